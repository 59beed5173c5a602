// SPDX-License-Identifier: Apache-2.0
#include "cosim/tools/snapshots.h"

#include "record/mcap_crc.h"
#include "sim/error.h"

#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>

namespace fledge::cosim {

namespace {

namespace files = std::filesystem;

constexpr const char *first_line = "fledge snapshots 1", *suffix = ".snapshots";

std::string crc_of(const Payload &bytes)
{
    McapCrc tables;
    mcap_crc_init(&tables);
    char digits[9];
    std::snprintf(digits, sizeof digits, "%08x", mcap_crc_update(&tables, 0, bytes.data(), bytes.size()));
    return digits;
}

/// Reads as many bytes as a line has announced.
class PastReader {
public:
    explicit PastReader(const std::string &path) : path_(path), file_(path, std::ios::binary)
    {
        if (!file_) {
            throw sim::RunError(path + ": it cannot be read");
        }
        left_ = files::file_size(path);
    }

    std::istringstream line()
    {
        std::string text;
        if (!std::getline(file_, text)) {
            fail("it is cut off");
        }
        left_ -= std::min<std::uintmax_t>(left_, text.size() + 1);
        return std::istringstream(text);
    }

    Bytes bytes(std::uint64_t size)
    {
        if (size > left_) {
            fail("it is cut off");
        }
        Bytes bytes(size);
        file_.read(reinterpret_cast<char *>(bytes.data()), static_cast<std::streamsize>(size));
        if (!file_) {
            fail("it is cut off");
        }
        left_ -= size;
        return bytes;
    }

    [[noreturn]] void fail(const std::string &why) const { throw sim::RunError(path_ + ": " + why); }

private:
    std::string path_;
    std::ifstream file_;
    std::uintmax_t left_ = 0;
};

std::string rest_of(std::istringstream &line)
{
    std::string name;
    std::getline(line >> std::ws, name);
    return name;
}

Past::Topic read_topic(PastReader &file, std::istringstream &line)
{
    std::uint64_t size = 0, count = 0;
    line >> size >> count;
    Past::Topic topic{rest_of(line), {}, {}};
    if (!line.eof() || topic.name.empty() || !size || count > (std::uint64_t{1} << 40) || size > Limits{}.frame) {
        file.fail("damaged: a topic without its size, number of messages and name");
    }
    topic.initial = file.bytes(cdr_header + size);
    const Bytes times = file.bytes(count * sizeof(Ns)), structs = file.bytes(count * size);
    for (std::size_t i = 0; i < count; i++) {
        Ns t;
        std::memcpy(&t, times.data() + i * sizeof t, sizeof t);
        topic.messages.emplace_back(t, make_payload(std::span(structs).subspan(i * size, size)));
    }
    return topic;
}

} // namespace

SnapshotFolder::SnapshotFolder(std::string folder, std::size_t most, std::uintmax_t bytes)
    : folder_(std::move(folder)), files_(most), bytes_(bytes)
{
    files::create_directories(folder_);
}

void SnapshotFolder::kept(Ns t, const std::vector<NodeSnapshot> &snapshots)
{
    const std::string path = folder_ + "/" + std::to_string(t) + suffix, part = path + ".part";
    std::ofstream file(part, std::ios::binary);
    file << first_line << '\n';
    for (const NodeSnapshot &snapshot : snapshots) {
        file << "node " << snapshot.reached << ' ' << snapshot.bytes.size() << ' ' << crc_of(snapshot.bytes) << ' '
             << snapshot.node << '\n';
        file.write(reinterpret_cast<const char *>(snapshot.bytes.data()),
                   static_cast<std::streamsize>(snapshot.bytes.size()));
    }
    file << "end\n";
    file.close();
    std::error_code error;
    if (file) {
        files::rename(part, path, error);
    }
    if (!file || error) {
        throw sim::RunError("cannot write the snapshots " + part + ": is there room in the file system?");
    }
    thin();
}

/// Delete files until the rest is within its bounds: always the one between whose neighbours is the shortest time as a
/// part of its age. The first and the last stay.
void SnapshotFolder::thin() const
{
    std::map<Ns, files::directory_entry> all;
    std::uintmax_t bytes = 0;
    for (const auto &entry : files::directory_iterator(folder_)) {
        if (entry.path().extension() == suffix) {
            all[std::stoll(entry.path().stem())] = entry;
            bytes += entry.file_size();
        }
    }
    while (all.size() > 2 && (all.size() > files_ || bytes > bytes_)) {
        const auto now = static_cast<double>(all.rbegin()->first);
        auto least = all.end();
        double gap = 0;
        for (auto it = std::next(all.begin()); std::next(it) != all.end(); ++it) {
            const auto between = static_cast<double>(std::next(it)->first - std::prev(it)->first);
            const double part = between / (now - static_cast<double>(it->first));
            if (least == all.end() || part < gap) {
                least = it;
                gap = part;
            }
        }
        bytes -= least->second.file_size();
        files::remove(least->second);
        all.erase(least);
    }
}

Past read_past(const std::string &path)
{
    PastReader file(path);
    if (file.line().str() != first_line) {
        file.fail(std::string("it has no snapshots: it does not begin with \"") + first_line + "\"");
    }
    Past past;
    for (;;) {
        auto line = file.line();
        std::string what, crc;
        line >> what;
        if (what == "end") {
            return past;
        }
        if (what == "until") {
            line >> past.until;
        } else if (what == "topic") {
            past.topics.push_back(read_topic(file, line));
        } else if (what == "node") {
            NodeSnapshot snapshot;
            std::uint64_t size = 0;
            line >> snapshot.reached >> size >> crc;
            snapshot.node = rest_of(line);
            snapshot.bytes = file.bytes(size);
            if (crc_of(snapshot.bytes) != crc) {
                file.fail("the snapshot of " + snapshot.node + " is damaged: its checksum is " +
                          crc_of(snapshot.bytes) + ", the file says " + crc);
            }
            past.snapshots.push_back(std::move(snapshot));
        } else {
            file.fail("damaged: found \"" + what.substr(0, 40) + "\", expected node, topic, until or end");
        }
    }
}

} // namespace fledge::cosim
