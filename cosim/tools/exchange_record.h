// SPDX-License-Identifier: Apache-2.0
// The exchange as an archive: a topic for each message between nodes, at the times of writing, and all that replay.h
// needs to run one node again.
//
// The metadata "exchange" holds simulation, seed, end [ns], and of each node NAME.present (0 or
// 1), NAME.rates ("period+offset", one per line), NAME.any_time, NAME.reads ("topic latency", one per line;
// "optional" may follow). After an epoch they come again under "exchange after T". A topic's metadata
// are its writer and its initial value (payload in hexadecimal digits). "end" holds the reason, and under "settled" the
// last instant [ns] up to which all messages are there.
//
// Example:
//
//     #include "cosim/router/router.h"
//     using namespace cosim;
//     void listen(const ControllerConfig &run, RouterConfig &router)
//     {
//         static ExchangeRecord record("exchange.mcap", run);
//         router.listeners.push_back(&record);
//     }
#pragma once

#include "cosim/controller/config.h"
#include "cosim/controller/run_listener.h"
#include "sim/archive_file.h"

#include <map>
#include <memory>
#include <string>

namespace fledge::cosim {

class ExchangeRecord final : public RunListener {
public:
    /// It creates the file when the nodes are matched, and gives it its name when the run is over.
    ExchangeRecord(std::string path, const ControllerConfig &run);

    // These throw RunError if the file cannot be written.
    void began(const Exchange &exchange) override;
    void wrote(const std::string &node, const std::vector<Record> &records) override;
    void settled(Ns t) override;
    /// A run that goes on from snapshots needs the messages until then.
    void kept(Ns, const std::vector<NodeSnapshot> &) override { file_->save(); }
    void ended(const std::string &reason) override;

private:
    struct Topic {
        std::uint16_t channel; ///< in the file
        std::vector<SchemaField> fields;
        std::size_t size;
    };

    /// The order of replies is random: messages wait until the record can write them in the order of their times, so
    /// that the same run gives the same bytes.
    struct Pending {
        Ns t;
        std::uint32_t channel; ///< of the exchange
        std::uint32_t count;
        Payload payload;
    };

    std::string path_, simulation_;
    std::uint64_t seed_;
    Ns end_;
    Ns settled_ = -1;
    std::unique_ptr<sim::ArchiveFile> file_;
    std::map<std::string, Topic> known_; ///< by name: a topic stays in its channel
    std::vector<Topic> topics_;          ///< by channel of the exchange
    std::vector<Pending> pending_;
    std::vector<std::byte> message_;
};

} // namespace fledge::cosim
