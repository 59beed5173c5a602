// SPDX-License-Identifier: Apache-2.0
// How deep each stack was used: one for each task.
#pragma once

#include <vector>

#include "emulator/debug/observer.h"
#include "emulator/elf.h"

namespace fledge::emulator {

class StackDepth final : public Observer {
public:
    explicit StackDepth(const Program &program) : program_(program) {}

    void executed(const Executed &step) override;

    struct Stack {
        std::string name; ///< "main"; of a task, the place where it begins: "stacks+0x4a00"
        std::uint32_t top = 0, lowest = 0;
        std::uint32_t size = 0; ///< [bytes] 0: not known
        std::uint32_t used() const { return top - lowest; }
    };
    const std::vector<Stack> &stacks() const { return stacks_; }

private:
    Stack made(std::uint32_t pointer) const;

    const Program &program_;
    std::vector<Stack> stacks_;
    std::size_t present_ = 0;
    std::uint32_t pointer_ = 0;
};

} // namespace fledge::emulator
