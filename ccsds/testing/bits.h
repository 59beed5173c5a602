// SPDX-License-Identifier: Apache-2.0
// What the tests of ccsds/ share: bytes, the bits that standards print, and real data.
#ifndef CCSDS_TESTING_BITS_H
#define CCSDS_TESTING_BITS_H

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <random>
#include <string>
#include <vector>

namespace ccsds::testing {

using Bytes = std::vector<std::uint8_t>;

/// The path of a file of real data: in FLEDGE_TEST_DATA, or ../shared/data of the repository.
inline std::string real_file(const std::string &name)
{
    const char *folder = std::getenv("FLEDGE_TEST_DATA");
    return (folder != nullptr ? folder : FLEDGE_ROOT "/../shared/data") + ("/" + name);
}

/// n random bytes.
inline Bytes any_bytes(std::mt19937 &random, std::size_t n)
{
    Bytes found(n);
    for (std::uint8_t &byte : found) {
        byte = static_cast<std::uint8_t>(random());
    }
    return found;
}

/// The bytes that hex digits name.
inline Bytes from_hex(const std::string &digits)
{
    Bytes found;
    for (std::size_t i = 0; i + 1 < digits.size(); i += 2) {
        found.push_back(static_cast<std::uint8_t>(std::stoi(digits.substr(i, 2), nullptr, 16)));
    }
    return found;
}

/// n bits of a value, as the digits of a text.
inline std::string bits(std::uint32_t value, int n)
{
    std::string text;
    for (int i = n; i-- > 0;) {
        text += (value >> i & 1u) != 0 ? '1' : '0';
    }
    return text;
}

/// The first n bytes, as digits.
inline std::string bits(const Bytes &bytes, std::size_t n)
{
    std::string text;
    for (std::size_t i = 0; i < n; i++) {
        text += bits(bytes[i], 8);
    }
    return text;
}

} // namespace ccsds::testing

#endif
