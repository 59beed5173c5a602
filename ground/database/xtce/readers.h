// SPDX-License-Identifier: Apache-2.0
// A reader for each concept of XTCE: it fills in the items that Declarations has declared, from their nodes.
#pragma once

#include "ground/database/xtce/declarations.h"

#include <set>

namespace fledge::ground::xtce {

inline constexpr std::uint64_t most_values = 1 << 20; // of a type; of all entries, 16 times as many

/// Reads references to values, conditions, and numbers that follow from values.
class ValueReader {
public:
    ValueReader(Database &database, Declarations &declared) : db_(database), declared_(declared) {}

    Reference reference(Node node) const;

    /// The condition that is the only child of a node; and a condition's own node.
    Condition condition(Node node);
    Condition condition_of(Node node, std::size_t depth = 0);
    static bool is_condition(Node node)
    {
        return one_of(tag(node), {"Comparison", "ComparisonList", "BooleanExpression"});
    }
    Quantity quantity(Node node);
    std::vector<Dimension> dimensions(Node node);

    /// Note constants that no value of a parameter or an argument equals, once all types and commands are complete.
    void note_constants();

    std::set<std::string> members; ///< a reference may name one of these members of the same aggregate
    bool outside = false;          ///< a reference may mean a value of another program

private:
    std::optional<Reference> parameter(Node node, const std::string &text) const;
    void add_steps(Reference &to, Node node, View steps) const;
    std::set<Id> argument_types(Node node, const std::string &name, std::size_t &looked) const;
    Condition comparison(Node node) const;
    Condition two_values(Node node) const;

    Database &db_;
    Declarations &declared_;
    std::vector<std::pair<Node, Condition>> comparisons_; ///< with constants
    std::unordered_map<const void *, Id> commands_;       ///< by their nodes
    std::map<std::string, std::set<Id>> arguments_;       ///< the types of all of a name
};

/// Shared by the readers of items.
struct Context {
    Database &db_;
    Declarations &declared_;
    ValueReader &values_;
};

/// Reads the encodings of values in packets, and their calibrators.
class EncodingReader : Context {
public:
    explicit EncodingReader(const Context &context) : Context(context) {}

    Encoding encoding(Node node);

private:
    void part(Encoding &encoding, Node node);
    void string_size(Encoding &encoding, Node node, bool text);
    Calibrator calibrator(Node node);
    void math(Calibrator &calibrator, Node node);
};

Range range(Node node);

class AlarmReader : Context {
public:
    explicit AlarmReader(const Context &context) : Context(context) {}

    Alarm alarm(Node node);
};

class TypeReader : Context {
public:
    explicit TypeReader(const Context &context) : Context(context), encodings_(context), alarms_(context) {}

    /// Read the sort, the members and the element of each type, after those of its base.
    void read_structures();
    void fill();

    /// Give the times that count from other times the epoch of these.
    void find_epochs();

    /// Refuse a type that packets cannot have: without a size, or with more values than a packet.
    void need_encoding(Node node, Id id);

    /// The number of values of a type, and of an array if its dimensions are fixed.
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
    void add_alarm(Type &type, Node node);
    void time_encoding(Type &type, Node node);
    void reference_time(Type &type, Node node);
    std::optional<Epoch> epoch_before(Id id, std::size_t depth) const;

    EncodingReader encodings_;
    AlarmReader alarms_;
    std::map<Id, Id> bases_;
    std::vector<std::uint64_t> n_values_;
    std::vector<bool> encoded_; ///< types that have an encoding
};

class ContainerReader : Context {
public:
    ContainerReader(const Context &context, TypeReader &types) : Context(context), types_(types) {}

    void fill();
    void refuse_loops();

    /// The standard counts from the end of a container to the end of an entry; some authors count to its begin. Refuse
    /// a database in which no entry reaches the container's end, although one would if begins were meant.
    void refuse_doubtful_ends();

private:
    void fill(Container &container, Node node);
    void base(Container &container, Node node);
    Entry entry(Node node);
    void begin_entry(Entry &entry, Node node);
    void part(Entry &entry, Node node);

    TypeReader &types_;
    std::uint64_t n_values_ = 0; ///< of all entries
};

class CommandReader : Context {
public:
    explicit CommandReader(const Context &context) : Context(context) {}

    void fill();
    void refuse_loops();

private:
    void part(Id id, Node node);
    Constraint constraint(Node node);
    Verifier verifier(Node node);
    void window(Verifier &verifier, Node node);
};

} // namespace fledge::ground::xtce
