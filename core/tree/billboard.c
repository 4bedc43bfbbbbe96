/* billboard.c - see billboard.h.
 *
 * A plane is drawn once, with samples x samples a texel; sums of all that is kept (premultiplied) go down the
 * pyramid by boxes of 2 x 2, then what is empty takes what the level above has ("push-pull"), and each part
 * is cut from its level on. */
#include "core/tree/billboard.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/image/dxt.h"
#include "core/tree/cloud_bake.h"
#include "core/tree/least_squares.h"

/* What is summed a texel, each times coverage. */
enum { COVERAGE, RED, NORMAL = RED + 3, OCCLUSION = NORMAL + 3, OPEN, CHANNELS = OPEN + 4 };

static const float DIAGONAL = 0.70710678f;

struct pyramid {
    int levels, side;
    float *level[SV_BILLBOARD_LEVELS_MAX]; /* CHANNELS a texel; one heap block at level[0] */
    double leaf[SV_UNKNOWNS_MAX][SV_UNKNOWNS_MAX + 1];
    uint8_t *rgba; /* of one level */
    float target;  /* sum of the planes' coverage */
};

/* ---- sizes ---- */

static int log2_of(int side)
{
    int k = 0;
    while (side >> (k + 1))
        k++;
    return k;
}

static size_t picture_bytes(enum sv_billboard_part part, int side)
{
    return part == SV_BILLBOARD_COLOR ? sv_dxt5_bytes(side, side) : 4 * (size_t)side * (size_t)side;
}

static size_t total_bytes(const struct sv_billboards *b)
{
    size_t bytes = 0;
    for (int part = 0; part < SV_BILLBOARD_PARTS; part++)
        for (int k = 0; k < b->levels[part]; k++)
            bytes += (size_t)b->plane_count * picture_bytes((enum sv_billboard_part)part, b->side[part] >> k);
    return bytes;
}

static size_t offset_of(const struct sv_billboards *b, enum sv_billboard_part part, int level)
{
    size_t at = 0;
    for (int p = 0; p <= (int)part; p++)
        for (int k = 0; k < (p == (int)part ? level : b->levels[p]); k++)
            at += (size_t)b->plane_count * picture_bytes((enum sv_billboard_part)p, b->side[p] >> k);
    return at;
}

const uint8_t *sv_billboards_level(const struct sv_billboards *b, enum sv_billboard_part part, int level,
                                   size_t *bytes)
{
    *bytes = picture_bytes(part, b->side[part] >> level);
    return b->data + offset_of(b, part, level);
}

static uint8_t *picture_of(const struct sv_billboards *b, enum sv_billboard_part part, int level, int plane)
{
    return b->data + offset_of(b, part, level) + (size_t)plane * picture_bytes(part, b->side[part] >> level);
}

/* ---- coverage ---- */

/* Share of the bilinear picture, tested at the texels' centres, edges and corners, that is >= bar. */
static double share_above(const float *coverage, int side, float bar)
{
    size_t passed = 0;
    for (int j = 0; j < side; j++) {
        const float *row = coverage + (size_t)j * (size_t)side;
        const float *below = coverage + (size_t)(j + 1 < side ? j + 1 : j) * (size_t)side;
        for (int i = 0; i < side; i++) {
            int next = i + 1 < side ? i + 1 : i;
            float a = row[i], b = row[next], c = below[i], d = below[next];
            passed += (size_t)(a >= bar) + (size_t)(a + b >= 2 * bar) + (size_t)(a + c >= 2 * bar) +
                      (size_t)(a + b + c + d >= 4 * bar);
        }
    }
    return (double)passed / (4.0 * side * side);
}

float sv_coverage_bar(const float *coverage, int side, double target)
{
    float low = 0, high = 1, best = 0.5f;
    double least = INFINITY;
    /* The share falls as the bar rises; 10 halvings settle the bar to a quarter of an 8-bit step. */
    for (int step = 0; step < 10; step++) {
        float bar = 0.5f * (low + high);
        double share = share_above(coverage, side, bar);
        if (fabs(share - target) < least) {
            least = fabs(share - target);
            best = bar;
        }
        if (share > target)
            low = bar;
        else
            high = bar;
    }
    return best;
}

/* ---- one plane ---- */

static enum sv_status pyramid_init(struct pyramid *p, int side, struct sv_error *error)
{
    size_t texels = 0;
    *p = (struct pyramid){.side = side, .levels = log2_of(side) + 1};
    for (int k = 0; k < p->levels; k++)
        texels += (size_t)(side >> k) * (size_t)(side >> k);
    p->level[0] = malloc(texels * CHANNELS * sizeof(float));
    p->rgba = malloc(4 * (size_t)side * (size_t)side);
    if (!p->level[0] || !p->rgba) {
        free(p->level[0]);
        free(p->rgba);
        return sv_fail(error, SV_ENOMEM, "billboards", "no memory to bake pictures of %d x %d", side, side);
    }
    for (int k = 1; k < p->levels; k++)
        p->level[k] = p->level[k - 1] + CHANNELS * (size_t)(side >> (k - 1)) * (size_t)(side >> (k - 1));
    return SV_OK;
}

static void pyramid_finish(struct pyramid *p)
{
    free(p->level[0]);
    free(p->rgba);
}

static void fill_level_0(const struct sv_cloud_bake *bake, const struct sv_cloud_plane *plane, int samples,
                         struct pyramid *p)
{
    memset(p->level[0], 0, CHANNELS * sizeof(float) * (size_t)p->side * (size_t)p->side);
    for (int j = 0; j < p->side; j++)
        for (int i = 0; i < p->side; i++) {
            struct sv_cloud_texel t;
            float *out = p->level[0] + CHANNELS * ((size_t)j * (size_t)p->side + (size_t)i);
            sv_cloud_bake_texel(bake, i, j, samples, &t);
            if (t.coverage <= 0)
                continue;
            out[COVERAGE] = t.coverage;
            for (int c = 0; c < 3; c++) {
                out[RED + c] = t.coverage * t.rgb[c];
                out[NORMAL + c] = t.coverage * (t.normal[0] * plane->u[c] + t.normal[1] * plane->v[c] +
                                                t.normal[2] * plane->normal[c]);
            }
            out[OCCLUSION] = t.coverage * t.occlusion;
            for (int c = 0; c < 4; c++)
                out[OPEN + c] = t.coverage * t.open[c];
            const double row[4] = {(double)t.rgb[0], (double)t.rgb[1], (double)t.rgb[2], 1};
            if ((i + j) % 4 == 0) /* a quarter of all tells as much */
                sv_least_squares_add(p->leaf, 4, row, (double)t.translucency, (double)t.coverage);
        }
}

static void shrink(struct pyramid *p, int level)
{
    int side = p->side >> level;
    const float *from = p->level[level - 1];
    for (int j = 0; j < side; j++)
        for (int i = 0; i < side; i++) {
            const float *a = from + CHANNELS * (2 * (size_t)j * 2 * (size_t)side + 2 * (size_t)i);
            const float *b = a + CHANNELS * 2 * (size_t)side;
            float *out = p->level[level] + CHANNELS * ((size_t)j * (size_t)side + (size_t)i);
            for (int c = 0; c < CHANNELS; c++)
                out[c] = 0.25f * (a[c] + a[CHANNELS + c] + b[c] + b[CHANNELS + c]);
        }
}

/* Sums become means; empty texels take the level above's. */
static void straighten(struct pyramid *p, int level)
{
    int side = p->side >> level;
    for (int j = 0; j < side; j++)
        for (int i = 0; i < side; i++) {
            float *t = p->level[level] + CHANNELS * ((size_t)j * (size_t)side + (size_t)i);
            if (t[COVERAGE] > 0) {
                float each = 1 / t[COVERAGE];
                for (int c = RED; c < CHANNELS; c++)
                    t[c] *= each;
            } else if (level + 1 < p->levels) {
                const float *up =
                    p->level[level + 1] + CHANNELS * ((size_t)(j / 2) * (size_t)(side / 2) + (size_t)(i / 2));
                memcpy(t + RED, up + RED, (CHANNELS - RED) * sizeof *t);
            }
        }
}

static uint8_t code(float v)
{
    return (uint8_t)(fminf(fmaxf(v, 0), 1) * 255.0f + 0.5f);
}

/* Gives the bar of an alpha test. */
static float put_color(const struct pyramid *p, int level, double target, float *scratch, uint8_t *blocks)
{
    int side = p->side >> level;
    size_t texels = (size_t)side * (size_t)side;
    for (size_t k = 0; k < texels; k++) {
        const float *t = p->level[level] + CHANNELS * k;
        for (int c = 0; c < 3; c++)
            p->rgba[4 * k + (size_t)c] = sv_srgb8_from_linear(t[RED + c]);
        p->rgba[4 * k + 3] = code(t[COVERAGE]);
        scratch[k] = t[COVERAGE];
    }
    sv_dxt5_encode(p->rgba, side, side, blocks);
    return sv_coverage_bar(scratch, side, target);
}

static void put_normal(const struct pyramid *p, int level, uint8_t *out)
{
    size_t texels = (size_t)(p->side >> level) * (size_t)(p->side >> level);
    for (size_t k = 0; k < texels; k++) {
        const float *t = p->level[level] + CHANNELS * k;
        for (int c = 0; c < 3; c++)
            out[4 * k + (size_t)c] = code(0.5f + 0.5f * t[NORMAL + c]);
        out[4 * k + 3] = code(t[OCCLUSION]);
    }
}

static void put_light(const struct pyramid *p, int level, uint8_t *out)
{
    size_t texels = (size_t)(p->side >> level) * (size_t)(p->side >> level);
    for (size_t k = 0; k < texels; k++) {
        const float *t = p->level[level] + CHANNELS * k;
        for (int c = 0; c < 3; c++)
            out[4 * k + (size_t)c] = code(0.5f + 0.5f * t[OPEN + c]);
        out[4 * k + 3] = code(t[OPEN + 3]);
    }
}

static void set_outline(const struct pyramid *p, float outline[SV_BILLBOARD_OUTLINE])
{
    static const float a[SV_BILLBOARD_OUTLINE] = {1, DIAGONAL, 0, -DIAGONAL, -1, -DIAGONAL, 0, DIAGONAL};
    for (int k = 0; k < SV_BILLBOARD_OUTLINE; k++)
        outline[k] = -INFINITY;
    for (int j = 0; j < p->side; j++)
        for (int i = 0; i < p->side; i++) {
            if (!(p->level[0][CHANNELS * ((size_t)j * (size_t)p->side + (size_t)i) + COVERAGE] > 0))
                continue;
            float s = ((float)i + 0.5f) / (float)p->side, t = ((float)j + 0.5f) / (float)p->side;
            for (int k = 0; k < SV_BILLBOARD_OUTLINE; k++)
                outline[k] = fmaxf(outline[k], a[k] * s + a[(k + 6) % SV_BILLBOARD_OUTLINE] * t);
        }
    /* A coarse level's texels reach further out; the rectangle ends it. */
    static const float most[SV_BILLBOARD_OUTLINE] = {1, 2 * DIAGONAL, 1, DIAGONAL, 0, 0, 0, DIAGONAL};
    for (int k = 0; k < SV_BILLBOARD_OUTLINE; k++)
        outline[k] = fminf(outline[k] + 0.008f, most[k]);
}

static enum sv_status bake_plane(struct sv_cloud_bake *bake, int plane, int samples, struct pyramid *p,
                                 float *scratch, struct sv_billboards *b, struct sv_error *error)
{
    double target = 0;
    enum sv_status status = sv_cloud_bake_draw(bake, plane, p->side * samples, p->side * samples, error);
    if (status)
        return status;
    fill_level_0(bake, &bake->cloud->planes[plane], samples, p);
    set_outline(p, b->outline[plane]);
    for (int k = 1; k < p->levels; k++)
        shrink(p, k);
    target = (double)p->level[p->levels - 1][COVERAGE];
    for (int k = p->levels - 1; k >= 0; k--)
        straighten(p, k);
    for (int k = 0; k < b->levels[SV_BILLBOARD_COLOR]; k++)
        b->bar[k] +=
            (float)target * put_color(p, k, target, scratch, picture_of(b, SV_BILLBOARD_COLOR, k, plane));
    p->target += (float)target;
    int first = log2_of(p->side / b->side[SV_BILLBOARD_NORMAL]);
    for (int k = 0; k < b->levels[SV_BILLBOARD_NORMAL]; k++)
        put_normal(p, first + k, picture_of(b, SV_BILLBOARD_NORMAL, k, plane));
    first = log2_of(p->side / b->side[SV_BILLBOARD_LIGHT]);
    for (int k = 0; k < b->levels[SV_BILLBOARD_LIGHT]; k++)
        put_light(p, first + k, picture_of(b, SV_BILLBOARD_LIGHT, k, plane));
    return SV_OK;
}

/* ---- the whole ---- */

static bool is_side(int side, int most)
{
    return side >= 4 && side <= most && (side & (side - 1)) == 0;
}

static struct sv_billboards of_sizes(const struct sv_billboard_options *o, int planes)
{
    struct sv_billboards b = {.plane_count = planes, .side = {o->color_side, o->normal_side, o->light_side}};
    for (int part = 0; part < SV_BILLBOARD_PARTS; part++)
        b.levels[part] = part == SV_BILLBOARD_LIGHT ? 1 : log2_of(b.side[part]) + 1;
    b.bytes = total_bytes(&b);
    return b;
}

size_t sv_billboards_bytes(const struct sv_billboard_options *options, int planes)
{
    return of_sizes(options, planes).bytes;
}

enum sv_status sv_billboards_bake(const struct sv_tree_mesh *mesh, const struct sv_tree_cloud *cloud,
                                  const struct sv_billboard_options *o, struct sv_billboards *out,
                                  struct sv_error *error)
{
    if (!is_side(o->color_side, 4096) || !is_side(o->normal_side, o->color_side) ||
        !is_side(o->light_side, o->color_side) || o->samples < 1 || o->samples > 4 ||
        o->color_side * o->samples > SV_CLOUD_BAKE_SIDE_MAX)
        return sv_fail(error, SV_EINVAL, "billboards",
                       "sides %d, %d, %d with %d samples are not powers of two in range", o->color_side,
                       o->normal_side, o->light_side, o->samples);
    struct sv_billboards made = of_sizes(o, cloud->plane_count);
    struct sv_cloud_bake bake = {.plane = -1};
    struct pyramid p;
    made.data = malloc(made.bytes);
    float *scratch = malloc(sizeof(float) * (size_t)o->color_side * (size_t)o->color_side);
    enum sv_status status = pyramid_init(&p, o->color_side, error);
    bool pyramid = status == SV_OK;
    if (!status && (!made.data || !scratch))
        status = sv_fail(error, SV_ENOMEM, "billboards", "no memory for %zu bytes", made.bytes);
    if (!status)
        status = sv_cloud_bake_init(mesh, cloud, o->color_side * o->samples, o->color_side * o->samples,
                                    &bake, error);
    for (int k = 0; !status && k < cloud->plane_count; k++)
        status = bake_plane(&bake, k, o->samples, &p, scratch, &made, error);
    for (int k = 0; !status && k < SV_BILLBOARD_LEVELS_MAX; k++)
        made.bar[k] = p.target > 0 && made.bar[k] > 0 ? made.bar[k] / p.target : 0.5f;
    if (!status)
        sv_translucency_rule(p.leaf, made.translucency);
    sv_cloud_bake_finish(&bake);
    if (pyramid)
        pyramid_finish(&p);
    free(scratch);
    if (status)
        sv_billboards_finish(&made);
    else
        *out = made;
    return status;
}

void sv_billboards_finish(struct sv_billboards *b)
{
    free(b->data);
    memset(b, 0, sizeof *b);
}

/* ---- bytes ---- */

static const char MAGIC[8] = {'S', 'V', 'B', 'I', 'L', 'L', 'B', 1};
enum { BYTE_ORDER_MARK = 0x01020304 };

struct file_header {
    char magic[8];
    uint32_t byte_order, plane_count, side[SV_BILLBOARD_PARTS];
    float translucency[4], bar[SV_BILLBOARD_LEVELS_MAX];
};

enum sv_status sv_billboards_save(const struct sv_billboards *b, void **data, size_t *bytes,
                                  struct sv_error *error)
{
    struct file_header h = {.byte_order = BYTE_ORDER_MARK, .plane_count = (uint32_t)b->plane_count};
    size_t outlines = (size_t)b->plane_count * sizeof *b->outline, size = sizeof h + outlines + b->bytes;
    unsigned char *block = malloc(size);
    if (!block)
        return sv_fail(error, SV_ENOMEM, "billboards", "no memory for %zu saved bytes", size);
    memcpy(h.magic, MAGIC, sizeof h.magic);
    for (int part = 0; part < SV_BILLBOARD_PARTS; part++)
        h.side[part] = (uint32_t)b->side[part];
    memcpy(h.translucency, b->translucency, sizeof h.translucency);
    memcpy(h.bar, b->bar, sizeof h.bar);
    memcpy(block, &h, sizeof h);
    memcpy(block + sizeof h, b->outline, outlines);
    memcpy(block + sizeof h + outlines, b->data, b->bytes);
    *data = block;
    *bytes = size;
    return SV_OK;
}

enum sv_status sv_billboards_load(const void *data, size_t bytes, struct sv_billboards *out,
                                  struct sv_error *error)
{
    struct file_header h;
    struct sv_billboards b = {0};
    bool sound = data && bytes >= sizeof h;
    if (sound) {
        memcpy(&h, data, sizeof h);
        sound = memcmp(h.magic, MAGIC, sizeof h.magic) == 0 && h.byte_order == BYTE_ORDER_MARK &&
                h.plane_count >= 1 && h.plane_count <= SV_CLOUD_PLANES_MAX;
    }
    for (int part = 0; sound && part < SV_BILLBOARD_PARTS; part++) {
        sound = h.side[part] <= 4096 && is_side((int)h.side[part], part ? b.side[0] : 4096);
        b.side[part] = (int)h.side[part];
        b.levels[part] = sound ? part == SV_BILLBOARD_LIGHT ? 1 : log2_of(b.side[part]) + 1 : 0;
    }
    if (!sound)
        return sv_fail(error, SV_EFORMAT, "billboards", "the bytes are not saved billboard textures");
    b.plane_count = (int)h.plane_count;
    b.bytes = total_bytes(&b);
    size_t outlines = (size_t)b.plane_count * sizeof *b.outline;
    if (bytes != sizeof h + outlines + b.bytes)
        return sv_fail(error, SV_EFORMAT, "billboards", "%zu bytes where the sizes ask for %zu", bytes,
                       sizeof h + outlines + b.bytes);
    memcpy(b.translucency, h.translucency, sizeof b.translucency);
    memcpy(b.bar, h.bar, sizeof b.bar);
    memcpy(b.outline, (const unsigned char *)data + sizeof h, outlines);
    for (int k = 0; k < 4; k++)
        sound = sound && fabsf(b.translucency[k]) <= 1e6f;
    for (int k = 0; k < SV_BILLBOARD_LEVELS_MAX; k++)
        sound = sound && b.bar[k] >= 0 && b.bar[k] <= 1;
    for (int k = 0; k < b.plane_count * SV_BILLBOARD_OUTLINE; k++)
        sound = sound && b.outline[k / SV_BILLBOARD_OUTLINE][k % SV_BILLBOARD_OUTLINE] <=
                             2; /* -INFINITY: nothing is shown */
    if (!sound)
        return sv_fail(error, SV_EFORMAT, "billboards", "a number of the billboard textures is out of range");
    b.data = malloc(b.bytes);
    if (!b.data)
        return sv_fail(error, SV_ENOMEM, "billboards", "no memory for %zu bytes", b.bytes);
    memcpy(b.data, (const unsigned char *)data + sizeof h + outlines, b.bytes);
    *out = b;
    return SV_OK;
}
