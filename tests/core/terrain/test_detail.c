/* test_detail.c - the ground's detail: its GLSL against its C twin, its mean, its ends.
 *
 * llvmpipe filters 8-bit textures with 8-bit weights and rounds to 8 bits: each of up to two lookups a scale
 * is off by at most 1/256 of the largest step between texels (below 1) plus half a code of 1/128. Three
 * scales: below 0.03 of the albedo; on average the errors have no sign: below 0.002. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/rng.h"
#include "core/base/vec.h"
#include "core/gl/context.h"
#include "core/gl/functions.h"
#include "core/gl/program.h"
#include "core/terrain/detail.h"

enum { ROUNDS = 1500 };

static const char vertex_text[] = "void main()\n{\n"
                                  "    vec2 p = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0;\n"
                                  "    gl_Position = vec4(p, 0.5, 1.0);\n}\n";
static const char fragment_text[] =
    "#include \"detail.glsl\"\n"
    "layout(binding = 0) uniform sampler2D tile;\n"
    "layout(location = 0) uniform vec2 place;\n"
    "layout(location = 1) uniform vec3 more; // pixel, n . v, texel\n"
    "layout(location = 2) uniform vec3 albedo;\n"
    "layout(location = 3) uniform vec2 eye[3];\n"
    "layout(location = 0) out vec4 color;\n"
    "void main()\n{\n"
    "    color = vec4(detail_apply(tile, detail_at(place, eye), more.x, more.y, more.z, albedo), 1.0);\n}\n";

struct fixture {
    struct sv_gl_context *context;
    unsigned program;
    GLuint framebuffer, texture, tile, vertices;
};

static void make_tile(struct fixture *f)
{
    gl.GenTextures(1, &f->tile);
    gl.BindTexture(GL_TEXTURE_2D, f->tile);
    gl.TexStorage2D(GL_TEXTURE_2D, SV_TERRAIN_DETAIL_LEVELS, GL_RGBA8, SV_TERRAIN_DETAIL_SIDE,
                    SV_TERRAIN_DETAIL_SIDE);
    for (int l = 0; l < SV_TERRAIN_DETAIL_LEVELS; l++)
        gl.TexSubImage2D(GL_TEXTURE_2D, l, 0, 0, SV_TERRAIN_DETAIL_SIDE >> l, SV_TERRAIN_DETAIL_SIDE >> l,
                         GL_RGBA, GL_UNSIGNED_BYTE, sv_terrain_detail_level(l));
    gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR_MIPMAP_LINEAR);
}

static int set_up(void **state)
{
    static struct fixture f;
    struct sv_error error;
    if (sv_gl_context_create(&f.context, &error) || sv_terrain_detail_init(&error) ||
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
    make_tile(&f);
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

/* Draws the detail at eye + place as terrain.frag would. */
static void draw_detail(double eye_x, double eye_y, const float place[2], const float more[3],
                        const float albedo[3], float rgba[4])
{
    double uv[SV_DETAIL_COUNT][2];
    float eye[SV_DETAIL_COUNT * 2];
    sv_terrain_detail_place(eye_x, eye_y, uv);
    for (int k = 0; k < SV_DETAIL_COUNT * 2; k++)
        eye[k] = (float)uv[k / 2][k % 2];
    gl.Uniform2fv(0, 1, place);
    gl.Uniform3fv(1, 1, more);
    gl.Uniform3fv(2, 1, albedo);
    gl.Uniform2fv(3, SV_DETAIL_COUNT, eye);
    gl.DrawArrays(GL_TRIANGLES, 0, 3);
    gl.ReadPixels(0, 0, 1, 1, GL_RGBA, GL_FLOAT, rgba);
}

static void shader_agrees_with_its_twin(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(77, 1);
    double sum = 0, changed = 0;
    for (int round = 0; round < ROUNDS; round++) {
        double eye_x = sv_rng_range(&rng, 3e5, 7e5), eye_y = sv_rng_range(&rng, 4e6, 9e6);
        float place[2] = {(float)sv_rng_range(&rng, -60, 60), (float)sv_rng_range(&rng, -60, 60)};
        float more[3] = {(float)exp(sv_rng_range(&rng, log(0.002), log(30))),
                         (float)sv_rng_range(&rng, -0.1, 1),
                         (float)exp(sv_rng_range(&rng, log(0.2), log(100)))};
        float albedo[3] = {(float)sv_rng_range(&rng, 0.02, 0.3), (float)sv_rng_range(&rng, 0.02, 0.3), 0.03f},
              got[4];
        if (round % 10 == 0) /* snow, where it is subdued; and water, where there is none */
            albedo[0] = albedo[1] = albedo[2] = (float)sv_rng_range(&rng, 0.3, 0.8);
        if (round % 10 == 1)
            albedo[2] = albedo[1] + (float)sv_rng_range(&rng, 0, 0.03);
        draw_detail(eye_x, eye_y, place, more, albedo, got);
        float expected[3] = {albedo[0], albedo[1], albedo[2]};
        sv_terrain_detail_apply(eye_x + (double)place[0], eye_y + (double)place[1], (double)more[0],
                                (double)more[1], (double)more[2], expected);
        for (int c = 0; c < 3; c++) {
            double off = (double)(got[c] - expected[c]) / (double)albedo[c];
            if (!(fabs(off) < 0.03))
                fail_msg("round %d, channel %d: albedo %g, expected %g, got %g", round, c, (double)albedo[c],
                         (double)expected[c], (double)got[c]);
            sum += off;
            changed += fabs((double)(expected[c] / albedo[c] - 1));
        }
    }
    assert_true(fabs(sum / (3 * ROUNDS)) < 0.002);
    assert_true(changed / (3 * ROUNDS) > 0.05); /* there is something to agree on */
}

/* Over a large area the detail multiplies by 1 on average, at every size of pixel. */
static void mean_is_one(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(5, 1);
    for (double pixel_m = 0.01; pixel_m < 20; pixel_m *= 3) {
        double sum = 0;
        int n = 40000;
        for (int k = 0; k < n; k++) {
            float albedo[3] = {0.06f, 0.10f, 0.03f};
            sv_terrain_detail_apply(sv_rng_range(&rng, 0, 5000), sv_rng_range(&rng, 0, 5000), pixel_m, 1, 40,
                                    albedo);
            sum += (double)albedo[1] / 0.10;
        }
        assert_true(fabs(sum / n - 1) < 0.01); /* deviation of the mean: 0.5 / 200 = 0.0025 */
    }
}

/* From a scale's end on nothing of it is left, and just below its visible range there is something. */
static void scales_end_where_they_say(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(6, 1);
    assert_true(sv_terrain_detail_end_m(SV_DETAIL_BROAD, 5) == 0);
    for (double texel_m = 0.3; texel_m < 300; texel_m *= 2) {
        double end = 0;
        for (int k = 0; k < SV_DETAIL_COUNT; k++)
            end = fmax(end, sv_terrain_detail_end_m((enum sv_terrain_detail_scale)k, texel_m));
        double seen = 0;
        for (int k = 0; k < 200; k++) {
            float far_off[3] = {0.1f, 0.1f, 0.05f}, near_by[3] = {0.1f, 0.1f, 0.05f};
            double x = sv_rng_range(&rng, 0, 1e6), y = sv_rng_range(&rng, 0, 1e6);
            sv_terrain_detail_apply(x, y, end * 1.0001, 1, texel_m, far_off);
            sv_terrain_detail_apply(x, y, end * 0.2, 1, texel_m, near_by);
            assert_true(fabsf(far_off[1] - 0.1f) < 1e-6f);
            seen += fabs((double)near_by[1] - 0.1);
        }
        assert_true(seen / 200 > 1e-4);
    }
}

static void odd_numbers_change_nothing(void **state)
{
    (void)state;
    const double odd[] = {(double)NAN, (double)INFINITY, -(double)INFINITY, 1e308, 0};
    for (int k = 0; k < 5; k++)
        for (int at = 0; at < 5; at++) {
            double v[5] = {5, 5, 0.1, 1, 10};
            float albedo[3] = {0.1f, 0.2f, 0.05f};
            v[at] = odd[k];
            sv_terrain_detail_apply(v[0], v[1], v[2], v[3], v[4], albedo);
            for (int c = 0; c < 3; c++)
                assert_true(albedo[c] >= 0 && albedo[c] < 2);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(shader_agrees_with_its_twin),
        cmocka_unit_test(mean_is_one),
        cmocka_unit_test(scales_end_where_they_say),
        cmocka_unit_test(odd_numbers_change_nothing),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
