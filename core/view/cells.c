/* cells.c - see cells.h. */
#include "core/view/cells.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/base/hash.h"
#include "core/cell/crown_warp.h"
#include "core/cell/panel_ground.h"
#include "core/relief/warp.h"
#include "core/view/cells_change.h"
#include "core/view/compose.h"
#include "core/view/panels.h"
#include "core/view/rings.h"
#include "core/view/soften.h"

/* Texels farther than the ground at their pixel by this share are behind it (crowns stand in the ground, and their
 * depth is that of their middle where they are far). */
#define BEHIND 0.01f
/* Pixels that a texel may be wide in the middle of the picture: crowns of larger ones are squares. */
#define TEXEL_PX_MAX 4

/* Rows beyond a band that its own depend on (soften.h). */
enum { APRON = 1 };
enum held { HELD_NOT, HELD_SHARED, HELD_OWN };

/* Panels that a view is drawn from. */
struct seen {
    int ring;
    enum sv_cell_face face;
    unsigned layer;
    enum held held; /* in the cache, or in memory of this process */
    bool open;
    struct sv_panel panel;
    struct sv_cell_cache_panel pin;
};

struct sv_cells {
    const struct sv_scene *scene;
    struct sv_direct *direct;
    struct sv_cells_options options;
    struct sv_panels *panels;
    struct sv_crown_buffer *crowns; /* of the last size and band */
    struct sv_warp_buffer ground;
    int width, height, row_first, row_count; /* of the band with its aprons */
    float *depth;                            /* window depth of what is opaque */
    float *near_depth;
    uint8_t (*near)[4]; /* trees within the innermost cube */
    float (*light)[4];
    uint8_t (*picture)[4]; /* ground and sky of all rows; those of the band are written */
    uint8_t (*rgba)[4];    /* the band's of it */
    uint8_t *hidden;
    struct seen seen[SV_CELLS_PANELS_MAX];
    int seen_count;
    bool full; /* a panel was drawn ahead for which the cache has no room: no other is, for that view */
};

enum sv_status sv_cells_create(const struct sv_scene *scene, struct sv_direct *direct,
                               const struct sv_cells_options *options, struct sv_cells **cells,
                               struct sv_error *error)
{
    struct sv_cells *c = calloc(1, sizeof *c);
    if (!c)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for cells");
    c->scene = scene;
    c->direct = direct;
    c->options = *options;
    enum sv_status status = sv_panels_create(scene, direct, &c->panels, error);
    if (status) {
        sv_cells_destroy(c);
        return status;
    }
    *cells = c;
    return SV_OK;
}

static void free_band(struct sv_cells *c)
{
    sv_crown_buffer_destroy(c->crowns);
    sv_warp_buffer_finish(&c->ground);
    free(c->depth);
    free(c->near_depth);
    free(c->near);
    free(c->light);
    free(c->picture);
    free(c->hidden);
    c->crowns = NULL;
    c->depth = c->near_depth = NULL;
    c->near = NULL;
    c->light = NULL;
    c->picture = NULL;
    c->hidden = NULL;
    c->width = 0;
}

void sv_cells_destroy(struct sv_cells *cells)
{
    if (!cells)
        return;
    free_band(cells);
    sv_panels_destroy(cells->panels);
    free(cells);
}

void sv_cells_use_slot(struct sv_cells *cells, unsigned slot)
{
    cells->options.slot = slot;
}

static enum sv_status want_band(struct sv_cells *c, const struct sv_camera *camera, int row_first,
                                int row_count, struct sv_error *error)
{
    int width = camera->width, height = camera->height;
    if (c->width == width && c->height == height && c->row_first == row_first && c->row_count == row_count)
        return SV_OK;
    free_band(c);
    size_t pixels = (size_t)width * (size_t)row_count;
    enum sv_status status = sv_crown_buffer_create(width, row_first, row_count, &c->crowns, error);
    if (!status)
        status = sv_warp_buffer_create(width, height, &c->ground, error);
    if (status)
        return status;
    sv_warp_buffer_limit(&c->ground, row_first, row_first + row_count);
    c->depth = malloc(pixels * sizeof *c->depth);
    c->near_depth = malloc(pixels * sizeof *c->near_depth);
    c->near = malloc(pixels * sizeof *c->near);
    c->light = malloc(pixels * sizeof *c->light);
    c->picture = malloc((size_t)width * (size_t)height * sizeof *c->picture);
    c->hidden = malloc(pixels);
    if (!c->depth || !c->near_depth || !c->near || !c->light || !c->picture || !c->hidden)
        return sv_fail(error, SV_ENOMEM, "relief", "no memory for %zu pixels", pixels);
    c->rgba = c->picture + (size_t)row_first * (size_t)width;
    c->width = width;
    c->height = height;
    c->row_first = row_first;
    c->row_count = row_count;
    return SV_OK;
}

/* ---- which panels ---- */

bool sv_cells_can(const struct sv_resolved_view *view, unsigned layers)
{
    return view->camera.projection == SV_PROJECTION_PERSPECTIVE && !view->plan.raycast &&
           view->plan.samples == 1 && layers == 1u << SV_LAYER_COLOR &&
           2 * sv_camera_focal_px(&view->camera) <= TEXEL_PX_MAX * view->plan.relief_resolution &&
           (!view->plan.draw_trees || view->plan.trees == SV_TREES_AUTO);
}

struct frame {
    const struct sv_resolved_view *view;
    int row_first, row_end; /* of the picture that is drawn */
    bool sky;
    bool all;      /* from all rings of panels; else from what pays */
    bool ahead;    /* only builds, */
    uint32_t most; /* so many panels */
    struct sv_view_rings at;
    int first;       /* innermost ring of crowns that is drawn from panels; what is nearer is drawn directly */
    int ground_ring; /* -1: drawn directly */
    int size;
    struct sv_cell_light light;
    uint64_t light_key, scene_key;
    double planes[5][4];
    struct sv_cells_report *report;
};

/* What a face holds is where forward >= D and right and up within +- forward: the hull of four corners and four
 * directions. Out of view when all of them are outside of one plane. */
static bool face_in_view(const struct frame *f, struct sv_vec3 v, double distance_m, enum sv_cell_face face)
{
    struct sv_vec3 right, up, forward;
    struct sv_vec3 from = sv_sub(v, f->view->camera.eye);
    sv_cell_face_axes(face, &right, &up, &forward);
    for (int p = 0; p < 5; p++) {
        const double *n = f->planes[p];
        struct sv_vec3 normal = {n[0], n[1], n[2]};
        bool inside = false;
        for (int k = 0; k < 4 && !inside; k++) {
            struct sv_vec3 d = sv_madd(sv_madd(forward, right, k & 1 ? 1 : -1), up, k & 2 ? 1 : -1);
            inside = sv_dot(normal, d) > 0 || sv_dot(normal, sv_madd(from, d, distance_m)) + n[3] >= 0;
        }
        if (!inside)
            return false;
    }
    return true;
}

static double now(const struct sv_cells *c)
{
    return c->options.clock_ms ? c->options.clock_ms() : 0;
}

static void put_back(struct sv_cells *c, struct seen *s)
{
    if (s->held == HELD_SHARED)
        sv_cell_cache_unpin(c->options.cache, c->options.slot, &s->pin);
    else if (s->held == HELD_OWN)
        free(s->pin.data);
}

static void release(struct sv_cells *c)
{
    for (int k = 0; k < c->seen_count; k++)
        put_back(c, &c->seen[k]);
    c->seen_count = 0;
}

static struct sv_cell_cache_label label_of(const struct frame *f, const struct seen *s)
{
    struct sv_cell_cache_label label = {.parts = {.place = f->at.chain[s->ring],
                                                  .face = s->face,
                                                  .layer = (int)s->layer,
                                                  .size = f->size,
                                                  .light = f->light_key,
                                                  .scene = f->scene_key},
                                        .shell = sv_cell_shell(&f->at.rings, &f->at.chain[s->ring], f->at.top),
                                        .light = f->light};
    label.key = sv_cell_key(&f->at.rings, &label.parts);
    return label;
}

/* Tells others that the panel is being built; false where they build it, or there is no room. */
static bool claim(struct sv_cells *c, const struct sv_cell_cache_label *label, struct seen *s)
{
    if (sv_cell_cache_reserve(c->options.cache, c->options.slot, label, 1, false, c->scene->generation, now(c) * 1e-3,
                              &s->pin) == SV_CELL_CACHE_GRANTED)
        s->held = HELD_SHARED;
    return s->held == HELD_SHARED;
}

/* Memory for a panel that is drawn: in the cache where it is claimed, or of this process where the cache has none to
 * give, if it must be. */
static enum sv_status make_place(struct sv_cells *c, size_t bytes, bool must, struct seen *s, struct sv_error *error)
{
    if (s->held == HELD_SHARED && !sv_cell_cache_fit(c->options.cache, c->options.slot, &s->pin, bytes, now(c) * 1e-3))
        s->held = HELD_NOT;
    if (s->held == HELD_SHARED || !must)
        return SV_OK;
    s->pin = (struct sv_cell_cache_panel){.data = aligned_alloc(4096, (bytes + 4095) / 4096 * 4096), .bytes = bytes};
    if (!s->pin.data)
        return sv_fail(error, SV_ENOMEM, "relief", "no memory for a panel of %zu bytes", bytes);
    s->held = HELD_OWN;
    return SV_OK;
}

static struct sv_panels_order order_of(const struct frame *f, const struct sv_cell_cache_label *label)
{
    return (struct sv_panels_order){.about = {.key = label->key,
                                              .place = label->parts.place,
                                              .distance_m = label->shell.distance_m,
                                              .face = label->parts.face,
                                              .size = f->size,
                                              .layers = (unsigned)label->parts.layer},
                                    .shell = label->shell,
                                    .view = f->view};
}

/* What a whole panel of the view is, in panels of 1024 x 1024. */
static double panel_work(const struct frame *f)
{
    return f->size / 1024.0 * f->size / 1024.0;
}

/* The level (core/cell/admit.h) that needs a panel of that ring: ground that is nearer than all crowns counts as theirs. */
static int level_of(const struct frame *f, int ring)
{
    return f->at.rings.count - (ring > f->at.crowns_first ? ring : f->at.crowns_first);
}

static enum sv_status build(struct sv_cells *c, const struct frame *f, const struct sv_cell_cache_label *label,
                            bool must, struct seen *s, struct sv_error *error)
{
    double since = now(c);
    struct sv_panels_order order = order_of(f, label);
    enum sv_status status = sv_panels_size(c->panels, &order, &order.about.size, error);
    if (status)
        return status;
    if (!claim(c, label, s) && !must)
        return SV_OK;
    size_t bytes;
    status = sv_panels_draw(c->panels, &order, &bytes, error);
    if (!status)
        status = make_place(c, bytes, !f->ahead, s, error);
    c->full = !status && s->held == HELD_NOT;
    if (status || c->full)
        return status;
    status = sv_panels_write(c->panels, s->pin.data, bytes, error);
    if (status)
        return status;
    double ms = now(c) - since;
    if (s->held == HELD_SHARED)
        sv_cell_cache_commit(c->options.cache, c->options.slot, &s->pin, bytes, ms * 1e-3, now(c) * 1e-3);
    sv_cell_cache_built(c->options.cache, level_of(f, s->ring), s->layer == SV_PANEL_GROUND, panel_work(f), ms * 1e-3);
    f->report->built++;
    f->report->ms[SV_STAGE_CELL] = fmax(f->report->ms[SV_STAGE_CELL], 0) + ms;
    return SV_OK;
}

static bool find(struct sv_cells *c, const struct sv_cell_cache_label *label, struct seen *s)
{
    if (sv_cell_cache_find(c->options.cache, c->options.slot, label->key, c->scene->generation, now(c) * 1e-3,
                           &s->pin) == SV_CELL_CACHE_HIT)
        s->held = HELD_SHARED;
    return s->held == HELD_SHARED;
}

static enum sv_status obtain(struct sv_cells *c, const struct frame *f, bool must, struct seen *s,
                             struct sv_error *error)
{
    struct sv_cell_cache_label label = label_of(f, s);
    enum sv_status status = SV_OK;
    bool hit = s->held != HELD_NOT || find(c, &label, s);
    f->report->hits += hit;
    if (!hit && f->report->built >= f->most)
        f->report->left++;
    else if (!hit && !c->full)
        status = build(c, f, &label, must, s, error);
    if (status || s->held == HELD_NOT)
        return status;
    status = sv_panel_open(s->pin.data, s->pin.bytes, &s->panel, error);
    s->open = !status;
    if (s->open && hit) /* one of less than full size shows nothing */
        f->report->refined += s->pin.refined || s->panel.about.size < f->size;
    return status;
}

static void want(struct sv_cells *c, const struct frame *f, int ring, double distance_m, unsigned layer)
{
    for (int face = 0; face < SV_CELL_FACES; face++)
        if (face_in_view(f, f->at.chain[ring].v, distance_m, (enum sv_cell_face)face))
            c->seen[c->seen_count++] = (struct seen){.ring = ring, .face = (enum sv_cell_face)face, .layer = layer};
}

static void want_all(struct sv_cells *c, const struct frame *f)
{
    if (f->ground_ring >= 0)
        want(c, f, f->ground_ring, f->at.rings.distance_m[f->ground_ring], SV_PANEL_GROUND);
    for (int ring = f->at.crowns_first; ring < f->at.rings.count && f->view->plan.draw_trees; ring++)
        want(c, f, ring, f->at.rings.distance_m[ring] / 2, SV_PANEL_CROWNS);
}

static uint64_t key_of_ring(const struct frame *f, int ring)
{
    return sv_cell_key(&f->at.rings, &(struct sv_cell_key_parts){.place = f->at.chain[ring],
                                                                 .size = f->size,
                                                                 .light = f->light_key,
                                                                 .scene = f->scene_key});
}

/* Which rings to draw from, by what is there of them. SV_ENOENT: none. Panels of the others are put back. */
static enum sv_status choose_rings(struct sv_cells *c, struct frame *f, struct sv_error *error)
{
    const struct sv_camera *camera = &f->view->camera;
    struct sv_cell_admit_request request = {.now_s = now(c) * 1e-3,
                                            .pixels = (int64_t)camera->width * camera->height,
                                            .rings = level_of(f, f->at.crowns_first)};
    for (int k = 1; k <= request.rings; k++)
        request.ring[k - 1].key = key_of_ring(f, f->at.rings.count - k);
    for (int k = 0; k < c->seen_count; k++) {
        struct seen *s = &c->seen[k];
        struct sv_cell_cache_label label = label_of(f, s);
        bool ground = s->layer == SV_PANEL_GROUND;
        int ring = level_of(f, s->ring) - 1;
        if (!find(c, &label, s))
            *(ground ? &request.ring[ring].ground : &request.ring[ring].crowns) += panel_work(f);
    }
    struct sv_cell_admit_answer answer = sv_cell_cache_admit(c->options.cache, &request);
    if (answer.level == 0)
        return sv_fail(error, SV_ENOENT, "relief", "no panels that are there, or worth building, save anything");
    int kept = 0;
    for (int k = 0; k < c->seen_count; k++)
        if (level_of(f, c->seen[k].ring) <= answer.level)
            c->seen[kept++] = c->seen[k];
        else
            put_back(c, &c->seen[k]);
    c->seen_count = kept;
    f->first = f->at.rings.count - answer.level;
    if (f->ground_ring >= 0 && level_of(f, f->ground_ring) > answer.level)
        f->ground_ring = -1;
    return SV_OK;
}

/* What others are building is left for the end: two processes that want the same panels share the work. */
static enum sv_status obtain_all(struct sv_cells *c, struct frame *f, struct sv_error *error)
{
    enum sv_status status = SV_OK;
    want_all(c, f);
    if (!f->all)
        status = choose_rings(c, f, error);
    c->full = false;
    for (int round = 0; round < (f->ahead ? 1 : 2); round++)
        for (int k = 0; k < c->seen_count && !status; k++)
            if (!c->seen[k].open)
                status = obtain(c, f, round > 0, &c->seen[k], error);
    return status;
}

/* All of the light that panels hold, and of the scene but what patches change: panels of another key are others. Where
 * the forest's numbers count from is a matter of rounding. */
static enum sv_status make_keys(const struct sv_cells *c, struct frame *f, struct sv_error *error)
{
    const struct sv_resolved_view *v = f->view;
    enum sv_status status = sv_direct_light(c->direct, v, &f->light, error);
    uint64_t h = sv_hash_double(sv_hash_double(SV_HASH_INIT, v->sun.azimuth_rad), v->sun.elevation_rad);
    h = sv_hash_u64(h, (uint64_t)v->plan.shadows | (uint64_t)v->air << 1 | (uint64_t)v->plan.draw_trees << 2);
    f->light_key = sv_hash_double(sv_hash_double(h, v->plan.tree_error_px), f->light.texel_m);
    struct sv_vec3 o = c->scene->forest.origin;
    h = sv_hash_u64(SV_HASH_INIT, sv_scene_loaded_version(c->scene));
    f->scene_key = sv_hash_done(sv_hash_double(sv_hash_double(sv_hash_double(h, o.x), o.y), o.z));
    return status;
}

/* Top and bottom of a band of rows, half a pixel outside of it as sv_camera_planes has them. */
static void band_planes(const struct sv_camera *camera, int first, int end, double planes[5][4])
{
    double focal = sv_camera_focal_px(camera), middle = 0.5 * camera->height;
    double top = (middle - first + 0.5) / focal, bottom = (middle - end - 0.5) / focal;
    struct sv_vec3 below_top = sv_normalize(sv_sub(sv_scale(camera->forward, top), camera->up));
    struct sv_vec3 above_bottom = sv_normalize(sv_sub(camera->up, sv_scale(camera->forward, bottom)));
    const struct sv_vec3 normals[2] = {below_top, above_bottom};
    for (int k = 0; k < 2; k++) {
        planes[2 + k][0] = normals[k].x;
        planes[2 + k][1] = normals[k].y;
        planes[2 + k][2] = normals[k].z;
        planes[2 + k][3] = 0;
    }
}

/* Where the eye is among cells, and what all of its picture sees. */
static enum sv_status look_around(struct sv_cells *c, struct frame *f, struct sv_error *error)
{
    const struct sv_resolved_view *view = f->view;
    f->size = view->plan.relief_resolution;
    if (!sv_view_rings(view, &f->at))
        return sv_fail(error, SV_EINVAL, "relief_distance", "there are no cells of that distance here");
    f->first = f->at.crowns_first;
    f->ground_ring = sv_panels_free_ring(c->panels, &f->at.rings, f->at.chain);
    enum sv_status status = make_keys(c, f, error);
    if (status)
        return status;
    sv_camera_planes(&view->camera, f->planes);
    return SV_OK;
}

static enum sv_status choose(struct sv_cells *c, struct frame *f, struct sv_error *error)
{
    const struct sv_resolved_view *view = f->view;
    enum sv_status status = look_around(c, f, error);
    if (status)
        return status;
    band_planes(&view->camera, f->row_first, f->row_end, f->planes);
    f->report->id = key_of_ring(f, f->at.crowns_first);
    status = obtain_all(c, f, error);
    f->report->ground_direct = f->ground_ring < 0;
    f->report->level = level_of(f, f->first);
    return status;
}

/* ---- what is opaque ---- */

/* What stands on the ground besides trees cannot be shaded by depth alone. */
static bool has_objects(const struct sv_cells *c)
{
    return c->scene->object_count > 0;
}

static enum sv_status draw_ground_directly(struct sv_cells *c, const struct frame *f, struct sv_error *error)
{
    struct sv_direct_pass pass = {.layers = 1u << SV_LAYER_DEPTH, .sky = f->sky};
    struct sv_picture picture = {0};
    if (has_objects(c))
        pass.layers |= 1u << SV_LAYER_COLOR;
    enum sv_status status = sv_picture_alloc(&f->view->camera, pass.layers, &picture, error);
    if (!status)
        status = sv_direct_draw(c->direct, f->view, &pass, &picture, NULL, error);
    if (!status) {
        size_t skip = (size_t)c->row_first * (size_t)c->width,
               pixels = (size_t)c->row_count * (size_t)c->width;
        memcpy(c->depth, (const float *)picture.layer[SV_LAYER_DEPTH].data + skip, pixels * sizeof *c->depth);
        if (has_objects(c))
            memcpy(c->rgba, (const uint8_t *)picture.layer[SV_LAYER_COLOR].data + 4 * skip, 4 * pixels);
        else
            memset(c->rgba, 0, 4 * pixels);
    }
    sv_picture_finish(&picture);
    return status;
}

/* Ground sources among what is seen. No ground is before its cube's faces. */
static unsigned ground_sources(const struct sv_cells *c, const struct frame *f,
                               struct sv_warp_source sources[SV_CELL_FACES])
{
    unsigned count = 0;
    for (int k = 0; k < c->seen_count; k++) {
        const struct seen *s = &c->seen[k];
        const struct sv_panel_ground *ground = &s->panel.ground;
        if (ground->rows == 0)
            continue;
        struct sv_warp_source *to = &sources[count++];
        *to = (struct sv_warp_source){.width = ground->size,
                                      .height = ground->rows,
                                      .t = ground->q,
                                      .color = ground->color,
                                      .cut = SV_PANEL_GROUND_CUT * 2 / (float)ground->size,
                                      .row0 = ground->first,
                                      .t_most = 1};
        struct sv_sweep sweep = {.v = s->panel.about.place.v,
                                 .distance_m = s->panel.about.distance_m,
                                 .face = s->face,
                                 .size = ground->size,
                                 .reach = sv_panels_ground_reach(ground->size)};
        sv_panel_ground_map(&sweep, &f->view->camera, 0, 0, &to->map);
    }
    return count;
}

static void warp_ground(struct sv_cells *c, const struct frame *f)
{
    struct sv_warp_source sources[SV_CELL_FACES];
    struct sv_warp_stats stats = {0};
    size_t pixels = (size_t)c->row_count * (size_t)c->width;
    unsigned count = ground_sources(c, f, sources);
    sv_warp_clear(&c->ground);
    for (unsigned k = 0; k < count; k++)
        sv_warp_splat(&sources[k], k, &c->ground, &stats);
    sv_warp_fill(sources, count, &c->ground, &stats);
    memcpy(c->depth, c->ground.depth + (size_t)c->row_first * (size_t)c->width, pixels * sizeof *c->depth);
    f->report->hole_pixels = stats.holes;
    f->report->holes_left = stats.holes_left;
}

/* The ground's colour where crowns let anything through. */
static void color_ground(struct sv_cells *c, const struct frame *f)
{
    struct sv_warp_source sources[SV_CELL_FACES];
    size_t pixels = (size_t)c->row_count * (size_t)c->width;
    const float(*light)[4] = (const float(*)[4])c->light;
    uint32_t *texel = c->ground.texel + (size_t)c->row_first * (size_t)c->width;
    for (size_t k = 0; k < pixels; k++)
        texel[k] |= light[k][3] < SV_CROWN_PASS_MIN ? SV_WARP_EMPTY : 0;
    memset(c->rgba, 0, 4 * pixels);
    unsigned count = ground_sources(c, f, sources);
    sv_warp_resolve(sources, count, &c->ground, c->picture);
}

/* What crowns let through: sky where no ground is, and ground that has no colour yet. */
static enum sv_status shade_behind(struct sv_cells *c, const struct frame *f, struct sv_error *error)
{
    size_t pixels = (size_t)c->row_count * (size_t)c->width;
    bool direct = f->ground_ring < 0;
    if (direct ? has_objects(c) : !f->sky)
        return SV_OK;
    const float(*light)[4] = (const float(*)[4])c->light, *depth = c->depth;
    uint8_t *restrict hidden = c->hidden;
    float nearest = direct ? INFINITY : 0;
    for (size_t k = 0; k < pixels; k++)
        hidden[k] = (uint8_t)((light[k][3] < SV_CROWN_PASS_MIN) | (depth[k] > nearest));
    return sv_direct_shade_ground(c->direct, f->view, f->sky, c->row_first, c->row_count, c->depth, c->hidden,
                                  c->rgba[0], error);
}

/* ---- crowns ---- */

static void clear_light(struct sv_cells *c, size_t pixels)
{
    for (size_t k = 0; k < pixels; k++) {
        c->light[k][0] = c->light[k][1] = c->light[k][2] = 0;
        c->light[k][3] = 1;
    }
}

/* Trees within the cube of the innermost ring that is drawn from panels are in front of all others: the first light.
 * Where that is the innermost of all, leaves are pixels large: one sample a pixel, softened. */
static enum sv_status draw_near(struct sv_cells *c, const struct frame *f, struct sv_draw_stats *stats,
                                struct sv_error *error)
{
    bool all = f->first == f->at.crowns_first;
    struct sv_tree_shell shell = {.inner_m = -1,
                                  .outer = f->at.chain[f->first].v,
                                  .outer_m = f->at.rings.distance_m[f->first]};
    struct sv_canvas canvas = {.width = c->width,
                               .height = f->view->camera.height,
                               .row_first = c->row_first,
                               .row_count = c->row_count,
                               .depth = c->near_depth,
                               .color = c->near[0]};
    struct sv_resolved_view view = *f->view;
    size_t pixels = (size_t)c->row_count * (size_t)c->width;
    bool any = false;
    enum sv_status status = sv_direct_sees_trees(c->direct, &view, &shell, &any, error);
    if (status || !any) {
        clear_light(c, pixels);
        return status;
    }
    if (all)
        view.plan.leaf_samples = 1;
    memcpy(c->near_depth, c->depth, pixels * sizeof *c->depth);
    memset(c->near, 0, pixels * sizeof *c->near);
    status = sv_direct_draw_trees(c->direct, &view, &shell, &canvas, stats, error);
    return status ? status
                  : sv_soften(c->width, c->row_count, all ? SV_SOFTEN_SIDE : 0, (const uint8_t(*)[4])c->near, c->light,
                              error);
}

static void warp_crowns(struct sv_cells *c, const struct frame *f)
{
    sv_crown_buffer_begin(c->crowns);
    sv_crown_buffer_close(c->crowns, (const float(*)[4])c->light);
    for (int ring = f->first; ring < f->at.rings.count; ring++) {
        struct sv_crown_source sources[SV_CELL_FACES];
        unsigned count = 0;
        for (int k = 0; k < c->seen_count; k++) {
            const struct seen *s = &c->seen[k];
            if (s->ring != ring || s->panel.crowns.size == 0)
                continue;
            sources[count].layer = &s->panel.crowns;
            sv_crown_map(s->panel.about.place.v, s->panel.about.distance_m, s->face, &f->view->camera, 0, 0,
                         sources[count++].m);
        }
        if (count == 0)
            continue;
        sv_crown_buffer_clear(c->crowns);
        sv_crown_splat(sources, count, c->crowns, NULL);
        sv_crown_resolve(sources, count, c->crowns, c->depth, BEHIND, c->light);
    }
}

/* Light over what is behind it, the band's own rows alone. */
static void compose(const struct sv_cells *c, int row_first, int row_count, uint8_t *rgba)
{
    size_t skip = (size_t)(row_first - c->row_first) * (size_t)c->width;
    sv_compose((size_t)c->width * (size_t)row_count, (const float(*)[4])(c->light + skip),
               (const uint8_t(*)[4])(c->rgba + skip), (uint8_t(*)[4])rgba);
}

static double since(const struct sv_cells *c, struct sv_cells_report *report, enum sv_stage stage,
                    double from)
{
    double t = now(c);
    report->ms[stage] = fmax(report->ms[stage], 0) + t - from;
    return t;
}

static void clear(struct sv_cells_report *report)
{
    *report = (struct sv_cells_report){0};
    for (int k = 0; k < SV_STAGE_COUNT; k++)
        report->ms[k] = -1;
}

enum sv_status sv_cells_wanted(struct sv_cells *cells, const struct sv_resolved_view *view,
                               struct sv_cells_panel panels[SV_CELLS_PANELS_MAX], int *count,
                               struct sv_error *error)
{
    struct sv_cells_report report;
    struct frame f = {.view = view, .row_end = view->camera.height, .report = &report};
    enum sv_status status = look_around(cells, &f, error);
    if (status)
        return status;
    want_all(cells, &f);
    for (int k = 0; k < cells->seen_count; k++) {
        panels[k].label = label_of(&f, &cells->seen[k]);
        panels[k].order = order_of(&f, &panels[k].label);
    }
    *count = cells->seen_count;
    release(cells);
    return SV_OK;
}

enum sv_status sv_cells_build(struct sv_cells *cells, const struct sv_resolved_view *view, uint32_t most,
                              struct sv_cells_report *report, struct sv_error *error)
{
    struct frame f = {.view = view,
                      .row_end = view->camera.height,
                      .all = true,
                      .ahead = true,
                      .most = most,
                      .report = report};
    clear(report);
    enum sv_status status = choose(cells, &f, error);
    release(cells);
    return status;
}

enum sv_status sv_cells_draw(struct sv_cells *cells, const struct sv_resolved_view *view, bool sky, int row_first,
                             int row_count, bool all, uint8_t *rgba, struct sv_cells_report *report,
                             struct sv_draw_stats *stats, struct sv_error *error)
{
    struct sv_cells *c = cells;
    int height = view->camera.height, end = row_first + row_count;
    struct frame f = {.view = view,
                      .row_first = row_first > APRON ? row_first - APRON : 0,
                      .row_end = end + APRON < height ? end + APRON : height,
                      .sky = sky,
                      .all = all,
                      .most = UINT32_MAX,
                      .report = report};
    clear(report);
    enum sv_status status = want_band(c, &view->camera, f.row_first, f.row_end - f.row_first, error);
    if (!status)
        status = choose(c, &f, error);
    double t = now(c);
    if (!status && f.ground_ring < 0)
        status = draw_ground_directly(c, &f, error);
    else if (!status)
        warp_ground(c, &f);
    t = since(c, report, f.ground_ring < 0 ? SV_STAGE_NEAR : SV_STAGE_WARP, t);
    if (!status)
        status = draw_near(c, &f, stats, error);
    t = since(c, report, SV_STAGE_NEAR, t);
    if (!status)
        warp_crowns(c, &f);
    if (!status && f.ground_ring >= 0)
        color_ground(c, &f);
    release(c);
    t = since(c, report, SV_STAGE_WARP, t);
    if (!status)
        status = shade_behind(c, &f, error);
    if (!status)
        compose(c, row_first, row_count, rgba);
    since(c, report, SV_STAGE_COMPOSITE, t);
    return status;
}

void sv_cells_changed(struct sv_cells *cells, const struct sv_scene_change *change)
{
    (void)sv_cells_change_drop(cells->options.cache, cells->scene, change, now(cells) * 1e-3);
}
