/* SPDX-License-Identifier: Apache-2.0 */
/* Flies a mission by lines of its standard input, without registers:
 *
 *     c HEX     a packet of a command arrives
 *     t NS      an instant of flight; afterwards "m CRC", of the mission's memory, and "a USED PEAK", of the heap of
 *               the script
 *     r NS      the computer is reset
 *
 * Each packet of telemetry is a line "p HEX". A line "." ends the answer. */
#include "targets/micropython/arena.h"
#include "targets/micropython/executive.h"
#include "targets/mission_host.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const MissionHost *const host = &fledge_mission;

static void print_packet(void *user, const uint8_t *packet, uint32_t n)
{
    (void)user;
    fputs("p ", stdout);
    for (uint32_t i = 0u; i < n; i++) {
        printf("%02x", packet[i]);
    }
    puts("");
}

static void print_report(void *user, const CommandReport *report, const uint8_t *data)
{
    telemetry_report(host->telemetry, report, data, print_packet, user);
}

static void begin(int64_t t)
{
    host->init();
    host->restart(t);
    command_begin(host->state);
    telemetry_begin(host->telemetry);
}

static void accept_packet(const char *digits)
{
    uint8_t packet[COMMAND_MAX + 1];
    uint32_t n = 0u;
    unsigned byte;
    while (n < sizeof packet && sscanf(digits + 2u * n, "%2x", &byte) == 1) {
        packet[n++] = (uint8_t)byte;
    }
    (void)command_accept(host->state, host->commands, &host->state->ground, packet, n, print_report, NULL);
}

static void fly(int64_t t)
{
    command_execute(host->state, host->commands, host->mission, t, print_report, NULL);
    host->tick(t);
    telemetry_send(host->telemetry, host->mission, t, host->state, print_packet, NULL);
    if (host->commands->services != NULL) {
        const CommandContext context = {host->state, host->commands, host->mission, t, 0u};
        host->commands->services->telemetry(host->telemetry, &context, print_report, print_packet, NULL);
    }
    printf("m %04x\na %zu %zu\n", command_crc(host->mission, fledge_script.size), arena_in_use->used,
           arena_in_use->peak);
}

int main(void)
{
    static char line[2 * COMMAND_MAX + 16];
    begin(0);
    while (fgets(line, sizeof line, stdin) != NULL) {
        switch (line[0]) {
        case 'c': accept_packet(line + 2); break;
        case 't': fly(strtoll(line + 2, NULL, 10)); break;
        default: begin(strtoll(line + 2, NULL, 10));
        }
        puts(".");
        fflush(stdout);
    }
    return 0;
}
