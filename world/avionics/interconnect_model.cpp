// SPDX-License-Identifier: Apache-2.0
#include "world/avionics/interconnect_model.h"

#include <algorithm>

namespace fledge::world {

void InterconnectModel::prepare(const sim::Setup &) {}

void InterconnectModel::reset(sim::Ns)
{
    interface_.out = {};
    interface_.mem = {};
}

void InterconnectModel::update(Tick tick)
{
    const NvmPacket &request = interface_.in.request;
    auto &[reply, state] = interface_.out;
    if (request.code != NVM_NOTHING && request.number != reply.number) {
        const Head head = reply.head;
        reply = request;
        reply.head = head;
        reply.refused =
            request.slot >= interface_.par.slots || (request.code != NVM_STORE && request.code != NVM_RETRIEVE);
        auto &slot = interface_.mem.memory[reply.refused ? 0 : request.slot];
        if (reply.refused) {
            state.refused++;
        } else if (request.code == NVM_STORE) {
            std::copy(std::begin(request.data), std::end(request.data), slot);
            state.stored++;
        } else {
            std::copy(std::begin(slot), std::end(slot), reply.data);
            state.retrieved++;
        }
    }
    reply.head = head_next(reply.head, tick.t, QUALITY_GOOD);
    state.resets = interface_.in.computer.count;
    state.head = head_next(state.head, tick.t, QUALITY_GOOD);
}

} // namespace fledge::world
