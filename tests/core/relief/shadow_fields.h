/* shadow_fields.h - fields of heights, light directions and the brute-force truth that the shadow tests
 * share.
 *
 * The truth knows nothing of sweeps: from each sample it walks towards the light in small steps over the
 * bilinear surface and looks whether that ever stands above the ray. */
#ifndef SV_TESTS_SHADOW_FIELDS_H
#define SV_TESTS_SHADOW_FIELDS_H

#include <stdint.h>

#include "core/base/vec.h"

enum field_kind { FIELD_SMOOTH, FIELD_STEPPED, FIELD_OBJECTS, FIELD_NOISE };

struct shadow_field {
    const char *name;
    enum field_kind kind;
    int width, height;
    double dx, dy;
    double (*at)(double x,
                 double y); /* x, y in 0 .. 1 across the field; height in units of its width / 100 */
};

enum { SHADOW_FIELDS = 17, SHADOW_LIGHTS = 50 };
extern const struct shadow_field shadow_fields[SHADOW_FIELDS];

/* The field's heights, m: heap, width * height. */
float *shadow_field_heights(const struct shadow_field *field);
/* Light number k of 50: elevations 1 to 90 degrees, all azimuths, axes and diagonals; the last four come from
 * behind. */
struct sv_vec3 shadow_light(int k);

/* The bilinear surface; NaN where the nearest sample is NaN or outside. A cell with a NaN corner is flat
 * about each real one. x, y in samples. */
double shadow_surface(const struct shadow_field *field, const float *heights, double x, double y);
/* 255 / 0 a sample: exactly, cell by cell; where a height is NaN, by steps of a twentieth of a sample. */
void shadow_truth(const struct shadow_field *field, const float *heights, struct sv_vec3 travel, double bias,
                  uint8_t *lit);

#endif
