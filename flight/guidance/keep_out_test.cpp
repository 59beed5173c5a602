// SPDX-License-Identifier: Apache-2.0
// Ways around the Sun and the Moon, sampled by slerp: no boresight enters a cone, and few ways are long.
#include "flight/testing/consistency.h"
#include "flight/testing/poison.h"

#include <Eigen/Geometry>

extern "C" {
#include "flight/guidance/keep_out.h"
#include "flight/guidance/slew_profile.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace keep_out_test {

using Eigen::Quaterniond;
constexpr double degree = pi / 180;
constexpr std::int64_t second = 1'000'000'000;

KeepOut scene(Random &random, int boresights, double first, double second_angle)
{
    KeepOut m{};
    m.par.n = static_cast<std::uint32_t>(boresights);
    m.par.boresights_B[0] = vec3(0, 0, 1);
    m.par.boresights_B[1] = vec3(0.8, 0, -0.6);
    m.par.first_angle = first;
    m.par.second_angle = second_angle;
    m.par.margin = 2 * degree;
    m.par.reached = m.par.jump = 0.5 * degree;
    m.in.target = {good(), random.mrp(), {}, {}};
    m.in.attitude = {good(), random.mrp(), {}};
    m.in.first = {good(), vec(random.direction() * 1.5e11), {}, {}};
    if (second_angle > 0) {
        m.in.second = {good(), vec(random.direction() * 4e8), {}, {}};
    }
    return m;
}

Quaterniond turned(Vec3 sigma) ///< carries components in the body to those in N
{
    return Quaterniond(dcm(sigma).transpose());
}

/// [rad] The least angle of any boresight from a cone, in an attitude.
double clearance(const KeepOut &m, const Quaterniond &q)
{
    double least = pi;
    for (std::uint32_t k = 0; k < m.par.n; k++) {
        const Vector3d c = q * eigen(m.par.boresights_B[k]);
        const auto angle = [&](const BodyState &body) {
            const Vector3d s = (eigen(body.r_PN_N) - eigen(m.in.orbit.r_BN_N)).normalized();
            return std::atan2(c.cross(s).norm(), c.dot(s));
        };
        least = std::min(least, angle(m.in.first) - m.par.first_angle);
        if (m.par.second_angle > 0) {
            least = std::min(least, angle(m.in.second) - m.par.second_angle);
        }
    }
    return least;
}

struct Flown {
    KeepOutResult result = KEEP_OUT_NONE; ///< at the start
    double clearance = pi, length = 0, direct = 0, widest = 0;
    bool arrives = false;
};

/// The body goes where the module says, by turns about eigenaxes, `samples` on each.
Flown go(KeepOut m, int samples)
{
    Flown flown;
    keep_out_update(&m, {0, 0});
    flown.result = m.out.status.result;
    flown.direct = m.out.status.direct;
    for (int leg = 0; leg < 5 && !flown.arrives; leg++) {
        const Quaterniond from = turned(m.in.attitude.sigma_BN), to = turned(m.out.way.sigma_RN);
        flown.widest = std::max(flown.widest, from.angularDistance(to));
        flown.length += from.angularDistance(to);
        for (int k = 0; k <= samples; k++) {
            flown.clearance = std::min(flown.clearance, clearance(m, from.slerp(double(k) / samples, to)));
        }
        flown.arrives = same_content(m.out.way, m.in.target);
        m.in.attitude.sigma_BN = m.out.way.sigma_RN;
        keep_out_update(&m, {(leg + 1) * second, second});
    }
    return flown;
}

struct Tally {
    int result[6] = {}, deeper = 0;
    double clearance = pi, longest = 0, sum = 0;
};

Tally fly_many(int n, int boresights, double first, double second_angle)
{
    Random random{1};
    Tally tally;
    for (int i = 0; i < n; i++) {
        const KeepOut m = scene(random, boresights, first, second_angle);
        const Flown flown = go(m, 60);
        tally.result[flown.result]++;
        if (flown.result == KEEP_OUT_CLEAR || flown.result == KEEP_OUT_DETOUR) {
            EXPECT_TRUE(flown.arrives);
            tally.clearance = std::min(tally.clearance, flown.clearance);
        }
        if (flown.result == KEEP_OUT_DETOUR) {
            tally.longest = std::max(tally.longest, flown.length - flown.direct);
            tally.sum += flown.length - flown.direct;
        }
        tally.deeper += flown.result == KEEP_OUT_START_INSIDE &&
                        flown.clearance < clearance(m, turned(m.in.attitude.sigma_BN)) - 1e-6;
    }
    return tally;
}

TEST(KeepOut, no_boresight_enters_a_cone_on_the_way)
{
    const int n = campaign_runs(500, 10000);
    const bool tell = n == 10000;
    for (int boresights = 1; boresights <= 2; boresights++) {
        for (const auto &[first, second_angle] : {std::pair{20.0, 0.0}, {35.0, 15.0}, {35.0, 65.0}, {60.0, 0.0}}) {
            const Tally tally = fly_many(n, boresights, first * degree, second_angle * degree);
            const int *of = tally.result;
            EXPECT_GT(tally.clearance, -1e-6);
            EXPECT_GE(of[KEEP_OUT_DETOUR], n / 50);
            EXPECT_LE(of[KEEP_OUT_NO_PATH], boresights == 1 ? 0 : n / 100);
            EXPECT_LE(tally.deeper, second_angle < 60 ? 0 : of[KEEP_OUT_START_INSIDE] / 10) << "if cones overlap";
            EXPECT_LT(tally.sum / of[KEEP_OUT_DETOUR], 50 * degree);
            if (tell) {
                std::printf("%d, %2.0f and %2.0f deg: clear %d, detour %d, target inside %d, start inside %d (deeper "
                            "%d), no path %d; clearance %.3f deg, detours %.1f deg longer, at most %.0f\n",
                            boresights, first, second_angle, of[1], of[2], of[3], of[4], tally.deeper, of[5],
                            tally.clearance / degree, tally.sum / of[2] / degree, tally.longest / degree);
            }
        }
    }
}

TEST(KeepOut, clearance_and_lengths_are_those_of_the_samples)
{
    Random random{2};
    int near = 0;
    for (int i = 0; i < 300; i++) {
        KeepOut m = scene(random, 1 + i % 2, 30 * degree, i % 3 ? 20 * degree : 0);
        keep_out_update(&m, {0, 0});
        if (m.out.status.result == KEEP_OUT_CLEAR || m.out.status.result == KEEP_OUT_DETOUR) {
            const Flown flown = go(m, 400);
            if (flown.widest < 177 * degree) { // else a turn may go either way round
                EXPECT_NEAR(flown.clearance, m.out.status.clearance, 1e-4);
                near++;
            }
            EXPECT_LE(m.out.status.clearance, flown.clearance + 1e-7);
            EXPECT_NEAR(flown.length, m.out.status.length, 1e-6);
            EXPECT_EQ(m.out.status.points > 0, m.out.status.result == KEEP_OUT_DETOUR);
        }
    }
    EXPECT_GT(near, 100);
}

TEST(KeepOut, detours_are_little_longer_than_the_shortest_by_one_way_point)
{
    Random random{3};
    double ratio = 0, worst = 0;
    int n = 0;
    while (n < 30) {
        const KeepOut m = scene(random, 1, 30 * degree, 0);
        const Flown flown = go(m, 20);
        if (flown.result != KEEP_OUT_DETOUR) {
            continue;
        }
        const Quaterniond a = turned(m.in.attitude.sigma_BN), z = turned(m.in.target.sigma_RN);
        double best = 1e9;
        for (int k = 0; k < 4000; k++) {
            const Vector3d by = random.direction() * random.real(0, 1.2);
            const Quaterniond w = Quaterniond(turn(by, by.norm())) * a.slerp(random.real(0.2, 0.8), z);
            const double length = a.angularDistance(w) + w.angularDistance(z);
            bool free = length < best;
            for (int j = 0; j <= 30 && free; j++) {
                free = clearance(m, a.slerp(j / 30.0, w)) > 0 && clearance(m, w.slerp(j / 30.0, z)) > 0;
            }
            best = free ? length : best;
        }
        n++;
        ratio += flown.length / best / 30;
        worst = std::max(worst, flown.length / best);
    }
    EXPECT_LT(ratio, 1.1);
    EXPECT_LT(worst, 1.5);
}

/// A slew about y that would take the boresight z through the Sun.
KeepOut through_the_sun()
{
    KeepOut m{};
    m.par = {1, 0, {vec3(0, 0, 1)}, 30 * degree, 0, 2 * degree, 0.5 * degree, 0.5 * degree};
    m.in.attitude = {good(), vec3(0, std::tan(-60 * degree / 4), 0), {}};
    m.in.target = {good(), vec3(0, std::tan(60 * degree / 4), 0), vec3(1e-4, 0, 0), {}};
    m.in.first = {good(), vec3(1e9, 0, 1.5e11), {}, {}};
    return m;
}

TEST(KeepOut, a_body_led_by_a_slew_profile_keeps_out)
{
    KeepOut m = through_the_sun();
    SlewProfile slew{};
    slew.par = {1 * degree, 0.02 * degree, 0.5 * degree, 0};
    double least = pi, nearest = 0;
    std::uint32_t slews = 0;
    for (int k = 0; k < 900; k++) {
        m.in.target.sigma_RN = mrp_compose(m.in.target.sigma_RN, mrp_turn(vec3(1e-4, 0, 0)));
        m.in.target.head.t = slew.in.attitude.head.t = k * second;
        keep_out_update(&m, {k * second, k ? second : 0});
        slew.in.target = m.out.way;
        slew.in.attitude = m.in.attitude;
        slew_profile_update(&slew, {k * second, k ? second : 0});
        const AttReference &r = slew.out.reference;
        m.in.attitude = {good(), r.sigma_RN, mat_vec(mrp_to_dcm(r.sigma_RN), r.omega_RN_N)};
        least = std::min(least, clearance(m, turned(r.sigma_RN)));
        nearest = m.out.status.clearance;
        slews = slew.out.status.slews;
    }
    EXPECT_GT(least, 0);
    EXPECT_LT(least, 6 * degree) << "it went around, not far away";
    EXPECT_EQ(m.out.status.plans, 1u);
    EXPECT_EQ(slews, 1u + m.mem.points) << "one to each way-point, one to the target";
    EXPECT_EQ(slew.out.status.phase, SLEW_TRACKING);
    EXPECT_TRUE(same_content(slew.out.reference, m.in.target));
    EXPECT_EQ(m.out.status.result, KEEP_OUT_CLEAR);
    EXPECT_GT(nearest, 0);
}

TEST(KeepOut, what_it_does_inside_cones_and_without_a_way)
{
    KeepOut m = through_the_sun();
    keep_out_update(&m, {0, 0});
    EXPECT_EQ(m.out.status.result, KEEP_OUT_DETOUR);
    EXPECT_EQ(m.out.way.head.quality, QUALITY_GOOD);
    EXPECT_EQ(m.out.way.omega_RN_N.v[0], 0) << "a way-point rests";

    KeepOut x = m;
    x.in.target.sigma_RN = vec3(0, 0, 0.1);
    keep_out_update(&x, {second, second});
    EXPECT_EQ(x.out.status.result, KEEP_OUT_TARGET_INSIDE);
    EXPECT_TRUE(same_content(x.out.way, x.in.target));
    EXPECT_EQ(x.out.way.head.quality, QUALITY_DEGRADED);
    EXPECT_LT(x.out.status.clearance, 0);

    x = m;
    keep_out_reset(&x);
    x.in.attitude.sigma_BN = vec3(0.02, -0.05, 0);
    keep_out_update(&x, {0, 0});
    EXPECT_EQ(x.out.status.result, KEEP_OUT_START_INSIDE);
    EXPECT_EQ(x.out.way.head.quality, QUALITY_DEGRADED);
    EXPECT_GT(clearance(x, turned(x.out.way.sigma_RN)), 2 * degree) << "first out of the cone";
    x.in.attitude.sigma_BN = x.out.way.sigma_RN;
    keep_out_update(&x, {second, second});
    EXPECT_EQ(x.out.status.result, KEEP_OUT_DETOUR) << "and then around";

    // Two opposite boresights have a belt left about the first body, and the second one cuts it in two.
    x = m;
    x.par.n = 2;
    x.par.boresights_B[1] = vec3(0, 0, -1);
    x.par.first_angle = 60 * degree;
    x.par.second_angle = 31 * degree;
    x.in.second = {good(), vec3(4e8, 0, 0), {}, {}};
    x.in.attitude.sigma_BN = vec3(std::tan(pi / 8), 0, 0);
    x.in.target.sigma_RN = vec3(-std::tan(pi / 8), 0, 0);
    keep_out_reset(&x);
    keep_out_update(&x, {0, 0});
    EXPECT_EQ(x.out.status.result, KEEP_OUT_NO_PATH);
    EXPECT_EQ(x.out.way.head.quality, QUALITY_DEGRADED);
    EXPECT_LT(difference(dcm(x.out.way.sigma_RN), dcm(x.in.attitude.sigma_BN)), 1e-15) << "it stays";
    x.in.second.head = {};
    keep_out_update(&x, {second, second});
    EXPECT_EQ(x.out.status.result, KEEP_OUT_DETOUR) << "until there is a way";
}

TEST(KeepOut, a_way_is_planned_anew_where_bodies_or_targets_move)
{
    KeepOut m = through_the_sun();
    keep_out_update(&m, {0, 0});
    for (int k = 1; k < 5; k++) {
        keep_out_update(&m, {k * second, second});
        EXPECT_EQ(m.out.status.plans, 1u);
    }
    KeepOut x = m;
    x.in.first.r_PN_N = vec3(-1e11, 0, -1e11);
    keep_out_update(&x, {6 * second, second});
    EXPECT_EQ(x.out.status.plans, 1u) << "the way is free still";
    x.in.first.r_PN_N = mat_transpose_vec(mrp_to_dcm(x.out.way.sigma_RN), vec3(0, 0, 1e11));
    keep_out_update(&x, {7 * second, second});
    EXPECT_EQ(x.out.status.plans, 2u);
    m.in.target.sigma_RN = vec3(0, std::tan(-70 * degree / 4), 0);
    keep_out_update(&m, {6 * second, second});
    EXPECT_EQ(m.out.status.plans, 2u);
    EXPECT_EQ(m.out.status.result, KEEP_OUT_CLEAR);
    m.in.first.r_PN_N = m.in.orbit.r_BN_N = vec3(0, 0, 7e6);
    m.in.first.r_PN_N.v[0] = -1e5; // seen from the orbit, in the direction of -x
    m.in.orbit.head = with(QUALITY_STALE);
    keep_out_update(&m, {8 * second, second});
    EXPECT_NEAR(m.out.status.clearance, clearance(m, turned(m.in.target.sigma_RN)), 1e-9);
    EXPECT_EQ(m.out.way.head.quality, QUALITY_DEGRADED);
}

TEST(KeepOut, without_sound_numbers_the_way_is_held)
{
    KeepOut m = through_the_sun();
    keep_out_update(&m, {0, 0});
    expect_held(
        m,
        doubles(m.in.target.sigma_RN, m.in.attitude.sigma_BN, m.in.first.r_PN_N, m.par.first_angle,
                m.par.boresights_B[0]),
        [](KeepOut &x) {
            keep_out_update(&x, {second, second});
        },
        [](KeepOut &x) {
            return std::vector{&x.out.way.head, &x.out.status.head};
        });
    keep_out_reset(&m);
    m.in.first.head = {};
    keep_out_update(&m, {0, 0});
    EXPECT_TRUE(all_zero(m.out));
}

} // namespace keep_out_test
} // namespace flight::testing
