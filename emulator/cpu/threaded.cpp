// SPDX-License-Identifier: Apache-2.0
// The threaded interpreter: each instruction is decoded once, into a record with the address of the code that executes
// it; that code ends with a jump to the code of the next one. Instructions that are rare, or that trap, go to the
// reference.
//
// Registers of the present window stand in one array while a burst of instructions runs. `d` is the record of the
// instruction at pc, `n` that at npc: a branch only sets `n`, so delay slots need no code of their own.
#include <bit>
#include <cmath>
#include <cstring>
#include <unordered_map>
#include <vector>

#include "emulator/cpu/fpu.h"
#include "emulator/cpu/host_fpu.h"
#include "emulator/cpu/step.h"

namespace fledge::emulator {

namespace {

// clang-format off
// Operations with a register or a number as the second operand: two pieces of code each.
#define FLEDGE_WITH_OPERAND(X)                                                                            \
    X(add) X(and_) X(or_) X(xor_) X(sub) X(andn) X(orn) X(xnor) X(addx) X(subx)                           \
    X(addcc) X(andcc) X(orcc) X(xorcc) X(subcc) X(andncc) X(orncc) X(xnorcc) X(addxcc) X(subxcc)          \
    X(umul) X(smul) X(umulcc) X(smulcc) X(udiv) X(sdiv) X(sll) X(srl) X(sra) X(wry)                       \
    X(jmpl) X(save) X(restore)                                                                            \
    X(ld) X(ldub) X(lduh) X(ldd) X(ldsb) X(ldsh) X(st) X(stb) X(sth) X(std_) X(ldf) X(lddf) X(stf) X(stdf)

// Operations of one form.
#define FLEDGE_OF_ONE_FORM(X)                                                                             \
    X(sethi) X(call) X(rdy)                                                                               \
    X(fmovs) X(fnegs) X(fabss) X(fsqrts) X(fsqrtd) X(fadds) X(faddd) X(fsubs) X(fsubd) X(fmuls) X(fmuld)  \
    X(fdivs) X(fdivd) X(fsmuld) X(fitos) X(fdtos) X(fitod) X(fstod) X(fstoi) X(fdtoi)                     \
    X(fcmps) X(fcmpd) X(fcmpes) X(fcmped)

// The conditions of bicc, from 0 to 15, in terms of the four variables that hold them.
#define FLEDGE_CONDITIONS(X)                                                                              \
    X(0, false)                          X(8, true)                                                       \
    X(1, zero == 0)                      X(9, zero != 0)                                                  \
    X(2, zero == 0 || LESS)              X(10, zero != 0 && !LESS)                                        \
    X(3, LESS)                           X(11, !LESS)                                                     \
    X(4, carry != 0 || zero == 0)        X(12, carry == 0 && zero != 0)                                   \
    X(5, carry != 0)                     X(13, carry == 0)                                                \
    X(6, IS_NEGATIVE(negative))          X(14, !IS_NEGATIVE(negative))                                    \
    X(7, IS_NEGATIVE(overflow))          X(15, !IS_NEGATIVE(overflow))
#define IS_NEGATIVE(x) (static_cast<std::int32_t>(x) < 0)
#define LESS IS_NEGATIVE(negative ^ overflow)
// clang-format on

/// The pieces of code: `pair` is of an operation with a register, the next one of the same with a number.
// clang-format off
enum class Code : std::uint8_t {
    undecoded,           ///< decode the instruction, then execute it
    next_page,           ///< behind the last instruction of a page
    stop,                ///< a breakpoint
    reference,           ///< the reference executes it
    far_bicc, far_fbfcc, ///< a branch to another page
    fbfcc, fbfcc_annul,  ///< a branch in its page, without and with the bit a
#define FLEDGE_CODE(name) name, name##_number,
    FLEDGE_WITH_OPERAND(FLEDGE_CODE)
#undef FLEDGE_CODE
#define FLEDGE_CODE(name) name,
    FLEDGE_OF_ONE_FORM(FLEDGE_CODE)
#undef FLEDGE_CODE
#define FLEDGE_CODE(number, condition) bicc_##number, bicc_##number##_annul,
    FLEDGE_CONDITIONS(FLEDGE_CODE)
#undef FLEDGE_CODE
    count
};
// clang-format on

struct Record {
    const void *code = nullptr; ///< a label of `burst`
    std::uint32_t pc = 0;
    std::int32_t imm = 0;     ///< the number, or the distance to the record of a branch's target [bytes]
    std::uint32_t charge = 0; ///< see charge_of
    std::uint8_t rd = 0, rs1 = 0, rs2 = 0;
};

// A burst counts down in one number: the cycles that are left in the upper bits, the instructions in the lower.
constexpr unsigned count_bits = 24;
constexpr std::uint64_t longest_burst = (1u << count_bits) - 2; ///< [cycles]; an instruction costs at least one
constexpr std::uint32_t charge_of(std::uint32_t cycles)
{
    return (cycles << count_bits) - 1;
}

constexpr std::uint32_t page_words = page_size / 4;
constexpr std::uint32_t sink = 32; ///< where a result for %g0 goes
constexpr std::size_t bank_size = 8 * sizeof(std::uint32_t);

/// The decoded instructions of a page. Behind them, records for pc and npc that have run out of it: a branch in the
/// last word may skip its delay slot.
struct Page {
    std::uint32_t base = 1; ///< no page begins at an odd address
    std::array<Record, page_words + 3> records{};
};

class Threaded : public Engine {
public:
    Threaded()
    {
        Core unused;
        burst(unused, 0, &labels_);
    }

    const char *name() const override { return "threaded"; }
    Exit run(Core &core, std::uint64_t until, bool step_over) override;
    void invalidate(std::uint32_t address, std::uint32_t size) override;

    void set_breakpoint(Core &core, std::uint32_t address, bool on) override
    {
        if (on) {
            core.breakpoints.insert(address);
        } else {
            core.breakpoints.erase(address);
        }
        invalidate(address, 4);
    }

private:
    bool burst(Core &core, std::uint64_t until, const void *const **labels = nullptr);
    void decode_record(const Core &core, Record &record, const Instruction &i) const;
    Record *lookup(std::uint32_t address);
    Record *lookup_slowly(std::uint32_t address);
    Page *known_page(std::uint32_t address) const;
    void begin_page(Page &page, std::uint32_t base) const;
    void settle_exceptions(Core &core);

    const void *label(Code code) const { return labels_[static_cast<std::size_t>(code)]; }

    const void *const *labels_ = nullptr;
    std::uint32_t ram_base_ = 0;
    std::vector<std::unique_ptr<Page>> ram_;                             ///< of the pages of Bus::ram()
    std::unordered_map<std::uint32_t, std::unique_ptr<Page>> elsewhere_; ///< of other memory, by their addresses
    /// For addresses at which no instruction was found yet: pc and npc may stand at two such places.
    Page unknown_[2];
    unsigned last_unknown_ = 0;

    /// The last floating-point operation: fsr.cexc follows from it, when something needs it.
    struct Last {
        Op op = Op::illegal; ///< illegal: fsr.cexc is right
        std::uint64_t a = 0, b = 0;
    } last_;
};

// ---- pages and their records

void Threaded::begin_page(Page &page, std::uint32_t base) const
{
    page.base = base;
    for (std::uint32_t k = 0; k < page.records.size(); k++) {
        page.records[k].pc = base + 4 * k;
        page.records[k].code = label(k < page_words ? Code::undecoded : Code::next_page);
    }
}

inline Page *Threaded::known_page(std::uint32_t address) const
{
    const std::uint32_t number = (address - ram_base_) / page_size;
    if (number < ram_.size()) {
        return ram_[number].get();
    }
    const auto found = elsewhere_.find(address / page_size);
    return found == elsewhere_.end() ? nullptr : found->second.get();
}

inline Record *Threaded::lookup(std::uint32_t address)
{
    Page *page = known_page(address);
    return page != nullptr ? &page->records[address % page_size / 4] : lookup_slowly(address);
}

Record *Threaded::lookup_slowly(std::uint32_t address)
{
    const std::uint32_t base = address - address % page_size, number = (address - ram_base_) / page_size;
    Page *page = nullptr;
    if (number < ram_.size()) {
        ram_[number] = std::make_unique<Page>();
        page = ram_[number].get();
    } else {
        if (unknown_[last_unknown_].base != base) {
            last_unknown_ ^= 1;
        }
        page = &unknown_[last_unknown_];
    }
    if (page->base != base) {
        begin_page(*page, base);
    }
    return &page->records[address % page_size / 4];
}

void Threaded::invalidate(std::uint32_t address, std::uint32_t size)
{
    const std::uint64_t end = std::uint64_t{address} + size;
    for (std::uint64_t a = address & ~3u; a < end;) {
        const std::uint64_t page_end = std::min(end, (a / page_size + 1) * page_size);
        if (Page *page = known_page(static_cast<std::uint32_t>(a)); page != nullptr) {
            for (std::uint64_t word = a % page_size / 4; word < (page_end - a + a % page_size + 3) / 4; word++) {
                page->records[word].code = label(Code::undecoded);
            }
        }
        a = page_end;
    }
}

constexpr Code next(Code code)
{
    return static_cast<Code>(static_cast<unsigned>(code) + 1);
}

/// The code for an operation; where the second operand may be a number, that with a register.
constexpr Code code_of(Op op)
{
    switch (op) {
#define FLEDGE_CODE(name)                                                                                              \
    case Op::name: return Code::name;
        FLEDGE_WITH_OPERAND(FLEDGE_CODE)
        FLEDGE_OF_ONE_FORM(FLEDGE_CODE)
#undef FLEDGE_CODE
    default: return Code::reference;
    }
}

constexpr Code code_of_branch(const Instruction &i, bool in_page)
{
    if (!in_page) {
        return i.op == Op::bicc ? Code::far_bicc : Code::far_fbfcc;
    }
    Code code = Code::fbfcc;
    if (i.op == Op::bicc) {
        switch (i.condition) {
#define FLEDGE_CODE(number, condition)                                                                                 \
    case number: code = Code::bicc_##number; break;
            FLEDGE_CONDITIONS(FLEDGE_CODE)
#undef FLEDGE_CODE
        }
    }
    return i.annul ? next(code) : code;
}

constexpr bool has_operand(Op op)
{
    const Code code = code_of(op);
    return code != Code::reference && code < Code::sethi;
}

/// The place of a floating-point register in CpuState::floats [bytes].
constexpr std::uint8_t place_of(std::uint8_t r, bool is_single)
{
    constexpr unsigned swap = std::endian::native == std::endian::little ? 1 : 0;
    return static_cast<std::uint8_t>(4 * (is_single ? r ^ swap : r & 30));
}

void Threaded::decode_record(const Core &core, Record &record, const Instruction &i) const
{
    record.imm = i.imm;
    record.charge = charge_of(core.timing[i.op]);
    record.rd = i.rd;
    record.rs1 = i.rs1;
    record.rs2 = i.rs2;
    Code code = code_of(i.op);
    switch (i.op) {
    case Op::bicc:
    case Op::fbfcc: {
        const std::uint32_t target = record.pc + static_cast<std::uint32_t>(i.imm);
        const bool in_page = target / page_size == record.pc / page_size;
        code = code_of_branch(i, in_page);
        if (in_page) {
            record.imm = i.imm / 4 * static_cast<std::int32_t>(sizeof(Record));
        }
        record.rd = i.condition;
        record.rs1 = i.annul ? 1 : 0;
        break;
    }
    case Op::ldf:
    case Op::stf: record.rd = place_of(i.rd, true); break;
    case Op::lddf:
    case Op::stdf: record.rd = place_of(i.rd, false); break;
    case Op::st:
    case Op::stb:
    case Op::sth:
    case Op::std_: break;
    case Op::ldd:
        if (i.rd == 0) { // %g1 alone
            code = Code::reference;
        }
        break;
    default:
        if (i.op >= Op::fmovs && i.op < Op::fpop_unimplemented) {
            const bool doubles = i.op == Op::fsqrtd || i.op == Op::faddd || i.op == Op::fsubd || i.op == Op::fmuld ||
                                 i.op == Op::fdivd || i.op == Op::fcmpd || i.op == Op::fcmped;
            const bool to_single = i.op == Op::fdtos || i.op == Op::fdtoi;
            const bool to_double = i.op == Op::fsmuld || i.op == Op::fitod || i.op == Op::fstod;
            record.rd = place_of(i.rd, !doubles && !to_double);
            record.rs1 = place_of(i.rs1, !doubles && !to_single);
            record.rs2 = place_of(i.rs2, !doubles && !to_single);
        } else if (i.rd == 0) {
            record.rd = sink;
        }
        break;
    }
    if (code != Code::reference && has_operand(i.op) && i.immediate) {
        code = next(code);
    }
    record.code = label(code);
}

// ---- execution

template <class T> T at(const void *memory, std::size_t offset)
{
    T value;
    std::memcpy(&value, static_cast<const std::byte *>(memory) + offset, sizeof value);
    return value;
}

template <class T> void put(void *memory, std::size_t offset, T value)
{
    std::memcpy(static_cast<std::byte *>(memory) + offset, &value, sizeof value);
}

/// Between the host's order of bytes and that of memory.
template <class T> T big_endian(T value)
{
    if constexpr (std::endian::native == std::endian::little && sizeof(T) > 1) {
        if constexpr (sizeof(T) == 2) {
            return static_cast<T>(__builtin_bswap16(static_cast<std::uint16_t>(value)));
        } else if constexpr (sizeof(T) == 4) {
            return static_cast<T>(__builtin_bswap32(static_cast<std::uint32_t>(value)));
        } else {
            return static_cast<T>(__builtin_bswap64(static_cast<std::uint64_t>(value)));
        }
    }
    return value;
}

template <class F> auto bits_of(F x)
{
    return std::bit_cast<std::conditional_t<sizeof(F) == 4, std::uint32_t, std::uint64_t>>(x);
}

/// A floating-point number in memory. The compiler must not take it through an integer register, where `has` below
/// wants its bits: that way is longer than the arithmetic.
template <class F> F number_at(const void *memory, std::size_t offset)
{
    using Number [[gnu::may_alias]] = F;
    F x = *reinterpret_cast<const Number *>(static_cast<const std::byte *>(memory) + offset);
#ifdef __SSE2__
    asm("" : "+x"(x));
#endif
    return x;
}

template <class F> void put_number(void *memory, std::size_t offset, F x)
{
    using Number [[gnu::may_alias]] = F;
#ifdef __SSE2__
    asm("" : "+x"(x));
#endif
    *reinterpret_cast<Number *>(static_cast<std::byte *>(memory) + offset) = x;
}

/// The numbers that this file leaves to the reference: the GRFPU's subnormal operands, and its results that are, or
/// were before rounding, below the normal numbers.
struct SmallNumbers {
    std::uint64_t doubles = 0; ///< below it, a subnormal number's bits without sign, times 2, less 1
    std::uint32_t singles = 0;

    explicit SmallNumbers(FpuPersonality fpu)
    {
        if (fpu == FpuPersonality::grfpu) {
            doubles = (std::uint64_t{1} << 53) - 1;
            singles = (1u << 24) - 1;
        }
    }
    bool has(double x) const { return bits_of(x) * 2 - 1 < doubles; }
    bool has(float x) const { return bits_of(x) * 2 - 1 < singles; }
    bool has_result(double x) const { return bits_of(x) * 2 - 1 <= doubles; }
    bool has_result(float x) const { return bits_of(x) * 2 - 1 <= singles; }
};

/// Execute instructions until the time, an instruction for the reference, or a breakpoint. With `labels`, only tell
/// where the pieces of code are.
bool Threaded::burst(Core &core, std::uint64_t until, const void *const **labels)
{
    // clang-format off
    // NOLINTBEGIN(bugprone-macro-parentheses): labels take none
    static const void *const code[] = {
        &&undecoded, &&next_page, &&stop, &&reference, &&far_bicc, &&far_fbfcc, &&fbfcc, &&fbfcc_annul,
#define FLEDGE_CODE(name) &&name, &&name##_number,
        FLEDGE_WITH_OPERAND(FLEDGE_CODE)
#undef FLEDGE_CODE
#define FLEDGE_CODE(name) &&name,
        FLEDGE_OF_ONE_FORM(FLEDGE_CODE)
#undef FLEDGE_CODE
#define FLEDGE_CODE(number, condition) &&bicc_##number, &&bicc_##number##_annul,
        FLEDGE_CONDITIONS(FLEDGE_CODE)
#undef FLEDGE_CODE
    };
    // NOLINTEND(bugprone-macro-parentheses)
    // clang-format on
    static_assert(std::size(code) == static_cast<std::size_t>(Code::count));
    if (labels != nullptr) {
        *labels = code;
        return false;
    }

    CpuState &s = core.state;
    std::uint32_t window = s.psr & psr::cwp;
    std::uint32_t r[33];
    const auto bank = [&s](std::uint32_t w, unsigned half) { return &s.windows[w % window_count * 16 + half * 8]; };
    std::memcpy(r, s.globals.data(), bank_size);
    std::memcpy(r + 8, bank(window, 0), 2 * bank_size);
    std::memcpy(r + 24, bank(window + 1, 0), bank_size);
    constexpr std::uint32_t sign = 0x80000000u;
    std::uint32_t negative = (s.psr & psr::negative) != 0 ? sign : 0; // the sign
    std::uint32_t zero = (s.psr & psr::zero) != 0 ? 0 : 1;            // 0 if the condition holds
    std::uint32_t overflow = (s.psr & psr::overflow) != 0 ? sign : 0; // the sign
    std::uint32_t carry = (s.psr & psr::carry) != 0 ? 1 : 0;
    std::uint32_t fcc = (s.fsr & fsr::fcc) >> fsr::fcc_shift;
    const bool fpu_on = (s.psr & psr::enable_fpu) != 0 && s.fp_queue.word == 0; // else the reference decides
    const bool fpu_fast = fpu_on && (s.fsr & fsr::cexc << fsr::tem_shift) == 0;
    const SmallNumbers small(core.fpu);
    std::uint64_t *const f = s.floats.data();
    const Memory &memory = core.bus->ram();
    const std::uint32_t ram_base = memory.base, ram_size = memory.size;
    std::byte *const ram = memory.bytes;
    const std::uint8_t *const flags = memory.flags, *const decoded = memory.code; // a store beside code is direct

    Record *d = lookup(s.pc), *n = s.npc == s.pc + 4 ? d + 1 : lookup(s.npc);
    const auto chunk = static_cast<std::int64_t>(std::min(until - s.cycles, longest_burst));
    const std::int64_t start = (chunk - 1) << count_bits;
    const std::int64_t annulled_charge = std::int64_t{core.timing.annulled} << count_bits;
    std::int64_t left = start; // negative: the time has come
    enum class WayOut { boundary, reference, no_instruction } way_out = WayOut::boundary;
    HostFpu host(s.fsr);

#define DISPATCH                                                                                                       \
    do {                                                                                                               \
        if (left < 0) [[unlikely]] {                                                                                   \
            goto end;                                                                                                  \
        }                                                                                                              \
        goto * d->code;                                                                                                \
    } while (false)
#define NEXT                                                                                                           \
    do {                                                                                                               \
        left -= d->charge;                                                                                             \
        d = n;                                                                                                         \
        n = n + 1;                                                                                                     \
        DISPATCH;                                                                                                      \
    } while (false)
#define BRANCH_TO(target)                                                                                              \
    do {                                                                                                               \
        Record *const target_ = (target);                                                                              \
        left -= d->charge;                                                                                             \
        d = n;                                                                                                         \
        n = target_;                                                                                                   \
        DISPATCH;                                                                                                      \
    } while (false)
#define ANNUL_AND_GO_TO(target)                                                                                        \
    do {                                                                                                               \
        Record *const target_ = (target);                                                                              \
        left -= d->charge + annulled_charge;                                                                           \
        d = target_;                                                                                                   \
        n = d + 1;                                                                                                     \
        DISPATCH;                                                                                                      \
    } while (false)
#define TARGET (reinterpret_cast<Record *>(reinterpret_cast<std::byte *>(d) + d->imm))

    DISPATCH;

    // ---- what is no instruction

undecoded : {
    const std::uint32_t offset = d->pc - ram_base;
    if (offset < ram_size && (flags[offset / page_size] & page_faulty) != 0) {
        goto reference; // each fetch counts there
    }
    std::uint32_t word = 0;
    if (core.bus->fetch(d->pc, word) == Access::fault) {
        way_out = WayOut::no_instruction;
        goto end;
    }
    if (known_page(d->pc) == nullptr) {
        auto page = std::make_unique<Page>();
        begin_page(*page, d->pc - d->pc % page_size);
        Record *const record = &page->records[d->pc % page_size / 4];
        elsewhere_[d->pc / page_size] = std::move(page);
        n = n == d + 1 ? record + 1 : n;
        d = record;
    }
    decode_record(core, *d, emulator::decode(word));
    if (core.breakpoints.contains(d->pc)) {
        d->code = label(Code::stop);
    }
    core.bus->mark_code(d->pc);
    goto * d->code;
}
next_page : {
    Record *const first = lookup(d->pc);
    n = n == d + 1 ? first + 1 : n;
    d = first;
    goto * d->code;
}
stop:
    goto end;

    // ---- control

#define FLEDGE_CODE(number, condition)                                                                                 \
    bicc_##number : if (condition)                                                                                     \
    {                                                                                                                  \
        BRANCH_TO(TARGET);                                                                                             \
    }                                                                                                                  \
    NEXT;                                                                                                              \
    bicc_##number##_annul : if (condition)                                                                             \
    {                                                                                                                  \
        if constexpr ((number) == 8) {                                                                                 \
            ANNUL_AND_GO_TO(TARGET);                                                                                   \
        } else {                                                                                                       \
            BRANCH_TO(TARGET);                                                                                         \
        }                                                                                                              \
    }                                                                                                                  \
    ANNUL_AND_GO_TO(n + 1);
    FLEDGE_CONDITIONS(FLEDGE_CODE)
#undef FLEDGE_CODE

fbfcc:
    if (!fpu_on) {
        goto reference;
    }
    if (fp_condition_holds(d->rd, fcc)) {
        BRANCH_TO(TARGET);
    }
    NEXT;
fbfcc_annul:
    if (!fpu_on) {
        goto reference;
    }
    if (d->rd == 8) {
        ANNUL_AND_GO_TO(TARGET);
    }
    if (fp_condition_holds(d->rd, fcc)) {
        BRANCH_TO(TARGET);
    }
    ANNUL_AND_GO_TO(n + 1);

    bool taken;
far_fbfcc:
    if (!fpu_on) {
        goto reference;
    }
    taken = fp_condition_holds(d->rd, fcc);
    goto far_branch;
far_bicc:
    taken = condition_holds(d->rd, negative >> 31 << 3 | (zero == 0 ? 4 : 0) | overflow >> 31 << 1 | carry);
far_branch : {
    const bool annul = d->rs1 != 0;
    if (taken) {
        Record *const target = lookup(d->pc + static_cast<std::uint32_t>(d->imm));
        if (annul && d->rd == 8) {
            ANNUL_AND_GO_TO(target);
        }
        BRANCH_TO(target);
    }
    if (annul) {
        ANNUL_AND_GO_TO(n + 1);
    }
    NEXT;
}

call:
    r[15] = d->pc;
    BRANCH_TO(lookup(d->pc + static_cast<std::uint32_t>(d->imm)));

    // The two forms of an operation: `a` is r[rs1], `b` the second operand.
#define WITH_OPERAND(name, ...)                                                                                        \
    name : {                                                                                                           \
        const std::uint32_t a = r[d->rs1], b = r[d->rs2];                                                              \
        __VA_ARGS__                                                                                                    \
    }                                                                                                                  \
    name##_number:                                                                                                     \
    {                                                                                                                  \
        const std::uint32_t a = r[d->rs1], b = static_cast<std::uint32_t>(d->imm);                                     \
        __VA_ARGS__                                                                                                    \
    }

    WITH_OPERAND(jmpl, {
        const std::uint32_t target = a + b;
        if ((target & 3) != 0) {
            goto reference;
        }
        r[d->rd] = d->pc;
        BRANCH_TO(lookup(target));
    })

    // The windows: locals and the outer end of the present one go to memory, those of the new one come from there.
    WITH_OPERAND(save, {
        const std::uint32_t to = (window + window_count - 1) % window_count;
        const std::uint32_t result = a + b;
        if ((s.wim >> to & 1) != 0) {
            goto reference;
        }
        std::memcpy(bank(window + 1, 0), r + 24, bank_size);
        std::memcpy(bank(window, 1), r + 16, bank_size);
        std::memcpy(r + 24, r + 8, bank_size);
        std::memcpy(r + 8, bank(to, 0), 2 * bank_size);
        window = to;
        r[d->rd] = result;
        NEXT;
    })
    WITH_OPERAND(restore, {
        const std::uint32_t to = (window + 1) % window_count;
        const std::uint32_t result = a + b;
        if ((s.wim >> to & 1) != 0) {
            goto reference;
        }
        std::memcpy(bank(window, 0), r + 8, 2 * bank_size);
        std::memcpy(r + 8, r + 24, bank_size);
        std::memcpy(r + 16, bank(to, 1), bank_size);
        std::memcpy(r + 24, bank(to + 1, 0), bank_size);
        window = to;
        r[d->rd] = result;
        NEXT;
    })

    // ---- integers

sethi:
    r[d->rd] = static_cast<std::uint32_t>(d->imm);
    NEXT;
rdy:
    r[d->rd] = s.y;
    NEXT;
    WITH_OPERAND(wry, s.y = a ^ b; NEXT;)

#define RESULT(expression)                                                                                             \
    r[d->rd] = (expression);                                                                                           \
    NEXT;
    WITH_OPERAND(add, RESULT(a + b))
    WITH_OPERAND(addx, RESULT(a + b + carry))
    WITH_OPERAND(sub, RESULT(a - b))
    WITH_OPERAND(subx, RESULT(a - b - carry))
    WITH_OPERAND(and_, RESULT(a & b))
    WITH_OPERAND(andn, RESULT(a & ~b))
    WITH_OPERAND(or_, RESULT(a | b))
    WITH_OPERAND(orn, RESULT(a | ~b))
    WITH_OPERAND(xor_, RESULT(a ^ b))
    WITH_OPERAND(xnor, RESULT(a ^ ~b))
    WITH_OPERAND(sll, RESULT(a << (b & 31)))
    WITH_OPERAND(srl, RESULT(a >> (b & 31)))
    WITH_OPERAND(sra, RESULT(static_cast<std::uint32_t>(static_cast<std::int32_t>(a) >> (b & 31))))

#define LOGIC_CC(expression)                                                                                           \
    negative = zero = (expression);                                                                                    \
    r[d->rd] = zero;                                                                                                   \
    overflow = carry = 0;                                                                                              \
    NEXT;
    WITH_OPERAND(andcc, LOGIC_CC(a & b))
    WITH_OPERAND(andncc, LOGIC_CC(a & ~b))
    WITH_OPERAND(orcc, LOGIC_CC(a | b))
    WITH_OPERAND(orncc, LOGIC_CC(a | ~b))
    WITH_OPERAND(xorcc, LOGIC_CC(a ^ b))
    WITH_OPERAND(xnorcc, LOGIC_CC(a ^ ~b))

#define SUM_CC(wide, signs)                                                                                            \
    const std::uint64_t wide_ = (wide);                                                                                \
    const auto result = static_cast<std::uint32_t>(wide_);                                                             \
    negative = zero = result;                                                                                          \
    overflow = (signs);                                                                                                \
    carry = static_cast<std::uint32_t>(wide_ >> 32) & 1;                                                               \
    r[d->rd] = result;                                                                                                 \
    NEXT;
    WITH_OPERAND(addcc, SUM_CC(std::uint64_t{a} + b, (a ^ result) & (b ^ result)))
    WITH_OPERAND(addxcc, SUM_CC(std::uint64_t{a} + b + carry, (a ^ result) & (b ^ result)))
    WITH_OPERAND(subcc, SUM_CC(std::uint64_t{a} - b, (a ^ b) & (a ^ result)))
    WITH_OPERAND(subxcc, SUM_CC(std::uint64_t{a} - b - carry, (a ^ b) & (a ^ result)))

#define PRODUCT(...)                                                                                                   \
    const auto product = static_cast<std::uint64_t>(__VA_ARGS__);                                                      \
    s.y = static_cast<std::uint32_t>(product >> 32);
#define SIGNED_PRODUCT (std::int64_t{static_cast<std::int32_t>(a)} * static_cast<std::int32_t>(b))
    WITH_OPERAND(umul, PRODUCT(std::uint64_t{a} * b) RESULT(static_cast<std::uint32_t>(product)))
    WITH_OPERAND(smul, PRODUCT(SIGNED_PRODUCT) RESULT(static_cast<std::uint32_t>(product)))
    WITH_OPERAND(umulcc, PRODUCT(std::uint64_t{a} * b) LOGIC_CC(static_cast<std::uint32_t>(product)))
    WITH_OPERAND(smulcc, PRODUCT(SIGNED_PRODUCT) LOGIC_CC(static_cast<std::uint32_t>(product)))
    // Those whose dividend fits into 32 bits.
    WITH_OPERAND(
        udiv, if (b == 0 || s.y != 0) { goto reference; } RESULT(a / b))
    WITH_OPERAND(
        sdiv, if (b == 0 || b == ~0u || s.y != (IS_NEGATIVE(a) ? ~0u : 0)) {
            goto reference;
        } RESULT(static_cast<std::uint32_t>(static_cast<std::int32_t>(a) / static_cast<std::int32_t>(b))))

    // ---- memory

#define PLACE(size, slow)                                                                                              \
    const std::uint32_t address = a + b, offset = address - ram_base;                                                  \
    if (offset >= ram_size || (address & ((size)-1)) != 0) [[unlikely]] {                                              \
        goto reference;                                                                                                \
    }                                                                                                                  \
    if (const std::uint8_t flag = flags[offset / page_size] & (slow); flag != 0) [[unlikely]] {                        \
        if (flag != page_code || decoded[offset / 4] != 0 || decoded[(offset + (size)-1) / 4] != 0) {                  \
            goto reference;                                                                                            \
        }                                                                                                              \
    }
#define LOAD(type, to)                                                                                                 \
    PLACE(sizeof(type), page_slow_read)                                                                                \
    const type value = big_endian(at<type>(ram, offset));                                                              \
    to NEXT;
#define STORE(type, value)                                                                                             \
    PLACE(sizeof(type), page_slow_write)                                                                               \
    put<type>(ram, offset, big_endian(static_cast<type>(value)));                                                      \
    NEXT;
#define FPU_ON                                                                                                         \
    if (!fpu_on) [[unlikely]] {                                                                                        \
        goto reference;                                                                                                \
    }
    WITH_OPERAND(ld, LOAD(std::uint32_t, r[d->rd] = value;))
    WITH_OPERAND(ldub, LOAD(std::uint8_t, r[d->rd] = value;))
    WITH_OPERAND(lduh, LOAD(std::uint16_t, r[d->rd] = value;))
    WITH_OPERAND(ldsb, LOAD(std::int8_t, r[d->rd] = static_cast<std::uint32_t>(std::int32_t{value});))
    WITH_OPERAND(ldsh, LOAD(std::int16_t, r[d->rd] = static_cast<std::uint32_t>(std::int32_t{value});))
    WITH_OPERAND(ldd, LOAD(std::uint64_t, r[d->rd] = static_cast<std::uint32_t>(value >> 32);
                           r[d->rd + 1] = static_cast<std::uint32_t>(value);))
    WITH_OPERAND(ldf, FPU_ON LOAD(std::uint32_t, put(f, d->rd, value);))
    WITH_OPERAND(lddf, FPU_ON LOAD(std::uint64_t, put(f, d->rd, value);))
    WITH_OPERAND(st, STORE(std::uint32_t, r[d->rd]))
    WITH_OPERAND(stb, STORE(std::uint8_t, r[d->rd]))
    WITH_OPERAND(sth, STORE(std::uint16_t, r[d->rd]))
    WITH_OPERAND(std_, STORE(std::uint64_t, std::uint64_t{r[d->rd]} << 32 | r[d->rd + 1]))
    WITH_OPERAND(stf, FPU_ON STORE(std::uint32_t, at<std::uint32_t>(f, d->rd)))
    WITH_OPERAND(stdf, FPU_ON STORE(std::uint64_t, at<std::uint64_t>(f, d->rd)))

    // ---- floating point. NaNs, and what else SPARC decides otherwise than the host, go to the reference. The host's
    // flags may then be set already, but only by exceptions that the reference finds, too.

#define FPU_FAST                                                                                                       \
    if (!fpu_fast) [[unlikely]] {                                                                                      \
        goto reference;                                                                                                \
    }
#define REMEMBER(name, first, second)                                                                                  \
    last_.op = Op::name;                                                                                               \
    put_number(&last_.a, 0, first);                                                                                    \
    put_number(&last_.b, 0, second);
#define FINISH(name, first, second, value)                                                                             \
    if (std::isnan(value) || small.has_result(value)) [[unlikely]] {                                                   \
        goto reference;                                                                                                \
    }                                                                                                                  \
    REMEMBER(name, first, second)                                                                                      \
    put_number(f, d->rd, value);                                                                                       \
    NEXT;
#define BINARY(name, From, To, expression)                                                                             \
    name : {                                                                                                           \
        FPU_FAST const From a = number_at<From>(f, d->rs1), b = number_at<From>(f, d->rs2);                            \
        if (small.has(a) || small.has(b)) [[unlikely]] {                                                               \
            goto reference;                                                                                            \
        }                                                                                                              \
        const To result = (expression);                                                                                \
        FINISH(name, a, b, result)                                                                                     \
    }
#define UNARY(name, From, To, expression)                                                                              \
    name : {                                                                                                           \
        FPU_FAST const From b = number_at<From>(f, d->rs2);                                                            \
        if (small.has(b)) [[unlikely]] {                                                                               \
            goto reference;                                                                                            \
        }                                                                                                              \
        const To result = (expression);                                                                                \
        FINISH(name, b, b, result)                                                                                     \
    }
    BINARY(fadds, float, float, a + b)
    BINARY(faddd, double, double, a + b)
    BINARY(fsubs, float, float, a - b)
    BINARY(fsubd, double, double, a - b)
    BINARY(fmuls, float, float, a *b)
    BINARY(fmuld, double, double, a *b)
    BINARY(fdivs, float, float, a / b)
    BINARY(fdivd, double, double, a / b)
    BINARY(fsmuld, float, double, double{a} * double{b})
    UNARY(fsqrts, float, float, std::sqrt(b))
    UNARY(fsqrtd, double, double, std::sqrt(b))
    UNARY(fstod, float, double, double{b})
    UNARY(fdtos, double, float, static_cast<float>(b))

#define FROM_INTEGER(name, To)                                                                                         \
    name : {                                                                                                           \
        FPU_FAST const auto integer = at<std::int32_t>(f, d->rs2);                                                     \
        last_.op = Op::name;                                                                                           \
        put(&last_.b, 0, integer);                                                                                     \
        put_number(f, d->rd, static_cast<To>(integer));                                                                \
        NEXT;                                                                                                          \
    }
    FROM_INTEGER(fitos, float)
    FROM_INTEGER(fitod, double)
#define TO_INTEGER(name, From)                                                                                         \
    name : {                                                                                                           \
        FPU_FAST const From b = number_at<From>(f, d->rs2);                                                            \
        if (small.has(b) || !(double{b} > -2147483649.0 && double{b} < 2147483648.0)) [[unlikely]] {                   \
            goto reference;                                                                                            \
        }                                                                                                              \
        REMEMBER(name, b, b)                                                                                           \
        put(f, d->rd, static_cast<std::int32_t>(b));                                                                   \
        NEXT;                                                                                                          \
    }
    TO_INTEGER(fstoi, float)
    TO_INTEGER(fdtoi, double)
#define COMPARE(name, From)                                                                                            \
    name : {                                                                                                           \
        FPU_FAST const From a = number_at<From>(f, d->rs1), b = number_at<From>(f, d->rs2);                            \
        if (__builtin_isunordered(a, b)) [[unlikely]] {                                                                \
            goto reference;                                                                                            \
        }                                                                                                              \
        REMEMBER(name, a, b)                                                                                           \
        fcc = (a < b ? 1u : 0u) | (a > b ? 2u : 0u);                                                                   \
        NEXT;                                                                                                          \
    }
    COMPARE(fcmps, float)
    COMPARE(fcmpd, double)
    COMPARE(fcmpes, float)
    COMPARE(fcmped, double)

#define MOVE(name, expression)                                                                                         \
    name : {                                                                                                           \
        FPU_FAST const auto bits = at<std::uint32_t>(f, d->rs2);                                                       \
        last_.op = Op::name;                                                                                           \
        put(f, d->rd, static_cast<std::uint32_t>(expression));                                                         \
        NEXT;                                                                                                          \
    }
    MOVE(fmovs, bits)
    MOVE(fnegs, bits ^ sign)
    MOVE(fabss, bits & ~sign)

reference:
    way_out = WayOut::reference;
end:
    s.fsr = (s.fsr & ~fsr::fcc) | fcc << fsr::fcc_shift | host.leave() << fsr::aexc_shift;
    std::memcpy(s.globals.data(), r, bank_size);
    std::memcpy(bank(window, 0), r + 8, 2 * bank_size);
    std::memcpy(bank(window + 1, 0), r + 24, bank_size);
    s.psr = (s.psr & ~(psr::icc | psr::cwp)) | window | (IS_NEGATIVE(negative) ? psr::negative : 0) |
            (zero == 0 ? psr::zero : 0) | (IS_NEGATIVE(overflow) ? psr::overflow : 0) | (carry != 0 ? psr::carry : 0);
    s.pc = d->pc;
    s.npc = n->pc;
    const auto done = static_cast<std::uint64_t>(start - left); // cycles << count_bits, less the instructions
    const std::uint64_t instructions = (0 - done) & ((std::uint64_t{1} << count_bits) - 1);
    s.instructions += instructions;
    s.cycles += (done + instructions) >> count_bits;
    if (way_out == WayOut::boundary) {
        return false;
    }
    std::uint32_t word = 0;
    if (way_out == WayOut::no_instruction || core.bus->fetch(s.pc, word) == Access::fault) {
        take_trap(core, trap::instruction_access_exception);
        return false;
    }
    const Instruction instruction = emulator::decode(word);
    if (instruction.op >= Op::ldf) {
        settle_exceptions(core);
    }
    return execute(core, instruction);
}

/// fsr.cexc and ftt as the last operation left them.
void Threaded::settle_exceptions(Core &core)
{
    if (last_.op == Op::illegal) {
        return;
    }
    // The reference repeats it, in other registers.
    const bool doubles = last_.op == Op::fsqrtd || last_.op == Op::faddd || last_.op == Op::fsubd ||
                         last_.op == Op::fmuld || last_.op == Op::fdivd || last_.op == Op::fcmpd ||
                         last_.op == Op::fcmped || last_.op == Op::fdtos || last_.op == Op::fdtoi;
    CpuState again;
    again.fsr = core.state.fsr;
    const auto operand = [doubles](const std::uint64_t &kept) {
        return doubles ? kept : std::uint64_t{at<std::uint32_t>(&kept, 0)} << 32;
    };
    again.floats[0] = operand(last_.a);
    again.floats[1] = operand(last_.b);
    execute_fpop(again, core.fpu, {.op = last_.op, .rd = 4, .rs1 = 0, .rs2 = 2});
    constexpr std::uint32_t settled = fsr::cexc | fsr::ftt;
    core.state.fsr = (core.state.fsr & ~settled) | (again.fsr & settled);
    last_.op = Op::illegal;
}

Exit Threaded::run(Core &core, std::uint64_t until, bool step_over)
{
    const Memory &memory = core.bus->ram();
    ram_base_ = memory.base;
    ram_.resize(memory.size / page_size);
    Exit exit = Exit::time;
    bool watched = false;
    for (;; step_over = false) {
        switch (at_boundary(core, until, watched, step_over, exit)) {
        case Boundary::exit: settle_exceptions(core); return exit;
        case Boundary::stepped: watched = false; break;
        case Boundary::execute: watched = step_over ? fetch_and_execute(core) : burst(core, until); break;
        }
    }
}

} // namespace

std::unique_ptr<Engine> make_threaded()
{
    return std::make_unique<Threaded>();
}

} // namespace fledge::emulator
