// SPDX-License-Identifier: Apache-2.0
// What the models of a spacecraft's surroundings (air, magnetic field, sunlight, ground stations) have in common:
// bodies, with or without a sky, and that parts of a spacecraft may ask them.
//
// Without a sky the bodies are where GravityBody says, and the first one turns about its pole at the rate `spin`; its
// prime meridian is the equator's ascending node at time 0. Each model publishes a message in its task. Parts of a
// spacecraft do not read that: they call the model's function at each stage of the integrator.
#pragma once

#include "sim/error.h"
#include "sim/model.h"
#include "world/consumer.h"
#include "world/environment/gravity.h"
#include "world/environment/sky.h"
#include "world/environment/sky_user.h"

#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace fledge::world {

/// An ellipsoid of revolution about the third axis.
struct Ellipsoid {
    double a = 0.0, b = 0.0; ///< [m] equatorial and polar radius

    /// WGS 84 for the Earth. Else the body's radius, with the flattening of the IAU's report of 2000 if that has it.
    static Ellipsoid of(const GravityBody &body);

    struct Height {
        double altitude;     ///< [m]
        double sine, cosine; ///< [-] of the geodetic latitude
    };

    /// Of a point at r_P, the altitude within 1 um down to half the radius.
    Height height(const Eigen::Vector3d &r_P) const;
    double altitude(const Eigen::Vector3d &r_P) const { return height(r_P).altitude; }

    /// [m] of a point at geodetic coordinates [rad, rad, m].
    Eigen::Vector3d point(double latitude, double longitude, double altitude) const;
};

class EnvironmentModel : public sim::Model, public SkyUser {
public:
    void set_sky(std::shared_ptr<const Sky> sky) final { sky_ = std::move(sky); }
    const std::shared_ptr<const Sky> &sky() const final { return sky_; }

    /// The first body is the one that the model is of. Throws SetupError on what `checked` refuses.
    void set_body(const GravityBody &body);
    void add_body(const GravityBody &body);
    const std::vector<GravityBody> &bodies() const { return bodies_; }

    void prepare(const sim::Setup &setup) override;
    void refresh() override;
    void ensure_data_until(sim::Ns until) override;
    void update(Tick tick) override { publish(tick.t); }
    std::vector<std::string> assumptions() const override;
    void copy_setup(const sim::Model &original,
                    const std::function<sim::Model *(const sim::Model *)> &counterpart) override;

    /// Empty before prepare().
    const std::string &name() const { return name_; }

    /// Changes whenever a parameter changes.
    std::uint64_t version() const { return version_; }

protected:
    /// `what`: what the model calls its first body. `turns`: whether the model needs its attitude. `required`: whether
    /// the model needs that body at all.
    EnvironmentModel(const char *what, bool turns, bool required = true)
        : what_(what), turns_(turns), required_(required)
    {
    }

    bool has_body() const { return !bodies_.empty() && bodies_[0].mu != 0.0; } ///< the first one

    virtual void publish(sim::Ns t) = 0;

    /// [rad/s] of the first body, where there is no sky.
    virtual double spin() const { return 0.0; }

    /// [m], [m/s] of a body. Throw RunError where the sky ends.
    Eigen::Vector3d r_PN_N(std::size_t body, sim::Ns start, double tau) const;
    Eigen::Vector3d v_PN_N(std::size_t body, sim::Ns start, double tau) const;

    /// Of the first body.
    const BodyAttitude &attitude(sim::Ns start, double tau) const;

    /// A SetupError with the model's name.
    [[noreturn]] void refuse(const std::string &text) const;

private:
    /// A body in the sky, and where it was found last: methods of integration ask for an instant twice.
    struct Place {
        int target = 0;
        bool moves = false; ///< relative to the origin
        Ephemeris::Cursor cursor;
    };

    void require(const Place &place, sim::Ns from, sim::Ns to) const;

    const char *what_;
    bool turns_, required_;
    std::string name_;
    std::shared_ptr<const Sky> sky_;
    std::vector<GravityBody> bodies_;
    mutable std::vector<Place> places_; // in the same order; none without a sky
    std::optional<Orientation> orientation_;
    Eigen::Matrix3d dcm_QN_ = Eigen::Matrix3d::Identity(); ///< Q: the body's equator, without a sky
    mutable BodyAttitude attitude_{Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero()};
    mutable sim::Ns start_ = 0;
    mutable double tau_ = std::numeric_limits<double>::quiet_NaN();
    mutable double turned_ = std::numeric_limits<double>::quiet_NaN(); ///< [rad] without a sky
    sim::Ns covered_ = 0;
    std::uint64_t version_ = 1;
};

/// The source of a part of a spacecraft: a model of the same process, or what Source::of() makes of it.
template <class Source> class SourceOf final : public Consumer {
public:
    const char *source_kind() const override { return Source::kind; }
    bool set_source(sim::Model &source) override { return set(source); }
    const sim::Model *source() const override { return model_; }

    bool set(const sim::Model &model)
    {
        if constexpr (requires { Source::of(model); }) {
            source_ = Source::of(model);
        } else {
            source_ = std::shared_ptr<const Source>(std::shared_ptr<void>(), dynamic_cast<const Source *>(&model));
        }
        model_ = source_ ? &model : nullptr;
        return model_;
    }
    const Source *operator->() const { return source_.get(); }
    const sim::Model *model() const { return model_; }

    /// `part`: the part's name; `port`: what it calls the source. When all models are prepared.
    void check(const std::string &part, const char *port) const
    {
        const auto process = [](const std::string &name) { return name.substr(0, name.find('.') + 1); };
        if (part.empty()) {
            throw sim::SetupError(std::string("a part of the spacecraft that asks a world.") + Source::kind +
                                  " is itself in no world: w.part = ... makes it known");
        }
        if (!source_ || source_->name().empty() || process(source_->name()) != process(part)) {
            throw sim::SetupError(part + "." + port +
                                  (source_ ? " is a model outside of " : " is missing: a model of ") +
                                  "the same world, as in `w." + port + " = world." + Source::kind + "(...)`");
        }
    }

    /// Whether the source's parameters have changed since the last call.
    bool changed()
    {
        const bool is_new = source_->version() != seen_;
        seen_ = source_->version();
        return is_new;
    }

    void copy(const SourceOf &original, const std::function<sim::Model *(const sim::Model *)> &counterpart)
    {
        if (const sim::Model *model = original.model_ ? counterpart(original.model_) : nullptr) {
            set(*model);
        }
    }

private:
    std::shared_ptr<const Source> source_;
    const sim::Model *model_ = nullptr;
    std::uint64_t seen_ = 0;
};

} // namespace fledge::world
