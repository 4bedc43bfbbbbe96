/* ground_rows_avx2.c - the row kernel with AVX2. */
#pragma GCC diagnostic ignored "-Wpsabi"
#define SV_GROUND_ROW sv_ground_row_avx2
#include "core/terrain/ground_rows.h"

#include "core/terrain/ground_rows.inc"
