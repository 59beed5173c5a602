/* SPDX-License-Identifier: Apache-2.0 */
#include "registers/message.h"

/* The CDR head: representation 00 00 big-endian or 00 01 little-endian, then two spare bytes. */
#define HEAD 4u
#define ORDER 1u

void register_message_reverse(const RegisterMessage *type, void *bytes)
{
    exec_reverse(type->runs, type->n_runs, bytes, 0u, type->size);
}

static int fits(const RegisterLane *lane, const RegisterMessage *type)
{
    return lane->form == REGISTER_MESSAGE && lane->capacity >= HEAD &&
           ((lane->flags & REGISTER_VARIABLE) != 0u ? type->size <= lane->capacity - HEAD
                                                    : type->size == lane->capacity - HEAD);
}

RegisterStatus register_put_message(const RegisterWindow *w, const RegisterLane *lane, const RegisterMessage *type,
                                    const void *message)
{
    const uint8_t head[HEAD] = {0u, (uint8_t)exec_little_endian(), 0u, 0u};
    if (!fits(lane, type)) {
        return REGISTER_SIZE;
    }
    return register_put_two(w, lane, head, HEAD, message, type->size, 0u);
}

RegisterStatus register_take_message(const RegisterWindow *w, const RegisterLane *lane, const RegisterMessage *type,
                                     void *message, RegisterInfo *info)
{
    uint8_t head[HEAD] = {0u, 0u, 0u, 0u};
    *info = (RegisterInfo){0u, 0u, 0u};
    if (!fits(lane, type)) {
        return REGISTER_SIZE;
    }
    const RegisterStatus status = register_take_two(w, lane, head, HEAD, message, type->size, info);
    if (status != REGISTER_OK && status != REGISTER_SAME) {
        return status;
    }
    if (info->n != HEAD + type->size || head[0] != 0u || head[ORDER] > 1u) {
        return REGISTER_CORRUPT;
    }
    if (head[ORDER] != exec_little_endian()) {
        register_message_reverse(type, message);
    }
    return status;
}
