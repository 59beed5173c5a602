/* SPDX-License-Identifier: Apache-2.0 */
/* A Kalman filter's propagation and update of a covariance of six, as an attitude filter does it. */
#include "bench/guest/guest.h"

enum { N = 6 };

static double P[N][N], F[N][N], FP[N][N], Q[N];

static void propagate(double dt, const double w[3])
{
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            F[i][j] = i == j ? 1.0 : 0.0;
        }
        if (i < 3) {
            const int j = (i + 1) % 3, k = (i + 2) % 3;
            F[i][j] = dt * w[k];
            F[i][k] = -dt * w[j];
            F[i][i + 3] = -dt;
        }
    }
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            double s = 0.0;
            for (int k = 0; k < N; k++) {
                s += F[i][k] * P[k][j];
            }
            FP[i][j] = s;
        }
    }
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            double s = i == j ? Q[i] : 0.0;
            for (int k = 0; k < N; k++) {
                s += FP[i][k] * F[j][k];
            }
            P[i][j] = s;
        }
    }
}

static void update(int axis, double r)
{
    const double scale = 1.0 / (P[axis][axis] + r);
    double K[N];
    for (int i = 0; i < N; i++) {
        K[i] = P[i][axis] * scale;
    }
    for (int i = 0; i < N; i++) {
        for (int j = i; j < N; j++) {
            P[i][j] -= K[i] * P[axis][j];
        }
    }
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < i; j++) {
            P[i][j] = P[j][i];
        }
    }
}

uint32_t work(void)
{
    for (int i = 0; i < N; i++) {
        P[i][i] = i < 3 ? 1e-2 : 1e-6;
        Q[i] = i < 3 ? 1e-9 : 1e-12;
    }
    for (long n = 0; n < 2000L * ROUNDS; n++) {
        const double w[3] = {1e-3, -2e-3 * (double)(n & 7), 3e-3};
        propagate(0.1, w);
        update((int)(n % 3), 1e-6);
    }
    uint32_t sum = 1;
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            sum = mix(sum, P[i][j]);
        }
    }
    return sum;
}
