// SPDX-License-Identifier: Apache-2.0
#include "world/avionics/recorder_model.h"

#include "flight/math/elementary.h"

#include <algorithm>
#include <array>
#include <bit>

namespace fledge::world {

namespace {

// The columns of the code's matrix: of the data's bits, 64 bytes with 3 or 5 bits; of its own bits, those with one. So
// one wrong bit has an odd sum of columns, which names it, and two have an even one, which is not 0.
constexpr auto columns = [] {
    std::array<std::uint8_t, 64> codes{};
    std::size_t n = 0;
    for (int weight : {3, 5}) {
        for (unsigned x = 0; x < 256 && n < codes.size(); x++) {
            if (std::popcount(x) == weight) {
                codes[n++] = static_cast<std::uint8_t>(x);
            }
        }
    }
    return codes;
}();

std::uint8_t code_of(const std::uint8_t *word)
{
    std::uint8_t code = 0;
    for (std::size_t i = 0; i < columns.size(); i++) {
        code ^= word[i / 8] >> i % 8 & 1 ? columns[i] : std::uint8_t{0};
    }
    return code;
}

} // namespace

void RecorderModel::prepare(const sim::Setup &setup)
{
    seeded_ = sim::Random(setup.seed, setup.name);
}

void RecorderModel::reset(sim::Ns)
{
    state_ = {seeded_, -1.0};
    interface_.out = {};
    interface_.mem = {};
}

/// bit: of a page's data, and behind them those of its code.
void RecorderModel::flip(std::uint32_t page, std::uint32_t bit)
{
    auto &mem = interface_.mem;
    const std::uint32_t byte = bit / 8;
    (byte < RECORDER_PAGE ? mem.memory[page][byte] : mem.code[page][byte - RECORDER_PAGE]) ^=
        static_cast<std::uint8_t>(1 << bit % 8);
}

void RecorderModel::upset(Tick tick)
{
    const auto &par = interface_.par;
    const sim::Ns last = tick.t - std::max(tick.dt, sim::Ns{1}); // at the first update dt is 0
    for (std::uint32_t i = 0; i < par.n_faults; i++) {
        const RecorderFault &fault = par.faults[i];
        if (fault.kind == RECORDER_FLIP && fault.begin > last && fault.begin <= tick.t) {
            for (std::uint32_t k = 0; k < fault.bits && fault.bit + k < 8 * RECORDER_PAGE; k++) {
                flip(fault.page, fault.bit + k);
            }
        }
    }
    if (par.upsets <= 0) {
        return;
    }
    const auto draw = [&] { return -fm_log(1.0 - state_.random.uniform()) / par.upsets; };
    state_.until = (state_.until < 0 ? draw() : state_.until) - tick_seconds(tick.dt);
    for (; state_.until < 0; state_.until += draw()) {
        constexpr double bits = 8 * (RECORDER_PAGE + RECORDER_WORDS);
        const auto any = static_cast<std::uint32_t>(state_.random.uniform() * par.pages * bits);
        flip(any / static_cast<std::uint32_t>(bits), any % static_cast<std::uint32_t>(bits));
    }
}

bool RecorderModel::worn(std::uint32_t page, sim::Ns t) const
{
    const auto &par = interface_.par;
    return (par.endurance != 0 && interface_.mem.writes[page] >= par.endurance) ||
           std::any_of(par.faults, par.faults + par.n_faults, [&](const RecorderFault &fault) {
               return fault.kind == RECORDER_WEAR && fault.page == page && t >= fault.begin;
           });
}

/// The first words of the request's data.
void RecorderModel::write(std::uint32_t words)
{
    auto &mem = interface_.mem;
    std::copy_n(mem.data, 8 * words, mem.memory[mem.page]);
    for (std::uint32_t i = 0; i < words; i++) {
        mem.code[mem.page][i] = code_of(mem.data + 8 * i);
    }
    mem.writes[mem.page]++;
    mem.used = std::max(mem.used, mem.page + 1);
}

/// Set right what can be, and put the page out.
RecorderAnswer RecorderModel::read(std::uint32_t page)
{
    auto &mem = interface_.mem;
    auto &[reply, state] = interface_.out;
    RecorderAnswer answer = RECORDER_DONE;
    for (std::uint32_t i = 0; i < RECORDER_WORDS; i++) {
        std::uint8_t *word = mem.memory[page] + 8 * i;
        const std::uint8_t wrong = code_of(word) ^ mem.code[page][i];
        const auto column = std::find(columns.begin(), columns.end(), wrong) - columns.begin();
        if (wrong == 0) {
            continue;
        }
        if (std::popcount(wrong) == 1) {
            mem.code[page][i] ^= wrong;
        } else if (column < std::ssize(columns)) {
            word[column / 8] ^= static_cast<std::uint8_t>(1 << column % 8);
        } else {
            state.damaged++;
            return RECORDER_DAMAGED;
        }
        state.corrected++;
        answer = RECORDER_CORRECTED;
    }
    std::copy_n(mem.memory[page], RECORDER_PAGE, reply.data);
    return answer;
}

/// The request that was being served is done.
void RecorderModel::serve(sim::Ns t)
{
    auto &mem = interface_.mem;
    auto &[reply, state] = interface_.out;
    std::fill(std::begin(reply.data), std::end(reply.data), std::uint8_t{0});
    reply.number = mem.number;
    reply.page = mem.page;
    if (mem.page >= interface_.par.pages || (mem.serving != RECORDER_WRITE && mem.serving != RECORDER_READ)) {
        reply.answer = RECORDER_REFUSED;
        state.refused++;
    } else if (mem.serving == RECORDER_READ) {
        reply.answer = read(mem.page);
        state.read++;
    } else if (worn(mem.page, t)) {
        reply.answer = RECORDER_WORN;
        state.worn++;
    } else {
        write(RECORDER_WORDS);
        reply.answer = RECORDER_DONE;
        state.written++;
    }
    mem.serving = RECORDER_NOTHING;
}

void RecorderModel::update(Tick tick)
{
    const auto &par = interface_.par;
    const auto &[request, power] = interface_.in;
    auto &mem = interface_.mem;
    auto &[reply, state] = interface_.out;

    upset(tick);
    const bool writes = mem.serving == RECORDER_WRITE && mem.page < par.pages && !worn(mem.page, tick.t);
    if (!supplied(&power, par.load)) {
        if (writes) {
            const auto lasted = static_cast<double>(std::min(tick_since(tick.t, mem.begun), par.write_time));
            write(static_cast<std::uint32_t>(RECORDER_WORDS * lasted / static_cast<double>(par.write_time)));
            state.torn++;
        }
        mem.serving = RECORDER_NOTHING;
        state.busy = 0;
        const Head head = head_held(reply.head);
        reply = {};
        reply.head = head;
        state.head = head_held(state.head);
        return;
    }
    const auto ready = [&] {
        const sim::Ns needs = mem.serving == RECORDER_WRITE ? par.write_time : par.read_time;
        return mem.serving != RECORDER_NOTHING && tick_since(tick.t, mem.begun) >= needs;
    };
    if (ready()) {
        serve(tick.t);
    }
    if (mem.serving == RECORDER_NOTHING && request.code != RECORDER_NOTHING && request.number != reply.number) {
        mem.serving = static_cast<std::uint32_t>(request.code);
        mem.number = request.number;
        mem.page = request.page;
        mem.begun = tick.t;
        std::copy_n(request.data, RECORDER_PAGE, mem.data);
        if (ready()) {
            serve(tick.t);
        }
    }
    state.busy = mem.serving != RECORDER_NOTHING;
    reply.pages = par.pages;
    reply.used = mem.used;
    reply.head = head_next(reply.head, tick.t, QUALITY_GOOD);
    state.head = head_next(state.head, tick.t, QUALITY_GOOD);
}

} // namespace fledge::world
