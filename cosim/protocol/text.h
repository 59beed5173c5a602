// SPDX-License-Identifier: Apache-2.0
// Which texts the programs exchange: UTF-8, and no characters that drive a terminal, which may show them. These are
// the control characters (U+0000 to U+001F, U+007F to U+009F), the separators of lines and paragraphs, and those that
// change the direction of writing (U+2028 to U+202E, U+2066 to U+2069).
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace fledge::cosim {

enum class TextKind {
    name,  ///< one line: of a node, a topic, an address
    lines, ///< a reason or a definition: tabs and line feeds are allowed
};

/// What is wrong with a text: "is not UTF-8"; "" if nothing is.
std::string text_fault(std::string_view text, TextKind kind);

/// The text with '?' for each byte and character that is not allowed in lines, and at most so many bytes of it.
std::string cleaned(std::string_view text, std::size_t most);

} // namespace fledge::cosim
