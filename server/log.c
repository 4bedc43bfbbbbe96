#include "server/log.h"

#include <errno.h>
#include <math.h>
#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

static const char *process_name = "silvista";
static enum sv_log_level level_limit = SV_LOG_INFO;
static uint64_t dropped;

enum { TAIL_BYTES = 16 }; /* room kept for the end of a cut line: ,"cut":true} and a newline */

void sv_log_init(const char *process, enum sv_log_level level)
{
    process_name = process;
    level_limit = level;
}

bool sv_log_on(enum sv_log_level level)
{
    return level <= level_limit;
}

uint64_t sv_log_dropped(void)
{
    return dropped;
}

/* Appends all of it or nothing. */
static bool append(struct sv_log_line *line, const char *text, size_t bytes)
{
    if (line->used + bytes > sizeof line->text - TAIL_BYTES) {
        line->cut = true;
        return false;
    }
    memcpy(line->text + line->used, text, bytes);
    line->used += bytes;
    return true;
}

/* Bytes of the UTF-8 sequence at p (1..4), or 0 when there is none. */
static size_t utf8_sequence(const unsigned char *p)
{
    static const unsigned least[] = {0, 0, 0x80, 0x800, 0x10000};
    if (p[0] < 0x80)
        return 1;
    size_t n = p[0] >= 0xF0 && p[0] < 0xF5   ? 4
               : p[0] >= 0xE0 && p[0] < 0xF0 ? 3
               : p[0] >= 0xC2 && p[0] < 0xE0 ? 2
                                             : 0;
    if (n == 0)
        return 0;
    unsigned code = p[0] & (0xFFu >> (n + 1));
    for (size_t i = 1; i < n; i++) {
        if ((p[i] & 0xC0) != 0x80)
            return 0;
        code = code << 6 | (p[i] & 0x3Fu);
    }
    return code < least[n] || code > 0x10FFFF || (code >= 0xD800 && code < 0xE000) ? 0 : n;
}

static bool append_quoted(struct sv_log_line *line, const char *value)
{
    bool fits = append(line, "\"", 1);
    for (const unsigned char *p = (const unsigned char *)value; fits && *p;) {
        char escaped[8];
        size_t n = utf8_sequence(p);
        if (n == 0 || *p < 0x20 || *p == 0x7F) {
            fits = append(line, escaped, (size_t)snprintf(escaped, sizeof escaped, "\\u%04x", *p));
            p++;
        } else if (*p == '"' || *p == '\\') {
            escaped[0] = '\\';
            escaped[1] = (char)*p++;
            fits = append(line, escaped, 2);
        } else {
            fits = append(line, (const char *)p, n);
            p += n;
        }
    }
    return fits && append(line, "\"", 1);
}

static bool append_key(struct sv_log_line *line, const char *key)
{
    return append(line, ",\"", 2) && append(line, key, strlen(key)) && append(line, "\":", 2);
}

void sv_log_begin(struct sv_log_line *line, enum sv_log_level level, const char *event)
{
    static const char *const names[] = {
#define X(name, text) [name] = text,
        SV_LOG_LEVEL_LIST(X)
#undef X
    };
    line->used = 0;
    line->cut = false;
    line->off = level > level_limit;
    if (line->off)
        return;
    struct timespec now;
    struct tm utc;
    clock_gettime(CLOCK_REALTIME, &now);
    gmtime_r(&now.tv_sec, &utc);
    char head[192];
    int n = snprintf(
        head, sizeof head,
        "{\"time\":\"%04d-%02d-%02dT%02d:%02d:%02d.%03ldZ\",\"level\":\"%s\",\"process\":\"%s\",\"pid\":%d",
        utc.tm_year + 1900, utc.tm_mon + 1, utc.tm_mday, utc.tm_hour, utc.tm_min, utc.tm_sec,
        now.tv_nsec / 1000000, names[level], process_name, (int)getpid());
    append(line, head, (size_t)n);
    sv_log_text(line, "event", event);
}

void sv_log_text(struct sv_log_line *line, const char *key, const char *value)
{
    if (line->off)
        return;
    size_t before = line->used;
    if (!append_key(line, key) || !(value ? append_quoted(line, value) : append(line, "null", 4)))
        line->used = before;
}

static void append_raw(struct sv_log_line *line, const char *key, const char *value)
{
    size_t before = line->used;
    if (!append_key(line, key) || !append(line, value, strlen(value)))
        line->used = before;
}

void sv_log_number(struct sv_log_line *line, const char *key, double value)
{
    char text[40] = "null";
    if (line->off)
        return;
    if (isfinite(value))
        snprintf(text, sizeof text, "%.6g", value);
    append_raw(line, key, text);
}

void sv_log_whole(struct sv_log_line *line, const char *key, int64_t value)
{
    char text[40];
    if (line->off)
        return;
    snprintf(text, sizeof text, "%lld", (long long)value);
    append_raw(line, key, text);
}

void sv_log_end(struct sv_log_line *line)
{
    if (line->off)
        return;
    int n = snprintf(line->text + line->used, sizeof line->text - line->used, "%s}\n",
                     line->cut ? ",\"cut\":true" : "");
    size_t bytes = line->used + (size_t)n;
    /* A pipe that polls writable takes PIPE_BUF (4096) bytes at once: the write cannot block. */
    struct pollfd out = {.fd = STDERR_FILENO, .events = POLLOUT};
    if (poll(&out, 1, 0) != 1 || !(out.revents & POLLOUT) || write(STDERR_FILENO, line->text, bytes) < 0)
        dropped++;
}

void sv_log(enum sv_log_level level, const char *event, const char *format, ...)
{
    if (!sv_log_on(level))
        return;
    struct sv_log_line line;
    char message[1024];
    va_list args;
    va_start(args, format);
    vsnprintf(message, sizeof message, format, args);
    va_end(args);
    sv_log_begin(&line, level, event);
    sv_log_text(&line, "message", message);
    sv_log_end(&line);
}
