// SPDX-License-Identifier: Apache-2.0
#include "ground/database/xtce/xml.h"

#include <charconv>

namespace fledge::ground::xtce {

namespace {

constexpr std::ptrdiff_t most_elements = 1 << 23; // of all files
constexpr std::size_t most_of_fault = 1000;       // characters of a fault
constexpr std::size_t most_shown = 100;           // faults of a message

/// Whether a text is UTF-8 of characters that XML allows; pugixml does not check that.
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
        for (const auto &attribute : node.attributes()) {
            good = good && is_text(attribute.name()) && is_text(attribute.value());
        }
        wrong = good ? Node() : node.type() == pugi::node_element ? node : node.parent();
        return good;
    }
};

void check_name_space(Node root)
{
    const View full = root.name();
    const std::string prefix(full.substr(0, std::min(full.find(':'), full.size())));
    const bool prefixed = prefix.size() < full.size();
    const std::string space = root.attribute(prefixed ? ("xmlns:" + prefix).c_str() : "xmlns").value();
    if (prefixed && space.empty()) {
        refuse(root, "the prefix " + prefix + " has no name space: xmlns:" + prefix + " is missing");
    }
    if (!one_of(space, {"", "http://www.omg.org/space/xtce", "http://www.omg.org/spec/XTCE/20180204",
                        "http://www.omg.org/spec/XTCE/20250214"})) {
        refuse(root, "the name space " + space +
                         " is not read: XTCE 1.0 and 1.1 have http://www.omg.org/space/xtce, 1.2 has "
                         "http://www.omg.org/spec/XTCE/20180204, and 1.3 http://www.omg.org/spec/XTCE/20250214");
    }
}

} // namespace

void refuse(Node node, const std::string &reason)
{
    std::size_t n = reason.size() <= most_of_fault ? reason.size() : most_of_fault;
    while (n < reason.size() && n > 0 && (reason[n] & 0xC0) == 0x80) { // not within a character
        n--;
    }
    throw Fault(reason.substr(0, n) + (n < reason.size() ? "..." : ""), node);
}

void refuse_element(Node node)
{
    refuse(node, "<" + std::string(tag(node)) + "> is not known in <" + std::string(tag(node.parent())) + ">");
}

void refuse_reference(const std::string &to)
{
    Fault fault(to + " has faults");
    fault.follows = true;
    throw fault;
}

View tag(Node node)
{
    const View name = node.name();
    return name.substr(name.find(':') + 1); // npos + 1 is 0
}

std::vector<Node> elements(Node node)
{
    std::vector<Node> found;
    for (Node child : node.children()) {
        if (child.type() == pugi::node_element) {
            found.push_back(child);
        }
    }
    return found;
}

Node element(Node node, View name)
{
    for (Node child : node.children()) {
        if (tag(child) == name) {
            return child;
        }
    }
    return {};
}

bool is_common(Node node)
{
    return one_of(tag(node), {"ShortDescription", "LongDescription", "AliasSet", "AncillaryDataSet"});
}

std::string needed(Node node, const char *attribute)
{
    const std::string text(trimmed(node.attribute(attribute).value()));
    return !text.empty()
               ? text
               : refuse_as<std::string>(node, "<" + std::string(tag(node)) + "> needs the attribute " + attribute);
}

bool is_true(Node node, const char *attribute, bool otherwise)
{
    return node.attribute(attribute).as_bool(otherwise);
}

std::optional<std::string> initial(Node node)
{
    const auto found = node.attribute("initialValue");
    return found ? std::optional<std::string>(found.value()) : std::nullopt;
}

Number any_number(Node node, View text)
{
    const auto value = number_in(text);
    return value ? *value : refuse_as<Number>(node, "'" + std::string(text) + "' is no number");
}

std::int64_t whole(Node node, View text)
{
    const auto value = number_in(text);
    return value && value->is_whole() && value->whole() == static_cast<std::int64_t>(value->whole())
               ? static_cast<std::int64_t>(value->whole())
               : refuse_as<std::int64_t>(node, "'" + std::string(text) + "' is no whole number");
}

double real(Node node, View text)
{
    return any_number(node, text).real();
}

double real_or(Node node, const char *attribute, double otherwise)
{
    const auto found = node.attribute(attribute);
    return found ? real(node, found.value()) : otherwise;
}

std::uint32_t count(Node node, View text, std::int64_t low, std::int64_t high)
{
    const std::int64_t value = whole(node, text);
    if (value < low || value > high) {
        refuse(node, "<" + std::string(tag(node)) + "> must be " + std::to_string(low) + " to " + std::to_string(high) +
                         "; found " + std::to_string(value));
    }
    return static_cast<std::uint32_t>(value);
}

std::vector<std::uint8_t> hexadecimal(Node node, View text)
{
    const auto bytes = octets_in(text);
    return bytes ? *bytes
                 : refuse_as<std::vector<std::uint8_t>>(node, "'" + std::string(text) + "' is not hexadecimal");
}

double seconds(Node node, View text)
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

// --- files

void Documents::add(std::string text, const std::string &name, const std::string &under)
{
    for (const std::string *part : std::initializer_list<const std::string *>{&under, &text}) {
        for (const char c : *part) {
            hash_ = (hash_ ^ static_cast<std::uint8_t>(c)) * 0x100000001B3;
        }
    }
    bytes_ += text.size();
    n_elements_ += std::count(text.begin(), text.end(), '<');
    if (bytes_ > most_text || n_elements_ > most_elements) {
        throw Refusal(name + ": a database has at most 128 MB and 8 million elements and ends of them");
    }
    const auto file = static_cast<std::uint32_t>(files_.size());
    files_.push_back(name);
    Document &document = *documents_.emplace_back(std::make_unique<Document>());
    document.text = std::move(text);
    document.under = under;
    for (std::size_t i = 0; i < document.text.size(); i++) {
        if (document.text[i] == '\n') {
            document.lines.push_back(i);
        }
    }
    parse(document, file);
}

void Documents::parse(Document &document, std::uint32_t file)
{
    if (document.text.starts_with("\xFE\xFF") || document.text.starts_with("\xFF\xFE")) {
        throw Fault(files_[file] + ": write the file in UTF-8; it is in UTF-16", Place{file, 1});
    }
    // A document type with its entities is skipped: an entity stays as it is written.
    const auto result = document.xml.load_buffer(document.text.data(), document.text.size(),
                                                 pugi::parse_default | pugi::parse_trim_pcdata);
    file_of_[document.xml.internal_object()] = file;
    if (!result) {
        const Place at{file, document.line(result.offset)};
        throw Fault(where(at) + ": " + result.description(), at);
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
    check_name_space(root);
}

std::uint32_t Documents::Document::line(std::ptrdiff_t offset) const
{
    const auto at = static_cast<std::size_t>(std::max<std::ptrdiff_t>(offset, 0));
    return static_cast<std::uint32_t>(std::lower_bound(lines.begin(), lines.end(), at) - lines.begin() + 1);
}

Place Documents::place(Node node) const
{
    const std::uint32_t file = file_of_.at(node.root().internal_object());
    return {file, documents_[file]->line(node.offset_debug())};
}

// --- faults

void Faults::add(const Fault &fault, Node thing, const std::string &path)
{
    const Place at = fault.place ? *fault.place : documents_.place(fault.node ? fault.node : thing);
    faults_.push_back({(fault.place ? "" : documents_.where(at) + ": ") + fault.what(), path, at, fault.follows});
    if (faults_.size() > most_faults) {
        refuse();
        throw Refusal(documents_.files()[at.file] + ": too much refers to what has faults");
    }
    left_out_.insert(thing.internal_object());
}

void Faults::refuse()
{
    std::stable_sort(faults_.begin(), faults_.end(), [](const Entry &a, const Entry &b) {
        return std::pair(a.place.file, a.place.line) < std::pair(b.place.file, b.place.line);
    });
    std::string all;
    std::size_t n = 0;
    for (const Entry &fault : faults_) {
        if (!fault.follows && ++n <= most_shown) {
            all += (all.empty() ? "" : "\n") + fault.message;
        }
    }
    if (n > most_shown) {
        all += "\nand " + std::to_string(n - most_shown) + " more faults";
    }
    if (n > 0) {
        throw Refusal(all);
    }
}

std::vector<std::string> Faults::take()
{
    std::vector<std::string> texts;
    for (const Entry &fault : faults_) {
        texts.push_back(fault.message + "; " + fault.thing + " is left out");
    }
    faults_.clear();
    return texts;
}

} // namespace fledge::ground::xtce
