#include "server/daemon/settings.h"

#include <ctype.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "api/fields.h"

enum setting_type { SETTING_TEXT, SETTING_WHOLE, SETTING_SWITCH };

struct setting {
    const char *key;
    enum setting_type type;
    const char *unit;
    const char *initial; /* the default, as text */
    int64_t min, max;    /* SETTING_WHOLE; for SETTING_TEXT max is the room in bytes */
    size_t offset;
    const char *choices; /* SETTING_TEXT: "|a|b|", NULL: anything */
    const char *help;
};

#define ROOM(member) sizeof(((struct sv_settings *)0)->member)
#define TEXT(name, standard, options, says)                                                     \
    {                                                                                           \
        .key = #name, .type = SETTING_TEXT, .unit = "", .initial = standard, .max = ROOM(name), \
        .offset = offsetof(struct sv_settings, name), .choices = options, .help = says          \
    }
#define WHOLE(name, measure, standard, least, most, says)                                        \
    {                                                                                            \
        .key = #name, .type = SETTING_WHOLE, .unit = measure, .initial = standard, .min = least, \
        .max = most, .offset = offsetof(struct sv_settings, name), .help = says                  \
    }
#define SWITCH(name, standard, says)                                                      \
    {                                                                                     \
        .key = #name, .type = SETTING_SWITCH, .unit = "", .initial = standard, .max = 1,  \
        .offset = offsetof(struct sv_settings, name), .choices = "|on|off|", .help = says \
    }

static const struct setting table[] = {
    TEXT(scene, "", NULL, "scene file to serve"),
    TEXT(listen, "127.0.0.1:8080", NULL,
         "ADDRESS:PORT, [v6]:PORT or :PORT (every address); port 0 takes a free one"),
    WHOLE(workers, "processes", "0", 0, 1024, "drawing processes; 0 is one for each online CPU"),
    TEXT(scene_program, "", NULL,
         "the program that loads and draws; empty is silvista-scene beside this one"),
    TEXT(cache_dir, "", NULL,
         "what is costly to build is kept here; empty is $XDG_CACHE_HOME/silvista, else "
         "/var/cache/silvista"),
    WHOLE(cache_budget_mb, "MiB", "4096", 1, 1 << 24, "size of cache_dir"),
    WHOLE(picture_cache_mb, "MiB", "256", 0, 1 << 20, "memory for encoded pictures; 0 keeps none"),
    WHOLE(slab_budget_mb, "MiB", "1024", 1, 1 << 20,
          "memory for pictures on their way from workers to clients"),
    WHOLE(cells_bytes, "bytes", "1073741824", 0, INT64_C(1) << 40,
          "memory for relief panels of cells, which workers share; 0 draws every view directly"),
    TEXT(refine_samples, "16", "|0|1|4|16|64|",
         "rays a texel of relief panels that views keep coming back to, which idle workers draw again from the "
         "ray-cast truth: 0 (never), 1, 4, 16 or 64"),
    WHOLE(resolve_cache_entries, "views", "65536", 0, 1 << 24, "resolved cameras remembered"),
    WHOLE(queue_limit, "jobs", "64", 1, 1 << 20, "jobs that may wait; one more is answered 503"),
    WHOLE(deadline_ms, "ms", "60000", 1, 86400000,
          "from arrival to answer, unless the client says Prefer: wait=N; long enough for a picture of "
          "max_samples_pixels ray cast at 0.6 million samples a second, and some waiting"),
    WHOLE(deadline_max_ms, "ms", "300000", 1, 86400000, "the longest that a client may ask to wait"),
    WHOLE(drain_ms, "ms", "10000", 0, 3600000, "time to finish what runs after SIGTERM"),
    WHOLE(max_pixels, "px", "16777216", 256, 16777216, "width times height of a picture"),
    WHOLE(max_samples_pixels, "px", "16777216", 256, 1073741824,
          "width times height times samples: 1024 x 1024 px at the 16 samples of quality=reference. One "
          "processor casts 0.6 to 1.5 million a second, so raise deadline_ms with it"),
    WHOLE(max_body_bytes, "bytes", "65536", 64, 1 << 26, "a request's body"),
    WHOLE(max_url_bytes, "bytes", "8192", 64, 1 << 16, "a request's target"),
    WHOLE(max_header_bytes, "bytes", "16384", 512, 1 << 16, "a request's line and header fields"),
    WHOLE(connections, "connections", "1024", 1, 65536, "open at once; more wait to be accepted"),
    WHOLE(connections_per_address, "connections", "256", 0, 65536,
          "open at once from one address; 0 is no limit"),
    WHOLE(accept_deadline_ms, "ms", "10000", 10, 3600000,
          "from accepting a connection to its first whole request"),
    WHOLE(request_read_deadline_ms, "ms", "10000", 10, 3600000,
          "from a request's first line to its last byte"),
    WHOLE(keep_alive_s, "s", "60", 1, 3600, "a connection without a request is closed after this time"),
    WHOLE(send_deadline_ms, "ms", "60000", 10, 3600000,
          "to take an answer, and a second more for each 64 KiB of it"),
    WHOLE(worker_max_views, "views", "10000", 0, 1 << 30, "a worker is replaced after so many; 0 is never"),
    WHOLE(worker_max_mb, "MiB", "2048", 0, 1 << 20,
          "a worker whose own memory passes this is replaced; 0 is never"),
    TEXT(public_url, "", NULL,
         "how clients reach this service, for absolute links; empty is the Host that they used"),
    TEXT(admin_token, "", NULL,
         "bearer token of the administrative calls; empty refuses them. Prefer the file or "
         "the environment: a command line can be seen by others"),
    TEXT(cors_origin, "*", NULL, "Access-Control-Allow-Origin; empty sends no CORS header"),
    TEXT(tls_cert, "", NULL, "PEM file of the certificate chain; needs tls_key"),
    TEXT(tls_key, "", NULL, "PEM file of the private key"),
    TEXT(log_level, "info", "|error|warning|info|debug|",
         "lines on standard error: error, warning, info or debug"),
    SWITCH(access_log, "on", "one line a request: on or off"),
    TEXT(test_hooks_dir, "", NULL, ""),
};
enum { SETTING_COUNT = sizeof table / sizeof table[0] };

/* Rows without help are for the project's own tests. */
static bool is_hidden(const struct setting *row)
{
    return row->help[0] == '\0';
}

static const struct setting *find_row(const char *key)
{
    for (size_t i = 0; i < SETTING_COUNT; i++)
        if (strcmp(table[i].key, key) == 0) {
            const char *hooks = getenv("SILVISTA_TEST_HOOKS");
            return is_hidden(&table[i]) && !(hooks && strcmp(hooks, "1") == 0) ? NULL : &table[i];
        }
    return NULL;
}

/* Says that there is no such setting, and which one was likely meant. */
static void refuse_key(const char *key, const char *source, struct sv_errors *errors)
{
    const char *best = NULL;
    size_t best_distance = SIZE_MAX;
    for (size_t i = 0; i < SETTING_COUNT; i++)
        if (find_row(table[i].key))
            sv_api_name_consider(key, table[i].key, &best, &best_distance);
    if (best)
        sv_errors_add(errors, SV_EINVAL, key, "%s: no such setting: did you mean \"%s\"?", source, best);
    else
        sv_errors_add(errors, SV_EINVAL, key, "%s: no such setting: --help lists them", source);
}

static void set_text(const struct setting *row, const char *value, const char *source,
                     struct sv_settings *settings, struct sv_errors *errors)
{
    char wanted[64];
    size_t bytes = strlen(value);
    if (bytes >= (size_t)row->max) {
        sv_errors_add(errors, SV_ELIMIT, row->key, "%s: %zu bytes, at most %lld are possible", source, bytes,
                      (long long)row->max - 1);
        return;
    }
    for (size_t i = 0; i < bytes; i++)
        if (iscntrl((unsigned char)value[i])) {
            sv_errors_add(errors, SV_EINVAL, row->key, "%s: a control character at byte %zu", source, i);
            return;
        }
    if (row->choices) {
        snprintf(wanted, sizeof wanted, "|%.40s|", value);
        if (strchr(value, '|') || !strstr(row->choices, wanted)) {
            sv_errors_add(errors, SV_EINVAL, row->key, "%s: \"%.80s\" is none of %s", source, value,
                          row->choices);
            return;
        }
    }
    memcpy((char *)settings + row->offset, value, bytes + 1);
}

static void set_whole(const struct setting *row, const char *value, const char *source,
                      struct sv_settings *settings, struct sv_errors *errors)
{
    char *end;
    errno = 0;
    long long v = strtoll(value, &end, 10);
    if (end == value || *end || errno || isspace((unsigned char)value[0]) || v < row->min || v > row->max) {
        sv_errors_add(errors, SV_EINVAL, row->key, "%s: \"%.80s\" is no whole number of %s from %lld to %lld",
                      source, value, row->unit, (long long)row->min, (long long)row->max);
        return;
    }
    *(int64_t *)(void *)((char *)settings + row->offset) = v;
}

static void set_value(const struct setting *row, const char *value, const char *source,
                      struct sv_settings *settings, struct sv_errors *errors)
{
    switch (row->type) {
    case SETTING_TEXT:
        set_text(row, value, source, settings, errors);
        break;
    case SETTING_WHOLE:
        set_whole(row, value, source, settings, errors);
        break;
    case SETTING_SWITCH:
        if (strcmp(value, "on") != 0 && strcmp(value, "off") != 0)
            sv_errors_add(errors, SV_EINVAL, row->key, "%s: \"%.80s\" is neither on nor off", source, value);
        *((bool *)settings + row->offset) = strcmp(value, "on") == 0;
        break;
    }
}

static void set_key(const char *key, const char *value, const char *source, struct sv_settings *settings,
                    struct sv_errors *errors)
{
    const struct setting *row = find_row(key);
    if (row)
        set_value(row, value, source, settings, errors);
    else
        refuse_key(key, source, errors);
}

static char *trimmed(char *text)
{
    while (isspace((unsigned char)*text))
        text++;
    char *end = text + strlen(text);
    while (end > text && isspace((unsigned char)end[-1]))
        *--end = '\0';
    return text;
}

/* Lines of `key = value`; # starts a comment at the beginning of a line only, since a value may hold one. */
static void read_file(const char *path, struct sv_settings *settings, struct sv_errors *errors)
{
    FILE *file = fopen(path, "re");
    if (!file) {
        sv_errors_add(errors, SV_ENOENT, "config", "%s: %s", path, strerror(errno));
        return;
    }
    char line[SV_SETTING_TEXT_MAX + 256], source[SV_SETTING_TEXT_MAX + 32];
    for (int number = 1; fgets(line, sizeof line, file); number++) {
        snprintf(source, sizeof source, "%s:%d", path, number);
        if (!strchr(line, '\n') && !feof(file)) {
            sv_errors_add(errors, SV_ELIMIT, "config", "%s: the line is over %zu bytes", source,
                          sizeof line - 2);
            break;
        }
        char *text = trimmed(line);
        if (*text == '\0' || *text == '#')
            continue;
        char *equals = strchr(text, '=');
        if (!equals) {
            sv_errors_add(errors, SV_EFORMAT, "config", "%s: expected key = value", source);
            continue;
        }
        *equals = '\0';
        set_key(trimmed(text), trimmed(equals + 1), source, settings, errors);
    }
    if (ferror(file))
        sv_errors_add(errors, SV_EIO, "config", "%s: %s", path, strerror(errno));
    fclose(file);
}

/* Variables of that prefix that are no settings: what a cluster puts there for a service named silvista, and
 * where the scripts build. */
static bool is_not_ours(const char *name)
{
    static const char *const beginnings[] = {"SILVISTA_PORT", "SILVISTA_SERVICE_", "SILVISTA_BUILD="};
    for (size_t i = 0; i < sizeof beginnings / sizeof beginnings[0]; i++)
        if (strncmp(name, beginnings[i], strlen(beginnings[i])) == 0)
            return true;
    return false;
}

static void read_environment(char *const *environment, struct sv_settings *settings, struct sv_errors *errors)
{
    for (; environment && *environment; environment++) {
        const char *entry = *environment, *equals = strchr(entry, '=');
        char key[64], source[96];
        if (strncmp(entry, "SILVISTA_", 9) != 0 || !equals || is_not_ours(entry))
            continue;
        snprintf(source, sizeof source, "environment %.*s", (int)(equals - entry < 72 ? equals - entry : 72),
                 entry);
        snprintf(key, sizeof key, "%.*s", (int)(equals - entry - 9), entry + 9);
        for (char *p = key; *p; p++)
            *p = (char)tolower((unsigned char)*p);
        if (strcmp(key, "test_hooks") != 0)
            set_key(key, equals + 1, source, settings, errors);
    }
}

/* One flag of the command line: a name without dashes and its value, if it has one. */
struct flag {
    char key[64];
    const char *value;
};

static const struct {
    const char *flag;
    enum sv_command command;
} commands[] = {{"help", SV_COMMAND_HELP},
                {"version", SV_COMMAND_VERSION},
                {"check_config", SV_COMMAND_CHECK},
                {"print_config", SV_COMMAND_SAMPLE}};

/* Flags that take a value and are no settings. */
static bool is_value_flag(const char *key)
{
    return strcmp(key, "config") == 0 || strcmp(key, "render") == 0 || strcmp(key, "output") == 0;
}

/* Says that no flag has that name, and passes over what looks like its value. */
static void refuse_flag(const struct flag *flag, bool has_value, int argc, char *const *argv, int *i,
                        struct sv_errors *errors)
{
    char source[80];
    if (!has_value && *i < argc && argv[*i][0] != '-')
        (*i)++;
    snprintf(source, sizeof source, "flag --%s", flag->key);
    refuse_key(flag->key, source, errors);
}

/* Reads the flag at argv[*i], moves *i over what it took. False after an error. */
static bool next_flag(int argc, char *const *argv, int *i, struct flag *flag, bool *is_command,
                      struct sv_command_line *line, struct sv_errors *errors)
{
    const char *text = argv[(*i)++];
    if (strcmp(text, "-h") == 0)
        text = "--help";
    if (strcmp(text, "-o") == 0)
        text = "--output";
    if (strncmp(text, "--", 2) != 0 || strlen(text) < 3) {
        sv_errors_add(errors, SV_EINVAL, text, "unexpected argument; see --help");
        return false;
    }
    size_t bytes = strcspn(text + 2, "=");
    snprintf(flag->key, sizeof flag->key, "%.*s", (int)bytes, text + 2);
    for (char *p = flag->key; *p; p++)
        *p = *p == '-' ? '_' : *p;
    *is_command = false;
    for (size_t c = 0; c < sizeof commands / sizeof commands[0]; c++)
        if (strcmp(commands[c].flag, flag->key) == 0 && text[2 + bytes] == '\0') {
            line->command = commands[c].command;
            *is_command = true;
            return true;
        }
    if (!is_value_flag(flag->key) && !find_row(flag->key)) {
        refuse_flag(flag, text[2 + bytes] == '=', argc, argv, i, errors);
        return false;
    }
    if (text[2 + bytes] == '=')
        flag->value = text + 3 + bytes;
    else if (*i < argc)
        flag->value = argv[(*i)++];
    else {
        sv_errors_add(errors, SV_EINVAL, flag->key, "%s needs a value", text);
        return false;
    }
    return true;
}

/* pass 0 looks for the file only, pass 1 sets the rest. */
static void read_flags(int argc, char *const *argv, int pass, char *config, struct sv_settings *settings,
                       struct sv_command_line *line, struct sv_errors *errors)
{
    struct sv_errors silent;
    sv_errors_init(&silent);
    for (int i = 1; i < argc;) {
        struct flag flag = {.value = ""};
        bool is_command;
        if (!next_flag(argc, argv, &i, &flag, &is_command, line, pass ? errors : &silent) || is_command)
            continue;
        if (strcmp(flag.key, "config") == 0) {
            snprintf(config, SV_SETTING_TEXT_MAX, "%s", flag.value);
        } else if (strcmp(flag.key, "render") == 0) {
            line->command = SV_COMMAND_RENDER;
            snprintf(line->render_view, sizeof line->render_view, "%s", flag.value);
        } else if (strcmp(flag.key, "output") == 0) {
            snprintf(line->render_out, sizeof line->render_out, "%s", flag.value);
        } else if (pass == 1) {
            char source[80];
            snprintf(source, sizeof source, "flag --%s", flag.key);
            set_key(flag.key, flag.value, source, settings, errors);
        }
    }
    sv_errors_finish(&silent);
}

/* What an empty value stands for. */
static void fill_in(struct sv_settings *settings)
{
    if (settings->workers == 0) {
        long online = sysconf(_SC_NPROCESSORS_ONLN);
        settings->workers = online < 1 ? 1 : online > 1024 ? 1024 : online;
    }
    if (settings->cache_dir[0] == '\0') {
        const char *home = getenv("XDG_CACHE_HOME");
        if (home && home[0] == '/' && strlen(home) < sizeof settings->cache_dir - 16)
            snprintf(settings->cache_dir, sizeof settings->cache_dir, "%s/silvista", home);
        else
            snprintf(settings->cache_dir, sizeof settings->cache_dir, "/var/cache/silvista");
    }
    if (settings->deadline_max_ms < settings->deadline_ms)
        settings->deadline_max_ms = settings->deadline_ms;
}

enum sv_status sv_settings_read(int argc, char *const *argv, char *const *environment,
                                struct sv_settings *settings, struct sv_command_line *line,
                                struct sv_errors *errors)
{
    char config[SV_SETTING_TEXT_MAX] = "";
    memset(settings, 0, sizeof *settings);
    memset(line, 0, sizeof *line);
    for (size_t i = 0; i < SETTING_COUNT; i++)
        set_value(&table[i], table[i].initial, "default", settings, errors);
    read_flags(argc, argv, 0, config, settings, line, errors);
    if (config[0])
        read_file(config, settings, errors);
    read_environment(environment, settings, errors);
    read_flags(argc, argv, 1, config, settings, line, errors);
    if (line->command == SV_COMMAND_RENDER && line->render_out[0] == '\0')
        sv_errors_add(errors, SV_EINVAL, "output", "--render needs -o FILE");
    if (errors->total)
        return errors->count ? errors->items[0].code : SV_ENOMEM;
    fill_in(settings);
    return SV_OK;
}

void sv_settings_check_run(const struct sv_settings *settings, struct sv_errors *errors)
{
    if (settings->scene[0] == '\0')
        sv_errors_add(errors, SV_EINVAL, "scene", "no scene file is given: --scene FILE");
    else if (access(settings->scene, R_OK))
        sv_errors_add(errors, SV_ENOENT, "scene", "%s: %s", settings->scene, strerror(errno));
    if ((settings->tls_cert[0] == '\0') != (settings->tls_key[0] == '\0'))
        sv_errors_add(errors, SV_EINVAL, settings->tls_cert[0] ? "tls_key" : "tls_cert",
                      "tls_cert and tls_key need each other");
}

void sv_settings_print_help(FILE *out)
{
    fputs("silvistad - serves pictures of a landscape over HTTP\n\n"
          "usage: silvistad --scene FILE [--KEY VALUE ...]\n"
          "       silvistad --scene FILE --render VIEW.json -o OUT   draws one picture, serves nothing\n\n"
          "  --config FILE     reads settings, `key = value` a line\n"
          "  --check-config    checks all settings and ends\n"
          "  --print-config    prints every setting with its default and ends\n"
          "  --version         prints the version and ends\n"
          "  --help            prints this and ends\n\n"
          "Settings: a later source wins: default, file, environment (SILVISTA_<KEY>), flag.\n",
          out);
    for (size_t i = 0; i < SETTING_COUNT; i++) {
        const struct setting *row = &table[i];
        char flag[64];
        if (is_hidden(row))
            continue;
        snprintf(flag, sizeof flag, "%s", row->key);
        for (char *p = flag; *p; p++)
            *p = *p == '_' ? '-' : *p;
        fprintf(out, "  --%s%s%s\n      %s", flag, row->unit[0] ? " " : "", row->unit, row->help);
        if (row->type == SETTING_WHOLE)
            fprintf(out, " (%lld to %lld; %s)\n", (long long)row->min, (long long)row->max, row->initial);
        else if (row->initial[0])
            fprintf(out, " (%s)\n", row->initial);
        else
            fputs("\n", out);
    }
}

void sv_settings_print_sample(FILE *out)
{
    fputs("# Settings of silvistad, each with its default. Printed by: silvistad --print-config\n"
          "# A later source wins: default, this file, environment (SILVISTA_<KEY>), flag "
          "(--key-with-dashes).\n",
          out);
    for (size_t i = 0; i < SETTING_COUNT; i++) {
        const struct setting *row = &table[i];
        if (is_hidden(row))
            continue;
        fprintf(out, "\n# %s\n", row->help);
        if (row->type == SETTING_WHOLE)
            fprintf(out, "# %s, %lld to %lld\n", row->unit, (long long)row->min, (long long)row->max);
        fprintf(out, "#%s =%s%s\n", row->key, row->initial[0] ? " " : "", row->initial);
    }
}
