// SPDX-License-Identifier: Apache-2.0
// A solar system for tests whose motion is known exactly: the Sun and Jupiter as points on circles
// about their barycentre, where their own gravity holds them.
#pragma once

#include "world/environment/sky.h"

#include <Eigen/Dense>

#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

namespace fledge::world::testing {

class TwoCircles {
public:
    static constexpr int sun = 10, jupiter = 599;
    static constexpr double mu_sun = 1.327e20, mu_jupiter = 1.267e17, distance = 7.78e11;
    static constexpr double day = 86'400.0;
    static constexpr double span = 20.0 * day; ///< [s] of the ephemeris, from J2000 on

    /// The angular rate of the line from the Sun to Jupiter [rad/s].
    static double rate() { return std::sqrt((mu_sun + mu_jupiter) / (distance * distance * distance)); }

    /// Maps the axes in which the motion is about the third axis to N's.
    static Eigen::Matrix3d plane() { return Eigen::AngleAxisd(0.4, Eigen::Vector3d(1, 2, 2) / 3.0).toRotationMatrix(); }

    /// Relative to the barycentre, t [s] past J2000.
    static Eigen::Vector3d r(int body, double t)
    {
        const double angle = rate() * t;
        return arm(body) * (plane() * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0));
    }
    static Eigen::Vector3d v(int body, double t)
    {
        const double angle = rate() * t;
        return arm(body) * rate() * (plane() * Eigen::Vector3d(-std::sin(angle), std::cos(angle), 0));
    }

    static Ephemeris ephemeris()
    {
        Ephemeris made;
        for (const int body : {sun, jupiter}) {
            auto records = std::make_shared<std::vector<double>>();
            for (double begin = 0.0; begin < span; begin += length) {
                append_record(*records, body, begin);
            }
            EphemerisSegment s;
            s.target = body;
            s.center = 0;
            s.first = s.start = 0.0;
            s.last = span;
            s.length = length;
            s.records = records->data();
            s.record_words = 2 + 3 * terms;
            s.count = records->size() / s.record_words;
            s.coefficients = terms;
            s.file = "two circles";
            made.add({s}, records);
        }
        return made;
    }

    /// A run that begins `day_of` days past J2000.
    static std::shared_ptr<const Sky> sky(int center, double day_of = 1.0)
    {
        const Epoch epoch{static_cast<std::int64_t>(day_of * day) * 1'000'000'000};
        return std::make_shared<const Sky>(ephemeris(), TimeSystem(), epoch, center);
    }

private:
    static constexpr double length = 2.0 * day;
    static constexpr int terms = 7; ///< each is 1e-3 of the one before or less

    static double arm(int body)
    {
        const double total = mu_sun + mu_jupiter;
        return body == sun ? -distance * mu_jupiter / total : distance * mu_sun / total;
    }

    /// The polynomials through the zeros of T_terms.
    static void append_record(std::vector<double> &records, int body, double begin)
    {
        const double half = length / 2.0;
        records.insert(records.end(), {begin + half, half});
        for (int axis = 0; axis < 3; axis++) {
            for (int k = 0; k < terms; k++) {
                double sum = 0.0;
                for (int j = 0; j < terms; j++) {
                    const double angle = std::numbers::pi * (j + 0.5) / terms;
                    const double t = begin + half + half * std::cos(angle);
                    sum += r(body, t)[axis] / 1e3 * std::cos(k * angle);
                }
                records.push_back((k == 0 ? 1.0 : 2.0) / terms * sum);
            }
        }
    }
};

} // namespace fledge::world::testing
