// SPDX-License-Identifier: Apache-2.0
#include "registers/line_backend.h"

#include "registers/clock.h"
#include "registers/outside.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <random>
#include <thread>

namespace fledge::registers {

namespace {

using namespace std::chrono_literals;

constexpr std::int64_t second = 1'000'000'000;
constexpr std::int64_t silence = second;   ///< [ns] after which it is reported
constexpr std::uint32_t misses_named = 10; ///< by name; the others are counted
constexpr std::array late_ms = {1, 2, 5, 10, 20, 50, 100, 200, 500, 1000};

std::int64_t now_ns()
{
    return std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count();
}

std::string seconds(std::int64_t ns)
{
    std::array<char, 40> text;
    std::snprintf(text.data(), text.size(), "%.9g s", static_cast<double>(ns) * 1e-9);
    return text.data();
}

std::string hexadecimal(std::span<const std::uint8_t> bytes)
{
    std::string text;
    for (const std::uint8_t byte : bytes) {
        text += "0123456789abcdef"[byte >> 4];
        text += "0123456789abcdef"[byte & 15];
    }
    return text;
}

double number(const std::string &name, const std::string &value, double least, double most)
{
    double x = 0;
    const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), x);
    if (error != std::errc() || end != value.data() + value.size() || !(x >= least && x <= most)) {
        std::array<char, 80> range;
        std::snprintf(range.data(), range.size(), "%g to %g", least, most);
        throw Error("the line's " + name + " is a number from " + range.data() + ", not '" + value + "'");
    }
    return x;
}

} // namespace

LineSettings LineSettings::read(const std::string &text)
{
    LineSettings s;
    const auto mark = text.find('?');
    s.device = text.substr(0, mark);
    for (std::size_t at = mark; at < text.size();) {
        const auto next = std::min(text.find('&', at + 1), text.size());
        const std::string setting = text.substr(at + 1, next - at - 1), name = setting.substr(0, setting.find('='));
        const std::string value = name.size() < setting.size() ? setting.substr(name.size() + 1) : "";
        if (name == "baud") {
            s.baud = static_cast<std::uint32_t>(number(name, value, 300, 20e6));
        } else if (name == "cut") {
            s.cut = number(name, value, 0, 1e6);
        } else if (name == "pace") {
            s.pace = number(name, value, 0, 1e6);
        } else if (name == "build") {
            s.build = value;
        } else if (name == "reset" && (value == "end" || value == "go-on")) {
            s.goes_on = value == "go-on";
        } else if (name == "reset") {
            throw Error("the line's reset is `end` or `go-on`, not '" + value + "'");
        } else {
            throw Error("a line has no option `" + name + "`; choose of: baud, reset, cut, pace, build");
        }
        at = next;
    }
    if (s.device.empty()) {
        throw Error("a line is DEVICE?baud=921600&reset=end, but '" + text + "' names no device");
    }
    return s;
}

LineBackend::LineBackend(std::span<const RegisterBoard *const> boards, Mission mission, LineSettings settings,
                         std::string record)
    : mission_(std::move(mission)), settings_(std::move(settings)), line_(std::make_unique<LineEnd>()),
      record_(std::move(record)), late_(late_ms.size() + 1)
{
    const auto n = static_cast<std::uint32_t>(boards.size());
    const std::size_t size = line_mirror_size(boards.data(), n);
    if (size == 0) {
        throw Error("a board of " + mission_.name + " is too large for a serial line");
    }
    shadow_.resize((size + 3) / 4);
    for (const RegisterBoard *board : boards) {
        memory_.emplace_back((board->size + 7) / 8);
        windows_.push_back(register_window(board, reinterpret_cast<volatile std::uint32_t *>(memory_.back().data())));
    }
    port_ = settings_.device == "pty" ? std::make_unique<SerialPort>()
                                      : std::make_unique<SerialPort>(settings_.device, settings_.baud);
}

LineBackend::~LineBackend()
{
    close_record(false);
}

void LineBackend::fail(const std::string &what) const
{
    throw Error(path() + ": " + what);
}

void LineBackend::report(const std::string &what) const
{
    std::fprintf(stderr, "%s: %s\n", path().c_str(), what.c_str());
}

// ---- the link

/// Begin a session, at the start or after the board was reset. It mirrors all of the memory.
void LineBackend::greet_anew(bool go_on)
{
    LineHello hello{};
    std::random_device random;
    do {
        hello.session = random();
    } while (hello.session == 0 || hello.session == line_->session);
    hello.version = LINE_VERSION;
    hello.flags = (record_.empty() ? 0U : static_cast<std::uint32_t>(LINE_RECORDS)) |
                  (go_on ? static_cast<std::uint32_t>(LINE_GO_ON) : 0U);
    hello.baud = settings_.baud;
    hello.hash = mission_.hash;
    line_greet(
        line_.get(), &hello,
        [](void *self, const LineMessage *message) { static_cast<LineBackend *>(self)->take(*message); }, this,
        now_ns());
    line_mirror_begin(&mirror_, windows_.data(), static_cast<std::uint32_t>(windows_.size()), shadow_.data());
    greeted_ = checked_ = false;
    pushing_ = true;
}

/// Send and receive, for at most so long. Returns whether any byte passed.
bool LineBackend::pump(std::chrono::nanoseconds wait)
{
    std::array<std::byte, 4096> room;
    for (;;) {
        push();
        if (unsent_.empty()) {
            std::size_t n = 0;
            const std::uint8_t *frame = line_output(line_.get(), now_ns(), &n);
            unsent_ = std::as_bytes(std::span(frame, frame ? n : 0));
        }
        if (unsent_.empty()) {
            break;
        }
        const std::size_t sent = port_->send(unsent_);
        unsent_ = port_->is_open() ? unsent_.subspan(sent) : std::span<const std::byte>();
        if (!unsent_.empty() || !port_->is_open()) {
            break;
        }
    }
    const std::chrono::nanoseconds until(line_wake(line_.get(), now_ns()));
    const std::size_t n = port_->receive(room, std::min(wait, until), !unsent_.empty());
    line_input(line_.get(), room.data(), n, now_ns());
    if (!wrong_.empty()) {
        fail(wrong_);
    }
    return n > 0;
}

/// Put what has changed here into the window, as far as it has room.
void LineBackend::push()
{
    std::array<std::uint8_t, LINE_PAYLOAD> payload;
    while (pushing_ && line_room(line_.get()) > 0) {
        int last = 0;
        const std::uint32_t n = line_mirror_take(&mirror_, payload.data(), &last);
        line_put(line_.get(), LINE_WORDS, last ? static_cast<std::uint32_t>(LINE_LAST) : 0U, ticked_, payload.data(),
                 n);
        pushing_ = !last;
    }
}

void LineBackend::take(const LineMessage &message)
{
    switch (message.kind) {
    case LINE_WELCOME: {
        const LineWelcome &w = message.welcome;
        const bool differs = greeted_ && w.boot != board_.boot && w.session == line_->session;
        if (w.session == 0) {
            was_reset_ = was_reset_ || greeted_;
        } else if (w.boot == former_ || (!settings_.goes_on && differs)) {
            wrong_ = "two boards answer, " + std::string(board_.target) + " and " + w.target +
                     ": take one of them off the line";
        } else if (!greeted_) {
            board_ = w;
            greeted_ = true;
        } else if (differs) { // if it was reset between two answers, the next greeting has one answer
            former_ = board_.boot;
            was_reset_ = true;
        }
        break;
    }
    case LINE_WORDS:
        if (!line_mirror_put(&mirror_, message.bytes, message.n)) {
            wrong_ = "the board sent words of registers that " + mission_.name + " does not have";
        } else if (message.flags & LINE_LAST) {
            line_mirror_finish(&mirror_);
        }
        break;
    case LINE_RECORD: take_record(message); break;
    case LINE_TEXT: take_text({message.bytes, message.n}); break;
    case LINE_SHOUT:
        shout_.assign(reinterpret_cast<const char *>(message.bytes), message.n);
        std::fprintf(stderr, "%s\n", shout_.c_str());
        break;
    case LINE_END: status_ = message.n > 0 ? message.bytes[0] : 0; break;
    default: break;
    }
}

void LineBackend::take_text(std::span<const std::uint8_t> text)
{
    text_.append(reinterpret_cast<const char *>(text.data()), text.size());
    if (const auto end = text_.rfind('\n'); end != text_.npos) {
        std::fwrite(text_.data(), 1, end + 1, stdout);
        std::fflush(stdout);
        text_.erase(0, end + 1);
    }
}

/// Bytes of the record, behind their position in it.
void LineBackend::take_record(const LineMessage &message)
{
    if (message.n < 4 || record_.empty()) {
        return;
    }
    const std::uint32_t at = message.bytes[0] | std::uint32_t{message.bytes[1]} << 8 |
                             std::uint32_t{message.bytes[2]} << 16 | std::uint32_t{message.bytes[3]} << 24;
    std::span bytes(message.bytes + 4, message.n - 4);
    if (at == 0 && (!recording_ || recorded_ > 0)) {
        if (recording_ && t_ >= 0) {
            report("the board kept nothing over its reset: the record begins anew at " + seconds(t_));
        }
        close_record(false);
        recorded_ = 0;
        recording_ = file_sink_open(&sink_, record_.c_str()) == 0;
        if (!recording_) {
            wrong_ = "the record " + record_ + " cannot be written: " + std::strerror(sink_.error);
        }
    }
    if (at > recorded_) {
        wrong_ = "the record of flight lacks the bytes " + std::to_string(recorded_) + " to " + std::to_string(at);
        return;
    }
    bytes = bytes.subspan(std::min<std::size_t>(recorded_ - at, bytes.size())); // sent again after a reset
    if (recording_ && file_sink_write(&sink_, bytes.data(), bytes.size()) != 0) {
        wrong_ = "the record " + record_ + " cannot be written: " + std::strerror(sink_.error);
    }
    recorded_ += static_cast<std::uint32_t>(bytes.size());
}

void LineBackend::close_record(bool whole)
{
    if (recording_ && file_sink_close(&sink_, whole) != 0 && whole) {
        wrong_ = "the record " + record_ + " cannot be written: " + std::strerror(sink_.error);
    }
    recording_ = false;
}

// ---- what may go wrong

/// What has come so far of a board that has not answered, and the remedy.
std::string LineBackend::no_greeting() const
{
    const LineCounts &c = line_->counts;
    const std::string at = port_->baud() ? " at " + std::to_string(port_->baud()) + " baud" : "";
    if (c.bytes_taken == 0) {
        return "nothing has come" + at + ": is the board on, does it fly " + mission_.name + " at " +
               "this rate, and is its TX at this RX?";
    }
    if (c.frames_taken == 0) {
        return std::to_string(c.bytes_taken) + " bytes have come" + at +
               ", and no frame of them: does the board have another rate, or do two boards share the line?";
    }
    if (!shout_.empty()) {
        return "the board says: " + shout_.substr(0, shout_.find('\n'));
    }
    return std::to_string(c.frames_taken) + " frames have come" + at + ", " + std::to_string(c.damaged) +
           " others were damaged, and no answer to the greeting: do two boards share the line?";
}

/// Refuse a board that does not fly what is expected.
void LineBackend::check_welcome() const
{
    const std::string has = hexadecimal(board_.build);
    if (board_.version != LINE_VERSION) {
        fail("the board's program was built by another version of Fledge: it speaks version " +
             std::to_string(board_.version) + " of the line, not " + std::to_string(LINE_VERSION) +
             "; build it again, and load it");
    }
    if (board_.mission != mission_.name) {
        fail("the board (" + std::string(board_.target) + ") flies " + board_.mission + ", not " + mission_.name +
             ": load the program of " + mission_.name + ", or choose another device");
    }
    if (board_.hash != mission_.hash) {
        fail("the board's program of " + mission_.name +
             " is stale: its tables are not those of this mission; build it again, and load it");
    }
    if (!settings_.build.empty() && has.find_first_not_of('0') != has.npos &&
        has.compare(0, settings_.build.size(), settings_.build) != 0) {
        fail("the board's program of " + mission_.name + " is not the given one: its build is " + has + ", not " +
             settings_.build + "; load it again");
    }
}

/// While this end waits: tell what is wrong with the line or the board, and end the run if it is to end then.
void LineBackend::check_line(const std::string &what)
{
    const std::int64_t now = now_ns();
    const auto limit = settings_.cut > 0 ? std::llround(settings_.cut * 1e9) : INT64_MAX;
    if (!port_->is_open()) {
        if (gone_ < 0) {
            gone_ = now;
            cuts_++;
            report("the device has vanished in " + what + ": is its cable out?");
        }
        if (now - gone_ > limit) {
            fail("the device has vanished in " + what + ", and did not come back within " + seconds(limit));
        }
        if (port_->reopen()) {
            report("the device is there again after " + seconds((now - gone_) / 1'000'000 * 1'000'000));
            gone_ = -1;
            begun_ = now;
        } else {
            std::this_thread::sleep_for(20ms);
        }
        return;
    }
    if (was_reset_) {
        was_reset_ = false;
        resets_++;
        const std::string text = "the board was reset in " + what;
        if (!settings_.goes_on) {
            fail(text + ", which ends the run (reset=end)");
        }
        report(text + ", and begins flight there (reset=go-on)");
        greet_anew(true);
        begun_ = now;
    }
    if (greeted_ && !checked_) {
        check_welcome();
        checked_ = true;
    }
    const std::int64_t quiet = now - std::max(line_->received_at, begun_);
    if (quiet > silence && !complained_) {
        complained_ = true;
        cuts_ += greeted_;
        report(greeted_ ? "the board has been silent for 1 s in " + what + ": is the line cut?" : no_greeting());
    } else if (complained_ && quiet < silence) {
        complained_ = false;
        if (greeted_) {
            report("the board is heard again");
        }
    }
    if (quiet > limit && greeted_) {
        fail("the board has been silent for " + seconds(limit) + " in " + what);
    }
    if (quiet > silence / 4 && line_is_open(line_.get()) && line_is_flushed(line_.get())) {
        // Words of nothing: a board that was reset answers them.
        line_put(line_.get(), LINE_WORDS, LINE_ASK, ticked_, nullptr, 0);
    }
}

// ---- the run

void LineBackend::greet(std::chrono::nanoseconds timeout, const std::function<bool()> &lives)
{
    begun_ = now_ns();
    greet_anew(false);
    while (!checked_) {
        pump(100ms);
        check_line("the greeting");
        if (!greeted_ && !lives()) {
            fail("the program of the board ended before it answered");
        }
        if (!greeted_ && now_ns() - begun_ > timeout.count()) {
            fail(no_greeting());
        }
    }
    std::fprintf(stderr, "%s: %s on %s, build %s, start %u\n", path().c_str(), board_.mission, board_.target,
                 hexadecimal(board_.build).c_str(), board_.starts);
}

Wait LineBackend::await_done(const RegisterWindow &clock, std::chrono::nanoseconds timeout)
{
    const std::int64_t end = now_ns() + timeout.count();
    Tick tick{};
    if (register_clock_due(&clock, &tick) && register_load(&clock, clock.board->clock) != ticked_) {
        begin(clock, tick);
    }
    while (!register_clock_is_done(&clock)) {
        const std::int64_t left = end - now_ns();
        if (status_ >= 0) {
            report("the board ended the run in the tick at " + seconds(t_) + ", with status " +
                   std::to_string(status_));
            return Wait::gone;
        }
        if (left <= 0) {
            return Wait::late;
        }
        pump(std::chrono::nanoseconds(left));
        check_line(t_ < 0 ? "the first tick" : "the tick at " + seconds(t_));
    }
    answer(tick);
    return Wait::done;
}

void LineBackend::begin(const RegisterWindow &clock, const Tick &tick)
{
    begun_ = now_ns();
    ticked_ = register_load(&clock, clock.board->clock);
    t_ = tick.t;
    pushing_ = true;
    if (t_ < 0) {
        zero_ = -1;
    } else if (settings_.pace > 0 && zero_ < 0) {
        zero_ = begun_ - due(t_);
    }
}

std::int64_t LineBackend::due(std::int64_t t) const
{
    return std::llround(static_cast<double>(t) / settings_.pace);
}

void LineBackend::answer(const Tick &tick)
{
    const std::int64_t now = now_ns();
    if (t_ < 0 || pushing_) {
        return;
    }
    ticks_++;
    spent_ += now - begun_;
    longest_ = std::max(longest_, now - begun_);
    if (settings_.pace > 0) {
        const std::int64_t late = std::max<std::int64_t>(now - zero_ - due(t_), 0);
        const auto bin = std::find_if(late_ms.begin(), late_ms.end(), [&](int ms) { return late < ms * 1'000'000LL; });
        late_[static_cast<std::size_t>(bin - late_ms.begin())]++;
        if (tick.dt > 0 && late >= due(tick.dt) && ++missed_ <= misses_named) {
            report("flight answered the tick at " + seconds(t_) + " " + seconds(late) + " late, when the next was due");
        }
    }
}

int LineBackend::end(std::chrono::nanoseconds timeout, const std::function<bool()> &lives)
{
    begun_ = now_ns();
    pushing_ = true;
    while (status_ < 0) {
        pump(100ms);
        check_line("the end of the run");
        // The end of a record takes its time on a slow line.
        if (now_ns() - std::max(line_->received_at, begun_) > timeout.count() || (status_ < 0 && !lives())) {
            fail("the board did not tell how its run ended");
        }
    }
    while (pump(100ms) && lives()) { // it repeats what was not acknowledged
    }
    if (!text_.empty()) {
        std::printf("%s\n", text_.c_str());
    }
    close_record(status_ == 0);
    if (!wrong_.empty()) {
        fail(wrong_);
    }
    return status_;
}

void LineBackend::print() const
{
    const LineCounts &c = line_->counts;
    std::printf("ticks %" PRIu64 "\ncpu_ns %.0f\nline_longest_ns %" PRId64 "\n", ticks_,
                static_cast<double>(spent_) / static_cast<double>(std::max<std::uint64_t>(ticks_, 1)), longest_);
    std::printf("line_bytes_sent %" PRIu64 "\nline_bytes_taken %" PRIu64 "\nline_frames_sent %u\nline_frames_taken %u\n"
                "line_resent %u\nline_damaged %u\nline_resets %u\nline_cuts %u\n",
                c.bytes_sent, c.bytes_taken, c.frames_sent, c.frames_taken, c.resent, c.damaged, resets_, cuts_);
    if (settings_.pace > 0) {
        std::printf("line_missed %u\n", missed_);
        for (std::size_t i = 0; i < late_.size(); i++) {
            const bool over = i == late_ms.size();
            std::printf("line_late_%s_%d_ms %u\n", over ? "over" : "under", late_ms[over ? i - 1 : i], late_[i]);
        }
    }
}

} // namespace fledge::registers
