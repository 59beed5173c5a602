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
// Who waits says so, and only then is it woken: a node by a futex in its memory. The controller waits
// for many nodes and for sockets at once, so it has a pipe for all of them (Bell).
#pragma once

#include "cosim/protocol.h"
#include "cosim/shared_memory.h"

#include <algorithm>
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

/// Where nodes ring for their controller. One end each.
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

    /// From now on a ring makes fd() readable. Look once more at all that may ring, then poll.
    void arm();
    /// No longer. `rang`: fd() was readable.
    void disarm(bool rang);
    int fd() const { return pipe_[0]; }

    std::string memory_path() const { return memory_.path(); }
    std::string pipe_path() const { return path_of(pipe_[1]); }
    std::uint64_t nonce() const { return nonce_; }

private:
    Memory &words() const;

    SharedMemory memory_;
    int pipe_[2] = {-1, -1}; ///< to read, to write
    std::uint64_t nonce_ = 0;
};

class SharedChannel {
public:
    struct Memory;

    /// The controller's end, with new memory. `spin`: so long the node looks for frames before it
    /// sleeps. Throws LinkError.
    SharedChannel(const Bell &bell, std::chrono::nanoseconds spin, const Limits &limits);
    /// The node's end of what stands at a path. Throws LinkError if it is not there, or other memory.
    SharedChannel(const std::string &path, std::uint64_t nonce, const Limits &limits);

    std::string path() const { return memory_.path(); }
    std::uint64_t nonce() const { return nonce_; }
    /// The other side has opened it, or never will.
    void hide() { memory_.hide(); }

    bool is_controllers() const { return !bell_; }

    /// Put a frame in. What finds no room is kept, for flush(). Throws ProtocolError if the other side
    /// counts nonsense, or the frame is larger than the limit.
    void send(std::span<const std::byte> frame);
    /// Put in more of what was kept. Whether nothing is left.
    bool flush();

    /// The next frame, into `frame`; false if none is there yet. Does flush(). Throws ProtocolError.
    bool receive(Bytes &frame);

    /// Whether there is something to receive, or room for what was kept.
    bool pending() const;

    /// The node's end: sleep until something is pending, at most so long.
    void wait(std::chrono::milliseconds most);

private:
    struct Lane;

    Memory &words() const;
    void ring();
    std::size_t filled() const;
    std::size_t room();
    void put(std::span<const std::byte> bytes);

    SharedMemory memory_;
    std::optional<Bell> bell_; ///< the node's end of it; the controller has none here
    std::uint64_t nonce_ = 0;
    Spin spin_; ///< the node's
    std::size_t limit_ = 0;
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
