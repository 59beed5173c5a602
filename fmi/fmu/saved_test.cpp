// SPDX-License-Identifier: Apache-2.0
// States of an FMU, saved, serialized and restored, by FMI 3.0 over a toy; and instances in threads.
#include "fmi/fmu/testing/instance.h"

#include <functional>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

namespace saved_test {

using namespace fmi::testing;

/** The bytes of everything that can be read. */
std::string everything(Instance &fmu)
{
    std::string all = fmu.received() + std::to_string(fmu.i64(MODE)) + " " + std::to_string(fmu.u32(FIRED)) + " " +
                      std::to_string(fmu.i64(LAST)) + " " + std::to_string(fmu.i64(SEEN_T)) + " " +
                      std::to_string(fmu.u32(SEEN_SEQUENCE));
    for (const Name name : {TIME, IN_F64, OUT_F64, INTEGRAL, GAIN, LIMIT, START}) {
        for (const double x : fmu.f64(name)) {
            all.append(reinterpret_cast<const char *>(&x), sizeof x);
        }
    }
    return all;
}

/** A step of a run that depends on its number alone, with all that an importer can set; the state stands within it. */
template <class Between> std::string fly(Instance &fmu, int i, Between between)
{
    std::mt19937 random(static_cast<unsigned>(i));
    std::uniform_real_distribution<double> number(-1.0, 1.0);
    EXPECT_EQ(fmu.set(IN_F64, Numbers{number(random), number(random)}), fmi3OK);
    EXPECT_EQ(fmu.set(IN_COLOR, Wholes{random() % 4 == 0 ? 7 : 0, 0}), fmi3OK);
    EXPECT_EQ(fmu.set(GAIN, Numbers{number(random)}), fmi3OK); // half of them are refused
    EXPECT_EQ(fmu.set(REQUEST, Wholes{static_cast<std::int64_t>(random() % 3)}), fmi3OK);
    EXPECT_EQ(fmu.send(std::string(random() % 4, 'x')), fmi3OK);
    between();
    const fmi3Status status = fmu.step(fmu.f64(TIME)[0], 0.025);
    return std::to_string(static_cast<int>(status)) + everything(fmu);
}

std::vector<std::uint8_t> serialized(Instance &fmu)
{
    fmi3FMUState state = nullptr;
    std::size_t size = 0;
    EXPECT_EQ(fmi3GetFMUState(fmu.p, &state), fmi3OK);
    EXPECT_EQ(fmi3SerializedFMUStateSize(fmu.p, state, &size), fmi3OK);
    std::vector<std::uint8_t> bytes(size);
    EXPECT_EQ(fmi3SerializeFMUState(fmu.p, state, bytes.data(), size), fmi3OK);
    EXPECT_EQ(fmi3FreeFMUState(fmu.p, &state), fmi3OK);
    EXPECT_EQ(state, nullptr);
    return bytes;
}

fmi3Status restore(Instance &fmu, const std::vector<std::uint8_t> &bytes)
{
    fmi3FMUState state = nullptr;
    fmi3Status status = fmi3DeserializeFMUState(fmu.p, bytes.data(), bytes.size(), &state);
    if (status == fmi3OK) {
        status = fmi3SetFMUState(fmu.p, state);
    }
    fmi3FreeFMUState(fmu.p, &state);
    return status;
}

TEST(FmuSaved, ARestoredRunContinuesWithTheSameBits)
{
    constexpr int STEPS = 40;
    std::vector<std::string> expected;
    Instance undisturbed;
    undisturbed.initialized();
    for (int i = 0; i < STEPS; i++) {
        expected.push_back(fly(undisturbed, i, [] {}));
    }
    std::mt19937 random(7);
    for (int round = 0; round < 50; round++) {
        const int at = static_cast<int>(random() % STEPS);
        Instance fmu;
        fmu.initialized();
        fmi3FMUState state = nullptr;
        std::vector<std::uint8_t> bytes;
        const auto save = [&] { // between what a step sets and the step
            EXPECT_EQ(fmi3GetFMUState(fmu.p, &state), fmi3OK);
            bytes = serialized(fmu);
        };
        for (int i = 0; i <= at; i++) {
            ASSERT_EQ(fly(fmu, i, [&] { i == at ? save() : void(); }), expected[static_cast<std::size_t>(i)]);
        }
        for (int i = 0; i < round % 5; i++) {
            fly(fmu, 1000 * round + i, [] {}); // another way
        }
        Instance other; // it was never initialized
        ASSERT_EQ(fmi3SetFMUState(fmu.p, state), fmi3OK);
        ASSERT_EQ(restore(other, bytes), fmi3OK);
        for (Instance *p : {&fmu, &other}) {
            const fmi3Status status = p->step(p->f64(TIME)[0], 0.025);
            ASSERT_EQ(std::to_string(static_cast<int>(status)) + everything(*p),
                      expected[static_cast<std::size_t>(at)]);
            for (int i = at + 1; i < STEPS; i++) {
                ASSERT_EQ(fly(*p, i, [] {}), expected[static_cast<std::size_t>(i)]);
            }
        }
        fmi3FreeFMUState(fmu.p, &state);
    }
}

TEST(FmuSaved, AStateOfEachPhaseIsRestored)
{
    Instance fmu(true, true);
    const std::vector<std::uint8_t> instantiated = serialized(fmu);
    ASSERT_EQ(fmu.enter(3.0), fmi3OK);
    ASSERT_EQ(fmu.set(IN_F64, Numbers{1.0, 1.0}), fmi3OK);
    const std::vector<std::uint8_t> initialization = serialized(fmu);
    ASSERT_EQ(fmi3ExitInitializationMode(fmu.p), fmi3OK);
    const std::vector<std::uint8_t> event = serialized(fmu);
    ASSERT_EQ(fmi3EnterStepMode(fmu.p), fmi3OK);
    EXPECT_EQ(fmi3EnterEventMode(nullptr), fmi3Error);
    EXPECT_EQ(fmu.step(9.0, 0.1), fmi3Error); // from an error, too
    ASSERT_EQ(restore(fmu, event), fmi3OK);
    EXPECT_EQ(fmu.update(), fmi3OK);
    ASSERT_EQ(restore(fmu, initialization), fmi3OK);
    EXPECT_EQ(fmu.f64(INTEGRAL), (Numbers{0.5, 0.5}));
    EXPECT_EQ(fmi3ExitInitializationMode(fmu.p), fmi3OK);
    ASSERT_EQ(restore(fmu, instantiated), fmi3OK);
    EXPECT_EQ(fmu.set(START, Numbers{1.0}), fmi3OK);
    fmu.initialized();
    EXPECT_EQ(fmu.f64(INTEGRAL), (Numbers{1.0, 1.0}));
    Instance plain; // without event mode
    ASSERT_EQ(restore(plain, event), fmi3OK);
    EXPECT_EQ(plain.step(3.0, 0.01), fmi3OK);
}

TEST(FmuSaved, DamagedStatesAreRefused)
{
    Instance fmu;
    fmu.initialized();
    const std::vector<std::uint8_t> good = serialized(fmu);
    for (std::size_t i = 0; i < good.size(); i++) {
        std::vector<std::uint8_t> bytes = good;
        bytes[i] ^= 0x10;
        EXPECT_EQ(restore(fmu, bytes), fmi3Error) << i;
        ASSERT_EQ(fmi3Reset(fmu.p), fmi3OK);
    }
    for (const std::size_t n : {std::size_t{0}, std::size_t{31}, good.size() - 1}) {
        EXPECT_EQ(restore(fmu, {good.begin(), good.begin() + static_cast<std::ptrdiff_t>(n)}), fmi3Error) << n;
        ASSERT_EQ(fmi3Reset(fmu.p), fmi3OK);
    }
    fmi3FMUState state = nullptr;
    ASSERT_EQ(fmi3GetFMUState(fmu.p, &state), fmi3OK);
    std::size_t size;
    std::uint64_t no_state[4] = {};
    EXPECT_EQ(fmi3SerializedFMUStateSize(fmu.p, no_state, &size), fmi3Error);
    EXPECT_EQ(fmi3SerializeFMUState(fmu.p, no_state, reinterpret_cast<std::uint8_t *>(no_state), 32), fmi3Error);
    EXPECT_EQ(fmi3SetFMUState(fmu.p, no_state), fmi3Error);
    EXPECT_TRUE(fmu.says("the state is not of this FMU"));
    std::vector<std::uint8_t> small(good.size() - 1);
    EXPECT_EQ(fmi3SerializeFMUState(fmu.p, state, small.data(), small.size()), fmi3Error);
    EXPECT_TRUE(fmu.says("there is room for " + std::to_string(small.size())));
    EXPECT_EQ(fmi3SetFMUState(fmu.p, nullptr), fmi3Error);
    EXPECT_EQ(restore(fmu, good), fmi3OK);
    fmi3FreeFMUState(fmu.p, &state);
}

TEST(FmuSaved, InstancesInThreadsDoNotDisturbOneAnother)
{
    std::vector<std::string> results[2];
    const auto run = [](std::vector<std::string> &result) {
        Instance fmu;
        fmu.initialized();
        for (int i = 0; i < 200; i++) {
            result.push_back(fly(fmu, i, [] {}));
        }
    };
    std::thread first(run, std::ref(results[0]));
    std::thread second(run, std::ref(results[1]));
    first.join();
    second.join();
    EXPECT_EQ(results[0], results[1]);
    EXPECT_EQ(results[0].size(), 200U);
}

} // namespace saved_test
