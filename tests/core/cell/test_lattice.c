/* test_lattice.c - the lattice held to its definition: nearest point by search, cells by their inequalities,
 * rings by counting in how many a segment is. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/rng.h"
#include "core/cell/lattice.h"
#include "core/view/camera.h"

static struct sv_cell_rings rings_of(double outer_m, double inner_m, double pitch)
{
    struct sv_cell_rings rings;
    sv_cell_rings_make(outer_m, inner_m, pitch, &rings);
    assert_true(rings.count > 0);
    return rings;
}

static const double reaches_m[] = {1, 300, 1e7}; /* of random eyes; the last as UTM northings are */
enum { REACHES = sizeof reaches_m / sizeof *reaches_m };

static struct sv_vec3 random_point(struct sv_rng *rng, double reach_m)
{
    return sv_vec3(sv_rng_range(rng, -reach_m, reach_m), sv_rng_range(rng, -reach_m, reach_m),
                   sv_rng_range(rng, -reach_m, reach_m));
}

static void rings_halve_to_the_one_nearest_inner(void **state)
{
    (void)state;
    static const struct {
        double outer, inner;
        int count;
        double first;
    } rows[] = {{100, 6, 5, 6.25},          {100, 1.5, 7, 1.5625}, {100, 100, 1, 100},
                {100, 900, 1, 100},         {200, 6, 6, 6.25},     {90, 6, 5, 5.625},
                {1e6, 1e-6, 12, 488.28125}, {100, 70, 2, 50},      {100, 71, 1, 100}};
    for (size_t k = 0; k < sizeof rows / sizeof *rows; k++) {
        struct sv_cell_rings r = rings_of(rows[k].outer, rows[k].inner, 0.1);
        assert_int_equal(r.count, rows[k].count);
        assert_true(r.distance_m[0] == rows[k].first && r.distance_m[r.count - 1] == rows[k].outer);
        for (int j = 1; j < r.count; j++)
            assert_true(r.distance_m[j] == 2 * r.distance_m[j - 1]);
    }
    static const double bad[][3] = {{0, 6, 0.1},    {-1, 6, 0.1},    {NAN, 6, 0.1},        {INFINITY, 6, 0.1},
                                    {100, 0, 0.1},  {100, NAN, 0.1}, {100, INFINITY, 0.1}, {100, 6, 0},
                                    {100, 6, -0.1}, {100, 6, 0.26},  {100, 6, NAN}};
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        struct sv_cell_rings r;
        sv_cell_rings_make(bad[k][0], bad[k][1], bad[k][2], &r);
        assert_int_equal(r.count, 0);
    }
}

/* Squared distance in steps from u to the nearest lattice point, by search of all within two of its cube. */
static double nearest_by_search(const double u[3])
{
    double best = INFINITY;
    for (int code = 0; code < 125; code++) {
        const double n[3] = {floor(u[0]) + code % 5 - 2, floor(u[1]) + code / 5 % 5 - 2,
                             floor(u[2]) + code / 25 - 2};
        if (fmod(n[0] + n[1] + n[2], 2) != 0)
            continue;
        double d = 0;
        for (int a = 0; a < 3; a++)
            d += (u[a] - n[a]) * (u[a] - n[a]);
        best = fmin(best, d);
    }
    return best;
}

/* An eye's cell: the nearest point of the lattice, and the eye within its dodecahedron. Rounding: eye / step
 * and index * step each to 2^-53 of the coordinate, so offsets are off by at most 4 * 2^-53 * reach. */
static void an_eye_belongs_to_the_nearest_point(void **state)
{
    (void)state;
    struct sv_cell_rings rings = rings_of(100, 6, 0.11);
    double s = rings.pitch * rings.distance_m[0];
    struct sv_rng rng = sv_rng_seeded(5, 1);
    for (int t = 0; t < 30000; t++) {
        double reach = reaches_m[t % REACHES], off = 4 * 0x1p-53 * reach / s;
        struct sv_vec3 eye = random_point(&rng, reach);
        struct sv_cell_place chain[SV_CELL_RINGS_MAX];
        assert_true(sv_cell_chain(&rings, eye, false, chain));
        assert_int_equal((chain[0].i + chain[0].j + chain[0].k) & 1, 0);
        struct sv_vec3 d = sv_scale(sv_sub(eye, chain[0].v), 1 / s);
        const double u[3] = {eye.x / s, eye.y / s, eye.z / s};
        assert_true(sv_dot(d, d) <= nearest_by_search(u) + 8 * off + 1e-14);
        double x = fabs(d.x), y = fabs(d.y), z = fabs(d.z), most = 1 + 2 * off + 1e-14;
        assert_true(x + y <= most && x + z <= most && y + z <= most);
    }
}

/* Points on faces, edges and corners of cells (multiples of a half step): one legal owner, the same every
 * time, and for every translation of the lattice onto itself the same one, moved along. */
static void ties_go_one_way(void **state)
{
    (void)state;
    struct sv_cell_rings rings =
        rings_of(64, 8, 0.0625); /* steps are powers of two: every product is exact */
    double s = rings.pitch * rings.distance_m[0];
    int ties = 0;
    for (int code = 0; code < 9 * 9 * 9; code++) {
        const double u[3] = {0.5 * (code % 9 - 4), 0.5 * (code / 9 % 9 - 4), 0.5 * (code / 81 - 4)};
        struct sv_cell_place here[SV_CELL_RINGS_MAX], again[SV_CELL_RINGS_MAX], moved[SV_CELL_RINGS_MAX];
        struct sv_vec3 eye = sv_vec3(u[0] * s, u[1] * s, u[2] * s);
        assert_true(sv_cell_chain(&rings, eye, false, here) && sv_cell_chain(&rings, eye, false, again));
        assert_memory_equal(here, again, (size_t)rings.count * sizeof *here);
        struct sv_vec3 d = sv_scale(sv_sub(eye, here[0].v), 1 / s);
        assert_true(sv_dot(d, d) == nearest_by_search(u));
        ties += fabs(d.x) + fabs(d.y) == 1 || fabs(d.x) + fabs(d.z) == 1 || fabs(d.y) + fabs(d.z) == 1;
        assert_true(sv_cell_chain(&rings, sv_add(eye, sv_vec3(1e6 * s, -3e6 * s, 7e6 * s)), false, moved));
        assert_true(moved[0].i == here[0].i + 1000000 && moved[0].j == here[0].j - 3000000 &&
                    moved[0].k == here[0].k + 7000000);
    }
    assert_true(ties > 300);
}

static void assert_in_cell(struct sv_vec3 d, double size)
{
    double x = fabs(d.x), y = fabs(d.y), z = fabs(d.z);
    assert_true(x + y <= size && x + z <= size && y + z <= size);
}

/* The distance bounds of the header, nesting, and that a chain is a function of each of its places. */
static void chains_stay_near_and_nest(void **state)
{
    (void)state;
    static const double pitches[] = {0.03, 0.0625, SV_CELL_PITCH_MAX};
    struct sv_rng rng = sv_rng_seeded(5, 2);
    for (int t = 0; t < 30000; t++) {
        struct sv_cell_rings rings = rings_of(100, 1.5, pitches[t % 3]);
        bool top = t / 3 % 2;
        struct sv_vec3 eye = random_point(&rng, reaches_m[t / 6 % REACHES]);
        struct sv_cell_place chain[SV_CELL_RINGS_MAX];
        assert_true(sv_cell_chain(&rings, eye, top, chain));
        for (int r = 0; r < rings.count; r++) {
            double distance = rings.distance_m[r], s = rings.pitch * distance, slack = 1e-8;
            struct sv_vec3 d = sv_sub(eye, chain[r].v);
            double cells = (2 - ldexp(1, -r)) * s; /* the chain's, added up */
            d.z += top ? cells : 0;
            assert_in_cell(d, cells + slack);
            struct sv_cell_place same = sv_cell_place_at(&rings, r, chain[r].i, chain[r].j, chain[r].k, top);
            assert_memory_equal(&same, &chain[r], sizeof same);
            if (r + 1 == rings.count)
                continue;
            same = sv_cell_next(&rings, &chain[r], top);
            assert_memory_equal(&same, &chain[r + 1], sizeof same);
            struct sv_vec3 e = sv_sub(chain[r].v, chain[r + 1].v);
            double reach = fmax(fabs(e.x), fmax(fabs(e.y), fabs(e.z)));
            assert_true(reach + distance < rings.distance_m[r + 1]); /* cubes nest */
            e.z += top ? 2 * s : 0; /* V_j in the outer cell, about its centre */
            assert_in_cell(e, 2 * s + slack);
        }
    }
}

static void coordinates_that_are_none_are_refused(void **state)
{
    (void)state;
    struct sv_cell_rings rings = rings_of(100, 6, 0.1), none = {0};
    struct sv_cell_place chain[SV_CELL_RINGS_MAX], before[SV_CELL_RINGS_MAX];
    memset(chain, 0x5a, sizeof chain);
    memcpy(before, chain, sizeof chain);
    static const double bad[] = {NAN, INFINITY, -INFINITY, 1e300, -1e12};
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        assert_false(sv_cell_chain(&rings, sv_vec3(bad[k], 0, 0), false, chain));
        assert_false(sv_cell_chain(&rings, sv_vec3(0, bad[k], 0), true, chain));
        assert_false(sv_cell_chain(&rings, sv_vec3(0, 0, bad[k]), true, chain));
    }
    assert_false(sv_cell_chain(&none, sv_vec3(0, 0, 0), false, chain));
    assert_memory_equal(chain, before, sizeof chain);
}

/* Chebyshev distance from v to an upright segment, by its ends and the nearest of many points between. */
static double distance_by_walk(struct sv_vec3 v, struct sv_vec3 foot, double height_m)
{
    double best = INFINITY;
    for (int n = 0; n <= 1000; n++) {
        struct sv_vec3 d = sv_sub(sv_vec3(foot.x, foot.y, foot.z + height_m * n / 1000), v);
        best = fmin(best, fmax(fabs(d.x), fmax(fabs(d.y), fabs(d.z))));
    }
    return best;
}

static void a_cube_holds_what_meets_it(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(5, 3);
    int inside = 0, outside = 0;
    for (int t = 0; t < 5000; t++) {
        struct sv_vec3 v = random_point(&rng, reaches_m[t % REACHES]),
                       foot = sv_add(v, random_point(&rng, 30));
        double height = t % 7 ? sv_rng_range(&rng, 0, 40) : 0, d = distance_by_walk(v, foot, height),
               side = 15;
        if (fabs(d - side) <= height / 1000 + 1e-8) /* the walk's own error */
            continue;
        assert_int_equal(sv_cell_in_cube(v, side, foot, height), d <= side);
        inside += d <= side;
        outside += d > side;
    }
    assert_true(inside > 500 && outside > 500);
    assert_true(sv_cell_in_cube(sv_vec3(0, 0, 0), 2, sv_vec3(2, -2, -5), 3)); /* touches an edge: closed */
    assert_false(sv_cell_in_cube(sv_vec3(0, 0, 0), 2, sv_vec3(2, -2, -5), 2.9));
    assert_false(sv_cell_in_cube(sv_vec3(0, 0, 0), 2, sv_vec3(NAN, 0, 0), 1));
    assert_false(sv_cell_in_cube(sv_vec3(0, 0, 0), 2, sv_vec3(0, 0, 0), NAN));
}

/* Every segment is near or in exactly one shell, however it stands; shells are asked one by one. */
static void every_segment_is_in_one_ring(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(5, 4);
    int seen[SV_CELL_RINGS_MAX + 1] = {0};
    for (int t = 0; t < 300; t++) {
        struct sv_cell_rings rings = rings_of(100, 6, t % 2 ? 0.05 : SV_CELL_PITCH_MAX);
        bool top = t / 2 % 2;
        struct sv_vec3 eye = random_point(&rng, reaches_m[t / 4 % REACHES]);
        struct sv_cell_place chain[SV_CELL_RINGS_MAX];
        assert_true(sv_cell_chain(&rings, eye, top, chain));
        for (int n = 0; n < 300; n++) {
            double reach = exp(sv_rng_range(&rng, log(2), log(400)));
            struct sv_vec3 foot = sv_add(eye, random_point(&rng, reach));
            if (n % 3 == 0) /* exactly on a cube's plane */
                foot.x = chain[n % rings.count].v.x + rings.distance_m[n % rings.count];
            double height = sv_rng_range(&rng, 0, 45), crown = n % 2 ? sv_rng_range(&rng, 0, 20) : 0;
            double near =
                rings.distance_m[0] + fmax(fmin(crown - rings.distance_m[0] / 2, rings.distance_m[0] / 2), 0);
            int found = sv_cell_in_cube(chain[0].v, near, foot, height), ring = SV_CELL_NEAR;
            for (int r = 0; r < rings.count; r++) {
                struct sv_cell_shell shell = sv_cell_shell(&rings, &chain[r], top);
                if (!sv_cell_in_shell(&shell, foot, height, crown))
                    continue;
                ring = r;
                found++;
            }
            assert_int_equal(found, 1);
            assert_int_equal(sv_cell_ring_of(&rings, chain, foot, height, crown), ring);
            seen[ring + 1]++;
        }
        assert_int_equal(sv_cell_ring_of(&rings, chain, sv_vec3(NAN, 0, 0), 1, 0), rings.count - 1);
    }
    for (int r = 0; r < 6; r++)
        assert_true(seen[r] > 1000);
}

/* Where panels show nothing (nearer than half way to V) no crown of theirs reaches, unless it is larger than
 * D. */
static void crowns_keep_half_the_distance(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(5, 9);
    int close = 0;
    for (int t = 0; t < 200000; t++) {
        struct sv_cell_shell shell = {
            .v = random_point(&rng, 1e5), .distance_m = sv_rng_range(&rng, 1, 50), .outer_m = INFINITY};
        double d = shell.distance_m, crown = sv_rng_range(&rng, 0, d), height = sv_rng_range(&rng, 0, 3 * d);
        struct sv_vec3 foot = sv_add(shell.v, random_point(&rng, 2.5 * d)), off = sv_sub(foot, shell.v);
        if (!sv_cell_in_shell(&shell, foot, height, crown))
            continue;
        double beside = fmax(fabs(off.x), fabs(off.y)) - crown, apart = fmax(off.z, -(off.z + height));
        assert_true(fmax(beside, apart) >= 0.5 * d - 1e-9);
        close += crown > 0.5 * d && fmax(beside, apart) < 0.6 * d;
    }
    assert_true(close > 1000);
}

/* By a grid of points of the box: whether one is in the pyramid, one out of the inner cube, and one in the
 * outer. */
static bool seen_by_search(const struct sv_cell_shell *shell, enum sv_cell_face face,
                           const struct sv_vec3 box[2])
{
    struct sv_vec3 right, up, forward;
    sv_cell_face_axes(face, &right, &up, &forward);
    bool in_pyramid = false, out_of_cube = false, in_outer = isinf(shell->outer_m);
    for (int n = 0; n < 9 * 9 * 9; n++) {
        const double at[3] = {n % 9 / 8.0, n / 9 % 9 / 8.0, n / 81 / 8.0};
        struct sv_vec3 p =
            sv_vec3(box[0].x + at[0] * (box[1].x - box[0].x), box[0].y + at[1] * (box[1].y - box[0].y),
                    box[0].z + at[2] * (box[1].z - box[0].z));
        struct sv_vec3 d = sv_sub(p, shell->v);
        double ahead = sv_dot(d, forward);
        in_pyramid |= ahead >= fabs(sv_dot(d, right)) && ahead >= fabs(sv_dot(d, up));
        out_of_cube |= !sv_cell_in_cube(shell->v, shell->distance_m, p, 0);
        in_outer |= sv_cell_in_cube(shell->outer_v, shell->outer_m, p, 0);
    }
    return in_pyramid && out_of_cube && in_outer;
}

/* No box that shows is missed; and few that do not are taken for such (a grid finds no slivers, and a box may
 * pass all four planes of a pyramid that it misses). */
static void boxes_that_show_are_seen(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(5, 6);
    struct sv_cell_rings rings = rings_of(100, 6, 0.1);
    int seen = 0, unseen = 0, mistaken = 0;
    struct sv_cell_place chain[SV_CELL_RINGS_MAX];
    for (int t = 0; t < 6000; t++) {
        struct sv_vec3 eye = random_point(&rng, reaches_m[t % REACHES]), box[2];
        assert_true(sv_cell_chain(&rings, eye, t % 2, chain));
        struct sv_cell_shell shell = sv_cell_shell(&rings, &chain[t % rings.count], t % 2);
        box[0] = sv_add(eye, random_point(&rng, 2.5 * shell.distance_m));
        box[1] =
            sv_add(box[0], sv_scale(sv_add(random_point(&rng, 1), sv_vec3(1, 1, 1)), 0.4 * shell.distance_m));
        enum sv_cell_face face = (enum sv_cell_face)(t % SV_CELL_FACES);
        bool shows = seen_by_search(&shell, face, box), said = sv_cell_sees_box(&shell, face, box[0], box[1]);
        assert_true(said || !shows);
        seen += shows;
        unseen += !said;
        mistaken += said && !shows;
    }
    assert_true(seen > 300 && unseen > 3000 && mistaken * 5 < seen);
    assert_true(sv_cell_chain(&rings, sv_vec3(0, 0, 0), false, chain));
    struct sv_cell_shell shell = sv_cell_shell(&rings, &chain[0], false);
    struct sv_vec3 inside = sv_vec3(-1, -1, -1), top = sv_vec3(1, 1, 1);
    assert_false(sv_cell_sees_box(&shell, SV_CELL_EAST, inside, top));
    for (int n = 0; n < 6; n++) {
        struct sv_vec3 box[2] = {inside, top};
        *(n % 3 == 0 ? &box[n / 3].x : n % 3 == 1 ? &box[n / 3].y : &box[n / 3].z) = NAN;
        assert_true(sv_cell_sees_box(&shell, SV_CELL_EAST, box[0], box[1]));
    }
}

static void faces_are_cameras(void **state)
{
    (void)state;
    static const double turns[SV_CELL_FACES][2] = {
        [SV_CELL_EAST] = {90, 0},   [SV_CELL_NORTH] = {0, 0},  [SV_CELL_WEST] = {270, 0},
        [SV_CELL_SOUTH] = {180, 0}, [SV_CELL_DOWN] = {0, -90}, [SV_CELL_UP] = {0, 90}};
    for (int f = 0; f < SV_CELL_FACES; f++) {
        struct sv_vec3 axes[3];
        struct sv_camera c = {0};
        sv_camera_aim(&c, sv_radians(turns[f][0]), sv_radians(turns[f][1]), 0);
        sv_cell_face_axes((enum sv_cell_face)f, &axes[0], &axes[1], &axes[2]);
        assert_true(sv_length(sv_sub(axes[0], c.right)) < 1e-15 * 4); /* pi is rounded in the camera */
        assert_true(sv_length(sv_sub(axes[1], c.up)) < 1e-15 * 4);
        assert_true(sv_length(sv_sub(axes[2], c.forward)) < 1e-15 * 4);
    }
}

/* Changes the n-th part of what makes a key; false when there is none. */
static bool vary(int n, struct sv_cell_rings *rings, struct sv_cell_key_parts *p)
{
    struct sv_cell_place *at = &p->place;
    switch (n) {
    case 0:
        *at = sv_cell_place_at(rings, at->ring, at->i + 1, at->j + 1, at->k, true);
        return true;
    case 1:
        *at = sv_cell_place_at(rings, at->ring, at->i, at->j - 1, at->k + 1, true);
        return true;
    case 2:
        *at = sv_cell_place_at(rings, at->ring + 1, at->i, at->j, at->k, true);
        return true;
    case 3:
        *at = sv_cell_place_at(rings, at->ring, at->i, at->j, at->k, false);
        return true;
    case 4:
        p->face = SV_CELL_WEST;
        return true;
    case 5:
        p->size = 512;
        return true;
    case 6:
        p->layer = 1;
        return true;
    case 7:
        p->light++;
        return true;
    case 8:
        p->scene++;
        return true;
    case 9:
        *rings = rings_of(100, 6, 0.0625);
        *at = sv_cell_place_at(rings, at->ring, at->i, at->j, at->k, true);
        return true;
    case 10:
        *rings = rings_of(120, 6, 0.1);
        *at = sv_cell_place_at(rings, at->ring, at->i, at->j, at->k, true);
        return true;
    case 11:
        rings->count--;
        return true; /* the ring is the last now: it has no outer cube */
    }
    return false;
}

static int by_value(const void *a, const void *b)
{
    uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

static void keys_differ_where_panels_do(void **state)
{
    (void)state;
    uint64_t keys[32];
    int count = 0;
    for (int n = -1; n < 32; n++) {
        struct sv_cell_rings rings = rings_of(100, 6, 0.1);
        struct sv_cell_key_parts parts = {
            sv_cell_place_at(&rings, 3, -70, 5, 3, true), SV_CELL_NORTH, 0, 1024, 7, 9};
        if (n >= 0 && !vary(n, &rings, &parts))
            break;
        keys[count++] = sv_cell_key(&rings, &parts);
        assert_true(keys[count - 1] == sv_cell_key(&rings, &parts) && keys[count - 1] != 0);
    }
    assert_int_equal(count, 13);
    for (int a = 0; a < count; a++)
        for (int b = 0; b < a; b++)
            assert_true(keys[a] != keys[b]);
}

/* 200,000 neighbours in a block of space: not one pair alike (a random 64-bit hash has one with chance 1e-9).
 */
static void keys_of_neighbours_do_not_meet(void **state)
{
    (void)state;
    enum { SIDE = 32 };
    struct sv_cell_rings rings = rings_of(100, 6, 0.1);
    size_t count = 0, most = (size_t)SIDE * SIDE * SIDE / 2 * SV_CELL_FACES * 2;
    uint64_t *keys = malloc(most * sizeof *keys);
    assert_non_null(keys);
    for (int n = 0; n < SIDE * SIDE * SIDE; n++) {
        int i = n % SIDE - SIDE / 2, j = n / SIDE % SIDE - SIDE / 2, k = n / SIDE / SIDE - SIDE / 2;
        for (int f = 0; (i + j + k) % 2 == 0 && f < 2 * SV_CELL_FACES; f++) {
            struct sv_cell_key_parts parts = {sv_cell_place_at(&rings, f / SV_CELL_FACES, i, j, k, true),
                                              (enum sv_cell_face)(f % SV_CELL_FACES),
                                              0,
                                              1024,
                                              7,
                                              9};
            keys[count++] = sv_cell_key(&rings, &parts);
        }
    }
    assert_int_equal(count, most);
    qsort(keys, count, sizeof *keys, by_value);
    for (size_t n = 1; n < count; n++)
        assert_true(keys[n] != keys[n - 1]);
    free(keys);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(rings_halve_to_the_one_nearest_inner),
                                       cmocka_unit_test(an_eye_belongs_to_the_nearest_point),
                                       cmocka_unit_test(ties_go_one_way),
                                       cmocka_unit_test(chains_stay_near_and_nest),
                                       cmocka_unit_test(coordinates_that_are_none_are_refused),
                                       cmocka_unit_test(a_cube_holds_what_meets_it),
                                       cmocka_unit_test(every_segment_is_in_one_ring),
                                       cmocka_unit_test(crowns_keep_half_the_distance),
                                       cmocka_unit_test(boxes_that_show_are_seen),
                                       cmocka_unit_test(faces_are_cameras),
                                       cmocka_unit_test(keys_differ_where_panels_do),
                                       cmocka_unit_test(keys_of_neighbours_do_not_meet)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
