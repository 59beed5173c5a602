// SPDX-License-Identifier: Apache-2.0
// What goes on is what was chosen; each writing counts once; what is not finite is held back.
#include "flight/testing/eigen.h"

extern "C" {
#include "flight/actuation/command_choices.h"
}

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <functional>

namespace flight::testing {
namespace command_choices_test {

template <class M> struct Of {
    M m{};
    void (*update)(M *, Tick);

    Head pass(Head head, unsigned char content)
    {
        std::memset(&m.in.chosen, content, sizeof m.in.chosen); // as doubles, all of these bytes are finite
        m.in.chosen.head = head;
        update(&m, {100, 10});
        return m.out.command.head;
    }
    bool passed() const
    {
        const auto *in = reinterpret_cast<const unsigned char *>(&m.in.chosen);
        const auto *out = reinterpret_cast<const unsigned char *>(&m.out.command);
        return std::memcmp(in + sizeof(Head), out + sizeof(Head), sizeof m.in.chosen - sizeof(Head)) == 0;
    }
};

template <class M> void expect_to_pass_on(void (*update)(M *, Tick))
{
    Of<M> choice{{}, update};
    EXPECT_EQ(choice.pass({}, 1).quality, QUALITY_NONE);
    EXPECT_FALSE(choice.passed());
    Head head = choice.pass({90, QUALITY_GOOD, 7}, 2);
    EXPECT_TRUE(choice.passed());
    EXPECT_EQ(head.t, 90);
    EXPECT_EQ(head.quality, QUALITY_GOOD);
    EXPECT_EQ(head.sequence, 1u);
    EXPECT_EQ(choice.pass({90, QUALITY_GOOD, 7}, 2).sequence, 1u); // suspended: nothing new
    head = choice.pass({90, QUALITY_STALE, 7}, 3);                 // of another output, of the same time
    EXPECT_TRUE(choice.passed());
    EXPECT_EQ(head.quality, QUALITY_STALE);
    EXPECT_EQ(head.sequence, 2u);
    EXPECT_EQ(choice.pass({500, QUALITY_GOOD, 8}, 3).t, 100); // of a time to come
    head = choice.pass({}, 4);
    EXPECT_FALSE(choice.passed());
    EXPECT_EQ(head.t, 100);
    EXPECT_EQ(head.quality, QUALITY_DEGRADED);
    EXPECT_EQ(head.sequence, 3u);
}

TEST(CommandChoices, pass_on_what_was_chosen)
{
    expect_to_pass_on(rod_command_choice_update);
    expect_to_pass_on(wheel_command_choice_update);
    expect_to_pass_on(wheel_drive_choice_update);
    expect_to_pass_on(gimbal_rates_choice_update);
    expect_to_pass_on(gimbal_torques_choice_update);
    expect_to_pass_on(thruster_times_choice_update);
    expect_to_pass_on(thruster_valves_choice_update);
    expect_to_pass_on(panel_command_choice_update);
    expect_to_pass_on(array_drive_command_choice_update);
}

template <class M> void expect_to_hold_back(void (*update)(M *, Tick), const std::function<double &(M &)> &number)
{
    Of<M> choice{{}, update};
    choice.pass({90, QUALITY_GOOD, 7}, 2);
    const double before = number(choice.m);
    for (const double bad : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
        number(choice.m) = bad;
        choice.m.in.chosen.head.t = 95;
        update(&choice.m, {100, 10});
        EXPECT_EQ(choice.m.out.command.head.t, 90);
        EXPECT_EQ(choice.m.out.command.head.quality, QUALITY_DEGRADED);
        number(choice.m) = before;
        EXPECT_TRUE(choice.passed());
    }
}

TEST(CommandChoices, hold_back_what_is_not_finite)
{
    for (int i = 0; i < 8; i += 7) {
        expect_to_hold_back<RodCommandChoice>(rod_command_choice_update,
                                              [i](auto &m) -> double & { return m.in.chosen.dipole[i]; });
        expect_to_hold_back<WheelCommandChoice>(wheel_command_choice_update,
                                                [i](auto &m) -> double & { return m.in.chosen.u[i]; });
        expect_to_hold_back<GimbalRatesChoice>(gimbal_rates_choice_update,
                                               [i](auto &m) -> double & { return m.in.chosen.rate[i]; });
        expect_to_hold_back<GimbalTorquesChoice>(gimbal_torques_choice_update,
                                                 [i](auto &m) -> double & { return m.in.chosen.u[i]; });
    }
    for (int i = 0; i < PANELS_MAX; i += PANELS_MAX - 1) {
        expect_to_hold_back<PanelCommandChoice>(panel_command_choice_update,
                                                [i](auto &m) -> double & { return m.in.chosen.theta[i]; });
        expect_to_hold_back<PanelCommandChoice>(panel_command_choice_update,
                                                [i](auto &m) -> double & { return m.in.chosen.u[i]; });
    }
}

} // namespace command_choices_test
} // namespace flight::testing
