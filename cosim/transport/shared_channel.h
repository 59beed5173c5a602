// SPDX-License-Identifier: Apache-2.0
// Frames between controller and node through memory that both map. The bytes are the same as over a socket, which
// stays open to show whether the other side is there.
//
// The memory of a node holds two rings, one each way. A ring is a stream of bytes; a frame in it is its length and
// its bytes, padded to a multiple of 8. Writer and reader count the bytes that they have written and taken. Each
// keeps a copy of its own count, and checks the count of the other side. The reader copies a frame out before it
// parses the frame. So whatever a peer writes into the memory, the worst result is a ProtocolError. A frame longer
// than a ring goes in pieces.
//
// A side that sleeps sets a flag, and only then does the other side wake it. All nodes sleep on one futex, so that
// one system call wakes all that have got a frame. The controller sleeps on another futex or, if it waits for
// sockets at the same time, on a pipe (WakeUp).
#pragma once

#include "cosim/protocol/protocol.h"
#include "cosim/transport/shared_memory.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <optional>

#include <sched.h>

namespace fledge::cosim {

/// Busy waiting before a sleep: sleeping and waking cost more than a short wait. If it fails, as the other side
/// computes for long or has no processor to run on, it is tried less and less often.
class Spin {
public:
    explicit Spin(std::chrono::nanoseconds most = {}) : most_(most) {}

    /// Whether `there` came true.
    template <class Condition> bool spin(const Condition &there)
    {
        if (!most_.count() || skip_) {
            skip_ -= skip_ > 0;
            return false;
        }
        const auto end = std::chrono::steady_clock::now() + most_;
        do {
            for (int i = 0; i < 16; i++) {
                if (there()) {
                    vain_ = 0;
                    return true;
                }
                pause();
            }
            sched_yield(); // the other side may have no processor of its own
        } while (std::chrono::steady_clock::now() < end);
        vain_ = std::min(2 * vain_ + 1, 1023u);
        skip_ = vain_;
        return false;
    }

private:
    /// Gives the core to its other hardware thread.
    static void pause()
    {
#if defined(__x86_64__) || defined(__i386__)
        __builtin_ia32_pause();
#elif defined(__aarch64__)
        asm volatile("yield");
#endif
    }

    std::chrono::nanoseconds most_;
    unsigned vain_ = 0, skip_ = 0;
};

/// Wakes a sleeping controller, and sleeping nodes. Each program has one end.
class WakeUp {
public:
    struct Memory;

    /// The controller's. Throws LinkError.
    WakeUp();
    /// A node's. Throws LinkError.
    WakeUp(const std::string &memory, const std::string &pipe, std::uint64_t nonce);
    ~WakeUp();
    WakeUp(const WakeUp &) = delete;
    WakeUp &operator=(const WakeUp &) = delete;

    /// Wake the controller if it sleeps, after writing a frame.
    void ring();

    /// The controller's end: the next wake() wakes this node.
    void call(std::size_t slot) { called_[slot / 32 % words_of_slots] |= 1u << slot % 32; }
    void wake();

    /// A node's end: the number of calls of wake() for its group of slots; sleep until the next one. False after a
    /// timeout (a negative time: none), or a signal.
    std::uint32_t calls(std::size_t slot) const;
    bool sleep(std::size_t slot, std::uint32_t calls, std::chrono::milliseconds most);

    /// How the controller waits: by rest() for nodes only; by polling fd() for sockets, too.
    enum Wait : std::uint32_t { awake = 0, polls = 1, rests = 2 };
    /// From now on ring() ends this wait. Check all nodes once more before the wait begins.
    void arm(Wait how);
    void rest(std::chrono::milliseconds most);
    /// The wait is over. `rang`: fd() was readable.
    void disarm(bool rang);
    int fd() const { return pipe_[0]; }

    std::string memory_path() const { return memory_.path(); }
    std::string pipe_path() const { return path_of(pipe_[1]); }
    std::uint64_t nonce() const { return nonce_; }

private:
    static constexpr std::size_t words_of_slots = 8; ///< of 32; with more nodes, slots share a bit

    Memory &words() const;

    SharedMemory memory_;
    std::array<std::uint32_t, words_of_slots> called_{};
    int pipe_[2] = {-1, -1}; ///< to read, to write
    std::uint64_t nonce_ = 0;
};

class SharedChannel {
public:
    struct Memory;

    /// The controller's end, with new memory. `wake_up` outlives it, and wakes the node by this slot.
    /// `spin`: the node's busy waiting before it sleeps. Throws LinkError.
    SharedChannel(WakeUp &wake_up, std::size_t slot, std::chrono::nanoseconds spin, const Limits &limits);
    /// The node's end of the memory at a path. Throws LinkError if there is none, or it is other memory.
    SharedChannel(const std::string &path, std::uint64_t nonce, const Limits &limits);

    std::string path() const { return memory_.path(); }
    std::uint64_t nonce() const { return nonce_; }
    /// After the other side has opened it, or will not.
    void hide() { memory_.hide(); }

    bool is_controllers() const { return !own_; }

    /// Put a frame in. A sleeping node sees it after WakeUp::wake(). flush() sends what finds no room.
    /// `urgent`: wake the controller even if it does not wait for this node.
    /// Throws ProtocolError if the other side's count is wrong, or the frame is larger than the limit.
    void send(std::span<const std::byte> frame, bool urgent = true);
    /// Put in more of what found no room. True if nothing is left.
    bool flush();

    /// Take the next frame; false if there is none yet. Calls flush(). Throws ProtocolError.
    bool receive(Bytes &frame);

    /// Whether there is something to receive, or new room for flush().
    bool pending() const;

    /// The controller's end: whether this node wakes the controller.
    void wake_on_message(bool wakes);

    /// The node's end: sleep until something is pending. A negative time: no timeout, but another thread may
    /// call interrupt().
    void wait(std::chrono::milliseconds most);
    void interrupt();

private:
    struct Side;

    Memory &words() const;
    void ring(bool urgent = true);
    std::size_t filled() const;
    std::size_t room();
    void put(std::span<const std::byte> bytes);

    SharedMemory memory_;
    WakeUp *wake_up_ = nullptr; ///< the controller's
    std::optional<WakeUp> own_; ///< the node's end of it
    std::size_t slot_ = 0;
    std::atomic<bool> interrupted_{false};
    std::uint64_t nonce_ = 0;
    Spin spin_; ///< the node's
    std::size_t limit_ = 0;
    bool wakes_ = true;
    Side *own_side_ = nullptr, *other_side_ = nullptr;
    std::byte *ring_in_ = nullptr, *ring_out_ = nullptr;
    std::uint64_t taken_ = 0;   ///< from the ring that comes in
    std::uint64_t written_ = 0; ///< to the other one,
    std::uint64_t passed_ = 0;  ///< of these, the other side had taken so many at the last look
    Bytes kept_;                ///< frames without room
    std::size_t kept_at_ = 0;   ///< bytes of it that were written
    Bytes coming_;              ///< an incomplete frame
    std::size_t size_ = 0;      ///< of that frame; 0: there is none
    std::size_t missing_ = 0;   ///< bytes of it that are still to come, padding included
};

} // namespace fledge::cosim
