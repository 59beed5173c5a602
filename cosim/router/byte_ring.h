// SPDX-License-Identifier: Apache-2.0
// A lock-free queue of byte entries from one thread to another, of fixed size. It touches only the memory that it uses.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <span>

namespace fledge::cosim {

class ByteRing {
public:
    explicit ByteRing(std::size_t room) : size_(room / 8 * 8), bytes_(new std::byte[size_]) {}

    /// The largest entry that always finds room in an empty ring.
    std::size_t largest() const { return size_ / 2 - 16; }

    /// The writer: room for an entry of n bytes, until commit(). Null if there is none.
    std::byte *claim(std::size_t n)
    {
        if (n > largest()) {
            return nullptr;
        }
        const std::size_t need = 8 + (n + 7) / 8 * 8;
        const std::size_t head = head_.load(std::memory_order_relaxed);
        const std::size_t at = head % size_, rest = size_ - at;
        const std::size_t skipped = need > rest ? rest : 0;
        if (skipped + need > size_ - (head - seen_tail_)) {
            seen_tail_ = tail_.load(std::memory_order_acquire);
            if (skipped + need > size_ - (head - seen_tail_)) {
                return nullptr;
            }
        }
        if (skipped) {
            put(at, skip);
        }
        const std::size_t begin = skipped ? 0 : at;
        put(begin, n);
        claimed_ = head + skipped + need;
        return bytes_.get() + begin + 8;
    }
    void commit() { head_.store(claimed_, std::memory_order_release); }

    /// The writer: how full it is, from 0 to 1.
    double fill() const
    {
        return static_cast<double>(head_.load(std::memory_order_relaxed) - tail_.load(std::memory_order_acquire)) /
               static_cast<double>(size_);
    }

    /// The reader: the first entry, until pop(). Its data are null if there is none.
    std::span<const std::byte> front()
    {
        for (;;) {
            const std::size_t tail = tail_.load(std::memory_order_relaxed);
            if (tail == head_.load(std::memory_order_acquire)) {
                return {};
            }
            const std::size_t at = tail % size_;
            const std::uint64_t n = get(at);
            if (n != skip) {
                return {bytes_.get() + at + 8, n};
            }
            tail_.store(tail + (size_ - at), std::memory_order_release);
        }
    }
    void pop()
    {
        const std::size_t tail = tail_.load(std::memory_order_relaxed);
        tail_.store(tail + 8 + (get(tail % size_) + 7) / 8 * 8, std::memory_order_release);
    }

private:
    static constexpr std::uint64_t skip = ~std::uint64_t{0}; ///< the rest of the buffer is unused

    void put(std::size_t at, std::uint64_t x) { std::memcpy(bytes_.get() + at, &x, sizeof x); }
    std::uint64_t get(std::size_t at) const
    {
        std::uint64_t x;
        std::memcpy(&x, bytes_.get() + at, sizeof x);
        return x;
    }

    std::size_t size_;
    std::unique_ptr<std::byte[]> bytes_;
    alignas(64) std::atomic<std::size_t> head_{0}; ///< bytes ever written
    std::size_t claimed_ = 0, seen_tail_ = 0;      ///< used by the writer
    alignas(64) std::atomic<std::size_t> tail_{0}; ///< bytes ever read
};

} // namespace fledge::cosim
