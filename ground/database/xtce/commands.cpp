// SPDX-License-Identifier: Apache-2.0
#include "ground/database/xtce/readers.h"

namespace fledge::ground::xtce {

void CommandReader::fill()
{
    declared_.each(db_.commands, declared_.commands, [&](Id i) {
        const Node node = declared_.commands[i].node;
        db_.commands[i].is_abstract = is_true(node, "abstract", false);
        for (Node child : elements(node)) {
            values_.outside = one_of(tag(child), {"TransmissionConstraintList", "VerifierSet"});
            declared_.attempt(node, db_.commands[i].path, [&] { part(i, child); });
        }
        values_.outside = false;
    });
}

void CommandReader::part(Id id, Node child)
{
    Command &command = db_.commands[id];
    const View name = tag(child);
    if (name == "BaseMetaCommand") {
        command.base = declared_.command(child, needed(child, "metaCommandRef"));
        for (Node item : elements(element(child, "ArgumentAssignmentList"))) {
            command.assignments.emplace_back(needed(item, "argumentName"), item.attribute("argumentValue").value());
        }
    } else if (name == "ArgumentList") {
        for (Node item : elements(child)) {
            Named named;
            declared_.describe(item, command.path, named);
            command.arguments.push_back(
                {named.name, named.description, declared_.type(item, "argumentTypeRef", true), initial(item)});
        }
    } else if (name == "CommandContainer") {
        const auto container = declared_.container_of(id);
        if (!container) {
            refuse_reference("its container");
        }
        command.container = *container;
    } else if (name == "DefaultSignificance") {
        command.consequence = child.attribute("consequenceLevel").value();
        command.reason = child.attribute("reasonForWarning").value();
    } else if (name == "TransmissionConstraintList") {
        for (Node item : elements(child)) {
            command.constraints.push_back(constraint(item));
        }
    } else if (name == "VerifierSet") {
        for (Node item : elements(child)) {
            command.verifiers.push_back(verifier(item));
        }
    } else if (one_of(name, {"ContextSignificanceList", "Interlock", "ParameterToSetList",
                             "ParametersToSuspendAlarmsOnSet"})) {
        declared_.note(child, std::string(name) + " is not computed");
    } else if (!is_common(child) && name != "SystemName") {
        refuse_element(child);
    }
}

Constraint CommandReader::constraint(Node node)
{
    Constraint result;
    result.timeout = seconds(node, node.attribute("timeOut").as_string("PT0S"));
    result.suspendable = is_true(node, "suspendable", false);
    if (const Node algorithm = element(node, "CustomAlgorithm")) {
        result.algorithm = algorithm.attribute("name").as_string("without a name");
        declared_.note(algorithm, "an algorithm that constrains a command is not computed");
    } else {
        result.condition = values_.condition(node);
    }
    return result;
}

Verifier CommandReader::verifier(Node node)
{
    Verifier result;
    result.stage = tag(node).substr(0, tag(node).rfind("Verifier"));
    if (std::find(std::begin(verifier_stages), std::end(verifier_stages), result.stage) == std::end(verifier_stages) ||
        !tag(node).ends_with("Verifier")) {
        refuse_element(node);
    }
    for (Node child : elements(node)) {
        const View name = tag(child);
        if (ValueReader::is_condition(child)) {
            result.condition = values_.condition_of(child);
        } else if (name == "ContainerRef") {
            result.container = declared_.container(child, needed(child, "containerRef"));
        } else if (name == "ParameterValueChange") {
            result.changes = values_.reference(element(child, "ParameterRef"));
            result.change = any_number(child, needed(element(child, "Change"), "value"));
        } else if (name == "CheckWindow") {
            window(result, child);
        } else if (name == "ReturnParmRef") {
            result.returns = values_.reference(child);
        } else if (name == "PercentComplete") {
            if (const Node fixed = element(child, "FixedValue")) {
                result.percent = real(fixed, fixed.text().get());
            } else {
                declared_.note(child, "only a fixed percentage is computed");
            }
        } else if (one_of(name, {"CustomAlgorithm", "CheckWindowAlgorithms"})) {
            result.algorithm = child.attribute("name").as_string("without a name");
            declared_.note(child, "an algorithm that verifies a command is not computed");
        } else if (!is_common(child)) {
            refuse_element(child);
        }
    }
    if (result.condition.kind == Condition::Kind::always && result.container == no_id && result.algorithm.empty() &&
        result.changes.of == Reference::Of::nothing) {
        refuse(node, "<" + std::string(tag(node)) +
                         "> needs a Comparison, ComparisonList, BooleanExpression, ContainerRef or "
                         "ParameterValueChange");
    }
    return result;
}

void CommandReader::window(Verifier &result, Node node)
{
    result.start = seconds(node, node.attribute("timeToStartChecking").as_string("PT0S"));
    result.stop = seconds(node, needed(node, "timeToStopChecking"));
    result.relative_to = node.attribute("timeWindowIsRelativeTo").as_string("timeLastVerifierPassed");
    if (!(result.stop > result.start) || !one_of(result.relative_to, {"timeLastVerifierPassed", "commandRelease"})) {
        refuse(node, "a window ends after it begins, relative to timeLastVerifierPassed or commandRelease");
    }
}

void CommandReader::refuse_loops()
{
    for (Id i = 0; i < db_.commands.size(); i++) {
        std::size_t steps = 0;
        for (Id at = i; at != no_id; at = db_.commands[at].base) {
            if (++steps > 1000) {
                declared_.fault(declared_.commands[i], db_.commands[i].path,
                                "the command " + db_.commands[i].name +
                                    " extends itself, or is nested deeper than 1000");
                break;
            }
        }
    }
}

} // namespace fledge::ground::xtce
