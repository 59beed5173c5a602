/* SPDX-License-Identifier: Apache-2.0 */
/* 3x3 products, kinematics of modified Rodrigues parameters, square roots. */
#include "bench/guest/guest.h"

static double sigma[3] = {0.1, 0.2, -0.3}, c[3][3];

/* The direction cosine matrix of an attitude. */
static void dcm(const double s[3], double m[3][3])
{
    const double s2 = s[0] * s[0] + s[1] * s[1] + s[2] * s[2];
    const double d = 1.0 / ((1.0 + s2) * (1.0 + s2)), a = 8.0 * d, b = 4.0 * (1.0 - s2) * d;
    const double x[3][3] = {{0.0, -s[2], s[1]}, {s[2], 0.0, -s[0]}, {-s[1], s[0], 0.0}};
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            const double xx = x[i][0] * x[0][j] + x[i][1] * x[1][j] + x[i][2] * x[2][j];
            m[i][j] = (i == j ? 1.0 : 0.0) + a * xx - b * x[i][j];
        }
    }
}

uint32_t work(void)
{
    double trace = 0.0;
    for (long n = 0; n < 10000L * ROUNDS; n++) {
        const double w[3] = {0.01, -0.02, 0.03 + 1e-3 * trace};
        const double s2 = sigma[0] * sigma[0] + sigma[1] * sigma[1] + sigma[2] * sigma[2];
        const double sw = sigma[0] * w[0] + sigma[1] * w[1] + sigma[2] * w[2];
        double ds[3];
        for (int i = 0; i < 3; i++) {
            const int j = (i + 1) % 3, k = (i + 2) % 3;
            ds[i] = 0.25 * ((1.0 - s2) * w[i] + 2.0 * (sigma[j] * w[k] - sigma[k] * w[j]) + 2.0 * sw * sigma[i]);
        }
        for (int i = 0; i < 3; i++) {
            sigma[i] += 0.05 * ds[i];
        }
        const double norm = __builtin_sqrt(sigma[0] * sigma[0] + sigma[1] * sigma[1] + sigma[2] * sigma[2]);
        if (norm > 1.0) {
            for (int i = 0; i < 3; i++) {
                sigma[i] /= -norm * norm;
            }
        }
        double m[3][3], p[3][3];
        dcm(sigma, m);
        for (int i = 0; i < 3; i++) {
            for (int j = 0; j < 3; j++) {
                p[i][j] = m[i][0] * m[0][j] + m[i][1] * m[1][j] + m[i][2] * m[2][j] + 0.5 * c[i][j];
            }
        }
        trace = 0.0;
        for (int i = 0; i < 3; i++) {
            for (int j = 0; j < 3; j++) {
                c[i][j] = 0.5 * p[i][j];
            }
            trace += c[i][i];
        }
    }
    uint32_t sum = 1;
    for (int i = 0; i < 3; i++) {
        sum = mix(mix(sum, sigma[i]), c[i][i]);
    }
    return sum;
}
