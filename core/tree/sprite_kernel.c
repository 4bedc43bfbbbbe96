/* sprite_kernel.c - trees into a tile, pixel by pixel: the reference. TWINS: sprite_kernel_avx2.c (8 pixels
 * at a time, the same operations in the same order, so that both give the same bits) and, for the light,
 * core/gl/shaders/tree_leaf.glsl. */
#include <math.h>

#include "core/tree/sprite_private.h"

static float clamp(float v, float lo, float hi)
{
    return v > lo ? v < hi ? v : hi : lo; /* NaN: lo */
}

/* An affine function on a row: its value at column x0 of the box, and its step. */
static float at(const struct sv_sprite_affine *f, float x, float y)
{
    return f->at + f->row * y + f->column * x;
}

/* What one picture shows at a pixel. */
struct shown {
    float alpha, rgb[3], z, normal[3];
};

struct place {
    float u, v, z;
};

static const struct sv_sprite_smooth *smooth_at(const struct sv_sprite *s, int i, int j)
{
    int round = (1 << s->shift) - 1;
    return &s->smooth[((j + round) >> s->shift) * s->smooth_stride + ((i + round) >> s->shift)];
}

static struct place locate(const struct sv_sprite *s, float x, float y)
{
    float inverse = 1 / at(&s->c, x, y), u0 = at(&s->u, x, y), v0 = at(&s->v, x, y), z0 = at(&s->z, x, y);
    struct place p = {u0 * inverse, v0 * inverse, z0 * inverse};
    if (!s->move)
        return p;
    int i = (int)clamp(p.u, 0, s->u_max), j = (int)clamp(p.v, 0, s->v_max);
    uint8_t code = smooth_at(s, i, j)->depth;
    float e = s->depth_first + s->depth_step * (float)code;
    p.u = (u0 + at(&s->u_depth, x, y) * e) * inverse;
    p.v = (v0 + at(&s->v_depth, x, y) * e) * inverse;
    p.z = (z0 + s->z_depth * e) * inverse;
    return p;
}

/* tree_leaf.glsl, leaf_sun. */
static float leaf_sun(const float m[3], const float l[3], float t, float gain)
{
    float rho2 = clamp(m[0] * m[0] + m[1] * m[1] + m[2] * m[2], 1e-6f, 1), loose = 1 - sqrtf(rho2);
    float along = m[0] * l[0] + m[1] * l[1] + m[2] * l[2];
    float c2 = fminf(along * along / rho2, 1), across = fminf(0.8f * loose, 0.5f);
    float mean = sqrtf(fmaxf(across + (1 - 3 * across) * c2, 0)) * (1 - loose * (0.56f - 0.4f * c2));
    return fmaxf(0, 0.5f * ((1 + t) * (mean * gain) + (1 - t) * along));
}

/* tree_light.glsl, tree_light. */
static float grid_light(const struct sv_sprite *s, float u, float v)
{
    float column = clamp(s->column[0] * u + s->column[1] * v + s->column[2], 0, 1);
    float row = clamp(s->row[0] * u + s->row[1] * v + s->row[2], 0, 3);
    int k = (int)fminf(row, 2);
    float part = row - (float)k;
    float first = s->light[k] + (s->light[k + 1] - s->light[k]) * part;
    float second = s->light[k + 4] + (s->light[k + 5] - s->light[k + 4]) * part;
    return first + (second - first) * column;
}

static float tone(float c)
{
    float t = fmaxf(2 * c - 1, 0);
    return fminf(c, 0.5f) + 0.5f * (t / (1 + t));
}

static void shade(const struct sv_sprite_light *light, const struct sv_sprite *s, int i, int j, float u,
                  float v, float keep, struct shown *out)
{
    const struct sv_sprite_texel *t = &s->texels[j * s->stride + i];
    const struct sv_sprite_smooth *w = smooth_at(s, i, j);
    float *m = out->normal;
    for (int c = 0; c < 3; c++)
        m[c] = (float)t->normal[c] * (2.0f / 255.0f) - 1;
    float visible = s->open_at + s->open[0] * (float)w->open[0] + s->open[1] * (float)w->open[1] +
                    s->open[2] * (float)w->open[2] + s->open[3] * (float)w->open[3];
    visible = clamp(visible, 0, 1) * grid_light(s, u, v);
    float out_by = (float)t->prominence - 128;
    visible = visible * fmaxf(1 + out_by * s->stand, 0);
    float sun = leaf_sun(m, s->sun, (float)w->translucency * (1.0f / 255.0f), s->gain) * visible;
    float up = 0.5f + 0.5f * (m[1] * s->up[0] + m[2] * s->up[1]);
    float occlusion = (float)w->occlusion * (1.0f / 255.0f) * fmaxf(1 + out_by * s->stand_sky, 0);
    for (int c = 0; c < 3; c++) {
        float root = (float)t->rgb[c] * (1.0f / 255.0f);
        float ambient = (light->ground_rgb[c] + (light->sky_rgb[c] - light->ground_rgb[c]) * up) * occlusion;
        float lit = tone(root * root * (light->sun_rgb[c] * sun + ambient));
        out->rgb[c] = light->air_rgb[c] + (lit - light->air_rgb[c]) * keep;
    }
}

/* Coverage between four texels. */
static float coverage(const struct sv_sprite_texel *t, int stride, float fu, float fv)
{
    float a = (float)t[0].coverage, b = (float)t[1].coverage;
    float c = (float)t[stride].coverage, d = (float)t[stride + 1].coverage;
    float above = a + (b - a) * fu, below = c + (d - c) * fu;
    return above + (below - above) * fv;
}

static void show(const struct sv_sprite_light *light, const struct sv_sprite *s, float x, float y,
                 float limit_z, float keep, struct shown *out)
{
    struct place p = locate(s, x, y);
    out->z = p.z;
    out->alpha = 0;
    if (!(p.z >= light->near_z && p.z <= limit_z))
        return;
    float u = clamp(p.u, 0, s->u_max), v = clamp(p.v, 0, s->v_max);
    int i = (int)(u + 0.5f), j = (int)(v + 0.5f);
    float covered = (float)s->texels[j * s->stride + i].coverage;
    if (s->between) {
        int k = (int)u, l = (int)v;
        covered = coverage(s->texels + l * s->stride + k, s->stride, u - (float)k, v - (float)l);
    }
    out->alpha = covered * s->weight;
    if (out->alpha > 0)
        shade(light, s, i, j, u, v, keep, out);
}

static void mark_hard(const struct sv_sprite_tree *tree, const struct shown *sum, size_t k,
                      struct sv_sprite_hard *hard)
{
    hard->z[k] = sum->z / sum->alpha;
    if (hard->depth_only)
        return;
    const float *n = sum->normal;
    float each = 1 / sqrtf(fmaxf(n[0] * n[0] + n[1] * n[1] + n[2] * n[2], 1e-12f));
    hard->id[k] = tree->id;
    for (int c = 0; c < 3; c++)
        hard->normal[c][k] = n[c] * each;
}

/* The mean normal in the world, weighed by coverage. */
static void add_normal(const struct sv_sprite *s, const struct shown *one, float sum[3])
{
    const float *r = s->right, *t = s->top, *m = one->normal;
    const float toward[3] = {r[1] * t[2] - r[2] * t[1], r[2] * t[0] - r[0] * t[2], r[0] * t[1] - r[1] * t[0]};
    for (int c = 0; c < 3; c++)
        sum[c] += one->alpha * (m[0] * r[c] + m[1] * t[c] + m[2] * toward[c]);
}

/* What covers of a tree a share of which is there (SV_SPRITE_SHARE). */
static float share_of(float alpha, uint32_t share)
{
    float root = fmaxf(1 - alpha, sv_sprite_share_least(share)), pass = 1;
    for (int bit = SV_SPRITE_SHARE_BITS; bit-- > 0;) {
        root = sqrtf(root);
        if (share >> bit & 1)
            pass = pass * root;
    }
    return 1 - pass;
}

static void draw_pixel(const struct sv_sprite_light *light, const struct sv_sprite_tree *tree,
                       const struct sv_sprite *sprites, float x, float y, size_t k,
                       struct sv_sprite_tile *tile, struct sv_sprite_hard *hard)
{
    struct shown sum = {0, {0, 0, 0}, 0, {0, 0, 0}};
    if (!(tile->pass[k] >= SV_SPRITE_PASS_MIN))
        return;
    for (uint32_t n = 0; n < tree->count; n++) {
        struct shown one;
        show(light, &sprites[n], x, y, tile->z[k], tree->keep, &one);
        if (!(one.alpha > 0))
            continue;
        sum.alpha += one.alpha;
        for (int c = 0; c < 3; c++)
            sum.rgb[c] += one.alpha * one.rgb[c];
        if (hard) {
            sum.z += one.alpha * one.z;
            if (!hard->depth_only)
                add_normal(&sprites[n], &one, sum.normal);
        }
    }
    float pass = tile->pass[k], covers = sum.alpha, lit = pass;
    if (tree->share < SV_SPRITE_SHARE) {
        covers = share_of(sum.alpha, tree->share);
        lit = pass * (covers / fmaxf(sum.alpha, 1e-6f));
    }
    float left = pass * (1 - fminf(covers, 1));
    tile->red[k] += lit * sum.rgb[0];
    tile->green[k] += lit * sum.rgb[1];
    tile->blue[k] += lit * sum.rgb[2];
    tile->pass[k] = left;
    bool mark = hard && (hard->surface ? pass > 0.5f : hard->z[k] == 0 && left <= 0.5f);
    if (mark && sum.alpha > 0)
        mark_hard(tree, &sum, k, hard);
}

static void draw_row(const struct sv_sprite_light *light, const struct sv_sprite_tree *tree,
                     const struct sv_sprite *sprites, int row, struct sv_sprite_state *state,
                     struct sv_sprite_tile *tile, struct sv_sprite_hard *hard)
{
    float y = (float)(state->y0 + row - tree->y0);
    int first = tree->x0 > state->x0 ? (tree->x0 - state->x0) / SV_SPRITE_LANES : 0;
    int last = (tree->x1 - 1 - state->x0) / SV_SPRITE_LANES;
    for (int g = first; g <= last && g < SV_SPRITE_TILE / SV_SPRITE_LANES; g++) {
        if (!(state->open[row] >> g & 1))
            continue;
        bool open = false;
        for (int lane = 0; lane < SV_SPRITE_LANES; lane++) {
            int column = g * SV_SPRITE_LANES + lane;
            size_t k = (size_t)(row * SV_SPRITE_TILE + column);
            draw_pixel(light, tree, sprites, (float)(state->x0 + column - tree->x0), y, k, tile, hard);
            open |= tile->pass[k] >= SV_SPRITE_PASS_MIN;
        }
        if (!open) {
            state->open[row] = (uint8_t)(state->open[row] & ~(1u << g));
            state->open_groups--;
        }
    }
}

void sv_sprite_kernel_scalar(const struct sv_sprite_light *light, const struct sv_sprite_tree *trees,
                             const struct sv_sprite *sprites, const uint32_t *order, uint32_t count,
                             struct sv_sprite_state *state, struct sv_sprite_tile *tile,
                             struct sv_sprite_hard *hard)
{
    for (uint32_t k = 0; k < count && state->open_groups > 0; k++) {
        const struct sv_sprite_tree *tree = &trees[order[k]];
        if (tree->near_z > state->far_z)
            continue;
        int first = tree->y0 > state->y0 ? tree->y0 - state->y0 : 0, end = tree->y1 - state->y0;
        for (int row = first; row < end && row < SV_SPRITE_TILE; row++)
            draw_row(light, tree, sprites + tree->first, row, state, tile, hard);
    }
}
