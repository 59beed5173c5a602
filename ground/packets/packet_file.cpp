// SPDX-License-Identifier: Apache-2.0
#include "ground/packets/packet_file.h"

#include <cerrno>
#include <cinttypes>
#include <cstdio>
#include <cstring>
#include <fcntl.h>
#include <optional>
#include <sys/stat.h>
#include <unistd.h>

namespace fledge::ground {

namespace {

constexpr std::size_t message_head = 22, cdr = 4, footer = record::prefix + 20 + record::magic.size();
constexpr std::uint64_t most_chunk = std::uint64_t{1} << 26, most_summary = std::uint64_t{1} << 28;

std::int64_t time(record::Fields &fields)
{
    return static_cast<std::int64_t>(fields.integer(8));
}

} // namespace

std::string hash_text(const Database &database)
{
    char text[17];
    std::snprintf(text, sizeof text, "%016" PRIx64, database.hash);
    return text;
}

PacketFile::PacketFile(std::string name) : path(std::move(name))
{
    open();
    const auto begin = read(0, record::magic.size(), buffer_);
    if (!std::equal(begin.begin(), begin.end(), record::magic.begin())) { // a new file may have no byte yet
        close();
        throw Refusal(path + " is no MCAP file");
    }
    scanned_ = record::magic.size();
    bool has_summary = false;
    try {
        has_summary = read_summary();
    } catch (const record::Damage &) { // then the records before the summary are read
    }
    if (!has_summary) {
        channels.clear(), chunks.clear(), metadata.clear();
        count = 0;
        scan();
    }
}

void PacketFile::open()
{
    if (fd_ < 0) {
        fd_ = ::open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    }
    struct stat about {};
    if (fd_ < 0 || fstat(fd_, &about) != 0 || !S_ISREG(about.st_mode)) {
        const std::string why = fd_ < 0 ? std::strerror(errno) : "it is no regular file";
        close();
        throw Refusal("cannot read " + path + ": " + why);
    }
    size_ = static_cast<std::uint64_t>(about.st_size);
}

void PacketFile::close()
{
    if (fd_ >= 0) {
        ::close(fd_);
        fd_ = -1;
    }
    std::vector<std::uint8_t>().swap(buffer_); // there are many files
}

/// Read n bytes, or fewer at the end of the file.
std::span<const std::uint8_t> PacketFile::read(std::uint64_t at, std::uint64_t n, std::vector<std::uint8_t> &into) const
{
    n = at < size_ ? std::min(n, size_ - at) : 0;
    into.resize(std::max<std::size_t>(into.size(), n));
    std::size_t done = 0;
    while (done < n) {
        const ssize_t got = pread(fd_, into.data() + done, n - done, static_cast<off_t>(at + done));
        if (got < 0 && errno != EINTR) {
            throw Refusal("cannot read " + path + ": " + std::strerror(errno));
        }
        if (got == 0) {
            break;
        }
        done += got > 0 ? static_cast<std::size_t>(got) : 0;
    }
    return {into.data(), done};
}

void PacketFile::damaged(std::uint64_t at, std::int64_t from, std::int64_t to, const std::string &problem)
{
    const std::string why = path + " is damaged at byte " + std::to_string(at) + ": " + problem;
    if (std::none_of(missing.begin(), missing.end(), [&](const Missing &gap) { return gap.why == why; })) {
        missing.push_back({from, to, why});
    }
}

std::span<const std::uint8_t> PacketFile::records(const Chunk &chunk)
{
    open();
    const auto bytes = read(chunk.at, record::chunk_head + (chunk.ended ? chunk.size : most_chunk), buffer_);
    const std::uint8_t *const p = bytes.data();
    if (bytes.size() < record::chunk_head || *p != record::op_chunk) {
        damaged(chunk.at, chunk.first, chunk.last, "there is no chunk");
        return {};
    }
    const auto inside = bytes.subspan(record::chunk_head);
    if (!chunk.ended) {
        return inside;
    }
    const std::uint64_t stated = record::number(p + 33, 4);
    const char *const problem = inside.size() < chunk.size || record::number(p + 41, 8) != chunk.size
                                    ? "the chunk has another size"
                                : record::number(p + 37, 4) != 0 ? "the chunk is compressed, which is not read here"
                                : stated != 0 && record::crc(inside) != stated ? "the checksum of the chunk is wrong"
                                                                               : nullptr;
    if (problem != nullptr) {
        damaged(chunk.at, chunk.first, chunk.last, problem);
        return {};
    }
    return inside;
}

/// Read the record at a place; its channel is 0 if it is no packet. Returns false at the end of the readable bytes.
bool PacketFile::next(std::span<const std::uint8_t> bytes, std::size_t &at, Stored &stored)
{
    if (bytes.size() - at < record::prefix) {
        return false;
    }
    const std::uint8_t *const p = bytes.data() + at;
    const std::uint64_t n = record::number(p + 1, 8);
    if ((*p != record::op_schema && *p != record::op_channel && *p != record::op_message) ||
        n > bytes.size() - at - record::prefix) {
        return false;
    }
    at += record::prefix + n;
    stored.channel = 0;
    if (*p == record::op_message && n >= message_head + cdr + packet_at) {
        const std::uint8_t *const content = p + record::prefix + message_head + cdr;
        const std::size_t size = n - message_head - cdr - packet_at;
        if (content[-3] == 1 && record::number(content + 16, 4) == size) { // little-endian
            stored = {static_cast<std::int64_t>(record::number(content, 8)),
                      static_cast<std::int64_t>(record::number(content + 8, 8)),
                      static_cast<std::uint16_t>(record::number(p + record::prefix, 2)),
                      {content + packet_at, size}};
        }
    } else if (*p == record::op_channel) {
        record::Fields fields{{p + record::prefix, n}};
        try {
            const auto id = static_cast<std::uint16_t>(fields.integer(2));
            fields.take(2);
            channels.try_emplace(id, Channel{fields.text()});
        } catch (const record::Damage &) { // its packets count as undecoded
        }
    }
    return true;
}

void PacketFile::read_metadata(std::span<const std::uint8_t> content)
{
    record::Fields fields{content};
    std::string name = fields.text();
    const record::Pairs pairs = fields.pairs();
    metadata.emplace_back(std::move(name), Metadata::value_type::second_type(pairs.begin(), pairs.end()));
}

/// The records of the summary, with the footer up to its checksum; none if the file has no end.
std::span<const std::uint8_t> PacketFile::summary(std::vector<std::uint8_t> &into) const
{
    std::vector<std::uint8_t> memory;
    const auto end =
        size_ < record::magic.size() + footer ? std::span<const std::uint8_t>() : read(size_ - footer, footer, memory);
    if (end.size() < footer || end[0] != record::op_footer || record::number(end.data() + 1, 8) != 20 ||
        !std::ranges::equal(end.subspan(record::prefix + 20), record::magic)) {
        return {};
    }
    const std::uint64_t begin = record::number(end.data() + record::prefix, 8);
    if (begin == 0 || begin > size_ - footer || size_ - begin > most_summary) {
        throw record::Damage{0, "there is no summary where the footer says"};
    }
    const auto all = read(begin, size_ - begin - 4 - record::magic.size(), into);
    const std::uint64_t stated = record::number(end.data() + record::prefix + 16, 4);
    if (stated != 0 && record::crc(all) != stated) {
        throw record::Damage{0, "the checksum of the summary is wrong"};
    }
    return all;
}

/// Returns the number of chunks.
std::uint64_t PacketFile::take_statistics(record::Fields &fields)
{
    count = fields.integer(8);
    fields.take(2 + 3 * 4);
    const std::uint64_t n_chunks = fields.integer(4);
    first = time(fields);
    last = time(fields);
    for (record::Fields counts{fields.take(fields.integer(4))}; !counts.rest.empty();) {
        const auto id = static_cast<std::uint16_t>(counts.integer(2));
        channels[id].count = counts.integer(8);
    }
    return n_chunks;
}

void PacketFile::take_chunk_index(record::Fields &fields)
{
    Chunk chunk;
    chunk.first = time(fields);
    chunk.last = time(fields);
    chunk.at = fields.integer(8);
    chunk.size = fields.integer(8) - record::chunk_head;
    for (record::Fields ids{fields.take(fields.integer(4))}; !ids.rest.empty(); ids.take(8)) {
        chunk.channels.push_back(static_cast<std::uint16_t>(ids.integer(2)));
    }
    if (chunk.size > most_chunk || chunk.at > size_ || chunk.size + record::chunk_head > size_ - chunk.at) {
        throw record::Damage{0, "a chunk lies outside of the file"};
    }
    chunk.ended = true;
    chunks.push_back(std::move(chunk));
}

void PacketFile::take_metadata_index(record::Fields &fields)
{
    const std::uint64_t at = fields.integer(8), n = fields.integer(8);
    if (n > most_summary) {
        throw record::Damage{0, "metadata are too long"};
    }
    std::vector<std::uint8_t> memory;
    record::Fields record{read(at, n, memory)};
    if (record.integer(1) != record::op_metadata) {
        throw record::Damage{0, "there are no metadata where the index says"};
    }
    read_metadata(record.take(record.integer(8)));
}

bool PacketFile::read_summary()
{
    std::vector<std::uint8_t> bytes;
    std::optional<std::uint64_t> n_chunks;
    for (record::Fields rest{summary(bytes)}; rest.rest.size() > footer - 4 - record::magic.size();) {
        const auto op = static_cast<std::uint8_t>(rest.integer(1));
        record::Fields fields{rest.take(rest.integer(8))};
        if (op == record::op_channel) {
            const auto id = static_cast<std::uint16_t>(fields.integer(2));
            fields.take(2);
            channels[id].topic = fields.text();
        } else if (op == record::op_statistics) {
            n_chunks = take_statistics(fields);
        } else if (op == record::op_chunk_index) {
            take_chunk_index(fields);
        } else if (op == record::op_metadata_index) {
            take_metadata_index(fields);
        }
    }
    whole = n_chunks == chunks.size(); // not as if the memory for the index was full
    return whole;
}

void PacketFile::refresh()
{
    open();
    if (!whole) {
        scan();
    }
}

/// Whether a chunk begins there that has packets but no head yet: the writer writes the head last.
bool PacketFile::is_unsaved(std::uint64_t at) const
{
    std::vector<std::uint8_t> memory;
    const auto bytes = read(at, record::chunk_head + 1, memory);
    return bytes.size() == record::chunk_head + 1 && bytes.back() >= record::op_schema &&
           bytes.back() <= record::op_message &&
           std::all_of(bytes.begin(), bytes.end() - 1, [](std::uint8_t byte) { return byte == 0; });
}

/// The chunk with this head, where the scan is.
PacketFile::Chunk PacketFile::chunk_of(std::span<const std::uint8_t> head) const
{
    Chunk chunk;
    chunk.at = scanned_;
    chunk.size = record::number(head.data() + 41, 8);
    chunk.first = static_cast<std::int64_t>(record::number(head.data() + 9, 8));
    chunk.last = static_cast<std::int64_t>(record::number(head.data() + 17, 8));
    // The chunk has ended if the next record is of a kind that stands outside of chunks.
    const bool agrees = chunk.size <= most_chunk &&
                        record::number(head.data() + 1, 8) == chunk.size + record::chunk_head - record::prefix;
    std::vector<std::uint8_t> memory;
    const auto behind = agrees ? read(chunk.at + record::chunk_head + chunk.size, record::prefix, memory)
                               : std::span<const std::uint8_t>();
    chunk.ended = behind.size() == record::prefix && behind[0] > record::op_message && behind[0] <= record::op_data_end;
    return chunk;
}

/// Read the records from where the last scan ended, chunk by chunk.
void PacketFile::scan()
{
    if (!chunks.empty() && !chunks.back().ended) {
        for (const auto &[id, n] : open_counts_) {
            channels[id].count -= n;
            count -= n;
        }
        chunks.pop_back();
    }
    std::vector<std::uint8_t> bytes;
    while (scanned_ < size_) {
        const auto head = read(scanned_, record::chunk_head, bytes);
        if (head.size() < record::prefix) {
            return;
        }
        const std::uint8_t op = head[0];
        const std::uint64_t n = record::number(head.data() + 1, 8), content = scanned_ + record::prefix;
        if (op == record::op_data_end) {
            whole = true; // the file is complete, but its summary is unusable
            return;
        }
        if (op == record::op_chunk && head.size() == record::chunk_head) {
            Chunk chunk = chunk_of(head);
            const std::uint64_t end = chunk.at + record::chunk_head + chunk.size;
            const bool ended = chunk.ended;
            scan_chunk(std::move(chunk));
            if (!ended) {
                return;
            }
            scanned_ = end;
            continue;
        }
        if (n > size_ - content || op == 0 || op > record::op_data_end) {
            if ((op == 0 || op > record::op_data_end) && !is_unsaved(scanned_)) {
                damaged(scanned_, last, last, "there is no record; what follows cannot be read");
            }
            return;
        }
        if (op == record::op_metadata && n <= most_summary) {
            try {
                read_metadata(read(content, n, bytes));
            } catch (const record::Damage &damage) {
                damaged(scanned_, last, last, damage.what);
            }
        }
        scanned_ = content + n;
    }
}

void PacketFile::scan_chunk(Chunk chunk)
{
    std::map<std::uint16_t, std::uint64_t> counts;
    std::uint64_t n = 0;
    std::int64_t t_first = 0, t_last = 0;
    each(chunk, [&](const Stored &stored) {
        counts[stored.channel]++;
        t_first = n == 0 ? stored.t : std::min(t_first, stored.t);
        t_last = n++ == 0 ? stored.t : std::max(t_last, stored.t);
        return true;
    });
    if (n == 0) {
        return;
    }
    chunk.first = t_first;
    chunk.last = t_last;
    first = count == 0 ? t_first : std::min(first, t_first);
    last = count == 0 ? t_last : std::max(last, t_last);
    count += n;
    for (const auto &[id, times] : counts) {
        channels[id].count += times;
        chunk.channels.push_back(id);
    }
    if (!chunk.ended) {
        open_counts_ = std::move(counts);
    }
    chunks.push_back(std::move(chunk));
}

} // namespace fledge::ground
