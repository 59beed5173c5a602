// SPDX-License-Identifier: Apache-2.0
// The theories of flight against the truth of the world: JPL's DE405, the Earth as ERFA and the IERS have it,
// shadows of spheres, and the file of the World Magnetic Model.
#include "flight/testing/eigen.h"
#include "world/environment/earth_rotation.h"
#include "world/environment/ephemeris.h"
#include "world/environment/magnetic_coefficients.h"
#include "world/environment/shadow.h"
#include "world/environment/testing/files.h"

extern "C" {
#include "flight/navigation/earth_on_board.h"
#include "flight/navigation/earth_orientation.h"
#include "flight/navigation/eclipse_on_board.h"
#include "flight/navigation/field_on_board.h"
#include "flight/navigation/moon_on_board.h"
#include "flight/navigation/sun_on_board.h"
}

namespace on_board_test {

using namespace flight::testing;
using fledge::world::EarthData;
using fledge::world::EarthRotation;
using fledge::world::Ephemeris;
using fledge::world::Epoch;
using fledge::world::TimeSystem;

constexpr double arcsec = pi / 648000;
const TimeSystem &time_system()
{
    static const TimeSystem time;
    return time;
}

/// An instant of these years, and flight's time of it.
struct Instant {
    Epoch epoch;
    UtcTime utc;

    Instant(Random &random, double first, double last)
    {
        epoch.ns = std::llround((random.real(first, last) - 2000) * 365.25 * 86400e9);
        const auto leaps = static_cast<std::int64_t>(time_system().tai_minus_utc(epoch));
        utc = {good(), time_system().tai(epoch) - leaps * 1'000'000'000};
    }
};

template <class Module> Module updated(UpdateOf<Module> update, const UtcTime &time)
{
    Module m{};
    m.in.time = time;
    update(&m, {0, 0});
    return m;
}

TEST(OnBoard, sun_and_moon_are_where_DE405_has_them)
{
    SKIP_WITHOUT(std::string(Ephemeris::de405_folder));
    Ephemeris jpl;
    jpl.add_de405();
    double sun_angle = 0, sun_off = 0, moon_angle = 0, moon_off = 0;
    Random random{1};
    for (int i = 0; i < runs(4000); i++) {
        const Instant now(random, 2000.01, 2049.99);
        const auto compare = [&](int body, const BodyState &computed, double &angle, double &off) {
            const Vector3d r = jpl.state(body, 399, now.epoch).r, s = eigen(computed.r_PN_N);
            angle = std::max(angle, (r.normalized() - s.normalized()).norm());
            off = std::max(off, std::abs(r.norm() - s.norm()));
        };
        compare(10, updated<SunOnBoard>(sun_on_board_update, now.utc).out.sun, sun_angle, sun_off);
        compare(301, updated<MoonOnBoard>(moon_on_board_update, now.utc).out.moon, moon_angle, moon_off);
    }
    RecordProperty("sun_arcsec", std::to_string(sun_angle / arcsec));
    RecordProperty("sun_km", std::to_string(sun_off / 1e3));
    RecordProperty("moon_deg", std::to_string(moon_angle * 180 / pi));
    RecordProperty("moon_km", std::to_string(moon_off / 1e3));
    EXPECT_LT(sun_angle, 9 * arcsec);
    EXPECT_LT(sun_off, 3e6);
    EXPECT_LT(moon_angle, 0.036 * pi / 180);
    EXPECT_LT(moon_off, 85e3);
}

TEST(OnBoard, the_earth_is_turned_as_the_world_turns_it)
{
    const auto angle = [](const Mat3 &a, const fledge::world::BodyAttitude &b) {
        return (eigen(a) - b.dcm_PN).norm() / std::sqrt(2.0) / arcsec;
    };
    Random random{2};
    double theory = 0, rate = 0;
    for (int i = 0; i < runs(200); i++) {
        const Instant now(random, 2000.01, 2049.99);
        EarthData data;
        data.theory = EarthData::Theory::iau1980;
        data.ut1_tai = -time_system().tai_minus_utc(now.epoch);
        EarthRotation::Window window;
        const auto truth = EarthRotation(data, time_system()).at(now.epoch, 0.0, window);
        const PlanetAttitude earth = updated<EarthOnBoard>(earth_on_board_update, now.utc).out.earth;
        theory = std::max(theory, angle(earth.dcm_PN, truth));
        rate = std::max(rate, (truth.dcm_PN * eigen(earth.omega_PN_N) - truth.omega_PN_P).norm());
    }
    EXPECT_LT(theory, 0.03);
    EXPECT_LT(rate, 1e-11);
    RecordProperty("theory_arcsec", std::to_string(theory));

    EarthData data;
    data.eop = fledge::world::testing::real_file("eopc04-2000-2020.txt");
    SKIP_WITHOUT(*data.eop);
    const EarthRotation measured(data, time_system());
    EarthRotation::Window window;
    double worst = 0, sum = 0;
    const int n = runs(600);
    for (int i = 0; i < n; i++) {
        const Instant now(random, 2000.01, 2020.98);
        EarthOnBoard m{};
        m.in.time = now.utc;
        m.par.dut1 = measured.measured(now.epoch).ut1_tai + time_system().tai_minus_utc(now.epoch);
        earth_on_board_update(&m, {0, 0});
        const double off = angle(m.out.earth.dcm_PN, measured.at(now.epoch, 0.0, window));
        worst = std::max(worst, off);
        sum += off / n;
    }
    RecordProperty("measured_arcsec", std::to_string(worst) + ", on average " + std::to_string(sum));
    EXPECT_LT(worst, 0.8);
}

TEST(OnBoard, the_shadow_is_the_worlds)
{
    const double R = 6378137.0, Rs = 695700e3, AU = 149597870700.0;
    Random random{3};
    int parts = 0;
    for (int i = 0; i < runs(20000); i++) {
        const Vector3d sun = AU * random.direction(), axis = -sun.normalized();
        const double along = R * std::pow(10.0, random.real(-1, 2.6));
        const double off = i % 4 ? R + random.real(-1.2, 1.2) * along * Rs / AU : random.real(0, 2) * R;
        const Vector3d r = along * axis + off * axis.cross(random.direction()).normalized();
        if (r.norm() < 1.001 * R) {
            continue;
        }
        EclipseOnBoard m{};
        m.par.radius = R;
        m.in.sun = {good(), vec(sun), {}, {}};
        m.in.orbit = {good(), vec(r), {}, {}};
        eclipse_on_board_update(&m, {0, 0});
        const double lit = 1.0 - fledge::world::hidden_share(r - sun, Rs, r, R);
        ASSERT_NEAR(m.out.shadow.lit, lit, 1e-7) << along << " " << off;
        if (lit > 1e-6 && lit < 1 - 1e-6) {
            ASSERT_EQ(m.out.shadow.phase, SHADOW_PENUMBRA);
            parts++;
        }
    }
    EXPECT_GT(parts, runs(5000));
}

TEST(OnBoard, the_field_is_that_of_the_file)
{
    Random random{4};
    for (const FieldModel which : {FIELD_IGRF, FIELD_WMM}) {
        const std::string name = which == FIELD_IGRF ? "IGRF-14" : "WMM2025";
        for (const int degree : {1, 4, 8, 12, which == FIELD_IGRF ? 13 : 12}) {
            const auto file = fledge::world::MagneticCoefficients::read(
                FLEDGE_ROOT "/python/fledge/world/magnetic/" + name + ".COF", degree);
            for (int i = 0; i < runs(500); i++) {
                const double years = random.real(0, 4.99);
                const Vector3d r = random.real(6.4e6, 5e7) * random.direction();
                FieldOnBoard m{};
                m.par.model = which;
                m.par.degree = static_cast<std::uint32_t>(degree);
                m.in.time = {good(), std::llround((9131.5 + years * 365.25) * 86400e9)};
                m.in.orbit = {good(), vec(r), {}, {}};
                m.in.earth = {good(), mat_identity(), {}};
                field_on_board_update(&m, {0, 0});
                EXPECT_LT((eigen(m.out.field.B_N) - file.field(r, 2025 + years)).norm(), 1e-16) << degree; // 1e-7 nT
            }
        }
    }
}

} // namespace on_board_test
