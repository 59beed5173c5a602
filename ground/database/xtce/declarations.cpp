// SPDX-License-Identifier: Apache-2.0
#include "ground/database/xtce/declarations.h"

namespace fledge::ground::xtce {

namespace {

constexpr std::size_t most_copied = 1 << 28;   // [bytes]
constexpr std::size_t most_searched = 1 << 28; // characters of the names that references may mean

/// The path of a reference, seen from a system; "" if it leads out of the tree.
std::string absolute(const std::string &from, View reference)
{
    std::string path = reference.starts_with('/') ? "" : from;
    for (std::size_t at = 0, end; at < reference.size(); at = end + 1) {
        end = std::min(reference.find('/', at), reference.size());
        const View part = reference.substr(at, end - at);
        if (part == "..") {
            if (path.empty()) {
                return "";
            }
            path.erase(path.rfind('/'));
        } else if (!part.empty() && part != ".") {
            path.append("/").append(part);
        }
    }
    return path;
}

} // namespace

// --- declarations

void Declarations::declare()
{
    for (file_ = 0; file_ < documents_.files().size(); file_++) {
        if (const Node root = documents_.root(file_); !faults_.left_out(root)) {
            attempt(root, "<SpaceSystem>", [&] { declare_system(root, documents_.under(file_), 0); });
        }
    }
    declare_command_containers();
}

void Declarations::declare_system(Node node, const std::string &under, std::size_t depth)
{
    if (depth > deepest) {
        refuse(node, "space systems are nested deeper than " + std::to_string(deepest));
    }
    Named system;
    describe(node, under, system);
    const std::string path = system.path;
    if (!system_names_.emplace(path, 0).second) {
        refuse(node, path + " is declared twice");
    }
    db_.systems.push_back(std::move(system));
    parts(node, path, [&](Node child) {
        const View name = tag(child);
        if (name == "SpaceSystem") {
            declare_system(child, path, depth + 1);
        } else if (name == "TelemetryMetaData" || name == "CommandMetaData") {
            parts(child, path, [&](Node set) { declare_set(set, path); });
        } else if (name == "ServiceSet") {
            note(child, "services are not computed");
        } else if (!is_common(child) && name != "Header") {
            refuse_element(child);
        }
    });
}

void Declarations::declare_set(Node set, const std::string &path)
{
    const View name = tag(set);
    if (one_of(name, {"StreamSet", "MessageSet", "AlgorithmSet"})) {
        note(set, std::string(name) + " is not computed");
    } else if (one_of(name, {"ParameterTypeSet", "ArgumentTypeSet", "ParameterSet", "ContainerSet",
                             "CommandContainerSet", "MetaCommandSet"})) {
        parts(set, path, [&](Node node) { declare_part(node, name, path); });
    } else {
        refuse_element(set);
    }
}

void Declarations::declare_part(Node node, View set, const std::string &path)
{
    const View kind = tag(node);
    if (set == "ParameterTypeSet" || set == "ArgumentTypeSet") {
        declare(node, path, db_.types, types, set == "ParameterTypeSet" ? type_names_ : argument_type_names_);
    } else if (set == "ParameterSet" && kind == "Parameter") {
        declare(node, path, db_.parameters, parameters, parameter_names_);
    } else if (set == "ParameterSet" && kind == "ParameterRef") {
        return; // a reference to a parameter of another system declares nothing
    } else if (set == "ContainerSet" || set == "CommandContainerSet") {
        if (kind != "SequenceContainer" && (kind != "CommandContainer" || set == "ContainerSet")) {
            refuse_element(node);
        }
        declare(node, path, db_.containers, containers, container_names_);
    } else if (kind == "MetaCommand") {
        const Id id = declare(node, path, db_.commands, commands, command_names_);
        if (const Node container = element(node, "CommandContainer")) {
            command_nodes_.emplace_back(id, container);
        }
    } else if (kind == "BlockMetaCommand" || kind == "MetaCommandRef") {
        note(node, std::string(kind) + " is not computed");
    } else {
        refuse_element(node);
    }
}

template <class Things>
Id Declarations::declare(Node node, const std::string &path, Things &things, std::vector<Declared> &declared,
                         Names &names)
{
    typename Things::value_type thing;
    describe(node, path, thing);
    const Id id = static_cast<Id>(things.size());
    if (const auto [found, fresh] = names.emplace(thing.path, id); !fresh) {
        refuse(node, thing.path + " is declared twice; first in " + documents_.where(things[found->second].place));
    }
    things.push_back(std::move(thing));
    declared.push_back({node, path, file_});
    return id;
}

void Declarations::declare_command_containers()
{
    for (const auto &[command, node] : command_nodes_) {
        const Declared &at = enter(commands[command]);
        Container result;
        const char *const given = node.attribute("name").value();
        result.name = *given ? given : db_.commands[command].name;
        result.path = at.system + "/" + result.name;
        if (container_names_.contains(result.path)) { // as in a database whose command containers have equal names
            result.path = db_.commands[command].path + "/" + result.name;
        }
        result.place = place(node);
        result.of_command = true;
        const Id id = static_cast<Id>(db_.containers.size());
        if (!container_names_.emplace(result.path, id).second) {
            throw Refusal(documents_.where(result.place) + ": " + result.path + " is declared twice");
        }
        command_containers_[command] = id;
        db_.containers.push_back(std::move(result));
        containers.push_back({node, at.system, at.file});
    }
}

void Declarations::describe(Node node, const std::string &under, Named &thing)
{
    thing.name = needed(node, "name");
    if (thing.name.find('/') != std::string::npos) {
        refuse(node, "a name has no '/'; found " + thing.name);
    }
    thing.path = under + "/" + thing.name;
    spend_copied(thing.path.size());
    thing.place = place(node);
    thing.description = node.attribute("shortDescription").value();
    for (const View name :
         {View("ShortDescription"), View("LongDescription")}) { // the first is no standard, but common
        if (thing.description.empty()) {
            thing.description = trimmed(element(node, name).text().get());
        }
    }
    for (Node alias : elements(element(node, "AliasSet"))) {
        thing.aliases.emplace_back(alias.attribute("nameSpace").value(), alias.attribute("alias").value());
    }
}

Declared &Declarations::enter(Declared &thing)
{
    file_ = thing.file;
    system_ = thing.system;
    return thing;
}

void Declarations::spend_copied(std::size_t n)
{
    if ((copied_ += n) > most_copied) {
        refuse_size("its names, and what its types inherit, take more than 256 MB: shorten them, or inherit less");
    }
}

void Declarations::refuse_size(const char *reason) const
{
    throw Refusal(documents_.files()[file_] + ": " + reason);
}

// --- names

/// Find a name in this system, or in a system around it.
std::optional<Id> Declarations::find(const Names &names, const std::vector<Declared> &things, View reference) const
{
    for (std::string from = system_;; from.erase(from.rfind('/'))) {
        if ((searched_ += 16 + from.size() + reference.size()) > most_searched) {
            refuse_size("its references may mean too many names: shorten them, or their names");
        }
        if (const auto found = names.find(absolute(from, reference)); found != names.end()) {
            if (left_out(things[found->second])) {
                refuse_reference(found->first);
            }
            return found->second;
        }
        if (from.empty() || reference.starts_with('/') || reference.starts_with('.')) {
            return std::nullopt;
        }
    }
}

Id Declarations::find(Node node, const Names &names, const std::vector<Declared> &things, const std::string &reference,
                      const char *kind) const
{
    const auto found = find(names, things, reference);
    return found ? *found : refuse_as<Id>(node, std::string("there is no ") + kind + " " + reference);
}

Id Declarations::type(Node node, const char *attribute, bool argument) const
{
    const std::string reference = needed(node, attribute);
    if (const auto found = find(argument ? argument_type_names_ : type_names_, types, reference)) {
        return *found;
    }
    return find(node, argument ? type_names_ : argument_type_names_, types, reference, "type");
}

Id Declarations::parameter(Node node, const std::string &reference) const
{
    return find(node, parameter_names_, parameters, reference, "parameter");
}

Id Declarations::container(Node node, const std::string &reference) const
{
    return find(node, container_names_, containers, reference, "container");
}

Id Declarations::command(Node node, const std::string &reference) const
{
    return find(node, command_names_, commands, reference, "command");
}

std::optional<Id> Declarations::container_of(Id command) const
{
    const auto found = command_containers_.find(command);
    return found != command_containers_.end() && !left_out(containers[found->second]) ? std::optional(found->second)
                                                                                      : std::nullopt;
}

} // namespace fledge::ground::xtce
