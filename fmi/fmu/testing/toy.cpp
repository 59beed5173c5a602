// SPDX-License-Identifier: Apache-2.0
#include "fmi/fmu/testing/toy.h"

#include <array>
#include <cstring>
#include <string>
#include <vector>

namespace fmi::testing {

namespace {

constexpr std::int64_t PERIOD_NS = 10'000'000;

struct Row {
    FmuRole role;
    FledgeType type;
    std::uint32_t n, block;
    std::size_t offset;
};

constexpr std::array<Row, N_NAMES> ROWS = {{
    {FMU_TIME, FLEDGE_F64, 1, 0, 0},
    {FMU_INPUT, FLEDGE_I64, 1, 0, offsetof(Inputs, command.head.t)},
    {FMU_INPUT, FLEDGE_ENUM, 1, 0, offsetof(Inputs, command.head.quality)},
    {FMU_INPUT, FLEDGE_U32, 1, 0, offsetof(Inputs, command.head.sequence)},
    {FMU_INPUT, FLEDGE_F64, 1, 0, offsetof(Inputs, command.u)},
    {FMU_INPUT, FLEDGE_I64, 1, 0, offsetof(Inputs, input.head.t)},
    {FMU_INPUT, FLEDGE_ENUM, 1, 0, offsetof(Inputs, input.head.quality)},
    {FMU_INPUT, FLEDGE_U32, 1, 0, offsetof(Inputs, input.head.sequence)},
    {FMU_INPUT, FLEDGE_F64, 2, 0, offsetof(Inputs, input.values.f64)},
    {FMU_INPUT, FLEDGE_F32, 2, 0, offsetof(Inputs, input.values.f32)},
    {FMU_INPUT, FLEDGE_I8, 2, 0, offsetof(Inputs, input.values.i8)},
    {FMU_INPUT, FLEDGE_U8, 2, 0, offsetof(Inputs, input.values.u8)},
    {FMU_INPUT, FLEDGE_I16, 2, 0, offsetof(Inputs, input.values.i16)},
    {FMU_INPUT, FLEDGE_U16, 2, 0, offsetof(Inputs, input.values.u16)},
    {FMU_INPUT, FLEDGE_I32, 2, 0, offsetof(Inputs, input.values.i32)},
    {FMU_INPUT, FLEDGE_U32, 2, 0, offsetof(Inputs, input.values.u32)},
    {FMU_INPUT, FLEDGE_I64, 2, 0, offsetof(Inputs, input.values.i64)},
    {FMU_INPUT, FLEDGE_U64, 2, 0, offsetof(Inputs, input.values.u64)},
    {FMU_INPUT, FLEDGE_ENUM, 2, 0, offsetof(Inputs, input.values.color)},
    {FMU_INPUT, FLEDGE_CHAR, 8, 0, offsetof(Inputs, input.values.text)},
    {FMU_OUTPUT, FLEDGE_F64, 2, 1, offsetof(Output, values.f64)},
    {FMU_OUTPUT, FLEDGE_F32, 2, 1, offsetof(Output, values.f32)},
    {FMU_OUTPUT, FLEDGE_I8, 2, 1, offsetof(Output, values.i8)},
    {FMU_OUTPUT, FLEDGE_U8, 2, 1, offsetof(Output, values.u8)},
    {FMU_OUTPUT, FLEDGE_I16, 2, 1, offsetof(Output, values.i16)},
    {FMU_OUTPUT, FLEDGE_U16, 2, 1, offsetof(Output, values.u16)},
    {FMU_OUTPUT, FLEDGE_I32, 2, 1, offsetof(Output, values.i32)},
    {FMU_OUTPUT, FLEDGE_U32, 2, 1, offsetof(Output, values.u32)},
    {FMU_OUTPUT, FLEDGE_I64, 2, 1, offsetof(Output, values.i64)},
    {FMU_OUTPUT, FLEDGE_U64, 2, 1, offsetof(Output, values.u64)},
    {FMU_OUTPUT, FLEDGE_ENUM, 2, 1, offsetof(Output, values.color)},
    {FMU_OUTPUT, FLEDGE_CHAR, 8, 1, offsetof(Output, values.text)},
    {FMU_OUTPUT, FLEDGE_F64, 2, 1, offsetof(Output, integral)},
    {FMU_LOCAL, FLEDGE_I64, 1, 1, offsetof(Output, t)},
    {FMU_LOCAL, FLEDGE_I64, 1, 1, offsetof(Output, seen.t)},
    {FMU_LOCAL, FLEDGE_ENUM, 1, 1, offsetof(Output, seen.quality)},
    {FMU_LOCAL, FLEDGE_U32, 1, 1, offsetof(Output, seen.sequence)},
    {FMU_LOCAL, FLEDGE_I64, 1, 1, offsetof(Output, commanded.t)},
    {FMU_LOCAL, FLEDGE_ENUM, 1, 1, offsetof(Output, commanded.quality)},
    {FMU_PARAMETER, FLEDGE_F64, 1, 2, offsetof(Gains, gain)},
    {FMU_PARAMETER, FLEDGE_F64, 1, 2, offsetof(Gains, limit)},
    {FMU_PARAMETER, FLEDGE_CHAR, 8, 2, offsetof(Gains, label)},
    {FMU_FIXED, FLEDGE_F64, 1, 3, offsetof(Start, integral)},
    {FMU_MODE, FLEDGE_ENUM, 1, 0, 0},
    {FMU_REQUEST, FLEDGE_ENUM, 1, 0, 0},
    {FMU_MODE, FLEDGE_ENUM, 1, 1, 0},
    {FMU_REQUEST, FLEDGE_ENUM, 1, 1, 0},
    {FMU_FIRED, FLEDGE_U32, 1, 0, 0},
    {FMU_FIRED, FLEDGE_U32, 1, 1, 0},
    {FMU_CLOCK_MODE, FLEDGE_U8, 1, 0, 0},
    {FMU_CLOCK_MODE, FLEDGE_U8, 1, 1, 0},
    {FMU_CLOCK_EVENT, FLEDGE_U8, 1, 0, 0},
    {FMU_CLOCK_EVENT, FLEDGE_U8, 1, 1, 0},
    {FMU_UPLINK, FLEDGE_U8, 1, 0, 0},
    {FMU_DOWNLINK, FLEDGE_U8, 1, 0, 0},
}};

struct Table {
    FmuVariable rows[N_NAMES];
};

constexpr Table TABLE = [] {
    Table table{};
    std::uint32_t next = 0;
    for (std::size_t i = 0; i < N_NAMES; i++) {
        const Row &row = ROWS[i];
        table.rows[i] = {next, row.role, row.type, row.n, row.block, static_cast<std::uint32_t>(row.offset)};
        next += row.type == FLEDGE_CHAR ? 1 : row.n;
    }
    return table;
}();
constexpr FmuMessage MESSAGES[] = {{COMMAND_T, IN_T - COMMAND_T, 0, offsetof(Inputs, command)},
                                   {IN_T, OUT_F64 - IN_T, 0, offsetof(Inputs, input)}};
constexpr FmuLayout LAYOUT = {TABLE.rows, N_NAMES, MESSAGES, 2, 2, 2};

/** What a snapshot has. */
struct State {
    Inputs inputs;
    Output output;
    Gains gains = {0.5, 8.0, "toy"};
    Start start;
    std::int64_t next; ///< [ns] the next instant
    std::int32_t mode[2];
    std::uint32_t entered[2], fired[2];
    std::uint32_t n_up, n_down; ///< [bytes]
    std::uint8_t up[16], down[16];
};

struct Toy {
    const FmuHost *host;
    State s{};
};

State &state(void *self)
{
    return static_cast<Toy *>(self)->s;
}
const State &state(const void *self)
{
    return static_cast<const Toy *>(self)->s;
}

int refuse(const void *self, const char *text)
{
    const FmuHost &host = *static_cast<const Toy *>(self)->host;
    host.log(host.user, FMU_ERROR, "errors", text);
    return -1;
}

void *create(const FmuHost *host)
{
    host->log(host->user, FMU_OK, "events", host->resources);
    return std::strcmp(host->instance, "broken") == 0 ? nullptr : new Toy{host};
}

void *memory(void *self, std::uint32_t block)
{
    State &s = state(self);
    void *const blocks[] = {&s.inputs, &s.output, &s.gains, &s.start};
    return blocks[block];
}

int changed(void *self, std::uint32_t block)
{
    const State &s = state(self);
    if (block == 2 && !(s.gains.gain > 0.0 && s.gains.gain < s.gains.limit)) {
        return refuse(self, "gain must be > 0 and < limit: 100 % of it, #1");
    }
    return block == 3 && s.start.integral > 1.0 ? refuse(self, "the start must be <= 1") : 0;
}

void enter_mode(State &s, std::uint32_t process, std::int32_t mode)
{
    s.mode[process] = mode;
    s.entered[process]++;
}

std::uint32_t ticks(const State &s)
{
    return s.entered[0] + s.entered[1] + s.fired[0] + s.fired[1];
}

// The mode 1 begins where the integral passes the limit; events fire where color[0] is 7, and where u is.
void run(Toy &toy)
{
    State &s = toy.s;
    Output &out = s.output;
    const Input &in = s.inputs.input;
    out.values = in.values;
    out.seen = in.head;
    out.commanded = s.inputs.command.head;
    out.t = s.next;
    for (std::size_t i = 0; i < 2; i++) {
        out.integral[i] += s.gains.gain * in.values.f64[i];
    }
    s.fired[0] += in.values.color[0] == 7;
    s.fired[1] += s.inputs.command.u == 7.0;
    if (s.mode[0] == 0 && out.integral[0] > s.gains.limit) {
        enter_mode(s, 0, 1);
        toy.host->log(toy.host->user, FMU_OK, "modes", "mode 1 begins");
    }
    std::memcpy(s.down, s.up, sizeof s.down);
    s.n_down = s.n_up;
    s.n_up = 0;
    s.next += PERIOD_NS;
}

int begin(void *self)
{
    Toy &toy = *static_cast<Toy *>(self);
    State first{};
    first.inputs = toy.s.inputs;
    first.gains = toy.s.gains;
    first.start = toy.s.start;
    toy.s = first;
    toy.s.output.integral[0] = toy.s.output.integral[1] = toy.s.start.integral;
    run(toy);
    toy.host->log(toy.host->user, FMU_OK, "events", "the run begins");
    return 0;
}

int advance(void *self, std::int64_t until, int stop, std::int64_t *reached)
{
    Toy &toy = *static_cast<Toy *>(self);
    State &s = toy.s;
    if (std::strcmp(s.gains.label, "fail") == 0) {
        return refuse(self, "the label fails");
    }
    s.n_down = 0;
    while (s.next <= until) {
        const std::uint32_t before = ticks(s);
        run(toy);
        if (stop && ticks(s) != before) {
            *reached = s.output.t;
            return 0;
        }
    }
    *reached = until;
    return 0;
}

int enter(void *self, std::uint32_t process, std::int32_t mode)
{
    if (mode < 0 || mode > 1) {
        return refuse(self, "the modes are 1 and 2");
    }
    enter_mode(state(self), process, mode);
    return 0;
}

int save(void *self, void *bytes)
{
    std::memcpy(bytes, &state(self), sizeof(State));
    return 0;
}

int restore(void *self, const void *bytes, std::size_t size)
{
    if (size != sizeof(State)) {
        return refuse(self, "the state has another size");
    }
    std::memcpy(&state(self), bytes, sizeof(State));
    return 0;
}

int uplink(void *self, const std::uint8_t *packets, std::size_t n)
{
    State &s = state(self);
    if (n > sizeof s.up - s.n_up) {
        return refuse(self, "at most 16 bytes of packets");
    }
    std::memcpy(s.up + s.n_up, packets, n);
    s.n_up += static_cast<std::uint32_t>(n);
    return 0;
}

const std::uint8_t *downlink(const void *self, std::size_t *n)
{
    *n = state(self).n_down;
    return state(self).down;
}

} // namespace

const FmuVariable &variable(Name name)
{
    return TABLE.rows[name];
}

std::uint32_t reference(Name name, std::uint32_t element)
{
    return TABLE.rows[name].reference + element;
}

} // namespace fmi::testing

using namespace fmi::testing;

extern "C" const FmuSystem fmu_system = {
    TOKEN,
    create,
    [](void *self) { delete static_cast<Toy *>(self); },
    [](const void *) { return &LAYOUT; },
    memory,
    changed,
    begin,
    advance,
    [](const void *self, std::uint32_t i) { return state(self).mode[i]; },
    enter,
    [](const void *self, std::uint32_t i) { return state(self).fired[i]; },
    [](const void *self, std::uint32_t i) { return state(self).entered[i]; },
    [](void *) { return sizeof(State); },
    save,
    restore,
    uplink,
    downlink,
};
