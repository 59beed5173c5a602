// SPDX-License-Identifier: Apache-2.0
// The choice against one of a few lines, on random units and messages.
extern "C" {
#include "flight/protection/star_select.h"
}

#include <gtest/gtest.h>

#include <random>

namespace star_select_test {

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
            for (StarAttitude *one : {&m.in.a, &m.in.b}) {
                if (pick(3) > 0) {
                    one->head = {t - pick(2), static_cast<Quality>(1 + pick(3)), one->head.sequence + 1};
                    one->sigma_BN.v[0] = static_cast<double>(chance());
                } else if (head_written(one->head) && pick(4) == 0) {
                    one->head.quality = QUALITY_STALE;
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

} // namespace star_select_test
