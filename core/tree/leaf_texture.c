/* leaf_texture.c - leaves drawn procedurally: an atlas of 2 x 2 variants for each habit.
 *
 * Every variant fills its cell from the base (lower edge) to the tip (upper edge). A shape is a function of
 * place (x in [-1, 1] across, y in [0, 1] from base to tip) that says whether the leaf is there and,
 * everywhere, what colour it would have: texels outside carry leaf colour, too, so that filtering draws no
 * halo. Alpha is the share of 16 samples inside. Colours are sRGB codes; a blade's linear green albedo lies
 * near 0.10, a needle's near 0.06 (leaf reflectance in the visible: Gates et al. 1965). Own drawing. */
#include "core/tree/grow_math.h"
#include "core/tree/grow_parts.h"

enum { CELL = 256, SIDE = 2 * CELL, SAMPLES = 4 };

struct leaf_sample {
    bool inside;
    double rgb[3]; /* sRGB codes, 0 .. 255 */
};

struct leaf_shape {
    double half_width;     /* of the cell, at the widest */
    double peak, fullness; /* where the widest place is; < 1 rounder */
    double teeth, tooth_depth;
    double veins, vein_slope;
    double base[3], vein[3]; /* colours */
};

static const struct leaf_shape BLADES[SV_HABIT_COUNT] = {
    [SV_HABIT_BROADLEAF] = {0.97, 0.46, 0.66, 9, 0.030, 8, 0.42, {70, 92, 46}, {104, 122, 70}},
    [SV_HABIT_POPLAR] = {0.97, 0.30, 0.70, 14, 0.035, 6, 0.60, {74, 94, 49}, {114, 128, 78}},
    [SV_HABIT_SHRUB] = {0.97, 0.55, 0.58, 18, 0.025, 6, 0.50, {66, 90, 48}, {98, 116, 68}},
    [SV_HABIT_PALM] = {0.98, 0.20, 0.50, 0, 0, 0, 0, {78, 96, 54}, {112, 126, 74}},
};

/* Tints of the four variants: young, mature, shaded, sunny. */
static const double TINTS[4][3] = {
    {1.06, 1.08, 0.98}, {0.97, 0.98, 1.0}, {0.86, 0.92, 0.96}, {1.12, 1.04, 0.90}};

/* Half width of a blade at height y (0 at both ends, shape->half_width at the peak): a sine in a warped y. */
static double blade_width(const struct leaf_shape *shape, double y)
{
    double s = (y - 0.03) / 0.955;
    if (s <= 0 || s >= 1)
        return 0;
    /* s^e = 1/2 at the peak */
    static const double LN_HALF = -0.69314718055994530942;
    double ln_peak = 0, q = (shape->peak - 1) / (shape->peak + 1), term = q;
    for (int k = 1; k < 40; k += 2, term *= q * q)
        ln_peak += 2 * term / k;
    double arch = sv_grow_sin(SV_PI * sv_grow_pow(s, LN_HALF / ln_peak));
    return shape->half_width * sv_grow_pow(arch > 0 ? arch : 0, shape->fullness);
}

/* The blade's half width at (x, y), with the teeth of its rim. */
static double toothed(const struct leaf_shape *shape, double ax, double y, double width)
{
    double tooth = shape->teeth * y - 0.6 * ax;
    return width * (1 - shape->tooth_depth * (tooth - floor(tooth)));
}

static bool in_blade(const struct leaf_shape *shape, double x, double y, double width)
{
    double ax = fabs(x);
    return ax < toothed(shape, ax, y, width) || (y < 0.10 && ax < 0.045); /* or on its stalk */
}

static void color_blade(const struct leaf_shape *shape, double x, double y, double width, uint64_t seed,
                        double rgb[3])
{
    double ax = fabs(x), rib = 0.012 + 0.035 * (1 - y), w = toothed(shape, ax, y, width);
    double line = shape->veins * (y - shape->vein_slope * ax), phase = line - floor(line);
    double near_vein = fmin(phase, 1 - phase) / (shape->veins > 0 ? shape->veins : 1); /* in leaf lengths */
    double vein = shape->veins > 0 && near_vein < 0.010 ? 1 - near_vein / 0.010 : 0;
    double pillow = shape->veins > 0 ? 0.93 + 0.14 * (4 * phase * (1 - phase)) : 1.0;
    double spots = 1 + 0.07 * sv_grow_noise(6 * x + 9, 9 * y, 64, 64, seed) +
                   0.05 * sv_grow_noise(21 * x + 33, 29 * y, 128, 128, seed + 1);
    double edge = w > 0 ? ax / w : 1, rim = edge > 0.85 ? 1 - 0.10 * fmin((edge - 0.85) / 0.15, 1) : 1;
    double mix = ax < rib ? 0.85 : 0.42 * vein;
    double fold = x < 0 ? 0.965 : 1.03; /* the two halves catch light differently */
    if (shape->veins == 0)              /* parallel veins of a palm's leaflet */
        spots *= 1 + 0.06 * sv_grow_noise(24 * x + 24, 1.5 * y, 64, 64, seed + 2);
    for (int c = 0; c < 3; c++)
        rgb[c] = (1 - mix) * shape->base[c] * pillow * spots * rim * fold + mix * shape->vein[c];
}

/* One layer of a spray: needles leave the stem at slope (lengthwise per crosswise); true on a needle, *shade
 * its light. */
static bool needle_layer(double x, double y, double count, double slope, double duty, uint64_t seed,
                         double *shade)
{
    double bow = y > 0.55 ? slope + 0.55 * (y - 0.55) : slope; /* towards the tip they point onward */
    double ax = fabs(x), s = count * (y - bow * ax) + (x < 0 ? 0.5 : 0.0);
    double k = floor(s + 0.5);
    uint64_t h = sv_mix64(seed + (uint64_t)(int64_t)k * 2 + (x < 0));
    double jitter = (double)(h >> 40) * 0x1p-24 - 0.5, reach_jitter = (double)(h & 0xFFFF) / 65536.0;
    double foot = k / count; /* where the needle leaves the stem */
    if (foot < -0.02 || foot > 0.93)
        return false;
    /* The spray's outline: full along its sides, round at the tip. */
    double late = foot > 0.35 ? (foot - 0.35) / 0.58 : 0, tip = 1 - 0.78 * late * late;
    double reach = (0.90 + 0.08 * reach_jitter) * tip * (foot < 0.04 ? 0.8 : 1);
    double along = ax / reach;
    if (along > 1)
        return false;
    double half = 0.5 * duty * (along < 0.75 ? 1 : 1 - 0.8 * (along - 0.75) / 0.25);
    double off = fabs(s - k - 0.22 * jitter);
    if (off > half)
        return false;
    *shade = (0.86 + 0.26 * reach_jitter) * (1.08 - 0.30 * off / half) * (0.84 + 0.24 * along);
    return true;
}

static struct leaf_sample spray(double x, double y, uint64_t seed)
{
    static const double needle[3] = {70, 94, 61}, stem[3] = {84, 68, 48};
    struct leaf_sample out = {.inside = true};
    double shade = 0.72;
    bool front = needle_layer(x, y, 19, 0.16, 0.62, seed, &shade);
    bool back = !front && needle_layer(x, y, 17, 0.27, 0.66, seed + 99, &shade);
    bool on_stem = fabs(x) < 0.045 && y < 0.93 && !front;
    if (back)
        shade *= 0.80;
    if (!front && !back && y > 0.86 && fabs(x) < 0.10 * (1 - y) / 0.1) /* the bud's needles point onward */
        front = true, shade = 1.05;
    out.inside = front || back || on_stem;
    double fresh = y > 0.72 ? (y - 0.72) / 0.28 : 0; /* this year's needles are lighter */
    for (int c = 0; c < 3; c++) {
        out.rgb[c] = on_stem ? stem[c] : needle[c] * shade * (1 + (c == 2 ? 0.05 : 0.22) * fresh);
        if (!out.inside)
            out.rgb[c] = needle[c] * 0.9;
    }
    return out;
}

static uint8_t to_code(double v)
{
    return (uint8_t)sv_clamp(v + 0.5, 0, 255);
}

static bool at_border(int i, int j)
{
    return i < 2 || i >= CELL - 2 || j < 2; /* kept empty: cells do not bleed into one another */
}

/* A blade's texel: its outline from all samples, its smooth colour from the middle one. */
static void draw_blade_texel(const struct leaf_shape *shape, int i, int j, const double width[CELL * SAMPLES],
                             uint64_t seed, const double tint[3], uint8_t texel[4])
{
    int inside = 0;
    for (int k = 0; k < SAMPLES * SAMPLES && !at_border(i, j); k++) {
        int row = j * SAMPLES + k / SAMPLES;
        double x = 2 * (i + (k % SAMPLES + 0.5) / SAMPLES) / CELL - 1, y = 1 - (row + 0.5) / (CELL * SAMPLES);
        inside += in_blade(shape, x, y, width[row]);
    }
    double rgb[3];
    color_blade(shape, 2 * (i + 0.5) / CELL - 1, 1 - (j + 0.5) / CELL, width[j * SAMPLES + SAMPLES / 2], seed,
                rgb);
    for (int c = 0; c < 3; c++)
        texel[c] = to_code(tint[c] * rgb[c]);
    texel[3] = (uint8_t)(255 * inside / (SAMPLES * SAMPLES));
}

/* A spray's texel: needles are about as thin as texels, so the colour is the mean of the samples on them. */
static void draw_spray_texel(int i, int j, uint64_t seed, const double tint[3], uint8_t texel[4])
{
    double on[3] = {0, 0, 0}, off[3] = {0, 0, 0};
    int inside = 0;
    for (int k = 0; k < SAMPLES * SAMPLES; k++) {
        double x = 2 * (i + (k % SAMPLES + 0.5) / SAMPLES) / CELL - 1;
        double y = 1 - (j + (k / SAMPLES + 0.5) / SAMPLES) / CELL;
        struct leaf_sample s = spray(x, y, seed);
        inside += s.inside;
        for (int c = 0; c < 3; c++)
            *(s.inside ? &on[c] : &off[c]) += s.rgb[c];
    }
    for (int c = 0; c < 3; c++)
        texel[c] = to_code(tint[c] * (inside ? on[c] / inside : off[c] / (SAMPLES * SAMPLES)));
    texel[3] = at_border(i, j) ? 0 : (uint8_t)(255 * inside / (SAMPLES * SAMPLES));
}

enum sv_status sv_leaf_texture(enum sv_habit habit, uint64_t seed, struct sv_image *image, double *coverage,
                               struct sv_error *error)
{
    struct sv_image out;
    enum sv_status status = sv_image_alloc(SIDE, SIDE, 4, SV_PIXEL_U8, &out, error);
    if (status != SV_OK)
        return status;
    double width[CELL * SAMPLES];
    long kept = 0;
    for (int row = 0; row < CELL * SAMPLES; row++)
        width[row] =
            habit == SV_HABIT_CONIFER ? 0 : blade_width(&BLADES[habit], 1 - (row + 0.5) / (CELL * SAMPLES));
    for (int variant = 0; variant < 4; variant++)
        for (int j = 0; j < CELL; j++)
            for (int i = 0; i < CELL; i++) {
                size_t at = (size_t)((variant >> 1) * CELL + j) * SIDE + (size_t)((variant & 1) * CELL + i);
                uint8_t *texel = (uint8_t *)out.data + 4 * at;
                uint64_t grain = sv_mix64(seed + (uint64_t)variant * 1000);
                if (habit == SV_HABIT_CONIFER)
                    draw_spray_texel(i, j, grain, TINTS[variant], texel);
                else
                    draw_blade_texel(&BLADES[habit], i, j, width, grain, TINTS[variant], texel);
                kept += texel[3] >= 128;
            }
    *image = out;
    *coverage = (double)kept / ((double)SIDE * SIDE);
    return SV_OK;
}
