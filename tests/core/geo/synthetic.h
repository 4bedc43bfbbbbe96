/* synthetic.h - rasters made by the tests themselves, in GDAL's memory file system. */
#ifndef SV_TESTS_GEO_SYNTHETIC_H
#define SV_TESTS_GEO_SYNTHETIC_H

#include <gdal.h>

#include "core/base/arena.h"
#include "core/geo/geo.h"

struct synthetic {
    const char *path; /* "/vsimem/....tif" */
    int width, height, bands;
    GDALDataType type;
    const double *place; /* geotransform of pixel corners; NULL: none */
    const char *crs;     /* NULL: none */
    const char *nodata;  /* as text, NULL: none */
    const char *unit;    /* of band 1, NULL: none */
    double scale;        /* of band 1; 0: none */
    double (*value)(void *context, int band, int column, int row); /* row 0 as in the file */
    void *context;
};

/* Writes the file (GeoTIFF); fails the test when GDAL does. */
void synthetic_write(const struct synthetic *s);
void synthetic_remove(const char *path);
/* An arena for one DEM. */
struct sv_arena *synthetic_arena(void);
/* Folder of the real data with `name` appended, or NULL when it is not there. Static memory, good until the
 * next call but three. */
const char *synthetic_data(const char *name);

#endif
