/* object_kit.h - procedural bodies for tests and experiments on relief objects: closed meshes in model space
 * (base at z = 0, height 1), made in code, the same on every machine but for libm's last bits. */
#ifndef SV_TESTS_OBJECT_KIT_H
#define SV_TESTS_OBJECT_KIT_H

#include "core/tree/mesh.h"

enum object_kit_body {
    OBJECT_KIT_SPHERE,
    OBJECT_KIT_BOX,       /* 0.8 x 0.6 x 1 */
    OBJECT_KIT_TORUS,     /* standing upright: one looks through it */
    OBJECT_KIT_COURTYARD, /* four walls around a floor, with a gate: concave, seen into from above */
    OBJECT_KIT_KNOT,      /* a carved trefoil knot of stone on a moulded pedestal */
    OBJECT_KIT_URN,       /* a fluted stone urn with lid and foot: figure 6 */
    OBJECT_KIT_COUNT
};

extern const char *const object_kit_names[OBJECT_KIT_COUNT];

/* Heap mesh (sv_tree_mesh_finish). Ends the program when memory is short. */
struct sv_tree_mesh object_kit_make(enum object_kit_body body);

#endif
