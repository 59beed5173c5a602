// SPDX-License-Identifier: Apache-2.0
// The series F1 of the standard's test plan: files.
#include "ccsds/testing/cfdp_link.h"

#include <chrono>
#include <cstdlib>
#include <map>
#include <string>
#include <vector>

namespace cfdp_test {

using namespace ccsds::testing;

TEST(CfdpF1, small_file_class_1)
{
    Link link;
    link.file(500);
    link.ground.put("source", "target", 1);
    link.finish();
    link.expect_whole();
    EXPECT_EQ(link.sent, (std::map<int, int>{{CFDP_METADATA, 1}, {CFDP_FILE_DATA, 1}, {CFDP_EOF, 1}}));
}

TEST(CfdpF1, many_pdus_in_each_class_checksum_and_id)
{
    for (const int class1 : {0, 1}) {
        for (const int closure : {0, 1}) {
            for (const std::uint8_t checksum : {CFDP_MODULAR, CFDP_CRC32, CFDP_NULL_CHECKSUM}) {
                for (const std::uint8_t crc : {0, 1}) {
                    Link link;
                    link.ground.remote.checksum = checksum;
                    link.ground.remote.crc = crc;
                    link.ground.cfdp.set.entity_bytes = static_cast<std::uint8_t>(1 + 7 * crc);
                    link.ground.cfdp.set.sequence_bytes = static_cast<std::uint8_t>(8 - 7 * crc);
                    link.drops = [=](const CfdpPdu &pdu, bool) {
                        EXPECT_EQ(pdu.crc, crc); // both ways
                        return false;
                    };
                    link.file(54321);
                    link.ground.put("source", "target", class1, {}, 0, closure);
                    link.finish();
                    link.expect_whole();
                    EXPECT_EQ(link.sent[CFDP_FILE_DATA], 55);
                    EXPECT_EQ(link.sent[CFDP_FINISHED], class1 == 0 || closure != 0);
                    EXPECT_EQ(link.sent[CFDP_ACK], class1 == 0 ? 2 : 0);
                    EXPECT_EQ(link.sent[CFDP_NAK], 0);
                    if (class1 == 0 || closure != 0) { // the sender knows
                        EXPECT_EQ(link.ground.ended()->file_status, CFDP_RETAINED);
                    }
                }
            }
        }
    }
}

TEST(CfdpF1, the_other_way)
{
    Link link;
    link.craft.memory.files["science"] = any_bytes(link.random, 9999);
    link.craft.put("science", "down/science");
    link.finish();
    EXPECT_EQ(link.ground.memory.files["down/science"], link.craft.memory.files["science"]);
}

TEST(CfdpF1, an_empty_file_and_no_file)
{
    for (const int class1 : {0, 1}) {
        Link link;
        link.file(0);
        link.ground.put("source", "target", class1);
        link.finish();
        link.expect_whole();
        const Bytes message{CFDP_TLV_MESSAGE, 2, 'h', 'i'};
        link.ground.put("", "", class1, message);
        link.finish();
        EXPECT_EQ(link.craft.events[link.craft.events.size() - 2].text, (Bytes{'h', 'i'}));
        EXPECT_EQ(link.craft.ended()->file_status, CFDP_UNREPORTED);
        EXPECT_EQ(link.craft.memory.files.size(), 1u);
    }
}

TEST(CfdpF1, metadata_alone_whose_sender_gives_no_eof)
{
    Link link;
    link.drops = [](const CfdpPdu &pdu, bool up) { return up && pdu.kind == CFDP_EOF; };
    link.ground.put("", "", 1, Bytes{CFDP_TLV_MESSAGE, 2, 'h', 'i'});
    link.finish();
    EXPECT_EQ(link.craft.events[link.craft.events.size() - 2].text, (Bytes{'h', 'i'}));
    EXPECT_EQ(link.craft.ended()->condition, CFDP_NO_ERROR);
    EXPECT_FALSE(link.craft.ended()->incomplete);
}

TEST(CfdpF1, a_link_that_loses_repeats_reorders_and_delays)
{
    for (const bool immediate : {false, true}) {
        for (std::uint32_t seed = 1; seed <= 20; seed++) {
            SCOPED_TRACE(seed);
            Link link(seed, 8, 2 + seed % 7 * 10);
            link.craft.remote.immediate = immediate;
            link.loss = seed % 3 == 0 ? 0.3 : 0.05;
            link.twice = 0.1;
            link.late = 0.2;
            link.ground.remote.ack_limit = link.craft.remote.ack_limit = link.craft.remote.nak_limit = 30;
            link.ground.remote.checksum = seed % 2 != 0 ? CFDP_CRC32 : CFDP_MODULAR;
            link.file(100000 + seed);
            link.ground.put("source", "target");
            link.finish();
            link.expect_whole();
        }
    }
}

TEST(CfdpF1, class_1_loses_and_says_so)
{
    Link link;
    link.file(10000);
    link.drops = lose(CFDP_FILE_DATA, 3);
    link.ground.put("source", "target", 1, {}, 0, 1);
    link.finish();
    link.expect_none(CFDP_CHECK_LIMIT);
    EXPECT_EQ(link.ground.ended()->incomplete, 1);
    EXPECT_EQ(link.sent[CFDP_FINISHED], 1);

    link.drops = lose(CFDP_FILE_DATA, 3); // without closure, the sender does not hear of it
    link.ground.put("source", "target", 1);
    link.finish();
    EXPECT_EQ(link.craft.ended()->condition, CFDP_CHECK_LIMIT);
    EXPECT_EQ(link.ground.ended()->condition, CFDP_NO_ERROR);
    EXPECT_FALSE(link.craft.memory.has("target"));
    EXPECT_EQ(link.sent[CFDP_FINISHED], 1);
}

TEST(CfdpF1, class_1_waits_for_data_behind_its_eof)
{
    Link link;
    link.late = 0.5;
    link.file(20000);
    link.ground.put("source", "target", 1);
    link.finish();
    link.expect_whole();
}

TEST(CfdpF1, cancel_at_either_end)
{
    for (const int class1 : {0, 1}) {
        for (const bool by_sender : {true, false}) {
            for (const Clock after : {0 * ms, 30 * ms, 150 * ms}) {
                Link link;
                link.file(400000);
                const CfdpId id = link.ground.put("source", "target", class1, {}, 0, 1);
                link.run(after);
                if (!by_sender && after < link.delay) {
                    EXPECT_EQ(cfdp_cancel(&link.craft.cfdp, id), 0); // it is not there yet
                    continue;
                }
                EXPECT_EQ(cfdp_cancel(&(by_sender ? link.ground : link.craft).cfdp, id), 1);
                EXPECT_EQ(cfdp_cancel(&(by_sender ? link.ground : link.craft).cfdp, id), 0);
                link.finish();
                link.expect_none(CFDP_CANCEL_REQUEST);
                EXPECT_LT(link.sent[CFDP_FILE_DATA], 400);
            }
        }
    }
}

TEST(CfdpF1, files_over_4_GB)
{
    // A store that keeps sizes alone: the first bytes of each segment name its offset.
    struct Huge {
        std::uint64_t size = (std::uint64_t{1} << 32) + 123456, came = 0, wrong = 0;
        bool whole = false;
    } source, target;
    const auto store_of = [](Huge &huge) {
        CfdpStore store{};
        store.user = &huge;
        store.open = [](void *, const char *, CfdpOpen) { return 1; };
        store.close = [](void *, int) {};
        store.size = [](void *user, int) { return static_cast<std::int64_t>(static_cast<Huge *>(user)->size); };
        store.read = [](void *, int, std::uint64_t offset, std::uint8_t *bytes, std::size_t) {
            cfdp_put_number(bytes, 8, offset);
            return 0;
        };
        store.write = [](void *user, int, std::uint64_t offset, const std::uint8_t *bytes, std::size_t n) {
            static_cast<Huge *>(user)->came += n;
            static_cast<Huge *>(user)->wrong += cfdp_get(bytes, 8) != offset;
            return 0;
        };
        store.rename = [](void *user, const char *, const char *) {
            static_cast<Huge *>(user)->whole = true;
            return 0;
        };
        store.remove = [](void *, const char *) { return 0; };
        return store;
    };
    Link link;
    link.ground.cfdp.set.store = store_of(source);
    link.craft.cfdp.set.store = store_of(target);
    link.ground.remote.segment = 65000;
    link.ground.remote.checksum = CFDP_NULL_CHECKSUM;
    link.craft.remote.immediate = 1;
    link.ground.put("source", "target");
    link.drops = [](const CfdpPdu &pdu, bool) { return pdu.kind == CFDP_FILE_DATA; };
    link.run(105 * ms);
    const std::uint64_t begin = (std::uint64_t{1} << 32) - 6500000; // as if both had come so far
    link.ground.transactions[0].progress = link.craft.transactions[0].progress = begin;
    link.drops = nullptr;
    link.loss = 0.1;
    link.finish();
    EXPECT_TRUE(target.whole);
    EXPECT_EQ(target.wrong, 0u);
    EXPECT_EQ(target.came, source.size - begin); // and nothing twice
    EXPECT_EQ(link.craft.ended()->progress, source.size);
    EXPECT_GT(link.sent[CFDP_NAK], 3);
}

TEST(CfdpF1, many_at_once_by_priority)
{
    Link link(1, 30);
    link.loss = 0.02;
    std::vector<CfdpId> ids;
    for (int i = 0; i < 20; i++) {
        const std::string name = "file" + std::to_string(i);
        link.ground.memory.files[name] = any_bytes(link.random, 20000);
        ids.push_back(link.ground.put(name, name, 0, {}, i == 19 ? 2 : 1));
    }
    for (int i = 0; i < 10; i++) { // and back
        const std::string name = "back" + std::to_string(i);
        link.craft.memory.files[name] = any_bytes(link.random, 20000);
        link.craft.put(name, name);
    }
    link.finish();
    for (const auto &[name, bytes] : link.ground.memory.files) {
        EXPECT_EQ(link.craft.memory.files[name], bytes) << name;
    }
    std::vector<std::uint64_t> order;
    for (const Event &event : link.craft.events) {
        if (event.what == CFDP_EVENT_ENDED && event.receiver != 0) {
            order.push_back(event.id.sequence);
        }
    }
    EXPECT_EQ(order.size(), 20u);
    EXPECT_EQ(order.front(), ids[19].sequence);
}

/// 100 MB in class 2 at a loss of 1 %, within 10 % of the link's rate. FLEDGE_CFDP_MB sets how many: 8 in the suite.
TEST(CfdpF1, a_large_file_goes_at_the_links_rate)
{
    const char *setting = std::getenv("FLEDGE_CFDP_MB");
    const std::size_t megabytes = setting != nullptr ? std::strtoul(setting, nullptr, 10) : 8;
    for (const bool immediate : {true, false}) {
        Link link(5, 1, 1200);
        link.loss = 0.01;
        link.delay = 250 * ms;
        link.craft.remote.immediate = immediate;
        link.craft.remote.nak_timer = 1 * s;
        link.ground.remote.segment = 1000;
        link.file(megabytes * 1000000);
        link.ground.put("source", "target");
        const auto start = std::chrono::steady_clock::now();
        link.finish(3600 * s);
        const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
        link.expect_whole();
        const double least = static_cast<double>(megabytes) * 1000 / 0.99 * 1e-3; // [s] of a PDU each ms
        const double rounds = megabytes < 100 ? 6 : 0; // [s] of the end, which a short file feels
        EXPECT_LT(static_cast<double>(link.now) / s, 1.1 * least + rounds);
        std::printf("%zu MB, %s NAK: %.3f of the link's rate, %.2f s of a processor\n", megabytes,
                    immediate ? "immediate" : "deferred", least / (static_cast<double>(link.now) / s), took.count());
    }
}

} // namespace cfdp_test
