// SPDX-License-Identifier: Apache-2.0
// The series F2 of the standard's test plan: lost PDUs and limits.
#include "ccsds/testing/cfdp_link.h"

#include <set>
#include <string>
#include <vector>

namespace cfdp_faults_test {

using namespace ccsds::testing;

TEST(CfdpF2, the_first_of_each_directive_is_lost)
{
    for (const int kind : {CFDP_METADATA, CFDP_EOF, CFDP_FINISHED, CFDP_NAK, CFDP_ACK}) {
        for (const int acknowledged : {0, static_cast<int>(CFDP_EOF), static_cast<int>(CFDP_FINISHED)}) {
            for (const bool immediate : {false, true}) {
                Link link;
                link.craft.remote.immediate = immediate;
                link.file(5000);
                auto first = lose(kind, 1, kind == CFDP_ACK ? acknowledged : 0);
                auto data = lose(CFDP_FILE_DATA, 2);
                link.drops = [&](const CfdpPdu &pdu, bool up) { return first(pdu, up) || data(pdu, up); };
                link.ground.put("source", "target");
                link.finish();
                link.expect_whole();
            }
        }
    }
}

TEST(CfdpF2, the_first_of_every_pdu_but_eof_is_lost_both_ways)
{
    Link link;
    std::set<std::vector<std::uint64_t>> seen;
    link.drops = [&](const CfdpPdu &pdu, bool) {
        const bool data = pdu.kind == CFDP_FILE_DATA;
        return pdu.kind != CFDP_EOF && seen.insert({pdu.kind, data ? pdu.offset : 0, pdu.acknowledged}).second;
    };
    link.file(20000);
    link.ground.put("source", "target");
    link.finish();
    link.expect_whole();
}

TEST(CfdpF2, limits_of_acknowledgements)
{
    Link link; // no EOF is acknowledged: neither that of the file nor that of the cancellation
    link.file(5000);
    link.drops = [](const CfdpPdu &pdu, bool) { return pdu.kind == CFDP_ACK && pdu.acknowledged == CFDP_EOF; };
    link.craft.remote.nak_limit = 2;
    auto data = lose(CFDP_FILE_DATA, 2);
    link.drops = [=](const CfdpPdu &pdu, bool up) {
        return (pdu.kind == CFDP_ACK && pdu.acknowledged == CFDP_EOF) ||
               (pdu.kind == CFDP_FILE_DATA && pdu.offset == 1000) || data(pdu, up) || pdu.kind == CFDP_FINISHED;
    };
    link.ground.put("source", "target");
    link.finish();
    EXPECT_EQ(link.ground.ended()->condition, CFDP_ACK_LIMIT);
    EXPECT_EQ(link.ground.count(CFDP_EVENT_FAULT, CFDP_ACK_LIMIT), 2);
    EXPECT_EQ(link.sent[CFDP_EOF], 2 * 5);
    EXPECT_EQ(link.ground.ended()->file_status, CFDP_UNREPORTED);
    EXPECT_FALSE(link.craft.memory.has("target"));

    Link back; // no FINISHED is acknowledged: the file is there all the same
    back.file(5000);
    back.drops = [](const CfdpPdu &pdu, bool) { return pdu.kind == CFDP_FINISHED; };
    back.ground.remote.inactivity = 30 * s;
    back.ground.put("source", "target");
    back.finish();
    EXPECT_EQ(back.sent[CFDP_FINISHED], 5);
    EXPECT_EQ(back.craft.ended()->condition, CFDP_ACK_LIMIT);
    EXPECT_EQ(back.craft.ended()->incomplete, 0);
    EXPECT_EQ(back.craft.memory.files["target"], back.ground.memory.files["source"]);
    EXPECT_EQ(back.ground.ended()->condition, CFDP_INACTIVITY);
}

TEST(CfdpF2, limit_of_naks)
{
    Link link;
    link.file(5000);
    Bytes where;
    link.drops = [&](const CfdpPdu &pdu, bool) {
        if (pdu.kind == CFDP_FINISHED) {
            where.assign(pdu.data, pdu.data + pdu.n);
        }
        return pdu.kind == CFDP_FILE_DATA && pdu.offset == 2000;
    };
    link.ground.put("source", "target");
    link.finish();
    link.expect_none(CFDP_NAK_LIMIT);
    EXPECT_EQ(link.sent[CFDP_NAK], 1 + 5);
    EXPECT_EQ(where, (Bytes{CFDP_TLV_ENTITY, 2, 0, 2})); // of the fault
}

TEST(CfdpF2, inactivity_at_either_end)
{
    Link link; // the ground falls silent after some data
    link.file(50000);
    int sent = 0;
    link.drops = [&](const CfdpPdu &, bool up) { return up && sent++ > 20; };
    link.ground.put("source", "target");
    link.finish();
    EXPECT_EQ(link.craft.ended()->condition, CFDP_INACTIVITY);
    EXPECT_FALSE(link.craft.memory.has("target"));

    Link silent; // the craft falls silent after its acknowledgement
    silent.file(5000);
    silent.drops = [](const CfdpPdu &pdu, bool up) { return !up && pdu.kind != CFDP_ACK; };
    silent.ground.put("source", "target");
    silent.finish();
    EXPECT_EQ(silent.ground.ended()->condition, CFDP_INACTIVITY);
}

TEST(CfdpF2, handlers_of_faults)
{
    // By the remote entity, and by the transaction itself; each for a receiver that misses data for ever.
    for (const int by_put : {0, 1}) {
        for (const std::uint8_t handler : {CFDP_CANCEL, CFDP_SUSPEND, CFDP_IGNORE, CFDP_ABANDON}) {
            Link link;
            link.file(5000);
            link.drops = [](const CfdpPdu &pdu, bool) { return pdu.kind == CFDP_FILE_DATA && pdu.offset == 2000; };
            Bytes options;
            if (by_put != 0) {
                options = {CFDP_TLV_HANDLER, 1, static_cast<std::uint8_t>(CFDP_NAK_LIMIT << 4 | handler),
                           CFDP_TLV_FLOW,    1, CFDP_NAK_LIMIT << 4};
            } else {
                link.craft.remote.handlers[CFDP_NAK_LIMIT] = handler;
            }
            link.ground.remote.inactivity = 300 * s;
            const CfdpId id = link.ground.put("source", "target", 0, options);
            link.run(40 * s);
            EXPECT_GE(link.craft.count(CFDP_EVENT_FAULT, CFDP_NAK_LIMIT), 1);
            EXPECT_EQ(link.craft.count(CFDP_EVENT_SUSPENDED), handler == CFDP_SUSPEND);
            EXPECT_EQ(link.craft.count(CFDP_EVENT_ABANDONED), handler == CFDP_ABANDON);
            EXPECT_EQ(link.craft.busy(), handler == CFDP_SUSPEND || handler == CFDP_IGNORE);
            EXPECT_EQ(link.ground.busy(), handler != CFDP_CANCEL);
            link.drops = nullptr;
            if (handler == CFDP_SUSPEND) {
                EXPECT_EQ(cfdp_resume(&link.craft.cfdp, id), 1);
            }
            link.finish();
            if (handler == CFDP_SUSPEND || handler == CFDP_IGNORE) {
                link.expect_whole();
            } else {
                EXPECT_FALSE(link.craft.memory.has("target"));
            }
        }
    }
}

TEST(CfdpF2, keep_alives_and_prompts)
{
    Link link;
    link.craft.remote.keep_alive = 100 * ms;
    link.file(500000);
    const CfdpId id = link.ground.put("source", "target");
    link.run(300 * ms);
    const int alive = link.sent[CFDP_KEEP_ALIVE];
    EXPECT_GE(alive, 1);
    EXPECT_EQ(cfdp_prompt(&link.ground.cfdp, id, 1), 1);
    EXPECT_EQ(cfdp_prompt(&link.ground.cfdp, id, 0), 1);
    EXPECT_EQ(cfdp_prompt(&link.craft.cfdp, id, 0), 0);
    link.run(150 * ms);
    EXPECT_EQ(link.sent[CFDP_PROMPT], 2);
    EXPECT_EQ(link.sent[CFDP_NAK], 1); // though nothing is missing
    link.finish();
    link.expect_whole();

    Link slow; // the receiver gets nothing: the sender notices how far it is behind
    slow.craft.remote.keep_alive = 100 * ms;
    slow.ground.remote.keep_alive_limit = 200000;
    slow.drops = [](const CfdpPdu &pdu, bool) { return pdu.kind == CFDP_FILE_DATA && pdu.offset > 5000; };
    slow.file(500000);
    slow.ground.put("source", "target");
    slow.finish();
    slow.expect_none(CFDP_KEEP_ALIVE_LIMIT);
    EXPECT_LT(slow.sent[CFDP_FILE_DATA], 400);
}

TEST(CfdpF2, a_wrong_checksum_or_size_delivers_nothing)
{
    for (const int what : {0, 1, 2}) {
        Link link;
        link.file(5000);
        bool done = false;
        const auto flip = [&](Bytes &bytes) {
            CfdpPdu pdu{};
            ASSERT_EQ(cfdp_pdu_read(&pdu, bytes.data(), bytes.size()), CCSDS_OK);
            const std::size_t head = cfdp_pdu_head(&pdu);
            if (what == 0 && pdu.kind == CFDP_FILE_DATA && !done) {
                bytes[head + 7] ^= 1;
                done = true;
            } else if (what != 0 && pdu.kind == CFDP_EOF && pdu.condition == 0) {
                pdu.offset = what == 1 ? 4000 : pdu.offset; // shorter than the data
                pdu.checksum ^= what == 2;
                cfdp_pdu_write(&pdu, bytes.data(), bytes.size());
            }
        };
        link.ground.put("source", "target");
        for (int i = 0; i < 60000 && (link.ground.busy() || link.craft.busy()); i++) {
            link.step();
            for (auto &[at, packet] : link.flying) {
                if (at == link.now + link.delay) {
                    flip(packet.bytes);
                }
            }
        }
        link.expect_none(what == 1 ? CFDP_SIZE_ERROR : CFDP_CHECKSUM_FAILURE);
        EXPECT_EQ(link.ground.ended()->incomplete, 1);
    }
}

TEST(CfdpF2, a_closure_that_does_not_come_and_a_checksum_that_is_not_known)
{
    Link link;
    link.file(5000);
    link.drops = [](const CfdpPdu &pdu, bool) { return pdu.kind == CFDP_FINISHED; };
    link.ground.put("source", "target", 1, {}, 0, 1);
    link.finish();
    EXPECT_EQ(link.ground.ended()->condition, CFDP_CHECK_LIMIT);
    EXPECT_TRUE(link.craft.memory.has("target"));

    Link other;
    other.ground.remote.checksum = 2;                                     // CRC-32C
    other.craft.remote.handlers[CFDP_UNSUPPORTED_CHECKSUM] = CFDP_IGNORE; // which cannot be
    other.file(5000);
    other.ground.put("source", "target");
    other.finish();
    other.expect_none(CFDP_UNSUPPORTED_CHECKSUM);
}

TEST(CfdpF2, timers_of_zero_never_expire)
{
    Link link;
    for (CfdpRemote *remote : {&link.ground.remote, &link.craft.remote}) {
        remote->ack_timer = remote->nak_timer = remote->check_timer = remote->inactivity = 0;
    }
    link.delay = 30 * s;
    link.file(5000);
    link.ground.put("source", "target");
    link.finish();
    link.expect_whole();
    EXPECT_EQ(link.sent[CFDP_EOF], 1);
    EXPECT_EQ(link.sent[CFDP_FINISHED], 1);
}

TEST(CfdpF2, reports_and_requests_that_cannot_be)
{
    Link link(1, 2);
    link.file(300000);
    const CfdpId id = link.ground.put("source", "target");
    link.run(200 * ms);
    for (End *end : {&link.ground, &link.craft}) {
        EXPECT_EQ(cfdp_report(&end->cfdp, id), 1);
        EXPECT_EQ(end->events.back().what, CFDP_EVENT_REPORT);
        EXPECT_EQ(end->events.back().size, 300000u);
        EXPECT_EQ(end->events.back().receiver, end == &link.craft);
    }
    EXPECT_EQ(link.ground.events.back().progress, 199000u);
    EXPECT_EQ(link.craft.events.back().progress, 99000u);
    for (const CfdpId none : {CfdpId{1, 99}, CfdpId{2, 1}}) {
        EXPECT_EQ(cfdp_report(&link.ground.cfdp, none), 0);
        EXPECT_EQ(cfdp_suspend(&link.ground.cfdp, none), 0);
        EXPECT_EQ(cfdp_resume(&link.ground.cfdp, none), 0);
        EXPECT_EQ(cfdp_cancel(&link.ground.cfdp, none), 0);
        EXPECT_EQ(cfdp_prompt(&link.ground.cfdp, none, 1), 0);
    }
    EXPECT_EQ(cfdp_resume(&link.ground.cfdp, id), 0); // it is not suspended
    const std::string longest(CFDP_NAME - 1, 'n'), longer = longest + "n";
    const Bytes options(CFDP_OPTIONS + 1);
    CfdpPut put{};
    CfdpId made{};
    const auto result = [&](std::uint64_t to, const char *from, const char *target, std::size_t options_n = 0) {
        put.destination = to;
        put.from = from;
        put.to = target;
        put.options = options.data();
        put.options_n = options_n;
        return cfdp_put(&link.ground.cfdp, &put, &made);
    };
    EXPECT_EQ(result(3, "source", "target"), CFDP_REFUSED);
    EXPECT_EQ(result(2, "none", "target"), CFDP_ABSENT);
    EXPECT_EQ(result(2, "source", ""), CFDP_REFUSED);
    EXPECT_EQ(result(2, "source", longer.c_str()), CFDP_REFUSED);
    EXPECT_EQ(result(2, "source", "target", options.size()), CFDP_REFUSED);
    EXPECT_EQ(result(2, "source", longest.c_str()), 0);
    EXPECT_EQ(made.sequence, id.sequence + 1);
    EXPECT_EQ(result(2, "source", "target"), CFDP_FULL);
    // Nothing for another remote entity, and nothing while the link is out.
    Bytes bytes(2000);
    const CfdpRemote other{};
    EXPECT_EQ(cfdp_next(&link.ground.cfdp, &other, bytes.data(), bytes.size()), 0u);
    link.ground.remote.frozen = 1;
    EXPECT_EQ(cfdp_next(&link.ground.cfdp, &link.ground.remote, bytes.data(), bytes.size()), 0u);
    link.ground.remote.frozen = 0;
    EXPECT_GT(cfdp_next(&link.ground.cfdp, &link.ground.remote, bytes.data(), bytes.size()), 0u);
    // Acknowledgements wait for the link, too.
    CfdpPdu pdu{};
    pdu.kind = CFDP_EOF;
    pdu.condition = CFDP_CANCEL_REQUEST;
    pdu.source = id.source;
    pdu.sequence = 77;
    pdu.destination = 2;
    pdu.entity_bytes = 1;
    pdu.sequence_bytes = 4;
    link.craft.remote.frozen = 1;
    cfdp_take(&link.craft.cfdp, bytes.data(), cfdp_pdu_write(&pdu, bytes.data(), bytes.size()));
    EXPECT_EQ(cfdp_next(&link.craft.cfdp, nullptr, bytes.data(), bytes.size()), 0u);
    link.craft.remote.frozen = 0;
    EXPECT_GT(cfdp_next(&link.craft.cfdp, nullptr, bytes.data(), bytes.size()), 0u);
    // A PDU of the other class changes nothing.
    pdu.condition = 0;
    pdu.sequence = id.sequence;
    pdu.unacknowledged = 1;
    cfdp_take(&link.craft.cfdp, bytes.data(), cfdp_pdu_write(&pdu, bytes.data(), bytes.size()));
    EXPECT_EQ(link.craft.cfdp.live.faults[CCSDS_TYPE], 1u);
    link.finish();
    EXPECT_EQ(link.craft.memory.files["target"], link.ground.memory.files["source"]);
    EXPECT_EQ(link.craft.memory.files[longest], link.ground.memory.files["source"]);
}

TEST(CfdpF2, metadata_that_is_longer_than_the_link_takes_cancels)
{
    Link link;
    link.file(1000);
    Bytes options(500);
    options[0] = options[250] = CFDP_TLV_MESSAGE;
    options[1] = options[251] = 248;
    const CfdpId id = link.ground.put("source", "target", 0, options);
    Bytes bytes(CFDP_ROOM);
    CfdpPdu pdu{};
    const std::size_t n = cfdp_next(&link.ground.cfdp, nullptr, bytes.data(), bytes.size());
    ASSERT_EQ(cfdp_pdu_read(&pdu, bytes.data(), n), CCSDS_OK);
    EXPECT_EQ(pdu.kind, CFDP_EOF);
    EXPECT_EQ(pdu.sequence, id.sequence);
    EXPECT_EQ(pdu.condition, CFDP_INVALID_STRUCTURE);
    link.finish();
    EXPECT_EQ(link.ground.ended()->condition, CFDP_INVALID_STRUCTURE);
    EXPECT_FALSE(link.craft.memory.has("target"));
}

TEST(CfdpF2, a_handler_that_suspends_can_be_resumed_or_cancelled_at_any_state)
{
    // At the end, too: the file is delivered, or the transaction is cancelled, and the other end does not answer.
    for (const bool cancelled : {false, true}) {
        for (const bool of_craft : {false, true}) {
            Link link;
            link.ground.remote.handlers[CFDP_ACK_LIMIT] = link.craft.remote.handlers[CFDP_ACK_LIMIT] = CFDP_SUSPEND;
            link.ground.remote.inactivity = 20 * s;
            link.file(5000);
            link.drops = [=](const CfdpPdu &pdu, bool) {
                return pdu.kind == CFDP_ACK || (of_craft && pdu.kind == CFDP_FINISHED);
            };
            const CfdpId id = link.ground.put("source", "target");
            End &end = of_craft ? link.craft : link.ground;
            if (cancelled) {
                link.run(102 * ms);
                cfdp_cancel(&end.cfdp, id);
            }
            link.run(40 * s);
            for (End *side : {&link.ground, &link.craft}) {
                cfdp_cancel(&side->cfdp, id);
            }
            link.finish();
        }
    }
}

} // namespace cfdp_faults_test
