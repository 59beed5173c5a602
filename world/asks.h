// SPDX-License-Identifier: Apache-2.0
// Parts of a spacecraft that call another model at each stage of the integrator.
#pragma once

#include "sim/model.h"

namespace fledge::world {

/// A part of a spacecraft that asks another model: of the environment, or the part on which it is mounted.
class Asks {
public:
    virtual ~Asks() = default;
    virtual const char *asks() const = 0; ///< the type of that model

    /// Use this model. False if it is of another type.
    virtual bool ask(sim::Model &source) = 0;

    /// The model that it asks; none before ask().
    virtual const sim::Model *asked() const = 0;
};

} // namespace fledge::world
