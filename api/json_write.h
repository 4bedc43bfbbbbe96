/* json_write.h - building JSON trees: one flag tells at the end whether memory ran out on the way. */
#ifndef SV_API_JSON_WRITE_H
#define SV_API_JSON_WRITE_H

#include <cjson/cJSON.h>
#include <stdbool.h>
#include <stddef.h>

/* All take item or object NULL as memory that ran out before: *good becomes false, nothing leaks, nothing
 * crashes. */
void sv_api_json_add(cJSON *object, const char *name, cJSON *item, bool *good); /* takes item */
void sv_api_json_append(cJSON *array, cJSON *item, bool *good);                 /* takes item */
/* A number; null when it is not finite. */
void sv_api_json_add_number(cJSON *object, const char *name, double v, bool *good);
/* A string of any bytes: what is not UTF-8 is shown escaped, over 1000 bytes it is cut; NULL is "". */
void sv_api_json_add_text(cJSON *object, const char *name, const char *text, bool *good);
void sv_api_json_add_bool(cJSON *object, const char *name, bool v, bool *good);
void sv_api_json_add_numbers(cJSON *object, const char *name, const double *values, int count, bool *good);
/* {a: va, b: vb} */
cJSON *sv_api_json_pair(const char *a, double va, const char *b, double vb, bool *good);
/* Prints and frees root: heap text without blanks, or NULL when !good or memory is out (*bytes is 0 then). */
char *sv_api_json_print(cJSON *root, bool good, size_t *bytes);

#endif
