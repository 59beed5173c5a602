// SPDX-License-Identifier: Apache-2.0
// The newest message of random ones, against a search through all that were written.
extern "C" {
#include "flight/selection/torque_select.h"
}

#include <gtest/gtest.h>

#include <random>

namespace {

TEST(TorqueSelect, TheNewestIsPassedOnOfEquallyNewOnesTheFirst)
{
    std::mt19937 chance(3);
    int silent = 0, tied = 0;
    for (int run = 0; run < 100; run++) {
        TorqueSelect m{};
        torque_select_reset(&m);
        BodyTorque *const in[] = {&m.in.a, &m.in.b, &m.in.c};
        const BodyTorque *from = nullptr;
        unsigned writings = 0;
        for (int64_t t = 1; t < 50; t++) {
            const BodyTorque *const before = from;
            bool anew = false;
            for (BodyTorque *one : in) {
                if (chance() % 5 == 0) {
                    one->head = {t, static_cast<Quality>(1 + chance() % 3), one->head.sequence + 1};
                    one->torque_B.v[0] = static_cast<double>(chance());
                    anew = anew || one == from;
                } else if (head_written(one->head) && chance() % 9 == 0) {
                    one->head.quality = QUALITY_STALE; // its wire has grown old: that is no writing
                }
            }
            from = nullptr;
            int equal = 0;
            for (const BodyTorque *one : in) {
                equal += from != nullptr && one->head.t == from->head.t;
                from = head_written(one->head) && (from == nullptr || one->head.t > from->head.t) ? one : from;
            }
            torque_select_update(&m, {t, 1});
            if (from == nullptr) {
                EXPECT_FALSE(head_written(m.out.torque.head));
                silent++;
                continue;
            }
            tied += equal > 0;
            writings += anew || from != before;
            EXPECT_EQ(m.out.torque.head.t, from->head.t);
            EXPECT_EQ(m.out.torque.head.quality, from->head.quality);
            EXPECT_EQ(m.out.torque.head.sequence, writings);
            EXPECT_EQ(m.out.torque.torque_B.v[0], from->torque_B.v[0]);
        }
    }
    EXPECT_GT(silent, 5);
    EXPECT_GT(tied, 100);
}

} // namespace
