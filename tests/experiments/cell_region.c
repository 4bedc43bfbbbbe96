/* cell_region.c - predicted against measured error of views drawn from cells (core/cell/region.h;
 * algorithms.md 2.6), at growing distances of the eye from the cells' reference points.
 *
 *   cell_region [--data FOLDER] [--demo FILE] [--eyes N] [--seed N] [--size PX] [--panels TEXELS] [-o FOLDER]
 *
 * A view's cells are built with a lattice step of 0.025 to 0.2 of their distance; eyes are random, so that
 * they stand anywhere in their cells. Measured: the mean absolute difference (of 255) from the same view
 * whose cells are built at the eye itself (a step as fine as the lattice bears), and the share of its pixels
 * that were holes in the ground. Predicted: for each panel by sv_region_predict from its own jumps; over a
 * view, each with the share of the picture that its texels in view take. Between crowns of one panel only
 * steps from crown to crown count: what a crown leaves free is not a surface.
 *
 * Two numbers, what a hole and what a pixel's offset count for, are fitted on the forest of forest_kit.h
 * (least squares, then raised until the medians there are the root of 5 apart: half way, by ratio, to the 5
 * times that a prediction may be too high); the demo scene and a DEM under scattered trees (FOLDER:
 * dem/scbi_10m_utm17n.tif) are then predicted with them. Scenes whose files are not there are skipped, and
 * said so. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/base/rng.h"
#include "core/cell/panel.h"
#include "core/cell/panel_ground.h"
#include "core/cell/region.h"
#include "core/view/cells.h"
#include "core/view/rings.h"
#include "tests/experiments/forest_kit.h"

enum { VIEWS_MAX = 512, PANELS_MAX = 256, STRIDE = 4, GREY = 110 };
#define CACHE_BYTES ((size_t)1 << 30)
static const double PITCHES[] = {0.025, 0.05, 0.1, 0.2};
enum { PITCH_COUNT = sizeof PITCHES / sizeof *PITCHES };

struct setup {
    const char *data, *demo, *folder;
    int eyes, size, panels;
    uint64_t seed;
};

/* One view. */
struct row {
    double pitch;
    double holes, shift;    /* predicted: share of the picture; levels of 255 */
    double ground_holes;    /* predicted, of the ground alone */
    double off, holes_seen; /* measured */
    double jumps[3]; /* what opens a unit of offset, in shares of the picture: sideways, up or down, forward or back */
};
struct rows {
    struct row of[VIEWS_MAX];
    int count;
};

/* ---- prediction ---- */

/* q of a crowns panel with its gaps closed along rows (or columns) from the last crown: steps are from crown
 * to crown. */
static void close_gaps(const struct sv_panel_layer *crowns, bool rows, float *q)
{
    int n = crowns->size;
    for (int a = 0; a < n; a++) {
        float last = 0;
        for (int k = 0; k < 2 * n; k++) { /* there and back: what is before the first crown has the first's */
            int b = k < n ? k : 2 * n - 1 - k;
            size_t at = rows ? (size_t)a * (size_t)n + (size_t)b : (size_t)b * (size_t)n + (size_t)a;
            uint16_t code = rows ? sv_panel_code(crowns, b, a) : sv_panel_code(crowns, a, b);
            if (code)
                last = (float)code / SV_PANEL_Q_ONE;
            if (k < n || q[at] == 0)
                q[at] = last;
        }
    }
}

static struct sv_cell_jumps crown_jumps(const struct sv_panel_layer *crowns)
{
    size_t texels = (size_t)crowns->size * (size_t)crowns->size;
    float *q = malloc(texels * sizeof *q);
    struct sv_cell_jumps along, up;
    if (!q)
        abort();
    close_gaps(crowns, true, q);
    sv_cell_jumps_measure(q, crowns->size, 0, &along);
    close_gaps(crowns, false, q);
    sv_cell_jumps_measure(q, crowns->size, 0, &up);
    free(q);
    along.y_plus = up.y_plus;
    along.y_minus = up.y_minus;
    along.yy = up.yy;
    along.texels = 0;
    for (size_t k = 0; k < texels; k++)
        along.texels += sv_panel_code(crowns, (int)k % crowns->size, (int)k / crowns->size) != 0;
    return along;
}

/* What of a panel is seen, counted on every STRIDE-th texel. Each is as large as one that is looked at along
 * the axis, times sec^3 of the angle from the picture's axis over that from the panel's. */
struct seen {
    double share;    /* of the picture, that its texels take */
    double gradient; /* step from texel to texel to the right and down, of 255, times share */
};

/* Index of a texel in the ground's rows that are stored, or -1. */
static ptrdiff_t ground_at(const struct sv_panel_ground *ground, int i, int j)
{
    bool stored = j >= ground->first && j < ground->first + ground->rows;
    return stored ? (ptrdiff_t)(j - ground->first) * ground->size + i : -1;
}

static double q_of(const struct sv_panel *panel, int i, int j)
{
    ptrdiff_t at = panel->ground.size > 0 ? ground_at(&panel->ground, i, j) : -1;
    if (panel->ground.size > 0)
        return at < 0 ? 0 : (double)panel->ground.q[at];
    return (double)sv_panel_code(&panel->crowns, i, j) / SV_PANEL_Q_ONE;
}

/* One channel of a texel, crowns before grey: their edges count, too. */
static double level(const struct sv_panel *panel, int i, int j, int channel)
{
    ptrdiff_t at = panel->ground.size > 0 ? ground_at(&panel->ground, i, j) : -1;
    if (panel->ground.size > 0)
        return at < 0 ? 0 : panel->ground.color[at][channel];
    const uint8_t *color = sv_panel_color(&panel->crowns, i, j);
    return color[channel] + GREY * (1 - color[3] / 255.0);
}

static double gradient_at(const struct sv_panel *panel, int size, int i, int j)
{
    double sum = 0;
    if (i + 1 >= size || j + 1 >= size)
        return 0;
    for (int c = 0; c < 3; c++)
        sum += fabs(level(panel, i, j, c) - level(panel, i + 1, j, c)) +
               fabs(level(panel, i, j, c) - level(panel, i, j + 1, c));
    return sum / 3;
}

/* Whether a point at (x, y) of the picture, depth m along forward, may be seen: it is not behind what the
 * depth picture shows by more than crowns are deep. */
static bool is_seen(const struct sv_image *depths, const struct sv_camera *camera, double x, double y,
                    double depth)
{
    if (!(x >= 0 && y >= 0 && x < camera->width && y < camera->height))
        return false;
    float shown = ((const float *)depths->data)[(size_t)y * (size_t)camera->width + (size_t)x];
    return depth <= (double)shown * 1.02 + 3;
}

static struct seen seen_of(const struct sv_panel *panel, const struct sv_camera *camera,
                           const struct sv_image *depths)
{
    bool ground = panel->ground.size > 0;
    int size = ground ? panel->ground.size : panel->crowns.size;
    double side = 2 * sv_camera_focal_px(camera) / size, all = (double)camera->width * camera->height;
    struct sv_vec3 right, up, forward;
    struct seen seen = {0, 0};
    sv_cell_face_axes(panel->about.face, &right, &up, &forward);
    for (int j = STRIDE / 2; j < size; j += STRIDE)
        for (int i = STRIDE / 2; i < size; i += STRIDE) {
            double q = q_of(panel, i, j);
            if (!(q > 0))
                continue;
            double xs = 2 * (i + 0.5) / size - 1, ys = 1 - 2 * (j + 0.5) / size, x, y, depth;
            struct sv_vec3 d = sv_madd(sv_madd(forward, right, xs), up, ys);
            struct sv_vec3 world = sv_madd(panel->about.place.v, d, panel->about.distance_m / q);
            if (!sv_camera_project(camera, world, &x, &y, &depth) || !is_seen(depths, camera, x, y, depth))
                continue;
            double cosine = sv_dot(sv_normalize(sv_sub(world, camera->eye)), camera->forward);
            double share = STRIDE * STRIDE * side * side * pow(sv_length(d) * cosine, -3) / all;
            seen.share += share;
            seen.gradient += share * gradient_at(panel, size, i, j);
        }
    return seen;
}

static void predict_panel(const struct sv_panel *panel, const struct sv_camera *camera,
                          const struct sv_image *depths, struct row *row)
{
    bool ground = panel->ground.size > 0;
    struct seen seen = seen_of(panel, camera, depths);
    if (seen.share <= 0)
        return;
    struct sv_region_panel p = {
        .face = panel->about.face, .size = ground ? panel->ground.size : panel->crowns.size, .q_most = 1};
    if (ground) {
        float *q = calloc((size_t)p.size * (size_t)p.size, sizeof *q);
        if (!q)
            abort();
        memcpy(q + panel->ground.first * p.size, panel->ground.q,
               (size_t)panel->ground.rows * (size_t)p.size * sizeof *q);
        sv_cell_jumps_measure(q, p.size, SV_PANEL_GROUND_CUT * 2 / (float)p.size, &p.jumps);
        free(q);
    } else {
        p.jumps = crown_jumps(&panel->crowns);
        for (size_t k = 0; k < (size_t)p.size * (size_t)p.size; k++)
            p.q_most = fmax(p.q_most, q_of(panel, (int)k % p.size, (int)k / p.size));
    }
    struct sv_region_view view = {.focal_px = sv_camera_focal_px(camera),
                                  .width = camera->width,
                                  .height = camera->height,
                                  .hole_weight = 1,
                                  .pixel_weight = 1};
    struct sv_vec3 offset = sv_scale(sv_sub(camera->eye, panel->about.place.v), 1 / panel->about.distance_m);
    struct sv_region_error error = sv_region_predict(&p, offset, &view);
    row->holes += seen.share * fmin(error.hole_share, 1);
    const struct sv_cell_jumps *s = &p.jumps;
    const double jumps[3] = {fmax(s->x_plus, s->x_minus), fmax(s->y_plus, s->y_minus), s->xx + s->yy};
    for (int k = 0; k < 3; k++)
        row->jumps[k] += seen.share * 0.5 * p.size * jumps[k] / s->texels;
    row->ground_holes += ground ? seen.share * error.hole_share : 0;
    row->shift += seen.gradient * error.position_px / error.texel_px;
}

/* All panels in the cache: those of the view that was drawn since it was made. */
static void predict(struct sv_cell_cache *cache, const struct sv_camera *camera,
                    const struct sv_image *depths, struct row *row)
{
    static struct sv_cell_cache_item items[PANELS_MAX];
    size_t count = sv_cell_cache_list(cache, 0, items, PANELS_MAX);
    struct sv_error error = {0};
    for (size_t k = 0; k < count && k < PANELS_MAX; k++) {
        struct sv_cell_cache_panel pin;
        struct sv_panel panel;
        if (sv_cell_cache_find(cache, 0, items[k].label.key, 0, 0, &pin) != SV_CELL_CACHE_HIT)
            continue;
        if (sv_panel_open(pin.data, pin.bytes, &panel, &error) == SV_OK)
            predict_panel(&panel, camera, depths, row);
        sv_cell_cache_unpin(cache, 0, &pin);
    }
}

/* ---- measurement ---- */

static void draw(struct forest *forest, const struct sv_view_request *request,
                 const struct sv_resolved_view *view, struct sv_picture *picture)
{
    struct sv_error error = {0};
    struct sv_draw_stats stats = {0};
    if (sv_cell_cache_make(forest->cells.memory, CACHE_BYTES, &SV_CELL_CACHE_OPTIONS_DEFAULT, &forest->cells.cache,
                           &error) ||
        sv_renderer_draw(forest->renderer, request, view, picture, NULL, &stats, &error)) {
        fprintf(stderr, "%s: %s\n", error.field, error.message);
        exit(1);
    }
}

/* How far away what the view shows is, m. */
static struct sv_image depths_of(const struct forest *forest, const struct sv_view_request *request)
{
    struct sv_view_request r = *request;
    struct sv_picture picture;
    r.layers = 1u << SV_LAYER_DEPTH;
    r.relief = SV_RELIEF_OFF;
    forest_draw(forest, &r, &picture, NULL, NULL, NULL);
    return picture.layer[SV_LAYER_DEPTH];
}

/* The finest lattice that coordinates of this size bear. */
static double finest_pitch(struct sv_resolved_view view)
{
    struct sv_view_rings rings;
    for (view.plan.relief_pitch = 1e-4; !sv_view_rings(&view, &rings); view.plan.relief_pitch *= 2)
        if (view.plan.relief_pitch > 0.02)
            break;
    return view.plan.relief_pitch;
}

/* A view of any heading, over the wood or in it. */
static struct sv_view_request random_request(const struct forest *forest, const struct setup *setup,
                                             struct sv_rng *rng, int k)
{
    struct sv_view_request r = forest_request(forest, k % 3 ? FOREST_OVERVIEW : FOREST_WALK, k);
    const struct sv_heightfield *f = &forest->scene->terrain.field;
    r.eye.x = f->x0 + sv_rng_range(rng, 0.25, 0.75) * (f->width - 1) * f->dx;
    r.eye.y = f->y0 + sv_rng_range(rng, 0.25, 0.75) * (f->height - 1) * f->dy;
    r.eye.agl = k % 3 ? sv_rng_range(rng, 15, 60) : 1.7;
    r.heading_rad = sv_rng_range(rng, 0, 2 * SV_PI);
    r.pitch_rad = k % 3 ? sv_radians(sv_rng_range(rng, -30, -5)) : sv_radians(3);
    r.width = r.height = setup->size;
    r.relief = SV_RELIEF_ON;
    r.relief_resolution = setup->panels;
    return r;
}

static void measure(struct forest *forest, const struct setup *setup, struct rows *rows)
{
    struct sv_rng rng = sv_rng_seeded(setup->seed, 5);
    for (int k = 0; k < setup->eyes; k++) {
        struct sv_view_request request = random_request(forest, setup, &rng, k);
        struct sv_resolved_view view;
        struct sv_picture own, moved;
        struct sv_error error = {0};
        if (sv_view_resolve(forest->scene, &request, &view, NULL, &error)) {
            fprintf(stderr, "%s: %s\n", error.field, error.message);
            exit(1);
        }
        struct sv_image depths = depths_of(forest, &request);
        view.plan.relief_pitch = finest_pitch(view);
        draw(forest, &request, &view, &own);
        for (int p = 0; p < PITCH_COUNT && rows->count < VIEWS_MAX; p++) {
            struct row *row = &rows->of[rows->count++];
            *row = (struct row){.pitch = PITCHES[p]};
            view.plan.relief_pitch = PITCHES[p];
            draw(forest, &request, &view, &moved);
            predict(forest->cells.cache, &view.camera, &depths, row);
            row->off = forest_compare(&moved.layer[SV_LAYER_COLOR], &own.layer[SV_LAYER_COLOR]).mean_abs;
            row->holes_seen = (double)sv_renderer_cells_report(forest->renderer)->hole_pixels /
                              ((double)request.width * request.height);
            sv_picture_finish(&moved);
        }
        sv_picture_finish(&own);
        sv_image_free(&depths);
    }
}

/* ---- what came out ---- */

struct weights {
    double hole, pixel;
};

static double total(const struct row *row, const struct weights *w)
{
    return w->hole * row->holes + w->pixel * row->shift;
}

/* Least squares of off = hole holes + pixel shift over the rows, neither negative; then both raised. */
static struct weights fit(const struct rows *rows)
{
    double hh = 0, hp = 0, pp = 0, hy = 0, py = 0;
    static double predicted[VIEWS_MAX], measured[VIEWS_MAX];
    for (int k = 0; k < rows->count; k++) {
        const struct row *r = &rows->of[k];
        hh += r->holes * r->holes;
        hp += r->holes * r->shift;
        pp += r->shift * r->shift;
        hy += r->holes * r->off;
        py += r->shift * r->off;
    }
    double det = hh * pp - hp * hp;
    struct weights w = {(hy * pp - py * hp) / det, (py * hh - hy * hp) / det};
    if (!(w.hole >= 0))
        w = (struct weights){0, py / pp};
    else if (!(w.pixel >= 0))
        w = (struct weights){hy / hh, 0};
    for (int k = 0; k < rows->count; k++) {
        predicted[k] = total(&rows->of[k], &w);
        measured[k] = rows->of[k].off;
    }
    double raise = sqrt(5) * forest_median(measured, rows->count) / forest_median(predicted, rows->count);
    return (struct weights){w.hole * raise, w.pixel * raise};
}

/* Spearman's: the correlation of ranks, equal values sharing theirs. */
static double rank_of(const double *of, int count, int k)
{
    double rank = 0;
    for (int n = 0; n < count; n++)
        rank += (of[n] < of[k]) + 0.5 * (of[n] == of[k]);
    return rank;
}

static double rank_correlation(const double *a, const double *b, int count)
{
    double ab = 0, aa = 0, bb = 0, mean = 0.5 * count;
    for (int k = 0; k < count; k++) {
        double x = rank_of(a, count, k) - mean, y = rank_of(b, count, k) - mean;
        ab += x * y;
        aa += x * x;
        bb += y * y;
    }
    return ab / sqrt(aa * bb);
}

static void tell(const char *what, const double *predicted, const double *measured, int count)
{
    static double p[VIEWS_MAX], m[VIEWS_MAX];
    int above = 0;
    for (int k = 0; k < count; k++)
        above += predicted[k] >= measured[k];
    memcpy(p, predicted, (size_t)count * sizeof *p);
    memcpy(m, measured, (size_t)count * sizeof *m);
    double mp = forest_median(p, count), mm = forest_median(m, count);
    printf("  %-14s %3d views: upper bound in %5.1f %%, medians predicted %.4g, measured %.4g (%.2f times), "
           "rank "
           "correlation %.2f\n",
           what, count, 100.0 * above / count, mp, mm, mp / mm, rank_correlation(predicted, measured, count));
}

/* What the views' panels have in the mean: of what no panel is drawn yet, nothing better is known. */
static void tell_jumps(const struct rows *rows)
{
    double sum[3] = {0};
    for (int k = 0; k < rows->count; k++)
        for (int c = 0; c < 3; c++)
            sum[c] += rows->of[k].jumps[c] / rows->count;
    printf("  an offset of the whole distance opens %.3f of the picture sideways, %.3f up or down, %.3f forward or back\n",
           sum[0], sum[1], sum[2]);
}

static void report(const char *name, const struct rows *rows, const struct weights *w, FILE *csv)
{
    static double predicted[VIEWS_MAX], measured[VIEWS_MAX], holes[VIEWS_MAX], seen[VIEWS_MAX];
    int warped = 0;
    printf("%s\n", name);
    for (int k = 0; k < rows->count; k++) {
        const struct row *r = &rows->of[k];
        predicted[k] = total(r, w);
        measured[k] = r->off;
        fprintf(csv, "%s,%g,%.6f,%.6f,%.6f,%.4f,%.4f,%.6f\n", name, r->pitch, r->holes, r->ground_holes,
                r->shift, predicted[k], r->off, r->holes_seen);
        if (r->ground_holes > 0) {
            holes[warped] = r->ground_holes;
            seen[warped++] = r->holes_seen;
        }
    }
    tell("error", predicted, measured, rows->count);
    for (int p = 0; p < PITCH_COUNT; p++) {
        static double a[VIEWS_MAX], b[VIEWS_MAX];
        char what[32];
        int n = 0;
        for (int k = 0; k < rows->count; k++)
            if (rows->of[k].pitch == PITCHES[p]) {
                a[n] = predicted[k];
                b[n++] = measured[k];
            }
        snprintf(what, sizeof what, "step %g", PITCHES[p]);
        tell(what, a, b, n);
    }
    tell_jumps(rows);
    if (warped > 0)
        tell("ground's holes", holes, seen, warped);
}

static void run(const char *name, struct forest *forest, const struct setup *setup, struct weights *w,
                FILE *csv)
{
    static struct rows rows;
    rows.count = 0;
    measure(forest, setup, &rows);
    forest_close(forest);
    if (!(w->hole + w->pixel > 0)) {
        *w = fit(&rows);
        printf("a hole counts %.3g of 255, a shift %.3g of what colours differ by\n", w->hole, w->pixel);
    }
    report(name, &rows, w, csv);
    fflush(stdout);
}

static const char DEM[] =
    "{\"name\":\"dem\",\"terrain\":{\"dem\":\"%s/dem/scbi_10m_utm17n.tif\"},"
    "\"species\":[{\"name\":\"oak\",\"procedural\":{\"habit\":\"broadleaf\",\"leaves\":9000,\"seed\":2}},"
    "{\"name\":\"pine\",\"procedural\":{\"habit\":\"conifer\",\"leaves\":12000,\"seed\":4}}],"
    "\"forest\":[{\"scatter\":{\"count\":9000,\"seed\":5,\"mix\":{\"oak\":0.6,\"pine\":0.4},"
    "\"height_m\":[5,22],\"min_spacing_m\":3}}]}";

static bool open_dem(const struct setup *setup, struct forest *forest)
{
    char dem[4096], folder[4000], path[] = "/tmp/silvista-region-XXXXXX";
    if (!setup->data || !realpath(setup->data, folder))
        return false;
    snprintf(dem, sizeof dem, "%s/dem/scbi_10m_utm17n.tif", folder);
    int fd = access(dem, R_OK) == 0 ? mkstemp(path) : -1;
    if (fd < 0)
        return false;
    dprintf(fd, DEM, folder);
    close(fd);
    sv_geo_init();
    forest_open_file(path, false, forest);
    unlink(path);
    return true;
}

int main(int argc, char **argv)
{
    struct setup setup = {.seed = 26, .eyes = 24, .size = 256, .panels = 512, .data = getenv("SV_DATA")};
    bool well = true;
    for (int k = 1; k < argc && well; k += 2) {
        const char *value = k + 1 < argc ? argv[k + 1] : "";
        if (strcmp(argv[k], "--data") == 0)
            setup.data = value;
        else if (strcmp(argv[k], "--demo") == 0)
            setup.demo = value;
        else if (strcmp(argv[k], "--eyes") == 0)
            well = (setup.eyes = atoi(value)) > 0 && setup.eyes * PITCH_COUNT <= VIEWS_MAX;
        else if (strcmp(argv[k], "--seed") == 0)
            setup.seed = strtoull(value, NULL, 10);
        else if (strcmp(argv[k], "--size") == 0)
            well = (setup.size = atoi(value)) >= 16 && setup.size <= 2048;
        else if (strcmp(argv[k], "--panels") == 0)
            well = (setup.panels = atoi(value)) >= 64 && setup.panels <= 2048;
        else if (strcmp(argv[k], "-o") == 0)
            setup.folder = value;
        else
            well = false;
    }
    if (!well) {
        fprintf(stderr,
                "usage: cell_region [--data FOLDER] [--demo FILE] [--eyes 1..%d] [--seed N] [--size PX] "
                "[--panels TEXELS] [-o FOLDER]\n",
                VIEWS_MAX / PITCH_COUNT);
        return 2;
    }
    char path[512] = "/dev/null";
    if (setup.folder) {
        mkdir(setup.folder, 0777);
        snprintf(path, sizeof path, "%s/region.csv", setup.folder);
    }
    FILE *csv = fopen(path, "w");
    if (!csv) {
        perror(path);
        return 1;
    }
    fprintf(csv, "scene,step,holes,ground_holes,shift,predicted,measured,holes_measured\n");
    struct weights weights = {0, 0};
    struct forest forest;
    forest_use_cells(CACHE_BYTES);
    forest_open(9000, false, &forest);
    run("fit", &forest, &setup, &weights, csv);
    if (setup.demo) {
        forest_open_file(setup.demo, false, &forest);
        run("demo", &forest, &setup, &weights, csv);
    } else {
        printf("demo: skipped (no --demo FILE)\n");
    }
    if (open_dem(&setup, &forest))
        run("dem", &forest, &setup, &weights, csv);
    else
        printf("dem: skipped (no dem/scbi_10m_utm17n.tif in --data FOLDER)\n");
    fclose(csv);
    return 0;
}
