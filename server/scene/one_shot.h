/* one_shot.h - one picture without a server: a view's JSON file in, an image file out. */
#ifndef SV_SERVER_ONE_SHOT_H
#define SV_SERVER_ONE_SHOT_H

#include "server/scene/backend.h"

/* Reads the view and draws it into out ("-": standard output). A suffix of out chooses the format where the
 * view does not, and must fit one that it gives. f=json writes the description instead. Errors are added;
 * SV_OK when the file is written. */
SV_MUST_CHECK enum sv_status sv_one_shot(const struct sv_backend_options *options, const char *view_path,
                                         const char *out_path, struct sv_errors *errors);

#endif
