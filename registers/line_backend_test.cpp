// SPDX-License-Identifier: Apache-2.0
// Flight on a board at a line: the board is a thread at the other end of a pseudo terminal, which speaks line.h.
#include "registers/line_backend.h"

#include <atomic>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <optional>
#include <string>
#include <thread>
#include <unistd.h>
#include <vector>

#include <gtest/gtest.h>

#include "registers/clock.h"
#include "registers/outside.h"
#include "registers/testing/board.h"
#include "registers/testing/terminal.h"
#include "tests/error_of.h"

namespace line_backend_test {

using namespace fledge::registers;
using namespace fledge::registers::testing;
using namespace std::chrono_literals;

constexpr std::uint32_t WORDS = 300; // more than one message has room for
constexpr std::uint64_t HASH = 0x0123456789abcdef;

/// What a board does, beside what it should.
struct Habits {
    const char *mission = "probe";
    std::uint64_t hash = HASH;
    std::uint32_t reset_in = 0;  ///< the tick within which it is reset; 0: none
    std::uint32_t silent_in = 0; ///< the tick from which it is silent
    std::uint32_t end_in = 0;    ///< the tick within which it ends the run
    bool speaks = true;          ///< else it sends bytes that are no frames
    bool doubled = false;        ///< a second board answers the greeting as well
    bool reset_between = false;  ///< the first answer is that of a board that is reset then
    double noise = 0;            ///< bytes that are changed
};

class Board {
public:
    Board(std::unique_ptr<SerialPort> port, const RegisterBoard &registers, Habits habits)
        : port_(std::move(port)), registers_(registers), habits_(habits), thread_([this] { run(); })
    {
    }
    ~Board()
    {
        ended_ = true;
        thread_.join();
    }
    Board(const Board &) = delete;
    Board &operator=(const Board &) = delete;

    std::atomic<std::uint32_t> starts = 0, flown = 0;
    std::atomic<bool> wakes = false; ///< a silent one speaks again

private:
    void start()
    {
        starts++;
        memory_.assign(registers_.size / 8 + 1, 0);
        window_ = register_window(&registers_, reinterpret_cast<volatile std::uint32_t *>(memory_.data()));
        shadow_.resize(registers_.size / 4);
        LineWelcome welcome{};
        welcome.boot = starts;
        welcome.hash = habits_.hash;
        welcome.build[0] = 0xAB;
        std::snprintf(welcome.target, sizeof welcome.target, "thread");
        std::snprintf(welcome.mission, sizeof welcome.mission, "%s", habits_.mission);
        line_ = std::make_unique<LineEnd>();
        line_await(
            line_.get(), &welcome, [](void *self, const LineMessage *m) { static_cast<Board *>(self)->take(*m); }, this,
            now());
        line_mirror_begin(&mirror_, &window_, 1, shadow_.data());
    }

    static std::int64_t now()
    {
        return std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count();
    }

    void take(const LineMessage &m)
    {
        if (m.kind == LINE_HELLO) {
            line_mirror_begin(&mirror_, &window_, 1, shadow_.data());
        } else if (m.kind == LINE_WORDS && line_mirror_put(&mirror_, m.bytes, m.n) && (m.flags & LINE_LAST)) {
            line_mirror_finish(&mirror_);
        }
    }

    void send(std::span<const std::byte> bytes)
    {
        while (!bytes.empty() && port_->is_open()) {
            bytes = bytes.subspan(port_->send(bytes));
        }
    }

    void send_welcome_of_another()
    {
        LineEnd other = *line_;
        other.welcome.boot += 1000;
        other.greet = 1;
        other.greeted = 0;
        std::size_t n = 0;
        const std::uint8_t *frame = line_output(&other, now(), &n);
        send(std::as_bytes(std::span(frame, n)));
    }

    void exchange()
    {
        std::array<std::byte, 1000> room{};
        std::size_t n = 0;
        while (const std::uint8_t *frame = line_output(line_.get(), now(), &n)) {
            const bool welcomes = frame[4] == LINE_WELCOME;
            if (welcomes && line_->session != 0 && std::exchange(habits_.reset_between, false)) {
                send_welcome_of_another();
            }
            send(std::as_bytes(std::span(frame, n)));
            if (welcomes && habits_.doubled) {
                send_welcome_of_another();
            }
        }
        n = port_->receive(room, 1ms);
        for (std::size_t i = 0; i < n; i++) {
            state_ = state_ * 6364136223846793005U + 1442695040888963407U;
            if (static_cast<double>(state_ >> 11) * 0x1p-53 < habits_.noise) {
                room[i] ^= std::byte{4};
            }
        }
        line_input(line_.get(), room.data(), n, now());
    }

    void say(LineKind kind, std::uint32_t flags, const void *bytes, std::size_t n)
    {
        while (!line_put(line_.get(), kind, flags, 0, bytes, n) && !ended_) {
            exchange();
        }
    }

    /// Each word that flight writes is three times the one that it reads; the record has their sum.
    void fly(std::uint32_t tick)
    {
        std::uint32_t sum = 0;
        for (std::uint32_t i = 0; i < WORDS; i++) {
            std::uint32_t in = 0;
            register_take_word(&window_, &registers_.lanes[0], i, &in);
            sum += in;
            register_put_word(&window_, &registers_.lanes[1], i, 3 * in);
        }
        register_clock_finish(&window_);
        std::array<std::uint8_t, LINE_PAYLOAD> payload{};
        for (int last = 0; !last;) {
            const std::uint32_t n = line_mirror_take(&mirror_, payload.data(), &last);
            say(LINE_WORDS, last ? std::uint32_t{LINE_LAST} : 0U, payload.data(), n);
        }
        const std::string line = std::to_string(tick) + " " + std::to_string(sum) + "\n";
        std::vector<std::uint8_t> record(4);
        for (std::size_t i = 0; i < 4; i++) {
            record[i] = static_cast<std::uint8_t>(recorded_ >> 8 * i);
        }
        record.insert(record.end(), line.begin(), line.end());
        recorded_ += static_cast<std::uint32_t>(line.size());
        say(LINE_RECORD, 0, record.data(), record.size());
        flown++;
    }

    void run()
    {
        start();
        while (!ended_) {
            if (!habits_.speaks) {
                send(std::as_bytes(std::span("U-Boot 2023.01\r\n")));
                std::this_thread::sleep_for(1ms);
                continue;
            }
            exchange();
            Tick tick{};
            const std::uint32_t count = register_load(&window_, registers_.clock);
            if (register_clock_stopped(&window_) && !stopped_) {
                stopped_ = true;
                say(LINE_TEXT, 0, "stack_bytes 100\n", 16);
                say(LINE_END, 0, "\0", 1);
            } else if (register_clock_due(&window_, &tick)) {
                if (count == habits_.reset_in) {
                    habits_.reset_in = 0;
                    start();
                } else if (count == habits_.end_in) {
                    say(LINE_END, 0, "\3", 1);
                    habits_.end_in = 0;
                    register_clock_finish(&window_);
                } else {
                    while (count == habits_.silent_in && !ended_ && !wakes) {
                        std::this_thread::sleep_for(1ms);
                    }
                    fly(count);
                }
            }
        }
    }

    std::unique_ptr<SerialPort> port_;
    const RegisterBoard &registers_;
    Habits habits_;
    std::unique_ptr<LineEnd> line_;
    std::vector<std::uint64_t> memory_;
    std::vector<std::uint32_t> shadow_;
    RegisterWindow window_{};
    LineMirror mirror_{};
    std::uint32_t recorded_ = 0;
    std::uint64_t state_ = 1;
    bool stopped_ = false;
    std::atomic<bool> ended_ = false;
    std::thread thread_;
};

class LineBackendTest : public TerminalTest {
protected:
    LineBackendTest()
        : bench_(
              {{REGISTER_WORD, PLAIN, 4, 4, false, WORDS}, {REGISTER_WORD, REGISTER_FROM_FLIGHT, 4, 4, false, WORDS}},
              true),
          record_(std::filesystem::temp_directory_path() / ("line_backend_" + std::to_string(getpid())))
    {
    }
    ~LineBackendTest() override
    {
        std::filesystem::remove(record_);
        std::filesystem::remove(record_.string() + ".part");
    }

    /// Make both ends.
    void begin(const Habits &habits, const std::string &line = "pty")
    {
        static const RegisterBoard *boards[1];
        boards[0] = &bench_.board();
        backend_.emplace(boards, LineBackend::Mission{"probe", HASH}, LineSettings::read(line), record_.string());
        board_ =
            std::make_unique<Board>(std::make_unique<SerialPort>(backend_->path(), 115200), bench_.board(), habits);
    }
    void greet()
    {
        backend_->greet(60s, [] { return true; });
    }

    /// Fly ticks from t on, and check what flight wrote.
    void fly(std::int64_t t, std::int64_t ticks)
    {
        const RegisterWindow &w = backend_->windows()[0];
        for (const std::int64_t end = t + ticks; t < end; t++) {
            for (std::uint32_t i = 0; i < WORDS; i++) {
                register_put_word(&w, &w.board->lanes[0], i, word(t, i));
            }
            register_clock_start(&w, {t * 100'000'000, t > 0 ? 100'000'000 : 0});
            ASSERT_EQ(backend_->await_done(w, 60s), Wait::done);
            for (std::uint32_t i = 0; i < WORDS; i++) {
                std::uint32_t out = 0;
                register_take_word(&w, &w.board->lanes[1], i, &out);
                ASSERT_EQ(out, 3 * word(t, i)) << "tick " << t << ", word " << i;
            }
        }
    }
    /// Few words change from tick to tick.
    static std::uint32_t word(std::int64_t t, std::uint32_t i)
    {
        return i % 7 == 0 ? static_cast<std::uint32_t>(t) * 1000 + i : i;
    }
    int end()
    {
        register_clock_stop(&backend_->windows()[0]);
        return backend_->end(60s, [] { return true; });
    }
    std::string recorded() const
    {
        std::ifstream file(record_);
        return {std::istreambuf_iterator<char>(file), {}};
    }
    static std::string expected(std::int64_t first, std::int64_t ticks, std::int64_t count = 1)
    {
        std::string text;
        for (std::int64_t t = first; t < first + ticks; t++) {
            std::uint32_t sum = 0;
            for (std::uint32_t i = 0; i < WORDS; i++) {
                sum += word(t, i);
            }
            text += std::to_string(t - first + count) + " " + std::to_string(sum) + "\n";
        }
        return text;
    }
    Bench bench_;
    std::filesystem::path record_;
    std::optional<LineBackend> backend_;
    std::unique_ptr<SerialPort> cable_;
    std::unique_ptr<Board> board_; ///< ends first
};

#define EXPECT_SAYS(text, part) EXPECT_NE((text).find(part), std::string::npos) << (text)

TEST_F(LineBackendTest, TheBoardsMemoryIsTheSameAtBothEndsInEachTick)
{
    begin({});
    greet();
    fly(0, 50);
    EXPECT_EQ(end(), 0);
    EXPECT_EQ(recorded(), expected(0, 50));
    EXPECT_EQ(board_->flown, 50U);
}

TEST_F(LineBackendTest, NoiseChangesNothingThatArrives)
{
    Habits habits;
    habits.noise = 1e-3;
    begin(habits);
    greet();
    fly(0, 50);
    EXPECT_EQ(end(), 0);
    EXPECT_EQ(recorded(), expected(0, 50));
    EXPECT_EQ(board_->flown, 50U);
}

TEST_F(LineBackendTest, ABoardThatIsResetInATickEndsTheRunOrGoesOn)
{
    Habits habits;
    habits.reset_in = 10;
    begin(habits);
    greet();
    EXPECT_SAYS(error_of<Error>([&] { fly(0, 50); }), "the board was reset in the tick at 0.9 s, which ends the run");

    begin(habits, "pty?reset=go-on");
    greet();
    fly(0, 50);
    EXPECT_EQ(end(), 0);
    EXPECT_EQ(board_->starts, 2U);
    EXPECT_EQ(board_->flown, 50U);
    EXPECT_EQ(recorded(), expected(0, 50));
}

TEST_F(LineBackendTest, ASilentBoardIsReportedAndEndsTheRunAsTheSettingsSay)
{
    Habits habits;
    habits.silent_in = 5;
    begin(habits, "pty?cut=1.5");
    greet();
    ::testing::internal::CaptureStderr();
    const std::string error = error_of<Error>([&] { fly(0, 50); });
    const std::string output = ::testing::internal::GetCapturedStderr();
    EXPECT_SAYS(error, "the board has been silent for 1.5 s in the tick at 0.4 s");
    EXPECT_SAYS(output, "the board has been silent for 1 s in the tick at 0.4 s: is the line cut?");
    EXPECT_EQ(board_->flown, 4U);
}

TEST_F(LineBackendTest, ABoardThatEndsWithinTheRunEndsIt)
{
    Habits habits;
    habits.end_in = 5;
    begin(habits);
    greet();
    fly(0, 4);
    const RegisterWindow &w = backend_->windows()[0];
    register_clock_start(&w, {400'000'000, 100'000'000});
    EXPECT_EQ(backend_->await_done(w, 60s), Wait::gone);
}

TEST_F(LineBackendTest, ABoardOfAnotherMissionOrWithAStaleProgramIsRefused)
{
    Habits habits;
    habits.mission = "lander";
    begin(habits);
    EXPECT_SAYS(error_of<Error>([&] { greet(); }),
                "the board (thread) flies lander, not probe: load the program of probe");

    habits = {};
    habits.hash++;
    begin(habits);
    EXPECT_SAYS(error_of<Error>([&] { greet(); }), "the board's program of probe is stale");

    begin({}, "pty?build=ac");
    EXPECT_SAYS(error_of<Error>([&] { greet(); }), "its build is ab00000000000000000000000000000000000000, not ac");

    begin({}, "pty?build=ab00");
    greet();
    fly(0, 2);
}

TEST_F(LineBackendTest, TwoBoardsOnOneLineAreRefused)
{
    for (const char *line : {"pty", "pty?reset=go-on"}) {
        Habits habits;
        habits.doubled = true;
        begin(habits, line);
        EXPECT_SAYS(error_of<Error>([&] {
                        greet();
                        fly(0, 1000);
                    }),
                    "two boards answer, thread and thread: take one of them off the line");
    }
}

TEST_F(LineBackendTest, ABoardThatIsResetBetweenTwoAnswersIsOneBoard)
{
    Habits habits;
    habits.reset_between = true;
    begin(habits, "pty?reset=go-on");
    greet();
    fly(0, 2);
}

TEST_F(LineBackendTest, WithoutAnAnswerTheReasonSaysWhatHasCome)
{
    Habits habits;
    habits.speaks = false;
    begin(habits);
    EXPECT_SAYS(error_of<Error>([&] { backend_->greet(100ms, [] { return true; }); }),
                "bytes have come, and no frame of them: does the board have another rate");

    board_.reset();
    static const RegisterBoard *boards[1];
    boards[0] = &bench_.board();
    backend_.emplace(boards, LineBackend::Mission{"probe", HASH}, LineSettings::read("pty"), "");
    EXPECT_SAYS(error_of<Error>([&] { backend_->greet(100ms, [] { return true; }); }),
                "nothing has come: is the board on");
    EXPECT_SAYS(error_of<Error>([&] { backend_->greet(60s, [] { return false; }); }), "ended before it answered");
}

TEST_F(LineBackendTest, ADeviceThatVanishesIsWaitedForAndFoundAgain)
{
    const auto device = std::filesystem::temp_directory_path() / ("line_device_" + std::to_string(getpid()));
    static const RegisterBoard *boards[1];
    boards[0] = &bench_.board();
    const auto plug = [&] {
        cable_ = std::make_unique<SerialPort>();
        std::filesystem::create_symlink(cable_->path(), device);
    };
    plug();
    backend_.emplace(boards, LineBackend::Mission{"probe", HASH}, LineSettings::read(device.string() + "?reset=go-on"),
                     record_.string());
    board_ = std::make_unique<Board>(std::move(cable_), bench_.board(), Habits());
    greet();
    fly(0, 10);
    ::testing::internal::CaptureStderr();
    std::filesystem::remove(device);
    board_.reset(); // with it goes the device, as a board's own USB port does
    plug();
    board_ = std::make_unique<Board>(std::move(cable_), bench_.board(), Habits());
    fly(10, 10);
    const std::string output = ::testing::internal::GetCapturedStderr();
    EXPECT_SAYS(output, "the device has vanished in the tick at 1 s: is its cable out?");
    EXPECT_SAYS(output, "the device is there again after ");
    EXPECT_SAYS(output, "the board was reset in the tick at 1 s, and begins flight there");
    // The board sends the first bytes of its record after its answer and before its answer to the next tick.
    EXPECT_TRUE(output.find("the board kept nothing over its reset: the record begins anew at 1 s") != output.npos ||
                output.find("the board kept nothing over its reset: the record begins anew at 1.1 s") != output.npos)
        << output;
    EXPECT_EQ(end(), 0);
    EXPECT_EQ(recorded(), expected(10, 10, 11));

    std::filesystem::remove(device);
    plug();
    backend_.emplace(boards, LineBackend::Mission{"probe", HASH}, LineSettings::read(device.string() + "?cut=0.2"),
                     record_.string());
    board_ = std::make_unique<Board>(std::move(cable_), bench_.board(), Habits());
    greet();
    fly(0, 10);
    std::filesystem::remove(device); // first: another program may have the next terminal of this number
    board_.reset();
    EXPECT_SAYS(error_of<Error>([&] { fly(10, 1); }),
                "the device has vanished in the tick at 1 s, and did not come back within "
                "0.2 s");
}

TEST_F(LineBackendTest, LatenessIsCountedAgainstThePaceAndMissedTicksAreNamed)
{
    Habits habits;
    habits.silent_in = 5;
    begin(habits, "pty?pace=1e6"); // a tick each 0.1 us
    greet();
    board_->wakes = true;
    ::testing::internal::CaptureStdout();
    ::testing::internal::CaptureStderr();
    fly(0, 20);
    backend_->print();
    const std::string output = ::testing::internal::GetCapturedStderr();
    const std::string figures = ::testing::internal::GetCapturedStdout();
    EXPECT_SAYS(figures, "ticks 20\n");
    EXPECT_SAYS(figures, "line_missed 19\n");
    EXPECT_SAYS(output, "flight answered the tick at 0.1 s ");
}

TEST(LineSettings, AreReadFromALineOfText)
{
    const LineSettings s = LineSettings::read("/dev/ttyACM0?baud=115200&reset=go-on&cut=5&pace=1&build=1a2b");
    EXPECT_EQ(s.device, "/dev/ttyACM0");
    EXPECT_EQ(s.baud, 115200U);
    EXPECT_TRUE(s.goes_on);
    EXPECT_EQ(s.cut, 5.0);
    EXPECT_EQ(s.pace, 1.0);
    EXPECT_EQ(s.build, "1a2b");
    const LineSettings usual = LineSettings::read("/dev/ttyACM0");
    EXPECT_EQ(usual.baud, 921600U);
    EXPECT_FALSE(usual.goes_on);
    const auto refused = [](const char *text) {
        try {
            LineSettings::read(text);
        } catch (const Error &error) {
            return std::string(error.what());
        }
        return std::string();
    };
    EXPECT_SAYS(refused("x?bauds=1"), "a line has no option `bauds`; choose of: baud, reset, cut, pace, build");
    EXPECT_SAYS(refused("x?baud=fast"), "the line's baud is a number from 300 to 2e+07, not 'fast'");
    EXPECT_SAYS(refused("x?baud=9600&reset=never"), "the line's reset is `end` or `go-on`, not 'never'");
    EXPECT_SAYS(refused("?baud=9600"), "names no device");
}

} // namespace line_backend_test
