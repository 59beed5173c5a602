// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "flight/msg/head.h"

#include <chrono>

/// [s] per call of a module's update at 2 Hz. `before` may change the inputs; its time counts.
template <class T, class Before> double seconds_per_call(void (*update)(T *, Tick), T &module, long n, Before before)
{
    const auto start = std::chrono::steady_clock::now();
    Tick tick{0, 500'000'000};
    for (long i = 0; i < n; i++) {
        tick.t += tick.dt;
        before(module, i, tick.t);
        update(&module, tick);
    }
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
    return elapsed.count() / static_cast<double>(n);
}

template <class T> double seconds_per_call(void (*update)(T *, Tick), T &module, long n)
{
    return seconds_per_call(update, module, n, [](T &, long, int64_t) {});
}
