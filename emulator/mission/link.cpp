// SPDX-License-Identifier: Apache-2.0
#include "emulator/mission/link.h"

#include <algorithm>
#include <cstring>
#include <dlfcn.h>
#include <limits>
#include <utility>

#include "emulator/board.h"
#include "emulator/devices/register_space.h"
#include "emulator/elf.h"
#include "emulator/error.h"
#include "flight/exec/task.h"

namespace fledge::emulator {

std::shared_ptr<const void> load_symbol(const std::string &path, const char *name)
{
    // Without a slash, dlopen() searches the system's libraries.
    const std::string file = path.find('/') == path.npos ? "./" + path : path;
    const std::shared_ptr<void> library(dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL), [](void *p) {
        if (p) {
            dlclose(p);
        }
    });
    const void *symbol = library ? dlsym(library.get(), name) : nullptr;
    if (!symbol) {
        throw Error("the tables of the mission, " + path + ": " + dlerror());
    }
    return {library, symbol};
}

std::shared_ptr<const MissionHost> load_mission(const std::string &path)
{
    return std::static_pointer_cast<const MissionHost>(load_symbol(path, "fledge_mission"));
}

std::uint32_t mission_address(const Machine &machine, const Program &program)
{
    const Program::Symbol *host = program.named("fledge_mission");
    std::byte bytes[4];
    if (!host || !machine.peek(host->address + 4, bytes)) {
        throw Error(program.path() + ": the program has no fledge_mission");
    }
    std::uint32_t address = 0;
    for (const std::byte b : bytes) {
        address = address << 8 | std::to_integer<std::uint32_t>(b);
    }
    return address;
}

Ns next_instant(const MissionHost &mission, Ns t)
{
    Ns next = std::numeric_limits<Ns>::max() / 2;
    for (std::uint16_t i = 0; i < mission.n_rates; i++) {
        next = std::min<Ns>(next, exec_on_grid(mission.rates[i], t + 1));
    }
    return next;
}

namespace {

RegisterSpace &space_with(Machine &machine, const MissionIo &io)
{
    auto *space = machine.device_of<RegisterSpace>();
    if (!space) {
        throw Error(machine.board().file + ": flight needs a register space, a device of the kind registers");
    }
    space->make({io.boards, io.n_boards});
    return *space;
}

} // namespace

MissionLink::MissionLink(Machine &machine, std::shared_ptr<const MissionHost> host)
    : host_(std::move(host)), io_(*host_->io), space_(space_with(machine, io_)), backend_(machine), outside_(backend_)
{
    own_packets();
    if (const auto [board, lane] = io_.telemetry; board != MISSION_NO_BOARD) {
        packet_.resize(io_.boards[board]->lanes[lane].capacity);
    }
    backend_.loop.next = [this](Ns t) { return next(t); };
}

/// The shared object has memory for one link alone.
void MissionLink::own_packets()
{
    if (!io_.packets) {
        return;
    }
    packets_ = *io_.packets;
    kinds_.assign(packets_.kinds, packets_.kinds + packets_.n);
    std::size_t size = 0, longest = 0;
    for (const MissionPacket &kind : kinds_) {
        size += kind.size + 1;
        longest = std::max<std::size_t>(longest, io_.boards[kind.board]->lanes[kind.lane].capacity);
    }
    last_.resize(size);
    scratch_.resize(longest);
    std::uint8_t *at = last_.data();
    for (MissionPacket &kind : kinds_) {
        kind.memory = std::exchange(at, at + kind.size + 1);
    }
    packets_.kinds = kinds_.data();
    packets_.scratch = scratch_.data();
    io_.packets = &packets_;
}

void MissionLink::put(std::uint32_t id, const void *message)
{
    if (id == host_->reset) {
        std::memcpy(&line_, message, std::min<std::size_t>(io_.messages[id].size, sizeof line_));
    }
    mission_io_put(&io_, windows(), id, message, &counts_);
}

void MissionLink::take(std::uint32_t id, void *message)
{
    mission_io_take(&io_, windows(), id, message, reached_, &counts_);
}

bool MissionLink::send(std::span<const std::byte> packet)
{
    return mission_io_send(&io_, windows(), io_.commands, packet.data(), static_cast<std::uint32_t>(packet.size()),
                           &counts_) != 0;
}

std::span<const std::uint8_t> MissionLink::receive()
{
    return std::span(packet_).first(mission_io_receive(&io_, windows(), io_.telemetry, packet_.data(),
                                                       static_cast<std::uint32_t>(packet_.size()), &counts_));
}

bool MissionLink::tick(Ns t)
{
    const Ns dt = t < 0 || reached_ < 0 ? 0 : t - reached_;
    reached_ = t;
    return outside_.tick({t, dt}, {}) != registers::Wait::gone;
}

MissionLink::State MissionLink::save() const
{
    const auto packets = std::as_bytes(std::span(last_));
    return {reached_, line_, backend_.loop.state, outside_.save(), {packets.begin(), packets.end()}};
}

void MissionLink::restore(const State &state)
{
    reached_ = state.reached;
    line_ = state.line;
    backend_.loop.state = state.loop;
    outside_.restore(state.outside);
    std::ranges::copy(state.packets, std::as_writable_bytes(std::span(last_)).begin());
}

} // namespace fledge::emulator
