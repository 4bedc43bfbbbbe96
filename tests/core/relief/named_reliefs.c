/* named_reliefs.c - see named_reliefs.h. */
#include "tests/core/relief/named_reliefs.h"

#include <math.h>
#include <stdlib.h>

#include "core/base/noise.h"

/* Height at (x, y) in texels, over a texture of w x h texels: in texels. p, q are the shape's own numbers. */
typedef double height_fn(double x, double y, double w, double h, double p, double q, uint64_t seed);

static double flat(double x, double y, double w, double h, double p, double q, uint64_t seed)
{
    (void)x, (void)y, (void)w, (void)h, (void)q, (void)seed;
    return p;
}
static double slope(double x, double y, double w, double h, double p, double q, uint64_t seed)
{
    (void)seed;
    return p * (x - w / 2) + q * (y - h / 2);
}
static double hills(double x, double y, double w, double h, double p, double q, uint64_t seed)
{
    (void)w, (void)h;
    return p * sv_noise_sum(seed, x / q, y / q, 2);
}
static double ripples(double x, double y, double w, double h, double p, double q, uint64_t seed)
{
    (void)seed;
    return p * sin(hypot(x - 0.4 * w, y - 0.55 * h) * 2 * SV_PI / q);
}
static double waves(double x, double y, double w, double h, double p, double q, uint64_t seed)
{
    (void)w, (void)h, (void)seed;
    return p * sin((x + 0.4 * y) * 2 * SV_PI / q);
}
static double dome(double x, double y, double w, double h, double p, double q, uint64_t seed)
{
    (void)seed, (void)q;
    double a = (x - w / 2) / (0.5 * w), b = (y - h / 2) / (0.5 * h);
    return p * (1 - 0.5 * (a * a + b * b));
}
static double bump(double x, double y, double w, double h, double p, double q, uint64_t seed)
{
    (void)seed;
    double a = (x - w / 2) / q, b = (y - h / 2) / q;
    return p * exp(-0.5 * (a * a + b * b));
}
static double saddle(double x, double y, double w, double h, double p, double q, uint64_t seed)
{
    (void)seed, (void)q;
    double a = (x - w / 2) / (0.5 * w), b = (y - h / 2) / (0.5 * h);
    return p * (a * a - b * b);
}
static double terraces(double x, double y, double w, double h, double p, double q, uint64_t seed)
{
    (void)w, (void)h, (void)seed;
    return p * floor((x + 0.35 * y) / q);
}
static double hill_terraces(double x, double y, double w, double h, double p, double q, uint64_t seed)
{
    return p * floor(hills(x, y, w, h, 4, q, seed));
}
static double blocks(double x, double y, double w, double h, double p, double q, uint64_t seed)
{
    (void)w, (void)h;
    struct sv_rng rng =
        sv_rng_seeded(seed, (uint64_t)(int64_t)floor(x / q) * 4099 + (uint64_t)(int64_t)floor(y / q));
    return p * sv_rng_unit(&rng);
}
static double towers(double x, double y, double w, double h, double p, double q, uint64_t seed)
{
    (void)w, (void)h;
    double i = floor(x / q), j = floor(y / q);
    struct sv_rng rng = sv_rng_seeded(seed, (uint64_t)(int64_t)i * 4099 + (uint64_t)(int64_t)j);
    bool inside = fabs(x / q - i - 0.5) < 0.25 && fabs(y / q - j - 0.5) < 0.3;
    return inside ? p * (0.5 + 0.5 * sv_rng_unit(&rng)) : 0;
}
static double wells(double x, double y, double w, double h, double p, double q, uint64_t seed)
{
    return -towers(x, y, w, h, p, q, seed);
}
static double stairs(double x, double y, double w, double h, double p, double q, uint64_t seed)
{
    (void)x, (void)w, (void)h, (void)seed;
    return p * floor(y / q);
}
static double discs(double x, double y, double w, double h, double p, double q, uint64_t seed)
{
    (void)seed;
    double r = hypot(x - w / 2, y - h / 2);
    return r < q ? p : r < 1.8 * q ? p / 2 : 0;
}
static double ball(double x, double y, double w, double h, double p, double q, uint64_t seed)
{
    (void)seed;
    double a = (x - w / 2) / q, b = (y - h / 2) / q, c = 1 - a * a - b * b;
    return c > 0 ? p + q * sqrt(c) : NAN;
}
static double window(double x, double y, double w, double h, double p, double q, uint64_t seed)
{
    bool hole = fabs(x - w / 2) < 0.2 * w && fabs(y - h / 2) < 0.25 * h;
    return hole ? NAN : waves(x, y, w, h, p, q, seed);
}
static double fence(double x, double y, double w, double h, double p, double q, uint64_t seed)
{
    (void)y, (void)w, (void)h, (void)seed;
    return fmod(x, q) < 0.4 * q ? p : 0;
}
static double white(double x, double y, double w, double h, double p, double q, uint64_t seed)
{
    (void)w, (void)h, (void)q;
    struct sv_rng rng = sv_rng_seeded(seed, (uint64_t)floor(x) * 65537 + (uint64_t)floor(y));
    return p * sv_rng_unit(&rng);
}
static double fractal(double x, double y, double w, double h, double p, double q, uint64_t seed)
{
    (void)w, (void)h;
    return p * sv_noise_sum(seed, x / q, y / q, 7);
}
static double spikes(double x, double y, double w, double h, double p, double q, uint64_t seed)
{
    return white(x, y, w, h, 1, 0, seed) < q ? p : 0;
}
static double crowns(double x, double y, double w, double h, double p, double q, uint64_t seed)
{
    double leaf = white(x, y, w, h, 2, 0, seed);
    return leaf < 0.5 ? NAN : bump(x, y, w, h, p, q, seed) + leaf;
}

enum paint { STONE, BRICK, CHECKER, MEADOW, STRIPES, MOSAIC };

struct named {
    const char *name;
    enum named_kind kind;
    int width, height;
    double side_a, side_b; /* m a texel */
    bool left;             /* f = - a x b / |a x b| */
    bool far_away;         /* origin at UTM coordinates */
    height_fn *shape;
    double p, q;
    double cut; /* texels */
    enum paint paint;
};

#define NEVER INFINITY
static const struct named table[NAMED_COUNT] = {
    {"one texel", NAMED_SMOOTH, 1, 1, 1, 1, false, false, flat, 0.3, 0, NEVER, STONE},
    {"two by one", NAMED_SMOOTH, 2, 1, 1, 2, true, false, flat, -0.2, 0, NEVER, CHECKER},
    {"column of five", NAMED_SMOOTH, 1, 5, 0.5, 1, false, false, slope, 0, 0.3, NEVER, BRICK},
    {"flat", NAMED_SMOOTH, 128, 128, 1, 1, false, false, flat, 0, 0, NEVER, MOSAIC},
    {"flat, before its plane", NAMED_SMOOTH, 96, 96, 0.5, 0.5, true, true, flat, 12, 0, NEVER, STONE},
    {"flat, behind its plane", NAMED_SMOOTH, 96, 64, 1, 1.5, false, false, flat, -20, 0, 2, BRICK},
    {"slope along u", NAMED_SMOOTH, 128, 96, 1, 1, true, false, slope, 0.3, 0, NEVER, CHECKER},
    {"slope along v", NAMED_SMOOTH, 96, 128, 1, 1, false, true, slope, 0, -0.35, 2, MEADOW},
    {"slope across", NAMED_SMOOTH, 64, 64, 2, 1.5, true, false, slope, 0.2, 0.2, 2, STRIPES},
    {"hills, low", NAMED_SMOOTH, 128, 128, 1, 1, false, false, hills, 5, 48, 2, STONE},
    {"hills, high", NAMED_SMOOTH, 160, 160, 1, 1, false, true, hills, 12, 64, 3, MEADOW},
    {"hills, long texels", NAMED_SMOOTH, 128, 64, 1, 2, true, false, hills, 6, 40, 3, MOSAIC},
    {"hills, wide texels", NAMED_SMOOTH, 64, 128, 3, 2, false, false, hills, 5, 40, 3, BRICK},
    {"ripples", NAMED_SMOOTH, 128, 128, 0.1, 0.1, true, false, ripples, 1, 24, NEVER, STONE},
    {"ripples, deep", NAMED_SMOOTH, 192, 128, 1, 1, false, false, ripples, 2.5, 36, 3, CHECKER},
    {"waves", NAMED_SMOOTH, 128, 128, 1, 1.25, false, true, waves, 2.5, 40, 2, MOSAIC},
    {"dome", NAMED_SMOOTH, 128, 128, 1, 1, true, false, dome, 25, 0, 3, BRICK},
    {"bowl", NAMED_SMOOTH, 128, 96, 1, 1, false, false, dome, -25, 0, NEVER, MEADOW},
    {"bump", NAMED_SMOOTH, 128, 128, 0.02, 0.02, false, false, bump, 14, 18, 3, STRIPES},
    {"saddle", NAMED_SMOOTH, 96, 96, 1, 1, true, true, saddle, 12, 0, NEVER, STONE},
    {"saddle, large", NAMED_SMOOTH, 256, 256, 1, 1, false, false, saddle, 25, 0, 3, MOSAIC},
    {"hills, largest", NAMED_SMOOTH, 256, 256, 1, 1, true, false, hills, 14, 90, 3, STONE},

    {"terraces", NAMED_STEPPED, 128, 128, 1, 1, false, false, terraces, 2, 24, 1, STONE},
    {"terraces, unequal", NAMED_STEPPED, 96, 128, 1.5, 1, true, true, terraces, 2, 20, 1, BRICK},
    {"terraced hills", NAMED_STEPPED, 160, 160, 1, 1, false, false, hill_terraces, 2, 60, 1, MEADOW},
    {"blocks", NAMED_STEPPED, 128, 128, 1, 1, true, false, blocks, 6, 32, 0.5, MOSAIC},
    {"blocks, low", NAMED_STEPPED, 128, 128, 1, 1, false, true, blocks, 3, 20, 0.25, CHECKER},
    {"towers", NAMED_STEPPED, 128, 128, 1, 1, false, false, towers, 10, 42, 1, BRICK},
    {"towers, long texels", NAMED_STEPPED, 128, 96, 1, 1.5, true, false, towers, 8, 32, 1, STONE},
    {"wells", NAMED_STEPPED, 128, 128, 1, 1, false, false, wells, 10, 42, 1, MEADOW},
    {"wells, small", NAMED_STEPPED, 96, 96, 0.25, 0.25, true, true, wells, 5, 24, 1, MOSAIC},
    {"stairs", NAMED_STEPPED, 96, 128, 1, 1, false, false, stairs, 2, 16, 1, STRIPES},
    {"stairs, down", NAMED_STEPPED, 128, 96, 2, 2, true, false, stairs, -3, 24, 1, STONE},
    {"discs", NAMED_STEPPED, 128, 128, 1, 1, false, false, discs, 12, 28, 1, CHECKER},
    {"disc well", NAMED_STEPPED, 128, 128, 1, 1, true, false, discs, -12, 28, 1, BRICK},
    {"half ball", NAMED_STEPPED, 128, 128, 1, 1, false, true, ball, -30, 60, 3, MOSAIC},
    {"window", NAMED_STEPPED, 128, 96, 1, 1, true, false, window, 2, 40, 2, STONE},
    {"fence", NAMED_STEPPED, 128, 128, 1, 1, false, false, fence, 5, 32, 1, MEADOW},
    {"largest blocks", NAMED_STEPPED, 256, 256, 1, 1, false, false, blocks, 10, 64, 0.5, STONE},
    {"two texels, torn", NAMED_STEPPED, 2, 2, 1, 1, true, false, stairs, 1.5, 1, 1, CHECKER},

    {"white noise, low", NAMED_NOISY, 128, 128, 1, 1, false, false, white, 1, 0, 2, STONE},
    {"white noise", NAMED_NOISY, 128, 128, 1, 1, true, false, white, 6, 0, 2, MOSAIC},
    {"white noise, one skin", NAMED_NOISY, 96, 96, 1, 1.5, false, true, white, 3, 0, NEVER, BRICK},
    {"fractal, low", NAMED_NOISY, 128, 128, 1, 1, false, false, fractal, 6, 40, 2, MEADOW},
    {"fractal", NAMED_NOISY, 256, 256, 1, 1, true, false, fractal, 24, 80, 2, STONE},
    {"fractal, one skin", NAMED_NOISY, 128, 96, 2, 1, false, false, fractal, 10, 40, NEVER, STRIPES},
    {"spikes", NAMED_NOISY, 128, 128, 1, 1, true, false, spikes, 12, 0.02, 1, CHECKER},
    {"pits", NAMED_NOISY, 128, 128, 1, 1, false, true, spikes, -12, 0.02, 1, BRICK},
    {"crown", NAMED_NOISY, 128, 128, 0.05, 0.05, false, false, crowns, 30, 40, 1.5, MEADOW},
    {"spikes, large", NAMED_NOISY, 256, 192, 1, 1, true, false, spikes, 20, 0.005, 1, MOSAIC},
};

const char *named_relief_name(int k)
{
    return table[k].name;
}

enum named_kind named_relief_kind(int k)
{
    return table[k].kind;
}

static double soft_step(double x)
{
    return sv_clamp(0.5 + x / 1.5, 0, 1); /* an edge as a lens draws it: a texel and a half wide */
}

static void mix(double rgb[3], const double other[3], double share)
{
    for (int e = 0; e < 3; e++)
        rgb[e] += (other[e] - rgb[e]) * share;
}

static double brick_mortar(double x, double y)
{
    double row = floor(y / 9), in_row = y - 9 * row, shifted = x + fmod(row, 2) * 9,
           in_brick = fmod(shifted, 18);
    double d = fmin(fmin(in_row, 9 - in_row), fmin(in_brick, 18 - in_brick));
    return 1 - soft_step(d - 1.4);
}

static void paint_texel(enum paint paint, double x, double y, uint64_t seed, double rgb[3])
{
    static const double mortar[3] = {205, 200, 190}, dark[3] = {28, 30, 40}, flower[3] = {250, 225, 60};
    double grain = sv_noise_sum(seed, x / 7, y / 7, 2), broad = sv_noise_sum(seed + 9, x / 40, y / 40, 3);
    double line[2] = {fabs(fmod(x + 160, 16) - 8) - 4, fabs(fmod(y + 160, 16) - 8) - 4};
    switch (paint) {
    case STONE:
        rgb[0] = 128 + 60 * broad + 38 * grain, rgb[1] = 120 + 62 * broad + 36 * grain;
        rgb[2] = 105 + 64 * broad + 30 * grain;
        mix(rgb, dark, 0.8 * soft_step(2 - 40 * fabs(sv_noise_at(seed + 3, x / 25, y / 25).v)));
        return;
    case BRICK:
        rgb[0] = 160 + 40 * broad + 30 * grain, rgb[1] = 80 + 30 * broad + 24 * grain;
        rgb[2] = 62 + 25 * broad + 20 * grain;
        mix(rgb, mortar, brick_mortar(x, y));
        return;
    case CHECKER: {
        double a = soft_step(line[0]), b = soft_step(line[1]), odd = a + b - 2 * a * b;
        rgb[0] = 235 - 190 * odd + 12 * grain, rgb[1] = 230 - 150 * odd + 12 * grain;
        rgb[2] = 215 - 60 * odd + 12 * grain;
        return;
    }
    case MEADOW:
        rgb[0] = 80 + 50 * broad + 34 * grain, rgb[1] = 125 + 50 * broad + 40 * grain;
        rgb[2] = 45 + 20 * broad + 20 * grain;
        mix(rgb, flower, soft_step(8 * sv_noise_at(seed + 5, x / 5, y / 5).v - 3.2));
        return;
    case STRIPES:
        rgb[0] = 60 + 170 * soft_step(line[0]), rgb[1] = 90 + x, rgb[2] = 200 - 1.1 * y + 20 * grain;
        return;
    case MOSAIC: {
        double a = soft_step(14 * sv_noise_at(seed + 1, x / 14, y / 14).v);
        double b = soft_step(14 * sv_noise_at(seed + 2, x / 19, y / 19).v);
        rgb[0] = 40 + 190 * a, rgb[1] = 60 + 140 * b + 20 * grain, rgb[2] = 180 - 100 * a * b + 30 * broad;
        return;
    }
    }
}

/* An orthonormal triple turned anyhow by the seed, right-handed. */
static void turn(uint64_t seed, struct sv_vec3 *a, struct sv_vec3 *b, struct sv_vec3 *f)
{
    struct sv_rng rng = sv_rng_seeded(seed, 77);
    double azimuth = sv_rng_range(&rng, 0, 2 * SV_PI), z = sv_rng_range(&rng, -0.9, 0.9), s = sqrt(1 - z * z);
    double spin = sv_rng_range(&rng, 0, 2 * SV_PI);
    *f = sv_vec3(s * cos(azimuth), s * sin(azimuth), z);
    struct sv_vec3 e = sv_normalize(sv_cross(sv_vec3(0, 0, 1), *f)), g = sv_cross(*f, e);
    *a = sv_madd(sv_scale(e, cos(spin)), g, sin(spin));
    *b = sv_cross(*f, *a);
}

static void set_frame(int k, struct sv_relief_frame *frame)
{
    const struct named *n = &table[k];
    struct sv_vec3 a, b, f;
    turn((uint64_t)k, &a, &b, &f);
    frame->a = sv_scale(a, n->side_a);
    frame->b = sv_scale(b, n->left ? -n->side_b : n->side_b);
    frame->f = f;
    frame->origin = n->far_away ? sv_vec3(389123.25, 3950456.5, 512.75) : sv_vec3(3, -2, 1);
}

void named_relief_make(int k, struct sv_relief *relief)
{
    const struct named *n = &table[k];
    double unit = sqrt(n->side_a * n->side_b);
    uint64_t seed = sv_mix64((uint64_t)k + 1000);
    if (sv_relief_alloc(n->width, n->height, relief, NULL))
        abort();
    set_frame(k, &relief->frame);
    relief->cut = (float)(n->cut * unit);
    for (int j = 0; j < n->height; j++)
        for (int i = 0; i < n->width; i++) {
            size_t texel = (size_t)j * (size_t)n->width + (size_t)i;
            double rgb[3] = {0}, h = n->shape(i + 0.5, j + 0.5, n->width, n->height, n->p, n->q, seed);
            paint_texel(n->paint, i + 0.5, j + 0.5, seed, rgb);
            for (int e = 0; e < 3; e++)
                relief->color[texel][e] = (uint8_t)(sv_clamp(rgb[e], 0, 255) + 0.5);
            relief->color[texel][3] = isnan(h) ? 0 : 255;
            relief->displ[texel] = isnan(h) ? 0 : (float)(h * unit);
            relief->normal[texel][2] = relief->normal[texel][3] = INT16_MAX;
        }
    sv_relief_measure(relief);
}

/* Largest px a metre at the corners of what the relief holds, and the picture's half sides that hold them
 * all. */
static double look(const struct sv_relief *r, const struct sv_camera *c, double half[2])
{
    double nearest = INFINITY;
    half[0] = half[1] = 0;
    for (int k = 0; k < 8; k++) {
        struct sv_vec3 x = sv_relief_point(&r->frame, k & 1 ? r->width : 0, k & 2 ? r->height : 0,
                                           k & 4 ? (double)r->displ_max : (double)r->displ_min);
        struct sv_vec3 d = sv_sub(x, c->eye);
        double z = sv_dot(d, c->forward), w = c->projection == SV_PROJECTION_ORTHOGRAPHIC ? 1 : z;
        nearest = fmin(nearest, w);
        half[0] = fmax(half[0], fabs(sv_dot(d, c->right) / w));
        half[1] = fmax(half[1], fabs(sv_dot(d, c->up) / w));
    }
    return nearest;
}

void named_relief_camera(const struct sv_relief *relief, double angle_rad, double azimuth_rad,
                         double magnification, bool parallel, struct sv_camera *camera)
{
    const struct sv_relief_frame *f = &relief->frame;
    struct sv_vec3 a = sv_normalize(f->a), b = sv_normalize(f->b);
    double side = fmax(sv_length(f->a), sv_length(f->b));
    double size = fmax(relief->width * sv_length(f->a), relief->height * sv_length(f->b));
    struct sv_vec3 middle = sv_relief_point(f, 0.5 * relief->width, 0.5 * relief->height,
                                            0.5 * ((double)relief->displ_min + (double)relief->displ_max));
    struct sv_vec3 to_eye =
        sv_add(sv_scale(f->f, cos(angle_rad)),
               sv_scale(sv_madd(sv_scale(a, cos(azimuth_rad)), b, sin(azimuth_rad)), sin(angle_rad)));
    struct sv_camera c = {.projection = parallel ? SV_PROJECTION_ORTHOGRAPHIC : SV_PROJECTION_PERSPECTIVE};
    c.eye = sv_madd(middle, to_eye, 1.8 * size);
    c.forward = sv_scale(to_eye, -1);
    struct sv_vec3 up = fabs(c.forward.z) < 0.99 ? sv_vec3(0, 0, 1) : sv_vec3(0, 1, 0);
    c.right = sv_normalize(sv_cross(c.forward, up));
    c.up = sv_cross(c.right, c.forward);
    c.near_m = 0.02 * size;
    c.far_m = 4 * size;
    double half[2], px_a_metre = magnification / side * look(relief, &c, half);
    c.width = (int)sv_clamp(2 * ceil(half[0] * px_a_metre) + 4, 8, 1024);
    c.height = (int)sv_clamp(2 * ceil(half[1] * px_a_metre) + 4, 8, 1024);
    c.vfov_rad = 2 * atan(0.5 * c.height / px_a_metre);
    c.ortho_height_m = c.height / px_a_metre;
    *camera = c;
}
