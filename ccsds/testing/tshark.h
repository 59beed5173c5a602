// SPDX-License-Identifier: Apache-2.0
// Wireshark as a decoder of packets that is not ours.
#ifndef CCSDS_TESTING_TSHARK_H
#define CCSDS_TESTING_TSHARK_H

#include "ccsds/bytes.h"
#include "ccsds/testing/bits.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>
#include <initializer_list>
#include <regex>

namespace ccsds::testing {

/// Write packets as a capture of link type 147, the first of those for private use.
inline void write_capture(const std::string &path, const std::vector<Bytes> &packets)
{
    std::ofstream file(path, std::ios::binary);
    const auto put = [&](std::initializer_list<std::uint32_t> words) {
        for (const std::uint32_t word : words) {
            std::uint8_t bytes[4];
            ccsds_put32(bytes, word);
            file.write(reinterpret_cast<const char *>(bytes), sizeof bytes);
        }
    };
    put({0xA1B2C3D4, 0x00020004, 0, 0, 131072, 147}); // big-endian, version 2.4
    for (const Bytes &packet : packets) {
        const auto n = static_cast<std::uint32_t>(packet.size());
        put({0, 0, n, n});
        file.write(reinterpret_cast<const char *>(packet.data()), n);
    }
}

/// What tshark prints of such a capture.
inline std::string tshark(const std::string &path, const std::string &arguments)
{
    const std::string command = "tshark -n -r " + path +
                                " -o 'uat:user_dlts:\"User 0 (DLT=147)\",\"ccsds\",\"0\",\"\",\"0\",\"\"' " +
                                arguments + " 2> /dev/null";
    std::FILE *pipe = popen(command.c_str(), "r");
    std::string text;
    char part[4096];
    for (std::size_t n; pipe != nullptr && (n = fread(part, 1, sizeof part, pipe)) != 0;) {
        text.append(part, n);
    }
    EXPECT_EQ(pclose(pipe), 0);
    // Flags, of which version 4.4 prints words.
    text = std::regex_replace(text, std::regex("\\bTrue\\b"), "1");
    return std::regex_replace(text, std::regex("\\bFalse\\b"), "0");
}

} // namespace ccsds::testing

#endif
