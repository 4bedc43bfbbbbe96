/* listen.h - a listening TCP socket from "ADDRESS:PORT". */
#ifndef SV_SERVER_LISTEN_H
#define SV_SERVER_LISTEN_H

#include "core/base/error.h"

/* text: "127.0.0.1:8080", "[::1]:8080", "name:8080", ":8080" (every address of both families); port 0 takes a
 * free one. SO_REUSEADDR, close-on-exec, non-blocking. *port is the actual one. SV_EINVAL on the text, SV_EIO
 * when it cannot be bound; both name `listen`. */
SV_MUST_CHECK enum sv_status sv_listen(const char *text, int *fd, unsigned *port, struct sv_error *error);

#endif
