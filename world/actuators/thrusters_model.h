// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/actuators/thrusters.h.
//
// Between two instants at which a valve moves or a ramp ends, all thrusts and flows are linear in time: a stretch. The
// integrator stops at its end, so no step sees a jump or a bend, and the masses are known in closed form.
//
// With the propellant m_j at r_j, the flow mu_k through the nozzle at r_k, the moment Q = sum mu_k r_k of the flow, and
// the rate D of sum m_j r_j, the momentum of the flow relative to the body is P = D + Q. From the balance of momentum
// and of angular momentum about B's origin, with what leaves at the velocity of its nozzle less F_k / mu_k, and without
// the rates of P and h in the body,
//
//   force  = sum F_k - 2 omega x P
//   torque = sum r_k x F_k - sum mu_k r_k x (omega x r_k) - dI omega - omega x h,
//
// where dI is the rate of the tanks' inertia and h the angular momentum of the flow, that of straight pipes:
// h = sum c_j s_j x Q, with c_j the part of the flow that comes from tank j and s_j where it leaves the propellant
// there: D = -sum c_j s_j sum mu_k.
//
// A nozzle on a panel is at d = r_k - p_k from the hinge's point p_k and moves at the velocity u = dtheta g x d. The
// flow turns with the panel, so that force has -2 mu_k u as well, torque -mu_k (r_k + p_k) x u, and h is
// mu_k (s x p_k + p_k x r_k). On the panel acts  (g x d) . (F_k - mu_k (omega + dtheta g) x d)  about its hinge.
//
// Example:
//
//     #include "world/dynamics/spacecraft_model.h"
//     using namespace world;
//     void mount(Thrusters &thrusters, SpacecraftModel &craft)
//     {
//         static ThrustersModel model(thrusters);
//         craft.attach(model); // it acts within the integrator's steps
//     }
#pragma once

#include "world/actuators/thrusters.h"
#include "world/consumer.h"
#include "world/dynamics/effector.h"
#include "world/dynamics/hinged_panels_model.h"
#include "world/dynamics/lanes.h"
#include "world/faults.h"

#include <algorithm>
#include <string>

namespace fledge::world {

class ThrustersModel final : public Effector, public Consumer {
public:
    explicit ThrustersModel(Thrusters &interface) : interface_(interface) {}

    const char *source_kind() const override { return "HingedPanels"; }
    bool set_source(sim::Model &source) override { return (panels_ = dynamic_cast<HingedPanelsModel *>(&source)); }
    const sim::Model *source() const override { return panels_; }

    void prepare(const sim::Setup &setup) override;
    void refresh() override;
    void reseed() override { state_.faults.reseed(seeded_); }
    std::span<std::byte> memory() override { return std::as_writable_bytes(std::span(&state_, 1)); }

    std::size_t states() const override { return 0; }
    bool pushes() const override { return true; }
    bool couples() const override { return interface_.par.n_tanks > 0 || mounted(); }
    bool is_free() const override { return false; }
    const Ramp *ramp() const override { return couples() ? nullptr : &ramp_; }
    const Effector *carrier() const override { return mounted() ? panels_ : nullptr; }
    bool switches() const override { return true; }
    void start(const Vec3 &omega, double *x) override;
    bool latch(const double *x, const BodyRate &rate, double dt) override;
    bool stretch(sim::Ns t, sim::Ns &end) override;
    void couple(const double *x, const Motion &motion, Loads &loads, Whole &whole) override;
    void derive(const double *x, const Motion &motion, double *dx, Loads &loads) const override;
    void publish(sim::Ns t, const double *x, const Vec3 &omega) override;
    void copy_setup(const sim::Model &original,
                    const std::function<sim::Model *(const sim::Model *)> &counterpart) override;

    /// What the tanks hold at one instant.
    struct Content {
        Quad mass;                       ///< [kg, kg m] with its moment about B's origin
        Quad source;                     ///< [m] where propellant leaves all tanks, on average
        SymmetricQuads inertia, leaving; ///< [kg m^2], [m^2] what takes inertia away per mass that leaves
    };
    /// What the thrusters do at one instant.
    struct Thrust {
        Quad force, torque; ///< [N], [N m] about B's origin
        Quad taken;         ///< [kg m/s] the moment of what leaves the tanks
        double flow;        ///< [kg/s]
    };
    bool has_tanks() const { return interface_.par.n_tanks > 0; }
    bool acts() const { return state_.acts != 0; }
    /// [s] since the stretch began.
    double since(sim::Ns t) const { return tick_seconds(t - state_.begin); }
    /// `tau` [s] after the stretch began.
    LANES_INLINE void hold(double tau, Content &to) const;
    /// On panels too, if they are any.
    template <bool may_ride> LANES_INLINE void thrust(double tau, Quad omega, const Content &from, Thrust &to) const;

private:
    struct Valve {
        sim::Ns on, off; ///< its window in `times`
        sim::Ns late;    ///< by how much that came too late
        sim::Ns opened;  ///< when it opened
        sim::Ns arrives; ///< when its thrust reaches its goal
        double level;    ///< part of the full thrust where the stretch begins
        double slope;    ///< [1/s]
        double goal;     ///< 1 while it is open, else 0
        double impulse;  ///< [N s] until the stretch begins
        std::uint32_t open, is_switched, is_new, spare;
    };
    /// A quantity that is linear in time: its value where the stretch begins, and its rate.
    struct Linear {
        double at, rate;
        double after(double tau) const { return at + tau * rate; }
    };
    /// What is in the tanks that hold balls, per part of the propellant that is left, and what leaves them, per mass.
    /// The inertias of balls that shrink go with part^(2/3) as well.
    struct Round {
        double mass[4];                  ///< [kg, kg m] with its moment about B's origin
        double source[4];                ///< [m] the mean of the points from which propellant flows
        Symmetric inertia, leaving;      ///< [kg m^2, m^2] of points
        double ball[2], ball_leaving[2]; ///< [kg m^2, m^2] of balls of constant radius; of those that shrink
    };
    /// What is in a tank, and what leaves it: it comes from a point, with an inertia about that. Inertias per mass have
    /// one value about `down`, the other one across it.
    struct Fuel {
        double mass, axial, across;
        Vec3 center, source, down;
        double axial_rate, across_rate; ///< [m^2]
    };
    /// What the thrusters on panels add, about B's origin.
    struct Riding {
        Vec3 force, torque;
        Vec3 moment;   ///< [kg m/s] of the flow: sum mu_k r_k
        Vec3 crossing; ///< [kg m/s] sum mu_k p_k
        Vec3 angular;  ///< [N m s]  sum mu_k p_k x r_k
    };
    struct State {
        sim::Ns begin; ///< of the stretch
        sim::Ns dry;   ///< when the tanks are empty, if that ends the step
        sim::Ns next;  ///< when a valve or a fault changes next, which ends the stretch
        Valve valves[THRUSTERS_MAX];
        LinearVector force, torque;    ///< about B's origin
        LinearVector moment;           ///< [kg m/s] of the flow
        Symmetric spread, spread_rate; ///< [kg m^2/s] of the flow: sum mu_k (r_k . r_k - r_k r_k), and its rate
        Linear flow;                   ///< [kg/s]
        double begun;                  ///< the part of the propellant with which the stretch begins
        double per_begun;              ///< 1 over that
        double begun_two_thirds;       ///< that to the power of 2/3
        double used;                   ///< [kg] until the stretch begins
        std::uint32_t acts;            ///< 1: some thruster gives thrust
        std::uint32_t empty;           ///< 1: the tanks are
        std::uint32_t has_power;       ///< 1: the latch valve has
        std::uint32_t is_new;          ///< 1: valves may change although `next` has not come
        Faults<THRUSTERS_MAX> faults;
    };

    bool mounted() const;
    bool begin(sim::Ns t, bool faulty);
    void push(const Motion &motion, Loads &loads) const;
    bool is_on(std::size_t i) const { return state_.valves[i].level != 0.0 || state_.valves[i].slope != 0.0; }
    void fill(double tau, Whole &whole);
    void ride(std::size_t i, double tau, const Vec3 &omega, Whole &whole);
    double burnt(double tau) const { return tau * (state_.flow.at + 0.5 * tau * state_.flow.rate); }
    /// The part of the propellant that is left.
    double left(double tau) const { return std::max(1.0 - (state_.used + burnt(tau)) * per_total_, 0.0); }
    static double power_two_thirds(double x);
    double two_thirds(double part) const;
    double level(const Valve &valve, sim::Ns t) const;
    Fuel settled(std::size_t j, double part) const;
    double per_thrust(std::size_t i) const;
    void move(sim::Ns t);
    bool command(std::size_t i, sim::Ns t, sim::Ns &end);
    void take_loads();

    Thrusters &interface_;
    std::string name_;
    sim::Random seeded_; ///< the stream as each run begins it
    double total_ = 0.0; ///< [kg] propellant at the beginning
    double per_total_ = 0.0;
    bool shrinks_ = false; ///< whether a tank has the shape TANK_SHRINKS
    Round round_{};
    // Of the last couple().
    Content content_{};
    Riding riding_{};
    HingedPanelsModel *panels_ = nullptr;
    State state_{};
    const Ramp ramp_{&state_.force, &state_.torque, &state_.begin, &state_.acts};
};

/// part^(2/3): within a stretch that is a short series about its beginning.
inline double ThrustersModel::two_thirds(double part) const
{
    const double x = part * state_.per_begun - 1.0;
    return fm_abs(x) < 1e-4 ? state_.begun_two_thirds * (1.0 + x * (2.0 / 3.0 + x * (-1.0 / 9.0 + x * (4.0 / 81.0))))
                            : power_two_thirds(part);
}

LANES_INLINE void ThrustersModel::hold(double tau, Content &to) const
{
    const double part = left(tau), shrunk = shrinks_ ? two_thirds(part) : 0.0;
    const auto ball = [&](const double(&sizes)[2]) LANES_LAMBDA {
        const double size = sizes[0] + shrunk * sizes[1];
        return SymmetricQuads{{size, size, size, 0.0}, {}};
    };
    to.mass = part * quad_at(round_.mass);
    to.source = quad_at(round_.source);
    to.inertia = part * (symmetric(round_.inertia) + ball(round_.ball));
    to.leaving = symmetric(round_.leaving) + ball(round_.ball_leaving);
    for (std::size_t j = 0; j < interface_.par.n_tanks; j++) {
        if (interface_.par.shape[j] != TANK_SETTLES) {
            continue;
        }
        const Fuel fuel = settled(j, part);
        const double share = interface_.par.propellant[j] / total_;
        const Quad center = quad(fuel.center), down = quad(fuel.down), from = quad(fuel.source);
        const auto about = [&](double axial, double across, Quad r) LANES_LAMBDA {
            const double round = across + dot(r, r);
            return SymmetricQuads{{round, round, round, 0.0}, {}} + (axial - across) * product(down, down) -
                   product(r, r);
        };
        to.mass += fuel.mass * Quad{1.0, center[0], center[1], center[2]};
        to.inertia = to.inertia + fuel.mass * about(fuel.axial, fuel.across, center);
        to.source += share * from;
        to.leaving = to.leaving + share * about(fuel.axial_rate, fuel.across_rate, from);
    }
}

template <bool may_ride>
LANES_INLINE void ThrustersModel::thrust(double tau, Quad omega, const Content &from, Thrust &to) const
{
    const auto after = [tau](const LinearVector &a) LANES_LAMBDA { return quad(a.at) + tau * quad(a.rate); };
    const bool rides = may_ride && panels_;
    to.force = after(state_.force);
    to.torque = after(state_.torque);
    to.taken = Quad{};
    to.flow = 0.0;
    if (rides) {
        to.force += quad(riding_.force);
        to.torque += quad(riding_.torque);
    }
    if (total_ > 0.0) {
        const Quad source = from.source;
        to.flow = state_.flow.after(tau);
        Quad moment = after(state_.moment), crossing = moment;
        const SymmetricQuads spread = symmetric(state_.spread) + tau * symmetric(state_.spread_rate);
        to.torque += (to.flow * from.leaving - spread).times(omega);
        if (rides) {
            moment += quad(riding_.moment);
            crossing += quad(riding_.crossing);
        }
        to.taken = to.flow * source;
        Quad pipes = cross(source, crossing);
        if (rides) {
            pipes += quad(riding_.angular);
        }
        to.force -= 2.0 * cross(omega, moment - to.taken);
        to.torque -= cross(omega, pipes);
    }
}

} // namespace fledge::world
