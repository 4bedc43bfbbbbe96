/* walk_options.c - the command line of walkthrough.c. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/experiments/walkthrough.h"

static bool read_counts(const char *text, struct setup *setup)
{
    setup->count_count = 0;
    for (char *end; *text; text = *end ? end + 1 : end) {
        unsigned long v = strtoul(text, &end, 10);
        if (end == text || (*end && *end != ',') || v > SV_FOREST_TREES_MAX ||
            setup->count_count == COUNTS_MAX)
            return false;
        setup->counts[setup->count_count++] = (uint32_t)v;
    }
    return setup->count_count > 0;
}

static bool read_forms(const char *text, struct setup *setup)
{
    for (int k = 0; k < FORMS; k++)
        setup->forms[k] = false;
    while (*text) {
        size_t n = strcspn(text, ",");
        int form = 0;
        while (form < FORMS &&
               (strlen(WALK_FORM_NAMES[form]) != n || strncmp(text, WALK_FORM_NAMES[form], n) != 0))
            form++;
        if (form == FORMS)
            return false;
        setup->forms[form] = true;
        text += n + (text[n] == ',');
    }
    return true;
}

static bool read_quality(const char *name, enum sv_quality *quality)
{
#define NAME(value, text) [value] = text,
    static const char *const names[] = {SV_QUALITY_LIST(NAME)};
#undef NAME
    for (int k = 0; k < SV_QUALITY_REFERENCE; k++)
        if (strcmp(name, names[k]) == 0) {
            *quality = (enum sv_quality)k;
            return true;
        }
    return false;
}

static bool option(struct setup *setup, const char *name, const char *value)
{
    if (strcmp(name, "--counts") == 0)
        return read_counts(value, setup);
    else if (strcmp(name, "--frames") == 0)
        return (setup->frames = atoi(value)) > 0 && setup->frames <= FRAMES_MAX;
    else if (strcmp(name, "--size") == 0)
        return sscanf(value, "%dx%d", &setup->width, &setup->height) == 2 &&
               setup->width >= SV_VIEW_SIDE_MIN && setup->height >= SV_VIEW_SIDE_MIN &&
               setup->width <= SV_VIEW_SIDE_MAX && setup->height <= SV_VIEW_SIDE_MAX;
    else if (strcmp(name, "--workers") == 0)
        return (setup->workers = atoi(value)) >= 1 && setup->workers <= WORKERS_MAX;
    else if (strcmp(name, "--truth") == 0)
        setup->truth_stride = atoi(value);
    else if (strcmp(name, "--panel") == 0)
        return (setup->panel = atoi(value)) >= 16;
    else if (strcmp(name, "--refine") == 0)
        return sscanf(value, "%dx%d", &setup->refine_samples, &setup->refine_scale) >= 1 &&
               setup->refine_samples >= 1 && setup->refine_scale >= 1;
    else if (strcmp(name, "--quality") == 0)
        return read_quality(value, &setup->quality);
    else if (strcmp(name, "-o") == 0)
        setup->folder = value;
    else if (strcmp(name, "--path") == 0)
        return (setup->path = walk_path_named(value)) < WALK_PATHS;
    else if (strcmp(name, "--forms") == 0)
        return read_forms(value, setup);
    else
        return false;
    return true;
}

bool walk_options(int argc, char **argv, struct setup *setup)
{
    *setup = (struct setup){.counts = {45000},
                            .count_count = 1,
                            .frames = 60,
                            .width = 512,
                            .height = 512,
                            .workers = 1,
                            .refine_scale = 1,
                            .quality = SV_QUALITY_BALANCED,
                            .forms = {[ON] = true, [OFF] = true}};
    bool well = true;
    for (int k = 1; k < argc && well; k++) {
        if (strcmp(argv[k], "--warm") == 0)
            setup->warm = true;
        else if (strcmp(argv[k], "--still") == 0)
            setup->still = true;
        else if (strcmp(argv[k], "--parts") == 0)
            setup->parts = true;
        else if (strcmp(argv[k], "--apart") == 0)
            setup->apart = true;
        else if (strcmp(argv[k], "--shadows") == 0)
            setup->shadows_alone = true;
        else if ((well = k + 1 < argc && option(setup, argv[k], argv[k + 1])))
            k++;
    }
    if (!well)
        fprintf(
            stderr,
            "usage: walkthrough [--counts N,N,...] [--path flight|walk|jump|turn|survey] [--frames N] "
            "[--forms on,auto,paper,off,raycast,four] [--size WxH] [--truth STRIDE] [--workers 1|2] "
            "[--refine SAMPLES[xSCALE]] [--panel TEXELS] [--quality fast|balanced|high] [--warm] [--still] "
            "[--apart] [--parts] [--shadows] [-o FOLDER]\n");
    return well;
}
