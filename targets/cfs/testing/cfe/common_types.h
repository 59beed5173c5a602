/* SPDX-License-Identifier: Apache-2.0 */
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

#define OS_USED __attribute__((used))
#define OS_PRINTF(n, m) __attribute__((__format__(__printf__, n, m)))

#endif
