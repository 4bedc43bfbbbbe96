/* cell_panels.c - what building the panels of an eye's chain of cells costs: the forest of table 2, an eye of
 * the flight or the walk. One line a panel: ring, face, trees in the shell and the view, the least processor
 * time of ROUNDS, bytes.
 *
 * cell_panels [--trees N] [--walk] [--eye K] [--rounds N] [--ring D] [--face NAME] [--size TEXELS]
 *             [--save FOLDER] [--against FOLDER]
 *
 * --ring D: of that distance alone, m; --face: east, north, west, south, down or up alone. --save: writes
 * panels into FOLDER; --against: compares with panels that were saved there: texels that differ, the largest
 * and the mean difference of colour codes, the largest of q codes.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "core/view/panels.h"
#include "core/view/resolve.h"
#include "core/view/rings.h"
#include "tests/experiments/forest_kit.h"

struct options {
    uint32_t trees;
    bool walk;
    int eye, rounds, size;
    double ring_m;
    const char *face, *save, *against;
};

static const char *const FACES[] = {"east", "north", "west", "south", "down", "up"};

struct bench {
    struct forest forest;
    struct sv_direct *direct;
    struct sv_panels *panels;
    struct sv_resolved_view view;
    struct sv_view_rings at;
};

static void check(enum sv_status status, const struct sv_error *error)
{
    if (!status)
        return;
    fprintf(stderr, "%s: %s\n", error->field, error->message);
    exit(1);
}

static double now_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

static void bench_open(const struct options *o, struct bench *b)
{
    struct sv_error error = {0};
    forest_open(o->trees, false, &b->forest);
    struct sv_view_request request =
        forest_request(&b->forest, o->walk ? FOREST_WALK : FOREST_OVERVIEW, o->eye);
    if (o->eye == 0) /* as walkthrough has it */
        request.eye.agl = o->walk ? 1.7 : 40;
    request.relief = SV_RELIEF_ON;
    request.relief_resolution = o->size;
    check(sv_view_resolve(b->forest.scene, &request, &b->view, NULL, &error), &error);
    if (!sv_view_rings(&b->view, &b->at))
        check(sv_fail(&error, SV_EINVAL, "relief_distance", "no cells"), &error);
    check(sv_direct_create(b->forest.scene, b->forest.store, &b->direct, &error), &error);
    check(sv_panels_create(b->forest.scene, b->direct, &b->panels, &error), &error);
}

struct difference {
    size_t texels, off;
    int color, q;
    double sum;
};

/* Crowns of both, texel by texel. */
static struct difference compare(const struct sv_panel_layer *a, const struct sv_panel_layer *b)
{
    struct difference d = {0};
    for (int j = 0; j < a->size && a->size == b->size; j++)
        for (int i = 0; i < a->size; i++) {
            const uint8_t *ca = sv_panel_color(a, i, j), *cb = sv_panel_color(b, i, j);
            int q = abs((int)sv_panel_code(a, i, j) - (int)sv_panel_code(b, i, j)), color = 0;
            for (int c = 0; c < 4; c++) {
                color = abs(ca[c] - cb[c]) > color ? abs(ca[c] - cb[c]) : color;
                d.sum += abs(ca[c] - cb[c]);
            }
            d.texels++;
            d.off += q > 0 || color > 0;
            d.color = color > d.color ? color : d.color;
            d.q = q > d.q ? q : d.q;
        }
    return d;
}

static void file_of(const char *folder, const struct sv_panels_order *order, char path[512])
{
    snprintf(path, 512, "%s/%g-%d.panel", folder, order->about.distance_m, (int)order->about.face);
}

static void save(const char *path, const void *block, size_t bytes)
{
    FILE *f = fopen(path, "wb");
    if (!f || fwrite(block, 1, bytes, f) != bytes || fclose(f))
        perror(path);
}

static void tell_difference(const char *path, const void *block, size_t bytes)
{
    struct sv_error error = {0};
    struct sv_panel now, then;
    FILE *f = fopen(path, "rb");
    size_t room = (size_t)64 << 20, got;
    void *kept = aligned_alloc(SV_PANEL_ALIGN, room);
    if (!f || !kept || (got = fread(kept, 1, room, f)) == 0) {
        perror(path);
        exit(1);
    }
    fclose(f);
    check(sv_panel_open(kept, got, &then, &error), &error);
    check(sv_panel_open(block, bytes, &now, &error), &error);
    struct difference d = compare(&now.crowns, &then.crowns);
    printf("   %zu texels differ, colour by %d at most, mean %.5f; q by %d at most", d.off, d.color,
           d.sum / 4 / (double)d.texels, d.q);
    free(kept);
}

static void keep(const struct options *o, const struct bench *b, const struct sv_panels_order *order,
                 size_t bytes)
{
    struct sv_error error = {0};
    char path[512];
    void *block = aligned_alloc(SV_PANEL_ALIGN, bytes);
    if (!block)
        exit(1);
    check(sv_panels_write(b->panels, block, bytes, &error), &error);
    if (o->save) {
        file_of(o->save, order, path);
        save(path, block, bytes);
    }
    if (o->against) {
        file_of(o->against, order, path);
        tell_difference(path, block, bytes);
    }
    free(block);
}

/* Least processor time of a panel; 0 where no tree is seen. */
static double draw(const struct options *o, const struct bench *b, int ring, enum sv_cell_face face)
{
    struct sv_error error = {0};
    struct sv_cell_shell shell = sv_cell_shell(&b->at.rings, &b->at.chain[ring], b->at.top);
    struct sv_panels_order order = {.about = {.place = b->at.chain[ring],
                                              .distance_m = shell.distance_m,
                                              .face = face,
                                              .size = b->view.plan.relief_resolution,
                                              .layers = SV_PANEL_CROWNS},
                                    .shell = shell,
                                    .view = &b->view};
    int size;
    double best = INFINITY;
    size_t bytes = 0;
    check(sv_panels_size(b->panels, &order, &size, &error), &error);
    if (size < order.about.size)
        return 0;
    for (int k = 0; k < o->rounds; k++) {
        double since = now_ms();
        check(sv_panels_draw(b->panels, &order, &bytes, &error), &error);
        best = fmin(best, now_ms() - since);
    }
    printf("D %7.2f %-5s %8.1f ms %6.2f MB", order.about.distance_m, FACES[face], best, (double)bytes * 1e-6);
    keep(o, b, &order, bytes);
    printf("\n");
    fflush(stdout);
    return best;
}

static bool option(struct options *o, const char *name, const char *value)
{
    if (strcmp(name, "--trees") == 0)
        o->trees = (uint32_t)strtoul(value, NULL, 10);
    else if (strcmp(name, "--eye") == 0)
        o->eye = atoi(value);
    else if (strcmp(name, "--rounds") == 0)
        o->rounds = atoi(value);
    else if (strcmp(name, "--size") == 0)
        o->size = atoi(value);
    else if (strcmp(name, "--ring") == 0)
        o->ring_m = atof(value);
    else if (strcmp(name, "--face") == 0)
        o->face = value;
    else if (strcmp(name, "--save") == 0)
        o->save = value;
    else if (strcmp(name, "--against") == 0)
        o->against = value;
    else
        return false;
    return o->rounds > 0;
}

int main(int argc, char **argv)
{
    struct options o = {.trees = 45000, .rounds = 3, .size = 1024};
    struct bench b;
    bool well = true;
    for (int k = 1; k < argc && well; k++)
        if (strcmp(argv[k], "--walk") == 0)
            o.walk = true;
        else if ((well = k + 1 < argc && option(&o, argv[k], argv[k + 1])))
            k++;
    if (!well) {
        fprintf(stderr,
                "usage: cell_panels [--trees N] [--walk] [--eye K] [--rounds N] [--ring D] [--face NAME] "
                "[--size TEXELS] [--save FOLDER] [--against FOLDER]\n");
        return 2;
    }
    bench_open(&o, &b);
    double sum = 0, most = 0;
    for (int ring = b.at.crowns_first; ring < b.at.rings.count; ring++)
        for (int face = 0; face < SV_CELL_FACES; face++)
            if ((!(o.ring_m > 0) || fabs(b.at.rings.distance_m[ring] / o.ring_m - 1) < 0.01) &&
                (!o.face || strcmp(o.face, FACES[face]) == 0)) {
                double ms = draw(&o, &b, ring, (enum sv_cell_face)face);
                sum += ms;
                most = fmax(most, ms);
            }
    printf("%u trees: all %.1f ms, worst %.1f ms\n", o.trees, sum, most);
    sv_panels_destroy(b.panels);
    sv_direct_destroy(b.direct);
    forest_close(&b.forest);
    return 0;
}
