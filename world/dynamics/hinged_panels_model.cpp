// SPDX-License-Identifier: Apache-2.0
#include "world/dynamics/hinged_panels_model.h"

#include "sim/error.h"
#include "sim/text.h"
#include "world/dynamics/lanes.h"
#include "world/eigen.h"

#include <Eigen/Geometry>

#include <utility>

namespace fledge::world {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Matrix3d cross_matrix(const Vector3d &a)
{
    Matrix3d m;
    m << 0.0, -a[2], a[1], a[2], 0.0, -a[0], -a[1], a[0], 0.0;
    return m;
}

/// 2 a.b - a b - b a: the inertia that two offsets have together.
Matrix3d mixed(const Vector3d &a, const Vector3d &b)
{
    return 2.0 * a.dot(b) * Matrix3d::Identity() - a * b.transpose() - b * a.transpose();
}

void add(Rows &to, const Matrix3d &a)
{
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            to.m[i][j] += a(i, j);
        }
    }
}

} // namespace

void HingedPanelsModel::prepare(const sim::Setup &setup)
{
    n_ = interface_.par.n;
    rates_ = sim::padded(n_);
    for (std::size_t i = 0; i < n_; i++) {
        if (const double J = panel(i).J; !(J >= 1e-9 && J <= 1e12)) {
            throw sim::SetupError(setup.name + ".I_B[" + std::to_string(i) + "]: with mass and center_B it must give " +
                                  "an inertia about the hinge in [1e-9, 1e12] kg m^2; found " + sim::format_number(J));
        }
    }
}

HingedPanelsModel::Panel HingedPanelsModel::panel(std::size_t i) const
{
    // The rotation by theta about g is  P + C cos + S sin.
    const auto &par = interface_.par;
    const double m = par.mass[i];
    const Vector3d g = view(par.axes_B[i]).stableNormalized(), h = view(par.hinge_B[i]), d = view(par.center_B[i]);
    const Matrix3d P = g * g.transpose(), C = Matrix3d::Identity() - P, S = cross_matrix(g);
    const Matrix3d I = view(par.I_B[i]) + 0.5 * m * mixed(d, d); // about the hinge

    const Vector3d b[3] = {m * P * d + m * h, m * C * d, m * S * d};
    const Vector3d push[3] = {Vector3d::Zero(), b[2], -b[1]}; // the derivative of b by the angle
    // With C I C cos^2 + (C I S' + S I C) sin cos + S I S' (1 - cos^2):
    const Matrix3d across = S * I * S.transpose();
    const Matrix3d around[3] = {P * I * P, P * I * C + C * I * P, P * I * S.transpose() + S * I * P};
    const Matrix3d inertia[5] = {around[0] + across + 0.5 * m * mixed(h, h) + mixed(h, m * P * d),
                                 around[1] + mixed(h, b[1]), around[2] + mixed(h, b[2]), C * I * C - across,
                                 C * I * S.transpose() + S * I * C};
    Panel panel{};
    panel.J = g.dot(I * g);
    panel.constant.mass = m;
    Whole *const of[5] = {&panel.constant, panel.terms, panel.terms + 1, panel.terms + 2, panel.terms + 3};
    Vector3d turn[3];
    for (int k = 0; k < 5; k++) {
        add(of[k]->inertia, inertia[k]);
    }
    for (int k = 0; k < 3; k++) {
        of[k]->moment = vec(b[k]);
        turn[k] = around[k] * g + h.cross(push[k]);
        std::copy(turn[k].begin(), turn[k].end(), panel.turn[k]);
    }
    std::copy(push[1].begin(), push[1].end(), panel.push[0]);
    std::copy(push[2].begin(), push[2].end(), panel.push[1]);
    // The products of two sums a_0 + a_1 cos + a_2 sin, where sin^2 = 1 - cos^2.
    const auto take = [&](Whole &to, int j, int k, double factor) {
        add(to.linear, factor * push[j] * push[k].transpose());
        add(to.cross, factor * push[j] * turn[k].transpose());
        add(to.angular, factor * turn[j] * turn[k].transpose());
    };
    constexpr int place[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 0}};
    for (int j = 0; j < 3; j++) {
        for (int k = 0; k < 3; k++) {
            take(*of[place[j][k]], j, k, 1.0 / panel.J);
        }
    }
    take(*of[3], 2, 2, -1.0 / panel.J);
    return panel;
}

std::vector<StateName> HingedPanelsModel::names() const
{
    std::vector<StateName> all;
    add_names(all, 0, "theta", "rad", n_);
    add_names(all, rates_, "dtheta", "rad/s", n_);
    return all;
}

void HingedPanelsModel::start(const Vec3 &, double *x)
{
    for (std::size_t i = 0; i < n_; i++) {
        panels_[i] = panel(i);
        x[i] = interface_.par.theta[i];
        x[rates_ + i] = interface_.par.dtheta[i];
    }
    interface_.out = {};
}

bool HingedPanelsModel::latch(const double *, const BodyRate &, double dt)
{
    const PanelCommand &command = interface_.in.command;
    const bool commanded = head_written(command.head);
    bool changed = std::exchange(changed_, false);
    for (std::size_t i = 0; i < n_; i++) {
        const double rest = commanded ? command.theta[i] : 0.0, u = commanded && dt > 0.0 ? command.u[i] : 0.0;
        changed |= rest != panels_[i].rest || u != panels_[i].u;
        panels_[i].rest = rest;
        panels_[i].u = u;
    }
    return changed;
}

void HingedPanelsModel::couple(const double *x, const Motion &motion, Loads &, Whole &whole)
{
    sim::in_registers<&HingedPanelsModel::couple_in_lanes>(*this, x, motion.omega, whole);
}

LANES_INLINE void HingedPanelsModel::couple_in_lanes(const double *x, const Vec3 &rate, Whole &whole)
{
    x_ = x;
    const auto &par = interface_.par;
    const Quad omega = quad(rate);
    Quad sines{}, cosines{}, force = quad(whole.force), torque = quad(whole.torque), drift = quad(whole.drift);
    for (std::size_t i = 0; i < n_; i++) {
        if (i % 4 == 0) {
            sincos(quad_at(x + i), sines, cosines);
        }
        const Panel &p = panels_[i];
        const double theta = x[i], dtheta = x[rates_ + i];
        const double s = sines[i % 4], c = cosines[i % 4], c2 = c * c, s2 = s * c;
        for (std::size_t k = 0; k < Whole::matrix; k += 4) {
            const auto of = [k](const Whole &term) { return quad_at(&term.mass + k); };
            add_at(&whole.mass + k, of(p.constant) + (c * of(p.terms[0]) + s * of(p.terms[1])) +
                                        (c2 * of(p.terms[2]) + s2 * of(p.terms[3])));
        }
        const auto bent = [&](int j) {
            const auto of = [&](int term) { return quad_at(p.terms[term].inertia.m[j]); };
            return (c * of(1) - s * of(0)) + ((2.0 * c2 - 1.0) * of(3) - 2.0 * s2 * of(2));
        };
        const Quad bends = combine(bent(0), bent(1), bent(2), rate.v); // d(inertia)/dtheta omega
        const Quad by_c = quad_at(p.push[0]), by_s = quad_at(p.push[1]), push = c * by_c + s * by_s;
        const Quad turn_c = quad_at(p.turn[1]), turn_s = quad_at(p.turn[2]);
        const Quad turn = quad_at(p.turn[0]) + c * turn_c + s * turn_s;
        const double acting =
            p.u - par.stiffness[i] * (theta - p.rest) - par.damping[i] * dtheta + 0.5 * dot(omega, bends);
        const double per = acting / p.J;
        force -= per * push + dtheta * (2.0 * cross(omega, push) + dtheta * (c * by_s - s * by_c));
        torque -= per * turn + dtheta * (bends + cross(omega, turn) + dtheta * (c * turn_s - s * turn_c));
        drift += dtheta * push;
        put(now_[i].push, push);
        put(now_[i].turn, turn);
        now_[i].inertia = p.J;
        now_[i].force = acting;
    }
    put(whole.force, force);
    put(whole.torque, torque);
    put(whole.drift, drift);
}

HingedPanelsModel::Hinge HingedPanelsModel::hinge(std::size_t i) const
{
    Quad sine, cosine;
    sincos(quad(x_[i]), sine, cosine);
    return {interface_.par.hinge_B[i], vec_unit(interface_.par.axes_B[i]), sine[0], cosine[0], x_[rates_ + i]};
}

void HingedPanelsModel::drive(std::size_t i, double torque, Whole &whole)
{
    Freedom &q = now_[i];
    q.force += torque;
    whole.force = vec_sub(whole.force, vec_scale(torque / q.inertia, q.push));
    whole.torque = vec_sub(whole.torque, vec_scale(torque / q.inertia, q.turn));
}

void HingedPanelsModel::accelerate(const double *x, const Vec3 &a, const Vec3 &domega, double *dx) const
{
    for (std::size_t i = 0; i < n_; i++) {
        dx[i] = x[rates_ + i];
        dx[rates_ + i] = now_[i].acceleration(a, domega);
    }
}

void HingedPanelsModel::publish(sim::Ns t, const double *x, const Vec3 &)
{
    PanelAngles &angles = interface_.out.angles;
    for (std::size_t i = 0; i < n_; i++) {
        angles.theta[i] = x[i];
        angles.dtheta[i] = x[rates_ + i];
    }
    angles.head = head_next(angles.head, t, QUALITY_GOOD);
}

} // namespace fledge::world
