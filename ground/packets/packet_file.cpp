// SPDX-License-Identifier: Apache-2.0
#include "ground/packets/packet_file.h"

#include "record/mcap_crc.h"

#include <cerrno>
#include <cinttypes>
#include <cstdio>
#include <cstring>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace fledge::ground {

namespace {

// Of MCAP: https://mcap.dev/spec
constexpr std::uint8_t magic[] = {0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};
constexpr std::size_t prefix = 9, chunk_head = 49, message_head = 22, cdr = 4, footer = prefix + 20 + sizeof magic;
constexpr std::uint64_t most_chunk = std::uint64_t{1} << 26, most_summary = std::uint64_t{1} << 28;
enum Op : std::uint8_t {
    end_of_file = 0x02,
    schema = 0x03,
    channel = 0x04,
    message = 0x05,
    chunk = 0x06,
    chunk_index = 0x08,
    statistics = 0x0B,
    metadata_op = 0x0C,
    metadata_index = 0x0D,
    data_end = 0x0F
};

struct Damage {
    const char *what;
};

std::uint64_t number(const std::uint8_t *at, std::size_t n)
{
    std::uint64_t value = 0;
    while (n--) {
        value = value << 8 | at[n];
    }
    return value;
}

std::uint32_t crc_of(std::span<const std::uint8_t> bytes)
{
    static const McapCrc tables = [] {
        McapCrc made;
        mcap_crc_init(&made);
        return made;
    }();
    return mcap_crc_update(&tables, 0, bytes.data(), bytes.size());
}

/// The fields of a record in their order; throws Damage where one reaches beyond its record.
struct Fields {
    std::span<const std::uint8_t> rest;

    std::span<const std::uint8_t> take(std::uint64_t n)
    {
        if (n > rest.size()) {
            throw Damage{"a field reaches beyond its record"};
        }
        const auto taken = rest.first(n);
        rest = rest.subspan(n);
        return taken;
    }
    std::uint64_t integer(std::size_t n) { return number(take(n).data(), n); }
    std::int64_t time() { return static_cast<std::int64_t>(integer(8)); }
    std::string text()
    {
        const auto bytes = take(integer(4));
        return {bytes.begin(), bytes.end()};
    }
};

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
    const auto begin = read(0, sizeof magic, buffer_);
    if (!std::equal(begin.begin(), begin.end(), magic)) { // a new file may have no byte yet
        close();
        throw Refusal(path + " is no MCAP file");
    }
    scanned_ = sizeof magic;
    bool read_it = false;
    try {
        read_it = read_summary();
    } catch (const Damage &) { // then what is in front of it counts
    }
    if (!read_it) {
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

/// So many bytes, or those up to the end of the file.
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

void PacketFile::damaged(std::uint64_t at, std::int64_t from, std::int64_t to, const std::string &what)
{
    const std::string why = path + " is damaged at byte " + std::to_string(at) + ": " + what;
    if (std::none_of(missing.begin(), missing.end(), [&](const Missing &one) { return one.why == why; })) {
        missing.push_back({from, to, why});
    }
}

std::span<const std::uint8_t> PacketFile::records(const Chunk &one)
{
    open();
    const auto bytes = read(one.at, chunk_head + (one.ended ? one.size : most_chunk), buffer_);
    const std::uint8_t *const p = bytes.data();
    if (bytes.size() < chunk_head || *p != chunk) {
        damaged(one.at, one.first, one.last, "there is no chunk");
        return {};
    }
    const auto inside = bytes.subspan(chunk_head);
    if (!one.ended) {
        return inside;
    }
    const std::uint64_t crc = number(p + 33, 4);
    const char *const what = inside.size() < one.size || number(p + 41, 8) != one.size ? "the chunk has another size"
                             : number(p + 37, 4) != 0            ? "the chunk is compressed, which is not read here"
                             : crc != 0 && crc_of(inside) != crc ? "the checksum of the chunk is wrong"
                                                                 : nullptr;
    if (what != nullptr) {
        damaged(one.at, one.first, one.last, what);
        return {};
    }
    return inside;
}

/// The record at a place; its channel is 0 if it is no packet. False at the end of what can be read.
bool PacketFile::next(std::span<const std::uint8_t> bytes, std::size_t &at, Stored &one)
{
    if (bytes.size() - at < prefix) {
        return false;
    }
    const std::uint8_t *const p = bytes.data() + at;
    const std::uint64_t n = number(p + 1, 8);
    if ((*p != schema && *p != channel && *p != message) || n > bytes.size() - at - prefix) {
        return false;
    }
    at += prefix + n;
    one.channel = 0;
    if (*p == message && n >= message_head + cdr + packet_at) {
        const std::uint8_t *const content = p + prefix + message_head + cdr;
        const std::size_t size = n - message_head - cdr - packet_at;
        if (content[-3] == 1 && number(content + 16, 4) == size) { // little-endian
            one = {static_cast<std::int64_t>(number(content, 8)),
                   static_cast<std::int64_t>(number(content + 8, 8)),
                   static_cast<std::uint16_t>(number(p + prefix, 2)),
                   {content + packet_at, size}};
        }
    } else if (*p == channel) {
        Fields fields{{p + prefix, n}};
        try {
            const auto id = static_cast<std::uint16_t>(fields.integer(2));
            fields.take(2);
            channels.try_emplace(id, Channel{fields.text()});
        } catch (const Damage &) { // its packets are as undecoded ones
        }
    }
    return true;
}

void PacketFile::read_metadata(std::span<const std::uint8_t> content)
{
    Fields fields{content};
    const std::string name = fields.text();
    Fields pairs{fields.take(fields.integer(4))};
    auto &made = metadata.emplace_back(name, Metadata::value_type::second_type()).second;
    while (!pairs.rest.empty()) {
        std::string key = pairs.text();
        made[std::move(key)] = pairs.text();
    }
}

bool PacketFile::read_summary()
{
    std::vector<std::uint8_t> bytes, more;
    if (size_ < sizeof magic + footer) {
        return false;
    }
    const auto end = read(size_ - footer, footer, more);
    if (end.size() < footer || end[0] != end_of_file || number(end.data() + 1, 8) != 20 ||
        std::memcmp(end.data() + prefix + 20, magic, sizeof magic) != 0) {
        return false;
    }
    const std::uint64_t begin = number(end.data() + prefix, 8);
    if (begin == 0 || begin > size_ - footer || size_ - begin > most_summary) {
        throw Damage{"there is no summary where the footer says"};
    }
    const auto all = read(begin, size_ - begin - 4 - sizeof magic, bytes); // with the footer up to the checksum
    const std::uint64_t crc = number(end.data() + prefix + 16, 4);
    if (crc != 0 && crc_of(all) != crc) {
        throw Damage{"the checksum of the summary is wrong"};
    }
    bool counted = false;
    std::uint64_t n_chunks = 0;
    for (Fields rest{all}; rest.rest.size() > footer - 4 - sizeof magic;) {
        const auto op = static_cast<std::uint8_t>(rest.integer(1));
        Fields fields{rest.take(rest.integer(8))};
        if (op == channel) {
            const auto id = static_cast<std::uint16_t>(fields.integer(2));
            fields.take(2);
            channels[id].topic = fields.text();
        } else if (op == statistics) {
            count = fields.integer(8);
            fields.take(2 + 3 * 4 - 4);
            fields.take(4);
            n_chunks = fields.integer(4);
            first = fields.time();
            last = fields.time();
            for (Fields counts{fields.take(fields.integer(4))}; !counts.rest.empty();) {
                const auto id = static_cast<std::uint16_t>(counts.integer(2));
                channels[id].count = counts.integer(8);
            }
            counted = true;
        } else if (op == chunk_index) {
            Chunk made;
            made.first = fields.time();
            made.last = fields.time();
            made.at = fields.integer(8);
            made.size = fields.integer(8) - chunk_head;
            for (Fields ids{fields.take(fields.integer(4))}; !ids.rest.empty(); ids.take(8)) {
                made.channels.push_back(static_cast<std::uint16_t>(ids.integer(2)));
            }
            if (made.size > most_chunk || made.at > size_ || made.size + chunk_head > size_ - made.at) {
                throw Damage{"a chunk lies outside of the file"};
            }
            made.ended = true;
            chunks.push_back(std::move(made));
        } else if (op == metadata_index) {
            const std::uint64_t at = fields.integer(8), n = fields.integer(8);
            if (n > most_summary) {
                throw Damage{"metadata are too long"};
            }
            Fields record{read(at, n, more)};
            if (record.integer(1) != metadata_op) {
                throw Damage{"there are no metadata where the index says"};
            }
            read_metadata(record.take(record.integer(8)));
        }
    }
    if (!counted || n_chunks != chunks.size()) { // as if the memory for the index was full
        return false;
    }
    whole = true;
    return true;
}

void PacketFile::refresh()
{
    open();
    if (!whole) {
        scan();
    }
}

/// Whether a chunk begins there whose first packets are written, but not its head, which its writer writes last.
bool PacketFile::is_unsaved(std::uint64_t at) const
{
    std::vector<std::uint8_t> memory;
    const auto bytes = read(at, chunk_head + 1, memory);
    return bytes.size() == chunk_head + 1 && bytes.back() >= schema && bytes.back() <= message &&
           std::all_of(bytes.begin(), bytes.end() - 1, [](std::uint8_t one) { return one == 0; });
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
        const auto head = read(scanned_, chunk_head, bytes);
        if (head.size() < prefix) {
            return;
        }
        const std::uint8_t op = head[0];
        const std::uint64_t n = number(head.data() + 1, 8), content = scanned_ + prefix;
        if (op == data_end) {
            whole = true; // without a summary that can be used
            return;
        }
        if (op == chunk && head.size() == chunk_head) {
            Chunk made;
            made.at = scanned_;
            made.size = number(head.data() + 41, 8);
            made.first = static_cast<std::int64_t>(number(head.data() + 9, 8));
            made.last = static_cast<std::int64_t>(number(head.data() + 17, 8));
            // A record behind it that is none of a chunk's says that nothing is added to it.
            const bool agrees = made.size <= most_chunk && n == made.size + chunk_head - prefix;
            const std::uint64_t end = made.at + chunk_head + made.size;
            const auto behind = agrees ? read(end, prefix, bytes) : std::span<const std::uint8_t>();
            const bool ended = behind.size() == prefix && behind[0] > message && behind[0] <= data_end;
            made.ended = ended;
            scan_chunk(std::move(made));
            if (!ended) {
                return;
            }
            scanned_ = end;
            continue;
        }
        if (n > size_ - content || op == 0 || op > data_end) {
            if ((op == 0 || op > data_end) && !is_unsaved(scanned_)) {
                damaged(scanned_, last, last, "there is no record; what follows cannot be read");
            }
            return;
        }
        if (op == metadata_op && n <= most_summary) {
            try {
                read_metadata(read(content, n, bytes));
            } catch (const Damage &damage) {
                damaged(scanned_, last, last, damage.what);
            }
        }
        scanned_ = content + n;
    }
}

void PacketFile::scan_chunk(Chunk made)
{
    std::map<std::uint16_t, std::uint64_t> counts;
    std::uint64_t n = 0;
    std::int64_t t_first = 0, t_last = 0;
    each(made, [&](const Stored &one) {
        counts[one.channel]++;
        t_first = n == 0 ? one.t : std::min(t_first, one.t);
        t_last = n++ == 0 ? one.t : std::max(t_last, one.t);
        return true;
    });
    if (n == 0) {
        return;
    }
    made.first = t_first;
    made.last = t_last;
    first = count == 0 ? t_first : std::min(first, t_first);
    last = count == 0 ? t_last : std::max(last, t_last);
    count += n;
    for (const auto &[id, times] : counts) {
        channels[id].count += times;
        made.channels.push_back(id);
    }
    if (!made.ended) {
        open_counts_ = std::move(counts);
    }
    chunks.push_back(std::move(made));
}

} // namespace fledge::ground
