// SPDX-License-Identifier: Apache-2.0
// The command line of a program in C++: each option once, with its help and its limits. The parser behind it, CLI11,
// takes seconds to compile; only options.cpp includes it.
//
// Example:
//
//     int run(const std::string &address, double start);
//
//     int main(int argc, char **argv)
//     {
//         Options options("thermal", "A plate in the Sun.", "See docs/cosim.md.");
//         std::string address;
//         double start = 300.0;
//         options.text("--address", address, "ADDRESS", "where the controller listens").required();
//         options.number("--start", start, 0.0, 1000.0, "K", "the temperature at the beginning");
//         options.parse(argc, argv);
//         return run(address, start);
//     }
#pragma once

#include <cstdint>
#include <functional>
#include <initializer_list>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace fledge {

class Options {
    struct Parser;

public:
    /// An option that was added, to say more of it.
    class Option {
    public:
        Option &required();
        Option &needs(const char *other); ///< an option that was added before this one
        Option &one_of(std::initializer_list<const char *> words);

    private:
        friend class Options;
        Option(Parser &parser, void *option) : parser_(parser), option_(option) {}
        Parser &parser_;
        void *option_;
    };

    Options(const std::string &program, const std::string &about, const std::string &footer);
    ~Options();
    Options(const Options &) = delete;
    Options &operator=(const Options &) = delete;

    // A name without dashes is that of a positional argument. `type` stands behind the name in the help. What the
    // command line does not have keeps its value.
    Option text(const char *name, std::string &to, const char *type, const char *help);
    /// May be given several times, with one text each time.
    Option texts(const char *name, std::vector<std::string> &to, const char *type, const char *help);
    Option number(const char *name, double &to, double least, double most, const char *type, const char *help);
    Option numbers(const char *name, std::pair<double, double> &to, const char *type, const char *help);
    template <class T> Option whole(const char *name, T &to, T least, T most, const char *type, const char *help)
    {
        return whole(
            name, [&to](std::uint64_t x) { to = static_cast<T>(x); }, static_cast<std::uint64_t>(least),
            static_cast<std::uint64_t>(most), type, help);
    }
    void flag(const char *name, bool &to, const char *help);

    /// Read the arguments. Ends the program with 0 after --help, and with 2 after a mistake.
    void parse(int argc, char **argv);

    /// Print what is wrong with the command line, and end the program with 2.
    [[noreturn]] void refuse(const std::string &why) const;

private:
    Option whole(const char *name, const std::function<void(std::uint64_t)> &set, std::uint64_t least,
                 std::uint64_t most, const char *type, const char *help);
    std::unique_ptr<Parser> parser_;
};

/// "" if a text is a number from `least` to `most`, else why not.
std::string check_number(const std::string &text, double least, double most);

} // namespace fledge
