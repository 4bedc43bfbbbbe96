/* object_sun.c - see object_sun.h. */
#include "core/relief/object_sun.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/frames.h"

/* Model space has height 1; what is a billion times that is no model (object.c has the same). */
static const float REACH_MAX = 1e9f;
enum { BORDER = 2 }; /* empty texels around, so that a lookup between texels ends in light */

struct axes {
    struct sv_vec3 right, down, travel; /* in model space */
};

/* Silhouette's axes for a direction of light: right is horizontal, down away from the zenith. */
static struct axes make_axes(struct sv_vec3 travel)
{
    struct axes a = {.travel = sv_normalize(travel)};
    a.right = sv_cross(a.travel, sv_vec3(0, 0, 1));
    a.right = sv_length(a.right) > 1e-9 ? sv_normalize(a.right) : sv_vec3(1, 0, 0);
    a.down = sv_cross(a.travel, a.right);
    return a;
}

static struct sv_vec3 vertex_place(const struct sv_tree_mesh *mesh, uint32_t v)
{
    const float *p = mesh->vertices[v].position;
    return sv_vec3((double)p[0], (double)p[1], (double)p[2]);
}

static void outline(const struct sv_tree_mesh *mesh, const struct axes *a, double lo[3], double hi[3])
{
    for (int k = 0; k < 3; k++)
        lo[k] = INFINITY, hi[k] = -INFINITY;
    for (uint32_t i = 0; i < mesh->vertex_count; i++) {
        struct sv_vec3 p = vertex_place(mesh, i);
        const double at[3] = {sv_dot(p, a->right), sv_dot(p, a->down), sv_dot(p, a->travel)};
        for (int k = 0; k < 3; k++)
            lo[k] = fmin(lo[k], at[k]), hi[k] = fmax(hi[k], at[k]);
    }
}

/* One corner in the map: texel coordinates, depth, and where it is in its texture. */
struct corner {
    float x, y, depth, uv[2];
};

static bool kept(const struct sv_tree_material *m, float u, float v)
{
    int at[2];
    const float uv[2] = {u, v};
    const int size[2] = {m->albedo.width, m->albedo.height};
    for (int k = 0; k < 2; k++) {
        float in = uv[k] - floorf(uv[k]); /* NaN where it is not finite */
        at[k] = in > 0 ? (int)(in * (float)size[k]) : 0;
        at[k] = at[k] >= size[k] ? size[k] - 1 : at[k];
    }
    const uint8_t *texel =
        (const uint8_t *)m->albedo.data + 4 * ((size_t)at[1] * (size_t)size[0] + (size_t)at[0]);
    return (float)texel[3] / 255.0f * m->base_color[3] >= m->alpha_cutoff;
}

/* What edges' tests forgive, texels across an edge: more than floats of 1024 texels round by. Light straight
 * down on a model that is turned by 45 degrees puts rows of texel centres on the very edges of its triangles;
 * by rounding alone they would lie in neither of the two, and single texels in its shadow would be lit. */
#define SLACK 6e-4f

static float unit(float x)
{
    return x < 0 ? 0 : x > 1 ? 1 : x;
}

static void draw_triangle(const struct sv_tree_material *m, const struct corner *a, const struct corner *b,
                          const struct corner *c, int width, int height, float *first)
{
    float bx = b->x - a->x, by = b->y - a->y, cx = c->x - a->x, cy = c->y - a->y, area = bx * cy - by * cx;
    if (!(fabsf(area) > 1e-9f))
        return; /* seen edge on */
    int x0 = (int)floorf(fminf(a->x, fminf(b->x, c->x))), x1 = (int)ceilf(fmaxf(a->x, fmaxf(b->x, c->x)));
    int y0 = (int)floorf(fminf(a->y, fminf(b->y, c->y))), y1 = (int)ceilf(fmaxf(a->y, fmaxf(b->y, c->y)));
    x0 = x0 < 0 ? 0 : x0, y0 = y0 < 0 ? 0 : y0;
    x1 = x1 > width ? width : x1, y1 = y1 > height ? height : y1;
    bool masked = m->masked && m->albedo.data;
    float slack = SLACK * (fabsf(bx) + fabsf(by) + fabsf(cx) + fabsf(cy)) / fabsf(area);
    for (int y = y0; y < y1; y++)
        for (int x = x0; x < x1; x++) {
            float px = (float)x + 0.5f - a->x, py = (float)y + 0.5f - a->y;
            float u = (px * cy - py * cx) / area, v = (bx * py - by * px) / area;
            if (u < -slack || v < -slack || u + v > 1 + slack)
                continue;
            u = unit(u), v = unit(v);
            float w = unit(1 - u - v), depth = w * a->depth + u * b->depth + v * c->depth;
            float *at = &first[(size_t)y * (size_t)width + (size_t)x];
            if (depth < *at && (!masked || kept(m, w * a->uv[0] + u * b->uv[0] + v * c->uv[0],
                                                w * a->uv[1] + u * b->uv[1] + v * c->uv[1])))
                *at = depth;
        }
}

static void draw(const struct sv_tree_mesh *mesh, const struct axes *a, const double corner[3], double texel,
                 int width, int height, float *first)
{
    for (int k = 0; k < mesh->material_count; k++) {
        const struct sv_tree_material *m = &mesh->materials[k];
        for (uint32_t i = 0; i < m->index_count; i += 3) {
            struct corner at[3];
            for (uint32_t c = 0; c < 3; c++) {
                uint32_t v = mesh->indices[m->first_index + i + c];
                struct sv_vec3 p = vertex_place(mesh, v);
                at[c] = (struct corner){(float)((sv_dot(p, a->right) - corner[0]) / texel),
                                        (float)((sv_dot(p, a->down) - corner[1]) / texel),
                                        (float)(sv_dot(p, a->travel) - corner[2]),
                                        {mesh->vertices[v].uv[0], mesh->vertices[v].uv[1]}};
            }
            draw_triangle(m, &at[0], &at[1], &at[2], width, height, first);
        }
    }
}

static enum sv_status check(const struct sv_tree_mesh *mesh, double heading_rad, struct sv_vec3 travel,
                            int side, struct sv_error *error)
{
    double length = sv_length(travel);
    if (side < SV_OBJECT_SUN_SIDE_MIN || side > SV_OBJECT_SUN_SIDE_MAX)
        return sv_fail(error, SV_EINVAL, "side", "is %d texels, must be %d to %d", side,
                       SV_OBJECT_SUN_SIDE_MIN, SV_OBJECT_SUN_SIDE_MAX);
    if (!(length > 0) || !isfinite(length) || !isfinite(heading_rad))
        return sv_fail(error, SV_EINVAL, "travel", "(%g, %g, %g), heading %g: no finite direction", travel.x,
                       travel.y, travel.z, heading_rad);
    if (mesh->vertex_count == 0)
        return sv_fail(error, SV_EINVAL, "mesh", "has no vertices");
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        const float *p = mesh->vertices[v].position;
        if (!(fabsf(p[0]) <= REACH_MAX && fabsf(p[1]) <= REACH_MAX && fabsf(p[2]) <= REACH_MAX))
            return sv_fail(error, SV_EINVAL, "mesh", "has a vertex at (%g, %g, %g)", (double)p[0],
                           (double)p[1], (double)p[2]);
    }
    return SV_OK;
}

enum sv_status sv_object_sun_create(const struct sv_tree_mesh *mesh, double heading_rad,
                                    struct sv_vec3 travel, int side, struct sv_object_sun *out,
                                    struct sv_error *error)
{
    enum sv_status status = check(mesh, heading_rad, travel, side, error);
    if (status != SV_OK)
        return status;
    const struct axes world = make_axes(travel);
    const struct axes model = {sv_rotate_clockwise(world.right, -heading_rad),
                               sv_rotate_clockwise(world.down, -heading_rad),
                               sv_rotate_clockwise(world.travel, -heading_rad)};
    double lo[3], hi[3];
    outline(mesh, &model, lo, hi);
    double longest = fmax(hi[0] - lo[0], hi[1] - lo[1]), texel = longest / side;
    if (!(texel > 0) || !isfinite(texel))
        return sv_fail(error, SV_EINVAL, "mesh", "has an outline of %g by %g", hi[0] - lo[0], hi[1] - lo[1]);
    int width = (int)ceil((hi[0] - lo[0]) / texel - 1e-6) + 2 * BORDER;
    int height = (int)ceil((hi[1] - lo[1]) / texel - 1e-6) + 2 * BORDER;
    size_t texels = (size_t)width * (size_t)height;
    float *first = malloc(texels * (sizeof *first + 1));
    if (!first)
        return sv_fail(error, SV_ENOMEM, "sun", "no memory for %d x %d texels", width, height);
    uint8_t *coverage = (uint8_t *)(first + texels);
    const double corner[3] = {lo[0] - BORDER * texel, lo[1] - BORDER * texel, 0};
    for (size_t i = 0; i < texels; i++)
        first[i] = INFINITY;
    draw(mesh, &model, corner, texel, width, height, first);
    for (size_t i = 0; i < texels; i++)
        coverage[i] = first[i] < INFINITY ? 255 : 0;
    *out = (struct sv_object_sun){
        .silhouette = {.width = width,
                       .height = height,
                       .coverage = coverage,
                       .first = first,
                       .corner = sv_madd(sv_scale(world.right, corner[0]), world.down, corner[1]),
                       .right = world.right,
                       .down = world.down,
                       .travel = world.travel,
                       .width_m = width * texel,
                       .height_m = height * texel,
                       .first_m = lo[2],
                       .last_m = hi[2]},
        .texel = texel,
        .block = first};
    return SV_OK;
}

void sv_object_sun_finish(struct sv_object_sun *sun)
{
    free(sun->block);
    *sun = (struct sv_object_sun){0};
}

float sv_object_sun_seen(const struct sv_object_sun *sun, struct sv_vec3 p, double bias)
{
    const struct sv_silhouette *s = &sun->silhouette;
    struct sv_vec3 d = sv_sub(p, s->corner);
    double x = sv_dot(d, s->right) / sun->texel - 0.5, y = sv_dot(d, s->down) / sun->texel - 0.5;
    double depth = sv_dot(d, s->travel) - bias;
    if (!(x >= 0 && y >= 0 && x < s->width - 1 && y < s->height - 1))
        return 1;
    int i = (int)x, j = (int)y;
    double u = x - i, v = y - j;
    const float *at = &s->first[(size_t)j * (size_t)s->width + (size_t)i];
    double top = (1 - u) * ((double)at[0] >= depth) + u * ((double)at[1] >= depth);
    at += s->width;
    double bottom = (1 - u) * ((double)at[0] >= depth) + u * ((double)at[1] >= depth);
    return (float)((1 - v) * top + v * bottom);
}
