// SPDX-License-Identifier: Apache-2.0
#include "world/dynamics/fuel_slosh_model.h"

namespace fledge::world {

void FuelSloshModel::prepare(const sim::Setup &)
{
    n_ = interface_.par.n;
    rates_ = sim::padded(n_);
}

void FuelSloshModel::refresh()
{
    const auto &par = interface_.par;
    lines_ = {};
    changed_ = true;
    for (std::size_t i = 0; i < n_; i++) {
        const Vec3 axis = vec_unit(par.axes_B[i]), turn = vec_cross(par.r_B[i], axis);
        for (int j = 0; j < 3; j++) {
            lines_.axis[j][i] = axis.v[j];
            lines_.place[j][i] = par.r_B[i].v[j];
            lines_.turn[j][i] = turn.v[j];
        }
        lines_.all.mass += par.mass[i];
        lines_.all.free({vec_scale(par.mass[i], axis), vec_scale(par.mass[i], turn), par.mass[i], 0.0});
        lines_.mass[i] = par.mass[i];
        lines_.stiffness[i] = par.stiffness[i] / par.mass[i];
        lines_.damping[i] = par.damping[i] / par.mass[i];
    }
}

std::vector<StateName> FuelSloshModel::names() const
{
    std::vector<StateName> all;
    add_names(all, 0, "rho", "m", n_);
    add_names(all, rates_, "drho", "m/s", n_);
    return all;
}

void FuelSloshModel::start(const Vec3 &, double *x)
{
    refresh();
    for (std::size_t i = 0; i < n_; i++) {
        x[i] = interface_.par.rho[i];
        x[rates_ + i] = interface_.par.drho[i];
    }
    interface_.out = {};
}

void FuelSloshModel::couple(const double *x, const Motion &motion, Loads &loads, Whole &whole)
{
    sim::in_registers<&FuelSloshModel::couple_in_lanes>(*this, x, motion.omega, loads, whole);
}

LANES_INLINE void FuelSloshModel::couple_in_lanes(const double *x, const Vec3 &rate, Loads &loads, Whole &whole)
{
    // push = m p, turn = m r x p, inertia = m
    x_ = x;
    const Quad3 omega = quads(rate);
    whole.mass += lines_.all.mass;
    symmetric(lines_.all.linear).add_to(whole.linear);
    symmetric(lines_.all.angular).add_to(whole.angular);
    for (int i = 0; i < 3; i++) {
        add_at(whole.cross.m[i], quad_at(lines_.all.cross.m[i]));
    }
    for (std::size_t i = 0; i < n_; i += sim::state_block) {
        const Quad m = quad_at(lines_.mass + i), rho = quad_at(x + i), drho = quad_at(x + rates_ + i);
        const Quad3 p = quads(lines_.axis, i), r = quads(lines_.place, i) + rho * p, turn = quads(lines_.turn, i);
        const Quad3 mr = m * r, round{mr.x * r.x, mr.y * r.y, mr.z * r.z};
        const QuadSymmetric inertia{round.y + round.z, -mr.x * r.y, -mr.x * r.z,
                                    round.x + round.z, -mr.y * r.z, round.x + round.y};
        // d(r.r - r r)/drho omega
        const Quad3 bends = (2.0 * dot(r, p)) * omega - dot(r, omega) * p - dot(p, omega) * r;
        const Quad force = 0.5 * dot(omega, bends) - quad_at(lines_.stiffness + i) * rho -
                           quad_at(lines_.damping + i) * drho; // per mass
        add_at(&whole.mass, sums(Quad{}, mr.x, mr.y, mr.z));
        inertia.sum().add_to(whole.inertia);
        const Quad mdrho = m * drho, mforce = m * force;
        put(whole.drift, quad(whole.drift) + sums(mdrho * p));
        put(whole.force, quad(whole.force) - sums(mforce * p));
        put(whole.torque, quad(whole.torque) - sums(mforce * turn + mdrho * bends));
        put(loads.momentum, quad(loads.momentum) + sums(mdrho * turn));
        force_[i / sim::state_block] = force;
    }
}

void FuelSloshModel::tide(const Mat3 &gradient, const Vec3 &c, Whole &whole)
{
    const auto at = [](const double(&of)[3][SLOSH_MAX], std::size_t i) { return vec3(of[0][i], of[1][i], of[2][i]); };
    for (std::size_t i = 0; i < n_; i++) {
        const Vec3 axis = at(lines_.axis, i), arm = vec_sub(vec_add(at(lines_.place, i), vec_scale(x_[i], axis)), c);
        const double force = vec_dot(axis, mat_vec(gradient, arm)), m = lines_.mass[i]; // per mass
        force_[i / sim::state_block][i % sim::state_block] += force;
        whole.drive(force, vec_scale(m, axis), vec_scale(m, at(lines_.turn, i)));
    }
}

void FuelSloshModel::accelerate(const double *x, const Vec3 &a, const Vec3 &domega, double *dx) const
{
    sim::in_registers<&FuelSloshModel::accelerate_in_lanes>(*this, x, a, domega, dx);
}

LANES_INLINE void FuelSloshModel::accelerate_in_lanes(const double *x, const Vec3 &a, const Vec3 &domega,
                                                      double *dx) const
{
    const Quad3 linear = quads(a), angular = quads(domega);
    for (std::size_t i = 0; i < n_; i += sim::state_block) {
        put_quad(dx + i, quad_at(x + rates_ + i));
        put_quad(dx + rates_ + i, force_[i / sim::state_block] - dot(quads(lines_.axis, i), linear) -
                                      dot(quads(lines_.turn, i), angular));
    }
}

void FuelSloshModel::publish(sim::Ns t, const double *x, const Vec3 &)
{
    SloshState &fuel = interface_.out.fuel;
    for (std::size_t i = 0; i < n_; i++) {
        const Vec3 axis = vec3(lines_.axis[0][i], lines_.axis[1][i], lines_.axis[2][i]);
        fuel.r_B[i] = vec_add(interface_.par.r_B[i], vec_scale(x[i], axis));
        fuel.v_B[i] = vec_scale(x[rates_ + i], axis);
    }
    fuel.head = head_next(fuel.head, t, QUALITY_GOOD);
}

} // namespace fledge::world
