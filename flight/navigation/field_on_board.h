/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_NAVIGATION_FIELD_ON_BOARD_H
#define FLIGHT_NAVIGATION_FIELD_ON_BOARD_H

#include "flight/msg/ephemeris.h"
#include "flight/msg/magnetics.h"
#include "flight/msg/orbit.h"

/** Which model of the Earth's magnetic field. */
typedef enum FieldModel {
    FIELD_DIPOLE = 0, ///< degree 1 of IGRF-14
    FIELD_IGRF = 1,   ///< IGRF-14, degree 13
    FIELD_WMM = 2     ///< WMM2025, degree 12
} FieldModel;

/** The Earth's magnetic field at the spacecraft, B = -grad V, by a model in spherical harmonics:
 *      V = a sum_n (a / r)^(n+1) sum_m (g_nm cos m lon + h_nm sin m lon) P_nm(sin lat),   a = 6371.2 km
 *  with P in Schmidt's quasi-normalisation, and with g and h that change at constant rates. It is summed in Cartesian
 *  components, which have no singular place: the poles are places as any other.
 *  The models hold from 2025.0 to 2030.0. At other times the output is degraded, and is the field at the nearer end.
 *  Without orbit, time or the Earth's attitude, within 6,000 km of the Earth's centre, and with a model that there is
 *  not, nothing is written. What the models leave out, in a low orbit: about 100 nT of currents in ionosphere and
 *  magnetosphere, more in storms. A lower degree is cheaper and leaves more out.
 *  Sources: IAGA, IGRF-14; World Magnetic Model 2025; Montenbruck and Gill, section 3.2, for sums without angles. */
typedef struct FieldOnBoard {
    struct {
        NavOrbit orbit; ///< relative to the Earth's centre
        UtcTime time;
        PlanetAttitude earth; ///< how the Earth is turned
    } in;
    struct {
        KnownField field;
    } out;
    struct {
        FieldModel model; ///< [-] which model
        uint32_t degree;  ///< [-] in [0, 13]: highest degree that counts; 0: all that the model has
    } par;
} FieldOnBoard;

void field_on_board_reset(FieldOnBoard *m);
void field_on_board_update(FieldOnBoard *m, Tick t);

#endif
