// SPDX-License-Identifier: Apache-2.0
// The structure that a user builds: processes with their tasks of modules and models, modes and events, and the wires
// between them. It does not change during a run, except that an action of an event may add events. runtime.h holds the
// state of the run.
#pragma once

#include "flight/command/command.h"
#include "flight/exec/message.h"
#include "sim/carrier.h"
#include "sim/condition.h"
#include "sim/error.h"
#include "sim/executive.h"
#include "sim/instance.h"

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace fledge::sim {

class Simulation;

/// An input or output of an instance.
struct Port {
    std::shared_ptr<Instance> instance;
    const FledgeField *field = nullptr;

    std::string path() const; ///< "flight.control.error"
    std::byte *bytes() const { return instance->memory() + field->offset; }
    void set_fed(bool fed) const; ///< Instance::fed
};

struct WireOptions {
    /// 0: the consumer reads the message that the producer wrote last. 1: it reads the message of the last exchange, so
    /// that the two processes may run in parallel; see Simulation::connect.
    int latency = 0;
    /// [ns] The wire lowers the quality of a message that is older than this; 0: never.
    Ns stale_after = 0;
    /// Of several wires into one input, which have the same: which one counts, in the order of their declaration.
    ExecChoice by = EXEC_SOLE;
    std::string mode = {}; ///< EXEC_IN_MODE: the wire is carried in this mode of its process
    bool more = false;     ///< whether it joins the wires that its input has
    SourceLine at = {};    ///< where it was declared

    /// How it is chosen, in words: "newest", "in safe"; "": it is the only one.
    std::string choice() const;
};

struct Wire {
    Port from, to;
    WireOptions options;
};

/// How often, and when first.
struct Tally {
    std::uint64_t count = 0;
    Ns first = -1;

    void add(Ns t) { first = count++ ? first : t; }
};

/// Modules or models that run in order, at one rate.
struct Task {
    std::string name;
    Ns period = 0;
    Ns offset = 0;
    int priority = 0;
    std::vector<std::shared_ptr<Instance>> run;
};

/// A named set of active tasks. Tasks that no mode names are always active. A request to enter it is refused unless it
/// comes in one of the modes `after`, if there are any, and `when` holds, if it is given.
struct Mode {
    std::string name;
    std::vector<std::string> tasks;
    std::optional<Condition> when = {};
    std::vector<std::string> after = {};
    SourceLine at = {}; ///< where it was declared

    /// When it may be entered, in words: "after rest or point, if flight.burn.loaded == 1"; "": always.
    std::string guard() const;
};

/// What an event writes: parameters or outputs of a module of its process.
struct Setting {
    std::shared_ptr<Instance> instance;
    std::uint32_t offset = 0; ///< bytes from the start of the instance's memory
    std::vector<std::byte> bytes;
};

/// A process checks its events at the instants at which one of its tasks ran, in the order of their declaration. An
/// event fires when its condition has held for `hold`, and at `count` of these instants without a gap. It then waits
/// until the condition no longer holds, or, if it has `until`, until that condition holds; with `once`, until something
/// arms it. A process checks an event once at an instant, as a flight computer does; one with Python in it is checked
/// again while events fire. If its action arms it while its condition still holds, it would fire for ever: that is a
/// RunError.
struct Event {
    std::string name;
    std::optional<Condition> condition; ///< either this or the predicate
    std::function<bool()> predicate;
    std::optional<Condition> until;
    Ns hold = 0;
    std::int32_t count = 1;
    bool once = false;
    bool armed = true;              ///< at the start of a run
    std::string text;               ///< when it happens, in words
    std::vector<std::string> modes; ///< only in these its condition holds; none: in all

    std::string mode; ///< enter this mode of the event's process; "": none
    /// Names of events of its process, and whether to arm or disarm each.
    std::vector<std::pair<std::string, bool>> arms;
    std::vector<Setting> set;
    std::function<void()> action; ///< call this; may be empty
    SourceLine at;                ///< where it was declared

    bool is_data() const { return condition && !action; }
    /// Call f with every instance that it reads or writes.
    void visit(const std::function<void(std::shared_ptr<Instance> &)> &f);
};

/// The messages of a port as they were elsewhere, or as a user gives them.
struct Messages {
    std::vector<Ns> times;        ///< rising; of happenings several may have the same
    std::vector<std::byte> bytes; ///< a message for each time

    /// How many there are until t.
    std::size_t until(Ns t) const;
    const std::byte *message(std::size_t i) const { return bytes.data() + i * (bytes.size() / times.size()); }
    /// Throws SetupError that begins with `path`, unless there is one of this size for each rising time.
    void check(const std::string &path, std::size_t size) const;
};

/// What an output was elsewhere.
struct Played {
    const FledgeField *output = nullptr;
    std::shared_ptr<const Messages> messages;
    bool sent = false;           ///< these are what other processes read, which need not be what was put out
    std::vector<std::byte> held; ///< with `sent`: the last one
};

/// What an input gets by hand, in place of a wire: at each instant the last message until then.
struct Feed {
    Port to;
    std::shared_ptr<const Messages> messages; ///< null: the caller writes the input itself
    bool always = false;                      ///< the only message holds for each instant
    std::vector<std::uint32_t> linear;        ///< [bytes] the doubles that change linearly from message to message
    Ns stale_after = 0;                       ///< as of a wire
    std::string source;                       ///< in words
};

/// An instance that does not run: at each of its instants its outputs become the last messages until then.
struct Playback {
    std::byte *memory = nullptr;
    std::vector<Played> outputs;

    void at(Ns t);
};

/// What a process can be commanded, as data for its CommandTable: fledge.commands makes it of the live objects.
struct Dictionary {
    struct Block {
        std::string instance;
        std::uint32_t offset = 0, size = 0; ///< [bytes] of its parameters in its memory
        bool configuration = false;
        std::vector<ExecRun> runs;
        std::vector<CommandRule> rules; ///< without texts
    };
    /// A message that a module puts out.
    struct Output {
        std::string instance;
        std::uint32_t offset = 0, size = 0; ///< [bytes] in its memory
        std::vector<ExecRun> runs;
    };
    std::uint16_t stream = 0, telemetry = 0, version = 0; ///< telemetry: its first stream
    std::uint32_t room = 0;                               ///< [bytes] for commands that wait
    std::vector<Block> blocks;
    std::vector<Output> outputs;
};

/// What runs the procedures of commands: Python, in place of an interpreter on board. A clone has none.
struct ProcedureHost {
    enum Turn { GOES_ON, ENDED, FAILED };

    /// Begin a procedure, which may take so many turns in one instant; COMMAND_OK, or why not.
    std::function<int(const std::vector<std::uint8_t> &bytecode, std::uint16_t sequence, std::uint32_t turns)> start;
    /// At an instant of the process: a Turn. What it changed in the modules is taken back if it failed.
    std::function<int(Ns t)> turn;
    /// It has ended otherwise: killed, because of a change that is refused, or stopped.
    std::function<void(Ns t, bool killed, const std::string &why)> end;
};

/// What resets the computer of a process.
struct ResetLine {
    Port input; ///< a ComputerReset
    Ns down;    ///< how long the computer runs nothing
};

/// What a computer in the simulation has of the process in whose place it flies.
struct Shared {
    Port port;          ///< an input, parameter or output of the process' modules
    std::size_t offset; ///< [bytes] of the same bytes in the computer's interface
};

struct ScriptedCommand {
    Ns after;
    std::vector<std::uint8_t> packet;
    bool counts_on = false; ///< its sequence becomes the one behind that of the last command
};

/// A report, and the bytes that were read back.
struct CommandReply {
    CommandReport report;
    std::vector<std::uint8_t> data;
};

/// The requests to a process before its first instant.
struct Requests {
    int mode = -1;                     ///< -1: none
    std::map<std::size_t, bool> armed; ///< by the index of the event
};

/// The tasks of one computer or model world: "flight" or "world".
class Process {
public:
    std::string name;
    Requests requests;      ///< they wait for the first instant; Simulation::reset() forgets them
    bool stands_in = false; ///< for other programs: the health of its instances is theirs

    /// Give an instance its name. Throws SetupError if the name is taken or no identifier, or if
    /// the instance already has a process.
    void add(const std::string &name, std::shared_ptr<Instance> instance, SourceLine at = {});

    /// Throws SetupError on a period <= 0, a negative offset, an unknown or twice used instance.
    void add_task(Task task);
    void add_mode(Mode mode);
    std::shared_ptr<Event> add_event(Event event);
    /// Begin in this mode. The first one added is the default. Throws SetupError if the simulation has run.
    void start_in(const std::string &mode);
    void set_integrator(std::shared_ptr<const Integrator> integrator);
    /// From now on no instance of this process runs: this one puts out these messages, and others what was given for
    /// them. All tasks are active in all modes, because the messages have the effects of modes. Throws SetupError if
    /// the instance is of another process, has run, or the messages are not one for each rising time.
    void play(const Instance &instance, Played output);
    /// From now on its mode is that of these messages, and it says them, and what happened in it. Throws SetupError if
    /// it has no such mode, or the messages are not one for each time.
    void play_executive(std::shared_ptr<const Messages> modes, std::shared_ptr<const Messages> happenings);
    /// From now on no instance of this process runs: this function is called once at each of its instants, and writes
    /// their outputs. Its messages are as with play(). Such a simulation cannot be cloned.
    void fly_by(std::function<void(Ns t)> flight);
    const std::function<void(Ns t)> &flight() const { return flight_; }
    /// The same by a model, which becomes an instance of this process without a task: at each instant it gets the
    /// inputs and parameters, updates, and its outputs become theirs. It keeps the time itself: its ticks have no dt.
    /// request: where [bytes] it has the mode to enter, an int32_t from 1, 0: none; -1: nowhere.
    void fly_by_model(const std::string &as, const std::shared_ptr<Instance> &computer, std::vector<Shared> shared,
                      std::ptrdiff_t request = -1);
    const std::shared_ptr<Instance> &computer() const { return computer_; } ///< or null
    void request_of_computer(int mode) const;                               ///< that it enters a mode; -1: none
    /// The message that is for an input at the present instant, as fly_by's function sees it.
    std::span<const std::byte> incoming(const Port &input) const;

    const Integrator &integrator() const { return *integrator_; }
    const std::vector<std::shared_ptr<Instance>> &instances() const { return instances_; }
    const std::vector<Task> &tasks() const { return tasks_; }
    const std::vector<Mode> &modes() const { return modes_; }
    const std::vector<std::shared_ptr<Event>> &events() const { return events_; }
    std::shared_ptr<Instance> find(std::string_view instance) const; ///< or null
    std::map<const Instance *, Playback> &playback() { return playback_; }
    /// What a port gives to a reader: its message, or what a playback has for other processes.
    const std::byte *given(const Port &port, const Process &reader) const;
    std::shared_ptr<Event> event(std::string_view event_name) const; ///< or null
    int initial_mode() const { return initial_; }                    ///< -1: the process has no modes
    int mode_index(const std::string &mode) const;                   ///< throws SetupError with the valid names
    bool runs_in(const Task &task, int mode) const;                  ///< whether the task is active in the mode

    /// The computer of this process is reset by each new count of a ComputerReset that it reads, and is down for a
    /// time. Throws SetupError if the port is no such input of its instances.
    void reset_by(const Port &input, Ns down);
    const std::optional<ResetLine> &reset_line() const { return reset_; }

    // The state of the run. Before a run is prepared, the mode is the initial one and events are as they start.

    /// Whether a mode may be entered now.
    bool may_enter(int mode) const;
    /// Request a mode. The process enters it at its next instant. Throws SetupError if it may not be entered.
    void enter(const std::string &mode);
    /// The mode in force; "" if the process has none.
    const std::string &mode() const;
    /// The mode that was requested last, which may be in force.
    const std::string &requested_mode() const;
    bool armed(const Event &event) const;
    int arming(const Event &event) const; ///< ExecEvent::armed
    void arm(const Event &event, bool armed);
    Ns fired_at(const Event &event) const; ///< when it last fired; -1: never
    /// How often a mode began in this run, and when first; the same of the firing of an event.
    Tally entered(const Mode &mode) const;
    /// How often, up to 255, a mode was followed by another: rows of the first, in the order of modes().
    std::span<const std::uint8_t> followed() const;
    Tally fired(const Event &event) const;
    Executive &executive() { return executive_; }
    const Executive &executive() const { return executive_; }
    /// (from, until) of the times at which its computer was down.
    std::vector<std::pair<Ns, Ns>> outages() const;

    // Commands, of a process that has a dictionary.

    void set_dictionary(std::shared_ptr<const Dictionary> dictionary);
    const std::shared_ptr<const Dictionary> &dictionary() const { return dictionary_; }
    /// Accept or refuse a packet; what is accepted counts at the next instant of one of its tasks, active or not.
    CommandReason command(const std::vector<std::uint8_t> &packet);
    /// The model as what carries units between this process and the ground. Throws SetupError if it does not.
    Carrier &carrier(const Instance &model);
    void send_by(const Instance &model, Unit unit); ///< from the ground, now
    /// Commands for later, in the order of time: each is accepted before the first instant after its time.
    /// Before the first run they replace the commands that wait.
    void set_script(std::vector<ScriptedCommand> script);
    const std::vector<ScriptedCommand> &script() const { return script_; }
    void set_procedure_host(ProcedureHost host) { procedure_host_ = std::move(host); }
    const ProcedureHost &procedure_host() const { return procedure_host_; }
    /// As the command that requests a mode, of a procedure in its turn.
    CommandReason command_mode(const std::string &mode);
    /// The reports since the last call, of a run that is prepared.
    std::vector<CommandReply> take_reports();
    CommandCounters command_counters() const;
    CommandLink ground() const;       ///< the link by which commands come
    Units telemetry;                  ///< its packets
    Units units;                      ///< what carries them: frames, or they themselves
    std::shared_ptr<const void> keys; ///< of secured frames: a SdlsProvider (ccsds/sdls.h)
    /// From now on its packets are these, in the order of time, of a target that flew.
    void play_telemetry(std::vector<Packet> packets);
    const std::optional<std::vector<Packet>> &played_telemetry() const { return played_telemetry_; }
    Units received; ///< what carriers brought, each after the time before its instant

private:
    friend class Simulation;
    Process(Simulation &owner, std::string process_name);
    void stand_in(Instance::Maker maker);
    void set_computer(std::shared_ptr<Instance> computer, std::vector<Shared> shared, std::ptrdiff_t request);

    std::size_t index_of(const Event &event) const;
    const std::string &mode_name(int mode) const; ///< "" of -1

    Simulation *owner_;
    std::vector<std::shared_ptr<Instance>> instances_;
    std::vector<Task> tasks_;
    std::vector<Mode> modes_;
    std::vector<std::shared_ptr<Event>> events_;
    std::shared_ptr<const Integrator> integrator_;
    std::map<const Instance *, Playback> playback_;
    Executive executive_;
    std::function<void(Ns t)> flight_;
    std::shared_ptr<Instance> computer_;
    std::vector<Shared> shared_;  ///< with it
    std::ptrdiff_t request_ = -1; ///< of it
    std::shared_ptr<const Dictionary> dictionary_;
    std::vector<ScriptedCommand> script_;
    std::optional<std::vector<Packet>> played_telemetry_;
    ProcedureHost procedure_host_;
    std::optional<ResetLine> reset_;
    int initial_ = -1;
};

/// The whole structure. Processes run in this order.
struct Structure {
    std::uint64_t seed = 0;
    std::vector<std::unique_ptr<Process>> processes;
    std::vector<Wire> wires;
    std::vector<Feed> feeds;

    /// The feed of an input, or null.
    const Feed *feed_of(const Port &input) const;

    Process &process(std::string_view name) const; ///< throws SetupError with the valid names

    /// The models that serve a process.
    std::vector<Carrier *> carriers(const Process &of) const;

    /// The paths of all outputs of a type, for messages.
    std::vector<std::string> outputs_of_type(const FledgeStruct *type) const;
};

bool same_type(const FledgeStruct *a, const FledgeStruct *b);

/// What an instance does in a run.
struct Role {
    const Process *process;
    bool scheduled = false; ///< a task runs it
    bool part = false;      ///< a model that another model advances
    /// A module without a task: it publishes its parameters at the start, and again after they change.
    bool configuration = false;
};
using Roles = std::map<const Instance *, Role>;

Roles decide_roles(const Structure &structure);

/// The tasks of a process in the order in which they run at equal times.
std::vector<const Task *> in_order(const Process &process);

/// The longest period of its tasks; 0 if there are none.
Ns longest_period(const Process &process);

/// An instance, then the parts that it advances, and theirs.
std::vector<const Instance *> with_parts(const Process &process, const Instance &instance);

/// Collect all inputs without a wire, instances without a task and bad parameters. Returns the instances whose
/// parameters are bad.
std::set<const Instance *> check(const Structure &structure, const Roles &roles, Faults &faults);

/// Throws SetupError that lists the inputs without a wire to which a user assigned, although their heads say that
/// nothing was written: nothing reads them. flown: the simulation has run, so that no feed can begin.
void check_assigned(const Structure &structure, bool flown);

/// Collect inputs that must differ, such as two bodies to point at, but are wired to one output, or to two outputs
/// with the same content at the start.
void check_distinct(const Structure &structure, Faults &faults);

/// The dependencies between processes besides wires, of one process or (if the name is empty) of all: pairs of an event
/// or model, and the instance of another process on which it depends. The function does not find dependencies inside
/// Python callables.
std::vector<std::pair<std::string, std::string>> cross_process_dependencies(const Structure &structure,
                                                                            std::string_view process);

/// See Simulation::assumptions.
std::vector<std::string> assumptions(const Structure &structure);

} // namespace fledge::sim
