// SPDX-License-Identifier: Apache-2.0
#include "record/mcap_reader.h"

#include "record/mcap_crc.h"

#include <algorithm>
#include <cstdio>
#include <map>
#include <numeric>
#include <string_view>
#include <unordered_map>

namespace fledge::record {

namespace {

using Counts = std::map<std::uint16_t, std::uint64_t>; // by channel

// clang-format off
constexpr std::string_view names[] = {"Header", "Footer", "Schema", "Channel", "Message", "Chunk", "MessageIndex",
    "ChunkIndex", "Attachment", "AttachmentIndex", "Statistics", "Metadata", "MetadataIndex", "SummaryOffset",
    "DataEnd"};
// clang-format on

std::string hex(std::uint32_t value, int digits)
{
    char text[11];
    std::snprintf(text, sizeof text, "0x%0*x", digits, value);
    return text;
}

std::string name_of(std::uint8_t op)
{
    return op >= op_header && op <= op_data_end ? std::string(names[op - 1]) : hex(op, 2);
}

/// The records that the data section and the summary may have, a bit for each.
constexpr std::uint32_t in_data = 1u << op_schema | 1u << op_channel | 1u << op_message | 1u << op_chunk |
                                  1u << op_message_index | 1u << op_attachment | 1u << op_metadata | 1u << op_data_end;
constexpr std::uint32_t in_summary = 1u << op_schema | 1u << op_channel | 1u << op_chunk_index |
                                     1u << op_attachment_index | 1u << op_statistics | 1u << op_metadata_index |
                                     1u << op_summary_offset | 1u << op_footer;

/// Whether the record is not among these; records from 0x80 on are private, and allowed anywhere.
bool is_misplaced(std::uint8_t op, std::uint32_t among)
{
    return op < 0x80 && (op > op_data_end || (among >> op & 1u) == 0);
}

/// Whether bytes are UTF-8, by table 3-7 of the Unicode Standard.
bool is_utf8(Bytes bytes)
{
    for (std::size_t i = 0; i < bytes.size();) {
        const std::uint8_t first = bytes[i++];
        if (first < 0x80) {
            continue;
        }
        const int more = first < 0xC2 ? 0 : first < 0xE0 ? 1 : first < 0xF0 ? 2 : first < 0xF5 ? 3 : 0;
        if (more == 0 || bytes.size() - i < static_cast<std::size_t>(more)) {
            return false;
        }
        const std::uint8_t second = bytes[i];
        if ((first == 0xE0 && second < 0xA0) || (first == 0xED && second > 0x9F) || (first == 0xF0 && second < 0x90) ||
            (first == 0xF4 && second > 0x8F)) {
            return false;
        }
        for (int k = 0; k < more; k++) {
            if ((bytes[i++] & 0xC0) != 0x80) {
                return false;
            }
        }
    }
    return true;
}

} // namespace

std::uint32_t crc(Bytes bytes)
{
    static const McapCrc tables = [] {
        McapCrc crc_tables;
        mcap_crc_init(&crc_tables);
        return crc_tables;
    }();
    return mcap_crc_update(&tables, 0, bytes.data(), bytes.size());
}

Bytes Fields::take(std::uint64_t n)
{
    if (n > rest.size()) {
        throw Damage{record, "a field reaches beyond its record"};
    }
    const Bytes taken = rest.first(n);
    rest = rest.subspan(n);
    return taken;
}

std::string Fields::text()
{
    const Bytes bytes = take(integer(4));
    if (!is_utf8(bytes)) {
        throw Damage{record, "a text is not UTF-8"};
    }
    return {bytes.begin(), bytes.end()};
}

Pairs Fields::pairs()
{
    Fields inner{take(integer(4)), record};
    Pairs result;
    std::unordered_map<std::string, std::size_t> places;
    while (!inner.rest.empty()) {
        std::string key = inner.text(), value = inner.text();
        const auto [place, is_new] = places.try_emplace(key, result.size());
        if (is_new) {
            result.emplace_back(std::move(key), std::move(value));
        } else {
            result[place->second].second = std::move(value);
        }
    }
    return result;
}

namespace {

/// Fills a Scan.
class Reader {
public:
    Reader(Bytes file, const Scan::Length &length, Scan &scan) : file_(file), length_(length), scan_(scan)
    {
        try {
            summary(data_section(magic.size()));
        } catch (const Damage &damage) {
            scan_.problem = damage.what;
            scan_.problem_at = damage.at;
        }
        judge();
    }

private:
    struct Record {
        std::uint8_t op;
        std::uint64_t begin, end; ///< of its content
    };

    /// Set good_until, and add to `problem` which data are good.
    void judge()
    {
        scan_.good_until = last_;
        if (data_is_right_ == false) {
            if (scan_.problem.empty()) {
                scan_.problem = "the checksum of the data section is wrong";
                scan_.problem_at = *data_end_at_;
            }
            if (loose_ || statistics_ != counts()) {
                scan_.good_until = std::nullopt;
                scan_.problem += "; the damaged record is unknown, any value may be wrong";
            } else {
                scan_.problem += "; all messages are there and agree with their chunks' checksums";
            }
        } else if (scan_.problem.empty()) {
            return;
        } else if (passed_over_ && !data_is_right_) {
            scan_.good_until = std::nullopt;
            scan_.problem += "; records before it were passed over, which may have held messages";
        } else if (data_end_at_) {
            scan_.problem += "; all messages are there";
        } else if (cut_) {
            scan_.problem += "; the messages that are there of this chunk were read without a checksum";
        } else if (loose_) {
            scan_.problem += "; the messages before it have no checksum of their own";
        }
    }

    Counts counts() const
    {
        Counts result;
        for (const Channel &channel : scan_.channels) {
            result[channel.id] = channel.offsets.size();
        }
        return result;
    }

    std::uint64_t count() const
    {
        return std::transform_reduce(scan_.channels.begin(), scan_.channels.end(), std::uint64_t{0}, std::plus<>(),
                                     [](const Channel &channel) { return channel.offsets.size(); });
    }

    Fields fields(std::uint64_t at, const Record &found) const
    {
        return {file_.subspan(found.begin, found.end - found.begin), at};
    }

    Record record(std::uint64_t at, std::uint64_t end) const
    {
        const std::uint64_t there = end - at;
        if (there < prefix) {
            throw Damage{at, end == file_.size()
                                 ? "the file ends within a record (" + std::to_string(there) + " bytes of it are there)"
                                 : "a record reaches beyond its chunk"};
        }
        const std::uint8_t op = file_[at];
        const std::uint64_t length = number(&file_[at + 1], 8);
        if (length > there - prefix) {
            throw Damage{at, "the " + name_of(op) + " record states " + std::to_string(length) + " bytes, " +
                                 std::to_string(there - prefix) + " are there"};
        }
        return {op, at + prefix, at + prefix + length};
    }

    std::uint64_t data_section(std::uint64_t at)
    {
        Record found = record(at, file_.size());
        if (found.op != op_header) {
            throw Damage{at, "expected the Header, found record " + hex(found.op, 2)};
        }
        Fields header = fields(at, found);
        std::string first = header.text();
        scan_.library = header.text();
        scan_.profile = std::move(first);
        at = contents(found.end, file_.size(), false);
        found = record(at, file_.size());
        const std::uint64_t stated = fields(at, found).integer(4);
        data_end_at_ = at;
        if (stated != 0) {
            data_is_right_ = stated == crc(file_.first(at));
        }
        return found.end;
    }

    /// Read the records of a chunk to its end, or of the data section to its DataEnd.
    std::uint64_t contents(std::uint64_t at, std::uint64_t end, bool in_chunk)
    {
        struct Latest { // stored even if a record is wrong
            Reader &reader;
            bool in_chunk, any = false;
            std::uint64_t t = 0;
            ~Latest()
            {
                if (any) {
                    reader.last_ = std::max(t, reader.last_.value_or(0));
                    reader.loose_ = reader.loose_ || !in_chunk;
                }
            }
        } latest{*this, in_chunk};
        Channel *known = nullptr;
        while (at < end) {
            // The fast path for messages, which are nearly all records.
            if (end - at >= cdr_at && file_[at] == op_message) {
                const std::uint64_t length = number(&file_[at + 1], 8);
                if (length >= cdr_at - prefix && length <= end - at - prefix) {
                    const auto id = static_cast<std::uint16_t>(number(&file_[at + prefix], 2));
                    if (known == nullptr || known->id != id) {
                        const auto place = places_.find(id);
                        if (place == places_.end()) {
                            throw Damage{at, "a message of channel " + std::to_string(id) + ", which is not declared"};
                        }
                        known = &scan_.channels[place->second];
                    }
                    if (known->length.value_or(length) != length) {
                        throw Damage{at, "a message on " + known->topic + " has " + std::to_string(length) +
                                             " bytes, by its definition it has " + std::to_string(*known->length)};
                    }
                    known->offsets.push_back(at);
                    latest.t = std::max(latest.t, number(&file_[at + time_at], 8));
                    latest.any = true;
                    at += prefix + length;
                    continue;
                }
            }
            Record found{};
            try {
                found = record(at, end);
            } catch (const Damage &) {
                if (!in_chunk) {
                    take_cut_chunk(at);
                }
                throw;
            }
            if (found.op == op_data_end && !in_chunk) {
                return at;
            }
            other(found, at, in_chunk);
            known = nullptr; // a new channel may move it
            at = found.end;
        }
        if (!in_chunk) {
            throw Damage{at, "the file ends before its DataEnd record"};
        }
        return at;
    }

    void other(const Record &found, std::uint64_t at, bool in_chunk)
    {
        Fields rest = fields(at, found);
        const std::uint8_t op = found.op;
        if (op == op_schema) {
            take_schema(rest);
        } else if (op == op_channel) {
            take_channel(rest);
        } else if (op == op_chunk && !in_chunk) {
            take_chunk(rest);
        } else if (op == op_message) {
            throw Damage{at, "a Message record shorter than its head"};
        } else if (op == op_metadata && !in_chunk) {
            scan_.metadata.emplace_back(rest.text(), Pairs());
            scan_.metadata.back().second = rest.pairs();
        } else if (op == op_message_index && !in_chunk) {
            rest.take(2);
            rest.take(rest.integer(4));
        } else if (in_chunk || is_misplaced(op, in_data)) {
            throw Damage{at, "record " + name_of(op) + " has no place here"};
        }
        // Attachments, private records and fields of a later MCAP are skipped; but damage may have turned another
        // record into one of these.
        passed_over_ = passed_over_ || !rest.rest.empty();
    }

    void take_schema(Fields &rest)
    {
        const auto id = static_cast<std::uint16_t>(rest.integer(2));
        std::array<std::string, 3> schema;
        for (std::string &text : schema) {
            text = rest.text();
        }
        const auto place = schemas_.find(id);
        if (data_end_at_ && place == schemas_.end()) {
            throw Damage{rest.record, "schema " + std::to_string(id) + " is declared in the summary alone"};
        }
        if (place == schemas_.end()) {
            schemas_.emplace(id, std::move(schema));
        } else if (place->second != schema) {
            throw Damage{rest.record, "schema " + std::to_string(id) + " is declared twice, differently"};
        }
    }

    void take_channel(Fields &rest)
    {
        Channel channel;
        channel.id = static_cast<std::uint16_t>(rest.integer(2));
        channel.schema = static_cast<std::uint16_t>(rest.integer(2));
        const auto schema = schemas_.find(channel.schema);
        const std::string name = "channel " + std::to_string(channel.id);
        if (channel.schema != 0 && schema == schemas_.end()) {
            throw Damage{rest.record,
                         name + " has schema " + std::to_string(channel.schema) + ", which is not declared"};
        }
        channel.topic = rest.text();
        channel.encoding = rest.text();
        channel.metadata = rest.pairs();
        const auto place = places_.find(channel.id);
        if (place == places_.end()) {
            if (data_end_at_) {
                throw Damage{rest.record, name + " is declared in the summary alone"};
            }
            if (schema != schemas_.end()) {
                channel.definition = schema->second;
            }
            channel.length = length_(channel);
            places_.emplace(channel.id, scan_.channels.size());
            scan_.channels.push_back(std::move(channel));
            return;
        }
        const Channel &known = scan_.channels[place->second];
        if (known.schema != channel.schema || known.topic != channel.topic || known.encoding != channel.encoding ||
            !std::ranges::is_permutation(known.metadata, channel.metadata)) {
            throw Damage{rest.record, name + " is declared twice, differently"};
        }
    }

    void take_chunk(Fields &rest)
    {
        rest.take(16); // earliest and latest time
        const std::uint64_t size = rest.integer(8), stated = rest.integer(4);
        const std::string compression = rest.text();
        if (compression == "lz4" || compression == "zstd") {
            throw Unsupported{"its chunks are compressed (" + compression + "), which is not read here"};
        }
        if (!compression.empty()) {
            throw Damage{rest.record, "the chunk states an unknown compression, \"" + compression + "\""};
        }
        if (rest.integer(8) != size || size != rest.rest.size()) {
            throw Damage{rest.record, "the lengths that the Chunk record states do not agree"};
        }
        const Bytes inside = rest.take(size);
        const std::uint32_t found = crc(inside);
        if (stated != 0 && stated != found) {
            throw Damage{rest.record, "the checksum of this chunk is " + hex(found, 8) + ", " +
                                          hex(static_cast<std::uint32_t>(stated), 8) + " was written"};
        }
        const auto begin = static_cast<std::uint64_t>(inside.data() - file_.data());
        contents(begin, begin + size, true);
    }

    /// Read the messages of a chunk in which the file ends.
    void take_cut_chunk(std::uint64_t at)
    {
        constexpr std::uint64_t compression_at = 37;
        if (file_.size() - at < chunk_head || file_[at] != op_chunk || number(&file_[at + compression_at], 4) != 0) {
            return;
        }
        const std::uint64_t before = count();
        try {
            contents(at + chunk_head, file_.size(), true);
        } catch (const Damage &) { // the end of the file, which the caller names
        }
        cut_ = count() > before;
    }

    void summary(std::uint64_t start)
    {
        std::uint64_t at = start;
        Fields rest{};
        for (;;) {
            const Record found = record(at, file_.size());
            rest = fields(at, found);
            if (found.op == op_footer) {
                break;
            }
            if (found.op == op_schema) {
                take_schema(rest);
            } else if (found.op == op_channel) {
                take_channel(rest);
            } else if (found.op == op_statistics) {
                take_statistics(rest);
            } else if (is_misplaced(found.op, in_summary)) {
                throw Damage{at, "record " + name_of(found.op) + " has no place in a summary"};
            }
            at = found.end;
        }
        const auto end = static_cast<std::uint64_t>(rest.rest.data() + rest.rest.size() - file_.data());
        const std::uint64_t stated = rest.integer(8);
        rest.take(8);
        const std::uint64_t sum = rest.integer(4);
        if (!rest.rest.empty() || stated != (at > start ? start : 0)) {
            throw Damage{at, "the Footer does not fit the file"};
        }
        if (sum != 0 && sum != crc(file_.subspan(start, end - 4 - start))) {
            throw Damage{at, "the checksum of the summary is wrong"};
        }
        if (!std::ranges::equal(file_.subspan(end), magic)) {
            throw Damage{end, "expected the closing magic bytes and then the end of the file"};
        }
        if (statistics_ && *statistics_ != counts()) {
            std::uint64_t total = 0;
            for (const auto &[id, n] : *statistics_) {
                total += n;
            }
            throw Damage{start, "the Statistics count " + std::to_string(total) + " messages, " +
                                    std::to_string(count()) + " were found"};
        }
    }

    void take_statistics(Fields &rest)
    {
        const std::uint64_t total = rest.integer(8);
        rest.take(2 + 4 * 4 + 2 * 8);
        Fields inner{rest.take(rest.integer(4)), rest.record};
        Counts found;
        while (!inner.rest.empty()) {
            const auto id = static_cast<std::uint16_t>(inner.integer(2));
            found[id] = inner.integer(8);
        }
        if (found.empty()) {
            return;
        }
        statistics_.emplace();
        for (const Channel &channel : scan_.channels) { // some writers omit channels without messages
            (*statistics_)[channel.id] = 0;
        }
        std::uint64_t sum = 0;
        for (const auto &[id, n] : found) {
            (*statistics_)[id] = n;
            sum += n;
        }
        if (total != sum) {
            throw Damage{rest.record, "the counts of the Statistics do not add up"};
        }
    }

    const Bytes file_;
    const Scan::Length &length_;
    Scan &scan_;
    std::map<std::uint16_t, std::array<std::string, 3>> schemas_;
    std::map<std::uint16_t, std::size_t> places_; ///< of the channels, by their ids
    std::optional<Counts> statistics_;
    std::optional<std::uint64_t> last_; ///< [ns] the latest message
    bool loose_ = false;                ///< there are messages outside of chunks, without a checksum of their own
    bool cut_ = false;                  ///< the file ends within a chunk, whose checksum cannot be checked
    bool passed_over_ = false;          ///< some records were not decoded, or not completely
    std::optional<std::uint64_t> data_end_at_; ///< place of the DataEnd record, once it was read
    std::optional<bool> data_is_right_;        ///< whether its checksum is right; none: it has none
};

} // namespace

Scan::Scan(Bytes file, const Length &length)
{
    Reader(file, length, *this);
}

Metadata metadata_of(Bytes file)
{
    Metadata result;
    for (std::uint64_t at = magic.size(); at <= file.size() && file.size() - at >= prefix;) {
        const std::uint8_t op = file[at];
        const std::uint64_t length = number(&file[at + 1], 8);
        if (op == op_data_end || length > file.size() - at - prefix) {
            break;
        }
        if (op == op_metadata) {
            try {
                Fields fields{file.subspan(at + prefix, length), at};
                std::string name = fields.text();
                result.emplace_back(std::move(name), fields.pairs());
            } catch (const Damage &) {
                break;
            }
        }
        at += prefix + length;
    }
    return result;
}

} // namespace fledge::record
