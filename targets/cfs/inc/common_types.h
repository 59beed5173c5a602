/* SPDX-License-Identifier: Apache-2.0 */
/* The basic types of cFE and OSAL. */
#ifndef COMMON_TYPES_H
#define COMMON_TYPES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef int8_t int8;
typedef int16_t int16;
typedef int32_t int32;
typedef int64_t int64;
typedef uint8_t uint8;
typedef uint16_t uint16;
typedef uint32_t uint32;
typedef uint64_t uint64;
typedef uintptr_t cpuaddr;
typedef size_t cpusize;

#ifdef __GNUC__
#define OS_USED __attribute__((used))
#define OS_PRINTF(spec, first) __attribute__((__format__(__printf__, spec, first)))
#else
#define OS_USED
#define OS_PRINTF(spec, first)
#endif

#endif
