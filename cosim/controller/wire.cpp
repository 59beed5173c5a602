// SPDX-License-Identifier: Apache-2.0
#include "cosim/controller/wire.h"

#include <algorithm>

namespace fledge::cosim {

void Wire::lay(NodeId writer, Latency latency, Ns exchange, Ns boundary, Payload first)
{
    from = writer;
    latency_ = latency;
    exchange_ = exchange;
    delivered_ = 0;
    pending_.clear();
    pending_.push_back({boundary + 1, std::move(first)});
}

Ns Wire::first_seen(Ns t) const
{
    return latency_ == Latency::same_instant   ? t
           : latency_ == Latency::next_instant ? t + 1
                                               : (t + exchange_ - 1) / exchange_ * exchange_ + 1;
}

Ns Wire::known_until(Ns first_write) const
{
    if (first_write == for_ever) {
        return for_ever;
    }
    if (latency_ == Latency::next_exchange) {
        const Ns exchanges = first_write > 0 ? (first_write - 1) / exchange_ : -1;
        return (exchanges + 1) * exchange_;
    }
    return latency_ == Latency::same_instant ? first_write - 1 : first_write;
}

Ns Wire::earliest_write(Ns granted, const Schedule &reader) const
{
    Ns seen = granted; // the reader must see the new message later than this
    if (pending_.size() > delivered_) {
        const Ns before = std::max(pending_.back().t, seen + 1);
        seen = reader.any_time ? before : std::max(seen, reader.next_after(before - 1));
    }
    switch (latency_) {
    case Latency::next_instant: return std::max(seen, Ns{0});
    case Latency::next_exchange: return seen <= 0 ? 0 : ((seen + exchange_ - 1) / exchange_ - 1) * exchange_ + 1;
    default: return seen + 1;
    }
}

void Wire::push(Ns written, const Payload &payload, const Schedule &reader)
{
    const Ns seen = first_seen(written);
    while (pending_.size() > delivered_) {
        const Ns before = pending_.back().t;
        if (before < seen && (reader.any_time || reader.next_after(before - 1) < seen)) {
            break;
        }
        pending_.pop_back();
    }
    pending_.push_back({seen, payload});
}

std::size_t Wire::count_deliverable(Ns until) const
{
    const auto next = pending_.begin() + static_cast<std::ptrdiff_t>(delivered_);
    const auto later = [](Ns t, const TimedPayload &message) { return t < message.t; };
    return static_cast<std::size_t>(std::upper_bound(next, pending_.end(), until, later) - next);
}

void Wire::deliver(Ns until, std::vector<Record> &records)
{
    for (std::size_t n = count_deliverable(until); n; n--, delivered_++) {
        records.push_back({channel, ++count_, pending_[delivered_].t, pending_[delivered_].payload});
    }
}

void Wire::pass(Ns t)
{
    while (delivered_ && pending_.front().t <= t) {
        last_ = std::move(pending_.front().payload);
        pending_.pop_front();
        delivered_--;
    }
}

void Wire::restart()
{
    delivered_ = 0;
    count_ = 0;
}

void Wire::resend_last(Ns reached)
{
    if (!last_.empty() && (pending_.empty() || pending_.front().t > reached)) {
        pending_.push_front({reached, last_});
    }
}

void Wire::empty()
{
    last_ = latest();
    pending_.clear();
    delivered_ = 0;
}

} // namespace fledge::cosim
