/* sprite_bake.c - see sprite_atlas.h: frames are drawn one by one (impostor_frame.h), summed up to all
 * levels, and each level is written from its sums. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/tree/impostor_frame.h"
#include "core/tree/impostor_guess.h"
#include "core/tree/sprite_atlas.h"

enum { SUB = 3, SUMS = SV_SPRITE_LEVELS + 1, ABOUT = 3 };

/* Sums of one level. */
struct sums {
    struct sv_frame_texel *texels;
    int width, height;
    float samples; /* that a texel has */
};

struct bake {
    struct sv_sprite_atlas out;
    size_t texel_room, smooth_room;
    struct sv_frame_bake frame;
    struct sv_frame_texel *work;
    float
        *prominent[SV_SPRITE_LEVELS]; /* sums of prominence, a texel each of each level; [0] holds them all */
    struct sums sums[SUMS];
    struct sv_guess_table table;
};

static uint8_t code(float v)
{
    return (uint8_t)(fminf(fmaxf(v, 0), 255) + 0.5f);
}

static void add(struct sv_frame_texel *to, const struct sv_frame_texel *from)
{
    _Static_assert(sizeof *to == 14 * sizeof(float), "all of it is floats");
    float *a = &to->count;
    const float *b = &from->count;
    for (size_t k = 0; k < sizeof *to / sizeof(float); k++)
        a[k] += b[k];
}

/* Cuts the frame out, its corner even, depth made relative to the plane, and adds up the levels. */
static void sum_levels(struct bake *b, struct sv_sprite_frame *f)
{
    const struct sv_frame_bake *from = &b->frame;
    f->left = from->box[0] & ~1;
    f->top = from->box[2] & ~1;
    struct sv_frame_texel *at = b->work;
    int width = from->box[1] - f->left, height = from->box[3] - f->top;
    double step = (double)from->view.step * SUB;
    for (int k = 0; k < SUMS; k++) {
        struct sums *s = &b->sums[k];
        *s = (struct sums){at, width, height, (float)(SUB * SUB) * exp2f((float)(2 * k))};
        at += (size_t)width * (size_t)height;
        width = (width + 1) / 2;
        height = (height + 1) / 2;
    }
    memset(b->work, 0, (size_t)(at - b->work) * sizeof *at);
    for (int j = 0; j < b->sums[0].height; j++)
        for (int i = 0; i < b->sums[0].width; i++) {
            struct sv_frame_texel *t = &b->sums[0].texels[(size_t)j * (size_t)b->sums[0].width + (size_t)i];
            *t = from->texels[(size_t)(j + f->top) * (size_t)from->cell + (size_t)(i + f->left)];
            double x = (double)from->view.left + (i + f->left + 0.5) * step;
            double y = (double)from->view.top - (j + f->top + 0.5) * step;
            t->depth -= t->count * (float)(from->plane[0] + from->plane[1] * x + from->plane[2] * y);
        }
    for (int k = 1; k < SUMS; k++) {
        const struct sums *fine = &b->sums[k - 1];
        for (int j = 0; j < fine->height; j++)
            for (int i = 0; i < fine->width; i++)
                add(&b->sums[k].texels[(size_t)(j / 2) * (size_t)b->sums[k].width + (size_t)(i / 2)],
                    &fine->texels[(size_t)j * (size_t)fine->width + (size_t)i]);
    }
}

/* Range of depth among the smooth texels of all levels: the finest has the widest. */
static void depth_range(const struct sums *s, struct sv_sprite_frame *f)
{
    float lo = INFINITY, hi = -INFINITY;
    for (size_t k = 0; k < (size_t)s->width * (size_t)s->height; k++) {
        const struct sv_frame_texel *t = &s->texels[k];
        if (!(t->count > 0))
            continue;
        lo = fminf(lo, t->depth / t->count);
        hi = fmaxf(hi, t->depth / t->count);
    }
    f->depth_first = lo < hi ? lo : lo < INFINITY ? lo : 0;
    f->depth_step = lo < hi ? (hi - lo) / 255 : 0;
}

/* Mean depth of what is about texel (i, j): between the sums of level ABOUT, by what they hold. */
static float depth_about(const struct sums *s, int i, int j)
{
    float x = ((float)i + 0.5f) / (1 << ABOUT) - 0.5f, y = ((float)j + 0.5f) / (1 << ABOUT) - 0.5f;
    float bx = floorf(x), by = floorf(y), depth = 0, weight = 0;
    for (int k = 0; k < 4; k++) {
        int u = (int)bx + (k & 1), v = (int)by + (k >> 1);
        if (u < 0 || v < 0 || u >= s->width || v >= s->height)
            continue;
        const struct sv_frame_texel *t = &s->texels[(size_t)v * (size_t)s->width + (size_t)u];
        float share = (k & 1 ? x - bx : 1 - (x - bx)) * (k >> 1 ? y - by : 1 - (y - by));
        depth += share * t->depth;
        weight += share * t->count;
    }
    return weight > 0 ? depth / weight : 0;
}

/* How far texels stand out, summed up to all levels as the rest is, in rms of level 0. */
static void sum_prominence(struct bake *b)
{
    const struct sums *fine = &b->sums[0];
    float *at = b->prominent[0];
    double square = 0, count = 0;
    for (int k = 0; k < SV_SPRITE_LEVELS; k++) {
        size_t texels = (size_t)b->sums[k].width * (size_t)b->sums[k].height;
        b->prominent[k] = at;
        memset(at, 0, texels * sizeof *at);
        at += texels;
    }
    for (int j = 0; j < fine->height; j++)
        for (int i = 0; i < fine->width; i++) {
            size_t k = (size_t)j * (size_t)fine->width + (size_t)i;
            const struct sv_frame_texel *t = &fine->texels[k];
            if (!(t->count > 0))
                continue;
            float out = t->depth / t->count - depth_about(&b->sums[ABOUT], i, j);
            b->prominent[0][k] = out * t->count;
            square += (double)(out * out * t->count);
            count += (double)t->count;
        }
    float each = square > 0 ? (float)(1 / sqrt(square / count)) : 0;
    for (int j = 0; j < fine->height; j++)
        for (int i = 0; i < fine->width; i++) {
            float out = b->prominent[0][(size_t)j * (size_t)fine->width + (size_t)i] *= each;
            for (int k = 1; k < SV_SPRITE_LEVELS; k++)
                b->prominent[k][(size_t)(j >> k) * (size_t)b->sums[k].width + (size_t)(i >> k)] += out;
        }
}

static struct sv_sprite_texel texel_of(const struct sv_frame_texel *t, float samples, float prominence)
{
    struct sv_sprite_texel out;
    float each = 1 / t->count;
    for (int c = 0; c < 3; c++) {
        out.rgb[c] = code(255 * sqrtf(fmaxf(t->rgb[c] * each, 0)));
        out.normal[c] = code(127.5f + 127.5f * t->normal[c] * each);
    }
    out.coverage = code(255 * t->count / samples);
    out.prominence = code(128 + SV_SPRITE_PROMINENCE * prominence * each);
    return out;
}

static struct sv_sprite_smooth smooth_of(const struct sv_frame_texel *t, const struct sv_sprite_frame *f)
{
    struct sv_sprite_smooth out = {.unused = 0};
    float each = 1 / t->count;
    out.occlusion = code(255 * t->occlusion * each);
    for (int c = 0; c < 3; c++)
        out.open[c] = code(127.5f + 127.5f * t->open[c] * each);
    out.open[3] = code(255 * t->open[3] * each);
    out.translucency = code(255 * t->translucency * each);
    out.depth = f->depth_step > 0 ? code((t->depth * each - f->depth_first) / f->depth_step) : 0;
    return out;
}

/* Sums that stand for texel (i, j) of level k: its own, or those of the finest coarser one that shows
 * something. */
static const struct sv_frame_texel *stand_in(const struct bake *b, int k, int i, int j, float *prominence)
{
    for (;; k++, i /= 2, j /= 2) {
        size_t at = (size_t)j * (size_t)b->sums[k].width + (size_t)i;
        const struct sv_frame_texel *t = &b->sums[k].texels[at];
        if (!(t->count > 0) && k < SUMS - 1)
            continue;
        *prominence = k < SV_SPRITE_LEVELS ? b->prominent[k][at] : 0;
        return t;
    }
}

static int held(int i, int count)
{
    return i < 0 ? 0 : i < count ? i : count - 1;
}

/* Texels, border counted, that filtering in block i of `count` + 1 texels may read: all between the block's
 * edges, and one on. */
static void block_range(int i, int count, int range[2])
{
    float step = (float)(count + 1) / SV_SPRITE_BLOCKS;
    range[0] = held((int)floorf((float)i * step - 0.01f), count + 2);
    range[1] = held((int)floorf((float)(i + 1) * step + 0.01f) + 1, count + 2);
}

static void put_blocks(const struct sv_sprite_atlas *atlas, struct sv_sprite_level *l)
{
    const struct sv_sprite_texel *texels = atlas->texels + l->texel_first;
    for (int j = 0; j < SV_SPRITE_BLOCKS; j++)
        for (int i = 0; i < SV_SPRITE_BLOCKS; i++) {
            int u[2], v[2];
            bool any = false;
            block_range(i, l->width, u);
            block_range(j, l->height, v);
            for (int y = v[0]; y <= v[1]; y++)
                for (int x = u[0]; x <= u[1]; x++)
                    any |= texels[y * (l->width + 2) + x].coverage > 0;
            l->blocks[j / 2] |= (uint32_t)any << (16 * (j % 2) + i);
        }
}

static void put_level(struct bake *b, struct sv_sprite_frame *f, int k)
{
    struct sv_sprite_level *l = &f->level[k];
    int smooth = k + sv_sprite_shift(k) < SUMS ? k + sv_sprite_shift(k) : SUMS - 1;
    const struct sums *s = &b->sums[k], *half = &b->sums[smooth];
    float prominence;
    *l = (struct sv_sprite_level){.texel_first = (uint32_t)b->out.texel_count,
                                  .smooth_first = (uint32_t)b->out.smooth_count,
                                  .width = s->width,
                                  .height = s->height};
    struct sv_sprite_texel *t = b->out.texels + b->out.texel_count;
    for (int j = -1; j <= s->height; j++)
        for (int i = -1; i <= s->width; i++, t++) {
            int ci = held(i, s->width), cj = held(j, s->height);
            const struct sv_frame_texel *own = &s->texels[(size_t)cj * (size_t)s->width + (size_t)ci];
            const struct sv_frame_texel *from = stand_in(b, k, ci, cj, &prominence);
            *t = texel_of(from, s->samples, prominence);
            if (ci != i || cj != j || !(own->count > 0))
                t->coverage = 0;
        }
    struct sv_sprite_smooth *m = b->out.smooth + b->out.smooth_count;
    for (int j = -1; j <= half->height; j++)
        for (int i = -1; i <= half->width; i++, m++)
            *m = smooth_of(stand_in(b, smooth, held(i, half->width), held(j, half->height), &prominence), f);
    put_blocks(&b->out, l);
    b->out.texel_count = (size_t)(t - b->out.texels);
    b->out.smooth_count = (size_t)(m - b->out.smooth);
}

/* Mean of the shading's guess over the level. */
static void put_guess(const struct bake *b, struct sv_sprite_frame *f, int k)
{
    float sum[6] = {0}, weight = 0;
    const struct sums *s = &b->sums[k];
    for (size_t i = 0; i < (size_t)s->width * (size_t)s->height; i++) {
        const struct sv_frame_texel *t = &s->texels[i];
        if (!(t->count > 0))
            continue;
        float bright = t->rgb[0] + t->rgb[1] + t->rgb[2];
        const float m[3] = {t->normal[0] / t->count, t->normal[1] / t->count, t->normal[2] / t->count};
        sv_guess_add(&b->table, bright, m, sum);
        weight += bright;
    }
    for (int c = 0; c < 6; c++)
        f->guess[k][c] = weight > 0 ? sum[c] / weight : c < 3 ? 0.5f : 0;
}

/* Makes room for a whole frame more. */
static enum sv_status make_room(struct bake *b, struct sv_error *error)
{
    size_t most = 0;
    for (int k = 0; k < SV_SPRITE_LEVELS; k++)
        most += (size_t)((SV_SPRITE_CELL >> k) + 2) * (size_t)((SV_SPRITE_CELL >> k) + 2);
    if (b->out.texel_count + most > b->texel_room) {
        size_t room = b->texel_room + 8 * most;
        void *texels = realloc(b->out.texels, room * sizeof *b->out.texels);
        if (!texels)
            return sv_fail(error, SV_ENOMEM, "sprite", "no memory for an atlas of %zu texels", room);
        b->out.texels = texels;
        b->texel_room = room;
    }
    if (b->out.smooth_count + most > b->smooth_room) {
        size_t room = b->smooth_room + 8 * most;
        void *smooth = realloc(b->out.smooth, room * sizeof *b->out.smooth);
        if (!smooth)
            return sv_fail(error, SV_ENOMEM, "sprite", "no memory for an atlas of %zu texels", room);
        b->out.smooth = smooth;
        b->smooth_room = room;
    }
    return SV_OK;
}

static enum sv_status bake_frame(struct bake *b, int index, struct sv_error *error)
{
    struct sv_sprite_frame *f = &b->out.frames[index];
    enum sv_status status = make_room(b, error);
    if (status)
        return status;
    sv_frame_bake_draw(&b->frame, index);
    f->of = b->frame.frame;
    if (b->frame.box[0] >= b->frame.box[1])
        return SV_OK;
    sum_levels(b, f);
    depth_range(&b->sums[1], f);
    sum_prominence(b);
    for (int k = 0; k < SV_SPRITE_LEVELS; k++) {
        put_level(b, f, k);
        put_guess(b, f, k);
    }
    return SV_OK;
}

/* Puts equal levels of all frames beside one another: a view of far trees reads the coarse ones of many
 * frames, and these then lie in few pages. Room that was too much goes back. */
static enum sv_status order_by_level(struct sv_sprite_atlas *atlas, struct sv_error *error)
{
    struct sv_sprite_texel *texels = malloc(atlas->texel_count * sizeof *texels + 1), *t = texels;
    struct sv_sprite_smooth *smooth = malloc(atlas->smooth_count * sizeof *smooth + 1), *m = smooth;
    if (!texels || !smooth) {
        free(texels);
        free(smooth);
        return sv_fail(error, SV_ENOMEM, "sprite", "no memory for an atlas of %zu texels",
                       atlas->texel_count);
    }
    for (int k = SV_SPRITE_LEVELS - 1; k >= 0; k--)
        for (int f = 0; f < SV_IMPOSTOR_FRAMES; f++) {
            struct sv_sprite_level *l = &atlas->frames[f].level[k];
            if (l->width == 0)
                continue;
            size_t count = (size_t)(l->width + 2) * (size_t)(l->height + 2);
            size_t coarse =
                (size_t)sv_sprite_smooth_size(l->width, k) * (size_t)sv_sprite_smooth_size(l->height, k);
            memcpy(t, atlas->texels + l->texel_first, count * sizeof *t);
            memcpy(m, atlas->smooth + l->smooth_first, coarse * sizeof *m);
            l->texel_first = (uint32_t)(t - texels);
            l->smooth_first = (uint32_t)(m - smooth);
            t += count;
            m += coarse;
        }
    free(atlas->texels);
    free(atlas->smooth);
    atlas->texels = texels;
    atlas->smooth = smooth;
    return SV_OK;
}

enum sv_status sv_sprite_atlas_bake(const struct sv_tree_mesh *mesh, struct sv_sprite_atlas *atlas,
                                    struct sv_error *error)
{
    struct bake *b = calloc(1, sizeof *b);
    size_t texels = 0;
    for (int k = 0; k < SUMS; k++)
        texels += (size_t)(SV_SPRITE_CELL >> k) * (size_t)(SV_SPRITE_CELL >> k) + 4;
    if (b) {
        b->work = malloc(texels * sizeof *b->work);
        b->prominent[0] = malloc(texels * sizeof *b->prominent[0]);
    }
    if (!b || !b->work || !b->prominent[0]) {
        free(b ? b->work : NULL);
        free(b);
        return sv_fail(error, SV_ENOMEM, "sprite", "no memory to bake %zu texels", texels);
    }
    sv_guess_table_make(&b->table);
    enum sv_status status = sv_frame_bake_init(mesh, SV_SPRITE_CELL, SUB, &b->frame, error);
    for (int k = 0; !status && k < SV_IMPOSTOR_FRAMES; k++)
        status = bake_frame(b, k, error);
    sv_frame_bake_finish(&b->frame);
    if (!status)
        status = order_by_level(&b->out, error);
    if (status)
        sv_sprite_atlas_finish(&b->out);
    else
        *atlas = b->out;
    free(b->work);
    free(b->prominent[0]);
    free(b);
    return status;
}
