/* SPDX-License-Identifier: Apache-2.0 */
/* The types that the elements of a field can have, their widths, and how a double is made of one and
 * one of a double. */
#ifndef FLIGHT_EXEC_ELEMENT_H
#define FLIGHT_EXEC_ELEMENT_H

#include <stdint.h>
#include <string.h>

typedef enum FledgeType {
    FLEDGE_F64,
    FLEDGE_F32,
    FLEDGE_I8,
    FLEDGE_U8,
    FLEDGE_I16,
    FLEDGE_U16,
    FLEDGE_I32,
    FLEDGE_U32,
    FLEDGE_I64,
    FLEDGE_U64,
    FLEDGE_CHAR,  ///< of a text of fixed size
    FLEDGE_ENUM,  ///< 4 bytes, with a sign
    FLEDGE_STRUCT ///< no number: its size is 0 here
} FledgeType;

/** [bytes] The width of one element. */
static inline uint32_t element_size(FledgeType type)
{
    static const uint8_t sizes[] = {8u, 4u, 1u, 1u, 2u, 2u, 4u, 4u, 8u, 8u, 1u, 4u, 0u};
    return sizes[type];
}

/** [bytes] What n numbers of a type have from a byte `offset` of a struct of `size` bytes on; 0: they are not there. */
static inline uint32_t element_span(uint32_t type, uint32_t offset, uint32_t n, uint32_t size)
{
    const uint32_t width =
        type <= (uint32_t)FLEDGE_ENUM && type != (uint32_t)FLEDGE_CHAR ? element_size((FledgeType)type) : 0u;
    return width > 0u && offset < size && n <= (size - offset) / width ? n * width : 0u;
}

#define FLEDGE_READ(ctype)                                                                                             \
    {                                                                                                                  \
        ctype v;                                                                                                       \
        memcpy(&v, p, sizeof v);                                                                                       \
        return (double)v;                                                                                              \
    }

/** The number at p; 0 if the type is not numeric. */
static inline double element_read(FledgeType type, const void *p)
{
    switch (type) {
    case FLEDGE_F64: FLEDGE_READ(double)
    case FLEDGE_F32: FLEDGE_READ(float)
    case FLEDGE_I8: FLEDGE_READ(int8_t)
    case FLEDGE_U8: FLEDGE_READ(uint8_t)
    case FLEDGE_I16: FLEDGE_READ(int16_t)
    case FLEDGE_U16: FLEDGE_READ(uint16_t)
    case FLEDGE_ENUM:
    case FLEDGE_I32: FLEDGE_READ(int32_t)
    case FLEDGE_U32: FLEDGE_READ(uint32_t)
    case FLEDGE_I64: FLEDGE_READ(int64_t)
    case FLEDGE_U64: FLEDGE_READ(uint64_t)
    case FLEDGE_CHAR:
    case FLEDGE_STRUCT: break;
    }
    return 0.0;
}

/** The whole number nearest to x, from low to high. Both ends are below 2^63. */
static inline int64_t element_whole(double x, double low, double high)
{
    const double limited = x > low ? (x < high ? x : high) : low;
    /* open: NaN is not above low, so it became low, which the analyser does not see */
    return (int64_t)(limited < 0.0 ? limited - 0.5 : limited + 0.5);
}

#define FLEDGE_WRITE(ctype, value)                                                                                     \
    {                                                                                                                  \
        const ctype v = (ctype)(value);                                                                                \
        memcpy(p, &v, sizeof v);                                                                                       \
        return;                                                                                                        \
    }

/** Write x at p: rounded and limited to the range of the type, or for types of 64 bits to 9e15, which a double
 *  represents exactly. */
static inline void element_write(FledgeType type, void *p, double x)
{
    switch (type) {
    case FLEDGE_F64: FLEDGE_WRITE(double, x)
    case FLEDGE_F32: FLEDGE_WRITE(float, x)
    case FLEDGE_I8: FLEDGE_WRITE(int8_t, element_whole(x, -128.0, 127.0))
    case FLEDGE_U8: FLEDGE_WRITE(uint8_t, element_whole(x, 0.0, 255.0))
    case FLEDGE_I16: FLEDGE_WRITE(int16_t, element_whole(x, -32768.0, 32767.0))
    case FLEDGE_U16: FLEDGE_WRITE(uint16_t, element_whole(x, 0.0, 65535.0))
    case FLEDGE_ENUM:
    case FLEDGE_I32: FLEDGE_WRITE(int32_t, element_whole(x, -2147483648.0, 2147483647.0))
    case FLEDGE_U32: FLEDGE_WRITE(uint32_t, element_whole(x, 0.0, 4294967295.0))
    case FLEDGE_I64: FLEDGE_WRITE(int64_t, element_whole(x, -9.0e15, 9.0e15))
    case FLEDGE_U64: FLEDGE_WRITE(uint64_t, element_whole(x, 0.0, 9.0e15))
    case FLEDGE_CHAR:
    case FLEDGE_STRUCT: break;
    }
}

#undef FLEDGE_READ
#undef FLEDGE_WRITE

#endif
