// SPDX-License-Identifier: Apache-2.0
#include "cosim/tools/status.h"

#include "cosim/protocol/text.h"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <fcntl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

namespace fledge::cosim {

namespace {

using namespace std::chrono_literals;

constexpr auto often = 200ms;
constexpr std::size_t longest_text = 16'384;
constexpr std::size_t longest_line = 4096; ///< of a command
constexpr std::size_t most_unread = 1 << 20;

/// A reason may come from a library or the system, in any bytes.
std::string quoted(const std::string &text)
{
    std::string s = "\"";
    for (const char c : cleaned(text, longest_text)) {
        if (c == '"' || c == '\\') {
            s += '\\';
            s += c;
        } else if (static_cast<unsigned char>(c) < 0x20) {
            char code[8];
            std::snprintf(code, sizeof code, "\\u%04x", static_cast<unsigned>(c));
            s += code;
        } else {
            s += c;
        }
    }
    return s + '"';
}

std::string seconds(double s)
{
    char text[40];
    std::snprintf(text, sizeof text, "%.9g", s);
    return text;
}

std::string reached(Ns t)
{
    return t < 0 ? "-1" : seconds(static_cast<double>(t) * 1e-9);
}

std::string nodes_of(const Router &router, const ControllerConfig &config)
{
    std::string s = "[";
    for (NodeId id = 0; id < config.nodes.size(); id++) {
        const NodeTimes times = router.times(id);
        s += std::string(id ? "," : "") + "{\"name\":" + quoted(config.nodes[id].name) + ",\"state\":\"" +
             router.controller().state(id) + "\",\"t\":" + reached(router.controller().reached(id)) +
             ",\"ticks\":" + std::to_string(times.ticks);
        for (const auto &[name, ns] : {std::pair{"compute", times.compute},
                                       {"transport", times.transport},
                                       {"wait", times.wait},
                                       {"pending", times.pending}}) {
            s += std::string(",\"") + name + "\":" + seconds(static_cast<double>(ns) * 1e-9);
        }
        s += '}';
    }
    return s + ']';
}

/// Delays, if it is paced; the pace, if it may change.
std::string pace_of(const Router &router)
{
    std::string s;
    if (const PaceReport *pace = router.pace()) {
        s = ",\"overruns\":" + std::to_string(pace->overruns) +
            ",\"worst\":" + seconds(static_cast<double>(pace->worst) * 1e-9);
    }
    if (const Pace *pace = router.steer()) {
        s += ",\"pace\":" + seconds(pace->speed()) + ",\"paused\":" + (pace->paused() ? "true" : "false");
        s += pace->until() == for_ever ? "" : ",\"until\":" + seconds(static_cast<double>(pace->until()) * 1e-9);
    }
    return s;
}

/// What all nodes in the run have reached; without any, the furthest that a node came.
Ns reached_by_all(const Router &router, const ControllerConfig &config)
{
    Ns least = config.end, most = -1;
    bool some = false;
    for (NodeId id = 0; id < config.nodes.size(); id++) {
        const std::string state = router.controller().state(id);
        const Ns t = router.controller().reached(id);
        most = std::max(most, t);
        if (state == "running" || state == "finished") {
            least = std::min(least, t);
            some = true;
        }
    }
    return some ? least : most;
}

std::string state_of(const Router &router, const ControllerConfig &config)
{
    return ",\"t\":" + reached(reached_by_all(router, config)) + pace_of(router) +
           ",\"nodes\":" + nodes_of(router, config);
}

} // namespace

StatusStream::StatusStream(int fd) : fd_(fd), begun_(Clock::now())
{
    struct stat about {};
    if (fd_ >= 0 && fstat(fd_, &about) == 0) {
        socket_ = S_ISSOCK(about.st_mode);
        fcntl(fd_, F_SETFL, fcntl(fd_, F_GETFL) | O_NONBLOCK);
        fcntl(fd_, F_SETFD, FD_CLOEXEC);
    } else if (fd_ >= 0) {
        throw LinkError("--status " + std::to_string(fd_) + ": there is no such file descriptor");
    }
}

void StatusStream::listening(const std::string &address)
{
    write("{\"listening\":" + quoted(address) + "}");
}

void StatusStream::report(const std::string &text)
{
    write("{\"report\":" + quoted(text) + "}");
}

void StatusStream::progress(const Router &router, const ControllerConfig &config)
{
    const auto now = Clock::now();
    if (fd_ < 0 || now - reported_ < often || !flush()) { // a slow reader skips states
        return;
    }
    reported_ = now;
    const Controller &c = router.controller();
    write(std::string("{\"phase\":\"") +
          (c.running()     ? "running"
           : c.finishing() ? "finishing"
                           : "gathering") +
          "\",\"wall\":" + seconds(std::chrono::duration<double>(now - begun_).count()) + state_of(router, config) +
          "}");
}

void StatusStream::ended(const std::string &reason, const Router &router, const ControllerConfig &config)
{
    write("{\"ended\":" + quoted(reason) + ",\"wall\":" +
          seconds(std::chrono::duration<double>(Clock::now() - begun_).count()) + state_of(router, config) + "}");
    for (int i = 0; i < 100 && !flush(); i++) { // the last line: wait until it is written
        usleep(10'000);
    }
}

std::string StatusStream::read_line()
{
    char text[512];
    while (socket_ && !input_ended_) {
        if (const auto end = input_.find('\n'); end != std::string::npos) {
            std::string line = input_.substr(0, end);
            input_.erase(0, end + 1);
            return line;
        }
        const ssize_t n = recv(fd_, text, sizeof text, MSG_DONTWAIT);
        if (n < 0 && (errno == EAGAIN || errno == EINTR)) {
            break;
        }
        if (n <= 0) {
            input_ended_ = true;
            return "stop the program that started it is gone";
        }
        input_.append(text, static_cast<std::size_t>(n));
        if (input_.size() > longest_line && input_.find('\n') == std::string::npos) {
            input_.clear();
        }
    }
    return "";
}

void StatusStream::write(const std::string &line)
{
    if (fd_ >= 0 && rest_.size() < most_unread) {
        rest_ += line + '\n';
        flush();
    }
}

/// Whether all is written.
bool StatusStream::flush()
{
    while (fd_ >= 0 && !rest_.empty()) {
        const ssize_t n =
            socket_ ? send(fd_, rest_.data(), rest_.size(), MSG_NOSIGNAL) : ::write(fd_, rest_.data(), rest_.size());
        if (n >= 0) {
            rest_.erase(0, static_cast<std::size_t>(n));
        } else if (errno == EAGAIN || errno == EINTR) {
            return false;
        } else {
            fd_ = -1; // the reader is gone
        }
    }
    return true;
}

} // namespace fledge::cosim
