// SPDX-License-Identifier: Apache-2.0
// Directions that a body sees, with errors, and what an attitude from them must say of bad ones.
#pragma once

#include "flight/testing/consistency.h"
#include "flight/testing/poison.h"

#include "flight/msg/navigation.h"
#include "flight/msg/sensors.h"

#include <gtest/gtest.h>

#include <vector>

namespace flight::testing {

/// An attitude, and directions that a body with it sees, of which any two are `apart`, also from the opposite.
struct Sky {
    Matrix3d dcm_BN;
    std::vector<SeenDirection> seen;

    Sky(Random &random, int n, double apart, double std_min, double std_max) : dcm_BN(random.attitude())
    {
        std::vector<Vector3d> known;
        while (static_cast<int>(known.size()) < n) {
            const Vector3d candidate = random.direction();
            bool fits = true;
            for (const Vector3d &other : known) {
                fits = fits && candidate.cross(other).norm() > std::sin(apart);
            }
            if (fits) {
                known.push_back(candidate);
            }
        }
        for (const Vector3d &direction : known) {
            const double std = std_min * std::pow(std_max / std_min, random.real(0, 1));
            seen.push_back({good(), vec3(0, 0, 0), vec(direction), std});
        }
        measure(random, 1);
    }

    /// Measures all directions, with errors of the given part of their standard deviation.
    void measure(Random &random, double part)
    {
        for (SeenDirection &direction : seen) {
            const Vector3d w = dcm_BN * eigen(direction.d_N), e = random.normals(part * direction.std);
            const double angle = (e - w * w.dot(e)).norm();
            const Vector3d side = (e - w * w.dot(e)) / (angle + 1e-300);
            direction.d_B = vec(Vector3d(std::cos(angle) * w + std::sin(angle) * side));
        }
    }

    /// The small turn from the attitude of the body to another one, in the axes of B.
    Vector3d error(Vec3 sigma_BN) const
    {
        const Matrix3d c = dcm(sigma_BN) * dcm_BN.transpose();
        const Vector3d s = Vector3d(c(1, 2) - c(2, 1), c(2, 0) - c(0, 2), c(0, 1) - c(1, 0)) / 2;
        const double angle = std::atan2(s.norm(), (c.trace() - 1) / 2);
        return s * (angle / (s.norm() + 1e-300));
    }
};

/// Errors as large as they are reported, and misfits. `take` gives a module the directions of a sky.
template <class Module, class Take>
void expect_fix_consistent(Take take, UpdateOf<Module> update, int most, double apart, double std_max)
{
    Random random{5};
    const int n = campaign_runs(4000, 100'000);
    double error = 0, misfit = 0, freedom = 0, about = 0;
    for (int i = 0; i < n; i++) {
        Sky sky(random, 2 + i % (most - 1), apart, std_max / 30, std_max);
        Module m{};
        m.par.separation_min = 0.02;
        m.par.together = 1;
        m.par.gate = 10;
        take(m, sky);
        update(&m, {0, 0});
        ASSERT_EQ(m.out.attitude.head.quality, QUALITY_GOOD);
        const Matrix3d P = eigen(m.out.attitude.P_B);
        const Vector3d e = sky.error(m.out.attitude.sigma_BN), axis = random.direction();
        error += e.dot(P.inverse() * e) / n;
        about += std::pow(axis.dot(e), 2) / axis.dot(P * axis) / n;
        misfit += m.out.state.misfit / n;
        freedom += (2.0 * static_cast<double>(sky.seen.size()) - 3) / n;
        EXPECT_NEAR(m.out.state.std, std::sqrt(P.trace()), 1e-12);
    }
    expect_chi_square(error, 3, n);
    expect_chi_square(about, 1, n);
    expect_chi_square(misfit, freedom, n);
}

/// What both say of missing, old, parallel and bad directions. `ports` gives those of a module.
template <class Module, class Ports> void expect_fix_faults(Ports ports, UpdateOf<Module> update)
{
    Random random{6};
    constexpr std::int64_t second = 1'000'000'000;
    Module m{};
    const std::vector<SeenDirection *> in = ports(m);
    m.par.separation_min = 0.2;
    m.par.together = 0.5;
    m.par.gate = 4;
    const auto sky_at = [&](std::int64_t t) {
        Sky sky(random, 2, 0.5, 0.001, 0.01);
        *in[0] = sky.seen[0], *in[1] = sky.seen[1];
        in[0]->head.t = in[1]->head.t = t;
        return sky;
    };
    const auto expect = [&](std::int64_t t, Quality quality, FixFinding finding, std::int64_t of) {
        update(&m, {t, second});
        EXPECT_EQ(m.out.attitude.head.quality, quality) << finding;
        EXPECT_EQ(m.out.state.finding, finding);
        EXPECT_EQ(m.out.attitude.head.t, of) << finding;
    };
    expect(0, QUALITY_NONE, FIX_ALONE, 0); // never written
    std::int64_t t = second;
    sky_at(t);
    *in[1] = {};
    expect(t, QUALITY_NONE, FIX_ALONE, 0);
    Sky sky = sky_at(t);
    expect(t, QUALITY_GOOD, FIX_SOUND, t);
    const auto written = m.out;
    in[0]->d_B = vec3(1, 0, 0); // not new
    update(&m, {t + 1, 1});
    in[0]->head.t = t + 1; // only one is new
    update(&m, {t + 1, 1});
    EXPECT_EQ(std::memcmp(&m.out, &written, sizeof written), 0);
    sky_at(5 * t); // to come
    update(&m, {t + 2, 1});
    EXPECT_EQ(m.out.attitude.head.t, t);

    sky_at(5 * t);
    in[1]->head.t = 4 * t; // too far apart
    expect(5 * t, QUALITY_DEGRADED, FIX_ALONE, t);
    in[1]->head.t = 5 * t - second / 4;
    expect(5 * t, QUALITY_GOOD, FIX_SOUND, 5 * t);
    for (const double sign : {1.0, -1.0}) {
        sky = sky_at(6 * t);
        in[1]->d_N = vec_unit(vec_add(vec_scale(sign, in[0]->d_N), vec_scale(0.15, in[1]->d_N)));
        in[1]->d_B = vec(Vector3d(sky.dcm_BN * eigen(in[1]->d_N)));
        expect(6 * t, QUALITY_DEGRADED, FIX_PARALLEL, 5 * t);
        in[1]->d_N = vec_scale(sign, in[0]->d_N), in[1]->d_B = vec_scale(sign, in[0]->d_B);
        expect(6 * t, QUALITY_DEGRADED, FIX_PARALLEL, 5 * t);
    }
    sky = sky_at(7 * t);
    in[1]->d_B = vec_unit(vec_add(in[1]->d_B, vec_scale(0.5, in[0]->d_B))); // nearer to each other than known
    expect(7 * t, QUALITY_DEGRADED, FIX_MISFIT, 7 * t);
    EXPECT_GT(m.out.state.misfit, 16);
    sky_at(8 * t);
    in[0]->head.quality = QUALITY_DEGRADED;
    expect(8 * t, QUALITY_DEGRADED, FIX_DEGRADED, 8 * t);
    for (const double bad : {0.0, -1.0, 5.0, std::nan(""), HUGE_VAL}) { // an error of 5 rad is one
        for (double *at : {&in[0]->std, &in[1]->std, &in[0]->d_B.v[0], &in[1]->d_N.v[2]}) {
            if ((at == &in[0]->std || at == &in[1]->std) ? bad != 5.0 : std::abs(bad) != 1.0 && bad != 0.0) {
                sky_at(9 * t);
                *at = bad;
                expect(9 * t, QUALITY_DEGRADED, FIX_ALONE, 8 * t);
            }
        }
    }
    sky_at(9 * t);
    in[0]->std = in[1]->std = 1e-200; // their squares are zero
    expect(9 * t, QUALITY_DEGRADED, FIX_INVALID, 8 * t);
    sky_at(2 * t); // the clock was set back
    expect(2 * t, QUALITY_GOOD, FIX_SOUND, 2 * t);

    for (int round = 0; round < campaign_runs(20000, 1'000'000); round++) {
        sky_at(round);
        for (SeenDirection *direction : in) {
            direction->head = {random.below(9) ? round : INT64_MIN, any_quality(random), 1};
            throw_numbers(doubles(direction->std), random, 9 * random.below(2));
            if (random.below(3) == 0) {
                direction->d_N = vec(random.direction());
                direction->d_B = random.below(2) ? vec(random.direction()) : direction->d_N;
            }
            if (random.below(3) == 0) {
                throw_numbers(doubles(direction->d_B, direction->d_N), random, round);
            }
        }
        update(&m, {round, 1});
        expect_finite(doubles(m.out.attitude.sigma_BN, m.out.attitude.P_B, m.out.state.misfit, m.out.state.std), round);
        ASSERT_LE(vec_norm(m.out.attitude.sigma_BN), 1 + 1e-15);
    }
}

} // namespace flight::testing
