// SPDX-License-Identifier: Apache-2.0
// What an FMU does in a run, by FMI 3.0 over a toy: the instant 0, steps, heads, parameters, events and packets.
#include "fmi/fmu/testing/instance.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace run_test {

using namespace fmi::testing;

constexpr std::int64_t MS = 1'000'000; // [ns]

// The oracle: with a gain of 0.5, each instant adds half of the input.
TEST(FmuRun, TheInstant0FollowsWhatIsSetInInitialization)
{
    Instance fmu;
    ASSERT_EQ(fmu.set(START, Numbers{0.25}), fmi3OK);
    ASSERT_EQ(fmu.set(IN_F64, Numbers{1.0, 2.0}), fmi3OK);
    EXPECT_EQ(fmu.f64(INTEGRAL), (Numbers{0.0, 0.0})); // not yet
    ASSERT_EQ(fmu.enter(100.0), fmi3OK);
    EXPECT_EQ(fmu.f64(TIME), Numbers{100.0});
    EXPECT_EQ(fmu.f64(INTEGRAL), (Numbers{0.75, 1.25}));
    ASSERT_EQ(fmu.set(IN_F64, Numbers{4.0, 4.0}), fmi3OK);
    ASSERT_EQ(fmu.set(START, Numbers{0.0}), fmi3OK);
    EXPECT_EQ(fmu.f64(IN_F64), (Numbers{4.0, 4.0}));
    EXPECT_EQ(fmu.f64(INTEGRAL), (Numbers{2.0, 2.0}));
    ASSERT_EQ(fmu.set(IN_F64, Numbers{6.0, 6.0}), fmi3OK);
    ASSERT_EQ(fmi3ExitInitializationMode(fmu.p), fmi3OK);
    EXPECT_EQ(fmu.f64(INTEGRAL), (Numbers{3.0, 3.0}));
    EXPECT_EQ(fmu.u32(SEEN_SEQUENCE), 1U); // however often it ran
    EXPECT_EQ(std::count(fmu.log.begin(), fmu.log.end(), "0 events: the run begins"), 3);
    EXPECT_EQ(fmu.i64(LAST), 0);
}

TEST(FmuRun, AStepRunsTheInstantsBehindItsBeginAndUpToItsEnd)
{
    std::mt19937 random(1);
    Instance fmu;
    fmu.initialized();
    std::int64_t now = 0; // [ns]
    for (int i = 0; i < 1000; i++) {
        const std::int64_t h = std::uniform_int_distribution<std::int64_t>(1, 35'000'000)(random);
        ASSERT_EQ(fmu.step(static_cast<double>(now) / 1e9, static_cast<double>(h) / 1e9), fmi3OK);
        now += h;
        EXPECT_EQ(fmu.i64(LAST), now / (10 * MS) * (10 * MS));
        EXPECT_EQ(fmu.reached, fmu.f64(TIME)[0]);
        EXPECT_NEAR(fmu.reached, static_cast<double>(now) / 1e9, 1e-12);
        EXPECT_FALSE(fmu.early || fmu.events || fmu.terminate);
    }
}

// Importers compute time in several ways: each step must end at its instant, neither before nor behind.
TEST(FmuRun, TimesOfImportersThatRoundOrAddUpAreUnderstood)
{
    for (const double start : {0.0, 1.75e9, -3.0e5}) {
        for (const std::int64_t ns : {10 * MS, 30 * MS, 100 * MS}) {
            const double h = static_cast<double>(ns) / 1e9;
            Instance adding, counting, differing;
            adding.initialized(start);
            counting.initialized(start);
            differing.initialized(start);
            double t = start;
            for (int i = 0; i < 20'000; i++) {
                ASSERT_EQ(adding.step(t, h), fmi3OK);
                t += h;
                const double now = start + i * h;
                const double next = start + (i + 1) * h;
                ASSERT_EQ(counting.step(now, h), fmi3OK);
                ASSERT_EQ(differing.step(now, next - now), fmi3OK);
                ASSERT_EQ(adding.i64(LAST), (i + 1) * ns);
                ASSERT_EQ(counting.i64(LAST), (i + 1) * ns);
                ASSERT_EQ(differing.i64(LAST), (i + 1) * ns);
            }
        }
    }
    // After an early end, as of another FMU, the rest of a step is no whole number of ns.
    for (const double h : {0.1, 0.3, 0.7}) {
        Instance fmu;
        fmu.initialized();
        double t = 0.0;
        for (int i = 0; i < 30'000; i++) {
            const double end = t + h;
            const double middle = t + h / 3.0;
            ASSERT_EQ(fmu.step(t, middle - t), fmi3OK);
            ASSERT_EQ(fmu.step(middle, end - middle), fmi3OK);
            t = end;
            ASSERT_EQ(fmu.i64(LAST), std::llround(1e3 * h) * MS * (i + 1));
        }
    }
    Instance third; // three steps are 10 ms: no number of ns is one of them
    third.initialized();
    for (int i = 0; i < 30'000; i++) {
        ASSERT_EQ(third.step(i * 0.01 / 3.0, 0.01 / 3.0), fmi3OK);
        ASSERT_EQ(third.i64(LAST), (i + 1) / 3 * 10 * MS);
    }
}

TEST(FmuRun, ImpossibleStepsAreRefused)
{
    const double nan = std::nan("");
    struct Case {
        double t, h;
        const char *text;
    };
    for (const Case &c : {Case{0.0, 0.0, "must be > 0 s, found 0 s"},
                          {0.0, -0.1, "found -0.1 s"},
                          {0.0, nan, "found nan"},
                          {0.2, 0.1, "where the FMU is, at 0 s; found 0.2 s"},
                          {nan, 0.1, "found nan"},
                          {0.0, 1e12, "at most 8e9 s"}}) {
        Instance fmu;
        fmu.initialized();
        EXPECT_EQ(fmu.step(c.t, c.h), fmi3Error);
        EXPECT_TRUE(fmu.says(c.text)) << fmu.log.back();
    }
    Instance fmu;
    ASSERT_EQ(fmi3EnterInitializationMode(fmu.p, false, 0.0, 1.0, true, 1.1), fmi3OK);
    ASSERT_EQ(fmi3ExitInitializationMode(fmu.p), fmi3OK);
    EXPECT_EQ(fmu.step(1.0, 0.1), fmi3OK); // to the stop time
    EXPECT_EQ(fmu.step(1.1, 0.1), fmi3Error);
    EXPECT_TRUE(fmu.says("after the stop time 1.1 s"));
    for (const double start : {nan, HUGE_VAL}) {
        EXPECT_EQ(Instance().enter(start), fmi3Error);
    }
    EXPECT_EQ(fmi3EnterInitializationMode(Instance().p, false, 0.0, 1.0, true, 0.5), fmi3Error);
}

TEST(FmuRun, AMessageGetsAHeadForEachStepBeforeWhichItWasSet)
{
    Instance fmu;
    fmu.initialized(5.0);
    EXPECT_EQ(fmu.i64(SEEN_QUALITY), QUALITY_NONE);
    ASSERT_EQ(fmu.step(5.0, 0.01), fmi3OK);
    EXPECT_EQ(fmu.i64(SEEN_QUALITY), QUALITY_NONE); // never set
    ASSERT_EQ(fmu.set(IN_F64, Numbers{1.0, 1.0}), fmi3OK);
    ASSERT_EQ(fmu.set(IN_F64, Numbers{2.0, 1.0}), fmi3OK);
    ASSERT_EQ(fmu.step(5.01, 0.01), fmi3OK);
    EXPECT_EQ(fmu.i64(SEEN_QUALITY), QUALITY_GOOD);
    EXPECT_EQ(fmu.i64(SEEN_T), 10 * MS);
    EXPECT_EQ(fmu.u32(SEEN_SEQUENCE), 1U);
    EXPECT_EQ(fmu.i64(COMMANDED_QUALITY), QUALITY_NONE);
    ASSERT_EQ(fmu.set(COMMAND_U, Numbers{1.0}), fmi3OK); // the other message
    ASSERT_EQ(fmu.step(5.02, 0.01), fmi3OK);             // not set again
    EXPECT_EQ(fmu.i64(COMMANDED_QUALITY), QUALITY_GOOD);
    EXPECT_EQ(fmu.i64(COMMANDED_T), 20 * MS);
    EXPECT_EQ(fmu.i64(SEEN_T), 10 * MS);
    EXPECT_EQ(fmu.u32(SEEN_SEQUENCE), 1U);
    ASSERT_EQ(fmu.set(IN_F64, Numbers{1.0, 1.0}), fmi3OK);
    ASSERT_EQ(fmu.step(5.03, 0.01), fmi3OK);
    EXPECT_EQ(fmu.i64(SEEN_T), 30 * MS);
    EXPECT_EQ(fmu.u32(SEEN_SEQUENCE), 2U);
}

TEST(FmuRun, AHeadThatTheImporterSetsIsItsOwn)
{
    Instance fmu;
    ASSERT_EQ(fmu.set(IN_QUALITY, Wholes{QUALITY_DEGRADED}), fmi3OK);
    fmu.initialized();
    for (int i = 0; i < 3; i++) {
        ASSERT_EQ(fmu.set(IN_T, Wholes{7 * i}), fmi3OK);
        ASSERT_EQ(fmu.set(IN_F64, Numbers{1.0, 1.0}), fmi3OK);
        ASSERT_EQ(fmu.step(0.01 * i, 0.01), fmi3OK);
        EXPECT_EQ(fmu.i64(SEEN_QUALITY), QUALITY_DEGRADED);
        EXPECT_EQ(fmu.i64(SEEN_T), 7 * i);
        EXPECT_EQ(fmu.u32(SEEN_SEQUENCE), 0U);
    }
    ASSERT_EQ(fmi3Reset(fmu.p), fmi3OK);
    ASSERT_EQ(fmu.set(IN_F64, Numbers{1.0, 1.0}), fmi3OK);
    fmu.initialized();
    EXPECT_EQ(fmu.i64(SEEN_QUALITY), QUALITY_GOOD);
}

TEST(FmuRun, AParameterOutOfItsBoundsDiscardsTheStep)
{
    Instance fmu;
    fmu.initialized();
    ASSERT_EQ(fmu.set(IN_F64, Numbers{1.0, 0.0}), fmi3OK);
    ASSERT_EQ(fmu.set(LIMIT, Numbers{9.0}), fmi3OK);
    ASSERT_EQ(fmu.step(0.0, 0.01), fmi3OK);
    ASSERT_EQ(fmu.set(LIMIT, Numbers{4.0}), fmi3OK);
    ASSERT_EQ(fmu.set(LABEL, "new"), fmi3OK);
    ASSERT_EQ(fmu.set(GAIN, Numbers{5.0}), fmi3OK);
    ASSERT_EQ(fmu.set(GAIN, Numbers{6.0}), fmi3OK);
    EXPECT_EQ(fmu.f64(GAIN), Numbers{6.0});
    EXPECT_EQ(fmu.step(0.01, 0.01), fmi3Discard);
    EXPECT_EQ(fmu.log.at(fmu.log.size() - 2), "3 errors: gain must be > 0 and < limit: 100 % of it, ##1");
    EXPECT_TRUE(fmu.says("2 warnings: fmi3DoStep: a parameter was out of its bounds")) << fmu.log.back();
    EXPECT_EQ(fmu.f64(GAIN), Numbers{0.5});
    EXPECT_EQ(fmu.f64(LIMIT), Numbers{9.0});
    EXPECT_EQ(fmu.f64(INTEGRAL), (Numbers{0.5, 0.0}));
    EXPECT_EQ(fmu.reached, 0.01);
    ASSERT_EQ(fmu.set(GAIN, Numbers{5.0}), fmi3OK); // below the limit, which is 9 again
    EXPECT_EQ(fmu.step(0.01, 0.01), fmi3OK);
    EXPECT_EQ(fmu.f64(INTEGRAL), (Numbers{5.5, 0.0}));
}

TEST(FmuRun, AParameterOutOfItsBoundsEndsTheInitialization)
{
    Instance early, late, fixed;
    ASSERT_EQ(early.set(GAIN, Numbers{-1.0}), fmi3OK);
    EXPECT_EQ(early.enter(), fmi3Error);
    ASSERT_EQ(late.enter(), fmi3OK);
    ASSERT_EQ(late.set(START, Numbers{1.5}), fmi3OK);
    EXPECT_EQ(fmi3ExitInitializationMode(late.p), fmi3Error);
    EXPECT_TRUE(late.says("a parameter is out of its bounds"));
    fixed.initialized();
    EXPECT_EQ(fixed.set(START, Numbers{0.5}), fmi3Error);
    EXPECT_TRUE(fixed.says("is fixed after the start"));
}

TEST(FmuRun, AStepThatFailsEndsTheRun)
{
    Instance fmu;
    fmu.initialized();
    ASSERT_EQ(fmu.set(LABEL, "fail"), fmi3OK);
    EXPECT_EQ(fmu.step(0.0, 0.01), fmi3Error);
    EXPECT_EQ(fmu.log.at(fmu.log.size() - 2), "3 errors: the label fails");
    EXPECT_EQ(fmu.step(0.0, 0.01), fmi3Error);
    EXPECT_TRUE(fmu.says("in the state Terminated"));
}

TEST(FmuRun, AModeIsEnteredWhenItsRequestChanges)
{
    Instance fmu;
    fmu.initialized();
    EXPECT_EQ(fmu.i64(MODE), 1);
    ASSERT_EQ(fmu.set(REQUEST, Wholes{2}), fmi3OK);
    EXPECT_EQ(fmu.i64(MODE), 1); // with the next step
    ASSERT_EQ(fmu.step(0.0, 0.01), fmi3OK);
    EXPECT_EQ(fmu.i64(MODE), 2);
    ASSERT_EQ(fmu.set(REQUEST, Wholes{1}), fmi3OK);
    ASSERT_EQ(fmu.step(0.01, 0.01), fmi3OK);
    EXPECT_EQ(fmu.i64(MODE), 1);
    ASSERT_EQ(fmu.set(IN_F64, Numbers{20.0, 0.0}), fmi3OK); // the mode 2 begins by itself
    ASSERT_EQ(fmu.set(REQUEST, Wholes{1}), fmi3OK);         // held, not new
    ASSERT_EQ(fmu.step(0.02, 0.01), fmi3OK);
    ASSERT_EQ(fmu.set(IN_F64, Numbers{-1000.0, 0.0}), fmi3OK);
    ASSERT_EQ(fmu.step(0.03, 0.01), fmi3OK);
    EXPECT_EQ(fmu.i64(MODE), 2);
    ASSERT_EQ(fmu.set(REQUEST, Wholes{0}), fmi3OK);
    ASSERT_EQ(fmu.set(OTHER_REQUEST, Wholes{2}), fmi3OK);
    ASSERT_EQ(fmu.step(0.04, 0.01), fmi3OK);
    EXPECT_EQ(fmu.i64(MODE), 2);
    EXPECT_EQ(fmu.i64(OTHER_MODE), 2);
    ASSERT_EQ(fmu.set(REQUEST, Wholes{9}), fmi3OK);
    EXPECT_EQ(fmu.step(0.05, 0.01), fmi3OK); // flight goes on
    EXPECT_TRUE(fmu.says("the modes are 1 and 2"));
    EXPECT_EQ(fmu.i64(MODE), 2);
}

// The input of 4 adds 2 at each instant: the limit of 8 is passed at the instant 40 ms, behind the 2 of the instant 0.
TEST(FmuRun, AStepReturnsEarlyWhereAModeBegins)
{
    for (const bool early : {false, true}) {
        for (const bool events : {false, true}) {
            Instance fmu(events, early);
            ASSERT_EQ(fmu.set(IN_F64, Numbers{4.0, 0.0}), fmi3OK);
            fmu.initialized(1.0);
            if (events) {
                EXPECT_FALSE(fmu.clock(CLOCK_MODE));
                ASSERT_EQ(fmi3EnterStepMode(fmu.p), fmi3OK);
            }
            ASSERT_EQ(fmu.step(1.0, 0.1), fmi3OK);
            EXPECT_EQ(fmu.early, early);
            EXPECT_EQ(fmu.events, events);
            EXPECT_DOUBLE_EQ(fmu.reached, early ? 1.04 : 1.1);
            EXPECT_EQ(fmu.i64(LAST), early ? 40 * MS : 100 * MS);
            if (events) {
                ASSERT_EQ(fmi3EnterEventMode(fmu.p), fmi3OK);
                EXPECT_TRUE(fmu.clock(CLOCK_MODE));
                EXPECT_TRUE(fmu.clock(CLOCK_MODE)); // until the event ends
                EXPECT_FALSE(fmu.clock(CLOCK_EVENT));
                ASSERT_EQ(fmu.set(IN_COLOR, Wholes{7, 0}), fmi3OK);
                ASSERT_EQ(fmu.update(), fmi3OK);
                EXPECT_FALSE(fmu.clock(CLOCK_MODE));
                ASSERT_EQ(fmi3EnterStepMode(fmu.p), fmi3OK);
                ASSERT_EQ(fmu.step(fmu.reached, 0.005), fmi3OK); // no instant
                EXPECT_FALSE(fmu.early || fmu.events);
                ASSERT_EQ(fmu.step(fmu.reached, 0.005), fmi3OK);
                EXPECT_FALSE(fmu.early); // at the end of the step
                EXPECT_TRUE(fmu.events);
                EXPECT_EQ(fmu.u32(FIRED), 1U);
                ASSERT_EQ(fmi3EnterEventMode(fmu.p), fmi3OK);
                EXPECT_TRUE(fmu.clock(CLOCK_EVENT));
            }
        }
    }
}

TEST(FmuRun, AnEventThatTheImporterDoesNotHandleIsForgotten)
{
    Instance fmu(true, false);
    fmu.initialized();
    ASSERT_EQ(fmi3EnterStepMode(fmu.p), fmi3OK);
    ASSERT_EQ(fmu.set(COMMAND_U, Numbers{7.0}), fmi3OK);
    ASSERT_EQ(fmu.step(0.0, 0.01), fmi3OK);
    EXPECT_TRUE(fmu.events);
    ASSERT_EQ(fmu.set(COMMAND_U, Numbers{0.0}), fmi3OK);
    ASSERT_EQ(fmu.step(0.01, 0.01), fmi3OK);
    EXPECT_FALSE(fmu.events);
    EXPECT_EQ(fmu.u32(OTHER_FIRED), 1U);
    ASSERT_EQ(fmu.set(OTHER_REQUEST, Wholes{2}), fmi3OK);
    ASSERT_EQ(fmu.step(0.02, 0.01), fmi3OK);
    ASSERT_EQ(fmi3EnterEventMode(fmu.p), fmi3OK);
    EXPECT_FALSE(fmu.clock(CLOCK_MODE) || fmu.clock(CLOCK_EVENT) || fmu.clock(OTHER_CLOCK_EVENT));
    EXPECT_TRUE(fmu.clock(OTHER_CLOCK_MODE));
}

TEST(FmuRun, AnEventOfTheInstant0IsInTheFirstEventMode)
{
    Instance fmu(true, false);
    ASSERT_EQ(fmu.set(IN_COLOR, Wholes{7, 0}), fmi3OK);
    fmu.initialized();
    EXPECT_TRUE(fmu.clock(CLOCK_EVENT));
    EXPECT_EQ(fmu.u32(FIRED), 1U);
    const fmi3ValueReference r = reference(IN_F64);
    bool value;
    EXPECT_EQ(fmi3GetClock(fmu.p, &r, 1, &value), fmi3Error);
}

TEST(FmuRun, PacketsAreDeliveredOnce)
{
    Instance fmu;
    EXPECT_EQ(fmu.send(""), fmi3OK); // the start value
    EXPECT_EQ(fmu.send("early"), fmi3Discard);
    fmu.initialized();
    EXPECT_EQ(fmu.received(), "");
    EXPECT_EQ(fmu.send(std::string("a\0b", 3)), fmi3OK);
    EXPECT_EQ(fmu.send("c"), fmi3OK);
    ASSERT_EQ(fmu.step(0.0, 0.01), fmi3OK);
    EXPECT_EQ(fmu.received(), std::string("a\0bc", 4));
    ASSERT_EQ(fmu.step(0.01, 0.01), fmi3OK);
    EXPECT_EQ(fmu.received(), "");
    EXPECT_EQ(fmu.received(UPLINK), "");
    EXPECT_EQ(fmu.send("more than 16 bytes"), fmi3Discard);
    EXPECT_TRUE(fmu.says("the packets cannot be sent"));
}

TEST(FmuRun, ResetBringsTheStartValuesBack)
{
    Instance fmu;
    ASSERT_EQ(fmu.set(GAIN, Numbers{2.0}), fmi3OK);
    ASSERT_EQ(fmu.set(IN_F64, Numbers{1.0, 1.0}), fmi3OK);
    fmu.initialized(4.0);
    ASSERT_EQ(fmi3Terminate(fmu.p), fmi3OK);
    EXPECT_EQ(fmu.f64(INTEGRAL), (Numbers{2.0, 2.0}));
    ASSERT_EQ(fmi3Reset(fmu.p), fmi3OK);
    EXPECT_EQ(fmu.f64(GAIN), Numbers{0.5});
    fmu.initialized();
    EXPECT_EQ(fmu.f64(INTEGRAL), (Numbers{0.0, 0.0}));
    EXPECT_EQ(fmu.f64(TIME), Numbers{0.0});
}

TEST(FmuRun, LogCategoriesAreSwitched)
{
    Instance fmu;
    fmu.initialized();
    const char *const modes[] = {"modes"};
    ASSERT_EQ(fmi3SetDebugLogging(fmu.p, false, 0, nullptr), fmi3OK);
    ASSERT_EQ(fmi3SetDebugLogging(fmu.p, true, 1, modes), fmi3OK);
    fmu.log.clear();
    ASSERT_EQ(fmu.set(IN_F64, Numbers{100.0, 0.0}), fmi3OK);
    ASSERT_EQ(fmu.step(0.0, 0.01), fmi3OK);
    EXPECT_EQ(fmu.step(7.0, 0.01), fmi3Error);
    EXPECT_EQ(fmu.log, (std::vector<std::string>{"0 modes: mode 1 begins"}));
    const char *const unknown[] = {"dreams"};
    EXPECT_EQ(fmi3SetDebugLogging(fmu.p, true, 1, unknown), fmi3Error);
    Instance silent;
    fmi3FreeInstance(silent.p);
    silent.p = fmi3InstantiateCoSimulation("toy", TOKEN, nullptr, false, false, false, false, nullptr, 0, &silent,
                                           &Instance::logged, nullptr);
    silent.log.clear(); // of the first
    EXPECT_EQ(silent.step(0.0, 0.01), fmi3Error);
    EXPECT_TRUE(silent.log.empty());
}

} // namespace run_test
