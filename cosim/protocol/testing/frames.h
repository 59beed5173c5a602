// SPDX-License-Identifier: Apache-2.0
// Frames and messages for tests: one of each kind, changed ones, and definitions.
#pragma once

#include "cosim/protocol/protocol.h"

#include <algorithm>
#include <cstring>
#include <random>

namespace fledge::cosim::testing {

inline constexpr const char *error_text =
    "fledge/Head head  # head\n"
    "float64[3] sigma_br  # sigma_BR [-] (3) attitude error\n"
    "float64[9] p  # P [N m s] (3, 3)\n"
    "int32 mode  # mode {OFF=0, ON=1}\n"
    "float32 x  # x [m]\n"
    "================================================================================\n"
    "MSG: fledge/Head\n"
    "int64 t  # t [ns] time of validity\n"
    "uint32 quality  # quality [-] trust\n"
    "uint32 sequence  # sequence [-] counts\n";

/// A definition with everything that the format allows.
inline constexpr const char *rich_text =
    "fledge/Wheel[3] wheels  # wheels each of them\n"
    "fledge/Nest nest  # nest\n"
    "uint8[12] label  # label (12) a text\n"
    "int32 state  # STATE what it does {IDLE=0, RUN=1, FAULT=-2}\n"
    "\n"
    "# a line of its own\n"
    "uint64[2] serial\n"
    "int64 t  # t [ns]\n"
    "int8[3] small\n"
    "bool on  # on\n"
    "int16 short\n"
    "uint16 word\n"
    "float32[6] grid  # GRID [m/s] (2, 3) with a wrong unit\n"
    "================================================================================\n"
    "MSG: fledge/Wheel\n"
    "float64[3] axis_b  # axis_B [-] (3)\n"
    "fledge/Nest nest  # nest\n"
    "uint32[2] counts  # counts\n"
    "================================================================================\n"
    "MSG: fledge/Nest\n"
    "float64 j  # J [kg m^2] inertia\n"
    "byte[4] raw  # raw\n"
    "char[4] code\n";

inline Schema error_schema()
{
    return make_schema("AttError", error_text);
}

inline Bytes filled(std::size_t n)
{
    Bytes bytes(n);
    for (std::size_t i = 0; i < n; i++) {
        bytes[i] = static_cast<std::byte>(i + 1);
    }
    return bytes;
}

inline std::vector<Frame> one_of_each()
{
    const Schema schema = error_schema();
    const Record record{3, 7, 95, make_payload(filled(120))};
    return {{1, Hello{1, 2, "spin", "flight", Role::asynchronous, true}},
            {2, Welcome{"tcp://127.0.0.1:7000", "/proc/12/fd/7", 0x0123456789abcdef}},
            {3, Refused{"there is a flight already"}},
            {4, Initialize{42, 1'000'000'000, -1, "ipc://@f", "ipc://@b", filled(40)}},
            {5, Initialized{{{100, 0}, {250, 50}}, true, true}},
            {6, ProvideDesired{}},
            {7, Desired{{{"/w/a", Latency::next_exchange, true, schema}, {"/w/b", Latency::same_instant, false, {}}}}},
            {8, Match{{{0, "/f/u", schema}, {1, "/f/v", {"V", "", 0, 0}}}}},
            {9, Matched{{{1, schema, make_payload(filled(120))}}}},
            {10, Start{{{0, "/w/a", schema}}}},
            {11, Ready{}},
            {12, Tick{500, {record, record}}},
            {13, Tock{400, 12345, {record}, true}},
            {14, Finish{"asked"}},
            {15, Finished{}},
            {16, Failed{"a pole"}},
            {17, Attached{"ipc://@f", "ipc://@b", {{0, "/f/u", schema}}}},
            {18, Published{record, "flight"}},
            {19, Save{1'000'000'000}},
            {20, Saved{filled(77)}}};
}

/// Correct the checksum and size of a frame after a change of its body.
inline void seal(Bytes &bytes)
{
    std::uint32_t crc = 0xffffffff; // bit by bit, independent of the tables
    for (std::size_t i = frame_header_size; i < bytes.size(); i++) {
        crc ^= std::to_integer<std::uint32_t>(bytes[i]);
        for (int k = 0; k < 8; k++) {
            crc = crc >> 1 ^ (crc & 1 ? 0xedb88320u : 0u);
        }
    }
    const auto put = [&](std::size_t at, std::uint32_t x) {
        for (std::size_t i = 0; i < 4; i++, x >>= 8) {
            bytes[at + (bytes[4] == std::byte{1} ? i : 3 - i)] = static_cast<std::byte>(x);
        }
    };
    put(8, static_cast<std::uint32_t>(bytes.size() - frame_header_size));
    put(12, ~crc);
}

/// Change a body at random, sometimes the kind, too, and correct the checksum.
inline void change(Bytes &b, std::mt19937 &random)
{
    for (auto changes = 1 + random() % 3; changes && b.size() > frame_header_size; changes--) {
        const auto at = frame_header_size + random() % (b.size() - frame_header_size);
        switch (random() % 4) {
        case 0: b[at] = static_cast<std::byte>(random()); break;
        case 1: b[at] = std::byte{random() % 2 ? std::uint8_t{0xff} : std::uint8_t{0}}; break;
        case 2: b.erase(b.begin() + static_cast<std::ptrdiff_t>(at)); break;
        default: b.insert(b.begin() + static_cast<std::ptrdiff_t>(at), static_cast<std::byte>(random()));
        }
    }
    if (random() % 8 == 0) {
        b[b[4] == std::byte{1} ? 6 : 7] = static_cast<std::byte>(random() % (std::variant_size_v<Message> + 2));
    }
    seal(b);
}

/// Change a definition at random.
inline std::string change(std::string text, std::mt19937 &random)
{
    const std::string alphabet = " \n#[](),:=/{}_aAx9\t\r";
    for (auto changes = 1 + random() % 4; changes; changes--) {
        const auto at = random() % text.size();
        switch (random() % 3) {
        case 0: text[at] = alphabet[random() % alphabet.size()]; break;
        case 1: text.erase(at, 1 + random() % 9); break;
        default: text.insert(at, 1, alphabet[random() % alphabet.size()]);
        }
    }
    return text;
}

} // namespace fledge::cosim::testing
