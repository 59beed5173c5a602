// SPDX-License-Identifier: Apache-2.0
// Any set of sensors, against the Sun that lit them, a search of directions, and SunPyramids.
#include "flight/testing/base.h"
#include "flight/testing/eigen.h"

extern "C" {
#include "flight/sensing/sun_direction.h"
#include "flight/sensing/sun_pyramids.h"
}

#include <Eigen/SVD>

#include <algorithm>
#include <cmath>
#include <vector>

namespace flight::testing {
namespace sun_direction_test {

constexpr double full = 5e-3; // [A]

SunDirection sensors(const std::vector<Vector3d> &axes)
{
    SunDirection m{};
    m.par.n = static_cast<std::uint32_t>(axes.size());
    m.par.dark = 0.02;
    m.par.differ = 0.01;
    for (std::size_t i = 0; i < axes.size(); i++) {
        m.par.axes_B[i] = vec(axes[i]);
        m.par.current[i] = full;
    }
    m.in.currents.head = good();
    return m;
}

const std::vector<Vector3d> cube{Vector3d::UnitX(),  -Vector3d::UnitX(), Vector3d::UnitY(),
                                 -Vector3d::UnitY(), Vector3d::UnitZ(),  -Vector3d::UnitZ()};

double cosine(const SunDirection &m, std::size_t i, const Vector3d &s)
{
    const double c = eigen(m.par.axes_B[i]).normalized().dot(s);
    return c > (m.par.view[i] > 0 ? std::cos(m.par.view[i]) : 0.0) ? c : 0.0;
}

/// An update with what the Sun at s makes of the sensors, and `noise` of the cosines.
SunHeading see(SunDirection &m, const Vector3d &s, double noise = 0, std::uint64_t seed = 1)
{
    Random random{seed};
    for (std::size_t i = 0; i < m.par.n; i++) {
        m.in.currents.current[i] = full * (cosine(m, i, s) + random.real(-noise, noise));
    }
    sun_direction_update(&m, {0, 0});
    return m.out.heading;
}

/// The least singular value of the axes of the lit sensors: 0 if they lie in a plane.
double spread(const SunDirection &m)
{
    Eigen::MatrixXd lit(3, m.par.n);
    for (std::size_t i = 0; i < m.par.n; i++) {
        const bool is_lit = m.out.cosines.lit >> i & 1u;
        lit.col(static_cast<Eigen::Index>(i)) =
            is_lit ? Vector3d(eigen(m.par.axes_B[i]).normalized()) : Vector3d(0, 0, 0);
    }
    return m.par.n < 3 ? 0.0 : Eigen::JacobiSVD<Eigen::MatrixXd>(lit).singularValues()(2);
}

std::vector<Vector3d> any_axes(Random &random)
{
    std::vector<Vector3d> axes(static_cast<std::size_t>(1 + random.below(8)));
    for (Vector3d &axis : axes) {
        axis = random.real(0.1, 3) * random.direction();
    }
    return axes;
}

TEST(SunDirection, is_where_the_Sun_is_wherever_three_lit_sensors_do_not_lie_in_a_plane)
{
    Random random{1};
    int met = 0;
    for (int round = 0; round < runs(3000); round++) {
        SunDirection m = sensors(any_axes(random));
        const Vector3d s = random.direction();
        const SunHeading heading = see(m, s);
        EXPECT_EQ(m.out.cosines.n, m.par.n);
        if (spread(m) > 0.1) {
            EXPECT_EQ(heading.head.quality, QUALITY_GOOD);
            EXPECT_LT((eigen(heading.s_B) - s).norm(), 1e-12);
            met++;
        } else if (spread(m) < 1e-9) {
            EXPECT_LE(heading.head.quality, QUALITY_DEGRADED);
        }
    }
    EXPECT_GT(met, runs(3000) / 10);
}

TEST(SunDirection, no_other_direction_explains_noisy_readings_better)
{
    Random random{2};
    for (int round = 0; round < runs(300); round++) {
        SunDirection m = sensors(cube);
        m.par.differ = 1;
        m.par.weight[round % 6] = 4;
        const Vector3d s = random.direction();
        const SunHeading heading = see(m, s, 0.01, static_cast<std::uint64_t>(round));
        if (spread(m) < 0.1) {
            continue;
        }
        const auto misfit = [&](const Vector3d &guess) {
            double sum = 0;
            for (std::size_t i = 0; i < 6; i++) {
                const double reads = m.in.currents.current[i] / full, there = cube[i].dot(guess);
                const bool lit = reads >= m.par.dark;
                const double rest = lit ? reads - there : std::min(0.0, std::max(reads, 0.0) - there);
                sum += (m.par.weight[i] > 0 ? m.par.weight[i] : 1) * rest * rest;
            }
            return sum;
        };
        const double least = misfit(eigen(heading.s_B));
        for (int k = 0; k < 100; k++) {
            const double size = k < 50 ? 2 : 1e-3;
            EXPECT_LE(least, misfit((eigen(heading.s_B) + size * random.direction()).normalized()) + 1e-9);
        }
    }
}

TEST(SunDirection, of_two_pyramids_it_has_the_bits_of_SunPyramids)
{
    Random random{3};
    std::vector<Vector3d> axes;
    for (unsigned i = 0; i < 8; i++) {
        axes.emplace_back(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i < 4 ? std::sqrt(2) : -std::sqrt(2));
    }
    SunDirection m = sensors(axes);
    SunPyramids both{};
    both.par.persistence = 10;
    both.par.dark = m.par.dark;
    both.par.differ = m.par.differ;
    both.par.scale[0] = both.par.scale[1] = 2e-6;
    std::copy_n(m.par.axes_B, 8, both.par.axes_B);
    std::copy_n(m.par.current, 8, both.par.current);
    both.in.a.head = both.in.b.head = good();
    for (int round = 0; round < runs(500); round++) {
        const Vector3d s = random.direction();
        for (std::size_t i = 0; i < 8; i++) {
            const auto count = static_cast<std::uint16_t>(std::round(full * cosine(m, i, s) / 2e-6));
            (i < 4 ? both.in.a : both.in.b).counts[i % 4] = count;
            m.in.currents.current[i] = 2e-6 * count;
        }
        sun_direction_update(&m, {0, 0});
        sun_pyramids_update(&both, {0, 0});
        EXPECT_EQ(eigen(m.out.heading.s_B), eigen(both.out.heading.s_B));
        EXPECT_EQ(m.out.cosines.lit, both.out.cosines.lit);
    }
}

TEST(SunDirection, one_or_two_lit_sensors_give_it_degraded_near_their_plane_alone)
{
    SunDirection m = sensors(cube);
    const SunHeading along = see(m, Vector3d::UnitY());
    EXPECT_EQ(along.head.quality, QUALITY_DEGRADED);
    EXPECT_EQ(eigen(along.s_B), Vector3d(Vector3d::UnitY()));
    const Vector3d edge = Vector3d(3, 0, -4) / 5;
    const SunHeading between = see(m, edge);
    EXPECT_EQ(between.head.quality, QUALITY_DEGRADED);
    EXPECT_LT((eigen(between.s_B) - edge).norm(), 1e-12);

    SunDirection two = sensors({Vector3d::UnitX(), Vector3d::UnitY()});
    EXPECT_EQ(see(two, Vector3d(3, 4, 0) / 5).head.quality, QUALITY_DEGRADED);
    const Head before = two.out.heading.head;
    const SunHeading held = see(two, Vector3d(2, 2, 1) / 3); // or at (2, 2, -1) / 3
    EXPECT_EQ(held.head.sequence, before.sequence);
    EXPECT_EQ(eigen(held.s_B), Vector3d(Vector3d(3, 4, 0) / 5));
    EXPECT_EQ(two.out.cosines.lit, 3u);
}

TEST(SunDirection, a_dark_sensor_excludes_its_field_of_view_and_no_more)
{
    std::vector<Vector3d> axes{Vector3d::UnitX(), Vector3d::UnitY(), Vector3d::UnitZ(), Vector3d(1, 1, 0).normalized()};
    const Vector3d s = Vector3d(1, 1, 1).normalized(); // 35 degrees off the last axis
    SunDirection m = sensors(axes);
    m.par.view[3] = 0.5;
    EXPECT_EQ(see(m, s).head.quality, QUALITY_GOOD);
    EXPECT_LT((eigen(m.out.heading.s_B) - s).norm(), 1e-12);
    m.par.view[3] = 0.7;
    m.in.currents.current[3] = 0;
    sun_direction_update(&m, {0, 0});
    EXPECT_EQ(m.out.heading.head.quality, QUALITY_DEGRADED); // it should be lit: nothing explains that
    EXPECT_EQ(m.out.heading.head.sequence, 1u);
}

TEST(SunDirection, counts_of_a_converter_are_currents)
{
    SunDirection m = sensors(cube);
    m.par.scale = 2e-6;
    m.par.offset = -1e-5;
    m.in.currents.head = {};
    m.in.counts.head = good();
    const Vector3d s = Vector3d(2, -3, 6) / 7;
    for (std::size_t i = 0; i < 6; i++) {
        m.in.counts.counts[i] = static_cast<std::uint16_t>(std::round((full * cosine(m, i, s) + 1e-5) / 2e-6));
    }
    sun_direction_update(&m, {0, 0});
    EXPECT_EQ(m.out.heading.head.quality, QUALITY_GOOD);
    EXPECT_LT((eigen(m.out.heading.s_B) - s).norm(), 5e-4);
}

TEST(SunDirection, without_light_or_readings_it_is_held)
{
    SunDirection m = sensors(cube);
    m.in.currents.head = {};
    sun_direction_update(&m, {0, 0});
    EXPECT_EQ(m.out.heading.head.quality, QUALITY_NONE);
    m.in.currents.head = good();
    const Vector3d s = Vector3d(2, -3, 6) / 7;
    EXPECT_EQ(see(m, s).head.quality, QUALITY_GOOD);
    m.in.currents.head.quality = QUALITY_STALE;
    EXPECT_EQ(see(m, s).head.quality, QUALITY_DEGRADED);
    std::fill_n(m.in.currents.current, 8, 0.0);
    sun_direction_update(&m, {0, 0});
    EXPECT_EQ(m.out.heading.head.sequence, 2u); // an eclipse
    EXPECT_LT((eigen(m.out.heading.s_B) - s).norm(), 1e-12);
    EXPECT_EQ(m.out.cosines.lit, 0u);
    m.in.currents.current[2] = std::nan("");
    sun_direction_update(&m, {0, 0});
    EXPECT_EQ(m.out.cosines.head.sequence, 3u);
}

} // namespace sun_direction_test
} // namespace flight::testing
