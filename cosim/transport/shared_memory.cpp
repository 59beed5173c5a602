// SPDX-License-Identifier: Apache-2.0
#include "cosim/transport/shared_memory.h"

#include "cosim/transport/link_error.h"

#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>
#include <utility>

namespace fledge::cosim {

namespace {

constexpr int seals = F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL;

[[noreturn]] void fail(const std::string &what)
{
    throw LinkError("no shared memory: " + what);
}

} // namespace

std::string path_of(int fd)
{
    return fd < 0 ? "" : "/proc/" + std::to_string(getpid()) + "/fd/" + std::to_string(fd);
}

SharedMemory SharedMemory::create(std::size_t size)
{
    SharedMemory memory;
    memory.fd_ = memfd_create("fledge", MFD_CLOEXEC | MFD_ALLOW_SEALING);
    if (memory.fd_ < 0 || ftruncate(memory.fd_, static_cast<off_t>(size)) || fcntl(memory.fd_, F_ADD_SEALS, seals)) {
        fail(std::strerror(errno));
    }
    memory.map(size);
    return memory;
}

int open_checked(const std::string &path, unsigned type, int flags)
{
    const int looked = ::open(path.c_str(), O_PATH | O_CLOEXEC);
    if (looked < 0) {
        fail(path + ": " + std::strerror(errno));
    }
    struct stat found {};
    const bool fits = !fstat(looked, &found) && (found.st_mode & S_IFMT) == type;
    const int fd = fits ? ::open(("/proc/self/fd/" + std::to_string(looked)).c_str(), flags | O_CLOEXEC) : -1;
    const int why = errno;
    close(looked);
    if (fd < 0) {
        fail(fits ? path + ": " + std::strerror(why) : path + " is no shared memory");
    }
    return fd;
}

SharedMemory SharedMemory::open(const std::string &path, std::size_t size)
{
    SharedMemory memory;
    memory.fd_ = open_checked(path, S_IFREG, O_RDWR);
    struct stat found {};
    if (fstat(memory.fd_, &found) || static_cast<std::size_t>(found.st_size) != size) {
        fail(path + " is no shared memory of this size");
    }
    if ((fcntl(memory.fd_, F_GET_SEALS) & seals) != seals) {
        fail(path + " may change its size");
    }
    memory.map(size);
    memory.hide();
    return memory;
}

void SharedMemory::map(std::size_t size)
{
    void *at = mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED, fd_, 0);
    if (at == MAP_FAILED) {
        fail(std::strerror(errno));
    }
    bytes_ = {static_cast<std::byte *>(at), size};
}

SharedMemory::~SharedMemory()
{
    hide();
    if (!bytes_.empty()) {
        munmap(bytes_.data(), bytes_.size());
    }
}

SharedMemory::SharedMemory(SharedMemory &&other) noexcept
    : fd_(std::exchange(other.fd_, -1)), bytes_(std::exchange(other.bytes_, {}))
{
}

SharedMemory &SharedMemory::operator=(SharedMemory &&other) noexcept
{
    std::swap(fd_, other.fd_);
    std::swap(bytes_, other.bytes_);
    return *this;
}

std::string SharedMemory::path() const
{
    return path_of(fd_);
}

void SharedMemory::hide()
{
    if (fd_ >= 0) {
        close(std::exchange(fd_, -1));
    }
}

} // namespace fledge::cosim
