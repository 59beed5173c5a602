// SPDX-License-Identifier: Apache-2.0
#include "cosim/tools/exchange_record.h"

#include "cosim/protocol/words.h"

#include <algorithm>
#include <tuple>

namespace fledge::cosim {

namespace {

constexpr std::size_t room = 1024; ///< for topics that come with later epochs

std::string hexadecimal(std::span<const std::byte> bytes)
{
    constexpr char digits[] = "0123456789abcdef";
    std::string text;
    for (const std::byte b : bytes) {
        text += digits[std::to_integer<unsigned>(b) >> 4];
        text += digits[std::to_integer<unsigned>(b) & 15];
    }
    return text;
}

sim::Pairs pairs_of(const Exchange::Member &member)
{
    std::string rates, reads;
    for (const Rate &rate : member.rates) {
        rates += std::to_string(rate.period) + "+" + std::to_string(rate.offset) + "\n";
    }
    for (const Subscription &subscription : member.subscriptions) {
        const std::string latency(word_for(latency_words, subscription.latency));
        reads += subscription.topic + " " + latency + (subscription.optional ? " optional" : "") + "\n";
    }
    sim::Pairs pairs = {{member.name + ".present", member.present ? "1" : "0"},
                        {member.name + ".rates", rates},
                        {member.name + ".any_time", member.any_time ? "1" : "0"},
                        {member.name + ".reads", reads}};
    if (!member.names.prefix.empty()) {
        pairs.emplace_back(member.name + ".prefix", member.names.prefix);
    }
    std::string topics;
    for (const auto &[ours, of_run] : member.names.topics) {
        topics += ours + " " + of_run + "\n";
    }
    if (!topics.empty()) {
        pairs.emplace_back(member.name + ".topics", topics);
    }
    return pairs;
}

} // namespace

ExchangeRecord::ExchangeRecord(std::string path, const ControllerConfig &run)
    : path_(std::move(path)), simulation_(run.simulation), seed_(run.seed), end_(run.end)
{
}

void ExchangeRecord::began(const Exchange &exchange)
{
    if (file_) {
        settled(for_ever); // earlier messages have the old channel numbers
    } else {
        file_ = std::make_unique<sim::ArchiveFile>(path_, exchange.topics.size() + room);
    }
    std::string nodes;
    sim::Pairs pairs = {{"simulation", simulation_}, {"seed", std::to_string(seed_)}, {"end", std::to_string(end_)}};
    for (const Exchange::Member &member : exchange.members) {
        nodes += member.name + "\n";
        for (auto &pair : pairs_of(member)) {
            pairs.push_back(std::move(pair));
        }
    }
    pairs.emplace_back("nodes", nodes);
    file_->metadata(exchange.after < 0 ? "exchange" : "exchange after " + std::to_string(exchange.after), pairs);
    topics_.clear();
    for (const Exchange::Topic &topic : exchange.topics) {
        if (topic.writer.empty()) {
            topics_.push_back({});
            continue;
        }
        auto it = known_.find(topic.name);
        if (it == known_.end()) {
            const auto channel =
                file_->add_channel(topic.name, topic.schema.name, topic.schema.text,
                                   {{"writer", topic.writer}, {"initial", hexadecimal(topic.initial)}});
            it = known_.emplace(topic.name, Topic{channel, parse_schema(topic.schema.text), topic.schema.size}).first;
        }
        topics_.push_back(it->second);
    }
}

void ExchangeRecord::wrote(const std::string &, const std::vector<Record> &records)
{
    for (const Record &record : records) {
        pending_.push_back({record.t, record.channel, record.count, record.payload});
    }
}

void ExchangeRecord::settled(Ns t)
{
    settled_ = std::max(settled_, t);
    const auto later = std::partition(pending_.begin(), pending_.end(), [&](const Pending &p) { return p.t <= t; });
    std::sort(pending_.begin(), later, [](const Pending &a, const Pending &b) {
        return std::tie(a.t, a.channel, a.count) < std::tie(b.t, b.channel, b.count);
    });
    for (auto it = pending_.begin(); it != later; ++it) {
        const Topic &topic = topics_.at(it->channel);
        message_.resize(topic.size);
        read_payload(it->payload, topic.fields, message_);
        file_->message(topic.channel, it->t, it->count, message_);
    }
    if (file_) {
        file_->save_if_due();
    }
    pending_.erase(pending_.begin(), later);
}

void ExchangeRecord::ended(const std::string &reason)
{
    if (file_) {
        const Ns last = reason.empty() ? end_ : settled_;
        settled(for_ever);
        file_->metadata("end", {{"reason", reason}, {"settled", std::to_string(last)}});
        file_->close();
    }
}

} // namespace fledge::cosim
