// SPDX-License-Identifier: Apache-2.0
#include "world/environment/attraction.h"

#include "sim/error.h"
#include "world/dynamics/orbit.h"
#include "world/environment/bodies.h"
#include "world/environment/harmonics.h"
#include "world/environment/testing/files.h"
#include "world/environment/testing/kernel.h"
#include "world/environment/testing/two_circles.h"
#include "world/testing/flyer.h"

#include <array>
#include <cmath>

namespace fledge::world {
namespace attraction_test {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using ::testing::ElementsAre;
using testing::Flyer;
using ::testing::HasSubstr;
using testing::made_kernel;
using testing::second;
using testing::TemporaryFile;
using testing::TwoCircles;
using testing::uniform_motion;

GravityBody point(const char *name, int naif, double mu)
{
    GravityBody body{.name = name, .mu = mu, .naif = naif};
    return body;
}

GravityBody the_sun()
{
    return point("SUN", TwoCircles::sun, TwoCircles::mu_sun);
}

GravityBody jupiter()
{
    return point("JUPITER", TwoCircles::jupiter, TwoCircles::mu_jupiter);
}

// ---- The formula --------------------------------------------------------------------------------

TEST(ThirdBodyGravity, LosesNoDigits)
{
    using Long = Eigen::Matrix<long double, 3, 1>;
    const Vector3d r_PN(1.1e11, -0.8e11, 0.4e11);
    const double mu = 1.3e20;
    for (const double size : {1e3, 1e6, 1e9, 1e11, 1e12}) {
        const Vector3d r = size * Vector3d(0.6, 0.3, -0.7);
        // 64 bits of mantissa leave 19 - log10(|r_PN| / |r|) digits to the plain difference.
        const Long p = r_PN.cast<long double>(), d = p - r.cast<long double>();
        const auto unit = [](const Long &x) { return Long(x / (x.squaredNorm() * x.norm())); };
        const Long plain = mu * (unit(d) - unit(p));
        const Vector3d ours = third_body_gravity(mu, r, r_PN);
        const double lost = std::max(1e-19 * r_PN.norm() / size, 0.0);
        EXPECT_LT((ours.cast<long double>() - plain).norm(), (2e-15 + 30 * lost) * plain.norm()) << size;
    }
}

// ---- Flights near Jupiter -----------------------------------------------------------------------

constexpr double begin_day = 1.0;

/// Where and how fast a fly-by of Jupiter begins, relative to it: two days before periapsis.
OrbitState fly_by()
{
    const double e = 1.5, rp = 3e8, p = rp * (1.0 + e);
    const double f = -2.15; // r is p / (1 + e cos f) = 4.2e9
    return orbit_state(TwoCircles::mu_jupiter, {p, e, 0.6, 0.3, -0.4, f});
}

/// The same flight, in an N about any center. After every hour `look` is given the state relative
/// to the barycentre, and t past J2000.
void fly(int center, const std::vector<GravityBody> &bodies,
         const std::function<void(const Vector3d &, const Vector3d &, double)> &look)
{
    const double t0 = begin_day * TwoCircles::day;
    const auto origin = [&](double t) {
        return center == 0 ? OrbitState{{0, 0, 0}, {0, 0, 0}}
                           : OrbitState{TwoCircles::r(center, t), TwoCircles::v(center, t)};
    };
    const OrbitState start = fly_by(), at = origin(t0);
    Flyer f;
    f.method = sim::make_adaptive(1e-13, 1e-9);
    f.set_inertia(Matrix3d::Identity());
    f.craft_interface.par.r_BN_N = vec(TwoCircles::r(TwoCircles::jupiter, t0) + start.r - at.r);
    f.craft_interface.par.v_BN_N = vec(TwoCircles::v(TwoCircles::jupiter, t0) + start.v - at.v);
    for (const GravityBody &body : bodies) {
        f.craft.add_gravity(body);
    }
    f.craft.set_sky(TwoCircles::sky(center, begin_day));
    f.prepare();
    f.craft.ensure_data_until(96 * 3600 * second);
    f.fly(96 * 3600 * second, 3600 * second, [&] {
        const double t = t0 + 1e-9 * static_cast<double>(f.t);
        look(f.r() + origin(t).r, f.v() + origin(t).v, t);
    });
}

TEST(Attraction, KeepsTheJacobiConstantThroughAFlyBy)
{
    // C = v^2 / 2 - n . (r x v) - mu_S / r_S - mu_J / r_J, about the barycentre.
    for (const int center : {TwoCircles::jupiter, TwoCircles::sun, 0}) {
        const auto constant = [](const Vector3d &r, const Vector3d &v, double t) {
            const Vector3d n = TwoCircles::plane() * Vector3d(0, 0, TwoCircles::rate());
            return 0.5 * v.squaredNorm() - n.dot(r.cross(v)) -
                   TwoCircles::mu_sun / (r - TwoCircles::r(TwoCircles::sun, t)).norm() -
                   TwoCircles::mu_jupiter / (r - TwoCircles::r(TwoCircles::jupiter, t)).norm();
        };
        const double t0 = begin_day * TwoCircles::day;
        const OrbitState start = fly_by();
        const double before = constant(TwoCircles::r(TwoCircles::jupiter, t0) + start.r,
                                       TwoCircles::v(TwoCircles::jupiter, t0) + start.v, t0);
        double nearest = 1e99, worst = 0.0;
        fly(center, {the_sun(), jupiter()}, [&](const Vector3d &r, const Vector3d &v, double t) {
            nearest = std::min(nearest, (r - TwoCircles::r(TwoCircles::jupiter, t)).norm());
            worst = std::max(worst, std::abs(constant(r, v, t) - before));
        });
        EXPECT_LT(nearest, 5e8) << "it did fly by";
        // Of the kinetic energy. Away from Jupiter a position has 1e-4 m of rounding at every step.
        const double share = center == TwoCircles::jupiter ? 1e-12 : 2e-11;
        EXPECT_LT(worst, share * TwoCircles::mu_jupiter / 3e8) << center;
    }
}

TEST(Attraction, IsTheSameFlightAboutEveryCenterAndInAnInertialFrame)
{
    // The three bodies in an inertial frame, all of them integrated: plain Runge and Kutta in long
    // double, with short steps.
    using Long = Eigen::Matrix<long double, 3, 1>;
    struct Bodies {
        std::array<Long, 3> r, v; // craft, Sun, Jupiter
    };
    constexpr long double mu[] = {0.0L, TwoCircles::mu_sun, TwoCircles::mu_jupiter};
    const auto rates = [&](const Bodies &b) {
        Bodies d;
        for (std::size_t i = 0; i < 3; i++) {
            d.r[i] = b.v[i];
            d.v[i].setZero();
            for (std::size_t j = 1; j < 3; j++) {
                if (j != i) {
                    const Long to = b.r[j] - b.r[i];
                    d.v[i] += mu[j] / (to.squaredNorm() * to.norm()) * to;
                }
            }
        }
        return d;
    };
    const auto shifted = [](const Bodies &b, long double h, const Bodies &d) {
        Bodies out;
        for (std::size_t i = 0; i < 3; i++) {
            out.r[i] = b.r[i] + h * d.r[i];
            out.v[i] = b.v[i] + h * d.v[i];
        }
        return out;
    };
    const double t0 = begin_day * TwoCircles::day;
    const OrbitState start = fly_by();
    Bodies b;
    for (const std::size_t i : {1, 2}) {
        const int body = i == 1 ? TwoCircles::sun : TwoCircles::jupiter;
        b.r[i] = TwoCircles::r(body, t0).cast<long double>();
        b.v[i] = TwoCircles::v(body, t0).cast<long double>();
    }
    b.r[0] = b.r[2] + start.r.cast<long double>();
    b.v[0] = b.v[2] + start.v.cast<long double>();
    std::vector<Vector3d> expected; // relative to Jupiter
    constexpr int steps = 180;      // per hour
    const long double h = 3600.0L / steps;
    for (int i = 1; i <= 96 * steps; i++) {
        const Bodies k1 = rates(b), k2 = rates(shifted(b, h / 2, k1));
        const Bodies k3 = rates(shifted(b, h / 2, k2)), k4 = rates(shifted(b, h, k3));
        for (const auto &[k, weight] : {std::pair{&k1, 1}, {&k2, 2}, {&k3, 2}, {&k4, 1}}) {
            b = shifted(b, weight * h / 6, *k);
        }
        if (i % steps == 0) {
            expected.push_back((b.r[0] - b.r[2]).cast<double>());
        }
    }

    const auto from_jupiter = [](const Vector3d &r, double t) {
        return Vector3d(r - TwoCircles::r(TwoCircles::jupiter, t));
    };
    double without_sun = 0.0;
    fly(TwoCircles::jupiter, {jupiter()}, [&](const Vector3d &r, const Vector3d &, double t) {
        without_sun = (from_jupiter(r, t) - expected.back()).norm();
    });
    EXPECT_GT(without_sun, 10e3); // there is something to be got right

    for (const int center : {TwoCircles::jupiter, TwoCircles::sun, 0}) {
        double worst = 0.0;
        std::size_t i = 0;
        fly(center, {the_sun(), jupiter()}, [&](const Vector3d &r, const Vector3d &, double t) {
            worst = std::max(worst, (from_jupiter(r, t) - expected[i++]).norm());
        });
        EXPECT_EQ(i, expected.size());
        EXPECT_LT(worst, center == TwoCircles::jupiter ? 0.01 : 1.0) << center;
    }
}

// ---- Whose fall counts --------------------------------------------------------------------------

/// Earth, Moon and Sun at rest, on the first axis, for 100 s.
std::string a_row()
{
    return made_kernel({uniform_motion(3, 0, 0, 100, 1.5e8, 0), uniform_motion(399, 3, 0, 100, -4700, 0),
                        uniform_motion(301, 3, 0, 100, 380000, 0), uniform_motion(10, 0, 0, 100, 0, 0)});
}

TEST(Attraction, APassageThroughAMovingBodyEndsTheRun)
{
    // Relative to the barycentre and to the Sun, Jupiter moves; periapsis is at 3e8 m.
    for (const int center : {TwoCircles::jupiter, TwoCircles::sun, 0}) {
        for (const double surface : {2.99e8, 3.01e8}) {
            for (const double hours : {0.1, 24.0}) {
                Flyer f;
                f.method = sim::make_adaptive(1e-12, 1e-3);
                f.set_inertia(Matrix3d::Identity());
                GravityBody near = jupiter();
                near.surface = surface;
                f.craft.add_gravity(near);
                f.craft.add_gravity(the_sun());
                const auto sky = TwoCircles::sky(center);
                f.craft.set_sky(sky);
                Ephemeris::Cursor cursor;
                const BodyState at = sky->state(TwoCircles::jupiter, 0, cursor);
                const OrbitState relative = fly_by();
                f.craft_interface.par.r_BN_N = vec(relative.r + at.r);
                f.craft_interface.par.v_BN_N = vec(relative.v + at.v);
                f.prepare();
                const auto dt = static_cast<sim::Ns>(3.6e12 * hours);
                const std::string text = error_of([&] { f.fly(4 * 86400 * second, dt); });
                if (surface < 3e8) {
                    EXPECT_EQ(text, "") << center << " " << hours;
                } else {
                    EXPECT_THAT(text, HasSubstr("world.craft: inside JUPITER at ")) << center << " " << hours;
                }
            }
        }
    }
}

TEST(Attraction, OfTheMembersOfASystemDoesNotMoveItsBarycentre)
{
    const TemporaryFile file("row.bsp", a_row());
    const double mu_sun = 1.3e20, mu_earth = 4e14, mu_moon = 5e12;
    const Vector3d r(2e7, 3e7, -1e7), earth(-4.7e6, 0, 0), moon(3.8e8, 0, 0), sun(-1.5e11, 0, 0);
    const auto at = [&](int center, const Vector3d &r_BN_N) {
        Ephemeris ephemeris;
        ephemeris.add_spk(file.path());
        Attraction attraction;
        attraction.add(point("SUN", 10, mu_sun));
        attraction.add(point("EARTH", 399, mu_earth));
        attraction.add(point("MOON", 301, mu_moon));
        attraction.set_sky(std::make_shared<const Sky>(std::move(ephemeris), TimeSystem(), Epoch{0}, center));
        attraction.prepare("craft", r_BN_N);
        return attraction.at(0, 50.0, r_BN_N);
    };
    const auto pull = [&](double mu, const Vector3d &p) {
        return Vector3d(mu / std::pow((p - r).norm(), 3) * (p - r));
    };
    const auto fall = [&](double mu, const Vector3d &p) { return Vector3d(mu / std::pow(p.norm(), 3) * p); };
    const Vector3d all = pull(mu_sun, sun) + pull(mu_earth, earth) + pull(mu_moon, moon);
    EXPECT_LT((at(0, r - sun) - all).norm(), 1e-14 * all.norm());
    EXPECT_LT((at(3, r) - (all - fall(mu_sun, sun))).norm(), 1e-14 * all.norm());
    EXPECT_LT((at(399, r - earth) - (all - fall(mu_sun, sun - earth) - fall(mu_moon, moon - earth))).norm(),
              1e-14 * all.norm());
}

TEST(Attraction, TakesASystemForAPlanetThatIsNotGivenAlone)
{
    const TemporaryFile file("jupiter.bsp",
                             made_kernel({uniform_motion(5, 0, 0, 100, 7e8, 0), uniform_motion(10, 0, 0, 100, 0, 0)}));
    Ephemeris ephemeris;
    ephemeris.add_spk(file.path());
    Attraction attraction;
    attraction.add(point("JUPITER", 599, 1.26687e17));
    attraction.set_sky(std::make_shared<const Sky>(std::move(ephemeris), TimeSystem(), Epoch{0}, 10));
    attraction.prepare("craft", {1e9, 0, 0});
    EXPECT_EQ(attraction.at(0, 0.0, {1e9, 0, 0}), third_body_gravity(body_mu(5), {1e9, 0, 0}, {7e11, 0, 0}));
    EXPECT_THAT(attraction.assumptions(),
                ElementsAre("gravity: the ephemeris has no JUPITER (599); JUPITER BARYCENTER (5) "
                            "stands for it, with the mass of its moons"));
}

// ---- Fields that turn ---------------------------------------------------------------------------

constexpr double mu_mars = 4.2828e13, radius_mars = 3.397e6;

/// N about Mars, which is all there is.
std::shared_ptr<const Sky> mars_sky(const std::string &kernel)
{
    Ephemeris ephemeris;
    ephemeris.add_spk(kernel);
    return std::make_shared<const Sky>(std::move(ephemeris), TimeSystem(), Epoch{40 * second}, 499);
}

struct Mars : ::testing::Test {
    TemporaryFile file{"mars.bsp", made_kernel({uniform_motion(4, 0, 0, 1e6, 2e8, 20)})};
    std::shared_ptr<const Sky> sky = mars_sky(file.path());
    Vector3d r{2.1e6, -3.2e6, 1.7e6};

    static GravityBody with(const HarmonicField &field)
    {
        GravityBody body = point("MARS", 499, 0.0);
        body.field = std::make_shared<const Harmonics>(field);
        return body;
    }

    Attraction attraction(const GravityBody &body) const
    {
        Attraction made;
        made.add(body);
        made.set_sky(sky);
        made.prepare("craft", r);
        return made;
    }
};

TEST_F(Mars, OfDegree2AloneIsTheZonalJ2)
{
    HarmonicField field = HarmonicField::zero(mu_mars, radius_mars, 2);
    field.C[HarmonicField::index(2, 0)] = -8.75e-4;
    GravityBody zonal = point("MARS", 499, mu_mars);
    zonal.radius = radius_mars;
    zonal.J[0] = field.J(2);
    zonal.pole_N = Vector3d::UnitX(); // the sky replaces it
    Attraction a = attraction(with(field)), b = attraction(zonal);
    const Vector3d expected = b.at(0, 0.0, r);
    EXPECT_LT((a.at(0, 0.0, r) - expected).norm(), 1e-15 * expected.norm());
    // It is far from a point, and the pole hardly moves in three days.
    EXPECT_GT((expected + mu_mars / std::pow(r.norm(), 3) * r).norm(), 1e-4 * expected.norm());
    EXPECT_LT((a.at(0, 3 * 86400.0, r) - expected).norm(), 1e-8 * expected.norm());
    // In 20 years it does, and the zonal's goes with it.
    const double years = 20 * 365.25 * 86400.0;
    EXPECT_GT((b.at(0, years, r) - expected).norm(), 1e-8 * expected.norm());
    EXPECT_LT((a.at(0, years, r) - b.at(0, years, r)).norm(), 1e-15 * expected.norm());
    // A pole that was given for good is not replaced.
    zonal.pole_stays = true;
    Attraction still = attraction(zonal);
    EXPECT_EQ(still.at(0, years, r), still.at(0, 0.0, r));
    EXPECT_EQ(still.at(0, 0.0, r), gravity(zonal, r));
}

TEST_F(Mars, TurnsWithItsField)
{
    HarmonicField field = HarmonicField::zero(mu_mars, radius_mars, 3);
    field.C[HarmonicField::index(2, 0)] = -8.75e-4;
    field.C[HarmonicField::index(2, 2)] = -8.4e-5;
    field.S[HarmonicField::index(2, 2)] = 5e-5;
    field.C[HarmonicField::index(3, 1)] = 4e-6;
    const Harmonics harmonics(field);
    const Orientation mars = sky->orientation(499);
    Attraction a = attraction(with(field));
    for (const double tau : {0.0, 3.0, 1e4, 3.0}) { // back and forth
        for (const sim::Ns start : {sim::Ns{0}, 7000 * second}) {
            const Matrix3d dcm_PN = mars.at(sky->epoch_at(start), tau).dcm_PN;
            EXPECT_EQ(a.at(start, tau, r), harmonics.gravity_N(dcm_PN, r));
        }
    }
    const Vector3d now = a.at(0, 0.0, r);
    EXPECT_GT((a.at(0, 6 * 3600.0, r) - now).norm(), 1e-5 * now.norm());
    EXPECT_LT((a.at(0, 88642.663, r) - now).norm(), 1e-9 * now.norm()); // one turn
}

TEST_F(Mars, KeepsTheEnergyInTheTurningFrame)
{
    // In P the field is at rest, so v_P^2 / 2 - |omega x r|^2 / 2 - U is kept; with v_P = v - omega
    // x r that is v^2 / 2 - omega . (r x v) - U.
    HarmonicField field = HarmonicField::zero(mu_mars, radius_mars, 4);
    field.C[HarmonicField::index(2, 0)] = -8.75e-4;
    field.C[HarmonicField::index(2, 2)] = -8.4e-5;
    field.S[HarmonicField::index(2, 2)] = 5e-5;
    field.C[HarmonicField::index(4, 3)] = 6e-6;
    const Harmonics harmonics(field);
    const Orientation mars = sky->orientation(499);
    Flyer f;
    f.method = sim::make_adaptive(1e-12, 1e-9);
    f.set_inertia(Matrix3d::Identity());
    f.craft_interface.par.r_BN_N = vec(r);
    f.craft_interface.par.v_BN_N = vec3(2000, 2400, 1500);
    f.craft.add_gravity(with(field));
    f.craft.set_sky(sky);
    f.prepare();
    const auto energy = [&] {
        const BodyAttitude attitude = mars.at(sky->epoch_at(f.t));
        const Vector3d omega_N = attitude.dcm_PN.transpose() * attitude.omega_PN_P;
        double potential = 0.0;
        harmonics.gravity(attitude.dcm_PN * f.r(), &potential);
        return 0.5 * f.v().squaredNorm() - omega_N.dot(f.r().cross(f.v())) - potential;
    };
    const auto inertial = [&] { return 0.5 * f.v().squaredNorm() - mu_mars / f.r().norm(); };
    const double before = energy(), inertial_before = inertial();
    double changed = 0.0, inertial_changed = 0.0;
    f.fly(86400 * second, 300 * second, [&] {
        changed = std::max(changed, std::abs(energy() - before));
        inertial_changed = std::max(inertial_changed, std::abs(inertial() - inertial_before));
    });
    // Only the precession of the pole, 5e-8 rad in a day, changes it.
    EXPECT_LT(changed, 1e-8 * std::abs(before));
    EXPECT_GT(inertial_changed, 1e-4 * std::abs(before));
}

// ---- What is refused ----------------------------------------------------------------------------

TEST_F(Mars, NamesWhatIsWrong)
{
    const auto refusal = [&](const std::vector<GravityBody> &bodies, int center = 499) {
        Attraction a;
        for (const GravityBody &body : bodies) {
            a.add(body);
        }
        Ephemeris ephemeris;
        ephemeris.add_spk(file.path());
        a.set_sky(std::make_shared<const Sky>(std::move(ephemeris), TimeSystem(), Epoch{0}, center));
        return error_of([&] { a.prepare("world.craft", r); });
    };
    EXPECT_EQ(refusal({point("MARS", 499, mu_mars)}), "");
    GravityBody nameless = point("ROCK", 0, 1.0);
    nameless.naif.reset();
    EXPECT_EQ(refusal({nameless}), "world.craft.gravity: ROCK has no NAIF number, by which the sky would find it");
    GravityBody elsewhere = point("MARS", 499, mu_mars);
    elsewhere.r_PN_N = {1e9, 0, 0};
    EXPECT_EQ(refusal({elsewhere}), "world.craft.gravity: MARS was given a position, but "
                                    "the sky holds its position");
    EXPECT_THAT(refusal({point("EARTH", 399, 4e14)}),
                HasSubstr("world.craft.gravity: " + file.path() + ": no EARTH (399); asked for"));
    EXPECT_EQ(refusal({point("MARS AND MOONS", 4, mu_mars)}),
              "world.craft.gravity: MARS BARYCENTER (4) is the whole system of the centre, MARS "
              "(499): name the members of the system");
    EXPECT_EQ(refusal({point("MARS", 499, mu_mars), point("MARS AND MOONS", 4, mu_mars)}, 0),
              "world.craft.gravity: MARS BARYCENTER (4) holds MARS (499): name the system or its "
              "members, not both");
    GravityBody large = point("MARS", 499, mu_mars);
    large.radius = 1e7;
    EXPECT_THAT(refusal({large}), HasSubstr("world.craft.r_BN_N: must lie outside MARS, of "));

    const HarmonicField field = HarmonicField::zero(mu_mars, radius_mars, 2);
    GravityBody barycentre = with(field);
    barycentre.naif = 4;
    EXPECT_THAT(refusal({barycentre}, 0),
                HasSubstr("world.craft.gravity: no orientation is built in for MARS BARYCENTER"));
    Attraction without;
    without.add(with(field));
    EXPECT_EQ(error_of([&] { without.prepare("world.craft", r); }),
              "world.craft.gravity: the field of MARS turns with it: give a sky, which holds its "
              "orientation");
    GravityBody both = with(field);
    both.J[0] = 1e-3;
    EXPECT_THAT(error_of([&] { without.add(both); }), HasSubstr("exclude one another"));
}

TEST_F(Mars, TheEndOfTheSkyIsNamedBeforeItIsReachedAndAtTheLatestThere)
{
    Flyer f;
    f.set_inertia(Matrix3d::Identity());
    f.craft_interface.par.r_BN_N = vec3(1e9, 0, 0);
    f.craft.add_gravity(point("MARS", 499, mu_mars));
    Ephemeris ephemeris;
    ephemeris.add_spk(file.path());
    const Epoch epoch{999'990 * second};
    f.craft.set_sky(std::make_shared<const Sky>(std::move(ephemeris), TimeSystem(), epoch, 0));
    f.prepare();
    EXPECT_NO_THROW(f.craft.ensure_data_until(10 * second));
    const std::string words = "world.craft.gravity: MARS BARYCENTER (4) is given from "
                              "2000-01-01T12:00:00 TDB to 2000-01-13T01:46:40 TDB";
    EXPECT_THAT(error_of([&] { f.craft.ensure_data_until(11 * second); }), HasSubstr(words));
    EXPECT_THROW(f.craft.ensure_data_until(11 * second), sim::SetupError);
    EXPECT_THROW(f.craft.ensure_data_until(std::numeric_limits<sim::Ns>::max()), sim::SetupError);
    EXPECT_NO_THROW(f.fly(10 * second, second));
    EXPECT_THROW(f.step(second), sim::RunError);
    EXPECT_THAT(error_of([&] { f.step(second); }), HasSubstr("last good state at 10 s: r_BN_N = [1e+09, 0, 0] m"));
}

} // namespace attraction_test
} // namespace fledge::world
