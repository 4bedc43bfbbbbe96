/* cells_change.c - see cells_change.h. */
#include "core/view/cells_change.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/cell/panel.h"
#include "core/terrain/shadow_page.h"

/* Lights that are kept at a time, and pieces of a sweep at most. */
enum { LIGHTS = 8, PIECES_MAX = 512 };
/* Light from lower than that casts nothing (core/terrain/shadow_window.h). */
static const double LOWEST_SUN_Z = 0.004;
/* Texels that drawing spreads over: splats and edges. */
static const double DRAWN_TEXELS = 2;
/* Shadows on the ground are read from texels of up to 1.4 pixels, of which one on the ground is at most five
 * as long as across (core/terrain/shadow_page.h), and spread over 3 of them. */
static const double SHADOW_TEXELS = 3 * 1.4 * 5;
/* Silhouettes spread by a texel of theirs, of the body's height. */
static const double SILHOUETTE_SHARE = 1.0 / 32;
/* Crowns are lit by texels of the picture of light, which both who shades and who is shaded are grown by. */
static const double LIGHT_TEXELS = 4;

struct box {
    struct sv_vec3 low, high;
};

/* Boxes that hold all that the shadows of the change fall on, and objects that they touch. */
struct sweep {
    struct sv_vec3 to_sun;
    struct box *pieces; /* heap */
    size_t piece_count, room;
    bool *touched; /* heap; of the scene's objects */
};

struct sv_cells_change {
    const struct sv_scene *scene;
    const struct sv_scene_change *change;
    double tallest_m, widest_m; /* of the trees of now; the latter from foot to crown's edge */
    struct sweep sweeps[LIGHTS];
    unsigned next; /* sweep to give way */
};

static struct box grown(struct box b, double across_m, double up_m)
{
    struct sv_vec3 by = sv_vec3(across_m, across_m, up_m);
    return (struct box){sv_sub(b.low, by), sv_add(b.high, by)};
}

static bool overlap(const struct box *a, const struct box *b)
{
    return a->low.x <= b->high.x && b->low.x <= a->high.x && a->low.y <= b->high.y && b->low.y <= a->high.y &&
           a->low.z <= b->high.z && b->low.z <= a->high.z;
}

static struct box changed_box(const struct sv_scene_change *change, uint32_t k)
{
    const struct sv_change_box *b = &change->boxes[k];
    return (struct box){sv_vec3(b->min[0], b->min[1], b->min[2]), sv_vec3(b->max[0], b->max[1], b->max[2])};
}

static struct box object_box(const struct sv_scene *scene, int k)
{
    const struct sv_scene_object *o = &scene->objects[k];
    double r = o->height_m * (double)scene->models[o->model].mesh.radius;
    return (struct box){sv_vec3(o->x - r, o->y - r, o->z), sv_vec3(o->x + r, o->y + r, o->z + o->height_m)};
}

/* ---- sweeps ---- */

/* From where to where along the light, m, a box may throw its shadow: from some way towards the sun, as light
 * passes trees in an order that is theirs but for their size (core/tree/shade_stand.c), down to the lowest
 * ground or off the field. */
static void sweep_range(const struct sv_cells_change *c, struct sv_vec3 to_sun, const struct box *b,
                        double *from, double *to)
{
    const struct sv_heightfield *f = &c->scene->terrain.field;
    double across = hypot(to_sun.x, to_sun.y), down = fmax(to_sun.z, LOWEST_SUN_Z);
    double size = hypot((f->width - 1) * f->dx, (f->height - 1) * f->dy);
    *from = -(c->tallest_m + 2 * c->widest_m + b->high.z - b->low.z);
    *to = fmax(b->high.z - (f->z0 + (double)f->h_min), 0) / down;
    if (across * *to > size)
        *to = size / across;
}

static bool put_piece(struct sweep *s, struct box piece)
{
    if (s->piece_count == s->room) {
        size_t room = s->room ? 2 * s->room : 64;
        struct box *pieces = realloc(s->pieces, room * sizeof *pieces);
        if (!pieces)
            return false;
        s->pieces = pieces;
        s->room = room;
    }
    s->pieces[s->piece_count++] = piece;
    return true;
}

static bool sweep_box(const struct sv_cells_change *c, struct sweep *s, const struct box *b)
{
    double from, to, height = b->high.z - b->low.z, side = fmin(b->high.x - b->low.x, b->high.y - b->low.y);
    sweep_range(c, s->to_sun, b, &from, &to);
    int count = (int)fmin(ceil((to - from) / fmax(fmax(height, side), 1)), PIECES_MAX);
    for (int k = 0; k < count; k++) {
        struct sv_vec3 a = sv_scale(s->to_sun, -(from + (to - from) * k / count));
        struct sv_vec3 e = sv_scale(s->to_sun, -(from + (to - from) * (k + 1) / count));
        struct box piece = {sv_add(b->low, sv_vec3(fmin(a.x, e.x), fmin(a.y, e.y), fmin(a.z, e.z))),
                            sv_add(b->high, sv_vec3(fmax(a.x, e.x), fmax(a.y, e.y), fmax(a.z, e.z)))};
        double spread = SILHOUETTE_SHARE * height;
        if (!put_piece(s, grown(piece, spread, spread)))
            return false;
    }
    return true;
}

static void sweep_finish(struct sweep *s)
{
    free(s->pieces);
    free(s->touched);
    *s = (struct sweep){0};
}

static bool sweep_init(const struct sv_cells_change *c, struct sv_vec3 to_sun, struct sweep *s)
{
    int objects = c->scene->object_count;
    *s = (struct sweep){.to_sun = to_sun, .touched = calloc((size_t)objects + 1, sizeof *s->touched)};
    bool good = s->touched;
    for (uint32_t k = 0; k < c->change->box_count && good; k++) {
        struct box b = changed_box(c->change, k);
        good = sweep_box(c, s, &b);
    }
    for (int k = 0; k < objects && good; k++) {
        struct box b = object_box(c->scene, k);
        for (size_t p = 0; p < s->piece_count && !s->touched[k]; p++)
            s->touched[k] = overlap(&s->pieces[p], &b);
    }
    if (!good)
        sweep_finish(s);
    return good;
}

/* NULL: no memory. */
static const struct sweep *sweep_under(struct sv_cells_change *c, struct sv_vec3 to_sun)
{
    for (int k = 0; k < LIGHTS; k++) {
        const struct sweep *s = &c->sweeps[k];
        if (s->touched && s->to_sun.x == to_sun.x && s->to_sun.y == to_sun.y && s->to_sun.z == to_sun.z)
            return s;
    }
    struct sweep *s = &c->sweeps[c->next++ % LIGHTS];
    sweep_finish(s);
    return sweep_init(c, to_sun, s) ? s : NULL;
}

/* ---- panels ---- */

/* The box, grown by what `texels` of the panel are at the box's farthest corner. */
static bool sees(const struct sv_cell_cache_label *label, const struct sv_cell_shell *shell, struct box b,
                 double texels)
{
    struct sv_vec3 v = shell->v;
    double far = fmax(fmax(fmax(b.high.x - v.x, v.x - b.low.x), fmax(b.high.y - v.y, v.y - b.low.y)),
                      fmax(b.high.z - v.z, v.z - b.low.z));
    double by = texels * 2 * far / label->parts.size;
    b = grown(b, by, by);
    return sv_cell_sees_box(shell, label->parts.face, b.low, b.high);
}

/* Of what is drawn directly, objects throw no shadows on trees; refined panels are ray cast, and there they do. */
static bool shows_on_crowns(const struct sv_cells_change *c, const struct sweep *sweep,
                            const struct sv_cell_cache_label *label, bool refined)
{
    if (!refined && c->change->trees_added + c->change->trees_removed == 0)
        return false;
    for (uint32_t k = 0; k < c->change->box_count; k++)
        if (sees(label, &label->shell, changed_box(c->change, k), DRAWN_TEXELS))
            return true;
    double spread = LIGHT_TEXELS * label->light.texel_m;
    double across = 2 * c->widest_m + spread, up = c->tallest_m + spread;
    for (size_t k = 0; sweep && k < sweep->piece_count; k++)
        if (sees(label, &label->shell, grown(sweep->pieces[k], across, up), DRAWN_TEXELS))
            return true;
    return false;
}

/* Objects in a panel's face decide how the panel is drawn; they are looked for with as much around them as
 * they are high (core/view/panels.c). */
static bool sees_object(const struct sv_cell_cache_label *label, const struct sv_cell_shell *shell,
                        struct box b)
{
    double height = b.high.z - b.low.z;
    return sees(label, shell, grown(b, height, height), DRAWN_TEXELS);
}

static bool shows_on_ground(const struct sv_cells_change *c, const struct sweep *sweep,
                            const struct sv_cell_cache_label *label)
{
    struct sv_cell_shell shell = label->shell;
    shell.outer_m = INFINITY; /* ground is not parted into rings */
    bool objects = c->change->objects_added + c->change->objects_removed > 0;
    for (uint32_t k = 0; objects && k < c->change->box_count; k++)
        if (sees_object(label, &shell, changed_box(c->change, k)))
            return true;
    if (!sweep)
        return false;
    for (size_t k = 0; k < sweep->piece_count; k++)
        if (sees(label, &shell, sweep->pieces[k], SHADOW_TEXELS))
            return true;
    for (int k = 0; k < c->scene->object_count; k++)
        if (sweep->touched[k] && sees_object(label, &shell, object_box(c->scene, k)))
            return true;
    return false;
}

/* Pages of shadow are read nowhere but on the ground, where their own rule holds. */
static bool shows_on_shadow(const struct sv_cells_change *c, const struct sv_cell_cache_label *label)
{
    const struct sv_cell_place *at = &label->parts.place;
    bool trees = label->light.texel_m > 0 && c->change->trees_added + c->change->trees_removed > 0;
    if (!trees && c->change->objects_added + c->change->objects_removed == 0)
        return false;
    for (uint32_t k = 0; k < c->change->box_count; k++) {
        struct sv_shadow_box box;
        memcpy(box.min, c->change->boxes[k].min, sizeof box.min);
        memcpy(box.max, c->change->boxes[k].max, sizeof box.max);
        if (sv_shadow_page_meets(&c->scene->terrain.field, label->light.to_sun, &box, at->k, at->i, at->j))
            return true;
    }
    return false;
}

bool sv_cells_change_shows(struct sv_cells_change *change, const struct sv_cell_cache_label *label, bool refined)
{
    if (label->parts.layer == SV_PANEL_SHADOW)
        return shows_on_shadow(change, label);
    const struct sweep *sweep = NULL;
    if (label->light.to_sun.z > 0) {
        sweep = sweep_under(change, label->light.to_sun);
        if (!sweep)
            return true;
    }
    return label->parts.layer == SV_PANEL_CROWNS ? shows_on_crowns(change, sweep, label, refined)
                                                 : shows_on_ground(change, sweep, label);
}

/* ---- the change ---- */

enum sv_status sv_cells_change_create(const struct sv_scene *scene, const struct sv_scene_change *change,
                                      struct sv_cells_change **out, struct sv_error *error)
{
    struct sv_cells_change *c = calloc(1, sizeof *c);
    if (!c)
        return sv_fail(error, SV_ENOMEM, "relief", "no memory to tell which panels a change shows on");
    c->scene = scene;
    c->change = change;
    for (uint32_t k = 0; k < scene->forest.count; k++) {
        const struct sv_tree *t = &scene->forest.trees[k];
        double h = (double)t->height_m;
        c->tallest_m = h > c->tallest_m ? h : c->tallest_m;
        double wide = h * (double)scene->species[t->species].mesh.radius;
        c->widest_m = wide > c->widest_m ? wide : c->widest_m;
    }
    *out = c;
    return SV_OK;
}

void sv_cells_change_destroy(struct sv_cells_change *change)
{
    for (int k = 0; change && k < LIGHTS; k++)
        sweep_finish(&change->sweeps[k]);
    free(change);
}

static bool hit(void *context, const struct sv_cell_cache_item *item)
{
    return !context || sv_cells_change_shows(context, &item->label, item->refined);
}

size_t sv_cells_change_drop(struct sv_cell_cache *cache, const struct sv_scene *scene,
                            const struct sv_scene_change *change, double now_s)
{
    struct sv_cells_change *c = NULL;
    struct sv_error error;
    if (sv_cells_change_create(scene, change, &c, &error) != SV_OK)
        c = NULL;
    size_t dropped = sv_cell_cache_drop(cache, scene->generation, now_s, hit, c);
    sv_cells_change_destroy(c);
    return dropped;
}
