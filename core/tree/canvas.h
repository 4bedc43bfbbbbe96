/* canvas.h - the pixels of a view, or of a band of its rows, that trees are drawn into on the CPU.
 *
 * A plain value that borrows its planes, laid out as sv_gl_target_read gives them: row 0 at the top, rows of
 * `width` elements without gaps. A plane holds the band's rows alone: picture row row_first is its first.
 * What is opaque (terrain, objects, near trees) is drawn before, and has left its colour and depth; near
 * trees drawn on the CPU (leaf splats) write all planes as GL would; far trees (sprite.h) are blended over.
 *
 * depth   window depth, reversed, as GL wrote it (frames.h): perspective near / Z, orthographic (far - Z) /
 * far, Z in metres along forward; 0: nothing there (sky). Larger is nearer. color   RGBA u8, sRGB code of
 * linear light, premultiplied by coverage a; a = 255 where the sky is drawn. id      core/scene/id.h. normal
 * 3 floats, world axes, facing the viewer, unit; 0 for the sky.
 *
 * surface: trees leave depth wherever they cover anything (that of the tree which covers half of what is covered),
 * not only where they cover half of the view: what a relief panel is made of. */
#ifndef SV_TREE_CANVAS_H
#define SV_TREE_CANVAS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct sv_canvas {
    int width, height;        /* of the whole picture, as in the camera: 1 .. 4096 */
    int row_first, row_count; /* the band; 0 <= row_first, row_first + row_count <= height */
    float *depth;             /* never NULL */
    uint8_t *color;           /* never NULL */
    uint32_t *id;             /* NULL: not wanted */
    float *normal;            /* NULL: not wanted */
    bool surface;
};

/* Pixel of picture row `row` (of the band) and column: index into depth and id; times 4: color, times 3:
 * normal. */
static inline size_t sv_canvas_at(const struct sv_canvas *canvas, int column, int row)
{
    return (size_t)(row - canvas->row_first) * (size_t)canvas->width + (size_t)column;
}

/* The canvas' rows row .. row + rows - 1 alone. */
static inline struct sv_canvas sv_canvas_band(const struct sv_canvas *canvas, int row, int rows)
{
    size_t skip = sv_canvas_at(canvas, 0, row);
    struct sv_canvas band = *canvas;
    band.row_first = row;
    band.row_count = rows;
    band.depth += skip;
    band.color += 4 * skip;
    band.id = canvas->id ? canvas->id + skip : NULL;
    band.normal = canvas->normal ? canvas->normal + 3 * skip : NULL;
    return band;
}

#endif
