// SPDX-License-Identifier: Apache-2.0
// Packets one behind the other in files that are damaged: what is reported was put in, or a note says that it may be
// damaged; what is not is counted. FLEDGE_CASES sets how many files are tried.
#include "ccsds/space_packet.h"
#include "ccsds/testing/bits.h"
#include "ground/capture/packets.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <iostream>
#include <set>
#include <string>

namespace packets_test {

using namespace ccsds::testing;
using namespace fledge::ground;

/// Files of packets of a few applications, with their counts.
struct Maker {
    std::mt19937 random;
    std::vector<std::uint16_t> ids, counts;
    bool steady;       ///< the counts stay 0
    unsigned contents; ///< random, zeros, small numbers

    explicit Maker(unsigned seed)
        : random(seed), ids(1 + random() % 6), counts(ids.size()), steady(random() % 8 == 0), contents(random() % 3)
    {
        for (std::size_t i = 0; i < ids.size(); i++) {
            ids[i] = static_cast<std::uint16_t>(random() % 2047);
            counts[i] = static_cast<std::uint16_t>(steady ? 0 : random() % SPACE_PACKET_COUNTS);
        }
    }
    Bytes packet(std::size_t longest)
    {
        const std::size_t which = random() % ids.size(), n = 7 + random() % longest;
        Bytes made(n);
        for (std::uint8_t &byte : made) {
            byte = static_cast<std::uint8_t>(contents == 0   ? random()
                                             : contents == 1 ? 0
                                                             : random() % 4 * (random() % 3 == 0));
        }
        made.back() = 0x5A; // else its end may be padding
        const SpacePacket head{static_cast<std::uint32_t>(n), ids[which], counts[which], 0, 0, SPACE_PACKET_WHOLE};
        space_packet_write(&head, made.data());
        counts[which] = static_cast<std::uint16_t>((counts[which] + (steady ? 0 : 1)) % SPACE_PACKET_COUNTS);
        return made;
    }
};

struct Read {
    std::vector<Bytes> sure, doubtful;
    std::size_t problems = 0, bytes = 0;
};

Read read(const Bytes &file, std::size_t skip = 0)
{
    Read made;
    std::size_t at = 0;
    for (const Found &one : packets_of_bytes(file, skip)) {
        EXPECT_GE(one.at, at); // in order, and nothing twice
        if (!one.problem.empty()) {
            made.problems++;
            made.bytes += std::stoul(one.problem);
            at = one.at + std::stoul(one.problem);
            EXPECT_NE(one.problem.find(" bytes are no packet"), std::string::npos);
            continue;
        }
        at = one.at + one.packet.size();
        made.bytes += skip + one.packet.size();
        (one.note.empty() ? made.sure : made.doubtful).push_back(one.packet);
    }
    return made;
}

void append(Bytes &to, const Bytes &more)
{
    to.insert(to.end(), more.begin(), more.end());
}

unsigned cases(unsigned otherwise)
{
    const char *given = std::getenv("FLEDGE_CASES");
    return given != nullptr ? static_cast<unsigned>(std::strtoul(given, nullptr, 10)) : otherwise;
}

TEST(Packets, a_whole_file_is_read_whole)
{
    for (unsigned seed = 0; seed < cases(1000); seed++) {
        Maker maker(seed);
        Bytes file;
        std::vector<Bytes> all;
        const std::size_t skip = seed % 4 == 0 ? seed / 4 % 9 : 0, longest = seed % 3 == 0 ? 20 : 300;
        for (std::size_t n = maker.random() % 60; n > 0; n--) {
            append(file, any_bytes(maker.random, skip));
            all.push_back(maker.packet(longest));
            append(file, all.back());
            if (n % 16 == 0 && skip == 0) {
                append(file, Bytes(maker.random() % 40, 0));
            }
        }
        const Read found = read(file, skip);
        ASSERT_EQ(found.sure, all) << seed;
        ASSERT_EQ(found.problems + found.doubtful.size(), 0u) << seed;
    }
}

/// Bytes are put in or taken out, also in front. No check tells of a packet whose end was taken out together with what
/// is behind it, if the length happens to fit, nor of a header that became another by a damage: those are counted.
TEST(Packets, behind_damage_none_is_invented_and_few_are_lost)
{
    std::size_t invented = 0, joined = 0, put = 0, recovered = 0, doubtful = 0;
    const unsigned files = cases(1500);
    for (unsigned seed = 0; seed < files; seed++) {
        Maker maker(seed);
        std::vector<Bytes> all;
        Bytes file;
        const std::size_t longest = seed % 3 == 0 ? 20 : seed % 3 == 1 ? 300 : 4000;
        for (std::size_t n = 20 + maker.random() % 80; n > 0; n--) {
            all.push_back(maker.packet(longest));
            append(file, all.back());
        }
        if (maker.random() % 3 == 0) {
            Bytes before = any_bytes(maker.random, 1 + maker.random() % 50);
            append(before, file);
            file = before;
        }
        for (unsigned n = 1 + maker.random() % 3; n > 0; n--) {
            const auto at = file.begin() + static_cast<std::ptrdiff_t>(maker.random() % file.size());
            const std::size_t size = 1 + maker.random() % (maker.random() % 4 ? 30 : 500);
            if (maker.random() % 2 != 0) {
                file.erase(at, at + std::min<std::ptrdiff_t>(static_cast<std::ptrdiff_t>(size), file.end() - at));
            } else {
                const Bytes more = maker.random() % 2 ? any_bytes(maker.random, size) : Bytes(size, 0xE0);
                file.insert(at, more.begin(), more.end());
            }
        }
        const Read found = read(file);
        const std::set<Bytes> known(all.begin(), all.end());
        for (const Bytes &one : found.sure) {
            const bool begins = std::any_of(all.begin(), all.end(), [&](const Bytes &of) {
                return of.size() == one.size() && std::equal(of.begin(), of.begin() + 6, one.begin());
            });
            invented += !begins;
            joined += begins && known.count(one) == 0;
        }
        put += all.size();
        recovered += found.sure.size() + found.doubtful.size();
        doubtful += found.doubtful.size();
    }
    EXPECT_LE(invented, put / 10000);
    EXPECT_LE(joined, put / 4000);
    EXPECT_LE(doubtful, 3 * files);
    EXPECT_GT(recovered, put * 95 / 100);
    if (std::getenv("FLEDGE_CASES") != nullptr) {
        std::cout << put << " packets, " << recovered << " read, " << doubtful << " of them with a note, " << joined
                  << " joined, " << invented << " invented\n";
    }
}

/// Whatever the file, each byte of it belongs to one piece, or is padding.
TEST(Packets, any_bytes_are_taken)
{
    std::mt19937 random(1);
    for (unsigned i = 0; i < cases(2000); i++) {
        Bytes file = any_bytes(random, random() % 3000);
        for (std::uint8_t &byte : file) {
            byte = i % 3 == 0   ? byte
                   : i % 3 == 1 ? byte % 4
                                : static_cast<std::uint8_t>(byte % 8 == 0 ? 0xE0 | byte : 0);
        }
        const Read found = read(file, random() % 3);
        ASSERT_LE(found.bytes, file.size());
    }
    const Bytes zeros(200000, 0), fill(200000, 0xE0);
    EXPECT_EQ(read(zeros).problems + read(fill).problems, 0u);
    EXPECT_TRUE(read(zeros).sure.empty() && read(fill).sure.empty());
}

TEST(Packets, damage_is_named_with_its_place)
{
    Bytes file = from_hex("0005c000000011"
                          "0005c001000022"
                          "9a00"
                          "0005c002000033"
                          "0005c003000044");
    const auto found = packets_of_bytes(file, 0);
    ASSERT_EQ(found.size(), 5u);
    EXPECT_EQ(found[1].note, "what follows it is no packet: it may be damaged, too");
    EXPECT_EQ(found[2].at, 14u);
    EXPECT_EQ(found[2].problem, "2 bytes are no packet: byte 14 is 0x9a, of packet version 4");
    EXPECT_EQ(packets_of_bytes(from_hex("2005c000000011"), 0)[0].problem,
              "7 bytes are no packet: byte 0 is 0x20, of packet version 1");
    file.erase(file.begin() + 5); // in a header
    EXPECT_EQ(packets_of_bytes(file, 0)[0].problem.substr(0, 22), "15 bytes are no packet");
}

} // namespace packets_test
