/* SPDX-License-Identifier: Apache-2.0 */
/* Functions of numbers and small arrays that introspect found in headers, as data, so that Python can call them. */
#ifndef SIM_FUNCTION_H
#define SIM_FUNCTION_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum {
    FLEDGE_FUNCTION_ARGUMENTS = 4, /* the most that a function takes, or gives */
    FLEDGE_FUNCTION_NUMBERS = 9    /* the most of one of them */
};

typedef struct FledgeArgument {
    const char *name;
    uint32_t ndim; /* 0: a number */
    uint32_t shape[2];
    uint32_t whole; /* 1: a whole number, given as a double */
} FledgeArgument;

typedef struct FledgeFunction {
    const char *name;
    const char *doc;
    const char *header;
    uint32_t n_in;
    FledgeArgument in[FLEDGE_FUNCTION_ARGUMENTS];
    uint32_t n_out;
    FledgeArgument out[FLEDGE_FUNCTION_ARGUMENTS];
    void (*call)(const double *const *in, double *const *out);
} FledgeFunction;

typedef struct FledgeFunctions {
    uint32_t n;
    const FledgeFunction *functions;
} FledgeFunctions;

#ifdef __cplusplus
}
#endif

#endif
