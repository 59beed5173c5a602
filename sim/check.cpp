// SPDX-License-Identifier: Apache-2.0
// The rules that stand in the headers' comments, checked on the bytes of an instance.
#include "sim/error.h"
#include "sim/instance.h"
#include "sim/text.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace fledge::sim {

namespace {

/// The element of a numeric field as a double.
double number(const FledgeField &field, const std::byte *bytes, std::size_t index)
{
    const auto read = [&]<class T>(T value) {
        std::memcpy(&value, bytes + index * sizeof value, sizeof value);
        return static_cast<double>(value);
    };
    switch (field.type) {
    case FLEDGE_F64: return read(double{});
    case FLEDGE_F32: return read(float{});
    case FLEDGE_I8: return read(std::int8_t{});
    case FLEDGE_U8: return read(std::uint8_t{});
    case FLEDGE_I16: return read(std::int16_t{});
    case FLEDGE_U16: return read(std::uint16_t{});
    case FLEDGE_I32: return read(std::int32_t{});
    case FLEDGE_U32: return read(std::uint32_t{});
    case FLEDGE_I64: return read(std::int64_t{});
    case FLEDGE_U64: return read(std::uint64_t{});
    case FLEDGE_ENUM: return read(std::int32_t{});
    case FLEDGE_CHAR:
    case FLEDGE_STRUCT: break;
    }
    return 0.0;
}

std::string bounds_text(const FledgeField &field)
{
    const bool lo = field.bounds & FLEDGE_HAS_LO, hi = field.bounds & FLEDGE_HAS_HI;
    if (lo && hi) {
        return "must be in " + std::string(field.bounds & FLEDGE_LO_OPEN ? "(" : "[") + format_number(field.lo) + ", " +
               format_number(field.hi) + (field.bounds & FLEDGE_HI_OPEN ? ")" : "]");
    }
    if (lo) {
        return std::string("must be ") + (field.bounds & FLEDGE_LO_OPEN ? "> " : ">= ") + format_number(field.lo);
    }
    return std::string("must be ") + (field.bounds & FLEDGE_HI_OPEN ? "< " : "<= ") + format_number(field.hi);
}

bool within_bounds(const FledgeField &field, double x)
{
    if (field.bounds & FLEDGE_HAS_LO && !(field.bounds & FLEDGE_LO_OPEN ? x > field.lo : x >= field.lo)) {
        return false;
    }
    return !(field.bounds & FLEDGE_HAS_HI) || (field.bounds & FLEDGE_HI_OPEN ? x < field.hi : x <= field.hi);
}

/// Whether m + shift has only positive eigenvalues: Sylvester's criterion.
bool positive_definite(const double (&matrix)[3][3], double shift)
{
    double m[3][3];
    std::memcpy(m, matrix, sizeof m);
    for (int i = 0; i < 3; i++) {
        m[i][i] += shift;
    }
    const double minor = m[0][0] * m[1][1] - m[0][1] * m[1][0];
    const double determinant = m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
                               m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
                               m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
    return m[0][0] > 0.0 && minor > 0.0 && determinant > 0.0;
}

/// What is wrong with an inertia matrix; "" if nothing is.
std::string inertia_fault(const std::byte *bytes)
{
    double m[3][3];
    std::memcpy(m, bytes, sizeof m);
    const double trace = m[0][0] + m[1][1] + m[2][2];
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < i; j++) {
            if (std::abs(m[i][j] - m[j][i]) > 1e-9 * std::abs(trace)) {
                return "must be symmetric";
            }
        }
    }
    // By more than rounding: the zero moment of a rod that lies askew comes out as 1e-16 of its trace.
    if (!positive_definite(m, -1e-12 * trace)) {
        return "must be positive definite";
    }
    // No principal moment exceeds the sum of the other two if and only if trace/2 - I has no
    // negative eigenvalue. A flat body lies on the edge.
    double rest[3][3];
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            rest[i][j] = (i == j ? 0.5 * trace : 0.0) - m[i][j];
        }
    }
    return positive_definite(rest, 1e-9 * trace)
               ? ""
               : "is that of no body: a principal moment exceeds the sum of the others";
}

} // namespace

void check_field(const FledgeStruct &type, const FledgeField &field, const std::byte *memory, std::string_view path)
{
    if (field.type == FLEDGE_STRUCT || field.type == FLEDGE_CHAR || field.flags & FLEDGE_SPARE) {
        return;
    }
    const std::byte *bytes = memory + field.offset;
    const std::size_t rows = field_rows(type, field, memory);
    const std::size_t row = field.ndim ? field_elements(field) / field.shape[0] : 1;
    const std::string unit = *field.unit && std::strcmp(field.unit, "-") ? " " + std::string(field.unit) : "";
    const auto fail = [&](const std::string &rule, const std::string &found) {
        throw SetupError(std::string(path) + "." + field.name + " " + rule + ", found " + found);
    };
    for (std::size_t i = 0; i < rows * row; i++) {
        const double x = number(field, bytes, i);
        const auto found = [&] { return format_number(x) + unit + (field.ndim ? " at " + index_text(field, i) : ""); };
        if (!std::isfinite(x)) {
            fail("must be finite", found());
        }
        if (field.bounds && !within_bounds(field, x)) {
            fail(bounds_text(field) + unit, found());
        }
    }
    if (field.flags & FLEDGE_NON_ZERO) {
        // Of vectors, every row must have a length; a scalar or an array of scalars no zero.
        const std::size_t vector = field.ndim && field.shape[field.ndim - 1] == 3 ? 3 : 1;
        for (std::size_t i = 0; i < rows * row; i += vector) {
            const auto zero = [&](std::size_t k) { return number(field, bytes, i + k) == 0.0; };
            if (zero(0) && (vector == 1 || (zero(1) && zero(2)))) {
                fail(vector == 3 ? "must have a length" : "must not be zero",
                     field.ndim ? "zero at " + index_text(field, i, field.ndim - (vector == 3)) : "zero");
            }
        }
    }
    if (field.flags & FLEDGE_INERTIA) {
        if (const std::string fault = inertia_fault(bytes); !fault.empty()) {
            std::string matrix;
            for (std::size_t i = 0; i < 9; i++) {
                matrix += (i % 3 ? ", " : i ? "], [" : "[") + format_number(number(field, bytes, i));
            }
            fail(fault, "[" + matrix + "]]" + unit);
        }
    }
}

void check_parameters(const Instance &instance)
{
    const FledgeStruct &type = instance.type();
    std::string faults;
    for (std::size_t i = 0; i < type.n; i++) {
        const FledgeField &field = type.fields[i];
        if (field.group != FLEDGE_PAR) {
            continue;
        }
        const std::byte *bytes = instance.memory() + field.offset;
        const bool zero = std::all_of(bytes, bytes + field.size, [](std::byte b) { return b == std::byte{0}; });
        try {
            if (field.flags & FLEDGE_REQUIRED && zero && !instance.given[i]) {
                throw SetupError(instance.path + "." + field.name + " is required: " + field.doc +
                                 (*field.unit ? " [" + std::string(field.unit) + "]" : ""));
            }
            check_field(type, field, instance.memory(), instance.path);
        } catch (const SetupError &error) {
            faults += (faults.empty() ? "" : "\n") + std::string(error.what());
        }
    }
    if (!faults.empty()) {
        throw SetupError(faults);
    }
}

} // namespace fledge::sim
