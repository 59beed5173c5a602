// SPDX-License-Identifier: Apache-2.0
// An MCAP file that is being written: record/mcap.h with its memory, its file and its errors.
#pragma once

#include "record/mcap.h"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace fledge::sim {

using Pairs = std::vector<std::pair<std::string, std::string>>;

/// Until it is closed, the file is NAME.part; one that is left or fails stays so. A program that is killed loses what
/// it recorded in its last second. All functions throw RunError if the file cannot be written; it takes nothing more
/// then.
class ArchiveFile {
public:
    /// With room for so many channels.
    ArchiveFile(std::string path, std::size_t channels);
    ~ArchiveFile();
    ArchiveFile(const ArchiveFile &) = delete;
    ArchiveFile &operator=(const ArchiveFile &) = delete;

    void metadata(const std::string &name, const Pairs &pairs);
    /// A topic, or the channel that it has already; `type` is the message's ("NavAttitude"), `schema` its ros2msg text.
    std::uint16_t add_channel(const std::string &topic, const std::string &type, const std::string &schema,
                              const Pairs &pairs = {});
    /// A message's struct, in the machine's byte order, at t >= 0 [ns].
    void message(std::uint16_t channel, std::int64_t t, std::uint32_t sequence, std::span<const std::byte> bytes)
    {
        require(mcap_message(&writer_, channel, t, sequence, bytes.data(), bytes.size()));
    }
    /// Give the system all messages: they stay, whatever becomes of this program. The mark is of the file so far.
    McapMark save();
    /// The same, in each second of the wall clock once. The finished file has the same bytes, whenever that is.
    void save_if_due()
    {
        if (const std::int64_t now = seconds(); now != saved_) {
            save();
        }
    }
    /// Complete the file, which gets its name.
    void close();

    /// Whether a lost program has left the file of the mark as NAME.part. Then it becomes NAME.lost.
    static bool lost(const std::string &path, const McapMark &mark);
    /// Write what NAME.lost has up to its mark: metadata and messages, for the same channels as there. Then delete it.
    void take_over(const McapMark &mark);

    const std::string &path() const { return path_; }

private:
    struct Memory; ///< that the writer points into
    void require(McapStatus status)
    {
        if (status != MCAP_OK) {
            abandon(status);
        }
    }
    [[noreturn]] void abandon(McapStatus status);
    static std::int64_t seconds();
    void copy(std::span<const std::uint8_t> records);

    std::string path_;
    std::int64_t saved_ = seconds(); ///< [s] of the wall clock
    std::unique_ptr<Memory> memory_;
    McapWriter writer_{};
};

} // namespace fledge::sim
