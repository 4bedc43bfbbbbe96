/* named_reliefs.h - fifty reliefs with names: what warps are judged on. Smooth, stepped and noisy; 1 x 1 to
 * 256 x 256; texels of unequal sides; frames of both hands, turned anyhow, some at UTM coordinates; colours
 * with edges, grain and contrast as photographs have them (features of about three texels and more: a picture
 * is sampled finely enough). */
#ifndef SV_TESTS_RELIEF_NAMED_RELIEFS_H
#define SV_TESTS_RELIEF_NAMED_RELIEFS_H

#include "core/relief/relief.h"
#include "core/view/camera.h"

enum named_kind { NAMED_SMOOTH, NAMED_STEPPED, NAMED_NOISY };
enum { NAMED_COUNT = 50 };

const char *named_relief_name(int k);
enum named_kind named_relief_kind(int k);
/* Heap; sv_relief_finish. Aborts without memory. */
void named_relief_make(int k, struct sv_relief *relief);

/* A camera that sees the whole of a relief: from `angle_rad` off f, at `azimuth_rad` from a, so near that the
 * texel that is drawn largest is about `magnification` px. The picture is as large as it must be, at most
 * 1024 a side. */
void named_relief_camera(const struct sv_relief *relief, double angle_rad, double azimuth_rad,
                         double magnification, bool parallel, struct sv_camera *camera);

#endif
