// SPDX-License-Identifier: Apache-2.0
// The XML of XTCE files: places of nodes, values of attributes and texts. Functions that refuse throw Fault.
#pragma once

#include "ground/database/model.h"

#include <pugixml.hpp>

#include <algorithm>
#include <initializer_list>
#include <memory>
#include <optional>
#include <string_view>
#include <unordered_map>
#include <unordered_set>

namespace fledge::ground::xtce {

using Node = pugi::xml_node;
using View = std::string_view;

inline constexpr std::size_t deepest = 64;         // of nested systems, types and conditions
inline constexpr std::size_t most_text = 1 << 27;  // of all files
inline constexpr std::size_t most_faults = 10'000; // of all files

/// A fault at a node; without a node, of the item that is read.
struct Fault : Refusal {
    explicit Fault(const std::string &reason, Node at = {}) : Refusal(reason), node(at) {}
    Fault(const std::string &message, Place at) : Refusal(message), place(at) {}
    Node node;
    std::optional<Place> place; ///< if the text names it already
    bool follows = false;       ///< it follows from another fault
};

[[noreturn]] void refuse(Node node, const std::string &reason);

/// Refuse an element that its parent must not have.
[[noreturn]] void refuse_element(Node node);

/// Refuse a reference to an item that has faults.
[[noreturn]] void refuse_reference(const std::string &to);

template <class Result> [[noreturn]] Result refuse_as(Node node, const std::string &reason)
{
    refuse(node, reason);
}

// --- names and elements

/// The name of an element without its prefix.
View tag(Node node);
std::vector<Node> elements(Node node);
Node element(Node node, View name);

/// Whether any element may have this child.
bool is_common(Node node);

inline bool one_of(View name, std::initializer_list<View> names)
{
    return std::find(names.begin(), names.end(), name) != names.end();
}

// --- attributes and texts

std::string needed(Node node, const char *attribute);
bool is_true(Node node, const char *attribute, bool otherwise);
std::optional<std::string> initial(Node node);
Number any_number(Node node, View text);
std::int64_t whole(Node node, View text);
double real(Node node, View text);
double real_or(Node node, const char *attribute, double otherwise);
std::uint32_t count(Node node, View text, std::int64_t low, std::int64_t high);
std::vector<std::uint8_t> hexadecimal(Node node, View text);

/// [s] of a duration as PT1.5S.
double seconds(Node node, View text);

// --- files

class Documents {
public:
    /// Parse a file whose space system stands under another one. Throws Refusal if the files are too large, and Fault.
    void add(std::string text, const std::string &name, const std::string &under);

    const std::vector<std::string> &files() const { return files_; }
    std::uint64_t hash() const { return hash_; }
    Node root(std::size_t file) const { return documents_[file]->xml.document_element(); }
    const std::string &under(std::size_t file) const { return documents_[file]->under; }
    Place place(Node node) const;
    std::string where(Place place) const { return files_[place.file] + ":" + std::to_string(place.line); }

private:
    struct Document {
        std::string text, under;
        std::vector<std::size_t> lines;
        pugi::xml_document xml;

        std::uint32_t line(std::ptrdiff_t offset) const;
    };
    void parse(Document &document, std::uint32_t file);

    std::vector<std::unique_ptr<Document>> documents_;
    std::unordered_map<const void *, std::uint32_t> file_of_; ///< by the root
    std::vector<std::string> files_;
    std::uint64_t hash_ = Database().hash;
    std::size_t bytes_ = 0;
    std::ptrdiff_t n_elements_ = 0;
};

/// The faults of files, and the nodes that are left out because of them.
class Faults {
public:
    explicit Faults(const Documents &documents) : documents_(documents) {}

    /// Leave out an item, whose name or path is given.
    void add(const Fault &fault, Node thing, const std::string &path);
    bool empty() const { return faults_.empty(); }
    const std::string &first() const { return faults_[0].message; }
    bool left_out(Node node) const { return !left_out_.empty() && left_out_.contains(node.internal_object()); }

    /// Throw Refusal if there are faults; its message has all except those that follow from others.
    void refuse();

    /// Return the texts of all faults with the items left out, and clear the faults. The nodes stay left out.
    std::vector<std::string> take();

private:
    struct Entry {
        std::string message, thing;
        Place place;
        bool follows;
    };
    const Documents &documents_;
    std::vector<Entry> faults_;
    std::unordered_set<const void *> left_out_;
};

} // namespace fledge::ground::xtce
