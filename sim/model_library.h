// SPDX-License-Identifier: Apache-2.0
// The models of a library of one's own, as the reader writes them into <library>_models.cpp.
#pragma once

#include "sim/model.h"

#include <cstdint>
#include <memory>

namespace fledge::sim {

/// Changes whenever Model, Setup or ModelType does; a library built with another one is refused.
inline constexpr std::uint32_t model_version = 3;

/// What a library exports as `fledge_models_<name>`, beside its tables (sim/table.h).
struct ModelLibrary {
    std::uint32_t version; ///< model_version
    std::uint32_t n;
    const ModelType *types;
};

/// How a model comes into being: its class is constructed from its interface.
template <class Behaviour, class Interface> std::unique_ptr<Model> make_model(void *interface)
{
    return std::make_unique<Behaviour>(*static_cast<Interface *>(interface));
}

} // namespace fledge::sim
