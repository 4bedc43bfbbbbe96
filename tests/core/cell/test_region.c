/* test_region.c - M against rays met with planes, predictions against panels moved by brute force in double.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/rng.h"
#include "core/cell/region.h"
#include "core/view/camera.h"

static const double distance_m = 137;

/* Along a face's right, up, forward, m, about V. */
static struct sv_vec3 face_point(enum sv_cell_face face, double x, double y, double z)
{
    struct sv_vec3 right, up, forward;
    sv_cell_face_axes(face, &right, &up, &forward);
    return sv_madd(sv_madd(sv_scale(right, x), up, y), forward, z);
}

/* Whether the line of sight from an eye (m, about V) along `sight` meets the face's plane within the paper's
 * panel. */
static bool on_panel(enum sv_cell_face face, struct sv_vec3 eye, struct sv_vec3 sight)
{
    struct sv_vec3 right, up, forward;
    sv_cell_face_axes(face, &right, &up, &forward);
    double ahead = distance_m - sv_dot(eye, forward), speed = sv_dot(sight, forward);
    if (ahead <= 0 || speed <= 0)
        return false;
    struct sv_vec3 hit = sv_madd(eye, sight, ahead / speed);
    double most = 2 * distance_m * (1 + 1e-12);
    return fabs(sv_dot(hit, right)) <= most && fabs(sv_dot(hit, up)) <= most;
}

static double beyond(struct sv_vec3 e) /* > 0: outside M, by its definition as an intersection of slabs */
{
    double x = fabs(e.x), y = fabs(e.y), z = fabs(e.z);
    return x + y + z - fmin(x, fmin(y, z)) - 1;
}

static struct sv_vec3 random_offset(struct sv_rng *rng, double reach)
{
    return sv_vec3(sv_rng_range(rng, -reach, reach), sv_rng_range(rng, -reach, reach),
                   sv_rng_range(rng, -reach, reach));
}

/* 1,000,000 eyes: inside M every content point of the four wedges is on its panel; outside, for some corner
 * of a wedge at infinity, it is not. */
static void region_m_is_what_panels_hold(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(5, 10);
    int inside = 0, outside = 0;
    for (int t = 0; t < 1000000; t++) {
        struct sv_vec3 e = random_offset(&rng, 1.2), eye = sv_scale(e, distance_m);
        if (fabs(beyond(e)) < 1e-9)
            continue;
        bool in = sv_region_holds(e), all = true;
        assert_int_equal(in, beyond(e) <= 0);
        *(in ? &inside : &outside) += 1;
        enum sv_cell_face face = (enum sv_cell_face)(t % 4);
        double z = distance_m / (1 - sv_rng_unit(&rng)); /* q in (0, 1] */
        double xs = t % 5 ? sv_rng_range(&rng, -1, 1) : 1, ys = t % 3 ? sv_rng_range(&rng, -1, 1) : -1;
        if (in)
            assert_true(on_panel(face, eye, sv_sub(face_point(face, xs * z, ys * z, z), eye)));
        for (int n = 0; n < 16 && !in; n++)
            all = all && on_panel((enum sv_cell_face)(n / 4), eye,
                                  face_point((enum sv_cell_face)(n / 4), n & 1 ? -1 : 1, n & 2 ? -1 : 1, 1));
        assert_true(in || !all);
    }
    assert_true(inside > 100000 && outside > 100000);
    assert_true(sv_region_holds(sv_vec3(0.5, -0.5, 0.5)) && sv_region_holds(sv_vec3(0, 0, -1)));
    assert_false(sv_region_holds(sv_vec3(NAN, 0, 0)) || sv_region_holds(sv_vec3(0, 0, NAN)));
}

/* --- panels moved by brute force --- */

enum { SIDE = 64, GRID = 384 };

struct picture {
    double q[SIDE][SIDE]; /* row 0 at the top */
};

/* Boxes that face the panel before a far backdrop, which alone reaches the rim. */
static void boxes(struct sv_rng *rng, int count, double q_most, struct picture *p)
{
    for (int y = 0; y < SIDE; y++)
        for (int x = 0; x < SIDE; x++)
            p->q[y][x] = 0.05;
    for (int n = 0; n < count; n++) {
        double q = sv_rng_range(rng, 0.15, q_most);
        int x0 = 16 + (int)sv_rng_range(rng, 0, 30), y0 = 16 + (int)sv_rng_range(rng, 0, 30);
        int w = 1 + (int)sv_rng_range(rng, 0, 9), h = 1 + (int)sv_rng_range(rng, 0, 12);
        for (int y = y0; y < y0 + h && y < SIDE - 12; y++)
            for (int x = x0; x < x0 + w && x < SIDE - 12; x++)
                p->q[y][x] = fmax(q, p->q[y][x]);
    }
}

static double edge(int n)
{
    return 2.0 * n / SIDE - 1;
}

static struct sv_cell_jumps jumps_of(const struct picture *p)
{
    struct sv_cell_jumps s = {.texels = SIDE * SIDE};
    for (int y = 0; y < SIDE; y++)
        for (int x = 0; x + 1 < SIDE; x++) {
            double dx = p->q[y][x + 1] - p->q[y][x], dy = p->q[x][y] - p->q[x + 1][y]; /* upward */
            *(dx > 0 ? &s.x_plus : &s.x_minus) += fabs(dx);
            *(dy > 0 ? &s.y_plus : &s.y_minus) += fabs(dy);
            s.xx += fabs(edge(x + 1) * dx);
            s.yy += fabs(edge(x + 1) * dy);
        }
    return s;
}

/* Sample (i, j) lies in square (i, j) of a grid, shifted along each axis by the golden ratio from line to
 * line, so that straight gaps are met as often as they are wide. */
static double shifted(int i, int j)
{
    return i + fmod(j * 0.6180339887498949, 1);
}

static bool within(double at, double low, double high)
{
    return at >= low - 1e-9 && at <= high + 1e-9; /* neighbours at one depth leave no seam */
}

/* Marks the samples in a rectangle, in grid steps. */
static void cover(bool covered[GRID][GRID], const double x[2], const double y[2])
{
    int i0 = (int)fmax(0, floor(x[0]) - 1), i1 = (int)fmin(GRID - 1, x[1]);
    int j0 = (int)fmax(0, floor(y[0]) - 1), j1 = (int)fmin(GRID - 1, y[1]);
    for (int j = j0; j <= j1; j++)
        for (int i = i0; i <= i1; i++)
            covered[j][i] |= within(shifted(i, j), x[0], x[1]) && within(shifted(j, i), y[0], y[1]);
}

/* Share of the picture that no texel covers, seen from the moved eye by a camera aligned with the panel:
 * texels are squares at their depth, the grid spans what the backdrop covers. */
static double holes_by_moving(const struct picture *p, const double e[3])
{
    static bool covered[GRID][GRID];
    memset(covered, 0, sizeof covered);
    double far = p->q[0][0], back = 1 - e[2] * far, step = 2 / back / GRID;
    double left = (-1 - far * e[0]) / back, bottom = (-1 - far * e[1]) / back;
    for (int row = 0; row < SIDE; row++)
        for (int column = 0; column < SIDE; column++) {
            double q = p->q[row][column], near = 1 - e[2] * q, x[2], y[2];
            for (int n = 0; n < 2; n++) {
                x[n] = ((edge(column + n) - q * e[0]) / near - left) / step;
                y[n] = ((-edge(row + 1 - n) - q * e[1]) / near - bottom) / step;
            }
            cover(covered, x, y);
        }
    int holes = 0;
    for (int n = 0; n < GRID * GRID; n++)
        holes += !covered[n / GRID][n % GRID];
    return (double)holes / (GRID * GRID);
}

static const struct sv_region_view view = {443, 512, 512, 1, 0};

/* Spearman's rank correlation of two lists without ties. */
static double rank_correlation(const double *a, const double *b, int count)
{
    double sum = 0;
    for (int n = 0; n < count; n++) {
        int ra = 0, rb = 0;
        for (int m = 0; m < count; m++) {
            ra += a[m] < a[n] || (a[m] == a[n] && m < n);
            rb += b[m] < b[n] || (b[m] == b[n] && m < n);
        }
        sum += (double)(ra - rb) * (ra - rb);
    }
    return 1 - 6 * sum / ((double)count * ((double)count * count - 1));
}

static int by_size(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Two kinds of scene (few boxes, a thicket) and every face: the prediction is above what is measured, at the
 * median at most five times it, and ranks offsets as measured. Slack: shifted samples count a straight gap of
 * 14 texels (84 lines) to about 1 / 84, holes of few samples to a dozen of 147,456. */
static void predicted_holes_bound_those_there_are(void **state)
{
    (void)state;
    enum { OFFSETS = 60 };
    for (int scene = 0; scene < 2; scene++) {
        struct sv_rng rng = sv_rng_seeded(5, 20 + (uint64_t)scene);
        static struct picture p;
        boxes(&rng, scene ? 60 : 6, scene ? 1 : 0.6, &p);
        double predicted[OFFSETS], measured[OFFSETS], ratio[OFFSETS];
        for (int t = 0; t < OFFSETS; t++) {
            struct sv_region_panel panel = {(enum sv_cell_face)(t % SV_CELL_FACES), SIDE, 1, jumps_of(&p)};
            double r = sv_rng_range(&rng, 0.02, 0.25), e[3];
            for (int a = 0; a < 3; a++)
                e[a] = r * sv_rng_range(&rng, -1, 1) * (t % 5 == a || t % 5 > 2);
            struct sv_vec3 offset = face_point(panel.face, e[0], e[1], e[2]);
            predicted[t] = sv_region_predict(&panel, offset, &view).hole_share;
            measured[t] = holes_by_moving(&p, e);
            assert_true(measured[t] <= predicted[t] * 1.02 + 1e-4);
            ratio[t] = predicted[t] / fmax(measured[t], 1e-9);
        }
        assert_true(rank_correlation(predicted, measured, OFFSETS) >= 0.7);
        qsort(ratio, OFFSETS, sizeof *ratio, by_size);
        assert_true(ratio[OFFSETS / 2] <= 5);
    }
}

/* One box: along one axis the prediction is the opened area itself, and each sign opens its own side. */
static void one_edge_is_predicted_exactly(void **state)
{
    (void)state;
    static struct picture p;
    struct sv_rng rng = sv_rng_seeded(5, 30);
    boxes(&rng, 0, 1, &p);
    for (int y = 20; y < 40; y++)
        for (int x = 20; x < 34; x++)
            p.q[y][x] = 0.55;
    struct sv_region_panel panel = {SV_CELL_NORTH, SIDE, 1, jumps_of(&p)};
    for (int t = 0; t < 4; t++) {
        double e[3] = {0};
        e[t / 2] =
            t % 2 ? -0.2 : 0.2; /* moves the box by 0.1 of tangent against the backdrop: 3.2 of 64 texels */
        double opened = 0.5 * 0.2 * (t / 2 ? 14 : 20) * 2 / SIDE / 4;
        double share =
            sv_region_predict(&panel, face_point(SV_CELL_NORTH, e[0], e[1], e[2]), &view).hole_share;
        assert_true(fabs(share - opened) < 1e-12);
        assert_true(fabs(holes_by_moving(&p, e) - opened) < 0.03 * opened);
    }
    panel.jumps.x_minus = 0; /* to the right nothing opens any more, to the left it does */
    assert_true(sv_region_predict(&panel, sv_vec3(0.1, 0, 0), &view).hole_share == 0);
    assert_true(sv_region_predict(&panel, sv_vec3(-0.1, 0, 0), &view).hole_share > 0);
}

/* Any camera, any texel that it sees: sides and places of the texel's square as projected are within what is
 * predicted. Exact: a straight way between two points in view is in view, where tangents stretch by F sec^2
 * of the corner at most. */
static void texels_and_places_are_bounded(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(5, 40);
    int looked = 0;
    double closest = 0;
    for (int t = 0; t < 400000; t++) {
        int size = 8 << t % 8;
        double q_most = t % 3 ? 1 : 1.9;
        struct sv_region_panel panel = {(enum sv_cell_face)(t % SV_CELL_FACES), size, q_most, {.texels = 1}};
        struct sv_region_view looker = {sv_rng_range(&rng, 200, 900), 300 + t % 300, 200 + t % 400, 0, 1};
        struct sv_vec3 offset = random_offset(&rng, 0.3), v = random_offset(&rng, 1000);
        struct sv_camera c = {.eye = sv_madd(v, offset, distance_m),
                              .width = looker.width,
                              .height = looker.height,
                              .near_m = 1e-3,
                              .vfov_rad = 2 * atan(0.5 * looker.height / looker.focal_px)};
        sv_camera_aim(&c, sv_rng_range(&rng, 0, 2 * SV_PI), sv_rng_range(&rng, -1.5, 1.5),
                      sv_rng_range(&rng, -1, 1));
        double h = 1.0 / size, q = sv_rng_range(&rng, 0.01, q_most), kept = round(q * 32768) / 32768;
        double xs = edge(0) + h + 2 * h * floor(sv_rng_range(&rng, 0, size)),
               ys = edge(0) + h + 2 * h * floor(sv_rng_range(&rng, 0, size));
        double dx = t % 2 ? h : sv_rng_range(&rng, -h, h), dy = t % 4 ? h : sv_rng_range(&rng, -h, h);
        const double at[4][3] = {
            {xs, ys, kept}, {xs + dx, ys + dy, q}, {xs - h, ys - h, q}, {xs + h, ys - h, q}};
        double px[4], py[4], depth;
        bool seen = true;
        for (int n = 0; n < 4; n++) {
            double z = distance_m / at[n][2];
            struct sv_vec3 place = sv_add(v, face_point(panel.face, at[n][0] * z, at[n][1] * z, z));
            seen = seen && sv_camera_project(&c, place, &px[n], &py[n], &depth) && px[n] >= 0 && py[n] >= 0 &&
                   px[n] <= c.width && py[n] <= c.height;
        }
        if (!seen)
            continue;
        looked++;
        struct sv_region_error error = sv_region_predict(&panel, offset, &looker);
        double off = hypot(px[1] - px[0], py[1] - py[0]), wide = hypot(px[3] - px[2], py[3] - py[2]);
        assert_true(off <= error.position_px * (1 + 1e-9));
        assert_true(wide <= error.texel_px * (1 + 1e-9));
        assert_true(error.total == error.position_px);
        closest = fmax(closest, off / error.position_px);
    }
    assert_true(looked > 5000 && closest > 0.6); /* it is no idle bound */
}

/* A random eye in r M, by rejection. */
static struct sv_vec3 random_in_m(struct sv_rng *rng, double r)
{
    struct sv_vec3 e = random_offset(rng, 1);
    while (beyond(e) > 0)
        e = random_offset(rng, 1);
    return sv_scale(e, r);
}

static void the_radius_keeps_what_it_says(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(5, 50);
    static struct picture p[SV_CELL_FACES];
    struct sv_region_panel panels[SV_CELL_FACES];
    for (int f = 0; f < SV_CELL_FACES; f++) {
        boxes(&rng, 5 + 10 * f, 1, &p[f]);
        panels[f] = (struct sv_region_panel){(enum sv_cell_face)f, SIDE, 1, jumps_of(&p[f])};
    }
    double last = 0;
    for (int t = 0; t < 12; t++) {
        bool top = t & 1;
        double tolerance = 0.003 * (1 << t / 2),
               r = sv_region_radius(panels, SV_CELL_FACES, top, &view, tolerance);
        assert_true(r > 0 && r < 1 && (top ? r < last : r > last));
        last = top ? 0 : r;
        for (int n = 0; n < 2000; n++) {
            struct sv_vec3 e = random_in_m(&rng, r);
            e.z -= top ? r : 0;
            for (int f = 0; f < SV_CELL_FACES; f++)
                assert_true(sv_region_predict(&panels[f], e, &view).total <= tolerance);
        }
        /* It is the largest: the whole stretch is (1 + r)^2 or (1 - r)^-3 (2 r with V at the top) over what
         * an eye that moves sideways has; within that factor some eye exceeds the tolerance. */
        double worst = 0, factor = top ? pow(1 - 2 * r, -3) : pow(1 - r, -3);
        for (int n = 0; n < 20000; n++) {
            struct sv_vec3 e = random_in_m(&rng, r);
            e.z -= top ? r : 0;
            for (int f = 0; f < SV_CELL_FACES; f++)
                worst = fmax(worst, sv_region_predict(&panels[f], e, &view).total);
        }
        assert_true(worst * factor >= 0.8 * tolerance); /* random eyes miss the corner itself */
    }
    assert_true(sv_region_radius(panels, 0, false, &view, 0.01) > 0.999);
    struct sv_region_view sharp = {443, 512, 512, 1, 1};
    assert_true(sv_region_radius(panels, 1, false, &sharp, 1) == 0); /* texels alone are more than that */
    assert_true(sv_region_radius(panels, 1, false, &view, NAN) == 0);
}

/* Eyes anywhere in cells of that lattice step stay within the tolerance, those of twice the step do not all.
 */
static void cells_are_as_large_as_the_tolerance_bears(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(5, 70);
    static struct picture p[SV_CELL_FACES];
    struct sv_region_panel panels[SV_CELL_FACES];
    double last = 0;
    for (int f = 0; f < SV_CELL_FACES; f++) {
        boxes(&rng, 5 + 10 * f, 1, &p[f]);
        panels[f] = (struct sv_region_panel){(enum sv_cell_face)f, SIDE, 1, jumps_of(&p[f])};
    }
    for (int t = 0; t < 20; t++) {
        double tolerance = 1e-4 * pow(2, t), worst = 0;
        double pitch = sv_region_pitch(panels, SV_CELL_FACES, false, &view, tolerance);
        double power = log2(pitch / SV_REGION_PITCH_LEAST);
        assert_true(power == floor(power) && power >= 0 && pitch <= SV_CELL_PITCH_MAX && pitch >= last);
        last = pitch;
        for (int n = 0; n < 20000; n++) {
            struct sv_vec3 e = random_in_m(&rng, 2 * pitch);
            for (int f = 0; f < SV_CELL_FACES; f++) {
                double within = sv_region_predict(&panels[f], e, &view).total;
                assert_true(within <= tolerance || pitch == SV_REGION_PITCH_LEAST);
                worst = fmax(worst, sv_region_predict(&panels[f], sv_scale(e, 2), &view).total);
            }
        }
        /* The radius is held to the stretch of the whole region, (1 - 4 pitch)^-3 where all of it is looked
         * at. */
        assert_true(2 * pitch > SV_CELL_PITCH_MAX || worst * pow(1 - 4 * pitch, -3) >= 0.8 * tolerance);
    }
    assert_true(last == 8 * SV_REGION_PITCH_LEAST);
    assert_true(sv_region_pitch(panels, SV_CELL_FACES, false, &view, 0) == SV_REGION_PITCH_LEAST);
    assert_true(sv_region_pitch(panels, SV_CELL_FACES, false, &view, NAN) == SV_REGION_PITCH_LEAST);
    assert_true(sv_region_pitch(panels, 0, false, &view, 0.01) == 8 * SV_REGION_PITCH_LEAST);
}

/* No gap in r M is wider than eps, and somewhere it is that wide. Gaps by the two texels' own places. */
static void the_hard_radius_holds_every_gap(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(5, 60);
    for (int t = 0; t < 40; t++) {
        double jump = sv_rng_range(&rng, 0.05, 1), focal = 443, eps = exp(sv_rng_range(&rng, -2, 6));
        double r = sv_region_radius_hard(eps, focal, jump), widest = 0;
        assert_true(r > 0 && r < 1);
        for (int n = 0; n < 20000; n++) {
            struct sv_vec3 e = random_in_m(&rng, r);
            if (n % 50 == 0)
                e = n % 100 ? sv_vec3(0, r, 0) : sv_vec3(0.5 * r, 0.5 * r, 0.5 * r);
            double xs = n % 2 ? -1 : sv_rng_range(&rng, -1, 1);
            double q1 = n % 3 ? 1 : sv_rng_range(&rng, jump, 1), q2 = q1 - jump;
            double gap = focal * fabs((xs - q1 * e.x) / (1 - q1 * e.y) - (xs - q2 * e.x) / (1 - q2 * e.y));
            assert_true(gap <= eps * (1 + 1e-9));
            widest = fmax(widest, gap);
        }
        assert_true(widest >=
                    (1 - r) * eps * 0.99); /* the far texel is not at q = 1: 1 - r is what that leaves */
    }
    static const double rows[][4] = {{0, 443, 1, 0},   {-1, 443, 1, 0}, {NAN, 443, 1, 0},     {1, NAN, 1, 0},
                                     {1, 443, NAN, 0}, {1, 443, 0, 1},  {INFINITY, 443, 1, 1}};
    for (size_t n = 0; n < sizeof rows / sizeof *rows; n++)
        assert_true(sv_region_radius_hard(rows[n][0], rows[n][1], rows[n][2]) == rows[n][3]);
    double tiny = sv_region_radius_hard(1e-12, 443, 1);
    assert_true(fabs(tiny * 443e12 - 1) < 1e-9); /* no cancellation */
}

static void eyes_beyond_have_no_prediction(void **state)
{
    (void)state;
    struct sv_region_panel panel = {SV_CELL_EAST, SIDE, 1, {1, 1, 1, 1, 1, 1, 100}};
    static const double bad[][3] = {{1, 0, 0},   {2, 0, 0},         {NAN, 0, 0},     {0, NAN, 0},
                                    {0, 0, NAN}, {-INFINITY, 0, 0}, {0, INFINITY, 0}};
    for (size_t n = 0; n < sizeof bad / sizeof *bad; n++) {
        struct sv_region_error e = sv_region_predict(&panel, sv_vec3(bad[n][0], bad[n][1], bad[n][2]), &view);
        assert_true(isinf(e.hole_share) && isinf(e.texel_px) && isinf(e.position_px) && isinf(e.total));
    }
    panel.q_most = 2; /* a crown half way to V */
    assert_true(isinf(sv_region_predict(&panel, sv_vec3(0.5, 0, 0), &view).total));
    assert_true(isfinite(sv_region_predict(&panel, sv_vec3(0.49, 0, 0), &view).total));
    panel.jumps.texels = 0;
    assert_true(sv_region_predict(&panel, sv_vec3(0.3, 0.1, 0), &view).hole_share == 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(region_m_is_what_panels_hold),
                                       cmocka_unit_test(predicted_holes_bound_those_there_are),
                                       cmocka_unit_test(one_edge_is_predicted_exactly),
                                       cmocka_unit_test(texels_and_places_are_bounded),
                                       cmocka_unit_test(the_radius_keeps_what_it_says),
                                       cmocka_unit_test(cells_are_as_large_as_the_tolerance_bears),
                                       cmocka_unit_test(the_hard_radius_holds_every_gap),
                                       cmocka_unit_test(eyes_beyond_have_no_prediction)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
