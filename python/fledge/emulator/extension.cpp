// SPDX-License-Identifier: Apache-2.0
// The module `_emulator`: a computer in software, for the package fledge.emulator. Times are integer nanoseconds here.
#include "emulator/board.h"
#include "emulator/debug/gdb_server.h"
#include "emulator/debug/tools.h"
#include "emulator/elf.h"
#include "emulator/loop.h"
#include "emulator/machine.h"
#include "registers/outside.h"
#include "targets/mission_host.h"

#include <dlfcn.h>
#include <optional>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

namespace py = pybind11;

namespace {

using namespace fledge;
using namespace fledge::emulator;

const char *const engines[] = {"interpreter", "threaded", "translator"};
const char *const reasons[] = {"time", "early", "breakpoint", "watchpoint", "error"};

py::bytes bytes_of(std::span<const std::byte> bytes)
{
    return {reinterpret_cast<const char *>(bytes.data()), bytes.size()};
}

std::span<const std::byte> span_of(const py::bytes &bytes)
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

/// A machine with its board and program.
struct Computer {
    BoardDescription description;
    Program program;
    Machine machine;
    std::unique_ptr<GdbServer> gdb;
    std::string console;

    Computer(const std::string &board, const std::string &elf, const std::string &engine)
        : description(BoardDescription::read(board)), program(Program::read(elf)),
          machine(description, engine_of(engine))
    {
        machine.load(program);
        machine.reset();
    }

    StopReason run_until(Ns t) { return gdb ? gdb->run_until(t) : machine.run_until(t); }
};

const char *reason_of(StopReason reason)
{
    return reasons[static_cast<int>(reason)];
}

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
            return reason_of(reason);
        }
        if (PyErr_CheckSignals() != 0) {
            throw py::error_already_set();
        }
    }
}

} // namespace
