// SPDX-License-Identifier: Apache-2.0
// Counts the allocations of a stretch of code. Linking allocations.cpp replaces operator new.
#pragma once

namespace fledge::sim::testing {

/// Counts from its construction on, in all threads.
class Allocations {
public:
    Allocations();
    long count() const;

private:
    long before_;
};

} // namespace fledge::sim::testing
