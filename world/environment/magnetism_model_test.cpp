// SPDX-License-Identifier: Apache-2.0
// The dipole by its textbook form; the World Magnetic Model against sums in spherical coordinates, which divide by the
// cosine of the latitude and share nothing with the model's own, and against its published test values.
#include "world/environment/magnetism_model.h"

#include "world/eigen.h"
#include "world/environment/testing/files.h"
#include "world/environment/testing/two_circles.h"

#include <Eigen/Dense>

#include <array>
#include <numbers>
#include <random>
#include <sstream>

namespace fledge::world {
namespace magnetism_model_test {

using Eigen::Vector3d;
using ::testing::HasSubstr;
using testing::TemporaryFile;

constexpr double pi = std::numbers::pi, deg = pi / 180.0;
constexpr sim::Ns second = 1'000'000'000;

/// A file in the form of the model's, with random coefficients.
struct Coefficients {
    int degree;
    std::vector<std::array<double, 4>> rows;

    explicit Coefficients(int highest) : degree(highest)
    {
        std::mt19937 random(1);
        std::normal_distribution<double> normal;
        for (int n = 1; n <= degree; n++) {
            for (int m = 0; m <= n; m++) {
                const auto rounded = [&](double scale) { return std::round(10 * scale * normal(random)) / 10; };
                rows.push_back(
                    {rounded(30000.0 / (n * n)), m ? rounded(30000.0 / (n * n)) : 0.0, rounded(20), rounded(20)});
            }
        }
    }
    std::string text(const std::string &end = "99999999999999999999\n999999999999999999\n") const
    {
        std::ostringstream out;
        out << "    2025.0            WMM-TEST     11/13/2024\n";
        std::size_t i = 0;
        for (int n = 1; n <= degree; n++) {
            for (int m = 0; m <= n; m++, i++) {
                out << n << "  " << m << "  " << rows[i][0] << " " << rows[i][1] << " " << rows[i][2] << " "
                    << rows[i][3] << "\n";
            }
        }
        return out.str() + end;
    }
};

double factorial(int n)
{
    return n < 2 ? 1.0 : n * factorial(n - 1);
}

/// P_nm of Schmidt from the derivatives of (x^2 - 1)^n, and its slope by the colatitude from a central difference.
double schmidt(int n, int m, double colatitude)
{
    // Rodrigues: P_nm = sin^m / (2^n n!) d^(n+m)/dx^(n+m) (x^2 - 1)^n, term by term.
    const double x = std::cos(colatitude);
    double sum = 0.0;
    for (int k = 0; 2 * k <= n - m; k++) {
        sum += (k % 2 ? -1.0 : 1.0) * factorial(2 * n - 2 * k) /
               (factorial(k) * factorial(n - k) * factorial(n - m - 2 * k)) * std::pow(x, n - m - 2 * k);
    }
    const double norm = m == 0 ? 1.0 : std::sqrt(2.0 * factorial(n - m) / factorial(n + m));
    return norm * std::pow(std::sin(colatitude), m) * sum / std::pow(2.0, n);
}

/// North, east, down [nT].
Vector3d by_angles(const Coefficients &c, double year, double r, double colatitude, double longitude)
{
    const double a = 6371.2e3;
    Vector3d B(0, 0, 0);
    std::size_t i = 0;
    for (int n = 1; n <= c.degree; n++) {
        for (int m = 0; m <= n; m++, i++) {
            const double g = c.rows[i][0] + (year - 2025.0) * c.rows[i][2];
            const double h = m ? c.rows[i][1] + (year - 2025.0) * c.rows[i][3] : 0.0;
            const double q = std::pow(a / r, n + 2), step = 1e-4;
            const double P = schmidt(n, m, colatitude);
            const double slope = (8.0 * (schmidt(n, m, colatitude + step) - schmidt(n, m, colatitude - step)) -
                                  (schmidt(n, m, colatitude + 2 * step) - schmidt(n, m, colatitude - 2 * step))) /
                                 (12.0 * step);
            const double C = std::cos(m * longitude), S = std::sin(m * longitude);
            B += q * Vector3d((g * C + h * S) * slope, m * (g * S - h * C) * P / std::sin(colatitude),
                              -(n + 1) * (g * C + h * S) * P);
        }
    }
    return B;
}

/// Components north, east, down of a field [T] at geocentric angles, in nT.
Vector3d local(const Vector3d &B, double colatitude, double longitude)
{
    const Vector3d up(std::sin(colatitude) * std::cos(longitude), std::sin(colatitude) * std::sin(longitude),
                      std::cos(colatitude));
    const Vector3d east(-std::sin(longitude), std::cos(longitude), 0);
    return 1e9 * Vector3d(B.dot(up.cross(east)), B.dot(east), -B.dot(up));
}

Vector3d place(double r, double colatitude, double longitude)
{
    return r * Vector3d(std::sin(colatitude) * std::cos(longitude), std::sin(colatitude) * std::sin(longitude),
                        std::cos(colatitude));
}

void compare(const MagneticCoefficients &model, const Coefficients &c)
{
    std::mt19937 random(2);
    std::uniform_real_distribution<double> share(0.0, 1.0);
    for (int round = 0; round < 60; round++) {
        const double r = 6.4e6 + 3e6 * share(random), colatitude = 0.05 + 3.04 * share(random);
        const double longitude = 2 * pi * share(random), year = 2025.0 + 5.0 * share(random);
        const Vector3d found = local(model.field(place(r, colatitude, longitude), year), colatitude, longitude);
        const Vector3d wanted = by_angles(c, year, r, colatitude, longitude);
        EXPECT_LT((found - wanted).norm(), 1e-9 * wanted.norm()) << r << " " << colatitude << " " << longitude;
    }
}

TEST(MagneticCoefficients, GiveTheFieldOfTheirSums)
{
    const Coefficients c(12);
    const TemporaryFile file("field.COF", c.text());
    compare(MagneticCoefficients::read(file.path(), 0), c);
    Coefficients dipole = c;
    dipole.degree = 1;
    const auto low = MagneticCoefficients::read(file.path(), 1);
    EXPECT_EQ(low.degree(), 1);
    compare(low, dipole);
    const Vector3d pole = MagneticCoefficients::read(file.path(), 0).field({0, 0, 7e6}, 2026.0);
    EXPECT_TRUE(pole.allFinite()) << "the pole is a place as any other";
}

TEST(MagneticCoefficients, HaveNoSourcesAndNoCurrents)
{
    const TemporaryFile file("field.COF", Coefficients(12).text());
    const auto model = MagneticCoefficients::read(file.path(), 0);
    const Vector3d r(3e6, -4e6, 4.5e6);
    const double h = 100.0;
    Eigen::Matrix3d slope;
    for (int k = 0; k < 3; k++) {
        const Vector3d step = h * Vector3d::Unit(k);
        slope.col(k) = (model.field(r + step, 2027.0) - model.field(r - step, 2027.0)) / (2 * h);
    }
    EXPECT_LT(std::abs(slope.trace()), 1e-7 * slope.norm());
    EXPECT_LT((slope - slope.transpose()).norm(), 1e-7 * slope.norm());
}

TEST(MagneticCoefficients, OfTheWorldMagneticModelHaveItsPublishedTestValues)
{
    const auto model = MagneticCoefficients::read(FLEDGE_ROOT "/python/fledge/world/magnetic/WMM2025.COF", 0);
    EXPECT_EQ(model.name(), "WMM-2025");
    EXPECT_EQ(model.degree(), 12);
    // Year, altitude [km], latitude, longitude [deg], geodetic; north, east, down [nT].
    const double table[][7] = {
        {2025.0, 0, 80, 0, 6521.6, 145.9, 54791.5},       {2025.0, 0, 0, 120, 39677.8, -109.6, -10580.2},
        {2025.0, 0, -80, 240, 6117.5, 15751.9, -52022.5}, {2025.0, 100, 80, 0, 6216.0, 92.4, 52598.8},
        {2025.0, 100, 0, 120, 37688.6, -96.2, -10152.1},  {2025.0, 100, -80, 240, 5907.6, 14780.3, -49540.7},
        {2027.5, 0, 80, 0, 6500.8, 294.5, 54869.4},       {2027.5, 0, 0, 120, 39701.6, -167.4, -10381.8},
        {2027.5, 0, -80, 240, 6200.7, 15730.3, -51783.7}, {2027.5, 100, 80, 0, 6196.7, 233.8, 52670.5},
        {2027.5, 100, 0, 120, 37711.5, -148.7, -9969.8},  {2027.5, 100, -80, 240, 5984.0, 14760.1, -49317.7}};
    for (const auto &row : table) {
        const double lat = row[2] * deg, lon = row[3] * deg;
        const Vector3d r = Ellipsoid{6378137.0, 6378137.0 * (1 - 1 / 298.257223563)}.point(lat, lon, 1e3 * row[1]);
        const Vector3d found = local(model.field(r, row[0]), pi / 2 - lat, lon); // about the geodetic vertical
        EXPECT_LT((found - Vector3d(row[4], row[5], row[6])).cwiseAbs().maxCoeff(), 0.06)
            << row[2] << " " << row[3] << ": " << found.transpose();
    }
}

TEST(MagneticCoefficients, ADamagedFileIsRefusedWithItsLine)
{
    const std::string good = Coefficients(2).text(), name = "field.COF";
    const auto error = [&](const std::string &text) {
        const TemporaryFile file(name, text);
        return error_of([&] { MagneticCoefficients::read(file.path(), 0); });
    };
    EXPECT_EQ(error(good), "");
    EXPECT_THAT(error(""), HasSubstr(":1: expected the header of a .COF file: epoch in years, name, date"));
    EXPECT_THAT(error("soon WMM"), HasSubstr(":1: expected the header"));
    EXPECT_THAT(error(Coefficients(2).text("")),
                HasSubstr(":7: the file ends before its line of nines; next would be degree and order 3 0"));
    EXPECT_THAT(error(good.substr(0, good.find("2  1")) + "99999999999999\n"),
                HasSubstr(":5: the coefficients end within a degree; next would be degree and order 2 1"));
    std::string wrong = good;
    wrong.replace(wrong.find("2  1"), 4, "2  2");
    EXPECT_THAT(error(wrong), HasSubstr(":5: expected degree and order 2 1, then g, h and their rates a year"));
    wrong = good;
    wrong.insert(wrong.find("2  1") + 6, "x");
    EXPECT_THAT(error(wrong), HasSubstr(":5: expected degree and order 2 1"));
    EXPECT_THAT(error_of([] { MagneticCoefficients::read("nope.COF", 0); }), HasSubstr("nope.COF: cannot be opened"));
    const TemporaryFile file(name, good);
    EXPECT_THAT(error_of([&] { MagneticCoefficients::read(file.path(), 3); }),
                HasSubstr("has the degrees 1 to 2; asked for 3"));
}

struct Field : ::testing::Test {
    Magnetism i{};
    MagnetismModel model{i};

    Field() { model.set_body({.name = "EARTH", .mu = 3.986e14, .radius = 6378137.0, .naif = 399}); }
    std::string refusal()
    {
        return error_of([&] { model.prepare({"world.field", 1, nullptr}); });
    }
    /// In which only the position of the centre, the Sun, is read.
    static std::shared_ptr<const Sky> sky(const char *date)
    {
        TimeSystem time;
        const Epoch epoch = time.epoch(date);
        return std::make_shared<const Sky>(Ephemeris(), time, epoch, 399);
    }
};

TEST_F(Field, ADipoleIsTwiceAsStrongOverItsPolesAndTurns)
{
    const double tilt = 0.2, M = 7.8e15;
    i.par.dipole_P = vec3(M * std::sin(tilt), 0, -M * std::cos(tilt));
    i.par.spin = 1e-4;
    ASSERT_EQ(refusal(), "");
    const double r = 7e6, t = 5000.0;
    const double angle = 1e-4 * t;
    const Vector3d axis(std::sin(tilt) * std::cos(angle), std::sin(tilt) * std::sin(angle), -std::cos(tilt));
    const Vector3d side = axis.unitOrthogonal();
    EXPECT_LT((model.at(4000 * second, 1000.0, r * axis) - 2 * M / (r * r * r) * axis).norm(), 1e-18);
    EXPECT_LT((model.at(4000 * second, 1000.0, r * side) + M / (r * r * r) * axis).norm(), 1e-18);
    i.in.truth.head.quality = QUALITY_GOOD;
    i.in.truth.r_BN_N = vec(r * side);
    model.reset(0);
    model.update({5000 * second, second});
    EXPECT_LT((Vector3d(view(i.out.field.B_N)) - model.at(5000 * second, 0.0, r * side)).norm(), 1e-20);
    i.in.truth.r_BN_N = {};
    try {
        model.update({5001 * second, second});
        ADD_FAILURE() << "the centre has no field";
    } catch (const sim::RunError &error) {
        EXPECT_THAT(error.what(), HasSubstr("world.field: the field is asked for in the centre of EARTH"));
    }
}

TEST_F(Field, AFilesFieldTurnsWithTheEarthAndChangesWithTheYears)
{
    const Coefficients c(3);
    const TemporaryFile file("field.COF", c.text());
    model.set_coefficients(file.path());
    const auto given = sky("2026-07-02T12:00:00");
    model.set_sky(given);
    ASSERT_EQ(refusal(), "");
    const auto wanted = MagneticCoefficients::read(file.path(), 0);
    const Vector3d r(5e6, -4e6, 3e6);
    // Also within steps, where the model turns the Earth of their beginning, and between whole seconds.
    for (const sim::Ns t : {sim::Ns(0), 40'000 * second, 40'000'000 * second + second / 3}) {
        for (const double tau : {0.0, 0.05, 0.05, 0.1, 60.0}) {
            const Eigen::Matrix3d PN = given->orientation(399).at(given->epoch_at(t), tau).dcm_PN;
            const double year = 2026.5 + (1e-9 * static_cast<double>(t) + tau) / (365.2425 * 86400.0);
            const Vector3d B = PN.transpose() * wanted.field(PN * r, year);
            EXPECT_LT((model.at(t, tau, r) - B).norm(), 3e-9 * B.norm()) << t << " " << tau;
        }
    }
    MagnetismModel clone(i);
    clone.copy_setup(model, [](const sim::Model *other) { return const_cast<sim::Model *>(other); });
    clone.prepare({"world.field", 1, nullptr});
    EXPECT_EQ(clone.at(0, 0.0, r), model.at(0, 0.0, r));
}

TEST_F(Field, InCubesIsWithinItsTolerance)
{
    const TemporaryFile rough("field.COF", Coefficients(12).text());
    model.set_sky(sky("2026-07-02T12:00:00"));
    std::mt19937 random(1);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> share(0.0, 1.0);
    for (const std::string &path :
         {std::string(FLEDGE_ROOT "/python/fledge/world/magnetic/WMM2025.COF"), rough.path()}) {
        model.set_coefficients(path);
        double before = 0.0;
        for (const double tolerance : {1e-9, 1e-11}) {
            i.par.tolerance = tolerance;
            ASSERT_EQ(refusal(), "");
            MagnetismModel clone(i);
            clone.copy_setup(model, [](const sim::Model *other) { return const_cast<sim::Model *>(other); });
            clone.prepare({"world.field", 1, nullptr});
            Magnetism exact_interface{};
            MagnetismModel exact(exact_interface);
            exact.copy_setup(model, [](const sim::Model *other) { return const_cast<sim::Model *>(other); });
            exact.prepare({"world.field", 1, nullptr});
            double worst = 0.0;
            for (int round = 0; round < 300; round++) {
                const Vector3d up = Vector3d(normal(random), normal(random), normal(random)).normalized();
                const Vector3d r = (6.378e6 + 3e5 + 1.7e6 * share(random)) * up;
                const sim::Ns t = static_cast<sim::Ns>(1e5 * share(random)) * second;
                for (const double tau : {0.0, 0.05}) {
                    const Vector3d B = model.at(t, tau, r);
                    worst = std::max(worst, (B - exact.at(t, tau, r)).cwiseAbs().maxCoeff());
                    EXPECT_EQ(clone.at(t, tau, r), B);
                }
            }
            EXPECT_LT(worst, tolerance);
            EXPECT_TRUE(before == 0.0 || worst < 0.1 * before) << worst << " after " << before;
            before = worst;
        }
    }
    i.par.tolerance = 1e-15;
    EXPECT_EQ(refusal(), "world.field.tolerance: expected 0, or at least 1e-14 T; found 1e-15");
    i.par.tolerance = 1e-10;
    model.set_coefficients("");
    i.par.dipole_P = vec3(1, 0, 0);
    EXPECT_EQ(refusal(), "world.field.tolerance: there is no file of coefficients, and a dipole needs none");
}

TEST_F(Field, NamesWhatIsWrong)
{
    EXPECT_EQ(refusal(), "world.field: give a moment, dipole_P, or a model, coefficients=\"WMM2025\"");
    const TemporaryFile file("field.COF", Coefficients(2).text());
    model.set_coefficients(file.path());
    EXPECT_EQ(refusal(), "world.field.sky is missing: the field of " + file.path() +
                             " turns with the Earth and changes with the years");
    model.set_sky(sky("2031-03-02"));
    EXPECT_EQ(refusal(), "world.field.coefficients: WMM-TEST holds from 2025.0 to 2030.0; the run begins in 2031.164");
    model.set_sky(sky("2024-12-31"));
    EXPECT_THAT(refusal(), HasSubstr("the run begins in 2024.997"));
    model.set_sky(sky("2029-12-31"));
    EXPECT_EQ(refusal(), "");
    EXPECT_NO_THROW(model.ensure_data_until(3600 * second));
    EXPECT_THAT(error_of([&] { model.ensure_data_until(20 * 86400 * second); }),
                HasSubstr("world.field.coefficients: WMM-TEST holds from 2025.0 to 2030.0; the run ends in 2030.052"));
    i.par.degree = 3;
    EXPECT_THAT(refusal(),
                HasSubstr("world.field.coefficients: " + file.path() + ": has the degrees 1 to 2; asked for 3"));
    i.par.degree = 0;
    i.par.dipole_P = vec3(1, 0, 0);
    EXPECT_EQ(refusal(), "world.field.dipole_P: the file " + file.path() + " has the dipole already");
}

} // namespace magnetism_model_test
} // namespace fledge::world
