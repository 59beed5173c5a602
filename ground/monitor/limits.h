// SPDX-License-Identifier: Apache-2.0
// The concern of values by their limits: the alarms of a type, or bands that a person has set.
#pragma once

#include "ground/database/decoder.h"

#include <array>
#include <map>
#include <regex>

namespace fledge::ground {

/// low and high by the level.
using Bands = std::map<Concern, std::pair<double, double>>;

class Limits {
public:
    /// A value that is good or has no label.
    struct Sample {
        Kind kind, raw_kind;
        Status status;
        std::uint64_t raw, value; ///< by the kinds
        std::string_view text;    ///< of a text
    };
    using Runs = std::array<std::uint32_t, 5>; ///< successive values of each level or above

    /// Throws Refusal for a pattern that is no regular expression.
    explicit Limits(const Type &type);
    /// Values are outside of the band of each level. Throws Refusal if one is upside down.
    Limits(const Bands &bands, std::uint32_t persistence);

    bool none() const { return checks_.empty(); }
    /// All is well for a number from low to high, whatever else there is.
    double low() const { return low_; }
    double high() const { return high_; }
    /// The static ones without a condition.
    Bands bands() const;
    std::uint32_t persistence() const { return none() ? 1 : checks_.back().violations; }
    /// Whether a concern depends on values before it.
    bool persists() const { return persists_; }

    /// The concern after a value. before: the value before it, or nullptr.
    Concern judge(Decoder &decoder, const Sample &now, const Sample *before, Runs &runs) const;

private:
    struct Check {             ///< an alarm, compiled
        const Condition *when; ///< nullptr: always
        std::uint32_t violations;
        bool on_change;
        std::vector<Alarm::Limits> limits;
        std::vector<Concern> of_label; ///< of each enumerator
        std::vector<std::pair<std::regex, Concern>> patterns;
        Concern otherwise; ///< than labels and patterns
    };

    void finish();

    std::vector<Check> checks_; ///< the first whose condition holds counts
    double low_, high_;
    bool persists_ = false;
};

} // namespace fledge::ground
