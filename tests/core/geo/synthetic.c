#include "tests/core/geo/synthetic.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <cpl_conv.h>
#include <cpl_vsi.h>
#include <ogr_srs_api.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

static void set_up_bands(GDALDatasetH ds, const struct synthetic *s)
{
    for (int b = 1; b <= s->bands; b++)
        if (s->nodata)
            assert_int_equal(GDALSetRasterNoDataValue(GDALGetRasterBand(ds, b), CPLAtof(s->nodata)), CE_None);
    if (s->unit)
        GDALSetRasterUnitType(GDALGetRasterBand(ds, 1), s->unit);
    if (s->scale != 0)
        GDALSetRasterScale(GDALGetRasterBand(ds, 1), s->scale);
}

void synthetic_write(const struct synthetic *s)
{
    const char *const options[] = {"SPARSE_OK=TRUE", "PROFILE=GDALGeoTIFF", NULL};
    GDALDatasetH ds = GDALCreate(GDALGetDriverByName("GTiff"), s->path, s->width, s->height, s->bands,
                                 s->type, (char **)options);
    assert_non_null(ds);
    double place[6];
    for (int k = 0; s->place && k < 6; k++)
        place[k] = s->place[k];
    if (s->place)
        assert_int_equal(GDALSetGeoTransform(ds, place), CE_None);
    if (s->crs) {
        OGRSpatialReferenceH srs = OSRNewSpatialReference(NULL);
        OSRSetAxisMappingStrategy(srs, OAMS_TRADITIONAL_GIS_ORDER);
        assert_int_equal(OSRSetFromUserInput(srs, s->crs), OGRERR_NONE);
        assert_int_equal(GDALSetSpatialRef(ds, srs), CE_None);
        OSRRelease(srs);
    }
    set_up_bands(ds, s);
    double *row = malloc((size_t)s->width * sizeof *row);
    assert_non_null(row);
    for (int b = 1; s->value && b <= s->bands; b++)
        for (int j = 0; j < s->height; j++) {
            for (int i = 0; i < s->width; i++)
                row[i] = s->value(s->context, b, i, j);
            assert_int_equal(GDALRasterIO(GDALGetRasterBand(ds, b), GF_Write, 0, j, s->width, 1, row,
                                          s->width, 1, GDT_Float64, 0, 0),
                             CE_None);
        }
    free(row);
    GDALClose(ds);
}

void synthetic_remove(const char *path)
{
    char aux[256];
    snprintf(aux, sizeof aux, "%s.aux.xml", path);
    VSIUnlink(path);
    VSIUnlink(aux);
}

struct sv_arena *synthetic_arena(void)
{
    struct sv_arena *arena = NULL;
    assert_int_equal(sv_arena_create((size_t)1 << 31, &arena, NULL), SV_OK);
    return arena;
}

const char *synthetic_data(const char *name)
{
    static char paths[4][512];
    static int next;
    const char *root = getenv("SV_DATA");
    char *path = paths[next++ % 4];
    snprintf(path, sizeof paths[0], "%s/%s", root ? root : "../shared/data", name);
    return access(path, R_OK) == 0 ? path : NULL;
}
