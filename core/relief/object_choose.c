/* object_choose.c - which of the six faces shows a piece of surface best. See below. */
#include "core/relief/object.h"

void sv_relief_object_choose(struct sv_relief_object *object)
{
    (void)object;
}
