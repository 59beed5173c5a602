// SPDX-License-Identifier: Apache-2.0
#include "cosim/protocol/schema.h"

#include <algorithm>
#include <charconv>
#include <map>
#include <optional>
#include <set>
#include <strings.h>

namespace fledge::cosim {

namespace {

struct Primitive {
    std::string_view name;
    std::uint32_t size;
};

constexpr Primitive primitives[] = {
    {"float64", 8}, {"float32", 4}, {"int64", 8}, {"uint64", 8}, {"int32", 4}, {"uint32", 4}, {"int16", 2},
    {"uint16", 2},  {"int8", 1},    {"uint8", 1}, {"bool", 1},   {"byte", 1},  {"char", 1},
};

constexpr std::string_view blanks = " \t\r";
constexpr std::string_view word_characters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz_0123456789";

std::string_view trim(std::string_view s)
{
    s.remove_prefix(std::min(s.find_first_not_of(blanks), s.size()));
    return s.substr(0, s.find_last_not_of(blanks) + 1);
}

/// Remove the first word from s and return it.
std::string_view take_word(std::string_view &s)
{
    s = trim(s);
    const std::string_view word = s.substr(0, s.find_first_of(blanks));
    s.remove_prefix(word.size());
    return word;
}

bool is_identifier(std::string_view s)
{
    return !s.empty() && s.find_first_not_of(word_characters) == std::string_view::npos &&
           !(s[0] >= '0' && s[0] <= '9');
}

std::string_view short_name(std::string_view type)
{
    return type.substr(type.rfind('/') + 1); // all of it without a slash
}

bool same_but_for_case(std::string_view a, std::string_view b)
{
    return a.size() == b.size() && !strncasecmp(a.data(), b.data(), a.size());
}

std::optional<std::uint32_t> number(std::string_view s)
{
    std::uint32_t n = 0;
    const auto [end, error] = std::from_chars(s.data(), s.data() + s.size(), n);
    if (error != std::errc() || end != s.data() + s.size()) {
        return std::nullopt;
    }
    return n;
}

struct Line {
    std::size_t number;
    std::string_view text;
};

/// Collects the fields of a message, depth first. Each section of the text defines a nested type.
class Parser {
public:
    explicit Parser(std::string_view text)
    {
        std::string_view section;
        bool after_rule = false;
        for (std::size_t n = 1; !text.empty(); n++) {
            const auto end = std::min(text.find('\n'), text.size());
            const std::string_view line = text.substr(0, end);
            text.remove_prefix(std::min(end + 1, text.size()));
            if (after_rule) {
                const auto colon = line.find(':');
                section = colon == std::string_view::npos ? "" : short_name(trim(line.substr(colon + 1)));
                if (line.substr(0, colon) != "MSG" || section.empty() || sections.contains(section)) {
                    fail(n, "expected \"MSG: <a new type>\"", line);
                }
                sections[section];
                after_rule = false;
            } else if (line.size() == 80 && line.find_first_not_of('=') == std::string_view::npos) {
                after_rule = true;
            } else if (sections[section]; !trim(line.substr(0, line.find('#'))).empty()) {
                sections[section].push_back({n, line});
            }
        }
    }

    std::vector<SchemaField> fields()
    {
        walk("", "", 0);
        if (result.empty()) {
            throw SchemaError("the definition has no fields");
        }
        return std::move(result);
    }

private:
    [[noreturn]] static void fail(std::size_t line, std::string_view why, std::string_view found)
    {
        throw SchemaError("line " + std::to_string(line) + ": " + std::string(why) + ", found \"" +
                          std::string(found.substr(0, 80)) + "\"");
    }

    void walk(std::string_view section, const std::string &prefix, int depth)
    {
        std::set<std::string_view> names;
        for (const Line &line : sections[section]) {
            const auto hash = std::min(line.text.find('#'), line.text.size());
            const std::string_view comment = line.text.substr(std::min(hash + 1, line.text.size()));
            member(line, line.text.substr(0, hash), comment, prefix, depth, names);
        }
    }

    void member(const Line &line, std::string_view code, std::string_view comment, const std::string &prefix, int depth,
                std::set<std::string_view> &names)
    {
        std::string_view type = take_word(code);
        const std::string_view name = take_word(code);
        std::uint32_t count = 1;
        SchemaField field;
        if (const auto bracket = type.find('['); bracket != std::string_view::npos) {
            const auto n =
                type.back() == ']' ? number(type.substr(bracket + 1, type.size() - bracket - 2)) : std::nullopt;
            if (!n || !*n) {
                fail(line.number, "expected an array of fixed size", line.text);
            }
            count = *n;
            field.shape = std::to_string(count);
            type = type.substr(0, bracket);
        }
        if (!is_identifier(name) || !trim(code).empty()) {
            fail(line.number, "expected \"<type> <name>\" of fixed size", line.text);
        }
        if (!names.insert(name).second) {
            fail(line.number, "this name is there twice", name);
        }

        if (const auto open = comment.rfind('{'); open != std::string_view::npos && trim(comment).back() == '}') {
            field.choices = comment.substr(open + 1, comment.rfind('}') - open - 1);
        }
        field.name = prefix + std::string(name);
        if (const std::string_view found = take_word(comment); same_but_for_case(found, name)) {
            field.name = prefix + std::string(found);
            comment = trim(comment);
            if (comment.starts_with('[')) {
                const auto end = std::min(comment.find(']'), comment.size());
                field.unit = comment.substr(1, end - 1);
                comment = trim(comment.substr(std::min(end + 1, comment.size())));
            }
            if (comment.starts_with('(') && !field.shape.empty()) {
                take_shape(comment, count, field.shape);
            }
        }

        const auto primitive = std::find_if(std::begin(primitives), std::end(primitives),
                                            [&](const Primitive &p) { return p.name == type; });
        if (primitive != std::end(primitives)) {
            field.type = type;
            field.item = primitive->size;
            field.count = count;
            add(line, std::move(field));
        } else if (!sections.contains(short_name(type)) || short_name(type).empty()) {
            fail(line.number, "this type is not of fixed size or not defined here", type);
        } else if (depth >= 16) {
            fail(line.number, "types are nested too deeply, or contain themselves", type);
        } else {
            for (std::uint32_t i = 0; i < count; i++) {
                const std::size_t before = result.size();
                const std::string index = field.shape.empty() ? "" : "[" + std::to_string(i) + "]";
                walk(short_name(type), field.name + index + ".", depth + 1);
                if (result.size() == before) {
                    fail(line.number, "this type has no fields", type);
                }
            }
        }
    }

    /// "(3, 3)" in a comment gives the dimensions of an array, which ROS stores with one. Their product has to agree.
    static void take_shape(std::string_view comment, std::uint32_t count, std::string &shape)
    {
        std::string found;
        std::uint64_t product = 1;
        std::string_view inside = comment.substr(1, std::min(comment.find(')'), comment.size()) - 1);
        while (!inside.empty()) {
            const auto comma = std::min(inside.find(','), inside.size());
            const auto n = number(trim(inside.substr(0, comma)));
            if (!n || !*n || product > count) {
                return;
            }
            product *= *n;
            found += (found.empty() ? "" : ", ") + std::to_string(*n);
            inside.remove_prefix(std::min(comma + 1, inside.size()));
        }
        if (product == count && !found.empty()) {
            shape = found;
        }
    }

    void add(const Line &line, SchemaField field)
    {
        const std::uint64_t size = std::uint64_t{field.item} * field.count;
        texts += field.name.size() + field.unit.size() + field.choices.size();
        if (at + size > schema_size_max || result.size() >= schema_fields_max || texts > schema_text_max) {
            fail(line.number, "the message is too large", field.name);
        }
        if (at % field.item) {
            fail(line.number, "padding would be needed before this field", field.name);
        }
        field.offset = at;
        at += static_cast<std::uint32_t>(size);
        result.push_back(std::move(field));
    }

    std::map<std::string_view, std::vector<Line>> sections;
    std::vector<SchemaField> result;
    std::uint32_t at = 0;
    std::size_t texts = 0; ///< bytes of names, units and choices
};

std::string described(const SchemaField &field)
{
    return field.type + (field.shape.empty() ? "" : " (" + field.shape + ")") +
           (field.unit.empty() ? "" : " [" + field.unit + "]");
}

} // namespace

std::uint64_t schema_hash(std::string_view text)
{
    std::uint64_t hash = 0xcbf29ce484222325u;
    for (const char c : text) {
        hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
    }
    return hash;
}

std::vector<SchemaField> parse_schema(std::string_view text)
{
    return Parser(text).fields();
}

Schema make_schema(std::string name, std::string text)
{
    const SchemaField last = parse_schema(text).back();
    const std::uint64_t hash = schema_hash(text);
    return {std::move(name), std::move(text), last.offset + last.item * last.count, hash};
}

std::string schema_fault(const Schema &schema)
{
    if (!schema.given()) {
        return schema.size || schema.hash ? "it has a size or hash, but no text" : "";
    }
    try {
        const Schema made = make_schema(schema.name, schema.text);
        return made.size != schema.size
                   ? "its text makes " + std::to_string(made.size) + " bytes, not " + std::to_string(schema.size)
               : made.hash != schema.hash ? "its hash is not that of its text"
                                          : "";
    } catch (const SchemaError &error) {
        return error.what();
    }
}

std::vector<SchemaField> fields_of(const Schema &schema)
{
    if (const std::string fault = schema_fault(schema); !fault.empty()) {
        throw SchemaError("a bad definition of " + schema.name + ": " + fault);
    }
    return parse_schema(schema.text);
}

std::string schema_difference(const Schema &published, const Schema &subscribed)
{
    if (published.name != subscribed.name && !published.name.empty() && !subscribed.name.empty()) {
        return "it is a " + published.name + " in the publication and a " + subscribed.name + " in the subscription";
    }
    if (!published.given() || !subscribed.given() ||
        (published.hash == subscribed.hash && published.text == subscribed.text)) {
        return "";
    }
    const auto a = parse_schema(published.text), b = parse_schema(subscribed.text);
    for (std::size_t i = 0; i < std::max(a.size(), b.size()); i++) {
        if (i >= a.size() || (i < b.size() && a[i].name != b[i].name)) {
            const bool elsewhere = std::any_of(a.begin(), a.end(), [&](const auto &f) { return f.name == b[i].name; });
            return "field " + b[i].name + (elsewhere ? " is at another place" : " is missing") + " in the publication";
        }
        if (i >= b.size()) {
            return "field " + a[i].name + " is missing in the subscription";
        }
        if (described(a[i]) != described(b[i])) {
            return "field " + a[i].name + " is " + described(a[i]) + " in the publication and " + described(b[i]) +
                   " in the subscription";
        }
    }
    return "";
}

void swap_bytes(std::span<const SchemaField> fields, std::span<std::byte> bytes)
{
    for (const SchemaField &field : fields) {
        if (field.item == 1) {
            continue;
        }
        for (std::uint32_t i = 0; i < field.count; i++) {
            const auto number = bytes.subspan(field.offset + std::size_t{i} * field.item, field.item);
            std::reverse(number.begin(), number.end());
        }
    }
}

} // namespace fledge::cosim
