// SPDX-License-Identifier: Apache-2.0
// Files through the code that executes all commands and sends all telemetry, against an entity of the ground behind a
// link that loses and reorders.
#include "ccsds/cfdp.h"
#include "ccsds/store/memory_store.h"
#include "flight/services/testing/flight_software.h"
#include "flight/telemetry/telemetry.h"

extern "C" {
#include "flight/services/files.h"
}

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <deque>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <vector>

namespace files_test {

using namespace service_testing;

constexpr int64_t ms = 1'000'000, s = 1000 * ms;

/// A module with parameters.
struct Gains {
    double K[100];
    uint32_t n;
    uint32_t spare;
};

struct Mission {
    Files files;
    Gains gains;
    int published;
};

const ExecRun runs[] = {{8, 100}, {4, 2}};
const CommandRule rules[] = {
    {"K", "> 0", 0, 100, 1, COMMAND_ALL_ROWS, FLEDGE_HAS_LO | FLEDGE_LO_OPEN, FLEDGE_F64, 0, 0}};
const CommandBlock blocks[] = {{runs, rules, sizeof(Gains), 2, 1, 1, 0}};
const CommandService *const kinds[] = {&files_service};
CommandServices services = [] {
    CommandServices made =
        command_services(kinds, 1, [](void *m, uint32_t) -> void * { return &static_cast<Mission *>(m)->files; });
    made.telemetry = telemetry_services;
    return made;
}();
uint8_t queue[64 * COMMAND_MAX], staged[sizeof(Gains)], packet_memory[TELEMETRY_REPORT_MAX];
const CommandTable table = [] {
    CommandTable made = command_table(&services, queue, sizeof queue);
    made.n_blocks = 1;
    made.blocks = blocks;
    made.staged = staged;
    made.parameters = [](void *m, uint16_t) -> void * { return &static_cast<Mission *>(m)->gains; };
    made.publish = [](void *m, uint16_t, int64_t) { static_cast<Mission *>(m)->published++; };
    made.reset = [](void *m, int64_t) { files_reset(&static_cast<Mission *>(m)->files); };
    return made;
}();
TelemetryRate rates[3 + COMMAND_STREAMS];
const TelemetryTable telemetry = {0x0880, 0, nullptr, rates, packet_memory, [](const void *) -> uint16_t { return 0; },
                                  nullptr};

Bytes text(const std::string &letters)
{
    return {letters.begin(), letters.end()};
}

Bytes command(int code, uint16_t first, const std::string &name, uint64_t sequence = 9)
{
    return packet(code, big(0x1234, 2) + big(first, 2) + text(name), sequence);
}

Bytes control(FileAction action, int own, uint32_t transaction)
{
    return packet(COMMAND_FILE_CONTROL,
                  big(0x1234, 2) + big(action, 2) + big(static_cast<uint64_t>(own), 2) + big(transaction, 4));
}

Bytes any_bytes(uint32_t seed, size_t n)
{
    std::mt19937 random(seed);
    Bytes bytes(n);
    for (uint8_t &byte : bytes) {
        byte = static_cast<uint8_t>(random());
    }
    return bytes;
}

int put_file(const CfdpStore &store, const std::string &name, const Bytes &bytes)
{
    const int file = store.open(store.user, name.c_str(), CFDP_OPEN_NEW);
    return file < 0 ? file : store.write(store.user, file, 0, bytes.data(), bytes.size());
}

/// The content of a file; {0xEE} if there is none.
Bytes get_file(const CfdpStore &store, const std::string &name)
{
    const int file = store.open(store.user, name.c_str(), CFDP_OPEN_READ);
    if (file < 0) {
        return {0xEE};
    }
    Bytes bytes(static_cast<size_t>(store.size(store.user, file)));
    EXPECT_EQ(store.read(store.user, file, 0, bytes.data(), bytes.size()), 0);
    return bytes;
}

/// The ground: an entity with a store.
struct Ground {
    std::vector<uint64_t> memory = std::vector<uint64_t>(MEMORY_STORE_BYTES(4096) / 8);
    CfdpRemote craft{};
    CfdpTransaction transactions[16];
    CfdpRange ranges[16 * 64];
    CfdpPast past[64];
    uint8_t work[1024];
    Cfdp cfdp{};
    std::vector<CfdpEvent> events{};

    Ground()
    {
        auto *store = reinterpret_cast<MemoryStore *>(memory.data());
        memory_store_begin(store, memory.size() * 8);
        memory_store_mount(store);
        craft.entity = 2;
        craft.ack_timer = craft.nak_timer = craft.check_timer = 5 * s;
        craft.inactivity = 300 * s;
        craft.segment = 400;
        craft.ack_limit = craft.nak_limit = craft.check_limit = 20;
        CfdpSetup setup{};
        setup.entity = 1;
        setup.store = memory_store_files(store);
        setup.notify = [](void *user, const CfdpEvent *event) {
            static_cast<Ground *>(user)->events.push_back(*event);
        };
        setup.user = this;
        setup.remotes = &craft;
        setup.remotes_n = 1;
        setup.transactions = transactions;
        setup.transactions_n = 16;
        setup.ranges = ranges;
        setup.ranges_n = 64;
        setup.past = past;
        setup.past_n = 64;
        setup.work = work;
        setup.work_n = sizeof work;
        setup.entity_bytes = 1;
        setup.sequence_bytes = 2;
        cfdp_begin(&cfdp, &setup, 1);
    }
    Ground(const Ground &) = delete;

    const CfdpStore &store() const { return cfdp.set.store; }
    CfdpId put(const std::string &from, const std::string &to, int class1 = 0, const Bytes &options = {})
    {
        const CfdpPut request{
            2, from.c_str(), to.c_str(), options.data(), options.size(), static_cast<uint8_t>(class1), 0, 0};
        CfdpId id{};
        EXPECT_EQ(cfdp_put(&cfdp, &request, &id), 0);
        return id;
    }
    int ended() const
    {
        const auto last = std::find_if(events.rbegin(), events.rend(),
                                       [](const CfdpEvent &event) { return event.what == CFDP_EVENT_ENDED; });
        return last == events.rend() ? -1 : last->condition;
    }
};

/// Flight and ground, and the link between them: an instant every 100 ms, the module's task every 500 ms.
class FilesTest : public testing::Test {
protected:
    FilesTest()
    {
        mission_->files.par.rate = 4000;
        mission_->files.par.entity = 2;
        mission_->files.par.ground = 1;
        mission_->files.par.allowed = 15;
        std::fill(std::begin(mission_->gains.K), std::end(mission_->gains.K), 1.0);
        services.store = nullptr;
        command_begin(&state_);
        telemetry_begin(&telemetry);
        files_reset(&mission_->files);
    }

    CommandReason send(const Bytes &p)
    {
        return command_accept(&state_, &table, nullptr, p.data(), static_cast<uint32_t>(p.size()), note, this);
    }

    bool lost() { return std::uniform_real_distribution<>()(random_) < loss_; }

    /// One instant of all.
    void step()
    {
        t_ += 100 * ms;
        cfdp_time(&ground_.cfdp, t_);
        Bytes pdu(512);
        for (int i = 0; i < 4; i++) {
            pdu.resize(512);
            pdu.resize(cfdp_next(&ground_.cfdp, nullptr, pdu.data(), pdu.size()));
            if (!pdu.empty() && !lost()) {
                up_.push_back(pdu);
            }
        }
        if (up_.size() > 1 && loss_ > 0) {
            std::swap(up_.front(), up_.back());
        }
        for (const Bytes &bytes : up_) {
            EXPECT_EQ(send(packet(COMMAND_PDU, bytes)), COMMAND_OK);
        }
        up_.clear();
        command_execute(&state_, &table, mission_.get(), t_, note, this);
        if (t_ % (500 * ms) == 0) {
            files_update(&mission_->files, {t_, updated_ < 0 ? 0 : t_ - updated_});
            updated_ = t_;
            record();
        }
        if (mission_->files.out.event.count != counted_) {
            counted_ = mission_->files.out.event.count;
            events_.push_back(mission_->files.out.event);
        }
        const CommandContext context = {&state_, &table, mission_.get(), t_, 0};
        const size_t before = sent_.size();
        telemetry_services(&telemetry, &context, note, take, this);
        for (size_t i = before; i < sent_.size(); i++) {
            if (!lost()) {
                cfdp_take(&ground_.cfdp, sent_[i].data(), sent_[i].size());
            }
        }
    }
    /// The recorder, if it has pages.
    void record()
    {
        const RecorderRequest &request = mission_->files.out.request;
        RecorderReply &reply = mission_->files.in.recorded;
        reply.head = head_next(reply.head, t_, QUALITY_GOOD);
        reply.pages = reply.used = static_cast<uint32_t>(recorder_.size());
        if (request.code == RECORDER_NOTHING || request.number == reply.number) {
            return;
        }
        reply.number = request.number;
        uint8_t *page = recorder_.at(request.page).data();
        if (request.code == RECORDER_WRITE) {
            std::memcpy(page, request.data, RECORDER_PAGE);
        } else {
            std::memcpy(reply.data, page, RECORDER_PAGE);
        }
    }
    void run(int64_t duration)
    {
        for (const int64_t end = t_ + duration; t_ < end;) {
            step();
        }
    }

    static void note(void *self, const CommandReport *report, const uint8_t *data)
    {
        auto &me = *static_cast<FilesTest *>(self);
        me.reports_.push_back(*report);
        me.data_.assign(data, data + report->n);
    }
    static void take(void *self, const uint8_t *p, uint32_t n)
    {
        EXPECT_EQ(p[0] << 8 | p[1], 0x0880 + 3 + STREAM_FILES);
        static_cast<FilesTest *>(self)->sent_.emplace_back(p + TELEMETRY_HEADER, p + n);
    }

    /// What was reported of the command with a sequence: stage, reason, detail.
    using Rows = std::vector<std::vector<int>>;
    Rows reported(int sequence) const
    {
        Rows rows;
        for (const CommandReport &report : reports_) {
            if (report.sequence == sequence) {
                rows.push_back({report.executed, report.reason, report.detail});
            }
        }
        return rows;
    }
    /// What became of a command: why it was refused, or the first report of its execution.
    CommandReason did(const Bytes &p)
    {
        const size_t before = reports_.size();
        if (send(p) == COMMAND_OK) {
            step();
        }
        const auto first = std::find_if(
            reports_.begin() + static_cast<std::ptrdiff_t>(before), reports_.end(), [&](const CommandReport &report) {
                return report.code == p[6] && (report.executed != COMMAND_ACCEPTED || report.reason != COMMAND_OK);
            });
        detail_ = first->detail;
        return static_cast<CommandReason>(first->reason);
    }
    int count(FilesEventId id) const
    {
        return static_cast<int>(
            std::count_if(events_.begin(), events_.end(), [&](const FlightEvent &event) { return event.id == id; }));
    }
    const FilesState &state() const { return mission_->files.out.state; }
    CfdpStore store() { return memory_store_files(reinterpret_cast<MemoryStore *>(mission_->files.mem.store)); }

    std::unique_ptr<Mission> mission_ = std::make_unique<Mission>();
    Ground ground_{};
    CommandState state_{};
    int64_t t_ = 0, updated_ = -1;
    double loss_ = 0;
    std::vector<Bytes> recorder_{};
    std::mt19937 random_{7};
    std::deque<Bytes> up_{};
    std::vector<CommandReport> reports_{};
    Bytes data_{};
    uint16_t detail_ = 0; ///< of what did() found
    std::vector<Bytes> sent_{};
    uint32_t counted_ = 0;
    std::vector<FlightEvent> events_{};
};

TEST_F(FilesTest, files_go_both_ways_over_a_link_that_loses)
{
    const Bytes plan = any_bytes(1, 20'000), science = any_bytes(2, 30'000);
    loss_ = 0.1;
    put_file(ground_.store(), "plan", plan);
    ground_.put("plan", "next");
    run(60 * s);
    EXPECT_EQ(get_file(store(), "next"), plan);
    EXPECT_EQ(ground_.ended(), CFDP_NO_ERROR);
    EXPECT_EQ(count(FILES_RECEIVED), 1);
    EXPECT_EQ(events_.back().arguments[0], 1.0);
    EXPECT_EQ(events_.back().arguments[2], 20'000.0);

    put_file(store(), "science", science);
    send(command(COMMAND_FILE_SEND, 2, "science>got", 77));
    run(90 * s);
    EXPECT_EQ(get_file(ground_.store(), "got"), science);
    EXPECT_EQ(count(FILES_SENT), 1);
    const Rows rows = reported(77);
    ASSERT_EQ(rows.size(), 13u); // accepted, started, at 10 % to 100 %, done
    EXPECT_EQ(rows[0], (std::vector<int>{COMMAND_ACCEPTED, COMMAND_OK, 0}));
    EXPECT_EQ(rows[1], (std::vector<int>{COMMAND_STARTED, COMMAND_OK, 1}));
    for (int i = 2; i < 12; i++) {
        EXPECT_EQ(rows[static_cast<size_t>(i)][0], COMMAND_UNDER_WAY);
        EXPECT_GT(rows[static_cast<size_t>(i)][2], rows[static_cast<size_t>(i) - 1][2] - (i == 2));
    }
    EXPECT_EQ(rows.back(), (std::vector<int>{COMMAND_DONE, COMMAND_OK, 0}));
    EXPECT_EQ(state_.counters.executed, 1u);
    run(1 * s);
    EXPECT_EQ(state().received, 1u);
    EXPECT_EQ(state().delivered, 1u);
    EXPECT_EQ(state().receiving + state().sending + state().failed, 0u);
    EXPECT_EQ(state().used, (2u + 82u + 123u) * MEMORY_DATA); // names, and parts of 244 bytes
}

TEST_F(FilesTest, class_1_ends_when_all_is_sent)
{
    run(1 * s);
    put_file(store(), "log", any_bytes(3, 1000));
    send(command(COMMAND_FILE_SEND, 1, "log", 5));
    run(5 * s);
    EXPECT_EQ(get_file(ground_.store(), "log"), any_bytes(3, 1000));
    EXPECT_EQ(reported(5).back(), (std::vector<int>{COMMAND_DONE, COMMAND_OK, 0}));
    put_file(ground_.store(), "up", any_bytes(4, 1000));
    ground_.put("up", "up", 1);
    run(5 * s);
    EXPECT_EQ(get_file(store(), "up"), any_bytes(4, 1000));
}

TEST_F(FilesTest, the_rate_holds_whatever_waits)
{
    run(1 * s);
    put_file(store(), "a", any_bytes(5, 60'000));
    send(command(COMMAND_FILE_SEND, 1, "a"));
    send(command(COMMAND_FILE_SEND, 1, "a>b"));
    mission_->files.par.rate = 2500;
    step();
    const auto bytes = [&] {
        size_t n = 0;
        for (const Bytes &unit : sent_) {
            n += unit.size();
            EXPECT_LE(unit.size(), static_cast<size_t>(COMMAND_DATA_MAX));
        }
        return static_cast<double>(n);
    };
    const double before = bytes();
    run(20 * s);
    EXPECT_NEAR((bytes() - before) / 20, 2500, 30);
}

TEST_F(FilesTest, what_the_ground_may_ask_for)
{
    run(1 * s);
    put_file(store(), "science", any_bytes(6, 700));
    const auto request = [&](CfdpMessageType type, const char *first, const char *second) {
        CfdpMessage message{};
        message.type = static_cast<uint8_t>(type);
        message.entity = 1;
        message.entity_bytes = 1;
        message.first = {reinterpret_cast<const uint8_t *>(first), static_cast<uint8_t>(std::strlen(first))};
        message.second = {reinterpret_cast<const uint8_t *>(second), static_cast<uint8_t>(std::strlen(second))};
        Bytes options(300);
        options.resize(cfdp_message_write(&message, options.data(), options.size()));
        ground_.put("", "", 0, options);
        run(10 * s);
        return get_file(ground_.store(), second);
    };
    EXPECT_EQ(request(CFDP_PROXY_PUT, "science", "got"), any_bytes(6, 700));
    EXPECT_EQ(request(CFDP_LIST, "", "names"), text("science\n"));
    mission_->files.par.allowed = CFDP_ALLOW_LIST;
    EXPECT_EQ(request(CFDP_PROXY_PUT, "science", "again"), Bytes{0xEE});
    EXPECT_EQ(request(CFDP_LIST, "", "more"), text("science\n"));
    EXPECT_EQ(state().failed, 0u);
}

TEST_F(FilesTest, suspended_and_cancelled_by_command)
{
    run(1 * s);
    put_file(store(), "long", any_bytes(8, 40'000));
    send(command(COMMAND_FILE_SEND, 2, "long", 31));
    run(2 * s);
    EXPECT_EQ(did(control(FILE_SUSPEND, 1, 2)), COMMAND_PLACE);
    EXPECT_EQ(did(control(FILE_RESUME, 1, 1)), COMMAND_PLACE);
    EXPECT_EQ(did(control(FILE_SUSPEND, 1, 1)), COMMAND_OK);
    run(1 * s);
    const size_t sent = sent_.size();
    run(30 * s);
    EXPECT_EQ(sent_.size(), sent);
    EXPECT_EQ(did(control(FILE_RESUME, 1, 1)), COMMAND_OK);
    run(2 * s);
    EXPECT_GT(sent_.size(), sent);
    EXPECT_EQ(did(control(FILE_CANCEL, 1, 1)), COMMAND_OK);
    run(5 * s);
    EXPECT_EQ(reported(31).back(), (std::vector<int>{COMMAND_DONE, COMMAND_FAILED, CFDP_CANCEL_REQUEST}));
    EXPECT_EQ(count(FILES_SUSPENDED) + count(FILES_RESUMED) + count(FILES_FAILED), 3);
    EXPECT_EQ(get_file(ground_.store(), "long"), Bytes{0xEE});

    put_file(ground_.store(), "up", any_bytes(9, 40'000));
    const CfdpId id = ground_.put("up", "up");
    run(1 * s);
    EXPECT_EQ(did(control(FILE_CANCEL, 0, static_cast<uint32_t>(id.sequence))), COMMAND_OK);
    run(5 * s);
    EXPECT_EQ(ground_.ended(), CFDP_CANCEL_REQUEST);
    EXPECT_EQ(get_file(store(), "up"), Bytes{0xEE});
    run(1 * s);
    EXPECT_EQ(state().failed, 2u);
    EXPECT_EQ(state().used, (1u + 164u) * MEMORY_DATA); // of `long` alone
}

TEST_F(FilesTest, a_link_that_is_out_rests)
{
    run(1 * s);
    put_file(store(), "long", any_bytes(8, 20'000));
    send(command(COMMAND_FILE_SEND, 2, "long"));
    run(2 * s);
    mission_->files.par.frozen = ground_.craft.frozen = 1;
    const size_t sent = sent_.size();
    run(1000 * s);
    EXPECT_EQ(sent_.size(), sent);
    mission_->files.par.frozen = ground_.craft.frozen = 0;
    run(30 * s);
    EXPECT_EQ(get_file(ground_.store(), "long"), any_bytes(8, 20'000));
}

TEST_F(FilesTest, a_ground_with_another_number_does_not_disturb_what_is_under_way)
{
    run(1 * s);
    put_file(store(), "log", any_bytes(3, 20'000));
    send(command(COMMAND_FILE_SEND, 2, "log", 5));
    run(2 * s);
    mission_->files.par.ground = 3;
    const size_t sent = sent_.size();
    run(30 * s);
    EXPECT_EQ(sent_.size(), sent);
    mission_->files.par.ground = 1;
    run(10 * s);
    EXPECT_EQ(get_file(ground_.store(), "log"), any_bytes(3, 20'000));
}

TEST_F(FilesTest, a_ground_that_is_gone)
{
    run(1 * s);
    put_file(store(), "log", any_bytes(3, 1000));
    mission_->files.par.ack_limit = 3;
    loss_ = 1;
    send(command(COMMAND_FILE_SEND, 2, "log", 5));
    run(120 * s);
    EXPECT_EQ(reported(5).back(), (std::vector<int>{COMMAND_DONE, COMMAND_FAILED, CFDP_ACK_LIMIT}));
    EXPECT_EQ(state().condition, static_cast<uint32_t>(CFDP_ACK_LIMIT));
    EXPECT_EQ(state().sending, 0u);
    EXPECT_GE(count(FILES_FAULT), 1);
    EXPECT_EQ(count(FILES_FAILED), 1);
}

TEST_F(FilesTest, several_commands_end_at_once_each_with_its_own_report)
{
    run(1 * s);
    put_file(store(), "long", any_bytes(2, 20'000));
    put_file(store(), "a", any_bytes(1, 100));
    put_file(store(), "empty", {});
    send(command(COMMAND_FILE_SEND, 2, "long", 40));
    send(command(COMMAND_FILE_SEND, 2, "a", 41));
    send(command(COMMAND_FILE_SEND, 2, "empty", 42));
    run(5 * s);
    const std::vector<int> done{COMMAND_DONE, COMMAND_OK, 0};
    EXPECT_EQ(reported(41).back(), done);
    EXPECT_EQ(reported(42), (Rows{{COMMAND_ACCEPTED, COMMAND_OK, 0}, {COMMAND_STARTED, COMMAND_OK, 3}, done}));
    EXPECT_EQ(get_file(ground_.store(), "a"), any_bytes(1, 100));
    EXPECT_EQ(get_file(ground_.store(), "empty"), Bytes{});
    EXPECT_EQ(state().delivered, 2u);
    EXPECT_EQ(reported(40).back()[0], COMMAND_UNDER_WAY);
}

TEST_F(FilesTest, commands_are_reported_where_numbers_of_transactions_need_more_than_32_bits)
{
    t_ = INT64_C(300'000'000) * s; // the first number is 16 times the seconds, and 1
    const int64_t first = INT64_C(4'800'000'001);
    run(1 * s);
    put_file(store(), "long", any_bytes(2, 20'000));
    for (int i = 0; i < 10; i++) { // more than there are places
        send(command(COMMAND_FILE_SEND, 2, "long", static_cast<uint16_t>(40 + i)));
        run(20 * s);
        const Rows rows = reported(40 + i);
        EXPECT_EQ(rows.front(), (std::vector<int>{COMMAND_ACCEPTED, COMMAND_OK, 0}));
        EXPECT_EQ(rows[1], (std::vector<int>{COMMAND_STARTED, COMMAND_OK, static_cast<int>((first + i) % 65536)}));
        EXPECT_EQ(rows[2][0], COMMAND_UNDER_WAY);
        EXPECT_EQ(rows.back(), (std::vector<int>{COMMAND_DONE, COMMAND_OK, 0}));
    }
    EXPECT_EQ(get_file(ground_.store(), "long"), any_bytes(2, 20'000));
    EXPECT_EQ(events_.back().id, FILES_SENT);
    EXPECT_EQ(events_.back().arguments[1], static_cast<double>(first + 9));
}

TEST_F(FilesTest, a_file_that_the_ground_has_in_part_has_failed)
{
    run(1 * s);
    put_file(store(), "a", any_bytes(1, 1000));
    loss_ = 1;
    send(command(COMMAND_FILE_SEND, 2, "a", 41));
    run(1 * s);
    CfdpPdu finished{};
    finished.kind = CFDP_FINISHED;
    finished.to_sender = finished.incomplete = 1;
    finished.source = 2;
    finished.sequence = static_cast<uint64_t>(reported(41)[1][2]);
    finished.destination = 1;
    finished.entity_bytes = finished.sequence_bytes = 1;
    Bytes bytes(64);
    bytes.resize(cfdp_pdu_write(&finished, bytes.data(), bytes.size()));
    up_.push_back(bytes);
    run(1 * s);
    EXPECT_EQ(reported(41).back(), (std::vector<int>{COMMAND_DONE, COMMAND_FAILED, 0}));
    EXPECT_EQ(state().delivered, 0u);
}

TEST_F(FilesTest, timers_handlers_and_segments_are_those_of_the_parameters)
{
    run(1 * s);
    put_file(store(), "log", any_bytes(3, 1000));
    loss_ = 1;
    auto &par = mission_->files.par;
    par.segment = 100;
    par.ack_limit = 2;
    par.handlers[CFDP_ACK_LIMIT] = CFDP_ABANDON;
    par.ack_timer = 1;
    send(command(COMMAND_FILE_SEND, 2, "log", 5));
    run(6 * s);
    EXPECT_EQ(reported(5).back(), (std::vector<int>{COMMAND_DONE, COMMAND_FAILED, CFDP_ACK_LIMIT}));
    EXPECT_EQ(count(FILES_FAILED), 1);
    EXPECT_EQ(sent_.size(), 1u + 10u + 2u) << "Metadata, data, EOF twice, and no word of the end";
    par.ack_timer = 1e9; // longer than a clock can say
    sent_.clear();
    send(command(COMMAND_FILE_SEND, 2, "log", 6));
    run(60 * s);
    EXPECT_EQ(sent_.size(), 1u + 10u + 1u);
    EXPECT_EQ(reported(6).back()[0], COMMAND_UNDER_WAY);
}

TEST_F(FilesTest, a_store_that_is_full_refuses_the_file_and_keeps_the_others)
{
    run(1 * s);
    put_file(store(), "kept", any_bytes(1, 200'000));
    const uint32_t used = (1u + 820u) * MEMORY_DATA;
    put_file(ground_.store(), "big", any_bytes(2, 60'000));
    ground_.put("big", "big");
    run(60 * s);
    EXPECT_EQ(ground_.ended(), CFDP_FILESTORE_REJECTION);
    EXPECT_EQ(get_file(store(), "big"), Bytes{0xEE});
    EXPECT_EQ(get_file(store(), "kept"), any_bytes(1, 200'000));
    run(1 * s);
    EXPECT_EQ(state().used, used);
    EXPECT_EQ(state().condition, static_cast<uint32_t>(CFDP_FILESTORE_REJECTION));
    put_file(store(), "rest", Bytes(static_cast<size_t>(state().free - MEMORY_DATA)));
    EXPECT_EQ(did(command(COMMAND_TABLE_DUMP, 0, "table")), COMMAND_FULL);
    EXPECT_EQ(did(command(COMMAND_FILE_REMOVE, 0, "rest")), COMMAND_OK);
    EXPECT_EQ(did(command(COMMAND_TABLE_DUMP, 0, "table")), COMMAND_OK);
}

TEST_F(FilesTest, names_and_arguments_that_are_wrong)
{
    run(1 * s);
    put_file(store(), "a", {1});
    const std::string longest(CFDP_NAME - 1, 'n'), longer = longest + "n";
    for (const std::string &name :
         {std::string(">b"), std::string("a>"), std::string("a>b>c"), longer, "a>" + longer, std::string("a\0", 2),
          std::string("a>b\0", 4), std::string(".cfdp0"), std::string(".cfdp-table>b")}) {
        EXPECT_EQ(did(command(COMMAND_FILE_SEND, 2, name)), COMMAND_VALUE) << name;
    }
    EXPECT_EQ(did(command(COMMAND_FILE_SEND, 2, "a>" + longest)), COMMAND_OK);
    EXPECT_EQ(did(command(COMMAND_FILE_SEND, 3, "a")), COMMAND_VALUE);
    EXPECT_EQ(did(command(COMMAND_FILE_SEND, 0, "a")), COMMAND_VALUE);
    EXPECT_EQ(did(command(COMMAND_FILE_SEND, 2, "")), COMMAND_LENGTH);
    EXPECT_EQ(did(command(COMMAND_FILE_SEND, 2, "none")), COMMAND_PLACE);
    EXPECT_EQ(did(command(COMMAND_FILE_SEND, 2, "../a")), COMMAND_VALUE);
    EXPECT_EQ(did(command(COMMAND_FILE_REMOVE, 1, "a")), COMMAND_VALUE);
    EXPECT_EQ(did(command(COMMAND_FILE_REMOVE, 0, "a>b")), COMMAND_VALUE);
    EXPECT_EQ(did(command(COMMAND_FILE_REMOVE, 0, "none")), COMMAND_PLACE);
    EXPECT_EQ(did(control(static_cast<FileAction>(3), 1, 1)), COMMAND_VALUE);
    EXPECT_EQ(did(control(FILE_SUSPEND, 2, 1)), COMMAND_VALUE);
    EXPECT_EQ(did(command(COMMAND_TABLE_LOAD, 0, "a>b")), COMMAND_VALUE);
    EXPECT_EQ(did(command(COMMAND_TABLE_LOAD, 1, "a")), COMMAND_PLACE);
    EXPECT_EQ(did(command(COMMAND_TABLE_DUMP, 1, "a")), COMMAND_PLACE);
    // The ground's own names.
    put_file(ground_.store(), "up", {1, 2});
    ground_.put("up", "../up");
    run(10 * s);
    EXPECT_EQ(ground_.ended(), CFDP_FILESTORE_REJECTION);
    // More at once than there is room for.
    put_file(store(), "long", any_bytes(8, 20'000));
    for (int i = 0; i < FILES_TRANSACTIONS; i++) {
        EXPECT_EQ(did(command(COMMAND_FILE_SEND, 2, "long")), COMMAND_OK);
    }
    EXPECT_EQ(did(command(COMMAND_FILE_SEND, 2, "long")), COMMAND_FULL);
}

TEST_F(FilesTest, what_comes_beyond_the_room_or_damaged_is_counted)
{
    run(1 * s);
    const Bytes garbage(520, 0xFF);
    for (int i = 0; i < 20; i++) {
        ASSERT_EQ(send(packet(COMMAND_PDU, garbage)), COMMAND_OK);
    }
    run(2 * s);
    const uint32_t room = FILES_INPUT / 522;
    EXPECT_EQ(state().refused, room);
    EXPECT_EQ(state().lost, 20u - room);
    EXPECT_EQ(count(FILES_LOST), 1);
    EXPECT_EQ(events_.back().arguments[0], 20.0 - room);
    EXPECT_TRUE(reports_.empty()); // PDUs are not reported
    put_file(ground_.store(), "up", any_bytes(9, 4000));
    ground_.put("up", "up");
    run(10 * s);
    EXPECT_EQ(get_file(store(), "up"), any_bytes(9, 4000));
}

TEST_F(FilesTest, a_reset_of_flight_leaves_transactions_and_files)
{
    loss_ = 0.05;
    put_file(ground_.store(), "up", any_bytes(1, 20'000));
    ground_.put("up", "up");
    run(1 * s);
    put_file(store(), "down", any_bytes(2, 20'000));
    send(command(COMMAND_FILE_SEND, 2, "down", 31));
    run(3 * s);
    EXPECT_EQ(did(packet(COMMAND_RESET_FLIGHT, big(0x1234, 2))), COMMAND_OK);
    updated_ = -1;
    run(120 * s);
    EXPECT_EQ(get_file(store(), "up"), any_bytes(1, 20'000));
    EXPECT_EQ(get_file(ground_.store(), "down"), any_bytes(2, 20'000));
    EXPECT_EQ(reported(31).back(), (std::vector<int>{COMMAND_DONE, COMMAND_OK, 0}));
}

TEST_F(FilesTest, after_a_reset_of_the_computer_numbers_go_on_and_the_ground_is_informed)
{
    loss_ = 0;
    put_file(ground_.store(), "up", any_bytes(1, 60'000));
    ground_.put("up", "up");
    run(1 * s);
    put_file(store(), "down", any_bytes(2, 20'000));
    send(command(COMMAND_FILE_SEND, 2, "down", 31));
    run(2 * s);
    const uint32_t before = static_cast<uint32_t>(reported(31)[1][2]);
    std::memset(&mission_->files.mem, 0, sizeof mission_->files.mem);
    files_reset(&mission_->files);
    command_begin(&state_);
    run(60 * s);
    EXPECT_EQ(get_file(store(), "up"), any_bytes(1, 60'000)); // its Metadata came again
    put_file(store(), "down", any_bytes(3, 500));
    send(command(COMMAND_FILE_SEND, 2, "down", 32));
    run(10 * s);
    EXPECT_GT(static_cast<uint32_t>(reported(32)[1][2]), before);
    EXPECT_EQ(get_file(ground_.store(), "down"), any_bytes(3, 500));
}

TEST_F(FilesTest, a_recorder_keeps_files_over_a_reset_of_the_computer)
{
    mission_->files.par.kept = 1;
    recorder_.assign(60, Bytes(RECORDER_PAGE));
    put_file(ground_.store(), "up", any_bytes(1, 5000));
    put_file(ground_.store(), "next", any_bytes(2, 5000));
    ground_.put("up", "up");
    run(10 * s);
    EXPECT_NE(did(command(COMMAND_TABLE_DUMP, 0, "table")), COMMAND_OK); // the pages are not back yet
    EXPECT_GT(state().waiting, 30u);
    run(60 * s);
    EXPECT_EQ(get_file(store(), "up"), any_bytes(1, 5000));
    EXPECT_EQ(state().waiting, 0u);

    ground_.put("next", "next");
    run(300 * ms);
    loss_ = 1;
    run(3 * s);
    EXPECT_EQ(state().receiving, 1u);
    loss_ = 0;
    std::memset(&mission_->files.mem, 0, sizeof mission_->files.mem);
    files_reset(&mission_->files);
    command_begin(&state_);
    run(120 * s);
    EXPECT_EQ(get_file(store(), "up"), any_bytes(1, 5000));
    EXPECT_EQ(get_file(store(), "next"), any_bytes(2, 5000)) << "it was on its way";
    EXPECT_EQ(ground_.ended(), 0);
    EXPECT_EQ(state().used, 2u * (1u + 21u) * MEMORY_DATA);
    EXPECT_EQ(state().used + state().free, 60u * MEMORY_DATA);
    EXPECT_EQ(state().waiting + state().failed, 0u);
}

TEST_F(FilesTest, a_copy_of_the_memory_goes_on_alike)
{
    put_file(ground_.store(), "up", any_bytes(1, 20'000));
    ground_.put("up", "up");
    run(1 * s);
    put_file(store(), "down", any_bytes(2, 20'000));
    send(command(COMMAND_FILE_SEND, 2, "down"));
    run(2 * s);
    const Mission copied = *mission_;
    // With the same PDUs, whatever the ground does.
    const auto flies_on = [&] {
        sent_.clear();
        std::mt19937 random(3);
        for (int i = 0; i < 100; i++) {
            t_ += 500 * ms;
            Bytes pdu = any_bytes(random(), 40);
            send(packet(COMMAND_PDU, pdu));
            command_execute(&state_, &table, mission_.get(), t_, note, this);
            files_update(&mission_->files, {t_, 500 * ms});
            const CommandContext context = {&state_, &table, mission_.get(), t_, 0};
            telemetry_services(&telemetry, &context, note, take, this);
        }
        return sent_;
    };
    const int64_t t = t_;
    const std::vector<Bytes> first = flies_on();
    const Mission end = *mission_;
    *mission_ = copied;
    t_ = t;
    EXPECT_EQ(flies_on(), first);
    EXPECT_GT(first.size(), 20u);
    EXPECT_EQ(std::memcmp(&end, mission_.get(), sizeof end), 0);
}

/// The file of a table.
Bytes table_of(const Gains &gains, uint16_t version = 0x1234, uint16_t module = 0)
{
    Bytes block;
    for (const double gain : gains.K) {
        uint64_t bits;
        std::memcpy(&bits, &gain, sizeof bits);
        block = block + big(bits, 8);
    }
    block = block + big(gains.n, 4) + big(gains.spare, 4);
    return big(0x464C5442, 4) + big(version, 2) + big(module, 2) + big(block.size(), 4) +
           big(command_crc(block.data(), static_cast<uint32_t>(block.size())), 2) + big(0, 2) + block;
}

TEST_F(FilesTest, a_table_counts_whole_or_not_at_all)
{
    run(1 * s);
    Gains next = mission_->gains;
    next.K[0] = 5;
    next.K[99] = 7;
    next.n = 3;
    const auto load = [&](const Bytes &file) {
        put_file(ground_.store(), "t", file);
        ground_.put("t", "tables");
        run(10 * s);
        const Gains before = mission_->gains;
        const CommandReason reason = did(command(COMMAND_TABLE_LOAD, 0, "tables"));
        EXPECT_TRUE(reason == COMMAND_OK || std::memcmp(&before, &mission_->gains, sizeof before) == 0);
        return reason;
    };
    EXPECT_EQ(did(command(COMMAND_TABLE_LOAD, 0, "tables")), COMMAND_PLACE); // there is none yet
    const Bytes good = table_of(next);
    EXPECT_EQ(load(table_of(next, 0x1235)), COMMAND_VERSION);
    EXPECT_EQ(load(table_of(next, 0x1234, 1)), COMMAND_PLACE);
    EXPECT_EQ(load(Bytes(good.begin(), good.end() - 1)), COMMAND_LENGTH);
    EXPECT_EQ(load(good + Bytes{0}), COMMAND_LENGTH);
    for (const auto &[at, reason] : std::map<size_t, CommandReason>{
             {0, COMMAND_VALUE}, {9, COMMAND_LENGTH}, {13, COMMAND_CRC}, {20, COMMAND_CRC}}) {
        Bytes bad = good;
        bad[at] ^= 1;
        EXPECT_EQ(load(bad), reason) << at;
    }
    Gains wrong = next;
    wrong.K[98] = -1;
    EXPECT_EQ(load(table_of(wrong)), COMMAND_RULE);
    EXPECT_EQ(detail_, 0);
    EXPECT_EQ(mission_->published, 0);
    EXPECT_EQ(load(good), COMMAND_OK);
    EXPECT_EQ(std::memcmp(&next, &mission_->gains, sizeof next), 0);
    EXPECT_EQ(mission_->published, 1);
    EXPECT_EQ(count(FILES_LOADED), 1);

    EXPECT_EQ(did(command(COMMAND_TABLE_DUMP, 0, "down")), COMMAND_OK);
    EXPECT_EQ(get_file(store(), "down"), good);
    EXPECT_EQ(did(command(COMMAND_TABLE_DUMP, 0, "no/folder")), COMMAND_PLACE);
    EXPECT_EQ(get_file(store(), ".cfdp-table"), Bytes{0xEE});
    EXPECT_EQ(did(packet(COMMAND_CHECK, big(0x1234, 2) + big(0, 2))), COMMAND_OK);
    EXPECT_EQ(data_, Bytes(good.begin() + 8, good.begin() + 14)); // size and CRC
    EXPECT_EQ(did(packet(COMMAND_CHECK, big(0x1234, 2) + big(1, 2))), COMMAND_PLACE);
}

TEST_F(FilesTest, tables_of_the_start_count_after_a_reset_of_the_computer)
{
    const Gains built = mission_->gains;
    Gains first = built, second = built, wrong = built;
    first.n = 1;
    second.n = 2;
    wrong.K[7] = -1;
    mission_->files.par.kept = mission_->files.par.boot = 1;
    recorder_.assign(120, Bytes(RECORDER_PAGE));
    run(70 * s);
    EXPECT_EQ(state().booted, 1u);
    EXPECT_EQ(state().tables, 0u);
    const std::map<std::string, Bytes> up = {{"boot/c", table_of(first)},
                                             {"boot/b", table_of(second)},
                                             {"boot/a", table_of(wrong)},
                                             {"boot/d", any_bytes(1, 100)},
                                             {"boot/e", table_of(second, 0x1233)},
                                             {"boot/f", table_of(second, 0x1234, 1)},
                                             {"boot/g", {}},
                                             {"boots", table_of(second)}};
    for (const auto &[name, bytes] : up) {
        put_file(ground_.store(), "up", bytes);
        ground_.put("up", name);
        run(10 * s);
        EXPECT_EQ(get_file(store(), name), bytes) << name;
    }
    run(30 * s);
    EXPECT_EQ(state().waiting, 0u);
    EXPECT_EQ(std::memcmp(&mission_->gains, &built, sizeof built), 0);

    const size_t before = events_.size();
    std::memset(&mission_->files.mem, 0, sizeof mission_->files.mem);
    files_reset(&mission_->files);
    command_begin(&state_);
    counted_ = 0;
    run(55 * s); // the pages are not back yet
    EXPECT_EQ(state().booted, 0u);
    EXPECT_EQ(mission_->gains.n, 0u);
    run(10 * s);
    EXPECT_EQ(state().booted, 1u);
    EXPECT_EQ(state().tables, 2u);
    EXPECT_EQ(mission_->gains.n, 1u) << "b, then c";
    EXPECT_EQ(mission_->published, 2);
    std::vector<std::vector<double>> count;
    for (size_t i = before; i < events_.size(); i++) {
        count.emplace_back(events_[i].arguments, events_[i].arguments + 4);
        count.back().insert(count.back().begin(), events_[i].id);
    }
    const double loaded = FILES_LOADED, refused = FILES_REFUSED, none = COMMAND_ALL;
    EXPECT_EQ(count, (std::vector<std::vector<double>>{{refused, 0, COMMAND_RULE, 0, 0},
                                                       {loaded, 0, sizeof(Gains), 0, 0},
                                                       {loaded, 0, sizeof(Gains), 0, 0},
                                                       {refused, 3, COMMAND_VALUE, none, 0},
                                                       {refused, 4, COMMAND_VERSION, 0, 0},
                                                       {refused, 5, COMMAND_PLACE, 1, 0},
                                                       {refused, 6, COMMAND_VALUE, none, 0}}));

    mission_->gains.n = 9; // a reset of flight keeps parameters, so nothing is loaded again
    files_reset(&mission_->files);
    run(2 * s);
    EXPECT_EQ(mission_->gains.n, 9u);
    EXPECT_EQ(state().tables, 2u);
}

TEST_F(FilesTest, tables_of_the_start_in_a_store_of_the_host)
{
    std::vector<uint64_t> memory(MEMORY_STORE_BYTES(64) / 8);
    auto *other = reinterpret_cast<MemoryStore *>(memory.data());
    memory_store_begin(other, memory.size() * 8);
    memory_store_mount(other);
    const CfdpStore host = memory_store_files(other);
    services.store = &host;
    Gains next = mission_->gains;
    next.n = 5;
    EXPECT_EQ(host.make_directory(host.user, "boot"), 0);
    const std::string longest(CFDP_NAME - 6, 'n');
    EXPECT_EQ(put_file(host, "boot/" + longest, table_of(next)), 0);
    EXPECT_EQ(host.make_directory(host.user, "boot/folder"), 0);
    run(1 * s);
    EXPECT_EQ(mission_->gains.n, 0u) << "without the parameter";
    mission_->files.par.boot = 1;
    run(1 * s);
    EXPECT_EQ(mission_->gains.n, 5u);
    EXPECT_EQ(state().booted, 1u);
    EXPECT_EQ(state().tables, 1u);
    EXPECT_EQ(count(FILES_REFUSED), 0) << "a folder is no table";
    services.store = nullptr;
}

/// The host's store, which breaks after some calls and lists what a test wants.
struct Broken {
    std::vector<uint64_t> memory = std::vector<uint64_t>(MEMORY_STORE_BYTES(64) / 8);
    static inline int reads, writes;
    static inline std::vector<std::string> names;
    CfdpStore files;

    Broken()
    {
        auto *own = reinterpret_cast<MemoryStore *>(memory.data());
        memory_store_begin(own, memory.size() * 8);
        memory_store_mount(own);
        files = memory_store_files(own);
        reads = writes = 1000;
        files.read = [](void *user, int file, uint64_t offset, uint8_t *bytes, size_t n) -> int {
            const CfdpStore good = memory_store_files(static_cast<MemoryStore *>(user));
            return reads-- > 0 ? good.read(user, file, offset, bytes, n) : CFDP_BROKEN;
        };
        files.write = [](void *user, int file, uint64_t offset, const uint8_t *bytes, size_t n) -> int {
            const CfdpStore good = memory_store_files(static_cast<MemoryStore *>(user));
            return writes-- > 0 ? good.write(user, file, offset, bytes, n) : CFDP_BROKEN;
        };
        files.list = [](void *, const char *, CfdpEach each, void *to) -> int {
            for (const std::string &name : names) {
                each(to, name.c_str());
            }
            return 0;
        };
        services.store = &files;
    }
    ~Broken() { services.store = nullptr; }
    Broken(const Broken &) = delete;
};

TEST_F(FilesTest, tables_in_a_store_that_breaks)
{
    Broken host;
    Gains next = mission_->gains;
    next.n = 5;
    put_file(host.files, "t", table_of(next));
    run(1 * s);
    for (const int works : {0, 1}) {
        Broken::reads = works;
        EXPECT_EQ(did(command(COMMAND_TABLE_LOAD, 0, "t")), COMMAND_FAILED);
        EXPECT_EQ(mission_->gains.n, 0u);
        Broken::writes = works;
        EXPECT_EQ(did(command(COMMAND_TABLE_DUMP, 0, "down")), COMMAND_FAILED);
        for (const char *name : {"down", ".cfdp-table"}) {
            EXPECT_EQ(get_file(host.files, name), Bytes{0xEE});
        }
    }
    Broken::reads = 1000;
    EXPECT_EQ(did(command(COMMAND_TABLE_LOAD, 0, "t")), COMMAND_OK);
    EXPECT_EQ(mission_->gains.n, 5u);
}

TEST_F(FilesTest, tables_of_the_start_have_an_order_whatever_that_of_the_list)
{
    Broken host;
    Gains next = mission_->gains;
    host.files.make_directory(host.files.user, "boot");
    for (const char *name : {"boot/a", "boot/b"}) {
        next.n++;
        put_file(host.files, name, table_of(next));
    }
    Broken::names = {"", std::string(CFDP_NAME + 1, 'n'), std::string(CFDP_NAME - 5, 'n'), "folder/", "b", "a"};
    mission_->files.par.boot = 1;
    EXPECT_EQ(files_service.next(&mission_->files), 0);
    run(100 * ms);
    EXPECT_EQ(mission_->gains.n, 1u);
    run(1 * s);
    EXPECT_EQ(mission_->gains.n, 2u);
    EXPECT_EQ(state().tables, 2u);
    EXPECT_EQ(count(FILES_REFUSED), 0);
    EXPECT_EQ(files_service.next(&mission_->files), INT64_MAX);
    mission_->files.par.boot = 0;
    EXPECT_EQ(files_service.next(&mission_->files), INT64_MAX);
}

TEST_F(FilesTest, what_a_recorder_keeps_is_its_own_store_even_with_one_of_the_host)
{
    Broken host;
    put_file(host.files, "a", {1});
    mission_->files.par.kept = 1;
    recorder_.assign(60, Bytes(RECORDER_PAGE));
    run(70 * s);
    EXPECT_EQ(did(command(COMMAND_FILE_SEND, 2, "a")), COMMAND_PLACE);
    put_file(ground_.store(), "up", {1, 2});
    ground_.put("up", "up");
    run(10 * s);
    EXPECT_EQ(get_file(store(), "up"), (Bytes{1, 2}));
    EXPECT_EQ(get_file(host.files, "up"), Bytes{0xEE});
}

TEST_F(FilesTest, a_store_of_the_host_takes_the_place_of_its_own)
{
    std::vector<uint64_t> memory(MEMORY_STORE_BYTES(64) / 8);
    auto *other = reinterpret_cast<MemoryStore *>(memory.data());
    memory_store_begin(other, memory.size() * 8);
    memory_store_mount(other);
    const CfdpStore host = memory_store_files(other);
    services.store = &host;
    put_file(ground_.store(), "up", any_bytes(1, 2000));
    ground_.put("up", "up");
    run(10 * s);
    EXPECT_EQ(get_file(host, "up"), any_bytes(1, 2000));
    EXPECT_EQ(state().used, 0u);
    services.store = nullptr;
}

} // namespace files_test
