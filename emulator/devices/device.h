// SPDX-License-Identifier: Apache-2.0
// A device on the bus: words at offsets, a next time at which it does something, and its state as plain bytes.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace fledge::emulator {

inline constexpr std::uint64_t never = std::numeric_limits<std::uint64_t>::max();

/// What a device may ask of its machine.
class DeviceHost {
public:
    virtual ~DeviceHost() = default;
    virtual std::uint64_t cycles() const = 0;
    virtual void raise(std::uint32_t line) = 0; ///< an interrupt, 1 to 15
    virtual void reset() = 0;                   ///< of the whole board, behind this instruction: the watchdog
    virtual void changed() = 0;                 ///< the device's next_event has changed
};

/// What the plug-and-play tables say of a device.
struct Identity {
    std::uint32_t vendor = 0, device = 0, version = 0;
};

/// A word of a device for debuggers; to read it changes nothing.
struct DeviceRegister {
    std::string name;
    std::uint32_t offset = 0;
};

class Device {
public:
    explicit Device(std::string name) : name_(std::move(name)) {}
    virtual ~Device() = default;
    Device(const Device &) = delete;
    Device &operator=(const Device &) = delete;

    std::string_view name() const { return name_; }
    virtual Identity identity() const = 0;
    virtual std::uint32_t read(std::uint32_t offset) = 0; ///< a word; offset is a multiple of 4
    virtual void write(std::uint32_t offset, std::uint32_t value) = 0;
    /// Whether a byte can be stored by itself. Else all four bytes of the bus carry it, as on an APB.
    virtual bool is_memory() const { return false; }
    virtual std::uint64_t next_event() const { return never; } ///< [cycles]
    virtual void act() {}                                      ///< the time of next_event has come
    virtual void reset() = 0;
    virtual std::span<std::byte> state() = 0; ///< all of it; a snapshot copies it
    virtual void restored() {}                ///< the bytes of state() are those of a snapshot
    virtual std::vector<DeviceRegister> registers() const { return {}; }

private:
    std::string name_;
};

/// The bytes of a struct of a device.
template <typename State> std::span<std::byte> bytes_of(State &state)
{
    static_assert(std::is_trivially_copyable_v<State>);
    return std::as_writable_bytes(std::span(&state, 1));
}

} // namespace fledge::emulator
