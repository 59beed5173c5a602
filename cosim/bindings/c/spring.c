/* SPDX-License-Identifier: Apache-2.0 */
/* A spring as a node: it reads where a mass is and writes the force on it.
 *     spring tcp://127.0.0.1:7000 */
#include "cosim/bindings/c/fledge_node.h"

#include <stdio.h>

typedef struct State {
    int64_t t;
    uint32_t quality, sequence;
    double x[2], v[2];
} State;

typedef struct Spring {
    State mass;
    struct {
        double F[2];
    } force;
} Spring;

static int step(void *user, int64_t t)
{
    Spring *spring = user;
    (void)t;
    for (int i = 0; i < 2; i++) {
        spring->force.F[i] = -spring->mass.x[i];
    }
    return 0;
}

int main(int argc, char **argv)
{
    Spring spring = {0};
    FledgeNode *node = fledge_node_create("spring", "spring", argc > 1 ? argv[1] : "", 10000000, 0);
    if (fledge_node_reads(node, "/mass/state", FLEDGE_SAME_INSTANT, NULL, NULL, &spring.mass, sizeof spring.mass) ||
        fledge_node_writes(node, "/spring/force", "Force", "float64[2] F  # F [N] (2) force\n", &spring.force,
                           sizeof spring.force) ||
        fledge_node_run(node, step, &spring)) {
        fprintf(stderr, "spring: %s\n", fledge_error());
        return 1;
    }
    fledge_node_destroy(node);
    return 0;
}
