#include "server/daemon/http.h"

#include <ctype.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "server/daemon/http_private.h"
#include "server/daemon/listen.h"
#include "server/log.h"

/* libmicrohttpd's memory for one connection: request line and fields, then the answer's fields. Ours are
 * under 8 KiB. */
enum { ANSWER_FIELDS_BYTES = 16384 };
/* Bodies over the limit without a Content-Length are read and thrown away up to here, so that 413 can be
 * said. */
enum { DISCARD_BYTES = 1 << 20 };
/* How soon to look again at a half-closed connection whose last bytes libmicrohttpd has not taken yet. */
static const double look_again_ms = 5;

static void cut(void *context)
{
    struct sv_connection *connection = context;
    sv_metrics_count(connection->http->options.metrics, SV_COUNT_CONNECTION_CUT);
    shutdown(connection->fd, SHUT_RDWR); /* libmicrohttpd sees the end and cleans up */
}

static void set_deadline(struct sv_connection *connection, double ms_from_now)
{
    if (sv_loop_arm(connection->http->options.loop, &connection->deadline, sv_loop_now_ms() + ms_from_now) !=
        SV_OK)
        cut(connection);
}

static void clear_deadline(struct sv_connection *connection)
{
    sv_loop_disarm(connection->http->options.loop, &connection->deadline);
}

/* ---- connections ---- */

static void tell_owner_gone(struct sv_exchange *exchange);

static void end_connection(struct sv_connection *connection)
{
    struct sv_exchange *exchange = connection->exchange;
    shutdown(connection->fd, SHUT_RDWR);
    if (!exchange || !exchange->private_->suspended)
        return;
    exchange->private_->suspended = false;
    connection->http->run_now = true;
    MHD_resume_connection(connection->mhd);
}

/* The peer has closed its side. libmicrohttpd is not told while the exchange is suspended, and misses it when
 * the end came together with the last bytes (its edge-triggered event is spent on those). A request that
 * waits for its answer is given up, one that can never be whole is ended, one that is being answered is left
 * alone. */
static void look_at_half_closed(void *context)
{
    struct sv_connection *connection = context;
    struct sv_exchange *exchange = connection->exchange;
    char byte;
    if (exchange && exchange->private_->answered)
        return; /* on_completed looks again */
    if (exchange && exchange->private_->dispatched) {
        tell_owner_gone(exchange);
        end_connection(connection);
        return;
    }
    if (recv(connection->fd, &byte, 1, MSG_PEEK | MSG_DONTWAIT) <= 0)
        end_connection(connection);
    else if (sv_loop_arm(connection->http->options.loop, &connection->look,
                         sv_loop_now_ms() + look_again_ms) != SV_OK)
        end_connection(connection);
}

static void on_peer_closed(void *context, uint32_t events)
{
    struct sv_connection *connection = context;
    (void)events;
    connection->half_closed = true;
    look_at_half_closed(connection);
}

static void connection_opens(struct sv_http *http, struct MHD_Connection *mhd, void **slot)
{
    struct sv_connection *connection = calloc(1, sizeof *connection);
    const union MHD_ConnectionInfo *info = MHD_get_connection_info(mhd, MHD_CONNECTION_INFO_CONNECTION_FD);
    http->connections++;
    *slot = connection;
    if (!connection || !info)
        return;
    *connection = (struct sv_connection){.http = http, .mhd = mhd, .fd = info->connect_fd};
    connection->deadline = (struct sv_timer){.due = cut, .context = connection};
    connection->look = (struct sv_timer){.due = look_at_half_closed, .context = connection};
    struct sv_error error;
    if (sv_loop_watch(http->options.loop, connection->fd, EPOLLRDHUP | EPOLLET, on_peer_closed, connection,
                      &connection->watch, &error) != SV_OK)
        sv_log(SV_LOG_WARNING, "connection", "%s",
               error.message); /* its end is then noticed by its deadlines */
    set_deadline(connection, (double)http->options.settings->accept_deadline_ms);
}

static void on_connection(void *context, struct MHD_Connection *mhd, void **slot,
                          enum MHD_ConnectionNotificationCode code)
{
    struct sv_http *http = context;
    if (code == MHD_CONNECTION_NOTIFY_STARTED) {
        connection_opens(http, mhd, slot);
        return;
    }
    struct sv_connection *connection = *slot;
    http->connections--;
    http->run_now =
        true; /* at its limit libmicrohttpd looks for new connections only at the start of a run */
    if (!connection)
        return;
    clear_deadline(connection);
    sv_loop_disarm(http->options.loop, &connection->look);
    sv_loop_unwatch(http->options.loop, connection->watch);
    free(connection);
    *slot = NULL;
}

/* ---- the life of an exchange ---- */

static struct sv_exchange *exchange_create(struct sv_connection *connection, const char *target)
{
    struct sv_exchange *exchange = calloc(1, sizeof *exchange);
    struct sv_exchange_private *p = calloc(1, sizeof *p);
    char *copy = strdup(target ? target : "");
    if (!exchange || !p || !copy) {
        free(exchange);
        free(p);
        free(copy);
        return NULL;
    }
    struct sv_http *http = connection->http;
    exchange->private_ = p;
    exchange->arrival_ms = sv_loop_now_ms();
    exchange->route = "none";
    sv_api_headers_init(&exchange->headers);
    for (int s = 0; s < SV_STAGE_COUNT; s++)
        exchange->timings.ms[s] = -1;
    *p = (struct sv_exchange_private){.connection = connection, .target = copy, .next = http->exchanges};
    if (p->next)
        p->next->private_->previous = exchange;
    http->exchanges = exchange;
    http->active++;
    connection->exchange = exchange;
    return exchange;
}

static void exchange_destroy(struct sv_exchange *exchange)
{
    struct sv_exchange_private *p = exchange->private_;
    struct sv_http *http = p->connection->http;
    *(p->previous ? &p->previous->private_->next : &http->exchanges) = p->next;
    if (p->next)
        p->next->private_->previous = p->previous;
    http->active--;
    p->connection->exchange = NULL;
    sv_exchange_finish(exchange);
    free(p);
    free(exchange);
}

static struct sv_connection *connection_of(struct MHD_Connection *mhd)
{
    const union MHD_ConnectionInfo *info = MHD_get_connection_info(mhd, MHD_CONNECTION_INFO_SOCKET_CONTEXT);
    return info ? info->socket_context : NULL;
}

/* The request line is there: this is when a request begins. */
static void *on_request_line(void *context, const char *target, struct MHD_Connection *mhd)
{
    struct sv_http *http = context;
    struct sv_connection *connection = connection_of(mhd);
    if (!connection || connection->exchange)
        return NULL;
    double left_ms = (double)http->options.settings->request_read_deadline_ms;
    if (connection->deadline.place && connection->deadline.at_ms - sv_loop_now_ms() < left_ms)
        left_ms = connection->deadline.at_ms - sv_loop_now_ms();
    set_deadline(connection, left_ms);
    return exchange_create(connection, target);
}

static void log_access(struct sv_exchange *exchange, bool whole)
{
    struct sv_http *http = exchange->private_->connection->http;
    double ms = sv_loop_now_ms() - exchange->arrival_ms;
    sv_metrics_request(http->options.metrics, exchange->route, exchange->status, ms * 1e-3,
                       whole && !exchange->head ? exchange->answer_bytes : 0);
    if (!http->options.settings->access_log)
        return;
    struct sv_log_line line;
    sv_log_begin(&line, SV_LOG_INFO, "request");
    if (line.off)
        return;
    sv_log_text(&line, "id", exchange->trace.request_id);
    if (exchange->trace.continued)
        sv_log_text(&line, "traceparent", exchange->trace.traceparent);
    sv_log_text(&line, "method", exchange->head ? "HEAD" : exchange->method);
    sv_log_whole(&line, "status", exchange->status);
    sv_log_whole(&line, "bytes", (int64_t)exchange->answer_bytes);
    sv_log_number(&line, "ms", ms);
    if (exchange->timings.ms[SV_STAGE_QUEUE] >= 0)
        sv_log_number(&line, "queue_ms", exchange->timings.ms[SV_STAGE_QUEUE]);
    if (exchange->timings.ms[SV_STAGE_NEAR] >= 0)
        sv_log_number(&line, "near_ms", exchange->timings.ms[SV_STAGE_NEAR]);
    if (exchange->timings.ms[SV_STAGE_ENCODE] >= 0)
        sv_log_number(&line, "encode_ms", exchange->timings.ms[SV_STAGE_ENCODE]);
    sv_log_text(&line, "outcome", whole ? "sent" : exchange->private_->gone ? "client gone" : "not sent");
    sv_log_text(&line, "target", exchange->private_->target);
    sv_log_end(&line);
}

static void tell_owner_gone(struct sv_exchange *exchange)
{
    struct sv_exchange_private *p = exchange->private_;
    if (!p->dispatched || p->answered || p->gone)
        return;
    p->gone = true;
    exchange->status = 499; /* in logs and metrics only: the client left */
    sv_metrics_count(p->connection->http->options.metrics, SV_COUNT_CLIENT_GONE);
    if (exchange->gone)
        exchange->gone(exchange);
}

static void on_completed(void *context, struct MHD_Connection *mhd, void **slot,
                         enum MHD_RequestTerminationCode code)
{
    struct sv_http *http = context;
    struct sv_exchange *exchange = *slot;
    (void)mhd;
    *slot = NULL;
    if (!exchange)
        return;
    struct sv_connection *connection = exchange->private_->connection;
    tell_owner_gone(exchange);
    log_access(exchange, code == MHD_REQUEST_TERMINATED_COMPLETED_OK && exchange->private_->answered);
    exchange_destroy(exchange);
    set_deadline(connection, (double)(http->options.settings->keep_alive_s * 1000 +
                                      http->options.settings->accept_deadline_ms));
    if (connection->half_closed &&
        sv_loop_arm(http->options.loop, &connection->look, sv_loop_now_ms()) != SV_OK)
        shutdown(connection->fd, SHUT_RDWR);
}

/* ---- a request, checked ---- */

struct framing {
    int hosts, lengths, encodings;
    bool bad_name, lengths_differ, chunked;
    const char *length;
};

static bool is_token(const char *text)
{
    for (const char *p = text; *p; p++)
        if (!isalnum((unsigned char)*p) && !strchr("!#$%&'*+-.^_`|~", *p))
            return false;
    return *text != '\0';
}

static enum MHD_Result see_field(void *context, enum MHD_ValueKind kind, const char *name, const char *value)
{
    struct framing *f = context;
    (void)kind;
    value = value ? value : "";
    f->bad_name = f->bad_name || !is_token(name);
    if (strcasecmp(name, "Host") == 0)
        f->hosts++;
    if (strcasecmp(name, "Content-Length") == 0) {
        f->lengths_differ = f->lengths_differ || (f->length && strcmp(f->length, value) != 0);
        f->length = value;
        f->lengths++;
    }
    if (strcasecmp(name, "Transfer-Encoding") == 0) {
        f->encodings++;
        f->chunked = strcasecmp(value, "chunked") == 0;
    }
    return MHD_YES;
}

/* Splits the target (origin form, absolute form or *) into path and query. False when it is none of them. */
static bool split_target(struct sv_exchange *exchange)
{
    const char *start = exchange->private_->target;
    for (const char *p = start; *p; p++)
        if (*p <= 0x20 || *p == 0x7F)
            return false;
    if (strncasecmp(start, "http://", 7) == 0 || strncasecmp(start, "https://", 8) == 0) {
        start = strstr(start, "://") + 3;
        start += strcspn(start, "/?");
    }
    size_t path_bytes = strcspn(start, "?");
    exchange->path = path_bytes ? strndup(start, path_bytes) : strdup("/");
    if (start[path_bytes] == '?') {
        exchange->query = start + path_bytes + 1;
        exchange->query_bytes = strlen(exchange->query);
    }
    return exchange->path && (exchange->path[0] == '/' || strcmp(exchange->path, "*") == 0);
}

static const char *framing_fault(const struct framing *f, const char *version)
{
    bool http11 = strcmp(version, "HTTP/1.1") == 0;
    if (f->bad_name)
        return "a header field's name has characters that no name may have";
    if ((http11 && f->hosts == 0) || f->hosts > 1)
        return f->hosts ? "more than one Host header" : "HTTP/1.1 needs a Host header";
    if (f->encodings && f->lengths)
        return "Transfer-Encoding and Content-Length exclude each other";
    if (f->encodings > 1 || (f->encodings && (!f->chunked || !http11)))
        return "the only Transfer-Encoding is chunked, in HTTP/1.1";
    if (f->lengths_differ)
        return "several Content-Length headers that differ";
    return NULL;
}

static void refuse(struct sv_exchange *exchange, enum sv_problem_kind kind, const char *detail)
{
    struct sv_http *http = exchange->private_->connection->http;
    exchange->close = true;
    exchange->private_->dispatched = true;
    http->options.refuse(http->options.context, exchange, kind, detail);
}

/* The header fields are there, the body is not. Refuses what cannot be read on. */
static void begin(struct sv_exchange *exchange, const char *method, const char *version)
{
    struct sv_exchange_private *p = exchange->private_;
    struct sv_http *http = p->connection->http;
    const struct sv_settings *settings = http->options.settings;
    struct framing framing = {0};
    p->begun = true;
    sv_exchange_identify(exchange);
    exchange->head = strcmp(method, "HEAD") == 0;
    exchange->method = strdup(exchange->head ? "GET" : method);
    MHD_get_connection_values(p->connection->mhd, MHD_HEADER_KIND, see_field, &framing);
    const char *fault = framing_fault(&framing, version);
    const union MHD_ConnectionInfo *fields =
        MHD_get_connection_info(p->connection->mhd, MHD_CONNECTION_INFO_REQUEST_HEADER_SIZE);
    bool target_is_good = split_target(exchange);
    exchange->has_length = framing.lengths || framing.encodings;
    if (strlen(p->target) > (size_t)settings->max_url_bytes)
        refuse(exchange, SV_PROBLEM_URI, "the target is longer than max_url_bytes");
    else if (fields && fields->header_size > (size_t)settings->max_header_bytes)
        refuse(exchange, SV_PROBLEM_HEADERS, "the header fields are longer than max_header_bytes");
    else if (fault || !target_is_good || !exchange->method || !is_token(method))
        refuse(exchange, SV_PROBLEM_BAD_REQUEST, fault ? fault : "the request line is not legal");
    else if (framing.length &&
             strtoull(framing.length, NULL, 10) > (unsigned long long)settings->max_body_bytes)
        refuse(exchange, SV_PROBLEM_TOO_LARGE, "the body is longer than max_body_bytes");
}

static enum MHD_Result take_body(struct sv_exchange *exchange, const char *bytes, size_t *size)
{
    struct sv_exchange_private *p = exchange->private_;
    size_t limit = (size_t)p->connection->http->options.settings->max_body_bytes, more = *size;
    *size = 0;
    if (exchange->body_bytes + more > limit || p->body_too_large) {
        p->body_too_large = true;
        exchange->body_bytes += more;
        return exchange->body_bytes > limit + DISCARD_BYTES ? MHD_NO : MHD_YES;
    }
    if (exchange->body_bytes + more + 1 > p->body_room) {
        size_t room = 2 * p->body_room > exchange->body_bytes + more + 1 ? 2 * p->body_room
                                                                         : exchange->body_bytes + more + 1;
        char *body = realloc(exchange->body, room);
        if (!body)
            return MHD_NO;
        exchange->body = body;
        p->body_room = room;
    }
    memcpy(exchange->body + exchange->body_bytes, bytes, more);
    exchange->body_bytes += more;
    exchange->body[exchange->body_bytes] = '\0';
    return MHD_YES;
}

static enum MHD_Result send_answer(struct sv_exchange *exchange)
{
    struct sv_connection *connection = exchange->private_->connection;
    struct MHD_Response *response = sv_exchange_response(exchange);
    if (!response)
        return MHD_NO;
    enum MHD_Result queued = MHD_queue_response(connection->mhd, exchange->status, response);
    MHD_destroy_response(response);
    set_deadline(connection, (double)connection->http->options.settings->send_deadline_ms +
                                 (double)exchange->answer_bytes / 65.536);
    return queued;
}

/* The request is whole: to the handler, then to the client or to sleep. */
static enum MHD_Result dispatch(struct sv_exchange *exchange)
{
    struct sv_exchange_private *p = exchange->private_;
    struct sv_http *http = p->connection->http;
    if (!p->dispatched && p->body_too_large) {
        refuse(exchange, SV_PROBLEM_TOO_LARGE, "the body is longer than max_body_bytes");
    } else if (!p->dispatched) {
        p->dispatched = true;
        clear_deadline(p->connection);
        http->options.handler(http->options.context, exchange);
    }
    if (p->connection->half_closed)
        tell_owner_gone(exchange);
    if (p->gone)
        return MHD_NO;
    if (p->answered)
        return send_answer(exchange);
    p->suspended = true;
    MHD_suspend_connection(p->connection->mhd);
    return MHD_YES;
}

static enum MHD_Result on_access(void *context, struct MHD_Connection *mhd, const char *url,
                                 const char *method, const char *version, const char *upload,
                                 size_t *upload_bytes, void **slot)
{
    struct sv_exchange *exchange = *slot;
    (void)context;
    (void)mhd;
    (void)url;
    if (!exchange)
        return MHD_NO;
    if (!exchange->private_->begun) {
        begin(exchange, method, version);
        return exchange->private_->answered ? send_answer(exchange) : MHD_YES;
    }
    if (*upload_bytes)
        return take_body(exchange, upload, upload_bytes);
    return dispatch(exchange);
}

void sv_exchange_answer(struct sv_exchange *exchange, unsigned status)
{
    struct sv_exchange_private *p = exchange->private_;
    if (p->gone || p->answered)
        return;
    exchange->status = status;
    p->answered = true;
    struct sv_http *http = p->connection->http;
    if (p->suspended) {
        p->suspended = false;
        http->run_now = true;
        MHD_resume_connection(p->connection->mhd);
    }
}

/* ---- the daemon in the loop ---- */

static void on_ready(void *context, uint32_t events)
{
    struct sv_http *http = context;
    (void)events;
    MHD_run(http->daemon);
}

static double before_wait(void *context)
{
    struct sv_http *http = context;
    MHD_UNSIGNED_LONG_LONG ms = 0;
    enum MHD_Result timed = MHD_get_timeout(http->daemon, &ms);
    if (http->run_now || (timed == MHD_YES && ms == 0)) {
        http->run_now = false;
        MHD_run(http->daemon);
        timed = MHD_get_timeout(http->daemon, &ms);
    }
    if (http->run_now)
        return 0;
    return timed == MHD_YES ? (double)ms : -1;
}

static void log_mhd(void *context, const char *format, va_list args)
{
    char text[512];
    (void)context;
    if (!sv_log_on(SV_LOG_DEBUG))
        return;
    vsnprintf(text, sizeof text, format, args);
    text[strcspn(text, "\n")] = '\0';
    sv_log(SV_LOG_DEBUG, "libmicrohttpd", "%s", text);
}

static struct MHD_Daemon *start_daemon(struct sv_http *http)
{
    const struct sv_settings *s = http->options.settings;
    bool tls = http->options.tls_cert && http->options.tls_key;
    unsigned flags = MHD_USE_EPOLL | MHD_ALLOW_SUSPEND_RESUME | MHD_USE_ERROR_LOG | (tls ? MHD_USE_TLS : 0);
    size_t memory = (size_t)(s->max_header_bytes + s->max_url_bytes) + ANSWER_FIELDS_BYTES;
    struct MHD_OptionItem certificate[] = {
        {MHD_OPTION_HTTPS_MEM_CERT, 0, (void *)(uintptr_t)http->options.tls_cert},
        {MHD_OPTION_HTTPS_MEM_KEY, 0, (void *)(uintptr_t)http->options.tls_key},
        {MHD_OPTION_END, 0, NULL}};
    struct MHD_OptionItem nothing[] = {{MHD_OPTION_END, 0, NULL}};
    return MHD_start_daemon(flags, 0, NULL, NULL, on_access, http, MHD_OPTION_EXTERNAL_LOGGER, log_mhd, NULL,
                            MHD_OPTION_LISTEN_SOCKET, http->listen_fd, MHD_OPTION_NOTIFY_CONNECTION,
                            on_connection, http, MHD_OPTION_NOTIFY_COMPLETED, on_completed, http,
                            MHD_OPTION_URI_LOG_CALLBACK, on_request_line, http, MHD_OPTION_CONNECTION_LIMIT,
                            (unsigned)s->connections, MHD_OPTION_PER_IP_CONNECTION_LIMIT,
                            (unsigned)s->connections_per_address, MHD_OPTION_CONNECTION_TIMEOUT,
                            (unsigned)s->keep_alive_s, MHD_OPTION_CONNECTION_MEMORY_LIMIT, memory,
                            MHD_OPTION_ARRAY, tls ? certificate : nothing, MHD_OPTION_END);
}

enum sv_status sv_http_create(const struct sv_http_options *options, struct sv_http **out,
                              struct sv_error *error)
{
    struct sv_http *http = calloc(1, sizeof *http);
    if (!http)
        return sv_fail(error, SV_ENOMEM, "listen", "out of memory");
    http->options = *options;
    http->listen_fd = -1;
    enum sv_status status = sv_listen(options->settings->listen, &http->listen_fd, &http->port, error);
    if (status == SV_OK) {
        http->daemon = start_daemon(http);
        if (!http->daemon)
            status = sv_fail(error, SV_EIO, options->tls_cert ? "tls_cert" : "listen",
                             "the HTTP library does not start%s",
                             options->tls_cert ? " (are certificate and key a pair, in PEM?)" : "");
    }
    if (status == SV_OK) {
        int fd = MHD_get_daemon_info(http->daemon, MHD_DAEMON_INFO_EPOLL_FD)->epoll_fd;
        status = sv_loop_watch(options->loop, fd, EPOLLIN, on_ready, http, &http->watch, error);
    }
    if (status != SV_OK) {
        sv_http_destroy(http);
        return status;
    }
    sv_loop_set_before_wait(options->loop, before_wait, http);
    *out = http;
    return SV_OK;
}

void sv_http_destroy(struct sv_http *http)
{
    if (!http)
        return;
    sv_loop_unwatch(http->options.loop, http->watch);
    if (http->daemon) {
        MHD_run(http->daemon);         /* what was answered last is resumed, as stopping wants it */
        MHD_stop_daemon(http->daemon); /* closes the listening socket, unless it was drained */
    }
    if (http->listen_fd >= 0 && (!http->daemon || http->draining))
        close(http->listen_fd);
    free(http);
}

unsigned sv_http_port(const struct sv_http *http)
{
    return http->port;
}

size_t sv_http_connections(const struct sv_http *http)
{
    return http->connections;
}

size_t sv_http_active(const struct sv_http *http)
{
    return http->active;
}

void sv_http_drain(struct sv_http *http)
{
    if (http->draining)
        return;
    http->draining = true;
    MHD_quiesce_daemon(http->daemon);
    close(http->listen_fd);
    http->listen_fd = -1;
}

void sv_http_each_kept(struct sv_http *http, sv_exchange_call call, void *context)
{
    struct sv_exchange *next;
    for (struct sv_exchange *e = http->exchanges; e; e = next) {
        next = e->private_->next; /* answering frees nothing: that is on_completed's */
        if (e->private_->dispatched && !e->private_->answered && !e->private_->gone)
            call(context, e);
    }
}
