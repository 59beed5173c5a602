/* SPDX-License-Identifier: Apache-2.0 */
/* The outside of a program that flies by the machine's clock: it makes the register file, passes packets of commands
 * from standard input to flight, and flight's packets to standard output, each as a line in hexadecimal. At the end of
 * the input it ends flight's run, and itself when flight has gone. `fledge console` starts it. */
#include "registers/clock.h"
#include "registers/shared_file.h"
#include "targets/mission_host.h"

#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

enum { LINE_MAX_BYTES = 2 * COMMAND_MAX + 2, PATIENCE = 500 /* turns */, TURN_MS = 20 };

static RegisterFile file;
static RegisterWindow windows[MISSION_BOARDS_MAX];
static MissionIoCounts counts;

static int complain(const char *message)
{
    (void)fprintf(stderr, "relay: %s\n", message);
    return 1;
}

static uint8_t nibble(char digit)
{
    return (uint8_t)(digit <= '9' ? digit - '0' : digit - 'a' + 10);
}

/* A line without its end: digits in pairs, as Python writes them. */
static int pass_command(const char *line, uint32_t n)
{
    uint8_t packet[COMMAND_MAX];
    if (n % 2u != 0u || n / 2u > sizeof packet || strspn(line, "0123456789abcdef") != n) {
        return complain("a line is no packet");
    }
    for (uint32_t i = 0u; i < n / 2u; i++) {
        packet[i] = (uint8_t)(nibble(line[2u * i]) << 4 | nibble(line[2u * i + 1u]));
    }
    const MissionIo *io = fledge_mission.io;
    return mission_io_send(io, windows, io->commands, packet, n / 2u, &counts)
               ? 0
               : complain("the queue of commands is full");
}

static void pass_telemetry(void)
{
    static uint8_t packet[65536];
    const MissionIo *io = fledge_mission.io;
    uint32_t n;
    while ((n = mission_io_receive(io, windows, io->telemetry, packet, sizeof packet, &counts)) != 0u) {
        for (uint32_t i = 0u; i < n; i++) {
            printf("%02x", packet[i]);
        }
        puts("");
    }
    (void)fflush(stdout);
}

/* Pass the lines that have come. Returns 0 at the end of the input. */
static int pass_commands(void)
{
    static char line[LINE_MAX_BYTES];
    static uint32_t n;
    char bytes[4096];
    const ssize_t got = read(STDIN_FILENO, bytes, sizeof bytes);
    for (ssize_t i = 0; i < got; i++) {
        if (bytes[i] != '\n') {
            line[n] = bytes[i];
            n += n + 1u < sizeof line ? 1u : 0u;
            continue;
        }
        line[n] = '\0';
        (void)pass_command(line, n);
        n = 0u;
    }
    return got > 0;
}

int main(int argc, char **argv)
{
    const MissionIo *io = fledge_mission.io;
    if (argc != 2) {
        return complain("usage: relay REGISTERS");
    }
    if (io->n_boards > MISSION_BOARDS_MAX ||
        register_file_create(&file, argv[1], io->boards, io->n_boards, windows) != REGISTER_FILE_OK) {
        return complain("the register file cannot be made");
    }
    const RegisterWindow *clock = &windows[mission_io_clock(io)];
    int attached = 0, open = 1, turns = 0;
    while (attached ? register_file_peer_lives(&file) : turns++ < PATIENCE) {
        attached = attached || register_file_peer_lives(&file);
        struct pollfd input = {.fd = attached && open ? STDIN_FILENO : -1, .events = POLLIN};
        if (poll(&input, 1, TURN_MS) > 0 && !pass_commands()) {
            open = 0;
            register_clock_stop(clock);
        }
        pass_telemetry();
    }
    pass_telemetry();
    register_file_close(&file);
    return attached ? 0 : complain("flight has not come");
}
