/* Ladder: errors in px of known displacement, what they do with size, and the choice they lead to. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/color.h"
#include "core/base/store.h"
#include "core/tree/ladder.h"
#include "tests/core/tree/draw_fixture.h"

static struct sv_tree_mesh leafy, bare;
static struct sv_sprite_draw *sprites;
static struct sv_leaf_splat *leaves;
static struct sv_tree_draw_species species[2];

static int setup(void **state)
{
    (void)state;
    struct sv_error error;
    sv_color_init();
    fixture_tree(3000, 7, &leafy);
    fixture_tree(0, 7, &bare);
    species[0] = (struct sv_tree_draw_species){&leafy, 11, 1};
    species[1] = (struct sv_tree_draw_species){&bare, 12, 1};
    fixture_ok(sv_sprite_draw_create(species, 2, NULL, &sprites, &error), &error);
    fixture_ok(sv_leaf_splat_create(species, 2, &leaves, &error), &error);
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    sv_leaf_splat_destroy(leaves);
    sv_sprite_draw_destroy(sprites);
    sv_tree_mesh_finish(&leafy);
    sv_tree_mesh_finish(&bare);
    return 0;
}

static struct sv_ladder made_up(float sprite, float sprite_step, float leaf)
{
    struct sv_ladder ladder;
    for (int k = 0; k < SV_LADDER_SIZES; k++) {
        ladder.error_px[k][SV_LADDER_SPRITE] = sprite + sprite_step * (float)k;
        ladder.error_px[k][SV_LADDER_LEAF] = leaf;
    }
    return ladder;
}

static void errors_lie_between_rungs(void **state)
{
    (void)state;
    struct sv_ladder ladder = made_up(0.25f, 0.25f, 0.5f);
    assert_true(sv_ladder_size_px(1) == 2 * sv_ladder_size_px(0));
    for (int k = 0; k < SV_LADDER_SIZES; k++) /* at a rung: its own value */
        assert_true(fabs(sv_ladder_error_px(&ladder, SV_LADDER_SPRITE, (double)sv_ladder_size_px(k)) -
                         (0.25 + 0.25 * k)) < 1e-6);
    double between = (double)sv_ladder_size_px(2) * sqrt(2);
    assert_true(fabs(sv_ladder_error_px(&ladder, SV_LADDER_SPRITE, between) - (0.25 + 0.25 * 2.5)) < 1e-6);
    static const double small[] = {0, -1, NAN, 1e-30, 3};
    for (size_t k = 0; k < sizeof small / sizeof small[0]; k++)
        assert_true(sv_ladder_error_px(&ladder, SV_LADDER_SPRITE, small[k]) == 0.25);
    double last = (double)sv_ladder_size_px(SV_LADDER_SIZES - 1), top = 0.25 * SV_LADDER_SIZES;
    assert_true(fabs(sv_ladder_error_px(&ladder, SV_LADDER_SPRITE, 4 * last) - 2 * top) < 1e-6);
    assert_true(sv_ladder_error_px(&ladder, SV_LADDER_LEAF, 4 * last) == 0.5);
}

static void leaves_begin_where_sprites_are_off(void **state)
{
    (void)state;
    struct sv_ladder ladder = made_up(0.5f, 0.5f, 0.1f); /* 1 px at rung 1, 1.5 px at rung 2 */
    double near = sv_ladder_near_px(&ladder, 1.5);
    assert_true(near >= (double)sv_ladder_size_px(2) / 1.05 && near <= (double)sv_ladder_size_px(2) * 1.05);
    assert_true(sv_ladder_near_px(&ladder, 1) < near && sv_ladder_near_px(&ladder, 2) > near);
    struct sv_ladder good = made_up(0.1f, 0, 0.05f), no_better = made_up(3, 0, 4);
    assert_true(sv_ladder_near_px(&good, 1) == SV_LADDER_MAGNIFIED_PX);
    assert_true(sv_ladder_near_px(&no_better, 1) == SV_LADDER_MAGNIFIED_PX);
    struct sv_ladder bad = made_up(3, 0, 0.1f); /* every size above the first rung is drawn leaf by leaf */
    assert_true(sv_ladder_near_px(&bad, 1) <= (double)sv_ladder_size_px(0));
}

/* What is measured has the properties that drawing relies on: leaves get better with size, sprites worse; small trees are
 * better as sprites or hardly worse, large ones as leaves. */
static void measured_errors_make_sense(void **state)
{
    (void)state;
    struct sv_error error;
    struct sv_ladder a, b;
    for (int k = 0; k < 2; k++) {
        fixture_ok(sv_ladder_measure(sprites, leaves, k, species[k].mesh, &a, &error), &error);
        for (int r = 0; r < SV_LADDER_SIZES; r++) {
            print_message("  %4.0f px: sprite %.3f, leaves %.3f px\n", (double)sv_ladder_size_px(r),
                          (double)a.error_px[r][SV_LADDER_SPRITE], (double)a.error_px[r][SV_LADDER_LEAF]);
            for (int f = 0; f < SV_LADDER_FORMS; f++)
                assert_true(a.error_px[r][f] >= 0 && a.error_px[r][f] < 6);
        }
        int last = SV_LADDER_SIZES - 1;
        assert_true(a.error_px[last][SV_LADDER_LEAF] < a.error_px[last][SV_LADDER_SPRITE]);
        assert_true(a.error_px[last][SV_LADDER_SPRITE] > a.error_px[0][SV_LADDER_SPRITE]);
    }
    fixture_ok(sv_ladder_measure(sprites, leaves, 1, species[1].mesh, &b, &error), &error);
    assert_memory_equal(&a, &b, sizeof a); /* deterministic */
}

static void ladders_are_kept_and_checked(void **state)
{
    (void)state;
    char folder[] = "/tmp/sv-ladder-XXXXXX";
    struct sv_store *store;
    struct sv_error error;
    struct sv_ladder want = made_up(0.7f, 0.1f, 0.3f), got;
    assert_non_null(mkdtemp(folder));
    assert_int_equal(sv_store_open(folder, 1 << 20, &store, &error), SV_OK);
    sv_store_put(store, SV_LADDER_KIND, species[1].key, &want, sizeof want, &error);
    fixture_ok(sv_ladder_obtain(sprites, leaves, 1, &species[1], store, &got, &error), &error);
    assert_memory_equal(&got, &want, sizeof got);
    want.error_px[3][0] = NAN; /* what is no ladder is measured again, and kept */
    sv_store_put(store, SV_LADDER_KIND, species[1].key, &want, sizeof want, &error);
    fixture_ok(sv_ladder_obtain(sprites, leaves, 1, &species[1], store, &got, &error), &error);
    for (int k = 0; k < SV_LADDER_SIZES; k++)
        assert_true(got.error_px[k][0] >= 0);
    void *data;
    size_t bytes;
    assert_int_equal(sv_store_get(store, SV_LADDER_KIND, species[1].key, &data, &bytes, &error), SV_OK);
    assert_int_equal(bytes, sizeof got);
    assert_memory_equal(data, &got, bytes);
    free(data);
    sv_store_close(store);
    char command[64];
    snprintf(command, sizeof command, "rm -r %s", folder);
    assert_int_equal(system(command), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(errors_lie_between_rungs),
        cmocka_unit_test(leaves_begin_where_sprites_are_off),
        cmocka_unit_test(measured_errors_make_sense),
        cmocka_unit_test(ladders_are_kept_and_checked),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
