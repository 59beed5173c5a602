// SPDX-License-Identifier: Apache-2.0
#include "sim/parameters.h"

#include "sim/model.h"

#include <cstring>

namespace fledge::sim {

/// They lie together in the memory.
Parameters::Parameters(Instance &of, RunProcess &by) : instance(&of), process(&by)
{
    for (const FledgeField &field : fields(of.type())) {
        if (field.group == FLEDGE_PAR) {
            now = {now.empty() ? of.memory() + field.offset : now.data(), now.size() + field.size};
        }
    }
    see();
}

bool Parameters::changed() const
{
    return !now.empty() && std::memcmp(now.data(), seen.data(), now.size()) != 0;
}

void Parameters::see()
{
    seen.assign(now.begin(), now.end());
}

std::vector<const FledgeField *> Parameters::differing() const
{
    std::vector<const FledgeField *> changed;
    for (const FledgeField &field : fields(instance->type())) {
        const std::byte *at = instance->memory() + field.offset;
        if (field.group == FLEDGE_PAR && std::memcmp(at, seen.data() + (at - now.data()), field.size)) {
            changed.push_back(&field);
        }
    }
    return changed;
}

void Parameters::refresh() const
{
    if (instance->model() && changed()) {
        instance->model()->refresh();
    }
}

} // namespace fledge::sim
