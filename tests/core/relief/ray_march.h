/* ray_march.h - the truth that warps of relief textures are judged by: one ray a pixel against the relief's
 * own surface, in double, by exact roots. Uses nothing of the warps (only the camera's rays).
 *
 * The surface. A texel owns the square of one texel about its centre. Between the centres of neighbours that
 * are one surface (both solid, displ within `cut`) the surface is bilinear. Where corners of a patch are not
 * all one surface, it is torn along the border between the squares: each side keeps the bilinear patch of its
 * own corners, and a corner that is not its own counts as what lies next to it (flat for the last half texel,
 * as at the border of the texture). Both sides of the surface are seen. Colours are bilinear in sRGB code
 * values between the same corners. What a torn place opens between the upper and the lower side is no
 * surface: a ray that meets nothing else but passed through such a place saw a hole. */
#ifndef SV_TESTS_RELIEF_RAY_MARCH_H
#define SV_TESTS_RELIEF_RAY_MARCH_H

#include "core/relief/relief.h"
#include "core/view/camera.h"

enum ray_kind { RAY_NOTHING, RAY_SURFACE, RAY_HOLE };

struct ray_seen {
    enum ray_kind kind;
    double u, v, displ; /* of what is seen; hole: where the far side, carried on flat, is met */
    double depth_m;     /* along the camera's axis */
    double rgb[3];      /* sRGB code values, 0 .. 255; hole: of the far side's edge where the ray passed it */
    double far_rgb[3];  /* hole: of the far texel itself; a fill may filter along the edge or not */
    int gaps;           /* torn places passed before */
};

/* A relief prepared for rays: its patches. Borrows the relief. */
struct ray_field;
struct ray_field *ray_field_create(const struct sv_relief *relief); /* NULL: no memory */
void ray_field_destroy(struct ray_field *field);

/* A camera prepared for many rays: they are affine in the picture's coordinates. */
struct ray_view {
    struct sv_vec3 start, start_x, start_y, step, step_x,
        step_y; /* in texel coordinates; at (0, 0), a pixel right, down */
    double near, far;
};
void ray_view_init(const struct ray_field *field, const struct sv_camera *camera, struct ray_view *view);
void ray_march_view(const struct ray_field *field, const struct ray_view *view, double px, double py,
                    struct ray_seen *seen);
/* What the ray of picture position (px, py) sees first, beyond the camera's near plane. */
void ray_march(const struct ray_field *field, const struct sv_camera *camera, double px, double py,
               struct ray_seen *seen);
/* The surface and its colour over (u, v); false where there is none. */
bool ray_surface_at(const struct ray_field *field, double u, double v, double *displ, double rgb[3]);

#endif
