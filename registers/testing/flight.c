/* SPDX-License-Identifier: Apache-2.0 */
/* Flight of machines_test.py, for any machine: attaches to the register file that it is given, and
 * answers each tick. Its exit code names the first failure. */
#include <io_board_a.h>
#include <single_board_computer.h>

#include "registers/shared_file.h"

#define LONG_NS INT64_C(60000000000)

static const RegisterRun nav_attitude[] = {{8u, 1u}, {4u, 2u}, {8u, 6u}};
static const RegisterRun wheel_command[] = {{8u, 1u}, {4u, 2u}, {8u, 8u}};
const RegisterMessage fledge_message_NavAttitude = {"NavAttitude", 64u, 3u, nav_attitude};
const RegisterMessage fledge_message_WheelCommand = {"WheelCommand", 80u, 3u, wheel_command};

static int fly(const RegisterWindow *sbc, const RegisterWindow *ioa, Tick tick)
{
    NavAttitude nav;
    WheelCommand out = {.head = {tick.t + tick.dt, QUALITY_DEGRADED, 7u}};
    RegisterInfo info;
    if (single_board_computer_nav_attitude_take(sbc, &nav, &info) != REGISTER_OK || nav.head.t != tick.t ||
        nav.head.quality != QUALITY_GOOD || info.sequence == 0u) {
        return 2;
    }
    for (uint32_t i = 0u; i < 3u; i++) {
        out.u[i] = nav.sigma_BN.v[i];
        out.u[3u + i] = nav.omega_BN_B.v[i];
    }
    out.u[6] = io_board_a_sun_sensor_current(ioa, 5u);
    /* Jammed at the 5th tick, slewed from the 10th on. */
    const int64_t time = register_slave_time(sbc);
    const uint32_t seconds = register_slave_pulses(sbc, 0);
    out.u[7] = (double)time;
    if (register_handle(sbc, SINGLE_BOARD_COMPUTER_INTERRUPT_SECOND) == 0u || seconds == 0u ||
        (info.sequence == 5u && register_slave_command(sbc, REGISTER_JAM, -INT64_C(5000000000)) != REGISTER_OK) ||
        (info.sequence == 10u && register_slave_command(sbc, REGISTER_SLEW, 777777) != REGISTER_OK)) {
        return 6;
    }
    if (io_board_a_wheel_volts_set_command(ioa, 3u, nav.sigma_BN.v[0]) != 0) {
        return 3;
    }
    return single_board_computer_wheel_command_put(sbc, &out) == REGISTER_OK ? 0 : 4;
}

int main(int argc, char **argv)
{
    const RegisterBoard *boards[2] = {&single_board_computer, &io_board_a};
    RegisterFile file;
    RegisterWindow w[2];
    if (argc != 2 || register_file_attach(&file, argv[1], boards, 2u, w) != REGISTER_FILE_OK) {
        return 1;
    }
    for (;;) {
        Tick tick;
        if (register_clock_due(&w[0], &tick)) {
            const int failed = fly(&w[0], &w[1], tick);
            if (failed) {
                return failed;
            }
            register_clock_finish(&w[0]);
        } else if (register_clock_stopped(&w[0])) {
            register_file_close(&file);
            return 0;
        } else if (register_file_wait(&file, LONG_NS) != REGISTER_FILE_RANG) {
            return 5;
        }
    }
}
