// SPDX-License-Identifier: Apache-2.0
// FMI 3.0 over a toy: its functions, values, and the states in which each may be called.
#include "fmi/fmu/testing/instance.h"

#include <cstring>
#include <functional>
#include <limits>
#include <map>
#include <string>
#include <type_traits>
#include <vector>

#include <dlfcn.h>
#include <gtest/gtest.h>

namespace fmi3_test {

using namespace fmi::testing;

TEST(Fmi3, TheLibraryExportsTheFunctionsOfTheStandardAlone)
{
    void *library = dlopen(FLEDGE_TOY_FMU, RTLD_NOW | RTLD_LOCAL);
    ASSERT_NE(library, nullptr) << dlerror();
#define EXPORTED(name) EXPECT_NE(dlsym(library, "fmi3" #name), nullptr) << #name;
    FMI3_CO_SIMULATION(EXPORTED)
    FMI3_OTHER(EXPORTED)
#undef EXPORTED
#define EXPORTED(name) EXPECT_NE(dlsym(library, "fmi2" #name), nullptr) << #name;
    FMI2_CO_SIMULATION(EXPORTED)
    FMI2_OTHER(EXPORTED)
#undef EXPORTED
    for (const char *name : {"fmu_new", "fmu_step", "fmu_get", "fmu_save", "fmu_system"}) {
        EXPECT_EQ(dlsym(library, name), nullptr) << name;
    }
    dlclose(library);
    EXPECT_STREQ(fmi3GetVersion(), "3.0");
}

TEST(Fmi3, AnInstanceThatCannotBeSaysWhy)
{
    const Instance other(false, false, "{ball}");
    EXPECT_EQ(other.p, nullptr);
    EXPECT_EQ(other.log.at(0), "3 errors: fmi3InstantiateCoSimulation: the model description has the token "
                               "\"{ball}\", this library \"{toy}\"");
    const Instance unnamed(false, false, TOKEN, " ");
    EXPECT_EQ(unnamed.p, nullptr);
    EXPECT_TRUE(unnamed.says("no name"));
    EXPECT_EQ(Instance(false, false, TOKEN, "broken").p, nullptr);
    std::vector<std::string> log;
    const auto append = [](void *to, fmi3Status, fmi3String, fmi3String text) {
        static_cast<std::vector<std::string> *>(to)->push_back(text);
    };
    EXPECT_EQ(fmi3InstantiateModelExchange("toy", TOKEN, nullptr, false, true, &log, append), nullptr);
    EXPECT_EQ(
        fmi3InstantiateScheduledExecution("toy", TOKEN, nullptr, false, true, &log, append, nullptr, nullptr, nullptr),
        nullptr);
    EXPECT_EQ(log.size(), 2U);
    fmi3FreeInstance(nullptr);
}

// ---- values

template <class T> using Get = fmi3Status(fmi3Instance, const fmi3ValueReference *, std::size_t, T *, std::size_t);
template <class T>
using Set = fmi3Status(fmi3Instance, const fmi3ValueReference *, std::size_t, const T *, std::size_t);

template <class T>
void expect_values_arrive(Set<T> *set, Get<T> *get, Name in, Name out, std::vector<std::vector<T>> cases)
{
    for (const std::vector<T> &values : cases) {
        Instance fmu;
        fmu.initialized();
        const fmi3ValueReference from = reference(in);
        const fmi3ValueReference to = reference(out);
        std::vector<T> result(2);
        ASSERT_EQ(set(fmu.p, &from, 1, values.data(), 2), fmi3OK);
        ASSERT_EQ(get(fmu.p, &from, 1, result.data(), 2), fmi3OK);
        EXPECT_EQ(std::memcmp(result.data(), values.data(), 2 * sizeof(T)), 0) << in;
        ASSERT_EQ(fmu.step(0.0, 0.01), fmi3OK);
        ASSERT_EQ(get(fmu.p, &to, 1, result.data(), 2), fmi3OK);
        EXPECT_EQ(std::memcmp(result.data(), values.data(), 2 * sizeof(T)), 0) << out;
    }
}

template <class T> std::vector<std::vector<T>> extremes()
{
    using Limits = std::numeric_limits<T>;
    if constexpr (std::is_floating_point_v<T>) {
        return {{Limits::max(), Limits::denorm_min()}, {Limits::quiet_NaN(), -Limits::infinity()}};
    } else {
        return {{Limits::min(), Limits::max()}};
    }
}

TEST(Fmi3, ValuesOfEachTypeArriveWithTheirBits)
{
    expect_values_arrive<double>(fmi3SetFloat64, fmi3GetFloat64, IN_F64, OUT_F64, extremes<double>());
    expect_values_arrive<float>(fmi3SetFloat32, fmi3GetFloat32, IN_F32, OUT_F32, extremes<float>());
    expect_values_arrive<std::int8_t>(fmi3SetInt8, fmi3GetInt8, IN_I8, OUT_I8, extremes<std::int8_t>());
    expect_values_arrive<std::uint8_t>(fmi3SetUInt8, fmi3GetUInt8, IN_U8, OUT_U8, extremes<std::uint8_t>());
    expect_values_arrive<std::int16_t>(fmi3SetInt16, fmi3GetInt16, IN_I16, OUT_I16, extremes<std::int16_t>());
    expect_values_arrive<std::uint16_t>(fmi3SetUInt16, fmi3GetUInt16, IN_U16, OUT_U16, extremes<std::uint16_t>());
    expect_values_arrive<std::int32_t>(fmi3SetInt32, fmi3GetInt32, IN_I32, OUT_I32, extremes<std::int32_t>());
    expect_values_arrive<std::uint32_t>(fmi3SetUInt32, fmi3GetUInt32, IN_U32, OUT_U32, extremes<std::uint32_t>());
    expect_values_arrive<std::int64_t>(fmi3SetInt64, fmi3GetInt64, IN_I64, OUT_I64, extremes<std::int64_t>());
    expect_values_arrive<std::uint64_t>(fmi3SetUInt64, fmi3GetUInt64, IN_U64, OUT_U64, extremes<std::uint64_t>());
    expect_values_arrive<std::int64_t>(fmi3SetInt64, fmi3GetInt64, IN_COLOR, OUT_COLOR, {{-2147483648LL, 2147483647}});
}

TEST(Fmi3, TextsArriveAndTooLongAreRefused)
{
    Instance fmu;
    fmu.initialized();
    EXPECT_EQ(fmu.set(IN_TEXT, "seven c"), fmi3OK);
    EXPECT_EQ(fmu.set(IN_TEXT, "short"), fmi3OK); // nothing of the longer text stays behind it
    EXPECT_EQ(fmu.step(0.0, 0.01), fmi3OK);
    const fmi3ValueReference r = reference(OUT_TEXT);
    const char *text = nullptr;
    ASSERT_EQ(fmi3GetString(fmu.p, &r, 1, &text, 1), fmi3OK);
    EXPECT_STREQ(text, "short");
    EXPECT_EQ(fmu.set(IN_TEXT, "eight ch"), fmi3Error);
    EXPECT_TRUE(fmu.says("at most 7 bytes, found \"eight ch\""));
}

TEST(Fmi3, ManyVariablesOfOneCallFollowOneAnother)
{
    Instance fmu;
    fmu.initialized();
    const fmi3ValueReference in[] = {reference(GAIN), reference(IN_F64), reference(LIMIT)};
    const double values[] = {0.25, 3.0, 5.0, 100.0};
    ASSERT_EQ(fmi3SetFloat64(fmu.p, in, 3, values, 4), fmi3OK);
    ASSERT_EQ(fmu.step(0.0, 0.01), fmi3OK);
    const fmi3ValueReference out[] = {reference(INTEGRAL), reference(LIMIT), reference(TIME)};
    double got[4] = {};
    ASSERT_EQ(fmi3GetFloat64(fmu.p, out, 3, got, 4), fmi3OK);
    EXPECT_EQ(Numbers(got, got + 4), (Numbers{0.75, 1.25, 100.0, 0.01}));
}

// Each function of a type serves the variables of that type, and Int64 also enumerations.
TEST(Fmi3, AVariableOfAnotherTypeIsRefused)
{
    const std::map<FledgeType, std::function<fmi3Status(fmi3Instance, fmi3ValueReference, std::size_t)>> getters = {
#define GETTER(tag, type)                                                                                              \
    {                                                                                                                  \
        FLEDGE_##tag, [](fmi3Instance p, fmi3ValueReference r, std::size_t n) {                                        \
            fmi3##type values[8];                                                                                      \
            return fmi3Get##type(p, &r, 1, values, n);                                                                 \
        }                                                                                                              \
    }
        GETTER(F64, Float64), GETTER(F32, Float32), GETTER(I8, Int8),    GETTER(U8, UInt8),
        GETTER(I16, Int16),   GETTER(U16, UInt16),  GETTER(I32, Int32),  GETTER(U32, UInt32),
        GETTER(I64, Int64),   GETTER(U64, UInt64),  GETTER(CHAR, String)};
#undef GETTER
    for (std::uint32_t i = 0; i < N_NAMES; i++) {
        const FmuVariable &v = variable(static_cast<Name>(i));
        for (const auto &[type, get] : getters) {
            Instance fmu;
            fmu.initialized();
            const bool fits = v.role < FMU_CLOCK_MODE || v.role == FMU_TIME;
            const bool right = fits && (v.type == type || (v.type == FLEDGE_ENUM && type == FLEDGE_I64));
            const std::size_t n = v.type == FLEDGE_CHAR ? 1 : v.n;
            EXPECT_EQ(get(fmu.p, v.reference, n), right ? fmi3OK : fmi3Error) << i << " " << type;
            EXPECT_EQ(get(fmu.p, v.reference, n + 1), fmi3Error) << i << " " << type;
            EXPECT_EQ(get(fmu.p, v.reference, n - 1), fmi3Error) << i << " " << type;
        }
    }
}

TEST(Fmi3, IllegalReferencesAndNumbersAreRefused)
{
    const fmi3ValueReference inside = reference(IN_F64, 1); // an element has no reference of its own in 3.0
    const fmi3ValueReference outside = reference(DOWNLINK) + 1;
    const double x[2] = {1.0, 2.0};
    for (const fmi3ValueReference r : {inside, outside, ~0U}) {
        Instance fmu;
        EXPECT_EQ(fmi3SetFloat64(fmu.p, &r, 1, x, 2), fmi3Error);
        EXPECT_TRUE(fmu.says("no variable has the value reference " + std::to_string(r)));
    }
    for (const std::int64_t color : Wholes{2147483648, -2147483649, std::numeric_limits<std::int64_t>::max()}) {
        Instance fmu;
        EXPECT_EQ(fmu.set(IN_COLOR, Wholes{0, color}), fmi3Error);
        EXPECT_TRUE(fmu.says("out of range"));
    }
    const std::uint8_t *bytes = nullptr;
    std::size_t size = 0;
    for (const fmi3ValueReference r : {reference(IN_U8), reference(CLOCK_EVENT), outside}) {
        EXPECT_EQ(fmi3GetBinary(Instance().p, &r, 1, &size, &bytes, 1), fmi3Error);
        EXPECT_EQ(fmi3SetBinary(Instance().p, &r, 1, &size, &bytes, 1), fmi3Error);
    }
    const fmi3ValueReference down = reference(DOWNLINK);
    EXPECT_EQ(fmi3SetBinary(Instance().p, &down, 1, &size, &bytes, 1), fmi3Error);
    const fmi3ValueReference boolean = reference(IN_U8);
    bool flag = false;
    EXPECT_EQ(fmi3GetBoolean(Instance().p, &boolean, 1, &flag, 1), fmi3Error);
    for (const Name name : {TIME, OUT_F64, INTEGRAL}) {
        Instance fmu;
        EXPECT_EQ(fmu.set(name, Numbers(variable(name).n)), fmi3Error);
        EXPECT_TRUE(fmu.says("is not an input"));
    }
}

// ---- states

enum State { INSTANTIATED = 1, INITIALIZATION = 2, STEP = 4, EVENT = 8, TERMINATED = 16, ANY = 31 };

void drive(Instance &fmu, int state)
{
    if (state > INSTANTIATED) {
        ASSERT_EQ(fmu.enter(), fmi3OK);
    }
    if (state > INITIALIZATION) {
        ASSERT_EQ(fmi3ExitInitializationMode(fmu.p), fmi3OK); // to the event mode
    }
    if (state == STEP) {
        ASSERT_EQ(fmi3EnterStepMode(fmu.p), fmi3OK);
    }
    if (state == TERMINATED) {
        ASSERT_EQ(fmi3Terminate(fmu.p), fmi3OK);
    }
}

struct Function {
    const char *name;
    int states; ///< in which the standard allows it
    std::function<fmi3Status(Instance &)> call;
};

const std::vector<Function> FUNCTIONS = {
    {"fmi3SetDebugLogging", ANY, [](Instance &f) { return fmi3SetDebugLogging(f.p, true, 0, nullptr); }},
    {"fmi3EnterInitializationMode", INSTANTIATED, [](Instance &f) { return f.enter(); }},
    {"fmi3ExitInitializationMode", INITIALIZATION, [](Instance &f) { return fmi3ExitInitializationMode(f.p); }},
    {"fmi3EnterEventMode", STEP, [](Instance &f) { return fmi3EnterEventMode(f.p); }},
    {"fmi3EnterStepMode", EVENT, [](Instance &f) { return fmi3EnterStepMode(f.p); }},
    {"fmi3Terminate", STEP | EVENT, [](Instance &f) { return fmi3Terminate(f.p); }},
    {"fmi3Reset", ANY, [](Instance &f) { return fmi3Reset(f.p); }},
    {"fmi3EvaluateDiscreteStates", EVENT, [](Instance &f) { return fmi3EvaluateDiscreteStates(f.p); }},
    {"fmi3UpdateDiscreteStates", EVENT, [](Instance &f) { return f.update(); }},
    {"fmi3DoStep", STEP, [](Instance &f) { return f.step(0.0, 0.01); }},
    {"fmi3GetFloat64", ANY,
     [](Instance &f) {
         const fmi3ValueReference r = reference(OUT_F64);
         double x[2];
         return fmi3GetFloat64(f.p, &r, 1, x, 2);
     }},
    {"fmi3SetFloat64 of an input", ANY ^ TERMINATED,
     [](Instance &f) {
         return f.set(IN_F64, Numbers{1.0, 2.0});
     }},
    {"fmi3SetFloat64 of a tunable parameter", ANY ^ TERMINATED, [](Instance &f) { return f.set(GAIN, Numbers{1.0}); }},
    {"fmi3SetFloat64 of a fixed parameter", INSTANTIATED | INITIALIZATION,
     [](Instance &f) { return f.set(START, Numbers{1.0}); }},
    {"fmi3GetClock", EVENT,
     [](Instance &f) {
         const fmi3ValueReference r = reference(CLOCK_MODE);
         bool value;
         return fmi3GetClock(f.p, &r, 1, &value);
     }},
    {"fmi3GetFMUState", ANY,
     [](Instance &f) {
         fmi3FMUState state = nullptr;
         const fmi3Status status = fmi3GetFMUState(f.p, &state);
         fmi3FreeFMUState(f.p, &state);
         return status;
     }},
};

TEST(Fmi3, EachFunctionIsRefusedInTheStatesInWhichTheStandardForbidsIt)
{
    for (const Function &function : FUNCTIONS) {
        for (int state = INSTANTIATED; state <= TERMINATED; state *= 2) {
            Instance fmu(true, true);
            drive(fmu, state);
            const bool allowed = (function.states & state) != 0;
            EXPECT_EQ(function.call(fmu), allowed ? fmi3OK : fmi3Error) << function.name << " " << state;
            if (!allowed) {
                EXPECT_TRUE(fmu.says("forbids this call in the state") || fmu.says("fixed after the start"));
                EXPECT_EQ(fmu.step(0.0, 0.01), fmi3Error); // terminated
                EXPECT_TRUE(fmu.says("in the state Terminated"));
                EXPECT_EQ(fmi3Reset(fmu.p), fmi3OK);
                fmu.initialized();
            }
        }
    }
}

TEST(Fmi3, WithoutAnInstanceEachFunctionFails)
{
    fmi3FMUState state = nullptr;
    std::size_t size = 0;
    std::uint8_t byte = 0;
    for (const Function &function : FUNCTIONS) {
        Instance none(false, false, "{none}");
        EXPECT_EQ(function.call(none), fmi3Error) << function.name;
    }
    EXPECT_EQ(fmi3SetFMUState(nullptr, &byte), fmi3Error);
    EXPECT_EQ(fmi3SerializedFMUStateSize(nullptr, &byte, &size), fmi3Error);
    EXPECT_EQ(fmi3SerializeFMUState(nullptr, &byte, &byte, 1), fmi3Error);
    EXPECT_EQ(fmi3DeserializeFMUState(nullptr, &byte, 1, &state), fmi3Error);
}

TEST(Fmi3, AnImporterWithoutEventModeMayNotEnterIt)
{
    Instance fmu;
    fmu.initialized();
    EXPECT_EQ(fmi3EnterEventMode(fmu.p), fmi3Error);
    EXPECT_TRUE(fmu.says("eventModeUsed"));
}

TEST(Fmi3, WhatIsNotOfferedRefuses)
{
    double x = 0.0;
    std::size_t n = 1;
    std::uint32_t r = reference(CLOCK_MODE);
    std::uint64_t u = 0;
    std::int32_t order = 1;
    bool b = false;
    fmi3IntervalQualifier q{};
    fmi3DependencyKind kind{};
    const std::vector<std::function<fmi3Status(fmi3Instance)>> calls = {
        [&](fmi3Instance p) { return fmi3SetClock(p, &r, 1, &b); },
        [&](fmi3Instance p) { return fmi3GetNumberOfVariableDependencies(p, r, &n); },
        [&](fmi3Instance p) { return fmi3GetVariableDependencies(p, r, &n, &r, &n, &kind, 1); },
        [&](fmi3Instance p) { return fmi3GetDirectionalDerivative(p, &r, 1, &r, 1, &x, 1, &x, 1); },
        [&](fmi3Instance p) { return fmi3GetAdjointDerivative(p, &r, 1, &r, 1, &x, 1, &x, 1); },
        [&](fmi3Instance p) { return fmi3GetOutputDerivatives(p, &r, 1, &order, &x, 1); },
        [&](fmi3Instance p) { return fmi3EnterConfigurationMode(p); },
        [&](fmi3Instance p) { return fmi3ExitConfigurationMode(p); },
        [&](fmi3Instance p) { return fmi3GetIntervalDecimal(p, &r, 1, &x, &q); },
        [&](fmi3Instance p) { return fmi3GetIntervalFraction(p, &r, 1, &u, &u, &q); },
        [&](fmi3Instance p) { return fmi3GetShiftDecimal(p, &r, 1, &x); },
        [&](fmi3Instance p) { return fmi3GetShiftFraction(p, &r, 1, &u, &u); },
        [&](fmi3Instance p) { return fmi3SetIntervalDecimal(p, &r, 1, &x); },
        [&](fmi3Instance p) { return fmi3SetIntervalFraction(p, &r, 1, &u, &u); },
        [&](fmi3Instance p) { return fmi3SetShiftDecimal(p, &r, 1, &x); },
        [&](fmi3Instance p) { return fmi3SetShiftFraction(p, &r, 1, &u, &u); },
        [&](fmi3Instance p) { return fmi3EnterContinuousTimeMode(p); },
        [&](fmi3Instance p) { return fmi3CompletedIntegratorStep(p, b, &b, &b); },
        [&](fmi3Instance p) { return fmi3SetTime(p, x); },
        [&](fmi3Instance p) { return fmi3SetContinuousStates(p, &x, 1); },
        [&](fmi3Instance p) { return fmi3GetContinuousStates(p, &x, 1); },
        [&](fmi3Instance p) { return fmi3GetContinuousStateDerivatives(p, &x, 1); },
        [&](fmi3Instance p) { return fmi3GetEventIndicators(p, &x, 1); },
        [&](fmi3Instance p) { return fmi3GetNominalsOfContinuousStates(p, &x, 1); },
        [&](fmi3Instance p) { return fmi3GetNumberOfEventIndicators(p, &n); },
        [&](fmi3Instance p) { return fmi3GetNumberOfContinuousStates(p, &n); },
        [&](fmi3Instance p) { return fmi3ActivateModelPartition(p, r, x); },
    };
    for (const auto &call : calls) {
        Instance fmu;
        fmu.initialized();
        EXPECT_EQ(call(fmu.p), fmi3Error);
        EXPECT_TRUE(fmu.says("this FMU does not offer it"));
        EXPECT_EQ(call(nullptr), fmi3Error);
    }
}

} // namespace fmi3_test
