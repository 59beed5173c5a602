// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/avionics/recorder.h.
#pragma once

#include "sim/model.h"
#include "sim/random.h"
#include "world/avionics/recorder.h"

namespace fledge::world {

class RecorderModel final : public sim::Model {
public:
    explicit RecorderModel(Recorder &interface) : interface_(interface) {}

    void prepare(const sim::Setup &setup) override;
    void reset(sim::Ns t) override;
    void reseed() override { state_.random = seeded_; }
    void update(Tick tick) override;
    std::span<std::byte> memory() override { return std::as_writable_bytes(std::span(&state_, 1)); }

private:
    void upset(Tick tick);
    void flip(std::uint32_t page, std::uint32_t bit);
    void write(std::uint32_t words);
    RecorderAnswer read(std::uint32_t page);
    void serve(sim::Ns t);
    bool worn(std::uint32_t page, sim::Ns t) const;

    Recorder &interface_;
    sim::Random seeded_; ///< the stream as each run begins it
    struct State {
        sim::Random random;
        double until; ///< [s] of the next random flip, since the last update
    } state_{};
};

} // namespace fledge::world
