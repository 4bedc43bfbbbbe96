/* impostor_raster.c - see impostor_raster.h. Half-plane test over each triangle's box, the depth as an affine
 * function; a sample on an edge may go to both triangles, which a z-buffer does not mind. */
#include "core/tree/impostor_raster.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"

enum { TEXTURE_SIDE_MIN = 256 };

static int scaled(int side)
{
    int k = 1;
    while (side * k < TEXTURE_SIDE_MIN)
        k++;
    return side * k;
}

/* Bilinear, repeating, at the texel centre (i, j) of the prepared texture: the rule of mesh.h. */
static void bilinear(const struct sv_image *image, float x, float y, float rgba[4])
{
    const uint8_t *data = image->data;
    int w = image->width, h = image->height;
    float bx = floorf(x), by = floorf(y), fx = x - bx, fy = y - by;
    int x0 = ((int)bx % w + w) % w, y0 = ((int)by % h + h) % h, x1 = (x0 + 1) % w, y1 = (y0 + 1) % h;
    const uint8_t *taps[4] = {
        data + 4 * ((size_t)y0 * (size_t)w + (size_t)x0), data + 4 * ((size_t)y0 * (size_t)w + (size_t)x1),
        data + 4 * ((size_t)y1 * (size_t)w + (size_t)x0), data + 4 * ((size_t)y1 * (size_t)w + (size_t)x1)};
    float weights[4] = {(1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy};
    memset(rgba, 0, 4 * sizeof *rgba);
    for (int k = 0; k < 4; k++) {
        for (int c = 0; c < 3; c++)
            rgba[c] += weights[k] * sv_linear_from_srgb8[taps[k][c]];
        rgba[3] += weights[k] * (float)taps[k][3];
    }
}

static enum sv_status prepare_texture(const struct sv_tree_material *m, struct sv_raster_texture *texture,
                                      struct sv_error *error)
{
    const struct sv_image *image = &m->albedo;
    if (!image->data)
        return SV_OK;
    int w = scaled(image->width), h = scaled(image->height);
    size_t count = (size_t)w * (size_t)h;
    uint8_t *texels = calloc(1, count * 3 + count / 8 + 1), *mask = texels + count * 3;
    if (!texels)
        return sv_fail(error, SV_ENOMEM, m->name, "no memory for a mask of %d x %d", w, h);
    float sx = (float)image->width / (float)w, sy = (float)image->height / (float)h;
    for (int j = 0; j < h; j++)
        for (int i = 0; i < w; i++) {
            float rgba[4];
            size_t at = (size_t)j * (size_t)w + (size_t)i;
            bilinear(image, ((float)i + 0.5f) * sx - 0.5f, ((float)j + 0.5f) * sy - 0.5f, rgba);
            for (int c = 0; c < 3; c++)
                texels[3 * at + (size_t)c] = sv_srgb8_from_linear(rgba[c]);
            bool kept = !(m->masked && rgba[3] * (1.0f / 255.0f) * m->base_color[3] < m->alpha_cutoff);
            mask[at / 8] = (uint8_t)(mask[at / 8] | kept << at % 8);
        }
    *texture = (struct sv_raster_texture){w, h, texels, mask};
    return SV_OK;
}

enum sv_status sv_raster_set_mesh(struct sv_raster *r, const struct sv_tree_mesh *mesh,
                                  struct sv_error *error)
{
    uint32_t count = mesh->vertex_count ? mesh->vertex_count : 1;
    r->mesh = mesh;
    if (r->vertex_room >= count)
        return SV_OK;
    free(r->x);
    free(r->y);
    free(r->z);
    r->x = malloc(count * sizeof(float));
    r->y = malloc(count * sizeof(float));
    r->z = malloc(count * sizeof(float));
    r->vertex_room = r->x && r->y && r->z ? count : 0;
    if (r->vertex_room)
        return SV_OK;
    return sv_fail(error, SV_ENOMEM, "raster", "no memory to draw a mesh of %u vertices", count);
}

enum sv_status sv_raster_resize(struct sv_raster *r, int width, int height, struct sv_error *error)
{
    size_t samples = (size_t)width * (size_t)height;
    r->width = width;
    r->height = height;
    if (samples <= r->sample_room)
        return SV_OK;
    free(r->depth);
    free(r->triangle);
    free(r->material);
    r->depth = malloc(samples * sizeof(float));
    r->triangle = malloc(samples * sizeof(int32_t));
    r->material = malloc(samples);
    r->sample_room = r->depth && r->triangle && r->material ? samples : 0;
    if (r->sample_room)
        return SV_OK;
    return sv_fail(error, SV_ENOMEM, "raster", "no memory for a picture of %d x %d", width, height);
}

enum sv_status sv_raster_init(const struct sv_tree_mesh *mesh, int width, int height,
                              struct sv_raster *raster, struct sv_error *error)
{
    *raster = (struct sv_raster){.mesh = mesh};
    enum sv_status status = sv_raster_resize(raster, width, height, error);
    if (!status)
        status = sv_raster_set_mesh(raster, mesh, error);
    for (int m = 0; !status && m < mesh->material_count; m++)
        status = prepare_texture(&mesh->materials[m], &raster->textures[m], error);
    if (status)
        sv_raster_finish(raster);
    return status;
}

void sv_raster_finish(struct sv_raster *raster)
{
    for (int m = 0; m < SV_TREE_MATERIALS_MAX; m++)
        free(raster->textures[m].texels);
    free(raster->x);
    free(raster->y);
    free(raster->z);
    free(raster->depth);
    free(raster->triangle);
    free(raster->material);
    *raster = (struct sv_raster){0};
}

static float dot3(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

void sv_raster_aim(struct sv_raster *r, struct sv_raster_view *view)
{
    float lo[2] = {INFINITY, INFINITY}, hi[2] = {-INFINITY, -INFINITY};
    uint32_t count = r->mesh->vertex_count;
    for (uint32_t i = 0; i < count; i++) {
        const float *p = r->mesh->vertices[i].position;
        r->x[i] = dot3(p, view->right);
        r->y[i] = dot3(p, view->up);
        r->z[i] = dot3(p, view->toward);
        lo[0] = r->x[i] < lo[0] ? r->x[i] : lo[0];
        hi[0] = r->x[i] > hi[0] ? r->x[i] : hi[0];
        lo[1] = r->y[i] < lo[1] ? r->y[i] : lo[1];
        hi[1] = r->y[i] > hi[1] ? r->y[i] : hi[1];
    }
    float side = count ? fmaxf(hi[0] - lo[0], hi[1] - lo[1]) : 1;
    side = fmaxf(side, 1e-3f) * 1.0001f;
    view->left = count ? 0.5f * (lo[0] + hi[0] - side) : -0.5f;
    view->top = count ? 0.5f * (lo[1] + hi[1] + side) : 0.5f;
    view->step = side / (float)r->width;
    float inverse = 1.0f / view->step;
    for (uint32_t i = 0; i < count; i++) {
        r->x[i] = (r->x[i] - view->left) * inverse;
        r->y[i] = (view->top - r->y[i]) * inverse;
    }
}

/* An affine function over the picture: value at sample (0, 0)'s centre, steps right and down. */
struct affine {
    float at, dx, dy;
};

struct corner {
    float x, y;
};

static struct affine through(const struct corner p[3], float inverse_area, float a, float b, float c)
{
    float e1 = b - a, e2 = c - a;
    float x1 = p[1].x - p[0].x, y1 = p[1].y - p[0].y, x2 = p[2].x - p[0].x, y2 = p[2].y - p[0].y;
    struct affine f = {.dx = (e1 * y2 - e2 * y1) * inverse_area, .dy = (e2 * x1 - e1 * x2) * inverse_area};
    f.at = a + f.dx * (0.5f - p[0].x) + f.dy * (0.5f - p[0].y);
    return f;
}

static int texel_of(float u, int side)
{
    if (u >= 1) /* rare: the triangle's whole part is off already */
        u -= floorf(u);
    int i = (int)(u * (float)side);
    return i < side ? i : side - 1;
}

/* True where the mask keeps texture position (u, v); u, v >= 0 but for rounding. */
static bool kept(const struct sv_raster_texture *t, float u, float v)
{
    int i = texel_of(u > 0 ? u : 0, t->width), j = texel_of(v > 0 ? v : 0, t->height);
    return sv_raster_texture_keeps(t, i, j);
}

/* Not fminf: that is a call, and there are eight of them a triangle; nothing here is NaN (mesh.h). */
static float low3(float a, float b, float c)
{
    float ab = a < b ? a : b;
    return ab < c ? ab : c;
}

static float high3(float a, float b, float c)
{
    float ab = a > b ? a : b;
    return ab > c ? ab : c;
}

/* A triangle ready to fill: rows y0 .. y1, in each the samples where all three weights are >= 0. */
struct patch {
    int x0, y0, x1, y1;
    struct affine weight[3];
    float inverse_dx[3]; /* 1 / weight.dx, 0 for an edge along the row */
    struct affine z, u, v;
    const struct sv_raster_texture *mask; /* NULL: opaque */
    int32_t triangle;
    uint8_t material;
};

/* Narrows [*lo, *hi], relative to sample 0, to where the row's weights are not negative. */
static bool span(const struct patch *t, float row, float *lo, float *hi)
{
    for (int k = 0; k < 3; k++) {
        const struct affine *w = &t->weight[k];
        float at = w->at + w->dy * row, cross = -at * t->inverse_dx[k];
        if (w->dx > 0)
            *lo = cross > *lo ? cross : *lo;
        else if (w->dx < 0)
            *hi = cross < *hi ? cross : *hi;
        else if (at < 0)
            return false;
    }
    return *lo <= *hi;
}

static void fill_row(struct sv_raster *r, const struct patch *t, int j, int first, int last)
{
    float fj = (float)j, z0 = t->z.at + t->z.dy * fj, dz = t->z.dx;
    float u0 = t->u.at + t->u.dy * fj, v0 = t->v.at + t->v.dy * fj;
    float *depth = r->depth + (size_t)j * (size_t)r->width;
    int32_t *triangle = r->triangle + (size_t)j * (size_t)r->width;
    uint8_t *material = r->material + (size_t)j * (size_t)r->width;
    for (int i = first; i <= last; i++) {
        float fi = (float)i, z = z0 + dz * fi;
        if (z <= depth[i])
            continue;
        if (t->mask && !kept(t->mask, u0 + t->u.dx * fi, v0 + t->v.dx * fi))
            continue;
        depth[i] = z;
        triangle[i] = t->triangle;
        material[i] = t->material;
    }
}

static void fill(struct sv_raster *r, const struct patch *t)
{
    for (int j = t->y0; j <= t->y1; j++) {
        float lo = (float)t->x0, hi = (float)t->x1;
        if (!span(t, (float)j, &lo, &hi))
            continue;
        int first = (int)lo, last = (int)hi; /* both >= 0 */
        fill_row(r, t, j, first + ((float)first < lo), last);
    }
}

static int clamp_sample(float v, int side)
{
    return v < 0 ? 0 : v > (float)(side - 1) ? side - 1 : (int)v;
}

static void draw_triangle(struct sv_raster *r, uint32_t first, struct patch *t)
{
    const uint32_t *index = r->mesh->indices + first;
    struct corner p[3];
    for (int k = 0; k < 3; k++)
        p[k] = (struct corner){r->x[index[k]], r->y[index[k]]};
    float area = (p[1].x - p[0].x) * (p[2].y - p[0].y) - (p[2].x - p[0].x) * (p[1].y - p[0].y);
    if (!(fabsf(area) > 1e-9f))
        return;
    /* Samples whose centre lies in the box: i + 0.5 in [lo, hi]. Off the picture only by rounding. */
    t->x0 = clamp_sample(low3(p[0].x, p[1].x, p[2].x) + 0.49999f, r->width);
    t->y0 = clamp_sample(low3(p[0].y, p[1].y, p[2].y) + 0.49999f, r->height);
    t->x1 = clamp_sample(high3(p[0].x, p[1].x, p[2].x) - 0.5f, r->width);
    t->y1 = clamp_sample(high3(p[0].y, p[1].y, p[2].y) - 0.5f, r->height);
    if (t->x1 < t->x0 || t->y1 < t->y0)
        return;
    float inverse = 1.0f / area;
    for (int k = 0; k < 3; k++) {
        t->weight[k] = through(p, inverse, k == 0, k == 1, k == 2);
        t->inverse_dx[k] = t->weight[k].dx != 0 ? 1.0f / t->weight[k].dx : 0;
    }
    t->z = through(p, inverse, r->z[index[0]], r->z[index[1]], r->z[index[2]]);
    t->triangle = (int32_t)first;
    if (t->mask) {
        const struct sv_tree_vertex *v = r->mesh->vertices;
        const float *a = v[index[0]].uv, *b = v[index[1]].uv, *c = v[index[2]].uv;
        float du = floorf(low3(a[0], b[0], c[0])), dv = floorf(low3(a[1], b[1], c[1]));
        t->u = through(p, inverse, a[0] - du, b[0] - du, c[0] - du);
        t->v = through(p, inverse, a[1] - dv, b[1] - dv, c[1] - dv);
    }
    fill(r, t);
}

void sv_raster_draw(struct sv_raster *r)
{
    size_t samples = (size_t)r->width * (size_t)r->height;
    for (size_t i = 0; i < samples; i++) {
        r->depth[i] = -INFINITY;
        r->triangle[i] = SV_RASTER_NONE;
    }
    for (int m = 0; m < r->mesh->material_count; m++) {
        const struct sv_tree_material *material = &r->mesh->materials[m];
        struct patch t = {.material = (uint8_t)m};
        t.mask = material->masked && r->textures[m].texels ? &r->textures[m] : NULL;
        for (uint32_t i = 0; i + 2 < material->index_count; i += 3)
            draw_triangle(r, material->first_index + i, &t);
    }
}

void sv_raster_weights(const struct sv_raster *r, int i, int j, float w[3])
{
    const uint32_t *index = r->mesh->indices + r->triangle[(size_t)j * (size_t)r->width + (size_t)i];
    float x[3], y[3], px = (float)i + 0.5f, py = (float)j + 0.5f;
    for (int k = 0; k < 3; k++) {
        x[k] = r->x[index[k]];
        y[k] = r->y[index[k]];
    }
    float area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]);
    w[1] = ((px - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (py - y[0])) / area;
    w[2] = ((x[1] - x[0]) * (py - y[0]) - (px - x[0]) * (y[1] - y[0])) / area;
    w[0] = 1 - w[1] - w[2];
}

bool sv_raster_kept(const struct sv_raster *r, int material, float u, float v)
{
    const struct sv_raster_texture *t = &r->textures[material];
    return !t->texels || !r->mesh->materials[material].masked || kept(t, u - floorf(u), v - floorf(v));
}

void sv_raster_color(const struct sv_raster *raster, int material, float u, float v, float rgb[3])
{
    const struct sv_raster_texture *t = &raster->textures[material];
    const float *base = raster->mesh->materials[material].base_color;
    static const uint8_t white[3] = {255, 255, 255};
    const uint8_t *code = white;
    if (t->texels) {
        int i = texel_of(u - floorf(u), t->width), j = texel_of(v - floorf(v), t->height);
        code = t->texels + 3 * ((size_t)j * (size_t)t->width + (size_t)i);
    }
    for (int c = 0; c < 3; c++)
        rgb[c] = base[c] * sv_linear_from_srgb8[code[c]];
}
