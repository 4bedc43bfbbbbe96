/* test_shadow_page.c - pages of shadow: what is in them against a window of its own there, that neighbours
 * agree on what both hold, which are kept, and that nothing depends on what was asked for before. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/rng.h"
#include "core/terrain/shadow_page.h"

enum { FIELD = 129, SIDE = SV_SHADOW_PAGE_SIDE, STEP = SV_SHADOW_PAGE_STEP, BODIES = 40 };

static float heights[FIELD * FIELD];
static const struct sv_heightfield field = {.width = FIELD,
                                            .height = FIELD,
                                            .x0 = 471230.25,
                                            .y0 = 5203411.5,
                                            .dx = 2,
                                            .dy = 2.5,
                                            .z0 = 800,
                                            .h_min = -12,
                                            .h_max = 12,
                                            .h = heights};
static uint8_t disc[24 * 32];
static struct sv_silhouette body;
static struct sv_vec3 places[BODIES];
static struct sv_shadow_height sun;
static int casts; /* how often the caster was called */

static void cast_bodies(void *context, struct sv_shadow_window *window)
{
    (void)context;
    casts++;
    for (int k = 0; k < BODIES; k++)
        sv_shadow_window_cast(window, &body, places[k], 5);
}

static struct sv_shadow_scene scene(uint64_t key)
{
    return (struct sv_shadow_scene){
        .field = &field, .terrain = &sun, .casters = {{NULL, NULL}, {cast_bodies, NULL}}, .key = key};
}

static int setup(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(5, 5);
    struct sv_error error;
    struct sv_vec3 to_sun = sv_normalize(sv_vec3(0.6, -0.5, 0.45));
    for (int j = 0; j < FIELD; j++)
        for (int i = 0; i < FIELD; i++)
            heights[j * FIELD + i] = (float)(8 * sin(i * 0.13) * cos(j * 0.17) + 2 * sin(i * 0.6 + j * 0.5));
    for (int j = 0; j < 32; j++)
        for (int i = 0; i < 24; i++)
            disc[j * 24 + i] = hypot((i - 11.5) / 12, (j - 15.5) / 16) < 0.95 ? (uint8_t)(90 + 5 * i) : 0;
    struct sv_vec3 right = sv_normalize(sv_cross(sv_vec3(0, 0, 1), to_sun));
    struct sv_vec3 down = sv_scale(sv_cross(to_sun, right), -1);
    body = (struct sv_silhouette){.travel = sv_scale(to_sun, -1),
                                  .right = right,
                                  .down = down,
                                  .corner = sv_add(sv_scale(right, -0.5), sv_scale(down, -1)),
                                  .width = 24,
                                  .height = 32,
                                  .width_m = 1,
                                  .height_m = 1.3,
                                  .first_m = -1,
                                  .coverage = disc};
    for (int k = 0; k < BODIES; k++) {
        double x = sv_rng_range(&rng, field.x0, sv_heightfield_x1(&field)),
               y = sv_rng_range(&rng, field.y0, sv_heightfield_y1(&field)), z = 0;
        assert_true(sv_heightfield_height(&field, x, y, &z));
        places[k] = sv_vec3(x, y, z);
    }
    return sv_shadow_height_make(&sun, &field, to_sun, &error) ? -1 : 0;
}

static int teardown(void **state)
{
    (void)state;
    sv_shadow_height_finish(&sun);
    return 0;
}

static struct sv_shadow_pages *make_pages(uint64_t key)
{
    struct sv_shadow_pages *pages;
    struct sv_error error;
    struct sv_shadow_scene s = scene(key);
    if (sv_shadow_pages_create(&pages, &error))
        fail_msg("%s", error.message);
    sv_shadow_pages_use(pages, &s);
    return pages;
}

/* Every texel of a page is that of a window four times as large which holds the page in its middle. */
static void pages_are_windows(void **state)
{
    (void)state;
    struct sv_shadow_pages *pages = make_pages(1);
    struct sv_shadow_window w;
    struct sv_error error;
    long shaded = 0, texels = 0, off = 0;
    if (sv_shadow_window_alloc(&w, 4 * SIDE, &error))
        fail_msg("%s", error.message);
    for (int level = 0; level < 6; level++)
        for (int round = 0; round < 4; round++) {
            double texel = SV_SHADOW_PAGE_TEXEL_M * (1 << level);
            int across = (int)(250 / (STEP * texel)), i = across > 1 ? (round * 7 + 1) % across : 0,
                j = across > 1 ? (round * 5 + 2) % across : round - 1;
            uint32_t at = sv_shadow_pages_want(pages, level, i, j);
            struct sv_shadow_place place = {field.x0 + (i * STEP - 1 - 3 * SIDE / 2) * texel,
                                            field.y0 + (j * STEP - 1 - 3 * SIDE / 2) * texel, texel};
            sv_shadow_window_fill(&w, &field, &sun, place);
            cast_bodies(NULL, &w);
            const uint8_t *light = sv_shadow_pages_light(pages) + at;
            for (int b = 0; b < SIDE; b++)
                for (int a = 0; a < SIDE; a++) {
                    int got = light[b * SIDE + a],
                        want =
                            w.light[(size_t)(b + 3 * SIDE / 2) * (size_t)w.side + (size_t)(a + 3 * SIDE / 2)];
                    /* Floats count from the page's corner: a grey level, or at the shadow's end a texel. */
                    off += abs(got - want) > 2;
                    shaded += want < 200;
                    texels++;
                }
        }
    assert_true(shaded > texels / 50);
    if (off > texels / 2000)
        fail_msg("%ld of %ld texels are not those of the window", off, texels);
    sv_shadow_window_finish(&w);
    sv_shadow_pages_destroy(pages);
}

/* The last column of a page and the first of the next one stand for the same texels (rows, too). */
static void neighbours_agree(void **state)
{
    (void)state;
    struct sv_shadow_pages *pages = make_pages(1);
    const uint8_t *light = sv_shadow_pages_light(pages);
    long off = 0, all = 0;
    for (int level = 0; level < 3; level++)
        for (int k = 0; k < 3; k++) {
            uint32_t here = sv_shadow_pages_want(pages, level, k, 1),
                     east = sv_shadow_pages_want(pages, level, k + 1, 1),
                     north = sv_shadow_pages_want(pages, level, k, 2);
            for (int a = 0; a < SIDE; a++)
                for (int edge = 0; edge < 2; edge++, all += 2) {
                    off += abs(light[here + a * SIDE + SIDE - 2 + edge] - light[east + a * SIDE + edge]) > 2;
                    off +=
                        abs(light[here + (SIDE - 2 + edge) * SIDE + a] - light[north + edge * SIDE + a]) > 2;
                }
        }
    if (off > all / 500)
        fail_msg("%ld of %ld texels differ from the neighbour's", off, all);
    sv_shadow_pages_destroy(pages);
}

/* A page is filled once while it is wanted; another key, level or place is another page; after
 * SV_SHADOW_PAGES others the one that was wanted longest ago is gone, and comes back with the same bytes. */
static void the_least_lately_used_gives_way(void **state)
{
    (void)state;
    struct sv_shadow_pages *pages = make_pages(1);
    static uint8_t first[SIDE * SIDE];
    uint32_t at = sv_shadow_pages_want(pages, 1, 0, 0);
    memcpy(first, sv_shadow_pages_light(pages) + at, sizeof first);
    casts = 0;
    assert_int_equal(sv_shadow_pages_want(pages, 1, 0, 0), at);
    assert_int_equal(casts, 0);
    struct sv_shadow_scene other = scene(2);
    sv_shadow_pages_use(pages, &other);
    assert_int_not_equal(sv_shadow_pages_want(pages, 1, 0, 0), at);
    assert_int_not_equal(sv_shadow_pages_want(pages, 2, 0, 0), at);
    assert_int_not_equal(sv_shadow_pages_want(pages, 1, -1, 0), at);
    assert_int_equal(casts, 3);
    other = scene(1);
    other.casters[1].cast = NULL; /* what fills the store up */
    other.key = 3;
    sv_shadow_pages_use(pages, &other);
    for (int k = 0; k < SV_SHADOW_PAGES - 5; k++)
        sv_shadow_pages_want(pages, 0, k, 700);
    other = scene(1);
    sv_shadow_pages_use(pages, &other);
    uint64_t filled = sv_shadow_pages_filled(pages);
    assert_int_equal(sv_shadow_pages_want(pages, 1, 0, 0), at); /* still there, and now the latest */
    assert_int_equal(sv_shadow_pages_filled(pages), filled);
    for (int k = 0; k < SV_SHADOW_PAGES; k++)
        sv_shadow_pages_want(pages, 12, k, 3);
    filled = sv_shadow_pages_filled(pages);
    at = sv_shadow_pages_want(pages, 1, 0, 0);
    assert_int_equal(sv_shadow_pages_filled(pages), filled + 1);
    assert_memory_equal(first, sv_shadow_pages_light(pages) + at, sizeof first);
    sv_shadow_pages_destroy(pages);
}

static void finest_level(void **state)
{
    (void)state;
    struct sv_shadow_pages *pages = make_pages(1);
    struct sv_shadow_scene bare = scene(1);
    assert_int_equal(sv_shadow_pages_finest(pages), 0);
    bare.casters[1].cast = NULL;
    sv_shadow_pages_use(pages, &bare);
    assert_int_equal(sv_shadow_pages_finest(pages), 1); /* 2 m / 8 = 0.25 m */
    sv_shadow_pages_destroy(pages);
    sv_shadow_pages_destroy(NULL);
}

/* After whole levels were filled, none of their pages over the field has to be filled again; many casters
 * stop it at coarser ones. */
static void whole_levels(void **state)
{
    (void)state;
    int before = -1;
    for (double casters = 0; casters < 1e7; casters = casters * 30 + BODIES) {
        struct sv_shadow_pages *pages = make_pages(1);
        int level = sv_shadow_pages_fill_whole(pages, casters, SV_SHADOW_PAGES_WHOLE_S);
        uint64_t filled = sv_shadow_pages_filled(pages);
        assert_true(level >= before && filled <= SV_SHADOW_PAGES_WHOLE);
        before = level;
        for (int l = level; l < 8; l++) {
            double side = SV_SHADOW_PAGE_TEXEL_M * (1 << l) * STEP;
            int w = (int)ceil(256 / side), h = (int)ceil(320 / side);
            for (int k = 0; k < w * h && w * h > 1; k++)
                sv_shadow_pages_want(pages, l, k % w, k / w);
        }
        assert_int_equal(sv_shadow_pages_filled(pages), filled);
        sv_shadow_pages_destroy(pages);
    }
    assert_true(before > 2);
}

/* After a change only what it dropped is filled again, and that only where there is time for it. */
static void whole_levels_again(void **state)
{
    (void)state;
    struct sv_shadow_pages *pages = make_pages(1);
    int level = sv_shadow_pages_fill_whole(pages, BODIES, SV_SHADOW_PAGES_WHOLE_S);
    uint64_t filled = sv_shadow_pages_filled(pages);
    assert_true(filled > 20);
    assert_int_equal(sv_shadow_pages_fill_whole(pages, 1e9, 0), level); /* nothing is missing */
    const struct sv_vec3 p = places[0];
    struct sv_shadow_box box = {{p.x - 1, p.y - 1, p.z}, {p.x + 1, p.y + 1, p.z + 5}};
    sv_shadow_pages_drop(pages, 1, sun.to_sun, &field, &box, 1);
    assert_true(sv_shadow_pages_fill_whole(pages, 1e9, 1e-3) > level);
    assert_int_equal(sv_shadow_pages_filled(pages), filled);
    assert_int_equal(sv_shadow_pages_fill_whole(pages, BODIES, SV_SHADOW_PAGES_WHOLE_S), level);
    assert_in_range(sv_shadow_pages_filled(pages) - filled, 1, filled / 2);
    sv_shadow_pages_destroy(pages);
}

/* Shadows of a low sun are longer, and reach more pages: fewer are cast at once. */
static void whole_levels_of_a_low_sun(void **state)
{
    (void)state;
    struct sv_error error;
    struct sv_shadow_height low = {0};
    assert_int_equal(sv_shadow_height_make(&low, &field, sv_normalize(sv_vec3(1, 0, 0.07)), &error), SV_OK);
    const struct sv_shadow_height *const suns[2] = {&sun, &low};
    uint64_t filled[2];
    int level[2];
    for (int k = 0; k < 2; k++) {
        struct sv_shadow_pages *pages = make_pages(1);
        struct sv_shadow_scene lit = scene(1);
        lit.terrain = suns[k];
        sv_shadow_pages_use(pages, &lit);
        level[k] = sv_shadow_pages_fill_whole(pages, 3e5, SV_SHADOW_PAGES_WHOLE_S);
        filled[k] = sv_shadow_pages_filled(pages);
        sv_shadow_pages_destroy(pages);
    }
    assert_true(level[1] > level[0]);
    assert_true(filled[1] > 0 && filled[1] < filled[0]);
    sv_shadow_height_finish(&low);
}

/* ---- refined pages ---- */

/* A source that has some pages: those of its table, each of one grey. */
static struct had {
    int level, i, j;
    uint64_t number;
    uint8_t grey;
} had[64];
static int had_count, reads, written;

static uint64_t read_page(void *context, int level, int i, int j, uint64_t have, uint8_t *light)
{
    assert_ptr_equal(context, had);
    reads++;
    for (int k = 0; k < had_count; k++)
        if (had[k].level == level && had[k].i == i && had[k].j == j) {
            if (had[k].number != have) {
                memset(light, had[k].grey, SIDE * SIDE);
                written++;
            }
            return had[k].number;
        }
    return 0;
}

static struct sv_shadow_scene refined_scene(uint64_t version)
{
    struct sv_shadow_scene s = scene(1);
    s.refined = (struct sv_shadow_source){read_page, had, version};
    return s;
}

static int grey_of(const struct sv_shadow_pages *pages, uint32_t at)
{
    return sv_shadow_pages_light(pages)[at + SIDE * SIDE / 2];
}

/* Of all sets of pages that a source may have of one column of levels: the finest that it has between two
 * levels is taken, by the definition; nothing is built for it. */
static void the_finest_there_is(void **state)
{
    (void)state;
    enum { TOP = 3 };
    const int fi = 5 * 16 + 3, fj = -7 * 16 + 9; /* page of the finest level */
    struct sv_shadow_pages *pages = make_pages(1);
    for (unsigned set = 0; set < 1u << (SV_SHADOW_PAGE_FINER + TOP); set++) {
        had_count = 0;
        for (int level = -SV_SHADOW_PAGE_FINER, bit = 0; level < TOP; level++, bit++)
            if (set >> bit & 1)
                had[had_count++] = (struct had){level, fi >> bit, fj >> bit, 100 + set, (uint8_t)(10 + bit)};
        struct sv_shadow_scene s = refined_scene(set + 1);
        sv_shadow_pages_use(pages, &s);
        for (int level = -SV_SHADOW_PAGE_FINER, bit = 0; level < TOP; level++, bit++)
            for (int last = level; last < TOP; last++) {
                int want = level, found = 99;
                while (want <= last && !(set >> (want + SV_SHADOW_PAGE_FINER) & 1))
                    want++;
                uint64_t lacking = sv_shadow_pages_lacking(pages);
                uint32_t at = sv_shadow_pages_want_refined(pages, level, last, fi >> bit, fj >> bit, &found);
                assert_int_equal(sv_shadow_pages_lacking(pages) - lacking, !(set >> bit & 1));
                assert_true((at == SV_SHADOW_PAGE_NONE) == (want > last));
                if (want <= last) {
                    assert_int_equal(found, want);
                    assert_int_equal(grey_of(pages, at), 10 + found + SV_SHADOW_PAGE_FINER);
                }
            }
    }
    assert_int_equal(sv_shadow_pages_filled(pages), 0);
    sv_shadow_pages_destroy(pages);
}

/* What the source says is asked for once a version; what it has no longer, or has anew, is followed; who uses
 * no source never sees it. */
static void follows_its_source(void **state)
{
    (void)state;
    static uint8_t built[SIDE * SIDE];
    struct sv_shadow_pages *pages = make_pages(1);
    struct sv_shadow_scene plain = scene(1), s = refined_scene(1);
    int found;
    memcpy(built, sv_shadow_pages_light(pages) + sv_shadow_pages_want(pages, 0, 1, 1), sizeof built);
    assert_false(sv_shadow_pages_refines(pages));
    sv_shadow_pages_use(pages, &s);
    assert_true(sv_shadow_pages_refines(pages));
    had_count = reads = written = 0;
    for (int k = 0; k < 3; k++) {
        assert_true(sv_shadow_pages_want_refined(pages, -1, 0, 2, 2, &found) == SV_SHADOW_PAGE_NONE);
        assert_int_equal(reads, 2); /* of two levels */
    }
    had[had_count++] = (struct had){-1, 2, 2, 8, 77};
    assert_true(sv_shadow_pages_want_refined(pages, -1, 0, 2, 2, &found) == SV_SHADOW_PAGE_NONE);
    for (uint64_t version = 2; version < 4; version++) {
        s = refined_scene(version);
        sv_shadow_pages_use(pages, &s);
        for (int k = 0; k < 3; k++) {
            assert_int_equal(grey_of(pages, sv_shadow_pages_want_refined(pages, -1, 0, 2, 2, &found)), 77);
            assert_int_equal(found, -1);
        }
        assert_int_equal(reads, 1 + (int)version);
        assert_int_equal(written, 1);
    }
    had[0].number = 9;
    had[0].grey = 78;
    s = refined_scene(4);
    sv_shadow_pages_use(pages, &s);
    assert_int_equal(grey_of(pages, sv_shadow_pages_want_refined(pages, -1, 0, 2, 2, &found)), 78);
    had[0].level = 0;
    had[0].i = had[0].j = 1;
    s = refined_scene(5);
    sv_shadow_pages_use(pages, &s);
    assert_int_equal(grey_of(pages, sv_shadow_pages_want_refined(pages, -1, 0, 2, 2, &found)), 78);
    assert_int_equal(found, 0);
    uint32_t at = sv_shadow_pages_want(pages, 0, 1, 1); /* built ones are others */
    assert_memory_equal(built, sv_shadow_pages_light(pages) + at, sizeof built);
    sv_shadow_pages_use(pages, &plain);
    assert_int_equal(sv_shadow_pages_want(pages, 0, 1, 1), at);
    had_count = 0;
    s = refined_scene(6);
    sv_shadow_pages_use(pages, &s);
    assert_true(sv_shadow_pages_want_refined(pages, 0, 0, 1, 1, &found) == SV_SHADOW_PAGE_NONE);
    sv_shadow_pages_destroy(pages);
}

/* Pages that come and go by the hundred, refined ones among built ones: what is given back is right, and a
 * page that was emptied is room again. */
static void refined_pages_give_way_too(void **state)
{
    (void)state;
    struct sv_shadow_pages *pages = make_pages(1);
    struct sv_rng rng = sv_rng_seeded(17, 0);
    for (uint64_t version = 1; version < 400; version++) {
        had_count = 0;
        for (int k = 0; k < 64; k++)
            if (sv_rng_next(&rng) % 2)
                had[had_count++] =
                    (struct had){-2, k, 3, 1 + version % 3, (uint8_t)(k + 100 * (version % 3 == 1))};
        struct sv_shadow_scene s = refined_scene(version);
        s.casters[1].cast = NULL; /* quickly built */
        s.refined.version = version;
        sv_shadow_pages_use(pages, &s);
        for (int n = 0; n < 100; n++) {
            int i = (int)(sv_rng_next(&rng) % 64), found;
            uint32_t at = sv_shadow_pages_want_refined(pages, -2, 0, i, 3, &found);
            bool has = false;
            for (int k = 0; k < had_count; k++)
                has |= had[k].i == i;
            assert_true(has == (at != SV_SHADOW_PAGE_NONE));
            if (has)
                assert_int_equal(grey_of(pages, at), i + 100 * (version % 3 == 1));
            if (n % 4 == 0)
                sv_shadow_pages_want(pages, 2, (int)(sv_rng_next(&rng) % 6000), 5);
        }
    }
    sv_shadow_pages_destroy(pages);
}

/* Wishes are noted once each, as many as there is room for. */
static void wishes_are_noted(void **state)
{
    (void)state;
    struct sv_shadow_pages *pages = make_pages(1);
    struct sv_shadow_scene s = refined_scene(1);
    struct sv_shadow_wish list[4];
    struct sv_shadow_wishes wishes = {.list = list, .room = 4};
    int found;
    had[0] = (struct had){-1, 0, 0, 5, 1};
    had_count = 1;
    sv_shadow_pages_use(pages, &s);
    (void)sv_shadow_pages_want_refined(pages, -1, 0, 9, 9, &found);
    sv_shadow_pages_note(pages, &wishes);
    for (int k = 0; k < 60; k++)
        (void)sv_shadow_pages_want_refined(pages, -1, 0, k % 6, 0,
                                           &found); /* those that the source has, too */
    sv_shadow_pages_note(pages, NULL);
    (void)sv_shadow_pages_want_refined(pages, -1, 0, 0, 0, &found);
    assert_int_equal(wishes.count, 4);
    for (int k = 0; k < 4; k++) {
        assert_int_equal(list[k].level, -1);
        assert_int_equal(list[k].i, k);
        assert_int_equal(list[k].count, 10);
    }
    sv_shadow_pages_destroy(pages);
}

/* The rule of what is dropped against points of the box, thrown along the light to heights at which ground
 * is. */
static void what_a_shadow_falls_on(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(23, 0);
    int hit = 0, clear = 0;
    for (int t = 0; t < 3000; t++) {
        double azimuth = sv_rng_range(&rng, 0, 6.3), elevation = sv_rng_range(&rng, 0.1, 1.5);
        struct sv_vec3 to_sun =
            sv_vec3(cos(elevation) * cos(azimuth), cos(elevation) * sin(azimuth), sin(elevation));
        double x = sv_rng_range(&rng, 0, 200), y = sv_rng_range(&rng, 0, 200), r = sv_rng_range(&rng, 0.1, 4);
        struct sv_shadow_box box = {{field.x0 + x - r, field.y0 + y - r, 790},
                                    {field.x0 + x + r, field.y0 + y + r, 800 + sv_rng_range(&rng, 0, 20)}};
        int level = t % 9 - 4, side = (int)(200 / (ldexp(SV_SHADOW_PAGE_TEXEL_M, level) * STEP)) + 1,
            i = (int)(sv_rng_next(&rng) % (unsigned)side), j = (int)(sv_rng_next(&rng) % (unsigned)side);
        struct sv_shadow_place at = sv_shadow_page_place(&field, level, i, j);
        bool falls = false, said = sv_shadow_page_meets(&field, to_sun, &box, level, i, j);
        for (int n = 0; n < 300 && !falls; n++) {
            struct sv_vec3 p = sv_vec3(sv_rng_range(&rng, box.min[0], box.max[0]),
                                       sv_rng_range(&rng, box.min[1], box.max[1]),
                                       sv_rng_range(&rng, box.min[2], box.max[2]));
            double ground = sv_rng_range(&rng, 788, p.z < 812 ? p.z : 812);
            p = sv_madd(p, to_sun, -(p.z - ground) / to_sun.z);
            double a = (p.x - at.x0) / at.texel_m, b = (p.y - at.y0) / at.texel_m;
            falls = ground >= 788 && a >= 0 && b >= 0 && a <= SIDE && b <= SIDE;
        }
        assert_true(said || !falls);
        hit += falls;
        clear += !said;
    }
    assert_true(hit > 200 && clear > 1000);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pages_are_windows),
        cmocka_unit_test(neighbours_agree),
        cmocka_unit_test(the_least_lately_used_gives_way),
        cmocka_unit_test(finest_level),
        cmocka_unit_test(whole_levels),
        cmocka_unit_test(whole_levels_again),
        cmocka_unit_test(whole_levels_of_a_low_sun),
        cmocka_unit_test(the_finest_there_is),
        cmocka_unit_test(follows_its_source),
        cmocka_unit_test(refined_pages_give_way_too),
        cmocka_unit_test(wishes_are_noted),
        cmocka_unit_test(what_a_shadow_falls_on),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
