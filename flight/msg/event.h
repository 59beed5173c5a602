/* SPDX-License-Identifier: Apache-2.0 */
/* The message that a module publishes when something happens in it. The events of flight.py are others: conditions of
 * the executive. */
#ifndef FLIGHT_MSG_EVENT_H
#define FLIGHT_MSG_EVENT_H

#include "flight/msg/head.h"

typedef enum EventSeverity { EVENT_INFO = 1, EVENT_LOW = 2, EVENT_MEDIUM = 3, EVENT_HIGH = 4 } EventSeverity;

/** Something has happened: of one instant the gravest event, of equal ones the last. */
typedef struct FlightEvent {
    Head head;
    double arguments[4];    ///< [SI] what they mean stands with the id
    uint32_t id;            ///< [-] which event of the module, by an enumeration in its header
    EventSeverity severity; ///< [-] how grave it is
    uint32_t count;         ///< [-] the module's events so far
    uint32_t spare;
} FlightEvent;

/** Write an event, of which id, severity and arguments are set, to a module's output. */
static inline void event_publish(FlightEvent *output, int64_t t, FlightEvent event)
{
    event.count = output->count + 1u;
    if (event.count > 1u && output->head.t == t && output->severity > event.severity) {
        output->count = event.count;
        return;
    }
    event.head = head_next(output->head, t, QUALITY_GOOD);
    *output = event;
}

#endif
