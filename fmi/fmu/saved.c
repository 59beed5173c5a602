/* SPDX-License-Identifier: Apache-2.0 */
/* The state of an instance as bytes: a head, the instance's moment, and what the system saves. */
#include "fmi/fmu/fmu.h"

#include <stdlib.h>
#include <string.h>

typedef struct Saved {
    uint64_t format;
    uint64_t size; /* [bytes] with this head */
    uint64_t token;
    uint64_t check; /* of the bytes behind this head; in those alone that travel */
} Saved;

static const uint64_t format = 0x3145544154534d46u; /* FMSTATE1 */

/* FNV-1a */
static uint64_t hash(const void *bytes, size_t n)
{
    const uint8_t *p = bytes;
    uint64_t h = 14695981039346656037u;
    size_t i;
    for (i = 0u; i < n; ++i) {
        h = (h ^ p[i]) * 1099511628211u;
    }
    return h;
}

/* The system has a state from its first begin() on. */
static int begin(Fmu *f, const char *function)
{
    return fmu_may(f, function, FMU_ANY) && fmu_compute(f, function) && (f->begun || fmu_begin(f, function));
}

/* Read the head of a state of this instance or of another of the same FMU; 0: it is none. */
static int head_of(Fmu *f, const char *function, const void *state, Saved *head)
{
    if (state == NULL) {
        (void)fmu_refuse(f, FMU_FAILED, function, "there is no state");
        return 0;
    }
    memcpy(head, state, sizeof *head);
    if (head->format != format || head->token != hash(f->host.token, strlen(f->host.token))) {
        (void)fmu_refuse(f, FMU_FAILED, function, "the state is not of this FMU");
        return 0;
    }
    return 1;
}

static int make_room(Fmu *f, const char *function, void **state, size_t size)
{
    void *memory = realloc(*state, size);
    if (memory == NULL) {
        (void)fmu_refuse(f, FMU_FAILED, function, "there is no memory left for %zu bytes", size);
        return 0;
    }
    *state = memory;
    return 1;
}

FmuStatus fmu_save(Fmu *f, const char *function, void **state)
{
    Saved head = {format, 0u, 0u, 0u};
    uint8_t *bytes;
    if (!begin(f, function)) {
        return FMU_FAILED;
    }
    head.token = hash(f->host.token, strlen(f->host.token));
    head.size = sizeof head + f->moment_size + fmu_system.state_size(f->system);
    if (!make_room(f, function, state, (size_t)head.size)) {
        return FMU_FAILED;
    }
    bytes = *state;
    memcpy(bytes, &head, sizeof head);
    memcpy(bytes + sizeof head, f->moment, f->moment_size);
    return fmu_system.save(f->system, bytes + sizeof head + f->moment_size) == 0
               ? FMU_DONE
               : fmu_refuse(f, FMU_FAILED, function, "the state cannot be saved");
}

FmuStatus fmu_restore(Fmu *f, const char *function, const void *state)
{
    Saved head;
    const uint8_t *bytes = state;
    if (!begin(f, function) || !head_of(f, function, state, &head)) {
        return FMU_FAILED;
    }
    if (head.size < sizeof head + f->moment_size ||
        fmu_system.restore(f->system, bytes + sizeof head + f->moment_size,
                           (size_t)head.size - sizeof head - f->moment_size) != 0) {
        return fmu_refuse(f, FMU_FAILED, function, "the state cannot be restored");
    }
    memcpy(f->moment, bytes + sizeof head, f->moment_size);
    if (f->moment->phase == FMU_EVENTS && !f->event_mode) { /* of an instance that uses the event mode */
        f->moment->phase = FMU_STEPPING;
    }
    return FMU_DONE;
}

FmuStatus fmu_saved_size(Fmu *f, const char *function, const void *state, size_t *size)
{
    Saved head;
    if (!fmu_may(f, function, FMU_ANY) || !head_of(f, function, state, &head)) {
        return FMU_FAILED;
    }
    *size = (size_t)head.size;
    return FMU_DONE;
}

FmuStatus fmu_write_saved(Fmu *f, const char *function, const void *state, void *bytes, size_t size)
{
    Saved head;
    if (!fmu_may(f, function, FMU_ANY) || !head_of(f, function, state, &head)) {
        return FMU_FAILED;
    }
    if (size < head.size) {
        return fmu_refuse(f, FMU_FAILED, function, "the state has %zu bytes; there is room for %zu", (size_t)head.size,
                          size);
    }
    memcpy(bytes, state, (size_t)head.size);
    head.check = hash((const uint8_t *)state + sizeof head, (size_t)head.size - sizeof head);
    memcpy(bytes, &head, sizeof head);
    return FMU_DONE;
}

FmuStatus fmu_read_saved(Fmu *f, const char *function, const void *bytes, size_t size, void **state)
{
    Saved head;
    if (!fmu_may(f, function, FMU_ANY)) {
        return FMU_FAILED;
    }
    if (size < sizeof head) {
        return fmu_refuse(f, FMU_FAILED, function, "%zu bytes are no state", size);
    }
    if (!head_of(f, function, bytes, &head)) {
        return FMU_FAILED;
    }
    if (head.size < sizeof head || head.size > size ||
        head.check != hash((const uint8_t *)bytes + sizeof head, (size_t)head.size - sizeof head)) {
        return fmu_refuse(f, FMU_FAILED, function, "the bytes of the state are damaged");
    }
    if (!make_room(f, function, state, (size_t)head.size)) {
        return FMU_FAILED;
    }
    memcpy(*state, bytes, (size_t)head.size);
    return FMU_DONE;
}
