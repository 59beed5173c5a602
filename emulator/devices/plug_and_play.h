// SPDX-License-Identifier: Apache-2.0
// The tables with which a program finds what is on its buses: read-only words at fixed addresses.
#pragma once

#include <vector>

#include "emulator/devices/device.h"

namespace fledge::emulator {

/// One entry: what a device is, where it is, and its interrupt (0: none).
struct PlugAndPlayEntry {
    Identity identity;
    std::uint32_t address = 0, size = 0, interrupt = 0;
};

class PlugAndPlay final : public Device {
public:
    static constexpr std::uint32_t ahb_address = 0xFFFFF000, apb_address = 0x800FF000, table_size = 0x1000;
    static constexpr std::uint32_t apb_base = 0x80000000, apb_size = 0x100000; ///< the bridge to the slow devices

    explicit PlugAndPlay(std::string name) : Device(std::move(name)), words_(table_size / 4) {}

    /// On the AHB: of a master nothing but the identity counts. A slave is memory: its addresses are multiples of
    /// 1 MiB, and its size counts as the next power of two of them.
    void add_master(const PlugAndPlayEntry &e);
    void add_slave(const PlugAndPlayEntry &e);
    /// On the APB, in units of 256 bytes.
    void add_apb(const PlugAndPlayEntry &e);

    Identity identity() const override { return {}; }
    std::uint32_t read(std::uint32_t offset) override { return words_[offset / 4]; }
    void write(std::uint32_t, std::uint32_t) override {}
    void reset() override {}
    std::span<std::byte> state() override { return {}; }

private:
    std::vector<std::uint32_t> words_;
    std::size_t masters_ = 0, slaves_ = 0, apb_ = 0;
};

} // namespace fledge::emulator
