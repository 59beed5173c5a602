// SPDX-License-Identifier: Apache-2.0
// SPK kernels made for tests: small ones of our own, and real ones in the other byte order.
#pragma once

#include "world/environment/bytes.h"

#include <bit>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace fledge::world::testing {

/// A segment as it will stand in a kernel.
struct MadeSegment {
    int target, center;
    double first, last;
    std::vector<double> words; ///< records, then START, LENGTH, words per record, records
    int type = 2, frame = 1;
};

/// A segment of type 2 with one record: the body moves uniformly, r = r0 + v (t - middle), in km.
inline MadeSegment uniform_motion(int target, int center, double first, double last, double r0, double v)
{
    const double radius = (last - first) / 2.0;
    return {target,
            center,
            first,
            last,
            {first + radius, radius, r0, v * radius, 0.0, 0.0, 0.0, 0.0, first, last - first, 8.0, 1.0}};
}

/// The bytes of a kernel in this machine's order: the first record, one of summaries, one of names,
/// and the segments.
inline std::string made_kernel(const std::vector<MadeSegment> &segments)
{
    std::string bytes(3 * 1024, '\0');
    const auto put = [&](std::size_t at, const auto &value) { std::memcpy(bytes.data() + at, &value, sizeof value); };
    std::memcpy(bytes.data(), "DAF/SPK ", 8);
    put(8, std::int32_t{2});
    put(12, std::int32_t{6});
    put(76, std::int32_t{2});
    put(80, std::int32_t{2});
    std::memcpy(bytes.data() + 88, std::endian::native == std::endian::little ? "LTL-IEEE" : "BIG-IEEE", 8);
    put(1024 + 16, static_cast<double>(segments.size()));
    std::size_t at = 1024 + 24;
    for (const MadeSegment &s : segments) {
        const auto begin = static_cast<std::int32_t>(bytes.size() / 8 + 1);
        bytes.append(reinterpret_cast<const char *>(s.words.data()), 8 * s.words.size());
        put(at, s.first);
        put(at + 8, s.last);
        const std::int32_t integers[6] = {s.target, s.center, s.frame,
                                          s.type,   begin,    static_cast<std::int32_t>(bytes.size() / 8)};
        put(at + 16, integers);
        at += 40;
    }
    put(84, static_cast<std::int32_t>(bytes.size() / 8 + 1));
    return bytes;
}

/// The same kernel in the other byte order.
inline std::string turned_kernel(const std::string &kernel)
{
    std::string out = kernel;
    const bool was_little = kernel.compare(88, 8, "LTL-IEEE") == 0;
    const std::endian order = was_little ? std::endian::little : std::endian::big;
    std::memcpy(out.data() + 88, was_little ? "BIG-IEEE" : "LTL-IEEE", 8);
    const auto turn = [&](std::size_t at, std::size_t size) {
        for (std::size_t i = 0; i < size; i++) {
            out[at + i] = kernel[at + size - 1 - i];
        }
    };
    for (const std::size_t at : {8, 12, 76, 80, 84}) {
        turn(at, 4);
    }
    std::vector<bool> done(kernel.size() / 8, false);
    std::size_t record = load<std::uint32_t>(kernel.data() + 76, order);
    while (record != 0) {
        const std::size_t begin = (record - 1) * 1024;
        const auto count = static_cast<std::size_t>(load<double>(kernel.data() + begin + 16, order));
        for (std::size_t i = 0; i < 128; i++) { // the summaries' integers have 4 bytes
            done[begin / 8 + i] = true;
            if (i >= 3 && i < 3 + 5 * count && (i - 3) % 5 >= 2) {
                turn(begin + 8 * i, 4);
                turn(begin + 8 * i + 4, 4);
            } else {
                turn(begin + 8 * i, 8);
            }
        }
        for (std::size_t i = 0; i < 128 && begin / 8 + 128 + i < done.size(); i++) {
            done[begin / 8 + 128 + i] = true; // the record of names
        }
        record = static_cast<std::size_t>(load<double>(kernel.data() + begin, order));
    }
    for (std::size_t i = 128; i < done.size(); i++) {
        if (!done[i]) {
            turn(8 * i, 8);
        }
    }
    return out;
}

} // namespace fledge::world::testing
