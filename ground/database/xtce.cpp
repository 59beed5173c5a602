// SPDX-License-Identifier: Apache-2.0
#include "ground/database/xtce.h"

#include "ground/database/calibrate.h"

#include <pugixml.hpp>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <sstream>
#include <string_view>
#include <unordered_map>
#include <unordered_set>

namespace fledge::ground {

namespace {

using Node = pugi::xml_node;
using View = std::string_view;
using Sort = Type::Sort;

constexpr View of_argument = "/yamcs/cmd/arg/";
constexpr std::size_t deepest = 64;               // of nested systems, types and conditions
constexpr std::size_t most_text = 1 << 27;        // of all files
constexpr std::ptrdiff_t most_elements = 1 << 23; // of all files
constexpr std::size_t most_copied = 1 << 28;      // [bytes] of paths, and of what types inherit
constexpr std::size_t most_searched = 1 << 28;    // characters of the names that references may mean
constexpr std::uint64_t most_values = 1 << 20;    // of a type; of all entries, 16 times as many
constexpr std::int64_t most_quantity = std::int64_t(1) << 40;
constexpr std::size_t most_steps = 1024;    // of a calculation
constexpr std::size_t most_of_fault = 1000; // characters of a fault
constexpr std::size_t most_faults = 10'000;
constexpr std::size_t most_shown = 100; // faults of a message
constexpr int most_rounds = 100;
constexpr const char *too_many_copies =
    "its names, and what its types inherit, take more than 256 MB: shorten them, or inherit less";
constexpr const char *too_many_values = "a value has more than 2^20 members and elements";

View tag(Node node)
{
    const View name = node.name();
    return name.substr(name.find(':') + 1); // npos + 1 is 0
}

std::string trimmed(View text)
{
    const auto first = text.find_first_not_of(" \t\r\n"), last = text.find_last_not_of(" \t\r\n");
    return first == View::npos ? "" : std::string(text.substr(first, last - first + 1));
}

bool one_of(View name, std::initializer_list<View> names)
{
    return std::find(names.begin(), names.end(), name) != names.end();
}

template <class Number> std::optional<Number> number(View text)
{
    if (text.starts_with('+')) {
        text.remove_prefix(1);
    }
    Number value{};
    const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), value);
    return fault == std::errc() && end == text.data() + text.size() && !text.empty() ? std::optional(value)
                                                                                     : std::nullopt;
}

/// What is wrong at a place; `follows`: because something else is.
struct Fault : Refusal {
    Fault(const std::string &reason, Place at, bool because = false) : Refusal(reason), place(at), follows(because) {}
    Place place;
    bool follows;
    std::string thing; ///< that has it
};

/// What a document declares, until it is filled in.
struct Declared {
    Node node;
    std::string system; ///< its path
    std::uint32_t file = 0;
    int state = 0; ///< 1: being filled in; 2: done
};

/// Whether a text is UTF-8 of characters that XML has, which pugixml does not look at.
bool is_text(const char *at)
{
    while (const auto first = static_cast<std::uint8_t>(*at++)) {
        const int more = first < 0x80 ? 0 : first < 0xE0 ? 1 : first < 0xF0 ? 2 : 3;
        std::uint32_t point = more == 0 ? first : first & (0x3Fu >> more);
        for (int i = 0; i < more; i++, at++) {
            if ((static_cast<std::uint8_t>(*at) & 0xC0u) != 0x80u) {
                return false;
            }
            point = point << 6 | (static_cast<std::uint8_t>(*at) & 0x3Fu);
        }
        static constexpr std::uint32_t least[] = {0x20, 0x80, 0x800, 0x10000};
        if ((point < least[more] && point != '\t' && point != '\n' && point != '\r') || point > 0x10FFFF ||
            (first >= 0x80 && first < 0xC0) || first >= 0xF8 || (point >= 0xD800 && point < 0xE000)) {
            return false;
        }
    }
    return true;
}

struct Texts : pugi::xml_tree_walker {
    Node wrong;

    bool for_each(Node &node) override
    {
        bool good = is_text(node.name()) && is_text(node.value());
        for (const auto &one : node.attributes()) {
            good = good && is_text(one.name()) && is_text(one.value());
        }
        wrong = good ? Node() : node.type() == pugi::node_element ? node : node.parent();
        return good;
    }
};

class Reader {
public:
    explicit Reader(Database &database) : db_(database) {}

    void take(std::string text, const std::string &name, const std::string &under)
    {
        file_ = static_cast<std::uint32_t>(db_.files.size());
        db_.files.push_back(name);
        for (const std::string *part : std::initializer_list<const std::string *>{&under, &text}) {
            for (const char c : *part) {
                db_.hash = (db_.hash ^ static_cast<std::uint8_t>(c)) * 0x100000001B3;
            }
        }
        bytes_ += text.size();
        n_elements_ += std::count(text.begin(), text.end(), '<');
        if (bytes_ > most_text || n_elements_ > most_elements) {
            throw Refusal(name + ": a database has at most 128 MB and 8 million elements and ends of them");
        }
        Document &document = *documents_.emplace_back(std::make_unique<Document>());
        document.text = std::move(text);
        document.under = under;
        for (std::size_t i = 0; i < document.text.size(); i++) {
            if (document.text[i] == '\n') {
                document.lines.push_back(i);
            }
        }
        attempt({}, name, [&] { parse(document, name); });
    }

    /// Fill in the database. All that is wrong is refused at once; lenient: it is left out, and in further rounds all
    /// that refers to what is not there.
    void finish(bool lenient)
    {
        refuse_faults();
        const std::vector<std::string> files = db_.files;
        const std::uint64_t hash = db_.hash;
        for (int round = 0;; round++) {
            std::vector<std::string> left_out = std::move(db_.left_out);
            db_ = Database();
            db_.files = files;
            db_.hash = hash;
            db_.left_out = std::move(left_out);
            for (file_ = 0; file_ < files.size(); file_++) {
                if (const Node root = documents_[file_]->xml.document_element(); !left(root)) {
                    attempt(root, "<SpaceSystem>", [&] { declare_system(root, documents_[file_]->under, 0); });
                }
            }
            declare_command_containers();
            fill();
            if (faults_.empty()) {
                return;
            }
            if (!lenient) {
                refuse_faults();
            }
            if (round == most_rounds) {
                throw Refusal(std::string(faults_[0].what()) + "; more than " + std::to_string(most_rounds) +
                              " things depend on one another and on a fault");
            }
            for (const Fault &one : faults_) {
                db_.left_out.push_back(std::string(one.what()) + "; " + one.thing + " is left out");
            }
            const auto skip = std::move(left_);
            clear();
            left_ = skip;
        }
    }

private:
    struct Document {
        std::string text, under;
        std::vector<std::size_t> lines;
        pugi::xml_document xml;
    };
    using Names = std::unordered_map<std::string, Id>;

    void parse(Document &document, const std::string &name)
    {
        if (document.text.starts_with("\xFE\xFF") || document.text.starts_with("\xFF\xFE")) {
            throw Fault(name + ": write the file in UTF-8; it is in UTF-16", {file_, 1});
        }
        // A document type, and with it entities of its own, is passed over: an entity stays as it is written.
        const auto result = document.xml.load_buffer(document.text.data(), document.text.size(),
                                                     pugi::parse_default | pugi::parse_trim_pcdata);
        if (!result) {
            const Place at{file_, line_at(file_, result.offset)};
            throw Fault(db_.where(at) + ": " + result.description(), at);
        }
        Texts texts;
        document.xml.traverse(texts);
        if (texts.wrong) {
            refuse(texts.wrong, "a name or text is not UTF-8, or has a character that XML does not");
        }
        const Node root = document.xml.document_element();
        if (tag(root) != "SpaceSystem") {
            refuse(root, "the root must be SpaceSystem; found " + std::string(tag(root)));
        }
        const View full = root.name();
        const std::string prefix(full.substr(0, std::min(full.find(':'), full.size())));
        const bool prefixed = prefix.size() < full.size();
        const std::string space = root.attribute(prefixed ? ("xmlns:" + prefix).c_str() : "xmlns").value();
        if (prefixed && space.empty()) {
            refuse(root, "the prefix " + prefix + " has no name space: xmlns:" + prefix + " is missing");
        }
        if (!one_of(space, {"", "http://www.omg.org/space/xtce", "http://www.omg.org/spec/XTCE/20180204"})) {
            refuse(root, "the name space " + space + (space.ends_with("/XTCE/20250214") ? ", XTCE 1.3," : "") +
                             " is not read: XTCE 1.0 and 1.1 have http://www.omg.org/space/xtce, and 1.2 has "
                             "http://www.omg.org/spec/XTCE/20180204");
        }
    }

    void fill()
    {
        values_.assign(db_.types.size(), 0);
        encoded_.assign(db_.types.size(), false);
        for (Id i = 0; i < db_.types.size(); i++) {
            if (!left(types_[i].node)) {
                attempt(enter(types_[i]).node, db_.types[i].path, [&] { structure_of(i, 0); });
            }
        }
        each(db_.parameters, parameters_,
             [&](Id i) { db_.parameters[i].type = type_of(parameters_[i].node, "parameterTypeRef", false); });
        for (Id i = 0; i < db_.types.size(); i++) {
            if (!left(types_[i].node)) {
                fill_type(i);
            }
        }
        each(db_.parameters, parameters_, [&](Id i) { fill_parameter(i); });
        each(db_.containers, containers_, [&](Id i) { fill_container(db_.containers[i], containers_[i].node); });
        each(db_.commands, commands_, [&](Id i) { fill_command(i); });
        refuse_loops();
        refuse_doubtful_ends();
        for (Id i = 0; i < db_.containers.size(); i++) {
            if (db_.containers[i].base != no_id) {
                db_.containers[db_.containers[i].base].heirs.push_back(i);
            }
        }
    }

    /// Of what earlier rounds declared.
    void clear()
    {
        for (auto *one : {&types_, &parameters_, &containers_, &commands_}) {
            one->clear();
        }
        for (Names *one : {&system_names_, &type_names_, &argument_type_names_, &parameter_names_, &container_names_,
                           &command_names_}) {
            one->clear();
        }
        command_containers_.clear();
        command_container_paths_.clear();
        bases_.clear();
        member_names_.clear();
        faults_.clear();
        copied_ = 0;
        entry_values_ = 0;
    }

    // --- faults

    /// Do what is needed for a thing: what is wrong is noted, and the thing is left out.
    template <class Do> bool attempt(Node thing, const std::string &path, Do what)
    {
        const std::uint32_t file = file_;
        try {
            what();
            return true;
        } catch (const Fault &fault) {
            file_ = file;
            const Place at = fault.place.line == 0 ? place(thing) : fault.place;
            faults_.emplace_back((fault.place.line == 0 ? db_.where(at) + ": " : "") + fault.what(), at, fault.follows);
            faults_.back().thing = path;
            if (faults_.size() > most_faults) {
                refuse_faults();
                throw Refusal(db_.files[file_] + ": too much refers to what has faults");
            }
            left_.insert(thing.internal_object());
            return false;
        }
    }

    void fault(Declared &thing, const std::string &path, const std::string &reason)
    {
        attempt(enter(thing).node, path, [&] { refuse(thing.node, reason); });
    }

    template <class Things, class Do> void each(Things &things, std::vector<Declared> &declared, Do what)
    {
        for (Id i = 0; i < things.size(); i++) {
            if (!left(declared[i].node)) {
                enter(declared[i]);
                attempt(declared[i].node, things[i].path, [&] { what(i); });
            }
        }
    }

    bool left(Node node) const { return !left_.empty() && left_.contains(node.internal_object()); }

    /// With all faults in a message, those that follow from others left away.
    void refuse_faults()
    {
        std::stable_sort(faults_.begin(), faults_.end(), [](const Fault &a, const Fault &b) {
            return std::pair(a.place.file, a.place.line) < std::pair(b.place.file, b.place.line);
        });
        std::string all;
        std::size_t n = 0;
        for (const Fault &one : faults_) {
            if (!one.follows && ++n <= most_shown) {
                all += (all.empty() ? "" : "\n") + std::string(one.what());
            }
        }
        if (n > most_shown) {
            all += "\nand " + std::to_string(n - most_shown) + " more faults";
        }
        if (n > 0) {
            throw Refusal(all);
        }
    }

    /// Count what grows faster than the file.
    void spend(std::size_t &sum, std::size_t n, std::size_t most, const char *what) const
    {
        if ((sum += n) > most) {
            throw Refusal(db_.files[file_] + ": " + what);
        }
    }

    // --- places and complaints

    std::uint32_t line_at(std::uint32_t file, std::ptrdiff_t offset) const
    {
        const auto &lines = documents_[file]->lines;
        return static_cast<std::uint32_t>(
            std::lower_bound(lines.begin(), lines.end(),
                             static_cast<std::size_t>(std::max<std::ptrdiff_t>(offset, 0))) -
            lines.begin() + 1);
    }

    Place place(Node node) const { return {file_, line_at(file_, node.offset_debug())}; }

    [[noreturn]] void refuse(Node node, const std::string &reason) const
    {
        std::size_t n = reason.size() <= most_of_fault ? reason.size() : most_of_fault;
        while (n < reason.size() && n > 0 && (reason[n] & 0xC0) == 0x80) { // not within a character
            n--;
        }
        throw Fault(db_.where(place(node)) + ": " + reason.substr(0, n) + (n < reason.size() ? "..." : ""),
                    place(node));
    }

    [[noreturn]] void stray(Node node) const
    {
        refuse(node, "<" + std::string(tag(node)) + "> is not known in <" + std::string(tag(node.parent())) + ">");
    }

    void note(Node node, const std::string &text) { db_.notes.push_back(db_.where(place(node)) + ": " + text); }

    /// The elements of a node.
    static std::vector<Node> elements(Node node)
    {
        std::vector<Node> found;
        for (Node child : node.children()) {
            if (child.type() == pugi::node_element) {
                found.push_back(child);
            }
        }
        return found;
    }

    static Node element(Node node, View name)
    {
        for (Node child : node.children()) {
            if (tag(child) == name) {
                return child;
            }
        }
        return {};
    }

    // --- attributes and texts

    std::string needed(Node node, const char *attribute) const
    {
        const std::string text = trimmed(node.attribute(attribute).value());
        return !text.empty()
                   ? text
                   : refuse_as<std::string>(node, "<" + std::string(tag(node)) + "> needs the attribute " + attribute);
    }

    template <class Result> [[noreturn]] Result refuse_as(Node node, const std::string &reason) const
    {
        refuse(node, reason);
    }

    std::int64_t whole(Node node, View text) const
    {
        const auto value = number<std::int64_t>(trimmed(text));
        return value ? *value : refuse_as<std::int64_t>(node, "'" + std::string(text) + "' is no whole number");
    }

    double real(Node node, View text) const
    {
        const auto value = number<double>(trimmed(text));
        return value ? *value : refuse_as<double>(node, "'" + std::string(text) + "' is no number");
    }

    double real_or(Node node, const char *attribute, double otherwise) const
    {
        const auto found = node.attribute(attribute);
        return found ? real(node, found.value()) : otherwise;
    }

    std::uint32_t count(Node node, View text, std::int64_t low, std::int64_t high) const
    {
        const std::int64_t value = whole(node, text);
        if (value < low || value > high) {
            refuse(node, "<" + std::string(tag(node)) + "> must be " + std::to_string(low) + " to " +
                             std::to_string(high) + "; found " + std::to_string(value));
        }
        return static_cast<std::uint32_t>(value);
    }

    std::vector<std::uint8_t> hexadecimal(Node node, View text) const
    {
        const std::string digits = (text.size() % 2 == 0 ? "" : "0") + std::string(text);
        std::vector<std::uint8_t> bytes(digits.size() / 2);
        for (std::size_t i = 0; i < bytes.size(); i++) {
            const char *const end = &digits[2 * i] + 2;
            if (std::from_chars(&digits[2 * i], end, bytes[i], 16).ptr != end) {
                refuse(node, "'" + std::string(text) + "' is not hexadecimal");
            }
        }
        return bytes;
    }

    std::optional<std::string> initial(Node node) const
    {
        const auto found = node.attribute("initialValue");
        return found ? std::optional<std::string>(found.value()) : std::nullopt;
    }

    static bool is_true(Node node, const char *attribute, bool otherwise)
    {
        return node.attribute(attribute).as_bool(otherwise);
    }

    // --- what the document declares

    void declare_system(Node node, const std::string &under, std::size_t depth)
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
        const auto part = [&](Node child) {
            const View name = tag(child);
            if (name == "SpaceSystem") {
                declare_system(child, path, depth + 1);
            } else if (name == "TelemetryMetaData" || name == "CommandMetaData") {
                parts(child, path, [&](Node set) { declare_set(set, path); });
            } else if (name == "ServiceSet") {
                note(child, "services are not computed");
            } else if (!common(child) && name != "Header") {
                stray(child);
            }
        };
        parts(node, path, part);
    }

    /// Do it for each element of a node that has not been left out.
    template <class Do> void parts(Node node, const std::string &path, Do what)
    {
        for (Node child : elements(node)) {
            if (!left(child)) {
                const std::string name = trimmed(child.attribute("name").value());
                attempt(child, name.empty() ? "<" + std::string(tag(child)) + ">" : path + "/" + name,
                        [&] { what(child); });
            }
        }
    }

    void declare_set(Node set, const std::string &path)
    {
        const View name = tag(set);
        if (one_of(name, {"StreamSet", "MessageSet", "AlgorithmSet"})) {
            note(set, std::string(name) + " is not computed");
            return;
        }
        if (!one_of(name, {"ParameterTypeSet", "ArgumentTypeSet", "ParameterSet", "ContainerSet", "CommandContainerSet",
                           "MetaCommandSet"})) {
            stray(set);
        }
        parts(set, path, [&](Node node) {
            const View kind = tag(node);
            if (name == "ParameterTypeSet" || name == "ArgumentTypeSet") {
                declare(node, path, db_.types, types_, name == "ParameterTypeSet" ? type_names_ : argument_type_names_);
            } else if (name == "ParameterSet" && kind == "Parameter") {
                declare(node, path, db_.parameters, parameters_, parameter_names_);
            } else if (name == "ParameterSet" && kind == "ParameterRef") {
                return; // a parameter of another system, which needs no second name here
            } else if (name == "ContainerSet" || name == "CommandContainerSet") {
                if (kind != "SequenceContainer" && (kind != "CommandContainer" || name == "ContainerSet")) {
                    stray(node);
                }
                declare(node, path, db_.containers, containers_, container_names_);
            } else if (kind == "MetaCommand") {
                declare(node, path, db_.commands, commands_, command_names_);
                if (const Node container = element(node, "CommandContainer")) {
                    command_containers_.emplace_back(db_.commands.size() - 1, container);
                }
            } else if (kind == "BlockMetaCommand" || kind == "MetaCommandRef") {
                note(node, std::string(kind) + " is not computed");
            } else {
                stray(node);
            }
        });
    }

    template <class Things>
    Id declare(Node node, const std::string &path, Things &things, std::vector<Declared> &declared, Names &names)
    {
        typename Things::value_type thing;
        describe(node, path, thing);
        const Id id = static_cast<Id>(things.size());
        if (const auto [found, fresh] = names.emplace(thing.path, id); !fresh) {
            refuse(node, thing.path + " is declared twice; first in " + db_.where(things[found->second].place));
        }
        things.push_back(std::move(thing));
        declared.push_back({node, path, file_, 0});
        return id;
    }

    void describe(Node node, const std::string &under, Named &thing)
    {
        thing.name = needed(node, "name");
        if (thing.name.find('/') != std::string::npos) {
            refuse(node, "a name has no '/'; found " + thing.name);
        }
        thing.path = under + "/" + thing.name;
        spend(copied_, thing.path.size(), most_copied, too_many_copies);
        thing.place = place(node);
        thing.description = node.attribute("shortDescription").value();
        if (const Node text = element(node, "LongDescription"); text && thing.description.empty()) {
            thing.description = trimmed(text.text().get());
        }
        for (Node alias : elements(element(node, "AliasSet"))) {
            thing.aliases.emplace_back(alias.attribute("nameSpace").value(), alias.attribute("alias").value());
        }
    }

    static bool common(Node node) { return one_of(tag(node), {"LongDescription", "AliasSet", "AncillaryDataSet"}); }

    Declared &enter(Declared &at)
    {
        file_ = at.file;
        system_ = at.system;
        return at;
    }

    // --- names

    /// The path of a reference, seen from a system; "" if it leads out of the tree.
    static std::string absolute(const std::string &from, View reference)
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

    /// In this system, or in one around it.
    std::optional<Id> find(const Names &names, View reference) const
    {
        for (std::string from = system_;; from.erase(from.rfind('/'))) {
            spend(searched_, 16 + from.size() + reference.size(), most_searched,
                  "its references may mean too many names: shorten them, or their names");
            if (const auto found = names.find(absolute(from, reference)); found != names.end()) {
                const Declared &one = (&names == &container_names_   ? containers_
                                       : &names == &command_names_   ? commands_
                                       : &names == &parameter_names_ ? parameters_
                                                                     : types_)[found->second];
                if (left(one.node)) {
                    throw Fault(found->first + " has faults", {}, true);
                }
                return found->second;
            }
            if (from.empty() || reference.starts_with('/') || reference.starts_with('.')) {
                return std::nullopt;
            }
        }
    }

    Id find(Node node, const Names &names, const std::string &reference, const char *what) const
    {
        const auto found = find(names, reference);
        return found ? *found : refuse_as<Id>(node, std::string("there is no ") + what + " " + reference);
    }

    Id type_of(Node node, const char *attribute, bool argument) const
    {
        const std::string reference = needed(node, attribute);
        if (const auto found = find(argument ? argument_type_names_ : type_names_, reference)) {
            return *found;
        }
        return find(node, argument ? type_names_ : argument_type_names_, reference, "type");
    }

    std::optional<Reference> parameter_reference(Node node, const std::string &text) const
    {
        for (std::size_t end = text.size(); end != std::string::npos && end > 0;
             end = text.find_last_of("/.[", end - 1)) {
            if (const auto found = find(parameter_names_, View(text).substr(0, end))) {
                Reference reference;
                reference.of = Reference::Of::parameter;
                reference.parameter = *found;
                reference.name = text;
                Id at = db_.parameters[*found].type;
                for (std::size_t i = end; i < text.size();) {
                    const std::size_t next = std::min(text.find_first_of("/.[", i + 1), text.size());
                    const std::string step = text.substr(i + 1, next - i - 1);
                    const Type &type = db_.types[at];
                    const auto member = std::find_if(type.members.begin(), type.members.end(),
                                                     [&](const Member &one) { return one.name == step; });
                    if (text[i] == '[' && type.sort == Type::Sort::array && step.ends_with(']')) {
                        reference.steps.push_back(count(node, View(step).substr(0, step.size() - 1), 0, 1 << 20));
                        at = type.element;
                    } else if (text[i] != '[' && member != type.members.end()) {
                        reference.steps.push_back(static_cast<std::uint32_t>(member - type.members.begin()));
                        at = member->type;
                    } else {
                        refuse(node, type.path + " has no " + step);
                    }
                    i = next;
                }
                return reference;
            }
        }
        return std::nullopt;
    }

    Reference reference(Node node)
    {
        Reference made;
        if (const auto argument = node.attribute("argumentRef")) {
            made.of = Reference::Of::argument;
            made.name = argument.value();
        } else {
            const std::string text = needed(node, "parameterRef");
            if (auto found = parameter_reference(node, text)) {
                made = *found;
            } else if ((outside_ && text.starts_with("/yamcs/")) || member_names_.contains(text)) {
                made.of = Reference::Of::argument; // beside it, or of another program, which has arguments in this way
                made.name = text.starts_with(of_argument) ? text.substr(of_argument.size()) : text;
            } else {
                refuse(node, "there is no parameter " + text);
            }
        }
        if (node.attribute("instance").as_int(0) != 0) {
            refuse(node, "only the last value of " + made.name + " is kept: instance must be 0");
        }
        made.calibrated = is_true(node, "useCalibratedValue", true);
        return made;
    }

    // --- conditions and quantities

    Operator comparison(Node node, View text) const
    {
        constexpr View operators[] = {"==", "!=", "<", "<=", ">", ">="};
        const auto found = std::find(std::begin(operators), std::end(operators), trimmed(text));
        return found != std::end(operators)
                   ? static_cast<Operator>(found - std::begin(operators))
                   : refuse_as<Operator>(node, "'" + std::string(text) + "' is no operator of a comparison");
    }

    Condition one_condition(Node node, std::size_t depth)
    {
        const View name = tag(node);
        Condition made;
        if (depth > deepest) {
            refuse(node, "conditions are nested deeper than " + std::to_string(deepest));
        }
        if (name == "Comparison") {
            made.what = Condition::What::compare;
            const Node inner = elements(node).empty() ? node : elements(node).front();
            made.left = reference(inner);
            made.op = comparison(node, node.attribute("comparisonOperator").as_string("=="));
            const auto value = node.attribute("value");
            made.literal = literal_of(value ? value.value()
                                            : refuse_as<const char *>(node, "<Comparison> needs the attribute value"));
            made.text =
                made.left.name + " " + node.attribute("comparisonOperator").as_string("==") + " " + made.literal.text;
        } else if (name == "Condition") {
            made.what = Condition::What::compare;
            int place = 0;
            for (Node child : elements(node)) {
                if (one_of(tag(child), {"ParameterInstanceRef", "ArgumentInstanceRef"}) && place < 2) {
                    (place++ == 0 ? made.left : made.right) = reference(child);
                } else if (tag(child) == "ComparisonOperator") {
                    made.op = comparison(child, child.text().get());
                    made.text = trimmed(child.text().get());
                } else if (tag(child) == "Value" && place == 1) {
                    made.literal = literal_of(child.text().get());
                    place++;
                } else {
                    stray(child);
                }
            }
            if (place != 2 || made.text.empty()) {
                refuse(node, "a condition compares two values, or a value with a constant");
            }
            made.text = made.left.name + " " + made.text + " " +
                        (made.right.of == Reference::Of::nothing    ? made.literal.text
                         : made.right.of == Reference::Of::argument ? "argument " + made.right.name
                                                                    : made.right.name);
        } else {
            made.what = name == "ORedConditions" ? Condition::What::any : Condition::What::all;
            if (!one_of(name, {"ComparisonList", "BooleanExpression", "ANDedConditions", "ORedConditions"})) {
                stray(node);
            }
            for (Node child : elements(node)) {
                made.parts.push_back(one_condition(child, depth + 1));
            }
            if (made.parts.empty()) {
                refuse(node, "<" + std::string(name) + "> has no condition");
            }
        }
        return made;
    }

    static bool is_condition(Node node)
    {
        return one_of(tag(node), {"Comparison", "ComparisonList", "BooleanExpression"});
    }

    /// The condition that a node holds, and nothing else.
    Condition condition(Node node)
    {
        const auto inside = elements(node);
        if (inside.size() != 1 || !is_condition(inside[0])) {
            refuse(inside.size() > 1 ? inside[1] : node, "<" + std::string(tag(node)) +
                                                             "> must hold one Comparison, ComparisonList or "
                                                             "BooleanExpression");
        }
        return one_condition(inside[0], 0);
    }

    Quantity quantity(Node node)
    {
        Quantity made;
        for (Node child : elements(node)) {
            if (one_of(tag(child), {"FixedValue", "Fixed"})) {
                const Node value = tag(child) == "Fixed" ? element(child, "FixedValue") : child;
                made.fixed = whole(child, value.text().get());
                if (made.fixed > most_quantity || made.fixed < -most_quantity) {
                    refuse(child, "a size, a place or a number is at most 2^40; found " + std::to_string(made.fixed));
                }
                return made;
            }
            if (tag(child) == "DynamicValue") {
                for (Node part : elements(child)) {
                    if (one_of(tag(part), {"ParameterInstanceRef", "ArgumentInstanceRef"})) {
                        made.from = reference(part);
                    } else if (tag(part) == "LinearAdjustment") {
                        made.slope = real_or(part, "slope", 1);
                        made.intercept = real_or(part, "intercept", 0);
                    } else {
                        stray(part);
                    }
                }
                return made.from.of != Reference::Of::nothing
                           ? made
                           : refuse_as<Quantity>(child, "<DynamicValue> refers to nothing");
            }
            if (tag(child) == "DiscreteLookupList") {
                made.looked_up = true;
                for (Node one : elements(child)) {
                    if (tag(one) != "DiscreteLookup" || elements(one).size() != 1) {
                        refuse(one, "a lookup has one condition and a value");
                    }
                    made.cases.emplace_back(
                        one_condition(elements(one)[0], 0),
                        std::clamp(whole(one, needed(one, "value")), -most_quantity, most_quantity));
                }
                return made;
            }
        }
        refuse(node, "<" + std::string(tag(node)) + "> has no value");
    }

    std::vector<Dimension> dimensions(Node node)
    {
        std::vector<Dimension> made;
        for (Node child : elements(node)) {
            Dimension one;
            if (tag(child) == "Size") { // how many, not the last index
                one.last = quantity(child);
                one.last.fixed--;
                one.last.intercept--;
                for (auto &[condition, value] : one.last.cases) {
                    value--;
                }
            } else if (tag(child) == "Dimension") {
                one.first = quantity(element(child, "StartingIndex"));
                one.last = quantity(element(child, "EndingIndex"));
            } else {
                stray(child);
            }
            made.push_back(std::move(one));
        }
        return made;
    }

    // --- types

    static std::optional<Type::Sort> sort_of(View name)
    {
        static const std::map<View, Sort> sorts = {{"Integer", Sort::integer},
                                                   {"Float", Sort::real},
                                                   {"Enumerated", Sort::enumerated},
                                                   {"Boolean", Sort::boolean},
                                                   {"String", Sort::text},
                                                   {"Binary", Sort::binary},
                                                   {"AbsoluteTime", Sort::absolute_time},
                                                   {"RelativeTime", Sort::relative_time},
                                                   {"Aggregate", Sort::aggregate},
                                                   {"Array", Sort::array}};
        for (const View end : {View("ParameterType"), View("ArgumentType")}) {
            if (name.ends_with(end)) {
                const auto found = sorts.find(name.substr(0, name.size() - end.size()));
                return found != sorts.end() ? std::optional(found->second) : std::nullopt;
            }
        }
        return std::nullopt;
    }

    /// The sort, the members and the element of a type, after those of its base.
    void structure(Id id, std::size_t depth)
    {
        const Declared &at = types_[id];
        if (left(at.node) || !attempt(enter(types_[id]).node, db_.types[id].path, [&] { structure_of(id, depth); })) {
            throw Fault(db_.types[id].path + " has faults", {}, true);
        }
    }

    void structure_of(Id id, std::size_t depth)
    {
        Declared &at = types_[id];
        if (at.state == 2) {
            return;
        }
        const Node node = at.node;
        if (at.state == 1 || depth > deepest) {
            refuse(node, "the type " + db_.types[id].name + " contains or extends itself" +
                             (at.state == 1 ? "" : ", or is nested deeper than " + std::to_string(deepest)));
        }
        at.state = 1;
        const auto sort = sort_of(tag(node));
        if (!sort) {
            stray(node);
        }
        const bool argument = tag(node).ends_with("ArgumentType");
        db_.types[id].sort = *sort;
        if (node.attribute("baseType")) {
            const Id base = type_of(node, "baseType", argument);
            structure(base, depth + 1);
            enter(at);
            if (db_.types[base].sort != *sort &&
                std::max(db_.types[base].sort, *sort) >= Type::Sort::aggregate) { // others lend their encoding
                refuse(node, "the base " + db_.types[base].name + " is of another kind");
            }
            spend(copied_, db_.types[base].members.size() * sizeof(Member), most_copied, too_many_copies);
            db_.types[id].members = db_.types[base].members;
            db_.types[id].element = db_.types[base].element;
            bases_[id] = base;
        }
        if (*sort == Type::Sort::array && node.attribute("arrayTypeRef")) {
            db_.types[id].element = type_of(node, "arrayTypeRef", argument);
        }
        for (Node one : elements(element(node, "MemberList"))) {
            if (tag(one) != "Member") {
                stray(one);
            }
            Member member{needed(one, "name"),
                          type_of(one, one.attribute("typeRef") ? "typeRef" : "parameterTypeRef", argument),
                          initial(one)};
            member_names_.insert(member.name);
            db_.types[id].members.push_back(std::move(member));
        }
        if (*sort == Type::Sort::array && db_.types[id].element == no_id) {
            refuse(node, "an array needs the attribute arrayTypeRef");
        }
        std::uint64_t n = 1;
        for (std::size_t i = 0; i < db_.types[id].members.size(); i++) {
            structure(db_.types[id].members[i].type, depth + 1);
            n += values_[db_.types[id].members[i].type];
        }
        if (db_.types[id].element != no_id) {
            structure(db_.types[id].element, depth + 1);
            n += values_[db_.types[id].element];
        }
        enter(at).state = 2;
        values_[id] = n;
        if (n > most_values) {
            refuse(node, too_many_values);
        }
    }

    void fill_type(Id id)
    {
        Declared &at = types_[id];
        if (at.state == 3) {
            return;
        }
        at.state = 3; // structure() has refused loops
        if (const auto base = bases_.find(id); base != bases_.end()) {
            fill_type(base->second);
            if (left(types_[base->second].node)) {
                enter(at);
                attempt(at.node, db_.types[id].path,
                        [&] { throw Fault(db_.types[base->second].path + " has faults", {}, true); });
                return;
            }
            const Type &from = db_.types[base->second];
            spend(copied_,
                  from.enumerators.size() * sizeof(Enumerator) + from.encoding.calibrator.points.size() * 16 +
                      from.encoding.calibrator.steps.size() * sizeof(MathStep) +
                      from.encoding.contexts.size() * (sizeof(Condition) + sizeof(Calibrator)) +
                      from.alarms.size() * sizeof(Alarm) + sizeof(Type),
                  most_copied, too_many_copies);
            Type made = from;
            made.sort = db_.types[id].sort;
            static_cast<Named &>(made) = db_.types[id];
            made.members = db_.types[id].members;
            made.element = db_.types[id].element;
            db_.types[id] = std::move(made);
        }
        enter(at);
        Type &type = db_.types[id];
        const Node node = at.node;
        type.is_signed = is_true(node, "signed", type.is_signed);
        type.zero = node.attribute("zeroStringValue").as_string(type.zero.c_str());
        type.one = node.attribute("oneStringValue").as_string(type.one.c_str());
        if (const auto value = initial(node)) {
            type.initial = value;
        }
        const auto part = [&](Node child) {
            const View name = tag(child);
            if (name == "UnitSet") {
                type.units.clear();
                for (Node unit : elements(child)) {
                    const std::string power = unit.attribute("power").as_string("1");
                    type.units.push_back(trimmed(unit.text().get()) + (power == "1" ? "" : "^" + power));
                }
            } else if (name.ends_with("DataEncoding")) {
                type.encoding = encoding(child);
            } else if (name == "Encoding") {
                time_encoding(type, child);
            } else if (name == "EnumerationList") {
                enumerators(type, child);
            } else if (name == "ValidRange") {
                type.valid = {range(child)};
            } else if (name == "ValidRangeSet") {
                type.valid.clear();
                for (Node one : elements(child)) {
                    type.valid.push_back(range(one));
                    type.valid.back().calibrated =
                        is_true(child, "validRangeAppliesToCalibrated", type.valid.back().calibrated);
                }
            } else if (name == "DefaultAlarm") {
                type.alarms.push_back(alarm(child));
            } else if (name == "ContextAlarmList") {
                for (Node one : elements(child)) {
                    type.alarms.insert(type.alarms.end() - (!type.alarms.empty() &&
                                                            type.alarms.back().when.what == Condition::What::always),
                                       alarm(one));
                }
            } else if (name == "DimensionList") {
                type.dimensions = dimensions(child);
            } else if (name == "ReferenceTime") {
                for (Node one : elements(child)) {
                    if (tag(one) == "OffsetFrom") {
                        type.offset_from = reference(one);
                    } else if (tag(one) == "Epoch") {
                        type.epoch = trimmed(one.text().get());
                    } else {
                        stray(one);
                    }
                }
            } else if (!common(child) && !one_of(name, {"ToString", "SizeRangeInCharacters", "MemberList"})) {
                stray(child);
            }
        };
        for (Node child : elements(node)) {
            attempt(node, type.path, [&] { part(child); });
        }
        attempt(node, type.path, [&] { complete(type, node); });
    }

    void complete(Type &type, Node node)
    {
        if (type.sort == Type::Sort::array && type.dimensions.empty()) {
            const auto given = node.attribute("numberOfDimensions");
            type.dimensions.resize(given ? count(node, given.value(), 1, 16) : 1);
            for (Dimension &one : type.dimensions) {
                one.last.fixed = -1; // the entry of a container says how many
            }
        }
        if (type.encoding.what == Encoding::What::binary && type.encoding.algorithm.empty() &&
            type.encoding.size.is_fixed() && type.encoding.size.fixed > 0 && type.encoding.size.fixed <= 64 &&
            type.sort != Type::Sort::binary && type.sort != Type::Sort::text) { // a number all the same
            type.encoding.what = Encoding::What::integer;
            type.encoding.bits = static_cast<std::uint32_t>(type.encoding.size.fixed);
        }
        if (type.sort != Type::Sort::enumerated || type.alarms.empty()) {
            return;
        }
        std::set<View> labels;
        for (const Enumerator &one : type.enumerators) {
            labels.insert(one.label);
        }
        for (const Alarm &one : type.alarms) {
            for (const auto &[label, level] : one.labels) {
                if (!labels.contains(label)) {
                    refuse(node, "an alarm of " + type.name + " names " + label + ", which is no enumerator");
                }
            }
        }
    }

    void enumerators(Type &type, Node node)
    {
        type.enumerators.clear();
        for (Node one : elements(node)) {
            const std::int64_t low = whole(one, needed(one, "value"));
            const auto high = one.attribute("maxValue");
            type.enumerators.push_back({low, high ? whole(one, high.value()) : low, needed(one, "label")});
        }
        std::vector<const Enumerator *> sorted;
        for (const Enumerator &one : type.enumerators) {
            sorted.push_back(&one);
        }
        std::sort(sorted.begin(), sorted.end(), [](auto a, auto b) { return a->low < b->low; });
        for (std::size_t i = 0; i < sorted.size(); i++) {
            if (sorted[i]->high < sorted[i]->low || (i > 0 && sorted[i]->low <= sorted[i - 1]->high)) {
                refuse(node, "the values of the enumerator " + sorted[i]->label + " are empty or another's");
            }
        }
    }

    void time_encoding(Type &type, Node node)
    {
        static const std::map<View, double> units = {{"seconds", 1e9}, {"picoSeconds", 1e-3}, {"days", 86400e9}};
        const std::string unit = node.attribute("units").as_string("seconds");
        const auto found = units.find(unit);
        if (found == units.end()) {
            refuse(node, "a time is in seconds, picoSeconds or days; found " + unit);
        }
        type.scale = real_or(node, "scale", 1) * found->second;
        type.offset = real_or(node, "offset", 0) * found->second;
        for (Node child : elements(node)) {
            if (!tag(child).ends_with("DataEncoding")) {
                stray(child);
            }
            type.encoding = encoding(child);
        }
    }

    Encoding encoding(Node node)
    {
        using What = Encoding::What;
        static const std::map<View, What> whats = {{"IntegerDataEncoding", What::integer},
                                                   {"FloatDataEncoding", What::real},
                                                   {"StringDataEncoding", What::text},
                                                   {"BinaryDataEncoding", What::binary}};
        const auto what = whats.find(tag(node));
        if (what == whats.end()) {
            stray(node);
        }
        Encoding made;
        made.what = what->second;
        made.bits_reversed = node.attribute("bitOrder").as_string() == View("leastSignificantBitFirst");
        if (made.what == What::integer || made.what == What::real) {
            number_form(made, node);
        }
        for (Node child : elements(node)) {
            const View name = tag(child);
            const bool text = made.what == What::text;
            if (name == "DefaultCalibrator") {
                made.calibrator = calibrator(child);
            } else if (name == "ContextCalibratorList") {
                for (Node one : elements(child)) {
                    made.contexts.emplace_back(condition(element(one, "ContextMatch")),
                                               calibrator(element(one, "Calibrator")));
                }
            } else if (name == "ByteOrderList") {
                for (Node one : elements(child)) {
                    made.byte_order.push_back(
                        static_cast<std::uint8_t>(count(one, needed(one, "byteSignificance"), 0, 7)));
                }
            } else if (name == "SizeInBits" || (text && name == "Variable")) {
                string_size(made, child, text);
            } else if (one_of(name, {"FromBinaryTransformAlgorithm", "ToBinaryTransformAlgorithm"})) {
                made.algorithm = child.attribute("name").value();
                note(child, "the algorithm " + made.algorithm + " is not computed: what it encodes is not decoded");
            } else if (name == "ErrorDetectCorrect") {
                note(child, "errors are not corrected");
            } else {
                stray(child);
            }
        }
        if (made.what == What::text) {
            static const char *const names[] = {"UTF-8",    "US-ASCII", "ISO-8859-1", "Windows-1252", "UTF-16",
                                                "UTF-16LE", "UTF-16BE", "UTF-32",     "UTF-32LE",     "UTF-32BE"};
            const std::string name = node.attribute("encoding").as_string("UTF-8");
            const auto found = std::find(std::begin(names), std::end(names), name);
            if (found == std::end(names)) {
                refuse(node, "the character set " + name + " is not known");
            }
            made.charset = static_cast<Charset>(found - std::begin(names));
        }
        if (made.what == What::binary && !made.sized && !made.algorithm.empty()) {
            made.sized = true;
            made.size.fixed = -1;
        }
        if ((made.what == What::text || made.what == What::binary) && !made.sized && made.size_tag == 0 &&
            made.terminator.empty()) {
            refuse(node, "<" + std::string(tag(node)) + "> has no size");
        }
        order(made, node);
        return made;
    }

    void number_form(Encoding &made, Node node)
    {
        static const std::map<View, NumberForm> forms = {{"unsigned", NumberForm::plain},
                                                         {"twosComplement", NumberForm::twos_complement},
                                                         {"twosCompliment", NumberForm::twos_complement}, // of XTCE 1.0
                                                         {"onesComplement", NumberForm::ones_complement},
                                                         {"signMagnitude", NumberForm::sign_magnitude},
                                                         {"BCD", NumberForm::bcd},
                                                         {"packedBCD", NumberForm::packed_bcd},
                                                         {"IEEE754_1985", NumberForm::ieee754},
                                                         {"IEEE754", NumberForm::ieee754},
                                                         {"MILSTD_1750A", NumberForm::mil1750a}};
        const bool real = made.what == Encoding::What::real;
        const std::string name = node.attribute("encoding").as_string(real ? "IEEE754" : "unsigned");
        const auto form = forms.find(name);
        if (form == forms.end() || (form->second >= NumberForm::ieee754) != real) {
            refuse(node, "the encoding " + name + " is not known");
        }
        made.form = form->second;
        made.bits = count(node, node.attribute("sizeInBits").as_string(real ? "32" : "8"), 1, 64);
        const std::uint32_t unit = made.form == NumberForm::bcd ? 8 : made.form == NumberForm::packed_bcd ? 4 : 1;
        if (made.bits % unit != 0 ||
            (made.form == NumberForm::ieee754 && made.bits != 16 && made.bits != 32 && made.bits != 64) ||
            (made.form == NumberForm::mil1750a && made.bits != 32 && made.bits != 48)) {
            refuse(node, name + " has no form of " + std::to_string(made.bits) + " bits");
        }
    }

    /// The size of text and binary: [bits] of the whole, with what says where text ends in it.
    void string_size(Encoding &made, Node node, bool text)
    {
        bool ignored = false;
        for (Node child : elements(node)) {
            const View name = tag(child);
            if (name == "LeadingSize" && text) {
                made.size_tag = count(child, child.attribute("sizeInBitsOfSizeTag").as_string("16"), 1, 32);
            } else if (name == "TerminationChar" && text) {
                made.terminator = hexadecimal(child, trimmed(child.text().get()));
            } else if (!one_of(name, {"Fixed", "FixedValue", "DynamicValue", "DiscreteLookupList"})) {
                stray(child);
            } else if (name == "DynamicValue" &&
                       element(child, "ParameterInstanceRef").attribute("parameterRef").value() ==
                           View("_yamcs_ignore")) {
                ignored = true; // a common way to say that the value alone has a size
            } else {
                made.sized = true;
                made.size = quantity(node);
            }
        }
        if (const auto most = node.attribute("maxSizeInBits")) {
            made.most_bits = count(node, most.value(), 1, 1 << 24);
        }
        const std::int64_t fixed = made.size.fixed;
        if (!ignored && made.size.is_fixed() && (fixed < -1 || fixed > 8 * 65542)) {
            refuse(node, "a size is at most that of a packet; found " + std::to_string(fixed) + " bits");
        }
    }

    void order(Encoding &made, Node node)
    {
        const std::string text = node.attribute("byteOrder").as_string("mostSignificantByteFirst");
        const std::size_t bytes = (made.bits + 7) / 8;
        if (text == "leastSignificantByteFirst") {
            for (std::size_t i = 0; i < bytes; i++) {
                made.byte_order.push_back(static_cast<std::uint8_t>(i));
            }
        } else if (text != "mostSignificantByteFirst") {
            std::stringstream list(text);
            for (std::string one; std::getline(list, one, ',');) {
                made.byte_order.push_back(static_cast<std::uint8_t>(count(node, one, 0, 7)));
            }
        }
        if (made.byte_order.empty() || bytes <= 1) {
            made.byte_order.clear();
            return;
        }
        if (made.bits % 8 != 0) {
            refuse(node, "a byte order needs whole bytes; found " + std::to_string(made.bits) + " bits");
        }
        std::vector<std::uint8_t> sorted = made.byte_order, backwards = sorted;
        std::sort(sorted.begin(), sorted.end());
        for (std::size_t i = 0; i < std::max(sorted.size(), bytes); i++) {
            if (i >= sorted.size() || i >= bytes || sorted[i] != i) {
                refuse(node, "a byte order has each significance from 0 to " + std::to_string(bytes - 1) + " once");
            }
        }
        std::sort(backwards.rbegin(), backwards.rend());
        if (made.byte_order == backwards) {
            made.byte_order.clear();
        }
    }

    Calibrator calibrator(Node node)
    {
        using What = Calibrator::What;
        Calibrator made;
        for (Node child : elements(node)) {
            const View name = tag(child);
            if (made.what != What::none) {
                refuse(child, "<" + std::string(tag(node)) + "> holds more than one calibrator");
            }
            if (name == "PolynomialCalibrator") {
                made.what = What::polynomial;
                for (Node term : elements(child)) {
                    const std::uint32_t exponent = count(term, needed(term, "exponent"), 0, 64);
                    made.coefficients.resize(std::max<std::size_t>(made.coefficients.size(), exponent + 1));
                    made.coefficients[exponent] += real(term, needed(term, "coefficient"));
                }

            } else if (name == "SplineCalibrator") {
                made.what = What::spline;
                made.order = count(child, child.attribute("order").as_string("1"), 0, 16);
                made.extrapolate = is_true(child, "extrapolate", false);
                for (Node point : elements(child)) {
                    made.points.push_back(
                        {real(point, needed(point, "raw")), real(point, needed(point, "calibrated"))});
                }
                std::stable_sort(made.points.begin(), made.points.end(),
                                 [](auto &a, auto &b) { return a.raw < b.raw; });
                if (made.points.size() <= std::max(made.order, 1u)) {
                    refuse(child, "a spline of order " + std::to_string(made.order) + " needs " +
                                      std::to_string(std::max(made.order, 1u) + 1) + " points");
                }
            } else if (name == "MathOperationCalibrator") {
                made.what = What::math;
                math(made, child);
            } else if (!common(child)) {
                stray(child);
            }
            if (made.what != What::none && made.coefficients.empty() && made.points.empty() && made.steps.empty()) {
                note(child, "<" + std::string(name) + "> has no result: the values have none but the raw one");
            }
        }
        return made;
    }

    void math(Calibrator &made, Node node)
    {
        int depth = 0;
        bool sound = true;
        for (Node child : elements(node)) {
            const View name = tag(child);
            MathStep step;
            int takes = 0, gives = 1;
            if (name == "ValueOperand") {
                step.number = real(child, child.text().get());
            } else if (name == "ThisParameterOperand") {
                step.what = MathStep::What::this_value;
            } else if (name == "ParameterInstanceRefOperand") {
                step.what = MathStep::What::value;
                step.value = reference(child);
                made.refers = true;
            } else if (name == "Operator") {
                step.what = MathStep::What::function;
                const auto found = math_function(trimmed(child.text().get()));
                if (!found) {
                    refuse(child, "the operator " + trimmed(child.text().get()) + " is not known");
                }
                step.function = *found;
                takes = math_takes(*found);
                gives = math_gives(*found);
            } else {
                stray(child);
            }
            if (made.steps.size() == most_steps) {
                refuse(child, "a calculation has at most " + std::to_string(most_steps) + " steps");
            }
            sound = sound && depth >= takes && depth - takes + gives <= math_depth;
            depth += gives - takes;
            made.steps.push_back(std::move(step));
        }
        if (depth != 1 || !sound) { // a stack that has too few or too many values
            made.steps.clear();
        }
    }

    Range range(Node node) const
    {
        const double infinite = std::numeric_limits<double>::infinity();
        Range made;
        made.low_open = !!node.attribute("minExclusive");
        made.high_open = !!node.attribute("maxExclusive");
        made.low = real_or(node, made.low_open ? "minExclusive" : "minInclusive", -infinite);
        made.high = real_or(node, made.high_open ? "maxExclusive" : "maxInclusive", infinite);
        made.calibrated =
            is_true(node, "rangeAppliesToCalibrated", is_true(node, "validRangeAppliesToCalibrated", true));
        return made;
    }

    Concern concern(Node node, View name) const
    {
        constexpr View levels[] = {"normal", "watch", "warning", "distress", "critical", "severe"};
        const auto found = std::find(std::begin(levels), std::end(levels), name);
        return found != std::end(levels) ? static_cast<Concern>(found - std::begin(levels))
                                         : refuse_as<Concern>(node, std::string(name) + " is no level of an alarm");
    }

    Alarm alarm(Node node)
    {
        Alarm made;
        made.violations = count(node, node.attribute("minViolations").as_string("1"), 1, 1 << 30);
        made.otherwise = concern(node, node.attribute("defaultAlarmLevel").as_string("normal"));
        for (Node child : elements(node)) {
            const View name = tag(child);
            if (name == "ContextMatch") {
                made.when = condition(child);
            } else if (one_of(name, {"StaticAlarmRanges", "ChangeAlarmRanges"})) {
                made.on_change = name == "ChangeAlarmRanges";
                const bool inside = child.attribute("rangeForm").as_string() == View("inside");
                for (Node one : elements(child)) {
                    std::string level(tag(one).substr(0, tag(one).find("Range")));
                    std::transform(level.begin(), level.end(), level.begin(), [](char c) { return c | 0x20; });
                    made.limits.push_back({concern(one, level), range(one), inside});
                }
            } else if (name == "AlarmMultiRanges") {
                for (Node one : elements(child)) {
                    made.limits.push_back({concern(one, one.attribute("level").as_string("normal")), range(one),
                                           one.attribute("rangeForm").as_string("outside") == View("inside")});
                }
            } else if (one_of(name, {"EnumerationAlarmList", "StringAlarmList"})) {
                for (Node one : elements(child)) {
                    made.labels.emplace_back(
                        needed(one, name == "StringAlarmList" ? "matchPattern" : "enumerationLabel"),
                        concern(one, needed(one, "alarmLevel")));
                }
            } else if (one_of(name, {"AlarmConditions", "CustomAlarm", "ChangePerSecondAlarmRanges"})) {
                note(child, std::string(name) + " is not computed");
            } else if (!common(child)) {
                stray(child);
            }
        }
        return made;
    }

    // --- parameters and containers

    void fill_parameter(Id id)
    {
        Declared &at = enter(parameters_[id]);
        Parameter &parameter = db_.parameters[id];
        if (left(types_[parameter.type].node)) {
            throw Fault(db_.types[parameter.type].path + " has faults", {}, true);
        }
        parameter.initial = initial(at.node);
        for (Node child : elements(at.node)) {
            if (tag(child) == "ParameterProperties") {
                parameter.source = child.attribute("dataSource").as_string("telemetered");
            } else if (!common(child)) {
                stray(child);
            }
        }
    }

    void fill_container(Container &container, Node node)
    {
        container.is_abstract = is_true(node, "abstract", false);
        for (Node child : elements(node)) {
            const View name = tag(child);
            if (name == "EntryList") {
                for (Node one : elements(child)) {
                    attempt(node, container.path, [&] { container.entries.push_back(entry(one)); });
                }
            } else if (name == "BaseContainer") {
                container.base = find(child, container_names_, needed(child, "containerRef"), "container");
                for (Node criteria : elements(child)) {
                    if (tag(criteria) != "RestrictionCriteria") {
                        stray(criteria);
                    }
                    if (element(criteria, "NextContainer")) {
                        note(criteria, "the order of containers is not checked");
                    } else {
                        container.restriction = condition(criteria);
                    }
                }
            } else if (!common(child) && !one_of(name, {"DefaultRateInStream", "RateInStreamSet", "BinaryEncoding"})) {
                stray(child);
            }
        }
    }

    Entry entry(Node node)
    {
        using What = Entry::What;
        const View name = tag(node);
        Entry made;
        std::uint64_t n = 1;
        made.place = place(node);
        if (one_of(name, {"ParameterRefEntry", "ArrayParameterRefEntry"})) {
            made.id = find(node, parameter_names_, needed(node, "parameterRef"), "parameter");
            need_encoding(node, db_.parameters[made.id].type);
            n = values_[db_.parameters[made.id].type];
        } else if (name == "ContainerRefEntry") {
            made.what = What::container;
            made.id = find(node, container_names_, needed(node, "containerRef"), "container");
        } else if (one_of(name, {"ArgumentRefEntry", "ArrayArgumentRefEntry"})) {
            made.what = What::argument;
            made.name = needed(node, "argumentRef");
        } else if (name == "FixedValueEntry") {
            made.what = What::fixed;
            made.bytes = hexadecimal(node, needed(node, "binaryValue"));
            made.bits =
                count(node, node.attribute("sizeInBits").as_string(std::to_string(8 * made.bytes.size()).c_str()), 1,
                      8 * 65542);
            made.bytes.insert(made.bytes.begin(), (made.bits + 7) / 8, 0); // the value is at its end
        } else if (name == "IndirectParameterRefEntry") {
            made.what = What::indirect;
            made.name = node.attribute("aliasNameSpace").value();
            const Node instance = element(node, "ParameterInstance");
            made.selector = instance ? reference(instance)
                                     : refuse_as<Reference>(node, "<IndirectParameterRefEntry> needs a "
                                                                  "ParameterInstance");
            if (std::none_of(db_.parameters.begin(), db_.parameters.end(), [&](const Parameter &one) {
                    return std::any_of(one.aliases.begin(), one.aliases.end(),
                                       [&](auto &alias) { return alias.first == made.name; });
                })) {
                refuse(node, "no parameter has an alias in the name space " + made.name);
            }
        } else if (name.ends_with("Entry")) {
            refuse(node, std::string(name) + " is not decoded here");
        } else {
            stray(node);
        }
        for (Node child : elements(node)) {
            const View part = tag(child);
            if (part == "LocationInContainerInBits") {
                const std::string from = child.attribute("referenceLocation").as_string("previousEntry");
                made.from = from == "containerStart" ? Entry::From::start
                            : from == "containerEnd" ? Entry::From::end
                            : from == "previousEntry"
                                ? Entry::From::previous
                                : refuse_as<Entry::From>(child, "a place refers to containerStart, containerEnd or "
                                                                "previousEntry; found " +
                                                                    from);
                made.offset = quantity(child);
            } else if (part == "RepeatEntry") {
                made.repeats = true;
                made.count = quantity(element(child, "Count"));
                if (const Node gap = element(child, "Offset")) {
                    made.gap = quantity(gap);
                }
            } else if (part == "IncludeCondition") {
                made.include = condition(child);
            } else if (part == "DimensionList") {
                made.dimensions = dimensions(child);
                if (made.what == What::parameter && db_.types[db_.parameters[made.id].type].element != no_id) {
                    n = values_of(child, db_.types[db_.parameters[made.id].type].element, made.dimensions);
                }
            } else if (part == "TimeAssociation") {
                note(child, "the time of one parameter is not computed from another's");
            } else if (!common(child) && part != "ParameterInstance") {
                stray(child);
            }
        }
        spend(entry_values_, n, 16 * most_values, "its containers have more than 2^24 values");
        return made;
    }

    /// What stands in a packet has a size, and not more values than a packet.
    void need_encoding(Node node, Id id)
    {
        const Type &type = db_.types[id];
        if (encoded_[id]) {
            return;
        }
        if (left(types_[id].node)) {
            throw Fault(type.path + " has faults", {}, true);
        }
        if (type.sort == Type::Sort::array) {
            need_encoding(node, type.element);
            values_[id] = values_of(node, type.element, type.dimensions);
        } else if (type.sort == Type::Sort::aggregate) {
            values_[id] = 1;
            for (const Member &member : type.members) {
                need_encoding(node, member.type);
                values_[id] += values_[member.type];
            }
        } else if (type.encoding.what == Encoding::What::none) {
            refuse(node, "the type " + type.name + " (" + db_.where(type.place) + ") has no encoding");
        } else if (type.encoding.what == Encoding::What::binary && type.encoding.algorithm.empty() &&
                   type.sort != Type::Sort::binary && type.sort != Type::Sort::text) {
            refuse(node, "the type " + type.name + " (" + db_.where(type.place) +
                             ") is binary, and no algorithm makes a value of it");
        }
        if (values_[id] > most_values) {
            refuse(node, too_many_values);
        }
        encoded_[id] = true;
    }

    /// How many values an array has, if its dimensions are fixed.
    std::uint64_t values_of(Node node, Id element, const std::vector<Dimension> &dimensions) const
    {
        std::uint64_t n = values_[element];
        for (const Dimension &one : dimensions) {
            const bool fixed = one.first.is_fixed() && one.last.is_fixed();
            n *= fixed ? static_cast<std::uint64_t>(
                             std::clamp<std::int64_t>(one.last.fixed - one.first.fixed + 1, 1, most_values + 1))
                       : 1;
            if (n > most_values) {
                refuse(node, too_many_values);
            }
        }
        return n;
    }

    // --- commands

    void fill_command(Id id)
    {
        Declared &at = commands_[id];
        Command &command = db_.commands[id];
        command.is_abstract = is_true(at.node, "abstract", false);
        const auto part = [&](Node child) {
            const View name = tag(child);
            if (name == "BaseMetaCommand") {
                command.base = find(child, command_names_, needed(child, "metaCommandRef"), "command");
                for (Node one : elements(element(child, "ArgumentAssignmentList"))) {
                    command.assignments.emplace_back(needed(one, "argumentName"),
                                                     one.attribute("argumentValue").value());
                }
            } else if (name == "ArgumentList") {
                for (Node one : elements(child)) {
                    Named named;
                    describe(one, command.path, named);
                    command.arguments.push_back(
                        {named.name, named.description, type_of(one, "argumentTypeRef", true), initial(one)});
                }
            } else if (name == "CommandContainer") {
                const auto path = command_container_paths_.find(id);
                if (path == command_container_paths_.end() ||
                    left(containers_[container_names_.at(path->second)].node)) {
                    throw Fault("its container has faults", {}, true);
                }
                command.container = container_names_.at(path->second);
            } else if (name == "DefaultSignificance") {
                command.consequence = child.attribute("consequenceLevel").value();
                command.reason = child.attribute("reasonForWarning").value();
            } else if (name == "TransmissionConstraintList") {
                outside_ = true;
                for (Node one : elements(child)) {
                    command.constraints.push_back(condition(one));
                }
                outside_ = false;
            } else if (name == "VerifierSet") {
                outside_ = true;
                for (Node one : elements(child)) {
                    command.verifiers.push_back(verifier(one));
                }
                outside_ = false;
            } else if (one_of(name, {"ContextSignificanceList", "Interlock", "ParameterToSetList",
                                     "ParametersToSuspendAlarmsOnSet"})) {
                note(child, std::string(name) + " is not computed");
            } else if (!common(child) && name != "SystemName") {
                stray(child);
            }
        };
        for (Node child : elements(at.node)) {
            outside_ = false;
            attempt(at.node, command.path, [&] { part(child); });
        }
    }

    double seconds(Node node, View text) const
    {
        const auto wrong = [&](const char *why) { refuse(node, "'" + std::string(text) + "' is no " + why); };
        double sum = 0;
        std::size_t last = 0; // the units come in their order, each once
        bool time = false;
        if (!text.starts_with('P') || text.size() < 3 || text.ends_with('T')) {
            wrong("duration, as PT1.5S");
        }
        for (std::size_t i = 1, end; i < text.size(); i = end + 1) {
            if (text[i] == 'T' && !time) {
                time = true;
                end = i;
                continue;
            }
            end = text.find_first_not_of("0123456789.", i);
            const std::size_t unit = View("YMD HMS").find(end == View::npos ? '?' : text[end], time ? 4 : 0);
            constexpr double scales[] = {0, 0, 86400, 0, 3600, 60, 1};
            if (unit == View::npos || unit < last || (unit < 3) == time ||
                (unit != 6 && text.substr(i, end - i).find('.') != View::npos)) {
                wrong("duration, as PT1.5S");
            }
            const double value = real(node, text.substr(i, end - i));
            if (unit < 2 && value != 0) {
                wrong("duration of days or less: years and months have no one length");
            }
            last = unit + 1;
            sum += scales[unit] * value;
        }
        return sum;
    }

    Verifier verifier(Node node)
    {
        Verifier made;
        made.stage = tag(node).substr(0, tag(node).rfind("Verifier"));
        if (std::find(std::begin(verifier_stages), std::end(verifier_stages), made.stage) ==
                std::end(verifier_stages) ||
            !tag(node).ends_with("Verifier")) {
            stray(node);
        }
        for (Node child : elements(node)) {
            const View name = tag(child);
            if (is_condition(child)) {
                made.condition = one_condition(child, 0);
            } else if (name == "ContainerRef") {
                made.container = find(child, container_names_, needed(child, "containerRef"), "container");
            } else if (name == "ParameterValueChange") {
                made.changes = reference(element(child, "ParameterRef"));
                made.change = real(child, needed(element(child, "Change"), "value"));
            } else if (name == "CheckWindow") {
                made.start = seconds(child, child.attribute("timeToStartChecking").as_string("PT0S"));
                made.stop = seconds(child, needed(child, "timeToStopChecking"));
                made.relative_to = child.attribute("timeWindowIsRelativeTo").as_string("timeLastVerifierPassed");
                if (!(made.stop > made.start) ||
                    !one_of(made.relative_to, {"timeLastVerifierPassed", "commandRelease"})) {
                    refuse(child,
                           "a window ends after it begins, relative to timeLastVerifierPassed or commandRelease");
                }
            } else if (name == "ReturnParmRef") {
                made.returns = reference(child);
            } else if (name == "PercentComplete") {
                if (const Node fixed = element(child, "FixedValue")) {
                    made.percent = real(fixed, fixed.text().get());
                } else {
                    note(child, "only a fixed percentage is computed");
                }
            } else if (one_of(name, {"CustomAlgorithm", "CheckWindowAlgorithms"})) {
                made.algorithm = child.attribute("name").as_string("without a name");
                note(child, "an algorithm that verifies a command is not computed");
            } else if (!common(child)) {
                stray(child);
            }
        }
        if (made.condition.what == Condition::What::always && made.container == no_id && made.algorithm.empty() &&
            made.changes.of == Reference::Of::nothing) {
            refuse(node, "<" + std::string(tag(node)) +
                             "> needs a Comparison, ComparisonList, BooleanExpression, ContainerRef or "
                             "ParameterValueChange");
        }
        return made;
    }

    // --- loops

    void refuse_loops()
    {
        std::vector<char> state(db_.containers.size());
        std::vector<std::pair<Id, std::size_t>> path; // an explicit stack: chains may be long
        for (Id i = 0; i < db_.containers.size(); i++) {
            path.emplace_back(i, 0);
            while (!path.empty()) {
                auto &[at, next] = path.back();
                Container &one = db_.containers[at];
                if (next == 0 && state[at] == 2) {
                    path.pop_back();
                    continue;
                }
                state[at] = 1;
                Id to = no_id;
                if (next == 0) {
                    to = one.base;
                } else if (next <= one.entries.size()) {
                    const Entry &entry = one.entries[next - 1];
                    to = entry.what == Entry::What::container ? entry.id : no_id;
                } else {
                    state[at] = 2;
                    path.pop_back();
                    continue;
                }
                next++;
                const bool loop = to != no_id && state[to] == 1;
                if (loop || path.size() > 1000) {
                    fault(containers_[at], one.path,
                          loop ? "the container " + one.name + " extends or contains itself"
                               : "containers are nested deeper than 1000");
                } else if (to != no_id && state[to] == 0) {
                    path.emplace_back(to, 0);
                }
            }
        }
        for (Id i = 0; i < db_.commands.size(); i++) {
            std::size_t steps = 0;
            for (Id at = i; at != no_id; at = db_.commands[at].base) {
                if (++steps > 1000) {
                    fault(commands_[i], db_.commands[i].path,
                          "the command " + db_.commands[i].name + " extends itself, or is nested deeper than 1000");
                    break;
                }
            }
        }
    }

    /// The standard counts from the end of a container to the end of an entry; others write where the entry begins. A
    /// database whose entries never reach the end, unless begins are meant, may mean either.
    void refuse_doubtful_ends()
    {
        std::vector<std::pair<Id, const Entry *>> doubtful;
        for (Id i = 0; i < db_.containers.size(); i++) {
            for (const Entry &one : db_.containers[i].entries) {
                const bool parameter = one.what == Entry::What::parameter;
                if (one.from != Entry::From::end || !one.offset.is_fixed() ||
                    (!parameter && one.what != Entry::What::fixed)) {
                    continue;
                }
                const Encoding *encoding = parameter ? &db_.types[db_.parameters[one.id].type].encoding : nullptr;
                const std::int64_t bits = !parameter                                     ? one.bits
                                          : encoding->sized && encoding->size.is_fixed() ? encoding->size.fixed
                                                                                         : encoding->bits;
                if (one.offset.fixed < bits) {
                    return;
                }
                if (one.offset.fixed == bits && bits != 0) {
                    doubtful.emplace_back(i, &one);
                }
            }
        }
        for (const auto &[id, entry] : doubtful) {
            const Node node = enter(containers_[id]).node;
            attempt(node, db_.containers[id].path, [&, &one = *entry] {
                throw Fault(db_.where(one.place) + ": this entry ends " + std::to_string(one.offset.fixed) +
                                " bits in front of the container's end, as XTCE counts, and no entry is behind it. If "
                                "its begin is meant, write 0; else add an entry for these bits",
                            one.place);
            });
        }
    }

public:
    /// The containers of commands have no set of their own: they are declared after all others.
    void declare_command_containers()
    {
        for (const auto &[command, node] : command_containers_) {
            const Declared &at = enter(commands_[command]);
            Container made;
            const char *const given = node.attribute("name").value();
            made.name = *given ? given : db_.commands[command].name;
            made.path = at.system + "/" + made.name;
            if (container_names_.contains(made.path)) { // as of a command that calls all of them alike
                made.path = db_.commands[command].path + "/" + made.name;
            }
            made.place = place(node);
            made.of_command = true;
            if (!container_names_.emplace(made.path, static_cast<Id>(db_.containers.size())).second) {
                refuse(node, made.path + " is declared twice");
            }
            command_container_paths_[static_cast<Id>(command)] = made.path;
            db_.containers.push_back(std::move(made));
            containers_.push_back({node, at.system, at.file, 0});
        }
    }

private:
    Database &db_;
    std::vector<std::unique_ptr<Document>> documents_;
    std::vector<Declared> types_, parameters_, containers_, commands_;
    Names system_names_, type_names_, argument_type_names_, parameter_names_, container_names_, command_names_;
    std::vector<std::pair<std::size_t, Node>> command_containers_;
    std::map<Id, std::string> command_container_paths_;
    std::map<Id, Id> bases_; ///< of types
    std::set<std::string> member_names_;
    std::uint32_t file_ = 0;
    std::string system_;
    std::vector<std::uint64_t> values_; ///< of each type
    std::vector<bool> encoded_;         ///< types that have an encoding
    std::vector<Fault> faults_;
    std::unordered_set<const void *> left_; ///< nodes that are left out
    std::size_t bytes_ = 0, copied_ = 0, entry_values_ = 0;
    mutable std::size_t searched_ = 0;
    std::ptrdiff_t n_elements_ = 0;
    bool outside_ = false; ///< a reference may lead to what another program knows
};

} // namespace

Literal literal_of(const std::string &text)
{
    Literal made{text, number<std::int64_t>(trimmed(text)), number<double>(trimmed(text))};
    if (const auto large = number<std::uint64_t>(trimmed(text)); large && !made.integer) {
        made.integer = static_cast<std::int64_t>(*large); // its 64 bits
    }
    return made;
}

Database read_xtce(const std::vector<XtceFile> &files, bool lenient)
{
    Database database;
    Reader reader(database);
    for (const XtceFile &file : files) {
        std::ifstream in(file.name, std::ios::binary);
        std::string text;
        for (std::size_t n = 0; in && n <= most_text; n = text.size()) { // in parts: it may be a device, or huge
            text.resize(n + (1 << 20));
            in.read(text.data() + n, 1 << 20);
            text.resize(n + static_cast<std::size_t>(in.gcount()));
        }
        if (text.empty() || in.bad()) {
            throw Refusal(file.name + ": cannot be read, or is empty");
        }
        reader.take(std::move(text), file.name, file.under == "/" ? "" : file.under);
    }
    reader.finish(lenient);
    return database;
}

Database read_xtce_text(std::string text, const std::string &name, bool lenient)
{
    Database database;
    Reader reader(database);
    reader.take(std::move(text), name, "");
    reader.finish(lenient);
    return database;
}

} // namespace fledge::ground
