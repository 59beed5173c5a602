// SPDX-License-Identifier: Apache-2.0
#include "world/environment/bodies.h"

#include "sim/error.h"
#include "sim/text.h"
#include "world/environment/text_input.h"

#include <vector>

namespace fledge::world {

namespace {

struct Body {
    int id;
    const char *name;
    double mu;                // [km^3/s^2], 0: not here
    double equatorial, polar; // [km], 0: not here
};

constexpr Body bodies[] = {
    {0, "SOLAR SYSTEM BARYCENTER", 0, 0, 0},
    {1, "MERCURY BARYCENTER", 22031.780000000021, 0, 0},
    {2, "VENUS BARYCENTER", 324858.59200000006, 0, 0},
    {3, "EARTH MOON BARYCENTER", 403503.23550225981, 0, 0},
    {4, "MARS BARYCENTER", 42828.375214000022, 0, 0},
    {5, "JUPITER BARYCENTER", 126712764.80000021, 0, 0},
    {6, "SATURN BARYCENTER", 37940585.200000003, 0, 0},
    {7, "URANUS BARYCENTER", 5794548.6000000080, 0, 0},
    {8, "NEPTUNE BARYCENTER", 6836527.1005800236, 0, 0},
    {9, "PLUTO BARYCENTER", 977.00000000000068, 0, 0},
    {10, "SUN", 132712440041.93938, 696000.0, 696000.0},
    {199, "MERCURY", 22031.780000000021, 2439.7, 2439.7},
    {299, "VENUS", 324858.59200000006, 6051.8, 6051.8},
    {399, "EARTH", 398600.43543609598, 6378.14, 6356.75},
    {301, "MOON", 4902.8000661637961, 1737.4, 1737.4},
    {499, "MARS", 42828.373620699091, 3396.19, 3376.20},
    {599, "JUPITER", 126686534.92180080, 71492.0, 66854.0},
    {699, "SATURN", 37931207.498652240, 60268.0, 54364.0},
    {799, "URANUS", 5793951.3222790090, 25559.0, 24973.0},
    {899, "NEPTUNE", 6835099.5024396720, 24764.0, 24341.0},
    {999, "PLUTO", 869.61381776087480, 1195.0, 1195.0},
    {401, "PHOBOS", 0, 0, 0},
    {402, "DEIMOS", 0, 0, 0},
    {501, "IO", 0, 0, 0},
    {502, "EUROPA", 0, 0, 0},
    {503, "GANYMEDE", 0, 0, 0},
    {504, "CALLISTO", 0, 0, 0},
    {505, "AMALTHEA", 0, 0, 0},
    {514, "THEBE", 0, 0, 0},
    {515, "ADRASTEA", 0, 0, 0},
    {516, "METIS", 0, 0, 0},
    {601, "MIMAS", 0, 0, 0},
    {602, "ENCELADUS", 0, 0, 0},
    {603, "TETHYS", 0, 0, 0},
    {604, "DIONE", 0, 0, 0},
    {605, "RHEA", 0, 0, 0},
    {606, "TITAN", 0, 0, 0},
    {607, "HYPERION", 0, 0, 0},
    {608, "IAPETUS", 0, 0, 0},
    {609, "PHOEBE", 0, 0, 0},
    {701, "ARIEL", 0, 0, 0},
    {702, "UMBRIEL", 0, 0, 0},
    {703, "TITANIA", 0, 0, 0},
    {704, "OBERON", 0, 0, 0},
    {705, "MIRANDA", 0, 0, 0},
    {801, "TRITON", 0, 0, 0},
    {802, "NEREID", 0, 0, 0},
    {901, "CHARON", 0, 0, 0},
};

constexpr struct {
    const char *name;
    int id;
} aliases[] = {{"SSB", 0}, {"EMB", 3}, {"EARTH BARYCENTER", 3}};

const Body *find(int id)
{
    for (const Body &body : bodies) {
        if (body.id == id) {
            return &body;
        }
    }
    return nullptr;
}

[[noreturn]] void refuse(const std::string &what, int id, double Body::*member)
{
    std::vector<std::string> known;
    for (const Body &body : bodies) {
        if (body.*member > 0.0) {
            known.push_back(body_name(body.id));
        }
    }
    throw sim::SetupError("no " + what + " is built in for " + body_name(id) + "; it is for " +
                          sim::format_list(known));
}

} // namespace

std::string body_name(int id)
{
    const Body *body = find(id);
    return body ? std::string(body->name) + " (" + std::to_string(id) + ")" : "body " + std::to_string(id);
}

int body_id(std::string_view name)
{
    if (const auto number = parse_integer(name)) {
        return *number;
    }
    std::string plain;
    for (const char c : name) {
        plain += c == '_' ? ' ' : c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
    }
    std::vector<std::string> known;
    for (const Body &body : bodies) {
        if (plain == body.name) {
            return body.id;
        }
        known.push_back(body.name);
    }
    for (const auto &alias : aliases) {
        if (plain == alias.name) {
            return alias.id;
        }
    }
    throw sim::SetupError("no body is named \"" + std::string(name) + "\"; give a NAIF number or one of " +
                          sim::format_list(known));
}

double body_mu(int id)
{
    const Body *body = find(id);
    if (!body || body->mu == 0.0) {
        refuse("gravitational parameter", id, &Body::mu);
    }
    return body->mu * 1e9;
}

BodyRadii body_radii(int id)
{
    const Body *body = find(id);
    if (!body || body->equatorial == 0.0) {
        refuse("radius", id, &Body::equatorial);
    }
    return {body->equatorial * 1e3, body->polar * 1e3};
}

} // namespace fledge::world
