// SPDX-License-Identifier: Apache-2.0
#include "sim/recorder.h"

#include "sim/error.h"
#include "sim/text.h"

#include <algorithm>
#include <cstring>
#include <limits>

namespace fledge::sim {

namespace {

constexpr std::size_t spare_channels = 64; // of what is followed after the archive was opened
constexpr Ns never = std::numeric_limits<Ns>::max();

/// The first multiple of a log's period after t.
Ns due_after(Ns every, Ns t)
{
    return t < 0 ? 0 : every ? (t / every + 1) * every : t + 1;
}

} // namespace

std::string Log::topic() const
{
    std::string topic = "/" + instance->path + "/" + field->name;
    std::replace(topic.begin(), topic.end(), '.', '/');
    return topic;
}

Recorder::Recorder() : next_due_(never) {}

Recorder::~Recorder() = default;

std::shared_ptr<Log> Recorder::record(std::shared_ptr<Instance> instance, const FledgeField &field, Ns every, bool keep,
                                      std::function<bool()> only)
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
        throw SetupError("record " + path + ": the archive " + archive_->path() +
                         " is open; choose what to record before you open it");
    }
    for (const auto &log : logs_) {
        if (log->instance == instance && log->field == &field) {
            log->every = std::min(log->every, every);
            log->keep = log->keep || keep;
            if (!only) {
                log->only.clear();
            } else if (!log->only.empty()) {
                log->only.push_back(std::move(only));
            }
            return log;
        }
    }
    auto log = std::make_shared<Log>();
    log->instance = std::move(instance);
    log->field = &field;
    log->every = every;
    log->keep = keep;
    if (only) {
        log->only.push_back(std::move(only));
    }
    logs_.push_back(log);
    next_due_ = 0; // the next instant computes it again
    return log;
}

std::shared_ptr<Log> Recorder::follow(std::shared_ptr<Instance> instance, const FledgeField &field)
{
    auto log = std::make_shared<Log>();
    log->instance = std::move(instance);
    log->field = &field;
    followed_.push_back(log);
    if (archive_) {
        declare(*log, *archive_);
        log->archived_ = true;
    }
    return log;
}

void Recorder::watch(std::shared_ptr<Watcher> watcher)
{
    watchers_.push_back(std::move(watcher));
    next_due_ = 0; // the next instant computes it again
}

void Recorder::declare(Log &log, ArchiveFile &archive)
{
    log.channel_ = archive.add_channel(log.topic(), log.field->sub->name, log.field->sub->schema);
}

template <class Use> void Recorder::for_all(const Use &use)
{
    for (const auto *logs : {&logs_, &followed_}) {
        for (const auto &log : *logs) {
            use(*log);
        }
    }
}

void Recorder::forget(const std::function<bool(const Log &)> &which)
{
    if (archive_) {
        throw SetupError("the archive " + archive_->path() + " is open; choose what to record before you open it");
    }
    std::erase_if(logs_, [&](const auto &log) { return which(*log); });
    std::erase_if(followed_, [&](const auto &log) { return which(*log); });
    find_next_due();
}

void Recorder::open_archive(const std::string &path, const Pairs &run)
{
    if (archive_) {
        throw SetupError("the archive " + archive_->path() + " is still open");
    }
    auto archive = std::make_unique<ArchiveFile>(path, logs_.size() + followed_.size() + spare_channels);
    archive->metadata("run", run);
    begin_archive(std::move(archive));
}

void Recorder::begin_archive(std::unique_ptr<ArchiveFile> archive)
{
    for_all([&](Log &log) {
        if (log.archive) {
            declare(log, *archive);
        }
        log.archived_ = log.archive;
    });
    archive_ = std::move(archive);
}

bool Recorder::resume_archive(const std::string &path)
{
    if (!resumed_ || !ArchiveFile::lost(path, *resumed_)) {
        return false;
    }
    begin_archive(std::make_unique<ArchiveFile>(path, logs_.size() + followed_.size() + spare_channels));
    write_archive([&] { archive_->take_over(*resumed_); });
    return true;
}

McapMark Recorder::save_archive()
{
    McapMark mark{};
    if (archive_) {
        write_archive([&] { mark = archive_->save(); });
    }
    return mark;
}

/// If the archive cannot be written, the run continues without it, after this error.
template <class Write> void Recorder::write_archive(Write write)
{
    try {
        write();
    } catch (const RunError &) {
        find_next_due();
        take_archive();
        throw;
    }
}

void Recorder::archive_metadata(const std::string &name, const Pairs &pairs)
{
    if (!archive_) {
        throw SetupError("no archive is open for the metadata " + name);
    }
    archive_->metadata(name, pairs);
}

void Recorder::close_archive(const Pairs &end)
{
    if (const auto archive = take_archive()) {
        if (!end.empty()) {
            archive->metadata("end", end);
        }
        archive->close();
    }
}

/// Stop archiving.
std::unique_ptr<ArchiveFile> Recorder::take_archive()
{
    for_all([](Log &log) { log.archived_ = false; });
    return std::move(archive_);
}

void Recorder::reserve(Ns now, Ns t, Ns step)
{
    for (const auto &log : logs_) {
        const Ns every = std::max(log->every, step);
        if (log->keep && log->only.empty() && t > now && every > 0) { // how long a mode lasts is not known
            const auto more = static_cast<std::size_t>((t - std::max<Ns>(now, 0)) / every + 2);
            const std::size_t wanted = log->times.size() + more;
            // At least double the capacity, so that many short runs do not copy the log each time.
            if (wanted > log->times.capacity()) {
                const std::size_t room = std::max(wanted, 2 * log->times.capacity());
                try {
                    log->times.reserve(room);
                    log->bytes.reserve(room * log->field->size);
                } catch (const std::exception &) { // bad_alloc or length_error
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
        const auto holds = [](const auto &condition) { return condition(); };
        if (!log->only.empty() && std::none_of(log->only.begin(), log->only.end(), holds)) {
            continue;
        }
        const std::byte *message = log->instance->memory() + log->field->offset;
        if (log->changes) {
            if (!log->last_.empty() && std::memcmp(log->last_.data(), message, log->last_.size()) == 0) {
                continue;
            }
            log->last_.assign(message, message + log->field->size);
        }
        keep(*log, t);
    }
    stop_wanted_ = false;
    for (const auto &watcher : watchers_) {
        if (t >= watcher->due_) {
            watcher->due_ = due_after(watcher->every, t);
            watcher->take(t);
            stop_wanted_ = stop_wanted_ || watcher->stop;
        }
    }
    if (archive_) {
        write_archive([&] { archive_->save_if_due(); });
    }
    find_next_due();
}

void Recorder::look_early(Ns t, const std::function<bool(const Instance &)> &waits)
{
    for (const auto &watcher : watchers_) {
        if (t >= watcher->due_ && watcher->is_early(waits)) {
            watcher->due_ = due_after(watcher->every, t);
            watcher->take(t);
        }
    }
    find_next_due();
}

void Recorder::written(Log &log, Ns t)
{
    log.keep = log.times.size() < Log::most;
    keep(log, t);
}

void Recorder::keep(Log &log, Ns t)
{
    const std::byte *message = log.instance->memory() + log.field->offset;
    if (log.keep) {
        log.times.push_back(t);
        log.bytes.insert(log.bytes.end(), message, message + log.field->size);
    }
    if (log.archived_) {
        Head head;
        std::memcpy(&head, message, sizeof head);
        write_archive([&] { archive_->message(log.channel_, t, head.sequence, {message, log.field->size}); });
    }
}

void Recorder::find_next_due()
{
    next_due_ = never;
    for (const auto &log : logs_) {
        next_due_ = std::min(next_due_, log->due_);
    }
    for (const auto &watcher : watchers_) {
        next_due_ = std::min(next_due_, watcher->due_);
    }
}

void Recorder::reset()
{
    rewind(-1);
}

void Recorder::rewind(Ns now)
{
    for_all([&](Log &log) {
        const auto n = std::upper_bound(log.times.begin(), log.times.end(), now) - log.times.begin();
        log.times.resize(static_cast<std::size_t>(n));
        log.bytes.resize(static_cast<std::size_t>(n) * log.field->size);
        log.rewinds++;
        log.due_ = due_after(log.every, now);
        log.last_.clear();
    });
    for (const auto &watcher : watchers_) {
        watcher->due_ = due_after(watcher->every, now);
        watcher->rewind(now);
    }
    stop_wanted_ = false;
    find_next_due();
}

} // namespace fledge::sim
