// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/sensors/navigation.h.
#pragma once

#include "sim/model.h"
#include "sim/random.h"
#include "world/sensors/navigation.h"

namespace fledge::world {

class NavigationModel final : public sim::Model {
public:
    explicit NavigationModel(Navigation &interface) : interface_(interface) {}

    void prepare(const sim::Setup &setup) override;
    void reset(sim::Ns t) override;
    void update(Tick tick) override;
    std::span<std::byte> memory() override { return std::as_writable_bytes(std::span(&random_, 1)); }

private:
    Vec3 error(const Vec3 &bias, const Vec3 &deviation);

    Navigation &interface_;
    sim::Random seeded_; ///< the stream as each run begins it
    sim::Random random_;
};

} // namespace fledge::world
