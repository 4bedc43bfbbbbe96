/* test_gl.c - context, target, programs: what is up stays up, layers read back what was drawn, errors have
 * words, and the depth buffer tells 0.2 m from 50 km. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "core/base/color.h"
#include "core/base/rng.h"
#include "core/gl/context.h"
#include "core/gl/frame.h"
#include "core/gl/functions.h"
#include "core/gl/program.h"
#include "core/gl/target.h"

enum { W = 64, H = 48 };

static const unsigned all_layers = (1u << SV_LAYER_COUNT) - 1;

/* A local-space triangle list straight from the vertex buffer, with a uniform colour. */
static const char vertex_text[] = "#include \"frame.glsl\"\n"
                                  "layout(location = 0) in vec3 p;\n"
                                  "void main()\n{\n    gl_Position = clip_from_local * vec4(p, 1.0);\n}\n";
static const char fragment_text[] = "layout(location = 0) uniform vec4 paint;\n"
                                    "layout(location = 1) uniform uint number;\n"
                                    "layout(location = 0) out vec4 color;\n"
                                    "layout(location = 1) out uint id;\n"
                                    "layout(location = 2) out vec4 normal;\n"
                                    "void main()\n{\n    color = paint;\n    id = number;\n"
                                    "    normal = vec4(-0.25, 0.5, 1.0, 0.0);\n}\n";

struct fixture {
    struct sv_gl_context *context;
    unsigned program;
    GLuint vertices, buffer;
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
    gl.GenVertexArrays(1, &f.vertices);
    gl.BindVertexArray(f.vertices);
    gl.GenBuffers(1, &f.buffer);
    gl.BindBuffer(GL_ARRAY_BUFFER, f.buffer);
    gl.EnableVertexAttribArray(0);
    gl.VertexAttribPointer(0, 3, GL_FLOAT, GL_FALSE, 0, NULL);
    *state = &f;
    return 0;
}

static int tear_down(void **state)
{
    struct fixture *f = *state;
    sv_gl_context_destroy(f->context);
    return 0;
}

static struct sv_gl_frame frame_at(double heading, double pitch, double roll)
{
    struct sv_gl_frame frame = {.camera = {.projection = SV_PROJECTION_PERSPECTIVE,
                                           .vfov_rad = 1.0,
                                           .width = W,
                                           .height = H,
                                           .near_m = 0.1}};
    sv_camera_aim(&frame.camera, heading, pitch, roll);
    return frame;
}

static void begin_frame(struct sv_gl_frame *frame)
{
    struct sv_error error;
    assert_int_equal(sv_gl_frame_begin(frame, &error), SV_OK);
}

/* A square of half side s about the local point p, facing the camera. */
static void draw_square(const struct fixture *f, const struct sv_camera *c, struct sv_vec3 p, double s,
                        const float paint[4], unsigned number)
{
    static const int corner[6][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, -1}, {1, 1}, {-1, 1}};
    float xyz[18];
    for (int k = 0; k < 6; k++) {
        struct sv_vec3 q = sv_madd(sv_madd(p, c->right, s * corner[k][0]), c->up, s * corner[k][1]);
        xyz[3 * k] = (float)q.x;
        xyz[3 * k + 1] = (float)q.y;
        xyz[3 * k + 2] = (float)q.z;
    }
    gl.BindVertexArray(f->vertices);
    gl.BindBuffer(GL_ARRAY_BUFFER, f->buffer);
    gl.BufferData(GL_ARRAY_BUFFER, sizeof xyz, xyz, GL_STREAM_DRAW);
    gl.UseProgram(f->program);
    gl.Uniform4fv(0, 1, paint);
    gl.Uniform1ui(1, number);
    gl.DrawArrays(GL_TRIANGLES, 0, 6);
}

static struct sv_gl_target *new_target(unsigned layers)
{
    struct sv_gl_target *target = NULL;
    struct sv_error error;
    if (sv_gl_target_create(W, H, layers, &target, &error))
        fail_msg("%s", error.message);
    return target;
}

static void read_layer(struct sv_gl_target *target, enum sv_layer layer, int channels,
                       enum sv_pixel_type type, struct sv_image *out)
{
    struct sv_error error;
    assert_int_equal(sv_image_alloc(W, H, channels, type, out, &error), SV_OK);
    if (sv_gl_target_read(target, layer, out, &error))
        fail_msg("%s", error.message);
}

/* What is above and to the right of the view axis must be in the picture's upper right: the first rows read.
 */
static void picture_is_upright(void **state)
{
    struct fixture *f = *state;
    struct sv_gl_target *target = new_target(all_layers);
    struct sv_gl_frame frame = frame_at(0.7, 0.2, 0.3);
    struct sv_image color, id, normal, depth;
    const float paint[4] = {0.5f, 0.25f, 1.0f, 1.0f};
    struct sv_vec3 p = sv_scale(frame.camera.forward, 10);
    p = sv_madd(sv_madd(p, frame.camera.right, 3), frame.camera.up, 2);
    begin_frame(&frame);
    sv_gl_target_begin(target);
    draw_square(f, &frame.camera, p, 0.5, paint, 0x80000007u);
    read_layer(target, SV_LAYER_COLOR, 4, SV_PIXEL_U8, &color);
    read_layer(target, SV_LAYER_ID, 1, SV_PIXEL_U32, &id);
    read_layer(target, SV_LAYER_NORMAL, 3, SV_PIXEL_F32, &normal);
    read_layer(target, SV_LAYER_DEPTH, 1, SV_PIXEL_F32, &depth);
    double px, py, z;
    assert_true(sv_camera_project(&frame.camera, sv_add(frame.camera.eye, p), &px, &py, &z));
    assert_true(px > W / 2 + 4 && py < H / 2 - 4);
    size_t at = (size_t)py * W + (size_t)px;
    const uint8_t *rgba = (const uint8_t *)color.data + 4 * at;
    for (int c = 0; c < 3; c++)
        assert_in_range(rgba[c], sv_srgb8_from_linear(paint[c]) - (c < 2), sv_srgb8_from_linear(paint[c]));
    assert_int_equal(rgba[3], 255);
    assert_int_equal(((const uint32_t *)id.data)[at], 0x80000007u);
    assert_float_equal(((const float *)normal.data)[3 * at], -0.25f, 1e-6);
    assert_float_equal(((const float *)normal.data)[3 * at + 2], 1.0f, 1e-6);
    assert_float_equal(0.1 / (double)((const float *)depth.data)[at], 10, 1e-5);
    size_t mirrored = (size_t)(H - 1 - (int)py) * W + (size_t)px, covered = 0;
    assert_int_equal(((const uint32_t *)id.data)[mirrored], 0);
    assert_true(((const float *)depth.data)[mirrored] == 0);
    for (size_t i = 0; i < (size_t)W * H; i++)
        covered += ((const uint32_t *)id.data)[i] != 0;
    double side = sv_camera_focal_px(&frame.camera) / 10;
    assert_in_range(covered, (size_t)((side - 1) * (side - 1)), (size_t)((side + 1) * (side + 1)));
    sv_image_free(&color);
    sv_image_free(&id);
    sv_image_free(&normal);
    sv_image_free(&depth);
    sv_gl_target_destroy(target);
}

/* Pixel (i, j) shows a point just when the point's position, less the shift, falls into it. */
static void shift_moves_the_sample(void **state)
{
    struct fixture *f = *state;
    struct sv_gl_target *target = new_target(1u << SV_LAYER_ID);
    struct sv_rng rng = sv_rng_seeded(3, 3);
    for (int round = 0; round < 60; round++) {
        struct sv_gl_frame frame = frame_at(1, -0.4, 0.1);
        if (round % 2) {
            frame.camera.projection = SV_PROJECTION_ORTHOGRAPHIC;
            frame.camera.ortho_height_m = 20;
            frame.camera.far_m = 1000;
        }
        frame.shift_x_px = sv_rng_range(&rng, -0.5, 0.5);
        frame.shift_y_px = sv_rng_range(&rng, -0.5, 0.5);
        /* A sample 0.3 px off the edge of a half plane tells on which side of the edge it lies. */
        int column = 20 + round % 20, inside = round / 2 % 2;
        struct sv_vec3 origin, direction;
        double edge = column + 0.5 + frame.shift_x_px + (inside ? -0.05 : 0.05);
        sv_camera_ray(&frame.camera, edge, 24 + frame.shift_y_px, &origin, &direction);
        struct sv_vec3 p = sv_madd(sv_madd(origin, direction, 10), frame.camera.right, 100);
        const float paint[4] = {1, 1, 1, 1};
        struct sv_image id;
        begin_frame(&frame);
        sv_gl_target_begin(target);
        draw_square(f, &frame.camera, p, 100, paint, 9);
        read_layer(target, SV_LAYER_ID, 1, SV_PIXEL_U32, &id);
        assert_int_equal(((const uint32_t *)id.data)[24 * W + column], inside ? 9 : 0);
        assert_int_equal(((const uint32_t *)id.data)[24 * W + column + 1], 9);
        assert_int_equal(((const uint32_t *)id.data)[24 * W + column - 1], 0);
        sv_image_free(&id);
    }
    sv_gl_target_destroy(target);
}

/* A reversed float depth has a relative step of 2^-24; what reaches the buffer also went through w = Z in
 * float. Squares at distances from 0.2 m to 50 km read back within 1e-6, and of two that are 1e-5 apart the
 * nearer one wins whatever the order. */
static void depth_reaches_from_hand_to_horizon(void **state)
{
    struct fixture *f = *state;
    struct sv_gl_target *target = new_target(all_layers);
    const float paint[4] = {1, 1, 1, 1};
    struct sv_gl_frame frame = frame_at(2.2, 0, 0);
    begin_frame(&frame);
    for (double z = 0.2; z < 51000; z *= 1.37) {
        for (int order = 0; order < 2; order++) {
            struct sv_image id, depth;
            double first = order ? z : z * (1 + 1e-5), second = order ? z * (1 + 1e-5) : z;
            sv_gl_target_begin(target);
            draw_square(f, &frame.camera, sv_scale(frame.camera.forward, first), first, paint, order ? 1 : 2);
            draw_square(f, &frame.camera, sv_scale(frame.camera.forward, second), second, paint,
                        order ? 2 : 1);
            read_layer(target, SV_LAYER_ID, 1, SV_PIXEL_U32, &id);
            read_layer(target, SV_LAYER_DEPTH, 1, SV_PIXEL_F32, &depth);
            for (int i = 0; i < W * H; i++) {
                assert_int_equal(((const uint32_t *)id.data)[i], 1);
                double got = 0.1 / (double)((const float *)depth.data)[i];
                if (!(fabs(got - z) <= 1e-6 * z))
                    fail_msg("distance %.9g m, pixel %d: got %.9g m", z, i, got);
            }
            sv_image_free(&id);
            sv_image_free(&depth);
        }
    }
    sv_gl_target_destroy(target);
}

/* Counter-clockwise for the viewer is the front, in spite of the flip. */
static void front_is_counter_clockwise(void **state)
{
    struct fixture *f = *state;
    struct sv_gl_target *target = new_target(1u << SV_LAYER_ID);
    struct sv_gl_frame frame = frame_at(0.4, 0.1, 0);
    const float paint[4] = {1, 1, 1, 1};
    begin_frame(&frame);
    for (int back = 0; back < 2; back++) {
        struct sv_image id;
        struct sv_camera axes = frame.camera;
        if (back)
            axes.right = sv_scale(axes.right, -1);
        sv_gl_target_begin(target);
        gl.Enable(GL_CULL_FACE);
        draw_square(f, &axes, sv_scale(frame.camera.forward, 5), 9, paint, 3);
        read_layer(target, SV_LAYER_ID, 1, SV_PIXEL_U32, &id);
        assert_int_equal(((const uint32_t *)id.data)[H / 2 * W + W / 2], back ? 0 : 3);
        sv_image_free(&id);
    }
    gl.Disable(GL_CULL_FACE);
    sv_gl_target_destroy(target);
}

/* A picture that was written is read again, byte for byte, and depth does not change; other sizes are refused. */
static void pictures_are_written(void **state)
{
    (void)state;
    struct sv_gl_target *target = new_target(1u << SV_LAYER_COLOR), *bare = new_target(1u << SV_LAYER_ID);
    struct sv_image in, out, small, depth;
    struct sv_error error;
    assert_int_equal(sv_image_alloc(W, H, 4, SV_PIXEL_U8, &in, &error), SV_OK);
    assert_int_equal(sv_image_alloc(W, H - 1, 4, SV_PIXEL_U8, &small, &error), SV_OK);
    uint8_t *bytes = in.data;
    for (int k = 0; k < W * H * 4; k++)
        bytes[k] = (uint8_t)(k * 37 + k / 1000);
    sv_gl_target_begin(target);
    assert_int_equal(sv_gl_target_write(target, &in, &error), SV_OK);
    read_layer(target, SV_LAYER_COLOR, 4, SV_PIXEL_U8, &out);
    read_layer(target, SV_LAYER_DEPTH, 1, SV_PIXEL_F32, &depth);
    assert_memory_equal(in.data, out.data, (size_t)W * H * 4);
    for (int k = 0; k < W * H; k++)
        assert_true(((const float *)depth.data)[k] == 0);
    assert_int_equal(sv_gl_target_write(target, &small, &error), SV_EINVAL);
    assert_int_equal(sv_gl_target_write(bare, &in, &error), SV_EINVAL);
    sv_image_free(&in);
    sv_image_free(&out);
    sv_image_free(&small);
    sv_image_free(&depth);
    sv_gl_target_destroy(target);
    sv_gl_target_destroy(bare);
}

static void missing_layers_are_refused(void **state)
{
    (void)state;
    struct sv_gl_target *target = new_target(1u << SV_LAYER_COLOR), *none = NULL;
    struct sv_image id;
    struct sv_error error = {.code = SV_OK};
    assert_int_equal(sv_image_alloc(W, H, 1, SV_PIXEL_U32, &id, &error), SV_OK);
    assert_int_equal(sv_gl_target_read(target, SV_LAYER_ID, &id, &error), SV_EINVAL);
    assert_int_equal(sv_gl_target_read(target, SV_LAYER_COLOR, &id, &error), SV_EINVAL); /* not RGBA u8 */
    assert_int_equal(sv_gl_target_create(0, 5, 1, &none, &error), SV_EINVAL);
    assert_null(none);
    sv_image_free(&id);
    sv_gl_target_destroy(target);
    sv_gl_target_destroy(NULL);
}

static void broken_shaders_have_words(void **state)
{
    (void)state;
    struct sv_error error;
    unsigned program = 77;
    assert_int_equal(sv_gl_program_create("nope.vert", "nope.frag", NULL, &program, &error), SV_ENOENT);
    assert_string_equal(error.field, "nope.vert");
    assert_int_equal(sv_gl_program_create_text("void main() { gl_Position = vec4(wrong_name); }",
                                               "void main() {}", &program, &error),
                     SV_EINTERNAL);
    assert_non_null(strstr(error.message, "wrong_name"));
    assert_int_equal(sv_gl_program_create_text("#include \"absent.glsl\"\nvoid main() {}", "void main() {}",
                                               &program, &error),
                     SV_ENOENT);
    assert_string_equal(error.field, "absent.glsl");
    assert_int_equal(program, 77);
}

static void gl_errors_are_told(void **state)
{
    (void)state;
    struct sv_error error;
    gl.Enable(0x1234);
    assert_int_equal(sv_gl_check("the test", &error), SV_EINTERNAL);
    assert_string_equal(error.message, "GL_INVALID_ENUM in the test");
    assert_int_equal(sv_gl_check("the test", &error), SV_OK);
}

/* A context made before the fork draws in the child, too. */
static void children_draw(void **state)
{
    struct fixture *f = *state;
    struct sv_gl_target *target = new_target(all_layers);
    pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        struct sv_gl_frame frame = frame_at(0, 0, 0);
        const float paint[4] = {1, 1, 1, 1};
        uint32_t ids[W * H];
        struct sv_image id = {W, H, 1, SV_PIXEL_U32, ids};
        alarm(20);
        if (sv_gl_frame_begin(&frame, NULL))
            _exit(2);
        sv_gl_target_begin(target);
        draw_square(f, &frame.camera, sv_scale(frame.camera.forward, 5), 9, paint, 5);
        _exit(sv_gl_target_read(target, SV_LAYER_ID, &id, NULL) || ids[0] != 5);
    }
    int status = -1;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 0);
    sv_gl_target_destroy(target);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(picture_is_upright),
        cmocka_unit_test(shift_moves_the_sample),
        cmocka_unit_test(depth_reaches_from_hand_to_horizon),
        cmocka_unit_test(front_is_counter_clockwise),
        cmocka_unit_test(pictures_are_written),
        cmocka_unit_test(missing_layers_are_refused),
        cmocka_unit_test(broken_shaders_have_words),
        cmocka_unit_test(gl_errors_are_told),
        cmocka_unit_test(children_draw),
    };
    sv_color_init();
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
