// SPDX-License-Identifier: Apache-2.0
// The C interface of a StructNode and of an Observer.
#include "cosim/bindings/c/fledge_node.h"

#include "cosim/node/observer.h"
#include "cosim/node/struct_node.h"

#include <cmath>
#include <mutex>
#include <optional>

using namespace fledge::cosim;

struct FledgeNode {
    FledgeNode(MemberConfig config, Rate steps) : node(std::move(config), steps) {}

    StructNode node;
};

struct FledgeObserver {
    explicit FledgeObserver(MemberConfig config) : observer(context, std::move(config)) {}

    zmq::context_t context;
    Observer observer;
    Observed seen;
    std::vector<std::byte> message;
    std::mutex schemas; ///< of the observer, which other threads look up, too
};

namespace {

thread_local std::string last_error;

/// Call a function. What it throws becomes the error, and the result is `otherwise`.
template <class F> auto attempt(F function, decltype(function()) otherwise = {})
{
    try {
        last_error.clear();
        return function();
    } catch (const std::exception &e) {
        last_error = e.what();
        return otherwise;
    }
}

/// The same with a node or an observer; none is there if its creation failed.
template <class T, class F> int attempt_with(T *object, F function)
{
    if (!object) {
        return -1;
    }
    return attempt(
        [&] {
            function(*object);
            return 0;
        },
        -1);
}

std::string text(const char *given)
{
    return given ? given : "";
}

MemberConfig member(const char *simulation, const char *name, const char *address)
{
    MemberConfig config;
    config.simulation = text(simulation);
    config.node = text(name);
    config.address = text(address);
    ask_environment(config);
    return config;
}

Schema schema(const char *type, const char *definition)
{
    return definition && *definition ? make_schema(text(type), definition) : Schema{text(type), "", 0, 0};
}

std::span<std::byte> bytes(void *memory, std::size_t size)
{
    return {static_cast<std::byte *>(memory), size};
}

std::chrono::milliseconds milliseconds(double seconds)
{
    return std::chrono::milliseconds(std::llround(1000 * std::min(seconds, 1e9)));
}

/// For the result of one of the program's functions.
void check(int code, const char *what)
{
    if (code) {
        throw std::runtime_error(last_error.empty() ? what + std::string(" returned ") + std::to_string(code)
                                                    : last_error);
    }
}

/// A text that lives until the next call from the same place in this thread: each lambda has its own `Tag`.
template <class Tag> const char *lasting(Tag, std::string value)
{
    thread_local std::string text;
    text = std::move(value);
    return text.c_str();
}

} // namespace

const char *fledge_error(void)
{
    return last_error.c_str();
}

int fledge_fail(const char *why)
{
    last_error = why;
    return -1;
}

FledgeNode *fledge_node_create(const char *simulation, const char *node, const char *address, int64_t every,
                               int64_t offset)
{
    return attempt([&] { return new FledgeNode(member(simulation, node, address), {every, offset}); });
}

void fledge_node_destroy(FledgeNode *node)
{
    delete node;
}

const char *fledge_node_simulation(const FledgeNode *node)
{
    return node ? node->node.config().simulation.c_str() : nullptr;
}

const char *fledge_node_name(const FledgeNode *node)
{
    return node ? node->node.config().node.c_str() : nullptr;
}

int fledge_node_set(FledgeNode *node, const char *keys, double timeout)
{
    return attempt_with(node, [&](FledgeNode &n) {
        n.node.config().keys = text(keys);
        n.node.config().connect_timeout = milliseconds(timeout);
    });
}

int fledge_node_also_steps(FledgeNode *node, int64_t every, int64_t offset)
{
    return attempt_with(node, [&](FledgeNode &n) { n.node.also_step({every, offset}); });
}

int fledge_node_reads(FledgeNode *node, const char *topic, FledgeLatency latency, const char *type,
                      const char *definition, void *message, size_t size)
{
    return attempt_with(node, [&](FledgeNode &n) {
        n.node.read(topic, static_cast<Latency>(latency & ~FLEDGE_OPTIONAL), bytes(message, size),
                    schema(type, definition), latency & FLEDGE_OPTIONAL);
    });
}

int fledge_node_writes(FledgeNode *node, const char *topic, const char *type, const char *definition, void *message,
                       size_t size)
{
    return attempt_with(node,
                        [&](FledgeNode &n) { n.node.write(topic, bytes(message, size), schema(type, definition)); });
}

int fledge_node_save_in_snapshots(FledgeNode *node, void *state, size_t size)
{
    return attempt_with(node, [&](FledgeNode &n) { n.node.save_in_snapshots(bytes(state, size)); });
}

int fledge_node_run(FledgeNode *node, FledgeStep step, void *user)
{
    std::string reason;
    const int result = attempt_with(node, [&](FledgeNode &n) {
        reason = n.node.run([&](Ns t) { check(step(user, t), "its step"); });
        last_error.clear(); // of functions that a step has called
    });
    if (!result && !reason.empty()) {
        last_error = reason;
        return 1;
    }
    return result;
}

void fledge_node_leave(FledgeNode *node)
{
    node->node.leave();
}

void fledge_node_stop(FledgeNode *node)
{
    node->node.stop();
}

uint64_t fledge_node_seed(const FledgeNode *node)
{
    return node->node.seed();
}

int64_t fledge_node_end(const FledgeNode *node)
{
    return node->node.end();
}

FledgeObserver *fledge_observer_create(const char *simulation, const char *name, const char *address, const char *keys,
                                       double timeout)
{
    return attempt([&] {
        MemberConfig config = member(simulation, name, address);
        config.keys = text(keys);
        config.connect_timeout = milliseconds(timeout);
        return new FledgeObserver(std::move(config));
    });
}

void fledge_observer_destroy(FledgeObserver *observer)
{
    delete observer;
}

int fledge_observer_subscribe(FledgeObserver *observer, const char *prefix)
{
    return attempt_with(observer, [&](FledgeObserver &o) { o.observer.subscribe(prefix); });
}

int fledge_observer_next(FledgeObserver *observer, double timeout, FledgeSeen *seen)
{
    bool found = false;
    const int result = attempt_with(observer, [&](FledgeObserver &o) {
        std::optional<Observed> next;
        do {
            next = o.observer.next(timeout < 0 ? std::chrono::hours(1) : milliseconds(timeout));
        } while (!next && timeout < 0 && !o.observer.over());
        if (next) {
            found = true;
            o.seen = std::move(*next);
            const std::lock_guard lock(o.schemas);
            const Schema &schema = o.observer.schema(o.seen.topic);
            o.message.resize(schema.size);
            read_payload(o.seen.payload, fields_of(schema), o.message);
            *seen = {o.seen.topic.c_str(), o.seen.node.c_str(), o.message.data(), o.message.size(), o.seen.t,
                     o.seen.count,         o.seen.missed};
        }
    });
    return result ? result : found;
}

int fledge_observer_write(FledgeObserver *observer, const char *topic, const void *message, size_t size)
{
    return attempt_with(observer, [&](FledgeObserver &o) {
        o.observer.write(topic, make_payload({static_cast<const std::byte *>(message), size}));
    });
}

const char *fledge_observer_topics(FledgeObserver *observer)
{
    const std::lock_guard lock(observer->schemas);
    std::string names;
    for (const auto &[topic, schema] : observer->observer.topics()) {
        names += topic + "\n";
    }
    return lasting([] {}, names);
}

const char *fledge_observer_type(FledgeObserver *observer, const char *topic)
{
    const std::lock_guard lock(observer->schemas);
    return attempt([&] { return lasting([] {}, observer->observer.schema(topic).name); });
}

const char *fledge_observer_definition(FledgeObserver *observer, const char *topic)
{
    const std::lock_guard lock(observer->schemas);
    return attempt([&] { return lasting([] {}, observer->observer.schema(topic).text); });
}

const char *fledge_observer_reason(const FledgeObserver *observer)
{
    return observer && observer->observer.over() ? observer->observer.reason().c_str() : nullptr;
}
