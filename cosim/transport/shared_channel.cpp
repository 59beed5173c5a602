// SPDX-License-Identifier: Apache-2.0
#include "cosim/transport/shared_channel.h"

#include "cosim/transport/link_error.h"

#include <algorithm>
#include <cerrno>
#include <climits>
#include <cstring>
#include <fcntl.h>
#include <linux/futex.h>
#include <new>
#include <random>
#include <string_view>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>
#include <utility>

namespace fledge::cosim {

namespace {

constexpr char magic[8] = {'F', 'L', 'E', 'D', 'G', 'S', 'M', '2'};
constexpr std::size_t ring_size = 16384; ///< of each way: some ticks fit in, and it stays in the cache
constexpr std::size_t word = 8;

static_assert(std::atomic<std::uint32_t>::is_always_lock_free && std::atomic<std::uint64_t>::is_always_lock_free);

struct Head {
    char magic[8];
    std::uint64_t nonce, spin, slot;
    char wake_up[64], pipe[64];
};

/// Before each frame in a ring.
struct Length {
    std::uint32_t size, zero;
};
static_assert(sizeof(Length) == word);

std::size_t padded(std::size_t n)
{
    return (n + word - 1) / word * word;
}

std::uint64_t draw_nonce()
{
    std::random_device device;
    return static_cast<std::uint64_t>(device()) << 32 | device();
}

void set_text(char (&to)[64], const std::string &text)
{
    if (text.size() >= sizeof to) {
        throw LinkError("no shared memory: the path " + text + " is too long");
    }
    std::memcpy(to, text.c_str(), text.size() + 1);
}

std::string text_of(const char (&from)[64])
{
    return {from, strnlen(from, sizeof from)};
}

} // namespace

// ---- waking up

struct WakeUp::Memory {
    std::uint64_t nonce;
    alignas(64) std::atomic<std::uint32_t> armed;
    alignas(64) std::atomic<std::uint32_t> calls[words_of_slots];
};

WakeUp::Memory &WakeUp::words() const
{
    return *std::launder(reinterpret_cast<Memory *>(memory_.bytes().data()));
}

WakeUp::WakeUp() : memory_(SharedMemory::create(sizeof(Memory))), nonce_(draw_nonce())
{
    if (pipe2(pipe_, O_NONBLOCK | O_CLOEXEC)) {
        throw LinkError(std::string("no pipe: ") + std::strerror(errno));
    }
    (new (memory_.bytes().data()) Memory{})->nonce = nonce_;
}

WakeUp::WakeUp(const std::string &memory, const std::string &pipe, std::uint64_t nonce)
    : memory_(SharedMemory::open(memory, sizeof(Memory))), nonce_(nonce)
{
    if (words().nonce != nonce) {
        throw LinkError("no shared memory: the wake-up memory is another one");
    }
    // Also for reading: else writing to a lost controller would raise SIGPIPE.
    pipe_[1] = open_checked(pipe, S_IFIFO, O_RDWR | O_NONBLOCK);
}

WakeUp::~WakeUp()
{
    for (const int fd : pipe_) {
        if (fd >= 0) {
            close(fd);
        }
    }
}

void WakeUp::ring()
{
    std::atomic_thread_fence(std::memory_order_seq_cst);
    std::atomic<std::uint32_t> &armed = words().armed;
    switch (armed.load(std::memory_order_relaxed) ? armed.exchange(awake) : awake) {
    case polls: (void)!write(pipe_[1], "", 1); break; // a full pipe is readable already
    case rests: syscall(SYS_futex, &armed, FUTEX_WAKE, 1, nullptr, nullptr, 0); break;
    default: break;
    }
}

void WakeUp::wake()
{
    for (std::size_t i = 0; i < words_of_slots; i++) {
        if (const std::uint32_t waiters = std::exchange(called_[i], 0)) {
            std::atomic<std::uint32_t> &calls = words().calls[i];
            calls.fetch_add(1);
            syscall(SYS_futex, &calls, FUTEX_WAKE_BITSET, INT_MAX, nullptr, nullptr, waiters);
        }
    }
}

std::uint32_t WakeUp::calls(std::size_t slot) const
{
    return words().calls[slot / 32 % words_of_slots].load();
}

bool WakeUp::sleep(std::size_t slot, std::uint32_t calls, std::chrono::milliseconds most)
{
    timespec until{};
    if (most.count() >= 0) {
        clock_gettime(CLOCK_MONOTONIC, &until);
        const auto ns = until.tv_nsec + most.count() % 1000 * 1'000'000;
        until = {until.tv_sec + most.count() / 1000 + ns / 1'000'000'000, ns % 1'000'000'000};
    }
    return !syscall(SYS_futex, &words().calls[slot / 32 % words_of_slots], FUTEX_WAIT_BITSET, calls,
                    most.count() >= 0 ? &until : nullptr, nullptr, 1u << slot % 32) ||
           errno == EAGAIN;
}

void WakeUp::rest(std::chrono::milliseconds most)
{
    const timespec rest = {most.count() / 1000, most.count() % 1000 * 1'000'000};
    syscall(SYS_futex, &words().armed, FUTEX_WAIT, rests, &rest, nullptr, 0);
}

void WakeUp::arm(Wait how)
{
    words().armed.store(how, std::memory_order_relaxed);
    std::atomic_thread_fence(std::memory_order_seq_cst);
}

void WakeUp::disarm(bool rang)
{
    words().armed.store(awake, std::memory_order_relaxed);
    char bytes[256];
    while (rang && read(pipe_[0], bytes, sizeof bytes) == sizeof bytes) {
    }
}

// ---- a node's memory

/// What one end writes, on a cache line of its own: the other end then fetches it at once.
struct alignas(64) SharedChannel::Side {
    std::atomic<std::uint64_t> written; ///< bytes, into its ring
    std::atomic<std::uint64_t> taken;   ///< bytes, from the other ring
    std::atomic<std::uint32_t> blocked; ///< it waits for room in its ring
    std::atomic<std::uint32_t> away;    ///< the node sleeps; the controller does not wait for this node
};

struct SharedChannel::Memory {
    Head head;
    Side controller, node;
    alignas(64) std::byte rings[2][ring_size]; ///< to the node, to the controller
};

SharedChannel::Memory &SharedChannel::words() const
{
    return *std::launder(reinterpret_cast<Memory *>(memory_.bytes().data()));
}

SharedChannel::SharedChannel(WakeUp &wake_up, std::size_t slot, std::chrono::nanoseconds spin, const Limits &limits)
    : memory_(SharedMemory::create(sizeof(Memory))), wake_up_(&wake_up), slot_(slot), nonce_(wake_up.nonce()),
      limit_(limits.frame)
{
    Memory &memory = *new (memory_.bytes().data()) Memory{};
    std::memcpy(memory.head.magic, magic, sizeof magic);
    memory.head.nonce = nonce_;
    memory.head.spin = static_cast<std::uint64_t>(spin.count());
    memory.head.slot = slot;
    set_text(memory.head.wake_up, wake_up.memory_path());
    set_text(memory.head.pipe, wake_up.pipe_path());
    own_side_ = &memory.controller;
    other_side_ = &memory.node;
    ring_out_ = memory.rings[0];
    ring_in_ = memory.rings[1];
}

SharedChannel::SharedChannel(const std::string &path, std::uint64_t nonce, const Limits &limits)
    : memory_(SharedMemory::open(path, sizeof(Memory))), nonce_(nonce), limit_(limits.frame)
{
    Memory &memory = words();
    const Head head = memory.head;
    if (std::memcmp(head.magic, magic, sizeof magic) || head.nonce != nonce) {
        throw LinkError("no shared memory: " + path + " is another one");
    }
    own_.emplace(text_of(head.wake_up), text_of(head.pipe), nonce);
    slot_ = head.slot;
    spin_ = Spin(std::chrono::nanoseconds(std::min<std::uint64_t>(head.spin, 1'000'000)));
    own_side_ = &memory.node;
    other_side_ = &memory.controller;
    ring_in_ = memory.rings[0];
    ring_out_ = memory.rings[1];
}

void SharedChannel::wake_on_message(bool wakes)
{
    if (wakes != wakes_) {
        wakes_ = wakes;
        own_side_->away.store(!wakes, std::memory_order_relaxed); // WakeUp::arm() follows
    }
}

void SharedChannel::ring(bool urgent)
{
    std::atomic_thread_fence(std::memory_order_seq_cst);
    const bool away = other_side_->away.load(std::memory_order_relaxed) != 0;
    if (wake_up_ && away) {
        wake_up_->call(slot_);
    } else if (!wake_up_ && (urgent || !away)) {
        own_->ring();
    }
}

void SharedChannel::wait(std::chrono::milliseconds most)
{
    if (spin_.spin([&] { return pending(); })) {
        return;
    }
    own_side_->away.store(1, std::memory_order_relaxed);
    std::atomic_thread_fence(std::memory_order_seq_cst);
    // wake() also wakes other nodes of the same slot.
    for (std::uint32_t calls = own_->calls(slot_); !pending() && !interrupted_ && own_->sleep(slot_, calls, most);) {
        calls = own_->calls(slot_);
    }
    own_side_->away.store(0, std::memory_order_relaxed);
}

void SharedChannel::interrupt()
{
    interrupted_ = true;
    own_->call(slot_);
    own_->wake();
}

// ---- the rings

std::size_t SharedChannel::filled() const
{
    const std::uint64_t n = other_side_->written.load(std::memory_order_acquire) - taken_;
    if (n > ring_size || n % word) {
        throw ProtocolError("the shared memory counts " + std::to_string(n) + " bytes in a ring of " +
                            std::to_string(ring_size));
    }
    return n;
}

std::size_t SharedChannel::room()
{
    const std::uint64_t passed = other_side_->taken.load(std::memory_order_acquire);
    if (passed - passed_ > written_ - passed_ || passed % word) {
        throw ProtocolError("the shared memory counts more bytes taken than were written");
    }
    passed_ = passed;
    return ring_size - (written_ - passed_);
}

/// There is room.
void SharedChannel::put(std::span<const std::byte> bytes)
{
    const std::size_t at = written_ % ring_size, first = std::min(bytes.size(), ring_size - at);
    std::memcpy(ring_out_ + at, bytes.data(), first);
    std::memcpy(ring_out_, bytes.data() + first, bytes.size() - first);
    written_ += padded(bytes.size());
}

void SharedChannel::send(std::span<const std::byte> frame, bool urgent)
{
    if (frame.size() > limit_) {
        throw ProtocolError("a frame of " + std::to_string(frame.size()) + " bytes; " + std::to_string(limit_) +
                            " are the most");
    }
    const Length length{static_cast<std::uint32_t>(frame.size()), 0};
    const auto head = std::as_bytes(std::span(&length, 1));
    if (kept_.empty() && word + padded(frame.size()) <= room()) {
        put(head);
        put(frame);
        own_side_->written.store(written_, std::memory_order_release);
        return ring(urgent);
    }
    kept_.insert(kept_.end(), head.begin(), head.end());
    kept_.insert(kept_.end(), frame.begin(), frame.end());
    kept_.resize(padded(kept_.size()));
    flush();
}

bool SharedChannel::flush()
{
    if (kept_.empty()) {
        return true;
    }
    own_side_->blocked.store(1, std::memory_order_relaxed);
    std::atomic_thread_fence(std::memory_order_seq_cst);
    if (const std::size_t n = std::min(room(), kept_.size() - kept_at_)) {
        put(std::span(kept_).subspan(kept_at_, n));
        kept_at_ += n;
        own_side_->written.store(written_, std::memory_order_release);
        ring();
    }
    if (kept_at_ == kept_.size()) {
        kept_.clear();
        kept_at_ = 0;
        own_side_->blocked.store(0, std::memory_order_relaxed);
    }
    return kept_.empty();
}

bool SharedChannel::receive(Bytes &frame)
{
    flush();
    std::size_t n = filled();
    if (!n) {
        return false;
    }
    if (!size_) {
        Length length;
        std::memcpy(&length, ring_in_ + taken_ % ring_size, sizeof length);
        if (length.size == 0 || length.zero || length.size > limit_) {
            throw ProtocolError("a frame of " + std::to_string(length.size) + " bytes in the shared memory; " +
                                std::to_string(limit_) + " are the most");
        }
        size_ = length.size;
        missing_ = padded(size_);
        taken_ += sizeof length;
        n -= sizeof length;
        coming_.clear();
    }
    n = std::min(n, missing_);
    const std::size_t at = taken_ % ring_size, first = std::min(n, ring_size - at);
    coming_.insert(coming_.end(), ring_in_ + at, ring_in_ + at + first);
    coming_.insert(coming_.end(), ring_in_, ring_in_ + (n - first));
    taken_ += n;
    missing_ -= n;
    own_side_->taken.store(taken_, std::memory_order_release);
    std::atomic_thread_fence(std::memory_order_seq_cst);
    if (other_side_->blocked.load(std::memory_order_relaxed)) {
        ring();
    }
    if (missing_) {
        return false;
    }
    coming_.resize(std::exchange(size_, 0));
    std::swap(frame, coming_);
    return true;
}

bool SharedChannel::pending() const
{
    return other_side_->written.load(std::memory_order_acquire) != taken_ ||
           (!kept_.empty() && other_side_->taken.load(std::memory_order_acquire) != passed_);
}

} // namespace fledge::cosim
