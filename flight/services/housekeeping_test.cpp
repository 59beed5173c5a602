// SPDX-License-Identifier: Apache-2.0
// Reports of chosen numbers: their packets byte for byte, and when they are sent.
#include "flight/services/testing/flight_software.h"

extern "C" {
#include "ccsds/bytes.h"
#include "flight/services/housekeeping.h"
}

#include <gtest/gtest.h>

#include <cstddef>
#include <cstring>
#include <string>
#include <vector>

namespace housekeeping_test {

using namespace service_testing;

struct Output {
    Head head;
    double x[3];
    int32_t mode;
    uint16_t word;
    uint8_t small[2];
};

struct Mission {
    Housekeeping housekeeping;
    Output output;
    double large[80];
};

const CommandService *const kinds[] = {&housekeeping_service};
const CommandServices services = command_services(
    kinds, 1, [](void *m, uint32_t) -> void * { return &static_cast<Mission *>(m)->housekeeping; },
    [](const void *m, uint16_t place, uint32_t *size) -> const void * {
        const auto &mission = *static_cast<const Mission *>(m);
        *size = place == 2 ? sizeof mission.output : sizeof mission.large;
        return place == 2 ? static_cast<const void *>(&mission.output) : mission.large;
    });

class Reports : public testing::Test {
protected:
    Reports()
    {
        table_.n_outputs = 3;
        housekeeping_reset(&mission_.housekeeping);
    }

    HousekeepingReport &report(int i) { return mission_.housekeeping.par.reports[i]; }

    void choose(int i, uint32_t output, std::size_t offset, FledgeType type, uint32_t n)
    {
        report(i).choices[report(i).n++] = {static_cast<uint16_t>(output), static_cast<uint16_t>(offset),
                                            static_cast<uint16_t>(type), static_cast<uint16_t>(n)};
        report(i).on = 1;
    }

    /// An instant with an update; returns the reports that are sent.
    std::string at(int64_t t)
    {
        housekeeping_update(&mission_.housekeeping, {t, 0});
        contents_.clear();
        const CommandContext context{&state_, &table_, &mission_, t, 0};
        std::string sent;
        uint8_t content[COMMAND_DATA_MAX];
        while (const uint32_t n = housekeeping_service.telemetry(&context, &mission_.housekeeping, content)) {
            EXPECT_EQ(ccsds_get64(content), static_cast<uint64_t>(t));
            sent += std::to_string(content[9]);
            contents_.emplace_back(content, content + n);
        }
        return sent;
    }

    CommandTable table_ = command_table(&services, nullptr, 0);
    CommandState state_{};
    Mission mission_{};
    std::vector<Bytes> contents_;
};

TEST_F(Reports, NumbersAreBigEndianInTheirOwnTypes)
{
    mission_.output = {{0x0102030405060708, QUALITY_GOOD, 3}, {1.0, -2.0, 0.0}, -2, 0xABCD, {7, 8}};
    choose(5, 2, offsetof(Output, word), FLEDGE_U16, 1);
    choose(5, 2, offsetof(Output, x), FLEDGE_F64, 2);
    choose(5, 2, offsetof(Output, small), FLEDGE_U8, 2);
    choose(5, 2, offsetof(Output, mode), FLEDGE_I32, 1);
    choose(5, 2, 0, FLEDGE_I64, 1);
    EXPECT_EQ(at(0x1122334455), "5");
    EXPECT_EQ(housekeeping_service.stream, STREAM_SELECTED);
    const Bytes expected{0,    0,    0,    0x11, 0x22, 0x33, 0x44, 0x55, 0, 5, 0,    0, 0, 0, 0, 32,
                         0xAB, 0xCD, 0x3F, 0xF0, 0,    0,    0,    0,    0, 0, 0xC0, 0, 0, 0, 0, 0,
                         0,    0,    7,    8,    0xFF, 0xFF, 0xFF, 0xFE, 1, 2, 3,    4, 5, 6, 7, 8};
    const Bytes choices{0, 2, 0, 44, 0, 5, 0, 1,  0, 2, 0, 16, 0, 0, 0, 2, 0, 2, 0, 46,
                        0, 3, 0, 2,  0, 2, 0, 40, 0, 6, 0, 1,  0, 2, 0, 0, 0, 8, 0, 1};
    Bytes found = contents_.front();
    EXPECT_EQ(ccsds_get16(&found[10]), ccsds_crc16(choices.data(), static_cast<uint32_t>(choices.size())));
    found[10] = found[11] = 0;
    EXPECT_EQ(found, expected);
}

TEST_F(Reports, AReportIsSentWhenItIsTurnedOnAndAtEachPeriod)
{
    choose(0, 2, 16, FLEDGE_F64, 1);
    choose(3, 2, 16, FLEDGE_F64, 1);
    report(0).period = 25;
    std::string sent;
    for (int64_t t = 10; t <= 100; t += 10) {
        sent += at(t) + " ";
    }
    EXPECT_EQ(sent, "03 3 03 3 03 3 3 03 3 03 "); // 10, then from 25, 50, 75 and 100 on
    report(3).on = 0;
    EXPECT_EQ(at(110), "");
    EXPECT_EQ(mission_.housekeeping.out.state.on, 1u);
    report(3).on = 1;
    EXPECT_EQ(at(120), "3");
    EXPECT_EQ(at(130), "03");
    EXPECT_EQ(mission_.housekeeping.out.state.sent, 16u);
    housekeeping_reset(&mission_.housekeeping);
    EXPECT_EQ(at(135), "03"); // the reports are parameters
    EXPECT_EQ(at(140), "3");
    report(0).period = 1000;
    EXPECT_EQ(at(145), "03"); // another period
    EXPECT_EQ(at(149), "3");
}

TEST_F(Reports, AChoiceThatNamesNoNumberIsLeftOutAndReported)
{
    mission_.output.word = 0x1234;
    choose(1, 3, 0, FLEDGE_F64, 1); // no such output
    choose(1, 2, offsetof(Output, word), FLEDGE_U16, 1);
    choose(1, 2, sizeof(Output) - 4, FLEDGE_F64, 1); // beyond its end
    choose(1, 2, 16, FLEDGE_CHAR, 1);                // a letter
    choose(1, 2, 16, static_cast<FledgeType>(99), 1);
    choose(1, 2, 16, FLEDGE_F64, 0);
    choose(1, 1, 0, FLEDGE_F64, 62); // 496 bytes: there is room for 494
    choose(1, 1, 0, FLEDGE_F64, 61);
    at(10);
    EXPECT_EQ(contents_.front().size(), 16u + 2u + 488u);
    EXPECT_EQ(ccsds_get16(&contents_.front()[12]), 0x7Du);
    EXPECT_EQ(ccsds_get16(&contents_.front()[16]), 0x1234u);
    report(1).n = 0xFFFF; // damaged
    at(20);
    EXPECT_EQ(mission_.housekeeping.out.state.bad, 2u);
    EXPECT_EQ(mission_.housekeeping.out.state.head.quality, QUALITY_DEGRADED);
    choose(0, 3, 0, FLEDGE_F64, 1);
    at(30);
    at(40);
    EXPECT_EQ(mission_.housekeeping.out.state.bad, 3u);
    report(0).choices[0] = {1, 0, FLEDGE_F64, 62}; // there is just room
    at(50);
    EXPECT_EQ(contents_.front().size(), static_cast<std::size_t>(COMMAND_DATA_MAX));
    at(60);
    EXPECT_EQ(mission_.housekeeping.out.state.bad, 2u);
    report(1).on = 0;
    at(70);
    EXPECT_EQ(mission_.housekeeping.out.state.bad, 0u);
    EXPECT_EQ(mission_.housekeeping.out.state.head.quality, QUALITY_GOOD);
}

} // namespace housekeeping_test
