// SPDX-License-Identifier: Apache-2.0
#include "emulator/board.h"

// toml++ asserts in its parser what damaged files do not keep, and takes care of them afterwards.
#define TOML_ASSERT(condition) static_assert(true)
#include <toml++/toml.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <iterator>
#include <optional>
#include <sstream>

#include "emulator/bus/bus.h"
#include "emulator/devices/debug_unit.h"
#include "emulator/devices/gptimer.h"
#include "emulator/devices/plug_and_play.h"

namespace fledge::emulator {

namespace {

struct Kind {
    const char *name;
    std::vector<std::string> keys; ///< besides kind, name and address
};

const std::array<Kind, device_kinds> &kinds()
{
    static const std::array<Kind, device_kinds> all{{{"irqmp", {}},
                                                     {"gptimer", {"interrupt", "timers", "watchdog"}},
                                                     {"apbuart", {"interrupt", "timed"}},
                                                     {"ahbstat", {"interrupt"}},
                                                     {"ftmctrl", {}},
                                                     {"scrubber", {"period"}},
                                                     {"protection", {}},
                                                     {"registers", {"size", "tick", "interrupt", "lines"}},
                                                     {"dsu", {}},
                                                     {"grspw2", {}},
                                                     {"report", {}}}};
    return all;
}

std::string listed(const std::vector<std::string> &names)
{
    std::string text;
    for (const std::string &name : names) {
        text += (text.empty() ? "" : ", ") + name;
    }
    return text;
}

std::string hex(std::uint64_t value)
{
    std::ostringstream text;
    text << "0x" << std::hex << std::uppercase << value;
    return text.str();
}

constexpr int levels = 32; ///< of tables in tables: toml++ would run out of stack

/// The line of a key with more parts than that; 0 if there is none.
std::uint32_t line_of_deep_key(std::string_view text)
{
    std::uint32_t line = 1;
    int dots = 0;
    char until = '\0'; // the end of a text or comment
    for (const char c : text) {
        if (c == '\n') {
            line++;
            dots = 0;
            until = '\0';
        } else if (until != '\0') {
            until = c == until ? '\0' : until;
        } else if (c == '"' || c == '\'' || c == '#') {
            until = c == '#' ? '\n' : c;
        } else if (c == '[' || c == '{' || c == ',' || c == '=') {
            dots = 0;
        } else if (c == '.' && ++dots >= levels) {
            return line;
        }
    }
    return 0;
}

class Parser {
public:
    Parser(std::string_view text, const std::string &file) : file_(file)
    {
        if (const std::uint32_t line = line_of_deep_key(text)) {
            mistake(line, "a key has at most " + std::to_string(levels) + " parts");
            return;
        }
        try {
            table_ = toml::parse(text, file);
        } catch (const toml::parse_error &e) {
            mistake(e.source().begin.line, std::string(e.description()));
        }
    }

    BoardDescription board()
    {
        BoardDescription b;
        b.file = file_;
        if (errors_.empty()) {
            read_board(b);
        }
        if (errors_.empty()) {
            check_places(b);
        }
        if (!errors_.empty()) {
            throw Error(errors_);
        }
        std::ostringstream canonical;
        canonical << toml::default_formatter(table_);
        b.hash = 0xCBF29CE484222325; // FNV-1a
        for (const char c : canonical.str()) {
            b.hash = (b.hash ^ static_cast<unsigned char>(c)) * 0x100000001B3;
        }
        return b;
    }

private:
    void mistake(std::uint32_t line, const std::string &what)
    {
        errors_ += (errors_.empty() ? "" : "\n") + file_ + ":" + std::to_string(line) + ": " + what;
    }

    void allow(const toml::table &t, const std::vector<std::string> &keys)
    {
        for (const auto &[key, node] : t) {
            if (std::find(keys.begin(), keys.end(), key.str()) == keys.end()) {
                mistake(key.source().begin.line,
                        "unknown key `" + std::string(key.str()) + "`; choose of: " + listed(keys));
            }
        }
    }

    /// The value of a key; `expected` says in words what `valid` accepts. A missing key gives `usual`, or is a mistake.
    template <typename T, typename Valid>
    T value(const toml::table &t, const char *key, const std::string &expected, std::optional<T> usual, Valid valid)
    {
        const toml::node *node = t.get(key);
        if (!node) {
            if (!usual) {
                mistake(t.source().begin.line, std::string("`") + key + "` is missing: " + expected);
            }
            return usual.value_or(T{});
        }
        const auto found = std::is_same_v<T, double> ? node->value<T>() : node->value_exact<T>();
        if (!found || !valid(*found)) {
            std::ostringstream text;
            node->visit([&](const auto &n) { text << n; });
            mistake(node->source().begin.line,
                    std::string("`") + key + "` must be " + expected + ", found " + text.str());
            return usual.value_or(T{});
        }
        return *found;
    }

    std::uint32_t number(const toml::table &t, const char *key, std::int64_t least, std::int64_t most,
                         std::optional<std::int64_t> usual)
    {
        const std::string expected = "a whole number from " + std::to_string(least) + " to " + std::to_string(most);
        return static_cast<std::uint32_t>(
            value<std::int64_t>(t, key, expected, usual, [&](std::int64_t v) { return v >= least && v <= most; }));
    }
    /// A multiple of `unit`.
    std::uint32_t address(const toml::table &t, const char *key, std::uint32_t unit, std::int64_t least,
                          std::optional<std::int64_t> usual)
    {
        const std::string expected = "a multiple of " + hex(unit) + " from " + hex(static_cast<std::uint64_t>(least)) +
                                     " to " + hex(0x100000000 - unit);
        return static_cast<std::uint32_t>(value<std::int64_t>(t, key, expected, usual, [&](std::int64_t v) {
            return v >= least && v <= 0x100000000 - unit && v % unit == 0;
        }));
    }
    bool flag(const toml::table &t, const char *key, bool usual)
    {
        return value<bool>(t, key, "true or false", usual, [](bool) { return true; });
    }
    std::string choice(const toml::table &t, const char *key, const std::vector<std::string> &choices,
                       std::optional<std::string> usual)
    {
        return value<std::string>(t, key, "one of: " + listed(choices), std::move(usual), [&](const std::string &v) {
            return std::find(choices.begin(), choices.end(), v) != choices.end();
        });
    }
    std::string text(const toml::table &t, const char *key, std::optional<std::string> usual)
    {
        return value<std::string>(t, key, "a text that is not empty", std::move(usual),
                                  [](const std::string &v) { return !v.empty(); });
    }
    std::uint32_t interrupt(const toml::table &t, const char *key, std::optional<std::int64_t> usual)
    {
        return number(t, key, usual ? 0 : 1, 15, usual);
    }

    MemoryDescription memory(const char *name, bool is_ram)
    {
        MemoryDescription m;
        const toml::node *node = table_.get(name);
        if (!node || !node->is_table()) {
            if (node || is_ram) {
                mistake(node ? node->source().begin.line : 1, std::string("[") + name + "] must be a table");
            }
            return m;
        }
        const toml::table &t = *node->as_table();
        allow(t, is_ram ? std::vector<std::string>{"base", "size", "edac", "reset"}
                        : std::vector<std::string>{"base", "size"});
        m.base = address(t, "base", page_size, 0, {});
        m.size = address(t, "size", page_size, page_size, {});
        if (is_ram) {
            m.edac = flag(t, "edac", false);
            m.kept = choice(t, "reset", {"kept", "cleared"}, "kept") == "kept";
        }
        return m;
    }

    void read_board(BoardDescription &b)
    {
        allow(table_, {"name", "clock", "timing", "fpu", "ram", "rom", "device"});
        b.name = text(table_, "name", {});
        b.clock = number(table_, "clock", 1000, 4000000000, {});
        b.leon3_timing = choice(table_, "timing", {"plain", "leon3"}, "plain") == "leon3";
        b.grfpu = choice(table_, "fpu", {"grfpu", "qemu"}, "grfpu") == "grfpu";
        b.ram = memory("ram", true);
        b.rom = memory("rom", false);
        const toml::node *devices = table_.get("device");
        const toml::array *list = devices ? devices->as_array() : nullptr;
        if (!list) {
            mistake(devices ? devices->source().begin.line : 1, "the devices must be tables [[device]]");
            return;
        }
        for (const toml::node &node : *list) {
            if (const toml::table *t = node.as_table()) {
                b.devices.push_back(device(*t));
            } else {
                mistake(node.source().begin.line, "a device must be a table [[device]]");
            }
        }
    }

    DeviceDescription device(const toml::table &t)
    {
        DeviceDescription d;
        d.line = static_cast<int>(t.source().begin.line);
        std::vector<std::string> names;
        for (const Kind &kind : kinds()) {
            names.push_back(kind.name);
        }
        const std::string kind = choice(t, "kind", names, {});
        const auto at = std::find(names.begin(), names.end(), kind);
        if (at == names.end()) {
            return d;
        }
        d.kind = static_cast<DeviceKind>(at - names.begin());
        std::vector<std::string> keys = kinds()[static_cast<std::size_t>(d.kind)].keys;
        keys.insert(keys.begin(), {"kind", "name", "address", "wait"});
        allow(t, keys);
        d.name = text(t, "name", kind);
        d.address = address(t, "address", 0x100, 0, {});
        d.wait = number(t, "wait", 0, 1'000'000'000, 0);
        switch (d.kind) {
        case DeviceKind::gptimer: timer(t, d); break;
        case DeviceKind::apbuart:
            d.interrupt = interrupt(t, "interrupt", {});
            d.timed = flag(t, "timed", false);
            break;
        case DeviceKind::ahbstat: d.interrupt = interrupt(t, "interrupt", {}); break;
        case DeviceKind::scrubber: d.period = number(t, "period", 0, 0xFFFFFFFF, 0); break;
        case DeviceKind::registers: registers(t, d); break;
        case DeviceKind::dsu: d.size = DebugUnit::size; break;
        default: break;
        }
        return d;
    }

    void timer(const toml::table &t, DeviceDescription &d)
    {
        d.interrupt = interrupt(t, "interrupt", {});
        d.timers = number(t, "timers", 1, Gptimer::most_timers, 2);
        d.watchdog = t.contains("watchdog");
        d.watchdog_after_reset =
            value<double>(t, "watchdog", "a time of 0 to 4000 s", 0.0, [](double v) { return v >= 0 && v <= 4000; });
        if (d.interrupt + d.timers > 16) {
            mistake(t.source().begin.line, std::to_string(d.timers) + " timers from interrupt " +
                                               std::to_string(d.interrupt) + " on: the last interrupt is 15");
        }
    }

    void registers(const toml::table &t, DeviceDescription &d)
    {
        d.size = address(t, "size", 0x100, 0x100, 0x100000);
        d.registers.size = d.size;
        d.registers.tick = d.interrupt = interrupt(t, "tick", {});
        d.registers.interrupt = interrupt(t, "interrupt", 0);
        const toml::node *lines = t.get("lines");
        if (lines && !lines->is_array()) {
            mistake(lines->source().begin.line, "`lines` must be a list of tables {board, line, interrupt}");
            return;
        }
        for (std::size_t i = 0; lines && i < lines->as_array()->size(); i++) {
            const toml::table *entry = lines->as_array()->get(i)->as_table();
            if (!entry) {
                mistake(lines->source().begin.line, "`lines` must be a list of tables {board, line, interrupt}");
                continue;
            }
            allow(*entry, {"board", "line", "interrupt"});
            RegisterSpace::Line line{text(*entry, "board", {}), number(*entry, "line", 0, 1023, {}), 0};
            const toml::node *does = entry->get("interrupt");
            if (!does || does->value_exact<std::string>() != "reset") {
                line.interrupt = does && does->is_string()
                                     ? (mistake(does->source().begin.line,
                                                "`interrupt` must be a whole number from 1 to 15, or \"reset\""),
                                        0)
                                     : interrupt(*entry, "interrupt", {});
            }
            d.registers.lines.push_back(std::move(line));
        }
    }

    /// Nothing overlaps, and there is one of each kind that is needed, at most.
    void check_places(const BoardDescription &b)
    {
        struct Place {
            std::string what;
            std::uint32_t line;
            std::uint64_t from, to;
        };
        std::vector<Place> places;
        const auto add = [&](const std::string &what, std::uint32_t line, std::uint64_t from, std::uint64_t size) {
            if (from + size > 0x100000000) {
                mistake(line, what + " at " + hex(from) + " goes beyond the last address");
            }
            for (const Place &p : places) {
                if (from < p.to && p.from < from + size) {
                    mistake(line, what + " at " + hex(from) + " to " + hex(from + size - 1) + " overlaps " + p.what +
                                      " at " + hex(p.from) + " to " + hex(p.to - 1));
                }
            }
            places.push_back({what, line, from, from + size});
        };
        add("the table of the AHB", 0, PlugAndPlay::ahb_address, PlugAndPlay::table_size);
        add("the table of the APB", 0, PlugAndPlay::apb_address, PlugAndPlay::table_size);
        add("[ram]", table_.get("ram")->source().begin.line, b.ram.base, b.ram.size);
        if (b.rom.size > 0) {
            add("[rom]", table_.get("rom")->source().begin.line, b.rom.base, b.rom.size);
        }
        std::vector<std::string> names;
        std::array<unsigned, device_kinds> count{};
        for (const DeviceDescription &d : b.devices) {
            const auto line = static_cast<std::uint32_t>(d.line);
            add("device `" + d.name + "`", line, d.address, d.size);
            if (std::find(names.begin(), names.end(), d.name) != names.end()) {
                mistake(line, "another device has the name `" + d.name + "`; give this one a `name`");
            }
            names.push_back(d.name);
            if (++count[static_cast<std::size_t>(d.kind)] > 1 && d.kind != DeviceKind::gptimer &&
                d.kind != DeviceKind::apbuart) {
                mistake(line, "a board has one device of the kind `" +
                                  std::string(kinds()[static_cast<std::size_t>(d.kind)].name) + "` at most");
            }
        }
        if (count[static_cast<std::size_t>(DeviceKind::irqmp)] == 0) {
            mistake(1, "a device of the kind `irqmp` is missing");
        }
    }

    std::string file_, errors_;
    toml::table table_;
};

} // namespace

BoardDescription BoardDescription::parse(std::string_view text, const std::string &file)
{
    return Parser(text, file).board();
}

BoardDescription BoardDescription::read(const std::string &path)
{
    std::ifstream file(path, std::ios::binary);
    const std::string text{std::istreambuf_iterator<char>(file), {}};
    if (!file.is_open() || file.bad()) {
        throw Error(path + ": cannot be read");
    }
    return parse(text, path);
}

} // namespace fledge::emulator
