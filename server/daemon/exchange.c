/* exchange.c - reading a request's fields and building its answer (http.h). */
#include "server/daemon/http.h"

#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/random.h>

#include "server/daemon/http_private.h"
#include "server/log.h"

const char *sv_exchange_field(struct sv_exchange *exchange, const char *name)
{
    return MHD_lookup_connection_value(exchange->private_->connection->mhd, MHD_HEADER_KIND, name);
}

struct joined {
    const char *name;
    char *text;
    size_t bytes;
};

static enum MHD_Result join_field(void *context, enum MHD_ValueKind kind, const char *name, const char *value)
{
    struct joined *joined = context;
    (void)kind;
    if (strcasecmp(name, joined->name) != 0)
        return MHD_YES;
    size_t more = value ? strlen(value) : 0;
    char *text = realloc(joined->text, joined->bytes + more + 3);
    if (!text)
        return MHD_NO;
    if (joined->bytes) {
        memcpy(text + joined->bytes, ", ", 2);
        joined->bytes += 2;
    }
    if (more)
        memcpy(text + joined->bytes, value, more);
    joined->bytes += more;
    text[joined->bytes] = '\0';
    joined->text = text;
    return MHD_YES;
}

char *sv_exchange_fields(struct sv_exchange *exchange, const char *name)
{
    struct joined joined = {.name = name};
    MHD_get_connection_values(exchange->private_->connection->mhd, MHD_HEADER_KIND, join_field, &joined);
    return joined.text;
}

static void drop_body(struct sv_exchange *exchange)
{
    if (exchange->release)
        exchange->release(exchange->release_context);
    exchange->release = NULL;
    exchange->answer = NULL;
    exchange->answer_bytes = 0;
}

void sv_exchange_set_body(struct sv_exchange *exchange, const void *bytes, size_t size,
                          void (*release)(void *), void *context)
{
    drop_body(exchange);
    exchange->answer = bytes;
    exchange->answer_bytes = size;
    exchange->release = release;
    exchange->release_context = context;
}

void sv_exchange_take_text(struct sv_exchange *exchange, char *text)
{
    sv_exchange_set_body(exchange, text, text ? strlen(text) : 0, text ? free : NULL, text);
}

/* Random bytes come from the kernel a page at a time. */
static const uint8_t *random_bytes(struct sv_http *http)
{
    if (http->random_left < SV_TRACE_RANDOM_BYTES) {
        /* Before the kernel's pool is ready the last bytes serve again: ids are for finding things, not
         * secrets. */
        ssize_t got = getrandom(http->random, sizeof http->random, GRND_NONBLOCK);
        http->random_left = got > 0 ? (size_t)got : sizeof http->random;
    }
    http->random_left -=
        http->random_left < SV_TRACE_RANDOM_BYTES ? http->random_left : SV_TRACE_RANDOM_BYTES;
    return http->random + http->random_left;
}

void sv_exchange_identify(struct sv_exchange *exchange)
{
    sv_api_trace(sv_exchange_field(exchange, "X-Request-Id"), sv_exchange_field(exchange, "traceparent"),
                 random_bytes(exchange->private_->connection->http), &exchange->trace);
}

static void add_common(struct sv_exchange *exchange)
{
    struct sv_http *http = exchange->private_->connection->http;
    const char *origin = http->options.settings->cors_origin;
    exchange->timings.ms[SV_STAGE_TOTAL] = sv_loop_now_ms() - exchange->arrival_ms;
    struct sv_answer_common common = {
        .trace = &exchange->trace, .timings = &exchange->timings, .cors_origin = origin[0] ? origin : NULL};
    sv_api_answer_common(&common, &exchange->headers);
    if (exchange->close || http->draining)
        sv_api_headers_set(&exchange->headers, "Connection", "close");
    if (exchange->headers.overflow)
        sv_log(SV_LOG_WARNING, "headers", "an answer's header fields did not fit and were left out");
}

struct MHD_Response *sv_exchange_response(struct sv_exchange *exchange)
{
    add_common(exchange);
    bool owned = exchange->answer_bytes && exchange->release;
    void *bytes = (void *)(uintptr_t)exchange->answer;
    struct MHD_Response *response =
        owned ? MHD_create_response_from_buffer_with_free_callback_cls(
                    exchange->answer_bytes, bytes, exchange->release, exchange->release_context)
              : MHD_create_response_from_buffer(exchange->answer_bytes, bytes, MHD_RESPMEM_PERSISTENT);
    if (!response)
        return NULL;
    if (owned)
        exchange->release = NULL; /* libmicrohttpd calls it now */
    for (int i = 0; i < exchange->headers.count; i++)
        MHD_add_response_header(response, exchange->headers.items[i].name,
                                sv_api_headers_value(&exchange->headers, i));
    return response;
}

void sv_exchange_finish(struct sv_exchange *exchange)
{
    drop_body(exchange);
    free(exchange->method);
    free(exchange->path);
    free(exchange->body);
    free(exchange->private_->target);
}
