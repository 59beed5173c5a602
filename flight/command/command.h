/* SPDX-License-Identifier: Apache-2.0 */
/* Commands to flight, on every target: request a mode, write parameters, publish configuration, reset, arm or disarm an
 * event, read back, set the rate of telemetry.
 *
 * A command is a CCSDS space packet with the command header of cFS (CCSDS 133.0-B-2; cFE's CFE_MSG_CommandHeader_t):
 *
 *     byte 0  0x1800 + topic    the stream's id, big-endian
 *          2  0xC000 + sequence
 *          4  length - 7
 *          6  function code
 *          7  checksum: the XOR of all bytes of the packet is 0xFF
 *          8  the dictionary's version, then the arguments: 16-bit numbers, big-endian
 *
 * Bytes of parameters are the block of the module's header, each number big-endian, whatever the target. The dictionary
 * is what the export writes of a mission: its modes, modules with parameters, events and outputs, by their places in its
 * lists. Its version changes with their names and layouts, so that a command for another version is refused.
 *
 * A command is accepted when it arrives, and executed at the next instant of flight, before its tasks. Both are reported
 * with the command's sequence and a reason. What is refused changes nothing but counters. */
#ifndef FLIGHT_COMMAND_COMMAND_H
#define FLIGHT_COMMAND_COMMAND_H

#include "flight/command/rules.h"

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef enum CommandCode {         /* arguments, each of 16 bits, behind the version */
    COMMAND_NOOP = 0,              ///< none, and no version
    COMMAND_RESET_COUNTERS = 1,    ///< none, and no version
    COMMAND_MODE = 2,              ///< mode
    COMMAND_WRITE = 3,             ///< module, offset, n, then n bytes of its parameters; all rules must hold afterwards
    COMMAND_STAGE = 4,             ///< the same, into a copy of the block that counts only when it is committed
    COMMAND_COMMIT = 5,            ///< module, CRC of the staged block (command_crc)
    COMMAND_PUBLISH = 6,           ///< module: of the configuration
    COMMAND_RESET_FLIGHT = 7,      ///< none
    COMMAND_ARM = 8,               ///< event, 1 or 0
    COMMAND_READ = 9,              ///< module, offset, n: the report of the execution has the bytes
    COMMAND_TELEMETRY = 10,        ///< output, or COMMAND_ALL; 1 or 0; every how many of its writings one is sent
    COMMAND_CODES
} CommandCode;

/** Why a command was refused. Operators read these numbers: append, do not renumber. */
typedef enum CommandReason {
    COMMAND_OK = 0,
    COMMAND_LENGTH = 1,   ///< not that of its code, or shorter than a header, or not that of the header
    COMMAND_CHECKSUM = 2,
    COMMAND_UNKNOWN = 3,  ///< no such function code
    COMMAND_STREAM = 4,   ///< the id of another stream
    COMMAND_VERSION = 5,  ///< for another version of the dictionary
    COMMAND_PLACE = 6,    ///< no such mode, module, event or output, or bytes beyond the block or inside a number
    COMMAND_VALUE = 7,    ///< an argument that must be 0 or 1, or a rate of 0
    COMMAND_RULE = 8,     ///< the parameters break a rule of their header; detail: its place in the list
    COMMAND_INITIAL = 9,  ///< a change of an initial value after flight's first instant
    COMMAND_BUSY = 10,    ///< too many commands wait for the next instant
    COMMAND_NOT_STAGED = 11, ///< a commit without a stage, or of another module
    COMMAND_CRC = 12,     ///< the staged block is not what the commit says
    COMMAND_REASONS
} CommandReason;

enum {
    COMMAND_HEADER = 8,    ///< [bytes]
    COMMAND_DATA_MAX = 512, ///< [bytes] of parameters in one command or report
    COMMAND_MAX = COMMAND_HEADER + 8 + COMMAND_DATA_MAX,
    COMMAND_WAITING = 2 * COMMAND_MAX, ///< [bytes] of accepted commands
    COMMAND_ALL = 0xFFFF
};

/** The parameters of a module. */
typedef struct CommandBlock {
    const char *path;          ///< "flight.control"
    uint32_t offset;           ///< [bytes] in the mission's memory
    uint32_t size;             ///< [bytes]
    const CommandRun *runs;    ///< the widths of its numbers, for the byte order
    const CommandRule *rules;
    uint16_t n_runs;
    uint16_t n_rules;
    uint16_t configuration;    ///< 1: a change publishes it
    uint16_t spare;
} CommandBlock;

/** A mission's dictionary, as `fledge export` writes it, and the desktop makes it. */
typedef struct CommandTable {
    uint16_t stream;           ///< 0x1800 + topic
    uint16_t version;
    uint16_t n_blocks, n_modes, n_events, n_outputs;
    uint32_t largest;          ///< [bytes] of the largest block
    const CommandBlock *blocks;
    void *staged;              ///< memory for the largest block
    void (*enter)(void *mission, uint16_t mode);
    void (*publish)(void *mission, uint16_t block, int64_t t);
    void (*arm)(void *mission, uint16_t event, int on);
    void (*reset)(void *mission);
    void (*telemetry)(void *mission, uint16_t output, int on, uint16_t every);
} CommandTable;

typedef struct CommandCounters {
    uint32_t accepted;
    uint32_t executed;
    uint32_t refused;                   ///< at either time
    uint32_t reasons[COMMAND_REASONS];  ///< of those refused
} CommandCounters;

/** What was done with a command. */
typedef struct CommandReport {
    int64_t t;          ///< [ns] of flight; -1: before its first instant
    uint16_t sequence;  ///< of the command, 14 bits
    uint16_t code;      ///< its function code
    uint16_t executed;  ///< 0: this is about its acceptance; 1: about its execution
    uint16_t reason;    ///< CommandReason
    uint16_t detail;    ///< with COMMAND_RULE: of the rule; else 0
    uint16_t n;         ///< [bytes] read back
} CommandReport;

typedef void (*CommandSink)(void *user, const CommandReport *report, const uint8_t *data);

typedef struct CommandState {
    CommandCounters counters;
    uint32_t waiting;                 ///< [bytes]
    uint16_t staging;                 ///< the module that is staged, plus 1; 0: none
    uint16_t begun;                   ///< 1 after flight's first instant
    uint8_t queue[COMMAND_WAITING];
} CommandState;

/** A command has arrived: check it, report, and keep it until the next instant if it is accepted. */
CommandReason command_accept(CommandState *s, const CommandTable *table, const uint8_t *packet, uint32_t n,
                             CommandSink sink, void *user);

/** At the beginning of flight's instant t: execute what was accepted, in order, and report each. */
void command_execute(CommandState *s, const CommandTable *table, void *mission, int64_t t, CommandSink sink, void *user);

/** CRC-16-CCITT (CCSDS 131.0-B), of a block with big-endian numbers. */
uint16_t command_crc(const uint8_t *bytes, uint32_t n);

#ifdef __cplusplus
}
#endif

#endif
