// SPDX-License-Identifier: Apache-2.0
#include "cosim/protocol/testing/frames.h"
#include "tests/error_of.h"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>

namespace fledge::cosim {
namespace protocol_test {

using namespace testing;

std::string why(std::span<const std::byte> bytes, const Limits &limits = {})
{
    return error_of<ProtocolError>([&] { decode(bytes, limits); });
}

TEST(Protocol, EveryMessageIsReadAsItWasWrittenInBothByteOrders)
{
    const auto frames = one_of_each();
    ASSERT_EQ(frames.size(), std::variant_size_v<Message>);
    for (std::size_t i = 0; i < frames.size(); i++) {
        EXPECT_EQ(frames[i].message.index(), i);
        for (const Order order : {Order::little, Order::big}) {
            EXPECT_EQ(decode(encode(frames[i], order)), frames[i]) << kind_name(frames[i].message);
        }
    }
}

TEST(Protocol, AFrameHasTheDocumentedLayout)
{
    const Bytes b = encode({258, Tock{1, 2, {{5, 6, 3, make_payload(filled(8))}}, true}}, Order::big);
    const unsigned char expected[] = {
        'F', 'L', 'C', 'S', 0, 1, 0, 13, 0, 0, 0, 56, 0, 0, 0, 0, 0, 0, 1, 2, 0, 0, 0, 0, // header, crc left out
        0,   0,   0,   0,   0, 0, 0, 1,  0, 0, 0, 0,  0, 0, 0, 2,                         // reached, compute
        1,   0,   0,   0,   0, 0, 0, 1,  0, 0, 0, 0,  0, 0, 0, 3,                         // leaving; one record; its t
        0,   0,   0,   5,   0, 0, 0, 6,  0, 0, 0, 12};                                    // channel, count, length
    ASSERT_EQ(b.size(), frame_header_size + 56);
    for (std::size_t i = 0; i < sizeof expected; i++) {
        if (i < 12 || i >= 16) {
            EXPECT_EQ(std::to_integer<int>(b[i]), expected[i]) << "byte " << i;
        }
    }
    // The struct begins at a multiple of 8, behind the CDR header.
    EXPECT_EQ(std::to_integer<int>(b[frame_header_size + 48]), 1);
}

TEST(Protocol, DecodeRefusesEveryTruncationAndEveryFlippedBit)
{
    for (const Frame &frame : one_of_each()) {
        const Bytes whole = encode(frame);
        for (std::size_t n = 0; n < whole.size(); n++) {
            EXPECT_NE(why({whole.data(), n}), "") << kind_name(frame.message) << " cut to " << n;
        }
        for (std::size_t bit = 0; bit < 8 * whole.size(); bit++) {
            if (bit / 8 >= 16 && bit / 8 < 20) {
                continue; // the number may be any
            }
            Bytes turned = whole;
            turned[bit / 8] ^= static_cast<std::byte>(1 << bit % 8);
            // A changed kind may be that of a message with the same body; decode() refuses all else.
            if (bit / 8 != 6 && bit / 8 != 7) {
                EXPECT_NE(why(turned), "") << kind_name(frame.message) << " bit " << bit;
            }
        }
    }
}

TEST(Protocol, EachMessageHasOneEncoding)
{
    // Change bodies at random: each frame that decode() accepts is encoded as the same bytes.
    std::mt19937 random(4);
    std::size_t read = 0, refused = 0;
    const auto frames = one_of_each();
    for (int i = 0; i < 200'000; i++) {
        Bytes b = encode(frames[random() % frames.size()]);
        change(b, random);
        try {
            const Frame frame = decode(b);
            EXPECT_EQ(encode(frame), b);
            read++;
        } catch (const ProtocolError &) {
            refused++;
        }
    }
    EXPECT_GT(read, 10'000u);
    EXPECT_GT(refused, 10'000u);
}

TEST(Protocol, AnErrorNamesTheByteAndTheReason)
{
    Bytes b = encode({1, Hello{1, 1, "spin", "flight"}});
    EXPECT_EQ(why({}), "this is no frame of a co-simulation");
    b[5] = std::byte{9};
    EXPECT_EQ(why(b), "version 9 of the format, while this program speaks version 1");
    b[5] = std::byte{1};
    b.back() = std::byte{0};
    EXPECT_EQ(why(b), "the checksum of the body is wrong");
    seal(b);
    EXPECT_EQ(why(b), "Hello: byte 22 of the body: node holds the control character U+0000");
    b.push_back(std::byte{1});
    EXPECT_EQ(why(b), "a body of 23 bytes, while the header says 22");
    Limits limits;
    limits.name = 5;
    EXPECT_EQ(why(encode({1, Hello{1, 1, "spin", "flight"}}), limits),
              "Hello: byte 16 of the body: node has 6 bytes; 5 are the most");
    limits.frame = 40;
    EXPECT_EQ(why(encode({1, Hello{1, 1, "spin", "flight"}}), limits), "a frame of 46 bytes; 40 are the most");
    Bytes wrong = encode({1, Desired{{{"/a", Latency::same_instant, false, {}}}}});
    wrong[frame_header_size + 10] = std::byte{7};
    seal(wrong);
    EXPECT_EQ(why(wrong), "Desired: byte 11 of the body: there is no latency 7");
    wrong = encode({1, Hello{1, 1, "spin", "flight"}});
    wrong[frame_header_size + 2] = std::byte{2};
    seal(wrong);
    EXPECT_EQ(why(wrong), "Hello: byte 3 of the body: there is no role 2");
}

/// Each text that a frame may carry, by the name of its field: one frame of each kind with `text` in that field.
std::vector<std::pair<std::string, Frame>> frames_with(const std::string &text)
{
    const Schema plain = error_schema(), named{text, plain.text, plain.size, plain.hash};
    const Schema defined{"A", text, plain.size, plain.hash};
    const Record record{1, 1, 1, {}};
    return {{"simulation", {1, Hello{1, 1, text, "a"}}},
            {"node", {1, Hello{1, 1, "a", text}}},
            {"address", {1, Welcome{text, "", 0}}},
            {"shared", {1, Welcome{"", text, 0}}},
            {"frontend", {1, Initialize{0, 0, -1, text, "", {}}}},
            {"backend", {1, Initialize{0, 0, -1, "", text, {}}}},
            {"topic", {1, Desired{{{text, Latency::same_instant, false, {}}}}}},
            {"type", {1, Desired{{{"/a", Latency::same_instant, false, named}}}}},
            {"definition", {1, Desired{{{"/a", Latency::same_instant, false, defined}}}}},
            {"topic", {1, Match{{{0, text, plain}}}}},
            {"type", {1, Matched{{{0, named, {}}}}}},
            {"topic", {1, Start{{{0, text, plain}}}}},
            {"frontend", {1, Attached{text, "", {}}}},
            {"backend", {1, Attached{"", text, {}}}},
            {"node", {1, Published{record, text}}}};
}

TEST(Protocol, ATextIsUtf8WithoutControlCharactersInEveryField)
{
    const std::pair<std::string, std::string> bad[] = {
        {"a\xff", "is not UTF-8"},
        {"\x1b[2J\xc3", "is not UTF-8"},
        {"\xc0\xaf", "is not UTF-8"},         // a slash in two bytes
        {"\xed\xa0\x80", "is not UTF-8"},     // half of a pair of UTF-16
        {"\xf4\x90\x80\x80", "is not UTF-8"}, // beyond the last character
        {std::string("a\0b", 3), "holds the control character U+0000"},
        {"a\rb", "holds the control character U+000D"},
        {"\x1b]0;title\x07", "holds the control character U+001B"},
        {"\x7f", "holds the control character U+007F"},
        {"\xc2\x9b"
         "2J",
         "holds the control character U+009B"}, // CSI in one character
        {"\xe2\x80\xae"
         "cba",
         "holds the control character U+202E"}};
    for (const auto &[text, fault] : bad) {
        for (const auto &[field, frame] : frames_with(text)) {
            const std::string found = why(encode(frame));
            EXPECT_TRUE(found.ends_with("of the body: " + field + " " + fault)) << found;
        }
    }
    for (const auto &[field, frame] : frames_with("two\n\tlines")) {
        EXPECT_EQ(why(encode(frame)).empty(), field == "definition") << field;
    }
    for (const auto &[field, frame] : frames_with("sat\xc3\xa9lite \xf0\x9f\x9b\xb0")) {
        EXPECT_EQ(why(encode(frame)), "") << field;
    }
    for (const auto &[field, frame] : frames_with(std::string(256, 'a'))) {
        EXPECT_EQ(why(encode(frame)).find(field + " has 256 bytes; 255 are the most") != std::string::npos,
                  field != "definition");
    }
}

TEST(Protocol, AReasonIsCleanedWhereItIsWritten)
{
    const std::string text = "\x1b[2Ja\xff"
                             "b\n\tc\xc2\x9b",
                      clean = "?[2Ja?b\n\tc?";
    EXPECT_EQ(std::get<Failed>(decode(encode({1, Failed{text}})).message).reason, clean);
    EXPECT_EQ(std::get<Refused>(decode(encode({1, Refused{text}})).message).reason, clean);
    EXPECT_EQ(std::get<Finish>(decode(encode({1, Finish{text}})).message).reason, clean);
    const std::string longest =
        std::get<Failed>(decode(encode({1, Failed{std::string(2'000'001, 'a')}})).message).reason;
    EXPECT_EQ(longest.size(), Limits{}.text);
    Bytes raw = encode({1, Failed{"abc"}}); // as another program may write it
    raw[frame_header_size + 5] = std::byte{0x1b};
    seal(raw);
    EXPECT_EQ(why(raw), "Failed: byte 7 of the body: reason holds the control character U+001B");
}

TEST(Protocol, TimesAndDurationsHaveTheirRange)
{
    constexpr Ns first = std::numeric_limits<Ns>::min(), last = std::numeric_limits<Ns>::max();
    const auto refused = [](const Message &message, const std::string &field) {
        const std::string found = why(encode({1, message}));
        EXPECT_NE(found.find("of the body: " + field + " is "), std::string::npos) << field << ": " << found;
    };
    for (const Ns t : {first, Ns{-2}, longest_time + 1, last}) {
        refused(Initialize{0, 0, t, "", "", {}}, "start");
        refused(Tick{t, {}}, "until");
        refused(Tick{1, {{0, 1, t, {}}}}, "t");
        refused(Tock{t, 0, {}, false}, "reached");
        refused(Tock{1, 0, {{0, 1, t, {}}}, false}, "t");
        refused(Published{{0, 1, t, {}}, "a"}, "t");
        refused(Save{t}, "time");
    }
    for (const Ns t : {first, Ns{-1}, longest_time + 1, last}) {
        refused(Initialize{0, t, -1, "", "", {}}, "end");
        refused(Initialized{{{t, 0}}, false, false}, "period");
        refused(Initialized{{{1, t}}, false, false}, "offset");
        refused(Tock{1, t, {}, false}, "compute_ns");
    }
    EXPECT_EQ(why(encode({1, Tock{-1, longest_time, {{0, 1, -1, {}}}, false}})), "");
    EXPECT_EQ(why(encode({1, Tock{1, -7, {}, false}})),
              "Tock: byte 16 of the body: compute_ns is -7 ns; expected 0 to 1000000000000000000");
}

TEST(Protocol, AListAllocatesNoMoreMemoryThanItsFrameHas)
{
    Bytes b = encode({1, Match{}});
    const std::uint32_t many = 65536;
    std::memcpy(b.data() + frame_header_size, &many, 4);
    seal(b);
    EXPECT_EQ(why(b), "Match: byte 4 of the body: a list of 65536 items does not fit into what is left");
}

TEST(Protocol, APayloadOfTheOtherByteOrderIsConverted)
{
    struct {
        std::int64_t t = -7;
        std::uint32_t quality = 3, sequence = 9;
        double sigma[3] = {0.1, -0.2, 0.3}, p[9] = {1, 2, 3, 4, 5, 6, 7, 8, 9.5};
        std::int32_t mode = -1;
        float x = 1.25f;
    } sent, got;
    const auto fields = parse_schema(error_text);
    const auto bytes_of = [](auto &s) { return std::as_writable_bytes(std::span(&s, 1)); };
    Bytes payload = make_payload(bytes_of(sent)).copy();
    EXPECT_EQ(payload.size(), 4 + error_schema().size);
    got = {};
    got.x = 0;
    read_payload(payload, fields, bytes_of(got));
    EXPECT_EQ(std::memcmp(&sent, &got, sizeof sent), 0);

    payload[1] ^= std::byte{1};
    const auto number = [&](std::size_t at, std::size_t n) { std::reverse(&payload[4 + at], &payload[4 + at] + n); };
    number(0, 8);
    number(8, 4);
    number(12, 4);
    for (std::size_t i = 0; i < 12; i++) {
        number(16 + 8 * i, 8);
    }
    number(112, 4);
    number(116, 4);
    got.x = 0;
    read_payload(payload, fields, bytes_of(got));
    EXPECT_EQ(std::memcmp(&sent, &got, sizeof sent), 0);

    payload[0] = std::byte{1};
    EXPECT_THROW(read_payload(payload, fields, bytes_of(got)), ProtocolError);
    payload.pop_back();
    EXPECT_THROW(read_payload(payload, fields, bytes_of(got)), ProtocolError);
}

TEST(Schema, ItsTextGivesNamesUnitsAndShapes)
{
    const auto fields = parse_schema(error_text);
    ASSERT_EQ(fields.size(), 7u);
    EXPECT_EQ(fields[0], (SchemaField{"head.t", "int64", "ns", "", 0, 8, 1}));
    EXPECT_EQ(fields[3], (SchemaField{"sigma_BR", "float64", "-", "3", 16, 8, 3}));
    EXPECT_EQ(fields[4], (SchemaField{"P", "float64", "N m s", "3, 3", 40, 8, 9}));
    EXPECT_EQ(fields[6], (SchemaField{"x", "float32", "m", "", 116, 4, 1}));
    EXPECT_EQ(fields[5].choices, "OFF=0, ON=1");
    EXPECT_EQ(error_schema().size, 120u);
}

TEST(Schema, ADifferenceNamesTheField)
{
    const Schema offered = error_schema();
    const auto changed = [&](const std::string &from, const std::string &to) {
        std::string text = error_text;
        const auto at = text.find(from);
        EXPECT_NE(at, std::string::npos);
        return schema_difference(offered, make_schema("AttError", text.replace(at, from.size(), to)));
    };
    EXPECT_EQ(schema_difference(offered, offered), "");
    EXPECT_EQ(schema_difference(offered, {}), "");
    EXPECT_EQ(changed("attitude error", "the same in other words"), "");
    EXPECT_EQ(changed("[m]", "[km]"), "field x is float32 [m] in the publication and float32 [km] in the subscription");
    EXPECT_EQ(changed("float32 x", "uint32 x"),
              "field x is float32 [m] in the publication and uint32 [m] in the subscription");
    EXPECT_EQ(changed("(3, 3)", "(9)"),
              "field P is float64 (3, 3) [N m s] in the publication and float64 (9) [N m s] in the subscription");
    EXPECT_EQ(changed("float32 x  # x [m]\n", ""), "field x is missing in the subscription");
    EXPECT_EQ(changed("float32 x  # x [m]\n", "float32 x  # x [m]\nfloat64 y\n"),
              "field y is missing in the publication");
    EXPECT_EQ(
        changed("int32 mode  # mode {OFF=0, ON=1}\nfloat32 x  # x [m]\n", "float32 x  # x [m]\nint32 mode  # mode\n"),
        "field x is at another place in the publication");
    EXPECT_EQ(schema_difference(offered, make_schema("Other", error_text)),
              "it is a AttError in the publication and a Other in the subscription");
}

TEST(Schema, ItsSizeAndHashAreThoseOfItsText)
{
    Schema schema = error_schema();
    EXPECT_EQ(schema_fault(schema), "");
    EXPECT_EQ(fields_of(schema).size(), 7u);
    schema.size = 4'000'000'000;
    EXPECT_EQ(schema_fault(schema), "its text makes 120 bytes, not 4000000000");
    EXPECT_THROW(fields_of(schema), SchemaError);
    schema = error_schema();
    schema.hash++;
    EXPECT_EQ(schema_fault(schema), "its hash is not that of its text");
    EXPECT_EQ(schema_fault({"A", "", 8, 0}), "it has a size or hash, but no text");
    EXPECT_EQ(schema_fault({"A", "", 0, 0}), "");
}

TEST(Schema, AnErrorNamesTheLine)
{
    const auto refusal = [](const std::string &text) -> std::string {
        return error_of<SchemaError>([&] { parse_schema(text); });
    };
    EXPECT_EQ(refusal(""), "the definition has no fields");
    EXPECT_EQ(refusal("int32 a\nfloat64 b\n"), "line 2: padding would be needed before this field, found \"b\"");
    EXPECT_EQ(refusal("string s\n"), "line 1: this type is not of fixed size or not defined here, found \"string\"");
    EXPECT_EQ(refusal("int32[] a\n"), "line 1: expected an array of fixed size, found \"int32[] a\"");
    EXPECT_EQ(refusal("int32[0] a\n"), "line 1: expected an array of fixed size, found \"int32[0] a\"");
    EXPECT_EQ(refusal("int32 a b\n"), "line 1: expected \"<type> <name>\" of fixed size, found \"int32 a b\"");
    EXPECT_EQ(refusal("int8 a\nint8 a\n"), "line 2: this name is there twice, found \"a\"");
    EXPECT_EQ(refusal("float64[4000000000] a\n"), "line 1: the message is too large, found \"a\"");
    const std::string rule(80, '=');
    EXPECT_EQ(refusal("p/A a\n" + rule + "\nMSG: p/A\np/A a\n"),
              "line 4: types are nested too deeply, or contain themselves, found \"p/A\"");
    EXPECT_EQ(refusal("p/A[4000000000] a\n" + rule + "\nMSG: p/A\n"), "line 1: this type has no fields, found \"p/A\"");
    EXPECT_EQ(refusal("p/A[4000000000] a\n" + rule + "\nMSG: p/A\nint8 x\n"),
              "line 4: the message is too large, found \"a[65536].x\"");
    const std::string nested = "p/A[60000] a\n" + rule + "\nMSG: p/A\n";
    EXPECT_TRUE(
        refusal(nested + "int8 " + std::string(5000, 'x') + "\n").starts_with("line 4: the message is too large"));
    EXPECT_TRUE(refusal(nested + "int8 x  # x [" + std::string(5000, 'm') + "]\n")
                    .starts_with("line 4: the message is too large"));
    EXPECT_TRUE(refusal(nested + "int8 x  # x {" + std::string(5000, 'm') + "}\n")
                    .starts_with("line 4: the message is too large"));
    EXPECT_EQ(refusal(nested + std::string(500'000, '\n') + "int8 x\n"), ""); // blank lines cost nothing
    EXPECT_EQ(refusal(rule + "\nnonsense\n"), "line 2: expected \"MSG: <a new type>\", found \"nonsense\"");
}

TEST(Schema, AnyTextIsParsedOrRefused)
{
    std::mt19937 random(6);
    std::size_t read = 0;
    for (int i = 0; i < 30'000; i++) {
        const std::string text = change(i % 2 ? error_text : rich_text, random);
        try {
            const auto fields = parse_schema(text);
            EXPECT_EQ(fields.front().offset, 0u);
            for (std::size_t k = 1; k < fields.size(); k++) {
                EXPECT_EQ(fields[k].offset, fields[k - 1].offset + fields[k - 1].item * fields[k - 1].count);
            }
            read++;
        } catch (const SchemaError &) {
        }
    }
    EXPECT_GT(read, 1000u);
}

} // namespace protocol_test
} // namespace fledge::cosim
