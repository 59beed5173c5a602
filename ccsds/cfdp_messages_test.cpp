// SPDX-License-Identifier: Apache-2.0
// The series F3 of the standard's test plan: the store, proxies and directories.
#include "ccsds/testing/cfdp_link.h"

#include <algorithm>
#include <string>
#include <vector>

namespace cfdp_messages_test {

using namespace ccsds::testing;

TEST(CfdpF3, requests_to_the_store)
{
    const auto status = [](const Bytes &options, Link &link) {
        link.ground.events.clear();
        link.ground.put("", "", 0, options);
        link.finish();
        std::vector<int> found;
        for (const Event &event : link.ground.events) {
            if (event.what == CFDP_EVENT_RESPONSE) {
                found.push_back(event.text[0] & 15);
            }
        }
        return found;
    };
    using Found = std::vector<int>;
    Link link;
    auto &files = link.craft.memory.files;
    EXPECT_EQ(status(request(CFDP_CREATE_FILE, "a"), link), Found{0});
    EXPECT_TRUE(link.craft.memory.has("a"));
    EXPECT_EQ(status(request(CFDP_CREATE_FILE, "a"), link), Found{1}); // it is there
    files["a"] = {1, 2};
    files["b"] = {3};
    EXPECT_EQ(status(request(CFDP_APPEND_FILE, "a", "b"), link), Found{0});
    EXPECT_EQ(files["a"], (Bytes{1, 2, 3}));
    EXPECT_EQ(status(request(CFDP_REPLACE_FILE, "a", "b"), link), Found{0});
    EXPECT_EQ(files["a"], Bytes{3});
    EXPECT_EQ(files["b"], Bytes{3});
    EXPECT_EQ(status(request(CFDP_APPEND_FILE, "none", "b"), link), Found{1});
    EXPECT_EQ(status(request(CFDP_REPLACE_FILE, "a", "none"), link), Found{2});
    EXPECT_EQ(status(request(CFDP_RENAME_FILE, "a", "b"), link), Found{2}); // the new name is there
    EXPECT_EQ(status(request(CFDP_RENAME_FILE, "none", "c"), link), Found{1});
    EXPECT_EQ(status(request(CFDP_RENAME_FILE, "a", "../c"), link), Found{3});
    EXPECT_EQ(status(request(CFDP_RENAME_FILE, "a", "c"), link), Found{0});
    EXPECT_FALSE(link.craft.memory.has("a"));
    EXPECT_EQ(files["c"], Bytes{3});
    EXPECT_EQ(status(request(CFDP_DELETE_FILE, "a"), link), Found{1});
    EXPECT_EQ(status(request(CFDP_DENY_FILE, "a"), link), Found{0});
    EXPECT_EQ(status(request(CFDP_CREATE_DIRECTORY, "d"), link), Found{0});
    EXPECT_EQ(status(request(CFDP_CREATE_DIRECTORY, "d"), link), Found{1});
    EXPECT_EQ(status(request(CFDP_REMOVE_DIRECTORY, "d"), link), Found{0});
    EXPECT_EQ(status(request(CFDP_REMOVE_DIRECTORY, "d"), link), Found{1});
    EXPECT_EQ(status(request(CFDP_DENY_DIRECTORY, "d"), link), Found{0});
    // After one that fails, the others are not performed.
    EXPECT_EQ(status(joined({request(CFDP_DELETE_FILE, "b"), request(CFDP_DELETE_FILE, "none"),
                             request(CFDP_DELETE_FILE, "c")}),
                     link),
              (Found{0, 1, 15}));
    EXPECT_FALSE(link.craft.memory.has("b"));
    EXPECT_TRUE(link.craft.memory.has("c"));
    EXPECT_EQ(status(request(CFDP_DELETE_FILE, ".cfdp0"), link), Found{2}); // unfinished files are not for peers
    Bytes most;
    for (int i = 0; i < CFDP_REQUESTS; i++) {
        most = joined({most, request(CFDP_DENY_FILE, "n")});
    }
    EXPECT_EQ(status(most, link), Found(CFDP_REQUESTS, 0));
    EXPECT_EQ(status(joined({most, request(CFDP_DELETE_FILE, "c")}), link), Found{}); // too many: none is done
    EXPECT_EQ(link.ground.ended()->condition, CFDP_FILESTORE_REJECTION);
    link.craft.remote.allowed = 0;
    EXPECT_EQ(status(request(CFDP_DELETE_FILE, "c"), link), Found{2});
    EXPECT_TRUE(link.craft.memory.has("c"));
}

TEST(CfdpF3, requests_wait_for_the_file_and_are_done_once)
{
    Link link;
    link.file(3000);
    link.craft.memory.files["log"] = {7};
    auto data = lose(CFDP_FILE_DATA, 2), finished = lose(CFDP_FINISHED), metadata = lose(CFDP_METADATA);
    link.drops = [&](const CfdpPdu &pdu, bool up) { return data(pdu, up) || finished(pdu, up) || metadata(pdu, up); };
    link.twice = 0.5;
    link.ground.put("source", "target", 0, request(CFDP_APPEND_FILE, "log", "target"));
    link.finish();
    link.expect_whole();
    EXPECT_EQ(link.craft.memory.files["log"].size(), 3001u);
    EXPECT_EQ(link.ground.count(CFDP_EVENT_RESPONSE), 1);
}

TEST(CfdpF3, get_by_proxy)
{
    for (const std::uint8_t mode : {0, 1}) {
        Link link;
        link.craft.memory.files["science"] = any_bytes(link.random, 30000);
        link.ground.put("", "", 0,
                        joined({message(CFDP_PROXY_PUT, "science", "got", 1), message(CFDP_PROXY_MODE, "", "", 0, mode),
                                message(CFDP_PROXY_MESSAGE, "note")}));
        link.finish();
        EXPECT_EQ(link.ground.memory.files["got"], link.craft.memory.files["science"]);
        // The ground has the message of the file, then the response: no error, whole; and for which transaction.
        std::vector<Bytes> texts;
        for (const Event &event : link.ground.events) {
            if (event.what == CFDP_EVENT_MESSAGE) {
                texts.push_back(event.text);
            }
        }
        ASSERT_EQ(texts.size(), 3u);
        EXPECT_EQ(texts[0], (Bytes{'n', 'o', 't', 'e'}));
        EXPECT_EQ(texts[1], (Bytes{'c', 'f', 'd', 'p', CFDP_PROXY_PUT_RESPONSE,
                                   static_cast<std::uint8_t>(mode == 0 ? CFDP_RETAINED : CFDP_UNREPORTED)}));
        CfdpMessage origin{};
        const CfdpTlv tlv{{texts[2].data(), static_cast<std::uint8_t>(texts[2].size())}, CFDP_TLV_MESSAGE};
        ASSERT_EQ(cfdp_message_read(&origin, &tlv), CCSDS_OK);
        EXPECT_EQ(origin.type, CFDP_ORIGIN);
        EXPECT_EQ(origin.entity, 1u);
        EXPECT_EQ(origin.sequence, 1u);
    }
    Link options; // the options with which the requested file is sent
    Bytes found;
    options.drops = [&](const CfdpPdu &pdu, bool up) {
        if (!up && pdu.kind == CFDP_METADATA && pdu.from.n != 0) {
            found.assign(pdu.data, pdu.data + pdu.n);
            EXPECT_EQ(pdu.closure, 1);
            EXPECT_EQ(pdu.unacknowledged, 1);
        }
        return false;
    };
    options.craft.memory.files["science"] = {1};
    options.ground.put("", "", 0,
                       joined({message(CFDP_PROXY_PUT, "science", "got", 1), message(CFDP_PROXY_MODE, "", "", 0, 1),
                               message(CFDP_PROXY_CLOSURE, "", "", 0, 1), message(CFDP_PROXY_MESSAGE, "hi"),
                               message(CFDP_PROXY_HANDLER, "", "", 0, CFDP_INACTIVITY << 4 | CFDP_ABANDON),
                               message(CFDP_PROXY_FLOW, "f"), message(CFDP_PROXY_REQUEST, std::string("\x70\1a", 3))}));
    options.finish();
    EXPECT_EQ(found, (Bytes{2, 2, 'h', 'i', 4, 1, CFDP_INACTIVITY << 4 | CFDP_ABANDON, 5, 1, 'f', 0, 3, 0x70, 1, 'a'}));
    Link link; // a file that is not there, and one that may not be requested
    for (const std::uint8_t allowed : {CFDP_ALLOW_PROXY, CFDP_ALLOW_LIST}) {
        link.craft.remote.allowed = allowed;
        link.craft.memory.files["secret"] = {1};
        link.ground.put("", "", 0, message(CFDP_PROXY_PUT, allowed == CFDP_ALLOW_PROXY ? "none" : "secret", "got", 1));
        link.finish();
        const auto events =
            std::find_if(link.ground.events.rbegin(), link.ground.events.rend(), [](const Event &event) {
                return event.what == CFDP_EVENT_MESSAGE && event.text[4] == CFDP_PROXY_PUT_RESPONSE;
            });
        ASSERT_NE(events, link.ground.events.rend());
        EXPECT_EQ(events->text[5], CFDP_FILESTORE_REJECTION << 4 | 4 | CFDP_REJECTED);
        EXPECT_FALSE(link.ground.memory.has("got"));
        link.ground.events.clear();
    }
}

TEST(CfdpF3, cancel_by_proxy)
{
    Link link;
    link.craft.memory.files["science"] = any_bytes(link.random, 3000000);
    const CfdpId id = link.ground.put("", "", 0, message(CFDP_PROXY_PUT, "science", "got", 1));
    link.run(1 * s);
    CfdpMessage origin{};
    origin.type = CFDP_ORIGIN;
    origin.entity = id.source;
    origin.sequence = id.sequence;
    origin.entity_bytes = origin.sequence_bytes = 4;
    Bytes which(40);
    which.resize(cfdp_message_write(&origin, which.data(), which.size()));
    link.ground.put("", "", 0, joined({message(CFDP_PROXY_CANCEL), which}));
    link.finish();
    EXPECT_FALSE(link.ground.memory.has("got"));
    EXPECT_EQ(link.craft.count(CFDP_EVENT_ENDED, CFDP_CANCEL_REQUEST), 1);
    EXPECT_EQ(link.ground.count(CFDP_EVENT_ENDED, CFDP_CANCEL_REQUEST), 1);
}

TEST(CfdpF3, list_a_directory)
{
    Link link;
    link.craft.memory.files["a"] = {1};
    link.craft.memory.files["b"] = {};
    link.ground.put("", "", 0, message(CFDP_LIST, "", "names"));
    link.finish();
    EXPECT_EQ(link.ground.memory.files["names"], (Bytes{'a', '\n', 'b', '\n'}));
    link.ground.events.clear();
    link.ground.put("", "", 0, message(CFDP_LIST, "none", "more"));
    link.finish();
    EXPECT_FALSE(link.ground.memory.has("more"));
    const auto events = std::find_if(link.ground.events.begin(), link.ground.events.end(),
                                     [](const Event &event) { return event.what == CFDP_EVENT_MESSAGE; });
    ASSERT_NE(events, link.ground.events.end());
    EXPECT_EQ(events->text[4], CFDP_LISTED);
    EXPECT_EQ(events->text[5], 0x80);
}

/// Ask the craft about a transaction. Returns the value of its answer; -1: there is none.
int ask(Link &link, CfdpMessageType type, CfdpId about, const std::string &file = "")
{
    CfdpMessage request{};
    request.type = static_cast<std::uint8_t>(type);
    request.entity = about.source;
    request.sequence = about.sequence;
    request.entity_bytes = request.sequence_bytes = 4;
    request.first = {reinterpret_cast<const std::uint8_t *>(file.data()), static_cast<std::uint8_t>(file.size())};
    Bytes options(200);
    options.resize(cfdp_message_write(&request, options.data(), options.size()));
    link.ground.events.clear();
    link.ground.put("", "", 0, options);
    link.run(2 * s);
    for (const Event &event : link.ground.events) {
        if (event.what == CFDP_EVENT_MESSAGE && event.text[4] == type + 1) {
            CfdpMessage answer{};
            const CfdpTlv tlv{{event.text.data(), static_cast<std::uint8_t>(event.text.size())}, CFDP_TLV_MESSAGE};
            EXPECT_EQ(cfdp_message_read(&answer, &tlv), CCSDS_OK);
            EXPECT_EQ(answer.entity, about.source);
            EXPECT_EQ(answer.sequence, about.sequence);
            return answer.value;
        }
    }
    return -1;
}

TEST(CfdpF3, remote_suspension_and_reports_of_what_the_craft_sends)
{
    Link link;
    link.craft.memory.files["science"] = any_bytes(link.random, 5'000'000);
    link.ground.put("", "", 0, message(CFDP_PROXY_PUT, "science", "got", 1));
    link.run(1 * s);
    const CfdpId id{2, 1};
    EXPECT_EQ(ask(link, CFDP_REMOTE_SUSPEND, id), 0x80 | CFDP_ACTIVE << 5);
    EXPECT_EQ(link.craft.count(CFDP_EVENT_SUSPENDED), 1);
    const int sent = link.sent[CFDP_FILE_DATA];
    link.run(30 * s);
    EXPECT_EQ(link.sent[CFDP_FILE_DATA], sent);
    EXPECT_EQ(ask(link, CFDP_REMOTE_SUSPEND, id), 0x80 | CFDP_ACTIVE << 5); // it is already
    EXPECT_EQ(link.craft.count(CFDP_EVENT_SUSPENDED), 1);
    EXPECT_EQ(ask(link, CFDP_REMOTE_REPORT, id, "report"), CFDP_ACTIVE << 6);
    const Bytes &report = link.ground.memory.files["report"];
    EXPECT_EQ(std::string(report.begin(), report.end()),
              "progress " + std::to_string(1000 * sent) + "\nsize 5000000\nstate 1\ncondition 0\nsuspended 1\n");
    EXPECT_EQ(ask(link, CFDP_REMOTE_RESUME, id), CFDP_ACTIVE << 5);
    EXPECT_EQ(link.craft.count(CFDP_EVENT_RESUMED), 1);
    link.finish();
    EXPECT_EQ(link.ground.memory.files["got"], link.craft.memory.files["science"]);
    EXPECT_EQ(ask(link, CFDP_REMOTE_REPORT, id, "report"), CFDP_TERMINATED << 6 | 1);
    EXPECT_EQ(ask(link, CFDP_REMOTE_SUSPEND, {2, 999}), CFDP_UNRECOGNIZED << 5);
    link.finish();
}

TEST(CfdpF3, remote_suspension_of_what_the_craft_receives)
{
    for (const int class1 : {0, 1}) {
        Link link;
        link.file(3'000'000);
        const CfdpId id = link.ground.put("source", "target", class1);
        link.run(1 * s);
        EXPECT_EQ(ask(link, CFDP_REMOTE_SUSPEND, id), 0x80 | CFDP_ACTIVE << 5);
        EXPECT_EQ(ask(link, CFDP_REMOTE_REPORT, id, "../report"), -1); // the ground's own store refuses that name
        link.run(5 * s);
        EXPECT_FALSE(link.craft.memory.has("target")); // all of it is there
        EXPECT_EQ(ask(link, CFDP_REMOTE_RESUME, id), CFDP_ACTIVE << 5);
        EXPECT_EQ(link.craft.memory.files["target"], link.ground.memory.files["source"]);
        link.finish();
    }
}

TEST(CfdpF3, remote_suspension_needs_permission)
{
    Link link;
    CfdpRemote remotes[] = {link.craft.remote, link.craft.remote};
    remotes[1].entity = 7;
    link.craft.cfdp.set.remotes = remotes;
    link.craft.cfdp.set.remotes_n = 2;
    link.file(3'000'000);
    const CfdpId id = link.ground.put("source", "target");
    link.run(1 * s);
    EXPECT_EQ(ask(link, CFDP_REMOTE_SUSPEND, {1, id.sequence + 1}), CFDP_UNRECOGNIZED << 5); // itself
    remotes[0].allowed = CFDP_ALLOW_PROXY;
    EXPECT_EQ(ask(link, CFDP_REMOTE_SUSPEND, id), -1);
    remotes[0].allowed = CFDP_ALLOW_REMOTE;
    link.craft.memory.files["source"] = {1};
    CfdpPut put{};
    put.destination = 7;
    put.from = put.to = "source";
    CfdpId other{};
    ASSERT_EQ(cfdp_put(&link.craft.cfdp, &put, &other), 0);
    EXPECT_EQ(ask(link, CFDP_REMOTE_SUSPEND, other), CFDP_UNRECOGNIZED << 5);
    EXPECT_EQ(link.craft.count(CFDP_EVENT_SUSPENDED), 0);
}

} // namespace cfdp_messages_test
