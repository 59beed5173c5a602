// SPDX-License-Identifier: Apache-2.0
// A board as its TOML file describes it: boards/leon3.toml has every key.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "emulator/devices/register_space.h"
#include "emulator/error.h"

namespace fledge::emulator {

struct MemoryDescription {
    std::uint32_t base = 0, size = 0; ///< [bytes]
    bool edac = false;                ///< each word has check bits
    bool kept = true;                 ///< over a reset of the board; else all bytes are 0 then
};

enum class DeviceKind : std::uint8_t {
    irqmp,
    gptimer,
    apbuart,
    ahbstat,
    ftmctrl,
    scrubber,
    protection,
    registers,
    dsu,
    grspw2,
    report
};
inline constexpr std::size_t device_kinds = static_cast<std::size_t>(DeviceKind::report) + 1;

struct DeviceDescription {
    DeviceKind kind = DeviceKind::irqmp;
    std::string name; ///< the kind, unless the file has another
    int line = 0;     ///< of the file
    std::uint32_t address = 0, size = 0x100;
    std::uint32_t wait = 0; ///< cycles that each access takes more
    std::uint32_t interrupt = 0;
    std::uint32_t timers = 2;        ///< gptimer
    bool watchdog = false;           ///< gptimer: the last timer is one
    double watchdog_after_reset = 0; ///< gptimer [s]; 0: it stands until the program starts it
    bool timed = false;              ///< apbuart: a byte takes its time
    std::uint32_t period = 0;        ///< scrubber: cycles from word to word
    RegisterSpace::Settings registers;
};

struct BoardDescription {
    std::string file, name;
    std::uint64_t hash = 0;  ///< of all that the file says
    std::uint32_t clock = 0; ///< [Hz]
    bool leon3_timing = false, grfpu = true;
    MemoryDescription ram, rom; ///< rom.size 0: there is none
    std::vector<DeviceDescription> devices;

    /// Both throw Error with all mistakes: file, line, what is wrong, and what is allowed.
    static BoardDescription read(const std::string &path);
    static BoardDescription parse(std::string_view text, const std::string &file);
};

} // namespace fledge::emulator
