// SPDX-License-Identifier: Apache-2.0
// A LEON3 board as a program: fledge_leon3 --help.
#include "emulator/board.h"
#include "emulator/debug/tools.h"
#include "emulator/devices/apbuart.h"
#include "emulator/devices/register_space.h"
#include "emulator/devices/spacewire.h"
#include "emulator/devices/test_report.h"
#include "emulator/elf.h"
#include "emulator/mission/link.h"
#include "emulator/report.h"
#include "options/options.h"
#include "record/file_sink.h"
#include "registers/shared_file.h"
#include "registers/snapshot_link.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <memory>
#include <optional>
#include <poll.h>
#include <sys/socket.h>
#include <thread>
#include <unistd.h>

namespace {

using namespace fledge;
using namespace fledge::emulator;

constexpr Ns second = 1'000'000'000;

struct Settings {
    std::string board, program, tables, registers, engine = "translator", timing, console, record, input;
    std::string gdb, trace, coverage, profile;
    double snapshots = -1, duration = 0, wait = 10;
    std::pair<double, double> traced = {0, 9e9};
    bool figures = false, stacks = false;
};

volatile std::sig_atomic_t stopped = 0;

Settings parse(int argc, char **argv)
{
    Settings o;
    Options options(
        "fledge_leon3", "Runs a program on a LEON3 board in software.",
        "With --tables and --registers the clock of the register file paces the program, which is an exported\n"
        "mission; without them the program runs until it ends (`ta 0` with traps disabled; its status is then the\n"
        "exit code) or --for has passed.\n\n"
        "example: fledge_leon3 leon3.toml nadir_spin --tables nadir_spin.so --registers {registers} --record r.mcap");
    const auto text = [&](const char *name, std::string &to, const char *help, const char *type = "") {
        return options.text(name, to, type, help);
    };
    text("BOARD", o.board, "the file of the board").required();
    text("PROGRAM", o.program, "an ELF file for SPARC V8, S-records, or a PROM's bytes, *.bin").required();
    text("--registers", o.registers, "the register file, or /dev/fd/N; needs --tables");
    text("--tables", o.tables, "the mission and its boards: a shared object, as ./fledge fly builds it")
        .needs("--registers");
    text("--engine", o.engine, "interpreter, threaded or translator; all give the same results")
        .one_of({"interpreter", "threaded", "translator"});
    text("--timing", o.timing, "plain or leon3: another one than the board's file says").one_of({"plain", "leon3"});
    text("--console", o.console, "a file for what the first UART sends; else the standard output");
    text("--record", o.record, "a file for what the SpaceWire link and the last UART send");
    options
        .number("--snapshots", o.snapshots, 0, 1 << 20, "FD",
                "a socket by which the program that has made the register file asks for snapshots, and gives the one\n"
                "from which to go on (registers/snapshot_link.h)")
        .needs("--registers");
    text("--input", o.input,
         "for the first UART: - is the standard input; at a port a client, who gets the output, too",
         "-|[ADDRESS:]PORT");
    options.number("--for", o.duration, 0, 1e9, "SECONDS", "end after so many seconds of the board's time");
    options.number("--wait", o.wait, 0, 1e6, "SECONDS", "for the register file to be there; default: 10");
    text("--gdb", o.gdb, "wait there for gdb-multiarch; the board stands until gdb lets it run", "[ADDRESS:]PORT");
    text("--trace", o.trace, "a file for each instruction, in words");
    options.numbers("--traced", o.traced, "SECONDS SECONDS", "trace between these times of the board").needs("--trace");
    text("--coverage", o.coverage, "a file for the lines and branches that ran, for genhtml");
    text("--profile", o.profile, "a file for the cost of each function, for callgrind_annotate");
    options.flag("--stacks", o.stacks, "print how deep each stack was used");
    options.flag("--figures", o.figures, "print figures at the end also without --tables");
    options.parse(argc, argv);
    if (o.tables.empty() != o.registers.empty()) {
        options.refuse("--registers needs --tables");
    }
    if (!o.input.empty() && !o.tables.empty()) {
        options.refuse("--input is for programs without --tables");
    }
    return o;
}

/// A file that gets its name only if all went well; until then it is FILE.part.
class Output {
public:
    explicit Output(std::string path) : path_(std::move(path)) {}
    ~Output()
    {
        if (open_) {
            write();
            file_sink_close(&sink_, false);
        }
    }
    Output(const Output &) = delete;
    Output &operator=(const Output &) = delete;

    /// Begin the file, unless it has begun.
    void begin()
    {
        if (!open_) {
            check(file_sink_open(&sink_, path_.c_str()));
            open_ = true;
        }
    }
    /// Go on with the file of a program that ended.
    void resume(const FileMark &mark)
    {
        const int error = file_sink_resume(&sink_, path_.c_str(), mark);
        if (error == ENODATA) {
            throw Error(path_ + ".part is not what was recorded until the snapshot; if it is not there at all, flight "
                                "flies from the start");
        }
        check(error);
        open_ = true;
    }
    FileMark mark()
    {
        FileMark mark;
        begin();
        write();
        check(file_sink_mark(&sink_, &mark));
        return mark;
    }
    void put(std::span<const std::uint8_t> bytes)
    {
        bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
        if (bytes_.size() >= std::size_t{1} << 16) {
            write();
        }
    }
    void close()
    {
        begin();
        write();
        open_ = false;
        check(file_sink_close(&sink_, true));
    }

private:
    void write()
    {
        file_sink_write(&sink_, bytes_.data(), bytes_.size()); // keeps its first error
        bytes_.clear();
    }
    void check(int error) const
    {
        if (error != 0) {
            throw Error(path_ + ": " + std::strerror(error));
        }
    }
    std::string path_;
    FileSink sink_;
    bool open_ = false;
    std::vector<std::uint8_t> bytes_;
};

/// What the first UART receives from a terminal, a pipe, or a client of a port.
class Input {
public:
    Input(const std::string &from, Apbuart &uart) : uart_(uart)
    {
        if (from == "-") {
            from_ = 0;
        } else {
            std::uint16_t port = 0;
            listener_ = listen_at(from, "--input", port);
            std::fprintf(stderr, "fledge_leon3: the first UART waits at port %u\n", port);
        }
    }
    ~Input()
    {
        leave();
        close(listener_);
    }
    Input(const Input &) = delete;
    Input &operator=(const Input &) = delete;

    bool may_come() const { return from_ >= 0 || listener_ >= 0; }

    void send(std::uint8_t byte)
    {
        if (listener_ >= 0 && from_ >= 0 && ::send(from_, &byte, 1, MSG_NOSIGNAL) != 1) {
            leave();
        }
    }

    /// Wait until the clock of the host has reached a time of the board, and pass on what comes until then.
    void wait(Ns until)
    {
        for (;;) {
            const Ns left = until - (std::chrono::steady_clock::now() - begun_).count();
            const int timeout = static_cast<int>(std::clamp<Ns>(left / 1'000'000, 0, 1000));
            const std::size_t room = uart_.room();
            pollfd from{from_ < 0 ? listener_ : room > 0 ? from_ : -1, POLLIN, 0};
            if (poll(&from, 1, timeout) > 0) {
                take(room);
            } else if (left < 1'000'000 || stopped) {
                return;
            }
        }
    }

private:
    void take(std::size_t room)
    {
        if (from_ < 0) {
            from_ = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
            return;
        }
        std::array<std::uint8_t, 1024> bytes;
        const ssize_t n = read(from_, bytes.data(), std::min(room, bytes.size()));
        if (n > 0) {
            uart_.receive({bytes.data(), static_cast<std::size_t>(n)});
        } else {
            leave();
        }
    }
    /// The input has ended; a port waits for the next client.
    void leave()
    {
        if (listener_ >= 0 && from_ >= 0) {
            close(from_);
        }
        from_ = -1;
    }

    Apbuart &uart_;
    int listener_ = -1, from_ = -1;
    std::chrono::steady_clock::time_point begun_ = std::chrono::steady_clock::now();
};

/// The register file; it must stay where it is.
struct File {
    File(const Settings &o, const MissionIo &io) : windows(io.n_boards)
    {
        using clock = std::chrono::steady_clock;
        const auto end =
            clock::now() + std::chrono::duration_cast<clock::duration>(std::chrono::duration<double>(o.wait));
        RegisterFileStatus status;
        while ((status = register_file_attach(&file, o.registers.c_str(), io.boards, io.n_boards, windows.data())) ==
                   REGISTER_FILE_NOT_YET &&
               !stopped && clock::now() < end) {
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
        if (status != REGISTER_FILE_OK) {
            throw Error(
                "--registers " + o.registers + ": " +
                (status == REGISTER_FILE_FAILED ? std::strerror(file.error) : register_file_status_text(status)));
        }
    }
    ~File() { register_file_close(&file); }
    File(const File &) = delete;
    File &operator=(const File &) = delete;

    RegisterFile file;
    std::vector<RegisterWindow> windows;
};

/// Fly tick by tick. `snapshots` looks for requests between ticks. Returns what went wrong, "" if nothing did.
std::string fly(File &file, FlightLoop &loop, const RegisterWindow &clock, Output *record,
                const std::function<void()> &snapshots)
{
    constexpr Ns poll = second / 4;
    while (!stopped) {
        Tick tick;
        snapshots();
        if (register_clock_due(&clock, &tick)) {
            if (record) {
                record->begin();
            }
            if (!loop.exchange()) {
                return "the program has failed";
            }
        } else if (register_clock_stopped(&clock)) {
            return loop.finish() ? "" : "the program did not end with the run";
        } else if (register_file_wait(&file.file, poll) == REGISTER_FILE_GONE && !register_clock_stopped(&clock)) {
            return "the outside has disappeared before it ended the run";
        }
    }
    return "a signal stopped the run";
}

/// A snapshot: the mark of the record, and what flies.
std::vector<std::byte> save(FlightLoop &loop, Output *record)
{
    const FileMark mark = record ? record->mark() : FileMark{};
    std::vector<std::byte> bytes = loop.save();
    const auto *at = reinterpret_cast<const std::byte *>(&mark);
    bytes.insert(bytes.begin(), at, at + sizeof mark);
    return bytes;
}

void restore(FlightLoop &loop, Output *record, std::span<const std::byte> bytes)
{
    FileMark mark;
    if (bytes.size() < sizeof mark) {
        throw Error("the snapshot is truncated");
    }
    std::memcpy(&mark, bytes.data(), sizeof mark);
    loop.restore(bytes.subspan(sizeof mark));
    if (record) {
        record->resume(mark);
    }
}

void print_figures(Machine &machine, const FlightLoop *loop)
{
    const auto ns = [&](double cycles) { return cycles * 1e9 / machine.board().clock; };
    if (loop) {
        const FlightLoop::State &s = loop->state;
        std::printf("ticks %llu\ncpu_ns %.0f\ncpu_ns_most %.0f\nmissed %llu\n",
                    static_cast<unsigned long long>(s.ticks),
                    s.ticks > 0 ? ns(static_cast<double>(s.cycles)) / static_cast<double>(s.ticks) : 0.0,
                    ns(static_cast<double>(s.cycles_most)), static_cast<unsigned long long>(s.missed));
    }
    std::printf("instructions %llu\ncycles %llu\nresets %llu\nwatchdog %llu\n",
                static_cast<unsigned long long>(machine.instructions()),
                static_cast<unsigned long long>(machine.core().state.cycles),
                static_cast<unsigned long long>(machine.resets()),
                static_cast<unsigned long long>(machine.watchdog_resets()));
}

/// Begin what the options ask for.
void observe(Tools &tools, const Settings &o)
{
    const auto ns = [](double s) { return static_cast<Ns>(s * 1e9); };
    if (!o.trace.empty()) {
        tools.trace(o.trace, ns(o.traced.first), ns(o.traced.second));
    }
    if (!o.coverage.empty()) {
        tools.coverage(o.coverage);
    }
    if (!o.profile.empty()) {
        tools.profile(o.profile);
    }
    if (o.stacks) {
        tools.stacks();
    }
    if (!o.gdb.empty()) {
        std::fprintf(stderr, "fledge_leon3: waiting for gdb; in gdb-multiarch: target remote :%u\n",
                     tools.serve_gdb(o.gdb));
        while (!stopped && !tools.gdb()->wait(200)) {
        }
    }
}

/// Run a program that is no mission. Returns the exit code.
int run_alone(Machine &machine, Tools &tools, const Program &program, const Settings &o, Input *input)
{
    constexpr Ns look = second / 100; // how often for input
    const Ns end = o.duration > 0 ? static_cast<Ns>(o.duration * 1e9) : std::numeric_limits<Ns>::max();
    constexpr Ns hour = 3600 * second;
    StopReason reason = StopReason::time;
    std::uint64_t instructions = 0;
    Ns awake = 0; // when it last executed an instruction
    while (!stopped && reason == StopReason::time && machine.now() < end) {
        const bool interactive = input && input->may_come();
        if (interactive) {
            input->wait(machine.now());
        }
        reason = tools.run_until(std::min(end, machine.now() + (interactive ? look : second)));
        awake = std::exchange(instructions, machine.instructions()) != instructions ? machine.now() : awake;
        if (machine.now() - awake >= hour) {
            std::fflush(stdout);
            std::fprintf(stderr, "fledge_leon3: for an hour no interrupt has come: %s",
                         machine.report(&program).c_str());
            return 1;
        }
    }
    int status = 0;
    std::string why;
    if (reason == StopReason::error && !program_ended(machine, &program, status, why)) {
        std::fflush(stdout);
        std::fprintf(stderr, "fledge_leon3: %s%s%s", why.c_str(), why.empty() ? "" : "\n",
                     machine.report(&program).c_str());
        return 1;
    }
    return status;
}

/// What the serial lines and the SpaceWire link send, and the first UART receives.
struct Lines {
    Lines(Machine &machine, const Settings &o)
    {
        Apbuart *first = machine.device_of<Apbuart>(), *last = first;
        for (std::size_t n = 1; Apbuart *other = machine.device_of<Apbuart>(n); n++) {
            last = other;
        }
        if (!o.console.empty()) {
            console = std::make_unique<Output>(o.console);
            console->begin();
        }
        if (!o.record.empty()) {
            SpaceWire *spacewire = machine.device_of<SpaceWire>();
            if (!spacewire && last == first) {
                throw Error(o.board + ": --record needs a device of the kind `grspw2`, or a second one of `apbuart`");
            }
            record = std::make_unique<Output>(o.record);
            if (o.snapshots < 0) {
                record->begin(); // else once it is known whether this program goes on from a snapshot
            }
            if (spacewire) {
                spacewire->transmit = [this](std::span<const std::uint8_t> packet) { record->put(packet); };
            }
            if (last) {
                last->transmit = [this](std::uint8_t byte) { record->put({&byte, 1}); };
            }
        }
        if (first) {
            first->transmit = [this](std::uint8_t byte) {
                console ? console->put({&byte, 1}) : void(std::putchar(byte));
                if (input) {
                    input->send(byte);
                    std::fflush(stdout);
                }
            };
        }
        if (auto *port = machine.device_of<TestReport>()) {
            port->say = [](const std::string &line) { std::fputs(line.c_str(), stdout); };
        }
        if (!o.input.empty()) {
            if (!first) {
                throw Error(o.board + ": --input needs a device of the kind `apbuart`");
            }
            input.emplace(o.input, *first);
        }
    }
    Lines(const Lines &) = delete;
    Lines &operator=(const Lines &) = delete;

    void close(bool good)
    {
        if (console) {
            console->close();
        }
        if (record && good) {
            record->close();
        }
    }

    std::unique_ptr<Output> console, record;
    std::optional<Input> input;
};

/// Run a mission's flight, with the register file. Returns the exit code.
int run_flight(Machine &machine, Tools &tools, const Program &program, const Settings &o, Output *record)
{
    const std::shared_ptr<const MissionHost> mission = load_mission(o.tables);
    File file(o, *mission->io);
    RegisterSpace *space = machine.device_of<RegisterSpace>();
    if (!space) {
        throw Error(o.board + ": --registers needs a device of the kind `registers`");
    }
    space->attach(file.windows);
    FlightLoop loop(machine);
    loop.next = [&](Ns t) { return next_instant(*mission, t); };
    loop.run = [&](Ns t) { return tools.run_until(t); };
    loop.on_tick = [&] { tools.begin(); };
    machine.on_error = [&] {
        std::fflush(stdout);
        std::fprintf(stderr, "fledge_leon3: %s", machine.report(&program).c_str());
    };
    std::uint64_t by_watchdog = 0;
    machine.on_reset = [&] {
        const bool watchdog = std::exchange(by_watchdog, machine.watchdog_resets()) != machine.watchdog_resets();
        std::fprintf(stderr, "fledge_leon3: %s has reset the board, %.3f s after it was switched on\n",
                     watchdog ? "the watchdog" : "the outside", static_cast<double>(machine.now()) * 1e-9);
    };
    std::optional<registers::SnapshotLink> link;
    if (o.snapshots >= 0) {
        link.emplace(static_cast<int>(o.snapshots));
    }
    const auto snapshots = [&] {
        if (link) {
            link->answer([&] { return save(loop, record); },
                         [&](std::span<const std::byte> snapshot) {
                             restore(loop, record, snapshot);
                             by_watchdog = machine.watchdog_resets();
                         });
        }
    };
    const std::string wrong = fly(file, loop, *space->clock(), record, snapshots);
    print_figures(machine, &loop);
    if (!wrong.empty()) {
        std::fflush(stdout);
        std::fprintf(stderr, "fledge_leon3: %s\n", wrong.c_str());
        return 1;
    }
    return 0;
}

int run(const Settings &o)
{
    BoardDescription board = BoardDescription::read(o.board);
    if (!o.timing.empty()) {
        board.leon3_timing = o.timing == "leon3";
    }
    const Program program = Program::read(o.program);
    Machine machine(board, o.engine == "interpreter" ? EngineKind::interpreter
                           : o.engine == "threaded"  ? EngineKind::threaded
                                                     : EngineKind::translator);
    machine.load(program);
    Lines lines(machine, o);
    Tools tools(machine, program);
    observe(tools, o);
    int result = 0;
    if (o.tables.empty()) {
        result = run_alone(machine, tools, program, o, lines.input ? &*lines.input : nullptr);
        if (o.figures) {
            print_figures(machine, nullptr);
        }
    } else {
        result = run_flight(machine, tools, program, o, lines.record.get());
    }
    tools.finish();
    for (const StackDepth::Stack &stack : tools.depths()) {
        std::printf("stack_%s %u\n", stack.name.c_str(), stack.used());
    }
    lines.close(result == 0);
    return result;
}

} // namespace

int main(int argc, char **argv)
{
    std::signal(SIGINT, [](int) { stopped = 1; });
    std::signal(SIGTERM, [](int) { stopped = 1; });
    std::signal(SIGXFSZ, SIG_IGN); // a file that reaches the limit on sizes is an error of writing
    try {
        return run(parse(argc, argv));
    } catch (const std::exception &error) {
        std::fflush(stdout);
        std::fprintf(stderr, "fledge_leon3: %s\n", error.what());
        return 1;
    }
}
