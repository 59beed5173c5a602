// SPDX-License-Identifier: Apache-2.0
// Packets, the software bus, events, time.
#include "targets/cfs/testing/pocket.h"

#include <cstring>
#include <deque>
#include <map>
#include <random>

namespace bus_test {

class Bus : public Pocket {};

Bytes bytes_of(const CFE_SB_Buffer_t *b)
{
    const auto *p = reinterpret_cast<const std::uint8_t *>(b);
    return {p, p + (p[4] << 8 | p[5]) + 7};
}

TEST_F(Bus, TypesHaveTheSizesOfTheRealOne)
{
    EXPECT_EQ(sizeof(CFE_SB_MsgId_t), 4u);
    EXPECT_EQ(sizeof(CFE_SB_PipeId_t), 4u);
    EXPECT_EQ(sizeof(CFE_TBL_Handle_t), 2u);
    EXPECT_EQ(sizeof(CFE_MSG_Message_t), 6u);
    EXPECT_EQ(sizeof(CFE_MSG_CommandHeader_t), 8u);
    EXPECT_EQ(sizeof(CFE_MSG_TelemetryHeader_t), 16u);
    EXPECT_EQ(sizeof(CFE_TIME_SysTime_t), 8u);
    EXPECT_EQ(sizeof(CFE_EVS_LongEventTlm_t), 172u);
}

TEST_F(Bus, ANoopIsTheseBytes)
{
    CFE_MSG_CommandHeader_t noop;
    ASSERT_EQ(CFE_MSG_Init(&noop.Msg, id(0x18c0), sizeof noop), 0);
    ASSERT_EQ(CFE_MSG_SetFcnCode(&noop.Msg, 0), 0);
    ASSERT_EQ(CFE_MSG_GenerateChecksum(&noop.Msg), 0);
    const Bytes expected{0x18, 0xc0, 0xc0, 0x00, 0x00, 0x01, 0x00, 0xe6};
    EXPECT_EQ(std::memcmp(&noop, expected.data(), 8), 0);
    EXPECT_EQ(command(0x18c0, 0), expected);
}

TEST_F(Bus, AChecksumSeesEveryBit)
{
    std::mt19937 random(7);
    for (int n = 0; n < 50; n++) {
        Bytes payload(random() % 60);
        for (auto &b : payload) {
            b = std::uint8_t(random());
        }
        Bytes p = command(0x1800 + random() % 256, random() % 128, payload);
        const auto *m = reinterpret_cast<const CFE_MSG_Message_t *>(p.data());
        bool valid = false;
        ASSERT_EQ(CFE_MSG_ValidateChecksum(m, &valid), 0);
        EXPECT_TRUE(valid);
        const std::size_t bit = 48 + random() % (8 * p.size() - 48); // the header has type and size
        p[bit / 8] ^= std::uint8_t(1u << bit % 8);
        ASSERT_EQ(CFE_MSG_ValidateChecksum(m, &valid), 0);
        EXPECT_FALSE(valid) << "bit " << bit;
    }
}

TEST_F(Bus, ACommandWithoutItsHeaderHasNoCode)
{
    Bytes p = command(0x18c0, 3);
    p[5] = 0; // 7 bytes
    const auto *m = reinterpret_cast<const CFE_MSG_Message_t *>(p.data());
    CFE_MSG_FcnCode_t code = 9;
    bool valid = true;
    EXPECT_EQ(CFE_MSG_GetFcnCode(m, &code), CFE_MSG_WRONG_MSG_TYPE);
    EXPECT_EQ(code, 0);
    EXPECT_EQ(CFE_MSG_ValidateChecksum(m, &valid), CFE_MSG_WRONG_MSG_TYPE);
    EXPECT_FALSE(valid);
}

TEST_F(Bus, TelemetryCarriesItsTime)
{
    struct {
        CFE_MSG_TelemetryHeader_t header;
        std::uint8_t data[8];
    } m;
    ASSERT_EQ(CFE_MSG_Init(&m.header.Msg, id(0x08c1), sizeof m), 0);
    ASSERT_EQ(CFE_MSG_SetMsgTime(&m.header.Msg, {0x01020304, 0xa5b6c7d8}), 0);
    const Bytes expected{0x08, 0xc1, 0xc0, 0, 0, 17, 1, 2, 3, 4, 0xa5, 0xb6, 0, 0, 0, 0};
    EXPECT_EQ(std::memcmp(&m, expected.data(), 16), 0);
    CFE_TIME_SysTime_t t;
    ASSERT_EQ(CFE_MSG_GetMsgTime(&m.header.Msg, &t), 0);
    EXPECT_EQ(t.Seconds, 0x01020304u);
    EXPECT_EQ(t.Subseconds, 0xa5b60000u);
}

TEST_F(Bus, EverySubscriberGetsTheMessagesInOrder)
{
    const auto a = pipe(16, "a"), b = pipe(16, "b");
    ASSERT_EQ(CFE_SB_Subscribe(id(0x1801), a), 0);
    ASSERT_EQ(CFE_SB_Subscribe(id(0x1801), b), 0);
    ASSERT_EQ(CFE_SB_Subscribe(id(0x1802), b), 0);
    const Bytes first = command(0x1801, 1), second = command(0x1802, 2, {1, 2, 3});
    EXPECT_TRUE(ingest(second));
    EXPECT_TRUE(ingest(first));
    CFE_SB_Buffer_t *m;
    ASSERT_EQ(CFE_SB_ReceiveBuffer(&m, a, CFE_SB_POLL), 0);
    EXPECT_EQ(bytes_of(m), first);
    EXPECT_EQ(CFE_SB_ReceiveBuffer(&m, a, CFE_SB_POLL), CFE_SB_NO_MESSAGE);
    ASSERT_EQ(CFE_SB_ReceiveBuffer(&m, b, CFE_SB_POLL), 0);
    EXPECT_EQ(bytes_of(m), second);
    ASSERT_EQ(CFE_SB_ReceiveBuffer(&m, b, CFE_SB_PEND_FOREVER), 0);
    EXPECT_EQ(bytes_of(m), first);
    EXPECT_EQ(CFE_SB_ReceiveBuffer(&m, b, 1), CFE_SB_TIME_OUT);
}

// Any mix of sending and receiving over several ids and pipes, against a plain model.
TEST_F(Bus, DeliversWhatAPlainModelDoes)
{
    std::mt19937 random(11);
    ASSERT_EQ(CFE_SB_DeletePipe(event_pipe), 0); // or events fill the room for messages
    struct Model {
        CFE_SB_PipeId_t pipe;
        std::size_t depth;
        std::map<unsigned, unsigned> limits;
        std::deque<Bytes> waiting;
    };
    std::vector<Model> pipes;
    for (int i = 0; i < 3; i++) {
        Model m{pipe(std::uint16_t(3 + 4 * i)), std::size_t(3 + 4 * i), {}, {}};
        for (unsigned mid = 0; mid < 5; mid++) {
            if (random() % 4 != 0) {
                const auto limit = std::uint16_t(1 + random() % 4);
                ASSERT_EQ(CFE_SB_SubscribeEx(id(0x1900 + mid), m.pipe, CFE_SB_Qos_t{}, limit), 0);
                m.limits[0x1900 + mid] = limit;
            }
        }
        pipes.push_back(std::move(m));
    }
    std::uint32_t overflow = 0, full = 0;
    for (int step = 0; step < 5000; step++) {
        if (random() % 2 != 0) {
            const unsigned mid = 0x1900 + random() % 5;
            const Bytes p = command(mid, step % 128, Bytes(random() % 20, std::uint8_t(step)));
            ASSERT_TRUE(ingest(p));
            for (auto &m : pipes) {
                const auto limit = m.limits.find(mid);
                if (limit == m.limits.end()) {
                    continue;
                }
                unsigned same = 0;
                for (const auto &w : m.waiting) {
                    same += unsigned(w[0] << 8 | w[1]) == mid;
                }
                if (same >= limit->second) {
                    overflow++;
                } else if (m.waiting.size() == m.depth) {
                    full++;
                } else {
                    m.waiting.push_back(p);
                }
            }
        } else {
            auto &m = pipes[random() % pipes.size()];
            CFE_SB_Buffer_t *b;
            const auto status = CFE_SB_ReceiveBuffer(&b, m.pipe, CFE_SB_POLL);
            if (m.waiting.empty()) {
                ASSERT_EQ(status, CFE_SB_NO_MESSAGE);
            } else {
                ASSERT_EQ(status, 0);
                ASSERT_EQ(bytes_of(b), m.waiting.front());
                m.waiting.pop_front();
            }
        }
    }
    EXPECT_GT(overflow, 100u);
    EXPECT_GT(full, 100u);
    EXPECT_EQ(pocket_counts().pipe_full, full);
    EXPECT_EQ(pocket_counts().overflow, overflow);
    EXPECT_EQ(pocket_counts().no_buffer, 0u);
}

TEST_F(Bus, MessagesBeyondTheLimitOfAnIdAreLostWithAnEvent)
{
    const auto p = pipe(10, "narrow");
    ASSERT_EQ(CFE_SB_Subscribe(id(0x18c0), p), 0);
    for (int i = 0; i < 6; i++) {
        EXPECT_TRUE(ingest(command(0x18c0, unsigned(i))));
    }
    EXPECT_EQ(pocket_counts().overflow, 2u);
    for (int i = 0; i < 2; i++) {
        const Event e = event("CFE_SB", 0);
        EXPECT_EQ(e.id, 17u);
        EXPECT_EQ(e.type, unsigned(CFE_EVS_EventType_ERROR));
        EXPECT_EQ(e.text, "Message 0x18C0 lost: too many of them wait in pipe narrow");
    }
    CFE_SB_Buffer_t *m;
    for (int i = 0; i < 4; i++) {
        ASSERT_EQ(CFE_SB_ReceiveBuffer(&m, p, CFE_SB_POLL), 0);
        EXPECT_EQ(bytes_of(m)[6], i);
    }
    EXPECT_EQ(CFE_SB_ReceiveBuffer(&m, p, CFE_SB_POLL), CFE_SB_NO_MESSAGE);
}

TEST_F(Bus, ABadCommandIsDeliveredWithAnEvent)
{
    const auto p = pipe(10);
    ASSERT_EQ(CFE_SB_Subscribe(id(0x18c0), p), 0);
    Bytes bad = command(0x18c0, 1);
    bad[7] ^= 1;
    EXPECT_TRUE(ingest(bad));
    EXPECT_EQ(event("CFE_SB", 0).text, "Command 0x18C0 has a wrong checksum");
    Bytes brief = command(0x18c0, 1);
    brief[5] = 0;
    brief.pop_back();
    EXPECT_TRUE(ingest(brief));
    EXPECT_EQ(event("CFE_SB", 0).text, "Command 0x18C0 of 7 bytes is shorter than its header");
    CFE_SB_Buffer_t *m; // both come to the app, as with the real one
    ASSERT_EQ(CFE_SB_ReceiveBuffer(&m, p, CFE_SB_POLL), 0);
    ASSERT_EQ(CFE_SB_ReceiveBuffer(&m, p, CFE_SB_POLL), 0);
    EXPECT_EQ(pocket_counts().bad_checksum, 1u);
    EXPECT_EQ(pocket_counts().short_command, 1u);
}

TEST_F(Bus, WhatIsNoPacketIsRefused)
{
    Bytes p = command(0x18c0, 1);
    for (std::size_t n = 0; n < p.size(); n++) {
        EXPECT_FALSE(pocket_ingest(p.data(), n));
    }
    p.push_back(0);
    EXPECT_FALSE(ingest(p));
    EXPECT_FALSE(ingest(Bytes(5000, 0x18)));
    EXPECT_FALSE(ingest({0, 0, 0xc0, 0, 0, 0, 0})); // id 0 is none
    EXPECT_EQ(pocket_counts().no_packet, 11u);
}

TEST_F(Bus, NoBytesFromOutsideDoHarm)
{
    std::mt19937 random(23);
    CFE_TBL_Handle_t table;
    ASSERT_EQ(CFE_TBL_Register(&table, "T", 16, CFE_TBL_OPT_DEFAULT, nullptr), 0);
    const auto p = pipe(8);
    for (const unsigned mid : {0x1801u, 0x0801u, 0x1804u}) {
        ASSERT_EQ(CFE_SB_Subscribe(id(mid), p), 0);
    }
    std::uint32_t refused = 0;
    for (int n = 0; n < 20000; n++) {
        Bytes b(random() % 100);
        for (auto &byte : b) {
            byte = std::uint8_t(random());
        }
        if (b.size() > 8 && random() % 4 != 0) { // most have the form of packets
            b.resize(random() % 4 != 0 ? b.size() : 8);
            const unsigned mids[] = {0x1801, 0x0801, 0x1804, 0x1804};
            const unsigned mid = mids[random() % 4];
            b[0] = std::uint8_t(mid >> 8);
            b[1] = std::uint8_t(mid);
            b[4] = 0;
            b[5] = std::uint8_t(b.size() - 7);
            b[6] = std::uint8_t(random() % 4 * 2); // none that resets the counters
            if (random() % 2 != 0) {
                const auto *m = reinterpret_cast<const CFE_MSG_Message_t *>(b.data());
                CFE_MSG_GenerateChecksum(const_cast<CFE_MSG_Message_t *>(m));
            }
        }
        refused += !ingest(b);
        CFE_SB_Buffer_t *m;
        while (CFE_SB_ReceiveBuffer(&m, p, CFE_SB_POLL) == CFE_SUCCESS) {
            (void)bytes_of(m);
        }
        while (event("NO_APP", 0).id != 0) {
        }
        (void)CFE_TBL_Manage(table);
    }
    const auto counts = pocket_counts();
    EXPECT_EQ(counts.no_packet, refused);
    EXPECT_GT(counts.bad_checksum, 100u);
    EXPECT_GT(counts.table_commands, 100u); // no operations
    EXPECT_GT(counts.table_errors, 100u);
    EXPECT_EQ(counts.overflow + counts.pipe_full + counts.no_buffer, 0u);
}

TEST_F(Bus, SequencesCountPerIdAndWrap)
{
    const auto p = pipe(4);
    ASSERT_EQ(CFE_SB_Subscribe(id(0x0801), p), 0);
    struct {
        CFE_MSG_TelemetryHeader_t header;
        double value;
    } m;
    ASSERT_EQ(CFE_MSG_Init(&m.header.Msg, id(0x0801), sizeof m), 0);
    CFE_SB_Buffer_t *b;
    for (unsigned i = 1; i < 0x4003; i++) {
        ASSERT_EQ(CFE_SB_TransmitMsg(&m.header.Msg, true), 0);
        ASSERT_EQ(CFE_SB_ReceiveBuffer(&b, p, CFE_SB_POLL), 0);
        CFE_MSG_SequenceCount_t n;
        ASSERT_EQ(CFE_MSG_GetSequenceCount(&b->Msg, &n), 0);
        ASSERT_EQ(n, i & 0x3fff);
    }
}

TEST_F(Bus, TheBusWritesTheTimeOfWhatItNumbers)
{
    const auto p = pipe(4);
    ASSERT_EQ(CFE_SB_Subscribe(id(0x0801), p), 0);
    CFE_MSG_TelemetryHeader_t m;
    ASSERT_EQ(CFE_MSG_Init(&m.Msg, id(0x0801), sizeof m), 0);
    ASSERT_EQ(CFE_MSG_SetMsgTime(&m.Msg, {0x01020304, 0}), 0);
    for (const bool origination : {true, false}) {
        CFE_SB_Buffer_t *b;
        CFE_TIME_SysTime_t t;
        ASSERT_EQ(CFE_SB_TransmitMsg(&m.Msg, origination), 0);
        ASSERT_EQ(CFE_SB_ReceiveBuffer(&b, p, CFE_SB_POLL), 0);
        ASSERT_EQ(CFE_MSG_GetMsgTime(&b->Msg, &t), 0);
        EXPECT_EQ(t.Seconds == 0x01020304u, !origination);
    }
}

TEST_F(Bus, UnreadMessagesExhaustTheBuffersUntilTheyAreRead)
{
    std::vector<CFE_SB_PipeId_t> pipes;
    for (int i = 0; i < 3; i++) {
        pipes.push_back(pipe(60));
        ASSERT_EQ(CFE_SB_SubscribeEx(id(unsigned(0x1900 + i)), pipes.back(), CFE_SB_Qos_t{}, 60), 0);
    }
    for (int i = 0; i < 120; i++) {
        (void)ingest(command(unsigned(0x1900 + i % 3), 0));
    }
    EXPECT_GT(pocket_counts().no_buffer, 0u);
    for (const auto p : pipes) {
        EXPECT_EQ(CFE_SB_DeletePipe(p), 0);
        EXPECT_EQ(CFE_SB_DeletePipe(p), CFE_SB_BAD_ARGUMENT); // not taken for its successor
    }
    while (event("CFE_SB", 0).id != 0) {
    }
    const auto p = pipe(1);
    ASSERT_EQ(CFE_SB_Subscribe(id(0x1900), p), 0);
    CFE_SB_Buffer_t *b;
    for (int i = 0; i < 200; i++) {
        ASSERT_TRUE(ingest(command(0x1900, 0)));
        ASSERT_EQ(CFE_SB_ReceiveBuffer(&b, p, CFE_SB_POLL), 0);
    }
}

TEST_F(Bus, AFilterPassesEventsByItsMask)
{
    const CFE_EVS_BinFilter_t filters[] = {{1, CFE_EVS_FIRST_TWO_STOP}, {2, CFE_EVS_EVERY_OTHER_ONE}};
    ASSERT_EQ(CFE_EVS_Register(filters, 2, CFE_EVS_EventFilter_BINARY), 0);
    const auto before = pocket_counts();
    for (int i = 0; i < 6; i++) {
        for (const std::uint16_t n : {std::uint16_t(1), std::uint16_t(2), std::uint16_t(3)}) {
            EXPECT_EQ(CFE_EVS_SendEvent(n, CFE_EVS_EventType_INFORMATION, "%d", i), 0);
        }
    }
    EXPECT_EQ(pocket_counts().events - before.events, 2u + 3u + 6u);
    EXPECT_EQ(pocket_counts().filtered - before.filtered, 4u + 3u);
    EXPECT_EQ(CFE_EVS_ResetAllFilters(), 0);
    EXPECT_EQ(CFE_EVS_SendEvent(1, CFE_EVS_EventType_INFORMATION, "again"), 0);
    EXPECT_EQ(pocket_counts().filtered - before.filtered, 7u);
}

TEST_F(Bus, ALongEventIsCut)
{
    const std::string words(300, 'x');
    ASSERT_EQ(CFE_EVS_SendEvent(9, CFE_EVS_EventType_CRITICAL, "%s", words.c_str()), 0);
    const Event e = event("HOST");
    EXPECT_EQ(e.text, std::string(120, 'x') + "$");
    EXPECT_EQ(e.id, 9u);
    EXPECT_EQ(e.type, 4u);
}

TEST_F(Bus, TimesAddAndCompareAcrossTheirEnd)
{
    std::mt19937_64 random(3);
    const auto whole = [](CFE_TIME_SysTime_t t) { return std::uint64_t(t.Seconds) << 32 | t.Subseconds; };
    for (int i = 0; i < 1000; i++) {
        const std::uint64_t a = random(), b = random();
        const CFE_TIME_SysTime_t A{std::uint32_t(a >> 32), std::uint32_t(a)};
        const CFE_TIME_SysTime_t B{std::uint32_t(b >> 32), std::uint32_t(b)};
        EXPECT_EQ(whole(CFE_TIME_Add(A, B)), a + b);
        EXPECT_EQ(whole(CFE_TIME_Subtract(A, B)), a - b);
        EXPECT_EQ(CFE_TIME_Compare(A, B), std::int64_t(a - b) > 0 ? CFE_TIME_A_GT_B : CFE_TIME_A_LT_B);
        EXPECT_EQ(CFE_TIME_Compare(A, A), CFE_TIME_EQUAL);
        const auto micro = std::uint32_t(random() % 1000000);
        EXPECT_EQ(CFE_TIME_Sub2MicroSecs(CFE_TIME_Micro2SubSecs(micro)), micro);
    }
}

TEST_F(Bus, ArgumentsThatAreNoneAreRefused)
{
    CFE_SB_PipeId_t p;
    CFE_SB_Buffer_t *b;
    EXPECT_EQ(CFE_SB_CreatePipe(nullptr, 4, "x"), CFE_SB_BAD_ARGUMENT);
    EXPECT_EQ(CFE_SB_CreatePipe(&p, 0, "x"), CFE_SB_BAD_ARGUMENT);
    EXPECT_EQ(CFE_SB_CreatePipe(&p, 4, "a name that is longer than it may be"), CFE_SB_BAD_ARGUMENT);
    EXPECT_EQ(CFE_SB_Subscribe(id(0x18c0), CFE_SB_PipeId_t{0}), CFE_SB_BAD_ARGUMENT);
    EXPECT_EQ(CFE_SB_Subscribe(id(0x2000), pipe(4)), CFE_SB_BAD_ARGUMENT);
    EXPECT_EQ(CFE_SB_ReceiveBuffer(nullptr, p, 0), CFE_SB_BAD_ARGUMENT);
    EXPECT_EQ(CFE_SB_ReceiveBuffer(&b, CFE_SB_PipeId_t{77}, 0), CFE_SB_BAD_ARGUMENT);
    EXPECT_EQ(CFE_SB_TransmitMsg(nullptr, true), CFE_SB_BAD_ARGUMENT);
    EXPECT_EQ(CFE_EVS_SendEvent(1, 9, "x"), CFE_EVS_INVALID_PARAMETER);
    for (int i = 0; i < 100; i++) {
        if (CFE_SB_CreatePipe(&p, 4, "x") == CFE_SB_MAX_PIPES_MET) {
            return;
        }
    }
    FAIL() << "pipes have no end";
}

} // namespace bus_test
