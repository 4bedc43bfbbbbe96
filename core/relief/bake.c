/* bake.c - sv_relief_from_mesh (build.h): a mesh drawn by GL against f, then reduced to texels.
 *
 * The picture's axes are the relief's: column along a, row along b, window depth 1 at the front and 0 at the
 * back (frames.h: reversed, cleared to 0), so that displ = d * range - back. It is drawn tile by tile, each a
 * whole number of texels, so that memory does not grow with the relief. Polygons are drawn from both sides,
 * as they are everywhere (core/tree/draw_mesh.c).
 *
 * A texel is reduced to the surface that most of its samples see: the one about their median displ (of two
 * equal halves the nearer one). Albedo, sky and normal are means over the samples within SAME_TEXELS of it,
 * or within cut where that is less; coverage counts all samples. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/gl/context.h"
#include "core/gl/functions.h"
#include "core/gl/program.h"
#include "core/gl/target.h"
#include "core/relief/build.h"
#include "core/tree/draw_mesh_upload.h"

enum { SAMPLES_MAX = 8, TILE_SIDE = 1024 /* samples; 20 MB, and few enough tiles */ };
/* Displ within which samples of one texel are one surface, in texels: a slope of 63 degrees spans this much
 * to either side of its middle. */
#define SAME_TEXELS 1.0
/* By how much the depth range is widened at both ends, so that what lies on an end is in. */
#define RANGE_MARGIN (1.0 / 4096)

enum { UNIFORM_CLIP, UNIFORM_TURN, UNIFORM_BASE, UNIFORM_CUTOFF };

struct bake {
    const struct sv_tree_mesh *mesh;
    const struct sv_relief_bake_options *options;
    struct sv_vec3 across, down, front; /* a / |a|^2, b / |b|^2, f */
    double back, range;                 /* displ = d * range - back */
    float turn[9];                      /* model to (a^, b^, f), column-major */
    float same;                         /* m */
    int tile;                           /* texels a side of a full tile */
    struct sv_mesh_upload upload;       /* textures: 0: the white one */
    GLuint white;
    struct sv_gl_target *target;
    struct sv_image color, normal, depth; /* of one tile */
};

static enum sv_status check(const struct sv_relief_bake_options *o, struct sv_error *error)
{
    if (o->samples < 1 || o->samples > SAMPLES_MAX)
        return sv_fail(error, SV_EINVAL, "samples", "is %d, must be 1 to %d", o->samples, SAMPLES_MAX);
    if (!(o->cut > 0))
        return sv_fail(error, SV_EINVAL, "cut", "is %g m, must be above 0 (infinite: never torn)", o->cut);
    double range = o->front_m + o->depth_m;
    if (!(range > 0 && isfinite(range) && isfinite(o->front_m)))
        return sv_fail(error, SV_EINVAL, "depth_m",
                       "is %g m with front_m %g m: together they must be above 0 and finite", o->depth_m,
                       o->front_m);
    return SV_OK;
}

static void set_geometry(struct bake *b, const struct sv_relief_frame *f)
{
    const struct sv_relief_bake_options *o = b->options;
    double side_a = sv_length(f->a), side_b = sv_length(f->b), range = o->front_m + o->depth_m;
    b->across = sv_scale(f->a, 1 / (side_a * side_a));
    b->down = sv_scale(f->b, 1 / (side_b * side_b));
    b->front = f->f;
    struct sv_vec3 axes[3] = {sv_scale(f->a, 1 / side_a), sv_scale(f->b, 1 / side_b), f->f};
    for (int k = 0; k < 3; k++) {
        b->turn[k] = (float)axes[k].x;
        b->turn[3 + k] = (float)axes[k].y;
        b->turn[6 + k] = (float)axes[k].z;
    }
    b->back = o->depth_m + RANGE_MARGIN * range;
    b->range = range * (1 + 2 * RANGE_MARGIN);
    b->same = fminf(o->cut, (float)(SAME_TEXELS * fmax(side_a, side_b)));
    int side = o->width > o->height ? o->width : o->height;
    b->tile = TILE_SIDE / o->samples < side ? TILE_SIDE / o->samples : side;
}

/* Compiled once a context: a bake of a small relief costs less than its shaders. */
static struct {
    unsigned generation; /* 0: none yet */
    GLuint plain, masked;
} programs;

static enum sv_status obtain_programs(struct sv_error *error)
{
    GLuint plain, masked;
    if (programs.generation == sv_gl_context_generation() && programs.generation)
        return SV_OK;
    enum sv_status status = sv_gl_program_create("relief_bake.vert", "relief_bake.frag", NULL, &plain, error);
    if (status)
        return status;
    status =
        sv_gl_program_create("relief_bake.vert", "relief_bake.frag", "#define MASKED 1\n", &masked, error);
    if (status) {
        gl.DeleteProgram(plain);
        return status;
    }
    programs.plain = plain;
    programs.masked = masked;
    programs.generation = sv_gl_context_generation();
    return SV_OK;
}

static enum sv_status prepare(struct bake *b, struct sv_error *error)
{
    static const uint8_t white[4] = {255, 255, 255, 255};
    int side = b->tile * b->options->samples;
    enum sv_status status = obtain_programs(error);
    if (!status)
        status =
            sv_gl_target_create(side, side, 1u << SV_LAYER_COLOR | 1u << SV_LAYER_NORMAL, &b->target, error);
    if (!status)
        status = sv_image_alloc(side, side, 4, SV_PIXEL_U8, &b->color, error);
    if (!status)
        status = sv_image_alloc(side, side, 3, SV_PIXEL_F32, &b->normal, error);
    if (!status)
        status = sv_image_alloc(side, side, 1, SV_PIXEL_F32, &b->depth, error);
    if (status)
        return status;
    sv_mesh_upload_init(b->mesh, false, &b->upload);
    b->white = sv_mesh_upload_texture(1, 1, white, false);
    return sv_gl_check("uploading a mesh to bake", error);
}

static void release(struct bake *b)
{
    sv_mesh_upload_finish(&b->upload);
    gl.DeleteTextures(1, &b->white);
    sv_gl_target_destroy(b->target);
    sv_image_free(&b->color);
    sv_image_free(&b->normal);
    sv_image_free(&b->depth);
}

static void set_row(struct sv_mat4 *m, int row, struct sv_vec3 v, double w)
{
    const double values[4] = {v.x, v.y, v.z, w};
    memcpy(m->m[row], values, sizeof values);
}

/* The tile whose first texel is (column, row): x to the right along a, y down along b. */
static void tile_clip(const struct bake *b, struct sv_vec3 origin, int column, int row, float out[16])
{
    struct sv_mat4 m;
    double s = 2.0 / b->tile;
    set_row(&m, 0, sv_scale(b->across, s), -s * (sv_dot(b->across, origin) + column) - 1);
    set_row(&m, 1, sv_scale(b->down, -s), s * (sv_dot(b->down, origin) + row) + 1);
    set_row(&m, 2, sv_scale(b->front, 1 / b->range), (b->back - sv_dot(b->front, origin)) / b->range);
    set_row(&m, 3, sv_vec3(0, 0, 0), 1);
    sv_mat4_to_float(&m, out);
}

static void draw(const struct bake *b, const float clip[16])
{
    gl.BindVertexArray(b->upload.array);
    gl.ActiveTexture(GL_TEXTURE0);
    for (int k = 0; k < b->mesh->material_count; k++) {
        const struct sv_tree_material *m = &b->mesh->materials[k];
        if (m->index_count == 0)
            continue;
        gl.UseProgram(m->masked && b->upload.textures[k] ? programs.masked : programs.plain);
        gl.BindTexture(GL_TEXTURE_2D, b->upload.textures[k] ? b->upload.textures[k] : b->white);
        gl.UniformMatrix4fv(UNIFORM_CLIP, 1, GL_FALSE, clip);
        gl.UniformMatrix3fv(UNIFORM_TURN, 1, GL_FALSE, b->turn);
        gl.Uniform4fv(UNIFORM_BASE, 1, m->base_color);
        gl.Uniform1f(UNIFORM_CUTOFF, m->alpha_cutoff);
        gl.DrawElements(GL_TRIANGLES, (GLsizei)m->index_count, GL_UNSIGNED_INT,
                        (const void *)((size_t)m->first_index * sizeof(uint32_t)));
    }
    gl.BindVertexArray(0);
}

static int by_value(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

/* Median of count >= 1 depths; of an even number the mean of the middle two where they are one surface, else
 * the nearer one. Sorts d. */
static float median(float *d, int count, float same)
{
    bool alike = d[0] == d[count - 1];
    for (int k = 1; alike && k < count; k++)
        alike = d[k] == d[0];
    if (!alike)
        qsort(d, (size_t)count, sizeof *d, by_value);
    float upper = d[count / 2], lower = d[(count - 1) / 2];
    return upper - lower <= same ? 0.5f * (upper + lower) : upper;
}

static int16_t to_short(double v)
{
    return (int16_t)lrint(sv_clamp(v, -1, 1) * INT16_MAX);
}

/* Means of the samples whose displ is within `same` of the middle. */
static void reduce_surface(const struct bake *b, size_t first, float middle, struct sv_relief *r,
                           size_t texel)
{
    int samples = b->options->samples, count = 0;
    double rgb[3] = {0}, n[3] = {0}, sky = 0;
    const float *depth = b->depth.data, *normal = b->normal.data;
    const uint8_t *color = b->color.data;
    for (int y = 0; y < samples; y++)
        for (int x = 0; x < samples; x++) {
            size_t k = first + (size_t)y * (size_t)b->depth.width + (size_t)x;
            float displ = (float)(depth[k] * b->range - b->back);
            if (!(depth[k] > 0) || fabsf(displ - middle) > b->same)
                continue;
            for (int e = 0; e < 3; e++) {
                rgb[e] += (double)sv_linear_from_srgb8[color[4 * k + (size_t)e]];
                n[e] += (double)normal[3 * k + (size_t)e];
            }
            sky += color[4 * k + 3];
            count++;
        }
    double size = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int e = 0; e < 3; e++) {
        r->color[texel][e] = sv_srgb8_from_linear((float)(rgb[e] / count));
        r->normal[texel][e] = to_short(size > 1e-6 ? n[e] / size : e == 2);
    }
    r->normal[texel][3] = to_short(sky / (255.0 * count));
}

static void reduce_texel(const struct bake *b, int i, int j, struct sv_relief *r, size_t texel)
{
    int samples = b->options->samples, count = 0;
    float displ[SAMPLES_MAX * SAMPLES_MAX];
    const float *depth = b->depth.data;
    size_t first = ((size_t)j * (size_t)b->depth.width + (size_t)i) * (size_t)samples;
    for (int y = 0; y < samples; y++)
        for (int x = 0; x < samples; x++) {
            float d = depth[first + (size_t)y * (size_t)b->depth.width + (size_t)x];
            if (d > 0)
                displ[count++] = (float)(d * b->range - b->back);
        }
    if (count == 0)
        return;
    float middle = median(displ, count, b->same);
    r->displ[texel] = middle;
    reduce_surface(b, first, middle, r, texel);
    r->color[texel][3] = (uint8_t)((255 * count + samples * samples / 2) / (samples * samples));
}

static enum sv_status bake_tile(struct bake *b, struct sv_relief *r, int column, int row,
                                struct sv_error *error)
{
    float clip[16];
    tile_clip(b, r->frame.origin, column, row, clip);
    sv_gl_target_begin(b->target);
    draw(b, clip);
    enum sv_status status = sv_gl_check("baking a relief", error);
    if (!status)
        status = sv_gl_target_read(b->target, SV_LAYER_COLOR, &b->color, error);
    if (!status)
        status = sv_gl_target_read(b->target, SV_LAYER_NORMAL, &b->normal, error);
    if (!status)
        status = sv_gl_target_read(b->target, SV_LAYER_DEPTH, &b->depth, error);
    if (status)
        return status;
    for (int j = 0; j < b->tile && row + j < r->height; j++)
        for (int i = 0; i < b->tile && column + i < r->width; i++)
            reduce_texel(b, i, j, r, (size_t)(row + j) * (size_t)r->width + (size_t)(column + i));
    return SV_OK;
}

enum sv_status sv_relief_from_mesh(const struct sv_tree_mesh *mesh, const struct sv_relief_frame *frame,
                                   const struct sv_relief_bake_options *options, struct sv_relief *relief,
                                   struct sv_error *error)
{
    struct sv_relief r = {0};
    struct bake b = {.mesh = mesh, .options = options};
    enum sv_status status = check(options, error);
    if (!status)
        status = sv_relief_frame_check(frame, error);
    if (!status)
        status = sv_relief_alloc(options->width, options->height, &r, error);
    if (status)
        return status;
    r.frame = *frame;
    r.cut = options->cut;
    set_geometry(&b, frame);
    sv_color_init();
    status = prepare(&b, error);
    for (int row = 0; !status && row < r.height; row += b.tile)
        for (int column = 0; !status && column < r.width; column += b.tile)
            status = bake_tile(&b, &r, column, row, error);
    release(&b);
    if (status) {
        sv_relief_finish(&r);
        return status;
    }
    sv_relief_measure(&r);
    *relief = r;
    return SV_OK;
}
