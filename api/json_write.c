/* json_write.c - see json_write.h. */
#include "api/json_write.h"

#include <math.h>
#include <string.h>

#include "api/utf8.h"

void sv_api_json_add(cJSON *object, const char *name, cJSON *item, bool *good)
{
    if (!item || !cJSON_AddItemToObject(object, name, item)) {
        cJSON_Delete(item);
        *good = false;
    }
}

void sv_api_json_append(cJSON *array, cJSON *item, bool *good)
{
    if (!item || !cJSON_AddItemToArray(array, item)) {
        cJSON_Delete(item);
        *good = false;
    }
}

static cJSON *number(double v)
{
    return isfinite(v) ? cJSON_CreateNumber(v) : cJSON_CreateNull();
}

void sv_api_json_add_number(cJSON *object, const char *name, double v, bool *good)
{
    sv_api_json_add(object, name, number(v), good);
}

void sv_api_json_add_text(cJSON *object, const char *name, const char *text, bool *good)
{
    char shown[1024];
    text = text ? text : "";
    sv_api_utf8_show(text, strlen(text), shown, sizeof shown);
    sv_api_json_add(object, name, cJSON_CreateString(shown), good);
}

void sv_api_json_add_bool(cJSON *object, const char *name, bool v, bool *good)
{
    sv_api_json_add(object, name, cJSON_CreateBool(v), good);
}

void sv_api_json_add_numbers(cJSON *object, const char *name, const double *values, int count, bool *good)
{
    cJSON *list = cJSON_CreateArray();
    for (int k = 0; k < count; k++)
        sv_api_json_append(list, number(values[k]), good);
    sv_api_json_add(object, name, list, good);
}

cJSON *sv_api_json_pair(const char *a, double va, const char *b, double vb, bool *good)
{
    cJSON *object = cJSON_CreateObject();
    sv_api_json_add_number(object, a, va, good);
    sv_api_json_add_number(object, b, vb, good);
    return object;
}

char *sv_api_json_print(cJSON *root, bool good, size_t *bytes)
{
    char *text = good ? cJSON_PrintUnformatted(root) : NULL;
    cJSON_Delete(root);
    *bytes = text ? strlen(text) : 0;
    return text;
}
