// SPDX-License-Identifier: Apache-2.0
#include "world/sensors/fault_panel_model.h"

#include <algorithm>

namespace fledge::world {

void FaultPanelModel::update(Tick tick)
{
    FaultSet &out = interface_.out.set;
    out.head = head_next(out.head, tick.t, QUALITY_GOOD);
    out.n = interface_.par.n_faults;
    std::copy_n(interface_.par.faults, out.n, out.list);
}

} // namespace fledge::world
