// SPDX-License-Identifier: Apache-2.0
// The bytes of a field as numbers of C types.
#pragma once

#include "core/object.h"

#include <algorithm>
#include <cstring>

namespace fledge::core {

inline const Member &member_of(void *closure)
{
    return *static_cast<const Member *>(closure);
}

template <class T> T load(const std::byte *bytes)
{
    T value;
    std::memcpy(&value, bytes, sizeof value);
    return value;
}

template <class T> void save(std::byte *bytes, T value)
{
    std::memcpy(bytes, &value, sizeof value);
}

/// Call f with a value of the field's C type.
template <class F> auto with_type(FledgeType type, F &&f)
{
    switch (type) {
    case FLEDGE_F32: return f(float{});
    case FLEDGE_I8: return f(std::int8_t{});
    case FLEDGE_U8: return f(std::uint8_t{});
    case FLEDGE_I16: return f(std::int16_t{});
    case FLEDGE_U16: return f(std::uint16_t{});
    case FLEDGE_I32:
    case FLEDGE_ENUM: return f(std::int32_t{});
    case FLEDGE_U32: return f(std::uint32_t{});
    case FLEDGE_I64: return f(std::int64_t{});
    case FLEDGE_U64: return f(std::uint64_t{});
    case FLEDGE_F64:
    case FLEDGE_CHAR:
    case FLEDGE_STRUCT: break;
    }
    return f(double{});
}

inline std::uint32_t read_count(const Object &object, const Member &count)
{
    return with_type(count.field->type, [&]<class T>(T) {
        return static_cast<std::uint32_t>(load<T>(object.memory + count.field->offset));
    });
}

inline void write_count(const Object &object, const Member &count, std::uint32_t n)
{
    with_type(count.field->type, [&]<class T>(T) { save(object.memory + count.field->offset, static_cast<T>(n)); });
}

/// Rows that count, of an array.
inline std::uint32_t rows_of(const Object &object, const Member &member)
{
    const std::uint32_t capacity = member.field->shape[0];
    return member.count ? std::min(read_count(object, *member.count), capacity) : capacity;
}

} // namespace fledge::core
