/* SPDX-License-Identifier: Apache-2.0 */
/* The models' side of machines_test.py: makes the register file of the given name, flies some ticks
 * with the process that attaches, and prints what flight answered, as bits. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <io_board_a.h>
#include <single_board_computer.h>

#include "registers/shared_file.h"
#include "registers/slave_clock.h"

#define LONG_NS INT64_C(60000000000)

static const RegisterRun nav_attitude[] = {{8u, 1u}, {4u, 2u}, {8u, 6u}};
static const RegisterRun wheel_command[] = {{8u, 1u}, {4u, 2u}, {8u, 8u}};
const RegisterMessage fledge_message_NavAttitude = {"NavAttitude", 64u, 3u, nav_attitude};
const RegisterMessage fledge_message_WheelCommand = {"WheelCommand", 80u, 3u, wheel_command};

static uint32_t word_of(const RegisterField *field, double value)
{
    return register_field_place(field, 0u, register_field_quantise(field, value, NULL));
}

static int exchange(RegisterFile *file, const RegisterWindow *sbc, const RegisterWindow *ioa, RegisterSlaveClock *slave,
                    int k)
{
    const RegisterLane *sun = &io_board_a.lanes[IO_BOARD_A_LANE_SUN_SENSOR];
    const RegisterLane *nav = &single_board_computer.lanes[SINGLE_BOARD_COMPUTER_LANE_NAV_ATTITUDE];
    const RegisterLane *command = &single_board_computer.lanes[SINGLE_BOARD_COMPUTER_LANE_WHEEL_COMMAND];
    const Tick tick = {INT64_C(0x0123456789) * k, 1000 + k};
    NavAttitude message = {.head = {tick.t, QUALITY_GOOD, (uint32_t)k}};
    WheelCommand answer;
    RegisterInfo info;
    for (int i = 0; i < 3; i++) {
        message.sigma_BN.v[i] = 0.1 * k / (i + 1);
        message.omega_BN_B.v[i] = -1e-300 / k;
    }
    if (register_put_message(sbc, nav, &fledge_message_NavAttitude, &message) != REGISTER_OK ||
        register_put_word(ioa, sun, 5u, word_of(&sun->fields[0], 0.0005 * k)) != REGISTER_OK) {
        return 2;
    }
    register_slave_show(slave, tick.t);
    register_clock_start(sbc, tick);
    while (!register_clock_is_done(sbc)) {
        if (register_file_wait(file, LONG_NS) != REGISTER_FILE_RANG) {
            return 3;
        }
    }
    register_slave_obey(slave, tick.t);
    if (register_take_message(sbc, command, &fledge_message_WheelCommand, &answer, &info) != REGISTER_OK) {
        return 4;
    }
    printf("%" PRId64 " %d %u", answer.head.t, (int)answer.head.quality, answer.head.sequence);
    for (int i = 0; i < 8; i++) {
        uint64_t bits;
        memcpy(&bits, &answer.u[i], sizeof bits);
        printf(" %016" PRIx64, bits);
    }
    printf(" %08x\n", register_load(ioa, IO_BOARD_A_WHEEL_VOLTS_ADDRESS + 12u));
    return 0;
}

int main(int argc, char **argv)
{
    const RegisterBoard *boards[2] = {&single_board_computer, &io_board_a};
    RegisterFile file;
    RegisterWindow w[2];
    if (argc != 2 || register_file_create(&file, argv[1], boards, 2u, w) != REGISTER_FILE_OK) {
        return 1;
    }
    printf("ready\n");
    fflush(stdout);
    RegisterSlaveClock slave = {.window = &w[0]};
    register_slave_start(&slave);
    for (int k = 1; k <= 20; k++) {
        const int failed = exchange(&file, &w[0], &w[1], &slave, k);
        if (failed) {
            return failed;
        }
    }
    register_clock_stop(&w[0]);
    register_file_close(&file);
    return 0;
}
