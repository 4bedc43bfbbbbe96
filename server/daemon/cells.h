/* cells.h - /v1/cells: the relief cells of the scene that serves are listed, dropped, built ahead; and what
 * of them is counted. */
#ifndef SV_SERVER_CELLS_H
#define SV_SERVER_CELLS_H

#include "server/daemon/service.h"

void sv_cells_page_list(struct sv_service *service, struct sv_exchange *exchange);  /* GET */
void sv_cells_page_drop(struct sv_service *service, struct sv_exchange *exchange);  /* DELETE */
void sv_cells_page_build(struct sv_service *service, struct sv_exchange *exchange); /* POST */

/* Counters and gauges as of now. */
void sv_cells_measure(struct sv_service *service);

#endif
