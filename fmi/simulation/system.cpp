// SPDX-License-Identifier: Apache-2.0
// A simulation as the system of an FMU: that of resources/composition.json, of which `fmu` has the variables and what
// numbers processes and events:
//
//     {"variables": [[reference, role, type, n, block, offset], ...],
//      "messages": [[first, n, block, offset], ...], "processes": [name, ...], "events": [[process, name], ...],
//      "commanded": the flight process that takes packets, or ""}
#include "fmi/fmu/flight.h"

#include "flight/msg/head.h"
#include "fmi/simulation/composition.h"

#include <algorithm>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

namespace fledge::fmi {

using nlohmann::json;
using sim::Ns;

namespace {

/// The enumerator of that name.
template <class Enum, std::size_t n> Enum named(const char *const (&names)[n], const std::string &name)
{
    const auto found = std::find(std::begin(names), std::end(names), name);
    if (found == std::end(names)) {
        throw sim::SetupError("it has a variable of the kind '" + name + "', which is unknown here");
    }
    return static_cast<Enum>(found - std::begin(names));
}

const char *const roles[] = {"input", "output",     "local",       "parameter", "fixed",  "mode",    "request",
                             "fired", "clock_mode", "clock_event", "time",      "uplink", "downlink"};
const char *const types[] = {"f64", "f32", "i8", "u8", "i16", "u16", "i32", "u32", "i64", "u64", "char", "enum"};

std::ifstream open(const FmuHost &host, const std::string &name)
{
    const std::string path = std::string(host.resources) + "/" + name;
    std::ifstream file(path);
    if (!file) {
        throw sim::SetupError(path + " is not there: unpack the FMU with its resources");
    }
    return file;
}

/// A simulation that an importer steps.
class Flown {
public:
    Flown(const FmuHost &importer, const json &composition) : host(importer)
    {
        const json &fmu = composition.at("fmu");
        simulation_ = build(composition, host.resources);
        blocks_ = blocks(*simulation_);
        for (const json &row : fmu.at("variables")) {
            variables_.push_back({row.at(0), named<FmuRole>(roles, row.at(1)), named<FledgeType>(types, row.at(2)),
                                  row.at(3), row.at(4), row.at(5)});
        }
        for (const json &row : fmu.at("messages")) {
            messages_.push_back({row.at(0), row.at(1), row.at(2), row.at(3)});
        }
        for (const std::string &name : fmu.at("processes").get<std::vector<std::string>>()) {
            processes_.push_back(&simulation_->process(name));
        }
        for (const auto &[process, name] : fmu.at("events").get<std::vector<std::pair<std::string, std::string>>>()) {
            sim::Process &owner = simulation_->process(process);
            events_.emplace_back(&owner, owner.event(name));
            if (!events_.back().second) {
                throw sim::SetupError(process + " has no event " + name);
            }
        }
        if (const std::string name = fmu.at("commanded"); !name.empty()) {
            commanded_ = &simulation_->process(name);
            commanded_->units.take(); // they are kept from now on
            frames_ = std::ranges::any_of(commanded_->instances(), [](const auto &instance) {
                return instance->type().service && instance->type().service->wrap;
            });
        }
        check();
        layout_ = {variables_.data(),
                   static_cast<std::uint32_t>(variables_.size()),
                   messages_.data(),
                   static_cast<std::uint32_t>(messages_.size()),
                   static_cast<std::uint32_t>(processes_.size()),
                   static_cast<std::uint32_t>(events_.size())};
        simulation_->prepare();
        room_ = simulation_->snapshot_room();
    }

    const FmuLayout *layout() const { return &layout_; }

    std::byte *memory(std::uint32_t block) const { return blocks_.at(block)->memory(); }

    void changed(std::uint32_t block)
    {
        sim::check_parameters(*blocks_.at(block));
        changed_ = true;
    }

    void begin()
    {
        std::vector<std::vector<std::byte>> inputs; // a reset forgets them
        for (const FmuMessage &message : messages_) {
            const std::byte *from = memory(message.block) + message.offset;
            inputs.emplace_back(from, from + size(message));
        }
        simulation_->reset();
        for (std::size_t i = 0; i < inputs.size(); i++) {
            std::copy(inputs[i].begin(), inputs[i].end(), memory(messages_[i].block) + messages_[i].offset);
        }
        changed_ = false;
        sent_.clear();
        run(0);
    }

    Ns advance(Ns until, bool stop)
    {
        const std::uint64_t before = happenings();
        sent_.clear();
        do {
            const Ns next = simulation_->next();
            run(stop ? std::min(next, until) : until);
        } while (stop && simulation_->time() < until && happenings() == before);
        return simulation_->time();
    }

    std::int32_t mode(std::uint32_t process) const
    {
        const sim::Process &p = *processes_.at(process);
        return p.mode().empty() ? -1 : p.mode_index(p.mode());
    }

    void enter(std::uint32_t process, std::int32_t mode)
    {
        sim::Process &p = *processes_.at(process);
        p.enter(p.modes().at(static_cast<std::size_t>(mode)).name);
    }

    std::uint32_t fired(std::uint32_t event) const
    {
        const auto &[process, e] = events_.at(event);
        return static_cast<std::uint32_t>(process->fired(*e).count);
    }

    std::uint32_t entered(std::uint32_t process) const
    {
        std::uint64_t n = 0;
        for (const sim::Mode &mode : processes_.at(process)->modes()) {
            n += processes_[process]->entered(mode).count;
        }
        return static_cast<std::uint32_t>(n);
    }

    /// Space packets, or, where flight speaks frames, a unit of them.
    void uplink(std::span<const std::uint8_t> bytes)
    {
        if (!commanded_ || !commanded_->dictionary()) {
            throw sim::SetupError("no flight process here takes packets");
        }
        while (!bytes.empty()) {
            const auto unit = bytes.first(flight_unit_size(bytes.data(), bytes.size(), frames_));
            commanded_->command({unit.begin(), unit.end()});
            bytes = bytes.subspan(unit.size());
        }
    }

    const std::vector<std::uint8_t> &sent() const { return sent_; }

    std::size_t state_size() const { return sizeof(std::uint64_t) + room_; }

    void save(void *to) const
    {
        const std::vector<std::byte> snapshot = simulation_->snapshot();
        const std::uint64_t n = snapshot.size();
        auto *bytes = static_cast<std::byte *>(to);
        std::memcpy(bytes, &n, sizeof n);
        std::copy(snapshot.begin(), snapshot.end(), bytes + sizeof n);
        std::fill(bytes + sizeof n + n, bytes + state_size(), std::byte{0});
    }

    void restore(const void *from, std::size_t size)
    {
        std::uint64_t n = 0;
        if (size == state_size()) {
            std::memcpy(&n, from, sizeof n);
        }
        if (size != state_size() || n > room_) {
            throw sim::SetupError("the state has " + std::to_string(size) + " bytes; those of this FMU have " +
                                  std::to_string(state_size()));
        }
        simulation_->restore({static_cast<const std::byte *>(from) + sizeof n, n});
        changed_ = true;
    }

    const FmuHost &host;

private:
    std::size_t size(const FmuMessage &message) const
    {
        return sim::field_at(blocks_.at(message.block)->type(), message.offset)->size;
    }

    void run(Ns until)
    {
        sim::RunControl control;
        control.same_parameters = !changed_;
        simulation_->run_until(until, control);
        changed_ = false;
        if (commanded_) {
            for (const sim::Packet &unit : commanded_->units.take()) {
                sent_.insert(sent_.end(), unit.bytes.begin(), unit.bytes.end());
            }
        }
    }

    /// How often something happened at which an importer may want to stop.
    std::uint64_t happenings() const
    {
        std::uint64_t n = 0;
        for (std::uint32_t i = 0; i < processes_.size(); i++) {
            n += entered(i);
        }
        for (std::uint32_t i = 0; i < events_.size(); i++) {
            n += fired(i);
        }
        return n;
    }

    /// That all variables lie in their blocks.
    void check() const
    {
        const auto inside = [&](std::uint32_t block, std::uint64_t end) {
            if (block >= blocks_.size() || end > blocks_[block]->type().size) {
                throw sim::SetupError("a variable lies outside of block " + std::to_string(block));
            }
        };
        for (const FmuVariable &v : variables_) {
            if (v.role <= FMU_FIXED) {
                inside(v.block, v.offset + std::uint64_t{v.n} * element_size(v.type));
            }
        }
        for (const FmuMessage &message : messages_) {
            inside(message.block, message.offset + sizeof(Head));
        }
    }

    std::unique_ptr<sim::Simulation> simulation_;
    std::vector<std::shared_ptr<sim::Instance>> blocks_;
    std::vector<FmuVariable> variables_;
    std::vector<FmuMessage> messages_;
    std::vector<sim::Process *> processes_;
    std::vector<std::pair<sim::Process *, std::shared_ptr<sim::Event>>> events_;
    sim::Process *commanded_ = nullptr;
    bool frames_ = false;            ///< it speaks them
    std::vector<std::uint8_t> sent_; ///< by the last run
    FmuLayout layout_{};
    std::size_t room_ = 0;
    bool changed_ = true; ///< parameters, since the last run
};

Flown &flown(void *self)
{
    return *static_cast<Flown *>(self);
}
const Flown &flown(const void *self)
{
    return *static_cast<const Flown *>(self);
}

/// -1 if the call throws, after the log has why: a line for each problem.
template <class Call> int guarded(const FmuHost &host, const std::string &what, const Call &call)
{
    std::string why;
    try {
        call();
        return 0;
    } catch (const std::exception &error) {
        why = error.what();
    } catch (...) {
        why = "an exception of an unknown kind";
    }
    for (std::size_t at = 0, end = 0; end != std::string::npos; at = end + 1) {
        end = why.find('\n', at);
        host.log(host.user, FMU_ERROR, "errors", (what + why.substr(at, end - at)).c_str());
    }
    return -1;
}

void *create(const FmuHost *host)
{
    Flown *made = nullptr;
    const char *const name = "composition.json";
    guarded(*host, std::string(host->resources) + "/" + name + ": ",
            [&] { made = new Flown(*host, json::parse(open(*host, name))); });
    return made;
}

void destroy(void *self)
{
    delete static_cast<Flown *>(self);
}

const FmuLayout *layout(const void *self)
{
    return flown(self).layout();
}

void *memory(void *self, std::uint32_t block)
{
    return flown(self).memory(block);
}

int changed(void *self, std::uint32_t block)
{
    return guarded(flown(self).host, "", [&] { flown(self).changed(block); });
}

int begin(void *self)
{
    return guarded(flown(self).host, "", [&] { flown(self).begin(); });
}

int advance(void *self, std::int64_t until, int stop, std::int64_t *reached)
{
    return guarded(flown(self).host, "", [&] { *reached = flown(self).advance(until, stop != 0); });
}

std::int32_t mode(const void *self, std::uint32_t process)
{
    return flown(self).mode(process);
}

int enter(void *self, std::uint32_t process, std::int32_t mode)
{
    return guarded(flown(self).host, "", [&] { flown(self).enter(process, mode); });
}

std::uint32_t fired(const void *self, std::uint32_t event)
{
    return flown(self).fired(event);
}

std::uint32_t entered(const void *self, std::uint32_t process)
{
    return flown(self).entered(process);
}

std::size_t state_size(void *self)
{
    return flown(self).state_size();
}

int uplink(void *self, const std::uint8_t *packets, std::size_t n)
{
    return guarded(flown(self).host, "", [&] { flown(self).uplink({packets, n}); });
}

const std::uint8_t *downlink(const void *self, std::size_t *n)
{
    *n = flown(self).sent().size();
    return flown(self).sent().data();
}

int save(void *self, void *bytes)
{
    return guarded(flown(self).host, "", [&] { flown(self).save(bytes); });
}

int restore(void *self, const void *bytes, std::size_t size)
{
    return guarded(flown(self).host, "", [&] { flown(self).restore(bytes, size); });
}

} // namespace

} // namespace fledge::fmi

extern "C" const FmuSystem fmu_system = {nullptr, // the composition has it
                                         fledge::fmi::create,
                                         fledge::fmi::destroy,
                                         fledge::fmi::layout,
                                         fledge::fmi::memory,
                                         fledge::fmi::changed,
                                         fledge::fmi::begin,
                                         fledge::fmi::advance,
                                         fledge::fmi::mode,
                                         fledge::fmi::enter,
                                         fledge::fmi::fired,
                                         fledge::fmi::entered,
                                         fledge::fmi::state_size,
                                         fledge::fmi::save,
                                         fledge::fmi::restore,
                                         fledge::fmi::uplink,
                                         fledge::fmi::downlink};
