/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_GUIDANCE_BASE_REFERENCE_H
#define FLIGHT_GUIDANCE_BASE_REFERENCE_H

#include "flight/msg/attitude.h"

/** Which base counts. */
typedef enum BaseSource {
    BASE_COMMANDED = 0, ///< what another computer or spacecraft sends
    BASE_SENSED = 1,    ///< the attitude of another spacecraft, as a sensor sees it
    BASE_OWN = 2        ///< what guidance of this spacecraft computes
} BaseSource;

/** The base of guidance, from one of three sources, carried to now.
 *  Another computer or spacecraft commands it, a relative sensor sees where another spacecraft points, or guidance of
 *  this one computes it, perhaps at a slower rate. It is carried from its time of validity to now, over the age T, by
 *  its rate and, if it is not sensed, its acceleration:
 *     [RN](t + T) = [RN](t) [M(phi)],   phi = omega T + domega T^2 / 2,   omega(t + T) = omega + domega T
 *  with [M(phi)] a turn by the vector phi, N components. For a turn about an axis fixed in N this is exact.
 *  A base that is missing or older than `hold` does not count: the last reference is held, degraded.
 *  Source: thesis section 5.5. */
typedef struct BaseReference {
    struct {
        AttReference commanded; ///< optional: of another computer or spacecraft
        NavAttitude sensed;     ///< optional: the attitude of another spacecraft
        AttReference own;       ///< optional: of this spacecraft
    } in;
    struct {
        AttReference reference;
    } out;
    struct {
        double hold;       ///< [s] > 0, <= 1000, required: how old a base may be
        BaseSource source; ///< [-] which base counts
        uint32_t spare;
    } par;
} BaseReference;

void base_reference_reset(BaseReference *m);
void base_reference_update(BaseReference *m, Tick t);

#endif
