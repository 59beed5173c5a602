// SPDX-License-Identifier: Apache-2.0
// Memory for instructions of the host: one view to write, one to execute, so that no page is both.
#pragma once

#include <cstddef>
#include <cstdint>

namespace fledge::emulator {

class CodeMemory {
public:
    explicit CodeMemory(std::size_t size);
    ~CodeMemory();
    CodeMemory(const CodeMemory &) = delete;
    CodeMemory &operator=(const CodeMemory &) = delete;

    std::uint8_t *writable() const { return writable_; }
    const std::uint8_t *executable(std::size_t offset) const { return executable_ + offset; }
    std::size_t size() const { return size_; }

private:
    std::size_t size_;
    std::uint8_t *writable_ = nullptr, *executable_ = nullptr;
};

} // namespace fledge::emulator
