/* Points from CSV and vector files made here, with every slip that inventories have. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cpl_vsi.h>
#include <ogr_api.h>
#include <ogr_srs_api.h>

#include "core/scene/forest.h"
#include "tests/core/geo/synthetic.h"

#define CSV "/vsimem/trees.csv"

static void write_text(const char *path, const char *text)
{
    VSILFILE *f = VSIFOpenL(path, "wb");
    assert_non_null(f);
    size_t n = strlen(text);
    assert_int_equal(VSIFWriteL(text, 1, n, f), n);
    VSIFCloseL(f);
}

static struct sv_points read_points(const struct sv_points_options *o, const char *scene)
{
    struct sv_crs *crs = NULL;
    struct sv_points p;
    struct sv_error error = {0};
    assert_int_equal(scene ? sv_crs_create(scene, &crs, NULL) : sv_crs_create_local(&crs, NULL), SV_OK);
    if (sv_points_read(o, crs, &p, &error) != SV_OK)
        fail_msg("%s: %s", o->path, error.message);
    for (size_t k = 0; k < p.count; k++) {
        assert_true(isfinite(p.items[k].x) && isfinite(p.items[k].y));
        assert_true(!isinf(p.items[k].height_m) && !isinf(p.items[k].rotation_deg));
        assert_true(p.items[k].species == UINT32_MAX || p.items[k].species < p.name_count);
    }
    sv_crs_destroy(crs);
    return p;
}

static void refused(const struct sv_points_options *o, const char *scene, enum sv_status expected,
                    const char *word)
{
    struct sv_crs *crs = NULL;
    struct sv_points p = {0};
    struct sv_error error = {0};
    assert_int_equal(scene ? sv_crs_create(scene, &crs, NULL) : sv_crs_create_local(&crs, NULL), SV_OK);
    enum sv_status status = sv_points_read(o, crs, &p, &error);
    if (status != expected || p.items || !strstr(error.message, word))
        fail_msg("%s: expected \"%s\" and \"%s\", got \"%s\": %s", o->path, sv_status_text(expected), word,
                 sv_status_text(status), error.message);
    sv_crs_destroy(crs);
}

/* As refused, and the error belongs to that key. */
static void refused_key(const struct sv_points_options *o, const char *scene, enum sv_status expected,
                        const char *key, const char *word)
{
    struct sv_crs *crs = NULL;
    struct sv_points p = {0};
    struct sv_error error = {0};
    refused(o, scene, expected, word);
    assert_int_equal(scene ? sv_crs_create(scene, &crs, NULL) : sv_crs_create_local(&crs, NULL), SV_OK);
    assert_int_equal(sv_points_read(o, crs, &p, &error), expected);
    assert_string_equal(error.field, key);
    sv_crs_destroy(crs);
}

static void point_is(const struct sv_point *p, double x, double y, double height, uint32_t species)
{
    if (p->x != x || p->y != y || p->species != species ||
        (isnan(height) ? !isnan(p->height_m) : p->height_m != height))
        fail_msg("expected (%g, %g), %g m, species %u; got (%g, %g), %g m, species %u", x, y, height, species,
                 p->x, p->y, p->height_m, p->species);
}

#define NONE UINT32_MAX

/* A byte-order mark, empty fields, text among numbers, quotes, blanks, blank lines, CR LF, missing columns,
 * infinities. */
static void csv_slips(void **state)
{
    (void)state;
    write_text(CSV, "\xEF\xBB\xBFx,y,species,height_m,rot\r\n"
                    "1,2,Picea abies,12.5,90\r\n"
                    "3.5,4,,,\r\n"
                    "5,6,\"Fagus, red\",tall,\"  45 \"\r\n"
                    "7,8, Picea abies  ,-3,nan\r\n"
                    "here,9,Picea abies,1,1\r\n"
                    "\r\n"
                    "10,,Picea abies,1,1\r\n"
                    "11,12\r\n"
                    "13,14,\xC5\x91rfa,0,inf\r\n"
                    "1e400,15,Quercus,1,1\r\n"
                    "16,17,Picea abies,12 m,1e2,surplus\r\n");
    struct sv_points p = read_points(
        &(struct sv_points_options){
            .path = CSV, .species = "species", .height = "height_m", .rotation = "rot"},
        "EPSG:32632");
    assert_int_equal(p.count, 7);
    assert_int_equal(p.name_count, 4); /* the name of a tree without a place is a name all the same */
    assert_string_equal(p.names[0], "Picea abies");
    assert_string_equal(p.names[1], "Fagus, red");
    assert_string_equal(p.names[2], "\xC5\x91rfa");
    point_is(&p.items[0], 1, 2, 12.5, 0);
    point_is(&p.items[1], 3.5, 4, NAN, NONE);
    point_is(&p.items[2], 5, 6, NAN, 1);
    point_is(&p.items[3], 7, 8, -3, 0);
    point_is(&p.items[4], 11, 12, NAN, NONE);
    point_is(&p.items[5], 13, 14, 0, 2);
    point_is(&p.items[6], 16, 17, NAN, 0);
    assert_true(p.items[0].rotation_deg == 90 && isnan(p.items[1].rotation_deg) &&
                p.items[2].rotation_deg == 45 && isnan(p.items[3].rotation_deg) &&
                isnan(p.items[5].rotation_deg) && p.items[6].rotation_deg == 100);
    assert_true(p.skipped >= 3 &&
                p.skipped <= 4); /* a blank line may count as a row without a place, or as none */
    assert_false(p.crs_suspect);
    sv_points_finish(&p);
    assert_null(p.items);
    sv_points_finish(&p);
    VSIUnlink(CSV);
}

/* Semicolons and decimal commas; tabs; names in another case; a table called .txt; Windows-1252 names. */
static void csv_dialects(void **state)
{
    (void)state;
    write_text(CSV, "Rechts;Hoch;Art;Hoehe\n1,5;2,25;Buche;12,5\n3;4;F\xF6hre;1.234,5\n");
    struct sv_points p = read_points(
        &(struct sv_points_options){
            .path = CSV, .x = "rechts", .y = "HOCH", .species = "art", .height = "Hoehe"},
        NULL);
    assert_int_equal(p.count, 2);
    point_is(&p.items[0], 1.5, 2.25, 12.5, 0);
    point_is(&p.items[1], 3, 4, NAN, 1);
    assert_string_equal(p.names[1], "F\xC3\xB6hre");
    sv_points_finish(&p);
    VSIUnlink(CSV);
    static const char *const names[] = {"/vsimem/trees.txt", "/vsimem/trees.tsv"};
    for (int k = 0; k < 2; k++) {
        write_text(names[k], "x\ty\theight_m\n10\t20\t5\n30\t40\t6\n");
        p = read_points(&(struct sv_points_options){.path = names[k], .height = "height_m"}, NULL);
        assert_int_equal(p.count, 2);
        point_is(&p.items[1], 30, 40, 6, NONE);
        sv_points_finish(&p);
        VSIUnlink(names[k]);
    }
    /* a column of well-known text instead of x and y */
    write_text(
        CSV, "WKT,h\n\"POINT (1 2)\",3\n\"MULTIPOINT ((4 5),(6 7))\",8\n,9\n\"POLYGON ((0 0,10 0,10 "
             "10,0 10,0 0))\",1\n\"LINESTRING (0 0,10 10)\",2\n\"MULTILINESTRING ((0 0,1 1),(2 2,3 3))\",2\n"
             "\"GEOMETRYCOLLECTION (LINESTRING (0 0,1 1),POINT (8 9))\",4\n");
    p = read_points(&(struct sv_points_options){.path = CSV, .height = "h"}, NULL);
    assert_int_equal(p.count, 5);
    point_is(&p.items[2], 6, 7, 8, NONE);
    point_is(&p.items[3], 5, 5, 1, NONE);
    point_is(&p.items[4], 8, 9, 4, NONE);
    assert_int_equal(p.skipped, 4); /* no geometry, and three lines */
    sv_points_finish(&p);
    VSIUnlink(CSV);
}

static void csv_errors(void **state)
{
    (void)state;
    write_text(CSV, "lon,lat,dbh\n1,2,3\n4,5,60\n");
    refused_key(&(struct sv_points_options){.path = CSV}, NULL, SV_ENOENT, "x",
                "no column \"x\" (x), \"y\" (y); its columns are: lon, lat, dbh");
    refused_key(&(struct sv_points_options){.path = CSV, .x = "lon", .y = "north"}, NULL, SV_ENOENT, "y",
                "no column \"north\" (y); its");
    refused_key(&(struct sv_points_options){.path = CSV, .x = "lon", .y = "lat", .species = "kind"}, NULL,
                SV_ENOENT, "species", "no column \"kind\" (species); its");
    refused_key(
        &(struct sv_points_options){
            .path = CSV, .x = "lon", .y = "north", .species = "dbh", .height = "h", .rotation = "turn"},
        NULL, SV_ENOENT, "y", "no column \"north\" (y), \"h\" (height_m), \"turn\" (rotation_deg); its");
    refused_key(&(struct sv_points_options){.path = CSV, .x = "lon", .y = "lat", .where = "dbh >"}, NULL,
                SV_EINVAL, "where", "dbh >");
    refused_key(&(struct sv_points_options){.path = CSV, .x = "lon", .y = "lat", .where = "height > 3"}, NULL,
                SV_EINVAL, "where", "height");
    refused_key(&(struct sv_points_options){.path = CSV, .x = "lon", .y = "lat", .crs = "EPSG:0"},
                "EPSG:32632", SV_EINVAL, "crs", "EPSG:0");
    refused_key(&(struct sv_points_options){.path = CSV, .x = "lon", .y = "lat", .crs = "EPSG:4326"}, NULL,
                SV_EUNSUPPORTED, "crs", "local");
    refused(&(struct sv_points_options){.path = "/vsimem/none.csv"}, NULL, SV_ENOENT, "no such file");
    struct sv_points p = read_points(
        &(struct sv_points_options){.path = CSV, .x = "lon", .y = "lat", .where = "dbh > 10 AND lon < 100"},
        NULL);
    assert_int_equal(p.count, 1);
    point_is(&p.items[0], 4, 5, NAN, NONE);
    sv_points_finish(&p);
    /* none at all is no error; nor is an empty table */
    p = read_points(&(struct sv_points_options){.path = CSV, .x = "lon", .y = "lat", .where = "dbh > 100"},
                    NULL);
    assert_int_equal(p.count, 0);
    sv_points_finish(&p);
    write_text(CSV, "x,y\n");
    p = read_points(&(struct sv_points_options){.path = CSV}, NULL);
    assert_int_equal(p.count, 0);
    sv_points_finish(&p);
    write_text(CSV, "");
    struct sv_points none = {0};
    struct sv_crs *local = NULL;
    assert_int_equal(sv_crs_create_local(&local, NULL), SV_OK);
    assert_int_not_equal(sv_points_read(&(struct sv_points_options){.path = CSV}, local, &none, NULL), SV_OK);
    sv_crs_destroy(local);
    VSIUnlink(CSV);
    write_text("/vsimem/trees.geojson", "{\"type\":\"FeatureCollection\",\"features\":[{\"type\"");
    refused(&(struct sv_points_options){.path = "/vsimem/trees.geojson"}, NULL, SV_EFORMAT,
            "neither CSV nor");
    VSIUnlink("/vsimem/trees.geojson");
}

/* CSV in degrees, into a projected scene. On the central meridian the northing is 0.9996 of the meridian's
 * arc, 111132.95254 lat - 16038.50874 sin 2 lat + 16.83322 sin 4 lat - 0.0218 sin 6 lat (WGS 84). */
static void csv_crs(void **state)
{
    (void)state;
    write_text(CSV, "x,y\n9,47\n9,95\n");
    struct sv_points p =
        read_points(&(struct sv_points_options){.path = CSV, .crs = "EPSG:4326"}, "EPSG:32632");
    assert_int_equal(p.count, 1);
    assert_int_equal(p.skipped, 1); /* there is no latitude of 95 */
    assert_true(fabs(p.items[0].x - 500000) < 1e-3 && fabs(p.items[0].y - 5205164.11) < 0.1);
    assert_false(p.crs_suspect);
    sv_points_finish(&p);
    VSIUnlink(CSV);
}

static void geojson(const char *crs_member, const char *coordinates)
{
    char text[2000];
    snprintf(text, sizeof text,
             "{\"type\":\"FeatureCollection\",%s\"features\":[{\"type\":\"Feature\",\"properties\":{\"h\":7},"
             "\"geometry\":{\"type\":\"MultiPoint\",\"coordinates\":[%s]}}]}",
             crs_member, coordinates);
    write_text("/vsimem/trees.geojson", text);
}

/* GDAL takes GeoJSON without a system for degrees whatever is in it. */
static void degrees_or_metres(void **state)
{
    (void)state;
    const struct sv_points_options o = {.path = "/vsimem/trees.geojson", .height = "h"};
    geojson("", "[5,992],[498,821],[20,40]");
    struct sv_points p = read_points(&o, NULL);
    assert_true(p.crs_suspect && p.count == 3);
    point_is(&p.items[0], 5, 992, 7, NONE);
    sv_points_finish(&p);
    p = read_points(&o, "EPSG:32632");
    assert_true(p.crs_suspect && p.count == 3 && p.items[1].x == 498);
    sv_points_finish(&p);
    /* given a system, that one, however odd it looks */
    p = read_points(&(struct sv_points_options){.path = o.path, .crs = "EPSG:32633"}, "EPSG:32633");
    assert_true(!p.crs_suspect && p.count == 3 && p.items[1].x == 498);
    sv_points_finish(&p);
    /* real degrees with one slip of the pen in twelve stay degrees */
    geojson("", "[9,47],[9,47],[9,47],[9,47],[9,47],[9,47],[9,47],[9,47],[9,47],[9,47],[9,47],[9,470]");
    p = read_points(&o, "EPSG:32632");
    assert_true(!p.crs_suspect && p.count == 11 && p.skipped == 1);
    sv_points_finish(&p);
    /* small plot metres look like degrees; in a local scene they cannot be */
    geojson("", "[-1.99,0.93],[4.8,-7.9]");
    p = read_points(&o, NULL);
    assert_true(p.crs_suspect && p.count == 2 && p.items[1].y == -7.9);
    sv_points_finish(&p);
    /* the old crs member counts */
    geojson("\"crs\":{\"type\":\"name\",\"properties\":{\"name\":\"urn:ogc:def:crs:EPSG::32633\"}},",
            "[500000,5205336]");
    p = read_points(&o, "EPSG:4326");
    assert_true(!p.crs_suspect && p.count == 1 && fabs(p.items[0].x - 15) < 1e-9);
    sv_points_finish(&p);
    refused(&o, NULL, SV_EUNSUPPORTED, "EPSG:32633");
    VSIUnlink("/vsimem/trees.geojson");
}

/* GeoPackage and Shapefile written by OGR: geometry of each kind, a system of their own, nulls. */
static void other_files(void **state)
{
    (void)state;
    static const char *const drivers[][2] = {{"GPKG", "/vsimem/trees.gpkg"},
                                             {"ESRI Shapefile", "/vsimem/trees.shp"}};
    for (int k = 0; k < 2; k++) {
        GDALDatasetH ds =
            GDALCreate(GDALGetDriverByName(drivers[k][0]), drivers[k][1], 0, 0, 0, GDT_Unknown, NULL);
        assert_non_null(ds);
        OGRSpatialReferenceH srs = OSRNewSpatialReference(NULL);
        OSRImportFromEPSG(srs, 32633);
        OGRLayerH layer = GDALDatasetCreateLayer(ds, "trees", srs, wkbPoint, NULL);
        OSRRelease(srs);
        OGRFieldDefnH height = OGR_Fld_Create("height", OFTReal), kind = OGR_Fld_Create("kind", OFTInteger);
        OGR_L_CreateField(layer, height, TRUE);
        OGR_L_CreateField(layer, kind, TRUE);
        OGR_Fld_Destroy(height);
        OGR_Fld_Destroy(kind);
        for (int n = 0; n < 5; n++) {
            OGRFeatureH f = OGR_F_Create(OGR_L_GetLayerDefn(layer));
            if (n != 1)
                OGR_F_SetFieldDouble(f, 0, 10.5 + n);
            OGR_F_SetFieldInteger(f, 1, n % 2 ? 17 : 4);
            if (n != 3) {
                OGRGeometryH g = OGR_G_CreateGeometry(wkbPoint);
                OGR_G_SetPoint_2D(g, 0, 500000 + n, 5200000);
                OGR_F_SetGeometryDirectly(f, g);
            }
            assert_int_equal(OGR_L_CreateFeature(layer, f), OGRERR_NONE);
            OGR_F_Destroy(f);
        }
        GDALClose(ds);
        struct sv_points p = read_points(
            &(struct sv_points_options){.path = drivers[k][1], .height = "height", .species = "kind"},
            "EPSG:32633");
        assert_int_equal(p.count, 4);
        assert_int_equal(p.skipped, 1);
        point_is(&p.items[0], 500000, 5200000, 10.5, 0);
        point_is(&p.items[1], 500001, 5200000, NAN, 1);
        assert_string_equal(p.names[0], "4");
        assert_string_equal(p.names[1], "17");
        sv_points_finish(&p);
        p = read_points(&(struct sv_points_options){.path = drivers[k][1], .where = "kind = 4"},
                        "EPSG:32632");
        assert_int_equal(p.count, 3);
        assert_true(p.items[0].x > 900000);
        sv_points_finish(&p);
        assert_int_equal(GDALDeleteDataset(NULL, drivers[k][1]), CE_None);
    }
}

/* Many names: found again each, in order of appearance. */
static void many_names(void **state)
{
    (void)state;
    enum { N = 3000 };
    char *text = malloc(2 * N * 60 + 100), *at = text;
    assert_non_null(text);
    at += snprintf(at, 20, "x,y,s\n");
    for (int k = 0; k < 2 * N; k++)
        at += snprintf(at, 60, "%d,%d,species %d\n", k, k, k % N);
    write_text(CSV, text);
    free(text);
    struct sv_points p = read_points(&(struct sv_points_options){.path = CSV, .species = "s"}, NULL);
    assert_int_equal(p.count, 2 * N);
    assert_int_equal(p.name_count, N);
    for (int k = 0; k < 2 * N; k++) {
        char name[32];
        snprintf(name, sizeof name, "species %d", k % N);
        assert_int_equal(p.items[k].species, k % N);
        assert_string_equal(p.names[p.items[k].species], name);
    }
    sv_points_finish(&p);
    VSIUnlink(CSV);
}

/* One more than the limit is refused, and says so. Rows without attributes, so that it stays quick. */
static void limit(void **state)
{
    (void)state;
    size_t rows = (size_t)SV_FOREST_TREES_MAX + 1;
    VSILFILE *f = VSIFOpenL(CSV, "wb");
    assert_non_null(f);
    VSIFWriteL("x,y\n", 1, 4, f);
    char block[4096];
    for (size_t k = 0; k < sizeof block; k += 4)
        memcpy(block + k, "1,2\n", 4);
    for (size_t k = 0; k < rows; k += sizeof block / 4)
        VSIFWriteL(block, 1, rows - k < sizeof block / 4 ? 4 * (rows - k) : sizeof block, f);
    VSIFCloseL(f);
    refused(&(struct sv_points_options){.path = CSV}, NULL, SV_ELIMIT, "4194304");
    VSIUnlink(CSV);
}

static int set_up(void **state)
{
    (void)state;
    sv_geo_init();
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(csv_slips),         cmocka_unit_test(csv_dialects),
        cmocka_unit_test(csv_errors),        cmocka_unit_test(csv_crs),
        cmocka_unit_test(degrees_or_metres), cmocka_unit_test(other_files),
        cmocka_unit_test(many_names),        cmocka_unit_test(limit),
    };
    return cmocka_run_group_tests(tests, set_up, NULL);
}
