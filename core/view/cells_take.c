/* cells_take.c - see cells_take.h. */
#include "core/view/cells_take.h"

#include <math.h>
#include <stdlib.h>

#include "core/base/hash.h"

/* What a face holds is where forward >= D and right and up within +- forward: the hull of four corners and
 * four directions. Out of view when all of them are outside of one plane. */
static bool face_in_view(const struct sv_cells_frame *f, struct sv_vec3 v, double distance_m,
                         enum sv_cell_face face)
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

static double now(const struct sv_cells_take *t)
{
    return t->options.clock_ms ? t->options.clock_ms() : 0;
}

static void put_back(struct sv_cells_take *t, struct sv_taken *s)
{
    if (s->held == SV_HELD_SHARED)
        sv_cell_cache_unpin(t->options.cache, t->options.slot, &s->pin);
    else if (s->held == SV_HELD_OWN)
        free(s->pin.data);
}

void sv_cells_take_release(struct sv_cells_take *t)
{
    for (int k = 0; k < t->count; k++)
        put_back(t, &t->taken[k]);
    t->count = 0;
}

static struct sv_cell_cache_label label_of(const struct sv_cells_frame *f, const struct sv_taken *s)
{
    struct sv_cell_cache_label label = {.parts = {.place = f->at.chain[s->ring],
                                                  .face = s->face,
                                                  .layer = (int)s->layer,
                                                  .size = f->size,
                                                  .light = f->light_key,
                                                  .scene = f->scene_key},
                                        .shell =
                                            sv_cell_shell(&f->at.rings, &f->at.chain[s->ring], f->at.top),
                                        .light = f->light,
                                        .pitch = f->at.rings.pitch};
    label.key = sv_cell_key(&f->at.rings, &label.parts);
    return label;
}

/* Tells others that the panel is being built; false where they build it, or there is no room. */
static bool claim(struct sv_cells_take *t, const struct sv_cell_cache_label *label, struct sv_taken *s)
{
    if (sv_cell_cache_reserve(t->options.cache, t->options.slot, label, 1, false, t->scene->generation,
                              now(t) * 1e-3, &s->pin) == SV_CELL_CACHE_GRANTED)
        s->held = SV_HELD_SHARED;
    return s->held == SV_HELD_SHARED;
}

/* Memory for a panel that is drawn: in the cache where it is claimed, or of this process where the cache has
 * none to give, if it must be. */
static enum sv_status make_place(struct sv_cells_take *t, size_t bytes, bool must, struct sv_taken *s,
                                 struct sv_error *error)
{
    if (s->held == SV_HELD_SHARED &&
        !sv_cell_cache_fit(t->options.cache, t->options.slot, &s->pin, bytes, now(t) * 1e-3))
        s->held = SV_HELD_NOT;
    if (s->held == SV_HELD_SHARED || !must)
        return SV_OK;
    s->pin = (struct sv_cell_cache_panel){.data = aligned_alloc(4096, (bytes + 4095) / 4096 * 4096),
                                          .bytes = bytes};
    if (!s->pin.data)
        return sv_fail(error, SV_ENOMEM, "relief", "no memory for a panel of %zu bytes", bytes);
    s->held = SV_HELD_OWN;
    return SV_OK;
}

static struct sv_panels_order order_of(const struct sv_cells_frame *f,
                                       const struct sv_cell_cache_label *label)
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
static double panel_work(const struct sv_cells_frame *f)
{
    return f->size / 1024.0 * f->size / 1024.0;
}

/* The level (core/cell/admit.h) that needs a panel of that ring: ground that is nearer than all crowns counts
 * as theirs. */
static int level_of(const struct sv_cells_frame *f, int ring)
{
    return f->at.rings.count - (ring > f->at.crowns_first ? ring : f->at.crowns_first);
}

static enum sv_status build(struct sv_cells_take *t, const struct sv_cells_frame *f,
                            const struct sv_cell_cache_label *label, bool must, struct sv_taken *s,
                            struct sv_error *error)
{
    double since = now(t);
    struct sv_panels_order order = order_of(f, label);
    enum sv_status status = sv_panels_size(t->panels, &order, &order.about.size, error);
    if (status)
        return status;
    if (!claim(t, label, s) && !must)
        return SV_OK;
    size_t bytes;
    status = sv_panels_draw(t->panels, &order, &bytes, error);
    if (!status)
        status = make_place(t, bytes, !f->ahead, s, error);
    t->full = !status && s->held == SV_HELD_NOT;
    if (status || t->full)
        return status;
    status = sv_panels_write(t->panels, s->pin.data, bytes, error);
    if (status)
        return status;
    double ms = now(t) - since;
    if (s->held == SV_HELD_SHARED)
        sv_cell_cache_commit(t->options.cache, t->options.slot, &s->pin, bytes, ms * 1e-3, now(t) * 1e-3);
    sv_cell_cache_built(t->options.cache, level_of(f, s->ring), s->layer == SV_PANEL_GROUND, panel_work(f),
                        ms * 1e-3);
    f->report->built++;
    f->report->ms[SV_STAGE_CELL] = fmax(f->report->ms[SV_STAGE_CELL], 0) + ms;
    return SV_OK;
}

static bool find(struct sv_cells_take *t, const struct sv_cell_cache_label *label, struct sv_taken *s)
{
    if (sv_cell_cache_find(t->options.cache, t->options.slot, label->key, t->scene->generation, now(t) * 1e-3,
                           &s->pin) == SV_CELL_CACHE_HIT)
        s->held = SV_HELD_SHARED;
    return s->held == SV_HELD_SHARED;
}

static enum sv_status obtain(struct sv_cells_take *t, const struct sv_cells_frame *f, bool must,
                             struct sv_taken *s, struct sv_error *error)
{
    struct sv_cell_cache_label label = label_of(f, s);
    enum sv_status status = SV_OK;
    bool hit = s->held != SV_HELD_NOT || find(t, &label, s);
    f->report->hits += hit;
    if (!hit && f->report->built >= f->most)
        f->report->left++;
    else if (!hit && !t->full)
        status = build(t, f, &label, must, s, error);
    if (status || s->held == SV_HELD_NOT)
        return status;
    status = sv_panel_open(s->pin.data, s->pin.bytes, &s->panel, error);
    s->open = !status;
    if (s->open && hit) /* one of less than full size shows nothing */
        f->report->refined += s->pin.refined || s->panel.about.size < f->size;
    return status;
}

static void want(struct sv_cells_take *t, const struct sv_cells_frame *f, int ring, double distance_m,
                 unsigned layer)
{
    for (int face = 0; face < SV_CELL_FACES; face++)
        if (face_in_view(f, f->at.chain[ring].v, distance_m, (enum sv_cell_face)face))
            t->taken[t->count++] =
                (struct sv_taken){.ring = ring, .face = (enum sv_cell_face)face, .layer = layer};
}

static void want_all(struct sv_cells_take *t, const struct sv_cells_frame *f)
{
    if (f->ground_ring >= 0)
        want(t, f, f->ground_ring, f->at.rings.distance_m[f->ground_ring], SV_PANEL_GROUND);
    for (int ring = f->at.crowns_first; ring < f->at.rings.count && f->view->plan.draw_trees; ring++)
        want(t, f, ring, f->at.rings.distance_m[ring] / 2, SV_PANEL_CROWNS);
}

static uint64_t key_of_ring(const struct sv_cells_frame *f, int ring)
{
    return sv_cell_key(&f->at.rings, &(struct sv_cell_key_parts){.place = f->at.chain[ring],
                                                                 .size = f->size,
                                                                 .light = f->light_key,
                                                                 .scene = f->scene_key});
}

/* How many rings to draw the picture from, by what is there of them. */
static int admit(struct sv_cells_take *t, const struct sv_cells_frame *f)
{
    const struct sv_camera *camera = &f->view->camera;
    struct sv_cell_admit_request request = {.now_s = now(t) * 1e-3,
                                            .pixels = (int64_t)camera->width * camera->height,
                                            .rings = level_of(f, f->at.crowns_first)};
    for (int k = 1; k <= request.rings; k++)
        request.ring[k - 1].key = key_of_ring(f, f->at.rings.count - k);
    for (int k = 0; k < t->count; k++) {
        struct sv_taken *s = &t->taken[k];
        struct sv_cell_cache_label label = label_of(f, s);
        bool ground = s->layer == SV_PANEL_GROUND;
        int ring = level_of(f, s->ring) - 1;
        if (!find(t, &label, s))
            *(ground ? &request.ring[ring].ground : &request.ring[ring].crowns) += panel_work(f);
    }
    return sv_cell_cache_admit(t->options.cache, &request).level;
}

/* Of several who draw the picture the first to ask decides. */
static int agree(struct sv_cells_take *t, const struct sv_cells_frame *f)
{
    int level = f->bands ? f->bands->agree(f->bands->context, -1) : -1;
    if (level >= 0)
        return level;
    level = admit(t, f);
    return f->bands ? f->bands->agree(f->bands->context, level) : level;
}

/* Which rings to draw from. SV_ENOENT: none. Panels of the others are put back. */
static enum sv_status choose_rings(struct sv_cells_take *t, struct sv_cells_frame *f, struct sv_error *error)
{
    int level = agree(t, f);
    if (level == 0)
        return sv_fail(error, SV_ENOENT, "relief",
                       "no panels that are there, or worth building, save anything");
    int kept = 0;
    for (int k = 0; k < t->count; k++)
        if (level_of(f, t->taken[k].ring) <= level)
            t->taken[kept++] = t->taken[k];
        else
            put_back(t, &t->taken[k]);
    t->count = kept;
    f->first = f->at.rings.count - level;
    if (f->ground_ring >= 0 && level_of(f, f->ground_ring) > level)
        f->ground_ring = -1;
    return SV_OK;
}

/* What the rows do not see is put back. */
static void keep_rows(struct sv_cells_take *t, struct sv_cells_frame *f)
{
    const struct sv_camera *camera = &f->view->camera;
    int kept = 0;
    if (f->row_first == 0 && f->row_end == camera->height)
        return;
    sv_camera_band_planes(camera, f->row_first, f->row_end, f->planes);
    for (int k = 0; k < t->count; k++) {
        const struct sv_taken *s = &t->taken[k];
        double distance_m = f->at.rings.distance_m[s->ring] / (s->layer == SV_PANEL_GROUND ? 1 : 2);
        if (face_in_view(f, f->at.chain[s->ring].v, distance_m, s->face))
            t->taken[kept++] = *s;
        else
            put_back(t, &t->taken[k]);
    }
    t->count = kept;
}

/* What others are building is left for the end: two processes that want the same panels share the work. */
static enum sv_status obtain_all(struct sv_cells_take *t, struct sv_cells_frame *f, struct sv_error *error)
{
    enum sv_status status = SV_OK;
    want_all(t, f);
    if (!f->all)
        status = choose_rings(t, f, error);
    keep_rows(t, f);
    t->full = false;
    for (int round = 0; round < (f->ahead ? 1 : 2); round++)
        for (int k = 0; k < t->count && !status; k++)
            if (!t->taken[k].open)
                status = obtain(t, f, round > 0, &t->taken[k], error);
    return status;
}

/* All of the light that panels hold, and of the scene but what patches change: panels of another key are
 * others. Where the forest's numbers count from is a matter of rounding. */
static enum sv_status make_keys(const struct sv_cells_take *t, struct sv_cells_frame *f,
                                struct sv_error *error)
{
    const struct sv_resolved_view *v = f->view;
    enum sv_status status = sv_direct_light(t->direct, v, &f->light, error);
    uint64_t h = sv_hash_double(sv_hash_double(SV_HASH_INIT, v->sun.azimuth_rad), v->sun.elevation_rad);
    h = sv_hash_u64(h, (uint64_t)v->plan.shadows | (uint64_t)v->air << 1 | (uint64_t)v->plan.draw_trees << 2);
    f->light_key = sv_hash_double(sv_hash_double(h, v->plan.tree_error_px), f->light.texel_m);
    struct sv_vec3 o = t->scene->forest.origin;
    h = sv_hash_u64(SV_HASH_INIT, sv_scene_loaded_version(t->scene));
    f->scene_key = sv_hash_done(sv_hash_double(sv_hash_double(sv_hash_double(h, o.x), o.y), o.z));
    return status;
}

/* Where the eye is among cells, and what all of its picture sees. */
enum sv_status sv_cells_take_look(struct sv_cells_take *t, struct sv_cells_frame *f, struct sv_error *error)
{
    const struct sv_resolved_view *view = f->view;
    f->size = view->plan.relief_resolution;
    if (!sv_view_rings(view, &f->at))
        return sv_fail(error, SV_EINVAL, "relief_distance", "there are no cells of that distance here");
    f->first = f->at.crowns_first;
    f->ground_ring = sv_panels_free_ring(t->panels, &f->at.rings, f->at.chain);
    f->low = f->ground_ring < 0;
    enum sv_status status = make_keys(t, f, error);
    if (status)
        return status;
    f->shadow = (struct sv_cells_shadow){.cache = t->options.cache,
                                         .slot = t->options.slot,
                                         .generation = t->scene->generation,
                                         .now_s = now(t) * 1e-3,
                                         .field = &t->scene->terrain.field,
                                         .light = f->light,
                                         .scene_key = f->scene_key};
    sv_camera_planes(&view->camera, f->planes);
    return SV_OK;
}

enum sv_status sv_cells_take_panels(struct sv_cells_take *t, struct sv_cells_frame *f, struct sv_error *error)
{
    enum sv_status status = sv_cells_take_look(t, f, error);
    if (status)
        return status;
    f->report->id = key_of_ring(f, f->at.crowns_first);
    status = obtain_all(t, f, error);
    f->report->ground_direct = f->ground_ring < 0;
    f->report->level = level_of(f, f->first);
    return status;
}
enum sv_status sv_cells_take_list(struct sv_cells_take *t, struct sv_cells_frame *f,
                                  struct sv_cells_panel panels[SV_CELLS_PANELS_MAX], int *count,
                                  struct sv_error *error)
{
    enum sv_status status = sv_cells_take_look(t, f, error);
    if (status)
        return status;
    want_all(t, f);
    for (int k = 0; k < t->count; k++) {
        panels[k].label = label_of(f, &t->taken[k]);
        panels[k].order = order_of(f, &panels[k].label);
    }
    *count = t->count;
    sv_cells_take_release(t);
    return SV_OK;
}
