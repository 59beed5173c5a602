// SPDX-License-Identifier: Apache-2.0
// FMI 2.0 over a toy: what differs from FMI 3.0 (fmi3_test.cpp, run_test.cpp).
#include "fmi/fmu/testing/toy.h"

#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace fmi2_test {

using namespace fmi::testing;

/** An instance with its log, as printf writes it. */
struct Instance {
    explicit Instance(const char *resources = nullptr, fmi2Type type = fmi2CoSimulation, const char *guid = TOKEN)
    {
        callbacks = {&logged, nullptr, nullptr, nullptr, this};
        p = fmi2Instantiate("toy", type, guid, resources, &callbacks, fmi2False, fmi2True);
    }
    Instance(const Instance &) = delete;
    Instance &operator=(const Instance &) = delete;
    ~Instance() { fmi2FreeInstance(p); }

    static void logged(void *environment, fmi2String, fmi2Status status, fmi2String category, fmi2String format, ...)
    {
        char text[1000];
        va_list arguments;
        va_start(arguments, format);
        std::vsnprintf(text, sizeof text, format, arguments);
        va_end(arguments);
        static_cast<Instance *>(environment)
            ->log.push_back(std::to_string(static_cast<int>(status)) + " " + category + ": " + text);
    }

    bool says(const std::string &text) const { return !log.empty() && log.back().find(text) != std::string::npos; }

    void initialized()
    {
        EXPECT_EQ(fmi2EnterInitializationMode(p), fmi2OK);
        EXPECT_EQ(fmi2ExitInitializationMode(p), fmi2OK);
    }

    fmi2Status step(double t, double h) { return fmi2DoStep(p, t, h, fmi2True); }

    double real(Name name, std::uint32_t element = 0)
    {
        const fmi2ValueReference r = reference(name, element);
        double x = -1.0;
        EXPECT_EQ(fmi2GetReal(p, &r, 1, &x), fmi2OK);
        return x;
    }
    int integer(Name name, std::uint32_t element = 0)
    {
        const fmi2ValueReference r = reference(name, element);
        int x = -1;
        EXPECT_EQ(fmi2GetInteger(p, &r, 1, &x), fmi2OK);
        return x;
    }
    fmi2Status set(Name name, std::uint32_t element, double x)
    {
        const fmi2ValueReference r = reference(name, element);
        return fmi2SetReal(p, &r, 1, &x);
    }
    fmi2Status set(Name name, std::uint32_t element, int x)
    {
        const fmi2ValueReference r = reference(name, element);
        return fmi2SetInteger(p, &r, 1, &x);
    }

    std::vector<std::string> log;
    fmi2CallbackFunctions callbacks;
    fmi2Component p;
};

TEST(Fmi2, AnInstanceThatCannotBeSaysWhy)
{
    EXPECT_STREQ(fmi2GetVersion(), "2.0");
    EXPECT_STREQ(fmi2GetTypesPlatform(), "default");
    const Instance exchange(nullptr, fmi2ModelExchange);
    EXPECT_EQ(exchange.p, nullptr);
    EXPECT_TRUE(exchange.says("co-simulation alone"));
    const Instance other(nullptr, fmi2CoSimulation, "{100%}");
    EXPECT_EQ(other.p, nullptr);
    EXPECT_TRUE(other.says("the token \"{100%}\", this library \"{toy}\""));
    EXPECT_EQ(fmi2Instantiate("toy", fmi2CoSimulation, "", nullptr, nullptr, fmi2False, fmi2False), nullptr);
}

TEST(Fmi2, ResourcesAreAUri)
{
    for (const auto &[uri, path] :
         std::vector<std::pair<const char *, std::string>>{{"file:///tmp/a%20b%2Fc/resources", "/tmp/a b/c/resources"},
                                                           {"file:/tmp/resources/", "/tmp/resources"},
                                                           {"file://localhost/tmp/r", "/tmp/r"},
                                                           {"/tmp/50%/r", "/tmp/50%/r"},
                                                           {"file:///tmp/5%zz%4", "/tmp/5%zz%4"},
                                                           {nullptr, ""}}) {
        EXPECT_EQ(Instance(uri).log.at(0), "0 events: " + path);
    }
}

// Each element has a reference of its own.
TEST(Fmi2, ElementsOfEachTypeArriveAsRealsAndIntegers)
{
    struct Case {
        Name in, out;
        double low, high;
        bool real;
    };
    for (const Case &c : {Case{IN_F64, OUT_F64, -1e300, std::numeric_limits<double>::denorm_min(), true},
                          {IN_F32, OUT_F32, -0.5, 3.25, true},
                          {IN_U32, OUT_U32, 0.0, 4294967295.0, true},
                          {IN_I64, OUT_I64, -9007199254740991.0, 9007199254740991.0, true},
                          {IN_U64, OUT_U64, 4503599627370497.0, 9007199254740991.0, true},
                          {IN_I8, OUT_I8, -128, 127, false},
                          {IN_U8, OUT_U8, 0, 255, false},
                          {IN_I16, OUT_I16, -32768, 32767, false},
                          {IN_U16, OUT_U16, 0, 65535, false},
                          {IN_I32, OUT_I32, -2147483648.0, 2147483647, false},
                          {IN_COLOR, OUT_COLOR, -2147483648.0, 2147483647, false}}) {
        for (const std::uint32_t element : {0U, 1U}) {
            for (const double x : {c.low, c.high}) {
                Instance fmu;
                fmu.initialized();
                ASSERT_EQ(c.real ? fmu.set(c.in, element, x) : fmu.set(c.in, element, static_cast<int>(x)), fmi2OK);
                ASSERT_EQ(fmu.step(0.0, 0.01), fmi2OK);
                EXPECT_EQ(c.real ? fmu.real(c.out, element) : fmu.integer(c.out, element), x) << c.in;
                EXPECT_EQ(c.real ? fmu.real(c.out, 1 - element) : fmu.integer(c.out, 1 - element), 0.0) << c.in;
                EXPECT_EQ(c.real ? fmu.set(c.in, 0, 1) : fmu.set(c.in, 0, 1.0), fmi2Error); // the other type
                EXPECT_TRUE(fmu.says("another type"));
            }
        }
    }
    Instance fmu;
    const double nan = std::nan("");
    ASSERT_EQ(fmu.set(IN_F64, 1, nan), fmi2OK); // flight judges it
    ASSERT_EQ(fmu.set(IN_F32, 1, nan), fmi2OK);
    fmu.initialized();
    EXPECT_TRUE(std::isnan(fmu.real(OUT_F64, 1)));
    EXPECT_TRUE(std::isnan(fmu.real(OUT_F32, 1)));
}

TEST(Fmi2, NumbersThatTheTypeCannotHaveAreRefused)
{
    const auto refuses = [](Name name, auto x) {
        Instance fmu;
        EXPECT_EQ(fmu.set(name, 1, x), fmi2Error) << name << " " << x;
        EXPECT_TRUE(fmu.says("out of range"));
    };
    refuses(IN_I8, 128);
    refuses(IN_U8, -1);
    refuses(IN_I16, -32769);
    refuses(IN_U16, 65536);
    refuses(IN_U32, -1.0);
    refuses(IN_U32, 4294967296.0);
    refuses(IN_U32, std::nan(""));
    refuses(IN_I64, 1e19);
    refuses(IN_U64, -1.0);
    Instance fmu;
    fmi2ValueReference r = reference(DOWNLINK) + 1;
    double x;
    EXPECT_EQ(fmi2GetReal(fmu.p, &r, 1, &x), fmi2Error);
    r = reference(IN_U8);
    int b;
    EXPECT_EQ(fmi2GetBoolean(Instance().p, &r, 1, &b), fmi2Error);
    EXPECT_EQ(fmi2SetBoolean(Instance().p, &r, 1, &b), fmi2Error);
}

TEST(Fmi2, TextsHaveAReferenceEach)
{
    Instance fmu;
    const fmi2ValueReference in[] = {reference(LABEL), reference(IN_TEXT)};
    const char *const texts[] = {"label", "seven c"};
    ASSERT_EQ(fmi2SetString(fmu.p, in, 2, texts), fmi2OK);
    fmu.initialized();
    const fmi2ValueReference out[] = {reference(OUT_TEXT), reference(LABEL)};
    const char *got[2] = {};
    ASSERT_EQ(fmi2GetString(fmu.p, out, 2, got), fmi2OK);
    EXPECT_STREQ(got[0], "seven c");
    EXPECT_STREQ(got[1], "label");
    EXPECT_EQ(reference(OUT_F64), reference(IN_TEXT) + 1);
}

enum State { INSTANTIATED = 1, INITIALIZATION = 2, STEP = 4, TERMINATED = 8, ANY = 15 };

struct Function {
    const char *name;
    int states; ///< in which the standard allows it
    std::function<fmi2Status(Instance &)> call;
};

const std::vector<Function> FUNCTIONS = {
    {"fmi2SetDebugLogging", ANY, [](Instance &f) { return fmi2SetDebugLogging(f.p, fmi2True, 0, nullptr); }},
    {"fmi2SetupExperiment", INSTANTIATED,
     [](Instance &f) { return fmi2SetupExperiment(f.p, fmi2False, 0.0, 0.0, fmi2True, 1.0); }},
    {"fmi2EnterInitializationMode", INSTANTIATED, [](Instance &f) { return fmi2EnterInitializationMode(f.p); }},
    {"fmi2ExitInitializationMode", INITIALIZATION, [](Instance &f) { return fmi2ExitInitializationMode(f.p); }},
    {"fmi2Terminate", STEP, [](Instance &f) { return fmi2Terminate(f.p); }},
    {"fmi2Reset", ANY, [](Instance &f) { return fmi2Reset(f.p); }},
    {"fmi2DoStep", STEP, [](Instance &f) { return f.step(0.0, 0.01); }},
    {"fmi2SetReal", ANY ^ TERMINATED, [](Instance &f) { return f.set(IN_F64, 0, 1.0); }},
    {"fmi2GetRealStatus", STEP | TERMINATED,
     [](Instance &f) {
         double t;
         return fmi2GetRealStatus(f.p, fmi2LastSuccessfulTime, &t);
     }},
    {"fmi2GetBooleanStatus", STEP | TERMINATED,
     [](Instance &f) {
         int ended;
         return fmi2GetBooleanStatus(f.p, fmi2Terminated, &ended);
     }},
};

TEST(Fmi2, EachFunctionIsRefusedInTheStatesInWhichTheStandardForbidsIt)
{
    for (const Function &function : FUNCTIONS) {
        for (int state = INSTANTIATED; state <= TERMINATED; state *= 2) {
            Instance fmu;
            if (state > INSTANTIATED) {
                ASSERT_EQ(fmi2EnterInitializationMode(fmu.p), fmi2OK);
            }
            if (state > INITIALIZATION) {
                ASSERT_EQ(fmi2ExitInitializationMode(fmu.p), fmi2OK);
            }
            if (state == TERMINATED) {
                ASSERT_EQ(fmi2Terminate(fmu.p), fmi2OK);
            }
            const bool allowed = (function.states & state) != 0;
            EXPECT_EQ(function.call(fmu), allowed ? fmi2OK : fmi2Error) << function.name << " " << state;
            EXPECT_TRUE(allowed || fmu.says("forbids this call in the state")) << function.name << " " << state;
        }
    }
}

TEST(Fmi2, ADiscardedStepHasAStatus)
{
    Instance fmu;
    ASSERT_EQ(fmi2SetupExperiment(fmu.p, fmi2False, 0.0, 5.0, fmi2False, 0.0), fmi2OK);
    fmu.initialized();
    ASSERT_EQ(fmu.step(5.0, 0.1), fmi2OK);
    ASSERT_EQ(fmu.set(GAIN, 0, -1.0), fmi2OK);
    EXPECT_EQ(fmu.step(5.1, 0.1), fmi2Discard);
    EXPECT_EQ(fmu.log.at(fmu.log.size() - 2), "3 errors: gain must be > 0 and < limit: 100 % of it, ##1");
    double t = 0.0;
    int ended = 7;
    fmi2Status status;
    fmi2String text;
    EXPECT_EQ(fmi2GetRealStatus(fmu.p, fmi2LastSuccessfulTime, &t), fmi2OK);
    EXPECT_EQ(t, 5.1);
    EXPECT_EQ(fmi2GetBooleanStatus(fmu.p, fmi2Terminated, &ended), fmi2OK);
    EXPECT_EQ(ended, fmi2False);
    EXPECT_EQ(fmi2GetStatus(fmu.p, fmi2DoStepStatus, &status), fmi2Discard);
    EXPECT_EQ(fmi2GetStringStatus(fmu.p, fmi2PendingStatus, &text), fmi2Discard);
    EXPECT_EQ(fmi2GetIntegerStatus(fmu.p, fmi2DoStepStatus, &ended), fmi2Discard);
    EXPECT_EQ(fmi2GetRealStatus(fmu.p, fmi2Terminated, &t), fmi2Discard);
    EXPECT_EQ(fmi2GetBooleanStatus(fmu.p, fmi2LastSuccessfulTime, &ended), fmi2Discard);
    EXPECT_EQ(fmu.step(5.1, 0.1), fmi2OK);
    EXPECT_EQ(fmi2Terminate(fmu.p), fmi2OK);
    EXPECT_EQ(fmi2Reset(fmu.p), fmi2OK);
    ASSERT_EQ(fmi2SetupExperiment(fmu.p, fmi2False, 0.0, 5.0, fmi2True, 5.1), fmi2OK);
    fmu.initialized();
    EXPECT_EQ(fmu.step(5.0, 0.2), fmi2Error);
    EXPECT_TRUE(fmu.says("the stop time 5.1 s"));
}

TEST(Fmi2, AStateContinuesInAnotherInstance)
{
    Instance fmu, other;
    fmu.initialized();
    ASSERT_EQ(fmu.set(IN_F64, 0, 0.125), fmi2OK);
    ASSERT_EQ(fmu.step(0.0, 0.035), fmi2OK);
    fmi2FMUstate state = nullptr;
    std::size_t size = 0;
    ASSERT_EQ(fmi2GetFMUstate(fmu.p, &state), fmi2OK);
    ASSERT_EQ(fmi2SerializedFMUstateSize(fmu.p, state, &size), fmi2OK);
    std::vector<char> bytes(size);
    ASSERT_EQ(fmi2SerializeFMUstate(fmu.p, state, bytes.data(), size), fmi2OK);
    ASSERT_EQ(fmu.step(0.035, 0.035), fmi2OK);
    const double later = fmu.real(INTEGRAL);
    EXPECT_EQ(later, 7 * 0.0625);
    ASSERT_EQ(fmi2SetFMUstate(fmu.p, state), fmi2OK);
    EXPECT_EQ(fmi2FreeFMUstate(fmu.p, &state), fmi2OK);
    ASSERT_EQ(fmi2DeSerializeFMUstate(other.p, bytes.data(), size, &state), fmi2OK);
    ASSERT_EQ(fmi2SetFMUstate(other.p, state), fmi2OK);
    EXPECT_EQ(fmi2FreeFMUstate(other.p, &state), fmi2OK);
    for (Instance *p : {&fmu, &other}) {
        EXPECT_EQ(p->real(INTEGRAL), 3 * 0.0625);
        ASSERT_EQ(p->step(0.035, 0.035), fmi2OK);
        EXPECT_EQ(p->real(INTEGRAL), later);
    }
    bytes[size / 2] ^= 1;
    EXPECT_EQ(fmi2DeSerializeFMUstate(other.p, bytes.data(), size, &state), fmi2Error);
    EXPECT_TRUE(other.says("damaged"));
}

TEST(Fmi2, WhatIsNotOfferedRefuses)
{
    double x = 0.0;
    fmi2ValueReference r = reference(IN_F64);
    int i = 1;
    fmi2EventInfo info;
    const std::vector<std::function<fmi2Status(fmi2Component)>> calls = {
        [&](fmi2Component p) { return fmi2SetRealInputDerivatives(p, &r, 1, &i, &x); },
        [&](fmi2Component p) { return fmi2GetRealOutputDerivatives(p, &r, 1, &i, &x); },
        [&](fmi2Component p) { return fmi2GetDirectionalDerivative(p, &r, 1, &r, 1, &x, &x); },
        [&](fmi2Component p) { return fmi2CancelStep(p); },
        [&](fmi2Component p) { return fmi2EnterEventMode(p); },
        [&](fmi2Component p) { return fmi2NewDiscreteStates(p, &info); },
        [&](fmi2Component p) { return fmi2EnterContinuousTimeMode(p); },
        [&](fmi2Component p) { return fmi2CompletedIntegratorStep(p, fmi2True, &i, &i); },
        [&](fmi2Component p) { return fmi2SetTime(p, x); },
        [&](fmi2Component p) { return fmi2SetContinuousStates(p, &x, 1); },
        [&](fmi2Component p) { return fmi2GetContinuousStates(p, &x, 1); },
        [&](fmi2Component p) { return fmi2GetDerivatives(p, &x, 1); },
        [&](fmi2Component p) { return fmi2GetEventIndicators(p, &x, 1); },
        [&](fmi2Component p) { return fmi2GetNominalsOfContinuousStates(p, &x, 1); },
    };
    for (const auto &call : calls) {
        Instance fmu;
        fmu.initialized();
        EXPECT_EQ(call(fmu.p), fmi2Error);
        EXPECT_TRUE(fmu.says("this FMU does not offer it"));
        EXPECT_EQ(call(nullptr), fmi2Error);
    }
}

} // namespace fmi2_test
