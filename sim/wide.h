// SPDX-License-Identifier: Apache-2.0
// Loops in registers of 256 bits where the processor has them.
//
// `in_registers<&Model::loop>(*this, x, dx)` calls the member function `loop`, which is [[gnu::always_inline]] and
// returns nothing. The compiler builds it for AVX2, for AVX and for narrow registers, and `wide` chooses. No build
// fuses products and sums, so that all give the same bits. The narrow one is slow: gcc stores a vector that is made of
// numbers number by number, and the loads of its pairs wait for that.
#pragma once

#include <cstdlib>
#include <string_view>

namespace fledge::sim {

#if defined(__x86_64__)
#define FLEDGE_WIDE(set) [[gnu::target(set)]]
/// 2 with AVX2, 1 with AVX, 0 with neither; the environment variable FLEDGE_WIDE lowers it. Only tests change it later.
inline int wide = [] {
    const char *wanted = std::getenv("FLEDGE_WIDE");
    const std::string_view most = wanted ? wanted : "";
    return __builtin_cpu_supports("avx2") && most != "0" && most != "1" ? 2
           : __builtin_cpu_supports("avx") && most != "0"               ? 1
                                                                        : 0;
}();
#else
#define FLEDGE_WIDE(set)
inline int wide = 0;
#endif

/// The builds of a loop of an Object with these arguments.
template <auto loop, class Object, class... Arguments> struct Builds {
    FLEDGE_WIDE("avx2") static void in_avx2(Object &object, Arguments... arguments) { (object.*loop)(arguments...); }
    FLEDGE_WIDE("avx") static void in_avx(Object &object, Arguments... arguments) { (object.*loop)(arguments...); }
    static void in_narrow(Object &object, Arguments... arguments) { (object.*loop)(arguments...); }
};

template <auto loop> struct BuildsOf;
template <class Object, class... Arguments, void (Object::*loop)(Arguments...)>
struct BuildsOf<loop> : Builds<loop, Object, Arguments...> {
};
template <class Object, class... Arguments, void (Object::*loop)(Arguments...) const>
struct BuildsOf<loop> : Builds<loop, const Object, Arguments...> {
};

template <auto loop> [[gnu::always_inline]] inline void in_registers(auto &object, auto &&...arguments)
{
    using Of = BuildsOf<loop>;
#if defined(__x86_64__)
    wide == 2   ? Of::in_avx2(object, arguments...)
    : wide == 1 ? Of::in_avx(object, arguments...)
                : Of::in_narrow(object, arguments...);
#else
    Of::in_narrow(object, arguments...);
#endif
}

} // namespace fledge::sim
