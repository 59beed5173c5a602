// SPDX-License-Identifier: Apache-2.0
// The bus of a machine: RAM, ROM and devices by their addresses.
//
// Example:
//
//     emulator::SystemBus bus;
//     bus.add_memory(0x40000000, 1 << 20, true, false);
//     std::uint64_t word = 0;
//     bus.write(0x40000010, 4, 0xC0FFEE);
//     if (bus.read(0x40000010, 4, word) != emulator::Access::done) {
//         // nothing is there, or an error that cannot be corrected
//     }
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "emulator/bus/bus.h"
#include "emulator/bus/edac.h"
#include "emulator/devices/device.h"

namespace fledge::emulator {

/// A failed or corrected access, for the AHB status register.
struct BusError {
    std::uint32_t address = 0;
    unsigned size = 4; ///< [bytes]
    bool write = false, corrected = false;
};

/// Addresses [from, to) that the processor cannot write.
struct ProtectedRange {
    std::uint32_t from = 0, to = 0;
    bool operator==(const ProtectedRange &) const = default;
};

struct UnmapBytes {
    std::size_t size;
    void operator()(std::byte *bytes) const;
};

class SystemBus final : public Bus {
public:
    SystemBus() = default;
    SystemBus(const SystemBus &) = delete;
    SystemBus &operator=(const SystemBus &) = delete;

    /// Memory must be added before it is used; RAM first. Sizes and bases are multiples of page_size.
    void add_memory(std::uint32_t base, std::uint32_t size, bool writable, bool edac);
    /// wait: cycles that each access takes more.
    void add_device(std::uint32_t base, std::uint32_t size, Device &device, std::uint32_t wait = 0);
    /// Addresses that a bridge answers where no device is, as an APB's does; elsewhere the access is an error.
    void add_bridge(std::uint32_t base, std::uint32_t size) { bridges_.push_back({base, size}); }

    const Memory &ram() const override { return regions_.front().memory; }
    Access read(std::uint32_t address, unsigned size, std::uint64_t &value) override;
    Access write(std::uint32_t address, unsigned size, std::uint64_t value) override;
    Access fetch(std::uint32_t address, std::uint32_t &word) override;
    void mark_code(std::uint32_t address) override;

    /// Instructions may have changed: the engine forgets what it decoded.
    std::function<void(std::uint32_t address, std::uint32_t size)> code_changed;
    std::function<void(const BusError &)> error;
    std::uint64_t *cycles = nullptr; ///< of the processor: they pass while it waits for a device

    /// The bytes of memory that hold these addresses; empty if they are not all in one memory.
    std::span<std::byte> memory(std::uint32_t address, std::size_t size) const;
    /// Read bytes without side effects: of memory, and of devices' registers. False: neither is there.
    bool peek(std::uint32_t address, std::span<std::byte> bytes) const;
    /// Write bytes without protection and without side effects but those on snapshots and code; or a word of a device,
    /// as the program does. False: neither is there.
    bool poke(std::uint32_t address, std::span<const std::byte> bytes);
    /// All memories one behind the other, by pages: their number, and where one is.
    std::uint32_t pages() const { return pages_; }
    std::span<std::byte> page(std::uint32_t index) const;
    std::uint32_t page_address(std::uint32_t index) const;
    void page_changed(std::uint32_t index); ///< its bytes were replaced

    /// Pages that were written since the last call of all_unchanged, or since they were made.
    const std::vector<std::uint32_t> &changed() const { return changed_; }
    void all_unchanged();
    void forget_code(); ///< another engine starts with nothing decoded

    void protect(std::vector<ProtectedRange> ranges);
    void watch(std::uint32_t address, std::uint32_t size, bool on_read, bool on_write, bool on);
    std::uint32_t watched_at() const { return watched_at_; } ///< where the last watched access was

    /// EDAC of RAM with check bits; without it, memory gives the bits as they are.
    bool has_edac() const { return regions_.front().edac; }
    void enable_edac(bool on) { edac_on_ = on; }
    /// Flip bits of the word at an address of RAM: of its data, and of its check bits, if it has some.
    void flip(std::uint32_t address, EdacFlips flips);
    /// Flip bits of the word that the processor reads next from RAM as data.
    void flip_next_read(std::uint32_t bits);
    /// That read has an error of the bus, which traps.
    void fail_next_read();
    /// Read and correct a word of RAM, as a scrubber does. Reports an error as any access.
    EdacResult scrub(std::uint32_t address);

    /// Flips that are in memory, for snapshots: their words by address.
    const std::map<std::uint32_t, EdacFlips> &flips() const { return flips_; }
    void set_flips(std::map<std::uint32_t, EdacFlips> flips); ///< and none of the next read

private:
    struct Region {
        Memory memory;
        bool writable = false, edac = false;
        std::uint32_t first_page = 0;
        std::unique_ptr<std::byte, UnmapBytes> bytes, code;
        std::vector<std::uint8_t> flags;
    };
    struct Slave {
        std::uint32_t base = 0, size = 0;
        Device *device = nullptr;
        std::uint32_t wait = 0;
    };
    struct Watch {
        std::uint32_t address = 0, size = 0;
        bool on_read = false, on_write = false;
        bool operator==(const Watch &) const = default;
    };

    Region *region(std::uint32_t address);
    const Region *region_of_page(std::uint32_t index) const;
    const Slave *slave(std::uint32_t address) const;
    static bool shows(const Slave &s, std::uint32_t address);
    Access answer_hole(std::uint32_t address, unsigned size, bool write);
    Access refuse(std::uint32_t address, unsigned size, bool write);
    bool watched(std::uint32_t address, unsigned size, bool write);
    void pass(const Slave &s) const;
    Access read_device(const Slave &s, std::uint32_t address, unsigned size, std::uint64_t &value);
    void write_device(const Slave &s, std::uint32_t address, unsigned size, std::uint64_t value);
    EdacResult check(std::uint32_t word, std::uint32_t &correction, bool write);
    bool correct(std::uint32_t word);
    bool read_faulty(std::uint32_t address, unsigned size, std::uint64_t &value);
    bool write_faulty(std::uint32_t address, unsigned size);
    void set_faulty(std::uint32_t address);
    void note_write(Region &r, std::uint32_t address, unsigned size);
    void mark_pages(std::uint8_t flag, const std::vector<ProtectedRange> &ranges);

    std::vector<Region> regions_;
    std::vector<Slave> slaves_, bridges_;
    std::vector<Watch> watches_;
    std::vector<ProtectedRange> protected_;
    std::vector<std::uint32_t> changed_;
    std::map<std::uint32_t, EdacFlips> flips_;
    std::uint64_t read_flag_changes_ = 0;
    std::uint32_t flip_next_ = 0, watched_at_ = 0;
    std::uint32_t pages_ = 0;
    bool edac_on_ = false, fail_next_ = false;
};

} // namespace fledge::emulator
