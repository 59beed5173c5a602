// SPDX-License-Identifier: Apache-2.0
#include "world/environment/text_input.h"

#include "sim/error.h"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <memory>

namespace fledge::world {

std::string read_whole(const std::string &path)
{
    const std::unique_ptr<std::FILE, int (*)(std::FILE *)> file(std::fopen(path.c_str(), "rb"), std::fclose);
    if (!file) {
        throw sim::SetupError(path + ": cannot be opened: " + std::strerror(errno));
    }
    std::string text;
    char block[1 << 16];
    std::size_t got;
    while ((got = std::fread(block, 1, sizeof block, file.get())) > 0) {
        text.append(block, got);
    }
    if (std::ferror(file.get())) {
        throw sim::SetupError(path + ": cannot be read: " + std::strerror(errno));
    }
    return text;
}

std::vector<std::string_view> lines_of(std::string_view text)
{
    std::vector<std::string_view> lines;
    while (!text.empty()) {
        const std::size_t end = std::min(text.find('\n'), text.size());
        std::string_view line = text.substr(0, end);
        text.remove_prefix(std::min(end + 1, text.size()));
        if (!line.empty() && line.back() == '\r') {
            line.remove_suffix(1);
        }
        lines.push_back(line);
    }
    return lines;
}

std::vector<std::string_view> words_of(std::string_view line)
{
    std::vector<std::string_view> words;
    for (;;) {
        const std::size_t begin = line.find_first_not_of(" \t,\r");
        if (begin == line.npos) {
            return words;
        }
        line.remove_prefix(begin);
        const std::size_t length = std::min(line.find_first_of(" \t,\r"), line.size());
        words.push_back(line.substr(0, length));
        line.remove_prefix(length);
    }
}

std::optional<double> parse_number(std::string_view text)
{
    char copy[64];
    if (!text.empty() && text.front() == '+') {
        text.remove_prefix(1);
        if (!text.empty() && text.front() == '-') {
            return {};
        }
    }
    // from_chars knows neither the exponent D nor that "inf" and "nan" are no numbers here.
    if (text.empty() || text.size() > sizeof copy || text.find_first_not_of("+-.0123456789eEdD") != text.npos) {
        return {};
    }
    std::transform(text.begin(), text.end(), copy, [](char c) { return c == 'd' || c == 'D' ? 'e' : c; });
    double value = 0.0;
    const auto [end, error] = std::from_chars(copy, copy + text.size(), value);
    if (error != std::errc() || end != copy + text.size() || !std::isfinite(value)) {
        return {};
    }
    return value;
}

std::optional<int> parse_integer(std::string_view text)
{
    int value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (text.empty() || error != std::errc() || end != text.data() + text.size()) {
        return {};
    }
    return value;
}

namespace {

std::string escaped(std::string_view text)
{
    std::string result;
    for (const char c : text) {
        constexpr char digits[] = "0123456789ABCDEF";
        const auto byte = static_cast<unsigned char>(c);
        if (byte < ' ' || byte > '~') {
            result += {'\xe2', '\x9f', '\xa8', digits[byte / 16], digits[byte % 16], '\xe2', '\x9f', '\xa9'};
        } else {
            result += c;
        }
    }
    return result;
}

} // namespace

std::string shown(std::string_view text)
{
    constexpr std::size_t head = 900, tail = 200;
    if (text.size() <= head + tail) {
        std::string whole = escaped(text);
        if (whole.size() <= head + tail) {
            return whole;
        }
    }
    const auto is_inside = [](char c) { return (static_cast<unsigned char>(c) & 0xC0) == 0x80; }; // of a character
    const std::string first = escaped(text.substr(0, head)),
                      last = escaped(text.substr(std::max(text.size(), tail) - tail));
    std::size_t end = std::min(head, first.size()), begin = last.size() - tail;
    while (end < first.size() && is_inside(first[end])) {
        end--;
    }
    while (is_inside(last[begin])) {
        begin++;
    }
    return first.substr(0, end) + " ... " + last.substr(begin);
}

void refuse_file(const std::string &path, const std::string &what)
{
    throw sim::SetupError(path + ": " + shown(what));
}

void refuse_line(const std::string &file, std::size_t line, const std::string &what)
{
    refuse_file(file + ":" + std::to_string(line), what);
}

} // namespace fledge::world
