/* draw_object.c - see draw_object.h: bakes and classes of objects, what a view draws in which form, shadows.
 *
 * A bake is a (model, resolution) with its levels; a class is a (bake, heading): its objects look alike under
 * one light, up to size and shade. Slots of lit colours are numbered class * SV_LEVELS + level; shadow maps
 * one a class. */
#include "core/relief/draw_object.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/frames.h"
#include "core/relief/draw_object_mesh.h"
#include "core/relief/draw_object_relief.h"
#include "core/relief/object_sun.h"
#include "core/scene/id.h"

enum { LEVELS = 9 }; /* 2048 halved down to 8 */
/* A level is coarse enough for a picture when its texels are at most this large there, px, whatever the
 * plan allows: coarser ones blur. */
#define LEVEL_TEXEL_PX 1.0
/* All shadow maps of one sun together. Of 1,000 objects that stand each in its own way, each gets 113 x 113.
 */
#define SUN_BYTES_MAX (64u << 20)
enum { SUN_SIDE_MIN = 48, SUN_SIDE_MAX = 512 };

struct bake {
    int model, resolution, level_count;
    struct sv_relief_object level[LEVELS]; /* the finest first */
    struct sv_vec3 middle;                 /* of its box, model space */
    double radius;                         /* half its diagonal */
};

struct object_class {
    int bake;
    double heading_rad;
    struct sv_object_sun sun; /* of the current sun; block NULL: not made yet */
};

struct placed {
    int class_index;
    struct sv_relief_place at;
    struct sv_vec3 middle; /* world */
    double radius_m;
    bool shaded_known, taken_known; /* for the current sun: */
    double taken;                   /* share of sunlight that trees keep away */
    double shaded_m;                /* world height up to which other objects keep the sun from its middle */
};

struct candidate {
    double distance_m;
    int object;
    int level; /* -1: polygons */
};

struct sv_object_draw {
    const struct sv_scene *scene;
    struct bake *bakes;
    int bake_count;
    struct object_class *classes;
    int class_count;
    struct placed *placed; /* one an object */
    struct candidate *candidates;
    struct sv_object_mesh_entry *mesh_entries;
    struct sv_object_relief_entry *relief_entries;
    struct sv_object_meshes *meshes;
    struct sv_object_reliefs *reliefs;
    struct sv_vec3 to_sun; /* current; (0, 0, 0): none */
    int sun_side;
};

/* ---- making ---- */

struct sort_key {
    int model, resolution, object;
    double heading_rad;
};

static int compare_keys(const void *a, const void *b)
{
    const struct sort_key *p = a, *q = b;
    if (p->model != q->model)
        return p->model < q->model ? -1 : 1;
    if (p->resolution != q->resolution)
        return p->resolution < q->resolution ? -1 : 1;
    if (p->heading_rad != q->heading_rad)
        return p->heading_rad < q->heading_rad ? -1 : 1;
    return (p->object > q->object) - (p->object < q->object);
}

/* Numbers bakes and classes; arrays have room for every object. */
static enum sv_status classify(struct sv_object_draw *d, struct sv_error *error)
{
    int count = d->scene->object_count;
    struct sort_key *keys = malloc((size_t)count * sizeof *keys);
    if (!keys)
        return sv_fail(error, SV_ENOMEM, "objects", "no memory for %d objects", count);
    for (int k = 0; k < count; k++) {
        const struct sv_scene_object *o = &d->scene->objects[k];
        keys[k] = (struct sort_key){o->model, o->relief_resolution, k, o->heading_rad};
    }
    qsort(keys, (size_t)count, sizeof *keys, compare_keys);
    for (int k = 0; k < count; k++) {
        const struct sort_key *key = &keys[k], *last = k ? &keys[k - 1] : NULL;
        bool same_bake = last && last->model == key->model && last->resolution == key->resolution;
        if (!same_bake)
            d->bakes[d->bake_count++] = (struct bake){.model = key->model, .resolution = key->resolution};
        if (!same_bake || last->heading_rad != key->heading_rad)
            d->classes[d->class_count++] =
                (struct object_class){.bake = d->bake_count - 1, .heading_rad = key->heading_rad};
        d->placed[key->object].class_index = d->class_count - 1;
    }
    free(keys);
    return SV_OK;
}

/* The resolution of the next coarser level, or 0. */
static int coarser(int resolution)
{
    int next = (resolution + 1) / 2;
    return next >= SV_RELIEF_RESOLUTION_MIN && next < resolution ? next : 0;
}

static enum sv_status obtain_levels(struct sv_object_draw *d, struct bake *b, struct sv_store *store,
                                    struct sv_error *error)
{
    const struct sv_object_model *model = &d->scene->models[b->model];
    for (int r = b->resolution; r && b->level_count < LEVELS; r = coarser(r)) {
        enum sv_status status =
            sv_relief_object_obtain(&model->mesh, model->key, r, store, &b->level[b->level_count], error);
        if (status)
            return status;
        b->level_count++;
    }
    b->middle = sv_scale(sv_add(b->level[0].box_min, b->level[0].box_max), 0.5);
    b->radius = 0.5 * sv_length(sv_sub(b->level[0].box_max, b->level[0].box_min));
    return SV_OK;
}

enum sv_status sv_object_relief_prepare(const struct sv_tree_mesh *mesh, uint64_t key, int resolution,
                                        struct sv_store *store, struct sv_error *error)
{
    enum sv_status status = SV_OK;
    for (int r = resolution; r && !status; r = coarser(r)) {
        struct sv_relief_object made = {0};
        status = sv_relief_object_obtain(mesh, key, r, store, &made, error);
        sv_relief_object_finish(&made);
    }
    return status;
}

static void place_all(struct sv_object_draw *d)
{
    for (int k = 0; k < d->scene->object_count; k++) {
        const struct sv_scene_object *o = &d->scene->objects[k];
        struct placed *p = &d->placed[k];
        const struct bake *b = &d->bakes[d->classes[p->class_index].bake];
        p->at = (struct sv_relief_place){sv_vec3(o->x, o->y, o->z), o->height_m, o->heading_rad};
        p->middle = sv_madd(p->at.place, sv_rotate_clockwise(b->middle, o->heading_rad), o->height_m);
        p->radius_m = b->radius * o->height_m;
    }
}

static bool allocate(struct sv_object_draw *d)
{
    size_t n = (size_t)d->scene->object_count + 1;
    d->bakes = calloc(n, sizeof *d->bakes);
    d->classes = calloc(n, sizeof *d->classes);
    d->placed = calloc(n, sizeof *d->placed);
    d->candidates = calloc(n, sizeof *d->candidates);
    d->mesh_entries = calloc(n, sizeof *d->mesh_entries);
    d->relief_entries = calloc(n, sizeof *d->relief_entries);
    return d->bakes && d->classes && d->placed && d->candidates && d->mesh_entries && d->relief_entries;
}

enum sv_status sv_object_draw_create(const struct sv_scene *scene, struct sv_store *store,
                                     struct sv_object_draw **out, struct sv_error *error)
{
    struct sv_object_draw *d = calloc(1, sizeof *d);
    if (d)
        d->scene = scene;
    if (!d || !allocate(d)) {
        sv_object_draw_destroy(d);
        return sv_fail(error, SV_ENOMEM, "objects", "no memory for %d objects", scene->object_count);
    }
    enum sv_status status = classify(d, error);
    for (int k = 0; k < d->bake_count && !status; k++)
        status = obtain_levels(d, &d->bakes[k], store, error);
    if (!status)
        status =
            sv_object_meshes_create(scene->models, scene->model_count, d->class_count, &d->meshes, error);
    if (!status)
        status = sv_object_reliefs_create(d->class_count * LEVELS, &d->reliefs, error);
    if (status) {
        sv_object_draw_destroy(d);
        return status;
    }
    place_all(d);
    double share = sqrt((double)SUN_BYTES_MAX / 5 / (d->class_count + 1));
    d->sun_side = (int)sv_clamp(share, SUN_SIDE_MIN, SUN_SIDE_MAX);
    *out = d;
    return SV_OK;
}

void sv_object_draw_destroy(struct sv_object_draw *d)
{
    if (!d)
        return;
    sv_object_meshes_destroy(d->meshes);
    sv_object_reliefs_destroy(d->reliefs);
    for (int k = 0; k < d->bake_count; k++)
        for (int level = 0; level < d->bakes[k].level_count; level++)
            sv_relief_object_finish(&d->bakes[k].level[level]);
    for (int k = 0; k < d->class_count; k++)
        sv_object_sun_finish(&d->classes[k].sun);
    free(d->bakes);
    free(d->classes);
    free(d->placed);
    free(d->candidates);
    free(d->mesh_entries);
    free(d->relief_entries);
    free(d);
}

size_t sv_object_draw_relief_bytes(const struct sv_object_draw *d, int object)
{
    if (object < 0 || object >= d->scene->object_count)
        return 0;
    const struct bake *b = &d->bakes[d->classes[d->placed[object].class_index].bake];
    size_t texels = 0;
    for (int level = 0; level < b->level_count; level++)
        for (int k = 0; k < SV_RELIEF_FACES; k++)
            texels += (size_t)b->level[level].face[k].width * (size_t)b->level[level].face[k].height;
    return texels * (sizeof(float) + 4 + 4 * sizeof(int16_t) + 1); /* displ, colour, normal, kept */
}

/* ---- the sun ---- */

void sv_object_draw_sun(struct sv_object_draw *d, struct sv_vec3 to_sun)
{
    if (to_sun.x == d->to_sun.x && to_sun.y == d->to_sun.y && to_sun.z == d->to_sun.z)
        return;
    d->to_sun = to_sun;
    for (int k = 0; k < d->class_count; k++)
        sv_object_sun_finish(&d->classes[k].sun);
    for (int k = 0; k < d->scene->object_count; k++)
        d->placed[k].shaded_known = d->placed[k].taken_known = false;
    sv_object_meshes_new_sun(d->meshes);
}

void sv_object_draw_forget_trees(struct sv_object_draw *d)
{
    for (int k = 0; k < d->scene->object_count; k++)
        d->placed[k].taken_known = false;
}

/* The shadow map of an object's class, made when it is not there; NULL at night and without memory: then it
 * throws no shadow. */
static const struct sv_object_sun *want_sun(struct sv_object_draw *d, int class_index)
{
    struct object_class *c = &d->classes[class_index];
    if (!(d->to_sun.z > 0))
        return NULL;
    if (!c->sun.block) {
        const struct bake *b = &d->bakes[c->bake];
        /* As fine as the reliefs are, but for what a budget allows. */
        int side = (int)sv_clamp(2.0 * b->resolution, SUN_SIDE_MIN, d->sun_side);
        if (sv_object_sun_create(&d->scene->models[b->model].mesh, c->heading_rad, sv_scale(d->to_sun, -1),
                                 side, &c->sun, NULL) != SV_OK)
            return NULL;
    }
    return &c->sun;
}

void sv_object_draw_cast(void *context, struct sv_shadow_window *window)
{
    struct sv_object_draw *d = context;
    if (!(d->to_sun.z > 0))
        return;
    double side = window->side * window->texel_m;
    double flat = hypot(d->to_sun.x, d->to_sun.y) / d->to_sun.z; /* metres of shadow a metre of height */
    for (int k = 0; k < d->scene->object_count; k++) {
        const struct placed *p = &d->placed[k];
        /* Where the middle's shadow falls for ground between the window's lowest and the object's top. */
        double drop = p->middle.z + p->radius_m - (window->z0 + (double)window->ground_min);
        double reach = fmax(drop, 0) * flat, scale = reach / fmax(hypot(d->to_sun.x, d->to_sun.y), 1e-300);
        double x1 = p->middle.x - d->to_sun.x * scale, y1 = p->middle.y - d->to_sun.y * scale;
        double r = p->radius_m;
        if (fmax(p->middle.x, x1) + r < window->x0 || fmin(p->middle.x, x1) - r > window->x0 + side ||
            fmax(p->middle.y, y1) + r < window->y0 || fmin(p->middle.y, y1) - r > window->y0 + side)
            continue;
        const struct sv_object_sun *sun = want_sun(d, p->class_index);
        if (sun)
            sv_shadow_window_cast(window, &sun->silhouette, p->at.place, p->at.height_m);
    }
}

/* Height over the foot, in heights, up to which a silhouette keeps the sun from the vertical line at (x, y)
 * (heights from the foot); -INFINITY: nowhere. */
static double shade_top(const struct sv_object_sun *sun, double x, double y)
{
    const struct sv_silhouette *s = &sun->silhouette;
    struct sv_vec3 d = sv_sub(sv_vec3(x, y, 0), s->corner);
    double column = sv_dot(d, s->right) / sun->texel; /* right is level: the same for the whole line */
    if (!(column >= 0 && column < s->width))
        return -INFINITY;
    if (s->down.z > -1e-6) { /* straight down: the line is one texel, dark below where the body begins */
        double row = sv_dot(d, s->down) / sun->texel;
        size_t i = (size_t)fmax(row, 0) * (size_t)s->width + (size_t)column;
        return row >= 0 && row < s->height && s->coverage[i]
                   ? ((double)s->first[i] - sv_dot(d, s->travel)) / s->travel.z
                   : -INFINITY;
    }
    /* (d + z up) . down = (row + 0.5) texel, and down.z < 0: the first row that is covered is the highest z.
     */
    for (int row = 0; row < s->height; row++) {
        size_t i = (size_t)row * (size_t)s->width + (size_t)column;
        if (!s->coverage[i])
            continue;
        double z = (row * sun->texel - sv_dot(d, s->down)) / s->down.z;
        double depth = sv_dot(d, s->travel) + z * s->travel.z;
        return depth > (double)s->first[i] ? z : -INFINITY;
    }
    return -INFINITY;
}

/* World height up to which objects but `except` keep the sun away at (x, y); -INFINITY where none does. */
static double shadow_height(struct sv_object_draw *d, double x, double y, int except)
{
    double top = -INFINITY;
    if (!(d->to_sun.z > 0))
        return top;
    double level = hypot(d->to_sun.x, d->to_sun.y);
    for (int k = 0; k < d->scene->object_count; k++) {
        const struct placed *p = &d->placed[k];
        if (k == except)
            continue;
        double dx = x - p->middle.x, dy = y - p->middle.y;
        /* Distance sideways of the light's ground track, and behind along it. */
        double side = level > 0 ? (dx * d->to_sun.y - dy * d->to_sun.x) / level : hypot(dx, dy);
        double along = level > 0 ? -(dx * d->to_sun.x + dy * d->to_sun.y) / level : 0;
        if (fabs(side) > p->radius_m || along < -p->radius_m)
            continue;
        /* Light past the body's top is this high there: most objects are too far or too low. */
        double light = p->middle.z + (p->radius_m - along * d->to_sun.z) / fmax(level, 1e-9);
        if (light <= top)
            continue;
        const struct sv_object_sun *sun = want_sun(d, p->class_index);
        double h = p->at.height_m;
        double z = sun ? shade_top(sun, (x - p->at.place.x) / h, (y - p->at.place.y) / h) : -INFINITY;
        top = fmax(top, p->at.place.z + z * h);
    }
    return top;
}

/* ---- a view ---- */

static bool is_seen(const struct placed *p, const struct sv_gl_frame *frame)
{
    struct sv_vec3 c = sv_sub(p->middle, frame->camera.eye);
    for (int k = 0; k < 5; k++) {
        const double *plane = frame->planes[k];
        if (plane[0] * c.x + plane[1] * c.y + plane[2] * c.z + plane[3] < -p->radius_m)
            return false;
    }
    return true;
}

/* The form of an object: -1 polygons, else the level of its relief. */
static int choose_level(const struct sv_object_draw *d, int object, const struct sv_camera *camera,
                        double relief_texel_px)
{
    const struct placed *p = &d->placed[object];
    const struct bake *b = &d->bakes[d->classes[p->class_index].bake];
    if (!(relief_texel_px > 0))
        return -1;
    double px = sv_relief_object_texel_px(&b->level[0], &p->at, camera);
    if (!(px <= relief_texel_px))
        return -1;
    double limit = fmin(relief_texel_px, LEVEL_TEXEL_PX);
    int level = 0;
    while (level + 1 < b->level_count && px * b->level[level + 1].texel / b->level[0].texel <= limit)
        level++;
    return level;
}

static int nearest_first(const void *a, const void *b)
{
    const struct candidate *p = a, *q = b;
    if (p->distance_m != q->distance_m)
        return p->distance_m < q->distance_m ? -1 : 1;
    return (p->object > q->object) - (p->object < q->object);
}

static uint32_t find_candidates(struct sv_object_draw *d, const struct sv_gl_frame *frame,
                                double relief_texel_px)
{
    uint32_t count = 0;
    for (int k = 0; k < d->scene->object_count; k++) {
        if (!is_seen(&d->placed[k], frame))
            continue;
        struct sv_vec3 c = sv_sub(d->placed[k].middle, frame->camera.eye);
        bool level = frame->camera.projection == SV_PROJECTION_ORTHOGRAPHIC;
        d->candidates[count++] =
            (struct candidate){.distance_m = level ? sv_dot(c, frame->camera.forward) : sv_length(c),
                               .object = k,
                               .level = choose_level(d, k, &frame->camera, relief_texel_px)};
    }
    qsort(d->candidates, count, sizeof *d->candidates, nearest_first);
    return count;
}

/* World height below which an object is in the shade of the terrain or of other objects: the height hand-over
 * of paper 1, 3.3.2 (cast.h), with one height an object, taken at its middle. */
static double shade_height(struct sv_object_draw *d, const struct sv_object_draw_options *options, int object)
{
    struct placed *p = &d->placed[object];
    if (!options->shadows)
        return -INFINITY;
    if (!p->shaded_known) {
        p->shaded_m = shadow_height(d, p->middle.x, p->middle.y, object);
        p->shaded_known = true;
    }
    double z = p->shaded_m;
    if (options->ground)
        z = fmax(z, options->ground(options->ground_context, p->at.place.x, p->at.place.y)); /* NaN: not */
    return z > p->at.place.z ? z : -INFINITY;
}

/* Share of sunlight that trees keep from an object: the mean over places before its middle, as the sun sees
 * it. */
static double taken_by_trees(struct sv_object_draw *d, const struct sv_object_draw_options *options,
                             int object)
{
    static const double across[3] = {-0.6, 0, 0.6}, up[4] = {0.15, 0.4, 0.65, 0.9};
    struct placed *p = &d->placed[object];
    if (!options->shadows || !options->trees || !(d->to_sun.z > 0))
        return 0;
    if (p->taken_known)
        return p->taken;
    struct sv_vec3 right = sv_normalize(sv_cross(sv_vec3(0, 0, 1), d->to_sun));
    double left = 0, width = sqrt(fmax(p->radius_m * p->radius_m - p->at.height_m * p->at.height_m / 4, 0));
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 4; j++) {
            struct sv_vec3 at = sv_madd(p->middle, right, across[i] * width);
            at.z = p->at.place.z + up[j] * p->at.height_m;
            left += options->trees(options->trees_context, at) / 12;
        }
    p->taken = sv_clamp(1 - left, 0, 1);
    p->taken_known = true;
    return p->taken;
}

enum sv_status sv_object_draw_view(struct sv_object_draw *d, const struct sv_gl_frame *frame,
                                   const struct sv_object_draw_options *options,
                                   struct sv_object_draw_stats *stats, struct sv_error *error)
{
    if (!(options->relief_texel_px >= 0))
        return sv_fail(error, SV_EINVAL, "relief_texel_px", "is %g px, must be at least 0",
                       options->relief_texel_px);
    if (options->shadows)
        sv_object_draw_sun(d, frame->light.to_sun);
    struct sv_object_draw_stats own = {0};
    uint32_t count = find_candidates(d, frame, options->relief_texel_px), meshes = 0, reliefs = 0;
    for (uint32_t k = 0; k < count; k++) {
        const struct candidate *c = &d->candidates[k];
        const struct placed *p = &d->placed[c->object];
        const struct bake *b = &d->bakes[d->classes[p->class_index].bake];
        double shade = shade_height(d, options, c->object), taken = taken_by_trees(d, options, c->object);
        uint32_t id = SV_ID_OBJECT_FIRST + d->scene->objects[c->object].number;
        if (c->level < 0) {
            d->mesh_entries[meshes++] = (struct sv_object_mesh_entry){
                b->model, p->class_index, p->at, id, options->shadows ? want_sun(d, p->class_index) : NULL,
                shade,    taken};
            own.triangles += d->scene->models[b->model].mesh.index_count / 3;
        } else {
            d->relief_entries[reliefs++] = (struct sv_object_relief_entry){
                &b->level[c->level], p->class_index * LEVELS + c->level, p->at, id, shade, taken};
        }
    }
    own.polygon_objects = meshes;
    own.relief_objects = reliefs;
    own.culled_objects = (uint32_t)d->scene->object_count - count;
    enum sv_status status = sv_object_meshes_draw(d->meshes, frame, d->mesh_entries, meshes, error);
    struct sv_object_relief_stats warped = {0};
    if (!status)
        status = sv_object_reliefs_draw(d->reliefs, frame, options->layers, options->shadows,
                                        d->relief_entries, reliefs, &warped, error);
    own.texels = warped.texels;
    own.holes = warped.holes;
    own.holes_left = warped.holes_left;
    if (!status && stats)
        *stats = own;
    return status;
}
