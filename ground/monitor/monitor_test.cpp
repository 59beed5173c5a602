// SPDX-License-Identifier: Apache-2.0
#include "ground/database/testing/database.h"
#include "ground/monitor/monitor.h"

#include <gtest/gtest.h>

namespace fledge::ground {
namespace monitor_test {

using testing::Bytes;

/// Stores packets as text, and checks what a reader sees.
class Sink final : public PacketSink {
public:
    explicit Sink(const Monitor &monitor) : monitor_(monitor) {}

    void put(const Arrival &arrival, Id container) override
    {
        seen();
        if (full) {
            throw Refusal("the disk is full");
        }
        text += std::to_string(arrival.bytes[0]) + (container == no_id ? "? " : " ");
    }

    void save() override
    {
        seen();
        if (full) {
            throw Refusal("nothing is saved");
        }
        text += "saved ";
    }

    void seen()
    {
        const auto newest = monitor_.newest(0);
        shown += (newest ? std::to_string(newest->newest.value) : "-") + " ";
    }

    bool full = false;
    std::string text, shown;

private:
    const Monitor &monitor_;
};

const Database &database()
{
    static const Database result =
        read_xtce_text(testing::file(testing::integer("u8", 8), "x:u8 y:u8", testing::container("P", "x y")), "s.xml");
    return result;
}

std::string summary(const std::vector<Note> &notes)
{
    std::string all;
    for (const Note &note : notes) {
        all += note.kind == Note::Kind::archive     ? "archive: " + note.text
               : note.kind == Note::Kind::undecoded ? "undecoded: " + note.text
                                                    : "other";
    }
    return all;
}

std::vector<Note> take(Monitor &monitor, const std::vector<Bytes> &packets)
{
    std::vector<Arrival> batch;
    for (const Bytes &packet : packets) {
        batch.push_back({1, 2, packet});
    }
    return monitor.take(batch);
}

TEST(Monitor, ABatchIsSavedBeforeItIsShown)
{
    Monitor monitor(database());
    Sink sink(monitor);
    monitor.sink(&sink);
    EXPECT_EQ(summary(take(monitor, {{1, 1}, {2, 2}, {3}})), "undecoded: the packet ends within y");
    EXPECT_EQ(sink.text, "1 2 3? saved ");
    EXPECT_EQ(summary(take(monitor, {{4, 4}})), "");
    EXPECT_EQ(sink.shown, "- - - - 2 2 ");
    EXPECT_EQ(monitor.newest(0)->newest.value, 4U);
}

TEST(Monitor, AFailingArchiveIsReportedOnceAndTelemetryGoesOn)
{
    Monitor monitor(database());
    Sink sink(monitor);
    monitor.sink(&sink);
    sink.full = true;
    EXPECT_EQ(summary(take(monitor, {{1, 1}, {2, 2}})), "archive: the disk is full");
    EXPECT_EQ(summary(take(monitor, {{3, 3}})), "");
    EXPECT_EQ(monitor.newest(1)->newest.value, 3U);
    sink.full = false;
    EXPECT_EQ(summary(take(monitor, {{4, 4}})), "archive: ");
    EXPECT_EQ(sink.text, "4 saved ");
    monitor.sink(nullptr);
    EXPECT_EQ(summary(take(monitor, {{5, 5}})), "");
    EXPECT_EQ(monitor.newest(0)->newest.count, 5U);
}

TEST(Monitor, RowsThatAreNotCollectedAreDroppedWithANote)
{
    Monitor monitor(database());
    const std::uint32_t trigger = monitor.trigger(std::vector<std::uint32_t>(1000, 0));
    std::string notes;
    for (int i = 0; i < 5000; i++) {
        for (const Note &note : take(monitor, {{1, 1}})) {
            notes += note.text;
        }
    }
    EXPECT_EQ(notes, "rows of derived parameters were not collected in time");
    EXPECT_LT(monitor.rows(trigger).size(), std::size_t(1) << 23);
}

TEST(Slots, NamesAreTheAliasOrTheOnlyNameOrThePath)
{
    const Database result = read_xtce_text(
        "<SpaceSystem name='S'><TelemetryMetaData><ParameterTypeSet>" + testing::integer("u8", 8) +
            "<AggregateParameterType name='g'><MemberList><Member name='m' typeRef='u8'/></MemberList>"
            "</AggregateParameterType><ArrayParameterType name='l' arrayTypeRef='g'><DimensionList><Dimension>"
            "<StartingIndex><FixedValue>0</FixedValue></StartingIndex><EndingIndex><FixedValue>1</FixedValue>"
            "</EndingIndex></Dimension></DimensionList></ArrayParameterType></ParameterTypeSet><ParameterSet>"
            "<Parameter name='a' parameterTypeRef='l'><AliasSet><Alias nameSpace='Fledge' alias='flight.a'/></AliasSet>"
            "</Parameter><Parameter name='b' parameterTypeRef='u8'/><Parameter name='unused' parameterTypeRef='u8'/>"
            "</ParameterSet><ContainerSet>" +
            testing::container("P", "a b") +
            "</ContainerSet></TelemetryMetaData><SpaceSystem name='T'><TelemetryMetaData><ParameterSet><Parameter "
            "name='b' parameterTypeRef='u8'/></ParameterSet><ContainerSet>" +
            testing::container("Q", "b") + "</ContainerSet></TelemetryMetaData></SpaceSystem></SpaceSystem>",
        "s.xml");
    const Slots slots(result);
    std::string all;
    for (const Slot &slot : slots.all()) {
        all += slot.name + " ";
        EXPECT_EQ(slots.find(slot.path), slots.find(slot.name));
    }
    EXPECT_EQ(all, "flight.a[0].m flight.a[1].m /S/b /S/T/b ");
    EXPECT_EQ(slots.find("unused"), no_id);
}

/// A text whose encoding is a number is a number: there are no bytes to show.
TEST(Slots, ATextThatIsEncodedAsANumberHasItsNumber)
{
    const Database result =
        read_xtce_text(testing::file("<StringParameterType name='t'><IntegerDataEncoding sizeInBits='32'/>"
                                     "</StringParameterType><BinaryParameterType name='b'><FloatDataEncoding "
                                     "sizeInBits='32'/></BinaryParameterType>",
                                     "x:t y:b", testing::container("P", "x y")),
                       "s.xml");
    Monitor monitor(result);
    EXPECT_EQ(summary(take(monitor, {Bytes(8, 0xFF)})), "");
    EXPECT_EQ(monitor.slots(0)[0].slot.kind, Kind::natural);
    EXPECT_EQ(monitor.slots(0)[1].slot.kind, Kind::real);
    EXPECT_EQ(monitor.newest(0)->newest.value, 0xFFFFFFFFU);
    EXPECT_EQ(monitor.changes(0, {}).bytes.size(), 32U + 2 * 24);
}

} // namespace monitor_test
} // namespace fledge::ground
