/* draw_mesh.c - see draw_mesh.h.
 *
 * The list comes nearest first over all species. It is cut into groups of 8, 16, 32 ... trees; inside a group
 * trees are gathered by species and drawn with one call a material. So what hides most is drawn first, and
 * the number of calls grows with the logarithm of the count. Alpha and colour come from level 0 of the
 * texture: exactly the rule of mesh.h, which the ray-cast truth follows too (supersampling, not mip levels,
 * makes it smooth). */
#include "core/tree/draw_mesh.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "core/gl/context.h"
#include "core/gl/functions.h"
#include "core/gl/program.h"
#include "core/tree/draw_mesh_upload.h"

enum { GROUP_FIRST = 8 };
enum {
    AT_PLACE = SV_MESH_AT_INSTANCE,
    AT_TURN,
    AT_ID,
    AT_LIGHT, /* and the next: a column of the light's grid each */
};            /* locations in tree_mesh.vert */
enum { UNIFORM_BASE, UNIFORM_LEAF, UNIFORM_ACROSS, UNIFORM_ALONG }; /* locations in tree_mesh.frag, .vert */
enum { PROGRAM_PLAIN, PROGRAM_MASKED, PROGRAM_PLAIN_SHADE, PROGRAM_MASKED_SHADE, PROGRAMS };
enum { UNIT_ALBEDO = 0 };

/* What the vertex shader needs to know of a tree. */
struct instance {
    float place[4]; /* eye-relative foot, m; height, m */
    float turn[2];  /* cos, sin of the rotation */
    uint32_t id, reserved;
};

_Static_assert(SV_SHADE_COLUMNS == 2 && SV_SHADE_ROWS == 4 && sizeof(struct sv_tree_light) == 8,
               "tree_light.glsl reads two columns of four");

struct species_mesh {
    const struct sv_tree_mesh *mesh; /* NULL: not built */
    int owner;                       /* index of the species that owns the GL names */
    struct sv_mesh_upload upload;    /* textures: 0: the white one */
};

struct sv_mesh_draw {
    int species_count;
    uint32_t id_first;
    struct species_mesh *species;
    GLuint programs[PROGRAMS]; /* those of shade are made when first needed */
    GLuint white, instances, lights;
    struct instance *staging;            /* heap */
    struct sv_tree_light *light_staging; /* heap, NULL until light is given */
    uint32_t room, light_room;
};

static void attribute(GLuint at, GLint size, GLenum type, GLboolean normalized, size_t stride, size_t offset)
{
    gl.EnableVertexAttribArray(at);
    gl.VertexAttribPointer(at, size, type, normalized, (GLsizei)stride, (const void *)offset);
}

static void set_instance_attributes(const struct sv_mesh_draw *draw, GLuint array)
{
    gl.BindVertexArray(array);
    gl.BindBuffer(GL_ARRAY_BUFFER, draw->instances);
    attribute(AT_PLACE, 4, GL_FLOAT, GL_FALSE, sizeof(struct instance), offsetof(struct instance, place));
    attribute(AT_TURN, 2, GL_FLOAT, GL_FALSE, sizeof(struct instance), offsetof(struct instance, turn));
    gl.EnableVertexAttribArray(AT_ID);
    gl.VertexAttribIPointer(AT_ID, 1, GL_UNSIGNED_INT, sizeof(struct instance),
                            (const void *)offsetof(struct instance, id));
    for (GLuint at = AT_PLACE; at <= AT_LIGHT + 1; at++)
        gl.VertexAttribDivisor(at, 1);
    gl.BindVertexArray(0);
}

static int find_owner(const struct sv_mesh_draw *draw, int k)
{
    for (int i = 0; i < k; i++)
        if (draw->species[i].mesh == draw->species[k].mesh)
            return i;
    return k;
}

static enum sv_status make_programs(struct sv_mesh_draw *draw, int first, int last, struct sv_error *error)
{
    static const char *const defines[PROGRAMS] = {
        [PROGRAM_MASKED] = "#define MASKED 1\n",
        [PROGRAM_PLAIN_SHADE] = "#define SHADE 1\n",
        [PROGRAM_MASKED_SHADE] = "#define MASKED 1\n#define SHADE 1\n",
    };
    enum sv_status status = SV_OK;
    for (int k = first; !status && k <= last; k++)
        if (!draw->programs[k])
            status = sv_gl_program_create("tree_mesh.vert", "tree_mesh.frag", defines[k], &draw->programs[k],
                                          error);
    return status;
}

enum sv_status sv_mesh_draw_create(const struct sv_tree_draw_species *species, int species_count,
                                   uint32_t id_first, struct sv_mesh_draw **out, struct sv_error *error)
{
    static const uint8_t white[4] = {255, 255, 255, 255};
    struct sv_mesh_draw *draw = calloc(1, sizeof *draw);
    if (draw)
        draw->species = calloc((size_t)species_count + 1, sizeof *draw->species);
    if (!draw || !draw->species) {
        free(draw);
        return sv_fail(error, SV_ENOMEM, "species", "no memory to draw %d species", species_count);
    }
    draw->species_count = species_count;
    draw->id_first = id_first;
    enum sv_status status = make_programs(draw, PROGRAM_PLAIN, PROGRAM_MASKED, error);
    if (status)
        goto fail;
    draw->white = sv_mesh_upload_texture(1, 1, white, false);
    gl.GenBuffers(1, &draw->instances);
    gl.GenBuffers(1, &draw->lights);
    for (int k = 0; k < species_count; k++) {
        if (species[k].tree_count == 0)
            continue;
        draw->species[k].mesh = species[k].mesh;
        draw->species[k].owner = find_owner(draw, k);
        if (draw->species[k].owner != k)
            continue;
        sv_mesh_upload_init(species[k].mesh, false, &draw->species[k].upload);
        set_instance_attributes(draw, draw->species[k].upload.array);
    }
    status = sv_gl_check("uploading tree meshes", error);
    if (status)
        goto fail;
    *out = draw;
    return SV_OK;
fail:
    sv_mesh_draw_destroy(draw);
    return status;
}

void sv_mesh_draw_destroy(struct sv_mesh_draw *draw)
{
    if (!draw)
        return;
    for (int k = 0; k < draw->species_count; k++)
        sv_mesh_upload_finish(&draw->species[k].upload);
    gl.DeleteTextures(1, &draw->white);
    gl.DeleteBuffers(1, &draw->instances);
    gl.DeleteBuffers(1, &draw->lights);
    for (int k = 0; k < PROGRAMS; k++)
        gl.DeleteProgram(draw->programs[k]);
    free(draw->staging);
    free(draw->light_staging);
    free(draw->species);
    free(draw);
}

static void put_instance(struct instance *i, const struct sv_tree *tree, struct sv_vec3 eye,
                         uint32_t id_first)
{
    i->place[0] = (float)(tree->x - eye.x);
    i->place[1] = (float)(tree->y - eye.y);
    i->place[2] = (float)(tree->z - eye.z);
    i->place[3] = tree->height_m;
    i->turn[0] = cosf(tree->rotation_rad);
    i->turn[1] = sinf(tree->rotation_rad);
    i->id = id_first + tree->number;
    i->reserved = 0;
}

/* axes NULL: no light is given. */
static void draw_run(const struct sv_mesh_draw *draw, const struct species_mesh *s,
                     const struct sv_tree_light_axes *axes, uint32_t first, uint32_t count)
{
    gl.BindVertexArray(s->upload.array);
    for (int m = 0; m < s->mesh->material_count; m++) {
        const struct sv_tree_material *material = &s->mesh->materials[m];
        if (material->index_count == 0)
            continue;
        bool masked = material->masked && s->upload.textures[m];
        gl.UseProgram(draw->programs[(axes ? PROGRAM_PLAIN_SHADE : PROGRAM_PLAIN) + masked]);
        gl.BindTexture(GL_TEXTURE_2D, s->upload.textures[m] ? s->upload.textures[m] : draw->white);
        gl.Uniform4fv(UNIFORM_BASE, 1, material->base_color);
        gl.Uniform2f(UNIFORM_LEAF, material->alpha_cutoff, material->is_leaf ? material->translucency : 0);
        if (axes) {
            gl.Uniform4fv(UNIFORM_ACROSS, 1, axes->across);
            gl.Uniform4fv(UNIFORM_ALONG, 1, axes->along);
        }
        gl.DrawElementsInstancedBaseInstance(GL_TRIANGLES, (GLsizei)material->index_count, GL_UNSIGNED_INT,
                                             (const void *)((size_t)material->first_index * sizeof(uint32_t)),
                                             (GLsizei)count, first);
    }
}

/* Where each species' trees of the group entries[0 .. count) begin in the staging: counting sort, order kept.
 */
static void draw_group(const struct sv_mesh_draw *draw, const struct sv_tree *trees,
                       const struct sv_tree_light_axes *axes, const struct sv_cull_entry *entries,
                       uint32_t count, uint32_t base)
{
    uint32_t at = base;
    for (int k = 0; k < draw->species_count; k++) {
        const struct species_mesh *s = &draw->species[k];
        uint32_t run = 0;
        for (uint32_t i = 0; i < count; i++)
            run += trees[entries[i].tree].species == k;
        if (run && s->mesh)
            draw_run(draw, &draw->species[s->owner], axes ? &axes[k] : NULL, at, run);
        at += run;
    }
}

static void stage_group(struct sv_mesh_draw *draw, const struct sv_tree *trees,
                        const struct sv_tree_light *lights, const struct sv_cull_entry *entries,
                        uint32_t count, uint32_t base, struct sv_vec3 eye)
{
    uint32_t at = base;
    for (int k = 0; k < draw->species_count; k++)
        for (uint32_t i = 0; i < count; i++) {
            uint32_t tree = entries[i].tree;
            if (trees[tree].species != k)
                continue;
            put_instance(&draw->staging[at], &trees[tree], eye, draw->id_first);
            if (lights)
                draw->light_staging[at] = lights[tree];
            at++;
        }
}

static uint32_t group_size(uint32_t base, uint32_t count)
{
    uint32_t size = base + GROUP_FIRST; /* doubles what came before */
    return size < count - base ? size : count - base;
}

static enum sv_status make_room(struct sv_mesh_draw *draw, uint32_t count, bool light, struct sv_error *error)
{
    if (draw->room < count) {
        struct instance *grown = realloc(draw->staging, count * sizeof *grown);
        if (!grown)
            return sv_fail(error, SV_ENOMEM, "trees", "no memory for %u instances", count);
        draw->staging = grown;
        draw->room = count;
    }
    if (light && draw->light_room < count) {
        struct sv_tree_light *grown = realloc(draw->light_staging, count * sizeof *grown);
        if (!grown)
            return sv_fail(error, SV_ENOMEM, "trees", "no memory for the light on %u instances", count);
        draw->light_staging = grown;
        draw->light_room = count;
    }
    return SV_OK;
}

static void upload_instances(const struct sv_mesh_draw *draw, uint32_t count, bool light)
{
    gl.BindBuffer(GL_ARRAY_BUFFER, draw->instances);
    gl.BufferData(GL_ARRAY_BUFFER, (GLsizeiptr)(count * sizeof *draw->staging), draw->staging,
                  GL_STREAM_DRAW);
    if (!light)
        return;
    gl.BindBuffer(GL_ARRAY_BUFFER, draw->lights);
    gl.BufferData(GL_ARRAY_BUFFER, (GLsizeiptr)(count * sizeof *draw->light_staging), draw->light_staging,
                  GL_STREAM_DRAW);
}

/* Vertex arrays read light only while there is some: drawing without is left as it was. */
static void enable_light(struct sv_mesh_draw *draw)
{
    for (int k = 0; k < draw->species_count; k++) {
        const struct species_mesh *s = &draw->species[k];
        if (!s->mesh || s->owner != k)
            continue;
        gl.BindVertexArray(s->upload.array);
        gl.BindBuffer(GL_ARRAY_BUFFER, draw->lights);
        for (GLuint c = 0; c < SV_SHADE_COLUMNS; c++)
            attribute(AT_LIGHT + c, SV_SHADE_ROWS, GL_UNSIGNED_BYTE, GL_TRUE, sizeof(struct sv_tree_light),
                      c * SV_SHADE_ROWS);
    }
}

static void disable_light(const struct sv_mesh_draw *draw)
{
    for (int k = 0; k < draw->species_count; k++) {
        if (!draw->species[k].upload.array)
            continue;
        gl.BindVertexArray(draw->species[k].upload.array);
        for (GLuint c = 0; c < SV_SHADE_COLUMNS; c++)
            gl.DisableVertexAttribArray(AT_LIGHT + c);
    }
}

enum sv_status sv_mesh_draw_trees(struct sv_mesh_draw *draw, const struct sv_gl_frame *frame,
                                  const struct sv_tree *trees, const struct sv_cull_entry *entries,
                                  uint32_t count, struct sv_tree_lights lights, struct sv_error *error)
{
    if (count == 0)
        return SV_OK;
    bool light = lights.of_tree && lights.of_species;
    enum sv_status status = make_room(draw, count, light, error);
    if (!status && light)
        status = make_programs(draw, PROGRAM_PLAIN_SHADE, PROGRAM_MASKED_SHADE, error);
    if (status)
        return status;
    const struct sv_tree_light *of_tree = light ? lights.of_tree : NULL;
    for (uint32_t base = 0; base < count; base += group_size(base, count))
        stage_group(draw, trees, of_tree, entries + base, group_size(base, count), base, frame->camera.eye);
    upload_instances(draw, count, light);
    if (light)
        enable_light(draw);
    gl.Disable(GL_CULL_FACE);
    gl.ActiveTexture(GL_TEXTURE0 + UNIT_ALBEDO);
    for (uint32_t base = 0; base < count; base += group_size(base, count))
        draw_group(draw, trees, light ? lights.of_species : NULL, entries + base, group_size(base, count),
                   base);
    if (light)
        disable_light(draw);
    gl.BindVertexArray(0);
    return sv_gl_check("drawing tree polygons", error);
}
