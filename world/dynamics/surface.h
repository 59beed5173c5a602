// SPDX-License-Identifier: Apache-2.0
// What drag and the pressure of sunlight share: an area, or flat facets, on which a model of the environment acts. A
// facet that is mounted on a panel turns and moves with it; what acts on it turns the hinge, too.
#pragma once

#include "world/dynamics/hinged_panels_model.h"
#include "world/environment/environment_model.h"

#include <algorithm>
#include <functional>
#include <string>
#include <vector>

namespace fledge::world {

/// Source: of the environment. facets: the most that the interface holds.
template <class Interface, class Source, std::size_t facets> class Surface : public Effector, public Consumer {
public:
    explicit Surface(Interface &interface) : interface_(interface) {}

    const char *source_kind() const override { return Source::kind; }
    bool set_source(sim::Model &source) override { return source_.set(source); }
    const sim::Model *source() const override { return source_.model(); }
    std::vector<Further> further() override { return {{"panels", &mount_}}; }
    const Effector *carrier() const override { return mounted() ? mount_.panels() : nullptr; }

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
        for (std::size_t i = 0; i < interface_.par.n; i++) {
            HingedPanelsModel::check_mount(mount_.panels(), name_, i, interface_.par.panel[i]);
        }
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
        const auto &other = dynamic_cast<const Surface &>(original);
        source_.copy(other.source_, counterpart);
        if (const sim::Model *carrier = other.mount_.source()) {
            mount_.set_source(*counterpart(carrier));
        }
    }

protected:
    virtual const char *port() const = 0; ///< what it calls its source
    virtual void check() const = 0;       ///< throws SetupError where nothing can act on it

    /// Adds what acts without facets, or on each facet i whose unit normal has a part along a unit vector, its cosine;
    /// with `lee` on all facets.
    template <class Force>
    void push(const Vec3 &whole_B, const Vec3 &along_B, const Motion &motion, Loads &loads, Force &&force,
              bool lee = false) const
    {
        const auto &par = interface_.par;
        Loads own{};
        if (par.n == 0) {
            own.push(whole_B, vec_sub(par.centre_B, motion.r_CB_B));
        }
        for (std::size_t i = 0; i < par.n; i++) {
            if (par.panel[i] > 0) {
                push_panel(i, along_B, motion, loads, own, force, lee);
            } else if (const double cosine = vec_dot(normals_B_[i], along_B); cosine > 0.0 || lee) {
                own.push(force(i, normals_B_[i], cosine), vec_sub(par.centres_B[i], motion.r_CB_B));
            }
        }
        loads.force_B = vec_add(loads.force_B, own.force_B);
        loads.torque = vec_add(loads.torque, own.torque);
        load_ = own;
    }

    /// The same of facet i on its panel.
    template <class Force>
    void push_panel(std::size_t i, const Vec3 &along_B, const Motion &motion, Loads &loads, Loads &own, Force &&force,
                    bool lee) const
    {
        const std::size_t panel = interface_.par.panel[i] - 1;
        const HingedPanelsModel::Hinge hinge = mount_.panels()->hinge(panel);
        const Vec3 normal = hinge.turned(normals_B_[i]);
        if (const double cosine = vec_dot(normal, along_B); cosine > 0.0 || lee) {
            const Vec3 arm = hinge.turned(vec_sub(interface_.par.centres_B[i], hinge.at)), F = force(i, normal, cosine);
            own.push(F, vec_sub(vec_add(hinge.at, arm), motion.r_CB_B));
            mount_.panels()->drive(panel, vec_dot(hinge.axis, vec_cross(arm, F)), *loads.whole);
        }
    }

    bool mounted() const
    {
        const auto &par = interface_.par;
        return std::any_of(par.panel, par.panel + par.n, [](std::uint32_t panel) { return panel > 0; });
    }

    Interface &interface_;
    std::string name_;
    SourceOf<Source> source_;
    PanelMount mount_;
    bool changed_ = true;
    Vec3 normals_B_[facets] = {}; ///< unit vectors
    mutable Loads load_{};        ///< of the last derive(), for the output
};

} // namespace fledge::world
