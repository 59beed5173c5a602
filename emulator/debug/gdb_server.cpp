// SPDX-License-Identifier: Apache-2.0
// "Appendix E, gdb Remote Serial Protocol", of "Debugging with gdb".
#include "emulator/debug/gdb_server.h"

#include "emulator/debug/registers.h"
#include "emulator/report.h"

#include <algorithm>
#include <arpa/inet.h>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

namespace fledge::emulator {

namespace {

constexpr Ns slice = 10'000'000; // [ns] of simulated time, between looks at the socket
constexpr std::size_t packet_size = 0x4000;

std::string hex(std::span<const std::byte> bytes)
{
    static constexpr char digits[] = "0123456789abcdef";
    std::string text;
    for (const std::byte b : bytes) {
        text += digits[static_cast<unsigned>(b) >> 4];
        text += digits[static_cast<unsigned>(b) & 15];
    }
    return text;
}

std::string hex(std::string_view text)
{
    return hex(std::as_bytes(std::span(text)));
}

std::array<std::byte, 4> big_endian(std::uint32_t value)
{
    return {std::byte(value >> 24), std::byte(value >> 16 & 255), std::byte(value >> 8 & 255), std::byte(value & 255)};
}

std::optional<std::uint32_t> number(std::string_view text, int base = 16)
{
    std::uint32_t value = 0;
    const auto end = text.data() + text.size();
    const auto [rest, error] = std::from_chars(text.data(), end, value, base);
    return error == std::errc() && rest == end ? std::optional(value) : std::nullopt;
}

/// Bytes of hexadecimal digits; nullopt if they are not.
std::optional<std::vector<std::byte>> from_hex(std::string_view digits)
{
    std::vector<std::byte> bytes;
    for (std::size_t i = 0; i + 1 < digits.size(); i += 2) {
        const auto byte = number(digits.substr(i, 2));
        if (!byte) {
            return std::nullopt;
        }
        bytes.push_back(std::byte(*byte));
    }
    return digits.size() % 2 ? std::nullopt : std::optional(bytes);
}

std::vector<std::string> split(std::string_view text, std::string_view separators)
{
    std::vector<std::string> parts(1);
    for (const char c : text) {
        if (separators.find(c) == separators.npos) {
            parts.back() += c;
        } else {
            parts.emplace_back();
        }
    }
    return parts;
}

} // namespace

void visit_windows(CpuState &state, const std::function<void(std::uint32_t, std::uint32_t *, std::uint32_t *)> &f)
{
    std::uint32_t window = state.psr & psr::cwp;
    for (std::uint32_t i = 0; i + 1 < window_count; i++, window = (window + 1) % window_count) {
        if (state.wim >> window & 1u) {
            return; // this one and all behind it are in memory
        }
        std::uint32_t *outs = state.windows.data() + std::size_t{window} * 16;
        std::uint32_t *ins = state.windows.data() + std::size_t{(window + 1) % window_count} * 16;
        f(outs[6], outs + 8, ins);
    }
}

int listen_at(std::string_view address, const std::string &what, std::uint16_t &listens_at)
{
    const auto colon = address.rfind(':');
    const std::string host(colon == address.npos || colon == 0 ? "127.0.0.1" : address.substr(0, colon));
    const auto port = number(colon == address.npos ? address : address.substr(colon + 1), 10);
    sockaddr_in at{};
    at.sin_family = AF_INET;
    if (!port || *port > 65535 || inet_pton(AF_INET, host.c_str(), &at.sin_addr) != 1) {
        throw Error(what + ": expected [ADDRESS:]PORT with an IPv4 address, as in 127.0.0.1:1234; found '" +
                    std::string(address) + "'");
    }
    at.sin_port = htons(static_cast<std::uint16_t>(*port));
    const int listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0), enabled = 1;
    setsockopt(listener, SOL_SOCKET, SO_REUSEADDR, &enabled, sizeof enabled);
    socklen_t size = sizeof at;
    if (listener < 0 || bind(listener, reinterpret_cast<sockaddr *>(&at), size) != 0 || listen(listener, 1) != 0 ||
        getsockname(listener, reinterpret_cast<sockaddr *>(&at), &size) != 0) {
        const std::string why = std::strerror(errno);
        close(listener);
        throw Error(what + " cannot be served at " + std::string(address) + ": " + why);
    }
    listens_at = ntohs(at.sin_port);
    return listener;
}

GdbServer::GdbServer(Machine &machine, std::string_view address, const Program *program)
    : machine_(machine), program_(program), history_(machine), listener_(listen_at(address, "gdb", port_))
{
}

GdbServer::~GdbServer()
{
    drop();
    close(listener_);
}

// --- the connection ---

bool GdbServer::wait(int timeout)
{
    pollfd listening{listener_, POLLIN, 0};
    if (!attached() && poll(&listening, 1, timeout) > 0) {
        accept();
    }
    return attached();
}

void GdbServer::accept()
{
    client_ = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
    if (client_ >= 0) {
        const int enabled = 1;
        setsockopt(client_, IPPROTO_TCP, TCP_NODELAY, &enabled, sizeof enabled);
        acknowledge_ = true;
        input_.clear();
        stands_ = true;
        reason_ = StopReason::time;
        history_.begin();
    }
}

/// gdb has gone: its breakpoints go too, and the machine runs on.
void GdbServer::drop()
{
    if (client_ >= 0) {
        close(client_);
        client_ = -1;
    }
    for (const std::uint32_t address : std::set<std::uint32_t>(machine_.core().breakpoints)) {
        machine_.set_breakpoint(address, false);
    }
    for (const Watch &watch : watches_) {
        machine_.set_watchpoint(watch.address, watch.size, watch.kind != '2', watch.kind != '3', false);
    }
    watches_.clear();
    stands_ = false;
}

bool GdbServer::readable(int timeout)
{
    pollfd from{client_, POLLIN, 0};
    return !input_.empty() || poll(&from, 1, timeout) > 0;
}

/// The next packet, "\x03" for an interruption, or "" if gdb has gone.
std::string GdbServer::receive()
{
    for (;;) {
        const std::size_t start = input_.find_first_of("$\x03");
        const std::size_t end = input_.find('#', start == input_.npos ? 0 : start);
        if (start != input_.npos && input_[start] == '\x03') {
            input_.erase(0, start + 1);
            return "\x03";
        }
        if (start != input_.npos && end != input_.npos && end + 2 < input_.size()) {
            std::string packet = input_.substr(start + 1, end - start - 1);
            unsigned sum = 0;
            for (const char c : packet) {
                sum += static_cast<unsigned char>(c);
            }
            const bool good = number(std::string_view(input_).substr(end + 1, 2)) == (sum & 255u);
            input_.erase(0, end + 3);
            if (acknowledge_ && ::send(client_, good ? "+" : "-", 1, MSG_NOSIGNAL) != 1) {
                return "";
            }
            if (good) {
                return packet;
            }
            continue;
        }
        char buffer[4096];
        const ssize_t n = recv(client_, buffer, sizeof buffer, 0);
        if (n <= 0 || input_.size() > 4 * packet_size) {
            return "";
        }
        input_.append(buffer, static_cast<std::size_t>(n));
    }
}

void GdbServer::send(std::string_view packet)
{
    unsigned sum = 0;
    for (const char c : packet) {
        sum += static_cast<unsigned char>(c);
    }
    const std::byte last{static_cast<unsigned char>(sum)};
    std::string text = "$" + std::string(packet) + "#" + hex(std::span(&last, 1));
    for (std::string_view rest = text; !rest.empty();) {
        const ssize_t n = ::send(client_, rest.data(), rest.size(), MSG_NOSIGNAL);
        if (n <= 0) {
            return; // the next receive() notices
        }
        rest.remove_prefix(static_cast<std::size_t>(n));
    }
}

// --- running ---

StopReason GdbServer::run_until(Ns t)
{
    for (Then then = Then::go_on; then != Then::leave;) {
        (void)wait(0);
        if (!attached()) {
            return machine_.run_until(t);
        }
        then = stands_ ? go(serve()) : run_slice(t);
        if (then == Then::stop) {
            stands_ = true;
            send(stop_reply());
        }
    }
    return reason_;
}

/// Do what gdb wants of a machine that stands.
GdbServer::Then GdbServer::go(Go how)
{
    stands_ = past_begins_ = interrupted_ = false;
    switch (how) {
    case Go::let_go: drop(); return Then::go_on;
    case Go::step_back:
        past_begins_ = !history_.step_back();
        reason_ = StopReason::time;
        return Then::stop;
    case Go::back:
        reason_ = history_.continue_back();
        past_begins_ = reason_ == StopReason::time;
        return Then::stop;
    case Go::on:
    case Go::step: break;
    }
    reason_ = history_.step(); // also to leave a breakpoint
    const bool moves = reason_ == StopReason::time || reason_ == StopReason::breakpoint;
    if (reason_ == StopReason::early) { // flight has finished its tick with this instruction
        stands_ = how == Go::step;
        if (stands_) {
            send(stop_reply());
        }
        return Then::leave;
    }
    return how == Go::on && moves ? Then::go_on : Then::stop;
}

GdbServer::Then GdbServer::run_slice(Ns t)
{
    reason_ = machine_.now() < t ? history_.run_until(std::min(t, machine_.now() + slice)) : StopReason::time;
    if (reason_ == StopReason::early || (machine_.now() >= t && reason_ == StopReason::time)) {
        return Then::leave;
    }
    if (reason_ != StopReason::time) {
        return Then::stop;
    }
    if (!readable(0)) {
        return Then::go_on;
    }
    if (receive() == "\x03") {
        interrupted_ = true;
        return Then::stop;
    }
    drop(); // a packet while the machine runs: gdb has gone
    return Then::go_on;
}

/// Answer gdb until it lets the machine run.
GdbServer::Go GdbServer::serve()
{
    for (;;) {
        const std::string packet = receive();
        if (packet.empty()) {
            return Go::let_go;
        }
        std::optional<Go> go;
        const std::string reply = packet == "\x03" ? stop_reply() : answer(packet, go);
        if (!go || go == Go::let_go) {
            send(reply);
        }
        if (go) {
            return *go;
        }
        if (packet == "QStartNoAckMode") {
            acknowledge_ = false;
        }
    }
}

std::string GdbServer::stop_reply() const
{
    if (interrupted_) {
        return "T02thread:1;"; // SIGINT
    }
    if (past_begins_) {
        return "T05replaylog:begin;thread:1;";
    }
    switch (reason_) {
    case StopReason::watchpoint: return "T05" + watched() + "thread:1;";
    case StopReason::breakpoint: return "T05swbreak:;thread:1;";
    case StopReason::error: return "T06thread:1;"; // SIGABRT
    default: return "T05thread:1;";
    }
}

std::string GdbServer::answer(const std::string &packet, std::optional<Go> &go)
{
    const auto resume = [&](Go how) {
        go = how;
        return std::string();
    };
    const std::string rest = packet.substr(1);
    switch (packet[0]) {
    case '?': return stop_reply();
    case 'g': return registers();
    case 'G': {
        const auto bytes = from_hex(rest);
        for (unsigned i = 0; bytes && i < register_count && i * 8 + 8 <= rest.size(); i++) {
            set_register(machine_.core().state, i, *number(rest.substr(std::size_t{i} * 8, 8)));
        }
        history_.changed();
        return bytes ? "OK" : "E01";
    }
    case 'p': {
        const auto which = number(rest);
        return which && *which < register_count ? hex(big_endian(get_register(machine_.core().state, *which))) : "E01";
    }
    case 'P': {
        const auto parts = split(rest, "=");
        const auto which = number(parts[0]), value = number(parts.size() == 2 ? parts[1] : "");
        if (!which || !value || *which >= register_count) {
            return "E01";
        }
        set_register(machine_.core().state, *which, *value);
        history_.changed();
        return "OK";
    }
    case 'm': {
        const auto parts = split(rest, ",");
        const auto address = number(parts[0]), n = number(parts.size() == 2 ? parts[1] : "");
        const std::string found = address && n ? read_memory(*address, *n) : "";
        return found.empty() ? "E01" : found;
    }
    case 'M': {
        const auto parts = split(rest, ",:");
        const auto address = number(parts[0]);
        return address && parts.size() == 3 && write_memory(*address, parts[2]) ? "OK" : "E01";
    }
    case 'c': return resume(Go::on);
    case 's': return resume(Go::step);
    case 'b': return resume(rest == "s" ? Go::step_back : Go::back);
    case 'D': (void)resume(Go::let_go); return "OK";
    case 'k': return resume(Go::let_go);
    case 'H':
    case 'T': return "OK";
    case 'Z':
    case 'z': return set_point(packet);
    case 'q':
    case 'Q': return query(packet);
    case 'v':
        if (packet == "vCont?") {
            return "vCont;c;C;s;S";
        }
        if (packet.starts_with("vCont;")) {
            return resume(packet[6] == 's' || packet[6] == 'S' ? Go::step : Go::on);
        }
        return "";
    default: return "";
    }
}

std::string GdbServer::registers() const
{
    std::string text;
    for (unsigned i = 0; i < register_count; i++) {
        text += hex(big_endian(get_register(machine_.core().state, i)));
    }
    return text;
}

// --- memory ---

std::string GdbServer::read_memory(std::uint32_t address, std::uint32_t n) const
{
    std::vector<std::byte> bytes(std::min<std::size_t>(n, packet_size / 2));
    while (!bytes.empty() && !machine_.peek(address, bytes)) {
        bytes.resize(bytes.size() / 2); // as far as there is memory
    }
    visit_windows(machine_.core().state, [&](std::uint32_t at, std::uint32_t *locals, std::uint32_t *ins) {
        for (std::uint32_t i = 0; i < 64; i++) {
            const std::uint32_t place = at + i - address;
            if (place < bytes.size()) { // gcc 12 with sanitizers reads 0 from (i < 32 ? locals : ins)[...]
                bytes[place] = big_endian(i < 32 ? locals[i / 4] : ins[i / 4 - 8])[i % 4];
            }
        }
    });
    return hex(bytes);
}

bool GdbServer::write_memory(std::uint32_t address, std::string_view digits)
{
    const auto bytes = from_hex(digits);
    if (!bytes || !machine_.poke(address, *bytes)) {
        return false;
    }
    visit_windows(machine_.core().state, [&](std::uint32_t at, std::uint32_t *locals, std::uint32_t *ins) {
        for (std::uint32_t i = 0; i < 64; i++) {
            const std::uint32_t place = at + i - address;
            if (place < bytes->size()) {
                std::uint32_t &word = i < 32 ? locals[i / 4] : ins[i / 4 - 8];
                const unsigned up = 24 - i % 4 * 8;
                word = (word & ~(255u << up)) | static_cast<std::uint32_t>((*bytes)[place]) << up;
            }
        }
    });
    history_.changed();
    return true;
}

std::string GdbServer::set_point(const std::string &packet)
{
    const auto parts = split(std::string_view(packet).substr(1), ",;");
    const auto address = number(parts.size() > 2 ? parts[1] : ""), size = number(parts.size() > 2 ? parts[2] : "");
    const char kind = packet[1];
    const bool on = packet[0] == 'Z';
    if (!address || !size || kind < '0' || kind > '4') {
        return "E01";
    }
    try {
        if (kind < '2') {
            machine_.set_breakpoint(*address, on);
            return "OK";
        }
        machine_.set_watchpoint(*address, *size, kind != '2', kind != '3', on);
    } catch (const Error &) {
        return "E01";
    }
    const auto same = [&](const Watch &w) { return w.address == *address && w.size == *size && w.kind == kind; };
    watches_.erase(std::remove_if(watches_.begin(), watches_.end(), same), watches_.end());
    if (on) {
        watches_.push_back({*address, *size, kind});
    }
    return "OK";
}

// --- queries, and `monitor` ---

std::string GdbServer::query(const std::string &packet)
{
    if (packet.starts_with("qSupported")) {
        return "PacketSize=4000;ReverseStep+;ReverseContinue+;swbreak+;vContSupported+;QStartNoAckMode+";
    }
    if (packet == "QStartNoAckMode") {
        return "OK";
    }
    if (packet == "qAttached") {
        return "1"; // gdb lets it go at its end, and does not kill it
    }
    if (packet == "qC") {
        return "QC1";
    }
    if (packet == "qfThreadInfo") {
        return "m1";
    }
    if (packet == "qsThreadInfo") {
        return "l";
    }
    if (packet.starts_with("qRcmd,")) {
        const auto bytes = from_hex(std::string_view(packet).substr(6));
        std::string command;
        for (const std::byte b : bytes.value_or(std::vector<std::byte>{})) {
            command += static_cast<char>(b);
        }
        return hex(monitor(command) + "\n");
    }
    return "";
}

std::string GdbServer::monitor(const std::string &command)
{
    std::vector<std::string> words = split(command, " ");
    std::erase(words, "");
    const std::string name = words.size() > 1 ? words[1] : "";
    const std::string what = words.empty() ? "help" : words[0];
    if (what == "time" && words.size() == 1) {
        const CpuState &state = machine_.core().state;
        return std::to_string(static_cast<double>(machine_.now()) / 1e9) + " s, " + std::to_string(state.cycles) +
               " cycles, " + std::to_string(state.instructions) + " instructions";
    }
    if (what == "snapshot" && words.size() <= 2) {
        snapshots_[name] = machine_.snapshot();
        return "snapshot " + name + (name.empty() ? "" : " ") + "taken";
    }
    if (what == "restore" && words.size() <= 2) {
        const auto found = snapshots_.find(name);
        if (found == snapshots_.end()) {
            return "there is no snapshot " + name + "; take one with: monitor snapshot " + name;
        }
        machine_.restore(*found->second);
        history_.changed();
        return "restored";
    }
    if (what == "flip" && words.size() == 3) {
        const auto bit = number(words[2], 10);
        try {
            return bit ? flip(name, *bit) : "flip: the bit must be a number; found " + words[2];
        } catch (const Error &error) {
            return error.what();
        }
    }
    if (what == "devices" && words.size() <= 2) {
        std::string text;
        for (const DeviceWords &device : device_words(machine_)) {
            for (const auto &[word, at, value] : device.words) {
                if (name.empty() || name == device.name) {
                    text += (text.empty() ? "0x" : "\n0x") + hex(big_endian(at)) + " " + device.name + " " + word +
                            " 0x" + hex(big_endian(value));
                }
            }
        }
        return text.empty() ? "there is no device " + name + " with registers; monitor devices lists all" : text;
    }
    if (what == "report" && words.size() == 1) {
        return machine_.report(program_);
    }
    return "monitor time               simulated time, cycles and instructions\n"
           "monitor snapshot [NAME]    keep the state of the machine\n"
           "monitor restore [NAME]     go back, or on, to it\n"
           "monitor flip ADDRESS BIT   invert a bit of the byte there, 0 (lowest) to 7\n"
           "monitor flip %REG BIT      of a register: %l3, %f2, %psr; 0 (lowest) to 31\n"
           "monitor devices [NAME]     registers of the devices; set {int}ADDRESS = VALUE writes one\n"
           "monitor report             registers and backtrace";
}

std::string GdbServer::flip(const std::string &place, unsigned bit)
{
    if (place.starts_with("%")) {
        flip_register(machine_.core().state, place, bit);
    } else {
        const auto address = place.starts_with("0x") ? number(std::string_view(place).substr(2)) : number(place, 10);
        std::byte byte{};
        if (!address || bit > 7 || !machine_.peek(*address, {&byte, 1})) {
            return "flip: there is no bit " + std::to_string(bit) + " at " + place;
        }
        byte ^= std::byte(1u << bit);
        (void)machine_.poke(*address, {&byte, 1});
    }
    history_.changed();
    return place + ": bit " + std::to_string(bit) + " inverted";
}

/// Of the watched access that the last instruction made, as gdb wants it.
std::string GdbServer::watched() const
{
    static constexpr const char *names[] = {"watch", "rwatch", "awatch"};
    const std::uint32_t at = machine_.bus().watched_at();
    const auto found =
        std::find_if(watches_.begin(), watches_.end(), [&](const Watch &w) { return at - w.address < w.size; });
    return found == watches_.end() ? "" : std::string(names[found->kind - '2']) + ":" + hex(big_endian(at)) + ";";
}

} // namespace fledge::emulator
