/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLATSAT_AVIONICS_H
#define FLATSAT_AVIONICS_H

#include "flight/msg/wheels.h"
#include "flight/units_msg.h"

/** The manager of the flat-sat's units: the direction to the Sun from the coarse sensors, volts for the motors, heaters
 *  that keep the cards warm, burns while the mode asks for them and the recorder is less than half full. */
typedef struct Avionics {
    struct {
        SensorCurrents sun;
        WheelCommand torques;
        PowerReply reply;
        HouseKeeping cards;
        BusState bus;
        ModeWord request;
        DataRecorderState recorder;
    } in;
    struct {
        SunVector direction;
        MotorVolts volts;
        CardsCommand power;
        Burn burn;
        ModeWord mode;
    } out;
    struct {
        double motor;     ///< [N m / V] required, > 0: torque of a motor per volt
        double cold;      ///< [K] required, > 0: below this the heater of a card is switched on
        double warm;      ///< [K] required, > 0: so much above it is switched off
        double volts_min; ///< [V] required, > 0: below this the bus bears no heater
    } par;
    struct {
        uint64_t updates; ///< [-] in this mode
    } mem;
} Avionics;

void avionics_reset(Avionics *m);
void avionics_update(Avionics *m, Tick t);

#endif
