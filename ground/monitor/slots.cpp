// SPDX-License-Identifier: Apache-2.0
#include "ground/monitor/slots.h"

namespace fledge::ground {

namespace {

/// How many elements an array has by its dimensions; nothing: that varies, or they are more than there are slots.
std::optional<std::uint32_t> elements(const std::vector<Dimension> &dimensions)
{
    std::int64_t n = 1;
    for (const Dimension &dimension : dimensions) {
        const std::int64_t many = dimension.last.fixed - dimension.first.fixed + 1;
        if (!dimension.first.is_fixed() || !dimension.last.is_fixed() || many < 0 || many > std::int64_t(Slots::most) ||
            (n *= many) > std::int64_t(Slots::most)) {
            return std::nullopt;
        }
    }
    return static_cast<std::uint32_t>(n);
}

} // namespace

Slots::Slots(const Database &database)
    : db_(database), names_(db_.parameters.size()), branches_(db_.parameters.size()), tables_(db_.containers.size()),
      known_(db_.containers.size())
{
    std::unordered_map<std::string, int> count;
    for (const Parameter &parameter : db_.parameters) {
        count[parameter.name]++;
    }
    for (std::size_t i = 0; i < names_.size(); i++) {
        const Parameter &parameter = db_.parameters[i];
        names_[i] = count[parameter.name] == 1 ? parameter.name : parameter.path;
        for (const auto &[space, alias] : parameter.aliases) {
            if (space == "Fledge") {
                names_[i] = alias;
            }
        }
    }
    for (const Container &container : db_.containers) {
        for (const Entry &entry : container.entries) {
            if (!container.of_command && entry.kind == Entry::Kind::parameter) {
                lay(container, entry.id, db_.parameters[entry.id].type, entry.id, "", &entry.dimensions);
            }
        }
    }
}

void Slots::lay(const Container &container, Id parameter, Id id, std::uint32_t branch, const std::string &suffix,
                const std::vector<Dimension> *dimensions)
{
    const Type &type = db_.types[id];
    if (type.sort == Type::Sort::aggregate) {
        for (std::uint32_t i = 0; i < type.members.size(); i++) {
            lay(container, parameter, type.members[i].type, child(branch, i), suffix + "." + type.members[i].name,
                nullptr);
        }
    } else if (type.sort == Type::Sort::array) {
        const auto n =
            elements(dimensions != nullptr && !dimensions->empty() ? *dimensions : type.dimensions).value_or(0);
        for (std::uint32_t i = 0; i < n && all_.size() < most; i++) {
            lay(container, parameter, type.element, child(branch, i), suffix + "[" + std::to_string(i) + "]", nullptr);
        }
    } else if (type.encoding.kind != Encoding::Kind::none) {
        leaf(branch, parameter, id, static_cast<Id>(&container - db_.containers.data()), suffix);
    }
}

std::uint32_t Slots::child(std::uint32_t branch, std::uint32_t place)
{
    if (place >= branches_[branch].children.size()) {
        branches_[branch].children.resize(place + 1, no_id);
    }
    if (branches_[branch].children[place] == no_id) {
        branches_[branch].children[place] = static_cast<std::uint32_t>(branches_.size());
        branches_.emplace_back();
    }
    return branches_[branch].children[place];
}

std::uint32_t Slots::leaf(std::uint32_t branch, Id parameter, Id type, Id container, const std::string &suffix)
{
    if (branches_[branch].slot == no_id && all_.size() < most) {
        const Kind kind = value_kind(db_.types[type]);
        branches_[branch].slot = add({names_[parameter] + suffix, db_.parameters[parameter].path + suffix, parameter,
                                      type, container, kind != Kind::none ? kind : raw_kind(db_.types[type].encoding)});
    }
    return branches_[branch].slot;
}

std::uint32_t Slots::add(Slot slot)
{
    const auto place = static_cast<std::uint32_t>(all_.size());
    if (!by_name_.emplace(slot.name, place).second && slot.parameter == no_id) {
        throw Refusal("there is a parameter " + slot.name + " already");
    }
    by_name_.emplace(slot.path, place);
    all_.push_back(std::move(slot));
    return place;
}

std::uint32_t Slots::find(const std::string &name) const
{
    const auto found = by_name_.find(name);
    return found != by_name_.end() ? found->second : no_id;
}

std::uint32_t Slots::seek(const Decoded &packet, std::size_t field)
{
    const Field &decoded = packet.fields[field];
    std::uint32_t branch = decoded.parameter;
    if (decoded.node != 0) {
        steps_.clear();
        for (std::uint32_t node = decoded.node; node != 0; node = packet.nodes[node].parent) {
            steps_.push_back(packet.nodes[node].place);
        }
        for (std::size_t i = steps_.size(); i-- > 0;) {
            const auto &children = branches_[branch].children;
            const bool there = steps_[i] < children.size() && children[steps_[i]] != no_id;
            if (!there && all_.size() >= most) {
                return no_id;
            }
            branch = there ? children[steps_[i]] : child(branch, steps_[i]);
        }
    }
    if (branches_[branch].slot == no_id) {
        return leaf(branch, decoded.parameter, decoded.type, packet.container, suffix(db_, packet, field));
    }
    return branches_[branch].slot;
}

std::span<const std::uint32_t> Slots::of(const Decoded &packet)
{
    if (knows(packet)) {
        return tables_[packet.container];
    }
    table_.resize(packet.fields.size());
    for (std::size_t i = 0; i < table_.size(); i++) {
        table_[i] = seek(packet, i);
    }
    if (packet.planned) {
        tables_[packet.container] = table_;
        known_[packet.container] = true;
    }
    return table_;
}

} // namespace fledge::ground
