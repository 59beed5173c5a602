// SPDX-License-Identifier: Apache-2.0
// A model that takes a sky, as Python sets it.
#pragma once

#include <memory>

namespace fledge::world {

class Sky;

class SkyUser {
public:
    virtual ~SkyUser() = default;
    virtual void set_sky(std::shared_ptr<const Sky> sky) = 0;
    virtual const std::shared_ptr<const Sky> &sky() const = 0;
};

} // namespace fledge::world
