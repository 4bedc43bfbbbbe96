/* object_cast_avx2.c - eight quadrilaterals at once: operation for operation what object_cast.c does. Pixels
 * are packed into a list first, because which are covered cannot be foretold. */
#include <immintrin.h>

#include "core/relief/object_casters.h"
#include "core/relief/object_splat_kernel.h"
#include "core/relief/warp_list_avx2.h"

static inline __m256 splat(float v)
{
    return _mm256_set1_ps(v);
}

static inline __m256 mul(__m256 a, __m256 b)
{
    return _mm256_mul_ps(a, b);
}

static inline __m256 plus(__m256 sum, __m256 a, float b) /* sum + a b */
{
    return _mm256_add_ps(sum, mul(splat(b), a));
}

static inline __m256 cross(__m256 ax, __m256 by, __m256 ay, __m256 bx) /* ax by - ay bx */
{
    return _mm256_sub_ps(mul(ax, by), mul(ay, bx));
}

struct quads {
    __m256 at[3], e1[3], e2[3], e3[3], lo[3], hi[3];
};

static inline __m256 whole(const int16_t *from)
{
    return _mm256_cvtepi32_ps(_mm256_cvtepi16_epi32(_mm_load_si128((const __m128i *)(const void *)from)));
}

static inline void project(const struct sv_relief_map *map, const struct sv_relief_quads *from, int axis,
                           struct quads *q)
{
    const float *m = map->at[axis];
    float along_u = m[0] * map->du, along_v = m[1] * map->dv;
    __m256 t = _mm256_loadu_ps(from->t[0]),
           at = plus(plus(splat(m[3]), whole(from->u), m[0]), whole(from->v), m[1]);
    q->at[axis] = plus(at, t, m[2]);
    q->e1[axis] = plus(splat(along_u), _mm256_sub_ps(_mm256_loadu_ps(from->t[1]), t), m[2]);
    q->e2[axis] = plus(splat(along_v), _mm256_sub_ps(_mm256_loadu_ps(from->t[2]), t), m[2]);
    q->e3[axis] = plus(splat(along_u + along_v), _mm256_sub_ps(_mm256_loadu_ps(from->t[3]), t), m[2]);
    const __m256 zero = _mm256_setzero_ps();
    q->lo[axis] = _mm256_min_ps(_mm256_min_ps(q->e3[axis], zero), _mm256_min_ps(q->e1[axis], q->e2[axis]));
    q->hi[axis] = _mm256_max_ps(_mm256_max_ps(q->e3[axis], zero), _mm256_max_ps(q->e1[axis], q->e2[axis]));
}

static inline __m256i pixels(__m256 lo, __m256 hi, int size, __m256i *first)
{
    const __m256 half = splat(0.5f), end = splat((float)size), last = splat((float)size - 1);
    __m256 a = _mm256_max_ps(_mm256_sub_ps(lo, half), _mm256_setzero_ps());
    __m256 b = _mm256_min_ps(_mm256_sub_ps(hi, half), last);
    a = _mm256_ceil_ps(_mm256_min_ps(a, end));
    b = _mm256_floor_ps(_mm256_max_ps(b, splat(-1)));
    *first = _mm256_cvttps_epi32(a);
    return _mm256_cvttps_epi32(_mm256_add_ps(_mm256_sub_ps(b, a), splat(1)));
}

enum { LIST = 1024 };
struct list {
    int count;
    int32_t pixel[LIST + 8];
    float d[LIST + 8];
};

static void put(struct list *list, float *depth)
{
    for (int i = 0; i < list->count; i++) {
        float *to = depth + list->pixel[i], held = *to, d = list->d[i];
        *to = d > held ? d : held;
    }
    list->count = 0;
}

static inline __m256i more_than(__m256i count, int k)
{
    return _mm256_cmpgt_epi32(count, _mm256_set1_epi32(k));
}

/* Those of eight in `drawn`. */
static void draw(const struct sv_relief_map *map, const struct quads *q, __m256 det, __m256 drawn,
                 struct list *list)
{
    const __m256 one = splat(1), zero = _mm256_setzero_ps();
    __m256i i0, j0;
    __m256i nx =
        pixels(_mm256_add_ps(q->at[0], q->lo[0]), _mm256_add_ps(q->at[0], q->hi[0]), map->width, &i0);
    __m256i ny =
        pixels(_mm256_add_ps(q->at[1], q->lo[1]), _mm256_add_ps(q->at[1], q->hi[1]), map->height, &j0);
    nx = _mm256_and_si256(nx, _mm256_castps_si256(drawn));
    ny = _mm256_and_si256(ny, more_than(nx, 0));
    int wide = sv_warp_largest(nx), high = sv_warp_largest(ny);
    __m256 scale = _mm256_div_ps(one, det), sx = mul(q->e2[1], scale), sy = mul(q->e2[0], scale),
           rx = mul(q->e1[1], scale), ry = mul(q->e1[0], scale);
    __m256 s3 = cross(q->e3[0], sx, q->e3[1], sy), r3 = cross(q->e3[1], ry, q->e3[0], rx);
    __m256 convex = _mm256_and_ps(_mm256_cmp_ps(s3, zero, _CMP_GT_OQ), _mm256_cmp_ps(r3, zero, _CMP_GT_OQ));
    convex = _mm256_and_ps(convex, _mm256_cmp_ps(_mm256_add_ps(s3, r3), one, _CMP_GT_OQ));
    __m256 s1 = _mm256_blendv_ps(_mm256_max_ps(s3, one), one, convex);
    __m256 r1 = _mm256_blendv_ps(_mm256_max_ps(r3, one), one, convex);
    __m256 a_r = _mm256_and_ps(convex, _mm256_sub_ps(s3, one)), a_s = _mm256_blendv_ps(one, r3, convex);
    __m256 e_s = _mm256_and_ps(convex, _mm256_sub_ps(r3, one)), e_r = _mm256_blendv_ps(one, s3, convex);
    __m256 x0 = _mm256_sub_ps(_mm256_add_ps(_mm256_cvtepi32_ps(i0), splat(0.5f)), q->at[0]);
    __m256 y0 = _mm256_sub_ps(_mm256_add_ps(_mm256_cvtepi32_ps(j0), splat(0.5f)), q->at[1]);
    __m256 d_min = _mm256_add_ps(q->at[2], q->lo[2]), d_max = _mm256_add_ps(q->at[2], q->hi[2]);
    __m256i row = _mm256_add_epi32(_mm256_mullo_epi32(j0, _mm256_set1_epi32(map->width)), i0);
    for (int ky = 0; ky < high; ky++, row = _mm256_add_epi32(row, _mm256_set1_epi32(map->width))) {
        __m256 dy = _mm256_add_ps(y0, splat((float)ky)), s_row = mul(dy, sy), r_row = mul(dy, ry);
        __m256i in_row = more_than(ny, ky);
        for (int kx = 0; kx < wide; kx++) {
            __m256 dx = _mm256_add_ps(x0, splat((float)kx));
            __m256 s = _mm256_sub_ps(mul(dx, sx), s_row), r = _mm256_sub_ps(r_row, mul(dx, rx));
            __m256 a = cross(a_r, r, a_s, _mm256_sub_ps(s, s1)), e = cross(e_s, s, e_r, _mm256_sub_ps(r, r1));
            __m256 least = _mm256_min_ps(_mm256_min_ps(s, r), _mm256_min_ps(a, e));
            __m256 in = _mm256_cmp_ps(least, splat(-SV_WARP_EDGE), _CMP_GE_OQ);
            in = _mm256_and_ps(in, _mm256_castsi256_ps(_mm256_and_si256(in_row, more_than(nx, kx))));
            __m256 d = _mm256_add_ps(_mm256_add_ps(q->at[2], mul(s, q->e1[2])), mul(r, q->e2[2]));
            d = _mm256_min_ps(_mm256_max_ps(d, d_min), d_max);
            unsigned mask = (unsigned)_mm256_movemask_ps(in);
            __m256i order = sv_warp_order(mask), pixel = _mm256_add_epi32(row, _mm256_set1_epi32(kx));
            _mm256_storeu_si256((__m256i *)(void *)(list->pixel + list->count),
                                _mm256_permutevar8x32_epi32(pixel, order));
            _mm256_storeu_ps(list->d + list->count, _mm256_permutevar8x32_ps(d, order));
            list->count += __builtin_popcount(mask);
            if (list->count > LIST - 8)
                put(list, map->depth);
        }
    }
}

void sv_relief_cast_avx2(const struct sv_relief_map *map, const struct sv_relief_quads *quads, size_t count)
{
    struct list list;
    list.count = 0; /* and nothing more: the rest is large */
    for (size_t n = 0; n < count; n++) {
        struct quads q;
        project(map, &quads[n], 0, &q);
        project(map, &quads[n], 1, &q);
        __m256 det = cross(q.e1[0], q.e2[1], q.e1[1], q.e2[0]);
        __m256 box = mul(_mm256_sub_ps(q.hi[0], q.lo[0]), _mm256_sub_ps(q.hi[1], q.lo[1]));
        __m256 size = _mm256_andnot_ps(splat(-0.0f), det);
        __m256 drawn = _mm256_cmp_ps(size, mul(box, splat(SV_RELIEF_EDGE_ON)), _CMP_GT_OQ);
        if (!_mm256_movemask_ps(drawn))
            continue;
        project(map, &quads[n], 2, &q);
        draw(map, &q, det, drawn, &list);
    }
    put(&list, map->depth);
}
