/* SPDX-License-Identifier: Apache-2.0 */
/* A spring as a node: it reads where a mass is, and writes the force on it.
 *     spring ADDRESS [LATENCY [HOW]]
 *
 * HOW makes it a program of the tests. It `prints` what it saw as a line of JSON. At 0.3 s it fails (`broken`), goes
 * (`leaves`) or stops (`hangs`); at 3 s it `dies`. It gives no definition of what it writes (`reader`), or has another
 * one of what it reads (`other`). It pulls back by the integral too (`integral`), and saves it in snapshots (`saves`).
 */
#include "cosim/bindings/c/fledge_node.h"

#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define SECOND 1000000000

typedef struct State {
    int64_t t;
    uint32_t quality, sequence;
    double x[2], v[2];
} State;

#define OTHER_STATE                                                                                                    \
    "int64 t  # t [ns]\nuint32 quality  # quality [-]\nuint32 sequence  # sequence [-]\n"                              \
    "float64[2] x  # x [km] (2) position\nfloat64[2] v  # v [m/s] (2) velocity\n"

typedef struct Force {
    double F[2];
} Force;

static FledgeNode *node;
static const char *how = "";
static State mass;
static Force force;
static double integral;
static char *seen; /* rows of JSON */
static size_t used;

static int is(const char *word)
{
    return strstr(how, word) != NULL;
}

static void end_it(int number)
{
    (void)number;
    fledge_node_stop(node); /* a signal handler may: NOLINT(bugprone-signal-handler) */
}

static int step(void *user, int64_t t)
{
    (void)user;
    integral += is("integral") || is("saves") ? 0.001 * mass.x[0] : 0.0;
    for (int i = 0; i < 2; i++) {
        force.F[i] = -mass.x[i] - integral;
    }
    if (t == 3 * (int64_t)SECOND && is("dies")) {
        raise(SIGKILL);
    }
    if (is("prints")) {
        char *const more = realloc(seen, used + 100);
        if (!more) {
            return fledge_fail("no memory is left");
        }
        seen = more;
        used += (size_t)snprintf(seen + used, 100, "%s[%" PRId64 ", %" PRId64 ", %" PRIu32 ", %.17g]", used ? ", " : "",
                                 t, mass.t, mass.sequence, mass.x[0]);
    }
    if (t == 3 * (int64_t)SECOND / 10) {
        if (is("broken")) {
            return fledge_fail("a pole");
        }
        if (is("leaves")) {
            fledge_node_leave(node);
        }
        if (is("hangs")) {
            raise(SIGSTOP);
        }
    }
    return 0;
}

int main(int argc, char **argv)
{
    const FledgeLatency latency = argc > 2 ? (FledgeLatency)atoi(argv[2]) : FLEDGE_SAME_INSTANT;
    how = argc > 3 ? argv[3] : "";
    node = fledge_node_create("spring", "spring", argc > 1 ? argv[1] : "", SECOND / 100, 0);
    (void)signal(SIGTERM, end_it);
    int ended = 0;
    if (fledge_node_reads(node, "/mass/state", latency, NULL, is("other") ? OTHER_STATE : NULL, &mass, sizeof mass) ||
        fledge_node_writes(node, "/spring/force", "Force", is("reader") ? NULL : "float64[2] F  # F [N] (2) force\n",
                           &force, sizeof force) ||
        (is("saves") && fledge_node_save_in_snapshots(node, &integral, sizeof integral)) ||
        ((ended = fledge_node_run(node, step, NULL)) != 0 && !(ended > 0 && is("prints")))) {
        fprintf(stderr, "spring: %s\n", fledge_error());
        return 1;
    }
    if (is("prints")) {
        printf("{\"reason\": \"%s\", \"seen\": [%s], \"seed\": %" PRIu64 ", \"end\": %" PRId64 "}\n", fledge_error(),
               seen ? seen : "", fledge_node_seed(node), fledge_node_end(node));
        free(seen);
    }
    fledge_node_destroy(node);
    return 0;
}
