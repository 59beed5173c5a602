// SPDX-License-Identifier: Apache-2.0
// A world model whose behaviour is the script of its instance.
#pragma once

#include "sim/instance.h"
#include "sim/random.h"

namespace fledge::sim {

/// Its state is the `mem` of its interface, and a stream of random numbers.
class ScriptedModel final : public Model {
public:
    explicit ScriptedModel(Instance &instance) : instance_(instance) {}

    void prepare(const Setup &setup) override
    {
        seeded_ = Random(setup.seed, setup.name);
        if (instance_.script.prepare) {
            instance_.script.prepare(instance_);
        }
    }
    void reset(Ns t) override
    {
        random = seeded_;
        clear(instance_);
        if (instance_.script.begin) {
            instance_.script.begin(instance_, {t, 0});
        }
    }
    void refresh() override { version_++; }
    void reseed() override { random = seeded_; }
    void update(Tick tick) override { instance_.script.update(instance_, tick); }
    std::span<std::byte> memory() override { return std::as_writable_bytes(std::span(&random, 1)); }

    const Instance &instance() const { return instance_; }

    /// Changes whenever a parameter changes.
    std::uint64_t version() const { return version_; }

    /// What its script says of a place; see Script.
    bool answers() const { return static_cast<bool>(instance_.script.at_place); }
    void ask(double t, std::span<const double, 3> place, std::span<double> answer) const
    {
        instance_.script.at_place(instance_, t, place, answer);
    }

    Random random;

private:
    Instance &instance_;
    Random seeded_; ///< the stream at the start of each run
    std::uint64_t version_ = 1;
};

} // namespace fledge::sim
