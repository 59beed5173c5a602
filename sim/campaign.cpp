// SPDX-License-Identifier: Apache-2.0
#include "sim/campaign.h"

#include "flight/math/elementary.h"
#include "sim/random.h"
#include "sim/text.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstring>
#include <limits>
#include <mutex>
#include <thread>

namespace fledge::sim {

namespace {

constexpr double pi = 3.14159265358979323846;
constexpr int draws_max = 10'000; ///< tries to draw between the bounds of a normal distribution
constexpr double far = 8.0;       ///< standard deviations; practically no draw is farther from the mean

std::shared_ptr<Instance> find_instance(const Simulation &simulation, std::string_view path)
{
    for (const auto &process : simulation.processes()) {
        for (const auto &instance : process->instances()) {
            if (instance->path == path) {
                return instance;
            }
        }
    }
    return nullptr;
}

std::vector<std::string> instance_paths(const Simulation &simulation)
{
    std::vector<std::string> paths;
    for (const auto &process : simulation.processes()) {
        for (const auto &instance : process->instances()) {
            paths.push_back(instance->path);
        }
    }
    return paths;
}

/// The names that may follow an instance's path.
std::vector<std::string> dispersible(const FledgeStruct &type)
{
    std::vector<std::string> names;
    for (const FledgeField &field : fields(type)) {
        if (field.group == FLEDGE_PAR && field.type == FLEDGE_F64) {
            names.emplace_back(field.name);
        }
    }
    return names;
}

/// An instance and the field of a path "process.instance.field"; throws SetupError.
std::pair<std::shared_ptr<Instance>, const FledgeField *> find_path(const Simulation &simulation,
                                                                    const std::string &path)
{
    const auto dot = path.rfind('.');
    const std::string owner = path.substr(0, dot == std::string::npos ? 0 : dot);
    const auto instance = find_instance(simulation, owner);
    if (!instance) {
        throw SetupError(path + ": there is no instance " + (owner.empty() ? path : owner) + "; there are " +
                         format_list(instance_paths(simulation)));
    }
    return {instance, find_field(instance->type(), path.substr(dot + 1))};
}

double nominal_value(const Instance &instance, const FledgeField &field, std::size_t element)
{
    double x;
    std::memcpy(&x, instance.memory() + field.offset + element * sizeof x, sizeof x);
    return x;
}

/// The element across the diagonal of an inertia; of anything else, the element itself.
std::size_t mirror(const FledgeField &field, std::size_t element)
{
    return field.flags & FLEDGE_INERTIA ? element % 3 * 3 + element / 3 : element;
}

void set_element(const FledgeField &field, std::byte *memory, std::size_t element, double x)
{
    for (const std::size_t i : {element, mirror(field, element)}) {
        std::memcpy(memory + field.offset + i * sizeof x, &x, sizeof x);
    }
}

/// sigma = q_v / (1 + q_0) of a uniformly distributed quaternion (Shoemake 1992), |sigma| <= 1.
std::array<double, 3> random_attitude(Random &random)
{
    const double u = random.uniform(), v = 2.0 * pi * random.uniform(), w = 2.0 * pi * random.uniform();
    double sv, cv, sw, cw;
    fm_sincos(v, &sv, &cv);
    fm_sincos(w, &sw, &cw);
    const double a = std::sqrt(1.0 - u), b = std::sqrt(u);
    const double q0 = b * cw, sign = q0 < 0.0 ? -1.0 : 1.0, scale = sign / (1.0 + sign * q0);
    return {scale * a * sv, scale * a * cv, scale * b * sw};
}

double absolute(const Distribution &distribution, double nominal, double x)
{
    return distribution.relative ? nominal * x : distribution.about ? nominal + x : x;
}

double draw(const Distribution &distribution, Random &random, double nominal, const std::string &path)
{
    if (distribution.kind == Distribution::Kind::uniform) {
        return absolute(distribution, nominal, distribution.a + (distribution.b - distribution.a) * random.uniform());
    }
    for (int i = 0; i < draws_max; i++) {
        const double x = distribution.a + distribution.b * random.normal();
        if (x >= distribution.lo && x <= distribution.hi) {
            return absolute(distribution, nominal, x);
        }
    }
    throw SetupError(path + ": of " + std::to_string(draws_max) + " draws none fell between " +
                     format_number(distribution.lo) + " and " + format_number(distribution.hi));
}

/// Whether the draws of one element can keep the rule in the header. Throws SetupError.
void check_reach(const Instance &instance, const FledgeField &field, std::size_t element, const Distribution &d)
{
    const double nominal = nominal_value(instance, field, element);
    const FledgeStruct &type = instance.type();
    const auto fault = [&](double x) -> std::string {
        std::vector<std::byte> bytes(instance.memory(), instance.memory() + type.size);
        set_element(field, bytes.data(), element, absolute(d, nominal, x));
        try {
            check_field(type, field, bytes.data(), instance.path);
        } catch (const SetupError &error) {
            return error.what();
        }
        return "";
    };
    const bool normal = d.kind == Distribution::Kind::normal;
    const double low = normal ? std::max(d.lo, d.a - far * d.b) : d.a;
    const double high = normal ? std::min(d.hi, d.a + far * d.b) : d.b;
    const bool bounded_below = !normal || low == d.lo, bounded_above = !normal || high == d.hi;
    const std::string at_low = fault(low), at_high = fault(high);
    const bool out_of_reach = !at_low.empty() && !at_high.empty() && !fault(std::clamp(d.a, low, high)).empty();
    for (const auto &[text, counts] : {std::pair{at_low, bounded_below}, std::pair{at_high, bounded_above}}) {
        if (!text.empty() && (counts || out_of_reach)) {
            throw SetupError(text + ", of draws between " + format_number(absolute(d, nominal, low)) + " and " +
                             format_number(absolute(d, nominal, high)));
        }
    }
}

/// Flies runs one after the other in a simulation of its own, and stores their results.
class Worker {
public:
    Worker(const Simulation &nominal, Simulation &own, const CampaignPlan &plan)
        : nominal_(nominal), own_(own), plan_(plan)
    {
        for (const Retained &variable : plan.retained) {
            const auto [instance, field] = find_path(own, variable.port);
            logs_.push_back(own.recorder().record(instance, *field, plan.every));
        }
    }

    void fly(std::size_t run, CampaignResult &result, const std::atomic<bool> &stop)
    {
        std::vector<double> draws;
        try {
            if (own_.prepared()) { // false after a run with invalid draws
                own_.reset();
            }
            draws = disperse(nominal_, own_, plan_, plan_.first + run);
            RunControl control;
            control.poll = [&](Ns) { return !stop; };
            if (!own_.run_until(plan_.duration, control)) {
                return;
            }
        } catch (const std::exception &error) {
            result.failures[run] = error.what();
        }
        result.flown[run] = 1;
        result.health[run] = own_.health();
        std::copy(draws.begin(), draws.end(), result.draws.begin() + static_cast<std::ptrdiff_t>(run * draws.size()));
        for (std::size_t i = 0; i < logs_.size(); i++) {
            keep(*logs_[i], plan_.retained[i], result.samples, result.failures[run].empty(),
                 result.retained[i].data() + run * result.samples * plan_.retained[i].elements);
        }
    }

private:
    /// Between two instants, the samples repeat the message of the first one.
    static void keep(const Log &log, const Retained &variable, std::size_t samples, bool complete, double *to)
    {
        const auto index = [&](Ns t) { return static_cast<std::size_t>(t / log.every); };
        std::size_t k = 0;
        for (std::size_t i = 0; i < log.times.size(); i++) {
            const std::byte *from = log.bytes.data() + i * log.field->size + variable.offset;
            const bool last = i + 1 == log.times.size();
            const std::size_t end = complete && last ? samples
                                    : last           ? index(log.times[i]) + 1
                                                     : index(log.times[i + 1]);
            for (; k < std::min(samples, end); k++) {
                std::memcpy(to + k * variable.elements, from, variable.elements * sizeof(double));
            }
        }
    }

    const Simulation &nominal_;
    Simulation &own_;
    const CampaignPlan &plan_;
    std::vector<std::shared_ptr<Log>> logs_;
};

std::size_t dispersed_elements(const CampaignPlan &plan)
{
    std::size_t n = 0;
    for (const Dispersion &dispersion : plan.dispersions) {
        n += dispersion.elements.size();
    }
    return n;
}

/// A result of the right size, filled with NaN.
CampaignResult room_for(const CampaignPlan &plan)
{
    const double none = std::numeric_limits<double>::quiet_NaN();
    CampaignResult result;
    result.samples = static_cast<std::size_t>(plan.duration / plan.every) + 1;
    result.flown.resize(plan.runs);
    result.failures.resize(plan.runs);
    result.health.resize(plan.runs);
    result.draws.assign(plan.runs * dispersed_elements(plan), none);
    for (const Retained &variable : plan.retained) {
        result.retained.emplace_back(plan.runs * result.samples * variable.elements, none);
    }
    return result;
}

} // namespace

Distribution::Distribution() : lo(-std::numeric_limits<double>::infinity()), hi(std::numeric_limits<double>::infinity())
{
}

bool has_callables(const Simulation &simulation)
{
    for (const auto &process : simulation.processes()) {
        for (const auto &event : process->events()) {
            if (event->predicate || event->action) {
                return true;
            }
        }
    }
    return false;
}

void check_dispersion(const Simulation &nominal, const Dispersion &dispersion)
{
    const auto [instance, field] = find_path(nominal, dispersion.path);
    if (!field || field->group != FLEDGE_PAR || field->type != FLEDGE_F64) {
        throw SetupError(dispersion.path + " is no parameter that can be dispersed; " + instance->path + " has " +
                         format_list(dispersible(instance->type())));
    }
    const std::size_t n = field_elements(*field);
    for (std::size_t element : dispersion.elements) {
        if (element >= n) {
            throw SetupError(dispersion.path + " has " + std::to_string(n) + " elements; there is no element " +
                             std::to_string(element));
        }
    }
    const Distribution &d = dispersion.distribution;
    const auto refuse = [&](const std::string &rule) { throw SetupError(dispersion.path + ": " + rule); };
    if (!std::isfinite(d.a) || !std::isfinite(d.b) || std::isnan(d.lo) || std::isnan(d.hi)) {
        refuse("a distribution needs finite numbers");
    }
    switch (d.kind) {
    case Distribution::Kind::uniform:
        if (!(d.a <= d.b)) {
            refuse("uniform between " + format_number(d.a) + " and " + format_number(d.b) +
                   ": the lower bound is above the upper one");
        }
        break;
    case Distribution::Kind::normal:
        if (!(d.b >= 0.0)) {
            refuse("a standard deviation must be >= 0, found " + format_number(d.b));
        }
        if (!(d.lo < d.hi) || d.lo > d.a + far * d.b || d.hi < d.a - far * d.b) {
            refuse("a normal distribution about " + format_number(d.a) + " with deviation " + format_number(d.b) +
                   " never falls between " + format_number(d.lo) + " and " + format_number(d.hi));
        }
        break;
    case Distribution::Kind::attitude:
        if (dispersion.elements != std::vector<std::size_t>{0, 1, 2} || n != 3) {
            refuse("a random attitude needs the three elements of an MRP");
        }
        return;
    }
    const auto still = [&](std::size_t i) { return nominal_value(*instance, *field, i) == 0.0; };
    if (d.relative && std::all_of(dispersion.elements.begin(), dispersion.elements.end(), still)) {
        refuse("its nominal value is 0, which no factor changes");
    }
    for (std::size_t element : dispersion.elements) {
        check_reach(*instance, *field, element, d);
    }
}

void check_retained(const Simulation &nominal, const Retained &variable)
{
    const auto [instance, field] = find_path(nominal, variable.port);
    if (!field || field->type != FLEDGE_STRUCT || (field->group != FLEDGE_IN && field->group != FLEDGE_OUT)) {
        throw SetupError(variable.port + " is no input or output, and only these are retained; " + instance->path +
                         " has " + format_list(field_names(instance->type(), FLEDGE_OUT)));
    }
    if (variable.offset + variable.elements * sizeof(double) > field->size) {
        throw SetupError(variable.port + ": the retained field lies outside the message");
    }
}

void check_plan(const Simulation &nominal, const CampaignPlan &plan)
{
    if (plan.runs == 0) {
        throw SetupError("a campaign needs at least one run");
    }
    if (plan.duration <= 0) {
        throw SetupError("the runs' duration must be > 0, found " + format_time(plan.duration));
    }
    if (plan.every <= 0) {
        throw SetupError("the time between retained samples must be > 0, found " + format_time(plan.every));
    }
    std::vector<std::string> drawn;
    for (const Dispersion &dispersion : plan.dispersions) {
        check_dispersion(nominal, dispersion);
        const FledgeField &field = *find_path(nominal, dispersion.path).second;
        for (std::size_t element : dispersion.elements) {
            const std::string path = dispersion.path + index_text(field, std::min(element, mirror(field, element)));
            if (std::find(drawn.begin(), drawn.end(), path) != drawn.end()) {
                throw SetupError(path + " is dispersed twice");
            }
            drawn.push_back(path);
        }
    }
    for (const Retained &variable : plan.retained) {
        check_retained(nominal, variable);
    }
}

std::vector<double> disperse(const Simulation &nominal, Simulation &simulation, const CampaignPlan &plan,
                             std::size_t index)
{
    const std::string run = "run " + std::to_string(index);
    simulation.set_seed(Random(plan.seed, run).bits());
    std::vector<double> draws;
    for (const Dispersion &dispersion : plan.dispersions) {
        const auto [from, field] = find_path(nominal, dispersion.path);
        const auto to = find_instance(simulation, from->path);
        const auto set = [&](std::size_t element, double x) {
            set_element(*field, to->memory(), element, x);
            draws.push_back(x);
        };
        if (dispersion.distribution.kind == Distribution::Kind::attitude) {
            Random random(plan.seed, run + " " + dispersion.path);
            const auto sigma = random_attitude(random);
            for (std::size_t i = 0; i < 3; i++) {
                set(i, sigma[i]);
            }
            continue;
        }
        for (std::size_t element : dispersion.elements) {
            // A stream for each element, so that one dispersion more changes no other's draws.
            const std::string path = dispersion.path + index_text(*field, element);
            Random random(plan.seed, run + " " + path);
            set(element, draw(dispersion.distribution, random, nominal_value(*from, *field, element), path));
        }
    }
    return draws;
}

CampaignResult fly_one(Simulation &simulation, CampaignPlan plan, std::size_t index)
{
    plan.first = index;
    plan.runs = 1;
    check_plan(simulation, plan);
    CampaignResult result = room_for(plan);
    Worker(simulation, simulation, plan).fly(0, result, false);
    return result;
}

CampaignResult fly(const Simulation &nominal, const CampaignPlan &plan, unsigned threads,
                   const std::function<bool(CampaignProgress)> &progress)
{
    check_plan(nominal, plan);
    CampaignResult result = room_for(plan);

    // Clones are made here, one after the other: the nominal simulation is touched by one thread only.
    std::vector<std::unique_ptr<Simulation>> clones;
    std::vector<std::unique_ptr<Worker>> workers;
    for (unsigned i = 0; i < std::clamp<std::size_t>(threads, 1, plan.runs); i++) {
        clones.push_back(nominal.clone());
        workers.push_back(std::make_unique<Worker>(nominal, *clones.back(), plan));
    }
    std::atomic<std::size_t> next{0}, finished{0}, failed{0};
    std::atomic<bool> stop{false};
    std::atomic<unsigned> working{static_cast<unsigned>(workers.size())};
    std::mutex mutex;
    std::condition_variable done;
    std::vector<std::thread> pool;
    for (const auto &worker : workers) {
        pool.emplace_back([&, own = worker.get()] {
            for (std::size_t run = next++; run < plan.runs && !stop; run = next++) {
                own->fly(run, result, stop);
                finished += result.flown[run];
                failed += !result.failures[run].empty();
            }
            const std::lock_guard lock(mutex);
            working--;
            done.notify_one();
        });
    }
    {
        std::unique_lock lock(mutex);
        while (working) {
            done.wait_for(lock, std::chrono::milliseconds(100));
            if (progress && !stop) {
                lock.unlock();
                stop = !progress({finished, failed});
                lock.lock();
            }
        }
    }
    for (std::thread &thread : pool) {
        thread.join();
    }
    return result;
}

} // namespace fledge::sim
