/* SPDX-License-Identifier: Apache-2.0 */
/** A C program as a node of a co-simulation, for programs that were never meant to be one: link
 *  libfledge_node, say which structs are read and written, and hand over the function that steps.
 *
 *  A message is a C struct without padding, of the fields of its definition in their order. Before each
 *  step the structs that are read hold what is seen at that instant; after it, those that were changed
 *  are sent. Definitions are ros2msg texts (introspect/emit/schema.py); one is needed on one side only,
 *  so NULL takes that of the partner, whose size must then be that of the struct. Other byte orders are
 *  turned round.
 *
 *  Functions return 0, or -1 with the reason in fledge_node_error(). Nodes are not for several threads. */
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

/** When a reader sees what was written at t. */
typedef enum FledgeLatency {
    FLEDGE_SAME_INSTANT = 0, ///< at t: the writer steps first
    FLEDGE_NEXT_INSTANT = 1, ///< at its first instant after t
    FLEDGE_NEXT_EXCHANGE = 2 ///< after the exchange that follows; both step at once
} FledgeLatency;

/** Do what is due at t [ns]. Anything but 0 ends the run with an error. */
typedef int (*FledgeStep)(void *user, int64_t t);

/** A node that steps at offset + k every [ns], of the simulation whose controller listens at `address`:
 *  "tcp://127.0.0.1:7000", "ipc://@name". What is NULL is as FLEDGE_SIMULATION, FLEDGE_NODE and
 *  FLEDGE_ADDRESS say. NULL if there is no memory. */
FLEDGE_API FledgeNode *fledge_node_create(const char *simulation, const char *node, const char *address, int64_t every,
                                          int64_t offset);
FLEDGE_API void fledge_node_destroy(FledgeNode *node);

/** Read a topic into the struct at `message`, which lives as long as the node. `type` and `definition`
 *  may be NULL. */
FLEDGE_API int fledge_node_reads(FledgeNode *node, const char *topic, FledgeLatency latency, const char *type,
                                 const char *definition, void *message, size_t size);

/** Write a topic from the struct at `message`, which lives as long as the node. What it holds when the
 *  run begins is its initial value. */
FLEDGE_API int fledge_node_writes(FledgeNode *node, const char *topic, const char *type, const char *definition,
                                  void *message, size_t size);

/** All that its steps depend on, besides the messages, is in this memory (and what else is told so), which
 *  lives as long as the node, without pointers. With it one that was lost goes on from a snapshot, and not
 *  by all its steps from the beginning. */
FLEDGE_API int fledge_node_keeps(FledgeNode *node, void *state, size_t size);

/** Take part in a run, to its regular end. */
FLEDGE_API int fledge_node_run(FledgeNode *node, FledgeStep step, void *user);

/** From within the step: take no further part in the run. What this step writes is the last, and
 *  fledge_node_run() returns. */
FLEDGE_API void fledge_node_leave(FledgeNode *node);

/** Why the last function failed, or the run ended early; "" if neither. */
FLEDGE_API const char *fledge_node_error(const FledgeNode *node);

#ifdef __cplusplus
}
#endif
#endif
