/* SPDX-License-Identifier: Apache-2.0 */
/* What passes between flight and the avionics, in counts of converters where there is a converter: integers pass words
 * of any board without rounding. */
#ifndef FLIGHT_MSG_AVIONICS_H
#define FLIGHT_MSG_AVIONICS_H

#include "flight/msg/head.h"
#include "flight/msg/wheels.h"

#define SUN_SENSORS_MAX 8

/** What drives the motors of the wheels. */
typedef struct WheelDrive {
    Head head;
    int32_t counts[WHEELS_MAX]; ///< [-] of the converter from numbers to volts
} WheelDrive;

/** How far the wheels turned in the last whole window of time, relative to the body. */
typedef struct WheelTachometers {
    Head head;
    int32_t counts[WHEELS_MAX]; ///< [-] of the tachometer; their sign is that of the direction
} WheelTachometers;

/** What one converter makes of the currents of the coarse sun sensors. */
typedef struct SunSensorCounts {
    Head head;
    uint16_t counts[SUN_SENSORS_MAX]; ///< [-] of the converter
} SunSensorCounts;

/** A time or an offset as registers hold it: whole seconds, and nanoseconds of the same sign. */
typedef struct ClockTime {
    int32_t coarse; ///< [s] whole seconds
    int32_t fine;   ///< [-] in [-999999999, 999999999]: nanoseconds
} ClockTime;

static inline int64_t clock_ns(ClockTime time)
{
    return time.coarse * INT64_C(1000000000) + time.fine;
}

/** Of up to 68 years. */
static inline ClockTime clock_time(int64_t ns)
{
    return (ClockTime){(int32_t)(ns / 1000000000), (int32_t)(ns % 1000000000)};
}

/** What a clock can be commanded to do. */
typedef enum ClockCode {
    CLOCK_GOES_ON = 0,
    CLOCK_JAM = 1,  ///< it shows the value at once
    CLOCK_SLEW = 2, ///< it gains the value, or loses it if it is negative, at its slew rate
    CLOCK_ALIGN = 3 ///< it shows the value at the next pulse
} ClockCode;

/** A command to the slave clock of the vehicle. */
typedef struct ClockCommand {
    Head head;
    ClockCode code;
    uint32_t number; ///< [-] another one than that of the last command
    ClockTime value; ///< a time, or an offset
} ClockCommand;

/** The vehicle's clocks: the master, whose pulses reach the computer, and the computer's own slave. */
typedef struct ClockReading {
    Head head;
    ClockTime time;   ///< of the slave, now
    ClockTime tone;   ///< of the slave, at the last pulse
    ClockTime master; ///< of the master, at the last pulse
    uint32_t pulses;  ///< [-] how many there were since the slave's start
    uint32_t done;    ///< [-] number of the command that the slave obeyed last; 0 after its start
    uint32_t busy;    ///< [-] 1: a part of an offset is left, or it waits for a pulse to align
    uint32_t spare;
} ClockReading;

/** The vehicle's time, as flight knows it. */
typedef struct VehicleTimeState {
    Head head;
    int64_t time;          ///< [ns] of the vehicle, now
    int64_t error;         ///< [ns] of the slave clock against the master, at the last pulse
    uint32_t synchronized; ///< [-] in [0, 1]: 1 if the error is small
    uint32_t jams;         ///< [-] how often the slave was aligned anew
} VehicleTimeState;

/** Asks the interconnect to store or retrieve non-volatile memory. */
typedef enum NvmCode { NVM_NOTHING = 0, NVM_STORE = 1, NVM_RETRIEVE = 2 } NvmCode;

#define NVM_WORDS 8

/** A packet to or from the non-volatile memory. */
typedef struct NvmPacket {
    Head head;
    NvmCode code;
    uint32_t number;          ///< [-] another one than that of the last request; in a reply, that of its request
    uint32_t slot;            ///< [-] of the memory
    uint32_t refused;         ///< [-] in a reply, 1: there is no such slot
    uint32_t data[NVM_WORDS]; ///< [-] the content
} NvmPacket;

/** What the interconnect reports of itself. */
typedef struct InterconnectState {
    Head head;
    uint32_t stored;    ///< [-] requests, since the vehicle was switched on
    uint32_t retrieved; ///< [-] requests
    uint32_t refused;   ///< [-] requests
    uint32_t resets;    ///< [-] of the computer that it has seen
} InterconnectState;

#define RECORDER_PAGE 256

/** Asks the recorder to write or read a page. */
typedef enum RecorderCode { RECORDER_NOTHING = 0, RECORDER_WRITE = 1, RECORDER_READ = 2 } RecorderCode;

/** What became of a request. */
typedef enum RecorderAnswer {
    RECORDER_DONE = 0,
    RECORDER_CORRECTED = 1, ///< read; wrong bits were set right
    RECORDER_DAMAGED = 2,   ///< there are more wrong bits in a word of the page than its code corrects
    RECORDER_WORN = 3,      ///< the page takes nothing new
    RECORDER_REFUSED = 4    ///< there is no such page, or no such code
} RecorderAnswer;

/** A request to the recorder. */
typedef struct RecorderRequest {
    Head head;
    RecorderCode code;
    uint32_t number; ///< [-] another one than that of the last request
    uint32_t page;   ///< [-] from 0
    uint32_t spare;
    uint8_t data[RECORDER_PAGE]; ///< [-] the content to be written
} RecorderRequest;

/** The recorder's answer to the request that it served last. */
typedef struct RecorderReply {
    Head head;
    RecorderAnswer answer;
    uint32_t number;             ///< [-] of the request; 0 after the recorder was switched on
    uint32_t page;               ///< [-] of the request
    uint32_t pages;              ///< [-] how many the recorder has
    uint8_t data[RECORDER_PAGE]; ///< [-] the content that was read
} RecorderReply;

/** What the recorder reports of itself, since the vehicle was switched on. */
typedef struct RecorderState {
    Head head;
    uint32_t written;   ///< [-] pages
    uint32_t read;      ///< [-] pages, damaged ones included
    uint32_t corrected; ///< [-] words that had a wrong bit when they were read
    uint32_t damaged;   ///< [-] pages that had more wrong bits when they were read
    uint32_t worn;      ///< [-] requests to write that a worn page refused
    uint32_t refused;   ///< [-] other requests
    uint32_t torn;      ///< [-] pages of which a part was written when the power failed
    uint32_t busy;      ///< [-] in [0, 1]: 1: a request is being served
} RecorderState;

/** How the computer started. */
typedef struct BootState {
    Head head;
    uint32_t boots; ///< [-] starts of the computer, this one included, by the non-volatile count; 0: not yet known
    uint32_t kept;  ///< [-] in [0, 1]: 1: the count is stored
    uint32_t own;   ///< [-] starts that no reset from outside explains: by the board's watchdog
    uint32_t spare;
} BootState;

#define LOADS_MAX 8

/** A command to the power unit's controller. */
typedef struct PowerCommand {
    Head head;
    uint32_t number;    ///< [-] another one than that of the last command; 0: none
    uint32_t on;        ///< [-] the loads that shall be on, a bit for each
    uint32_t clear;     ///< [-] the trips to be cleared, a bit for each load
    uint32_t reset;     ///< [-] in [0, 1]: 1: reset the computer
    uint32_t heartbeat; ///< [-] changes while flight lives
    uint32_t spare;
} PowerCommand;

/** Housekeeping of the power unit. */
typedef struct PowerTelemetry {
    Head head;
    uint32_t number;             ///< [-] of the command that it obeyed last
    uint32_t on;                 ///< [-] the loads that are on, a bit for each
    uint32_t tripped;            ///< [-] the loads that a trip has switched off, a bit for each
    uint32_t trips;              ///< [-] how many there were
    uint16_t current[LOADS_MAX]; ///< [-] counts of the current of each load
    uint16_t bus;                ///< [-] counts of the voltage of the bus
    uint16_t spare[3];
} PowerTelemetry;

#define THRUSTERS_MAX 8

/** A burn for the propulsion card's queue. */
typedef struct BurnCommand {
    Head head;
    uint32_t number;   ///< [-] another one than that of the last burn; 0: none
    uint32_t thruster; ///< [-] from 0
    uint32_t armed;    ///< [-] in [0, 1]: 0 closes all thrusters and empties the queue
    uint32_t spare;
    int64_t start;    ///< [ns] of flight's time; past: at once
    int64_t duration; ///< [ns] of the burn
} BurnCommand;

/** What the propulsion card has done with the burns. */
typedef struct PropulsionState {
    Head head;
    uint32_t number;  ///< [-] of the burn that it took last
    uint32_t armed;   ///< [-] in [0, 1]: 1: by flight and by the switch
    uint32_t queued;  ///< [-] burns that wait
    uint32_t begun;   ///< [-] burns that have begun
    uint32_t refused; ///< [-] burns: too short, no such thruster, not armed, or no room
    uint32_t spare;
} PropulsionState;

/** When the thrusters are open: the burn of each that is under way or was the last one. */
typedef struct ThrusterTimes {
    Head head;
    int64_t on[THRUSTERS_MAX];     ///< [ns] it opens
    int64_t off[THRUSTERS_MAX];    ///< [ns] it closes
    uint32_t burns[THRUSTERS_MAX]; ///< [-] that have begun
} ThrusterTimes;

#endif
