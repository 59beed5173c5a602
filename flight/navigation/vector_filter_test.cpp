// SPDX-License-Identifier: Apache-2.0
#include "flight/navigation/testing/vector_mission.h"

#include <algorithm>

namespace flight::testing {
namespace vector_filter_test {

using Mission = VectorMission;
using Matrix9d = Eigen::Matrix<double, 9, 9>;

TEST(VectorFilter, its_errors_are_as_large_as_it_says)
{
    double all = 0, attitude = 0;
    Innovations fit;
    int n = 0;
    for (int seed = 1; seed <= campaign_runs(100, 1000); seed++) {
        Mission f(static_cast<std::uint64_t>(seed));
        const double from = f.random.real(800, 1600);
        fit.used[0] = fit.used[1] = 0;
        f.run(400);
        while (f.seconds() < from) {
            f.step();
            fit.measure(f.state());
        }
        EXPECT_EQ(f.state().restarts, 0u);
        if (f.quality() == QUALITY_GOOD) { // not where it waits in the dark for the Sun
            all += f.normalised(9);
            attitude += f.normalised(3);
            n++;
        }
    }
    EXPECT_GT(n, campaign_runs(100, 1000) * 3 / 4);
    expect_chi_square(all / n, 9, n);
    expect_chi_square(attitude / n, 3, n);
    expect_chi_square(fit.sum[0] / fit.n[0], 2, fit.n[0]);
    expect_chi_square(fit.sum[1] / fit.n[1], 3, fit.n[1]);
}

/// At first the attitude has the error of the magnetometer's bias.
TEST(VectorFilter, at_first_its_errors_are_no_larger_than_it_says)
{
    double sum = 0;
    const int n = campaign_runs(400, 4000);
    for (int seed = 1; seed <= n; seed++) {
        Mission f(static_cast<std::uint64_t>(20'000 + seed));
        f.phase = 0;
        f.run(f.random.real(2, 20));
        sum += f.quality() == QUALITY_NONE ? 3 : f.normalised(3);
    }
    EXPECT_LT(sum / n, 3 + 3 * std::sqrt(6. / n));
    EXPECT_GT(sum / n, 1.5);
}

TEST(VectorFilter, where_it_is_good_its_errors_are_as_large_as_it_says_whatever_the_sensors_do)
{
    const int missions = campaign_runs(100, 1000);
    std::vector<double> times;
    double all = 0, worst = 0;
    int n = 0;
    for (int seed = 1; seed <= missions; seed++) {
        Mission f(static_cast<std::uint64_t>(10'000 + seed));
        const double duration = campaign_runs(1200, 3000), at = f.random.real(duration / 2, duration);
        spoil(f, duration);
        double first = -1, good = -1;
        bool looked = false;
        while (f.seconds() < duration) {
            f.step();
            first = first < 0 && f.quality() != QUALITY_NONE ? f.seconds() : first;
            if (f.quality() != QUALITY_GOOD) {
                continue;
            }
            good = good < 0 ? f.seconds() : good;
            const Vector3d by_std = f.error().head<3>().cwiseQuotient(eigen(f.state().attitude_std));
            worst = std::max(worst, by_std.cwiseAbs().maxCoeff());
            if (!looked && f.seconds() > at) {
                looked = true;
                all += f.normalised(9);
                n++;
            }
        }
        if (good >= 0) {
            times.push_back(good - first);
        }
    }
    EXPECT_LT(worst, 7) << "standard deviations, about any axis, ever";
    EXPECT_GE(n, missions / 3) << "the others wait for the Sun";
    expect_chi_square(all / n, 9, n);
    std::sort(times.begin(), times.end());
    const double median = times[times.size() / 2], most = times[times.size() * 95 / 100];
    std::printf("good after %g s (median), %g s (95 %%), %g s (all); largest error %.1f std\n", median, most,
                times.back(), worst);
    EXPECT_LT(median, 60);
    EXPECT_LT(most, 600);
}

/// Against a dense filter whose sensitivities are numerical derivatives.
TEST(VectorFilter, a_measurement_is_that_of_a_dense_filter)
{
    for (const bool field : {false, true}) {
        Mission f(3);
        f.phase = 0;
        f.run(30);
        VectorFilter m = f.m;
        const VectorEstimate before = m.mem.at;
        Eigen::Map<const Eigen::Matrix<double, 9, 9, Eigen::RowMajor>> root(&before.root[0][0]);
        const Matrix9d P = root.transpose() * root;
        using State = Eigen::Matrix<double, 9, 1>;
        const Matrix3d A = dcm(before.sigma_BN);
        const auto turned = [&](const Vector3d &x) -> Matrix3d { return turn(x, x.norm() + 1e-300) * A; };
        const auto predicted = [&](const State &x) -> Vector3d {
            const Matrix3d B = turned(x.head<3>());
            return field ? Vector3d(B * eigen(f.known.B_N) + eigen(before.field_bias_B) + x.tail<3>())
                         : Vector3d(B * f.sun_N);
        };
        const Vector3d seen = predicted(State::Zero()) + (field ? 3e-7 : 1e-3) * f.random.direction();
        Eigen::Matrix<double, 3, 9> H;
        for (int i = 0; i < 9; i++) {
            const double h = i < 3 ? 1e-4 : 1e-6;
            H.col(i) = (predicted(h * State::Unit(i)) - predicted(-h * State::Unit(i))) / (2 * h);
        }
        // A direction has no component along itself: there, any error will do.
        const Vector3d b = predicted(State::Zero());
        const Matrix3d R = field ? Matrix3d(std::pow(f.field_noise, 2) * Matrix3d::Identity())
                                 : Matrix3d(std::pow(f.sun_std, 2) * Matrix3d::Identity() + 1e3 * b * b.transpose());
        const Eigen::Matrix<double, 9, 3> K = P * H.transpose() * (H * P * H.transpose() + R).inverse();
        const State x = K * (seen - b);
        Matrix9d reset = Matrix9d::Identity();
        reset.topLeftCorner<3, 3>() -= 0.5 * skew(Vector3d(x.head<3>()));
        const Matrix9d expected = reset * (Matrix9d::Identity() - K * H) * P * reset.transpose();

        m.in.first = {field ? Head{} : good(f.t), vec(Vector3d(seen.normalized())), vec(f.sun_N), f.sun_std};
        m.in.field = {field ? good(f.t) : Head{}, vec(seen)};
        m.in.start = {};
        vector_filter_update(&m, {f.t, 0});
        ASSERT_EQ(m.out.state.used[field ? 3 : 0], f.state().used[field ? 3 : 0] + 1);
        Eigen::Map<const Eigen::Matrix<double, 9, 9, Eigen::RowMajor>> after(&m.mem.at.root[0][0]);
        const State scale = expected.diagonal().cwiseSqrt().cwiseInverse();
        const Matrix9d off = after.transpose() * after - expected;
        EXPECT_LT((scale.asDiagonal() * off * scale.asDiagonal()).cwiseAbs().maxCoeff(), 1e-4) << field;
        EXPECT_LT(difference(dcm(m.mem.at.sigma_BN), turned(x.head<3>())), field ? 1e-9 : 3e-6) << field;
        EXPECT_LT((eigen(m.mem.at.bias_B) - eigen(before.bias_B) - x.segment<3>(3)).norm(), 1e-3 * 1e-5);
        EXPECT_LT((eigen(m.mem.at.field_bias_B) - eigen(before.field_bias_B) - x.tail<3>()).norm(), 1e-3 * 1e-6);
    }
}

/// For some seconds, both sensors see a world that is turned.
TEST(VectorFilter, leaves_a_wrong_start)
{
    unsigned restarts = 0;
    for (std::uint64_t seed = 1; seed <= 40; seed++) {
        Mission f(seed);
        f.phase = 0;
        const double angle = f.random.real(0.5, 3.1);
        const Matrix3d wrong = turn(f.random.direction(), angle);
        f.fault = [&](Mission &now) {
            if (now.seconds() < 10 && now.t / Mission::step_ns % 2 == 1) {
                now.sun.d_B = vec(Vector3d(wrong * eigen(now.sun.d_B)));
                now.field.B_B = vec(Vector3d(wrong * eigen(now.field.B_B)));
            }
        };
        f.run(300);
        restarts += f.state().restarts;
        EXPECT_LT(f.error().head<3>().norm(), 6 * vec_norm(f.state().attitude_std)) << seed;
        EXPECT_LT(vec_norm(f.state().attitude_std), 3 * degree) << seed;
        EXPECT_EQ(f.quality(), QUALITY_GOOD) << seed;
    }
    EXPECT_GT(restarts, 20u);
}

TEST(VectorFilter, a_stuck_sensor_does_not_draw_it_away)
{
    for (const bool of_sun : {true, false}) {
        Mission f(5);
        f.phase = 0;
        f.run(300);
        const Vec3 sun = f.sun.d_B, field = f.field.B_B;
        f.fault = [&](Mission &now) { (of_sun ? now.sun.d_B : now.field.B_B) = of_sun ? sun : field; };
        f.run(600);
        EXPECT_EQ(f.state().restarts, 0u);
        EXPECT_GT(f.state().rejected[of_sun ? 0 : 3], 200u);
        EXPECT_LT(f.error().head<3>().norm(), 5 * vec_norm(f.state().attitude_std)) << of_sun;
    }
}

TEST(VectorFilter, with_one_direction_it_is_good_as_long_as_the_gyro_carries)
{
    Mission f(6, 0); // at rest: the turn about the Sun's direction cannot be seen
    f.omega.setZero();
    f.phase = 0;
    f.run(600);
    ASSERT_EQ(f.quality(), QUALITY_GOOD);
    f.fault = [](Mission &now) { now.field = {}; };
    f.run(20);
    EXPECT_EQ(f.quality(), QUALITY_GOOD);
    f.run(2700);
    EXPECT_EQ(f.quality(), QUALITY_DEGRADED);
    const Vector3d e = f.error().head<3>(), std = eigen(f.state().attitude_std);
    EXPECT_LT(e.cwiseQuotient(std).cwiseAbs().maxCoeff(), 4);
    EXPECT_LT((f.dcm_BN() * f.sun_N).cross(e).norm(), 1 * degree);
    f.fault = nullptr;
    f.run(60);
    EXPECT_EQ(f.quality(), QUALITY_GOOD);
    EXPECT_EQ(f.state().restarts, 0u);

    Mission alone(7);
    alone.fault = [](Mission &now) { now.field = {}; };
    alone.run(60);
    EXPECT_EQ(alone.quality(), QUALITY_NONE) << "one direction begins nothing";
}

TEST(VectorFilter, gaps_of_the_gyro)
{
    Mission f(8);
    f.phase = 0;
    f.run(600);
    const auto drop = [](Mission &now) { now.m.in.gyro.head.quality = QUALITY_STALE; };
    f.fault = drop;
    f.run(1.5);
    EXPECT_EQ(f.quality(), QUALITY_DEGRADED);
    EXPECT_LT(f.error().head<3>().norm(), 5 * vec_norm(f.state().attitude_std));
    f.fault = nullptr;
    f.run(5);
    EXPECT_EQ(f.quality(), QUALITY_GOOD);
    EXPECT_EQ(f.state().restarts, 0u);
    const double known = vec_norm(f.state().field_bias_std);
    f.fault = drop;
    f.run(30);
    const Head held = f.m.out.attitude.head;
    EXPECT_EQ(held.quality, QUALITY_DEGRADED);
    f.run(1);
    EXPECT_EQ(f.m.out.attitude.head.sequence, held.sequence);
    f.fault = nullptr;
    f.run(60);
    EXPECT_EQ(f.state().restarts, 1u);
    EXPECT_EQ(f.quality(), QUALITY_GOOD);
    EXPECT_LT(vec_norm(f.state().field_bias_std), 1.2 * known) << "the biases outlive it";
    EXPECT_LT(f.error().head<3>().norm(), 5 * vec_norm(f.state().attitude_std));
}

TEST(VectorFilter, old_measurements_are_late_and_those_to_come_wait)
{
    Mission f(9);
    f.phase = 0;
    f.run(600);
    const VectorFilterState before = f.state();
    f.fault = [](Mission &now) {
        now.sun.head.t = now.t - 2'000'000'000;
        now.field.head.t = now.t + 1;
    };
    f.run(10);
    EXPECT_GE(f.state().late - before.late, 17u) << "at first, they are no newer than the last";
    EXPECT_EQ(f.state().used[3], before.used[3]);
    EXPECT_EQ(f.state().used[0], before.used[0]);
    f.fault = nullptr;
    f.run(30);
    EXPECT_GT(f.state().used[3], before.used[3] + 25);
    EXPECT_EQ(f.quality(), QUALITY_GOOD);
}

TEST(VectorFilter, a_direction_along_the_expected_one_turns_nothing)
{
    Mission f(12);
    f.phase = 0;
    f.run(60);
    VectorFilter m = f.m;
    m.mem.at.sigma_BN = vec3(0, 0, 0);
    m.in.field = {};
    m.in.start = {};
    m.in.first = {good(f.t), vec3(1, 0, 0), vec3(1, 0, 0), f.sun_std};
    VectorFilter opposite = m;
    vector_filter_update(&m, {f.t, 0});
    EXPECT_EQ(m.out.state.used[0], f.state().used[0] + 1);
    EXPECT_EQ(m.out.state.misfit[0], 0.0);
    EXPECT_EQ(vec_norm(m.mem.at.sigma_BN), 0.0);
    opposite.in.first.d_B = vec3(-1, 0, 0);
    vector_filter_update(&opposite, {f.t, 0});
    EXPECT_EQ(opposite.out.state.rejected[0], f.state().rejected[0] + 1);
    EXPECT_GT(opposite.out.state.misfit[0], m.par.gate * m.par.gate) << "to some side";
}

TEST(VectorFilter, a_start_from_before_the_last_measurement_makes_none_count_twice)
{
    Mission f(13);
    f.phase = 0;
    f.m.par.age_max = 4;
    f.run(100);
    f.fault = [](Mission &now) { now.m.in.gyro.head.quality = now.sun.head.quality = QUALITY_STALE; };
    f.run(0.5);
    const NavAttitude then = f.m.out.attitude;
    f.run(2);
    VectorFilter m = f.m;
    ASSERT_EQ(m.mem.running, 0u) << "too long without a rate";
    ASSERT_GT(m.mem.seen[3], then.head.t);
    m.in.field.head.t = m.mem.seen[3];
    m.in.field.B_B.v[0] += 1e-9;
    m.in.gyro.head = good(f.t);
    m.in.start = {good(then.head.t), then.sigma_BN, mat(Matrix3d(1e-4 * Matrix3d::Identity()))};
    vector_filter_update(&m, {f.t, Mission::step_ns});
    EXPECT_EQ(m.mem.running, 1u);
    EXPECT_EQ(m.mem.used[3], f.m.mem.used[3]);
    EXPECT_EQ(m.mem.rejected[3], f.m.mem.rejected[3]);
    EXPECT_EQ(m.mem.restarts, f.m.mem.restarts);
}

TEST(VectorFilter, bad_numbers_leave_it_sound)
{
    VectorFilter nothing = Mission(1).m;
    vector_filter_update(&nothing, {0, 0});
    vector_filter_update(&nothing, {1, 1});
    EXPECT_TRUE(all_zero(nothing.out));
    Mission f(10);
    f.phase = 0;
    f.run(300);
    for (const double bad : {0.0, std::nan(""), HUGE_VAL, 1e160, 1e308}) {
        for (int port = 0; port < 8; port++) {
            if (port == 5 && bad == 0.0) {
                continue; // a rate like any other
            }
            f.fault = [&](Mission &now) {
                double *const at[] = {&now.sun.std,
                                      &now.sun.d_B.v[0],
                                      &now.sun.d_N.v[1],
                                      &now.field.B_B.v[2],
                                      &now.known.B_N.v[0],
                                      &now.m.in.gyro.omega_BN_B.v[1],
                                      &now.m.in.known_field.B_N.v[0],
                                      &now.m.in.third.std};
                *at[port] = bad;
            };
            f.run(1);
            EXPECT_TRUE(vec_finite(f.m.out.attitude.sigma_BN));
            f.fault = nullptr;
            f.run(20);
            EXPECT_LT(f.error().head<3>().norm(), 5 * vec_norm(f.state().attitude_std)) << bad << " at " << port;
            EXPECT_EQ(f.quality(), QUALITY_GOOD) << bad << " at " << port;
        }
    }
    f.fault = [](Mission &now) { now.sun.d_B = vec_neg(now.sun.d_B); }; // the opposite direction
    f.run(60);
    EXPECT_NE(f.quality(), QUALITY_GOOD) << "in doubt";
    EXPECT_LT(f.error().head<3>().norm(), 5 * vec_norm(f.state().attitude_std));
    f.fault = nullptr;
    f.run(20);
    EXPECT_EQ(f.quality(), QUALITY_GOOD);
    Random random{11};
    VectorFilter m = f.m;
    for (int round = 0; round < campaign_runs(20000, 1'000'000); round++) {
        auto &in = m.in;
        throw_numbers(doubles(in.gyro.omega_BN_B, in.start.sigma_BN, in.start.P_B, in.first.d_B, in.first.d_N,
                              in.first.std, in.second.d_B, in.field.B_B, in.known_field.B_N),
                      random, round);
        for (Head *head : {&in.gyro.head, &in.start.head, &in.first.head, &in.second.head, &in.field.head}) {
            *head = {random.below(9) ? round : random.below(2) ? INT64_MAX : INT64_MIN, any_quality(random), 1};
        }
        in.known_field.head.quality = any_quality(random);
        vector_filter_update(&m, {random.below(99) ? round : random.below(99) - 50, 1});
        expect_finite(doubles(m.out.attitude.sigma_BN, m.out.attitude.omega_BN_B, m.out.state.attitude_std,
                              m.out.state.bias_std, m.out.state.field_bias_std, m.out.state.misfit),
                      round);
    }
}

} // namespace vector_filter_test
} // namespace flight::testing
