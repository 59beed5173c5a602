// SPDX-License-Identifier: Apache-2.0
// The law in closed loop with rods by the cross-product law: small motions against the Floquet multipliers of linear
// equations of its own, and errors after random starts.
#include "flight/testing/consistency.h"
#include "flight/testing/linear.h"
#include "flight/testing/magnetic_orbit.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/control/magnetic_pointing.h"
}

namespace flight::testing {
namespace magnetic_pointing_test {

constexpr std::int64_t second = 1'000'000'000;
constexpr double degree = pi / 180;
using Matrix7d = Eigen::Matrix<double, 7, 7>;
using Vector7d = Eigen::Matrix<double, 7, 1>;

/// The gains that are recommended for a 12U.
MagneticPointing law(bool wheel)
{
    MagneticPointing m{};
    m.par = {1e-6, mat(6e-4 * Matrix3d::Identity()), vec3(0, 0, 1), 0, 0, 0, 0, 10};
    if (wheel) {
        m.par = {0, mat(3e-4 * Matrix3d::Identity()), vec3(0, 0, 2), 1.25e-3, 8.8e-3, 0.03, 5e-4, 10};
        m.in.wheels.head = m.in.speeds.head = good();
        m.in.wheels.n = 1;
        m.in.wheels.axes_B[0] = vec3(0, 0, 1);
        m.in.wheels.J[0] = 1e-5;
    }
    m.in.error.head = good();
    return m;
}

struct Flight {
    MagneticOrbit orbit;
    Craft craft;
    MagneticPointing m;
    Actions act;
    Vector3d dipole_B = Vector3d::Zero(); // of the craft itself
    double m_max = 0.4;
    std::int64_t t = 0;

    Flight(const MagneticOrbit &o, bool wheel) : orbit(o), m(law(wheel))
    {
        act.gravity_gradient = 3 * orbit.n * orbit.n;
    }
    Matrix3d dcm_BR() const { return craft.dcm_BN() * orbit.hill(1e-9 * static_cast<double>(t)).transpose(); }
    Vector3d omega_BR_B() const { return craft.omega - dcm_BR() * Vector3d(0, 0, orbit.n); }
    double error() const { return Eigen::AngleAxisd(dcm_BR()).angle(); }

    /// The dipole of three rods of `m_max` for a torque, scaled within their limits.
    Vector3d rods_for(const Vector3d &torque, const Vector3d &B) const
    {
        const Vector3d wanted = B.cross(torque) / B.squaredNorm();
        return wanted / std::max(1.0, wanted.cwiseAbs().maxCoeff() / m_max);
    }

    void step(std::int64_t dt)
    {
        const Tick tick{t, t ? dt : 0};
        const double now = 1e-9 * static_cast<double>(t);
        const Vector3d omega_R = dcm_BR() * Vector3d(0, 0, orbit.n);
        m.in.error = {good(t), dcm_to_mrp(mat(dcm_BR())), vec(craft.omega - omega_R), vec(omega_R), {}};
        m.in.speeds.Omega[0] = craft.h[2] / 1e-5;
        magnetic_pointing_update(&m, tick);
        act.dipole_B = rods_for(eigen(m.out.torque.torque_B), craft.dcm_BN() * orbit.field_N(now)) + dipole_B;
        const double u = std::clamp(m.out.wheels_torque.torque_B.v[2], -2e-3, 2e-3), h = craft.h[2];
        act.wheels_B.z() = std::abs(h) > 0.06 && u * h < 0 ? 0 : u; // limits of the motor and of the wheel's speed
        craft.step(orbit, now, 1e-9 * static_cast<double>(dt), act);
        t += dt;
    }
};

/// d/dt of small (theta, dtheta, h - h_bias) about the pointing, with axes r1, r2, r3: Euler's equations by hand.
Matrix7d linear(const MagneticOrbit &orbit, const MagneticPointing &m, double t)
{
    const Vector3d I = Craft{}.I.diagonal(), b = (orbit.hill(t) * orbit.field_N(t)).normalized();
    const Matrix3d across = Matrix3d::Identity() - b * b.transpose(), P = eigen(m.par.P);
    const double n = orbit.n, h = m.par.h_bias, g = m.par.gain;
    Matrix3d of_theta = Matrix3d::Zero(), of_rate = Matrix3d::Zero(), rods = -m.par.K / 4 * Matrix3d::Identity(),
             D = -P;
    of_rate(0, 1) = (I[0] + I[1] - I[2]) * n - h;
    of_rate(1, 0) = -of_rate(0, 1);
    of_theta(0, 0) = -((I[2] - I[1]) * n + h) * n;
    of_theta(1, 1) = -4 * (I[2] - I[0]) * n * n - h * n;
    of_theta(2, 2) = -3 * n * n * (I[1] - I[0]);
    if (h > 0) {
        rods.row(2).setZero();
        D.row(2).setZero();
        rods(0, 1) -= g * h;
        rods(1, 0) += g * h;
    }
    of_theta += across * rods;
    of_rate += across * D;
    of_theta(2, 2) -= m.par.K_pitch / 4;
    of_rate(2, 2) -= m.par.P_pitch;
    Matrix7d A = Matrix7d::Zero();
    A.block<3, 3>(0, 3).setIdentity();
    A.block<3, 3>(3, 0) = I.cwiseInverse().asDiagonal() * of_theta;
    A.block<3, 3>(3, 3) = I.cwiseInverse().asDiagonal() * of_rate;
    A.block<3, 1>(3, 6) = I.cwiseInverse().asDiagonal() * (-g * across.col(2));
    A(6, 2) = m.par.K_pitch / 4;
    A(6, 5) = m.par.P_pitch;
    return A;
}

struct Orbits {
    double linear, flown, difference; ///< largest multipliers per orbit; how far the matrices are apart, of 1
};

/// What an orbit makes of small states, by the linear equations and by the flight itself.
Orbits multipliers(bool wheel, double P, double gain)
{
    MagneticOrbit orbit;
    orbit.tilt = 0; // so that the field repeats
    const std::int64_t dt = wheel ? second / 4 : second;
    const auto steps = std::llround(2 * pi / orbit.n / (1e-9 * static_cast<double>(dt)));
    orbit.n = 2 * pi / (1e-9 * static_cast<double>(dt * steps));
    auto change = [&](MagneticPointing &m) {
        m.par.P = mat(P * Matrix3d::Identity());
        m.par.gain = gain;
    };
    MagneticPointing m = law(wheel);
    change(m);
    Matrix7d X = Matrix7d::Identity(), Y;
    const double h = 2e-9 * static_cast<double>(dt);
    for (int k = 0; k < steps / 2; k++) {
        const Matrix7d A = linear(orbit, m, k * h), B = linear(orbit, m, (k + 0.5) * h),
                       C = linear(orbit, m, (k + 1) * h);
        const Matrix7d a = A * X, b = B * (X + h / 2 * a), c = B * (X + h / 2 * b), d = C * (X + h * c);
        X += h / 6 * (a + 2 * b + 2 * c + d);
    }
    for (int i = 0; i < 7; i++) {
        Vector7d small = Vector7d::Zero();
        small[i] = i < 3 ? 1e-3 : i < 6 ? 1e-6 : 1e-5;
        Flight flight(orbit, wheel);
        change(flight.m);
        const Vector3d theta = small.head<3>();
        const Matrix3d turned = theta.norm() > 0 ? turn(theta, theta.norm()) : Matrix3d::Identity();
        flight.craft.measure(turned * orbit.hill(0));
        flight.craft.omega = turned * Vector3d(0, 0, orbit.n) + small.segment<3>(3);
        flight.craft.h.z() = flight.m.par.h_bias + small[6];
        for (int k = 0; k < steps; k++) {
            flight.step(dt);
        }
        const Eigen::AngleAxisd left(flight.dcm_BR().transpose()); // its turn carries R into B
        Y.col(i) << left.angle() * left.axis(), flight.omega_BR_B(), flight.craft.h.z() - flight.m.par.h_bias;
        Y.col(i) /= small[i];
    }
    auto largest = [&](const Matrix7d &M) { // without a wheel its momentum is no state
        return spectral_radius(M.topLeftCorner(wheel ? 7 : 6, wheel ? 7 : 6));
    };
    Vector7d units;
    units << 1, 1, 1, orbit.n, orbit.n, orbit.n, 0.03;
    const Matrix7d scale = units.asDiagonal(), unscale = units.cwiseInverse().asDiagonal();
    return {largest(X), largest(Y), (unscale * (X - Y) * scale).norm() / (unscale * X * scale).norm()};
}

TEST(MagneticPointing, small_motions_decay_as_their_floquet_multipliers_say)
{
    const Orbits rods = multipliers(false, 6e-4, 0), edge = multipliers(false, 2.4e-4, 0);
    const Orbits wheel = multipliers(true, 3e-4, 5e-4);
    for (const auto &[orbits, name] : {std::pair{rods, "rods"}, {edge, "rods, P too small"}, {wheel, "with a wheel"}}) {
        EXPECT_LT(orbits.difference, 0.01) << name;
        std::printf("per orbit, %s: %.3f, linear %.3f, matrices differ by %.4f\n", name, orbits.flown, orbits.linear,
                    orbits.difference);
    }
    EXPECT_LT(rods.flown, 0.35);
    EXPECT_LT(wheel.flown, 0.3);
    EXPECT_GT(edge.flown, 1.2) << "P below K / (3 n) is unstable";
    EXPECT_GT(multipliers(true, 1e-5, 5e-4).linear, 1) << "P below gain I lets the nutation grow";
}

TEST(MagneticPointing, without_rods_gravity_gradient_swings_the_pitch)
{
    Flight flight({}, false);
    flight.m_max = 1e-30;
    flight.craft.measure(turn(2, 1e-3) * flight.orbit.hill(0));
    flight.craft.omega = Vector3d(0, 0, flight.orbit.n);
    const double quarter = pi / 2 / (flight.orbit.n * std::sqrt(3 * (0.12 - 0.05) / 0.125));
    while (1e-9 * static_cast<double>(flight.t) < 2 * quarter) {
        flight.step(second);
    }
    EXPECT_NEAR(std::atan2(flight.dcm_BR()(0, 1), flight.dcm_BR()(0, 0)), -1e-3, 2e-6) << "half a period";
}

/// Flies from any attitude with what a B-dot leaves of the rates; [rad] the errors of the last 2 orbits.
std::vector<double> errors(Random &random, bool wheel, double orbits, double dipole, double torque)
{
    Flight flight(MagneticOrbit::any(random), wheel);
    flight.craft.measure(random.attitude());
    flight.craft.omega = random.direction() * 0.15 * degree;
    flight.dipole_B = random.direction() * dipole;
    flight.act.disturbance_B = random.direction() * torque;
    const double period = 2 * pi / flight.orbit.n;
    std::vector<double> all;
    while (1e-9 * static_cast<double>(flight.t) < orbits * period) {
        flight.step(2 * second);
        if (1e-9 * static_cast<double>(flight.t) > (orbits - 2) * period) {
            all.push_back(flight.error());
        }
    }
    return all;
}

TEST(MagneticPointing, errors_after_random_starts)
{
    struct Case {
        bool wheel;
        double orbits, dipole, torque, rms, most;
    };
    for (const Case &c : {Case{false, 8, 0, 0, 0.1, 0.5}, Case{false, 10, 1e-3, 1e-8, 15, 30},
                          Case{true, 6, 0, 0, 0.2, 2}, Case{true, 6, 0.01, 1e-7, 1, 2}}) {
        Random random{5};
        std::vector<double> all;
        for (int i = 0; i < campaign_runs(8, 100); i++) {
            const std::vector<double> some = errors(random, c.wheel, c.orbits, c.dipole, c.torque);
            all.insert(all.end(), some.begin(), some.end());
        }
        std::sort(all.begin(), all.end());
        double sum = 0;
        for (double e : all) {
            sum += e * e;
        }
        const double rms = std::sqrt(sum / static_cast<double>(all.size())) / degree, most = all.back() / degree;
        EXPECT_LT(rms, c.rms);
        EXPECT_LT(most, c.most);
        std::printf("wheel %d, %.3f A m^2, %.0e N m: after %.0f orbits rms %.2f, median %.2f, worst %.2f deg\n",
                    c.wheel, c.dipole, c.torque, c.orbits - 2, rms, all[all.size() / 2] / degree, most);
    }
}

TEST(MagneticPointing, wheels_turn_about_the_pitch_axis_and_rods_restore_their_momentum)
{
    Random random{6};
    for (int i = 0; i < 300; i++) {
        MagneticPointing m = law(true);
        m.in.wheels.n = 3; // along any axes
        for (int k = 0; k < 3; k++) {
            m.in.wheels.axes_B[k] = vec((Vector3d::Unit(k) + random.vector(0.3)).normalized());
            m.in.wheels.J[k] = 1e-5;
            m.in.speeds.Omega[k] = random.real(-3000, 3000);
        }
        m.par.pitch_B = vec(random.direction());
        m.par.P = {};
        m.in.error.sigma_BR = random.mrp();
        magnetic_pointing_update(&m, {0, 0});
        const Vector3d a = eigen(m.par.pitch_B), given = eigen(m.out.wheels_torque.torque_B);
        EXPECT_LT(given.cross(a).norm(), 1e-15);
        EXPECT_LE(given.dot(a) * eigen(m.in.error.sigma_BR).dot(a), 0);
        Vector3d h = Vector3d::Zero();
        for (int k = 0; k < 3; k++) {
            h += 1e-5 * m.in.speeds.Omega[k] * eigen(m.in.wheels.axes_B[k]);
        }
        const Vector3d L = eigen(m.out.torque.torque_B), normal = dcm(m.in.error.sigma_BR) * a;
        EXPECT_NEAR(L.dot(a), -5e-4 * (h.dot(a) - 0.03), 1e-16) << "of h_bias along the pitch axis, tilted or not";
        EXPECT_LT((L - L.dot(a) * a + 5e-4 * (h - 0.03 * normal - (h - 0.03 * normal).dot(a) * a)).norm(), 1e-16);
    }
}

TEST(MagneticPointing, missing_and_bad_data)
{
    for (const bool wheel : {false, true}) {
        for (const Quality lost : {QUALITY_NONE, QUALITY_STALE, QUALITY_DEGRADED, QUALITY_GOOD}) {
            MagneticPointing m = law(wheel);
            m.par.hold = 3;
            m.in.error.sigma_BR = vec3(0.1, 0.2, 0.3);
            magnetic_pointing_update(&m, {0, 0});
            EXPECT_EQ(m.out.torque.head.quality, QUALITY_GOOD);
            m.in.error.head.quality = lost;
            m.in.error.sigma_BR.v[1] = lost == QUALITY_GOOD ? NAN : 0.2;
            for (int k = 1; k < 8; k++) {
                magnetic_pointing_update(&m, {k * second, second});
                EXPECT_EQ(vec_norm(m.out.torque.torque_B) > 0, k <= 3);
                EXPECT_EQ(vec_norm(m.out.wheels_torque.torque_B) > 0, wheel && k <= 3);
                EXPECT_EQ(m.out.torque.head.quality, QUALITY_DEGRADED);
                EXPECT_EQ(m.out.wheels_torque.head.quality, QUALITY_DEGRADED);
            }
        }
    }
    Random random{7};
    MagneticPointing m = law(true);
    m.in.speeds = {};
    m.in.error.sigma_BR = vec3(0.1, 0.2, 0.3);
    magnetic_pointing_update(&m, {0, 0});
    EXPECT_EQ(m.out.torque.head.quality, QUALITY_DEGRADED) << "wheels of unknown speeds";
    EXPECT_EQ(vec_norm(m.out.wheels_torque.torque_B), 0);
}

} // namespace magnetic_pointing_test
} // namespace flight::testing
