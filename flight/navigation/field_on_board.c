/* SPDX-License-Identifier: Apache-2.0 */
/* With the direction (x, y, u) to the spacecraft, P_nm = cos^m lat A_nm(u), and C + i S = (x + i y)^m, each term of V
 * is a q A (g C + h S), q = (a / r)^(n+1), and its gradient
 *     q a / r ( A grad(g C + h S) + (0, 0, A' (g C + h S)) - ((n + m + 1) A + u A') (g C + h S) (x, y, u) ).
 * Along a column of one order m, from A_mm, A_nm and its derivative A' follow by
 *     k_n A_n = (2 n - 1) u A_n-1 - k_n-1 A_n-2,   k_n = sqrt(n^2 - m^2),   A_mm = sqrt((2 m - 1) / (2 m)) A_m-1,m-1
 * with A_00 = A_11 = 1. */
#include "flight/navigation/field_on_board.h"

#include <string.h>

#include "flight/navigation/earth_orientation.h"
#include "flight/navigation/field_coefficients.h"

#define FIELD_RADIUS 6371.2e3 /* [m] */
#define FIELD_INSIDE 6000e3   /* [m] */
#define FIELD_BEGIN 9131.5    /* [d] 2025-01-01 */
#define FIELD_END 10957.5     /* [d] 2030-01-01 */

void field_on_board_reset(FieldOnBoard *m)
{
    memset(&m->out, 0, sizeof m->out);
}

/* [nT] At r, years after the models' begin, in axes that are fixed in the Earth. */
static Vec3 field_at(Vec3 r, double years, const double (*rows)[4], int degree)
{
    const double distance = vec_norm(r), ratio = FIELD_RADIUS / distance;
    const double x = r.v[0] / distance, y = r.v[1] / distance, u = r.v[2] / distance;
    double across = 0.0, ahead = 0.0, along = 0.0, up = 0.0; /* sums along x, y, u, and of the radial part */
    double C = 1.0, S = 0.0, C1 = 0.0, S1 = 0.0;             /* of the orders m and m - 1 */
    double diagonal = 1.0, first = ratio * ratio;            /* A_mm, and (a / r)^(m+2) */
    for (int m = 0; m <= degree; m++) {
        double A = diagonal, dA = 0.0, A1 = 0.0, dA1 = 0.0, k = 0.0, q = first;
        for (int n = m; n <= degree; n++) {
            if (n > m) {
                const double k1 = k, A2 = A1, dA2 = dA1;
                A1 = A;
                dA1 = dA;
                k = fm_sqrt((double)(n * n - m * m));
                const double inverse = 1.0 / k, twice = (2 * n - 1) * inverse, before = k1 * inverse;
                A = twice * u * A1 - before * A2;
                dA = twice * (A1 + u * dA1) - before * dA2;
                q *= ratio;
            }
            if (n > 0) {
                const double *row = rows[n * (n + 1) / 2 - 1 + m];
                const double g = row[0] + years * row[2], h = row[1] + years * row[3];
                const double sum = q * (g * C + h * S), slope = q * m * A;
                across += slope * (g * C1 + h * S1);
                ahead += slope * (h * C1 - g * S1);
                along += dA * sum;
                up += ((n + m + 1) * A + u * dA) * sum;
            }
        }
        C1 = C;
        S1 = S;
        C = x * C1 - y * S1;
        S = x * S1 + y * C1;
        diagonal *= m > 0 ? fm_sqrt((2 * m + 1) / (2.0 * m + 2.0)) : 1.0;
        first *= ratio;
    }
    return vec3(up * x - across, up * y - ahead, up * u - along);
}

/* The highest that counts, of a model that has `most`. */
static int degree_of(const FieldOnBoard *m, uint32_t most)
{
    return (int)(m->par.degree > 0u && m->par.degree < most ? m->par.degree : most);
}

void field_on_board_update(FieldOnBoard *m, Tick t)
{
    const FieldModel model = m->par.model;
    const int wmm = model == FIELD_WMM, dipole = model == FIELD_DIPOLE, known = wmm || dipole || model == FIELD_IGRF;
    const double days = earth_days(m->in.time.time);
    const int held = days >= FIELD_BEGIN && days < FIELD_END;
    const double within = days < FIELD_BEGIN ? FIELD_BEGIN : days > FIELD_END ? FIELD_END : days;
    const Mat3 dcm_PN = m->in.earth.dcm_PN;
    const Vec3 r_N = m->in.orbit.r_BN_N, r_P = mat_vec(dcm_PN, r_N);

    Quality quality = quality_min(quality_through(m->in.orbit.head), quality_through(m->in.time.head));
    quality = quality_min(quality, quality_through(m->in.earth.head));
    const int given = quality != QUALITY_NONE && known && vec_norm(r_P) >= FIELD_INSIDE;
    Vec3 B_N = vec3(0.0, 0.0, 0.0);
    if (given) {
        const double years = (within - FIELD_BEGIN) / 365.25;
        const Vec3 B_P = wmm ? field_at(r_P, years, field_wmm, degree_of(m, FIELD_DEGREES_WMM))
                             : field_at(r_P, years, field_igrf, degree_of(m, dipole ? 1u : FIELD_DEGREES_IGRF));
        B_N = vec_scale(1e-9, mat_transpose_vec(dcm_PN, B_P));
    }
    KnownField *field = &m->out.field;
    if (given && vec_finite(B_N)) {
        *field =
            (KnownField){head_next(field->head, t.t, held ? quality : quality_min(quality, QUALITY_DEGRADED)), B_N};
    } else {
        field->head = head_held(field->head);
    }
}
