/* pages.h - the small endpoints: what the service says of itself, the scene's document, reload, and a page
 * for people. */
#ifndef SV_SERVER_PAGES_H
#define SV_SERVER_PAGES_H

#include "server/daemon/service.h"

void sv_page_home(struct sv_service *service, struct sv_exchange *exchange);
void sv_page_scene(struct sv_service *service, struct sv_exchange *exchange);
void sv_page_reload(struct sv_service *service, struct sv_exchange *exchange);
void sv_page_patch(struct sv_service *service, struct sv_exchange *exchange);
void sv_page_livez(struct sv_service *service, struct sv_exchange *exchange);
void sv_page_readyz(struct sv_service *service, struct sv_exchange *exchange);
void sv_page_metrics(struct sv_service *service, struct sv_exchange *exchange);
void sv_page_openapi(struct sv_service *service, struct sv_exchange *exchange);

/* Answers the reload or patch that waits, if one does: reasons NULL for success. */
void sv_page_scene_done(struct sv_service *service, const struct sv_errors *reasons);

/* Is `field` (an Authorization header, may be NULL) "Bearer TOKEN"? Takes the same time wherever they differ.
 */
bool sv_page_token_fits(const char *field, const char *token);
/* May it do what needs the admin token? False, with the answer given: it may not. */
bool sv_page_is_admin(struct sv_service *service, struct sv_exchange *exchange);

#endif
