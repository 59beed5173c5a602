// SPDX-License-Identifier: Apache-2.0
// Snapshots of all nodes of a run as files, and what a run needs that goes on from one of them.
//
// Such a file begins with the line "fledge snapshots 1" and ends with "end". Between them are
//
//     node REACHED SIZE CRC NAME    and SIZE bytes: a node's snapshot at REACHED [ns]; their CRC-32 in hexadecimal
//
// and, in the past of a run, also these, all bytes in the order of the machine:
//
//     until T                       its last instant [ns]
//     topic SIZE COUNT NAME         and the initial payload, COUNT times of writing [ns, int64], COUNT structs
#pragma once

#include "cosim/controller/config.h"

#include <string>

namespace fledge::cosim {

/// Writes T.snapshots into a folder, with T in ns. A file has its name only when it is whole. Of many files, those stay
/// that lie the denser the later they are.
class SnapshotFolder final : public RunListener {
public:
    static constexpr std::size_t most_files = 64;
    static constexpr std::uintmax_t most_bytes = std::uintmax_t{1} << 30;

    /// Throws std::filesystem::filesystem_error if there can be no such folder.
    explicit SnapshotFolder(std::string folder, std::size_t files = most_files, std::uintmax_t bytes = most_bytes);

    void began(const Exchange &) override {}
    void wrote(const std::string &, const std::vector<Record> &) override {}
    /// Throws RunError if the file cannot be written.
    void kept(Ns t, const std::vector<NodeSnapshot> &snapshots) override;
    void ended(const std::string &) override {}

private:
    void thin() const;

    std::string folder_;
    std::size_t files_;
    std::uintmax_t bytes_;
};

/// Throws RunError if the file is damaged, with the reason.
Past read_past(const std::string &path);

} // namespace fledge::cosim
