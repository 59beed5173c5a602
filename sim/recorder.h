// SPDX-License-Identifier: Apache-2.0
// Records of messages: kept in memory for the user's plots, written to an archive, or both.
#pragma once

#include "sim/archive_file.h"
#include "sim/instance.h"

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace fledge::sim {

/// The samples of one port, taken at the first instant at or after each multiple of `every`.
struct Log {
    std::shared_ptr<Instance> instance;
    const FledgeField *field = nullptr;
    Ns every = 0;                                ///< 0: at each instant
    bool keep = true;                            ///< in memory
    bool archive = true;                         ///< into an archive; false: that has all messages of the port
    bool changes = false;                        ///< only samples that differ from the one before
    std::vector<std::function<bool()>> only;     ///< only where one of these holds; none: everywhere
    static constexpr std::size_t most = 100'000; ///< samples in memory, of what Recorder::written() brings

    std::vector<Ns> times;
    std::vector<std::byte> bytes; ///< times.size() samples of field->size bytes
    std::uint64_t rewinds = 0;    ///< how often samples may have been dropped

    std::string topic() const; ///< "/flight/control/torque"

private:
    friend class Recorder;
    Ns due_ = 0;
    std::uint16_t channel_ = 0; ///< in the archive
    bool archived_ = false;
    std::vector<std::byte> last_; ///< of `changes`
};

/// Looks at a simulation at the first instant at or after each multiple of `every`.
class Watcher {
public:
    virtual ~Watcher() = default;
    virtual void take(Ns t) = 0;
    /// The simulation went to the instant `now`; -1: to its beginning.
    virtual void rewind(Ns now) = 0;

    /// Whether none of what it looks at waits for the rest of an instant that is held: then it looks before.
    virtual bool is_early(const std::function<bool(const Instance &)> & /* waits */) const { return false; }

    Ns every = 0;      ///< 0: at each instant
    bool stop = false; ///< the run shall end after this instant

private:
    friend class Recorder;
    Ns due_ = 0;
};

class Recorder {
public:
    Recorder();
    ~Recorder(); ///< an archive still open is left as NAME.part

    /// Record a port from now on, while `only` holds, if it is given. A port that is already recorded has one log, with
    /// the shorter of the two periods, and where any of both holds.
    /// Throws SetupError if the field is no port, `every` is negative, or an archive is open.
    std::shared_ptr<Log> record(std::shared_ptr<Instance> instance, const FledgeField &field, Ns every,
                                bool keep = true, std::function<bool()> only = {});
    const std::vector<std::shared_ptr<Log>> &logs() const { return logs_; }
    /// Record each writing of a port from now on, also into an archive that is open.
    std::shared_ptr<Log> follow(std::shared_ptr<Instance> instance, const FledgeField &field);
    const std::vector<std::shared_ptr<Log>> &followed() const { return followed_; }
    /// Let someone look from now on; a clone has none.
    void watch(std::shared_ptr<Watcher> watcher);
    bool take_stop() { return std::exchange(stop_wanted_, false); } ///< whether a watcher wants the run to end

    /// The message of a log that follows it was written at t. Throws RunError as take().
    void written(Log &log, Ns t);
    /// Take these records out. Throws SetupError if an archive is open.
    void forget(const std::function<bool(const Log &)> &which);

    /// Write all logs to an MCAP file from now on, with this metadata under the name "run". Until it
    /// is closed, the file is NAME.part. Throws RunError if it cannot be written.
    void open_archive(const std::string &path, const Pairs &run);
    /// Finish the file, with this metadata under the name "end". Throws RunError with the reason and
    /// where the readable part lies.
    void close_archive(const Pairs &end = {});
    /// More metadata, under a name of its own. Throws SetupError if no archive is open, RunError as close_archive.
    void archive_metadata(const std::string &name, const Pairs &pairs);
    bool archiving() const { return archive_ != nullptr; }

    /// Let the system have all of the archive now, so that no message is lost if this program is killed. The mark is
    /// of the archive so far; all zero without one.
    McapMark save_archive();
    /// This simulation goes on from the snapshot of a lost program, whose archive had this mark then.
    void resume_from(const McapMark &mark) { resumed_ = mark; }
    bool resumed() const { return resumed_.has_value(); }
    /// As open_archive(), but the archive begins with what the lost program's has up to its mark, metadata included.
    /// Returns false, and does nothing, if NAME.part is not that archive.
    bool resume_archive(const std::string &path);

    /// Room for the samples after the instant `now` up to t, so that the loop does not allocate.
    /// `step` is the shortest time between instants.
    void reserve(Ns now, Ns t, Ns step);
    bool keeps() const { return !logs_.empty(); } ///< else there is nothing to reserve

    /// Take the records that are due at t. Throws RunError once, if the archive cannot be written;
    /// its readable part stays, and the logs go on.
    void take(Ns t)
    {
        if (t >= next_due_) {
            take_due(t);
        }
    }

    /// What watchers can see at t, an instant that is held. waits: whether an instance may change in the rest of it.
    void take_early(Ns t, const std::function<bool(const Instance &)> &waits)
    {
        if (t >= next_due_) {
            look_early(t, waits);
        }
    }

    /// Empty the logs and start anew at 0.
    void reset();

    /// The simulation went to the instant `now`: drop the samples after it.
    void rewind(Ns now);

private:
    void take_due(Ns t);
    void look_early(Ns t, const std::function<bool(const Instance &)> &waits);
    void keep(Log &log, Ns t);
    void declare(Log &log, ArchiveFile &archive);
    template <class Use> void for_all(const Use &use);
    void find_next_due();
    std::unique_ptr<ArchiveFile> take_archive();
    void begin_archive(std::unique_ptr<ArchiveFile> archive);
    template <class Write> void write_archive(Write write);

    std::optional<McapMark> resumed_;
    std::vector<std::shared_ptr<Log>> logs_, followed_;
    std::vector<std::shared_ptr<Watcher>> watchers_;
    std::unique_ptr<ArchiveFile> archive_;
    Ns next_due_;
    bool stop_wanted_ = false;
};

} // namespace fledge::sim
