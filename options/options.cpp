// SPDX-License-Identifier: Apache-2.0
#include "options/options.h"

#include <CLI/CLI.hpp>

#include <cstdio>
#include <cstdlib>

namespace fledge {

struct Options::Parser {
    CLI::App app;
};

namespace {

CLI::Option *cli(void *option)
{
    return static_cast<CLI::Option *>(option);
}

template <class T> std::string in_words(T x)
{
    std::ostringstream text;
    text << x;
    return text.str();
}

template <class T> std::string check(const std::string &text, T least, T most, const char *kind)
{
    T x{};
    return CLI::detail::lexical_cast(text, x) && x >= least && x <= most
               ? ""
               : "expected a " + std::string(kind) + " from " + in_words(least) + " to " + in_words(most) + ", found " +
                     text;
}

} // namespace

std::string check_number(const std::string &text, double least, double most)
{
    return check(text, least, most, "number");
}

Options::Option &Options::Option::required()
{
    cli(option_)->required();
    return *this;
}

Options::Option &Options::Option::needs(const char *other)
{
    cli(option_)->needs(parser_.app.get_option(other));
    return *this;
}

Options::Option &Options::Option::one_of(std::initializer_list<const char *> words)
{
    cli(option_)->check(CLI::IsMember(std::vector<std::string>(words.begin(), words.end())));
    return *this;
}

Options::Options(const std::string &program, const std::string &about, const std::string &footer)
    : parser_(std::make_unique<Parser>())
{
    parser_->app.name(program);
    parser_->app.description(about);
    parser_->app.footer(footer + "\n\nExits with 0 at the regular end, 1 at another, 2 on a mistake in the options.");
}

Options::~Options() = default;

Options::Option Options::text(const char *name, std::string &to, const char *type, const char *help)
{
    return {*parser_, parser_->app.add_option(name, to, help)->type_name(type)};
}

Options::Option Options::texts(const char *name, std::vector<std::string> &to, const char *type, const char *help)
{
    return {*parser_, parser_->app.add_option(name, to, help)->allow_extra_args(false)->type_name(type)};
}

Options::Option Options::number(const char *name, double &to, double least, double most, const char *type,
                                const char *help)
{
    const auto within = [least, most](const std::string &text) { return check_number(text, least, most); };
    return {*parser_, parser_->app.add_option(name, to, help)->check(within)->type_name(type)};
}

Options::Option Options::numbers(const char *name, std::pair<double, double> &to, const char *type, const char *help)
{
    return {*parser_, parser_->app.add_option(name, to, help)->type_name(type)};
}

Options::Option Options::whole(const char *name, const std::function<void(std::uint64_t)> &set, std::uint64_t least,
                               std::uint64_t most, const char *type, const char *help)
{
    const auto within = [least, most](const std::string &text) { return check(text, least, most, "whole number"); };
    return {*parser_, parser_->app.add_option_function<std::uint64_t>(name, set, help)->check(within)->type_name(type)};
}

void Options::flag(const char *name, bool &to, const char *help)
{
    parser_->app.add_flag(name, to, help);
}

void Options::parse(int argc, char **argv)
{
    try {
        parser_->app.parse(argc, argv);
    } catch (const CLI::CallForHelp &help) {
        std::exit(parser_->app.exit(help));
    } catch (const CLI::Error &error) {
        refuse(error.what());
    }
}

void Options::refuse(const std::string &why) const
{
    std::fprintf(stderr, "%s: %s; see --help\n", parser_->app.get_name().c_str(), why.c_str());
    std::exit(2);
}

} // namespace fledge
