// SPDX-License-Identifier: Apache-2.0
// The newest message of random ones, against a search through all that were written.
extern "C" {
#include "flight/selection/reference_select.h"
}

#include <gtest/gtest.h>

#include <random>

namespace {

TEST(ReferenceSelect, TheNewestIsPassedOnOfEquallyNewOnesTheFirst)
{
    std::mt19937 chance(3);
    int silent = 0, tied = 0;
    for (int run = 0; run < 100; run++) {
        ReferenceSelect m{};
        reference_select_reset(&m);
        AttReference *const in[] = {&m.in.a, &m.in.b, &m.in.c, &m.in.d, &m.in.e, &m.in.f};
        const AttReference *from = nullptr;
        unsigned writings = 0;
        for (int64_t t = 1; t < 50; t++) {
            const AttReference *const before = from;
            bool anew = false;
            for (AttReference *one : in) {
                if (chance() % 5 == 0) {
                    one->head = {t, static_cast<Quality>(1 + chance() % 3), one->head.sequence + 1};
                    one->sigma_RN.v[0] = static_cast<double>(chance());
                    anew = anew || one == from;
                } else if (head_written(one->head) && chance() % 9 == 0) {
                    one->head.quality = QUALITY_STALE; // its wire has grown old: that is no writing
                }
            }
            from = nullptr;
            int equal = 0;
            for (const AttReference *one : in) {
                equal += from != nullptr && one->head.t == from->head.t;
                from = head_written(one->head) && (from == nullptr || one->head.t > from->head.t) ? one : from;
            }
            reference_select_update(&m, {t, 1});
            if (from == nullptr) {
                EXPECT_FALSE(head_written(m.out.reference.head));
                silent++;
                continue;
            }
            tied += equal > 0;
            writings += anew || from != before;
            EXPECT_EQ(m.out.reference.head.t, from->head.t);
            EXPECT_EQ(m.out.reference.head.quality, from->head.quality);
            EXPECT_EQ(m.out.reference.head.sequence, writings);
            EXPECT_EQ(m.out.reference.sigma_RN.v[0], from->sigma_RN.v[0]);
        }
    }
    EXPECT_GT(silent, 5);
    EXPECT_GT(tied, 100);
}

} // namespace
