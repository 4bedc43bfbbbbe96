/* cells_refine.c - see cells_refine.h. */
#include "core/view/cells_refine.h"

#include <stdlib.h>

#include "core/base/hash.h"
#include "core/view/cells_shadow.h"
#include "core/view/panels_refine.h"

struct sv_cells_refiner {
    const struct sv_scene *scene;
    const struct sv_truth *truth;
    struct sv_cells *cells;
    struct sv_cells_options options;
    /* What is begun; refinement NULL: nothing. */
    struct sv_panels_refinement *refinement;
    uint64_t key, version; /* of the panel; of the scene then */
    double spent_ms;
    struct sv_cell_cache_panel pin;
    /* Pages of shadow: what a view wanted, and the one that is begun. */
    struct sv_cells_shadow shadow;
    struct sv_shadow_wish wishes[SV_CELLS_SHADOWS_MAX];
    size_t wish_count;
    uint64_t wishes_key; /* of the view and the scene; 0: of none */
    struct sv_cells_shadow_work work;
    uint64_t work_version; /* of the scene then */
    double work_ms;
};

enum sv_status sv_cells_refiner_create(const struct sv_scene *scene, const struct sv_truth *truth,
                                       struct sv_cells *cells, const struct sv_cells_options *options,
                                       struct sv_cells_refiner **refiner, struct sv_error *error)
{
    struct sv_cells_refiner *r = calloc(1, sizeof *r);
    if (!r)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory to refine panels");
    *r = (struct sv_cells_refiner){.scene = scene, .truth = truth, .cells = cells, .options = *options};
    *refiner = r;
    return SV_OK;
}

static void end(struct sv_cells_refiner *r)
{
    sv_panels_refine_destroy(r->refinement);
    sv_cell_cache_unpin(r->options.cache, r->options.slot, &r->pin);
    r->refinement = NULL;
}

static double now(const struct sv_cells_refiner *r)
{
    return r->options.clock_ms ? r->options.clock_ms() : 0;
}

static void end_page(struct sv_cells_refiner *r)
{
    sv_cells_shadow_work_end(&r->work, r->work_ms * 1e-3, now(r) * 1e-3);
}

void sv_cells_refiner_drop(struct sv_cells_refiner *refiner)
{
    if (refiner->refinement)
        end(refiner);
    end_page(refiner);
    refiner->wishes_key = 0;
}

void sv_cells_refiner_destroy(struct sv_cells_refiner *refiner)
{
    if (!refiner)
        return;
    sv_cells_refiner_drop(refiner);
    free(refiner);
}

/* Whether the panel is there and could be better; its size as it is built. */
static bool is_built(const struct sv_cells_refiner *r, const struct sv_cells_panel *panel, int *size)
{
    struct sv_cell_cache_panel pin;
    struct sv_panel built;
    struct sv_error ignored;
    if (sv_cell_cache_find(r->options.cache, r->options.slot, panel->label.key, r->scene->generation, now(r) * 1e-3,
                           &pin) != SV_CELL_CACHE_HIT)
        return false;
    bool well = !pin.refined && sv_panel_open(pin.data, pin.bytes, &built, &ignored) == SV_OK;
    if (well)
        *size = built.about.size;
    sv_cell_cache_unpin(r->options.cache, r->options.slot, &pin);
    /* One of less than full size shows nothing. */
    return well && *size == panel->order.about.size;
}

/* Begins with the panel, unless others refine it. */
static enum sv_status begin(struct sv_cells_refiner *r, const struct sv_cells_panel *panel, int size,
                            const struct sv_cells_refine_options *options, struct sv_error *error)
{
    struct sv_panels_order order = panel->order;
    double since = now(r);
    int larger = size * options->scale;
    order.about.size = larger <= SV_PANEL_SIZE_MAX ? larger : size;
    if (sv_cell_cache_reserve(r->options.cache, r->options.slot, &panel->label, 1, true, r->scene->generation,
                              since * 1e-3, &r->pin) != SV_CELL_CACHE_GRANTED)
        return SV_OK;
    enum sv_status status =
        sv_panels_refine_begin(r->scene, r->truth, &order, options->samples, &r->refinement, error);
    if (status)
        sv_cell_cache_unpin(r->options.cache, r->options.slot, &r->pin);
    r->key = panel->label.key;
    r->version = r->scene->version;
    r->spent_ms = now(r) - since;
    return status;
}

/* Puts the whole panel in the built one's place, if the cache has room for it. */
static void put(struct sv_cells_refiner *r)
{
    struct sv_error ignored;
    size_t bytes = sv_panels_refine_measure(r->refinement);
    if (sv_cell_cache_fit(r->options.cache, r->options.slot, &r->pin, bytes, now(r) * 1e-3) &&
        sv_panels_refine_write(r->refinement, r->pin.data, bytes, &ignored) == SV_OK)
        sv_cell_cache_commit(r->options.cache, r->options.slot, &r->pin, bytes, r->spent_ms * 1e-3, now(r) * 1e-3);
}

/* Goes on with what is begun; false: stopped. */
static bool go_on(struct sv_cells_refiner *r, const struct sv_cells_refine_options *options)
{
    double since = now(r);
    bool more;
    while ((more = sv_panels_refine_row(r->refinement)))
        if (options->stop && options->stop(options->context))
            break;
    r->spent_ms += now(r) - since;
    if (more)
        return false;
    put(r);
    end(r);
    return true;
}

/* ---- pages of shadow ---- */

/* All that tells which pages a view wants. */
static uint64_t key_of(const struct sv_cells_refiner *r, const struct sv_resolved_view *view)
{
    const struct sv_camera *c = &view->camera;
    const struct sv_vec3 vectors[] = {c->eye, c->right, c->up, c->forward};
    uint64_t h = sv_hash_u64(SV_HASH_INIT, r->scene->version);
    for (int k = 0; k < 4; k++)
        h = sv_hash_double(sv_hash_double(sv_hash_double(h, vectors[k].x), vectors[k].y), vectors[k].z);
    h = sv_hash_double(sv_hash_double(h, c->vfov_rad), view->plan.terrain_error_px);
    h = sv_hash_u64(sv_hash_u64(h, (uint64_t)c->width), (uint64_t)c->height);
    h = sv_hash_double(sv_hash_double(h, view->sun.azimuth_rad), view->sun.elevation_rad);
    h = sv_hash_done(sv_hash_u64(h, (uint64_t)view->plan.shadows | (uint64_t)view->plan.draw_trees << 1));
    return h ? h : 1;
}

/* What the view wants; found once while the same view is refined page by page. */
static enum sv_status want_pages(struct sv_cells_refiner *r, const struct sv_resolved_view *view,
                                 struct sv_error *error)
{
    uint64_t key = key_of(r, view);
    enum sv_status status = SV_OK;
    if (key != r->wishes_key)
        status = sv_cells_wanted_shadows(r->cells, view, &r->shadow, r->wishes, &r->wish_count, error);
    r->wishes_key = status ? 0 : key;
    r->shadow.now_s = now(r) * 1e-3;
    r->shadow.slot = r->options.slot;
    return status;
}

static bool is_wanted(const struct sv_cells_refiner *r)
{
    for (size_t k = 0; k < r->wish_count; k++) {
        const struct sv_shadow_wish *w = &r->wishes[k];
        if (sv_cells_shadow_label(&r->shadow, w->level, w->i, w->j).key == r->work.key)
            return true;
    }
    return false;
}

/* Goes on with the page that is begun; false: stopped. */
static bool cast_page(struct sv_cells_refiner *r, const struct sv_cells_refine_options *options)
{
    double since = now(r);
    bool more;
    while ((more = sv_cells_shadow_work_row(&r->work, r->truth)))
        if (options->stop && options->stop(options->context))
            break;
    r->work_ms += now(r) - since;
    if (more)
        return false;
    end_page(r);
    return true;
}

/* False: stopped. */
static bool refine_pages(struct sv_cells_refiner *r, const struct sv_cells_refine_options *options,
                         struct sv_cells_refine_report *report)
{
    bool going = true;
    if (r->work.begun && (r->work_version != r->scene->version || !is_wanted(r)))
        end_page(r);
    if (r->work.begun) {
        going = cast_page(r, options);
        report->shadows += going;
    }
    for (size_t k = 0; k < r->wish_count; k++) {
        if (sv_cells_shadow_there(&r->shadow, &r->wishes[k]))
            continue;
        going = going && report->shadows < options->most;
        if (going && sv_cells_shadow_work_begin(&r->work, &r->shadow, &r->wishes[k], options->samples)) {
            r->work_version = r->scene->version;
            r->work_ms = 0;
            going = cast_page(r, options);
            report->shadows += going;
        }
        report->left += !going;
    }
    report->refined += report->shadows;
    return going;
}

/* ---- both ---- */

static bool has_key(const struct sv_cells_panel *panels, int count, uint64_t key)
{
    for (int k = 0; k < count; k++)
        if (panels[k].label.key == key)
            return true;
    return false;
}

enum sv_status sv_cells_refine(struct sv_cells_refiner *refiner, const struct sv_resolved_view *view,
                               const struct sv_cells_refine_options *options,
                               struct sv_cells_refine_report *report, struct sv_error *error)
{
    struct sv_cells_refiner *r = refiner;
    struct sv_cells_panel panels[SV_CELLS_PANELS_MAX];
    int count, size;
    enum sv_status status = sv_cells_wanted(r->cells, view, panels, &count, error);
    if (!status)
        status = want_pages(r, view, error);
    if (status)
        return status;
    *report = (struct sv_cells_refine_report){0};
    count = options->shadows_alone ? 0 : count;
    bool going = refine_pages(r, options, report) && report->refined < options->most;
    if (r->refinement && (r->version != r->scene->version || !has_key(panels, count, r->key)))
        end(r);
    if (r->refinement && going) {
        going = go_on(r, options);
        report->refined += going;
    }
    for (int k = 0; k < count && !status; k++) {
        if (!is_built(r, &panels[k], &size))
            continue;
        going = going && report->refined < options->most;
        if (going)
            status = begin(r, &panels[k], size, options, error);
        if (going && !status && r->refinement) {
            going = go_on(r, options);
            report->refined += going;
        }
        report->left += !going;
    }
    return status;
}
