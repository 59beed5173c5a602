// SPDX-License-Identifier: Apache-2.0
// The live telemetry of a spacecraft: decodes packets by a database, keeps the newest values and checks their limits.
// The monitor decodes a batch of packets, and the archive saves it; then any thread can read the values.
//
// Example:
//
//     using namespace ground;
//     void watch(const Database &database, std::span<const Arrival> batch)
//     {
//         Monitor monitor(database);
//         for (const Note &note : monitor.take(batch)) {
//             if (note.kind == Note::Kind::concern && note.now >= Concern::warning) {
//                 std::puts(monitor.slot(note.slot).name.c_str());
//             }
//         }
//     }
#pragma once

#include "ground/monitor/arrival.h"
#include "ground/monitor/limits.h"
#include "ground/monitor/slots.h"

#include <memory>
#include <mutex>

namespace fledge::ground {

/// The newest value of a slot.
struct Newest {
    std::int64_t t = 0, received = 0;
    std::uint64_t raw = 0, value = 0; ///< words of their kinds; texts and bytes are stored apart
    std::uint64_t count = 0;          ///< of values so far
    std::uint64_t version = 0;        ///< of the batch that had it
    Kind raw_kind = Kind::none;
    Status status = Status::good;
    Concern concern = Concern::normal;
    std::uint32_t text = no_id; ///< place of its text or bytes
};

/// An event in a batch.
struct Note {
    enum class Kind : std::uint8_t {
        concern,   ///< of a slot, after persistence
        undecoded, ///< a packet; text: the reason
        watched,   ///< a packet of a watched container
        verified,  ///< a packet fulfils the verifier numbered `slot`; text: what the verifier returns
        slots,     ///< there are new slots, from `slot` on
        full,      ///< there are `Slots::most` slots, and values without one
        archive    ///< text: why it does not store packets; empty: it does again
    };
    Kind kind;
    std::uint32_t slot = no_id;
    std::int64_t t = 0;
    Concern old = Concern::normal, now = Concern::normal;
    std::size_t packet = 0; ///< place in the batch
    Id container = no_id;
    std::string text{};
};

/// A frame of values for a browser, little-endian: 32 bytes (u32 "FLD1", u32 the spacecraft, 0 here, u64 version,
/// i64 the newest t, u32 n, u32 bytes of texts); n rows of 24 bytes (u32 slot, u8 concern, u8 status, u16 0, i64 t,
/// u64 value); texts. The value of a label is the enumerator's place, or the raw value if the status is unlabelled; the
/// value of texts and bytes is (place in the texts) << 32 | size.
struct Frame {
    std::uint64_t version;
    std::string bytes;
};

class Monitor {
public:
    /// The database must outlive the monitor. root: of all packets, as for the decoder.
    explicit Monitor(const Database &database, Id root = no_id);
    ~Monitor();

    /// Set the archive that stores the packets; nullptr: none.
    void sink(PacketSink *sink);

    /// Decode, archive and save a batch, then publish its values. Batches of several threads follow each other.
    std::vector<Note> take(std::span<const Arrival> batch);

    /// Return a note for each packet of these containers and of those that extend them.
    void watch(std::span<const Id> containers);

    /// Return a note for each packet that fulfils a verifier of a command; `verifier` is its place in
    /// Database::verifiers. Returns the number that these notes have. A packet must have at least one parameter of the
    /// condition; the others have their earlier values. arguments: as text. Throws Refusal if the condition cannot be
    /// computed.
    std::uint32_t expect(Id command, std::size_t verifier, const std::map<std::string, std::string> &arguments);
    void forget(std::uint32_t number);

    /// A constraint of a command by the newest values.
    struct Judged {
        const Constraint *constraint;
        std::optional<bool> holds; ///< nothing: it cannot be judged
        std::string text;          ///< what does not hold or is not known, with the values; empty if it holds
    };
    /// The constraints of a command, in the order of Database::constraints. arguments: as text.
    std::vector<Judged> judge(Id command, const std::map<std::string, std::string> &arguments);

    struct Shown {
        Newest newest;
        std::string raw, value; ///< of texts and bytes
    };
    std::optional<Shown> newest(std::uint32_t slot) const;
    /// The slots that have no value yet: (first, last) of each stretch.
    std::vector<std::pair<std::uint32_t, std::uint32_t>> missing() const;
    std::uint64_t version() const;
    Slot slot(std::uint32_t slot) const;
    /// The values that are newer than a version; slots: only of these.
    Frame changes(std::uint64_t since, std::optional<std::span<const std::uint32_t>> slots) const;

    std::uint32_t find(const std::string &name) const;
    struct Described {
        Slot slot;
        Bands limits; ///< the static limits that have no condition
        std::uint32_t persistence;
        std::optional<Bands> replaced; ///< the limits of the database, if others are in force
    };
    std::vector<Described> slots(std::uint32_t first, std::uint32_t most = no_id) const;

    /// Replace the limits of the database; nullopt: restore them. A value outside of a level's band has that level. The
    /// newest value is judged at once. Throws Refusal if the low end of a band is above its high end.
    std::vector<Note> set_limits(std::uint32_t slot, const std::optional<Bands> &limits, std::uint32_t persistence);

    /// Write a row of these slots' numbers for each packet that has one of them, once all slots have a value.
    std::uint32_t trigger(std::vector<std::uint32_t> inputs);
    /// The rows since the last call, 8 bytes each: int64 t, then the doubles.
    std::vector<std::uint64_t> rows(std::uint32_t trigger);

    /// Add a slot whose numbers `put` sets.
    std::uint32_t derive(const std::string &name, const std::string &unit, const std::string &description,
                         const Bands &limits, std::uint32_t persistence);
    std::vector<Note> put(std::uint32_t slot, std::span<const std::int64_t> t, std::span<const double> values);

    /// Copy the parameters of earlier packets to another decoder.
    void lend(Decoder &decoder) const;

private:
    struct Live;
    struct Trigger;
    struct Expected;
    struct Texts {
        std::string raw, value;
    };

    void grow();
    void arm(std::uint32_t slot);
    void apply(const Decoded &packet, const Arrival &arrival, std::vector<Note> &notes);
    void keep(std::uint32_t slot, Live &live, Kind kind, Newest &next, const Decoded *packet, std::vector<Note> &notes);
    void judge(std::uint32_t slot, Kind kind, Newest &next, const Decoded *packet, std::vector<Note> &notes);
    void write_rows(std::int64_t t);
    void verify(const Decoded &packet, std::int64_t t, std::vector<Note> &notes);
    void publish(std::int64_t t, std::vector<Note> &notes);
    void check(std::uint32_t slot) const;

    const Database &db_;
    const Id root_;
    Decoder decoder_;

    // The thread that calls take() uses these; it holds taking_ until the archive has saved the batch.
    mutable std::mutex taking_;
    PacketSink *sink_ = nullptr;
    std::string problem_; ///< of the archive
    bool full_ = false;
    std::int64_t received_ = 0; ///< [ns] of the newest packet
    std::vector<Live> live_;
    std::vector<Texts> live_texts_;
    std::vector<Limits::Runs> runs_;
    std::vector<std::vector<std::uint32_t>> feeds_; ///< triggers of each slot
    std::vector<std::uint32_t> touched_, fired_;
    std::vector<bool> watched_; ///< of each container
    std::map<std::uint32_t, Expected> expected_;
    std::uint32_t expectations_ = 0; ///< how many there were so far

    // Readers use these, and hold shown_ briefly. take() reads some without shown_: writing these needs both locks.
    mutable std::mutex shown_;
    Slots slots_;
    std::vector<std::shared_ptr<const Limits>> by_type_, limits_;     ///< of each slot
    std::map<std::uint32_t, std::shared_ptr<const Limits>> replaced_; ///< by set_limits
    std::vector<Newest> newest_;
    std::vector<Texts> texts_;
    std::vector<Trigger> triggers_;
    std::uint64_t version_ = 0;
    std::int64_t t_ = 0;
};

} // namespace fledge::ground
