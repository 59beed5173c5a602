// SPDX-License-Identifier: Apache-2.0
// Files for tests: the real ones, which the repository does not hold, and damaged ones.
#pragma once

#include "tests/error_of.h"
#include "world/environment/text_input.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>

namespace fledge::world::testing {

/// The path of a file of real data: in FLEDGE_TEST_DATA, or ../shared/data of the repository.
inline std::string real_file(const std::string &name)
{
    const char *folder = std::getenv("FLEDGE_TEST_DATA");
    return (folder ? folder : FLEDGE_ROOT "/../shared/data") + ("/" + name);
}

/// In a test: skip it where a file is not there.
#define SKIP_WITHOUT(path)                                                                                             \
    do {                                                                                                               \
        if (!std::filesystem::exists(path)) {                                                                          \
            GTEST_SKIP() << "not here: " << (path);                                                                    \
        }                                                                                                              \
    } while (false)

/// A file that is gone after the test.
class TemporaryFile {
public:
    TemporaryFile(const std::string &name, const std::string &bytes)
        : path_(::testing::TempDir() + "fledge_" + ::testing::UnitTest::GetInstance()->current_test_info()->name() +
                "_" + name)
    {
        std::ofstream(path_, std::ios::binary) << bytes;
    }
    ~TemporaryFile() { std::filesystem::remove(path_); }
    TemporaryFile(const TemporaryFile &) = delete;
    TemporaryFile &operator=(const TemporaryFile &) = delete;

    const std::string &path() const { return path_; }

private:
    std::string path_;
};

} // namespace fledge::world::testing
