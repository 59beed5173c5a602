/* SPDX-License-Identifier: Apache-2.0 */
/* A board as data: where its snorkels lie and how they behave. The tables are generated from the
 * board's TOML file; README.md draws the layouts. Addresses are in bytes from the board's base. */
#ifndef REGISTERS_BOARD_H
#define REGISTERS_BOARD_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define REGISTER_NOWHERE UINT32_MAX

typedef enum RegisterForm {
    REGISTER_WORD,   ///< 32 bits, of which fields may be parts
    REGISTER_PACKET, ///< bytes
    REGISTER_MESSAGE ///< a message as in the archive: 4 bytes of CDR head, then its struct
} RegisterForm;

enum {
    REGISTER_FROM_FLIGHT = 1 << 0, ///< flight writes, the outside reads; else the other way round
    REGISTER_QUEUED = 1 << 1,      ///< read in order; else only the last one counts
    REGISTER_VARIABLE = 1 << 2,    ///< 0 to capacity bytes; else exactly capacity
    REGISTER_OVERWRITE = 1 << 3    ///< a full queue drops its oldest; else it refuses the newest
};

/** The positions of the parts of a packet's describing word. A part of 0 bits is not there. */
typedef struct RegisterDescriptor {
    uint8_t length_lsb;
    uint8_t length_bits;
    uint8_t tag_lsb;
    uint8_t tag_bits;
    uint8_t valid_lsb;
    uint8_t valid_bits; ///< 0 or 1
} RegisterDescriptor;

/** What the outside's end of a lane does to a packet: drop `remove` bytes in front, reverse the
 *  bytes of each whole unit if both sides' orders differ, put `add` bytes in front. */
typedef struct RegisterOutside {
    uint16_t remove;     ///< [bytes]
    uint16_t add;        ///< [bytes]
    const uint8_t *head; ///< the bytes to add
    uint8_t unit;        ///< [bytes] 1, 2, 4 or 8
    uint8_t swap;        ///< 1: the orders differ
} RegisterOutside;

/** A part of a word, of `bits` bits from `lsb` up, or numbers of `bits` bits in a packet:
 *  value = offset + scale * count. The members below `is_signed` are of packets. */
typedef struct RegisterField {
    const char *name;
    const char *unit;
    double scale; ///< never 0
    double offset;
    uint8_t lsb;
    uint8_t bits;
    uint8_t is_signed; ///< two's complement
    uint8_t is_float;  ///< IEEE 754, of 32 or 64 bits
    uint32_t at;       ///< [bytes] from the beginning of flight's packet
    uint16_t count;    ///< numbers in a row
    uint8_t little_endian;
    uint8_t tag; ///< the kind of packet, as its descriptor has it
} RegisterField;

/** One direction of a snorkel. A snorkel of both directions is two lanes. */
typedef struct RegisterLane {
    const char *name;
    RegisterForm form;
    uint32_t flags;       ///< REGISTER_QUEUED ...
    uint32_t address;     ///< the word itself, or the control block
    uint32_t descriptors; ///< the first describing word; REGISTER_NOWHERE: they are in the slots
    uint32_t capacity;    ///< [bytes] of a slot's payload
    uint32_t stride;      ///< [bytes] from slot to slot
    uint32_t depth;       ///< slots: of a queue a power of two; 4 of a packet that is not queued
    uint32_t count;       ///< number of equal adjacent words; 1 except for words that are not queued
    int32_t interrupt;    ///< the line that a write raises, or -1
    RegisterDescriptor descriptor;
    RegisterOutside outside;
    uint32_t n_fields;
    const RegisterField *fields;
} RegisterLane;

/** A clock of its own rate (clock.h). */
typedef struct RegisterSlave {
    uint32_t address;
    int32_t interrupt; ///< the line that a pulse raises, or -1
    int64_t start;     ///< [ns] its time at simulated time 0
    int64_t pulse;     ///< [ns] of simulated time, from pulse to pulse
    int32_t drift;     ///< [ns/s] how much faster than simulated time it runs
    int32_t slew;      ///< [ns/s] how much faster or slower it runs while it is slewed
} RegisterSlave;

typedef struct RegisterBoard {
    const char *name;
    uint64_t hash;           ///< of what both sides must agree on: they must come from the same file
    uint64_t base;           ///< its address on the bus of flight's processor
    uint32_t size;           ///< [bytes]
    uint32_t big_endian;     ///< the order of its words
    uint32_t clock;          ///< address of the clock block, or REGISTER_NOWHERE
    int32_t clock_interrupt; ///< the line that a tick raises, or -1
    uint32_t interrupts;     ///< address of the interrupts' counters, or REGISTER_NOWHERE
    uint32_t n_interrupts;
    uint32_t level; ///< the interrupt of flight's processor that lines raise, but not a tick's; 0: as its machine says
    uint32_t n_lanes;
    const RegisterLane *lanes;
    const RegisterSlave *slave; ///< NULL: there is no slave clock
} RegisterBoard;

#ifdef __cplusplus
}
#endif

#endif
