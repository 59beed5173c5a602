// SPDX-License-Identifier: Apache-2.0
// JSON becomes a simulation: each function here has its counterpart in compose.cpp.
#include "fmi/simulation/composition.h"

#include "sim/library_file.h"
#include "world/avionics/radio_model.h"
#include "world/dynamics/ephemeris_craft_model.h"
#include "world/dynamics/spacecraft_model.h"
#include "world/environment/earth_atmosphere_model.h"
#include "world/environment/magnetism_model.h"
#include "world/models.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>

extern "C" {
extern const FledgeLibrary fledge_library_flight;
extern const FledgeLibrary fledge_library_world;
}

namespace fledge::fmi {

using nlohmann::json;

namespace {

std::vector<std::byte> unhex(const std::string &text)
{
    const auto digit = [&](char c) {
        const std::string_view digits = "0123456789abcdef";
        const std::size_t value = digits.find(c);
        if (value == std::string_view::npos || text.size() % 2) {
            throw sim::SetupError("its bytes are not hexadecimal: " + text.substr(0, 40));
        }
        return value;
    };
    std::vector<std::byte> bytes;
    for (std::size_t i = 0; i < text.size(); i += 2) {
        bytes.push_back(static_cast<std::byte>(digit(text[i]) * 16 + digit(text[i + 1])));
    }
    return bytes;
}

/// Into exactly n bytes.
void unhex(const std::string &text, void *to, std::size_t n)
{
    const std::vector<std::byte> bytes = unhex(text);
    if (bytes.size() != n) {
        throw sim::SetupError("it has " + std::to_string(bytes.size()) + " bytes; expected " + std::to_string(n));
    }
    std::memcpy(to, bytes.data(), n);
}

template <class T> std::optional<T> maybe(const json &value)
{
    return value.is_null() ? std::nullopt : std::optional(value.get<T>());
}

template <class Vector> Vector vector_of(const json &row)
{
    Vector v;
    for (Eigen::Index i = 0; i < v.size(); i++) {
        v[i] = row.at(static_cast<std::size_t>(i));
    }
    return v;
}

template <class Vector> std::vector<Vector> vectors_of(const json &rows)
{
    std::vector<Vector> all;
    std::transform(rows.begin(), rows.end(), std::back_inserter(all), vector_of<Vector>);
    return all;
}

std::vector<ExecRun> runs_of(const json &rows)
{
    std::vector<ExecRun> runs;
    for (const json &row : rows) {
        runs.push_back({row.at(0), row.at(1)});
    }
    return runs;
}

std::shared_ptr<const sim::Dictionary> dictionary_of(const json &d)
{
    auto made = std::make_shared<sim::Dictionary>();
    made->stream = d.at("stream");
    made->telemetry = d.at("telemetry");
    made->version = d.at("version");
    made->room = d.at("room");
    for (const json &row : d.at("blocks")) {
        sim::Dictionary::Block block{row.at(0), row.at(1), row.at(2), row.at(3), runs_of(row.at(4)), {}};
        for (const json &r : row.at(5)) {
            CommandRule rule{"", "", r.at(0), r.at(1), r.at(2), r.at(3), r.at(4), r.at(5), 0.0, 0.0};
            unhex(r.at(6), &rule.low, sizeof rule.low);
            unhex(r.at(7), &rule.high, sizeof rule.high);
            block.rules.push_back(rule);
        }
        made->blocks.push_back(std::move(block));
    }
    for (const json &row : d.at("outputs")) {
        made->outputs.push_back({row.at(0), row.at(1), row.at(2), runs_of(row.at(3))});
    }
    return made;
}

std::shared_ptr<const world::CraftEphemeris> ephemeris_of(const json &e)
{
    auto made = std::make_shared<world::CraftEphemeris>();
    for (const json &row : e.at("orbits")) {
        made->orbits.push_back({row.at(0), row.at(1), row.at(2), row.at(3), vectors_of<Eigen::Vector3d>(row.at(4)),
                                vectors_of<Eigen::Vector3d>(row.at(5))});
    }
    for (const json &row : e.at("attitudes")) {
        made->attitudes.push_back({row.at(0), row.at(1), row.at(2), vectors_of<Eigen::Vector4d>(row.at(3)),
                                   vectors_of<Eigen::Vector4d>(row.at(4))});
    }
    return made;
}

class Builder {
public:
    Builder(const json &composition, std::string folder)
        : all_(composition), folder_(std::move(folder)), built_(std::make_unique<sim::Simulation>(all_.at("seed")))
    {
    }

    std::unique_ptr<sim::Simulation> build()
    {
        read_libraries();
        for (const json &row : all_.at("skies")) {
            skies_.push_back(std::make_shared<world::Sky>(sky_setup(row)));
        }
        for (const json &row : all_.at("fields")) {
            fields_.push_back(
                world::read_harmonics({file(row.at("file")), maybe<int>(row.at("degree")), row.at("tides"),
                                       maybe<std::string>(row.at("date")), row.at("mu")}));
        }
        for (const json &row : all_.at("weathers")) {
            std::vector<std::string> paths;
            std::transform(row.begin(), row.end(), std::back_inserter(paths),
                           [&](const json &name) { return file(name); });
            weathers_.push_back(std::make_shared<world::SpaceWeather>(paths, world::TimeSystem()));
        }
        for (const json &row : all_.at("processes")) {
            add_process(row);
        }
        // What follows may use an instance of any process.
        for (const json &row : all_.at("processes")) {
            for (const json &instance : row.at("instances")) {
                const std::string path =
                    row.at("name").get<std::string>() + "." + instance.at("name").get<std::string>();
                if (sim::Model *model = instance_at(path)->model()) {
                    set_up(*model, path, instance);
                }
            }
            add_decisions(row);
        }
        join();
        return std::move(built_);
    }

private:
    std::string file(const std::string &name) const { return folder_ + "/" + name; }
    std::optional<std::string> maybe_file(const json &name) const
    {
        return name.is_null() ? std::nullopt : std::optional(file(name));
    }

    void add_types(const FledgeLibrary &library, std::span<const sim::ModelType> models)
    {
        for (std::uint32_t i = 0; i < library.n; i++) {
            types_[library.structs[i]->name] = {library.structs[i], nullptr};
        }
        for (const sim::ModelType &model : models) {
            types_[model.interface->name] = {model.interface, &model};
        }
    }

    void read_libraries()
    {
        add_types(fledge_library_flight, {});
        add_types(fledge_library_world, world::models());
        for (const auto &[name, path] : all_.value("libraries", std::map<std::string, std::string>())) {
            const sim::LibraryFile theirs = sim::open_library(path, name, &fledge_library_flight);
            add_types(*theirs.tables, theirs.models);
        }
        // The same for all, which several threads may build.
        static const bool once = [&] {
            sim::set_executive_types(*types_.at("ProcessMode").table, *types_.at("Activity").table);
            return true;
        }();
        (void)once;
    }

    world::SkySetup sky_setup(const json &row) const
    {
        world::SkySetup setup{row.at("epoch"),
                              row.at("center"),
                              {},
                              maybe_file(row.at("leap_seconds")),
                              maybe_file(row.at("pck")),
                              std::nullopt,
                              row.at("principal_axes"),
                              file("DE405")};
        for (const json &kernel : row.at("kernels")) {
            setup.kernels.push_back(kernel == "DE405" ? kernel.get<std::string>() : file(kernel));
        }
        if (const json &e = row.at("earth"); !e.is_null()) {
            const auto theory = e.at("iau1980") ? world::EarthData::Theory::iau1980 : world::EarthData::Theory::iau2006;
            setup.earth = {theory, maybe_file(e.at("eop")), maybe<double>(e.at("ut1_tai")), std::nullopt};
            if (const json &pole = e.at("pole"); !pole.is_null()) {
                setup.earth->pole = vector_of<Eigen::Vector2d>(pole);
            }
        }
        return setup;
    }

    world::GravityBody body(const json &row) const
    {
        world::GravityBody b;
        b.name = row.at("name");
        b.mu = row.at("mu");
        b.radius = row.at("radius");
        b.J = row.at("J");
        b.pole_N = vector_of<Eigen::Vector3d>(row.at("pole_N"));
        b.r_PN_N = vector_of<Eigen::Vector3d>(row.at("r_PN_N"));
        b.v_PN_N = vector_of<Eigen::Vector3d>(row.at("v_PN_N"));
        b.naif = maybe<int>(row.at("naif"));
        b.field = row.at("field").is_null() ? nullptr : fields_.at(row.at("field"));
        b.surface = maybe<double>(row.at("surface"));
        b.pole_stays = row.at("pole_stays");
        b.checked = row.at("checked");
        return b;
    }

    std::shared_ptr<sim::Instance> instance_at(const std::string &path) const
    {
        const std::size_t dot = path.find('.');
        auto found =
            dot == std::string::npos ? nullptr : built_->process(path.substr(0, dot)).find(path.substr(dot + 1));
        if (!found) {
            throw sim::SetupError("it has no instance " + path);
        }
        return found;
    }

    sim::Port port_at(const std::string &path) const
    {
        const std::size_t dot = path.rfind('.');
        const auto instance = instance_at(path.substr(0, dot));
        const FledgeField *field = sim::find_field(instance->type(), path.substr(dot + 1));
        if (!field) {
            throw sim::SetupError(instance->path + " has no port " + path.substr(dot + 1));
        }
        return {instance, field};
    }

    std::shared_ptr<sim::Instance> make_instance(const json &row, const std::string &path) const
    {
        const std::string name = row.at("type");
        const auto type = types_.find(name);
        if (type == types_.end() || type->second.table->hash != row.at("hash")) {
            throw sim::SetupError(path + ": its type " + name +
                                  (type == types_.end() ? " is in no library here" : " has another header here") +
                                  ": export the mission again");
        }
        const auto &[table, model] = type->second;
        auto instance = model ? std::make_shared<sim::Instance>(*model) : std::make_shared<sim::Instance>(*table);
        unhex(row.at("bytes"), instance->memory(), table->size);
        instance->given = row.at("given").get<std::vector<bool>>();
        instance->given.resize(table->n);
        return instance;
    }

    void add_process(const json &row)
    {
        sim::Process &p = built_->add_process(row.at("name"));
        if (const std::array<double, 2> tolerances = row.at("integrator"); tolerances[1] > 0.0) {
            p.set_integrator(sim::make_adaptive(tolerances[0], tolerances[1]));
        }
        for (const json &instance : row.at("instances")) {
            const std::string name = instance.at("name");
            p.add(name, make_instance(instance, p.name + "." + name));
        }
        for (const json &task : row.at("tasks")) {
            sim::Task made{task.at("name"), task.at("period"), task.at("offset"), task.at("priority"), {}};
            for (const json &path : task.at("run")) {
                made.run.push_back(instance_at(path));
            }
            p.add_task(std::move(made));
        }
    }

    void set_up(sim::Model &model, const std::string &path, const json &row) const
    {
        const auto as = [&]<class T>(T *model_of_type) -> T & {
            if (!model_of_type) {
                throw sim::SetupError(path + " is a " + row.at("type").get<std::string>() +
                                      ", which takes no such set-up");
            }
            return *model_of_type;
        };
        if (row.contains("sky")) {
            as(dynamic_cast<world::SkyUser *>(&model)).set_sky(skies_.at(row.at("sky")));
        }
        for (const json &b : row.value("gravity", json::array())) {
            as(dynamic_cast<world::SpacecraftModel *>(&model)).add_gravity(body(b));
        }
        for (const json &part : row.value("parts", json::array())) {
            as(dynamic_cast<world::SpacecraftModel *>(&model))
                .attach(as(dynamic_cast<world::Effector *>(instance_at(part)->model())));
        }
        const json bodies = row.value("bodies", json::array());
        for (std::size_t i = 0; i < bodies.size(); i++) {
            auto &environment = as(dynamic_cast<world::EnvironmentModel *>(&model));
            if (const world::GravityBody b = body(bodies[i]); i > 0) {
                environment.add_body(b);
            } else if (b.checked) { // else it has none, but others
                environment.set_body(b);
            }
        }
        for (const auto &[port, source] : row.value("sources", std::map<std::string, std::string>())) {
            set_source(as(dynamic_cast<world::Consumer *>(&model)), path + "." + port, port, source);
        }
        if (row.contains("serves")) {
            as(dynamic_cast<world::RadioModel *>(&model)).set_serves(row.at("serves"));
        }
        if (row.contains("coefficients")) {
            as(dynamic_cast<world::MagnetismModel *>(&model)).set_coefficients(file(row.at("coefficients")));
        }
        if (row.contains("weather")) {
            as(dynamic_cast<world::EarthAtmosphereModel *>(&model)).set_weather(weathers_.at(row.at("weather")));
        }
        if (row.contains("ephemeris")) {
            as(dynamic_cast<world::EphemerisCraftModel *>(&model)).set_ephemeris(ephemeris_of(row.at("ephemeris")));
        }
    }

    void set_source(world::Consumer &consumer, const std::string &path, const std::string &port,
                    const std::string &source) const
    {
        world::Consumer *end = port.empty() ? &consumer : nullptr;
        for (const auto &further : consumer.further()) {
            end = further.port == port ? further.consumer : end;
        }
        sim::Model *model = instance_at(source)->model();
        if (!end || !model || !end->set_source(*model)) {
            throw sim::SetupError(path + " cannot take " + source + " as its source");
        }
    }

    std::optional<sim::Condition> condition_of(const json &row) const
    {
        if (row.is_null()) {
            return std::nullopt;
        }
        const auto operand = [&](const json &o) {
            sim::Operand made;
            made.type = o.at("type");
            if (o.contains("constant")) {
                unhex(o.at("constant"), made.constant.data(), made.constant.size());
                return made;
            }
            made.instance = instance_at(o.at("instance"));
            made.offset = o.at("offset");
            made.elements = o.at("elements");
            made.measure = o.at("measure");
            if (made.offset + made.elements * element_size(made.type) > made.instance->type().size) {
                throw sim::SetupError("a condition reads beyond " + made.instance->path);
            }
            return made;
        };
        std::vector<sim::Condition::Step> steps;
        for (const json &step : row.at("steps")) {
            sim::Condition::Step &made = steps.emplace_back();
            made.join = step.at("join");
            if (made.join == EXEC_COMPARE) {
                made.comparison = {operand(step.at("left")), operand(step.at("right")), step.at("relation")};
            }
        }
        return sim::Condition(std::move(steps), row.at("text"));
    }

    sim::Event event_of(const json &row) const
    {
        sim::Event event;
        event.name = row.at("name");
        event.condition = condition_of(row.at("when"));
        event.until = condition_of(row.at("until"));
        event.hold = row.at("hold");
        event.count = row.at("count");
        event.once = row.at("once");
        event.armed = row.at("armed");
        event.text = row.at("text");
        event.modes = row.at("modes");
        event.mode = row.at("mode");
        event.arms = row.at("arms").get<std::vector<std::pair<std::string, bool>>>();
        for (const json &s : row.at("set")) {
            event.set.push_back({instance_at(s.at(0)), s.at(1), unhex(s.at(2))});
        }
        return event;
    }

    void add_decisions(const json &row)
    {
        sim::Process &p = built_->process(row.at("name").get<std::string>());
        for (const json &mode : row.at("modes")) {
            p.add_mode({mode.at("name"), mode.at("tasks"), condition_of(mode.at("when")), mode.at("after"), {}});
        }
        if (row.contains("initial")) {
            p.start_in(row.at("initial"));
        }
        for (const json &event : row.at("events")) {
            p.add_event(event_of(event));
        }
        if (row.contains("reset")) {
            p.reset_by(port_at(row.at("reset").at("input")), row.at("reset").at("down"));
        }
        if (!row.at("dictionary").is_null()) {
            p.set_dictionary(dictionary_of(row.at("dictionary")));
        }
    }

    void join()
    {
        std::map<std::string, bool> outside;
        for (const json &row : all_.at("processes")) {
            outside[row.at("name")] = row.at("outside");
        }
        for (const json &row : all_.at("wires")) {
            const std::string from = row.at("from");
            sim::WireOptions options{row.at("latency"), row.at("stale_after"), row.at("by"),
                                     row.at("mode"),    row.at("more"),        {}};
            if (outside.at(from.substr(0, from.find('.')))) {
                options.latency = 0; // the importer exchanges messages
            }
            built_->connect(port_at(from), port_at(row.at("to")), options);
        }
        for (const json &row : all_.at("feeds")) {
            auto messages = std::make_shared<sim::Messages>();
            messages->times = row.at("times").get<std::vector<sim::Ns>>();
            messages->bytes = unhex(row.at("bytes"));
            built_->feed({port_at(row.at("to")), messages, row.at("always"), row.at("linear"), row.at("stale_after"),
                          row.at("source")});
        }
        for (const auto &[name, flown] : outside) {
            if (flown) {
                built_->process(name).fly_by([](sim::Ns) {});
            }
        }
    }

    struct Type {
        const FledgeStruct *table;
        const sim::ModelType *model;
    };

    const json &all_;
    std::string folder_;
    std::unique_ptr<sim::Simulation> built_;
    std::map<std::string, Type> types_;
    std::vector<std::shared_ptr<const world::Sky>> skies_;
    std::vector<std::shared_ptr<const world::Harmonics>> fields_;
    std::vector<std::shared_ptr<const world::SpaceWeather>> weathers_;
};

} // namespace

std::unique_ptr<sim::Simulation> build(const json &composition, const std::string &folder)
{
    try {
        if (composition.at("format") != 1) {
            throw sim::SetupError("its format is " + composition.at("format").dump() + ", expected 1");
        }
        return Builder(composition, folder).build();
    } catch (const json::exception &error) {
        throw sim::SetupError(error.what());
    } catch (const std::out_of_range &) {
        throw sim::SetupError("a number in it counts beyond the end of a list");
    }
}

std::vector<std::shared_ptr<sim::Instance>> blocks(const sim::Simulation &simulation)
{
    std::vector<std::shared_ptr<sim::Instance>> all;
    for (const auto &process : simulation.processes()) {
        all.insert(all.end(), process->instances().begin(), process->instances().end());
    }
    return all;
}

} // namespace fledge::fmi
