/* density.h - a billboard cloud in 393,344 bytes: the density texture of paper 2, and better use of its
 * bytes.
 *
 * Both kinds are one DXT5 picture of 6 x 4 tiles of 128 x 128 texels, a tile a plane, 768 x 512 in a DDS file
 * (paper 3.4, 4.2). A texel stands for 8 x 8 pixels of the UV texture, the plane drawn at 1024 x 1024 with
 * the leaves' own texture coordinates as colour (paper 3.1).
 *
 * PAPER, as sections 3.2 to 3.5 say: R, G = periods w_x, w_y of the ramps found about the texel (sawtooth.h),
 * B, A = x, y of the mean normal. Codes: 0 in R and G: no leaf; 255 in both: wood, which the paper leaves
 * out. Texture coordinates are the sawtooth of the billboard's own coordinate.
 *
 * PLAIN (own derivation): what the leaves of a species have in common, their size and their texture, needs no
 * bytes in each texel; what they have not, does. A, the one channel that DXT5 keeps well = the share of the
 * texel that is covered; R, G = x, y of the mean normal; B = tone, the place on a line through
 * three colours of the species: its bark, its dark and its bright leaves. Texels that show nothing carry
 * their block's mean, so that they spoil no other; mip levels are made when it is loaded (sv_density_levels).
 * How sharp they are drawn is measured for each species (density_tune.c).
 *
 * Light: sky occlusion and openness to the sun (mesh.h) vary slowly over a crown; each plane has them as
 * quadratic functions of its place, in both kinds. Frames: x right, y up on the plane, -1 .. 1 over its
 * rectangle (cloud.h). Deterministic, no GL, any thread. */
#ifndef SV_TREE_DENSITY_H
#define SV_TREE_DENSITY_H

#include "core/tree/cloud.h"

enum {
    SV_DENSITY_COLUMNS = 6,
    SV_DENSITY_ROWS = 4,
    SV_DENSITY_PLANES_MAX = SV_DENSITY_COLUMNS * SV_DENSITY_ROWS,
    SV_DENSITY_TILE = 128,
    SV_DENSITY_STEP = 8, /* pixels of the UV texture a texel */
    SV_DENSITY_UV_SIDE = SV_DENSITY_TILE * SV_DENSITY_STEP,
    SV_DENSITY_WIDTH = SV_DENSITY_COLUMNS * SV_DENSITY_TILE,
    SV_DENSITY_HEIGHT = SV_DENSITY_ROWS * SV_DENSITY_TILE,
    SV_DENSITY_FILE_BYTES = SV_DENSITY_WIDTH * SV_DENSITY_HEIGHT + 128,
    SV_DENSITY_LEVELS = 8, /* mip levels: the last one has one texel a plane */
    SV_DENSITY_SCALES = 6, /* levels of detail FIRST, FIRST + 1, ...: how near a tree is, about */
    SV_DENSITY_SCALE_FIRST = -1,
};

/* Tone of the darkest leaf; below it lies what shows wood as well. */
#define SV_DENSITY_TONE_DARK 0.4f

/* Kinds of the blobs in the store; digits are raised whenever what is built changes. */
#define SV_DENSITY_PAPER_KIND "densitypaper6"
#define SV_DENSITY_PLAIN_KIND "density6"

enum sv_density_kind { SV_DENSITY_PAPER, SV_DENSITY_PLAIN, SV_DENSITY_KIND_COUNT };

/* c[0] + c[1] x + c[2] y + c[3] x^2 + c[4] x y + c[5] y^2 */
struct sv_density_quadratic {
    float c[6];
};
float sv_density_quadratic_at(const struct sv_density_quadratic *q, float x, float y);

struct sv_density_plane {
    struct sv_density_quadratic occlusion, open[4]; /* mesh.h; slope along the model's axes, mean; / 127 */
    float scatter[6]; /* mean |n.l| of what it shows, for unit l in the plane's axes: as sv_impostor_frame */
    float length;     /* mean length of a texel's mean normal, 0..1 */
    float slender;    /* width of its rectangle over height */
};

/* The leaf that most of the crown's leaf area is made of: where its picture lies. */
struct sv_density_leaf {
    int32_t material;         /* -1: there are no leaves */
    float uv_lo[2], uv_hi[2]; /* of one of them, the middle one in size */
    float size[2];            /* model units, of that picture's width and height */
    float cover;              /* share of the picture that its alpha test keeps */
};

struct sv_density {
    enum sv_density_kind kind;
    int plane_count;
    float period_min, period_max;      /* px: what codes 1 and 254 stand for (PAPER) */
    float wood[3], dark[3], bright[3]; /* linear colours of tones 0, SV_DENSITY_TONE_DARK and 1 */
    float translucency[4];             /* of colour c (linear): c . [0..2] + [3], to be held in 0..1 */
    float
        finer[SV_DENSITY_SCALES]; /* added to levels of detail (PLAIN): 0 or less, mostly (density_tune.c) */
    struct sv_density_leaf leaf;
    struct sv_density_plane planes[SV_DENSITY_PLANES_MAX];
    uint8_t *file; /* heap, SV_DENSITY_FILE_BYTES: the DDS file */
};

/* Draws every plane's UV texture and boils it down. mesh and cloud belong to each other. SV_ELIMIT for more
 * planes than tiles, SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_density_build(const struct sv_tree_mesh *mesh,
                                              const struct sv_tree_cloud *cloud, enum sv_density_kind kind,
                                              struct sv_density *density, struct sv_error *error);
void sv_density_finish(struct sv_density *density); /* legal on a zeroed one */

/* One block of bytes (heap, caller frees) and back; load takes any bytes: SV_EFORMAT. */
SV_MUST_CHECK enum sv_status sv_density_save(const struct sv_density *density, void **data, size_t *bytes,
                                             struct sv_error *error);
SV_MUST_CHECK enum sv_status sv_density_load(const void *data, size_t bytes, struct sv_density *density,
                                             struct sv_error *error);

/* A period in 8 bits, evenly spaced from least (code 1) to most (254); and back. Off by (most - least) / 506
 * px at most: over 3 .. 64 px 0.12 px, 3.0 % at 4 px and 0.5 % at 24. By its logarithm (design.md section 4)
 * it would be off by ln(most / least) / 506 of itself: 0.6 % everywhere; that is sv_density_log_code. NaN
 * gives 0. */
uint8_t sv_density_code(float period, float least, float most);
float sv_density_period(uint8_t code, float least, float most);
uint8_t sv_density_log_code(float period, float least, float most);
float sv_density_log_period(uint8_t code, float least, float most);

/* Linear colour of a tone, 0..1 (PLAIN). */
void sv_density_color(const struct sv_density *density, float tone, float rgb[3]);
/* What is added to a level of detail (PLAIN): linear between scales, and held beyond them. */
float sv_density_finer(const struct sv_density *density, float lod);
/* The texels of the file, WIDTH x HEIGHT x 4, row 0 at the top, into rgba. */
void sv_density_texels(const struct sv_density *density, uint8_t *rgba);

/* What PLAIN is drawn from, heap, level after level, level k WIDTH >> k by HEIGHT >> k: colour, premultiplied
 * by coverage and in sRGB code, with coverage; mean normal in the plane's axes as 127.5 + 127.5 m, and
 * occlusion. Means by coverage; empty texels continue what is near. No level mixes two planes. Levels are
 * chosen by areas (tree_density.frag); so that pixels do not miss what stands upright on slender planes,
 * trunks, colour and coverage of levels above 0 are means over as many texels along a plane's narrow side as
 * a pixel has there then: the root of the ratio of its sides. */
struct sv_density_levels {
    uint8_t *albedo[SV_DENSITY_LEVELS], *normal[SV_DENSITY_LEVELS];
};
SV_MUST_CHECK enum sv_status sv_density_levels_init(const struct sv_density *density,
                                                    struct sv_density_levels *levels, struct sv_error *error);
void sv_density_levels_finish(struct sv_density_levels *levels);

#endif
