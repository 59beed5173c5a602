// SPDX-License-Identifier: Apache-2.0
// Packets to values, by a database: one decoder for live telemetry, archives, replays and exports.
//
// A packet has the most derived container whose restrictions hold: the search begins at a root and tries the heirs of
// each container in the order of their declaration; an abstract container needs an heir that fits. A container whose
// places are all fixed has a plan, a few loops over its bytes; others are decoded entry by entry. Both give the same
// values, in the order of the entries.
//
// A reference means the value in this packet. If there is none, and it does not stand in a restriction, it means the
// last value of an earlier packet, or else the parameter's initial value.
#pragma once

#include "ground/database/calibrate.h"
#include "ground/database/operand.h"

#include <memory>
#include <optional>
#include <span>
#include <unordered_map>

namespace fledge::ground {

/// A step from a parameter into its members and elements; node 0 is the parameter itself.
struct PathNode {
    std::uint32_t parent;
    std::uint32_t place; ///< of the member, or of the element
    Id type;             ///< of the aggregate or array
};

/// A value's parameter, type and kinds.
struct Field {
    Id parameter;
    Id type;
    std::uint32_t node;
    Kind raw, value;
};

/// An array without elements; node: the step that leads to it.
struct EmptyArray {
    std::size_t before; ///< this field of the packet
    Id parameter;
    std::uint32_t node;
};

enum class Status : std::uint8_t {
    good,
    uncalibrated, ///< there is only a raw value, outside of what its calibrator, epoch or number covers
    unlabelled,   ///< there is only a raw value, which no enumerator has
    malformed     ///< its encoding does not have such bits, as a BCD digit beyond 9
};

/// The kind of a type's values.
Kind value_kind(const Type &type);

/// A value as a number: a time in seconds, an enumerator's raw value. NaN: there is none.
inline double number(Kind value_kind, std::uint64_t value, Kind raw_kind, std::uint64_t raw, Status status)
{
    const bool none = status == Status::uncalibrated || status == Status::malformed;
    const auto found = value_kind == Kind::label ? real_of(raw_kind, raw) : real_of(value_kind, value);
    return none ? std::numeric_limits<double>::quiet_NaN() : found.value_or(std::numeric_limits<double>::quiet_NaN());
}

/// Bits of a packet.
struct Bits {
    std::size_t at, n;
};

/// A packet that was decoded; valid until the decoder decodes the next.
struct Decoded {
    Id container = no_id; ///< no_id: none fits
    Id nearest = no_id;   ///< then: the container that came nearest
    std::string reason;   ///< why values are missing; empty: the packet is whole
    std::span<const Field> fields;
    std::span<const PathNode> nodes;
    std::span<const EmptyArray> empty;
    std::span<const std::uint64_t> raw, values; ///< of each field, by its kinds; real: std::bit_cast<double>
    std::span<const Status> status;
    std::span<const std::uint8_t> bytes; ///< of texts and binary values
    std::size_t bits = 0;                ///< of the packet, up to the end of the last entry
    bool planned = false;                ///< fields and nodes are the same in every planned packet of this container
    std::span<const Bits> places;        ///< of each field; empty if the decoder has plans
    std::optional<std::size_t> stopped;  ///< [bits] where the entry or comparison is that failed; not with plans

    /// The bytes of a text or a binary value.
    std::string_view text(std::uint64_t slice) const
    {
        return {reinterpret_cast<const char *>(bytes.data()) + (slice >> 32), slice & 0xFFFFFFFF};
    }
};

/// The name of a field behind its parameter's name: "", ".member[3]".
std::string suffix(const Database &database, const Decoded &packet, std::size_t field);

class Decoder {
public:
    /// The database must outlive the decoder. plans: false decodes all entry by entry, and fills in Decoded::places.
    explicit Decoder(const Database &database, bool plans = true);
    ~Decoder();

    /// Decode a packet. root: the container of all packets; no_id: each container that extends none but is extended,
    /// or, if there are none, each that no other contains.
    const Decoded &decode(std::span<const std::uint8_t> packet, Id root = no_id);

    /// "parameter", "parameter.member[3]".
    std::string name(const Decoded &packet, std::size_t field) const
    {
        return db_.parameters[packet.fields[field].parameter].name + suffix(db_, packet, field);
    }

    /// Whether a condition of the database, as of an alarm, holds for the newest values.
    bool applies(const Condition &condition);

    /// Whether it holds; nothing: that depends on a value that no packet had.
    std::optional<bool> judge(const Condition &condition);

    /// The comparisons that do not hold or are not known, with the newest values.
    std::string failing(const Condition &condition);

    /// The newest value of a reference as a number, if it is one, and as text.
    std::optional<Number> number(const Reference &reference);
    std::string words(const Reference &reference);

    /// Copy the values of earlier packets from another decoder of the same database.
    void remember(const Decoder &other);

    std::span<const Id> roots() const { return roots_; }

private:
    struct Plan;
    struct Walk;
    struct Labels;
    struct Held;
    enum class Outcome : std::uint8_t { matched, unmatched, broken };

    void hold_references();
    void find_roots();
    static Labels labels_of(const Type &type);
    void keep_held();

    const Plan &plan_of(Id container);
    void make_plan(Plan &plan, Id container);
    bool lay_entries(Plan &plan, Id container, std::size_t &at, std::size_t start);
    bool lay(Plan &plan, Id parameter, Id type, std::uint32_t node, std::size_t &at,
             const std::vector<Dimension> *dimensions);
    void join_steps(Plan &plan) const;
    std::optional<std::pair<std::size_t, std::uint64_t>> key(const Plan &plan, const Condition &condition) const;
    void dispatch(Plan &plan, const Container &container) const;
    std::size_t decode_planned(const Plan &plan);
    Id planned(Id container, std::size_t bits);
    bool by_more_than_numbers(const Plan &plan, const Condition &condition) const;
    bool holds_planned(const Plan &plan, const Condition &condition) const;
    void run(const Plan &plan);

    Outcome attempt(Id container, Walk walk, std::size_t depth, bool included);
    bool entries(Id container, Walk &walk);
    bool entry(const Entry &entry, Walk &walk);
    bool once(const Entry &entry, Walk &walk);
    bool take(Id parameter, Id type, std::uint32_t node, Walk &walk, const std::vector<Dimension> *dimensions);
    std::optional<std::size_t> elements(const std::vector<Dimension> &dimensions);
    std::optional<std::int64_t> size(Id type, const std::vector<Dimension> &dimensions);
    bool take_text(const Type &type, Walk &walk, std::uint64_t &raw, std::uint64_t &value, Status &status);
    bool take_binary(const Type &type, Walk &walk, std::uint64_t &raw, std::uint64_t &value);
    bool broken(std::string reason);
    void explain(Id container, std::size_t depth);
    std::string failing(const Condition &condition, std::optional<std::size_t> &at, bool earlier);
    bool spend(std::size_t effort);
    std::uint64_t copy(std::size_t bit, std::size_t bits);

    bool refers(const Type &type) const;
    Status convert(const Type &type, Kind kind, std::uint64_t raw, std::uint64_t &value);
    std::optional<Status> convert_text(const Type &type, Kind &kind, std::uint64_t &raw, std::uint64_t &value) const;
    Status convert_time(const Type &type, const Number &number, std::uint64_t &value);
    std::optional<Operand> find(const Reference &reference, bool earlier);
    bool leads(const Reference &reference, std::span<const PathNode> nodes, std::uint32_t node) const;
    bool holds(const Condition &condition, bool earlier);
    std::string_view text_of(std::uint64_t word) const;
    std::optional<std::int64_t> number(const Quantity &quantity);
    std::optional<std::int64_t> size_at(const Quantity &quantity, std::size_t at);
    const Labels &labels(Id type) const { return *labels_[type]; }
    std::uint64_t label(const Type &type, const Number &raw) const;
    void hold(const Condition &condition);
    void hold(const Quantity &quantity);
    void hold(const Reference &reference);
    void keep(std::size_t field, std::uint32_t slot);

    const Database &db_;
    const bool plans_on_;
    std::vector<Id> roots_;
    std::vector<std::unique_ptr<Plan>> plans_;
    std::vector<std::unique_ptr<Labels>> labels_; ///< of each type with enumerators
    std::size_t planned_fields_ = 0, laid_ = 0;
    std::vector<Held> held_;                                   ///< values of earlier packets that others refer to
    std::unordered_map<Id, std::vector<std::uint32_t>> slots_; ///< of each parameter, in held_

    Decoded packet_;
    std::vector<std::uint8_t> bytes_; ///< the packet, 16 zeros, and texts
    std::size_t used_ = 0, n_bits_ = 0, effort_ = 0, depth_ = 0, best_ = 0;
    std::vector<Field> fields_;
    std::vector<PathNode> nodes_;
    std::vector<EmptyArray> empty_;
    std::vector<Bits> places_;
    std::vector<std::uint64_t> raw_, values_;
    std::vector<Status> status_;
    bool broken_ = false; ///< the packet's reason says where it ends early or cannot be decoded further
    Id found_ = no_id;
    std::size_t end_ = 0;
};

} // namespace fledge::ground
