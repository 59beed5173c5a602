// SPDX-License-Identifier: Apache-2.0
// What an entity does where something seldom happens: a store that breaks at any call, PDUs made by hand, timers at the
// end of time, places that are kept, a reset at each state.
#include "ccsds/testing/cfdp_link.h"

#include <string>
#include <utility>
#include <vector>

namespace cfdp_guards_test {

using namespace ccsds::testing;

using Calls = std::map<std::string, int>; // of the store: from which on it breaks

/// A PDU of the ground's transaction with that number, to the craft; `bytes`: its data.
CfdpPdu pdu_of(CfdpKind kind, std::uint64_t sequence, const Bytes &bytes = {})
{
    CfdpPdu pdu{};
    pdu.kind = kind;
    pdu.source = 1;
    pdu.destination = 2;
    pdu.sequence = sequence;
    pdu.entity_bytes = 2;
    pdu.sequence_bytes = 4;
    pdu.to_sender = kind == CFDP_NAK || kind == CFDP_KEEP_ALIVE || kind == CFDP_ACK || kind == CFDP_FINISHED;
    pdu.data = bytes.data();
    pdu.n = bytes.size();
    return pdu;
}

CfdpText text(const std::string &of)
{
    return {reinterpret_cast<const std::uint8_t *>(of.data()), static_cast<std::uint8_t>(of.size())};
}

CfdpPdu metadata_of(std::uint64_t sequence, const std::string &from, const std::string &to, const Bytes &options = {})
{
    CfdpPdu pdu = pdu_of(CFDP_METADATA, sequence, options);
    pdu.from = text(from);
    pdu.to = text(to);
    return pdu;
}

void take(End &end, const CfdpPdu &pdu)
{
    Bytes bytes(3000);
    bytes.resize(cfdp_pdu_write(&pdu, bytes.data(), bytes.size()));
    ASSERT_FALSE(bytes.empty());
    cfdp_take(&end.cfdp, bytes.data(), bytes.size());
}

/// The next PDU of an end; its kind, -1: none.
int next_of(End &end)
{
    Bytes bytes(2000);
    CfdpPdu pdu{};
    const std::size_t n = cfdp_next(&end.cfdp, nullptr, bytes.data(), bytes.size());
    return n != 0 && cfdp_pdu_read(&pdu, bytes.data(), n) == CCSDS_OK ? pdu.kind : -1;
}

/// What a program that resets now finds in its memory again.
void reset(End &end, Clock now)
{
    const CfdpLive live = end.cfdp.live;
    const auto transactions = end.transactions;
    const auto past = end.past;
    end.memory.opened.clear();
    end.begin(1);
    end.cfdp.live = live;
    std::copy(transactions.begin(), transactions.end(), end.transactions.begin());
    std::copy(past.begin(), past.end(), end.past.begin());
    cfdp_restart(&end.cfdp, now);
}

// ---- stores

TEST(CfdpGuards, a_receiver_whose_store_breaks_rejects_the_file)
{
    const struct {
        std::size_t size;
        Calls fails;
        std::uint8_t checksum;
        int lost; // the PDU of data that is lost at first, 0: none
    } cases[] = {
        {0, {{"open", 1}}, CFDP_MODULAR, 0},    // an empty file is made at its end
        {5000, {{"open", 1}}, CFDP_MODULAR, 0}, // the first data
        {5000, {{"write", 3}}, CFDP_MODULAR, 0},  {5000, {{"write", 5}}, CFDP_MODULAR, 2}, // what fills a gap
        {5000, {{"read", 1}}, CFDP_CRC32, 2}, // what is read again for the checksum
        {5000, {{"rename", 1}}, CFDP_MODULAR, 0},
    };
    for (const auto &[size, fails, checksum, lost] : cases) {
        Link link;
        link.ground.remote.checksum = checksum;
        link.craft.memory.fails = fails;
        if (lost != 0) {
            link.drops = lose(CFDP_FILE_DATA, lost);
        }
        link.file(size);
        link.ground.put("source", "target");
        link.finish();
        link.expect_none(CFDP_FILESTORE_REJECTION);
        EXPECT_EQ(link.ground.ended()->file_status, CFDP_REJECTED) << fails.begin()->first;
        EXPECT_TRUE(link.craft.memory.files.empty());
    }
}

TEST(CfdpGuards, a_sender_whose_store_breaks_cancels_or_puts_nothing)
{
    Link link;
    link.file(5000);
    CfdpPut put{};
    CfdpId id{};
    put.destination = 2;
    put.from = "source";
    put.to = "target";
    link.ground.memory.fails = {{"size", 1}};
    EXPECT_EQ(cfdp_put(&link.ground.cfdp, &put, &id), CFDP_BROKEN);
    EXPECT_TRUE(link.ground.memory.opened.empty());
    const std::string longest(300, 'n'); // longer than a text's length can say
    put.from = longest.c_str();
    EXPECT_EQ(cfdp_put(&link.ground.cfdp, &put, &id), CFDP_REFUSED);
    EXPECT_FALSE(link.ground.busy());

    link.ground.memory.fails = {{"read", 3}};
    link.ground.put("source", "target");
    link.finish();
    link.expect_none(CFDP_FILESTORE_REJECTION);
    EXPECT_EQ(link.sent[CFDP_FILE_DATA], 2);

    Link gone; // the file is gone after a reset
    gone.file(5000);
    gone.ground.put("source", "target");
    gone.run(3 * ms);
    gone.ground.memory.files.clear();
    reset(gone.ground, gone.now);
    gone.finish();
    gone.expect_none(CFDP_FILESTORE_REJECTION);
}

/// What a request of the store is answered; 99: nothing.
int answer_to(Link &link, const Bytes &options)
{
    link.ground.events.clear();
    link.ground.put("", "", 0, options);
    link.finish();
    for (const Event &event : link.ground.events) {
        if (event.what == CFDP_EVENT_RESPONSE) {
            return event.text[0] & 15;
        }
    }
    return 99;
}

TEST(CfdpGuards, requests_to_a_store_that_breaks_leave_all_as_it_was)
{
    const struct {
        Bytes options;
        Calls fails;
        int status;
    } cases[] = {
        {request(CFDP_APPEND_FILE, "a", "b"), {{"open", 3}}, 3}, // after both were found: the new file
        {request(CFDP_APPEND_FILE, "a", "b"), {{"open", 4}}, 3}, // its own bytes
        {request(CFDP_APPEND_FILE, "a", "b"), {{"open", 5}}, 3}, // the other's
        {request(CFDP_APPEND_FILE, "a", "b"), {{"size", 1}}, 3},
        {request(CFDP_APPEND_FILE, "a", "b"), {{"read", 2}}, 3},
        {request(CFDP_APPEND_FILE, "a", "b"), {{"write", 1}}, 3},
        {request(CFDP_REPLACE_FILE, "a", "b"), {{"rename", 1}}, 3},
        {request(CFDP_DENY_FILE, "a"), {{"remove", 1}}, 2},
        {request(CFDP_RENAME_FILE, "a", ".cfdp0"), {}, 3},
        {request(CFDP_APPEND_FILE, "a", "../b"), {}, 3},
        {request(CFDP_APPEND_FILE, "../a", "b"), {}, 3},
    };
    for (const auto &[options, fails, status] : cases) {
        Link link;
        const std::map<std::string, Bytes> files{{"a", Bytes(10000, 1)}, {"b", {2}}};
        link.craft.memory.files = files;
        link.craft.memory.fails = fails;
        EXPECT_EQ(answer_to(link, options), status) << (fails.empty() ? "" : fails.begin()->first);
        EXPECT_EQ(link.craft.memory.files, files);
    }
    Link link; // parts of the file, one by one
    link.craft.memory.files = {{"a", Bytes(10000, 1)}, {"b", {2}}};
    Bytes whole(10000, 1);
    whole.push_back(2);
    EXPECT_EQ(answer_to(link, request(CFDP_APPEND_FILE, "a", "b")), 0);
    EXPECT_EQ(link.craft.memory.files["a"], whole);
}

// ---- messages

/// The value of the answer of that type; -1: there is none.
int value_of(const Link &link, CfdpMessageType type)
{
    for (const Event &event : link.ground.events) {
        CfdpMessage message{};
        const CfdpTlv tlv{{event.text.data(), static_cast<std::uint8_t>(event.text.size())}, CFDP_TLV_MESSAGE};
        if (event.what == CFDP_EVENT_MESSAGE && cfdp_message_read(&message, &tlv) == CCSDS_OK && message.type == type) {
            return message.value;
        }
    }
    return -1;
}

/// The same of the answer to a message.
int value_of(Link &link, const Bytes &options, CfdpMessageType type)
{
    link.ground.events.clear();
    link.ground.put("", "", 0, options);
    link.run(2 * s);
    return value_of(link, type);
}

TEST(CfdpGuards, lists_that_cannot_be_are_refused)
{
    const struct {
        Bytes options;
        Calls fails;
        int value;
    } cases[] = {
        {message(CFDP_LIST, "", ""), {}, 0x80},       // nowhere to write it to
        {message(CFDP_LIST, "", ".cfdp0"), {}, 0x80}, //
        {message(CFDP_LIST, ".cfdp", "names"), {}, 0x80},
        {message(CFDP_LIST, "", "names"), {{"open", 1}}, 0x80},
        {message(CFDP_LIST, "", "names"), {{"write", 1}}, 0x80},
        {message(CFDP_LIST, "", "names"), {{"open", 2}}, -1}, // it is written, and cannot be read
    };
    for (const auto &[options, fails, value] : cases) {
        Link link;
        link.craft.memory.files["a"] = {1};
        link.craft.memory.fails = fails;
        EXPECT_EQ(value_of(link, options, CFDP_LISTED), value);
        EXPECT_FALSE(link.ground.memory.has("names"));
        EXPECT_EQ(link.craft.memory.files.size(), 1u);
        link.finish();
    }
    Link link; // a name is cut, where a line would be longer than a PDU
    link.craft.memory.files[std::string(600, 'n')] = {};
    EXPECT_EQ(value_of(link, message(CFDP_LIST, "", "names"), CFDP_LISTED), 0);
    EXPECT_EQ(link.ground.memory.files["names"].size(), CFDP_ROOM + 1u);
    link.craft.remote.allowed = CFDP_ALLOW_PROXY;
    EXPECT_EQ(value_of(link, message(CFDP_LIST, "", "names"), CFDP_LISTED), -1);
    for (const auto &[from, to] : {std::pair{".cfdp0", "got"}, {"a", ".cfdp0"}}) {
        link.craft.memory.files["a"] = {1};
        EXPECT_EQ(value_of(link, message(CFDP_PROXY_PUT, from, to, 1), CFDP_PROXY_PUT_RESPONSE),
                  CFDP_FILESTORE_REJECTION << 4 | 4 | CFDP_REJECTED);
    }
}

Bytes about(CfdpMessageType type, CfdpId id, const std::string &file = "")
{
    CfdpMessage fields{};
    fields.type = static_cast<std::uint8_t>(type);
    fields.entity = id.source;
    fields.sequence = id.sequence;
    fields.entity_bytes = fields.sequence_bytes = 4;
    fields.first = text(file);
    Bytes bytes(200);
    bytes.resize(cfdp_message_write(&fields, bytes.data(), bytes.size()));
    return bytes;
}

/// A craft that sends `science` to entity 7, as the ground requested by proxy.
struct Proxy : Link {
    CfdpRemote remotes[2];
    CfdpId requested{}, id{2, 1};

    Proxy() : remotes{craft.remote, craft.remote}
    {
        remotes[1].entity = 7;
        remotes[1].inactivity = remotes[1].ack_timer = 0; // it is silent
        craft.cfdp.set.remotes = remotes;
        craft.cfdp.set.remotes_n = 2;
        craft.memory.files["science"] = any_bytes(random, 5000);
        drops = [](const CfdpPdu &of, bool) { return of.destination == 7; };
        requested = ground.put("", "", 0, message(CFDP_PROXY_PUT, "science", "got", 7));
        run(1 * s);
        EXPECT_EQ(sending().state, CFDP_SENT);
    }
    CfdpTransaction &sending() { return craft.transactions[id.sequence == 1 ? place() : 0]; }
    std::size_t place() const
    {
        for (std::size_t i = 0; i < craft.transactions.size(); i++) {
            if (craft.transactions[i].peer == 7) {
                return i;
            }
        }
        return 0;
    }
};

TEST(CfdpGuards, suspension_is_for_the_entity_that_requested_by_proxy)
{
    Proxy link;
    EXPECT_EQ(value_of(link, about(CFDP_REMOTE_SUSPEND, link.id), CFDP_REMOTE_SUSPENDED), 0x80 | CFDP_ACTIVE << 5);
    link.craft.memory.fails = {{"open", 1}};
    EXPECT_EQ(value_of(link, about(CFDP_REMOTE_REPORT, link.id, "report"), CFDP_REMOTE_REPORTED), CFDP_ACTIVE << 6 | 1);
    link.craft.memory.fails.clear();
    for (const char *file : {"", ".cfdp1"}) {
        EXPECT_EQ(value_of(link, about(CFDP_REMOTE_REPORT, link.id, file), CFDP_REMOTE_REPORTED), CFDP_ACTIVE << 6 | 1);
    }
    EXPECT_EQ(value_of(link, about(CFDP_REMOTE_RESUME, link.id), CFDP_REMOTE_RESUMED), CFDP_ACTIVE << 5);
    link.sending().condition = CFDP_NAK_LIMIT; // it ends already
    EXPECT_EQ(value_of(link, about(CFDP_REMOTE_SUSPEND, link.id), CFDP_REMOTE_SUSPENDED), CFDP_ACTIVE << 5);
    link.sending().condition = 0;
    link.sending().origin.source = 9;
    EXPECT_EQ(value_of(link, about(CFDP_REMOTE_SUSPEND, link.id), CFDP_REMOTE_SUSPENDED), CFDP_UNRECOGNIZED << 5);
    EXPECT_EQ(link.craft.count(CFDP_EVENT_SUSPENDED), 1);
}

TEST(CfdpGuards, cancel_by_proxy_is_for_what_its_message_names)
{
    const std::vector<std::pair<void (*)(CfdpTransaction &), int>> cases{
        {[](CfdpTransaction &) {}, 1},
        {[](CfdpTransaction &t) { t.proxy = 0; }, 0},
        {[](CfdpTransaction &t) { t.condition = CFDP_NAK_LIMIT; }, 0},
        {[](CfdpTransaction &t) { t.origin.source = 9; }, 0},
        {[](CfdpTransaction &t) { t.origin.sequence++; }, 0},
    };
    for (const auto &[change, cancelled] : cases) {
        Proxy link;
        change(link.sending());
        const auto condition = link.sending().condition;
        link.ground.put("", "", 0, joined({message(CFDP_PROXY_CANCEL), about(CFDP_ORIGIN, link.requested)}));
        link.run(2 * s);
        EXPECT_EQ(link.sending().state, CFDP_SENT);
        EXPECT_EQ(link.sending().condition, cancelled != 0 ? int{CFDP_CANCEL_REQUEST} : int{condition});
    }
}

// ---- PDUs by hand

TEST(CfdpGuards, metadata_that_cannot_be_is_rejected)
{
    const std::string longest(CFDP_NAME, 'n');
    for (const auto &[from, to, options] : {std::tuple{std::string("a"), longest, Bytes{}},
                                            {"a", std::string("b\0c", 3), {}},
                                            {"", "b", {}},
                                            {"a", "", {}},
                                            {"a", "b", Bytes(CFDP_OPTIONS + 2)},
                                            {"a", "b", Bytes{CFDP_TLV_REQUEST, 0}}}) {
        Link link;
        take(link.craft, metadata_of(5, from, to, options));
        EXPECT_EQ(link.craft.count(CFDP_EVENT_FAULT, CFDP_FILESTORE_REJECTION), 1) << from << to;
        EXPECT_EQ(link.craft.transactions[0].state, CFDP_FINISHING);
        EXPECT_EQ(link.craft.count(CFDP_EVENT_STARTED), 0);
    }
}

TEST(CfdpGuards, a_file_of_unknown_size_ends_with_its_eof)
{
    Link link;
    const Bytes data{1, 2, 3, 4, 5, 6, 7, 8};
    take(link.craft, metadata_of(5, "a", "target"));
    take(link.craft, pdu_of(CFDP_FILE_DATA, 5)); // without data: nothing
    EXPECT_EQ(link.craft.transactions[0].progress, 0u);
    EXPECT_TRUE(link.craft.memory.files.empty());
    take(link.craft, pdu_of(CFDP_FILE_DATA, 5, data));
    CfdpPdu eof = pdu_of(CFDP_EOF, 5);
    eof.offset = 8;
    eof.checksum = 0x01020304 + 0x05060708;
    take(link.craft, eof);
    EXPECT_EQ(link.craft.memory.files["target"], data);
    // It is delivered: nothing of it is cancelled, and a prompt changes nothing.
    const CfdpTransaction &t = link.craft.transactions[0];
    EXPECT_EQ(t.state, CFDP_FINISHING);
    EXPECT_EQ(cfdp_cancel(&link.craft.cfdp, {1, 5}), 0);
    const auto due = t.due;
    take(link.craft, pdu_of(CFDP_PROMPT, 5));
    EXPECT_EQ(t.due, due);
    EXPECT_EQ(t.state, CFDP_FINISHING);
}

TEST(CfdpGuards, prompts_are_for_class_2)
{
    Link link;
    link.file(300000);
    const CfdpId id = link.ground.put("source", "target", 1);
    link.run(110 * ms);
    EXPECT_EQ(cfdp_prompt(&link.ground.cfdp, id, 1), 0);
    CfdpPdu prompt = pdu_of(CFDP_PROMPT, id.sequence);
    prompt.unacknowledged = 1;
    take(link.craft, prompt);
    EXPECT_EQ(link.craft.transactions[0].due, 0);
    link.finish();
    link.expect_whole();
    EXPECT_EQ(link.sent[CFDP_NAK], 0);
}

TEST(CfdpGuards, pdus_that_contradict_their_transaction_are_counted)
{
    Link link;
    CfdpRemote remotes[] = {link.ground.remote, link.ground.remote};
    remotes[1].entity = 7;
    link.ground.cfdp.set.remotes = remotes;
    link.ground.cfdp.set.remotes_n = 2;
    link.file(5000);
    const CfdpId id = link.ground.put("source", "target");
    link.run(2 * ms);
    const CfdpTransaction before = link.ground.transactions[0];
    CfdpPdu finished = pdu_of(CFDP_FINISHED, id.sequence);
    finished.destination = 7; // known, but not the receiver of this file
    take(link.ground, finished);
    EXPECT_EQ(link.ground.cfdp.live.faults[CCSDS_CHANNEL], 1u);
    finished.destination = 2;
    finished.large = 1;
    take(link.ground, finished);
    EXPECT_EQ(link.ground.cfdp.live.faults[CCSDS_TYPE], 1u);
    EXPECT_EQ(link.ground.transactions[0].state, before.state);
    EXPECT_EQ(link.ground.cfdp.live.answers_n, 0u);
    link.finish();
    link.expect_whole();
}

TEST(CfdpGuards, what_cannot_be_acknowledged_counts_as_not_received)
{
    Link link;
    const auto fill = [](End &end, CfdpPdu pdu) {
        for (pdu.sequence = 700; end.cfdp.live.answers_n < CFDP_ANSWERS; pdu.sequence++) {
            take(end, pdu);
        }
    };
    link.file(3000);
    const CfdpId id = link.ground.put("source", "target");
    link.run(103 * ms); // data arrives
    CfdpPdu stray = pdu_of(CFDP_EOF, 0);
    stray.condition = CFDP_CANCEL_REQUEST;
    fill(link.craft, stray);
    CfdpPdu eof = pdu_of(CFDP_EOF, id.sequence);
    eof.offset = 3000;
    take(link.craft, eof);
    EXPECT_EQ(link.craft.transactions[0].eof, 0);
    fill(link.ground, pdu_of(CFDP_FINISHED, 0));
    take(link.ground, pdu_of(CFDP_FINISHED, id.sequence));
    EXPECT_FALSE(link.ground.ended().has_value());
    for (const End *end : {&link.ground, &link.craft}) {
        EXPECT_EQ(end->cfdp.live.faults[CCSDS_ROOM], 1u);
    }
    link.finish();
    link.expect_whole();
}

TEST(CfdpGuards, a_sender_that_is_cancelled_takes_no_naks_and_waits_for_the_right_acknowledgement)
{
    Link link;
    link.file(5000);
    const CfdpId id = link.ground.put("source", "target");
    link.drops = [](const CfdpPdu &, bool) { return true; };
    link.run(20 * ms);
    CfdpTransaction &t = link.ground.transactions[0];
    ASSERT_EQ(t.state, CFDP_SENT);
    ASSERT_EQ(cfdp_cancel(&link.ground.cfdp, id), 1);
    Bytes segment(8);
    ccsds_put32(&segment[4], 1000);
    take(link.ground, pdu_of(CFDP_NAK, id.sequence, segment));
    EXPECT_EQ(t.ranges, 0u);
    CfdpPdu ack = pdu_of(CFDP_ACK, id.sequence);
    ack.acknowledged = CFDP_EOF;
    take(link.ground, ack); // of the EOF before
    EXPECT_EQ(t.state, CFDP_SENT);
    EXPECT_EQ(next_of(link.ground), CFDP_EOF);
    take(link.ground, ack);
    EXPECT_EQ(link.ground.ended()->condition, CFDP_CANCEL_REQUEST);
    EXPECT_FALSE(link.ground.busy());
}

TEST(CfdpGuards, keep_alives_tell_how_far_the_receiver_is_behind)
{
    for (const auto &[behind, faults] : {std::pair{0, 0}, {2000, 0}, {2001, 1}, {-1, 0}}) {
        Link link;
        link.ground.remote.keep_alive_limit = 2000;
        link.file(50000);
        const CfdpId id = link.ground.put("source", "target");
        link.run(10 * ms);
        CfdpPdu alive = pdu_of(CFDP_KEEP_ALIVE, id.sequence);
        alive.offset = link.ground.transactions[0].progress - static_cast<std::uint64_t>(behind);
        take(link.ground, alive);
        EXPECT_EQ(link.ground.count(CFDP_EVENT_FAULT, CFDP_KEEP_ALIVE_LIMIT), faults) << behind;
    }
}

// ---- room, places, time

TEST(CfdpGuards, a_link_of_short_pdus)
{
    Link link(1, 1, 100);
    link.pdu.resize(CFDP_ROOM);
    link.ground.memory.files["source"] = any_bytes(link.random, 200000);
    link.drops = [n = 0](const CfdpPdu &pdu, bool) mutable {
        return pdu.kind == CFDP_FILE_DATA && n < 140 && n++ % 2 == 0;
    };
    link.ground.put("source", "target");
    link.finish();
    link.expect_whole();
    EXPECT_EQ(link.sent[CFDP_FILE_DATA], 70 + (200000 + 493) / 494); // 512 bytes but for 18 of the head and of a check
    EXPECT_EQ(link.sent[CFDP_NAK], 2);                               // of 61 ranges at most
}

TEST(CfdpGuards, a_nak_without_room_for_the_end_of_the_file_is_followed_by_one)
{
    Link link;
    link.craft.remote.segment = 16; // two ranges
    link.file(6000);
    std::set<std::uint64_t> lost{1000, 3000, 5000};
    link.drops = [&](const CfdpPdu &pdu, bool) { return pdu.kind == CFDP_FILE_DATA && lost.erase(pdu.offset) != 0; };
    link.ground.put("source", "target");
    link.finish(3 * s);
    link.expect_whole();
    EXPECT_EQ(link.sent[CFDP_NAK], 2);
    EXPECT_EQ(link.sent[CFDP_FILE_DATA], 9);
}

TEST(CfdpGuards, a_file_that_comes_takes_the_place_of_a_silent_one_if_it_may)
{
    const Bytes data(10);
    enum Way { REPLACES, KEPT, ENDLESS, FROZEN, DELIVERED, TAKEN };
    for (const Way way : {REPLACES, KEPT, ENDLESS, FROZEN, DELIVERED, TAKEN}) {
        Link link(1, way == KEPT ? 2 : 1);
        link.craft.cfdp.set.kept = way == KEPT;
        link.craft.remote.inactivity = way == ENDLESS ? 0 : 60 * s;
        link.craft.remote.ack_timer = 0;
        link.craft.memory.files["other"] = {1};
        if (way == DELIVERED) {
            take(link.craft, metadata_of(5, "", ""));
            CfdpPdu eof = pdu_of(CFDP_EOF, 5);
            take(link.craft, eof);
            ASSERT_EQ(link.craft.transactions[0].state, CFDP_FINISHING);
        } else {
            take(link.craft, pdu_of(CFDP_FILE_DATA, 5, data));
        }
        cfdp_time(&link.craft.cfdp, 5 * s);
        link.craft.remote.frozen = way == FROZEN;
        if (way == TAKEN) { // by what the user puts at that moment
            link.craft.on_event = [&](const CfdpEvent &event) {
                if (event.what == CFDP_EVENT_ENDED) {
                    link.craft.put("other", "other");
                }
            };
        }
        take(link.craft, pdu_of(CFDP_FILE_DATA, 6, data));
        const bool replaces = way == REPLACES || way == KEPT || way == DELIVERED;
        const CfdpTransaction &place = link.craft.transactions.back();
        EXPECT_EQ(place.id.sequence, replaces ? 6u : way == TAKEN ? 1u : 5u) << way;
        EXPECT_EQ(link.craft.cfdp.live.faults[CCSDS_ROOM], replaces ? 0u : 1u) << way;
        EXPECT_EQ(link.craft.count(CFDP_EVENT_ENDED, CFDP_INACTIVITY),
                  way == DELIVERED || way == ENDLESS || way == FROZEN ? 0 : 1);
        EXPECT_EQ(link.craft.count(CFDP_EVENT_ENDED, CFDP_NO_ERROR), way == DELIVERED);
    }
}

/// Numbers that need more bytes than the setup gives them get as many: none is cut, and both ends agree.
TEST(CfdpGuards, numbers_of_any_size_are_whole)
{
    const std::uint64_t sizes[][2] = {{3, 1},
                                      {0xFFFF, 0xFFFFFFFF},
                                      {0x10000, 0x100000000},
                                      {0xFFFFFFFFFFFFFF, 0xFFFFFFFFFFFFFF},
                                      {UINT64_MAX - 1, UINT64_MAX - 7}};
    const std::size_t widths[][2] = {{2, 4}, {2, 4}, {3, 5}, {7, 7}, {8, 8}};
    for (std::size_t i = 0; i < std::size(sizes); i++) {
        SCOPED_TRACE(i);
        const auto [entity, sequence] = sizes[i];
        for (const bool own : {false, true}) { // which of the ids is large
            Link link(1);
            link.ground.entity = link.craft.remote.entity = own ? entity : 1;
            link.craft.entity = link.ground.remote.entity = own ? 2 : entity;
            link.ground.begin(sequence);
            link.craft.begin(sequence);
            link.file(3000);
            const CfdpId id = link.ground.put("source", "target");
            EXPECT_EQ(id.sequence, sequence);
            Bytes pdu(CFDP_ROOM);
            pdu.resize(cfdp_next(&link.ground.cfdp, nullptr, pdu.data(), pdu.size()));
            ASSERT_GT(pdu.size(), 28u);
            const std::size_t ids = (pdu[3] >> 4 & 7u) + 1u, numbers = (pdu[3] & 7u) + 1u;
            EXPECT_EQ(ids, widths[i][0]);
            EXPECT_EQ(numbers, widths[i][1]);
            const auto number = [&](std::size_t at, std::size_t n) {
                std::uint64_t value = 0;
                for (; n != 0; n--) {
                    value = value * 256 + pdu[at++];
                }
                return value;
            };
            EXPECT_EQ(number(4, ids), link.ground.entity);
            EXPECT_EQ(number(4 + ids, numbers), sequence);
            EXPECT_EQ(number(4 + ids + numbers, ids), link.craft.entity);
            cfdp_take(&link.craft.cfdp, pdu.data(), pdu.size());
            link.finish();
            link.expect_whole();
        }
    }
}

/// PDUs of a file that is not large name offsets up to 2^32 - 1: data behind them is a wrong size, and not cut.
TEST(CfdpGuards, data_behind_what_its_pdus_can_name_is_a_wrong_size)
{
    for (const std::uint8_t large : {std::uint8_t{0}, std::uint8_t{1}}) {
        Link link(1);
        const Bytes two(2, 1);
        CfdpPdu pdu{};
        pdu.kind = CFDP_FILE_DATA;
        pdu.large = large;
        pdu.source = link.ground.entity;
        pdu.destination = link.craft.entity;
        pdu.sequence = 9;
        pdu.entity_bytes = pdu.sequence_bytes = 2;
        pdu.data = two.data();
        pdu.n = 2;
        pdu.offset = large ? UINT64_C(1) << 63 : UINT32_MAX - 1;
        Bytes bytes(100);
        bytes.resize(cfdp_pdu_write(&pdu, bytes.data(), bytes.size()));
        cfdp_take(&link.craft.cfdp, bytes.data(), bytes.size());
        ASSERT_TRUE(link.craft.events.size() != 0);
        EXPECT_EQ(link.craft.events.front().what, CFDP_EVENT_FAULT);
        EXPECT_EQ(link.craft.events.front().condition, CFDP_SIZE_ERROR);
    }
}

TEST(CfdpGuards, an_entity_that_records_no_past)
{
    Link link;
    link.craft.cfdp.set.past_n = 0;
    link.file(5000);
    link.ground.put("source", "target");
    link.finish();
    link.expect_whole();
}

TEST(CfdpGuards, timers_at_the_end_of_time)
{
    constexpr Clock end = INT64_MAX - 50;
    Link link;
    link.file(5000);
    cfdp_time(&link.ground.cfdp, end - 10 * s);
    link.ground.remote.inactivity = 10 * s;
    const CfdpId id = link.ground.put("source", "target");
    ASSERT_EQ(link.ground.transactions[0].inactive, end);
    ASSERT_EQ(cfdp_suspend(&link.ground.cfdp, id), 1);
    cfdp_time(&link.ground.cfdp, end - 10 * s + 51); // what would pass the end stays
    EXPECT_EQ(link.ground.transactions[0].inactive, end);
    link.ground.put("source", "other"); // and what would begin behind it does not run
    EXPECT_EQ(link.ground.transactions[1].inactive, INT64_MAX);
}

TEST(CfdpGuards, transactions_rest_while_their_entity_is_not_known)
{
    for (const bool of_craft : {false, true}) {
        for (const int class1 : {0, 1}) {
            Link link;
            link.file(300000);
            auto data = lose(CFDP_FILE_DATA, 150);
            link.drops = [&](const CfdpPdu &pdu, bool up) { return class1 == 0 && data(pdu, up); };
            const CfdpId id = link.ground.put("source", "target", class1);
            link.run(of_craft ? 250 * ms : 150 * ms);
            End &end = of_craft ? link.craft : link.ground;
            CfdpPdu stray = pdu_of(of_craft ? CFDP_EOF : CFDP_FINISHED, 77);
            stray.condition = CFDP_CANCEL_REQUEST;
            take(end, stray);
            const std::uint64_t entity = std::exchange(end.remote.entity, 9);
            ASSERT_EQ(cfdp_suspend(&end.cfdp, id), 1);
            ASSERT_EQ(cfdp_resume(&end.cfdp, id), 1);
            reset(end, link.now);
            for (Clock now = link.now; now < link.now + 100 * s; now += s) {
                cfdp_time(&end.cfdp, now);
                EXPECT_EQ(next_of(end), -1);
            }
            EXPECT_EQ(end.count(CFDP_EVENT_FAULT), 0);
            EXPECT_EQ(end.cfdp.live.answers_n, 1u);
            end.remote.entity = entity;
            reset(end, link.now);
            link.finish();
            link.expect_whole();
        }
    }
}

// ---- faults

TEST(CfdpGuards, inactivity_after_the_eof_is_a_fault_of_a_file_that_misses_data)
{
    Link link;
    link.craft.remote.nak_timer = 0;
    link.file(5000);
    link.drops = [](const CfdpPdu &pdu, bool up) { // the ground falls silent after its EOF
        return !up || pdu.condition != 0 || (pdu.kind == CFDP_FILE_DATA && pdu.offset == 1000);
    };
    link.ground.remote.ack_limit = 1;
    link.ground.put("source", "target");
    link.run(70 * s);
    EXPECT_EQ(link.craft.count(CFDP_EVENT_FAULT, CFDP_INACTIVITY), 1);
    EXPECT_FALSE(link.craft.memory.has("target"));
}

TEST(CfdpGuards, a_second_fault_abandons_where_its_handler_says_so)
{
    for (const std::uint8_t handler : {CFDP_CANCEL, CFDP_ABANDON}) {
        Link link;
        link.file(5000);
        link.drops = [](const CfdpPdu &, bool) { return true; };
        link.ground.remote.handlers[CFDP_ACK_LIMIT] = handler;
        const Bytes options{CFDP_TLV_HANDLER, 2, CFDP_ACK_LIMIT << 4 | CFDP_IGNORE, 0}; // too long: none
        const CfdpId id = link.ground.put("source", "target", 0, options);
        link.run(20 * ms);
        ASSERT_EQ(cfdp_cancel(&link.ground.cfdp, id), 1);
        link.finish();
        EXPECT_EQ(link.ground.count(CFDP_EVENT_FAULT, CFDP_ACK_LIMIT), 1);
        EXPECT_EQ(link.ground.count(CFDP_EVENT_ABANDONED, CFDP_ACK_LIMIT), handler == CFDP_ABANDON);
        EXPECT_EQ(link.ground.count(CFDP_EVENT_ENDED, CFDP_CANCEL_REQUEST), handler == CFDP_CANCEL);
    }
}

// ---- resets

TEST(CfdpGuards, a_reset_before_any_data_and_one_while_the_checksum_is_read)
{
    for (const bool checks : {false, true}) {
        Link link;
        link.ground.remote.checksum = checks ? CFDP_CRC32 : CFDP_MODULAR;
        link.file(100000);
        bool lost = false;
        link.drops = [&](const CfdpPdu &pdu, bool) {
            return pdu.kind == CFDP_FILE_DATA && (checks ? !std::exchange(lost, true) : link.now < 200 * ms);
        };
        link.ground.put("source", "target");
        const auto state = [&] { return link.craft.transactions[0].state; };
        while (state() != (checks ? CFDP_CHECKING : CFDP_RECEIVING)) {
            ASSERT_LT(link.now, 10 * s);
            link.step();
        }
        ASSERT_EQ(link.craft.transactions[0].created, checks);
        reset(link.craft, link.now);
        EXPECT_EQ(link.craft.transactions[0].checked, 0u);
        link.finish();
        link.expect_whole();
    }
}

TEST(CfdpGuards, a_file_that_is_gone_after_a_reset_stays_suspended_however_often_it_is_resumed)
{
    Link link;
    link.craft.remote.handlers[CFDP_FILESTORE_REJECTION] = CFDP_SUSPEND;
    link.file(300000);
    const CfdpId id = link.ground.put("source", "target");
    link.run(200 * ms);
    link.craft.memory.files.clear();
    link.drops = [](const CfdpPdu &, bool) { return true; };
    reset(link.craft, link.now);
    for (int i = 1; i < 4; i++) {
        link.run(200 * ms);
        EXPECT_EQ(link.craft.transactions[0].suspended, 1);
        EXPECT_EQ(link.craft.count(CFDP_EVENT_FAULT, CFDP_FILESTORE_REJECTION), i);
        EXPECT_EQ(cfdp_resume(&link.craft.cfdp, id), 1);
    }
    EXPECT_TRUE(link.craft.memory.files.empty());
}

} // namespace cfdp_guards_test
