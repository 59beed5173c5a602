// SPDX-License-Identifier: Apache-2.0
// The commands of a database as forms: what an operator may fill in.
#include "ground/loaded.h"

#include <algorithm>
#include <set>

namespace fledge::ground {

namespace {

/// The name in the name space Fledge, else the path.
const std::string &shown_name(const Named &one)
{
    for (const auto &[space, alias] : one.aliases) {
        if (space == "Fledge") {
            return alias;
        }
    }
    return one.path;
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
    default: return "time";
    }
}

py::object bound(double x)
{
    return x - x == 0 ? py::object(py::float_(x)) : py::object(py::none());
}

template <class Text> py::object text_or_none(const Text &text)
{
    return text ? py::object(py::str(*text)) : py::object(py::none());
}

py::dict argument_form(const Database &db, const Argument &one)
{
    const Type &type = db.types[one.type];
    py::dict made;
    made["name"] = one.name;
    made["type"] = kind_of(type);
    made["unit"] = type.units.empty() ? std::string() : type.units.front();
    const Range range = type.valid.size() == 1 ? type.valid.front() : Range();
    made["low"] = bound(range.low);
    made["high"] = bound(range.high);
    made["low_open"] = range.low_open;
    made["high_open"] = range.high_open;
    py::list labels;
    for (const Enumerator &label : type.enumerators) {
        labels.append(label.label);
    }
    if (type.sort == Type::Sort::boolean) {
        labels.append(type.zero);
        labels.append(type.one);
    }
    made["labels"] = labels;
    made["initial"] = text_or_none(one.initial ? one.initial : type.initial);
    made["description"] = one.description.empty() ? type.description : one.description;
    const Quantity &size = type.encoding.size; // how many bytes: no operator counts them
    made["counted_by"] = size.from.of == Reference::Of::argument && size.slope == 8 ? size.from.name : std::string();
    const std::uint32_t bits = type.encoding.bits ? type.encoding.bits
                               : size.is_fixed()  ? static_cast<std::uint32_t>(size.fixed / 8)
                                                  : type.encoding.most_bits / 8;
    made["size"] = bits ? py::object(py::int_(bits)) : py::object(py::none());
    return made;
}

std::string in_words(const Condition &condition)
{
    std::string all = condition.text;
    for (const Condition &part : condition.parts) {
        all += (all.empty() ? "" : condition.what == Condition::What::any ? " or " : " and ") + in_words(part);
    }
    return all;
}

bool compares_arguments(const Condition &condition)
{
    return condition.right.of == Reference::Of::argument ||
           std::any_of(condition.parts.begin(), condition.parts.end(), compares_arguments);
}

py::dict verifier_form(const Database &db, const Verifier &one)
{
    std::string text =
        one.container != no_id ? shown_name(db.containers[one.container])
        : one.changes.of != Reference::Of::nothing
            ? "a change of " + one.changes.name + " by " + py::str(py::float_(one.change)).cast<std::string>()
        : one.condition.what != Condition::What::always ? in_words(one.condition)
                                                        : one.algorithm;
    py::dict made;
    made["stage"] = one.stage;
    made["text"] = text;
    made["start"] = one.start;
    made["stop"] = one.stop > 0 ? py::object(py::float_(one.stop)) : py::object(py::none());
    made["from_release"] = one.relative_to == "commandRelease";
    made["percent"] = one.percent ? py::object(py::float_(*one.percent)) : py::object(py::none());
    made["own"] = compares_arguments(one.condition);
    return made;
}

} // namespace

/// Of each command that is not abstract: name, path, group, description, hazardous, arguments, verifiers.
DictRows command_forms(const Database &db)
{
    py::list made;
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
        std::string hazardous;
        for (const Command *one : chain) { // the nearest significance counts
            const std::string &level = one->consequence;
            if (hazardous.empty() && !level.empty() && level != "none" && level != "watch") {
                hazardous = one->reason.empty() ? level : one->reason;
            }
            for (const auto &[name, value] : one->assignments) {
                assigned.insert(name);
            }
        }
        for (auto one = chain.rbegin(); one != chain.rend(); ++one) {
            for (const Argument &argument : (*one)->arguments) {
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
        py::list verifiers;
        for (const Verifier *one : db.verifiers(static_cast<Id>(&command - db.commands.data()))) {
            verifiers.append(verifier_form(db, *one));
        }
        form["verifiers"] = verifiers;
        made.append(form);
    }
    return made;
}

/// Path of a container -> its name in the name space Fledge, or the path.
Names container_names(const Database &db)
{
    py::dict made;
    for (const Container &container : db.containers) {
        made[py::str(container.path)] = shown_name(container);
    }
    return made;
}

} // namespace fledge::ground
