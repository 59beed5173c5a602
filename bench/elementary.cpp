// SPDX-License-Identifier: Apache-2.0
// The elementary functions of flight and world by name.
#include "flight/math/elementary.h"
#include "bench/bench.h"

#include <cstring>

double elementary(const char *function, double x)
{
    constexpr struct {
        const char *name;
        double (*call)(double);
    } all[] = {{"sin", fm_sin},   {"cos", fm_cos},   {"tan", fm_tan}, {"asin", fm_asin},
               {"acos", fm_acos}, {"atan", fm_atan}, {"exp", fm_exp}, {"log", fm_log}};
    for (const auto &each : all) {
        if (std::strcmp(each.name, function) == 0) {
            return each.call(x);
        }
    }
    return NAN;
}
