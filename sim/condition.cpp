// SPDX-License-Identifier: Apache-2.0
#include "sim/condition.h"

#include "sim/error.h"

#include <algorithm>

namespace fledge::sim {

double Operand::value() const
{
    const std::byte *p = instance ? instance->memory() + offset : constant.data();
    if (measure == Measure::element) {
        return element_read(type, p);
    }
    const double *x = reinterpret_cast<const double *>(p);
    if (type != FLEDGE_F64) {
        static thread_local std::vector<double> numbers;
        numbers.resize(elements);
        for (std::size_t i = 0; i < elements; i++) {
            numbers[i] = element_read(type, p + i * element_size(type));
        }
        x = numbers.data();
    }
    return measure == Measure::norm ? exec_norm(x, elements) : exec_max_abs(x, elements);
}

ExecNumber Operand::number() const
{
    if (!wide()) {
        return exec_real(value());
    }
    std::uint64_t bits;
    std::memcpy(&bits, instance ? instance->memory() + offset : constant.data(), sizeof bits);
    return type == FLEDGE_I64 ? exec_signed(static_cast<std::int64_t>(bits)) : exec_unsigned(bits);
}

bool Comparison::holds() const
{
    const bool exact = left.wide() || right.wide();
    const double a = exact ? exec_difference(left.number(), right.number()) : left.value();
    const double b = exact ? 0.0 : right.value();
    switch (relation) {
    case Relation::less: return a < b;
    case Relation::less_equal: return a <= b;
    case Relation::greater: return a > b;
    case Relation::greater_equal: return a >= b;
    case Relation::equal: return a == b;
    case Relation::not_equal: return a != b;
    }
    return false;
}

Condition::Condition(Comparison comparison, std::string text) : text_(std::move(text))
{
    steps_.push_back({Join::none, std::move(comparison)});
}

Condition::Condition(Join join, const Condition &a, const Condition &b)
    : steps_(a.steps_), text_(a.part_of(join) + (join == Join::both ? " & " : " | ") + b.part_of(join)),
      depth_(std::max(a.depth_, b.depth_ + 1))
{
    if (depth_ > 64) { // the bits in which holds() keeps the results
        throw SetupError("a condition nests more than 64 deep: " + text_);
    }
    steps_.insert(steps_.end(), b.steps_.begin(), b.steps_.end());
    steps_.push_back({join, {}});
}

Condition Condition::operator~() const
{
    Condition other = *this;
    other.steps_.push_back({Join::inverse, {}});
    other.text_ = "~(" + text_ + ")";
    return other;
}

/// Its text as an operand of & or |.
std::string Condition::part_of(Join join) const
{
    const Join own = steps_.back().join;
    return own == join || own == Join::inverse ? text_ : "(" + text_ + ")";
}

bool Condition::holds() const
{
    std::uint64_t results = 0; // a stack of bits
    for (const Step &step : steps_) {
        const std::uint64_t last = results & 1u, rest = results >> 1u;
        switch (step.join) {
        case Join::none: results = results << 1u | static_cast<std::uint64_t>(step.comparison.holds()); break;
        case Join::both: results = rest & (last | ~std::uint64_t{1}); break;
        case Join::either: results = rest | last; break;
        case Join::inverse: results ^= 1u; break;
        }
    }
    return results & 1u;
}

void Condition::visit(const std::function<void(std::shared_ptr<Instance> &)> &f)
{
    for (Step &step : steps_) {
        for (Operand *operand : {&step.comparison.left, &step.comparison.right}) {
            if (operand->instance) {
                f(operand->instance);
            }
        }
    }
}

} // namespace fledge::sim
