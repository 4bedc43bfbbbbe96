/* test_light_glsl.c - light.glsl against its C twin core/scene/light.c: random suns, normals, directions and
 * colours, one draw each into a one-pixel float framebuffer. Both compute in float with the same terms: they
 * may differ by a few roundings of a sum of magnitude ~1 and by exp/pow of the GLSL compiler, hence 2e-5
 * relative to 1 + |value|; the powers of the sky's glow (g^1024) multiply one rounding of g (6e-8) by
 * 1024: 1.3e-4 of a term of 0.25. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "core/base/rng.h"
#include "core/gl/context.h"
#include "core/gl/frame.h"
#include "core/gl/functions.h"
#include "core/gl/program.h"

enum { ROUNDS = 400 };

static const char vertex_text[] = "void main()\n{\n"
                                  "    vec2 p = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0;\n"
                                  "    gl_Position = vec4(p, 0.5, 1.0);\n}\n";
static const char fragment_text[] =
    "#include \"light.glsl\"\n"
    "layout(location = 0) uniform vec3 n;\n"
    "layout(location = 1) uniform vec3 v;\n"
    "layout(location = 2) uniform vec3 albedo;\n"
    "layout(location = 3) uniform vec4 more; // occlusion, translucency, visible, distance\n"
    "layout(location = 4) uniform int which;\n"
    "layout(location = 0) out vec4 color;\n"
    "void main()\n{\n"
    "    vec3 c = albedo;\n"
    "    if (which == 0) c = light_surface(n, albedo, more.x, more.z);\n"
    "    if (which == 1) c = light_leaf(n, v, albedo, more.x, more.y, more.z);\n"
    "    if (which == 2) c = light_sky(n);\n"
    "    if (which == 3) c = light_air(more.w, albedo);\n"
    "    color = vec4(c, 1.0);\n}\n";

struct fixture {
    struct sv_gl_context *context;
    unsigned program;
    GLuint framebuffer, texture, vertices;
};

static int set_up(void **state)
{
    static struct fixture f;
    struct sv_error error;
    if (sv_gl_context_create(&f.context, &error) ||
        sv_gl_program_create_text(vertex_text, fragment_text, &f.program, &error)) {
        print_error("%s: %s\n", error.field, error.message);
        return -1;
    }
    gl.GenTextures(1, &f.texture);
    gl.BindTexture(GL_TEXTURE_2D, f.texture);
    gl.TexStorage2D(GL_TEXTURE_2D, 1, GL_RGBA32F, 1, 1);
    gl.GenFramebuffers(1, &f.framebuffer);
    gl.BindFramebuffer(GL_FRAMEBUFFER, f.framebuffer);
    gl.FramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, f.texture, 0);
    gl.GenVertexArrays(1, &f.vertices);
    gl.BindVertexArray(f.vertices);
    gl.Viewport(0, 0, 1, 1);
    gl.UseProgram(f.program);
    *state = &f;
    return gl.CheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE ? 0 : -1;
}

static int tear_down(void **state)
{
    struct fixture *f = *state;
    sv_gl_context_destroy(f->context);
    return 0;
}

static struct sv_vec3 random_unit(struct sv_rng *rng)
{
    double z = sv_rng_range(rng, -1, 1), a = sv_rng_range(rng, 0, 2 * SV_PI), r = sqrt(1 - z * z);
    return sv_vec3(r * cos(a), r * sin(a), z);
}

/* The unit vector as GLSL gets it. */
static struct sv_vec3 narrowed(struct sv_vec3 v)
{
    return sv_vec3((float)v.x, (float)v.y, (float)v.z);
}

static void expect_rgb(const float expected[3], double allowed, int which, int round)
{
    float got[4];
    gl.Uniform1i(4, which);
    gl.DrawArrays(GL_TRIANGLES, 0, 3);
    gl.ReadPixels(0, 0, 1, 1, GL_RGBA, GL_FLOAT, got);
    for (int c = 0; c < 3; c++)
        if (!(fabs((double)got[c] - (double)expected[c]) <= allowed * (1 + fabs((double)expected[c]))))
            fail_msg("function %d, round %d, channel %d: expected %.8g, allowed %g, got %.8g", which, round,
                     c, (double)expected[c], allowed, (double)got[c]);
}

static void light_agrees_with_its_twin(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(42, 1);
    for (int round = 0; round < ROUNDS; round++) {
        struct sv_sun sun = {sv_rng_range(&rng, 0, 7), sv_rng_range(&rng, -0.5, SV_PI / 2)};
        struct sv_gl_frame frame = {.camera = {.width = 1, .height = 1, .vfov_rad = 1, .near_m = 0.1}};
        struct sv_error error;
        sv_camera_aim(&frame.camera, 0, 0, 0);
        sv_light_from_sun(&sun, &frame.light);
        frame.light.air = round % 2;
        frame.light.to_sun = narrowed(frame.light.to_sun);
        assert_int_equal(sv_gl_frame_begin(&frame, &error), SV_OK);
        struct sv_vec3 n = narrowed(random_unit(&rng)), v = narrowed(random_unit(&rng));
        if (round % 8 == 0) /* towards the sun: disc and glow */
            n = narrowed(sv_normalize(sv_madd(frame.light.to_sun, v, 0.02 * sv_rng_unit(&rng))));
        float albedo[3], more[4], expected[3];
        for (int c = 0; c < 3; c++)
            albedo[c] = (float)sv_rng_unit(&rng);
        for (int c = 0; c < 4; c++)
            more[c] = (float)sv_rng_unit(&rng);
        more[3] *= 60000;
        gl.Uniform3f(0, (float)n.x, (float)n.y, (float)n.z);
        gl.Uniform3f(1, (float)v.x, (float)v.y, (float)v.z);
        gl.Uniform3fv(2, 1, albedo);
        gl.Uniform4fv(3, 1, more);
        sv_light_surface(&frame.light, n, albedo, more[0], more[2], expected);
        expect_rgb(expected, 2e-5, 0, round);
        sv_light_leaf(&frame.light, n, v, albedo, more[0], more[1], more[2], expected);
        expect_rgb(expected, 2e-5, 1, round);
        struct sv_vec3 off = sv_sub(n, frame.light.to_sun);
        double angle = sv_length(off);
        if (angle < 4e-3 ||
            angle > 5.4e-3) { /* on the disc's rim one rounding of |off|^2 is a visible step */
            sv_light_sky(&frame.light, n, expected);
            expect_rgb(expected, 3e-4, 2, round);
        }
        for (int c = 0; c < 3; c++)
            expected[c] = albedo[c];
        sv_light_air(&frame.light, (double)more[3], expected);
        expect_rgb(expected, 2e-5, 3, round);
    }
    struct sv_error error;
    assert_int_equal(sv_gl_check("test", &error), SV_OK);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(light_agrees_with_its_twin)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
