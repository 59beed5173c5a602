// SPDX-License-Identifier: Apache-2.0
// The Reed-Solomon code against the check symbols of another encoder (libfec's encode_rs_ccsds), and real frames of
// Suomi NPP.
#include "ccsds/sync.h"
#include "ccsds/testing/bits.h"
#include "ground/capture/reed_solomon.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <numeric>
#include <optional>
#include <string>

namespace reed_solomon_test {

using namespace ccsds::testing;
using fledge::ground::reed_solomon_correct;

/// 0, 1, 2, ... and the check symbols of libfec.
Bytes word_of(std::size_t n)
{
    Bytes word(n);
    std::iota(word.begin(), word.end(), std::uint8_t{0});
    const Bytes check = from_hex(n == 223 ? "4ffb92dd557ec67f27fb8982cf58f8fd028ad117fcef6b2793d0418826578651"
                                          : "d5ce9fa9d65a446bc9fbede976d4c5c40bfd69f7b8bb3a71eebac7ec7b97a607");
    word.insert(word.end(), check.begin(), check.end());
    return word;
}

/// Another value in n symbols from `from` on, each `step` behind the one before.
void spoil(std::mt19937 &random, Bytes &bytes, std::size_t n, std::size_t from = 0, std::size_t step = 1)
{
    std::vector<std::size_t> places;
    for (std::size_t at = from; at < bytes.size(); at += step) {
        places.push_back(at);
    }
    std::shuffle(places.begin(), places.end(), random);
    for (std::size_t i = 0; i < n; i++) {
        bytes[places[i]] ^= static_cast<std::uint8_t>(1 + random() % 255);
    }
}

TEST(ReedSolomon, up_to_16_symbols_are_corrected_and_more_are_refused)
{
    std::mt19937 random(1);
    for (const std::size_t n : {223, 100}) { // the second one has virtual fill
        const Bytes good = word_of(n);
        for (int i = 0; i < 400; i++) {
            Bytes word = good;
            const std::size_t wrong = random() % 17;
            spoil(random, word, wrong);
            ASSERT_EQ(reed_solomon_correct(word, 1), std::optional(wrong));
            ASSERT_EQ(word, good);
        }
        for (int i = 0; i < 400; i++) {
            Bytes word = good;
            spoil(random, word, 17 + random() % 30);
            const Bytes before = word;
            const std::optional<std::size_t> corrected = reed_solomon_correct(word, 1);
            ASSERT_TRUE(!corrected) << *corrected; // one in 16! would be another word
            ASSERT_EQ(word, before);
        }
    }
}

TEST(ReedSolomon, real_frames_have_the_code)
{
    const std::string path = real_file("ccsds/snpp_synchronized_cadus.dat");
    std::ifstream file(path, std::ios::binary);
    if (!file) {
        GTEST_SKIP() << "not here: " << path;
    }
    const Bytes all((std::istreambuf_iterator<char>(file)), {});
    std::mt19937 random(2);
    std::size_t blocks = 0;
    for (std::size_t at = 4; at + 1020 <= all.size(); at += 1024, blocks++) {
        Bytes block(all.begin() + static_cast<std::ptrdiff_t>(at),
                    all.begin() + static_cast<std::ptrdiff_t>(at + 1020));
        sync_randomise_tm(block.data(), block.size());
        const Bytes good = block;
        ASSERT_EQ(reed_solomon_correct(block, 4), std::optional(std::size_t{0}));
        ASSERT_EQ(block, good);
        spoil(random, block, 10, 0, 4);
        spoil(random, block, 16, 3, 4);
        ASSERT_EQ(reed_solomon_correct(block, 4), std::optional(std::size_t{26}));
        ASSERT_EQ(block, good);
        spoil(random, block, 20, 1, 4);
        ASSERT_FALSE(reed_solomon_correct(block, 4));
    }
    EXPECT_EQ(blocks, 65u);
}

} // namespace reed_solomon_test
