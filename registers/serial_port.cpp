// SPDX-License-Identifier: Apache-2.0
#include "registers/serial_port.h"

#include "registers/outside.h"

#include <algorithm>
#include <cerrno>
#include <climits>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <filesystem>
#include <fstream>
#include <grp.h>
#include <poll.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

// <termios.h> knows no speed that is not in its list, and contradicts these.
#include <asm/termbits.h>
#include <linux/serial.h>

namespace fledge::registers {

namespace {

namespace fs = std::filesystem;

/// The serial devices by name, for a message.
std::string devices()
{
    std::string found;
    std::error_code none;
    for (const auto &entry : fs::directory_iterator("/dev/serial/by-id", none)) {
        found += (found.empty() ? "; connected are " : ", ") + entry.path().string();
    }
    return found.empty() ? "; no serial device is connected (/dev/serial/by-id is empty)" : found;
}

/// Whether both files are the same device. Each mounted /dev/pts, as that of a container, numbers its terminals from 0.
bool same_device(const struct stat &a, const struct stat &b)
{
    constexpr unsigned first_pts = 136, last_pts = 143; // major numbers
    const bool terminal = major(a.st_rdev) >= first_pts && major(a.st_rdev) <= last_pts;
    return S_ISCHR(a.st_mode) && a.st_rdev == b.st_rdev && (!terminal || a.st_dev == b.st_dev);
}

/// The program that has the device open, "NAME (process N)"; "" if none has, as far as this user may see.
std::string holder(const struct stat &device)
{
    std::error_code none;
    for (const auto &process : fs::directory_iterator("/proc", none)) {
        const std::string pid = process.path().filename();
        if (pid.find_first_not_of("0123456789") != pid.npos || pid == std::to_string(getpid())) {
            continue;
        }
        for (const auto &file : fs::directory_iterator(process.path() / "fd", none)) {
            struct stat s;
            if (stat(file.path().c_str(), &s) == 0 && same_device(s, device)) {
                std::string name;
                std::getline(std::ifstream(process.path() / "comm"), name);
                return name + " (process " + pid + ")";
            }
        }
    }
    return "";
}

[[noreturn]] void refuse_held(const std::string &path, const struct stat &device)
{
    const std::string by = holder(device);
    throw Error(path + " is held by " + (by.empty() ? "another program" : by) + ": end that program first");
}

[[noreturn]] void refuse_open(const std::string &path, int error)
{
    struct stat s {};
    switch (error) {
    case ENOENT:
    case ENODEV:
    case ENXIO: throw Error("there is no device " + path + devices());
    case EACCES:
        if (stat(path.c_str(), &s) == 0) {
            const group *owner = getgrgid(s.st_gid);
            const std::string name = owner ? owner->gr_name : std::to_string(s.st_gid);
            const std::string no_right = "you have no right to open " + path + ", which is of the group " + name;
            constexpr mode_t both = S_IRGRP | S_IWGRP;
            if ((s.st_mode & both) != both || s.st_gid == 0) { // to join it would not help, or give too many rights
                throw Error(no_right + ": run `sudo chmod a+rw " + path +
                            "`, which lasts until the device is gone; a rule of udev lasts");
            }
            throw Error(no_right + ": run `sudo usermod -aG " + name + " $USER`, and log in again");
        }
        break;
    case EBUSY:
        if (stat(path.c_str(), &s) == 0) {
            refuse_held(path, s);
        }
        break;
    case EISDIR: throw Error(path + " is a folder, no serial device" + devices());
    default: break;
    }
    throw Error(path + " cannot be opened: " + std::strerror(error));
}

/// Bytes pass as they are, 8 bits, no parity, one stop bit, no flow control. Returns 0 or errno.
int make_raw(int fd, std::uint32_t baud)
{
    termios2 t{};
    if (ioctl(fd, TCGETS2, &t) != 0) {
        return errno;
    }
    t.c_iflag = 0;
    t.c_oflag = 0;
    t.c_lflag = 0;
    t.c_cflag = CS8 | CREAD | CLOCAL; // without HUPCL: the end of a run must not reset a board
    t.c_cc[VMIN] = 1;                 // a read of no bytes: the device has vanished
    t.c_cc[VTIME] = 0;
    if (baud != 0) {
        t.c_cflag |= BOTHER;
        t.c_ispeed = t.c_ospeed = baud;
    } else {
        t.c_cflag |= B38400;
    }
    return ioctl(fd, TCSETS2, &t) == 0 ? 0 : errno;
}

} // namespace

SerialPort::SerialPort(const std::string &path, std::uint32_t baud) : path_(path), baud_(baud)
{
    try {
        open();
    } catch (...) {
        close();
        throw;
    }
}

SerialPort::SerialPort()
{
    fd_ = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    char name[PATH_MAX];
    if (fd_ >= 0 && grantpt(fd_) == 0 && unlockpt(fd_) == 0 && ptsname_r(fd_, name, sizeof name) == 0) {
        other_ = ::open(name, O_RDWR | O_NOCTTY | O_CLOEXEC);
    }
    if (other_ < 0 || make_raw(other_, 0) != 0) {
        const int error = errno;
        close();
        throw Error(std::string("no pseudo terminal can be made: ") + std::strerror(error));
    }
    path_ = name;
}

SerialPort::~SerialPort()
{
    close();
}

void SerialPort::close()
{
    for (int *fd : {&fd_, &other_}) {
        if (*fd >= 0) {
            ::close(*fd);
        }
        *fd = -1;
    }
}

void SerialPort::open()
{
    struct stat s {};
    fd_ = ::open(path_.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (fd_ < 0) {
        refuse_open(path_, errno);
    }
    const auto vanished = [&](int error) {
        if (error == EIO || error == ENXIO || error == ENODEV) {
            throw Error(path_ + " has vanished while it was opened: is its cable out?");
        }
    };
    errno = 0;
    if (fstat(fd_, &s) != 0 || !S_ISCHR(s.st_mode) || !isatty(fd_)) {
        vanished(errno);
        throw Error(path_ + " is no serial device" + devices());
    }
    // No other program may open it from now on; the user root may, but not a program that takes the lock.
    if (flock(fd_, LOCK_EX | LOCK_NB) != 0 || ioctl(fd_, TIOCEXCL) != 0 || !holder(s).empty()) {
        refuse_held(path_, s);
    }
    if (const int error = make_raw(fd_, baud_); error != 0) {
        vanished(error);
        throw Error(path_ + " takes no " + std::to_string(baud_) + " baud: " + std::strerror(error));
    }
    termios2 t{};
    if (ioctl(fd_, TCGETS2, &t) == 0 && (t.c_ospeed < baud_ - baud_ / 32 || t.c_ospeed > baud_ + baud_ / 32)) {
        throw Error(path_ + " runs at " + std::to_string(t.c_ospeed) + " baud instead of " + std::to_string(baud_) +
                    ": choose a rate that it has");
    }
    serial_struct how{};
    if (ioctl(fd_, TIOCGSERIAL, &how) == 0) { // an adapter by FTDI otherwise keeps bytes for 16 ms
        how.flags |= ASYNC_LOW_LATENCY;
        (void)ioctl(fd_, TIOCSSERIAL, &how);
    }
    (void)ioctl(fd_, TCFLSH, TCIFLUSH); // of an earlier run
}

bool SerialPort::reopen()
{
    try {
        open();
    } catch (const Error &) {
        close();
    }
    return is_open();
}

std::size_t SerialPort::receive(std::span<std::byte> room, std::chrono::nanoseconds timeout, bool until_room)
{
    const auto left = std::max<std::int64_t>(timeout.count(), 0);
    const timespec t{left / 1'000'000'000, left % 1'000'000'000};
    pollfd request{fd_, static_cast<short>(until_room ? POLLIN | POLLOUT : POLLIN), 0};
    if (fd_ < 0 || ppoll(&request, 1, &t, nullptr) <= 0 || request.revents == POLLOUT) {
        return 0;
    }
    const ssize_t n = read(fd_, room.data(), room.size());
    if (n > 0) {
        return static_cast<std::size_t>(n);
    }
    if (n == 0 || (errno != EAGAIN && errno != EINTR)) {
        close();
    }
    return 0;
}

std::size_t SerialPort::send(std::span<const std::byte> bytes)
{
    if (fd_ < 0) {
        return 0;
    }
    const ssize_t n = write(fd_, bytes.data(), bytes.size());
    if (n < 0 && errno != EAGAIN && errno != EINTR) {
        close();
    }
    return n < 0 ? 0 : static_cast<std::size_t>(n);
}

} // namespace fledge::registers
