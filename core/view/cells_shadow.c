/* cells_shadow.c - see cells_shadow.h. */
#include "core/view/cells_shadow.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/hash.h"
#include "core/cell/panel.h"
#include "core/truth/sunlight.h"

enum { SIDE = SV_SHADOW_PAGE_SIDE, STEP = SV_SHADOW_PAGE_STEP };
static const size_t PAGE_BYTES = (size_t)SIDE * SIDE;

/* ---- in the cache ---- */

static bool of_trees(const struct sv_cells_shadow *shadow)
{
    return shadow->light.texel_m > 0;
}

struct sv_cell_cache_label sv_cells_shadow_label(const struct sv_cells_shadow *shadow, int level, int i,
                                                 int j)
{
    struct sv_shadow_place at = sv_shadow_page_place(shadow->field, level, i, j);
    struct sv_vec3 s = shadow->light.to_sun;
    uint64_t light = sv_hash_double(sv_hash_double(sv_hash_double(SV_HASH_INIT, s.x), s.y), s.z);
    struct sv_cell_cache_label label = {
        .parts = {.place = {.i = i, .j = j, .k = level, .v = {at.x0, at.y0, 0}},
                  .layer = SV_PANEL_SHADOW,
                  .size = SIDE,
                  .light = sv_hash_u64(light, of_trees(shadow)),
                  .scene = shadow->scene_key},
        .light = {.to_sun = s, .texel_m = of_trees(shadow) ? at.texel_m : 0},
        .pitch = 1};
    const struct sv_cell_rings rings = {.count = 1, .distance_m = {at.texel_m * STEP}, .pitch = 1};
    label.key = sv_cell_key(&rings, &label.parts);
    return label;
}

bool sv_cells_shadow_there(const struct sv_cells_shadow *shadow, const struct sv_shadow_wish *page)
{
    uint64_t key = sv_cells_shadow_label(shadow, page->level, page->i, page->j).key;
    return sv_cell_cache_serial(shadow->cache, key, shadow->generation, shadow->now_s) != 0;
}

/* A sv_shadow_source. */
static uint64_t read_page(void *context, int level, int i, int j, uint64_t have, uint8_t *light)
{
    const struct sv_cells_shadow *s = context;
    struct sv_cell_cache_panel pin;
    uint64_t key = sv_cells_shadow_label(s, level, i, j).key;
    uint64_t serial = sv_cell_cache_serial(s->cache, key, s->generation, s->now_s);
    if (serial == 0 || serial == have)
        return serial;
    if (sv_cell_cache_find(s->cache, s->slot, key, s->generation, s->now_s, &pin) != SV_CELL_CACHE_HIT)
        return 0;
    bool whole = pin.bytes == PAGE_BYTES;
    if (whole)
        memcpy(light, pin.data, PAGE_BYTES);
    sv_cell_cache_unpin(s->cache, s->slot, &pin);
    return whole ? pin.serial : 0;
}

/* ---- in use ---- */

void sv_cells_shadow_begin(struct sv_cells_shadow *shadow, struct sv_direct *direct, uint64_t *lacking)
{
    struct sv_shadow_source source = {
        .read = read_page, .context = shadow, .version = sv_cell_cache_changes(shadow->cache)};
    sv_direct_use_refined(direct, &source);
    *lacking = sv_shadow_pages_lacking(sv_direct_pages(direct));
}

bool sv_cells_shadow_end(struct sv_direct *direct, uint64_t lacking)
{
    sv_direct_use_refined(direct, NULL);
    return sv_shadow_pages_lacking(sv_direct_pages(direct)) > lacking;
}

static int by_urgency(const void *a, const void *b)
{
    const struct sv_shadow_wish *x = a, *y = b;
    if (x->level != y->level)
        return x->level < y->level ? -1 : 1;
    if (x->count != y->count)
        return x->count > y->count ? -1 : 1;
    if (x->j != y->j)
        return x->j < y->j ? -1 : 1;
    return (x->i > y->i) - (x->i < y->i);
}

enum sv_status sv_cells_shadow_wishes(struct sv_cells_shadow *shadow, struct sv_direct *direct,
                                      const struct sv_resolved_view *view,
                                      struct sv_shadow_wish list[SV_CELLS_SHADOWS_MAX], size_t *count,
                                      struct sv_error *error)
{
    struct sv_direct_pass pass = {.layers = 1u << SV_LAYER_COLOR | 1u << SV_LAYER_DEPTH};
    struct sv_shadow_wishes wishes = {.list = list, .room = SV_CELLS_SHADOWS_MAX};
    struct sv_picture picture = {0};
    uint64_t lacking;
    enum sv_status status = sv_picture_alloc(&view->camera, pass.layers, &picture, error);
    sv_cells_shadow_begin(shadow, direct, &lacking);
    sv_shadow_pages_note(sv_direct_pages(direct), &wishes);
    if (!status)
        status = sv_direct_draw(direct, view, &pass, &picture, NULL, error);
    sv_shadow_pages_note(sv_direct_pages(direct), NULL);
    (void)sv_cells_shadow_end(direct, lacking);
    sv_picture_finish(&picture);
    qsort(list, wishes.count, sizeof *list, by_urgency);
    *count = wishes.count;
    return status;
}

/* ---- being cast ---- */

bool sv_cells_shadow_work_begin(struct sv_cells_shadow_work *work, const struct sv_cells_shadow *shadow,
                                const struct sv_shadow_wish *page, int samples)
{
    struct sv_cell_cache_label label = sv_cells_shadow_label(shadow, page->level, page->i, page->j);
    *work =
        (struct sv_cells_shadow_work){.shadow = *shadow, .page = *page, .key = label.key, .samples = samples};
    work->begun =
        sv_cell_cache_reserve(shadow->cache, shadow->slot, &label, PAGE_BYTES, true, shadow->generation,
                              shadow->now_s, &work->pin) == SV_CELL_CACHE_GRANTED;
    return work->begun;
}

bool sv_cells_shadow_work_row(struct sv_cells_shadow_work *work, const struct sv_truth *truth)
{
    const struct sv_cells_shadow *s = &work->shadow;
    const struct sv_light light = {.to_sun = s->light.to_sun};
    struct sv_truth_lattice lattice = {.x0 = s->field->x0,
                                       .y0 = s->field->y0,
                                       .texel_m =
                                           sv_shadow_page_place(s->field, work->page.level, 0, 0).texel_m,
                                       .first = work->page.i * STEP - 1,
                                       .count = SIDE,
                                       .samples = work->samples,
                                       .trees = of_trees(s)};
    if (work->row < SIDE) {
        sv_truth_sunlight_row(truth, &light, &lattice, work->page.j * STEP - 1 + work->row,
                              (uint8_t *)work->pin.data + (size_t)work->row * SIDE);
        work->row++;
    }
    return work->row < SIDE;
}

void sv_cells_shadow_work_end(struct sv_cells_shadow_work *work, double spent_s, double now_s)
{
    struct sv_cell_cache *cache = work->shadow.cache;
    if (work->begun && work->row == SIDE)
        sv_cell_cache_commit(cache, work->shadow.slot, &work->pin, PAGE_BYTES, spent_s, now_s);
    if (work->begun)
        sv_cell_cache_unpin(cache, work->shadow.slot, &work->pin);
    *work = (struct sv_cells_shadow_work){0};
}
