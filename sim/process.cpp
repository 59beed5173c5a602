// SPDX-License-Identifier: Apache-2.0
#include "sim/crash.h"
#include "sim/runtime.h"
#include "sim/text.h"

#include <algorithm>
#include <cctype>
#include <cstring>
#include <functional>

namespace fledge::sim {

namespace {

bool is_identifier(const std::string &name)
{
    const auto letter = [](unsigned char c) { return std::isalpha(c) || c == '_'; };
    const auto rest = [&](unsigned char c) { return letter(c) || std::isdigit(c); };
    return !name.empty() && letter(static_cast<unsigned char>(name[0])) && std::all_of(name.begin(), name.end(), rest);
}

template <class Items> std::vector<std::string> names_of(const Items &items)
{
    std::vector<std::string> names;
    for (const auto &item : items) {
        if constexpr (requires { item->name; }) {
            names.push_back(item->name);
        } else {
            names.push_back(item.name);
        }
    }
    return names;
}

template <class Items> bool has(const Items &items, const std::string &name)
{
    const auto names = names_of(items);
    return std::find(names.begin(), names.end(), name) != names.end();
}

} // namespace

Process::Process(Simulation &owner, std::string process_name)
    : name(std::move(process_name)), owner_(&owner), integrator_(make_rk4()), executive_(owner.recorder())
{
    executive_.begin(name);
}

void Process::add(const std::string &instance_name, std::shared_ptr<Instance> instance, SourceLine at)
{
    const std::string wanted = name + "." + instance_name;
    if (!is_identifier(instance_name)) {
        throw SetupError(wanted + ": an instance's name must be an identifier");
    }
    if (!instance->name.empty()) {
        throw SetupError(wanted + ": this " + instance->type().name + " already is " + instance->path +
                         "; make another one");
    }
    if (has(instances_, instance_name)) {
        throw SetupError(wanted + " is already there, a " + find(instance_name)->type().name);
    }
    owner_->set_up_again();
    instance->name = instance_name;
    instance->path = wanted;
    instance->at = std::move(at);
    instances_.push_back(std::move(instance));
}

void Process::add_task(Task task)
{
    const std::string path = name + "." + task.name;
    if (task.period <= 0) {
        throw SetupError("task " + path + ": its period must be at least 1 ns, found " + format_time(task.period));
    }
    if (task.offset < 0) {
        throw SetupError("task " + path + ": its offset must be >= 0, found " + format_time(task.offset));
    }
    if (has(tasks_, task.name)) {
        throw SetupError("task " + path + " is already there");
    }
    if (task.run.empty()) {
        throw SetupError("task " + path + " runs nothing");
    }
    for (auto it = task.run.begin(); it != task.run.end(); ++it) {
        if (std::find(instances_.begin(), instances_.end(), *it) == instances_.end()) {
            throw SetupError("task " + path + " runs " + (*it)->path + ", which is not in the process " + name +
                             "; it has " + format_list(names_of(instances_)));
        }
        const auto runs = [&](const Task &other) {
            return std::find(other.run.begin(), other.run.end(), *it) != other.run.end();
        };
        const auto other = std::find_if(tasks_.begin(), tasks_.end(), runs);
        if (other != tasks_.end() || std::find(task.run.begin(), it, *it) != it) {
            throw SetupError("task " + path + " runs " + (*it)->path + ", which is already in task " + name + "." +
                             (other != tasks_.end() ? other->name : task.name));
        }
    }
    owner_->set_up_again();
    tasks_.push_back(std::move(task));
}

void Process::add_mode(Mode mode)
{
    if (has(modes_, mode.name)) {
        throw SetupError("mode " + name + "." + mode.name + " is already there");
    }
    for (const std::string &task : mode.tasks) {
        if (!has(tasks_, task)) {
            throw SetupError("mode " + name + "." + mode.name + " names the task " + task + "; the process has " +
                             format_list(names_of(tasks_)));
        }
    }
    owner_->set_up_again();
    modes_.push_back(std::move(mode));
    initial_ = std::max(initial_, 0);
}

std::shared_ptr<Event> Process::add_event(Event event)
{
    const std::string path = "event " + name + "." + event.name;
    if (has(events_, event.name)) {
        throw SetupError(path + " is already there");
    }
    if (event.condition.has_value() == static_cast<bool>(event.predicate)) {
        throw SetupError(path + " needs one condition");
    }
    if (event.mode.empty() && event.arms.empty() && event.set.empty() && !event.action) {
        throw SetupError(path + " does nothing: give it a mode to enter or something to do");
    }
    if (event.count < 1) {
        throw SetupError(path + ": the count must be >= 1, found " + std::to_string(event.count));
    }
    if (event.once && event.until) {
        throw SetupError(path + ": with once, it does not arm itself again: leave out until");
    }
    for (const std::string &mode : event.modes) {
        if (!has(modes_, mode)) {
            throw SetupError(path + " looks in the mode " + mode + "; the process has " +
                             format_list(names_of(modes_)));
        }
    }
    for (const Setting &setting : event.set) {
        const Instance &target = *setting.instance;
        const FledgeField *field = field_at(target.type(), setting.offset);
        const std::string found = path + " sets " + target.path + "." + field->name;
        if (find(target.name).get() != &target || target.model()) {
            throw SetupError(found + ": an event sets what modules of its own process have");
        }
        if ((field->group != FLEDGE_PAR && field->group != FLEDGE_OUT) || field->flags & FLEDGE_INITIAL) {
            throw SetupError(found + ": an event sets parameters, but for initial values, and outputs");
        }
    }
    if (event.hold < 0) {
        throw SetupError(path + ": the time to hold must be >= 0, found " + format_time(event.hold));
    }
    if (!event.mode.empty() && !has(modes_, event.mode)) {
        throw SetupError(path + " enters the mode " + event.mode + "; the process has " +
                         format_list(names_of(modes_)));
    }
    events_.push_back(std::make_shared<Event>(std::move(event)));
    if (owner_->runtime_) {
        owner_->runtime_->event_added(*this);
    }
    return events_.back();
}

int Process::mode_index(const std::string &mode) const
{
    const auto it = std::find_if(modes_.begin(), modes_.end(), [&](const Mode &m) { return m.name == mode; });
    if (it == modes_.end()) {
        throw SetupError("process " + name + " has no mode " + mode + "; it has " + format_list(names_of(modes_)));
    }
    return static_cast<int>(it - modes_.begin());
}

void Process::start_in(const std::string &mode)
{
    const int index = mode_index(mode);
    owner_->set_up_again();
    initial_ = index;
}

bool Process::may_enter(int mode) const
{
    const Mode &target = modes_[static_cast<std::size_t>(mode)];
    return (target.after.empty() ||
            std::find(target.after.begin(), target.after.end(), this->mode()) != target.after.end()) &&
           (!target.when || target.when->holds());
}

void Process::enter(const std::string &mode)
{
    const int index = mode_index(mode);
    if (!may_enter(index)) {
        throw SetupError("mode " + name + "." + mode + " may be entered only " +
                         modes_[static_cast<std::size_t>(index)].guard() + ", which is not so " +
                         (owner_->time() < 0 ? "before the run" : "at " + format_time(owner_->time())) +
                         " in the mode " + this->mode());
    }
    if (owner_->time() < 0) {
        requests.mode = index;
    }
    if (owner_->runtime_) {
        owner_->runtime_->enter(*this, index);
    }
}

const std::string &Process::mode_name(int mode) const
{
    static const std::string none;
    return mode < 0 ? none : modes_[static_cast<std::size_t>(mode)].name;
}

const std::string &Process::mode() const
{
    return mode_name(owner_->runtime_ ? owner_->runtime_->of(*this).mode : initial_);
}

const std::string &Process::requested_mode() const
{
    const int first = requests.mode < 0 ? initial_ : requests.mode;
    return mode_name(owner_->runtime_ ? owner_->runtime_->of(*this).requested : first);
}

int Process::arming(const Event &event) const
{
    if (owner_->runtime_) {
        return owner_->runtime_->of(*this, event).state.armed;
    }
    const auto entry = requests.armed.find(index_of(event));
    return entry == requests.armed.end() ? event.armed : entry->second;
}

bool Process::armed(const Event &event) const
{
    return arming(event) == 1;
}

std::size_t Process::index_of(const Event &event) const
{
    const auto it = std::find_if(events_.begin(), events_.end(), [&](const auto &own) { return own.get() == &event; });
    return static_cast<std::size_t>(it - events_.begin());
}

void Process::arm(const Event &event, bool armed)
{
    if (owner_->time() < 0) {
        requests.armed[index_of(event)] = armed;
    }
    if (owner_->runtime_) {
        owner_->runtime_->of(*this, event).state.armed = armed;
    }
}

Ns Process::fired_at(const Event &event) const
{
    return owner_->runtime_ ? owner_->runtime_->of(*this, event).state.fired_at : -1;
}

Tally Process::entered(const Mode &mode) const
{
    return owner_->runtime_ ? owner_->runtime_->of(*this).entered[static_cast<std::size_t>(&mode - modes_.data())]
                            : Tally{};
}

std::span<const std::uint8_t> Process::followed() const
{
    return owner_->runtime_ ? owner_->runtime_->of(*this).followed : std::span<const std::uint8_t>();
}

Tally Process::fired(const Event &event) const
{
    return owner_->runtime_ ? owner_->runtime_->of(*this, event).fired : Tally{};
}

void Process::play(const Instance &instance, Played output)
{
    const FledgeField &field = *output.output;
    const std::string path = instance.path + "." + field.name;
    const auto own = [&](const auto &own_instance) { return own_instance.get() == &instance; };
    if (std::none_of(instances_.begin(), instances_.end(), own)) {
        throw SetupError(path + " is not of the process " + name);
    }
    if (field.group != FLEDGE_OUT) {
        throw SetupError(path + " is no output: a playback is of those");
    }
    output.messages->check(path, field.size);
    stand_in(Instance::Maker::record);
    output.held.resize(output.sent ? field.size : 0);
    playback_[&instance].outputs.push_back(std::move(output));
}

void Process::play_executive(std::shared_ptr<const Messages> modes, std::shared_ptr<const Messages> happenings)
{
    modes->check(name + ".mode", sizeof(ProcessMode));
    if (happenings->bytes.size() != happenings->times.size() * sizeof(Activity)) {
        throw SetupError(name + ".activity: expected a message of " + std::to_string(sizeof(Activity)) +
                         " bytes for each time");
    }
    for (std::size_t i = 0; i < modes->times.size(); i++) {
        ProcessMode mode;
        std::memcpy(&mode, modes->message(i), sizeof mode);
        if (mode.index >= modes_.size()) {
            throw SetupError(name + " has " + std::to_string(modes_.size()) +
                             " modes; the record has one with the index " + std::to_string(mode.index) + ", " +
                             mode.name);
        }
    }
    owner_->set_up_again();
    executive_.play(std::move(modes), std::move(happenings));
}

/// No instance runs any more.
void Process::stand_in(Instance::Maker maker)
{
    owner_->set_up_again();
    for (const auto &instance : instances_) {
        instance->maker = maker;
        playback_[instance.get()].memory = instance->memory();
    }
}

void Process::fly_by(std::function<void(Ns t)> flight)
{
    stand_in(Instance::Maker::computer);
    flight_ = std::move(flight);
}

void Process::fly_by_model(const std::string &as, const std::shared_ptr<Instance> &computer, std::vector<Shared> shared,
                           std::ptrdiff_t request)
{
    for (const Shared &each : shared) {
        const std::size_t size = each.port.field->size, room = computer->type().size;
        if (find(each.port.instance->name) != each.port.instance || each.offset > room || size > room - each.offset) {
            throw SetupError(each.port.path() + " has no place in the computer that flies " + name);
        }
    }
    stand_in(Instance::Maker::model);
    add(as, computer);
    set_computer(computer, std::move(shared), request);
}

void Process::set_computer(std::shared_ptr<Instance> computer, std::vector<Shared> shared, std::ptrdiff_t request)
{
    computer_ = std::move(computer);
    shared_ = std::move(shared);
    request_ = request;
    flight_ = [this](Ns t) {
        bool changed = false;
        for (const auto &[port, offset] : shared_) {
            std::byte *const place = computer_->memory() + offset;
            if (port.field->group == FLEDGE_IN) {
                std::ranges::copy(incoming(port), place);
            } else if (port.field->group == FLEDGE_PAR && std::memcmp(place, port.bytes(), port.field->size) != 0) {
                std::memcpy(place, port.bytes(), port.field->size);
                changed = true;
            }
        }
        if (owner_->time() < 0) {
            request_of_computer(requests.mode);
        }
        {
            const Runs runs(computer_.get());
            if (changed) {
                computer_->model()->refresh();
            }
            computer_->model()->update({t, 0});
        }
        request_of_computer(-1);
        for (const auto &[port, offset] : shared_) {
            if (port.field->group == FLEDGE_OUT) {
                std::memcpy(port.bytes(), computer_->memory() + offset, port.field->size);
            }
        }
    };
}

void Process::request_of_computer(int mode) const
{
    if (computer_ && request_ >= 0) {
        const std::int32_t number = mode + 1;
        std::memcpy(computer_->memory() + request_, &number, sizeof number);
    }
}

std::span<const std::byte> Process::incoming(const Port &input) const
{
    owner_->prepare();
    return owner_->runtime_->incoming(input);
}

const std::byte *Process::given(const Port &port, const Process &reader) const
{
    const auto found = playback_.find(port.instance.get());
    if (found != playback_.end() && &reader != this) {
        for (const Played &output : found->second.outputs) {
            if (output.sent && output.output == port.field) {
                return output.held.data();
            }
        }
    }
    return port.bytes();
}

void Playback::at(Ns t)
{
    for (Played &output : outputs) {
        if (const std::size_t n = output.messages->until(t)) {
            std::byte *to = output.sent ? output.held.data() : memory + output.output->offset;
            std::memcpy(to, output.messages->message(n - 1), output.output->size);
        }
    }
}

void Process::set_dictionary(std::shared_ptr<const Dictionary> dictionary)
{
    dictionary_ = std::move(dictionary);
    if (owner_->runtime_) {
        owner_->runtime_->set_commands(*this, dictionary_);
    }
}

void Process::set_script(std::vector<ScriptedCommand> script)
{
    script_ = std::move(script);
    if (owner_->runtime_) {
        if (owner_->runtime_->time() < 0) {
            owner_->runtime_->set_commands(*this, dictionary_);
            executive_.forget();
        }
        owner_->runtime_->find_places();
    }
}

CommandReason Process::command(const std::vector<std::uint8_t> &packet)
{
    owner_->prepare();
    return owner_->runtime_->command(*this, packet);
}

void Process::play_telemetry(std::vector<Packet> packets)
{
    telemetry.take(); // they keep them from now on
    units.take();
    played_telemetry_ = std::move(packets);
}

Carrier &Process::carrier(const Instance &model)
{
    owner_->prepare();
    for (Carrier *carrier : owner_->structure_.carriers(*this)) {
        if (dynamic_cast<Model *>(carrier) == model.model()) {
            return *carrier;
        }
    }
    throw SetupError(model.path + " carries no packets of " + name + ": give a model that serves it");
}

void Process::send_by(const Instance &model, Unit unit)
{
    carrier(model).send_up(std::max<Ns>(owner_->runtime_->time(), 0), unit);
    owner_->runtime_->expect_changes();
}

CommandReason Process::command_mode(const std::string &mode)
{
    const int index = mode_index(mode);
    return owner_->runtime_->of(*this).commands->enter(static_cast<std::uint16_t>(index));
}

std::vector<CommandReply> Process::take_reports()
{
    return owner_->runtime_ ? owner_->runtime_->of(*this).commands->take_reports() : std::vector<CommandReply>{};
}

CommandLink Process::ground() const
{
    return owner_->runtime_ ? owner_->runtime_->of(*this).commands->ground() : CommandLink{};
}

CommandCounters Process::command_counters() const
{
    return owner_->runtime_ ? owner_->runtime_->of(*this).commands->counters() : CommandCounters{};
}

void Process::reset_by(const Port &input, Ns down)
{
    if (input.field->group != FLEDGE_IN || std::strcmp(input.field->sub->name, "ComputerReset") != 0 ||
        find(input.instance->name) != input.instance) {
        throw SetupError(name + ".reset_by: expected an input of a module of this process, a ComputerReset; found " +
                         input.path() + ", a " + input.field->sub->name);
    }
    if (down < 0) {
        throw SetupError(name + ".reset_by: down must be >= 0, found " + format_time(down));
    }
    owner_->set_up_again();
    reset_ = ResetLine{input, down};
}

std::vector<std::pair<Ns, Ns>> Process::outages() const
{
    return owner_->runtime_ ? owner_->runtime_->of(*this).outages : std::vector<std::pair<Ns, Ns>>{};
}

bool Process::runs_in(const Task &task, int mode) const
{
    if (!playback_.empty()) {
        return true;
    }
    bool named = false;
    for (std::size_t i = 0; i < modes_.size(); i++) {
        const auto &tasks = modes_[i].tasks;
        if (std::find(tasks.begin(), tasks.end(), task.name) != tasks.end()) {
            named = true;
            if (static_cast<int>(i) == mode) {
                return true;
            }
        }
    }
    return !named;
}

void Process::set_integrator(std::shared_ptr<const Integrator> integrator)
{
    owner_->set_up_again();
    integrator_ = std::move(integrator);
}

std::shared_ptr<Instance> Process::find(std::string_view instance) const
{
    const auto it =
        std::find_if(instances_.begin(), instances_.end(), [&](const auto &i) { return i->name == instance; });
    return it == instances_.end() ? nullptr : *it;
}

std::shared_ptr<Event> Process::event(std::string_view event_name) const
{
    const auto it = std::find_if(events_.begin(), events_.end(), [&](const auto &e) { return e->name == event_name; });
    return it == events_.end() ? nullptr : *it;
}

} // namespace fledge::sim
