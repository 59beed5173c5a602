// SPDX-License-Identifier: Apache-2.0
// Conditions of events as data, so that they can be exported to C: comparisons of fields with constants and with other
// fields, joined by and, or, not.
#pragma once

#include "flight/exec/condition.h"
#include "sim/instance.h"

#include <array>
#include <cstring>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace fledge::sim {

/// A number to compare: an element of a field, a measure of all its elements, or a constant.
struct Operand {
    std::shared_ptr<Instance> instance; ///< null: a constant
    std::uint32_t offset = 0;           ///< bytes from the start of the instance's memory
    FledgeType type = FLEDGE_F64;       ///< of the elements, or of the constant
    std::uint32_t elements = 1;
    ExecMeasure measure = EXEC_ELEMENT;
    std::array<std::byte, 8> constant{};

    template <class T> static Operand of(T x)
    {
        Operand operand;
        operand.type = std::is_same_v<T, double>         ? FLEDGE_F64
                       : std::is_same_v<T, std::int64_t> ? FLEDGE_I64
                                                         : FLEDGE_U64;
        static_assert(sizeof x == 8);
        std::memcpy(operand.constant.data(), &x, sizeof x);
        return operand;
    }
    double value() const;
    ExecOperand as_data() const;
};

struct Comparison {
    Operand left, right;
    ExecRelation relation = EXEC_LESS;

    bool holds() const;
};

class Condition {
public:
    struct Step {
        ExecJoin join = EXEC_COMPARE;
        Comparison comparison; ///< of EXEC_COMPARE
    };

    Condition(Comparison comparison, std::string text);
    /// Both, or either, of two.
    Condition(ExecJoin join, const Condition &a, const Condition &b);
    Condition operator~() const;
    /// Of its steps. Throws SetupError if they do not leave one result.
    Condition(std::vector<Step> steps, std::string text);

    bool holds() const;
    /// Call f with the instance of every field in it.
    void visit(const std::function<void(std::shared_ptr<Instance> &)> &f);

    const std::vector<Step> &steps() const { return steps_; } ///< in postfix order
    const std::string &text() const { return text_; }         ///< as the user would write it

private:
    std::string part_of(ExecJoin join) const;

    std::vector<Step> steps_;
    std::string text_;
    int depth_ = 1; ///< how many results wait at most
};

} // namespace fledge::sim
