// SPDX-License-Identifier: Apache-2.0
#include "sim/batch.h"

#include "flight/exec/task.h"
#include "sim/text.h"

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <mutex>
#include <thread>

namespace fledge::sim {

namespace {

constexpr std::size_t cache_line = 64; ///< [bytes] of a cache

std::shared_ptr<Instance> find(const Simulation &simulation, const std::string &path)
{
    for (const auto &process : simulation.processes()) {
        for (const auto &instance : process->instances()) {
            if (instance->path == path) {
                return instance;
            }
        }
    }
    throw SetupError("there is no instance " + path);
}

/// Numbers in the memory of a clone, and their place in its row of an array.
struct Place {
    std::byte *at;
    std::size_t column, elements;
    FledgeType type;

    void write(const double *row) const
    {
        if (type == FLEDGE_F64) {
            std::memcpy(at, row + column, elements * sizeof(double));
            return;
        }
        for (std::size_t i = 0; i < elements; i++) {
            element_write(type, at + i * element_size(type), row[column + i]);
        }
    }
    void read(double *row) const
    {
        if (type == FLEDGE_F64) {
            std::memcpy(row + column, at, elements * sizeof(double));
            return;
        }
        for (std::size_t i = 0; i < elements; i++) {
            row[column + i] = element_read(type, at + i * element_size(type));
        }
    }
};

/// Whether a field of this type can hold x, but for rounding to a float.
bool can_hold(FledgeType type, double x)
{
    if (type == FLEDGE_F64) {
        return true;
    }
    std::byte bytes[8];
    element_write(type, bytes, x);
    const double held = element_read(type, bytes);
    return type == FLEDGE_F32 ? std::isfinite(held) : held == x;
}

} // namespace

// ---- threads

/// Threads that wait for work and share it with the thread that gives it. Each begins with a part of its own, the same
/// each time, so that the caches of its core keep the clones in it; then it helps the others.
class Batch::Crew {
public:
    using Work = std::function<void(std::size_t, const RunControl &)>;

    /// same_parameters: of RunControl, for all runs
    Crew(unsigned threads, bool same_parameters) : parts_(threads), same_(same_parameters)
    {
        for (unsigned i = 1; i < threads; i++) {
            threads_.emplace_back([this, i] { serve(i); });
        }
    }

    ~Crew()
    {
        {
            const std::lock_guard lock(mutex_);
            quit_ = true;
            given_++;
        }
        begin_.notify_all();
        for (std::thread &thread : threads_) {
            thread.join();
        }
    }

    /// False in a child of fork(), which has none of these threads and cannot wait for them.
    bool is_here() const { return getpid() == process_; }

    /// Call work(i) for all i < n. Returns false if poll() did: then it was called for some.
    bool run(std::size_t n, const Work &work, const Poll &poll)
    {
        if (!is_here()) {
            throw SetupError("this batch belongs to the process that made it; make one in each process");
        }
        if (busy_.exchange(true)) {
            throw SetupError("this batch is at work: it takes one call at a time");
        }
        const std::unique_ptr<std::atomic<bool>, void (*)(std::atomic<bool> *)> rest(&busy_,
                                                                                     [](auto *busy) { *busy = false; });
        for (std::size_t i = 0; i < parts_.size(); i++) {
            parts_[i].next = n * i / parts_.size();
            parts_[i].end = n * (i + 1) / parts_.size();
        }
        chunk_ = std::clamp<std::size_t>(n / (parts_.size() * 8), 1, 16);
        work_ = &work;
        stop_ = false;
        if (!threads_.empty()) {
            const std::lock_guard lock(mutex_);
            working_ = threads_.size();
            given_++;
        }
        begin_.notify_all();
        Clock::time_point last;
        const auto poll_if_due = [&] {
            if (poll && Clock::now() - last >= pause) {
                last = Clock::now();
                if (!poll()) {
                    stop_ = true;
                }
            }
            return !stop_;
        };
        share(0, {0.0, [&](Ns) { return poll_if_due(); }, same_}, poll_if_due);
        const auto done = [&] { return working_ == 0; };
        if (soon(done)) {
            return !stop_;
        }
        std::unique_lock lock(mutex_);
        while (!done_.wait_for(lock, pause, done)) {
            lock.unlock();
            poll_if_due();
            lock.lock();
        }
        return !stop_;
    }

private:
    using Clock = std::chrono::steady_clock;
    static constexpr auto pause = std::chrono::milliseconds(50);

    struct alignas(cache_line) Part {
        std::atomic<std::size_t> next{0};
        std::size_t end = 0;
    };

    /// Look for a while whether it is so: a thread that sleeps between short steps would wake too late, and elsewhere.
    template <class Ready> static bool soon(const Ready &ready)
    {
        const auto end = Clock::now() + std::chrono::microseconds(100);
        while (!ready()) {
            if (Clock::now() > end) {
                return false;
            }
        }
        return true;
    }

    template <class Poll> void share(std::size_t own, const RunControl &control, const Poll &poll)
    {
        for (std::size_t k = 0; k < parts_.size(); k++) {
            Part &part = parts_[(own + k) % parts_.size()];
            for (std::size_t i = part.next.fetch_add(chunk_); i < part.end; i = part.next.fetch_add(chunk_)) {
                for (std::size_t j = i; j < std::min(part.end, i + chunk_); j++) {
                    (*work_)(j, control);
                }
                if (!poll()) {
                    return;
                }
            }
        }
    }

    void serve(std::size_t own)
    {
        const auto goes_on = [this] { return !stop_; };
        const RunControl control{0.0, [this](Ns) { return !stop_; }, same_};
        std::uint64_t seen = 0;
        while (true) {
            const auto given = [&] { return given_ != seen; };
            if (!soon(given)) {
                std::unique_lock lock(mutex_);
                begin_.wait(lock, given);
            }
            seen = given_;
            if (quit_) {
                return;
            }
            share(own, control, goes_on);
            if (--working_ == 0) {
                const std::lock_guard lock(mutex_);
                done_.notify_one();
            }
        }
    }

    std::vector<Part> parts_;
    const bool same_;
    std::vector<std::thread> threads_;
    const pid_t process_ = getpid();
    const Work *work_ = nullptr;
    std::size_t chunk_ = 1;
    std::atomic<bool> busy_{false}, stop_{false};
    std::mutex mutex_; ///< of the threads that sleep
    std::condition_variable begin_, done_;
    std::atomic<std::uint64_t> given_{0}; ///< how often there was work
    std::atomic<std::size_t> working_{0};
    bool quit_ = false;
};

// ---- the batch

struct alignas(cache_line) Batch::Clone {
    std::unique_ptr<Simulation> simulation;
    std::vector<std::byte *> heads; ///< of the inputs that are actions
    std::vector<Place> actions, observations;
    std::vector<const Instance *> before; ///< a step ends before the first of them
    BatchRun run;
    Ns at = -1;         ///< the end of its last step
    bool given = false; ///< it has the actions of a step that has not ended
    bool ahead = false; ///< it has ended a step that others have not
    struct Coming {
        Ns made;
        std::vector<double> actions;
    };
    std::deque<Coming> coming; ///< actions on their way
    std::string failure;
    std::vector<double> draws;
};

Batch::Batch(const Simulation &nominal, BatchPlan plan) : plan_(std::move(plan))
{
    if (plan_.clones == 0 || plan_.threads == 0) {
        throw SetupError("a batch needs at least one clone and one thread");
    }
    if (plan_.every <= 0) {
        throw SetupError("the duration of a step must be > 0, found " + format_time(plan_.every));
    }
    if (const auto functions = callables(nominal, true); !plan_.separate && !functions.empty()) {
        throw SetupError("a simulation that calls Python cannot be stepped in a batch, where clones would share what "
                         "its functions use: " +
                         format_list(functions));
    }
    if (!callables(nominal).empty()) {
        plan_.threads = 1; // the others would wait for Python's lock
    }
    nominal_ = nominal.clone();
    if (nominal_->prepared()) {
        nominal_->reset();
    }
    find_order();
    for (const BatchField &action : plan_.actions) {
        add_target(nominal, action);
        actions_ += action.names.size();
    }
    for (const BatchField &observation : plan_.observations) {
        observations_ += observation.names.size();
    }
    if (__builtin_mul_overflow(static_cast<Ns>(plan_.delay), period_, &delay_) || delay_ < 0) {
        throw SetupError("delay: " + std::to_string(plan_.delay) + " periods of " + format_time(period_) +
                         " are longer than any run");
    }
    find_late();
    for (const Dispersion &dispersion : plan_.campaign.dispersions) {
        check_dispersion(*nominal_, dispersion);
    }
    for (const Composition &composition : plan_.campaign.compositions) {
        check_composition(*nominal_, composition);
    }
    nominal_->prepare(); // an error of the nominal simulation is one of all clones
    nominal_->set_seed(nominal_->seed());
    clones_ = std::vector<Clone>(plan_.clones);
    for (Clone &clone : clones_) {
        clone.simulation = nominal_->clone();
        clone.draws.assign(drawn(), no_number);
        lay_out(clone);
    }
    nominal_->prepare();
    const bool same = std::all_of(targets_.begin(), targets_.end(), [](const Target &target) { return target.input; });
    crew_ = std::make_unique<Crew>(static_cast<unsigned>(std::min<std::size_t>(plan_.threads, plan_.clones)), same);
}

Batch::~Batch()
{
    if (crew_ && !crew_->is_here()) {
        (void)crew_.release();
    }
}

/// An action in an output goes to the inputs that the output feeds in the original, because each of these wires may
/// have been removed for another action.
void Batch::add_target(const Simulation &original, const BatchField &action)
{
    const auto instance = find(*nominal_, action.instance);
    const FledgeField *field = field_at(instance->type(), action.offset);
    const FledgeGroup group = field ? field->group : FLEDGE_NONE;
    const std::string path = action.instance + (field ? "." + std::string(field->name) : "");
    const std::size_t first = targets_.size();
    if (group == FLEDGE_IN) {
        targets_.push_back({action, actions_, field});
        const Wire *last = nullptr;
        bool direct = false;
        for (const Wire &wire : original.wires()) {
            if (wire.to.path() == path) {
                last = &wire;
                direct = direct || is_direct(wire);
            }
        }
        if (direct || !last) {
            count_from(*instance);
        }
        see_period(instance->model() && last ? *last->from.instance : *instance, path);
    } else if (group == FLEDGE_OUT) {
        for (const Wire &wire : original.wires()) {
            if (wire.from.path() == path) {
                BatchField target = action;
                target.instance = wire.to.instance->path;
                target.offset += wire.to.field->offset - field->offset;
                targets_.push_back({target, actions_, wire.to.field});
                if (is_direct(wire)) {
                    count_from(*wire.to.instance);
                }
            }
        }
        see_period(*instance, path);
        if (targets_.size() == first) {
            throw SetupError(path + " feeds no input: an action there would have no effect");
        }
    } else if (group == FLEDGE_PAR && !(field->flags & FLEDGE_INITIAL)) {
        targets_.push_back({action, actions_, nullptr});
        count_from(*instance);
        see_period(*instance, path);
    } else {
        throw SetupError(path +
                         (group == FLEDGE_PAR ? " is an initial value, which counts only until the first instant"
                                              : " is no input, output or parameter") +
                         ": there can be no action in it");
    }
    for (std::size_t i = first; i < targets_.size(); i++) {
        const BatchField &own = targets_[i].field;
        const auto end = [](const BatchField &f) { return f.offset + f.names.size() * element_size(f.type); };
        for (std::size_t k = 0; k < i; k++) {
            const BatchField &other = targets_[k].field;
            if (own.instance == other.instance && own.offset < end(other) && other.offset < end(own)) {
                throw SetupError(action.names[0] + " and " + other.names[0] + " are two actions in the same place");
            }
        }
        if (targets_[i].input) {
            nominal_->feed(Port{find(*nominal_, own.instance), targets_[i].input});
        }
    }
}

void Batch::find_order()
{
    for (const auto &process : nominal_->processes()) {
        for (const Task *task : in_order(*process)) {
            for (const auto &instance : task->run) {
                order_.push_back({process.get(), task, instance.get()});
            }
        }
    }
}

/// The place in the order of an instant; its end if no task runs the instance.
std::size_t Batch::place_of(const std::string &path) const
{
    const auto run = std::ranges::find(order_, path, [](const Run &each) { return each.instance->path; });
    return static_cast<std::size_t>(run - order_.begin());
}

/// An action counts when this instance runs; configuration, when what reads it does. A model reads it for the time
/// since it last ran, so that it counts from the end of an instant on.
void Batch::count_from(const Instance &instance)
{
    std::vector<const Instance *> readers{&instance};
    for (std::size_t i = 0; i < readers.size(); i++) {
        const std::size_t place = place_of(readers[i]->path);
        if (readers[i]->model()) {
            continue;
        }
        if (place == order_.size()) {
            for (const Wire &wire : nominal_->wires()) {
                const Instance *const reader = wire.to.instance.get();
                if (wire.from.instance->path == readers[i]->path &&
                    std::ranges::find(readers, reader) == readers.end()) {
                    readers.push_back(reader);
                }
            }
            continue;
        }
        const Run &run = order_[place];
        for (const Run &each : order_) { // a computer takes all that comes to it before the first of its modules
            if (each.instance == run.instance || (run.process->flight() && each.process == run.process)) {
                before_.push_back(each.instance->path);
            }
        }
    }
}

/// Whether the reader of a wire has a message at the instant at which it is written; else at its next one.
bool Batch::is_direct(const Wire &wire) const
{
    const std::size_t from = place_of(wire.from.instance->path);
    return wire.options.latency == 0 && (from == order_.size() || from < place_of(wire.to.instance->path));
}

/// The period of what an action replaces.
void Batch::see_period(const Instance &instance, const std::string &path)
{
    Ns period = 0;
    const auto process = [](const std::string &of) { return of.substr(0, of.find('.')); };
    const std::size_t place = place_of(instance.path);
    for (const Run &each : order_) { // configuration counts at the next instant of its process
        if (place == order_.size() ? process(each.instance->path) == process(instance.path)
                                   : each.instance == order_[place].instance) {
            period = period > 0 ? std::min(period, each.task->period) : each.task->period;
        }
    }
    if (plan_.delay > 0 && period_ > 0 && period != period_) {
        throw SetupError("delay: " + path + " has periods of " + format_time(period) + ", the actions before it of " +
                         format_time(period_) + ": a batch has one delay; leave it out, or act on one of them");
    }
    period_ = period;
}

/// A step ends before the first module that has an action: what runs from there on is observed as of the instant
/// before.
void Batch::find_late()
{
    std::size_t place = order_.size();
    for (const std::string &path : before_) {
        place = std::min(place, place_of(path));
    }
    for (const BatchField &observation : plan_.observations) {
        const auto instance = find(*nominal_, observation.instance);
        const FledgeField *field = field_at(instance->type(), observation.offset);
        const std::size_t own = place_of(observation.instance);
        late_.push_back(own >= place && own < order_.size() && !(field && field->group == FLEDGE_PAR));
    }
}

void Batch::lay_out(Clone &clone) const
{
    for (const Target &target : targets_) {
        std::byte *memory = find(*clone.simulation, target.field.instance)->memory();
        clone.actions.push_back(
            {memory + target.field.offset, target.column, target.field.names.size(), target.field.type});
        std::byte *head = target.input ? memory + target.input->offset : nullptr;
        if (head && std::find(clone.heads.begin(), clone.heads.end(), head) == clone.heads.end()) {
            clone.heads.push_back(head);
        }
    }
    for (const std::string &path : before_) {
        clone.before.push_back(find(*clone.simulation, path).get());
    }
    std::size_t column = 0;
    for (const BatchField &observation : plan_.observations) {
        std::byte *memory = find(*clone.simulation, observation.instance)->memory();
        clone.observations.push_back({memory + observation.offset, column, observation.names.size(), observation.type});
        column += observation.names.size();
    }
}

std::size_t Batch::clones() const
{
    return clones_.size();
}

std::size_t Batch::drawn() const
{
    return dispersed_elements(plan_.campaign);
}

void Batch::begin(Clone &clone, BatchRun run, std::span<const std::byte> snapshot) const
{
    Simulation &simulation = *clone.simulation;
    clone.run = run;
    clone.at = -1;
    clone.given = clone.ahead = false;
    clone.coming.clear();
    clone.failure.clear();
    clone.draws.assign(drawn(), no_number);
    CampaignPlan plan = snapshot.empty() ? plan_.campaign : CampaignPlan{};
    plan.seed = run.seed;
    try {
        begin_anew(*nominal_, simulation);
        const auto draws = disperse(*nominal_, simulation, plan, run.index);
        std::copy(draws.begin(), draws.end(), clone.draws.begin());
        if (!snapshot.empty()) {
            simulation.restore(snapshot);
            simulation.reseed();
        }
        go_to_place(clone);
        clone.at = simulation.time();
    } catch (const std::exception &error) {
        clone.failure = error.what();
    }
}

/// To the first instant at which an action can count.
void Batch::go_to_place(Clone &clone) const
{
    Simulation &simulation = *clone.simulation;
    Ns to = 0;
    if (!clone.before.empty()) {
        simulation.ready_for(std::max<Ns>(simulation.time(), 0));
        to = std::max<Ns>(simulation.next_of(clone.before), 0);
    }
    if (to > simulation.time()) {
        simulation.run_until(to, {}, clone.before);
    }
}

/// made: when the script gave the actions
void Batch::write(Clone &clone, Ns made, std::span<const double> actions) const
{
    for (std::byte *at : clone.heads) {
        Head head;
        std::memcpy(&head, at, sizeof head);
        head = head_next(head, made, QUALITY_GOOD);
        std::memcpy(at, &head, sizeof head);
    }
    for (const Place &place : clone.actions) {
        place.write(actions.data());
    }
}

bool Batch::reset(std::span<const std::size_t> which, std::span<const BatchRun> runs,
                  std::span<const std::byte> snapshot, const Poll &poll)
{
    if (!snapshot.empty()) {
        nominal_->check_snapshot(snapshot);
    }
    return crew_->run(
        which.size(), [&](std::size_t i, const RunControl &) { begin(clones_.at(which[i]), runs[i], snapshot); }, poll);
}

void Batch::check_actions(std::span<const double> actions) const
{
    for (std::size_t i = 0; i < clones_.size(); i++) {
        if (!clones_[i].failure.empty()) {
            continue;
        }
        if (clones_[i].at < 0) {
            throw SetupError("clone " + std::to_string(i) + " has not begun: reset it first");
        }
        const double *row = actions.data() + i * actions_;
        for (const BatchField &field : plan_.actions) {
            for (const std::string &name : field.names) {
                const double x = *row++;
                if (!std::isfinite(x) || !can_hold(field.type, x)) {
                    throw SetupError("the action in " + name + " of clone " + std::to_string(i) + ": " +
                                     (std::isfinite(x) ? "its type cannot hold " : "expected a finite number, found ") +
                                     format_number(x));
                }
            }
        }
    }
}

/// Returns false if the control stopped it.
bool Batch::advance(Clone &clone, std::span<const double> actions, const RunControl &control) const
{
    if (clone.ahead || !clone.failure.empty()) {
        return true;
    }
    try {
        if (!clone.given && delay_ == 0) {
            write(clone, clone.at, actions);
        } else if (!clone.given) {
            clone.coming.push_back({clone.at, {actions.begin(), actions.end()}});
        }
        clone.given = true;
        const Ns end = clone.at + plan_.every;
        for (; !clone.coming.empty() && exec_later(clone.coming.front().made, delay_) < end; clone.coming.pop_front()) {
            const Ns arrives = exec_later(clone.coming.front().made, delay_);
            if (arrives > clone.at && !clone.simulation->run_until(arrives, control, clone.before)) {
                return false;
            }
            write(clone, clone.coming.front().made, clone.coming.front().actions);
        }
        if (!clone.simulation->run_until(end, control, clone.before)) {
            return false;
        }
        clone.at = end;
        clone.given = false;
    } catch (const std::exception &error) {
        clone.failure = error.what();
    }
    clone.ahead = true;
    return true;
}

bool Batch::step(std::span<const double> actions, std::span<double> observed, const Poll &poll)
{
    check_actions(actions);
    const auto work = [&](std::size_t i, const RunControl &control) {
        if (advance(clones_[i], actions.subspan(i * actions_, actions_), control)) {
            read_row(clones_[i], observed.subspan(i * observations_, observations_));
        }
    };
    if (!crew_->run(clones_.size(), work, poll)) {
        return false;
    }
    for (Clone &clone : clones_) {
        clone.ahead = false;
    }
    return true;
}

void Batch::read_row(const Clone &clone, std::span<double> row) const
{
    if (clone.at < 0 || !clone.failure.empty()) {
        std::fill(row.begin(), row.end(), no_number);
        return;
    }
    for (const Place &place : clone.observations) {
        place.read(row.data());
    }
}

void Batch::observe(std::span<double> to) const
{
    for (std::size_t i = 0; i < clones_.size(); i++) {
        read_row(clones_[i], to.subspan(i * observations_, observations_));
    }
}

const std::string &Batch::failure(std::size_t clone) const
{
    return clones_.at(clone).failure;
}

Ns Batch::time(std::size_t clone) const
{
    return clones_.at(clone).at;
}

BatchRun Batch::run(std::size_t clone) const
{
    return clones_.at(clone).run;
}

const std::vector<double> &Batch::draws(std::size_t clone) const
{
    return clones_.at(clone).draws;
}

Simulation &Batch::clone(std::size_t clone) const
{
    return *clones_.at(clone).simulation;
}

std::unique_ptr<Simulation> Batch::copy(std::size_t clone) const
{
    if (time(clone) < 0) {
        throw SetupError("clone " + std::to_string(clone) + " has not begun: reset it first");
    }
    return clones_[clone].simulation->clone();
}

std::unique_ptr<Simulation> Batch::repeat(std::size_t clone, std::size_t steps, std::span<const double> rows) const
{
    if (time(clone) < 0 && failure(clone).empty()) {
        throw SetupError("clone " + std::to_string(clone) + " has not begun: reset it first");
    }
    Clone alone;
    alone.simulation = nominal_->clone();
    lay_out(alone);
    begin(alone, run(clone), {});
    for (std::size_t i = 0; i < steps && alone.failure.empty(); i++) {
        alone.ahead = false;
        advance(alone, rows.subspan(i * actions_, actions_), {});
    }
    if (!alone.failure.empty()) {
        throw RunError(alone.failure);
    }
    return std::move(alone.simulation);
}

} // namespace fledge::sim
