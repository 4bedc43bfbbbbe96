/* log.h - one JSON object a line on standard error.
 *
 * A line is built field by field in a buffer of one page, so that its one write is whole among those of the
 * scene process; fields that do not fit are left out and the line says "cut". A line never blocks the event
 * loop: when nobody reads standard error it is dropped and counted. One thread. */
#ifndef SV_SERVER_LOG_H
#define SV_SERVER_LOG_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define SV_LOG_LEVEL_LIST(X)     \
    X(SV_LOG_ERROR, "error")     \
    X(SV_LOG_WARNING, "warning") \
    X(SV_LOG_INFO, "info")       \
    X(SV_LOG_DEBUG, "debug")

enum sv_log_level {
#define X(name, text) name,
    SV_LOG_LEVEL_LIST(X)
#undef X
        SV_LOG_LEVEL_COUNT
};

enum { SV_LOG_LINE_BYTES = 4096 };

struct sv_log_line {
    size_t used;
    bool off, cut; /* off: below the level, nothing is written */
    char text[SV_LOG_LINE_BYTES];
};

/* Lines above that level are not written. process: "silvistad" or "silvista-scene", a string that stays. */
void sv_log_init(const char *process, enum sv_log_level level);
bool sv_log_on(enum sv_log_level level);
uint64_t sv_log_dropped(void);

void sv_log_begin(struct sv_log_line *line, enum sv_log_level level, const char *event);
/* value may be any bytes up to its NUL: what is not UTF-8 or is a control character is escaped. NULL: null.
 */
void sv_log_text(struct sv_log_line *line, const char *key, const char *value);
void sv_log_number(struct sv_log_line *line, const char *key, double value); /* not finite: null */
void sv_log_whole(struct sv_log_line *line, const char *key, int64_t value);
void sv_log_end(struct sv_log_line *line);

/* A line with one message. */
void sv_log(enum sv_log_level level, const char *event, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

#endif
