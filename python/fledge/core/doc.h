// SPDX-License-Identifier: Apache-2.0
// The texts behind help(), made from the tables.
#pragma once

#include "core/object.h"

namespace fledge::core {

/// "required, > 0", as in the header; "" if there is no rule.
std::string rule_text(const FledgeField &field);

/// Of an attribute: what it is, its unit, shape, rule and meaning.
std::string field_doc(const FledgeField &field);

/// Of a type: a signature, the header's comment, and its inputs, outputs, parameters and memory.
std::string type_doc(const FledgeStruct &table);

} // namespace fledge::core
