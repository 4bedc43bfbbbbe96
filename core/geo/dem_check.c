/* dem_check.c - which raw values of a DEM are heights. See dem.h. */
#include "core/geo/dem.h"

#include <math.h>
#include <string.h>
#include <strings.h>

enum sv_dem_value sv_dem_check_value(const struct sv_dem_check *check, double raw, double *height_m)
{
    for (int k = 0; k < 2; k++)
        if (check->has_nodata[k] && (raw == check->nodata[k] || (isnan(raw) && isnan(check->nodata[k]))))
            return SV_DEM_VOID_DECLARED;
    double z = raw * check->scale_m + check->offset_m;
    /* SRTM's void and its neighbour (files that were scaled by hand), and the custom of Arc/Info grids. -9999
     * m is water of 10 km depth: a chart of a trench may lose a sample by this, and gets it back
     * interpolated. */
    if (raw == -32768 || raw == -32767 || (check->plain && raw == -9999))
        return SV_DEM_VOID_UNDECLARED;
    if (!(fabs(z) <= SV_DEM_HEIGHT_MAX_M)) /* NaN and infinities, too */
        return SV_DEM_VOID_UNDECLARED;
    *height_m = z;
    return SV_DEM_GOOD;
}

double sv_dem_unit_m(const char *name)
{
    static const struct {
        const char *name;
        double unit_m;
    } units[] = {
        {"m", 1},
        {"metre", 1},
        {"meter", 1},
        {"metres", 1},
        {"meters", 1},
        {"ft", 0.3048},
        {"foot", 0.3048},
        {"feet", 0.3048},
        {"international foot", 0.3048},
        {"us survey foot", 1200.0 / 3937.0},
        {"us survey feet", 1200.0 / 3937.0},
        {"foot_us", 1200.0 / 3937.0},
        {"us-ft", 1200.0 / 3937.0},
        {"ftus", 1200.0 / 3937.0},
        {"dm", 0.1},
        {"decimetre", 0.1},
        {"decimeter", 0.1},
        {"cm", 0.01},
        {"centimetre", 0.01},
        {"centimeter", 0.01},
        {"mm", 0.001},
        {"millimetre", 0.001},
        {"millimeter", 0.001},
        {"km", 1000},
        {"kilometre", 1000},
        {"kilometer", 1000},
    };
    for (size_t k = 0; name && k < sizeof units / sizeof units[0]; k++)
        if (!strcasecmp(name, units[k].name))
            return units[k].unit_m;
    return 0;
}
