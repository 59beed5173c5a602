/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLATSAT_UNITS_H
#define FLATSAT_UNITS_H

#include "flight/msg/wheels.h"
#include "flight/units_msg.h"
#include "world/msg/craft.h"

/** The units of the flat-sat: coarse sun sensors, motor converters, power unit with cards, recorder, thrusters, and the
 *  ground, which asks for modes. */
typedef struct Units {
    struct {
        CraftState truth;
        MotorVolts volts;
        WheelCommand torques; ///< what flight believes; costs power
        CardsCommand power;
        Burn burn;
        ModeWord flown;
    } in;
    struct {
        SensorCurrents sun;
        WheelCommand motors; ///< what the converters make of the volts
        PowerReply reply;
        HouseKeeping cards;
        BusState bus;
        ModeWord request;
        DataRecorderState recorder;
    } out;
    struct {
        double s_N[3];      ///< [-] required: unit vector to the Sun
        double current;     ///< [A] required, > 0: of a sensor that faces the Sun
        double motor;       ///< [N m / V] required, > 0: torque of a motor per volt
        int64_t burns_from; ///< [ns] required, > 0: when the ground asks for burns
        double full;        ///< [s] required, > 0: in which the recorder is full
    } par;
    struct {
        double burnt[12];  ///< [s] by each thruster
        uint32_t burns;    ///< [-] how many arrived
        uint32_t commands; ///< [-] to the power unit, how many arrived
        uint32_t modes;    ///< [-] how often the mode changed
        uint32_t spare;
    } mem;
} Units;

#endif
