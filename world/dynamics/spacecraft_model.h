// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/dynamics/spacecraft.h: one state vector for the craft and its parts,
// advanced by the process' integrator.
//
//   dr = v                     dv = gravity + force / mass
//   dsigma = 1/4 ((1 - sigma.sigma) omega + 2 sigma x omega + 2 (sigma.omega) sigma)
//   I_B domega = -omega x (I_B omega + sum of parts' momenta) + sum of parts' torques + torque
//
// r and v are those of the centre of mass of all, so that moving parts do not disturb them. With coupled parts, domega
// is the solution of the equations of the whole (world/dynamics/effector.h, docs/dynamics.md).
//
// Attitudes are Modified Rodrigues Parameters; a step that ends with |sigma| > 1 goes over to the
// shadow set.
//
// Example:
//
//     #include "world/dynamics/reaction_wheels_model.h"
//     using namespace world;
//     void spin(Spacecraft &craft, ReactionWheels &wheels)
//     {
//         const auto method = sim::make_rk4();
//         SpacecraftModel model(craft);
//         ReactionWheelsModel turned(wheels);
//         model.attach(turned);
//         turned.prepare({"world.wheels", 1, method.get()});
//         model.prepare({"world.craft", 1, method.get()});
//         model.reset(0);
//         model.update({.t = 500'000'000, .dt = 500'000'000}); // craft.out.state is that of 0.5 s
//     }
#pragma once

#include "sim/model.h"
#include "world/dynamics/effector.h"
#include "world/dynamics/lanes.h"
#include "world/dynamics/rigid_step.h"
#include "world/dynamics/spacecraft.h"
#include "world/eigen.h"
#include "world/environment/attraction.h"
#include "world/environment/sky_user.h"

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace fledge::world {

class ReactionWheelsModel;
class ThrustersModel;
class TorqueRodsModel;

class SpacecraftModel final : private sim::System, public sim::Model, public SkyUser {
public:
    explicit SpacecraftModel(Spacecraft &interface) : interface_(interface) {}

    /// Parts act in the order in which they are attached, and live as long as the spacecraft.
    /// Throws SetupError if one is attached twice.
    void attach(Effector &part);

    /// Throws SetupError on what `checked` refuses, and if a name is listed twice.
    void add_gravity(const GravityBody &body) { attraction_.add(body); }
    const std::vector<GravityBody> &gravity() const { return attraction_.bodies(); }
    /// As Attraction::expect_orbit.
    void expect_orbit(const GravityBody &about) { attraction_.expect_orbit(about, view(interface_.par.r_BN_N)); }

    /// From now on the bodies are where the sky has them.
    void set_sky(std::shared_ptr<const Sky> sky) override { attraction_.set_sky(std::move(sky)); }
    const std::shared_ptr<const Sky> &sky() const override { return attraction_.sky(); }

    /// [N m] The torque of gravity about the centre of mass, B components. Coordinates of parts feel their own, too.
    Vec3 gravity_torque(const Motion &motion, const Loads &loads) const;

    void prepare(const sim::Setup &setup) override;
    void ensure_data_until(sim::Ns until) override { attraction_.ensure_data_until(until); }
    void reset(sim::Ns t) override;

    /// A new inertia takes effect at once; the parts' own parameters say when they do.
    void refresh() override;

    /// Throws RunError if the state is no longer finite, if the craft comes inside a body of its gravity, or if a
    /// force arrives and the mass is 0.
    void update(Tick tick) override;

    /// What changes motion at once, as a collision does. The linear part acts at the centre of mass of all, or at `at`.
    struct Impulse {
        Vec3 dv_N, dv_B;             ///< [m/s] of the centre of mass
        Vec3 momentum_N, momentum_B; ///< [N s]
        Vec3 angular_N, angular_B;   ///< [N m s]
        std::optional<Vec3> at;      ///< [m] relative to B's origin, B components
    };
    /// Let it act on the hub at the time of the last update, and publish the state after it. Parts that move keep their
    /// inertial motion, but for what the hub exerts on them. Throws SetupError if it needs a mass, and there is none.
    void strike(const Impulse &impulse);

    std::vector<sim::Model *> parts() const override;
    std::vector<sim::DifferentialState> differential_states() override;
    void follow(sim::Ns dt) override;
    std::vector<std::string> assumptions() const override { return attraction_.assumptions(); }
    std::span<std::byte> memory() override { return std::as_writable_bytes(std::span(memory_)); }
    void copy_setup(const sim::Model &original,
                    const std::function<sim::Model *(const sim::Model *)> &counterpart) override;

private:
    void derive(sim::Ns start, double tau, const double *x, double *dx) override;
    void normalize(double *x) override;
    [[gnu::noinline]] void normalize_parts(double *x) const;

    /// Position and velocity of C relative to B's origin, N components.
    struct Offset {
        Quad r, v;
    };
    void begin();
    void couple(const double *x, Motion &motion, Loads &loads);
    /// derive() without forces and coupled parts.
    void derive_simple(sim::Ns start, double tau, const double *x, double *dx);
    /// The same with them.
    void derive_pushed(sim::Ns start, double tau, const double *x, double *dx);
    void solve(const double *x, Motion &motion, Loads &loads, double *dx);
    Quad gravity_at(sim::Ns start, double tau, Quad r);
    Offset offset(const Attitude &attitude, Quad omega) const;
    void place_origin(const Attitude &attitude, Motion &motion) const;
    void publish_origin();

    bool latch(Tick tick);
    bool latch_external(Tick tick);
    void advance(Tick tick);
    /// Where a drive's speed would be, or is, at the end of an update.
    struct Governed {
        Effector *effector;
        std::size_t at, i;
        double sign, share, speed, limit;
    };
    template <class Each> void each_drive(double ahead, const Each &each) const;
    [[gnu::noinline]] void govern(sim::Ns t, double dt, bool ahead);
    [[gnu::noinline]] void share_out(sim::Ns t, double dt, bool ahead);
    void begin_stretch(sim::Ns t, sim::Ns &end);
    [[gnu::noinline]] void advance_by_stretches(sim::Ns t, sim::Ns until);
    /// One step of dt by Runge and Kutta, and the derivatives at its end, in registers.
    using Step = void (*)(SpacecraftModel &, sim::Ns dt);
    template <auto loop> static void in_steps(SpacecraftModel &model, sim::Ns dt)
    {
        sim::in_registers<loop>(model, dt);
    }
    void choose_steps();
    Step pushed_step();
    template <class Wheels, bool has_rods>
    LANES_INLINE void step_pushed(Wheels wheels, std::size_t at_wheels, sim::Ns dt);
    template <bool has_rods> void step_pushed_alone(sim::Ns dt);
    template <bool has_rods> void step_pushed_rotors(sim::Ns dt);
    template <bool has_rods> void step_pushed_jitter(sim::Ns dt);
    Step tanked_step();
    template <class Wheels> LANES_INLINE void step_tanked(Wheels wheels, std::size_t at_wheels, sim::Ns dt);
    void step_tanked_alone(sim::Ns dt);
    void step_tanked_rotors(sim::Ns dt);
    template <class Wheels> LANES_INLINE static auto state_at(const double *from, std::size_t at_wheels);
    template <class Wheels>
    LANES_INLINE void end_pushed(const auto &from, const auto &x, const auto &k, std::size_t at_wheels, Quad gravity,
                                 sim::Ns dt);
    Step coupled_step();
    template <class Wheels> LANES_INLINE void step_rigid(sim::Ns dt);
    template <class First, class Second>
    LANES_INLINE void step_coupled(First first, std::size_t at_first, Second second, std::size_t at_second, sim::Ns dt);
    void step_wheels(sim::Ns dt);
    template <std::size_t most> void step_gyros(sim::Ns dt);
    template <std::size_t most> void step_panels(sim::Ns dt);
    template <std::size_t most> void step_panels_and_balanced_wheels(sim::Ns dt);
    bool clear_of_center(double h) const;
    void end_in_registers(Quad from_r, Quad from_v, Quad r, Quad sum, double h);
    void end_step(sim::Ns start, double tau, const double *x);
    void take_inertia();
    void publish(sim::Ns t);
    void put_out(sim::Ns t);
    std::string last_good_state() const;

    // Where the states of the craft itself stand: each vector in a block of its own, so that what one
    // loop stores by blocks the next loads by the same blocks, which the processor forwards at once.
    enum : std::size_t { at_r = 0, at_v = 4, at_sigma = 8, at_omega = 12, own_states = 16 };
    static_assert(own_states % sim::state_block == 0);

    // Where the external inputs stand, and a 1 if they act.
    enum : std::size_t { at_force_N = 0, at_force_B = 4, at_torque_B = 8, at_acts = 12, held_size = 16 };

    struct Part {
        Effector *effector;
        std::size_t at; ///< where its states begin
        bool couples;
    };

    Spacecraft &interface_;
    std::vector<Part> parts_;
    std::vector<Effector *> switching_; ///< those of the parts whose loads jump or bend
    mutable Attraction attraction_;     ///< it remembers where it found the bodies
    double central_mu_ = 0.0;           ///< of the only gravity body, if it is a point at rest in the origin

    std::string name_;
    std::unique_ptr<sim::Integrator> integrator_;
    Mat3 I_B_{};
    Rows I_transposed_{}, I_inverse_{}; ///< the second transposed as well
    Mat3 I_hidden_{};                   ///< what I_B leaves out
    Mat3 I_C_{};                        ///< their sum
    Whole hub_{};                       ///< the hub alone
    Vec3 center_{};                     ///< of the hub
    Whole whole_{};        ///< as the last derive() found it, if some part is coupled; only scratch, as the next two
    Vec3 a_{};             ///< [m/s^2] of B's origin less gravity, B components
    Vec3 gravity_{};       ///< [m/s^2] N components
    bool coupled_ = false; ///< whether some part is
    bool offset_ = false;  ///< whether C may differ from B's origin

    // All that changes during a run: the states (r, v, sigma, omega, then the parts') and what the
    // integrator carries, their derivatives as last published, and what the external inputs gave
    // in the last update (force_N, force_B, torque_B).
    std::vector<double> memory_;
    std::size_t n_ = 0;

    // Of share_out(), which takes nothing from the heap.
    std::vector<Governed> governed_;
    std::vector<double> gains_;     ///< of each speed to each whole torque
    std::vector<double> responses_; ///< of all derivatives to each whole torque
    std::vector<double> shares_;    ///< as they were
    std::vector<double> without_;   ///< the derivatives without one torque
    double *x_ = nullptr, *dx_ = nullptr, *held_ = nullptr;
    bool parts_push_ = false;          ///< whether some part adds forces
    bool free_ = false;                ///< whether some part has degrees of freedom
    std::size_t drives_ = 0;           ///< of its parts, in this update
    unsigned needs_ = 0;               ///< what some part needs of the motion
    bool pushed_ = false;              ///< whether there is a force
    bool simple_ = false;              ///< whether there is none, and no coupled part
    Step step_ = nullptr;              ///< in this update; null: the integrator's
    Step unpushed_step_ = nullptr;     ///< the same while nothing pushes, and `turned_`, if any, has rotors
    Step pushed_step_ = nullptr;       ///< while something does, and `shaking_` has no viscous friction
    const Effector *turned_ = nullptr; ///< the part that must have four rotors for both
    const Rotors *rotors_ = nullptr;   ///< of that part, in this update
    const Part *first_ = nullptr, *second_ = nullptr; ///< those of a coupled step; the wheels of a pushed one
    const ReactionWheelsModel *shaking_ = nullptr;    ///< the same, if they jitter
    const TorqueRodsModel *rods_ = nullptr;           ///< of a pushed step
    const ThrustersModel *tanked_ = nullptr;          ///< of a step with tanks
    static constexpr std::size_t pushing_parts = 6;   ///< at most, in that

    // For the check that the craft stays outside of all bodies.
    double central_surface_ = 0.0, central_arc_ = 0.0; ///< of the only gravity body, as central_mu_
    sim::Ns from_ = 0;                                 ///< when an update began
    Vec3 from_r_{}, from_v_{};                         ///< and where
    bool clear_ = false;                               ///< whether a step in registers needs no further check
    bool begun_ = false;                               ///< whether the attraction knows this
    bool stepped_ = false;                             ///< whether the next derive() is at the end of a step
};

LANES_INLINE Quad SpacecraftModel::gravity_at(sim::Ns start, double tau, Quad r)
{
    if (central_mu_ > 0.0) {
        const double r2 = dot(r, r);
        return -central_mu_ / (r2 * r2) * fm_sqrt(r2) * r;
    }
    return quad(vec(attraction_.at(start, tau, view(vec(r)))));
}

/// Whether the step of h [s] that ended in r is clear of the only body, as clear_of_center() says, and the sum of its
/// states finite; if it is not, keep where it began.
LANES_INLINE void SpacecraftModel::end_in_registers(Quad from_r, Quad from_v, Quad r, Quad sum, double h)
{
    const Quad way = r - from_r, none = sum - sum; // NaN, where a number is not finite
    const Quad length = way < 0.0 ? -way : way;
    const double reach = central_surface_ + 1.5 * (length[0] + length[1] + length[2]) + central_arc_ * (h * h);
    clear_ = central_mu_ > 0.0 && dot(r, r) > reach * reach && (none[0] + none[1]) + (none[2] + none[3]) == 0.0;
    if (!clear_) {
        put(from_r_, from_r);
        put(from_v_, from_v);
    }
}

} // namespace fledge::world
