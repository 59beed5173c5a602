// SPDX-License-Identifier: Apache-2.0
// The commands of a database as forms that an operator fills in.
#include "ground/database/operand.h"
#include "ground/database/times.h"
#include "ground/python/loaded.h"

#include <algorithm>
#include <set>

namespace fledge::ground {

namespace {

/// The name in the name space Fledge, else the path.
const std::string &shown_name(const Named &named)
{
    for (const auto &[space, alias] : named.aliases) {
        if (space == "Fledge") {
            return alias;
        }
    }
    return named.path;
}

const char *kind_of(const Type &type)
{
    switch (type.sort) {
    case Type::Sort::integer: return type.is_signed ? "integer" : "natural";
    case Type::Sort::real: return "real";
    case Type::Sort::enumerated: return "label";
    case Type::Sort::boolean: return "boolean";
    case Type::Sort::text: return "text";
    case Type::Sort::binary: return "binary";
    case Type::Sort::aggregate: return "aggregate";
    case Type::Sort::array: return "array";
    default: return name_of(value_kind(type));
    }
}

/// As a user gives it: in a database a time without a unit is in seconds, from a user in ns.
py::object initial_value(const Type &type, const std::optional<std::string> &text)
{
    const Kind kind = value_kind(type);
    if (!text || !is_time(kind) || !number_in(*text)) {
        return text ? py::object(py::str(*text)) : py::object(py::none());
    }
    return py::str(time_words(kind, static_cast<std::int64_t>(constant(type, *text).word)));
}

py::dict argument_form(const Database &db, const Argument &argument)
{
    const Type &type = db.types[argument.type];
    py::dict result;
    result["name"] = argument.name;
    result["type"] = kind_of(type);
    const Kind kind = value_kind(type); // a duration is given in ns, or as text with its unit
    result["unit"] = kind == Kind::duration ? "ns" : unit_of(type);
    const Range range = type.valid.size() == 1 ? type.valid.front() : Range();
    result["low"] = end_of(range.low);
    result["high"] = end_of(range.high);
    result["low_open"] = range.low_open;
    result["high_open"] = range.high_open;
    py::list labels;
    for (const Enumerator &label : type.enumerators) {
        labels.append(label.label);
    }
    if (type.sort == Type::Sort::boolean) {
        labels.append(type.zero_label);
        labels.append(type.one_label);
    }
    result["labels"] = labels;
    result["initial"] = initial_value(type, argument.initial ? argument.initial : type.initial);
    result["description"] = argument.description.empty() ? type.description : argument.description;
    const Quantity &size = type.encoding.size; // an argument with the number of bytes needs no entry by an operator
    result["counted_by"] = size.from.of == Reference::Of::argument && size.slope == 8 ? size.from.name : std::string();
    const std::uint32_t bits = type.encoding.bits ? type.encoding.bits
                               : size.is_fixed()  ? static_cast<std::uint32_t>(size.fixed / 8)
                                                  : type.encoding.most_bits / 8;
    result["size"] = bits ? py::object(py::int_(bits)) : py::object(py::none());
    return result;
}

std::string in_words(const Condition &condition)
{
    std::string all = condition.text;
    for (const Condition &part : condition.parts) {
        all += (all.empty() ? "" : condition.kind == Condition::Kind::any ? " or " : " and ") + in_words(part);
    }
    return all;
}

bool compares_arguments(const Condition &condition)
{
    return condition.right.of == Reference::Of::argument ||
           std::any_of(condition.parts.begin(), condition.parts.end(), compares_arguments);
}

py::dict verifier_form(const Database &db, const Verifier &verifier)
{
    std::string text = verifier.container != no_id ? shown_name(db.containers[verifier.container])
                       : verifier.changes.of != Reference::Of::nothing
                           ? "a change of " + verifier.changes.name + " by " + text_of(verifier.change)
                       : verifier.condition.kind != Condition::Kind::always ? in_words(verifier.condition)
                                                                            : verifier.algorithm;
    py::dict result;
    result["stage"] = verifier.stage;
    result["text"] = text;
    result["start"] = verifier.start;
    result["stop"] = verifier.stop > 0 ? py::object(py::float_(verifier.stop)) : py::object(py::none());
    result["from_release"] = verifier.relative_to == "commandRelease";
    result["percent"] = verifier.percent ? py::object(py::float_(*verifier.percent)) : py::object(py::none());
    result["own"] = compares_arguments(verifier.condition);
    return result;
}

} // namespace

/// Of each command that is not abstract: name, path, group, description, hazardous, arguments, constraints,
/// verifiers.
DictRows command_forms(const Database &db)
{
    py::list result;
    for (const Command &command : db.commands) {
        if (command.is_abstract) {
            continue;
        }
        std::vector<const Command *> chain{&command};
        while (chain.back()->base != no_id) {
            chain.push_back(&db.commands[chain.back()->base]);
        }
        std::set<std::string> assigned;
        py::list arguments;
        std::string level, hazardous;
        for (const Command *step : chain) { // the significance of the most derived command applies
            if (level.empty() && !step->consequence.empty()) {
                level = step->consequence;
                const bool harmless = level == "none" || level == "watch" || level == "normal";
                hazardous = harmless ? "" : step->reason.empty() ? level : step->reason;
            }
            for (const auto &[name, value] : step->assignments) {
                assigned.insert(name);
            }
        }
        for (auto step = chain.rbegin(); step != chain.rend(); ++step) {
            for (const Argument &argument : (*step)->arguments) {
                if (!assigned.count(argument.name)) {
                    arguments.append(argument_form(db, argument));
                }
            }
        }
        py::dict form;
        form["name"] = shown_name(command);
        form["path"] = command.path;
        form["group"] = chain.size() > 1 ? shown_name(*chain[1]) : command.path.substr(0, command.path.rfind('/'));
        form["description"] = command.description;
        form["hazardous"] = hazardous;
        form["arguments"] = arguments;
        py::list constraints;
        for (const Constraint *constraint : db.constraints(static_cast<Id>(&command - db.commands.data()))) {
            constraints.append(constraint->algorithm.empty() ? in_words(constraint->condition) : constraint->algorithm);
        }
        form["constraints"] = constraints;
        py::list verifiers;
        for (const Verifier *verifier : db.verifiers(static_cast<Id>(&command - db.commands.data()))) {
            verifiers.append(verifier_form(db, *verifier));
        }
        form["verifiers"] = verifiers;
        result.append(form);
    }
    return result;
}

/// Path of a container -> its name in the name space Fledge, or the path.
Names container_names(const Database &db)
{
    py::dict result;
    for (const Container &container : db.containers) {
        result[py::str(container.path)] = shown_name(container);
    }
    return result;
}

} // namespace fledge::ground
