/* settings.h - what an operator can set: one table of rows gives parser, --help, the sample file and this
 * struct's values.
 *
 * Order, later wins: default, file (--config), environment (SILVISTA_<KEY>), flag (--key-with-dashes). An
 * unknown key or a value out of range fails with an error that names the key, the value, the range and where
 * it was set; all of them at once. Nothing here starts anything. */
#ifndef SV_SERVER_SETTINGS_H
#define SV_SERVER_SETTINGS_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#include "core/base/error.h"

enum { SV_SETTING_TEXT_MAX = 1024 };

struct sv_settings {
    char scene[SV_SETTING_TEXT_MAX];
    char listen[256];
    int64_t workers; /* resolved: >= 1 */
    char scene_program[SV_SETTING_TEXT_MAX];
    char cache_dir[SV_SETTING_TEXT_MAX];
    int64_t cache_budget_mb, picture_cache_mb, slab_budget_mb, resolve_cache_entries;
    int64_t cells_bytes;
    char refine_samples[8]; /* digits */
    int64_t queue_limit, deadline_ms, deadline_max_ms, drain_ms;
    int64_t max_pixels, max_samples_pixels, max_body_bytes, max_url_bytes, max_header_bytes;
    int64_t connections, connections_per_address;
    int64_t accept_deadline_ms, request_read_deadline_ms, keep_alive_s, send_deadline_ms;
    int64_t worker_max_views, worker_max_mb;
    char public_url[SV_SETTING_TEXT_MAX];
    char admin_token[256];
    char cors_origin[256];
    char tls_cert[SV_SETTING_TEXT_MAX], tls_key[SV_SETTING_TEXT_MAX];
    char log_level[16];
    bool access_log;
    char test_hooks_dir[SV_SETTING_TEXT_MAX]; /* with SILVISTA_TEST_HOOKS=1 only */
};

/* What the command line asks for besides settings. */
enum sv_command {
    SV_COMMAND_SERVE,
    SV_COMMAND_HELP,
    SV_COMMAND_VERSION,
    SV_COMMAND_CHECK,  /* --check-config */
    SV_COMMAND_SAMPLE, /* --print-config */
    SV_COMMAND_RENDER  /* --render VIEW.json -o OUT */
};

struct sv_command_line {
    enum sv_command command;
    char render_view[SV_SETTING_TEXT_MAX], render_out[SV_SETTING_TEXT_MAX];
};

/* Reads everything in order. environment: NULL-terminated NAME=VALUE, as environ. argv[0] is skipped. On
 * errors the list is not empty and the status is that of the first; settings and line then hold no promise.
 * Variables that a cluster puts there for a service named silvista (SILVISTA_PORT..., SILVISTA_SERVICE_...)
 * are no settings. */
SV_MUST_CHECK enum sv_status sv_settings_read(int argc, char *const *argv, char *const *environment,
                                              struct sv_settings *settings, struct sv_command_line *line,
                                              struct sv_errors *errors);
/* What a run needs beyond legal values: a scene, both TLS files or none. Adds to errors. */
void sv_settings_check_run(const struct sv_settings *settings, struct sv_errors *errors);

void sv_settings_print_help(FILE *out);
void sv_settings_print_sample(FILE *out); /* deploy/silvistad.conf */

#endif
