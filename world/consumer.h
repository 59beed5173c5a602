// SPDX-License-Identifier: Apache-2.0
// Parts of a spacecraft that call another model at each stage of the integrator.
#pragma once

#include "sim/model.h"

namespace fledge::world {

/// A part of a spacecraft that uses another model, its source: of the environment, or the part on which it is mounted.
class Consumer {
public:
    virtual ~Consumer() = default;
    virtual const char *source_kind() const = 0; ///< the type of that model

    /// Use this model. False if it is of another type.
    virtual bool set_source(sim::Model &source) = 0;

    /// The model in use; none before set_source().
    virtual const sim::Model *source() const = 0;
};

} // namespace fledge::world
