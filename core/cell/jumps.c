/* jumps.c - see jumps.h. Sums run in eight lanes, so that every compiler makes vectors of them; a row's in
 * float, rows in double. */
#include "core/cell/jumps.h"

#include <assert.h>
#include <math.h>
#include <string.h>

enum { LANES = 8, SIZE_MAX_TEXELS = 4096 };

/* Of the differences d = b - a beyond the cut: sums of d > 0, of -d > 0, of x d > 0, of -x d > 0. */
struct sums {
    double more, less, out_more, out_less;
};

static void add_lanes(const float *a, const float *b, const float *x, int count, float cut,
                      float sum[4][LANES])
{
    for (int l = 0; l < count; l++) {
        float d = b[l] - a[l];
        d = fabsf(d) > cut ? d : 0;
        float out = x[l] * d;
        sum[0][l] += d > 0 ? d : 0;
        sum[1][l] += d < 0 ? -d : 0;
        sum[2][l] += out > 0 ? out : 0;
        sum[3][l] += out < 0 ? -out : 0;
    }
}

static struct sums row_sums(const float *a, const float *b, const float *x, int count, float cut)
{
    float sum[4][LANES] = {{0}};
    double total[4] = {0};
    int i = 0;
    for (; i + LANES <= count; i += LANES)
        add_lanes(a + i, b + i, x + i, LANES, cut, sum);
    add_lanes(a + i, b + i, x + i, count - i, cut, sum);
    for (int k = 0; k < 4; k++)
        for (int l = 0; l < LANES; l++)
            total[k] += (double)sum[k][l];
    return (struct sums){total[0], total[1], total[2], total[3]};
}

static int covered(const float *row, int count)
{
    int n = 0;
    for (int i = 0; i < count; i++)
        n += row[i] > 0;
    return n;
}

/* One more row, below the one before (NULL: the first). */
static void add_row(const float *row, const float *above, int j, float cut, const float *x,
                    struct sv_jumps *jumps)
{
    int n = jumps->size;
    struct sums s = row_sums(row, row + 1, x, n - 1, cut);
    jumps->covered += (uint64_t)covered(row, n);
    jumps->right_more += s.more;
    jumps->right_less += s.less;
    jumps->out_more += s.out_more;
    jumps->out_less += s.out_less;
    if (!above)
        return;
    double ys = 1 - 2.0 * j / n; /* between the two rows */
    s = row_sums(row, above, x, n, cut);
    jumps->up_more += s.more;
    jumps->up_less += s.less;
    jumps->out_more += ys > 0 ? ys * s.more : -ys * s.less;
    jumps->out_less += ys > 0 ? ys * s.less : -ys * s.more;
}

/* xs between a texel and the next. */
static void begin(int size, struct sv_jumps *jumps, float *x)
{
    assert(size >= 1 && size <= SIZE_MAX_TEXELS);
    *jumps = (struct sv_jumps){.size = size};
    for (int i = 0; i < size; i++)
        x[i] = (float)(2.0 * (i + 1) / size - 1);
}

void sv_jumps_measure(const float *q, int size, float cut, struct sv_jumps *jumps)
{
    float x[SIZE_MAX_TEXELS];
    begin(size, jumps, x);
    for (int j = 0; j < size; j++, q += size)
        add_row(q, j > 0 ? q - size : NULL, j, cut, x, jumps);
}

void sv_jumps_measure_codes(const uint16_t *q, int size, float cut, struct sv_jumps *jumps)
{
    float x[SIZE_MAX_TEXELS], rows[2][SIZE_MAX_TEXELS];
    begin(size, jumps, x);
    for (int j = 0; j < size; j++, q += size) {
        float *row = rows[j & 1];
        for (int i = 0; i < size; i++)
            row[i] = (float)q[i] * (1.0f / 32768);
        add_row(row, j > 0 ? rows[(j & 1) ^ 1] : NULL, j, cut, x, jumps);
    }
}

double sv_jumps_opened(const struct sv_jumps *jumps, double alpha, double beta, double gamma)
{
    double width = (alpha > 0 ? alpha * jumps->right_less : -alpha * jumps->right_more) +
                   (beta > 0 ? beta * jumps->up_less : -beta * jumps->up_more) +
                   (gamma > 0 ? gamma * jumps->out_more : -gamma * jumps->out_less);
    return width * 0.5 * jumps->size;
}
