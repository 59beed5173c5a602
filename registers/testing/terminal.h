// SPDX-License-Identifier: Apache-2.0
// Tests of serial lines fly over pseudo terminals, which a container may not have.
#pragma once

#include <gtest/gtest.h>

#include "registers/outside.h"
#include "registers/serial_port.h"

namespace fledge::registers {

/// Skips its tests where no pseudo terminal can be made, and says why.
class TerminalTest : public ::testing::Test {
protected:
    void SetUp() override
    {
        try {
            const SerialPort port;
        } catch (const Error &error) {
            GTEST_SKIP() << error.what();
        }
    }
};

} // namespace fledge::registers
