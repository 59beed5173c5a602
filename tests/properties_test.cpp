// SPDX-License-Identifier: Apache-2.0
// Properties of all flight modules and world models, for any inputs: numbers come from the tables, so that a new
// module or model is tested here without a line.
#include "flight/testing/poison.h"
#include "sim/error.h"
#include "sim/simulation.h"
#include "world/dynamics/effector.h"
#include "world/dynamics/ephemeris_craft_model.h"
#include "world/dynamics/spacecraft_model.h"
#include "world/environment/celestial_body_model.h"
#include "world/environment/earth_atmosphere_model.h"
#include "world/environment/environment_model.h"
#include "world/environment/testing/two_circles.h"
#include "world/models.h"
#include "world/msg/fault.h"

#include <gtest/gtest.h>

#include <climits>
#include <functional>
#include <string>

extern "C" {
#include "flight/actuation/wheel_torques.h"
#include "flight/control/mrp_feedback.h"
#include "flight/guidance/tracking_error.h"
#include "flight/msg/protection.h"

extern const FledgeLibrary fledge_library_flight;
}

namespace properties_test {

using namespace fledge;
using flight::testing::any_number;
using flight::testing::any_quality;
using flight::testing::Random;
using sim::Ns;

constexpr Ns ms = 1'000'000, second = 1000 * ms;

/// One number of a struct in memory.
struct Number {
    FledgeType type;
    std::byte *at;
    const FledgeField *field;

    double read() const { return element_read(type, at); }
    template <class T> void write(T value) const { std::memcpy(at, &value, sizeof value); }
};

/// All numbers of the fields of a group, those of messages included, spares left out.
std::vector<Number> numbers(const FledgeStruct &type, FledgeGroup group, std::byte *memory)
{
    std::vector<Number> result;
    for (const FledgeField &field : sim::fields(type)) {
        if (field.group != group || field.flags & FLEDGE_SPARE) {
            continue;
        }
        if (field.type == FLEDGE_STRUCT) {
            for (std::uint32_t at = 0; at < field.size; at += field.sub->size) {
                for (Number number : numbers(*field.sub, FLEDGE_NONE, memory + field.offset + at)) {
                    result.push_back(number);
                }
            }
        } else {
            for (std::uint32_t at = 0; at < field.size; at += element_size(field.type)) {
                result.push_back({field.type, memory + field.offset + at, &field});
            }
        }
    }
    return result;
}

bool named(const Number &number, const char *name)
{
    return std::string(number.field->name) == name;
}

/// A value that the field's rule allows.
double ordinary(const FledgeField &field, Random &random)
{
    const bool lo = field.bounds & FLEDGE_HAS_LO, hi = field.bounds & FLEDGE_HAS_HI;
    const double below = hi ? std::min(-1.0, field.hi - 2.0) : -1.0; // about 0, if the rule allows it
    const double low = lo ? std::max(field.lo, below) : below;
    const double high = hi ? std::min(field.hi, low + (lo && low == field.lo ? 10.0 : 2.0)) : low + 2.0;
    return random.real(low + 0.1 * (high - low), high);
}

/// Parameters that keep all rules.
void set_parameters(sim::Instance &instance, Random &random)
{
    instance.given.assign(instance.type().n, true);
    for (const FledgeField &field : sim::fields(instance.type())) {
        if (field.group != FLEDGE_PAR || field.flags & FLEDGE_SPARE) {
            continue;
        }
        const double moments[] = {2.0, 2.5, 3.0};
        std::uint32_t i = 0;
        for (const Number &number : numbers(instance.type(), FLEDGE_PAR, instance.memory())) {
            if (number.field != &field) {
                continue;
            }
            if (field.flags & FLEDGE_INERTIA) {
                number.write(i % 9 % 4 == 0 ? moments[i % 9 / 4] : 0.0);
            } else if (number.type == FLEDGE_F64) {
                number.write(ordinary(field, random));
            } else {
                number.write(static_cast<std::uint32_t>(field.bounds & FLEDGE_HAS_HI ? std::min(field.hi, 3.0) : 1.0));
            }
            i++;
        }
    }
}

bool in_matrix(const Number &number)
{
    return number.field->ndim == 2 && number.field->shape[0] == 3 && number.field->shape[1] == 3;
}

/// Inputs that are good and finite, of time t. Their matrices are anything, attitudes of no turn, or small covariances.
void set_inputs(sim::Instance &instance, Random &random, Ns t)
{
    const int kind = random.below(3);
    int place = 0; // in a matrix
    for (const Number &number : numbers(instance.type(), FLEDGE_IN, instance.memory())) {
        place = in_matrix(number) ? place % 9 + 1 : 0;
        if (place > 0 && kind > 0) {
            number.write(place % 4 != 1 ? 0.0 : kind == 1 ? 1.0 : 1e-4);
        } else if (number.type == FLEDGE_F64) {
            number.write(random.real(-2.0, 2.0));
        } else if (named(number, "quality")) {
            number.write(QUALITY_GOOD);
        } else if (named(number, "t")) {
            number.write(t);
        } else if (number.type == FLEDGE_U8) {
            number.write(std::uint8_t{1});
        } else if (number.type == FLEDGE_I64) {
            number.write(std::int64_t{0});
        } else if (named(number, "state")) {
            number.write(static_cast<std::uint32_t>(UNIT_PRIMARY));
        } else if (named(number, "waits")) {
            number.write(std::uint32_t{0});
        } else {
            number.write(std::uint32_t{1});
        }
    }
}

void update(sim::Instance &module, Tick tick)
{
    reinterpret_cast<void (*)(void *, Tick)>(module.type().update)(module.memory(), tick);
}

void reset(sim::Instance &module)
{
    reinterpret_cast<void (*)(void *)>(module.type().reset)(module.memory());
}

/// The name of a number among the outputs that is not finite; "" if all are.
std::string not_finite(const sim::Instance &instance)
{
    for (const Number &number : numbers(instance.type(), FLEDGE_OUT, instance.memory())) {
        if (!std::isfinite(number.read())) {
            return instance.path + ": " + number.field->name;
        }
    }
    return "";
}

void for_each_module(const std::function<void(sim::Instance &)> &test)
{
    int modules = 0;
    for (std::uint32_t i = 0; i < fledge_library_flight.n; i++) {
        const FledgeStruct &type = *fledge_library_flight.structs[i];
        if (type.kind == FLEDGE_MODULE) {
            sim::Instance module(type);
            SCOPED_TRACE(type.name);
            test(module);
            modules++;
        }
    }
    EXPECT_GE(modules, 13);
}

/// Writes bad numbers at up to `most` places of a group; into parameters only those that the checks allow.
void spoil(sim::Instance &module, FledgeGroup group, int most, Random &random)
{
    const auto all = numbers(module.type(), group, module.memory());
    const int n = static_cast<int>(all.size());
    for (int bad = std::min(most, n); bad > 0; bad--) {
        const Number &number = all[static_cast<std::size_t>(random.below(n))];
        const double before = number.read();
        if (number.type == FLEDGE_F64) {
            number.write(any_number(random));
        } else if (named(number, "quality")) {
            number.write(any_quality(random));
        } else if (number.type == FLEDGE_U32 && group == FLEDGE_IN) {
            number.write(static_cast<std::uint32_t>(random.real(0, 4294967295.0)));
        } else if (number.type == FLEDGE_U8 && group == FLEDGE_IN) {
            number.write(static_cast<std::uint8_t>(random.below(2)));
        }
        try {
            if (group == FLEDGE_PAR) {
                sim::check_parameters(module);
            }
        } catch (const sim::SetupError &) {
            number.write(before);
        }
    }
}

TEST(Modules, OutputsAreFiniteWhateverTheInputs)
{
    for_each_module([](sim::Instance &module) {
        Random random{1};
        bool written = false;
        for (int round = 0; round < 4000; round++) {
            if (round % 50 == 0) {
                set_parameters(module, random);
                sim::check_parameters(module);
                spoil(module, FLEDGE_PAR, round % 100 ? 20 : 0, random);
                reset(module);
            }
            set_inputs(module, random, round * ms);
            spoil(module, FLEDGE_IN, round % 9 ? random.below(4) : INT_MAX, random);
            update(module, {round * ms, round % 50 ? ms : 0});
            ASSERT_EQ(not_finite(module), "") << round;
            for (const Number &number : numbers(module.type(), FLEDGE_OUT, module.memory())) {
                written |= named(number, "sequence") && number.read() > 0;
            }
        }
        EXPECT_TRUE(written) << "nothing was tested";
    });
}

TEST(Modules, AnyTimesAreDefined)
{
    // The undefined-behaviour sanitizer sees integers that overflow.
    constexpr Ns ends[] = {INT64_MIN, INT64_MIN + 1, -second, -1, 0, 1, second, INT64_MAX - 1, INT64_MAX};
    const auto any_time = [&](Random &random) { return ends[random.below(9)]; };
    for_each_module([&](sim::Instance &module) {
        Random random{2};
        for (int round = 0; round < 3000; round++) {
            if (round % 10 == 0) {
                set_parameters(module, random);
                reset(module);
            }
            set_inputs(module, random, any_time(random));
            for (const Number &number : numbers(module.type(), FLEDGE_IN, module.memory())) {
                if (number.type == FLEDGE_I64) {
                    number.write(any_time(random));
                } else if (named(number, "durations")) {
                    number.write(random.below(2) ? 5e8 : 1e-9);
                }
            }
            update(module, {any_time(random), any_time(random)});
            ASSERT_EQ(not_finite(module), "") << round;
        }
    });
}

/// Inputs and times of any kind, among good ones.
void disturb(sim::Instance &module, Random &random, Ns t)
{
    set_inputs(module, random, t);
    for (const Number &number : numbers(module.type(), FLEDGE_IN, module.memory())) {
        if (random.below(4) > 0) {
            continue;
        }
        if (number.type == FLEDGE_F64) {
            number.write(any_number(random));
        } else if (named(number, "quality")) {
            number.write(any_quality(random));
        } else if (named(number, "t")) {
            const Ns times[] = {INT64_MIN, t - second, t + second, INT64_MAX};
            number.write(times[random.below(4)]);
        } else if (number.type == FLEDGE_U8) {
            number.write(static_cast<std::uint8_t>(random.below(2)));
        }
    }
}

TEST(Modules, AResetForgetsEverything)
{
    for_each_module([](sim::Instance &module) {
        Random random{6};
        set_parameters(module, random);
        reset(module);
        sim::Instance fresh(module.type());
        std::memcpy(fresh.memory(), module.memory(), module.type().size);
        for (int round = 0; round < 500; round++) {
            disturb(module, random, round * ms);
            update(module, {round * ms, round ? ms : 0});
        }
        Random same = random;
        set_inputs(module, random, 0);
        set_inputs(fresh, same, 0);
        reset(module);
        const std::string name = module.type().name;
        for (const FledgeGroup group : {FLEDGE_IN, FLEDGE_PAR, FLEDGE_OUT, FLEDGE_MEM}) {
            if (group == FLEDGE_MEM && (name == "Files" || name == "FaultProtection" || name == "BurnMemory")) {
                continue; // files stay, and transfers go on; the states of units stay; so does what was burnt
            }
            const bool zero = group == FLEDGE_OUT ||
                              (group == FLEDGE_MEM && name != "Monitors" && name != "RequirementMonitor" &&
                               name != "PowerManager" && name != "PropulsionManager"); // their memory begins otherwise
            const auto left = numbers(module.type(), group, module.memory());
            const auto never = numbers(module.type(), group, fresh.memory());
            for (std::size_t i = 0; i < left.size(); i++) {
                ASSERT_EQ(left[i].read(), zero ? 0.0 : never[i].read()) << left[i].field->name;
            }
        }
    });
}

TEST(Modules, AfterBadInputsAModuleSpeaksAgain)
{
    for_each_module([](sim::Instance &module) {
        sim::Instance fresh(module.type());
        for (std::uint64_t seed = 1; seed <= flight::testing::runs(20); seed++) {
            Random random{seed};
            set_parameters(module, random);
            reset(module);
            std::memcpy(fresh.memory(), module.memory(), module.type().size);
            for (int round = 0; round < 300; round++) {
                disturb(module, random, round * ms);
                update(module, {round * ms, round ? ms : 0});
            }
            for (int round = 300; round < 500; round++) {
                Random same = random;
                set_inputs(module, random, round * ms);
                set_inputs(fresh, same, round * ms);
                update(module, {round * ms, ms});
                update(fresh, {round * ms, round > 300 ? ms : 0});
            }
            for (const FledgeField &field : sim::fields(module.type())) {
                if (field.group != FLEDGE_OUT || std::string(field.sub->name) == "FlightEvent") {
                    continue; // events are irregular
                }
                for (std::uint32_t at = field.offset; at < field.offset + field.size; at += field.sub->size) {
                    const auto spoilt = numbers(*field.sub, FLEDGE_NONE, module.memory() + at);
                    const auto sound = numbers(*field.sub, FLEDGE_NONE, fresh.memory() + at);
                    for (std::size_t i = 0; i < spoilt.size(); i++) {
                        ASSERT_TRUE(!named(spoilt[i], "t") || spoilt[i].read() >= sound[i].read())
                            << "number " << i << " of " << field.name << ", seed " << seed;
                    }
                }
            }
        }
    });
}

TEST(Modules, AnAttitudeThatIsLostEndsTheWheelsTorque)
{
    using namespace flight::testing;
    for (const Quality lost : {QUALITY_STALE, QUALITY_DEGRADED, QUALITY_GOOD}) {
        Random random{5};
        TrackingError tracking{};
        MrpFeedback control{};
        WheelTorques motor{};
        control.in.vehicle = {good(), mat(random.spd(100))};
        control.par.K = 1.0;
        control.par.P = mat(random.spd(10));
        motor.in.wheels.head = good();
        motor.in.wheels.n = 4;
        for (Vec3 &axis : motor.in.wheels.axes_B) {
            axis = vec(random.direction());
        }
        tracking.in.attitude = {good(), random.mrp(), vec(random.vector())};
        const auto largest = [&](Ns t) {
            tracking.in.reference = {good(t), random.mrp(), vec(random.vector()), vec(random.vector())};
            tracking_error_update(&tracking, {t, t > 0 ? second : 0});
            control.in.error = tracking.out.error;
            mrp_feedback_update(&control, {t, t > 0 ? second : 0});
            motor.in.torque = control.out.torque;
            wheel_torques_update(&motor, {t, t > 0 ? second : 0});
            double most = 0.0;
            for (double u : motor.out.command.u) {
                most = std::max(most, std::abs(u));
            }
            return most;
        };
        EXPECT_GT(largest(0), 0.0);
        tracking.in.attitude.head.quality = lost;
        if (lost == QUALITY_GOOD) {
            tracking.in.attitude.omega_BN_B.v[1] = NAN;
        }
        for (int k = 1; k < 60; k++) {
            const double most = largest(k * second);
            EXPECT_TRUE(k < 10 ? most > 0.0 : k <= 20 || most == 0.0) << k << " " << most;
            EXPECT_EQ(motor.out.command.head.quality, QUALITY_DEGRADED);
        }
    }
}

/// Numbers whose squares, inverses and products leave the range of a double, and the bounds of the fields.
std::vector<double> extremes()
{
    std::vector<double> all;
    for (const double x : {0.0, 5e-324, 1e-320, 1e-300, 1e-160, 1e-100, 1e-30, 1e30, 1e100, 1e160, 1e300, DBL_MAX,
                           HUGE_VAL, std::numeric_limits<double>::quiet_NaN()}) {
        all.insert(all.end(), {x, -x});
    }
    return all;
}

struct Outcomes {
    int refused = 0, flown = 0;
};

/// For each number of the parameters and each extreme: refused with the parameter's name, or flown with finite outputs.
Outcomes fly_extremes(sim::Instance &instance, const std::function<void()> &prepare, const std::function<void()> &fly)
{
    std::vector<std::byte> ordinary(instance.memory(), instance.memory() + instance.type().size);
    int refused = 0, flown = 0;
    for (const Number &number : numbers(instance.type(), FLEDGE_PAR, instance.memory())) {
        if (number.type != FLEDGE_F64) {
            continue;
        }
        for (const double extreme : extremes()) {
            std::memcpy(instance.memory(), ordinary.data(), ordinary.size());
            number.write(extreme);
            try {
                prepare();
            } catch (const sim::SetupError &error) {
                const std::string text = error.what();
                EXPECT_EQ(text.find(instance.path + "."), 0u) << text;
                EXPECT_NE(text.find(number.field->name), std::string::npos) << text;
                refused++;
                continue;
            }
            try {
                fly();
                flown++;
                EXPECT_EQ(not_finite(instance), "") << number.field->name << " = " << extreme;
            } catch (const sim::RunError &error) {
                EXPECT_NE(std::string(error.what()).find("world.craft"), std::string::npos) << error.what();
            }
        }
    }
    std::memcpy(instance.memory(), ordinary.data(), ordinary.size());
    return {refused, flown};
}

TEST(Modules, ExtremeParametersAreRefusedOrGiveFiniteOutputs)
{
    Outcomes all;
    for_each_module([&](sim::Instance &module) {
        Random random{3};
        set_parameters(module, random);
        const auto fly = [&] {
            reset(module);
            for (int round = 0; round < 5; round++) {
                set_inputs(module, random, round * second);
                update(module, {round * second, round ? second : 0});
                ASSERT_EQ(not_finite(module), "");
            }
        };
        const Outcomes outcomes = fly_extremes(
            module, [&] { sim::check_parameters(module); }, fly);
        all.refused += outcomes.refused;
        all.flown += outcomes.flown;
    });
    EXPECT_GT(all.refused, 1000);
    EXPECT_GT(all.flown, 1000);
}

/// All models in one world, in which everything acts.
struct World {
    sim::Simulation simulation{1};
    std::vector<std::shared_ptr<sim::Instance>> instances;

    World()
    {
        using world::testing::TwoCircles;
        sim::Process &process = simulation.add_process("world");
        std::vector<std::shared_ptr<sim::Instance>> run;
        for (const sim::ModelType &type : world::models()) {
            auto instance = std::make_shared<sim::Instance>(type);
            const std::string name = type.interface->name;
            process.add(name == "Spacecraft" ? "craft" : name, instance);
            Random random{4}; // its own, so that a further model leaves the others as they were
            set_parameters(*instance, random);
            set_inputs(*instance, random, 0);
            instances.push_back(instance);
            if (!dynamic_cast<world::Effector *>(instance->model())) {
                run.push_back(instance);
            }
            if (auto *body = dynamic_cast<world::CelestialBodyModel *>(instance->model())) {
                body->set_sky(TwoCircles::sky(TwoCircles::sun));
                set(*instance, "id", TwoCircles::jupiter);
            }
            if (auto *follower = dynamic_cast<world::EphemerisCraftModel *>(instance->model())) {
                follower->set_sky(TwoCircles::sky(TwoCircles::sun));
                auto path = std::make_shared<world::CraftEphemeris>();
                path->orbits = {{0, 1000 * second, 1, {0, 1000 * second}, {{4e6, 0, 0}, {4e6, 3e6, 0}}, {}}};
                follower->set_ephemeris(path);
            }
            if (auto *model = dynamic_cast<world::EnvironmentModel *>(instance->model())) {
                world::GravityBody body;
                body.name = "rock";
                body.mu = body.radius = 1e6;
                body.r_PN_N = {name == "PlanetRadiation" ? 2e7 : 1e7, 0, 0}; // the Sun is elsewhere
                model->set_body(body);
            }
            if (auto *air = dynamic_cast<world::EarthAtmosphereModel *>(instance->model())) {
                air->set_body({.name = "jupiter", .mu = 1e8, .radius = 1e8, .naif = TwoCircles::jupiter});
                air->set_sky(TwoCircles::sky(TwoCircles::jupiter));
            }
        }
        set(find("Magnetism"), "degree", 0u);    // of a dipole
        set(find("PlanetRadiation"), "law", 0u); // without a sky
        set(find("PlanetRadiation"), "rings", 1u);
        set(find("Drag"), "T_wall", 0.0); // by Cd
        set(find("Drag"), "accommodation", 0.0);
        set(find("SolarPressure"), "specular", 0.3);
        set(find("SolarPressure"), "diffuse", 0.2); // both within 1
        auto &craft = dynamic_cast<world::SpacecraftModel &>(*find("craft").model());
        for (const auto &instance : instances) {
            if (auto *part = dynamic_cast<world::Effector *>(instance->model())) {
                craft.attach(*part);
            }
            if (auto *part = dynamic_cast<world::Consumer *>(instance->model())) {
                part->set_source(*find(part->source_kind()).model());
                for (const auto &further : part->further()) {
                    further.consumer->set_source(*find(further.consumer->source_kind()).model());
                }
            }
        }
        craft.add_gravity({.name = "mars", .mu = 4.2828314e13, .radius = 3.397e6, .J = {1.96e-3, 3e-5, 0, 0, 0}});
        set(find("craft"), "r_BN_N", 4e6);
        set(find("ReactionWheels"), "Omega", 0.01); // within their limit
        set(find("ControlMomentGyros"), "Omega", 0.01);
        set(find("ControlMomentGyros"), "rate", 0.01);
        set(find("craft"), "mass", 1e3); // a body that is heavier than its parts
        for (const Number &number : numbers(find("craft").type(), FLEDGE_PAR, find("craft").memory())) {
            if (named(number, "I_B")) {
                number.write(1e3 * number.read());
            }
        }
        const auto output = [&](const FledgeStruct *type) {
            for (const auto &writer : instances) {
                if (dynamic_cast<world::EphemerisCraftModel *>(writer->model())) {
                    continue; // the craft is another one
                }
                for (const FledgeField &field : sim::fields(writer->type())) {
                    if (field.group == FLEDGE_OUT && field.sub == type) {
                        return sim::Port{writer, &field};
                    }
                }
            }
            throw std::logic_error(std::string("no model puts out a ") + type->name);
        };
        for (const auto &reader : instances) {
            for (const FledgeField &input : sim::fields(reader->type())) {
                if (input.group == FLEDGE_IN && !(input.flags & FLEDGE_OPTIONAL)) {
                    simulation.connect(output(input.sub), {reader, &input});
                }
            }
        }
        const sim::Port moon{shared("StarTracker"), sim::find_field(find("StarTracker").type(), "moon")};
        simulation.connect(output(moon.field->sub), moon); // of which it needs to know
        process.add_task({"all", second, 0, 0, run});
    }

    std::shared_ptr<sim::Instance> shared(const std::string &name)
    {
        return *std::find_if(instances.begin(), instances.end(), [&](const auto &each) { return each->name == name; });
    }

    sim::Instance &find(const std::string &name) { return *shared(name); }

    template <class T> static void set(sim::Instance &instance, const char *name, T value)
    {
        for (const Number &number : numbers(instance.type(), FLEDGE_PAR, instance.memory())) {
            if (named(number, name)) {
                number.write(value);
            }
        }
    }
};

TEST(Models, ExtremeParametersAreRefusedOrGiveFiniteOutputs)
{
    World world;
    for (const auto &instance : world.instances) {
        SCOPED_TRACE(instance->path);
        const auto fly = [&] {
            for (int i = 0; i < 5; i++) {
                world.simulation.step();
            }
        };
        const Outcomes outcomes = fly_extremes(
            *instance, [&] { world.simulation.reset(); }, fly);
        const auto all = numbers(instance->type(), FLEDGE_PAR, instance->memory());
        const bool any = std::any_of(all.begin(), all.end(), [](const Number &n) { return n.type == FLEDGE_F64; });
        EXPECT_TRUE(!any || (outcomes.refused > 0 && outcomes.flown > 0));
    }
}

TEST(Models, FaultySensorsAndActuatorsGoOnBitForBitFromSnapshotsAndInClones)
{
    World world;
    const Fault faults[FAULTS_MAX] = {{FAULT_BABBLE, 1, 1e-3, 2 * second, 0},
                                      {FAULT_DELAY, 2, 2.0, 0, 0},
                                      {FAULT_DROPOUT, 0, 0.5, 3 * second, 5 * second},
                                      {FAULT_DRIFT, 4, 1e-3, 0, 0}};
    int faulty = 0;
    for (const auto &instance : world.instances) {
        for (const FledgeField &field : sim::fields(instance->type())) {
            if (field.type == FLEDGE_STRUCT && std::string(field.sub->name) == "Fault") {
                std::memcpy(instance->memory() + field.offset, faults, sizeof faults);
                World::set(*instance, "n_faults", std::uint32_t{FAULTS_MAX});
                faulty++;
            }
        }
    }
    EXPECT_GE(faulty, 12);
    world.simulation.run_until(5 * second);
    const auto there = world.simulation.snapshot();
    const auto clone = world.simulation.clone();
    world.simulation.run_until(10 * second);
    const auto straight = world.simulation.snapshot();
    clone->run_until(10 * second);
    EXPECT_EQ(clone->snapshot(), straight);
    world.simulation.restore(there);
    world.simulation.run_until(10 * second);
    EXPECT_EQ(world.simulation.snapshot(), straight);
}

} // namespace properties_test
