/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/services/requirement_monitor.h"

#include "flight/exec/condition.h"
#include "flight/math/elementary.h"

#include <float.h>
#include <math.h>
#include <string.h>

/* ---- what operations need */

/* How many operands and results an operation has, and how many numbers it remembers. */
typedef struct Shape {
    uint8_t vectors;          /* operands of n numbers */
    uint8_t numbers;          /* operands besides */
    uint8_t margins;          /* operands */
    uint8_t vector;           /* 1: the result has n numbers, */
    uint8_t result;           /* and so many besides */
    uint8_t margin;           /* 1: the result is a margin */
    uint8_t memory, for_each; /* numbers; for each of `last` samples */
} Shape;

static const Shape shapes[FORMULA_MODE + 1] = {
    [FORMULA_READ] = {.vector = 1},
    [FORMULA_CONSTANT] = {.result = 1},
    [FORMULA_ELEMENT] = {.vectors = 1, .result = 1},
    [FORMULA_NORM] = {.vectors = 1, .result = 1},
    [FORMULA_MAX_ABS] = {.vectors = 1, .result = 1},
    [FORMULA_MAGNITUDE] = {.vectors = 1, .vector = 1},
    [FORMULA_SUM] = {.vectors = 2, .vector = 1},
    [FORMULA_DIFFERENCE] = {.vectors = 2, .vector = 1},
    [FORMULA_SCALED] = {.vectors = 1, .vector = 1},
    [FORMULA_ANGLE] = {.numbers = 6, .result = 1},
    [FORMULA_TURNED] = {.numbers = 6, .result = 3},
    [FORMULA_COMPARE] = {.numbers = 1, .margin = 1},
    [FORMULA_CLOCK] = {.margin = 1},
    [FORMULA_NOT] = {.margins = 1, .margin = 1},
    [FORMULA_AND] = {.margins = 2, .margin = 1},
    [FORMULA_OR] = {.margins = 2, .margin = 1},
    [FORMULA_FIRST] = {.margins = 1, .margin = 1, .memory = 2},
    [FORMULA_DELAY] = {.margins = 1, .margin = 1, .for_each = 2},
    [FORMULA_ONCE] = {.margins = 1, .margin = 1, .memory = 2},
    [FORMULA_BEGINS] = {.margins = 1, .margin = 1, .memory = 2},
    [FORMULA_ALWAYS] = {.margins = 1, .margin = 1, .for_each = 4},
    [FORMULA_UNTIL] = {.margins = 2, .margin = 1, .for_each = 4},
    [FORMULA_ALWAYS_SO_FAR] = {.margins = 1, .margin = 1, .memory = 2},
    [FORMULA_UNTIL_SO_FAR] = {.margins = 2, .margin = 1, .memory = 4},
    [FORMULA_MODE] = {.result = 1},
};

/* ---- margins */

typedef struct Margin {
    double low, high;
} Margin;

static const Margin unknown = {-INFINITY, INFINITY}, true_now = {INFINITY, INFINITY},
                    false_now = {-INFINITY, -INFINITY};

static Margin inverse(Margin a)
{
    return (Margin){-a.high, -a.low};
}

static Margin least(Margin a, Margin b)
{
    return (Margin){b.low < a.low ? b.low : a.low, b.high < a.high ? b.high : a.high};
}

static Margin greatest(Margin a, Margin b)
{
    return (Margin){b.low > a.low ? b.low : a.low, b.high > a.high ? b.high : a.high};
}

static Margin load(const double *memory)
{
    return (Margin){memory[0], memory[1]};
}

static void store(double *memory, Margin a)
{
    memory[0] = a.low;
    memory[1] = a.high;
}

/* How far a number is from the other side of a limit; never 0, so that its sign says whether the relation holds. */
static double distance(uint32_t relation, double x, double limit)
{
    const double tiny = 0x1p-1074; /* the least above 0 */
    const int equal = x == limit;
    switch (relation) {
    case EXEC_LESS: return equal ? -tiny : limit - x;
    case EXEC_LESS_EQUAL: return equal ? tiny : limit - x;
    case EXEC_GREATER: return equal ? -tiny : x - limit;
    case EXEC_GREATER_EQUAL: return equal ? tiny : x - limit;
    case EXEC_EQUAL: return equal ? INFINITY : -INFINITY;
    default: return equal ? -INFINITY : INFINITY;
    }
}

static Margin compared(const FormulaNode *node, double x)
{
    if (x != x) {
        return unknown;
    }
    const double by = distance(node->first, x, node->number), scaled = by / node->scale;
    const double margin = scaled == 0.0 ? by : scaled;
    return (Margin){margin, margin};
}

/* ---- numbers */

static double norm(const double *a, uint32_t n)
{
    double sum = 0.0;
    for (uint32_t i = 0u; i < n; i++) {
        sum += a[i] * a[i];
    }
    return fm_sqrt(sum);
}

static double magnitude(double x)
{
    return x < 0.0 ? -x : x + 0.0; /* of -0, too */
}

static double max_abs(const double *a, uint32_t n)
{
    double most = 0.0;
    for (uint32_t i = 0u; i < n; i++) {
        const double size = magnitude(a[i]);
        most = size != size || size > most ? size : most;
    }
    return most;
}

static void cross(const double *a, const double *b, double *c)
{
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}

static double angle(const double *a, const double *b)
{
    double c[3];
    cross(a, b, c);
    return fm_atan2(norm(c, 3u), a[0] * b[0] + a[1] * b[1] + a[2] * b[2]);
}

/* v + (8 s x (s x v) - 4 (1 - s.s) s x v) / (1 + s.s)^2 */
static void turn(const double *s, const double *v, double *to)
{
    const double s2 = s[0] * s[0] + s[1] * s[1] + s[2] * s[2];
    const double by = 1.0 / ((1.0 + s2) * (1.0 + s2));
    double c[3], cc[3];
    cross(s, v, c);
    cross(s, c, cc);
    for (uint32_t i = 0u; i < 3u; i++) {
        to[i] = v[i] + (8.0 * cc[i] - 4.0 * (1.0 - s2) * c[i]) * by;
    }
}

/* Numbers of an output. Returns 0 if they are not there. */
static int read(const FormulaNode *node, const CommandContext *context, double *to)
{
    uint32_t size = 0u;
    const void *output = node->output < context->table->n_outputs
                             ? context->table->services->output(context->mission, (uint16_t)node->output, &size)
                             : NULL;
    if (element_span(node->type, node->offset, node->n, size) == 0u) {
        return 0;
    }
    Head head;
    memcpy(&head, output, sizeof head);
    const int known = node->first == 0u || head.quality > QUALITY_STALE;
    const uint8_t *p = (const uint8_t *)output + node->offset;
    for (uint32_t i = 0u; i < node->n; i++, p += element_size((FledgeType)node->type)) {
        to[i] = known ? element_read((FledgeType)node->type, p) : NAN;
    }
    return 1;
}

/* ---- a formula at a sample */

typedef struct Stack {
    double numbers[FORMULA_NUMBERS];
    Margin margins[FORMULA_VALUES];
    uint32_t n, n_margins;
} Stack;

/* Whether a node finds its operands, room for its results, and its memory. */
static int fits(const FormulaNode *node, const Stack *stack)
{
    if ((uint32_t)node->operation == 0u || (uint32_t)node->operation >= sizeof shapes / sizeof shapes[0] ||
        node->n > (uint32_t)FORMULA_VECTOR || node->place > (uint32_t)FORMULA_MEMORY) {
        return 0;
    }
    const Shape *shape = &shapes[node->operation];
    const uint32_t taken = shape->vectors * node->n + shape->numbers;
    const uint32_t given = shape->vector * node->n + shape->result;
    const uint32_t each = shape->for_each > 0u ? node->last : 1u; /* that remember a window need one */
    return taken <= stack->n && stack->n - taken + given <= (uint32_t)FORMULA_NUMBERS &&
           shape->margins <= stack->n_margins &&
           stack->n_margins - shape->margins + shape->margin <= (uint32_t)FORMULA_VALUES && each >= 1u &&
           each <= (uint32_t)FORMULA_MEMORY &&
           shape->memory + shape->for_each * each <= (uint32_t)FORMULA_MEMORY - node->place;
}

/* What an operation remembers before the first sample. */
static void begin(const FormulaNode *node, double *memory)
{
    switch (node->operation) {
    case FORMULA_FIRST: store(memory, unknown); break;
    case FORMULA_ONCE:
    case FORMULA_BEGINS: store(memory, false_now); break;
    case FORMULA_ALWAYS:
        for (uint32_t i = 0u; i < 4u * node->last; i++) {
            memory[i] = INFINITY;
        }
        break;
    case FORMULA_ALWAYS_SO_FAR: store(memory, true_now); break;
    case FORMULA_UNTIL_SO_FAR:
        store(memory, false_now);
        store(memory + 2, true_now);
        break;
    default: break;
    }
}

/* The least of a window, as a tree of pairs whose root is 1 and whose leaves begin at the window's size: a change costs
 * as many comparisons as the tree is high. */
static void change(double *tree, uint32_t size, uint32_t leaf, double value)
{
    uint32_t i = size + leaf;
    tree[i] = value;
    for (i /= 2u; i > 0u; i /= 2u) {
        tree[i] = tree[2u * i + 1u] < tree[2u * i] ? tree[2u * i + 1u] : tree[2u * i];
    }
}

static Margin until(const double *ring, uint32_t size, uint32_t first)
{
    Margin found = false_now, before = true_now;
    for (uint32_t i = 0u; i < size; i++) {
        const double *sample = ring + (size_t)4u * ((first + i) % size);
        found = greatest(found, least(load(sample + 2), before));
        before = least(before, load(sample));
    }
    return found;
}

/* An operation that remembers, at the sample; come: of its operands there is a sample, of this number. */
static Margin remembered(const FormulaNode *node, double *memory, const Margin *operands, int come, uint32_t number)
{
    const Margin a = operands[0];
    Margin found = unknown;
    switch (node->operation) {
    case FORMULA_FIRST:
        if (come && number == 0u) {
            store(memory, a);
        }
        return load(memory);
    case FORMULA_DELAY:
        memory += (size_t)2u * (number % node->last);
        found = load(memory);
        store(memory, a);
        return found;
    case FORMULA_ONCE:
        if (come) {
            store(memory, greatest(load(memory), a));
        }
        return load(memory);
    case FORMULA_BEGINS:
        found = least(a, inverse(load(memory)));
        if (come) {
            store(memory, a);
        }
        return found;
    case FORMULA_ALWAYS:
        found = (Margin){memory[1], memory[2u * node->last + 1u]};
        if (come) {
            change(memory, node->last, number % node->last, a.low);
            change(memory + (size_t)2u * node->last, node->last, number % node->last, a.high);
        }
        return found;
    case FORMULA_UNTIL:
        found = until(memory, node->last, number % node->last);
        if (come) {
            memory += (size_t)4u * (number % node->last);
            store(memory, a);
            store(memory + 2, operands[1]);
        }
        return found;
    case FORMULA_ALWAYS_SO_FAR:
        if (come && number >= node->first && number <= node->last) {
            store(memory, least(load(memory), a));
        }
        found = load(memory);
        if (!come || number <= node->last) {
            found.low = -INFINITY;
        }
        return found;
    default: /* FORMULA_UNTIL_SO_FAR */
        if (come && number <= node->last) {
            store(memory, greatest(load(memory), least(operands[1], load(memory + 2))));
            store(memory + 2, least(load(memory + 2), a));
        }
        found = load(memory);
        if ((!come || number <= node->last) && memory[3] > found.high) {
            found.high = memory[3];
        }
        return found;
    }
}

/* The margin of a formula of margins. */
static Margin joined(const FormulaNode *node, double *memory, const Stack *stack, const Margin *operands, int64_t t,
                     uint32_t sample)
{
    switch (node->operation) {
    case FORMULA_COMPARE: return compared(node, stack->numbers[stack->n]);
    case FORMULA_CLOCK: return t >= node->time ? true_now : false_now;
    case FORMULA_NOT: return inverse(operands[0]);
    case FORMULA_AND: return least(operands[0], operands[1]);
    case FORMULA_OR: return greatest(operands[0], operands[1]);
    default: break;
    }
    if (sample == 0u) {
        begin(node, memory);
    }
    return remembered(node, memory, operands, sample >= node->delay, sample - node->delay);
}

/* The numbers of an operation, from its operands, in whose place they stand. Returns 0 if they are not there. */
static int computed(const FormulaNode *node, const CommandContext *context, double *a)
{
    const uint32_t n = node->n;
    const double *b = a + n;
    switch (node->operation) {
    case FORMULA_READ: return read(node, context, a);
    case FORMULA_CONSTANT: a[0] = node->number; break;
    case FORMULA_MODE:
        if (context->table->mode == NULL) {
            return 0;
        }
        a[0] = context->table->mode(context->mission);
        break;
    case FORMULA_ELEMENT:
        if (node->first >= n) {
            return 0;
        }
        a[0] = a[node->first];
        break;
    case FORMULA_NORM: a[0] = norm(a, n); break;
    case FORMULA_MAX_ABS: a[0] = max_abs(a, n); break;
    case FORMULA_ANGLE: a[0] = angle(a, a + 3); break;
    case FORMULA_TURNED: turn(a, a + 3, a); break;
    default:
        for (uint32_t i = 0u; i < n; i++) {
            a[i] = node->operation == FORMULA_MAGNITUDE ? magnitude(a[i])
                   : node->operation == FORMULA_SUM     ? a[i] + b[i]
                   : node->operation == FORMULA_SCALED  ? node->number * a[i]
                                                        : a[i] - b[i];
        }
        break;
    }
    return 1;
}

/* Returns 0 if the formula is none. */
static int evaluate(RequirementMonitor *m, const FlownRequirement *requirement, const CommandContext *context,
                    uint32_t sample, Margin *margin)
{
    Stack stack = {.n = 0u};
    for (uint32_t i = 0u; i < requirement->n; i++) {
        const FormulaNode *node = &m->par.nodes[requirement->first + i];
        if (!fits(node, &stack)) {
            return 0;
        }
        const Shape *shape = &shapes[node->operation];
        stack.n -= shape->vectors * node->n + shape->numbers;
        stack.n_margins -= shape->margins;
        if (shape->margin != 0u) {
            Margin *operands = &stack.margins[stack.n_margins];
            *operands = joined(node, &m->mem.memory[node->place], &stack, operands, m->mem.last, sample);
        } else if (!computed(node, context, &stack.numbers[stack.n])) {
            return 0;
        }
        stack.n += shape->vector * node->n + shape->result;
        stack.n_margins += shape->margin;
    }
    *margin = stack.margins[0];
    return stack.n == 0u && stack.n_margins == 1u;
}

/* ---- requirements */

/* What outputs, and memory that a script takes along, may say: an infinite margin is the largest number. */
static double bounded(double x)
{
    return x > DBL_MAX ? DBL_MAX : x < -DBL_MAX ? -DBL_MAX : x;
}

static void publish(RequirementMonitor *m, int64_t t, RequirementMonitorEventId id, EventSeverity severity,
                    uint32_t place, double margin)
{
    event_publish(&m->out.event, t,
                  (FlightEvent){.id = id,
                                .severity = severity,
                                .arguments = {place, margin, tick_seconds(m->mem.sampled[place])}});
}

static void forget(RequirementMonitor *m, uint32_t place)
{
    m->mem.low[place] = -DBL_MAX;
    m->mem.high[place] = DBL_MAX;
    m->mem.sampled[place] = -1;
    m->mem.samples[place] = 0u;
}

/* Take the outputs that the last instant left as a sample of a requirement. */
static void judge(RequirementMonitor *m, uint32_t place, const CommandContext *context)
{
    const FlownRequirement *requirement = &m->par.requirements[place];
    const uint32_t bit = 1u << place, was_bad = m->mem.bad & bit;
    if (requirement->on == 0u) {
        forget(m, place);
        m->mem.bad &= ~bit;
        return;
    }
    const int is_formula = requirement->every > 0 && requirement->first <= (uint32_t)FORMULA_NODES &&
                           requirement->n <= (uint32_t)FORMULA_NODES - requirement->first;
    if (is_formula && m->mem.last % requirement->every != 0) {
        return;
    }
    if (m->mem.samples[place] == UINT32_MAX ||
        (m->mem.samples[place] > 0u && tick_since(m->mem.last, m->mem.sampled[place]) != requirement->every)) {
        forget(m, place);
        publish(m, context->t, REQUIREMENT_MONITOR_ANEW, EVENT_LOW, place, 0.0);
    }
    Margin margin = unknown;
    if (!is_formula || !evaluate(m, requirement, context, m->mem.samples[place], &margin)) {
        forget(m, place);
        m->mem.bad |= bit;
        if (was_bad == 0u) {
            publish(m, context->t, REQUIREMENT_MONITOR_BAD, EVENT_LOW, place, 0.0);
        }
        return;
    }
    const Margin before = {m->mem.low[place], m->mem.high[place]};
    m->mem.bad &= ~bit;
    m->mem.low[place] = bounded(margin.low);
    m->mem.high[place] = bounded(margin.high);
    m->mem.sampled[place] = m->mem.last;
    m->mem.samples[place]++;
    if (margin.high < 0.0 && before.high >= 0.0) {
        publish(m, context->t, REQUIREMENT_MONITOR_VIOLATED, EVENT_MEDIUM, place, m->mem.high[place]);
    } else if (margin.low > 0.0 && before.low <= 0.0) {
        publish(m, context->t, REQUIREMENT_MONITOR_HOLDS, EVENT_INFO, place, m->mem.low[place]);
    }
}

static void write_state(RequirementMonitor *m, int64_t t)
{
    RequirementState *s = &m->out.state;
    s->on = s->holding = s->violated = 0u;
    for (uint32_t i = 0u; i < REQUIREMENTS; i++) {
        s->low[i] = m->mem.low[i];
        s->high[i] = m->mem.high[i];
        s->sampled[i] = m->mem.sampled[i];
        s->on |= (m->par.requirements[i].on != 0u ? 1u : 0u) << i;
        s->holding |= (m->mem.low[i] > 0.0 ? 1u : 0u) << i;
        s->violated |= (m->mem.high[i] < 0.0 ? 1u : 0u) << i;
    }
    s->bad = m->mem.bad;
    s->head = head_next(s->head, t, m->mem.bad != 0u ? QUALITY_DEGRADED : QUALITY_GOOD);
}

/* ---- what it has for flight */

static uint32_t take(const CommandContext *context, void *module, uint8_t *packet, CommandReport *report)
{
    RequirementMonitor *m = module;
    (void)packet;
    (void)report;
    if (context->t < m->mem.last) { /* time begins anew */
        requirement_monitor_reset(m);
    }
    if (m->mem.last >= 0 && context->t > m->mem.last) {
        for (uint32_t i = 0u; i < REQUIREMENTS; i++) {
            judge(m, i, context);
        }
        write_state(m, context->t);
    }
    m->mem.last = context->t;
    return 0u;
}

static int64_t next(const void *module)
{
    const RequirementMonitor *m = module;
    for (uint32_t i = 0u; i < REQUIREMENTS; i++) {
        if (m->par.requirements[i].on != 0u) {
            return 0; /* at each instant */
        }
    }
    return INT64_MAX;
}

const CommandService requirement_monitor_service = {.take = take, .next = next};

/* ---- the module */

void requirement_monitor_reset(RequirementMonitor *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
    for (uint32_t i = 0u; i < REQUIREMENTS; i++) {
        forget(m, i);
    }
    m->mem.last = -1;
}

void requirement_monitor_update(RequirementMonitor *m, Tick t)
{
    write_state(m, t.t);
}
