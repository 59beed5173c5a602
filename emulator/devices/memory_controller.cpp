// SPDX-License-Identifier: Apache-2.0
#include "emulator/devices/memory_controller.h"

#include <algorithm>
#include <bit>

namespace fledge::emulator {

// ---- MemoryController

namespace {
enum : std::uint32_t { mcfg3 = 0x08, edac_enable = 1 << 9, edac_there = 1 << 27 };
} // namespace

std::uint32_t MemoryController::read(std::uint32_t offset)
{
    if (offset > mcfg3) {
        return 0;
    }
    const std::uint32_t stored = state_.config[offset / 4];
    return offset < mcfg3 ? stored
                          : (stored & ~(edac_enable | edac_there)) | (state_.edac ? edac_enable : 0u) |
                                (bus_.has_edac() ? edac_there : 0u);
}

void MemoryController::write(std::uint32_t offset, std::uint32_t value)
{
    if (offset > mcfg3) {
        return;
    }
    state_.config[offset / 4] = value;
    if (offset == mcfg3) {
        state_.edac = bus_.has_edac() && (value & edac_enable) ? 1 : 0;
        bus_.enable_edac(state_.edac != 0);
    }
}

void MemoryController::reset()
{
    state_ = {};
    state_.edac = bus_.has_edac() ? 1 : 0;
    bus_.enable_edac(bus_.has_edac());
}

// ---- AhbStatus

namespace {
enum : std::uint32_t { is_write = 1 << 7, new_error = 1 << 8, was_corrected = 1 << 9 };
} // namespace

std::uint32_t AhbStatus::read(std::uint32_t offset)
{
    switch (offset) {
    case 0x0: return state_.status;
    case 0x4: return state_.address;
    case 0x8: return state_.corrected;
    case 0xC: return state_.failed;
    default: return 0;
    }
}

void AhbStatus::write(std::uint32_t offset, std::uint32_t value)
{
    if (offset == 0x0 && !(value & new_error)) {
        state_.status &= ~(new_error | was_corrected);
    }
}

void AhbStatus::note(const BusError &error)
{
    (error.corrected ? state_.corrected : state_.failed)++;
    if (!(state_.status & new_error)) {
        state_.status = static_cast<std::uint32_t>(std::countr_zero(error.size)) | (error.write ? is_write : 0u) |
                        (error.corrected ? was_corrected : 0u) | new_error;
        state_.address = error.address;
        host_.raise(interrupt_);
    }
}

// ---- Scrubber

Scrubber::Scrubber(std::string name, DeviceHost &host, SystemBus &bus, std::uint32_t period)
    : Device(std::move(name)), host_(host), bus_(bus), period_(period)
{
    reset();
}

void Scrubber::reset()
{
    state_ = {};
    state_.running = period_ != 0 ? 1 : 0;
    state_.period = std::max(period_, 1u);
    state_.position = bus_.ram().base;
    state_.next_at = host_.cycles() + state_.period;
}

/// How many words the scrubber reads before this one.
std::uint64_t Scrubber::words_until(std::uint32_t address) const
{
    const std::uint32_t n = bus_.ram().size;
    return (address - state_.position + (address < state_.position ? n : 0)) / 4;
}

void Scrubber::bring_up()
{
    if (!state_.running || host_.cycles() < state_.next_at) {
        return;
    }
    const std::uint64_t passed = 1 + (host_.cycles() - state_.next_at) / state_.period;
    std::vector<std::uint32_t> words;
    for (const auto &[address, _] : bus_.flips()) {
        if (words_until(address) < passed) {
            words.push_back(address);
        }
    }
    for (const std::uint32_t word : words) {
        const EdacResult result = bus_.scrub(word);
        state_.corrected += result == EdacResult::corrected;
        state_.failed += result == EdacResult::uncorrectable;
    }
    const Memory &ram = bus_.ram();
    const std::uint64_t index = (state_.position - ram.base) / 4 + passed;
    state_.rounds += static_cast<std::uint32_t>(index / (ram.size / 4));
    state_.position = ram.base + static_cast<std::uint32_t>(index % (ram.size / 4)) * 4;
    state_.next_at += passed * state_.period;
}

std::uint64_t Scrubber::next_event() const
{
    std::uint64_t words = never;
    for (const auto &[address, _] : bus_.flips()) {
        words = std::min(words, words_until(address));
    }
    return !state_.running || words == never ? never : state_.next_at + words * state_.period;
}

std::uint32_t Scrubber::read(std::uint32_t offset)
{
    bring_up();
    switch (offset) {
    case 0x00: return state_.running;
    case 0x04: return state_.period;
    case 0x08: return state_.position;
    case 0x0C: return state_.rounds;
    case 0x10: return state_.corrected;
    case 0x14: return state_.failed;
    default: return 0;
    }
}

void Scrubber::write(std::uint32_t offset, std::uint32_t value)
{
    bring_up();
    const Memory &ram = bus_.ram();
    switch (offset) {
    case 0x00: state_.running = value & 1; break;
    case 0x04: state_.period = std::max(value, 1u); break;
    case 0x08: state_.position = value - ram.base < ram.size ? value & ~3u : ram.base; break;
    case 0x0C: state_.rounds = 0; return;
    case 0x10: state_.corrected = 0; return;
    case 0x14: state_.failed = 0; return;
    default: return;
    }
    state_.next_at = host_.cycles() + state_.period;
    host_.changed();
}

// ---- WriteProtection

std::uint32_t WriteProtection::read(std::uint32_t offset)
{
    return offset / 4 < words_.size() ? words_[offset / 4] : 0;
}

void WriteProtection::write(std::uint32_t offset, std::uint32_t value)
{
    if (offset / 4 < words_.size()) {
        words_[offset / 4] = value & (offset % 8 == 0 ? ~(page_size - 1) | 1u : ~(page_size - 1));
        restored();
    }
}

void WriteProtection::reset()
{
    words_ = {};
    restored();
}

void WriteProtection::restored()
{
    std::vector<ProtectedRange> ranges;
    for (std::size_t i = 0; i < words_.size(); i += 2) {
        if (words_[i] & 1) {
            ranges.push_back({words_[i] & ~1u, words_[i + 1] + (page_size - 1)});
        }
    }
    bus_.protect(std::move(ranges));
}

} // namespace fledge::emulator
