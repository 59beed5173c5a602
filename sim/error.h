// SPDX-License-Identifier: Apache-2.0
// What can go wrong. Set-up errors name the instance, the port or parameter, the rule, the value
// found and the valid choices; run errors name the instance and the time, and keep the last good values.
#pragma once

#include <stdexcept>
#include <string>

namespace fledge::sim {

struct SetupError : std::runtime_error {
    using std::runtime_error::runtime_error;
};

struct RunError : std::runtime_error {
    using std::runtime_error::runtime_error;
};

/// Collects the faults of several checks, so that one SetupError lists them all, a line each.
class Faults {
public:
    void add(const std::string &text) { text_ += (text_.empty() ? "" : "\n") + text; }

    /// Add what a check throws.
    template <class Check> void collect(const Check &check)
    {
        try {
            check();
        } catch (const SetupError &error) {
            add(error.what());
        }
    }

    void raise() const
    {
        if (!text_.empty()) {
            throw SetupError(text_);
        }
    }

private:
    std::string text_;
};

} // namespace fledge::sim
