/* leaf_form.c - see leaf_form.h. */
#include "core/tree/leaf_form.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Corners of a card may miss the parallelogram by this share of its size; grown cards miss by rounding. */
static const float CARD_TOLERANCE = 1e-3f;
/* The same for texture coordinates, of the card's extent in them. */
static const float UV_TOLERANCE = 1e-3f;
/* Fraction of the golden ratio: multiples of it fill 0..1 evenly. */
#define GOLDEN 0.6180339887498949

#define NO_VERTEX UINT32_C(0xffffffff)

struct piece {
    uint64_t order; /* material, kind, place along the curve, rank */
    uint32_t corner[4];
    uint32_t leaf; /* NO_VERTEX: not thinned out */
    float rank;
    uint8_t material;
};

struct leaf {
    float middle[3];
    float area, reach;
    uint32_t triangles;
    uint32_t code; /* Morton */
    float rank;
};

struct builder {
    const struct sv_tree_mesh *mesh;
    struct piece *pieces;
    uint32_t piece_count;
    uint32_t *root;      /* by vertex: union-find of what hangs together */
    struct leaf *leaves; /* by root vertex */
};

static const float *place(const struct sv_tree_mesh *mesh, uint32_t vertex)
{
    return mesh->vertices[vertex].position;
}

static uint32_t find(uint32_t *root, uint32_t v)
{
    while (root[v] != v)
        v = root[v] = root[root[v]];
    return v;
}

static bool near_to(const float *a, const float *b, const float *c, const float *d, int n, float tolerance)
{
    float off = 0, size = 0;
    for (int k = 0; k < n; k++) {
        off = fmaxf(off, fabsf(a[k] + c[k] - b[k] - d[k]));
        size = fmaxf(size, fmaxf(fabsf(c[k] - a[k]), fabsf(d[k] - b[k])));
    }
    return off <= tolerance * size;
}

/* Whether two triangles are one card: they share an edge, and are a parallelogram in space and texture. */
static bool join(const struct sv_tree_mesh *mesh, const uint32_t a[3], const uint32_t b[3], uint32_t out[4])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            /* a's edge from i to i + 1 against the same edge of b, either way round */
            uint32_t from = a[i], to = a[(i + 1) % 3], p = b[j], q = b[(j + 1) % 3];
            if (!((from == q && to == p) || (from == p && to == q)))
                continue;
            uint32_t apex = a[(i + 2) % 3], other = b[(j + 2) % 3];
            const uint32_t card[4] = {from, apex, to, other}; /* hm: around the rim */
            const struct sv_tree_vertex *v = mesh->vertices;
            if (!near_to(v[card[0]].position, v[card[1]].position, v[card[2]].position, v[card[3]].position,
                         3, CARD_TOLERANCE) ||
                !near_to(v[card[0]].uv, v[card[1]].uv, v[card[2]].uv, v[card[3]].uv, 2, UV_TOLERANCE))
                return false;
            memcpy(out, card, sizeof card);
            return true;
        }
    return false;
}

static void take_material(struct builder *b, int m)
{
    const struct sv_tree_mesh *mesh = b->mesh;
    const struct sv_tree_material *material = &mesh->materials[m];
    const uint32_t *index = mesh->indices + material->first_index;
    for (uint32_t k = 0; k < material->index_count; k += 3) {
        struct piece *p = &b->pieces[b->piece_count++];
        *p = (struct piece){.corner = {index[k], index[k + 1], index[k + 2], NO_VERTEX},
                            .leaf = NO_VERTEX,
                            .material = (uint8_t)m};
        if (k + 6 <= material->index_count && join(mesh, index + k, index + k + 3, p->corner))
            k += 3;
        for (int c = 1; c < 4 && material->is_leaf; c++)
            if (p->corner[c] != NO_VERTEX)
                b->root[find(b->root, p->corner[c])] = find(b->root, p->corner[0]);
    }
}

static float area_of(const struct sv_tree_mesh *mesh, const struct piece *p)
{
    bool card = p->corner[3] != NO_VERTEX;
    const float *a = place(mesh, p->corner[0]), *b = place(mesh, p->corner[1]);
    const float *c = place(mesh, p->corner[card ? 3 : 2]);
    float u[3], v[3];
    for (int k = 0; k < 3; k++)
        u[k] = b[k] - a[k], v[k] = c[k] - a[k];
    float x = u[1] * v[2] - u[2] * v[1], y = u[2] * v[0] - u[0] * v[2], z = u[0] * v[1] - u[1] * v[0];
    return sqrtf(x * x + y * y + z * z) * (card ? 1 : 0.5f);
}

static void middle_of(const struct sv_tree_mesh *mesh, const struct piece *p, float middle[3])
{
    int corners = p->corner[3] == NO_VERTEX ? 3 : 4;
    for (int k = 0; k < 3; k++) {
        middle[k] = 0;
        for (int c = 0; c < corners; c++)
            middle[k] += place(mesh, p->corner[c])[k] / (float)corners;
    }
}

static uint32_t spread3(uint32_t v)
{
    v &= 1023;
    v = (v | v << 16) & 0x030000ff;
    v = (v | v << 8) & 0x0300f00f;
    v = (v | v << 4) & 0x030c30c3;
    return (v | v << 2) & 0x09249249;
}

/* Heights -4 .. 4 in 10 bits an axis: crowns are cut to a hundredth of the height. */
static uint32_t morton(const float p[3])
{
    uint32_t code = 0;
    for (int k = 0; k < 3; k++)
        code |= spread3((uint32_t)fminf(fmaxf((p[k] + 2) * 256, 0), 1023)) << k;
    return code;
}

struct order {
    uint64_t key;
    uint32_t item;
};

static int by_key(const void *a, const void *b)
{
    const struct order *x = a, *y = b;
    return x->key != y->key ? (x->key > y->key) - (x->key < y->key)
                            : (x->item > y->item) - (x->item < y->item);
}

/* Gathers leaves from what hangs together; pieces of too large sheets lose theirs. */
static void find_leaves(struct builder *b, struct sv_leaf_form *form)
{
    const struct sv_tree_mesh *mesh = b->mesh;
    for (uint32_t k = 0; k < b->piece_count; k++) {
        struct piece *p = &b->pieces[k];
        if (!mesh->materials[p->material].is_leaf)
            continue;
        p->leaf = find(b->root, p->corner[0]);
        struct leaf *leaf = &b->leaves[p->leaf];
        float middle[3], area = fmaxf(area_of(mesh, p), 1e-12f);
        middle_of(mesh, p, middle);
        for (int c = 0; c < 3; c++)
            leaf->middle[c] += area * middle[c];
        leaf->area += area;
        leaf->triangles += p->corner[3] == NO_VERTEX ? 1 : 2;
    }
    double area = 0;
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        struct leaf *leaf = &b->leaves[v];
        if (leaf->triangles == 0)
            continue;
        for (int c = 0; c < 3; c++)
            leaf->middle[c] /= leaf->area;
        leaf->code = morton(leaf->middle);
        if (leaf->triangles > SV_LEAF_TRIANGLES)
            continue;
        form->leaf_count++;
        area += (double)leaf->area;
    }
    form->leaf_area = form->leaf_count ? (float)(area / form->leaf_count) : 0;
    for (uint32_t k = 0; k < b->piece_count; k++)
        if (b->pieces[k].leaf != NO_VERTEX && b->leaves[b->pieces[k].leaf].triangles > SV_LEAF_TRIANGLES)
            b->pieces[k].leaf = NO_VERTEX;
}

static float golden(uint32_t k)
{
    double turn = k * GOLDEN;
    return (float)(turn - floor(turn));
}

static void rank_leaves(struct builder *b, struct order *order)
{
    uint32_t n = 0;
    for (uint32_t v = 0; v < b->mesh->vertex_count; v++)
        if (b->leaves[v].triangles > 0 && b->leaves[v].triangles <= SV_LEAF_TRIANGLES)
            order[n++] = (struct order){b->leaves[v].code, v};
    qsort(order, n, sizeof *order, by_key);
    for (uint32_t i = 0; i < n; i++)
        b->leaves[order[i].item].rank = golden(i);
}

static uint64_t group_of(const struct builder *b, const struct piece *p)
{
    const struct sv_tree_material *m = &b->mesh->materials[p->material];
    uint64_t card = p->corner[3] != NO_VERTEX, thins = p->leaf != NO_VERTEX;
    return (uint64_t)!m->is_leaf << 10 | (uint64_t)p->material << 2 | thins << 1 | card; /* leaves first */
}

/* Sorts the pieces, clusters then by rank inside; marks the first of each cluster in `first`. */
static void sort_pieces(struct builder *b, struct order *order, struct piece *out, uint8_t *first)
{
    uint32_t n = b->piece_count;
    for (uint32_t k = 0; k < n; k++) {
        const struct piece *p = &b->pieces[k];
        float middle[3];
        middle_of(b->mesh, p, middle);
        uint32_t code = p->leaf != NO_VERTEX ? b->leaves[p->leaf].code : morton(middle);
        order[k] = (struct order){group_of(b, p) << 32 | code, k};
    }
    qsort(order, n, sizeof *order, by_key);
    for (uint32_t k = 0; k < n;) {
        uint64_t group = order[k].key >> 32;
        uint32_t m = 1;
        while (m < SV_LEAF_CLUSTER && k + m < n && order[k + m].key >> 32 == group)
            m++;
        for (uint32_t i = k; i < k + m; i++) {
            struct piece *p = &b->pieces[order[i].item];
            p->rank = p->leaf != NO_VERTEX ? b->leaves[p->leaf].rank : golden(i);
            order[i].key = (uint64_t)((double)p->rank * 0x1p32);
        }
        qsort(order + k, m, sizeof *order, by_key);
        for (uint32_t i = k; i < k + m; i++) {
            out[i] = b->pieces[order[i].item];
            out[i].order = group;
            first[i] = i == k;
        }
        k += m;
    }
}

static uint32_t pack_normal(const int16_t n[3])
{
    uint32_t out = 0;
    for (int k = 0; k < 3; k++)
        out |= ((uint32_t)lrintf((float)n[k] * (511.0f / 32767)) & 1023) << 10 * k;
    return out;
}

static void put_record(const struct sv_tree_vertex *v, const struct piece *p, struct sv_leaf_record *record)
{
    bool card = p->corner[3] != NO_VERTEX;
    for (int c = 0; c < (card ? 4 : 3); c++) {
        const struct sv_tree_vertex *from = &v[p->corner[c]];
        record->occlusion[c] = from->occlusion;
        record->normal[c] = pack_normal(from->normal);
        memcpy(record->open[c], from->open, sizeof from->open);
    }
    record->normal[0] |= card ? SV_LEAF_CARD : 0;
    const float *uv0 = v[p->corner[0]].uv, *uv1 = v[p->corner[1]].uv, *uv2 = v[p->corner[card ? 3 : 2]].uv;
    for (int k = 0; k < 2; k++) {
        record->uv[k] = uv0[k];
        record->uv[2 + k] = uv1[k] - uv0[k];
        record->uv[4 + k] = uv2[k] - uv0[k];
    }
}

static void put_piece(const struct builder *b, const struct piece *p, struct sv_leaf_form *form, uint32_t at)
{
    struct sv_leaf_block *block = &form->blocks[at / SV_LEAF_LANES];
    struct sv_leaf_fade *fade = &form->fades[at / SV_LEAF_LANES];
    uint32_t lane = at % SV_LEAF_LANES;
    bool card = p->corner[3] != NO_VERTEX;
    const struct sv_tree_vertex *v = b->mesh->vertices;
    const struct sv_tree_vertex *p0 = &v[p->corner[0]], *p1 = &v[p->corner[1]];
    const struct sv_tree_vertex *p2 = &v[p->corner[card ? 3 : 2]];
    float middle[3];
    middle_of(b->mesh, p, middle);
    const float *about = p->leaf != NO_VERTEX ? b->leaves[p->leaf].middle : middle;
    for (int k = 0; k < 3; k++) {
        block->p0[k][lane] = p0->position[k];
        block->e1[k][lane] = p1->position[k] - p0->position[k];
        block->e2[k][lane] = p2->position[k] - p0->position[k];
        fade->middle[k][lane] = about[k];
    }
    fade->rank[lane] = p->rank;
    put_record(v, p, &form->records[at]);
    form->material[at] = p->material;
}

static void bound_cluster(const struct builder *b, const struct piece *p, uint32_t n,
                          struct sv_leaf_cluster *cluster)
{
    float lo[3] = {INFINITY, INFINITY, INFINITY}, hi[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (int pass = 0; pass < 2; pass++) {
        for (uint32_t i = 0; i < n; i++) {
            const float *about = cluster->thins ? b->leaves[p[i].leaf].middle : NULL;
            for (int c = 0; c < 4; c++) {
                if (p[i].corner[c] == NO_VERTEX)
                    continue;
                const float *corner = place(b->mesh, p[i].corner[c]), *q = about ? about : corner;
                float far_out = 0, reach = 0;
                for (int k = 0; k < 3; k++) {
                    lo[k] = fminf(lo[k], q[k]);
                    hi[k] = fmaxf(hi[k], q[k]);
                    far_out += (q[k] - cluster->middle[k]) * (q[k] - cluster->middle[k]);
                    reach += (corner[k] - q[k]) * (corner[k] - q[k]);
                }
                if (pass == 0)
                    continue;
                /* The fourth corner of a card is where the parallelogram puts it: a little wider. */
                cluster->radius = fmaxf(cluster->radius, sqrtf(far_out) * 1.001f + 1e-6f);
                cluster->reach = fmaxf(cluster->reach, sqrtf(reach) * 1.002f);
            }
        }
        for (int k = 0; k < 3 && pass == 0; k++)
            cluster->middle[k] = 0.5f * (lo[k] + hi[k]);
    }
}

static void fill(const struct builder *b, const struct piece *sorted, const uint8_t *first,
                 struct sv_leaf_form *form)
{
    uint32_t block = 0, c = 0;
    for (uint32_t k = 0; k < b->piece_count; c++) {
        uint32_t n = 1;
        while (k + n < b->piece_count && !first[k + n])
            n++;
        const struct piece *p = sorted + k;
        const struct sv_tree_material *m = &b->mesh->materials[p->material];
        struct sv_leaf_cluster *cluster = &form->clusters[c];
        *cluster = (struct sv_leaf_cluster){.block = block,
                                            .block_count = (n + SV_LEAF_LANES - 1) / SV_LEAF_LANES,
                                            .material = p->material,
                                            .card = p->corner[3] != NO_VERTEX,
                                            .thins = p->leaf != NO_VERTEX,
                                            .masked = m->masked && m->albedo.data};
        bound_cluster(b, p, n, cluster);
        for (uint32_t i = 0; i < n; i++)
            put_piece(b, &p[i], form, block * SV_LEAF_LANES + i);
        for (uint32_t at = block * SV_LEAF_LANES + n; at % SV_LEAF_LANES; at++) {
            for (int axis = 0; axis < 3; axis++)
                form->blocks[at / SV_LEAF_LANES].p0[axis][at % SV_LEAF_LANES] = NAN;
            form->fades[at / SV_LEAF_LANES].rank[at % SV_LEAF_LANES] = 2;
        }
        block += cluster->block_count;
        k += n;
    }
}

static void bound_whole(struct sv_leaf_form *form)
{
    struct sv_leaf_cluster *whole = &form->whole;
    float lo[3] = {INFINITY, INFINITY, INFINITY}, hi[3] = {-INFINITY, -INFINITY, -INFINITY};
    whole->thins = true;
    for (int pass = 0; pass < 2; pass++) {
        for (uint32_t k = 0; k < form->cluster_count; k++) {
            const struct sv_leaf_cluster *c = &form->clusters[k];
            float apart = 0;
            for (int a = 0; a < 3; a++) {
                lo[a] = fminf(lo[a], c->middle[a]);
                hi[a] = fmaxf(hi[a], c->middle[a]);
                apart += (c->middle[a] - whole->middle[a]) * (c->middle[a] - whole->middle[a]);
            }
            if (pass == 0)
                continue;
            whole->radius = fmaxf(whole->radius, (sqrtf(apart) + c->radius) * 1.001f);
            whole->reach = fmaxf(whole->reach, c->reach);
        }
        for (int a = 0; a < 3 && pass == 0; a++)
            whole->middle[a] = 0.5f * (lo[a] + hi[a]);
    }
}

/* Texels a height of each material, by the pieces' areas in texture and space. */
static void measure_densities(const struct builder *b, struct sv_leaf_form *form)
{
    double texels[SV_TREE_MATERIALS_MAX] = {0}, area[SV_TREE_MATERIALS_MAX] = {0};
    for (uint32_t k = 0; k < b->piece_count; k++) {
        const struct piece *p = &b->pieces[k];
        const struct sv_image *albedo = &b->mesh->materials[p->material].albedo;
        bool card = p->corner[3] != NO_VERTEX;
        const struct sv_tree_vertex *v = b->mesh->vertices;
        const float *a = v[p->corner[0]].uv, *c = v[p->corner[1]].uv, *d = v[p->corner[card ? 3 : 2]].uv;
        double uv = fabs((double)((c[0] - a[0]) * (d[1] - a[1]) - (c[1] - a[1]) * (d[0] - a[0])));
        texels[p->material] += uv * (card ? 1 : 0.5) * albedo->width * albedo->height;
        area[p->material] += (double)area_of(b->mesh, p);
    }
    for (int m = 0; m < b->mesh->material_count; m++) {
        double density = sqrt(texels[m] / fmax(area[m], 1e-20));
        form->maps[m].density = density < 1e9 ? (float)density : 0; /* NaN and infinity in a model: level 0 */
    }
}

static void *aligned(size_t bytes)
{
    void *p = aligned_alloc(64, (bytes + 127) / 64 * 64);
    if (p)
        memset(p, 0, (bytes + 127) / 64 * 64);
    return p;
}

static enum sv_status make_room(const uint8_t *first, uint32_t pieces, struct sv_leaf_form *form,
                                struct sv_error *error)
{
    uint32_t run = 0;
    for (uint32_t k = 0; k < pieces; k++) {
        form->cluster_count += first[k];
        run = first[k] ? 0 : run + 1;
        form->block_count += run % SV_LEAF_LANES == 0;
    }
    size_t blocks = form->block_count, lanes = blocks * SV_LEAF_LANES;
    form->blocks = aligned(blocks * sizeof *form->blocks);
    form->fades = aligned(blocks * sizeof *form->fades);
    form->clusters = calloc((size_t)form->cluster_count + 1, sizeof *form->clusters);
    form->records = aligned((lanes + 1) * sizeof *form->records);
    form->material = calloc(lanes + 1, 1);
    form->bytes = blocks * (sizeof *form->blocks + sizeof *form->fades) +
                  form->cluster_count * sizeof *form->clusters + lanes * (sizeof *form->records + 1);
    if (!form->blocks || !form->fades || !form->clusters || !form->records || !form->material)
        return sv_fail(error, SV_ENOMEM, "species", "no memory for %zu bytes of leaves", form->bytes);
    return SV_OK;
}

static enum sv_status build(struct builder *b, struct order *order, struct piece *sorted, uint8_t *first,
                            struct sv_leaf_form *form, struct sv_error *error)
{
    const struct sv_tree_mesh *mesh = b->mesh;
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        b->root[v] = v;
    for (int m = 0; m < mesh->material_count; m++)
        take_material(b, m);
    find_leaves(b, form);
    rank_leaves(b, order);
    sort_pieces(b, order, sorted, first);
    enum sv_status status = make_room(first, b->piece_count, form, error);
    if (status)
        return status;
    fill(b, sorted, first, form);
    bound_whole(form);
    measure_densities(b, form);
    return sv_leaf_maps_init(form, error);
}

enum sv_status sv_leaf_form_init(const struct sv_tree_mesh *mesh, struct sv_leaf_form *out,
                                 struct sv_error *error)
{
    struct sv_leaf_form form = {.mesh = mesh};
    size_t triangles = mesh->index_count / 3 + 1, vertices = (size_t)mesh->vertex_count + 1;
    size_t most = triangles > vertices ? triangles : vertices;
    struct builder b = {.mesh = mesh,
                        .pieces = malloc(triangles * sizeof *b.pieces),
                        .root = malloc(vertices * sizeof *b.root),
                        .leaves = calloc(vertices, sizeof *b.leaves)};
    struct piece *sorted = malloc(triangles * sizeof *sorted);
    struct order *order = malloc(most * sizeof *order);
    uint8_t *first = malloc(triangles);
    enum sv_status status;
    if (!b.pieces || !b.root || !b.leaves || !sorted || !order || !first)
        status = sv_fail(error, SV_ENOMEM, "species", "no memory to sort %zu triangles", triangles);
    else
        status = build(&b, order, sorted, first, &form, error);
    free(b.pieces);
    free(b.root);
    free(b.leaves);
    free(sorted);
    free(order);
    free(first);
    if (status)
        sv_leaf_form_finish(&form);
    else
        *out = form;
    return status;
}

void sv_leaf_form_finish(struct sv_leaf_form *form)
{
    free(form->blocks);
    free(form->fades);
    free(form->clusters);
    free(form->records);
    free(form->material);
    for (int m = 0; m < SV_TREE_MATERIALS_MAX; m++) {
        free(form->maps[m].classes);
        free(form->maps[m].levels);
    }
    *form = (struct sv_leaf_form){0};
}
