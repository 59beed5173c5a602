// SPDX-License-Identifier: Apache-2.0
#include "fmi/importer/fmu.h"

#include "fmi/importer/versions.h"
#include "sim/text.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <dlfcn.h>
#include <map>
#include <mutex>

namespace fledge::importer {

namespace {

/// Throws unless no other instance of this library lives.
std::shared_ptr<void> only(const FmuFile &file, const std::string &name)
{
    static std::mutex mutex;
    static std::map<std::string, std::weak_ptr<void>> living;
    const std::lock_guard lock(mutex);
    if (!living[file.library].expired()) {
        throw sim::SetupError(
            name + " (" + file.file +
            "): the FMU may be in a program once (canBeInstantiatedOnlyOncePerProcess), and is there; it has no clones "
            "and campaigns, and a second one flies as a node of its own (fledge up)");
    }
    const auto mark = std::make_shared<int>(0);
    living[file.library] = mark;
    return mark;
}

} // namespace

Fmu::Fmu(const FmuFile &file, std::string name) : ticks(file.clocks.size(), 0), file_(file), name_(std::move(name))
{
    if (file.single) {
        only_ = only(file_, name_);
    }
    const sim::Inside inside("the constructors", file_.file.c_str());
    void *const handle = dlopen(file_.library.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (!handle) {
        throw sim::SetupError(name_ + " (" + file_.file + "): its library cannot be loaded: " + dlerror());
    }
    library_ = std::shared_ptr<void>(handle, [name = file_.file](void *opened) {
        const sim::Inside its("the destructors", name.c_str());
        dlclose(opened);
    });
}

void *Fmu::symbol(const char *function, bool needed) const
{
    void *const found = dlsym(library_.get(), function);
    if (!found && needed) {
        throw sim::SetupError(name_ + " (" + file_.file + "): its library has no function " + function +
                              ", which FMI " + std::to_string(file_.version) + ".0 demands");
    }
    return found;
}

void Fmu::no_instance(const char *function) const
{
    throw sim::SetupError(name_ + " (" + file_.file + "): " + function + " makes no instance" + logged());
}

void Fmu::check_version(const char *function, const char *found) const
{
    if (!found || !std::string(found).starts_with(std::to_string(file_.version) + ".0")) {
        throw sim::SetupError(name_ + " (" + file_.file + "): its description is of FMI " +
                              std::to_string(file_.version) + ".0, and " + function + " of its library says '" +
                              (found ? found : "") + "'");
    }
}

void Fmu::log(int status, const char *text)
{
    if (status == 0 || !text) {
        return;
    }
    constexpr std::size_t room = 2000;
    lines_ += (lines_.empty() ? "" : "; ") + std::string(text, strnlen(text, room));
    std::replace(lines_.begin(), lines_.end(), '\n', ' ');
    lines_.erase(0, lines_.size() > room ? lines_.size() - room : 0);
}

std::string Fmu::logged() const
{
    return lines_.empty() ? "" : "; the FMU says: " + lines_;
}

void Fmu::fail(const char *function, const std::string &answer)
{
    throw sim::RunError(name_ + " (" + file_.file + "): " + function + " answers with " + answer +
                        " at t = " + sim::format_number(time_) + " s of the FMU" + logged());
}

void Fmu::terminate()
{
    throw sim::RunError(name_ + " (" + file_.file + ") ends the simulation at t = " + sim::format_number(time_) +
                        " s of the FMU" + logged());
}

void Fmu::step_to(double end)
{
    // Whether it is there, up to the rounding of times.
    const auto there = [&] { return time_ >= end - 1e-10 * std::max(1.0, std::fabs(end)); };
    constexpr int most = 1'000'000, halves = 30;
    double size = end - time_;
    int steps = 0, refused = 0;
    while (!there()) {
        const double before = time_;
        const bool refuses = step(std::min(size, end - time_));
        if (time_ > before) {
            refused = 0;
            size = refuses ? size : end - time_;
        } else {
            size = (end - before) / std::exp2(++refused);
        }
        if (refused > halves || ++steps > most) {
            throw sim::RunError(name_ + " (" + file_.file + "): no step from t = " + sim::format_number(time_) +
                                " s of the FMU comes to " + sim::format_number(end) + " s, after " +
                                std::to_string(steps) + " tries" + logged());
        }
    }
    time_ = end;
}

std::unique_ptr<Fmu> load(const FmuFile &file, const std::string &name)
{
    return file.version == 2 ? make_fmu2(file, name) : make_fmu3(file, name);
}

} // namespace fledge::importer
