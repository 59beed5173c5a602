// SPDX-License-Identifier: Apache-2.0
#include "world/environment/harmonics.h"

#include "sim/error.h"
#include "sim/wide.h"
#include "world/environment/gravity.h"
#include "world/environment/orientation.h"
#include "world/environment/testing/files.h"

#include <Eigen/Dense>
#include <Eigen/Geometry>

#include <cmath>
#include <numbers>
#include <random>

namespace fledge::world {
namespace harmonics_test {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using ::testing::HasSubstr;
using testing::real_file;

constexpr double mu = 4e14, R = 6.4e6;

/// Random coefficients of the size that fields of planets have (Kaula's rule).
HarmonicField random_field(int degree, std::uint32_t seed)
{
    HarmonicField field = HarmonicField::zero(mu, R, degree);
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> any(-1.0, 1.0);
    for (int n = 1; n <= degree; n++) {
        for (int m = 0; m <= n; m++) {
            field.C[HarmonicField::index(n, m)] = 1e-4 / (n * n) * any(random);
            field.S[HarmonicField::index(n, m)] = m > 0 ? 1e-4 / (n * n) * any(random) : 0.0;
        }
    }
    return field;
}

/// The potential by its definition, with the standard library's Legendre functions.
double potential_by_definition(const HarmonicField &field, const Vector3d &r_P)
{
    const double r = r_P.norm();
    const double colatitude = std::atan2(std::hypot(r_P[0], r_P[1]), r_P[2]);
    const double longitude = std::atan2(r_P[1], r_P[0]);
    double sum = 0.0;
    for (int n = field.degree; n >= 0; n--) {
        double of_degree = 0.0;
        for (int m = 0; m <= n; m++) {
            // sph_legendre: (-1)^m sqrt((2 n + 1) / (4 pi) (n - m)! / (n + m)!) P_nm(cos
            // colatitude)
            const double P = (m % 2 ? -1.0 : 1.0) * std::sqrt((m == 0 ? 1.0 : 2.0) * 4.0 * std::numbers::pi) *
                             std::sph_legendre(static_cast<unsigned>(n), static_cast<unsigned>(m), colatitude);
            const std::size_t i = HarmonicField::index(n, m);
            of_degree += P * (field.C[i] * std::cos(m * longitude) + field.S[i] * std::sin(m * longitude));
        }
        sum += std::pow(field.radius / r, n) * of_degree;
    }
    return field.mu / r * sum;
}

/// Points all over and above a sphere, and at and close to its poles.
std::vector<Vector3d> points(double radius, int count)
{
    std::vector<Vector3d> all;
    std::mt19937 random(3);
    std::normal_distribution<double> any;
    std::uniform_real_distribution<double> height(1.0, 1.3);
    for (int i = 0; i < count; i++) {
        const Vector3d direction(any(random), any(random), any(random));
        all.push_back(radius * height(random) / direction.norm() * direction);
    }
    for (const double z : {1.0, -1.0}) {
        all.push_back({0.0, 0.0, z * 1.01 * radius});
        for (const double angle : {1e-12, 1e-6, 1e-3}) {
            all.push_back(1.01 * radius * Vector3d(angle, -0.5 * angle, z).normalized());
        }
    }
    all.push_back({radius, 0.0, 0.0});
    all.push_back({0.0, -radius, 0.0});
    return all;
}

/// The gradient of the potential by differences of the fourth order.
Vector3d gradient(const Harmonics &field, const Vector3d &r, double h)
{
    Vector3d g;
    for (int i = 0; i < 3; i++) {
        const auto U = [&](double step) {
            double value;
            field.gravity(r + step * Vector3d::Unit(i), &value);
            return value;
        };
        g[i] = (8.0 * (U(h) - U(-h)) - (U(2.0 * h) - U(-2.0 * h))) / (12.0 * h);
    }
    return g;
}

/// The trace of the gradient of gravity, and the largest element of its antisymmetric part.
std::pair<double, double> divergence_and_curl(const Harmonics &field, const Vector3d &r, double h)
{
    Matrix3d J;
    for (int i = 0; i < 3; i++) {
        const auto a = [&](double step) { return field.gravity(r + step * Vector3d::Unit(i)); };
        J.col(i) = (8.0 * (a(h) - a(-h)) - (a(2.0 * h) - a(-2.0 * h))) / (12.0 * h);
    }
    return {J.trace(), (J - J.transpose()).cwiseAbs().maxCoeff()};
}

void expect_harmonic(const HarmonicField &model, int count)
{
    const Harmonics field(model);
    for (const Vector3d &r : points(model.radius, count)) {
        double U;
        const Vector3d a = field.gravity(r, &U);
        EXPECT_NEAR(U, potential_by_definition(model, r), 1e-12 * U);
        EXPECT_LT((a - gradient(field, r, 150.0)).norm(), 3e-10 * a.norm()) << r.transpose();
        const auto [divergence, curl] = divergence_and_curl(field, r, 150.0);
        EXPECT_LT(std::fabs(divergence), 1e-10 * a.norm() / 100.0) << r.transpose();
        EXPECT_LT(curl, 1e-10 * a.norm() / 100.0) << r.transpose();
    }
}

TEST(Harmonics, MarsToDegree80IsTheGradientOfItsPotential)
{
    const std::string path = real_file("mars-ggm2bc80.shadr.csv");
    SKIP_WITHOUT(path);
    expect_harmonic(read_gravity_field(path), 30);
}

TEST(Harmonics, TheEarthToDegree180IsTheGradientOfItsPotential)
{
    const std::string path = real_file("earth-ggm03s.shadr.csv");
    SKIP_WITHOUT(path);
    expect_harmonic(read_gravity_field(path), 10);
}

TEST(Harmonics, RandomFieldsOfEveryLowDegreeAreTheGradientsOfTheirPotentials)
{
    for (int degree = 0; degree <= 13; degree++) {
        expect_harmonic(random_field(degree, static_cast<std::uint32_t>(degree)), 5);
    }
}

TEST(Harmonics, ZonalsEqualTheirClosedForms)
{
    HarmonicField field = HarmonicField::zero(mu, R, 6);
    GravityBody body{.name = "closed form", .mu = mu, .radius = R, .J = {1.08e-3, -2.5e-4, -1.6e-4, 2.3e-4, 5.4e-4}};
    for (int n = 2; n <= 6; n++) {
        field.C[HarmonicField::index(n, 0)] = -body.J[static_cast<std::size_t>(n - 2)] / std::sqrt(2.0 * n + 1.0);
        EXPECT_DOUBLE_EQ(field.J(n), body.J[static_cast<std::size_t>(n - 2)]);
    }
    const Harmonics harmonics(field);
    for (const Vector3d &r : points(R, 100)) {
        double U;
        const Vector3d a = harmonics.gravity(r, &U), expected = gravity(body, r);
        EXPECT_LT((a - expected).norm(), 3e-15 * expected.norm());
        EXPECT_NEAR(U, gravity_potential(body, r), 3e-15 * U);
    }
}

TEST(Harmonics, AFieldTurnedAboutItsPoleTurnsItsGravity)
{
    const HarmonicField field = random_field(60, 7);
    HarmonicField turned = field;
    const double angle = 0.7;
    for (int n = 0; n <= field.degree; n++) {
        for (int m = 0; m <= n; m++) {
            const std::size_t i = HarmonicField::index(n, m);
            const double c = std::cos(m * angle), s = std::sin(m * angle);
            turned.C[i] = c * field.C[i] - s * field.S[i];
            turned.S[i] = s * field.C[i] + c * field.S[i];
        }
    }
    const Matrix3d turn = Eigen::AngleAxisd(angle, Vector3d::UnitZ()).toRotationMatrix();
    const Harmonics a(field), b(turned);
    for (const Vector3d &r : points(R, 50)) {
        const Vector3d expected = turn * a.gravity(r);
        EXPECT_LT((b.gravity(turn * r) - expected).norm(), 3e-15 * expected.norm());
    }
}

TEST(Harmonics, AFieldTurnedUpsideDownTurnsItsGravity)
{
    // Half a turn about x: z and the longitude change sign, P_nm(-z) = (-1)^(n+m) P_nm(z).
    const HarmonicField field = random_field(61, 8);
    HarmonicField turned = field;
    for (int n = 0; n <= field.degree; n++) {
        for (int m = 0; m <= n; m++) {
            const double sign = (n + m) % 2 ? -1.0 : 1.0;
            turned.C[HarmonicField::index(n, m)] *= sign;
            turned.S[HarmonicField::index(n, m)] *= -sign;
        }
    }
    const Harmonics a(field), b(turned);
    const Vector3d flip(1.0, -1.0, -1.0);
    for (const Vector3d &r : points(R, 50)) {
        const Vector3d expected = flip.cwiseProduct(a.gravity(r));
        EXPECT_LT((b.gravity(flip.cwiseProduct(r)) - expected).norm(), 3e-15 * expected.norm());
    }
}

TEST(Harmonics, NothingIsLostAtThePoles)
{
    const std::string path = real_file("earth-ggm03s.shadr.csv");
    SKIP_WITHOUT(path);
    const Harmonics field(read_gravity_field(path));
    for (const double z : {1.0, -1.0}) {
        // Gravity is linear over a millimetre: the mean of opposite points is that between them.
        const Vector3d pole(0.0, 0.0, z * 6.5e6), x(1e-3, 0, 0), y(0, 1e-3, 0);
        const Vector3d at = field.gravity(pole);
        EXPECT_TRUE(at.allFinite());
        for (const Vector3d &d : {x, y, Vector3d(x + y)}) {
            EXPECT_LT((0.5 * (field.gravity(pole + d) + field.gravity(pole - d)) - at).norm(), 1e-14);
        }
        // The same limit from every meridian; the gradient is 3e-6 / s^2.
        for (int i = 0; i < 12; i++) {
            const Vector3d d(std::cos(i), std::sin(i), 0.0);
            EXPECT_LT((field.gravity(pole + 1e-7 * d) - at).norm(), 4e-13);
        }
    }
}

TEST(Harmonics, SingleTermsOfHighDegreeAreAsTheStandardLibraryHasThem)
{
    const std::pair<int, int> terms[] = {{180, 0},  {180, 90},    {180, 180},   {700, 350},
                                         {2190, 1}, {2190, 1000}, {2190, 2189}, {2190, 2190}};
    for (const auto &[n, m] : terms) {
        HarmonicField model = HarmonicField::zero(mu, R, n);
        model.C[HarmonicField::index(n, m)] = 1.0;
        const Harmonics field(model);
        for (const double latitude : {0.0, 0.3, 0.9, -1.2, 1.5}) {
            const Vector3d r = R * Vector3d(std::cos(latitude), 0.0, std::sin(latitude));
            double U;
            const Vector3d a = field.gravity(r, &U);
            const double P = (m % 2 ? -1.0 : 1.0) * std::sqrt((m == 0 ? 1.0 : 2.0) * 4.0 * std::numbers::pi) *
                             std::sph_legendre(static_cast<unsigned>(n), static_cast<unsigned>(m),
                                               std::numbers::pi / 2.0 - latitude);
            EXPECT_NEAR(U * R / mu - 1.0, P, 1e-9) << n << ", " << m << " at " << latitude;
            // Outward: -(n + 1) times the term.
            const double outward = a.dot(r) / R / (mu / (R * R));
            EXPECT_NEAR(outward, -1.0 - (n + 1) * P, 1e-9 * n) << n << ", " << m << " at " << latitude;
        }
        EXPECT_TRUE(field.gravity({0.0, 0.0, R}).allFinite()) << n << ", " << m;
        EXPECT_TRUE(field.gravity({1e-3, 0.0, -R}).allFinite()) << n << ", " << m;
    }
}

TEST(Harmonics, LowerDegreesLeaveOutTheRest)
{
    HarmonicField field = random_field(40, 9);
    const Harmonics low(field, 17);
    for (int n = 18; n <= 40; n++) {
        for (int m = 0; m <= n; m++) {
            field.C[HarmonicField::index(n, m)] = field.S[HarmonicField::index(n, m)] = 0.0;
        }
    }
    const Harmonics all(field);
    for (const Vector3d &r : points(R, 20)) {
        EXPECT_LT((low.gravity(r) - all.gravity(r)).norm(), 3e-15 * low.gravity(r).norm());
    }
    const Harmonics none(field, 0);
    const Vector3d r(7e6, 1e5, -3e6);
    EXPECT_LT((none.gravity(r) + mu / (r.norm() * r.squaredNorm()) * r).norm(), 1e-15);
}

TEST(Harmonics, TurnsWithThePlanet)
{
    // Over one day of Mars the gravity at a point at rest returns; in between it changed.
    const Harmonics field(random_field(8, 10));
    const Orientation mars = Orientation::built_in(499);
    const Vector3d r_N(4e6, 3e6, 6e6);
    const auto at = [&](double t) { return field.gravity_N(mars.at({0}, t).dcm_PN, r_N); };
    const double day = 2.0 * std::numbers::pi / mars.at({0}).omega_PN_P.norm();
    EXPECT_LT((at(day) - at(0.0)).norm(), 1e-10);
    EXPECT_GT((at(0.5 * day) - at(0.0)).norm(), 1e-5);
    // In axes fixed in the body and in inertial ones it is one vector.
    const Matrix3d dcm = mars.at({0}).dcm_PN;
    EXPECT_LT((dcm * at(0.0) - field.gravity(dcm * r_N)).norm(), 1e-14);
}

TEST(Harmonics, AreTheSameBitForBitInNarrowRegisters)
{
    const int widest = sim::wide;
    for (const int degree : {0, 1, 2, 3, 4, 7, 12, 20, 70}) { // blocks of four orders, alone and two by two
        const Harmonics field(random_field(degree, 11));
        for (const Vector3d &r : points(R, 20)) {
            double U, other_U;
            sim::wide = 0;
            const Vector3d narrow = field.gravity(r, &U);
            for (sim::wide = 1; sim::wide <= widest; sim::wide++) {
                EXPECT_EQ(field.gravity(r, &other_U), narrow) << degree << ": " << r.transpose();
                EXPECT_EQ(other_U, U);
            }
        }
    }
    sim::wide = widest;
}

TEST(Harmonics, MoreThanTheFieldHasIsRefused)
{
    const HarmonicField field = random_field(4, 1);
    EXPECT_THROW(Harmonics(field, 5), sim::SetupError);
    EXPECT_THAT(error_of([&] { Harmonics(field, 5); }), HasSubstr("degree 5 was asked for; it has 4"));
    EXPECT_THAT(error_of([&] { Harmonics(field, -1); }), HasSubstr("degree -1"));
    EXPECT_THAT(error_of([] { HarmonicField::zero(mu, 0.0, 2); }), HasSubstr("must be > 0"));
    EXPECT_THAT(error_of([&] { field.J(5); }), HasSubstr("has no J5"));
}

} // namespace harmonics_test
} // namespace fledge::world
