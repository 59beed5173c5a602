// SPDX-License-Identifier: Apache-2.0
// An instance of the toy by FMI 3.0, for tests.
#pragma once

#include "fmi/fmu/testing/toy.h"

#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace fmi::testing {

using Numbers = std::vector<double>;
using Wholes = std::vector<std::int64_t>;

/** An instance with its log; `p` may be NULL. */
struct Instance {
    explicit Instance(bool event_mode = false, bool early_return = false, const char *token = TOKEN,
                      const char *name = "toy")
        : p(fmi3InstantiateCoSimulation(name, token, "/tmp/r/", false, true, event_mode, early_return, nullptr, 0, this,
                                        &logged, nullptr))
    {
    }
    Instance(const Instance &) = delete;
    Instance &operator=(const Instance &) = delete;
    ~Instance() { fmi3FreeInstance(p); }

    static void logged(void *environment, fmi3Status status, fmi3String category, fmi3String message)
    {
        static_cast<Instance *>(environment)
            ->log.push_back(std::to_string(static_cast<int>(status)) + " " + category + ": " + message);
    }

    bool says(const std::string &text) const { return !log.empty() && log.back().find(text) != std::string::npos; }

    fmi3Status enter(double start = 0.0) { return fmi3EnterInitializationMode(p, false, 0.0, start, false, 0.0); }
    Instance &initialized(double start = 0.0)
    {
        EXPECT_EQ(enter(start), fmi3OK);
        EXPECT_EQ(fmi3ExitInitializationMode(p), fmi3OK);
        return *this;
    }

    fmi3Status step(double t, double h) { return fmi3DoStep(p, t, h, true, &events, &terminate, &early, &reached); }

    Numbers f64(Name name)
    {
        const fmi3ValueReference r = reference(name);
        Numbers values(variable(name).n);
        EXPECT_EQ(fmi3GetFloat64(p, &r, 1, values.data(), values.size()), fmi3OK);
        return values;
    }
    std::int64_t i64(Name name) // also enumerations
    {
        const fmi3ValueReference r = reference(name);
        std::int64_t value = -1;
        EXPECT_EQ(fmi3GetInt64(p, &r, 1, &value, 1), fmi3OK);
        return value;
    }
    std::uint32_t u32(Name name)
    {
        const fmi3ValueReference r = reference(name);
        std::uint32_t value = 0;
        EXPECT_EQ(fmi3GetUInt32(p, &r, 1, &value, 1), fmi3OK);
        return value;
    }
    bool clock(Name name)
    {
        const fmi3ValueReference r = reference(name);
        bool value = false;
        EXPECT_EQ(fmi3GetClock(p, &r, 1, &value), fmi3OK);
        return value;
    }
    fmi3Status set(Name name, const Numbers &values)
    {
        const fmi3ValueReference r = reference(name);
        return fmi3SetFloat64(p, &r, 1, values.data(), values.size());
    }
    fmi3Status set(Name name, const Wholes &values)
    {
        const fmi3ValueReference r = reference(name);
        return fmi3SetInt64(p, &r, 1, values.data(), values.size());
    }
    fmi3Status set(Name name, const char *text)
    {
        const fmi3ValueReference r = reference(name);
        return fmi3SetString(p, &r, 1, &text, 1);
    }
    fmi3Status update()
    {
        bool need, end, nominals, states, defined;
        double next;
        const fmi3Status status = fmi3UpdateDiscreteStates(p, &need, &end, &nominals, &states, &defined, &next);
        EXPECT_FALSE(status == fmi3OK && (need || end || nominals || states || defined));
        return status;
    }
    fmi3Status send(const std::string &bytes)
    {
        const fmi3ValueReference r = reference(UPLINK);
        const std::size_t n = bytes.size();
        const auto *data = reinterpret_cast<const std::uint8_t *>(bytes.data());
        return fmi3SetBinary(p, &r, 1, &n, &data, 1);
    }
    std::string received(Name name = DOWNLINK)
    {
        const fmi3ValueReference r = reference(name);
        std::size_t n = 99;
        const std::uint8_t *data = nullptr;
        EXPECT_EQ(fmi3GetBinary(p, &r, 1, &n, &data, 1), fmi3OK);
        return {reinterpret_cast<const char *>(data), n};
    }

    std::vector<std::string> log;
    bool events = false, terminate = false, early = false;
    double reached = -1.0;
    fmi3Instance p;
};

} // namespace fmi::testing
