/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/telemetry/telemetry.h"

void telemetry_services(const TelemetryTable *table, const CommandContext *context, CommandSink report,
                        TelemetrySink sink, void *user)
{
    const CommandServices *services = context->table->services;
    for (uint32_t i = 0u; i < services->n; i++) {
        const CommandService *service = services->list[i];
        void *module = services->module(context->mission, i);
        CommandReport done = {context->t, 0u, 0u, COMMAND_DONE, COMMAND_OK, 0u, 0u, 0u, 0u};
        uint32_t n;
        while (service->report != NULL && service->report(context, module, &done)) {
            command_report(context->state, &done, table->packet, report, user); /* it has no data */
            done = (CommandReport){context->t, 0u, 0u, COMMAND_DONE, COMMAND_OK, 0u, 0u, 0u, 0u};
        }
        while (service->telemetry != NULL &&
               (n = service->telemetry(context, module, table->packet + TELEMETRY_HEADER)) != 0u) {
            telemetry_packet(table, 3u + table->n_outputs + (uint32_t)service->stream, n, context->t, sink, user);
        }
    }
}
