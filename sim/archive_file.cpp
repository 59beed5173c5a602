// SPDX-License-Identifier: Apache-2.0
#include "sim/archive_file.h"

#include "record/file_sink.h"
#include "sim/error.h"

#include <cerrno>
#include <cstring>
#include <ctime>
#include <deque>
#include <fcntl.h>
#include <map>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

namespace fledge::sim {

namespace {

constexpr std::size_t chunk_size = std::size_t{1} << 20;
constexpr std::size_t chunks_indexed = 4096; // 4 GiB; beyond, readers scan

/// The same pairs in the type of the writer, which points to the texts.
std::vector<McapPair> as_pairs(const Pairs &pairs)
{
    std::vector<McapPair> list;
    for (const auto &[key, value] : pairs) {
        list.push_back({key.c_str(), value.c_str()});
    }
    return list;
}

/// A failure of the file in words.
std::string in_words(int error, const std::string &part)
{
    switch (error) {
    case EBUSY: return "another run writes " + part + " now; let it end, or choose another folder";
    case ELOOP: return part + " is a symbolic link, which is not followed; delete it";
    case EEXIST: return part + " is no regular file; delete it";
    case ESTALE: return part + " was deleted or replaced during the run";
    case EFBIG: return "the file would exceed the limit on its size (ulimit -f, or the file system's)";
    default: return std::strerror(error);
    }
}

// Of MCAP: https://mcap.dev/spec
constexpr std::size_t magic = 8, record_head = 9, chunk_head = 49, message_head = 26;
constexpr std::uint8_t schema_op = 0x03, channel_op = 0x04, message_op = 0x05, chunk_op = 0x06, metadata_op = 0x0C;

/// A file that is read as memory; empty if it cannot be.
class Mapped {
public:
    explicit Mapped(const std::string &path)
    {
        const int fd = open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
        struct stat about {};
        if (fd >= 0 && fstat(fd, &about) == 0 && S_ISREG(about.st_mode) && about.st_size > 0) {
            const auto size = static_cast<std::size_t>(about.st_size);
            void *at = mmap(nullptr, size, PROT_READ, MAP_PRIVATE, fd, 0);
            if (at != MAP_FAILED) {
                bytes = {static_cast<const std::uint8_t *>(at), size};
            }
        }
        if (fd >= 0) {
            ::close(fd);
        }
    }
    ~Mapped()
    {
        if (!bytes.empty()) {
            munmap(const_cast<std::uint8_t *>(bytes.data()), bytes.size());
        }
    }
    Mapped(const Mapped &) = delete;
    Mapped &operator=(const Mapped &) = delete;

    std::span<const std::uint8_t> bytes;
};

std::uint64_t number(const std::uint8_t *at, std::size_t n)
{
    std::uint64_t value = 0;
    while (n--) {
        value = value << 8 | at[n];
    }
    return value;
}

/// Where the chunk begins that was not complete at the mark: behind metadata that came later.
std::size_t chunk_at(std::span<const std::uint8_t> bytes, const McapMark &mark)
{
    std::size_t at = mark.position;
    while (bytes.size() - at > record_head && bytes[at] == metadata_op) {
        at += record_head + std::min<std::size_t>(number(&bytes[at + 1], 8), bytes.size() - at - record_head);
    }
    return at;
}

bool begins_with(std::span<const std::uint8_t> bytes, const McapMark &mark)
{
    if (mark.position < magic || mark.position > bytes.size()) {
        return false;
    }
    const std::size_t chunk = chunk_at(bytes, mark);
    if (mark.records && (bytes.size() - chunk < chunk_head || mark.records > bytes.size() - chunk - chunk_head)) {
        return false;
    }
    McapCrc tables;
    mcap_crc_init(&tables);
    std::uint32_t crc = mcap_crc_update(&tables, 0, bytes.data(), mark.position);
    if (mark.records) {
        crc = mcap_crc_update(&tables, crc, bytes.data() + chunk + chunk_head, mark.records);
    }
    return crc == mark.crc;
}

std::string text(const std::uint8_t *&at)
{
    const std::size_t n = number(at, 4);
    at += 4 + n;
    return {at - n, at};
}

} // namespace

struct ArchiveFile::Memory {
    FileSink sink{};
    bool open = true;
    std::vector<McapSchema> schemas;
    std::vector<McapChannel> channels;
    std::vector<std::uint8_t> chunk, index;
    std::deque<std::string> texts; ///< whose addresses do not change
    std::deque<Pairs> pairs;
    std::deque<std::vector<McapPair>> pointers;                         ///< into pairs
    std::map<std::string, std::uint16_t> topics;                        ///< their channels
    std::map<std::uint64_t, std::pair<std::string, std::string>> found; ///< schemas of a lost file: type, text

    const char *keep(std::string text) { return texts.emplace_back(std::move(text)).c_str(); }
    int finish(bool whole)
    {
        open = false;
        return file_sink_close(&sink, whole);
    }
};

ArchiveFile::ArchiveFile(std::string path, std::size_t channels)
    : path_(std::move(path)), memory_(std::make_unique<Memory>())
{
    Memory &m = *memory_;
    m.schemas.resize(channels);
    m.channels.resize(channels);
    m.chunk.resize(chunk_size);
    m.index.resize(chunks_indexed * (73 + 10 * channels) + 1024);
    if (const int error = file_sink_open(&m.sink, path_.c_str())) {
        throw RunError("cannot write " + path_ + ": " + in_words(error, m.sink.part));
    }
    McapConfig config{};
    config.write = file_sink_write;
    config.ahead = file_sink_ahead;
    config.user = &m.sink;
    config.schemas = m.schemas.data();
    config.channels = m.channels.data();
    config.schemas_max = config.channels_max = static_cast<std::uint16_t>(channels);
    config.chunk = m.chunk.data();
    config.chunk_size = m.chunk.size();
    config.index = m.index.data();
    config.index_size = m.index.size();
    require(mcap_open(&writer_, &config));
}

ArchiveFile::~ArchiveFile()
{
    if (memory_->open) {
        mcap_flush(&writer_);
        memory_->finish(false);
    }
}

void ArchiveFile::metadata(const std::string &name, const Pairs &pairs)
{
    const std::vector<McapPair> list = as_pairs(pairs);
    require(mcap_metadata(&writer_, name.c_str(), list.data(), list.size()));
}

std::uint16_t ArchiveFile::add_channel(const std::string &topic, const std::string &type, const std::string &schema,
                                       const Pairs &pairs)
{
    Memory &m = *memory_;
    if (const auto known = m.topics.find(topic); known != m.topics.end()) {
        return known->second;
    }
    const Pairs &lasting = m.pairs.emplace_back(pairs);
    const std::vector<McapPair> &pointers = m.pointers.emplace_back(as_pairs(lasting));
    std::uint16_t type_id = 0, id = 0;
    require(mcap_add_schema(&writer_, m.keep("fledge/msg/" + type), m.keep(schema), &type_id));
    require(
        mcap_add_channel(&writer_, m.keep(topic), type_id, MCAP_ORDER_NATIVE, pointers.data(), pointers.size(), &id));
    m.topics[topic] = id;
    return id;
}

void ArchiveFile::close()
{
    require(mcap_close(&writer_));
    if (const int error = memory_->finish(true)) {
        const std::string part = memory_->sink.part;
        throw RunError("cannot finish " + path_ + ": " + in_words(error, part) +
                       (error == ESTALE ? "" : "; what was written is in " + part));
    }
}

// The coarse clock costs a message some 5 ns.
std::int64_t ArchiveFile::seconds()
{
    timespec now{};
    clock_gettime(CLOCK_MONOTONIC_COARSE, &now);
    return now.tv_sec;
}

McapMark ArchiveFile::save()
{
    saved_ = seconds();
    require(mcap_save(&writer_));
    return mcap_mark(&writer_);
}

bool ArchiveFile::lost(const std::string &path, const McapMark &mark)
{
    // NAME.lost: the program that began to take it over was killed, too.
    const std::string here = path + ".lost", part = path + ".part";
    return begins_with(Mapped(here).bytes, mark) ||
           (begins_with(Mapped(part).bytes, mark) && std::rename(part.c_str(), here.c_str()) == 0);
}

void ArchiveFile::take_over(const McapMark &mark)
{
    const Mapped file(path_ + ".lost");
    if (!begins_with(file.bytes, mark)) {
        throw RunError(path_ + ".lost was deleted or changed while it was read");
    }
    copy(file.bytes.subspan(magic, mark.position - magic));
    if (mark.records) {
        copy(file.bytes.subspan(chunk_at(file.bytes, mark) + chunk_head, mark.records));
    }
    const McapMark own = save();
    if (own.position != mark.position || own.records != mark.records || own.crc != mark.crc) {
        throw RunError("cannot go on with the record of the lost program in " + path_ +
                       ".lost: this program records other topics; start the one that was lost");
    }
    unlink((path_ + ".lost").c_str());
}

/// Whole records, which this writer has written: their checksum is right.
void ArchiveFile::copy(std::span<const std::uint8_t> records)
{
    for (std::size_t n = 0; !records.empty(); records = records.subspan(record_head + n)) {
        n = number(records.data() + 1, 8);
        const std::uint8_t *at = records.data() + record_head, *end = at + n;
        if (records[0] == chunk_op) {
            copy({at + chunk_head - record_head, end});
        } else if (records[0] == schema_op) {
            const std::uint64_t id = number(at, 2);
            at += 2;
            const std::string name = text(at);
            text(at); // the encoding
            memory_->found[id] = {name.substr(name.rfind('/') + 1), text(at)};
        } else if (records[0] == channel_op) {
            const auto &[type, schema] = memory_->found[number(at + 2, 2)];
            at += 4;
            add_channel(text(at), type, schema);
        } else if (records[0] == message_op) {
            require(mcap_message(&writer_, static_cast<std::uint16_t>(number(at, 2)),
                                 static_cast<std::int64_t>(number(at + 6, 8)),
                                 static_cast<std::uint32_t>(number(at + 2, 4)), at + message_head,
                                 static_cast<std::size_t>(end - at) - message_head));
        } else if (records[0] == metadata_op) {
            const std::string name = text(at);
            Pairs pairs;
            for (at += 4; at < end;) {
                std::string key = text(at);
                pairs.emplace_back(std::move(key), text(at));
            }
            metadata(name, pairs);
        }
    }
}

/// The file could not be written: leave the readable part, and throw.
void ArchiveFile::abandon(McapStatus status)
{
    mcap_flush(&writer_);
    const Memory &m = *memory_;
    const std::string part = m.sink.part;
    const std::string reason = m.sink.error ? in_words(m.sink.error, part) : mcap_status_text(status);
    memory_->finish(false);
    throw RunError("cannot write " + path_ + ": " + reason + "; what was written before is in " + part);
}

} // namespace fledge::sim
