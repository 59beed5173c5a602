// SPDX-License-Identifier: Apache-2.0
// The extension `_cosim`: a process as a node, and the controller. Both work without Python's lock: only a world's own
// Python events are in the loop. The simulations are objects of `_core`, which also translates the exceptions.
#include "core/extension.h"

#include "cosim/node/simulation_node.h"
#include "cosim/protocol/words.h"
#include "cosim/tools/replay.h"

#include <pybind11/functional.h>
#include <pybind11/stl.h>

#include <atomic>
#include <future>
#include <random>
#include <thread>

namespace py = pybind11;
using namespace py::literals;

namespace fledge::core {

namespace {

using sim::Ns;

/// The enumerator of this name; `what` begins the message if there is none.
template <class Words> auto choice(const Words &words, const std::string &word, const char *what)
{
    const auto meant = cosim::meant_by(words, word);
    if (!meant) {
        throw py::value_error(what + word);
    }
    return *meant;
}

std::chrono::milliseconds milliseconds(double s)
{
    return std::chrono::milliseconds(std::llround(s * 1e3));
}

/// A SimulationNode with a callback at the start of the run, and random delays for tests.
class ProcessNode final : public cosim::SimulationNode {
public:
    ProcessNode(sim::Simulation &simulation, const std::string &process)
        : SimulationNode(simulation, process), simulation_(simulation), process_(process)
    {
    }

    void read_by_path(const std::string &topic, const std::string &port, const std::string &latency, Ns stale_after)
    {
        const auto first = port.find('.'), last = port.rfind('.');
        const auto instance = simulation_.process(process_).find(port.substr(first + 1, last - first - 1));
        if (port.substr(0, first) != process_ || !instance) {
            throw sim::SetupError(port + " is no input of the process " + process_);
        }
        read(topic, {instance, sim::find_field(instance->type(), port.substr(last + 1))},
             choice(cosim::latency_words, latency, "unknown latency "), stale_after);
    }

    void start(const std::vector<cosim::Channel> &wired) override
    {
        SimulationNode::start(wired);
        if (auto begin = std::exchange(on_start, nullptr)) {
            begin();
        }
    }

    cosim::Tock tick(const cosim::Tick &tick) override
    {
        if (interrupted) {
            throw sim::RunError("it was interrupted");
        }
        if (delay > 0.0) {
            std::this_thread::sleep_for(
                std::chrono::duration<double>(std::uniform_real_distribution<>(0.0, delay)(random_)));
        }
        return SimulationNode::tick(tick);
    }

    std::function<void()> on_start;
    double delay = 0.0; ///< [s] the longest
    std::atomic<bool> interrupted = false;

private:
    sim::Simulation &simulation_;
    std::string process_;
    std::mt19937 random_{std::random_device{}()};
};

/// Take part in a run. The delegate has a thread of its own, while this thread checks for signals. After a signal, the
/// node fails at its next tick; if no tick comes, this thread closes the connection.
std::string serve(ProcessNode &node, const std::string &simulation, const std::string &name, const std::string &address,
                  const std::string &keys, double connect_timeout, double delay, std::function<void()> on_start)
{
    node.on_start = std::move(on_start);
    node.interrupted = false;
    node.delay = delay;
    zmq::context_t context;
    std::promise<std::string> promise;
    auto reason = promise.get_future();
    std::thread delegate([&] {
        try {
            cosim::MemberConfig config;
            config.simulation = simulation;
            config.node = name;
            config.address = address;
            config.keys = keys;
            config.connect_timeout = milliseconds(connect_timeout);
            promise.set_value(cosim::Delegate(context, config).serve(node));
        } catch (...) {
            promise.set_exception(std::current_exception());
        }
    });
    Poll poll;
    {
        py::gil_scoped_release release;
        bool interrupted = false;
        while (!interrupted && reason.wait_for(std::chrono::milliseconds(50)) != std::future_status::ready) {
            interrupted = !poll([] { return true; });
        }
        if (interrupted) {
            node.interrupted = true;
            if (reason.wait_for(std::chrono::milliseconds(200)) != std::future_status::ready) {
                context.shutdown();
            }
        }
        delegate.join();
    }
    poll.rethrow();
    try {
        return reason.get();
    } catch (const cosim::LinkError &e) {
        throw sim::RunError(e.what());
    } catch (const cosim::ProtocolError &e) {
        throw sim::RunError(e.what());
    } catch (const cosim::KeyError &e) {
        throw sim::SetupError(e.what());
    }
}

/// Run a Router or Replay, and check for Python's signals. If `go_on` returns false, the run ends.
template <class R> std::string run_watched(R &router, const std::function<bool()> &go_on = {})
{
    Poll poll;
    std::string reason;
    {
        py::gil_scoped_release release;
        reason = router.run([&] { return poll([&] { return !go_on || go_on(); }); });
    }
    poll.rethrow();
    return reason;
}

/// Make a Router; its exceptions become Python's errors.
template <class Make> auto made_router(Make make)
{
    try {
        return make();
    } catch (const cosim::LinkError &e) {
        throw sim::SetupError(e.what());
    } catch (const cosim::KeyError &e) {
        throw sim::SetupError(e.what());
    } catch (const cosim::SchemaError &e) {
        throw sim::SetupError(e.what());
    } catch (const std::invalid_argument &e) {
        throw sim::SetupError(e.what());
    }
}

/// The controller with its own sockets.
class Control {
public:
    Control(const std::string &simulation, const std::vector<std::pair<std::string, std::string>> &nodes, Ns end,
            std::uint64_t seed, const std::string &address, const std::string &keys, bool unencrypted, double join,
            double reply, const std::string &sharing, Ns save_every, std::function<void(const std::string &)> report)
        : nodes_(nodes.size())
    {
        cosim::ControllerConfig controller;
        controller.simulation = simulation;
        for (const auto &[name, policy] : nodes) {
            cosim::NodeConfig node;
            node.name = name;
            node.on_loss =
                choice(cosim::policy_words, policy, "on_loss: expected abort, pause, hold, drop or restart; found ");
            node.save_every = save_every;
            controller.nodes.push_back(std::move(node));
        }
        controller.end = end;
        controller.seed = seed;
        cosim::RouterConfig router;
        router.address = address;
        router.keys = cosim::place_of_keys(keys);
        router.unencrypted_beyond_machine = unencrypted;
        router.sharing =
            choice(cosim::sharing_words, sharing, "sharing: expected allowed, forbidden or required; found ");
        router.join = milliseconds(join);
        router.reply = milliseconds(reply);
        router.report = std::move(report);
        if (const std::string text = cosim::warning(router); unencrypted && !text.empty()) {
            router.report(text);
        }
        router_ = made_router([&] { return std::make_unique<cosim::Router>(context_, controller, router); });
    }

    std::string address() const { return router_->address(); }

    std::string run(const std::function<bool()> &poll) { return run_watched(*router_, poll); }

    /// (ticks, ns of wall time computing, on the way, waiting) of each node.
    std::vector<std::tuple<std::uint64_t, Ns, Ns, Ns>> times() const
    {
        std::vector<std::tuple<std::uint64_t, Ns, Ns, Ns>> found;
        for (cosim::NodeId id = 0; id < nodes_; id++) {
            const cosim::NodeTimes t = router_->times(id);
            found.emplace_back(t.ticks, t.compute, t.transport, t.wait);
        }
        return found;
    }

private:
    zmq::context_t context_;
    std::size_t nodes_;
    std::unique_ptr<cosim::Router> router_;
};

/// One node alone, against the record of the others.
class Replay {
public:
    using Topic = std::tuple<std::string, std::string, std::string, py::bytes, std::vector<Ns>, py::bytes>;
    using Part = std::tuple<std::string, std::vector<std::pair<Ns, Ns>>, bool, std::vector<Topic>>;

    Replay(const std::string &simulation, const std::string &node, std::uint64_t seed, Ns end,
           const std::vector<Part> &others, const std::vector<std::string> &topics, const std::string &record,
           const std::string &address, const std::string &keys, double join, double reply, const std::string &prefix,
           const std::map<std::string, std::string> &names)
    {
        cosim::ReplayConfig config;
        config.names = {prefix, names};
        config.simulation = simulation;
        config.node = node;
        config.seed = seed;
        config.end = end;
        config.topics = topics;
        config.record = record;
        cosim::RouterConfig router;
        router.address = address;
        router.keys = cosim::place_of_keys(keys);
        router.join = milliseconds(join);
        router.reply = milliseconds(reply);
        replay_ = made_router([&] {
            for (const Part &part : others) {
                config.others.push_back(part_of(part));
            }
            return std::make_unique<cosim::Replay>(context_, config, router);
        });
    }

    std::string address() const { return replay_->address(); }
    std::string run(const std::function<bool()> &go_on) { return run_watched(*replay_, go_on); }

private:
    static cosim::Part part_of(const Part &from)
    {
        const auto &[node, rates, any_time, topics] = from;
        cosim::Part part;
        part.node = node;
        part.any_time = any_time;
        for (const auto &[period, offset] : rates) {
            part.rates.push_back({period, offset});
        }
        for (const auto &[name, type, text, initial, times, structs] : topics) {
            cosim::Part::Topic topic{name, cosim::make_schema(type, text), payload(initial), times, {}};
            const std::string_view all(structs);
            if (all.size() != times.size() * topic.schema.size) {
                throw std::invalid_argument(name + " has " + std::to_string(all.size()) + " bytes for " +
                                            std::to_string(times.size()) + " messages of " +
                                            std::to_string(topic.schema.size));
            }
            for (std::size_t i = 0; i < times.size(); i++) {
                const auto payload = all.substr(i * topic.schema.size, topic.schema.size);
                topic.payloads.push_back(cosim::make_payload(std::as_bytes(std::span(payload))));
            }
            part.topics.push_back(std::move(topic));
        }
        return part;
    }

    static cosim::Payload payload(const py::bytes &bytes) { return std::as_bytes(std::span(std::string_view(bytes))); }

    zmq::context_t context_;
    std::unique_ptr<cosim::Replay> replay_;
};

} // namespace

} // namespace fledge::core

PYBIND11_MODULE(_cosim, m)
{
    using namespace fledge::core;
    using fledge::sim::Ns;
    m.doc() = "Nodes and the controller of a co-simulation. Use the package fledge.cosim instead.";
    py::module_::import("_core");
    bind_crashes(m);
    py::class_<ProcessNode>(m, "ProcessNode", "A process of a simulation as a node of a co-simulation.")
        .def(py::init<fledge::sim::Simulation &, const std::string &>(), "simulation"_a, "process"_a,
             py::keep_alive<1, 2>())
        .def("read", &ProcessNode::read_by_path, "topic"_a, "port"_a, "latency"_a, "stale_after"_a)
        .def(
            "carry",
            [](ProcessNode &node, const std::string &flight, const std::vector<std::pair<Ns, Ns>> &rates) {
                std::vector<fledge::cosim::Rate> all;
                all.reserve(rates.size());
                for (const auto &[period, offset] : rates) {
                    all.push_back({period, offset});
                }
                node.carry(flight, std::move(all));
            },
            "flight"_a, "rates"_a)
        .def("serve", serve, "simulation"_a, "name"_a, "address"_a, "keys"_a, "connect_timeout"_a, "delay"_a,
             "on_start"_a);
    py::class_<Control>(m, "Control", "The controller of a co-simulation.")
        .def(py::init<const std::string &, const std::vector<std::pair<std::string, std::string>> &, Ns, std::uint64_t,
                      const std::string &, const std::string &, bool, double, double, const std::string &, Ns,
                      std::function<void(const std::string &)>>(),
             "simulation"_a, "nodes"_a, "end"_a, "seed"_a, "address"_a, "keys"_a, "unencrypted"_a, "join"_a, "reply"_a,
             "sharing"_a, "save_every"_a, "report"_a)
        .def_property_readonly("address", &Control::address)
        .def_property_readonly("times", &Control::times)
        .def("run", &Control::run, "poll"_a);
    py::class_<Replay>(m, "Replay", "A node of a co-simulation alone, against the record of the others.")
        .def(py::init<const std::string &, const std::string &, std::uint64_t, Ns, const std::vector<Replay::Part> &,
                      const std::vector<std::string> &, const std::string &, const std::string &, const std::string &,
                      double, double, const std::string &, const std::map<std::string, std::string> &>(),
             "simulation"_a, "node"_a, "seed"_a, "end"_a, "others"_a, "topics"_a, "record"_a, "address"_a, "keys"_a,
             "join"_a, "reply"_a, "prefix"_a, "names"_a)
        .def_property_readonly("address", &Replay::address)
        .def("run", &Replay::run, "poll"_a);
}
