// SPDX-License-Identifier: Apache-2.0
// The closed forms of a radio link, whose bits are the same on all machines.
#pragma once

#include "world/avionics/radio.h"
#include "world/error_function.h"

namespace fledge::world {

double decibels(double ratio);
double ratio(double decibels);

/// Of a receiver that is locked, in [0, 0.5].
double bit_error_rate(RadioCode code, double eb_n0);

/// [dB] at a range [m] and frequency [Hz] (Friis).
double free_space_loss(double range, double frequency);

/// [dB] below the gain on the axis at an angle [rad] from it, of a beam so wide [rad] at half power; at most `floor`.
double pattern_loss(double angle, double beam, double floor);

/// The share of a beam's power [rad, at half power] that comes from a disc of this radius [rad], at an angle [rad]
/// from the axis: the part of the noise temperature of the disc that the antenna sees.
double beam_share(double angle, double radius, double beam);

} // namespace fledge::world
