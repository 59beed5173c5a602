// SPDX-License-Identifier: Apache-2.0
// The host's floating-point unit with the guest's rounding mode, and with flags that stay set from operation to
// operation: fast engines do not read them after each one, because that costs more than the operation.
#pragma once

#include <cfenv>
#include <cstdint>

#ifdef __SSE2__
#include <xmmintrin.h>
#endif

#include "emulator/cpu/state.h"

namespace fledge::emulator {

#ifdef __SSE2__
/// The exceptions in the host's MXCSR, as in the field cexc of the FSR.
inline std::uint32_t exceptions(unsigned mxcsr)
{
    const auto bit = [mxcsr](unsigned flag, std::uint32_t e) { return (mxcsr & flag) != 0 ? e : 0; };
    return bit(_MM_EXCEPT_INVALID, fsr::invalid) | bit(_MM_EXCEPT_DIV_ZERO, fsr::division_by_zero) |
           bit(_MM_EXCEPT_OVERFLOW, fsr::overflow) | bit(_MM_EXCEPT_UNDERFLOW, fsr::underflow) |
           bit(_MM_EXCEPT_INEXACT, fsr::inexact);
}
#endif

/// Between construction and `leave`, the host computes for the guest. Nothing else may compute with floating point in
/// this time: neither devices nor the library.
class HostFpu {
public:
    explicit HostFpu(std::uint32_t guest_fsr)
    {
        const std::uint32_t mode = guest_fsr >> fsr::rounding_shift;
#ifdef __SSE2__
        constexpr unsigned rounding[] = {_MM_ROUND_NEAREST, _MM_ROUND_TOWARD_ZERO, _MM_ROUND_UP, _MM_ROUND_DOWN};
        before_ = _mm_getcsr();
        _mm_setcsr(_MM_MASK_MASK | rounding[mode]);
#else
        constexpr int rounding[] = {FE_TONEAREST, FE_TOWARDZERO, FE_UPWARD, FE_DOWNWARD};
        std::feholdexcept(&before_);
        std::fesetround(rounding[mode]);
#endif
    }

    /// The exceptions since the construction, as in the field cexc of the FSR.
    std::uint32_t leave()
    {
#ifdef __SSE2__
        const unsigned raised = _mm_getcsr();
        _mm_setcsr(before_);
        return exceptions(raised);
#else
        const int raised = std::fetestexcept(FE_ALL_EXCEPT);
        std::fesetenv(&before_);
        const auto bit = [raised](int flag, std::uint32_t e) { return (raised & flag) != 0 ? e : 0; };
        return bit(FE_INVALID, fsr::invalid) | bit(FE_DIVBYZERO, fsr::division_by_zero) |
               bit(FE_OVERFLOW, fsr::overflow) | bit(FE_UNDERFLOW, fsr::underflow) | bit(FE_INEXACT, fsr::inexact);
#endif
    }

private:
#ifdef __SSE2__
    unsigned before_;
#else
    std::fenv_t before_;
#endif
};

} // namespace fledge::emulator
