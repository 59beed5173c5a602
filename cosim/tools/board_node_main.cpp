// SPDX-License-Identifier: Apache-2.0
// The node of a board as a program: fledge_board_node --help.
#include "cosim/node/board_node.h"
#include "options/options.h"
#include "record/file_sink.h"
#include "registers/line_backend.h"
#include "registers/snapshot_link.h"

#include <charconv>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <dlfcn.h>
#include <fcntl.h>
#include <fstream>
#include <optional>
#include <string_view>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>

namespace {

using namespace fledge;
using namespace std::chrono_literals;

struct Settings {
    std::string tables, registers, line, line_record, script, telemetry;
    const MissionHost *mission = nullptr; ///< of the tables
    std::vector<std::string> command;
    bool by_radio = false;
    cosim::MemberConfig delegate;
    std::chrono::nanoseconds reply = 60s;
};

const MissionHost &load(const Options &options, const std::string &path)
{
    // Without a slash, dlopen() searches the system's libraries.
    const std::string file = path.find('/') == path.npos ? "./" + path : path;
    void *library = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
    const void *mission = library ? dlsym(library, "fledge_mission") : nullptr;
    if (!mission) {
        options.refuse("--tables " + path + ": " + dlerror());
    }
    return *static_cast<const MissionHost *>(mission);
}

Settings parse(int argc, char **argv)
{
    Settings o;
    const auto command = std::find(argv + 1, argv + argc, std::string_view("--"));
    if (command != argv + argc) {
        o.command.assign(command + 1, argv + argc);
    }
    Options options(
        "fledge_board_node",
        "Joins a simulation for a flight computer that knows nothing but the registers of its boards.",
        "Behind --, a command that starts flight; it ends with this program, and {registers} in its arguments is "
        "the register file. A command "
        "with {snapshots} makes snapshots of its computer: that is a socket (registers/snapshot_link.h).\n\n"
        "A line is DEVICE?baud=921600&reset=end&cut=0&pace=0&build=HEX: the rate; whether a reset of the board ends "
        "the run, or flight begins within it (reset=go-on); how long the line may be cut or silent [s]; the pace of "
        "the run, to tell how late answers are; and the build id of the board's program. With pty as its DEVICE it is "
        "a pseudo terminal, whose path is {line} in the arguments of the command.\n\n"
        "example: fledge_board_node --tables nadir_spin.so -- ./nadir_spin --record flight.mcap {registers}");
    const auto text = [&](const char *name, std::string &to, const char *help) {
        return options.text(name, to, "", help);
    };
    double patience = 60, reply = 60; // [s]
    const auto time = [&](const char *name, double &to, const char *help) {
        options.number(name, to, 1e-3, 1e6, "SECONDS", help);
    };
    text("--tables", o.tables, "the mission and its boards as data: a shared object, as ./fledge fly builds it")
        .required();
    text("--registers", o.registers, "the register file to be made; flight attaches to it by itself");
    text("--line", o.line, "the serial line of a board");
    text("--line-record", o.line_record, "a file for the record of flight that comes through the line").needs("--line");
    text("--script", o.script,
         "commands: lines of a time [ns] and the bytes of a packet in hexadecimal; flight gets\n"
         "each before its first instant after that time");
    text("--telemetry", o.telemetry, "a file for flight's packets, in lines of the same form, with the instant");
    text("--simulation", o.delegate.simulation, "of the run; default: FLEDGE_SIMULATION, else the mission's name");
    text("--node", o.delegate.node, "of this node; default: FLEDGE_NODE, else flight");
    text("--address", o.delegate.address, "of the controller; default: FLEDGE_ADDRESS, else tcp://127.0.0.1:7000");
    text("--keys", o.delegate.keys, "of this node (fledge keys); default: FLEDGE_KEYS");
    options.flag("--by-radio", o.by_radio, "a radio of another node carries commands and telemetry, too");
    time("--patience", patience, "for the controller, and for flight, to be there; default 60");
    time("--reply", reply, "for flight to answer a tick; default 60");
    options.parse(static_cast<int>(command - argv), argv);
    if (o.line.empty() ? o.registers.empty() == o.command.empty() : !o.registers.empty()) {
        options.refuse("either --registers, or --line, or a command is needed");
    }
    o.delegate.connect_timeout = std::chrono::milliseconds(static_cast<long>(patience * 1e3));
    o.reply = std::chrono::milliseconds(static_cast<long>(reply * 1e3));
    o.mission = &load(options, o.tables);
    return o;
}

/// An empty option gets its value from the environment, else the default.
void fill(std::string &value, const char *variable, const char *usual)
{
    const char *given = std::getenv(variable);
    if (value.empty()) {
        value = given && *given ? given : usual;
    }
}

/// The program of flight, or of its machine. It ends with this program, which notices its end at once.
class Child {
public:
    /// Without a command there is no such program. `inherited`: a descriptor that it gets.
    Child(std::vector<std::string> command, int inherited)
    {
        if (command.empty()) {
            return;
        }
        int theirs = -1;
        for (std::string &word : command) {
            put(word, "{snapshots}", [&] {
                const auto [ours, other] = registers::SnapshotLink::make();
                link_.emplace(ours);
                theirs = other;
                return std::to_string(theirs);
            });
        }
        std::vector<char *> arguments;
        arguments.reserve(command.size() + 1);
        for (std::string &word : command) {
            arguments.push_back(word.data());
        }
        arguments.push_back(nullptr);
        const pid_t parent = getpid();
        pid_ = fork();
        if (pid_ == 0) {
            prctl(PR_SET_PDEATHSIG, SIGKILL);
            if (getppid() != parent || (inherited >= 0 && fcntl(inherited, F_SETFD, 0) != 0)) {
                _exit(126);
            }
            execvp(arguments[0], arguments.data());
            std::fprintf(stderr, "fledge_board_node: %s cannot be started: %s\n", arguments[0], std::strerror(errno));
            _exit(127);
        }
        close(theirs);
        if (pid_ < 0) {
            throw registers::Error(std::string("no process can be started: ") + std::strerror(errno));
        }
    }
    Child(const Child &) = delete;
    Child &operator=(const Child &) = delete;
    ~Child()
    {
        if (pid_ > 0 && !ended() && (stopped_ || !wait(2s))) {
            kill(pid_, SIGTERM);
            if (!wait(5s)) {
                kill(pid_, SIGKILL);
                waitpid(pid_, &status_, 0);
            }
        }
    }

    bool ended()
    {
        ended_ = ended_ || (pid_ > 0 && waitpid(pid_, &status_, WNOHANG) == pid_);
        return ended_;
    }

    /// It need not end by itself.
    void stop() { stopped_ = true; }

    /// Its exit code; -1 if it has not ended within the timeout, 128 + n after signal n; 0 if there is none.
    int result(std::chrono::seconds timeout)
    {
        return pid_ < 0 ? 0 : !wait(timeout) ? -1 : WIFEXITED(status_) ? WEXITSTATUS(status_) : 128 + WTERMSIG(status_);
    }

    std::optional<registers::SnapshotLink> &snapshots() { return link_; }

    /// Put a value in place of {name}, if the word has it.
    static void put(std::string &word, const std::string &place, const auto &value)
    {
        if (const auto at = word.find(place); at != word.npos) {
            word.replace(at, place.size(), value());
        }
    }

private:
    bool wait(std::chrono::milliseconds timeout)
    {
        for (auto left = timeout; !ended() && left > 0ms; left -= 5ms) {
            std::this_thread::sleep_for(5ms);
        }
        return ended();
    }

    std::optional<registers::SnapshotLink> link_;
    pid_t pid_ = -1;
    int status_ = 0;
    bool ended_ = false, stopped_ = false;
};

/// Flight behind a back end, in a child or on a machine that this runs.
class Launched final : public registers::Backend {
public:
    Launched(registers::Backend &backend, Child &child) : backend_(backend), child_(child) {}

    std::span<const RegisterWindow> windows() const override { return backend_.windows(); }

    registers::Wait await_done(const RegisterWindow &clock, std::chrono::nanoseconds timeout) override
    {
        const auto end = std::chrono::steady_clock::now() + timeout;
        for (;;) {
            const auto left = end - std::chrono::steady_clock::now();
            const auto wait = backend_.await_done(clock, std::min<std::chrono::nanoseconds>(left, 200ms));
            if (wait != registers::Wait::late) {
                return wait;
            }
            if (child_.ended()) {
                return registers::Wait::gone;
            }
            if (left <= 0ns) {
                return registers::Wait::late;
            }
        }
    }

    bool saves() const override { return child_.snapshots().has_value(); }
    std::vector<std::byte> save(std::chrono::nanoseconds timeout) override { return ask({}, timeout); }
    void restore(std::span<const std::byte> snapshot, std::chrono::nanoseconds timeout) override
    {
        ask(snapshot, timeout);
    }

private:
    std::vector<std::byte> ask(std::span<const std::byte> request, std::chrono::nanoseconds timeout)
    {
        const RegisterWindow &any = windows().front();
        return child_.snapshots()->ask(
            request, [&] { any.ring(any.user, 0); }, timeout);
    }

    registers::Backend &backend_;
    Child &child_;
};

void read_script(const std::string &path, cosim::BoardNode &node)
{
    std::ifstream file(path);
    cosim::Ns after = 0;
    std::string digits;
    while (file >> after >> digits) {
        std::vector<std::uint8_t> packet(digits.size() / 2);
        for (std::size_t i = 0; i < packet.size(); i++) {
            const auto end = digits.data() + 2 * i + 2;
            if (std::from_chars(end - 2, end, packet[i], 16).ptr != end) {
                throw registers::Error("--script " + path + ": '" + digits + "' is not hexadecimal");
            }
        }
        node.command(after, std::move(packet));
    }
    if (!file.eof()) {
        throw registers::Error("--script " + path + ": expected lines of a time [ns] and the bytes of a packet");
    }
}

/// Packets of flight as lines of a file, which gets its name at the regular end.
class TelemetryFile {
public:
    explicit TelemetryFile(std::string path) : path_(std::move(path)) {}
    ~TelemetryFile()
    {
        file_sink_write(&sink_, text_.data(), text_.size());
        file_sink_close(&sink_, false);
    }
    TelemetryFile(const TelemetryFile &) = delete;
    TelemetryFile &operator=(const TelemetryFile &) = delete;

    void begin() { check(file_sink_open(&sink_, path_.c_str())); }
    /// Go on with the file of a program that ended.
    void resume(const FileMark &mark) { check(file_sink_resume(&sink_, path_.c_str(), mark)); }
    FileMark mark()
    {
        FileMark mark;
        write();
        check(file_sink_mark(&sink_, &mark));
        return mark;
    }
    void add(cosim::Ns t, std::span<const std::uint8_t> packet)
    {
        static constexpr char digits[] = "0123456789abcdef";
        text_ += std::to_string(t) + ' ';
        for (const std::uint8_t byte : packet) {
            text_ += digits[byte >> 4];
            text_ += digits[byte & 15];
        }
        text_ += '\n';
        if (text_.size() >= std::size_t{1} << 16) {
            write();
        }
    }
    void close()
    {
        write();
        check(file_sink_close(&sink_, true));
    }

private:
    void write()
    {
        check(file_sink_write(&sink_, text_.data(), text_.size()));
        text_.clear();
    }
    void check(int error) const
    {
        if (error == ENODATA) {
            throw registers::Error("--telemetry " + path_ + ".part is not what was written until the snapshot");
        }
        if (error != 0) {
            throw registers::Error("--telemetry " + path_ + ": " + std::strerror(error));
        }
    }
    std::string path_, text_;
    FileSink sink_{.fd = -1, .error = 0, .marked = {}, .part = {}};
};

/// The node with its file, of which a snapshot has the mark.
class NodeWithFile final : public cosim::BoardNode {
public:
    NodeWithFile(const MissionHost &mission, registers::Backend &backend, std::chrono::nanoseconds reply,
                 const std::string &path)
        : BoardNode(mission, backend, reply)
    {
        if (!path.empty()) {
            file_.emplace(path);
            telemetry = [this](cosim::Ns t, std::span<const std::uint8_t> packet) { file_->add(t, packet); };
        }
    }
    cosim::Initialized initialize(const cosim::Initialize &request) override
    {
        cosim::Initialize rest = request;
        FileMark mark{};
        if (rest.snapshot.size() >= sizeof mark) {
            std::memcpy(&mark, rest.snapshot.data() + rest.snapshot.size() - sizeof mark, sizeof mark);
            rest.snapshot.resize(rest.snapshot.size() - sizeof mark);
        }
        if (file_) {
            request.snapshot.empty() ? file_->begin() : file_->resume(mark);
        }
        return BoardNode::initialize(rest);
    }
    cosim::Bytes save() override
    {
        cosim::Bytes snapshot = BoardNode::save();
        const FileMark mark = file_ ? file_->mark() : FileMark{};
        const auto *at = reinterpret_cast<const std::byte *>(&mark);
        snapshot.insert(snapshot.end(), at, at + sizeof mark);
        return snapshot;
    }
    void finish(const std::string &reason) override
    {
        BoardNode::finish(reason);
        if (file_ && reason.empty()) {
            file_->close();
        }
    }

private:
    std::optional<TelemetryFile> file_;
};

/// Returns the reason of an early end, "" for the regular end.
std::string serve(const Settings &o, const MissionHost &mission, registers::Backend &backend)
{
    zmq::context_t context;
    NodeWithFile node(mission, backend, o.reply, o.telemetry);
    if (o.by_radio) {
        node.speak_by_radio();
    }
    if (!o.script.empty()) {
        read_script(o.script, node);
    }
    std::string reason = cosim::Delegate(context, o.delegate).serve(node);
    const MissionIoCounts &counts = node.counts();
    std::printf("outside_refused %u\noutside_corrupt %u\noutside_saturated %u\noutside_skipped %u\nlost %u\n",
                counts.refused, counts.corrupt, counts.saturated, counts.skipped,
                mission_io_lost(mission.io, backend.windows().data()));
    return reason;
}

using Boards = std::span<const RegisterBoard *const>;

/// The reason of an early end, also if the child's exit code tells it.
std::string end(Child &child, std::string reason)
{
    const int result = child.result(10s);
    if (reason.empty() && result != 0) {
        reason =
            result < 0 ? "flight did not end with the run" : "flight ended with exit code " + std::to_string(result);
    }
    return reason;
}

std::string fly_registers(Settings &o, Boards boards)
{
    registers::SharedFile file(boards, o.registers);
    for (std::string &word : o.command) {
        Child::put(word, "{registers}", [&] { return "/dev/fd/" + std::to_string(file.fd()); });
    }
    Child child(o.command, file.fd());
    Launched flight(file, child);
    return end(child, serve(o, *o.mission, flight));
}

std::string fly_line(Settings &o, Boards boards)
{
    registers::LineBackend line(boards, {o.mission->name, mission_host_hash(o.mission)},
                                registers::LineSettings::read(o.line), o.line_record);
    for (std::string &word : o.command) {
        Child::put(word, "{line}", [&] { return line.path(); });
    }
    Child child(o.command, -1);
    Launched flight(line, child);
    const auto lives = [&] { return !child.ended(); };
    line.greet(o.delegate.connect_timeout, lives);
    std::string reason = serve(o, *o.mission, flight);
    if (reason.empty()) {
        if (const int status = line.end(10s, lives); status != 0) {
            reason = "flight on the board ended with status " + std::to_string(status);
        }
        line.print();
        child.stop(); // a board waits for the next run
        return reason;
    }
    return end(child, reason);
}

} // namespace

int main(int argc, char **argv)
{
    std::signal(SIGXFSZ, SIG_IGN); // a file that reaches the limit on sizes is an error of writing
    try {
        Settings o = parse(argc, argv);
        const MissionHost &mission = *o.mission;
        fill(o.delegate.simulation, "FLEDGE_SIMULATION", mission.name);
        fill(o.delegate.node, "FLEDGE_NODE", "flight");
        fill(o.delegate.address, "FLEDGE_ADDRESS", "tcp://127.0.0.1:7000");
        const std::span boards(mission.io->boards, mission.io->n_boards);
        const std::string reason = o.line.empty() ? fly_registers(o, boards) : fly_line(o, boards);
        if (!reason.empty()) {
            std::fprintf(stderr, "the run ended early: %s\n", reason.c_str());
            return 1;
        }
    } catch (const std::exception &error) {
        std::fprintf(stderr, "fledge_board_node: %s\n", error.what());
        return 1;
    }
    return 0;
}
