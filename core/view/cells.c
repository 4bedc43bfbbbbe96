/* cells.c - see cells.h. */
#include "core/view/cells.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/cell/crown_warp.h"
#include "core/cell/panel_ground.h"
#include "core/relief/warp.h"
#include "core/view/cells_change.h"
#include "core/view/cells_take.h"
#include "core/view/compose.h"
#include "core/view/soften.h"

/* Texels farther than the ground at their pixel by this share are behind it (crowns stand in the ground, and
 * their depth is that of their middle where they are far). */
#define BEHIND 0.01f
/* Pixels that a texel may be wide in the middle of the picture: crowns of larger ones are squares. */
#define TEXEL_PX_MAX 4

/* Rows beyond a band that its own depend on (soften.h). */
enum { APRON = 1 };

struct sv_cells {
    struct sv_cells_take take;
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
    uint64_t lacking; /* sv_cells_shadow_begin */
};

enum sv_status sv_cells_create(const struct sv_scene *scene, struct sv_direct *direct,
                               const struct sv_cells_options *options, struct sv_cells **cells,
                               struct sv_error *error)
{
    struct sv_cells *c = calloc(1, sizeof *c);
    if (!c)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for cells");
    c->take = (struct sv_cells_take){.scene = scene, .direct = direct, .options = *options};
    enum sv_status status = sv_panels_create(scene, direct, &c->take.panels, error);
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
    sv_panels_destroy(cells->take.panels);
    free(cells);
}

void sv_cells_use_slot(struct sv_cells *cells, unsigned slot)
{
    cells->take.options.slot = slot;
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

bool sv_cells_can(const struct sv_resolved_view *view, unsigned layers)
{
    return view->camera.projection == SV_PROJECTION_PERSPECTIVE && !view->plan.raycast &&
           view->plan.samples == 1 && layers == 1u << SV_LAYER_COLOR &&
           2 * sv_camera_focal_px(&view->camera) <= TEXEL_PX_MAX * view->plan.relief_resolution &&
           (!view->plan.draw_trees || view->plan.trees == SV_TREES_AUTO);
}

/* ---- what is opaque ---- */

/* What is drawn between the two is lit by refined pages of shadow, where the ground is always drawn directly.
 */
static void begin_shadows(struct sv_cells *c, struct sv_cells_frame *f)
{
    if (f->low)
        sv_cells_shadow_begin(&f->shadow, c->take.direct, &c->lacking);
}

static void end_shadows(struct sv_cells *c, struct sv_cells_frame *f)
{
    if (f->low)
        f->report->shadows_left |= sv_cells_shadow_end(c->take.direct, c->lacking);
}

/* What stands on the ground besides trees cannot be shaded by depth alone. */
static bool has_objects(const struct sv_cells *c)
{
    return c->take.scene->object_count > 0;
}

static enum sv_status draw_ground_directly(struct sv_cells *c, const struct sv_cells_frame *f,
                                           struct sv_error *error)
{
    struct sv_direct_pass pass = {
        .layers = 1u << SV_LAYER_DEPTH, .sky = f->sky, .row_first = c->row_first, .row_count = c->row_count};
    struct sv_picture picture = {
        .layer[SV_LAYER_DEPTH] = {c->width, c->row_count, 1, SV_PIXEL_F32, c->depth}};
    if (has_objects(c)) {
        pass.layers |= 1u << SV_LAYER_COLOR;
        picture.layer[SV_LAYER_COLOR] = (struct sv_image){c->width, c->row_count, 4, SV_PIXEL_U8, c->rgba};
    } else {
        memset(c->rgba, 0, 4 * (size_t)c->row_count * (size_t)c->width);
    }
    return sv_direct_draw(c->take.direct, f->view, &pass, &picture, NULL, error);
}

/* Ground sources among what is seen. No ground is before its cube's faces. */
static unsigned ground_sources(const struct sv_cells *c, const struct sv_cells_frame *f,
                               struct sv_warp_source sources[SV_CELL_FACES])
{
    unsigned count = 0;
    for (int k = 0; k < c->take.count; k++) {
        const struct sv_taken *s = &c->take.taken[k];
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

static void warp_ground(struct sv_cells *c, const struct sv_cells_frame *f)
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
static void color_ground(struct sv_cells *c, const struct sv_cells_frame *f)
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
static enum sv_status shade_behind(struct sv_cells *c, const struct sv_cells_frame *f, struct sv_error *error)
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
    return sv_direct_shade_ground(c->take.direct, f->view, f->sky, c->row_first, c->row_count, c->depth,
                                  c->hidden, c->rgba[0], error);
}

/* ---- crowns ---- */

static void clear_light(struct sv_cells *c, size_t pixels)
{
    for (size_t k = 0; k < pixels; k++) {
        c->light[k][0] = c->light[k][1] = c->light[k][2] = 0;
        c->light[k][3] = 1;
    }
}

/* Trees within the cube of the innermost ring that is drawn from panels are in front of all others: the first
 * light. Where that is the innermost of all, leaves are pixels large: few samples a pixel will do, and one is
 * softened. */
static enum sv_status draw_near(struct sv_cells *c, const struct sv_cells_frame *f,
                                struct sv_draw_stats *stats, bool *any, struct sv_error *error)
{
    bool all = f->first == f->at.crowns_first;
    struct sv_tree_shell shell = {
        .inner_m = -1, .outer = f->at.chain[f->first].v, .outer_m = f->at.rings.distance_m[f->first]};
    struct sv_canvas canvas = {.width = c->width,
                               .height = f->view->camera.height,
                               .row_first = c->row_first,
                               .row_count = c->row_count,
                               .depth = c->near_depth,
                               .color = c->near[0]};
    struct sv_resolved_view view = *f->view;
    size_t pixels = (size_t)c->row_count * (size_t)c->width;
    *any = false;
    enum sv_status status = sv_direct_sees_trees(c->take.direct, &view, &shell, any, error);
    if (status || !*any) {
        clear_light(c, pixels);
        return status;
    }
    bool soft = all && view.plan.near_samples == 1;
    if (all)
        view.plan.leaf_samples = view.plan.near_samples;
    memcpy(c->near_depth, c->depth, pixels * sizeof *c->depth);
    memset(c->near, 0, pixels * sizeof *c->near);
    status = sv_direct_draw_trees(c->take.direct, &view, &shell, &canvas, stats, error);
    return status ? status
                  : sv_soften(c->width, c->row_count, soft ? SV_SOFTEN_SIDE : 0, (const uint8_t(*)[4])c->near,
                              c->light, error);
}

/* Where near trees are, and where nothing of panels can be in front: there are none, or what is seen is not
 * theirs. */
static void set_front(struct sv_cells *c)
{
    size_t pixels = (size_t)c->row_count * (size_t)c->width;
    for (size_t k = 0; k < pixels; k++)
        c->near_depth[k] = c->near_depth[k] > c->depth[k] ? c->near_depth[k] : INFINITY;
}

/* near: there are such trees. */
static void warp_crowns(struct sv_cells *c, const struct sv_cells_frame *f, bool near)
{
    if (near)
        set_front(c);
    sv_crown_buffer_begin(c->crowns);
    sv_crown_buffer_close(c->crowns, (const float(*)[4])c->light, near ? c->near_depth : NULL);
    for (int ring = f->first; ring < f->at.rings.count; ring++) {
        struct sv_crown_source sources[SV_CELL_FACES];
        unsigned count = 0;
        for (int k = 0; k < c->take.count; k++) {
            const struct sv_taken *s = &c->take.taken[k];
            if (s->ring != ring || s->panel.crowns.size == 0)
                continue;
            sources[count].layer = &s->panel.crowns;
            sources[count].opens =
                ring == f->at.crowns_first; /* leaves are many pixels large in none but these */
            sources[count].steep = s->pin.refined ? SV_CROWN_STEEP_REFINED : SV_CROWN_STEEP;
            sv_crown_map(s->panel.about.place.v, s->panel.about.distance_m, s->face, &f->view->camera, 0, 0,
                         sources[count++].m);
        }
        if (count == 0)
            continue;
        sv_crown_buffer_clear(c->crowns);
        sv_crown_splat(sources, count, c->crowns, NULL);
        if (near && ring == f->first)
            sv_crown_resolve_front(sources, count, c->crowns, c->near_depth, c->light);
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

static double now(const struct sv_cells *c)
{
    return c->take.options.clock_ms ? c->take.options.clock_ms() : 0;
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
    struct sv_cells_frame f = {.view = view, .row_end = view->camera.height, .report = &report};
    return sv_cells_take_list(&cells->take, &f, panels, count, error);
}

enum sv_status sv_cells_wanted_shadows(struct sv_cells *cells, const struct sv_resolved_view *view,
                                       struct sv_cells_shadow *shadow,
                                       struct sv_shadow_wish wishes[SV_CELLS_SHADOWS_MAX], size_t *count,
                                       struct sv_error *error)
{
    struct sv_cells_report report;
    struct sv_cells_frame f = {.view = view, .row_end = view->camera.height, .report = &report};
    enum sv_status status = sv_cells_take_look(&cells->take, &f, error);
    *shadow = f.shadow;
    *count = 0;
    if (!status && f.low && f.light.to_sun.z > 0)
        status = sv_cells_shadow_wishes(shadow, cells->take.direct, view, wishes, count, error);
    return status;
}

enum sv_status sv_cells_build(struct sv_cells *cells, const struct sv_resolved_view *view, uint32_t most,
                              struct sv_cells_report *report, struct sv_error *error)
{
    struct sv_cells_frame f = {.view = view,
                               .row_end = view->camera.height,
                               .all = true,
                               .ahead = true,
                               .most = most,
                               .report = report};
    clear(report);
    enum sv_status status = sv_cells_take_panels(&cells->take, &f, error);
    sv_cells_take_release(&cells->take);
    return status;
}

enum sv_status sv_cells_draw(struct sv_cells *cells, const struct sv_resolved_view *view,
                             const struct sv_cells_draw_options *options, uint8_t *rgba,
                             struct sv_cells_report *report, struct sv_draw_stats *stats,
                             struct sv_error *error)
{
    struct sv_cells *c = cells;
    int height = view->camera.height, first = options->row_first, end = first + options->row_count;
    struct sv_cells_frame f = {.view = view,
                               .row_first = first > APRON ? first - APRON : 0,
                               .row_end = end + APRON < height ? end + APRON : height,
                               .sky = options->sky,
                               .all = options->all,
                               .bands = options->bands,
                               .most = UINT32_MAX,
                               .report = report};
    clear(report);
    enum sv_status status = want_band(c, &view->camera, f.row_first, f.row_end - f.row_first, error);
    if (!status)
        status = sv_cells_take_panels(&c->take, &f, error);
    double t = now(c);
    bool near = false;
    if (!status && f.ground_ring < 0) {
        begin_shadows(c, &f);
        status = draw_ground_directly(c, &f, error);
        end_shadows(c, &f);
    } else if (!status) {
        warp_ground(c, &f);
    }
    t = since(c, report, f.ground_ring < 0 ? SV_STAGE_NEAR : SV_STAGE_WARP, t);
    if (!status)
        status = draw_near(c, &f, stats, &near, error);
    t = since(c, report, SV_STAGE_NEAR, t);
    if (!status)
        warp_crowns(c, &f, near);
    if (!status && f.ground_ring >= 0)
        color_ground(c, &f);
    sv_cells_take_release(&c->take);
    t = since(c, report, SV_STAGE_WARP, t);
    if (!status) {
        begin_shadows(c, &f);
        status = shade_behind(c, &f, error);
        end_shadows(c, &f);
    }
    if (!status)
        compose(c, first, options->row_count, rgba);
    since(c, report, SV_STAGE_COMPOSITE, t);
    return status;
}

void sv_cells_changed(struct sv_cells *cells, const struct sv_scene_change *change)
{
    (void)sv_cells_change_drop(cells->take.options.cache, cells->take.scene, change, now(cells) * 1e-3);
}
