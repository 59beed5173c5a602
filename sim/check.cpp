// SPDX-License-Identifier: Apache-2.0
// Checks the bytes of an instance by the rules in the comments of its header.
#include "flight/command/rules.h"
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
    return element_read(field.type, bytes + index * element_size(field.type));
}

/// The rule that an inertia matrix breaks; "" if it breaks none.
std::string inertia_fault(const std::byte *bytes)
{
    double m[3][3];
    std::memcpy(m, bytes, sizeof m);
    switch (exec_inertia(m)) {
    case EXEC_INERTIA_ASYMMETRIC: return "must be symmetric";
    case EXEC_INERTIA_INDEFINITE: return "must be positive definite";
    case EXEC_INERTIA_NO_BODY: return "is that of no body: a principal moment exceeds the sum of the others";
    case EXEC_INERTIA_GOOD: break;
    }
    return "";
}

} // namespace

void check_field(const FledgeStruct &type, const FledgeField &field, const std::byte *memory, std::string_view path)
{
    if (field.type == FLEDGE_CHAR || field.flags & FLEDGE_SPARE) {
        return;
    }
    const std::byte *bytes = memory + field.offset;
    const std::size_t rows = field_rows(type, field, memory);
    if (field.type == FLEDGE_STRUCT) {
        for (std::size_t i = 0; i < (field.ndim ? rows : 1); i++) {
            for (const FledgeField &inner : fields(*field.sub)) {
                check_field(*field.sub, inner, bytes + i * field.sub->size,
                            std::string(path) + "." + field.name + index_text(field, i, 1));
            }
        }
        return;
    }
    const std::size_t n = field.ndim ? rows * (field_elements(field) / field.shape[0]) : 1;
    const bool vector = field.ndim && field.shape[field.ndim - 1] == 3; // every row must have a length
    const std::uint32_t flags = field.bounds | (field.flags & FLEDGE_NON_ZERO ? COMMAND_NON_ZERO : 0) |
                                (field.flags & FLEDGE_INERTIA ? COMMAND_INERTIA : 0);
    const CommandRule rule{
        field.name, "",       0,       static_cast<std::uint32_t>(n), vector ? 3u : 1u, COMMAND_ALL_ROWS, flags,
        field.type, field.lo, field.hi};
    std::uint32_t at;
    if (!command_check(&rule, 1, bytes, &at)) {
        return;
    }
    const double x = number(field, bytes, at);
    const std::string unit = *field.unit && std::strcmp(field.unit, "-") ? " " + std::string(field.unit) : "";
    const auto fail = [&](const std::string &text, const std::string &found) {
        throw SetupError(std::string(path) + "." + field.name + " " + text + ", found " + found);
    };
    const std::string found = format_number(x) + unit + (field.ndim ? " at " + index_text(field, at) : "");
    if (!std::isfinite(x)) {
        fail("must be finite", found);
    }
    if (!exec_computable(x)) {
        fail("must be 0 or of a size from 1e-100 to 1e+100" + unit, found);
    }
    if (!exec_within(field.bounds, field.lo, field.hi, x)) {
        fail("must be " + bounds_text(field) + unit, found);
    }
    const bool matrices = field.flags & FLEDGE_INERTIA && at % 9 == 0;
    const std::string fault = matrices ? inertia_fault(bytes + at * sizeof(double)) : "";
    if (fault.empty()) {
        fail(vector ? "must have a length" : "must not be zero",
             field.ndim > vector ? "zero at " + index_text(field, at, field.ndim - vector) : "zero");
    }
    std::string matrix;
    for (std::size_t i = 0; i < 9; i++) {
        matrix += (i % 3 ? ", " : i ? "], [" : "[") + format_number(number(field, bytes, at + i));
    }
    fail(fault, "[" + matrix + "]]" + unit + (field.ndim > 2 ? " at [" + std::to_string(at / 9) + "]" : ""));
}

void check_parameters(const Instance &instance)
{
    const FledgeStruct &type = instance.type();
    Faults faults;
    for (std::size_t i = 0; i < type.n; i++) {
        const FledgeField &field = type.fields[i];
        if (field.group != FLEDGE_PAR) {
            continue;
        }
        const std::byte *bytes = instance.memory() + field.offset;
        const bool zero = std::all_of(bytes, bytes + field.size, [](std::byte b) { return b == std::byte{0}; });
        faults.collect([&] {
            if (field.flags & FLEDGE_REQUIRED && zero && !instance.given[i]) {
                throw SetupError(
                    instance.path + "." + field.name + " is required: " + field.doc +
                    (*field.unit && std::strcmp(field.unit, "-") ? " [" + std::string(field.unit) + "]" : ""));
            }
            check_field(type, field, instance.memory(), instance.path);
        });
    }
    faults.raise();
}

} // namespace fledge::sim
