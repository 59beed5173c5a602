// SPDX-License-Identifier: Apache-2.0
// The controller as a program: fledge_controller --help.
#include "cosim/tools/exchange_record.h"
#include "cosim/tools/snapshots.h"
#include "cosim/tools/status.h"
#include "options/options.h"

#include <cmath>
#include <csignal>
#include <cstdio>

namespace {

using namespace fledge::cosim;
using fledge::Options;

volatile std::sig_atomic_t end_requested = 0;

constexpr double longest = 1e9; ///< [s]

struct Settings {
    ControllerConfig controller;
    RouterConfig router;
    std::vector<std::string> nodes, asynchronous;
    double until = 0, join = 60, greet = 30, reply = 60; ///< [s]
    int status = -1;
    std::string record, snapshots, past;
    double keep_every = 0; ///< [s]
};

std::vector<std::string> split(const std::string &text)
{
    std::vector<std::string> words;
    for (std::size_t begin = 0, end = 0; end != text.npos && !text.empty(); begin = end + 1) {
        end = text.find(',', begin);
        words.push_back(text.substr(begin, end - begin));
    }
    return words;
}

std::chrono::milliseconds milliseconds(double seconds)
{
    return std::chrono::milliseconds(std::llround(seconds * 1e3));
}

/// NAME[:POLICY][,joins=SECONDS][,joins=any][,rejoins][,save=SECONDS][,reply=SECONDS]
void add_node(const Options &options, Settings &o, const std::string &text)
{
    const std::string option = "--node " + text + ": ";
    NodeConfig node;
    auto reply = o.router.reply;
    auto words = split(text);
    const auto colon = words.at(0).find(':');
    node.name = words[0].substr(0, colon);
    if (colon != std::string::npos) {
        const auto policy = meant_by(policy_words, words[0].substr(colon + 1));
        if (!policy) {
            options.refuse(option + "a policy is abort, pause, hold, drop or restart");
        }
        node.on_loss = *policy;
    }
    for (auto word = words.begin() + 1; word != words.end(); ++word) {
        const auto equals = word->find('=');
        const std::string key = word->substr(0, equals);
        const auto time = [&] {
            const std::string value = equals == std::string::npos ? "" : word->substr(equals + 1);
            if (const std::string why = fledge::check_number(value, 0, longest); !why.empty()) {
                options.refuse(option + key + ": " + why);
            }
            return std::llround(std::stod(value) * 1e9);
        };
        if (*word == "joins=any") {
            node.joins = Join::when_it_comes;
        } else if (key == "joins") {
            node.joins = Join::at_time;
            node.joins_after = time();
        } else if (*word == "rejoins") {
            node.rejoins = true;
        } else if (key == "save") {
            node.save_every = time();
        } else if (key == "prefix") {
            node.names.prefix = equals == std::string::npos ? "" : word->substr(equals + 1);
        } else if (const auto arrow = word->find('>'); key == "topic" && arrow != std::string::npos) {
            node.names.topics[word->substr(equals + 1, arrow - equals - 1)] = word->substr(arrow + 1);
        } else if (key == "reply") {
            reply = std::chrono::milliseconds(time() / 1'000'000);
        } else {
            options.refuse(option +
                           "expected joins=SECONDS, joins=any, rejoins, save=SECONDS, reply=SECONDS, "
                           "prefix=NAME or topic=/ITS>/OF_THE_RUN, found " +
                           *word);
        }
    }
    o.controller.nodes.push_back(std::move(node));
    o.router.replies.push_back(reply);
}

/// NAME[,complete[=N]][,hears=TOPIC...][:TOPIC,TOPIC...]
void add_asynchronous(const Options &options, Settings &o, const std::string &text)
{
    const auto colon = text.find(':');
    const std::string topics = colon == std::string::npos ? "" : text.substr(colon + 1);
    const auto words = split(text.substr(0, colon));
    AsynchronousConfig program{words.empty() ? "" : words[0], split(topics)};
    if (program.name.empty()) {
        options.refuse("--asynchronous: a name is needed");
    }
    for (auto word = words.begin() + 1; word != words.end(); ++word) {
        const auto equals = word->find('=');
        const std::string key = word->substr(0, equals), value = equals == word->npos ? "1" : word->substr(equals + 1);
        if (key == "complete" && fledge::check_number(value, 1, 1000).empty()) {
            program.complete = static_cast<unsigned>(std::stod(value));
        } else if (key == "hears" && equals != word->npos) {
            program.hears.push_back(value);
        } else {
            options.refuse("--asynchronous " + program.name + ": expected complete=N or hears=TOPIC, found " + *word);
        }
    }
    o.controller.asynchronous.push_back(std::move(program));
}

/// Do what a line of the status stream asks of the pace.
void steer(Pace &pace, const std::string &line)
{
    const auto space = line.find(' ');
    const std::string word = line.substr(0, space), value = space == line.npos ? "" : line.substr(space + 1);
    const bool number = fledge::check_number(value, 0, longest).empty();
    if (word == "pause") {
        pace.pause();
    } else if (word == "go") {
        pace.pause_after(for_ever);
    } else if (word == "until" && number) {
        pace.pause_after(std::llround(std::stod(value) * 1e9));
    } else if (word == "pace" && number) {
        pace.set_speed(std::stod(value));
    }
}

Settings parse(int argc, char **argv)
{
    Settings o;
    o.router.address = "tcp://127.0.0.1:7000";
    Options options("fledge_controller", "Joins programs into one simulation, until it has reached its end.",
                    "example: fledge_controller --simulation nadir_spin --until 9600 --node world --node flight");
    const auto number = [&](const char *name, double &to, const char *help, const char *type = "SECONDS") {
        return options.number(name, to, 0, longest, type, help);
    };
    options.text("--simulation", o.controller.simulation, "NAME", "of the run").required();
    number("--until", o.until, "the end of the run").required();
    options
        .texts("--node", o.nodes, "NAME[:POLICY]",
               "a program that takes part; what to do when it is lost: abort (default),\n"
               "pause (until it is back), hold (its last messages), drop (no messages),\n"
               "restart (another program goes on from its snapshot).\n"
               "More options behind commas: joins=SECONDS (it takes part after that time;\n"
               "joins=any: when it comes), rejoins (it may come again), save=SECONDS (from\n"
               "one snapshot to the next), reply=SECONDS, prefix=NAME (its topics begin with\n"
               "/NAME in the run), topic=/ITS>/OF_THE_RUN (another name for one)")
        .required();
    options.text("--address", o.router.address, "ADDRESS",
                 "where programs greet: tcp://127.0.0.1:7000 (default), ipc://@NAME");
    options.texts("--asynchronous", o.asynchronous, "NAME[,complete][,hears=TOPIC][:TOPIC,TOPIC...]",
                  "a program that does not step (a ground system) and writes these topics, if nodes\n"
                  "read them; without topics, all that begin with /NAME/. complete: it misses no\n"
                  "message; the run waits until it is there, and whenever it does not keep up;\n"
                  "complete=N: it subscribes N times. One that takes nothing within --reply, and\n"
                  "one that is gone, is not waited for. hears=TOPIC: of that topic, and may be\n"
                  "repeated; of others it sees the newest message");
    options.texts("--watch", o.controller.watched, "TOPIC", "write this topic for observers, even if no node reads it");
    options.text("--frontend", o.router.frontend, "ADDRESS",
                 "where asynchronous programs publish; default: a free port");
    options.text("--backend", o.router.backend, "ADDRESS", "where observers subscribe; default: a free port");
    bool no_broker = false;
    options.flag("--no-broker", no_broker, "no observers and no asynchronous programs");
    options.text("--keys", o.router.keys, "DIR",
                 "encrypt, and let in only programs whose keys are allowed there (./fledge keys);\n"
                 "needed where other machines can reach the address. Default: FLEDGE_KEYS");
    options.flag("--unencrypted-beyond-machine", o.router.unencrypted_beyond_machine,
                 "no keys where other machines can reach the address: they read all, and\n"
                 "may take any part");
    options.flag("--any-user", o.router.any_user,
                 "over ipc://, let in programs of other users of this machine; they, too, have\n"
                 "to allow it, by FLEDGE_ANY_USER=1");
    options.whole("--seed", o.controller.seed, std::uint64_t{0}, ~std::uint64_t{0}, "N",
                  "of the run's random streams; default 0");
    number("--pace", o.router.pace, "simulated seconds per second; default 0: as fast as possible", "X");
    options.flag("--steered", o.router.steered,
                 "the pace may change and the run may pause, as lines on the socket of --status say");
    number("--join", o.join, "for all programs to be there; default 60");
    number("--greet", o.greet,
           "for a program that has greeted to answer the first request; then another one may\n"
           "take its place; default 30; for ever with --reply 0");
    number("--reply", o.reply,
           "for a program to answer, its computing included; 0: for ever, also while a\n"
           "debugger stops it; default 60");
    std::string sharing = "allowed";
    options
        .text("--shared-memory", sharing, "WHICH",
              "with programs on this machine: allowed (default), forbidden, required")
        .one_of({"allowed", "forbidden", "required"});
    options.text("--record", o.record, "FILE", "an archive of all that nodes write to one another (exchange_record.h)");
    options.text("--snapshots", o.snapshots, "DIR", "keep snapshots of all nodes there (snapshots.h)");
    number("--keep-every", o.keep_every, "simulated time between these snapshots; needed for --snapshots");
    options.text("--past", o.past, "FILE", "go on from there: snapshots and messages (snapshots.h)");
    options.whole("--status", o.status, 0, 1 << 30, "FD",
                  "a file descriptor for the state of the run, in lines of JSON (status.h)");
    options.parse(argc, argv);
    o.controller.end = std::llround(o.until * 1e9);
    o.controller.keep_every = std::llround(o.keep_every * 1e9);
    if (o.snapshots.empty() != (o.controller.keep_every == 0)) {
        options.refuse("--snapshots and --keep-every belong together");
    }
    if (!o.past.empty()) {
        o.controller.past = std::make_shared<Past>(read_past(o.past));
    }
    o.router.broker = !no_broker;
    o.router.sharing = *meant_by(sharing_words, sharing);
    o.router.join = milliseconds(o.join);
    o.router.greet = milliseconds(o.greet);
    o.router.reply = milliseconds(o.reply);
    for (const std::string &node : o.nodes) {
        add_node(options, o, node);
    }
    for (const std::string &program : o.asynchronous) {
        add_asynchronous(options, o, program);
    }
    o.router.keys = place_of_keys(o.router.keys);
    return o;
}

/// Where the time went, and what was late or lost.
void print_figures(Router &router, const Settings &o)
{
    for (NodeId id = 0; id < o.controller.nodes.size(); id++) {
        const NodeTimes times = router.times(id);
        std::printf("%-16s %10llu ticks %10.3f s computing %10.3f s on the way %10.3f s waiting\n",
                    o.controller.nodes[id].name.c_str(), static_cast<unsigned long long>(times.ticks),
                    static_cast<double>(times.compute) * 1e-9, static_cast<double>(times.transport) * 1e-9,
                    static_cast<double>(times.wait) * 1e-9);
    }
    if (const PaceReport *pace = router.pace(); pace && pace->overruns) {
        std::fprintf(stderr, "%llu instants were late, by up to %.1f ms\n",
                     static_cast<unsigned long long>(pace->overruns), static_cast<double>(pace->worst) * 1e-6);
    }
    if (const BrokerCounts counts = router.broker() ? router.broker()->counts() : BrokerCounts{};
        counts.dropped || counts.refused) {
        std::fprintf(stderr, "the broker dropped %llu of %llu messages, and refused %llu\n",
                     static_cast<unsigned long long>(counts.dropped), static_cast<unsigned long long>(counts.published),
                     static_cast<unsigned long long>(counts.refused));
    }
}

} // namespace

int main(int argc, char **argv)
{
    for (const int signal : {SIGINT, SIGTERM}) {
        std::signal(signal, [](int) { end_requested = 1; });
    }
    std::signal(SIGXFSZ, SIG_IGN); // a record that reaches the limit on file sizes is an error of writing
    try {
        Settings o = parse(argc, argv);
        if (const std::string text = warning(o.router); !text.empty() && o.router.unencrypted_beyond_machine) {
            std::fprintf(stderr, "%s\n", text.c_str());
        }
        StatusStream status(o.status);
        o.router.report = [&](const std::string &text) {
            std::fprintf(stderr, "%s\n", text.c_str());
            status.report(text);
        };
        ExchangeRecord record(o.record, o.controller);
        if (!o.record.empty()) {
            o.router.listeners.push_back(&record);
        }
        std::optional<SnapshotFolder> snapshots; // after the record, which then has all messages up to a snapshot
        if (!o.snapshots.empty()) {
            o.router.listeners.push_back(&snapshots.emplace(o.snapshots));
        }
        zmq::context_t context;
        Router router(context, o.controller, o.router);
        o.controller.past.reset(); // it may be large
        std::printf("listening at %s\n", router.address().c_str());
        std::fflush(stdout);
        status.listening(router.address());
        std::string stop_reason;
        std::string reason = router.run([&] {
            status.progress(router, o.controller);
            for (std::string line; stop_reason.empty() && !(line = status.read_line()).empty();) {
                if (line.starts_with("stop ")) {
                    stop_reason = line.substr(5);
                } else if (line.starts_with("without ")) {
                    router.go_without(line.substr(8));
                } else if (Pace *pace = router.steer()) {
                    steer(*pace, line);
                }
            }
            return !end_requested && stop_reason.empty();
        });
        if (!stop_reason.empty() && !reason.empty()) {
            reason = stop_reason;
        }
        status.ended(reason, router, o.controller);
        print_figures(router, o);
        if (!reason.empty()) {
            std::fprintf(stderr, "the run ended early: %s\n", reason.c_str());
            return 1;
        }
    } catch (const std::exception &error) {
        std::fprintf(stderr, "fledge_controller: %s\n", error.what());
        return 1;
    }
    return 0;
}
