/* draw_cloud.c - see draw_cloud.h.
 *
 * The order of a tree's planes matters: each species has, for each of BINS directions to the viewer, the list
 * of their parts (cloud_order.h) from the nearest to the farthest, as indices; the bin on the other side has
 * them from the farthest to the nearest. For the hard pass the list of trees is cut into groups of 8, 16, 32
 * ... (as in draw_mesh.c); in a group, trees of one species that are seen from one bin are one instanced
 * call. */
#include "core/tree/draw_cloud.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/base/rng.h"
#include "core/base/vec.h"
#include "core/gl/context.h"
#include "core/gl/functions.h"
#include "core/gl/program.h"
#include "core/scene/id.h"
#include "core/tree/cloud_light.h"
#include "core/tree/cloud_order.h"
#include "core/tree/draw_cloud_form.h"

enum { GROUP_FIRST = 8, BINS = 128, KEYS = 2 * BINS /* a species */ };
enum { CORNERS = SV_CLOUD_OUTLINE };
enum {
    AT_POSITION,
    AT_CENTRE,
    AT_PICTURE,
    AT_RECTANGLE,
    AT_U,
    AT_V,
    AT_PLACE,
    AT_TURN,
    AT_ID,
    AT_LIGHT, /* and the next: a column of the light's grid each */
    AT_SHIFT = AT_LIGHT + 2,
}; /* locations in tree_cloud.vert */
enum pass { PASS_TESTED, PASS_SOFT, PASS_HARD, PASSES };
enum { UNIFORM_ACROSS = 2, UNIFORM_ALONG = 3, UNIFORM_EDGE_ON = 4, UNIFORM_LEAF = 5, UNIFORM_PARAMS = 8 };

/* Trees of fewer pixels are drawn by whole planes: a third of the triangles; 8 levels of 255 darker from 60
 * degrees above, which is why no more are. */
static const double WHOLE_PX = 12;

/* Cosine between a plane and the view below which it is left out: its texels would be drawn 20 times narrower
 * than they are high. What it shows is missed in the picture as it were in the tree: 0.1, 0.2 and 0.3 take 0
 * to 4 % more error each, and hardly less time (forest_fig4, three trees). */
static const float EDGE_ON = 0.05f;

struct cloud_vertex {
    float position[3], centre[3], picture[3], rectangle[4]; /* rectangle: s, t; half sizes */
    int16_t u[4], v[4];                                     /* unit * 32767 */
};

struct instance {
    float place[4]; /* eye-relative foot, m; height, m */
    float turn[2];  /* cos, sin of the rotation */
    struct sv_cloud_shift shift;
    uint32_t id;
};

_Static_assert(SV_SHADE_COLUMNS == 2 && SV_SHADE_ROWS == 4 && sizeof(struct sv_tree_light) == 8,
               "tree_light.glsl reads two columns of four");

/* The planes as polygons: cut along each other (cloud_order.h), or whole, for trees so small that it does not
 * show and triangles are what they cost. */
enum cut { CUT, WHOLE, CUTS };
struct plane_list {
    GLuint array, vertices, indices;
    size_t list; /* indices a bin */
};

/* A species in a form. */
struct form_species {
    bool built;
    struct sv_cloud_textures textures;
    struct plane_list planes[CUTS];
    size_t bytes;
};

struct cloud_species {
    struct sv_tree_draw_species of;
    int owner; /* index of the species of the same mesh that all is kept at */
    bool fitted;
    struct sv_tree_cloud cloud;
    struct sv_cloud_light light;
    struct form_species forms[SV_CLOUD_FORM_COUNT];
};

struct sv_cloud_draw {
    struct sv_cloud_options options;
    struct sv_store *store;
    int species_count;
    struct cloud_species *species;
    GLuint programs[SV_CLOUD_FORM_COUNT][PASSES][2]; /* without and with light; made when first needed */
    GLuint instances, lights;
    float bins[BINS][3];
    /* What is drawn, in order: heap, room entries each. */
    struct instance *staging;
    struct sv_tree_light *light_staging;
    uint32_t *keys, *scratch; /* keys: species * KEYS + cut * BINS + bin of what is staged */
    uint32_t *counts;         /* species_count * KEYS + 1 */
    uint32_t room;
};

/* ---- what a species has ---- */

static uint64_t store_key(uint64_t key, const struct sv_cloud_options *o)
{
    const struct sv_cloud_options d = SV_CLOUD_OPTIONS_DEFAULT;
    if (o->planes == d.planes && o->stem_planes == d.stem_planes && o->restarts == d.restarts &&
        o->lambda == d.lambda && o->seed == d.seed)
        return key;
    uint64_t lambda;
    memcpy(&lambda, &o->lambda, sizeof lambda);
    key =
        sv_mix64(key ^ ((uint64_t)o->planes << 32 | (uint64_t)o->stem_planes << 16 | (uint64_t)o->restarts));
    return sv_mix64(sv_mix64(key ^ lambda) ^ o->seed);
}

static enum sv_status obtain_cloud(const struct sv_tree_draw_species *species,
                                   const struct sv_cloud_options *options, struct sv_store *store,
                                   struct sv_tree_cloud *cloud, struct sv_error *error)
{
    void *data;
    size_t bytes;
    struct sv_error ignored;
    uint64_t key = store_key(species->key, options);
    if (sv_store_get(store, SV_CLOUD_KIND, key, &data, &bytes, &ignored) == SV_OK) {
        enum sv_status status = sv_tree_cloud_load(data, bytes, cloud, &ignored);
        free(data);
        if (status == SV_OK && cloud->plane_count == options->planes &&
            sv_tree_cloud_check(cloud, species->mesh, &ignored) == SV_OK)
            return SV_OK;
        if (status == SV_OK)
            sv_tree_cloud_finish(cloud);
        if (status == SV_ENOMEM)
            return sv_fail(error, status, ignored.field, "%s", ignored.message);
    }
    enum sv_status status = sv_tree_cloud_create(species->mesh, options, cloud, error);
    if (status == SV_OK && store && sv_tree_cloud_save(cloud, &data, &bytes, &ignored) == SV_OK) {
        sv_store_put(store, SV_CLOUD_KIND, key, data, bytes, &ignored);
        free(data);
    }
    return status;
}

static enum sv_status obtain_light(const struct sv_tree_draw_species *species,
                                   const struct sv_tree_cloud *cloud, const struct sv_cloud_options *options,
                                   struct sv_store *store, struct sv_cloud_light *light,
                                   struct sv_error *error)
{
    void *data;
    size_t bytes;
    struct sv_error ignored;
    uint64_t key = store_key(species->key, options);
    if (sv_store_get(store, SV_CLOUD_LIGHT_KIND, key, &data, &bytes, &ignored) == SV_OK) {
        bool sized = bytes == sizeof *light;
        if (sized)
            memcpy(light, data, sizeof *light);
        free(data);
        if (sized && sv_cloud_light_sound(light))
            return SV_OK;
    }
    enum sv_status status = sv_cloud_light_measure(species->mesh, cloud, light, error);
    if (status == SV_OK && store)
        sv_store_put(store, SV_CLOUD_LIGHT_KIND, key, light, sizeof *light, &ignored);
    return status;
}

static enum sv_status build_blob(const struct sv_tree_draw_species *species,
                                 const struct sv_tree_cloud *cloud, const struct sv_cloud_form_row *row,
                                 uint64_t key, struct sv_store *store, void **data, size_t *bytes,
                                 struct sv_error *error)
{
    struct sv_error ignored;
    enum sv_status status = row->build(species->mesh, cloud, data, bytes, error);
    if (status == SV_OK && store)
        sv_store_put(store, row->kind, key, *data, *bytes, &ignored);
    return status;
}

enum sv_status sv_cloud_form_prepare(const struct sv_tree_draw_species *species, enum sv_cloud_form form,
                                     const struct sv_cloud_options *options, struct sv_store *store,
                                     struct sv_error *error)
{
    struct sv_tree_cloud cloud = {0};
    struct sv_error ignored;
    void *data = NULL;
    size_t bytes;
    const struct sv_cloud_form_row *row = &sv_cloud_forms[form];
    uint64_t key = store_key(species->key, options);
    sv_color_init();
    struct sv_cloud_light light;
    enum sv_status status = obtain_cloud(species, options, store, &cloud, error);
    if (status == SV_OK)
        status = obtain_light(species, &cloud, options, store, &light, error);
    if (status == SV_OK && sv_store_get(store, row->kind, key, &data, &bytes, &ignored) != SV_OK) {
        data = NULL;
        status = build_blob(species, &cloud, row, key, store, &data, &bytes, error);
    }
    free(data);
    sv_tree_cloud_finish(&cloud);
    return status;
}

/* ---- planes ---- */

static float dot3(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Corner k of the octagon: where lines k and k + 1 meet; of the rectangle where there is no outline. */
static void corner_of(const float outline[CORNERS], int k, float st[2])
{
    static const float h = 0.70710678f;
    static const float a[CORNERS] = {1, 0.70710678f, 0, -0.70710678f, -1, -0.70710678f, 0, 0.70710678f};
    static const float whole[CORNERS][2] = {{1, 1}, {1, 1}, {0, 1}, {0, 1}, {0, 0}, {0, 0}, {1, 0}, {1, 0}};
    int n = (k + 1) % CORNERS;
    if (!(outline[0] < 1e6f)) {
        memcpy(st, whole[k], sizeof whole[k]);
        return;
    }
    float a0 = a[k], b0 = a[(k + 6) % CORNERS], a1 = a[n], b1 = a[(n + 6) % CORNERS]; /* a0 b1 - a1 b0 = h */
    float s = (outline[k] * b1 - outline[n] * b0) / h, t = (outline[n] * a0 - outline[k] * a1) / h;
    st[0] = s < 0 ? 0 : s > 1 ? 1 : s;
    st[1] = t < 0 ? 0 : t > 1 ? 1 : t;
}

/* The octagon about what a plane shows, plane coordinates; corners that fall together are one. */
static struct sv_cloud_part outline_of(const struct sv_cloud_plane *plane, int layer,
                                       const struct sv_cloud_textures *t)
{
    struct sv_cloud_part part = {.plane = layer};
    for (int k = 0; k < CORNERS; k++) {
        float st[2];
        corner_of(t->outline[layer], k, st);
        float at[2] = {(2 * st[0] - 1) * plane->half[0], (1 - 2 * st[1]) * plane->half[1]};
        const float *last = part.count ? part.at[part.count - 1] : NULL;
        if (last && fabsf(at[0] - last[0]) + fabsf(at[1] - last[1]) < 1e-6f)
            continue;
        memcpy(part.at[part.count++], at, sizeof at);
    }
    return part;
}

static void put_part(const struct sv_tree_cloud *cloud, const struct sv_cloud_part *part,
                     const struct sv_cloud_textures *t, struct cloud_vertex *out)
{
    const struct sv_cloud_plane *plane = &cloud->planes[part->plane];
    const float *tile = t->tile[part->plane];
    for (int k = 0; k < part->count; k++, out++) {
        float x = part->at[k][0], y = part->at[k][1];
        float s = 0.5f * (x / plane->half[0] + 1), r = 0.5f * (1 - y / plane->half[1]);
        *out = (struct cloud_vertex){
            .picture = {tile[0] + tile[2] * s, tile[1] + tile[3] * r, (float)part->plane},
            .rectangle = {s, r, plane->half[0], plane->half[1]}};
        memcpy(out->centre, plane->centre, sizeof out->centre);
        for (int c = 0; c < 3; c++) {
            out->position[c] = plane->centre[c] + x * plane->u[c] + y * plane->v[c];
            out->u[c] = (int16_t)lrintf(plane->u[c] * 32767);
            out->v[c] = (int16_t)lrintf(plane->v[c] * 32767);
        }
    }
}

/* Indices of the parts from the one nearest to a viewer in direction d. first: of each part's vertices. */
static void put_order(const struct sv_cloud_order *order, const struct sv_tree_cloud *cloud, const float d[3],
                      const uint16_t *first, uint16_t *scratch, uint16_t *out)
{
    sv_cloud_order_sort(order, cloud, d, scratch);
    for (int k = order->part_count - 1; k >= 0; k--) {
        const struct sv_cloud_part *part = &order->parts[scratch[k]];
        for (int i = 0; i + 2 < part->count; i++) {
            *out++ = first[scratch[k]];
            *out++ = (uint16_t)(first[scratch[k]] + i + 1);
            *out++ = (uint16_t)(first[scratch[k]] + i + 2);
        }
    }
}

static void set_attributes(const struct sv_cloud_draw *draw)
{
    static const struct {
        GLint size;
        GLenum type;
        size_t offset;
    } rows[] = {
        [AT_POSITION] = {3, GL_FLOAT, offsetof(struct cloud_vertex, position)},
        [AT_CENTRE] = {3, GL_FLOAT, offsetof(struct cloud_vertex, centre)},
        [AT_PICTURE] = {3, GL_FLOAT, offsetof(struct cloud_vertex, picture)},
        [AT_RECTANGLE] = {4, GL_FLOAT, offsetof(struct cloud_vertex, rectangle)},
        [AT_U] = {3, GL_SHORT, offsetof(struct cloud_vertex, u)},
        [AT_V] = {3, GL_SHORT, offsetof(struct cloud_vertex, v)},
    };
    for (GLuint k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        gl.EnableVertexAttribArray(k);
        gl.VertexAttribPointer(k, rows[k].size, rows[k].type, GL_TRUE, sizeof(struct cloud_vertex),
                               (const void *)rows[k].offset);
    }
    gl.BindBuffer(GL_ARRAY_BUFFER, draw->instances);
    gl.EnableVertexAttribArray(AT_PLACE);
    gl.VertexAttribPointer(AT_PLACE, 4, GL_FLOAT, GL_FALSE, sizeof(struct instance),
                           (const void *)offsetof(struct instance, place));
    gl.EnableVertexAttribArray(AT_TURN);
    gl.VertexAttribPointer(AT_TURN, 2, GL_FLOAT, GL_FALSE, sizeof(struct instance),
                           (const void *)offsetof(struct instance, turn));
    gl.EnableVertexAttribArray(AT_ID);
    gl.VertexAttribIPointer(AT_ID, 1, GL_UNSIGNED_INT, sizeof(struct instance),
                            (const void *)offsetof(struct instance, id));
    gl.EnableVertexAttribArray(AT_SHIFT);
    gl.VertexAttribPointer(AT_SHIFT, 3, GL_FLOAT, GL_FALSE, sizeof(struct instance),
                           (const void *)offsetof(struct instance, shift));
    gl.BindBuffer(GL_ARRAY_BUFFER, draw->lights);
    for (GLuint c = 0; c < SV_SHADE_COLUMNS; c++)
        gl.VertexAttribPointer(AT_LIGHT + c, SV_SHADE_ROWS, GL_UNSIGNED_BYTE, GL_TRUE,
                               sizeof(struct sv_tree_light), (const void *)(size_t)(c * SV_SHADE_ROWS));
    for (GLuint at = AT_PLACE; at <= AT_SHIFT; at++)
        gl.VertexAttribDivisor(at, 1);
}

/* Vertices of all parts, and their order for each bin. */
static enum sv_status build_lists(const struct sv_cloud_draw *draw, const struct sv_tree_cloud *cloud,
                                  const struct sv_cloud_order *order,
                                  const struct sv_cloud_textures *textures, struct plane_list *f,
                                  struct cloud_vertex **vertices, uint16_t **indices, int *vertex_count,
                                  struct sv_error *error)
{
    size_t parts = (size_t)order->part_count;
    int corners = 0;
    uint16_t *scratch = malloc((2 * parts + 1) * sizeof *scratch), *first = scratch + parts;
    for (size_t k = 0; scratch && k < parts; k++) {
        first[k] = (uint16_t)corners;
        corners += order->parts[k].count;
        f->list += 3 * ((size_t)order->parts[k].count - 2);
    }
    *vertex_count = corners;
    *vertices = malloc(((size_t)corners + 1) * sizeof **vertices);
    *indices = malloc((BINS * f->list + 1) * sizeof **indices);
    bool made = scratch && *vertices && *indices && corners <= UINT16_MAX;
    for (size_t k = 0; made && k < parts; k++)
        put_part(cloud, &order->parts[k], textures, *vertices + first[k]);
    for (int bin = 0; made && bin < BINS; bin++)
        put_order(order, cloud, draw->bins[bin], first, scratch, *indices + (size_t)bin * f->list);
    free(scratch);
    return made ? SV_OK : sv_fail(error, SV_ENOMEM, "cloud", "no room for %d corners of planes", corners);
}

static void upload_planes(const struct sv_cloud_draw *draw, const struct cloud_vertex *vertices,
                          int vertex_count, const uint16_t *indices, struct plane_list *f)
{
    size_t vertex_bytes = (size_t)vertex_count * sizeof *vertices,
           index_bytes = BINS * f->list * sizeof *indices;
    gl.GenVertexArrays(1, &f->array);
    gl.GenBuffers(1, &f->vertices);
    gl.GenBuffers(1, &f->indices);
    gl.BindVertexArray(f->array);
    gl.BindBuffer(GL_ARRAY_BUFFER, f->vertices);
    gl.BufferData(GL_ARRAY_BUFFER, (GLsizeiptr)vertex_bytes, vertices, GL_STATIC_DRAW);
    gl.BindBuffer(GL_ELEMENT_ARRAY_BUFFER, f->indices);
    gl.BufferData(GL_ELEMENT_ARRAY_BUFFER, (GLsizeiptr)index_bytes, indices, GL_STATIC_DRAW);
    set_attributes(draw);
    gl.BindVertexArray(0);
}

static enum sv_status build_list(const struct sv_cloud_draw *draw, const struct sv_tree_cloud *cloud,
                                 const struct sv_cloud_part *outlines, int count, float reach,
                                 struct form_species *f, struct plane_list *planes, struct sv_error *error)
{
    struct sv_cloud_order order = {0};
    struct cloud_vertex *vertices = NULL;
    uint16_t *indices = NULL;
    int vertex_count = 0;
    enum sv_status status = sv_cloud_order_build(cloud, outlines, count, reach, &order, error);
    if (!status)
        status =
            build_lists(draw, cloud, &order, &f->textures, planes, &vertices, &indices, &vertex_count, error);
    if (!status)
        upload_planes(draw, vertices, vertex_count, indices, planes);
    f->bytes += (size_t)vertex_count * sizeof *vertices + BINS * planes->list * sizeof *indices;
    free(vertices);
    free(indices);
    sv_cloud_order_finish(&order);
    return status;
}

static enum sv_status build_planes(const struct sv_cloud_draw *draw, const struct sv_tree_cloud *cloud,
                                   struct form_species *f, struct sv_error *error)
{
    static const float reach[CUTS] = {[CUT] = SV_CLOUD_ORDER_REACH, [WHOLE] = INFINITY};
    struct sv_cloud_part outlines[SV_CLOUD_PLANES_MAX];
    enum sv_status status = SV_OK;
    int shown = 0;
    for (int k = 0; k < cloud->plane_count; k++)
        if (cloud->planes[k].piece_count > 0 && f->textures.outline[k][0] > -1e6f) {
            outlines[shown] = outline_of(&cloud->planes[k], k, &f->textures);
            shown += outlines[shown].count >= 3;
        }
    for (int cut = 0; !status && cut < CUTS; cut++)
        status = build_list(draw, cloud, outlines, shown, reach[cut], f, &f->planes[cut], error);
    return status;
}

static enum sv_status upload_blob(const struct cloud_species *s, const struct sv_cloud_form_row *row,
                                  const void *data, size_t bytes, struct sv_cloud_textures *t,
                                  struct sv_error *error)
{
    memset(t, 0, sizeof *t);
    for (int k = 0; k < SV_CLOUD_PLANES_MAX; k++) {
        t->tile[k][2] = t->tile[k][3] = 1;
        for (int c = 0; c < SV_CLOUD_OUTLINE; c++)
            t->outline[k][c] = INFINITY;
    }
    enum sv_status status = row->upload(s->of.mesh, &s->cloud, data, bytes, t, error);
    if (status)
        gl.DeleteTextures(SV_CLOUD_TEXTURES_MAX, t->name);
    return status;
}

static enum sv_status build_textures(struct sv_cloud_draw *draw, struct cloud_species *s,
                                     enum sv_cloud_form form, struct sv_error *error)
{
    const struct sv_cloud_form_row *row = &sv_cloud_forms[form];
    uint64_t key = store_key(s->of.key, &draw->options);
    struct sv_cloud_textures *t = &s->forms[form].textures;
    struct sv_error ignored;
    void *data;
    size_t bytes;
    if (sv_store_get(draw->store, row->kind, key, &data, &bytes, &ignored) == SV_OK) {
        enum sv_status status = upload_blob(s, row, data, bytes, t, &ignored);
        free(data);
        if (status == SV_OK)
            return SV_OK;
    }
    enum sv_status status = build_blob(&s->of, &s->cloud, row, key, draw->store, &data, &bytes, error);
    if (status)
        return status;
    status = upload_blob(s, row, data, bytes, t, error);
    free(data);
    return status;
}

enum sv_status sv_cloud_draw_build(struct sv_cloud_draw *draw, int species, enum sv_cloud_form form,
                                   struct sv_error *error)
{
    struct cloud_species *s = &draw->species[draw->species[species].owner];
    struct form_species *f = &s->forms[form];
    enum sv_status status = SV_OK;
    if (f->built || s->of.tree_count == 0)
        return SV_OK;
    if (!s->fitted) {
        status = obtain_cloud(&s->of, &draw->options, draw->store, &s->cloud, error);
        if (!status)
            status = obtain_light(&s->of, &s->cloud, &draw->options, draw->store, &s->light, error);
        if (status)
            sv_tree_cloud_finish(&s->cloud);
        s->fitted = status == SV_OK;
    }
    if (!status)
        status = build_textures(draw, s, form, error);
    if (!status)
        status = build_planes(draw, &s->cloud, f, error);
    if (!status)
        status = sv_gl_check("uploading a billboard cloud", error);
    f->built = status == SV_OK;
    f->bytes += f->textures.bytes;
    return status;
}

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
