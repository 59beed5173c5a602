// SPDX-License-Identifier: Apache-2.0
// Both ends of a link of frames: a link that loses, damages, repeats and replays; how COP-1 begins, and begins anew;
// the frames of others; what is refused.
#include "ccsds/security/aes_gcm.h"
#include "ccsds/space_link.h"
#include "ccsds/testing/bits.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <functional>
#include <memory>
#include <set>

namespace ccsds_space_link_test {

using namespace ccsds::testing;

/// What F Prime's ground system and Yamcs agree on without further settings.
constexpr SpaceLinkSetup plain{{68, 1, 0, 1}, {68, 1024, 0, 1}, 1, 0, 0, 0, 0, 0, 40, 0};
/// All that there is.
constexpr SpaceLinkSetup full{{42, 3, 1, 1}, {42, 256, 1, 1}, 2, 5, 1, 1, 1, 1, 40, 1};

/// A packet with a number in it.
Bytes packet_of(std::uint32_t number, std::size_t n = 30, bool command = true)
{
    Bytes packet(n);
    const SpacePacket head{static_cast<std::uint32_t>(n), 9, 0, command, 0, SPACE_PACKET_WHOLE};
    space_packet_write(&head, packet.data());
    ccsds_put32(&packet[6], number);
    return packet;
}

/// Associations 7 of commands and 8 of telemetry, at one end.
struct Keys {
    AesGcmKey expanded{};
    AesGcmKeys keys{&expanded, 1};
    SdlsAssociation associations[2]{};
    Sdls sdls{};
    SpaceLinkSecurity security{&sdls, &sdls_functions};

    explicit Keys(const SpaceLinkSetup &setup)
    {
        const Bytes bytes(32, 9);
        aes_gcm_expand(&expanded, 1, bytes.data(), bytes.size());
        associations[0] = {7, 1, setup.commands.virtual_channel, SDLS_ENCRYPT, 200, 0, 1, SDLS_UNKEYED, 0, {}, 0, 0};
        associations[1] = {8, 0, setup.virtual_channel, SDLS_ENCRYPT, 1, 0, 2, SDLS_UNKEYED, 0, {}, 0, 0};
        for (SdlsAssociation &association : associations) {
            sdls_rekey(&association, 1, 0);
            sdls_start(&association);
        }
        sdls = {aes_gcm(&keys), associations, 2, {}};
    }
    Keys(const Keys &) = delete;
};

/// The spacecraft: commands wait for its next instant, 4 at most.
struct Craft {
    SpaceLinkSetup setup;
    std::unique_ptr<Keys> keys;
    SpaceLinkCraft craft{};
    std::deque<Bytes> down;
    std::vector<Bytes> packets;
    std::uint16_t spi = 0;
    int waiting = 0;

    Craft(const SpaceLinkSetup &s, bool secured) : setup(s), keys(secured ? new Keys(s) : nullptr)
    {
        EXPECT_TRUE(space_link_is_possible(&setup, secured));
        space_link_craft_begin(&craft, &setup);
    }
    const SpaceLinkSecurity *security() const { return keys ? &keys->security : nullptr; }
    static void sink(void *user, const std::uint8_t *frame, std::size_t n)
    {
        static_cast<Craft *>(user)->down.emplace_back(frame, frame + n);
    }
    void take(const Bytes &bytes)
    {
        space_link_craft_take(
            &craft, &setup, security(), bytes.data(), bytes.size(), waiting < 4,
            [](void *user, const std::uint8_t *packet, std::size_t n, std::uint16_t by) {
                auto &self = *static_cast<Craft *>(user);
                self.packets.emplace_back(packet, packet + n);
                self.spi = by;
                self.waiting++;
            },
            this);
    }
    void send(const Bytes &packet)
    {
        space_link_craft_send(&craft, &setup, security(), packet.data(), packet.size(), sink, this);
    }
    void flush(bool idle = false)
    {
        waiting = 0;
        space_link_craft_flush(&craft, &setup, security(), idle, sink, this);
    }
};

struct Ground {
    std::unique_ptr<Keys> keys;
    std::unique_ptr<SpaceLinkGround> ground = std::make_unique<SpaceLinkGround>();
    std::deque<Bytes> up;
    std::vector<Bytes> packets;
    std::vector<std::pair<SpaceLinkAnswer, std::uint32_t>> answers;
    std::int64_t t = 0;

    Ground(const SpaceLinkSetup &setup, bool secured, std::uint8_t limit = 6)
        : keys(secured ? new Keys(setup) : nullptr)
    {
        const SpaceLinkSinks sinks{[](void *user, const std::uint8_t *bytes, std::size_t n) {
                                       static_cast<Ground *>(user)->up.emplace_back(bytes, bytes + n);
                                   },
                                   [](void *user, const std::uint8_t *packet, std::size_t n) {
                                       static_cast<Ground *>(user)->packets.emplace_back(packet, packet + n);
                                   },
                                   [](void *user, SpaceLinkAnswer answer, std::uint32_t tag) {
                                       static_cast<Ground *>(user)->answers.emplace_back(answer, tag);
                                   },
                                   this};
        space_link_ground_begin(ground.get(), &setup, keys ? &keys->security : nullptr, &sinks, 1000, limit);
    }
    bool send(std::uint32_t tag, const Bytes &packet)
    {
        return space_link_ground_send(ground.get(), tag, packet.data(), packet.size()) != 0;
    }
    void take(const Bytes &bytes) { space_link_ground_take(ground.get(), bytes.data(), bytes.size()); }
    std::size_t count(SpaceLinkAnswer answer) const
    {
        return static_cast<std::size_t>(
            std::count_if(answers.begin(), answers.end(), [&](const auto &reply) { return reply.first == answer; }));
    }
};

/// An exchange without loss: what the ground sent arrives, then what the spacecraft sends.
void exchange(Ground &ground, Craft &craft, bool idle = false)
{
    while (!ground.up.empty()) {
        craft.take(ground.up.front());
        ground.up.pop_front();
    }
    craft.flush(idle);
    while (!craft.down.empty()) {
        ground.take(craft.down.front());
        craft.down.pop_front();
    }
}

/// Some of what is under way arrives, damaged, twice (if COP-1 or security sees that) or not at all; with `replays` now
/// and then something old does.
void carry(std::mt19937 &random, std::deque<Bytes> &way, std::vector<Bytes> &old, bool twice, bool replays,
           const std::function<void(const Bytes &)> &arrive)
{
    while (!way.empty()) {
        Bytes unit = std::move(way.front());
        way.pop_front();
        const std::uint32_t fate = random() % 100;
        if (old.size() < 100) {
            old.push_back(unit);
        } else {
            old[random() % 100] = unit;
        }
        if (fate < 4) {
            for (int i = 0; i < 12; i++) {
                unit[random() % unit.size()] ^= static_cast<std::uint8_t>(random());
            }
        }
        if (fate < 82) {
            arrive(unit);
        }
        if (twice && fate % 10 == 0) {
            arrive(unit);
        }
        if (replays && random() % 10 == 0) {
            arrive(old[random() % old.size()]);
        }
    }
}

void pass_through_a_bad_link(SpaceLinkSetup setup, bool secured)
{
    const std::uint32_t commands = 3000;
    std::mt19937 random(5);
    setup.cop1 = 1;
    setup.telemetry.control = 1;
    Craft craft(setup, secured);
    Ground ground(setup, secured);
    std::vector<Bytes> old_up, old_down;
    std::uint32_t tag = 0, numbered = 0;
    for (int i = 0; ground.answers.size() < commands; i++) {
        ASSERT_LT(i, 200000);
        space_link_ground_time(ground.ground.get(), ground.t += 300);
        if (tag < commands && random() % 3 == 0 && space_link_ground_is_ready(ground.ground.get())) {
            const std::size_t n = random() % 20 == 0 ? 1500 : 12 + random() % 300; // some are longer than a frame
            ASSERT_TRUE(
                ground.send(tag, packet_of(tag, setup.commands.segments != 0 ? std::min<std::size_t>(n, 1000) : 40)));
            tag++;
        }
        carry(random, ground.up, old_up, true, secured, [&](const Bytes &unit) { craft.take(unit); });
        for (std::uint32_t k = random() % 3; k-- != 0;) {
            craft.send(packet_of(numbered++, 12 + random() % 400, false));
        }
        craft.flush();
        carry(random, craft.down, old_down, secured, secured, [&](const Bytes &unit) { ground.take(unit); });
    }
    std::vector<std::uint32_t> executed;
    for (const Bytes &packet : craft.packets) {
        executed.push_back(ccsds_get32(&packet[6]));
        ASSERT_EQ(packet, packet_of(executed.back(), packet.size()));
    }
    ASSERT_TRUE(std::adjacent_find(executed.begin(), executed.end(), std::greater_equal<>()) == executed.end());
    std::set<std::uint32_t> answered;
    for (const auto &[answer, answer_tag] : ground.answers) {
        ASSERT_TRUE(answered.insert(answer_tag).second) << "one answer to each";
        ASSERT_TRUE(answer == SPACE_LINK_FAILED || std::binary_search(executed.begin(), executed.end(), answer_tag))
            << answer_tag;
    }
    EXPECT_GT(ground.count(SPACE_LINK_CONFIRMED), commands * 9 / 10);
    std::uint32_t last = 0;
    for (const Bytes &packet : ground.packets) { // telemetry: what comes is right, and in order
        const std::uint32_t number = ccsds_get32(&packet[6]);
        ASSERT_TRUE(number == 0 || number > last);
        ASSERT_EQ(packet, packet_of(number, packet.size(), false));
        last = number;
    }
    EXPECT_GT(ground.packets.size(), numbered / 2);
    EXPECT_GT(craft.craft.farm.discarded, secured ? 0u : commands / 20);
    EXPECT_GT(ground.ground->receiver.missing, 10u);
    if (secured) {
        EXPECT_EQ(craft.spi, 7);
        EXPECT_GT(craft.craft.faults[CCSDS_REPLAY], commands / 20);
        EXPECT_GT(ground.ground->faults[CCSDS_REPLAY], commands / 20);
    }
}

TEST(SpaceLink, commands_are_executed_once_and_in_order_or_reported)
{
    pass_through_a_bad_link(plain, false);
    pass_through_a_bad_link(full, false);
}

TEST(SpaceLink, with_security_so_they_are_whatever_is_replayed)
{
    pass_through_a_bad_link(plain, true);
    pass_through_a_bad_link(full, true);
}

TEST(SpaceLink, frames_of_others_pass)
{
    // A telecommand as F Prime's ground system frames it: spacecraft 68, channel 1, bypass, number 0.
    Craft craft(plain, false);
    Bytes frame = from_hex("2044041a00");
    const Bytes packet = packet_of(77, 20);
    frame.insert(frame.end(), packet.begin(), packet.end());
    const std::uint32_t crc = ccsds_crc16(frame.data(), frame.size());
    frame.push_back(static_cast<std::uint8_t>(crc >> 8));
    frame.push_back(static_cast<std::uint8_t>(crc));
    craft.take(frame);
    ASSERT_EQ(craft.packets, std::vector<Bytes>{packet});
    EXPECT_EQ(craft.craft.farm.accepted, 1u);
    craft.flush();
    EXPECT_TRUE(craft.down.empty()) << "without a CLCW there is nothing to say";
    craft.send(packet);
    craft.flush();
    ASSERT_EQ(craft.down.size(), 1u);
    const Bytes &sent = craft.down.front();
    ASSERT_EQ(sent.size(), 1024u);
    EXPECT_EQ(Bytes(sent.begin(), sent.begin() + 6), from_hex("044200001800"));
    EXPECT_EQ(Bytes(sent.begin() + 6, sent.begin() + 26), packet);
    EXPECT_EQ(Bytes(sent.begin() + 26, sent.begin() + 32), from_hex("07ffc00003dd")); // an idle packet fills
    EXPECT_EQ(ccsds_crc16(sent.data(), sent.size()), 0);

    Ground ground(plain, false); // and ours makes the same
    EXPECT_TRUE(ground.send(3, packet));
    ASSERT_EQ(ground.up, std::deque<Bytes>{frame});
    EXPECT_EQ(ground.answers, (std::vector{std::pair{SPACE_LINK_SENT, 3u}}));
    ground.take(sent);
    EXPECT_EQ(ground.packets, std::vector<Bytes>{packet});
    EXPECT_FALSE(ground.send(4, Bytes(1018))) << "too long, and the channel has no segments";
}

TEST(SpaceLink, several_packets_and_several_frames_come_in_one_unit)
{
    Ground ground(plain, false);
    Craft craft(plain, false);
    Bytes both = packet_of(1, 20), unit;
    const Bytes second = packet_of(2, 40);
    both.insert(both.end(), second.begin(), second.end());
    ground.send(1, both);
    ground.send(2, packet_of(3));
    for (const Bytes &part : ground.up) {
        unit.insert(unit.end(), part.begin(), part.end());
    }
    craft.take(unit);
    EXPECT_EQ(craft.packets, (std::vector{packet_of(1, 20), second, packet_of(3)}));
    EXPECT_EQ(craft.craft.packets, 3u);
}

TEST(SpaceLink, the_service_starts_by_itself_whatever_the_state_of_the_spacecraft)
{
    for (const int state : {0, 1, 2, 3}) {
        Craft craft(full, false);
        Ground ground(full, false);
        craft.craft.farm.next = 200;
        craft.craft.farm.state = state == 1 ? FARM_LOCKOUT : FARM_OPEN;
        craft.craft.farm.retransmit = state == 2;
        if (state == 3) {
            craft.craft.farm.wait = 1;
            craft.craft.farm.state = FARM_WAIT;
        }
        EXPECT_TRUE(ground.send(1, packet_of(1)));
        EXPECT_EQ(ground.up.size(), 1u) << "it asks for a CLCW";
        for (int i = 0; i < 4; i++) {
            exchange(ground, craft);
        }
        EXPECT_EQ(craft.packets, std::vector<Bytes>{packet_of(1)}) << state;
        EXPECT_EQ(ground.count(SPACE_LINK_CONFIRMED), 1u);
        EXPECT_EQ(craft.craft.farm.next, 201);
        for (std::uint32_t i = 2; i < 10; i++) {
            EXPECT_TRUE(ground.send(i, packet_of(i)));
        }
        exchange(ground, craft);
        ground.t = 5000;
        space_link_ground_time(ground.ground.get(), ground.t); // only 4 found room
        exchange(ground, craft);
        exchange(ground, craft);
        EXPECT_EQ(ground.count(SPACE_LINK_CONFIRMED), 9u);
        EXPECT_EQ(ground.ground->alerts, 0u);
    }
}

TEST(SpaceLink, it_begins_anew_after_a_lockout_and_after_a_reset_of_the_spacecraft)
{
    for (const bool lockout : {false, true}) {
        Craft craft(full, false);
        Ground ground(full, false);
        for (std::uint32_t i = 0; i < 7; i++) {
            exchange(ground, craft);
            EXPECT_TRUE(ground.send(i, packet_of(i)));
        }
        exchange(ground, craft);
        ASSERT_EQ(ground.count(SPACE_LINK_CONFIRMED), 7u);
        if (lockout) {
            craft.craft.farm.state = FARM_LOCKOUT;
        } else {
            space_link_craft_begin(&craft.craft, &full);
        }
        EXPECT_TRUE(ground.send(7, packet_of(7)));
        ground.up.clear();
        for (int i = 0; i < 4; i++) {
            exchange(ground, craft, true);
        }
        EXPECT_EQ(ground.answers.back(), (std::pair{SPACE_LINK_FAILED, 7u}));
        EXPECT_TRUE(ground.send(8, packet_of(8)));
        exchange(ground, craft);
        EXPECT_EQ(ground.answers.back(), (std::pair{SPACE_LINK_CONFIRMED, 8u}));
        EXPECT_EQ(craft.craft.farm.next, 9) << "behind what failed";
        EXPECT_EQ(ground.ground->alerts, 1u);
    }
}

TEST(SpaceLink, a_command_is_given_up_after_its_last_transmission)
{
    Craft craft(full, false);
    Ground ground(full, false, 3);
    exchange(ground, craft);
    EXPECT_TRUE(ground.send(1, packet_of(1, 2000))); // two segments
    EXPECT_FALSE(space_link_ground_due(ground.ground.get()) == INT64_MAX);
    std::size_t n = 0;
    while (ground.answers.empty()) {
        n += ground.up.size();
        ground.up.clear();
        space_link_ground_time(ground.ground.get(), ground.t += 1000);
    }
    EXPECT_EQ(n, 6u);
    EXPECT_EQ(ground.answers, (std::vector{std::pair{SPACE_LINK_FAILED, 1u}}));
    EXPECT_EQ(ground.ground->alert, FOP_ALERT_T1);
    EXPECT_EQ(space_link_ground_due(ground.ground.get()), INT64_MAX);
}

TEST(SpaceLink, what_is_not_for_this_spacecraft_is_refused_and_counted)
{
    const auto refused = [](SpaceLinkSetup other, bool secured, const Bytes &cut = {}) {
        other.cop1 = 0;
        Craft craft(full, secured);
        Ground ground(other, false);
        ground.send(1, packet_of(1, 50));
        craft.take(cut.empty() ? ground.up.front() : cut);
        EXPECT_TRUE(craft.packets.empty());
        const auto *found = std::max_element(craft.craft.faults, craft.craft.faults + CCSDS_FAULTS);
        EXPECT_EQ(std::count_if(craft.craft.faults, craft.craft.faults + CCSDS_FAULTS, [](auto n) { return n != 0; }),
                  1);
        return static_cast<CcsdsFault>(found - craft.craft.faults);
    };
    SpaceLinkSetup other = full;
    other.commands.spacecraft = 43;
    EXPECT_EQ(refused(other, false), CCSDS_SPACECRAFT);
    other = full;
    other.commands.virtual_channel = 4;
    EXPECT_EQ(refused(other, false), CCSDS_CHANNEL);
    other = full;
    other.map = 6;
    EXPECT_EQ(refused(other, false), CCSDS_CHANNEL);
    other = full;
    other.commands.check = 0;
    EXPECT_EQ(refused(other, false), CCSDS_CRC);
    other = full;
    other.cltu = 0;
    EXPECT_EQ(refused(other, false), CCSDS_SHORT);
    EXPECT_EQ(refused(full, true), CCSDS_ASSOCIATION);
    EXPECT_EQ(refused(full, false, Bytes(9, 0xEB)), CCSDS_SHORT);
    Craft craft(plain, false);
    craft.take(Bytes(3000));
    EXPECT_EQ(craft.craft.faults[CCSDS_ROOM], 1u);
    Ground ground(plain, false);
    ground.send(1, Bytes(20, 0x3F)); // no packet
    craft.take(ground.up.front());
    EXPECT_EQ(craft.craft.faults[CCSDS_VERSION], 1u);
    EXPECT_TRUE(craft.packets.empty());
    Bytes several{0xE9, 4, 1, 2, 0xE0}; // an encapsulation packet, one that fills
    const Bytes good = packet_of(7);
    several.insert(several.end(), good.begin(), good.end());
    ground.up.clear();
    ground.send(2, several);
    craft.take(ground.up.front());
    EXPECT_EQ(craft.craft.faults[CCSDS_VERSION], 2u);
    EXPECT_EQ(craft.packets.size(), 1u);
}

TEST(SpaceLink, a_stream_is_found_again_behind_damage)
{
    for (const bool marker : {false, true}) {
        std::mt19937 random(2);
        SpaceLinkSetup setup = plain;
        setup.marker = setup.tm_random = marker;
        Craft craft(setup, false);
        Ground ground(setup, false);
        Bytes stream = any_bytes(random, 700);
        for (std::uint32_t i = 0; i < 40; i++) {
            craft.send(packet_of(i, 200, false));
            craft.flush();
            stream.insert(stream.end(), craft.down.front().begin(), craft.down.front().end());
            craft.down.clear();
            if (i % 10 == 5) {
                const Bytes noise = any_bytes(random, random() % 3000);
                stream.insert(stream.end(), noise.begin(), noise.end());
            }
        }
        for (std::size_t at = 0; at < stream.size();) {
            const std::size_t n = std::min<std::size_t>(1 + random() % 1500, stream.size() - at);
            ground.take(Bytes(stream.begin() + static_cast<std::ptrdiff_t>(at),
                              stream.begin() + static_cast<std::ptrdiff_t>(at + n)));
            at += n;
        }
        EXPECT_GE(ground.packets.size(), 34u); // a false beginning may hide the frame that it is in
        EXPECT_EQ(ground.packets.back(), packet_of(39, 200, false));
        EXPECT_EQ(ground.ground->receiver.missing, 40 - ground.packets.size());
    }
}

TEST(SpaceLink, a_whole_packet_ends_one_that_lacks_its_last_segment)
{
    SpaceLinkSetup setup = full;
    setup.cop1 = 0;
    Craft craft(setup, false);
    Ground ground(setup, false);
    EXPECT_FALSE(ground.send(1, {}));
    EXPECT_FALSE(ground.send(1, Bytes(SPACE_LINK_PACKET + 1)));
    EXPECT_TRUE(ground.send(1, packet_of(1, 1500)));
    EXPECT_TRUE(ground.send(2, packet_of(2)));
    ASSERT_EQ(ground.up.size(), 3u);
    EXPECT_EQ(ground.answers, (std::vector{std::pair{SPACE_LINK_SENT, 1u}, {SPACE_LINK_SENT, 2u}}));
    craft.take(ground.up[0]);
    craft.take(ground.up[2]);
    EXPECT_EQ(craft.packets, std::vector<Bytes>{packet_of(2)});
    EXPECT_EQ(craft.craft.faults[CCSDS_GAP], 1u);
    // The CLCW is kept, though there is no service that needs it.
    exchange(ground, craft);
    EXPECT_EQ(ground.ground->clcws, 1u);
    EXPECT_EQ(ground.ground->fop.state, FOP_INITIAL);
    EXPECT_EQ(space_link_ground_due(ground.ground.get()), INT64_MAX);
}

TEST(SpaceLink, a_command_fails_as_one_whose_first_segments_went_out)
{
    SpaceLinkSetup setup = full;
    setup.window = 2; // of one frame
    Craft craft(setup, false);
    Ground ground(setup, false, 2);
    exchange(ground, craft);
    EXPECT_TRUE(ground.send(1, packet_of(1, 3000)));
    EXPECT_FALSE(space_link_ground_is_ready(ground.ground.get()));
    for (int i = 0; i < 3; i++) {
        space_link_ground_time(ground.ground.get(), ground.t += 1000);
    }
    EXPECT_EQ(ground.answers, (std::vector{std::pair{SPACE_LINK_FAILED, 1u}}));
    EXPECT_TRUE(space_link_ground_is_ready(ground.ground.get()));
    EXPECT_EQ(ground.ground->alert, FOP_ALERT_T1);

    Ground secured(full, true); // as one that its association does not protect
    Craft other(full, true);
    exchange(secured, other);
    sdls_stop(&secured.keys->associations[0]);
    EXPECT_TRUE(secured.send(1, packet_of(1)));
    EXPECT_EQ(secured.answers, (std::vector{std::pair{SPACE_LINK_FAILED, 1u}}));
    EXPECT_TRUE(space_link_ground_is_ready(secured.ground.get()));
}

TEST(SpaceLink, the_service_starts_by_telemetry_alone)
{
    Craft craft(full, false);
    Ground ground(full, false);
    craft.craft.farm.next = 200;
    craft.craft.farm.retransmit = 1; // of what somebody else sent: it is unlocked first
    exchange(ground, craft, true);
    EXPECT_EQ(ground.ground->fop.state, FOP_CONTROLLING);
    exchange(ground, craft, true);
    EXPECT_EQ(ground.ground->fop.state, FOP_ACTIVE);
    // Locked, though nothing was lost: it goes on where it was.
    craft.craft.farm.state = FARM_LOCKOUT;
    for (int i = 0; i < 3; i++) {
        exchange(ground, craft, true);
    }
    EXPECT_EQ(ground.ground->alert, FOP_ALERT_LOCKOUT);
    EXPECT_TRUE(ground.send(1, packet_of(1)));
    exchange(ground, craft);
    EXPECT_EQ(ground.answers, (std::vector{std::pair{SPACE_LINK_CONFIRMED, 1u}}));
    EXPECT_EQ(craft.craft.farm.next, 201);
}

TEST(SpaceLink, a_command_waits_until_it_may_ask_again)
{
    Ground ground(full, false);
    EXPECT_TRUE(ground.send(1, packet_of(1)));
    EXPECT_EQ(space_link_ground_due(ground.ground.get()), 1000); // of the timer
    space_link_ground_time(ground.ground.get(), 999);
    EXPECT_EQ(ground.up.size(), 1u);
    space_link_ground_time(ground.ground.get(), 1000);
    EXPECT_EQ(ground.up.size(), 2u);
}

TEST(SpaceLink, telemetry_of_others_and_words_that_are_no_clcw)
{
    SpaceLinkSetup setup = plain;
    setup.telemetry.control = 1;
    SpaceLinkSetup other = setup;
    other.virtual_channel = 2;
    Craft craft(setup, false), elsewhere(other, false);
    Ground ground(setup, false);
    exchange(ground, elsewhere, true);
    EXPECT_EQ(ground.ground->faults[CCSDS_CHANNEL], 1u);
    const auto take = [&](std::uint32_t word) {
        craft.flush(true);
        Bytes frame = craft.down.front();
        craft.down.clear();
        ccsds_put32(&frame[frame.size() - 6], ccsds_get32(&frame[frame.size() - 6]) ^ word);
        ccsds_put16(&frame[frame.size() - 2], ccsds_crc16(frame.data(), frame.size() - 2));
        ground.take(frame);
    };
    take(1u << 31); // another type of word
    EXPECT_EQ(ground.ground->faults[CCSDS_TYPE], 1u);
    take(1u << 18); // of another virtual channel
    EXPECT_EQ(ground.ground->clcws, 0u);
    take(0);
    EXPECT_EQ(ground.ground->clcws, 1u);
    EXPECT_EQ(ground.ground->receiver.missing, 0u);
}

TEST(SpaceLink, random_telemetry_without_a_marker)
{
    SpaceLinkSetup setup = plain;
    setup.tm_random = 1;
    Craft craft(setup, false);
    Ground ground(setup, false);
    for (std::uint32_t i = 0; i < 10; i++) {
        craft.send(packet_of(i, 200, false));
        craft.flush();
        craft.down.front()[500] ^= i == 4; // a damaged frame is passed over
        ground.take(craft.down.front());
        craft.down.clear();
    }
    EXPECT_EQ(ground.packets.size(), 9u);
    EXPECT_EQ(ground.ground->faults[CCSDS_CRC], 1u);
    EXPECT_EQ(ground.ground->skipped, setup.telemetry.size);
}

TEST(SpaceLink, commands_have_numbers_behind_the_newest_telemetry)
{
    Craft craft(full, true);
    Ground ground(full, true);
    std::vector<SdlsAssociation> associations(ground.keys->associations, ground.keys->associations + 2);
    associations.push_back(associations[1]); // an older one of telemetry
    associations[2].spi = 9;
    associations[2].next = 3;
    ground.keys->sdls.associations = associations.data();
    ground.keys->sdls.n = 3;
    craft.keys->associations[1].next = 50;
    exchange(ground, craft, true);
    EXPECT_EQ(associations[1].next, 51u);
    EXPECT_EQ(associations[0].next, 51u);
    EXPECT_EQ(associations[2].next, 3u);
}

TEST(SpaceLink, an_impossible_link_is_refused)
{
    EXPECT_TRUE(space_link_is_possible(&full, 1));
    const auto possible = [](auto change) {
        SpaceLinkSetup setup = full;
        change(setup);
        return space_link_is_possible(&setup, 1) != 0;
    };
    EXPECT_FALSE(possible([](auto &s) { s.commands.spacecraft = s.telemetry.spacecraft = 1024; }));
    EXPECT_FALSE(possible([](auto &s) { s.telemetry.spacecraft = 1; }));
    EXPECT_FALSE(possible([](auto &s) { s.commands.virtual_channel = 64; }));
    EXPECT_FALSE(possible([](auto &s) { s.virtual_channel = 8; }));
    EXPECT_FALSE(possible([](auto &s) { s.map = 64; }));
    EXPECT_FALSE(possible([](auto &s) { s.commands.segments = 0; }));
    EXPECT_FALSE(possible([](auto &s) { s.window = 41; }));
    EXPECT_FALSE(possible([](auto &s) { s.telemetry.size = 48; }));
    EXPECT_FALSE(possible([](auto &s) { s.telemetry.size = 2049; }));
}

} // namespace ccsds_space_link_test
