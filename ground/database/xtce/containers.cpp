// SPDX-License-Identifier: Apache-2.0
#include "ground/database/xtce/readers.h"

namespace fledge::ground::xtce {

namespace {

Entry::From place_of(Node node)
{
    const std::string from = node.attribute("referenceLocation").as_string("previousEntry");
    return from == "containerStart"  ? Entry::From::start
           : from == "containerEnd"  ? Entry::From::end
           : from == "previousEntry" ? Entry::From::previous
                                     : refuse_as<Entry::From>(node, "a place refers to containerStart, containerEnd or "
                                                                    "previousEntry; found " +
                                                                        from);
}

void fixed_value(Entry &result, Node node)
{
    result.kind = Entry::Kind::fixed;
    result.bytes = hexadecimal(node, needed(node, "binaryValue"));
    const std::string all = std::to_string(8 * result.bytes.size());
    result.bits = count(node, node.attribute("sizeInBits").as_string(all.c_str()), 1, 8 * 65542);
    result.bytes.insert(result.bytes.begin(), (result.bits + 7) / 8, 0); // the value is at its end
}

} // namespace

void ContainerReader::fill()
{
    declared_.each(db_.containers, declared_.containers,
                   [&](Id i) { fill(db_.containers[i], declared_.containers[i].node); });
}

void ContainerReader::fill(Container &container, Node node)
{
    container.is_abstract = is_true(node, "abstract", false);
    for (Node child : elements(node)) {
        const View name = tag(child);
        if (name == "EntryList") {
            for (Node element : elements(child)) {
                declared_.attempt(node, container.path, [&] { container.entries.push_back(entry(element)); });
            }
        } else if (name == "BaseContainer") {
            base(container, child);
        } else if (!is_common(child) && !one_of(name, {"DefaultRateInStream", "RateInStreamSet", "BinaryEncoding"})) {
            refuse_element(child);
        }
    }
}

void ContainerReader::base(Container &container, Node node)
{
    container.base = declared_.container(node, needed(node, "containerRef"));
    for (Node criteria : elements(node)) {
        if (tag(criteria) != "RestrictionCriteria") {
            refuse_element(criteria);
        }
        if (element(criteria, "NextContainer")) {
            declared_.note(criteria, "the order of containers is not checked");
        } else {
            container.restriction = values_.condition(criteria);
        }
    }
}

Entry ContainerReader::entry(Node node)
{
    Entry result;
    result.place = declared_.place(node);
    begin_entry(result, node);
    const bool parameter = result.kind == Entry::Kind::parameter;
    std::uint64_t n = parameter ? types_.n_values(db_.parameters[result.id].type) : 1;
    for (Node child : elements(node)) {
        if (tag(child) == "DimensionList") {
            result.dimensions = values_.dimensions(child);
            const Id of = parameter ? db_.types[db_.parameters[result.id].type].element : no_id;
            n = of != no_id ? types_.n_values(child, of, result.dimensions) : n;
        } else {
            part(result, child);
        }
    }
    if ((n_values_ += n) > 16 * most_values) {
        declared_.refuse_size("its containers have more than 2^24 values");
    }
    return result;
}

void ContainerReader::begin_entry(Entry &result, Node node)
{
    const View name = tag(node);
    if (one_of(name, {"ParameterRefEntry", "ArrayParameterRefEntry"})) {
        result.id = declared_.parameter(node, needed(node, "parameterRef"));
        types_.need_encoding(node, db_.parameters[result.id].type);
    } else if (name == "ContainerRefEntry") {
        result.kind = Entry::Kind::container;
        result.id = declared_.container(node, needed(node, "containerRef"));
    } else if (one_of(name, {"ArgumentRefEntry", "ArrayArgumentRefEntry"})) {
        result.kind = Entry::Kind::argument;
        result.name = needed(node, "argumentRef");
    } else if (name == "FixedValueEntry") {
        fixed_value(result, node);
    } else if (name == "IndirectParameterRefEntry") {
        result.kind = Entry::Kind::indirect;
        result.name = node.attribute("aliasNameSpace").value();
        const Node instance = element(node, "ParameterInstance");
        result.selector = instance
                              ? values_.reference(instance)
                              : refuse_as<Reference>(node, "<IndirectParameterRefEntry> needs a ParameterInstance");
        const auto has_alias = [&](const Parameter &parameter) {
            return std::any_of(parameter.aliases.begin(), parameter.aliases.end(),
                               [&](auto &alias) { return alias.first == result.name; });
        };
        if (std::none_of(db_.parameters.begin(), db_.parameters.end(), has_alias)) {
            refuse(node, "no parameter has an alias in the name space " + result.name);
        }
    } else if (name.ends_with("Entry")) {
        refuse(node, std::string(name) + " is not decoded here");
    } else {
        refuse_element(node);
    }
}

void ContainerReader::part(Entry &result, Node node)
{
    const View name = tag(node);
    if (name == "LocationInContainerInBits") {
        result.from = place_of(node);
        result.offset = values_.quantity(node);
    } else if (name == "RepeatEntry") {
        result.repeats = true;
        result.count = values_.quantity(element(node, "Count"));
        if (const Node gap = element(node, "Offset")) {
            result.gap = values_.quantity(gap);
        }
    } else if (name == "IncludeCondition") {
        result.include = values_.condition(node);
    } else if (name == "TimeAssociation") {
        declared_.note(node, "the time of one parameter is not computed from another's");
    } else if (!is_common(node) && name != "ParameterInstance") {
        refuse_element(node);
    }
}

// --- loops, and entries whose place may be meant in two ways

void ContainerReader::refuse_loops()
{
    std::vector<char> state(db_.containers.size());
    std::vector<std::pair<Id, std::size_t>> path; // an explicit stack: chains may be long
    for (Id i = 0; i < db_.containers.size(); i++) {
        path.emplace_back(i, 0);
        while (!path.empty()) {
            auto &[at, next] = path.back();
            Container &container = db_.containers[at];
            if (next == 0 && state[at] == 2) {
                path.pop_back();
                continue;
            }
            state[at] = 1;
            Id to = no_id;
            if (next == 0) {
                to = container.base;
            } else if (next <= container.entries.size()) {
                const Entry &entry = container.entries[next - 1];
                to = entry.kind == Entry::Kind::container ? entry.id : no_id;
            } else {
                state[at] = 2;
                path.pop_back();
                continue;
            }
            next++;
            const bool loop = to != no_id && state[to] == 1;
            if (loop || path.size() > 1000) {
                declared_.fault(declared_.containers[at], container.path,
                                loop ? "the container " + container.name + " extends or contains itself"
                                     : "containers are nested deeper than 1000");
            } else if (to != no_id && state[to] == 0) {
                path.emplace_back(to, 0);
            }
        }
    }
}

void ContainerReader::refuse_doubtful_ends()
{
    std::vector<std::pair<Id, const Entry *>> doubtful;
    for (Id i = 0; i < db_.containers.size(); i++) {
        for (const Entry &entry : db_.containers[i].entries) {
            const bool parameter = entry.kind == Entry::Kind::parameter;
            if (entry.from != Entry::From::end || !entry.offset.is_fixed() ||
                (!parameter && entry.kind != Entry::Kind::fixed)) {
                continue;
            }
            const Encoding *encoding = parameter ? &db_.types[db_.parameters[entry.id].type].encoding : nullptr;
            const std::int64_t bits = !parameter                                     ? entry.bits
                                      : encoding->sized && encoding->size.is_fixed() ? encoding->size.fixed
                                                                                     : encoding->bits;
            if (entry.offset.fixed < bits) {
                return;
            }
            if (entry.offset.fixed == bits && bits != 0) {
                doubtful.emplace_back(i, &entry);
            }
        }
    }
    for (const auto &[id, doubt] : doubtful) {
        const Node node = declared_.enter(declared_.containers[id]).node;
        declared_.attempt(node, db_.containers[id].path, [this, &entry = *doubt] {
            throw Fault(db_.where(entry.place) + ": this entry ends " + std::to_string(entry.offset.fixed) +
                            " bits in front of the container's end, as XTCE counts, and no entry is behind it. If "
                            "its begin is meant, write 0; else add an entry for these bits",
                        entry.place);
        });
    }
}

} // namespace fledge::ground::xtce
