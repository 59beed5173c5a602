// SPDX-License-Identifier: Apache-2.0
// What both attitude filters must do: measurements of a body in any motion, and the tests themselves.
#pragma once

#include "flight/testing/consistency.h"
#include "flight/testing/eigen.h"
#include "flight/testing/linear.h"

#include "flight/navigation/attitude_filter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <vector>

namespace flight::testing {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

inline constexpr std::int64_t tenth = 100'000'000, filter_second = 1'000'000'000;
inline constexpr double arc_second = pi / 180 / 3600;

/// The small turn from one attitude to another, in the axes of the second.
inline Vector3d turn_between(Vec3 to, Vec3 from)
{
    return 4 * eigen(mrp_relative(to, from));
}

/// A body that turns with a smooth rate, its gyro at 10 Hz, and its star tracker at 1 Hz.
template <class Filter> struct Flown {
    Filter m{};
    UpdateOf<Filter> update;
    Random random;
    Vec3 sigma = vec3(0, 0, 0);
    Vector3d bias, swing, phase;
    Matrix3d P_B;
    double rate = 0.05, noise = 1e-5, walk = 1e-7; // [rad/sqrt(s)], [rad/s/sqrt(s)]
    std::int64_t t = 0, latency = 0, every = filter_second;
    struct Past {
        std::int64_t t;
        Vec3 sigma;
        Vector3d bias;
    };
    std::vector<Past> past;
    std::function<void(Flown &)> fault; ///< spoils the inputs before an update
    bool tracks = true, turns = true;

    Flown(UpdateOf<Filter> update_, std::uint64_t seed) : update(update_), random(seed)
    {
        m.par.rate_noise = noise * noise;
        m.par.bias_walk = walk * walk;
        m.par.bias_std = 2e-4;
        m.par.star_std = arc_second;
        m.par.gate = 5;
        m.par.hold = 0.5;
        m.par.coast = 5;
        m.par.persistence = 3;
        sigma = random.mrp();
        bias = random.normals(m.par.bias_std);
        swing = random.vector(0.3);
        phase = random.vector(pi);
        const Matrix3d c = random.attitude();
        const Vector3d std = Vector3d(5, 5, 40) * arc_second;
        P_B = c * Matrix3d(std.cwiseAbs2().asDiagonal()) * c.transpose();
    }

    Vector3d omega(double at) const
    {
        Vector3d w;
        for (int i = 0; i < 3; i++) {
            w[i] = rate * std::sin(swing[i] * at + phase[i]);
        }
        return turns ? w : Vector3d::Zero();
    }

    Past then(std::int64_t at) const
    {
        return *std::find_if(past.rbegin(), past.rend(), [&](const Past &entry) { return entry.t <= at; });
    }

    void star(const Past &from)
    {
        Matrix3d all = P_B + m.par.star_std * m.par.star_std * Matrix3d::Identity();
        const Vector3d error = cholesky(all) * random.normals();
        m.in.stars = {good(from.t), mrp_compose(vec(error / 4), from.sigma), mat(P_B)};
    }

    void step()
    {
        if (!past.empty()) {
            for (int i = 0; i < 10; i++) { // the midpoint's rate, which is of order 2 over 10 ms
                const Vector3d w = omega(1e-9 * static_cast<double>(t) + 0.005 + 0.01 * i);
                sigma = dcm_to_mrp(mat(turn(w, w.norm() * 0.01 + 1e-300) * dcm(sigma)));
            }
            bias += random.normals(walk * std::sqrt(0.1));
            t += tenth;
        }
        past.push_back({t, sigma, bias});
        m.in.gyro = {good(t),
                     vec(omega(1e-9 * static_cast<double>(t)) + bias + random.normals(noise / std::sqrt(0.1)))};
        if (tracks && t >= latency && (t - latency) % every == 0) {
            star(then(t - latency));
        }
        if (fault) {
            fault(*this);
        }
        update(&m, {t, past.size() > 1 ? tenth : 0});
    }

    void run(double seconds)
    {
        for (int i = 0; i < std::lround(seconds * 10); i++) {
            step();
        }
    }

    double error() const { return turn_between(sigma, m.out.attitude.sigma_BN).norm(); }
    const AttitudeFilterState &state() const { return m.out.state; }
    Quality quality() const { return m.out.attitude.head.quality; }
};

inline Matrix6d covariance(const AttitudeEstimate &e, Mat3 to_turn)
{
    Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>> root(&e.root[0][0]);
    Matrix6d map = Matrix6d::Identity();
    map.topLeftCorner<3, 3>() = eigen(to_turn);
    return map * root.transpose() * root * map.transpose();
}

/// Of the estimate at the horizon.
template <class Filter> double normalised_error(const Flown<Filter> &f, Mat3 to_turn)
{
    const auto &at = f.m.mem.filter.at;
    const auto truth = f.then(at.t);
    Vector6d error;
    error << turn_between(truth.sigma, at.sigma_BN), truth.bias - eigen(at.bias_B);
    return error.dot(solve(covariance(at, to_turn), error));
}

/// Averages over runs within the 99.8 % interval of chi-square.
template <class Filter> void expect_consistent(UpdateOf<Filter> update, Mat3 (*to_turn)(Vec3))
{
    const int n = runs(200);
    double sum[3] = {0, 0, 0}, now[3] = {0, 0, 0};
    const double at[3] = {2.5, 20.5, 30.5};
    for (int seed = 1; seed <= n; seed++) {
        Flown<Filter> f(update, static_cast<std::uint64_t>(seed));
        f.latency = 2 * tenth;
        for (int k = 0; k < 3; k++) {
            f.run(at[k]);
            sum[k] += normalised_error(f, to_turn(f.m.mem.filter.at.sigma_BN)) / n;
        }
        const Vector3d error = turn_between(f.sigma, f.m.out.attitude.sigma_BN);
        for (int i = 0; i < 3; i++) {
            now[i] += std::pow(error[i] / f.state().attitude_std.v[i], 2) / n;
        }
        EXPECT_EQ(f.state().restarts, 0u);
        EXPECT_LE(f.state().rejected, 1u) << "the gate is at 5 standard deviations";
    }
    for (int i = 0; i < 3; i++) {
        expect_chi_square(sum[i], 6, n);
        expect_chi_square(now[i], 1, n); // about an axis, by the rates since the horizon
    }
}

/// Whatever happens to the sensors, errors are as large as they are reported wherever the quality is good: at a
/// random time of each run, and far larger ones never.
template <class Filter> void expect_good_is_true(UpdateOf<Filter> update, Mat3 (*to_turn)(Vec3))
{
    const char *const kinds[] = {"nothing",    "outages",     "wrong steps", "a large bias",
                                 "late stars", "a late gyro", "all"};
    for (int kind = 0; kind < 7; kind++) {
        const auto is = [&](int other) { return kind == other || kind == 6; };
        double sum = 0, now = 0;
        int n = 0, far = 0;
        for (int seed = 1; seed <= campaign_runs(70, 1430); seed++) {
            Flown<Filter> f(update, static_cast<std::uint64_t>(7 * seed + kind));
            Random &random = f.random;
            f.rate = std::pow(10, random.real(-3, -1));
            f.m.par.coast = is(1) ? random.real(5, 60) : 5;
            const double larger = is(3) ? std::pow(10, random.real(-1, 1.5)) : 1;
            f.m.par.bias_std *= larger;
            f.bias *= larger;
            f.latency = is(4) ? tenth * random.below(12) : 0;
            const auto late = static_cast<std::size_t>(is(5) ? random.below(3) : 0);
            double change = std::exp(random.real(1, 4));
            unsigned wrong = 0;
            Vec3 step = vec3(0, 0, 0);
            std::int64_t last = -1;
            std::vector<GyroRate> rates;
            f.fault = [&](auto &flown) {
                StarAttitude &stars = flown.m.in.stars;
                const double t = 1e-9 * static_cast<double>(flown.t);
                if (is(1) && t > change) {
                    flown.tracks = !flown.tracks;
                    change = t + std::exp(random.real(0, 4.5));
                }
                if (is(2) && stars.head.sequence > 0 && stars.head.t != last) {
                    last = stars.head.t;
                    if (wrong == 0 && random.below(15) == 0) { // fewer times than `persistence`, and beyond the gate
                        wrong = 1 + static_cast<unsigned>(random.below(static_cast<int>(flown.m.par.persistence) - 1));
                        const double gate = 0.005 + 20 * (vec_norm(flown.state().attitude_std) + flown.m.par.bias_std);
                        step = vec(std::tan(std::min(gate * std::pow(10, random.real(0, 2)), 3.0) / 4) *
                                   random.direction());
                    }
                    stars.sigma_BN = wrong > 0 ? mrp_compose(step, stars.sigma_BN) : stars.sigma_BN;
                    wrong -= wrong > 0;
                }
                rates.push_back(flown.m.in.gyro);
                flown.m.in.gyro = rates.size() > late ? rates[rates.size() - 1 - late] : GyroRate{};
            };
            const int steps = static_cast<int>(random.real(50, 1500)), from = random.below(steps);
            bool looked = false, off = false;
            for (int k = 0; k < steps; k++) {
                f.step();
                if (f.quality() != QUALITY_GOOD) {
                    continue;
                }
                const Vector3d by_std =
                    turn_between(f.sigma, f.m.out.attitude.sigma_BN).cwiseQuotient(eigen(f.state().attitude_std));
                const double error = normalised_error(f, to_turn(f.m.mem.filter.at.sigma_BN));
                off = off || by_std.cwiseAbs().maxCoeff() > 8 || error > 80;
                if (k >= from && !looked) {
                    looked = true;
                    n++;
                    sum += error;
                    now += by_std.squaredNorm() / 3;
                }
            }
            far += off;
        }
        SCOPED_TRACE(kinds[kind]);
        expect_chi_square(sum / n, 6, n);
        EXPECT_LT(now / n, 1 + 5 / std::sqrt(n));
        EXPECT_EQ(far, 0);
        EXPECT_GT(n, campaign_runs(70, 1430) / 2);
    }
}

/// Against a dense filter in Eigen: P' = F P F^T + Q with the exponential of the whole motion, and Joseph's form.
template <class Filter> void expect_riccati(UpdateOf<Filter> update, Mat3 (*to_turn)(Vec3), double tolerance)
{
    Flown<Filter> f(update, 3);
    const Vector3d w(0.02, -0.03, 0.05);
    f.m.par.rate_noise = 1e-10;
    f.m.par.bias_walk = 1e-14;
    f.m.in.gyro = {good(), vec(w)};
    Matrix6d P = Matrix6d::Zero();
    const Matrix3d R = f.P_B + f.m.par.star_std * f.m.par.star_std * Matrix3d::Identity();
    P.topLeftCorner<3, 3>() = R;
    P.bottomRightCorner<3, 3>() = 4e-8 * Matrix3d::Identity();
    // F and Q by 2000 steps of Euler's method between measurements, with Richardson's extrapolation.
    const auto predicted = [&](const Matrix6d &from, int steps) {
        Matrix6d A = Matrix6d::Zero(), Q = Matrix6d::Zero(), X = from;
        A.topLeftCorner<3, 3>() = -skew(w);
        A.topRightCorner<3, 3>() = -Matrix3d::Identity();
        Q.diagonal() << 1e-10, 1e-10, 1e-10, 1e-14, 1e-14, 1e-14;
        for (int i = 0; i < steps; i++) {
            X += (A * X + X * A.transpose() + Q) / steps;
        }
        return X;
    };
    Vec3 sigma = vec3(0.1, 0.2, 0.3);
    for (int k = 0; k <= 300; k++) {
        f.m.in.gyro.head.t = k * tenth;
        if (k % 10 == 0) {
            if (k > 0) {
                P = 2 * predicted(P, 2000) - predicted(P, 1000);
                Eigen::Matrix<double, 6, 3> K = P.leftCols<3>() * (P.topLeftCorner<3, 3>() + R).inverse();
                Matrix6d I_KH = Matrix6d::Identity();
                I_KH.leftCols<3>() -= K;
                P = I_KH * P * I_KH.transpose() + K * R * K.transpose();
            }
            f.m.in.stars = {good(k * tenth), sigma, mat(f.P_B)};
        }
        update(&f.m, {k * tenth, k ? tenth : 0});
        if (k % 10 == 0) {
            const Matrix6d found = covariance(f.m.mem.filter.at, to_turn(f.m.mem.filter.at.sigma_BN));
            const Vector6d scale = P.diagonal().cwiseSqrt().cwiseInverse();
            ASSERT_LT((scale.asDiagonal() * (found - P) * scale.asDiagonal()).cwiseAbs().maxCoeff(), tolerance) << k;
            ASSERT_GT(cholesky(found).size(), 0) << "positive definite";
        }
        sigma = dcm_to_mrp(mat(turn(w, w.norm() * 0.1) * dcm(sigma)));
    }
}

/// A wrong first attitude, by up to 180 degrees, and a bias of some milliradians per second.
template <class Filter> void expect_convergence(UpdateOf<Filter> update)
{
    for (int seed = 1; seed <= runs(100); seed++) {
        Flown<Filter> f(update, static_cast<std::uint64_t>(seed));
        f.m.par.bias_std *= 10;
        f.bias *= 10;
        f.fault = [](auto &flown) {
            if (flown.t == 0) {
                flown.m.in.stars.sigma_BN = flown.random.mrp();
            }
        };
        f.run(4);
        EXPECT_EQ(f.state().rejected, 3u);
        EXPECT_EQ(f.state().restarts, 1u);
        f.run(26);
        EXPECT_LT(f.error(), 100 * arc_second);
        EXPECT_LT((eigen(f.state().bias_B) - f.bias).norm(), 1e-4);
        EXPECT_EQ(f.state().restarts, 1u);
        EXPECT_EQ(f.quality(), QUALITY_GOOD);
    }
}

/// Measured attitudes that arrive late change the estimate at their time as those that arrive at once.
template <class Filter> void expect_late_as_in_time(UpdateOf<Filter> update)
{
    Flown<Filter> f(update, 8), g(update, 8);
    std::vector<StarAttitude> waiting;
    f.fault = [&](auto &flown) {
        if (flown.m.in.stars.head.t == flown.t) {
            waiting.push_back(flown.m.in.stars);
        }
        flown.m.in.stars.head = {};
        if (!waiting.empty() && flown.t - waiting.front().head.t >= 7 * tenth) {
            flown.m.in.stars = waiting.front();
            waiting.erase(waiting.begin());
        }
    };
    f.run(60.8); // up to 60.7 s, when the last of 60 s arrives
    g.run(60.1);
    const auto &a = f.m.mem.filter.at, &b = g.m.mem.filter.at;
    ASSERT_EQ(a.t, 60 * filter_second);
    ASSERT_EQ(b.t, 60 * filter_second);
    EXPECT_LT(vec_norm(vec_sub(a.sigma_BN, b.sigma_BN)), 1e-13);
    EXPECT_LT(vec_norm(vec_sub(a.bias_B, b.bias_B)), 1e-15);
    EXPECT_EQ(f.state().late, 0u);
    EXPECT_LT(f.error(), 100 * arc_second);

    Flown<Filter> old(update, 9);
    old.latency = 40 * tenth; // longer than the rates are kept
    old.run(60);
    EXPECT_GT(old.m.mem.filter.late_count, 40u);
    EXPECT_EQ(old.quality(), QUALITY_NONE);
}

template <class Filter> void expect_faults(UpdateOf<Filter> update)
{
    {
        SCOPED_TRACE("the star tracker drops out");
        Flown<Filter> f(update, 1);
        f.run(60);
        const double before = f.state().attitude_std.v[0];
        f.tracks = false;
        f.run(4);
        EXPECT_EQ(f.quality(), QUALITY_GOOD);
        f.run(60);
        EXPECT_EQ(f.quality(), QUALITY_DEGRADED);
        EXPECT_GT(f.state().attitude_std.v[0], 3 * before);
        EXPECT_LT(f.error(), 5 * vec_norm(f.state().attitude_std));
        f.tracks = true;
        f.run(5);
        EXPECT_EQ(f.quality(), QUALITY_GOOD);
        EXPECT_EQ(f.state().restarts, 0u);
    }
    {
        SCOPED_TRACE("the star tracker is stuck while the body turns");
        Flown<Filter> f(update, 2);
        f.run(60);
        const StarAttitude stuck = f.m.in.stars;
        f.fault = [&](auto &flown) { flown.m.in.stars.sigma_BN = stuck.sigma_BN; };
        f.run(60);
        EXPECT_EQ(f.state().restarts, 0u);
        EXPECT_GT(f.state().rejected, 50u);
        EXPECT_EQ(f.quality(), QUALITY_DEGRADED);
        f.turns = false;
        f.run(60);
        EXPECT_EQ(f.state().restarts, 0u) << "at rest, but elsewhere";
        EXPECT_LT(f.error(), 5e-3) << "the rate fell to zero at once, between two readings";
        f.fault = nullptr;
        f.run(10);
        EXPECT_LT(f.error(), 60 * arc_second);
        EXPECT_EQ(f.quality(), QUALITY_GOOD);
    }
    {
        SCOPED_TRACE("the star tracker jumps and is stuck there, while the body is at rest");
        Flown<Filter> f(update, 8);
        f.turns = false;
        f.run(60);
        const Vec3 stuck = f.random.mrp();
        f.fault = [&](auto &flown) { flown.m.in.stars.sigma_BN = stuck; };
        f.run(60);
        EXPECT_EQ(f.state().restarts, 0u) << "what is repeated agrees with nothing";
        EXPECT_EQ(f.state().rejected, 60u);
        EXPECT_LT(f.error(), 5e-3);
    }
    {
        SCOPED_TRACE("outliers");
        Flown<Filter> f(update, 3);
        f.fault = [](auto &flown) {
            if (flown.t % (5 * filter_second) == 3 * filter_second) {
                flown.m.in.stars.sigma_BN = flown.random.mrp();
            }
        };
        f.run(100);
        EXPECT_EQ(f.state().rejected, 20u);
        EXPECT_EQ(f.state().restarts, 0u);
        EXPECT_LT(f.error(), 60 * arc_second);
    }
    {
        SCOPED_TRACE("the gyro drops out, for a short and for a long time");
        Flown<Filter> f(update, 4);
        f.run(60);
        const auto drop = [](auto &flown) { flown.m.in.gyro.head.t = -1; };
        f.fault = drop;
        f.run(0.4);
        EXPECT_NE(f.quality(), QUALITY_NONE);
        f.fault = nullptr;
        f.run(5);
        EXPECT_EQ(f.state().restarts, 0u);
        EXPECT_LT(f.error(), 100 * arc_second);
        f.fault = drop;
        f.run(3);
        const auto held = f.m.out.attitude.head;
        EXPECT_EQ(held.quality, QUALITY_DEGRADED);
        f.run(1);
        EXPECT_EQ(f.m.out.attitude.head.sequence, held.sequence);
        f.fault = nullptr;
        f.run(20);
        EXPECT_EQ(f.state().restarts, 1u);
        EXPECT_EQ(f.quality(), QUALITY_GOOD);
        EXPECT_LT(f.error(), 60 * arc_second);
    }
    {
        SCOPED_TRACE("the gyro's bias jumps");
        Flown<Filter> f(update, 5);
        f.run(100);
        f.bias += Vector3d(3e-4, -4e-4, 2e-4);
        f.run(60);
        EXPECT_LT(f.error(), 60 * arc_second);
        EXPECT_LT((eigen(f.state().bias_B) - f.bias).norm(), 3e-5);
        EXPECT_EQ(f.quality(), QUALITY_GOOD);
    }
    {
        SCOPED_TRACE("the gyro is stuck while the body turns");
        Flown<Filter> f(update, 6);
        f.run(60);
        const Vec3 stuck = f.m.in.gyro.omega_BN_B;
        f.fault = [&](auto &flown) { flown.m.in.gyro.omega_BN_B = stuck; };
        f.run(60);
        EXPECT_GT(f.state().rejected, 30u);
        f.fault = nullptr;
        f.run(20);
        EXPECT_LT(f.error(), 60 * arc_second);
    }
    {
        SCOPED_TRACE("bad numbers and times");
        Flown<Filter> f(update, 7);
        f.run(30);
        const auto sound = f.m.mem.filter.at;
        for (const double bad : {std::nan(""), HUGE_VAL, 1e160, 1e308}) {
            f.fault = [&](auto &flown) {
                flown.m.in.gyro.omega_BN_B.v[1] = bad;
                flown.m.in.stars.sigma_BN.v[2] = bad;
                flown.m.in.stars.P_B.m[0][0] = bad;
            };
            f.run(0.3);
            f.fault = nullptr;
            f.run(5);
            EXPECT_LT(f.error(), 60 * arc_second) << bad;
        }
        EXPECT_LT((eigen(f.state().bias_B) - eigen(sound.bias_B)).norm(), 1e-4);
        for (const std::int64_t ahead : {f.t + 3600 * filter_second, INT64_MAX}) {
            f.fault = [&](auto &flown) { flown.m.in.stars.head.t = flown.m.in.gyro.head.t = ahead; };
            f.run(0.3);
            f.fault = nullptr;
            f.run(5);
            EXPECT_LT(f.error(), 60 * arc_second) << ahead;
            EXPECT_EQ(f.quality(), QUALITY_GOOD) << ahead;
        }
        f.fault = [](auto &flown) { flown.m.in.stars.head.quality = QUALITY_DEGRADED; };
        f.run(3);
        EXPECT_EQ(f.quality(), QUALITY_DEGRADED);
        EXPECT_LT(f.error(), 60 * arc_second);
        f.m.in.gyro.head.t = f.m.in.stars.head.t = 0;
        update(&f.m, {tenth, tenth}); // the clock was set back
        EXPECT_NE(f.quality(), QUALITY_GOOD);
    }
}

} // namespace flight::testing
