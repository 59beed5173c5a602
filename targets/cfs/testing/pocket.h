// SPDX-License-Identifier: Apache-2.0
// For tests: the pocket, booted afresh in a folder of its own, and packets by hand.
#pragma once

extern "C" {
#include "targets/cfs/pocket.h"
}

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <gtest/gtest.h>
#include <string>
#include <vector>

using Bytes = std::vector<std::uint8_t>;

class Pocket : public testing::Test {
protected:
    void SetUp() override
    {
        std::string pattern = testing::TempDir() + "pocketXXXXXX";
        folder = ::mkdtemp(pattern.data());
        std::filesystem::create_directory(folder / "cf");
        std::filesystem::create_directory(folder / "ram");
        boot(nullptr, 0);
    }
    void boot(const PocketApp *apps, std::uint32_t n)
    {
        pocket_boot(folder.c_str(), apps, n);
        pocket_quiet(true);
        ASSERT_EQ(CFE_EVS_Register(nullptr, 0, CFE_EVS_EventFilter_BINARY), 0);
        // Where the test sees events; none of them is lost.
        ASSERT_EQ(CFE_SB_CreatePipe(&event_pipe, 60, "events"), 0);
        ASSERT_EQ(CFE_SB_SubscribeEx(id(CFE_EVS_LONG_EVENT_MSG_MID), event_pipe, CFE_SB_Qos_t{0, 0}, 60), 0);
    }
    void TearDown() override
    {
        EXPECT_TRUE(pocket_stop(10000));
        std::filesystem::remove_all(folder);
    }

    static CFE_SB_MsgId_t id(std::uint32_t value) { return CFE_SB_ValueToMsgId(value); }

    static CFE_SB_PipeId_t pipe(std::uint16_t depth, const char *name = "p")
    {
        CFE_SB_PipeId_t pipe;
        EXPECT_EQ(CFE_SB_CreatePipe(&pipe, depth, name), 0);
        return pipe;
    }

    /// A command with its checksum.
    static Bytes command(std::uint32_t mid, unsigned code, const Bytes &payload = {})
    {
        Bytes p(8 + payload.size());
        std::copy(payload.begin(), payload.end(), p.begin() + 8);
        p[0] = std::uint8_t(mid >> 8);
        p[1] = std::uint8_t(mid);
        p[2] = 0xc0;
        p[6] = std::uint8_t(code);
        p[4] = std::uint8_t((p.size() - 7) >> 8);
        p[5] = std::uint8_t(p.size() - 7);
        std::uint8_t sum = 0xff;
        for (const std::uint8_t b : p) {
            sum ^= b;
        }
        p[7] = sum;
        return p;
    }
    static bool ingest(const Bytes &p) { return pocket_ingest(p.data(), p.size()); }
    static Bytes text(const std::string &s, std::size_t n)
    {
        Bytes b(s.begin(), s.end());
        b.resize(n);
        return b;
    }

    struct Event {
        std::string app;
        unsigned id, type;
        std::string text;
    };
    /// The next event of this app, waited for; events of others before it are passed over.
    Event event(const std::string &app, int ms = 10000)
    {
        CFE_SB_Buffer_t *b;
        while (CFE_SB_ReceiveBuffer(&b, event_pipe, ms) == CFE_SUCCESS) {
            CFE_EVS_LongEventTlm_t e;
            std::memcpy(&e, b, sizeof e);
            if (e.Payload.PacketID.AppName == app) {
                return {app, e.Payload.PacketID.EventID, e.Payload.PacketID.EventType, e.Payload.Message};
            }
        }
        return {"", 0, 0, "no event"};
    }

    std::filesystem::path folder;
    CFE_SB_PipeId_t event_pipe{};
};
