/* SPDX-License-Identifier: Apache-2.0 */
/** A C program as a node of a co-simulation, for programs that were never meant to be one: link
 *  libfledge_node, name the structs that the program reads and writes, and give it the function that steps.
 *
 *  A message is a C struct without padding, of the fields of its definition in their order. Before each
 *  step, the structs that the node reads hold what the node sees at that instant; after the step, the node
 *  sends the structs that have changed. Definitions are ros2msg texts (introspect/emit/schema.py). One side
 *  of a connection needs one: NULL takes the definition of the partner, whose size must then be the size of
 *  the struct. The library converts the byte order.
 *
 *  Functions that return an int return 0 on success, or -1. Functions that return a pointer return NULL if
 *  they fail. fledge_error() has the reason. All functions accept a node or an observer that is NULL because
 *  its creation failed; they fail with the same reason. Unless stated otherwise, one thread uses a node.
 *
 * Example:
 *
 *     static struct { double x[2]; } state;
 *     static struct { double F[2]; } force;
 *
 *     static int step(void *user, int64_t t)
 *     {
 *         force.F[0] = -2.0 * state.x[0];
 *         return 0;
 *     }
 *
 *     int main(void)
 *     {
 *         FledgeNode *node = fledge_node_create(NULL, "spring", NULL, 10000000, 0);
 *         fledge_node_reads(node, "/mass/state", FLEDGE_SAME_INSTANT, NULL, NULL, &state, sizeof state);
 *         fledge_node_writes(node, "/spring/force", "Force", "float64[2] F  # F [N]\n", &force, sizeof force);
 *         return fledge_node_run(node, step, NULL);
 *     }
 */
#ifndef COSIM_C_FLEDGE_NODE_H
#define COSIM_C_FLEDGE_NODE_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#if defined(__GNUC__) && defined(FLEDGE_NODE_EXPORTS)
#define FLEDGE_API __attribute__((visibility("default")))
#else
#define FLEDGE_API
#endif

typedef struct FledgeNode FledgeNode;
typedef struct FledgeObserver FledgeObserver;

/** When a reader sees what was written at t. */
typedef enum FledgeLatency {
    FLEDGE_SAME_INSTANT = 0,  ///< at t: the writer steps first
    FLEDGE_NEXT_INSTANT = 1,  ///< at its first instant after t
    FLEDGE_NEXT_EXCHANGE = 2, ///< after the exchange that follows; both step at once
    FLEDGE_OPTIONAL = 4       ///< added to one of the above: the run begins without a writer, too
} FledgeLatency;

/** Do what is due at t [ns]. A result other than 0 ends the run with an error; see fledge_fail(). */
typedef int (*FledgeStep)(void *user, int64_t t);

/** Why the last function of this thread failed, or why the run ended early; "" if neither. */
FLEDGE_API const char *fledge_error(void);

/** Set fledge_error() and return -1: `return fledge_fail("a pole");` ends a step with this error. */
FLEDGE_API int fledge_fail(const char *why);

/* ---- nodes */

/** A node that steps at offset + k every [ns], of the simulation whose controller listens at `address`:
 *  "tcp://127.0.0.1:7000", "ipc://@name". Where one of these is NULL, the variables FLEDGE_SIMULATION,
 *  FLEDGE_NODE and FLEDGE_ADDRESS give it. */
FLEDGE_API FledgeNode *fledge_node_create(const char *simulation, const char *node, const char *address, int64_t every,
                                          int64_t offset);
FLEDGE_API void fledge_node_destroy(FledgeNode *node);

/** The simulation and the name of the node, as given or as the environment has them. */
FLEDGE_API const char *fledge_node_simulation(const FledgeNode *node);
FLEDGE_API const char *fledge_node_name(const FledgeNode *node);

/** A folder or file of `fledge keys`, for a controller that asks for them (NULL: FLEDGE_KEYS), and the time
 *  [s] in which the controller must answer (60 unless set). */
FLEDGE_API int fledge_node_set(FledgeNode *node, const char *keys, double timeout);

/** Step at these instants, too: a node with several rates. */
FLEDGE_API int fledge_node_also_steps(FledgeNode *node, int64_t every, int64_t offset);

/** Read a topic into the struct at `message`, which lives as long as the node. `type` and `definition`
 *  may be NULL. */
FLEDGE_API int fledge_node_reads(FledgeNode *node, const char *topic, FledgeLatency latency, const char *type,
                                 const char *definition, void *message, size_t size);

/** Write a topic from the struct at `message`, which lives as long as the node. Its value at the beginning
 *  of the run is the initial value. */
FLEDGE_API int fledge_node_writes(FledgeNode *node, const char *topic, const char *type, const char *definition,
                                  void *message, size_t size);

/** Save this memory in snapshots. With the messages, it holds all that the next steps depend on; several calls add
 *  up. It lives as long as the node and has no pointers. With it, a node that was lost goes on from a snapshot;
 *  without it, from the beginning. */
FLEDGE_API int fledge_node_save_in_snapshots(FledgeNode *node, void *state, size_t size);

/** Take part in a run, to its regular end. */
FLEDGE_API int fledge_node_run(FledgeNode *node, FledgeStep step, void *user);

/** From within the step: take no further part in the run. The node still sends what this step writes, and
 *  fledge_node_run() returns. */
FLEDGE_API void fledge_node_leave(FledgeNode *node);

/** From any thread, or from a signal handler: end the run with an error instead of the next step, or of the wait for
 *  the controller. */
FLEDGE_API void fledge_node_stop(FledgeNode *node);

/** The seed and the end [ns] of the run, once it has begun. */
FLEDGE_API uint64_t fledge_node_seed(const FledgeNode *node);
FLEDGE_API int64_t fledge_node_end(const FledgeNode *node);

/* ---- observers */

/** A program that takes no steps: a viewer, a ground system. It comes and goes at any time, sees what nodes
 *  write, and may write topics that the controller's configuration assigns to it. The run never waits for it:
 *  it misses the messages that it does not read in time.
 *
 *  The arguments are as for a node. `timeout` [s] is also the time for all nodes to have joined. */
FLEDGE_API FledgeObserver *fledge_observer_create(const char *simulation, const char *name, const char *address,
                                                  const char *keys, double timeout);
FLEDGE_API void fledge_observer_destroy(FledgeObserver *observer);

/** Subscribe to all topics that begin with `prefix`; "": all. The last message of each comes at once. */
FLEDGE_API int fledge_observer_subscribe(FledgeObserver *observer, const char *prefix);

/** A message as a node wrote it. The pointers are valid until the next call of fledge_observer_next(). */
typedef struct FledgeSeen {
    const char *topic, *node;
    const void *message;
    size_t size;
    int64_t t;       ///< [ns] of writing; -1: before the first step
    uint32_t count;  ///< on its topic; 0: the initial value of the topic
    uint32_t missed; ///< messages between the one seen before and this one
} FledgeSeen;

/** Wait for the next message. Returns 1 with a message; 0 if none comes within `timeout` [s] (negative: no
 *  limit), or the run is over; -1 if the controller is gone. */
FLEDGE_API int fledge_observer_next(FledgeObserver *observer, double timeout, FledgeSeen *seen);

/** Write a message, from any thread. */
FLEDGE_API int fledge_observer_write(FledgeObserver *observer, const char *topic, const void *message, size_t size);

/** The names of all topics, a line each, and the type and the definition of one. From any thread; the text
 *  lives until the next call of this function in this thread. */
FLEDGE_API const char *fledge_observer_topics(FledgeObserver *observer);
FLEDGE_API const char *fledge_observer_type(FledgeObserver *observer, const char *topic);
FLEDGE_API const char *fledge_observer_definition(FledgeObserver *observer, const char *topic);

/** Why the run ended, "" at the regular end; NULL while it goes on. */
FLEDGE_API const char *fledge_observer_reason(const FledgeObserver *observer);

#ifdef __cplusplus
}
#endif
#endif
