// SPDX-License-Identifier: Apache-2.0
// The roll against sets of members, on random messages.
extern "C" {
#include "flight/protection/formation_roll.h"
}

#include <gtest/gtest.h>

#include <algorithm>
#include <iterator>
#include <map>
#include <random>
#include <set>

namespace formation_roll_test {

using Members = std::set<uint32_t>;

uint32_t bits(const Members &members)
{
    uint32_t all = 0;
    for (const uint32_t i : members) {
        all |= 1u << i;
    }
    return all;
}

Members without(const Members &some, const Members &others)
{
    Members rest;
    std::set_difference(some.begin(), some.end(), others.begin(), others.end(), std::inserter(rest, rest.end()));
    return rest;
}

TEST(FormationRoll, KnowsWhichMembersArePresentAndWhichAreLost)
{
    std::mt19937 chance(3);
    const auto pick = [&](int n) { return static_cast<int>(chance() % static_cast<unsigned>(n)); };
    int lost = 0, again = 0;
    for (int run = 0; run < 100; run++) {
        FormationRoll m{};
        formation_roll_reset(&m);
        BodyState *const in[] = {&m.in.a, &m.in.b, &m.in.c, &m.in.d, &m.in.e, &m.in.f, &m.in.g, &m.in.h};
        std::map<uint32_t, int64_t> newest;
        Members before;
        uint32_t events = 0;
        for (int64_t t = 1'000'000'000; t < 40'000'000'000; t += 1'000'000'000) {
            for (BodyState *state : in) {
                switch (pick(8)) {
                case 0: *state = {}; break; // its messages are gone
                case 1: state->head.quality = head_written(state->head) ? QUALITY_STALE : QUALITY_NONE; break;
                case 2: state->head = {t - pick(2), QUALITY_GOOD, state->head.sequence + 1}; break;
                case 3: state->head = {t, QUALITY_DEGRADED, state->head.sequence + 1}; break;
                default: break;
                }
            }
            formation_roll_update(&m, {t, 1'000'000'000});

            Members present, known;
            for (uint32_t i = 0; i < ROLL_MEMBERS; i++) {
                if (in[i]->head.quality == QUALITY_GOOD || in[i]->head.quality == QUALITY_DEGRADED) {
                    present.insert(i);
                    newest[i] = in[i]->head.t;
                }
                const double age = newest.count(i) ? static_cast<double>(t - newest[i]) / 1e9 : 0.0;
                EXPECT_EQ(m.out.state.age[i], age);
            }
            for (const auto &[i, when] : newest) {
                known.insert(i);
            }
            EXPECT_EQ(m.out.state.heard, bits(present));
            EXPECT_EQ(m.out.state.lost, bits(without(known, present)));
            EXPECT_EQ(m.out.state.head.quality, QUALITY_GOOD);
            const Members gone = without(before, present), come = without(present, before);
            events += !gone.empty() + !come.empty();
            EXPECT_EQ(m.out.event.count, events);
            if (!gone.empty() || !come.empty()) {
                EXPECT_EQ(m.out.event.id, gone.empty() ? FORMATION_ROLL_HEARD : FORMATION_ROLL_LOST);
                EXPECT_EQ(m.out.event.arguments[0], bits(gone.empty() ? come : gone));
                EXPECT_EQ(m.out.event.head.t, t);
            }
            lost += !gone.empty();
            again += before.size() < present.size();
            before = present;
        }
    }
    EXPECT_GT(lost, 100);
    EXPECT_GT(again, 100);
}

TEST(FormationRoll, ReportsNothingOfMembersThatWereNeverPresent)
{
    FormationRoll m{};
    formation_roll_reset(&m);
    m.in.b.head = {0, QUALITY_STALE, 1}; // it has spoken, too long ago
    formation_roll_update(&m, {5'000'000'000, 0});
    EXPECT_EQ(m.out.state.heard, 0u);
    EXPECT_EQ(m.out.state.lost, 0u);
    EXPECT_EQ(m.out.state.age[1], 0.0);
    EXPECT_EQ(m.out.event.count, 0u);
    EXPECT_EQ(m.out.state.head.sequence, 1u);
}

} // namespace formation_roll_test
