// SPDX-License-Identifier: Apache-2.0
// MRP feedback in closed loop with the equations of motion, wheels included: the Lyapunov
// rate, convergence, the integral term, and the quality of the torque.
#include "flight/testing/eigen.h"
#include "flight/testing/linear.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/control/mrp_feedback.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace mrp_feedback_test {

constexpr Tick first{0, 0};
constexpr std::int64_t half_second = 500'000'000;

/// A controller with n wheels and everything else at random.
MrpFeedback any(Random &random, std::uint32_t n)
{
    MrpFeedback m{};
    m.in.error = {good(), random.mrp(), vec(random.vector()), vec(random.vector()), vec(random.vector())};
    m.in.vehicle = {good(), mat(random.spd(100))};
    if (n > 0) {
        m.in.wheels.head = m.in.speeds.head = good();
    }
    m.in.wheels.n = n;
    for (std::uint32_t i = 0; i < n; i++) {
        m.in.wheels.axes_B[i] = vec(random.direction());
        m.in.wheels.J[i] = random.real(0.01, 1);
        m.in.speeds.Omega[i] = random.real(-500, 500);
    }
    m.par.K = random.real(0.1, 10);
    m.par.P = mat(random.spd(10));
    return m;
}

Vector3d torque_of(MrpFeedback m)
{
    mrp_feedback_update(&m, first);
    return eigen(m.out.torque.torque_B);
}

/// Body and wheels about a reference that moves, in the terms of the equations of motion: B relative to R, and the
/// wheels' inertial momenta, whose derivative is the motor torque.
struct Plant {
    Matrix3d I;
    Eigen::Matrix3Xd G;
    Vector3d omega_RN_R, domega_RN_R, L; // constant rate vector and torque in R and B
};

/// The derivative in B of omega_BN for a control torque -G u on the body.
Vector3d acceleration(const Plant &plant, const Vector3d &omega_BN, const Eigen::VectorXd &h, const Vector3d &torque)
{
    Vector3d H = plant.I * omega_BN + plant.G * h;
    return solve(plant.I, -omega_BN.cross(H) + torque + plant.L);
}

TEST(MrpFeedback, lyapunov_function_falls_as_the_damping_alone)
{
    Random random{1};
    for (int i = 0; i < 3000; i++) {
        auto n = static_cast<std::uint32_t>(i % (WHEELS_MAX + 1));
        MrpFeedback m = any(random, n);
        Plant plant{eigen(m.in.vehicle.I_B), Eigen::Matrix3Xd(3, n), {}, {}, Vector3d::Zero()};
        if (i % 2) {
            plant.L = random.vector();
            m.in.external = {good(), vec(plant.L)};
        }
        Vector3d sigma = eigen(m.in.error.sigma_BR), omega_BR = eigen(m.in.error.omega_BR_B);
        Vector3d omega_RN = eigen(m.in.error.omega_RN_B), omega_BN = omega_BR + omega_RN;
        Eigen::VectorXd h(n);
        for (std::uint32_t k = 0; k < n; k++) {
            plant.G.col(k) = eigen(m.in.wheels.axes_B[k]);
            h[k] = m.in.wheels.J[k] * (omega_BN.dot(plant.G.col(k)) + m.in.speeds.Omega[k]);
        }
        Vector3d domega_BN = acceleration(plant, omega_BN, h, torque_of(m));
        // d/dt in B of omega_RN is its inertial derivative less omega_BN x omega_RN.
        Vector3d domega_BR = domega_BN - (eigen(m.in.error.domega_RN_B) - omega_BN.cross(omega_RN));

        // V = omega_BR . I omega_BR / 2 + 2 K log(1 + sigma^2)
        Vector3d dsigma = eigen(mrp_rate(vec(sigma), vec(omega_BR)));
        double potential = 4 * m.par.K * sigma.dot(dsigma) / (1 + sigma.squaredNorm());
        double dV = omega_BR.dot(plant.I * domega_BR) + potential;
        double damping = omega_BR.dot(eigen(m.par.P) * omega_BR);
        double scale = (plant.I * omega_BN + plant.G * h).norm() * 10 + damping;
        EXPECT_NEAR(dV, -damping, 1e-14 * scale);
        EXPECT_LT(dV, 0);
    }
}

/// Flies the continuous law (the torque is evaluated within each stage of RK4) about a reference
/// that turns at a constant rate, and computes the Lyapunov function along the way.
struct ClosedLoop {
    MrpFeedback m;
    Plant plant;

    struct State {
        Vector3d sigma_BR, omega_BN;
        Eigen::VectorXd h;
    };

    void observe(const State &x)
    {
        Matrix3d BR = dcm(vec(x.sigma_BR));
        Vector3d omega_RN = BR * plant.omega_RN_R;
        m.in.error = {good(), mrp_short(vec(x.sigma_BR)), vec(x.omega_BN - omega_RN), vec(omega_RN),
                      vec(BR * plant.domega_RN_R)};
        for (std::uint32_t i = 0; i < m.in.wheels.n; i++) {
            m.in.speeds.Omega[i] = x.h[i] / m.in.wheels.J[i] - x.omega_BN.dot(plant.G.col(i));
        }
    }

    double lyapunov(const State &x)
    {
        observe(x);
        Vector3d omega_BR = eigen(m.in.error.omega_BR_B);
        return omega_BR.dot(plant.I * omega_BR) / 2 + 2 * m.par.K * std::log1p(vec_norm2(m.in.error.sigma_BR));
    }

    State derivative(const State &x)
    {
        observe(x);
        mrp_feedback_update(&m, first);
        Vector3d torque = eigen(m.out.torque.torque_B);
        Vector3d dsigma = eigen(mrp_rate(vec(x.sigma_BR), m.in.error.omega_BR_B));
        const Matrix3d GG = plant.G.lazyProduct(plant.G.transpose());
        Eigen::VectorXd u = -plant.G.transpose() * solve(GG, torque).head<3>(); // of all the shortest
        return {dsigma, acceleration(plant, x.omega_BN, x.h, torque), u};
    }

    void step(State &x, double dt)
    {
        auto move = [&](const State &d, double k) {
            return State{x.sigma_BR + k * d.sigma_BR, x.omega_BN + k * d.omega_BN, x.h + k * d.h};
        };
        State a = derivative(x), b = derivative(move(a, dt / 2)), c = derivative(move(b, dt / 2));
        State d = derivative(move(c, dt));
        x.sigma_BR += dt / 6 * (a.sigma_BR + 2 * b.sigma_BR + 2 * c.sigma_BR + d.sigma_BR);
        x.omega_BN += dt / 6 * (a.omega_BN + 2 * b.omega_BN + 2 * c.omega_BN + d.omega_BN);
        x.h += dt / 6 * (a.h + 2 * b.h + 2 * c.h + d.h);
        x.sigma_BR = eigen(mrp_short(vec(x.sigma_BR)));
    }
};

TEST(MrpFeedback, converges_on_a_turning_reference_from_any_attitude)
{
    Random random{2};
    for (int run = 0; run < runs(20); run++) {
        ClosedLoop loop{any(random, 4), {}};
        loop.m.in.vehicle.I_B = mat(random.spd(1));
        loop.m.par.K = 10;
        loop.m.par.P = mat(8 * Matrix3d::Identity());
        loop.plant = {eigen(loop.m.in.vehicle.I_B), Eigen::Matrix3Xd(3, 4), random.vector(0.1), Vector3d::Zero(),
                      random.vector(0.1)};
        loop.m.in.external = {good(), vec(loop.plant.L)};
        for (int i = 0; i < 4; i++) {
            Vector3d axis = (i < 3 ? Vector3d::Unit(i) : Vector3d(Vector3d::Ones())).normalized();
            loop.plant.G.col(i) = axis;
            loop.m.in.wheels.axes_B[i] = vec(axis);
        }
        ClosedLoop::State x{eigen(random.mrp()), random.vector(0.5), Eigen::VectorXd(4)};
        for (int i = 0; i < 4; i++) {
            x.h[i] = random.real(-1, 1);
        }
        double before = loop.lyapunov(x);
        for (int step = 0; step < 1500; step++) {
            loop.step(x, 0.1);
            double now = loop.lyapunov(x);
            ASSERT_LE(now, before * (1 + 1e-6) + 1e-20) << "run " << run << " step " << step;
            before = now;
        }
        EXPECT_LT(vec_norm(loop.m.in.error.sigma_BR), 1e-8);
        EXPECT_LT(vec_norm(loop.m.in.error.omega_BR_B), 1e-8);
    }
}

TEST(MrpFeedback, needs_no_wheels_and_without_speeds_says_so)
{
    Random random{3};
    MrpFeedback m = any(random, 4), none = m;
    none.in.wheels = WheelSet{};
    none.in.speeds = WheelSpeeds{};
    mrp_feedback_update(&none, first);
    EXPECT_EQ(none.out.torque.head.quality, QUALITY_GOOD);

    MrpFeedback blind = m;
    blind.in.speeds.head = Head{};
    mrp_feedback_update(&blind, first);
    EXPECT_EQ(blind.out.torque.head.quality, QUALITY_DEGRADED);
    EXPECT_TRUE(same_content(blind.out.torque, none.out.torque)) << "the momentum is left out";

    mrp_feedback_update(&m, first);
    EXPECT_EQ(m.out.torque.head.quality, QUALITY_GOOD);
    EXPECT_FALSE(same_content(m.out.torque, none.out.torque));

    none.in.speeds = m.in.speeds; // speeds of no wheels
    mrp_feedback_update(&none, first);
    EXPECT_EQ(none.out.torque.head.quality, QUALITY_GOOD);
}

TEST(MrpFeedback, quality_is_the_worst_of_what_it_used)
{
    Random random{4};
    const MrpFeedback start = any(random, 4);
    auto quality_with = [&](auto head) {
        MrpFeedback m = start;
        m.in.external.head = good();
        head(m) = with(QUALITY_STALE);
        mrp_feedback_update(&m, first);
        return m.out.torque.head.quality;
    };
    EXPECT_EQ(quality_with([](auto &m) -> Head & { return m.in.error.head; }), QUALITY_DEGRADED);
    EXPECT_EQ(quality_with([](auto &m) -> Head & { return m.in.vehicle.head; }), QUALITY_DEGRADED);
    EXPECT_EQ(quality_with([](auto &m) -> Head & { return m.in.wheels.head; }), QUALITY_DEGRADED);
    EXPECT_EQ(quality_with([](auto &m) -> Head & { return m.in.speeds.head; }), QUALITY_DEGRADED);
    EXPECT_EQ(quality_with([](auto &m) -> Head & { return m.in.external.head; }), QUALITY_DEGRADED);

    for (int missing = 0; missing < 2; missing++) {
        MrpFeedback m = start;
        (missing ? m.in.error.head : m.in.vehicle.head) = Head{};
        mrp_feedback_update(&m, first);
        EXPECT_TRUE(all_zero(m.out));
        EXPECT_TRUE(all_zero(m.mem));
    }
}

MrpFeedback integrating(Vec3 sigma)
{
    MrpFeedback m{};
    m.in.error = {good(), sigma, {}, {}, {}};
    m.in.vehicle = {good(), mat_identity()};
    m.par.K = 1;
    m.par.K_I = 0.25;
    return m;
}

/// The integral term's torque, of a module at rest.
Vector3d integral_torque(const MrpFeedback &m)
{
    return -eigen(m.out.torque.torque_B) - m.par.K * eigen(m.in.error.sigma_BR);
}

TEST(MrpFeedback, integral_of_a_constant_error_is_exact_from_the_first_update)
{
    MrpFeedback m = integrating(vec3(0.5, -0.25, 0.125));
    for (int k = 0; k < 1000; k++) {
        mrp_feedback_update(&m, {k * half_second, k ? half_second : 0});
        ASSERT_EQ(eigen(m.mem.z), Vector3d(0.5, -0.25, 0.125) * 0.5 * k);
        ASSERT_EQ(integral_torque(m), Vector3d(0.5, -0.25, 0.125) * 0.5 * 0.25 * k);
    }
}

TEST(MrpFeedback, integral_of_a_ramp_is_exact)
{
    MrpFeedback m = integrating(vec3(0, 0, 0));
    for (int k = 0; k <= 64; k++) {
        m.in.error.sigma_BR = vec3(k / 128.0, 0, 0);
        mrp_feedback_update(&m, {k * half_second, k ? half_second : 0});
        ASSERT_EQ(m.mem.z.v[0], 0.5 * k * k / 256.0);
    }
}

TEST(MrpFeedback, integral_crosses_the_change_of_sets_smoothly)
{
    // Turning on about one axis through 180 degrees, where sigma jumps from +1 to -1.
    MrpFeedback m = integrating(vec3(0, 0, 0));
    double z = 0, last = 0;
    for (int k = 0; k <= 40; k++) {
        double angle = pi - 0.2 + 0.01 * k, sigma = std::tan(angle / 4);
        m.in.error.sigma_BR = mrp_short(vec3(0, 0, sigma));
        mrp_feedback_update(&m, {k * half_second, k ? half_second : 0});
        bool switched = m.in.error.sigma_BR.v[2] < 0;
        double before = switched ? -1 / last : last; // the last error in the set of this one
        z += k ? 0.25 * (before + m.in.error.sigma_BR.v[2]) : 0;
        last = sigma;
        ASSERT_NEAR(m.mem.z.v[2], z, 1e-12) << k;
    }
    EXPECT_LT(m.in.error.sigma_BR.v[2], 0) << "the sets were changed";
}

TEST(MrpFeedback, integral_is_limited_per_axis_and_comes_back_at_once)
{
    MrpFeedback m = integrating(vec3(0.5, -0.5, 0.01));
    m.par.u_I_max = 0.3;
    for (int k = 0; k < 100; k++) {
        mrp_feedback_update(&m, {k * half_second, k ? half_second : 0});
        ASSERT_LE(integral_torque(m).cwiseAbs().maxCoeff(), 0.3 * (1 + 1e-15));
    }
    EXPECT_NEAR(integral_torque(m)[0], 0.3, 1e-15);
    EXPECT_NEAR(integral_torque(m)[1], -0.3, 1e-15);
    EXPECT_NEAR(integral_torque(m)[2], 0.25 * 0.01 * 0.5 * 99, 1e-12);

    m.in.error.sigma_BR = vec3(-0.05, 0.05, 0.01);
    mrp_feedback_update(&m, {100 * half_second, half_second}); // the mean error still has its sign
    mrp_feedback_update(&m, {101 * half_second, half_second});
    EXPECT_NEAR(integral_torque(m)[0], 0.3 - 0.25 * 0.025, 1e-15) << "nothing was wound up";
}

TEST(MrpFeedback, integral_is_off_without_gain)
{
    MrpFeedback m = integrating(vec3(0.5, 0, 0));
    m.par.K_I = 0;
    for (int k = 0; k < 10; k++) {
        mrp_feedback_update(&m, {k * half_second, k ? half_second : 0});
    }
    EXPECT_EQ(eigen(m.mem.z), Vector3d::Zero());
    EXPECT_EQ(integral_torque(m), Vector3d::Zero());
}

TEST(MrpFeedback, nothing_is_integrated_across_a_gap)
{
    MrpFeedback m = integrating(vec3(0.5, 0, 0));
    mrp_feedback_update(&m, {0, 0});
    mrp_feedback_update(&m, {half_second, half_second});
    Vec3 z = m.mem.z;
    for (int k = 2; k < 50; k++) {
        m.in.error.sigma_BR.v[1] = NAN;
        mrp_feedback_update(&m, {k * half_second, half_second});
        ASSERT_EQ(eigen(m.mem.z), eigen(z));
        ASSERT_EQ(m.out.torque.head.quality, QUALITY_DEGRADED);
    }
    m.in.error.sigma_BR.v[1] = 0;
    mrp_feedback_update(&m, {50 * half_second, half_second});
    EXPECT_EQ(eigen(m.mem.z), eigen(z));
    EXPECT_EQ(m.out.torque.head.quality, QUALITY_GOOD);
    mrp_feedback_update(&m, {51 * half_second, half_second});
    EXPECT_EQ(m.mem.z.v[0], z.v[0] + 0.25);
}

TEST(MrpFeedback, a_first_update_without_data_does_not_count)
{
    MrpFeedback m = integrating(vec3(0.5, 0, 0));
    m.in.error.head = Head{};
    mrp_feedback_update(&m, {0, 0});
    m.in.error.head = good();
    mrp_feedback_update(&m, {half_second, half_second});
    EXPECT_EQ(eigen(m.mem.z), Vector3d::Zero());
}

TEST(MrpFeedback, removes_the_offset_of_an_unknown_torque)
{
    // The error at rest under a constant torque is L / K without, and 0 with the integral term.
    ClosedLoop loop{integrating(vec3(0, 0, 0)), {}};
    loop.plant = {Matrix3d::Identity(), Matrix3d::Identity(), Vector3d::Zero(), Vector3d::Zero(),
                  Vector3d(0.01, -0.02, 0.03)};
    loop.m.par.P = mat(2 * Matrix3d::Identity());
    const std::int64_t tenth = 100'000'000;
    for (double gain : {0.0, 0.25}) {
        loop.m.par.K_I = gain;
        mrp_feedback_reset(&loop.m);
        Vector3d sigma = Vector3d::Zero(), omega = Vector3d::Zero();
        for (int k = 0; k < 4000; k++) { // at 10 Hz, the body by the symplectic Euler method
            loop.m.in.error.sigma_BR = vec(sigma);
            loop.m.in.error.omega_BR_B = vec(omega);
            mrp_feedback_update(&loop.m, {k * tenth, k ? tenth : 0});
            omega += 0.1 * (eigen(loop.m.out.torque.torque_B) + loop.plant.L);
            sigma += 0.1 * eigen(mrp_rate(vec(sigma), vec(omega)));
        }
        EXPECT_NEAR((sigma - (gain > 0 ? Vector3d::Zero().eval() : loop.plant.L)).norm(), 0, 1e-9);
    }
}

TEST(MrpFeedback, holds_the_last_torque_against_numbers_that_are_not_finite)
{
    Random random{6};
    MrpFeedback m = any(random, 3);
    m.in.external = {good(), vec(random.vector())};
    m.par.K_I = 0.1;
    m.par.u_I_max = 1;
    mrp_feedback_update(&m, first);
    mrp_feedback_update(&m, {half_second, half_second});
    AttError &error = m.in.error;
    WheelSet &wheels = m.in.wheels;
    Doubles in = doubles(error.sigma_BR, error.omega_BR_B, error.omega_RN_B, error.domega_RN_B, m.in.vehicle.I_B,
                         m.in.external.torque_B, m.par.K, m.par.P);
    for (int i = 0; i < 3; i++) {
        for (double *p : doubles(wheels.axes_B[i], wheels.J[i], m.in.speeds.Omega[i])) {
            in.push_back(p);
        }
    }
    auto z = eigen(m.mem.z);
    expect_held(
        m, in,
        [&](MrpFeedback &x) {
            mrp_feedback_update(&x, {2 * half_second, half_second});
            EXPECT_EQ(eigen(x.mem.z), z);
        },
        [](MrpFeedback &x) { return std::vector{&x.out.torque.head}; });

    m.in.wheels.axes_B[3] = vec3(NAN, NAN, NAN); // beyond the number of wheels nothing is read
    m.in.speeds.Omega[7] = NAN;
    mrp_feedback_update(&m, {2 * half_second, half_second});
    EXPECT_EQ(m.out.torque.head.quality, QUALITY_GOOD);
}

TEST(MrpFeedback, the_torque_ends_after_a_time_without_new_data)
{
    constexpr std::int64_t second = 2 * half_second;
    enum class Loss { nan, never_again, held, stale };
    for (Loss loss : {Loss::nan, Loss::never_again, Loss::held, Loss::stale}) {
        for (double hold : {0.0, 0.4, 3.0, 1e6}) {
            Random random{8};
            MrpFeedback m = any(random, 3);
            m.par.hold = hold;
            m.par.K_I = 0.1;
            m.in.error.head.t = second;
            mrp_feedback_update(&m, {second, 0});
            const AttError error = m.in.error;
            const MrpFeedback before = m;
            switch (loss) {
            case Loss::nan: m.in.error.sigma_BR.v[0] = NAN; break;
            case Loss::never_again: m.in.error.head.quality = QUALITY_NONE; break;
            case Loss::held: m.in.error.head.quality = QUALITY_DEGRADED; break;
            case Loss::stale: m.in.error.head.quality = QUALITY_STALE; break;
            }
            const double last = hold > 0 ? hold : 10 * 0.5;
            for (int k = 1; k < 40; k++) {
                mrp_feedback_update(&m, {second + k * half_second, half_second});
                ASSERT_EQ(m.out.torque.head.quality, QUALITY_DEGRADED);
                if (0.5 * k <= last) {
                    ASSERT_GT(vec_norm(m.out.torque.torque_B), 0) << k << " " << hold;
                } else {
                    ASSERT_EQ(eigen(m.out.torque.torque_B), Vector3d::Zero()) << k << " " << hold;
                    ASSERT_EQ(m.out.torque.head.t, second + k * half_second) << "zero is new";
                }
            }
            // With data again, it goes on. What is degraded, but new, counts as well.
            m.in.error = error;
            m.in.error.head = {21 * second, QUALITY_DEGRADED, 9};
            for (int k = 40; k < 60; k++) {
                m.in.error.head.t = second + k * half_second;
                mrp_feedback_update(&m, {second + k * half_second, half_second});
                ASSERT_GT(vec_norm(m.out.torque.torque_B), 0);
            }
            // A good error counts however old it is: its wire says how old it may be.
            m = before;
            for (int k = 1; k < 60; k++) {
                mrp_feedback_update(&m, {second + k * half_second, half_second});
                ASSERT_EQ(m.out.torque.head.quality, QUALITY_GOOD);
            }
        }
    }
}

} // namespace mrp_feedback_test
} // namespace flight::testing
