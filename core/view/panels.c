/* panels.c - see panels.h. */
#include "core/view/panels.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Leaves a pixel of a crowns panel, whatever the view asks for: its texels are seen again and again. */
enum { PANEL_LEAF_SAMPLES = 4 };

struct sv_panels {
    const struct sv_scene *scene;
    struct sv_direct *direct;
    struct sv_sweep_blocks *blocks;
    uint8_t *color; /* canvas of a crowns panel */
    float *depth;
    size_t pixels;
    struct sv_panel_room rooms[2]; /* crowns, ground; size 0: none yet */
    struct sv_panel_about drawn;
};

enum sv_status sv_panels_create(const struct sv_scene *scene, struct sv_direct *direct,
                                struct sv_panels **panels, struct sv_error *error)
{
    struct sv_panels *p = calloc(1, sizeof *p);
    if (!p)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory to draw panels");
    p->scene = scene;
    p->direct = direct;
    enum sv_status status = sv_sweep_blocks_create(&scene->terrain.field, &p->blocks, error);
    if (status) {
        sv_panels_destroy(p);
        return status;
    }
    *panels = p;
    return SV_OK;
}

void sv_panels_destroy(struct sv_panels *panels)
{
    if (!panels)
        return;
    sv_sweep_blocks_destroy(panels->blocks);
    free(panels->color);
    free(panels->depth);
    for (int k = 0; k < 2; k++)
        sv_panel_room_finish(&panels->rooms[k]);
    free(panels);
}

static enum sv_status make_canvas(struct sv_panels *p, size_t pixels, struct sv_error *error)
{
    if (p->pixels >= pixels)
        return SV_OK;
    free(p->color);
    free(p->depth);
    p->pixels = 0;
    p->color = malloc(4 * pixels);
    p->depth = malloc(pixels * sizeof *p->depth);
    if (!p->color || !p->depth)
        return sv_fail(error, SV_ENOMEM, "relief", "no memory to draw a panel of %zu texels", pixels);
    p->pixels = pixels;
    return SV_OK;
}

/* A room for one layer. */
static enum sv_status make_room(struct sv_panels *p, const struct sv_panel_about *about,
                                struct sv_panel_room **room, struct sv_error *error)
{
    *room = &p->rooms[about->layers & SV_PANEL_CROWNS ? 0 : 1];
    if ((*room)->size == about->size)
        return SV_OK;
    sv_panel_room_finish(*room);
    return sv_panel_room_create(about->size, about->layers, *room, error);
}

double sv_panels_ground_reach(int size)
{
    return 1 + 2.0 / size;
}

struct sv_camera sv_panels_camera(const struct sv_panels_order *order)
{
    bool crowns = order->about.layers & SV_PANEL_CROWNS;
    struct sv_camera c = {.eye = order->about.place.v,
                          .projection = SV_PROJECTION_PERSPECTIVE,
                          .vfov_rad = 2 * atan(crowns ? 1 : sv_panels_ground_reach(order->about.size)),
                          .width = order->about.size,
                          .height = order->about.size,
                          .near_m = crowns ? order->about.distance_m / 2 : order->about.distance_m};
    sv_cell_face_axes(order->about.face, &c.right, &c.up, &c.forward);
    return c;
}

/* The view from the reference point through the face. */
static struct sv_resolved_view face_view(const struct sv_panels_order *order)
{
    struct sv_resolved_view view = *order->view;
    view.camera = sv_panels_camera(order);
    view.plan.samples = 1;
    view.plan.leaf_samples = PANEL_LEAF_SAMPLES;
    return view;
}

static struct sv_tree_shell tree_shell(const struct sv_panels_order *order)
{
    return (struct sv_tree_shell){order->shell.v, order->shell.outer_v, order->shell.distance_m,
                                  order->shell.outer_m};
}

enum sv_status sv_panels_size(struct sv_panels *panels, const struct sv_panels_order *order, int *size,
                              struct sv_error *error)
{
    bool any = true;
    enum sv_status status = SV_OK;
    if (order->about.layers & SV_PANEL_CROWNS) {
        struct sv_resolved_view view = face_view(order);
        struct sv_tree_shell shell = tree_shell(order);
        status = sv_direct_sees_trees(panels->direct, &view, &shell, &any, error);
    }
    if (!status)
        *size = any ? order->about.size : SV_PANEL_SIZE_MIN;
    return status;
}

/* Trees alone: what the ground hides of them is found when they are composed with it, from where the eye is
 * then. */
static enum sv_status draw_crowns(struct sv_panels *p, const struct sv_panels_order *order,
                                  const struct sv_panel_room *room, struct sv_error *error)
{
    size_t pixels = (size_t)order->about.size * (size_t)order->about.size;
    enum sv_status status = make_canvas(p, pixels, error);
    if (status)
        return status;
    memset(p->color, 0, 4 * pixels);
    memset(p->depth, 0, pixels * sizeof *p->depth);
    struct sv_resolved_view view = face_view(order);
    struct sv_canvas canvas = {.width = order->about.size,
                               .height = order->about.size,
                               .row_count = order->about.size,
                               .depth = p->depth,
                               .color = p->color,
                               .surface = true};
    struct sv_tree_shell shell = tree_shell(order);
    status = sv_direct_draw_trees(p->direct, &view, &shell, &canvas, NULL, error);
    if (status)
        return status;
    struct sv_panel_drawing drawing = {.color = p->color, .depth = p->depth, .q_per_depth = 2, .scale = 1};
    return sv_panel_crowns(&drawing, room, error);
}

/* Whether any object may be seen through the face. */
static bool objects_in_face(const struct sv_panels *p, const struct sv_panels_order *order)
{
    struct sv_vec3 right, up, forward;
    sv_cell_face_axes(order->about.face, &right, &up, &forward);
    for (int k = 0; k < p->scene->object_count; k++) {
        const struct sv_scene_object *o = &p->scene->objects[k];
        double r = o->height_m * (double)p->scene->models[o->model].mesh.radius + o->height_m;
        struct sv_vec3 d = sv_sub((struct sv_vec3){o->x, o->y, o->z}, order->about.place.v);
        double z = sv_dot(d, forward) + r;
        if (z > 0 && fabs(sv_dot(d, right)) <= z + r && fabs(sv_dot(d, up)) <= z + r)
            return true;
    }
    return false;
}

/* Premultiplied colour and window depth as a ground panel holds them: opaque or nothing. */
static void take_ground(const struct sv_picture *picture, size_t pixels, const struct sv_panel_room *room)
{
    const uint8_t(*color)[4] = picture->layer[SV_LAYER_COLOR].data;
    const float *depth = picture->layer[SV_LAYER_DEPTH].data;
    for (size_t k = 0; k < pixels; k++) {
        bool there = depth[k] > 0;
        memcpy(room->ground_color[k], color[k], 4);
        room->ground_color[k][3] = there ? 255 : 0;
        room->ground_q[k] = there ? depth[k] : 0;
    }
}

/* Terrain and objects. */
static enum sv_status draw_opaque(struct sv_panels *p, const struct sv_panels_order *order,
                                  const struct sv_panel_room *room, struct sv_error *error)
{
    struct sv_resolved_view view = face_view(order);
    struct sv_direct_pass pass = {.layers = 1u << SV_LAYER_COLOR | 1u << SV_LAYER_DEPTH};
    struct sv_picture picture = {0};
    enum sv_status status = sv_picture_alloc(&view.camera, pass.layers, &picture, error);
    if (!status)
        status = sv_direct_draw(p->direct, &view, &pass, &picture, NULL, error);
    if (!status)
        take_ground(&picture, (size_t)order->about.size * (size_t)order->about.size, room);
    sv_picture_finish(&picture);
    return status;
}

static enum sv_status draw_ground(struct sv_panels *p, const struct sv_panels_order *order,
                                  const struct sv_panel_room *room, struct sv_error *error)
{
    if (objects_in_face(p, order))
        return draw_opaque(p, order, room, error);
    struct sv_sweep sweep = {.field = &p->scene->terrain.field,
                             .blocks = p->blocks,
                             .v = order->about.place.v,
                             .distance_m = order->about.distance_m,
                             .face = order->about.face,
                             .size = order->about.size,
                             .reach = sv_panels_ground_reach(order->about.size)};
    return sv_direct_ground_panel(p->direct, order->view, &sweep, room->ground_q, room->ground_color, error);
}

enum sv_status sv_panels_draw(struct sv_panels *panels, const struct sv_panels_order *order, size_t *bytes,
                              struct sv_error *error)
{
    struct sv_panel_room *room;
    enum sv_status status = make_room(panels, &order->about, &room, error);
    if (!status)
        status = order->about.layers & SV_PANEL_CROWNS ? draw_crowns(panels, order, room, error)
                                                       : draw_ground(panels, order, room, error);
    if (status)
        return status;
    panels->drawn = order->about;
    *bytes = sv_panel_measure(room);
    return SV_OK;
}

enum sv_status sv_panels_write(const struct sv_panels *panels, void *block, size_t bytes,
                               struct sv_error *error)
{
    const struct sv_panel_room *room = &panels->rooms[panels->drawn.layers & SV_PANEL_CROWNS ? 0 : 1];
    return sv_panel_write(room, &panels->drawn, block, bytes, error);
}

static bool meets_object(const struct sv_panels *p, struct sv_vec3 v, double half_m)
{
    for (int k = 0; k < p->scene->object_count; k++) {
        const struct sv_scene_object *o = &p->scene->objects[k];
        double r = o->height_m * (double)p->scene->models[o->model].mesh.radius + half_m;
        if (fabs(o->x - v.x) <= r && fabs(o->y - v.y) <= r && o->z <= v.z + half_m &&
            o->z + o->height_m >= v.z - half_m)
            return true;
    }
    return false;
}

/* The samples within the square and one beyond on each side bound the ground in it. */
static bool meets_ground(const struct sv_heightfield *f, struct sv_vec3 v, double half_m)
{
    double i0 = floor((v.x - half_m - f->x0) / f->dx), i1 = ceil((v.x + half_m - f->x0) / f->dx);
    double j0 = floor((v.y - half_m - f->y0) / f->dy), j1 = ceil((v.y + half_m - f->y0) / f->dy);
    int first_i = (int)fmax(i0, 0), last_i = (int)fmin(i1, f->width - 1);
    int first_j = (int)fmax(j0, 0), last_j = (int)fmin(j1, f->height - 1);
    double bottom = v.z - half_m - f->z0;
    for (int j = first_j; j <= last_j; j++)
        for (int i = first_i; i <= last_i; i++)
            if ((double)f->h[(size_t)j * (size_t)f->width + (size_t)i] >= bottom)
                return true;
    return false;
}

int sv_panels_free_ring(const struct sv_panels *panels, const struct sv_cell_rings *rings,
                        const struct sv_cell_place chain[SV_CELL_RINGS_MAX])
{
    int ring = rings->count - 1;
    while (ring >= 0 &&
           (meets_ground(&panels->scene->terrain.field, chain[ring].v, rings->distance_m[ring]) ||
            meets_object(panels, chain[ring].v, rings->distance_m[ring])))
        ring--;
    return ring;
}
