// SPDX-License-Identifier: Apache-2.0
#include "sim/recorder.h"

#include "record/file_sink.h"
#include "record/mcap.h"
#include "sim/error.h"
#include "sim/text.h"

#include <algorithm>
#include <cstring>
#include <limits>

namespace fledge::sim {

namespace {

constexpr Ns never = std::numeric_limits<Ns>::max();
constexpr std::size_t chunk_size = std::size_t{1} << 20;
constexpr std::size_t chunks_indexed = 4096; // 4 GiB; beyond, readers scan

/// The first multiple of a log's period after t.
Ns due_after(Ns every, Ns t)
{
    return t < 0 ? 0 : every ? (t / every + 1) * every : t + 1;
}

} // namespace

/// The strings and buffers that the writer points into live as long as the file is open.
struct Recorder::Archive {
    std::string path;
    FileSink sink{};
    McapWriter writer{};
    std::vector<std::string> topics, types;
    std::vector<McapSchema> schemas;
    std::vector<McapChannel> channels;
    std::vector<std::uint8_t> chunk, index;

    bool metadata(const char *name, const Pairs &pairs)
    {
        std::vector<McapPair> list;
        for (const auto &[key, value] : pairs) {
            list.push_back({key.c_str(), value.c_str()});
        }
        return mcap_metadata(&writer, name, list.data(), list.size()) == MCAP_OK;
    }
};

std::string Log::topic() const
{
    std::string topic = "/" + instance->path + "/" + field->name;
    std::replace(topic.begin(), topic.end(), '.', '/');
    return topic;
}

Recorder::Recorder() : next_due_(never) {}

Recorder::~Recorder()
{
    if (archive_) {
        mcap_flush(&archive_->writer);
        file_sink_close(&archive_->sink, false);
    }
}

std::shared_ptr<Log> Recorder::record(std::shared_ptr<Instance> instance, const FledgeField &field, Ns every,
                                      bool keep)
{
    const std::string path = instance->path + "." + field.name;
    if (field.type != FLEDGE_STRUCT || (field.group != FLEDGE_IN && field.group != FLEDGE_OUT)) {
        throw SetupError(path + " is no input or output, and only these are recorded");
    }
    if (instance->name.empty()) {
        throw SetupError("record " + path + ": this " + instance->type().name +
                         " has no name yet; assign it to a process first");
    }
    if (every < 0) {
        throw SetupError("record " + path + ": every must be >= 0, found " + format_time(every));
    }
    if (archive_) {
        throw SetupError("record " + path + ": the archive " + archive_->path +
                         " is open; say what to record before");
    }
    for (const auto &log : logs_) {
        if (log->instance == instance && log->field == &field) {
            log->every = std::min(log->every, every);
            log->keep = log->keep || keep;
            return log;
        }
    }
    auto log = std::make_shared<Log>();
    log->instance = std::move(instance);
    log->field = &field;
    log->every = every;
    log->keep = keep;
    logs_.push_back(log);
    next_due_ = 0; // looked at anew at the next instant
    return log;
}

void Recorder::open_archive(const std::string &path, const Pairs &run)
{
    if (archive_) {
        throw SetupError("the archive " + archive_->path + " is still open");
    }
    auto archive = std::make_unique<Archive>();
    Archive &a = *archive;
    a.path = path;
    const std::size_t n = logs_.size();
    a.schemas.resize(n);
    a.channels.resize(n);
    a.topics.reserve(n);
    a.types.reserve(n);
    a.chunk.resize(chunk_size);
    a.index.resize(chunks_indexed * (73 + 10 * n) + 1024);
    if (const int error = file_sink_open(&a.sink, path.c_str())) {
        throw RunError("cannot write " + path + ": " + std::strerror(error));
    }
    McapConfig config{};
    config.write = file_sink_write;
    config.user = &a.sink;
    config.schemas = a.schemas.data();
    config.channels = a.channels.data();
    config.schemas_max = config.channels_max = static_cast<std::uint16_t>(n);
    config.chunk = a.chunk.data();
    config.chunk_size = a.chunk.size();
    config.index = a.index.data();
    config.index_size = a.index.size();
    archive_ = std::move(archive);
    bool good = mcap_open(&a.writer, &config) == MCAP_OK && a.metadata("run", run);
    for (const auto &log : logs_) {
        a.topics.push_back(log->topic());
        a.types.push_back("fledge/msg/" + std::string(log->field->sub->name));
        std::uint16_t schema = 0;
        good = good &&
               mcap_add_schema(&a.writer, a.types.back().c_str(), log->field->sub->schema, &schema) == MCAP_OK &&
               mcap_add_channel(&a.writer, a.topics.back().c_str(), schema, MCAP_ORDER_NATIVE, nullptr, 0,
                                &log->channel_) == MCAP_OK;
        log->archived_ = true;
    }
    if (!good) {
        abandon_archive();
    }
}

void Recorder::close_archive(const Pairs &end)
{
    if (!archive_) {
        return;
    }
    Archive &a = *archive_;
    if ((!end.empty() && !a.metadata("end", end)) || mcap_close(&a.writer) != MCAP_OK) {
        abandon_archive();
    }
    const int error = file_sink_close(&a.sink, true);
    const std::string path = a.path;
    archive_.reset();
    for (const auto &log : logs_) {
        log->archived_ = false;
    }
    if (error) {
        throw RunError("cannot finish " + path + ": " + std::strerror(error) + "; what was written is in " +
                       path + ".part");
    }
}

/// The file could not be written: keep what is readable, go on without it, and say so.
void Recorder::abandon_archive()
{
    const Archive &a = *archive_;
    const McapStatus status = a.writer.status;
    const std::string reason = a.sink.error ? std::strerror(a.sink.error) : mcap_status_text(status);
    const std::string path = a.path;
    file_sink_close(&archive_->sink, false);
    archive_.reset();
    for (const auto &log : logs_) {
        log->archived_ = false;
    }
    throw RunError("cannot write " + path + ": " + reason + "; what was written before is in " + path + ".part");
}

void Recorder::reserve(Ns now, Ns t, Ns step)
{
    for (const auto &log : logs_) {
        const Ns every = std::max(log->every, step);
        if (log->keep && t > now && every > 0) {
            const auto more = static_cast<std::size_t>((t - std::max<Ns>(now, 0)) / every + 2);
            const std::size_t wanted = log->times.size() + more;
            // Ask for twice the room at least, so that many short runs do not copy it each time.
            if (wanted > log->times.capacity()) {
                const std::size_t room = std::max(wanted, 2 * log->times.capacity());
                try {
                    log->times.reserve(room);
                    log->bytes.reserve(room * log->field->size);
                } catch (const std::exception &) { // bad_alloc, or length_error where it cannot be counted
                    throw SetupError("record " + log->instance->path + "." + log->field->name + ": " +
                                     std::to_string(wanted) + " samples of " + std::to_string(log->field->size) +
                                     " bytes are more than there is memory for; record less often, or run in parts");
                }
            }
        }
    }
}

void Recorder::take_due(Ns t)
{
    for (const auto &log : logs_) {
        if (t < log->due_) {
            continue;
        }
        log->due_ = due_after(log->every, t);
        const std::byte *message = log->instance->memory() + log->field->offset;
        if (log->keep) {
            log->times.push_back(t);
            log->bytes.insert(log->bytes.end(), message, message + log->field->size);
        }
        if (log->archived_) {
            Head head;
            std::memcpy(&head, message, sizeof head);
            if (mcap_message(&archive_->writer, log->channel_, t, head.sequence, message, log->field->size) !=
                MCAP_OK) {
                find_next_due();
                abandon_archive();
            }
        }
    }
    find_next_due();
}

void Recorder::find_next_due()
{
    next_due_ = never;
    for (const auto &log : logs_) {
        next_due_ = std::min(next_due_, log->due_);
    }
}

void Recorder::reset()
{
    rewind(-1);
}

void Recorder::rewind(Ns now)
{
    for (const auto &log : logs_) {
        const auto kept = std::upper_bound(log->times.begin(), log->times.end(), now) - log->times.begin();
        log->times.resize(static_cast<std::size_t>(kept));
        log->bytes.resize(static_cast<std::size_t>(kept) * log->field->size);
        log->due_ = due_after(log->every, now);
    }
    find_next_due();
}

} // namespace fledge::sim
