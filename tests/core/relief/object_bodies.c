/* object_bodies.c - see object_bodies.h. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "core/base/color.h"
#include "core/gl/context.h"
#include "tests/core/relief/object_bodies.h"

enum { RESOLUTION = 128 };
const struct sv_relief_place BODIES_PLACE = {{512345.5, 6012345.25, 37}, 12, 0.35};
struct body bodies[OBJECT_KIT_COUNT];

int bodies_set_up(void **state)
{
    (void)state;
    struct sv_gl_context *context;
    struct sv_error error = {0};
    sv_color_init();
    if (sv_gl_context_create(&context, &error) != SV_OK)
        fail_msg("%s", error.message);
    for (int k = 0; k < OBJECT_KIT_COUNT; k++) {
        struct body *b = &bodies[k];
        b->mesh = object_kit_make((enum object_kit_body)k);
        if (sv_relief_object_bake(&b->mesh, RESOLUTION, &b->object, &error) != SV_OK ||
            sv_relief_look_create(&b->object, &b->look, &error) != SV_OK)
            fail_msg("%s: %s", error.field, error.message);
        b->truth = object_truth_create(&b->mesh);
    }
    sv_gl_context_destroy(context);
    return 0;
}

int bodies_tear_down(void **state)
{
    (void)state;
    for (int k = 0; k < OBJECT_KIT_COUNT; k++) {
        object_truth_destroy(bodies[k].truth);
        sv_relief_look_destroy(bodies[k].look);
        sv_relief_object_finish(&bodies[k].object);
        sv_tree_mesh_finish(&bodies[k].mesh);
    }
    return 0;
}

void *must(void *memory)
{
    assert_non_null(memory);
    return memory;
}

/* A camera that looks at the object's middle from outside; the object fills most of the picture. */
struct sv_camera bodies_orbit_camera(const struct sv_relief_object *object, double azimuth, double elevation,
                                     int side)
{
    struct sv_camera c = {.vfov_rad = 0.5, .width = side, .height = side, .near_m = 0.1};
    struct sv_vec3 size = sv_sub(object->box_max, object->box_min);
    double reach = 0.5 * sv_length(size) * BODIES_PLACE.height_m / sin(0.25) * 1.02;
    struct sv_vec3 to = sv_vec3(cos(elevation) * sin(azimuth), cos(elevation) * cos(azimuth), sin(elevation));
    struct sv_vec3 middle = sv_madd(BODIES_PLACE.place, sv_vec3(0, 0, 1), 0.5 * BODIES_PLACE.height_m);
    c.eye = sv_madd(middle, to, reach);
    sv_camera_aim(&c, azimuth + SV_PI, -elevation, 0);
    return c;
}

struct sv_vec3 bodies_texel_normal(const struct sv_relief *r, size_t k)
{
    struct sv_vec3 a = sv_normalize(r->frame.a), b = sv_normalize(r->frame.b);
    struct sv_vec3 n = sv_add(sv_scale(a, r->normal[k][0]), sv_scale(b, r->normal[k][1]));
    return sv_normalize(sv_madd(n, r->frame.f, r->normal[k][2]));
}
