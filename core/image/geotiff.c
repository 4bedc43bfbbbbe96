#include "core/image/private.h"
enum sv_status sv_geotiff_finish(void **bytes, size_t *size, const struct sv_geo_tags *geo,
                                 struct sv_error *error)
{
    (void)bytes;
    (void)size;
    if (geo)
        return sv_fail(error, SV_EUNSUPPORTED, "geo_tags", "not written");
    return SV_OK;
}
