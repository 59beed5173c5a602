// SPDX-License-Identifier: Apache-2.0
#include "sim/testing/allocations.h"

#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <new>

namespace {

std::atomic<long> made{0};

void *allocate(std::size_t size, std::size_t alignment)
{
    made++;
    void *p = alignment <= alignof(std::max_align_t)
                  ? std::malloc(size)
                  : std::aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment);
    if (!p) {
        throw std::bad_alloc();
    }
    return p;
}

} // namespace

void *operator new(std::size_t size)
{
    return allocate(size, 0);
}

void *operator new(std::size_t size, std::align_val_t alignment)
{
    return allocate(size, static_cast<std::size_t>(alignment));
}

// std::stable_sort takes its buffer with this one.
void *operator new(std::size_t size, const std::nothrow_t &) noexcept
{
    made++;
    return std::malloc(size);
}

void operator delete(void *p) noexcept
{
    std::free(p);
}

void operator delete(void *p, std::size_t) noexcept
{
    std::free(p);
}

void operator delete(void *p, std::align_val_t) noexcept
{
    std::free(p);
}

void operator delete(void *p, std::size_t, std::align_val_t) noexcept
{
    std::free(p);
}

namespace fledge::sim::testing {

Allocations::Allocations() : before_(made) {}

long Allocations::count() const
{
    return made - before_;
}

} // namespace fledge::sim::testing
