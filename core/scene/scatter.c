/* scatter.c - trees strewn by dart throwing on a grid, with a shrinking disc, then shared out among the
 * species.
 *
 * Places: Poisson-disc sampling by darts in grid cells (Wei 2008, Parallel Poisson Disk Sampling: the cells
 * of a phase group lie so far apart that their darts cannot collide, so the order inside a group does not
 * matter, and rows are walked in memory order), with the disc shrinking from pass to pass (McCool and Fiume
 * 1992, Hierarchical Poisson Disk Sampling Distributions) from the radius that would just hold `count` trees
 * down to min_spacing_m. So few trees spread out as blue noise, and many pack as tightly as allowed. The disc
 * is up to a fifth wider or narrower by smooth noise, never below min_spacing_m: a wood has thicker and
 * thinner parts. The last pass is thinned at random to the count.
 *
 * Species: each has a field of smooth noise plus a random part; species k takes the trees where its field is
 * highest among those left, as many as its share. The shares hold exactly (largest remainders), and each
 * species forms stands with mixed rims.
 *
 * Determinism: integers, + - * / sqrt floor only. The slope limit compares the normal's z with a cosine
 * summed here. */
#include "core/scene/scatter.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/noise.h"
#include "core/base/rng.h"

enum {
    CELLS_MAX = 1 << 24,
    PASSES_SHRINKING = 40,
    PASSES_PACKING = 400, /* at min_spacing_m; ends sooner, see PACKED_SHARE */
    DARTS = 2,            /* a cell and pass */
    MISSES_MAX =
        40,      /* darts in a row on forbidden ground, or too near when packing, before a cell is given up */
    PROBES = 256 /* a side, to estimate the ground allowed */
};
/* Poisson-disc sets that no dart can enter any more reach about 0.75 of the hexagonal lattice's spacing
 * (Lagae and Dutre 2008); beginning at 0.70 keeps the number of passes small. */
static const double FIRST_RADIUS = 0.70, SHRINK = 0.93;
/* Noise makes the disc this much wider or narrower at most. */
static const double RADIUS_SPREAD = 0.2;
/* Packing ends when a pass adds less than this share. */
static const double PACKED_SHARE = 2e-4;

enum { STREAM_PLACES = 1, STREAM_THIN, STREAM_SPECIES, STREAM_TREE, STREAM_DENSITY, STREAM_SITE };

struct place {
    double x, y;
    uint32_t next; /* in the same cell, plus 1; 0: none */
};

struct sower {
    const struct sv_scatter_spec *spec;
    const struct sv_heightfield *field;
    const struct sv_polygons *polygons;
    struct sv_scatter_report report;
    double min[2], max[2]; /* box of the darts */
    double cos_slope;      /* least z of a normal */
    double radius;         /* of the first pass */
    double cell_x, cell_y; /* sides, m; >= the widest disc, or the whole box */
    int nx, ny;
    uint32_t *heads; /* first place of each cell, plus 1 */
    uint8_t *misses; /* of each cell; MISSES_MAX: given up */
    float *widths;   /* the disc's factor in each cell */
    struct place *places;
    uint32_t count, room; /* a pass may overshoot spec->count before it is thinned */
};

/* cos of an angle in degrees, 0 .. 90, by its series: the same bits everywhere, error below 1e-15. */
static double cosine_deg(double deg)
{
    if (deg >= 90)
        return 0;
    double x = deg * (SV_PI / 180.0), x2 = x * x, sum = 1, term = 1;
    for (int k = 1; k <= 12; k++) {
        term *= -x2 / ((2 * k - 1) * (2 * k));
        sum += term;
    }
    return sum;
}

enum verdict { ALLOWED, OFF_POLYGON, TOO_STEEP };

static enum verdict ground_at(const struct sower *s, double x, double y)
{
    if (s->polygons && !sv_polygons_contain(s->polygons, x, y))
        return OFF_POLYGON;
    if (s->spec->max_slope_deg >= 90)
        return ALLOWED;
    struct sv_vec3 n;
    if (!sv_heightfield_normal(s->field, x, y, &n) || n.z < s->cos_slope)
        return TOO_STEEP;
    return ALLOWED;
}

static bool set_box(struct sower *s)
{
    const struct sv_heightfield *f = s->field;
    s->min[0] = f->x0;
    s->min[1] = f->y0;
    s->max[0] = sv_heightfield_x1(f);
    s->max[1] = sv_heightfield_y1(f);
    double lo[2], hi[2];
    if (s->polygons) {
        if (!sv_polygons_bounds(s->polygons, lo, hi))
            return false;
        for (int a = 0; a < 2; a++) {
            s->min[a] = lo[a] > s->min[a] ? lo[a] : s->min[a];
            s->max[a] = hi[a] < s->max[a] ? hi[a] : s->max[a];
        }
    }
    return s->max[0] > s->min[0] && s->max[1] > s->min[1];
}

/* Share of the box where trees may stand, by one jittered probe in each of PROBES^2 squares; never 0. */
static double allowed_share(const struct sower *s)
{
    struct sv_rng rng = sv_rng_seeded(s->spec->seed, STREAM_DENSITY);
    double wx = (s->max[0] - s->min[0]) / PROBES, wy = (s->max[1] - s->min[1]) / PROBES;
    uint32_t hits = 0;
    for (int j = 0; j < PROBES; j++)
        for (int i = 0; i < PROBES; i++) {
            double x = s->min[0] + wx * (i + sv_rng_unit(&rng)), y = s->min[1] + wy * (j + sv_rng_unit(&rng));
            hits += ground_at(s, x, y) == ALLOWED;
        }
    return (double)(hits ? hits : 1) / (PROBES * PROBES);
}

static enum sv_status make_grid(struct sower *s, struct sv_error *error)
{
    double wx = s->max[0] - s->min[0], wy = s->max[1] - s->min[1], least = s->spec->min_spacing_m;
    double hexagonal =
        sqrt(wx * wy * allowed_share(s) * 1.1547005383792515 / s->spec->count); /* 2 / sqrt 3 */
    s->radius = FIRST_RADIUS * hexagonal > least ? FIRST_RADIUS * hexagonal : least;
    /* Cells as small as the widest disc and the memory allow, dividing the box evenly. */
    double widest = s->radius * (1 + RADIUS_SPREAD), coarsest = sqrt(wx * wy / (CELLS_MAX / 2));
    double side = widest > coarsest ? widest : coarsest;
    s->nx = (int)sv_clamp(floor(wx / side), 1, CELLS_MAX / 8);
    s->ny = (int)sv_clamp(floor(wy / side), 1, CELLS_MAX / 8);
    s->cell_x = wx / s->nx;
    s->cell_y = wy / s->ny;
    size_t cells = (size_t)s->nx * (size_t)s->ny;
    s->heads = calloc(cells, sizeof *s->heads);
    s->misses = calloc(cells, sizeof *s->misses);
    s->widths = malloc(cells * sizeof *s->widths);
    s->room = s->spec->count;
    s->places = malloc((size_t)s->room * sizeof *s->places);
    if (!s->heads || !s->misses || !s->widths || !s->places)
        return sv_fail(error, SV_ENOMEM, "scatter", "no memory to strew %u trees", s->spec->count);
    /* Thick and thin parts some twelve trees wide. */
    uint64_t seed = sv_mix64(s->spec->seed ^ sv_mix64(STREAM_DENSITY));
    double step = 1.0 / 12;
    for (int j = 0; j < s->ny; j++)
        for (int i = 0; i < s->nx; i++) {
            double v = 1.6 * sv_noise_sum(seed, i * step, j * step, 2);
            s->widths[(size_t)j * (size_t)s->nx + (size_t)i] =
                (float)(1 + RADIUS_SPREAD * sv_clamp(v, -1, 1));
        }
    return SV_OK;
}

static bool collides(const struct sower *s, int i, int j, double x, double y, double radius)
{
    int i0 = i > 0 ? i - 1 : 0, i1 = i + 1 < s->nx ? i + 1 : i;
    int j0 = j > 0 ? j - 1 : 0, j1 = j + 1 < s->ny ? j + 1 : j;
    double r2 = radius * radius;
    for (int b = j0; b <= j1; b++)
        for (int a = i0; a <= i1; a++)
            for (uint32_t k = s->heads[(size_t)b * (size_t)s->nx + (size_t)a]; k; k = s->places[k - 1].next) {
                double dx = s->places[k - 1].x - x, dy = s->places[k - 1].y - y;
                if (dx * dx + dy * dy < r2)
                    return true;
            }
    return false;
}

static bool add_place(struct sower *s, size_t cell, double x, double y)
{
    if (s->count == s->room) {
        uint32_t room = s->room + s->room / 2 + 64;
        struct place *places = realloc(s->places, (size_t)room * sizeof *places);
        if (!places)
            return false;
        s->places = places;
        s->room = room;
    }
    s->places[s->count] = (struct place){x, y, s->heads[cell]};
    s->heads[cell] = ++s->count;
    return true;
}

/* Throws the darts of one pass into one cell; false when memory ran out. */
static bool sow_cell(struct sower *s, int pass, int i, int j, double radius, bool packing)
{
    size_t cell = (size_t)j * (size_t)s->nx + (size_t)i;
    if (s->misses[cell] >= MISSES_MAX)
        return true;
    struct sv_rng rng = sv_rng_seeded(s->spec->seed + (uint64_t)pass * UINT64_C(0xD1B54A32D192ED03),
                                      (uint64_t)cell << 8 | STREAM_PLACES);
    double r = radius * (double)s->widths[cell], least = s->spec->min_spacing_m;
    r = packing || r < least ? least : r;
    for (int dart = 0; dart < DARTS && s->misses[cell] < MISSES_MAX; dart++) {
        double x = s->min[0] + (i + sv_rng_unit(&rng)) * s->cell_x;
        double y = s->min[1] + (j + sv_rng_unit(&rng)) * s->cell_y;
        x = x < s->max[0] ? x : s->max[0]; /* rounding */
        y = y < s->max[1] ? y : s->max[1];
        if (collides(s, i, j, x, y, r)) {
            s->report.rejected_spacing += packing;
            s->misses[cell] = (uint8_t)(s->misses[cell] + packing);
            continue;
        }
        enum verdict v = ground_at(s, x, y);
        s->report.rejected_polygon += v == OFF_POLYGON;
        s->report.rejected_slope += v == TOO_STEEP;
        s->misses[cell] = (uint8_t)(v == ALLOWED ? 0 : s->misses[cell] + 1);
        if (v == ALLOWED && !add_place(s, cell, x, y))
            return false;
    }
    return true;
}

/* One pass over all cells, by the four phase groups in an order of its own. */
static bool sow_pass(struct sower *s, int pass, double radius, bool packing)
{
    int turn = (int)(sv_mix64(s->spec->seed + (uint64_t)pass) & 3);
    for (int k = 0; k < 4; k++) {
        int phase = k ^ turn;
        for (int j = phase >> 1; j < s->ny; j += 2)
            for (int i = phase & 1; i < s->nx; i += 2)
                if (!sow_cell(s, pass, i, j, radius, packing))
                    return false;
    }
    return true;
}

/* Keeps `keep` of the places from `first` on, chosen at random (Knuth's selection sampling: the order stays).
 */
static void thin(struct sower *s, uint32_t first, uint32_t keep)
{
    struct sv_rng rng = sv_rng_seeded(s->spec->seed, STREAM_THIN);
    uint32_t left = s->count - first, out = first;
    for (uint32_t k = first; keep > 0; k++, left--)
        if (sv_rng_unit(&rng) * left < keep) {
            s->places[out++] = s->places[k];
            keep--;
        }
    s->count = out;
}

static bool sow(struct sower *s)
{
    uint32_t wanted = s->spec->count;
    double least = s->spec->min_spacing_m, radius = s->radius;
    int pass = 0;
    bool packing = false;
    for (int packed = 0; s->count < wanted && packed < PASSES_PACKING; pass++) {
        uint32_t before = s->count;
        if (!sow_pass(s, pass, radius, packing))
            return false;
        if (s->count > wanted) {
            thin(s, before, wanted - before);
            return true;
        }
        packed += packing;
        if (packing && packed >= 16 && (double)(s->count - before) <= PACKED_SHARE * s->count)
            return true;
        radius *= SHRINK;
        packing = packing || radius * (1 + RADIUS_SPREAD) <= least || pass >= PASSES_SHRINKING;
    }
    return true;
}

/* ---- who stands there ---- */

/* How many trees of each species: shares of n, largest remainders first. */
static void quotas(const double *mix, int species_count, uint32_t n, uint32_t *quota, double *rest)
{
    uint32_t given = 0;
    for (int k = 0; k < species_count; k++) {
        double exact = mix[k] * n, whole = floor(exact);
        quota[k] = whole < n - given ? (uint32_t)whole : n - given;
        rest[k] = mix[k] > 0 ? exact - whole : -1;
        given += quota[k];
    }
    for (; given < n; given++) {
        int best = 0;
        for (int k = 1; k < species_count; k++)
            best = rest[k] > rest[best] ? k : best;
        quota[best]++;
        rest[best] -= 1;
    }
}

/* The key that the `wanted` highest of keys reach, and how many of those equal to it are among them. */
static uint32_t threshold(const uint32_t *keys, uint32_t n, uint32_t wanted, uint32_t *bins, uint32_t *equal)
{
    uint32_t high = 0, key = 0;
    for (int level = 0; level < 2; level++) {
        memset(bins, 0, 65536 * sizeof *bins);
        for (uint32_t k = 0; k < n; k++)
            if (level == 0)
                bins[keys[k] >> 16]++;
            else if (keys[k] >> 16 == high)
                bins[keys[k] & 0xFFFF]++;
        uint32_t bin = 65535;
        while (bins[bin] < wanted)
            wanted -= bins[bin--];
        key = high << 16 | bin;
        high = bin;
    }
    *equal = wanted;
    return key;
}

struct sharing {
    uint32_t *left, *keys, *bins, *quota; /* left: indices of trees without a species */
    double *rest;
};

static uint32_t key_of(double v)
{
    return (uint32_t)sv_clamp((v + 2) * 0x1p30, 0, 4294967295.0);
}

/* Gives species k its quota of the trees left. */
static uint32_t share_one(const struct sower *s, struct sharing *h, int k, uint32_t n, struct sv_tree *out)
{
    uint64_t seed = sv_mix64(s->spec->seed ^ sv_mix64((uint64_t)k << 8 | STREAM_SPECIES));
    double scale = 1.0 / (16 * s->radius > 40 ? 16 * s->radius : 40); /* a stand, m */
    for (uint32_t t = 0; t < n; t++) {
        const struct sv_tree *tree = &out[h->left[t]];
        double smooth = sv_noise_sum(seed, (tree->x - s->min[0]) * scale, (tree->y - s->min[1]) * scale, 2);
        struct sv_rng rng = sv_rng_seeded(seed, h->left[t]);
        h->keys[t] = key_of(smooth + 0.25 * (sv_rng_unit(&rng) + sv_rng_unit(&rng) - 1));
    }
    uint32_t equal, least = threshold(h->keys, n, h->quota[k], h->bins, &equal), kept = 0;
    for (uint32_t t = 0; t < n; t++) {
        bool taken = h->keys[t] > least || (h->keys[t] == least && equal > 0);
        equal -= taken && h->keys[t] == least;
        if (taken)
            out[h->left[t]].species = (uint16_t)k;
        else
            h->left[kept++] = h->left[t];
    }
    return kept;
}

static enum sv_status share_out(const struct sower *s, int species_count, struct sv_tree *out,
                                struct sv_error *error)
{
    uint32_t n = s->count, left = n;
    struct sharing h = {malloc((size_t)n * sizeof *h.left), malloc((size_t)n * sizeof *h.keys),
                        malloc(65536 * sizeof *h.bins), calloc((size_t)species_count, sizeof *h.quota),
                        calloc((size_t)species_count, sizeof *h.rest)};
    enum sv_status status = SV_OK;
    if (!h.left || !h.keys || !h.bins || !h.quota || !h.rest) {
        status = sv_fail(error, SV_ENOMEM, "scatter", "no memory to share out %u trees", n);
    } else {
        quotas(s->spec->mix, species_count, n, h.quota, h.rest);
        for (uint32_t t = 0; t < n; t++)
            h.left[t] = t;
        for (int k = 0; k < species_count; k++)
            if (h.quota[k] > 0)
                left = share_one(s, &h, k, left, out);
    }
    free(h.left);
    free(h.keys);
    free(h.bins);
    free(h.quota);
    free(h.rest);
    return status;
}

/* Height and rotation. Heights: a bell of three draws, half of it common to the place (its soil), bent so
 * that more trees are tall than small, as where a stand has closed its roof. */
static void grow_up(const struct sower *s, uint32_t number, struct sv_tree *t)
{
    const double *range = s->spec->height_m;
    struct sv_rng rng = sv_rng_seeded(s->spec->seed, (uint64_t)number << 8 | STREAM_TREE);
    uint64_t seed = sv_mix64(s->spec->seed ^ sv_mix64(STREAM_SITE));
    double scale = 1.0 / (10 * s->radius > 30 ? 10 * s->radius : 30);
    double site = sv_noise_sum(seed, (t->x - s->min[0]) * scale, (t->y - s->min[1]) * scale, 2);
    double bell = (sv_rng_unit(&rng) + sv_rng_unit(&rng) + sv_rng_unit(&rng)) / 3;
    double b = sv_clamp(0.6 * bell + 0.4 * (0.5 + 0.8 * site), 0, 1);
    b *= 1.35 - 0.35 * b;
    t->height_m = (float)(range[0] + (range[1] - range[0]) * b);
    float turn = (float)(sv_rng_unit(&rng) * (2 * SV_PI));
    t->rotation_rad = turn < (float)(2 * SV_PI) ? turn : 0;
}

static enum sv_status check(const struct sv_scatter_spec *spec, int species_count, struct sv_error *error)
{
    double sum = 0;
    for (int k = 0; k < species_count; k++) {
        if (!(spec->mix[k] >= 0))
            return sv_fail(error, SV_EINVAL, "mix", "a share is below 0");
        sum += spec->mix[k];
    }
    if (!(fabs(sum - 1) < 1e-6))
        return sv_fail(error, SV_EINVAL, "mix", "the shares sum to %g, not to 1", sum);
    if (spec->count > SV_FOREST_TREES_MAX)
        return sv_fail(error, SV_ELIMIT, "count", "%u is more than %d", spec->count, SV_FOREST_TREES_MAX);
    if (!(spec->min_spacing_m >= 0) || !(spec->max_slope_deg >= 0) || !(spec->height_m[0] > 0) ||
        !(spec->height_m[0] <= spec->height_m[1]) || !isfinite(spec->height_m[1]))
        return sv_fail(error, SV_EINVAL, "scatter", "spacing, slope or heights are out of range");
    return SV_OK;
}

static enum sv_status run(struct sower *s, int species_count, struct sv_tree *out, struct sv_error *error)
{
    enum sv_status status = make_grid(s, error);
    if (status != SV_OK)
        return status;
    if (!sow(s))
        return sv_fail(error, SV_ENOMEM, "scatter", "no memory to strew %u trees", s->spec->count);
    for (uint32_t k = 0; k < s->count; k++) {
        struct sv_tree *t = &out[k];
        *t = (struct sv_tree){.x = s->places[k].x, .y = s->places[k].y};
        grow_up(s, k, t);
        if (!sv_heightfield_height(s->field, t->x, t->y, &t->z))
            return sv_fail(error, SV_EINTERNAL, "scatter", "a tree fell off the terrain");
    }
    s->report.placed = s->count;
    return s->count > 0 ? share_out(s, species_count, out, error) : SV_OK;
}

enum sv_status sv_scatter(const struct sv_scatter_spec *spec, int species_count,
                          const struct sv_heightfield *field, const struct sv_polygons *polygons,
                          struct sv_tree *out, struct sv_scatter_report *report, struct sv_error *error)
{
    enum sv_status status = check(spec, species_count, error);
    if (status != SV_OK)
        return status;
    struct sower s = {.spec = spec, .field = field, .polygons = polygons};
    s.cos_slope = cosine_deg(spec->max_slope_deg);
    if (spec->count > 0 && set_box(&s))
        status = run(&s, species_count, out, error);
    free(s.heads);
    free(s.misses);
    free(s.widths);
    free(s.places);
    if (status == SV_OK)
        *report = s.report;
    return status;
}
