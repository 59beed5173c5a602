// SPDX-License-Identifier: Apache-2.0
// A folder of a test.
#ifndef CCSDS_TESTING_FOLDER_H
#define CCSDS_TESTING_FOLDER_H

#include <cstdlib>
#include <filesystem>
#include <string>

namespace ccsds::testing {

/// It is removed at the end.
struct Folder {
    std::filesystem::path path;
    Folder()
    {
        std::string name = (std::filesystem::temp_directory_path() / "fledge-cfdp-XXXXXX").string();
        path = mkdtemp(name.data());
    }
    ~Folder() { std::filesystem::remove_all(path); }
    Folder(const Folder &) = delete;
};

} // namespace ccsds::testing

#endif
