// SPDX-License-Identifier: Apache-2.0
// A reader for each concept of XTCE. Each fills in what Declarations has declared, from its node.
#pragma once

#include "ground/database/xtce/declarations.h"

#include <set>

namespace fledge::ground::xtce {

inline constexpr std::uint64_t most_values = 1 << 20; // of a type; of all entries, 16 times as many

/// References to values, conditions of them, and numbers that they give.
class ValueReader {
public:
    ValueReader(Database &database, const Declarations &declared) : db_(database), declared_(declared) {}

    Reference reference(Node node) const;

    /// The condition that a node holds, and nothing else.
    Condition condition(Node node) const;
    Condition one_condition(Node node, std::size_t depth = 0) const;
    static bool is_condition(Node node)
    {
        return one_of(tag(node), {"Comparison", "ComparisonList", "BooleanExpression"});
    }
    Quantity quantity(Node node) const;
    std::vector<Dimension> dimensions(Node node) const;

    std::set<std::string> members; ///< a reference may name a member beside it
    bool outside = false;          ///< a reference may lead to what another program knows

private:
    std::optional<Reference> parameter(Node node, const std::string &text) const;
    void add_steps(Reference &to, Node node, View steps) const;
    Condition comparison(Node node) const;
    Condition two_values(Node node) const;

    Database &db_;
    const Declarations &declared_;
};

/// How values lie in packets, and their calibrators.
class EncodingReader {
public:
    EncodingReader(Declarations &declared, const ValueReader &values) : declared_(declared), values_(values) {}

    Encoding encoding(Node node);

private:
    void part(Encoding &encoding, Node node);
    void string_size(Encoding &encoding, Node node, bool text);
    Calibrator calibrator(Node node);
    void math(Calibrator &calibrator, Node node);

    Declarations &declared_;
    const ValueReader &values_;
};

Range range(Node node);

class AlarmReader {
public:
    AlarmReader(Declarations &declared, const ValueReader &values) : declared_(declared), values_(values) {}

    Alarm alarm(Node node);

private:
    Declarations &declared_;
    const ValueReader &values_;
};

class TypeReader {
public:
    TypeReader(Database &database, Declarations &declared, ValueReader &values)
        : db_(database), declared_(declared), values_(values), encodings_(declared, values), alarms_(declared, values)
    {
    }

    /// The sort, the members and the element of each type, after those of its base.
    void read_structures();
    void fill();

    /// What stands in a packet has a size, and not more values than a packet.
    void need_encoding(Node node, Id id);

    /// How many values a type has, and how many an array, if its dimensions are fixed.
    std::uint64_t n_values(Id id) const { return n_values_[id]; }
    std::uint64_t n_values(Node node, Id element, const std::vector<Dimension> &dimensions) const;

private:
    void structure(Id id, std::size_t depth);
    void read_structure(Id id, std::size_t depth);
    void inherit_structure(Id id, std::size_t depth);
    void read_members(Type &type, Node node);
    void fill(Id id);
    void inherit(Id id, Id base);
    void part(Type &type, Node node);
    void time_encoding(Type &type, Node node);
    void reference_time(Type &type, Node node);

    Database &db_;
    Declarations &declared_;
    ValueReader &values_;
    EncodingReader encodings_;
    AlarmReader alarms_;
    std::map<Id, Id> bases_;
    std::vector<std::uint64_t> n_values_;
    std::vector<bool> encoded_; ///< types that have an encoding
};

class ContainerReader {
public:
    ContainerReader(Database &database, Declarations &declared, const ValueReader &values, TypeReader &types)
        : db_(database), declared_(declared), values_(values), types_(types)
    {
    }

    void fill();
    void refuse_loops();

    /// The standard counts from the end of a container to the end of an entry; others write where the entry begins. A
    /// database whose entries never reach the end, unless begins are meant, may mean either.
    void refuse_doubtful_ends();

private:
    void fill(Container &container, Node node);
    void base(Container &container, Node node);
    Entry entry(Node node);
    void begin_entry(Entry &entry, Node node);
    void part(Entry &entry, Node node);

    Database &db_;
    Declarations &declared_;
    const ValueReader &values_;
    TypeReader &types_;
    std::uint64_t n_values_ = 0; ///< of all entries
};

class CommandReader {
public:
    CommandReader(Database &database, Declarations &declared, ValueReader &values)
        : db_(database), declared_(declared), values_(values)
    {
    }

    void fill();
    void refuse_loops();

private:
    void part(Id id, Node node);
    Verifier verifier(Node node);
    void window(Verifier &verifier, Node node);

    Database &db_;
    Declarations &declared_;
    ValueReader &values_;
};

} // namespace fledge::ground::xtce
