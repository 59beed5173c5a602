// SPDX-License-Identifier: Apache-2.0
#include "emulator/debug/profile.h"

#include "emulator/error.h"

#include <fstream>

namespace fledge::emulator {

void Profile::executed(const Executed &step)
{
    const Cost spent{step.trapped ? 0u : 1u, step.state.cycles - step.begun};
    const std::uint32_t pc = step.state.pc;
    const std::uint32_t stack = Banks(const_cast<CpuState &>(step.state))[14];
    total_ += spent;
    self_[step.pc] += spent;
    if (step.trapped) {
        enter(step.pc, pc, step.pc, Banks(const_cast<CpuState &>(step.state))[30]); // the window before
        return;
    }
    const bool call = step.word >> 30 == 1;
    const bool jump = step.word >> 30 == 2 && (step.word >> 19 & 63) == 0x38;
    if (call || (jump && (step.word >> 25 & 31) == 15)) { // the delay slot comes first
        site_ = step.pc;
        stack_ = stack;
        target_ = step.state.npc;
    } else if (site_ != 0 && pc == target_) {
        enter(site_, pc, site_ + 8, stack_);
        site_ = 0;
    }
    // A return, also one past several frames (longjmp), or behind the word of a struct's size.
    for (std::size_t depth = frames_.size(); depth-- > 0;) {
        const Frame &frame = frames_[depth];
        if ((pc == frame.back || pc == frame.back + 4) && stack == frame.stack) {
            leave(depth);
            break;
        }
        if (frame.stack > stack) {
            break; // it is in that call
        }
    }
}

/// Where the function begins that an address belongs to; the address itself if it belongs to none.
std::uint32_t Profile::function_of(std::uint32_t address) const
{
    const Program::Symbol *symbol = program_.at(address);
    return symbol && symbol->function ? symbol->address : address;
}

void Profile::enter(std::uint32_t site, std::uint32_t function, std::uint32_t back, std::uint32_t stack)
{
    frames_.push_back({site, function, back, stack, total_});
}

/// All frames from this depth on have returned.
void Profile::leave(std::size_t depth)
{
    while (frames_.size() > depth) {
        const Frame &frame = frames_.back();
        Call &call = calls_[{frame.site, frame.function}];
        call.count++;
        call.inclusive += {total_.instructions - frame.before.instructions, total_.cycles - frame.before.cycles};
        frames_.pop_back();
    }
}

void Profile::write(const std::string &path, const SourceLines &lines)
{
    leave(0); // what has not returned has cost as much so far
    struct Called {
        std::uint32_t site;
        std::uint32_t function;
        const Call *call;
    };
    struct Function {
        std::map<std::pair<std::string, std::uint32_t>, Cost> self; ///< by file and line
        std::vector<Called> calls;
    };
    std::map<std::uint32_t, Function> functions;
    const auto place = [&](std::uint32_t address) {
        const auto *found = lines.find(address);
        return found ? std::pair(lines.files()[found->file], found->line) : std::pair(std::string("???"), 0u);
    };
    for (const auto &[address, cost] : self_) {
        functions[function_of(address)].self[place(address)] += cost;
    }
    for (const auto &[key, call] : calls_) {
        functions[function_of(key.first)].calls.push_back({key.first, function_of(key.second), &call});
    }
    std::ofstream out(path);
    out << "# callgrind format\nversion: 1\ncreator: fledge\npositions: line\nevents: Ir Cycles\nsummary: "
        << total_.instructions << ' ' << total_.cycles << '\n';
    const auto name = [&](std::uint32_t address) {
        const Program::Symbol *symbol = program_.at(address);
        return symbol ? symbol->name : "???";
    };
    for (const auto &[address, function] : functions) {
        out << "\nfl=" << place(address).first << "\nfn=" << name(address) << '\n';
        for (const auto &[at, cost] : function.self) { // also lines of other files, inlined
            out << "fi=" << at.first << '\n' << at.second << ' ' << cost.instructions << ' ' << cost.cycles << '\n';
        }
        for (const Called &called : function.calls) {
            const auto [file, line] = place(called.site);
            const Cost &cost = called.call->inclusive;
            out << "fi=" << file << "\ncfi=" << place(called.function).first << "\ncfn=" << name(called.function)
                << "\ncalls=" << called.call->count << ' ' << place(called.function).second << '\n'
                << line << ' ' << cost.instructions << ' ' << cost.cycles << '\n';
        }
    }
    out.close();
    if (!out) {
        throw Error("the profile " + path + " cannot be written");
    }
}

} // namespace fledge::emulator
