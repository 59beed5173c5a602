// SPDX-License-Identifier: Apache-2.0
// Units of bytes in messages: what is written is read, in both byte orders; what has no room waits; damage is refused.
#include "cosim/node/units.h"

#include "sim/error.h"

#include <random>

#include <gtest/gtest.h>

namespace units_test {

using namespace fledge::cosim;
using fledge::sim::Packet;

std::vector<Packet> some(std::size_t n)
{
    std::mt19937 random(static_cast<unsigned>(n));
    std::vector<Packet> units;
    for (std::size_t i = 0; i < n; i++) {
        Packet &unit = units.emplace_back(Packet{static_cast<Ns>(random()) << 20, {}});
        unit.bytes.resize(random() % 200);
        for (auto &byte : unit.bytes) {
            byte = static_cast<std::uint8_t>(random());
        }
    }
    return units;
}

bool same(const std::vector<Packet> &a, const std::vector<Packet> &b)
{
    return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                      [](const Packet &x, const Packet &y) { return x.t == y.t && x.bytes == y.bytes; });
}

TEST(Units, WhatAMessageHasNoRoomForGoesLaterInOrder)
{
    UnitsOut out;
    const Publication opened = out.open(7, 1000, 500);
    EXPECT_EQ(opened.schema, units_schema(1000));
    EXPECT_TRUE(units_of(opened.initial).empty());
    const auto all = some(100);
    auto waiting = all;
    std::vector<Packet> found;
    std::vector<Record> records;
    for (Ns t = 0; !waiting.empty(); t += 500) {
        out.write(t, waiting, records);
    }
    out.write(1, waiting, records); // nothing is no message
    std::uint32_t count = 0;
    for (const Record &record : records) {
        EXPECT_EQ(record.channel, 7u);
        EXPECT_EQ(record.count, ++count);
        EXPECT_TRUE(is_payload(record.payload, opened.schema.size));
        const auto units = units_of(record.payload);
        EXPECT_FALSE(units.empty());
        found.insert(found.end(), units.begin(), units.end());
    }
    EXPECT_GT(count, 5u);
    EXPECT_TRUE(same(found, all));
    auto large = some(1);
    large[0].bytes.resize(1000);
    EXPECT_THROW(out.write(0, large, records), fledge::sim::RunError);
}

TEST(Units, BytesThatAreCutOffAreRefused)
{
    const auto all = some(5);
    const Bytes bytes = packed(all);
    EXPECT_TRUE(same(unpacked(bytes), all));
    std::size_t whole = 0;
    for (std::size_t n = 0; n < bytes.size(); n++) {
        try {
            whole += unpacked(std::span(bytes).first(n)).size() < 5;
        } catch (const ProtocolError &) {
        }
    }
    EXPECT_EQ(whole, 5u); // where one ends
}

TEST(Units, AMessageWithAWrongLengthIsRefused)
{
    UnitsOut out;
    Bytes message(units_schema(100).size);
    message[8] = std::byte{101};
    EXPECT_THROW(units_of(make_payload(message)), ProtocolError);
    EXPECT_THROW(units_of(std::span(message).first(10)), ProtocolError);
}

} // namespace units_test
