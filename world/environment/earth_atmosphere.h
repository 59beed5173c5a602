/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_ENVIRONMENT_EARTH_ATMOSPHERE_H
#define WORLD_ENVIRONMENT_EARTH_ATMOSPHERE_H

#include "world/msg/craft.h"
#include "world/msg/environment.h"

/** By which law the Earth's upper air is computed. */
typedef enum EarthAirLaw {
    EARTH_AIR_NRLMSISE_00 = 0, ///< of the Naval Research Laboratory, 2000
    EARTH_AIR_JB2008 = 1,      ///< of Jacchia and Bowman, 2008
    EARTH_AIR_DTM2000 = 2,     ///< the Drag Temperature Model of 2000
    EARTH_AIR_MET = 3          ///< NASA's Marshall Engineering Thermosphere
} EarthAirLaw;

/** The Earth's upper air by the Sun's and the magnetic field's activity, and by place, season and local time: for the
 *  drag of spacecraft, and as a message. It turns with the Earth. Python's `sky`, which it needs, says the date and
 *  where the Sun is; `weather` is a file of indices, or else the activity is constant, by the parameters.
 *  Fluxes are in solar flux units, 1e-22 W/m^2/Hz.
 *  Assumptions: the wind blows alike everywhere; without a file the activity is the same at all times.
 *  Source: Picone et al. 2002; Bowman et al. 2008; Bruinsma, Thuillier and Barlier 2003; Hickey 1988. */
typedef struct EarthAtmosphere {
    struct {
        CraftState truth;
    } in;
    struct {
        AirState air;
    } out;
    struct {
        EarthAirLaw law; ///< [-] by which it is computed
        uint32_t spare;
        double F107;              ///< [-] >= 0, <= 1000: flux at 10.7 cm; > 0 without a file of indices
        double F107_average;      ///< [-] >= 0, <= 1000: its mean of 81 days; 0: F107
        double ap;                ///< [-] >= 0, <= 400: geomagnetic index; Kp follows from it
        double S10;               ///< [-] >= 0, <= 1000: JB2008, extreme ultraviolet; 0: F107
        double S10_average;       ///< [-] >= 0, <= 1000: JB2008; 0: S10
        double M10;               ///< [-] >= 0, <= 1000: JB2008, middle ultraviolet; 0: F107
        double M10_average;       ///< [-] >= 0, <= 1000: JB2008; 0: M10
        double Y10;               ///< [-] >= 0, <= 1000: JB2008, X-rays; 0: F107
        double Y10_average;       ///< [-] >= 0, <= 1000: JB2008; 0: Y10
        double storm_temperature; ///< [K] >= 0, <= 2000: JB2008, what a storm adds to the exosphere's temperature
        double density_factor;    ///< [-] >= 0, <= 100: on the density, for dispersions; 0: 1
        double wind_east;         ///< [m/s] >= -1e4, <= 1e4: of the air relative to the Earth
        double wind_north;        ///< [m/s] >= -1e4, <= 1e4: likewise
    } par;
} EarthAtmosphere;

#endif
