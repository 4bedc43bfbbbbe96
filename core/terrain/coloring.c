/* coloring.c - the natural colour of a terrain: soft classes of cover, their borders broken by noise.
 *
 * Own design. From bottom to top each cover is laid over the last with a weight in 0 .. 1: meadow (lush,
 * plain, dry by wetness, height and aspect), forest floor, bare soil of worn ridges, scree, rock with strata,
 * snow; sand and water at the sea. Thresholds are moved by noise, so that no border follows a contour line.
 * Constants were found by looking at the Alps (250 m DEM), Zion (90 m), Virginia (10 m) and made terrain (2
 * m). */
#include "core/terrain/coloring.h"

#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/base/rng.h"
#include "core/terrain/imagery_tone.h"
#include "core/terrain/land_form.h"

enum { TEXELS_MAX = 4096, FACTOR_MAX = 4, TILE = 512 };
#define TEXEL_MIN_M 0.9

struct rgb {
    float r, g, b;
};

static const struct rgb LUSH = {0.062f, 0.108f, 0.024f}, MEADOW = {0.096f, 0.130f, 0.038f},
                        DRY = {0.205f, 0.176f, 0.084f}, ALPINE = {0.128f, 0.124f, 0.056f},
                        FLOOR = {0.070f, 0.063f, 0.032f}, SHRUB = {0.036f, 0.052f, 0.020f},
                        SOIL = {0.150f, 0.112f, 0.070f}, SCREE = {0.215f, 0.205f, 0.188f},
                        ROCK = {0.180f, 0.172f, 0.160f}, RED_ROCK = {0.330f, 0.195f, 0.120f},
                        SNOW = {0.740f, 0.755f, 0.768f}, SAND = {0.360f, 0.305f, 0.215f},
                        WATER = {0.014f, 0.034f, 0.056f}, SHALLOW = {0.035f, 0.080f, 0.100f};

/* What holds for the whole field. */
struct climate {
    double tree_line_m, snow_line_m;
    float aridity;     /* 0 .. 0.6: the belts of deserts */
    float equatorward; /* +1: the sun stands in the south, -1: in the north */
};

struct painter {
    const struct sv_heightfield *field;
    struct sv_land_form form;
    struct climate climate;
    float *tile; /* TILE^2 of noise, mean 0, deviation 1, within +-2.6, periodic */
    /* Tile samples a metre at the four scales at which it is laid. */
    double speckle_scale, near_scale, middle_scale, far_scale;
};

/* ---- noise ---- */

static float lattice(int octave, int i, int j, int period)
{
    uint64_t h = sv_mix64((uint64_t)(octave + 1) << 40 ^ (uint64_t)(j % period + 1) << 20 ^
                          (uint64_t)(i % period + 1));
    h = sv_mix64(h + UINT64_C(0x9E3779B97F4A7C15));
    return (float)(h >> 40) * (float)0x1p-23 - 1;
}

/* Value noise with a cubic fade. */
static float tile_octave(int octave, double u, double v, int period)
{
    double x = u * period, y = v * period;
    int i = (int)x, j = (int)y;
    float fx = (float)(x - i), fy = (float)(y - j);
    fx = fx * fx * (3 - 2 * fx);
    fy = fy * fy * (3 - 2 * fy);
    float a = lattice(octave, i, j, period), b = lattice(octave, i + 1, j, period);
    float c = lattice(octave, i, j + 1, period), d = lattice(octave, i + 1, j + 1, period);
    return a + (b - a) * fx + (c - a) * fy + (a - b - c + d) * fx * fy;
}

static void fill_tile(float *tile)
{
    double sum = 0, squares = 0, n = (double)TILE * TILE;
    for (int j = 0; j < TILE; j++)
        for (int i = 0; i < TILE; i++) {
            float v = 0, amplitude = 1;
            for (int k = 0; k < 6; k++, amplitude *= 0.7f)
                v += amplitude * tile_octave(k, (i + 0.5) / TILE, (j + 0.5) / TILE, 7 << k);
            tile[j * TILE + i] = v;
            sum += (double)v;
            squares += (double)v * (double)v;
        }
    double mean = sum / n, scale = 1 / sqrt(squares / n - mean * mean);
    for (int k = 0; k < TILE * TILE; k++)
        tile[k] = (float)sv_clamp(((double)tile[k] - mean) * scale, -2.6, 2.6);
}

/* The tile at (x, y) m, laid with `scale` tile samples a metre; bilinear. */
static float noise_at(const struct painter *p, double x, double y, double scale)
{
    double u = x * scale + (1 << 28), v = y * scale + (1 << 28); /* above 0, so that a cast is a floor */
    int iu = (int)u, iv = (int)v;
    float fx = (float)(u - iu), fy = (float)(v - iv);
    int i = iu & (TILE - 1), j = iv & (TILE - 1), k = (i + 1) & (TILE - 1), l = (j + 1) & (TILE - 1);
    const float *t = p->tile;
    float low = t[j * TILE + i] + (t[j * TILE + k] - t[j * TILE + i]) * fx;
    float high = t[l * TILE + i] + (t[l * TILE + k] - t[l * TILE + i]) * fx;
    return low + (high - low) * fy;
}

/* ---- colours ---- */

static float ramp(float lo, float hi, float v)
{
    float t = (v - lo) / (hi - lo);
    t = t < 0 ? 0 : t > 1 ? 1 : t;
    return t * t * (3 - 2 * t);
}

static struct rgb mix_rgb(struct rgb a, struct rgb b, float t)
{
    return (struct rgb){a.r + (b.r - a.r) * t, a.g + (b.g - a.g) * t, a.b + (b.b - a.b) * t};
}

static struct rgb scale_rgb(struct rgb a, float s)
{
    return (struct rgb){a.r * s, a.g * s, a.b * s};
}

/* Noise at a place: f speckles single texels, n and m break the borders of classes, w makes patches and
 * districts. */
struct grain {
    float f, n, m, w;
};

/* Rock: grey to red by aridity and district, in strata a dozen metres thick that dip a little and fade in and
 * out. */
static struct rgb rock_color(const struct painter *p, const struct sv_land_sample *s, struct grain g)
{
    float red = ramp(-0.6f, 1.4f, g.w * 0.7f + 3.4f * p->climate.aridity - 0.9f);
    struct rgb base = mix_rgb(ROCK, RED_ROCK, red);
    float layer = (s->z + 9 * g.m + 3 * g.n) / 13.0f, broad = (s->z + 16 * g.w) / 71.0f;
    float band = 0.5f * sinf(6.2832f * layer) + 0.5f * sinf(6.2832f * layer * 2.37f + 1.3f);
    float district = sinf(6.2832f * broad);
    float strength = 0.10f + 0.10f * red;
    base = scale_rgb(base, 1 + strength * band + 0.12f * district + 0.10f * g.n + 0.08f * g.f);
    return mix_rgb(base, scale_rgb(SCREE, 1.1f), 0.25f * red * ramp(0.3f, 0.9f, district));
}

static struct rgb meadow_color(const struct painter *p, const struct sv_land_sample *s, float sunny,
                               float alpine, struct grain g)
{
    float thirst = 0.35f * sunny - 0.7f * (s->wet - 0.35f) + 1.1f * (s->broad + 0.5f * s->fine) +
                   0.22f * g.w + 0.16f * g.m + 0.07f * g.n + 1.2f * p->climate.aridity;
    struct rgb c = mix_rgb(MEADOW, LUSH, ramp(0.05f, -0.50f, thirst));
    c = mix_rgb(c, DRY, 0.9f * ramp(0.08f, 0.75f, thirst));
    c = mix_rgb(c, ALPINE, 0.8f * alpine);
    return scale_rgb(c, 1 + 0.10f * g.f + 0.07f * g.n + 0.05f * g.m);
}

/* Litter and moss of woods in patches below the tree line, on slopes and in hollows; bushes strewn about. */
static struct rgb add_woods(const struct painter *p, const struct sv_land_sample *s, struct rgb c,
                            float tangent, float alpine, struct grain g)
{
    float lower = (1 - alpine) * (1 - 0.7f * p->climate.aridity);
    float wood =
        ramp(0.15f, 0.9f, 0.45f * g.w + 0.25f * g.m + 0.10f * g.n + 0.4f * s->wet + 0.9f * tangent - 0.35f);
    c = mix_rgb(c, scale_rgb(FLOOR, 1 + 0.12f * g.f), 0.7f * wood * lower);
    float bush = ramp(0.8f, 1.5f, g.f + 0.55f * g.n + 0.5f * g.m + 0.9f * wood + 0.4f * s->wet - 0.3f);
    return mix_rgb(c, SHRUB, 0.6f * bush * (1 - alpine));
}

/* Land above the sea. */
static struct rgb land_color(const struct painter *p, const struct sv_land_sample *s, struct grain g)
{
    const struct climate *k = &p->climate;
    float tangent = sqrtf(s->east * s->east + s->north * s->north);
    float sunny = k->equatorward * s->north / sqrtf(1 + tangent * tangent);
    float steep = tangent + 0.09f * g.m + 0.06f * g.n + 0.03f * g.f; /* where borders of slope classes lie */
    float high = (float)((double)s->z - k->tree_line_m) + 70 * g.m + 110 * g.w;
    float alpine = ramp(-250, 120, high), barren = ramp(150, 800, high - 500 * s->wet);
    struct rgb c = add_woods(p, s, meadow_color(p, s, sunny, alpine, g), tangent, alpine, g);
    float worn = ramp(0.05f, 0.16f, s->fine + 0.6f * s->broad + 0.02f * g.m) * ramp(0.1f, 0.35f, steep);
    c = mix_rgb(c, scale_rgb(SOIL, 1 + 0.1f * g.n + 0.1f * g.f), 0.6f * worn);
    /* What is steep is bare: the sooner, the drier and the higher it lies; woods hold on to slopes of 40
     * degrees. */
    float bare = 0.43f * k->aridity + 0.10f * barren - 0.20f * (1 - alpine);
    float scree =
        ramp(0.50f, 0.72f, steep + bare + 0.5f * barren - 1.2f * s->fine) * (0.35f + 0.65f * alpine);
    scree = 0.85f * fmaxf(scree, 0.8f * barren);
    float rock = ramp(0.62f, 0.92f, steep + bare + 1.6f * s->fine + 0.8f * s->broad);
    if (rock > 0 || scree > 0) {
        struct rgb stone = rock_color(p, s, g);
        struct rgb rubble = scale_rgb(mix_rgb(SCREE, stone, 0.35f + 0.6f * k->aridity), 1 + 0.12f * g.f);
        c = mix_rgb(mix_rgb(c, rubble, scree), stone, rock);
    }
    /* Snow lies deeper in hollows and on the shady side, and not on walls. */
    float cold = (float)((double)s->z - k->snow_line_m) + 130 * g.m + 60 * g.n - 170 * sunny - 900 * s->broad;
    float snow = ramp(-60, 140, cold) * (1 - ramp(1.0f, 1.6f, steep + 0.8f * s->fine));
    return mix_rgb(c, SNOW, snow);
}

/* Crevices see less sky, ridges more; a hint of it in the colour, since the light has no occlusion of its
 * own. */
static float cavity(const struct sv_land_sample *s)
{
    float v = 1 + 0.7f * s->fine + 0.35f * s->broad;
    return v < 0.8f ? 0.8f : v > 1.2f ? 1.2f : v;
}

static struct rgb color_at(const struct painter *p, double u, double v)
{
    struct sv_land_sample s = sv_land_form_at(&p->form, u, v);
    double x = u * (p->field->width - 1) * p->field->dx, y = v * (p->field->height - 1) * p->field->dy;
    struct grain g = {noise_at(p, y, -x, p->speckle_scale),
                      noise_at(p, 0.8 * x - 0.6 * y, 0.6 * x + 0.8 * y, p->near_scale),
                      noise_at(p, x + 137, y + 71, p->middle_scale), noise_at(p, x, y, p->far_scale)};
    float sea = ramp(0.42f, 0.58f, s.sea + 0.10f * g.n);
    if (sea >= 1)
        return WATER;
    struct rgb c = scale_rgb(land_color(p, &s, g), cavity(&s));
    float beach = ramp(70, 15, s.shore + 8 * g.n) * ramp(6, 2, s.z + 0.7f * g.n);
    c = mix_rgb(c, SAND, beach);
    return mix_rgb(c, mix_rgb(SHALLOW, WATER, ramp(0.7f, 1, s.sea)), sea);
}

/* Lines through cited pairs: tree line 4000 m to 25 degrees, 2150 m in the Alps (46.7), 200 m at 70; snow 850
 * m above. */
static struct climate climate_at(double latitude_deg)
{
    double lat = isfinite(latitude_deg) ? sv_clamp(latitude_deg, -90, 90) : 45, away = fabs(lat);
    double tree = sv_clamp(4000 - 85 * fmax(0, away - 25), 0, 4000);
    float belt = ramp(10, 22, (float)away) * (1 - ramp(37, 44, (float)away));
    return (struct climate){tree, tree + 850, 0.6f * belt, lat >= 0 ? -1.0f : 1.0f};
}

/* ---- images ---- */

static enum sv_status arena_image(int width, int height, int channels, struct sv_arena *arena,
                                  struct sv_image *out, struct sv_error *error)
{
    void *data = sv_arena_alloc(arena, (size_t)width * (size_t)height, (size_t)channels);
    if (!data)
        return sv_fail(error, SV_ENOMEM, "terrain", "no room for a texture of %d x %d texels", width, height);
    *out = (struct sv_image){width, height, channels, SV_PIXEL_U8, data};
    return SV_OK;
}

static void fill_normals(const struct sv_heightfield *f, struct sv_image *image)
{
    uint8_t *out = image->data;
    for (int j = 0; j < f->height; j++)
        for (int i = 0; i < f->width; i++, out += 2) {
            struct sv_vec3 n = sv_heightfield_sample_normal(f, i, j);
            out[0] = (uint8_t)sv_clamp(floor(n.x * 127 + 128.5), 1, 255);
            out[1] = (uint8_t)sv_clamp(floor(n.y * 127 + 128.5), 1, 255);
        }
}

static int texels_for(int samples, double cell_m)
{
    int factor = (int)sv_clamp(cell_m / TEXEL_MIN_M, 1, FACTOR_MAX);
    int texels = (samples - 1) * factor;
    return texels > TEXELS_MAX ? TEXELS_MAX : texels;
}

/* The natural colour of texel (i, j), with what the albedo already holds, imagery, over it. */
static void paint_texel(const struct painter *p, const struct sv_image *albedo, int i, int j, uint8_t *texel)
{
    struct rgb c = color_at(p, (i + 0.5) / albedo->width, (j + 0.5) / albedo->height);
    if (texel[3]) {
        struct rgb o = {sv_linear_from_srgb8[texel[0]], sv_linear_from_srgb8[texel[1]],
                        sv_linear_from_srgb8[texel[2]]};
        c = mix_rgb(c, o, texel[3] / 255.0f);
    }
    texel[0] = sv_srgb8_from_linear(c.r);
    texel[1] = sv_srgb8_from_linear(c.g);
    texel[2] = sv_srgb8_from_linear(c.b);
    texel[3] = 255;
}

static void paint(struct painter *p, const struct sv_image *albedo)
{
    uint8_t *texel = albedo->data;
    for (int j = 0; j < albedo->height; j++)
        for (int i = 0; i < albedo->width; i++, texel += 4)
            if (texel[3] != 255)
                paint_texel(p, albedo, i, j, texel);
}

/* Imagery into the albedo, of its size, toned where it is raw; returns whether all of it is opaque. */
static bool lay_imagery(const struct sv_image *imagery, const struct sv_image *albedo)
{
    const uint8_t *from = imagery->data;
    uint8_t *to = albedo->data, table[3][256];
    bool opaque = true;
    (void)sv_imagery_tone(imagery, table);
    for (size_t k = 0; k < (size_t)albedo->width * (size_t)albedo->height; k++, from += 4, to += 4) {
        for (int c = 0; c < 3; c++)
            to[c] = table[c][from[c]];
        to[3] = from[3];
        opaque = opaque && from[3] == 255;
    }
    return opaque;
}

static enum sv_status paint_natural(struct sv_terrain *terrain, double latitude_deg, struct sv_error *error)
{
    const struct sv_heightfield *f = &terrain->field;
    struct painter p = {.field = f, .climate = climate_at(latitude_deg)};
    p.tile = malloc(sizeof *p.tile * TILE * TILE);
    if (!p.tile)
        return sv_fail(error, SV_ENOMEM, "terrain", "no memory to colour the terrain");
    enum sv_status status = sv_land_form_init(f, &p.form, error);
    if (!status) {
        double texel = sqrt((f->width - 1) * f->dx / terrain->albedo.width * ((f->height - 1) * f->dy) /
                            terrain->albedo.height);
        double near_period_m = fmax(110, 400 * texel);
        p.near_scale = TILE / near_period_m;
        p.speckle_scale = p.near_scale / 0.29;
        p.middle_scale = p.near_scale / 4.3;
        p.far_scale = TILE / fmax(2300, 9 * near_period_m);
        fill_tile(p.tile);
        paint(&p, &terrain->albedo);
        sv_land_form_finish(&p.form);
    }
    free(p.tile);
    return status;
}

enum sv_status sv_terrain_color(struct sv_terrain *terrain, const struct sv_image *imagery,
                                double latitude_deg, struct sv_arena *arena, struct sv_error *error)
{
    const struct sv_heightfield *f = &terrain->field;
    if (imagery &&
        (!imagery->data || imagery->channels != 4 || imagery->type != SV_PIXEL_U8 ||
         imagery->width > SV_TERRAIN_TEXTURE_SIDE_MAX || imagery->height > SV_TERRAIN_TEXTURE_SIDE_MAX))
        return sv_fail(error, SV_EINVAL, "terrain.imagery",
                       "imagery must be RGBA u8 of at most %d texels a side", SV_TERRAIN_TEXTURE_SIDE_MAX);
    int width = imagery ? imagery->width : texels_for(f->width, f->dx);
    int height = imagery ? imagery->height : texels_for(f->height, f->dy);
    sv_color_init();
    enum sv_status status = arena_image(f->width, f->height, 2, arena, &terrain->normal, error);
    if (!status)
        status = arena_image(width, height, 4, arena, &terrain->albedo, error);
    if (status)
        return status;
    fill_normals(f, &terrain->normal);
    terrain->has_imagery = imagery != NULL;
    if (imagery && lay_imagery(imagery, &terrain->albedo))
        return SV_OK;
    return paint_natural(terrain, latitude_deg, error);
}
