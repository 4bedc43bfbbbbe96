/* geotiff.c - where a picture lies, written into the directory of a TIFF that is already in memory.
 *
 * OpenImageIO's TIFF writer knows no GeoTIFF tags and stamps the present time into every file. Here its
 * finished bytes are taken up: the one directory is read, DateTime leaves it, the tags of OGC GeoTIFF 1.1
 * (19-008r4) enter, and the directory goes back in its place, or with geo tags to the end. Little-endian
 * classic TIFF only: what the writer makes.
 *
 * A picture whose up direction has the heading r (clockwise from north) maps column i and row j, at a pixel's
 * top left corner, to X = x0 + i px cos r - j py sin r, Y = y0 - i px sin r - j py cos r: up is (sin r, cos
 * r), right (cos r, -sin r). */
#include "core/image/private.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum {
    TAG_DATE_TIME = 306,
    TAG_PIXEL_SCALE = 33550,
    TAG_TIEPOINT = 33922,
    TAG_TRANSFORMATION = 34264,
    TAG_GEO_KEYS = 34735,
    TYPE_SHORT = 3,
    TYPE_DOUBLE = 12,
    ENTRY_BYTES = 12,
    ENTRIES_MAX = 64,
    EPSG_MIN = 1024,
    EPSG_MAX = 32766, /* what a GeoKey can hold: 19-008r4, 7.4 */
};

struct directory {
    uint32_t offset;
    int count, old_count;
    unsigned char entries[ENTRIES_MAX][ENTRY_BYTES];
    unsigned char next[4];
};

/* Values that do not fit into their entries; they follow the old end of the file. */
struct payload {
    unsigned char bytes[512];
    size_t size;
};

static uint16_t get16(const unsigned char *p)
{
    return (uint16_t)(p[0] | p[1] << 8);
}
static uint32_t get32(const unsigned char *p)
{
    return get16(p) | (uint32_t)get16(p + 2) << 16;
}
static void put16(unsigned char *p, unsigned v)
{
    p[0] = (unsigned char)v;
    p[1] = (unsigned char)(v >> 8);
}
static void put32(unsigned char *p, uint32_t v)
{
    put16(p, v & 0xFFFF);
    put16(p + 2, v >> 16);
}

static bool is_geo_tag(unsigned tag)
{
    return tag == TAG_PIXEL_SCALE || tag == TAG_TIEPOINT || tag == TAG_TRANSFORMATION || tag == TAG_GEO_KEYS;
}

static bool read_directory(const unsigned char *bytes, size_t size, struct directory *d)
{
    if (size < 8 || memcmp(bytes, "II*\0", 4) != 0)
        return false;
    d->offset = get32(bytes + 4);
    if (d->offset < 8 || size - 2 < d->offset)
        return false;
    d->old_count = get16(bytes + d->offset);
    size_t need = 2 + (size_t)d->old_count * ENTRY_BYTES + 4;
    if (d->old_count > ENTRIES_MAX - 4 || size - d->offset < need)
        return false;
    const unsigned char *p = bytes + d->offset + 2;
    for (int i = 0; i < d->old_count; i++, p += ENTRY_BYTES)
        if (get16(p) != TAG_DATE_TIME && !is_geo_tag(get16(p)))
            memcpy(d->entries[d->count++], p, ENTRY_BYTES);
    memcpy(d->next, p, 4);
    return true;
}

/* Adds a tag in its place by number; its values lie `base` bytes into the file plus what the payload holds.
 */
static void add_tag(struct directory *d, struct payload *payload, size_t base, unsigned tag, unsigned type,
                    const void *values, uint32_t count)
{
    size_t size = count * (type == TYPE_DOUBLE ? 8u : 2u);
    int at = d->count++;
    for (; at > 0 && get16(d->entries[at - 1]) > tag; at--)
        memcpy(d->entries[at], d->entries[at - 1], ENTRY_BYTES);
    unsigned char *p = d->entries[at];
    put16(p, tag);
    put16(p + 2, type);
    put32(p + 4, count);
    put32(p + 8, (uint32_t)(base + payload->size)); /* every payload here is over 4 bytes */
    memcpy(payload->bytes + payload->size, values, size);
    payload->size += size;
}

static void add_geo(struct directory *d, struct payload *payload, size_t base, const struct sv_geo_tags *geo)
{
    if (geo->rotation_rad == 0) {
        double scale[3] = {geo->pixel_x, geo->pixel_y, 0};
        double tie[6] = {0, 0, 0, geo->origin_x, geo->origin_y, 0};
        add_tag(d, payload, base, TAG_PIXEL_SCALE, TYPE_DOUBLE, scale, 3);
        add_tag(d, payload, base, TAG_TIEPOINT, TYPE_DOUBLE, tie, 6);
    } else {
        double c = cos(geo->rotation_rad), s = sin(geo->rotation_rad);
        double m[16] = {[0] = geo->pixel_x * c,
                        [1] = -geo->pixel_y * s,
                        [3] = geo->origin_x,
                        [4] = -geo->pixel_x * s,
                        [5] = -geo->pixel_y * c,
                        [7] = geo->origin_y,
                        [15] = 1};
        add_tag(d, payload, base, TAG_TRANSFORMATION, TYPE_DOUBLE, m, 16);
    }
    /* header (version 1, revision 1.0, keys), then GTModelType projected, GTRasterType PixelIsArea,
     * ProjectedCRS */
    uint16_t known[] = {1, 1, 0, 3, 1024, 0, 1, 1, 1025, 0, 1, 1, 3072, 0, 1, (uint16_t)geo->epsg};
    uint16_t unknown[] = {1, 1, 0, 1, 1025, 0, 1, 1};
    if (geo->epsg)
        add_tag(d, payload, base, TAG_GEO_KEYS, TYPE_SHORT, known, 16);
    else
        add_tag(d, payload, base, TAG_GEO_KEYS, TYPE_SHORT, unknown, 8);
}

static void write_directory(unsigned char *p, const struct directory *d)
{
    put16(p, (unsigned)d->count);
    memcpy(p + 2, d->entries, (size_t)d->count * ENTRY_BYTES);
    memcpy(p + 2 + d->count * ENTRY_BYTES, d->next, 4);
}

static enum sv_status check_geo(const struct sv_geo_tags *geo, struct sv_error *error)
{
    if (!isfinite(geo->origin_x) || !isfinite(geo->origin_y) || !isfinite(geo->rotation_rad))
        return sv_fail(error, SV_EINVAL, "geo_tags", "origin (%g, %g), rotation %g: not finite",
                       geo->origin_x, geo->origin_y, geo->rotation_rad);
    if (!(geo->pixel_x > 0 && geo->pixel_y > 0 && isfinite(geo->pixel_x) && isfinite(geo->pixel_y)))
        return sv_fail(error, SV_EINVAL, "geo_tags", "pixel of %g x %g m, must be finite and > 0",
                       geo->pixel_x, geo->pixel_y);
    if (geo->epsg != 0 && (geo->epsg < EPSG_MIN || geo->epsg > EPSG_MAX))
        return sv_fail(error, SV_EINVAL, "geo_tags", "EPSG code %d is outside %d..%d", geo->epsg, EPSG_MIN,
                       EPSG_MAX);
    return SV_OK;
}

enum sv_status sv_geotiff_finish(void **bytes, size_t *size, const struct sv_geo_tags *geo,
                                 struct sv_error *error)
{
    enum sv_status status = geo ? check_geo(geo, error) : SV_OK;
    if (status != SV_OK)
        return status;
    struct directory d = {0};
    struct payload payload = {0};
    if (!read_directory(*bytes, *size, &d))
        return sv_fail(error, SV_EFORMAT, "image", "not a small little-endian TIFF");
    size_t base = (*size + 7) & ~(size_t)7;
    if (geo)
        add_geo(&d, &payload, base, geo);
    if (!geo) { /* never longer than it was */
        write_directory((unsigned char *)*bytes + d.offset, &d);
        return SV_OK;
    }
    size_t at = base + payload.size, end = at + 2 + (size_t)d.count * ENTRY_BYTES + 4;
    if (end > UINT32_MAX)
        return sv_fail(error, SV_ELIMIT, "image", "%zu bytes: a TIFF holds 4 GiB", end);
    unsigned char *grown = realloc(*bytes, end);
    if (!grown)
        return sv_fail(error, SV_ENOMEM, "image", "no memory for %zu bytes", end);
    memset(grown + *size, 0, base - *size);
    memcpy(grown + base, payload.bytes, payload.size);
    write_directory(grown + at, &d);
    put32(grown + 4, (uint32_t)at);
    *bytes = grown;
    *size = end;
    return SV_OK;
}
