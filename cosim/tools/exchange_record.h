// SPDX-License-Identifier: Apache-2.0
// The exchange as an archive: a topic for each message that passes between nodes, at the times of
// writing, and what it takes to say the same to one of them once more (replay.h).
//
// The metadata "exchange" holds simulation, seed, end [ns], and of each node NAME.present (0 or
// 1), NAME.rates ("period+offset", one per line), NAME.any_time, NAME.reads ("topic latency", one per line;
// "optional" may follow). After an epoch they come again under "exchange after T". A topic's metadata
// are its writer and its initial value (payload in hexadecimal digits). "end" holds the reason.
#pragma once

#include "cosim/controller/run_listener.h"
#include "sim/archive_file.h"

#include <map>
#include <memory>
#include <string>

namespace fledge::cosim {

class ExchangeRecord final : public Witness {
public:
    /// The file appears when the nodes are matched, under its name when the run is over.
    ExchangeRecord(std::string path, const ControllerConfig &run);

    // These throw RunError if the file cannot be written.
    void began(const Exchange &exchange) override;
    void wrote(const std::string &node, const std::vector<Record> &records) override;
    void settled(Ns t) override;
    void ended(const std::string &reason) override;

private:
    struct Topic {
        std::uint16_t channel; ///< in the file
        std::vector<SchemaField> fields;
        std::size_t size;
    };

    /// Which node answers first is chance: messages wait until they can stand in the order of their
    /// times, so that the same run gives the same bytes.
    struct Pending {
        Ns t;
        std::uint32_t channel; ///< of the exchange
        std::uint32_t count;
        Bytes payload;
    };

    std::string path_, simulation_;
    std::uint64_t seed_;
    Ns end_;
    std::unique_ptr<sim::ArchiveFile> file_;
    std::map<std::string, Topic> known_; ///< by name: one that comes again stays in its channel
    std::vector<Topic> topics_;          ///< by channel of the exchange
    std::vector<Pending> pending_;
    std::vector<std::byte> message_;
};

} // namespace fledge::cosim
