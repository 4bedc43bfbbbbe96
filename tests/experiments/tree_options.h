/* tree_options.h - what the command lines of paper 2's experiments have in common. */
#ifndef SV_TEST_TREE_OPTIONS_H
#define SV_TEST_TREE_OPTIONS_H

#include "tests/experiments/tree_kit.h"

enum { TREE_OPTIONS_FORMS_MAX = 16, TREE_OPTIONS_VIEWS_MAX = 16, TREE_OPTIONS_DISTANCES = 5 };

struct tree_options {
    const char *out, *models; /* folder of sheets, NULL: none; folder of models */
    bool trees[TREE_KIT_TREES], forms[TREE_OPTIONS_FORMS_MAX];
    int views, samples, distances;
    struct sv_store *store;
};

/* False, after a line about the usage, for what is not understood. */
bool tree_options_parse(int argc, char **argv, struct tree_options *options);
int tree_options_forms(const struct tree_options *options); /* how many are asked for */

#endif
