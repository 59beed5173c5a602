// SPDX-License-Identifier: Apache-2.0
// The remote protocol of gdb for a machine. The program that runs the machine runs it through this object: whenever gdb
// stops the machine, run_until() does not return before gdb lets it go on.
//
// Example:
//
//     #include "emulator/machine.h"
//     using namespace emulator;
//     void debug(Machine &machine, const Program &program)
//     {
//         GdbServer gdb(machine, "3333", &program);
//         gdb.wait(-1);
//         gdb.run_until(10'000'000'000); // in place of Machine::run_until
//     }
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "emulator/debug/history.h"
#include "emulator/elf.h"

namespace fledge::emulator {

/// A socket that listens at "[ADDRESS:]PORT"; `port` gets the one that it has. Throws Error, in which `what` is the
/// purpose.
int listen_at(std::string_view address, const std::string &what, std::uint16_t &port);

class GdbServer {
public:
    /// Listen at "[ADDRESS:]PORT"; without an address at 127.0.0.1, and PORT 0 takes a free one. Throws Error.
    GdbServer(Machine &machine, std::string_view address, const Program *program = nullptr);
    ~GdbServer();
    GdbServer(const GdbServer &) = delete;
    GdbServer &operator=(const GdbServer &) = delete;

    std::uint16_t port() const { return port_; }

    /// Wait until gdb is there, at most so long [ms]; -1: for ever. The machine stands still until gdb runs it. Returns
    /// whether gdb came.
    bool wait(int timeout);
    bool attached() const { return client_ >= 0; }

    /// As Machine::run_until; with gdb, breakpoints and watchpoints stop the machine and not this call. gdb may attach
    /// at any time.
    StopReason run_until(Ns t);

    /// The outside has changed the machine: gdb cannot go back beyond this point.
    void begin() { history_.begin(); }

private:
    enum class Go { on, step, back, step_back, let_go };
    enum class Then { stop, go_on, leave };

    void accept();
    void drop();
    bool readable(int timeout);
    std::string receive();
    void send(std::string_view packet);
    Go serve();
    Then go(Go how);
    Then run_slice(Ns t);
    std::string answer(const std::string &packet, std::optional<Go> &go);
    std::string stop_reply() const;
    std::string watched() const;

    std::string registers() const;
    std::string read_memory(std::uint32_t address, std::uint32_t n) const;
    bool write_memory(std::uint32_t address, std::string_view hex);
    std::string set_point(const std::string &packet);
    std::string query(const std::string &packet);
    std::string monitor(const std::string &command);
    std::string flip(const std::string &place, unsigned bit);

    Machine &machine_;
    const Program *program_;
    History history_;
    std::map<std::string, std::shared_ptr<const Snapshot>> snapshots_; ///< of `monitor snapshot`, by name
    struct Watch {
        std::uint32_t address, size;
        char kind; ///< '2' write, '3' read, '4' both
    };
    std::vector<Watch> watches_;
    std::uint16_t port_ = 0;
    int listener_ = -1, client_ = -1;
    bool acknowledge_ = true;
    bool stands_ = false; ///< gdb has stopped the machine
    StopReason reason_ = StopReason::time;
    bool past_begins_ = false; ///< gdb went back to where the past begins
    bool interrupted_ = false; ///< gdb stopped the machine by Ctrl-C
    std::string input_;
};

/// Where a window of registers will be in memory once the program spills it. Debuggers read the stack in memory, so
/// they see the registers of windows that are not spilled there. Calls f(address of 16 words, the words).
void visit_windows(CpuState &state, const std::function<void(std::uint32_t, std::uint32_t *, std::uint32_t *)> &f);

} // namespace fledge::emulator
