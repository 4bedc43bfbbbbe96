/* control.h - the scene process after loading: says that it is ready, forks workers on demand, reaps them;
 * forks its successor for a patch. */
#ifndef SV_SERVER_CONTROL_H
#define SV_SERVER_CONTROL_H

#include "server/scene/backend.h"

/* Tells the daemon why the scene does not load. */
void sv_control_failed(int control_fd, enum sv_status status, const struct sv_errors *errors);
/* Threads of this process. */
unsigned sv_control_threads(void);
/* Says ready and serves until the daemon closes the socket; the process's exit status. threads: how many
 * there were when main began (libraries start some before); more by now are told to the daemon. */
int sv_control_serve(int control_fd, struct sv_backend *backend, unsigned threads);

#endif
