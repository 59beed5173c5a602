// SPDX-License-Identifier: Apache-2.0
// What SunOnBoard and MoonOnBoard share: rows of JPL's DE405, derivatives, the reports of bad times.
#pragma once

#include "flight/testing/derivative.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/msg/ephemeris.h"
#include "flight/msg/orbit.h"
}

namespace flight::testing {

struct SkyRow {
    double days; ///< UTC since 2000-01-01T12:00:00
    Vector3d r;  ///< [m]
    Vector3d v;  ///< [m/s]
};

inline UtcTime utc(double days)
{
    return {good(), std::llround(days * 86400e9)};
}

/// The angle between two directions [deg].
inline double apart(const Vector3d &a, const Vector3d &b)
{
    return std::atan2(a.cross(b).norm(), a.dot(b)) * 180 / pi;
}

/// `at` gives the module's BodyState at a number of days.
template <class At> void expect_rows(At at, const std::vector<SkyRow> &rows, double deg, double m, double mps)
{
    for (const SkyRow &row : rows) {
        const BodyState found = at(row.days);
        EXPECT_EQ(found.head.quality, QUALITY_GOOD);
        EXPECT_LT(apart(eigen(found.r_PN_N), row.r), deg) << row.days;
        EXPECT_NEAR(vec_norm(found.r_PN_N), row.r.norm(), m) << row.days;
        EXPECT_LT((eigen(found.v_PN_N) - row.v).norm(), mps) << row.days;
    }
}

/// Velocity and acceleration are the derivatives of the position; relative.
template <class At> void expect_derivatives(At at, double of_v, double of_a)
{
    Random random{1};
    for (int i = 0; i < 300; i++) {
        const double days = std::floor(random.real(0, 18000) * 64) / 64;
        const auto r = [&](double t) -> Vector3d { return eigen(at(days + t / 86400).r_PN_N); };
        const auto v = [&](double t) -> Vector3d { return eigen(at(days + t / 86400).v_PN_N); };
        const BodyState now = at(days);
        EXPECT_LT((derivative<Vector3d, 3>(r, 5400) - eigen(now.v_PN_N)).norm(), of_v * vec_norm(now.v_PN_N));
        EXPECT_LT((derivative<Vector3d, 3>(v, 5400) - eigen(now.a_PN_N)).norm(), of_a * vec_norm(now.a_PN_N));
    }
}

/// The reports of times that are unknown, stale, or not of these years; `body` is the module's output.
template <class Module>
void expect_honest(UpdateOf<Module> update, void (*reset)(Module *), BodyState &(*body)(Module &))
{
    Module m{};
    update(&m, {1, 1});
    EXPECT_TRUE(all_zero(m.out)) << "no time";
    for (const auto &[days, quality] : {std::pair{-0.5, QUALITY_GOOD},
                                        {-0.51, QUALITY_DEGRADED},
                                        {18262.49, QUALITY_GOOD},
                                        {18262.5, QUALITY_DEGRADED}}) {
        m.in.time = utc(days);
        update(&m, {7, 1});
        EXPECT_EQ(body(m).head.quality, quality) << days;
        EXPECT_EQ(body(m).head.t, 7);
    }
    EXPECT_EQ(body(m).head.sequence, 4U);
    m.in.time = utc(9000);
    m.in.time.head.quality = QUALITY_STALE;
    update(&m, {8, 1});
    EXPECT_EQ(body(m).head.quality, QUALITY_DEGRADED);
    m.in.time.head.quality = QUALITY_NONE;
    update(&m, {9, 1});
    EXPECT_EQ(body(m).head.sequence, 5U);
    for (const std::int64_t time : {INT64_MIN, INT64_MAX}) {
        m.in.time = {good(), time};
        update(&m, {10, 1});
        EXPECT_NE(body(m).head.quality, QUALITY_GOOD);
        EXPECT_TRUE(eigen(body(m).r_PN_N).allFinite() && eigen(body(m).a_PN_N).allFinite());
    }
    reset(&m);
    EXPECT_TRUE(all_zero(m.out));
}

} // namespace flight::testing
