// SPDX-License-Identifier: Apache-2.0
// Loops in registers of 256 bits where the processor has them.
//
// `in_registers<&Model::loop>(*this, x, dx)` calls the member function `loop`, which is [[gnu::always_inline]] and
// returns nothing. The compiler builds it twice, for wide registers and for narrow ones, and `wide` chooses. Neither
// build fuses products and sums, so that both give the same bits.
#pragma once

namespace fledge::sim {

#if defined(__x86_64__)
#define FLEDGE_WIDE [[gnu::target("avx2")]]
inline bool wide = __builtin_cpu_supports("avx2"); ///< only tests change it
#else
#define FLEDGE_WIDE
inline bool wide = false;
#endif

/// Both builds of a loop of an Object with these arguments.
template <auto loop, class Object, class... Arguments> struct Builds {
    FLEDGE_WIDE static void in_wide(Object &object, Arguments... arguments) { (object.*loop)(arguments...); }
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
    wide ? BuildsOf<loop>::in_wide(object, arguments...) : BuildsOf<loop>::in_narrow(object, arguments...);
}

} // namespace fledge::sim
