// SPDX-License-Identifier: Apache-2.0
// The message of an exception, for tests in C++.
#pragma once

#include <exception>
#include <string>
#include <utility>

/// The message of the Error that `work` throws; "" if it throws none.
template <class Error = std::exception, class Work> std::string error_of(Work &&work)
{
    try {
        std::forward<Work>(work)();
    } catch (const Error &error) {
        return error.what();
    }
    return "";
}
