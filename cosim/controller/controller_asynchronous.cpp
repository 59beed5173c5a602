// SPDX-License-Identifier: Apache-2.0
// Programs that step with nobody. What they write gets a time of its own: the first that lies before
// none of its readers. From there on it is as if a node had written it then, also in the record; so
// a replay gives the same. Two messages never get so close that a reader would miss the first.
#include "cosim/controller/controller_parts.h"

#include <algorithm>

namespace fledge::cosim {

/// Who writes the topics that no node does.
void Controller::take_asynchronous()
{
    for (Topic &topic : topics_) {
        topic.count = topic.writer && nodes_[*topic.writer].asynchronous ? 0 : topic.count;
        if (topic.wanted_by.empty() || (topic.writer && !nodes_[*topic.writer].over())) {
            continue;
        }
        for (NodeId id = config_.nodes.size(); id < nodes_.size(); id++) {
            const AsynchronousConfig &program = config_.asynchronous[id - config_.nodes.size()];
            const auto &its = program.topics;
            const bool writes = its.empty() ? topic.name.starts_with("/" + program.name + "/")
                                            : std::find(its.begin(), its.end(), topic.name) != its.end();
            if (!writes || topic.writer == id) {
                continue;
            }
            if (!topic.schema.given()) {
                add_fault(faults_, topic.name + " comes from " + program.name +
                                       ", an asynchronous program, and no reader defines it; one of them has to");
            }
            topic.writer = id;
            topic.since = topic.last = meeting_;
            topic.ahead.clear();
            topic.initial.assign(topic.schema.size + 4, std::byte{0});
            topic.initial[1] = static_cast<std::byte>(native_order());
        }
    }
}

/// The first time at which its writer may still write, so that the reader sees it, after all that
/// is on its way.
Ns Controller::earliest(const Wire &wire) const
{
    const Node &reader = nodes_[wire.to];
    Ns seen = reader.stage == Stage::ticking ? std::max(reader.until, reader.reached) : reader.reached;
    if (wire.pending.size() > wire.delivered) {
        const Ns before = std::max(wire.pending.back().t, seen + 1);
        seen = reader.any_time ? before : std::max(seen, reader.next_after(before - 1));
    }
    // Now it may be seen after `seen`.
    switch (wire.latency) {
    case Latency::same_instant: return seen + 1;
    case Latency::next_instant: return std::max(seen, Ns{0});
    case Latency::next_exchange:
        return seen <= 0 ? 0 : ((seen + wire.exchange - 1) / wire.exchange - 1) * wire.exchange + 1;
    }
    return seen + 1;
}

std::string Controller::inject(const std::string &program, const std::string &name, const Bytes &payload)
{
    if (!begun_ || finishing() || done()) {
        return begun_ ? "the run is over" : "the run has not begun";
    }
    const auto channel = channels_.find(name);
    if (channel == channels_.end()) {
        return "nobody reads " + name;
    }
    Topic &topic = topics_[channel->second];
    if (!topic.writer || !nodes_[*topic.writer].asynchronous || nodes_[*topic.writer].config.name != program) {
        return name + " does not come from " + program;
    }
    if (!is_payload(payload, topic.schema.size)) {
        return "a message of " + name + " has " + std::to_string(payload.size()) +
               " bytes; expected a CDR header and " + std::to_string(topic.schema.size);
    }
    if (phase_ == Phase::matching) {
        injected_.push_back({program, name, payload}); // the wires may be laid anew
        return "";
    }
    Ns written = std::max(topic.last, met_) + 1; // those who joined have seen what came before
    for (const std::size_t w : topic.wires) {
        const Wire &wire = wires_[w];
        if (wire.pending.size() >= config_.ahead) {
            return nodes_[wire.to].config.name + " has not yet seen " + std::to_string(wire.pending.size()) +
                   " messages of " + name;
        }
        const Node &reader = nodes_[wire.to];
        written = std::max(written, reader.over() ? reader.reached + 1 : earliest(wire));
    }
    topic.count++;
    topic.last = written;
    write_ahead(topic, written, payload);
    if (config_.tell) {
        act(action::Wrote{*topic.writer, {{channel->second, topic.count, written, payload}}});
    }
    return "";
}

std::vector<Channel> Controller::channels() const
{
    std::vector<Channel> channels;
    for (std::uint32_t channel = 0; channel < topics_.size(); channel++) {
        channels.push_back({channel, topics_[channel].name, topics_[channel].schema});
    }
    return channels;
}

} // namespace fledge::cosim
