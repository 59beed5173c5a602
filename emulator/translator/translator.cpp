// SPDX-License-Identifier: Apache-2.0
// Blocks of SPARC instructions as instructions of x86-64.
//
// A block is translated when it is reached first, and jumps to the next one directly once both are there. It begins
// with a check that it ends before the run does; otherwise the threaded interpreter executes the rest. All that is rare
// leaves the block: the reference executes that one instruction, and the next block begins behind it.
#include "emulator/cpu/engine.h"

#ifdef __x86_64__

#include <algorithm>
#include <array>
#include <optional>
#include <system_error>
#include <unordered_map>

#include <xbyak/xbyak_util.h>

#include "emulator/cpu/fpu.h"
#include "emulator/cpu/host_fpu.h"
#include "emulator/cpu/step.h"
#include "emulator/translator/emitter.h"

namespace fledge::emulator {

namespace {

constexpr std::size_t code_size = std::size_t{16} << 20;
constexpr std::size_t longest_trace = 64;        ///< [instructions]
constexpr std::uint64_t elsewhere = 1000;        ///< [cycles] that the other engine runs where nothing is translated
constexpr std::uint32_t mxcsr_defaults = 0x1F80; ///< to nearest, no exception traps, none has occurred
constexpr std::uint32_t no_link = ~std::uint32_t{0};
constexpr std::int64_t longest_run = std::int64_t{1} << 62;

/// Instructions that only read memory, and change nothing of its pages.
bool loads(Op op)
{
    return (op >= Op::ld && op <= Op::ldd) || op == Op::ldsb || op == Op::ldsh || op == Op::ldf || op == Op::lddf;
}

class Translator final : public Engine {
public:
    const char *name() const override { return "translator"; }

    Exit run(Core &core, std::uint64_t until, bool step_over) override;
    void invalidate(std::uint32_t address, std::uint32_t size) override;
    void set_breakpoint(Core &core, std::uint32_t address, bool on) override
    {
        other_->set_breakpoint(core, address, on);
        invalidate(address, 4);
    }

private:
    /// Memory and code of a processor; an engine meets its processor at its first run.
    void meet(Core &core);
    bool in_ram(std::uint32_t address) const { return address - ram_.base < ram_.size; }
    bool readable(std::uint32_t address) const
    {
        return in_ram(address) && (ram_.flags[(address - ram_.base) / page_size] & page_slow_read) == 0;
    }

    std::optional<std::uint32_t> block_at(Core &core, std::uint32_t pc);
    std::optional<TranslatedTrace> trace_from(Core &core, std::uint32_t pc);
    bool fetch(Core &core, std::uint32_t pc, Instruction &i) const;
    void look_at_flags();
    void kill(std::uint32_t block);
    void forget_all();

    std::uint64_t enter(Core &core, std::uint64_t until, const Block &block);
    void settle(Core &core);
    bool execute_site(Core &core, const Site &site);
    bool execute_here(Core &core)
    {
        settle(core);
        return fetch_and_execute(core);
    }
    Exit run_other(Core &core, std::uint64_t until)
    {
        settle(core);
        return other_->run(core, until);
    }

    std::unique_ptr<Engine> other_ = make_threaded();
    Core *core_ = nullptr;
    Memory ram_;
    std::uint64_t flag_changes_ = ~std::uint64_t{0}; ///< at the last look
    Context context_;
    CodeMemory memory_{code_size};
    std::unique_ptr<Emitter> emitter_;
    std::array<Target, target_count> targets_{};
    std::vector<Block> blocks_;
    std::unordered_map<std::uint32_t, std::uint32_t> block_of_pc_;
    std::unordered_map<std::uint32_t, std::vector<std::uint32_t>> blocks_of_page_;
};

void Translator::meet(Core &core)
{
    core_ = &core;
    ram_ = core.bus->ram();
    emitter_ = std::make_unique<Emitter>(memory_, core, ram_);
    context_.page_flags = ram_.flags;
    context_.code_words = ram_.code;
    context_.ram = reinterpret_cast<std::uintptr_t>(ram_.bytes) - ram_.base;
    context_.targets = targets_.data();
    forget_all();
}

void Translator::forget_all()
{
    blocks_.clear();
    block_of_pc_.clear();
    blocks_of_page_.clear();
    targets_.fill({});
    emitter_->forget();
}

/// Loads of translated code look at the flags of pages only while a page has one that matters to them.
void Translator::look_at_flags()
{
    if (ram_.read_flag_changes != nullptr && *ram_.read_flag_changes == flag_changes_) {
        return;
    }
    flag_changes_ = ram_.read_flag_changes != nullptr ? *ram_.read_flag_changes : 0;
    std::uint8_t all = 0;
    for (std::uint32_t page = 0; page < ram_.size / page_size; page++) {
        all |= ram_.flags[page];
    }
    if (const bool slow = (all & page_slow_read) != 0; slow != emitter_->checks_reads) {
        emitter_->checks_reads = slow;
        forget_all();
    }
}

// ---- blocks

bool Translator::fetch(Core &core, std::uint32_t pc, Instruction &i) const
{
    std::uint32_t word = 0;
    if (!readable(pc) || core.bus->fetch(pc, word) != Access::done) {
        return false;
    }
    i = decode(word);
    return true;
}

/// The instructions from pc on, up to a branch that may go two ways; branches that always go one way are followed.
std::optional<TranslatedTrace> Translator::trace_from(Core &core, std::uint32_t pc)
{
    TranslatedTrace trace;
    trace.next = pc;
    Instruction i, slot;
    while (trace.items.size() < longest_trace && fetch(core, trace.next, i)) {
        const std::uint32_t at = trace.next;
        if (core.breakpoints.contains(at)) {
            break;
        }
        const std::uint32_t cycles = core.timing[i.op];
        const bool is_branch = i.op == Op::bicc || i.op == Op::fbfcc;
        const bool always = i.op == Op::call || (is_branch && i.condition == 8);
        const bool never = is_branch && i.condition == 0;
        if (i.op != Op::call && i.op != Op::jmpl && !is_branch) {
            trace.items.push_back({at, at + 4, cycles, i});
            trace.next = at + 4;
            if (!Emitter::translates(i)) {
                return trace; // it leaves
            }
            continue;
        }
        const bool goes_one_way = always || never;
        const std::uint32_t to = always ? at + static_cast<std::uint32_t>(i.imm) : at + 8;
        if (goes_one_way && i.annul) {
            trace.items.push_back({at, at + 4, cycles + core.timing.annulled, i});
            trace.next = to;
            continue;
        }
        if (!fetch(core, at + 4, slot) || transfers_control(slot.op) || core.breakpoints.contains(at + 4)) {
            break;
        }
        trace.items.push_back({at, at + 4, cycles, i});
        trace.items.push_back({at + 4, to, core.timing[slot.op], slot});
        trace.next = to;
        if (!goes_one_way) {
            trace.branches = true;
            return trace;
        }
        if (!Emitter::translates(slot)) {
            return trace;
        }
    }
    return trace.items.empty() ? std::nullopt : std::optional(trace);
}

std::optional<std::uint32_t> Translator::block_at(Core &core, std::uint32_t pc)
{
    if (const auto found = block_of_pc_.find(pc); found != block_of_pc_.end()) {
        return found->second;
    }
    const std::optional<TranslatedTrace> trace = trace_from(core, pc);
    if (!trace) {
        return std::nullopt;
    }
    if (emitter_->full()) {
        forget_all();
    }
    const auto index = static_cast<std::uint32_t>(blocks_.size());
    Block &block = blocks_.emplace_back();
    block.pc = pc;
    for (const Item &item : trace->items) {
        block.words.push_back(item.pc);
        core.bus->mark_code(item.pc);
        const std::uint32_t page = item.pc / page_size;
        std::vector<std::uint32_t> &of_page = blocks_of_page_[page];
        if (of_page.empty() || of_page.back() != index) {
            of_page.push_back(index);
        }
    }
    emitter_->emit(*trace, block, index);
    block_of_pc_[pc] = index;
    return index;
}

/// Nothing leads to the block any more; its code stays until all is forgotten, for it may be running.
void Translator::kill(std::uint32_t index)
{
    Block &block = blocks_[index];
    if (!block.valid) {
        return;
    }
    block.valid = false;
    block_of_pc_.erase(block.pc);
    Target &target = targets_[block.pc / 4 % target_count];
    if (target.pc == block.pc) {
        target = {};
    }
    for (std::uint32_t link : block.incoming) {
        emitter_->connect(emitter_->links[link], emitter_->links[link].unlinked);
    }
    block.incoming.clear();
}

void Translator::invalidate(std::uint32_t address, std::uint32_t size)
{
    other_->invalidate(address, size);
    if (size == 0 || !emitter_) {
        return;
    }
    const auto touches = [address, size](std::uint32_t word) { return word - address < size || address - word < 4; };
    for (std::uint32_t page = address / page_size; page <= (address + (size - 1)) / page_size; page++) {
        const auto found = blocks_of_page_.find(page);
        if (found == blocks_of_page_.end()) {
            continue;
        }
        std::erase_if(found->second, [&](std::uint32_t index) {
            if (blocks_[index].valid && std::ranges::any_of(blocks_[index].words, touches)) {
                kill(index);
            }
            return !blocks_[index].valid;
        });
        if (found->second.empty()) {
            blocks_of_page_.erase(found);
        }
    }
}

// ---- execution

/// Go from CpuState to the form that translated code has, execute, and come back.
std::uint64_t Translator::enter(Core &core, std::uint64_t until, const Block &block)
{
    CpuState &s = core.state;
    Context &c = context_;
    const Banks banks(s);
    c.outs = banks.bank[1];
    c.ins = banks.bank[3];
    const auto nzvc = s.psr >> 20;
    c.icc = ((nzvc & 8) != 0 ? 1u << 15 : 0) | ((nzvc & 4) != 0 ? 1u << 14 : 0) | ((nzvc & 1) != 0 ? 1u << 8 : 0) |
            ((nzvc & 2) != 0 ? 1 : 0);
    c.fcc = s.fsr >> fsr::fcc_shift & 3;
    // With the nonstandard mode, too, the reference decides about subnormal numbers.
    constexpr std::uint32_t modes = 3u << fsr::rounding_shift | fsr::cexc << fsr::tem_shift;
    c.fp_ready = (s.psr & psr::enable_fpu) != 0 && (s.fsr & modes) == 0 && s.fp_queue.word == 0;
    c.guest_mxcsr = mxcsr_defaults;
    const std::uint64_t end = std::min(until, s.cycles + longest_run);
    c.remaining = static_cast<std::int64_t>(end - s.cycles);

    const std::uint64_t left = emitter_->enter()(&c, &s, memory_.executable(block.entry));

    s.cycles = end - static_cast<std::uint64_t>(c.remaining);
    s.psr = (s.psr & ~psr::icc) | ((c.icc & 1u << 15) != 0 ? psr::negative : 0) |
            ((c.icc & 1u << 14) != 0 ? psr::zero : 0) | ((c.icc & 1u << 8) != 0 ? psr::carry : 0) |
            ((c.icc & 1) != 0 ? psr::overflow : 0);
    s.fsr = (s.fsr & ~fsr::fcc) | c.fcc << fsr::fcc_shift | exceptions(c.guest_mxcsr) << fsr::aexc_shift;
    return left;
}

/// What the last floating-point operation left in cexc and ftt: the reference repeats it, in other registers.
void Translator::settle(Core &core)
{
    const auto op = static_cast<Op>(context_.last_op);
    if (op == Op::illegal) {
        return;
    }
    const bool singles =
        op == Op::fadds || op == Op::fsubs || op == Op::fmuls || op == Op::fdivs || op == Op::fsqrts || op == Op::fstoi;
    CpuState again;
    again.fsr = core.state.fsr;
    again.floats[0] = singles ? context_.last_a << 32 : context_.last_a;
    again.floats[1] = singles ? context_.last_b << 32 : context_.last_b;
    execute_fpop(again, core.fpu, {.op = op, .rd = 4, .rs1 = 0, .rs2 = 2});
    constexpr std::uint32_t settled = fsr::cexc | fsr::ftt;
    core.state.fsr = (core.state.fsr & ~settled) | (again.fsr & settled);
    context_.last_op = static_cast<std::uint32_t>(Op::illegal);
}

/// The reference executes an instruction within a block. True: a debugger watches its access.
bool Translator::execute_site(Core &core, const Site &site)
{
    CpuState &s = core.state;
    s.pc = site.pc;
    s.npc = site.npc_in_target ? context_.target : site.npc;
    s.cycles -= site.cycles;
    s.instructions -= site.instructions;
    if (site.instruction.op >= Op::ldf) {
        settle(core);
    }
    return execute(core, site.instruction);
}

Exit Translator::run(Core &core, std::uint64_t until, bool step_over)
{
    if (core_ != &core) {
        meet(core);
    }
    look_at_flags();
    CpuState &s = core.state;
    Exit exit = Exit::time;
    bool watched = false;
    std::uint32_t link = no_link; // that led to pc
    for (;; step_over = false) {
        const Boundary boundary = at_boundary(core, until, watched, step_over, exit);
        watched = false;
        if (boundary == Boundary::exit) {
            settle(core);
            return exit;
        }
        if (boundary == Boundary::stepped) {
            link = no_link;
            continue;
        }
        if (step_over || s.npc != s.pc + 4) {
            watched = execute_here(core);
            link = no_link;
            continue;
        }
        const std::optional<std::uint32_t> index = block_at(core, s.pc);
        if (!index) {
            link = no_link;
            if (readable(s.pc)) {
                watched = execute_here(core);
                continue;
            }
            exit = run_other(core, std::min(until, s.cycles + elsewhere));
            if (exit != Exit::time) {
                return exit;
            }
            continue;
        }
        Block &block = blocks_[*index];
        const std::uint8_t *code = memory_.executable(block.entry);
        if (link < emitter_->links.size() && emitter_->links[link].pc == s.pc) {
            emitter_->connect(emitter_->links[link], block.entry);
            block.incoming.push_back(link);
        }
        targets_[s.pc / 4 % target_count] = {.pc = s.pc, .code = code};
        link = no_link;

        const std::uint64_t left = enter(core, until, block);
        const auto number = static_cast<std::uint32_t>(left);
        switch (static_cast<Leave>(left >> 32)) {
        case Leave::time:
            s.pc = blocks_[number].pc;
            s.npc = s.pc + 4;
            exit = run_other(core, until);
            if (exit != Exit::time || s.cycles >= until) {
                return exit;
            }
            break;
        case Leave::not_ready:
            s.pc = blocks_[number].pc;
            s.npc = s.pc + 4;
            exit = run_other(core, std::min(until, s.cycles + elsewhere));
            if (exit != Exit::time) {
                return exit;
            }
            break;
        case Leave::link:
            s.pc = emitter_->links[number].pc;
            s.npc = s.pc + 4;
            link = number;
            break;
        case Leave::lookup:
            s.pc = context_.target;
            s.npc = s.pc + 4;
            break;
        case Leave::site: {
            const Site site = emitter_->sites[number];
            watched = execute_site(core, site);
            if (!loads(site.instruction.op)) { // a device may have changed them
                look_at_flags();
            }
            break;
        }
        }
    }
}

} // namespace

std::unique_ptr<Engine> make_translator()
try {
    const Xbyak::util::Cpu host;
    if (host.has(Xbyak::util::Cpu::tAVX)) {
        return std::make_unique<Translator>();
    }
    return make_threaded();
} catch (const std::system_error &) { // the system allows no memory for code
    return make_threaded();
}

} // namespace fledge::emulator

#else

namespace fledge::emulator {

std::unique_ptr<Engine> make_translator()
{
    return make_threaded();
}

} // namespace fledge::emulator

#endif
