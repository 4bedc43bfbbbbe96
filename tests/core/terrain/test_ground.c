/* test_ground.c - the colour of ground and sky, pixel by pixel, against the twins that the ray-cast truth
 * uses (core/truth/terrain_shade.h, core/scene/light.h); AVX2 against the plain kernel; hidden pixels; and
 * that every pixel is lit by a page of shadow that is as fine as shadow_page.h says. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/arena.h"
#include "core/base/color.h"
#include "core/base/rng.h"
#include "core/base/simd.h"
#include "core/terrain/coloring.h"
#include "core/terrain/detail.h"
#include "core/terrain/ground.h"
#include "core/terrain/ground_rows.h"
#include "core/truth/terrain_shade.h"

enum { W = 61, H = 48, FW = 97, FH = 90 };

static struct sv_arena *arena;
static struct sv_terrain terrain;
static struct sv_ground *ground;

static int set_up(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(4, 4);
    struct sv_error error;
    sv_color_init();
    if (sv_arena_create(1 << 26, &arena, &error))
        return -1;
    float *h = sv_arena_alloc(arena, FW * FH, sizeof *h);
    terrain.field = (struct sv_heightfield){.width = FW,
                                            .height = FH,
                                            .x0 = 471234.5,
                                            .y0 = 9123456.75,
                                            .dx = 12,
                                            .dy = 11,
                                            .z0 = 1500,
                                            .h_min = -50,
                                            .h_max = 50,
                                            .h = h};
    for (int j = 0; j < FH; j++)
        for (int i = 0; i < FW; i++)
            h[j * FW + i] = (float)(40 * sin(i * 0.2) * cos(j * 0.23) + sv_rng_range(&rng, -4, 4));
    if (sv_terrain_color(&terrain, NULL, 47, arena, &error) || sv_ground_create(&terrain, &ground, &error)) {
        print_error("%s\n", error.message);
        return -1;
    }
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    sv_ground_destroy(ground);
    sv_ground_destroy(NULL);
    sv_arena_destroy(arena);
    return 0;
}

/* A view over some place of the field, and depths that make each pixel a place of the field: the shading asks
 * for nothing else, so that the surface need not be the field's. */
struct picture {
    struct sv_camera camera;
    struct sv_light light;
    struct sv_ground_view view;
    float depth[W * H];
    uint8_t rgba[W * H * 4];
    double shift_x, shift_y;
};

static void make_picture(struct picture *p, struct sv_rng *rng, bool orthographic, double pixel_m, double far)
{
    const struct sv_heightfield *f = &terrain.field;
    memset(p, 0, sizeof *p);
    p->camera = (struct sv_camera){.width = W, .height = H, .near_m = 0.1, .far_m = 4000, .vfov_rad = 0.8};
    double z = pixel_m * 0.5 * H / tan(0.4); /* where a pixel is so large */
    if (orthographic) {
        p->camera.projection = SV_PROJECTION_ORTHOGRAPHIC;
        p->camera.ortho_height_m = pixel_m * H;
        z = 100;
    }
    p->camera.eye = sv_vec3(f->x0 + sv_rng_range(rng, 0.4, 0.6) * (FW - 1) * f->dx,
                            f->y0 + sv_rng_range(rng, 0.4, 0.6) * (FH - 1) * f->dy, 1600);
    sv_camera_aim(&p->camera, sv_rng_range(rng, 0, 6.28), sv_rng_range(rng, -1.5, -0.2),
                  sv_rng_range(rng, -0.3, 0.3));
    struct sv_sun sun = {sv_rng_range(rng, 0, 6.28), sv_rng_range(rng, -0.1, 1.4)};
    sv_light_from_sun(&sun, &p->light);
    p->light.air = sv_rng_range(rng, 0, 1) < 0.5;
    p->shift_x = sv_rng_range(rng, -0.4, 0.4);
    p->shift_y = sv_rng_range(rng, -0.4, 0.4);
    for (int k = 0; k < W * H; k++) {
        double at = z * exp(sv_rng_range(rng, 0, log(far)));
        p->depth[k] = (float)(orthographic ? 1 - at / p->camera.far_m : p->camera.near_m / at);
        if (sv_rng_range(rng, 0, 1) < 0.2)
            p->depth[k] = 0;
    }
    p->view = (struct sv_ground_view){.camera = &p->camera,
                                      .light = &p->light,
                                      .shift_x_px = p->shift_x,
                                      .shift_y_px = p->shift_y,
                                      .sky = true,
                                      .depth = p->depth};
}

/* From straight above, white, and nothing else: shares of sunlight are shares of the picture's light. */
static void light_by_sun_alone(struct sv_light *light)
{
    light->air = false;
    light->to_sun = sv_vec3(0, 0, 1);
    for (int c = 0; c < 3; c++) {
        light->sun_rgb[c] = 1;
        light->sky_rgb[c] = light->ground_rgb[c] = 0;
    }
}

struct place {
    struct sv_vec3 world, to_viewer;
    double depth, distance, pixel_m;
};

/* The place of a pixel, in double, from the same depth. */
static struct place place_of(const struct picture *p, int k)
{
    const struct sv_camera *c = &p->camera;
    bool ortho = c->projection == SV_PROJECTION_ORTHOGRAPHIC;
    struct sv_vec3 origin, ray;
    sv_camera_ray(c, k % W + 0.5 + p->shift_x, k / W + 0.5 + p->shift_y, &origin, &ray);
    struct place out;
    out.depth = ortho ? c->far_m * (1 - (double)p->depth[k]) : c->near_m / (double)p->depth[k];
    struct sv_vec3 local = sv_madd(origin, ray, out.depth);
    out.world = sv_add(c->eye, local);
    out.to_viewer = ortho ? sv_scale(c->forward, -1) : sv_scale(local, -1 / sv_length(local));
    out.distance = ortho ? out.depth : sv_length(local);
    out.pixel_m = (ortho ? 1 : out.depth) / sv_camera_focal_px(c);
    return out;
}

/* Worst and mean difference in codes. */
struct off {
    int worst;
    double sum;
    long count;
};

static void add_off(struct off *off, const uint8_t got[4], const float rgb[3])
{
    assert_int_equal(got[3], 255);
    for (int c = 0; c < 3; c++) {
        int e = abs(got[c] - sv_srgb8_from_linear(rgb[c]));
        off->worst = e > off->worst ? e : off->worst;
        off->sum += e;
        off->count++;
    }
}

static double albedo_texel_m(void)
{
    return (FW - 1) * terrain.field.dx / terrain.albedo.width;
}

/* Near the eye, where level 0 of the images is read: within two codes of the twin. */
static void near_ground_is_the_twins(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(31, 1);
    static struct picture p;
    struct off off = {0};
    for (int pose = 0; pose < 40; pose++) {
        make_picture(&p, &rng, pose % 4 == 3, exp(sv_rng_range(&rng, log(0.002), log(0.5))), 2);
        sv_ground_shade(ground, &p.view, p.rgba);
        for (int k = 0; k < W * H; k++) {
            if (p.depth[k] == 0)
                continue;
            struct place at = place_of(&p, k);
            float albedo[3], rgb[3];
            struct sv_vec3 n;
            sv_terrain_shade(&terrain, at.world.x, at.world.y, at.pixel_m, at.to_viewer, albedo, &n);
            /* Neighbouring samples may be seen at more of a slant. */
            if (at.pixel_m > 0.2 * albedo_texel_m() || sv_dot(n, at.to_viewer) < 0.4)
                continue;
            sv_light_surface(&p.light, n, albedo, 1, 1, rgb);
            sv_light_air(&p.light, at.distance, rgb);
            add_off(&off, p.rgba + 4 * k, rgb);
        }
    }
    assert_true(off.count > 100000);
    if (off.worst > 3 || off.sum / (double)off.count > 0.35)
        fail_msg("worst %d codes, mean %.3f", off.worst, off.sum / (double)off.count);
}

/* Far off, a pixel is the mean of what it covers: of the twin's albedo over the footprint, in the mean of
 * many. */
static void far_ground_keeps_the_mean(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(33, 1);
    static struct picture p;
    double got = 0, want = 0;
    for (int pose = 0; pose < 12; pose++) {
        make_picture(&p, &rng, true, 25, 1.01);
        p.light.air = false;
        sv_ground_shade(ground, &p.view, p.rgba);
        for (int k = 0; k < W * H; k++) {
            struct place at = place_of(&p, k);
            const struct sv_heightfield *f = &terrain.field;
            if (p.depth[k] == 0 || at.world.x < f->x0 || at.world.x > sv_heightfield_x1(f) ||
                at.world.y < f->y0 || at.world.y > sv_heightfield_y1(f))
                continue;
            float albedo[3], rgb[3];
            struct sv_vec3 n;
            sv_terrain_shade(&terrain, at.world.x, at.world.y, at.pixel_m, at.to_viewer, albedo, &n);
            sv_light_surface(&p.light, n, albedo, 1, 1, rgb);
            for (int c = 0; c < 3; c++) {
                got += (double)sv_linear_from_srgb8[p.rgba[4 * k + c]];
                want += (double)rgb[c];
            }
        }
    }
    if (!(fabs(got / want - 1) < 0.03))
        fail_msg("mean light %.4f of the twin's", got / want);
}

static void sky_is_the_twins(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(35, 1);
    static struct picture p;
    struct off off = {0};
    for (int pose = 0; pose < 30; pose++) {
        make_picture(&p, &rng, pose % 10 == 9, 1, 2);
        if (pose % 3 == 0) { /* into the sun, whose disc is a pixel or so wide */
            sv_camera_aim(&p.camera, atan2(p.light.to_sun.x, p.light.to_sun.y), asin(p.light.to_sun.z), 0);
            p.camera.vfov_rad = 0.2;
        }
        memset(p.depth, 0, sizeof p.depth);
        sv_ground_shade(ground, &p.view, p.rgba);
        for (int k = 0; k < W * H; k++) {
            struct sv_vec3 origin, ray;
            float rgb[3];
            sv_camera_ray(&p.camera, k % W + 0.5 + p.shift_x, k / W + 0.5 + p.shift_y, &origin, &ray);
            ray = sv_normalize(ray);
            struct sv_vec3 o = sv_sub(ray, p.light.to_sun);
            double edge = sqrt(sv_dot(o, o));
            if (edge > 4.2e-3 && edge < 5.2e-3) /* the disc's rim, steep in float */
                continue;
            sv_light_sky(&p.light, ray, rgb);
            add_off(&off, p.rgba + 4 * k, rgb);
        }
    }
    if (off.worst > 2 || off.sum / (double)off.count > 0.25)
        fail_msg("worst %d codes, mean %.3f", off.worst, off.sum / (double)off.count);
    p.view.sky = false;
    sv_ground_shade(ground, &p.view, p.rgba);
    for (int k = 0; k < W * H * 4; k++)
        assert_int_equal(p.rgba[k], 0);
}

/* Hidden pixels keep what was there; the others do not notice. */
static void hidden_pixels(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(37, 1);
    static struct picture p;
    static uint8_t hidden[W * H], all[W * H * 4];
    for (int pose = 0; pose < 8; pose++) {
        make_picture(&p, &rng, pose == 7, 0.3, 40);
        sv_ground_shade(ground, &p.view, all);
        for (int k = 0; k < W * H; k++)
            hidden[k] = sv_rng_range(&rng, 0, 1) < 0.5 || (k / 16) % 2;
        memset(p.rgba, 7, sizeof p.rgba);
        p.view.hidden = hidden;
        sv_ground_shade(ground, &p.view, p.rgba);
        for (int k = 0; k < W * H; k++)
            for (int c = 0; c < 4; c++)
                assert_int_equal(p.rgba[4 * k + c], hidden[k] ? 7 : all[4 * k + c]);
    }
}

/* ---- shadows ---- */

static struct sv_shadow_height sun_map;
static bool asked[SV_SHADOW_PAGE_LEVELS]; /* levels that were cast into */

/* A caster that says which page it was given: light of every texel is the level's number, and a chequer. */
static void mark(void *context, struct sv_shadow_window *window)
{
    (void)context;
    int level = (int)lrint(log2(window->texel_m / SV_SHADOW_PAGE_TEXEL_M));
    asked[level] = true;
    memset(window->light, 10 * level + 5, (size_t)window->side * (size_t)window->side);
}

/* Black ground but for sunlight: the red of a pixel tells the page that lit it. The rule, brute force: texels
 * are at least SV_SHADOW_PAGE_TEXEL_PX of the pixel's geometric mean on the ground, and less than twice that,
 * or the finest that there is. */
static void pages_are_as_fine_as_the_rule(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(39, 1);
    static struct picture p;
    struct sv_error error;
    struct sv_shadow_pages *pages;
    long compared = 0, off = 0;
    if (sv_shadow_pages_create(&pages, &error))
        fail_msg("%s", error.message);
    struct sv_shadow_scene scene = {.field = &terrain.field, .casters = {{mark, NULL}}, .key = 1};
    sv_shadow_pages_use(pages, &scene);
    for (int pose = 0; pose < 30; pose++) {
        make_picture(&p, &rng, pose % 5 == 4, exp(sv_rng_range(&rng, log(0.01), log(2))), 12);
        light_by_sun_alone(&p.light);
        static uint8_t lit[W * H * 4];
        sv_ground_shade(ground, &p.view, lit);
        p.view.shadows = pages;
        sv_ground_shade(ground, &p.view, p.rgba);
        for (int k = 0; k < W * H; k++) {
            float full = sv_linear_from_srgb8[lit[4 * k + 1]], part = sv_linear_from_srgb8[p.rgba[4 * k + 1]];
            if (p.depth[k] == 0 || full < 0.1f || full > 0.45f) /* where the tone curve is straight */
                continue;
            struct place at = place_of(&p, k);
            float albedo[3];
            struct sv_vec3 n;
            sv_terrain_shade(&terrain, at.world.x, at.world.y, at.pixel_m, at.to_viewer, albedo, &n);
            double footprint = at.pixel_m / sqrt(sv_clamp(sv_dot(n, at.to_viewer), 0.04, 1));
            double level = ceil(log2(SV_SHADOW_PAGE_TEXEL_PX * footprint / SV_SHADOW_PAGE_TEXEL_M));
            double got = ((double)(part / full) * 255 - 5) / 10;
            compared++;
            off += fabs(got - fmax(level, 0)) > 0.5;
        }
    }
    /* Where a normal's mip level is not level 0, or a footprint stands at the step: the next level. */
    assert_true(compared > 10000);
    if (off > compared / 12)
        fail_msg("%ld of %ld pixels are lit by another level than the rule's", off, compared);
    assert_true(asked[0] && asked[3] && !asked[12]);
    sv_shadow_pages_destroy(pages);
}

/* Only what is seen is cast: one pixel asks for one page, at its place. */
static double seen_x, seen_y;
static int seen_count;
static void note(void *context, struct sv_shadow_window *window)
{
    (void)context;
    double w = window->side * window->texel_m;
    seen_count++;
    assert_true(seen_x >= window->x0 && seen_x <= window->x0 + w && seen_y >= window->y0 &&
                seen_y <= window->y0 + w);
}

static void what_is_not_seen_is_not_cast(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(41, 1);
    static struct picture p;
    static uint8_t hidden[W * H];
    struct sv_error error;
    struct sv_shadow_pages *pages;
    if (sv_shadow_pages_create(&pages, &error))
        fail_msg("%s", error.message);
    for (int round = 0; round < 200; round++) {
        struct sv_shadow_scene scene = {
            .field = &terrain.field, .casters = {{note, NULL}}, .key = (uint64_t)round};
        sv_shadow_pages_use(pages, &scene);
        make_picture(&p, &rng, round % 5 == 4, exp(sv_rng_range(&rng, log(0.01), log(2))), 12);
        p.light.to_sun = sv_vec3(0, 0, 1);
        p.view.shadows = pages;
        p.view.hidden = hidden;
        int k = (int)sv_rng_range(&rng, 0, W * H - 1);
        memset(hidden, 1, sizeof hidden);
        hidden[k] = 0;
        struct place at = place_of(&p, k);
        seen_x = at.world.x;
        seen_y = at.world.y;
        seen_count = 0;
        sv_ground_shade(ground, &p.view, p.rgba);
        assert_int_equal(seen_count, p.depth[k] > 0);
    }
    sv_shadow_pages_destroy(pages);
}

static void simd_is_plain(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(43, 1);
    if (sv_simd_level() < SV_SIMD_AVX2)
        skip();
    static uint8_t plain[W * H * 4];
    static struct picture p;
    struct sv_error error;
    struct sv_vec3 to_sun = sv_normalize(sv_vec3(0.5, 0.4, 0.3));
    if (sv_shadow_height_make(&sun_map, &terrain.field, to_sun, &error))
        fail_msg("%s", error.message);
    struct sv_shadow_pages *pages;
    if (sv_shadow_pages_create(&pages, &error))
        fail_msg("%s", error.message);
    struct sv_shadow_scene scene = {.field = &terrain.field, .terrain = &sun_map, .key = 1};
    sv_shadow_pages_use(pages, &scene);
    for (int pose = 0; pose < 60; pose++) {
        make_picture(&p, &rng, pose % 5 == 4, exp(sv_rng_range(&rng, log(0.002), log(30))), 50);
        p.light.to_sun = to_sun;
        p.view.shadows = pose % 3 ? pages : NULL;
        sv_ground_shade_by(ground, &p.view, sv_ground_row_plain, plain);
        sv_ground_shade_by(ground, &p.view, sv_ground_row_avx2, p.rgba);
        for (int k = 0; k < W * H * 4; k++)
            if (plain[k] != p.rgba[k])
                fail_msg("pose %d, byte %d: plain %d, AVX2 %d", pose, k, plain[k], p.rgba[k]);
    }
    sv_shadow_pages_destroy(pages);
    sv_shadow_height_finish(&sun_map);
}

/* A source that has about half of all pages, of what looks like noise. */
static uint64_t some_pages(void *context, int level, int i, int j, uint64_t have, uint8_t *light)
{
    (void)context;
    (void)have;
    uint64_t h =
        sv_mix64((uint64_t)(uint32_t)i << 32 ^ (uint64_t)(uint32_t)j ^ sv_mix64((uint64_t)(level + 99)));
    if (h % 2)
        return 0;
    for (uint32_t k = 0; k < SV_SHADOW_PAGE_SIDE * SV_SHADOW_PAGE_SIDE; k++)
        light[k] = (uint8_t)((k * 2654435761u + (uint32_t)h) >> 13);
    return h;
}

static uint64_t no_pages(void *context, int level, int i, int j, uint64_t have, uint8_t *light)
{
    (void)context, (void)level, (void)i, (void)j, (void)have, (void)light;
    return 0;
}

/* With a source in use, too; and the source changes what it should and nothing else. */
static void simd_is_plain_of_refined_pages(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(47, 1);
    if (sv_simd_level() < SV_SIMD_AVX2)
        skip();
    static uint8_t plain[W * H * 4], built[W * H * 4];
    static struct picture p;
    struct sv_error error;
    struct sv_vec3 to_sun = sv_normalize(sv_vec3(0.5, 0.4, 0.3));
    if (sv_shadow_height_make(&sun_map, &terrain.field, to_sun, &error))
        fail_msg("%s", error.message);
    struct sv_shadow_pages *pages, *others;
    if (sv_shadow_pages_create(&pages, &error) || sv_shadow_pages_create(&others, &error))
        fail_msg("%s", error.message);
    struct sv_shadow_scene scene = {.field = &terrain.field, .terrain = &sun_map, .key = 1}, refined = scene;
    refined.refined = (struct sv_shadow_source){some_pages, NULL, 1};
    sv_shadow_pages_use(others, &scene);
    int changed = 0;
    for (int pose = 0; pose < 60; pose++) {
        make_picture(&p, &rng, pose % 5 == 4, exp(sv_rng_range(&rng, log(0.002), log(30))), 50);
        p.light.to_sun = to_sun;
        p.view.shadows = pages;
        sv_shadow_pages_use(pages, &refined);
        sv_ground_shade_by(ground, &p.view, sv_ground_row_plain, plain);
        sv_ground_shade_by(ground, &p.view, sv_ground_row_avx2, p.rgba);
        for (int k = 0; k < W * H * 4; k++)
            if (plain[k] != p.rgba[k])
                fail_msg("pose %d, byte %d: plain %d, AVX2 %d", pose, k, plain[k], p.rgba[k]);
        sv_shadow_pages_use(pages, &scene);
        sv_ground_shade(ground, &p.view, built);
        p.view.shadows = others; /* that never had a source */
        sv_ground_shade(ground, &p.view, p.rgba);
        assert_memory_equal(built, p.rgba, sizeof built);
        changed += memcmp(plain, built, sizeof built) != 0;
        /* A source that has nothing changes nothing. */
        struct sv_shadow_scene empty = scene;
        empty.refined = (struct sv_shadow_source){no_pages, NULL, 2};
        p.view.shadows = pages;
        sv_shadow_pages_use(pages, &empty);
        sv_ground_shade(ground, &p.view, p.rgba);
        assert_memory_equal(built, p.rgba, sizeof built);
    }
    assert_true(changed > 40);
    sv_shadow_pages_destroy(pages);
    sv_shadow_pages_destroy(others);
    sv_shadow_height_finish(&sun_map);
}

/* A source of one level's pages, of a triangle wave along x and y: look-ups give it back at the pixel's
 * middle, on whatever page that is, also where finer pages are wished for. A texel is a twelfth of the light,
 * so that a seam at a page's border would show. */
static int wave_level;
static double wave(double texels)
{
    return fabs(fmod(texels + 24e6, 24) - 12) / 12;
}
static double wave_at(double x, double y, double texel_m)
{
    return 0.5 * wave((x - terrain.field.x0) / texel_m) + 0.5 * wave((y - terrain.field.y0) / texel_m);
}
static uint64_t wave_pages(void *context, int level, int i, int j, uint64_t have, uint8_t *light)
{
    enum { SIDE = SV_SHADOW_PAGE_SIDE };
    struct sv_shadow_place at = sv_shadow_page_place(&terrain.field, level, i, j);
    double along_x[SIDE], along_y[SIDE];
    (void)context;
    if (level != wave_level || have)
        return level == wave_level;
    for (int k = 0; k < SIDE; k++) {
        along_x[k] = 127.5 * wave((at.x0 - terrain.field.x0) / at.texel_m + k + 0.5);
        along_y[k] = 127.5 * wave((at.y0 - terrain.field.y0) / at.texel_m + k + 0.5);
    }
    for (int k = 0; k < SIDE * SIDE; k++)
        light[k] = (uint8_t)(along_x[k % SIDE] + along_y[k / SIDE] + 0.5);
    return 1;
}

static void refined_pages_have_no_seams(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(49, 1);
    static struct picture p;
    static uint8_t lit[W * H * 4];
    struct sv_error error;
    struct sv_shadow_pages *pages;
    long compared = 0, borders = 0;
    if (sv_shadow_pages_create(&pages, &error))
        fail_msg("%s", error.message);
    for (int pose = 0; pose < 120; pose++) {
        wave_level = pose % (SV_SHADOW_PAGE_FINER + 1) - SV_SHADOW_PAGE_FINER;
        double texel_m = ldexp(SV_SHADOW_PAGE_TEXEL_M, wave_level);
        struct sv_shadow_scene scene = {.field = &terrain.field,
                                        .casters = {{mark, NULL}},
                                        .key = 1,
                                        .refined = {wave_pages, NULL, (uint64_t)pose + 1}};
        sv_shadow_pages_use(pages, &scene);
        make_picture(&p, &rng, pose % 7 == 4, texel_m * sv_rng_range(&rng, 0.02, 0.15), 3);
        light_by_sun_alone(&p.light);
        sv_ground_shade(ground, &p.view, lit);
        p.view.shadows = pages;
        sv_ground_shade(ground, &p.view, p.rgba);
        for (int k = 0; k < W * H; k++) {
            float full = sv_linear_from_srgb8[lit[4 * k + 1]], part = sv_linear_from_srgb8[p.rgba[4 * k + 1]];
            if (p.depth[k] == 0 || full < 0.1f || full > 0.45f) /* where the tone curve is straight */
                continue;
            struct place at = place_of(&p, k);
            float albedo[3];
            struct sv_vec3 n;
            sv_terrain_shade(&terrain, at.world.x, at.world.y, at.pixel_m, at.to_viewer, albedo, &n);
            if (sv_dot(n, at.to_viewer) < 0.3)
                continue; /* seen so flat that the pixel is longer than a texel */
            double want = wave_at(at.world.x, at.world.y, texel_m);
            double column = fmod((at.world.x - terrain.field.x0) / texel_m, SV_SHADOW_PAGE_STEP);
            borders += column < 1 || column > SV_SHADOW_PAGE_STEP - 1;
            compared++;
            if (fabs((double)(part / full) - want) > 0.06)
                fail_msg("level %d, pose %d, pixel %d: light %.3f, not %.3f", wave_level, pose, k,
                         (double)(part / full), want);
        }
    }
    print_message("%ld pixels, %ld at a page's border\n", compared, borders);
    assert_true(compared > 10000 && borders > 200);
    sv_shadow_pages_destroy(pages);
}

/* Depths that no drawing gives leave a picture of some colours, and nothing else is touched. */
static void hostile_depths(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(45, 1);
    static struct picture p;
    const float odd[] = {NAN, INFINITY, -INFINITY, -1, 1e-38f, 3e38f, 1e-30f, 5, 1};
    struct sv_error error;
    struct sv_shadow_pages *pages;
    if (sv_shadow_pages_create(&pages, &error))
        fail_msg("%s", error.message);
    struct sv_shadow_scene scene = {.field = &terrain.field, .key = 1};
    sv_shadow_pages_use(pages, &scene);
    for (int pose = 0; pose < 6; pose++) {
        make_picture(&p, &rng, pose % 2, 0.2, 30);
        p.view.shadows = pages;
        for (int k = 0; k < W * H; k += 3)
            p.depth[k] = odd[(k / 3) % (int)(sizeof odd / sizeof odd[0])];
        sv_ground_shade(ground, &p.view, p.rgba);
    }
    sv_shadow_pages_destroy(pages);
}

static void terrains_without_colours_are_refused(void **state)
{
    (void)state;
    struct sv_terrain bare = {.field = terrain.field};
    struct sv_ground *none = NULL;
    struct sv_error error;
    assert_int_equal(sv_ground_create(&bare, &none, &error), SV_EINVAL);
    assert_string_equal(error.field, "terrain.albedo");
    bare.albedo = terrain.albedo;
    assert_int_equal(sv_ground_create(&bare, &none, &error), SV_EINVAL);
    assert_string_equal(error.field, "terrain.normal");
    assert_null(none);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(near_ground_is_the_twins),
        cmocka_unit_test(far_ground_keeps_the_mean),
        cmocka_unit_test(sky_is_the_twins),
        cmocka_unit_test(hidden_pixels),
        cmocka_unit_test(pages_are_as_fine_as_the_rule),
        cmocka_unit_test(what_is_not_seen_is_not_cast),
        cmocka_unit_test(simd_is_plain),
        cmocka_unit_test(simd_is_plain_of_refined_pages),
        cmocka_unit_test(refined_pages_have_no_seams),
        cmocka_unit_test(hostile_depths),
        cmocka_unit_test(terrains_without_colours_are_refused),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
