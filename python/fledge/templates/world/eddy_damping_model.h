// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/eddy_damping.h.
#pragma once

#include "sim/model.h"
#include "sim/random.h"
#include "world/eddy_damping.h"

namespace my_sat {

class EddyDampingModel final : public fledge::sim::Model {
public:
    explicit EddyDampingModel(EddyDamping &interface) : interface_(interface) {}

    void prepare(const fledge::sim::Setup &setup) override;
    void reset(fledge::sim::Ns t) override;
    void update(Tick tick) override;
    void reseed() override { random_ = seeded_; }

    /// All state of a run besides the interface: snapshots and clones copy it.
    std::span<std::byte> memory() override { return std::as_writable_bytes(std::span(&random_, 1)); }

private:
    EddyDamping &interface_;
    fledge::sim::Random seeded_; ///< the stream at the start of each run
    fledge::sim::Random random_;
};

} // namespace my_sat
