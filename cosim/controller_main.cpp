// SPDX-License-Identifier: Apache-2.0
// The controller as a program: fledge_controller --help.
#include "cosim/exchange_record.h"
#include "cosim/status.h"

#include <charconv>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <string_view>

namespace {

using namespace fledge::cosim;

constexpr const char *usage =
    "usage: fledge_controller --simulation NAME --until SECONDS --node NAME[:POLICY] ... [options]\n"
    "\n"
    "Joins programs into one simulation, until it has reached its end.\n"
    "\n"
    "  --node NAME[:POLICY]  a program that takes part; what to do when it is lost: abort (default),\n"
    "                        pause (until it is back), hold (its last messages), drop (no messages)\n"
    "  --address ADDRESS     where programs greet: tcp://127.0.0.1:7000 (default), ipc://@NAME\n"
    "  --keys DIR            encrypt, and let in only whose keys are allowed there (./fledge keys);\n"
    "                        needed where others can reach the address. Default: FLEDGE_KEYS\n"
    "  --unencrypted-beyond-machine\n"
    "                        do without keys where others can reach the address: they read all, and\n"
    "                        may take any part\n"
    "  --seed N              of the run's random streams; default 0\n"
    "  --join SECONDS        for all programs to be there; default 60\n"
    "  --reply SECONDS       for a program to answer, its computing included; 0: for ever; default 60\n"
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

template <class T> T number(std::string_view option, std::string_view text, T least)
{
    T x{};
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), x);
    if (error != std::errc() || end != text.data() + text.size() || !(x >= least) || !(x <= T(1e9))) {
        refuse(std::string(option) + ": expected a number from " + std::to_string(static_cast<int>(least)) +
               " to 1e9, found " + std::string(text));
    }
    return x;
}

std::chrono::milliseconds milliseconds(double s)
{
    return std::chrono::milliseconds(std::llround(s * 1e3));
}

NodeConfig node(std::string_view text)
{
    constexpr std::pair<std::string_view, Policy> policies[] = {
        {"abort", Policy::abort}, {"pause", Policy::pause}, {"hold", Policy::hold}, {"drop", Policy::drop}};
    const auto colon = text.find(':');
    if (colon == text.npos) {
        return {std::string(text), Policy::abort};
    }
    for (const auto &[name, policy] : policies) {
        if (name == text.substr(colon + 1)) {
            return {std::string(text.substr(0, colon)), policy};
        }
    }
    refuse("--node " + std::string(text) + ": a policy is abort, pause, hold or drop");
}

Options options(int argc, char **argv)
{
    Options o;
    o.router.address = "tcp://127.0.0.1:7000";
    bool until = false;
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
            o.controller.nodes.push_back(node(value()));
        } else if (option == "--address") {
            o.router.address = value();
        } else if (option == "--keys") {
            o.router.keys = value();
        } else if (option == "--unencrypted-beyond-machine") {
            o.router.unencrypted_beyond_machine = true;
        } else if (option == "--seed") {
            o.controller.seed = number<std::uint64_t>(option, value(), 0);
        } else if (option == "--join") {
            o.router.join = milliseconds(number(option, value(), 0.0));
        } else if (option == "--reply") {
            o.router.reply = milliseconds(number(option, value(), 0.0));
        } else if (option == "--record") {
            o.record = value();
        } else if (option == "--status") {
            o.status = number<int>(option, value(), 0);
        } else {
            refuse("there is no option " + std::string(option));
        }
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
