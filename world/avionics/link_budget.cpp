// SPDX-License-Identifier: Apache-2.0
#include "world/avionics/link_budget.h"

#include "flight/math/elementary.h"
#include "world/constants.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace fledge::world {

namespace {

using std::numbers::pi;

} // namespace

double decibels(double ratio)
{
    return 10.0 / std::numbers::ln10 * fm_log(ratio);
}

double ratio(double decibels)
{
    return fm_exp(std::numbers::ln10 / 10.0 * decibels);
}

double bit_error_rate(RadioCode code, double eb_n0)
{
    if (code == RADIO_BLOCK) {
        return 0.0;
    }
    if (code == RADIO_UNCODED) {
        return 0.5 * complementary_error(std::sqrt(eb_n0));
    }
    // Wrong bits on all wrong paths of each distance from the right one, for the generators 171 and 133.
    constexpr double weights[] = {36, 211, 1404, 11633, 77433, 502690};
    double sum = 0.0, distance = 10.0;
    for (const double weight : weights) {
        sum += weight * 0.5 * complementary_error(std::sqrt(0.5 * distance * eb_n0));
        distance += 2.0;
    }
    return std::min(sum, 0.5);
}

double free_space_loss(double range, double frequency)
{
    return 2.0 * decibels(4.0 * pi * range * frequency / speed_of_light);
}

double pattern_loss(double angle, double beam, double floor)
{
    return std::min(12.0 * (angle / beam) * (angle / beam), floor);
}

double beam_share(double angle, double radius, double beam)
{
    // A Gaussian beam, over the strips of the disc across the way to the axis. The strips of the middle count; near the
    // rim of the disc they become narrow, so that the steps are those of an angle.
    const double sigma = beam / std::sqrt(8.0 * std::numbers::ln2);
    const double from = std::max(-radius, angle - 8.0 * sigma), to = std::min(radius, angle + 8.0 * sigma);
    if (!(from < to)) {
        return 0.0;
    }
    const double begin = fm_asin(from / radius), step = (fm_asin(to / radius) - begin) / 128;
    double sum = 0.0;
    for (int i = 0; i <= 128; i++) {
        double sine, cosine;
        fm_sincos(begin + i * step, &sine, &cosine);
        const double off = (radius * sine - angle) / sigma, half = radius * std::max(cosine, 0.0);
        const double weight = i == 0 || i == 128 ? 1.0 : i % 2 ? 4.0 : 2.0; // Simpson
        sum += weight * fm_exp(-0.5 * off * off) * (1.0 - complementary_error(half / (sigma * std::sqrt(2.0)))) * half;
    }
    return sum * step / 3.0 / (sigma * std::sqrt(2.0 * pi));
}

} // namespace fledge::world
