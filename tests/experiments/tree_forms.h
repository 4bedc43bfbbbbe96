/* tree_forms.h - the forms that one tree can be drawn in: a table, for the experiments of paper 2. */
#ifndef SV_TEST_TREE_FORMS_H
#define SV_TEST_TREE_FORMS_H

#include "core/gl/frame.h"
#include "core/tree/draw.h"
#include "tests/experiments/tree_kit.h"

struct tree_forms;

/* Makes all forms of the tree that there are. Needs a current GL context. */
struct tree_forms *tree_forms_create(const struct tree_kit *kit, struct sv_store *store);
void tree_forms_destroy(struct tree_forms *forms);

int tree_forms_count(void);
const char *tree_forms_name(int form);
/* Index of a name; -1. */
int tree_forms_find(const char *name);
/* Builds what the form needs, if that is not there yet: the first drawing does it otherwise. */
void tree_forms_build(struct tree_forms *forms, int form);
/* Bytes of a species in it as it is kept, 0: not said; and ms that building it took, 0: nothing is built. */
size_t tree_forms_bytes(const struct tree_forms *forms, int form);
double tree_forms_build_ms(const struct tree_forms *forms, int form);

/* The tree in a form, one sample a pixel: premultiplied as sv_gl_target_read gives it. Heap. *ms: the least
 * time of `runs` drawings, the clearing of the target and a read of one pixel included. */
struct sv_image tree_forms_draw(struct tree_forms *forms, int form, const struct sv_camera *camera,
                                const struct sv_light *light, int runs, double *ms);

#endif
