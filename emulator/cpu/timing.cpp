// SPDX-License-Identifier: Apache-2.0
#include "emulator/cpu/timing.h"

namespace fledge::emulator {

Timing plain_timing()
{
    Timing timing;
    timing.cycles.fill(1);
    return timing;
}

Timing leon3_timing()
{
    Timing timing = plain_timing();
    const auto cost = [&timing](std::uint8_t cycles, std::initializer_list<Op> ops) {
        for (Op op : ops) {
            timing.cycles[static_cast<std::size_t>(op)] = cycles;
        }
    };
    cost(3, {Op::jmpl, Op::rett});
    cost(2, {Op::ldd, Op::ldda, Op::lddf});
    cost(2, {Op::st, Op::stb, Op::sth, Op::sta, Op::stba, Op::stha, Op::stf, Op::stfsr});
    cost(3, {Op::std_, Op::stda, Op::stdf});
    cost(5, {Op::ldstub, Op::ldstuba, Op::swap, Op::swapa, Op::casa});
    cost(4, {Op::umul, Op::smul, Op::umulcc, Op::smulcc});
    cost(35, {Op::udiv, Op::sdiv, Op::udivcc, Op::sdivcc});
    cost(4, {Op::fmovs, Op::fnegs, Op::fabss,  Op::fadds, Op::faddd,  Op::fsubs, Op::fsubd,
             Op::fmuls, Op::fmuld, Op::fsmuld, Op::fitos, Op::fitod,  Op::fdtos, Op::fstod,
             Op::fstoi, Op::fdtoi, Op::fcmps,  Op::fcmpd, Op::fcmpes, Op::fcmped});
    cost(16, {Op::fdivs});
    cost(17, {Op::fdivd});
    cost(24, {Op::fsqrts});
    cost(25, {Op::fsqrtd});
    timing.trap = 5;
    timing.annulled = 1;
    return timing;
}

} // namespace fledge::emulator
