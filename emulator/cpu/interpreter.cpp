// SPDX-License-Identifier: Apache-2.0
// The reference interpreter: one instruction after the other, in the words and the order of chapter 5 and appendix B of
// "The SPARC Architecture Manual, Version 8".
#include "emulator/cpu/step.h"

#include <limits>

#include "emulator/cpu/fpu.h"

namespace fledge::emulator {

namespace {

constexpr std::uint32_t sign_bit = 0x80000000u;

class Execution {
public:
    Execution(Core &core, const Instruction &instruction)
        : core_(core), s_(core.state), r_(core.state), i_(instruction), next_npc_(core.state.npc + 4)
    {
    }

    bool watched() const { return watched_; }

    /// Returns the trap that the instruction causes, and then has changed nothing else; or trap::none.
    std::uint32_t perform();

    /// After an instruction without a trap.
    void complete()
    {
        s_.cycles += core_.timing[i_.op];
        s_.instructions++;
        if (annul_) {
            s_.cycles += core_.timing.annulled;
            s_.pc = next_npc_;
            s_.npc = next_npc_ + 4;
        } else {
            s_.pc = s_.npc;
            s_.npc = next_npc_;
        }
    }

private:
    // ---- operands

    std::uint32_t rs1() { return r_[i_.rs1]; }
    std::uint32_t operand2() { return i_.immediate ? static_cast<std::uint32_t>(i_.imm) : r_[i_.rs2]; }

    void set(std::uint32_t r, std::uint32_t value)
    {
        if (r != 0) {
            r_[r] = value;
        }
    }

    bool supervisor() const { return (s_.psr & psr::supervisor) != 0; }
    std::uint32_t carry() const { return (s_.psr & psr::carry) != 0 ? 1 : 0; }

    void set_icc(std::uint32_t result, bool overflow, bool carry_out)
    {
        s_.psr = (s_.psr & ~psr::icc) | ((result & sign_bit) != 0 ? psr::negative : 0) | (result == 0 ? psr::zero : 0) |
                 (overflow ? psr::overflow : 0) | (carry_out ? psr::carry : 0);
    }

    // ---- arithmetic

    std::uint32_t logic(std::uint32_t result, bool cc)
    {
        set(i_.rd, result);
        if (cc) {
            set_icc(result, false, false);
        }
        return trap::none;
    }

    std::uint32_t add(std::uint32_t carry_in, bool cc)
    {
        const std::uint32_t a = rs1(), b = operand2();
        const std::uint64_t sum = std::uint64_t{a} + b + carry_in;
        const auto result = static_cast<std::uint32_t>(sum);
        set(i_.rd, result);
        if (cc) {
            set_icc(result, ((a ^ result) & (b ^ result) & sign_bit) != 0, sum >> 32 != 0);
        }
        return trap::none;
    }

    std::uint32_t subtract(std::uint32_t borrow_in, bool cc)
    {
        const std::uint32_t a = rs1(), b = operand2();
        const std::uint64_t difference = std::uint64_t{a} - b - borrow_in;
        const auto result = static_cast<std::uint32_t>(difference);
        set(i_.rd, result);
        if (cc) {
            set_icc(result, ((a ^ b) & (a ^ result) & sign_bit) != 0, difference >> 32 != 0);
        }
        return trap::none;
    }

    /// The overflow of tagged arithmetic is also that of an operand whose two low bits are not zero.
    std::uint32_t tagged(bool subtraction, bool trapping)
    {
        const std::uint32_t a = rs1(), b = operand2(), result = subtraction ? a - b : a + b;
        const bool carry_out = subtraction ? b > a : result < a;
        const std::uint32_t signs = subtraction ? (a ^ b) & (a ^ result) : (a ^ result) & (b ^ result);
        const bool overflow = (signs & sign_bit) != 0 || ((a | b) & 3) != 0;
        if (overflow && trapping) {
            return trap::tag_overflow;
        }
        set(i_.rd, result);
        set_icc(result, overflow, carry_out);
        return trap::none;
    }

    std::uint32_t multiply_step()
    {
        const bool n = (s_.psr & psr::negative) != 0, v = (s_.psr & psr::overflow) != 0;
        const std::uint32_t multiplicand = rs1();
        const std::uint32_t a = multiplicand >> 1 | (n != v ? sign_bit : 0), b = (s_.y & 1) != 0 ? operand2() : 0;
        const std::uint32_t result = a + b;
        s_.y = s_.y >> 1 | multiplicand << 31;
        set(i_.rd, result);
        set_icc(result, ((a ^ result) & (b ^ result) & sign_bit) != 0, result < a);
        return trap::none;
    }

    std::uint32_t multiply(std::uint64_t product, bool cc)
    {
        s_.y = static_cast<std::uint32_t>(product >> 32);
        return logic(static_cast<std::uint32_t>(product), cc);
    }
    std::uint64_t unsigned_product() { return std::uint64_t{rs1()} * operand2(); }
    std::uint64_t signed_product()
    {
        return static_cast<std::uint64_t>(std::int64_t{static_cast<std::int32_t>(rs1())} *
                                          static_cast<std::int32_t>(operand2()));
    }

    /// A quotient that does not fit becomes the nearest number that does.
    std::uint32_t divide(bool is_signed, bool cc)
    {
        const std::uint64_t dividend = std::uint64_t{s_.y} << 32 | rs1();
        const std::uint32_t divisor = operand2();
        if (divisor == 0) {
            return trap::division_by_zero;
        }
        std::uint32_t result = 0;
        bool overflow = false;
        if (is_signed) {
            // -2^63 / -1 is the one quotient that does not fit into 64 bits.
            const auto a = static_cast<std::int64_t>(dividend);
            const std::int64_t b = static_cast<std::int32_t>(divisor);
            const std::int64_t lowest = std::numeric_limits<std::int32_t>::min();
            const std::int64_t highest = std::numeric_limits<std::int32_t>::max();
            const std::int64_t quotient =
                a == std::numeric_limits<std::int64_t>::min() && b == -1 ? highest + 1 : a / b;
            overflow = quotient < lowest || quotient > highest;
            result = static_cast<std::uint32_t>(quotient < lowest ? lowest : quotient > highest ? highest : quotient);
        } else {
            const std::uint64_t quotient = dividend / divisor;
            overflow = quotient >> 32 != 0;
            result = overflow ? ~0u : static_cast<std::uint32_t>(quotient);
        }
        set(i_.rd, result);
        if (cc) {
            set_icc(result, overflow, false);
        }
        return trap::none;
    }

    // ---- control

    std::uint32_t branch(bool taken, bool always)
    {
        if (taken) {
            next_npc_ = s_.pc + static_cast<std::uint32_t>(i_.imm);
            annul_ = i_.annul && always;
        } else if (i_.annul) {
            annul_ = true;
            next_npc_ = s_.npc + 4;
        }
        return trap::none;
    }

    std::uint32_t jump_and_link()
    {
        const std::uint32_t target = rs1() + operand2();
        if ((target & 3) != 0) {
            return trap::mem_address_not_aligned;
        }
        set(i_.rd, s_.pc);
        next_npc_ = target;
        return trap::none;
    }

    bool invalid(std::uint32_t window) const { return (s_.wim >> window & 1) != 0; }

    /// save (-1) and restore (+1): the operands are of the old window, the result goes into the new one.
    std::uint32_t change_window(std::uint32_t by)
    {
        const std::uint32_t window = ((s_.psr & psr::cwp) + by) % window_count;
        if (invalid(window)) {
            return by == 1 ? trap::window_underflow : trap::window_overflow;
        }
        const std::uint32_t result = rs1() + operand2();
        s_.psr = (s_.psr & ~psr::cwp) | window;
        r_ = Banks(s_);
        set(i_.rd, result);
        return trap::none;
    }

    std::uint32_t return_from_trap()
    {
        const std::uint32_t window = ((s_.psr & psr::cwp) + 1) % window_count, target = rs1() + operand2();
        if ((s_.psr & psr::enable_traps) != 0) {
            return supervisor() ? trap::illegal_instruction : trap::privileged_instruction;
        }
        if (!supervisor()) {
            return trap::privileged_instruction;
        }
        if (invalid(window)) {
            return trap::window_underflow;
        }
        if ((target & 3) != 0) {
            return trap::mem_address_not_aligned;
        }
        s_.psr = (s_.psr & ~(psr::cwp | psr::supervisor)) | window | psr::enable_traps |
                 ((s_.psr & psr::previous_supervisor) != 0 ? psr::supervisor : 0);
        next_npc_ = target;
        return trap::none;
    }

    // ---- state registers

    // As GRLIB's iu3.vhd has them: no read traps; a register that is not there reads as Y, 19 and 21 as 17. stbar is a
    // read of 15 into %g0.
    std::uint32_t read_asr()
    {
        const std::uint64_t count = s_.cycles - s_.counts_from;
        switch (i_.rs1) {
        case 17:
        case 19:
        case 21: return logic(s_.asr17, false);
        case 22: return logic(s_.asr22 | (static_cast<std::uint32_t>(count >> 32) & ~asr::counter_off), false);
        case 23: return logic(static_cast<std::uint32_t>(count), false);
        default: return logic(s_.y, false);
        }
    }

    std::uint32_t write_asr()
    {
        if (i_.rd >= 16 && i_.rd != 18 && !supervisor()) {
            return trap::privileged_instruction;
        }
        const std::uint32_t value = rs1() ^ operand2();
        switch (i_.rd) {
        case 17: s_.asr17 = (s_.asr17 & ~asr::asr17_writable) | (value & asr::asr17_writable); break;
        case 19: s_.mode = Mode::power_down; break;
        case 22: s_.asr22 = value & asr::counter_off; break;
        default: break;
        }
        return trap::none;
    }

    std::uint32_t write_psr()
    {
        const std::uint32_t value = rs1() ^ operand2();
        if ((value & psr::cwp) >= window_count) {
            return trap::illegal_instruction;
        }
        s_.psr = psr::version | (value & psr::writable);
        return trap::none;
    }

    // ---- memory

    /// Where an instruction of memory goes.
    struct Place {
        std::uint32_t address = 0;
        bool control = false; ///< a register of the cache's control, or of an MMU, instead of memory
    };

    std::uint32_t place(Place &p, unsigned size, bool alternate)
    {
        p.address = i_.op == Op::casa ? rs1() : rs1() + (alternate ? r_[i_.rs2] : operand2());
        if (alternate) {
            if (!supervisor() && !(i_.op == Op::casa && i_.asi == 0x0A)) {
                return trap::privileged_instruction;
            }
            const bool pair = size == 8 && (i_.rd & 1) != 0;
            if (i_.immediate || pair) {
                return trap::illegal_instruction;
            }
        }
        if ((p.address & (size - 1)) != 0) {
            return trap::mem_address_not_aligned;
        }
        if (alternate) {
            switch (asi()) {
            case 0x14:
            case 0x15: return trap::data_access_exception; // contexts of an MMU, which this LEON3 does not have
            case 0x0E:                                     // tags of the data cache, by words
                if (size != 4) {
                    return trap::data_access_exception;
                }
                [[fallthrough]];
            case 0x02: // control registers of the caches
            case 0x0C:
            case 0x0D:
            case 0x0F: // what the caches hold
            case 0x10:
            case 0x11: // flush
            case 0x03:
            case 0x04:
            case 0x13:
            case 0x18:
            case 0x19:
            case 0x1D:
            case 0x1E: p.control = true; break; // the MMU
            default: break;                     // memory
            }
        }
        return trap::none;
    }

    std::uint32_t asi() const { return i_.asi & 31u; } ///< the cache looks at five bits (mmu_dcache.vhd)

    std::uint32_t read(const Place &p, unsigned size, std::uint64_t &value)
    {
        if (p.control) {
            value = asi() == 0x02 && p.address == 0 ? s_.cache_control : 0;
            return trap::none;
        }
        const Access access = core_.bus->read(p.address, size, value);
        watched_ |= access == Access::watched;
        return access == Access::fault ? trap::data_access_exception : trap::none;
    }

    std::uint32_t write(const Place &p, unsigned size, std::uint64_t value)
    {
        if (p.control) {
            if (asi() == 0x02 && p.address == 0) {
                constexpr std::uint32_t flush_now = 3u << 21; // a cache without contents has been flushed at once
                s_.cache_control = static_cast<std::uint32_t>(value) & ~flush_now;
            }
            return trap::none;
        }
        const Access access = core_.bus->write(p.address, size, value);
        watched_ |= access == Access::watched;
        const bool traps = access == Access::fault && (s_.asr17 & asr::no_store_errors) == 0;
        return traps ? trap::data_store_error : trap::none;
    }

    std::uint32_t load(unsigned size, bool is_signed, bool alternate)
    {
        Place p;
        std::uint64_t value = 0;
        std::uint32_t t = place(p, size, alternate);
        if (t == trap::none) {
            t = read(p, size, value);
        }
        if (t != trap::none) {
            return t;
        }
        if (size == 8) {
            set(i_.rd, static_cast<std::uint32_t>(value >> 32));
            set(i_.rd + 1u, static_cast<std::uint32_t>(value));
        } else if (is_signed) {
            set(i_.rd, static_cast<std::uint32_t>(size == 1 ? static_cast<std::int8_t>(value)
                                                            : static_cast<std::int16_t>(value)));
        } else {
            set(i_.rd, static_cast<std::uint32_t>(value));
        }
        return trap::none;
    }

    std::uint32_t store(unsigned size, bool alternate)
    {
        Place p;
        const std::uint32_t t = place(p, size, alternate);
        if (t != trap::none) {
            return t;
        }
        std::uint64_t value = r_[i_.rd];
        if (size == 8) {
            value = value << 32 | r_[i_.rd + 1u];
        } else {
            value &= (std::uint64_t{1} << (8 * size)) - 1;
        }
        return write(p, size, value);
    }

    /// Read and write in one: ldstub, swap, casa.
    std::uint32_t exchange(unsigned size, bool alternate, std::uint32_t new_value)
    {
        Place p;
        std::uint64_t old = 0;
        std::uint32_t t = place(p, size, alternate);
        if (t == trap::none) {
            t = read(p, size, old);
        }
        if (t == trap::none) {
            t = write(p, size, new_value);
        }
        if (t == trap::none) {
            set(i_.rd, static_cast<std::uint32_t>(old));
        }
        return t;
    }

    std::uint32_t compare_and_swap()
    {
        const std::uint32_t expected = r_[i_.rs2], new_value = r_[i_.rd];
        Place p;
        std::uint64_t old = 0;
        std::uint32_t t = place(p, 4, true);
        if (t == trap::none) {
            t = read(p, 4, old);
        }
        if (t == trap::none && old == expected) {
            t = write(p, 4, new_value);
        }
        if (t == trap::none) {
            set(i_.rd, static_cast<std::uint32_t>(old));
        }
        return t;
    }

    // ---- floating point

    bool fpu_on() const { return (s_.psr & psr::enable_fpu) != 0; }

    /// The trap of an operation that waits in the queue: the next instruction of the FPU takes it. From then on until
    /// STDFQ has emptied the queue, only stores execute.
    std::uint32_t deferred_trap(bool is_store)
    {
        FpQueue &q = s_.fp_queue;
        if (q.word == 0 || (q.trapped != 0 && is_store)) {
            return trap::none;
        }
        if (q.trapped != 0) {
            s_.fsr = (s_.fsr & ~fsr::ftt) | fsr::sequence_error;
        }
        q.trapped = 1;
        return trap::fp_exception;
    }

    std::uint32_t before_operation() { return fpu_on() ? deferred_trap(false) : trap::fp_disabled; }

    std::uint32_t operate()
    {
        std::uint32_t t = before_operation();
        if (t == trap::none) {
            t = execute_fpop(s_, core_.fpu, i_);
            if (t == trap::fp_exception && core_.fpu == FpuPersonality::grfpu) {
                std::uint32_t word = 0;
                (void)core_.bus->fetch(s_.pc, word);
                s_.fp_queue = {.pc = s_.pc, .word = word};
                t = trap::none;
            }
        }
        return t;
    }

    std::uint32_t store_queue()
    {
        Place p;
        std::uint32_t t = !supervisor() ? trap::privileged_instruction
                          : fpu_on()    ? place(p, 8, false)
                                        : trap::fp_disabled;
        if (t == trap::none) {
            t = s_.fp_queue.word != 0 ? deferred_trap(true) : no_queue(s_);
        }
        if (t == trap::none) {
            t = write(p, 8, std::uint64_t{s_.fp_queue.pc} << 32 | s_.fp_queue.word);
        }
        if (t == trap::none) {
            s_.fp_queue = {};
        }
        return t;
    }

    std::uint32_t load_float(unsigned size)
    {
        Place p;
        std::uint64_t value = 0;
        std::uint32_t t = fpu_on() ? place(p, size, false) : trap::fp_disabled;
        if (t == trap::none) {
            t = deferred_trap(false);
        }
        if (t == trap::none) {
            t = read(p, size, value);
        }
        if (t != trap::none) {
            return t;
        }
        if (i_.op == Op::ldfsr) {
            s_.fsr = (s_.fsr & ~fsr::writable) | (static_cast<std::uint32_t>(value) & fsr::writable);
        } else if (size == 8) {
            s_.floats[i_.rd / 2] = value;
        } else {
            set_single(s_, i_.rd, static_cast<std::uint32_t>(value));
        }
        return trap::none;
    }

    std::uint32_t store_float(unsigned size)
    {
        Place p;
        std::uint32_t t = fpu_on() ? place(p, size, false) : trap::fp_disabled;
        if (t == trap::none) {
            t = deferred_trap(true);
        }
        if (t != trap::none) {
            return t;
        }
        if (i_.op == Op::stfsr) {
            const std::uint32_t queue = s_.fp_queue.word != 0 ? fsr::queue_not_empty : 0;
            return write(p, size, s_.fsr | fsr_version(core_.fpu) | queue);
        }
        return write(p, size, size == 8 ? s_.floats[i_.rd / 2] : single(s_, i_.rd));
    }

    Core &core_;
    CpuState &s_;
    Banks r_;
    const Instruction &i_;
    std::uint32_t next_npc_; ///< what npc will be, or pc if annul_
    bool annul_ = false;     ///< the instruction at npc is skipped
    bool watched_ = false;
};

std::uint32_t Execution::perform()
{
    switch (i_.op) {
    case Op::illegal: return trap::illegal_instruction;
    case Op::cpop:
    case Op::cbccc: return trap::cp_disabled;

    // Control
    case Op::call:
        next_npc_ = s_.pc + static_cast<std::uint32_t>(i_.imm);
        set(15, s_.pc);
        return trap::none;
    case Op::bicc: return branch(condition_holds(i_.condition, s_.psr >> 20), i_.condition == 8);
    case Op::fbfcc:
        if (const std::uint32_t t = before_operation(); t != trap::none) {
            return t;
        }
        return branch(fp_condition_holds(i_.condition, s_.fsr >> 10), i_.condition == 8);
    case Op::jmpl: return jump_and_link();
    case Op::rett: return return_from_trap();
    case Op::ticc:
        return condition_holds(i_.condition, s_.psr >> 20) ? trap::instruction + ((rs1() + operand2()) & 127)
                                                           : trap::none;
    case Op::flush: return trap::none; // a store forgets what was decoded from its bytes
    case Op::save: return change_window(window_count - 1);
    case Op::restore: return change_window(1);

    // Logic and shifts
    case Op::sethi: return logic(static_cast<std::uint32_t>(i_.imm), false);
    case Op::and_: return logic(rs1() & operand2(), false);
    case Op::andcc: return logic(rs1() & operand2(), true);
    case Op::andn: return logic(rs1() & ~operand2(), false);
    case Op::andncc: return logic(rs1() & ~operand2(), true);
    case Op::or_: return logic(rs1() | operand2(), false);
    case Op::orcc: return logic(rs1() | operand2(), true);
    case Op::orn: return logic(rs1() | ~operand2(), false);
    case Op::orncc: return logic(rs1() | ~operand2(), true);
    case Op::xor_: return logic(rs1() ^ operand2(), false);
    case Op::xorcc: return logic(rs1() ^ operand2(), true);
    case Op::xnor: return logic(rs1() ^ ~operand2(), false);
    case Op::xnorcc: return logic(rs1() ^ ~operand2(), true);
    case Op::sll: return logic(rs1() << (operand2() & 31), false);
    case Op::srl: return logic(rs1() >> (operand2() & 31), false);
    case Op::sra:
        return logic(static_cast<std::uint32_t>(static_cast<std::int32_t>(rs1()) >> (operand2() & 31)), false);

    // Arithmetic
    case Op::add: return add(0, false);
    case Op::addcc: return add(0, true);
    case Op::addx: return add(carry(), false);
    case Op::addxcc: return add(carry(), true);
    case Op::sub: return subtract(0, false);
    case Op::subcc: return subtract(0, true);
    case Op::subx: return subtract(carry(), false);
    case Op::subxcc: return subtract(carry(), true);
    case Op::taddcc: return tagged(false, false);
    case Op::taddcctv: return tagged(false, true);
    case Op::tsubcc: return tagged(true, false);
    case Op::tsubcctv: return tagged(true, true);
    case Op::mulscc: return multiply_step();
    case Op::umul: return multiply(unsigned_product(), false);
    case Op::umulcc: return multiply(unsigned_product(), true);
    case Op::smul: return multiply(signed_product(), false);
    case Op::smulcc: return multiply(signed_product(), true);
    case Op::udiv: return divide(false, false);
    case Op::udivcc: return divide(false, true);
    case Op::sdiv: return divide(true, false);
    case Op::sdivcc: return divide(true, true);

    // State registers
    case Op::rdy: return logic(s_.y, false);
    case Op::wry: s_.y = rs1() ^ operand2(); return trap::none;
    case Op::rdasr: return read_asr();
    case Op::wrasr: return write_asr();
    case Op::rdpsr: return supervisor() ? logic(s_.psr, false) : trap::privileged_instruction;
    case Op::rdwim: return supervisor() ? logic(s_.wim, false) : trap::privileged_instruction;
    case Op::rdtbr: return supervisor() ? logic(s_.tbr, false) : trap::privileged_instruction;
    case Op::wrpsr: return supervisor() ? write_psr() : trap::privileged_instruction;
    case Op::wrwim:
        if (!supervisor()) {
            return trap::privileged_instruction;
        }
        s_.wim = (rs1() ^ operand2()) & ((1u << window_count) - 1);
        return trap::none;
    case Op::wrtbr:
        if (!supervisor()) {
            return trap::privileged_instruction;
        }
        s_.tbr = ((rs1() ^ operand2()) & 0xFFFFF000u) | (s_.tbr & 0xFF0u);
        return trap::none;

    // Memory
    case Op::ld: return load(4, false, false);
    case Op::ldub: return load(1, false, false);
    case Op::lduh: return load(2, false, false);
    case Op::ldsb: return load(1, true, false);
    case Op::ldsh: return load(2, true, false);
    case Op::ldd: return load(8, false, false);
    case Op::st: return store(4, false);
    case Op::stb: return store(1, false);
    case Op::sth: return store(2, false);
    case Op::std_: return store(8, false);
    case Op::ldstub: return exchange(1, false, 0xFF);
    case Op::swap: return exchange(4, false, r_[i_.rd]);
    case Op::lda: return load(4, false, true);
    case Op::lduba: return load(1, false, true);
    case Op::lduha: return load(2, false, true);
    case Op::ldsba: return load(1, true, true);
    case Op::ldsha: return load(2, true, true);
    case Op::ldda: return load(8, false, true);
    case Op::sta: return store(4, true);
    case Op::stba: return store(1, true);
    case Op::stha: return store(2, true);
    case Op::stda: return store(8, true);
    case Op::ldstuba: return exchange(1, true, 0xFF);
    case Op::swapa: return exchange(4, true, r_[i_.rd]);
    case Op::casa: return compare_and_swap();

    // Floating point
    case Op::ldf:
    case Op::ldfsr: return load_float(4);
    case Op::lddf: return load_float(8);
    case Op::stf:
    case Op::stfsr: return store_float(4);
    case Op::stdf: return store_float(8);
    case Op::stdfq: return store_queue();
    default: return operate();
    }
}

class Interpreter : public Engine {
public:
    const char *name() const override { return "interpreter"; }

    Exit run(Core &core, std::uint64_t until, bool step_over) override
    {
        Exit exit = Exit::time;
        bool watched = false;
        for (;; step_over = false) {
            switch (at_boundary(core, until, watched, step_over, exit)) {
            case Boundary::exit: return exit;
            case Boundary::stepped: watched = false; break;
            case Boundary::execute: watched = fetch_and_execute(core); break;
            }
        }
    }

    void invalidate(std::uint32_t, std::uint32_t) override {}

    void set_breakpoint(Core &core, std::uint32_t address, bool on) override
    {
        if (on) {
            core.breakpoints.insert(address);
        } else {
            core.breakpoints.erase(address);
        }
    }
};

} // namespace

bool execute(Core &core, const Instruction &instruction)
{
    Execution execution(core, instruction);
    const std::uint32_t trap_type = execution.perform();
    if (trap_type == trap::none) {
        execution.complete();
    } else {
        take_trap(core, trap_type);
    }
    return execution.watched();
}

std::uint32_t effective_address(const CpuState &state, const Instruction &i)
{
    const Banks r(const_cast<CpuState &>(state));
    const auto value = [&r](std::uint32_t n) { return r.bank[n >> 3][n & 7]; };
    return value(i.rs1) + (i.op == Op::casa ? 0 : i.immediate ? static_cast<std::uint32_t>(i.imm) : value(i.rs2));
}

bool fetch_and_execute(Core &core)
{
    std::uint32_t word = 0;
    if (core.bus->fetch(core.state.pc, word) == Access::fault) {
        take_trap(core, trap::instruction_access_exception);
        return false;
    }
    return execute(core, decode(word));
}

std::unique_ptr<Engine> make_interpreter()
{
    return std::make_unique<Interpreter>();
}

} // namespace fledge::emulator
