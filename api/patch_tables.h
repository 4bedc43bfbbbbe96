/* patch_tables.h - the tables of a patch, for its reader and for its schema. Private to api. */
#ifndef SV_API_PATCH_TABLES_H
#define SV_API_PATCH_TABLES_H

#include "core/scene/scene_values.h"

/* What a key takes, beyond the types of scene_values.h; the section of a row is that of an item or of the
 * object. */
#define SV_PATCH_LIST "array"       /* of objects by the row's section */
#define SV_PATCH_IDS "array of ids" /* min .. max */
#define SV_PATCH_GEOMETRY "GeoJSON geometry"
#define SV_PATCH_MOMENT "date and time"

const struct sv_value_section *sv_api_patch_section(void);
/* Of an entry of trees.add that is a scatter. */
const struct sv_value_section *sv_api_patch_scatter_section(void);

#endif
