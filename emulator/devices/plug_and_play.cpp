// SPDX-License-Identifier: Apache-2.0
#include "emulator/devices/plug_and_play.h"

#include <bit>

namespace fledge::emulator {

namespace {

constexpr std::size_t slaves_at = 0x800 / 4, ahb_entry = 8, first_bar = 4;

std::uint32_t id_word(const PlugAndPlayEntry &e)
{
    return e.identity.vendor << 24 | e.identity.device << 12 | e.identity.version << 5 | e.interrupt;
}

/// Address and mask of twelve bits each, for units of so many bytes, and the type of the entry.
std::uint32_t bar(const PlugAndPlayEntry &e, std::uint32_t unit, std::uint32_t type)
{
    const std::uint32_t units = std::bit_ceil(std::uint64_t{e.size} > unit ? (e.size - 1) / unit + 1 : 1u);
    return (e.address / unit & 0xFFF) << 20 | (~(units - 1) & 0xFFF) << 4 | type;
}

} // namespace

void PlugAndPlay::add_master(const PlugAndPlayEntry &e)
{
    words_[masters_++ * ahb_entry] = id_word(e);
}

void PlugAndPlay::add_slave(const PlugAndPlayEntry &e)
{
    const std::size_t at = slaves_at + slaves_++ * ahb_entry;
    words_[at] = id_word(e);
    words_[at + first_bar] = bar(e, 1u << 20, 2);
}

void PlugAndPlay::add_apb(const PlugAndPlayEntry &e)
{
    words_[apb_ * 2] = id_word(e);
    words_[apb_ * 2 + 1] = bar(e, 256, 1);
    apb_++;
}

} // namespace fledge::emulator
