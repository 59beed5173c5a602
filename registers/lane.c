/* SPDX-License-Identifier: Apache-2.0 */
#include "registers/lane.h"

#include <string.h>

/* How often a reader starts again when the writer of an overwriting queue overtakes it. */
#define ATTEMPTS 8

typedef struct Pieces {
    uint8_t *head;
    uint32_t n_head;
    uint8_t *bytes;
    uint32_t room;
} Pieces;

static uint32_t part(uint32_t word, uint32_t lsb, uint32_t bits)
{
    return bits == 0u ? 0u : (word >> lsb) & (UINT32_MAX >> (32u - bits));
}

static uint32_t placed(uint32_t value, uint32_t lsb, uint32_t bits)
{
    return bits == 0u ? 0u : (value & (UINT32_MAX >> (32u - bits))) << lsb;
}

static uint32_t slot_address(const RegisterLane *lane, uint32_t slot)
{
    return lane->address + REGISTER_CONTROL_SIZE + slot * lane->stride;
}

/* The describing word of a slot is in the slot, or in a separate ring. */
static uint32_t describing_address(const RegisterLane *lane, uint32_t slot)
{
    return lane->descriptors == REGISTER_NOWHERE ? slot_address(lane, slot) : lane->descriptors + 4u * slot;
}

/* Zeros fill the last word. */
static void store_payload(const RegisterWindow *w, uint32_t address, const uint8_t *bytes, uint32_t n)
{
    for (uint32_t i = 0u; i < n; i += 4u) {
        uint32_t v = 0u;
        memcpy(&v, bytes + i, n - i < 4u ? n - i : 4u);
        register_store_bytes(w, address + i, v);
    }
}

static void load_payload(const RegisterWindow *w, uint32_t address, uint8_t *bytes, uint32_t n)
{
    for (uint32_t i = 0u; i < n; i += 4u) {
        const uint32_t v = register_load_bytes(w, address + i);
        memcpy(bytes + i, &v, n - i < 4u ? n - i : 4u);
    }
}

static void count(const RegisterWindow *w, uint32_t address, uint32_t more)
{
    register_store(w, address, register_load(w, address) + more);
}

static void announce(const RegisterWindow *w, const RegisterLane *lane)
{
    if (lane->interrupt >= 0) {
        register_raise(w, (uint32_t)lane->interrupt);
    }
}

/* The slot of the next write. False: the queue is full. */
static int begin_writing(const RegisterWindow *w, const RegisterLane *lane, uint32_t *slot)
{
    if ((lane->flags & REGISTER_QUEUED) == 0u) {
        const uint32_t pair = (register_load(w, lane->address + REGISTER_READING) & 1u) ^ 1u;
        const uint32_t last = register_load(w, lane->address + REGISTER_SLOTS + 4u * pair) & 1u;
        *slot = 2u * pair + (last ^ 1u);
        return 1;
    }
    const uint32_t written = register_load(w, lane->address + REGISTER_WRITTEN);
    if ((lane->flags & REGISTER_OVERWRITE) != 0u) {
        register_store(w, lane->address + REGISTER_BEGUN, written + 1u);
    } else if (written - register_load(w, lane->address + REGISTER_TAKEN) >= lane->depth) {
        count(w, lane->address + REGISTER_LOST_WRITING, 1u);
        return 0;
    }
    *slot = written & (lane->depth - 1u);
    return 1;
}

/* The sequence number of the next write. In a lane that is not queued it is never 0, because 0 means: never written. */
static uint32_t next_sequence(const RegisterWindow *w, const RegisterLane *lane)
{
    const uint32_t next = register_load(w, lane->address + REGISTER_WRITTEN) + 1u;
    return next == 0u && (lane->flags & REGISTER_QUEUED) == 0u ? 1u : next;
}

static void end_writing(const RegisterWindow *w, const RegisterLane *lane, uint32_t slot)
{
    register_store(w, lane->address + REGISTER_WRITTEN, next_sequence(w, lane));
    if ((lane->flags & REGISTER_QUEUED) == 0u) {
        register_store(w, lane->address + REGISTER_SLOTS + 4u * (slot / 2u), slot & 1u);
        register_store(w, lane->address + REGISTER_LATEST, slot / 2u);
    }
    announce(w, lane);
}

RegisterStatus register_put_two(const RegisterWindow *w, const RegisterLane *lane, const void *head, uint32_t n_head,
                                const void *bytes, uint32_t n, uint32_t tag)
{
    const int variable = (lane->flags & REGISTER_VARIABLE) != 0u;
    uint32_t slot;
    if (lane->form == REGISTER_WORD || n_head % 4u != 0u || n_head > lane->capacity || n > lane->capacity - n_head ||
        (!variable && n_head + n != lane->capacity)) {
        return REGISTER_SIZE;
    }
    if (!begin_writing(w, lane, &slot)) {
        return REGISTER_FULL;
    }
    const RegisterDescriptor *d = &lane->descriptor;
    const uint32_t describing = placed(n_head + n, d->length_lsb, d->length_bits) |
                                placed(tag, d->tag_lsb, d->tag_bits) | placed(1u, d->valid_lsb, d->valid_bits);
    const uint32_t address = slot_address(lane, slot);
    register_store(w, describing_address(lane, slot), describing);
    register_store(w, address + 4u, next_sequence(w, lane));
    store_payload(w, address + REGISTER_SLOT_HEAD, head, n_head);
    store_payload(w, address + REGISTER_SLOT_HEAD + n_head, bytes, n);
    end_writing(w, lane, slot);
    return REGISTER_OK;
}

RegisterStatus register_put(const RegisterWindow *w, const RegisterLane *lane, const void *bytes, uint32_t n,
                            uint32_t tag)
{
    return register_put_two(w, lane, 0, 0u, bytes, n, tag);
}

/* Copy the content of a slot, if the buffers are large enough. */
static RegisterStatus copy_slot(const RegisterWindow *w, const RegisterLane *lane, uint32_t slot, const Pieces *to,
                                RegisterInfo *info)
{
    const RegisterDescriptor *d = &lane->descriptor;
    const uint32_t address = slot_address(lane, slot) + REGISTER_SLOT_HEAD;
    const uint32_t describing = register_load(w, describing_address(lane, slot));
    info->sequence = register_load(w, address - 4u);
    info->tag = part(describing, d->tag_lsb, d->tag_bits);
    info->n =
        (lane->flags & REGISTER_VARIABLE) != 0u ? part(describing, d->length_lsb, d->length_bits) : lane->capacity;
    if (info->n > lane->capacity) {
        return REGISTER_CORRUPT;
    }
    const uint32_t head = info->n < to->n_head ? info->n : to->n_head;
    if (info->n - head > to->room) {
        return REGISTER_SIZE;
    }
    load_payload(w, address, to->head, head);
    load_payload(w, address + head, to->bytes, info->n - head);
    return REGISTER_OK;
}

static RegisterStatus take_latest(const RegisterWindow *w, const RegisterLane *lane, const Pieces *to,
                                  RegisterInfo *info)
{
    const uint32_t pair = register_load(w, lane->address + REGISTER_LATEST) & 1u;
    register_store(w, lane->address + REGISTER_READING, pair);
    const uint32_t last = register_load(w, lane->address + REGISTER_SLOTS + 4u * pair) & 1u;
    const uint32_t slot = 2u * pair + last;
    if (register_load(w, slot_address(lane, slot) + 4u) == 0u) {
        return REGISTER_EMPTY;
    }
    const RegisterStatus status = copy_slot(w, lane, slot, to, info);
    if (status != REGISTER_OK) {
        return status;
    }
    const uint32_t before = register_load(w, lane->address + REGISTER_TAKEN);
    register_store(w, lane->address + REGISTER_TAKEN, info->sequence);
    return info->sequence == before ? REGISTER_SAME : REGISTER_OK;
}

static void give_up(const RegisterWindow *w, const RegisterLane *lane, uint32_t *taken, uint32_t n)
{
    *taken += n;
    count(w, lane->address + REGISTER_LOST_READING, n);
    register_store(w, lane->address + REGISTER_TAKEN, *taken);
}

/* Take the first packet of a queue, or with `word` the first word. */
static RegisterStatus take_front(const RegisterWindow *w, const RegisterLane *lane, const Pieces *to,
                                 RegisterInfo *info, uint32_t *word)
{
    const int overwrite = (lane->flags & REGISTER_OVERWRITE) != 0u;
    uint32_t taken = register_load(w, lane->address + REGISTER_TAKEN);
    for (int attempt = 0; attempt < ATTEMPTS; attempt++) {
        const uint32_t waiting = register_load(w, lane->address + REGISTER_WRITTEN) - taken;
        RegisterStatus status = REGISTER_OK;
        if (waiting == 0u) {
            return attempt == 0 ? REGISTER_EMPTY : REGISTER_BUSY;
        }
        if (waiting > lane->depth) {
            give_up(w, lane, &taken, waiting - lane->depth);
        }
        const uint32_t slot = taken & (lane->depth - 1u);
        if (word) {
            *word = register_load(w, slot_address(lane, slot));
        } else {
            status = copy_slot(w, lane, slot, to, info);
        }
        /* The writer has overwritten the slot if it has begun number taken + depth. */
        if (overwrite && register_load(w, lane->address + REGISTER_BEGUN) - taken > lane->depth) {
            give_up(w, lane, &taken, 1u);
            continue;
        }
        if (status == REGISTER_CORRUPT) {
            give_up(w, lane, &taken, 1u);
            return status;
        }
        if (status != REGISTER_OK) {
            return status;
        }
        if (lane->descriptors != REGISTER_NOWHERE && !overwrite) {
            const uint32_t address = describing_address(lane, slot);
            const RegisterDescriptor *d = &lane->descriptor;
            register_store(w, address, register_load(w, address) & ~placed(1u, d->valid_lsb, d->valid_bits));
        }
        register_store(w, lane->address + REGISTER_TAKEN, taken + 1u);
        return REGISTER_OK;
    }
    return REGISTER_BUSY;
}

RegisterStatus register_take_two(const RegisterWindow *w, const RegisterLane *lane, void *head, uint32_t n_head,
                                 void *bytes, uint32_t room, RegisterInfo *info)
{
    const Pieces to = {head, n_head, bytes, room};
    *info = (RegisterInfo){0u, 0u, 0u};
    if (lane->form == REGISTER_WORD || n_head % 4u != 0u) {
        return REGISTER_SIZE;
    }
    return (lane->flags & REGISTER_QUEUED) != 0u ? take_front(w, lane, &to, info, 0) : take_latest(w, lane, &to, info);
}

RegisterStatus register_take(const RegisterWindow *w, const RegisterLane *lane, void *bytes, uint32_t room,
                             RegisterInfo *info)
{
    return register_take_two(w, lane, 0, 0u, bytes, room, info);
}

RegisterStatus register_put_word(const RegisterWindow *w, const RegisterLane *lane, uint32_t index, uint32_t value)
{
    uint32_t slot;
    if (lane->form != REGISTER_WORD || index >= lane->count) {
        return REGISTER_SIZE;
    }
    if ((lane->flags & REGISTER_QUEUED) == 0u) {
        register_store(w, lane->address + 4u * index, value);
        announce(w, lane);
        return REGISTER_OK;
    }
    if (!begin_writing(w, lane, &slot)) {
        return REGISTER_FULL;
    }
    register_store(w, slot_address(lane, slot), value);
    end_writing(w, lane, slot);
    return REGISTER_OK;
}

RegisterStatus register_take_word(const RegisterWindow *w, const RegisterLane *lane, uint32_t index, uint32_t *value)
{
    if (lane->form != REGISTER_WORD || index >= lane->count) {
        return REGISTER_SIZE;
    }
    if ((lane->flags & REGISTER_QUEUED) != 0u) {
        return take_front(w, lane, 0, 0, value);
    }
    *value = register_load(w, lane->address + 4u * index);
    return REGISTER_OK;
}

RegisterStatus register_next_tag(const RegisterWindow *w, const RegisterLane *lane, uint32_t *tag)
{
    uint32_t taken = register_load(w, lane->address + REGISTER_TAKEN);
    const uint32_t waiting = register_load(w, lane->address + REGISTER_WRITTEN) - taken;
    if (waiting == 0u) {
        return REGISTER_EMPTY;
    }
    taken += waiting > lane->depth ? waiting - lane->depth : 0u;
    const RegisterDescriptor *d = &lane->descriptor;
    *tag = part(register_load(w, describing_address(lane, taken & (lane->depth - 1u))), d->tag_lsb, d->tag_bits);
    return REGISTER_OK;
}

static int is_plain_word(const RegisterLane *lane)
{
    return lane->form == REGISTER_WORD && (lane->flags & REGISTER_QUEUED) == 0u;
}

uint32_t register_waiting(const RegisterWindow *w, const RegisterLane *lane)
{
    if (is_plain_word(lane)) {
        return 0u;
    }
    const uint32_t waiting =
        register_load(w, lane->address + REGISTER_WRITTEN) - register_load(w, lane->address + REGISTER_TAKEN);
    const uint32_t most = (lane->flags & REGISTER_QUEUED) != 0u ? lane->depth : 1u;
    return waiting < most ? waiting : most;
}

uint32_t register_lost(const RegisterWindow *w, const RegisterLane *lane)
{
    if (is_plain_word(lane)) {
        return 0u;
    }
    return register_load(w, lane->address + REGISTER_LOST_WRITING) +
           register_load(w, lane->address + REGISTER_LOST_READING);
}

/* Each interrupt line has two words: how often it was raised, and how often handled. */
void register_raise(const RegisterWindow *w, uint32_t line)
{
    if (line < w->board->n_interrupts) {
        count(w, w->board->interrupts + 8u * line, 1u);
        if (w->ring) {
            w->ring(w->user, line);
        }
    }
}

uint32_t register_interrupts(const RegisterWindow *w, uint32_t line)
{
    const uint32_t address = w->board->interrupts + 8u * line;
    return line < w->board->n_interrupts ? register_load(w, address) - register_load(w, address + 4u) : 0u;
}

uint32_t register_handle(const RegisterWindow *w, uint32_t line)
{
    const uint32_t pending = register_interrupts(w, line);
    if (pending > 0u) {
        count(w, w->board->interrupts + 8u * line + 4u, pending);
    }
    return pending;
}
