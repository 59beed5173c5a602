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

/// Until it is closed, the file is NAME.part; one that is left or fails stays so, readable up to its last
/// whole chunk. All functions throw RunError if the file cannot be written; it takes nothing more then.
class ArchiveFile {
public:
    /// With room for so many channels.
    ArchiveFile(std::string path, std::size_t channels);
    ~ArchiveFile();
    ArchiveFile(const ArchiveFile &) = delete;
    ArchiveFile &operator=(const ArchiveFile &) = delete;

    void metadata(const std::string &name, const Pairs &pairs);
    /// A topic of its own name; `type` is the message's ("NavAttitude"), `schema` its ros2msg text.
    std::uint16_t add_channel(const std::string &topic, const std::string &type, const std::string &schema,
                              const Pairs &pairs = {});
    /// A message's struct, in the machine's byte order, at t >= 0 [ns].
    void message(std::uint16_t channel, std::int64_t t, std::uint32_t sequence, std::span<const std::byte> bytes)
    {
        require(mcap_message(&writer_, channel, t, sequence, bytes.data(), bytes.size()));
    }
    /// Complete the file, which gets its name.
    void close();

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

    std::string path_;
    std::unique_ptr<Memory> memory_;
    McapWriter writer_{};
};

} // namespace fledge::sim
