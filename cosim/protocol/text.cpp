// SPDX-License-Identifier: Apache-2.0
#include "cosim/protocol/text.h"

#include <algorithm>
#include <cstdio>

namespace fledge::cosim {

namespace {

struct Character {
    char32_t code;
    std::size_t size; ///< bytes; 0: this is not UTF-8
};

/// The first character of a text that is not empty.
Character first_of(std::string_view text)
{
    const auto byte = [&](std::size_t i) { return i < text.size() ? static_cast<unsigned char>(text[i]) : 0u; };
    const unsigned head = byte(0);
    if (head < 0x80) {
        return {head, 1};
    }
    const std::size_t size = head < 0xC2 ? 0 : head < 0xE0 ? 2 : head < 0xF0 ? 3 : head < 0xF5 ? 4 : 0;
    char32_t code = head & (0x7Fu >> size);
    for (std::size_t i = 1; i < size; i++) {
        if ((byte(i) & 0xC0) != 0x80) {
            return {0, 0};
        }
        code = code << 6 | (byte(i) & 0x3F);
    }
    const bool surrogate = code >= 0xD800 && code < 0xE000;
    const bool longer_than_needed = (size == 3 && code < 0x800) || (size == 4 && code < 0x10000);
    return {code, surrogate || longer_than_needed || code > 0x10FFFF ? 0 : size};
}

bool allowed(char32_t c, TextKind kind)
{
    if (c == '\t' || c == '\n') {
        return kind == TextKind::lines;
    }
    return c >= 0x20 && !(c >= 0x7F && c <= 0x9F) && !(c >= 0x2028 && c <= 0x202E) && !(c >= 0x2066 && c <= 0x2069);
}

} // namespace

std::string text_fault(std::string_view text, TextKind kind)
{
    std::string fault;
    const auto plain = [](char c) { return c >= ' ' && c <= '~'; };
    for (Character c{}; !text.empty(); text.remove_prefix(c.size)) {
        text.remove_prefix(static_cast<std::size_t>(std::find_if_not(text.begin(), text.end(), plain) - text.begin()));
        if (text.empty()) {
            break;
        }
        c = first_of(text);
        if (!c.size) {
            return "is not UTF-8";
        }
        if (fault.empty() && !allowed(c.code, kind)) {
            char code[16];
            std::snprintf(code, sizeof code, "U+%04X", static_cast<unsigned>(c.code));
            fault = std::string("holds the control character ") + code;
        }
    }
    return fault;
}

std::string cleaned(std::string_view text, std::size_t most)
{
    std::string clean;
    while (!text.empty()) {
        const Character c = first_of(text);
        const std::size_t size = std::max<std::size_t>(c.size, 1);
        const std::string_view kept = c.size && allowed(c.code, TextKind::lines) ? text.substr(0, size) : "?";
        if (clean.size() + kept.size() > most) {
            break;
        }
        clean += kept;
        text.remove_prefix(size);
    }
    return clean;
}

} // namespace fledge::cosim
