// SPDX-License-Identifier: Apache-2.0
// The service that speaks frames, as a host drives it: commands in frames, telemetry in frames with the CLCW, idle
// frames, roles, secured frames, resets.
#include "ccsds/security/aes_gcm.h"
#include "flight/services/testing/flight_software.h"

extern "C" {
#include "flight/services/space_link.h"
}

#include <gtest/gtest.h>

#include <cstring>
#include <memory>
#include <set>
#include <vector>

namespace flight_space_link_test {

using namespace service_testing;

/// Flight with a link alone, and the ground.
struct SpaceLinkService : testing::Test {
    SpaceLink link{};
    Bytes queue = Bytes(4096), staged = Bytes(16);
    const CommandService *list[1] = {&space_link_service};
    CommandServices services{};
    CommandTable table{};
    CommandState state{};
    std::vector<CommandReport> reports;
    std::vector<Bytes> down, seen_down, up, packets;
    std::vector<SpaceLinkAnswer> answers;
    std::unique_ptr<SpaceLinkGround> ground = std::make_unique<SpaceLinkGround>();
    std::int64_t t = -1;

    std::vector<AesGcmKey> expanded{2};
    AesGcmKeys keys{};
    SdlsProvider provider{};
    SdlsAssociation associations[2]{};
    Sdls sdls{};

    void SetUp() override
    {
        services = command_services(
            list, 1, [](void *m, std::uint32_t) -> void * { return &static_cast<SpaceLinkService *>(m)->link; });
        services.unwrap = command_service_unwrap;
        services.wrap = command_service_wrap;
        table = command_table(&services, queue.data(), queue.size());
        table.version = 7;
        table.n_modes = 3;
        table.enter = [](void *, std::uint16_t) {};
        table.reset = [](void *m, std::int64_t) { space_link_reset(&static_cast<SpaceLinkService *>(m)->link); };
        table.staged = staged.data();
        link.par.spacecraft = 68;
        command_begin(&state);
        space_link_reset(&link);
    }

    /// Keys 1 and 2; the ground has the role.
    void secure(std::uint32_t role)
    {
        const Bytes bytes(32, 5), others(32, 6);
        aes_gcm_expand(&expanded[0], 1, bytes.data(), 32);
        aes_gcm_expand(&expanded[1], 2, others.data(), 32);
        keys = {expanded.data(), 2};
        provider = {aes_gcm(&keys), &sdls_functions, provider.since};
        services.keys = &provider;
        link.par.secured = SDLS_ENCRYPT;
        link.par.roles[0].key = 1;
        link.par.roles[2].key = 2;
        link.par.roles[2].barred = 1u << COMMAND_MODE;
        link.par.telemetry_key = 1;
        for (std::uint32_t i = 0; i < 2; i++) {
            const std::uint32_t place = i == 0 ? role : std::uint32_t{LINK_ROLES};
            associations[i] = {};
            associations[i].spi = static_cast<std::uint16_t>(place + 1);
            associations[i].fixed = place + 1;
            associations[i].telecommand = i == 0;
            associations[i].service = SDLS_ENCRYPT;
            associations[i].window = 1;
            sdls_rekey(&associations[i], i == 0 && role == 2 ? 2 : 1, i == 0 ? 100 : 0);
            sdls_start(&associations[i]);
        }
        sdls = {provider.cipher, associations, 2, {}};
    }

    void begin_ground(std::uint8_t cop1)
    {
        link.par.cop1 = cop1;
        const SpaceLinkSetup setup{{68, 0, 0, 1}, {68, 1024, cop1, 1}, 0, 0, 0, 0, 0, 0, 128, cop1};
        const SpaceLinkSecurity security{&sdls, &sdls_functions};
        const SpaceLinkSinks sinks{[](void *me, const std::uint8_t *bytes, std::size_t n) {
                                       static_cast<SpaceLinkService *>(me)->up.emplace_back(bytes, bytes + n);
                                   },
                                   [](void *me, const std::uint8_t *bytes, std::size_t n) {
                                       static_cast<SpaceLinkService *>(me)->packets.emplace_back(bytes, bytes + n);
                                   },
                                   [](void *me, SpaceLinkAnswer answer, std::uint32_t) {
                                       static_cast<SpaceLinkService *>(me)->answers.push_back(answer);
                                   },
                                   this};
        space_link_ground_begin(ground.get(), &setup, sdls.n != 0 ? &security : nullptr, &sinks, 2'500'000'000, 5);
    }

    void send(const Bytes &packet)
    {
        ASSERT_TRUE(space_link_ground_send(ground.get(), 1, packet.data(), packet.size()));
    }

    const SpaceLinkCraft &craft() const { return *reinterpret_cast<const SpaceLinkCraft *>(link.mem.craft); }
    CommandContext context() { return {&state, &table, this, t, 0}; }
    static void report(void *me, const CommandReport *received, const std::uint8_t *)
    {
        static_cast<SpaceLinkService *>(me)->reports.push_back(*received);
    }
    void put(const Bytes &bytes)
    {
        const CommandContext now = context();
        services.wrap(
            &now, bytes.data(), static_cast<std::uint32_t>(bytes.size()),
            [](void *me, const std::uint8_t *unit, std::uint32_t n) {
                static_cast<SpaceLinkService *>(me)->down.emplace_back(unit, unit + n);
            },
            this);
    }
    void take(const Bytes &unit)
    {
        const CommandContext now = context();
        command_receive(&now, unit.data(), static_cast<std::uint32_t>(unit.size()), report, this);
    }
    /// An instant of flight: what the ground has sent arrives, is executed, and telemetry comes.
    void instant(const std::vector<Bytes> &telemetry = {})
    {
        t += t < 0 ? 1 : 1'000'000'000;
        for (const Bytes &unit : std::exchange(up, {})) {
            take(unit);
        }
        command_execute(&state, &table, this, t, report, this);
        space_link_update(&link, Tick{t, 1'000'000'000});
        for (const Bytes &packet : telemetry) {
            put(packet);
        }
        put({});
        seen_down.insert(seen_down.end(), down.begin(), down.end());
        for (const Bytes &unit : std::exchange(down, {})) {
            space_link_ground_take(ground.get(), unit.data(), unit.size());
        }
    }
};

TEST_F(SpaceLinkService, CommandsAndTelemetryPassInFrames)
{
    begin_ground(0);
    const Bytes telemetry = {0x08, 0x80, 0xC0, 0, 0, 3, 1, 2, 3, 4};
    send(packet(COMMAND_NOOP, {}, 5));
    instant({telemetry, telemetry});
    ASSERT_EQ(reports.size(), 2u);
    EXPECT_EQ(reports[1].sequence, 5);
    EXPECT_EQ(reports[1].executed, COMMAND_DONE);
    EXPECT_EQ(packets, (std::vector{telemetry, telemetry}));
    take({1, 2, 3});
    space_link_update(&link, Tick{t, 1});
    EXPECT_EQ(link.out.state.accepted, 1u);
    EXPECT_EQ(link.out.state.packets, 1u);
    EXPECT_EQ(link.out.state.sent, 1u);
    EXPECT_EQ(link.out.state.faults[CCSDS_SHORT], 1u);
    EXPECT_EQ(link.out.state.farm, std::uint32_t{FARM_OPEN});
    take(packet(COMMAND_NOOP, {}, 6)); // a packet is no frame
    EXPECT_EQ(reports.size(), 2u);
}

TEST_F(SpaceLinkService, TheGroundGetsItsClcwAndAnIdleFrameNowAndThen)
{
    begin_ground(1);
    link.par.idle = 3;
    send(packet(COMMAND_NOOP, {}, 5));
    instant(); // a first frame, which starts the service
    EXPECT_EQ(up.size(), 1u);
    EXPECT_EQ(space_link_service.next(&link), 3'000'000'000);
    instant();
    EXPECT_EQ(answers, std::vector{SPACE_LINK_CONFIRMED});
    EXPECT_EQ(craft().frames, 2u);
    for (const std::uint32_t frames : {2u, 2u, 3u, 3u, 3u, 4u}) {
        instant();
        EXPECT_EQ(craft().frames, frames);
    }
    take(Bytes{0x30, 0x44, 0x00, 0x07, 0x00, 0x00, 0x71, 0x2B}); // with a wrong check
    EXPECT_EQ(space_link_service.next(&link), t + 3'000'000'000);
    send(packet(COMMAND_NOOP, {}, 6));
    take(up[0]);
    EXPECT_EQ(space_link_service.next(&link), 0); // the CLCW is to go
}

TEST_F(SpaceLinkService, FramesAreThoseOfTheParametersAndThoseThatCannotBeDoNotPass)
{
    begin_ground(0);
    link.par.frame_size = 64;
    link.par.window = 40;
    link.par.idle = 1;
    const Bytes telemetry = packet(0, Bytes(80));
    instant(); // the first idle frame
    down.clear();
    t += 1'000'000'000;
    put(telemetry);
    EXPECT_EQ(space_link_service.next(&link), 0) << "a frame is not full";
    ASSERT_FALSE(down.empty());
    EXPECT_EQ(down[0].size(), 64u);
    EXPECT_EQ(craft().farm.window, 40);
    put({});
    const std::uint32_t sent = craft().frames;
    put({}); // no idle frame, as others have gone
    EXPECT_EQ(craft().frames, sent);
    EXPECT_EQ(space_link_service.next(&link), t + 1'000'000'000);
    for (const double never : {0.0, 1e10}) {
        link.par.idle = never;
        EXPECT_EQ(space_link_service.next(&link), INT64_MAX);
    }
    link.par.frame_size = 10;
    put(telemetry);
    EXPECT_EQ(craft().frames, sent);
    take(packet(COMMAND_NOOP, {}, 5));
    EXPECT_EQ(craft().faults[CCSDS_ASSOCIATION], 1u);
}

TEST_F(SpaceLinkService, FarmWaitsWhereTheQueueHasNoRoom)
{
    begin_ground(1);
    table.room = COMMAND_MAX + 8;
    instant();
    for (std::uint16_t i = 0; i < 3; i++) {
        send(packet(COMMAND_NOOP, {}, i));
    }
    instant();
    EXPECT_EQ(state.counters.executed, 2u);
    EXPECT_EQ(state.counters.refused, 0u);
    instant();
    instant();
    EXPECT_EQ(state.counters.executed, 3u);
    EXPECT_EQ(answers.size(), 3u);
}

TEST_F(SpaceLinkService, ARoleHasCommandsThatItMayNotGive)
{
    secure(2);
    begin_ground(1);
    instant();
    send(packet(COMMAND_MODE, {0, 7, 0, 1}, 1));
    send(packet(COMMAND_NOOP, {}, 1));
    instant();
    ASSERT_EQ(reports.size(), 3u);
    EXPECT_EQ(reports[0].reason, COMMAND_ROLE);
    EXPECT_EQ(reports[2].code, COMMAND_NOOP);
    EXPECT_EQ(state.counters.reasons[COMMAND_ROLE], 1u);
    EXPECT_EQ(state.barred, 0u);

    secure(0); // another holder of a key, at the next link
    begin_ground(1);
    instant();
    instant();
    send(packet(COMMAND_MODE, {0, 7, 0, 1}, 2));
    instant();
    instant();
    EXPECT_EQ(reports.back().code, COMMAND_MODE);
    EXPECT_EQ(reports.back().executed, COMMAND_DONE);
    EXPECT_EQ(reports.back().reason, COMMAND_OK);
}

TEST_F(SpaceLinkService, WhatIsNotSecuredOrCameBeforeChangesNothing)
{
    secure(0);
    begin_ground(0);
    send(packet(COMMAND_NOOP, {}, 1));
    instant(); // without a number the ground has only requested telemetry
    ASSERT_EQ(up.size(), 1u);
    const Bytes unit = up[0];
    instant();
    EXPECT_EQ(state.counters.executed, 1u);
    take(unit);
    Bytes forged = unit;
    forged[30] ^= 1;
    ccsds_put16(&forged[forged.size() - 2], ccsds_crc16(forged.data(), forged.size() - 2));
    take(forged);
    EXPECT_EQ(craft().faults[CCSDS_REPLAY], 1u);
    EXPECT_EQ(craft().faults[CCSDS_TAG], 1u);

    send(packet(COMMAND_RESET_FLIGHT, {0, 7}, 2)); // keeps the link
    instant();
    EXPECT_EQ(state.counters.executed, 2u);
    take(unit);
    EXPECT_EQ(craft().faults[CCSDS_REPLAY], 2u);

    services.keys = nullptr;
    const std::uint32_t sent = craft().frames;
    take(unit);
    instant({{0x08, 0x80, 0xC0, 0, 0, 0, 1}});
    EXPECT_EQ(craft().faults[CCSDS_ASSOCIATION], 1u);
    EXPECT_EQ(craft().frames, sent);
}

TEST_F(SpaceLinkService, AfterAResetOfTheComputerNothingOldPassesAndTheGroundGoesOn)
{
    std::uint16_t sequence = 0;
    for (const std::uint8_t cop1 : {0, 1}) {
        secure(0);
        begin_ground(cop1);
        std::set<Bytes> vectors;
        for (int life = 0; life < 4; life++) {
            std::vector<Bytes> old;
            for (int i = 0; i < 6; i++) {
                send(packet(COMMAND_NOOP, {}, sequence++));
                old.insert(old.end(), up.begin(), up.end());
                if (i == 4) {
                    up.clear(); // somebody keeps it
                }
                instant({{0x08, 0x80, 0xC0, 0, 0, 0, 1}});
                space_link_ground_time(ground.get(), t);
            }
            const std::uint32_t executed = state.counters.executed;
            EXPECT_GE(executed, 4u) << "life " << life << ", cop1 " << int{cop1};
            if (life == 2) { // another program of the ground goes on with the same key
                const std::uint32_t fixed = associations[0].fixed;
                secure(0);
                begin_ground(cop1);
                associations[0].fixed = fixed + 8;
                associations[0].next = 0;
            }
            link.mem = {};
            command_begin(&state);
            space_link_reset(&link);
            provider.since += life == 1 ? 5'000'000'000'000 : 0;
            t = life == 1 ? -1 : t;       // there flight's time begins with the computer's
            for (int i = 0; i < 2; i++) { // before the first instant and after it
                for (const Bytes &unit : old) {
                    take(unit);
                }
                up.clear();
                instant();
            }
            EXPECT_EQ(state.counters.executed, 0u);
            EXPECT_GE(craft().faults[CCSDS_REPLAY], 10u);
            for (int i = 0; i < 8; i++) {
                space_link_ground_time(ground.get(), t);
                instant();
            }
            for (const Bytes &frame : seen_down) {
                ASSERT_TRUE(vectors.insert(Bytes(frame.begin() + 6, frame.begin() + 20)).second);
            }
            seen_down.clear();
            send(packet(COMMAND_NOOP, {}, sequence++));
            instant();
            instant();
            EXPECT_EQ(state.counters.executed, 1u) << "life " << life << ", cop1 " << int{cop1};
        }
        seen_down.clear();
        provider.since += 50'000'000'000'000;
    }
}

} // namespace flight_space_link_test
