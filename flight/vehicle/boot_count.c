/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/vehicle/boot_count.h"

#include <string.h>

void boot_count_reset(BootCount *m)
{
    memset(&m->out, 0, sizeof m->out);
}

void boot_count_update(BootCount *m, Tick t)
{
    const NvmPacket *reply = &m->in.reply;
    NvmPacket *request = &m->out.request;
    BootState *boot = &m->out.boot;
    if (!head_written(reply->head)) {
        request->head = head_held(request->head);
        boot->head = head_held(boot->head);
        return;
    }
    const int answered = reply->number == request->number && reply->refused == 0u;
    if (request->code == NVM_NOTHING) {
        request->code = NVM_RETRIEVE;
        request->number = reply->number + 1u; /* whatever was requested before this start */
        request->slot = m->par.slot;
    } else if (request->code == NVM_RETRIEVE && answered) {
        request->code = NVM_STORE;
        request->number++;
        memcpy(request->data, reply->data, sizeof request->data);
        request->data[0]++;
        boot->boots = request->data[0];
        if (head_written(m->in.interconnect.head) && boot->boots > m->in.interconnect.resets) {
            boot->own = boot->boots - 1u - m->in.interconnect.resets;
        }
    } else if (request->code == NVM_STORE && answered) {
        boot->kept = 1u;
    }
    request->head = head_next(request->head, t.t, QUALITY_GOOD);
    boot->head = head_next(boot->head, t.t, boot->kept != 0u ? QUALITY_GOOD : QUALITY_DEGRADED);
}
