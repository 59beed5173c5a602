// SPDX-License-Identifier: Apache-2.0
// A model: a piece of the simulated world. Its interface (inputs, outputs, parameters) is a C struct
// that introspect reads; its behaviour is a class derived from Model.
#pragma once

#include "flight/msg/head.h"
#include "sim/integrator.h"
#include "sim/table.h"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace fledge::sim {

/// What a model needs before a run.
struct Setup {
    std::string name;                 ///< process and instance, as in "world.craft"
    std::uint64_t seed = 0;           ///< of the run; see Random
    const Integrator *integrator;     ///< the process' method: take a fresh() one
    std::vector<std::string> wired{}; ///< its inputs that an output or the caller feeds
};

class Model;

/// A state of the differential equations of a model, for readers from outside.
struct DifferentialState {
    const Model *of;  ///< whose it is: the model's or one of its parts'
    std::string name; ///< "omega_BN_B[1]"
    std::string unit; ///< "-" if it has none
    double *value;    ///< in memory()
    double *rate;     ///< its derivative as last computed, in memory()
};

class Model {
public:
    virtual ~Model() = default;

    /// Check the parameters and the parts, and allocate all memory that the run needs.
    /// Throws SetupError that begins with setup.name.
    virtual void prepare(const Setup &setup) = 0;

    /// Parameters were changed, between two runs, where the kernel has checked them, or by an event within one:
    /// compute again what depends on them. The state stays as it is.
    virtual void refresh() {}

    /// A run up to the time `until` is about to begin. Throws SetupError if the data of the model (an
    /// ephemeris, say) do not reach that far. The text begins with setup.name.
    virtual void ensure_data_until(Ns until) { (void)until; }

    /// Take the initial state from the parameters and publish it for time t. Resets the parts too.
    virtual void reset(Ns t) = 0;

    /// Advance to tick.t with the inputs held since tick.t - tick.dt, and publish.
    /// tick.dt is 0 at the first update after a reset.
    virtual void update(Tick tick) = 0;

    /// Begin the random streams as reset() does, by the seed of prepare(). The rest of the state stays as it is.
    virtual void reseed() {}

    /// The models that this one advances itself. They are in no task; the kernel carries their inputs before it
    /// updates this one.
    virtual std::vector<Model *> parts() const { return {}; }

    /// What kind of model has this one among its parts(), for messages; null if it belongs into a task.
    virtual const char *part_of() const { return nullptr; }

    /// The states that it integrates, its own and those of its parts. May be called after prepare().
    virtual std::vector<DifferentialState> differential_states() { return {}; }

    /// The states or the inputs were changed from outside: compute the derivatives at the time of the last update, and
    /// publish. If dt > 0, read the inputs as an update over dt [ns] from now would; if 0, as the last update did.
    virtual void follow(Ns dt) { (void)dt; }

    /// All that changes during a run besides the interface: a snapshot is a copy of these bytes.
    virtual std::span<std::byte> memory() { return {}; }

    /// The bytes of memory() are about to be copied, or were written by a snapshot: for a model whose state is
    /// elsewhere. Throws SetupError if it cannot.
    virtual void save() {}
    virtual bool saves() const { return true; } ///< whether it can
    virtual void restored() {}

    /// The assumptions that the model makes about the data that it was given, a line each. May be called
    /// before prepare().
    virtual std::vector<std::string> assumptions() const { return {}; }

    /// Copy the set-up that is neither in the interface nor in memory (parts, gravity bodies). `counterpart` maps a
    /// model of the original simulation to the model of the clone.
    virtual void copy_setup(const Model &original, const std::function<Model *(const Model *)> &counterpart)
    {
        (void)original;
        (void)counterpart;
    }
};

/// A type of model. Each library has a table of these.
struct ModelType {
    const FledgeStruct *interface;
    std::unique_ptr<Model> (*create)(void *interface); ///< a model with this memory as its interface
};

} // namespace fledge::sim
