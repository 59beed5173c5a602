// SPDX-License-Identifier: Apache-2.0
// Reads a file of the packet archive by its index, or from the beginning if it is unfinished or damaged.
#pragma once

#include "ground/database/model.h"
#include "record/mcap_reader.h"

#include <algorithm>
#include <map>
#include <span>

namespace fledge::ground {

/// The message of a packet, behind the 4 bytes of CDR: t, received, the size of the packet, the packet.
inline constexpr std::size_t packet_at = 8 + 8 + 4;
inline constexpr char packet_type[] = "fledge/msg/GroundPacket";
inline constexpr char packet_schema[] = "int64 t  # t [ns] of the spacecraft's clock\n"
                                        "int64 received  # received [ns] UTC since 1970\n"
                                        "uint8[] packet  # packet\n";

/// The hash of a database as 16 hexadecimal digits, as it is in a file's metadata.
std::string hash_text(const Database &database);

/// A packet in a file.
struct Stored {
    std::int64_t t, received;
    std::uint16_t channel;
    std::span<const std::uint8_t> packet;
};

/// A stretch of time of which packets are missing, and why.
struct Missing {
    std::int64_t from, to;
    std::string why;
};

class PacketFile {
public:
    struct Channel {
        std::string topic;
        std::uint64_t count = 0;
    };
    struct Chunk {
        std::uint64_t at = 0, size = 0; ///< [bytes] where its record begins; of the records in it
        bool ended = false;             ///< false: packets may be added
        std::int64_t first = 0, last = 0;
        std::vector<std::uint16_t> channels;
    };
    using Metadata = std::vector<std::pair<std::string, std::map<std::string, std::string>>>;

    /// Throws Refusal if it cannot be read or is no MCAP file.
    explicit PacketFile(std::string path);
    ~PacketFile() { close(); }
    PacketFile(const PacketFile &) = delete;
    PacketFile &operator=(const PacketFile &) = delete;

    /// Read what was added to an unfinished file. Throws Refusal if the file is no longer there.
    void refresh();
    /// Close the descriptor; the next read opens it again.
    void close();

    /// Visit each packet of a chunk in its order, until `visit` returns false. A damaged chunk is skipped and added to
    /// `missing`. The packets live until the next call.
    template <class Visit> bool each(const Chunk &chunk, const Visit &visit)
    {
        const auto bytes = records(chunk);
        Stored stored{};
        for (std::size_t at = 0; next(bytes, at, stored);) {
            if (stored.channel != 0 && !visit(std::as_const(stored))) {
                return false;
            }
        }
        return true;
    }

    const std::string path;
    bool whole = false;      ///< the file has its end, and nothing is added
    std::uint64_t count = 0; ///< of packets
    std::int64_t first = 0, last = 0;
    std::map<std::uint16_t, Channel> channels;
    std::vector<Chunk> chunks;
    Metadata metadata;
    std::vector<Missing> missing; ///< the damaged parts

private:
    void open();
    std::span<const std::uint8_t> read(std::uint64_t at, std::uint64_t n, std::vector<std::uint8_t> &into) const;
    std::span<const std::uint8_t> records(const Chunk &chunk);
    bool next(std::span<const std::uint8_t> bytes, std::size_t &at, Stored &stored);
    std::span<const std::uint8_t> summary(std::vector<std::uint8_t> &into) const;
    std::uint64_t take_statistics(record::Fields &fields);
    void take_chunk_index(record::Fields &fields);
    void take_metadata_index(record::Fields &fields);
    bool read_summary();
    Chunk chunk_of(std::span<const std::uint8_t> head) const;
    void read_metadata(std::span<const std::uint8_t> content);
    bool is_unsaved(std::uint64_t at) const;
    void scan();
    void scan_chunk(Chunk chunk);
    void damaged(std::uint64_t at, std::int64_t from, std::int64_t to, const std::string &problem);

    int fd_ = -1;
    std::uint64_t size_ = 0, scanned_ = 0;
    std::map<std::uint16_t, std::uint64_t> open_counts_; ///< of the last chunk, if packets may be added to it
    std::vector<std::uint8_t> buffer_;
};

} // namespace fledge::ground
