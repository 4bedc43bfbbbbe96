#include "api/endpoints.h"

#include <string.h>

#include "tests/api/cmocka_all.h"

static void rows(void **state)
{
    (void)state;
    int count;
    const struct sv_endpoint *e = sv_api_endpoints(&count);
    assert_in_range(count, 15, 100);
    for (int k = 0; k < count; k++) {
        assert_int_equal(e[k].path[0], '/');
        for (int j = k + 1; j < count; j++) {
            assert_true(strcmp(e[k].id, e[j].id) != 0);
            assert_true(strcmp(e[k].path, e[j].path) != 0 || strcmp(e[k].method, e[j].method) != 0);
        }
    }
}

static void later(void **state)
{
    (void)state;
    static const struct {
        const char *method, *path, *id; /* NULL: none */
    } rows_[] = {
        {"POST", "/v1/batch", "postBatch"},
        {"GET", "/v1/batch", NULL},
        {"GET", "/v1/view", NULL},
        {"PATCH", "/v1/scene", NULL},
        {"GET", "/v1/scene", NULL},
        {"HEAD", "/v1/tradeoff", "getTradeoff"},
        {"GET", "/tiles/3/4/5.png", "getTile"},
        {"GET", "/tiles/3/4/5@2x.png", "getTile"},
        {"GET", "/tiles/3/4/5", NULL},
        {"GET", "/tiles/3/4/.png", NULL},
        {"GET", "/tiles/3/4/5.", NULL},
        {"GET", "/tiles/3/4", NULL},
        {"GET", "/tiles/3/4/5/6.png", NULL},
        {"GET", "/tiles//4/5.png", NULL},
        {"GET", "/tiles.json", "getTileJson"},
        {"GET", "/wms", "getWms"},
        {"GET", "/wms/", NULL},
        {"GET", "/static/-71.5,42.1,14@30,20/512x512@2x.png", "getStatic"},
        {"DELETE", "/v1/cells", NULL},
        {"GET", "", NULL},
        {"GET", "/", NULL},
    };
    for (size_t k = 0; k < sizeof rows_ / sizeof rows_[0]; k++) {
        const struct sv_endpoint *e = sv_api_endpoint_later(rows_[k].method, rows_[k].path);
        if ((e == NULL) != (rows_[k].id == NULL) || (e && strcmp(e->id, rows_[k].id) != 0))
            fail_msg("%s %s: %s", rows_[k].method, rows_[k].path, e ? e->id : "none");
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(rows), cmocka_unit_test(later)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
