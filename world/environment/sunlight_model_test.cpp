// SPDX-License-Identifier: Apache-2.0
// The cones of umbra and penumbra in closed form, and the light between them by rings of the sky.
#include "world/environment/sunlight_model.h"

#include "world/eigen.h"
#include "world/environment/shadow.h"
#include "world/environment/testing/files.h"
#include "world/environment/testing/two_circles.h"

#include <Eigen/Dense>

#include <algorithm>
#include <numbers>
#include <random>

namespace fledge::world {
namespace sunlight_model_test {

using Eigen::Vector3d;

constexpr double pi = std::numbers::pi;
constexpr double Rs = 6.957e8, AU = 149597870700.0;

/// An observer behind a body, on whose axis it is `along` from its centre and `off` beside.
struct Behind {
    double R, D; ///< [m] radius of the body, distance from the Sun

    double hidden(double along, double off) const
    {
        const Vector3d axis = Vector3d(2, -1, 2) / 3.0, side = Vector3d(1, 2, 0).normalized();
        const Vector3d r_PB = along * axis + off * side;
        return hidden_share(D * axis + r_PB, Rs, r_PB, R);
    }
    /// Radii of the two cones at a distance behind the body: tangents to both spheres, outside and crossed.
    double umbra(double along) const
    {
        const double s = (Rs - R) / D;
        return (R / s - along) * s / std::sqrt(1 - s * s);
    }
    double penumbra(double along) const
    {
        const double s = (Rs + R) / D;
        return (R / s + along) * s / std::sqrt(1 - s * s);
    }
};

TEST(Shadow, ItsConesAreTheTangentsOfBothSpheres)
{
    for (const Behind b : {Behind{6378e3, AU}, {1737e3, AU}, {7.1e7, 5.2 * AU}, {1e7, 1e10}}) {
        const double apex = b.R * b.D / (Rs - b.R);
        for (const double share : {0.01, 0.1, 0.5, 0.9, 0.999}) {
            const double along = share * apex;
            if (along * along + b.umbra(along) * b.umbra(along) < 1.01 * b.R * b.R) {
                continue; // still beside the body
            }
            const double width = b.penumbra(along) - b.umbra(along), inside = b.umbra(along),
                         outside = b.penumbra(along);
            EXPECT_EQ(b.hidden(along, 0.0), 1.0);
            EXPECT_EQ(b.hidden(along, inside - 1e-6 * width), 1.0) << b.R << " " << share;
            EXPECT_LT(b.hidden(along, inside + 1e-6 * width), 1.0);
            EXPECT_GT(b.hidden(along, inside + 1e-6 * width), 1.0 - 1e-3);
            EXPECT_GT(b.hidden(along, outside - 1e-6 * width), 0.0);
            EXPECT_LT(b.hidden(along, outside - 1e-6 * width), 1e-3);
            EXPECT_EQ(b.hidden(along, outside + 1e-6 * width), 0.0) << b.R << " " << share;
        }
        // Beyond the apex the eclipse is annular; at the apex it is just whole.
        EXPECT_EQ(b.hidden(apex * (1 - 1e-9), 0.0), 1.0);
        for (const double share : {1.01, 1.5, 4.0}) {
            const double along = share * apex;
            const double ratio = std::asin(b.R / along) / std::asin(Rs / (b.D + along));
            EXPECT_NEAR(b.hidden(along, 0.0), ratio * ratio, 1e-12);
            EXPECT_LT(b.hidden(along, 0.0), 1.0);
        }
    }
}

TEST(Shadow, PartsOfTheDiscAreThoseOfRingsOfTheSky)
{
    // Rings about the Sun's centre, of which the body hides an arc, on the sphere of the sky.
    const Behind b{6378e3, AU};
    for (const auto &[along, within] : {std::pair{2000e3, 3e-4}, {7000e3, 2e-4}, {4e7, 3e-5}}) {
        const double inside = b.umbra(along), width = b.penumbra(along) - inside;
        double last = 1.0;
        for (double share = 0.05; share < 1.0; share += 0.1) {
            const Vector3d r_PB(along, inside + share * width, 0), r_SB = Vector3d(AU, 0, 0) + r_PB;
            const double sun = std::asin(Rs / r_SB.norm()), body = std::asin(b.R / r_PB.norm());
            const double apart = std::atan2(r_SB.cross(r_PB).norm(), r_SB.dot(r_PB));
            double hidden = 0.0;
            constexpr int rings = 3000;
            for (int i = 0; i < rings; i++) {
                const double ring = (i + 0.5) / rings * sun;
                const double arc =
                    (std::cos(body) - std::cos(ring) * std::cos(apart)) / std::sin(ring) / std::sin(apart);
                hidden += std::acos(std::clamp(arc, -1.0, 1.0)) / pi * std::sin(ring) * sun / rings;
            }
            hidden /= 1.0 - std::cos(sun);
            const double found = hidden_share(r_SB, Rs, r_PB, b.R);
            EXPECT_NEAR(found, hidden, within) << along << " " << share;
            EXPECT_LT(found, last);
            last = found;
        }
    }
}

/// An ellipsoid of revolution about the pole p, and where the observer is relative to it.
struct Seen {
    Vector3d r_PB;
    double a, b;
    Vector3d p;

    Vector3d scaled(const Vector3d &r) const { return r / a + (1.0 / b - 1.0 / a) * p.dot(r) * p; }
};

/// Which rays u = (u0, u1, u2) along three axes meet a body: by plain numbers, since there are many.
struct Meeting {
    double along[3], square[3][3];

    Meeting(const Seen &body, const Eigen::Matrix3d &axes)
    {
        const Vector3d r = body.scaled(body.r_PB);
        Eigen::Matrix3d rays;
        rays << body.scaled(axes.col(0)), body.scaled(axes.col(1)), body.scaled(axes.col(2));
        Vector3d::Map(along) = rays.transpose() * r;
        Eigen::Matrix3d::Map(&square[0][0]) = rays.transpose() * rays * (r.squaredNorm() - 1.0);
    }

    bool meets(const double *u) const
    {
        double way = 0.0, rest = 0.0;
        for (int i = 0; i < 3; i++) {
            way += along[i] * u[i];
            rest += u[i] * (square[i][0] * u[0] + square[i][1] * u[1] + square[i][2] * u[2]);
        }
        return way < 0.0 && way * way > rest;
    }
};

/// The share of the Sun's disc, by rays from all over it, that meet a body.
double hidden_rays(const Vector3d &r_SB, const std::vector<Seen> &bodies)
{
    const double angle = std::asin(Rs / r_SB.norm());
    const Vector3d z = -r_SB.normalized(), x = z.unitOrthogonal();
    Eigen::Matrix3d axes;
    axes << z, x, z.cross(x);
    std::vector<Meeting> meetings;
    for (const Seen &body : bodies) {
        meetings.emplace_back(body, axes);
    }
    constexpr int rings = 300, rays = 300;
    double c[2 * rays], s[2 * rays];
    for (int k = 0; k < 2 * rays; k++) {
        c[k] = std::cos(pi * k / rays);
        s[k] = std::sin(pi * k / rays);
    }
    int met = 0;
    for (int i = 0; i < rings; i++) {
        const double cosine = 1.0 - (i + 0.5) / rings * (1.0 - std::cos(angle)), sine = std::sqrt(1 - cosine * cosine);
        for (int j = 0; j < rays; j++) {
            const int k = 2 * j + i % 2; // turned by half a step from ring to ring
            const double ray[3] = {cosine, sine * c[k], sine * s[k]};
            met += std::ranges::any_of(meetings, [&](const Meeting &body) { return body.meets(ray); });
        }
    }
    return static_cast<double>(met) / (rings * rays);
}

/// Of random bodies before the Sun.
struct Sights {
    std::mt19937 random{1};
    std::normal_distribution<double> normal;

    Vector3d any() { return Vector3d(normal(random), normal(random), normal(random)).normalized(); }
    double between(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); }

    /// An oblate body and where the Sun is: a ray that touches the body in q meets the observer and, up to 1.2 of its
    /// radius beside its centre, the Sun.
    std::pair<Seen, Vector3d> limb(double a, double b, double D, double altitude)
    {
        const Vector3d p = any(), e = any();
        const Vector3d q = a * e + (b - a) * p.dot(e) * p;
        const Vector3d n = (q + ((a * a) / (b * b) - 1.0) * p.dot(q) * p).normalized();
        const Vector3d t = n.cross(any()).normalized();
        const Vector3d r_PB = q + std::sqrt((a + altitude) * (a + altitude) - q.squaredNorm()) * t;
        return {{r_PB, a, b, p}, D * t - between(-1.2, 1.2) * Rs * n};
    }
};

constexpr double earth_a = 6378137.0, earth_b = 6356752.3, saturn_a = 60268e3, saturn_b = 54364e3;

TEST(Shadow, OfAnOblateBodyIsThatOfRaysPastItsEllipsoid)
{
    Sights sights;
    struct Case {
        double a, b, D, altitude, within;
    };
    for (const Case &c : {Case{earth_a, earth_b, AU, 500e3, 4e-4},
                          {earth_a, earth_b, AU, 3.6e7, 2e-4},
                          {earth_a, earth_b, AU, 1.5e9, 2e-3},
                          {saturn_a, saturn_b, 9.5 * AU, 1e7, 4e-4},
                          {saturn_a, saturn_b, 9.5 * AU, 1e9, 4e-4}}) {
        double worst = 0.0, by_sphere = 0.0;
        for (int round = 0; round < 40; round++) {
            const auto &[body, r_SB] = sights.limb(c.a, c.b, c.D, c.altitude);
            const double rays = hidden_rays(r_SB, {body});
            worst = std::max(worst, std::abs(hidden_share(r_SB, Rs, body.r_PB, c.a, c.b, body.p) - rays));
            by_sphere = std::max(by_sphere, std::abs(hidden_share(r_SB, Rs, body.r_PB, c.a) - rays));
        }
        EXPECT_LT(worst, c.within) << c.altitude;
        EXPECT_GT(by_sphere, 1.2 * c.within) << c.altitude;
    }
    // Annular, on the axis and beside it; a sphere is a sphere.
    const Vector3d r_SB(AU, 0, 0), r_PB(2e9, 1e3, 2e3), z(0, 0, 1);
    EXPECT_NEAR(hidden_share(r_SB, Rs, r_PB, earth_a, earth_b, z), hidden_rays(r_SB, {{r_PB, earth_a, earth_b, z}}),
                3.4e-3);
    EXPECT_GT(hidden_share(r_SB, Rs, {2e9, 0, 0}, earth_a, earth_b, z), 0.4);
    EXPECT_NEAR(hidden_share(r_SB, Rs, r_PB, earth_a, earth_a, z), hidden_share(r_SB, Rs, r_PB, earth_a), 1e-15);
}

TEST(Shadow, OfBodiesThatMeetIsThatOfRaysPastAllOfThem)
{
    Sights sights; // a limb, and one or two small spheres before or behind it
    double worst = 0.0, by_sum = 0.0;
    for (int round = 0; round < 160; round++) {
        const auto &[body, r_SB] =
            round % 2 ? sights.limb(earth_a, earth_b, AU, 500e3) : sights.limb(saturn_a, saturn_b, 9.5 * AU, 1e8);
        std::vector<Seen> bodies{body};
        for (int i = 0; i < 1 + round / 2 % 2; i++) {
            const double distance = 3.8e8, sun = Rs / r_SB.norm();
            const Vector3d off = Rs * sights.between(0.0, 1.2) * r_SB.cross(sights.any()).normalized();
            const double radius = distance * sun * sights.between(0.1, 1.2);
            bodies.push_back({distance * (r_SB + off).normalized(), radius, radius, sights.any()});
        }
        std::vector<Disc> discs{{{0.0, 0.0}, 1.0}};
        double sum = 0.0;
        for (const Seen &seen : bodies) {
            Disc disc{};
            const double hidden = hidden_share(r_SB, Rs, seen.r_PB, seen.a, seen.b, seen.p, &disc);
            sum += hidden;
            if (hidden > 0.0 && hidden < 1.0) {
                discs.push_back(disc);
            }
        }
        if (discs.size() == 1 + bodies.size()) {
            const double rays = hidden_rays(r_SB, bodies);
            worst = std::max(worst, std::abs(hidden_together(discs) - rays));
            by_sum = std::max(by_sum, std::min(sum, 1.0) - rays);
        }
    }
    EXPECT_LT(worst, 5e-4);
    EXPECT_GT(by_sum, 0.3);
}

TEST(Shadow, OfDiscsApartIsTheirSumAndWithinAnotherThatOfTheLarger)
{
    const Disc sun{{0, 0}, 1}, left{{-0.5, 0.1}, 0.3}, right{{0.6, 0}, 0.25}, within{{-0.55, 0.1}, 0.2};
    EXPECT_FALSE(left.meets(right));
    EXPECT_TRUE(left.meets(within));
    for (const auto &[discs, hidden] : {std::pair{std::vector{sun, left, right}, 0.09 + 0.0625},
                                        {{sun, left, within}, 0.09},
                                        {{sun, within, right, left}, 0.09 + 0.0625},
                                        {{sun}, 0.0}}) {
        EXPECT_NEAR(hidden_together(discs), hidden, 1e-12);
    }
}

TEST(Shadow, IsBehindTheBodyOnly)
{
    const double R = 6378e3;
    std::mt19937 random(1);
    std::normal_distribution<double> normal;
    for (int round = 0; round < 300; round++) {
        const Vector3d r_PB = 7000e3 * Vector3d(normal(random), normal(random), normal(random)).normalized();
        const double hidden = hidden_share(Vector3d(AU, 0, 0) + r_PB, Rs, r_PB, R);
        if (r_PB[0] < 0.0) {
            EXPECT_EQ(hidden, 0.0);
        }
        EXPECT_GE(hidden, 0.0);
        EXPECT_LE(hidden, 1.0);
    }
    EXPECT_EQ(hidden_share({AU, 0, 0}, Rs, {R / 2, 0, 0}, R), 1.0);      // inside the body
    EXPECT_EQ(hidden_share({AU, 0, 0}, Rs, {AU + 1e9, 0, 0}, 1e8), 0.0); // the body is behind the Sun
    EXPECT_EQ(hidden_share({AU, 0, 0}, Rs, {1e9, 0, 0}, 1e8), 1.0);
}

struct Light : ::testing::Test {
    Sunlight i{};
    SunlightModel model{i};

    static GravityBody body(const char *name, double radius, const Vector3d &r)
    {
        GravityBody made{.name = name, .mu = 1.0, .radius = radius, .r_PN_N = r};
        return made;
    }
};

TEST_F(Light, FallsWithTheSquareOfTheDistanceAndWithEachEclipse)
{
    model.set_body(body("SUN", Rs, {2.0 * AU, 0, 0}));
    model.add_body(body("EARTH", 6378e3, {0, 0, 0}));
    model.add_body(body("MOON", 1738e3, {-384e6, 2e7, 0}));
    model.prepare({"world.light", 1, nullptr});
    const auto lit = model.at(0, 0.0, {7e6, 0, 0});
    EXPECT_EQ(lit.visible, 1.0);
    EXPECT_NEAR(lit.irradiance, 1361.0 / 4.0, 0.05);
    EXPECT_LT((lit.s_N - Vector3d::UnitX()).norm(), 1e-12);
    EXPECT_EQ(model.at(0, 0.0, {-7e6, 0, 0}).visible, 0.0);
    EXPECT_EQ(model.at(0, 0.0, {-7e6, 0, 0}).irradiance, 0.0);
    EXPECT_EQ(model.at(0, 0.0, {-384e6 - 2e6, 2e7, 0}).visible, 0.0) << "behind the Moon";
    // Half in the shadow of one: what remains is what the geometry says.
    const Vector3d edge(-7e6, 6.38e6, 0);
    const double hidden = hidden_share(edge - Vector3d(2 * AU, 0, 0), Rs, edge, 6378e3);
    EXPECT_GT(hidden, 0.0);
    EXPECT_LT(hidden, 1.0);
    EXPECT_EQ(model.at(0, 0.0, edge).visible, 1.0 - hidden);
    i.par.irradiance = 1000.0;
    EXPECT_NEAR(model.at(0, 0.0, {7e6, 0, 0}).irradiance, 250.0, 0.05);

    model.reset(0);
    i.in.truth.head.quality = QUALITY_GOOD;
    i.in.truth.r_BN_N = vec(edge);
    model.update({5, 5});
    EXPECT_EQ(i.out.light.visible, 1.0 - hidden);
    EXPECT_EQ(i.out.light.irradiance, model.at(5, 0.0, edge).irradiance);
    EXPECT_EQ(i.out.light.head.t, 5);
}

TEST_F(Light, IsHiddenByBodiesTogetherWhereTheyMeet)
{
    const auto visible = [&](const std::vector<std::pair<Vector3d, double>> &bodies) {
        Sunlight parameters{};
        SunlightModel light{parameters};
        light.set_body(body("SUN", Rs, {AU, 0, 0}));
        for (const auto &[r, radius] : bodies) {
            light.add_body(body(("BODY " + std::to_string(radius)).c_str(), radius, r));
        }
        light.prepare({"world.light", 1, nullptr});
        return light.at(0, 0.0, {0, 0, 0}).visible;
    };
    const std::pair<Vector3d, double> moon{{384e6, 0, 0}, 8e5}, same{{1e9, 0, 0}, 8e5 / 384e6 * 1e9 * (1 + 1e-9)};
    const std::pair<Vector3d, double> beside{{384e6, 13e5, 0}, 3e5}, whole{{384e6, 0, 0}, 2e6};
    EXPECT_NEAR(visible({moon, same}), visible({moon}), 1e-8);
    const auto hidden = [](auto &seen) { return hidden_share({-AU, 0, 0}, Rs, -seen.first, seen.second); };
    EXPECT_EQ(visible({moon, beside}), 1.0 - (hidden(moon) + hidden(beside)));
    EXPECT_EQ(visible({moon, same, whole}), 0.0);
}

TEST_F(Light, ComesPastEllipsoidsAndBodiesThatMoveOn)
{
    GravityBody earth = body("EARTH", 6378137.0, {0, 0, 0});
    earth.naif = 399;
    earth.pole_N = Vector3d(0.4, 0, 1).normalized();
    earth.v_PN_N = {0, 3e4, 0};
    model.set_body(body("SUN", Rs, {AU, 0, 0}));
    model.add_body(earth);
    model.prepare({"world.light", 1, nullptr});
    const Vector3d r(-4.2e7, 4.4e6, 4.45e6), r_SB = r - Vector3d(AU, 0, 0);
    const double sphere = 1.0 - hidden_share(r_SB, Rs, r, 6378137.0);
    EXPECT_EQ(model.at(0, 0.0, r).visible, sphere);
    EXPECT_EQ(model.unhidden(0, 0.0, r).visible, 1.0);
    EXPECT_NEAR(model.unhidden(0, 0.0, r).irradiance * sphere, model.at(0, 0.0, r).irradiance, 1e-9);
    i.par.oblate = 1;
    const double polar = 6378137.0 * (1 - 1 / 298.257223563);
    EXPECT_NEAR(model.at(0, 0.0, r).visible, 1.0 - hidden_share(r_SB, Rs, r, 6378137.0, polar, earth.pole_N), 1e-12);
    EXPECT_GT(std::abs(model.at(0, 0.0, r).visible - sphere), 1e-3);
    // Light that passed the body 0.14 s ago: it was 4.2 km behind then.
    i.par.oblate = 0;
    i.par.light_time = 1;
    const Vector3d late = r + 3e4 * r.norm() / 299792458.0 * Vector3d::UnitY();
    EXPECT_NEAR(model.at(0, 0.0, r).visible, 1.0 - hidden_share(r_SB, Rs, late, 6378137.0), 1e-12);
    EXPECT_GT(std::abs(model.at(0, 0.0, r).visible - sphere), 1e-3);
}

TEST_F(Light, NamesWhatIsWrong)
{
    const auto refusal = [&] { return error_of([&] { model.prepare({"world.light", 1, nullptr}); }); };
    model.add_body(body("EARTH", 6378e3, {0, 0, 0}));
    EXPECT_EQ(refusal(), "world.light.sun is missing: give it a body, as in sun=world.SUN");
    model.set_body(body("SUN", Rs, {AU, 0, 0}));
    EXPECT_EQ(refusal(), "");
    model.add_body(body("EARTH", 6378e3, {0, 0, 0}));
    EXPECT_EQ(refusal(), "world.light.shadows: EARTH is there twice: name each body once");
    model.set_sky(testing::TwoCircles::sky(testing::TwoCircles::sun));
    EXPECT_EQ(refusal(), "world.light: SUN has no NAIF number, by which the sky would find it");
    GravityBody sun = body("SUN", Rs, {AU, 0, 0});
    sun.naif = 10;
    model.set_body(sun);
    EXPECT_EQ(refusal(), "world.light: SUN was given a position, but the sky holds its position");
}

} // namespace sunlight_model_test
} // namespace fledge::world
