// SPDX-License-Identifier: Apache-2.0
#include "sim/condition.h"

#include "sim/error.h"

#include <algorithm>

namespace fledge::sim {

ExecOperand Operand::as_data() const
{
    return {instance ? instance->memory() + offset : constant.data(), elements, type, measure};
}

double Operand::value() const
{
    const ExecOperand data = as_data();
    return exec_value(&data);
}

bool Comparison::holds() const
{
    const ExecOperand a = left.as_data(), b = right.as_data();
    return exec_compare(&a, relation, &b);
}

Condition::Condition(Comparison comparison, std::string text) : text_(std::move(text))
{
    steps_.push_back({EXEC_COMPARE, std::move(comparison)});
}

Condition::Condition(ExecJoin join, const Condition &a, const Condition &b)
    : steps_(a.steps_), text_(a.part_of(join) + (join == EXEC_BOTH ? " & " : " | ") + b.part_of(join)),
      depth_(std::max(a.depth_, b.depth_ + 1))
{
    if (depth_ > EXEC_DEPTH) {
        throw SetupError("a condition nests more than " + std::to_string(EXEC_DEPTH) + " deep: " + text_);
    }
    steps_.insert(steps_.end(), b.steps_.begin(), b.steps_.end());
    steps_.push_back({join, {}});
}

Condition Condition::operator~() const
{
    Condition other = *this;
    other.steps_.push_back({EXEC_INVERSE, {}});
    other.text_ = "~(" + text_ + ")";
    return other;
}

Condition::Condition(std::vector<Step> steps, std::string text) : steps_(std::move(steps)), text_(std::move(text))
{
    int waiting = 0;
    for (const Step &step : steps_) {
        waiting += step.join == EXEC_COMPARE ? 1 : step.join == EXEC_INVERSE ? 0 : -1;
        depth_ = std::max(depth_, waiting);
        if (waiting < 1 || waiting > EXEC_DEPTH) {
            break;
        }
    }
    if (waiting != 1 || depth_ > EXEC_DEPTH) {
        throw SetupError("the steps of a condition leave no single result: " + text_);
    }
}

/// Its text as an operand of & or |.
std::string Condition::part_of(ExecJoin join) const
{
    const ExecJoin own = steps_.back().join;
    return own == join || own == EXEC_INVERSE ? text_ : "(" + text_ + ")";
}

bool Condition::holds() const
{
    std::uint64_t results = 0;
    for (const Step &step : steps_) {
        results = exec_join(results, step.join, step.join == EXEC_COMPARE && step.comparison.holds());
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
