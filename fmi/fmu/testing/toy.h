// SPDX-License-Identifier: Apache-2.0
// A small system behind the functions of the standard: an integrator with instants at each 10 ms, modes, events,
// parameters with rules, a text, an array of each type, and packets.
#pragma once

#include "flight/msg/head.h"
#include "fmi/fmu/system.h"
#include "fmi/standard/fmi2.h"
#include "fmi/standard/fmi3.h"

#include <cstddef>
#include <cstdint>

extern "C" {
#define DECLARED(name) fmi3##name##TYPE fmi3##name;
FMI3_CO_SIMULATION(DECLARED)
FMI3_OTHER(DECLARED)
#undef DECLARED
#define DECLARED(name) fmi2##name##TYPE fmi2##name;
FMI2_CO_SIMULATION(DECLARED)
FMI2_OTHER(DECLARED)
#undef DECLARED
}

namespace fmi::testing {

constexpr const char *TOKEN = "{toy}";
constexpr double PERIOD = 0.01; // [s]

/** The values of a message: an array of each type. */
struct Values {
    double f64[2];
    float f32[2];
    std::int8_t i8[2];
    std::uint8_t u8[2];
    std::int16_t i16[2];
    std::uint16_t u16[2];
    std::int32_t i32[2];
    std::uint32_t u32[2];
    std::int64_t i64[2];
    std::uint64_t u64[2];
    std::int32_t color[2];
    char text[8];
};

struct Input {
    Head head;
    Values values;
};
struct Command {
    Head head;
    double u;
};

/** Block 0: two messages. */
struct Inputs {
    Command command;
    Input input;
};

/** Block 1: the values of the input at the last instant, the integral of values.f64, and what heads there were. */
struct Output {
    Head head;
    Values values;
    double integral[2];
    std::int64_t t; ///< [ns] of the last instant
    Head seen;      ///< of the input at the last instant
    Head commanded; ///< of the command
};

/** Block 2. Rules: 0 < gain < limit. */
struct Gains {
    double gain;
    double limit;
    char label[8];
};

/** Block 3, fixed: the integral at the start. Rule: at most 1. */
struct Start {
    double integral;
};

/** The variables, in the order of the layout. */
enum Name {
    TIME,
    COMMAND_T,
    COMMAND_QUALITY,
    COMMAND_SEQUENCE,
    COMMAND_U,
    IN_T,
    IN_QUALITY,
    IN_SEQUENCE,
    IN_F64,
    IN_F32,
    IN_I8,
    IN_U8,
    IN_I16,
    IN_U16,
    IN_I32,
    IN_U32,
    IN_I64,
    IN_U64,
    IN_COLOR,
    IN_TEXT,
    OUT_F64,
    OUT_F32,
    OUT_I8,
    OUT_U8,
    OUT_I16,
    OUT_U16,
    OUT_I32,
    OUT_U32,
    OUT_I64,
    OUT_U64,
    OUT_COLOR,
    OUT_TEXT,
    INTEGRAL,
    LAST,
    SEEN_T,
    SEEN_QUALITY,
    SEEN_SEQUENCE,
    COMMANDED_T,
    COMMANDED_QUALITY,
    GAIN,
    LIMIT,
    LABEL,
    START,
    MODE,
    REQUEST,
    OTHER_MODE,
    OTHER_REQUEST,
    FIRED,
    OTHER_FIRED,
    CLOCK_MODE,
    OTHER_CLOCK_MODE,
    CLOCK_EVENT,
    OTHER_CLOCK_EVENT,
    UPLINK,
    DOWNLINK,
    N_NAMES
};

/** The value reference of an element, in FMI 3.0 of the variable if it is the first. */
std::uint32_t reference(Name name, std::uint32_t element = 0);
const FmuVariable &variable(Name name);

} // namespace fmi::testing
