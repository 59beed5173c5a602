// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/units.h. All of its state is in the interface.
#pragma once

#include "sim/model.h"
#include "world/units.h"

namespace flatsat {

class UnitsModel final : public fledge::sim::Model {
public:
    explicit UnitsModel(Units &interface) : interface_(interface) {}

    void prepare(const fledge::sim::Setup &) override {}
    void reset(fledge::sim::Ns t) override;
    void update(Tick tick) override;

private:
    Units &interface_;
};

} // namespace flatsat
