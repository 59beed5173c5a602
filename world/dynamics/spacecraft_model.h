// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/dynamics/spacecraft.h: one state vector for the craft and its parts,
// advanced by the process' integrator.
//
//   dr = v                     dv = gravity + force / mass
//   dsigma = 1/4 ((1 - sigma.sigma) omega + 2 sigma x omega + 2 (sigma.omega) sigma)
//   I_B domega = -omega x (I_B omega + sum of parts' momenta) + sum of parts' torques + torque
//
// Attitudes are Modified Rodrigues Parameters; a step that ends with |sigma| > 1 goes over to the
// shadow set.
#pragma once

#include "sim/model.h"
#include "world/dynamics/effector.h"
#include "world/dynamics/spacecraft.h"
#include "world/environment/attraction.h"

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace fledge::world {

class SpacecraftModel final : private sim::System, public sim::Model {
public:
    explicit SpacecraftModel(Spacecraft &interface) : interface_(interface) {}

    /// Parts act in the order in which they are attached, and live as long as the spacecraft.
    /// Throws SetupError if one is attached twice.
    void attach(Effector &part);

    /// Throws SetupError on what `checked` refuses, and if a name is listed twice.
    void add_gravity(const GravityBody &body) { attraction_.add(body); }
    const std::vector<GravityBody> &gravity() const { return attraction_.bodies(); }

    /// From now on the bodies are where the sky has them.
    void set_sky(std::shared_ptr<const Sky> sky) { attraction_.set_sky(std::move(sky)); }
    const std::shared_ptr<const Sky> &sky() const { return attraction_.sky(); }

    void prepare(const sim::Setup &setup) override;
    void ensure_data_until(sim::Ns until) override { attraction_.ensure_data_until(until); }
    void reset(sim::Ns t) override;

    /// A new inertia takes effect at once; the parts' own parameters say when they do.
    void refresh() override;

    /// Throws RunError if the state is no longer finite, if the craft comes inside a body of its gravity, or if a
    /// force arrives and the mass is 0.
    void update(Tick tick) override;

    std::vector<sim::Model *> parts() const override;
    std::vector<std::string> assumptions() const override { return attraction_.assumptions(); }
    std::span<std::byte> memory() override { return std::as_writable_bytes(std::span(memory_)); }
    void copy_setup(const sim::Model &original,
                    const std::function<sim::Model *(const sim::Model *)> &counterpart) override;

private:
    void derive(sim::Ns start, double tau, const double *x, double *dx) override;
    void normalize(double *x) override;

    bool latch(Tick tick);
    bool latch_external(Tick tick);
    void advance(Tick tick);
    bool clear_of_center(double h) const;
    void end_step(sim::Ns start, double tau, const double *x);
    void take_inertia();
    void publish(sim::Ns t);
    std::string last_good_state() const;

    struct Part {
        Effector *effector;
        std::size_t at; ///< where its states begin
    };

    Spacecraft &interface_;
    std::vector<Part> parts_;
    Attraction attraction_;
    double central_mu_ = 0.0; ///< of the only gravity body, if it is a point at rest in the origin

    std::string name_;
    std::unique_ptr<sim::Integrator> integrator_;
    Mat3 I_B_{}, I_B_inverse_{};

    // All that changes during a run: the states (r, v, sigma, omega, then the parts') and what the
    // integrator carries, their derivatives as last published, and what the external inputs gave
    // in the last update (force_N, force_B, torque_B).
    std::vector<double> memory_;
    std::size_t n_ = 0;
    double *x_ = nullptr, *dx_ = nullptr, *held_ = nullptr;
    bool pushed_ = false; ///< whether there is a force

    // For the check that the craft stays outside of all bodies.
    double central_surface_ = 0.0, central_arc_ = 0.0; ///< of the only gravity body, as central_mu_
    sim::Ns from_ = 0;                                 ///< when an update began
    Vec3 from_r_{}, from_v_{};                         ///< and where
    bool begun_ = false;                               ///< whether the attraction knows this
    bool stepped_ = false;                             ///< whether the next derive() is at the end of a step
};

} // namespace fledge::world
