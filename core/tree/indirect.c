/* indirect.c - see indirect.h. */
#include "core/tree/indirect.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/tree/cloud_bake.h"

enum { SUB = 4 }; /* samples a side of a texel */

/* Where a piece lies as the indirect texture has it. */
struct leaf {
    float middle[2], half[2], turn; /* plane coordinates, model units, radians */
    float uv_lo[2], uv_hi[2];
    int layer; /* -1: it cannot be told (no layer left) */
    bool mirrored;
    uint8_t kind;
};

struct baker {
    const struct sv_tree_mesh *mesh;
    const struct sv_tree_cloud *cloud;
    struct sv_indirect *out;
    struct leaf *leaves; /* of each piece */
    int layer_of[SV_TREE_MATERIALS_MAX];
};

/* ---- pieces as leaves ---- */

/* Wood: the rectangle along its longest direction on the plane. */
static void measure_wood(const struct baker *b, const struct sv_cloud_piece *piece, struct leaf *leaf)
{
    struct sv_cloud_placement q;
    float sum[2] = {0}, xx = 0, xy = 0, yy = 0, lo[2] = {INFINITY, INFINITY}, hi[2] = {-INFINITY, -INFINITY};
    int count = 0;
    sv_cloud_place(b->cloud, piece, &q);
    for (int pass = 0; pass < 3; pass++)
        for (uint32_t t = 0; t < 3 * piece->triangle_count; t++) {
            struct sv_tree_vertex v =
                sv_cloud_corner(b->mesh, &b->cloud->triangles[piece->first_triangle + t / 3], (int)(t % 3));
            float p[3];
            sv_cloud_placed(&q, v.position, p);
            if (pass == 0) {
                sum[0] += p[0];
                sum[1] += p[1];
                count++;
                continue;
            }
            float x = p[0] - sum[0] / (float)count, y = p[1] - sum[1] / (float)count;
            if (pass == 1) {
                xx += x * x;
                xy += x * y;
                yy += y * y;
                leaf->turn = 0.5f * atan2f(2 * xy, xx - yy);
                continue;
            }
            float c = cosf(leaf->turn), s = sinf(leaf->turn), at[2] = {c * x + s * y, c * y - s * x};
            for (int k = 0; k < 2; k++) {
                lo[k] = fminf(lo[k], at[k]);
                hi[k] = fmaxf(hi[k], at[k]);
            }
        }
    float c = cosf(leaf->turn), s = sinf(leaf->turn), mid[2];
    for (int k = 0; k < 2; k++) {
        mid[k] = 0.5f * (lo[k] + hi[k]);
        leaf->half[k] = 0.5f * (hi[k] - lo[k]);
        leaf->uv_lo[k] = 0.25f;
        leaf->uv_hi[k] = 0.75f;
    }
    leaf->middle[0] = sum[0] / (float)count + c * mid[0] - s * mid[1];
    leaf->middle[1] = sum[1] / (float)count + s * mid[0] + c * mid[1];
}

/* The middle of the texture's box, by the piece's own frame: its centre is that of its polygons. */
static void measure_leaf(const struct baker *b, const struct sv_cloud_piece *piece, struct leaf *leaf)
{
    float c = cosf(piece->rotation), s = sinf(piece->rotation), box[2],
          down = piece->flags & SV_CLOUD_MIRRORED ? 1 : -1;
    struct sv_cloud_placement q;
    double mean[2] = {0}, weight = 0;
    sv_cloud_place(b->cloud, piece, &q);
    for (int k = 0; k < 2; k++) {
        leaf->half[k] = 0.5f * piece->size[k];
        leaf->uv_lo[k] = piece->uv_lo[k];
        leaf->uv_hi[k] = piece->uv_hi[k];
        box[k] = piece->uv_hi[k] - piece->uv_lo[k];
    }
    for (uint32_t t = 0; t < 3 * piece->triangle_count; t++) {
        struct sv_tree_vertex v =
            sv_cloud_corner(b->mesh, &b->cloud->triangles[piece->first_triangle + t / 3], (int)(t % 3));
        float p[3];
        sv_cloud_placed(&q, v.position, p);
        float u = box[0] > 0 ? (v.uv[0] - piece->uv_lo[0]) / box[0] - 0.5f : 0;
        float w = box[1] > 0 ? (v.uv[1] - piece->uv_lo[1]) / box[1] - 0.5f : 0;
        float x = u * piece->size[0], y = down * w * piece->size[1];
        mean[0] += (double)(p[0] - (c * x - s * y));
        mean[1] += (double)(p[1] - (s * x + c * y));
        weight += 1;
    }
    leaf->middle[0] = weight > 0 ? (float)(mean[0] / weight) : piece->at[0];
    leaf->middle[1] = weight > 0 ? (float)(mean[1] / weight) : piece->at[1];
    leaf->turn = piece->rotation;
    leaf->mirrored = piece->flags & SV_CLOUD_MIRRORED;
}

static void measure_pieces(struct baker *b)
{
    for (uint32_t i = 0; i < b->cloud->piece_count; i++) {
        const struct sv_cloud_piece *piece = &b->cloud->pieces[i];
        struct leaf *leaf = &b->leaves[i];
        *leaf = (struct leaf){.layer = b->layer_of[piece->material]};
        bool placed = piece->flags & SV_CLOUD_LEAF && piece->flags & SV_CLOUD_PLACED;
        if (placed)
            measure_leaf(b, piece, leaf);
        else
            measure_wood(b, piece, leaf);
        if (!placed) /* a part of the texture that it may have: its middle half */
            for (int k = 0; k < 2; k++) {
                float mid = 0.5f * (piece->uv_lo[k] + piece->uv_hi[k]),
                      box = piece->uv_hi[k] - piece->uv_lo[k];
                box = box < 1 ? box : 1;
                leaf->uv_lo[k] = piece->flags & SV_CLOUD_LEAF ? mid - 0.25f * box : 0.25f;
                leaf->uv_hi[k] = piece->flags & SV_CLOUD_LEAF ? mid + 0.25f * box : 0.75f;
            }
        for (int k = 0; k < 2; k++)
            leaf->half[k] = fmaxf(leaf->half[k], 1e-5f);
    }
}

/* ---- kinds ---- */

/* What leaves of one kind have in common, rounded. */
struct key {
    int layer, box[4], size[2];
};

static struct key key_of(const struct leaf *leaf, double box_step, double size_step)
{
    struct key k = {.layer = 2 * leaf->layer + leaf->mirrored};
    for (int c = 0; c < 2; c++) {
        float base = floorf(leaf->uv_lo[c]);
        k.box[c] = (int)lrint((double)(leaf->uv_lo[c] - base) / box_step);
        k.box[2 + c] = (int)lrint((double)(leaf->uv_hi[c] - base) / box_step);
        k.size[c] = (int)lrint(log2((double)leaf->half[c]) / size_step);
    }
    return k;
}

struct kind_sums {
    struct key key;
    double half[2], lo[2], hi[2], count;
};

/* Numbers the kinds at these steps; false when there are too many. */
static bool try_kinds(struct baker *b, double box_step, double size_step, struct kind_sums *sums, int *count)
{
    *count = 1;
    for (uint32_t i = 0; i < b->cloud->piece_count; i++) {
        struct leaf *leaf = &b->leaves[i];
        struct key key = key_of(leaf, box_step, size_step);
        int k = 1;
        leaf->kind = 0;
        if (leaf->layer < 0)
            continue;
        while (k < *count && memcmp(&sums[k].key, &key, sizeof key) != 0)
            k++;
        if (k == SV_INDIRECT_KINDS)
            return false;
        if (k == *count) {
            sums[k] = (struct kind_sums){.key = key};
            ++*count;
        }
        leaf->kind = (uint8_t)k;
        for (int c = 0; c < 2; c++) {
            double base = floor((double)leaf->uv_lo[c]);
            sums[k].half[c] += (double)leaf->half[c];
            sums[k].lo[c] += (double)leaf->uv_lo[c] - base;
            sums[k].hi[c] += (double)leaf->uv_hi[c] - base;
        }
        sums[k].count++;
    }
    return true;
}

static void make_kinds(struct baker *b)
{
    struct kind_sums sums[SV_INDIRECT_KINDS];
    int count = 1;
    double box_step = 1.0 / 256, size_step = 0.125;
    while (!try_kinds(b, box_step, size_step, sums, &count)) {
        size_step *= 2;
        box_step *= size_step > 0.5 ? 2 : 1;
    }
    b->out->kind_count = count;
    b->out->kinds[0].half[0] = b->out->kinds[0].half[1] = 1; /* the shader divides by it */
    for (int k = 1; k < count; k++) {
        struct sv_indirect_kind *kind = &b->out->kinds[k];
        for (int c = 0; c < 2; c++) {
            kind->half[c] = (float)(sums[k].half[c] / sums[k].count);
            kind->uv_lo[c] = (float)(sums[k].lo[c] / sums[k].count);
            kind->uv_hi[c] = (float)(sums[k].hi[c] / sums[k].count);
        }
        kind->layer = 0.5f * (float)sums[k].key.layer;
    }
    /* An offset reaches from any texel that a leaf touches to its middle. */
    for (uint32_t i = 0; i < b->cloud->piece_count; i++) {
        const struct leaf *leaf = &b->leaves[i];
        const struct sv_cloud_plane *plane = &b->cloud->planes[b->cloud->pieces[i].plane];
        float step = 1.0f / (float)b->out->side, texel = hypotf(plane->half[0] * step, plane->half[1] * step);
        float *reach = &b->out->kinds[leaf->kind].reach;
        if (leaf->kind)
            *reach = fmaxf(*reach, hypotf(leaf->half[0], leaf->half[1]) + texel);
    }
}

/* ---- texels ---- */

static uint8_t offset_code(float v)
{
    return (uint8_t)lrintf(128 + 127 * fminf(fmaxf(v, -1), 1));
}

static void put_texel(const struct baker *b, const struct sv_cloud_plane *plane, int i, int j,
                      const struct leaf *leaf, uint8_t out[4])
{
    const struct sv_indirect_kind *kind = &b->out->kinds[leaf->kind];
    float side = (float)b->out->side, turn = leaf->turn / (2 * 3.14159265f);
    float at[2] = {plane->half[0] * (2 * ((float)i + 0.5f) / side - 1),
                   plane->half[1] * (1 - 2 * ((float)j + 0.5f) / side)};
    for (int c = 0; c < 2; c++)
        out[c] = offset_code((leaf->middle[c] - at[c]) / kind->reach);
    out[2] = (uint8_t)(lrintf((turn - floorf(turn)) * 256) & 255);
    out[3] = leaf->kind;
}

/* The piece that most samples of the texel show; UINT32_MAX: none. */
static uint32_t most_seen(const struct sv_cloud_bake *bake, int i, int j)
{
    uint32_t piece[SUB * SUB], best = UINT32_MAX;
    int votes[SUB * SUB], count = 0, most = 0;
    for (int k = 0; k < SUB * SUB; k++) {
        int x = i * SUB + k % SUB, y = j * SUB + k / SUB, n = 0;
        if (!sv_cloud_bake_covered(bake, x, y))
            continue;
        uint32_t p = sv_cloud_bake_piece(bake, x, y);
        while (n < count && piece[n] != p)
            n++;
        if (n == count) {
            piece[count] = p;
            votes[count++] = 0;
        }
        if (++votes[n] > most) {
            most = votes[n];
            best = p;
        }
    }
    return best;
}

static enum sv_status bake_planes(struct baker *b, struct sv_error *error)
{
    struct sv_cloud_bake bake = {.plane = -1};
    int side = b->out->side;
    enum sv_status status = sv_cloud_bake_init(b->mesh, b->cloud, side * SUB, side * SUB, &bake, error);
    for (int k = 0; !status && k < b->cloud->plane_count; k++) {
        uint8_t *out = b->out->texels + 4 * (size_t)k * (size_t)side * (size_t)side;
        status = sv_cloud_bake_draw(&bake, k, side * SUB, side * SUB, error);
        for (int j = 0; !status && j < side; j++)
            for (int i = 0; i < side; i++, out += 4) {
                uint32_t piece = most_seen(&bake, i, j);
                if (piece != UINT32_MAX && b->leaves[piece].kind)
                    put_texel(b, &b->cloud->planes[k], i, j, &b->leaves[piece], out);
            }
    }
    sv_cloud_bake_finish(&bake);
    return status;
}

/* ---- leaf textures ---- */

static size_t leaf_level_bytes(const struct sv_indirect *t, int level)
{
    size_t side = (size_t)(SV_INDIRECT_LEAF_SIDE >> level);
    return 4 * side * side * (size_t)t->layer_count;
}

enum { LEAF_LEVELS = 9 };
_Static_assert(SV_INDIRECT_LEAF_SIDE >> (LEAF_LEVELS - 1) == 1, "the last level has one texel");

static size_t leaf_bytes(const struct sv_indirect *t)
{
    size_t bytes = 0;
    for (int k = 0; k < LEAF_LEVELS; k++)
        bytes += leaf_level_bytes(t, k);
    return bytes;
}

/* Means of 2 x 2 by coverage; where there is none, of colours. */
static void shrink_leaf(const float *from, int side, float *to)
{
    for (int j = 0; j < side; j++)
        for (int i = 0; i < side; i++, to += 4) {
            const float *p[4];
            float sum = 0;
            for (int k = 0; k < 4; k++) {
                p[k] = from + 4 * ((size_t)(2 * j + k / 2) * 2 * (size_t)side + (size_t)(2 * i + k % 2));
                sum += p[k][3];
            }
            for (int c = 0; c < 3; c++) {
                to[c] = 0;
                for (int k = 0; k < 4; k++)
                    to[c] += p[k][c] * (sum > 0 ? p[k][3] / sum : 0.25f);
            }
            to[3] = sum / 4;
        }
}

/* A material's texture through the alpha test, by 3 x 3 samples a texel. */
static void read_material(const struct sv_raster *r, int material, float *out)
{
    for (int j = 0; j < SV_INDIRECT_LEAF_SIDE; j++)
        for (int i = 0; i < SV_INDIRECT_LEAF_SIDE; i++, out += 4) {
            float kept[3] = {0}, all[3] = {0}, count = 0;
            for (int k = 0; k < 9; k++) {
                float u = ((float)i + ((float)(k % 3) + 0.5f) / 3) / SV_INDIRECT_LEAF_SIDE;
                float v = ((float)j + ((float)(k / 3) + 0.5f) / 3) / SV_INDIRECT_LEAF_SIDE, rgb[3];
                bool keep = sv_raster_kept(r, material, u, v);
                sv_raster_color(r, material, u, v, rgb);
                count += (float)keep;
                for (int c = 0; c < 3; c++) {
                    kept[c] += keep ? rgb[c] : 0;
                    all[c] += rgb[c];
                }
            }
            for (int c = 0; c < 3; c++)
                out[c] = count > 0 ? kept[c] / count : all[c] / 9;
            out[3] = count / 9;
        }
}

static enum sv_status bake_leaves(struct baker *b, struct sv_error *error)
{
    size_t texels = (size_t)SV_INDIRECT_LEAF_SIDE * SV_INDIRECT_LEAF_SIDE;
    struct sv_raster r = {0};
    float *a = malloc(4 * texels * sizeof *a), *next = malloc(texels * sizeof *next);
    enum sv_status status = sv_raster_init(b->mesh, 1, 1, &r, error);
    if (!status && (!a || !next))
        status = sv_fail(error, SV_ENOMEM, "indirect", "no memory for a leaf texture");
    for (int m = 0; !status && m < b->mesh->material_count; m++) {
        uint8_t *level = b->out->leaves;
        if (b->layer_of[m] < 0)
            continue;
        read_material(&r, m, a);
        for (int k = 0; k < LEAF_LEVELS; k++) {
            int side = SV_INDIRECT_LEAF_SIDE >> k;
            uint8_t *out = level + 4 * (size_t)b->layer_of[m] * (size_t)side * (size_t)side;
            for (size_t i = 0; i < (size_t)side * (size_t)side; i++) {
                for (size_t c = 0; c < 3; c++)
                    out[4 * i + c] = sv_srgb8_from_linear(a[4 * i + c]);
                out[4 * i + 3] = (uint8_t)(a[4 * i + 3] * 255 + 0.5f);
            }
            level += leaf_level_bytes(b->out, k);
            if (side > 1) {
                shrink_leaf(a, side / 2, next);
                memcpy(a, next, 4 * sizeof *a * (size_t)(side / 2) * (size_t)(side / 2));
            }
        }
    }
    sv_raster_finish(&r);
    free(a);
    free(next);
    return status;
}

/* ---- the whole ---- */

static size_t texel_bytes(const struct sv_indirect *t)
{
    return 4 * (size_t)t->plane_count * (size_t)t->side * (size_t)t->side;
}

void sv_indirect_finish(struct sv_indirect *t)
{
    free(t->texels);
    free(t->leaves);
    sv_billboards_finish(&t->base);
    memset(t, 0, sizeof *t);
}

size_t sv_indirect_bytes(const struct sv_indirect *t)
{
    return texel_bytes(t) + leaf_bytes(t) + t->base.bytes + (size_t)t->kind_count * sizeof *t->kinds;
}

size_t sv_indirect_most_bytes(const struct sv_tree_mesh *mesh, const struct sv_indirect_options *options,
                              int planes)
{
    struct sv_indirect t = {.plane_count = planes, .side = options->side, .kind_count = SV_INDIRECT_KINDS};
    t.base.bytes = sv_billboards_bytes(&options->base, planes);
    for (int m = 0; m < mesh->material_count; m++)
        t.layer_count += mesh->materials[m].index_count > 0 && t.layer_count < SV_INDIRECT_LAYERS_MAX;
    return sv_indirect_bytes(&t);
}

static bool is_side(int side)
{
    return side >= 16 && side <= 1024 && (side & (side - 1)) == 0;
}

enum sv_status sv_indirect_bake(const struct sv_tree_mesh *mesh, const struct sv_tree_cloud *cloud,
                                const struct sv_indirect_options *options, struct sv_indirect *out,
                                struct sv_error *error)
{
    struct sv_indirect made = {.plane_count = cloud->plane_count, .side = options->side};
    struct baker b = {.mesh = mesh, .cloud = cloud, .out = &made};
    if (!is_side(options->side))
        return sv_fail(error, SV_EINVAL, "indirect", "side %d is not a power of two of 16 .. 1024",
                       options->side);
    for (int m = 0; m < mesh->material_count; m++)
        b.layer_of[m] = mesh->materials[m].index_count > 0 && made.layer_count < SV_INDIRECT_LAYERS_MAX
                            ? made.layer_count++
                            : -1;
    b.leaves = malloc(((size_t)cloud->piece_count + 1) * sizeof *b.leaves);
    made.texels = calloc(texel_bytes(&made), 1);
    made.leaves = malloc(leaf_bytes(&made) + 1);
    enum sv_status status = SV_OK;
    if (!b.leaves || !made.texels || !made.leaves)
        status = sv_fail(error, SV_ENOMEM, "indirect", "no memory for %d pictures of %d a side",
                         made.plane_count, made.side);
    if (!status) {
        measure_pieces(&b);
        make_kinds(&b);
        status = bake_planes(&b, error);
    }
    if (!status)
        status = bake_leaves(&b, error);
    if (!status)
        status = sv_billboards_bake(mesh, cloud, &options->base, &made.base, error);
    free(b.leaves);
    if (status)
        sv_indirect_finish(&made);
    else
        *out = made;
    return status;
}

int sv_indirect_leaf_at(const struct sv_indirect *t, int plane, const float half[2], float x, float y,
                        float uv[2])
{
    int side = t->side;
    float s = 0.5f * (x / half[0] + 1), r = 0.5f * (1 - y / half[1]);
    int i = (int)floorf(s * (float)side), j = (int)floorf(r * (float)side);
    i = i < 0 ? 0 : i >= side ? side - 1 : i;
    j = j < 0 ? 0 : j >= side ? side - 1 : j;
    const uint8_t *code =
        t->texels + 4 * (((size_t)plane * (size_t)side + (size_t)j) * (size_t)side + (size_t)i);
    const struct sv_indirect_kind *kind = &t->kinds[code[3]];
    if (code[3] == 0)
        return 0;
    float texel[2] = {half[0] * (2 * ((float)i + 0.5f) / (float)side - 1),
                      half[1] * (1 - 2 * ((float)j + 0.5f) / (float)side)};
    float d[2] = {x - texel[0] - ((float)code[0] - 128) / 127 * kind->reach,
                  y - texel[1] - ((float)code[1] - 128) / 127 * kind->reach};
    float a = (float)code[2] * (6.28318531f / 256), c = cosf(a), n = sinf(a);
    float along[2] = {(c * d[0] + n * d[1]) / kind->half[0], (c * d[1] - n * d[0]) / kind->half[1]};
    if (fabsf(along[0]) > 1 || fabsf(along[1]) > 1)
        return 0;
    float mirror = kind->layer - floorf(kind->layer) > 0.25f ? -1 : 1;
    uv[0] = kind->uv_lo[0] + (kind->uv_hi[0] - kind->uv_lo[0]) * (0.5f + 0.5f * along[0]);
    uv[1] = kind->uv_lo[1] + (kind->uv_hi[1] - kind->uv_lo[1]) * (0.5f - 0.5f * mirror * along[1]);
    return code[3];
}
