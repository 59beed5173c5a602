// SPDX-License-Identifier: Apache-2.0
#include "ground/database/operand.h"
#include "ground/database/xtce/readers.h"

namespace fledge::ground::xtce {

namespace {

constexpr View of_argument = "/yamcs/cmd/arg/";
constexpr std::size_t most_judged = 1 << 22; // types and arguments that constants are compared with
constexpr std::int64_t most_quantity = std::int64_t(1) << 40;

bool is_reference(Node node)
{
    return one_of(tag(node), {"ParameterInstanceRef", "ArgumentInstanceRef"});
}

Operator comparison_operator(Node node, View text)
{
    constexpr View operators[] = {"==", "!=", "<", "<=", ">", ">="};
    const auto found = std::find(std::begin(operators), std::end(operators), trimmed(text));
    return found != std::end(operators)
               ? static_cast<Operator>(found - std::begin(operators))
               : refuse_as<Operator>(node, "'" + std::string(text) + "' is no operator of a comparison");
}

} // namespace

// --- references

/// ".member" and "[3]" behind the name of a parameter.
void ValueReader::add_steps(Reference &to, Node node, View steps) const
{
    Id at = db_.parameters[to.parameter].type;
    for (std::size_t i = 0; i < steps.size();) {
        const std::size_t next = std::min(steps.find_first_of("/.[", i + 1), steps.size());
        const std::string step(steps.substr(i + 1, next - i - 1));
        const Type &type = db_.types[at];
        const auto member = std::find_if(type.members.begin(), type.members.end(),
                                         [&](const Member &candidate) { return candidate.name == step; });
        if (steps[i] == '[' && type.sort == Type::Sort::array && step.ends_with(']')) {
            to.steps.push_back(count(node, View(step).substr(0, step.size() - 1), 0, 1 << 20));
            at = type.element;
        } else if (steps[i] != '[' && member != type.members.end()) {
            to.steps.push_back(static_cast<std::uint32_t>(member - type.members.begin()));
            at = member->type;
        } else {
            refuse(node, type.path + " has no " + step);
        }
        i = next;
    }
}

std::optional<Reference> ValueReader::parameter(Node node, const std::string &text) const
{
    for (std::size_t end = text.size(); end != std::string::npos && end > 0; end = text.find_last_of("/.[", end - 1)) {
        if (const auto found = declared_.parameter(View(text).substr(0, end))) {
            Reference reference;
            reference.of = Reference::Of::parameter;
            reference.parameter = *found;
            reference.name = text;
            add_steps(reference, node, View(text).substr(end));
            return reference;
        }
    }
    return std::nullopt;
}

Reference ValueReader::reference(Node node) const
{
    Reference result;
    if (const auto argument = node.attribute("argumentRef")) {
        result.of = Reference::Of::argument;
        result.name = argument.value();
    } else {
        const std::string text = needed(node, "parameterRef");
        if (auto found = parameter(node, text)) {
            result = *found;
        } else if ((outside && text.starts_with("/yamcs/")) || members.contains(text)) {
            result.of = Reference::Of::argument; // a member beside it, or a value of another program by its name
            result.name = text.starts_with(of_argument) ? text.substr(of_argument.size()) : text;
        } else {
            refuse(node, "there is no parameter " + text);
        }
    }
    if (node.attribute("instance").as_int(0) != 0) {
        refuse(node, "only the last value of " + result.name + " is kept: instance must be 0");
    }
    result.calibrated = is_true(node, "useCalibratedValue", true);
    return result;
}

// --- conditions

Condition ValueReader::comparison(Node node) const
{
    Condition result;
    result.kind = Condition::Kind::compare;
    const auto inside = elements(node);
    const char *const op = node.attribute("comparisonOperator").as_string("==");
    result.left = reference(inside.empty() ? node : inside.front());
    result.op = comparison_operator(node, op);
    const auto value = node.attribute("value");
    result.literal =
        Literal(value ? value.value() : refuse_as<const char *>(node, "<Comparison> needs the attribute value"));
    result.text = result.left.name + " " + op + " " + result.literal.text;
    return result;
}

Condition ValueReader::two_values(Node node) const
{
    Condition result;
    result.kind = Condition::Kind::compare;
    int place = 0;
    for (Node child : elements(node)) {
        if (is_reference(child) && place < 2) {
            (place++ == 0 ? result.left : result.right) = reference(child);
        } else if (tag(child) == "ComparisonOperator") {
            result.op = comparison_operator(child, child.text().get());
            result.text = trimmed(child.text().get());
        } else if (tag(child) == "Value" && place == 1) {
            result.literal = Literal(child.text().get());
            place++;
        } else {
            refuse_element(child);
        }
    }
    if (place != 2 || result.text.empty()) {
        refuse(node, "a condition compares two values, or a value with a constant");
    }
    result.text = result.left.name + " " + result.text + " " +
                  (result.right.of == Reference::Of::nothing    ? result.literal.text
                   : result.right.of == Reference::Of::argument ? "argument " + result.right.name
                                                                : result.right.name);
    return result;
}

Condition ValueReader::condition_of(Node node, std::size_t depth)
{
    const View name = tag(node);
    if (depth > deepest) {
        refuse(node, "conditions are nested deeper than " + std::to_string(deepest));
    }
    if (name == "Comparison" || name == "Condition") {
        Condition result = name == "Comparison" ? comparison(node) : two_values(node);
        if (result.right.of == Reference::Of::nothing) {
            comparisons_.emplace_back(node, result);
        }
        return result;
    }
    Condition result;
    result.kind = name == "ORedConditions" ? Condition::Kind::any : Condition::Kind::all;
    if (!one_of(name, {"ComparisonList", "BooleanExpression", "ANDedConditions", "ORedConditions"})) {
        refuse_element(node);
    }
    for (Node child : elements(node)) {
        result.parts.push_back(condition_of(child, depth + 1));
    }
    if (result.parts.empty()) {
        refuse(node, "<" + std::string(name) + "> has no condition");
    }
    return result;
}

Condition ValueReader::condition(Node node)
{
    const auto inside = elements(node);
    if (inside.size() != 1 || !is_condition(inside[0])) {
        refuse(inside.size() > 1 ? inside[1] : node, "<" + std::string(tag(node)) +
                                                         "> must hold one Comparison, ComparisonList or "
                                                         "BooleanExpression");
    }
    return condition_of(inside[0]);
}

/// The types that an argument has: in the command around a node, else in all commands; none where a member of an
/// aggregate may be meant. Adds to `looked` how many arguments it compared.
std::set<Id> ValueReader::argument_types(Node node, const std::string &name, std::size_t &looked) const
{
    for (; node && tag(node) != "MetaCommand"; node = node.parent()) {
    }
    const auto command = commands_.find(node.internal_object());
    if (!node || command == commands_.end()) {
        if (members.contains(name)) {
            return {};
        }
        const auto found = arguments_.find(name);
        return found != arguments_.end() ? found->second : std::set<Id>();
    }
    for (Id at = command->second; at != no_id && !declared_.left_out(declared_.commands[at]);
         at = db_.commands[at].base) {
        looked += db_.commands[at].arguments.size() + 1;
        for (const Argument &argument : db_.commands[at].arguments) {
            if (argument.name == name) {
                return {argument.type};
            }
        }
    }
    return {};
}

void ValueReader::note_constants()
{
    for (Id i = 0; i < db_.commands.size(); i++) {
        commands_[declared_.commands[i].node.internal_object()] = i;
        for (const Argument &argument : db_.commands[i].arguments) {
            arguments_[argument.name].insert(argument.type);
        }
    }
    std::size_t judged = 0;
    for (const auto &[node, compared] : comparisons_) {
        const Condition &condition = compared; // C++20 lets a lambda take a binding, clang 14 does not
        const Reference &left = condition.left;
        std::set<Id> types;
        if (left.of == Reference::Of::argument) {
            types = argument_types(node, left.name, judged);
        } else if (db_.parameters[left.parameter].type != no_id) { // else it is left out
            types = {db_.type_of(left)};
        }
        if ((judged += types.size()) > most_judged) {
            return;
        }
        const auto has = [&](Id type) { return has_value(db_.types[type], left.calibrated, condition.literal); };
        if (!types.empty() && std::none_of(types.begin(), types.end(), has)) {
            declared_.note(node, "'" + condition.literal.text + "' is no value of " + left.name +
                                     (left.calibrated ? "" : " as a raw number") + ": nothing equals it");
        }
    }
}

// --- quantities

Quantity ValueReader::quantity(Node node)
{
    Quantity result;
    for (Node child : elements(node)) {
        if (one_of(tag(child), {"FixedValue", "Fixed"})) {
            const Node value = tag(child) == "Fixed" ? element(child, "FixedValue") : child;
            result.fixed = whole(child, value.text().get());
            if (result.fixed > most_quantity || result.fixed < -most_quantity) {
                refuse(child, "a size, a place or a number is at most 2^40; found " + std::to_string(result.fixed));
            }
            return result;
        }
        if (tag(child) == "DynamicValue") {
            for (Node part : elements(child)) {
                if (is_reference(part)) {
                    result.from = reference(part);
                } else if (tag(part) == "LinearAdjustment") {
                    result.slope = real_or(part, "slope", 1);
                    result.intercept = real_or(part, "intercept", 0);
                } else {
                    refuse_element(part);
                }
            }
            return result.from.of != Reference::Of::nothing
                       ? result
                       : refuse_as<Quantity>(child, "<DynamicValue> refers to nothing");
        }
        if (tag(child) == "DiscreteLookupList") {
            result.looked_up = true;
            for (Node lookup : elements(child)) {
                if (tag(lookup) != "DiscreteLookup" || elements(lookup).size() != 1) {
                    refuse(lookup, "a lookup has one condition and a value");
                }
                result.cases.emplace_back(
                    condition_of(elements(lookup)[0]),
                    std::clamp(whole(lookup, needed(lookup, "value")), -most_quantity, most_quantity));
            }
            if (const auto otherwise = child.attribute("defaultValue")) { // of XTCE 1.3
                result.cases.emplace_back(Condition(),
                                          std::clamp(whole(child, otherwise.value()), -most_quantity, most_quantity));
            }
            return result;
        }
    }
    refuse(node, "<" + std::string(tag(node)) + "> has no value");
}

std::vector<Dimension> ValueReader::dimensions(Node node)
{
    std::vector<Dimension> result;
    for (Node child : elements(node)) {
        Dimension dimension;
        if (tag(child) == "Size") { // the number, not the last index
            dimension.last = quantity(child);
            dimension.last.fixed--;
            dimension.last.intercept--;
            for (auto &[condition, value] : dimension.last.cases) {
                value--;
            }
        } else if (tag(child) == "Dimension") {
            dimension.first = quantity(element(child, "StartingIndex"));
            dimension.last = quantity(element(child, "EndingIndex"));
        } else {
            refuse_element(child);
        }
        result.push_back(std::move(dimension));
    }
    return result;
}

} // namespace fledge::ground::xtce
