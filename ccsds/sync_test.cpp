// SPDX-License-Identifier: Apache-2.0
// Randomisers against the sequences that 131.0-B and 231.0-B print; codeblocks against long division; streams of bytes
// with wrong bits, and with bytes that belong to nothing.
#include "ccsds/sync.h"
#include "ccsds/testing/bits.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace sync_test {

using namespace ccsds::testing;

void keep(void *user, std::uint8_t *frame, std::size_t n)
{
    static_cast<std::vector<Bytes> *>(user)->emplace_back(frame, frame + n);
}

TEST(Randomiser, makes_the_sequences_of_the_standards)
{
    Bytes tm(255 + 8), tc(255 + 8);
    sync_randomise_tm(tm.data(), tm.size());
    sync_randomise_tc(tc.data(), tc.size());
    EXPECT_EQ(Bytes(tm.begin(), tm.begin() + 8), (Bytes{0xFF, 0x48, 0x0E, 0xC0, 0x9A, 0x0D, 0x70, 0xBC}));
    EXPECT_EQ(Bytes(tc.begin(), tc.begin() + 8), (Bytes{0xFF, 0x39, 0x9E, 0x5A, 0x68, 0xE9, 0x06, 0xF5}));
    EXPECT_TRUE(std::equal(tm.begin() + 255, tm.end(), tm.begin())); // a period of 255 bits, so of 255 bytes
    EXPECT_TRUE(std::equal(tc.begin() + 255, tc.end(), tc.begin()));
}

/// The remainder of 56 bits by x^7 + x^6 + x^2 + 1, by long division of polynomials.
std::uint32_t remainder(const std::uint8_t *data)
{
    std::uint64_t dividend = 0;
    for (int i = 0; i < 7; i++) {
        dividend = dividend << 8 | data[i];
    }
    dividend <<= 7;
    for (int bit = 62; bit >= 7; bit--) {
        if ((dividend >> bit & 1u) != 0) {
            dividend ^= std::uint64_t{0b11000101} << (bit - 7);
        }
    }
    return static_cast<std::uint32_t>(dividend);
}

TEST(Cltu, has_the_form_of_the_standard)
{
    std::mt19937 random(1);
    for (std::size_t n = 1; n < 60; n++) {
        const Bytes data = any_bytes(random, n);
        Bytes cltu(CLTU_SIZE(n));
        ASSERT_EQ(cltu_write(data.data(), n, cltu.data()), cltu.size());
        ASSERT_EQ(cltu[0] << 8 | cltu[1], 0xEB90);
        ASSERT_EQ(Bytes(cltu.end() - 8, cltu.end()), (Bytes{0xC5, 0xC5, 0xC5, 0xC5, 0xC5, 0xC5, 0xC5, 0x79}));
        for (std::size_t i = 0; i < (n + 6) / 7; i++) {
            const std::uint8_t *block = &cltu[2 + 8 * i];
            ASSERT_EQ(block[7], (~remainder(block) & 0x7Fu) << 1);
            for (std::size_t k = 0; k < 7; k++) {
                ASSERT_EQ(block[k], 7 * i + k < n ? data[7 * i + k] : 0x55);
            }
        }
    }
}

struct Cltus {
    Bytes memory = Bytes(2000);
    std::vector<Bytes> found;
    CltuReader reader{};

    Cltus() { cltu_begin(&reader, memory.data(), memory.size(), keep, &found); }
};

TEST(Cltu, one_wrong_bit_in_a_block_is_corrected_and_two_end_it)
{
    std::mt19937 random(2);
    const Bytes data = any_bytes(random, 14);
    Bytes cltu(CLTU_SIZE(14));
    cltu_write(data.data(), data.size(), cltu.data());
    for (std::size_t first = 0; first < 64; first++) {
        for (std::size_t second = first; second < 64; second++) {
            Bytes wrong = cltu;
            wrong[2 + first / 8] ^= static_cast<std::uint8_t>(0x80 >> first % 8);
            if (second != first) {
                wrong[2 + second / 8] ^= static_cast<std::uint8_t>(0x80 >> second % 8);
            }
            Cltus cltus;
            cltu_take(&cltus.reader, wrong.data(), wrong.size());
            if (second == first || second == 63) { // the last bit of a block is no part of the code
                ASSERT_EQ(cltus.found.size(), 1u);
                ASSERT_EQ(cltus.found[0], data) << first << " " << second;
                ASSERT_EQ(cltus.reader.corrected, first == 63 ? 0u : 1u);
            } else {
                ASSERT_TRUE(cltus.found.empty()) << first << " " << second;
            }
        }
    }
}

TEST(Cltu, units_are_found_among_other_bytes)
{
    std::mt19937 random(3);
    Cltus cltus;
    std::vector<Bytes> sent;
    for (int i = 0; i < 2000; i++) {
        Bytes noise(random() % 30, 0x55);
        sent.push_back(any_bytes(random, 7 * (1 + random() % 20)));
        Bytes cltu(CLTU_SIZE(sent.back().size()));
        cltu_write(sent.back().data(), sent.back().size(), cltu.data());
        noise.insert(noise.end(), cltu.begin(), cltu.end());
        for (std::size_t at = 0; at < noise.size();) { // in pieces
            const std::size_t n = std::min<std::size_t>(1 + random() % 50, noise.size() - at);
            cltu_take(&cltus.reader, &noise[at], n);
            at += n;
        }
    }
    EXPECT_EQ(cltus.found, sent);
    EXPECT_EQ(cltus.reader.units, 2000u);
}

TEST(Cltu, one_that_is_too_long_is_counted)
{
    Cltus cltus;
    cltus.reader.room = 13;
    const Bytes data(14, 1);
    Bytes cltu(CLTU_SIZE(14));
    cltu_write(data.data(), data.size(), cltu.data());
    cltu_take(&cltus.reader, cltu.data(), cltu.size());
    EXPECT_TRUE(cltus.found.empty());
    EXPECT_EQ(cltus.reader.faults[CCSDS_ROOM], 1u);
}

TEST(Markers, frames_are_found_in_noise_and_kept_when_bits_of_a_marker_flip)
{
    std::mt19937 random(4);
    Bytes memory(100);
    std::vector<Bytes> found, sent;
    SyncReader reader{};
    sync_begin(&reader, memory.data(), memory.size(), 2, keep, &found);
    Bytes stream = any_bytes(random, 1000);
    for (int i = 0; i < 300; i++) {
        sent.push_back(any_bytes(random, 100));
        Bytes marker{0x1A, 0xCF, 0xFC, 0x1D};
        if (i % 3 == 2) { // two wrong bits, where a marker is expected
            marker[0] ^= 0x10;
            marker[3] ^= 0x01;
        }
        stream.insert(stream.end(), marker.begin(), marker.end());
        stream.insert(stream.end(), sent.back().begin(), sent.back().end());
        if (i % 50 == 49) { // bytes that are too many: the next marker is searched for
            stream.insert(stream.end(), 3, 0x55);
        }
    }
    for (std::size_t at = 0; at < stream.size();) {
        const std::size_t n = std::min<std::size_t>(1 + random() % 300, stream.size() - at);
        sync_take(&reader, &stream[at], n);
        at += n;
    }
    // After 50 frames comes i = 50, whose marker has wrong bits and stands where none is expected.
    std::vector<Bytes> expected;
    for (std::size_t i = 0; i < sent.size(); i++) {
        if (i == 0 || i % 50 != 0 || i % 3 != 2) {
            expected.push_back(sent[i]);
        }
    }
    EXPECT_EQ(found, expected);
    EXPECT_EQ(reader.lost, 5u);
    EXPECT_GE(reader.skipped, 1000u);
}

} // namespace sync_test
