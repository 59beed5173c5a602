// SPDX-License-Identifier: Apache-2.0
// The cost of spherical-harmonic gravity.
#include "world/environment/harmonics.h"
#include "bench/bench.h"

#include <cmath>
#include <random>
#include <vector>

#include <time.h>

using Eigen::Vector3d;
using fledge::world::HarmonicField;
using fledge::world::Harmonics;

namespace {

constexpr double radius = 6378136.3;

/// A field like the Earth's in size: random coefficients after Kaula's rule, and its flattening.
HarmonicField field_of(int degree)
{
    HarmonicField field = HarmonicField::zero(3.986004415e14, radius, degree);
    std::mt19937 random(1);
    for (int n = 2; n <= degree; n++) {
        for (int m = 0; m <= n; m++) {
            const auto any = [&] { return 1e-5 / (n * n) * (static_cast<double>(random()) * 0x1p-31 - 1.0); };
            field.C[HarmonicField::index(n, m)] = any();
            field.S[HarmonicField::index(n, m)] = m > 0 ? any() : 0.0;
        }
    }
    if (degree >= 2) {
        field.C[HarmonicField::index(2, 0)] = -4.84e-4;
    }
    return field;
}

/// Along a low orbit of 53 degrees inclination.
std::vector<Vector3d> orbit()
{
    std::vector<Vector3d> points;
    for (int i = 0; i < 628; i++) {
        const double u = 0.01 * i;
        points.push_back((radius + 4e5) * Vector3d(std::cos(u), 0.6 * std::sin(u), 0.8 * std::sin(u)));
    }
    return points;
}

/// [s] of this thread's work, whatever else the machine does.
double now()
{
    timespec time;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

} // namespace

double time_harmonics(int degree, long n)
{
    const Harmonics gravity(field_of(degree));
    // The sum is kept, so that no evaluation can be left out.
    const std::vector<Vector3d> points = orbit();
    Vector3d sum(0, 0, 0);
    std::size_t at = 0;
    const double begin = now();
    for (long i = 0; i < n; i++) {
        sum += gravity.gravity(points[at]);
        at = at + 1 < points.size() ? at + 1 : 0;
    }
    const double end = now();
    const volatile double kept = sum[0] + sum[1] + sum[2];
    (void)kept;
    return (end - begin) / static_cast<double>(n);
}
