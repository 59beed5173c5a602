// SPDX-License-Identifier: Apache-2.0
// Every decoder with inputs that were valid and are damaged, and the state machines with any events. What is accepted
// must hold together, what is not must not matter; the sanitizers see the rest. Some checks are made to hold again, so
// that what is behind them is reached. PDUs have theirs in cfdp_pdu_test.cpp. FLEDGE_CASES sets how many inputs each
// has, FLEDGE_SEED which:
//
//     ./fledge test --preset asan -k Fuzz     # builds it, and runs the short form
//     FLEDGE_CASES=20000000 build/asan/ccsds/ccsds_test --gtest_filter='Fuzz.*'     # some hours
#include "ccsds/cop1.h"
#include "ccsds/sdls.h"
#include "ccsds/security/key_file.h"
#include "ccsds/space_link.h"
#include "ccsds/sync.h"
#include "ccsds/testing/bits.h"
#include "ccsds/time_code.h"
#include "ccsds/tm_frame.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <set>
#include <vector>

namespace ccsds_fuzz_test {

using namespace ccsds::testing;

std::uint32_t number_of(const char *variable, std::uint32_t otherwise)
{
    const char *given = std::getenv(variable);
    return given != nullptr ? static_cast<std::uint32_t>(std::strtoul(given, nullptr, 10)) : otherwise;
}

class Fuzz : public ::testing::Test {
protected:
    std::mt19937 random{number_of("FLEDGE_SEED", 1)};
    std::uint32_t cases = number_of("FLEDGE_CASES", 4000);
    Bytes earlier{0}; // an input that was valid, of which parts come again

    std::uint32_t any(std::size_t n) { return static_cast<std::uint32_t>(random() % n); }
    std::uint8_t byte() { return static_cast<std::uint8_t>(random()); }

    /// An input with a few damages, in memory of its own size.
    Bytes damaged(const Bytes &valid)
    {
        Bytes bytes = valid;
        for (std::uint32_t n = any(4); n > 0 && !bytes.empty(); n--) {
            const std::size_t at = any(bytes.size()), length = 1 + any(std::min<std::size_t>(bytes.size() - at, 40));
            const auto from = bytes.begin() + static_cast<std::ptrdiff_t>(at);
            switch (any(8)) {
            case 0: bytes[at] ^= static_cast<std::uint8_t>(1 << any(8)); break;
            case 1: bytes[at] = byte(); break;
            case 2: bytes[at] = static_cast<std::uint8_t>(0x7F + any(3)); break; // 0x7F, 0x80, 0x81
            case 3: bytes[any(std::min<std::size_t>(bytes.size(), 8))] = any(2) != 0 ? 0x00 : 0xFF; break;
            case 4: bytes.resize(at); break;
            case 5: bytes.erase(from, from + static_cast<std::ptrdiff_t>(length)); break;
            case 6: {
                const std::size_t part = std::min<std::size_t>(earlier.size(), 1 + any(40));
                bytes.insert(from, earlier.begin(), earlier.begin() + static_cast<std::ptrdiff_t>(part));
                break;
            }
            default: std::fill_n(from, length, byte()); break;
            }
        }
        earlier = valid;
        return Bytes(bytes);
    }
    /// With its CRC made to hold again, most of the time.
    Bytes checked(Bytes bytes)
    {
        if (bytes.size() > 2 && any(4) != 0) {
            ccsds_put16(&bytes[bytes.size() - 2], ccsds_crc16(bytes.data(), bytes.size() - 2));
        }
        return bytes;
    }
    Bytes packet()
    {
        const SpacePacket head{7 + any(300),
                               static_cast<std::uint16_t>(any(4) != 0 ? 5 : any(2048)),
                               static_cast<std::uint16_t>(any(4)),
                               static_cast<std::uint8_t>(any(2)),
                               static_cast<std::uint8_t>(any(2)),
                               static_cast<std::uint8_t>(any(4))};
        Bytes bytes = any_bytes(random, head.size);
        space_packet_write(&head, bytes.data());
        return bytes;
    }
};

void expect_packet(void *user, const std::uint8_t *bytes, std::size_t n)
{
    SpacePacket head{};
    ASSERT_EQ(space_packet_read(&head, bytes, n), CCSDS_OK);
    ASSERT_EQ(head.size, n);
    ASSERT_NE(head.application, SPACE_PACKET_IDLE);
    ++*static_cast<std::uint64_t *>(user);
}

TEST_F(Fuzz, packets_and_their_headers)
{
    Bytes joined(500), spanned(400);
    PacketJoiner joiner{};
    packet_joiner_begin(&joiner, 5, joined.data(), joined.size());
    std::uint64_t delivered = 0, accepted = 0, whole = 0;
    PacketZone zone{};
    packet_zone_begin(&zone, spanned.data(), spanned.size(), expect_packet, &delivered);
    zone.encapsulation = [](void *, const std::uint8_t *bytes, std::size_t n) {
        std::uint32_t size = 0;
        ASSERT_EQ(packet_size(bytes, n, &size), CCSDS_OK);
        ASSERT_EQ(size, n);
        ASSERT_FALSE(packet_is_idle(bytes));
    };
    for (std::uint32_t i = 0; i < cases; i++) {
        const Bytes bytes = damaged(packet());
        SpacePacket head{};
        if (space_packet_read(&head, bytes.data(), bytes.size()) == CCSDS_OK) {
            accepted++;
            ASSERT_LE(head.size, bytes.size());
            Bytes again(6);
            space_packet_write(&head, again.data());
            ASSERT_TRUE(std::equal(again.begin(), again.end(), bytes.begin()));
            PusHeader pus{};
            if (pus_read(&pus, head.command, &bytes[6], head.size - 6) == CCSDS_OK) {
                Bytes written(PUS_TELEMETRY);
                written.resize(pus_write(&pus, head.command, written.data()));
                ASSERT_TRUE(std::equal(written.begin(), written.end(), bytes.begin() + 6));
            }
        }
        whole += packet_join(&joiner, bytes.data(), bytes.size()) != 0;
        ASSERT_LE(joiner.parts.n, joined.size());
        Bytes several = damaged(packet());
        several.insert(several.end(), bytes.begin(), bytes.end());
        const Bytes exact(several);
        const std::uint32_t first = any(8) == 0 ? 0x7FC + any(4) : any(4) == 0 ? any(exact.size() + 2) : 0;
        packet_zone_take(&zone, exact.data(), exact.size(), first);
        if (any(20) == 0) {
            packet_zone_gap(&zone);
        }
        ASSERT_LE(zone.n, spanned.size());
    }
    EXPECT_GT(accepted, cases / 4);
    EXPECT_GT(whole, cases / 40);
    EXPECT_GT(delivered, cases / 10);
    EXPECT_GT(zone.encapsulated, cases / 400);
}

TEST_F(Fuzz, telemetry_frames)
{
    Bytes memory(TM_FRAME_MAX), spanned(1000);
    std::uint64_t delivered = 0, accepted = 0;
    TmReceiver receivers[2]{};
    tm_receiver_begin(&receivers[0], 256, spanned.data(), 500, expect_packet, &delivered);
    tm_receiver_begin(&receivers[1], 1u << 24, spanned.data() + 500, 500, expect_packet, &delivered);
    for (std::uint32_t i = 0; i < cases;) {
        const TmChannel channel{77, static_cast<std::uint16_t>(20 + any(100)), static_cast<std::uint8_t>(any(2)),
                                static_cast<std::uint8_t>(any(2))};
        std::vector<Bytes> frames;
        TmSender sender{};
        ASSERT_TRUE(tm_sender_begin(
            &sender, &channel,
            [](void *user, const std::uint8_t *frame, std::size_t n) {
                static_cast<std::vector<Bytes> *>(user)->emplace_back(frame, frame + n);
            },
            &frames));
        TmVirtual vc{};
        tm_virtual_begin(&vc, 1, memory.data());
        for (int k = 0; k < 4; k++) {
            const Bytes bytes = packet();
            tm_send(&sender, &vc, bytes.data(), bytes.size());
            tm_flush(&sender, &vc);
            tm_idle(&sender, &vc);
        }
        for (const Bytes &good : frames) {
            i++;
            const bool aos = any(4) == 0;
            Bytes bytes = damaged(good);
            if (aos && bytes.size() > 8) {
                bytes[0] = static_cast<std::uint8_t>(0x40 | (bytes[0] & 0x3F));
                bytes[6] &= 0x07;
            }
            if (!aos && any(2) != 0) {
                bytes.resize(channel.size); // else most have a wrong length
            }
            bytes = channel.check ? checked(std::move(bytes)) : std::move(bytes);
            const Bytes exact(bytes);
            TmFrame frame{};
            const CcsdsFault fault =
                aos ? aos_frame_read(exact.data(), exact.size(), any(4), channel.control, channel.check, &frame)
                    : tm_frame_read(&channel, exact.data(), exact.size(), &frame);
            if (fault == CCSDS_OK) {
                accepted++;
                ASSERT_GT(frame.n, 0u);
                ASSERT_GE(frame.zone, exact.data() + 6);
                ASSERT_LE(frame.zone + frame.n, exact.data() + exact.size());
                tm_receive(&receivers[aos], &frame);
            }
        }
    }
    EXPECT_GT(accepted, cases / 4);
    EXPECT_GT(delivered, cases / 40);
}

TEST_F(Fuzz, telecommand_frames)
{
    Bytes memory(200);
    PartJoiner joiner{memory.data(), memory.size(), 0, 0, {}};
    std::uint64_t accepted = 0, whole = 0;
    for (std::uint32_t i = 0; i < cases; i++) {
        const TcChannel channel{42, 1, static_cast<std::uint8_t>(any(2)), static_cast<std::uint8_t>(any(2))};
        Bytes bytes(TC_FRAME_MAX);
        if (any(8) == 0) {
            bytes.resize(tc_control_write(&channel, any(2) != 0 ? TC_SET : TC_UNLOCK, byte(), bytes.data()));
        } else {
            const Bytes data = any_bytes(random, 1 + any(100));
            TcFrame frame{};
            frame.data = data.data();
            frame.n = data.size();
            frame.type = static_cast<std::uint8_t>(any(2) != 0 ? TC_BD : TC_AD);
            frame.number = byte();
            frame.part = static_cast<std::uint8_t>(any(4));
            frame.map = static_cast<std::uint8_t>(any(64));
            bytes.resize(tc_frame_write(&channel, &frame, bytes.data()));
        }
        bytes = damaged(bytes);
        if (any(2) != 0 && bytes.size() > 5) { // the length that it has
            ccsds_put16(&bytes[2], (bytes[2] & 0xFCu) << 8 | static_cast<std::uint32_t>(bytes.size() - 1));
        }
        bytes = channel.check ? checked(std::move(bytes)) : std::move(bytes);
        const Bytes exact(bytes);
        TcFrame frame{};
        if (tc_frame_read(&channel, exact.data(), exact.size(), &frame) != CCSDS_OK) {
            continue;
        }
        accepted++;
        Bytes again(TC_FRAME_MAX);
        if (frame.type == TC_BC) {
            again.resize(tc_control_write(&channel, static_cast<TcControl>(frame.control), frame.value, again.data()));
            again[4] = exact[4]; // the number of a control command says nothing
            if (channel.check) {
                ccsds_put16(&again[again.size() - 2], ccsds_crc16(again.data(), again.size() - 2));
            }
        } else {
            again.resize(tc_frame_write(&channel, &frame, again.data()));
            whole += tc_join(&joiner, &frame) != 0;
            ASSERT_LE(joiner.n, memory.size());
        }
        ASSERT_EQ(again, Bytes(exact.begin(), exact.begin() + static_cast<std::ptrdiff_t>(frame.size)));
    }
    EXPECT_GT(accepted, cases / 4);
    EXPECT_GT(whole, cases / 40);
}

TEST_F(Fuzz, streams_of_bytes)
{
    struct Found {
        Bytes memory;
        std::uint64_t units;
    } blocks{Bytes(300), 0}, frames{Bytes(64), 0};
    const auto sink = [](void *user, std::uint8_t *bytes, std::size_t n) {
        Found &self = *static_cast<Found *>(user);
        ASSERT_EQ(bytes, self.memory.data());
        ASSERT_LE(n, self.memory.size());
        self.units++;
    };
    CltuReader cltus{};
    SyncReader markers{};
    cltu_begin(&cltus, blocks.memory.data(), blocks.memory.size(), sink, &blocks);
    sync_begin(&markers, frames.memory.data(), frames.memory.size(), 3, sink, &frames);
    for (std::uint32_t i = 0; i < cases; i++) {
        const Bytes data = any_bytes(random, 1 + any(i % 16 == 0 ? 400 : 60));
        Bytes cltu(CLTU_SIZE(data.size())), frame = any_bytes(random, 68);
        cltu_write(data.data(), data.size(), cltu.data());
        ccsds_put32(frame.data(), SYNC_MARKER);
        cltu = damaged(cltu);
        frame = damaged(frame);
        cltu_take(&cltus, cltu.data(), cltu.size());
        sync_take(&markers, frame.data(), frame.size());
    }
    EXPECT_GT(blocks.units, cases / 4);
    EXPECT_GT(frames.units, cases / 4);
}

TEST_F(Fuzz, words_times_and_keys)
{
    const std::string path = ::testing::TempDir() + "/fledge_fuzz_" + std::to_string(random()) + ".keys";
    const Bytes lines = [] {
        const std::string text = "# keys\n1 000102030405060708090a0b0c0d0e0f\n65535\t" + std::string(64, 'a') + "\r\n";
        return Bytes(text.begin(), text.end());
    }();
    std::uint64_t words = 0, files = 0;
    for (std::uint32_t i = 0; i < cases; i++) {
        Clcw clcw{};
        const std::uint32_t word = any(2) != 0 ? random() : random() & 0x03FFFFFFu;
        if (clcw_read(word, &clcw) != 0) {
            words++;
            ASSERT_EQ(clcw_word(&clcw), word & 0x03FCFEFFu); // without status and spare bits
        }
        const Bytes time = any_bytes(random, 8);
        ASSERT_GE(time_cds_read(time.data()), 0);
        ASSERT_GE(time_cuc_read(time.data(), 1 + any(4), any(4)), 0);
        if (i % 64 == 0) { // a file costs more than the rest
            const Bytes text = damaged(lines);
            std::ofstream(path, std::ios::binary)
                .write(reinterpret_cast<const char *>(text.data()), static_cast<std::streamsize>(text.size()));
            std::filesystem::permissions(path, std::filesystem::perms(0600));
            AesGcmKey keys[2];
            char why[300] = "";
            const std::size_t n = key_file_read(path.c_str(), keys, 2, why, sizeof why);
            ASSERT_EQ(n == 0, why[0] != '\0');
            ASSERT_LE(n, 2u);
            files += n != 0;
        }
    }
    std::filesystem::remove(path);
    EXPECT_GT(words, cases / 16);
    EXPECT_GT(files, cases / 64 / 8);
}

TEST_F(Fuzz, protected_frames_are_what_was_protected)
{
    const Bytes secret = any_bytes(random, 32);
    AesGcmKey key{};
    ASSERT_TRUE(aes_gcm_expand(&key, 1, secret.data(), secret.size()));
    AesGcmKeys keys{&key, 1};
    SdlsAssociation ends[2][2]{};
    Sdls sdls[2]{};
    for (int end = 0; end < 2; end++) {
        for (std::uint16_t k = 0; k < 2; k++) {
            ends[end][k] = {static_cast<std::uint16_t>(k + 1),
                            static_cast<std::uint8_t>(k == 0),
                            1,
                            static_cast<std::uint8_t>(k == 0 ? SDLS_ENCRYPT : SDLS_AUTHENTICATE),
                            64,
                            0,
                            k,
                            SDLS_UNKEYED,
                            0,
                            {},
                            0,
                            0};
            ASSERT_TRUE(sdls_rekey(&ends[end][k], 1, 100) && sdls_start(&ends[end][k]));
        }
        sdls[end] = {aes_gcm(&keys), ends[end], 2, {}};
    }
    const TcChannel commands{42, 1, 1, 0};
    const TmChannel telemetry{77, 100, 0, 0};
    std::map<std::uint64_t, Bytes> plain; // by number
    std::set<std::uint64_t> taken;
    Bytes memory(TM_FRAME_MAX), sent[2];
    std::vector<Bytes> old;
    TmSender sender{};
    TmVirtual vc{};
    tm_sender_begin(
        &sender, &telemetry,
        [](void *user, const std::uint8_t *frame, std::size_t n) {
            static_cast<Bytes *>(user)->assign(frame, frame + n);
        },
        &sent[1]);
    tm_virtual_begin(&vc, 1, memory.data());
    Bytes space(telemetry.size);
    vc.frame = space.data();
    sdls_tm_protect(&sdls[0], &vc);
    std::uint64_t accepted[2] = {0, 0};
    for (std::uint32_t i = 0; i < cases; i++) {
        const bool command = any(2) != 0;
        Bytes data = any_bytes(random, command ? 1 + any(60) : 64);
        Bytes bytes(TC_FRAME_MAX);
        if (command) {
            plain[ends[0][0].next] = data;
            TcFrame frame{};
            frame.data = data.data();
            frame.n = data.size();
            frame.part = SPACE_PACKET_WHOLE;
            ASSERT_EQ(sdls_tc_protect(&sdls[0], &commands, &frame, memory.data()), CCSDS_OK);
            bytes.resize(tc_frame_write(&commands, &frame, bytes.data()));
        } else {
            plain[ends[0][1].next | 1ull << 63] = data;
            tm_send(&sender, &vc, data.data(), data.size()); // fills the zone
            bytes = sent[1];
        }
        bytes = any(8) == 0 && !old.empty() ? old[any(old.size())] : damaged(bytes);
        old.push_back(bytes);
        if (old.size() > 200) {
            old.erase(old.begin() + any(old.size()));
        }
        if (any(2) != 0) {
            bytes.resize(command ? bytes.size() : telemetry.size);
            if (command && bytes.size() > 5) {
                ccsds_put16(&bytes[2], 1u << 10 | static_cast<std::uint32_t>(bytes.size() - 1));
            }
        }
        const Bytes exact(bytes);
        TcFrame tc{};
        TmFrame tm{};
        SdlsReceipt receipt{};
        if (command && tc_frame_read(&commands, exact.data(), exact.size(), &tc) == CCSDS_OK && tc.type != TC_BC &&
            tc.n >= SDLS_HEADER) {
            const std::uint64_t number = ccsds_get64(tc.data + 6);
            if (sdls_tc_check(&sdls[1], &commands, &tc, memory.data(), &receipt) == CCSDS_OK) {
                ASSERT_EQ(Bytes(tc.data, tc.data + tc.n), plain.at(number));
                ASSERT_EQ(taken.count(number), 0u);
                if (any(4) != 0) {
                    sdls_accept(&receipt);
                    taken.insert(number);
                    accepted[0]++;
                }
            }
        } else if (!command && tm_frame_read(&telemetry, exact.data(), exact.size(), &tm) == CCSDS_OK &&
                   tm.n >= SDLS_HEADER) {
            const std::uint64_t number = ccsds_get64(tm.zone + 6) | 1ull << 63;
            if (sdls_tm_open(&sdls[1], &tm, memory.data()) == CCSDS_OK) {
                ASSERT_EQ(Bytes(tm.zone, tm.zone + tm.n), plain.at(number));
                ASSERT_TRUE(taken.insert(number).second);
                accepted[1]++;
            }
        }
        if (plain.size() > 2000) { // a long run keeps what the window may still accept
            plain.clear();
            taken.clear();
            old.clear();
            ends[1][0].next = ends[0][0].next;
            ends[1][1].next = ends[0][1].next;
            std::fill(std::begin(ends[1][0].seen), std::end(ends[1][0].seen), ~0u);
            std::fill(std::begin(ends[1][1].seen), std::end(ends[1][1].seen), ~0u);
        }
    }
    EXPECT_GT(accepted[0], cases / 16);
    EXPECT_GT(accepted[1], cases / 16);
    EXPECT_GT(sdls[1].faults[CCSDS_TAG], cases / 16);
    EXPECT_GT(sdls[1].faults[CCSDS_REPLAY], cases / 100);
}

/// A FOP-1 whose answers are kept: each request has one end.
struct Sender {
    static constexpr std::uint32_t capacity = 12, room = 8;
    FopUnit units[capacity + 1]{};
    std::uint8_t memory[(capacity + 1) * room]{};
    Fop fop{};
    std::mt19937 &random;
    std::map<std::uint32_t, FopAnswer> open{};      ///< requests, with their last answer
    std::map<std::uint32_t, std::uint8_t> number{}; ///< of frames that were sent
    std::uint64_t ended = 0;

    explicit Sender(std::mt19937 &r) : random(r)
    {
        fop_begin(
            &fop, units, memory, room, capacity, 1000,
            [](void *user, TcType type, std::uint8_t n, const std::uint8_t *data, std::size_t size) {
                return static_cast<Sender *>(user)->send(type, n, data, size);
            },
            [](void *user, FopAnswer answer, std::uint32_t tag, std::uint32_t) {
                static_cast<Sender *>(user)->tell(answer, tag);
            },
            this);
    }
    Sender(const Sender &) = delete;

    int send(TcType type, std::uint8_t n, const std::uint8_t *data, std::size_t size)
    {
        EXPECT_EQ(size, type == TC_BC ? 2u : 4u);
        const std::uint32_t tag = type == TC_BC ? 0 : ccsds_get32(data);
        EXPECT_TRUE(type == TC_BC || open.count(tag) == 1) << "no request is open any more";
        EXPECT_TRUE(type != TC_AD || number.try_emplace(tag, n).first->second == n); // the same each time
        return random() % 16 == 0 ? -1 : static_cast<int>(random() % 3 != 0);
    }
    void tell(FopAnswer answer, std::uint32_t tag)
    {
        if (answer == FOP_ALERT || answer == FOP_SUSPENDED) {
            ASSERT_EQ(tag, 0u);
            return;
        }
        ASSERT_EQ(open.count(tag), 1u) << answer << " of " << tag;
        if (answer == FOP_ACCEPTED) {
            ASSERT_EQ(open[tag], 0);
            open[tag] = answer;
            return;
        }
        ASSERT_EQ(open[tag] == FOP_ACCEPTED, answer != FOP_REJECTED) << answer << " of " << tag;
        open.erase(tag);
        number.erase(tag);
        ended++;
    }
};

TEST_F(Fuzz, cop1_takes_any_events)
{
    Sender sender(random);
    Fop &fop = sender.fop;
    Farm farm{};
    ASSERT_TRUE(farm_begin(&farm, 10));
    std::uint32_t tag = 1;
    std::int64_t t = 0;
    for (std::uint32_t i = 0; i < 4 * cases; i++) {
        std::uint8_t data[4];
        ccsds_put32(data, tag);
        TcFrame frame{};
        frame.type = static_cast<std::uint8_t>(any(3));
        frame.number = static_cast<std::uint8_t>(any(2) != 0 ? farm.next : farm.next + any(30) - 15);
        frame.control = static_cast<std::uint8_t>(TC_UNLOCK + any(2));
        frame.value = any(4) == 0 ? byte() : farm.next;
        const Farm before = farm;
        const int took = farm_frame(&farm, &frame, any(4) != 0);
        ASSERT_TRUE(farm.state >= FARM_OPEN && farm.state <= FARM_LOCKOUT);
        ASSERT_TRUE(frame.type != TC_AD || farm.next == static_cast<std::uint8_t>(before.next + took));
        ASSERT_EQ(farm.accepted + farm.discarded, i + 1);
        if (any(4) == 0) {
            farm_room(&farm);
        }
        if (farm.state == FARM_LOCKOUT && any(8) == 0) {
            farm.state = FARM_OPEN;
        }
        Clcw clcw = farm_clcw(&farm, 1);
        switch (any(9)) {
        case 0:
        case 1:
        case 2:
            sender.open[tag] = FopAnswer{};
            fop_transfer(&fop, tag++, data, 4);
            break;
        case 3:
            sender.open[tag] = FopAnswer{};
            fop_bypass(&fop, tag, data, 4);
            sender.open.erase(tag++); // no more answers
            break;
        case 4: {
            const auto directive = static_cast<FopDirective>(any(13));
            sender.open[tag] = FopAnswer{};
            fop_directive(&fop, tag++, directive, any(3) == 0 ? random() : any(16));
            break;
        }
        case 5:
            clcw.next = static_cast<std::uint8_t>(fop.expected + any(fop.sent + 2));
            clcw.lockout = any(16) == 0;
            clcw.wait = any(4) == 0;
            clcw.retransmit = any(3) == 0;
            fop_clcw(&fop, &clcw);
            break;
        case 6: any(8) == 0 ? fop_invalid_clcw(&fop) : fop_clcw(&fop, &clcw); break;
        case 7: fop_time(&fop, t += any(800)); break;
        default: fop_ready(&fop, static_cast<TcType>(any(3)), any(16) != 0); break;
        }
        if (fop.state == FOP_INITIAL && fop.suspended == 0 && any(3) == 0) {
            sender.open[tag] = FopAnswer{};
            fop_directive(&fop, tag++, FOP_INITIATE, 0);
        }
        ASSERT_TRUE(fop.state >= FOP_ACTIVE && fop.state <= FOP_INITIAL);
        ASSERT_LE(fop.sent, Sender::capacity);
        ASSERT_LE(sender.open.size(), Sender::capacity + 3u); // frames, one that waits, a directive
        if (HasFailure()) {
            return;
        }
    }
    sender.open[tag] = FopAnswer{};
    fop_directive(&fop, tag, FOP_TERMINATE, 0);
    EXPECT_TRUE(sender.open.empty()) << sender.open.begin()->first;
    EXPECT_GT(sender.ended, cases / 4);
}

/// Both ends of a link take anything; what passes is packets, and each command gets at most one answer.
TEST_F(Fuzz, both_ends_of_a_link)
{
    struct Ends {
        SpaceLinkCraft craft{};
        SpaceLinkGround ground{};
        Bytes up{}, down{};
        std::uint64_t commands = 0, packets = 0, answers = 0;
    };
    const auto ends = std::make_unique<Ends>();
    const SpaceLinkSetup setup{{42, 3, 1, 1}, {42, 120, 1, 1}, 2, 0, 1, 0, 0, 1, 10, 1};
    const SpaceLinkSinks sinks{[](void *user, const std::uint8_t *bytes, std::size_t n) {
                                   Bytes &up = static_cast<Ends *>(user)->up;
                                   up.insert(up.end(), bytes, bytes + n);
                               },
                               [](void *user, const std::uint8_t *bytes, std::size_t n) {
                                   expect_packet(&static_cast<Ends *>(user)->packets, bytes, n);
                               },
                               [](void *user, SpaceLinkAnswer, std::uint32_t) { static_cast<Ends *>(user)->answers++; },
                               ends.get()};
    space_link_craft_begin(&ends->craft, &setup);
    space_link_ground_begin(&ends->ground, &setup, nullptr, &sinks, 5, 2);
    const auto take = [](void *user, const std::uint8_t *bytes, std::size_t n, std::uint16_t) {
        SpacePacket head{};
        ASSERT_EQ(space_packet_read(&head, bytes, n), CCSDS_OK);
        ASSERT_EQ(head.size, n);
        static_cast<Ends *>(user)->commands++;
    };
    const auto put = [](void *user, const std::uint8_t *bytes, std::size_t n) {
        Bytes &down = static_cast<Ends *>(user)->down;
        down.insert(down.end(), bytes, bytes + n);
    };
    std::uint32_t sent = 0;
    for (std::uint32_t i = 0; i < cases; i++) {
        const Bytes bytes = packet();
        sent += space_link_ground_send(&ends->ground, sent, bytes.data(), bytes.size()) != 0;
        const Bytes up = any(3) != 0 ? ends->up : damaged(ends->up);
        ends->up.clear();
        space_link_craft_take(&ends->craft, &setup, nullptr, up.data(), up.size(), any(4) != 0, take, ends.get());
        space_link_craft_send(&ends->craft, &setup, nullptr, bytes.data(), bytes.size(), put, ends.get());
        space_link_craft_flush(&ends->craft, &setup, nullptr, any(2) != 0, put, ends.get());
        const Bytes down = any(3) != 0 ? ends->down : damaged(ends->down);
        ends->down.clear();
        space_link_ground_take(&ends->ground, down.data(), down.size());
        space_link_ground_time(&ends->ground, i);
        ASSERT_LE(ends->answers, sent);
        ASSERT_LE(ends->craft.joined, sizeof ends->craft.unit);
        if (HasFailure()) {
            return;
        }
    }
    EXPECT_GT(ends->commands, cases / 20);
    EXPECT_GT(ends->packets, cases / 4);
}

} // namespace ccsds_fuzz_test
