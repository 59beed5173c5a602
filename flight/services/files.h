/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_SERVICES_FILES_H
#define FLIGHT_SERVICES_FILES_H

#include "flight/command/command.h"
#include "flight/msg/avionics.h"
#include "flight/msg/event.h"
#include "flight/msg/services.h"
#include "flight/services/mirror.h"

enum {
    FILES_PAGES = 1024,      ///< of the store, each for 244 bytes of a file, or for a name
    FILES_TRANSACTIONS = 8,  ///< at once
    FILES_RANGES = 32,       ///< that may be missing of a file, or are to be sent again
    FILES_INPUT = 8192,      ///< [bytes] of PDUs from one update to the next, each with two more
    FILES_SEGMENT = 480,     ///< [bytes] of file data in a PDU, which a packet holds
    FILES_STORE = 263192,    ///< [bytes] of the store's memory
    FILES_PROTOCOL = 1856,   ///< [8 bytes] of the protocol's memory
    FILES_TABLE_HEADER = 16, ///< [bytes] in front of a table
    FILES_NAME = 12,         ///< [bytes] in front of the names in a command
    FILES_NAME_MAX = 255,    ///< [bytes] of them
    FILES_BOOT_NAME = 128    ///< [bytes] for a name in boot
};

/** How files that are sent are checked: CfdpChecksum. */
typedef enum FilesChecksum { FILES_MODULAR = 0, FILES_CRC32 = 3, FILES_UNCHECKED = 15 } FilesChecksum;

/** What COMMAND_FILE_CONTROL does with a transaction. */
typedef enum FileAction { FILE_SUSPEND = 0, FILE_RESUME = 1, FILE_CANCEL = 2 } FileAction;

/** Its events. */
typedef enum FilesEventId {
    FILES_RECEIVED = 1,  ///< info, source [-], sequence [-], size [-]: a file has come
    FILES_SENT = 2,      ///< info, source [-], sequence [-], size [-]: a file was sent, and in class 2 delivered
    FILES_FAILED = 3,    ///< medium, source [-], sequence [-], size [-], condition [-]: a transaction ended without it
    FILES_FAULT = 4,     ///< low, source [-], sequence [-], size [-], condition [-]: a fault in a transaction
    FILES_SUSPENDED = 5, ///< low, source [-], sequence [-], size [-]: a transaction is suspended
    FILES_RESUMED = 6,   ///< info, source [-], sequence [-], size [-]: it goes on
    FILES_LOADED = 7,    ///< info, module [-], size [-]: a table counts from now on
    FILES_LOST = 8,      ///< low, lost [-]: PDUs came for which there was no room
    FILES_REFUSED = 9    ///< medium, place [-], reason [-], module [-], detail [-]: at the start, of the table in that
                         ///< place of the order of names: CommandReason, as of command 23
} FilesEventId;

/** A command whose transaction goes on. */
typedef struct FilesJob {
    uint64_t transaction; ///< [-] its sequence number
    uint32_t percent;     ///< [-] that was reported
    uint16_t command;     ///< [-] sequence of the command
    uint16_t origin;      ///< [-] `from` of its reports
    uint16_t used;        ///< [-] 1: this place is
    uint16_t ended;       ///< [-] 1: the transaction has ended
    uint32_t condition;   ///< [-] CfdpCondition, by which it has
    uint32_t good;        ///< [-] 1: all of it was sent, and in class 2 delivered
    uint32_t spare;
} FilesJob;

/** Files by CFDP (ccsds/cfdp.h) in classes 1 and 2, both ways, and tables of parameters as files.
 *
 *  PDUs come as COMMAND_PDU, and go as packets of the stream of files. At each of its updates the module takes those
 *  that came since the last one, and sends at most `rate`: PDUs have the last place in an instant, behind all other
 *  telemetry. Its time is that of its updates.
 *
 *  Files are in a store in its memory (ccsds/store/memory_store.h) of 1024 pages: one for each name, and one for each
 *  244 bytes. A recorder may keep it (flight/services/mirror.h), a page at each update; else a host may give another
 *  store. A file has its name only when it is whole. A reset of flight by command loses none, and transactions go on;
 *  after a reset of the computer the store is empty, or as the recorder kept it. Until all its pages are back, commands
 *  for files fail, and PDUs wait.
 *
 *  The commands 20 to 22 send a file to the ground, control a transaction and remove a file; what the ground itself
 *  sends, asks for by proxy or lists needs no command, if `allowed`. A command that sends is reported as started, with
 *  the number of its transaction modulo 65536, at each tenth, and at its end.
 *
 *  A table is a file: 0x464C5442, version of the dictionary (16 bits), module (16 bits), size (32 bits), CRC of the
 *  block (16 bits), 16 bits of 0, then the block of parameters, each number big-endian. Command 23 lets its block count
 *  as COMMAND_COMMIT does, whole or not at all; what is staged is lost. Command 24 writes the file of what counts.
 *
 *  With `boot` the tables in the directory boot are loaded after each start of the computer, once the store is there:
 *  in the order of their names, one at an instant, each as by command 23. What is no table, is for another version or
 *  breaks a rule is refused, and the others count. So what the ground wrote into boot outlives a reset of the computer,
 *  at which parameters are as built. The directory is made if it is not there. */
typedef struct Files {
    struct {
        RecorderReply recorded; ///< optional: of the recorder that keeps the store
    } in;
    struct {
        FilesState state;
        FlightEvent event;
        RecorderRequest request;
    } out;
    struct {
        double rate;            ///< [1/s] required, > 0: bytes of PDUs sent
        double ack_timer;       ///< [s] >= 0: until an EOF or FINISHED is sent again; 0: 10 s
        double nak_timer;       ///< [s] >= 0: until what is missing is asked for again; 0: 10 s
        double check_timer;     ///< [s] >= 0: of class 1, after EOF, for data that is late; 0: 10 s
        double inactivity;      ///< [s] >= 0: without a PDU of a transaction; 0: 300 s
        double keep_alive;      ///< [s] >= 0: between KEEP_ALIVEs; 0: none
        uint32_t entity;        ///< [-] required, in [1, 65535]: the own id
        uint32_t ground;        ///< [-] required, in [1, 65535]: id of the ground's entity
        uint32_t behind;        ///< [-] bytes that the receiver may be behind by its KEEP_ALIVE; 0: any
        uint32_t ack_limit;     ///< [-] in [0, 255]: how often an EOF or FINISHED is sent; 0: 10 times
        uint32_t nak_limit;     ///< [-] in [0, 255]: how often its timer expires without new data; 0: 10 times
        uint32_t check_limit;   ///< [-] in [0, 255]: how often its timer expires; 0: 10 times
        uint32_t segment;       ///< [-] in [0, 480]: bytes of file data in a PDU; 0: 480
        uint32_t immediate;     ///< [-] in [0, 1]: 1: what is missing is asked for at once; 0: after EOF
        FilesChecksum checksum; ///< [-] of files that are sent
        uint32_t crc;           ///< [-] in [0, 1]: 1: PDUs have a CRC
        uint32_t allowed;       ///< [-] in [0, 15]: what the ground may ask for: 1 requests to the store, 2 files by
                                ///< proxy, 4 directories, 8 remote suspension and reports; their sum
        uint32_t frozen;        ///< [-] in [0, 1]: 1: the link is out: nothing is sent, and timers rest
        uint32_t priority;      ///< [-] in [0, 255]: of files sent by command; those of proxies have that of the ground
        uint8_t handlers[16];   ///< [-] in [0, 4]: CfdpHandler by CfdpCondition; 0: it is cancelled
        uint32_t kept;          ///< [-] in [0, 1]: 1: the recorder keeps the store: wire `recorded` and `request`
        uint32_t boot;          ///< [-] in [0, 1]: 1: tables in boot/ are loaded at the start of the computer
        uint32_t spare;
    } par;
    struct {
        uint64_t protocol[FILES_PROTOCOL]; ///< [-] of the entity: FilesProtocol in files.c
        uint64_t store[FILES_STORE / 8];   ///< [-] the MemoryStore
        FilesJob jobs[FILES_TRANSACTIONS];
        Mirror mirror;
        int64_t t;          ///< [ns] of the last update
        int64_t dt;         ///< [ns] before it
        double budget;      ///< [-] bytes that may be sent
        uint32_t begun;     ///< [-] 1: protocol and store are
        uint32_t updated;   ///< [-] 1: since the protocol ran
        uint32_t used;      ///< [-] bytes of the input
        uint32_t lost;      ///< [-] PDUs for which the input had no room
        uint32_t received;  ///< [-] files
        uint32_t sent;      ///< [-] files
        uint32_t failed;    ///< [-] transactions
        uint32_t condition; ///< [-] CfdpCondition of the last fault
        uint32_t booted;    ///< [-] 1: no table of the start is left
        uint32_t tried;     ///< [-] tables of the start
        uint32_t tables;    ///< [-] that were loaded
        uint32_t spare;
        char last[FILES_BOOT_NAME]; ///< the name of the last one that was tried
        uint8_t input[FILES_INPUT]; ///< [-] PDUs, each behind its length
    } mem;
} Files;

void files_reset(Files *m);
void files_update(Files *m, Tick t);

/** How flight's executive drives it. */
extern const CommandService files_service;

#endif
