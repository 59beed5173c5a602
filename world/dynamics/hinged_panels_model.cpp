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
    panel.moment[0][0] = m;
    for (int k = 0; k < 5; k++) {
        panel.inertia[k].add(mat(inertia[k]));
    }
    for (int k = 0; k < 3; k++) {
        const Vector3d turn = around[k] * g + h.cross(push[k]);
        std::copy(b[k].begin(), b[k].end(), panel.moment[k] + 1);
        std::copy(turn.begin(), turn.end(), panel.turn[k]);
    }
    std::copy(push[1].begin(), push[1].end(), panel.push[0]);
    std::copy(push[2].begin(), push[2].end(), panel.push[1]);
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
        panels_.of[i] = panel(i);
        panels_.per_J[i] = 1.0 / panels_.of[i].J;
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
        changed |= rest != panels_.rest[i] || u != panels_.u[i];
        panels_.rest[i] = rest;
        panels_.u[i] = u;
    }
    return changed;
}

void HingedPanelsModel::couple(const double *x, const Motion &motion, Loads &loads, Whole &whole)
{
    sim::in_registers<&HingedPanelsModel::couple_in_lanes>(*this, x, motion.omega, loads, whole);
}

LANES_INLINE void HingedPanelsModel::couple_in_lanes(const double *x, const Vec3 &rate, Loads &loads, Whole &whole)
{
    x_ = x;
    Placed placed(whole);
    Moved moved(whole, loads);
    for (std::size_t i = 0; i < n_; i += state_block) {
        const auto four = up_to<4>(i);
        const Swing state = four.load(x);
        UpTo<4>::Place &at = places_[i / state_block];
        four.place(state.at, placed, at);
        acting_[i / state_block] = four.act(at, state, quad(rate), moved);
    }
    placed.put(whole);
    moved.put(whole, loads);
}

HingedPanelsModel::Hinge HingedPanelsModel::hinge(std::size_t i) const
{
    Quad sine, cosine;
    sincos(quad(x_[i]), sine, cosine);
    return {interface_.par.hinge_B[i], vec_unit(interface_.par.axes_B[i]), sine[0], cosine[0], x_[rates_ + i]};
}

void HingedPanelsModel::check_mount(const HingedPanelsModel *panels, const std::string &name, std::size_t i,
                                    std::size_t panel)
{
    if (panel > (panels ? panels->size() : 0)) {
        throw sim::SetupError(name + ".panel[" + std::to_string(i) + "] is " + std::to_string(panel) +
                              (panels ? ", but its HingedPanels have n = " + std::to_string(panels->size())
                                      : ", but " + name + ".panels is missing: the HingedPanels that carry it"));
    }
}

void HingedPanelsModel::drive(std::size_t i, double torque, Whole &whole)
{
    auto &at = places_[i / state_block];
    const std::size_t k = i % state_block;
    acting_[i / state_block].force[k] += torque;
    whole.drive(torque * panels_.per_J[i], vec(at.push[k]), vec(at.turn[k]));
}

/// With the push p = sum dm dr/dq, and I' = d/dq sum dm (r.r - r r), which the gradient G feels without its trace:
///
///   sum dm dr/dq . G (r - c) = -1/2 sum_jk G_jk I'_jk - p . G c
void HingedPanelsModel::tide(const Mat3 &gradient, const Vec3 &c, Whole &whole)
{
    Symmetric G{};
    G.add(gradient);
    const Vec3 Gc = mat_vec(gradient, c);
    for (std::size_t i = 0; i < n_; i++) {
        const Hinge h = hinge(i);
        const double slopes[4] = {-h.sine, h.cosine, -2.0 * h.sine * h.cosine, 2.0 * h.cosine * h.cosine - 1.0};
        double bent = 0.0;
        for (int k = 0; k < 4; k++) {
            const Symmetric &I = panels_.of[i].inertia[k + 1];
            for (int j = 0; j < 3; j++) {
                bent += slopes[k] * (G.along[j] * I.along[j] + 2.0 * G.across[j] * I.across[j]);
            }
        }
        drive(i, -0.5 * bent - vec_dot(vec(places_[i / state_block].push[i % state_block]), Gc), whole);
    }
}

void HingedPanelsModel::accelerate(const double *, const Vec3 &a, const Vec3 &domega, double *dx) const
{
    sim::in_registers<&HingedPanelsModel::accelerate_in_lanes>(*this, a, domega, dx);
}

LANES_INLINE void HingedPanelsModel::accelerate_in_lanes(const Vec3 &a, const Vec3 &domega, double *dx) const
{
    for (std::size_t i = 0; i < n_; i += state_block) {
        const auto four = up_to<4>(i);
        const std::size_t b = i / state_block;
        four.store(dx, four.accelerate(places_[b], acting_[b], quad(a), quad(domega)));
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
