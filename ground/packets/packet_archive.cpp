// SPDX-License-Identifier: Apache-2.0
#include "ground/packets/packet_archive.h"

#include "ground/packets/packet_file.h"

#include "record/file_sink.h"
#include "record/mcap.h"

#include <cerrno>
#include <condition_variable>
#include <cstring>
#include <fcntl.h>
#include <filesystem>
#include <mutex>
#include <sys/stat.h>
#include <thread>
#include <unistd.h>
#include <unordered_map>
#include <utility>

namespace fledge::ground {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t chunk_size = std::size_t{1} << 18;
constexpr std::size_t most_chunks = 4096; // of a file
constexpr std::size_t most_pending = std::size_t{1} << 26;
constexpr std::int64_t largest_clamp = 1'000'000'000;

std::int64_t seconds()
{
    return std::chrono::duration_cast<std::chrono::seconds>(std::chrono::steady_clock::now().time_since_epoch())
        .count();
}

std::string in_words(int error)
{
    return error == EFBIG ? "the file would exceed the limit on its size (ulimit -f, or the file system's)"
                          : std::strerror(error);
}

} // namespace

struct PacketArchive::File {
    std::string name;
    std::uint32_t session = 0;
    std::int64_t period = 0;
    FileSink sink{.fd = -1, .error = 0, .marked = {}, .part = {}};
    McapWriter writer{};
    McapSchema schema_memory{};
    std::vector<McapChannel> channel_memory;
    std::unique_ptr<std::uint8_t[]> chunk, index; ///< the system allocates pages as they are used
    std::unordered_map<std::string, std::uint16_t> channels;
    std::vector<std::uint8_t> message;
    std::uint32_t sequence = 0;
    std::uint64_t saved = 0; ///< [bytes] behind the last packet that is safe
    std::uint32_t packets_saved = 0;

    explicit File(std::string path) : name(std::move(path)) {}
    File(const File &) = delete;
    File &operator=(const File &) = delete;

    /// A file that is not closed stays NAME.part with the packets that were saved.
    ~File()
    {
        if (sink.fd >= 0) {
            if (ftruncate(sink.fd, static_cast<off_t>(saved)) == 0 && packets_saved == 0) {
                unlink(sink.part);
            }
            file_sink_close(&sink, false);
        }
    }

    void open(std::size_t most_channels)
    {
        const std::size_t index_size = most_chunks * (73 + 10 * most_channels) + 4096;
        channel_memory.resize(most_channels);
        chunk.reset(new std::uint8_t[chunk_size]);
        index.reset(new std::uint8_t[index_size]);
        if (const int error = file_sink_open(&sink, name.c_str())) {
            throw Refusal("cannot write " + name + ".part: " + in_words(error));
        }
        McapConfig config{};
        config.write = file_sink_write;
        config.ahead = file_sink_ahead;
        config.user = &sink;
        config.schemas = &schema_memory;
        config.schemas_max = 1;
        config.channels = channel_memory.data();
        config.channels_max = static_cast<std::uint16_t>(most_channels);
        config.chunk = chunk.get();
        config.chunk_size = chunk_size;
        config.index = index.get();
        config.index_size = index_size;
        require(mcap_open(&writer, &config));
    }

    void require(McapStatus status) const
    {
        if (status != MCAP_OK) {
            throw Refusal("cannot write " + name +
                          ".part: " + (sink.error != 0 ? in_words(sink.error) : mcap_status_text(status)));
        }
    }

    /// Write metadata in front of the next packets; this ends the chunk, so that no saved packet is ever overwritten.
    void metadata(const std::string &about, const std::vector<std::pair<std::string, std::string>> &pairs)
    {
        std::vector<McapPair> list;
        list.reserve(pairs.size());
        for (const auto &[key, value] : pairs) {
            list.push_back({key.c_str(), value.c_str()});
        }
        require(mcap_flush(&writer));
        require(mcap_metadata(&writer, about.c_str(), list.data(), list.size()));
    }

    void put(const std::string &topic, std::int64_t t, std::int64_t received, std::span<const std::uint8_t> packet)
    {
        const auto [at, added] = channels.try_emplace(topic);
        if (added) {
            std::uint16_t type = 0;
            require(mcap_add_schema(&writer, packet_type, packet_schema, &type));
            require(mcap_add_channel(&writer, at->first.c_str(), type, MCAP_ORDER_LITTLE, nullptr, 0, &at->second));
        }
        message.resize(packet_at + packet.size());
        for (std::size_t i = 0; i < 8; i++) {
            message[i] = static_cast<std::uint8_t>(static_cast<std::uint64_t>(t) >> 8 * i);
            message[8 + i] = static_cast<std::uint8_t>(static_cast<std::uint64_t>(received) >> 8 * i);
        }
        for (std::size_t i = 0; i < 4; i++) {
            message[16 + i] = static_cast<std::uint8_t>(packet.size() >> 8 * i);
        }
        std::copy(packet.begin(), packet.end(), message.begin() + packet_at);
        require(mcap_message(&writer, at->second, t, sequence++, message.data(), message.size()));
    }

    void save()
    {
        require(mcap_save(&writer));
        struct stat about {};
        if (fstat(sink.fd, &about) == 0 && about.st_nlink == 0) {
            throw Refusal(name + ".part was deleted while it was written");
        }
        const McapMark mark = mcap_mark(&writer);
        saved = mark.position + (mark.records != 0 ? 49 + mark.records : 0);
        packets_saved = sequence;
    }

    void close()
    {
        require(mcap_close(&writer));
        if (const int error = file_sink_close(&sink, true)) {
            throw Refusal("cannot finish " + name + ": " + in_words(error));
        }
    }
};

/// Syncs the saved file to the disk, some time later and in a thread of its own: a sync may take 0.1 s.
class PacketArchive::Disk {
public:
    explicit Disk(std::chrono::milliseconds within) : within_(within), thread_([this] { run(); }) {}
    Disk(const Disk &) = delete;
    Disk &operator=(const Disk &) = delete;

    ~Disk()
    {
        {
            const std::lock_guard lock(mutex_);
            over_ = true;
        }
        changed_.notify_one();
        thread_.join();
    }

    /// Request a sync of this file. Returns the errno of the last failed sync, once.
    int saved(const std::string &path)
    {
        const std::lock_guard lock(mutex_);
        if (path_.empty()) {
            changed_.notify_one();
        }
        path_ = path; // a different file before it was synced when it was closed
        return std::exchange(error_, 0);
    }

private:
    void run()
    {
        std::unique_lock lock(mutex_);
        while (!over_) {
            changed_.wait(lock, [&] { return over_ || !path_.empty(); });
            changed_.wait_for(lock, within_, [&] { return over_; });
            const std::string path = std::exchange(path_, "");
            if (over_ || path.empty()) {
                continue;
            }
            lock.unlock();
            const int error = sync(path, false);
            const int folder_error = path != known_ ? sync(fs::path(path).parent_path(), true) : 0; // a new name
            known_ = path;
            lock.lock();
            error_ = error != 0 ? error : folder_error;
        }
    }

    static int sync(const std::string &path, bool folder)
    {
        const int fd = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
        if (fd < 0) {
            return 0; // the file is complete and was renamed
        }
        const bool safe = (folder ? fsync(fd) : fdatasync(fd)) == 0 || errno == EINVAL || errno == ENOSYS;
        const int error = safe ? 0 : errno;
        ::close(fd);
        return error;
    }

    const std::chrono::milliseconds within_;
    std::mutex mutex_;
    std::condition_variable changed_;
    std::string path_, known_; ///< the file to sync, "": none; the file that was synced last
    int error_ = 0;
    bool over_ = false;
    std::thread thread_; ///< the last member: it uses the others
};

PacketArchive::PacketArchive(const std::string &folder, std::string craft, const Database &database,
                             std::int64_t period, std::chrono::milliseconds synced)
    : craft_(std::move(craft)), folder_(folder + "/" + craft_), db_(database), period_(period)
{
    if (craft_.empty() || craft_[0] == '.' || craft_.find('/') != std::string::npos) {
        throw Refusal("a spacecraft with an archive has a name without \"/\" that does not begin with a dot; found \"" +
                      craft_ + "\"");
    }
    if (period_ <= 0 || db_.containers.size() > 65000) {
        throw Refusal(period_ <= 0 ? "the period of an archive's files is more than 0"
                                   : "an archive is for at most 65000 containers; the database has " +
                                         std::to_string(db_.containers.size()));
    }
    std::error_code error;
    fs::create_directories(folder_, error);
    lock_ = error ? -1 : open((folder_ + "/lock").c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666);
    if (lock_ < 0) {
        throw Refusal("cannot write an archive into " + folder_ + ": " +
                      (error ? error.message() : std::strerror(errno)));
    }
    struct flock whole {};
    whole.l_type = F_WRLCK;
    if (fcntl(lock_, F_OFD_SETLK, &whole) != 0) {
        ::close(lock_);
        throw Refusal("another program writes the archive in " + folder_ +
                      " now; let it end, or choose another folder");
    }
    try {
        std::vector<std::string> left;
        for (const auto &entry : fs::directory_iterator(folder_)) {
            const std::string name = entry.path().filename();
            unsigned number = 0;
            if (std::sscanf(name.c_str(), "%6u-", &number) == 1 && name.find(".mcap") != std::string::npos) {
                session_ = std::max(session_, number);
                if (name.ends_with(".part") || name.ends_with(".lost")) {
                    left.push_back(entry.path().string().substr(0, entry.path().string().size() - 5));
                }
            }
        }
        for (const std::string &name : left) {
            recover(name);
        }
    } catch (const fs::filesystem_error &failed) {
        ::close(lock_);
        throw Refusal("cannot read " + folder_ + ": " + failed.code().message());
    }
    announce(++session_);
    disk_ = std::make_unique<Disk>(synced);
}

/// Write the number of the open session into the lock, where readers see it.
void PacketArchive::announce(std::uint32_t session) const
{
    char text[16];
    std::snprintf(text, sizeof text, "%06u\n", session);
    static_cast<void>(pwrite(lock_, text, 7, 0) == 7); // on a full disk, the session looks as if it had ended
}

PacketArchive::~PacketArchive()
{
    try {
        close();
    } catch (const Refusal &) { // the files say what is missing
        ::close(lock_);
    }
}

/// Make NAME of NAME.part, which a killed program has left: readers read it as NAME.lost until NAME is complete. If
/// that is not possible, it stays NAME.part, and readers read what is in it.
void PacketArchive::recover(const std::string &name) const
{
    const std::string lost = name + ".lost", part = name + ".part";
    std::error_code ignored;
    if (fs::exists(name, ignored)) { // complete: the program was killed before it removed the other
        fs::remove(lost, ignored);
        return;
    }
    if (!fs::exists(lost, ignored)) {
        fs::rename(part, lost, ignored);
    }
    try {
        PacketFile old(lost);
        File complete(name);
        if (old.count != 0 && old.missing.empty()) {
            complete.open(old.channels.size());
            for (const auto &[about, pairs] : old.metadata) {
                complete.metadata(about, {pairs.begin(), pairs.end()});
            }
            for (const auto &chunk : old.chunks) {
                old.each(chunk, [&](const Stored &stored) {
                    complete.put(old.channels[stored.channel].topic, stored.t, stored.received, stored.packet);
                    return true;
                });
            }
        }
        if (old.missing.empty()) {
            if (old.count != 0) {
                complete.close();
            }
            fs::remove(lost, ignored);
            return;
        }
    } catch (const Refusal &) { // as on a full disk
    }
    fs::rename(lost, part, ignored);
}

const std::string &PacketArchive::topic(Id container)
{
    if (topics_.empty()) {
        for (const Container &entry : db_.containers) {
            topics_.push_back("/" + craft_ + entry.path);
        }
        topics_.push_back("/" + craft_ + "/undecoded");
    }
    return topics_[std::min<std::size_t>(container, topics_.size() - 1)];
}

void PacketArchive::put(const Arrival &arrival, Id container)
{
    std::int64_t t = arrival.t;
    if (t < 0) {
        throw Refusal("a packet for the archive has the time " + std::to_string(t) + " ns; it is at least 0");
    }
    if (t < last_ && last_ - t <= largest_clamp) {
        t = last_;
    }
    session_ += t < last_ ? 1 : 0;
    const std::int64_t before = std::exchange(last_, t);
    if (!problem_.empty() && (gap_.packets != 0 || bytes_.size() + arrival.bytes.size() > most_pending)) {
        if (gap_.packets++ == 0) {
            gap_.from = before >= 0 && before < t ? before : t;
            gap_.why = problem_;
        }
        gap_.to = std::max(gap_.from, t);
        lost_++;
        return;
    }
    pending_.push_back({session_, container, t, arrival.received, bytes_.size(), arrival.bytes.size()});
    bytes_.insert(bytes_.end(), arrival.bytes.begin(), arrival.bytes.end());
}

void PacketArchive::missing(std::int64_t from, std::int64_t to, std::string why)
{
    missing_.push_back({from, to, 0, std::move(why)});
}

void PacketArchive::save()
{
    const std::int64_t now = seconds();
    if (!problem_.empty() && now == retry_) {
        throw Refusal(problem_);
    }
    retry_ = now;
    // After a failed write, try a new file at once: the limit of the old file's size may be the reason.
    for (int attempts = problem_.empty() ? 2 : 1; attempts-- != 0;) {
        try {
            write();
            problem_.clear();
            break;
        } catch (const Refusal &refusal) {
            problem_ = refusal.what();
            file_.reset();
        }
    }
    if (!problem_.empty()) {
        throw Refusal(problem_);
    }
    if (const int error = file_ != nullptr ? disk_->saved(file_->sink.part) : 0) {
        throw Refusal("packets of the last seconds may not be on the disk: " + file_->name +
                      ".part: " + in_words(error));
    }
}

/// Write all pending packets, each into the file of its session and period.
void PacketArchive::write()
{
    std::size_t done = 0;
    const auto forget = [&] { // the packets in a file that has ended
        pending_.erase(pending_.begin(), pending_.begin() + static_cast<std::ptrdiff_t>(done));
        done = 0;
    };
    for (; done < pending_.size(); done++) {
        Pending next = pending_[done];
        if (file_ != nullptr && (file_->session != next.session || file_->period != next.t / period_ ||
                                 file_->writer.n_chunks >= most_chunks)) {
            end(file_->session != next.session ? "the clock stepped back" : nullptr);
            forget();
        }
        if (file_ == nullptr) {
            begin(next);
        }
        file_->put(topic(next.container), next.t, next.received, {bytes_.data() + next.at, next.size});
    }
    if (gap_.packets != 0) {
        missing_.push_back(std::exchange(gap_, {}));
    }
    for (; file_ != nullptr && !missing_.empty(); missing_.erase(missing_.begin())) {
        const Gap &gap = missing_.front();
        file_->metadata("gap", {{"from", std::to_string(gap.from)},
                                {"to", std::to_string(gap.to)},
                                {"why", gap.why},
                                {"packets", std::to_string(gap.packets)}});
    }
    if (file_ != nullptr) {
        file_->save();
    }
    pending_.clear();
    bytes_.clear();
}

void PacketArchive::begin(const Pending &first)
{
    std::error_code ignored;
    fs::create_directories(folder_, ignored);
    char session[16];
    std::snprintf(session, sizeof session, "%06u-", first.session);
    std::string name;
    const auto taken = [&](const char *suffix) { return fs::exists(name + suffix, ignored); };
    for (std::int64_t t = first.t; name.empty() || taken("") || taken(".part") || taken(".lost"); t++) {
        name = folder_ + "/" + session + std::to_string(t) + ".mcap"; // an older file may have this time
    }
    auto file = std::make_unique<File>(name);
    file->open(db_.containers.size() + 1);
    file->session = first.session;
    file->period = first.t / period_;
    file_ = std::move(file);
    announce(first.session);
    file_->metadata("archive", {{"craft", craft_},
                                {"session", std::to_string(first.session)},
                                {"database", hash_text(db_)},
                                {"received", std::to_string(first.received)}});
    file_->save();
}

/// Close the file, which gets its final name. why: of the session's end, if it ends with this file.
void PacketArchive::end(const char *why)
{
    if (why != nullptr) {
        file_->metadata("ended", {{"why", why}});
    }
    file_->close();
    file_.reset();
}

void PacketArchive::close()
{
    if (!pending_.empty() || gap_.packets != 0 || !missing_.empty()) {
        retry_ = -1;
        save();
    }
    if (file_ != nullptr) {
        try {
            end("closed");
        } catch (const Refusal &) {
            file_.reset();
            throw;
        }
    }
    ::close(std::exchange(lock_, -1));
}

} // namespace fledge::ground
