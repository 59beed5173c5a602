// SPDX-License-Identifier: Apache-2.0
#include "world/environment/celestial_body_model.h"

#include "sim/error.h"
#include "world/eigen.h"
#include "world/environment/testing/files.h"
#include "world/environment/testing/two_circles.h"

namespace fledge::world {
namespace celestial_body_model_test {

using Eigen::Vector3d;
using ::testing::HasSubstr;
using testing::TwoCircles;

constexpr sim::Ns second = 1'000'000'000, hour = 3600 * second;

struct Body : ::testing::Test {
    CelestialBody body_interface{};
    CelestialBodyModel model{body_interface};
    const sim::Setup setup{"world.body", 1, nullptr};

    std::string refusal()
    {
        return error_of([&] { model.prepare(setup); });
    }
};

TEST_F(Body, IsWhereTheEphemerisHasIt)
{
    body_interface.par.id = TwoCircles::sun;
    model.set_sky(TwoCircles::sky(TwoCircles::jupiter, 2.0));
    model.prepare(setup);
    model.reset(0);
    model.update({0, 0});
    for (int i = 1; i < 100; i++) {
        model.update({i * hour, hour});
        const double t = 2.0 * TwoCircles::day + 3600.0 * i;
        const auto &state = body_interface.out.state;
        EXPECT_EQ(state.head.t, i * hour);
        EXPECT_EQ(state.head.sequence, 2u + static_cast<unsigned>(i));
        EXPECT_EQ(state.head.quality, QUALITY_GOOD);
        const Vector3d r = TwoCircles::r(TwoCircles::sun, t) - TwoCircles::r(TwoCircles::jupiter, t);
        const Vector3d v = TwoCircles::v(TwoCircles::sun, t) - TwoCircles::v(TwoCircles::jupiter, t);
        const Vector3d a = -TwoCircles::rate() * TwoCircles::rate() * r;
        EXPECT_LT((view(state.r_PN_N) - r).norm(), 5e-3);
        EXPECT_LT((view(state.v_PN_N) - v).norm(), 1e-6);
        EXPECT_LT((view(state.a_PN_N) - a).norm(), 1e-6 * a.norm());
    }
}

TEST_F(Body, InTheCenterIsAtRest)
{
    body_interface.par.id = TwoCircles::jupiter;
    model.set_sky(TwoCircles::sky(TwoCircles::jupiter));
    model.prepare(setup);
    model.reset(0);
    EXPECT_EQ(vec_norm(body_interface.out.state.r_PN_N), 0.0);
    EXPECT_EQ(vec_norm(body_interface.out.state.v_PN_N), 0.0);
    EXPECT_EQ(body_interface.out.state.head.quality, QUALITY_GOOD);
}

TEST_F(Body, NamesWhatIsWrong)
{
    body_interface.par.id = 499;
    EXPECT_EQ(refusal(), "world.body.sky is missing: the sky in which MARS (499) is");
    model.set_sky(TwoCircles::sky(0));
    EXPECT_THAT(refusal(), HasSubstr("world.body: two circles: no MARS (499); asked for"));
    body_interface.par.id = TwoCircles::sun;
    EXPECT_EQ(refusal(), "");
    EXPECT_NO_THROW(model.ensure_data_until(19 * 24 * hour));
    EXPECT_THAT(error_of([&] { model.ensure_data_until(20 * 24 * hour); }),
                HasSubstr("world.body: SUN (10) is given from 2000-01-01T12:00:00 TDB to "
                          "2000-01-21T12:00:00 TDB in two circles; asked for SUN (10) relative"));
    EXPECT_THROW(model.update({20 * 24 * hour, hour}), sim::RunError);
    EXPECT_THAT(error_of([&] { model.update({20 * 24 * hour, hour}); }), HasSubstr("world.body: SUN (10) is given"));
    // Another body from now on.
    body_interface.par.id = 3;
    EXPECT_THROW(model.refresh(), sim::SetupError);
}

TEST_F(Body, SaysWhenABarycentreStandsForIt)
{
    body_interface.par.id = 599;
    model.set_sky(TwoCircles::sky(0));
    EXPECT_TRUE(model.assumptions().empty());
    body_interface.par.id = 699;
    EXPECT_TRUE(model.assumptions().empty()); // nothing does
}

} // namespace celestial_body_model_test
} // namespace fledge::world
