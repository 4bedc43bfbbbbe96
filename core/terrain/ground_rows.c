/* ground_rows.c - the row kernel for every x86-64. */
#pragma GCC diagnostic ignored "-Wpsabi" /* vectors are passed between inlined functions only */
#define SV_GROUND_ROW sv_ground_row_plain
#include "core/terrain/ground_rows.h"

#include "core/terrain/ground_rows.inc"
