// SPDX-License-Identifier: Apache-2.0
#include "cosim/controller/topic_map.h"

#include <set>

namespace fledge::cosim {

std::string TopicMap::to_run(const std::string &topic) const
{
    const auto found = topics.find(topic);
    if (found != topics.end()) {
        return found->second;
    }
    return prefix.empty() ? topic : "/" + prefix + topic;
}

std::optional<std::string> TopicMap::to_node(const std::string &topic) const
{
    for (const auto &[ours, of_run] : topics) {
        if (of_run == topic) {
            return ours;
        }
    }
    const std::string start = prefix.empty() ? "" : "/" + prefix;
    if (!topic.starts_with(start + "/")) {
        return std::nullopt;
    }
    const std::string ours = topic.substr(start.size());
    return topics.contains(ours) ? std::nullopt : std::optional(ours);
}

std::string TopicMap::fault() const
{
    std::set<std::string> seen;
    for (const auto &[ours, of_run] : topics) {
        if (!ours.starts_with("/") || !of_run.starts_with("/")) {
            return "its topics begin with a slash; found " + ours + " as " + of_run;
        }
        if (!seen.insert(of_run).second) {
            return "two of its topics become " + of_run;
        }
    }
    return "";
}

} // namespace fledge::cosim
