/* SPDX-License-Identifier: Apache-2.0 */
/* Getting and setting variables, clocks and packets. */
#include "fmi/fmu/fmu.h"

#include "flight/msg/head.h"

#include <string.h>

/* What a reference of a call names: elements of a variable, and their place among the importer's values. */
typedef struct Part {
    const FmuVariable *variable;
    uint32_t element, n; /* texts: 0, 1 */
    size_t at;
} Part;

static uint32_t references_of(const FmuVariable *v)
{
    return v->type == FLEDGE_CHAR ? 1u : v->n;
}

/* The variable with a reference, and which element of it; NULL: there is none. */
static const FmuVariable *find(const Fmu *f, uint32_t reference, uint32_t *element)
{
    const FmuVariable *variables = f->layout->variables;
    uint32_t low = 0u;
    uint32_t high = f->layout->n;
    while (low < high) {
        const uint32_t middle = low + (high - low) / 2u;
        if (variables[middle].reference <= reference) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    if (low == 0u) {
        return NULL;
    }
    *element = reference - variables[low - 1u].reference;
    return *element < (f->version == 2 ? references_of(&variables[low - 1u]) : 1u) ? &variables[low - 1u] : NULL;
}

static int is_number(FmuRole role)
{
    return role != FMU_CLOCK_MODE && role != FMU_CLOCK_EVENT && role != FMU_UPLINK && role != FMU_DOWNLINK;
}

/* The part of reference i of a call; *part is that of the reference before it. */
static int next_part(Fmu *f, const FmuCall *call, size_t i, Part *part)
{
    part->at += part->n;
    part->variable = find(f, call->references[i], &part->element);
    if (part->variable == NULL) {
        (void)fmu_refuse(f, FMU_FAILED, call->function, "no variable has the value reference %u", call->references[i]);
        return 0;
    }
    part->n = f->version == 2 ? 1u : references_of(part->variable);
    if (!is_number(part->variable->role) || (call->types >> part->variable->type & 1u) == 0u) {
        (void)fmu_refuse(f, FMU_FAILED, call->function, "the variable with the value reference %u has another type",
                         call->references[i]);
    } else if (part->n > call->n_values - part->at) {
        (void)fmu_refuse(f, FMU_FAILED, call->function, "%zu values are too few: there is none for reference %u",
                         call->n_values, call->references[i]);
    } else {
        return 1;
    }
    return 0;
}

static FmuStatus all_values(Fmu *f, const FmuCall *call, const Part *last)
{
    const size_t n = last->at + last->n;
    return n == call->n_values
               ? FMU_DONE
               : fmu_refuse(f, FMU_FAILED, call->function, "the variables have %zu values, not %zu", n, call->n_values);
}

/* Where the value of a variable stands, or a copy of it. */
static uint8_t *place_of(Fmu *f, const FmuVariable *v)
{
    switch (v->role) {
    case FMU_MODE: f->number = (uint32_t)(fmu_system.mode(f->system, v->block) + 1); return (uint8_t *)&f->number;
    case FMU_FIRED: f->number = fmu_system.fired(f->system, v->block); return (uint8_t *)&f->number;
    case FMU_REQUEST: return (uint8_t *)&f->request[v->block];
    case FMU_TIME: return (uint8_t *)&f->moment->time;
    default: return (uint8_t *)fmu_system.memory(f->system, v->block) + v->offset;
    }
}

static int is_set_by_importer(FmuRole role)
{
    return role == FMU_INPUT || role == FMU_PARAMETER || role == FMU_FIXED || role == FMU_REQUEST;
}

FmuStatus fmu_get(Fmu *f, const FmuCall *call, void *values)
{
    const size_t width = element_size(call->kind);
    Part part = {NULL, 0u, 0u, 0u};
    size_t i;
    uint32_t k;
    if (!fmu_may(f, call->function, FMU_ANY)) {
        return FMU_FAILED;
    }
    for (i = 0u; i < call->n; ++i) {
        const uint8_t *from;
        uint8_t *to;
        uint32_t size;
        if (!next_part(f, call, i, &part) ||
            (!is_set_by_importer(part.variable->role) && !fmu_compute(f, call->function))) {
            return FMU_FAILED;
        }
        from = place_of(f, part.variable);
        if (call->kind == FLEDGE_CHAR) {
            if (memchr(from, '\0', part.variable->n) == NULL) {
                return fmu_refuse(f, FMU_DISCARDED, call->function, "the text with the value reference %u has no end",
                                  call->references[i]);
            }
            ((const char **)values)[part.at] = (const char *)from;
            continue;
        }
        size = element_size(part.variable->type);
        from += (size_t)part.element * size;
        to = (uint8_t *)values + part.at * width;
        if (call->kind == part.variable->type) {
            memcpy(to, from, part.n * width);
            continue;
        }
        for (k = 0u; k < part.n; ++k) {
            element_write(call->kind, to + k * width, element_read(part.variable->type, from + k * size));
        }
    }
    return all_values(f, call, &part);
}

/* Of a number of a message: it has changed, or the importer sets its head. */
static void mark_message(Fmu *f, const FmuVariable *v)
{
    const uint32_t index = (uint32_t)(v - f->layout->variables);
    uint32_t i;
    for (i = 0u; i < f->layout->n_messages; ++i) {
        const FmuMessage *m = &f->layout->messages[i];
        if (index - m->first < m->n) {
            f->inputs[i] |= (uint8_t)(FMU_CHANGED | (v->offset - m->offset < sizeof(Head) ? FMU_OWN_HEAD : 0));
            return;
        }
    }
}

/* Write a number; 0: the type cannot have it. */
static int write_number(FledgeType type, uint8_t *to, double x)
{
    const double limit = 4503599627370496.0; /* 2^52: from here on a double is whole, and element_write() not exact */
    double written;
    if (type == FLEDGE_I64 && (x >= limit || x <= -limit) && x < 9.2e18 && x > -9.2e18) {
        const int64_t whole = (int64_t)x;
        memcpy(to, &whole, sizeof whole);
        return 1;
    }
    if (type == FLEDGE_U64 && x >= limit && x < 1.8e19) {
        const uint64_t whole = (uint64_t)x;
        memcpy(to, &whole, sizeof whole);
        return 1;
    }
    element_write(type, to, x);
    written = element_read(type, to);
    return type == FLEDGE_F32 || (written - x <= 0.5 && x - written <= 0.5);
}

/* Write the importer's numbers; 0: a variable's type cannot have one of them. */
static int write_numbers(const FmuCall *call, const Part *part, const uint8_t *from, uint8_t *to)
{
    const FledgeType type = part->variable->type;
    const size_t width = element_size(call->kind);
    const size_t size = element_size(type);
    uint32_t k;
    to += part->element * size;
    if (call->kind == type) {
        memcpy(to, from, part->n * width);
        return 1;
    }
    for (k = 0u; k < part->n; ++k) {
        if (!write_number(type, to + k * size, element_read(call->kind, from + k * width))) {
            return 0;
        }
    }
    return 1;
}

FmuStatus fmu_set(Fmu *f, const FmuCall *call, const void *values)
{
    Part part = {NULL, 0u, 0u, 0u};
    size_t i;
    if (!fmu_may(f, call->function, FMU_ANY & ~(uint32_t)FMU_TERMINATED)) {
        return FMU_FAILED;
    }
    for (i = 0u; i < call->n; ++i) {
        const FmuVariable *v;
        uint8_t *to;
        if (!next_part(f, call, i, &part)) {
            return FMU_FAILED;
        }
        v = part.variable;
        if (!is_set_by_importer(v->role) ||
            (v->role == FMU_FIXED && (f->moment->phase & (FMU_STEPPING | FMU_EVENTS)) != 0u)) {
            return fmu_refuse(f, FMU_FAILED, call->function,
                              v->role == FMU_FIXED
                                  ? "the parameter with the value reference %u is fixed after the start"
                                  : "the variable with the value reference %u is not an input",
                              call->references[i]);
        }
        if (v->role == FMU_PARAMETER || v->role == FMU_FIXED) {
            fmu_remember(f, v);
        }
        to = place_of(f, v);
        if (call->kind == FLEDGE_CHAR) {
            const char *text = ((const char *const *)values)[part.at];
            if (text == NULL || strlen(text) >= v->n) {
                return fmu_refuse(f, FMU_FAILED, call->function,
                                  "the text with the value reference %u has at most %u bytes, found \"%s\"",
                                  call->references[i], v->n - 1u, text != NULL ? text : "none");
            }
            memset(to, 0, v->n);
            memcpy(to, text, strlen(text));
        } else if (!write_numbers(call, &part, (const uint8_t *)values + part.at * element_size(call->kind), to)) {
            return fmu_refuse(f, FMU_FAILED, call->function, "a number is out of range for value reference %u",
                              call->references[i]);
        }
        if (v->role == FMU_INPUT) {
            mark_message(f, v);
        }
        f->moment->computed = 0u;
    }
    return all_values(f, call, &part);
}

/* ---- clocks and packets */

/* The variable of reference i of a call, which has the role `a` or `b`; NULL: it has another. */
static const FmuVariable *variable_of(Fmu *f, const FmuCall *call, size_t i, FmuRole a, FmuRole b)
{
    uint32_t element;
    const FmuVariable *v = find(f, call->references[i], &element);
    if (v == NULL || (v->role != a && v->role != b)) {
        (void)fmu_refuse(f, FMU_FAILED, call->function, "no variable of this kind has the value reference %u",
                         call->references[i]);
        return NULL;
    }
    return v;
}

FmuStatus fmu_get_clocks(Fmu *f, const FmuCall *call, bool *values)
{
    size_t i;
    if (!fmu_may(f, call->function, FMU_EVENTS)) {
        return FMU_FAILED;
    }
    for (i = 0u; i < call->n; ++i) {
        const FmuVariable *v = variable_of(f, call, i, FMU_CLOCK_MODE, FMU_CLOCK_EVENT);
        if (v == NULL) {
            return FMU_FAILED;
        }
        values[i] = fmu_ticked(f, v->role == FMU_CLOCK_MODE ? v->block : f->layout->n_processes + v->block) != 0;
    }
    return FMU_DONE;
}

FmuStatus fmu_get_packets(Fmu *f, const FmuCall *call, size_t *sizes, const uint8_t **values)
{
    static const uint8_t nothing[1] = {0u};
    size_t i;
    if (!fmu_may(f, call->function, FMU_ANY)) {
        return FMU_FAILED;
    }
    for (i = 0u; i < call->n; ++i) {
        const FmuVariable *v = variable_of(f, call, i, FMU_UPLINK, FMU_DOWNLINK);
        if (v == NULL || !fmu_compute(f, call->function)) {
            return FMU_FAILED;
        }
        sizes[i] = 0u;
        values[i] = v->role == FMU_DOWNLINK && f->begun ? fmu_system.downlink(f->system, &sizes[i]) : nothing;
    }
    return FMU_DONE;
}

FmuStatus fmu_set_packets(Fmu *f, const FmuCall *call, const size_t *sizes, const uint8_t *const *values)
{
    size_t i;
    if (!fmu_may(f, call->function, FMU_ANY & ~(uint32_t)FMU_TERMINATED)) {
        return FMU_FAILED;
    }
    for (i = 0u; i < call->n; ++i) {
        if (variable_of(f, call, i, FMU_UPLINK, FMU_UPLINK) == NULL) {
            return FMU_FAILED;
        }
        if (sizes[i] == 0u) {
            continue;
        }
        if ((f->moment->phase & (FMU_STEPPING | FMU_EVENTS)) == 0u) {
            return fmu_refuse(f, FMU_DISCARDED, call->function, "packets reach flight after its start alone");
        }
        if (fmu_system.uplink(f->system, values[i], sizes[i]) != 0) {
            return fmu_refuse(f, FMU_DISCARDED, call->function, "the packets cannot be sent");
        }
    }
    return FMU_DONE;
}
