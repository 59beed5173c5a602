// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/environment/magnetism.h.
//
// A dipole m (times mu0 / 4 pi): B = (3 (m . u) u - m) / r^3, u = r / r.
#pragma once

#include "world/environment/environment_model.h"
#include "world/environment/field_cubes.h"
#include "world/environment/magnetic_coefficients.h"
#include "world/environment/magnetism.h"

#include <limits>
#include <optional>

namespace fledge::world {

class MagnetismModel final : public EnvironmentModel {
public:
    static constexpr const char *kind = "Magnetism";

    explicit MagnetismModel(Magnetism &interface) : EnvironmentModel("body", true), interface_(interface) {}

    /// The file is read by prepare().
    void set_coefficients(const std::string &path) { path_ = path; }
    const std::string &coefficients() const { return path_; }

    /// [T] at r_BN_N [m] and start + tau [s], N components. Throws RunError in the centre of the body.
    Eigen::Vector3d at(sim::Ns start, double tau, const Eigen::Vector3d &r_BN_N) const;

    void prepare(const sim::Setup &setup) override;
    void refresh() override;
    void ensure_data_until(sim::Ns until) override;
    void reset(sim::Ns) override { interface_.out = {}; }
    void copy_setup(const sim::Model &original,
                    const std::function<sim::Model *(const sim::Model *)> &counterpart) override;

private:
    double spin() const override { return interface_.par.spin; }
    void publish(sim::Ns t) override;
    const Eigen::Matrix3d &dcm_PN(sim::Ns start, double tau) const;
    double year(sim::Ns t) const;
    void require_year(sim::Ns t, const char *what) const;

    Magnetism &interface_;
    std::string path_;
    std::optional<MagneticCoefficients> model_;
    double year_ = 0.0; ///< at time 0
    sim::Ns held_ = 0;  ///< as long as coefficients stay as they are
    mutable FieldCubes cubes_;
    mutable Eigen::Matrix3d turned_PN_;
    mutable sim::Ns turned_start_ = 0; ///< at which turned_PN_ is
    mutable double turned_tau_ = std::numeric_limits<double>::quiet_NaN();
};

} // namespace fledge::world
