// SPDX-License-Identifier: Apache-2.0
// The archive's writer against a parser of its own, written from https://mcap.dev/spec alone: what
// comes out is what went in, every checksum, index and offset is right, and no failure of the sink
// or the caller leaves anything but a readable beginning.
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <barrier>
#include <cerrno>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <map>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>

#include "record/file_sink.h"
#include "record/mcap.h"

// volatile: the compiler takes for granted that malloc changes no variable of ours.
static volatile long heap_calls = 0;

extern "C" {
void *__real_malloc(size_t n);
void *__real_calloc(size_t n, size_t size);
void *__real_realloc(void *p, size_t n);

void *__wrap_malloc(size_t n)
{
    heap_calls = heap_calls + 1;
    return __real_malloc(n);
}

void *__wrap_calloc(size_t n, size_t size)
{
    heap_calls = heap_calls + 1;
    return __real_calloc(n, size);
}

void *__wrap_realloc(void *p, size_t n)
{
    heap_calls = heap_calls + 1;
    return __real_realloc(p, n);
}
}

namespace mcap_test {

using Bytes = std::vector<uint8_t>;

// ---- the parser ----

uint32_t crc_bit_by_bit(const uint8_t *p, size_t n)
{
    uint32_t r = ~0u;
    for (size_t i = 0; i < n; i++) {
        r ^= p[i];
        for (int bit = 0; bit < 8; bit++) {
            r = (r & 1u) ? (r >> 1) ^ 0xEDB88320u : r >> 1;
        }
    }
    return ~r;
}

struct Reader {
    const uint8_t *p;
    const uint8_t *end;

    uint64_t number(size_t n)
    {
        if (size_t(end - p) < n) {
            throw std::runtime_error("field beyond its record");
        }
        uint64_t v = 0;
        for (size_t i = 0; i < n; i++) {
            v |= uint64_t(p[i]) << (8 * i);
        }
        p += n;
        return v;
    }

    Reader part(uint64_t n)
    {
        if (uint64_t(end - p) < n) {
            throw std::runtime_error("part beyond its record");
        }
        Reader r{p, p + n};
        p += n;
        return r;
    }

    Bytes rest() const { return Bytes(p, end); }

    std::string text()
    {
        Reader r = part(number(4));
        return std::string(r.p, r.end);
    }

    std::map<std::string, std::string> pairs()
    {
        std::map<std::string, std::string> map;
        for (Reader r = part(number(4)); r.p < r.end;) {
            std::string key = r.text();
            map[key] = r.text();
        }
        return map;
    }
};

struct Message {
    uint64_t channel, sequence, t;
    Bytes payload; ///< with the CDR header
    bool operator==(const Message &) const = default;
};

struct Schema {
    std::string name, encoding, text;
    bool operator==(const Schema &) const = default;
};

struct Channel {
    uint64_t schema;
    std::string topic, encoding;
    std::map<std::string, std::string> metadata;
    bool operator==(const Channel &) const = default;
};

struct Chunk {
    uint64_t start, length, t_first, t_last, records;
    std::map<uint64_t, uint64_t> index_offsets; ///< channel -> file offset of its MessageIndex
    uint64_t index_length;
    bool operator==(const Chunk &) const = default;
};

struct File {
    std::string profile, library;
    std::map<uint64_t, Schema> schemas, summary_schemas;
    std::map<uint64_t, Channel> channels, summary_channels;
    std::vector<Message> messages;
    std::vector<Chunk> chunks, summary_chunks;
    std::map<std::string, std::map<std::string, std::string>> metadata;
    std::map<std::string, std::pair<uint64_t, uint64_t>> metadata_at, summary_metadata_at;
    uint64_t loose_messages = 0; ///< outside of chunks
    std::map<uint64_t, uint64_t> counts;
    uint64_t n_messages = 0, n_schemas = 0, n_channels = 0, n_metadata = 0, n_chunks = 0;
    uint64_t t_first = 0, t_last = 0;
};

void require(bool condition, const char *what)
{
    if (!condition) {
        throw std::runtime_error(what);
    }
}

// A Schema, Channel or (where allowed) Message record; false for any other.
bool content_record(uint64_t op, Reader r, std::map<uint64_t, Schema> &schemas, std::map<uint64_t, Channel> &channels,
                    std::vector<Message> *messages)
{
    if (op == 3) {
        uint64_t id = r.number(2);
        Schema s;
        s.name = r.text();
        s.encoding = r.text();
        s.text = r.text();
        require(id != 0 && schemas.emplace(id, s).second, "schema id");
    } else if (op == 4) {
        uint64_t id = r.number(2);
        Channel c;
        c.schema = r.number(2);
        require(schemas.count(c.schema) == 1, "channel before its schema");
        c.topic = r.text();
        c.encoding = r.text();
        c.metadata = r.pairs();
        require(channels.emplace(id, c).second, "channel id");
    } else if (op == 5 && messages) {
        Message m;
        m.channel = r.number(2);
        require(channels.count(m.channel) == 1, "message before its channel");
        m.sequence = r.number(4);
        m.t = r.number(8);
        require(r.number(8) == m.t, "publish time");
        m.payload = r.rest();
        messages->push_back(m);
        return true;
    } else {
        return false;
    }
    require(r.p == r.end, "record longer than its fields");
    return true;
}

struct Record {
    uint64_t op, start;
    Reader body;
};

Record next_record(Reader &r, const uint8_t *file)
{
    Record record{0, uint64_t(r.p - file), {nullptr, nullptr}};
    record.op = r.number(1);
    record.body = r.part(r.number(8));
    return record;
}

using Index = std::map<uint64_t, std::vector<std::pair<uint64_t, uint64_t>>>;

File parse(const Bytes &bytes)
{
    File f;
    const uint8_t *base = bytes.data();
    Reader r{base, base + bytes.size()};
    const std::string magic("\x89MCAP0\r\n", 8);
    auto read_magic = [&](Reader m) { require(std::string(m.p, m.end) == magic, "magic"); };
    read_magic(r.part(8));
    Record header = next_record(r, base);
    require(header.op == 1, "header");
    f.profile = header.body.text();
    f.library = header.body.text();

    // The data section. Every MessageIndex is checked against the chunk that it follows.
    Index expected;
    auto end_of_indexes = [&] { require(expected.empty(), "a MessageIndex is missing"); };
    for (bool open = true; open;) {
        Record record = next_record(r, base);
        Reader b = record.body;
        if (record.op == 6) {
            end_of_indexes();
            Chunk c{};
            c.start = record.start;
            c.length = uint64_t(r.p - base) - record.start;
            c.t_first = b.number(8);
            c.t_last = b.number(8);
            c.records = b.number(8);
            uint64_t crc = b.number(4);
            require(b.text().empty(), "compression");
            Reader records = b.part(b.number(8));
            require(b.p == b.end, "chunk length");
            require(uint64_t(records.end - records.p) == c.records, "uncompressed size");
            require(crc == crc_bit_by_bit(records.p, c.records), "chunk CRC");
            const uint8_t *chunk_base = records.p;
            uint64_t t_first = ~0ull, t_last = 0;
            while (records.p < records.end) {
                Record inner = next_record(records, chunk_base);
                size_t before = f.messages.size();
                require(content_record(inner.op, inner.body, f.schemas, f.channels, &f.messages),
                        "not allowed in a chunk");
                if (f.messages.size() > before) {
                    const Message &m = f.messages.back();
                    expected[m.channel].push_back({m.t, inner.start});
                    t_first = std::min(t_first, m.t);
                    t_last = std::max(t_last, m.t);
                }
            }
            require(c.t_first == (expected.empty() ? 0 : t_first), "chunk start time");
            require(c.t_last == t_last, "chunk end time");
            f.chunks.push_back(c);
        } else if (record.op == 7) {
            uint64_t channel = b.number(2);
            std::vector<std::pair<uint64_t, uint64_t>> entries;
            for (Reader e = b.part(b.number(4)); e.p < e.end;) {
                uint64_t t = e.number(8);
                entries.push_back({t, e.number(8)});
            }
            require(expected.count(channel) && expected[channel] == entries, "MessageIndex");
            expected.erase(channel);
            f.chunks.back().index_offsets[channel] = record.start;
            f.chunks.back().index_length += uint64_t(r.p - base) - record.start;
        } else if (record.op == 12) {
            std::string name = b.text();
            f.metadata[name] = b.pairs();
            f.metadata_at[name] = {record.start, uint64_t(r.p - base) - record.start};
        } else if (record.op == 15) {
            end_of_indexes();
            require(b.number(4) == crc_bit_by_bit(base, record.start), "data section CRC");
            open = false;
        } else {
            size_t before = f.messages.size();
            require(content_record(record.op, b, f.schemas, f.channels, &f.messages), "unknown record");
            f.loose_messages += f.messages.size() - before;
        }
    }

    // The summary, in groups; the offsets; the footer.
    const uint64_t summary_start = uint64_t(r.p - base);
    uint64_t offset_start = 0;
    std::map<uint64_t, std::pair<uint64_t, uint64_t>> groups, declared;
    for (bool open = true; open;) {
        Record record = next_record(r, base);
        Reader b = record.body;
        const uint64_t size = uint64_t(r.p - base) - record.start;
        if (record.op == 14) {
            offset_start = offset_start ? offset_start : record.start;
            uint64_t op = b.number(1);
            uint64_t start = b.number(8);
            declared[op] = {start, b.number(8)};
            continue;
        }
        if (record.op == 2) {
            require(b.number(8) == summary_start, "summary start");
            require(b.number(8) == offset_start, "summary offset start");
            const uint64_t crc_at = uint64_t(b.p - base);
            require(b.number(4) == crc_bit_by_bit(base + summary_start, crc_at - summary_start), "summary CRC");
            open = false;
            continue;
        }
        auto [group, fresh] = groups.try_emplace(record.op, record.start, 0);
        require(fresh || group->second.first + group->second.second == record.start, "grouping");
        group->second.second += size;
        if (record.op == 8) {
            Chunk c{};
            c.t_first = b.number(8);
            c.t_last = b.number(8);
            c.start = b.number(8);
            c.length = b.number(8);
            for (Reader e = b.part(b.number(4)); e.p < e.end;) {
                uint64_t channel = e.number(2);
                c.index_offsets[channel] = e.number(8);
            }
            c.index_length = b.number(8);
            require(b.text().empty(), "compression");
            c.records = b.number(8);
            require(b.number(8) == c.records, "uncompressed size");
            f.summary_chunks.push_back(c);
        } else if (record.op == 11) {
            f.n_messages = b.number(8);
            f.n_schemas = b.number(2);
            f.n_channels = b.number(4);
            require(b.number(4) == 0, "attachments");
            f.n_metadata = b.number(4);
            f.n_chunks = b.number(4);
            f.t_first = b.number(8);
            f.t_last = b.number(8);
            for (Reader e = b.part(b.number(4)); e.p < e.end;) {
                uint64_t channel = e.number(2);
                f.counts[channel] = e.number(8);
            }
        } else if (record.op == 13) {
            uint64_t start = b.number(8);
            uint64_t length = b.number(8);
            f.summary_metadata_at[b.text()] = {start, length};
        } else {
            require(content_record(record.op, b, f.summary_schemas, f.summary_channels, nullptr),
                    "not allowed in the summary");
        }
    }
    require(declared == groups, "summary offsets");
    read_magic(r.part(8));
    require(r.p == r.end, "bytes after the end");
    return f;
}

// ---- the writer, its memory, and a sink that may run full ----

struct Archive {
    Bytes file;
    Bytes disk;             ///< the file, and what is ahead of it
    size_t room = SIZE_MAX; ///< the sink fails when it would hold more
    int calls_after_failure = 0;
    bool failed = false;
    std::vector<McapSchema> schemas = std::vector<McapSchema>(4);
    std::vector<McapChannel> channels = std::vector<McapChannel>(4);
    Bytes chunk, index;
    McapWriter w;

    explicit Archive(size_t chunk_size, size_t index_size = 4096, uint8_t garbage = 0xA5)
        : chunk(chunk_size, garbage), index(index_size, garbage)
    {
        std::memset(&w, garbage, sizeof w);
    }

    static int write(void *user, const void *bytes, size_t n)
    {
        auto *a = static_cast<Archive *>(user);
        a->calls_after_failure += a->failed ? 1 : 0;
        const auto *p = static_cast<const uint8_t *>(bytes);
        size_t fits = std::min(n, a->room - a->file.size());
        a->file.insert(a->file.end(), p, p + fits);
        a->failed = fits < n;
        a->disk.resize(std::max(a->disk.size(), a->file.size()));
        std::copy_n(p, fits, a->disk.begin() + ptrdiff_t(a->file.size() - fits));
        return a->failed ? ENOSPC : 0;
    }

    static int ahead(void *user, size_t offset, const void *bytes, size_t n)
    {
        auto *a = static_cast<Archive *>(user);
        const size_t begin = a->file.size() + offset;
        a->calls_after_failure += a->failed ? 1 : 0;
        a->failed = begin + n > a->room;
        if (!a->failed) {
            a->disk.resize(std::max(a->disk.size(), begin + n));
            std::copy_n(static_cast<const uint8_t *>(bytes), n, a->disk.begin() + ptrdiff_t(begin));
        }
        return a->failed ? ENOSPC : 0;
    }

    McapConfig config()
    {
        McapConfig c{};
        c.write = write;
        c.ahead = ahead;
        c.user = this;
        c.schemas = schemas.data();
        c.channels = channels.data();
        c.chunk = chunk.empty() ? nullptr : chunk.data();
        c.index = index.empty() ? nullptr : index.data();
        c.chunk_size = chunk.size();
        c.index_size = index.size();
        c.schemas_max = uint16_t(schemas.size());
        c.channels_max = uint16_t(channels.size());
        return c;
    }

    McapStatus open()
    {
        McapConfig c = config();
        return mcap_open(&w, &c);
    }
};

const char ERROR_TEXT[] = "float64[3] sigma_br  # sigma_BR [-] (3) MRP of B relative to R\n";
const char TORQUE_TEXT[] = "float64[3] torque_b  # torque_B [N m] (3) control torque\n";
const McapPair ERROR_PAIRS[] = {{"instance", "tracking"}, {"task", "gnc"}};
const McapPair RUN_PAIRS[] = {{"seed", "7"}, {"mission", "nadir_spin"}};

struct Given {
    std::vector<Message> messages;
    uint16_t error = 0, torque = 0;
};

Bytes with_cdr_head(const Bytes &payload, bool little)
{
    Bytes b(4 + payload.size());
    b[1] = little ? 1 : 0;
    std::copy(payload.begin(), payload.end(), b.begin() + 4);
    return b;
}

// A run of n messages on two channels, sizes and times at random. Statuses are the caller's
// business: a failing sink goes through here too.
Given write_run(Archive &a, int n, size_t payload_max = 120, std::function<void(int)> each = {})
{
    Given given;
    std::mt19937 random(1);
    uint16_t schema = 0;
    a.open();
    mcap_add_schema(&a.w, "fledge/msg/AttError", ERROR_TEXT, &schema);
    mcap_add_channel(&a.w, "/flight/tracking/error", schema, MCAP_ORDER_LITTLE, ERROR_PAIRS, 2, &given.error);
    mcap_metadata(&a.w, "run", RUN_PAIRS, 2);
    for (int i = 0; i < n; i++) {
        if (i == n / 2) { // a channel may come late
            mcap_add_schema(&a.w, "fledge/msg/BodyTorque", TORQUE_TEXT, &schema);
            mcap_add_channel(&a.w, "/flight/control/torque", schema, MCAP_ORDER_BIG, nullptr, 0, &given.torque);
        }
        bool second = given.torque != 0 && random() % 3 == 0;
        Bytes payload(random() % (payload_max + 1));
        std::generate(payload.begin(), payload.end(), [&] { return uint8_t(random()); });
        int64_t t = 1'000'000'000LL * i + int64_t(random() % 3'000'000'000);
        mcap_message(&a.w, second ? given.torque : given.error, t, uint32_t(i), payload.data(), payload.size());
        given.messages.push_back(
            {second ? given.torque : given.error, uint64_t(i), uint64_t(t), with_cdr_head(payload, !second)});
        if (each) {
            each(i);
        }
    }
    return given;
}

void expect_whole(const File &f, const Given &given, bool chunked, bool indexed)
{
    EXPECT_EQ(f.profile, "ros2");
    EXPECT_EQ(f.library, "fledge");
    EXPECT_EQ(f.messages, given.messages);
    EXPECT_EQ(f.loose_messages, chunked ? 0 : given.messages.size());
    EXPECT_EQ(f.chunks.empty(), !chunked);

    const std::map<uint64_t, Schema> schemas{{1, {"fledge/msg/AttError", "ros2msg", ERROR_TEXT}},
                                             {2, {"fledge/msg/BodyTorque", "ros2msg", TORQUE_TEXT}}};
    const std::map<uint64_t, Channel> channels{
        {given.error, {1, "/flight/tracking/error", "cdr", {{"instance", "tracking"}, {"task", "gnc"}}}},
        {given.torque, {2, "/flight/control/torque", "cdr", {}}}};
    EXPECT_EQ(f.schemas, schemas);
    EXPECT_EQ(f.channels, channels);
    EXPECT_EQ(f.summary_schemas, schemas);
    EXPECT_EQ(f.summary_channels, channels);
    EXPECT_EQ(f.metadata.at("run").at("mission"), "nadir_spin");
    EXPECT_EQ(f.summary_chunks, indexed ? f.chunks : std::vector<Chunk>{});
    EXPECT_EQ(f.summary_metadata_at, indexed ? f.metadata_at : decltype(f.metadata_at){});

    std::map<uint64_t, uint64_t> counts;
    uint64_t first = ~0ull, last = 0;
    for (const Message &m : given.messages) {
        counts[m.channel]++;
        first = std::min(first, m.t);
        last = std::max(last, m.t);
    }
    EXPECT_EQ(f.counts, counts);
    EXPECT_EQ(f.n_messages, given.messages.size());
    EXPECT_EQ(f.n_schemas, 2u);
    EXPECT_EQ(f.n_channels, 2u);
    EXPECT_EQ(f.n_metadata, 1u);
    EXPECT_EQ(f.n_chunks, f.chunks.size());
    EXPECT_EQ(f.t_first, first);
    EXPECT_EQ(f.t_last, last);
}

// ---- CRC ----

TEST(Crc, IsTheWellKnownOne)
{
    McapCrc c;
    mcap_crc_init(&c);
    EXPECT_EQ(mcap_crc_update(&c, 0, "123456789", 9), 0xCBF43926u);
    EXPECT_EQ(mcap_crc_update(&c, 0, nullptr, 0), 0u);
}

TEST(Crc, EveryLengthCutAndJoinAgreesWithTheDefinition)
{
    McapCrc c;
    mcap_crc_init(&c);
    std::mt19937 random(2);
    Bytes b(70000);
    std::generate(b.begin(), b.end(), [&] { return uint8_t(random()); });
    std::vector<size_t> lengths{16383, 16384, 16385, 16407, 16408, 65536, 69999};
    for (size_t n = 0; n < 64; n++) {
        lengths.push_back(n);
    }
    for (size_t n : lengths) {
        const uint32_t whole = crc_bit_by_bit(b.data(), n);
        ASSERT_EQ(mcap_crc_update(&c, 0, b.data(), n), whole) << n;
        size_t cut = n == 0 ? 0 : random() % n;
        uint32_t head = mcap_crc_update(&c, 0, b.data(), cut);
        uint32_t tail = mcap_crc_update(&c, 0, b.data() + cut, n - cut);
        ASSERT_EQ(mcap_crc_update(&c, head, b.data() + cut, n - cut), whole) << n;
        ASSERT_EQ(mcap_crc_join(head, tail, n - cut), whole) << n;
    }
}

// ---- whole files ----

TEST(Mcap, WhatIsReadIsWhatWasGiven)
{
    for (size_t chunk_size : {size_t(0), MCAP_CHUNK_MIN, size_t(1500), size_t(1) << 20}) {
        SCOPED_TRACE(chunk_size);
        Archive a(chunk_size);
        Given given = write_run(a, 200);
        ASSERT_EQ(mcap_close(&a.w), MCAP_OK);
        File f = parse(a.file);
        expect_whole(f, given, chunk_size > 0, true);
        EXPECT_FALSE(a.w.index_full);
        if (chunk_size == 1500) {
            EXPECT_GT(f.chunks.size(), 10u);
        }
    }
}

TEST(Mcap, TinyMessagesNeverRunIntoTheirIndex)
{
    Archive a(MCAP_CHUNK_MIN, 1 << 16);
    Given given = write_run(a, 500, 0);
    ASSERT_EQ(mcap_close(&a.w), MCAP_OK);
    expect_whole(parse(a.file), given, true, true);
}

TEST(Mcap, AMessageLargerThanTheChunkBufferHasAChunkOfItsOwn)
{
    Archive a(MCAP_CHUNK_MIN, 65536);
    Given given = write_run(a, 200, 3000);
    ASSERT_EQ(mcap_close(&a.w), MCAP_OK);
    File f = parse(a.file);
    expect_whole(f, given, true, true);
    const auto large = [](const Message &m) { return m.payload.size() > MCAP_CHUNK_MIN; };
    EXPECT_GT(std::count_if(f.messages.begin(), f.messages.end(), large), 100);
}

TEST(Mcap, MessagesFarIntoALargeChunkAreFoundByTheirIndex)
{
    Archive a(size_t(1) << 20);
    Given given = write_run(a, 200, 4000);
    ASSERT_EQ(mcap_close(&a.w), MCAP_OK);
    File f = parse(a.file);
    EXPECT_EQ(f.chunks.size(), 1u);
    EXPECT_GT(a.file.size(), 2u * 65536u);
    expect_whole(f, given, true, true);
}

TEST(Mcap, ARunWithoutMessagesIsAFile)
{
    for (size_t chunk_size : {size_t(0), MCAP_CHUNK_MIN}) {
        Archive a(chunk_size);
        ASSERT_EQ(a.open(), MCAP_OK);
        ASSERT_EQ(mcap_close(&a.w), MCAP_OK);
        EXPECT_TRUE(parse(a.file).messages.empty());
        EXPECT_EQ(mcap_close(&a.w), MCAP_CLOSED);
        EXPECT_EQ(mcap_metadata(&a.w, "late", nullptr, 0), MCAP_CLOSED);
    }
}

TEST(Mcap, AFlushEndsTheChunk)
{
    Archive a(1 << 16);
    Given given = write_run(a, 100, 120, [&](int i) {
        if (i % 10 == 9) {
            EXPECT_EQ(mcap_flush(&a.w), MCAP_OK);
            EXPECT_EQ(mcap_flush(&a.w), MCAP_OK); // of nothing: writes nothing
        }
    });
    ASSERT_EQ(mcap_close(&a.w), MCAP_OK);
    File f = parse(a.file);
    expect_whole(f, given, true, true);
    EXPECT_EQ(f.chunks.size(), 10u);
}

// What the disk has after a save in message i is the beginning of a file whose chunk ends there.
void expect_saved(const Archive &a, int n, int i, std::function<void(Archive &, int)> each)
{
    Archive flushed(a.chunk.size());
    bool same = false;
    write_run(flushed, n, 120, [&](int k) {
        each(flushed, k);
        if (k == i && mcap_flush(&flushed.w) == MCAP_OK) {
            same =
                a.disk.size() <= flushed.file.size() && std::equal(a.disk.begin(), a.disk.end(), flushed.file.begin());
        }
    });
    EXPECT_TRUE(same) << i;
}

TEST(Mcap, WhatIsSavedIsAWholeChunkAndChangesNoByteOfTheFile)
{
    const auto metadata = [](Archive &a, int i) {
        if (i % 20 == 19) { // in the place of the saved chunk, which moves
            mcap_metadata(&a.w, "late", RUN_PAIRS, 2);
        }
    };
    for (size_t chunk_size : {size_t(0), size_t(1500), size_t(1) << 20}) {
        Archive plain(chunk_size);
        write_run(plain, 60, 120, [&](int i) { metadata(plain, i); });
        ASSERT_EQ(mcap_close(&plain.w), MCAP_OK);
        for (int every : {1, 7}) {
            Archive a(chunk_size);
            write_run(a, 60, 120, [&](int i) {
                if (i % every == 0) {
                    ASSERT_EQ(mcap_save(&a.w), MCAP_OK);
                    metadata(a, i);
                    expect_saved(a, 60, i, metadata);
                } else {
                    metadata(a, i);
                }
            });
            ASSERT_EQ(mcap_close(&a.w), MCAP_OK);
            EXPECT_EQ(a.file, plain.file);
            EXPECT_EQ(a.disk, plain.file);
        }
    }
}

TEST(Mcap, AMarkIsOfTheBytesAlone)
{
    for (size_t chunk_size : {size_t(0), size_t(1500)}) {
        Archive a(chunk_size), b(chunk_size);
        std::vector<McapMark> marks;
        write_run(a, 60, 120, [&](int) {
            mcap_save(&a.w);
            marks.push_back(mcap_mark(&a.w));
        });
        write_run(b, 60, 120, [&](int i) {
            const McapMark mark = mcap_mark(&b.w), &same = marks[size_t(i)];
            EXPECT_EQ(std::tie(mark.position, mark.records, mark.crc), std::tie(same.position, same.records, same.crc));
            Bytes bytes = b.file;
            EXPECT_EQ(mark.position, bytes.size());
            if (chunk_size) {
                bytes.insert(bytes.end(), b.chunk.begin() + 49, b.chunk.begin() + 49 + ptrdiff_t(mark.records));
            }
            EXPECT_EQ(mark.crc, crc_bit_by_bit(bytes.data(), bytes.size()));
        });
    }
}

TEST(Mcap, TheBytesDependOnTheCallsAlone)
{
    for (size_t chunk_size : {size_t(0), size_t(1500)}) {
        Archive a(chunk_size, 4096, 0x00), b(chunk_size, 4096, 0xFF);
        write_run(a, 100);
        write_run(b, 100);
        mcap_close(&a.w);
        mcap_close(&b.w);
        EXPECT_EQ(a.file, b.file);
    }
}

TEST(Mcap, AFullIndexLeavesAFileToBeScanned)
{
    Archive whole(1500);
    write_run(whole, 200);
    mcap_close(&whole.w);
    const size_t needed = whole.w.index_used + whole.index.size() - whole.w.index_floor;
    for (size_t index_size = 0; index_size <= needed; index_size += index_size < 200 ? 1 : 37) {
        SCOPED_TRACE(index_size);
        Archive a(1500, index_size);
        Given given = write_run(a, 200);
        ASSERT_EQ(mcap_close(&a.w), MCAP_OK);
        EXPECT_TRUE(a.w.index_full);
        expect_whole(parse(a.file), given, true, false);
    }
    Archive enough(1500, needed);
    Given given = write_run(enough, 200);
    ASSERT_EQ(mcap_close(&enough.w), MCAP_OK);
    EXPECT_FALSE(enough.w.index_full);
    expect_whole(parse(enough.file), given, true, true);
}

TEST(Mcap, TheCdrHeadTellsTheByteOrder)
{
    Archive a(0);
    uint16_t schema, native, little, big;
    a.open();
    mcap_add_schema(&a.w, "fledge/msg/X", "uint32 x\n", &schema);
    mcap_add_channel(&a.w, "/native", schema, MCAP_ORDER_NATIVE, nullptr, 0, &native);
    mcap_add_channel(&a.w, "/little", schema, MCAP_ORDER_LITTLE, nullptr, 0, &little);
    mcap_add_channel(&a.w, "/big", schema, MCAP_ORDER_BIG, nullptr, 0, &big);
    const uint32_t word = 1;
    for (uint16_t channel : {native, little, big}) {
        ASSERT_EQ(mcap_message(&a.w, channel, 0, 0, &word, sizeof word), MCAP_OK);
    }
    mcap_close(&a.w);
    File f = parse(a.file);
    const Bytes given(reinterpret_cast<const uint8_t *>(&word), reinterpret_cast<const uint8_t *>(&word) + sizeof word);
    EXPECT_EQ(f.messages[0].payload, with_cdr_head(given, given[0] == 1));
    EXPECT_EQ(f.messages[1].payload, with_cdr_head(given, true));
    EXPECT_EQ(f.messages[2].payload, with_cdr_head(given, false));
}

// ---- what goes wrong ----

TEST(Mcap, RefusedCallsLeaveTheFileUntouched)
{
    for (size_t chunk_size : {size_t(0), MCAP_CHUNK_MIN}) {
        Archive plain(chunk_size), tried(chunk_size);
        Given given = write_run(plain, 20);
        write_run(tried, 20);
        McapWriter *w = &tried.w;
        uint16_t id = 0;
        const double x = 0.0;
        const McapPair no_value[] = {{"key", nullptr}};
        EXPECT_EQ(mcap_add_schema(w, nullptr, "", &id), MCAP_BAD_ARGUMENT);
        EXPECT_EQ(mcap_add_schema(w, "fledge/msg/AttError", "another text", &id), MCAP_BAD_ARGUMENT);
        EXPECT_EQ(mcap_add_schema(w, "fledge/msg/AttError", ERROR_TEXT, &id), MCAP_OK);
        EXPECT_EQ(id, 1);
        EXPECT_EQ(mcap_add_channel(w, "/x", 0, MCAP_ORDER_NATIVE, nullptr, 0, &id), MCAP_BAD_ARGUMENT);
        EXPECT_EQ(mcap_add_channel(w, "/x", 3, MCAP_ORDER_NATIVE, nullptr, 0, &id), MCAP_BAD_ARGUMENT);
        EXPECT_EQ(mcap_add_channel(w, "/x", 1, MCAP_ORDER_NATIVE, no_value, 1, &id), MCAP_BAD_ARGUMENT);
        EXPECT_EQ(mcap_add_channel(w, "/flight/tracking/error", 1, MCAP_ORDER_NATIVE, nullptr, 0, &id),
                  MCAP_BAD_ARGUMENT);
        EXPECT_EQ(mcap_message(w, 0, 0, 0, &x, 8), MCAP_BAD_ARGUMENT);
        EXPECT_EQ(mcap_message(w, 3, 0, 0, &x, 8), MCAP_BAD_ARGUMENT);
        EXPECT_EQ(mcap_message(w, given.error, -1, 0, &x, 8), MCAP_BAD_ARGUMENT);
        EXPECT_EQ(mcap_message(w, given.error, 0, 0, nullptr, 8), MCAP_BAD_ARGUMENT);
        EXPECT_EQ(mcap_metadata(w, nullptr, nullptr, 0), MCAP_BAD_ARGUMENT);
        if (chunk_size > 0) {
            EXPECT_EQ(mcap_add_schema(w, "fledge/msg/Long", std::string(2 * chunk_size, ' ').c_str(), &id),
                      MCAP_TOO_LARGE);
        }
        EXPECT_EQ(mcap_close(&plain.w), MCAP_OK);
        EXPECT_EQ(mcap_close(w), MCAP_OK);
        EXPECT_EQ(plain.file, tried.file);
    }
}

TEST(Mcap, AFullTableIsAnError)
{
    Archive a(0);
    a.schemas.resize(1);
    a.channels.resize(1);
    uint16_t id;
    a.open();
    EXPECT_EQ(mcap_add_schema(&a.w, "a", "", &id), MCAP_OK);
    EXPECT_EQ(mcap_add_schema(&a.w, "b", "", &id), MCAP_FULL);
    EXPECT_EQ(mcap_add_channel(&a.w, "/a", 1, MCAP_ORDER_NATIVE, nullptr, 0, &id), MCAP_OK);
    EXPECT_EQ(mcap_add_channel(&a.w, "/b", 1, MCAP_ORDER_NATIVE, nullptr, 0, &id), MCAP_FULL);
    EXPECT_EQ(mcap_close(&a.w), MCAP_OK);
    EXPECT_EQ(parse(a.file).channels.size(), 1u);
}

TEST(Mcap, AnUnusableConfigurationOpensNothing)
{
    Archive a(MCAP_CHUNK_MIN);
    auto refuses = [&](auto &&change) {
        McapConfig c = a.config();
        change(c);
        return mcap_open(&a.w, &c) == MCAP_BAD_ARGUMENT && mcap_close(&a.w) == MCAP_CLOSED && a.file.empty();
    };
    EXPECT_TRUE(refuses([](McapConfig &c) { c.write = nullptr; }));
    EXPECT_TRUE(refuses([](McapConfig &c) { c.chunk = nullptr; }));
    EXPECT_TRUE(refuses([](McapConfig &c) { c.chunk_size = MCAP_CHUNK_MIN - 1; }));
    EXPECT_TRUE(refuses([](McapConfig &c) { c.chunk_size = MCAP_CHUNK_MAX + 1; }));
    EXPECT_TRUE(refuses([](McapConfig &c) { c.index = nullptr; }));
    EXPECT_TRUE(refuses([](McapConfig &c) { c.channels = nullptr; }));
}

TEST(Mcap, ASinkThatFailsAtAnyByteIsReportedAndLeftAlone)
{
    for (size_t chunk_size : {size_t(0), MCAP_CHUNK_MIN}) {
        Archive whole(chunk_size);
        write_run(whole, 30);
        ASSERT_EQ(mcap_close(&whole.w), MCAP_OK);
        for (size_t room = 0; room < whole.file.size(); room++) {
            Archive a(chunk_size);
            a.room = room;
            write_run(a, 30);
            ASSERT_EQ(mcap_close(&a.w), MCAP_WRITE_FAILED) << room;
            ASSERT_EQ(mcap_close(&a.w), MCAP_WRITE_FAILED) << room;
            ASSERT_EQ(mcap_flush(&a.w), MCAP_WRITE_FAILED) << room;
            ASSERT_EQ(mcap_save(&a.w), MCAP_WRITE_FAILED) << room;
            ASSERT_EQ(a.w.sink_error, ENOSPC) << room;
            ASSERT_EQ(a.calls_after_failure, 0) << room;
            ASSERT_EQ(a.file.size(), room);
            ASSERT_TRUE(std::equal(a.file.begin(), a.file.end(), whole.file.begin())) << room;
        }
    }
}

TEST(Mcap, ASaveThatFailsIsReportedAndTheSinkLeftAlone)
{
    Archive a(1 << 16);
    a.room = 1000;
    int saved = 0;
    write_run(a, 60, 120, [&](int) { saved += mcap_save(&a.w) == MCAP_OK ? 1 : 0; });
    EXPECT_GT(saved, 3);
    EXPECT_EQ(mcap_close(&a.w), MCAP_WRITE_FAILED);
    EXPECT_EQ(a.w.sink_error, ENOSPC);
    EXPECT_EQ(a.calls_after_failure, 0);
    EXPECT_LE(a.disk.size(), a.room);
}

TEST(Mcap, TheHeapIsNeverTouched)
{
    for (size_t chunk_size : {size_t(0), MCAP_CHUNK_MIN}) {
        Archive a(chunk_size, 1 << 15);
        a.file.reserve(1 << 20);
        McapConfig config = a.config();
        const double x[3] = {1, 2, 3};
        uint16_t schema, channel;
        const long before = heap_calls;
        mcap_open(&a.w, &config);
        mcap_add_schema(&a.w, "fledge/msg/AttError", ERROR_TEXT, &schema);
        mcap_add_channel(&a.w, "/error", schema, MCAP_ORDER_NATIVE, ERROR_PAIRS, 2, &channel);
        mcap_metadata(&a.w, "run", RUN_PAIRS, 2);
        for (int i = 0; i < 1000; i++) {
            mcap_message(&a.w, channel, i, 0, x, sizeof x);
        }
        mcap_close(&a.w);
        EXPECT_EQ(heap_calls, before);
        EXPECT_EQ(parse(a.file).messages.size(), 1000u);
    }
    const long before = heap_calls;
    void *volatile p = std::malloc(1); // the counter does count
    std::free(p);
    EXPECT_EQ(heap_calls, before + 1);
}

TEST(Mcap, EveryStatusHasWords)
{
    for (int s = MCAP_OK; s <= MCAP_CLOSED; s++) {
        EXPECT_STRNE(mcap_status_text(McapStatus(s)), "unknown status");
    }
}

// ---- the file sink ----

class FileSinkTest : public ::testing::Test {
protected:
    void SetUp() override
    {
        std::string pattern = (std::filesystem::temp_directory_path() / "mcap-XXXXXX").string();
        ASSERT_NE(mkdtemp(pattern.data()), nullptr);
        folder = pattern;
        name = (folder / "run.mcap").string();
    }

    void TearDown() override { std::filesystem::remove_all(folder); }

    static std::string content(const std::string &path)
    {
        std::ifstream f(path, std::ios::binary);
        return std::string(std::istreambuf_iterator<char>(f), {});
    }

    std::filesystem::path folder;
    std::string name;
    FileSink sink;
};

TEST_F(FileSinkTest, NamesTheFileOnceItIsWhole)
{
    std::ofstream(name) << "older run";
    ASSERT_EQ(file_sink_open(&sink, name.c_str()), 0);
    EXPECT_EQ(file_sink_write(&sink, "abc", 3), 0);
    EXPECT_EQ(file_sink_write(&sink, "de", 2), 0);
    EXPECT_EQ(content(name), "older run");
    EXPECT_EQ(file_sink_close(&sink, true), 0);
    EXPECT_EQ(content(name), "abcde");
    EXPECT_FALSE(std::filesystem::exists(name + ".part"));
}

TEST_F(FileSinkTest, BytesAheadStayInThePartAndAreReplaced)
{
    ASSERT_EQ(file_sink_open(&sink, name.c_str()), 0);
    EXPECT_EQ(file_sink_write(&sink, "abc", 3), 0);
    EXPECT_EQ(file_sink_ahead(&sink, 2, "fgh", 3), 0);
    EXPECT_EQ(file_sink_ahead(&sink, 0, "de", 2), 0);
    EXPECT_EQ(content(name + ".part"), "abcdefgh");
    EXPECT_EQ(file_sink_write(&sink, "DEFGHI", 6), 0);
    EXPECT_EQ(file_sink_close(&sink, true), 0);
    EXPECT_EQ(content(name), "abcDEFGHI");
}

TEST_F(FileSinkTest, KeepsThePartOfARunThatWasGivenUp)
{
    ASSERT_EQ(file_sink_open(&sink, name.c_str()), 0);
    EXPECT_EQ(file_sink_write(&sink, "abc", 3), 0);
    EXPECT_EQ(file_sink_close(&sink, false), 0);
    EXPECT_FALSE(std::filesystem::exists(name));
    EXPECT_EQ(content(name + ".part"), "abc");
}

TEST_F(FileSinkTest, KeepsThePartWhenTheDiskIsFull)
{
    // A limit on the file's size is a full disk that needs no privileges.
    rlimit old{};
    getrlimit(RLIMIT_FSIZE, &old);
    auto old_handler = std::signal(SIGXFSZ, SIG_IGN);
    ASSERT_EQ(file_sink_open(&sink, name.c_str()), 0);
    rlimit small{4096, old.rlim_max};
    setrlimit(RLIMIT_FSIZE, &small);
    const std::string block(3000, 'x');
    EXPECT_EQ(file_sink_write(&sink, block.data(), block.size()), 0);
    EXPECT_EQ(file_sink_write(&sink, block.data(), block.size()), EFBIG);
    setrlimit(RLIMIT_FSIZE, &old);
    std::signal(SIGXFSZ, old_handler);
    EXPECT_EQ(file_sink_write(&sink, "y", 1), EFBIG);
    EXPECT_EQ(file_sink_close(&sink, true), EFBIG);
    EXPECT_FALSE(std::filesystem::exists(name));
    EXPECT_EQ(content(name + ".part"), std::string(4096, 'x'));
}

TEST_F(FileSinkTest, GoesOnBehindAMarkOfAProgramThatEnded)
{
    const std::string first(10'000, 'a'), second(5'000, 'b');
    FileMark early, late, again;
    ASSERT_EQ(file_sink_open(&sink, name.c_str()), 0);
    EXPECT_EQ(file_sink_write(&sink, first.data(), first.size()), 0);
    EXPECT_EQ(file_sink_mark(&sink, &early), 0);
    EXPECT_EQ(file_sink_write(&sink, second.data(), second.size()), 0);
    EXPECT_EQ(file_sink_mark(&sink, &late), 0);
    EXPECT_EQ(file_sink_write(&sink, "lost", 4), 0);
    FileSink other;
    EXPECT_EQ(file_sink_resume(&other, name.c_str(), late), EBUSY);
    EXPECT_EQ(file_sink_close(&sink, false), 0);

    ASSERT_EQ(file_sink_resume(&sink, name.c_str(), late), 0);
    EXPECT_EQ(content(name + ".part"), first + second);
    EXPECT_EQ(file_sink_mark(&sink, &again), 0);
    EXPECT_EQ(std::memcmp(&again, &late, sizeof late), 0);
    EXPECT_EQ(file_sink_close(&sink, false), 0);

    ASSERT_EQ(file_sink_resume(&sink, name.c_str(), early), 0);
    EXPECT_EQ(file_sink_write(&sink, "c", 1), 0);
    EXPECT_EQ(file_sink_close(&sink, true), 0);
    EXPECT_EQ(content(name), first + "c");
}

TEST_F(FileSinkTest, GoesOnWithNoOtherFile)
{
    ASSERT_EQ(file_sink_open(&sink, name.c_str()), 0);
    EXPECT_EQ(file_sink_write(&sink, "abc", 3), 0);
    FileMark mark;
    EXPECT_EQ(file_sink_mark(&sink, &mark), 0);
    EXPECT_EQ(file_sink_close(&sink, false), 0);
    for (const char *other : {"abd and more", "ab", ""}) {
        std::ofstream(name + ".part") << other;
        EXPECT_EQ(file_sink_resume(&sink, name.c_str(), mark), ENODATA) << other;
        EXPECT_EQ(content(name + ".part"), other);
    }
    std::filesystem::remove(name + ".part");
    EXPECT_EQ(file_sink_resume(&sink, name.c_str(), mark), ENOENT);
}

TEST_F(FileSinkTest, OneSinkAtATimeWritesAFile)
{
    ASSERT_EQ(file_sink_open(&sink, name.c_str()), 0);
    FileSink second;
    EXPECT_EQ(file_sink_open(&second, name.c_str()), EBUSY);
    EXPECT_EQ(file_sink_write(&second, "xyz", 3), EBUSY);
    EXPECT_EQ(file_sink_close(&second, true), EBUSY);
    EXPECT_EQ(file_sink_write(&sink, "abc", 3), 0);
    EXPECT_EQ(file_sink_close(&sink, true), 0);
    EXPECT_EQ(content(name), "abc");
    EXPECT_EQ(file_sink_open(&second, name.c_str()), 0);
    file_sink_close(&second, false);
}

TEST_F(FileSinkTest, OfManySinksAtOnceOneWritesAndNoneDisturbsIt)
{
    for (int round = 0; round < 20; round++) {
        std::ofstream(name + ".part") << "of a program that was killed";
        std::barrier all(4);
        std::atomic<int> writers = 0;
        std::vector<std::thread> threads;
        for (int i = 0; i < 4; i++) {
            threads.emplace_back([&, i] {
                FileSink own;
                all.arrive_and_wait();
                const int error = file_sink_open(&own, name.c_str());
                all.arrive_and_wait();
                if (error != 0) {
                    EXPECT_TRUE(error == EBUSY || error == ESTALE) << error;
                    return;
                }
                writers++;
                const std::string text(1000, static_cast<char>('a' + i));
                EXPECT_EQ(file_sink_write(&own, text.data(), text.size()), 0);
                EXPECT_EQ(file_sink_close(&own, true), 0);
            });
        }
        for (auto &thread : threads) {
            thread.join();
        }
        EXPECT_EQ(writers, 1);
        const std::string whole = content(name);
        EXPECT_EQ(whole, std::string(1000, whole.empty() ? '?' : whole[0]));
        EXPECT_FALSE(std::filesystem::exists(name + ".part"));
    }
}

TEST_F(FileSinkTest, ThePartOfALostProgramIsReplacedNotEmptied)
{
    std::ofstream(name + ".part") << "lost";
    std::filesystem::create_hard_link(name + ".part", name + ".kept");
    ASSERT_EQ(file_sink_open(&sink, name.c_str()), 0);
    EXPECT_EQ(file_sink_write(&sink, "new", 3), 0);
    EXPECT_EQ(file_sink_close(&sink, false), 0);
    EXPECT_EQ(content(name + ".part"), "new");
    EXPECT_EQ(content(name + ".kept"), "lost");
}

TEST_F(FileSinkTest, LinksAndOtherFilesAreNotWritten)
{
    const std::string other = (folder / "other").string();
    std::ofstream(other) << "precious";
    std::filesystem::create_symlink(other, name + ".part");
    EXPECT_EQ(file_sink_open(&sink, name.c_str()), ELOOP);
    std::filesystem::remove(name + ".part");
    ASSERT_EQ(mkfifo((name + ".part").c_str(), 0600), 0);
    EXPECT_EQ(file_sink_open(&sink, name.c_str()), ENXIO);
    std::filesystem::remove(name + ".part");
    std::filesystem::create_symlink(other, name); // replaced, not followed
    ASSERT_EQ(file_sink_open(&sink, name.c_str()), 0);
    EXPECT_EQ(file_sink_write(&sink, "new", 3), 0);
    EXPECT_EQ(file_sink_close(&sink, true), 0);
    EXPECT_EQ(content(name), "new");
    EXPECT_EQ(content(other), "precious");
}

TEST_F(FileSinkTest, APartThatIsTakenAwayIsNotRenamed)
{
    ASSERT_EQ(file_sink_open(&sink, name.c_str()), 0);
    EXPECT_EQ(file_sink_write(&sink, "abc", 3), 0);
    std::filesystem::remove(name + ".part");
    FileSink second;
    ASSERT_EQ(file_sink_open(&second, name.c_str()), 0);
    EXPECT_EQ(file_sink_close(&sink, true), ESTALE);
    EXPECT_FALSE(std::filesystem::exists(name));
    EXPECT_EQ(file_sink_write(&second, "de", 2), 0);
    EXPECT_EQ(file_sink_close(&second, true), 0);
    EXPECT_EQ(content(name), "de");
}

TEST_F(FileSinkTest, AFileThatCannotBeCreatedGivesItsErrno)
{
    EXPECT_EQ(file_sink_open(&sink, (folder / "none" / "run.mcap").c_str()), ENOENT);
    EXPECT_EQ(file_sink_write(&sink, "abc", 3), ENOENT);
    EXPECT_EQ(file_sink_close(&sink, true), ENOENT);
    EXPECT_EQ(file_sink_open(&sink, ""), ENOENT);
    EXPECT_EQ(file_sink_open(&sink, std::string(5000, 'x').c_str()), ENAMETOOLONG);
}

TEST_F(FileSinkTest, KeepsThePartWhereAFolderHasTheName)
{
    ASSERT_EQ(file_sink_open(&sink, name.c_str()), 0);
    EXPECT_EQ(file_sink_write(&sink, "abc", 3), 0);
    std::filesystem::create_directory(name);
    EXPECT_EQ(file_sink_close(&sink, true), EISDIR);
    EXPECT_EQ(content(name + ".part"), "abc");
}

TEST_F(FileSinkTest, ANameFitsWithItsSuffixOrIsRefused)
{
    struct {
        FileSink sink;
        char after[16];
    } memory = {{}, "not overwritten"};
    const auto of_length = [&](std::size_t n) {
        const std::string start = folder.string(), end = "run.mcap";
        return start + std::string(n - start.size() - end.size(), '/') + end;
    };
    const std::size_t longest = sizeof memory.sink.part - sizeof ".part";
    EXPECT_EQ(file_sink_open(&memory.sink, of_length(longest).c_str()), 0);
    EXPECT_EQ(file_sink_close(&memory.sink, true), 0);
    EXPECT_TRUE(std::filesystem::exists(name));
    for (const std::size_t n : {longest + 1, longest + sizeof ".part", longest + 2 * sizeof ".part"}) {
        EXPECT_EQ(file_sink_open(&memory.sink, of_length(n).c_str()), ENAMETOOLONG);
        EXPECT_STREQ(memory.after, "not overwritten");
    }
    EXPECT_FALSE(std::filesystem::exists(name + ".part"));
}

} // namespace mcap_test
