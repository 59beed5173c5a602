// SPDX-License-Identifier: Apache-2.0
// The nadir spin in one program, and with world and flight in two that are joined by sockets or shared
// memory: every message has the same bytes, whatever the transport, the latencies, the order in which
// programs start, and the time that they take.
#include "cosim/node/simulation_node.h"
#include "cosim/protocol/testing/patience.h"
#include "cosim/router/router.h"
#include "flight/actuation/wheel_torques.h"
#include "flight/control/mrp_feedback.h"
#include "flight/guidance/euler_rotation.h"
#include "flight/guidance/hill_pointing.h"
#include "flight/guidance/tracking_error.h"
#include "flight/vehicle/vehicle_config.h"
#include "flight/vehicle/wheel_config.h"
#include "world/dynamics/orbit.h"
#include "world/dynamics/reaction_wheels_model.h"
#include "world/dynamics/spacecraft_model.h"
#include "world/models.h"
#include "world/sensors/navigation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <map>
#include <random>
#include <sstream>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>

extern "C" const FledgeLibrary fledge_library_flight;

namespace cosim_identity_test {

using namespace fledge;
using cosim::Latency;
using sim::Ns;

constexpr Ns ms = 1'000'000, second = 1000 * ms, run_end = 400 * second;
constexpr std::uint64_t seed = 5;

template <class T> T &as(const std::shared_ptr<sim::Instance> &instance)
{
    return *reinterpret_cast<T *>(instance->memory());
}

std::shared_ptr<sim::Instance> add(sim::Process &process, const std::string &name, const std::string &type)
{
    for (std::uint32_t i = 0; i < fledge_library_flight.n; i++) {
        if (fledge_library_flight.structs[i]->name == type) {
            process.add(name, std::make_shared<sim::Instance>(*fledge_library_flight.structs[i]));
            return process.find(name);
        }
    }
    for (const sim::ModelType &model : world::models()) {
        if (model.interface->name == type) {
            process.add(name, std::make_shared<sim::Instance>(model));
            return process.find(name);
        }
    }
    throw sim::SetupError("there is no type " + type);
}

sim::Port port(sim::Simulation &simulation, const std::string &path)
{
    const auto first = path.find('.'), last = path.rfind('.');
    const auto instance = simulation.process(path.substr(0, first)).find(path.substr(first + 1, last - first - 1));
    return {instance, sim::find_field(instance->type(), path.substr(last + 1))};
}

void wire(sim::Simulation &simulation, const std::string &from, const std::string &to, int latency = 0)
{
    simulation.connect(port(simulation, from), port(simulation, to), {latency, 0});
}

template <class T> void fit_wheels(T &par)
{
    par.n = 4;
    for (int i = 0; i < 4; i++) {
        par.axes_B[i] = vec3(i == 0 || i == 3 ? -0.5 : 0.5, i < 2 ? 0.5 : -0.5, -std::sqrt(0.5));
        par.J[i] = 0.1591549;
        par.u_max[i] = 0.2;
    }
}

const Mat3 inertia = mat_rows(vec3(700, 0, 0), vec3(0, 700, 0), vec3(0, 0, 800));

/// missions/nadir_spin/flight.py
void build_flight(sim::Simulation &s)
{
    sim::Process &f = s.add_process("flight");
    as<VehicleConfig>(add(f, "vehicle", "VehicleConfig")).par.I_B = inertia;
    fit_wheels(as<WheelConfig>(add(f, "wheels", "WheelConfig")).par);
    add(f, "guidance", "HillPointing");
    as<EulerRotation>(add(f, "spin", "EulerRotation")).par.rates = vec3(0, 0, 0.3 * std::acos(-1.0) / 180);
    as<TrackingError>(add(f, "tracking", "TrackingError")).par.sigma_BcB = vec3(0, 0, 1);
    auto &control = as<MrpFeedback>(add(f, "control", "MrpFeedback")).par;
    control.K = 2.531;
    control.P = mat_rows(vec3(45, 0, 0), vec3(0, 45, 0), vec3(0, 0, 45));
    add(f, "motor", "WheelTorques");
    wire(s, "flight.guidance.reference", "flight.spin.base");
    wire(s, "flight.spin.reference", "flight.tracking.reference");
    wire(s, "flight.tracking.error", "flight.control.error");
    wire(s, "flight.control.torque", "flight.motor.torque");
    wire(s, "flight.vehicle.vehicle", "flight.control.vehicle");
    wire(s, "flight.wheels.wheels", "flight.control.wheels");
    wire(s, "flight.wheels.wheels", "flight.motor.wheels");
    f.add_task({"gnc",
                500 * ms,
                0,
                0,
                {f.find("guidance"), f.find("spin"), f.find("tracking"), f.find("control"), f.find("motor")}});
}

/// missions/nadir_spin/world.py, with noise, so that the random streams count too.
void build_world(sim::Simulation &s)
{
    sim::Process &w = s.add_process("world");
    fit_wheels(as<ReactionWheels>(add(w, "wheels", "ReactionWheels")).par);
    auto &craft = as<Spacecraft>(add(w, "craft", "Spacecraft")).par;
    const double pi = std::acos(-1.0), mu = 4.2828314e13;
    world::OrbitElements elements;
    elements.p = world::semi_latus_rectum(7471.618e3, 0.4);
    elements.e = 0.4;
    elements.f = 1.5 * pi;
    const auto orbit = world::orbit_state(mu, elements);
    craft.I_B = inertia;
    craft.r_BN_N = vec3(orbit.r[0], orbit.r[1], orbit.r[2]);
    craft.v_BN_N = vec3(orbit.v[0], orbit.v[1], orbit.v[2]);
    craft.sigma_BN = vec3(0.1, 0.2, -0.3);
    craft.omega_BN_B = vec3(0.001, -0.01, 0.03);
    auto &model = dynamic_cast<world::SpacecraftModel &>(*w.find("craft")->model());
    model.attach(dynamic_cast<world::Effector &>(*w.find("wheels")->model()));
    world::GravityBody mars;
    mars.name = "mars";
    mars.mu = mu;
    model.add_gravity(mars);
    as<Navigation>(add(w, "nav", "Navigation")).par.rate_noise = vec3(1e-5, 1e-5, 1e-5);
    wire(s, "world.craft.state", "world.nav.truth");
    w.add_task({"dynamics", 100 * ms, 0, 0, {w.find("craft"), w.find("nav")}});
}

const std::pair<const char *, const char *> to_flight[] = {{"world.nav.attitude", "flight.tracking.attitude"},
                                                           {"world.nav.orbit", "flight.guidance.orbit"},
                                                           {"world.wheels.speeds", "flight.control.speeds"}};
const std::pair<const char *, const char *> to_world[] = {{"flight.motor.command", "world.wheels.command"}};

/// All outputs of a process, each time that it steps.
void record(sim::Simulation &s, const std::string &process)
{
    for (const auto &instance : s.process(process).instances()) {
        for (const FledgeField &field : sim::fields(instance->type())) {
            if (field.group == FLEDGE_OUT) {
                s.recorder().record(instance, field, process == "world" ? 100 * ms : 500 * ms);
            }
        }
    }
}

using Hashes = std::map<std::string, std::uint64_t>;

/// A hash per topic, of the times and bytes of all its messages.
Hashes hashes(const sim::Simulation &s)
{
    Hashes all;
    for (const auto &log : const_cast<sim::Simulation &>(s).recorder().logs()) {
        std::uint64_t hash = 0xcbf29ce484222325u;
        const auto mix = [&](std::span<const std::byte> bytes) {
            for (const std::byte b : bytes) {
                hash = (hash ^ std::to_integer<std::uint64_t>(b)) * 0x100000001b3u;
            }
        };
        mix(std::as_bytes(std::span(log->times)));
        mix(log->bytes);
        all[log->topic()] = hash;
    }
    return all;
}

Hashes in_one(int there, int back)
{
    sim::Simulation s(seed);
    build_world(s);
    build_flight(s);
    for (const auto &[from, to] : to_flight) {
        wire(s, from, to, there);
    }
    for (const auto &[from, to] : to_world) {
        wire(s, from, to, back);
    }
    record(s, "world");
    record(s, "flight");
    s.run_until(run_end);
    return hashes(s);
}

/// A node that takes its time, at random, before it answers.
class Slow final : public cosim::Node {
public:
    Slow(cosim::Node &node, unsigned draw) : node_(node), random_(draw) {}
    cosim::Initialized initialize(const cosim::Initialize &m) override { return delayed().initialize(m); }
    std::vector<cosim::Subscription> desired() override { return delayed().desired(); }
    std::vector<cosim::Publication> match(const std::vector<cosim::Channel> &channels) override
    {
        return delayed().match(channels);
    }
    void start(const std::vector<cosim::Channel> &wired) override { delayed().start(wired); }
    cosim::Tock tick(const cosim::Tick &m) override { return delayed().tick(m); }

private:
    cosim::Node &delayed()
    {
        if (random_() % 8 == 0) {
            std::this_thread::sleep_for(std::chrono::microseconds(random_() % 1000));
        }
        return node_;
    }
    cosim::Node &node_;
    std::mt19937 random_;
};

struct Case {
    const char *transport;
    int there, back; ///< latencies of the wires to flight and to the world
    unsigned draw;   ///< of the delays
};

/// One program: a process of the simulation, until the end. Its hashes go to `out` as bytes.
void be_node(const std::string &process, const std::string &address, const Case &c, int out)
{
    if (c.draw % 2 == (process == "world")) {
        std::this_thread::sleep_for(std::chrono::milliseconds(50)); // the other one comes first
    }
    sim::Simulation s(0); // the controller sets the seed
    const bool is_world = process == "world";
    (is_world ? build_world : build_flight)(s);
    cosim::SimulationNode node(s, process);
    const auto read = [&](const auto &wires, int latency, Latency without) {
        for (const auto &[from, to] : wires) {
            std::string topic = "/" + std::string(from);
            std::replace(topic.begin(), topic.end(), '.', '/');
            node.read(topic, port(s, to), latency ? Latency::next_exchange : without);
        }
    };
    is_world ? read(to_world, c.back, Latency::next_instant) : read(to_flight, c.there, Latency::same_instant);
    record(s, process);
    Slow slow(node, c.draw + is_world);
    zmq::context_t context;
    cosim::Delegate(context, {"nadir_spin", process, address, cosim::patience, {}}).serve(slow);
    for (const auto &[topic, hash] : hashes(s)) {
        const std::string line = topic + " " + std::to_string(hash) + "\n";
        if (write(out, line.data(), line.size()) != static_cast<ssize_t>(line.size())) {
            _exit(2);
        }
    }
}

/// The processes in programs of their own. Returns all hashes; fails the test if anything went wrong.
Hashes in_two(const Case &c)
{
    struct Program {
        int address[2], out[2];
        pid_t pid;
    };
    std::vector<Program> programs;
    for (const char *process : {"world", "flight"}) {
        Program p{};
        EXPECT_EQ(pipe(p.address) + pipe(p.out), 0);
        p.pid = fork(); // before there is any thread here
        if (p.pid == 0) {
            close(p.address[1]);
            char address[200] = {};
            ssize_t n = read(p.address[0], address, sizeof address - 1);
            try {
                be_node(process, std::string(address, static_cast<std::size_t>(std::max<ssize_t>(n, 0))), c, p.out[1]);
                _exit(0);
            } catch (const std::exception &error) {
                std::fprintf(stderr, "%s: %s\n", process, error.what());
                _exit(1);
            }
        }
        close(p.address[0]);
        close(p.out[1]);
        programs.push_back(p);
    }
    {
        cosim::ControllerConfig config;
        config.simulation = "nadir_spin";
        config.nodes = {{"world", cosim::Policy::abort}, {"flight", cosim::Policy::abort}};
        config.end = run_end;
        config.seed = seed;
        cosim::RouterConfig router_config;
        router_config.sharing =
            std::string(c.transport) == "shared memory" ? cosim::Sharing::required : cosim::Sharing::forbidden;
        router_config.address = std::string(c.transport) == "tcp"
                                    ? "tcp://127.0.0.1:*"
                                    : "ipc://@fledge-identity-" + std::to_string(getpid());
        zmq::context_t context;
        cosim::Router router(context, config, router_config);
        for (const Program &p : programs) {
            EXPECT_GT(write(p.address[1], router.address().data(), router.address().size()), 0);
            close(p.address[1]);
        }
        EXPECT_EQ(router.run(), "");
    }
    Hashes all;
    for (const Program &p : programs) {
        std::string text;
        char part[1000];
        for (ssize_t n; (n = read(p.out[0], part, sizeof part)) > 0;) {
            text.append(part, static_cast<std::size_t>(n));
        }
        close(p.out[0]);
        int status = -1;
        waitpid(p.pid, &status, 0);
        EXPECT_EQ(status, 0);
        std::istringstream lines(text);
        std::string topic;
        for (std::uint64_t hash = 0; lines >> topic >> hash;) {
            all[topic] = hash;
        }
    }
    return all;
}

TEST(CosimIdentity, TheNadirSpinHasTheSameMessagesInOneProgramAndInTwo)
{
    unsigned draw = 0;
    for (const int there : {0, 1}) {
        for (const int back : {0, 1}) {
            const Hashes expected = in_one(there, back);
            ASSERT_GT(expected.size(), 10u);
            for (const char *transport : {"ipc", "tcp", "shared memory"}) {
                EXPECT_EQ(in_two({transport, there, back, draw++}), expected)
                    << transport << ", latency " << there << " to flight and " << back << " to the world";
            }
        }
    }
    EXPECT_NE(in_one(0, 0), in_one(1, 1)); // latencies matter
}

/// Flight as a node, which dies at its n-th tick.
class Mortal final : public cosim::Node {
public:
    Mortal(sim::Simulation &s, int ticks) : node(s, "flight"), ticks_(ticks)
    {
        for (const auto &[from, to] : to_flight) {
            std::string topic = "/" + std::string(from);
            std::replace(topic.begin(), topic.end(), '.', '/');
            node.read(topic, port(s, to), Latency::same_instant);
        }
    }
    cosim::Initialized initialize(const cosim::Initialize &m) override
    {
        start_ = m.start;
        return node.initialize(m);
    }
    std::vector<cosim::Subscription> desired() override { return node.desired(); }
    std::vector<cosim::Publication> match(const std::vector<cosim::Channel> &channels) override
    {
        return node.match(channels);
    }
    void start(const std::vector<cosim::Channel> &wired) override { node.start(wired); }
    cosim::Bytes save() override { return node.save(); }
    cosim::Tock tick(const cosim::Tick &m) override
    {
        if (--ticks_ == 0) {
            throw std::runtime_error("it died");
        }
        return node.tick(m);
    }
    Ns start_ = -1;

private:
    cosim::SimulationNode node;
    int ticks_;
};

TEST(CosimIdentity, NoOtherSeesThatFlightDiedAndAnotherWentOnFromItsSnapshot)
{
    sim::Simulation together(seed), world(0), first(0), other(0);
    build_world(together);
    build_flight(together);
    for (const auto &[from, to] : to_flight) {
        wire(together, from, to);
    }
    for (const auto &[from, to] : to_world) {
        wire(together, from, to);
    }
    record(together, "world");
    record(together, "flight");
    together.run_until(run_end);

    build_world(world);
    build_flight(first);
    build_flight(other);
    record(world, "world");
    record(other, "flight");
    cosim::SimulationNode world_node(world, "world");
    world_node.read("/flight/motor/command", port(world, "world.wheels.command"), Latency::next_instant);
    Mortal flight(first, 500), again(other, -1);
    cosim::ControllerConfig config;
    config.simulation = "nadir_spin";
    config.nodes = {{"world"}, {"flight", cosim::Policy::restart}};
    config.nodes[1].save_every = 60 * second;
    config.end = run_end;
    config.seed = seed;
    cosim::RouterConfig router_config;
    router_config.address = "inproc://fledge-restart";
    zmq::context_t context;
    cosim::Router router(context, config, router_config);
    router.host("world", world_node);
    router.host("flight", flight);
    EXPECT_EQ(router.run([&] {
        if (router.controller().state(1) == std::string("lost")) {
            router.host("flight", again);
        }
        return true;
    }),
              "");
    EXPECT_EQ(again.start_, 240 * second);
    const Hashes wanted = hashes(together);
    for (const auto &[topic, hash] : hashes(world)) {
        EXPECT_EQ(hash, wanted.at(topic)) << topic;
    }
    // What flight records goes on after the snapshot, as if it had never died.
    for (const auto &log : other.recorder().logs()) {
        const auto whole = std::find_if(together.recorder().logs().begin(), together.recorder().logs().end(),
                                        [&](const auto &l) { return l->topic() == log->topic(); });
        ASSERT_EQ(log->times.size(), 320u) << log->topic();
        EXPECT_EQ(log->times.front(), 240'500 * ms);
        EXPECT_TRUE(std::equal(log->bytes.rbegin(), log->bytes.rend(), (*whole)->bytes.rbegin())) << log->topic();
    }
}

TEST(CosimIdentity, FlightMayJoinLate)
{
    sim::Simulation world(0), late(0);
    build_world(world);
    build_flight(late);
    record(late, "flight");
    cosim::SimulationNode world_node(world, "world");
    Mortal flight(late, -1);
    cosim::ControllerConfig config;
    config.simulation = "nadir_spin";
    config.nodes = {{"world"}, {"flight"}};
    config.nodes[1].joins = cosim::Join::at_time;
    config.nodes[1].joins_after = 100 * second;
    config.end = run_end;
    config.seed = seed;
    cosim::RouterConfig router_config;
    router_config.address = "inproc://fledge-late";
    zmq::context_t context;
    cosim::Router router(context, config, router_config);
    router.host("world", world_node);
    router.host("flight", flight);
    EXPECT_EQ(router.run(), "");
    for (const auto &log : late.recorder().logs()) {
        ASSERT_EQ(log->times.size(), 600u) << log->topic();
        EXPECT_EQ(log->times.front(), 100'500 * ms);
    }
    const auto error = late.recorder().logs().front();
    EXPECT_TRUE(std::any_of(error->bytes.begin(), error->bytes.end(), [](std::byte b) { return b != std::byte{0}; }));
}

} // namespace cosim_identity_test
