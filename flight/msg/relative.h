/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_MSG_RELATIVE_H
#define FLIGHT_MSG_RELATIVE_H

#include "flight/math/vec.h"
#include "flight/msg/head.h"

/** The motion of this spacecraft D in the Hill frame H of a chief C: h1 outward, h3 along its angular momentum. */
typedef struct HillState {
    Head head;
    Vec3 rho_H;        ///< [m]   position of D relative to C, H components
    Vec3 drho_H;       ///< [m/s] its derivative in H
    Vec3 rho_error_H;  ///< [m]   relative to the wanted motion
    Vec3 drho_error_H; ///< [m/s] its derivative in H
} HillState;

enum { ROLL_MEMBERS = 8 };

/** Which members of a formation are heard. Bit i of a set is that of member i. */
typedef struct FormationState {
    Head head;
    double age[ROLL_MEMBERS]; ///< [s] since the newest message of each, 0: none was heard yet
    uint32_t heard;           ///< [-] members whose messages come
    uint32_t lost;            ///< [-] those that were heard and are not any more
} FormationState;

#endif
