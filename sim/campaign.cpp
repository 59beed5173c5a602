// SPDX-License-Identifier: Apache-2.0
#include "sim/campaign.h"

#include "flight/math/elementary.h"
#include "sim/crash.h"
#include "sim/random.h"
#include "sim/text.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstring>
#include <iterator>
#include <map>
#include <mutex>
#include <numbers>
#include <span>
#include <thread>
#include <tuple>

// Of the build that counts branches (cmake/observed_branches.c); null in others.
extern "C" {
__attribute__((weak)) std::size_t fledge_branches();
__attribute__((weak)) void fledge_branches_into(std::uint8_t *row, std::size_t n);
}

namespace fledge::sim {

namespace {

using std::numbers::pi;
constexpr int draws_max = 10'000; ///< tries to draw between the bounds of a normal distribution
constexpr double far = 8.0;       ///< standard deviations; practically no draw is farther from the mean

/// By its path; by the name of a process alone its executive, whose mode is "flight.mode".
std::shared_ptr<Instance> find_instance(const Simulation &simulation, std::string_view path)
{
    for (const auto &process : simulation.processes()) {
        if (process->name == path) {
            return process->executive().instance();
        }
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
        if (field.group == FLEDGE_PAR && field.type != FLEDGE_CHAR && !(field.flags & FLEDGE_SPARE)) {
            names.emplace_back(field.name);
        }
    }
    return names;
}

/// A field of an instance, or of a struct inside it.
struct FieldPlace {
    std::shared_ptr<Instance> instance;
    const FledgeField *top = nullptr; ///< the instance's, null if the path names none
    const FledgeField *field = nullptr;
    const FledgeStruct *type = nullptr; ///< that has the field
    std::size_t base = 0;               ///< of that struct in the instance's memory

    std::byte *element(std::byte *memory, std::size_t i) const
    {
        return memory + base + field->offset + i * element_size(field->type);
    }
    double nominal(std::size_t i) const { return element_read(field->type, element(instance->memory(), i)); }
    bool whole() const { return field->type != FLEDGE_F64 && field->type != FLEDGE_F32; }
    /// The element across the diagonal of an inertia; of anything else, the element itself.
    std::size_t mirror(std::size_t i) const
    {
        return field->flags & FLEDGE_INERTIA ? i - i % 9 + i % 3 * 3 + i % 9 / 3 : i;
    }
    /// Returns the number as the type of the field holds it, or throws SetupError.
    double set(std::byte *memory, std::size_t i, double x, const std::string &path) const
    {
        for (const std::size_t at : {i, mirror(i)}) {
            element_write(field->type, element(memory, at), x);
        }
        const double held = element_read(field->type, element(memory, i));
        if (whole() && std::abs(held - x) > 0.5) {
            throw SetupError(path + index_text(*field, i) + " cannot be " + format_number(x) + ": it is of type " +
                             field->ctype);
        }
        return held;
    }
};

/// What a path "process.instance.field" or "process.instance.field[1].inner" names; throws SetupError.
FieldPlace find_path(const Simulation &simulation, const std::string &path)
{
    const auto first = path.find('.'), second = path.find('.', first + 1);
    const std::string owner = path.substr(0, second == std::string::npos ? first : second);
    FieldPlace place{find_instance(simulation, owner)};
    if (!place.instance) {
        throw SetupError(path + ": there is no instance " + (second == std::string::npos ? path : owner) +
                         "; there are " + format_list(instance_paths(simulation)));
    }
    const FledgeStruct *type = &place.instance->type();
    std::string_view rest = std::string_view(path).substr(std::min(owner.size() + 1, path.size()));
    while (!rest.empty()) {
        std::string_view name = rest.substr(0, rest.find('.'));
        rest.remove_prefix(std::min(rest.size(), name.size() + 1));
        const auto bracket = name.find('[');
        const std::size_t row = bracket == name.npos ? 0 : std::strtoul(name.data() + bracket + 1, nullptr, 10);
        const FledgeField *field = type ? find_field(*type, name.substr(0, bracket)) : nullptr;
        if (!field || row >= (field->ndim ? field->shape[0] : 1)) {
            place.field = nullptr;
            break;
        }
        place.base += place.field ? place.field->offset : 0;
        place.field = field;
        place.type = type;
        place.top = place.top ? place.top : field;
        type = field->sub;
        place.base += type ? row * type->size : 0;
    }
    return place;
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

double draw(const Distribution &distribution, Random &random, std::size_t point, double nominal, bool whole,
            const std::string &path)
{
    const bool steps = whole && !distribution.relative; // else the product is rounded
    if (distribution.kind == Distribution::Kind::grid) {
        const std::vector<double> &listed = distribution.choices;
        return absolute(distribution, nominal, listed[point / distribution.stride % listed.size()]);
    }
    if (distribution.kind == Distribution::Kind::choice) {
        const auto n = static_cast<double>(distribution.choices.size());
        return absolute(distribution, nominal, distribution.choices[static_cast<std::size_t>(n * random.uniform())]);
    }
    if (distribution.kind == Distribution::Kind::uniform) {
        const double low = steps ? std::ceil(distribution.a) : distribution.a;
        const double width = steps ? std::floor(distribution.b) - low + 1.0 : distribution.b - distribution.a;
        const double x = low + width * random.uniform();
        return absolute(distribution, nominal, steps ? std::floor(x) : x);
    }
    for (int i = 0; i < draws_max; i++) {
        const double drawn = distribution.a + distribution.b * random.normal();
        const double x = steps ? std::round(drawn) : drawn;
        if (x >= distribution.lo && x <= distribution.hi) {
            return absolute(distribution, nominal, x);
        }
    }
    throw SetupError(path + ": of " + std::to_string(draws_max) + " draws none fell between " +
                     format_number(distribution.lo) + " and " + format_number(distribution.hi));
}

/// Whether the draws of one element can keep the rule in the header. Throws SetupError.
void check_reach(const FieldPlace &place, std::size_t element, const Distribution &d, const std::string &path)
{
    const double nominal = place.nominal(element);
    const Instance &instance = *place.instance;
    const auto fault = [&](double x) -> std::string {
        std::vector<std::byte> bytes(instance.memory(), instance.memory() + instance.type().size);
        try {
            place.set(bytes.data(), element, absolute(d, nominal, x), path);
            check_field(instance.type(), *place.top, bytes.data(), instance.path);
        } catch (const SetupError &error) {
            return error.what();
        }
        return "";
    };
    for (const double x : d.choices) {
        if (const std::string text = fault(x); !text.empty()) {
            throw SetupError(text);
        }
    }
    if (d.kind == Distribution::Kind::choice || d.kind == Distribution::Kind::grid) {
        return;
    }
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

/// Throws SetupError that begins with the path on a distribution that cannot be drawn from, whatever its parameter.
void check_numbers(const Distribution &d, bool whole, const std::string &path)
{
    const auto refuse = [&](const std::string &rule) { throw SetupError(path + ": " + rule); };
    if (!std::isfinite(d.a) || !std::isfinite(d.b) || std::isnan(d.lo) || std::isnan(d.hi)) {
        refuse("a distribution needs finite numbers");
    }
    switch (d.kind) {
    case Distribution::Kind::uniform:
        if (!(d.a <= d.b)) {
            refuse("uniform between " + format_number(d.a) + " and " + format_number(d.b) +
                   ": the lower bound is above the upper one");
        }
        if (whole && !d.relative && std::ceil(d.a) > d.b) {
            refuse("there is no whole number between " + format_number(d.a) + " and " + format_number(d.b));
        }
        break;
    case Distribution::Kind::choice:
    case Distribution::Kind::grid:
        if (d.choices.empty() || d.stride == 0) {
            refuse("there is nothing to choose from");
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
    case Distribution::Kind::attitude: break;
    }
}

template <class Use> void visit_modes(const Simulation &simulation, const Use &use)
{
    for (const auto &process : simulation.processes()) {
        for (const Mode &mode : process->modes()) {
            if (process->modes().size() > 1) {
                use(*process, mode);
            }
        }
    }
}

/// How many numbers count() writes.
std::size_t counted(const Simulation &simulation)
{
    std::size_t n = 0;
    for (const auto &process : simulation.processes()) {
        n += process->modes().size() * process->modes().size() + process->events().size();
    }
    return n;
}

/// What a run has done: pairs of modes, and events.
void count(const Simulation &simulation, std::uint8_t *to)
{
    for (const auto &process : simulation.processes()) {
        to = std::ranges::copy(process->followed(), to).out;
        for (const auto &event : process->events()) {
            *to++ = static_cast<std::uint8_t>(std::min<std::uint64_t>(process->fired(*event).count, UINT8_MAX));
        }
    }
}

std::size_t branches()
{
    return fledge_branches ? fledge_branches() : 0;
}

/// While it lives, this thread counts the branches of flight code.
class Counting {
public:
    explicit Counting(std::span<std::uint8_t> row)
    {
        if (!row.empty()) {
            fledge_branches_into(row.data(), row.size());
        }
    }
    ~Counting()
    {
        if (fledge_branches) {
            fledge_branches_into(nullptr, 0);
        }
    }
    Counting(const Counting &) = delete;
    Counting &operator=(const Counting &) = delete;
};

bool is_field(const Retained &variable)
{
    return variable.kind == Retained::Kind::field;
}

/// Flies runs one after the other in a simulation of its own, and stores their results.
class Worker {
public:
    Worker(const Simulation &nominal, Simulation &own, const CampaignPlan &plan, const Watch &watch)
        : nominal_(nominal), own_(own), plan_(plan)
    {
        std::vector<std::vector<int>> watched;
        if (watch && !std::ranges::all_of(plan.retained, &is_field)) {
            std::tie(judge_, watched) = watch(&own);
        }
        auto traces = watched.begin();
        for (const Retained &variable : plan.retained) {
            if (is_field(variable)) {
                const FieldPlace place = find_path(own, variable.port);
                kept_.push_back({own.recorder().record(place.instance, *place.field, plan.every), {}});
            } else if (traces != watched.end()) {
                kept_.push_back({nullptr, *traces++});
            } else {
                throw SetupError("nothing watches what the campaign retains");
            }
        }
    }

    void fly(std::size_t run, CampaignResult &result, const std::atomic<bool> &stop)
    {
        const Runs runs;
        const std::size_t own = counted(own_);
        const std::span row(result.seen.data() + run * (result.seen.size() / plan_.runs),
                            result.seen.size() / plan_.runs);
        const Counting counting(row.subspan(own));
        running().of_campaign = static_cast<std::int64_t>(plan_.first + run);
        try {
            begin_anew(nominal_, own_);
            const std::vector<double> draws = disperse(nominal_, own_, plan_, plan_.first + run);
            std::copy(draws.begin(), draws.end(),
                      result.draws.begin() + static_cast<std::ptrdiff_t>(run * draws.size()));
            RunControl control;
            control.poll = [&](Ns) { return !stop; };
            if (!own_.run_until(plan_.duration, control)) {
                std::fill_n(result.draws.begin() + static_cast<std::ptrdiff_t>(run * draws.size()), draws.size(),
                            no_number);
                return;
            }
        } catch (const std::exception &error) {
            result.failures[run] = error.what();
        }
        result.flown[run] = 1;
        count(own_, row.data());
        result.health[run] = own_.health();
        std::size_t mode = run * (result.entered.size() / plan_.runs);
        visit_modes(own_, [&](const Process &process, const Mode &m) {
            const Tally tally = process.entered(m);
            result.entered[mode++] = tally.count ? static_cast<double>(tally.first) / 1e9 : no_number;
        });
        for (std::size_t i = 0; i < kept_.size(); i++) {
            const std::shared_ptr<Log> &log = kept_[i].log;
            const std::vector<int> &traces = kept_[i].traces;
            const Retained &variable = plan_.retained[i];
            double *to = result.retained[i].data() + run * result.samples * variable.elements;
            const bool complete = result.failures[run].empty();
            if (log) {
                keep(log->times, log->every, result.samples, complete, [&](std::size_t k, std::size_t taken, bool) {
                    read(*log, taken, variable, to + k * variable.elements);
                });
            }
            for (std::size_t j = 0; j < traces.size(); j++) {
                const std::vector<double> trace = judge_->trace(traces[j]);
                keep(judge_->times(), judge_->every, result.samples, complete,
                     [&](std::size_t k, std::size_t taken, bool again) {
                         const bool over = again && variable.kind == Retained::Kind::happened;
                         to[k * variable.elements + j] = over ? 0.0 : trace[taken];
                     });
            }
        }
    }

private:
    /// What a run retains of a variable: a log, or traces of the judge.
    struct Kept {
        std::shared_ptr<Log> log;
        std::vector<int> traces;
    };

    /// Fill the samples with what was taken at these times: put(sample, which, again). Between two instants they repeat
    /// the first one, `again`.
    template <class Put>
    static void keep(const std::vector<Ns> &times, Ns every, std::size_t samples, bool complete, const Put &put)
    {
        const auto index = [&](Ns t) { return static_cast<std::size_t>(t / every); };
        std::size_t k = 0;
        for (std::size_t i = 0; i < times.size(); i++) {
            const bool last = i + 1 == times.size();
            const std::size_t end = complete && last ? samples : last ? index(times[i]) + 1 : index(times[i + 1]);
            for (bool again = false; k < std::min(samples, end); k++, again = true) {
                put(k, i, again);
            }
        }
    }

    static void read(const Log &log, std::size_t taken, const Retained &variable, double *to)
    {
        const std::byte *message = log.bytes.data() + taken * log.field->size, *from = message + variable.offset;
        Head head;
        std::memcpy(&head, message, sizeof head);
        const bool there = variable.raw || variable.offset < sizeof head || head_written(head);
        for (std::size_t j = 0; j < variable.elements; j++) {
            to[j] = there ? element_read(variable.type, from + j * element_size(variable.type)) : no_number;
        }
    }

    const Simulation &nominal_;
    Simulation &own_;
    const CampaignPlan &plan_;
    std::shared_ptr<Judge> judge_;
    std::vector<Kept> kept_;
};

/// A result of the right size, filled with NaN.
CampaignResult room_for(const Simulation &simulation, const CampaignPlan &plan)
{
    CampaignResult result;
    result.samples = static_cast<std::size_t>(plan.duration / plan.every) + 1;
    result.flown.resize(plan.runs);
    result.failures.resize(plan.runs);
    result.health.resize(plan.runs);
    result.draws.assign(plan.runs * dispersed_elements(plan), no_number);
    result.entered.assign(plan.runs * mode_names(simulation).size(), no_number);
    result.seen.assign(plan.runs * (counted(simulation) + branches()), 0);
    for (const Retained &variable : plan.retained) {
        result.retained.emplace_back(plan.runs * result.samples * variable.elements, no_number);
    }
    return result;
}

} // namespace

Distribution::Distribution() : lo(-std::numeric_limits<double>::infinity()), hi(std::numeric_limits<double>::infinity())
{
}

std::vector<std::string> mode_names(const Simulation &simulation)
{
    std::vector<std::string> names;
    visit_modes(simulation, [&](const Process &process, const Mode &mode) {
        names.push_back(process.name + ".mode." + mode.name);
    });
    return names;
}

std::size_t dispersed_elements(const CampaignPlan &plan)
{
    std::size_t n = 0;
    for (const Dispersion &dispersion : plan.dispersions) {
        n += dispersion.elements.size();
    }
    for (const Composition &composition : plan.compositions) {
        n += composition.numbers.size();
    }
    return n;
}

std::vector<std::string> callables(const Simulation &simulation, bool sharing)
{
    std::vector<std::string> names;
    for (const auto &process : simulation.processes()) {
        for (const auto &event : process->events()) {
            if (event->predicate || event->action) {
                names.push_back("event " + process->name + "." + event->name);
            }
        }
        for (const auto &instance : process->instances()) {
            if (instance->script.update && (instance->script.shares || !sharing)) {
                names.push_back(instance->path);
            }
        }
    }
    return names;
}

void check_dispersion(const Simulation &nominal, const Dispersion &dispersion)
{
    const FieldPlace place = find_path(nominal, dispersion.path);
    const FledgeField *field = place.field;
    if (!field || place.top->group != FLEDGE_PAR || !element_size(field->type) || field->type == FLEDGE_CHAR) {
        throw SetupError(dispersion.path + " is no parameter that can be dispersed; " + place.instance->path + " has " +
                         format_list(dispersible(place.instance->type())));
    }
    const std::size_t n = field_elements(*field);
    for (std::size_t element : dispersion.elements) {
        if (element >= n) {
            throw SetupError(dispersion.path + " has " + std::to_string(n) + " elements; there is no element " +
                             std::to_string(element));
        }
        if (place.whole() && std::abs(place.nominal(element)) > 9.0e15) {
            throw SetupError(dispersion.path + index_text(*field, element) +
                             " is beyond the whole numbers that can be "
                             "dispersed, 9e15");
        }
    }
    const Distribution &d = dispersion.distribution;
    if (field->type == FLEDGE_ENUM && d.kind != Distribution::Kind::choice && d.kind != Distribution::Kind::grid) {
        throw SetupError(dispersion.path + ": an enumeration is drawn by a choice");
    }
    check_numbers(d, place.whole(), dispersion.path);
    if (d.kind == Distribution::Kind::attitude) {
        if (dispersion.elements != std::vector<std::size_t>{0, 1, 2} || n != 3 || field->type != FLEDGE_F64) {
            throw SetupError(dispersion.path + ": a random attitude needs the three elements of an MRP");
        }
        return;
    }
    const auto still = [&](std::size_t i) { return place.nominal(i) == 0.0; };
    if (d.relative && std::all_of(dispersion.elements.begin(), dispersion.elements.end(), still)) {
        throw SetupError(dispersion.path + ": its nominal value is 0, which no factor changes");
    }
    for (std::size_t element : dispersion.elements) {
        check_reach(place, element, d, dispersion.path);
    }
}

void check_composition(const Simulation &nominal, const Composition &composition)
{
    std::size_t elements = 0;
    for (const std::string &path : composition.parameters) {
        const FieldPlace place = find_path(nominal, path);
        if (!place.field || place.top->group != FLEDGE_PAR || place.whole()) {
            throw SetupError(path + " is no parameter that can be dispersed");
        }
        elements += field_elements(*place.field);
    }
    std::vector<double> numbers;
    for (const Composition::Number &number : composition.numbers) {
        check_numbers(number.distribution, false, number.path);
        if (number.distribution.relative && number.nominal == 0.0) {
            throw SetupError(number.path + ": its nominal value is 0, which no factor changes");
        }
        numbers.push_back(number.nominal);
    }
    const auto use = [&](const std::vector<double> &x) {
        return composition.commands ? (composition.commands(x), elements) : composition.values(x).size();
    };
    if (use(numbers) != elements) {
        throw SetupError(composition.numbers.front().path + ": it does not give as many numbers as it sets");
    }
    // The ends of bounded distributions, one at a time, as check_reach() of single parameters.
    for (std::size_t i = 0; i < numbers.size(); i++) {
        const auto &[path, at, d] = composition.numbers[i];
        std::vector<double> ends = d.choices;
        if (d.kind == Distribution::Kind::uniform) {
            ends = {d.a, d.b};
        } else if (d.kind == Distribution::Kind::normal) {
            for (const double end : {d.lo, d.hi}) {
                if (std::abs(end - d.a) < far * d.b) {
                    ends.push_back(end);
                }
            }
        }
        for (const double end : ends) {
            std::vector<double> values = numbers;
            values[i] = absolute(d, at, end);
            try {
                use(values);
            } catch (const SetupError &error) {
                throw SetupError(path + " = " + format_number(values[i]) + ": " + error.what());
            }
        }
    }
}

void check_retained(const Simulation &nominal, const Retained &variable)
{
    const FieldPlace place = find_path(nominal, variable.port);
    const FledgeField *field = place.field;
    if (!field || field->type != FLEDGE_STRUCT || (field->group != FLEDGE_IN && field->group != FLEDGE_OUT)) {
        throw SetupError(variable.port + " is no input or output, and only these are retained; " +
                         place.instance->path + " has " + format_list(field_names(place.instance->type(), FLEDGE_OUT)));
    }
    if (variable.offset + variable.elements * element_size(variable.type) > field->size) {
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
    const auto add = [&](const std::string &path) {
        if (std::find(drawn.begin(), drawn.end(), path) != drawn.end()) {
            throw SetupError(path + " is dispersed twice");
        }
        drawn.push_back(path);
    };
    for (const Dispersion &dispersion : plan.dispersions) {
        check_dispersion(nominal, dispersion);
        const FieldPlace place = find_path(nominal, dispersion.path);
        for (std::size_t element : dispersion.elements) {
            add(dispersion.path + index_text(*place.field, std::min(element, place.mirror(element))));
        }
    }
    for (const Composition &composition : plan.compositions) {
        check_composition(nominal, composition);
        for (const std::string &path : composition.parameters) {
            const FieldPlace place = find_path(nominal, path);
            for (std::size_t element = 0; element < field_elements(*place.field); element++) {
                add(path + index_text(*place.field, element));
            }
        }
    }
    for (const Retained &variable : plan.retained) {
        if (is_field(variable)) {
            check_retained(nominal, variable);
        }
    }
}

void begin_anew(const Simulation &nominal, Simulation &clone)
{
    for (std::size_t i = 0; i < nominal.processes().size(); i++) {
        clone.processes()[i]->requests = {}; // the first run of a clone is as all others
        const auto &from = nominal.processes()[i]->instances(), &to = clone.processes()[i]->instances();
        for (std::size_t k = 0; k < from.size(); k++) {
            for (const FledgeField &field : fields(from[k]->type())) {
                if (field.group == FLEDGE_PAR) {
                    std::memmove(to[k]->memory() + field.offset, from[k]->memory() + field.offset, field.size);
                }
            }
        }
    }
    if (clone.prepared()) { // false after a run with invalid draws
        clone.reset();
    }
}

std::vector<double> disperse(const Simulation &nominal, Simulation &simulation, const CampaignPlan &plan,
                             std::size_t index)
{
    const std::size_t point = index % plan.points;
    const std::string run = "run " + std::to_string(index / plan.points);
    simulation.set_seed(Random(plan.seed, run).bits());
    std::vector<double> draws;
    for (const Dispersion &dispersion : plan.dispersions) {
        const FieldPlace from = find_path(nominal, dispersion.path);
        const auto to = find_instance(simulation, from.instance->path);
        const auto set = [&](std::size_t element, double x) {
            draws.push_back(from.set(to->memory(), element, x, dispersion.path));
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
            const std::string path = dispersion.path + index_text(*from.field, element);
            Random random(plan.seed, run + " " + path);
            set(element, draw(dispersion.distribution, random, point, from.nominal(element), from.whole(), path));
        }
    }
    std::map<std::string, std::vector<ScriptedCommand>> scripts;
    for (const Composition &composition : plan.compositions) {
        std::vector<double> drawn;
        for (const auto &[path, at, distribution] : composition.numbers) {
            Random random(plan.seed, run + " " + path);
            drawn.push_back(draw(distribution, random, point, at, false, path));
        }
        draws.insert(draws.end(), drawn.begin(), drawn.end());
        if (composition.commands) {
            std::ranges::move(composition.commands(drawn), std::back_inserter(scripts[composition.process]));
            continue;
        }
        const std::vector<double> values = composition.values(drawn);
        auto next = values.begin();
        for (const std::string &path : composition.parameters) {
            const FieldPlace from = find_path(nominal, path);
            const auto to = find_instance(simulation, from.instance->path);
            for (std::size_t element = 0; element < field_elements(*from.field); element++) {
                from.set(to->memory(), element, *next++, path);
            }
        }
    }
    for (auto &[name, script] : scripts) {
        const auto from = std::ranges::find(nominal.processes(), name, [](const auto &p) { return p->name; });
        std::ranges::copy((*from)->script(), std::back_inserter(script));
        std::ranges::stable_sort(script, {}, &ScriptedCommand::after);
        simulation.process(name).set_script(std::move(script));
    }
    return draws;
}

CampaignResult fly_one(Simulation &simulation, CampaignPlan plan, std::size_t index, const Watch &watch)
{
    plan.first = index;
    plan.runs = 1;
    check_plan(simulation, plan);
    CampaignResult result = room_for(simulation, plan);
    Worker(simulation, simulation, plan, watch).fly(0, result, false);
    return result;
}

CampaignResult fly(const Simulation &nominal, const CampaignPlan &plan, unsigned threads,
                   const std::function<bool(CampaignProgress)> &progress, const Watch &watch)
{
    check_plan(nominal, plan);
    CampaignResult result = room_for(nominal, plan);

    // Clones are made here, one after the other: the nominal simulation is touched by one thread only.
    std::vector<std::unique_ptr<Simulation>> clones;
    std::vector<std::unique_ptr<Worker>> workers;
    for (unsigned i = 0; i < std::clamp<std::size_t>(threads, 1, plan.runs); i++) {
        clones.push_back(nominal.clone());
        workers.push_back(std::make_unique<Worker>(nominal, *clones.back(), plan, watch));
    }
    std::atomic<std::size_t> next{0}, finished{0}, failed{0};
    std::atomic<bool> stop{false};
    std::atomic<unsigned> working{static_cast<unsigned>(workers.size())};
    std::mutex mutex;
    std::condition_variable done;
    std::vector<std::thread> pool;
    pool.reserve(workers.size());
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
