// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/actuators/torque_rods.h.
#pragma once

#include "world/actuators/torque_rods.h"
#include "world/dynamics/lanes.h"
#include "world/eigen.h"
#include "world/environment/magnetism_model.h"
#include "world/faults.h"

#include <string>

namespace fledge::world {

class TorqueRodsModel final : public Effector, public Consumer {
public:
    explicit TorqueRodsModel(TorqueRods &interface) : interface_(interface) {}

    const char *source_kind() const override { return MagnetismModel::kind; }
    bool set_source(sim::Model &source) override { return field_.set(source); }
    const sim::Model *source() const override { return field_.model(); }

    void prepare(const sim::Setup &setup) override;
    void refresh() override;
    void reseed() override { state_.faults.reseed(seeded_); }
    std::span<std::byte> memory() override { return std::as_writable_bytes(std::span(&state_, 1)); }

    std::size_t states() const override { return 0; }
    bool pushes() const override { return true; }
    unsigned needs() const override { return needs_place; }
    bool switches() const override { return true; }
    void start(const Vec3 &omega, double *x) override;
    bool latch(const double *x, const BodyRate &rate, double dt) override;
    bool stretch(sim::Ns t, sim::Ns &end) override;
    void derive(const double *x, const Motion &motion, double *dx, Loads &loads) const override;
    void publish(sim::Ns t, const double *x, const Vec3 &omega) override;

    const Vec3 &dipole_B() const { return state_.dipole_B; } ///< [A m^2]
    /// [T] At r [m] and start + tau [s], N components.
    LANES_INLINE Quad field(sim::Ns start, double tau, Quad r) const
    {
        Vec3 place;
        put(place, r);
        const Eigen::Vector3d B_N = field_->at(start, tau, view(place));
        return Quad{B_N.x(), B_N.y(), B_N.z(), 0.0};
    }
    LANES_INLINE void keep(Quad torque) const { put(torque_, torque); } ///< the last one, for the output
    void copy_setup(const sim::Model &original,
                    const std::function<sim::Model *(const sim::Model *)> &counterpart) override;

private:
    struct State {
        Vec3 dipole_B;
        double requested[RODS_MAX]; ///< in the last update
        std::uint32_t is_new;       ///< 1: an update begins
        std::uint32_t again;        ///< 1: the dipole may change although the commands do not
        std::uint64_t saturated;    ///< 1: a limit reduces a dipole
        Faults<RODS_MAX> faults;
    };

    void apply();
    void turn(double x, double y, double z, const Vec3 &sigma_BN, Loads &loads) const;

    TorqueRods &interface_;
    std::string name_;
    sim::Random seeded_;
    SourceOf<MagnetismModel> field_;
    Vec3 axes_B_[RODS_MAX]{}; ///< of length 1
    State state_{};
    mutable Vec3 torque_{};
};

} // namespace fledge::world
