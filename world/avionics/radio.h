/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_AVIONICS_RADIO_H
#define WORLD_AVIONICS_RADIO_H

#include "world/msg/craft.h"
#include "world/msg/power.h"
#include "world/msg/radio.h"

/** How bits are coded. All are modulated by BPSK or QPSK, and Eb is the energy of a bit of data. */
typedef enum RadioCode {
    RADIO_UNCODED = 0,       ///< the bits as they are
    RADIO_CONVOLUTIONAL = 1, ///< rate 1/2, constraint length 7, soft decisions: the union bound on its bit errors
    RADIO_BLOCK = 2          ///< a long code, such as turbo or LDPC: no errors from `required` on
} RadioCode;

/** The radio of a spacecraft and its links with a ground station: the budget of each direction, and the bytes that it
 *  carries between flight and the ground. Python's `station` is the world.GroundStation; `shadows` are bodies that may
 *  hide it, besides its own; `sun` raises its noise; `sky` says where they are; `serves` names the flight process, if
 *  that is not `flight`. A unit of bytes, such as a packet, waits for the transmitter, is lost without lock, gets
 *  wrong bits at the bit error rate, and arrives one light time later. What finds no room is dropped.
 *  Assumptions: straight rays at the speed of light; no acquisition, Doppler, refraction, rain or scintillation beyond
 *  `loss`; the station's antenna follows the spacecraft; the pattern of both antennas is that of a main lobe, on board
 *  over a floor; the Sun is an even disc; a link keeps from one update to the next.
 *  Source: Friis for free space; ITU-R S.672 for the main lobe; Proakis for the bit errors; CCSDS 131.0-B for codes. */
typedef struct Radio {
    struct {
        CraftState truth;
        LoadSupply power; ///< optional: without it the radio is on
    } in;
    struct {
        RadioLink down; ///< spacecraft to station
        RadioLink up;
        RadioTraffic down_traffic;
        RadioTraffic up_traffic;
    } out;
    struct {
        Vec3 axis_B;             ///< [-] axis of the antenna on board; 0: it sends alike in all directions
        double beam;             ///< [rad] >= 0, <= 6.283185307179586: its width at half power, if it has an axis
        double floor_dB;         ///< [-] >= 0, <= 200: how far its gain falls at most; 0: 30
        double down_frequency;   ///< [Hz] required, >= 1e6, <= 1e12: of telemetry
        double up_frequency;     ///< [Hz] required, >= 1e6, <= 1e12: of commands
        double down_eirp_dBW;    ///< [-] required, in [-200, 200]: power of the spacecraft on the antenna's axis
        double up_eirp_dBW;      ///< [-] required, in [-200, 200]: power of the station
        double down_g_t_dBK;     ///< [-] required, in [-200, 200]: gain to temperature of the station, without the Sun
        double up_g_t_dBK;       ///< [-] required, in [-200, 200]: the same of the spacecraft, on the antenna's axis
        double down_loss_dB;     ///< [-] >= 0, <= 200: of air, pointing, polarization, demodulator together
        double up_loss_dB;       ///< [-] >= 0, <= 200: the same
        double down_rate;        ///< [1/s] required, >= 1, <= 1e12: bits of data per second
        double up_rate;          ///< [1/s] required, >= 1, <= 1e12: bits of data per second
        double down_required_dB; ///< [-] in [-200, 200]: least Eb/N0 with which the receiver locks
        double up_required_dB;   ///< [-] in [-200, 200]: the same
        RadioCode down_code;     ///< of telemetry
        RadioCode up_code;       ///< of commands
        uint32_t down_room;      ///< [-] <= 268435456: bytes that may wait or be on the way, 32 more for each unit;
                                 ///< 0: 65536
        uint32_t up_room;        ///< [-] <= 268435456: the same
        uint32_t load;           ///< [-] in [0, 31]: the radio's load in the power unit
        uint32_t spare;
        double station_beam;   ///< [rad] >= 0, <= 3.141592653589793: width of the station's antenna at half power
        double station_noise;  ///< [K] >= 0, <= 1e9: temperature of its system without the Sun
        double sun_brightness; ///< [K] >= 0, <= 1e9: the Sun's at the frequency of the downlink
    } par;
} Radio;

#endif
