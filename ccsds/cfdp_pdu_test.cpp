// SPDX-License-Identifier: Apache-2.0
// PDUs of CFDP: bytes worked by hand from the standard's tables, random ones both ways, damaged ones, and what
// Wireshark reads in them.
#include "ccsds/cfdp_pdu.h"
#include "ccsds/space_packet.h"
#include "ccsds/testing/bits.h"
#include "ccsds/testing/tshark.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <sstream>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

namespace cfdp_pdu_test {

using namespace ccsds::testing;

CfdpText text(std::string_view of)
{
    return {reinterpret_cast<const std::uint8_t *>(of.data()), static_cast<std::uint8_t>(of.size())};
}

std::string string(const CfdpText &of)
{
    return {reinterpret_cast<const char *>(of.bytes), of.n};
}

/// A PDU of transaction (1, 0x0203) to entity 4, in the shortest ids that hold it.
CfdpPdu pdu_of(CfdpKind kind)
{
    CfdpPdu pdu{};
    pdu.kind = kind;
    pdu.source = 1;
    pdu.sequence = 0x0203;
    pdu.destination = 4;
    pdu.entity_bytes = 1;
    pdu.sequence_bytes = 2;
    return pdu;
}

Bytes written(const CfdpPdu &pdu)
{
    Bytes bytes(CFDP_PDU_MAX);
    bytes.resize(cfdp_pdu_write(&pdu, bytes.data(), bytes.size()));
    return bytes;
}

Bytes hex(const std::string &digits)
{
    Bytes bytes;
    std::istringstream words(digits);
    for (std::string word; words >> word;) {
        for (std::size_t i = 0; i < word.size(); i += 2) {
            bytes.push_back(static_cast<std::uint8_t>(std::stoi(word.substr(i, 2), nullptr, 16)));
        }
    }
    return bytes;
}

TEST(CfdpPdu, bytes_are_those_of_the_tables)
{
    CfdpPdu pdu = pdu_of(CFDP_METADATA);
    pdu.closure = 1;
    pdu.checksum_type = CFDP_CRC32;
    pdu.offset = 0x1234;
    pdu.from = text("ab");
    pdu.to = text("c");
    EXPECT_EQ(written(pdu), hex("20 000B 01 01 0203 04  07 43 00001234 02 6162 01 63"));
    pdu.large = 1;
    EXPECT_EQ(written(pdu), hex("21 000F 01 01 0203 04  07 43 0000000000001234 02 6162 01 63"));
    pdu = pdu_of(CFDP_EOF);
    pdu.condition = CFDP_CANCEL_REQUEST;
    pdu.checksum = 0xDEADBEEF;
    pdu.offset = 7;
    const Bytes where = hex("06 01 04"); // the fault is at entity 4
    pdu.data = where.data();
    pdu.n = where.size();
    EXPECT_EQ(written(pdu), hex("20 000D 01 01 0203 04  04 F0 DEADBEEF 00000007 06 01 04"));
    pdu = pdu_of(CFDP_FINISHED);
    pdu.to_sender = 1;
    pdu.condition = CFDP_CHECKSUM_FAILURE;
    pdu.incomplete = 1;
    pdu.file_status = CFDP_RETAINED;
    EXPECT_EQ(written(pdu), hex("28 0002 01 01 0203 04  05 56"));
    pdu = pdu_of(CFDP_ACK);
    pdu.acknowledged = CFDP_FINISHED;
    pdu.condition = CFDP_NAK_LIMIT;
    pdu.status = CFDP_TERMINATED;
    EXPECT_EQ(written(pdu), hex("20 0003 01 01 0203 04  06 51 72"));
    pdu.acknowledged = CFDP_EOF;
    pdu.to_sender = 1;
    EXPECT_EQ(written(pdu), hex("28 0003 01 01 0203 04  06 40 72"));
    pdu = pdu_of(CFDP_NAK);
    pdu.to_sender = 1;
    pdu.end = 0x500;
    const Bytes segments = hex("00000000 00000000 00000100 00000200");
    pdu.data = segments.data();
    pdu.n = segments.size();
    EXPECT_EQ(written(pdu), hex("28 0019 01 01 0203 04  08 00000000 00000500 00000000 00000000 00000100 00000200"));
    pdu = pdu_of(CFDP_PROMPT);
    pdu.keep_alive = 1;
    EXPECT_EQ(written(pdu), hex("20 0002 01 01 0203 04  09 80"));
    pdu = pdu_of(CFDP_KEEP_ALIVE);
    pdu.to_sender = 1;
    pdu.large = 1;
    pdu.offset = 0x100000000;
    EXPECT_EQ(written(pdu), hex("29 0009 01 01 0203 04  0C 0000000100000000"));
    pdu = pdu_of(CFDP_FILE_DATA);
    pdu.unacknowledged = 1;
    pdu.records = 1;
    pdu.has_context = 1;
    pdu.continuation = 3;
    pdu.from = text("r");
    pdu.offset = 0x10;
    pdu.data = segments.data() + 10;
    pdu.n = 3;
    EXPECT_EQ(written(pdu), hex("34 0009 89 01 0203 04  C1 72 00000010 0100 00"));
    pdu.has_context = pdu.records = 0;
    pdu.from = {};
    pdu.crc = 1;
    Bytes checked = written(pdu);
    EXPECT_EQ(Bytes(checked.begin(), checked.end() - 2), hex("36 0009 01 01 0203 04  00000010 0100 00"));
    EXPECT_EQ(ccsds_crc16(checked.data(), checked.size()), 0);
    checked[10] ^= 1;
    EXPECT_EQ(cfdp_pdu_read(&pdu, checked.data(), checked.size()), CCSDS_CRC);
}

TEST(CfdpPdu, messages_and_requests_are_those_of_the_tables)
{
    std::uint8_t bytes[CFDP_PDU_MAX];
    const auto message = [&](const CfdpMessage &fields) {
        return Bytes(bytes, bytes + cfdp_message_write(&fields, bytes, sizeof bytes));
    };
    const std::string cfdp = "63666470 ";
    CfdpMessage fields{};
    fields.type = CFDP_PROXY_PUT;
    fields.entity = 0x102;
    fields.entity_bytes = 2;
    fields.first = text("a");
    fields.second = text("bc");
    EXPECT_EQ(message(fields), hex("02 0D" + cfdp + "00 02 0102 01 61 02 6263"));
    fields = {};
    fields.type = CFDP_ORIGIN;
    fields.entity = 5;
    fields.entity_bytes = 1;
    fields.sequence = 0x60708;
    fields.sequence_bytes = 3;
    EXPECT_EQ(message(fields), hex("02 0A" + cfdp + "0A 02 05 060708"));
    fields = {};
    fields.type = CFDP_LISTED;
    fields.value = 0x80;
    fields.first = text("d");
    fields.second = text("l");
    EXPECT_EQ(message(fields), hex("02 0A" + cfdp + "11 80 01 64 01 6C"));
    fields = {};
    fields.entity = 5;
    fields.sequence = 0x60708;
    fields.entity_bytes = 1;
    fields.sequence_bytes = 3;
    fields.first = text("r");
    fields.value = 0xA0;
    for (const auto &[type, digits] :
         std::initializer_list<std::pair<int, const char *>>{{CFDP_REMOTE_REPORT, "0C 63666470 20 02 05 060708 01 72"},
                                                             {CFDP_REMOTE_REPORTED, "0B 63666470 21 A0 02 05 060708"},
                                                             {CFDP_REMOTE_SUSPEND, "0A 63666470 30 02 05 060708"},
                                                             {CFDP_REMOTE_SUSPENDED, "0B 63666470 31 A0 02 05 060708"},
                                                             {CFDP_REMOTE_RESUME, "0A 63666470 38 02 05 060708"},
                                                             {CFDP_REMOTE_RESUMED, "0B 63666470 39 A0 02 05 060708"}}) {
        fields.type = static_cast<std::uint8_t>(type);
        EXPECT_EQ(message(fields), hex("02 " + std::string(digits)));
    }
    CfdpFilestore store{};
    store.action = CFDP_RENAME_FILE;
    store.status = 2;
    store.first = text("a");
    store.second = text("b");
    store.message = text("no");
    EXPECT_EQ(Bytes(bytes, bytes + cfdp_filestore_write(&store, bytes, sizeof bytes)), hex("00 05 20 01 61 01 62"));
    store.response = 1;
    EXPECT_EQ(Bytes(bytes, bytes + cfdp_filestore_write(&store, bytes, sizeof bytes)),
              hex("01 08 22 01 61 01 62 02 6E6F"));
    store.action = CFDP_DELETE_FILE; // which has no second name
    EXPECT_EQ(Bytes(bytes, bytes + cfdp_filestore_write(&store, bytes, sizeof bytes)), hex("01 06 12 01 61 02 6E6F"));
}

TEST(CfdpPdu, checksums)
{
    const std::string digits = "123456789";
    const auto sum = [](std::uint8_t type, const std::string &of) {
        return cfdp_checksum(type, 0, 0, text(of).bytes, of.size());
    };
    EXPECT_EQ(sum(CFDP_CRC32, digits), 0xCBF43926u); // the check value that catalogues of CRCs print
    EXPECT_EQ(sum(CFDP_MODULAR, digits), 0x31323334u + 0x35363738u + 0x39000000u);
    EXPECT_EQ(sum(CFDP_NULL_CHECKSUM, digits), 0u);
    std::mt19937 random(3);
    const Bytes file = any_bytes(random, 1000);
    for (const std::uint8_t type : {CFDP_MODULAR, CFDP_CRC32}) {
        std::uint32_t whole = cfdp_checksum(type, 0, 0, file.data(), file.size()), parts = 0;
        for (std::size_t at = 0; at < file.size();) {
            const std::size_t n = std::min<std::size_t>(1 + random() % 9, file.size() - at);
            parts = cfdp_checksum(type, parts, at, &file[at], n);
            at += n;
        }
        EXPECT_EQ(parts, whole);
    }
}

/// Random TLVs, of each kind.
Bytes any_tlvs(std::mt19937 &random, bool responses)
{
    Bytes all(2000);
    std::size_t n = 0;
    for (std::uint32_t i = random() % 4; i-- > 0;) {
        const std::string first(random() % 30, 'f'), second(random() % 30, 's');
        if (responses || random() % 3 == 0) {
            const auto action = static_cast<std::uint8_t>(random() % 9);
            const bool two = action >= CFDP_RENAME_FILE && action <= CFDP_REPLACE_FILE;
            CfdpFilestore operation{text(first), two ? text(second) : CfdpText{},
                                    {},          responses,
                                    action,      static_cast<std::uint8_t>(responses ? random() % 16 : 0)};
            const std::size_t took = cfdp_filestore_write(&operation, &all[n], all.size() - n);
            const std::uint8_t *at = &all[n];
            std::size_t left = took;
            CfdpTlv tlv{};
            CfdpFilestore back{};
            EXPECT_EQ(cfdp_tlv_next(&tlv, &at, &left), 1);
            EXPECT_EQ(cfdp_filestore_read(&back, &tlv), CCSDS_OK);
            EXPECT_EQ(std::tie(back.response, back.action, back.status),
                      std::tie(operation.response, operation.action, operation.status));
            EXPECT_EQ(string(back.first) + "/" + string(back.second) + "/" + string(back.message),
                      string(operation.first) + "/" + string(operation.second) + "/" + string(operation.message));
            n += took;
        } else {
            CfdpMessage written{random() & 0xFF,
                                random() & 0xFFFF,
                                text(first),
                                text(second),
                                static_cast<std::uint8_t>(random() % 12),
                                1,
                                2,
                                static_cast<std::uint8_t>(random())};
            if (random() % 4 == 0) {
                static const std::uint8_t others[] = {0x10, 0x11, 0x20, 0x21, 0x30, 0x31, 0x38, 0x39};
                written.type = others[random() % std::size(others)];
            } else if (written.type == CFDP_PROXY_REQUEST || written.type == CFDP_PROXY_RESPONSE) {
                written.first = text({"\0\1f\0", written.type == CFDP_PROXY_REQUEST ? 3u : 4u}); // creates a file f
            }
            const std::size_t took = cfdp_message_write(&written, &all[n], all.size() - n);
            const std::uint8_t *at = &all[n];
            std::size_t left = took;
            CfdpTlv tlv{};
            CfdpMessage back{};
            Bytes again(600);
            EXPECT_EQ(cfdp_tlv_next(&tlv, &at, &left), 1);
            EXPECT_EQ(cfdp_message_read(&back, &tlv), CCSDS_OK);
            again.resize(cfdp_message_write(&back, again.data(), again.size()));
            EXPECT_EQ(again, Bytes(&all[n], &all[n] + took));
            n += took;
        }
    }
    all.resize(n);
    return all;
}

/// A random PDU; what it refers to is kept in `held`.
CfdpPdu any_pdu(std::mt19937 &random, std::vector<Bytes> &held)
{
    static const CfdpKind kinds[] = {CFDP_FILE_DATA, CFDP_EOF, CFDP_FINISHED, CFDP_ACK,
                                     CFDP_METADATA,  CFDP_NAK, CFDP_PROMPT,   CFDP_KEEP_ALIVE};
    const auto keep = [&](Bytes bytes) -> const Bytes & { return held.emplace_back(std::move(bytes)); };
    held.clear();
    held.reserve(4);
    const auto number = [&](std::size_t n) { return (std::uint64_t{random()} << 32 | random()) >> (64 - 8 * n); };
    const auto bits = [&](std::uint32_t n) { return static_cast<std::uint8_t>(random() % (1u << n)); };
    CfdpPdu pdu = pdu_of(kinds[random() % 8]);
    pdu.entity_bytes = static_cast<std::uint8_t>(1 + random() % 8);
    pdu.sequence_bytes = static_cast<std::uint8_t>(1 + random() % 8);
    pdu.source = number(pdu.entity_bytes);
    pdu.destination = number(pdu.entity_bytes);
    pdu.sequence = number(pdu.sequence_bytes);
    pdu.unacknowledged = bits(1);
    pdu.crc = bits(1);
    pdu.large = bits(1);
    const std::size_t wide = cfdp_wide(pdu.large);
    if (pdu.kind != CFDP_ACK && pdu.kind != CFDP_FINISHED && pdu.kind != CFDP_PROMPT) {
        pdu.offset = number(wide);
    }
    const Bytes *data = nullptr;
    switch (pdu.kind) {
    case CFDP_FILE_DATA:
        if (bits(1) != 0) {
            pdu.has_context = 1;
            pdu.records = bits(1);
            pdu.continuation = bits(2);
            const Bytes &context = keep(any_bytes(random, random() % 64));
            pdu.from = {context.data(), static_cast<std::uint8_t>(context.size())};
        }
        data = &keep(any_bytes(random, random() % 300));
        break;
    case CFDP_EOF:
        pdu.condition = bits(4);
        pdu.checksum = random();
        data = &keep(pdu.condition != 0 ? hex("06 01 07") : Bytes{});
        break;
    case CFDP_FINISHED:
        pdu.to_sender = 1;
        pdu.condition = bits(4);
        pdu.incomplete = bits(1);
        pdu.file_status = bits(2);
        data = &keep(any_tlvs(random, true));
        break;
    case CFDP_ACK:
        pdu.to_sender = bits(1);
        pdu.acknowledged = pdu.to_sender != 0 ? CFDP_EOF : CFDP_FINISHED;
        pdu.condition = bits(4);
        pdu.status = bits(2);
        break;
    case CFDP_METADATA: {
        pdu.closure = bits(1);
        pdu.checksum_type = bits(4);
        const Bytes &from = keep(Bytes(random() % 256, 'x'));
        const Bytes &to = keep(Bytes(random() % 256, 'y'));
        pdu.from = {from.data(), static_cast<std::uint8_t>(from.size())};
        pdu.to = {to.data(), static_cast<std::uint8_t>(to.size())};
        data = &keep(any_tlvs(random, false));
        break;
    }
    case CFDP_NAK:
        pdu.to_sender = 1;
        pdu.end = number(wide);
        data = &keep(any_bytes(random, random() % 20 * 2 * wide));
        break;
    case CFDP_PROMPT: pdu.keep_alive = bits(1); break;
    default: pdu.to_sender = 1;
    }
    if (data != nullptr) {
        pdu.data = data->data();
        pdu.n = data->size();
    }
    return pdu;
}

std::vector<std::uint64_t> numbers(const CfdpPdu &of)
{
    return {of.source,      of.sequence, of.destination, of.offset,       of.end,           of.checksum,
            of.kind,        of.crc,      of.to_sender,   of.entity_bytes, of.large,         of.unacknowledged,
            of.has_context, of.records,  of.condition,   of.continuation, of.incomplete,    of.sequence_bytes,
            of.file_status, of.status,   of.closure,     of.acknowledged, of.checksum_type, of.keep_alive};
}

TEST(CfdpPdu, what_is_written_is_read)
{
    std::mt19937 random(1);
    std::vector<Bytes> held;
    for (int i = 0; i < 20000; i++) {
        const CfdpPdu pdu = any_pdu(random, held);
        const Bytes bytes = written(pdu);
        ASSERT_FALSE(bytes.empty());
        CfdpPdu back{};
        ASSERT_EQ(cfdp_pdu_read(&back, bytes.data(), bytes.size()), CCSDS_OK) << int{pdu.kind};
        ASSERT_EQ(string(back.from), string(pdu.from));
        ASSERT_EQ(string(back.to), string(pdu.to));
        ASSERT_EQ(Bytes(back.data, back.data + back.n), Bytes(pdu.data, pdu.data + pdu.n));
        ASSERT_EQ(numbers(back), numbers(pdu));
        ASSERT_EQ(written(back), bytes);
        // One byte less of room, or of the PDU, is refused.
        Bytes less(bytes.size() - 1);
        ASSERT_EQ(cfdp_pdu_write(&pdu, less.data(), less.size()), 0u);
        std::copy_n(bytes.begin(), less.size(), less.begin());
        ASSERT_NE(cfdp_pdu_read(&back, less.data(), less.size()), CCSDS_OK);
    }
}

TEST(CfdpPdu, what_contradicts_itself_is_refused)
{
    CfdpPdu pdu{};
    const auto fault = [&](const std::string &digits) {
        const Bytes bytes = hex(digits);
        return cfdp_pdu_read(&pdu, bytes.data(), bytes.size());
    };
    EXPECT_EQ(fault("20 0002"), CCSDS_SHORT);
    EXPECT_EQ(fault("20 0002 01 01 0203"), CCSDS_SHORT);
    EXPECT_EQ(fault("20 0000 01 01 0203 04"), CCSDS_LENGTH);           // no code
    EXPECT_EQ(fault("40 0002 01 01 0203 04  09 80"), CCSDS_VERSION);   // version 2
    EXPECT_EQ(fault("00 0002 01 01 0203 04  09 80"), CCSDS_OK);        // version 0, of older issues
    EXPECT_EQ(fault("20 0003 01 01 0203 04  09 80"), CCSDS_LENGTH);    // one byte is missing
    EXPECT_EQ(fault("20 0003 01 01 0203 04  09 80 00"), CCSDS_LENGTH); // one too many
    EXPECT_EQ(fault("20 0002 01 01 0203 04  0A 80"), CCSDS_TYPE);      // no such directive
    EXPECT_EQ(fault("28 0002 01 01 0203 04  09 80"), CCSDS_TYPE);      // a prompt toward the sender
    EXPECT_EQ(fault("20 0003 01 01 0203 04  06 40 02"),
              CCSDS_TYPE); // the acknowledgement of an EOF toward the receiver
    EXPECT_EQ(fault("28 0003 01 01 0203 04  06 70 02"), CCSDS_TYPE);                      // of Metadata
    EXPECT_EQ(fault("22 0001 01 01 0203 04  09"), CCSDS_LENGTH);                          // no room for its CRC
    EXPECT_EQ(fault("28 000C 01 01 0203 04  08 00000000 00000005 000000"), CCSDS_LENGTH); // a part of a segment
    EXPECT_EQ(fault("20 0009 01 01 0203 04  07 00 00000000 01 61 01"), CCSDS_LENGTH);     // a name without its byte
    EXPECT_EQ(fault("20 000A 01 01 0203 04  07 00 00000000 00 00 00 01"), CCSDS_LENGTH);  // a TLV without its byte
    EXPECT_EQ(fault("30 0003 01 01 0203 04  000000"), CCSDS_LENGTH);
    EXPECT_EQ(fault("30 0006 09 01 0203 04  02 00 00000000"), CCSDS_LENGTH); // the context is longer than the PDU
    EXPECT_EQ(fault("30 0000 09 01 0203 04"), CCSDS_LENGTH);                 // there is no context
    EXPECT_EQ(fault("30 0002 09 01 0203 04  05 00"), CCSDS_LENGTH);          // a part of it
    CfdpFilestore store{};
    CfdpMessage message{};
    for (const auto &[digits, expected] : std::initializer_list<std::pair<const char *, CcsdsFault>>{
             {"00 00", CCSDS_LENGTH},             // no action
             {"00 01 90", CCSDS_TYPE},            // no such action
             {"00 03 20 01 61", CCSDS_LENGTH},    // no second name
             {"00 04 00 01 61 62", CCSDS_LENGTH}, // a byte too many
             {"02 05 63666470 7F", CCSDS_TYPE},   // no such message
             {"02 04 63666470", CCSDS_TYPE},      // not a reserved one
             {"02 05 63666470 07", CCSDS_LENGTH}, // no value
             {"02 06 63666470 07 00", CCSDS_OK},  //
             {"02 07 63666470 07 00 00", CCSDS_LENGTH},
             {"02 08 63666470 0A 11 05 06", CCSDS_LENGTH},
             {"02 05 63666470 0A", CCSDS_LENGTH},                             // no transaction
             {"02 0A 63666470 00 00 01 61 01 62", CCSDS_LENGTH},              // an entity without bytes
             {"02 11 63666470 00 09 010203040506070809 00 00", CCSDS_LENGTH}, // one of 9
         }) {
        const Bytes bytes = hex(digits);
        const std::uint8_t *at = bytes.data();
        std::size_t n = bytes.size();
        CfdpTlv tlv{};
        ASSERT_EQ(cfdp_tlv_next(&tlv, &at, &n), 1) << digits;
        EXPECT_EQ(bytes[0] == 2 ? cfdp_message_read(&message, &tlv) : cfdp_filestore_read(&store, &tlv), expected)
            << digits;
    }
}

TEST(CfdpPdu, what_does_not_fit_is_not_written)
{
    Bytes bytes(100000), data(CFDP_PDU_MAX + 1);
    const auto size = [&](CfdpKind kind, std::size_t n, std::size_t context = 0) {
        CfdpPdu pdu = pdu_of(kind);
        pdu.data = data.data();
        pdu.n = n;
        pdu.has_context = kind == CFDP_FILE_DATA;
        pdu.from = {data.data(), static_cast<std::uint8_t>(context)};
        return cfdp_pdu_write(&pdu, bytes.data(), bytes.size());
    };
    EXPECT_EQ(size(CFDP_FILE_DATA, 65530), 8u + 65535u); // a length of 16 bits: with an offset and a context of 1 byte
    EXPECT_EQ(size(CFDP_FILE_DATA, 65531), 0u);
    EXPECT_EQ(size(CFDP_FILE_DATA, data.size()), 0u);
    EXPECT_EQ(size(CFDP_FILE_DATA, 5, CFDP_CONTEXT_MAX), 8u + 4u + 64u + 5u);
    EXPECT_EQ(size(CFDP_FILE_DATA, 5, CFDP_CONTEXT_MAX + 1), 0u);
    EXPECT_EQ(cfdp_tlv_write(1, data.data(), 256, bytes.data(), bytes.size()), 0u);
    EXPECT_EQ(cfdp_tlv_write(1, data.data(), 3, bytes.data(), 4), 0u);
    EXPECT_EQ(cfdp_tlv_write(1, nullptr, 0, bytes.data(), 2), 2u);
    bytes[2] = 7;
    EXPECT_EQ(cfdp_tlv_write(9, &bytes[2], 1, bytes.data(), 3), 3u); // the value stands there already
    EXPECT_EQ(Bytes(bytes.begin(), bytes.begin() + 3), (Bytes{9, 1, 7}));
    CfdpMessage none{};
    none.type = 0x7F;
    EXPECT_EQ(cfdp_message_write(&none, bytes.data(), bytes.size()), 0u);
}

/// The sanitizers watch. FLEDGE_PDUS sets how many.
TEST(CfdpPdu, damaged_and_random_bytes_are_refused_or_read_within_bounds)
{
    const char *setting = std::getenv("FLEDGE_PDUS");
    std::mt19937 random(2);
    std::vector<Bytes> held;
    int good = 0, bad = 0;
    for (long i = setting != nullptr ? std::atol(setting) : 50000; i-- > 0;) {
        Bytes bytes = i % 4 == 0 ? any_bytes(random, random() % 60) : written(any_pdu(random, held));
        if (i % 4 == 1) {
            bytes.resize(random() % (bytes.size() + 1));
        }
        for (std::uint32_t n = random() % 4; n-- > 0 && !bytes.empty();) {
            bytes[random() % bytes.size()] = static_cast<std::uint8_t>(random());
        }
        bytes.shrink_to_fit(); // so that a read behind them is noticed
        CfdpPdu pdu{};
        if (cfdp_pdu_read(&pdu, bytes.data(), bytes.size()) != CCSDS_OK) {
            bad++;
            continue;
        }
        good++;
        ASSERT_TRUE(pdu.n == 0 || (pdu.data >= bytes.data() && pdu.data + pdu.n <= bytes.data() + bytes.size()));
        if (pdu.kind == CFDP_METADATA || pdu.kind == CFDP_FINISHED || pdu.kind == CFDP_EOF) {
            CfdpTlv tlv{};
            CfdpFilestore store{};
            CfdpMessage message{};
            while (cfdp_tlv_next(&tlv, &pdu.data, &pdu.n) != 0) {
                (void)cfdp_filestore_read(&store, &tlv);
                (void)cfdp_message_read(&message, &tlv);
            }
            ASSERT_EQ(pdu.n, 0u);
        }
    }
    EXPECT_GT(good, 1000);
    EXPECT_GT(bad, 1000);
}

TEST(CfdpPdu, wireshark_reads_the_same)
{
    if (std::system("command -v tshark >/dev/null 2>&1") != 0) {
        GTEST_SKIP() << "not installed: tshark";
    }
    // As space packets of the application that Wireshark knows as CFDP's. It reads the issue before: sizes of 32 bits.
    // It takes PDUs below 10 bytes, a response of the store and a proxy's flow label for cut; these are left out.
    std::mt19937 random(5);
    std::vector<Bytes> held;
    std::vector<Bytes> packets;
    std::string expected;
    for (int i = 0; i < 400; i++) {
        CfdpPdu pdu = any_pdu(random, held);
        pdu.large = 0;
        pdu.has_context = pdu.records = 0;
        pdu.offset &= 0xFFFFFFFF;
        pdu.end &= 0xFFFFFFFF;
        if (pdu.kind == CFDP_FILE_DATA) {
            pdu.from = {};
        }
        pdu.n -= pdu.kind == CFDP_NAK ? pdu.n % 8 : pdu.kind == CFDP_FINISHED ? pdu.n : 0;
        const std::string tlvs(pdu.data, pdu.data + pdu.n);
        const Bytes bytes = written(pdu);
        if (bytes.size() < 10 || tlvs.find("cfdp\3") != std::string::npos || tlvs.find("cfdp\5") != std::string::npos ||
            tlvs.find("cfdp\7") != std::string::npos) {
            continue; // 3 and 7 have a condition, which would be in the column of EOF's
        }
        Bytes packet(SPACE_PACKET_HEADER);
        packet.insert(packet.end(), bytes.begin(), bytes.end());
        const SpacePacket head{
            static_cast<std::uint32_t>(packet.size()), 2045, static_cast<std::uint16_t>(i), 0, 0, SPACE_PACKET_WHOLE};
        space_packet_write(&head, packet.data());
        packets.push_back(packet);
        std::ostringstream line;
        line << pdu.source << ' ' << pdu.sequence << ' ' << pdu.destination;
        const auto field = [&](bool has, auto value) {
            line << ' ';
            if (has) {
                line << value;
            }
        };
        const auto is = [&](CfdpKind kind) { return pdu.kind == kind; };
        field(!is(CFDP_FILE_DATA), int{pdu.kind});
        field(is(CFDP_FILE_DATA), pdu.offset);
        field(is(CFDP_EOF) || is(CFDP_METADATA), pdu.offset);
        char sum[11];
        std::snprintf(sum, sizeof sum, "0x%08x", pdu.checksum);
        field(is(CFDP_EOF), sum);
        field(is(CFDP_EOF) || is(CFDP_FINISHED) || is(CFDP_ACK), int{pdu.condition});
        field(is(CFDP_NAK), pdu.offset);
        field(is(CFDP_NAK), pdu.end);
        field(is(CFDP_KEEP_ALIVE), pdu.offset);
        field(is(CFDP_METADATA), string(pdu.from));
        field(is(CFDP_METADATA), string(pdu.to));
        expected += line.str() + "\n";
    }
    const std::string file = testing::TempDir() + "cfdp_" + std::to_string(std::random_device{}()) + ".pcap";
    write_capture(file, packets);
    std::string fields = "-T fields -E occurrence=f -E separator=' '";
    for (const char *name :
         {"srcid", "transeqnum", "dstid", "fdtype", "offset", "file_size", "checksum", "condition_code", "nak_st_scope",
          "nak_sp_scope", "progress", "src_file_name", "dst_file_name"}) {
        fields += std::string(" -e cfdp.") + name;
    }
    EXPECT_EQ(tshark(file, fields), expected);
    EXPECT_EQ(tshark(file, "-Y '_ws.malformed || cfdp.bad_length'"), "");
    std::remove(file.c_str());
}

} // namespace cfdp_pdu_test
