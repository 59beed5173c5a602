// SPDX-License-Identifier: Apache-2.0
// Against the published values of the World Magnetic Model, sums in spherical coordinates, and the laws of the field.
#include "flight/testing/derivative.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/navigation/field_coefficients.h"
#include "flight/navigation/field_on_board.h"
}

namespace flight::testing {
namespace field_on_board_test {

constexpr double a = 6371.2e3, deg = pi / 180;

UtcTime at_year(double year)
{
    return {good(), std::llround((9131.5 + (year - 2025) * 365.25) * 86400e9)};
}

FieldOnBoard model(FieldModel which, std::uint32_t degree = 0, double year = 2026.3)
{
    FieldOnBoard m{};
    m.par.model = which;
    m.par.degree = degree;
    m.in.orbit.head = good();
    m.in.time = at_year(year);
    m.in.earth = {good(), mat_identity(), {}};
    return m;
}

/// [nT] N components, which are those of the Earth here unless it is turned.
Vector3d field(FieldOnBoard &m, const Vector3d &r)
{
    m.in.orbit.r_BN_N = vec(r);
    field_on_board_update(&m, {0, 1});
    return 1e9 * eigen(m.out.field.B_N);
}

/// P_nm of Schmidt by Rodrigues' formula, term by term, without and with the derivative by the colatitude.
std::pair<double, double> schmidt(int n, int m, double colatitude)
{
    const long double x = std::cos(static_cast<long double>(colatitude)), s = std::sqrt(1 - x * x);
    const auto fact = [](int k) { return std::tgamma(static_cast<long double>(k) + 1); };
    long double sum = 0, slope = 0;
    for (int k = 0; 2 * k <= n - m; k++) {
        const int power = n - m - 2 * k;
        const long double c = (k % 2 ? -1 : 1) * fact(2 * n - 2 * k) / (fact(k) * fact(n - k) * fact(power));
        sum += c * std::pow(x, power);
        slope += power > 0 ? c * power * std::pow(x, power - 1) : 0;
    }
    const long double norm = (m == 0 ? 1 : std::sqrt(2 * fact(n - m) / fact(n + m))) / std::pow(2.0L, n);
    const long double P = norm * std::pow(s, m) * sum;
    const long double dP = norm * ((m ? m * std::pow(s, m - 1) * x * sum : 0) - std::pow(s, m + 1) * slope);
    return {static_cast<double>(P), static_cast<double>(dP)};
}

/// The axes north, east, down at a place.
Matrix3d local(double colatitude, double longitude)
{
    Matrix3d axes;
    axes.row(1) = Vector3d(-std::sin(longitude), std::cos(longitude), 0);
    axes.row(2) = -Vector3d(std::sin(colatitude) * std::cos(longitude), std::sin(colatitude) * std::sin(longitude),
                            std::cos(colatitude));
    axes.row(0) = axes.row(1).cross(axes.row(2));
    return axes;
}

/// [nT] North, east, down, by the textbook's sum.
Vector3d by_angles(const double (*rows)[4], int degree, double years, double r, double colatitude, double longitude)
{
    Vector3d B(0, 0, 0);
    for (int n = 1; n <= degree; n++) {
        for (int m = 0; m <= n; m++) {
            const double *row = rows[n * (n + 1) / 2 - 1 + m];
            const double g = row[0] + years * row[2], h = row[1] + years * row[3];
            const auto [P, dP] = schmidt(n, m, colatitude);
            const double C = std::cos(m * longitude), S = std::sin(m * longitude);
            B += std::pow(a / r, n + 2) * Vector3d((g * C + h * S) * dP, m * (g * S - h * C) * P / std::sin(colatitude),
                                                   -(n + 1) * (g * C + h * S) * P);
        }
    }
    return B;
}

TEST(FieldOnBoard, of_any_degree_is_the_sum_by_angles)
{
    Random random{1};
    for (int i = 0; i < runs(400); i++) {
        const bool wmm = i % 2;
        const int most = wmm ? 12 : 13, degree = i < 26 ? 1 + i % most : 1 + random.below(most);
        FieldOnBoard m = model(wmm ? FIELD_WMM : FIELD_IGRF, static_cast<std::uint32_t>(degree));
        const double r = random.real(6.3e6, 9e6), colatitude = random.real(0.02, pi - 0.02);
        const double longitude = random.real(-pi, pi), years = random.real(0, 4.99);
        m.in.time = at_year(2025 + years);
        const Matrix3d axes = local(colatitude, longitude), turned = random.attitude();
        m.in.earth.dcm_PN = mat(turned);
        const Vector3d B = field(m, -r * turned.transpose() * axes.row(2).transpose());
        const Vector3d sum = by_angles(wmm ? field_wmm : field_igrf, degree, years, r, colatitude, longitude);
        EXPECT_LT((axes * turned * B - sum).norm(), 1e-7) << degree << " " << colatitude;
        EXPECT_EQ(m.out.field.head.quality, QUALITY_GOOD);
    }
}

TEST(FieldOnBoard, has_the_published_values_of_the_world_magnetic_model)
{
    // Year, altitude [km], latitude, longitude [deg], geodetic; north, east, down [nT]: the model's technical report.
    const double table[][7] = {
        {2025.0, 0, 80, 0, 6521.6, 145.9, 54791.5},       {2025.0, 0, 0, 120, 39677.8, -109.6, -10580.2},
        {2025.0, 0, -80, 240, 6117.5, 15751.9, -52022.5}, {2025.0, 100, 80, 0, 6216.0, 92.4, 52598.8},
        {2025.0, 100, 0, 120, 37688.6, -96.2, -10152.1},  {2025.0, 100, -80, 240, 5907.6, 14780.3, -49540.7},
        {2027.5, 0, 80, 0, 6500.8, 294.5, 54869.4},       {2027.5, 0, 0, 120, 39701.6, -167.4, -10381.8},
        {2027.5, 0, -80, 240, 6200.7, 15730.3, -51783.7}, {2027.5, 100, 80, 0, 6196.7, 233.8, 52670.5},
        {2027.5, 100, 0, 120, 37711.5, -148.7, -9969.8},  {2027.5, 100, -80, 240, 5984.0, 14760.1, -49317.7}};
    for (const auto &row : table) {
        FieldOnBoard m = model(FIELD_WMM, 0, row[0]);
        const double latitude = row[2] * deg, longitude = row[3] * deg, e2 = (2 - 1 / 298.257223563) / 298.257223563;
        const double N = 6378137.0 / std::sqrt(1 - e2 * std::pow(std::sin(latitude), 2)), h = 1e3 * row[1];
        const Vector3d r((N + h) * std::cos(latitude) * std::cos(longitude),
                         (N + h) * std::cos(latitude) * std::sin(longitude), (N * (1 - e2) + h) * std::sin(latitude));
        const Vector3d B = local(pi / 2 - latitude, longitude) * field(m, r);
        EXPECT_LT((B - Vector3d(row[4], row[5], row[6])).cwiseAbs().maxCoeff(), 0.06) << row[2] << " " << row[3];
    }
}

TEST(FieldOnBoard, both_models_agree_and_a_lower_degree_leaves_a_little_out)
{
    // Sums of n 14 + m times g, h, dg, dh in IAGA's other file, IGRF14.shc.
    double sums[4] = {-246787.10, -47605.70, -1302.70, -1048.20};
    for (int n = 1, i = 0; n <= 13; n++) {
        for (int order = 0; order <= n; order++, i++) {
            for (int k = 0; k < 4; k++) {
                sums[k] -= field_igrf[i][k] * (14 * n + order);
            }
        }
    }
    EXPECT_NEAR(sums[0], 0, 1e-6);
    EXPECT_NEAR(sums[1], 0, 1e-6);
    EXPECT_NEAR(sums[2], 0, 20.0); // that file has the field of 2030 in tenths
    EXPECT_NEAR(sums[3], 0, 20.0);

    Random random{2};
    double worst[14] = {}, models = 0;
    for (int i = 0; i < 500; i++) {
        const Vector3d r = 6.871e6 * random.direction();
        FieldOnBoard igrf = model(FIELD_IGRF), wmm = model(FIELD_WMM);
        const Vector3d whole = field(igrf, r);
        EXPECT_TRUE(whole.norm() > 15e3 && whole.norm() < 55e3);
        models = std::max(models, (whole - field(wmm, r)).norm());
        for (std::uint32_t degree = 1; degree < 14; degree++) {
            FieldOnBoard lower = model(FIELD_IGRF, degree);
            worst[degree] = std::max(worst[degree], (whole - field(lower, r)).norm());
        }
        FieldOnBoard dipole = model(FIELD_DIPOLE, 8), first = model(FIELD_IGRF, 1);
        EXPECT_EQ(field(dipole, r), field(first, r));
    }
    EXPECT_LT(models, 30.0);
    EXPECT_LT(worst[8], 200.0);
    EXPECT_EQ(worst[13], 0.0);
    for (int degree = 2; degree < 14; degree++) {
        EXPECT_LT(worst[degree], worst[degree - 1]);
        RecordProperty("worst_" + std::to_string(degree), std::to_string(worst[degree]));
    }
}

TEST(FieldOnBoard, the_dipole_is_that_of_a_magnet)
{
    const double year = 2028, *g10 = field_igrf[0], *g11 = field_igrf[1];
    const Vector3d m = (a * a * a) * Vector3d(g11[0] + 3 * g11[2], g11[1] + 3 * g11[3], g10[0] + 3 * g10[2]);
    Random random{3};
    for (int i = 0; i < 200; i++) {
        const Vector3d u = random.direction();
        const double r = random.real(6.4e6, 4e8);
        FieldOnBoard module = model(FIELD_DIPOLE, 0, year);
        const Vector3d B = (3 * m.dot(u) * u - m) / (r * r * r);
        EXPECT_LT((field(module, r * u) - B).norm(), 1e-13 * m.norm() / (r * r * r));
    }
}

TEST(FieldOnBoard, has_no_sources_and_no_currents_and_no_singular_pole)
{
    Random random{4};
    for (int i = 0; i < 60; i++) {
        FieldOnBoard m = model(i % 2 ? FIELD_WMM : FIELD_IGRF);
        const Vector3d r = 6.8e6 * (i < 4 ? Vector3d(i < 2 ? 0 : 1e-9, 0, i % 2 ? 1 : -1) : random.direction());
        Matrix3d slope;
        for (int k = 0; k < 3; k++) {
            const auto moved = [&](double h) -> Vector3d { return field(m, r + h * Vector3d::Unit(k)); };
            slope.col(k) = derivative<Vector3d, 3>(moved, 2000.0);
        }
        EXPECT_LT(std::abs(slope.trace()), 1e-9 * slope.norm());
        EXPECT_LT((slope - slope.transpose()).norm(), 1e-9 * slope.norm());
    }
}

TEST(FieldOnBoard, says_what_it_does_not_know)
{
    const auto update = [](FieldOnBoard &m) { field_on_board_update(&m, {9, 1}); };
    FieldOnBoard m = model(FIELD_IGRF, 13);
    m.in.orbit.r_BN_N = vec3(1e6, -4e6, 5.5e6);
    for (const auto head : {&m.in.orbit.head, &m.in.time.head, &m.in.earth.head}) {
        head->quality = QUALITY_NONE;
        update(m);
        EXPECT_TRUE(all_zero(m.out));
        head->quality = QUALITY_GOOD;
    }
    update(m);
    expect_held(m, doubles(m.in.orbit.r_BN_N, m.in.earth.dcm_PN), update,
                [](FieldOnBoard &module) { return std::vector{&module.out.field.head}; });
    for (const auto head : {&m.in.orbit.head, &m.in.time.head, &m.in.earth.head}) {
        head->quality = QUALITY_STALE;
        update(m);
        EXPECT_EQ(std::exchange(head->quality, QUALITY_GOOD), QUALITY_STALE);
        EXPECT_EQ(m.out.field.head.quality, QUALITY_DEGRADED);
    }
    for (const auto &[year, end, quality] : {std::tuple{2024.99, 2025.0, QUALITY_DEGRADED},
                                             {2025.0, 2025.0, QUALITY_GOOD},
                                             {2029.99, 2029.99, QUALITY_GOOD},
                                             {2030.1, 2030.0 - 0.25 / 365.25, QUALITY_DEGRADED},
                                             {2290.0, 2030.0 - 0.25 / 365.25, QUALITY_DEGRADED}}) {
        FieldOnBoard then = model(FIELD_IGRF, 0, year), nearest = model(FIELD_IGRF, 0, end);
        EXPECT_LT((field(then, {7e6, 0, 0}) - field(nearest, {7e6, 0, 0})).norm(), 1e-3) << year;
        EXPECT_EQ(then.out.field.head.quality, quality) << year;
    }
    const std::uint32_t written = m.out.field.head.sequence;
    m.in.orbit.r_BN_N = vec3(5.9e6, 0, 0); // in the ground
    update(m);
    m.in.orbit.r_BN_N = vec3(7e6, 0, 0);
    m.par.model = static_cast<FieldModel>(3);
    update(m);
    EXPECT_EQ(m.out.field.head.sequence, written);
    m.par = {FIELD_WMM, 0xffffffffU};
    update(m);
    EXPECT_EQ(m.out.field.head.sequence, written + 1);
}

} // namespace field_on_board_test
} // namespace flight::testing
