/* panels_refine.c - see panels_refine.h. */
#include "core/view/panels_refine.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/cell/panel_ground.h"
#include "core/truth/texels.h"

struct sv_panels_refinement {
    const struct sv_truth *truth;
    struct sv_truth_part *part; /* of crowns; NULL: none is seen */
    struct sv_truth_texels_options options;
    struct sv_camera camera;
    struct sv_light light;
    struct sv_panel_about about;
    struct sv_panel_room room;
    int next;
    float (*linear)[4], *inverse_m; /* a row */
};

/* Whether the tree belongs to the shell and may be seen through the face: by a box around all of it. */
static bool is_seen(const struct sv_scene *scene, const struct sv_panels_order *order,
                    const struct sv_tree *tree)
{
    double h = (double)tree->height_m, r = h * (double)scene->species[tree->species].mesh.radius;
    struct sv_vec3 foot = sv_vec3(tree->x, tree->y, tree->z);
    return sv_cell_in_shell(&order->shell, foot, h, r) &&
           sv_cell_sees_box(&order->shell, order->about.face, sv_sub(foot, sv_vec3(r, r, r)),
                            sv_add(foot, sv_vec3(r, r, h + r)));
}

static enum sv_status gather_trees(struct sv_panels_refinement *r, const struct sv_scene *scene,
                                   const struct sv_panels_order *order, struct sv_error *error)
{
    const struct sv_forest *forest = &scene->forest;
    uint32_t count = 0, *trees = malloc(((size_t)forest->count + 1) * sizeof *trees);
    if (!trees)
        return sv_fail(error, SV_ENOMEM, "relief", "no memory to choose from %u trees", forest->count);
    for (uint32_t k = 0; k < forest->count; k++)
        if (is_seen(scene, order, &forest->trees[k]))
            trees[count++] = k;
    enum sv_status status = SV_OK;
    if (count > 0)
        status = sv_truth_part_create(r->truth, trees, count, &r->part, error);
    free(trees);
    return status;
}

enum sv_status sv_panels_refine_begin(const struct sv_scene *scene, const struct sv_truth *truth,
                                      const struct sv_panels_order *order, int samples,
                                      struct sv_panels_refinement **refinement, struct sv_error *error)
{
    size_t width = (size_t)order->about.size;
    struct sv_panels_refinement *r = calloc(1, sizeof *r);
    if (!r)
        return sv_fail(error, SV_ENOMEM, "relief", "no memory to refine a panel");
    *r = (struct sv_panels_refinement){
        .truth = truth,
        .options = {samples, order->view->plan.shadows, order->view->plan.draw_trees},
        .camera = sv_panels_camera(order),
        .about = order->about,
        .linear = malloc(width * sizeof *r->linear),
        .inverse_m = malloc(width * sizeof *r->inverse_m)};
    sv_light_from_sun(&order->view->sun, &r->light);
    r->light.air = order->view->air;
    enum sv_status status = sv_panel_room_create(order->about.size, order->about.layers, &r->room, error);
    if (!status && (!r->linear || !r->inverse_m))
        status = sv_fail(error, SV_ENOMEM, "relief", "no memory for a row of %zu texels", width);
    if (!status && order->about.layers & SV_PANEL_CROWNS)
        status = gather_trees(r, scene, order, error);
    if (status) {
        sv_panels_refine_destroy(r);
        return status;
    }
    *refinement = r;
    return SV_OK;
}

static void put_crowns(const struct sv_panels_refinement *r)
{
    size_t first = (size_t)r->next * (size_t)r->about.size;
    for (int i = 0; i < r->about.size; i++) {
        uint8_t *color = r->room.color[first + (size_t)i];
        float q = r->inverse_m[i] * (float)r->about.distance_m * SV_PANEL_Q_ONE + 0.5f;
        for (int c = 0; c < 3; c++)
            color[c] = (uint8_t)(255 * sqrtf(r->linear[i][c]) + 0.5f);
        color[3] = (uint8_t)(255 * r->linear[i][3] + 0.5f);
        r->room.q[first + (size_t)i] = color[3] == 0 ? 0 : (uint16_t)fmaxf(fminf(q, 65535), 1);
        if (color[3] == 0)
            memset(color, 0, 4);
    }
}

static void crowns_row(const struct sv_panels_refinement *r)
{
    if (r->part) {
        sv_truth_trees_row(r->part, &r->camera, &r->light, &r->options, r->next, r->linear, r->inverse_m);
    } else {
        memset(r->linear, 0, (size_t)r->about.size * sizeof *r->linear);
        memset(r->inverse_m, 0, (size_t)r->about.size * sizeof *r->inverse_m);
    }
    put_crowns(r);
}

static void ground_row(const struct sv_panels_refinement *r)
{
    size_t first = (size_t)r->next * (size_t)r->about.size;
    double apart = (double)SV_PANEL_GROUND_CUT * 2 / r->about.size / r->about.distance_m;
    sv_truth_ground_row(r->truth, &r->camera, &r->light, &r->options, apart, r->next, r->linear,
                        r->inverse_m);
    for (int i = 0; i < r->about.size; i++) {
        uint8_t *color = r->room.ground_color[first + (size_t)i];
        bool there = r->inverse_m[i] > 0;
        for (int c = 0; c < 3; c++)
            color[c] = there ? sv_srgb8_from_linear(r->linear[i][c]) : 0;
        color[3] = there ? 255 : 0;
        r->room.ground_q[first + (size_t)i] = r->inverse_m[i] * (float)r->about.distance_m;
    }
}

bool sv_panels_refine_row(struct sv_panels_refinement *r)
{
    bool crowns = r->about.layers & SV_PANEL_CROWNS;
    if (r->next < r->about.size) {
        if (crowns)
            crowns_row(r);
        else
            ground_row(r);
        r->next++;
    }
    return r->next < r->about.size;
}

size_t sv_panels_refine_measure(struct sv_panels_refinement *r)
{
    return sv_panel_measure(&r->room);
}

enum sv_status sv_panels_refine_write(const struct sv_panels_refinement *r, void *block, size_t bytes,
                                      struct sv_error *error)
{
    return sv_panel_write(&r->room, &r->about, block, bytes, error);
}

void sv_panels_refine_destroy(struct sv_panels_refinement *r)
{
    if (!r)
        return;
    sv_truth_part_destroy(r->part);
    sv_panel_room_finish(&r->room);
    free(r->linear);
    free(r->inverse_m);
    free(r);
}
