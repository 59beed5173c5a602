// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "cosim/protocol/protocol.h"

#include <map>

namespace fledge::cosim {

/// The data with which a new program takes the place of a lost one: the last snapshot, and all messages that the node
/// has read (the input log) and written (the output log) since. The new program gets the inputs again and has to write
/// the same outputs again.
class RestartLog {
public:
    /// Log all messages after t.
    void begin(Ns t);
    /// Log no more: no program can take the node's place.
    void drop() { *this = {}; }
    bool kept() const { return kept_; }
    std::size_t bytes() const { return bytes_; }

    void log_input(const std::vector<Record> &records);
    void log_output(const std::vector<Record> &records);
    /// All that the channel had; only of such channels are the outputs compared.
    void log_output(std::uint32_t channel, std::vector<Record> records) { output_log_[channel] = std::move(records); }
    bool has(std::uint32_t channel) const { return output_log_.contains(channel); }
    /// Delete the inputs that the node sees after t: the controller delivers them again.
    void forget_inputs_after(Ns t);
    /// The node made a snapshot at t: delete all older messages.
    void take_snapshot(Ns t, Bytes snapshot);
    Ns saved() const { return saved_; }
    const Bytes &snapshot() const { return snapshot_; }

    /// The outputs after `replayed` up to t, which count as repeated. Their counts are those of the first program.
    std::vector<Record> repeat_until(Ns t);

    // The replay to a new program.

    /// It begins after t: the snapshot, or where the lost program was.
    void begin_replay(Ns t);
    Ns replayed() const { return replayed_; }
    /// The next tick towards `reached`, which the program before had reached.
    Tick next_tick(Ns reached);
    /// The difference between a message and the one that the program before wrote; "" if they are equal.
    std::string repeat_output(const Record &record, const std::string &topic);
    /// The new program has reached t. Returns which message is missing; "" if none is.
    template <class TopicName> std::string finish_tick(Ns t, TopicName name)
    {
        for (const auto &[channel, before] : output_log_) {
            const std::size_t n = repeated_[channel];
            if (n < before.size() && before[n].t <= t) {
                return missing(name(channel), before[n].t);
            }
        }
        replayed_ = t;
        return "";
    }

private:
    static std::string missing(const std::string &topic, Ns t);

    bool kept_ = false;
    Bytes snapshot_;
    Ns saved_ = -1; ///< when the snapshot was made; without one, the node's beginning
    std::vector<Record> input_log_;
    std::map<std::uint32_t, std::vector<Record>> output_log_; ///< by channel
    std::size_t bytes_ = 0;

    Ns replayed_ = -1;
    std::size_t resent_ = 0;                        ///< inputs
    std::map<std::uint32_t, std::size_t> repeated_; ///< outputs, by channel
};

} // namespace fledge::cosim
