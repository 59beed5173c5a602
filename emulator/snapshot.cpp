// SPDX-License-Identifier: Apache-2.0
// The file: magic and version, the hash of what follows, then numbers and bytes as this kind of host has them.
#include "emulator/snapshot.h"

#include <algorithm>
#include <cstring>

#include "emulator/error.h"

namespace fledge::emulator {

namespace {

constexpr char magic[16] = "FLEDGE LEON3 2\n"; // the number is the version

class Writer {
public:
    template <typename T> void value(const T &v)
    {
        static_assert(std::is_trivially_copyable_v<T>);
        bytes(std::as_bytes(std::span(&v, 1)));
    }
    void bytes(std::span<const std::byte> b) { out_.insert(out_.end(), b.begin(), b.end()); }
    void block(std::span<const std::byte> b)
    {
        value(std::uint64_t{b.size()});
        bytes(b);
    }
    std::vector<std::byte> take() { return std::move(out_); }

private:
    std::vector<std::byte> out_;
};

class SnapshotReader {
public:
    explicit SnapshotReader(std::span<const std::byte> in) : in_(in) {}
    std::span<const std::byte> bytes(std::uint64_t n)
    {
        if (n > in_.size()) {
            throw Error("the snapshot is truncated");
        }
        const auto part = in_.first(n);
        in_ = in_.subspan(n);
        return part;
    }
    template <typename T> T value()
    {
        T v;
        std::memcpy(&v, bytes(sizeof v).data(), sizeof v);
        return v;
    }
    std::vector<std::byte> block()
    {
        const auto part = bytes(value<std::uint64_t>());
        return {part.begin(), part.end()};
    }

private:
    std::span<const std::byte> in_;
};

} // namespace

std::uint64_t Snapshot::hash_of(std::span<const std::byte> bytes)
{
    std::uint64_t hash = 0xCBF29CE484222325; // FNV-1a
    for (const std::byte b : bytes) {
        hash = (hash ^ std::to_integer<std::uint64_t>(b)) * 0x100000001B3;
    }
    return hash;
}

std::vector<std::byte> Snapshot::write() const
{
    Writer w;
    w.value(board);
    w.value(std::uint64_t{sizeof cpu});
    w.value(cpu);
    w.value(resets);
    w.value(std::uint64_t{devices.size()});
    for (const auto &state : devices) {
        w.block(state);
    }
    w.value(std::uint64_t{flips.size()});
    for (const auto &[address, flip] : flips) {
        w.value(address);
        w.value(flip);
    }
    w.value(std::uint64_t{boot ? boot->segments.size() + 1 : 0});
    if (boot) {
        w.value(boot->entry);
        for (const BootImage::Segment &s : boot->segments) {
            w.value(s.address);
            w.block(s.bytes);
        }
    }
    w.value(std::uint64_t{pages.size()});
    for (const auto &page : pages) {
        w.value(std::uint8_t{page != nullptr});
        if (page) {
            w.bytes(*page);
        }
    }
    const std::vector<std::byte> body = w.take();
    Writer file;
    file.value(magic);
    file.value(hash_of(body));
    file.bytes(body);
    return file.take();
}

std::shared_ptr<const Snapshot> Snapshot::read(std::span<const std::byte> bytes, std::uint64_t board)
{
    SnapshotReader r(bytes);
    if (!std::ranges::equal(r.bytes(sizeof magic), std::as_bytes(std::span(magic)))) {
        throw Error("this is no snapshot, or one of another version");
    }
    if (r.value<std::uint64_t>() != hash_of(bytes.subspan(sizeof magic + sizeof(std::uint64_t)))) {
        throw Error("the snapshot is truncated or damaged");
    }
    const auto s = std::make_shared<Snapshot>();
    s->board = r.value<std::uint64_t>();
    if (s->board != board || r.value<std::uint64_t>() != sizeof s->cpu) {
        throw Error("the snapshot is of another board, or of another version");
    }
    s->cpu = r.value<CpuState>();
    s->resets = r.value<std::uint64_t>();
    for (auto n = r.value<std::uint64_t>(); n > 0; n--) {
        s->devices.push_back(r.block());
    }
    for (auto n = r.value<std::uint64_t>(); n > 0; n--) {
        const auto address = r.value<std::uint32_t>();
        s->flips[address] = r.value<EdacFlips>();
    }
    if (auto n = r.value<std::uint64_t>(); n > 0) {
        const auto boot = std::make_shared<BootImage>();
        boot->entry = r.value<std::uint32_t>();
        while (--n > 0) {
            const auto address = r.value<std::uint32_t>();
            boot->segments.push_back({address, r.block()});
        }
        s->boot = boot;
    }
    for (auto n = r.value<std::uint64_t>(); n > 0; n--) {
        std::shared_ptr<Page> page;
        if (r.value<std::uint8_t>() != 0) {
            page = std::make_shared<Page>();
            std::ranges::copy(r.bytes(page_size), page->begin());
        }
        s->pages.push_back(std::move(page));
    }
    return s;
}

} // namespace fledge::emulator
