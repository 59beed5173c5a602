// SPDX-License-Identifier: Apache-2.0
// Memory that several programs of one machine map. It has no name: other programs open it through the creator's
// "/proc/PID/fd/N", and the kernel frees it with the last program.
//
// Its size is sealed, so that no program can truncate it under the others.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace fledge::cosim {

class SharedMemory {
public:
    /// All zero. Throws LinkError if the system has no memory.
    static SharedMemory create(std::size_t size);
    /// Of another program. Throws LinkError if it has another size, or its size is not sealed.
    static SharedMemory open(const std::string &path, std::size_t size);

    ~SharedMemory();
    SharedMemory(SharedMemory &&other) noexcept;
    SharedMemory &operator=(SharedMemory &&other) noexcept;

    std::span<std::byte> bytes() const { return bytes_; }

    /// Where other programs find it; "" once it is hidden.
    std::string path() const;
    /// From now on, no other program can open it.
    void hide();

private:
    SharedMemory() = default;
    void map(std::size_t size);

    int fd_ = -1;
    std::span<std::byte> bytes_;
};

/// Open a file of another program if it is of this type, such as S_IFREG. It looks at the file before it opens it,
/// because opening a device may have effects. Throws LinkError.
int open_checked(const std::string &path, unsigned type, int flags);

/// "/proc/PID/fd/N" of a descriptor of this program.
std::string path_of(int fd);

} // namespace fledge::cosim
