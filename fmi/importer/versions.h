// SPDX-License-Identifier: Apache-2.0
// An instance of each version of the standard. Private to the importer.
#pragma once

#include "fmi/importer/fmu.h"

namespace fledge::importer {

std::unique_ptr<Fmu> make_fmu2(const FmuFile &file, const std::string &name);
std::unique_ptr<Fmu> make_fmu3(const FmuFile &file, const std::string &name);

} // namespace fledge::importer
