// SPDX-License-Identifier: Apache-2.0
// The controller as a program: fledge_controller --help.
#include "cosim/controller/words.h"
#include "cosim/tools/exchange_record.h"
#include "cosim/tools/status.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <iterator>
#include <string_view>
#include <vector>

namespace {

using namespace fledge::cosim;

constexpr const char *usage =
    "usage: fledge_controller --simulation NAME --until SECONDS --node NAME[:POLICY] ... [options]\n"
    "\n"
    "Joins programs into one simulation, until it has reached its end.\n"
    "\n"
    "  --node NAME[:POLICY]  a program that takes part; what to do when it is lost: abort (default),\n"
    "                        pause (until it is back), hold (its last messages), drop (no messages),\n"
    "                        restart (another goes on from its snapshot, and nobody sees it).\n"
    "                        More of it behind commas: joins=SECONDS (it takes part after that time;\n"
    "                        joins=any: when it comes), rejoins (it may come again), save=SECONDS (from\n"
    "                        one snapshot to the next), reply=SECONDS\n"
    "  --address ADDRESS     where programs greet: tcp://127.0.0.1:7000 (default), ipc://@NAME\n"
    "  --asynchronous NAME[:TOPIC,TOPIC...]\n"
    "                        a program that steps with nobody (a ground system) and writes these, if nodes\n"
    "                        want them; without topics, all that begin with /NAME/\n"
    "  --watch TOPIC         have it written, for those who watch, even if no node wants it\n"
    "  --frontend ADDRESS    where asynchronous programs publish, and\n"
    "  --backend ADDRESS     where they and those who watch subscribe; default: free ports beside ADDRESS,\n"
    "                        of which they are told when they greet there\n"
    "  --no-broker           neither: nobody watches\n"
    "  --keys DIR            encrypt, and let in only whose keys are allowed there (./fledge keys);\n"
    "                        needed where others can reach the address. Default: FLEDGE_KEYS\n"
    "  --unencrypted-beyond-machine\n"
    "                        do without keys where others can reach the address: they read all, and\n"
    "                        may take any part\n"
    "  --seed N              of the run's random streams; default 0\n"
    "  --pace X              X simulated seconds per second; default 0: as fast as possible\n"
    "  --join SECONDS        for all programs to be there; default 60\n"
    "  --reply SECONDS       for a program to answer, its computing included; 0: for ever; default 60\n"
    "  --shared-memory WHICH with programs on this machine: allowed (default), forbidden, required\n"
    "  --record FILE         an archive of all that nodes write to one another (exchange_record.h)\n"
    "  --status FD           a file descriptor that is told how it goes, in lines of JSON (status.h)\n"
    "\n"
    "example: fledge_controller --simulation nadir_spin --until 9600 --node world --node flight\n"
    "\n"
    "Exits with 0 at the regular end, 1 at another, 2 on a mistake in the options.\n";

volatile std::sig_atomic_t asked_to_end = 0;

struct Options {
    ControllerConfig controller;
    RouterConfig router;
    int status = -1;
    std::string record;
};

[[noreturn]] void refuse(const std::string &why)
{
    std::fprintf(stderr, "fledge_controller: %s; see --help\n", why.c_str());
    std::exit(2);
}

template <class T> T number(std::string_view option, std::string_view text, T least, T most = T(1e9))
{
    T x{};
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), x);
    if (error != std::errc() || end != text.data() + text.size() || !(x >= least) || !(x <= most)) {
        char limits[64];
        std::snprintf(limits, sizeof limits, "from %.10g to %.10g", static_cast<double>(least),
                      static_cast<double>(most));
        refuse(std::string(option) + ": expected a number " + limits + ", found " + std::string(text));
    }
    return x;
}

std::chrono::milliseconds milliseconds(double s)
{
    return std::chrono::milliseconds(std::llround(s * 1e3));
}

Sharing sharing(std::string_view text)
{
    if (const auto meant = meant_by(sharing_words, text)) {
        return *meant;
    }
    refuse("--shared-memory: expected allowed, forbidden or required, found " + std::string(text));
}

/// NAME[:POLICY][,joins=SECONDS][,joins=any][,rejoins][,save=SECONDS][,reply=SECONDS]
void add_node(Options &o, std::string_view text)
{
    const std::string whole = "--node " + std::string(text);
    NodeConfig node;
    auto reply = o.router.reply;
    const auto next = [&] {
        const auto end = std::min(text.find(','), text.size());
        const std::string_view word = text.substr(0, end);
        text.remove_prefix(std::min(end + 1, text.size()));
        return word;
    };
    const std::string_view first = next();
    const auto colon = std::min(first.find(':'), first.size());
    node.name = first.substr(0, colon);
    if (colon < first.size()) {
        const auto policy = meant_by(policy_words, first.substr(colon + 1));
        if (!policy) {
            refuse(whole + ": a policy is abort, pause, hold, drop or restart");
        }
        node.on_loss = *policy;
    }
    while (!text.empty()) {
        const std::string_view word = next();
        const auto equals = std::min(word.find('='), word.size());
        const std::string_view key = word.substr(0, equals), value = word.substr(std::min(equals + 1, word.size()));
        const auto time = [&] { return std::llround(number(whole + ": " + std::string(key), value, 0.0) * 1e9); };
        if (word == "joins=any") {
            node.joins = Join::when_it_comes;
        } else if (key == "joins") {
            node.joins = Join::at_time;
            node.joins_after = time();
        } else if (word == "rejoins") {
            node.rejoins = true;
        } else if (key == "save") {
            node.save_every = time();
        } else if (key == "reply") {
            reply = std::chrono::milliseconds(time() / 1'000'000);
        } else {
            refuse(whole + ": expected joins=SECONDS, joins=any, rejoins, save=SECONDS or reply=SECONDS, found " +
                   std::string(word));
        }
    }
    o.controller.nodes.push_back(std::move(node));
    o.router.replies.push_back(reply);
}

/// NAME[:TOPIC,TOPIC...]
AsynchronousConfig asynchronous(std::string_view text)
{
    const auto colon = std::min(text.find(':'), text.size());
    AsynchronousConfig program{std::string(text.substr(0, colon)), {}};
    for (text.remove_prefix(std::min(colon + 1, text.size())); !text.empty();) {
        const auto end = std::min(text.find(','), text.size());
        program.topics.emplace_back(text.substr(0, end));
        text.remove_prefix(std::min(end + 1, text.size()));
    }
    if (program.name.empty()) {
        refuse("--asynchronous needs a name");
    }
    return program;
}

Options options(int argc, char **argv)
{
    Options o;
    o.router.broker = true;
    o.router.address = "tcp://127.0.0.1:7000";
    bool until = false;
    std::vector<std::string_view> nodes;
    for (int i = 1; i < argc; i++) {
        const std::string_view option = argv[i];
        const auto value = [&]() -> std::string_view {
            if (i + 1 == argc) {
                refuse(std::string(option) + " needs a value");
            }
            return argv[++i];
        };
        if (option == "--help") {
            std::fputs(usage, stdout);
            std::exit(0);
        } else if (option == "--simulation") {
            o.controller.simulation = value();
        } else if (option == "--until") {
            o.controller.end = std::llround(number(option, value(), 0.0) * 1e9);
            until = true;
        } else if (option == "--node") {
            nodes.push_back(value());
        } else if (option == "--address") {
            o.router.address = value();
        } else if (option == "--asynchronous") {
            o.controller.asynchronous.push_back(asynchronous(value()));
        } else if (option == "--watch") {
            o.controller.watched.emplace_back(value());
        } else if (option == "--frontend") {
            o.router.frontend = value();
        } else if (option == "--backend") {
            o.router.backend = value();
        } else if (option == "--no-broker") {
            o.router.broker = false;
        } else if (option == "--keys") {
            o.router.keys = value();
        } else if (option == "--unencrypted-beyond-machine") {
            o.router.unencrypted_beyond_machine = true;
        } else if (option == "--seed") {
            o.controller.seed = number<std::uint64_t>(option, value(), 0, ~std::uint64_t{0});
        } else if (option == "--pace") {
            o.router.pace = number(option, value(), 0.0);
        } else if (option == "--join") {
            o.router.join = milliseconds(number(option, value(), 0.0));
        } else if (option == "--reply") {
            o.router.reply = milliseconds(number(option, value(), 0.0));
        } else if (option == "--shared-memory") {
            o.router.sharing = sharing(value());
        } else if (option == "--record") {
            o.record = value();
        } else if (option == "--status") {
            o.status = number<int>(option, value(), 0);
        } else {
            refuse("there is no option " + std::string(option));
        }
    }
    for (const std::string_view text : nodes) { // last, for what holds for all may come after
        add_node(o, text);
    }
    if (o.controller.simulation.empty() || o.controller.nodes.empty() || !until) {
        refuse("--simulation, --until and at least one --node are needed");
    }
    o.router.keys = place_of_keys(o.router.keys);
    return o;
}

} // namespace

int main(int argc, char **argv)
{
    Options o = options(argc, argv);
    for (const int signal : {SIGINT, SIGTERM}) {
        std::signal(signal, [](int) { asked_to_end = 1; });
    }
    try {
        StatusStream status(o.status);
        o.router.report = [&](const std::string &text) {
            std::fprintf(stderr, "%s\n", text.c_str());
            status.report(text);
        };
        ExchangeRecord record(o.record, o.controller);
        if (!o.record.empty()) {
            o.router.witnesses.push_back(&record);
        }
        zmq::context_t context;
        Router router(context, o.controller, o.router);
        std::printf("listening at %s\n", router.address().c_str());
        std::fflush(stdout);
        status.listening(router.address());
        std::string asked;
        std::string reason = router.run([&] {
            status.progress(router, o.controller);
            asked = status.asked_to_stop();
            return !asked_to_end && asked.empty();
        });
        if (!asked.empty() && !reason.empty()) {
            reason = asked;
        }
        status.ended(reason, router, o.controller);
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
                         static_cast<unsigned long long>(counts.dropped),
                         static_cast<unsigned long long>(counts.published),
                         static_cast<unsigned long long>(counts.refused));
        }
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
