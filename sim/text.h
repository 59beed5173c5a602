// SPDX-License-Identifier: Apache-2.0
// Words for messages to people.
#pragma once

#include "sim/integrator.h"
#include "sim/table.h"

#include <string>
#include <vector>

namespace fledge::sim {

/// Shortest text that reads back to the same number: "0.3", "-1e-05".
std::string format_number(double x);

/// "12.5 s" for 12'500'000'000.
std::string format_time(Ns t);

/// "a, b and c"; "(none)" if there are none.
std::string format_list(const std::vector<std::string> &names);

/// "in [0, 10]", "> 0"; "" without bounds.
std::string bounds_text(const FledgeField &field);

/// The index of a flat element in the shape of its field, its leading `dims`: "[2, 0]".
std::string index_text(const FledgeField &field, std::size_t element, std::uint32_t dims = FLEDGE_DIMS_MAX);

} // namespace fledge::sim
