/* jumps.c - see jumps.h. Sums run in eight lanes, so that every compiler makes vectors of them; a row's in
 * float, rows in double. */
#include "core/cell/jumps.h"

#include <assert.h>
#include <math.h>
#include <stddef.h>

enum { LANES = 8 };

/* Of the differences d = b - a beyond the cut: sums of d > 0, of -d > 0, of |x d|. */
struct sums {
    double more, less, out;
};

static void add_lanes(const float *a, const float *b, const float *x, int count, float cut,
                      float sum[3][LANES])
{
    for (int l = 0; l < count; l++) {
        float d = b[l] - a[l];
        d = fabsf(d) > cut ? d : 0;
        sum[0][l] += d > 0 ? d : 0;
        sum[1][l] += d < 0 ? -d : 0;
        sum[2][l] += fabsf(x[l] * d);
    }
}

static struct sums row_sums(const float *a, const float *b, const float *x, int count, float cut)
{
    float sum[3][LANES] = {{0}};
    double total[3] = {0};
    int i = 0;
    for (; i + LANES <= count; i += LANES)
        add_lanes(a + i, b + i, x + i, LANES, cut, sum);
    add_lanes(a + i, b + i, x + i, count - i, cut, sum);
    for (int k = 0; k < 3; k++)
        for (int l = 0; l < LANES; l++)
            total[k] += (double)sum[k][l];
    return (struct sums){total[0], total[1], total[2]};
}

static uint32_t held(const float *row, int count)
{
    uint32_t n = 0;
    for (int i = 0; i < count; i++)
        n += row[i] > 0;
    return n;
}

/* One more row, below the one before (NULL: the first). */
static void add_row(const float *row, const float *above, int j, int size, float cut, const float *x,
                    struct sv_cell_jumps *jumps)
{
    struct sums s = row_sums(row, row + 1, x, size - 1, cut);
    jumps->texels += held(row, size);
    jumps->x_plus += s.more;
    jumps->x_minus += s.less;
    jumps->xx += s.out;
    if (!above)
        return;
    s = row_sums(row, above, x, size, cut);
    jumps->y_plus += s.more;
    jumps->y_minus += s.less;
    jumps->yy += fabs(1 - 2.0 * j / size) * (s.more + s.less);
}

/* xs between a texel and the next. */
static void begin(int size, struct sv_cell_jumps *jumps, float *x)
{
    assert(size >= 1 && size <= SV_CELL_JUMPS_SIZE_MAX);
    *jumps = (struct sv_cell_jumps){.texels = 0};
    for (int i = 0; i < size; i++)
        x[i] = (float)(2.0 * (i + 1) / size - 1);
}

void sv_cell_jumps_measure(const float *q, int size, float cut, struct sv_cell_jumps *jumps)
{
    float x[SV_CELL_JUMPS_SIZE_MAX];
    begin(size, jumps, x);
    for (int j = 0; j < size; j++, q += size)
        add_row(q, j > 0 ? q - size : NULL, j, size, cut, x, jumps);
}

void sv_cell_jumps_measure_codes(const uint16_t *q, int size, float cut, struct sv_cell_jumps *jumps)
{
    float x[SV_CELL_JUMPS_SIZE_MAX], rows[2][SV_CELL_JUMPS_SIZE_MAX];
    begin(size, jumps, x);
    for (int j = 0; j < size; j++, q += size) {
        float *row = rows[j & 1];
        for (int i = 0; i < size; i++)
            row[i] = (float)q[i] * (1.0f / 32768);
        add_row(row, j > 0 ? rows[(j & 1) ^ 1] : NULL, j, size, cut, x, jumps);
    }
}
