// SPDX-License-Identifier: Apache-2.0
// A part of a spacecraft that exchanges momentum with it and may have states of its own. There are two kinds.
//
// An ordinary part has states whose derivatives need the body's angular rate, not its acceleration (for a balanced
// wheel: its inertial angular momentum, not its speed). It adds loads to the equation of the body, whose inertia is
// constant:
//
//   I_B domega = -omega x (I_B omega + momentum) + torque
//
// That needs one virtual call per part and stage of the integrator. In the same call, a part takes from its own
// momentum what it gives to the body, so only rounding changes the sum.
//
// A coupled part moves mass relative to the body, or changes it (panels, sloshing fuel, tanks, imbalanced wheels). It
// adds what it carries and its degrees of freedom to the equations of the whole; the craft solves them for the
// accelerations of the body, and the part computes its own from these. A degree of freedom q costs a product of six
// numbers with themselves. docs/dynamics.md derives it. A craft without coupled parts pays nothing for this.
#pragma once

#include "flight/math/vec.h"
#include "sim/model.h"

#include <algorithm>
#include <cstddef>

namespace fledge::world {

struct Whole;

/// What acts on the body; each part adds its own.
struct Loads {
    Vec3 momentum; ///< [N m s] angular momentum that is not in I_B omega, B components
    Vec3 torque;   ///< [N m]   on the body about the centre of mass C, B components
    Vec3 force_N;  ///< [N]     at C, N components; of parts that push
    Vec3 force_B;  ///< [N]     at C, B components; of parts that push
    // Of parts that change masses, which need a coupled part on the same craft: the tank.
    double mass_rate; ///< [kg/s]   of the whole; < 0 while mass leaves
    Vec3 moment_rate; ///< [kg m/s] of mass x position, from masses that change, each where it is; B components
    Whole *whole;     ///<          after couple(), for forces on the coordinates of coupled parts

    /// A force that acts at a point: `arm` is its position relative to C (its place in B less Motion::r_CB_B).
    void push(const Vec3 &force, const Vec3 &arm)
    {
        force_B = vec_add(force_B, force);
        torque = vec_add(torque, vec_cross(arm, force));
    }
};

/// The motion of the craft at one instant. B is the frame and the origin of the body, C the centre of mass of all.
/// Where no part pushes and none is coupled, only start, tau and omega are set.
struct Motion {
    sim::Ns start; ///< [ns]    when the step began
    double tau;    ///< [s]     since then
    Vec3 r_BN_N; ///< [m]     of B's origin, which is C unless the craft has an offset or coupled parts; only if a part
                 ///<         needs it
    Vec3 v_BN_N; ///< [m/s]   the same
    Vec3 sigma_BN; ///< [-]
    Vec3 omega;    ///< [rad/s] of B relative to N, B components
    Mat3 C_BN;     ///< only if a part needs it
    double mass;   ///< [kg]    of all
    Vec3 r_CB_B;   ///< [m]     the centre of mass relative to B's origin, B components
    Mat3 I_C_B;    ///< [kg m^2] of all about C, B components, wheels included; only if a part needs it
};

/// A degree of freedom of a coupled part, the coordinate q: how it moves mass with the body at rest, and what acts on
/// it. Its equation is  push . a + turn . domega + inertia ddq = force.  B components.
struct Freedom {
    Vec3 push;      ///< the derivative of the linear momentum by dq:  sum dm (dr/dq)
    Vec3 turn;      ///< of the angular momentum about B's origin:     sum dm r x (dr/dq)
    double inertia; ///< sum dm |dr/dq|^2, > 0
    double force;   ///< on q, with the terms of omega and dq, without those of the accelerations

    /// ddq, once the body's accelerations are known (Effector::accelerate).
    double acceleration(const Vec3 &a, const Vec3 &domega) const
    {
        return (force - vec_dot(push, a) - vec_dot(turn, domega)) / inertia;
    }
};

/// A matrix whose rows fill registers of four; the fourth elements are 0.
struct alignas(32) Rows {
    double m[3][4];
};

/// A symmetric matrix; the fourth elements are 0.
struct Symmetric {
    double along[4];  ///< xx, yy, zz
    double across[4]; ///< yz, zx, xy

    /// k a a
    void add(double k, const Vec3 &a)
    {
        for (int i = 0; i < 3; i++) {
            along[i] += k * a.v[i] * a.v[i];
            across[i] += k * a.v[(i + 1) % 3] * a.v[(i + 2) % 3];
        }
    }

    /// k (r.r - r r)
    void add_spread(double k, const Vec3 &r)
    {
        add(-k, r);
        for (int i = 0; i < 3; i++) {
            along[i] += k * vec_norm2(r);
        }
    }

    void add(const Mat3 &a)
    {
        for (int i = 0; i < 3; i++) {
            const int j = (i + 1) % 3, k = (i + 2) % 3;
            along[i] += a.m[i][i];
            across[i] += 0.5 * (a.m[j][k] + a.m[k][j]);
        }
    }

    Mat3 matrix() const
    {
        return {{{along[0], across[2], across[1]}, {across[2], along[1], across[0]}, {across[1], across[0], along[2]}}};
    }
};

/// The equations of the whole craft about B's origin, to which the coupled parts add. B components.
///
///   [ mass     -[moment]x ] [ a      ]   [ force  ]
///   [ [moment]x  inertia  ] [ domega ] = [ torque ]   less what the degrees of freedom take,
///
/// where a is the acceleration of B's origin less gravity. The craft itself adds omega x (omega x moment + 2 drift) and
/// omega x (inertia omega + momentum); the parts the other terms with the rates of their coordinates.
struct alignas(32) Whole {
    double mass;               ///< [kg]
    Vec3 moment;               ///< [kg m]   sum dm r
    Symmetric inertia;         ///< [kg m^2] sum dm (r.r - r r), with what I_B leaves out of it left out
    Symmetric linear, angular; ///< what the degrees of freedom take from the three blocks of the matrix
    Rows cross;
    Vec3 drift;  ///< [kg m/s] the rate of `moment` as B sees it, from masses that move (sum of dq Freedom::push)
    Vec3 force;  ///< [N]      what moving masses exert on the body, less the terms of all accelerations
    Vec3 torque; ///< [N m]    and its torque about B's origin

    /// A rigid mass with its centre at r and an inertia about that centre.
    void add(double m, const Vec3 &r, const Mat3 &about_center);
    void add(double m, const Vec3 &r);

    /// What a moving mass exerts at the point r, less the terms of all accelerations. Other forces belong to the Loads.
    void push_at(const Vec3 &f, const Vec3 &r)
    {
        force = vec_add(force, f);
        torque = vec_add(torque, vec_cross(r, f));
    }

    /// A degree of freedom.
    void free(const Freedom &q);

    /// A further force on a degree of freedom, per its inertia.
    void drive(double acceleration, const Vec3 &its_push, const Vec3 &its_turn)
    {
        force = vec_sub(force, vec_scale(acceleration, its_push));
        torque = vec_sub(torque, vec_scale(acceleration, its_turn));
    }
};

/// The rotation of the body. B components.
struct BodyRate {
    Vec3 omega;  ///< [rad/s]
    Vec3 domega; ///< [rad/s^2] as last published
};

/// What a state of a part is, for readers from outside.
struct StateName {
    std::size_t at;   ///< its place among the states
    std::string name; ///< "theta[1]"
    const char *unit; ///< "-" if it has none
};

/// Names of n elements of an array that begins at a place.
inline void add_names(std::vector<StateName> &names, std::size_t at, const char *array, const char *unit, std::size_t n)
{
    for (std::size_t i = 0; i < n; i++) {
        names.push_back({at + i, std::string(array) + "[" + std::to_string(i) + "]", unit});
    }
}

/// Balanced wheels whose torques are constant over a step: derive() adds the momenta x times axis and the reaction, and
/// dx is the torque.
struct Rotors {
    std::size_t n;           ///< a multiple of state_block
    const double (*axis)[4]; ///< unit vectors, B components
    const double *torque;    ///< [N m] on each wheel
    const Vec3 *reaction;    ///< [N m] on the body, B components
};

/// A vector that is linear in time: its value where a stretch begins, and its rate. B components.
struct LinearVector {
    Vec3 at, rate;
    Vec3 after(double tau) const { return vec_add(at, vec_scale(tau, rate)); }
    void add(double level, double slope, const Vec3 &a)
    {
        at = vec_add(at, vec_scale(level, a));
        rate = vec_add(rate, vec_scale(slope, a));
    }
};

/// A motor that turns a wheel or a gimbal. At the limit of the speed it stops driving; it never brakes by itself.
struct Drive {
    double torque; ///< [N m]   in this update, but for the limit
    double share;  ///< [-]     of it that the motor gives, in [0, 1]
    double speed;  ///< [rad/s] relative to what carries it
    double limit;  ///< [rad/s] 0: none
};

/// A force that is linear in time: derive() adds it, and its torque about B's origin, while it acts.
struct Ramp {
    const LinearVector *force, *torque; ///< [N], [N m]
    const sim::Ns *begin;               ///< of the stretch
    const std::uint32_t *acts;          ///< 0: no
};

/// All that latch() computes and derive() uses belongs to memory(): where latch() finds no change after a snapshot was
/// restored, the spacecraft uses the derivatives that it computed before the snapshot.
class Effector : public sim::Model {
public:
    /// The number of its states, a multiple of state_block. It is constant, and valid before prepare().
    virtual std::size_t states() const = 0;

    /// What the states are; those that only pad have no name.
    virtual std::vector<StateName> names() const
    {
        std::vector<StateName> all;
        add_names(all, 0, "x", "", states());
        return all;
    }

    /// Forget the run, and write the initial states.
    virtual void start(const Vec3 &omega, double *x) = 0;

    /// Read the inputs, which are constant for the next dt [s]. If dt is 0, they do not act.
    /// Returns whether the results of derive() change.
    virtual bool latch(const double *x, const BodyRate &rate, double dt) = 0;

    /// Write the states' derivatives and add the loads. The coupled parts have had their couple() by then.
    virtual void derive(const double *x, const Motion &motion, double *dx, Loads &loads) const
    {
        (void)x, (void)motion, (void)dx, (void)loads;
    }

    /// All that derive() does until the next latch(), if it is no more than this; else null.
    virtual const Rotors *rotors() const { return nullptr; }

    /// All that derive() does until the next stretch(), if it is no more than this; else null. Whether it is null is
    /// constant, and valid before prepare().
    virtual const Ramp *ramp() const { return nullptr; }

    /// Whether it adds forces, which need the craft's mass, or uses more than start, tau and omega of the Motion. It
    /// is constant.
    virtual bool pushes() const { return false; }

    /// What it uses of the Motion, besides: the inertia I_C_B, the place and velocity of B's origin, or C_BN. Such a
    /// part pushes. It is constant.
    enum Needs : unsigned { needs_nothing = 0, needs_inertia = 1, needs_place = 2, needs_attitude = 4 };
    virtual unsigned needs() const { return needs_nothing; }

    /// Add to `inertia` [kg m^2] what I_B leaves out but the craft has (a wheel's about its axis).
    virtual void add_hidden_inertia(Mat3 &inertia) const { (void)inertia; }

    /// Whether it is coupled. It is constant, and valid before prepare(). Then the craft calls couple() before all
    /// derive() and accelerate() after them, and needs its mass. The part's states belong to accelerate().
    virtual bool couples() const { return false; }

    /// Whether a coupled part has degrees of freedom (Whole::free). It is constant, and valid before prepare().
    virtual bool is_free() const { return couples(); }

    /// Add the masses that it carries, its degrees of freedom and its loads; all terms but those of the accelerations,
    /// and of omega alone. Of the motion only start, tau, sigma_BN and omega are known. What it computes here it
    /// may keep for accelerate(), which follows at the same x.
    virtual void couple(const double *x, const Motion &motion, Loads &loads, Whole &whole)
    {
        (void)x, (void)motion, (void)loads, (void)whole;
    }

    /// Add what a gradient of gravity [1/s^2] does along its coordinates: a mass at r feels gradient (r - c) more, B
    /// components. The gradient is symmetric, without trace. After couple(), at the same x.
    virtual void tide(const Mat3 &gradient, const Vec3 &c, Whole &whole) { (void)gradient, (void)c, (void)whole; }

    /// Write the derivatives of its states from the body's accelerations: a [m/s^2] of B's origin less gravity, and
    /// domega [rad/s^2], B components.
    virtual void accelerate(const double *x, const Vec3 &a, const Vec3 &domega, double *dx) const
    {
        (void)x, (void)a, (void)domega, (void)dx;
    }

    /// The part on which it is mounted, or null. It is constant, and valid before prepare(). The craft calls couple()
    /// of the carrier first.
    virtual const Effector *carrier() const { return nullptr; }

    /// At the end of a step: bring states to their usual range (an angle within a turn). Only of coupled parts.
    virtual void normalize(double *x) const { (void)x; }

    /// The number of its motors that the craft keeps within the limits of their speeds in this update. latch() lets
    /// each give all of its torque.
    std::size_t drives() const { return drives_; }

    /// The largest number that drives() returns. It is constant, and valid before prepare() of the craft.
    virtual std::size_t most_drives() const { return 0; }

    virtual Drive drive_at(std::size_t i, const double *x, const Vec3 &omega) const
    {
        (void)i, (void)x, (void)omega;
        return {};
    }

    /// [rad/s^2] The derivative of a drive's speed, which is linear in dx and domega but for a constant.
    virtual double drive_rate(std::size_t i, const double *x, const double *dx, const BodyRate &rate) const
    {
        (void)i, (void)x, (void)dx, (void)rate;
        return 0.0;
    }

    /// From now on a drive gives this share of its torque; derive() is linear in it. When
    /// an update has ended, the craft says by it which share the drive gave.
    virtual void give(std::size_t i, double share) { (void)i, (void)share; }

    /// Whether its loads jump or bend at times of its own, as those of valves. It is constant, and valid before
    /// prepare().
    virtual bool switches() const { return false; }

    /// A step begins at t: choose what acts until `end` [ns], and bring that forward to the first instant after t at
    /// which it changes. There a step ends, and the next one begins with a call. Returns whether the results of
    /// derive() change at t.
    virtual bool stretch(sim::Ns t, sim::Ns &end)
    {
        (void)t, (void)end;
        return false;
    }

    /// Write the outputs for time t.
    virtual void publish(sim::Ns t, const double *x, const Vec3 &omega) = 0;

    /// Called once, when it becomes a part of this spacecraft, by which it may ask that in derive().
    virtual void join(const sim::Model &spacecraft) { (void)spacecraft; }

    /// Make it a part of this spacecraft. False if it is a part of another one.
    bool claim(const sim::Model &spacecraft)
    {
        if (!host_) {
            host_ = &spacecraft;
            join(spacecraft);
        }
        return host_ == &spacecraft;
    }

    const char *part_of() const final { return "spacecraft"; }

    // The spacecraft resets and updates its parts by the functions above.
    void reset(sim::Ns) final {}
    void update(Tick) final {}

protected:
    /// Whether a limit of speed takes from a torque. A share that is 1 but for rounding takes nothing.
    bool shares_less(const double *share) const
    {
        return std::any_of(share, share + drives_, [](double each) { return each < 1.0 - 1e-9; });
    }

    std::size_t drives_ = 0; ///< by latch()

private:
    const sim::Model *host_ = nullptr;
};

inline void Whole::add(double m, const Vec3 &r)
{
    mass += m;
    moment = vec_add(moment, vec_scale(m, r));
    inertia.add_spread(m, r);
}

inline void Whole::add(double m, const Vec3 &r, const Mat3 &about_center)
{
    add(m, r);
    inertia.add(about_center);
}

inline void Whole::free(const Freedom &q)
{
    const double per = 1.0 / q.inertia;
    const Vec3 push = vec_scale(per, q.push);
    linear.add(per, q.push);
    angular.add(per, q.turn);
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            cross.m[i][j] += push.v[i] * q.turn.v[j];
        }
    }
    force = vec_sub(force, vec_scale(q.force, push));
    torque = vec_sub(torque, vec_scale(q.force * per, q.turn));
}

} // namespace fledge::world
