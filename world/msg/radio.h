/* SPDX-License-Identifier: Apache-2.0 */
/* What a radio link does. Levels are in decibels. */
#ifndef WORLD_MSG_RADIO_H
#define WORLD_MSG_RADIO_H

#include "flight/msg/head.h"

/** Why the receiver of a link is locked or not. */
typedef enum RadioState {
    RADIO_SILENT = 0, ///< nothing is known yet
    RADIO_LOCKED = 1,
    RADIO_LOW = 2,    ///< the spacecraft is below the station's mask
    RADIO_HIDDEN = 3, ///< a body hides it
    RADIO_WEAK = 4,   ///< Eb/N0 is too low
    RADIO_OFF = 5     ///< the radio has no power
} RadioState;

/** One direction of a radio link, for the bits that leave the spacecraft now, or that reach it now. */
typedef struct RadioLink {
    Head head;
    double range;          ///< [m] that the signal travels
    double light_time;     ///< [s] that it travels
    double elevation;      ///< [rad] of the spacecraft over the station's horizon
    double off_axis;       ///< [rad] from the axis of the antenna on board to the station; 0: it has none
    double sun_angle;      ///< [rad] between the spacecraft and the Sun, as the station sees them; pi without a Sun
    double gain_dB;        ///< [-] of the antenna on board relative to that on its axis
    double loss_dB;        ///< [-] in free space
    double noise_dB;       ///< [-] how much the Sun raises the noise of the station
    double c_n0_dBHz;      ///< [-] carrier to noise density
    double eb_n0_dB;       ///< [-] energy of a bit to noise density
    double bit_error_rate; ///< [-] in [0, 0.5]: of a receiver that is locked
    RadioState state;
    uint32_t lock; ///< [-] in [0, 1]: 1: the receiver is locked
} RadioLink;

/** What became of the units of bytes (packets, frames) of one direction since the reset. */
typedef struct RadioTraffic {
    Head head;
    uint64_t bytes;    ///< [-] that were received
    uint32_t sent;     ///< [-] units that the transmitter took
    uint32_t dropped;  ///< [-] units for which it had no room
    uint32_t lost;     ///< [-] units without lock
    uint32_t received; ///< [-] units
    uint32_t damaged;  ///< [-] units of these with wrong bits
    uint32_t waiting;  ///< [-] bytes that wait for the transmitter or are on the way
} RadioTraffic;

#endif
