// SPDX-License-Identifier: Apache-2.0
// The parameters of an instance, which may change between runs and by commands. Private to the kernel.
#pragma once

#include "sim/instance.h"

#include <span>
#include <vector>

namespace fledge::sim {

struct RunProcess;

/// In its memory, and as the run saw them last.
struct Parameters {
    Instance *instance;
    RunProcess *process;
    std::span<std::byte> now;
    std::vector<std::byte> seen;

    Parameters(Instance &of, RunProcess &process);

    bool changed() const;
    void see();
    std::vector<const FledgeField *> differing() const;
    void refresh() const; ///< where they changed, a model computes again what it derives from them
};

} // namespace fledge::sim
