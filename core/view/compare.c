/* compare.c - one pass over the pixels for the plain measures, one sweep of rows for SSIM: five planes (x, y,
 * x^2, y^2, xy) are smoothed along each row as it comes, and the last eleven smoothed rows, weighted, give
 * the windows' moments. Variances are differences of moments in double: of 8-bit values they lose 5 of 16
 * digits at most. */
#include "core/view/compare.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

enum { SIDE = SV_COMPARE_SSIM_SIDE, PLANES = 5 };

struct pair {
    const struct sv_image *picture, *truth, *mask;
    int width, height, colors;
};

static bool counts(const struct pair *p, int x, int y)
{
    return !p->mask || ((const uint8_t *)p->mask->data)[(size_t)y * (size_t)p->width + (size_t)x] != 0;
}

static const uint8_t *pixel(const struct sv_image *image, int x, int y)
{
    return (const uint8_t *)image->data +
           ((size_t)y * (size_t)image->width + (size_t)x) * (size_t)image->channels;
}

static double luma(const struct sv_image *image, int x, int y)
{
    const uint8_t *p = pixel(image, x, y);
    return image->channels < 3 ? p[0] : 0.299 * p[0] + 0.587 * p[1] + 0.114 * p[2];
}

static bool is_picture(const struct sv_image *image)
{
    return image && image->data && image->type == SV_PIXEL_U8 && image->width > 0 && image->height > 0 &&
           (image->channels == 1 || image->channels == 3 || image->channels == 4);
}

static enum sv_status check(const struct sv_image *picture, const struct sv_image *truth,
                            const struct sv_compare_options *options, struct sv_error *error)
{
    if (!is_picture(picture) || !is_picture(truth))
        return sv_fail(error, SV_EINVAL, "image", "pictures to compare have 8 bits and 1, 3 or 4 channels");
    if (picture->width != truth->width || picture->height != truth->height)
        return sv_fail(error, SV_EINVAL, "image", "%d x %d cannot be compared with %d x %d", picture->width,
                       picture->height, truth->width, truth->height);
    if ((picture->channels == 1) != (truth->channels == 1))
        return sv_fail(error, SV_EINVAL, "image", "%d channels cannot be compared with %d", picture->channels,
                       truth->channels);
    const struct sv_image *mask = options->mask;
    if (mask && (mask->type != SV_PIXEL_U8 || mask->channels != 1 || mask->width != truth->width ||
                 mask->height != truth->height || !mask->data))
        return sv_fail(error, SV_EINVAL, "mask", "a mask has 8 bits, one channel and the pictures' size");
    if (options->step < 0 || options->step > 254)
        return sv_fail(error, SV_EINVAL, "step", "%d is outside 0..254", options->step);
    return SV_OK;
}

static void plain_measures(const struct pair *p, int step, struct sv_compare_result *r)
{
    uint64_t pixels = 0, sum = 0, square = 0, differ = 0;
    for (int y = 0; y < p->height; y++)
        for (int x = 0; x < p->width; x++) {
            if (!counts(p, x, y))
                continue;
            const uint8_t *a = pixel(p->picture, x, y), *b = pixel(p->truth, x, y);
            int most = 0;
            for (int c = 0; c < p->colors; c++) {
                int d = abs(a[c] - b[c]);
                most = d > most ? d : most;
                sum += (uint64_t)d;
                square += (uint64_t)(d * d);
            }
            differ += most > step;
            pixels++;
        }
    double n = (double)pixels * p->colors; /* 0 / 0 is the NaN that the header promises */
    r->pixels = pixels;
    r->mean_abs = (double)sum / n;
    r->rmse = sqrt((double)square / n);
    r->psnr_db = 20 * log10(255 / r->rmse);
    r->differ_share = (double)differ / (double)pixels;
}

/* Adds the squared luma steps of one pair of neighbours. */
static void add_step(const struct pair *p, int x, int y, int u, int v, double energy[2])
{
    if (u >= p->width || v >= p->height || !counts(p, u, v))
        return;
    double a = luma(p->picture, u, v) - luma(p->picture, x, y),
           b = luma(p->truth, u, v) - luma(p->truth, x, y);
    energy[0] += a * a;
    energy[1] += b * b;
}

static double gradient_ratio(const struct pair *p)
{
    double energy[2] = {0, 0};
    bool any = false;
    for (int y = 0; y < p->height; y++)
        for (int x = 0; x < p->width; x++) {
            if (!counts(p, x, y))
                continue;
            any = true;
            add_step(p, x, y, x + 1, y, energy);
            add_step(p, x, y, x, y + 1, energy);
        }
    if (!any)
        return NAN;
    return energy[1] > 0 ? energy[0] / energy[1] : energy[0] > 0 ? INFINITY : 1;
}

/* The Gaussian's one-dimensional weights; its product is the normalised circular window. */
static void make_window(double w[SIDE])
{
    double sum = 0;
    for (int i = 0; i < SIDE; i++)
        sum += w[i] = exp(-(i - SIDE / 2) * (i - SIDE / 2) / (2 * 1.5 * 1.5));
    for (int i = 0; i < SIDE; i++)
        w[i] /= sum;
}

/* Smooths picture row y: out[plane * windows + i] for the windows that begin at column i. x, y: scratch of a
 * row of luma each. */
static void smooth_row(const struct pair *p, int row, const double w[SIDE], double *a, double *b, double *out)
{
    int windows = p->width - SIDE + 1;
    for (int x = 0; x < p->width; x++) {
        a[x] = luma(p->picture, x, row);
        b[x] = luma(p->truth, x, row);
    }
    for (int i = 0; i < windows; i++) {
        double s[PLANES] = {0};
        for (int k = 0; k < SIDE; k++) {
            double x = a[i + k], y = b[i + k], wx = w[k] * x, wy = w[k] * y;
            s[0] += wx, s[1] += wy, s[2] += wx * x, s[3] += wy * y, s[4] += wx * y;
        }
        for (int k = 0; k < PLANES; k++)
            out[(size_t)k * (size_t)windows + (size_t)i] = s[k];
    }
}

static double ssim_of(const double m[PLANES])
{
    const double c1 = (0.01 * 255) * (0.01 * 255), c2 = (0.03 * 255) * (0.03 * 255);
    double xx = m[2] - m[0] * m[0], yy = m[3] - m[1] * m[1], xy = m[4] - m[0] * m[1];
    return (2 * m[0] * m[1] + c1) * (2 * xy + c2) /
           ((m[0] * m[0] + m[1] * m[1] + c1) * (xx + yy + c2)); /* eq. 13 */
}

/* ring holds the smoothed rows y - 10 .. y, row y in slot y % 11. */
static void sum_windows(const struct pair *p, int y, const double w[SIDE], const double *ring, double *sum,
                        uint64_t *count)
{
    size_t windows = (size_t)(p->width - SIDE + 1);
    for (size_t i = 0; i < windows; i++) {
        if (!counts(p, (int)i + SIDE / 2, y - SIDE / 2))
            continue;
        double m[PLANES] = {0};
        for (int k = 0; k < SIDE; k++) {
            const double *row = ring + (size_t)((y - SIDE + 1 + k) % SIDE) * PLANES * windows;
            for (int j = 0; j < PLANES; j++)
                m[j] += w[k] * row[(size_t)j * windows + i];
        }
        *sum += ssim_of(m);
        (*count)++;
    }
}

static enum sv_status mean_ssim(const struct pair *p, double *ssim, struct sv_error *error)
{
    *ssim = NAN;
    if (p->width < SIDE || p->height < SIDE)
        return SV_OK;
    double w[SIDE], sum = 0;
    uint64_t count = 0;
    size_t row = PLANES * (size_t)(p->width - SIDE + 1);
    double *ring = malloc(SIDE * row * sizeof *ring), *a = malloc((size_t)p->width * sizeof *a),
           *b = malloc((size_t)p->width * sizeof *b);
    enum sv_status status = SV_OK;
    if (!ring || !a || !b)
        status = sv_fail(error, SV_ENOMEM, NULL, "no memory for eleven rows of %d px", p->width);
    make_window(w);
    for (int y = 0; status == SV_OK && y < p->height; y++) {
        smooth_row(p, y, w, a, b, ring + (size_t)(y % SIDE) * row);
        if (y >= SIDE - 1)
            sum_windows(p, y, w, ring, &sum, &count);
    }
    free(ring);
    free(a);
    free(b);
    if (status == SV_OK && count)
        *ssim = sum / (double)count;
    return status;
}

enum sv_status sv_compare(const struct sv_image *picture, const struct sv_image *truth,
                          const struct sv_compare_options *options, struct sv_compare_result *result,
                          struct sv_error *error)
{
    struct sv_compare_options o = options ? *options : SV_COMPARE_OPTIONS_DEFAULT;
    enum sv_status status = check(picture, truth, &o, error);
    if (status != SV_OK)
        return status;
    struct pair p = {picture, truth, o.mask, truth->width, truth->height, truth->channels == 1 ? 1 : 3};
    struct sv_compare_result r;
    status = mean_ssim(&p, &r.ssim, error);
    if (status != SV_OK)
        return status;
    plain_measures(&p, o.step, &r);
    r.gradient_ratio = gradient_ratio(&p);
    *result = r;
    return SV_OK;
}
