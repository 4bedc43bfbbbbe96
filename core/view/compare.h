/* compare.h - how far a picture is from the truth: error measures of 8-bit pictures, optionally under a mask.
 *
 * Differences are taken between encoded 8-bit values (0..255, as PSNR and SSIM are usually quoted), over R, G
 * and B alike; an alpha channel is left out, so compose over a background first. Luma is Y = 0.299 R + 0.587
 * G + 0.114 B of the encoded values (Rec. 601), unrounded. SSIM is that of Wang, Bovik, Sheikh, Simoncelli:
 * "Image quality assessment: from error visibility to structural similarity", IEEE TIP 13(4), 2004: eq. 13 on
 * luma, circular Gaussian of 11 x 11 with sigma 1.5, K1 = 0.01, K2 = 0.03, L = 255, mean over all windows
 * that lie wholly in the picture (as the authors' own program has it), no downsampling before. */
#ifndef SV_VIEW_COMPARE_H
#define SV_VIEW_COMPARE_H

#include <stdint.h>

#include "core/base/image.h"

enum { SV_COMPARE_SSIM_SIDE = 11 };

struct sv_compare_options {
    const struct sv_image
        *mask; /* u8, 1 channel, of the pictures' size: 0 leaves a pixel out; NULL: all count */
    int step;  /* 0..254: a pixel differs when a channel is off by more than this */
};
#define SV_COMPARE_OPTIONS_DEFAULT ((struct sv_compare_options){NULL, 8})

struct sv_compare_result {
    uint64_t pixels; /* that counted; 0 when the mask is empty: all else is then NaN */
    double mean_abs; /* mean absolute difference, levels of 255 */
    double rmse;     /* levels of 255 */
    double psnr_db;  /* 20 log10(255 / rmse); +infinity when equal */
    double ssim; /* -1..1; under a mask, of the windows whose middle counts; NaN when no window lies in the
                    picture (a side under 11) or counts */
    double differ_share;   /* share of pixels that differ by more than the step, 0..1 */
    double gradient_ratio; /* energy of luma differences between neighbours that both count (right and below),
                              picture over truth: under 1 blurred, over 1 noisy or aliased; 1 when both have
                              none, +infinity when only the truth has none */
};

/* Compares a picture with the truth: u8, equal sizes, 1, 3 or 4 channels each (equal in number but for
 * alpha). Any thread; about 30 ms for 512 x 512. SV_EINVAL says what does not fit; SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_compare(const struct sv_image *picture, const struct sv_image *truth,
                                        const struct sv_compare_options *options,
                                        struct sv_compare_result *result, struct sv_error *error);

#endif
