// SPDX-License-Identifier: Apache-2.0
#include "emulator/debug/tools.h"

#include "emulator/board.h"

namespace fledge::emulator {

Tools::~Tools()
{
    machine_.observe(nullptr);
}

std::uint16_t Tools::serve_gdb(std::string_view address)
{
    gdb_ = std::make_unique<GdbServer>(machine_, address, &program_);
    return gdb_->port();
}

void Tools::trace(const std::string &path, Ns from, Ns until)
{
    const double rate = machine_.board().clock / 1e9;
    const auto cycles = [&](Ns t) { return static_cast<std::uint64_t>(static_cast<double>(t) * rate); };
    trace_.emplace(path, program_, cycles(from), cycles(until));
    machine_.observe(this);
}

void Tools::coverage(const std::string &path)
{
    coverage_.emplace();
    coverage_path_ = path;
    machine_.observe(this);
}

void Tools::profile(const std::string &path)
{
    profile_.emplace(program_);
    profile_path_ = path;
    machine_.observe(this);
}

void Tools::stacks()
{
    stacks_.emplace(program_);
    machine_.observe(this);
}

void Tools::executed(const Executed &step)
{
    if (trace_) {
        trace_->executed(step);
    }
    if (coverage_) {
        coverage_->executed(step);
    }
    if (profile_) {
        profile_->executed(step);
    }
    if (stacks_) {
        stacks_->executed(step);
    }
}

StopReason Tools::run_until(Ns t)
{
    return gdb_ ? gdb_->run_until(t) : machine_.run_until(t);
}

void Tools::begin()
{
    if (gdb_ && gdb_->attached()) {
        gdb_->begin();
    }
}

void Tools::finish()
{
    machine_.observe(nullptr);
    trace_.reset();
    if (coverage_) {
        coverage_->write(coverage_path_, program_, SourceLines(program_.path()));
        coverage_.reset();
    }
    if (profile_) {
        profile_->write(profile_path_, SourceLines(program_.path()));
        profile_.reset();
    }
}

std::vector<StackDepth::Stack> Tools::depths() const
{
    std::vector<StackDepth::Stack> found = stacks_ ? stacks_->stacks() : std::vector<StackDepth::Stack>{};
    std::erase_if(found, [](const StackDepth::Stack &stack) { return stack.used() == 0; }); // the boot loader's
    return found;
}

} // namespace fledge::emulator
