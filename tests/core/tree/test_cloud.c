/* test_cloud.c - billboard clouds: counts, determinism, geometry, and how even they are, against the mesh
 * itself rasterised from all over the upper hemisphere. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cmocka.h>

#include "cloud_fixture.h"
#include "core/tree/grow.h"

static void make(const struct sv_tree_mesh *mesh, const struct sv_cloud_options *options,
                 struct sv_tree_cloud *cloud)
{
    struct sv_error error;
    if (sv_tree_cloud_create(mesh, options, cloud, &error) != SV_OK)
        fail_msg("%s: %s", error.field, error.message);
    if (sv_tree_cloud_check(cloud, mesh, &error) != SV_OK)
        fail_msg("%s: %s", error.field, error.message);
}

struct spread {
    double low, high, mean;
};

static struct spread spread_of(const double *v, int count)
{
    struct spread s = {INFINITY, 0, 0};
    for (int k = 0; k < count; k++) {
        s.low = fmin(s.low, v[k]);
        s.high = fmax(s.high, v[k]);
        s.mean += v[k] / count;
    }
    return s;
}

/* The table: one row a species. Coverage of the cloud from each view over that of the mesh. */
static void coverage_is_even(void **state)
{
    (void)state;
    int views = getenv("SV_TEST_FULL") ? 200 : 40;
    double *own = malloc((size_t)views * sizeof *own), *shown = malloc((size_t)views * sizeof *shown);
    assert_non_null(own);
    assert_non_null(shown);
    printf("%-22s %7s %6s %7s %7s %7s | coverage/mesh: low high mean (over %d views)\n", "species", "leaves",
           "ms", "pieces", "rms", "seen", views);
    for (int s = 0; s < cloud_fixture_count(); s++) {
        struct sv_tree_mesh mesh, flat;
        struct sv_tree_cloud cloud;
        if (!cloud_fixture_mesh(s, CLOUD_FIXTURE_LEAVES, &mesh)) {
            printf("%-22s skipped: the model is not here\n", cloud_fixture_name(s));
            continue;
        }
        clock_t start = clock();
        make(&mesh, &SV_CLOUD_OPTIONS_DEFAULT, &cloud);
        double ms = 1e3 * (double)(clock() - start) / CLOCKS_PER_SEC;
        assert_int_equal(cloud.plane_count, 24);
        cloud_fixture_flatten(&mesh, &cloud, &flat);
        cloud_fixture_coverage(&mesh, views, own);
        cloud_fixture_coverage(&flat, views, shown);
        for (int k = 0; k < views; k++)
            shown[k] /= own[k];
        struct spread even = spread_of(shown, views);
        printf("%-22s %7u %6.0f %7u %7.4f %7.4f | %.3f %.3f %.3f\n", cloud_fixture_name(s), mesh.leaf_count,
               ms, cloud.piece_count, (double)cloud.rms, (double)cloud.view_rms, even.low, even.high,
               even.mean);
        sv_tree_cloud_finish(&cloud);
        sv_tree_mesh_finish(&flat);
        sv_tree_mesh_finish(&mesh);
    }
    free(own);
    free(shown);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(coverage_is_even),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
