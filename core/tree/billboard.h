/* billboard.h - the classical textures of a billboard cloud's planes: paper 2's figure 4 (2).
 *
 * Each plane has a colour texture of 1024 x 1024 in DXT5 (colour in sRGB code, straight, and coverage), the
 * mean normals and sky occlusion of what it shows, and its openness to the sun (mesh.h). Colour and normals
 * have all mip levels, averages by coverage: they are drawn blended, so that a level covers what the leaves
 * did. An alpha test (ids, depth) needs a bar instead that differs from level to level, or thin crowns would
 * vanish in the distance and dense ones fill up: found by bisection (Castano). Colour and normals continue
 * into what is empty, so that filtering takes in no rubbish.
 *
 * Normals are in the model's axes, turned to the front of the plane; their length falls where they scatter.
 * No GL; any process, any thread; sv_color_init has been called. Deterministic. */
#ifndef SV_TREE_BILLBOARD_H
#define SV_TREE_BILLBOARD_H

#include "core/tree/cloud.h"

/* Kind of the blob in the store; the digit is raised whenever the bake or the layout changes. */
#define SV_BILLBOARD_KIND "billb4"

enum { SV_BILLBOARD_LEVELS_MAX = 13, SV_BILLBOARD_OUTLINE = 8 };

/* Sides are powers of two, 4 .. 4096, normal and light at most as large as colour. */
struct sv_billboard_options {
    int color_side, normal_side, light_side;
    int samples; /* a side of a texel of colour: 1 .. 4 */
};
/* Normals at a quarter of the resolution (8.4 MB a species; 512 takes 33.6 and changes the error against the
 * truth by less than its third digit, oak and spruce of 25 to 400 px), light, which is smooth, at a
 * sixteenth. */
#define SV_BILLBOARD_OPTIONS_DEFAULT ((struct sv_billboard_options){1024, 256, 64, 2})

enum sv_billboard_part { SV_BILLBOARD_COLOR, SV_BILLBOARD_NORMAL, SV_BILLBOARD_LIGHT, SV_BILLBOARD_PARTS };

struct sv_billboards {
    int plane_count, side[SV_BILLBOARD_PARTS], levels[SV_BILLBOARD_PARTS];
    float translucency[4]; /* of what shows colour c (linear): c . [0..2] + [3], to be held in 0..1 */
    float bar[SV_BILLBOARD_LEVELS_MAX]; /* coverage of a level of COLOR that an alpha test takes: mean over
                                           the planes, by what they show */
    /* What a plane shows, between eight lines: it lies where a s + b t <= outline[k], (a, b) = (cos, sin) of
     * k 45 degrees, (s, t) its picture's coordinates, 0..1, t down. */
    float outline[SV_CLOUD_PLANES_MAX][SV_BILLBOARD_OUTLINE];
    uint8_t *data; /* heap: part after part, level after level, plane after plane */
    size_t bytes;
};

SV_MUST_CHECK enum sv_status sv_billboards_bake(const struct sv_tree_mesh *mesh,
                                                const struct sv_tree_cloud *cloud,
                                                const struct sv_billboard_options *options,
                                                struct sv_billboards *billboards, struct sv_error *error);
void sv_billboards_finish(struct sv_billboards *billboards); /* legal on a zeroed one */
/* Bytes of the textures that a bake of legal options makes, mip levels included. */
size_t sv_billboards_bytes(const struct sv_billboard_options *options, int planes);

/* All planes' pictures of a level, plane after plane; *bytes of one plane. COLOR: DXT5 blocks; NORMAL: RGBA8,
 * 127.5 + 127.5 n and occlusion; LIGHT: RGBA8, 127.5 + 127.5 slope along the model's axes, and mean. */
const uint8_t *sv_billboards_level(const struct sv_billboards *billboards, enum sv_billboard_part part,
                                   int level, size_t *bytes);

/* One block of bytes (heap, caller frees) and back; load takes any bytes: SV_EFORMAT. */
SV_MUST_CHECK enum sv_status sv_billboards_save(const struct sv_billboards *billboards, void **data,
                                                size_t *bytes, struct sv_error *error);
SV_MUST_CHECK enum sv_status sv_billboards_load(const void *data, size_t bytes,
                                                struct sv_billboards *billboards, struct sv_error *error);

/* The bar for which the share of a bilinear picture of coverage (side x side, row by row) that is >= bar
 * comes closest to target: bisection. Shared by all forms with an alpha test. */
float sv_coverage_bar(const float *coverage, int side, double target);

#endif
