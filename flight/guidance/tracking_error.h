/* SPDX-License-Identifier: Apache-2.0 */
/* Example:
 *
 *     static TrackingError m; // all parameters may be 0: the body frame follows the reference
 *     tracking_error_reset(&m);
 *     m.in.attitude = (NavAttitude){.head = {0, QUALITY_GOOD, 1}, .sigma_BN = vec3(0.1, 0.0, 0.0)};
 *     m.in.reference = (AttReference){.head = {0, QUALITY_GOOD, 1}};
 *     tracking_error_update(&m, (Tick){.t = 0, .dt = 0});
 *     const AttError error = m.out.error; // for a module of flight/control
 */
#ifndef FLIGHT_GUIDANCE_TRACKING_ERROR_H
#define FLIGHT_GUIDANCE_TRACKING_ERROR_H

#include "flight/msg/attitude.h"

/** The error of the body's attitude against a reference that the control frame Bc shall follow.
 *  B follows R, so that Bc follows the reference Ri. With the matrices of sigma_BN, sigma_BcB and the reference,
 *     [RN] = [BcB]^T [RiN],   [BR] = [BN] [RN]^T
 *     omega_RN_B = [BN] omega_RN_N,   omega_BR_B = omega_BN_B - omega_RN_B,   domega_RN_B = [BN] domega_RN_N
 *  An attitude that is not good and gets older counts for `hold`; then the error is held, degraded, and its time
 *  says since when.
 *  Source: thesis, chapter 2. */
typedef struct TrackingError {
    struct {
        NavAttitude attitude;
        AttReference reference; ///< Ri: what the control frame shall follow
    } in;
    struct {
        AttError error;
    } out;
    struct {
        Vec3 sigma_BcB; ///< [-] attitude of the control frame Bc relative to B
        double hold;    ///< [s] >= 0: how long an old attitude counts; 0: ten updates
    } par;
} TrackingError;

void tracking_error_reset(TrackingError *m);
void tracking_error_update(TrackingError *m, Tick t);

#endif
