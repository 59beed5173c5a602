// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/avionics/radio.h.
#pragma once

#include "sim/carrier.h"
#include "sim/random.h"
#include "world/avionics/radio.h"
#include "world/environment/ground_station_model.h"

namespace fledge::world {

class RadioModel final : public EnvironmentModel, public Consumer, public sim::Carrier {
public:
    explicit RadioModel(Radio &interface) : EnvironmentModel("sun", false, false), interface_(interface) {}

    const char *source_kind() const override { return GroundStationModel::kind; }
    bool set_source(sim::Model &source) override { return station_.set(source); }
    const sim::Model *source() const override { return station_.model(); }

    void set_serves(std::string process) { serves_ = std::move(process); }
    const std::string &serves() const override { return serves_; }

    void prepare(const sim::Setup &setup) override;
    void refresh() override;
    void reset(sim::Ns t) override;
    void update(Tick tick) override;
    void reseed() override;
    std::span<std::byte> memory() override { return std::as_writable_bytes(std::span(memory_)); }
    void copy_setup(const sim::Model &original,
                    const std::function<sim::Model *(const sim::Model *)> &counterpart) override;

    void send_down(sim::Ns t, sim::Unit unit) override { send(state().down, interface_.par.down_rate, t, unit); }
    void send_up(sim::Ns t, sim::Unit unit) override { send(state().up, interface_.par.up_rate, t, unit); }
    double down_rate() const override { return interface_.par.down_rate; }
    double up_rate() const override { return interface_.par.up_rate; }
    sim::Ns next_up() const override { return next(state().up); }
    void receive(sim::Ns t, const std::function<void(sim::Unit)> &unit) override;
    std::vector<sim::Packet> take(sim::Ns t) override;

private:
    /// A unit on its way; its bytes follow, to a multiple of 8.
    struct Sent {
        sim::Ns begins, ends; ///< the transmitter
        sim::Ns arrives;      ///< its last bit, once that is known
        std::uint32_t n;
        enum Fate : std::uint32_t { whole, damaged, lost } fate;
    };

    /// One direction. The units lie in [begin, end) of a room of bytes; the fate of those before `open` is known.
    struct Way {
        std::uint64_t place, room; ///< of its bytes, in bytes from the beginning of the memory
        std::uint64_t begin, open, end;
        sim::Ns free;       ///< when the transmitter is
        sim::Ns last;       ///< when the last unit arrives whose fate is known
        sim::Ns light_time; ///< of the link
        double bit_error_rate;
        std::uint64_t lock;
        RadioTraffic traffic;
        sim::Random random;
    };

    struct State {
        sim::Ns now; ///< until which all has happened; -1: nothing has
        Way down, up;
    };

    State &state() { return *reinterpret_cast<State *>(memory_.data()); }
    const State &state() const { return *reinterpret_cast<const State *>(memory_.data()); }
    Sent &unit(const Way &way, std::uint64_t at);
    const Sent &unit(const Way &way, std::uint64_t at) const;
    std::span<std::uint8_t> bytes(Sent &sent) const { return {reinterpret_cast<std::uint8_t *>(&sent + 1), sent.n}; }

    void allocate();
    void publish(sim::Ns t) override;
    RadioLink link(sim::Ns t, bool up, Head last) const;
    Eigen::Vector3d origin(sim::Ns start, double tau) const;

    void settle(sim::Ns t); ///< let happen what happens until t
    void send(Way &way, double rate, sim::Ns t, sim::Unit unit);
    sim::Ns next(const Way &way) const;
    void decide(Way &way, Sent &sent);
    bool damage(Way &way, std::span<std::uint8_t> unit); ///< whether it has
    void deliver(Way &way, sim::Ns t, const std::function<void(sim::Ns, sim::Unit)> &to);

    Radio &interface_;
    std::string serves_ = "flight";
    SourceOf<GroundStationModel> station_;
    sim::Random seeded_down_, seeded_up_;
    std::vector<std::uint64_t> memory_; ///< State, and the units of both directions
    sim::Units ground_;
    bool origin_moves_ = false;
    mutable Ephemeris::Cursor origin_;
};

} // namespace fledge::world
