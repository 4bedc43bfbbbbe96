/* forest_light.c - mean light of forests in pictures, form by form, as a ratio to that of ray casts.
 *
 *   forest_light [--scene FILE] [--counts 5000,20000,45000] [--suns 20,40,60] [--azimuth DEGREES] [--poses N]
 *                [--forms coarse,density,...] [--samples N] [--plain]
 *
 * Overview eyes. Ratios of the mean linear green over the pixels whose middle a ray finds to be a tree: of
 * all, by distance (below 60 m, 60 to 150 m, beyond) and by species. The truth takes 4 rays a pixel unless
 * --samples says otherwise; of one ray edges tell too little. --scene: that scene instead of the papers'
 * forest (its counts are its own). --plain: without shadows, which leaves what is not the trees' light on
 * each other. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/scene/id.h"
#include "tests/experiments/forest_kit.h"

enum { LIST_MAX = 16, BINS = 3, SPECIES_MAX = 16 };
static const double EDGES_M[BINS - 1] = {60, 150};

struct setup {
    double counts[LIST_MAX], suns[LIST_MAX];
    int count_count, sun_count, poses, samples;
    double azimuth_deg;
    enum sv_trees forms[SV_TREES_COUNT];
    int form_count;
    bool shadows;
    const char *scene;
};

struct sums {
    double all[2], bin[BINS][2], species[SPECIES_MAX][2]; /* ours, truth's */
};

static double green(const struct sv_image *image, size_t at)
{
    return (double)sv_linear_from_srgb8[((const uint8_t *)image->data)[at * 4 + 1]];
}

static void add(const struct forest *forest, const uint16_t *species, const struct sv_picture *ours,
                const struct sv_picture *truth, struct sums *sums)
{
    const struct sv_image *color = &truth->layer[SV_LAYER_COLOR];
    const uint32_t *ids = truth->layer[SV_LAYER_ID].data;
    const float *depth = truth->layer[SV_LAYER_DEPTH].data;
    for (size_t at = 0; at < (size_t)color->width * (size_t)color->height; at++) {
        if (ids[at] < SV_ID_TREE_FIRST || ids[at] - SV_ID_TREE_FIRST >= forest->scene->forest.count)
            continue;
        int bin = 0;
        while (bin < BINS - 1 && (double)depth[at] > EDGES_M[bin])
            bin++;
        const double v[2] = {green(&ours->layer[SV_LAYER_COLOR], at), green(color, at)};
        for (int k = 0; k < 2; k++) {
            sums->all[k] += v[k];
            sums->bin[bin][k] += v[k];
            sums->species[species[ids[at] - SV_ID_TREE_FIRST]][k] += v[k];
        }
    }
}

static void print(const struct sums *s)
{
    printf(" %.3f |", s->all[0] / s->all[1]);
    for (int k = 0; k < BINS; k++)
        printf(" %.3f", s->bin[k][0] / s->bin[k][1]);
    printf(" |");
    for (int k = 0; k < SPECIES_MAX; k++)
        if (s->species[k][1] > 0)
            printf(" %.3f", s->species[k][0] / s->species[k][1]);
    printf("\n");
    fflush(stdout);
}

/* One sun over one forest. */
static void measure(const struct forest *forest, const uint16_t *species, const struct setup *setup,
                    double sun)
{
    static struct sums sums[SV_TREES_COUNT];
    memset(sums, 0, sizeof sums);
    for (int pose = 0; pose < setup->poses; pose++) {
        struct sv_view_request r = forest_request(forest, FOREST_OVERVIEW, pose);
        r.shadows = setup->shadows;
        r.has_sun_azimuth = r.has_sun_elevation = true;
        r.sun_azimuth_rad = setup->azimuth_deg * SV_PI / 180;
        r.sun_elevation_rad = sun * SV_PI / 180;
        r.trees = SV_TREES_RAYCAST;
        r.samples = setup->samples;
        r.layers |= 1u << SV_LAYER_DEPTH | 1u << SV_LAYER_ID;
        struct sv_picture truth, ours;
        forest_draw(forest, &r, &truth, NULL, NULL, NULL);
        r.samples = 0;
        r.layers = 1u << SV_LAYER_COLOR;
        for (int f = 0; f < setup->form_count; f++) {
            r.trees = setup->forms[f];
            forest_draw(forest, &r, &ours, NULL, NULL, NULL);
            add(forest, species, &ours, &truth, &sums[f]);
            sv_picture_finish(&ours);
        }
        sv_picture_finish(&truth);
    }
    for (int f = 0; f < setup->form_count; f++) {
        printf("%6u trees, sun %2.0f, %-9s", forest->scene->forest.count, sun,
               sv_trees_name(setup->forms[f]));
        print(&sums[f]);
    }
}

static void run(const struct setup *setup, uint32_t count)
{
    struct forest forest;
    if (setup->scene)
        forest_open_file(setup->scene, true, &forest);
    else
        forest_open(count, true, &forest);
    const struct sv_forest *trees = &forest.scene->forest;
    uint16_t *species = calloc((size_t)trees->count + 1, sizeof *species);
    for (uint32_t k = 0; species && k < trees->count; k++)
        species[trees->trees[k].number] = trees->trees[k].species % SPECIES_MAX;
    for (int k = 0; species && k < setup->sun_count; k++)
        measure(&forest, species, setup, setup->suns[k]);
    free(species);
    forest_close(&forest);
}

static int read_list(const char *text, double *out)
{
    int n = 0;
    for (char *end; *text && n < LIST_MAX; text = *end ? end + 1 : end) {
        out[n++] = strtod(text, &end);
        if (end == text || (*end && *end != ','))
            return 0;
    }
    return n;
}

static int read_forms(const char *text, enum sv_trees *out)
{
    int n = 0;
    while (*text && n < SV_TREES_COUNT) {
        size_t length = strcspn(text, ",");
        int form = 0;
        while (form < SV_TREES_COUNT && (strlen(sv_trees_name((enum sv_trees)form)) != length ||
                                         strncmp(sv_trees_name((enum sv_trees)form), text, length) != 0))
            form++;
        if (form == SV_TREES_COUNT)
            return 0;
        out[n++] = (enum sv_trees)form;
        text += length + (text[length] == ',');
    }
    return n;
}

static bool read_option(const char *name, const char *value, struct setup *s)
{
    if (strcmp(name, "--counts") == 0)
        return (s->count_count = read_list(value, s->counts)) > 0;
    if (strcmp(name, "--suns") == 0)
        return (s->sun_count = read_list(value, s->suns)) > 0;
    if (strcmp(name, "--forms") == 0)
        return (s->form_count = read_forms(value, s->forms)) > 0;
    if (strcmp(name, "--poses") == 0)
        return (s->poses = atoi(value)) > 0;
    if (strcmp(name, "--samples") == 0)
        return (s->samples = atoi(value)) > 0;
    if (strcmp(name, "--azimuth") == 0)
        return isfinite(s->azimuth_deg = strtod(value, NULL));
    if (strcmp(name, "--scene") == 0)
        return (s->scene = value)[0] != 0;
    return false;
}

int main(int argc, char **argv)
{
    struct setup setup = {.counts = {5000, 20000, 45000},
                          .suns = {20, 40, 60},
                          .count_count = 3,
                          .sun_count = 3,
                          .poses = 2,
                          .samples = 4,
                          .azimuth_deg = 135,
                          .forms = {SV_TREES_COARSE},
                          .form_count = 1,
                          .shadows = true};
    for (int k = 1; k < argc; k++) {
        if (strcmp(argv[k], "--plain") == 0)
            setup.shadows = false;
        else if (k + 1 >= argc || !read_option(argv[k], argv[k + 1], &setup)) {
            fprintf(stderr, "forest_light: %s: see the head of forest_light.c\n", argv[k]);
            return 2;
        } else
            k++;
    }
    for (int k = 0; k < (setup.scene ? 1 : setup.count_count); k++)
        run(&setup, (uint32_t)setup.counts[k]);
    return 0;
}
