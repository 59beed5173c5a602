// SPDX-License-Identifier: Apache-2.0
#include "registers/backend.h"

#include <cstring>
#include <utility>

#include "registers/outside.h"

namespace fledge::registers {

InProcess::InProcess(std::span<const RegisterBoard *const> boards, std::function<void()> flight)
    : flight_(std::move(flight))
{
    for (const RegisterBoard *board : boards) {
        memory_.emplace_back((board->size + 7) / 8);
        windows_.push_back(register_window(board, reinterpret_cast<volatile std::uint32_t *>(memory_.back().data())));
    }
}

Wait InProcess::await_done(const RegisterWindow &clock, std::chrono::nanoseconds)
{
    flight_();
    return register_clock_is_done(&clock) ? Wait::done : Wait::late;
}

SharedFile::SharedFile(std::span<const RegisterBoard *const> boards, const std::string &path) : windows_(boards.size())
{
    const RegisterFileStatus status = register_file_create(&file_, path.empty() ? nullptr : path.c_str(), boards.data(),
                                                           static_cast<std::uint32_t>(boards.size()), windows_.data());
    if (status != REGISTER_FILE_OK) {
        throw Error("the register file " + (path.empty() ? "without a name" : path) +
                    " cannot be made: " + register_file_status_text(status) +
                    (file_.error ? std::string(": ") + std::strerror(file_.error) : ""));
    }
}

SharedFile::~SharedFile()
{
    register_file_close(&file_);
}

Wait SharedFile::await_done(const RegisterWindow &clock, std::chrono::nanoseconds timeout)
{
    const auto end = std::chrono::steady_clock::now() + timeout;
    while (!register_clock_is_done(&clock)) {
        const auto left = std::chrono::duration_cast<std::chrono::nanoseconds>(end - std::chrono::steady_clock::now());
        switch (register_file_wait(&file_, left.count())) {
        case REGISTER_FILE_GONE: return register_clock_is_done(&clock) ? Wait::done : Wait::gone;
        case REGISTER_FILE_TIMEOUT: return register_clock_is_done(&clock) ? Wait::done : Wait::late;
        default: break;
        }
    }
    return Wait::done;
}

} // namespace fledge::registers
