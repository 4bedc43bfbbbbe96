/* draw_cloud.c - see draw_cloud.h.
 *
 * The order of a tree's planes matters: each species has, for each of BINS directions to the viewer, the list
 * of their parts (cloud_order.h) from the nearest to the farthest, as indices; the bin on the other side has
 * them from the farthest to the nearest. For the hard pass the list of trees is cut into groups of 8, 16, 32
 * ... (as in draw_mesh.c); in a group, trees of one species that are seen from one bin are one instanced
 * call. */
#include "core/tree/draw_cloud.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/base/vec.h"
#include "core/gl/context.h"
#include "core/gl/program.h"
#include "core/scene/id.h"
#include "core/tree/draw_cloud_private.h"

    enum {
        GROUP_FIRST = 8
    };

/* Trees of fewer pixels are drawn by whole planes: a third of the triangles; 8 levels of 255 darker from 60
 * degrees above, which is why no more are. */
static const double WHOLE_PX = 12;

/* Cosine between a plane and the view below which it is left out: its texels would be drawn 20 times narrower
 * than they are high. What it shows is missed in the picture as it were in the tree: 0.1, 0.2 and 0.3 take 0
 * to 4 % more error each, and hardly less time (forest_fig4, three trees). */
static const float EDGE_ON = 0.05f;

/* ---- life ---- */

static void make_bins(struct sv_cloud_draw *draw)
{
    for (int k = 0; k < BINS; k++) {
        double z = 1 - (2 * k + 1.0) / BINS, across = sqrt(1 - z * z), a = k * 2.39996322972865332;
        draw->bins[k][0] = (float)(across * cos(a));
        draw->bins[k][1] = (float)(across * sin(a));
        draw->bins[k][2] = (float)z;
    }
}

enum sv_status sv_cloud_draw_create(const struct sv_tree_draw_species *species, int species_count,
                                    struct sv_store *store, const struct sv_cloud_options *options,
                                    struct sv_cloud_draw **out, struct sv_error *error)
{
    struct sv_cloud_draw *draw = calloc(1, sizeof *draw);
    if (draw) {
        draw->species = calloc((size_t)species_count + 1, sizeof *draw->species);
        draw->counts = calloc((size_t)species_count * KEYS + 1, sizeof *draw->counts);
    }
    if (!draw || !draw->species || !draw->counts) {
        sv_cloud_draw_destroy(draw);
        return sv_fail(error, SV_ENOMEM, "species", "no memory to draw %d species", species_count);
    }
    sv_color_init();
    draw->options = *options;
    draw->store = store;
    draw->species_count = species_count;
    make_bins(draw);
    for (int k = 0; k < species_count; k++) {
        draw->species[k].of = species[k];
        draw->species[k].owner = k;
        for (int i = k - 1; i >= 0; i--)
            if (species[i].tree_count > 0 && species[i].mesh == species[k].mesh)
                draw->species[k].owner = i;
    }
    gl.GenBuffers(1, &draw->instances);
    gl.GenBuffers(1, &draw->lights);
    enum sv_status status = sv_gl_check("making buffers for billboard clouds", error);
    if (status)
        sv_cloud_draw_destroy(draw);
    else
        *out = draw;
    return status;
}

void sv_cloud_draw_destroy(struct sv_cloud_draw *draw)
{
    if (!draw)
        return;
    for (int k = 0; draw->species && k < draw->species_count; k++) {
        sv_tree_cloud_finish(&draw->species[k].cloud);
        for (int form = 0; form < SV_CLOUD_FORM_COUNT; form++) {
            struct form_species *f = &draw->species[k].forms[form];
            gl.DeleteTextures(SV_CLOUD_TEXTURES_MAX, f->textures.name);
            for (int cut = 0; cut < CUTS; cut++) {
                gl.DeleteVertexArrays(1, &f->planes[cut].array);
                gl.DeleteBuffers(1, &f->planes[cut].vertices);
                gl.DeleteBuffers(1, &f->planes[cut].indices);
            }
        }
    }
    for (int form = 0; form < SV_CLOUD_FORM_COUNT; form++)
        for (int k = 0; k < PASSES * 2; k++)
            gl.DeleteProgram(draw->programs[form][k / 2][k % 2]);
    gl.DeleteBuffers(1, &draw->instances);
    gl.DeleteBuffers(1, &draw->lights);
    free(draw->species);
    free(draw->counts);
    free(draw->staging);
    free(draw->light_staging);
    free(draw->keys);
    free(draw->scratch);
    free(draw);
}

enum sv_status sv_cloud_draw_build(struct sv_cloud_draw *draw, int species, enum sv_cloud_form form,
                                   struct sv_error *error)
{
    return sv_cloud_build_form(draw, &draw->species[draw->species[species].owner], form, error);
}

size_t sv_cloud_draw_bytes(const struct sv_cloud_draw *draw, int species, enum sv_cloud_form form)
{
    const struct form_species *f = &draw->species[draw->species[species].owner].forms[form];
    return f->built ? f->bytes : 0;
}

const struct sv_tree_cloud *sv_cloud_draw_cloud(const struct sv_cloud_draw *draw, int species)
{
    const struct cloud_species *s = &draw->species[draw->species[species].owner];
    return s->fitted ? &s->cloud : NULL;
}

/* ---- drawing ---- */

static enum sv_status make_program(struct sv_cloud_draw *draw, enum sv_cloud_form form, enum pass pass,
                                   bool light, struct sv_error *error)
{
    static const char *const of_pass[PASSES] = {"", "#define SOFT 1\n", "#define HARD 1\n"};
    const struct sv_cloud_form_row *row = &sv_cloud_forms[form];
    char defines[512] = "";
    if (draw->programs[form][pass][light])
        return SV_OK;
    if (light)
        strcat(defines, "#define SHADE 1\n");
    strcat(defines, of_pass[pass]);
    if (row->defines)
        strncat(defines, row->defines, sizeof defines - strlen(defines) - 1);
    return sv_gl_program_create("tree_cloud.vert", row->fragment, defines, &draw->programs[form][pass][light],
                                error);
}

static enum sv_status make_room(struct sv_cloud_draw *draw, uint32_t count, struct sv_error *error)
{
    if (draw->room >= count)
        return SV_OK;
    free(draw->staging);
    free(draw->light_staging);
    free(draw->keys);
    free(draw->scratch);
    draw->staging = malloc(count * sizeof *draw->staging);
    draw->light_staging = malloc(count * sizeof *draw->light_staging);
    draw->keys = malloc(count * sizeof *draw->keys);
    draw->scratch = malloc(count * sizeof *draw->scratch);
    draw->room = draw->staging && draw->light_staging && draw->keys && draw->scratch ? count : 0;
    if (draw->room)
        return SV_OK;
    return sv_fail(error, SV_ENOMEM, "trees", "no memory for %u trees", count);
}

static float dot3(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static int bin_of(const struct sv_cloud_draw *draw, const float d[3])
{
    int best = 0;
    float most = -INFINITY;
    for (int k = 0; k < BINS; k++) {
        float facing = dot3(draw->bins[k], d);
        best = facing > most ? k : best;
        most = facing > most ? facing : most;
    }
    return best;
}

/* A direction of the world in the tree's own axes. */
static void turn_back(const struct sv_tree *tree, struct sv_vec3 v, float d[3])
{
    double c = cos((double)tree->rotation_rad), s = sin((double)tree->rotation_rad);
    d[0] = (float)(c * v.x - s * v.y);
    d[1] = (float)(c * v.y + s * v.x);
    d[2] = (float)v.z;
}

/* Direction to the viewer in the tree's own axes; not unit. */
static void model_view(const struct sv_camera *camera, const struct sv_tree *tree, float d[3])
{
    struct sv_vec3 middle = sv_vec3(tree->x, tree->y, tree->z + 0.5 * (double)tree->height_m);
    bool orthographic = camera->projection == SV_PROJECTION_ORTHOGRAPHIC;
    turn_back(tree, orthographic ? sv_scale(camera->forward, -1) : sv_sub(camera->eye, middle), d);
}

static void put_instance(struct instance *i, const struct sv_tree *tree, struct sv_vec3 eye)
{
    i->place[0] = (float)(tree->x - eye.x);
    i->place[1] = (float)(tree->y - eye.y);
    i->place[2] = (float)(tree->z - eye.z);
    i->place[3] = tree->height_m;
    i->turn[0] = cosf(tree->rotation_rad);
    i->turn[1] = sinf(tree->rotation_rad);
    i->id = SV_ID_TREE_FIRST + tree->number;
}

/* What is drawn, and where it is staged. */
struct batch {
    enum sv_cloud_form form;
    const struct sv_camera *camera;
    struct sv_vec3 to_sun;
    const struct sv_tree *trees;
    const struct sv_cull_entry *entries; /* nearest first */
    uint32_t count;
    struct sv_tree_lights lights; /* of_tree NULL: none */
};

static void put_shift(const struct sv_cloud_draw *draw, const struct batch *b, const struct sv_tree *tree,
                      struct sv_cloud_shift *shift)
{
    const struct cloud_species *s = &draw->species[draw->species[tree->species].owner];
    float view[3], sun[3];
    model_view(b->camera, tree, view);
    turn_back(tree, b->to_sun, sun);
    *shift = sv_cloud_light_shift(&s->light, view, sun);
}

static void stage(struct sv_cloud_draw *draw, const struct batch *b, uint32_t entry, uint32_t at,
                  uint32_t key)
{
    uint32_t tree = b->entries[entry].tree;
    draw->keys[at] = key;
    put_instance(&draw->staging[at], &b->trees[tree], b->camera->eye);
    put_shift(draw, b, &b->trees[tree], &draw->staging[at].shift);
    if (b->lights.of_tree)
        draw->light_staging[at] = b->lights.of_tree[tree];
}

/* Species and bin of an entry; side -1: planes from the farthest on. */
static uint32_t key_of(const struct sv_cloud_draw *draw, const struct batch *b, uint32_t entry, float side)
{
    const struct sv_tree *tree = &b->trees[b->entries[entry].tree];
    float d[3];
    model_view(b->camera, tree, d);
    for (int c = 0; c < 3; c++)
        d[c] *= side;
    uint32_t cut = sv_cull_height_px(b->camera, tree) < WHOLE_PX ? WHOLE : CUT;
    return tree->species * (uint32_t)KEYS + cut * BINS + (uint32_t)bin_of(draw, d);
}

/* Stages entries first .. first + count sorted by key, order kept within one, from `at` on. */
static void stage_group(struct sv_cloud_draw *draw, const struct batch *b, uint32_t first, uint32_t count,
                        uint32_t at)
{
    uint32_t key_count = (uint32_t)draw->species_count * KEYS;
    memset(draw->counts, 0, (key_count + 1) * sizeof *draw->counts);
    for (uint32_t i = 0; i < count; i++) {
        draw->scratch[i] = key_of(draw, b, first + i, 1);
        draw->counts[draw->scratch[i] + 1]++;
    }
    for (uint32_t k = 0; k < key_count; k++)
        draw->counts[k + 1] += draw->counts[k];
    for (uint32_t i = 0; i < count; i++)
        stage(draw, b, first + i, at + draw->counts[draw->scratch[i]]++, draw->scratch[i]);
}

static uint32_t group_size(uint32_t base, uint32_t count)
{
    uint32_t size = base + GROUP_FIRST; /* doubles what came before */
    return size < count - base ? size : count - base;
}

/* Nearest first, in groups, from `at` on. */
static void stage_near(struct sv_cloud_draw *draw, const struct batch *b, uint32_t at)
{
    for (uint32_t base = 0; base < b->count; base += group_size(base, b->count))
        stage_group(draw, b, base, group_size(base, b->count), at + base);
}

/* Farthest first, strictly: blending wants it. */
static void stage_far(struct sv_cloud_draw *draw, const struct batch *b, uint32_t at)
{
    for (uint32_t i = 0; i < b->count; i++) {
        uint32_t entry = b->count - 1 - i;
        stage(draw, b, entry, at + i, key_of(draw, b, entry, -1));
    }
}

static void upload_instances(const struct sv_cloud_draw *draw, uint32_t count, bool light)
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

static void bind_species(const struct form_species *f, const struct plane_list *planes, float translucency,
                         const struct sv_tree_light_axes *axes)
{
    gl.BindVertexArray(planes->array);
    for (int k = 0; k < SV_CLOUD_TEXTURES_MAX; k++) {
        if (!f->textures.name[k])
            continue;
        gl.ActiveTexture((GLenum)(GL_TEXTURE0 + k));
        gl.BindTexture(f->textures.target[k], f->textures.name[k]);
    }
    gl.Uniform4fv(UNIFORM_PARAMS, SV_CLOUD_PARAMS, f->textures.params[0]);
    gl.Uniform1f(UNIFORM_LEAF, translucency);
    for (GLuint c = 0; c < SV_SHADE_COLUMNS; c++)
        if (axes)
            gl.EnableVertexAttribArray(AT_LIGHT + c);
        else
            gl.DisableVertexAttribArray(AT_LIGHT + c);
    if (axes) {
        gl.Uniform4fv(UNIFORM_ACROSS, 1, axes->across);
        gl.Uniform4fv(UNIFORM_ALONG, 1, axes->along);
    }
}

/* What is staged from `first` on, a call a run of one key. */
static void draw_pass(const struct sv_cloud_draw *draw, const struct batch *b, enum pass pass, uint32_t first)
{
    const struct sv_tree_light_axes *axes = b->lights.of_tree ? b->lights.of_species : NULL;
    int bound = -1; /* species and cut */
    gl.UseProgram(draw->programs[b->form][pass][axes != NULL]);
    gl.Uniform1f(UNIFORM_EDGE_ON, EDGE_ON);
    for (uint32_t i = first, run; i < first + b->count; i += run) {
        uint32_t key = draw->keys[i];
        int species = (int)(key / KEYS);
        const struct cloud_species *s = &draw->species[draw->species[species].owner];
        const struct form_species *f = &s->forms[b->form];
        for (run = 1; i + run < first + b->count && draw->keys[i + run] == key;)
            run++;
        const struct plane_list *planes = &f->planes[key / BINS % CUTS];
        if (planes->list == 0)
            continue;
        if (bound != (int)(key / BINS))
            bind_species(f, planes, s->light.translucency, axes ? &axes[species] : NULL);
        bound = (int)(key / BINS);
        gl.DrawElementsInstancedBaseInstance(GL_TRIANGLES, (GLsizei)planes->list, GL_UNSIGNED_SHORT,
                                             (const void *)(key % BINS * planes->list * sizeof(uint16_t)),
                                             (GLsizei)run, i);
    }
}

/* Colour, farthest first, tested against depth but leaving it. */
static void draw_soft(const struct sv_cloud_draw *draw, const struct batch *b, uint32_t first)
{
    GLint color = GL_NONE;
    gl.GetIntegerv(GL_DRAW_BUFFER0, &color);
    if (color == GL_NONE)
        return;
    gl.Enablei(GL_BLEND, 0);
    gl.BlendFunc(GL_ONE, GL_ONE_MINUS_SRC_ALPHA);
    gl.ColorMaski(1, GL_FALSE, GL_FALSE, GL_FALSE, GL_FALSE);
    gl.ColorMaski(2, GL_FALSE, GL_FALSE, GL_FALSE, GL_FALSE);
    gl.DepthMask(GL_FALSE);
    draw_pass(draw, b, PASS_SOFT, first);
    gl.Disablei(GL_BLEND, 0);
    gl.DepthMask(GL_TRUE);
    gl.ColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
}

/* Depth, id and normal, nearest first. */
static void draw_hard(const struct sv_cloud_draw *draw, const struct batch *b, uint32_t first)
{
    gl.ColorMaski(0, GL_FALSE, GL_FALSE, GL_FALSE, GL_FALSE);
    draw_pass(draw, b, PASS_HARD, first);
    gl.ColorMaski(0, GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
}

static enum sv_status make_programs(struct sv_cloud_draw *draw, const struct batch *b, bool color_only,
                                    struct sv_error *error)
{
    bool light = b->lights.of_tree, tested = sv_cloud_forms[b->form].tested;
    enum sv_status status = make_program(draw, b->form, tested ? PASS_TESTED : PASS_SOFT, light, error);
    if (!status && !tested && !color_only)
        status = make_program(draw, b->form, PASS_HARD, light, error);
    return status;
}

enum sv_status sv_cloud_draw_trees(struct sv_cloud_draw *draw, enum sv_cloud_form form,
                                   const struct sv_gl_frame *frame, const struct sv_tree *trees,
                                   const struct sv_cull_entry *entries, uint32_t count, bool color_only,
                                   struct sv_tree_lights lights, struct sv_error *error)
{
    if (count == 0)
        return SV_OK;
    if (!lights.of_species)
        lights.of_tree = NULL;
    struct batch b = {form, &frame->camera, frame->light.to_sun, trees, entries, count, lights};
    bool tested = sv_cloud_forms[form].tested, two = !tested && !color_only;
    enum sv_status status = make_room(draw, two ? 2 * count : count, error);
    if (!status)
        status = make_programs(draw, &b, color_only, error);
    for (uint32_t i = 0; !status && i < count; i++)
        status = sv_cloud_draw_build(draw, trees[entries[i].tree].species, form, error);
    if (status)
        return status;
    if (tested || two)
        stage_near(draw, &b, 0);
    if (!tested)
        stage_far(draw, &b, two ? count : 0);
    upload_instances(draw, two ? 2 * count : count, lights.of_tree != NULL);
    gl.Disable(GL_CULL_FACE);
    if (tested)
        draw_pass(draw, &b, PASS_TESTED, 0);
    else
        draw_soft(draw, &b, two ? count : 0);
    if (two)
        draw_hard(draw, &b, 0);
    gl.BindVertexArray(0);
    gl.ActiveTexture(GL_TEXTURE0);
    return sv_gl_check("drawing billboard clouds", error);
}
