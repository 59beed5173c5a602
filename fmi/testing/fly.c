/* SPDX-License-Identifier: Apache-2.0 */
/* Flies FMUs by a plan: fly PLAN. It prints for each communication point its number and a hash (FNV-1a) of all that was
 * hashed until then. At each point the FMUs step in their order, and each hands its outputs over before the next one
 * steps (Gauss-Seidel). The plan's words, a line each; an FMU is its place in the plan from 0, a time a number of
 * steps:
 *
 *     fmu VERSION EVENTS NAME LIBRARY TOKEN RESOURCES
 *     steps N SECONDS                     N steps of this size
 *     sets N                              of instances of all FMUs, which fly side by side
 *     states N SEED                       at N random points go back, and on by a copy of the state
 *     at TIME FMU REFERENCE TYPE N VALUES before the step; -1: before initialization
 *     feed FMU REFERENCE TYPE N           from the file of feeds: of each point its elements, in this order
 *     feeds FILE
 *     wire FMU REFERENCE TYPE N FMU REFERENCE
 *     hash FMU REFERENCE TYPE N
 *     show FMU REFERENCE TYPE N           its last values, at the end
 *     clock FMU REFERENCE                 how often it ticked, at the end
 */
#include "fmi/testing/importer.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

enum { FMUS = 8, SETS = 4, ROWS = 20000, BYTES = 4096 * 8 };

typedef struct Row {
    int fmu, to_fmu;
    long at;
    ImporterVariable v, to;
    unsigned char *values; ///< that are set
    unsigned ticks;
} Row;

typedef struct Rows {
    Row *rows;
    size_t n;
} Rows;

typedef struct Plan {
    ImporterFmu fmus[FMUS];
    int n_fmus, n_sets;
    long steps, states;
    double step;
    uint32_t seed;
    unsigned char *feeds;
    size_t fed; ///< [bytes] of a point
    int again;  ///< it flies a part once more: clocks are not counted
    Rows at, feed, wire, hash, show, clock;
} Plan;

typedef struct Set {
    ImporterFmu fmus[FMUS];
    uint64_t hash;
} Set;

static Plan plan;
static Set sets[SETS];

static int stop(const char *what, const char *which)
{
    fprintf(stderr, "fly: %s %s\n", what, which);
    exit(2);
}

/* ---- the plan */

static FledgeType type_of(const char *name)
{
    static const char *const names[] = {"f64", "f32", "i8",  "u8",  "i16",  "u16",
                                        "i32", "u32", "i64", "u64", "char", "enum"};
    for (int i = 0; i <= (int)FLEDGE_ENUM; i++) {
        if (strcmp(name, names[i]) == 0) {
            return (FledgeType)i;
        }
    }
    return (FledgeType)stop("there is no type", name);
}

static char *next(void)
{
    char *word = strtok(NULL, " \n");
    return word != NULL ? word : (stop("a line is", "too short"), word);
}

static long number(void)
{
    return strtol(next(), NULL, 10);
}

static ImporterVariable variable(void)
{
    ImporterVariable v;
    v.reference = (uint32_t)number();
    v.type = type_of(next());
    v.n = (uint32_t)number();
    return v;
}

/* Numbers; "" of a text is written as "". */
static unsigned char *values_of(ImporterVariable v)
{
    unsigned char *values = calloc(1u, importer_bytes(v) + 1u);
    if (v.type == FLEDGE_CHAR) {
        const char *text = next();
        strncpy((char *)values, strcmp(text, "\"\"") == 0 ? "" : text, v.n);
        return values;
    }
    for (uint32_t i = 0u; i < v.n; i++) {
        element_write(v.type, values + i * element_size(v.type), strtod(next(), NULL));
    }
    return values;
}

static unsigned char *contents(const char *path)
{
    FILE *file = fopen(path, "rb");
    if (file == NULL || fseek(file, 0, SEEK_END) != 0) {
        stop("there is no file", path);
    }
    const long n = ftell(file);
    unsigned char *bytes = calloc(1u, (size_t)n + 1u);
    rewind(file);
    if (fread(bytes, 1u, (size_t)n, file) != (size_t)n) {
        stop("cannot read", path);
    }
    fclose(file);
    return bytes;
}

static Row *add(Rows *rows)
{
    rows->rows = rows->rows != NULL ? rows->rows : calloc(ROWS, sizeof *rows->rows);
    return rows->n < ROWS ? &rows->rows[rows->n++] : (stop("the plan has too many", "rows"), rows->rows);
}

static void read_fmu(void)
{
    ImporterFmu *fmu = &plan.fmus[plan.n_fmus < FMUS ? plan.n_fmus++ : stop("too many", "FMUs")];
    fmu->version = (int)number();
    fmu->events = (int)number();
    fmu->name = next();
    fmu->library = next();
    fmu->token = next();
    fmu->resources = next();
}

static void read_row(const char *word)
{
    Rows *of[] = {&plan.at, &plan.feed, &plan.wire, &plan.hash, &plan.show, &plan.clock};
    static const char *const names[] = {"at", "feed", "wire", "hash", "show", "clock"};
    size_t kind = 0u;
    while (kind < 6u && strcmp(word, names[kind]) != 0) {
        kind++;
    }
    Row *row = kind < 6u ? add(of[kind]) : (stop("there is no word", word), plan.at.rows);
    row->at = kind == 0u ? number() : 0;
    row->fmu = (int)number();
    if (kind == 5u) {
        row->v.reference = (uint32_t)number();
        return;
    }
    row->v = row->to = variable();
    if (importer_bytes(row->v) > BYTES) {
        stop("a variable has too many bytes:", word);
    }
    if (kind == 0u) {
        row->values = values_of(row->v);
    } else if (kind == 1u) {
        plan.fed += importer_bytes(row->v);
    } else if (kind == 2u) {
        row->to_fmu = (int)number();
        row->to.reference = (uint32_t)number();
    }
}

static void read_plan(char *text)
{
    plan.n_sets = 1;
    for (char *line = text, *end; *line != '\0'; line = end) {
        end = line + strcspn(line, "\n");
        end += *end != '\0';
        char *rest = end > line && end[-1] == '\n' ? &end[-1] : end;
        *rest = '\0';
        const char *word = strtok(line, " ");
        if (word == NULL) {
            continue;
        }
        if (strcmp(word, "fmu") == 0) {
            read_fmu();
        } else if (strcmp(word, "steps") == 0) {
            plan.steps = number();
            plan.step = strtod(next(), NULL);
        } else if (strcmp(word, "sets") == 0) {
            plan.n_sets = (int)number();
        } else if (strcmp(word, "states") == 0) {
            plan.states = number();
            plan.seed = (uint32_t)number();
        } else if (strcmp(word, "feeds") == 0) {
            plan.feeds = contents(next());
        } else {
            read_row(word);
        }
    }
    if (plan.n_sets > SETS) {
        stop("too many", "sets");
    }
}

/* ---- the flight */

static void must(int result)
{
    if (result != 0) {
        exit(1);
    }
}

static void set_at(Set *set, int fmu, long step)
{
    for (size_t i = 0u; i < plan.at.n; i++) {
        const Row *row = &plan.at.rows[i];
        if (row->at == step && row->fmu == fmu) {
            must(importer_set(&set->fmus[fmu], row->v, row->values));
        }
    }
}

static void feed(Set *set, int fmu, long step)
{
    const unsigned char *at = plan.feeds + (size_t)step * plan.fed;
    for (size_t i = 0u; i < plan.feed.n; i++) {
        const Row *row = &plan.feed.rows[i];
        if (row->fmu == fmu) {
            must(importer_set(&set->fmus[fmu], row->v, at));
        }
        at += importer_bytes(row->v);
    }
}

/* What an FMU puts out, to those from `first` to below `last`. */
static void hand_over(Set *set, int fmu, int first, int last)
{
    static unsigned char values[BYTES];
    for (size_t i = 0u; i < plan.wire.n; i++) {
        const Row *row = &plan.wire.rows[i];
        if (row->fmu == fmu && row->to_fmu >= first && row->to_fmu < last) {
            must(importer_get(&set->fmus[fmu], row->v, values));
            must(importer_set(&set->fmus[row->to_fmu], row->to, values));
        }
    }
}

static void add_hashes(Set *set)
{
    static unsigned char values[BYTES];
    for (size_t i = 0u; i < plan.hash.n; i++) {
        const Row *row = &plan.hash.rows[i];
        must(importer_get(&set->fmus[row->fmu], row->v, values));
        for (size_t k = 0u; k < importer_bytes(row->v); k++) {
            set->hash = (set->hash ^ values[k]) * UINT64_C(0x100000001b3);
        }
    }
}

static void count_ticks(void *user, ImporterFmu *fmu)
{
    const Set *set = user;
    for (size_t i = 0u; i < plan.clock.n; i++) {
        Row *row = &plan.clock.rows[i];
        if (!plan.again && set == sets && &set->fmus[row->fmu] == fmu) {
            row->ticks += importer_ticked(fmu, row->v.reference) == 1;
        }
    }
}

/* Outputs of initialization go to those that come later in the plan; back only when all have left it, as inputs of the
 * first step. */
static void begin(Set *set)
{
    set->hash = UINT64_C(0xcbf29ce484222325);
    for (int i = 0; i < plan.n_fmus; i++) {
        set->fmus[i] = plan.fmus[i];
        set->fmus[i].at_event = count_ticks;
        set->fmus[i].user = set;
        must(importer_open(&set->fmus[i]));
        set_at(set, i, -1);
        must(importer_begin(&set->fmus[i], 0.0));
    }
    for (int i = 0; i < plan.n_fmus; i++) {
        set_at(set, i, 0);
        feed(set, i, 0);
        must(importer_begun(&set->fmus[i]));
        hand_over(set, i, i + 1, FMUS);
    }
    for (int i = 0; i < plan.n_fmus; i++) {
        hand_over(set, i, 0, i + 1);
    }
    add_hashes(set);
}

static void step(Set *set, long k)
{
    for (int i = 0; i < plan.n_fmus; i++) {
        set_at(set, i, k);
        feed(set, i, k);
        must(importer_step(&set->fmus[i], (double)k * plan.step));
        hand_over(set, i, 0, FMUS);
    }
    add_hashes(set);
}

static uint32_t draw(void)
{
    plan.seed = plan.seed * 1664525u + 1013904223u;
    return plan.seed >> 8;
}

static void restore(Set *to, ImporterState *states, int serialised)
{
    for (int i = 0; i < plan.n_fmus; i++) {
        must(importer_restore(&to->fmus[i], &states[i], serialised));
    }
}

/* From the point k on, twice: the second time from a state that the first set had there, in that set or in another.
 * Then all are at k again. */
static void go_back(long k)
{
    ImporterState states[FMUS];
    Set *other = &sets[draw() % (uint32_t)plan.n_sets];
    const int serialised = other != sets || draw() % 2u;
    const long until = k + 1 + (long)(draw() % 20u), end = until < plan.steps ? until : plan.steps;
    const uint64_t before = sets->hash;
    uint64_t after[2];
    plan.again = 1;
    for (int i = 0; i < plan.n_fmus; i++) {
        must(importer_save(&sets->fmus[i], &states[i]));
    }
    for (int way = 0; way < 2; way++) {
        Set *set = way == 0 ? sets : other;
        if (way == 1) {
            restore(set, states, serialised);
        }
        set->hash = before;
        for (long at = k + 1; at <= end; at++) {
            step(set, at);
        }
        after[way] = set->hash;
        set->hash = before;
    }
    if (after[0] != after[1]) {
        fprintf(stderr, "fly: from a %s state of point %ld it goes on otherwise until %ld\n",
                serialised ? "serialised" : "kept", k, end);
        exit(3);
    }
    restore(other, states, serialised);
    restore(sets, states, 0);
    for (int i = 0; i < plan.n_fmus; i++) {
        must(importer_forget(&sets->fmus[i], &states[i]));
    }
    plan.again = 0;
}

static void end(void)
{
    static unsigned char values[BYTES];
    for (size_t i = 0u; i < plan.show.n; i++) {
        const Row *row = &plan.show.rows[i];
        must(importer_get(&sets->fmus[row->fmu], row->v, values));
        printf("%" PRIu32, row->v.reference);
        if (row->v.type == FLEDGE_CHAR) {
            printf(" %s", (const char *)values);
        }
        for (uint32_t k = 0u; k < row->v.n && row->v.type != FLEDGE_CHAR; k++) {
            printf(" %.17g", element_read(row->v.type, values + k * element_size(row->v.type)));
        }
        printf("\n");
    }
    for (size_t i = 0u; i < plan.clock.n; i++) {
        printf("%" PRIu32 " %u\n", plan.clock.rows[i].v.reference, plan.clock.rows[i].ticks);
    }
    for (int s = 0; s < plan.n_sets; s++) {
        for (int i = 0; i < plan.n_fmus; i++) {
            must(importer_end(&sets[s].fmus[i]));
            importer_close(&sets[s].fmus[i]);
        }
    }
}

int main(int argc, char **argv)
{
    if (argc != 2) {
        return stop("usage:", "fly PLAN");
    }
    char *text = (char *)contents(argv[1]);
    read_plan(text);
    for (int s = 0; s < plan.n_sets; s++) {
        begin(&sets[s]);
    }
    for (long k = 0; k <= plan.steps; k++) {
        for (int s = 0; s < plan.n_sets && k > 0; s++) {
            step(&sets[s], k);
        }
        for (int s = 1; s < plan.n_sets; s++) {
            if (sets[s].hash != sets->hash) {
                fprintf(stderr, "fly: set %d differs from the first at point %ld\n", s, k);
                return 3;
            }
        }
        printf("%ld %016" PRIx64 "\n", k, sets->hash);
        if (plan.states > 0 && k < plan.steps && draw() % (uint32_t)(plan.steps - k) < (uint32_t)plan.states) {
            plan.states--;
            go_back(k);
        }
    }
    end();
    return 0;
}
