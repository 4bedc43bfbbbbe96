/* sawtooth.c - see sawtooth.h. The peak of S is found on a grid of frequencies, then by parabolas through
 * three points of the sum itself, each a quarter as wide as the one before. */
#include "core/tree/sawtooth.h"

#include <math.h>
#include <stdatomic.h>
#include <string.h>

#include "core/base/simd.h"
#include "core/base/vec.h"
#include "core/tree/sawtooth_kernel.h"

enum { F = SV_SAWTOOTH_FREQUENCIES, W = SV_SAWTOOTH_WINDOW, REFINEMENTS = 4 };

double sv_sawtooth_at(double x, double w)
{
    if (!(w > 0) || !isfinite(w) || !isfinite(x))
        return 0;
    double r = fmod(x, w); /* exact, however far x is */
    r = r < 0 ? r + w : r;
    double f = r / w; /* eq. 1 */
    return f < 1 ? f : 0;
}

static double frequency(int k)
{
    return (double)k / F - 0.5;
}

const struct sv_sawtooth_table *sv_sawtooth_table(void)
{
    /* Two threads that come first at once write the same numbers. */
    static struct sv_sawtooth_table table;
    static atomic_bool made;
    if (atomic_load_explicit(&made, memory_order_acquire))
        return &table;
    for (int c = 0; c < 256; c++) {
        table.re[c] = (float)cos(2 * SV_PI * c / 255);
        table.im[c] = (float)sin(2 * SV_PI * c / 255);
    }
    for (int t = 0; t < W; t++)
        for (int k = 0; k < F; k++) {
            table.cosine[t][k] = (float)cos(2 * SV_PI * frequency(k) * t);
            table.sine[t][k] = (float)-sin(2 * SV_PI * frequency(k) * t);
        }
    atomic_store_explicit(&made, true, memory_order_release);
    return &table;
}

void sv_sawtooth_power_scalar(const struct sv_sawtooth_table *table, const uint8_t code[W], uint32_t mask,
                              float power[F])
{
    float re[F] = {0}, im[F] = {0};
    for (int t = 0; t < W; t++) {
        if (!(mask >> t & 1))
            continue;
        float zr = table->re[code[t]], zi = table->im[code[t]];
        const float *c = table->cosine[t], *s = table->sine[t];
        for (int k = 0; k < F; k++) {
            re[k] = re[k] + (zr * c[k] - zi * s[k]);
            im[k] = im[k] + (zr * s[k] + zi * c[k]);
        }
    }
    for (int k = 0; k < F; k++)
        power[k] = power[k] + (re[k] * re[k] + im[k] * im[k]);
}

/* The rows of a window, gathered. */
struct rows {
    uint8_t code[SV_SAWTOOTH_ROWS_MAX][W];
    uint32_t mask[SV_SAWTOOTH_ROWS_MAX];
    int count;      /* of rows with a pixel at least */
    int pixels;     /* that show a leaf */
    float together; /* sum of n_row^2 */
};

static void gather(const struct sv_sawtooth_window *window, struct rows *rows)
{
    rows->count = rows->pixels = 0;
    rows->together = 0;
    int n = window->rows < SV_SAWTOOTH_ROWS_MAX ? window->rows : SV_SAWTOOTH_ROWS_MAX;
    for (int r = 0; r < n; r++) {
        const uint8_t *code = window->code + r * window->row_step,
                      *mask = window->mask + r * window->row_step;
        uint32_t bits = 0;
        for (int t = 0; t < W; t++) {
            rows->code[rows->count][t] = code[t * window->step];
            bits |= (uint32_t)(mask[t * window->step] != 0) << t;
        }
        int pixels = __builtin_popcount(bits);
        rows->mask[rows->count] = bits;
        rows->count += pixels > 0;
        rows->pixels += pixels;
        rows->together += (float)(pixels * pixels);
    }
}

/* Sum of |S_row(g)|^2 at any frequency. */
static float power_at(const struct sv_sawtooth_table *table, const struct rows *rows, double g)
{
    float c[W], s[W], power = 0;
    double turn_c = cos(2 * SV_PI * g), turn_s = -sin(2 * SV_PI * g), at_c = 1, at_s = 0;
    for (int t = 0; t < W; t++) {
        c[t] = (float)at_c, s[t] = (float)at_s;
        double next = at_c * turn_c - at_s * turn_s;
        at_s = at_c * turn_s + at_s * turn_c;
        at_c = next;
    }
    for (int r = 0; r < rows->count; r++) {
        float re = 0, im = 0;
        for (int t = 0; t < W; t++) {
            if (!(rows->mask[r] >> t & 1))
                continue;
            float zr = table->re[rows->code[r][t]], zi = table->im[rows->code[r][t]];
            re += zr * c[t] - zi * s[t];
            im += zr * s[t] + zi * c[t];
        }
        power += re * re + im * im;
    }
    return power;
}

/* Where the parabola through (-1, a), (0, b), (1, c) has its top; at most one away. */
static double top(float a, float b, float c)
{
    double bend = (double)a - 2 * (double)b + (double)c;
    double x = bend < 0 ? 0.5 * ((double)a - (double)c) / bend : a > c ? -1 : c > a ? 1 : 0;
    return x > 1 ? 1 : x < -1 ? -1 : x;
}

static double refine(const struct sv_sawtooth_table *table, const struct rows *rows, double g)
{
    double step = 0.5 / F;
    for (int k = 0; k < REFINEMENTS; k++, step *= 0.25)
        g += step *
             top(power_at(table, rows, g - step), power_at(table, rows, g), power_at(table, rows, g + step));
    return g;
}

/* Chance that noise correlates as well (sawtooth.h, b and c), over all frequencies. */
static double chance(double square, int pixels, int rows)
{
    if (pixels <= rows + 1) /* phases and the period fit any two */
        return 1;
    double x = square < 1 ? square : 1, loose = 1 - x, sum = 0, n = pixels - 1, log_binomial = 0;
    for (int j = 0; j < rows; j++) { /* eq. b */
        if (j > 0)
            log_binomial += log((n - j + 1) / j);
        /* x^j (1 - x)^(n - j); a power of 0 is 0, as j < rows <= n */
        sum += x > 0 && loose > 0 ? exp(log_binomial + j * log(x) + (n - j) * log(loose)) : x <= 0 && j == 0;
    }
    double free = pixels - rows, ball = 0;
    if (loose > 0) /* eq. c */
        ball = exp(0.5 * rows * log((double)pixels / rows) + 0.5 * free * log(SV_PI * pixels * loose) -
                   lgamma(0.5 * free + 1) - free * log(2 * SV_PI));
    return fmin(1, fmax(sum, ball) * F);
}

struct sv_sawtooth sv_sawtooth_fit(const struct sv_sawtooth_window *window,
                                   const struct sv_sawtooth_options *options)
{
    const struct sv_sawtooth_table *table = sv_sawtooth_table();
    struct rows rows;
    struct sv_sawtooth found = {0, false, 0, 0};
    gather(window, &rows);
    if (rows.pixels == 0 || window->rows < 1)
        return found;
    found.coverage = (float)rows.pixels / (float)(W * window->rows);
    if (!(found.coverage >= options->coverage))
        return found;
    double least = options->period_min > 2 ? (double)options->period_min : 2;
    double most = options->period_max >= 2 ? (double)options->period_max : 255;
    most = most > least ? most : least;
    float power[F] = {0};
    for (int r = 0; r < rows.count; r++)
        if (sv_simd_level() >= SV_SIMD_AVX2)
            sv_sawtooth_power_avx2(table, rows.code[r], rows.mask[r], power);
        else
            sv_sawtooth_power_scalar(table, rows.code[r], rows.mask[r], power);
    int best = F / 2;
    for (int k = 0; k < F; k++)
        if (fabs(frequency(k)) <= 1 / least && power[k] > power[best])
            best = k;
    double g = refine(table, &rows, frequency(best));
    double square = (double)(power_at(table, &rows, g) / rows.together);
    found.correlation = (float)sqrt(fmin(square, 1));
    if (!(chance(square, rows.pixels, rows.count) <= (double)options->chance))
        return found;
    double period = fabs(g) > 1e-9 ? 1 / fabs(g) : INFINITY;
    found.falling = g < 0;
    found.period = (float)(period < least ? least : period > most ? most : period);
    return found;
}
