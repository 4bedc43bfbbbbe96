/* tree_options.c - see tree_options.h. */
#include "tests/experiments/tree_options.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "tests/experiments/tree_forms.h"

/* Sets chosen[find(name)] for each name of a list with commas; false for a name that is none. */
static bool choose(const char *list, int (*find)(const char *), bool *chosen, int count)
{
    memset(chosen, 0, (size_t)count * sizeof *chosen);
    char name[64];
    for (const char *at = list; *at;) {
        size_t n = strcspn(at, ",");
        snprintf(name, sizeof name, "%.*s", (int)(n < 63 ? n : 63), at);
        int k = find(name);
        if (k < 0) {
            fprintf(stderr, "there is no %s\n", name);
            return false;
        }
        chosen[k] = true;
        at += n + (at[n] == ',');
    }
    return true;
}

static bool parse(int argc, char **argv, struct tree_options *setup)
{
    for (int i = 1; i < argc; i++) {
        const char *key = argv[i], *value = i + 1 < argc ? argv[++i] : NULL;
        struct sv_error error;
        if (!value)
            return false;
        if (strcmp(key, "-o") == 0)
            setup->out = value;
        else if (strcmp(key, "--models") == 0)
            setup->models = value;
        else if (strcmp(key, "--views") == 0)
            setup->views = atoi(value);
        else if (strcmp(key, "--samples") == 0)
            setup->samples = atoi(value);
        else if (strcmp(key, "--distances") == 0)
            setup->distances = atoi(value);
        else if (strcmp(key, "--store") == 0)
            tree_kit_must(sv_store_open(value, (uint64_t)1 << 32, &setup->store, &error), &error);
        else if (strcmp(key, "--trees") == 0 && !choose(value, tree_kit_find, setup->trees, TREE_KIT_TREES))
            return false;
        else if (strcmp(key, "--forms") == 0 &&
                 !choose(value, tree_forms_find, setup->forms, TREE_OPTIONS_FORMS_MAX))
            return false;
        else if (strcmp(key, "--trees") != 0 && strcmp(key, "--forms") != 0)
            return false;
    }
    return setup->views >= 1 && setup->views <= TREE_OPTIONS_VIEWS_MAX && setup->distances >= 1 &&
           setup->distances <= TREE_OPTIONS_DISTANCES &&
           (setup->samples == 1 || setup->samples == 4 || setup->samples == 16 || setup->samples == 64);
}

bool tree_options_parse(int argc, char **argv, struct tree_options *options)
{
    *options = (struct tree_options){
        .models = "../shared/data/models", .views = 4, .samples = 64, .distances = TREE_OPTIONS_DISTANCES};
    memset(options->trees, 1, sizeof options->trees);
    memset(options->forms, 1, sizeof options->forms);
    if (parse(argc, argv, options)) {
        if (options->out)
            mkdir(options->out, 0777); /* may be there */
        return true;
    }
    fprintf(stderr,
            "usage: %s [-o DIR] [--trees NAME,...] [--forms NAME,...] [--views 1..%d] [--distances 1..%d] "
            "[--samples 1|4|16|64] [--store DIR] [--models DIR]\n",
            argv[0], TREE_OPTIONS_VIEWS_MAX, TREE_OPTIONS_DISTANCES);
    return false;
}

int tree_options_forms(const struct tree_options *options)
{
    int count = 0;
    for (int f = 0; f < tree_forms_count(); f++)
        count += options->forms[f];
    return count;
}
