/* SPDX-License-Identifier: Apache-2.0 */
/* The reports of the executive of a process: the mode in force, the events that fired, what became of commands,
 * and resets of the computer. The desktop and every target write these messages into their records by the functions
 * below, so that both can be compared. */
#ifndef FLIGHT_COMMAND_ACTIVITY_H
#define FLIGHT_COMMAND_ACTIVITY_H

#include "flight/command/command.h"
#include "flight/msg/head.h"

/** The mode of a process. It is written when a mode begins. */
typedef struct ProcessMode {
    Head head;
    uint32_t index; ///< [-] in the order of declaration
    char name[44];  ///< of the mode
} ProcessMode;

typedef enum ActivityKind {
    ACTIVITY_NONE = 0,
    ACTIVITY_EVENT = 1,    ///< an event fired
    ACTIVITY_ACCEPTED = 2, ///< a command arrived, and was accepted or refused
    ACTIVITY_EXECUTED = 3, ///< a command was executed, or refused at its execution
    ACTIVITY_RESET = 4     ///< the computer began anew after a reset
} ActivityKind;

/** Something that happened in a process. */
typedef struct Activity {
    Head head;
    ActivityKind kind;
    uint32_t index;       ///< [-] of an event, in the order of declaration; the sequence of a command; how many resets
    CommandCode code;     ///< of a command: its function
    CommandReason reason; ///< of a command: why it was refused; of an event: GUARDED: it did not enter its mode
    char name[32];        ///< of an event
    char cause[88];       ///< of an event: its condition
} Activity;

/** A text that fits; the rest of the array is zero. */
static inline void activity_text(char *to, uint32_t room, const char *text)
{
    uint32_t i = 0u;
    for (; i + 1u < room && text[i] != '\0'; i++) {
        to[i] = text[i];
    }
    for (; i < room; i++) {
        to[i] = '\0';
    }
}

/** Whether a mode is another one than that of the last message. */
static inline int activity_mode_began(const ProcessMode *last, uint32_t index)
{
    return !head_written(last->head) || last->index != index;
}

/** A mode began at t. */
static inline void activity_mode(ProcessMode *m, int64_t t, uint32_t index, const char *name)
{
    m->head = head_next(m->head, t, QUALITY_GOOD);
    m->index = index;
    activity_text(m->name, sizeof m->name, name);
}

/** Something happened at t that has neither a command nor a text. */
static inline void activity_begin(Activity *a, int64_t t, ActivityKind kind, uint32_t index)
{
    a->head = head_next(a->head, t, QUALITY_GOOD);
    a->kind = kind;
    a->index = index;
    a->code = COMMAND_NOOP;
    a->reason = COMMAND_OK;
    activity_text(a->name, sizeof a->name, "");
    activity_text(a->cause, sizeof a->cause, "");
}

/** An event fired at t. refused: the condition of the mode that it enters did not hold. */
static inline void activity_event(Activity *a, int64_t t, uint32_t index, const char *name, const char *cause,
                                  int refused)
{
    activity_begin(a, t, ACTIVITY_EVENT, index);
    a->reason = refused ? COMMAND_GUARDED : COMMAND_OK;
    activity_text(a->name, sizeof a->name, name);
    activity_text(a->cause, sizeof a->cause, cause);
}

/** What became of a command. */
static inline void activity_command(Activity *a, const CommandReport *report)
{
    activity_begin(a, report->t < 0 ? 0 : report->t, report->executed != 0u ? ACTIVITY_EXECUTED : ACTIVITY_ACCEPTED,
                   report->sequence);
    a->code = (CommandCode)report->code;
    a->reason = (CommandReason)report->reason;
}

/** The computer began anew at t, for the count-th time. */
static inline void activity_reset(Activity *a, int64_t t, uint32_t count)
{
    activity_begin(a, t, ACTIVITY_RESET, count);
}

#endif
