// SPDX-License-Identifier: Apache-2.0
#include "cosim/tools/replay.h"

#include <algorithm>
#include <stdexcept>

namespace fledge::cosim {

namespace {

constexpr const char *listener = "the record"; // as a fault names it: "the record subscribes to ..."

ControllerConfig controller_of(const ReplayConfig &config)
{
    ControllerConfig controller;
    controller.simulation = config.simulation;
    controller.seed = config.seed;
    controller.end = config.end;
    controller.nodes = {{config.node, Policy::abort}, {listener, Policy::abort}};
    controller.nodes.front().names = config.names;
    for (const Part &part : config.others) {
        controller.nodes.push_back({part.node, Policy::abort});
        for (const Part::Topic &topic : part.topics) {
            if (topic.times.size() != topic.payloads.size() ||
                !std::is_sorted(topic.times.begin(), topic.times.end(), std::less_equal<>())) {
                throw std::invalid_argument(part.node + " writes " + topic.name +
                                            " at times that do not ascend, or that are not as many as its messages");
            }
        }
    }
    return controller;
}

/// All inputs are known, so a node could run to the end at once, in one reply: it takes many instead.
RouterConfig recording(RouterConfig config, RunListener &record, Ns end)
{
    config.listeners.push_back(&record);
    config.window = std::max<Ns>(1, end / 1024);
    return config;
}

} // namespace

std::vector<Publication> Player::match(const std::vector<Channel> &channels)
{
    published_.clear();
    std::vector<Publication> publications;
    for (const Channel &channel : channels) {
        for (std::size_t i = 0; i < part_.topics.size(); i++) {
            if (part_.topics[i].name == channel.topic) {
                published_.emplace_back(channel.channel, i);
                publications.push_back({channel.channel, part_.topics[i].schema, part_.topics[i].initial});
            }
        }
    }
    return publications;
}

Tock Player::tick(const Tick &tick)
{
    Tock tock;
    tock.reached = tick.until;
    for (const auto &[channel, i] : published_) {
        const Part::Topic &topic = part_.topics[i];
        for (std::size_t &k = next_[i]; k < topic.times.size() && topic.times[k] <= tick.until; k++) {
            tock.records.push_back({channel, static_cast<std::uint32_t>(k + 1), topic.times[k], topic.payloads[k]});
        }
    }
    return tock;
}

std::vector<Subscription> Listener::desired()
{
    std::vector<Subscription> subscriptions;
    for (const std::string &topic : topics_) {
        subscriptions.push_back({topic, Latency::same_instant, false, {}});
    }
    return subscriptions;
}

Replay::Replay(zmq::context_t &context, ReplayConfig config, RouterConfig router)
    : config_(std::move(config)), listener_(config_.topics), players_(config_.others.begin(), config_.others.end()),
      record_(config_.record, controller_of(config_)),
      router_(context, controller_of(config_), recording(std::move(router), record_, config_.end))
{
    router_.host(listener, listener_);
    for (std::size_t i = 0; i < players_.size(); i++) {
        router_.host(config_.others[i].node, players_[i]);
    }
}

} // namespace fledge::cosim
