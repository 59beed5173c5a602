/* SPDX-License-Identifier: Apache-2.0 */
/* What introspect found in the headers, as data: one table per struct, for the desktop's Python
 * objects, the recorder and every tool that shows a module. The tables are generated. */
#ifndef SIM_TABLE_H
#define SIM_TABLE_H

#include "flight/exec/bounds.h"
#include "flight/exec/element.h"

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Changes whenever a struct below does; a library built with another one is refused. */
#define FLEDGE_TABLE_VERSION 4u

#define FLEDGE_DIMS_MAX 4

typedef enum FledgeGroup {
    FLEDGE_NONE, /* a member of a message or plain struct */
    FLEDGE_IN,
    FLEDGE_OUT,
    FLEDGE_PAR,
    FLEDGE_MEM
} FledgeGroup;

/* What a field's comment demands. */
enum {
    FLEDGE_REQUIRED = 1 << 0, /* a parameter that must be given */
    FLEDGE_OPTIONAL = 1 << 1, /* an input that may stay unwired */
    FLEDGE_ASSUMED = 1 << 2,  /* zero is an assumption worth stating at the end of a run */
    FLEDGE_NON_ZERO = 1 << 3, /* a scalar that is not 0; of a vector, or of each row: norm not 0 */
    FLEDGE_INERTIA = 1 << 4,  /* symmetric, positive definite, triangle inequality of its moments */
    FLEDGE_SPARE = 1 << 5,    /* fills a gap; no tool shows it */
    FLEDGE_INITIAL = 1 << 6   /* without effect after the first instant */
};

struct FledgeStruct;
struct CommandService;

typedef struct FledgeEnumerator {
    const char *name;
    int64_t value;
    const char *doc;
} FledgeEnumerator;

typedef struct FledgeEnum {
    const char *name;
    const char *doc;
    uint32_t n;
    const FledgeEnumerator *values;
} FledgeEnum;

typedef struct FledgeField {
    const char *name; /* as in the header */
    uint32_t offset;  /* bytes from the start of the outermost struct */
    uint32_t size;    /* bytes, of the whole field */
    FledgeType type;  /* Vec3 and Mat3 are FLEDGE_F64 with trailing dimensions */
    FledgeGroup group;
    uint32_t flags;  /* FLEDGE_REQUIRED ... */
    uint32_t bounds; /* FLEDGE_HAS_LO ... */
    double lo, hi;   /* in the header's unit */
    uint32_t ndim;   /* 0: a scalar */
    uint32_t shape[FLEDGE_DIMS_MAX];
    const char *count;              /* the field that says how many leading rows count, or NULL */
    const char *distinct;           /* the input that may not hold the same as this one, or NULL */
    const struct FledgeStruct *sub; /* FLEDGE_STRUCT */
    const FledgeEnum *values;       /* FLEDGE_ENUM */
    const char *unit;               /* as in the header, "-" if dimensionless, "" if none is given */
    int8_t dims[8];                 /* exponents of m, kg, s, A, K, mol, cd, rad */
    const char *ctype;              /* as in the header: "Vec3", "double", "AttError" */
    const char *doc;                /* the meaning */
} FledgeField;

typedef enum FledgeKind {
    FLEDGE_PLAIN,   /* a struct that messages are made of */
    FLEDGE_MESSAGE, /* begins with a Head */
    FLEDGE_MODULE,  /* flight: groups, reset, update */
    FLEDGE_MODEL    /* world: groups; its behaviour is C++ */
} FledgeKind;

typedef struct FledgeStruct {
    const char *name;
    const char *doc;
    const char *header; /* relative to the root that was read, with '/' */
    const char *folder; /* of the header: "flight/guidance" */
    FledgeKind kind;
    uint32_t size;
    uint32_t align;
    uint64_t hash; /* FNV-1a over names, types, shapes, offsets and units */
    uint32_t n;
    const FledgeField *fields; /* in the order of memory; members of groups flattened */
    const char *schema;        /* messages: the ros2msg text; else NULL */
    /* Modules: the C functions, as void (*)(T *) and void (*)(T *, Tick). Models: NULL. */
    void (*reset)(void);
    void (*update)(void);
    const struct CommandService *service; /* of a module that commands need (flight/command/command.h); else NULL */
    const FledgeEnum *events;             /* of a module with an output FlightEvent: what it says; else NULL */
} FledgeStruct;

typedef struct FledgeLibrary {
    uint32_t version; /* FLEDGE_TABLE_VERSION */
    const char *name; /* "flight", "world", or a user's library */
    uint32_t n;
    const FledgeStruct *const *structs;
} FledgeLibrary;

#ifdef __cplusplus
}
#endif

#endif
