// SPDX-License-Identifier: Apache-2.0
// The cost of an update of the filters and ephemerides, with new measurements at each.
#include "bench/bench.h"

extern "C" {
#include "flight/navigation/attitude_mekf.h"
#include "flight/navigation/attitude_ukf.h"
#include "flight/navigation/chebyshev_ephemeris.h"
#include "flight/navigation/element_ephemeris.h"
#include "flight/sensing/sun_line.h"
}

#include <chrono>
#include <cstring>

namespace {

constexpr std::int64_t tenth = 100'000'000;

/// [s] of an update, of those alone for which `timed` holds.
template <class Module, class Prepare, class Timed>
double seconds(Module &m, void (*update)(Module *, Tick), long n, Prepare prepare, Timed timed)
{
    using clock = std::chrono::steady_clock;
    clock::duration total{}, overhead{};
    for (int i = 0; i < 1000; i++) { // what reading the clock costs
        const auto start = clock::now();
        overhead += clock::now() - start;
    }
    long count = 0;
    for (std::int64_t i = 0; count < n; i++) {
        const Tick tick{i * tenth, i ? tenth : 0};
        prepare(m, i, tick.t);
        const auto start = clock::now();
        update(&m, tick);
        if (timed(i)) {
            total += clock::now() - start - overhead / 1000;
            count++;
        }
    }
    return std::chrono::duration<double>(total).count() / static_cast<double>(n);
}

/// At rest, so that measured attitudes fit for ever. Kind 0: without them; 1: one at each update; 2: one in 16.
template <class Filter> double attitude(void (*update)(Filter *, Tick), int kind, long n)
{
    Filter m{};
    m.par = {1e-10, 1e-14, 1e-4, 1e-5, 5, 1, 10, 3, 0};
    m.in.gyro.head = m.in.stars.head = {0, QUALITY_GOOD, 1};
    m.in.stars.sigma_BN = {{0.1, -0.2, 0.3}};
    for (int i = 0; i < 3; i++) {
        m.in.stars.P_B.m[i][i] = 1e-10;
    }
    const auto measured = [=](std::int64_t i) { return kind == 1 || (kind == 2 ? i % 16 == 15 : i == 0); };
    return seconds(
        m, update, n,
        [=](Filter &f, std::int64_t i, std::int64_t t) {
            f.in.gyro.head.t = t;
            f.in.stars.head.t = measured(i) ? t : f.in.stars.head.t;
        },
        [=](std::int64_t i) { return i > 0 && measured(i) == (kind > 0); });
}

double sun_line(int kind, long n)
{
    SunLine m{};
    m.par = {0.01, 0.05, 1e-8, 1e-14, 1e-3, 5, 0.1, 1, 5, 0};
    m.in.cosines.head = {0, QUALITY_GOOD, 1};
    m.in.cosines.n = 8;
    const Vec3 s = vec_unit(Vec3{{0.3, 0.2, 1}});
    for (unsigned i = 0; i < 8; i++) {
        m.in.cosines.axes_B[i] = vec_unit(Vec3{{i & 1 ? 1.0 : -1.0, i & 2 ? 1.0 : -1.0, i & 4 ? 1.0 : -1.0}});
        m.in.cosines.cosine[i] = vec_dot(m.in.cosines.axes_B[i], s);
        m.in.cosines.lit |= m.in.cosines.cosine[i] > 0.1 ? 1u << i : 0u;
        m.in.cosines.weight[i] = 1;
    }
    m.in.gyro.head.quality = kind == 0 ? QUALITY_GOOD : QUALITY_NONE;
    return seconds(
        m, sun_line_update, n,
        [](SunLine &f, std::int64_t, std::int64_t t) { f.in.cosines.head.t = f.in.gyro.head.t = t; },
        [](std::int64_t i) { return i > 0; });
}

double chebyshev(long n)
{
    ChebyshevEphemeris m{};
    m.par.duration = INT64_MAX;
    m.par.segments = 1;
    m.par.n = EPHEMERIS_TERMS;
    m.par.c[0][3] = {{1, 2, 3}};
    return seconds(
        m, chebyshev_ephemeris_update, n, [](auto &, auto, auto) {}, [](auto) { return true; });
}

double elements(long n)
{
    ElementEphemeris m{};
    m.par.mu = 3.986004415e14;
    m.par.a = 7e6;
    m.par.e = 0.01;
    m.par.i = 1.7;
    m.par.J2 = 1.08e-3;
    m.par.radius = 6378e3;
    return seconds(
        m, element_ephemeris_update, n, [](auto &, auto, auto) {}, [](auto) { return true; });
}

} // namespace

double time_filter_update(const char *module, int kind, long n)
{
    const auto is = [&](const char *name) { return std::strcmp(module, name) == 0; };
    return is("AttitudeMekf")         ? attitude(attitude_mekf_update, kind, n)
           : is("AttitudeUkf")        ? attitude(attitude_ukf_update, kind, n)
           : is("SunLine")            ? sun_line(kind, n)
           : is("ChebyshevEphemeris") ? chebyshev(n)
           : is("ElementEphemeris")   ? elements(n)
                                      : -1.0;
}
