// SPDX-License-Identifier: Apache-2.0
// For tests: a controller with nodes that answer in every order, join, leave and die. The tests compare the inputs of
// each node with a look-up in the history of all writes, which does not use grants.
#pragma once

#include "cosim/controller/controller.h"
#include "cosim/protocol/testing/words.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <optional>
#include <random>
#include <string>
#include <vector>

namespace fledge::cosim {

using Random = std::mt19937;

inline std::uint64_t mix(std::uint64_t a, std::uint64_t b)
{
    a ^= b + 0x9e3779b97f4a7c15u + (a << 6) + (a >> 2);
    return (a ^ a >> 29) * 0xbf58476d1ce4e5b9u;
}

/// The steps, subscriptions and outputs of a node.
struct Spec {
    std::string name;
    std::vector<Rate> rates;
    bool any_time = false;
    std::vector<Subscription> subscriptions;
    std::vector<std::string> writes;
    Policy on_loss = Policy::abort;
    Join joins = Join::at_start;
    Ns joins_after = -1;
    bool rejoins = false, saves = false;
    Ns save_every = 0;
    Ns leaves_at = for_ever; ///< at its first instant after this

    /// Its instants up to `end`. A node that steps at any time has instants that the controller does not know.
    std::vector<Ns> instants(Ns end) const
    {
        std::vector<Ns> all;
        if (any_time) {
            for (Ns t = 0, n = 1; t <= end; n++) {
                all.push_back(t);
                t += 1 + static_cast<Ns>(mix(name.size() + name.back(), static_cast<std::uint64_t>(n)) % 60);
            }
            return all;
        }
        for (const Rate &rate : rates) {
            for (Ns t = rate.offset; rate.period > 0 && t <= end; t += rate.period) {
                all.push_back(t);
            }
        }
        std::sort(all.begin(), all.end());
        all.erase(std::unique(all.begin(), all.end()), all.end());
        return all;
    }

    std::uint64_t initial(std::size_t output) const { return mix(name.back(), 1000 + output); }
    bool writes_at(Ns t, std::size_t output) const
    {
        return mix(static_cast<std::uint64_t>(t), output + static_cast<unsigned char>(name.back())) % 4 != 0;
    }
    static std::uint64_t output(std::uint64_t state, std::size_t output) { return mix(state, output); }
};

/// By name of the node: its state at each of its instants, which depends on all its inputs.
using History = std::map<std::string, std::vector<std::pair<Ns, std::uint64_t>>>;

struct Write {
    Ns t;
    std::uint64_t x;
};

/// At its instant t, a reader sees the messages written up to the returned time; -1 is that of the initial value.
/// The last exchange was at `since` at the latest.
inline Ns latest_seen(Latency latency, Ns t, const std::vector<Rate> &reader, const std::vector<Rate> &writer = {},
                      Ns since = -1)
{
    Ns longest = 0;
    for (const auto *rates : {&reader, &writer}) {
        for (const Rate &rate : *rates) {
            longest = std::max(longest, rate.period);
        }
    }
    return latency == Latency::same_instant   ? t
           : latency == Latency::next_instant ? t - 1
                                              : std::max(t == 0 ? -1 : (t - 1) / longest * longest, since);
}

/// When each node took part.
struct Lives {
    /// At the instants after the first time, up to and including the second; by node.
    std::map<std::string, std::vector<std::pair<Ns, Ns>>> parts;
    /// When a topic became known: a reader was there together with its writer.
    std::map<std::string, Ns> known;
};

/// From the changes that a controller reports.
inline Lives lives_of(const std::vector<Spec> &specs, const std::vector<Change> &changes)
{
    Lives lives;
    std::vector<bool> there(specs.size()), been(specs.size());
    const auto look = [&](Ns t) {
        for (std::size_t from = 0; from < specs.size(); from++) {
            for (std::size_t to = 0; to < specs.size(); to++) {
                for (const Subscription &subscription : specs[to].subscriptions) {
                    const auto &writes = specs[from].writes;
                    const bool written = std::find(writes.begin(), writes.end(), subscription.topic) != writes.end();
                    if (there[from] && been[to] && written) {
                        lives.known.try_emplace(subscription.topic, t);
                    }
                }
            }
        }
    };
    for (std::size_t i = 0; i < specs.size(); i++) {
        if (specs[i].joins == Join::at_start) {
            there[i] = been[i] = true;
            lives.parts[specs[i].name].emplace_back(-1, for_ever);
        }
    }
    look(-1);
    for (const Change &change : changes) {
        auto &own = lives.parts[specs[change.node].name];
        if (change.what == Change::joined) {
            there[change.node] = been[change.node] = true;
            own.emplace_back(change.after, for_ever);
            look(change.after);
        } else if (change.what != Change::back) {
            there[change.node] = false;
            own.back().second = change.after;
        }
    }
    return lives;
}

/// The same run without a controller. `given`: messages of asynchronous programs.
inline History expected(const std::vector<Spec> &specs, Ns end, const Lives &lives,
                        const std::map<std::string, std::vector<Write>> &given = {})
{
    struct Source {
        const Spec *writer = nullptr;
        std::vector<Write> writes; // in order of time
        Ns joined = -1;
    };
    enum Kind { step, ghost, join };
    struct Event {
        Ns t;
        int after; // at the same time, joiners come last
        std::size_t i;
        Kind kind;
        auto operator<=>(const Event &) const = default;
    };
    std::map<std::string, Source> topics;
    const Spec no_node;
    for (const auto &[topic, writes] : given) {
        topics[topic] = {&no_node, writes};
    }
    std::vector<Event> events; // by time, then in the order of the nodes
    std::vector<std::uint64_t> state(specs.size());
    std::vector<Ns> joined(specs.size(), -1);
    for (std::size_t i = 0; i < specs.size(); i++) {
        const auto instants = specs[i].instants(end + 1000);
        if (!lives.parts.contains(specs[i].name)) {
            continue;
        }
        for (const auto &[from, to] : lives.parts.at(specs[i].name)) {
            events.push_back({from, 1, i, join});
            for (const Ns t : instants) {
                if (t > from && t <= to && t <= end) {
                    events.push_back({t, 0, i, step});
                }
            }
            if (to != for_ever && specs[i].on_loss == Policy::drop) {
                const auto next = std::find_if(instants.begin(), instants.end(), [&, at = to](Ns t) { return t > at; });
                events.push_back({specs[i].any_time ? to + 1 : *next, 0, i, ghost});
            }
        }
    }
    std::sort(events.begin(), events.end());
    History history;
    for (const auto &[t, after, i, kind] : events) {
        const Spec &spec = specs[i];
        if (kind == join) {
            state[i] = 7;
            joined[i] = t;
            for (std::size_t k = 0; k < spec.writes.size(); k++) {
                Source &source = topics[spec.writes[k]];
                source.writer = &spec;
                source.joined = t;
                source.writes.push_back({t, spec.initial(k)});
            }
            continue;
        }
        if (kind == ghost) {
            const auto &own = lives.parts.at(spec.name);
            const bool alive = std::any_of(
                own.begin(), own.end(), [&, at = t](const auto &life) { return life.first < at && at <= life.second; });
            for (const std::string &topic : spec.writes) {
                if (!alive) {
                    topics[topic].writes.push_back({t, 0});
                }
            }
            continue;
        }
        for (const Subscription &subscription : spec.subscriptions) {
            const auto known = lives.known.find(subscription.topic);
            if (!given.contains(subscription.topic) && (known == lives.known.end() || known->second >= t)) {
                state[i] = mix(state[i], 0); // no writer took part yet
                continue;
            }
            const Source &source = topics.at(subscription.topic);
            const Ns latest = latest_seen(subscription.latency, t, spec.rates, source.writer->rates,
                                          std::max(source.joined, joined[i]));
            const auto later =
                std::find_if(source.writes.begin(), source.writes.end(), [&](const Write &w) { return w.t > latest; });
            state[i] = mix(state[i], (later - 1)->x);
        }
        state[i] = mix(state[i], static_cast<std::uint64_t>(t));
        history[spec.name].emplace_back(t, state[i]);
        for (std::size_t k = 0; k < spec.writes.size(); k++) {
            if (spec.writes_at(t, k)) {
                topics[spec.writes[k]].writes.push_back({t, Spec::output(state[i], k)});
            }
        }
    }
    return history;
}

inline History expected(const std::vector<Spec> &specs, Ns end)
{
    return expected(specs, end, lives_of(specs, {}));
}

/// A node that answers like a delegate.
struct FakeNode {
    const Spec *spec = nullptr;
    Ns reached = -1, start = -1;
    std::uint64_t state = 7;
    std::map<std::uint32_t, std::uint32_t> counts; ///< received, by channel
    std::map<std::string, std::uint64_t> seen;     ///< by topic
    std::vector<std::pair<Ns, std::pair<std::string, std::uint64_t>>> coming;
    std::map<std::uint32_t, std::string> wired;
    std::map<std::string, std::pair<std::uint32_t, std::uint32_t>> written; ///< channel and count
    std::vector<Ns> instants;
    std::vector<std::pair<Ns, std::uint64_t>> history;
    std::vector<std::pair<Ns, std::uint64_t>> past; ///< steps of the lost program, which this one repeats
    std::vector<std::uint64_t> latest;              ///< of each output

    /// A new program takes the place of the lost one, without its messages. It has the state of the lost one only if
    /// the run pauses for it.
    void start_anew(bool itself)
    {
        if (!itself) {
            state = 7;
            latest.clear();
        }
        counts.clear();
        seen.clear();
        coming.clear();
        wired.clear();
        written.clear();
    }

    Bytes save()
    {
        while (!coming.empty() && coming.front().first <= reached) {
            seen[coming.front().second.first] = coming.front().second.second;
            coming.erase(coming.begin());
        }
        std::vector<std::uint64_t> words = {static_cast<std::uint64_t>(reached), state, latest.size()};
        words.insert(words.end(), latest.begin(), latest.end());
        for (std::size_t i = 0; i < spec->subscriptions.size(); i++) {
            const auto it = seen.find(spec->subscriptions[i].topic);
            words.push_back(it != seen.end());
            words.push_back(it != seen.end() ? it->second : 0);
        }
        const auto bytes = std::as_bytes(std::span(words));
        return {bytes.begin(), bytes.end()};
    }

    void restore(const Bytes &bytes)
    {
        std::vector<std::uint64_t> words(bytes.size() / 8);
        std::memcpy(words.data(), bytes.data(), bytes.size());
        EXPECT_EQ(static_cast<Ns>(words[0]), start);
        state = words[1];
        latest.assign(words.begin() + 3, words.begin() + 3 + static_cast<std::ptrdiff_t>(words[2]));
        for (std::size_t i = 0; i < spec->subscriptions.size(); i++) {
            const std::size_t at = 3 + words[2] + 2 * i;
            if (words[at]) {
                seen[spec->subscriptions[i].topic] = words[at + 1];
            }
        }
    }

    Message answer(const Message &request, Random &random, Ns end)
    {
        const Schema schema = make_schema("Word", word_text);
        if (const auto *m = std::get_if<Initialize>(&request)) {
            reached = start = m->start;
            instants = spec->instants(end);
            if (!m->snapshot.empty()) {
                restore(m->snapshot);
            }
            past = history.size() > past.size() ? history : past;
            std::erase_if(history, [&](const auto &entry) { return entry.first > start; });
            return Initialized{spec->rates, spec->any_time, spec->saves};
        }
        if (std::holds_alternative<ProvideDesired>(request)) {
            return Desired{spec->subscriptions};
        }
        if (const auto *m = std::get_if<Match>(&request)) {
            Matched matched;
            written.clear();
            for (std::size_t k = latest.size(); k < spec->writes.size(); k++) {
                latest.push_back(spec->initial(k));
            }
            for (const Channel &channel : m->channels) {
                const auto it = std::find(spec->writes.begin(), spec->writes.end(), channel.topic);
                if (it != spec->writes.end()) {
                    written[channel.topic] = {channel.channel, 0};
                    matched.publications.push_back(
                        {channel.channel, schema, word(latest[static_cast<std::size_t>(it - spec->writes.begin())])});
                }
            }
            return matched;
        }
        if (const auto *m = std::get_if<Start>(&request)) {
            counts.clear();
            std::erase_if(coming, [&](const auto &c) { return c.first > reached; }); // the controller sends them again
            wired.clear();
            for (const Channel &channel : m->wired) {
                EXPECT_EQ(channel.schema, schema);
                wired[channel.channel] = channel.topic;
            }
            return Ready{};
        }
        if (const auto *m = std::get_if<Tick>(&request)) {
            return step(*m, random);
        }
        if (const auto *m = std::get_if<Save>(&request)) {
            EXPECT_EQ(m->time, reached);
            return Saved{save()};
        }
        EXPECT_TRUE(std::holds_alternative<Finish>(request));
        return Finished{};
    }

    Tock step(const Tick &tick, Random &random)
    {
        Tock tock;
        EXPECT_GT(tick.until, reached);
        for (const Record &record : tick.records) {
            EXPECT_EQ(record.count, ++counts[record.channel]) << "a gap";
            EXPECT_TRUE(record.t > reached || (record.t == reached && reached == start)) << "late for " << spec->name;
            EXPECT_LE(record.t, tick.until);
            coming.push_back({record.t, {wired.at(record.channel), word_of(record.payload)}});
        }
        std::stable_sort(coming.begin(), coming.end(), [](auto &a, auto &b) { return a.first < b.first; });
        tock.reached = tick.until;
        for (const Ns t : instants) {
            if (t <= reached || t > tick.until) {
                continue;
            }
            while (!coming.empty() && coming.front().first <= t) {
                seen[coming.front().second.first] = coming.front().second.second;
                coming.erase(coming.begin());
            }
            for (const Subscription &subscription : spec->subscriptions) {
                EXPECT_TRUE(subscription.optional || seen.contains(subscription.topic))
                    << "incomplete inputs of " << spec->name;
                state = mix(state, seen[subscription.topic]);
            }
            state = mix(state, static_cast<std::uint64_t>(t));
            history.emplace_back(t, state);
            if (history.size() <= past.size()) {
                EXPECT_EQ(history.back(), past[history.size() - 1]);
            }
            for (std::size_t k = 0; k < spec->writes.size(); k++) {
                const auto it = written.find(spec->writes[k]);
                if (spec->writes_at(t, k)) {
                    latest[k] = Spec::output(state, k);
                    if (it != written.end()) {
                        tock.records.push_back({it->second.first, ++it->second.second, t, word(latest[k])});
                    }
                }
            }
            if (t >= spec->leaves_at) {
                tock.reached = t;
                tock.leaving = true;
                break;
            }
            if (random() % 8 == 0) {
                tock.reached = t; // an early return
                break;
            }
        }
        reached = tock.reached;
        return tock;
    }
};

/// A controller with its nodes, whose replies come in any order.
struct Bench {
    Bench(const std::vector<Spec> &all, Ns run_end, unsigned seed, std::uint32_t batch = 1000,
          std::uint32_t ahead = 4096)
        : Bench(all, configured(all, run_end, batch, ahead), seed)
    {
    }

    Bench(const std::vector<Spec> &all, const ControllerConfig &config, unsigned seed)
        : specs(all), end(config.end), random(seed), controller(config), nodes(all.size()), requests(all.size())
    {
        for (std::size_t i = 0; i < all.size(); i++) {
            nodes[i].spec = &specs[i];
        }
    }

    static ControllerConfig configured(const std::vector<Spec> &all, Ns end, std::uint32_t batch, std::uint32_t ahead)
    {
        ControllerConfig config;
        config.simulation = "bench";
        for (const Spec &spec : all) {
            config.nodes.push_back(
                {spec.name, spec.on_loss, spec.joins, spec.joins_after, spec.rejoins, spec.save_every, {}});
        }
        config.end = end;
        config.batch = batch;
        config.ahead = ahead;
        config.listened = true;
        config.asynchronous = {{"ground", {}}};
        return config;
    }

    void arrive(NodeId id) { controller.hello(id, {1, 1, "bench", specs[id].name}); }

    void arrive_all()
    {
        std::vector<NodeId> order(nodes.size());
        for (NodeId i = 0; i < order.size(); i++) {
            order[i] = i;
        }
        std::erase_if(order, [&](NodeId i) { return specs[i].joins != Join::at_start; });
        std::shuffle(order.begin(), order.end(), random);
        for (const NodeId id : order) {
            arrive(id);
            for (auto n = random() % 6; n; n--) {
                reply_somewhere();
            }
        }
    }

    void act()
    {
        while (controller.play()) {
        }
        for (Action &a : controller.take_actions()) {
            if (auto *send = std::get_if<action::Send>(&a)) {
                sent += !std::holds_alternative<Save>(send->frame.message); // a snapshot may come later
                EXPECT_TRUE(!requests[send->node] || std::holds_alternative<Finish>(send->frame.message));
                if (std::holds_alternative<Tick>(send->frame.message)) {
                    ticks++;
                }
                requests[send->node] = std::move(send->frame);
            } else if (auto *out = std::get_if<action::ShutOut>(&a)) {
                requests[out->node].reset();
            } else if (auto *report = std::get_if<action::Report>(&a)) {
                reports.push_back(report->text);
            } else if (auto *refuse = std::get_if<action::Refuse>(&a)) {
                refusals.push_back(refuse->reason);
            } else if (auto *began = std::get_if<action::Began>(&a)) {
                exchange = began->exchange;
            } else if (auto *wrote = std::get_if<action::Wrote>(&a)) {
                for (const Record &record : wrote->records) {
                    const Exchange::Topic &topic = exchange.topics.at(record.channel);
                    EXPECT_EQ(topic.writer, wrote->node < specs.size() ? specs[wrote->node].name : "ground");
                    written[topic.name].emplace_back(record.t, word_of(record.payload));
                    counts[topic.name].push_back(record.count);
                    const bool some_node_went =
                        std::any_of(controller.changes().begin(), controller.changes().end(), [](const Change &c) {
                            return c.what == Change::given_up || c.what == Change::left;
                        });
                    if (wrote->node < specs.size() && !some_node_went) {
                        EXPECT_GT(record.t, settled) << "settled too early";
                    }
                }
                settled = std::max(settled, wrote->settled);
            } else if (auto *snapshots = std::get_if<action::Kept>(&a)) {
                EXPECT_TRUE(kept.empty() || kept.rbegin()->first < snapshots->t);
                settled = std::max(settled, snapshots->t);
                kept[snapshots->t] = snapshots->snapshots;
            } else if (auto *done = std::get_if<action::Done>(&a)) {
                EXPECT_FALSE(outcome);
                outcome = done->reason;
            }
        }
    }

    /// A random node answers. False if the controller waits for no reply.
    bool reply_somewhere()
    {
        const auto before = sent;
        act();
        sleeping = sleeping && sent == before;
        std::vector<NodeId> busy;
        for (NodeId i = 0; i < nodes.size(); i++) {
            if (requests[i]) {
                busy.push_back(i);
            }
        }
        if (busy.empty()) {
            return false;
        }
        reply(busy[random() % busy.size()]);
        return true;
    }

    void reply(NodeId id)
    {
        const Frame request = *std::exchange(requests[id], std::nullopt);
        // Through bytes, as on a network.
        const Frame answer = decode(encode({request.number, nodes[id].answer(request.message, random, end)},
                                           random() % 2 ? Order::big : Order::little));
        EXPECT_TRUE(controller.waiting_for(id));
        const auto *tick = std::get_if<Tick>(&request.message);
        const auto *tock = std::get_if<Tock>(&answer.message);
        const bool whole = tick && tock && tock->reached == tick->until && !tock->leaving;
        if (!sleeping) {
            sleeping = controller.unblocking_nodes(unblocking_nodes);
        }
        const bool sleeps_on = sleeping && whole && !unblocking_nodes[id];
        controller.received(id, answer);
        if (sleeps_on) {
            const auto before = sent;
            act();
            EXPECT_EQ(sent, before) << "a controller that sleeps until an unblocking node answers would miss this";
        } else {
            sleeping = false;
        }
    }

    /// Run to the end. Returns the outcome, or "the run hangs".
    std::string run()
    {
        arrive_all();
        return go_on();
    }

    std::string go_on()
    {
        while (reply_somewhere()) {
        }
        return outcome.value_or("the run hangs");
    }

    /// All nodes connect and are matched.
    void begin()
    {
        arrive_all();
        while (!controller.running() && reply_somewhere()) {
        }
        act();
    }

    /// The end of the node's tick; none without a tick.
    std::optional<Ns> tick_of(NodeId id) const
    {
        const auto *tick = requests[id] ? std::get_if<Tick>(&requests[id]->message) : nullptr;
        return tick ? std::optional(tick->until) : std::nullopt;
    }

    /// Let the node answer its tick with this tock.
    void tock(NodeId id, Tock answer)
    {
        const Frame request = *std::exchange(requests[id], std::nullopt);
        sleeping = false;
        controller.received(id, {request.number, std::move(answer)});
        act();
    }

    History history() const
    {
        History all;
        for (const FakeNode &node : nodes) {
            all[node.spec->name] = node.history.size() > node.past.size() ? node.history : node.past;
        }
        return all;
    }

    std::vector<Spec> specs;
    Ns end;
    Random random;
    Controller controller;
    std::vector<FakeNode> nodes;
    std::vector<std::optional<Frame>> requests;
    std::vector<std::string> reports, refusals;
    std::optional<std::string> outcome;
    std::size_t ticks = 0;
    std::size_t sent = 0;
    std::vector<char> unblocking_nodes; ///< see Controller; valid while `sleeping`
    bool sleeping = false;              ///< a test sets it to false after each event except replies
    Exchange exchange;
    std::map<std::string, std::vector<std::pair<Ns, std::uint64_t>>> written; ///< writes, by topic
    std::map<std::string, std::vector<std::uint32_t>> counts;                 ///< of these
    std::map<Ns, std::vector<NodeSnapshot>> kept;
    Ns settled = -1;
};

inline Subscription subscription(const std::string &topic, Latency latency)
{
    return {topic, latency, false, make_schema("Word", word_text)};
}

/// Nodes with random steps, wires and latencies, without cycles.
inline std::vector<Spec> random_network(Random &random)
{
    const Ns periods[] = {7, 10, 20, 30, 50, 100};
    std::vector<Spec> specs(2 + random() % 4);
    for (std::size_t i = 0; i < specs.size(); i++) {
        specs[i].name = std::string("n") + static_cast<char>('a' + i);
        specs[i].any_time = random() % 5 == 0;
        for (auto n = 1 + random() % 2; n; n--) {
            const Ns period = periods[random() % 6];
            specs[i].rates.push_back({period, random() % 3 ? 0 : static_cast<Ns>(random() % 60)});
        }
        for (auto n = random() % 3; n; n--) {
            specs[i].writes.push_back("/" + specs[i].name + "/" + std::to_string(n));
        }
    }
    for (std::size_t to = 0; to < specs.size(); to++) {
        for (std::size_t from = 0; from < specs.size(); from++) {
            for (const std::string &topic : specs[from].writes) {
                if (from == to || random() % 2) {
                    continue;
                }
                auto latency = static_cast<Latency>(random() % 3);
                const bool waits = latency == Latency::same_instant ||
                                   (latency == Latency::next_instant && specs[from].any_time && specs[to].any_time);
                if (waits && from > to) {
                    latency = Latency::next_exchange;
                }
                specs[to].subscriptions.push_back(subscription(topic, latency));
            }
        }
    }
    return specs;
}

} // namespace fledge::cosim
