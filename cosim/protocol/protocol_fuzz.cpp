// SPDX-License-Identifier: Apache-2.0
// Fuzzes the decoders with libFuzzer, for hours instead of the unit test's second:
//     cmake --preset debug -DCMAKE_C_COMPILER=clang -DCMAKE_CXX_COMPILER=clang++ -DFLEDGE_FUZZ=ON
//     cmake --build --preset debug --target cosim_protocol_fuzz
// Frames are given without their header, whose checksum no fuzzer would guess.
#include "cosim/protocol/protocol.h"

#include "record/mcap_crc.h"

#include <cstdlib>
#include <cstring>

using namespace fledge::cosim;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t *data, std::size_t size)
{
    if (size < 2) {
        return 0;
    }
    McapCrc tables;
    mcap_crc_init(&tables);
    Bytes frame(frame_header_size + size - 2);
    std::memcpy(frame.data(), "FLCS", 4);
    frame[4] = static_cast<std::byte>(data[0] & 1);
    frame[5] = std::byte{protocol_version};
    const auto put = [&](std::size_t at, auto x) { // in the frame's byte order
        for (std::size_t i = 0; i < sizeof x; i++) {
            frame[at + (data[0] & 1 ? i : sizeof x - 1 - i)] = static_cast<std::byte>(x >> 8 * i);
        }
    };
    std::memcpy(frame.data() + frame_header_size, data + 2, size - 2);
    put(6, std::uint16_t{data[1]});
    put(8, static_cast<std::uint32_t>(size - 2));
    put(12, mcap_crc_update(&tables, 0, data + 2, size - 2));
    try {
        if (encode(decode(frame), static_cast<Order>(frame[4])) != frame) {
            std::abort();
        }
    } catch (const ProtocolError &) {
    }
    try {
        parse_schema({reinterpret_cast<const char *>(data), size});
    } catch (const SchemaError &) {
    }
    return 0;
}
