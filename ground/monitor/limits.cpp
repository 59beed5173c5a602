// SPDX-License-Identifier: Apache-2.0
#include "ground/monitor/limits.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace fledge::ground {

namespace {

constexpr std::size_t most_pattern = 1000; // characters of a pattern
constexpr std::size_t most_matched = 4096; // bytes of a text that a pattern is compared with

std::regex compiled(const Type &type, const std::string &pattern)
{
    try {
        if (pattern.size() > most_pattern) {
            throw std::regex_error(std::regex_constants::error_complexity);
        }
        return std::regex(pattern, std::regex_constants::ECMAScript | std::regex_constants::__polynomial);
    } catch (const std::regex_error &error) {
        throw Refusal("an alarm of " + type.path + " has a pattern that is no regular expression, or too long: " +
                      pattern.substr(0, 60) + " (" + error.what() + ")");
    }
}

/// The number that is compared with a range.
std::optional<Number> number_of(const Limits::Sample &sample, bool calibrated)
{
    return calibrated && sample.kind != Kind::label ? number_of(sample.kind, sample.value)
                                                    : number_of(sample.raw_kind, sample.raw);
}

/// The end of a range in doubles: a number whose double is not beyond it is within the range. From 2^53 on a double
/// stands for several whole numbers.
double inner(const Number &end, bool open, double inwards)
{
    const double x = end.real();
    const bool exact = end == x && (std::abs(x) < 0x1p53 || std::isinf(x));
    return exact && !open ? x : std::nextafter(x, inwards);
}

} // namespace

Limits::Limits(const Type &type) : low_(infinite), high_(-infinite)
{
    for (const Alarm &alarm : type.alarms) {
        Check result{alarm.when.kind != Condition::Kind::always ? &alarm.when : nullptr,
                     alarm.violations,
                     alarm.on_change,
                     alarm.limits,
                     {},
                     {},
                     alarm.otherwise};
        if (type.sort == Type::Sort::enumerated && (!alarm.labels.empty() || alarm.otherwise != Concern::normal)) {
            result.of_label.assign(type.enumerators.size(), alarm.otherwise);
            for (const auto &[label, concern] : alarm.labels) {
                for (std::size_t i = 0; i < type.enumerators.size(); i++) {
                    result.of_label[i] = type.enumerators[i].label == label ? concern : result.of_label[i];
                }
            }
        } else {
            for (const auto &[pattern, concern] : alarm.labels) {
                result.patterns.emplace_back(compiled(type, pattern), concern);
            }
        }
        checks_.push_back(std::move(result));
    }
    finish();
}

Limits::Limits(const Bands &bands, std::uint32_t persistence) : low_(infinite), high_(-infinite)
{
    if (bands.empty()) {
        return;
    }
    Check result{nullptr, std::max(persistence, 1U), false, {}, {}, {}, Concern::normal};
    for (const auto &[level, band] : bands) {
        if (!(band.first <= band.second)) {
            throw Refusal("a band of limits is from the lower to the higher number; found " + text_of(band.first) +
                          " to " + text_of(band.second));
        }
        result.limits.push_back({level, Range{band.first, band.second}, false});
    }
    checks_.push_back(std::move(result));
    finish();
}

void Limits::finish()
{
    bool simple = checks_.size() == 1;
    for (const Check &check : checks_) {
        depth_ = std::max(depth_, check.violations + (check.on_change ? 1 : 0));
        simple =
            simple && check.when == nullptr && !check.on_change && check.of_label.empty() && check.patterns.empty();
        for (const Alarm::Limits &limit : check.limits) {
            simple = simple && !limit.inside && limit.range.calibrated;
        }
    }
    if (simple) {
        low_ = -infinite, high_ = infinite;
        for (const Alarm::Limits &limit : checks_[0].limits) {
            const Range &range = limit.range;
            low_ = std::max(low_, inner(range.low, range.low_open, infinite));
            high_ = std::min(high_, inner(range.high, range.high_open, -infinite));
        }
    }
}

Bands Limits::bands() const
{
    Bands result;
    if (!none() && checks_.back().when == nullptr && !checks_.back().on_change) {
        for (const Alarm::Limits &limit : checks_.back().limits) {
            if (!limit.inside && limit.range.calibrated) {
                result.emplace(limit.level, std::pair(limit.range.low, limit.range.high));
            }
        }
    }
    return result;
}

Concern Limits::judge(Decoder &decoder, const Sample &now, const Sample *before, Runs &runs) const
{
    const auto chosen = std::find_if(checks_.begin(), checks_.end(), [&](const Check &check) {
        return check.when == nullptr || decoder.applies(*check.when);
    });
    Concern level = Concern::normal;
    std::uint32_t violations = 1;
    if (chosen != checks_.end()) {
        violations = chosen->violations;
        for (const Alarm::Limits &limit : chosen->limits) {
            auto x = number_of(now, limit.range.calibrated);
            if (chosen->on_change) {
                const auto last =
                    before != nullptr && before->good() ? number_of(*before, limit.range.calibrated) : std::nullopt;
                x = x && last ? std::optional(*x - *last) : std::nullopt;
            }
            if (x && limit.range.holds(*x) == limit.inside) {
                level = std::max(level, limit.level);
            }
        }
        if (!chosen->of_label.empty()) {
            const bool known = now.value < chosen->of_label.size();
            level = std::max(level, known ? chosen->of_label[now.value] : chosen->otherwise);
        } else if (!chosen->patterns.empty() && now.kind == Kind::text) {
            const auto found = std::find_if(chosen->patterns.begin(), chosen->patterns.end(), [&](const auto &pattern) {
                return now.text.size() <= most_matched &&
                       std::regex_match(now.text.begin(), now.text.end(), pattern.first);
            });
            level = std::max(level, found != chosen->patterns.end() ? found->second : chosen->otherwise);
        }
    }
    if (depth_ == 1) {
        return level;
    }
    Concern result = Concern::normal;
    for (std::size_t i = 0; i < runs.size(); i++) {
        const auto above = static_cast<Concern>(i + 1);
        runs[i] = level < above ? 0 : runs[i] + (runs[i] != ~0U);
        result = runs[i] >= violations ? above : result;
    }
    return result;
}

Judge::Judge(const Type &type, std::vector<Setting> settings)
    : own_(std::make_shared<Limits>(type)), limits_(own_), settings_(std::move(settings)), depth_(own_->depth())
{
    for (const Setting &setting : settings_) {
        depth_ = std::max(depth_, setting.limits ? setting.limits->depth() : 1);
    }
}

void Judge::judge(Decoder &decoder, const Limits::Sample &sample, const Limits::Sample *before)
{
    if (sample.good() && !limits_->none()) {
        concern_ = limits_->judge(decoder, sample, before, runs_);
    }
}

Concern Judge::take(Decoder &decoder, const Limits::Sample &sample, std::int64_t received, std::uint32_t session)
{
    if (session != session_) {
        session_ = session;
        next_ = 0;
        limits_ = own_;
        runs_ = {};
        concern_ = Concern::normal;
        before_.reset();
    }
    for (; next_ < settings_.size() && settings_[next_].received <= received; next_++) {
        const auto before = std::exchange(limits_, settings_[next_].limits ? settings_[next_].limits : own_);
        if (limits_ == before) {
            continue;
        }
        runs_ = {};
        if (limits_->none()) {
            concern_ = Concern::normal;
        } else if (before_) { // at once, as Monitor::set_limits
            before_->text = text_;
            judge(decoder, *before_, nullptr);
        }
    }
    const double x = real_of(sample.kind, sample.value).value_or(std::numeric_limits<double>::quiet_NaN());
    const bool easy =
        concern_ == Concern::normal && runs_ == Limits::Runs{} && x >= limits_->low() && x <= limits_->high();
    if (!easy) {
        judge(decoder, sample, before_ ? &*before_ : nullptr);
    }
    before_ = sample;
    if (sample.kind == Kind::text) {
        text_ = sample.text;
    }
    return concern_;
}

} // namespace fledge::ground
