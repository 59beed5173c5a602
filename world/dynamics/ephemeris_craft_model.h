// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/dynamics/ephemeris_craft.h.
#pragma once

#include "sim/model.h"
#include "world/dynamics/ephemeris_craft.h"
#include "world/environment/sky_user.h"

#include <Eigen/Core>

#include <array>
#include <memory>
#include <string>
#include <vector>

namespace fledge::world {

/// What files say of a spacecraft, in N and in times of the run [ns].
struct CraftEphemeris {
    struct Orbit {
        sim::Ns begin, end;
        int degree; ///< of the polynomial
        std::vector<sim::Ns> t;
        std::vector<Eigen::Vector3d> r, v; ///< [m], [m/s]; v empty: unknown
    };
    struct Attitude {
        sim::Ns begin, end;
        std::vector<sim::Ns> t;
        std::vector<Eigen::Vector4d> beta;      ///< of B relative to N, scalar first, each near the last
        std::vector<Eigen::Vector4d> beta_rate; ///< [1/s]; empty: unknown
    };
    std::string orbit_file, attitude_file;
    std::vector<Orbit> orbits;
    std::vector<Attitude> attitudes;
};

class EphemerisCraftModel final : public sim::Model, public SkyUser {
public:
    explicit EphemerisCraftModel(EphemerisCraft &interface) : interface_(interface) {}

    void set_sky(std::shared_ptr<const Sky> sky) override { sky_ = std::move(sky); }
    const std::shared_ptr<const Sky> &sky() const override { return sky_; }
    void set_ephemeris(std::shared_ptr<const CraftEphemeris> ephemeris) { ephemeris_ = std::move(ephemeris); }

    const std::shared_ptr<const CraftEphemeris> &ephemeris() const { return ephemeris_; }

    void prepare(const sim::Setup &setup) override;
    void ensure_data_until(sim::Ns until) override;
    void reset(sim::Ns t) override;
    void update(Tick tick) override { publish(tick.t); }
    void copy_setup(const sim::Model &original,
                    const std::function<sim::Model *(const sim::Model *)> &counterpart) override;

private:
    void publish(sim::Ns t);

    EphemerisCraft &interface_;
    std::shared_ptr<const Sky> sky_;
    std::shared_ptr<const CraftEphemeris> ephemeris_;
    std::string name_;
};

} // namespace fledge::world
