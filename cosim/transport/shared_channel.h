// SPDX-License-Identifier: Apache-2.0
// Frames between controller and node through memory that both map: the same bytes as over a socket,
// which stays open beside it to tell whether the other side is there.
//
// The memory of a node holds two rings, one each way. A ring is a stream of bytes; a frame in it is its
// length and its bytes, filled up to a multiple of 8. Writer and reader count the bytes that they have
// written and taken; each keeps its own count for itself, and what it reads of the other's is only
// believed within bounds. A frame is copied out before anybody looks at it. So whatever a peer writes
// into the memory, the worst is a ProtocolError, or a frame that decode() refuses. A frame that is
// longer than a ring goes in pieces.
//
// Who waits says so, and only then is it woken: nodes by a futex that they have in common, so that one
// call wakes all that have got something; the controller by another one or, where it waits for sockets at
// the same time, by a pipe (Bell).
#pragma once

#include "cosim/protocol/protocol.h"
#include "cosim/transport/shared_memory.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <optional>

namespace fledge::cosim {

/// To look for a while before one sleeps: sleeping and waking cost more than a short wait. Where it
/// was in vain, as the other side computes for long or has no processor to run on, it is tried less
/// and less often.
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
        } while (std::chrono::steady_clock::now() < end);
        vain_ = std::min(2 * vain_ + 1, 1023u);
        skip_ = vain_;
        return false;
    }

private:
    /// A processor that waits in a loop lets its twin go ahead.
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

/// Where nodes ring for their controller, and it for them. One end each.
class Bell {
public:
    struct Memory;

    /// The controller's. Throws LinkError.
    Bell();
    /// A node's. Throws LinkError.
    Bell(const std::string &memory, const std::string &pipe, std::uint64_t nonce);
    ~Bell();
    Bell(Bell &&other) noexcept;
    Bell &operator=(Bell &&other) noexcept;

    /// Wake the controller if it sleeps. What it is to find was written before.
    void ring();

    /// The controller's end: this node is to be woken, by the next wake().
    void call(std::size_t slot) { called_[slot / 32 % words_of_slots] |= 1u << slot % 32; }
    void wake();

    /// A node's end: how often wake() was called for its like; sleep until it is called once more. False
    /// if the time is over before (a negative one never is), or a signal came.
    std::uint32_t calls(std::size_t slot) const;
    bool sleep(std::size_t slot, std::uint32_t calls, std::chrono::milliseconds most);

    /// How the controller waits: for nodes alone, by rest(); for sockets, too, by polling fd().
    enum Wait : std::uint32_t { awake = 0, polls = 1, rests = 2 };
    /// From now on a ring ends this wait. Look once more at all that may ring, before it begins.
    void arm(Wait how);
    void rest(std::chrono::milliseconds most);
    /// No longer. `rang`: fd() was readable.
    void disarm(bool rang);
    int fd() const { return pipe_[0]; }

    std::string memory_path() const { return memory_.path(); }
    std::string pipe_path() const { return path_of(pipe_[1]); }
    std::uint64_t nonce() const { return nonce_; }

private:
    static constexpr std::size_t words_of_slots = 8; ///< of 32; with more nodes, some wake in vain

    Memory &words() const;

    SharedMemory memory_;
    std::array<std::uint32_t, words_of_slots> called_{};
    int pipe_[2] = {-1, -1}; ///< to read, to write
    std::uint64_t nonce_ = 0;
};

class SharedChannel {
public:
    struct Memory;

    /// The controller's end, with new memory. The bell lives longer, and wakes the node by this slot.
    /// `spin`: so long the node looks for frames before it sleeps. Throws LinkError.
    SharedChannel(Bell &bell, std::size_t slot, std::chrono::nanoseconds spin, const Limits &limits);
    /// The node's end of what stands at a path. Throws LinkError if it is not there, or other memory.
    SharedChannel(const std::string &path, std::uint64_t nonce, const Limits &limits);

    std::string path() const { return memory_.path(); }
    std::uint64_t nonce() const { return nonce_; }
    /// The other side has opened it, or never will.
    void hide() { memory_.hide(); }

    bool is_controllers() const { return !own_; }

    /// Put a frame in; a node sees it at the latest after Bell::wake(). What finds no room is kept, for
    /// flush(). `urgent`: wake the controller in any case, also if it does not wait for this node.
    /// Throws ProtocolError if the other side counts nonsense, or the frame is larger than the limit.
    void send(std::span<const std::byte> frame, bool urgent = true);
    /// Put in more of what was kept. Whether nothing is left.
    bool flush();

    /// The next frame, into `frame`; false if none is there yet. Does flush(). Throws ProtocolError.
    bool receive(Bytes &frame);

    /// Whether there is something to receive, or room for what was kept.
    bool pending() const;

    /// The controller's end: whether it waits for this node too, when it sleeps.
    void expect(bool expected);

    /// The node's end: sleep until something is pending, at most so long; a negative time: until then or
    /// interrupt(), by another thread.
    void wait(std::chrono::milliseconds most);
    void interrupt();

private:
    struct Lane;

    Memory &words() const;
    void ring(bool urgent = true);
    std::size_t filled() const;
    std::size_t room();
    void put(std::span<const std::byte> bytes);

    SharedMemory memory_;
    Bell *bell_ = nullptr;    ///< the controller's
    std::optional<Bell> own_; ///< the node's end of it
    std::size_t slot_ = 0;
    std::atomic<bool> interrupted_{false};
    std::uint64_t nonce_ = 0;
    Spin spin_; ///< the node's
    std::size_t limit_ = 0;
    bool expected_ = true;
    Lane *in_ = nullptr, *out_ = nullptr;
    std::byte *ring_in_ = nullptr, *ring_out_ = nullptr;
    std::uint64_t taken_ = 0;   ///< from the ring that comes in
    std::uint64_t written_ = 0; ///< to the other one,
    std::uint64_t passed_ = 0;  ///< of which the other side has taken so many, when last looked at
    Bytes kept_;                ///< to be written
    std::size_t kept_at_ = 0;   ///< so many bytes of it were
    Bytes coming_;              ///< a frame of which not all is there
    std::size_t size_ = 0;      ///< of that frame; 0: there is none
    std::size_t missing_ = 0;   ///< so many bytes of it, what fills it up included
};

} // namespace fledge::cosim
