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

/** The currents of coarse sun sensors. */
typedef struct SunCurrents {
    Head head;
    double current[SUN_SENSORS_MAX]; ///< [A] of each sensor
} SunCurrents;

/** What one converter makes of the currents of the coarse sun sensors. */
typedef struct SunSensorCounts {
    Head head;
    uint16_t counts[SUN_SENSORS_MAX]; ///< [-] of the converter
} SunSensorCounts;

/** A time as registers tag a measurement with it: ticks of up to 1 s, modulo 2^32. */
static inline uint32_t time_tag(int64_t t, int64_t tick)
{
    return (uint32_t)(t / tick);
}

/** [ns] The last time up to `now` that has a tag. */
static inline int64_t tag_time(uint32_t tag, int64_t tick, int64_t now)
{
    const uint32_t age = time_tag(now, tick) - tag;
    return tick_since(now - now % tick, (int64_t)age * tick);
}

/** What the electronics of a star tracker hold: its last measurement. */
typedef struct StarTrackerRegisters {
    Head head;
    int32_t q[4];      ///< [-] counts of the quaternion of its case S relative to N, scalar first
    uint32_t time;     ///< [-] tag of the measurement
    uint32_t counter;  ///< [-] of its measurements
    uint32_t tracks;   ///< [-] in [0, 1]: 1: it sees its stars
    uint32_t residual; ///< [-] counts of the deviation of its stars, about an axis across its boresight
} StarTrackerRegisters;

/** What flight makes of a star tracker's registers. */
typedef struct StarTrackerState {
    Head head;
    uint32_t tracks;  ///< [-] in [0, 1]: 1: it sees its stars
    uint32_t refused; ///< [-] measurements: no unit quaternion, too old, or of too large a residual
} StarTrackerState;

/** What the electronics of gyros hold: the angle that the body has turned about each axis. */
typedef struct GyroRegisters {
    Head head;
    uint32_t angle[3]; ///< [-] counts, modulo 2^bits
    uint32_t time;     ///< [-] tag of the last sample
    uint32_t counter;  ///< [-] of the samples
    uint32_t spare;
} GyroRegisters;

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

/** For a module that keeps something in a slot of the memory, given as place + 1, at each update: the request that has
 *  been answered, NVM_NOTHING while it has not. After a start the slot is retrieved, whatever was requested before. */
static inline NvmCode nvm_answered(NvmPacket *request, const NvmPacket *reply, uint32_t slot, int64_t t)
{
    if (slot == 0u || !head_written(reply->head)) {
        request->head = head_held(request->head);
        return NVM_NOTHING;
    }
    request->head = head_next(request->head, t, QUALITY_GOOD);
    if (request->code == NVM_NOTHING) {
        request->code = NVM_RETRIEVE;
        request->number = reply->number + 1u;
        request->slot = slot - 1u;
        return NVM_NOTHING;
    }
    return reply->number == request->number ? request->code : NVM_NOTHING;
}

/** The checksum that stands in the last word of a slot, of the others; mark: of the module that keeps it. */
static inline uint32_t nvm_check(const uint32_t *words, uint32_t mark)
{
    uint32_t sum = mark;
    for (uint32_t i = 0u; i + 1u < NVM_WORDS; i++) {
        sum = (sum ^ words[i]) * 16777619u; /* odd: each change of a word changes it */
    }
    return sum;
}

/** Let the request be to store its data, whose last word becomes the checksum. */
static inline void nvm_store(NvmPacket *request, uint32_t mark)
{
    request->code = NVM_STORE;
    request->number++;
    request->data[NVM_WORDS - 1] = nvm_check(request->data, mark);
}

/** Whether a slot has something that was kept: 0: never, -1: it is damaged. */
static inline int nvm_has(const uint32_t *words, uint32_t mark)
{
    uint32_t any = 0u;
    for (uint32_t i = 0u; i < NVM_WORDS; i++) {
        any |= words[i];
    }
    return any == 0u ? 0 : words[NVM_WORDS - 1] == nvm_check(words, mark) ? 1 : -1;
}

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
    uint32_t number; ///< [-] of the request; 0 after the recorder was switched on
    uint32_t page;   ///< [-] of the request
    uint32_t pages;  ///< [-] how many the recorder has
    uint32_t used;   ///< [-] up to the last one that was ever written: what is behind them is empty
    uint32_t spare;
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

#define SWITCH_CARDS 4
#define CARD_LOADS 8
#define LOADS_MAX 32 ///< load 8 c + k is load k of switch card c

/** A command to the controller card of the power unit. */
typedef struct PowerCommand {
    Head head;
    uint32_t number;    ///< [-] another one than that of the last command; 0: none
    uint32_t on;        ///< [-] the loads that shall be on, a bit for each
    uint32_t clear;     ///< [-] the trips to be cleared, a bit for each load
    uint32_t reset;     ///< [-] in [0, 1]: 1: reset the computer
    uint32_t heartbeat; ///< [-] changes while flight lives
    uint32_t spare;
} PowerCommand;

/** Housekeeping of a switch card. */
typedef struct SwitchCard {
    uint32_t counter;             ///< [-] of its reports; it stands still while the card does not work
    uint32_t on;                  ///< [-] its loads that are on, a bit for each
    uint32_t tripped;             ///< [-] its loads that a trip has switched off, a bit for each
    uint32_t trips;               ///< [-] how many there were
    uint16_t current[CARD_LOADS]; ///< [-] counts of the current of each load
} SwitchCard;

/** Housekeeping of the power unit: of its controller card, and of its switch cards. */
typedef struct PowerTelemetry {
    Head head;
    uint32_t counter;   ///< [-] of the controller's reports; it stands still while the card does not work
    uint32_t number;    ///< [-] of the command that it obeyed last
    uint32_t heartbeat; ///< [-] of flight, as it saw it last
    uint16_t bus;       ///< [-] counts of the voltage of the bus
    uint16_t battery;   ///< [-] of 65535: how full the battery is
    SwitchCard cards[SWITCH_CARDS];
} PowerTelemetry;

/** The loads that are on as the cards report them, a bit for each of all 32. */
static inline uint32_t power_on(const PowerTelemetry *power)
{
    uint32_t on = 0u;
    for (uint32_t c = 0; c < SWITCH_CARDS; c++) {
        on |= (power->cards[c].on & 0xFFu) << CARD_LOADS * c;
    }
    return on;
}

/** The loads that a trip has switched off, likewise. */
static inline uint32_t power_tripped(const PowerTelemetry *power)
{
    uint32_t tripped = 0u;
    for (uint32_t c = 0; c < SWITCH_CARDS; c++) {
        tripped |= (power->cards[c].tripped & 0xFFu) << CARD_LOADS * c;
    }
    return tripped;
}

/** The power unit, as flight sees it. */
typedef struct PowerState {
    Head head;
    uint32_t on;      ///< [-] the loads that are on, a bit for each; none of a silent card
    uint32_t tripped; ///< [-] the loads that a trip has switched off, a bit for each
    uint32_t silent;  ///< [-] the cards whose reports stand still, a bit for each; bit 4: the controller
    uint32_t battery; ///< [-] of 65535: how full the battery is, as last reported
} PowerState;

#define ARRAYS_MAX 4

/** Where the drives of solar arrays shall turn them. */
typedef struct ArrayDriveCommand {
    Head head;
    int32_t target[ARRAYS_MAX]; ///< [-] steps from the position at which each array was at the beginning
} ArrayDriveCommand;

/** What the drives of solar arrays report. */
typedef struct ArrayDriveState {
    Head head;
    int32_t position[ARRAYS_MAX]; ///< [-] counts of the sensor of each angle
    uint32_t counter;             ///< [-] of the reports; it stands still while the drives have no power
    uint32_t moving;              ///< [-] drives that are under way, a bit for each
} ArrayDriveState;

/** How solar arrays point. */
typedef struct ArrayPointingState {
    Head head;
    double off[ARRAYS_MAX]; ///< [rad] angle between the normal of each array and the Sun
    uint32_t stuck;         ///< [-] drives that do not come nearer to their target, a bit for each
    uint32_t spare;
} ArrayPointingState;

#define THRUSTERS_MAX 8

/** Burn times of the thrusters of a propulsion card. What flight wrote last counts alone, so that a burn goes on with a
 *  longer duration, ends with a shorter one, and a command that is lost takes nothing with it. */
typedef struct PropulsionCommand {
    Head head;
    uint32_t number;                 ///< [-] which the card shows
    uint32_t armed;                  ///< [-] in [0, 1]: 0: no thruster opens
    int64_t start[THRUSTERS_MAX];    ///< [ns] of flight's time: when each opens
    int64_t duration[THRUSTERS_MAX]; ///< [ns] for how long; 0: it stays shut
} PropulsionCommand;

/** Housekeeping of a propulsion card. */
typedef struct PropulsionState {
    Head head;
    uint32_t counter; ///< [-] of its reports; it stands still while the card does not work
    uint32_t number;  ///< [-] of the command that it obeys
    uint32_t armed;   ///< [-] in [0, 1]: 1: by flight
    uint32_t begun;   ///< [-] burns that have begun
    uint32_t refused; ///< [-] burns: too short, over before they came, or of no thruster
    uint32_t spare;
    uint32_t driven[THRUSTERS_MAX];  ///< [-] of its steps, those in which it had each open at some time
    uint32_t flowing[THRUSTERS_MAX]; ///< [-] those in which the pressure of each showed a thrust at some time
} PropulsionState;

/** A propulsion card and its thrusters, as flight sees them. */
typedef struct PropulsionHealth {
    Head head;
    uint32_t stuck_open; ///< [-] thrusters that give thrust while they are shut, a bit for each
    uint32_t stuck_shut; ///< [-] thrusters that gave none when they were open, a bit for each
    uint32_t silent;     ///< [-] in [0, 1]: 1: the card's reports stand still
    uint32_t disarmed;   ///< [-] in [0, 1]: 1: the card is not armed, though it shall be
} PropulsionHealth;

/** When the thrusters are open: the burn of each that is under way or was the last one. */
typedef struct ThrusterTimes {
    Head head;
    int64_t on[THRUSTERS_MAX];     ///< [ns] it opens
    int64_t off[THRUSTERS_MAX];    ///< [ns] it closes
    uint32_t burns[THRUSTERS_MAX]; ///< [-] that have begun
} ThrusterTimes;

#endif
