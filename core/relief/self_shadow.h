/* self_shadow.h - the shadow that a relief casts on itself from parallel light (paper 1, section 3.3.1), by
 * its line sweep.
 *
 * l is the direction in which light TRAVELS, in the relief's axes (a^, b^, f), unit; theta its elevation
 * above the plane: sin(theta) = -l.f. Along a line of texels parallel to l's projection l_T, s metres on, the
 * pre-warped coordinate of (3) is s' = s + displ cot(theta); g = s' sin(theta) = s sin(theta) + displ
 * cos(theta) orders as it does and has no singular place: a texel is dark iff g < G - bias, G the largest g
 * before it; then G grows to g if that is larger.
 *
 * Departures. Rule (iii) grows S to (u_i, v_i), NOT to (u_s, v_s) as printed: a test shows that read
 * literally nearly everything goes dark; and the text beside figure 3 swaps d (a: in S, dark) and e (b: not
 * in S, lit). The paper's two special cases fall out: light square to the plane: g = s rises, nothing is
 * dark; light parallel to it: g = displ. Both are kept as branches of their own, selectable.
 *
 * Discrete lines: texel (i, j) lies on line i - round(j l_u / l_v) where |l_u| <= |l_v|, in texels (else u
 * and v swapped): copies of one Bresenham line, each texel on exactly one of them, up to half a texel beside
 * it. displ is taken ON the line, between the two texels beside it (texels_alone: as the paper has it, the
 * texel's own; then up to 40 % of the texels of a slope that the light runs along differ from the truth,
 * because neighbours on a line stand at different heights of that slope). A texel takes its line's answer:
 * edges are off by up to half a texel.
 *
 * Light from behind (l.f > 0): all solid texels are dark. Empty texels cast nothing and are lit. */
#ifndef SV_RELIEF_SELF_SHADOW_H
#define SV_RELIEF_SELF_SHADOW_H

#include "core/relief/relief.h"

struct sv_self_shadow_options {
    struct sv_vec3 travel;  /* l in (a^, b^, f), unit */
    const uint8_t *initial; /* width * height or NULL: shadow texture (cast.h), 0: dark from the start (the
                               first S of step (4) of 3.3.2), anything else: not. A texel that it darkens is
                               dark; G grows by it as by any other, for its body stops light all the same */
    float bias_m;           /* along g, m, finite, >= 0: what rounding to texels may not darken */
    bool special_cases;     /* the paper's two cases as branches of their own (for the record: same result) */
    bool texels_alone;      /* displ of each texel itself, not between two (the paper's reading) */
};

/* lit: width * height, 255 sees the light, 0 does not. O(texels), some 200 bytes a line of memory. Threads:
 * any. SV_EINVAL when travel is not unit (1e-6) or not finite, or bias_m out of range; SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_self_shadow(const struct sv_relief *relief,
                                            const struct sv_self_shadow_options *options, uint8_t *lit,
                                            struct sv_error *error);

#endif
