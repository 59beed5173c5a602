// SPDX-License-Identifier: Apache-2.0
// The choice against one of a few lines, on random units and messages.
extern "C" {
#include "flight/protection/unit_select.h"
}

#include <gtest/gtest.h>

#include <limits>
#include <random>

namespace unit_select_test {

TEST(StarSelect, TheFirstThatIsInUseAndSpeaksIsPassedOnAsByAWire)
{
    std::mt19937 chance(7);
    const auto pick = [&](int n) { return static_cast<int>(chance() % static_cast<unsigned>(n)); };
    int silent = 0, second = 0, held = 0;
    for (int run = 0; run < 200; run++) {
        StarSelect m{};
        m.par.places[0] = 3;
        m.par.places[1] = 9;
        star_select_reset(&m);
        const bool table = run % 4 != 0;
        unsigned writings = 0, changes = 0;
        int before = -2, source = -1;
        unsigned seen = 0;
        for (int64_t t = 1; t < 60; t++) {
            for (StarAttitude *stars : {&m.in.a, &m.in.b}) {
                if (pick(3) > 0) {
                    stars->head = {t - pick(2), static_cast<Quality>(1 + pick(3)), stars->head.sequence + 1};
                    stars->sigma_BN.v[0] = static_cast<double>(chance());
                } else if (head_written(stars->head) && pick(4) == 0) {
                    stars->head.quality = QUALITY_STALE;
                }
            }
            if (table && (t == 1 || pick(9) == 0)) {
                m.in.units.head = {t, QUALITY_GOOD, static_cast<uint32_t>(t)};
                m.in.units.state[3] = static_cast<UnitState>(pick(5));
                m.in.units.state[9] = static_cast<UnitState>(pick(5));
                m.in.units.waits = pick(6) == 0;
            }
            const StarAttitude last = m.out.attitude;
            star_select_update(&m, {t, 1});

            const bool known = m.in.units.waits == 0;
            const bool a = !table || (known && m.in.units.state[3] == UNIT_PRIMARY);
            const bool b = !table || (known && m.in.units.state[9] == UNIT_PRIMARY);
            const bool a_speaks = m.in.a.head.quality > QUALITY_STALE, b_speaks = m.in.b.head.quality > QUALITY_STALE;
            const int taken = a && (a_speaks || !b || !b_speaks) ? 0 : b ? 1 : -1;
            EXPECT_EQ(m.out.choice.taken, static_cast<unsigned>(taken + 1));
            changes += before != -2 && taken != before;
            before = taken;
            EXPECT_EQ(m.out.choice.changes, changes);
            EXPECT_EQ(m.out.choice.age[1], static_cast<double>(t - m.in.b.head.t) / 1e9);
            const StarAttitude *from = taken == 0 ? &m.in.a : taken == 1 ? &m.in.b : nullptr;
            if (from == nullptr || !head_written(from->head)) {
                EXPECT_EQ(m.out.attitude.sigma_BN.v[0], last.sigma_BN.v[0]);
                EXPECT_EQ(m.out.attitude.head.t, last.head.t);
                EXPECT_LE(m.out.attitude.head.quality, QUALITY_DEGRADED);
                EXPECT_EQ(m.out.attitude.head.sequence, last.head.sequence);
                held++;
                continue;
            }
            writings += source != taken || seen != from->head.sequence;
            source = taken;
            seen = from->head.sequence;
            EXPECT_EQ(m.out.attitude.sigma_BN.v[0], from->sigma_BN.v[0]);
            EXPECT_EQ(m.out.attitude.head.t, from->head.t);
            EXPECT_EQ(m.out.attitude.head.quality, from->head.quality);
            EXPECT_EQ(m.out.attitude.head.sequence, writings);
            silent += a && taken == 1;
            second += !a && taken == 1;
        }
    }
    EXPECT_GT(silent, 100);
    EXPECT_GT(second, 100);
    EXPECT_GT(held, 100);
}

TEST(GyroSelect, TheRateIsThatOfTheGyroInUse)
{
    GyroSelect m{};
    m.par.places[0] = 4;
    m.par.places[1] = 5;
    gyro_select_reset(&m);
    m.in.a = {{8, QUALITY_GOOD, 7}, {{1, 2, 3}}};
    m.in.b = {{9, QUALITY_DEGRADED, 2}, {{4, 5, 6}}};
    m.in.units.head = {9, QUALITY_GOOD, 1};
    m.in.units.state[4] = UNIT_PRIMARY;
    m.in.units.state[5] = UNIT_REDUNDANT;
    gyro_select_update(&m, {10, 10});
    EXPECT_EQ(m.out.rate.omega_BN_B.v[2], 3.0);
    EXPECT_EQ(m.out.rate.head.quality, QUALITY_GOOD);
    m.in.units.state[4] = UNIT_FAULTED;
    m.in.units.state[5] = UNIT_PRIMARY;
    gyro_select_update(&m, {20, 10});
    EXPECT_EQ(m.out.rate.omega_BN_B.v[2], 6.0);
    EXPECT_EQ(m.out.rate.head.t, 9);
    EXPECT_EQ(m.out.rate.head.quality, QUALITY_DEGRADED);
    EXPECT_EQ(m.out.rate.head.sequence, 2u);
    EXPECT_EQ(m.out.choice.taken, 2u);
    m.in.units.state[5] = UNIT_FAULTED;
    gyro_select_update(&m, {30, 10});
    EXPECT_EQ(m.out.choice.taken, 0u);
    EXPECT_EQ(m.out.rate.head.sequence, 2u);
    EXPECT_EQ(m.out.rate.omega_BN_B.v[2], 6.0);
}

TEST(GyroSelect, ARateThatIsNotFiniteCountsAsNone)
{
    GyroSelect m{};
    m.par.places[1] = 1;
    gyro_select_reset(&m);
    m.in.a = {{8'000'000'000, QUALITY_GOOD, 7}, {{1, 2, 3}}};
    m.in.units.head = {1, QUALITY_GOOD, 1};
    m.in.units.state[0] = UNIT_PRIMARY;
    gyro_select_update(&m, {9'000'000'000, 1});
    m.in.a.head.sequence++;
    m.in.a.omega_BN_B.v[1] = std::numeric_limits<double>::quiet_NaN();
    gyro_select_update(&m, {10'000'000'000, 1});
    EXPECT_EQ(m.out.rate.omega_BN_B.v[1], 2.0);
    EXPECT_EQ(m.out.rate.head.sequence, 1u);
    EXPECT_LT(m.out.rate.head.quality, QUALITY_GOOD);
    EXPECT_EQ(m.out.choice.age[0], 10.0) << "so a rule about a silent gyro sees it";
    m.in.b = {{9'000'000'000, QUALITY_GOOD, 1}, {{4, 5, 6}}};
    m.in.units.state[1] = UNIT_PRIMARY;
    gyro_select_update(&m, {11'000'000'000, 1});
    EXPECT_EQ(m.out.rate.omega_BN_B.v[1], 5.0) << "of two in use the one that speaks";
}

} // namespace unit_select_test
