// SPDX-License-Identifier: Apache-2.0
#include "cosim/node/mailbox.h"

#include <algorithm>
#include <cstring>

namespace fledge::cosim {

void Inbox::open(const std::vector<Channel> &wired)
{
    counts_.clear();
    coming_.clear();
    for (const Channel &channel : wired) {
        counts_[channel.channel] = 0;
    }
}

void Inbox::take(const std::vector<Record> &records)
{
    for (const Record &record : records) {
        const auto count = counts_.find(record.channel);
        if (count == counts_.end() || record.count != ++count->second) {
            throw ProtocolError("message " + std::to_string(record.count) + " on channel " +
                                std::to_string(record.channel) + " is not the next one");
        }
        const auto later =
            std::find_if(coming_.rbegin(), coming_.rend(), [&](const Record &r) { return r.t <= record.t; });
        coming_.insert(later.base(), record);
    }
}

void Outbox::add(std::uint32_t channel, std::span<const std::byte> message)
{
    outputs_.push_back({channel, message, make_payload(message), 0});
}

void Outbox::collect(Ns t, std::vector<Record> &records)
{
    for (Output &output : outputs_) {
        if (std::memcmp(output.message.data(), output.sent.data() + cdr_header, output.message.size())) {
            output.sent = make_payload(output.message);
            records.push_back({output.channel, ++output.count, t, output.sent});
        }
    }
}

} // namespace fledge::cosim
