/* gdal_trap.h - keeps GDAL, OGR and PROJ quiet, and what they had to say. For files of core/geo only.
 *
 * GDAL reports errors through a handler, by default on standard error. sv_geo_init replaces that one for good
 * by silence; every public call that may fail opens a trap around its work and puts the first failure's text
 * into its sv_error. */
#ifndef SV_GEO_GDAL_TRAP_H
#define SV_GEO_GDAL_TRAP_H

#include <stdbool.h>

struct sv_gdal_trap {
    char text[320]; /* the first failure (or, when there was none, the first warning); "" if all was well */
    bool failed;    /* a failure, not just a warning */
};

/* Starts to collect into *trap, which must stay where it is until sv_gdal_trap_end. Traps nest. */
void sv_gdal_trap_begin(struct sv_gdal_trap *trap);
void sv_gdal_trap_end(struct sv_gdal_trap *trap);
/* The collected text, or `otherwise` when GDAL gave no reason. */
const char *sv_gdal_trap_text(const struct sv_gdal_trap *trap, const char *otherwise);

#endif
