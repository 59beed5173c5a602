/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/vehicle/nvm_share.h"

#include <string.h>

void nvm_share_reset(NvmShare *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

void nvm_share_update(NvmShare *m, Tick t)
{
    const NvmPacket *requests[NVM_CLIENTS] = {&m->in.ask_a, &m->in.ask_b, &m->in.ask_c, &m->in.ask_d};
    NvmPacket *replies[NVM_CLIENTS] = {&m->out.reply_a, &m->out.reply_b, &m->out.reply_c, &m->out.reply_d};
    const NvmPacket *reply = &m->in.reply;
    NvmPacket *request = &m->out.request;
    if (!head_written(reply->head)) {
        request->head = head_held(request->head);
        for (uint32_t i = 0u; i < NVM_CLIENTS; i++) {
            replies[i]->head = head_held(replies[i]->head);
        }
        return;
    }
    if (m->mem.under_way != 0u && reply->number == request->number) {
        NvmPacket *to = replies[m->mem.served];
        const Head head = to->head;
        *to = *reply;
        to->head = head;
        to->number = m->mem.number;
        m->mem.under_way = 0u;
    }
    for (uint32_t i = 1u; i <= NVM_CLIENTS && m->mem.under_way == 0u; i++) {
        const uint32_t next = (m->mem.served + i) % NVM_CLIENTS;
        if (requests[next]->code != NVM_NOTHING && requests[next]->number != replies[next]->number) {
            const uint32_t last = request->code == NVM_NOTHING ? reply->number : request->number;
            const Head head = request->head;
            *request = *requests[next];
            request->head = head;
            request->number = last + 1u;
            m->mem.number = requests[next]->number;
            m->mem.served = next;
            m->mem.under_way = 1u;
        }
    }
    request->head = head_next(request->head, t.t, quality_through(reply->head));
    for (uint32_t i = 0u; i < NVM_CLIENTS; i++) {
        replies[i]->head = head_next(replies[i]->head, t.t, quality_through(reply->head));
    }
}
