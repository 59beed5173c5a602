// SPDX-License-Identifier: Apache-2.0
#include "ground/database/times.h"
#include "ground/database/xtce/readers.h"

namespace fledge::ground::xtce {

namespace {

constexpr View misspelt = "AgumentType"; // in XTCE 1.2, of relative times
constexpr const char *too_many_values = "a value has more than 2^20 members and elements";

std::optional<Type::Sort> sort_of(View name)
{
    static const std::map<View, Type::Sort> sorts = {{"Integer", Type::Sort::integer},
                                                     {"Float", Type::Sort::real},
                                                     {"Enumerated", Type::Sort::enumerated},
                                                     {"Boolean", Type::Sort::boolean},
                                                     {"String", Type::Sort::text},
                                                     {"Binary", Type::Sort::binary},
                                                     {"AbsoluteTime", Type::Sort::absolute_time},
                                                     {"RelativeTime", Type::Sort::relative_time},
                                                     {"Aggregate", Type::Sort::aggregate},
                                                     {"Array", Type::Sort::array}};
    for (const View end : {View("ParameterType"), View("ArgumentType"), misspelt}) {
        if (name.ends_with(end)) {
            const auto found = sorts.find(name.substr(0, name.size() - end.size()));
            return found != sorts.end() ? std::optional(found->second) : std::nullopt;
        }
    }
    return std::nullopt;
}

bool is_of_argument(Node node)
{
    return tag(node).ends_with("ArgumentType") || tag(node).ends_with(misspelt);
}

void enumerators(Type &type, Node node)
{
    type.enumerators.clear();
    for (Node item : elements(node)) {
        const std::int64_t low = whole(item, needed(item, "value"));
        const auto high = item.attribute("maxValue");
        type.enumerators.push_back({low, high ? whole(item, high.value()) : low, needed(item, "label")});
    }
    std::vector<const Enumerator *> sorted;
    for (const Enumerator &enumerator : type.enumerators) {
        sorted.push_back(&enumerator);
    }
    std::sort(sorted.begin(), sorted.end(), [](auto a, auto b) { return a->low < b->low; });
    for (std::size_t i = 0; i < sorted.size(); i++) {
        if (sorted[i]->high < sorted[i]->low || (i > 0 && sorted[i]->low <= sorted[i - 1]->high)) {
            refuse(node, "the values of the enumerator " + sorted[i]->label + " are empty or another's");
        }
    }
}

void complete(Type &type, Node node)
{
    if (type.sort == Type::Sort::array && type.dimensions.empty()) {
        const auto given = node.attribute("numberOfDimensions");
        type.dimensions.resize(given ? count(node, given.value(), 1, 16) : 1);
        for (Dimension &dimension : type.dimensions) {
            dimension.last.fixed = -1; // the entry of a container has the number
        }
    }
    if (type.sort != Type::Sort::absolute_time) {
        type.epoch.reset(); // a duration stays one
    }
    if (type.encoding.kind == Encoding::Kind::binary && type.encoding.algorithm.empty() &&
        type.encoding.size.is_fixed() && type.encoding.size.fixed > 0 && type.encoding.size.fixed <= 64 &&
        type.sort != Type::Sort::binary && type.sort != Type::Sort::text) { // it is a number
        type.encoding.kind = Encoding::Kind::integer;
        type.encoding.bits = static_cast<std::uint32_t>(type.encoding.size.fixed);
    }
    if (type.sort != Type::Sort::enumerated || type.alarms.empty()) {
        return;
    }
    std::set<View> labels;
    for (const Enumerator &enumerator : type.enumerators) {
        labels.insert(enumerator.label);
    }
    for (const Alarm &alarm : type.alarms) {
        for (const auto &[label, level] : alarm.labels) {
            if (!labels.contains(label)) {
                refuse(node, "an alarm of " + type.name + " names " + label + ", which is no enumerator");
            }
        }
    }
}

} // namespace

// --- structure

void TypeReader::read_structures()
{
    n_values_.assign(db_.types.size(), 0);
    encoded_.assign(db_.types.size(), false);
    declared_.each(db_.types, declared_.types, [&](Id i) { read_structure(i, 0); });
}

void TypeReader::structure(Id id, std::size_t depth)
{
    if (declared_.left_out(declared_.types[id]) ||
        !declared_.attempt(declared_.enter(declared_.types[id]).node, db_.types[id].path,
                           [&] { read_structure(id, depth); })) {
        refuse_reference(db_.types[id].path);
    }
}

/// Copy the structure of the base to a type.
void TypeReader::inherit_structure(Id id, std::size_t depth)
{
    Declared &at = declared_.types[id];
    const Node node = at.node;
    const Type::Sort sort = db_.types[id].sort;
    const Id base = declared_.type(node, "baseType", is_of_argument(node));
    structure(base, depth + 1);
    declared_.enter(at);
    if (db_.types[base].sort != sort &&
        std::max(db_.types[base].sort, sort) >= Type::Sort::aggregate) { // others lend their encoding
        refuse(node, "the base " + db_.types[base].name + " is of another kind");
    }
    declared_.spend_copied(db_.types[base].members.size() * sizeof(Member));
    db_.types[id].members = db_.types[base].members;
    db_.types[id].element = db_.types[base].element;
    bases_[id] = base;
}

void TypeReader::read_members(Type &type, Node node)
{
    for (Node item : elements(element(node, "MemberList"))) {
        if (tag(item) != "Member") {
            refuse_element(item);
        }
        Member member{
            needed(item, "name"),
            declared_.type(item, item.attribute("typeRef") ? "typeRef" : "parameterTypeRef", is_of_argument(node)),
            initial(item)};
        values_.members.insert(member.name);
        type.members.push_back(std::move(member));
    }
}

void TypeReader::read_structure(Id id, std::size_t depth)
{
    Declared &at = declared_.types[id];
    if (at.read == Declared::Read::structure) {
        return;
    }
    const Node node = at.node;
    const bool loops = at.read == Declared::Read::structure_begun;
    if (loops || depth > deepest) {
        refuse(node, "the type " + db_.types[id].name + " contains or extends itself" +
                         (loops ? "" : ", or is nested deeper than " + std::to_string(deepest)));
    }
    at.read = Declared::Read::structure_begun;
    const auto sort = sort_of(tag(node));
    if (!sort) {
        refuse_element(node);
    }
    db_.types[id].sort = *sort;
    if (node.attribute("baseType")) {
        inherit_structure(id, depth);
    }
    if (*sort == Type::Sort::array && node.attribute("arrayTypeRef")) {
        db_.types[id].element = declared_.type(node, "arrayTypeRef", is_of_argument(node));
    }
    read_members(db_.types[id], node);
    if (*sort == Type::Sort::array && db_.types[id].element == no_id) {
        refuse(node, "an array needs the attribute arrayTypeRef");
    }
    std::uint64_t n = 1;
    for (std::size_t i = 0; i < db_.types[id].members.size(); i++) {
        structure(db_.types[id].members[i].type, depth + 1);
        n += n_values_[db_.types[id].members[i].type];
    }
    if (db_.types[id].element != no_id) {
        structure(db_.types[id].element, depth + 1);
        n += n_values_[db_.types[id].element];
    }
    declared_.enter(at).read = Declared::Read::structure;
    n_values_[id] = n;
    if (n > most_values) {
        refuse(node, too_many_values);
    }
}

// --- the rest

void TypeReader::fill()
{
    for (Id i = 0; i < db_.types.size(); i++) {
        if (!declared_.left_out(declared_.types[i])) {
            fill(i);
        }
    }
}

/// Copy from the base all that a type does not define itself.
void TypeReader::inherit(Id id, Id base)
{
    const Type &from = db_.types[base];
    declared_.spend_copied(from.enumerators.size() * sizeof(Enumerator) + from.encoding.calibrator.points.size() * 16 +
                           from.encoding.calibrator.steps.size() * sizeof(MathStep) +
                           from.encoding.contexts.size() * (sizeof(Condition) + sizeof(Calibrator)) +
                           from.alarms.size() * sizeof(Alarm) + sizeof(Type));
    Type result = from;
    result.sort = db_.types[id].sort;
    static_cast<Named &>(result) = db_.types[id];
    result.members = db_.types[id].members;
    result.element = db_.types[id].element;
    db_.types[id] = std::move(result);
}

void TypeReader::fill(Id id)
{
    Declared &at = declared_.types[id];
    if (std::exchange(at.read, Declared::Read::all) == Declared::Read::all) { // structure() has refused loops
        return;
    }
    if (const auto base = bases_.find(id); base != bases_.end()) {
        fill(base->second);
        if (declared_.left_out(declared_.types[base->second])) {
            declared_.enter(at);
            declared_.attempt(at.node, db_.types[id].path, [&] { refuse_reference(db_.types[base->second].path); });
            return;
        }
        inherit(id, base->second);
    }
    declared_.enter(at);
    Type &type = db_.types[id];
    const Node node = at.node;
    type.is_signed = is_true(node, "signed", type.is_signed);
    type.zero_label = node.attribute("zeroStringValue").as_string(type.zero_label.c_str());
    type.one_label = node.attribute("oneStringValue").as_string(type.one_label.c_str());
    if (const auto value = initial(node)) {
        type.initial = value;
    }
    for (Node child : elements(node)) {
        declared_.attempt(node, type.path, [&] { part(type, child); });
    }
    declared_.attempt(node, type.path, [&] { complete(type, node); });
}

void TypeReader::part(Type &type, Node child)
{
    const View name = tag(child);
    if (name == "UnitSet") {
        type.units.clear();
        for (Node unit : elements(child)) {
            const std::string power = unit.attribute("power").as_string("1");
            type.units.push_back(std::string(trimmed(unit.text().get())) + (power == "1" ? "" : "^" + power));
        }
    } else if (name.ends_with("DataEncoding")) {
        type.encoding = encodings_.encoding(child);
    } else if (name == "Encoding") {
        time_encoding(type, child);
    } else if (name == "EnumerationList") {
        enumerators(type, child);
    } else if (name == "ValidRange") {
        type.valid = {range(child)};
    } else if (name == "ValidRangeSet") {
        type.valid.clear();
        for (Node item : elements(child)) {
            type.valid.push_back(range(item));
            type.valid.back().calibrated =
                is_true(child, "validRangeAppliesToCalibrated", type.valid.back().calibrated);
        }
    } else if (name == "DefaultAlarm") {
        add_alarm(type, child);
    } else if (one_of(name, {"ContextAlarmList", "BinaryContextAlarmList"})) {
        for (Node item : elements(child)) {
            add_alarm(type, item);
        }
    } else if (name == "DimensionList") {
        type.dimensions = values_.dimensions(child);
    } else if (name == "ReferenceTime") {
        reference_time(type, child);
    } else if (!is_common(child) && !one_of(name, {"ToString", "SizeRangeInCharacters", "MemberList"})) {
        refuse_element(child);
    }
}

/// Add an alarm: the default one, which has no context, remains the last.
void TypeReader::add_alarm(Type &type, Node node)
{
    Alarm alarm = alarms_.alarm(node);
    if (is_true(node, "disabled", false)) { // of XTCE 1.3
        declared_.note(node, "an alarm is disabled: it is not computed");
        return;
    }
    const bool has_default = !type.alarms.empty() && type.alarms.back().when.kind == Condition::Kind::always;
    type.alarms.insert(type.alarms.end() - (has_default && alarm.when.kind != Condition::Kind::always),
                       std::move(alarm));
}

void TypeReader::time_encoding(Type &type, Node node)
{
    static const std::map<View, double> units = {
        {"seconds", 1e9},      {"picoSeconds", 1e-3}, {"days", 86400e9}, // and of XTCE 1.3:
        {"picoseconds", 1e-3}, {"nanoseconds", 1},    {"microseconds", 1e3},
        {"milliseconds", 1e6}, {"minutes", 60e9},     {"hours", 3600e9}};
    const std::string unit = node.attribute("units").as_string("seconds");
    const auto found = units.find(unit);
    if (found == units.end()) {
        refuse(node, "a time is in days, hours, minutes, seconds, milliseconds, microseconds, nanoseconds or "
                     "picoSeconds; found " +
                         unit);
    }
    type.scale = real_or(node, "scale", 1) * found->second;
    type.offset = real_or(node, "offset", 0) * found->second;
    for (Node child : elements(node)) {
        if (!tag(child).ends_with("DataEncoding")) {
            refuse_element(child);
        }
        type.encoding = encodings_.encoding(child);
    }
}

void TypeReader::reference_time(Type &type, Node node)
{
    for (Node child : elements(node)) {
        if (tag(child) == "OffsetFrom") {
            type.offset_from = values_.reference(child);
            type.epoch.reset();
        } else if (tag(child) == "Epoch") {
            const std::string text(trimmed(child.text().get()));
            type.offset_from = {};
            type.epoch = epoch_of(text);
            if (!type.epoch) {
                refuse(child, "an epoch is TAI, GPS, J2000, UNIX, POSIX or a date, as 2000-01-01T12:00:00; found '" +
                                  text + "'");
            }
        } else {
            refuse_element(child);
        }
    }
}

/// The epoch of the time from which a type's times count.
std::optional<Epoch> TypeReader::epoch_before(Id id, std::size_t depth) const
{
    const Reference &from = db_.types[id].offset_from;
    if (db_.types[id].sort != Type::Sort::absolute_time || db_.types[id].epoch || depth > deepest) {
        return db_.types[id].epoch;
    }
    if (from.of == Reference::Of::parameter) {
        return from.calibrated ? epoch_before(db_.type_of(from), depth + 1) : std::nullopt;
    }
    std::optional<std::optional<Epoch>> found;
    for (const Type &type : db_.types) { // a member of the same aggregate
        const auto &all = type.members;
        const auto named = std::find_if(all.begin(), all.end(), [&](auto &member) { return member.name == from.name; });
        if (from.of == Reference::Of::argument && named != all.end() &&
            std::any_of(all.begin(), all.end(), [&](auto &member) { return member.type == id; })) {
            const auto epoch = epoch_before(named->type, depth + 1);
            if (depth > 0) { // the types before are judged by themselves
                return epoch;
            }
            if (found && *found != epoch) {
                refuse(declared_.types[id].node, "the times of " + db_.types[id].name + " count from " + from.name +
                                                     ", which has another epoch in " + type.name);
            }
            found = epoch;
        }
    }
    return found.value_or(std::nullopt);
}

void TypeReader::find_epochs()
{
    declared_.each(db_.types, declared_.types, [&](Id i) {
        Type &type = db_.types[i];
        type.epoch = epoch_before(i, 0);
        if (type.sort == Type::Sort::absolute_time && type.encoding.kind != Encoding::Kind::none && !type.epoch) {
            declared_.note(declared_.types[i].node, "the times of " + type.name + " have no epoch: they are durations");
        }
    });
}

// --- values of packets

void TypeReader::need_encoding(Node node, Id id)
{
    const Type &type = db_.types[id];
    if (encoded_[id]) {
        return;
    }
    if (declared_.left_out(declared_.types[id])) {
        refuse_reference(type.path);
    }
    if (type.sort == Type::Sort::array) {
        need_encoding(node, type.element);
        n_values_[id] = n_values(node, type.element, type.dimensions);
    } else if (type.sort == Type::Sort::aggregate) {
        n_values_[id] = 1;
        for (const Member &member : type.members) {
            need_encoding(node, member.type);
            n_values_[id] += n_values_[member.type];
        }
    } else if (type.encoding.kind == Encoding::Kind::none) {
        refuse(node, "the type " + type.name + " (" + db_.where(type.place) + ") has no encoding");
    } else if (type.encoding.kind == Encoding::Kind::binary && type.encoding.algorithm.empty() &&
               type.sort != Type::Sort::binary && type.sort != Type::Sort::text) {
        refuse(node, "the type " + type.name + " (" + db_.where(type.place) +
                         ") is binary, and no algorithm makes a value of it");
    }
    if (n_values_[id] > most_values) {
        refuse(node, too_many_values);
    }
    encoded_[id] = true;
}

std::uint64_t TypeReader::n_values(Node node, Id element, const std::vector<Dimension> &dimensions) const
{
    std::uint64_t n = n_values_[element];
    for (const auto &[first, last] : dimensions) {
        if (first.is_fixed() && last.is_fixed()) {
            n *= static_cast<std::uint64_t>(std::clamp<std::int64_t>(last.fixed - first.fixed + 1, 1, most_values + 1));
        }
        if (n > most_values) {
            refuse(node, too_many_values);
        }
    }
    return n;
}

} // namespace fledge::ground::xtce
