// SPDX-License-Identifier: Apache-2.0
// The simulation becomes JSON: each function here has its counterpart in composition.cpp.
#include "fmi/simulation/composition.h"

#include "sim/text.h"
#include "world/avionics/radio_model.h"
#include "world/dynamics/ephemeris_craft_model.h"
#include "world/dynamics/spacecraft_model.h"
#include "world/environment/earth_atmosphere_model.h"
#include "world/environment/magnetism_model.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

namespace fledge::fmi {

using nlohmann::json;

namespace {

std::string hex(const void *bytes, std::size_t n)
{
    static const char digits[] = "0123456789abcdef";
    std::string text;
    for (const auto *p = static_cast<const unsigned char *>(bytes); n > 0; n--, p++) {
        text += {digits[*p >> 4u], digits[*p & 15u]};
    }
    return text;
}

template <class T> json or_null(const std::optional<T> &value)
{
    return value ? json(*value) : json();
}

template <class Vector> json numbers(const Vector &v)
{
    return std::vector<double>(v.data(), v.data() + v.size());
}

json condition(const std::optional<sim::Condition> &condition)
{
    if (!condition) {
        return {};
    }
    const auto operand = [](const sim::Operand &o) -> json {
        if (!o.instance) {
            return {{"constant", hex(o.constant.data(), o.constant.size())}, {"type", o.type}};
        }
        return {{"instance", o.instance->path},
                {"offset", o.offset},
                {"type", o.type},
                {"elements", o.elements},
                {"measure", o.measure}};
    };
    json steps = json::array();
    for (const sim::Condition::Step &step : condition->steps()) {
        json entry{{"join", step.join}};
        if (step.join == EXEC_COMPARE) {
            const auto &[left, right, relation] = step.comparison;
            entry.update({{"left", operand(left)}, {"relation", relation}, {"right", operand(right)}});
        }
        steps.push_back(entry);
    }
    return {{"text", condition->text()}, {"steps", steps}};
}

json event(const sim::Event &e)
{
    json set = json::array();
    for (const sim::Setting &s : e.set) {
        set.push_back({s.instance->path, s.offset, hex(s.bytes.data(), s.bytes.size())});
    }
    return {{"name", e.name},
            {"when", condition(e.condition)},
            {"until", condition(e.until)},
            {"hold", e.hold},
            {"count", e.count},
            {"once", e.once},
            {"armed", e.armed},
            {"text", e.text},
            {"modes", e.modes},
            {"mode", e.mode},
            {"arms", e.arms},
            {"set", set}};
}

json runs(const std::vector<ExecRun> &runs)
{
    json rows = json::array();
    for (const ExecRun &run : runs) {
        rows.push_back({run.width, run.n});
    }
    return rows;
}

json dictionary(const std::shared_ptr<const sim::Dictionary> &d)
{
    if (!d) {
        return {};
    }
    json blocks = json::array(), outputs = json::array();
    for (const auto &block : d->blocks) {
        json rules = json::array();
        for (const CommandRule &r : block.rules) {
            rules.push_back({r.offset, r.n, r.row, r.rows_at, r.flags, r.number, hex(&r.low, sizeof r.low),
                             hex(&r.high, sizeof r.high)});
        }
        blocks.push_back({block.instance, block.offset, block.size, block.configuration, runs(block.runs), rules});
    }
    for (const auto &output : d->outputs) {
        outputs.push_back({output.instance, output.offset, output.size, runs(output.runs)});
    }
    return {{"stream", d->stream}, {"telemetry", d->telemetry}, {"version", d->version},
            {"room", d->room},     {"blocks", blocks},          {"outputs", outputs}};
}

json ephemeris(const world::CraftEphemeris &e)
{
    const auto rows = [](const auto &vectors) {
        json all = json::array();
        for (const auto &vector : vectors) {
            all.push_back(numbers(vector));
        }
        return all;
    };
    json orbits = json::array(), attitudes = json::array();
    for (const auto &[begin, end, degree, t, r, v] : e.orbits) {
        orbits.push_back({begin, end, degree, t, rows(r), rows(v)});
    }
    for (const auto &[begin, end, t, beta, rates] : e.attitudes) {
        attitudes.push_back({begin, end, t, rows(beta), rows(rates)});
    }
    return {{"orbits", orbits}, {"attitudes", attitudes}};
}

class Composer {
public:
    explicit Composer(const sim::Simulation &simulation) : simulation_(simulation)
    {
        for (const auto &instance : blocks(simulation)) {
            paths_[instance->model()] = instance->path;
        }
    }

    Composition compose(const std::string &process)
    {
        json processes = json::array();
        for (const auto &p : simulation_.processes()) {
            processes.push_back(process_of(*p, !process.empty() && p->name != process));
        }
        json all{{"format", 1}, {"seed", simulation_.seed()}, {"processes", processes}, {"wires", wires()}};
        all.update({{"feeds", feeds()}, {"skies", skies_.rows}, {"weathers", weathers_.rows}});
        all["fields"] = fields_.rows;
        if (!faults_.all().empty()) {
            throw sim::CompositionError(faults_.all());
        }
        return {all.dump(), {files_.begin(), files_.end()}};
    }

private:
    /// What several models share, once.
    struct Shared {
        std::vector<const void *> known;
        json rows = json::array();

        template <class Row> std::size_t place(const void *what, const Row &row)
        {
            const auto found = std::find(known.begin(), known.end(), what);
            if (found != known.end()) {
                return static_cast<std::size_t>(found - known.begin());
            }
            rows.push_back(row()); // which may add to others
            known.push_back(what);
            return known.size() - 1;
        }
    };

    /// The name of a file among those of the composition.
    std::string file(const std::string &path)
    {
        if (const auto found = files_.find(path); found != files_.end()) {
            return found->second;
        }
        const std::string name = std::filesystem::path(path).filename().string();
        const auto taken = [&](const std::string &other) {
            return std::ranges::any_of(files_, [&](const auto &entry) { return entry.second == other; });
        };
        std::string free = name;
        for (int i = 2; taken(free); i++) {
            free = std::to_string(i) + "_" + name;
        }
        return files_[path] = free;
    }

    json file(const std::optional<std::string> &path) { return path ? json(file(*path)) : json(); }

    std::size_t sky(const world::Sky &sky, const std::string &path)
    {
        return skies_.place(&sky, [&]() -> json {
            if (!sky.setup()) {
                faults_.add(path + ".sky: it was not made of files");
                return {};
            }
            const world::SkySetup &s = *sky.setup();
            json kernels = json::array(), earth;
            for (const std::string &kernel : s.kernels) {
                kernels.push_back(kernel == "DE405" ? kernel : file(kernel));
            }
            if (s.principal_axes || std::ranges::count(s.kernels, "DE405")) {
                for (const char *part : {"table.dat", "table.f0i"}) {
                    files_[s.de405 + "/" + part] = std::string("DE405/") + part;
                }
            }
            if (const auto &e = s.earth) {
                earth = {{"iau1980", e->theory == world::EarthData::Theory::iau1980},
                         {"eop", file(e->eop)},
                         {"ut1_tai", or_null(e->ut1_tai)},
                         {"pole", e->pole ? numbers(*e->pole) : json()}};
            }
            return {{"epoch", s.epoch},
                    {"center", s.center},
                    {"kernels", kernels},
                    {"earth", earth},
                    {"pck", file(s.pck)},
                    {"leap_seconds", file(s.leap_seconds)},
                    {"principal_axes", s.principal_axes}};
        });
    }

    json field(const std::shared_ptr<const world::Harmonics> &field, const std::string &path)
    {
        if (!field) {
            return {};
        }
        return fields_.place(field.get(), [&]() -> json {
            if (!field->setup) {
                faults_.add(path + ": its gravity field was not read from a file");
                return {};
            }
            const auto &[name, degree, tides, date, mu] = *field->setup;
            return {{"file", file(name)},
                    {"degree", or_null(degree)},
                    {"tides", tides},
                    {"date", or_null(date)},
                    {"mu", mu}};
        });
    }

    json bodies(const std::vector<world::GravityBody> &bodies, const std::string &path)
    {
        json rows = json::array();
        for (const world::GravityBody &b : bodies) {
            rows.push_back({{"name", b.name},
                            {"mu", b.mu},
                            {"radius", b.radius},
                            {"J", b.J},
                            {"pole_N", numbers(b.pole_N)},
                            {"r_PN_N", numbers(b.r_PN_N)},
                            {"v_PN_N", numbers(b.v_PN_N)},
                            {"naif", or_null(b.naif)},
                            {"field", field(b.field, path)},
                            {"surface", or_null(b.surface)},
                            {"pole_stays", b.pole_stays},
                            {"checked", b.checked}});
        }
        return rows;
    }

    /// The set-up that Model::copy_setup() copies.
    void set_up(sim::Model &model, const std::string &path, json &entry)
    {
        if (const auto *user = dynamic_cast<const world::SkyUser *>(&model); user && user->sky()) {
            entry["sky"] = sky(*user->sky(), path);
        }
        if (const auto *craft = dynamic_cast<const world::SpacecraftModel *>(&model)) {
            entry["gravity"] = bodies(craft->gravity(), path);
            for (const sim::Model *part : craft->parts()) {
                entry["parts"].push_back(paths_.at(part));
            }
        }
        if (const auto *environment = dynamic_cast<const world::EnvironmentModel *>(&model)) {
            entry["bodies"] = bodies(environment->bodies(), path);
        }
        if (auto *consumer = dynamic_cast<world::Consumer *>(&model)) {
            auto ports = consumer->further();
            ports.push_back({"", consumer});
            for (const auto &[port, end] : ports) {
                if (const sim::Model *source = end->source()) {
                    entry["sources"][std::string(port)] = paths_.at(source);
                }
            }
        }
        if (const auto *radio = dynamic_cast<const world::RadioModel *>(&model)) {
            entry["serves"] = radio->serves();
        }
        if (const auto *field = dynamic_cast<const world::MagnetismModel *>(&model);
            field && !field->coefficients().empty()) {
            entry["coefficients"] = file(field->coefficients());
        }
        if (const auto *air = dynamic_cast<const world::EarthAtmosphereModel *>(&model); air && air->weather()) {
            entry["weather"] = weathers_.place(air->weather().get(), [&] {
                json names = json::array();
                for (const std::string &name : air->weather()->paths()) {
                    names.push_back(file(name));
                }
                return names;
            });
        }
        if (const auto *craft = dynamic_cast<const world::EphemerisCraftModel *>(&model); craft && craft->ephemeris()) {
            entry["ephemeris"] = ephemeris(*craft->ephemeris());
        }
    }

    json instance_of(const sim::Instance &instance)
    {
        const sim::Script &script = instance.script;
        if (script.update || script.begin || script.prepare || script.at_place || script.reset) {
            faults_.add(instance.path +
                            " is still Python, which an FMU cannot fly: write it in C or C++ (./fledge new " +
                            (instance.model() ? "model" : "module") + " begins it)",
                        instance.at);
        }
        json entry{{"name", instance.name},
                   {"type", instance.type().name},
                   {"hash", instance.type().hash},
                   {"bytes", hex(instance.memory(), instance.type().size)},
                   {"given", instance.given}};
        if (instance.model()) {
            set_up(*instance.model(), instance.path, entry);
        }
        return entry;
    }

    json process_of(const sim::Process &p, bool outside)
    {
        if (std::ranges::any_of(p.instances(),
                                [](const auto &i) { return i->maker != sim::Instance::Maker::itself; })) {
            faults_.add(p.name + " is a record that is played, or another program flies it: export the mission itself");
        }
        json instances = json::array(), tasks = json::array(), modes = json::array(), events = json::array();
        for (const auto &instance : p.instances()) {
            instances.push_back(instance_of(*instance));
        }
        for (const sim::Task &task : p.tasks()) {
            json run = json::array();
            for (const auto &instance : task.run) {
                run.push_back(instance->path);
            }
            tasks.push_back({{"name", task.name},
                             {"period", task.period},
                             {"offset", task.offset},
                             {"priority", task.priority},
                             {"run", run}});
        }
        for (const sim::Mode &mode : p.modes()) {
            modes.push_back(
                {{"name", mode.name}, {"tasks", mode.tasks}, {"when", condition(mode.when)}, {"after", mode.after}});
        }
        json entry{{"name", p.name}, {"outside", outside}, {"integrator", p.integrator().tolerances()}};
        entry.update({{"instances", instances}, {"tasks", tasks}, {"modes", modes}});
        if (!p.mode().empty()) {
            entry["initial"] = p.mode();
        }
        for (const auto &e : p.events()) {
            if (!outside && !e->is_data()) {
                faults_.add("event " + p.name + "." + e->name + " calls Python, which an FMU cannot: let it be data " +
                                "(when=watch(...), enter, arm, disarm, set), or leave it out of the mission",
                            e->at);
            } else if (!outside) {
                events.push_back(event(*e));
            }
        }
        entry["events"] = events;
        if (const auto &line = p.reset_line(); line && !outside) {
            entry["reset"] = {{"input", line->input.path()}, {"down", line->down}};
        }
        entry["dictionary"] = outside ? json() : dictionary(p.dictionary());
        return entry;
    }

    json wires() const
    {
        json rows = json::array();
        for (const sim::Wire &wire : simulation_.wires()) {
            const sim::WireOptions &o = wire.options;
            rows.push_back({{"from", wire.from.path()},
                            {"to", wire.to.path()},
                            {"latency", o.latency},
                            {"stale_after", o.stale_after},
                            {"by", o.by},
                            {"mode", o.mode},
                            {"more", o.more}});
        }
        return rows;
    }

    json feeds()
    {
        json rows = json::array();
        for (const sim::Feed &feed : simulation_.feeds()) {
            if (!feed.messages) {
                faults_.add(feed.to.path() + " is fed by another program");
                continue;
            }
            const auto &[times, bytes] = *feed.messages;
            rows.push_back({{"to", feed.to.path()},
                            {"times", times},
                            {"bytes", hex(bytes.data(), bytes.size())},
                            {"always", feed.always},
                            {"linear", feed.linear},
                            {"stale_after", feed.stale_after},
                            {"source", feed.source}});
        }
        return rows;
    }

    const sim::Simulation &simulation_;
    std::map<const sim::Model *, std::string> paths_;
    std::map<std::string, std::string> files_;
    Shared skies_, fields_, weathers_;
    sim::Faults faults_;
};

} // namespace

Composition compose(const sim::Simulation &simulation, const std::string &process)
{
    if (simulation.time() >= 0) {
        throw sim::SetupError("the simulation has run until " + sim::format_time(simulation.time()) +
                              ": export it before it runs");
    }
    sim::Faults faults;
    if (!process.empty()) {
        for (const auto &[what, other] : simulation.cross_process_dependencies(process)) {
            faults.add(what + " depends on " + other + ", of another process");
        }
    }
    faults.raise();
    return Composer(simulation).compose(process);
}

} // namespace fledge::fmi
