// SPDX-License-Identifier: Apache-2.0
// What drag and the pressure of sunlight share: an area, or flat facets, on which a model of the environment acts.
#pragma once

#include "world/dynamics/effector.h"
#include "world/environment/environment_model.h"

#include <functional>
#include <string>

namespace fledge::world {

/// Source: of the environment. facets: the most that the interface holds.
template <class Interface, class Source, std::size_t facets> class Surface : public Effector, public Consumer {
public:
    explicit Surface(Interface &interface) : interface_(interface) {}

    const char *source_kind() const override { return Source::kind; }
    bool set_source(sim::Model &source) override { return source_.set(source); }
    const sim::Model *source() const override { return source_.model(); }

    void prepare(const sim::Setup &setup) override
    {
        name_ = setup.name;
        check();
        refresh();
    }
    void refresh() override
    {
        for (std::size_t i = 0; i < interface_.par.n; i++) {
            normals_B_[i] = vec_unit(interface_.par.normals_B[i]);
        }
        changed_ = true;
    }
    std::size_t states() const override { return 0; }
    void start(const Vec3 &, double *) override
    {
        source_.check(name_, port());
        interface_.out = {};
    }
    bool latch(const double *, const BodyRate &, double) override
    {
        const bool changed = source_.changed() || changed_;
        changed_ = false;
        return changed;
    }
    bool pushes() const override { return true; }
    unsigned needs() const override { return needs_place | needs_attitude; }
    void publish(sim::Ns t, const double *, const Vec3 &) override
    {
        ForceTorque &load = interface_.out.load;
        load = {head_next(load.head, t, QUALITY_GOOD), {}, load_.force_B, load_.torque};
    }
    void copy_setup(const sim::Model &original,
                    const std::function<sim::Model *(const sim::Model *)> &counterpart) override
    {
        source_.copy(dynamic_cast<const Surface &>(original).source_, counterpart);
    }

protected:
    virtual const char *port() const = 0; ///< what it calls its source
    virtual void check() const = 0;       ///< throws SetupError where nothing can act on it

    /// Adds what acts without facets, or on each facet i whose normal has a part along a unit vector, its cosine.
    template <class Force>
    void push(const Vec3 &whole_B, const Vec3 &along_B, const Motion &motion, Loads &loads, Force &&force) const
    {
        const auto &par = interface_.par;
        Loads own{};
        if (par.n == 0) {
            own.push(whole_B, vec_sub(par.centre_B, motion.r_CB_B));
        }
        for (std::size_t i = 0; i < par.n; i++) {
            if (const double cosine = vec_dot(normals_B_[i], along_B); cosine > 0.0) {
                own.push(force(i, cosine), vec_sub(par.centres_B[i], motion.r_CB_B));
            }
        }
        loads.force_B = vec_add(loads.force_B, own.force_B);
        loads.torque = vec_add(loads.torque, own.torque);
        load_ = own;
    }

    Interface &interface_;
    std::string name_;
    SourceOf<Source> source_;
    bool changed_ = true;
    Vec3 normals_B_[facets] = {}; ///< unit vectors
    mutable Loads load_{};        ///< of the last derive(), for the output
};

} // namespace fledge::world
