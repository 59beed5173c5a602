// SPDX-License-Identifier: Apache-2.0
// The tools of a developer on one machine: gdb, trace, coverage, profile, depth of the stacks.
#pragma once

#include <optional>

#include "emulator/debug/coverage.h"
#include "emulator/debug/gdb_server.h"
#include "emulator/debug/profile.h"
#include "emulator/debug/stack_depth.h"
#include "emulator/debug/trace.h"

namespace fledge::emulator {

class Tools final : private Observer {
public:
    Tools(Machine &machine, const Program &program) : machine_(machine), program_(program) {}
    ~Tools() override;
    Tools(const Tools &) = delete;
    Tools &operator=(const Tools &) = delete;

    /// Serve gdb, as GdbServer does. Returns its port.
    std::uint16_t serve_gdb(std::string_view address);
    GdbServer *gdb() { return gdb_.get(); }

    // Begin to observe, until finish(). Each file is written then, but for the trace, which grows. They throw Error.

    /// Of the instructions that begin at these times [ns].
    void trace(const std::string &path, Ns from = 0, Ns until = std::numeric_limits<Ns>::max());
    void coverage(const std::string &path);
    void profile(const std::string &path);
    void stacks();

    /// As Machine::run_until, under gdb if it is there.
    StopReason run_until(Ns t);
    /// The outside has changed the machine.
    void begin();

    /// Write the files, and observe no more. Throws Error.
    void finish();
    /// After stacks(): each with its size.
    std::vector<StackDepth::Stack> depths() const;

private:
    void executed(const Executed &step) override;

    Machine &machine_;
    const Program &program_;
    std::unique_ptr<GdbServer> gdb_;
    std::optional<Trace> trace_;
    std::optional<Coverage> coverage_;
    std::optional<Profile> profile_;
    std::optional<StackDepth> stacks_;
    std::string coverage_path_, profile_path_;
};

} // namespace fledge::emulator
