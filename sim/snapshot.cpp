// SPDX-License-Identifier: Apache-2.0
#include "sim/snapshot.h"

#include <cstring>
#include <map>

namespace fledge::sim {

namespace {

/// Differs between structures with other types, tasks, wires or events.
std::uint64_t hash_of(Runtime &runtime)
{
    std::uint64_t hash = 0xcbf29ce484222325u; // FNV-1a, by words
    const auto mix = [&](std::uint64_t x) { hash = (hash ^ x) * 0x100000001b3u; };
    for (const auto &process : runtime.structure.processes) {
        for (const auto &instance : process->instances()) {
            mix(instance->type().hash);
        }
    }
    runtime.visit_state([&](void *, std::size_t n) { mix(n); });
    return hash;
}

} // namespace

std::vector<std::byte> save(Runtime &runtime)
{
    std::vector<std::byte> bytes;
    const auto append = [&](const void *from, std::size_t n) {
        const auto *first = static_cast<const std::byte *>(from);
        bytes.insert(bytes.end(), first, first + n);
    };
    const std::uint64_t hash = hash_of(runtime);
    append(&hash, sizeof hash);
    runtime.visit_state(append);
    if (runtime.commands_used()) {
        runtime.visit_commands(append);
    }
    return bytes;
}

std::vector<Simulation::StateBlock> state_blocks(Runtime &runtime)
{
    std::map<const void *, std::size_t> offsets;
    std::size_t at = sizeof(std::uint64_t); // behind the hash
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

bool check_snapshot(Runtime &runtime, std::span<const std::byte> bytes)
{
    std::uint64_t hash = 0;
    std::size_t size = sizeof hash;
    runtime.visit_state([&](void *, std::size_t n) { size += n; });
    if (bytes.size() >= sizeof hash) {
        std::memcpy(&hash, bytes.data(), sizeof hash);
    }
    std::size_t commands = 0;
    runtime.visit_commands([&](void *, std::size_t n) { commands += n; });
    const bool commanded = commands && bytes.size() == size + commands;
    if (hash != hash_of(runtime) || (bytes.size() != size && !commanded)) {
        throw SetupError("this snapshot (" + std::to_string(bytes.size()) +
                         " bytes) is of a simulation with other modules, tasks or events; this one's have " +
                         std::to_string(size) + " bytes");
    }
    return commanded;
}

void restore(Runtime &runtime, std::span<const std::byte> bytes)
{
    const bool commanded = check_snapshot(runtime, bytes);
    const std::byte *from = bytes.data() + sizeof(std::uint64_t);
    const auto take = [&](void *to, std::size_t n) {
        std::memcpy(to, from, n);
        from += n;
    };
    runtime.visit_state(take);
    runtime.forget_commands();
    if (commanded) {
        runtime.visit_commands(take);
    }
    runtime.restored();
}

} // namespace fledge::sim
