// SPDX-License-Identifier: Apache-2.0
// Outages and resets.
#include "ccsds/testing/cfdp_link.h"

#include <algorithm>
#include <ctime>
#include <map>
#include <string>
#include <vector>

namespace cfdp_restart_test {

using namespace ccsds::testing;

TEST(CfdpOutage, a_frozen_link_stops_the_clocks_of_both_ends)
{
    Link link;
    link.file(300000);
    link.ground.put("source", "target");
    link.run(150 * ms);
    link.ground.remote.frozen = link.craft.remote.frozen = 1;
    link.drops = [](const CfdpPdu &, bool) { return true; };
    link.run(3600 * s / 10);
    EXPECT_EQ(link.ground.events.size() + link.craft.events.size(), 1u);
    link.ground.remote.frozen = link.craft.remote.frozen = 0;
    link.drops = nullptr;
    link.finish();
    link.expect_whole();
}

TEST(CfdpOutage, suspended_over_an_outage)
{
    for (const Clock when : {110 * ms, 290 * ms, 350 * ms, 410 * ms}) {
        Link link;
        link.file(300000);
        const CfdpId id = link.ground.put("source", "target");
        link.run(when);
        EXPECT_EQ(cfdp_suspend(&link.ground.cfdp, id), 1);
        EXPECT_EQ(cfdp_suspend(&link.craft.cfdp, id), 1);
        link.drops = [](const CfdpPdu &, bool) { return true; };
        link.run(200 * s);
        link.drops = nullptr;
        cfdp_resume(&link.ground.cfdp, id);
        cfdp_resume(&link.craft.cfdp, id);
        link.finish();
        link.expect_whole();
    }
}

/// What a program keeps over a reset.
struct Kept {
    CfdpLive live;
    std::vector<CfdpTransaction> transactions;
    std::vector<CfdpRange> ranges;
    std::vector<CfdpPast> past;
    std::map<std::string, Bytes> files;

    explicit Kept(const End &end)
        : live(end.cfdp.live), transactions(end.transactions), ranges(end.ranges), past(end.past),
          files(end.memory.files)
    {
    }
    void restore(End &end, Clock now) const
    {
        end.memory.opened.clear();
        end.begin(1);
        end.cfdp.live = live;
        std::copy(transactions.begin(), transactions.end(), end.transactions.begin());
        std::copy(ranges.begin(), ranges.end(), end.ranges.begin());
        std::copy(past.begin(), past.end(), end.past.begin());
        cfdp_restart(&end.cfdp, now);
    }
};

TEST(CfdpReset, an_end_that_kept_its_memory_goes_on)
{
    for (const bool of_craft : {false, true}) {
        for (Clock when = 10 * ms; when < 900 * ms; when += 40 * ms) {
            SCOPED_TRACE(when / ms);
            Link link(static_cast<std::uint32_t>(when / ms));
            link.loss = 0.02;
            link.file(300000);
            link.ground.put("source", "target");
            link.run(when);
            End &end = of_craft ? link.craft : link.ground;
            const Kept kept(end);
            link.run(20 * ms); // the memory is a little older than the reset
            kept.restore(end, link.now);
            link.finish();
            ASSERT_TRUE(link.craft.memory.has("target"));
            EXPECT_EQ(link.craft.memory.files["target"], link.ground.memory.files["source"]);
        }
    }
}

TEST(CfdpReset, a_clock_that_begins_anew_moves_the_timers)
{
    Link link;
    link.craft.remote.keep_alive = 10 * s;
    link.file(300000);
    link.ground.put("source", "target");
    link.run(200 * ms);
    const Kept kept(link.craft);
    const CfdpTransaction before = link.craft.transactions[0];
    kept.restore(link.craft, 5);
    const CfdpTransaction &now = link.craft.transactions[0];
    EXPECT_EQ(now.inactive - 5, before.inactive - link.now);
    EXPECT_EQ(now.keep_alive - 5, before.keep_alive - link.now);
    EXPECT_EQ(now.expires, INT64_MAX); // it does not run
}

TEST(CfdpReset, a_file_that_lost_bytes_in_the_reset_is_not_delivered)
{
    for (const int what : {0, 1, 2}) {
        Link link;
        link.file(300000);
        link.ground.put("source", "target");
        link.run(250 * ms);
        const Kept kept(link.craft);
        Bytes &file = link.craft.memory.files.begin()->second;
        ASSERT_GT(file.size(), 100000u);
        if (what == 0) {
            file[5000] ^= 1;
        } else if (what == 1) {
            file.resize(5000);
        } else {
            link.craft.memory.files.clear();
        }
        kept.restore(link.craft, link.now);
        link.finish();
        link.expect_none(what == 0 ? CFDP_CHECKSUM_FAILURE : CFDP_FILESTORE_REJECTION);
    }
}

TEST(CfdpReset, an_end_that_kept_nothing_hangs_nothing_and_delivers_nothing_wrong)
{
    for (const bool of_craft : {false, true}) {
        for (Clock when = 10 * ms; when < 1000 * ms; when += 30 * ms) {
            SCOPED_TRACE(when / ms);
            Link link(static_cast<std::uint32_t>(when / ms));
            link.loss = 0.02;
            link.file(300000);
            link.ground.put("source", "target");
            link.run(when);
            End &end = of_craft ? link.craft : link.ground;
            const bool before = link.craft.memory.has("target");
            end.memory.opened.clear();
            end.begin(1000); // another sequence number than before
            cfdp_time(&end.cfdp, link.now);
            link.ground.memory.files["second"] = any_bytes(link.random, 50000);
            link.ground.put("second", "other");
            while (link.ground.busy() || link.craft.busy()) {
                ASSERT_LT(link.now, 1000 * s) << "a transaction hangs";
                link.step();
            }
            EXPECT_EQ(link.craft.memory.files["other"], link.ground.memory.files["second"]);
            if (before || link.craft.memory.has("target")) {
                EXPECT_EQ(link.craft.memory.files["target"], link.ground.memory.files["source"]);
            }
            std::size_t left = 0; // an unfinished file may be left: at most one for each place
            for (const auto &[name, bytes] : link.craft.memory.files) {
                left += name[0] == '.';
            }
            EXPECT_LE(left, link.craft.transactions.size());
        }
    }
}

} // namespace cfdp_restart_test
