/* imagery.h - the two halves of draping imagery: reading a window of a file as RGBA bytes, and sampling it.
 * For files of core/geo only. */
#ifndef SV_GEO_IMAGERY_H
#define SV_GEO_IMAGERY_H

#include "core/geo/raster.h"

/* Part of a file, averaged down to width x height pixels: straight RGBA, alpha 255 or 0. Heap. */
struct sv_imagery_window {
    double i0, j0, scale_i, scale_j; /* pixel = (index + 0.5 - i0) * scale - 0.5 */
    int x, y, span_x, span_y;        /* the part, in the file's pixels */
    int width, height;
    uint8_t *rgba;
};

/* Which bands make the colours, by options or by what the file says; fills report's bands_used and palette.
 * SV_EINVAL. */
SV_MUST_CHECK enum sv_status sv_imagery_choose_bands(const struct sv_raster *raster,
                                                     const struct sv_imagery_options *options,
                                                     struct sv_imagery_report *report,
                                                     struct sv_error *error);
/* Reads the part that window names (x .. height set) into window->rgba; fills report's rescaled and stretch.
 * Within a trap. SV_EIO, SV_ENOMEM. */
struct sv_gdal_trap;
SV_MUST_CHECK enum sv_status sv_imagery_read_window(const struct sv_raster *raster, const char *path,
                                                    struct sv_imagery_window *window,
                                                    struct sv_imagery_report *report,
                                                    const struct sv_gdal_trap *trap, struct sv_error *error);

#endif
