// SPDX-License-Identifier: Apache-2.0
// Reading the text files of others: whole, line by line, numbers as Fortran writes them.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace fledge::world {

/// The bytes of a file. Throws SetupError with its name and the reason if it cannot be read.
std::string read_whole(const std::string &path);

/// The lines of a text, without their ends ("\n" or "\r\n").
std::vector<std::string_view> lines_of(std::string_view text);

/// The parts between blanks, tabs and commas.
std::vector<std::string_view> words_of(std::string_view line);

/// A finite number, its exponent marked by e, E, d or D; nothing if the text is anything else.
std::optional<double> parse_number(std::string_view text);

/// A decimal integer; nothing if the text is anything else.
std::optional<int> parse_integer(std::string_view text);

/// A text of a file for a message: what is no printable ASCII as "⟨0F⟩", a long one cut in its middle.
std::string shown(std::string_view text);

/// Throws SetupError "path: what", which may have texts of the file.
[[noreturn]] void refuse_file(const std::string &path, const std::string &what);

/// Throws SetupError "file:line: what", likewise.
[[noreturn]] void refuse_line(const std::string &file, std::size_t line, const std::string &what);

} // namespace fledge::world
