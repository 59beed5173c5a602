// SPDX-License-Identifier: Apache-2.0
// The items that XTCE files declare, by name, before readers fill them in.
#pragma once

#include "ground/database/xtce/xml.h"

#include <map>

namespace fledge::ground::xtce {

struct Declared {
    enum class Read : std::uint8_t { nothing, structure_begun, structure, all };
    Node node;
    std::string system; ///< its path
    std::uint32_t file = 0;
    Read read = Read::nothing; ///< how much of a type is filled in
};

class Declarations {
public:
    /// searched: the effort of all rounds for finding names.
    Declarations(Database &database, const Documents &documents, Faults &faults, std::size_t &searched)
        : db_(database), documents_(documents), faults_(faults), searched_(searched)
    {
    }

    /// The space systems of all files. The containers of commands have no set of their own: they are declared last.
    void declare();

    /// Look up names from the system of a thing from now on. Returns the thing.
    Declared &enter(Declared &thing);

    void describe(Node node, const std::string &under, Named &thing);
    void note(Node node, const std::string &text)
    {
        db_.notes.push_back(documents_.where(documents_.place(node)) + ": " + text);
    }
    Place place(Node node) const { return documents_.place(node); }

    // --- names: each function refuses items that do not exist or have faults

    Id type(Node node, const char *attribute, bool argument) const;
    std::optional<Id> parameter(View reference) const { return find(parameter_names_, parameters, reference); }
    Id parameter(Node node, const std::string &reference) const;
    Id container(Node node, const std::string &reference) const;
    Id command(Node node, const std::string &reference) const;
    std::optional<Id> container_of(Id command) const;

    // --- faults

    /// Do an action for a thing, which is left out if the action finds a fault.
    template <class Do> bool attempt(Node thing, const std::string &path, Do action)
    {
        const std::uint32_t file = file_;
        try {
            action();
            return true;
        } catch (const Fault &fault) {
            file_ = file;
            faults_.add(fault, thing, path);
            return false;
        }
    }

    void fault(Declared &thing, const std::string &path, const std::string &reason)
    {
        attempt(enter(thing).node, path, [&] { refuse(thing.node, reason); });
    }

    bool left_out(const Declared &thing) const { return faults_.left_out(thing.node); }

    /// Do an action for each thing that is not left out.
    template <class Things, class Do> void each(Things &things, std::vector<Declared> &declared, Do action)
    {
        for (Id i = 0; i < things.size(); i++) {
            if (!left_out(declared[i])) {
                enter(declared[i]);
                attempt(declared[i].node, things[i].path, [&] { action(i); });
            }
        }
    }

    /// Do an action for each element of a node that is not left out: one in which it finds a fault is.
    template <class Do> void parts(Node node, const std::string &path, Do action)
    {
        for (Node child : elements(node)) {
            if (!faults_.left_out(child)) {
                const std::string name(trimmed(child.attribute("name").value()));
                attempt(child, name.empty() ? "<" + std::string(tag(child)) + ">" : path + "/" + name,
                        [&] { action(child); });
            }
        }
    }

    /// Count the data that grow faster than the files: [bytes] of paths, and of what types inherit.
    void spend_copied(std::size_t n);

    /// Throw Refusal with the file of the thing that was entered.
    [[noreturn]] void refuse_size(const char *reason) const;

    std::vector<Declared> types, parameters, containers, commands; ///< in the order of the database's

private:
    using Names = std::unordered_map<std::string, Id>;

    void declare_system(Node node, const std::string &under, std::size_t depth);
    void declare_set(Node set, const std::string &path);
    void declare_part(Node node, View set, const std::string &path);
    void declare_command_containers();
    template <class Things>
    Id declare(Node node, const std::string &path, Things &things, std::vector<Declared> &declared, Names &names);
    std::optional<Id> find(const Names &names, const std::vector<Declared> &things, View reference) const;
    Id find(Node node, const Names &names, const std::vector<Declared> &things, const std::string &reference,
            const char *kind) const;

    Database &db_;
    const Documents &documents_;
    Faults &faults_;
    std::size_t &searched_;
    Names system_names_, type_names_, argument_type_names_, parameter_names_, container_names_, command_names_;
    std::vector<std::pair<Id, Node>> command_nodes_; ///< containers of commands
    std::map<Id, Id> command_containers_;
    std::uint32_t file_ = 0;
    std::string system_;
    std::size_t copied_ = 0;
};

} // namespace fledge::ground::xtce
