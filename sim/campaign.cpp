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
constexpr int draws_max = 10'000; ///< of a cut normal distribution, before its bounds are given up

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

double draw(const Distribution &distribution, Random &random, double nominal, const std::string &path)
{
    const auto absolute = [&](double x) {
        return distribution.relative ? nominal * x : distribution.about ? nominal + x : x;
    };
    if (distribution.kind == Distribution::Kind::uniform) {
        return absolute(distribution.a + (distribution.b - distribution.a) * random.uniform());
    }
    for (int i = 0; i < draws_max; i++) {
        const double x = distribution.a + distribution.b * random.normal();
        if (x >= distribution.lo && x <= distribution.hi) {
            return absolute(x);
        }
    }
    throw SetupError(path + ": of " + std::to_string(draws_max) + " draws none fell between " +
                     format_number(distribution.lo) + " and " + format_number(distribution.hi));
}

/// The clones of one thread, and where its results go.
class Worker {
public:
    Worker(const Simulation &nominal, const CampaignPlan &plan) : nominal_(nominal), plan_(plan), own_(nominal.clone())
    {
        for (const Retained &variable : plan.retained) {
            const auto [instance, field] = find_path(*own_, variable.port);
            logs_.push_back(own_->recorder().record(instance, *field, plan.every));
        }
    }

    void fly(std::size_t run, CampaignResult &result, const std::atomic<bool> &stop)
    {
        try {
            if (own_->prepared()) { // not after a run whose draws were refused
                own_->reset();
            }
            const auto draws = disperse(nominal_, *own_, plan_, plan_.first + run);
            std::copy(draws.begin(), draws.end(),
                      result.draws.begin() + static_cast<std::ptrdiff_t>(run * draws.size()));
            RunControl control;
            control.poll = [&](Ns) { return !stop; };
            own_->run_until(plan_.duration, control);
        } catch (const std::exception &error) {
            result.failures[run] = error.what();
        }
        for (std::size_t i = 0; i < logs_.size(); i++) {
            keep(*logs_[i], plan_.retained[i], result.samples,
                 result.retained[i].data() + run * result.samples * plan_.retained[i].elements);
        }
    }

private:
    static void keep(const Log &log, const Retained &variable, std::size_t samples, double *to)
    {
        const std::size_t n = std::min(samples, log.times.size());
        for (std::size_t k = 0; k < n; k++) {
            std::memcpy(to + k * variable.elements, log.bytes.data() + k * log.field->size + variable.offset,
                        variable.elements * sizeof(double));
        }
    }

    const Simulation &nominal_;
    const CampaignPlan &plan_;
    std::unique_ptr<Simulation> own_;
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

} // namespace

Distribution::Distribution()
    : lo(-std::numeric_limits<double>::infinity()), hi(std::numeric_limits<double>::infinity())
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
    for (const Dispersion &dispersion : plan.dispersions) {
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
            if (!(d.lo < d.hi) || d.lo > d.a + 8.0 * d.b || d.hi < d.a - 8.0 * d.b) {
                refuse("a normal distribution about " + format_number(d.a) + " with deviation " + format_number(d.b) +
                       " never falls between " + format_number(d.lo) + " and " + format_number(d.hi));
            }
            break;
        case Distribution::Kind::attitude:
            if (dispersion.elements != std::vector<std::size_t>{0, 1, 2} || n != 3) {
                refuse("a random attitude needs the three elements of an MRP");
            }
            break;
        }
    }
    for (const Retained &variable : plan.retained) {
        const auto [instance, field] = find_path(nominal, variable.port);
        if (!field || field->type != FLEDGE_STRUCT || (field->group != FLEDGE_IN && field->group != FLEDGE_OUT)) {
            throw SetupError(variable.port + " is no input or output, and only these are retained; " + instance->path +
                             " has " + format_list(field_names(instance->type(), FLEDGE_OUT)));
        }
    }
}

std::vector<double> disperse(const Simulation &nominal, Simulation &simulation, const CampaignPlan &plan,
                             std::size_t index)
{
    const std::string run = "run " + std::to_string(index);
    simulation.set_seed(Random(plan.seed, run).bits());
    std::vector<double> draws;
    for (const Dispersion &dispersion : plan.dispersions) {
        // A stream for each path, so that one dispersion more changes no other's draws.
        Random random(plan.seed, run + " " + dispersion.path);
        const auto [from, field] = find_path(nominal, dispersion.path);
        const auto to = find_instance(simulation, from->path);
        const auto set = [&](std::size_t element, double x) {
            std::memcpy(to->memory() + field->offset + element * sizeof x, &x, sizeof x);
            draws.push_back(x);
        };
        if (dispersion.distribution.kind == Distribution::Kind::attitude) {
            const auto sigma = random_attitude(random);
            for (std::size_t i = 0; i < 3; i++) {
                set(i, sigma[i]);
            }
            continue;
        }
        for (std::size_t element : dispersion.elements) {
            set(element, draw(dispersion.distribution, random, nominal_value(*from, *field, element), dispersion.path));
        }
    }
    return draws;
}

CampaignResult fly(const Simulation &nominal, const CampaignPlan &plan, unsigned threads,
                   const std::function<bool(std::size_t)> &progress)
{
    check_plan(nominal, plan);
    const double none = std::numeric_limits<double>::quiet_NaN();
    CampaignResult result;
    result.samples = static_cast<std::size_t>(plan.duration / plan.every) + 1;
    result.failures.resize(plan.runs);
    result.draws.assign(plan.runs * dispersed_elements(plan), none);
    for (const Retained &variable : plan.retained) {
        result.retained.emplace_back(plan.runs * result.samples * variable.elements, none);
    }

    // Clones are made here, one after the other: the nominal simulation is touched by one thread only.
    std::vector<std::unique_ptr<Worker>> workers;
    for (unsigned i = 0; i < std::clamp<std::size_t>(threads, 1, plan.runs); i++) {
        workers.push_back(std::make_unique<Worker>(nominal, plan));
    }
    std::atomic<std::size_t> next{0}, finished{0};
    std::atomic<bool> stop{false};
    std::atomic<unsigned> working{static_cast<unsigned>(workers.size())};
    std::mutex mutex;
    std::condition_variable done;
    std::vector<std::thread> pool;
    for (const auto &worker : workers) {
        pool.emplace_back([&, own = worker.get()] {
            for (std::size_t run = next++; run < plan.runs && !stop; run = next++) {
                own->fly(run, result, stop);
                finished += !stop;
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
                stop = !progress(finished);
                lock.lock();
            }
        }
    }
    for (std::thread &thread : pool) {
        thread.join();
    }
    result.finished = finished;
    return result;
}

} // namespace fledge::sim
