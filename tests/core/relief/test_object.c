/* test_object.c - relief objects as data: layout, the faces that an eye needs, the store, refusals. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "core/base/rng.h"
#include "core/gl/context.h"
#include "core/relief/object_splat_kernel.h"
#include "tests/core/relief/object_bodies.h"

/* Layout: square texels, the box covered by less than a texel too much, f outward. */
static void test_layout(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(8, 0);
    for (int round = 0; round < 500; round++) {
        struct sv_relief_object o = {0};
        struct sv_vec3 lo = sv_vec3(sv_rng_range(&rng, -2, 0), sv_rng_range(&rng, -2, 0), 0);
        struct sv_vec3 size =
            sv_vec3(exp(sv_rng_range(&rng, -6, 1)), exp(sv_rng_range(&rng, -6, 1)), round % 5);
        int resolution = 8 + (int)(sv_rng_unit(&rng) * 2040);
        assert_int_equal(sv_relief_object_set_box(&o, lo, sv_add(lo, size), resolution, SV_EINVAL, NULL),
                         SV_OK);
        int longest = 0;
        for (int k = 0; k < SV_RELIEF_FACES; k++) {
            struct sv_relief_frame f;
            int width, height;
            sv_relief_object_face_layout(&o, k, o.texel, &f, &width, &height);
            assert_int_equal(sv_relief_frame_check(&f, NULL), SV_OK);
            longest = width > longest ? width : height > longest ? height : longest;
            for (int corner = 0; corner < 8; corner++) {
                struct sv_vec3 p =
                    sv_vec3(corner & 1 ? o.box_max.x : o.box_min.x, corner & 2 ? o.box_max.y : o.box_min.y,
                            corner & 4 ? o.box_max.z : o.box_min.z);
                double u, v, d;
                sv_relief_locate(&f, p, &u, &v, &d);
                assert_true(u > -1e-5 && u < width + 1e-5 && v > -1e-5 && v < height + 1e-5 && d < 1e-9);
                assert_true(fmin(u, width - u) <= 0.5 + 1e-5 && fmin(v, height - v) <= 0.5 + 1e-5);
            }
        }
        assert_int_equal(longest, resolution);
    }
    struct sv_relief_object o;
    struct sv_error error;
    const struct sv_vec3 zero = {0, 0, 0}, one = {1, 1, 1}, odd = {1, NAN, 1};
    assert_int_equal(sv_relief_object_set_box(&o, zero, one, 7, SV_EINVAL, &error), SV_EINVAL);
    assert_string_equal(error.field, "resolution");
    assert_int_equal(sv_relief_object_set_box(&o, zero, odd, 8, SV_EINVAL, &error), SV_EINVAL);
    assert_int_equal(sv_relief_object_set_box(&o, zero, zero, 8, SV_EINVAL, &error), SV_EINVAL);
    assert_int_equal(sv_relief_object_set_box(&o, one, zero, 8, SV_EINVAL, &error), SV_EINVAL);
}

/* faces and spans leave out nothing that faces the eye: every kept texel whose normal is towards it is in. */
static void test_faces(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(5, 0);
    long checked = 0, spared = 0;
    for (int round = 0; round < 60; round++) {
        const struct body *b = &bodies[round % OBJECT_KIT_COUNT];
        bool is_place = round % 3 != 0;
        struct sv_vec3 eye =
            sv_vec3(sv_rng_range(&rng, -1, 1), sv_rng_range(&rng, -1, 1), sv_rng_range(&rng, -1, 1));
        eye = is_place ? sv_madd(sv_vec3(0, 0, 0.5), eye, exp(sv_rng_range(&rng, -1, 3))) : sv_normalize(eye);
        unsigned faces = sv_relief_object_seen_from(&b->object, eye, is_place);
        for (int k = 0; k < SV_RELIEF_SHEETS; k++) {
            const struct sv_relief *r = sv_relief_sheet(&b->object, k);
            struct sv_relief_span *spans =
                must(malloc((size_t)sv_relief_object_spans_max(&b->object) * sizeof *spans));
            uint8_t *in = must(calloc((size_t)r->width, (size_t)r->height));
            int count = sv_relief_object_spans(&b->object, k, eye, is_place, spans);
            spared += r->width * r->height;
            for (int s = 0; s < count; s++)
                for (int j = spans[s].row0; j < spans[s].row1; j++)
                    for (int i = spans[s].column0; i < spans[s].column1; i++, spared--)
                        in[j * r->width + i] = 1;
            for (int j = 0; j < r->height; j++)
                for (int i = 0; i < r->width; i++) {
                    size_t t = (size_t)j * (size_t)r->width + (size_t)i;
                    if (!sv_relief_solid(r, t) || (k < SV_RELIEF_FACES && !b->object.keep[k][t]))
                        continue;
                    struct sv_vec3 at = sv_relief_point(&r->frame, i + 0.5, j + 0.5, (double)r->displ[t]);
                    if (!(sv_dot(bodies_texel_normal(r, t), is_place ? sv_sub(eye, at) : eye) > 0))
                        continue;
                    checked++;
                    assert_true(in[t]);
                    assert_true(faces >> k % SV_RELIEF_FACES & 1);
                }
            free(in);
            free(spans);
        }
    }
    printf("faces: %ld texels towards eyes, all in; %ld texels spared\n", checked, spared);
    assert_true(spared > 0);
}

static void same_object(const struct sv_relief_object *a, const struct sv_relief_object *b)
{
    for (int k = 0; k < SV_RELIEF_SHEETS; k++) {
        const struct sv_relief *r = sv_relief_sheet(a, k), *s = sv_relief_sheet(b, k);
        size_t texels = (size_t)r->width * (size_t)r->height;
        assert_int_equal(r->width, s->width);
        assert_int_equal(r->height, s->height);
        assert_memory_equal(&r->frame, &s->frame, sizeof r->frame);
        assert_memory_equal(r->displ, s->displ, texels * 4);
        assert_memory_equal(r->color, s->color, texels * 4);
        assert_memory_equal(r->normal, s->normal, texels * 8);
        assert_int_equal(r->solid_count, s->solid_count);
    }
}

static void test_store(void **state)
{
    (void)state;
    const struct sv_relief_object *o = &bodies[OBJECT_KIT_COURTYARD].object;
    struct sv_relief_object again;
    struct sv_error error;
    void *data;
    size_t bytes;
    assert_int_equal(sv_relief_object_save(o, &data, &bytes, NULL), SV_OK);
    assert_int_equal(sv_relief_object_load(data, bytes, &again, NULL), SV_OK);
    same_object(o, &again);
    sv_relief_object_finish(&again);
    /* Any byte changed, any length cut: refused with a reason. */
    struct sv_rng rng = sv_rng_seeded(11, 0);
    for (int k = 0; k < 300; k++) {
        uint8_t *at = (uint8_t *)data + (k < 100 ? (size_t)k : (size_t)(sv_rng_unit(&rng) * (double)bytes));
        *at ^= 0x40;
        memset(&error, 0, sizeof error);
        assert_int_equal(sv_relief_object_load(data, bytes, &again, &error), SV_EFORMAT);
        assert_true(error.message[0] != 0);
        *at ^= 0x40;
        size_t shorter = (size_t)(sv_rng_unit(&rng) * (double)bytes);
        assert_int_equal(sv_relief_object_load(data, shorter, &again, NULL), SV_EFORMAT);
    }
    assert_int_equal(sv_relief_object_load(NULL, 0, &again, NULL), SV_EFORMAT);
    free(data);
}

/* The second call reads what the first one wrote: no GL context is there by now, so a bake would fail. */
static void test_obtain(void **state)
{
    (void)state;
    char folder[] = "/tmp/sv_object_XXXXXX";
    struct sv_store *store;
    struct sv_gl_context *context;
    struct sv_relief_object first, second;
    assert_non_null(mkdtemp(folder));
    assert_int_equal(sv_store_open(folder, 64 << 20, &store, NULL), SV_OK);
    const struct sv_tree_mesh *mesh = &bodies[OBJECT_KIT_TORUS].mesh;
    assert_int_equal(sv_gl_context_create(&context, NULL), SV_OK);
    assert_int_equal(sv_relief_object_obtain(mesh, 77, 40, store, &first, NULL), SV_OK);
    sv_gl_context_destroy(context);
    const struct sv_tree_mesh none = {0}; /* cannot be baked */
    assert_int_equal(sv_relief_object_obtain(&none, 77, 40, store, &second, NULL), SV_OK);
    same_object(&first, &second);
    sv_relief_object_finish(&second);
    assert_int_equal(sv_relief_object_obtain(&none, 77, 41, store, &second, NULL), SV_EINVAL);
    assert_int_equal(sv_relief_object_obtain(&none, 78, 40, store, &second, NULL), SV_EINVAL);
    assert_int_equal(sv_relief_object_obtain(&none, 77, 40, NULL, &second, NULL), SV_EINVAL);
    sv_relief_object_finish(&first);
    sv_store_close(store);
    char command[64];
    snprintf(command, sizeof command, "rm -r %s", folder);
    assert_int_equal(system(command), 0);
}

static void test_refusals(void **state)
{
    (void)state;
    const struct body *b = &bodies[OBJECT_KIT_BOX];
    struct sv_light light;
    const struct sv_sun sun = {0.4, 0.5};
    sv_light_from_sun(&sun, &light);
    struct sv_relief_look_options options = {.lit = true, .shininess = 1};
    struct sv_error error;
    struct sv_relief_place place = BODIES_PLACE;
    place.height_m = 0;
    assert_int_equal(sv_relief_look_light(b->look, &place, &light, &options, 63, &error), SV_EINVAL);
    assert_string_equal(error.field, "place.height_m");
    place = BODIES_PLACE;
    place.place.x = NAN;
    assert_int_equal(sv_relief_look_light(b->look, &place, &light, &options, 63, &error), SV_EINVAL);
    options.specular = 2;
    assert_int_equal(sv_relief_look_light(b->look, &BODIES_PLACE, &light, &options, 63, &error), SV_EINVAL);
    assert_string_equal(error.field, "specular");
    struct sv_camera camera = bodies_orbit_camera(&b->object, 0, 0, 512);
    camera.eye = sv_madd(BODIES_PLACE.place, sv_vec3(0, 0, 1), 6); /* inside of the body */
    assert_true(sv_relief_object_texel_px(&b->object, &BODIES_PLACE, &camera) > 100);
    assert_true(sv_relief_object_faces(&b->object, &BODIES_PLACE, &camera) <= 63);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_layout), cmocka_unit_test(test_faces),    cmocka_unit_test(test_store),
        cmocka_unit_test(test_obtain), cmocka_unit_test(test_refusals),
    };
    return cmocka_run_group_tests(tests, bodies_set_up, bodies_tear_down);
}
