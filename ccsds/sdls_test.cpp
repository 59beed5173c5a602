// SPDX-License-Identifier: Apache-2.0
// Frame security: frames whose bytes another implementation of AES-GCM made, what is refused and counted, the window.
#include "ccsds/sdls.h"
#include "ccsds/security/aes_gcm.h"
#include "ccsds/testing/bits.h"

#include <gtest/gtest.h>

#include <cstring>
#include <set>
#include <vector>

namespace sdls_test {

using namespace ccsds::testing;

constexpr TcChannel commands{0x2A, 1, 1, 1};
constexpr TmChannel telemetry{77, 62, 1, 1};

/// One end, with two keys, and associations for commands on channel 1 and telemetry on channel 3.
struct End {
    std::vector<AesGcmKey> expanded{2};
    AesGcmKeys keys{};
    std::vector<SdlsAssociation> associations{2};
    Sdls sdls{};
    Bytes memory = Bytes(TM_FRAME_MAX);

    explicit End(std::uint8_t service = SDLS_ENCRYPT, std::uint16_t key = 1, std::uint16_t window = SDLS_WINDOW)
    {
        const Bytes bytes = from_hex("000102030405060708090a0b0c0d0e0f101112131415161718191a1b1c1d1e1f");
        EXPECT_TRUE(aes_gcm_expand(&expanded[0], 1, bytes.data(), 32));
        EXPECT_TRUE(aes_gcm_expand(&expanded[1], 2, bytes.data(), 16));
        keys = {expanded.data(), expanded.size()};
        associations[0] = {0x1234, 1, 1, service, window, 0, 0, SDLS_UNKEYED, 0, {}, 0, 0};
        associations[1] = {0x00FE, 0, 3, service, window, 0, 0xA1B2C3D4, SDLS_UNKEYED, 0, {}, 0, 0};
        sdls = {aes_gcm(&keys), associations.data(), 2, {}};
        EXPECT_TRUE(sdls_rekey(&associations[0], key, 7));
        EXPECT_TRUE(sdls_rekey(&associations[1], key, 0x0102030405060708));
        EXPECT_TRUE(sdls_start(&associations[0]) && sdls_start(&associations[1]));
    }
    End(const End &) = delete;

    /// A protected command as a frame.
    Bytes command(const Bytes &data, std::uint8_t type = TC_AD)
    {
        TcFrame frame{};
        frame.data = data.data();
        frame.n = data.size();
        frame.type = type;
        frame.number = 5;
        frame.part = SPACE_PACKET_WHOLE;
        frame.map = 3;
        EXPECT_EQ(sdls_tc_protect(&sdls, &commands, &frame, memory.data()), CCSDS_OK);
        Bytes bytes(TC_FRAME_MAX);
        bytes.resize(tc_frame_write(&commands, &frame, bytes.data()));
        return bytes;
    }
    /// What becomes of a command; its data in `data`. It is accepted if FARM-1 does so.
    CcsdsFault take(const Bytes &bytes, Bytes &data, bool farm = true)
    {
        TcFrame frame{};
        EXPECT_EQ(tc_frame_read(&commands, bytes.data(), bytes.size(), &frame), CCSDS_OK);
        SdlsReceipt receipt{};
        const CcsdsFault fault = sdls_tc_check(&sdls, &commands, &frame, memory.data(), &receipt);
        if (fault == CCSDS_OK && farm) {
            sdls_accept(&receipt);
        }
        data.assign(frame.data, frame.data + frame.n);
        return fault;
    }
    CcsdsFault take(const Bytes &bytes)
    {
        Bytes data;
        return take(bytes, data);
    }
};

/// A frame with its check made new.
Bytes checked(Bytes bytes)
{
    ccsds_put16(&bytes[bytes.size() - 2], ccsds_crc16(bytes.data(), bytes.size() - 2));
    return bytes;
}

TEST(Sdls, commands_have_the_bytes_of_another_implementation)
{
    const Bytes data = from_hex("deadbeef0102030405");
    const char *const frames[] = {
        "002a042e05c31234000000000000000000000007deadbeef010203040553fffc65c7bdadcaccb0b26c923e118369b9",
        "002a042e05c312340000000000000000000000073ec0adf016155dfec19a4d6b322c97aa0eb033296d2fbc80a1f842"};
    for (const std::uint8_t service : {SDLS_AUTHENTICATE, SDLS_ENCRYPT}) {
        End ground(service), craft(service);
        const Bytes bytes = ground.command(data);
        EXPECT_EQ(bytes, from_hex(frames[service - 1]));
        Bytes found;
        EXPECT_EQ(craft.take(bytes, found), CCSDS_OK);
        EXPECT_EQ(found, data);
        EXPECT_EQ(craft.associations[0].accepted, 1u);
    }
}

TEST(Sdls, telemetry_has_the_bytes_of_another_implementation)
{
    const Bytes packet = from_hex("0005c000000d000102030405060708090a0b0c0d");
    const char *const frames[] = {
        "04d70000180000fea1b2c3d401020304050607080005c000000d000102030405060708090a0b0c0d47b9f69d6c"
        "5740945d4b273cc7b63502010400007655",
        "04d70000180000fea1b2c3d401020304050607082544b487e100101faadc512f8888950e6919399f26987027b7"
        "8ef2b23211f14a3d562fba010400007cb6"};
    for (const std::uint8_t service : {SDLS_AUTHENTICATE, SDLS_ENCRYPT}) {
        End craft(service), ground(service);
        std::vector<Bytes> sent;
        TmSender sender{};
        ASSERT_TRUE(tm_sender_begin(
            &sender, &telemetry,
            [](void *user, const std::uint8_t *frame, std::size_t n) {
                static_cast<std::vector<Bytes> *>(user)->emplace_back(frame, frame + n);
            },
            &sent));
        sender.control = 0x01040000;
        Bytes memory(telemetry.size), found;
        TmVirtual vc{};
        tm_virtual_begin(&vc, 3, memory.data());
        sdls_tm_protect(&craft.sdls, &vc);
        tm_send(&sender, &vc, packet.data(), packet.size());
        ASSERT_EQ(sent.size(), 1u);
        EXPECT_EQ(sent[0], from_hex(frames[service - 1]));
        TmFrame frame{};
        ASSERT_EQ(tm_frame_read(&telemetry, sent[0].data(), sent[0].size(), &frame), CCSDS_OK);
        ASSERT_EQ(sdls_tm_open(&ground.sdls, &frame, ground.memory.data()), CCSDS_OK);
        EXPECT_EQ(Bytes(frame.zone, frame.zone + frame.n), packet);
        ASSERT_EQ(tm_frame_read(&telemetry, sent[0].data(), sent[0].size(), &frame), CCSDS_OK);
        EXPECT_EQ(sdls_tm_open(&ground.sdls, &frame, ground.memory.data()), CCSDS_REPLAY);
        tm_idle(&sender, &vc); // protected as any other
        ASSERT_EQ(sent.size(), 2u);
        ASSERT_EQ(tm_frame_read(&telemetry, sent[1].data(), sent[1].size(), &frame), CCSDS_OK);
        EXPECT_EQ(frame.first, std::uint32_t{PACKET_ZONE_IDLE});
        EXPECT_EQ(sdls_tm_open(&ground.sdls, &frame, ground.memory.data()), CCSDS_OK);
        EXPECT_EQ(Bytes(frame.zone, frame.zone + frame.n), Bytes(20, 0x55));
        ASSERT_TRUE(sdls_stop(&craft.associations[1])); // then nothing goes out
        tm_send(&sender, &vc, packet.data(), packet.size());
        EXPECT_EQ(sent.size(), 2u);
        EXPECT_EQ(sender.unprotected, 1u);
        EXPECT_EQ(craft.sdls.faults[CCSDS_ASSOCIATION], 1u);
    }
}

TEST(Sdls, packets_pass_through_protected_telemetry)
{
    std::mt19937 random(1);
    End craft, ground;
    struct Way {
        Sdls *sdls;
        Bytes memory = Bytes(TM_FRAME_MAX), packets = Bytes(3000);
        TmReceiver receiver{};
        std::vector<Bytes> found{};
    } way{&ground.sdls};
    tm_receiver_begin(
        &way.receiver, 256, way.packets.data(), way.packets.size(),
        [](void *user, const std::uint8_t *packet, std::size_t n) {
            static_cast<Way *>(user)->found.emplace_back(packet, packet + n);
        },
        &way);
    TmSender sender{};
    tm_sender_begin(
        &sender, &telemetry,
        [](void *user, const std::uint8_t *bytes, std::size_t n) {
            Way &self = *static_cast<Way *>(user);
            TmFrame frame{};
            ASSERT_EQ(tm_frame_read(&telemetry, bytes, n, &frame), CCSDS_OK);
            ASSERT_EQ(sdls_tm_open(self.sdls, &frame, self.memory.data()), CCSDS_OK);
            tm_receive(&self.receiver, &frame);
        },
        &way);
    Bytes memory(telemetry.size);
    TmVirtual vc{};
    tm_virtual_begin(&vc, 3, memory.data());
    sdls_tm_protect(&craft.sdls, &vc);
    std::vector<Bytes> sent;
    for (int i = 0; i < 500; i++) {
        Bytes packet = any_bytes(random, 7 + random() % 200);
        const SpacePacket head{static_cast<std::uint32_t>(packet.size()), 9, 0, 0, 0, SPACE_PACKET_WHOLE};
        space_packet_write(&head, packet.data());
        tm_send(&sender, &vc, packet.data(), packet.size());
        if (random() % 4 == 0) {
            tm_flush(&sender, &vc);
            tm_idle(&sender, &vc);
        }
        sent.push_back(std::move(packet));
    }
    tm_flush(&sender, &vc);
    tm_flush(&sender, &vc); // what was too short for an idle packet
    EXPECT_EQ(way.found, sent);
}

TEST(Sdls, any_wrong_bit_is_refused_and_changes_nothing)
{
    for (const std::uint8_t service : {SDLS_AUTHENTICATE, SDLS_ENCRYPT}) {
        End ground(service), craft(service);
        const Bytes good = ground.command({1, 2, 3, 4, 5});
        const SdlsAssociation before = craft.associations[0];
        for (std::size_t bit = 5 * 8; bit < (good.size() - 2) * 8; bit++) { // segment header to code
            Bytes bad = good, data;
            bad[bit / 8] ^= static_cast<std::uint8_t>(0x80 >> bit % 8);
            const bool other = bit / 8 >= 6 && bit / 8 < 12; // the association, the fixed part
            ASSERT_EQ(craft.take(checked(bad), data), other ? CCSDS_ASSOCIATION : CCSDS_TAG) << bit;
            ASSERT_EQ(craft.memory, Bytes(craft.memory.size())); // nothing of it is left
        }
        EXPECT_EQ(craft.sdls.faults[CCSDS_ASSOCIATION], 48u);
        EXPECT_EQ(craft.sdls.faults[CCSDS_TAG], (good.size() - 2 - 5 - 6) * 8);
        EXPECT_EQ(std::memcmp(&before, &craft.associations[0], sizeof before), 0);
        EXPECT_EQ(craft.take(good), CCSDS_OK);
    }
}

TEST(Sdls, what_is_not_of_an_association_is_refused)
{
    End ground, craft, other(SDLS_ENCRYPT, 2);
    const Bytes frame = ground.command({1});
    EXPECT_EQ(other.take(frame), CCSDS_TAG); // another key
    craft.associations[0].virtual_channel = 2;
    EXPECT_EQ(craft.take(frame), CCSDS_ASSOCIATION);
    craft.associations[0].virtual_channel = 1;
    craft.associations[0].telecommand = 0;
    EXPECT_EQ(craft.take(frame), CCSDS_ASSOCIATION);
    craft.associations[0].telecommand = 1;
    craft.associations[0].key = 9; // of which the cipher knows nothing
    EXPECT_EQ(craft.take(frame), CCSDS_ASSOCIATION);
    craft.associations[0].key = 1;
    TcFrame none{};
    const Bytes plain(SDLS_OVERHEAD);
    none.data = plain.data();
    none.n = plain.size();
    SdlsReceipt receipt{};
    EXPECT_EQ(sdls_tc_check(&craft.sdls, &commands, &none, craft.memory.data(), &receipt), CCSDS_SHORT);
    EXPECT_EQ(craft.sdls.faults[CCSDS_SHORT], 1u);
    const Bytes zeros(SDLS_OVERHEAD + 1); // association 0, which does not exist
    none.data = zeros.data();
    none.n = zeros.size();
    EXPECT_EQ(sdls_tc_check(&craft.sdls, &commands, &none, craft.memory.data(), &receipt), CCSDS_ASSOCIATION);
    const Bytes large(TC_FRAME_MAX + 1);
    none.data = large.data();
    none.n = large.size();
    EXPECT_EQ(sdls_tc_check(&craft.sdls, &commands, &none, craft.memory.data(), &receipt), CCSDS_ROOM);
    none.type = TC_BC; // a control command has no protection
    receipt.association = &craft.associations[0];
    EXPECT_EQ(sdls_tc_check(&craft.sdls, &commands, &none, craft.memory.data(), &receipt), CCSDS_OK);
    EXPECT_EQ(receipt.association, nullptr);
    sdls_accept(&receipt);
    EXPECT_EQ(craft.associations[0].accepted, 0u);
    none.type = TC_AD;
    for (const std::size_t n : {std::size_t{0}, tc_room(&commands) - SDLS_OVERHEAD + 1}) {
        none.n = n;
        EXPECT_EQ(sdls_tc_protect(&ground.sdls, &commands, &none, ground.memory.data()), CCSDS_ROOM);
    }
    EXPECT_EQ(ground.sdls.faults[CCSDS_ROOM], 2u);
    none.n = tc_room(&commands) - SDLS_OVERHEAD;
    EXPECT_EQ(sdls_tc_protect(&ground.sdls, &commands, &none, ground.memory.data()), CCSDS_OK);
    ground.associations[0].next = UINT64_MAX; // no number is left
    none.data = large.data();
    none.n = 1;
    EXPECT_EQ(sdls_tc_protect(&ground.sdls, &commands, &none, ground.memory.data()), CCSDS_ASSOCIATION);
    ground.associations[0].next = 20;
    ground.associations[0].key = 9;
    EXPECT_EQ(sdls_tc_protect(&ground.sdls, &commands, &none, ground.memory.data()), CCSDS_ASSOCIATION);
    EXPECT_EQ(ground.associations[0].next, 21u); // no number is used twice, whatever happens
}

TEST(Sdls, an_association_has_states)
{
    SdlsAssociation association{7, 1, 0, SDLS_ENCRYPT, 64, 0, 0, SDLS_UNKEYED, 0, {}, 0, 0};
    EXPECT_FALSE(sdls_start(&association) || sdls_stop(&association) || sdls_expire(&association));
    for (const auto &[spi, window] : {std::pair{0, 64}, {65535, 64}, {7, 0}, {7, 257}}) {
        SdlsAssociation impossible = association;
        impossible.spi = static_cast<std::uint16_t>(spi);
        impossible.window = static_cast<std::uint16_t>(window);
        EXPECT_FALSE(sdls_rekey(&impossible, 1, 0));
    }
    SdlsAssociation last = association;
    last.spi = 65534;
    EXPECT_TRUE(sdls_rekey(&last, 1, 0));
    EXPECT_TRUE(sdls_rekey(&association, 3, 99));
    EXPECT_TRUE(association.state == SDLS_KEYED && association.key == 3 && association.next == 99);
    EXPECT_FALSE(sdls_rekey(&association, 4, 0) || sdls_stop(&association));
    EXPECT_TRUE(sdls_start(&association));
    EXPECT_FALSE(sdls_start(&association) || sdls_expire(&association) || sdls_rekey(&association, 4, 0));
    EXPECT_TRUE(sdls_stop(&association) && sdls_expire(&association));
    EXPECT_EQ(association.state, SDLS_UNKEYED);
}

TEST(Sdls, a_number_is_accepted_once_within_the_window)
{
    std::mt19937 random(3);
    for (const std::uint16_t window : {1, 2, 31, 32, 33, 100, 255, 256}) {
        End craft(SDLS_AUTHENTICATE, 1, window);
        SdlsAssociation &association = craft.associations[0];
        const std::uint64_t start = association.next;
        std::set<std::uint64_t> accepted;
        std::uint64_t newest = start - 1;
        End ground(SDLS_AUTHENTICATE);
        for (int i = 0; i < 3000; i++) {
            const std::uint64_t ahead = random() % 50 == 0 ? random() % 1000 : random() % 4;
            const std::uint64_t behind = random() % (2u * window + 8);
            const std::uint64_t number = random() % 2 != 0 ? newest + ahead : newest - std::min(newest, behind);
            ground.associations[0].next = number;
            const bool fits = number >= start && newest - number + 1 <= window;
            const bool expected = number > newest || (fits && accepted.count(number) == 0);
            const bool farm = random() % 8 != 0;
            Bytes data;
            ASSERT_EQ(craft.take(ground.command({9}), data, farm), expected ? CCSDS_OK : CCSDS_REPLAY)
                << number << " after " << newest << ", window " << window;
            if (expected && farm) {
                accepted.insert(number);
                newest = std::max(newest, number);
            }
        }
        EXPECT_EQ(association.accepted, accepted.size());
        EXPECT_EQ(association.next, newest + 1);
        EXPECT_EQ(craft.sdls.faults[CCSDS_REPLAY] > 0, true);
    }
}

TEST(Sdls, after_a_reset_the_owner_goes_on_behind_what_it_kept)
{
    End ground, craft;
    std::vector<Bytes> frames;
    for (int i = 0; i < 5; i++) {
        frames.push_back(ground.command({1}));
    }
    EXPECT_EQ(craft.take(frames[0]), CCSDS_OK);
    EXPECT_EQ(craft.take(frames[3]), CCSDS_OK);
    const std::uint64_t kept = craft.associations[0].next;
    ASSERT_TRUE(sdls_stop(&craft.associations[0]) && sdls_expire(&craft.associations[0]));
    ASSERT_TRUE(sdls_rekey(&craft.associations[0], 1, kept) && sdls_start(&craft.associations[0]));
    for (int i = 0; i < 4; i++) { // also those that did not come: it cannot tell
        EXPECT_EQ(craft.take(frames[static_cast<std::size_t>(i)]), CCSDS_REPLAY);
    }
    EXPECT_EQ(craft.take(frames[4]), CCSDS_OK);
}

} // namespace sdls_test
