#include "core/view/request.h"

#include <stddef.h>

#define X(name, text) [name] = text,
#define NAMES(function, type, list, limit)                                                                   \
    const char *function(enum type v)                                                                        \
    {                                                                                                        \
        static const char *const names[] = {list(X)};                                                       \
        return (unsigned)v < (limit) ? names[v] : "?";                                                      \
    }
NAMES(sv_quality_name, sv_quality, SV_QUALITY_LIST, SV_QUALITY_COUNT)
NAMES(sv_trees_name, sv_trees, SV_TREES_LIST, SV_TREES_COUNT)
NAMES(sv_relief_name, sv_relief_mode, SV_RELIEF_LIST, SV_RELIEF_COUNT)
NAMES(sv_layer_name, sv_layer, SV_LAYER_LIST, SV_LAYER_COUNT)
NAMES(sv_projection_name, sv_projection, SV_PROJECTION_LIST, SV_PROJECTION_COUNT)
#undef X
#define X(name, text, media) [name] = text,
NAMES(sv_format_name, sv_format, SV_FORMAT_LIST, SV_FORMAT_COUNT)
#undef X
#define X(name, text, media) [name] = media,
NAMES(sv_format_media, sv_format, SV_FORMAT_LIST, SV_FORMAT_COUNT)
#undef X
