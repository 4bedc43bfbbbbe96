/* scene_values.h - typed readers of JSON values, driven by tables: what scene_file.c is made of, and the
 * reader of patches (api/patch_parse.h), which has some of its tables in common.
 *
 * A row (sv_value_field) says key, type, unit, legal range, default and where the value goes; a reader checks
 * a value against its row and writes it, or adds an error that names key path, value and range. Readers never
 * stop at the first error. They write into zeroed plain structs; strings and lists are heap memory of the
 * struct's owner. */
#ifndef SV_SCENE_SCENE_VALUES_H
#define SV_SCENE_SCENE_VALUES_H

#include <stdbool.h>
#include <stddef.h>

#include <cjson/cJSON.h>

#include "core/base/error.h"

enum { SV_VALUE_FIELDS_MAX = 16, SV_VALUE_PATH_BYTES_MAX = 4096 };

struct sv_scene_spec;

struct sv_value_reader {
    const char *file; /* begins what errors say; NULL: they say what is wrong alone */
    char *folder;     /* of the scene file, with its slash; "" for the current one */
    bool look_for_files;
    struct sv_scene_spec *spec; /* what was read so far */
    struct sv_errors *errors;
    char path[160]; /* key path of what is being read */
};

struct sv_value_field;
/* Reads json into base + field->offset; json is NULL when the key is absent (then the default is written). */
typedef void sv_value_read(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *field,
                           void *base);

struct sv_value_field {
    const char *key, *type, *unit;
    double min, max, fallback; /* of numbers; for strings min and max are bytes, for arrays max is items */
    sv_value_read *read;
    const struct sv_value_section *section; /* of an object */
    size_t offset;
    bool required;
};

struct sv_value_section {
    const struct sv_value_field *fields;
    int count; /* <= SV_VALUE_FIELDS_MAX */
};

/* Adds an error for the current key path. */
void sv_value_complain(struct sv_value_reader *r, enum sv_status code, const char *format, ...)
    SV_PRINTF(3, 4);
/* "must be WANTED, is an array" */
void sv_value_complain_type(struct sv_value_reader *r, const cJSON *json, const char *wanted);

/* Appends to the key path; returns its old length for sv_value_leave. */
size_t sv_value_enter(struct sv_value_reader *r, const char *format, ...) SV_PRINTF(2, 3);
size_t sv_value_enter_key(struct sv_value_reader *r, const char *key);
void sv_value_leave(struct sv_value_reader *r, size_t length);

/* Text of the file as an error may show it: cut at a character, control characters replaced. */
struct sv_value_shown {
    char text[68];
};
struct sv_value_shown sv_value_show(const char *s);

/* Checks alone: false / NULL after an error was added. */
bool sv_value_number_in(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f,
                        bool integer, double *value);
const char *sv_value_string_in(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f);
/* a followed by b, heap; NULL after an error. */
char *sv_value_copy(struct sv_value_reader *r, const char *a, const char *b);

/* Readers for rows. */
sv_value_read sv_value_number; /* double */
sv_value_read sv_value_int;
sv_value_read sv_value_u32;
sv_value_read sv_value_u64;
sv_value_read sv_value_string; /* char *, NULL when absent */
sv_value_read sv_value_path;   /* char *, resolved against the folder and, if asked, looked for */
sv_value_read sv_value_range;  /* double[2]: [least, most] or one number; untouched when absent */
sv_value_read sv_value_object; /* by row->section, at row->offset */

sv_value_read sv_value_species; /* int: index of the scene's species of that name, -1 when absent */

/* Tables of the scene file (scene_file.c): "scatter" of a forest's entry, into a struct sv_scatter_spec; an
 * entry of "objects", into a struct sv_object_spec. */
extern const struct sv_value_section sv_scene_scatter_section, sv_scene_object_section;

/* An object by its table: unknown, duplicate and missing keys. */
void sv_value_section(struct sv_value_reader *r, const cJSON *json, const struct sv_value_section *s,
                      void *base);
/* Zeroed room for the items of an array (row->max at most) and their number; NULL when there is nothing to
 * read. */
void *sv_value_list(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f, size_t size,
                    int *count);
/* Has the object exactly one of two keys? An error says so if not. False for what is no object. */
bool sv_value_one_of(struct sv_value_reader *r, const cJSON *json, const char *a, const char *b);

#endif
