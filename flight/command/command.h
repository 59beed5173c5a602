/* SPDX-License-Identifier: Apache-2.0 */
/* Commands to flight, on the desktop and on every target: request a mode, write parameters, publish configuration,
 * reset, arm or disarm an event, read back, set the rate of telemetry, run procedures on board.
 *
 * A command is a CCSDS space packet with the command header of cFS (CCSDS 133.0-B-2; cFE's CFE_MSG_CommandHeader_t):
 *
 *     byte 0  0x1800 + topic    the stream's id, big-endian
 *          2  0xC000 + sequence
 *          4  length - 7
 *          6  function code
 *          7  checksum: the XOR of all bytes of the packet is 0xFF
 *          8  the dictionary's version, then the arguments, each big-endian
 *
 * Arguments have 16 bits, but an offset, a length and a number of turns, which have 32. Bytes of parameters are a part
 * of the block `par` of the module's header, from the beginning of a number to the end of one, each number big-endian,
 * whatever the target. The dictionary is what the export writes of a mission: its modes, modules with parameters,
 * events and outputs, by their places in its lists. Its version changes with their names and layouts, so that a command
 * for another version is refused.
 *
 * A procedure is a program of the ground for the interpreter of the flight software, which reads telemetry, waits, and
 * requests modes and writes parameters by the same checks. The ground stages its bytecode in a slot and starts it. In
 * each instant it may take so many turns of its loops and calls; one that takes more is ended.
 *
 * A command is accepted when it arrives, and executed at the next instant of flight, before its tasks. Both are
 * reported with the command's sequence and a reason. What is refused changes nothing but counters. A packet that comes
 * again by a link from the ground is refused, too; on a software bus, senders count as they like. These functions do
 * not lock: a host of several tasks calls them for one state in one task, or under one lock.
 *
 * Example:
 *
 *     uint32_t from_the_ground(uint8_t *packet, uint32_t room);
 *
 *     static void instant(CommandState *s, const CommandTable *table, void *mission, int64_t t, CommandSink report)
 *     {
 *         uint8_t packet[64];
 *         uint32_t n;
 *         while ((n = from_the_ground(packet, sizeof packet)) > 0) {
 *             command_accept(s, table, &s->ground, packet, n, report, NULL);
 *         }
 *         command_execute(s, table, mission, t, report, NULL); // the tasks of flight run after it
 *     }
 */
#ifndef FLIGHT_COMMAND_COMMAND_H
#define FLIGHT_COMMAND_COMMAND_H

#include "flight/command/rules.h"
#include "flight/exec/order.h"

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Function codes, with the arguments behind the version. */
typedef enum CommandCode {
    COMMAND_NOOP = 0,             ///< none, and no version
    COMMAND_RESET_COUNTERS = 1,   ///< none, and no version
    COMMAND_MODE = 2,             ///< mode
    COMMAND_WRITE = 3,            ///< module, offset, bytes of its parameters; all rules must hold afterwards
    COMMAND_STAGE = 4,            ///< the same, into a block that begins as zeros, and counts when it is committed
    COMMAND_COMMIT = 5,           ///< module, command_crc of its whole staged block
    COMMAND_PUBLISH = 6,          ///< module of the configuration
    COMMAND_RESET_FLIGHT = 7,     ///< none; the parameters stay
    COMMAND_ARM = 8,              ///< event, 1 or 0
    COMMAND_READ = 9,             ///< module, offset, n: the report of the execution has n bytes
    COMMAND_TELEMETRY = 10,       ///< output, n_outputs (housekeeping) or COMMAND_ALL; 1 or 0; every how many writings
    COMMAND_STAGE_PROCEDURE = 11, ///< slot, offset, bytes of a procedure
    COMMAND_START_PROCEDURE = 12, ///< slot, length, command_crc of the procedure, turns in one instant
    COMMAND_STOP_PROCEDURE = 13,  ///< slot
    COMMAND_EVALUATE = 14,        ///< 0, turns, a line of text for the interpreter
    COMMAND_STORE = 15,           ///< command_crc of what follows: list, step, time (64 bits), a command to be stored
    COMMAND_DELETE = 16,          ///< list or COMMAND_ALL, step or COMMAND_ALL
    COMMAND_CONTROL = 17,         ///< list or COMMAND_ALL, ListAction, to start: command_crc of the list's report, or 0
    COMMAND_LIST = 18,            ///< list: the report of the execution has 16 bytes of each of its commands
    COMMAND_PDU = 19,             ///< no version: a PDU of CFDP; reported if it is refused only, and without a sequence
    COMMAND_FILE_SEND = 20,       ///< class, name, or name>name for the ground: a file to the ground
    COMMAND_FILE_CONTROL = 21,    ///< FileAction, 1: a transaction that flight began, its number (32 bits)
    COMMAND_FILE_REMOVE = 22,     ///< 0, name
    COMMAND_TABLE_LOAD = 23,      ///< module, name: its parameters become those of a file, by the rules of a commit
    COMMAND_TABLE_DUMP = 24,      ///< module, name: write them to a file
    COMMAND_CHECK = 25,           ///< module: the report of the execution has the size (32 bits) and command_crc of its
                                  ///< parameters
    COMMAND_EVENTS = 26,          ///< none: the log of events sends again what it has
    COMMAND_UNIT = 27, ///< unit or COMMAND_ALL, UnitState or 0: clear its fault (all: of each), 1: even if none
                       ///< of its kind stays in use
    COMMAND_CODES
} CommandCode;

/** Why a command was refused. Operators read these numbers: append, do not renumber. */
typedef enum CommandReason {
    COMMAND_OK = 0,
    COMMAND_LENGTH = 1, ///< not that of its code, shorter than a header, or not that of its header
    COMMAND_CHECKSUM = 2,
    COMMAND_STREAM = 3,      ///< the id of another stream
    COMMAND_UNKNOWN = 4,     ///< no such function code
    COMMAND_VERSION = 5,     ///< for another version of the dictionary
    COMMAND_PLACE = 6,       ///< no such mode, module, event, output, slot, file or transaction; bytes beyond its end
                             ///< or inside a number
    COMMAND_VALUE = 7,       ///< an argument that must be 0 or 1, a rate or a length or turns of 0, or a module that
                             ///< publishes nothing
    COMMAND_RULE = 8,        ///< the parameters would break a rule of their header; detail: its place in the list
    COMMAND_INITIAL = 9,     ///< a change of an initial value after flight's first instant; detail: of its rule
    COMMAND_BUSY = 10,       ///< the commands that wait for the next instant leave no room
    COMMAND_NOT_STAGED = 11, ///< a commit without a stage, or of another module
    COMMAND_CRC = 12,        ///< what is staged is not what the commit or the start names
    COMMAND_ABSENT = 13,  ///< this flight software has no interpreter, or none that evaluates text, or not this service
    COMMAND_RUNNING = 14, ///< a procedure or a list runs, stands or is held already
    COMMAND_BYTECODE = 15,  ///< the procedure is not bytecode for this interpreter
    COMMAND_FAILED = 16,    ///< the text was not evaluated to its end, and a text of telemetry says why; a file did not
                            ///< arrive; detail: CfdpCondition
    COMMAND_SEQUENCE = 17,  ///< it came before, or later than one behind it; detail: the last sequence accepted
    COMMAND_LATE = 18,      ///< a stored command came due too long ago
    COMMAND_INHIBITED = 19, ///< its list is inhibited
    COMMAND_FULL = 20,      ///< the store of files is full, or too many transactions are under way
    COMMAND_ROLE = 21,      ///< whose key protected the frame in which it came may not give it
    COMMAND_LAST = 22,      ///< it would leave no unit of its kind in use
    COMMAND_GUARDED = 23,   ///< the mode's condition does not hold
    COMMAND_CONFLICT = 24,  ///< another list asks for another mode at the same time
    COMMAND_REASONS
} CommandReason;

/** What COMMAND_CONTROL does with a list of stored commands. */
typedef enum ListAction {
    LIST_START = 0, ///< a sequence
    LIST_STOP = 1,
    LIST_HOLD = 2,    ///< nothing comes due, a sequence's time stands
    LIST_RELEASE = 3, ///< from there on
    LIST_INHIBIT = 4, ///< what comes due is not executed
    LIST_ALLOW = 5
} ListAction;

enum {
    COMMAND_HEADER = 8,     ///< [bytes]
    COMMAND_DATA = 16,      ///< [bytes] in front of parameters, bytecode and text
    COMMAND_DATA_MAX = 512, ///< [bytes] of them in one command or report
    COMMAND_MAX = COMMAND_DATA + COMMAND_DATA_MAX,
    COMMAND_STORED = 24,      ///< [bytes] in front of a command to be stored
    COMMAND_STORED_MAX = 112, ///< [bytes] of one
    COMMAND_AT_ONCE = 4,      ///< stored commands of one instant
    COMMAND_OF_LIST = 1,      ///< in reports
    COMMAND_OF_MONITOR = 32,
    COMMAND_OF_RULE = 48,
    COMMAND_RECENT = 16, ///< reports that the state keeps for records
    COMMAND_ALL = 0xFFFF
};

/** The parameters of a module. */
typedef struct CommandBlock {
    const ExecRun *runs; ///< its numbers
    const CommandRule *rules;
    uint32_t size; ///< [bytes]
    uint16_t n_runs;
    uint16_t n_rules;
    uint16_t configuration; ///< 1: the module publishes its parameters, and so does a change of them
    uint16_t spare;
} CommandBlock;

struct CommandState;
struct CommandTable;

/** The context of what a command starts: the state, the mission and the instant. A service may store it. */
typedef struct CommandContext {
    struct CommandState *state;
    const struct CommandTable *table;
    void *mission;
    int64_t t;         ///< [ns] the instant
    uint16_t sequence; ///< of the command
} CommandContext;

/** The procedures of a host with an interpreter. */
typedef struct CommandProcedures {
    uint8_t *slots; ///< memory for n slots
    uint32_t room;  ///< [bytes] of each
    uint16_t n;
    uint16_t evaluates; ///< 1: the interpreter evaluates text
    CommandReason (*start)(const CommandContext *context, uint16_t slot, uint32_t n, uint32_t turns);
    CommandReason (*stop)(const CommandContext *context, uint16_t slot);
    CommandReason (*evaluate)(const CommandContext *context, const uint8_t *text, uint32_t n, uint32_t turns);
} CommandProcedures;

struct CommandReport;

/** What a service sends. Operators know these streams: append, do not renumber. */
typedef enum CommandStream { STREAM_EVENTS = 0, STREAM_SELECTED = 1, STREAM_FILES = 2, COMMAND_STREAMS } CommandStream;

/** Takes a packet of a unit. barred: bit i: its sender may not give the function code i. */
typedef void (*CommandPackets)(void *user, const uint8_t *packet, uint32_t n, uint64_t barred);
typedef void (*CommandBytes)(void *user, const uint8_t *bytes, uint32_t n);

/** How flight drives a module that commands need, a service. Such a module's header declares one, by the name
 *  MODULE_service; a process has one module of a kind. Its memory is the mission's, and its update is that of any
 *  module. A function that it does not need is NULL. */
typedef struct CommandService {
    uint16_t first, n; ///< its function codes
    /** As a command is accepted, whose length and version are right. */
    CommandReason (*check)(const uint8_t *packet, uint32_t n);
    /** As a command is executed; data: for the n bytes of a report. */
    CommandReason (*execute)(const CommandContext *context, void *module, const uint8_t *packet,
                             struct CommandReport *report, uint8_t *data);
    /** At an instant, after the commands of the ground: take the next command that the module has for flight, and
     *  return its length; 0: there is none. report: reason: why it is not to be executed; from. */
    uint32_t (*take)(const CommandContext *context, void *module, uint8_t *packet, struct CommandReport *report);
    /** [ns] when it will have one, as things stand; in the past: it may have one at each instant; INT64_MAX: never,
     *  unless a command comes. */
    int64_t (*next)(const void *module);
    /** At an instant, with the commands of the ground: a PDU of n bytes has come. */
    void (*arrive)(const CommandContext *context, void *module, const uint8_t *bytes, uint32_t n);
    /** At the end of an instant, after the packets of outputs: write the content of the next packet, big-endian and at
     *  most COMMAND_DATA_MAX bytes, and return its length; 0: there is none. */
    uint32_t (*telemetry)(const CommandContext *context, void *module, uint8_t *content);
    /** At the end of an instant: the next report of a command that was executed before; 0: there is none. */
    int (*report)(const CommandContext *context, void *module, struct CommandReport *report);
    CommandStream stream; ///< of its telemetry
    /** Of the service by which flight speaks frames: a unit of n bytes has come by the link from the ground: give its
     *  packets to the sink. */
    void (*unwrap)(const CommandContext *context, void *module, const uint8_t *unit, uint32_t n, CommandPackets sink,
                   void *user);
    /** A packet of telemetry is to go, or, n = 0, the instant ends: give the units that are ready to the sink. */
    void (*wrap)(const CommandContext *context, void *module, const uint8_t *packet, uint32_t n, CommandBytes sink,
                 void *user);
} CommandService;

struct TelemetryTable;

/** Those of a process. The last six are the functions below and telemetry_services: the table names them, so that
 *  flight software without services does not link them, nor the last two without one that speaks frames. */
typedef struct CommandServices {
    const CommandService *const *list;
    uint32_t n;
    void *(*module)(void *mission, uint32_t place); ///< of a service
    /** One of n_outputs, and its size. */
    const void *(*output)(const void *mission, uint16_t place, uint32_t *size);
    const uint16_t *events; ///< the places of the outputs that are a FlightEvent (flight/msg/event.h)
    uint32_t n_events;
    const void *store; ///< of files, from the host; NULL: none
    const void *keys;  ///< of frames, from the host: a const SdlsProvider * (ccsds/sdls.h); NULL: none
    CommandReason (*check)(const struct CommandTable *table, const uint8_t *packet, uint32_t n);
    CommandReason (*execute)(const CommandContext *context, const uint8_t *packet, struct CommandReport *report,
                             uint8_t *data);
    void (*run)(const CommandContext *context, void (*sink)(void *, const struct CommandReport *, const uint8_t *),
                void *user);
    void (*telemetry)(const struct TelemetryTable *table, const CommandContext *context,
                      void (*sink)(void *, const struct CommandReport *, const uint8_t *),
                      void (*send)(void *, const uint8_t *, uint32_t), void *user);
    CommandReason (*unwrap)(const CommandContext *context, const uint8_t *unit, uint32_t n,
                            void (*sink)(void *, const struct CommandReport *, const uint8_t *), void *user);
    void (*wrap)(const CommandContext *context, const uint8_t *packet, uint32_t n, CommandBytes sink, void *user);
} CommandServices;

/** A mission's dictionary, as `fledge export` writes it and the desktop makes it, and the functions of what they
 *  command. `mission` is the host's own. */
typedef struct CommandTable {
    uint16_t stream; ///< 0x1800 + topic
    uint16_t version;
    uint16_t n_blocks, n_modes, n_events, n_outputs;
    const CommandBlock *blocks;
    uint8_t *staged; ///< memory for the largest block
    uint8_t *queue;  ///< memory for the commands that wait
    uint32_t room;   ///< [bytes] of it
    void *(*parameters)(void *mission, uint16_t block);
    void (*enter)(void *mission, uint16_t mode);
    void (*publish)(void *mission, uint16_t block, int64_t t);
    void (*arm)(void *mission, uint16_t event, int on);
    void (*reset)(void *mission, int64_t t);
    void (*telemetry)(void *mission, uint16_t output, int on, uint16_t every);
    const CommandProcedures *procedures;            ///< NULL: none
    const CommandServices *services;                ///< NULL: none
    int (*may_enter)(void *mission, uint16_t mode); ///< whether the mode's condition holds; NULL: none has one
    uint16_t (*mode)(const void *mission);          ///< the one in force; NULL: it has none
} CommandTable;

/** Of commands, by what became of them. */
typedef struct CommandCounters {
    uint32_t accepted;                 ///< [-]
    uint32_t executed;                 ///< [-]
    uint32_t refused;                  ///< [-] at either time
    uint32_t reasons[COMMAND_REASONS]; ///< [-] of those refused
} CommandCounters;

/** How far a command is. */
typedef enum CommandStage {
    COMMAND_ACCEPTED = 0, ///< or refused when it came
    COMMAND_DONE = 1,     ///< executed, or refused then
    COMMAND_STARTED = 2,  ///< executed; what it began goes on, and is reported again
    COMMAND_UNDER_WAY = 3 ///< detail: [%] of it
} CommandStage;

/** What was done with a command. */
typedef struct CommandReport {
    int64_t t;         ///< [ns] the instant of execution; of acceptance: the last instant before, -1: none; of what was
                       ///< stored: its own
    uint16_t sequence; ///< [-] of the command, 14 bits
    uint16_t code;     ///< [-] its function code
    uint16_t executed; ///< [-] CommandStage
    uint16_t reason;   ///< [-] CommandReason
    uint16_t detail;   ///< [-] of COMMAND_RULE, COMMAND_INITIAL and COMMAND_SEQUENCE
    uint16_t n;        ///< [-] bytes read back
    uint16_t origin;   ///< [-] COMMAND_OF_LIST + its list, COMMAND_OF_MONITOR or COMMAND_OF_RULE + its place; 0: from
                       ///< elsewhere
    uint16_t spare;
} CommandReport;

typedef void (*CommandSink)(void *user, const CommandReport *report, const uint8_t *data);

/** A link from the ground, whose one sender counts its commands up, modulo 2^14. What is accepted is ahead of the last
 *  one, by less than half of the circle: packets may be lost, but none counts twice, and what was refused may come
 *  again. All zero: the first may have any sequence. Frames that check this themselves (COP-1, or protection against
 *  replay) make a link needless. */
typedef struct CommandLink {
    uint16_t begun; ///< [-] 1: a command was accepted,
    uint16_t last;  ///< [-] the last one with this sequence
} CommandLink;

typedef struct CommandState {
    int64_t t; ///< [ns] the last instant; -1: none
    CommandCounters counters;
    uint32_t waiting;                     ///< [bytes] in the queue
    uint16_t staging;                     ///< the module that is staged, plus 1; 0: none
    uint16_t from;                        ///< of the reports that are made now
    CommandLink ground;                   ///< of a host with one link
    uint64_t barred;                      ///< bit i: what comes now may not be a command with the function code i
    uint32_t framed;                      ///< 1: the service that speaks frames has begun
    uint32_t reported;                    ///< how many reports there were
    CommandReport recent[COMMAND_RECENT]; ///< report i, the first is 0, at i modulo COMMAND_RECENT
} CommandState;

/** Before flight's first instant: nothing waits, nothing is staged, nothing was counted, no command has come. */
void command_begin(CommandState *s);

/** A packet has arrived: check it, report, and keep it until the next instant if it is accepted. link: by which it
 *  came; NULL: a software bus, or any other way on which sequences mean nothing. */
CommandReason command_accept(CommandState *s, const CommandTable *table, CommandLink *link, const uint8_t *packet,
                             uint32_t n, CommandSink sink, void *user);

/** The same of what came by the link from the ground: a packet or, with a service that speaks frames, a unit of them,
 *  whose fate only the reports show. */
CommandReason command_receive(const CommandContext *context, const uint8_t *unit, uint32_t n, CommandSink sink,
                              void *user);

/** At the beginning of flight's instant t: execute what was accepted, in order, then what services have, and report
 *  each. */
void command_execute(CommandState *s, const CommandTable *table, void *mission, int64_t t, CommandSink sink,
                     void *user);

/** What a procedure does, with the checks and counters of a command: write parameters, n > 0 bytes as they lie in
 *  memory, whole numbers; request a mode. detail: as in a report. */
CommandReason command_write(const CommandContext *context, uint16_t module, uint32_t at, const uint8_t *bytes,
                            uint32_t n, uint16_t *detail);
CommandReason command_enter(const CommandContext *context, uint16_t mode);

/** Whether a mode may be entered now, if there is one. */
static inline int command_may_enter(const CommandContext *context, uint16_t mode)
{
    return context->table->may_enter == NULL || mode >= context->table->n_modes ||
           context->table->may_enter(context->mission, mode);
}

/** Let the whole block, big-endian, that stands in table->staged count, as COMMAND_COMMIT. detail: as in a report. */
CommandReason command_activate(const CommandContext *context, uint16_t module, uint16_t *detail);

/** Copy n bytes of the parameters of a module from the byte `at`, whole numbers, each big-endian. */
void command_block(const CommandContext *context, uint16_t module, uint32_t at, uint32_t n, uint8_t *bytes);

/** command_crc of all of them. */
uint16_t command_block_crc(const CommandContext *context, uint16_t module);

/** Count a report and give it to a sink. */
void command_report(CommandState *s, const CommandReport *report, const uint8_t *data, CommandSink sink, void *user);

/** What flight/command does for services: members of CommandServices. */
CommandReason command_service_check(const CommandTable *table, const uint8_t *packet, uint32_t n);
CommandReason command_service_execute(const CommandContext *context, const uint8_t *packet, CommandReport *report,
                                      uint8_t *data);
void command_service_run(const CommandContext *context, CommandSink sink, void *user);
CommandReason command_service_unwrap(const CommandContext *context, const uint8_t *unit, uint32_t n, CommandSink sink,
                                     void *user);
void command_service_wrap(const CommandContext *context, const uint8_t *packet, uint32_t n, CommandBytes sink,
                          void *user);

/** CRC-16-CCITT (as of CCSDS 131.0-B, from 0xFFFF) of a block with big-endian numbers. */
uint16_t command_crc(const uint8_t *bytes, uint32_t n);

#ifdef __cplusplus
}
#endif

#endif
