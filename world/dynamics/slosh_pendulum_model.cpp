// SPDX-License-Identifier: Apache-2.0
#include "world/dynamics/slosh_pendulum_model.h"

namespace fledge::world {

namespace {

constexpr std::size_t block = sim::state_block, rod_block = 2 * block; // the rod's direction, and its rate

Vec3 get(const double *x)
{
    return vec3(x[0], x[1], x[2]);
}

void put(double *x, const Vec3 &a)
{
    x[0] = a.v[0];
    x[1] = a.v[1];
    x[2] = a.v[2];
    x[3] = 0.0;
}

/// Any unit vector perpendicular to the unit vector n.
Vec3 perpendicular(const Vec3 &n)
{
    return vec_unit(vec_cross(n, fm_abs(n.v[0]) < 0.6 ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 1.0, 0.0)));
}

} // namespace

void SloshPendulumModel::prepare(const sim::Setup &)
{
    n_ = interface_.par.n;
}

std::vector<StateName> SloshPendulumModel::names() const
{
    std::vector<StateName> all;
    for (std::size_t i = 0; i < n_; i++) {
        const std::string row = "[" + std::to_string(i) + "]";
        add_names(all, rod_block * i, ("rod_B" + row).c_str(), "-", 3);
        add_names(all, rod_block * i + block, ("drod_B" + row).c_str(), "1/s", 3);
    }
    return all;
}

void SloshPendulumModel::start(const Vec3 &, double *x)
{
    for (std::size_t i = 0; i < n_; i++) {
        const Vec3 rod = vec_unit(interface_.par.rod_B[i]);
        put(x + rod_block * i, rod);
        put(x + rod_block * i + block, vec_cross(interface_.par.spin_B[i], rod));
    }
    interface_.out = {};
}

void SloshPendulumModel::couple(const double *x, const Motion &motion, Loads &, Whole &whole)
{
    const auto &par = interface_.par;
    const Vec3 &omega = motion.omega;
    for (std::size_t i = 0; i < n_; i++) {
        const double m = par.mass[i], l = par.length[i];
        const Vec3 n = get(x + rod_block * i), dn = get(x + rod_block * i + block);
        const Vec3 r = vec_add(par.r_B[i], vec_scale(l, n)), v = vec_scale(l, dn);
        place_[i] = r;
        whole.add(m, r);
        const Vec3 coriolis = vec_scale(2.0 * m, vec_cross(omega, v));
        const Vec3 inward = vec_scale(m * l * vec_norm2(dn), n);
        whole.push_at(inward, r);
        whole.torque = vec_sub(whole.torque, vec_cross(r, coriolis));
        whole.drift = vec_add(whole.drift, vec_scale(m, v));
        const Vec3 centripetal = vec_scale(m, vec_cross(omega, vec_cross(omega, r)));
        const Vec3 force = vec_neg(vec_add(vec_add(coriolis, centripetal), vec_scale(par.damping[i], v)));
        across_[i][0] = perpendicular(n);
        across_[i][1] = vec_cross(n, across_[i][0]);
        for (int k = 0; k < 2; k++) {
            const Vec3 along = vec_scale(m * l, across_[i][k]);
            now_[i][k] = {along, vec_cross(r, along), m * l * l, l * vec_dot(across_[i][k], force)};
            whole.free(now_[i][k]);
        }
    }
}

void SloshPendulumModel::tide(const Mat3 &gradient, const Vec3 &c, Whole &whole)
{
    for (std::size_t i = 0; i < n_; i++) {
        const Vec3 pull = mat_vec(gradient, vec_sub(place_[i], c));
        for (Freedom &q : now_[i]) {
            const double force = vec_dot(q.push, pull);
            q.force += force;
            whole.drive(force / q.inertia, q.push, q.turn);
        }
    }
}

void SloshPendulumModel::accelerate(const double *x, const Vec3 &a, const Vec3 &domega, double *dx) const
{
    for (std::size_t i = 0; i < n_; i++) {
        const Vec3 n = get(x + rod_block * i), dn = get(x + rod_block * i + block);
        Vec3 ddn = vec_scale(-vec_norm2(dn), n);
        for (int k = 0; k < 2; k++) {
            ddn = vec_add(ddn, vec_scale(now_[i][k].acceleration(a, domega), across_[i][k]));
        }
        put(dx + rod_block * i, dn);
        put(dx + rod_block * i + block, ddn);
    }
}

void SloshPendulumModel::normalize(double *x) const
{
    for (std::size_t i = 0; i < n_; i++) {
        const Vec3 n = vec_unit(get(x + rod_block * i)), dn = get(x + rod_block * i + block);
        put(x + rod_block * i, n);
        put(x + rod_block * i + block, vec_sub(dn, vec_scale(vec_dot(dn, n), n)));
    }
}

void SloshPendulumModel::publish(sim::Ns t, const double *x, const Vec3 &)
{
    SloshState &fuel = interface_.out.fuel;
    for (std::size_t i = 0; i < n_; i++) {
        const double l = interface_.par.length[i];
        fuel.r_B[i] = vec_add(interface_.par.r_B[i], vec_scale(l, get(x + rod_block * i)));
        fuel.v_B[i] = vec_scale(l, get(x + rod_block * i + block));
    }
    fuel.head = head_next(fuel.head, t, QUALITY_GOOD);
}

} // namespace fledge::world
