/* forest_motion.c - does a tree pop when the eye moves? A walk and a flight through a scene, frame by frame:
 * how much each tile of the picture changes from one frame to the next, beside how much the ray-cast truth
 * changes there between the same two frames.
 *
 *   forest_motion [--scene FILE] [--trees N] [--frames N] [--size PX] [--form auto] [--rate HZ] [--stride N]
 *                 [--worst N] [--path walk|flight|both] [-o FOLDER]
 *
 * FILE: a scene file; without one the forest of forest_kit.h of N trees. Of every tile of TILE x TILE pixels
 * and every pair of frames: `change`, the mean absolute difference of 8-bit values, and `tone`, the signed
 * mean of the difference. A tile pops when its change is larger than the truth's own by more than what 4
 * samples a pixel (leaves have as many) and other sample positions make of a still picture, and ALLOWED; or
 * when its tone moves beyond the truth's, or the other way, by more than ALLOWED. What passes by with a fault
 * that stays with it (a crown that is paler) changes otherwise than the truth without a pop, and in
 * proportion to the motion: so ALLOWED is LEVELS, and SHARE of the truth's own change. The truth (16 samples)
 * is cast for every stride-th pair, and for those where the picture's own history shows the largest jumps:
 * `worst` each by largest change, by change over that of the frames before and after, and by tone over
 * theirs; and for those where a tree passes from one form into the other.
 *
 * Trees pop by their forms, and forms are drawn alike without shadows. So a pair that pops is drawn and cast
 * again with shadows off: where no tile is over the same allowance then, it was the shadows' resolution on
 * the ground (soft texels beside leaves' sharp outlines), which is told with its own figures and counted
 * apart.
 *
 * FOLDER: motion.csv (every pair), PATH-frames.png (every 10th frame), PATH-worst.png (a row a pair, worst
 * first: ours, ours a frame later, their difference times 4; the same of the truth), and the worst pair's
 * pictures as they are. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "core/base/rng.h"
#include "core/tree/draw.h"
#include "tests/experiments/forest_kit.h"
#include "tests/experiments/motion_sheet.h"

enum { TILE = 32, FRAMES_MAX = 1000, TRUTH_SAMPLES = 16, FLOOR_SAMPLES = 4, SHEET_PAIRS = 8 };
static const double BALANCED_ERROR_PX = 1.5; /* of core/view/resolve.c */
/* Levels of 255; share of the truth's change in the tile. */
static const double ALLOWED_LEVELS = 4, ALLOWED_SHARE = 0.25;

enum path { WALK, FLIGHT, PATHS };
static const struct {
    const char *name;
    double speed_m_s, agl_m, pitch_deg, clear_m;
} paths[PATHS] = {[WALK] = {"walk", 1.4, 1.7, 3, 1.5}, [FLIGHT] = {"flight", 15, 40, -12, 0}};

struct options {
    const char *scene, *folder;
    uint32_t trees;
    int frames, size, stride, worst;
    double rate_hz;
    enum sv_trees form;
    bool wanted[PATHS];
};

/* Of one tile between two frames. */
struct step {
    float change, tone[3];
};

/* What the truth says of a pair. */
struct verdict {
    bool cast;
    double truth_mean, truth_max, floor_mean; /* of change, over tiles */
    double excess, tone; /* over the tiles the largest of change less truth and floor, and of tone beyond
                            the truth's, each less SHARE of the truth's change */
    int excess_tile, tone_tile;
    bool pops;                       /* in either way */
    bool shadow;                     /* by the shadows' resolution: without shadows it does not */
    double plain_excess, plain_tone; /* of a pair that pops: without shadows */
};

struct run {
    const struct options *options;
    const struct forest *forest;
    enum path path;
    struct sv_view_request start;
    struct sv_image *pictures; /* a frame each */
    struct sv_draw_stats *stats;
    int across, tiles;
    struct step *steps; /* [pair][tile] */
    struct verdict *verdicts;
};

static void *must(void *memory)
{
    if (memory)
        return memory;
    fprintf(stderr, "forest_motion: no memory\n");
    exit(1);
}

/* ---- where the eye goes ---- */

static struct sv_view_request frame_request(const struct run *run, int frame)
{
    struct sv_view_request r = run->start;
    double way = paths[run->path].speed_m_s * frame / run->options->rate_hz;
    r.eye.x += way * sin(r.heading_rad);
    r.eye.y += way * cos(r.heading_rad);
    return r;
}

static bool is_way_free(const struct run *run)
{
    for (int k = 0; k < run->options->frames; k++) {
        struct sv_view_request r = frame_request(run, k);
        if (!forest_is_free(run->forest, r.eye.x, r.eye.y, paths[run->path].clear_m))
            return false;
    }
    return true;
}

/* A straight way; where the scene has objects the middle of it lies beside the first one, at the side of the
 * picture. The first seed whose way meets no stem. */
static void choose_way(struct run *run)
{
    const struct sv_scene *scene = run->forest->scene;
    double length = paths[run->path].speed_m_s * run->options->frames / run->options->rate_hz;
    double beside = run->path == WALK ? 9 : 25;
    for (int seed = 0; seed < 10000; seed++) {
        struct sv_rng rng = sv_rng_seeded(1414, (uint64_t)seed);
        run->start = forest_request(run->forest, FOREST_OVERVIEW, seed);
        run->start.heading_rad = sv_rng_range(&rng, 0, 2 * SV_PI);
        run->start.pitch_rad = sv_radians(paths[run->path].pitch_deg);
        run->start.eye.agl = paths[run->path].agl_m;
        run->start.width = run->start.height = run->options->size;
        run->start.trees = run->options->form;
        double s = sin(run->start.heading_rad), c = cos(run->start.heading_rad);
        if (scene->object_count > 0) {
            run->start.eye.x = scene->objects[0].x - 0.6 * length * s + beside * c;
            run->start.eye.y = scene->objects[0].y - 0.6 * length * c - beside * s;
        }
        if (paths[run->path].clear_m == 0 || is_way_free(run))
            return;
    }
    fprintf(stderr, "forest_motion: no way of %g m is free of trees\n", length);
    exit(1);
}

/* ---- pictures and their changes ---- */

static void draw_frames(struct run *run)
{
    int frames = run->options->frames;
    run->pictures = must(calloc((size_t)frames, sizeof *run->pictures));
    run->stats = must(calloc((size_t)frames, sizeof *run->stats));
    double since = forest_now_ms();
    for (int k = 0; k < frames; k++) {
        struct sv_view_request r = frame_request(run, k);
        struct sv_picture picture;
        forest_draw(run->forest, &r, &picture, &run->stats[k], NULL, NULL);
        run->pictures[k] = picture.layer[SV_LAYER_COLOR];
    }
    printf("%s: eye %.1f %.1f heading %.1f deg, %d frames, %.1f ms each\n", paths[run->path].name,
           run->start.eye.x, run->start.eye.y, sv_degrees(run->start.heading_rad), frames,
           (forest_now_ms() - since) / frames);
}

static struct step step_of(const struct sv_image *a, const struct sv_image *b, int across, int tile)
{
    int x0 = tile % across * TILE, y0 = tile / across * TILE, count = 0;
    int64_t change = 0, tone[3] = {0};
    for (int y = y0; y < y0 + TILE && y < a->height; y++)
        for (int x = x0; x < x0 + TILE && x < a->width; x++, count++)
            for (size_t c = 0; c < 3; c++) {
                size_t at = 4 * ((size_t)y * (size_t)a->width + (size_t)x) + c;
                int d = ((const uint8_t *)b->data)[at] - ((const uint8_t *)a->data)[at];
                change += abs(d);
                tone[c] += d;
            }
    struct step s = {(float)((double)change / (3 * count)), {0}};
    for (int c = 0; c < 3; c++)
        s.tone[c] = (float)((double)tone[c] / count);
    return s;
}

/* Mean over channels of how far the tones of two steps differ. */
static double tone_between(const struct step *a, const struct step *b)
{
    double sum = 0;
    for (int c = 0; c < 3; c++)
        sum += fabs((double)a->tone[c] - (double)b->tone[c]);
    return sum / 3;
}

/* Mean over channels of how far our tone moves beyond the truth's, or the other way: what moves less, shadows
 * that are softer for one, does not pop. */
static double tone_beyond(const struct step *ours, const struct step *truth)
{
    double sum = 0;
    for (int c = 0; c < 3; c++) {
        double o = (double)ours->tone[c], t = (double)truth->tone[c];
        sum += fabs(o - fmin(fmax(o, fmin(t, 0)), fmax(t, 0)));
    }
    return sum / 3;
}

static const struct step *steps_of(const struct run *run, int pair)
{
    return run->steps + (size_t)pair * (size_t)run->tiles;
}

static void measure_steps(struct run *run)
{
    int pairs = run->options->frames - 1;
    run->across = (run->options->size + TILE - 1) / TILE;
    run->tiles = run->across * run->across;
    run->steps = must(calloc((size_t)pairs * (size_t)run->tiles, sizeof *run->steps));
    run->verdicts = must(calloc((size_t)pairs, sizeof *run->verdicts));
    for (int p = 0; p < pairs; p++)
        for (int t = 0; t < run->tiles; t++)
            run->steps[(size_t)p * (size_t)run->tiles + (size_t)t] =
                step_of(&run->pictures[p], &run->pictures[p + 1], run->across, t);
}

/* How large a pair's largest jump is, by one of three measures; pairs at the ends have one neighbour. */
enum measure { CHANGE, SPIKE, TONE, MEASURES };

static double jump_of(const struct run *run, int pair, enum measure measure, int *tile)
{
    int last = run->options->frames - 2, before = pair > 0 ? pair - 1 : pair + 1;
    int after = pair < last ? pair + 1 : pair - 1;
    double most = -1;
    before = last == 0 ? 0 : before;
    after = last == 0 ? 0 : after;
    for (int t = 0; t < run->tiles; t++) {
        const struct step *s = &steps_of(run, pair)[t], *a = &steps_of(run, before)[t],
                          *b = &steps_of(run, after)[t];
        double jump = (double)s->change;
        if (measure == SPIKE)
            jump -= fmax((double)a->change, (double)b->change);
        if (measure == TONE)
            jump = fmin(tone_between(s, a), tone_between(s, b));
        if (jump > most) {
            most = jump;
            *tile = t;
        }
    }
    return most;
}

/* ---- against the truth ---- */

/* What the truth says of a pair whose steps are given; shadows: as the scene has them, or off. */
static struct verdict compare_pair(const struct run *run, int pair, bool shadows, const struct step *steps)
{
    struct verdict v = {.cast = true, .excess = -1e9, .tone = -1e9};
    struct sv_image truth[2], few;
    struct sv_view_request r;
    for (int k = 1; k >= 0; k--) { /* r is the first frame's in the end */
        r = frame_request(run, pair + k);
        r.shadows = r.shadows && shadows;
        forest_truth_of(run->forest, &r, TRUTH_SAMPLES, &truth[k]);
    }
    forest_truth_of(run->forest, &r, FLOOR_SAMPLES, &few);
    for (int t = 0; t < run->tiles; t++) {
        struct step s = step_of(&truth[0], &truth[1], run->across, t);
        struct step floor = step_of(&truth[0], &few, run->across, t);
        const struct step *ours = &steps[t];
        double moved = ALLOWED_SHARE * (double)s.change, tone = tone_beyond(ours, &s) - moved;
        double excess = (double)(ours->change - s.change - floor.change) - moved;
        v.truth_mean += (double)s.change / run->tiles;
        v.truth_max = fmax(v.truth_max, (double)s.change);
        v.floor_mean += (double)floor.change / run->tiles;
        if (excess > v.excess) {
            v.excess = excess;
            v.excess_tile = t;
        }
        if (tone > v.tone) {
            v.tone = tone;
            v.tone_tile = t;
        }
    }
    v.pops = fmax(v.excess, v.tone) > ALLOWED_LEVELS;
    sv_image_free(&truth[0]);
    sv_image_free(&truth[1]);
    sv_image_free(&few);
    return v;
}

/* The pair drawn and cast again without shadows. */
static struct verdict compare_plain(const struct run *run, int pair)
{
    struct sv_image pictures[2];
    struct step *steps = must(calloc((size_t)run->tiles, sizeof *steps));
    for (int k = 0; k < 2; k++) {
        struct sv_view_request r = frame_request(run, pair + k);
        struct sv_picture picture;
        r.shadows = false;
        forest_draw(run->forest, &r, &picture, NULL, NULL, NULL);
        pictures[k] = picture.layer[SV_LAYER_COLOR];
    }
    for (int t = 0; t < run->tiles; t++)
        steps[t] = step_of(&pictures[0], &pictures[1], run->across, t);
    struct verdict v = compare_pair(run, pair, false, steps);
    sv_image_free(&pictures[0]);
    sv_image_free(&pictures[1]);
    free(steps);
    return v;
}

static void judge(struct run *run, int pair)
{
    struct verdict *v = &run->verdicts[pair];
    if (v->cast)
        return;
    *v = compare_pair(run, pair, true, steps_of(run, pair));
    if (!v->pops || !run->start.shadows)
        return;
    struct verdict plain = compare_plain(run, pair);
    v->shadow = !plain.pops;
    v->plain_excess = plain.excess;
    v->plain_tone = plain.tone;
}

/* The pairs whose jumps by a measure are largest. */
static void judge_worst(struct run *run, enum measure measure)
{
    int pairs = run->options->frames - 1, tile;
    bool *done = must(calloc((size_t)pairs, sizeof *done));
    for (int k = 0; k < run->options->worst && k < pairs; k++) {
        int worst = -1;
        double most = -1e9;
        for (int p = 0; p < pairs; p++) {
            double jump = done[p] ? -1e9 : jump_of(run, p, measure, &tile);
            if (jump > most) {
                most = jump;
                worst = p;
            }
        }
        done[worst] = true;
        judge(run, worst);
    }
    free(done);
}

/* Pairs between which a tree begins or ends to be drawn leaf by leaf, `worst` times MEASURES of them, evenly.
 */
static void judge_forms(struct run *run)
{
    int found[FRAMES_MAX], count = 0, most = run->options->worst * MEASURES;
    for (int p = 0; p < run->options->frames - 1; p++)
        if (run->stats[p].near_trees != run->stats[p + 1].near_trees)
            found[count++] = p;
    for (int k = 0; k < count && k < most; k++)
        judge(run, found[count <= most ? k : k * count / most]);
}

static double badness(const struct verdict *v)
{
    return v->cast ? fmax(v->excess, v->tone) : -1e9;
}

/* ---- what is written ---- */

static void place_of(const struct run *run, int tile, int *x, int *y)
{
    *x = tile % run->across * TILE + TILE / 2;
    *y = tile / run->across * TILE + TILE / 2;
}

static void write_rows(const struct run *run, FILE *csv)
{
    for (int p = 0; p < run->options->frames - 1; p++) {
        const struct verdict *v = &run->verdicts[p];
        int tile = 0, x, y;
        double mean = 0;
        for (int t = 0; t < run->tiles; t++)
            mean += (double)steps_of(run, p)[t].change / run->tiles;
        fprintf(csv, "%s,%d,%u,%u,%.3f", paths[run->path].name, p, run->stats[p].near_trees,
                run->stats[p].far_trees, mean);
        for (int m = 0; m < MEASURES; m++) {
            double jump = jump_of(run, p, (enum measure)m, &tile);
            place_of(run, tile, &x, &y);
            fprintf(csv, ",%.3f,%d,%d", jump, x, y);
        }
        if (v->cast) {
            place_of(run, v->excess_tile, &x, &y);
            fprintf(csv, ",%.3f,%.3f,%.3f,%.3f,%d,%d", v->truth_mean, v->truth_max, v->floor_mean, v->excess,
                    x, y);
            place_of(run, v->tone_tile, &x, &y);
            fprintf(csv, ",%.3f,%d,%d,%d,%d\n", v->tone, x, y, v->pops, v->shadow);
        } else {
            fprintf(csv, ",,,,,,,,,,,\n");
        }
    }
}

static void save_sheet(const struct run *run, const char *what, struct motion_sheet *sheet)
{
    char path[512];
    snprintf(path, sizeof path, "%s/%s-%s.png", run->options->folder, paths[run->path].name, what);
    forest_save(&sheet->image, path);
    motion_sheet_finish(sheet);
}

static void write_frames(const struct run *run)
{
    struct motion_sheet sheet;
    int count = (run->options->frames + 9) / 10, columns = count < 5 ? count : 5, cell = 192;
    motion_sheet_init(&sheet, columns, (count + columns - 1) / columns, cell, cell);
    for (int k = 0; k < run->options->frames; k += 10)
        motion_sheet_add(&sheet, &run->pictures[k]);
    save_sheet(run, "frames", &sheet);
}

static void save_picture(const struct run *run, const char *what, int frame, const struct sv_image *image)
{
    char path[512];
    snprintf(path, sizeof path, "%s/%s-%s-%d.png", run->options->folder, paths[run->path].name, what, frame);
    forest_save(image, path);
}

static void write_pair(const struct run *run, int pair, struct motion_sheet *sheet)
{
    const struct verdict *v = &run->verdicts[pair];
    struct sv_image truth[2];
    int x, y;
    bool by_tone = v->tone > v->excess;
    place_of(run, by_tone ? v->tone_tile : v->excess_tile, &x, &y);
    printf("  pair %d at %d %d: change over the truth's %.2f, tone beyond %.2f", pair, x, y, v->excess,
           v->tone);
    if (v->pops)
        printf(": %s; without shadows %.2f, %.2f", v->shadow ? "SHADOW" : "POPS", v->plain_excess,
               v->plain_tone);
    printf("\n");
    if (!run->options->folder)
        return;
    for (int k = 0; k < 2; k++) {
        struct sv_view_request r = frame_request(run, pair + k);
        forest_truth_of(run->forest, &r, TRUTH_SAMPLES, &truth[k]);
    }
    const struct sv_image *rows[2] = {&run->pictures[pair], truth};
    for (int k = 0; k < 2 && sheet->used == 0; k++) {
        save_picture(run, "ours", pair + k, &run->pictures[pair + k]);
        save_picture(run, "truth", pair + k, &truth[k]);
    }
    for (int k = 0; k < 2; k++) {
        motion_sheet_add_part(sheet, &rows[k][0], x, y, 2);
        motion_sheet_add_part(sheet, &rows[k][1], x, y, 2);
        motion_sheet_add_change(sheet, &rows[k][0], &rows[k][1], x, y, 2, 4);
    }
    sv_image_free(&truth[0]);
    sv_image_free(&truth[1]);
}

static void write_worst(struct run *run)
{
    struct motion_sheet sheet;
    int pairs = run->options->frames - 1, judged = 0;
    bool *done = must(calloc((size_t)pairs, sizeof *done));
    for (int p = 0; p < pairs; p++)
        judged += run->verdicts[p].cast;
    int rows = judged < SHEET_PAIRS ? judged : SHEET_PAIRS;
    motion_sheet_init(&sheet, 6, rows, 192, 192);
    for (int k = 0; k < rows; k++) {
        int worst = -1;
        for (int p = 0; p < pairs; p++)
            if (!done[p] && run->verdicts[p].cast &&
                (worst < 0 || badness(&run->verdicts[p]) > badness(&run->verdicts[worst])))
                worst = p;
        done[worst] = true;
        write_pair(run, worst, &sheet);
    }
    if (run->options->folder)
        save_sheet(run, "worst", &sheet);
    else
        motion_sheet_finish(&sheet);
    free(done);
}

static void summarize(const struct run *run)
{
    int judged = 0, pops = 0, shadows = 0;
    double excess = -1e9, tone = -1e9, truth = 0, ours = 0, floor = 0;
    for (int p = 0; p < run->options->frames - 1; p++) {
        const struct verdict *v = &run->verdicts[p];
        if (!v->cast)
            continue;
        judged++;
        pops += v->pops && !v->shadow;
        shadows += v->shadow;
        excess = fmax(excess, v->excess);
        tone = fmax(tone, v->tone);
        truth += v->truth_mean;
        floor += v->floor_mean;
        for (int t = 0; t < run->tiles; t++)
            ours += (double)steps_of(run, p)[t].change / run->tiles;
    }
    printf("%s %s: %d pairs against the truth: mean change %.2f (truth %.2f, floor %.2f); most over truth "
           "and floor "
           "%.2f, tone beyond %.2f, of %.0f allowed; %d pop, %d more by the shadows' resolution\n",
           paths[run->path].name, sv_trees_name(run->options->form), judged, ours / judged, truth / judged,
           floor / judged, excess, tone, ALLOWED_LEVELS, pops, shadows);
}

static void run_path(const struct options *options, const struct forest *forest, enum path path, FILE *csv)
{
    struct run run = {.options = options, .forest = forest, .path = path};
    choose_way(&run);
    draw_frames(&run);
    measure_steps(&run);
    for (int p = 0; options->stride > 0 && p < options->frames - 1; p += options->stride)
        judge(&run, p);
    for (int m = 0; m < MEASURES; m++)
        judge_worst(&run, (enum measure)m);
    judge_forms(&run);
    if (options->folder) {
        write_rows(&run, csv);
        write_frames(&run);
    }
    write_worst(&run);
    summarize(&run);
    for (int k = 0; k < options->frames; k++)
        sv_image_free(&run.pictures[k]);
    free(run.pictures);
    free(run.stats);
    free(run.steps);
    free(run.verdicts);
}

/* ---- options ---- */

static bool form_named(const char *name, enum sv_trees *form)
{
    for (int k = 0; k < SV_TREES_COUNT; k++)
        if (strcmp(name, sv_trees_name((enum sv_trees)k)) == 0) {
            *form = (enum sv_trees)k;
            return true;
        }
    return false;
}

static bool want_path(const char *name, struct options *o)
{
    bool found = false;
    for (int k = 0; k < PATHS; k++) {
        o->wanted[k] = strcmp(name, paths[k].name) == 0 || strcmp(name, "both") == 0;
        found |= o->wanted[k];
    }
    return found;
}

static bool take(const char *key, const char *value, struct options *o)
{
    const struct {
        const char *key;
        int *value;
    } numbers[] = {
        {"--frames", &o->frames}, {"--size", &o->size}, {"--stride", &o->stride}, {"--worst", &o->worst}};
    for (size_t k = 0; k < sizeof numbers / sizeof *numbers; k++)
        if (strcmp(key, numbers[k].key) == 0) {
            *numbers[k].value = atoi(value);
            return true;
        }
    if (strcmp(key, "--scene") == 0)
        o->scene = value;
    else if (strcmp(key, "-o") == 0)
        o->folder = value;
    else if (strcmp(key, "--trees") == 0)
        o->trees = (uint32_t)strtoul(value, NULL, 10);
    else if (strcmp(key, "--rate") == 0)
        o->rate_hz = atof(value);
    else
        return strcmp(key, "--form") == 0 ? form_named(value, &o->form)
                                          : strcmp(key, "--path") == 0 && want_path(value, o);
    return true;
}

int main(int argc, char **argv)
{
    struct options o = {.trees = 20000,
                        .frames = 200,
                        .size = 384,
                        .stride = 20,
                        .worst = 3,
                        .rate_hz = 10,
                        .form = SV_TREES_AUTO,
                        .wanted = {true, true}};
    bool good = argc % 2 == 1;
    for (int k = 1; k + 1 < argc; k += 2)
        good &= take(argv[k], argv[k + 1], &o);
    if (!good || o.frames < 2 || o.frames > FRAMES_MAX || o.size < SV_VIEW_SIDE_MIN ||
        o.size > SV_VIEW_SIDE_MAX || o.stride < 0 || o.worst < 1 || !(o.rate_hz > 0)) {
        fprintf(stderr,
                "usage: forest_motion [--scene FILE] [--trees N] [--frames 2..%d] [--size PX] [--form auto]\n"
                "  [--rate HZ] [--stride N] [--worst N] [--path walk|flight|both] [-o FOLDER]\n",
                FRAMES_MAX);
        return 2;
    }
    FILE *csv = NULL;
    if (o.folder) {
        char path[512];
        mkdir(o.folder, 0777);
        snprintf(path, sizeof path, "%s/motion.csv", o.folder);
        csv = fopen(path, "w");
        if (!csv) {
            perror(path);
            return 1;
        }
        fprintf(csv,
                "path,pair,near_trees,far_trees,change_mean,change_max,x,y,spike_max,x,y,tone_jump_max,x,y,"
                "truth_mean,truth_max,floor_mean,excess_max,x,y,tone_beyond_max,x,y,pops,shadow\n");
    }
    struct forest forest;
    if (o.scene)
        forest_open_file(o.scene, false, &forest);
    else
        forest_open(o.trees, false, &forest);
    for (int k = 0; k < forest.scene->species_count; k++)
        printf("%s: leaves from %.0f px on\n", forest.scene->spec.species[k].name,
               sv_tree_draw_near_px(sv_renderer_trees(forest.renderer), k, BALANCED_ERROR_PX));
    for (int k = 0; k < PATHS; k++)
        if (o.wanted[k])
            run_path(&o, &forest, (enum path)k, csv);
    forest_close(&forest);
    return csv && fclose(csv) ? 1 : 0;
}
