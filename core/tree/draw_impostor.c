/* draw_impostor.c - see draw_impostor.h.
 *
 * Level of detail: each tree names its mip level itself, from its size in the picture, so that a quad is as
 * sharp as its frame allows whatever its shape. A quad covers the texels of that level that hold anything and
 * half a texel more: the shader lets coverage fade to 0 there as if the frame stood on an empty border. A
 * tree smaller than the last level's texel is drawn larger and thinner, so that its share of the picture
 * stays right however small it is. */
#include "core/tree/draw_impostor.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/gl/context.h"
#include "core/gl/functions.h"
#include "core/gl/program.h"
#include "core/scene/id.h"
#include "core/tree/impostor.h"

enum {
    AT_PLACE,
    AT_CELL,
    AT_FRAME,
    AT_LIGHT_OF,
    AT_UP,
    AT_LEAF,
    AT_RIGHT,
    AT_TOP,
    AT_SUN,
    AT_ID,
    AT_LIGHT_PLACE,
    AT_LIGHT, /* and the next: a column of the light's grid each */
};            /* locations in tree_quad.vert */
enum { UNIT_ALBEDO = 0, UNIT_NORMAL = 1, UNIT_OPEN = 2 };
enum { LAST_LEVEL = SV_IMPOSTOR_LEVELS - 1 };

/* All atlases together stay below this many bytes: levels from the fine end are left out when species are
 * many. */
static const size_t ATLAS_BUDGET_BYTES = (size_t)256 << 20;

struct quad_vertex {
    float place[3]; /* eye-relative, m */
    float cell[2];  /* s, t in the frame's cell */
    float frame[4]; /* the cell's corner in the atlas, 0..1; layer; level */
    float light[4]; /* direction to the sun in the frame's axes; coverage factor */
    float up[4];    /* world up in the frame's axes (up, toward); texels a cell at that level; gain */
    float leaf[4];  /* impostor.h: translucency by colour */
    int16_t right[4], top[4]; /* the frame's axes in the world, unit * 32767 */
    int16_t sun[4];           /* direction to the sun in the model's axes, unit * 32767 */
    uint32_t id;
};

/* What there is besides where light is given. */
struct quad_light {
    float at[2]; /* column and row coordinate (struct sv_tree_light_axes) */
    struct sv_tree_light light;
};

struct species_quads {
    struct sv_impostor_frame *frames;        /* heap, owner's; NULL: not built */
    uint8_t *coverage;                       /* heap, owner's, SIDE x SIDE: what shade.h is made from */
    float (*scatter)[SV_IMPOSTOR_FRAMES][6]; /* heap, owner's: a row a level (impostor.h) */
    float translucency[4];
    int owner, layer;
    const struct sv_tree_mesh *mesh;
};

struct sv_quad_draw {
    int species_count, layers, first_level;
    struct species_quads *species;
    GLuint soft, soft_shade, hard; /* programs; soft_shade: made when first needed, as are lit and lights */
    GLuint albedo, normal, open, array, vertices, indices;
    GLuint lit, lights; /* array of quads with light, and what it reads besides */
    uint32_t room;      /* quads that the buffers hold */
};

/* ---- building ---- */

static enum sv_status obtain(const struct sv_tree_draw_species *species, struct sv_store *store,
                             struct sv_impostor *impostor, struct sv_error *error)
{
    void *data;
    size_t bytes;
    struct sv_error ignored;
    if (sv_store_get(store, SV_IMPOSTOR_KIND, species->key, &data, &bytes, &ignored) == SV_OK) {
        enum sv_status status = sv_impostor_load(data, bytes, impostor, &ignored);
        free(data);
        if (status == SV_OK || status == SV_ENOMEM)
            return status == SV_OK ? SV_OK : sv_fail(error, status, ignored.field, "%s", ignored.message);
    }
    enum sv_status status = sv_impostor_bake(species->mesh, impostor, error);
    if (status == SV_OK && store && sv_impostor_save(impostor, &data, &bytes, &ignored) == SV_OK) {
        sv_store_put(store, SV_IMPOSTOR_KIND, species->key, data, bytes, &ignored);
        free(data);
    }
    return status;
}

enum sv_status sv_tree_impostor_prepare(const struct sv_tree_draw_species *species, struct sv_store *store,
                                        struct sv_error *error)
{
    struct sv_impostor impostor = {0};
    sv_color_init();
    enum sv_status status = obtain(species, store, &impostor, error);
    sv_impostor_finish(&impostor);
    return status;
}

static size_t layer_bytes(int first_level)
{
    size_t bytes = 0;
    for (int k = first_level; k < SV_IMPOSTOR_LEVELS; k++)
        bytes += 3 * 4 * (size_t)(SV_IMPOSTOR_SIDE >> k) * (size_t)(SV_IMPOSTOR_SIDE >> k);
    return bytes;
}

static GLuint make_array(const struct sv_quad_draw *draw, GLenum format)
{
    GLuint name;
    int side = SV_IMPOSTOR_SIDE >> draw->first_level;
    gl.GenTextures(1, &name);
    gl.BindTexture(GL_TEXTURE_2D_ARRAY, name);
    gl.TexStorage3D(GL_TEXTURE_2D_ARRAY, SV_IMPOSTOR_LEVELS - draw->first_level, format, side, side,
                    draw->layers);
    gl.TexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_MIN_FILTER, GL_LINEAR_MIPMAP_NEAREST);
    gl.TexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    gl.TexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    gl.TexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    return name;
}

static void upload_levels(const struct sv_quad_draw *draw, int layer, const struct sv_impostor_levels *levels)
{
    for (int k = draw->first_level; k < SV_IMPOSTOR_LEVELS; k++) {
        int side = SV_IMPOSTOR_SIDE >> k, level = k - draw->first_level;
        gl.BindTexture(GL_TEXTURE_2D_ARRAY, draw->albedo);
        gl.TexSubImage3D(GL_TEXTURE_2D_ARRAY, level, 0, 0, layer, side, side, 1, GL_RGBA, GL_UNSIGNED_BYTE,
                         levels->albedo[k]);
        gl.BindTexture(GL_TEXTURE_2D_ARRAY, draw->normal);
        gl.TexSubImage3D(GL_TEXTURE_2D_ARRAY, level, 0, 0, layer, side, side, 1, GL_RGBA, GL_UNSIGNED_BYTE,
                         levels->normal[k]);
        gl.BindTexture(GL_TEXTURE_2D_ARRAY, draw->open);
        gl.TexSubImage3D(GL_TEXTURE_2D_ARRAY, level, 0, 0, layer, side, side, 1, GL_RGBA, GL_UNSIGNED_BYTE,
                         levels->open[k]);
    }
}

static enum sv_status build_species(const struct sv_quad_draw *draw,
                                    const struct sv_tree_draw_species *species, struct sv_store *store,
                                    struct species_quads *s, struct sv_error *error)
{
    struct sv_impostor impostor = {0};
    struct sv_impostor_levels levels = {{0}, {0}, {0}, NULL};
    enum sv_status status = obtain(species, store, &impostor, error);
    if (!status)
        status = sv_impostor_levels_init(&impostor, &levels, error);
    if (!status) {
        s->frames = malloc(sizeof impostor.frames);
        s->coverage = malloc((size_t)SV_IMPOSTOR_SIDE * SV_IMPOSTOR_SIDE);
        if (!s->frames || !s->coverage)
            status = sv_fail(error, SV_ENOMEM, "impostor", "no memory for %zu bytes", sizeof impostor.frames);
    }
    if (!status) {
        for (size_t k = 0; k < (size_t)SV_IMPOSTOR_SIDE * SV_IMPOSTOR_SIDE; k++)
            s->coverage[k] = impostor.albedo[4 * k + 3];
        memcpy(s->frames, impostor.frames, sizeof impostor.frames);
        memcpy(s->translucency, impostor.translucency, sizeof s->translucency);
        s->scatter = levels.scatter;
        levels.scatter = NULL;
        upload_levels(draw, s->layer, &levels);
    }
    sv_impostor_levels_finish(&levels);
    sv_impostor_finish(&impostor);
    return status;
}

/* Numbers the layers: one a mesh. */
static void plan_layers(struct sv_quad_draw *draw, const struct sv_tree_draw_species *species)
{
    for (int k = 0; k < draw->species_count; k++) {
        struct species_quads *s = &draw->species[k];
        s->owner = k;
        if (species[k].tree_count == 0)
            continue;
        s->mesh = species[k].mesh;
        for (int i = k - 1; i >= 0; i--)
            s->owner = draw->species[i].mesh == s->mesh ? i : s->owner;
        s->layer = s->owner == k ? draw->layers++ : draw->species[s->owner].layer;
    }
    while (draw->first_level < LAST_LEVEL - 3 &&
           (size_t)draw->layers * layer_bytes(draw->first_level) > ATLAS_BUDGET_BYTES)
        draw->first_level++;
}

static void set_vertex_attributes(const struct sv_quad_draw *draw)
{
    static const struct {
        GLint size;
        GLenum type;
        GLboolean normalized;
        size_t offset;
    } rows[] = {
        [AT_PLACE] = {3, GL_FLOAT, GL_FALSE, offsetof(struct quad_vertex, place)},
        [AT_CELL] = {2, GL_FLOAT, GL_FALSE, offsetof(struct quad_vertex, cell)},
        [AT_FRAME] = {4, GL_FLOAT, GL_FALSE, offsetof(struct quad_vertex, frame)},
        [AT_LIGHT_OF] = {4, GL_FLOAT, GL_FALSE, offsetof(struct quad_vertex, light)},
        [AT_UP] = {4, GL_FLOAT, GL_FALSE, offsetof(struct quad_vertex, up)},
        [AT_LEAF] = {4, GL_FLOAT, GL_FALSE, offsetof(struct quad_vertex, leaf)},
        [AT_RIGHT] = {3, GL_SHORT, GL_TRUE, offsetof(struct quad_vertex, right)},
        [AT_TOP] = {3, GL_SHORT, GL_TRUE, offsetof(struct quad_vertex, top)},
        [AT_SUN] = {3, GL_SHORT, GL_TRUE, offsetof(struct quad_vertex, sun)},
    };
    gl.BindBuffer(GL_ELEMENT_ARRAY_BUFFER, draw->indices);
    gl.BindBuffer(GL_ARRAY_BUFFER, draw->vertices);
    for (GLuint k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        gl.EnableVertexAttribArray(k);
        gl.VertexAttribPointer(k, rows[k].size, rows[k].type, rows[k].normalized, sizeof(struct quad_vertex),
                               (const void *)rows[k].offset);
    }
    gl.EnableVertexAttribArray(AT_ID);
    gl.VertexAttribIPointer(AT_ID, 1, GL_UNSIGNED_INT, sizeof(struct quad_vertex),
                            (const void *)offsetof(struct quad_vertex, id));
}

static void make_vertex_array(struct sv_quad_draw *draw)
{
    gl.GenVertexArrays(1, &draw->array);
    gl.GenBuffers(1, &draw->vertices);
    gl.GenBuffers(1, &draw->indices);
    gl.BindVertexArray(draw->array);
    set_vertex_attributes(draw);
    gl.BindVertexArray(0);
}

/* What drawing with light needs besides; made once. */
static enum sv_status make_lit(struct sv_quad_draw *draw, struct sv_error *error)
{
    if (draw->lit)
        return SV_OK;
    enum sv_status status = sv_gl_program_create("tree_quad.vert", "tree_quad.frag", "#define SHADE 1\n",
                                                 &draw->soft_shade, error);
    if (status)
        return status;
    gl.GenVertexArrays(1, &draw->lit);
    gl.GenBuffers(1, &draw->lights);
    gl.BindVertexArray(draw->lit);
    set_vertex_attributes(draw);
    gl.BindBuffer(GL_ARRAY_BUFFER, draw->lights);
    gl.EnableVertexAttribArray(AT_LIGHT_PLACE);
    gl.VertexAttribPointer(AT_LIGHT_PLACE, 2, GL_FLOAT, GL_FALSE, sizeof(struct quad_light),
                           (const void *)offsetof(struct quad_light, at));
    for (GLuint c = 0; c < SV_SHADE_COLUMNS; c++) {
        gl.EnableVertexAttribArray(AT_LIGHT + c);
        gl.VertexAttribPointer(AT_LIGHT + c, SV_SHADE_ROWS, GL_UNSIGNED_BYTE, GL_TRUE,
                               sizeof(struct quad_light),
                               (const void *)(offsetof(struct quad_light, light) + c * SV_SHADE_ROWS));
    }
    gl.BindVertexArray(0);
    return sv_gl_check("making lit tree impostors", error);
}

enum sv_status sv_quad_draw_create(const struct sv_tree_draw_species *species, int species_count,
                                   struct sv_store *store, struct sv_quad_draw **out, struct sv_error *error)
{
    struct sv_quad_draw *draw = calloc(1, sizeof *draw);
    if (draw)
        draw->species = calloc((size_t)species_count + 1, sizeof *draw->species);
    if (!draw || !draw->species) {
        free(draw);
        return sv_fail(error, SV_ENOMEM, "species", "no memory to draw %d species", species_count);
    }
    draw->species_count = species_count;
    plan_layers(draw, species);
    enum sv_status status =
        sv_gl_program_create("tree_quad.vert", "tree_quad.frag", NULL, &draw->soft, error);
    if (!status)
        status = sv_gl_program_create("tree_quad.vert", "tree_quad_hard.frag", "#define HARD 1\n",
                                      &draw->hard, error);
    if (status)
        goto fail;
    make_vertex_array(draw);
    if (draw->layers > 0) {
        draw->albedo = make_array(draw, GL_SRGB8_ALPHA8);
        draw->normal = make_array(draw, GL_RGBA8);
        draw->open = make_array(draw, GL_RGBA8);
    }
    for (int k = 0; !status && k < species_count; k++)
        if (draw->species[k].mesh && draw->species[k].owner == k)
            status = build_species(draw, &species[k], store, &draw->species[k], error);
    if (!status)
        status = sv_gl_check("uploading tree impostors", error);
    if (status)
        goto fail;
    *out = draw;
    return SV_OK;
fail:
    sv_quad_draw_destroy(draw);
    return status;
}

void sv_quad_draw_destroy(struct sv_quad_draw *draw)
{
    if (!draw)
        return;
    for (int k = 0; k < draw->species_count; k++) {
        free(draw->species[k].frames);
        free(draw->species[k].coverage);
        free(draw->species[k].scatter);
    }
    gl.DeleteTextures(1, &draw->albedo);
    gl.DeleteTextures(1, &draw->normal);
    gl.DeleteTextures(1, &draw->open);
    gl.DeleteVertexArrays(1, &draw->array);
    gl.DeleteVertexArrays(1, &draw->lit);
    gl.DeleteBuffers(1, &draw->lights);
    gl.DeleteBuffers(1, &draw->vertices);
    gl.DeleteBuffers(1, &draw->indices);
    gl.DeleteProgram(draw->soft);
    gl.DeleteProgram(draw->soft_shade);
    gl.DeleteProgram(draw->hard);
    free(draw->species);
    free(draw);
}

struct sv_shade_species sv_quad_draw_shade_species(const struct sv_quad_draw *draw, int species)
{
    const struct species_quads *s = &draw->species[species];
    if (!s->mesh)
        return (struct sv_shade_species){NULL, NULL, 0};
    const struct species_quads *owner = &draw->species[s->owner];
    return (struct sv_shade_species){owner->frames, owner->coverage, s->mesh->radius};
}

size_t sv_quad_draw_bytes(const struct sv_quad_draw *draw, int species)
{
    const struct species_quads *s = &draw->species[species];
    return s->mesh ? layer_bytes(draw->first_level) + sizeof(((struct sv_impostor *)0)->frames) : 0;
}

/* ---- drawing ---- */

/* What is the same for all trees of a view. */
struct view {
    struct sv_vec3 eye;
    float forward[3], to_sun[3];
    float focal_px, near_m;
    bool orthographic;
    int first_level;
};

static float dot3(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Model space to world axes: sv_rotate_clockwise with c, s at hand. */
static void turn(float c, float s, const float p[3], float out[3])
{
    out[0] = c * p[0] + s * p[1];
    out[1] = c * p[1] - s * p[0];
    out[2] = p[2];
}

struct detail {
    int level;
    float inflate; /* >= 1: sides of a tree below the last level's size are this much longer */
};

/* pixels: of the picture, a model unit. */
static struct detail choose_detail(const struct sv_impostor_frame *f, float pixels, int first_level)
{
    float texels_a_px = f->texels / fmaxf(pixels, 1e-12f);
    struct detail d = {first_level, 1};
    float side = exp2f((float)LAST_LEVEL + 0.5f);
    while (d.level < LAST_LEVEL && texels_a_px > exp2f((float)d.level + 0.5f))
        d.level++;
    if (texels_a_px > side)
        d.inflate = texels_a_px / side;
    return d;
}

/* The part of the cell that a quad covers, s or t: whole texels of the level, and half a texel around. */
static void cover(float lo, float hi, int level, float inflate, float out[2])
{
    float texels = (float)(SV_IMPOSTOR_CELL >> level);
    float a = (floorf(lo * texels) - 0.5f) / texels, b = (ceilf(hi * texels) + 0.5f) / texels;
    float middle = 0.5f * (a + b), half = 0.5f * (b - a) * inflate;
    out[0] = middle - half;
    out[1] = middle + half;
}

static void put_axis(const float v[3], int16_t out[4])
{
    for (int c = 0; c < 3; c++)
        out[c] = (int16_t)(32767.0f * v[c]);
    out[3] = 0;
}

/* By how much a quad is drawn wider, about the tree's axis: a crown is round, and seen from beside its frame
 * it does not get narrower, as a plane picture of it would. to_viewer: unit, model space. */
static float widen(const struct sv_impostor_frame *f, const float to_viewer[3])
{
    float beside = dot3(f->right, to_viewer);
    return 1 / sqrtf(fmaxf(1 - beside * beside, 0.5f));
}

static void put_corners(const struct sv_impostor_frame *f, const float foot[3], float h, float c, float s,
                        float wider, struct detail detail, struct quad_vertex *q)
{
    float axis = -dot3(f->origin, f->right) * f->texels / SV_IMPOSTOR_CELL;
    float cs[2], ct[2], edge_s[2], edge_t[2], origin[3], along_s[3], along_t[3];
    cover(f->s_min, f->s_max, detail.level, 1, cs);
    cover(f->t_min, f->t_max, detail.level, 1, ct);
    cover(f->s_min, f->s_max, detail.level, detail.inflate, edge_s);
    cover(f->t_min, f->t_max, detail.level, detail.inflate, edge_t);
    for (int k = 0; k < 2; k++)
        edge_s[k] = axis + (edge_s[k] - axis) * wider;
    turn(c, s, f->origin, origin);
    turn(c, s, f->along_s, along_s);
    turn(c, s, f->along_t, along_t);
    for (int k = 0; k < 4; k++) {
        int i = k & 1, j = k >> 1;
        for (int a = 0; a < 3; a++)
            q[k].place[a] = foot[a] + h * (origin[a] + edge_s[i] * along_s[a] + edge_t[j] * along_t[a]);
        q[k].cell[0] = cs[i];
        q[k].cell[1] = ct[j];
    }
}

/* Axes that normals are read in. Leaves show the viewer the side that faces him, wherever he stands, so the
 * mean of a texel's normals follows him: the frame's axes are turned, by the shortest way, until they face
 * the true viewer. Without this the sunlit share of a crown is off by up to 10 % between frames. right comes
 * in as the frame's own. */
static void face_viewer(const float to_viewer[3], float right[3], float up[3], float toward[3])
{
    float length = sqrtf(dot3(to_viewer, to_viewer)), off = 0, across = 0;
    for (int a = 0; a < 3; a++)
        toward[a] = length > 0 ? to_viewer[a] / length : a == 2;
    off = dot3(right, toward);
    for (int a = 0; a < 3; a++)
        up[a] = right[a] - off * toward[a];
    across = sqrtf(dot3(up, up));
    for (int a = 0; a < 3; a++)
        right[a] = across > 1e-3f ? up[a] / across : right[a];
    up[0] = toward[1] * right[2] - toward[2] * right[1];
    up[1] = toward[2] * right[0] - toward[0] * right[2];
    up[2] = toward[0] * right[1] - toward[1] * right[0];
}

/* Writes the four vertices of a tree; false when there is nothing to see. */
static bool put_quad(const struct view *view, const struct species_quads *s,
                     const struct species_quads *owner, const struct sv_tree *tree, struct quad_vertex *q)
{
    float h = tree->height_m, c = cosf(tree->rotation_rad), n = sinf(tree->rotation_rad);
    float foot[3] = {(float)(tree->x - view->eye.x), (float)(tree->y - view->eye.y),
                     (float)(tree->z - view->eye.z)};
    float middle[3] = {foot[0], foot[1], foot[2] + 0.5f * h}, to_eye[3], model[3];
    for (int a = 0; a < 3; a++)
        to_eye[a] = view->orthographic ? -view->forward[a] : -middle[a];
    turn(c, -n, to_eye, model);
    int index = sv_impostor_nearest(model[0], model[1], model[2]);
    const struct sv_impostor_frame *f = &owner->frames[index];
    if (!(f->s_min < f->s_max))
        return false;
    float depth = fmaxf(dot3(middle, view->forward), view->near_m);
    float pixels = h * view->focal_px / (view->orthographic ? 1 : depth);
    struct detail detail = choose_detail(f, pixels, view->first_level);
    float right[3], up[3], toward[3];
    turn(c, n, f->right, right);
    face_viewer(to_eye, right, up, toward);
    turn(c, -n, toward, model);
    put_corners(f, foot, h, c, n, widen(f, model), detail, q);
    q[0].frame[0] = (float)(index % SV_IMPOSTOR_GRID) / SV_IMPOSTOR_GRID;
    q[0].frame[1] = (float)(index / SV_IMPOSTOR_GRID) / SV_IMPOSTOR_GRID;
    q[0].frame[2] = (float)s->layer;
    q[0].frame[3] = (float)(detail.level - view->first_level);
    q[0].light[0] = dot3(view->to_sun, right);
    q[0].light[1] = dot3(view->to_sun, up);
    q[0].light[2] = dot3(view->to_sun, toward);
    q[0].light[3] = 1 / (detail.inflate * detail.inflate);
    q[0].up[0] = up[2];
    q[0].up[1] = toward[2];
    q[0].up[2] = (float)(SV_IMPOSTOR_CELL >> detail.level);
    q[0].up[3] = sv_impostor_gain(f->scatter, owner->scatter[detail.level][index], q[0].light);
    memcpy(q[0].leaf, owner->translucency, sizeof q[0].leaf);
    put_axis(right, q[0].right);
    put_axis(up, q[0].top);
    turn(c, -n, view->to_sun, model);
    put_axis(model, q[0].sun);
    q[0].id = SV_ID_TREE_FIRST + tree->number;
    for (int k = 1; k < 4; k++)
        memcpy(q[k].frame, q[0].frame, sizeof *q - offsetof(struct quad_vertex, frame));
    return true;
}

/* Indices for `room` quads, twice: in order, then in reverse. */
static enum sv_status make_room(struct sv_quad_draw *draw, uint32_t count, struct sv_error *error)
{
    if (draw->room >= count)
        return SV_OK;
    uint32_t room = 1024;
    while (room < count)
        room *= 2;
    uint32_t *indices = malloc(12 * (size_t)room * sizeof *indices);
    if (!indices)
        return sv_fail(error, SV_ENOMEM, "trees", "no memory to draw %u trees", count);
    static const uint32_t corner[6] = {0, 1, 2, 2, 1, 3};
    for (uint32_t k = 0; k < room; k++)
        for (uint32_t i = 0; i < 6; i++) {
            indices[6 * (size_t)k + i] = 4 * k + corner[i];
            indices[6 * (size_t)(2 * room - 1 - k) + i] = 4 * k + corner[i];
        }
    gl.BindVertexArray(draw->array);
    gl.BufferData(GL_ELEMENT_ARRAY_BUFFER, (GLsizeiptr)(12 * (size_t)room * sizeof *indices), indices,
                  GL_STATIC_DRAW);
    free(indices);
    draw->room = room;
    return sv_gl_check("making room for tree impostors", error);
}

/* Where the quad's corners lie on the tree's grid of light. */
static void put_light(const struct quad_vertex *q, const struct sv_tree *tree, struct sv_vec3 eye,
                      const struct sv_tree_light *light, const struct sv_tree_light_axes *axes,
                      struct quad_light *out)
{
    float foot[3] = {(float)(tree->x - eye.x), (float)(tree->y - eye.y), (float)(tree->z - eye.z)};
    for (int k = 0; k < 4; k++) {
        float p[3];
        for (int a = 0; a < 3; a++)
            p[a] = (q[k].place[a] - foot[a]) / tree->height_m;
        out[k].at[0] = dot3(axes->across, p) + axes->across[3];
        out[k].at[1] = dot3(axes->along, p) + axes->along[3];
        out[k].light = *light;
    }
}

static void *map_array(GLuint buffer, size_t bytes)
{
    gl.BindBuffer(GL_ARRAY_BUFFER, buffer);
    gl.BufferData(GL_ARRAY_BUFFER, (GLsizeiptr)bytes, NULL, GL_STREAM_DRAW);
    return gl.MapBufferRange(GL_ARRAY_BUFFER, 0, (GLsizeiptr)bytes,
                             GL_MAP_WRITE_BIT | GL_MAP_INVALIDATE_BUFFER_BIT);
}

static void unmap_array(GLuint buffer)
{
    gl.BindBuffer(GL_ARRAY_BUFFER, buffer);
    gl.UnmapBuffer(GL_ARRAY_BUFFER);
}

static struct view view_of(const struct sv_gl_frame *frame, int first_level)
{
    const struct sv_camera *camera = &frame->camera;
    const struct sv_vec3 sun = frame->light.to_sun;
    return (struct view){
        .eye = camera->eye,
        .forward = {(float)camera->forward.x, (float)camera->forward.y, (float)camera->forward.z},
        .to_sun = {(float)sun.x, (float)sun.y, (float)sun.z},
        .focal_px = (float)sv_camera_focal_px(camera),
        .near_m = (float)camera->near_m,
        .orthographic = camera->projection == SV_PROJECTION_ORTHOGRAPHIC,
        .first_level = first_level};
}

static enum sv_status fill_quads(struct sv_quad_draw *draw, const struct sv_gl_frame *frame,
                                 const struct sv_tree *trees, const struct sv_cull_entry *entries,
                                 uint32_t count, struct sv_tree_lights lights, uint32_t *quads,
                                 struct sv_error *error)
{
    struct view view = view_of(frame, draw->first_level);
    bool light = lights.of_tree != NULL;
    struct quad_vertex *q = map_array(draw->vertices, 4 * (size_t)count * sizeof *q);
    struct quad_light *l = light ? map_array(draw->lights, 4 * (size_t)count * sizeof *l) : NULL;
    uint32_t made = 0;
    for (uint32_t k = 0; q && (l || !light) && k < count; k++) {
        uint32_t index = entries[k].tree;
        const struct sv_tree *tree = &trees[index];
        const struct species_quads *s = &draw->species[tree->species];
        size_t at = 4 * (size_t)made;
        if (!s->mesh || !put_quad(&view, s, &draw->species[s->owner], tree, q + at))
            continue;
        if (light)
            put_light(q + at, tree, view.eye, &lights.of_tree[index], &lights.of_species[tree->species],
                      l + at);
        made++;
    }
    if (q)
        unmap_array(draw->vertices);
    if (l)
        unmap_array(draw->lights);
    if (!q || (light && !l))
        return sv_fail(error, SV_ENOMEM, "trees", "no memory to draw %u trees", count);
    *quads = made;
    return SV_OK;
}

/* Colour, farthest first, tested against depth but leaving it. */
static void draw_soft(GLuint program, uint32_t quads)
{
    gl.UseProgram(program);
    gl.Enablei(GL_BLEND, 0);
    gl.BlendFunc(GL_ONE, GL_ONE_MINUS_SRC_ALPHA);
    gl.ColorMaski(1, GL_FALSE, GL_FALSE, GL_FALSE, GL_FALSE);
    gl.ColorMaski(2, GL_FALSE, GL_FALSE, GL_FALSE, GL_FALSE);
    gl.DepthMask(GL_FALSE);
    gl.DrawElements(GL_TRIANGLES, (GLsizei)(6 * quads), GL_UNSIGNED_INT, NULL);
    gl.Disablei(GL_BLEND, 0);
    gl.DepthMask(GL_TRUE);
    gl.ColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
}

/* Depth, id and normal, nearest first. */
static void draw_hard(const struct sv_quad_draw *draw, uint32_t quads)
{
    size_t first = 6 * (size_t)(2 * draw->room - quads);
    gl.UseProgram(draw->hard);
    gl.ColorMaski(0, GL_FALSE, GL_FALSE, GL_FALSE, GL_FALSE);
    gl.DrawElements(GL_TRIANGLES, (GLsizei)(6 * quads), GL_UNSIGNED_INT,
                    (const void *)(first * sizeof(uint32_t)));
    gl.ColorMaski(0, GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
}

enum sv_status sv_quad_draw_trees(struct sv_quad_draw *draw, const struct sv_gl_frame *frame,
                                  const struct sv_tree *trees, const struct sv_cull_entry *entries,
                                  uint32_t count, bool soft_only, struct sv_tree_lights lights,
                                  struct sv_error *error)
{
    if (count == 0)
        return SV_OK;
    uint32_t quads = 0;
    bool light = lights.of_tree && lights.of_species;
    if (!light)
        lights = (struct sv_tree_lights){NULL, NULL};
    enum sv_status status = light ? make_lit(draw, error) : SV_OK;
    if (!status)
        status = make_room(draw, count, error);
    if (!status)
        status = fill_quads(draw, frame, trees, entries, count, lights, &quads, error);
    if (status || quads == 0)
        return status;
    GLint color = GL_NONE;
    gl.GetIntegerv(GL_DRAW_BUFFER0, &color);
    gl.Disable(GL_CULL_FACE);
    gl.BindVertexArray(light ? draw->lit : draw->array);
    gl.ActiveTexture(GL_TEXTURE0 + UNIT_OPEN);
    gl.BindTexture(GL_TEXTURE_2D_ARRAY, draw->open);
    gl.ActiveTexture(GL_TEXTURE0 + UNIT_NORMAL);
    gl.BindTexture(GL_TEXTURE_2D_ARRAY, draw->normal);
    gl.ActiveTexture(GL_TEXTURE0 + UNIT_ALBEDO);
    gl.BindTexture(GL_TEXTURE_2D_ARRAY, draw->albedo);
    if (color != GL_NONE)
        draw_soft(light ? draw->soft_shade : draw->soft, quads);
    if (!soft_only)
        draw_hard(draw, quads);
    gl.BindVertexArray(0);
    return sv_gl_check("drawing tree impostors", error);
}
