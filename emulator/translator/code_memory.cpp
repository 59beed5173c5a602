// SPDX-License-Identifier: Apache-2.0
#include "emulator/translator/code_memory.h"

#include <cerrno>
#include <system_error>

#include <sys/mman.h>
#include <unistd.h>

namespace fledge::emulator {

CodeMemory::CodeMemory(std::size_t size) : size_(size)
{
    const int file = memfd_create("translated", MFD_CLOEXEC);
    void *views[2] = {MAP_FAILED, MAP_FAILED};
    if (file >= 0 && ftruncate(file, static_cast<off_t>(size)) == 0) {
        views[0] = mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
        views[1] = mmap(nullptr, size, PROT_READ | PROT_EXEC, MAP_SHARED, file, 0);
    }
    const int error = errno;
    if (file >= 0) {
        close(file);
    }
    writable_ = static_cast<std::uint8_t *>(views[0]);
    executable_ = static_cast<std::uint8_t *>(views[1]);
    if (views[0] == MAP_FAILED || views[1] == MAP_FAILED) {
        for (void *view : views) {
            if (view != MAP_FAILED) {
                munmap(view, size);
            }
        }
        throw std::system_error(error, std::generic_category(), "memory for translated code");
    }
}

CodeMemory::~CodeMemory()
{
    munmap(writable_, size_);
    munmap(executable_, size_);
}

} // namespace fledge::emulator
