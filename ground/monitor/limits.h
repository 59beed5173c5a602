// SPDX-License-Identifier: Apache-2.0
// The concern of values by their limits: the alarms of a type, or bands that a person has set.
#pragma once

#include "ground/database/decoder.h"

#include <array>
#include <limits>
#include <map>
#include <memory>
#include <regex>

namespace fledge::ground {

constexpr double infinite = std::numeric_limits<double>::infinity();

/// low and high by the level.
using Bands = std::map<Concern, std::pair<Number, Number>>;

class Limits {
public:
    /// A value as its limits see it.
    struct Sample {
        Kind kind, raw_kind;
        Status status;
        std::uint64_t raw, value; ///< by the kinds
        std::string_view text;    ///< of a text

        bool good() const { return status == Status::good || status == Status::unlabelled; }
    };
    using Runs = std::array<std::uint32_t, 5>; ///< successive values of each level or above

    /// Throws Refusal for a pattern that is no regular expression.
    explicit Limits(const Type &type);
    /// Each level's values are those outside of its band. Throws Refusal if a band's low end is above its high end.
    Limits(const Bands &bands, std::uint32_t persistence);

    bool none() const { return checks_.empty(); }
    /// Numbers from low to high have no concern, whatever the other values are.
    double low() const { return low_; }
    double high() const { return high_; }
    /// The static limits that have no condition.
    Bands bands() const;
    std::uint32_t persistence() const { return none() ? 1 : checks_.back().violations; }
    /// On how many successive values a concern depends.
    std::uint32_t depth() const { return depth_; }

    /// The concern after a good value. before: the value before it, or nullptr.
    Concern judge(Decoder &decoder, const Sample &now, const Sample *before, Runs &runs) const;

private:
    struct Check {             ///< an alarm, compiled
        const Condition *when; ///< nullptr: always
        std::uint32_t violations;
        bool on_change;
        std::vector<Alarm::Limits> limits;
        std::vector<Concern> of_label; ///< of each enumerator
        std::vector<std::pair<std::regex, Concern>> patterns;
        Concern otherwise; ///< if no label and no pattern matches
    };

    void finish();

    std::vector<Check> checks_; ///< the first whose condition holds applies
    double low_, high_;
    std::uint32_t depth_ = 1;
};

/// The concern of successive values, by limits that change.
class Judge {
public:
    struct Setting {
        std::int64_t received;                ///< [ns] UTC: the limits apply to packets received from then on
        std::shared_ptr<const Limits> limits; ///< nullptr: those of the database
    };

    /// type: its alarms are the limits before any setting.
    Judge(const Type &type, std::vector<Setting> settings);

    std::uint32_t depth() const { return depth_; }
    /// The concern after a value, which need not be good. A new session resets the state.
    Concern take(Decoder &decoder, const Limits::Sample &sample, std::int64_t received, std::uint32_t session);

private:
    void judge(Decoder &decoder, const Limits::Sample &sample, const Limits::Sample *before);

    std::shared_ptr<const Limits> own_, limits_; ///< those of the database; those in force
    std::vector<Setting> settings_;
    std::size_t next_ = 0;
    std::uint32_t session_ = 0, depth_ = 1;
    Limits::Runs runs_{};
    Concern concern_ = Concern::normal;
    std::optional<Limits::Sample> before_;
    std::string text_; ///< of before_
};

} // namespace fledge::ground
