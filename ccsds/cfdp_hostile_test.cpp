// SPDX-License-Identifier: Apache-2.0
// Peers that misbehave, stores that refuse, and a store of POSIX.
#include "ccsds/store/posix_store.h"
#include "ccsds/testing/cfdp_link.h"
#include "ccsds/testing/folder.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <string>
#include <vector>

namespace cfdp_hostile_test {

using namespace ccsds::testing;

TEST(CfdpHostile, an_acknowledgement_of_what_was_not_sent)
{
    Link link;
    link.file(50000);
    const CfdpId id = link.ground.put("source", "target");
    link.run(10 * ms);
    CfdpPdu ack{};
    ack.kind = CFDP_ACK;
    ack.acknowledged = CFDP_EOF;
    ack.to_sender = 1;
    ack.source = id.source;
    ack.sequence = id.sequence;
    ack.destination = 2;
    ack.entity_bytes = 2;
    ack.sequence_bytes = 4;
    std::uint8_t bytes[64];
    cfdp_take(&link.ground.cfdp, bytes, cfdp_pdu_write(&ack, bytes, sizeof bytes));
    EXPECT_EQ(link.ground.transactions[0].state, CFDP_SENDING);
    link.finish(10 * s);
    link.expect_whole();
}

TEST(CfdpHostile, a_full_store_refuses_and_may_go_on_when_there_is_room)
{
    for (const std::uint8_t handler : {CFDP_CANCEL, CFDP_SUSPEND}) {
        Link link;
        link.craft.memory.capacity = 20000;
        link.craft.remote.handlers[CFDP_FILESTORE_REJECTION] = handler;
        link.file(50000);
        const CfdpId id = link.ground.put("source", "target");
        if (handler == CFDP_CANCEL) {
            link.finish();
            link.expect_none(CFDP_FILESTORE_REJECTION);
            EXPECT_EQ(link.ground.ended()->file_status, CFDP_REJECTED);
        } else {
            link.run(5 * s);
            EXPECT_TRUE(link.craft.busy());
            link.craft.memory.capacity = SIZE_MAX;
            EXPECT_EQ(cfdp_resume(&link.craft.cfdp, id), 1);
            link.finish();
            link.expect_whole();
        }
    }
}

TEST(CfdpHostile, names_that_are_not_allowed)
{
    for (const std::string name : {"../target", "/target", ".cfdp3", ".cfdp"}) {
        Link link;
        link.file(100);
        link.ground.put("source", name);
        link.finish();
        link.expect_none(CFDP_FILESTORE_REJECTION);
        EXPECT_TRUE(link.craft.memory.files.empty());
    }
}

TEST(CfdpHostile, transactions_that_never_end_give_their_places_back)
{
    Link link(1, 4);
    CfdpPdu pdu{};
    pdu.kind = CFDP_FILE_DATA;
    pdu.source = 1;
    pdu.destination = 2;
    pdu.entity_bytes = pdu.sequence_bytes = 2;
    const Bytes data(10);
    pdu.data = data.data();
    pdu.n = data.size();
    std::uint8_t bytes[64];
    for (pdu.sequence = 500; pdu.sequence < 520; pdu.sequence++) {
        cfdp_take(&link.craft.cfdp, bytes, cfdp_pdu_write(&pdu, bytes, sizeof bytes));
    }
    EXPECT_EQ(link.craft.cfdp.live.faults[CCSDS_ROOM], 16u);
    link.file(5000);
    link.ground.put("source", "target"); // finds no place, until one of those has been silent for some time
    link.run(link.craft.remote.inactivity / 4);
    EXPECT_EQ(link.craft.memory.files["target"], link.ground.memory.files["source"]);
    link.finish(); // the others end by inactivity
}

TEST(CfdpHostile, pdus_of_others_are_counted)
{
    Link link;
    CfdpPdu pdu{};
    pdu.kind = CFDP_EOF;
    pdu.source = 1;
    pdu.destination = 2;
    pdu.sequence = 77;
    pdu.entity_bytes = pdu.sequence_bytes = 2;
    std::uint8_t bytes[64];
    const auto take = [&] { cfdp_take(&link.craft.cfdp, bytes, cfdp_pdu_write(&pdu, bytes, sizeof bytes)); };
    const auto &faults = link.craft.cfdp.live.faults;
    pdu.destination = 3;
    take();
    EXPECT_EQ(faults[CCSDS_SPACECRAFT], 1u);
    pdu.destination = 2;
    pdu.source = 9;
    take();
    EXPECT_EQ(faults[CCSDS_CHANNEL], 1u);
    pdu.source = 1;
    pdu.condition = CFDP_CANCEL_REQUEST; // of a transaction that is not known: acknowledged as such
    take();
    EXPECT_EQ(faults[CCSDS_STRAY], 1u);
    Bytes answer(2000);
    const std::size_t n = cfdp_next(&link.craft.cfdp, nullptr, answer.data(), answer.size());
    CfdpPdu ack{};
    ASSERT_EQ(cfdp_pdu_read(&ack, answer.data(), n), CCSDS_OK);
    EXPECT_EQ(ack.kind, CFDP_ACK);
    EXPECT_EQ(ack.status, CFDP_UNRECOGNIZED);
    EXPECT_FALSE(link.craft.busy());
    // A flood of them fills the queue of acknowledgements, and is counted.
    for (int i = 0; i < 40; i++) {
        take();
    }
    EXPECT_EQ(faults[CCSDS_ROOM], 40u - CFDP_ANSWERS);
    EXPECT_EQ(cfdp_next(&link.craft.cfdp, nullptr, answer.data(), CFDP_ROOM - 1), 0u);
}

/// PDUs of both ends are damaged, replayed and made up, while files go on; the sanitizers watch. Whatever arrives is
/// whole: PDUs have a CRC. FLEDGE_CFDP_ROUNDS sets how many.
TEST(CfdpHostile, a_peer_that_answers_with_garbage)
{
    const char *setting = std::getenv("FLEDGE_CFDP_ROUNDS");
    const std::uint32_t rounds = setting != nullptr ? static_cast<std::uint32_t>(std::atol(setting)) : 40;
    std::uint32_t arrived = 0, refused = 0;
    for (std::uint32_t seed = 1; seed <= rounds; seed++) {
        Link link(seed, 3, 4);
        link.ground.remote.inactivity = link.craft.remote.inactivity = 20 * s;
        link.ground.remote.crc = link.craft.remote.crc = 1;
        link.ground.remote.immediate = link.craft.remote.immediate = seed % 2;
        link.craft.remote.handlers[1 + seed % 10] = static_cast<std::uint8_t>(1 + seed % 4);
        link.tick = 10 * ms;
        link.loss = 0.05;
        std::vector<Bytes> old;
        for (int file = 0; file < 2; file++) {
            link.ground.memory.files["f" + std::to_string(file)] = any_bytes(link.random, 20000);
            const Bytes options = joined({request(CFDP_DENY_FILE, "none"), message(CFDP_LIST, "", "names")});
            link.ground.put("f" + std::to_string(file), "f" + std::to_string(file), 0, options);
        }
        for (int i = 0; i < 4000; i++) {
            link.step();
            for (auto &[at, packet] : link.flying) {
                if (at == link.now + link.delay) {
                    old.push_back(packet.bytes);
                }
            }
            Bytes bytes = old.empty() || link.random() % 4 == 0 ? any_bytes(link.random, link.random() % 100)
                                                                : old[link.random() % old.size()];
            CfdpPdu pdu{};
            if (link.random() % 2 == 0 && cfdp_pdu_read(&pdu, bytes.data(), bytes.size()) == CCSDS_OK) {
                // A valid PDU with wrong contents, of another transaction, so that the files are not touched.
                pdu.sequence = 100 + link.random() % 3;
                pdu.offset = link.random() % 3 == 0 ? link.random() : pdu.offset;
                pdu.condition = static_cast<std::uint8_t>(link.random() % 16);
                pdu.unacknowledged = link.random() % 5 == 0;
                Bytes changed(2000);
                changed.resize(cfdp_pdu_write(&pdu, changed.data(), changed.size()));
                bytes = std::move(changed);
            } else if (!bytes.empty() && link.random() % 2 == 0) {
                bytes[link.random() % bytes.size()] ^= static_cast<std::uint8_t>(1 + link.random() % 255);
            }
            bytes.shrink_to_fit();
            cfdp_take(&(link.random() % 2 == 0 ? link.craft : link.ground).cfdp, bytes.data(), bytes.size());
        }
        const Clock stop = link.now + 2000 * s;
        for (const CfdpTransaction &transaction : link.craft.transactions) { // suspended by their handler
            cfdp_cancel(&link.craft.cfdp, transaction.id);
        }
        while (link.ground.busy() || link.craft.busy()) {
            ASSERT_LT(link.now, stop) << "a transaction hangs, seed " << seed;
            link.step();
            for (const CfdpTransaction &transaction : link.craft.transactions) {
                if (transaction.suspended != 0) {
                    cfdp_cancel(&link.craft.cfdp, transaction.id);
                }
            }
        }
        for (const std::string file : {"f0", "f1"}) {
            if (link.craft.memory.has(file)) {
                arrived++;
                EXPECT_EQ(link.craft.memory.files[file], link.ground.memory.files[file]);
            }
        }
        refused += link.craft.cfdp.live.faults[CCSDS_CRC];
    }
    EXPECT_GT(arrived, rounds / 2);
    EXPECT_GT(refused, rounds);
}

TEST(CfdpStore, files_requests_and_lists_in_folders)
{
    const Folder folder;
    PosixStore posix[2];
    Link link;
    link.loss = 0.02;
    for (End *end : {&link.ground, &link.craft}) {
        const std::filesystem::path own = folder.path / std::to_string(end->entity);
        std::filesystem::create_directory(own);
        ASSERT_EQ(posix_store_open(&posix[end->entity - 1], own.c_str(), 1 << 30, &end->store), 1);
        end->begin(1);
    }
    const Bytes bytes = any_bytes(link.random, 123456);
    std::ofstream(folder.path / "1/source", std::ios::binary)
        .write(reinterpret_cast<const char *>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    link.ground.put("", "", 0, request(CFDP_CREATE_DIRECTORY, "new"));
    link.finish();
    link.ground.put("source", "new/target", 0, request(CFDP_CREATE_FILE, "empty"));
    link.finish();
    std::ifstream read(folder.path / "2/new/target", std::ios::binary);
    EXPECT_EQ(Bytes(std::istreambuf_iterator<char>(read), {}), bytes);
    link.ground.put("", "", 0, message(CFDP_LIST, "", "names"));
    link.ground.put("", "", 0, message(CFDP_LIST, "new", "new names"));
    link.finish();
    const auto text = [&](const char *name) {
        std::ifstream file(folder.path / name);
        std::set<std::string> lines;
        for (std::string line; std::getline(file, line);) {
            lines.insert(line);
        }
        return lines;
    };
    EXPECT_EQ(text("1/names"), (std::set<std::string>{"new/", "empty"}));
    EXPECT_EQ(text("1/new names"), (std::set<std::string>{"target"}));
    for (const auto &entry : std::filesystem::recursive_directory_iterator(folder.path)) {
        EXPECT_NE(entry.path().filename().string()[0], '.') << entry.path();
    }
    for (PosixStore &store : posix) {
        posix_store_close(&store);
    }
}

} // namespace cfdp_hostile_test
