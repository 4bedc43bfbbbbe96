/* test_cells_change.c - which panels a change shows on: swept boxes against points searched through the box
 * and its shadow; and a scene patched under a warm cache: pictures and every panel that stayed are, byte for
 * byte, those of a cache that was empty. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "core/base/rng.h"
#include "core/cell/panel.h"
#include "core/scene/id.h"
#include "core/view/cells_change.h"
#include "core/view/cells_refine.h"
#include "tests/core/tree/kept_bakes.h"
#include "tests/core/view/patch_kit.h"
#include "tests/core/view/scene_kit.h"

/* ---- sweeps ---- */

static struct sv_vec3 between(struct sv_rng *rng, const double low[3], const double high[3])
{
    double x = sv_rng_range(rng, low[0], high[0]), y = sv_rng_range(rng, low[1], high[1]);
    return sv_vec3(x, y, sv_rng_range(rng, low[2], high[2]));
}

/* By the definition: a point of the pyramid of the face, outside of the inner cube, within the outer one. */
static bool point_shows(const struct sv_cell_cache_label *l, struct sv_vec3 p)
{
    struct sv_vec3 right, up, forward, d = sv_sub(p, l->shell.v);
    sv_cell_face_axes(l->parts.face, &right, &up, &forward);
    double ahead = sv_dot(d, forward);
    bool ground = l->parts.layer == SV_PANEL_GROUND; /* has no outer cube */
    return ahead >= fabs(sv_dot(d, right)) && ahead >= fabs(sv_dot(d, up)) &&
           !sv_cell_in_cube(l->shell.v, l->shell.distance_m, p, 0) &&
           (ground || isinf(l->shell.outer_m) || sv_cell_in_cube(l->shell.outer_v, l->shell.outer_m, p, 0));
}

/* Points of the box (crowns) or of its shadow, down to the lowest ground. */
static bool found(struct sv_rng *rng, const struct sv_cell_cache_label *l, const struct sv_change_box *b,
                  double lowest)
{
    bool lit = l->light.to_sun.z > 0, crowns = l->parts.layer == SV_PANEL_CROWNS;
    for (int n = 0; n < 400; n++) {
        struct sv_vec3 p = between(rng, b->min, b->max);
        if (crowns && point_shows(l, p))
            return true;
        if (lit && point_shows(l, sv_madd(p, l->light.to_sun,
                                          -sv_rng_range(rng, 0, (p.z - lowest) / l->light.to_sun.z))))
            return true;
    }
    return false;
}

static struct sv_cell_cache_label random_label(struct sv_rng *rng, int t)
{
    static const double low[3] = {-150, -150, -10}, high[3] = {150, 150, 80};
    struct sv_cell_rings rings;
    struct sv_cell_place chain[SV_CELL_RINGS_MAX];
    sv_cell_rings_make(100, 6, 0.05, &rings);
    assert_true(sv_cell_chain(&rings, between(rng, low, high), false, chain));
    double azimuth = sv_rng_range(rng, 0, 2 * SV_PI), elevation = sv_rng_range(rng, 0.05, 1.5);
    struct sv_cell_cache_label l = {.parts = {.face = (enum sv_cell_face)(t % SV_CELL_FACES),
                                              .layer = t & 1 ? SV_PANEL_CROWNS : SV_PANEL_GROUND,
                                              .size = 1024},
                                    .shell = sv_cell_shell(&rings, &chain[t % rings.count], false)};
    if (t % 5)
        l.light.to_sun =
            sv_vec3(cos(elevation) * cos(azimuth), cos(elevation) * sin(azimuth), sin(elevation));
    return l;
}

static void shadows_that_show_are_seen(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(11, 0);
    struct sv_scene scene = {.terrain.field = {.width = 2,
                                               .height = 2,
                                               .x0 = -500,
                                               .y0 = -500,
                                               .dx = 1000,
                                               .dy = 1000,
                                               .z0 = 3,
                                               .h_min = -8,
                                               .h_max = 30}};
    int shown = 0, unseen = 0, mistaken = 0;
    for (int t = 0; t < 4000; t++) {
        static const double low[3] = {-100, -100, 0}, high[3] = {100, 100, 30};
        struct sv_scene_change change = {.trees_added = 1, .box_count = 1};
        struct sv_vec3 at = between(&rng, low, high);
        double r = sv_rng_range(&rng, 0.2, 4), h = sv_rng_range(&rng, 1, 15);
        change.boxes[0] = (struct sv_change_box){{at.x - r, at.y - r, at.z}, {at.x + r, at.y + r, at.z + h}};
        struct sv_cell_cache_label label = random_label(&rng, t);
        struct sv_cells_change *c = NULL;
        struct sv_error error;
        assert_int_equal(sv_cells_change_create(&scene, &change, &c, &error), SV_OK);
        bool shows = found(&rng, &label, &change.boxes[0], -5),
             said = sv_cells_change_shows(c, &label, false);
        assert_true(said || !shows);
        shown += shows;
        unseen += !said;
        mistaken += said && !shows;
        sv_cells_change_destroy(c);
    }
    assert_true(shown > 300 && unseen > 1500);
    assert_true(mistaken < shown); /* margins, boxes about slanted sweeps */
}

/* ---- a scene with a warm cache ---- */

enum { SIDE = 96, VIEWS = 5, ITEMS = 2048 };
static const size_t CACHE_BYTES = (size_t)96 << 20;

struct drawer {
    void *memory;
    struct sv_cell_cache *cache;
    struct sv_renderer *renderer;
};

static double no_clock(void)
{
    return 0;
}

static struct sv_renderer *renderer_of(const struct sv_scene *scene, struct sv_cell_cache *cache)
{
    struct sv_renderer_options options = {.store = kept_bakes(), .clock = no_clock, .cells = cache};
    struct sv_renderer *r = NULL;
    struct sv_error error;
    assert_int_equal(sv_renderer_create(scene, &options, &r, &error), SV_OK);
    return r;
}

static struct drawer drawer_of(const struct sv_scene *scene)
{
    struct drawer d = {.memory = aligned_alloc(4096, CACHE_BYTES)};
    struct sv_cell_cache_options cache = SV_CELL_CACHE_OPTIONS_DEFAULT;
    struct sv_error error;
    assert_non_null(d.memory);
    memset(d.memory, 0, CACHE_BYTES);
    assert_int_equal(sv_cell_cache_make(d.memory, CACHE_BYTES, &cache, &d.cache, &error), SV_OK);
    sv_cell_cache_drop_keys(d.cache, scene->generation, NULL, 0);
    d.renderer = renderer_of(scene, d.cache);
    return d;
}

static void drawer_finish(struct drawer *d)
{
    sv_renderer_destroy(d->renderer);
    free(d->memory);
}

/* Inside the wood, above it, at its edges looking in and out. */
static const struct {
    double x, y, agl, heading_deg, pitch_deg;
} POSES[VIEWS] = {{110, 80, 1.7, 20, 0},
                  {60, 60, 22, 60, -25},
                  {190, 190, 1.7, 200, 0},
                  {30, 190, 12, 310, -5},
                  {100, 40, 40, 5, -50}};

/* other_sun: not the scene's. */
static void resolve(const struct sv_scene *scene, int k, bool other_sun, struct sv_view_request *q,
                    struct sv_resolved_view *view)
{
    struct sv_error error;
    *q = kit_request();
    q->eye.x = POSES[k].x;
    q->eye.y = POSES[k].y;
    q->eye.agl = POSES[k].agl;
    q->heading_rad = sv_radians(POSES[k].heading_deg);
    q->pitch_rad = sv_radians(POSES[k].pitch_deg);
    q->width = q->height = SIDE;
    q->shadows = true;
    q->relief = SV_RELIEF_ON;
    q->relief_distance_m = 12;
    q->relief_resolution = 64;
    if (other_sun) {
        q->has_sun_azimuth = true;
        q->sun_azimuth_rad = sv_radians(260);
    }
    if (sv_view_resolve(scene, q, view, NULL, &error) != SV_OK)
        fail_msg("view %d: %s: %s", k, error.field, error.message);
}

static void draw(const struct sv_scene *scene, const struct drawer *d, int k, bool other_sun,
                 struct sv_picture *picture)
{
    struct sv_view_request q;
    struct sv_resolved_view view;
    struct sv_error error;
    resolve(scene, k, other_sun, &q, &view);
    if (sv_renderer_draw(d->renderer, &q, &view, picture, NULL, NULL, &error) != SV_OK)
        fail_msg("view %d: %s: %s", k, error.field, error.message);
}

struct album {
    struct sv_picture pictures[2 * VIEWS];
};

static struct album take(const struct sv_scene *scene, const struct drawer *d)
{
    struct album a = {0};
    for (int k = 0; k < 2 * VIEWS; k++)
        draw(scene, d, k % VIEWS, k >= VIEWS, &a.pictures[k]);
    return a;
}

static int differing(const struct album *a, const struct album *b)
{
    int pictures = 0;
    for (int k = 0; k < 2 * VIEWS; k++)
        pictures += memcmp(a->pictures[k].layer[SV_LAYER_COLOR].data,
                           b->pictures[k].layer[SV_LAYER_COLOR].data, 4 * SIDE * SIDE) != 0;
    return pictures;
}

static void put_away(struct album *a)
{
    for (int k = 0; k < 2 * VIEWS; k++)
        sv_picture_finish(&a->pictures[k]);
}

static size_t list(const struct drawer *d, struct sv_cell_cache_item items[ITEMS])
{
    size_t count = sv_cell_cache_list(d->cache, 0, items, ITEMS);
    assert_true(count > 0 && count <= ITEMS);
    return count;
}

/* Panels that both have are the same; how many there are. */
static size_t same_panels(const struct sv_scene *scene, const struct drawer *a, const struct drawer *b)
{
    static struct sv_cell_cache_item items[ITEMS];
    size_t count = list(a, items), both = 0;
    for (size_t k = 0; k < count; k++) {
        struct sv_cell_cache_panel p, q;
        uint64_t key = items[k].label.key;
        if (sv_cell_cache_find(b->cache, 1, key, scene->generation, 0, &q) != SV_CELL_CACHE_HIT)
            continue;
        assert_int_equal(sv_cell_cache_find(a->cache, 1, key, scene->generation, 0, &p), SV_CELL_CACHE_HIT);
        assert_int_equal(p.bytes, q.bytes);
        if (memcmp(p.data, q.data, p.bytes) != 0)
            fail_msg("ring %d face %d layer %d differs", items[k].label.parts.place.ring,
                     (int)items[k].label.parts.face, items[k].label.parts.layer);
        sv_cell_cache_unpin(a->cache, 1, &p);
        sv_cell_cache_unpin(b->cache, 1, &q);
        both++;
    }
    return both;
}

/* Pictures are those of a cache that was empty, after `ready` (NULL: nothing) has seen to it; how many panels
 * both have. GL has one context at a time: the warm cache goes on with a renderer of its own. */
static size_t same_as_fresh(struct sv_scene *scene, struct drawer *warm,
                            void (*ready)(const struct sv_scene *scene, const struct drawer *fresh))
{
    struct album a = take(scene, warm), b;
    sv_renderer_destroy(warm->renderer);
    struct drawer fresh = drawer_of(scene);
    if (ready) {
        b = take(scene, &fresh);
        put_away(&b);
        ready(scene, &fresh);
    }
    b = take(scene, &fresh);
    assert_int_equal(differing(&a, &b), 0);
    size_t same = same_panels(scene, warm, &fresh);
    drawer_finish(&fresh);
    warm->renderer = renderer_of(scene, warm->cache);
    put_away(&a);
    put_away(&b);
    return same;
}

/* What is drawn after the patch is what a cache that was empty draws; some panels stayed, some went. */
static void check(struct sv_scene *scene, struct drawer *warm, size_t were)
{
    static struct sv_cell_cache_item items[ITEMS];
    struct sv_cell_cache_stats stats;
    sv_cell_cache_stats(warm->cache, &stats);
    assert_int_equal(stats.generation, scene->generation);
    size_t stayed = list(warm, items);
    if (stayed == were || stayed < were / 4)
        fail_msg("%zu of %zu panels stayed", stayed, were);
    assert_true(same_as_fresh(scene, warm, NULL) >= stayed / 2);
}

static void patches_drop_what_they_show_on(void **state)
{
    (void)state;
    static struct sv_cell_cache_item items[ITEMS];
    struct sv_scene *scene = patch_kit_load(PATCH_KIT_TREES, "", "", 135);
    struct drawer warm = drawer_of(scene);
    struct album before = take(scene, &warm);
    size_t were = list(&warm, items);
    struct sv_scene_change c = patch_kit_patch(
        scene, warm.renderer,
        "{\"trees\":{\"add\":[{\"x\":120.5,\"y\":100.25,\"species\":\"oak\",\"height_m\":9}]}}");
    assert_int_equal(scene->generation, 1);
    check(scene, &warm, were);
    were = list(&warm, items);
    patch_kit_patch(scene, warm.renderer, "{\"sun\":{\"azimuth_deg\":140}}");
    assert_int_equal(list(&warm, items), were); /* the light is part of their keys */
    patch_kit_patch(scene, warm.renderer, "{\"sun\":{\"azimuth_deg\":135}}");
    patch_kit_patch(scene, warm.renderer, "{\"trees\":{\"remove\":{\"ids\":[%u]}}}",
                    SV_ID_TREE_FIRST + c.first_tree);
    check(scene, &warm, were);
    struct album after = take(scene, &warm);
    assert_int_equal(differing(&before, &after), 0);
    were = list(&warm, items);
    patch_kit_patch(scene, warm.renderer,
                    "{\"objects\":{\"add\":[{\"model\":\"hut.obj\",\"x\":70,\"y\":75,\"height_m\":6}]}}");
    check(scene, &warm, were);
    put_away(&before);
    put_away(&after);
    drawer_finish(&warm);
    sv_scene_destroy(scene);
}

/* ---- refined shadows ---- */

/* Refines the shadows of the walkers' views. */
static void refine(const struct sv_scene *scene, const struct drawer *d)
{
    for (int k = 0; k < VIEWS; k += 2) {
        struct sv_view_request q;
        struct sv_resolved_view view;
        struct sv_cells_refine_options options = {
            .samples = 4, .scale = 1, .shadows_alone = true, .most = UINT32_MAX};
        struct sv_cells_refine_report report;
        struct sv_error error;
        resolve(scene, k, false, &q, &view);
        assert_int_equal(sv_renderer_refine_cells(d->renderer, &q, &view, &options, &report, &error), SV_OK);
        assert_int_equal(report.left, 0);
    }
}

static size_t list_shadows(const struct drawer *d, struct sv_cell_cache_item items[ITEMS])
{
    size_t count = list(d, items), shadows = 0;
    for (size_t k = 0; k < count; k++)
        if (items[k].label.parts.layer == SV_PANEL_SHADOW)
            items[shadows++] = items[k];
    return shadows;
}

/* As many as `were` pages of shadow, but for those that the change shows on; pictures are those of a process
 * that has drawn nothing yet and, once all is refined again, those of a cache that was empty. */
static void check_refined(struct sv_scene *scene, struct drawer *warm, size_t were)
{
    static struct sv_cell_cache_item items[ITEMS];
    size_t stayed = list_shadows(warm, items);
    print_message("%zu of %zu pages of shadow stayed\n", stayed, were);
    if (stayed == were || stayed < were / 4)
        fail_msg("%zu of %zu pages of shadow stayed", stayed, were);
    struct album a = take(scene, warm);
    sv_renderer_destroy(warm->renderer);
    warm->renderer = renderer_of(scene, warm->cache);
    struct album b = take(scene, warm);
    assert_int_equal(differing(&a, &b), 0);
    put_away(&a);
    put_away(&b);
    refine(scene, warm);
    size_t again = list_shadows(warm, items);
    assert_true(again > stayed);
    assert_true(same_as_fresh(scene, warm, refine) >= stayed);
}

static void refined_shadows_follow_patches(void **state)
{
    (void)state;
    static struct sv_cell_cache_item items[ITEMS];
    struct sv_scene *scene = patch_kit_load(PATCH_KIT_TREES, "", "", 135);
    struct drawer warm = drawer_of(scene);
    struct album built = take(scene, &warm);
    refine(scene, &warm);
    struct album refined = take(scene, &warm);
    assert_true(differing(&built, &refined) > 0);
    size_t were = list_shadows(&warm, items);
    assert_true(were > 20);
    /* Twice, so that the truth is changed in place and made anew. */
    struct sv_scene_change c =
        patch_kit_patch(scene, warm.renderer,
                        "{\"trees\":{\"add\":[{\"x\":112,\"y\":85,\"species\":\"oak\",\"height_m\":5}]}}");
    check_refined(scene, &warm, were);
    were = list_shadows(&warm, items);
    refine(scene, &warm);
    assert_int_equal(list_shadows(&warm, items), were);
    patch_kit_patch(scene, warm.renderer, "{\"trees\":{\"remove\":{\"ids\":[%u]}}}",
                    SV_ID_TREE_FIRST + c.first_tree);
    check_refined(scene, &warm, were);
    struct album after = take(scene, &warm);
    assert_int_equal(differing(&refined, &after), 0);
    were = list_shadows(&warm, items);
    patch_kit_patch(scene, warm.renderer,
                    "{\"objects\":{\"add\":[{\"model\":\"hut.obj\",\"x\":108,\"y\":84,\"height_m\":2}]}}");
    check_refined(scene, &warm, were);
    put_away(&built);
    put_away(&refined);
    put_away(&after);
    drawer_finish(&warm);
    sv_scene_destroy(scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(shadows_that_show_are_seen),
                                       cmocka_unit_test(patches_drop_what_they_show_on),
                                       cmocka_unit_test(refined_shadows_follow_patches)};
    return cmocka_run_group_tests(tests, patch_kit_setup, patch_kit_teardown);
}
