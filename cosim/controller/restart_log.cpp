// SPDX-License-Identifier: Apache-2.0
#include "cosim/controller/restart_log.h"

#include "cosim/controller/schedule.h"

#include <algorithm>

namespace fledge::cosim {

namespace {

constexpr std::size_t most_records = 16'384; // in one tick
constexpr std::size_t most_bytes = std::size_t{4} << 20;

std::size_t size_of(const Record &record)
{
    return sizeof record + record.payload.size();
}

} // namespace

void RestartLog::begin(Ns t)
{
    kept_ = true;
    saved_ = t;
}

void RestartLog::log_input(const std::vector<Record> &records)
{
    for (const Record &record : records) {
        input_log_.push_back(record);
        bytes_ += size_of(record);
    }
}

void RestartLog::log_output(const std::vector<Record> &records)
{
    for (const Record &record : records) {
        output_log_[record.channel].push_back(record);
        bytes_ += size_of(record);
    }
}

void RestartLog::forget_inputs_after(Ns t)
{
    std::erase_if(input_log_, [&](const Record &record) {
        bytes_ -= record.t > t ? size_of(record) : 0;
        return record.t > t;
    });
}

void RestartLog::take_snapshot(Ns t, Bytes snapshot)
{
    snapshot_ = std::move(snapshot);
    saved_ = t;
    std::erase_if(input_log_, [&](const Record &record) { return record.t <= t; });
    output_log_.clear();
    bytes_ = 0;
    for (const Record &record : input_log_) {
        bytes_ += size_of(record);
    }
}

std::vector<Record> RestartLog::repeat_until(Ns t)
{
    std::vector<Record> records;
    for (const auto &[channel, log] : output_log_) {
        for (std::size_t &n = repeated_[channel]; n < log.size() && log[n].t <= t; n++) {
            records.push_back(log[n]);
        }
    }
    return records;
}

void RestartLog::begin_replay(Ns t)
{
    replayed_ = t;
    resent_ = 0;
    repeated_.clear();
    std::stable_sort(input_log_.begin(), input_log_.end(), [](const Record &a, const Record &b) { return a.t < b.t; });
}

Tick RestartLog::next_tick(Ns reached)
{
    Tick tick{reached, {}};
    for (std::size_t bytes = 0; resent_ < input_log_.size(); resent_++) {
        const Record &record = input_log_[resent_];
        if ((tick.records.size() >= most_records || bytes > most_bytes) && record.t > tick.records.back().t) {
            tick.until = std::max(record.t - 1, replayed_ + 1);
            break;
        }
        bytes += size_of(record);
        tick.records.push_back(record);
    }
    return tick;
}

std::string RestartLog::repeat_output(const Record &record, const std::string &topic)
{
    const auto &before = output_log_[record.channel];
    std::size_t &n = repeated_[record.channel];
    if (n == before.size() || before[n].t > record.t) {
        return "it writes " + topic + " at " + when(record.t) + ", which the program before did not";
    }
    if (before[n].t < record.t) {
        return missing(topic, before[n].t);
    }
    if (before[n].payload != record.payload) {
        return topic + " at " + when(record.t) + " differs from the value before";
    }
    n++;
    return "";
}

std::string RestartLog::missing(const std::string &topic, Ns t)
{
    return "it does not write " + topic + " at " + when(t) + ", but the program before did";
}

} // namespace fledge::cosim
