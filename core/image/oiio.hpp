/* oiio.hpp - what encode.cpp and decode.cpp share: OpenImageIO, our C headers, and the fence that no
 * exception passes.
 *
 * Private to core/image. The macros of OpenImageIO's headers stay behind this file. */
#ifndef SV_IMAGE_OIIO_HPP
#define SV_IMAGE_OIIO_HPP

#include <new>
#include <string>
#include <vector>

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

extern "C" {
#include "core/base/color.h"
#include "core/image/encode.h"
#include "core/image/private.h"
}

/* Runs body, which returns enum sv_status, and turns whatever it throws into a status. */
template <class F>
static inline enum sv_status sv_image_fenced(struct sv_error *error, const char *what, F body)
{
    try {
        return body();
    } catch (const std::bad_alloc &) {
        return sv_fail(error, SV_ENOMEM, "image", "%s: out of memory", what);
    } catch (const std::exception &e) {
        return sv_fail(error, SV_EINTERNAL, "image", "%s: %s", what, e.what());
    } catch (...) {
        return sv_fail(error, SV_EINTERNAL, "image", "%s: unknown exception", what);
    }
}

#endif
