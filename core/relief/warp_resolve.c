/* warp_resolve.c - from texels to colours, normals and depths, once a pixel. */
#include <math.h>

#include "core/relief/warp_kernel.h"

static bool joined(const struct sv_warp_source *source, size_t a, size_t b)
{
    return source->color[b][3] >= 128 && fabsf(source->t[a] - source->t[b]) <= source->cut;
}

/* Neighbours of texel (c, j) on the sides (cs, js), weighed bilinearly; those that are empty or torn from it
 * give their share to the others. */
static void weigh_torn(const struct sv_warp_source *source, int c, int j, float fu, float fv,
                       struct sv_warp_weights *w)
{
    int cs = fu < 0.5f ? -1 : 1, js = fv < 0.5f ? -1 : 1;
    float du = fabsf(fu - 0.5f), dv = fabsf(fv - 0.5f);
    size_t width = (size_t)source->width, own = (size_t)j * width + (size_t)c;
    bool has_c = c + cs >= 0 && c + cs < source->width, has_j = j + js >= 0 && j + js < source->height;
    size_t h = has_c ? (cs < 0 ? own - 1 : own + 1) : own,
           v = has_j ? (js < 0 ? own - width : own + width) : own;
    size_t both = has_c && has_j ? v + h - own : own;
    bool by_h = has_c && joined(source, own, h), by_v = has_j && joined(source, own, v);
    bool diagonal = (by_h && has_j && joined(source, h, both)) || (by_v && has_c && joined(source, v, both));
    w->texel[0] = (uint32_t)own;
    w->texel[1] = (uint32_t)h;
    w->texel[2] = (uint32_t)v;
    w->texel[3] = (uint32_t)both;
    w->weight[0] = (1 - du) * (1 - dv);
    w->weight[1] = by_h ? du * (1 - dv) : 0;
    w->weight[2] = by_v ? (1 - du) * dv : 0;
    w->weight[3] = diagonal ? du * dv : 0;
    float share = 1 / (w->weight[0] + w->weight[1] + w->weight[2] + w->weight[3]);
    for (int k = 0; k < 4; k++)
        w->weight[k] *= share;
}

/* A filled pixel shows the far texel's border, along which its neighbour on that side has a share. */
static void weigh_filled(const struct sv_warp_source *source, uint32_t own, uint32_t place,
                         struct sv_warp_weights *w)
{
    uint32_t width = (uint32_t)source->width, fu = place >> 8, fv = place >> 1 & 127;
    bool along_v = fu == 0 || fu == 255; /* the border is the texel's left or right one */
    float part = along_v ? ((float)fv + 0.5f) / 128 - 0.5f : ((float)fu + 0.5f) / 256 - 0.5f;
    uint32_t at = along_v ? own / width : own % width,
             last = (uint32_t)(along_v ? source->height : source->width) - 1;
    uint32_t step = along_v ? width : 1, other = part < 0 ? own - step : own + step;
    bool has = part < 0 ? at > 0 : at < last;
    float share = has && joined(source, own, other) ? fabsf(part) : 0;
    *w = (struct sv_warp_weights){{own, has ? other : own, own, own}, {1 - share, share, 0, 0}};
}

bool sv_warp_weigh(const struct sv_warp_source *sources, const struct sv_warp_buffer *buffer, int i, int j,
                   unsigned *source, struct sv_warp_weights *weights)
{
    size_t p = (size_t)j * (size_t)buffer->width + (size_t)i;
    uint32_t texel = buffer->texel[p], place = buffer->place[p];
    if (texel == SV_WARP_EMPTY)
        return false;
    *source = texel >> SV_WARP_TEXEL_BITS & (SV_WARP_SOURCES_MAX - 1);
    const struct sv_warp_source *from = sources + *source;
    uint32_t index = texel & SV_WARP_TEXEL_MASK, width = (uint32_t)from->width;
    if (texel & SV_WARP_FILLED) {
        weigh_filled(from, index, place, weights);
        return true;
    }
    float fu = ((float)(place >> 8) + 0.5f) / 256, fv = ((float)(place >> 1 & 127) + 0.5f) / 128;
    if (!(place & 1)) {
        weigh_torn(from, (int)(index % width), (int)(index / width), fu, fv, weights);
        return true;
    }
    *weights = (struct sv_warp_weights){
        {index, index + 1, index + width, index + width + 1},
        {(1 - fu) * (1 - fv), fu * (1 - fv), (1 - fu) * fv, fu * fv},
    };
    return true;
}

/* x y / 2^15, rounded: what _mm256_mulhrs_epi16 does. */
static int32_t mul_round(int32_t x, int32_t y)
{
    return (x * y + 0x4000) >> 15;
}

/* Bilinear in a full cell; 6 bits below the level are kept on the way. */
static void blend_full(const uint8_t (*color)[4], uint32_t width, uint32_t place, uint8_t out[4])
{
    int32_t a = (int32_t)(place >> 8) * 128 + 64, b = (int32_t)(place >> 1 & 127) * 256 + 128;
    for (int k = 0; k < 4; k++) {
        int32_t c00 = color[0][k] * 64, c10 = color[1][k] * 64;
        int32_t c01 = color[width][k] * 64, c11 = color[width + 1][k] * 64;
        int32_t top = c00 + mul_round(c10 - c00, a), low = c01 + mul_round(c11 - c01, a);
        out[k] = (uint8_t)((top + mul_round(low - top, b) + 32) >> 6);
    }
}

static void blend_torn(const struct sv_warp_source *source, const struct sv_warp_weights *w, uint8_t out[4])
{
    float sum[4] = {0.5f, 0.5f, 0.5f, 0.5f};
    for (int i = 0; i < 4; i++) {
        const uint8_t *color = source->color[w->texel[i]];
        if (!(w->weight[i] > 0))
            continue;
        for (int k = 0; k < 4; k++)
            sum[k] += w->weight[i] * color[k];
    }
    for (int k = 0; k < 4; k++)
        out[k] = (uint8_t)(sum[k] < 255 ? sum[k] : 255);
}

void sv_warp_resolve_run(const struct sv_warp_source *sources, const struct sv_warp_buffer *buffer, int j,
                         int i0, int i1, uint8_t (*rgba)[4])
{
    size_t p = (size_t)j * (size_t)buffer->width + (size_t)i0;
    for (int i = i0; i < i1; i++, p++) {
        uint32_t texel = buffer->texel[p];
        const struct sv_warp_source *source = sources + (texel >> SV_WARP_TEXEL_BITS & 31);
        struct sv_warp_weights weights;
        unsigned k;
        if (texel == SV_WARP_EMPTY)
            continue;
        if (buffer->place[p] & 1)
            blend_full(source->color + (texel & SV_WARP_TEXEL_MASK), (uint32_t)source->width,
                       buffer->place[p], rgba[p]);
        else if (sv_warp_weigh(sources, buffer, i, j, &k, &weights))
            blend_torn(source, &weights, rgba[p]);
    }
}

static void resolve_scalar(const struct sv_warp_source *sources, const struct sv_warp_buffer *buffer,
                           uint8_t (*rgba)[4])
{
    for (int j = buffer->y0; j < buffer->y1; j++)
        sv_warp_resolve_run(sources, buffer, j, buffer->x0, buffer->x1, rgba);
}

void sv_warp_resolve_at(enum sv_simd level, const struct sv_warp_source *sources, unsigned count,
                        const struct sv_warp_buffer *buffer, uint8_t (*rgba)[4])
{
    (void)count;
    if (level == SV_SIMD_AVX2)
        sv_warp_resolve_avx2(sources, buffer, rgba);
    else
        resolve_scalar(sources, buffer, rgba);
}

void sv_warp_resolve(const struct sv_warp_source *sources, unsigned count,
                     const struct sv_warp_buffer *buffer, uint8_t (*rgba)[4])
{
    sv_warp_resolve_at(sv_simd_level(), sources, count, buffer, rgba);
}

void sv_warp_resolve_int16(const struct sv_warp_source *sources, const int16_t (*const *images)[4],
                           unsigned count, const struct sv_warp_buffer *buffer, int16_t (*out)[4])
{
    for (int j = buffer->y0; j < buffer->y1; j++)
        for (int i = buffer->x0; i < buffer->x1; i++) {
            size_t p = (size_t)j * (size_t)buffer->width + (size_t)i;
            struct sv_warp_weights w;
            unsigned k;
            if (!sv_warp_weigh(sources, buffer, i, j, &k, &w) || k >= count || !images[k])
                continue;
            for (int channel = 0; channel < 4; channel++) {
                float sum = 0;
                for (int n = 0; n < 4; n++)
                    if (w.weight[n] > 0)
                        sum += w.weight[n] * images[k][w.texel[n]][channel];
                out[p][channel] = (int16_t)lrintf(sum);
            }
        }
}

void sv_warp_resolve_depth(const struct sv_warp_source *sources, const struct sv_warp_buffer *buffer,
                           float *depth)
{
    for (int j = buffer->y0; j < buffer->y1; j++)
        for (int i = buffer->x0; i < buffer->x1; i++) {
            size_t p = (size_t)j * (size_t)buffer->width + (size_t)i;
            struct sv_warp_weights n;
            unsigned k;
            if (!sv_warp_weigh(sources, buffer, i, j, &k, &n))
                continue;
            depth[p] = buffer->depth[p];
            if (!(buffer->place[p] & 1))
                continue;
            const struct sv_warp_source *s = &sources[k];
            double u = (double)(n.texel[0] % (uint32_t)s->width) + 0.5 + (double)(n.weight[1] + n.weight[3]);
            double v = s->row0 + (double)(n.texel[0] / (uint32_t)s->width) + 0.5 +
                       (double)(n.weight[2] + n.weight[3]);
            double t = 0;
            for (int c = 0; c < 4; c++)
                t += (double)n.weight[c] * s->t[n.texel[c]];
            const double *d = s->map.m[2], *w = s->map.m[3];
            double here = (d[0] * u + d[1] * v + d[2] * t + d[3]) / (w[0] * u + w[1] * v + w[2] * t + w[3]);
            if (here >= 0 && here <= 1)
                depth[p] = (float)here;
        }
}
