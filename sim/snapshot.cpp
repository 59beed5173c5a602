// SPDX-License-Identifier: Apache-2.0
#include "sim/snapshot.h"

#include <algorithm>
#include <cstring>
#include <map>

namespace fledge::sim {

namespace {

struct Start {
    std::uint64_t layout;
    std::uint64_t checksum;
};

/// FNV-1a, by words.
struct Hash {
    std::uint64_t value = 0xcbf29ce484222325u;
    void mix(std::uint64_t x) { value = (value ^ x) * 0x100000001b3u; }
};

/// Differs between structures with other types, tasks, wires or events.
std::uint64_t layout_of(Runtime &runtime)
{
    Hash hash;
    for (const auto &process : runtime.structure.processes) {
        for (const auto &instance : process->instances()) {
            hash.mix(instance->type().hash);
        }
    }
    runtime.visit_state([&](void *, std::size_t n) { hash.mix(n); });
    return hash.value;
}

/// Of all bytes of a snapshot but those of the checksum, and of their number.
std::uint64_t checksum_of(std::span<const std::byte> bytes)
{
    Start start;
    std::memcpy(&start, bytes.data(), sizeof start);
    Hash hash;
    hash.mix(start.layout);
    hash.mix(bytes.size());
    for (std::size_t at = sizeof start; at < bytes.size(); at += sizeof(std::uint64_t)) {
        std::uint64_t word = 0;
        std::memcpy(&word, bytes.data() + at, std::min(sizeof word, bytes.size() - at));
        hash.mix(word);
    }
    return hash.value;
}

void visit_models(const Runtime &runtime, void (Model::*f)())
{
    for (const auto &process : runtime.structure.processes) {
        for (const auto &instance : process->instances()) {
            if (Model *model = instance->model()) {
                (model->*f)();
            }
        }
    }
}

} // namespace

std::vector<std::byte> save(Runtime &runtime)
{
    visit_models(runtime, &Model::save);
    std::vector<std::byte> bytes;
    const auto append = [&](const void *from, std::size_t n) {
        const auto *first = static_cast<const std::byte *>(from);
        bytes.insert(bytes.end(), first, first + n);
    };
    Start start{layout_of(runtime), 0};
    append(&start, sizeof start);
    runtime.visit_state(append);
    if (runtime.commands_used()) {
        runtime.visit_commands(append);
    }
    start.checksum = checksum_of(bytes);
    std::memcpy(bytes.data(), &start, sizeof start);
    return bytes;
}

std::size_t snapshot_room(Runtime &runtime)
{
    std::size_t n = sizeof(Start);
    const auto add = [&](void *, std::size_t size) { n += size; };
    runtime.visit_state(add);
    runtime.visit_commands(add);
    return n;
}

std::vector<Simulation::StateBlock> state_blocks(Runtime &runtime)
{
    std::map<const void *, std::size_t> offsets;
    std::size_t at = sizeof(Start);
    runtime.visit_state([&](const void *block, std::size_t n) {
        offsets[block] = at;
        at += n;
    });
    std::vector<Simulation::StateBlock> blocks;
    for (const auto &process : runtime.structure.processes) {
        for (const auto &instance : process->instances()) {
            using enum Simulation::StateBlock::Kind;
            blocks.push_back({INSTANCE, instance->path, offsets.at(instance->memory()), instance->type().size});
            if (Model *model = instance->model(); model && !model->memory().empty()) {
                const auto memory = model->memory();
                blocks.push_back({MODEL, instance->path, offsets.at(memory.data()), memory.size()});
            }
        }
    }
    runtime.visit_held([&](const Wire &wire, const void *block, std::size_t n) {
        blocks.push_back({Simulation::StateBlock::HELD, wire.to.path(), offsets.at(block), n});
    });
    return blocks;
}

bool check_snapshot(Runtime &runtime, std::span<const std::byte> bytes, bool edited)
{
    const auto about = "this snapshot (" + std::to_string(bytes.size()) + " bytes) is ";
    Start start{};
    if (bytes.size() >= sizeof start) {
        std::memcpy(&start, bytes.data(), sizeof start);
    }
    if (bytes.size() < sizeof start || (!edited && start.checksum != checksum_of(bytes))) {
        throw SetupError(about + "truncated or damaged: its checksum is not that of its bytes; take another one");
    }
    std::size_t size = sizeof start, commands = 0;
    runtime.visit_state([&](void *, std::size_t n) { size += n; });
    runtime.visit_commands([&](void *, std::size_t n) { commands += n; });
    const bool commanded = commands && bytes.size() == size + commands;
    if (start.layout != layout_of(runtime) || (bytes.size() != size && !commanded)) {
        throw SetupError(about + "of a simulation with other modules, tasks or events; this one's have " +
                         std::to_string(size) + " bytes");
    }
    return commanded;
}

void restore(Runtime &runtime, std::span<const std::byte> bytes, bool edited)
{
    const bool commanded = check_snapshot(runtime, bytes, edited);
    const std::byte *from = bytes.data() + sizeof(Start);
    const auto take = [&](void *to, std::size_t n) {
        if (n > 0) { // an empty block may have no place
            std::memcpy(to, from, n);
        }
        from += n;
    };
    runtime.visit_state(take);
    runtime.forget_commands();
    if (commanded) {
        runtime.visit_commands(take);
    }
    visit_models(runtime, &Model::restored);
    runtime.restored();
}

} // namespace fledge::sim
