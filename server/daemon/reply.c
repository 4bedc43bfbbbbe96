#include "server/daemon/reply.h"

#include <stdlib.h>

#include "api/answer.h"

void sv_reply(struct sv_exchange *exchange, const struct sv_problem *problem)
{
    struct sv_problem filled = *problem;
    size_t bytes = 0;
    filled.request_id = exchange->trace.request_id;
    char *text = sv_api_problem_document(&filled, &bytes);
    sv_api_answer_problem(&filled, &exchange->headers);
    sv_exchange_set_body(exchange, text, text ? bytes : 0, text ? free : NULL, text);
    sv_exchange_answer(exchange, (unsigned)sv_api_problem_status(filled.kind));
}

void sv_reply_problem(struct sv_exchange *exchange, enum sv_problem_kind kind, const char *detail)
{
    struct sv_problem problem = {.kind = kind, .detail = detail};
    sv_reply(exchange, &problem);
}

void sv_reply_retry(struct sv_exchange *exchange, enum sv_problem_kind kind, const char *detail,
                    int retry_after_s)
{
    struct sv_problem problem = {.kind = kind, .detail = detail, .retry_after_s = retry_after_s};
    sv_reply(exchange, &problem);
}

void sv_reply_document(struct sv_exchange *exchange, const char *media, const char *etag, char *text)
{
    if (!text) {
        sv_reply_problem(exchange, SV_PROBLEM_INTERNAL, "out of memory");
        return;
    }
    sv_api_answer_document(media, etag, &exchange->headers);
    char *asked = etag ? sv_exchange_fields(exchange, "If-None-Match") : NULL;
    bool same = asked && sv_api_etag_matches(asked, etag);
    free(asked);
    if (same) {
        free(text);
        sv_exchange_answer(exchange, 304);
        return;
    }
    sv_exchange_take_text(exchange, text);
    sv_exchange_answer(exchange, 200);
}
