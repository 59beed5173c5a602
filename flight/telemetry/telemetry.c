/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/telemetry/telemetry.h"

#include "ccsds/space_packet.h"

#include <stddef.h>
#include <string.h>

enum { HOUSEKEEPING = 0, REPORTS = 1, OUTPUTS = 2 };

static const ExecRun housekeeping[] = {{8u, 1u}, {4u, 5u + (uint32_t)COMMAND_REASONS}, {2u, 2u}},
                     report[] = {{8u, 1u}, {2u, 8u}}, text[] = {{8u, 1u}, {2u, 4u}, {4u, 2u}};

/* Between the order of this machine and big-endian: the n bytes of a content in table->packet. Those read back, which
 * are big-endian, and letters follow the numbers. The content from services is big-endian already. */
static void swap(const TelemetryTable *table, uint32_t stream, uint32_t n)
{
    uint8_t *content = table->packet + TELEMETRY_HEADER;
    if (stream == (uint32_t)HOUSEKEEPING) {
        exec_big_endian(housekeeping, 3u, content, 0u, n);
    } else if (stream == (uint32_t)REPORTS) {
        exec_big_endian(report, 2u, content, 0u, n);
    } else if (stream < (uint32_t)OUTPUTS + table->n_outputs) {
        const TelemetryOutput *output = &table->outputs[stream - (uint32_t)OUTPUTS];
        exec_big_endian(output->runs, output->n_runs, content, 0u, n);
    } else if (stream == (uint32_t)OUTPUTS + table->n_outputs) {
        exec_big_endian(text, 3u, content, 0u, n);
    }
}

void telemetry_native(const TelemetryTable *table, const uint8_t *packet)
{
    swap(table, (uint32_t)ccsds_get16(packet) - table->stream,
         (uint32_t)ccsds_get16(packet + 4) + 7u - (uint32_t)TELEMETRY_HEADER);
}

void telemetry_packet(const TelemetryTable *table, uint32_t stream, uint32_t n, int64_t t, TelemetrySink sink,
                      void *user)
{
    uint8_t *p = table->packet;
    const SpacePacket head = {(uint32_t)TELEMETRY_HEADER + n,
                              (table->stream + stream) & 0x7FFu,
                              table->rates[stream].sequence++ & 0x3FFFu,
                              0u,
                              1u,
                              SPACE_PACKET_WHOLE};
    const uint64_t time = t < 0 ? 0u : (uint64_t)t;
    const uint64_t seconds = time / 1000000000u, part = ((time % 1000000000u) << 16) / 1000000000u;
    memset(p, 0, TELEMETRY_HEADER);
    space_packet_write(&head, p);
    ccsds_put32(p + SPACE_PACKET_HEADER, (uint32_t)seconds);
    ccsds_put16(p + SPACE_PACKET_HEADER + 4, (uint32_t)part);
    swap(table, stream, n);
    sink(user, p, (uint32_t)TELEMETRY_HEADER + n);
}

/* Count a writing; returns 1 if it is to be sent. */
static int is_due(TelemetryRate *rate)
{
    if (rate->on == 0u || ++rate->writings < rate->every) {
        return 0;
    }
    rate->writings = 0u;
    return 1;
}

void telemetry_begin(const TelemetryTable *table)
{
    memset(table->rates, 0, ((size_t)OUTPUTS + table->n_outputs + 1u + COMMAND_STREAMS) * sizeof *table->rates);
}

void telemetry_rate(const TelemetryTable *table, uint16_t output, int on, uint16_t every)
{
    for (uint32_t i = 0u; i <= table->n_outputs; i++) {
        if (output == i || output == COMMAND_ALL) {
            TelemetryRate *rate = &table->rates[i < table->n_outputs ? (uint32_t)OUTPUTS + i : (uint32_t)HOUSEKEEPING];
            rate->on = on != 0;
            rate->every = every;
            rate->writings = 0u;
        }
    }
}

static void send_texts(const TelemetryTable *table, int64_t t, TelemetrySink sink, void *user)
{
    uint32_t n;
    for (uint32_t at = 0u; at < table->texts->used; at += n) {
        TelemetryText head;
        memcpy(&head, table->texts->memory + at, sizeof head);
        n = (uint32_t)sizeof head + head.n;
        memcpy(table->packet + TELEMETRY_HEADER, table->texts->memory + at, n);
        telemetry_packet(table, (uint32_t)OUTPUTS + table->n_outputs, n, t, sink, user);
    }
    table->texts->used = 0u;
}

void telemetry_repeat(const TelemetryTable *table)
{
    for (uint32_t i = 0u; i < table->n_outputs; i++) {
        TelemetryRate *rate = &table->rates[(uint32_t)OUTPUTS + i];
        if (rate->on != 0u && rate->sequence == rate->repeated) {
            rate->seen = 0u;
            rate->writings = (uint16_t)(rate->every - 1u);
        }
        rate->repeated = rate->sequence;
    }
}

void telemetry_send(const TelemetryTable *table, const void *mission, int64_t t, const CommandState *commands,
                    TelemetrySink sink, void *user)
{
    /*@ loop unroll 256; */
    for (uint32_t i = 0u; i < table->n_outputs; i++) {
        const TelemetryOutput *output = &table->outputs[i];
        const uint8_t *message = (const uint8_t *)mission + output->offset;
        TelemetryRate *rate = &table->rates[(uint32_t)OUTPUTS + i];
        Head head;
        memcpy(&head, message, sizeof head);
        const int written = head.sequence != rate->seen;
        rate->seen = head.sequence;
        if (written && is_due(rate)) {
            memcpy(table->packet + TELEMETRY_HEADER, message, output->size);
            telemetry_packet(table, (uint32_t)OUTPUTS + i, output->size, t, sink, user);
        }
    }
    if (is_due(&table->rates[HOUSEKEEPING])) {
        TelemetryHousekeeping h = {t, table->mode(mission), commands->staging, commands->counters, commands->ground,
                                   0u};
        const uint32_t n = (uint32_t)offsetof(TelemetryHousekeeping, ground) + (uint32_t)sizeof h.ground;
        memcpy(table->packet + TELEMETRY_HEADER, &h, n); /* without the bytes that a compiler may put behind it */
        telemetry_packet(table, HOUSEKEEPING, n, t, sink, user);
    }
    if (table->texts != NULL) {
        send_texts(table, t, sink, user);
    }
}

void telemetry_text(TelemetryTexts *texts, int64_t t, TelemetryTextKind kind, uint16_t sequence, uint32_t line,
                    const char *text)
{
    uint32_t n = 0u;
    while (n < (uint32_t)COMMAND_DATA_MAX && text[n] != '\0') {
        n++;
    }
    const TelemetryText head = {t,           (uint16_t)kind, sequence, (uint16_t)(line <= 0xFFFFu ? line : 0xFFFFu),
                                (uint16_t)n, texts->lost,    0u};
    if (sizeof head + n > texts->room - texts->used) {
        texts->lost++;
        return;
    }
    memcpy(texts->memory + texts->used, &head, sizeof head);
    memcpy(texts->memory + texts->used + sizeof head, text, n);
    texts->used += (uint32_t)(sizeof head + n);
    texts->lost = 0u;
}

void telemetry_report(const TelemetryTable *table, const CommandReport *done, const uint8_t *data, TelemetrySink sink,
                      void *user)
{
    memcpy(table->packet + TELEMETRY_HEADER, done, sizeof *done);
    if (done->n > 0u) { /* else there may be no data */
        memcpy(table->packet + TELEMETRY_HEADER + sizeof *done, data, done->n);
    }
    telemetry_packet(table, REPORTS, (uint32_t)sizeof *done + done->n, done->t, sink, user);
}
