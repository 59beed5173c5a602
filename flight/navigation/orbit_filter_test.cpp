// SPDX-License-Identifier: Apache-2.0
// The filter of the orbit on true orbits by another integrator: whether its errors are as large as it says, and what it
// does with outliers, outages, late fixes and a receiver that wanders or is stuck.
#include "flight/navigation/testing/orbits.h"
#include "flight/testing/consistency.h"
#include "flight/testing/linear.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/navigation/orbit_filter.h"
}

#include <algorithm>
#include <functional>
#include <vector>

namespace flight::testing {
namespace orbit_filter_test {

using namespace orbits;

using Matrix7d = Eigen::Matrix<double, 7, 7>;
using Vector7d = Eigen::Matrix<double, 7, 1>;

/// A spacecraft, its receiver and the filter, a step of `every` at a time.
struct Flown {
    OrbitFilter m{};
    Random random;
    Earth earth;
    State x;
    std::int64_t t = 0, every = 10 * second, latency = 0;
    double white = 5, fast = 0.02, wander = 0, wander_time = 1800, noise = 0, along_std = 0, along_time = 0;
    Vector3d wandered{0, 0, 0};
    std::vector<std::pair<std::int64_t, State>> past;
    std::vector<NavOrbit> sent;
    std::uint32_t sequence = 0;
    bool speaks = true, started = false;
    std::function<void(NavOrbit &)> spoil;

    explicit Flown(std::uint64_t seed) : random(seed)
    {
        earth.c = random.attitude();
        x = on_orbit(random, random.real(6.8e6, 7.5e6), random.real(0, 0.02), random.real(0, pi));
        m.par = {mu_earth, radius_earth, J2_earth, J3_earth, J4_earth, 10, 1e-6, 5e-7, 20000,
                 white,    fast,         0,        6,        50,       5,  60,   3};
    }

    /// White acceleration, and one along the velocity that wanders, besides what Earth has.
    void move()
    {
        const double h = 1e-9 * static_cast<double>(every), T = 1e-9 * static_cast<double>(t);
        x = earth.go(T, x, T + h);
        if (noise > 0) {
            const Vector3d dv = random.normals(std::sqrt(noise * h));
            x.tail<3>() += dv;
            x.head<3>() += h / 2 * dv + random.normals(h * std::sqrt(noise * h / 12));
        }
        if (along_std > 0) {
            const double stays = std::exp(-h / along_time);
            earth.along = stays * earth.along + along_std * std::sqrt(1 - stays * stays) * random.normals().x();
        }
        t += every;
    }

    void step()
    {
        started ? move() : void();
        const double stays = started ? std::exp(-1e-9 * static_cast<double>(every) / wander_time) : 0;
        wandered = stays * wandered + random.normals(wander * std::sqrt(1 - stays * stays));
        past.push_back({t, x});
        NavOrbit fix{{t, QUALITY_GOOD, 0},
                     vec(x.head<3>() + wandered + random.normals(white)),
                     vec(x.tail<3>() + random.normals(fast)),
                     {}};
        if (spoil) {
            spoil(fix);
        }
        sent.push_back(fix);
        const auto behind = static_cast<std::size_t>(latency / every);
        if (speaks && sent.size() > behind) {
            m.in.fix = sent[sent.size() - 1 - behind];
            m.in.fix.head.sequence = ++sequence;
        }
        m.in.planet = earth.attitude(t);
        orbit_filter_update(&m, {t, started ? every : 0});
        started = true;
    }

    void run(double seconds)
    {
        for (const std::int64_t end = t + std::llround(seconds * 1e9); t < end || !started;) {
            step();
        }
    }

    State then(std::int64_t at) const
    {
        return std::find_if(past.rbegin(), past.rend(), [&](const auto &entry) { return entry.first <= at; })->second;
    }

    Vector3d error() const { return eigen(m.out.orbit.r_BN_N) - Vector3d(x.head<3>()); }
    double formal_std() const { return vec_norm(m.out.state.position_std); }
    Quality quality() const { return m.out.orbit.head.quality; }
    const OrbitFilterState &state() const { return m.out.state; }

    double normalised_error() const
    {
        const OrbitEstimate &at = m.mem.at;
        Eigen::Map<const Eigen::Matrix<double, 7, 7, Eigen::RowMajor>> root(&at.root[0][0]);
        const State truth = then(at.t);
        Vector7d e;
        e << eigen(at.x.r) - Vector3d(truth.head<3>()), eigen(at.x.v) - Vector3d(truth.tail<3>()),
            at.along - earth.along;
        const Vector7d scale = (Vector7d() << 1, 1, 1, 1e-3, 1e-3, 1e-3, 1e-7).finished().cwiseInverse();
        const Matrix7d P = scale.asDiagonal() * Matrix7d(root.transpose() * root) * scale.asDiagonal();
        e = scale.cwiseProduct(e);
        return e.dot(solve(P, e));
    }
};

/// Within the 99 % interval of chi-square, by Wilson and Hilferty.
void expect_99(const char *what, double average, double degrees, double n)
{
    const double s = 2 / (9 * degrees * n);
    const double low = degrees * std::pow(1 - s - 2.576 * std::sqrt(s), 3);
    const double high = degrees * std::pow(1 - s + 2.576 * std::sqrt(s), 3);
    std::printf("%s %.4f of %.0f, 99 %%: %.4f to %.4f\n", what, average, degrees, low, high);
    EXPECT_GT(average, low) << what;
    EXPECT_LT(average, high) << what;
}

TEST(OrbitFilter, its_errors_are_as_large_as_it_says)
{
    const int n = campaign_runs(100, 1000);
    double early = 0, late = 0, coasted = 0, misfit = 0;
    int fixes = 0;
    for (int seed = 1; seed <= n; seed++) {
        Flown f(static_cast<std::uint64_t>(seed));
        f.noise = f.m.par.accel_noise;
        f.along_std = f.m.par.along_std;
        f.along_time = f.m.par.along_time = 3000;
        f.earth.along = f.random.normals(f.along_std).x();
        f.run(60);
        early += f.normalised_error() / n;
        for (int k = 0; k < 100; k++) {
            f.step();
            misfit += f.state().misfit;
            fixes++;
        }
        late += f.normalised_error() / n;
        f.speaks = false;
        f.run(1200);
        coasted += f.normalised_error() / n;
        EXPECT_EQ(f.state().restarts, 0u);
        EXPECT_LE(f.state().rejected, 1u);
    }
    expect_99("NEES after 60 s", early, 7, n);
    expect_99("NEES after 1060 s", late, 7, n);
    expect_99("NEES after an outage of 1200 s", coasted, 7, n);
    expect_99("NIS", misfit / fixes, 6, fixes);
}

TEST(OrbitFilter, its_covariance_is_that_of_a_dense_filter)
{
    Flown f(1);
    f.every = 5 * second;
    f.run(5);
    Eigen::Map<const Eigen::Matrix<double, 7, 7, Eigen::RowMajor>> root(&f.m.mem.at.root[0][0]);
    for (int k = 0; k < 300; k++) {
        Matrix7d P = root.transpose() * root;
        const OrbitEstimate at = f.m.mem.at;
        f.step();
        // F by differences of the step itself, with the true gravity about the estimate.
        Matrix7d F;
        for (int j = 0; j < 7; j++) {
            const double d = j < 3 ? 100 : j < 6 ? 0.1 : 1e-3;
            const auto moved = [&](double by) {
                State x;
                x << eigen(at.x.r), eigen(at.x.v);
                Earth e = f.earth;
                e.along = at.along + (j == 6 ? by : 0);
                j < 6 ? void(x[j] += by) : void();
                return e.go(0, x, 5);
            };
            F.col(j) << (moved(d) - moved(-d)) / (2 * d), j == 6 ? std::exp(-5.0 / 20000) : 0;
        }
        Matrix7d Q = Matrix7d::Zero();
        const double q = 1e-6, h = 5;
        Q.topLeftCorner<3, 3>().diagonal().fill(q * h * h * h / 3);
        Q.block<3, 3>(0, 3).diagonal().fill(q * h * h / 2);
        Q.block<3, 3>(3, 0).diagonal().fill(q * h * h / 2);
        Q.block<3, 3>(3, 3).diagonal().fill(q * h);
        Q(6, 6) = 25e-14 * (1 - std::exp(-10.0 / 20000));
        P = F * P * F.transpose() + Q;
        Eigen::Matrix<double, 6, 7> H = Eigen::Matrix<double, 6, 7>::Identity();
        Eigen::Matrix<double, 6, 6> S = H * P * H.transpose();
        S.diagonal() += (State() << 25, 25, 25, 4e-4, 4e-4, 4e-4).finished();
        const Matrix7d dense = P - P * H.transpose() * S.partialPivLu().solve(Eigen::Matrix<double, 6, 7>(H * P));
        const Matrix7d own = root.transpose() * root;
        for (int i = 0; i < 7; i++) {
            for (int j = 0; j < 7; j++) {
                ASSERT_NEAR(own(i, j), dense(i, j), 1e-5 * std::sqrt(dense(i, i) * dense(j, j))) << i << j << " " << k;
            }
        }
    }
}

/// The field has terms that the filter does not know, the air drags, and the receiver does all that it can.
TEST(OrbitFilter, random_missions)
{
    const int n = campaign_runs(100, 1000);
    double worst = 0, sum = 0, farthest = 0;
    long count = 0, far = 0;
    std::vector<double> converged, ends;
    for (int seed = 1; seed <= n; seed++) {
        Flown f(static_cast<std::uint64_t>(1000 + seed));
        Random &random = f.random;
        f.earth.C22 = 1.57446e-6;
        f.earth.S22 = -9.0386e-7;
        f.earth.drag = std::pow(10, random.real(-15, -14));
        f.every = (2 + random.below(20)) * second;
        f.latency = random.below(3) * f.every;
        f.m.par.latency = 60;
        f.wander = f.m.par.wander = random.below(2) ? random.real(0, 4) : 0;
        f.wander_time = random.real(300, 5000);
        f.m.par.good = 100;
        double change = random.real(300, 1500), first = -1;
        int wrong = 0;
        NavOrbit stuck{};
        f.spoil = [&](NavOrbit &fix) {
            if (1e-9 * static_cast<double>(fix.head.t) > change) {
                f.speaks = !f.speaks;
                change += f.speaks ? random.real(300, 2000) : std::exp(random.real(2, 7.5));
                stuck = random.below(3) ? NavOrbit{} : fix;
            }
            if (wrong == 0 && random.below(40) == 0) {
                wrong = 1 + random.below(2);
            }
            if (wrong > 0) { // fewer in a row than `persistence`
                wrong--;
                const double size = std::pow(10, random.real(2.5, 9));
                fix.r_BN_N = vec_add(fix.r_BN_N, vec(random.direction() * size));
                fix.v_BN_N.v[0] = random.below(10) ? fix.v_BN_N.v[0] : any_number(random);
            } else if (stuck.head.t > 0 && fix.head.t < stuck.head.t + 120 * second) {
                fix.r_BN_N = stuck.r_BN_N;
                fix.v_BN_N = stuck.v_BN_N;
            }
        };
        while (f.t < 5400 * second) {
            f.step();
            if (f.quality() == QUALITY_GOOD) {
                const double ratio = f.error().squaredNorm() / std::pow(f.formal_std(), 2);
                const double seconds = 1e-9 * static_cast<double>(f.t);
                first = first < 0 && f.error().norm() < 10 ? seconds : first;
                worst = std::max(worst, ratio);
                far += ratio > 9 ? 1 : 0;
                farthest = std::max(farthest, f.error().norm());
                sum += ratio;
                count++;
            }
        }
        f.speaks = true;
        change = 1e9;
        f.run(200 * 1e-9 * static_cast<double>(f.every));
        converged.push_back(first);
        ends.push_back(f.error().norm());
        EXPECT_GE(first, 0) << seed;
        EXPECT_EQ(f.quality(), QUALITY_GOOD) << seed;
        EXPECT_LE(f.state().restarts, 1u) << seed; // one if the first fix was an outlier
        EXPECT_LT(f.error().norm(), 40) << seed;
    }
    std::sort(converged.begin(), converged.end());
    std::sort(ends.begin(), ends.end());
    const auto at = [&](const std::vector<double> &all, double q) {
        return all[static_cast<std::size_t>(q * static_cast<double>(all.size() - 1))];
    };
    std::printf(
        "%d missions, %ld good results: (error / said)^2 on average %.3f, worst %.1f, above 9: %ld, farthest %.0f m\n",
        n, count, sum / static_cast<double>(count), worst, far, farthest);
    std::printf("within 10 m after %.0f s (median), %.0f s (95 %%), %.0f s (all); at the end %.1f m, %.1f m, %.1f m\n",
                at(converged, 0.5), at(converged, 0.95), converged.back(), at(ends, 0.5), at(ends, 0.95), ends.back());
    EXPECT_LT(sum / static_cast<double>(count), 1.2);
    EXPECT_LT(worst, 25);
    EXPECT_LT(at(converged, 0.95), 400);
}

TEST(OrbitFilter, late_fixes_count_at_their_time)
{
    Flown in_time(7), late(7);
    for (Flown *f : {&in_time, &late}) {
        f->every = second;
        f->m.par.step = 1;
    }
    late.latency = 3 * second;
    in_time.run(300);
    late.run(303);
    EXPECT_EQ(late.m.mem.at.t, in_time.m.mem.at.t);
    EXPECT_LT(vec_norm(vec_sub(late.m.mem.at.x.r, in_time.m.mem.at.x.r)), 1e-6);
    EXPECT_EQ(late.state().late, 0u);
    EXPECT_LT(late.error().norm(), 10);

    Flown old(8);
    old.every = second;
    old.run(100);
    const auto used = old.state().used;
    old.latency = 90 * second; // of yesterday, as it were
    old.run(20);
    EXPECT_EQ(old.state().late, 20u);
    EXPECT_EQ(old.state().used, used);
    EXPECT_LT(old.error().norm(), 10);
    Flown first(8);
    first.m.in.fix = {good(-86400 * second), vec3(7e6, 0, 0), vec3(0, 7e3, 0), {}};
    orbit_filter_update(&first.m, {0, 0});
    EXPECT_EQ(first.state().late, 1u);
    EXPECT_EQ(first.quality(), QUALITY_NONE);
}

TEST(OrbitFilter, faults)
{
    Flown f(9);
    f.run(20);
    EXPECT_EQ(f.quality(), QUALITY_GOOD) << "after three fixes";
    f.run(600);
    {
        SCOPED_TRACE("a stuck receiver");
        const NavOrbit stuck = f.sent.back();
        f.spoil = [&](NavOrbit &fix) { fix.r_BN_N = stuck.r_BN_N, fix.v_BN_N = stuck.v_BN_N; };
        f.run(300);
        EXPECT_EQ(f.state().rejected, 30u);
        EXPECT_EQ(f.state().restarts, 0u);
        EXPECT_LT(f.error().norm(), 5 * f.formal_std());
        f.spoil = nullptr;
        f.run(100);
        EXPECT_LT(f.error().norm(), 10);
    }
    {
        SCOPED_TRACE("a receiver that is stuck until any other fix would begin the filter anew");
        Flown vague(10);
        vague.m.par.accel_noise = 1e-2;
        vague.run(100);
        const NavOrbit stuck = vague.sent.back();
        vague.spoil = [&](NavOrbit &fix) { fix.r_BN_N = stuck.r_BN_N, fix.v_BN_N = stuck.v_BN_N; };
        vague.run(9000);
        EXPECT_GT(vague.formal_std(), 2e4);
        EXPECT_EQ(vague.state().restarts, 0u);
        vague.spoil = nullptr;
        vague.run(60);
        EXPECT_EQ(vague.state().restarts, 1u);
        EXPECT_LT(vague.error().norm(), 30);
    }
    {
        SCOPED_TRACE("an outage, until its own error is above the limit");
        f.speaks = false;
        bool was_good = false;
        while (f.quality() == QUALITY_GOOD) {
            was_good = true;
            ASSERT_LT(f.formal_std(), 50);
            f.step();
        }
        EXPECT_TRUE(was_good);
        EXPECT_GT(f.formal_std(), 50);
        EXPECT_LT(f.error().norm(), 3 * f.formal_std());
        f.speaks = true;
        f.step();
        EXPECT_EQ(f.quality(), QUALITY_GOOD);
    }
    {
        SCOPED_TRACE("a maneuver that it is not told of");
        const auto rejected = f.state().rejected;
        f.x[4] += 20;
        f.run(30);
        EXPECT_EQ(f.state().rejected, rejected + 3);
        EXPECT_EQ(f.state().restarts, 1u);
        f.run(100);
        EXPECT_EQ(f.quality(), QUALITY_GOOD);
        EXPECT_LT(f.error().norm(), 15);
    }
    {
        SCOPED_TRACE("a gap of the updates");
        const double seconds = 40000;
        f.x = f.earth.go(1e-9 * static_cast<double>(f.t), f.x, 1e-9 * static_cast<double>(f.t) + seconds);
        f.t += std::llround(seconds * 1e9);
        f.step();
        EXPECT_EQ(f.quality(), QUALITY_DEGRADED);
        EXPECT_LT(f.m.out.orbit.head.t, f.t);
        f.run(2000);
        EXPECT_EQ(f.quality(), QUALITY_GOOD);
        EXPECT_LT(f.error().norm(), 15);
    }
    {
        SCOPED_TRACE("the clock goes back, a degraded fix, none");
        f.t -= 5000 * second;
        f.past.clear();
        f.run(60);
        EXPECT_EQ(f.quality(), QUALITY_GOOD);
        f.spoil = [](NavOrbit &fix) { fix.head.quality = QUALITY_DEGRADED; };
        f.run(10);
        EXPECT_EQ(f.quality(), QUALITY_DEGRADED);
        f.spoil = [](NavOrbit &fix) { fix.head.quality = QUALITY_NONE; };
        const auto used = f.state().used;
        f.run(10);
        EXPECT_EQ(f.state().used, used);
        f.spoil = nullptr;
        f.m.par.step = 0;
        f.step();
        EXPECT_EQ(f.quality(), QUALITY_DEGRADED);
        EXPECT_EQ(f.state().used, used);
    }
}

TEST(OrbitFilter, wrong_fixes_that_do_not_agree_begin_nothing)
{
    Flown velocities(11);
    velocities.run(600);
    int k = 0;
    velocities.spoil = [&](NavOrbit &fix) { fix.v_BN_N.v[2] += k++ % 2 ? 2 : -2; };
    velocities.run(300);
    EXPECT_EQ(velocities.state().rejected, 30u);
    EXPECT_EQ(velocities.state().restarts, 0u) << "their positions agree, their velocities do not";

    Flown same(12);
    same.run(600);
    same.speaks = false;
    same.step();
    OrbitFilter &m = same.m;
    m.in.fix.head = good(same.t);
    for (std::uint32_t i = 0; i < 2 * m.par.persistence; i++) {
        m.in.fix.head.sequence = 1000 + i;
        m.in.fix.r_BN_N = vec_add(m.in.fix.r_BN_N, vec3(1e5, 0, 0));
        m.in.fix.r_BN_N.v[0] -= i == 0 ? 0 : 1e5 - 1e-3;
        orbit_filter_update(&m, {same.t, 10 * second});
    }
    EXPECT_EQ(same.state().rejected, 2 * m.par.persistence);
    EXPECT_EQ(same.state().restarts, 0u) << "of one time, they say nothing of a motion";
}

TEST(OrbitFilter, a_position_that_is_repeated_counts_where_the_velocity_is_new)
{
    Flown f(13);
    f.every = second / 1000;
    f.m.par.position_std = 100;
    f.spoil = [](NavOrbit &fix) {
        for (double &r : fix.r_BN_N.v) {
            r = 200 * std::round(r / 200);
        }
    };
    f.run(0.1);
    int repeated = 0;
    for (std::size_t i = 1; i < f.sent.size(); i++) {
        repeated += vec_norm(vec_sub(f.sent[i].r_BN_N, f.sent[i - 1].r_BN_N)) == 0.0;
    }
    EXPECT_GT(repeated, 50);
    EXPECT_EQ(f.state().used, f.sent.size());
    EXPECT_EQ(f.state().rejected, 0u);
}

TEST(OrbitFilter, absurd_numbers_leave_no_infinite_misfit_and_no_infinite_orbit)
{
    Flown sure(14);
    sure.m.par.velocity_std = 1e-3;
    sure.step();
    sure.spoil = [](NavOrbit &fix) { fix.v_BN_N = vec3(1e154, 0, 0); };
    sure.step();
    EXPECT_EQ(sure.state().used, 1u);
    EXPECT_EQ(sure.state().rejected, 1u);
    EXPECT_EQ(sure.state().misfit, 0.0) << "it overflows";

    Flown fast(15);
    fast.spoil = [](NavOrbit &fix) { fix.v_BN_N = vec3(1.2e154, 0, 0); };
    fast.step();
    const OrbitFilter before = fast.m;
    orbit_filter_update(&fast.m, {fast.t + 10 * second, 10 * second});
    EXPECT_TRUE(vec_finite(fast.m.out.orbit.r_BN_N));
    EXPECT_EQ(fast.m.out.orbit.head.sequence, before.out.orbit.head.sequence) << "it is held";
}

TEST(OrbitFilter, bad_numbers_never_leave_it)
{
    Random random{5};
    for (int round = 0; round < runs(2000); round++) {
        Flown f(3);
        f.run(10 * random.below(4));
        for (int k = 0; k < 3; k++) {
            throw_numbers(doubles(f.m.in.fix.r_BN_N, f.m.in.fix.v_BN_N), random, round);
            if (round % 2) {
                throw_numbers(doubles(f.m.par.accel_noise, f.m.par.along_std, f.m.par.wander, f.m.par.latency,
                                      f.m.in.planet.dcm_PN, f.m.par.J2),
                              random, round);
            }
            f.m.in.fix.head = {random.below(3) ? f.t : INT64_MIN, any_quality(random),
                               1000u + static_cast<unsigned>(k)};
            const std::int64_t t = random.below(6) ? f.t + 100 * second : INT64_MAX;
            orbit_filter_update(&f.m, {t, second});
            expect_finite(doubles(f.m.out.orbit.r_BN_N, f.m.out.orbit.v_BN_N, f.m.out.orbit.a_BN_N,
                                  f.m.out.state.position_std, f.m.out.state.velocity_std, f.m.out.state.misfit),
                          round);
        }
    }
}

} // namespace orbit_filter_test
} // namespace flight::testing
