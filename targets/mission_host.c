/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/mission_host.h"

#include <string.h>

void mission_host_exchange(const MissionHost *host, const RegisterWindow *w, int64_t t, MissionIoCounts *counts)
{
    if (t < 0) {
        host->reset();
        mission_io_forget(host->io, w);
    } else {
        mission_io_read(host->io, w, host->mission, t, counts);
        host->tick(t);
    }
    mission_io_write(host->io, w, host->mission, counts);
}

McapStatus mission_record_open(MissionRecord *r, const MissionHost *host, McapWrite write, void *user,
                               const char *target)
{
    const McapPair run[] = {{"mission", host->name}, {"target", target}};
    McapConfig config = {.write = write, .user = user};
    config.schemas = host->schemas;
    config.channels = host->channels;
    config.schemas_max = host->n_schemas;
    config.channels_max = host->n_channels;
    r->first = 0u;
    r->open = 0u;
    McapStatus status = mcap_open(&r->writer, &config);
    if (status == MCAP_OK) {
        r->open = 1u;
        status = mcap_metadata(&r->writer, "run", run, 2u);
    }
    for (uint32_t i = 0u; i < host->io->n_messages && status == MCAP_OK; i++) {
        const MissionDefinition *d = &host->definitions[host->topics[i].definition];
        uint16_t schema, channel;
        if (host->io->messages[i].direction == MISSION_IN) {
            continue;
        }
        status = mcap_add_schema(&r->writer, d->name, d->text, &schema);
        if (status == MCAP_OK) {
            status = mcap_add_channel(&r->writer, host->topics[i].topic, schema, MCAP_ORDER_NATIVE, 0, 0u, &channel);
        }
        if (status == MCAP_OK && r->first == 0u) {
            r->first = channel; /* the ids of the other channels follow */
        }
    }
    return status;
}

McapStatus mission_record_take(MissionRecord *r, const MissionHost *host, int64_t t)
{
    uint16_t channel = r->first;
    McapStatus status = MCAP_OK;
    for (uint32_t i = 0u; i < host->io->n_messages && status == MCAP_OK; i++) {
        const MissionMessage *m = &host->io->messages[i];
        if (m->direction != MISSION_IN) {
            Head head;
            const uint8_t *message = (const uint8_t *)host->mission + m->offset;
            memcpy(&head, message, sizeof head);
            status = mcap_message(&r->writer, channel++, t, head.sequence, message, m->size);
        }
    }
    return status;
}

McapStatus mission_record_close(MissionRecord *r)
{
    if (r->open == 0u) {
        return MCAP_CLOSED;
    }
    r->open = 0u;
    return mcap_close(&r->writer);
}
