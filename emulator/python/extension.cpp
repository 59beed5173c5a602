// SPDX-License-Identifier: Apache-2.0
// The module `_emulator`: a computer in software, for the package fledge.emulator. Times are integer nanoseconds here.
#include "core/typed.h"
#include "emulator/board.h"
#include "emulator/debug/registers.h"
#include "emulator/debug/tools.h"
#include "emulator/devices/apbuart.h"
#include "emulator/devices/irqmp.h"
#include "emulator/devices/memory_controller.h"
#include "emulator/devices/register_space.h"
#include "emulator/mission/link.h"
#include "emulator/report.h"
#include "emulator/snapshot.h"
#include "registers/lane.h"

#include <pybind11/functional.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

namespace py = pybind11;
using namespace py::literals;

namespace {

using namespace fledge;
using namespace fledge::emulator;
using fledge::core::list_of;
using fledge::core::Typed;

const char *const engines[] = {"interpreter", "threaded", "translator"};
const char *const reasons[] = {"time", "early", "breakpoint", "watchpoint", "error"};

py::bytes to_python(std::span<const std::byte> bytes)
{
    return {reinterpret_cast<const char *>(bytes.data()), bytes.size()};
}

std::span<const std::byte> from_python(const py::bytes &bytes)
{
    const std::string_view view = bytes;
    return std::as_bytes(std::span(view));
}

EngineKind engine_of(const std::string &name)
{
    for (int i = 0; i < 3; i++) {
        if (name == engines[i]) {
            return static_cast<EngineKind>(i);
        }
    }
    throw Error("engine: expected interpreter, threaded or translator; found " + name);
}

Error no_memory(std::uint32_t address)
{
    char text[64];
    std::snprintf(text, sizeof text, "the board has no memory at 0x%08x", address);
    return Error(text);
}

/// A machine with its program and a developer's tools.
class Computer {
public:
    Computer(const std::string &board, const std::string &elf, const std::string &engine)
        : program(Program::read(elf)), engine_(engine_of(engine)), machine(BoardDescription::read(board), engine_),
          tools(machine, program)
    {
        machine.load(program);
        if (auto *uart = machine.device_of<Apbuart>(0)) {
            uart->transmit = [this](std::uint8_t byte) { console += static_cast<char>(byte); };
        }
    }

    /// As the machine's, with the flip that is planned.
    StopReason run_until(Ns t)
    {
        if (planned) {
            const auto &[instruction, time, flips] = *planned;
            const StopReason reason =
                instruction ? machine.run_to_instruction(*instruction, t) : tools.run_until(std::min(t, *time));
            const bool reached = instruction ? machine.instructions() >= *instruction : machine.now() >= *time;
            if (reason != StopReason::time || !reached) {
                return reason; // it has stopped, or the time has come, before
            }
            for (const auto &[place, bit] : flips) {
                flip(place, bit);
            }
            planned.reset();
        }
        return tools.run_until(t);
    }

    using Place = std::variant<std::uint32_t, std::string>;

    void flip(const Place &place, unsigned bit)
    {
        if (const auto *address = std::get_if<std::uint32_t>(&place)) {
            flip_memory(*address, bit);
        } else {
            flip_register(machine.core().state, std::get<std::string>(place), bit);
        }
    }

    void finish()
    {
        tools.finish();
        renew_engine();
    }
    /// The children of a process share the memory of translated code, so each needs an engine of its own.
    void renew_engine() { machine.select(engine_); }

    Program program;

private:
    void flip_memory(std::uint32_t address, unsigned bit)
    {
        std::byte byte{};
        if (!machine.peek(address, {&byte, 1})) {
            throw no_memory(address);
        }
        if (bit > 7) {
            throw Error("flip: a byte of memory has the bits 0 to 7; found " + std::to_string(bit));
        }
        const Memory &ram = machine.bus().ram();
        if (address - ram.base < ram.size) {
            machine.bus().flip(address & ~3u, {1u << bit << (8 * (3 - (address & 3))), 0}); // EDAC may see it
        } else {
            byte ^= std::byte(1u << bit);
            (void)machine.poke(address, {&byte, 1});
        }
    }

    EngineKind engine_;

public:
    Machine machine;
    Tools tools;
    std::string console;
    struct Plan {
        std::optional<std::uint64_t> instruction;
        std::optional<Ns> time; ///< if there is no instruction
        std::vector<std::pair<Place, unsigned>> flips;
    };
    std::optional<Plan> planned;
};

/// Run in slices, so that Ctrl-C of Python ends it.
const char *run_until(Computer &c, Ns t)
{
    constexpr Ns slice = 1'000'000'000;
    for (;;) {
        StopReason reason;
        {
            py::gil_scoped_release release;
            reason = c.run_until(std::min(t, c.machine.now() + slice));
        }
        if (reason != StopReason::time || c.machine.now() >= t) {
            return reasons[static_cast<int>(reason)];
        }
        if (PyErr_CheckSignals() != 0) {
            throw py::error_already_set();
        }
    }
}

/// The outside's end of the registers of a mission that flies on a computer.
class Link {
public:
    Link(Computer &computer, const std::string &tables)
        : computer_(computer), link_(computer.machine, load_mission(tables)), host_(link_.host())
    {
        const MissionIo &io = *host_.io;
        for (std::uint32_t id = 0; id < io.n_messages; id++) {
            held_.emplace_back(io.messages[id].size);
        }
        link_.loop().run = [this](Ns t) {
            const StopReason reason = computer_.run_until(t);
            if (on_stop && (reason == StopReason::breakpoint || reason == StopReason::watchpoint)) {
                on_stop(reasons[static_cast<int>(reason)]);
            }
            return reason;
        };
        link_.loop().on_tick = [&computer] { computer.tools.begin(); };
    }
    Link(const Link &) = delete;
    Link &operator=(const Link &) = delete;

    auto messages() const
    {
        return list_of(std::span(host_.io->messages, host_.io->n_messages), [](const MissionMessage &m) {
            return std::tuple(m.path, m.offset, m.size, m.direction == MISSION_IN);
        });
    }

    std::uint32_t mission() const { return mission_address(computer_.machine, computer_.program); }

    std::vector<std::tuple<std::string, std::uint64_t, std::uint64_t>> registers()
    {
        std::vector<std::tuple<std::string, std::uint64_t, std::uint64_t>> rows;
        for (const RegisterWindow &w : link_.space().windows()) {
            for (const RegisterLane &lane : std::span(w.board->lanes, w.board->n_lanes)) {
                const bool words = lane.form == REGISTER_WORD && !(lane.flags & REGISTER_QUEUED);
                rows.emplace_back(std::string(w.board->name) + "." + lane.name, w.board->base + lane.address,
                                  words ? 4 * lane.count : REGISTER_CONTROL_SIZE + lane.depth * lane.stride);
            }
        }
        return rows;
    }

    /// A fault of the register at an address of the processor.
    void stick(std::uint64_t address, std::uint32_t ones, std::uint32_t zeros)
    {
        std::uint64_t first = address;
        for (const RegisterWindow &w : link_.space().windows()) {
            first = std::min<std::uint64_t>(first, w.board->base);
        }
        link_.space().stick(static_cast<std::uint32_t>(address - first), ones, zeros);
    }

    bool carries(std::uint32_t id) const { return link_.carries(id); }

    void put(std::uint32_t id, const py::bytes &message)
    {
        const std::string_view bytes = message;
        if (bytes.size() != held_.at(id).size()) {
            throw Error("a message of another size");
        }
        link_.put(id, bytes.data());
    }

    py::bytes take(std::uint32_t id)
    {
        link_.take(id, held_.at(id).data());
        return to_python(held_[id]);
    }

    bool send(const py::bytes &packet) { return link_.send(from_python(packet)); }

    std::vector<py::bytes> receive()
    {
        std::vector<py::bytes> packets;
        for (auto packet = link_.receive(); !packet.empty(); packet = link_.receive()) {
            packets.push_back(to_python(std::as_bytes(packet)));
        }
        return packets;
    }

    /// Whether the computer is down at t, after a reset by the message that was put last.
    bool is_down(Ns t) { return link_.is_down(t); }

    /// Returns whether the processor lives.
    bool tick(Ns t)
    {
        py::gil_scoped_release release;
        return link_.tick(t);
    }

    /// A fault: so many ticks do not reach the processor.
    void lose_ticks(std::uint64_t n) { link_.loop().state.lose = n; }
    Ns reached() const { return link_.reached(); }
    const FlightLoop::State &state() const { return link_.loop().state; }

    /// All that is not in the machine.
    struct Saved {
        MissionLink::State link;
        std::vector<std::vector<std::byte>> held;
    };

    Saved save() const { return {link_.save(), held_}; }
    void restore(const Saved &saved)
    {
        link_.restore(saved.link);
        held_ = saved.held;
    }

    std::function<void(const char *)> on_stop; ///< at a breakpoint or watchpoint; then the machine goes on

private:
    Computer &computer_;
    MissionLink link_;
    const MissionHost &host_;
    std::vector<std::vector<std::byte>> held_; ///< the last message of each, by id
};

Typed<py::dict, "dict[str, int]"> registers_of(Computer &c)
{
    py::dict found;
    for (unsigned i = 0; i < named_registers; i++) {
        found[py::str("%" + register_name(i))] = get_register(c.machine.core().state, i);
    }
    return found;
}

Irqmp &interrupts_of(Computer &c)
{
    auto *found = c.machine.device_of<Irqmp>();
    if (!found) {
        throw Error(c.machine.board().file + ": the board has no interrupt controller");
    }
    return *found;
}

/// Registers, memory, devices and symbols.
void bind_memory(py::class_<Computer> &computer)
{
    computer.def("registers", registers_of)
        .def(
            "set_register",
            [](Computer &c, const std::string &name, std::uint32_t value) {
                set_register(c.machine.core().state, register_number(name), value);
            },
            "name"_a, "value"_a)
        .def(
            "peek",
            [](const Computer &c, std::uint32_t address, std::size_t n) {
                std::vector<std::byte> bytes(n);
                if (!c.machine.peek(address, bytes)) {
                    throw no_memory(address);
                }
                return to_python(bytes);
            },
            "address"_a, "n"_a)
        .def(
            "poke",
            [](Computer &c, std::uint32_t address, const py::bytes &bytes) {
                if (!c.machine.poke(address, from_python(bytes))) {
                    throw no_memory(address);
                }
            },
            "address"_a, "bytes"_a)
        .def(
            "devices", [](Computer & c) -> Typed<py::dict, "dict[str, dict[str, tuple[int, int]]]"> {
                py::dict found;
                for (const DeviceWords &device : device_words(c.machine)) {
                    py::dict words;
                    for (const auto &[name, address, value] : device.words) {
                        words[py::str(name)] = py::make_tuple(address, value);
                    }
                    found[py::str(device.name)] = words;
                }
                return found;
            })
        .def(
            "symbol",
            [](const Computer &c, const std::string &name) {
                const Program::Symbol *found = c.program.named(name);
                return found ? std::optional(std::pair(found->address, found->size)) : std::nullopt;
            },
            "name"_a)
        .def("symbols",
             [](const Computer &c) {
                 return list_of(c.program.symbols(), [](const Program::Symbol &symbol) { return symbol.name; });
             })
        .def(
            "place", [](const Computer &c, std::uint32_t address) { return c.program.place(address); }, "address"_a);
}

/// What a developer uses: breakpoints, gdb, traces, coverage, profiles, stacks.
void bind_tools(py::class_<Computer> &computer)
{
    computer
        .def(
            "set_breakpoint",
            [](Computer &c, std::uint32_t address, bool on) { c.machine.set_breakpoint(address, on); }, "address"_a,
            "on"_a)
        .def(
            "set_watchpoint",
            [](Computer &c, std::uint32_t address, std::uint32_t size, bool read, bool write, bool on) {
                c.machine.set_watchpoint(address, size, read, write, on);
            },
            "address"_a, "size"_a, "read"_a, "write"_a, "on"_a)
        .def(
            "serve_gdb", [](Computer &c, const std::string &address) { return c.tools.serve_gdb(address); },
            "address"_a)
        .def(
            "wait_for_gdb",
            [](Computer &c, int timeout) {
                py::gil_scoped_release release;
                return c.tools.gdb() && c.tools.gdb()->wait(timeout);
            },
            "timeout"_a)
        .def(
            "trace", [](Computer &c, const std::string &path, Ns from, Ns until) { c.tools.trace(path, from, until); },
            "path"_a, "from_"_a, "until"_a)
        .def(
            "coverage", [](Computer &c, const std::string &path) { c.tools.coverage(path); }, "path"_a)
        .def(
            "profile", [](Computer &c, const std::string &path) { c.tools.profile(path); }, "path"_a)
        .def("stacks", [](Computer &c) { c.tools.stacks(); })
        .def("finish", &Computer::finish)
        .def("renew_engine", &Computer::renew_engine)
        .def("depths", [](const Computer &c) {
            return list_of(c.tools.depths(), [](const StackDepth::Stack &stack) {
                return std::tuple(stack.name, stack.used(), stack.size);
            });
        });
}

/// Faults that a campaign injects.
void bind_faults(py::class_<Computer> &computer)
{
    computer.def("flip", &Computer::flip, "place"_a, "bit"_a)
        .def(
            "plan_flip",
            [](Computer &c, std::optional<std::uint64_t> instruction, std::optional<Ns> time,
               std::vector<std::pair<Computer::Place, unsigned>> flips) {
                c.planned = Computer::Plan{instruction, time, std::move(flips)};
            },
            "instruction"_a, "time"_a, "flips"_a)
        .def(
            "flip_next_read", [](Computer &c, std::uint32_t bits) { c.machine.bus().flip_next_read(bits); }, "bits"_a)
        .def("fail_next_read", [](Computer &c) { c.machine.bus().fail_next_read(); })
        .def(
            "raise_interrupt", [](Computer &c, std::uint32_t line) { interrupts_of(c).raise(line); }, "line"_a)
        .def(
            "stick_interrupts",
            [](Computer &c, std::uint32_t pending, std::uint32_t silent) { interrupts_of(c).stick(pending, silent); },
            "pending"_a, "silent"_a)
        .def("enable_edac",
             [](Computer &c) {
                 auto *controller = c.machine.device_of<MemoryController>();
                 if (!controller || !c.machine.bus().has_edac()) {
                     throw Error(c.machine.board().file + ": the board has no EDAC that a device ftmctrl switches");
                 }
                 controller->write(8, controller->read(8) | 1u << 9);
             })
        .def_property_readonly("corrected", [](Computer &c) {
            auto *status = c.machine.device_of<AhbStatus>();
            return status ? status->read(8) : 0u;
        });
}

void bind_computer(py::module_ &m)
{
    py::class_<Computer> computer(m, "Computer");
    computer
        .def(py::init<const std::string &, const std::string &, const std::string &>(), "board"_a, "elf"_a, "engine"_a)
        .def_property_readonly("now", [](const Computer &c) { return c.machine.now(); })
        .def_property_readonly("cycles", [](Computer &c) { return c.machine.core().state.cycles; })
        .def_property_readonly("instructions", [](const Computer &c) { return c.machine.instructions(); })
        .def_property_readonly("resets", [](const Computer &c) { return c.machine.resets(); })
        .def_property_readonly("watchdog_resets", [](const Computer &c) { return c.machine.watchdog_resets(); })
        .def_property_readonly("failed", [](Computer &c) { return c.machine.core().state.mode == Mode::error; })
        .def_property_readonly("trap", [](Computer &c) { return trap_name(c.machine.core().state.trap_type); })
        .def("run_until", run_until, "t"_a)
        .def("step", [](Computer &c) { return reasons[static_cast<int>(c.machine.step())]; })
        .def("reset", [](Computer &c) { c.machine.reset(); })
        .def_property_readonly("entry", [](const Computer &c) { return c.program.entry(); })
        .def("report", [](const Computer &c) { return c.machine.report(&c.program); })
        .def_readonly("console", &Computer::console)
        .def(
            "send",
            [](Computer &c, const py::bytes &bytes, std::size_t n) {
                auto *uart = c.machine.device_of<Apbuart>(n);
                const auto from = from_python(bytes);
                if (!uart || uart->room() < from.size()) {
                    throw Error(!uart ? c.machine.board().file + ": the board has no UART " + std::to_string(n)
                                      : "send: the UART has room for " + std::to_string(uart->room()) +
                                            " bytes; run the program, so that it reads what waits");
                }
                uart->receive({reinterpret_cast<const std::uint8_t *>(from.data()), from.size()});
            },
            "bytes"_a, "n"_a)
        .def("snapshot", [](Computer &c) { return std::const_pointer_cast<Snapshot>(c.machine.snapshot()); })
        .def(
            "restore",
            [](Computer &c, const Snapshot &s) {
                c.machine.restore(s);
                c.tools.begin();
            },
            "snapshot"_a)
        .def("save", [](Computer &c) { return to_python(c.machine.save()); })
        .def(
            "load", [](Computer &c, const py::bytes &bytes) { c.machine.load_snapshot(from_python(bytes)); },
            "bytes"_a);
    bind_memory(computer);
    bind_tools(computer);
    bind_faults(computer);
}

void bind_link(py::module_ &m)
{
    py::class_<Link>(m, "Link")
        .def(py::init<Computer &, const std::string &>(), "computer"_a, "tables"_a, py::keep_alive<1, 2>())
        .def("messages", &Link::messages, "(path, offset in the mission's memory, size, whether it is an input) by id")
        .def("mission", &Link::mission)
        .def("registers", &Link::registers, "(board.lane, address, size in bytes) of all lanes")
        .def("stick", &Link::stick, "address"_a, "ones"_a, "zeros"_a)
        .def("carries", &Link::carries, "id"_a)
        .def("put", &Link::put, "id"_a, "message"_a)
        .def("take", &Link::take, "id"_a)
        .def("send", &Link::send, "packet"_a)
        .def("receive", &Link::receive)
        .def("is_down", &Link::is_down, "t"_a)
        .def("tick", &Link::tick, "t"_a)
        .def("lose_ticks", &Link::lose_ticks, "n"_a)
        .def(
            "on_stop", [](Link &link, std::function<void(const char *)> f) { link.on_stop = std::move(f); }, "f"_a)
        .def_property_readonly("reached", &Link::reached)
        .def_property_readonly("epoch", [](const Link &link) { return link.state().epoch; })
        .def_property_readonly("missed", [](const Link &link) { return link.state().missed; })
        .def_property_readonly("ticks", [](const Link &link) { return link.state().ticks; })
        .def_property_readonly("cycles", [](const Link &link) { return link.state().cycles; })
        .def("save", &Link::save)
        .def("restore", &Link::restore, "saved"_a);
}

} // namespace

PYBIND11_MODULE(_emulator, m)
{
    m.doc() = "A flight computer in software. Use the package fledge.emulator instead.";
    py::register_exception_translator([](std::exception_ptr error) {
        try {
            std::rethrow_exception(std::move(error));
        } catch (const Error &e) {
            PyErr_SetString(py::module_::import("fledge.errors").attr("SetupError").ptr(), e.what());
        } catch (const registers::Error &e) {
            PyErr_SetString(py::module_::import("fledge.errors").attr("SetupError").ptr(), e.what());
        }
    });

    (void)py::class_<Snapshot, std::shared_ptr<Snapshot>>(m, "Snapshot");
    (void)py::class_<Link::Saved>(m, "Saved");

    bind_computer(m);
    bind_link(m);
}
