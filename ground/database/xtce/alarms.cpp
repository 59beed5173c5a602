// SPDX-License-Identifier: Apache-2.0
#include "ground/database/xtce/readers.h"

#include <limits>

namespace fledge::ground::xtce {

namespace {

Concern concern(Node node, View name)
{
    constexpr View levels[] = {"normal", "watch", "warning", "distress", "critical", "severe"};
    const auto found = std::find(std::begin(levels), std::end(levels), name);
    return found != std::end(levels) ? static_cast<Concern>(found - std::begin(levels))
                                     : refuse_as<Concern>(node, std::string(name) + " is no level of an alarm");
}

} // namespace

Range range(Node node)
{
    const auto end = [&](const char *name, Number &to) {
        if (const auto found = node.attribute(name)) {
            to = any_number(node, found.value());
        }
    };
    Range result;
    result.low_open = !!node.attribute("minExclusive");
    result.high_open = !!node.attribute("maxExclusive");
    end(result.low_open ? "minExclusive" : "minInclusive", result.low);
    end(result.high_open ? "maxExclusive" : "maxInclusive", result.high);
    result.calibrated = is_true(node, "rangeAppliesToCalibrated", is_true(node, "validRangeAppliesToCalibrated", true));
    return result;
}

Alarm AlarmReader::alarm(Node node)
{
    Alarm result;
    result.violations = count(node, node.attribute("minViolations").as_string("1"), 1, 1 << 30);
    result.otherwise = concern(node, node.attribute("defaultAlarmLevel").as_string("normal"));
    for (Node child : elements(node)) {
        const View name = tag(child);
        if (name == "ContextMatch") {
            result.when = values_.condition(child);
        } else if (one_of(name, {"StaticAlarmRanges", "ChangeAlarmRanges"})) {
            result.on_change = name == "ChangeAlarmRanges";
            const bool inside = child.attribute("rangeForm").as_string() == View("inside");
            for (Node item : elements(child)) {
                std::string level(tag(item).substr(0, tag(item).find("Range")));
                std::transform(level.begin(), level.end(), level.begin(), [](char c) { return c | 0x20; });
                result.limits.push_back({concern(item, level), range(item), inside});
            }
        } else if (name == "AlarmMultiRanges") {
            for (Node item : elements(child)) {
                result.limits.push_back({concern(item, item.attribute("level").as_string("normal")), range(item),
                                         item.attribute("rangeForm").as_string("outside") == View("inside")});
            }
        } else if (one_of(name, {"EnumerationAlarmList", "StringAlarmList"})) {
            for (Node item : elements(child)) {
                result.labels.emplace_back(
                    needed(item, name == "StringAlarmList" ? "matchPattern" : "enumerationLabel"),
                    concern(item, needed(item, "alarmLevel")));
            }
        } else if (one_of(name, {"AlarmConditions", "CustomAlarm", "ChangePerSecondAlarmRanges"})) {
            declared_.note(child, std::string(name) + " is not computed");
        } else if (!is_common(child)) {
            refuse_element(child);
        }
    }
    return result;
}

} // namespace fledge::ground::xtce
