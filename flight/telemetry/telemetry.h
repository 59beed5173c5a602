/* SPDX-License-Identifier: Apache-2.0 */
/* Telemetry of flight: a packet for each output, with the rate that COMMAND_TELEMETRY sets, a packet of housekeeping,
 * the reports of commands, texts of a host with an interpreter, and the packets of services. Outputs and housekeeping
 * are off until a command turns them on.
 *
 * A packet has the telemetry header of cFS (CCSDS 133.0-B-2; cFE's CFE_MSG_TelemetryHeader_t):
 *
 *     byte 0  0x0800 + topic    the stream's id, big-endian
 *          2  0xC000 + sequence, which counts the packets of its stream
 *          4  length - 7
 *          6  flight's time: 32 bits of seconds, 16 bits of 2^-16 s, big-endian
 *         12  four spare bytes
 *         16  the message, TelemetryHousekeeping, CommandReport and the bytes read back, or TelemetryText and its
 *             letters: as in memory, but each number big-endian, whatever the target; or the content from a service
 *
 * A host whose readers expect structs of its own machine (the software bus of cFS) calls telemetry_native for a packet
 * that it sends there.
 *
 * Example:
 *
 *     void to_the_ground(void *radio, const uint8_t *packet, uint32_t n);
 *
 *     static void end_of_instant(const TelemetryTable *table, const void *mission, int64_t t, const CommandState *s)
 *     {
 *         telemetry_send(table, mission, t, s, to_the_ground, NULL);
 *     }
 */
#ifndef FLIGHT_TELEMETRY_TELEMETRY_H
#define FLIGHT_TELEMETRY_TELEMETRY_H

#include "flight/command/command.h"
#include "flight/msg/head.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    TELEMETRY_HEADER = 16, ///< [bytes]
    TELEMETRY_REPORT_MAX = TELEMETRY_HEADER + (int)sizeof(CommandReport) + COMMAND_DATA_MAX
};

/** The state of flight. */
typedef struct TelemetryHousekeeping {
    int64_t t;       ///< [ns] of flight
    uint32_t mode;   ///< [-] its place in the list of modes; 0 if there are none
    uint32_t staged; ///< [-] the module that is staged, plus 1; 0: none
    CommandCounters commands;
    CommandLink ground; ///< where a ground that begins anew counts on
    uint32_t spare;     ///< is not sent
} TelemetryHousekeeping;

/** An output of flight. */
typedef struct TelemetryOutput {
    const ExecRun *runs; ///< its numbers
    uint32_t n_runs;
    uint32_t offset; ///< [bytes] in the mission's memory
    uint32_t size;   ///< [bytes]
} TelemetryOutput;

/** Whether and how often a stream is sent. */
typedef struct TelemetryRate {
    uint32_t seen;     ///< the sequence of the last writing that was looked at
    uint16_t on;       ///< 1: it is sent
    uint16_t every;    ///< every how many writings
    uint16_t writings; ///< since it was sent, or turned on
    uint16_t sequence; ///< of its next packet
    uint16_t repeated; ///< that sequence, at the last telemetry_repeat
} TelemetryRate;

/** What a text is about. Operators read these numbers: append, do not renumber. */
typedef enum TelemetryTextKind {
    TELEMETRY_SCRIPT = 0,            ///< flight's own script: what went wrong in it
    TELEMETRY_PROCEDURE_STARTED = 1, ///< the text has its name
    TELEMETRY_PROCEDURE_ENDED = 2,   ///< it returned
    TELEMETRY_PROCEDURE_STOPPED = 3, ///< by a command, or a reset of flight
    TELEMETRY_PROCEDURE_KILLED = 4,  ///< the text says why
    TELEMETRY_PRINTED = 5,           ///< by a procedure or an evaluated text
    TELEMETRY_RESULT = 6,            ///< of an evaluated text
    TELEMETRY_ERROR = 7,             ///< why an evaluated text failed
    TELEMETRY_TEXT_KINDS
} TelemetryTextKind;

/** A text, with n letters behind it. */
typedef struct TelemetryText {
    int64_t t;         ///< [ns] flight's instant
    uint16_t kind;     ///< [-] TelemetryTextKind
    uint16_t sequence; ///< [-] of the command that started the procedure or had the text; of flight's script: 0
    uint16_t line;     ///< [-] of the script; 0: none
    uint16_t n;        ///< [-] bytes
    uint32_t lost;     ///< [-] texts before it, since the one that was sent before, for which there was no room
    uint32_t spare;
} TelemetryText;

/** The texts that wait until the end of flight's instant. */
typedef struct TelemetryTexts {
    uint8_t *memory;
    uint32_t room; ///< [bytes] of it
    uint32_t used;
    uint32_t lost;
} TelemetryTexts;

/** What the export writes of a mission. The streams follow one another: housekeeping, reports, outputs, texts, and
 *  those of services by CommandStream. */
typedef struct TelemetryTable {
    uint16_t stream; ///< 0x0800 + topic, of housekeeping
    uint16_t n_outputs;
    const TelemetryOutput *outputs;
    TelemetryRate *rates; ///< memory for 3 + n_outputs + COMMAND_STREAMS
    uint8_t *packet;      ///< memory for the largest packet, at least TELEMETRY_REPORT_MAX
    uint16_t (*mode)(const void *mission);
    TelemetryTexts *texts; ///< NULL: none
} TelemetryTable;

typedef void (*TelemetrySink)(void *user, const uint8_t *packet, uint32_t n);

/** Turn all off. */
void telemetry_begin(const TelemetryTable *table);

/** COMMAND_TELEMETRY. The place n_outputs is that of housekeeping, whose writings are flight's instants. */
void telemetry_rate(const TelemetryTable *table, uint16_t output, int on, uint16_t every);

/** What was not sent since the last call is sent again after the next instant, if it was written at all. */
void telemetry_repeat(const TelemetryTable *table);

/** After flight's instant t: send what is due. */
void telemetry_send(const TelemetryTable *table, const void *mission, int64_t t, const CommandState *commands,
                    TelemetrySink sink, void *user);

/** At the end of flight's instant: send the packets and reports that services have. */
void telemetry_services(const TelemetryTable *table, const CommandContext *context, CommandSink report,
                        TelemetrySink sink, void *user);

/** Send the content, which lies in table->packet behind its header, as a packet of a stream, by its place. The numbers
 *  of services are big-endian, all others as in memory. */
void telemetry_packet(const TelemetryTable *table, uint32_t stream, uint32_t n, int64_t t, TelemetrySink sink,
                      void *user);

/** Keep a text until telemetry_send sends it; what is longer than COMMAND_DATA_MAX is cut. */
void telemetry_text(TelemetryTexts *texts, int64_t t, TelemetryTextKind kind, uint16_t sequence, uint32_t line,
                    const char *text);

/** Give the numbers of a packet that a sink got the order of this machine, in place, in the memory of the telemetry. */
void telemetry_native(const TelemetryTable *table, const uint8_t *packet);

/** Send a report. */
void telemetry_report(const TelemetryTable *table, const CommandReport *report, const uint8_t *data, TelemetrySink sink,
                      void *user);

#ifdef __cplusplus
}
#endif

#endif
