/* gdal_trap.c - quiet, collecting GDAL error handlers, and the one-time set-up of the library. */
#include "core/geo/gdal_trap.h"

#include <stdio.h>
#include <string.h>

#include <cpl_conv.h>
#include <cpl_error.h>
#include <gdal.h>
#include <ogr_srs_api.h>

#include "core/geo/geo.h"

static void CPL_STDCALL collect(CPLErr level, CPLErrorNum number, const char *text)
{
    (void)number;
    struct sv_gdal_trap *trap = CPLGetErrorHandlerUserData();
    if (!trap || level < CE_Warning)
        return;
    bool failure = level >= CE_Failure;
    if (trap->text[0] && (trap->failed || !failure))
        return;
    trap->failed = failure;
    snprintf(trap->text, sizeof trap->text, "%s", text);
    /* GDAL's messages may hold line breaks; one sentence on one line is what an error promises */
    for (char *p = trap->text; *p; p++)
        if ((unsigned char)*p < 0x20)
            *p = ' ';
}

void sv_gdal_trap_begin(struct sv_gdal_trap *trap)
{
    *trap = (struct sv_gdal_trap){0};
    CPLErrorReset();
    CPLPushErrorHandlerEx(collect, trap);
}

void sv_gdal_trap_end(struct sv_gdal_trap *trap)
{
    (void)trap;
    CPLPopErrorHandler();
    CPLErrorReset();
}

const char *sv_gdal_trap_text(const struct sv_gdal_trap *trap, const char *otherwise)
{
    return trap->text[0] ? trap->text : otherwise;
}

void sv_geo_init(void)
{
    static bool done;
    if (done)
        return;
    done = true;
    static const struct {
        const char *key, *value;
    } settings[] = {
        {"GDAL_NUM_THREADS", "1"}, /* a thread of GDAL's that lives at the fork hangs the child */
        {"OPJ_NUM_THREADS", "1"},
        {"GDAL_CACHEMAX", "128"}, /* MB; the default, 5 % of memory, would count against every worker */
        {"GDAL_VRT_ENABLE_PYTHON", "NO"},
        {"CPL_DEBUG", "OFF"},
    };
    CPLSetErrorHandler(CPLQuietErrorHandler);
    for (size_t i = 0; i < sizeof settings / sizeof settings[0]; i++)
        CPLSetConfigOption(settings[i].key, settings[i].value);
    OSRSetPROJEnableNetwork(FALSE); /* the same answer on every machine, and no waiting */
    GDALAllRegister();
}
