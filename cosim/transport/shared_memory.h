// SPDX-License-Identifier: Apache-2.0
// Memory that several programs of one machine map. It never has a name: others open it through the
// creator's "/proc/PID/fd/N", and the kernel drops it with the last program, however that ends.
//
// Its size is sealed, so that nobody can take it away from under the others.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace fledge::cosim {

class SharedMemory {
public:
    /// All zero. Throws LinkError if the system has none to give.
    static SharedMemory create(std::size_t size);
    /// Another program's. Throws LinkError if there is none of this size, or its size is not sealed.
    static SharedMemory open(const std::string &path, std::size_t size);

    ~SharedMemory();
    SharedMemory(SharedMemory &&other) noexcept;
    SharedMemory &operator=(SharedMemory &&other) noexcept;

    std::span<std::byte> bytes() const { return bytes_; }

    /// Where others find it; "" once it is hidden.
    std::string path() const;
    /// Let nobody else open it from now on.
    void hide();

private:
    SharedMemory() = default;
    void map(std::size_t size);

    int fd_ = -1;
    std::span<std::byte> bytes_;
};

/// "/proc/PID/fd/N" of a descriptor of this program.
std::string path_of(int fd);

} // namespace fledge::cosim
