// SPDX-License-Identifier: Apache-2.0
#include "world/environment/text_kernel.h"

#include "sim/error.h"
#include "sim/text.h"
#include "world/environment/text_input.h"

#include <algorithm>

namespace fledge::world {

namespace {

struct Token {
    enum Kind { word, quoted, open, close, assign, append } kind;
    std::string text;
    std::size_t line;
};

std::string_view trimmed(std::string_view line)
{
    const std::size_t begin = line.find_first_not_of(" \t");
    if (begin == line.npos) {
        return {};
    }
    return line.substr(begin, line.find_last_not_of(" \t") - begin + 1);
}

/// Append the tokens of one line of data.
void tokenise(std::string_view line, std::size_t number, const std::string &file, std::vector<Token> &tokens)
{
    for (std::size_t i = 0; i < line.size();) {
        const char c = line[i];
        if (c == ' ' || c == '\t' || c == ',') {
            i++;
        } else if (c == '(' || c == ')') {
            tokens.push_back({c == '(' ? Token::open : Token::close, {c}, number});
            i++;
        } else if (c == '=') {
            tokens.push_back({Token::assign, "=", number});
            i++;
        } else if (line.substr(i, 2) == "+=") {
            tokens.push_back({Token::append, "+=", number});
            i += 2;
        } else if (c == '\'') {
            std::string text;
            for (i++;; i++) {
                if (i >= line.size()) {
                    refuse_line(file, number, "a string begins with ' and does not end in its line");
                }
                if (line[i] == '\'') {
                    if (line.substr(i, 2) != "''") {
                        break;
                    }
                    i++;
                }
                text += line[i];
            }
            i++;
            tokens.push_back({Token::quoted, text, number});
        } else {
            std::size_t end = i;
            while (end < line.size() && std::string_view(" \t,()='").find(line[end]) == std::string_view::npos &&
                   line.substr(end, 2) != "+=") {
                end++;
            }
            tokens.push_back({Token::word, std::string(line.substr(i, end - i)), number});
            i = end;
        }
    }
}

KernelValue value_of(const Token &token, const std::string &name, const std::string &file)
{
    KernelValue value{token.text, false, 0.0, token.line};
    if (token.kind == Token::quoted || token.text.front() == '@') {
        return value;
    }
    const auto number = parse_number(token.text);
    if (!number) {
        refuse_line(file, token.line,
                    "the value \"" + token.text + "\" of " + name + " is no number, no 'string' and no @time");
    }
    value.is_number = true;
    value.number = *number;
    return value;
}

} // namespace

TextKernel TextKernel::read(const std::string &path)
{
    return parse(read_whole(path), path);
}

TextKernel TextKernel::parse(std::string_view text, const std::string &file)
{
    if (text.find('\0') != text.npos) {
        throw sim::SetupError(file + ": holds binary data; expected a SPICE text kernel");
    }
    TextKernel kernel;
    kernel.file_ = file;
    std::vector<Token> tokens;
    bool data = false, any = false;
    std::size_t number = 0;
    for (const std::string_view line : lines_of(text)) {
        number++;
        const std::string_view word = trimmed(line);
        if (word == "\\begindata") {
            data = any = true;
        } else if (word == "\\begintext") {
            data = false;
        } else if (data) {
            tokenise(line, number, file, tokens);
        }
    }
    if (!any) {
        throw sim::SetupError(file + ": has no line \\begindata; expected a SPICE text kernel");
    }

    for (std::size_t i = 0; i < tokens.size();) {
        const Token &name = tokens[i];
        if (name.kind != Token::word) {
            refuse_line(file, name.line, "expected a name, found \"" + name.text + "\"");
        }
        i++;
        if (i == tokens.size() || (tokens[i].kind != Token::assign && tokens[i].kind != Token::append)) {
            refuse_line(
                file, name.line,
                "expected = or += after " + name.text +
                    (i == tokens.size() ? ", found the end of the file" : ", found \"" + tokens[i].text + "\""));
        }
        const bool append = tokens[i].kind == Token::append;
        i++;
        std::vector<KernelValue> values;
        const bool list = i < tokens.size() && tokens[i].kind == Token::open;
        if (list) {
            for (i++; i < tokens.size() && (tokens[i].kind == Token::word || tokens[i].kind == Token::quoted); i++) {
                values.push_back(value_of(tokens[i], name.text, file));
            }
            if (i == tokens.size() || tokens[i].kind != Token::close) {
                refuse_line(file, i == tokens.size() ? number : tokens[i].line,
                            "expected ) at the end of the values of " + name.text + ", which line " +
                                std::to_string(name.line) + " begins; found " +
                                (i == tokens.size() ? "the end of the file" : "\"" + tokens[i].text + "\""));
            }
            i++;
        } else if (i < tokens.size() && (tokens[i].kind == Token::word || tokens[i].kind == Token::quoted)) {
            values.push_back(value_of(tokens[i++], name.text, file));
        }
        if (values.empty()) {
            refuse_line(file, name.line, name.text + " has no value");
        }
        auto &stored = kernel.values_[name.text];
        if (!append) {
            stored.clear();
        }
        stored.insert(stored.end(), values.begin(), values.end());
    }
    return kernel;
}

const std::vector<KernelValue> &TextKernel::values(const std::string &name) const
{
    const auto found = values_.find(name);
    if (found == values_.end()) {
        std::vector<std::string> some = names();
        if (some.size() > 12) {
            some.resize(12);
            some.push_back("so on");
        }
        refuse_file(file_, "does not define " + name + "; it defines " + sim::format_list(some));
    }
    return found->second;
}

std::vector<double> TextKernel::numbers(const std::string &name, std::size_t least, std::size_t most) const
{
    const auto &all = values(name);
    if (all.size() < least || all.size() > most) {
        refuse_line(file_, all.front().line,
                    name + " has " + std::to_string(all.size()) + " values; expected " + std::to_string(least) +
                        (most == least ? "" : " to " + std::to_string(most)));
    }
    std::vector<double> numbers;
    for (const KernelValue &value : all) {
        if (!value.is_number) {
            refuse_line(file_, value.line, "expected numbers for " + name + ", found \"" + value.text + "\"");
        }
        numbers.push_back(value.number);
    }
    return numbers;
}

std::vector<std::string> TextKernel::names() const
{
    std::vector<std::string> names;
    for (const auto &[name, values] : values_) {
        names.push_back(name);
    }
    return names;
}

} // namespace fledge::world
