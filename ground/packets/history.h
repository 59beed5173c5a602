// SPDX-License-Identifier: Apache-2.0
// Reads the archive of a spacecraft: its packets and their values, by the decoder of live telemetry, also while a
// program writes the archive.
//
// A query names a session, or -1: the newest one if its clock is not UTC, as in a simulation; else all sessions, where
// each lasts until the first packet of the next. Times are the spacecraft's [ns], both ends inclusive. Values are
// numbers: a boolean is 0 or 1, a label is its raw value, a time is in seconds; NaN: no value.
#pragma once

#include "ground/monitor/limits.h"
#include "ground/packets/packet_file.h"

#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <tuple>

namespace fledge::ground {

class History {
public:
    struct Session {
        std::uint32_t number = 0;
        std::int64_t first = 0, last = 0;
        std::uint64_t packets = 0;
        std::string ended; ///< why; "": the session continues
        std::vector<Missing> gaps;
    };
    struct Exact { ///< a value as the decoder has it
        std::uint64_t value, raw;
        Status status;
        std::string bytes; ///< of a text or a binary value
    };
    struct Series {
        std::vector<std::int64_t> t;
        std::vector<double> value, low, high;
        std::vector<std::uint8_t> concern, worst; ///< of the last value; the worst of the bucket; all 0 without limits
        std::vector<Exact> exact;                 ///< if the query requests it
        Id type = no_id;
    };
    /// Limits that an operator has set, by the names of a query; other parameters have those of the database.
    using Settings = std::map<std::string, std::vector<Judge::Setting>>;
    struct Packet {
        std::int64_t t, received;
        std::string container; ///< its path; "": not decoded
        std::vector<std::uint8_t> bytes;
    };
    struct Query {
        std::int64_t from = 0, to = std::numeric_limits<std::int64_t>::max();
        std::int64_t session = -1;
    };

    std::uint64_t most_decoded = 4'000'000; ///< packets that a query of values may decode
    std::uint64_t most_seen = 50'000'000;   ///< values that it may read in these packets
    std::uint64_t most_values = 1'000'000;  ///< values that it may return; 64 bytes of a text count as a value

    /// folder: of the archive. root: as in Decoder::decode, "" for none.
    History(const std::string &folder, std::string craft, const Database &database, const std::string &root);

    const Database &database() const { return db_; }
    std::vector<Session> sessions();

    /// The values of parameters, or of members and elements: "parameter.member[3]", the parameter by its name in
    /// Fledge, its path or its name. points: at most so many of each, for equal buckets of time with the last, lowest
    /// and highest value in each; 0: all values. limits: nullptr judges no value; each value is judged by the limits
    /// that were in force when it was received. exact: texts and bytes too, which are no numbers. Throws Refusal.
    std::vector<Series> series(const std::vector<std::string> &names, Query query, std::size_t points,
                               const Settings *limits = nullptr, bool exact = false);

    /// A row for each packet that has one of the inputs, after each input had a value: the time (its 64 bits) and the
    /// newest value of each input, which may be older than the query.
    struct Rows {
        std::vector<double> values;
        std::vector<std::int64_t> received; ///< of each row
    };
    Rows rows(const std::vector<std::string> &inputs, Query query);

    /// At most `limit` packets of a container (its path or name; "": all packets; "undecoded"), from either end; the
    /// last packet is the one that reaches `most_bytes`.
    std::vector<Packet> packets(Query query, const std::string &container, std::size_t limit, bool backwards,
                                std::uint64_t most_bytes = UINT64_MAX);

    /// At most `limit` packets after the first `skip` packets of the query, within `span` [ns].
    std::vector<Packet> next(Query query, std::size_t skip, std::size_t limit, std::int64_t span);

private:
    using Key = std::pair<std::uint32_t, std::int64_t>; ///< session, time in the name
    struct Piece {
        PacketFile *file;
        std::int64_t from, to;
    };
    struct Target { ///< the value that a name means
        Id parameter, type;
        std::vector<std::uint32_t> steps;
    };
    /// t, received, session, packet
    using Earlier = std::tuple<std::int64_t, std::int64_t, std::uint32_t, std::vector<std::uint8_t>>;
    struct Sample { ///< a value in a packet
        Decoder &decoder;
        const Decoded &packet;
        std::size_t field, target;
        std::int64_t t, received;
        std::uint32_t session;
        bool before; ///< the query: other values depend on it
    };
    using Wanted = std::function<bool(const std::string &container)>; ///< by its path; "": not decoded
    using Visit = std::function<bool(const Stored &, const std::string &container)>;
    using Range = std::function<void(std::int64_t from, std::int64_t to)>;
    using Value = std::function<void(const Sample &)>;

    void list();
    PacketFile *opened(const Key &key);
    std::vector<Piece> pieces(const Query &query);
    void walk(std::vector<Piece> pieces, const Wanted &wanted, bool backwards, const Visit &visit);
    std::string container_of(const PacketFile &file, std::uint16_t channel) const;
    std::pair<Id, std::size_t> parameter(const std::string &name) const;
    void add_steps(Target &target, const std::string &name, std::size_t at) const;
    Target target(const std::string &name, bool numbers) const;
    std::set<Id> carriers(const std::set<Id> &parameters) const;
    std::set<Id> references(Id container) const;
    std::set<Id> needed(const std::vector<Target> &targets, const std::vector<Judge> &judges,
                        std::map<Id, std::uint32_t> &before) const;
    std::vector<Earlier> earlier(const std::map<Id, std::uint32_t> &before, const std::vector<Target> &inputs,
                                 const Query &query);
    std::pair<std::int64_t, std::int64_t> extent(const std::vector<Piece> &all, const Query &query,
                                                 const std::function<Wanted(const PacketFile &)> &wanted_of) const;
    void decode(const std::vector<Target> &targets, const std::vector<Judge> &judges, bool held, const Query &query,
                const Range &range, const Value &value, const std::function<void(const Stored &)> &packet);

    const std::string folder_, craft_;
    const Database &db_;
    const Id root_;
    std::mutex mutex_;
    std::map<Key, std::string> names_;
    std::map<Key, std::unique_ptr<PacketFile>> files_;
    std::vector<Missing> unreadable_;
};

} // namespace fledge::ground
