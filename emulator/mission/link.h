// SPDX-License-Identifier: Apache-2.0
// A mission that flies on a machine: the outside's end of its registers, and its instants. The mission comes as data, a
// shared object as fledge.targets builds it.
//
// Example:
//
//     #include "emulator/board.h"
//     #include "emulator/elf.h"
//     using namespace emulator;
//     Machine machine(BoardDescription::read("emulator/boards/leon3.toml"));
//     machine.load(Program::read("nadir_spin"));
//     MissionLink link(machine, load_mission("tables/nadir_spin.so"));
//     link.tick(-1); // flight boots
//     std::vector<std::byte> command(link.host().io->messages[1].size);
//     for (Ns t = 0; t < 60'000'000'000; t = link.next(t)) {
//         if (!link.tick(t)) {
//             throw std::runtime_error(machine.report());
//         }
//         link.take(1, command.data());
//     }
#pragma once

#include <memory>
#include <string>

#include "emulator/backend.h"
#include "flight/msg/computer.h"
#include "registers/outside.h"
#include "targets/mission_host.h"

namespace fledge::emulator {

/// A symbol of a shared object, which stays loaded as long as this lives. Throws Error.
std::shared_ptr<const void> load_symbol(const std::string &path, const char *name);

/// The mission that a shared object has. Throws Error.
std::shared_ptr<const MissionHost> load_mission(const std::string &path);

/// The address of the mission's memory in a machine, of whose program its MissionHost is a part. Throws Error.
std::uint32_t mission_address(const Machine &machine, const Program &program);

/// Flight's first instant after t: on the grid of any of its tasks.
Ns next_instant(const MissionHost &mission, Ns t);

class MissionLink {
public:
    /// All that is not in the machine.
    struct State {
        Ns reached = -1;      ///< the last tick
        ComputerReset line{}; ///< the message that resets the computer, as put last
        FlightLoop::State loop;
        std::vector<std::byte> outside, packets;
    };

    /// Throws Error if the machine has no room for the mission's registers.
    MissionLink(Machine &machine, std::shared_ptr<const MissionHost> host);
    MissionLink(const MissionLink &) = delete;
    MissionLink &operator=(const MissionLink &) = delete;

    const MissionHost &host() const { return *host_; }
    FlightLoop &loop() { return backend_.loop; }
    const FlightLoop &loop() const { return backend_.loop; }
    RegisterSpace &space() { return space_; }
    Ns reached() const { return reached_; }
    Ns next(Ns t) const { return next_instant(*host_, t); }

    /// Messages by their ids, in memory of their sizes. What no lane carries of a message, take() leaves as it is.
    bool carries(std::uint32_t id) const { return mission_io_carries(&io_, id) != 0; }
    void put(std::uint32_t id, const void *message);
    void take(std::uint32_t id, void *message);

    /// A command for flight; false: there is no room, or no queue.
    bool send(std::span<const std::byte> packet);
    /// The next packet from flight, valid until the next call; empty: there is none.
    std::span<const std::uint8_t> receive();

    /// Whether the computer is down at t, after a reset by the message that was put last: no tick reaches it.
    bool is_down(Ns t) { return outside_.is_down(t, line_.count, host_->down); }
    /// An instant of flight; t < 0: reset flight. False: the processor is in its error mode.
    bool tick(Ns t);

    State save() const;
    void restore(const State &state);

private:
    void own_packets();
    const RegisterWindow *windows() const { return backend_.windows().data(); }

    std::shared_ptr<const MissionHost> host_;
    MissionIo io_; ///< the host's, but for the memory of packets
    MissionPackets packets_{};
    std::vector<MissionPacket> kinds_;
    std::vector<std::uint8_t> last_, scratch_, packet_; ///< the last packets of all kinds; memory for one packet each
    RegisterSpace &space_;
    MachineBackend backend_;
    registers::Outside outside_;
    MissionIoCounts counts_{};
    ComputerReset line_{};
    Ns reached_ = -1;
};

} // namespace fledge::emulator
