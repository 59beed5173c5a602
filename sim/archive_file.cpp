// SPDX-License-Identifier: Apache-2.0
#include "sim/archive_file.h"

#include "record/file_sink.h"
#include "sim/error.h"

#include <cerrno>
#include <cstring>
#include <deque>

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

} // namespace

struct ArchiveFile::Memory {
    FileSink sink{};
    bool open = true;
    std::vector<McapSchema> schemas;
    std::vector<McapChannel> channels;
    std::vector<std::uint8_t> chunk, index;
    std::deque<std::string> texts; ///< whose addresses do not change
    std::deque<Pairs> pairs;
    std::deque<std::vector<McapPair>> pointers; ///< into pairs

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
    const Pairs &kept = m.pairs.emplace_back(pairs);
    const std::vector<McapPair> &pointers = m.pointers.emplace_back(as_pairs(kept));
    std::uint16_t type_id = 0, id = 0;
    require(mcap_add_schema(&writer_, m.keep("fledge/msg/" + type), m.keep(schema), &type_id));
    require(
        mcap_add_channel(&writer_, m.keep(topic), type_id, MCAP_ORDER_NATIVE, pointers.data(), pointers.size(), &id));
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
