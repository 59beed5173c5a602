/* SPDX-License-Identifier: Apache-2.0 */
/* Where several outputs command one actuator: `fsw.newest(a.command, b.command) >> w.rods.command`. A wire chooses
 * among outputs of the process of its reader; so flight chooses, by the wires of one of these modules, and the actuator
 * has one command. Such a connection makes the module, and a task that runs it behind the outputs.
 * A message that goes on keeps its time and quality, as on a wire; `command` counts its own writings, one for each
 * message that differs from the last. One whose numbers are not finite is held back. */
#ifndef FLIGHT_ACTUATION_COMMAND_CHOICES_H
#define FLIGHT_ACTUATION_COMMAND_CHOICES_H

#include "flight/msg/avionics.h"
#include "flight/msg/gimbals.h"
#include "flight/msg/magnetics.h"
#include "flight/msg/panels.h"
#include "flight/msg/valves.h"

/** One of several commands: the dipoles of torque rods. */
typedef struct RodCommandChoice {
    struct {
        RodCommand chosen;
    } in;
    struct {
        RodCommand command;
    } out;
} RodCommandChoice;

void rod_command_choice_reset(RodCommandChoice *m);
void rod_command_choice_update(RodCommandChoice *m, Tick t);

/** One of several commands: the motor torques of wheels. */
typedef struct WheelCommandChoice {
    struct {
        WheelCommand chosen;
    } in;
    struct {
        WheelCommand command;
    } out;
} WheelCommandChoice;

void wheel_command_choice_reset(WheelCommandChoice *m);
void wheel_command_choice_update(WheelCommandChoice *m, Tick t);

/** One of several commands: what drives the motors of wheels. */
typedef struct WheelDriveChoice {
    struct {
        WheelDrive chosen;
    } in;
    struct {
        WheelDrive command;
    } out;
} WheelDriveChoice;

void wheel_drive_choice_reset(WheelDriveChoice *m);
void wheel_drive_choice_update(WheelDriveChoice *m, Tick t);

/** One of several commands: the rates of gimbals. */
typedef struct GimbalRatesChoice {
    struct {
        GimbalRates chosen;
    } in;
    struct {
        GimbalRates command;
    } out;
} GimbalRatesChoice;

void gimbal_rates_choice_reset(GimbalRatesChoice *m);
void gimbal_rates_choice_update(GimbalRatesChoice *m, Tick t);

/** One of several commands: the motor torques of gimbals. */
typedef struct GimbalTorquesChoice {
    struct {
        GimbalTorques chosen;
    } in;
    struct {
        GimbalTorques command;
    } out;
} GimbalTorquesChoice;

void gimbal_torques_choice_reset(GimbalTorquesChoice *m);
void gimbal_torques_choice_update(GimbalTorquesChoice *m, Tick t);

/** One of several commands: the burns of thrusters. */
typedef struct ThrusterTimesChoice {
    struct {
        ThrusterTimes chosen;
    } in;
    struct {
        ThrusterTimes command;
    } out;
} ThrusterTimesChoice;

void thruster_times_choice_reset(ThrusterTimesChoice *m);
void thruster_times_choice_update(ThrusterTimesChoice *m, Tick t);

/** One of several commands: the valves of thrusters. */
typedef struct ThrusterValvesChoice {
    struct {
        ThrusterValves chosen;
    } in;
    struct {
        ThrusterValves command;
    } out;
} ThrusterValvesChoice;

void thruster_valves_choice_reset(ThrusterValvesChoice *m);
void thruster_valves_choice_update(ThrusterValvesChoice *m, Tick t);

/** One of several commands: what drives hinged panels. */
typedef struct PanelCommandChoice {
    struct {
        PanelCommand chosen;
    } in;
    struct {
        PanelCommand command;
    } out;
} PanelCommandChoice;

void panel_command_choice_reset(PanelCommandChoice *m);
void panel_command_choice_update(PanelCommandChoice *m, Tick t);

/** One of several commands: the drives of solar arrays. */
typedef struct ArrayDriveCommandChoice {
    struct {
        ArrayDriveCommand chosen;
    } in;
    struct {
        ArrayDriveCommand command;
    } out;
} ArrayDriveCommandChoice;

void array_drive_command_choice_reset(ArrayDriveCommandChoice *m);
void array_drive_command_choice_update(ArrayDriveCommandChoice *m, Tick t);

#endif
