// SPDX-License-Identifier: Apache-2.0
// The packets of a spacecraft in MCAP files, as they arrive.
//
// FOLDER/CRAFT has a file for each period of a session, SESSION-T.mcap by the time of its first packet [ns]; while it
// is written, SESSION-T.mcap.part. A session is a stretch of time that begins when a program opens the archive, or when
// the clock steps back. The file has a channel for each container, /CRAFT/path/of/container, and /CRAFT/undecoded for
// packets that no container fits. Metadata:
//   archive   craft, session, database (the hash of its files)
//   gap       from, to [ns], why, packets (how many arrived and are not in the archive)
//   ended     why: the session ended with this file
//
// Example:
//
//     #include "ground/packets/history.h"
//     using namespace ground;
//     void keep(const Database &database, const Arrival &packet)
//     {
//         PacketArchive archive("archive", "imager", database, 3600'000'000'000);
//         archive.put(packet, no_id);
//         archive.save();
//         History history("archive", "imager", database, "");
//         const auto temperature = history.series({"temperature"}, {}, 1000);
//     }
#pragma once

#include "ground/monitor/arrival.h"

#include <chrono>
#include <memory>
#include <string>
#include <vector>

namespace fledge::ground {

class PacketArchive final : public PacketSink {
public:
    /// Open for writing, and complete the files that a killed program has left. period: [ns] of the spacecraft's clock.
    /// synced: within that time after save(), packets are on the disk, safe also from a loss of power. Throws Refusal,
    /// as when another program writes there.
    PacketArchive(const std::string &folder, std::string craft, const Database &database, std::int64_t period,
                  std::chrono::milliseconds synced = std::chrono::seconds(5));
    ~PacketArchive() override;

    /// Add a packet; it is in memory until save(). A time that steps back by up to a second becomes the last time.
    void put(const Arrival &arrival, Id container) override;

    /// Throws Refusal when the packets cannot be written. They stay in memory, up to 64 MiB of them, until a later
    /// save() can write them into a new file; a gap in the files' metadata counts those that are lost.
    void save() override;

    /// Record that packets of these times [ns] were lost before they arrived here.
    void missing(std::int64_t from, std::int64_t to, std::string why);

    /// End the session: another program may write there then. Throws as save().
    void close();

    /// Why packets are not saved; "": they are.
    const std::string &problem() const { return problem_; }

    /// How many packets were dropped so far, because memory had no room for them either.
    std::uint64_t lost() const { return lost_; }

private:
    struct File; ///< the file that is being written
    class Disk;
    struct Pending {
        std::uint32_t session;
        Id container;
        std::int64_t t, received;
        std::size_t at, size; ///< in bytes_
    };
    struct Gap {
        std::int64_t from = 0, to = 0;
        std::uint64_t packets = 0; ///< 0: there is none
        std::string why;
    };

    void recover(const std::string &name) const;
    void announce(std::uint32_t session) const;
    void write();
    void begin(const Pending &first);
    void end(const char *why);
    const std::string &topic(Id container);

    const std::string craft_, folder_;
    const Database &db_;
    const std::int64_t period_;
    int lock_ = -1;
    std::uint32_t session_ = 0;
    std::int64_t last_ = -1;  ///< [ns] of the session's last packet
    std::int64_t retry_ = -1; ///< [s] of the wall clock
    std::vector<std::string> topics_;
    std::unique_ptr<File> file_;
    std::unique_ptr<Disk> disk_;
    std::vector<Pending> pending_;
    std::vector<std::uint8_t> bytes_;
    Gap gap_;
    std::vector<Gap> missing_; ///< gaps that are not in a file yet
    std::uint64_t lost_ = 0;
    std::string problem_;
};

} // namespace fledge::ground
