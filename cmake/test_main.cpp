// SPDX-License-Identifier: Apache-2.0
// The main function of all tests in GoogleTest. A program holds the tests of a folder, and ctest knows each source by
// itself: `PROGRAM --source=a/b_test.cpp` runs the cases of that source which GTEST_FILTER selects. Where GTEST_OUTPUT
// names a folder, `--report=a.b_test` puts their report into a.b_test.xml there: two programs may have a source.
// Temporary files of the tests, and of what they start, are in a folder of this program, which it removes: another run,
// perhaps of another user, writes the same names.
#include <gtest/gtest.h>

#include <fnmatch.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <string_view>
#include <system_error>

namespace {

/// Whether one of the patterns, which colons part, has the form of this name.
bool matches(const std::string &patterns, const std::string &name)
{
    for (std::size_t at = 0; at < patterns.size();) {
        const std::size_t end = std::min(patterns.find(':', at), patterns.size());
        if (::fnmatch(patterns.substr(at, end - at).c_str(), name.c_str(), 0) == 0) {
            return true;
        }
        at = end + 1;
    }
    return false;
}

/// What a filter of GoogleTest, "WANTED-UNWANTED", selects of the cases of one source, as another such filter.
std::string cases_of(const std::string &source, const std::string &filter)
{
    const std::size_t dash = std::min(filter.find('-'), filter.size());
    const std::string wanted = dash == 0 ? "*" : filter.substr(0, dash);
    const std::string unwanted = dash < filter.size() ? filter.substr(dash + 1) : "";
    std::string cases;
    const auto &all = *testing::UnitTest::GetInstance();
    for (int i = 0; i < all.total_test_suite_count(); i++) {
        const testing::TestSuite &suite = *all.GetTestSuite(i);
        for (int j = 0; j < suite.total_test_count(); j++) {
            const testing::TestInfo &info = *suite.GetTestInfo(j);
            const std::string name = std::string(suite.name()) + "." + info.name();
            if (("/" + std::string(info.file())).ends_with("/" + source) && matches(wanted, name) &&
                !matches(unwanted, name)) {
                cases += (cases.empty() ? "" : ":") + name;
            }
        }
    }
    return cases.empty() ? "-*" : cases;
}

} // namespace

int main(int argc, char **argv)
{
    const auto given = [&](std::string_view option) {
        std::string value;
        for (int i = 1; i < argc; i++) {
            if (std::string_view(argv[i]).starts_with(option)) {
                value = argv[i] + option.size();
            }
        }
        return value;
    };
    const std::string source = given("--source="), report = given("--report=");
    // GoogleTest opens the report, and makes tests with parameters, when it is initialised.
    if (std::string &output = testing::GTEST_FLAG(output); !report.empty() && output.ends_with('/')) {
        output += report + ".xml";
    }
    testing::InitGoogleTest(&argc, argv);
    if (!source.empty()) {
        testing::GTEST_FLAG(filter) = cases_of(source, testing::GTEST_FLAG(filter));
    }
    std::string folder = (std::filesystem::temp_directory_path() / "fledge-test-XXXXXX").string();
    if (::mkdtemp(folder.data()) == nullptr) {
        std::perror(folder.c_str());
        return 1;
    }
    for (const char *name : {"TMPDIR", "TEST_TMPDIR"}) { // the second is GoogleTest's
        ::setenv(name, folder.c_str(), 1);
    }
    const int status = RUN_ALL_TESTS();
    std::error_code ignored;
    std::filesystem::remove_all(folder, ignored);
    return status;
}
