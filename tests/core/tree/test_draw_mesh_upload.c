/* Meshes as GL has them: what was uploaded is read back. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "core/gl/context.h"
#include "core/gl/functions.h"
#include "core/tree/draw_mesh_upload.h"
#include "draw_fixture.h"

static struct sv_gl_context *context;
static struct sv_tree_mesh mesh;

static int setup(void **state)
{
    (void)state;
    struct sv_error error;
    fixture_ok(sv_gl_context_create(&context, &error), &error);
    fixture_tree(40, 3, &mesh);
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    sv_tree_mesh_finish(&mesh);
    sv_gl_context_destroy(context);
    return 0;
}

static void same_bytes(GLenum target, GLuint buffer, const void *expected, size_t bytes)
{
    gl.BindBuffer(target, buffer);
    const void *held = gl.MapBufferRange(target, 0, (GLsizeiptr)bytes, GL_MAP_READ_BIT);
    assert_non_null(held);
    assert_memory_equal(held, expected, bytes);
    assert_true(gl.UnmapBuffer(target));
}

static GLint level_width(GLint level)
{
    GLint width = -1;
    gl.GetTexLevelParameteriv(GL_TEXTURE_2D, level, GL_TEXTURE_WIDTH, &width);
    return width;
}

static void what_was_uploaded_is_there(void **state)
{
    (void)state;
    struct sv_error error;
    int textured = 0;
    for (int mipmaps = 0; mipmaps < 2; mipmaps++) {
        struct sv_mesh_upload u;
        size_t bytes = mesh.vertex_count * sizeof *mesh.vertices + mesh.index_count * sizeof *mesh.indices;
        sv_mesh_upload_init(&mesh, mipmaps, &u);
        same_bytes(GL_ARRAY_BUFFER, u.vertices, mesh.vertices, mesh.vertex_count * sizeof *mesh.vertices);
        gl.BindVertexArray(u.array); /* the array knows its indices */
        GLint name = 0;
        gl.GetIntegerv(GL_ELEMENT_ARRAY_BUFFER_BINDING, &name);
        assert_int_equal(name, u.indices);
        same_bytes(GL_ELEMENT_ARRAY_BUFFER, u.indices, mesh.indices, mesh.index_count * sizeof *mesh.indices);
        gl.BindVertexArray(0);
        for (int k = 0; k < SV_TREE_MATERIALS_MAX; k++) {
            const struct sv_image *albedo = &mesh.materials[k].albedo;
            bool has = k < mesh.material_count && albedo->data;
            assert_true((u.textures[k] != 0) == has);
            if (!has)
                continue;
            uint8_t held[64 * 64 * 4];
            assert_true(sv_image_bytes(albedo) <= sizeof held);
            gl.BindTexture(GL_TEXTURE_2D, u.textures[k]);
            gl.GetTexImage(GL_TEXTURE_2D, 0, GL_RGBA, GL_UNSIGNED_BYTE, held);
            assert_memory_equal(held, albedo->data, sv_image_bytes(albedo));
            assert_int_equal(level_width(1), mipmaps ? albedo->width / 2 : 0);
            bytes += sv_image_bytes(albedo);
            textured++;
        }
        assert_int_equal(sv_mesh_upload_bytes(&mesh), bytes);
        sv_mesh_upload_finish(&u);
        assert_int_equal(u.array, 0);
        sv_mesh_upload_finish(&u); /* as on a zeroed one */
    }
    assert_true(textured > 0);
    fixture_ok(sv_gl_check("uploading", &error), &error);
}

static void textures_of_any_size_have_all_levels(void **state)
{
    (void)state;
    static const int sizes[][3] = {{1, 1, 1}, {5, 3, 3}, {1, 64, 7}, {33, 2, 6}};
    struct sv_error error;
    static uint8_t grey[64 * 64 * 4];
    memset(grey, 128, sizeof grey);
    for (size_t k = 0; k < sizeof sizes / sizeof *sizes; k++)
        for (int mipmaps = 0; mipmaps < 2; mipmaps++) {
            unsigned name = sv_mesh_upload_texture(sizes[k][0], sizes[k][1], grey, mipmaps);
            int levels = mipmaps ? sizes[k][2] : 1;
            uint8_t last[4] = {0};
            gl.BindTexture(GL_TEXTURE_2D, name);
            assert_true(level_width(levels - 1) >= 1);
            assert_int_equal(level_width(levels), 0);
            if (mipmaps) {
                gl.GetTexImage(GL_TEXTURE_2D, levels - 1, GL_RGBA, GL_UNSIGNED_BYTE, last);
                for (int c = 0; c < 4; c++)
                    assert_in_range(last[c], 127, 129);
            }
            gl.DeleteTextures(1, &name);
        }
    fixture_ok(sv_gl_check("textures", &error), &error);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(what_was_uploaded_is_there),
                                       cmocka_unit_test(textures_of_any_size_have_all_levels)};
    return cmocka_run_group_tests(tests, setup, teardown);
}
