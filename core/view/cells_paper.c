/* cells_paper.c - see cells_paper.h. Paper 1's symbols: distance = D, n = texels a side over 90 degrees. */
#include "core/view/cells_paper.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/base/hash.h"
#include "core/cell/lattice.h"
#include "core/cell/panel_ground.h"
#include "core/cell/region.h"
#include "core/gl/target.h"
#include "core/relief/build.h"
#include "core/relief/draw_prewarp.h"

enum { KEPT = 2, WARPED_ID = 0 };
/* Eyes nearer to a panel's plane than that share of D have the next V: at M's own corner det of (2) is 0. */
#define PLANE_MARGIN 1e-3

/* Panels about one V, under one light; made when a view first sees them. */
struct cell {
    bool used, made[SV_CELL_FACES];
    struct sv_vec3 v;
    double distance_m;
    int size;
    uint64_t key;
    struct sv_relief panel[SV_CELL_FACES]; /* displ is zeta = D (q - 1): prewarp.h */
};

struct sv_cells_paper {
    const struct sv_scene *scene;
    struct sv_direct *direct;
    double (*clock_ms)(void);
    struct sv_prewarp_draw *draw;
    struct sv_gl_target *target; /* of the last size */
    int width, height;
    struct sv_picture panels; /* colour and depth of the quads */
    uint8_t *hidden;
    struct cell cells[KEPT]; /* the current one first */
};

static void finish_cell(struct cell *cell)
{
    for (int k = 0; k < SV_CELL_FACES; k++)
        if (cell->made[k])
            sv_relief_finish(&cell->panel[k]);
    *cell = (struct cell){0};
}

static void finish_size(struct sv_cells_paper *c)
{
    sv_gl_target_destroy(c->target);
    sv_picture_finish(&c->panels);
    free(c->hidden);
    c->target = NULL;
    c->panels = (struct sv_picture){0};
    c->hidden = NULL;
    c->width = c->height = 0;
}

void sv_cells_paper_destroy(struct sv_cells_paper *cells)
{
    if (!cells)
        return;
    finish_size(cells);
    for (int k = 0; k < KEPT; k++)
        finish_cell(&cells->cells[k]);
    sv_prewarp_draw_destroy(cells->draw);
    free(cells);
}

enum sv_status sv_cells_paper_create(const struct sv_scene *scene, struct sv_direct *direct,
                                     double (*clock_ms)(void), struct sv_cells_paper **cells,
                                     struct sv_error *error)
{
    struct sv_cells_paper *c = calloc(1, sizeof *c);
    if (!c)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for cells");
    c->scene = scene;
    c->direct = direct;
    c->clock_ms = clock_ms;
    enum sv_status status = sv_prewarp_draw_create(&c->draw, error);
    if (status) {
        sv_cells_paper_destroy(c);
        return status;
    }
    *cells = c;
    return SV_OK;
}

static enum sv_status want_size(struct sv_cells_paper *c, const struct sv_camera *camera,
                                struct sv_error *error)
{
    unsigned layers = 1u << SV_LAYER_COLOR | 1u << SV_LAYER_DEPTH;
    if (c->width == camera->width && c->height == camera->height)
        return SV_OK;
    finish_size(c);
    enum sv_status status = sv_gl_target_create(camera->width, camera->height, layers, &c->target, error);
    if (!status)
        status = sv_picture_alloc(camera, layers, &c->panels, error);
    if (status)
        return status;
    c->hidden = malloc((size_t)camera->width * (size_t)camera->height);
    if (!c->hidden)
        return sv_fail(error, SV_ENOMEM, "relief", "no memory for %d x %d pixels", camera->width,
                       camera->height);
    c->width = camera->width;
    c->height = camera->height;
    return SV_OK;
}

static double since(const struct sv_cells_paper *c, struct sv_cells_paper_report *report, enum sv_stage stage,
                    double from)
{
    double t = c->clock_ms ? c->clock_ms() : 0;
    report->ms[stage] = fmax(report->ms[stage], 0) + t - from;
    return t;
}

/* ---- which V ---- */

static bool in_region(struct sv_vec3 v, double distance_m, struct sv_vec3 eye)
{
    struct sv_vec3 o = sv_scale(sv_sub(eye, v), 1 / distance_m);
    return sv_region_holds(o) && fmax(fabs(o.x), fmax(fabs(o.y), fabs(o.z))) <= 1 - PLANE_MARGIN;
}

/* Everything but the place that panels depend on. */
static uint64_t key_of(const struct sv_cells_paper *c, const struct sv_resolved_view *v)
{
    uint64_t h = sv_hash_double(sv_hash_double(SV_HASH_INIT, v->sun.azimuth_rad), v->sun.elevation_rad);
    h = sv_hash_u64(h, (uint64_t)v->plan.shadows | (uint64_t)v->air << 1 | (uint64_t)v->plan.draw_trees << 2);
    h = sv_hash_u64(sv_hash_double(h, v->plan.relief_distance_m), (uint64_t)v->plan.relief_resolution);
    return sv_hash_u64(sv_hash_double(h, v->plan.tree_error_px), c->scene->version);
}

/* The next V. One ring nests in nothing, so the lattice's step is D and its cells are M: on the level the
 * diamonds of figure 7. */
static struct sv_vec3 next_v(const struct sv_cells_paper *c, const struct sv_resolved_view *view)
{
    struct sv_vec3 eye = view->camera.eye, level = {eye.x, eye.y, 0};
    double d = view->plan.relief_distance_m, ground;
    struct sv_cell_rings rings = {.count = 1, .distance_m = {d}, .pitch = 1};
    struct sv_cell_place chain[SV_CELL_RINGS_MAX];
    if (!sv_cell_chain(&rings, level, false, chain) ||
        !sv_heightfield_height(&c->scene->terrain.field, chain[0].v.x, chain[0].v.y, &ground))
        return eye;
    struct sv_vec3 v = {chain[0].v.x, chain[0].v.y, ground + eye.z - view->ground_z};
    return in_region(v, d, eye) ? v : eye;
}

/* cells[0] becomes one that the eye may use. */
static void choose_cell(struct sv_cells_paper *c, const struct sv_resolved_view *view)
{
    uint64_t key = key_of(c, view);
    int k = 0;
    while (k < KEPT - 1 && !(c->cells[k].used && c->cells[k].key == key &&
                             in_region(c->cells[k].v, c->cells[k].distance_m, view->camera.eye)))
        k++;
    struct cell cell = c->cells[k];
    memmove(&c->cells[1], &c->cells[0], (size_t)k * sizeof cell);
    c->cells[0] = cell;
    if (cell.used && cell.key == key && in_region(cell.v, cell.distance_m, view->camera.eye))
        return;
    finish_cell(&c->cells[0]);
    c->cells[0] = (struct cell){.used = true,
                                .v = next_v(c, view),
                                .distance_m = view->plan.relief_distance_m,
                                .size = view->plan.relief_resolution,
                                .key = key};
}

/* What a panel holds is where forward >= D / 2 (crowns reach before its plane), right and up within +-
 * forward: the hull of four corners and four directions; not in view when all of it is outside of one plane.
 */
static bool in_view(const struct cell *cell, const struct sv_camera *camera, enum sv_cell_face face)
{
    struct sv_vec3 right, up, forward, from = sv_sub(cell->v, camera->eye);
    double planes[5][4];
    sv_cell_face_axes(face, &right, &up, &forward);
    sv_camera_planes(camera, planes);
    for (int p = 0; p < 5; p++) {
        struct sv_vec3 normal = {planes[p][0], planes[p][1], planes[p][2]};
        bool inside = false;
        for (int k = 0; k < 4 && !inside; k++) {
            struct sv_vec3 d = sv_madd(sv_madd(forward, right, k & 1 ? 1 : -1), up, k & 2 ? 1 : -1);
            inside = sv_dot(normal, d) > 0 ||
                     sv_dot(normal, sv_madd(from, d, cell->distance_m / 2)) + planes[p][3] >= 0;
        }
        if (!inside)
            return false;
    }
    return true;
}

/* ---- a panel ---- */

/* The plane: texel (0, 0) at the upper left as V sees it, f to V. */
static struct sv_relief_frame frame_of(const struct cell *cell, enum sv_cell_face face)
{
    struct sv_vec3 right, up, forward;
    double d = cell->distance_m, texel = 2 * d / cell->size;
    sv_cell_face_axes(face, &right, &up, &forward);
    return (struct sv_relief_frame){.origin =
                                        sv_madd(sv_madd(sv_madd(cell->v, forward, d), right, -d), up, d),
                                    .a = sv_scale(right, texel),
                                    .b = sv_scale(up, -texel),
                                    .f = sv_scale(forward, -1)};
}

/* The z-buffer (near plane near_m) by (7)-(9). A texel is there when half of it is covered (relief.h): crowns
 * before the sky. */
static void take_panel(const struct cell *cell, const struct sv_picture *picture, double near_m,
                       struct sv_relief *panel)
{
    const uint8_t(*color)[4] = picture->layer[SV_LAYER_COLOR].data;
    const float *depth = picture->layer[SV_LAYER_DEPTH].data;
    struct sv_depth_form form = {.kind = SV_DEPTH_REVERSED_INFINITE, .near_m = near_m};
    int n = cell->size;
    for (int j = 0; j < n; j++)
        for (int i = 0; i < n; i++) {
            size_t k = (size_t)j * (size_t)n + (size_t)i;
            double z = sv_depth_linear(&form, (double)depth[k]), us, vs, displ;
            if (!(z > 0) || isinf(z) || color[k][3] < 128)
                continue;
            sv_depth_relief(cell->distance_m, n, i + 0.5, j + 0.5, z, &us, &vs, &displ); /* eq. 7, 8, 9 */
            panel->displ[k] = (float)(displ * cell->distance_m / z); /* zeta: at (u, v), not (u', v') */
            for (int c = 0; c < 3; c++)
                panel->color[k][c] =
                    color[k][3] == 255
                        ? color[k][c]
                        : sv_srgb8_from_linear(sv_linear_from_srgb8[color[k][c]] * 255 / (float)color[k][3]);
            panel->color[k][3] = 255;
        }
    sv_relief_measure(panel);
}

/* Terrain and objects beyond the plane, then trees over them: with the near plane at D / 2, for crowns. */
static enum sv_status draw_from_v(struct sv_cells_paper *c, const struct cell *cell,
                                  struct sv_resolved_view *view, struct sv_picture *picture,
                                  struct sv_error *error)
{
    struct sv_direct_pass pass = {.layers = 1u << SV_LAYER_COLOR | 1u << SV_LAYER_DEPTH, .sky = false};
    struct sv_tree_shell shell = {
        .inner = cell->v, .inner_m = cell->distance_m, .outer = cell->v, .outer_m = INFINITY};
    enum sv_status status = sv_picture_alloc(&view->camera, pass.layers, picture, error);
    if (!status)
        status = sv_direct_draw(c->direct, view, &pass, picture, NULL, error);
    if (status)
        return status;
    float *depth = picture->layer[SV_LAYER_DEPTH].data;
    for (size_t k = 0; k < (size_t)cell->size * (size_t)cell->size; k++)
        depth[k] *= 0.5f;
    view->camera.near_m /= 2;
    struct sv_canvas canvas = {.width = cell->size,
                               .height = cell->size,
                               .row_count = cell->size,
                               .depth = depth,
                               .color = picture->layer[SV_LAYER_COLOR].data,
                               .surface = true};
    return sv_direct_draw_trees(c->direct, view, &shell, &canvas, NULL, error);
}

static enum sv_status build(struct sv_cells_paper *c, struct cell *cell, const struct sv_resolved_view *view,
                            enum sv_cell_face face, struct sv_error *error)
{
    struct sv_resolved_view from_v = *view;
    struct sv_picture picture = {0};
    struct sv_relief panel;
    from_v.camera = (struct sv_camera){.eye = cell->v,
                                       .projection = SV_PROJECTION_PERSPECTIVE,
                                       .vfov_rad = SV_PI / 2,
                                       .width = cell->size,
                                       .height = cell->size,
                                       .near_m = cell->distance_m};
    sv_cell_face_axes(face, &from_v.camera.right, &from_v.camera.up, &from_v.camera.forward);
    enum sv_status status = sv_relief_alloc(cell->size, cell->size, &panel, error);
    if (status)
        return status;
    panel.frame = frame_of(cell, face);
    panel.cut = (float)(SV_PANEL_GROUND_CUT * 2 / cell->size * cell->distance_m);
    status = draw_from_v(c, cell, &from_v, &picture, error);
    if (!status)
        take_panel(cell, &picture, from_v.camera.near_m, &panel);
    sv_picture_finish(&picture);
    if (status) {
        sv_relief_finish(&panel);
        return status;
    }
    cell->panel[face] = panel;
    cell->made[face] = true;
    return SV_OK;
}

/* ---- a frame ---- */

/* zeta -> displ: what draw_prewarp.h takes. */
static void displ_of(const struct sv_warped *warped, double distance_m)
{
    for (size_t k = 0; k < (size_t)warped->width * (size_t)warped->height; k++) {
        double q = 1 + (double)warped->displ[k] / distance_m;
        warped->displ[k] = q > 0 ? (float)((double)warped->displ[k] / q) : -1e30f;
    }
}

static enum sv_status draw_panel(struct sv_cells_paper *c, const struct cell *cell,
                                 const struct sv_gl_frame *frame, enum sv_cell_face face,
                                 struct sv_cells_paper_report *report, struct sv_error *error)
{
    const struct sv_relief *panel = &cell->panel[face];
    struct sv_prewarp_options options = {.fill = true};
    struct sv_prewarp prewarp;
    struct sv_warped warped;
    enum sv_status status = sv_prewarp_panel(&panel->frame, cell->v, frame->camera.eye, &prewarp, error);
    if (!status)
        status = sv_prewarp_two_pass(panel, &prewarp, &options, &warped, error);
    if (status)
        return status;
    displ_of(&warped, cell->distance_m);
    report->holes += warped.holes;
    report->warped++;
    /* The texture of the plane is one picture, mapped bilinearly as such: no cut. */
    struct sv_prewarp_plane plane = {.frame = &panel->frame, .cut = INFINITY, .id = WARPED_ID};
    status = sv_prewarp_draw_upload(c->draw, &warped, NULL, error);
    if (!status)
        status = sv_prewarp_draw_plane(c->draw, frame, &plane, error);
    sv_warped_finish(&warped);
    return status;
}

/* Faces by rising gamma: the opposite wedge first, the own one last. */
static void sort_faces(const struct cell *cell, struct sv_vec3 eye, enum sv_cell_face order[SV_CELL_FACES])
{
    double gamma[SV_CELL_FACES];
    struct sv_vec3 right, up, forward;
    for (int k = 0; k < SV_CELL_FACES; k++) {
        sv_cell_face_axes((enum sv_cell_face)k, &right, &up, &forward);
        gamma[k] = sv_dot(sv_sub(eye, cell->v), forward);
        int at = k;
        for (; at > 0 && gamma[order[at - 1]] > gamma[k]; at--)
            order[at] = order[at - 1];
        order[at] = (enum sv_cell_face)k;
    }
}

static enum sv_status build_faces(struct sv_cells_paper *c, const struct sv_resolved_view *view,
                                  struct sv_cells_paper_report *report, struct sv_error *error)
{
    struct cell *cell = &c->cells[0];
    enum sv_status status = SV_OK;
    for (int k = 0; k < SV_CELL_FACES && !status; k++) {
        if (cell->made[k] || !in_view(cell, &view->camera, (enum sv_cell_face)k))
            continue;
        double t = c->clock_ms ? c->clock_ms() : 0;
        status = build(c, cell, view, (enum sv_cell_face)k, error);
        report->built++;
        since(c, report, SV_STAGE_CELL, t);
    }
    return status;
}

static enum sv_status draw_panels(struct sv_cells_paper *c, const struct sv_resolved_view *view,
                                  struct sv_cells_paper_report *report, struct sv_error *error)
{
    const struct cell *cell = &c->cells[0];
    enum sv_cell_face order[SV_CELL_FACES];
    struct sv_gl_frame frame;
    memset(&frame, 0, sizeof frame);
    frame.camera = view->camera;
    sv_light_from_sun(&view->sun, &frame.light);
    frame.light.air = view->air;
    sort_faces(cell, view->camera.eye, order);
    sv_gl_target_begin(c->target);
    enum sv_status status = sv_gl_frame_begin(&frame, error);
    for (int k = 0; k < SV_CELL_FACES && !status; k++)
        if (in_view(cell, &view->camera, order[k]) && cell->panel[order[k]].solid_count > 0)
            status = draw_panel(c, cell, &frame, order[k], report, error);
    if (!status)
        status = sv_gl_target_read(c->target, SV_LAYER_COLOR, &c->panels.layer[SV_LAYER_COLOR], error);
    if (!status)
        status = sv_gl_target_read(c->target, SV_LAYER_DEPTH, &c->panels.layer[SV_LAYER_DEPTH], error);
    return status;
}

/* Whether what the camera sees at a pixel, at that depth, is in the cube. */
static bool in_cube(const struct cell *cell, const struct sv_camera *camera, size_t pixel, float depth)
{
    struct sv_vec3 from, ray;
    double x = (double)(pixel % (size_t)camera->width) + 0.5;
    double y = (double)(pixel / (size_t)camera->width) + 0.5;
    sv_camera_ray(camera, x, y, &from, &ray);
    struct sv_vec3 p = sv_madd(sv_sub(camera->eye, cell->v), ray, camera->near_m / (double)depth);
    return fmax(fabs(p.x), fmax(fabs(p.y), fabs(p.z))) <= cell->distance_m;
}

/* Panels and geometry into one: geometry where it is in the cube and not behind a crown that reaches into it,
 * or where no panel has anything. */
static void compose(struct sv_cells_paper *c, const struct sv_camera *camera, struct sv_picture *geometry,
                    uint8_t *rgba, struct sv_cells_paper_report *report)
{
    const struct cell *cell = &c->cells[0];
    const uint8_t(*color)[4] = c->panels.layer[SV_LAYER_COLOR].data;
    const float *far = c->panels.layer[SV_LAYER_DEPTH].data;
    const uint8_t *own = geometry->layer[SV_LAYER_COLOR].data;
    float *depth = geometry->layer[SV_LAYER_DEPTH].data;
    for (size_t k = 0; k < (size_t)camera->width * (size_t)camera->height; k++) {
        bool near = depth[k] > far[k] && in_cube(cell, camera, k, depth[k]);
        c->hidden[k] = far[k] > 0 && !near;
        if (c->hidden[k]) {
            memcpy(rgba + 4 * k, color[k], 4);
            depth[k] = far[k];
            continue;
        }
        report->geometry += depth[k] > 0 && !near;
        if (own)
            memcpy(rgba + 4 * k, own + 4 * k, 4);
        else
            memset(rgba + 4 * k, 0, 4);
    }
}

/* Terrain and objects as they are, under what panels hold. What stands on the ground besides trees cannot be
 * shaded by depth alone. */
static enum sv_status draw_near(struct sv_cells_paper *c, const struct sv_resolved_view *view, bool sky,
                                uint8_t *rgba, struct sv_cells_paper_report *report,
                                struct sv_draw_stats *stats, struct sv_error *error)
{
    const struct cell *cell = &c->cells[0];
    struct sv_direct_pass pass = {.layers = 1u << SV_LAYER_DEPTH, .sky = sky};
    struct sv_tree_shell shell = {.inner_m = -1, .outer = cell->v, .outer_m = cell->distance_m};
    struct sv_picture geometry = {0};
    bool objects = c->scene->object_count > 0;
    double t = c->clock_ms ? c->clock_ms() : 0;
    if (objects)
        pass.layers |= 1u << SV_LAYER_COLOR;
    enum sv_status status = sv_picture_alloc(&view->camera, pass.layers, &geometry, error);
    if (!status)
        status = sv_direct_draw(c->direct, view, &pass, &geometry, stats, error);
    t = since(c, report, SV_STAGE_NEAR, t);
    const float *depth = geometry.layer[SV_LAYER_DEPTH].data;
    if (!status)
        compose(c, &view->camera, &geometry, rgba, report);
    if (!status && !objects)
        status = sv_direct_shade_ground(c->direct, view, sky, 0, view->camera.height, depth, c->hidden, rgba,
                                        error);
    t = since(c, report, SV_STAGE_COMPOSITE, t);
    if (!status) {
        struct sv_canvas canvas = {.width = view->camera.width,
                                   .height = view->camera.height,
                                   .row_count = view->camera.height,
                                   .depth = geometry.layer[SV_LAYER_DEPTH].data,
                                   .color = rgba};
        status = sv_direct_draw_trees(c->direct, view, &shell, &canvas, stats, error);
    }
    sv_picture_finish(&geometry);
    since(c, report, SV_STAGE_NEAR, t);
    return status;
}

enum sv_status sv_cells_paper_draw(struct sv_cells_paper *cells, const struct sv_resolved_view *view,
                                   bool sky, uint8_t *rgba, struct sv_cells_paper_report *report,
                                   struct sv_draw_stats *stats, struct sv_error *error)
{
    struct sv_cells_paper *c = cells;
    *report = (struct sv_cells_paper_report){0};
    for (int k = 0; k < SV_STAGE_COUNT; k++)
        report->ms[k] = -1;
    if (!(view->plan.relief_distance_m > 0) || view->plan.relief_resolution < 1)
        return sv_fail(error, SV_EINVAL, "relief", "no distance and resolution of panels");
    enum sv_status status = want_size(c, &view->camera, error);
    if (status)
        return status;
    choose_cell(c, view);
    report->v = c->cells[0].v;
    status = build_faces(c, view, report, error);
    double t = c->clock_ms ? c->clock_ms() : 0;
    if (!status)
        status = draw_panels(c, view, report, error);
    since(c, report, SV_STAGE_WARP, t);
    return status ? status : draw_near(c, view, sky, rgba, report, stats, error);
}
