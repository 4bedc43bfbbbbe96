/* draw_cloud_build.c - see draw_cloud_private.h: clouds and textures from the store or made anew, planes cut
 * and ordered, all of it uploaded. */
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/base/rng.h"
#include "core/gl/context.h"
#include "core/tree/cloud_order.h"
#include "core/tree/draw_cloud_private.h"

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

bool sv_cloud_form_kept(const struct sv_tree_draw_species *species, enum sv_cloud_form form,
                        const struct sv_cloud_options *options, struct sv_store *store)
{
    uint64_t key = store_key(species->key, options);
    return sv_store_has(store, SV_CLOUD_KIND, key) && sv_store_has(store, SV_CLOUD_LIGHT_KIND, key) &&
           sv_store_has(store, sv_cloud_forms[form].kind, key);
}

/* Of a species' cloud and all its forms: they are built from one cloud. What is kept needs no claim. */
static int claim_form(const struct sv_tree_draw_species *species, enum sv_cloud_form form,
                      const struct sv_cloud_options *options, struct sv_store *store)
{
    return sv_cloud_form_kept(species, form, options, store)
               ? SV_STORE_UNCLAIMED
               : sv_store_claim(store, SV_CLOUD_KIND, store_key(species->key, options));
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
    int claim = claim_form(species, form, options, store);
    enum sv_status status = obtain_cloud(species, options, store, &cloud, error);
    if (status == SV_OK)
        status = obtain_light(species, &cloud, options, store, &light, error);
    if (status == SV_OK && sv_store_get(store, row->kind, key, &data, &bytes, &ignored) != SV_OK) {
        data = NULL;
        status = build_blob(species, &cloud, row, key, store, &data, &bytes, error);
    }
    sv_store_release(claim);
    free(data);
    sv_tree_cloud_finish(&cloud);
    return status;
}

size_t sv_cloud_form_bytes(const struct sv_tree_mesh *mesh, enum sv_cloud_form form,
                           const struct sv_cloud_options *options)
{
    return sv_cloud_forms[form].bytes(mesh, options->planes);
}

/* ---- planes ---- */

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

enum sv_status sv_cloud_build_form(struct sv_cloud_draw *draw, struct cloud_species *s,
                                   enum sv_cloud_form form, struct sv_error *error)
{
    struct form_species *f = &s->forms[form];
    enum sv_status status = SV_OK;
    if (f->built || s->of.tree_count == 0)
        return SV_OK;
    int claim = claim_form(&s->of, form, &draw->options, draw->store);
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
    sv_store_release(claim);
    if (!status)
        status = build_planes(draw, &s->cloud, f, error);
    if (!status)
        status = sv_gl_check("uploading a billboard cloud", error);
    f->built = status == SV_OK;
    f->bytes += f->textures.bytes;
    return status;
}
