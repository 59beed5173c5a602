/* SPDX-License-Identifier: Apache-2.0 */
/* For `fledge profile`, on a machine whose time is that of its instructions (QEMU's -icount): how long each exchange of
 * flight takes, and its initialisation, by the board's clock; and how deep the stack was until the first exchange. The
 * linker calls this in the place of the functions (--wrap). */
#include "targets/bare/bare.h"
#include "targets/bare/port.h"
#include "targets/mission_host.h"

#define EXCHANGE const MissionHost *host, const RegisterWindow *windows, int64_t t, MissionIoCounts *counts

void __real_mission_host_exchange(EXCHANGE);
void __wrap_mission_host_exchange(EXCHANGE);

void __wrap_mission_host_exchange(EXCHANGE)
{
    const int64_t begin = board_time();
    __real_mission_host_exchange(host, windows, t, counts);
    const uint32_t taken = (uint32_t)(board_time() - begin);
    bare_say(t < 0 ? "cycle_first " : "cycle_");
    if (t >= 0) {
        static uint32_t cycle;
        bare_say_number(cycle++);
        bare_say(" ");
    }
    bare_say_number(taken);
    bare_say("\n");
}
