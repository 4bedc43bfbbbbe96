#include "core/tree/least_squares.h"

#include <math.h>
#include <string.h>

void sv_least_squares_add(double m[SV_UNKNOWNS_MAX][SV_UNKNOWNS_MAX + 1], int n, const double *row,
                          double value, double weight)
{
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < n; k++)
            m[i][k] += weight * row[i] * row[k];
        m[i][n] += weight * row[i] * value;
    }
}

bool sv_least_squares_solve(int n, double m[SV_UNKNOWNS_MAX][SV_UNKNOWNS_MAX + 1],
                            double out[SV_UNKNOWNS_MAX])
{
    for (int k = 0; k < n; k++) {
        int best = k;
        for (int i = k + 1; i < n; i++)
            best = fabs(m[i][k]) > fabs(m[best][k]) ? i : best;
        for (int c = 0; c <= n; c++) {
            double swap = m[k][c];
            m[k][c] = m[best][c];
            m[best][c] = swap;
        }
        if (!(fabs(m[k][k]) > 1e-12))
            return false;
        for (int i = 0; i < n; i++) {
            double f = i == k ? 0 : m[i][k] / m[k][k];
            for (int c = k; c <= n; c++)
                m[i][c] -= f * m[k][c];
        }
    }
    for (int k = 0; k < n; k++)
        out[k] = m[k][n] / m[k][k];
    return true;
}

void sv_translucency_rule(double m[SV_UNKNOWNS_MAX][SV_UNKNOWNS_MAX + 1], float rule[4])
{
    double seen = m[3][3], fitted[SV_UNKNOWNS_MAX];
    double mean = seen > 0 ? m[3][4] / seen : 0;
    for (int c = 0; c < 3; c++)
        m[c][c] += 1e-6 * seen; /* one colour alone still has an answer */
    bool solved = seen > 0 && sv_least_squares_solve(4, m, fitted);
    for (int c = 0; solved && c < 4; c++)
        solved = fabs(fitted[c]) < 1e5;
    for (int c = 0; c < 4; c++)
        rule[c] = solved ? (float)fitted[c] : c == 3 ? (float)mean : 0;
}
