/* reply.h - answers that are made in one go: problem documents and texts. */
#ifndef SV_SERVER_REPLY_H
#define SV_SERVER_REPLY_H

#include "api/problem.h"
#include "server/daemon/http.h"

/* Answers with the problem; request_id is filled in. */
void sv_reply(struct sv_exchange *exchange, const struct sv_problem *problem);
/* detail may be NULL. */
void sv_reply_problem(struct sv_exchange *exchange, enum sv_problem_kind kind, const char *detail);
void sv_reply_retry(struct sv_exchange *exchange, enum sv_problem_kind kind, const char *detail,
                    int retry_after_s);
/* Takes the heap text (NULL: out of memory, 500). etag may be NULL; with one, If-None-Match is honoured. */
void sv_reply_document(struct sv_exchange *exchange, const char *media, const char *etag, char *text);

#endif
