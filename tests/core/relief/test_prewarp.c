/* test_prewarp.c - the two-pass warp: against rays through every sample (ray_march.h), its order against a
 * warp with a depth buffer, holes against their known area. The equations have test_prewarp_equations.c. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/rng.h"
#include "core/relief/prewarp.h"
#include "tests/core/relief/named_reliefs.h"
#include "tests/core/relief/ray_march.h"

static struct sv_relief_frame plain_frame(void)
{
    return (struct sv_relief_frame){sv_vec3(0, 0, 0), sv_vec3(1, 0, 0), sv_vec3(0, 1, 0), sv_vec3(0, 0, 1)};
}

/* ---- the two-pass warp ---- */

struct view {
    bool parallel;
    struct sv_vec3 eye_or_direction;
};

static struct sv_prewarp prewarp_of(const struct sv_relief_frame *frame, const struct view *view)
{
    struct sv_prewarp p;
    struct sv_error error;
    if (view->parallel ? sv_prewarp_parallel(frame, view->eye_or_direction, &p, &error)
                       : sv_prewarp_perspective(frame, view->eye_or_direction, &p, &error))
        fail_msg("%s: %s", error.field, error.message);
    return p;
}

/* Looks at the middle of a relief from `angle` off f (> 90 degrees: from behind), `away` sizes from it. */
static struct view view_of(const struct sv_relief *r, double angle, double azimuth, double away,
                           bool parallel)
{
    const struct sv_relief_frame *f = &r->frame;
    struct sv_vec3 middle = sv_relief_point(f, 0.5 * r->width, 0.5 * r->height, r->displ_min);
    struct sv_vec3 side =
        sv_add(sv_scale(sv_normalize(f->a), cos(azimuth)), sv_scale(sv_normalize(f->b), sin(azimuth)));
    struct sv_vec3 to = sv_madd(sv_scale(f->f, cos(angle)), side, sin(angle));
    double size = fmax(sv_length(f->a) * r->width, sv_length(f->b) * r->height);
    return parallel ? (struct view){true, sv_scale(to, -1)}
                    : (struct view){false, sv_madd(middle, to, away * size)};
}

/* The truth of one sample: a ray from the eye through its place on the plane (ray_march.h). */
static void look_through(const struct ray_field *field, const struct sv_relief *r, const struct view *view,
                         const struct sv_warped *w, int x, int y, struct ray_seen *seen)
{
    double u = w->u0 + (x + 0.5) * (w->u1 - w->u0) / w->width;
    double v = w->v0 + (y + 0.5) * (w->v1 - w->v0) / w->height;
    struct sv_vec3 p = sv_relief_point(&r->frame, u, v, 0), aside = r->frame.a, eye = view->eye_or_direction;
    double size =
        sv_length(r->frame.a) * r->width + sv_length(r->frame.b) * r->height + r->displ_max - r->displ_min;
    struct sv_camera c = {.projection =
                              view->parallel ? SV_PROJECTION_ORTHOGRAPHIC : SV_PROJECTION_PERSPECTIVE,
                          .vfov_rad = 1,
                          .ortho_height_m = 1,
                          .width = 1,
                          .height = 1,
                          .near_m = 1e-6 * size,
                          .far_m = 200 * size};
    c.forward = sv_normalize(view->parallel ? eye : sv_sub(p, eye));
    c.right = sv_normalize(sv_cross(c.forward, aside));
    c.up = sv_cross(c.right, c.forward);
    c.eye = view->parallel ? sv_madd(p, c.forward, -100 * size) : eye;
    ray_march(field, &c, 0.5, 0.5, seen);
}

struct tally {
    long seen, off, missing, extra, holes, holes_right, fill_off;
};

/* plain: the warp without filling, full: with it. */
static void compare(const struct sv_relief *r, const struct view *view, const struct sv_warped *plain,
                    const struct sv_warped *full, struct tally *t)
{
    struct ray_field *field = ray_field_create(r);
    for (int y = 0; y < plain->height; y++)
        for (int x = 0; x < plain->width; x++) {
            size_t at = (size_t)y * (size_t)plain->width + (size_t)x;
            struct ray_seen seen;
            look_through(field, r, view, plain, x, y, &seen);
            bool there = seen.kind == RAY_SURFACE, ours = plain->color[at][3] != 0;
            bool hole = !ours && full->color[at][3] != 0;
            double most = 0, filled = 0;
            for (int c = 0; c < 3; c++) {
                most = fmax(most, fabs(plain->color[at][c] - seen.rgb[c]));
                filled = fmax(filled, fabs(full->color[at][c] - seen.far_rgb[c]));
            }
            t->seen += there || ours;
            t->missing += there && !ours;
            t->extra += ours && !there;
            t->off += there && ours && most > 8;
            t->holes += seen.kind == RAY_HOLE;
            t->holes_right += seen.kind == RAY_HOLE && hole;
            t->fill_off += seen.kind == RAY_HOLE && hole && filled > 8;
        }
    ray_field_destroy(field);
}

static struct sv_warped warp(const struct sv_relief *r, const struct sv_prewarp *p, int width, int height,
                             bool fill, enum sv_prewarp_order order)
{
    struct sv_prewarp_options options = {.width = width, .height = height, .fill = fill, .order = order};
    struct sv_warped w;
    struct sv_error error;
    if (sv_prewarp_two_pass(r, p, &options, &w, &error))
        fail_msg("%s: %s", error.field, error.message);
    return w;
}

static struct sv_relief new_relief(int width, int height, float cut)
{
    struct sv_relief r;
    struct sv_error error;
    if (sv_relief_alloc(width, height, &r, &error))
        fail_msg("%s", error.message);
    r.frame = plain_frame();
    r.cut = cut;
    return r;
}

static void set(struct sv_relief *r, int i, int j, float d, int red, int green, int blue)
{
    size_t at = (size_t)j * (size_t)r->width + (size_t)i;
    r->displ[at] = d;
    uint8_t color[4] = {(uint8_t)red, (uint8_t)green, (uint8_t)blue, 255};
    memcpy(r->color[at], color, 4);
}

/* A flat relief is its own warp, texel for texel, from anywhere. */
static void flat_reliefs_stay(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(31, 4);
    struct sv_relief r = new_relief(17, 9, 1);
    for (int j = 0; j < 9; j++)
        for (int i = 0; i < 17; i++)
            set(&r, i, j, 0, (int)(sv_rng_next(&rng) & 255), i * 15, j * 25);
    sv_relief_measure(&r);
    for (int n = 0; n < 32; n++) {
        struct view view = view_of(&r, n < 16 ? 1.2 : 2.0, n, 0.7, n & 1);
        struct sv_prewarp p = prewarp_of(&r.frame, &view);
        struct sv_warped w = warp(&r, &p, 0, 0, true, SV_PREWARP_ORDER_AUTO);
        assert_int_equal(w.width, 17);
        assert_int_equal(w.height, 9);
        assert_memory_equal(w.color, r.color, 17 * 9 * 4);
        assert_memory_equal(w.displ, r.displ, 17 * 9 * 4);
        for (uint32_t t = 0; t < 17 * 9; t++)
            assert_int_equal(w.texel[t], t);
        assert_int_equal(w.holes, 0);
        sv_warped_finish(&w);
    }
    sv_relief_finish(&r);
}

static const struct {
    double angle, azimuth, away;
    bool parallel;
} looks[] = {{0.1, 0.3, 1.5, false}, {0.5, 2.2, 1.2, false}, {0.52, 4.1, 2.0, true}, {1.0, 5.5, 1.3, false},
             {1.0, 1.0, 1.3, true},  {2.5, 0.4, 1.5, false}, {2.4, 3.6, 1.5, true}};
enum { LOOKS = sizeof looks / sizeof *looks };

/* Named reliefs from seven places, with both orders of passes. The plain suite takes those of up to 64 texels
 * a side, SV_TEST_FULL=1 all; SV_TEST_EACH=1 prints each. */
static void two_pass_against_rays(void **state)
{
    (void)state;
    static const char *const kind[3] = {"smooth", "stepped", "noisy"};
    const char *full_run = getenv("SV_TEST_FULL");
    int largest = full_run && strcmp(full_run, "1") == 0 ? 256 : 128;
    struct tally sum[3][LOOKS] = {{{0}}}, other = {0};
    for (int k = 0; k < NAMED_COUNT; k++) {
        struct sv_relief r;
        named_relief_make(k, &r);
        for (int n = 0; n < LOOKS && r.width <= largest && r.height <= largest; n++) {
            struct view view =
                view_of(&r, looks[n].angle, looks[n].azimuth, looks[n].away, looks[n].parallel);
            struct sv_prewarp p = prewarp_of(&r.frame, &view);
            struct sv_warped plain = warp(&r, &p, 0, 0, false, SV_PREWARP_ORDER_AUTO);
            struct sv_warped full = warp(&r, &p, 0, 0, true, SV_PREWARP_ORDER_AUTO);
            struct tally t = {0};
            compare(&r, &view, &plain, &full, &t);
            if (getenv("SV_TEST_EACH") && t.seen > 0)
                print_message(
                    "    %-24s %d x %d look %d: %.3f / %.3f / %.3f of %ld; holes %ld of %ld, fill off %ld\n",
                    named_relief_name(k), r.width, r.height, n, 100.0 * t.off / t.seen,
                    100.0 * t.missing / t.seen, 100.0 * t.extra / t.seen, t.seen, t.holes_right, t.holes,
                    t.fill_off);
            long *to = (long *)&sum[named_relief_kind(k)][n], *from = (long *)&t;
            for (size_t m = 0; m < sizeof t / sizeof *to; m++)
                to[m] += from[m];
            enum sv_prewarp_order turned =
                plain.columns_first ? SV_PREWARP_ROWS_FIRST : SV_PREWARP_COLUMNS_FIRST;
            sv_warped_finish(&plain);
            plain = warp(&r, &p, 0, 0, false, turned);
            compare(&r, &view, &plain, &full, &other);
            sv_warped_finish(&plain);
            sv_warped_finish(&full);
        }
        sv_relief_finish(&r);
    }
    print_message("share of samples, %%: off by more than 8 levels / missing / extra; holes found; fill off "
                  "by more than 8\n");
    for (int m = 0; m < 3; m++)
        for (int n = 0; n < LOOKS; n++) {
            const struct tally *t = &sum[m][n];
            double all = t->seen > 0 ? 100.0 / (double)t->seen : 0;
            print_message("  %-8s %5.1f degrees off f, %-11s %6.3f / %6.3f / %6.3f of %ld; %ld of %ld, %ld\n",
                          kind[m], sv_degrees(looks[n].angle), looks[n].parallel ? "parallel" : "perspective",
                          (double)t->off * all, (double)t->missing * all, (double)t->extra * all, t->seen,
                          t->holes_right, t->holes, t->fill_off);
            if (m == NAMED_NOISY || t->seen < 1000)
                continue;
            assert_true((double)t->off * all < (looks[n].angle < 0.6 ? 0.1 : 0.3));
            assert_true((double)t->missing * all < 0.01 && (double)t->extra * all < 0.01);
            assert_true((double)t->holes_right >= 0.999 * (double)t->holes);
            assert_true(t->fill_off * 500 <= t->holes);
        }
    print_message("  all, the other order of passes: %.3f / %.3f / %.3f\n",
                  100.0 * (double)other.off / (double)other.seen,
                  100.0 * (double)other.missing / (double)other.seen,
                  100.0 * (double)other.extra / (double)other.seen);
}

/* ---- order ---- */

/* Blocks of 6 x 6 texels, as high as 30: they hide each other from everywhere. */
static struct sv_relief blocks(int side)
{
    struct sv_rng rng = sv_rng_seeded(31, 6);
    struct sv_relief r = new_relief(side, side, 0.5f);
    for (int j = 0; j < side; j++)
        for (int i = 0; i < side; i++) {
            float d = 3.0f * (float)(sv_rng_next(&rng) % 10);
            if (i % 6 != 0)
                d = r.displ[j * side + i - 1];
            else if (j % 6 != 0)
                d = r.displ[(j - 1) * side + i];
            set(&r, i, j, d, (int)(d * 8), 0, 0);
        }
    sv_relief_measure(&r);
    return r;
}

/* A warp with a depth buffer: 32 x 32 points of each texel go along their own rays; of those that pass within
 * a tenth of a sample of its centre the nearest wins. NaN: none. */
static float *depth_buffer_warp(const struct sv_relief *r, const struct view *view, const struct sv_warped *w)
{
    enum { MANY = 32 }; /* at twice the size and two samples a texel: one in each tenth */
    size_t n = (size_t)w->width * (size_t)w->height;
    float *displ = malloc(n * sizeof *displ);
    double *nearest = malloc(n * sizeof *nearest);
    assert_true(displ && nearest);
    for (size_t k = 0; k < n; k++)
        nearest[k] = INFINITY, displ[k] = NAN;
    for (int t = 0; t < r->width * r->height; t++)
        for (int k = 0; k < MANY * MANY; k++) {
            double d = r->displ[t];
            struct sv_vec3 x =
                sv_vec3(t % r->width + (k % MANY + 0.5) / MANY, t / r->width + (k / MANY + 0.5) / MANY, d);
            struct sv_vec3 ray = view->parallel ? view->eye_or_direction : sv_sub(x, view->eye_or_direction);
            double distance = view->parallel ? sv_dot(x, ray) : sv_length(ray);
            struct sv_vec3 p = sv_madd(x, ray, -d / ray.z);
            if (!view->parallel && ray.z * (p.z - view->eye_or_direction.z) < 0)
                continue;
            double px = (p.x - w->u0) * w->width / (w->u1 - w->u0),
                   py = (p.y - w->v0) * w->height / (w->v1 - w->v0);
            if (!(px >= 0 && py >= 0 && px < w->width && py < w->height) ||
                fabs(px - floor(px) - 0.5) > 0.1 || fabs(py - floor(py) - 0.5) > 0.1)
                continue;
            size_t at = (size_t)py * (size_t)w->width + (size_t)px;
            if (distance >= nearest[at])
                continue;
            nearest[at] = distance;
            displ[at] = (float)d;
        }
    free(nearest);
    return displ;
}

/* Samples that show a surface which the depth buffer sees neither there nor next to it, nor (points beside
 * the centre hide slivers) a ray through the very centre. */
static long wrong_surfaces(const struct sv_relief *r, const struct view *view, const struct sv_warped *w,
                           const float *truth, long *judged)
{
    long wrong = 0;
    struct ray_field *field = ray_field_create(r);
    for (int y = 1; y + 1 < w->height; y++)
        for (int x = 1; x + 1 < w->width; x++) {
            size_t at = (size_t)y * (size_t)w->width + (size_t)x;
            if (isnan(truth[at]) || w->color[at][3] == 0)
                continue;
            bool near = false;
            for (int k = 0; k < 9; k++) {
                size_t n = (size_t)(y + k / 3 - 1) * (size_t)w->width + (size_t)(x + k % 3 - 1);
                near |= fabsf(truth[n] - w->displ[at]) < 0.1f;
            }
            ++*judged;
            struct ray_seen seen;
            if (near)
                continue;
            look_through(field, r, view, w, x, y, &seen);
            wrong += seen.kind != RAY_SURFACE || fabs(seen.displ - w->displ[at]) > 0.1;
        }
    ray_field_destroy(field);
    return wrong;
}

static void nearest_surface_wins_on_all_sides(void **state)
{
    (void)state;
    enum { SIDE = 48 };
    struct sv_relief r = blocks(SIDE);
    long judged = 0, wrong = 0, mirrored = 0, ignored = 0;
    for (int n = 0; n < 72; n++) {
        /* the foot of the eye: in a ring beside the texture, or on it; in front and behind; parallel */
        double azimuth = n % 12 * 0.5236 + 0.1, out = n / 12 % 3 == 1 ? 10 : 45;
        bool behind = n >= 36;
        struct view view = {n / 12 % 3 == 2,
                            sv_vec3(24 + out * cos(azimuth), 24 + out * sin(azimuth), behind ? -25 : 60)};
        if (view.parallel)
            view.eye_or_direction = sv_vec3(cos(azimuth), sin(azimuth), behind ? 0.9 : -0.9);
        struct sv_prewarp p = prewarp_of(&r.frame, &view);
        assert_int_equal(p.behind, behind);
        struct sv_warped w = warp(&r, &p, 2 * SIDE, 2 * SIDE, false, SV_PREWARP_ORDER_AUTO);
        float *truth = depth_buffer_warp(&r, &view, &w);
        wrong += wrong_surfaces(&r, &view, &w, truth, &judged);
        sv_warped_finish(&w);
        /* the same with the epipole on the other side: this must fail, or the test proves nothing */
        for (int k = 0; k < 2; k++)
            p.epipole[k] = isinf(p.epipole[k]) ? -p.epipole[k] : 1e6 * (p.epipole[k] < 24 ? 1 : -1);
        w = warp(&r, &p, 2 * SIDE, 2 * SIDE, false, SV_PREWARP_ORDER_AUTO);
        mirrored += wrong_surfaces(&r, &view, &w, truth, &ignored);
        sv_warped_finish(&w);
        free(truth);
    }
    print_message("order: %ld samples of 72 eyes on all sides of the epipole, %ld show a hidden surface; "
                  "with the order "
                  "reversed %ld\n",
                  judged, wrong, mirrored);
    assert_true(judged > 200000);
    assert_true(wrong * 10000 < judged);
    assert_true(mirrored * 50 > judged);
    sv_relief_finish(&r);
}

/* ---- holes ---- */

/* A smooth skin, magnified three times and more: inside its outline every sample is there. Of those on its
 * outline rays may see one in a hundred more. */
static void magnified_surfaces_have_no_pin_holes(void **state)
{
    (void)state;
    enum { SIDE = 40 };
    struct sv_relief r = new_relief(SIDE, SIDE, 1.5f);
    for (int j = 0; j < SIDE; j++)
        for (int i = 0; i < SIDE; i++)
            set(&r, i, j, (float)(6 * sin(i * 0.17) * cos(j * 0.19)), i, j, 0);
    sv_relief_measure(&r);
    long inside = 0, missing = 0, pin_holes = 0;
    for (int n = 0; n < 24; n++) {
        struct view view = view_of(&r, n % 4 * 0.3 + (n < 12 ? 0 : 2.1), n * 0.7, 0.6, n % 3 == 0);
        struct sv_prewarp p = prewarp_of(&r.frame, &view);
        struct sv_warped w = warp(&r, &p, 300, 300, false, SV_PREWARP_ORDER_AUTO);
        struct ray_field *field = ray_field_create(&r);
        for (int y = 1; y < 299; y++)
            for (int x = 1; x < 299; x++) {
                size_t at = (size_t)y * 300 + (size_t)x;
                struct ray_seen seen;
                inside += w.color[at][3] != 0;
                if (w.color[at][3])
                    continue;
                look_through(field, &r, &view, &w, x, y, &seen);
                missing += seen.kind == RAY_SURFACE;
                pin_holes += w.color[at - 1][3] && w.color[at + 1][3] && w.color[at - 300][3] &&
                             w.color[at + 300][3] && seen.kind == RAY_SURFACE;
            }
        ray_field_destroy(field);
        assert_int_equal(w.holes, 0);
        sv_warped_finish(&w);
    }
    print_message("magnified: %ld samples landed, %ld more are seen by rays, %ld of them pin-holes\n", inside,
                  missing, pin_holes);
    assert_true(inside > 500000);
    assert_int_equal(pin_holes, 0);
    assert_true(missing * 100 < inside);
    sv_relief_finish(&r);
}

/* A block on flat ground, seen so that the ground behind it is not known: the area that opens is the shift of
 * the block's near rims, minus what the block itself covers again. */
static void holes_are_counted_and_filled_from_the_far_side(void **state)
{
    (void)state;
    enum { SIDE = 40, X0 = 15, X1 = 25, Y0 = 18, Y1 = 24 };
    for (int n = 0; n < 8; n++) {
        struct sv_relief r = new_relief(SIDE, SIDE, 1);
        for (int j = 0; j < SIDE; j++)
            for (int i = 0; i < SIDE; i++) {
                bool on = i >= X0 && i < X1 && j >= Y0 && j < Y1;
                set(&r, i, j, on ? 5 : 0, on ? 250 : 20, 100, 100);
            }
        sv_relief_measure(&r);
        double ku = (n & 1 ? 1 : -1) * 0.8, kv = n & 2 ? 0.4 : 0; /* samples of shift a metre */
        /* k4 = -(c.a) / (c.f): looking down, c.f = -1, k4 = c.a; from behind c.f = 1 */
        bool behind = n >= 4;
        struct view view = {true, sv_vec3(behind ? -ku : ku, behind ? -kv : kv, behind ? 1 : -1)};
        struct sv_prewarp p = prewarp_of(&r.frame, &view);
        struct sv_warped open = warp(&r, &p, 0, 0, false, SV_PREWARP_ORDER_AUTO);
        struct sv_warped closed = warp(&r, &p, 0, 0, true, SV_PREWARP_ORDER_AUTO);
        /* the block lands 5 ku, 5 kv away; in front the hole is its old place less its new one. From behind
         * the ground hides the block but for what shows through its old place, and the same is open. */
        int shift_u = (int)fabs(5 * ku), shift_v = (int)fabs(5 * kv);
        int expected = (X1 - X0) * (Y1 - Y0) - (X1 - X0 - shift_u) * (Y1 - Y0 - shift_v);
        assert_int_equal(open.holes, expected);
        assert_int_equal(open.holes_left, expected);
        assert_int_equal(closed.holes, expected);
        assert_int_equal(closed.holes_left, 0);
        int filled = 0;
        for (int t = 0; t < open.width * open.height; t++) {
            bool empty = open.color[t][3] == 0;
            assert_true(closed.color[t][3] == 255);
            if (!empty)
                continue;
            filled++;
            assert_true(open.texel[t] == SV_WARPED_NONE && open.displ[t] == 0);
            assert_true(closed.displ[t] == (behind ? 5 : 0)); /* the far side */
            assert_int_equal(closed.color[t][0], behind ? 250 : 20);
        }
        assert_int_equal(filled, expected);
        sv_warped_finish(&open);
        sv_warped_finish(&closed);
        sv_relief_finish(&r);
    }
}

static void see_through_texels_are_no_holes(void **state)
{
    (void)state;
    struct sv_relief r = new_relief(8, 8, 1);
    for (int t = 0; t < 64; t++) {
        set(&r, t % 8, t / 8, (float)(t % 3 == 0 ? 4 : 0), 1, 2, 3);
        r.color[t][3] = t % 3 == 1 ? 0 : 255;
        if (t % 3 == 2)
            r.displ[t] = NAN;
    }
    sv_relief_measure(&r);
    struct view view = {true, sv_vec3(0.9, 0.2, -1)};
    struct sv_prewarp p = prewarp_of(&r.frame, &view);
    struct sv_warped w = warp(&r, &p, 0, 0, true, SV_PREWARP_ORDER_AUTO);
    assert_int_equal(w.holes, 0);
    sv_warped_finish(&w);
    for (int t = 0; t < 64; t++)
        r.color[t][3] = 0;
    w = warp(&r, &p, 0, 0, true, SV_PREWARP_ORDER_AUTO);
    assert_true(w.width == 8 && w.height == 8 && w.u0 == 0 && w.v1 == 8);
    for (int t = 0; t < 64; t++)
        assert_true(w.color[t][3] == 0 && w.texel[t] == SV_WARPED_NONE);
    sv_warped_finish(&w);
    sv_relief_finish(&r);
}

/* Blocks of a few levels on a panel, from eyes that moved aside, forward (order inward) and back (order
 * outward): every sample shows the nearest level that stands there, or, where none does, is a hole. On one
 * level (1) is linear, so what a sample sees of each level is known without any warp. Samples within 0.02
 * texels of a block's border are left out: displ is float, and both sides are right there. */
static void panels_show_the_nearest_on_all_sides(void **state)
{
    enum { SIDE = 48, LEVELS = 4 };
    static const double offset[][3] = {{0.3, 0.2, 0.4},    {-0.3, 0.2, 0.4},   {0.2, -0.4, -0.5},
                                       {-0.4, -0.2, -0.5}, {0.05, 0.02, -0.9}, {0, 0, -0.6},
                                       {0.3, -0.1, 0},     {0.02, 0.03, 0.5}};
    (void)state;
    const double d = SIDE / 2.0;
    long seen = 0;
    for (size_t k = 0; k < sizeof offset / sizeof *offset; k++) {
        struct sv_relief r = new_relief(SIDE, SIDE, 1);
        struct sv_rng rng = sv_rng_seeded(k + 1, 7);
        for (int j = 0; j < SIDE; j++)
            for (int i = 0; i < SIDE; i++)
                set(&r, i, j, -2.0f * LEVELS, 10, 10, 10);
        for (int b = 0; b < 40; b++) {
            int i0 = (int)sv_rng_range(&rng, 0, SIDE - 6), j0 = (int)sv_rng_range(&rng, 0, SIDE - 6);
            float level = -2.0f * (float)(int)sv_rng_range(&rng, 0, LEVELS);
            for (int j = j0; j < j0 + 6; j++)
                for (int i = i0; i < i0 + 6; i++)
                    set(&r, i, j, level, 50, 50, 50);
        }
        sv_relief_measure(&r);
        struct sv_vec3 v = {d, d, d};
        struct sv_vec3 eye = {v.x + offset[k][0] * d, v.y + offset[k][1] * d, v.z - offset[k][2] * d};
        struct sv_prewarp p;
        struct sv_error error;
        assert_int_equal(sv_prewarp_panel(&r.frame, v, eye, &p, &error), SV_OK);
        for (int order = SV_PREWARP_ROWS_FIRST; order <= SV_PREWARP_COLUMNS_FIRST; order++) {
            struct sv_warped w = warp(&r, &p, 0, 0, false, (enum sv_prewarp_order)order);
            for (int y = 0; y < w.height; y++)
                for (int x = 0; x < w.width; x++) {
                    double ui = w.u0 + x + 0.5, vi = w.v0 + y + 0.5;
                    bool border = false, hit = false;
                    for (int l = 0; l <= LEVELS && !hit && !border; l++) {
                        double zeta = -2.0 * l, tau = 1 + p.k[2] * zeta;
                        double u = ui * tau - p.k[0] * zeta, q = vi * tau - p.k[1] * zeta; /* eq. 1 */
                        border = fabs(u - round(u)) < 0.02 || fabs(q - round(q)) < 0.02;
                        if (border || !(u > 0 && q > 0 && u < SIDE && q < SIDE))
                            continue;
                        hit = (double)r.displ[(int)q * SIDE + (int)u] == zeta;
                        if (hit) {
                            size_t at = (size_t)y * (size_t)w.width + (size_t)x;
                            assert_true(w.color[at][3] == 255);
                            assert_true(fabs((double)w.displ[at] - zeta) < 1e-4);
                            seen++;
                        }
                    }
                }
            sv_warped_finish(&w);
        }
        sv_relief_finish(&r);
    }
    assert_true(seen > 20000);
}

static void bad_options_are_refused(void **state)
{
    (void)state;
    struct sv_relief r = new_relief(4, 4, 1);
    struct view view = {true, sv_vec3(0.9, 0.2, -1)};
    struct sv_prewarp p = prewarp_of(&r.frame, &view), none = {.near = 0};
    struct sv_prewarp_options options = {.width = -1};
    struct sv_warped w = {.width = 77};
    struct sv_error error;
    assert_int_equal(sv_prewarp_two_pass(&r, &p, &options, &w, &error), SV_EINVAL);
    assert_string_equal(error.field, "options");
    options.width = SV_PREWARP_SIDE_MAX + 1;
    assert_int_equal(sv_prewarp_two_pass(&r, &p, &options, &w, &error), SV_EINVAL);
    options.width = 4;
    assert_int_equal(sv_prewarp_two_pass(&r, &none, &options, &w, &error), SV_EINVAL);
    assert_string_equal(error.field, "prewarp");
    assert_int_equal(w.width, 77);
    struct sv_warped empty = {0};
    sv_warped_finish(&empty);
    sv_relief_finish(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(flat_reliefs_stay),
        cmocka_unit_test(two_pass_against_rays),
        cmocka_unit_test(nearest_surface_wins_on_all_sides),
        cmocka_unit_test(magnified_surfaces_have_no_pin_holes),
        cmocka_unit_test(holes_are_counted_and_filled_from_the_far_side),
        cmocka_unit_test(see_through_texels_are_no_holes),
        cmocka_unit_test(panels_show_the_nearest_on_all_sides),
        cmocka_unit_test(bad_options_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
