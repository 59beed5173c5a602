/* SPDX-License-Identifier: Apache-2.0 */
/* What passes between flight and the units of the flat-sat. */
#ifndef FLATSAT_UNITS_MSG_H
#define FLATSAT_UNITS_MSG_H

#include "flight/msg/head.h"

enum { SUN_SENSORS = 8, MOTORS = 4, CARDS = 4 };

/** What the coarse sun sensors give. */
typedef struct SensorCurrents {
    Head head;
    double current[SUN_SENSORS];    ///< [A] photocurrent
    uint8_t saturated[SUN_SENSORS]; ///< [-] 1: the converter is at its end
} SensorCurrents;

/** A direction to the Sun. */
typedef struct SunVector {
    Head head;
    double s_B[3]; ///< [-] unit vector
} SunVector;

/** What drives the motors. */
typedef struct MotorVolts {
    Head head;
    double volts[MOTORS]; ///< [V] of each motor
} MotorVolts;

/** A burn of one thruster. */
typedef struct Burn {
    Head head;
    double duration;   ///< [s] of the burn; 0: none
    uint32_t thruster; ///< [-] which
    uint32_t number;   ///< [-] counts the burns
} Burn;

/** A command to the power unit: which cards are on. */
typedef struct CardsCommand {
    Head head;
    uint32_t number; ///< [-] counts the commands
    uint32_t cards;  ///< [-] a bit for each
} CardsCommand;

/** The reply of the power unit. */
typedef struct PowerReply {
    Head head;
    uint32_t number; ///< [-] of the command
    uint32_t cards;  ///< [-] which are on, a bit for each
} PowerReply;

/** What the cards report. */
typedef struct HouseKeeping {
    Head head;
    double temperature[CARDS]; ///< [K] of each card
} HouseKeeping;

/** The state of the power bus. */
typedef struct BusState {
    Head head;
    double volts;   ///< [V] of the main bus
    double battery; ///< [A] current of the battery
} BusState;

/** A mode, asked for or flown. */
typedef struct ModeWord {
    Head head;
    uint32_t mode; ///< [-] 0: rest, 1: point, 2: point and burn
    uint32_t spare;
} ModeWord;

/** The state of the recorder. */
typedef struct DataRecorderState {
    Head head;
    double fill; ///< [-] in [0, 1]: how full its memory is
} DataRecorderState;

#endif
