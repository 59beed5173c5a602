// SPDX-License-Identifier: Apache-2.0
// One program takes the place of another. What is kept for that is a snapshot, what the node was told since,
// and what it said: the new one begins with the first, is told the second again, and has to say the third
// again. Without snapshots, all of it reaches back to the node's beginning.
#include "cosim/controller/controller_parts.h"

#include <algorithm>

namespace fledge::cosim {

namespace {

constexpr std::size_t most_records = 16'384; // in one tick
constexpr std::size_t most_bytes = std::size_t{4} << 20;

std::size_t room_of(const Record &record)
{
    return sizeof record + record.payload.size();
}

} // namespace

void Controller::keep_told(Node &node, const std::vector<Record> &records)
{
    for (const Record &record : records) {
        node.told.push_back(record);
        node.logged += room_of(record);
    }
}

void Controller::keep_said(Node &node, const std::vector<Record> &records)
{
    for (const Record &record : records) {
        node.said[record.channel].push_back(record);
        node.logged += room_of(record);
    }
}

/// What is kept has an end.
void Controller::look_at_log(NodeId id)
{
    Node &node = nodes_[id];
    if (node.logged > config_.log && !node.saves) {
        report(node.config.name + " cannot be started again from now on: what it was told since " + when(node.saved) +
               " exceeds " + std::to_string(config_.log) + " bytes" +
               (node.saved < 0 ? ", and it makes no snapshots" : ""));
        node.kept = false;
        node.told = {};
        node.said.clear();
        node.logged = 0;
    }
}

/// Ask for a snapshot if it is time for one.
bool Controller::save_if_due(NodeId id)
{
    Node &node = nodes_[id];
    const Ns every = node.config.save_every;
    const bool due = node.kept && node.saves && node.reached > node.saved &&
                     ((every && node.reached - node.saved >= every) || node.logged > config_.log);
    if (due) {
        node.stage = Stage::saving;
        send<Save, Saved>(id, {node.reached});
    }
    return due;
}

void Controller::reply(NodeId id, Saved &m)
{
    Node &node = nodes_[id];
    node.stage = Stage::idle;
    if (m.snapshot.empty()) {
        node.saves = false;
        report(node.config.name + " makes no snapshot at " + when(node.reached));
        look_at_log(id);
    } else {
        node.snapshot = std::move(m.snapshot);
        node.saved = node.reached;
        std::erase_if(node.told, [&](const Record &record) { return record.t <= node.reached; });
        node.said.clear();
        node.logged = 0;
        for (const Record &record : node.told) {
            node.logged += room_of(record);
        }
    }
    grant_around(id);
    look_at_boundary();
    finish_if_complete();
}

/// The next of what it was told before it was lost, or, at the end of that, what is new.
void Controller::tell_again(NodeId id)
{
    Node &node = nodes_[id];
    if (node.replayed >= node.reached) {
        return come_back(id);
    }
    if (!node.told_again) {
        std::stable_sort(node.told.begin(), node.told.end(),
                         [](const Record &a, const Record &b) { return a.t < b.t; });
    }
    Tick tick{node.reached, {}};
    for (std::size_t bytes = 0; node.told_again < node.told.size(); node.told_again++) {
        const Record &record = node.told[node.told_again];
        if ((tick.records.size() >= most_records || bytes > most_bytes) && record.t > tick.records.back().t) {
            tick.until = std::max(record.t - 1, node.replayed + 1);
            break;
        }
        bytes += room_of(record);
        tick.records.push_back(record);
        for (const std::size_t w : node.in) {
            if (wires_[w].channel == record.channel) {
                tick.records.back().count = ++wires_[w].count;
            }
        }
    }
    node.until = tick.until;
    node.stage = Stage::ticking;
    send<Tick, Tock>(id, std::move(tick));
}

void Controller::hear_again(NodeId id, const Tock &m)
{
    Node &node = nodes_[id];
    const auto differs = [&](const std::string &what) {
        finish(node.config.name + ": started again from " + when(node.saved) +
               ", it does not do the same again: " + what);
    };
    if (m.reached <= node.replayed || m.reached > node.until) {
        return lost(id, "it says that it reached " + when(m.reached) + "; it may go from " + when(node.replayed) +
                            " to " + when(node.until));
    }
    for (const Record &record : m.records) {
        if (record.channel >= topics_.size() || topics_[record.channel].writer != id) {
            return lost(id, "it wrote on channel " + std::to_string(record.channel) + ", which is not its own");
        }
        Topic &topic = topics_[record.channel];
        if (record.count != ++topic.count) {
            return lost(id, "gap or duplicate: message " + std::to_string(record.count) + " of " + topic.name +
                                " follows message " + std::to_string(topic.count - 1));
        }
        if (record.t <= topic.since) {
            continue; // nobody had asked for it then
        }
        const std::string what = topic.name + " at " + when(record.t);
        const auto &before = node.said[record.channel];
        std::size_t &n = node.said_again[record.channel];
        if (n == before.size() || before[n].t > record.t) {
            return differs("it writes " + what + ", which it did not");
        }
        if (before[n].t < record.t) {
            return differs("it does not write " + topic.name + " at " + when(before[n].t) + ", as it did");
        }
        if (before[n].payload != record.payload) {
            return differs(what + " has another value");
        }
        n++;
    }
    for (const auto &[channel, before] : node.said) {
        const std::size_t n = node.said_again[channel];
        if (n < before.size() && before[n].t <= m.reached) {
            return differs("it does not write " + topics_[channel].name + " at " + when(before[n].t) + ", as it did");
        }
    }
    node.replayed = m.reached;
    node.stage = Stage::idle;
    tell_again(id);
}

void Controller::come_back(NodeId id)
{
    Node &node = nodes_[id];
    node.returning = false;
    changes_.push_back({Change::back, id, node.reached});
    report(node.config.name + " is back at " + when(node.reached));
    grant_all(); // perhaps all have waited for it
    look_at_boundary();
    finish_if_complete();
}

} // namespace fledge::cosim
