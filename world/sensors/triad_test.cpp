// SPDX-License-Identifier: Apache-2.0
// Gyros, accelerometers and magnetometers: what they measure, and the errors that they share.
#include "world/sensors/accelerometer_model.h"
#include "world/sensors/gyro_model.h"
#include "world/sensors/magnetometer_model.h"
#include "world/testing/sensing.h"

#include <cstring>
#include <numbers>

namespace triad_test {

using namespace fledge;
using namespace fledge::world;
using namespace fledge::world::testing;

using GyroBench = Bench<Gyro, GyroModel>;

bool same(const Vec3 &a, const Vec3 &b)
{
    return std::memcmp(&a, &b, sizeof a) == 0;
}

TEST(Triad, WithoutErrorsTheyGiveTheTruth)
{
    GyroBench g;
    g.begin();
    g.i.in.truth.omega_BN_B = vec3(0.1, -0.2, 0.3);
    g.step(100 * ms);
    EXPECT_TRUE(same(g.i.out.rate.omega_BN_B, g.i.in.truth.omega_BN_B));
    EXPECT_EQ(g.i.out.rate.head.t, 100 * ms);
    EXPECT_EQ(g.i.out.rate.head.quality, QUALITY_GOOD);
    g.i.in.truth.head.quality = QUALITY_STALE;
    g.step(100 * ms);
    EXPECT_EQ(g.i.out.rate.head.quality, QUALITY_DEGRADED);
    g.i.in.power.head.quality = QUALITY_GOOD;
    const std::uint32_t sequence = g.i.out.rate.head.sequence;
    g.step(100 * ms);
    EXPECT_EQ(g.i.out.rate.head.sequence, sequence) << "its load is off";
    g.i.in.power.on = 1;
    g.step(100 * ms);
    EXPECT_EQ(g.i.out.rate.head.sequence, sequence + 1);
}

TEST(Triad, TheAngleWalksByItsDensityWhateverThePeriodIs)
{
    // The Allan variance of white noise is density / tau, at any averaging time tau.
    const double density = 1e-6;
    for (const Ns dt : {10 * ms, 100 * ms, second}) {
        GyroBench g;
        g.i.par.noise = vec3(density, density, 4 * density);
        g.begin();
        for (const int m : {1, 4, 16}) {
            const double tau = m * tick_seconds(dt);
            Sample allan, allan_z;
            Vec3 last{};
            for (int k = 0; k < 1500; k++) {
                Vec3 mean{};
                for (int j = 0; j < m; j++) {
                    g.step(dt);
                    mean = vec_add(mean, vec_scale(1.0 / m, g.i.out.rate.omega_BN_B));
                }
                if (k % 2) { // pairs that share no reading
                    allan.add((mean.v[0] - last.v[0]) / std::sqrt(2.0));
                    allan_z.add((mean.v[2] - last.v[2]) / std::sqrt(2.0));
                }
                last = mean;
            }
            EXPECT_TRUE(allan.is_normal(density / tau)) << dt << " " << m;
            EXPECT_TRUE(allan_z.is_normal(4 * density / tau)) << dt << " " << m;
        }
    }
}

TEST(Triad, TheBiasWalksByItsDensityWhateverThePeriodIs)
{
    // Over a time T the bias gains a variance of walk T, and its integral one of walk T^3 / 3.
    const double walk = 1e-8, T = 10.0;
    for (const Ns dt : {100 * ms, 500 * ms}) {
        Sample gained, integrated;
        for (std::uint64_t seed = 0; seed < 400; seed++) {
            GyroBench g;
            g.i.par.walk = vec3(walk, walk, walk);
            g.i.par.bias = vec3(1e-3, 1e-3, 1e-3);
            g.begin(seed);
            Vec3 angle{};
            while (g.t < 10 * second) {
                const Vec3 before = g.i.out.rate.omega_BN_B;
                g.step(dt);
                const Vec3 middle = vec_scale(0.5, vec_add(before, g.i.out.rate.omega_BN_B));
                angle = vec_add(angle, vec_scale(tick_seconds(dt), vec_sub(middle, g.i.par.bias)));
            }
            for (int i = 0; i < 3; i++) {
                gained.add(g.i.out.rate.omega_BN_B.v[i] - 1e-3);
                integrated.add(angle.v[i]);
                EXPECT_DOUBLE_EQ(g.i.out.rate.omega_BN_B.v[i], 1e-3 + g.i.mem.walked.v[i]);
            }
        }
        EXPECT_TRUE(gained.is_normal(walk * T)) << dt;
        // The trapezoids of the samples lack the variance h^3 / 12 of the walk within each step.
        const double h = tick_seconds(dt);
        EXPECT_TRUE(integrated.is_normal(walk * (T * T * T / 3.0 - T * h * h / 12.0))) << dt;
    }
}

TEST(Triad, ScaleAndMisalignmentAreThoseOfTheCase)
{
    GyroBench g;
    g.i.par.scale = vec3(1e-2, -2e-2, 3e-2);
    g.i.par.misalignment = vec3(0.1, -0.05, 0.2);
    g.i.par.bias = vec3(1e-3, 2e-3, 3e-3);
    g.begin();
    const Vector3d rate(0.3, -0.4, 0.5);
    g.i.in.truth.omega_BN_B = vec(rate);
    g.step(100 * ms);
    // A turn of the case by a vector takes components to the case by its inverse.
    Vector3d expected = rotation(view(g.i.par.misalignment)).transpose() * rate;
    expected += view(g.i.par.scale).cwiseProduct(expected) + view(g.i.par.bias);
    EXPECT_LT((view(g.i.out.rate.omega_BN_B) - expected).norm(), 1e-15);
}

TEST(Triad, QuantisationRoundsToSteps)
{
    GyroBench g;
    g.i.par.step = 1e-3;
    g.begin();
    Sample errors;
    for (int k = 0; k < 3000; k++) {
        const double rate = 1e-3 * 0.618033988749895 * k; // is spread evenly over a step
        g.i.in.truth.omega_BN_B = vec3(rate, -rate, 0);
        g.step(ms);
        const double read = g.i.out.rate.omega_BN_B.v[0] / 1e-3;
        ASSERT_NEAR(read, std::round(read), 1e-9);
        ASSERT_LE(std::abs(g.i.out.rate.omega_BN_B.v[0] - rate), 0.5e-3 * (1 + 1e-9));
        ASSERT_EQ(g.i.out.rate.omega_BN_B.v[1], -g.i.out.rate.omega_BN_B.v[0]);
        errors.add(g.i.out.rate.omega_BN_B.v[0] - rate);
    }
    EXPECT_NEAR(errors.mean(), 0.0, 1e-6);
    EXPECT_NEAR(errors.variance(), 1e-6 / 12.0, 1e-9);
}

TEST(Triad, SaturationCutsAndCounts)
{
    GyroBench g;
    g.i.par.limit = 0.1;
    g.i.par.step = 0.03;
    g.begin();
    g.i.in.truth.omega_BN_B = vec3(5.0, -5.0, 0.02);
    g.step(ms);
    EXPECT_EQ(g.i.out.rate.omega_BN_B.v[0], 0.1);
    EXPECT_EQ(g.i.out.rate.omega_BN_B.v[1], -0.1);
    EXPECT_NEAR(g.i.out.rate.omega_BN_B.v[2], 0.03, 1e-15);
    EXPECT_EQ(g.i.mem.saturated, 1u);
    g.i.in.truth.omega_BN_B = vec3(0.05, -0.05, 0);
    g.step(ms);
    EXPECT_EQ(g.i.mem.saturated, 1u);
}

TEST(Triad, AFaultOfOneAxisLeavesTheOthersAndTheNoiseAsTheyWere)
{
    const auto begun = [](bool faulty) {
        GyroBench g;
        g.i.par.noise = vec3(1e-4, 1e-4, 1e-4);
        g.i.par.limit = 2.0;
        if (faulty) {
            g.fault(FAULT_BABBLE, 1);
            g.fault(FAULT_BIAS, 2, 0.5);
        }
        g.begin();
        return g;
    };
    GyroBench sound = begun(false), faulty = begun(true);
    for (int k = 0; k < 100; k++) {
        sound.step(100 * ms);
        faulty.step(100 * ms);
        const Vec3 &a = sound.i.out.rate.omega_BN_B, &b = faulty.i.out.rate.omega_BN_B;
        EXPECT_NE(a.v[0], b.v[0]);
        EXPECT_NEAR(b.v[1] - a.v[1], 0.5, 1e-15);
        EXPECT_EQ(a.v[2], b.v[2]);
    }
}

TEST(Triad, ADeadSensorWritesNothing)
{
    GyroBench g;
    g.begin();
    g.step(second);
    g.i.in.injected.head.quality = QUALITY_GOOD;
    g.i.in.injected.n = 1;
    g.i.in.injected.list[0] = {FAULT_DEAD, 0, 0.0, 0, 0};
    g.i.in.truth.omega_BN_B = vec3(1, 2, 3);
    g.step(second);
    EXPECT_EQ(g.i.out.rate.head.t, second);
    EXPECT_EQ(g.i.out.rate.head.quality, QUALITY_DEGRADED);
    EXPECT_EQ(g.i.out.rate.omega_BN_B.v[0], 0.0) << "what it wrote last";
    g.i.in.injected.list[0].channels = 3; // but if one axis lives
    g.step(second);
    EXPECT_EQ(g.i.out.rate.head.quality, QUALITY_GOOD);
    EXPECT_TRUE(same(g.i.out.rate.omega_BN_B, vec3(0, 0, 3)));
}

TEST(Triad, ItRefusesFaultsThatItCannotHave)
{
    GyroBench g;
    g.fault(FAULT_HIGH, 1);
    EXPECT_NE(error_of([&] { g.begin(); }).find("world.sensor.faults[0].size: not every channel has limits"),
              std::string::npos);
    g.i.par.limit = 1.0;
    EXPECT_NO_THROW(g.begin());
    g.i.par.faults[0].channels = 8;
    EXPECT_NE(error_of([&] { g.model.refresh(); }).find("world.sensor.faults[0].channels"), std::string::npos);
}

TEST(Accelerometer, FeelsAllButGravity)
{
    // A craft that flies, turns and is pushed, against derivatives of the place of the sensor by finite differences,
    // and their mean over a step by a rule of the fifth order. A mean in the axes of a step's ends is off by a twelfth
    // of the square of its turn, and as much once more, for the force turns with it, and a little for the rate changes.
    Flyer f;
    f.set_inertia(Vector3d(50.0, 60.0, 80.0).asDiagonal());
    f.craft_interface.par.mass = 100.0;
    f.craft_interface.par.r_BN_N = vec3(7e6, 0, 0);
    f.craft_interface.par.v_BN_N = vec3(0, 7500, 300);
    f.craft_interface.par.omega_BN_B = vec3(0.3, -0.2, 0.4);
    GravityBody earth;
    earth.name = "earth";
    earth.mu = 3.986004415e14;
    f.craft.add_gravity(earth);
    f.prepare();
    f.push().force_B = vec3(30, -20, 10);
    f.push().torque_B = vec3(3, 2, -1);

    Bench<Accelerometer, AccelerometerModel> a;
    a.i.par.r_AB_B = vec3(0.5, -0.3, 0.8);
    a.begin();
    const Ns dt = 10 * ms;
    const double h = tick_seconds(dt);
    std::vector<Vector3d> place, gravity, read, felt;
    std::vector<Matrix3d> dcm;
    std::vector<double> rate;
    for (int k = 0; k < 200; k++) {
        f.step(dt);
        a.i.in.truth = f.state();
        a.step(dt);
        dcm.push_back(f.dcm_BN());
        place.push_back(dcm.back().transpose() * view(a.i.par.r_AB_B));
        gravity.push_back(-earth.mu / std::pow(f.r().norm(), 3) * f.r());
        EXPECT_LT((view(f.state().g_CN_N) - gravity.back()).norm(), 1e-12);
        read.push_back(view(a.i.out.force.f_B));
        rate.push_back(view(f.state().omega_BN_B).norm());
    }
    felt.resize(place.size());
    for (std::size_t k = 2; k + 2 < place.size(); k++) {
        const Vector3d turning =
            (-place[k + 2] + 16 * place[k + 1] - 30 * place[k] + 16 * place[k - 1] - place[k - 2]) / (12 * h * h);
        felt[k] = Vector3d(0.3, -0.2, 0.1) + dcm[k] * turning;
    }
    Vector3d sum = h * (read[0] + read[1] + read[2] + read[3]);
    for (std::size_t k = 4; k + 3 < place.size(); k++) {
        const Vector3d mean = (-felt[k - 2] + 13 * felt[k - 1] + 13 * felt[k] - felt[k + 1]) / 24;
        const double turn = h * rate[k], error = turn * turn / 12 * mean.norm();
        ASSERT_LT((read[k] - mean).norm(), 2.5 * error + 1e-8);
        sum += h * mean;
    }
    for (std::size_t k = place.size() - 3; k < place.size(); k++) {
        sum += h * read[k];
    }
    EXPECT_LT((view(a.i.out.force.dv_B) - sum).norm(), 200 * h * 3e-6) << "nothing is lost between updates";

    // Nothing pushes a craft in free fall, and a sensor at its centre feels nothing.
    f.push() = {};
    a.i.par.r_AB_B = {};
    f.step(dt);
    a.i.in.truth = f.state();
    a.step(dt);
    EXPECT_LT(view(a.i.out.force.f_B).norm(), 1e-9) << "but for the digits of its velocity";
}

TEST(Accelerometer, CountsAPulseThatIsOverBeforeItIsRead)
{
    // 20 ms of 0.5 m/s^2 in a step of 100 ms, in a body that lies turned; then a silence, which is not counted.
    Bench<Accelerometer, AccelerometerModel> a;
    a.i.par.bias = vec3(0, 0, 1e-3);
    a.i.in.truth.sigma_BN = vec3(0, 0, std::tan(std::numbers::pi / 8)); // b1 along n2
    a.begin();
    a.i.in.truth.v_BN_N = vec3(0, 0.01, 0);
    a.step(100 * ms);
    EXPECT_NEAR(a.i.out.force.f_B.v[0], 0.1, 1e-12);
    EXPECT_NEAR(a.i.out.force.dv_B.v[0], 0.01, 1e-12);
    a.step(100 * ms);
    EXPECT_NEAR(a.i.out.force.f_B.v[0], 0, 1e-12);
    EXPECT_NEAR(a.i.out.force.dv_B.v[0], 0.01, 1e-12);
    EXPECT_NEAR(a.i.out.force.dv_B.v[2], 2e-4, 1e-12) << "errors add up as they do in f_B";
    a.i.in.power.head = {0, QUALITY_GOOD, 1};
    a.i.in.truth.v_BN_N = vec3(0, 0.05, 0);
    a.step(100 * ms);
    a.i.in.power.on = 1;
    a.step(100 * ms);
    EXPECT_NEAR(a.i.out.force.dv_B.v[0], 0.01, 1e-12);
}

TEST(Magnetometer, ReadsTheFieldInItsBodyAndThatOfTheCraft)
{
    Bench<Magnetometer, MagnetometerModel> m;
    m.i.par.residual_B = vec3(1e-7, 2e-7, 3e-7);
    m.begin();
    m.i.in.field.head.quality = QUALITY_GOOD;
    m.i.in.field.B_N = vec3(2e-5, -3e-5, 4e-5);
    m.i.in.truth.sigma_BN = vec3(0.2, -0.3, 0.4);
    m.step(second);
    const Mat3 C_BN = mrp_to_dcm(m.i.in.truth.sigma_BN);
    const Vector3d expected = view(C_BN) * view(m.i.in.field.B_N) + view(m.i.par.residual_B);
    EXPECT_LT((view(m.i.out.measured.B_B) - expected).norm(), 1e-19);
    m.i.in.field.head.quality = QUALITY_STALE;
    m.step(second);
    EXPECT_EQ(m.i.out.measured.head.quality, QUALITY_DEGRADED);
}

} // namespace triad_test
