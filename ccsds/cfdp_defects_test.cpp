// SPDX-License-Identifier: Apache-2.0
// Defects that other implementations of CFDP have had.
#include "ccsds/testing/cfdp_link.h"

#include <algorithm>
#include <ctime>
#include <set>
#include <string>

namespace cfdp_defects_test {

using namespace ccsds::testing;

TEST(CfdpDefects, eof_while_suspended_is_followed_by_naks_after_resume)
{
    for (const bool immediate : {false, true}) {
        Link link;
        link.craft.remote.immediate = immediate;
        link.file(20000);
        link.drops = lose(CFDP_FILE_DATA, 12);
        const CfdpId id = link.ground.put("source", "target");
        link.run(105 * ms);
        ASSERT_EQ(cfdp_suspend(&link.craft.cfdp, id), 1);
        link.run(30 * s);
        EXPECT_EQ(link.sent[CFDP_NAK], 0);
        EXPECT_EQ(link.sent[CFDP_ACK], 1); // but the EOF is acknowledged
        EXPECT_EQ(cfdp_resume(&link.craft.cfdp, id), 1);
        link.finish();
        link.expect_whole();
    }
}

TEST(CfdpDefects, resume_without_gaps_finishes)
{
    Link link;
    link.file(20000);
    const CfdpId id = link.ground.put("source", "target");
    link.run(105 * ms);
    ASSERT_EQ(cfdp_suspend(&link.craft.cfdp, id), 1);
    link.run(50 * s);
    EXPECT_EQ(link.sent[CFDP_FINISHED], 0);
    EXPECT_FALSE(link.craft.memory.has("target"));
    ASSERT_EQ(cfdp_resume(&link.craft.cfdp, id), 1);
    link.finish(1 * s);
    link.expect_whole();
    EXPECT_EQ(link.sent[CFDP_NAK], 0);

    Link sender; // and at the sender, in the middle of the file
    sender.file(20000);
    const CfdpId other = sender.ground.put("source", "target");
    sender.run(10 * ms);
    ASSERT_EQ(cfdp_suspend(&sender.ground.cfdp, other), 1);
    EXPECT_EQ(cfdp_suspend(&sender.ground.cfdp, other), 0);
    sender.run(50 * s);
    EXPECT_LT(sender.sent[CFDP_FILE_DATA], 11);
    ASSERT_EQ(cfdp_resume(&sender.ground.cfdp, other), 1);
    sender.finish(1 * s);
    sender.expect_whole();
}

TEST(CfdpDefects, a_nak_list_longer_than_one_pdu_is_sent_in_several)
{
    Link link(1, 1, 400);
    link.craft.remote.segment = 100; // 12 ranges
    link.drops = [n = 0](const CfdpPdu &pdu, bool) mutable {
        return pdu.kind == CFDP_FILE_DATA && n < 600 && n++ % 2 == 0;
    };
    link.file(600000);
    link.ground.put("source", "target");
    link.finish(3 * s);
    link.expect_whole();
    EXPECT_EQ(link.sent[CFDP_NAK], (300 + 11) / 12);
    EXPECT_EQ(link.sent[CFDP_FILE_DATA], 900); // and nothing more often than needed
}

TEST(CfdpDefects, what_several_naks_ask_for_is_sent_once)
{
    Link link(1, 1, 8);
    link.file(20000);
    const CfdpId id = link.ground.put("source", "target");
    link.run(15 * ms);
    std::set<std::uint64_t> sent;
    link.drops = [&](const CfdpPdu &pdu, bool) {
        EXPECT_TRUE(pdu.kind != CFDP_FILE_DATA || sent.insert(pdu.offset).second) << pdu.offset;
        return true;
    };
    std::uint8_t bytes[200], segments[200];
    CfdpPdu nak{};
    nak.kind = CFDP_NAK;
    nak.to_sender = 1;
    nak.source = id.source;
    nak.sequence = id.sequence;
    nak.destination = 2;
    nak.entity_bytes = 2;
    nak.sequence_bytes = 4;
    nak.data = segments;
    for (const auto &[begin, end] : std::initializer_list<std::pair<std::uint32_t, std::uint32_t>>{{8000, 9000},
                                                                                                   {1000, 3000},
                                                                                                   {5000, 6000},
                                                                                                   {2000, 5500},
                                                                                                   {500, 1000},
                                                                                                   {6000, 6500},
                                                                                                   {4000, 4000},
                                                                                                   {9000, 4}}) {
        ccsds_put32(segments + nak.n, begin);
        ccsds_put32(segments + nak.n + 4, end);
        nak.n += 8;
    }
    cfdp_take(&link.ground.cfdp, bytes, cfdp_pdu_write(&nak, bytes, sizeof bytes));
    const CfdpRange *ranges = link.ground.ranges.data();
    ASSERT_EQ(link.ground.transactions[0].ranges, 2u);
    EXPECT_EQ(std::tie(ranges[0].begin, ranges[0].end), std::make_tuple(500u, 6500u));
    EXPECT_EQ(std::tie(ranges[1].begin, ranges[1].end), std::make_tuple(8000u, 9000u));
    link.run(100 * ms);
    for (std::uint64_t offset = 500; offset < 6500; offset += 1000) {
        EXPECT_EQ(sent.count(offset), 1u);
    }
    EXPECT_EQ(sent.count(8000), 1u);
}

TEST(CfdpDefects, a_large_file_with_many_gaps_does_not_slow_down)
{
    // The processor's time of a file with three times as many gaps is about three times as long, not nine times.
    const auto time = [](std::uint32_t gaps) {
        Link link(1, 1, gaps + 1);
        std::set<std::uint64_t> lost;
        link.drops = [&lost](const CfdpPdu &pdu, bool) {
            return pdu.kind == CFDP_FILE_DATA && pdu.offset % 40 == 0 && lost.insert(pdu.offset).second;
        };
        link.ground.remote.segment = 20;
        link.craft.remote.segment = 1000;
        link.file(gaps * 40);
        link.ground.put("source", "target");
        const std::clock_t start = std::clock(); // of the processor: other programs may run beside
        link.finish();
        link.expect_whole();
        return static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    };
    double few = 1e9, many = 1e9;
    for (int i = 0; i < 4; i++) {
        few = std::min(few, time(3000));
        many = std::min(many, time(9000));
    }
    EXPECT_LT(many, 6 * few);
}

TEST(CfdpDefects, a_duplicate_eof_is_acknowledged_again)
{
    for (const bool ended : {false, true}) { // while the receiver misses data; after all has ended
        Link link;
        link.file(5000);
        Bytes eof;
        link.drops = [&](const CfdpPdu &pdu, bool) {
            if (pdu.kind == CFDP_EOF) {
                eof = Bytes(64);
                eof.resize(cfdp_pdu_write(&pdu, eof.data(), eof.size()));
            }
            return !ended && pdu.kind == CFDP_FILE_DATA && pdu.offset == 1000;
        };
        link.ground.put("source", "target");
        link.run(500 * ms);
        ASSERT_EQ(link.craft.busy(), !ended);
        const Bytes first = eof;
        if (ended) { // and others after it
            link.ground.put("", "");
            link.ground.put("", "");
            link.run(500 * ms);
        }
        eof = first;
        const int before = link.sent[CFDP_ACK];
        for (int i = 0; i < 3; i++) {
            cfdp_take(&link.craft.cfdp, eof.data(), eof.size());
        }
        link.run(10 * ms);
        EXPECT_EQ(link.sent[CFDP_ACK], before + 3);
        EXPECT_EQ(link.craft.busy(), !ended);
    }
}

TEST(CfdpDefects, three_hundred_files_in_a_row)
{
    Link link(3, 2);
    link.loss = 0.05;
    link.twice = 0.05;
    link.late = 0.1;
    link.tick = 5 * ms;
    link.ground.remote.ack_timer = link.craft.remote.ack_timer = link.craft.remote.nak_timer = 500 * ms;
    link.ground.remote.ack_limit = link.craft.remote.ack_limit = link.craft.remote.nak_limit = 30;
    link.file(3000);
    int files = 0;
    const auto next = [&] {
        if (files < 300) {
            files++;
            link.ground.put("source", "target" + std::to_string(files));
        }
    };
    link.ground.on_event = [&](const CfdpEvent &event) { // the next is put while the last one ends
        if (event.what == CFDP_EVENT_ENDED) {
            next();
        }
    };
    next();
    link.finish(3000 * s);
    EXPECT_EQ(files, 300);
    for (int i = 1; i <= 300; i++) {
        EXPECT_EQ(link.craft.memory.files["target" + std::to_string(i)], link.ground.memory.files["source"]);
    }
}

TEST(CfdpDefects, a_full_list_of_gaps_loses_nothing)
{
    for (const bool immediate : {false, true}) {
        for (const std::uint32_t gaps : {1u, 2u, 5u}) {
            Link link(gaps, 1, gaps);
            link.loss = 0.2;
            link.late = 0.3;
            link.craft.remote.immediate = immediate;
            link.craft.remote.nak_timer = 300 * ms;
            link.craft.remote.nak_limit = link.craft.remote.ack_limit = link.ground.remote.ack_limit = 50;
            link.file(100000);
            link.ground.put("source", "target");
            link.finish();
            link.expect_whole();
            EXPECT_GT(link.craft.cfdp.live.faults[CCSDS_ROOM], 0u);
        }
    }
}

} // namespace cfdp_defects_test
