// SPDX-License-Identifier: Apache-2.0
#include "world/dynamics/drag_model.h"

#include "world/dynamics/orbit.h"
#include "world/environment/atmosphere_model.h"
#include "world/testing/bodies.h"

#include <gtest/gtest.h>

#include <numbers>
#include <random>

namespace drag_model_test {

using namespace fledge;
using namespace fledge::world;
using namespace fledge::world::testing;

constexpr double mu = 3.986004415e14, pi = std::numbers::pi;

struct Craft {
    Flyer f;
    Atmosphere air_interface{};
    AtmosphereModel air{air_interface};
    Drag drag_interface{};
    DragModel drag{drag_interface};

    Craft()
    {
        GravityBody body{.name = "EARTH", .mu = mu, .radius = 6378137.0};
        air.set_body(body);
        air_interface.par.density = 1e-12;
        drag_interface.par.Cd = 2.2;
        drag_interface.par.area = 3.0;
        f.craft.add_gravity(body);
        f.set_inertia(Vector3d(500.0, 700.0, 900.0).asDiagonal());
        f.craft_interface.par.mass = 100.0;
        f.craft_interface.par.r_BN_N = vec3(7e6, 0, 0);
        f.craft_interface.par.v_BN_N = vec3(0, 7000, 1000);
        drag.set_source(air);
        f.craft.attach(drag);
    }
    void prepare()
    {
        drag.prepare({"world.drag", 1, f.method.get()}); // before its source
        air.prepare({"world.air", 1, f.method.get()});
        f.prepare();
    }
    Vector3d force() const { return view(drag_interface.out.load.force_B); }
    Vector3d torque() const { return view(drag_interface.out.load.torque_B); }
};

TEST(Drag, ASphereFeelsTheWindOfTheTurningAir)
{
    std::mt19937 random(1);
    std::normal_distribution<double> normal;
    const auto any = [&](double scale) -> Vector3d {
        return scale * Vector3d(normal(random), normal(random), normal(random));
    };
    for (int round = 0; round < 100; round++) {
        Craft c;
        c.air_interface.par.spin = 1e-4 * normal(random);
        const Vector3d r = 7e6 * any(1).normalized(), v = any(5000), sigma = any(0.2), centre = any(1);
        c.f.craft_interface.par.r_BN_N = vec(r);
        c.f.craft_interface.par.v_BN_N = vec(v);
        c.f.craft_interface.par.sigma_BN = vec(sigma);
        c.drag_interface.par.centre_B = vec(centre);
        c.prepare();
        const Vector3d wind = v - Vector3d(0, 0, c.air_interface.par.spin).cross(r);
        const Vector3d F_N = -0.5 * 1e-12 * 2.2 * 3.0 * wind.norm() * wind;
        EXPECT_LT((c.f.dcm_BN().transpose() * c.force() - F_N).norm(), 1e-14 * F_N.norm());
        EXPECT_LT((c.torque() - centre.cross(c.force())).norm(), 1e-14 * F_N.norm());
        // It is what the craft felt, besides gravity.
        const Vector3d a = view(c.f.state().a_BN_N);
        EXPECT_LT((a + mu / std::pow(r.norm(), 3) * r - F_N / 100.0).norm(), 1e-14);
        const Vector3d domega = view(c.f.state().domega_BN_B);
        EXPECT_LT((c.f.inertia() * domega - c.torque()).norm(), 1e-14 * F_N.norm());
    }
}

/// Six facets of a box of these sides about a centre.
void make_box(Drag &drag, const Vector3d &sides, const Vector3d &centre)
{
    drag.par.n = 6;
    for (int k = 0; k < 6; k++) {
        const int axis = k / 2;
        const Vector3d normal = (k % 2 ? -1.0 : 1.0) * Vector3d::Unit(axis);
        drag.par.normals_B[k] = vec(3.0 * normal); // of any length
        drag.par.areas[k] = sides.prod() / sides[axis];
        drag.par.centres_B[k] = vec(centre + 0.5 * sides[axis] * normal);
    }
}

TEST(Drag, ABoxFeelsItsProjection)
{
    const Vector3d sides(1.0, 2.0, 0.5), centre(0.1, -0.2, 0.3), v(4000, -5000, 3000);
    Craft c;
    make_box(c.drag_interface, sides, centre);
    c.f.craft_interface.par.sigma_BN = vec3(0.3, -0.1, 0.2);
    c.f.craft_interface.par.v_BN_N = vec(v);
    c.prepare();
    const Vector3d v_B = c.f.dcm_BN() * v;
    // Of a convex body the projection is half the sum over all facets, lit or not.
    double projection = 0.0;
    Vector3d torque(0, 0, 0);
    for (int axis = 0; axis < 3; axis++) {
        const double area = sides.prod() / sides[axis] * std::abs(v_B[axis]) / v.norm();
        projection += area;
        const Vector3d middle = centre + 0.5 * sides[axis] * (v_B[axis] > 0 ? 1 : -1) * Vector3d::Unit(axis);
        torque += area * middle.cross(-0.5e-12 * 2.2 * v.norm() * v_B);
    }
    const Vector3d F = -0.5e-12 * 2.2 * projection * v.norm() * v_B;
    EXPECT_LT((c.force() - F).norm(), 1e-14 * F.norm());
    EXPECT_LT((c.torque() - torque).norm(), 1e-14 * F.norm());
}

TEST(Drag, ACircularOrbitDecaysAsTheClosedFormSays)
{
    // In air of constant density that does not turn, da/dt = -density B sqrt(mu a) with B = Cd A / m, so that sqrt(a)
    // falls at a constant rate. The orbit stays circular but for terms of density B a = 7e-6.
    Craft c;
    const double a0 = 7e6, B = 2.2 * 3.0 / 100.0, density = 1.5e-11;
    c.air_interface.par.density = density;
    c.f.craft_interface.par.v_BN_N = vec3(0, std::sqrt(mu / a0), 0);
    c.prepare();
    const double period = 2 * pi * std::sqrt(a0 * a0 * a0 / mu);
    const auto axis = [&] { return 1.0 / (2.0 / c.f.r().norm() - c.f.v().squaredNorm() / mu); };
    c.f.fly(static_cast<Ns>(period) * 10 * second, 10 * second);
    const double t = 1e-9 * static_cast<double>(c.f.t);
    const double root = std::sqrt(a0) - 0.5 * density * B * std::sqrt(mu) * t;
    EXPECT_GT(a0 - axis(), 2500.0);
    EXPECT_NEAR((a0 - axis()) / (a0 - root * root), 1.0, 2e-5);
    // The craft comes ahead of an undisturbed one: a lower orbit is faster. To first order by
    // 3/4 n density B sqrt(mu / a) t^2.
    const double n = std::sqrt(mu / (a0 * a0 * a0));
    const double ahead = std::remainder(std::atan2(c.f.r()[1], c.f.r()[0]) - n * t, 2 * pi);
    EXPECT_NEAR(ahead / (0.75 * n * density * B * std::sqrt(mu / a0) * t * t), 1.0, 1e-3);
}

TEST(Drag, TakesTheEnergyThatItsForceWorks)
{
    // Work by Simpson's rule on the published force, over an eccentric orbit in the standard atmosphere.
    Craft c;
    c.air_interface.par = {};
    c.air_interface.par.law = ATMOSPHERE_STANDARD_1976;
    c.f.method = sim::make_adaptive(1e-13, 1e-9);
    const OrbitState state = orbit_state(mu, {.p = 6.6e6 * 1.02, .e = 0.02, .i = 1.0, .f = -1.0});
    c.f.craft_interface.par.r_BN_N = vec(state.r);
    c.f.craft_interface.par.v_BN_N = vec(state.v);
    c.prepare();
    const auto energy = [&] { return 0.5 * c.f.v().squaredNorm() - mu / c.f.r().norm(); };
    const auto power = [&] { return (c.f.dcm_BN().transpose() * c.force()).dot(c.f.v()) / 100.0; };
    const double before = energy();
    double work = power() / 3.0 * 2.0;
    constexpr int steps = 1500;
    for (int i = 1; i <= steps; i++) {
        c.f.step(2 * second);
        work += (i == steps ? 1.0 : i % 2 ? 4.0 : 2.0) * power() / 3.0 * 2.0;
    }
    EXPECT_LT(work, -100.0);
    EXPECT_NEAR((energy() - before) / work, 1.0, 1e-6);
}

/// A panel of two facets and a hub with one, in air at rest, without gravity.
struct Winged : Assembly {
    Atmosphere air_interface{};
    AtmosphereModel air{air_interface};
    Drag drag_interface{};
    DragModel drag{drag_interface};

    Winged()
    {
        air.set_body({.name = "EARTH", .mu = mu, .radius = 6378137.0});
        air_interface.par.density = 0.01;
        method = sim::make_adaptive(1e-12, 1e-12);
        auto &par = drag_interface.par;
        par.Cd = 2.2;
        par.n = 3;
        par.panel[0] = par.panel[1] = 1;
        const Vector3d centres[3] = {{0.1, 1.5, 0.0}, {0.2, 2.5, -0.2}, {0.5, 0.0, 0.1}};
        for (int i = 0; i < 3; i++) {
            par.areas[i] = 0.5 + 0.2 * i;
            par.normals_B[i] = vec3(1.0, 0.1 * i, -0.2);
            par.centres_B[i] = vec(centres[i]);
        }
        add_panel(5.0, Vector3d(1.0, 0.2, 1.1).asDiagonal(), {0.1, 1.0, 0.2}, {0.2, 0.5, 0.8}, {0.0, 0.9, -0.1});
        panel_interface.par.stiffness[0] = 4.0;
        panel_interface.par.dtheta[0] = -0.1;
        craft_interface.par.r_BN_N = vec3(7e6, 0, 0);
        craft_interface.par.v_BN_N = vec3(10, 1, -1);
        craft_interface.par.omega_BN_B = vec3(0.01, -0.02, 0.01);
        drag.set_source(air);
        drag.further()[0].consumer->set_source(panels);
    }
    void prepare()
    {
        drag.prepare({"world.drag", 1, method.get()});
        air.prepare({"world.air", 1, method.get()});
        craft.attach(drag);
        prepare_all();
    }
    /// Force, its power and its torque about B's origin, N components, of all facets.
    struct Acting {
        Vector3d force{0, 0, 0}, torque{0, 0, 0};
        double power = 0.0;
    };
    Acting acting() const
    {
        Acting all;
        const auto &par = panel_interface.par;
        const double theta = panel_interface.out.angles.theta[0], rate = panel_interface.out.angles.dtheta[0];
        const Vector3d hinge = view(par.hinge_B[0]), axis = view(par.axes_B[0]).normalized();
        const Matrix3d BN = dcm_BN(), turn = rotation(theta * axis);
        for (int i = 0; i < 3; i++) {
            Vector3d n = view(drag_interface.par.normals_B[i]).normalized(), at = view(drag_interface.par.centres_B[i]);
            Vector3d speed = omega().cross(at);
            if (drag_interface.par.panel[i]) {
                n = turn * n;
                at = hinge + turn * (at - hinge);
                speed = omega().cross(at) + rate * axis.cross(at - hinge);
            }
            const double along = n.dot(BN * v());
            EXPECT_GT(along, 0.0);
            const Vector3d F = -0.5 * 0.01 * 2.2 * drag_interface.par.areas[i] * along * v();
            all.force += F;
            all.torque += (BN.transpose() * at).cross(F);
            all.power += F.dot(v() + BN.transpose() * speed);
        }
        return all;
    }
};

TEST(Drag, FacetsOnAPanelTurnItAndTheCraft)
{
    Winged c;
    c.prepare();
    const Sums first = c.sums();
    const Vector3d r = c.r();
    const auto acting = [&] {
        auto now = c.acting();
        now.torque += (c.r() - r).cross(now.force);
        return now;
    };
    const auto before = acting();
    EXPECT_LT((c.dcm_BN().transpose() * view(c.drag_interface.out.load.force_B) - before.force).norm(), 1e-12);
    // What the forces do by Simpson's rule.
    constexpr double h = 0.025;
    Vector3d pushed = h / 3.0 * before.force, turned = h / 3.0 * before.torque;
    double work = h / 3.0 * before.power, most = 0.0;
    constexpr int steps = 200;
    for (int i = 1; i <= steps; i++) {
        c.step(25 * ms);
        const auto now = acting();
        const double weight = (i == steps ? 1.0 : i % 2 ? 4.0 : 2.0) * h / 3.0;
        pushed += weight * now.force;
        turned += weight * now.torque;
        work += weight * now.power;
        most = std::max(most, std::abs(c.panel_interface.out.angles.theta[0]));
    }
    const Sums last = c.sums();
    const auto about = [&](const Sums &s) { return Vector3d(s.angular - r.cross(s.linear)); };
    EXPECT_GT(most, 0.1);
    EXPECT_LT((last.linear - first.linear - pushed).norm(), 1e-6 * pushed.norm());
    EXPECT_LT((about(last) - about(first) - turned).norm(), 1e-6 * turned.norm());
    EXPECT_NEAR(last.energy() - first.energy(), work, 1e-6 * std::abs(work));
}

TEST(Drag, NamesPanelsThatAreMissing)
{
    Winged bare;
    DragModel alone(bare.drag_interface);
    alone.set_source(bare.air);
    bare.air.prepare({"world.air", 1, bare.method.get()});
    alone.prepare({"world.drag", 1, bare.method.get()});
    EXPECT_EQ(error_of([&] { alone.start({}, nullptr); }),
              "world.drag.panel[0] is 1, but world.drag.panels is missing: the HingedPanels that carry it");
    bare.drag_interface.par.panel[1] = 2;
    EXPECT_EQ(error_of([&] { bare.prepare(); }), "world.drag.panel[1] is 2, but its HingedPanels have n = 1");
}

TEST(Drag, ANewDensityTakesEffectAtOnce)
{
    Craft c;
    c.prepare();
    c.f.step(second);
    const Vector3d v = c.f.v();
    c.air_interface.par.density = 1e-3;
    c.air.refresh();
    c.f.step(ms);
    EXPECT_NEAR((c.f.v() - v).norm(), 0.5e-3 * 2.2 * 3.0 / 100.0 * v.squaredNorm() * 1e-3, 0.03);
}

/// In free molecular flow at 400 km, with a speed ratio s in the direction of x; the pressure is density c^2 / 2.
struct Free : Craft {
    double density, T, c;

    explicit Free(double s, double accommodation = 0.9, double T_wall = 300.0)
    {
        air_interface.par = {};
        air_interface.par.law = ATMOSPHERE_STANDARD_1976;
        drag_interface.par.Cd = 0.0;
        drag_interface.par.T_wall = T_wall;
        drag_interface.par.accommodation = accommodation;
        f.craft_interface.par.r_BN_N = vec3(6778137.0, 0, 0);
        air.prepare({"world.air", 1, f.method.get()});
        const AirSource::State at = air.at(0, 0.0, Vector3d(6778137.0, 0, 0));
        density = at.density;
        T = at.temperature;
        c = std::sqrt(2.0 * 8.314462618 * T / at.molar_mass);
        f.craft_interface.par.v_BN_N = vec3(s * c, 0, 0);
    }
    double speed() const { return f.craft_interface.par.v_BN_N.v[0]; }
    /// [Pa] on a facet whose normal is at this angle from the motion.
    Vector3d pressure(double angle)
    {
        drag_interface.par.n = 1;
        drag_interface.par.normals_B[0] = vec3(std::cos(angle), std::sin(angle), 0);
        drag_interface.par.areas[0] = 1.0;
        prepare();
        return force();
    }
    /// [m^2/s^2] R T / M of the molecules that leave.
    double leaving() const
    {
        const double brought = 0.25 * speed() * speed() + 0.5 * c * c, alpha = drag_interface.par.accommodation;
        return (1.0 - alpha) * brought + alpha * 0.5 * c * c / T * drag_interface.par.T_wall;
    }
};

/// Sums over the velocities of molecules that meet a wall with the normal x: a Maxwell distribution about the velocity
/// (-s cos, -s sin) in units of c. They are the number, and the momentum along x and y.
Vector3d coming(double s, double angle)
{
    constexpr int n = 400;
    Vector3d sum(0, 0, 0);
    const double from = -s * std::cos(angle) - 8.0, h = -from / n;
    if (from >= 0.0) {
        return sum;
    }
    for (int i = 0; i <= n; i++) { // Simpson's rule along x, from far out to the wall
        const double u = from + h * i, weight = (i == 0 || i == n ? 1.0 : i % 2 ? 4.0 : 2.0) * h / 3.0;
        const double f = std::exp(-std::pow(u + s * std::cos(angle), 2)) / std::sqrt(pi);
        for (double w = -8.0; w <= 8.0; w += 0.25) { // and the trapezoidal rule along y
            const double v = w - s * std::sin(angle),
                         number = -u * weight * f * 0.25 * std::exp(-w * w) / std::sqrt(pi);
            sum += number * Vector3d(1.0, u, v);
        }
    }
    return sum;
}

TEST(Drag, AFacetFeelsTheMomentumOfAllMoleculesThatComeAndLeave)
{
    for (const double s : {0.0, 0.3, 1.0, 4.0, 9.0}) {
        for (const double angle : {0.0, 0.5, 1.4, pi / 2, 1.8, 3.0}) {
            Free c(s);
            const Vector3d p = c.pressure(angle), sums = coming(s, angle);
            // As many leave, with half a Maxwell distribution: along the normal sqrt(pi / 2 R T / M) on average.
            const double leave = sums[0] * std::sqrt(0.5 * pi * c.leaving()) / c.c;
            const Vector3d n(std::cos(angle), std::sin(angle), 0), t(-std::sin(angle), std::cos(angle), 0);
            const Vector3d expected = c.density * c.c * c.c * ((sums[1] - leave) * n - sums[2] * t);
            EXPECT_LT((p - expected).norm(), 1e-8 * c.density * c.c * c.c * (1.0 + s * s)) << s << " " << angle;
        }
    }
}

TEST(Drag, AtRestInAirOfItsTemperatureAFacetFeelsThePressure)
{
    Free c(0.0, 0.7);
    c.drag_interface.par.T_wall = c.T;
    const double p = 0.5 * c.density * c.c * c.c;
    EXPECT_LT((c.pressure(0.3) + p * Vector3d(std::cos(0.3), std::sin(0.3), 0)).norm(), 1e-9 * p);
}

TEST(Drag, FastMoleculesHaveTheLimitsOfTheTextbook)
{
    // Far faster than their heat: the drag coefficient of a plate across the flow is 2 where they stay cold, and
    // sqrt(pi / 2) more where they keep their energy; the lee side feels nothing.
    const auto coefficient = [](double accommodation) {
        Free c(1000.0, accommodation, 1e-3);
        EXPECT_LT(c.pressure(pi).norm(), 1e-300);
        return -c.pressure(0.0)[0] / (0.5 * c.density * c.speed() * c.speed());
    };
    EXPECT_NEAR(coefficient(1.0), 2.0, 1e-5);
    EXPECT_NEAR(coefficient(1e-9), 2.0 + std::sqrt(pi / 2.0), 1e-5);
}

TEST(Drag, ASphereFeelsTheSumOfItsFacetsAndTheClosedForm)
{
    for (const double s : {0.005, 0.0099, 0.0101, 0.5, 3.0, 12.0}) {
        Free sphere(s);
        sphere.prepare();
        double sum = 0.0;
        constexpr int n = 200;
        for (int i = 0; i <= n; i++) { // rings of a sphere of the cross section 3 m^2
            const double angle = pi * i / n, weight = (i == 0 || i == n ? 1.0 : i % 2 ? 4.0 : 2.0) * pi / n / 3.0;
            sum += weight * 6.0 * std::sin(angle) * Free(s).pressure(angle)[0];
        }
        EXPECT_NEAR(sphere.force()[0] / sum, 1.0, 1e-6) << s;
        const double s2 = s * s, warm = std::sqrt(sphere.leaving() / (0.5 * sphere.c * sphere.c));
        const double Cd = (2 * s2 + 1) * std::exp(-s2) / (std::sqrt(pi) * s2 * s) +
                          (4 * s2 * s2 + 4 * s2 - 1) * std::erf(s) / (2 * s2 * s2) + 2 * std::sqrt(pi) / (3 * s) * warm;
        const double F = -0.5 * sphere.density * 3.0 * Cd * sphere.speed() * sphere.speed();
        EXPECT_NEAR(sphere.force()[0] / F, 1.0, 1e-8) << s;
    }
}

TEST(Drag, FreeFlowNeedsItsParametersAndTheTemperature)
{
    Free both(1.0);
    both.drag_interface.par.Cd = 2.0;
    EXPECT_EQ(
        error_of([&] { both.prepare(); }),
        "world.drag.Cd is 2, T_wall 300 K and accommodation 0.9: give either Cd, or both T_wall and accommodation");
    Free bare(1.0, 0.0);
    EXPECT_EQ(error_of([&] { bare.prepare(); }),
              "world.drag.Cd is 0, T_wall 300 K and accommodation 0: give either Cd, or both T_wall and accommodation");
    Free cold(1.0);
    cold.air_interface.par = {};
    cold.air_interface.par.density = 1e-12;
    EXPECT_EQ(
        error_of([&] { cold.prepare(); }),
        "world.drag.T_wall needs the temperature of the air, which world.air does not have: take another law, such "
        "as \"STANDARD_1976\", or give Cd in its place");
}

TEST(Drag, NamesWhatIsWrong)
{
    Craft none;
    none.drag_interface.par.area = 0.0;
    EXPECT_EQ(error_of([&] { none.prepare(); }),
              "world.drag.area is 0 m^2, and there are no facets: nothing feels the air");
    Craft light;
    light.f.craft_interface.par.mass = 0.0;
    EXPECT_EQ(error_of([&] { light.prepare(); }),
              "world.craft.mass is 0, but one of its parts adds forces: give the spacecraft its mass");
    Craft elsewhere;
    EXPECT_EQ(
        error_of([&] { elsewhere.f.prepare(); }),
        "a part of the spacecraft that asks a world.Atmosphere is itself in no world: w.part = ... makes it known");
    Flyer f;
    Drag interface {
    };
    interface.par.Cd = interface.par.area = 1.0;
    DragModel bare(interface);
    bare.prepare({"world.drag", 1, f.method.get()});
    EXPECT_EQ(error_of([&] { bare.start({}, nullptr); }),
              "world.drag.air is missing: a model of the same world, as in `w.air = world.Atmosphere(...)`");
    EXPECT_FALSE(bare.set_source(f.craft));
}

} // namespace drag_model_test
