// SPDX-License-Identifier: Apache-2.0
// The database of a spacecraft in memory: space systems with their parameters, containers, commands and types. A reader
// fills it (xtce.h); decoder and encoder work by it. Items refer to others by their place in a list.
#pragma once

#include "ground/database/number.h"

#include <limits>
#include <stdexcept>
#include <utility>
#include <vector>

namespace fledge::ground {

using Id = std::uint32_t;
inline constexpr Id no_id = std::numeric_limits<Id>::max();

/// A fault in a database, a packet's root or a command: "file:line: reason" or a sentence.
struct Refusal : std::runtime_error {
    using std::runtime_error::runtime_error;
};

struct Place {
    std::uint32_t file = 0; ///< of Database::files
    std::uint32_t line = 0;
};

/// The properties of all named items.
struct Named {
    std::string name;
    std::string path; ///< "/System/Subsystem/name"
    std::string description;
    std::vector<std::pair<std::string, std::string>> aliases; ///< name space, alias
    Place place;
};

/// A value that is known while a packet is decoded or a command is encoded.
struct Reference {
    enum class Of : std::uint8_t {
        nothing,
        parameter,
        argument,
        rest ///< a size: the bits up to the packet's end
    };
    Of of = Of::nothing;
    bool calibrated = true;
    Id parameter = no_id;
    std::vector<std::uint32_t> steps; ///< into it: places of members and of elements
    std::string name;                 ///< of an argument, or of a member of the same aggregate
};

/// A constant of a comparison, as it is written, and as a number if it is one.
struct Literal {
    std::string text;
    std::optional<Number> number;

    Literal() = default;
    explicit Literal(std::string written) : text(std::move(written)), number(number_in(text)) {}
};

enum class Operator : std::uint8_t { equal, unequal, less, at_most, more, at_least };

/// A condition of values.
struct Condition {
    enum class Kind : std::uint8_t { always, compare, all, any };
    Kind kind = Kind::always;
    Operator op = Operator::equal;
    Reference left, right; ///< right: of nothing if `literal` is compared
    Literal literal;
    std::vector<Condition> parts; ///< of `all` and `any`
    std::string text;             ///< of a comparison, for messages
};

/// A size, a count or a place that is constant or follows from a value.
struct Quantity {
    std::int64_t fixed = 0;
    bool looked_up = false;
    Reference from; ///< of nothing: fixed
    double slope = 1, intercept = 0;
    std::vector<std::pair<Condition, std::int64_t>> cases; ///< of a lookup: the first that holds applies

    bool is_fixed() const { return !looked_up && from.of == Reference::Of::nothing; }
};

/// A step of a calculation on a stack.
struct MathStep {
    enum class Kind : std::uint8_t { number, this_value, value, function };
    Kind kind = Kind::number;
    Number number;
    Reference value;
    std::uint8_t function = 0; ///< place in math_functions
};

/// Converts a raw number. Without coefficients, points and steps there is no result.
struct Calibrator {
    enum class Kind : std::uint8_t { none, polynomial, spline, math };
    struct Point {
        double raw, calibrated;
    };
    Kind kind = Kind::none;
    std::vector<double> coefficients; ///< of a polynomial, from the constant on
    std::vector<Point> points;        ///< of a spline, ascending
    std::uint32_t order = 1;
    bool extrapolate = false;
    std::vector<MathStep> steps;
    bool refers = false; ///< to other values
};

enum class NumberForm : std::uint8_t {
    plain, ///< unsigned
    twos_complement,
    ones_complement,
    sign_magnitude,
    bcd,        ///< a digit in each byte
    packed_bcd, ///< a digit in four bits
    ieee754,
    mil1750a
};

enum class Charset : std::uint8_t {
    utf8,
    ascii,
    latin1,
    windows1252,
    utf16,
    utf16le,
    utf16be,
    utf32,
    utf32le,
    utf32be
};

/// How a value lies in a packet.
struct Encoding {
    enum class Kind : std::uint8_t { none, integer, real, text, binary };
    Kind kind = Kind::none;
    NumberForm form = NumberForm::plain;
    Charset charset = Charset::utf8;
    bool bits_reversed = false;           ///< the least significant bit comes first
    std::uint32_t bits = 0;               ///< of a number
    std::vector<std::uint8_t> byte_order; ///< the significance of each byte in memory; empty: most significant first
    bool sized = false;                   ///< of text and binary: `size` applies
    Quantity size;                        ///< [bits]; -1: an algorithm or a command's value determines it
    std::uint32_t size_tag = 0;           ///< [bits] in front of text, with its size in bytes
    std::vector<std::uint8_t> terminator; ///< of text; empty: none
    std::uint32_t most_bits = 0;          ///< of text of variable size; 0: not limited
    std::string algorithm;                ///< which only its author's program has; empty: none
    Calibrator calibrator;
    std::vector<std::pair<Condition, Calibrator>> contexts; ///< the first that holds applies instead
};

struct Range {
    Number low = -std::numeric_limits<double>::infinity(), high = std::numeric_limits<double>::infinity();
    bool low_open = false, high_open = false;
    bool calibrated = true; ///< the calibrated value is compared

    bool holds(const Number &x) const { return (low_open ? x > low : x >= low) && (high_open ? x < high : x <= high); }
};

enum class Concern : std::uint8_t { normal, watch, warning, distress, critical, severe };

struct Alarm {
    struct Limits {
        Concern level;
        Range range;
        bool inside; ///< the alarm is inside of the range, not outside
    };
    Condition when; ///< always: the default
    std::uint32_t violations = 1;
    bool on_change = false; ///< the change of the value is compared
    std::vector<Limits> limits;
    std::vector<std::pair<std::string, Concern>> labels; ///< of enumerators and texts
    Concern otherwise = Concern::normal;
};

struct Enumerator {
    std::int64_t low, high; ///< raw values
    std::string label;
};

struct Member {
    std::string name;
    Id type;
    std::optional<std::string> initial;
};

struct Dimension {
    Quantity first, last; ///< index
};

/// Where a count of absolute times begins.
struct Epoch {
    std::int64_t ns;   ///< since 1970-01-01T00:00:00 of TAI with leap seconds, else of UTC
    bool leap_seconds; ///< are counted

    bool operator==(const Epoch &) const = default;
};

struct Type : Named {
    enum class Sort : std::uint8_t {
        integer,
        real,
        enumerated,
        boolean,
        text,
        binary,
        absolute_time,
        relative_time,
        aggregate,
        array
    };
    Sort sort = Sort::integer;
    bool is_signed = true;
    std::vector<std::string> units;
    Encoding encoding;
    std::vector<Enumerator> enumerators;
    std::string zero_label = "False", one_label = "True";
    std::vector<Member> members;
    Id element = no_id;
    std::vector<Dimension> dimensions;
    std::optional<Epoch> epoch;     ///< of an absolute time; nothing: it is not known
    Reference offset_from;          ///< a time with this epoch; of nothing: the epoch
    double scale = 1e9, offset = 0; ///< [ns] a time is scale raw + offset
    std::vector<Range> valid;       ///< empty: all
    std::vector<Alarm> alarms;      ///< those with a context in their order, the default last
    std::optional<std::string> initial;
};

struct Parameter : Named {
    Id type = no_id;
    std::string source; ///< telemetered, derived, constant, local, ground
    std::optional<std::string> initial;
};

struct Entry {
    enum class Kind : std::uint8_t { parameter, container, argument, fixed, indirect };
    enum class From : std::uint8_t { previous, start, end };
    Kind kind = Kind::parameter;
    From from = From::previous;
    bool repeats = false;
    Id id = no_id;                   ///< of the parameter or container
    std::string name;                ///< of the argument; of indirect: the name space of the alias
    std::vector<std::uint8_t> bytes; ///< of fixed, the least significant bits count
    std::uint32_t bits = 0;          ///< of fixed
    Quantity offset;                 ///< [bits]
    Condition include;
    Quantity count, gap;               ///< if it repeats; [bits] behind each
    std::vector<Dimension> dimensions; ///< if any, instead of the type's
    Reference selector;                ///< of indirect: its value is the alias
    Place place;
};

struct Container : Named {
    bool is_abstract = false;
    bool of_command = false;
    Id base = no_id;
    Condition restriction;
    std::vector<Entry> entries;
    std::vector<Id> heirs; ///< in the order of their declaration
};

struct Argument {
    std::string name, description;
    Id type = no_id;
    std::optional<std::string> initial;
};

struct Verifier {
    std::string stage; ///< Accepted, Execution, Complete, ...
    Condition condition;
    Id container = no_id; ///< a packet of it verifies the command
    Reference changes;    ///< the parameter that must change by `change`
    Number change;
    Reference returns;             ///< the parameter that then has details; of nothing: none
    std::optional<double> percent; ///< how much is executed then
    std::string algorithm;         ///< which only its author's program has
    double start = 0, stop = 0;    ///< [s] of the window; stop 0: not limited
    std::string relative_to;       ///< commandRelease or timeLastVerifierPassed
};

/// What must hold before a command leaves.
struct Constraint {
    Condition condition;
    std::string algorithm;    ///< which only its author's program has, instead of a condition
    double timeout = 0;       ///< [s] that the command may wait for it
    bool suspendable = false; ///< an operator may send the command although it does not hold
};

struct Command : Named {
    bool is_abstract = false;
    Id base = no_id;
    std::vector<Argument> arguments; ///< its own
    std::vector<std::pair<std::string, std::string>> assignments;
    Id container = no_id;
    std::string consequence, reason;     ///< of its significance
    std::vector<Constraint> constraints; ///< its own
    std::vector<Verifier> verifiers;
};

struct Database {
    std::vector<std::string> files;
    std::uint64_t hash = 0xCBF29CE484222325; ///< of the text of all files and their places (FNV-1a)
    std::vector<Named> systems;
    std::vector<Type> types;
    std::vector<Parameter> parameters;
    Id arguments = no_id; ///< the first parameter that is an argument of a command; no_id: none is
    std::vector<Container> containers;
    std::vector<Command> commands;
    std::vector<std::string> notes;    ///< "file:line: what was read but is not computed here"
    std::vector<std::string> left_out; ///< "file:line: reason; what is left out", if faults are allowed

    /// The verifiers of a command, own and inherited, in the order of their stages: own Complete verifiers add to those
    /// that are inherited, others replace those of their stage.
    std::vector<const Verifier *> verifiers(Id command) const;

    /// The constraints of a command: those that it inherits first.
    std::vector<const Constraint *> constraints(Id command) const;

    /// The type of a parameter, or of its member or element.
    Id type_of(const Reference &reference) const;

    std::string where(Place place) const { return files[place.file] + ":" + std::to_string(place.line); }

    /// A container or command by its path, or by its name if that is unique. Throws Refusal.
    Id container(const std::string &name) const { return find(containers, name, "container"); }
    Id command(const std::string &name) const { return find(commands, name, "command"); }

private:
    template <class Items> static Id find(const Items &items, const std::string &name, const char *kind)
    {
        Id match = no_id;
        for (Id i = 0; i < items.size(); i++) {
            if (items[i].path == name) {
                return i;
            }
            if (items[i].name == name) {
                if (match != no_id) {
                    throw Refusal(name + " is the name of several " + kind + "s: give the path of one, as " +
                                  items[i].path);
                }
                match = i;
            }
        }
        return match != no_id ? match : throw Refusal(std::string("the database has no ") + kind + " " + name);
    }
};

/// The stages of verifiers in their order.
inline constexpr const char *verifier_stages[] = {
    "TransferredToRange", "SentFromRange", "Received", "Accepted", "Queued", "Execution", "Complete", "Failed"};

inline std::vector<const Verifier *> Database::verifiers(Id command) const
{
    std::vector<const Verifier *> result;
    for (const std::string stage : verifier_stages) {
        const std::size_t before = result.size();
        for (Id at = command; at != no_id && (result.size() == before || stage == "Complete"); at = commands[at].base) {
            for (const Verifier &verifier : commands[at].verifiers) {
                if (verifier.stage == stage) {
                    result.push_back(&verifier);
                }
            }
        }
    }
    return result;
}

inline Id Database::type_of(const Reference &reference) const
{
    Id id = parameters[reference.parameter].type;
    for (const std::uint32_t step : reference.steps) {
        id = types[id].sort == Type::Sort::array ? types[id].element : types[id].members[step].type;
    }
    return id;
}

inline std::vector<const Constraint *> Database::constraints(Id command) const
{
    std::vector<const Constraint *> result;
    for (; command != no_id; command = commands[command].base) {
        const auto &own = commands[command].constraints;
        for (std::size_t i = own.size(); i-- > 0;) {
            result.insert(result.begin(), &own[i]);
        }
    }
    return result;
}

} // namespace fledge::ground
