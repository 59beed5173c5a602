/* SPDX-License-Identifier: Apache-2.0 */
#include "ccsds/cop1.h"

#include <string.h>

int farm_begin(Farm *farm, uint8_t window)
{
    memset(farm, 0, sizeof *farm);
    farm->state = FARM_OPEN;
    farm->window = window;
    return window >= 2u && window <= 254u && window % 2u == 0u;
}

/* The events E1 to E5 of 232.1-B-2, table 6-1: a frame of type AD. */
static int in_sequence(Farm *farm, uint8_t number, int room)
{
    const uint32_t ahead = (uint32_t)(number - farm->next) & 0xFFu, half = farm->window / 2u;
    if (farm->state == (uint8_t)FARM_LOCKOUT) {
        return 0;
    }
    if (ahead == 0u) {
        if (farm->state == (uint8_t)FARM_WAIT) {
            return 0;
        }
        if (!room) {
            farm->retransmit = farm->wait = 1u;
            farm->state = FARM_WAIT;
            return 0;
        }
        farm->next++;
        farm->retransmit = 0u;
        return 1;
    }
    if (ahead < half) {
        farm->retransmit = 1u;
    } else if (ahead < 256u - half) {
        farm->state = FARM_LOCKOUT;
    } /* else behind: it came before */
    return 0;
}

/* E7 and E8. */
static void control(Farm *farm, const TcFrame *frame)
{
    if (frame->control == (uint8_t)TC_UNLOCK) {
        farm->state = FARM_OPEN;
        farm->retransmit = farm->wait = 0u;
    } else if (farm->state != (uint8_t)FARM_LOCKOUT) {
        farm->state = FARM_OPEN;
        farm->retransmit = farm->wait = 0u;
        farm->next = frame->value;
    }
}

int farm_frame(Farm *farm, const TcFrame *frame, int room)
{
    int accepted = 1;
    if (frame->type == (uint8_t)TC_AD) {
        accepted = in_sequence(farm, frame->number, room);
    } else {
        farm->bypasses++;
        if (frame->type == (uint8_t)TC_BC) {
            control(farm, frame);
        }
    }
    farm->accepted += accepted != 0;
    farm->discarded += accepted == 0;
    return accepted;
}

void farm_room(Farm *farm)
{
    farm->wait = 0u;
    if (farm->state == (uint8_t)FARM_WAIT) {
        farm->state = FARM_OPEN;
    }
}

Clcw farm_clcw(const Farm *farm, uint8_t virtual_channel)
{
    const Clcw clcw = {virtual_channel,
                       0u,
                       0u,
                       farm->state == (uint8_t)FARM_LOCKOUT,
                       farm->wait,
                       farm->retransmit,
                       (uint8_t)(farm->bypasses & 3u),
                       farm->next};
    return clcw;
}
