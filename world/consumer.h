// SPDX-License-Identifier: Apache-2.0
// Parts of a spacecraft that call another model at each stage of the integrator.
#pragma once

#include "sim/model.h"

#include <string>
#include <string_view>
#include <vector>

namespace fledge::world {

/// A part of a spacecraft that uses another model, its source: of the environment, or the part on which it is mounted.
class Consumer {
public:
    virtual ~Consumer() = default;
    virtual const char *source_kind() const = 0; ///< the type of that model

    /// What it takes as its source, for messages.
    virtual std::string source_text() const
    {
        return std::string("a model of the world, as in world.") + source_kind() + "(...)";
    }

    /// Use this model. False if it is of another type.
    virtual bool set_source(sim::Model &source) = 0;

    /// The model in use; none before set_source().
    virtual const sim::Model *source() const = 0;

    struct Further {
        std::string_view port; ///< its name in Python
        Consumer *consumer;
    };

    /// What it takes besides: each its own model. Constant.
    virtual std::vector<Further> further() { return {}; }
};

} // namespace fledge::world
