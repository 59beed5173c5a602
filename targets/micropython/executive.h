/* SPDX-License-Identifier: Apache-2.0 */
/* The executive of a mission whose script composes it at run time: tasks, wires, modes and events as data, run by the
 * rules of flight/exec, in the order of the exported C (python/fledge/export/c_run.py). It is the mission of
 * targets/mission_host.h where MicroPython flies. The script's objects hold the records below; the executive links
 * them, and allocates only one table of the modules. */
#ifndef TARGETS_MICROPYTHON_EXECUTIVE_H
#define TARGETS_MICROPYTHON_EXECUTIVE_H

#include "flight/exec/condition.h"
#include "flight/exec/message.h"
#include "flight/exec/task.h"
#include "flight/telemetry/telemetry.h"
#include "targets/micropython/tables.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Start the interpreter, run the script, check its composition, lock the arena, begin at 0. Again after a reset of
 *  the computer: the arena begins anew. A script that fails leaves a mission without tasks; executive_failure() has
 *  the reason. A text of telemetry names each module whose parameters are not those of the desktop. */
void executive_init(void);

/** NULL, or why the script did not compose the mission: "flight.py, line 12: ..." */
const char *executive_failure(void);

/** After executive_init: begin in another mode than the script's at the next restart. */
void executive_start_in(uint16_t mode);

/** The functions of targets/mission_host.h and flight/command/command.h. */
void executive_restart(int64_t t);
int64_t executive_next(void);
void executive_tick(int64_t t);
void executive_enter(uint16_t mode);
int executive_may_enter(uint16_t mode);
uint16_t executive_mode(void);
void executive_publish(uint16_t block, int64_t t);
void executive_arm(uint16_t event, int on);
const ExecEvent *executive_event(uint16_t event);
void *executive_parameters(uint16_t block);

/** Print the composition of the script, a line at a time. Names are without "flight."; those of one kind come in the
 *  order of flight.py, except where noted:
 *
 *     module NAME TYPE              of each module, and then its memory after the reset at 0:
 *     python NAME                   its update is the script's
 *     bytes NAME OFFSET HEX         at most 32 bytes as they lie in memory, unless all are zero
 *     differs NAME                  its parameters are not those of the desktop (ScriptPlace.crc)
 *     wire A.OUTPUT B.INPUT AGE     [ns] within the process, with stale_after; by modules. Of several into one input
 *                                   "newest", "first", "best" or "in MODE" follows, and how many came before
 *     task NAME PERIOD OFFSET PRIORITY      [ns]; in the order of equal times
 *     runs TASK MODULE
 *     mode NAME
 *     activates MODE TASK
 *     follows MODE MODE             the first is entered only in the second, or others of its lines; none: in all
 *     guards MODE PART              the condition on which it is entered, as `when`
 *     start MODE                    the mode to begin in
 *     event NAME HOLD COUNT ONCE ARMED      [ns], whole number, 1 or 0, 1 or 0
 *     looks EVENT MODE              a mode in which it is checked; none: in all
 *     enters EVENT MODE
 *     arms EVENT EVENT, disarms EVENT EVENT
 *     sets EVENT MODULE+OFFSET HEX  at most 32 bytes
 *     when EVENT PART, until EVENT PART     the parts of its conditions in postfix order: & or | or ~ or
 *                                   OPERAND RELATION OPERAND. An operand is MODULE+OFFSET:MEASURE, as in
 *                                   control+96:norm, a double by its bits, 0x3ff0000000000000, or in decimal a whole
 *                                   number that no double represents
 *     reset MODULE+OFFSET DOWN      [ns] the input that resets the computer
 *     heap USED PEAK SIZE           [bytes] of the arena */
void executive_describe(void (*line)(const char *text));

/** [ns] A monotonic clock of the host for measurements; NULL: none. */
extern int64_t (*executive_clock)(void);

/** Print the actions of the script until now, a line at a time. */
void executive_figures(void (*line)(const char *text));

/** Texts that wait for the end of the instant. */
extern TelemetryTexts executive_texts;

/* --- the composition of a script ------------------------------------------------------------------- */

/* Zeroed before it is filled. Names are texts that stay. Offsets are in the mission's memory. */

typedef struct ExecutiveWire {
    struct ExecutiveWire *next;
    uint32_t from, to;   ///< [bytes]
    uint32_t size;       ///< [bytes]
    int64_t stale_after; ///< [ns]; 0: never, as of configuration
    const char *mode;    ///< EXEC_IN_MODE: it is carried in this one, perhaps one that comes later
    uint8_t by;          ///< ExecChoice, of several into one input
    uint8_t before;      ///< how many of them are carried before this one
} ExecutiveWire;

/** The functions of a place. When it is named, they are those of its type; a script's own replace them. */
typedef struct ExecutiveModule {
    void (*reset)(void *self);
    void (*update)(void *self, Tick t);
    void *self;           ///< of the two: the module's memory, or the script's object
    ExecutiveWire *wires; ///< carried before its update, of configuration after it
    uint8_t named;        ///< 1: the script has created it
    uint8_t scheduled;    ///< 1: it runs in a task; 0: it is configuration
    uint8_t changed;      ///< 1: configuration to publish at the next instant
    uint8_t differs;      ///< 1: its parameters are not those of the desktop
} ExecutiveModule;

typedef struct ExecutiveTask {
    struct ExecutiveTask *next; ///< in the order of equal times
    const char *name;
    ExecRate rate;
    ExecTask state;
    int32_t priority;
    uint8_t named; ///< 1: some mode names it, so that it does not run in all
    uint16_t n;
    const uint16_t *run; ///< places, in order
} ExecutiveTask;

/** A number of a field, or a constant. */
typedef struct ExecutiveOperand {
    union {
        double real;
        int64_t whole;
        struct {
            uint32_t offset, elements;
        } field;
    } of;
    uint8_t constant; ///< 1: `of` is its value
    uint8_t type;     ///< FledgeType; of a constant FLEDGE_F64, or FLEDGE_I64 if no double represents it
    uint8_t measure;  ///< ExecMeasure
} ExecutiveOperand;

typedef struct ExecutiveCondition {
    uint8_t join;     ///< ExecJoin; EXEC_COMPARE: left relation right
    uint8_t relation; ///< ExecRelation
    uint8_t depth;    ///< how many results wait at most; up to EXEC_DEPTH
    union {
        ExecutiveOperand operands[2];
        const struct ExecutiveCondition *parts[2]; ///< one for EXEC_INVERSE
    } of;
} ExecutiveCondition;

typedef struct ExecutiveMode {
    struct ExecutiveMode *next;
    const char *name;
    uint16_t n, n_after;
    ExecutiveTask **tasks;
    const char **after;             ///< the modes in which alone it is entered, perhaps ones that come later; none: all
    const ExecutiveCondition *when; ///< on which it is entered; NULL: always
} ExecutiveMode;

struct ExecutiveEvent;

typedef struct ExecutiveArm {
    struct ExecutiveArm *next;
    const char *name; ///< of an event, perhaps one that comes later
    struct ExecutiveEvent *event;
    uint8_t on;
} ExecutiveArm;

typedef struct ExecutiveSetting {
    struct ExecutiveSetting *next;
    uint32_t offset;
    uint32_t n; ///< [bytes]
    const uint8_t *bytes;
} ExecutiveSetting;

typedef struct ExecutiveEvent {
    struct ExecutiveEvent *next;
    const char *name;
    const ExecutiveCondition *when, *until; ///< until: NULL: when `when` no longer holds
    int64_t hold;                           ///< [ns]
    int32_t count;
    uint8_t once, armed;
    uint16_t n_modes;
    ExecutiveMode **modes; ///< the modes in which it is checked; none: in all
    ExecutiveMode *enter;  ///< NULL: none
    ExecutiveArm *arms;
    ExecutiveSetting *settings;
    ExecEvent state;
} ExecutiveEvent;

typedef struct Executive {
    ExecutiveModule *modules; ///< by place
    ExecutiveTask *tasks;     ///< in the order of equal times
    ExecutiveMode *modes, *initial, *current, *requested;
    ExecutiveEvent *events;
    ExecutiveWire *inputs; ///< those of fledge_script.inputs
    ExecutiveWire *wires;  ///< of the script, until it is done
    int64_t t;             ///< [ns] the last tick; -1: none
    int64_t down;          ///< [ns] of the computer after a reset
    uint32_t reset;        ///< the offset of the ComputerReset, an input; 0: nothing resets it
    uint8_t changed;       ///< 1: some configuration is to be published
    uint8_t composed;      ///< 1: the script is done
} Executive;

extern Executive executive;

/** Start the interpreter and run the script, which composes by the functions below: of process.c. Calls executive_begin
 *  when the arena is there. Returns NULL, or why it failed. */
const char *process_run(void);

/** Of update.c: NULL, or the text of a failure that there was. */
const char *update_failure(void);

/** Of update.c: a line for each module whose update is the script's, "script.flight.control" with updates, failures,
 *  turns and times, and one with its last failure. */
void update_figures(void (*line)(const char *text));

/** Begin to compose. Returns 0 if the arena has no room for the table of modules. */
int executive_begin(void);

/** The module of a place exists. */
void executive_name(uint16_t place);

/** The place whose memory has that byte; -1: none. */
int executive_place(uint32_t offset);

/** These link a record that is filled; the caller has checked it. */
void executive_add_wire(ExecutiveWire *wire);
void executive_add_task(ExecutiveTask *task);
void executive_add_mode(ExecutiveMode *mode);
void executive_add_event(ExecutiveEvent *event);

ExecutiveTask *executive_find_task(const char *name);
ExecutiveMode *executive_find_mode(const char *name);
ExecutiveEvent *executive_find_event(const char *name);

/** The script has set a parameter of a place while flight runs: configuration is published at the next instant. */
void executive_changed(uint16_t place);

/** Whether a mode may be entered now. */
int executive_admits(const ExecutiveMode *mode);

/** Request a mode from the next instant on. */
void executive_request(ExecutiveMode *mode);

#ifdef __cplusplus
}
#endif

#endif
