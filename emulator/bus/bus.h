// SPDX-License-Identifier: Apache-2.0
// What the processor reads and writes: memory, and devices, by their addresses. All data are big-endian, as SPARC has
// them; memory holds them in this order, so the bytes of an ELF, of gdb and of a shared file need no change.
#pragma once

#include <cstddef>
#include <cstdint>

namespace fledge::emulator {

/// Why an access to a page of memory takes the slow way.
enum PageFlags : std::uint8_t {
    page_code = 1 << 0,        ///< instructions of it are decoded or translated: Memory::code says which
    page_protected = 1 << 1,   ///< a write traps
    page_watch_write = 1 << 2, ///< a debugger watches it
    page_watch_read = 1 << 3,
    page_faulty = 1 << 4,    ///< it holds words whose check bits do not agree: EDAC looks at each access
    page_unchanged = 1 << 5, ///< as in the last snapshot: the bus notes the first write
    page_slow_write = page_code | page_protected | page_watch_write | page_faulty | page_unchanged,
    page_slow_read = page_watch_read | page_faulty
};

inline constexpr std::uint32_t page_size = 4096;

/// A range of addresses that is memory. Both base and size are multiples of page_size. It stays where it is as long as
/// the machine lives.
struct Memory {
    std::uint32_t base = 0, size = 0; ///< [bytes]
    std::byte *bytes = nullptr;
    std::uint8_t *flags = nullptr; ///< PageFlags of each page
    /// Of each word, whether it was decoded: a write invalidates it. Where page_code alone is set, and these are 0, an
    /// engine may write directly.
    std::uint8_t *code = nullptr;
    /// How often a flag of page_slow_read has changed in any page; nullptr: this is not counted.
    const std::uint64_t *read_flag_changes = nullptr;
};

enum class Access : std::uint8_t {
    done,
    fault,  ///< nothing is there, it is protected, or its error cannot be corrected: the instruction traps
    watched ///< done, and a debugger wants to stop behind this instruction
};

/// The slow way for all, and what fast ways need. Engines access `ram()` themselves where the flags of the page
/// allow it.
class Bus {
public:
    virtual ~Bus() = default;

    /// The memory where programs run.
    virtual const Memory &ram() const = 0;

    /// An aligned access of 1, 2, 4 or 8 bytes; a value stands in the low bits. Of a device, 8 bytes are two words.
    virtual Access read(std::uint32_t address, unsigned size, std::uint64_t &value) = 0;
    virtual Access write(std::uint32_t address, unsigned size, std::uint64_t value) = 0;

    /// An instruction.
    virtual Access fetch(std::uint32_t address, std::uint32_t &word) = 0;

    /// The word, which is in memory, is decoded from now on; the engine is called when it is written.
    virtual void mark_code(std::uint32_t address) = 0;
};

} // namespace fledge::emulator
