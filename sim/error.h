// SPDX-License-Identifier: Apache-2.0
// What can go wrong. Set-up errors name the instance, the port or parameter, the rule, the value
// found and the valid choices; run errors name the instance and the time, and keep the last good values.
#pragma once

#include <compare>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace fledge::sim {

struct SetupError : std::runtime_error {
    using std::runtime_error::runtime_error;
};

struct RunError : std::runtime_error {
    using std::runtime_error::runtime_error;
};

/// A line of a user's file; "" and 0: unknown.
struct SourceLine {
    std::string file = {};
    int line = 0;

    auto operator<=>(const SourceLine &) const = default;
};

/// Why a simulation cannot run, and the line that made what it is about.
struct Problem {
    SourceLine at;
    std::string text;

    auto operator<=>(const Problem &) const = default;
};

/// A simulation as it was composed cannot run. The text has a line for each problem: "flight.py, line 12: ...".
struct CompositionError : SetupError {
    explicit CompositionError(const std::vector<Problem> &problems) : SetupError(lines(problems)) {}

private:
    static std::string lines(const std::vector<Problem> &problems)
    {
        std::string text;
        for (const Problem &problem : problems) {
            text +=
                (text.empty() ? "" : "\n") +
                (problem.at.file.empty() ? "" : problem.at.file + ", line " + std::to_string(problem.at.line) + ": ") +
                problem.text;
        }
        return text;
    }
};

/// Collects the faults of several checks, so that one SetupError lists them all, a line each.
class Faults {
public:
    void add(const std::string &text, const SourceLine &at = {}) { all_.push_back({at, text}); }

    /// Add what a check throws, each line of it. Returns whether it throws nothing.
    template <class Check> bool collect(const Check &check, const SourceLine &at = {})
    {
        try {
            check();
        } catch (const SetupError &error) {
            std::string text = error.what();
            for (std::size_t end; (end = text.find('\n')) != std::string::npos; text.erase(0, end + 1)) {
                add(text.substr(0, end), at);
            }
            add(text, at);
            return false;
        }
        return true;
    }

    void raise() const
    {
        if (!all_.empty()) {
            std::string text;
            for (const Problem &problem : all_) {
                text += (text.empty() ? "" : "\n") + problem.text;
            }
            throw SetupError(text);
        }
    }

    const std::vector<Problem> &all() const { return all_; }

private:
    std::vector<Problem> all_;
};

} // namespace fledge::sim
