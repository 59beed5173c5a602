// SPDX-License-Identifier: Apache-2.0
#include "registers/testing/allocations.h"

#include <atomic>
#include <cstdlib>
#include <new>

namespace {

std::atomic<long> count;

void *allocate(std::size_t n)
{
    count++;
    if (void *p = std::malloc(n)) {
        return p;
    }
    throw std::bad_alloc();
}

} // namespace

void *operator new(std::size_t n)
{
    return allocate(n);
}
void *operator new[](std::size_t n)
{
    return allocate(n);
}
void operator delete(void *p) noexcept
{
    std::free(p);
}
void operator delete[](void *p) noexcept
{
    std::free(p);
}
void operator delete(void *p, std::size_t) noexcept
{
    std::free(p);
}
void operator delete[](void *p, std::size_t) noexcept
{
    std::free(p);
}

namespace fledge::registers::testing {

long allocations()
{
    return count;
}

} // namespace fledge::registers::testing
