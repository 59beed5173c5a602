// SPDX-License-Identifier: Apache-2.0
#include "world/avionics/radio_model.h"

#include "flight/math/attitude.h"
#include "world/avionics/link_budget.h"
#include "world/constants.h"
#include "world/eigen.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>

namespace fledge::world {

using Eigen::Vector3d;
using sim::Ns;

namespace {

constexpr std::uint32_t usual_room = 1u << 16;
constexpr double floor_below_axis = 30.0; // [dB]

constexpr std::uint64_t words(std::uint64_t bytes)
{
    return (bytes + 7) / 8 * 8;
}

double angle_between(const Vector3d &a, const Vector3d &b)
{
    return fm_atan2(a.cross(b).norm(), a.dot(b));
}

} // namespace

// --- set-up ----------------------------------------------------------------------------------------

void RadioModel::prepare(const sim::Setup &setup)
{
    EnvironmentModel::prepare(setup);
    const auto &par = interface_.par;
    if (!view(par.axis_B).isZero(0.0) && !(par.beam > 0.0)) {
        refuse(".beam is missing: the width of the antenna's beam at half power, or no axis_B");
    }
    if (has_body() && !(par.station_beam > 0.0 && par.station_noise > 0.0 && par.sun_brightness > 0.0)) {
        refuse(".sun: give station_beam, station_noise and sun_brightness too, by which it raises the noise");
    }
    seeded_down_ = {setup.seed, setup.name + ".down"};
    seeded_up_ = {setup.seed, setup.name + ".up"};
    // The lowest number is the barycentre of the solar system, if the ephemeris has it.
    origin_moves_ = sky() && sky()->center() != 0 && sky()->ephemeris().bodies().front() == 0;
    origin_ = {};
    allocate();
}

void RadioModel::allocate()
{
    const auto &par = interface_.par;
    const std::uint64_t down = words(par.down_room ? par.down_room : usual_room);
    const std::uint64_t up = words(par.up_room ? par.up_room : usual_room);
    static_assert(std::is_trivially_copyable_v<State> && sizeof(State) % 8 == 0 && sizeof(Sent) % 8 == 0);
    memory_.assign((sizeof(State) + down + up) / 8, 0);
    State &s = *new (memory_.data()) State{};
    s.now = -1;
    s.down.place = sizeof(State);
    s.down.room = down;
    s.up.place = sizeof(State) + down;
    s.up.room = up;
    reseed();
}

void RadioModel::refresh()
{
    EnvironmentModel::refresh();
    if (state().now < 0) {
        allocate();
    }
}

void RadioModel::reseed()
{
    state().down.random = seeded_down_;
    state().up.random = seeded_up_;
}

void RadioModel::reset(Ns)
{
    station_.check(name(), "station");
    if (static_cast<bool>(sky()) != static_cast<bool>(station_->sky()) ||
        (sky() && !sky()->has_frame_of(*station_->sky()))) {
        refuse(".sky and the sky of its station must be the same");
    }
    interface_.out = {};
    allocate();
}

void RadioModel::copy_setup(const sim::Model &original,
                            const std::function<sim::Model *(const sim::Model *)> &counterpart)
{
    EnvironmentModel::copy_setup(original, counterpart);
    const auto &other = dynamic_cast<const RadioModel &>(original);
    serves_ = other.serves_;
    station_.copy(other.station_, counterpart);
}

// --- the links -------------------------------------------------------------------------------------

/// [m] N's origin from the barycentre of the solar system: light does not share its motion.
Vector3d RadioModel::origin(Ns start, double tau) const
{
    return origin_moves_ ? Vector3d(-sky()->position(0, start, tau, origin_)) : Vector3d::Zero();
}

RadioLink RadioModel::link(Ns t, bool up, Head last) const
{
    const auto &par = interface_.par;
    const CraftState &truth = interface_.in.truth;
    const Vector3d here = view(truth.r_BN_N) + origin(t, 0.0);
    const double sense = up ? -1.0 : 1.0; // the station before, or after
    RadioLink out{};
    out.head = head_next(last, t, quality_through(truth.head));

    GroundStationModel::Place place;
    Vector3d way;
    for (int i = 0; i < 4; i++) { // each is nearer by a factor of speed over that of light
        const double at = sense * out.light_time;
        place = station_->at(t, at);
        way = place.r_N + origin(t, at) - here;
        out.range = way.norm();
        out.light_time = out.range / speed_of_light;
    }
    const Vector3d to_station = way / out.range;
    out.elevation = fm_asin(std::clamp(-to_station.dot(place.up_N), -1.0, 1.0));
    if (!view(par.axis_B).isZero(0.0)) {
        const Mat3 dcm_BN = mrp_to_dcm(truth.sigma_BN);
        out.off_axis = angle_between(view(dcm_BN).transpose() * view(par.axis_B), way);
        out.gain_dB = -pattern_loss(out.off_axis, par.beam, par.floor_dB > 0.0 ? par.floor_dB : floor_below_axis);
    }
    out.sun_angle = std::numbers::pi;
    if (has_body()) {
        const Vector3d to_sun = r_PN_N(0, t, sense * out.light_time) - place.r_N;
        out.sun_angle = angle_between(to_sun, -way);
        const double radius = fm_asin(std::min(bodies()[0].radius / to_sun.norm(), 1.0));
        const double noise = up ? 0.0 : par.sun_brightness * beam_share(out.sun_angle, radius, par.station_beam);
        out.noise_dB = decibels(1.0 + noise / par.station_noise);
    }
    bool hidden = false;
    const GravityBody &ground = station_->bodies()[0];
    for (std::size_t i = 1; i < bodies().size(); i++) {
        const GravityBody &body = bodies()[i];
        if (body.naif ? body.naif == ground.naif : body.name == ground.name) {
            continue; // the station stands on it, and has a horizon
        }
        // Where the body is when the ray passes it.
        double along = 0.0;
        Vector3d off;
        for (int k = 0; k < 3; k++) {
            const double at = sense * along / speed_of_light;
            const Vector3d to_body = r_PN_N(i, t, at) + origin(t, at) - here;
            along = std::clamp(to_body.dot(to_station), 0.0, out.range);
            off = to_body - along * to_station;
        }
        hidden = hidden || off.norm() < body.radius;
    }
    out.loss_dB = free_space_loss(out.range, up ? par.up_frequency : par.down_frequency);
    out.c_n0_dBHz = (up ? par.up_eirp_dBW : par.down_eirp_dBW) + out.gain_dB - out.loss_dB -
                    (up ? par.up_loss_dB : par.down_loss_dB) + (up ? par.up_g_t_dBK : par.down_g_t_dBK) - out.noise_dB -
                    decibels(boltzmann);
    out.eb_n0_dB = out.c_n0_dBHz - decibels(up ? par.up_rate : par.down_rate);
    out.bit_error_rate = bit_error_rate(up ? par.up_code : par.down_code, ratio(out.eb_n0_dB));
    out.state = !supplied(&interface_.in.power, par.load)                         ? RADIO_OFF
                : out.elevation < station_->mask()                                ? RADIO_LOW
                : hidden                                                          ? RADIO_HIDDEN
                : out.eb_n0_dB < (up ? par.up_required_dB : par.down_required_dB) ? RADIO_WEAK
                                                                                  : RADIO_LOCKED;
    out.lock = out.state == RADIO_LOCKED;
    return out;
}

void RadioModel::update(Tick tick)
{
    settle(tick.t - 1); // as the link was until now
    publish(tick.t);
}

void RadioModel::publish(Ns t)
{
    State &s = state();
    auto &out = interface_.out;
    if (head_written(interface_.in.truth.head)) {
        out.down = link(t, false, out.down.head);
        out.up = link(t, true, out.up.head);
        const auto take = [](Way &way, const RadioLink &from) {
            way.light_time = static_cast<Ns>(std::llround(1e9 * from.light_time));
            way.bit_error_rate = from.bit_error_rate;
            way.lock = from.lock;
        };
        take(s.down, out.down);
        take(s.up, out.up);
    }
    settle(t);
    const auto add = [t](RadioTraffic &to, const RadioTraffic &from) {
        const Head head = head_next(to.head, t, QUALITY_GOOD);
        to = from;
        to.head = head;
    };
    add(out.down_traffic, s.down.traffic);
    add(out.up_traffic, s.up.traffic);
}

// --- the bytes -------------------------------------------------------------------------------------

RadioModel::Sent &RadioModel::unit(const Way &way, std::uint64_t at)
{
    return *reinterpret_cast<Sent *>(reinterpret_cast<std::byte *>(memory_.data()) + way.place + at);
}

const RadioModel::Sent &RadioModel::unit(const Way &way, std::uint64_t at) const
{
    return *reinterpret_cast<const Sent *>(reinterpret_cast<const std::byte *>(memory_.data()) + way.place + at);
}

void RadioModel::send(Way &way, double rate, Ns t, sim::Unit bytes_of)
{
    settle(t);
    const std::uint64_t size = sizeof(Sent) + words(bytes_of.size());
    if (way.end - way.begin + size > way.room) {
        way.traffic.dropped++;
        return;
    }
    if (way.end + size > way.room) {
        std::memmove(&unit(way, 0), &unit(way, way.begin), way.end - way.begin);
        way.open -= way.begin;
        way.end -= way.begin;
        way.begin = 0;
    }
    const Ns begins = std::max(state().now, way.free);
    way.free = begins + static_cast<Ns>(std::ceil(8e9 * static_cast<double>(bytes_of.size()) / rate));
    Sent &sent =
        *new (&unit(way, way.end)) Sent{begins, way.free, 0, static_cast<std::uint32_t>(bytes_of.size()), Sent::whole};
    std::copy(bytes_of.begin(), bytes_of.end(), bytes(sent).begin());
    way.end += size;
    way.traffic.sent++;
    way.traffic.waiting += sent.n;
    settle(t);
}

void RadioModel::settle(Ns t)
{
    State &s = state();
    s.now = std::max(s.now, t);
    // What leaves the spacecraft has the link of the instant at which it leaves; what reaches it, that of its arrival.
    while (s.down.open < s.down.end && unit(s.down, s.down.open).begins <= s.now) {
        decide(s.down, unit(s.down, s.down.open));
    }
    while (s.up.open < s.up.end && unit(s.up, s.up.open).ends + s.up.light_time <= s.now) {
        decide(s.up, unit(s.up, s.up.open));
    }
    deliver(s.down, s.now, [this](Ns at, sim::Unit unit) { ground_.put(at, unit); });
}

void RadioModel::decide(Way &way, Sent &sent)
{
    way.open += sizeof(Sent) + words(sent.n);
    sent.arrives = way.last = std::max(sent.ends + way.light_time, way.last);
    sent.fate = !way.lock ? Sent::lost : damage(way, bytes(sent)) ? Sent::damaged : Sent::whole;
}

bool RadioModel::damage(Way &way, std::span<std::uint8_t> bytes)
{
    const double p = way.bit_error_rate;
    if (!(p > 0.0)) {
        return false;
    }
    // From wrong bit to wrong bit: how many right ones are between has a geometric distribution.
    const double scale = p < 1e-8 ? -p : fm_log(1.0 - p);
    const double n = 8.0 * static_cast<double>(bytes.size());
    double at = -1.0;
    bool wrong = false;
    while ((at += 1.0 + std::floor(fm_log(1.0 - way.random.uniform()) / scale)) < n) {
        const auto bit = static_cast<std::size_t>(at);
        bytes[bit / 8] ^= static_cast<std::uint8_t>(0x80u >> bit % 8);
        wrong = true;
    }
    return wrong;
}

void RadioModel::deliver(Way &way, Ns t, const std::function<void(Ns, sim::Unit)> &to)
{
    while (way.begin < way.open && unit(way, way.begin).arrives <= t) {
        Sent &sent = unit(way, way.begin);
        way.begin += sizeof(Sent) + words(sent.n);
        way.traffic.waiting -= sent.n;
        if (sent.fate == Sent::lost) {
            way.traffic.lost++;
            continue;
        }
        way.traffic.received++;
        way.traffic.damaged += sent.fate == Sent::damaged;
        way.traffic.bytes += sent.n;
        to(sent.arrives, bytes(sent));
    }
}

void RadioModel::receive(Ns t, const std::function<void(sim::Unit)> &to)
{
    settle(t);
    deliver(state().up, t, [&](Ns, sim::Unit unit) { to(unit); });
}

std::vector<sim::Packet> RadioModel::take(Ns t)
{
    settle(t);
    return ground_.take();
}

Ns RadioModel::next(const Way &way) const
{
    if (way.begin == way.end) {
        return std::numeric_limits<Ns>::max();
    }
    const Sent &sent = unit(way, way.begin);
    return way.begin < way.open ? sent.arrives : sent.ends + way.light_time;
}

} // namespace fledge::world
