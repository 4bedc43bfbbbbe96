/* lod.c - the level of detail's life, and the top-down refinement for a camera. Measuring is in lod_build.c.
 *
 * The question of a vertex v with error e and radius r, Z its depth and d its distance from the eye: can e be
 * seen? Over the sphere inside the view volume depth is at least max(Z - r, (d - r) / S), S being 1 / cos of
 * the picture's corner, and at least near - e; so split iff e C > Z - r and e C S > d - r and e (C + 1) >
 * near, with C = f s / error_px. All three are monotone under the nesting of spheres and errors. Done in
 * double: rounding (1e-16 d) stays far below the radii's slack. */
#include "core/terrain/lod.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/hash.h"
#include "core/terrain/lod_private.h"

#define TRIANGLES_MAX (UINT32_C(1) << 25)
#define STORED_SAMPLES_MIN ((size_t)1 << 21)

static const char store_kind[] = "lod1";

/* ---- life ---- */

/* What stands before the arrays in the store. */
struct stored {
    uint32_t width, height, side, outside_capacity, outside_count, reserved;
    double error_unit_m, radius_unit_m;
};

static uint64_t field_key(const struct sv_heightfield *f)
{
    uint64_t h = sv_hash_u64(SV_HASH_INIT, (uint64_t)f->width << 32 | (uint64_t)f->height);
    h = sv_hash_double(sv_hash_double(h, f->dx), f->dy);
    return sv_hash_done(sv_hash_bytes(h, f->h, (size_t)f->width * (size_t)f->height * sizeof *f->h));
}

static bool stored_fits(const struct sv_terrain_lod *lod, const struct stored *s, size_t bytes)
{
    size_t count = (size_t)lod->field->width * (size_t)lod->field->height;
    uint32_t c = s->outside_capacity;
    return s->width == (uint32_t)lod->field->width && s->height == (uint32_t)lod->field->height &&
           s->side == (uint32_t)lod->side && (c & (c - 1)) == 0 && c <= (UINT32_C(1) << 24) &&
           (c == 0 || s->outside_count < c) && s->error_unit_m > 0 && s->radius_unit_m > 0 &&
           bytes == sizeof *s + count * 4 + (size_t)c * 8;
}

/* Fills lod from a blob; false when it is not what it should be or memory is short. */
static bool from_stored(struct sv_terrain_lod *lod, const void *data, size_t bytes)
{
    struct stored s;
    size_t count = (size_t)lod->field->width * (size_t)lod->field->height;
    if (bytes < sizeof s)
        return false;
    memcpy(&s, data, sizeof s);
    if (!stored_fits(lod, &s, bytes))
        return false;
    const char *from = (const char *)data + sizeof s;
    size_t table_bytes = (size_t)s.outside_capacity * 4;
    uint32_t *packed = malloc(count * 4), *keys = malloc(table_bytes + 4), *values = malloc(table_bytes + 4);
    if (!packed || !keys || !values) {
        free(packed);
        free(keys);
        free(values);
        return false;
    }
    memcpy(packed, from, count * 4);
    memcpy(keys, from + count * 4, table_bytes);
    memcpy(values, from + count * 4 + table_bytes, table_bytes);
    lod->packed = packed;
    lod->outside = (struct sv_lod_outside){keys, values, s.outside_capacity, s.outside_count};
    lod->error_unit_m = s.error_unit_m;
    lod->radius_unit_m = s.radius_unit_m;
    return true;
}

static void keep(const struct sv_terrain_lod *lod, struct sv_store *store, uint64_t key)
{
    size_t count = (size_t)lod->field->width * (size_t)lod->field->height;
    size_t table_bytes = (size_t)lod->outside.capacity * 4,
           bytes = sizeof(struct stored) + count * 4 + table_bytes * 2;
    struct stored s = {(uint32_t)lod->field->width, (uint32_t)lod->field->height,
                       (uint32_t)lod->side,         lod->outside.capacity,
                       lod->outside.count,          0,
                       lod->error_unit_m,           lod->radius_unit_m};
    char *blob = malloc(bytes);
    if (!blob)
        return;
    memcpy(blob, &s, sizeof s);
    memcpy(blob + sizeof s, lod->packed, count * 4);
    if (table_bytes) {
        memcpy(blob + sizeof s + count * 4, lod->outside.keys, table_bytes);
        memcpy(blob + sizeof s + count * 4 + table_bytes, lod->outside.values, table_bytes);
    }
    (void)sv_store_put(store, store_kind, key, blob, bytes, NULL);
    free(blob);
}

static bool take_from_store(struct sv_terrain_lod *lod, struct sv_store *store, uint64_t key)
{
    void *data = NULL;
    size_t bytes = 0;
    if (sv_store_get(store, store_kind, key, &data, &bytes, NULL))
        return false;
    bool taken = from_stored(lod, data, bytes);
    free(data);
    return taken;
}

enum sv_status sv_terrain_lod_create(const struct sv_heightfield *field, struct sv_store *store,
                                     struct sv_terrain_lod **lod, struct sv_error *error)
{
    struct sv_terrain_lod *made = calloc(1, sizeof *made);
    if (!made)
        return sv_fail(error, SV_ENOMEM, "terrain", "no memory for the level of detail");
    made->field = field;
    made->side = 1;
    while (made->side < field->width - 1 || made->side < field->height - 1)
        made->side *= 2;
    bool stored = store && (size_t)field->width * (size_t)field->height >= STORED_SAMPLES_MIN;
    uint64_t key = stored ? field_key(field) : 0;
    if (!stored || !take_from_store(made, store, key)) {
        enum sv_status status = sv_lod_measure(made, error);
        if (status) {
            sv_terrain_lod_destroy(made);
            return status;
        }
        if (stored)
            keep(made, store, key);
    }
    *lod = made;
    return SV_OK;
}

void sv_terrain_lod_destroy(struct sv_terrain_lod *lod)
{
    if (!lod)
        return;
    free(lod->packed);
    free(lod->outside.keys);
    free(lod->outside.values);
    free(lod);
}

size_t sv_terrain_lod_bytes(const struct sv_terrain_lod *lod)
{
    return sizeof *lod + (size_t)lod->field->width * (size_t)lod->field->height * 4 +
           (size_t)lod->outside.capacity * 8;
}

/* ---- the mesh that grows ---- */

/* A slot of the table from sample to vertex. */
struct place {
    uint32_t sample_plus_1, vertex;
};

void sv_terrain_mesh_finish(struct sv_terrain_mesh *mesh)
{
    free(mesh->vertices);
    free(mesh->samples);
    free(mesh->indices);
    free(mesh->table);
    *mesh = (struct sv_terrain_mesh){0};
}

static bool grow_vertices(struct sv_terrain_mesh *mesh)
{
    uint32_t capacity = mesh->vertex_capacity ? mesh->vertex_capacity * 2 : 16384;
    float *vertices = realloc(mesh->vertices, (size_t)capacity * 3 * sizeof *vertices);
    if (vertices)
        mesh->vertices = vertices;
    uint32_t *samples = realloc(mesh->samples, (size_t)capacity * sizeof *samples);
    if (samples)
        mesh->samples = samples;
    if (!vertices || !samples)
        return false;
    mesh->vertex_capacity = capacity;
    return true;
}

static bool grow_indices(struct sv_terrain_mesh *mesh)
{
    uint32_t capacity = mesh->triangle_capacity ? mesh->triangle_capacity * 2 : 32768;
    uint32_t *indices = realloc(mesh->indices, (size_t)capacity * 3 * sizeof *indices);
    if (!indices)
        return false;
    mesh->indices = indices;
    mesh->triangle_capacity = capacity;
    return true;
}

static uint32_t find_place(const struct place *table, uint32_t size, uint32_t sample)
{
    uint32_t slot = (sample * UINT32_C(0x9E3779B1)) >> 7 & (size - 1);
    while (table[slot].sample_plus_1 && table[slot].sample_plus_1 != sample + 1)
        slot = (slot + 1) & (size - 1);
    return slot;
}

/* A larger table (two slots a vertex at least); enters those there are again. */
static bool grow_table(struct sv_terrain_mesh *mesh)
{
    uint32_t size = mesh->table_size ? mesh->table_size * 2 : 65536;
    struct place *table = calloc(size, sizeof *table);
    if (!table)
        return false;
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        uint32_t slot = find_place(table, size, mesh->samples[v]);
        table[slot] = (struct place){mesh->samples[v] + 1, v};
    }
    free(mesh->table);
    mesh->table = table;
    mesh->table_size = size;
    return true;
}

/* ---- refinement ---- */

struct corner {
    int i, j; /* in the padded grid */
    uint32_t vertex;
};

struct refinement {
    const struct sv_terrain_lod *lod;
    const struct sv_heightfield *field;
    struct sv_terrain_mesh *mesh;
    int last_i, last_j, depth;
    struct sv_vec3 origin; /* of the field, relative to the eye */
    struct sv_vec3 forward;
    double planes[5][4];
    double px_m;  /* f s: px of an error of 1 m at depth 1 (orthographic: anywhere) */
    double reach; /* C = px_m / error_px */
    double slant; /* S */
    double near_m;
    bool orthographic;
    enum sv_status status;
};

static struct sv_vec3 sample_place(const struct refinement *r, int i, int j)
{
    size_t at = (size_t)j * (size_t)r->field->width + (size_t)i;
    return sv_vec3(r->origin.x + i * r->field->dx, r->origin.y + j * r->field->dy,
                   r->origin.z + (double)r->field->h[at]);
}

/* Index of the vertex at a padded place, entered when it is new. */
static uint32_t vertex_at(struct refinement *r, int i, int j)
{
    struct sv_terrain_mesh *mesh = r->mesh;
    i = i < r->last_i ? i : r->last_i;
    j = j < r->last_j ? j : r->last_j;
    if ((mesh->vertex_count >= mesh->vertex_capacity && !grow_vertices(mesh)) ||
        (mesh->vertex_count * 2 >= mesh->table_size && !grow_table(mesh))) {
        r->status = SV_ENOMEM;
        return 0;
    }
    uint32_t sample = (uint32_t)j * (uint32_t)r->field->width + (uint32_t)i;
    struct place *table = mesh->table;
    uint32_t slot = find_place(table, mesh->table_size, sample);
    if (table[slot].sample_plus_1)
        return table[slot].vertex;
    struct sv_vec3 p = sample_place(r, i, j);
    float *out = mesh->vertices + 3 * (size_t)mesh->vertex_count;
    out[0] = (float)p.x;
    out[1] = (float)p.y;
    out[2] = (float)p.z;
    mesh->samples[mesh->vertex_count] = sample;
    table[slot] = (struct place){sample + 1, mesh->vertex_count};
    return mesh->vertex_count++;
}

static void emit(struct refinement *r, const struct corner *a, const struct corner *b, const struct corner *c)
{
    struct sv_terrain_mesh *mesh = r->mesh;
    if (mesh->triangle_count >= TRIANGLES_MAX) {
        r->status = SV_ELIMIT;
        return;
    }
    if (mesh->triangle_count >= mesh->triangle_capacity && !grow_indices(mesh)) {
        r->status = SV_ENOMEM;
        return;
    }
    uint32_t *out = mesh->indices + 3 * (size_t)mesh->triangle_count++;
    out[0] = a->vertex;
    out[1] = b->vertex;
    out[2] = c->vertex;
}

/* The planes of `mask` that the sphere crosses; -1 when it lies outside one of them. */
static int crossed_planes(const struct refinement *r, struct sv_vec3 p, double radius, int mask)
{
    for (int k = 0; k < 5; k++) {
        if (!(mask >> k & 1))
            continue;
        const double *n = r->planes[k];
        double distance = n[0] * p.x + n[1] * p.y + n[2] * p.z + n[3];
        if (distance < -radius)
            return -1;
        if (distance > radius)
            mask &= ~(1 << k);
    }
    return mask;
}

static bool must_split(const struct refinement *r, double z, double distance2, double e, double radius)
{
    double seen = e * r->reach;
    if (r->orthographic)
        return seen > 1;
    double far_side = seen * r->slant + radius;
    return seen + radius > z && far_side * far_side > distance2 && seen + e > r->near_m;
}

/* The error left when v is not split, px. */
static double left_px(const struct refinement *r, double z, double distance2, double e, double radius)
{
    if (r->orthographic)
        return e * r->px_m;
    double depth = fmax(fmax(z - radius, (sqrt(distance2) - radius) / r->slant), r->near_m - e);
    return depth > 0 ? e * r->px_m / depth : 0;
}

/* Whether the eye is nearer, on the ground plan, to b than to c. */
static bool eye_is_nearer(const struct refinement *r, const struct corner *b, const struct corner *c)
{
    double bx = r->origin.x + b->i * r->field->dx, by = r->origin.y + b->j * r->field->dy;
    double cx = r->origin.x + c->i * r->field->dx, cy = r->origin.y + c->j * r->field->dy;
    return bx * bx + by * by < cx * cx + cy * cy;
}

/* Refines the triangle with its right angle at a and hypotenuse b c, counter-clockwise. */
static void refine(struct refinement *r, const struct corner *a, const struct corner *b,
                   const struct corner *c, int level, int mask)
{
    if ((a->i >= r->last_i && b->i >= r->last_i && c->i >= r->last_i) ||
        (a->j >= r->last_j && b->j >= r->last_j && c->j >= r->last_j) || r->status)
        return;
    if (level == r->depth) {
        emit(r, a, b, c);
        return;
    }
    int i = (b->i + c->i) / 2, j = (b->j + c->j) / 2;
    struct sv_vec3 p = sample_place(r, i < r->last_i ? i : r->last_i, j < r->last_j ? j : r->last_j);
    uint32_t packed = sv_lod_packed(r->lod, i, j);
    double e = sv_lod_error_m(r->lod, packed), radius = sv_lod_radius_m(r->lod, packed);
    mask = crossed_planes(r, p, radius, mask);
    if (mask < 0)
        return;
    double z = sv_dot(p, r->forward), distance2 = sv_dot(p, p);
    if (!must_split(r, z, distance2, e, radius)) {
        r->mesh->max_error_px = fmax(r->mesh->max_error_px, left_px(r, z, distance2, e, radius));
        emit(r, a, b, c);
        return;
    }
    struct corner v = {i, j, vertex_at(r, i, j)};
    /* Nearer side first, so that the depth test throws hidden fragments away before they are shaded. */
    if (eye_is_nearer(r, b, c)) {
        refine(r, &v, a, b, level + 1, mask);
        refine(r, &v, c, a, level + 1, mask);
    } else {
        refine(r, &v, c, a, level + 1, mask);
        refine(r, &v, a, b, level + 1, mask);
    }
}

/* f s and S (lod.h): both are largest at a corner of the picture. */
static void set_reach(struct refinement *r, const struct sv_camera *camera, double error_px)
{
    double f = sv_camera_focal_px(camera), longest = 1, cosine = 1;
    for (int k = 0; k < 4 && !r->orthographic; k++) {
        double x = (k & 1 ? 0.5 : -0.5) * (camera->width + 1) / f,
               y = (k & 2 ? 0.5 : -0.5) * (camera->height + 1) / f;
        double dx = camera->right.z - x * camera->forward.z, dy = camera->up.z - y * camera->forward.z;
        longest = fmax(longest, sqrt(dx * dx + dy * dy));
        cosine = 1 / sqrt(1 + x * x + y * y);
    }
    r->px_m = f * longest;
    r->reach = error_px > 0 ? r->px_m / error_px : INFINITY;
    r->slant = 1 / cosine;
}

static void refine_field(struct refinement *r)
{
    int n = r->lod->side;
    struct corner ll = {0, 0, vertex_at(r, 0, 0)}, lr = {n, 0, vertex_at(r, n, 0)};
    struct corner ul = {0, n, vertex_at(r, 0, n)}, ur = {n, n, vertex_at(r, n, n)};
    if (r->status)
        return;
    refine(r, &lr, &ur, &ll, 0, 31);
    refine(r, &ul, &ll, &ur, 0, 31);
}

enum sv_status sv_terrain_lod_refine(const struct sv_terrain_lod *lod, const struct sv_camera *camera,
                                     const double (*planes)[4], double error_px, struct sv_terrain_mesh *mesh, struct sv_error *error)
{
    const struct sv_heightfield *f = lod->field;
    if (!(error_px >= 0))
        return sv_fail(error, SV_EINVAL, "error_px", "%g px is not a screen-space error (0 or more)",
                       error_px);
    struct refinement r = {.lod = lod,
                           .field = f,
                           .mesh = mesh,
                           .last_i = f->width - 1,
                           .last_j = f->height - 1,
                           .origin = sv_sub(sv_vec3(f->x0, f->y0, f->z0), camera->eye),
                           .forward = camera->forward,
                           .near_m = camera->near_m,
                           .orthographic = camera->projection == SV_PROJECTION_ORTHOGRAPHIC};
    for (int n = 1; n < lod->side; n *= 2)
        r.depth += 2;
    if (planes)
        memcpy(r.planes, planes, sizeof r.planes);
    else
        sv_camera_planes(camera, r.planes);
    set_reach(&r, camera, error_px);
    mesh->vertex_count = mesh->triangle_count = 0;
    mesh->max_error_px = 0;
    if (mesh->table)
        memset(mesh->table, 0, mesh->table_size * sizeof(struct place));
    refine_field(&r);
    if (r.status == SV_ELIMIT)
        return sv_fail(error, SV_ELIMIT, "error_px",
                       "the view needs more than %u triangles of terrain; %g px is too fine",
                       (unsigned)TRIANGLES_MAX, error_px);
    if (r.status)
        return sv_fail(error, SV_ENOMEM, "terrain", "no memory for a mesh of %u triangles",
                       mesh->triangle_count);
    return SV_OK;
}
