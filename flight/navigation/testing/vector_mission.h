// SPDX-License-Identifier: Apache-2.0
// A body that tumbles in a low orbit with a gyro, a coarse sun sensor and a magnetometer, and a filter on board.
#pragma once

#include "flight/navigation/testing/directions.h"
#include "flight/testing/linear.h"

extern "C" {
#include "flight/navigation/quest.h"
#include "flight/navigation/vector_filter.h"
}

#include <Eigen/Geometry>

#include <functional>

namespace flight::testing {

inline constexpr double degree = pi / 180;

/// Gyro and filter at 2 Hz, Sun and field at 1 Hz, each measurement half a second old when it arrives.
struct VectorMission {
    static constexpr std::int64_t step_ns = 500'000'000;
    Random random;
    VectorFilter m{};
    Quest quest{};
    Eigen::Quaterniond q_NB; ///< x_N = q x_B
    Vector3d omega, I, bias, field_bias, sun_N, pole, node;
    double sun_std, field_noise, phase;
    std::int64_t t = 0;
    bool dark = false, lit = true;
    struct Past {
        Matrix3d dcm_BN;
        Vector3d bias;
    } before{};
    std::function<void(VectorMission &)> fault; ///< spoils what is measured, before it is used
    SeenDirection sun{};
    MeasuredField field{};
    KnownField known{};

    explicit VectorMission(std::uint64_t seed, double fastest = 5 * degree) : random(seed)
    {
        q_NB = Eigen::Quaterniond(random.attitude());
        omega = random.vector(fastest / std::sqrt(3));
        I = Vector3d(1, 1, 0.6) + random.vector(0.2);
        sun_N = random.direction();
        pole = (Vector3d::UnitX() + random.vector(0.3)).normalized(); // a polar orbit, more or less
        node = pole.unitOrthogonal();
        sun_std = random.real(1, 3) * degree;
        field_noise = random.real(100, 300) * 1e-9;
        phase = random.real(0, 95 * 60);
        m.par.rate_noise = std::pow(0.15 * degree / 60, 2);       // 0.15 deg/sqrt(h)
        m.par.bias_walk = std::pow(10 * degree / 3600, 2) / 3600; // 10 deg/h in an hour
        m.par.bias_std = 0.05 * degree;
        m.par.field_noise = field_noise;
        m.par.field_walk = std::pow(50e-9, 2) / 3600;
        m.par.field_bias_std = 1000e-9;
        m.par.gate = 5;
        m.par.hold = 2;
        m.par.age_max = 1.5;
        m.par.good = 1 * degree;
        m.par.persistence = 5;
        quest.par = {0.2, 0.6, 4};
        bias = random.normals(m.par.bias_std);
        field_bias = random.normals(m.par.field_bias_std);
    }

    double seconds() const { return 1e-9 * static_cast<double>(t); }
    Matrix3d dcm_BN() const { return q_NB.toRotationMatrix().transpose(); }

    /// A tilted dipole that turns with the Earth, at 500 km.
    Vector3d B_N() const
    {
        const double u = 2 * pi * (seconds() + phase) / (95 * 60), day = 7.292e-5 * seconds() + phase;
        const Vector3d r = std::cos(u) * node + std::sin(u) * pole.cross(node);
        const Vector3d dipole(std::sin(0.17) * std::cos(day), std::sin(0.17) * std::sin(day), -std::cos(0.17));
        return 3.0e-5 * std::pow(6371. / 6871, 3) * (3 * dipole.dot(r) * r - dipole);
    }

    void turn_by(double dt)
    {
        const auto rate = [&](const Vector3d &w) -> Vector3d { return -w.cross(I.cwiseProduct(w)).cwiseQuotient(I); };
        for (int i = 0; i < 8; i++) {
            const double h = dt / 8;
            const Vector3d middle = omega + h / 2 * rate(omega);
            omega += h * rate(middle);
            q_NB = (q_NB * Eigen::Quaterniond(Eigen::AngleAxisd(middle.norm() * h, middle.normalized()))).normalized();
        }
    }

    void step()
    {
        const double dt = 1e-9 * step_ns;
        if (t > 0 || before.dcm_BN.norm() > 0) {
            before = {dcm_BN(), bias};
            turn_by(dt);
            bias += random.normals(std::sqrt(m.par.bias_walk * dt));
            field_bias += random.normals(std::sqrt(m.par.field_walk * dt));
            t += step_ns;
        } else {
            before = {dcm_BN(), bias};
        }
        dark = std::fmod(seconds() + phase, 95 * 60.) > 60 * 60;
        m.in.gyro = {good(t), vec(Vector3d(omega + bias + random.normals(std::sqrt(m.par.rate_noise / dt))))};
        known = {good(t), vec(B_N())};
        if (t / step_ns % 2 == 1) { // what was measured at the last step
            const Vector3d d = before.dcm_BN * sun_N, e = d.cross(random.normals(sun_std));
            sun = {good(t - step_ns), vec(Vector3d(turn(e, -e.norm()) * d)), vec(sun_N), sun_std};
            if (dark) {
                sun.head.quality = QUALITY_DEGRADED; // carried on, and wrong
                sun.d_B = vec3(1, 0, 0);
            }
            field = {good(t - step_ns),
                     vec(Vector3d(before.dcm_BN * B_N() + field_bias + random.normals(field_noise)))};
        }
        if (fault) {
            fault(*this);
        }
        const double strength = vec_norm(known.B_N);
        quest.in.first = sun;
        quest.in.second = {field.head, vec_unit(field.B_B), vec_unit(known.B_N),
                           std::hypot(field_noise, m.par.field_bias_std) / strength};
        quest_update(&quest, {t, step_ns});
        m.in.start = quest.out.attitude;
        m.in.first = sun;
        m.in.field = field;
        m.in.known_field = known;
        vector_filter_update(&m, {t, step_ns});
    }

    void run(double duration)
    {
        for (int i = 0; i < std::lround(duration * 1e9 / step_ns); i++) {
            step();
        }
    }

    Quality quality() const { return m.out.attitude.head.quality; }
    const VectorFilterState &state() const { return m.out.state; }

    /// The small turn from the estimated attitude to the true one, and the errors of the biases.
    Eigen::Matrix<double, 9, 1> error() const
    {
        const Eigen::Quaterniond q(dcm(m.out.attitude.sigma_BN).transpose());
        const Eigen::AngleAxisd left(q.conjugate() * q_NB);
        const double angle = left.angle() > pi ? left.angle() - 2 * pi : left.angle();
        Eigen::Matrix<double, 9, 1> e;
        e << angle * left.axis(), bias - eigen(m.out.state.bias_B), field_bias - eigen(m.out.state.field_bias_B);
        return e;
    }

    /// Errors squared by the covariance, of all states or of the attitude alone.
    double normalised(int states) const
    {
        Eigen::Map<const Eigen::Matrix<double, 9, 9, Eigen::RowMajor>> root(&m.mem.at.root[0][0]);
        const Eigen::MatrixXd P = (root.transpose() * root).topLeftCorner(states, states);
        const Eigen::VectorXd scale = P.diagonal().cwiseSqrt().cwiseInverse(),
                              e = scale.cwiseProduct(error().head(states));
        const Eigen::MatrixXd unit = scale.asDiagonal() * P * scale.asDiagonal();
        return e.dot(solve(unit, e));
    }
};

/// Averages over a mission's measurements that were used, of the Sun and of the field.
struct Innovations {
    double sum[2] = {0, 0};
    int n[2] = {0, 0};
    std::uint32_t used[2] = {0, 0};

    void measure(const VectorFilterState &state)
    {
        for (const int i : {0, 1}) {
            const int source = i == 0 ? 0 : 3;
            if (state.used[source] != used[i]) {
                used[i] = state.used[source];
                sum[i] += state.misfit[source];
                n[i]++;
            }
        }
    }
};

/// Wrong directions and fields, and a time without the Sun, the field, or the gyro.
inline void spoil(VectorMission &f, double duration)
{
    const double from = f.random.real(0, duration), to = from + std::exp(f.random.real(0, 6)); // 1 to 400 s
    const int kind = f.random.below(4);
    f.fault = [=](VectorMission &now) {
        const bool out = now.seconds() > from && now.seconds() < to;
        if (now.t / VectorMission::step_ns % 2 == 1) {
            if (!now.dark && now.random.below(50) == 0) {
                now.sun.d_B = vec(now.random.direction());
            }
            if (now.random.below(50) == 0) {
                now.field.B_B = vec(Vector3d(5e-5 * now.random.direction()));
            }
        }
        now.sun.head.quality = out && kind == 0 ? QUALITY_STALE : now.sun.head.quality;
        now.field.head.quality = out && kind == 1 ? QUALITY_STALE : now.field.head.quality;
        now.m.in.gyro.head.quality = out && kind == 2 ? QUALITY_STALE : now.m.in.gyro.head.quality;
    };
}

} // namespace flight::testing
