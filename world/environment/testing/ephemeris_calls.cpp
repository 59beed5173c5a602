// SPDX-License-Identifier: Apache-2.0
// The ephemeris as plain functions, for spk_test.py to hold against jplephem.
#include "world/environment/ephemeris.h"

#include <cstdio>
#include <exception>

extern "C" {

/// Position [m], velocity [m/s] and acceleration [m/s^2], 9 numbers, of a body in a kernel; the
/// time is in whole seconds of TDB past J2000. 0 if it went well.
__attribute__((visibility("default"))) int spk_state(const char *path, int target, int center, long long seconds,
                                                     double *state)
{
    using namespace fledge::world;
    try {
        Ephemeris ephemeris;
        ephemeris.add_spk(path);
        const BodyState s = ephemeris.state(target, center, Epoch{seconds * 1'000'000'000});
        for (int i = 0; i < 3; i++) {
            state[i] = s.r[i];
            state[3 + i] = s.v[i];
            state[6 + i] = s.a[i];
        }
        return 0;
    } catch (const std::exception &error) {
        std::fprintf(stderr, "%s\n", error.what());
        return 1;
    }
}

} // extern "C"
