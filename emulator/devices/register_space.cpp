// SPDX-License-Identifier: Apache-2.0
#include "emulator/devices/register_space.h"

#include <algorithm>
#include <bit>

#include "emulator/error.h"
#include "registers/clock.h"
#include "registers/plug_and_play.h"

namespace fledge::emulator {

namespace {

/// The word as the processor, which is big-endian, sees its bytes.
std::uint32_t big_endian(std::uint32_t bytes)
{
    return std::endian::native == std::endian::big ? bytes : __builtin_bswap32(bytes);
}

} // namespace

RegisterSpace::RegisterSpace(std::string name, DeviceHost &host, Settings settings)
    : Device(std::move(name)), host_(host), settings_(std::move(settings))
{
}

void RegisterSpace::make(std::span<const RegisterBoard *const> boards)
{
    std::uint32_t size = 0, lines = 0;
    for (const RegisterBoard *board : boards) {
        size += board->size;
        lines += board->n_interrupts;
    }
    const std::size_t begin = (sizeof(Head) / 4 + lines + 1) / 2; // in units of 8 bytes
    memory_.assign(begin + size / 8, 0);
    std::vector<RegisterWindow> windows;
    auto *words = reinterpret_cast<volatile std::uint32_t *>(memory_.data() + begin);
    for (const RegisterBoard *board : boards) {
        windows.push_back(register_window(board, words));
        words += board->size / 4;
    }
    attach(windows);
}

void RegisterSpace::attach(std::span<const RegisterWindow> windows)
{
    windows_.assign(windows.begin(), windows.end());
    places_.clear();
    counters_.clear();
    clock_ = nullptr;
    std::vector<const RegisterBoard *> boards;
    for (const RegisterWindow &w : windows_) {
        boards.push_back(w.board);
    }
    for (const RegisterWindow &w : windows_) {
        const RegisterBoard &board = *w.board;
        const std::uint64_t at = register_bus_offset(boards.data(), static_cast<std::uint32_t>(boards.size()), &board);
        if (at + board.size > settings_.size) {
            throw Error("the board `" + std::string(board.name) + "` ends " + std::to_string(at + board.size) +
                        " bytes behind the lowest base; the register space has " + std::to_string(settings_.size));
        }
        const auto from = static_cast<std::uint32_t>(at);
        places_.push_back({from, board.size, &w});
        if (!clock_ && board.clock != REGISTER_NOWHERE) {
            clock_ = &w;
            clock_at_ = from + board.clock;
        }
        for (std::uint32_t line = 0; line < board.n_interrupts; line++) {
            const auto named = std::find_if(settings_.lines.begin(), settings_.lines.end(),
                                            [&](const Line &l) { return l.board == board.name && l.line == line; });
            const bool ticks = board.clock != REGISTER_NOWHERE && board.clock_interrupt == static_cast<int>(line);
            const bool listed = named != settings_.lines.end();
            const std::uint32_t interrupt = board.level != 0 ? board.level : settings_.interrupt;
            if (listed || (!ticks && interrupt != 0)) {
                counters_.push_back({&w, board.interrupts + 8 * line, listed ? named->interrupt : interrupt});
            }
        }
    }
    check_lines();
    memory_.resize(std::max(memory_.size(), (sizeof(Head) / 4 + counters_.size() + 1) / 2));
    settle();
}

/// Each line in the list must be there.
void RegisterSpace::check_lines() const
{
    for (const Line &line : settings_.lines) {
        std::string names;
        bool found = false;
        for (const RegisterWindow &w : windows_) {
            names += (names.empty() ? "" : ", ") + std::string(w.board->name) + " with " +
                     std::to_string(w.board->n_interrupts) + " lines";
            found = found || (line.board == w.board->name && line.line < w.board->n_interrupts);
        }
        if (!found) {
            throw Error("the register space has no line " + std::to_string(line.line) + " of a board `" + line.board +
                        "`; it has: " + names);
        }
    }
}

std::span<std::uint32_t> RegisterSpace::seen()
{
    return {reinterpret_cast<std::uint32_t *>(&head() + 1), counters_.size()};
}

RegisterSpace::Head &RegisterSpace::head()
{
    return *reinterpret_cast<Head *>(memory_.data());
}

void RegisterSpace::stick(std::uint32_t offset, std::uint32_t ones, std::uint32_t zeros)
{
    Head &h = head();
    h.at = offset & ~3u;
    h.on = ones;
    h.off = zeros;
}

std::uint32_t RegisterSpace::stuck(std::uint32_t offset, std::uint32_t value)
{
    const Head &h = head();
    return offset == h.at ? (value | h.on) & ~h.off : value;
}

void RegisterSpace::settle()
{
    for (std::size_t i = 0; i < counters_.size(); i++) {
        seen()[i] = register_load(counters_[i].window, counters_[i].address);
    }
}

void RegisterSpace::announce()
{
    for (std::size_t i = 0; i < counters_.size(); i++) {
        const std::uint32_t raised = register_load(counters_[i].window, counters_[i].address);
        if (raised != seen()[i]) {
            seen()[i] = raised;
            if (counters_[i].interrupt != 0) {
                host_.raise(counters_[i].interrupt);
            } else {
                host_.reset();
            }
        }
    }
}

void RegisterSpace::tick()
{
    if (clock_) {
        head().tick = clock_->words[(clock_->board->clock + REGISTER_CLOCK_TICK) / 4];
    }
    if (settings_.tick != 0) {
        host_.raise(settings_.tick);
    }
}

volatile std::uint32_t *RegisterSpace::word(std::uint32_t offset) const
{
    for (const Place &p : places_) {
        if (offset - p.from < p.size) {
            return p.window->words + (offset - p.from) / 4;
        }
    }
    return nullptr;
}

std::uint32_t RegisterSpace::read(std::uint32_t offset)
{
    if (clock_ && offset == clock_at_ + REGISTER_CLOCK_TICK) {
        return big_endian(head().tick);
    }
    const volatile std::uint32_t *at = word(offset);
    return at ? stuck(offset, big_endian(__atomic_load_n(at, __ATOMIC_SEQ_CST))) : 0;
}

void RegisterSpace::write(std::uint32_t offset, std::uint32_t value)
{
    volatile std::uint32_t *at = word(offset);
    if (!at) {
        return;
    }
    __atomic_store_n(at, big_endian(stuck(offset, value)), __ATOMIC_SEQ_CST);
    if (clock_ && offset == clock_at_ + REGISTER_CLOCK_DONE) {
        settle();
        if (done) {
            done();
        }
    }
}

} // namespace fledge::emulator
