// SPDX-License-Identifier: Apache-2.0
// Entities of CFDP at both ends of a link that loses, repeats, reorders and delays, in simulated time: the series F1 to
// F3 of the standard's test plan, defects that others have had, outages, resets, and peers that misbehave.
#include "ccsds/cfdp.h"
#include "ccsds/store/posix_store.h"
#include "ccsds/testing/bits.h"
#include "ccsds/testing/folder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <set>
#include <string>
#include <vector>

namespace cfdp_test {

using namespace ccsds::testing;
using Clock = std::int64_t; // [ns]

constexpr Clock ms = 1'000'000, s = 1000 * ms;

/// Files in memory.
struct Memory {
    std::map<std::string, Bytes> files{};
    std::set<std::string> directories{};
    std::map<int, std::string> opened{};
    std::size_t capacity = SIZE_MAX; // [bytes] of all files
    int next = 0;
    std::set<std::string> shown{}; // every name that a finished file ever had

    static Memory &of(void *user) { return *static_cast<Memory *>(user); }
    std::size_t used() const
    {
        std::size_t n = 0;
        for (const auto &[name, bytes] : files) {
            n += bytes.size();
        }
        return n;
    }
    bool has(const std::string &name) const { return files.count(name) != 0; }

    CfdpStore store()
    {
        CfdpStore made{};
        made.user = this;
        made.open = [](void *user, const char *name, CfdpOpen how) -> int {
            Memory &self = of(user);
            const std::string file = name;
            if (file.find("..") != std::string::npos || file[0] == '/' || self.directories.count(file) != 0) {
                return CFDP_REFUSED;
            }
            if (how == CFDP_OPEN_NEW) {
                self.files[file].clear();
            } else if (!self.has(file)) {
                return CFDP_ABSENT;
            }
            self.opened[self.next] = file;
            return self.next++;
        };
        made.close = [](void *user, int file) { EXPECT_EQ(of(user).opened.erase(file), 1u); };
        made.size = [](void *user, int file) -> std::int64_t {
            return static_cast<std::int64_t>(of(user).files[of(user).opened.at(file)].size());
        };
        made.read = [](void *user, int file, std::uint64_t offset, std::uint8_t *bytes, std::size_t n) -> int {
            const Bytes &all = of(user).files[of(user).opened.at(file)];
            if (offset + n > all.size()) {
                return CFDP_BROKEN;
            }
            std::copy_n(all.data() + offset, n, bytes);
            return 0;
        };
        made.write = [](void *user, int file, std::uint64_t offset, const std::uint8_t *bytes, std::size_t n) -> int {
            Bytes &all = of(user).files[of(user).opened.at(file)];
            const std::size_t end = std::max<std::size_t>(all.size(), offset + n);
            if (end > (1u << 28) || of(user).used() - all.size() + end > of(user).capacity) {
                return CFDP_FULL;
            }
            all.resize(end);
            std::copy_n(bytes, n, all.data() + offset);
            return 0;
        };
        made.rename = [](void *user, const char *from, const char *to) -> int {
            Memory &self = of(user);
            for (const auto &[handle, name] : self.opened) {
                EXPECT_NE(name, from) << "a file is renamed while it is open";
            }
            if (!self.has(from) || *to == '/' || std::string(to).find("..") != std::string::npos) {
                return CFDP_REFUSED;
            }
            Bytes bytes = std::move(self.files[from]);
            self.files.erase(from);
            self.files[to] = std::move(bytes);
            self.shown.insert(to);
            return 0;
        };
        made.remove = [](void *user, const char *name) -> int {
            return of(user).files.erase(name) != 0 ? 0 : CFDP_ABSENT;
        };
        made.make_directory = [](void *user, const char *name) -> int {
            return of(user).directories.insert(name).second ? 0 : CFDP_REFUSED;
        };
        made.remove_directory = [](void *user, const char *name) -> int {
            return of(user).directories.erase(name) != 0 ? 0 : CFDP_ABSENT;
        };
        made.list = [](void *user, const char *directory, CfdpEach each, void *to) -> int {
            if (*directory != '\0' && of(user).directories.count(directory) == 0) {
                return CFDP_ABSENT;
            }
            const std::map<std::string, Bytes> stored = of(user).files; // which its taker may change
            for (const auto &[name, bytes] : stored) {
                if (name[0] != '.' && each(to, name.c_str()) < 0) {
                    return CFDP_BROKEN;
                }
            }
            return 0;
        };
        return made;
    }
};

struct Told {
    CfdpTold what;
    CfdpId id;
    int receiver, condition, incomplete, file_status;
    std::uint64_t progress, size;
    std::string to;
    Bytes text;
};

/// An entity with its memory, a store and what it tells.
struct End {
    Memory memory{};
    CfdpRemote remote{};
    std::vector<CfdpTransaction> transactions;
    std::vector<CfdpRange> ranges;
    std::vector<CfdpPast> past = std::vector<CfdpPast>(100);
    Bytes work = Bytes(4096);
    std::vector<Told> told{};
    std::function<void(const CfdpEvent &)> on_event{};
    CfdpStore store{};
    Cfdp cfdp{};
    std::uint64_t entity;

    End(std::uint64_t own, std::uint64_t other, std::uint32_t places = 8, std::uint32_t gaps = 64)
        : transactions(places), ranges(places * gaps), entity(own)
    {
        remote.entity = other;
        remote.ack_timer = remote.nak_timer = 2 * s;
        remote.inactivity = 60 * s;
        remote.check_timer = 2 * s;
        remote.segment = 1000;
        remote.ack_limit = remote.nak_limit = 5;
        remote.check_limit = 3;
        remote.allowed = CFDP_ALLOW_FILESTORE | CFDP_ALLOW_PROXY | CFDP_ALLOW_LIST | CFDP_ALLOW_REMOTE;
        store = memory.store();
        begin(1);
    }
    End(const End &) = delete;

    void begin(std::uint64_t sequence)
    {
        CfdpSetup setup{};
        setup.entity = entity;
        setup.store = store;
        setup.tell = [](void *user, const CfdpEvent *event) {
            End &self = *static_cast<End *>(user);
            self.told.push_back({event->what, event->id, event->receiver, event->condition, event->incomplete,
                                 event->file_status, event->progress, event->size, event->to,
                                 Bytes(event->text.bytes, event->text.bytes + event->text.n)});
            if (self.on_event) {
                self.on_event(*event);
            }
        };
        setup.user = this;
        setup.remotes = &remote;
        setup.remotes_n = 1;
        setup.transactions = transactions.data();
        setup.transactions_n = static_cast<std::uint32_t>(transactions.size());
        setup.ranges = ranges.data();
        setup.ranges_n = static_cast<std::uint32_t>(ranges.size() / transactions.size());
        setup.past = past.data();
        setup.past_n = static_cast<std::uint32_t>(past.size());
        setup.work = work.data();
        setup.work_n = static_cast<std::uint32_t>(work.size());
        setup.entity_bytes = 2;
        setup.sequence_bytes = 4;
        cfdp_begin(&cfdp, &setup, sequence);
    }

    CfdpId put(const std::string &from, const std::string &to, int class1 = 0, const Bytes &options = {},
               std::uint8_t priority = 0, int closure = 0)
    {
        CfdpPut one{};
        one.destination = remote.entity;
        one.from = from.c_str();
        one.to = to.c_str();
        one.options = options.data();
        one.options_n = options.size();
        one.class1 = static_cast<std::uint8_t>(class1);
        one.closure = static_cast<std::uint8_t>(closure);
        one.priority = priority;
        CfdpId id{};
        EXPECT_EQ(cfdp_put(&cfdp, &one, &id), 0);
        return id;
    }
    bool busy() const
    {
        return cfdp.live.answers_n != 0 || std::any_of(transactions.begin(), transactions.end(),
                                                       [](const auto &one) { return one.state != CFDP_FREE; });
    }
    /// How the last transaction ended; nothing, if none did.
    std::optional<Told> ended() const
    {
        for (auto one = told.rbegin(); one != told.rend(); one++) {
            if (one->what == CFDP_TOLD_ENDED || one->what == CFDP_TOLD_ABANDONED) {
                return *one;
            }
        }
        return std::nullopt;
    }
    std::ptrdiff_t count(CfdpTold what, int condition = -1) const
    {
        return std::count_if(told.begin(), told.end(), [&](const Told &one) {
            return one.what == what && (condition < 0 || one.condition == condition);
        });
    }
};

/// Ground (1) and craft (2), and the link: one PDU each way at each tick.
struct Link {
    End ground, craft;
    Clock now = 0, tick = ms, delay = 100 * ms;
    std::mt19937 random;
    double loss = 0, twice = 0, late = 0;
    std::function<bool(const CfdpPdu &, bool up)> drops{}; // what the link loses on purpose
    struct Flying {
        Clock at;
        bool up;
        Bytes bytes;
    };
    std::multimap<Clock, Flying> flying{};
    std::map<int, int> sent{}; // by kind, both ways
    Bytes pdu = Bytes(70000);

    explicit Link(std::uint32_t seed = 1, std::uint32_t places = 8, std::uint32_t gaps = 64)
        : ground(1, 2, places, gaps), craft(2, 1, places, gaps), random(seed)
    {
    }

    bool chance(double of) { return of > 0 && static_cast<double>(random()) < of * 4294967296.0; }

    void send(End &end, bool up)
    {
        const std::size_t n = cfdp_next(&end.cfdp, nullptr, pdu.data(), pdu.size());
        if (n == 0) {
            return;
        }
        CfdpPdu read{};
        ASSERT_EQ(cfdp_pdu_read(&read, pdu.data(), n), CCSDS_OK);
        sent[read.kind]++;
        if ((drops && drops(read, up)) || chance(loss)) {
            return;
        }
        const Bytes bytes(pdu.begin(), pdu.begin() + static_cast<std::ptrdiff_t>(n));
        for (int copies = chance(twice) ? 2 : 1; copies-- > 0;) {
            const Clock at = now + delay + (chance(late) ? random() % 300 * ms : 0);
            flying.insert({at, {at, up, bytes}});
        }
    }

    void step()
    {
        now += tick;
        cfdp_time(&ground.cfdp, now);
        cfdp_time(&craft.cfdp, now);
        while (!flying.empty() && flying.begin()->first <= now) {
            const Flying one = std::move(flying.begin()->second);
            flying.erase(flying.begin());
            cfdp_take(&(one.up ? craft : ground).cfdp, one.bytes.data(), one.bytes.size());
        }
        send(ground, true);
        send(craft, false);
    }

    void run(Clock time)
    {
        for (const Clock stop = now + time; now < stop;) {
            step();
        }
    }
    /// Until no transaction is left. Fails after a time.
    void finish(Clock most = 600 * s)
    {
        const Clock stop = now + most;
        while (ground.busy() || craft.busy() || !flying.empty()) {
            ASSERT_LT(now, stop) << "a transaction hangs";
            step();
        }
        EXPECT_TRUE(ground.memory.opened.empty() && craft.memory.opened.empty());
        for (const End *end : {&ground, &craft}) {
            for (const auto &[name, bytes] : end->memory.files) {
                EXPECT_NE(name[0], '.') << name << " is left";
            }
        }
    }

    Bytes file(std::size_t n) { return ground.memory.files["source"] = any_bytes(random, n); }
    /// The file arrived, and both ends know.
    void expect_whole(const std::string &name = "target", const std::string &source = "source")
    {
        ASSERT_TRUE(craft.memory.has(name));
        EXPECT_EQ(craft.memory.files[name], ground.memory.files[source]);
        for (const End *end : {&ground, &craft}) {
            ASSERT_TRUE(end->ended().has_value());
            EXPECT_EQ(end->ended()->condition, CFDP_NO_ERROR);
            EXPECT_EQ(end->ended()->incomplete, 0);
        }
        EXPECT_EQ(craft.ended()->file_status, CFDP_RETAINED);
    }
    void expect_none(int condition)
    {
        EXPECT_FALSE(craft.memory.has("target"));
        EXPECT_EQ(craft.memory.shown.count("target"), 0u);
        for (const End *end : {&ground, &craft}) {
            if (end->ended().has_value()) {
                EXPECT_EQ(end->ended()->condition, condition) << (end == &ground ? "ground" : "craft");
            }
        }
    }
};

/// Loses the n-th PDU (from 1) of a kind.
std::function<bool(const CfdpPdu &, bool)> lose(int kind, int nth = 1, int acknowledged = 0)
{
    auto count = std::make_shared<int>(0);
    return [=](const CfdpPdu &pdu, bool) {
        return pdu.kind == kind && (acknowledged == 0 || pdu.acknowledged == acknowledged) && ++*count == nth;
    };
}

// ---- F1: files

TEST(CfdpF1, small_file_class_1)
{
    Link link;
    link.file(500);
    link.ground.put("source", "target", 1);
    link.finish();
    link.expect_whole();
    EXPECT_EQ(link.sent, (std::map<int, int>{{CFDP_METADATA, 1}, {CFDP_FILE_DATA, 1}, {CFDP_EOF, 1}}));
}

TEST(CfdpF1, many_pdus_in_each_class_checksum_and_id)
{
    for (const int class1 : {0, 1}) {
        for (const int closure : {0, 1}) {
            for (const std::uint8_t checksum : {CFDP_MODULAR, CFDP_CRC32, CFDP_NULL_CHECKSUM}) {
                for (const std::uint8_t crc : {0, 1}) {
                    Link link;
                    link.ground.remote.checksum = checksum;
                    link.ground.remote.crc = crc;
                    link.ground.cfdp.set.entity_bytes = static_cast<std::uint8_t>(1 + 7 * crc);
                    link.ground.cfdp.set.sequence_bytes = static_cast<std::uint8_t>(8 - 7 * crc);
                    link.drops = [=](const CfdpPdu &pdu, bool) {
                        EXPECT_EQ(pdu.crc, crc); // both ways
                        return false;
                    };
                    link.file(54321);
                    link.ground.put("source", "target", class1, {}, 0, closure);
                    link.finish();
                    link.expect_whole();
                    EXPECT_EQ(link.sent[CFDP_FILE_DATA], 55);
                    EXPECT_EQ(link.sent[CFDP_FINISHED], class1 == 0 || closure != 0);
                    EXPECT_EQ(link.sent[CFDP_ACK], class1 == 0 ? 2 : 0);
                    EXPECT_EQ(link.sent[CFDP_NAK], 0);
                    if (class1 == 0 || closure != 0) { // the sender knows
                        EXPECT_EQ(link.ground.ended()->file_status, CFDP_RETAINED);
                    }
                }
            }
        }
    }
}

TEST(CfdpF1, the_other_way)
{
    Link link;
    link.craft.memory.files["science"] = any_bytes(link.random, 9999);
    link.craft.put("science", "down/science");
    link.finish();
    EXPECT_EQ(link.ground.memory.files["down/science"], link.craft.memory.files["science"]);
}

TEST(CfdpF1, an_empty_file_and_no_file)
{
    for (const int class1 : {0, 1}) {
        Link link;
        link.file(0);
        link.ground.put("source", "target", class1);
        link.finish();
        link.expect_whole();
        const Bytes message{CFDP_TLV_MESSAGE, 2, 'h', 'i'};
        link.ground.put("", "", class1, message);
        link.finish();
        EXPECT_EQ(link.craft.told[link.craft.told.size() - 2].text, (Bytes{'h', 'i'}));
        EXPECT_EQ(link.craft.ended()->file_status, CFDP_UNREPORTED);
        EXPECT_EQ(link.craft.memory.files.size(), 1u);
    }
}

TEST(CfdpF1, metadata_alone_whose_sender_gives_no_eof)
{
    Link link;
    link.drops = [](const CfdpPdu &pdu, bool up) { return up && pdu.kind == CFDP_EOF; };
    link.ground.put("", "", 1, Bytes{CFDP_TLV_MESSAGE, 2, 'h', 'i'});
    link.finish();
    EXPECT_EQ(link.craft.told[link.craft.told.size() - 2].text, (Bytes{'h', 'i'}));
    EXPECT_EQ(link.craft.ended()->condition, CFDP_NO_ERROR);
    EXPECT_FALSE(link.craft.ended()->incomplete);
}

TEST(CfdpF1, a_link_that_loses_repeats_reorders_and_delays)
{
    for (const bool immediate : {false, true}) {
        for (std::uint32_t seed = 1; seed <= 20; seed++) {
            SCOPED_TRACE(seed);
            Link link(seed, 8, 2 + seed % 7 * 10);
            link.craft.remote.immediate = immediate;
            link.loss = seed % 3 == 0 ? 0.3 : 0.05;
            link.twice = 0.1;
            link.late = 0.2;
            link.ground.remote.ack_limit = link.craft.remote.ack_limit = link.craft.remote.nak_limit = 30;
            link.ground.remote.checksum = seed % 2 != 0 ? CFDP_CRC32 : CFDP_MODULAR;
            link.file(100000 + seed);
            link.ground.put("source", "target");
            link.finish();
            link.expect_whole();
        }
    }
}

TEST(CfdpF1, class_1_loses_and_says_so)
{
    Link link;
    link.file(10000);
    link.drops = lose(CFDP_FILE_DATA, 3);
    link.ground.put("source", "target", 1, {}, 0, 1);
    link.finish();
    link.expect_none(CFDP_CHECK_LIMIT);
    EXPECT_EQ(link.ground.ended()->incomplete, 1);
    EXPECT_EQ(link.sent[CFDP_FINISHED], 1);

    link.drops = lose(CFDP_FILE_DATA, 3); // without closure, the sender does not hear of it
    link.ground.put("source", "target", 1);
    link.finish();
    EXPECT_EQ(link.craft.ended()->condition, CFDP_CHECK_LIMIT);
    EXPECT_EQ(link.ground.ended()->condition, CFDP_NO_ERROR);
    EXPECT_FALSE(link.craft.memory.has("target"));
    EXPECT_EQ(link.sent[CFDP_FINISHED], 1);
}

TEST(CfdpF1, class_1_waits_for_data_behind_its_eof)
{
    Link link;
    link.late = 0.5;
    link.file(20000);
    link.ground.put("source", "target", 1);
    link.finish();
    link.expect_whole();
}

TEST(CfdpF1, cancel_at_either_end)
{
    for (const int class1 : {0, 1}) {
        for (const bool by_sender : {true, false}) {
            for (const Clock after : {0 * ms, 30 * ms, 150 * ms}) {
                Link link;
                link.file(400000);
                const CfdpId id = link.ground.put("source", "target", class1, {}, 0, 1);
                link.run(after);
                if (!by_sender && after < link.delay) {
                    EXPECT_EQ(cfdp_cancel(&link.craft.cfdp, id), 0); // it is not there yet
                    continue;
                }
                EXPECT_EQ(cfdp_cancel(&(by_sender ? link.ground : link.craft).cfdp, id), 1);
                EXPECT_EQ(cfdp_cancel(&(by_sender ? link.ground : link.craft).cfdp, id), 0);
                link.finish();
                link.expect_none(CFDP_CANCEL_REQUEST);
                EXPECT_LT(link.sent[CFDP_FILE_DATA], 400);
            }
        }
    }
}

TEST(CfdpF1, files_over_4_GB)
{
    // A store that keeps sizes alone: the first bytes of each segment name its offset.
    struct Huge {
        std::uint64_t size = (std::uint64_t{1} << 32) + 123456, came = 0, wrong = 0;
        bool whole = false;
    } source, target;
    const auto store_of = [](Huge &huge) {
        CfdpStore store{};
        store.user = &huge;
        store.open = [](void *, const char *, CfdpOpen) { return 1; };
        store.close = [](void *, int) {};
        store.size = [](void *user, int) { return static_cast<std::int64_t>(static_cast<Huge *>(user)->size); };
        store.read = [](void *, int, std::uint64_t offset, std::uint8_t *bytes, std::size_t) {
            cfdp_put_number(bytes, 8, offset);
            return 0;
        };
        store.write = [](void *user, int, std::uint64_t offset, const std::uint8_t *bytes, std::size_t n) {
            static_cast<Huge *>(user)->came += n;
            static_cast<Huge *>(user)->wrong += cfdp_get(bytes, 8) != offset;
            return 0;
        };
        store.rename = [](void *user, const char *, const char *) {
            static_cast<Huge *>(user)->whole = true;
            return 0;
        };
        store.remove = [](void *, const char *) { return 0; };
        return store;
    };
    Link link;
    link.ground.cfdp.set.store = store_of(source);
    link.craft.cfdp.set.store = store_of(target);
    link.ground.remote.segment = 65000;
    link.ground.remote.checksum = CFDP_NULL_CHECKSUM;
    link.craft.remote.immediate = 1;
    link.ground.put("source", "target");
    link.drops = [](const CfdpPdu &pdu, bool) { return pdu.kind == CFDP_FILE_DATA; };
    link.run(105 * ms);
    const std::uint64_t begin = (std::uint64_t{1} << 32) - 6500000; // as if both had come so far
    link.ground.transactions[0].progress = link.craft.transactions[0].progress = begin;
    link.drops = nullptr;
    link.loss = 0.1;
    link.finish();
    EXPECT_TRUE(target.whole);
    EXPECT_EQ(target.wrong, 0u);
    EXPECT_EQ(target.came, source.size - begin); // and nothing twice
    EXPECT_EQ(link.craft.ended()->progress, source.size);
    EXPECT_GT(link.sent[CFDP_NAK], 3);
}

TEST(CfdpF1, many_at_once_by_priority)
{
    Link link(1, 30);
    link.loss = 0.02;
    std::vector<CfdpId> ids;
    for (int i = 0; i < 20; i++) {
        const std::string name = "file" + std::to_string(i);
        link.ground.memory.files[name] = any_bytes(link.random, 20000);
        ids.push_back(link.ground.put(name, name, 0, {}, i == 19 ? 2 : 1));
    }
    for (int i = 0; i < 10; i++) { // and back
        const std::string name = "back" + std::to_string(i);
        link.craft.memory.files[name] = any_bytes(link.random, 20000);
        link.craft.put(name, name);
    }
    link.finish();
    for (const auto &[name, bytes] : link.ground.memory.files) {
        EXPECT_EQ(link.craft.memory.files[name], bytes) << name;
    }
    std::vector<std::uint64_t> order;
    for (const Told &one : link.craft.told) {
        if (one.what == CFDP_TOLD_ENDED && one.receiver != 0) {
            order.push_back(one.id.sequence);
        }
    }
    EXPECT_EQ(order.size(), 20u);
    EXPECT_EQ(order.front(), ids[19].sequence);
}

/// 100 MB in class 2 at a loss of 1 %, within 10 % of the link's rate. FLEDGE_CFDP_MB sets how many: 8 in the suite.
TEST(CfdpF1, a_large_file_goes_at_the_links_rate)
{
    const char *asked = std::getenv("FLEDGE_CFDP_MB");
    const std::size_t megabytes = asked != nullptr ? std::strtoul(asked, nullptr, 10) : 8;
    for (const bool immediate : {true, false}) {
        Link link(5, 1, 1200);
        link.loss = 0.01;
        link.delay = 250 * ms;
        link.craft.remote.immediate = immediate;
        link.craft.remote.nak_timer = 1 * s;
        link.ground.remote.segment = 1000;
        link.file(megabytes * 1000000);
        link.ground.put("source", "target");
        const auto start = std::chrono::steady_clock::now();
        link.finish(3600 * s);
        const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
        link.expect_whole();
        const double least = static_cast<double>(megabytes) * 1000 / 0.99 * 1e-3; // [s] of a PDU each ms
        const double rounds = megabytes < 100 ? 6 : 0; // [s] of the end, which a short file feels
        EXPECT_LT(static_cast<double>(link.now) / s, 1.1 * least + rounds);
        std::printf("%zu MB, %s NAK: %.3f of the link's rate, %.2f s of a processor\n", megabytes,
                    immediate ? "immediate" : "deferred", least / (static_cast<double>(link.now) / s), took.count());
    }
}

// ---- F2: lost PDUs and limits

TEST(CfdpF2, the_first_of_each_directive_is_lost)
{
    for (const int kind : {CFDP_METADATA, CFDP_EOF, CFDP_FINISHED, CFDP_NAK, CFDP_ACK}) {
        for (const int acknowledged : {0, static_cast<int>(CFDP_EOF), static_cast<int>(CFDP_FINISHED)}) {
            for (const bool immediate : {false, true}) {
                Link link;
                link.craft.remote.immediate = immediate;
                link.file(5000);
                auto first = lose(kind, 1, kind == CFDP_ACK ? acknowledged : 0);
                auto data = lose(CFDP_FILE_DATA, 2);
                link.drops = [&](const CfdpPdu &pdu, bool up) { return first(pdu, up) || data(pdu, up); };
                link.ground.put("source", "target");
                link.finish();
                link.expect_whole();
            }
        }
    }
}

TEST(CfdpF2, the_first_of_every_pdu_but_eof_is_lost_both_ways)
{
    Link link;
    std::set<std::vector<std::uint64_t>> seen;
    link.drops = [&](const CfdpPdu &pdu, bool) {
        const bool data = pdu.kind == CFDP_FILE_DATA;
        return pdu.kind != CFDP_EOF && seen.insert({pdu.kind, data ? pdu.offset : 0, pdu.acknowledged}).second;
    };
    link.file(20000);
    link.ground.put("source", "target");
    link.finish();
    link.expect_whole();
}

TEST(CfdpF2, limits_of_acknowledgements)
{
    Link link; // no EOF is acknowledged: neither that of the file nor that of the cancellation
    link.file(5000);
    link.drops = [](const CfdpPdu &pdu, bool) { return pdu.kind == CFDP_ACK && pdu.acknowledged == CFDP_EOF; };
    link.craft.remote.nak_limit = 2;
    auto data = lose(CFDP_FILE_DATA, 2);
    link.drops = [=](const CfdpPdu &pdu, bool up) {
        return (pdu.kind == CFDP_ACK && pdu.acknowledged == CFDP_EOF) ||
               (pdu.kind == CFDP_FILE_DATA && pdu.offset == 1000) || data(pdu, up) || pdu.kind == CFDP_FINISHED;
    };
    link.ground.put("source", "target");
    link.finish();
    EXPECT_EQ(link.ground.ended()->condition, CFDP_ACK_LIMIT);
    EXPECT_EQ(link.ground.count(CFDP_TOLD_FAULT, CFDP_ACK_LIMIT), 2);
    EXPECT_EQ(link.sent[CFDP_EOF], 2 * 5);
    EXPECT_EQ(link.ground.ended()->file_status, CFDP_UNREPORTED);
    EXPECT_FALSE(link.craft.memory.has("target"));

    Link back; // no FINISHED is acknowledged: the file is there all the same
    back.file(5000);
    back.drops = [](const CfdpPdu &pdu, bool) { return pdu.kind == CFDP_FINISHED; };
    back.ground.remote.inactivity = 30 * s;
    back.ground.put("source", "target");
    back.finish();
    EXPECT_EQ(back.sent[CFDP_FINISHED], 5);
    EXPECT_EQ(back.craft.ended()->condition, CFDP_ACK_LIMIT);
    EXPECT_EQ(back.craft.ended()->incomplete, 0);
    EXPECT_EQ(back.craft.memory.files["target"], back.ground.memory.files["source"]);
    EXPECT_EQ(back.ground.ended()->condition, CFDP_INACTIVITY);
}

TEST(CfdpF2, limit_of_naks)
{
    Link link;
    link.file(5000);
    Bytes where;
    link.drops = [&](const CfdpPdu &pdu, bool) {
        if (pdu.kind == CFDP_FINISHED) {
            where.assign(pdu.data, pdu.data + pdu.n);
        }
        return pdu.kind == CFDP_FILE_DATA && pdu.offset == 2000;
    };
    link.ground.put("source", "target");
    link.finish();
    link.expect_none(CFDP_NAK_LIMIT);
    EXPECT_EQ(link.sent[CFDP_NAK], 1 + 5);
    EXPECT_EQ(where, (Bytes{CFDP_TLV_ENTITY, 2, 0, 2})); // of the fault
}

TEST(CfdpF2, inactivity_at_either_end)
{
    Link link; // the ground falls silent after some data
    link.file(50000);
    int sent = 0;
    link.drops = [&](const CfdpPdu &, bool up) { return up && sent++ > 20; };
    link.ground.put("source", "target");
    link.finish();
    EXPECT_EQ(link.craft.ended()->condition, CFDP_INACTIVITY);
    EXPECT_FALSE(link.craft.memory.has("target"));

    Link silent; // the craft falls silent after its acknowledgement
    silent.file(5000);
    silent.drops = [](const CfdpPdu &pdu, bool up) { return !up && pdu.kind != CFDP_ACK; };
    silent.ground.put("source", "target");
    silent.finish();
    EXPECT_EQ(silent.ground.ended()->condition, CFDP_INACTIVITY);
}

TEST(CfdpF2, handlers_of_faults)
{
    // By the remote entity, and by the transaction itself; each for a receiver that misses data for ever.
    for (const int by_put : {0, 1}) {
        for (const std::uint8_t handler : {CFDP_CANCEL, CFDP_SUSPEND, CFDP_IGNORE, CFDP_ABANDON}) {
            Link link;
            link.file(5000);
            link.drops = [](const CfdpPdu &pdu, bool) { return pdu.kind == CFDP_FILE_DATA && pdu.offset == 2000; };
            Bytes options;
            if (by_put != 0) {
                options = {CFDP_TLV_HANDLER, 1, static_cast<std::uint8_t>(CFDP_NAK_LIMIT << 4 | handler),
                           CFDP_TLV_FLOW,    1, CFDP_NAK_LIMIT << 4};
            } else {
                link.craft.remote.handlers[CFDP_NAK_LIMIT] = handler;
            }
            link.ground.remote.inactivity = 300 * s;
            const CfdpId id = link.ground.put("source", "target", 0, options);
            link.run(40 * s);
            EXPECT_GE(link.craft.count(CFDP_TOLD_FAULT, CFDP_NAK_LIMIT), 1);
            EXPECT_EQ(link.craft.count(CFDP_TOLD_SUSPENDED), handler == CFDP_SUSPEND);
            EXPECT_EQ(link.craft.count(CFDP_TOLD_ABANDONED), handler == CFDP_ABANDON);
            EXPECT_EQ(link.craft.busy(), handler == CFDP_SUSPEND || handler == CFDP_IGNORE);
            EXPECT_EQ(link.ground.busy(), handler != CFDP_CANCEL);
            link.drops = nullptr;
            if (handler == CFDP_SUSPEND) {
                EXPECT_EQ(cfdp_resume(&link.craft.cfdp, id), 1);
            }
            link.finish();
            if (handler == CFDP_SUSPEND || handler == CFDP_IGNORE) {
                link.expect_whole();
            } else {
                EXPECT_FALSE(link.craft.memory.has("target"));
            }
        }
    }
}

TEST(CfdpF2, keep_alives_and_prompts)
{
    Link link;
    link.craft.remote.keep_alive = 100 * ms;
    link.file(500000);
    const CfdpId id = link.ground.put("source", "target");
    link.run(300 * ms);
    const int alive = link.sent[CFDP_KEEP_ALIVE];
    EXPECT_GE(alive, 1);
    EXPECT_EQ(cfdp_prompt(&link.ground.cfdp, id, 1), 1);
    EXPECT_EQ(cfdp_prompt(&link.ground.cfdp, id, 0), 1);
    EXPECT_EQ(cfdp_prompt(&link.craft.cfdp, id, 0), 0);
    link.run(150 * ms);
    EXPECT_EQ(link.sent[CFDP_PROMPT], 2);
    EXPECT_EQ(link.sent[CFDP_NAK], 1); // though nothing is missing
    link.finish();
    link.expect_whole();

    Link slow; // the receiver gets nothing: the sender notices how far it is behind
    slow.craft.remote.keep_alive = 100 * ms;
    slow.ground.remote.keep_alive_limit = 200000;
    slow.drops = [](const CfdpPdu &pdu, bool) { return pdu.kind == CFDP_FILE_DATA && pdu.offset > 5000; };
    slow.file(500000);
    slow.ground.put("source", "target");
    slow.finish();
    slow.expect_none(CFDP_KEEP_ALIVE_LIMIT);
    EXPECT_LT(slow.sent[CFDP_FILE_DATA], 400);
}

TEST(CfdpF2, a_wrong_checksum_or_size_delivers_nothing)
{
    for (const int what : {0, 1, 2}) {
        Link link;
        link.file(5000);
        bool done = false;
        const auto flip = [&](Bytes &bytes) {
            CfdpPdu pdu{};
            ASSERT_EQ(cfdp_pdu_read(&pdu, bytes.data(), bytes.size()), CCSDS_OK);
            const std::size_t head = cfdp_pdu_head(&pdu);
            if (what == 0 && pdu.kind == CFDP_FILE_DATA && !done) {
                bytes[head + 7] ^= 1;
                done = true;
            } else if (what != 0 && pdu.kind == CFDP_EOF && pdu.condition == 0) {
                pdu.offset = what == 1 ? 4000 : pdu.offset; // shorter than the data
                pdu.checksum ^= what == 2;
                cfdp_pdu_write(&pdu, bytes.data(), bytes.size());
            }
        };
        link.ground.put("source", "target");
        for (int i = 0; i < 60000 && (link.ground.busy() || link.craft.busy()); i++) {
            link.step();
            for (auto &[at, one] : link.flying) {
                if (at == link.now + link.delay) {
                    flip(one.bytes);
                }
            }
        }
        link.expect_none(what == 1 ? CFDP_SIZE_ERROR : CFDP_CHECKSUM_FAILURE);
        EXPECT_EQ(link.ground.ended()->incomplete, 1);
    }
}

TEST(CfdpF2, a_closure_that_does_not_come_and_a_checksum_that_is_not_known)
{
    Link link;
    link.file(5000);
    link.drops = [](const CfdpPdu &pdu, bool) { return pdu.kind == CFDP_FINISHED; };
    link.ground.put("source", "target", 1, {}, 0, 1);
    link.finish();
    EXPECT_EQ(link.ground.ended()->condition, CFDP_CHECK_LIMIT);
    EXPECT_TRUE(link.craft.memory.has("target"));

    Link other;
    other.ground.remote.checksum = 2;                                     // CRC-32C
    other.craft.remote.handlers[CFDP_UNSUPPORTED_CHECKSUM] = CFDP_IGNORE; // which cannot be
    other.file(5000);
    other.ground.put("source", "target");
    other.finish();
    other.expect_none(CFDP_UNSUPPORTED_CHECKSUM);
}

TEST(CfdpF2, timers_of_zero_never_expire)
{
    Link link;
    for (CfdpRemote *one : {&link.ground.remote, &link.craft.remote}) {
        one->ack_timer = one->nak_timer = one->check_timer = one->inactivity = 0;
    }
    link.delay = 30 * s;
    link.file(5000);
    link.ground.put("source", "target");
    link.finish();
    link.expect_whole();
    EXPECT_EQ(link.sent[CFDP_EOF], 1);
    EXPECT_EQ(link.sent[CFDP_FINISHED], 1);
}

TEST(CfdpHostile, an_acknowledgement_of_what_was_not_sent)
{
    Link link;
    link.file(50000);
    const CfdpId id = link.ground.put("source", "target");
    link.run(10 * ms);
    CfdpPdu ack{};
    ack.kind = CFDP_ACK;
    ack.acknowledged = CFDP_EOF;
    ack.to_sender = 1;
    ack.source = id.source;
    ack.sequence = id.sequence;
    ack.destination = 2;
    ack.entity_bytes = 2;
    ack.sequence_bytes = 4;
    std::uint8_t bytes[64];
    cfdp_take(&link.ground.cfdp, bytes, cfdp_pdu_write(&ack, bytes, sizeof bytes));
    EXPECT_EQ(link.ground.transactions[0].state, CFDP_SENDING);
    link.finish(10 * s);
    link.expect_whole();
}

TEST(CfdpF2, reports_and_requests_that_cannot_be)
{
    Link link(1, 2);
    link.file(300000);
    const CfdpId id = link.ground.put("source", "target");
    link.run(200 * ms);
    for (End *end : {&link.ground, &link.craft}) {
        EXPECT_EQ(cfdp_report(&end->cfdp, id), 1);
        EXPECT_EQ(end->told.back().what, CFDP_TOLD_REPORT);
        EXPECT_EQ(end->told.back().size, 300000u);
        EXPECT_EQ(end->told.back().receiver, end == &link.craft);
    }
    EXPECT_EQ(link.ground.told.back().progress, 199000u);
    EXPECT_EQ(link.craft.told.back().progress, 99000u);
    for (const CfdpId none : {CfdpId{1, 99}, CfdpId{2, 1}}) {
        EXPECT_EQ(cfdp_report(&link.ground.cfdp, none), 0);
        EXPECT_EQ(cfdp_suspend(&link.ground.cfdp, none), 0);
        EXPECT_EQ(cfdp_resume(&link.ground.cfdp, none), 0);
        EXPECT_EQ(cfdp_cancel(&link.ground.cfdp, none), 0);
        EXPECT_EQ(cfdp_prompt(&link.ground.cfdp, none, 1), 0);
    }
    EXPECT_EQ(cfdp_resume(&link.ground.cfdp, id), 0); // it is not suspended
    const std::string longest(CFDP_NAME - 1, 'n'), longer = longest + "n";
    const Bytes options(CFDP_OPTIONS + 1);
    CfdpPut put{};
    CfdpId made{};
    const auto result = [&](std::uint64_t to, const char *from, const char *target, std::size_t options_n = 0) {
        put.destination = to;
        put.from = from;
        put.to = target;
        put.options = options.data();
        put.options_n = options_n;
        return cfdp_put(&link.ground.cfdp, &put, &made);
    };
    EXPECT_EQ(result(3, "source", "target"), CFDP_REFUSED);
    EXPECT_EQ(result(2, "none", "target"), CFDP_ABSENT);
    EXPECT_EQ(result(2, "source", ""), CFDP_REFUSED);
    EXPECT_EQ(result(2, "source", longer.c_str()), CFDP_REFUSED);
    EXPECT_EQ(result(2, "source", "target", options.size()), CFDP_REFUSED);
    EXPECT_EQ(result(2, "source", longest.c_str()), 0);
    EXPECT_EQ(made.sequence, id.sequence + 1);
    EXPECT_EQ(result(2, "source", "target"), CFDP_FULL);
    // Nothing for another remote entity, and nothing while the link is out.
    Bytes bytes(2000);
    const CfdpRemote other{};
    EXPECT_EQ(cfdp_next(&link.ground.cfdp, &other, bytes.data(), bytes.size()), 0u);
    link.ground.remote.frozen = 1;
    EXPECT_EQ(cfdp_next(&link.ground.cfdp, &link.ground.remote, bytes.data(), bytes.size()), 0u);
    link.ground.remote.frozen = 0;
    EXPECT_GT(cfdp_next(&link.ground.cfdp, &link.ground.remote, bytes.data(), bytes.size()), 0u);
    // Acknowledgements wait for the link, too.
    CfdpPdu pdu{};
    pdu.kind = CFDP_EOF;
    pdu.condition = CFDP_CANCEL_REQUEST;
    pdu.source = id.source;
    pdu.sequence = 77;
    pdu.destination = 2;
    pdu.entity_bytes = 1;
    pdu.sequence_bytes = 4;
    link.craft.remote.frozen = 1;
    cfdp_take(&link.craft.cfdp, bytes.data(), cfdp_pdu_write(&pdu, bytes.data(), bytes.size()));
    EXPECT_EQ(cfdp_next(&link.craft.cfdp, nullptr, bytes.data(), bytes.size()), 0u);
    link.craft.remote.frozen = 0;
    EXPECT_GT(cfdp_next(&link.craft.cfdp, nullptr, bytes.data(), bytes.size()), 0u);
    // A PDU of the other class changes nothing.
    pdu.condition = 0;
    pdu.sequence = id.sequence;
    pdu.unacknowledged = 1;
    cfdp_take(&link.craft.cfdp, bytes.data(), cfdp_pdu_write(&pdu, bytes.data(), bytes.size()));
    EXPECT_EQ(link.craft.cfdp.live.faults[CCSDS_TYPE], 1u);
    link.finish();
    EXPECT_EQ(link.craft.memory.files["target"], link.ground.memory.files["source"]);
    EXPECT_EQ(link.craft.memory.files[longest], link.ground.memory.files["source"]);
}

TEST(CfdpF2, metadata_that_is_longer_than_the_link_takes_cancels)
{
    Link link;
    link.file(1000);
    Bytes options(500);
    options[0] = options[250] = CFDP_TLV_MESSAGE;
    options[1] = options[251] = 248;
    const CfdpId id = link.ground.put("source", "target", 0, options);
    Bytes bytes(CFDP_ROOM);
    CfdpPdu pdu{};
    const std::size_t n = cfdp_next(&link.ground.cfdp, nullptr, bytes.data(), bytes.size());
    ASSERT_EQ(cfdp_pdu_read(&pdu, bytes.data(), n), CCSDS_OK);
    EXPECT_EQ(pdu.kind, CFDP_EOF);
    EXPECT_EQ(pdu.sequence, id.sequence);
    EXPECT_EQ(pdu.condition, CFDP_INVALID_STRUCTURE);
    link.finish();
    EXPECT_EQ(link.ground.ended()->condition, CFDP_INVALID_STRUCTURE);
    EXPECT_FALSE(link.craft.memory.has("target"));
}

TEST(CfdpF2, a_handler_that_suspends_can_be_resumed_or_cancelled_at_any_state)
{
    // At the end, too: the file is delivered, or the transaction is cancelled, and the other end does not answer.
    for (const bool cancelled : {false, true}) {
        for (const bool of_craft : {false, true}) {
            Link link;
            link.ground.remote.handlers[CFDP_ACK_LIMIT] = link.craft.remote.handlers[CFDP_ACK_LIMIT] = CFDP_SUSPEND;
            link.ground.remote.inactivity = 20 * s;
            link.file(5000);
            link.drops = [=](const CfdpPdu &pdu, bool) {
                return pdu.kind == CFDP_ACK || (of_craft && pdu.kind == CFDP_FINISHED);
            };
            const CfdpId id = link.ground.put("source", "target");
            End &end = of_craft ? link.craft : link.ground;
            if (cancelled) {
                link.run(102 * ms);
                cfdp_cancel(&end.cfdp, id);
            }
            link.run(40 * s);
            for (End *one : {&link.ground, &link.craft}) {
                cfdp_cancel(&one->cfdp, id);
            }
            link.finish();
        }
    }
}

// ---- F3: the store, proxies and directories

Bytes request(CfdpAction action, const std::string &first, const std::string &second = "")
{
    CfdpFilestore one{};
    one.action = action;
    one.first = {reinterpret_cast<const std::uint8_t *>(first.data()), static_cast<std::uint8_t>(first.size())};
    one.second = {reinterpret_cast<const std::uint8_t *>(second.data()), static_cast<std::uint8_t>(second.size())};
    Bytes bytes(600);
    bytes.resize(cfdp_filestore_write(&one, bytes.data(), bytes.size()));
    return bytes;
}

Bytes message(std::uint8_t type, const std::string &first = "", const std::string &second = "",
              std::uint64_t entity = 0, std::uint8_t value = 0)
{
    CfdpMessage one{};
    one.type = type;
    one.first = {reinterpret_cast<const std::uint8_t *>(first.data()), static_cast<std::uint8_t>(first.size())};
    one.second = {reinterpret_cast<const std::uint8_t *>(second.data()), static_cast<std::uint8_t>(second.size())};
    one.entity = entity;
    one.entity_bytes = 2;
    one.sequence_bytes = 4;
    one.value = value;
    Bytes bytes(600);
    bytes.resize(cfdp_message_write(&one, bytes.data(), bytes.size()));
    return bytes;
}

Bytes joined(std::initializer_list<Bytes> parts)
{
    Bytes all;
    for (const Bytes &part : parts) {
        all.insert(all.end(), part.begin(), part.end());
    }
    return all;
}

TEST(CfdpF3, requests_to_the_store)
{
    const auto status = [](const Bytes &options, Link &link) {
        link.ground.told.clear();
        link.ground.put("", "", 0, options);
        link.finish();
        std::vector<int> found;
        for (const Told &one : link.ground.told) {
            if (one.what == CFDP_TOLD_RESPONSE) {
                found.push_back(one.text[0] & 15);
            }
        }
        return found;
    };
    using Found = std::vector<int>;
    Link link;
    auto &files = link.craft.memory.files;
    EXPECT_EQ(status(request(CFDP_CREATE_FILE, "a"), link), Found{0});
    EXPECT_TRUE(link.craft.memory.has("a"));
    EXPECT_EQ(status(request(CFDP_CREATE_FILE, "a"), link), Found{1}); // it is there
    files["a"] = {1, 2};
    files["b"] = {3};
    EXPECT_EQ(status(request(CFDP_APPEND_FILE, "a", "b"), link), Found{0});
    EXPECT_EQ(files["a"], (Bytes{1, 2, 3}));
    EXPECT_EQ(status(request(CFDP_REPLACE_FILE, "a", "b"), link), Found{0});
    EXPECT_EQ(files["a"], Bytes{3});
    EXPECT_EQ(files["b"], Bytes{3});
    EXPECT_EQ(status(request(CFDP_APPEND_FILE, "none", "b"), link), Found{1});
    EXPECT_EQ(status(request(CFDP_REPLACE_FILE, "a", "none"), link), Found{2});
    EXPECT_EQ(status(request(CFDP_RENAME_FILE, "a", "b"), link), Found{2}); // the new name is there
    EXPECT_EQ(status(request(CFDP_RENAME_FILE, "none", "c"), link), Found{1});
    EXPECT_EQ(status(request(CFDP_RENAME_FILE, "a", "../c"), link), Found{3});
    EXPECT_EQ(status(request(CFDP_RENAME_FILE, "a", "c"), link), Found{0});
    EXPECT_FALSE(link.craft.memory.has("a"));
    EXPECT_EQ(files["c"], Bytes{3});
    EXPECT_EQ(status(request(CFDP_DELETE_FILE, "a"), link), Found{1});
    EXPECT_EQ(status(request(CFDP_DENY_FILE, "a"), link), Found{0});
    EXPECT_EQ(status(request(CFDP_CREATE_DIRECTORY, "d"), link), Found{0});
    EXPECT_EQ(status(request(CFDP_CREATE_DIRECTORY, "d"), link), Found{1});
    EXPECT_EQ(status(request(CFDP_REMOVE_DIRECTORY, "d"), link), Found{0});
    EXPECT_EQ(status(request(CFDP_REMOVE_DIRECTORY, "d"), link), Found{1});
    EXPECT_EQ(status(request(CFDP_DENY_DIRECTORY, "d"), link), Found{0});
    // After one that fails, the others are not performed.
    EXPECT_EQ(status(joined({request(CFDP_DELETE_FILE, "b"), request(CFDP_DELETE_FILE, "none"),
                             request(CFDP_DELETE_FILE, "c")}),
                     link),
              (Found{0, 1, 15}));
    EXPECT_FALSE(link.craft.memory.has("b"));
    EXPECT_TRUE(link.craft.memory.has("c"));
    EXPECT_EQ(status(request(CFDP_DELETE_FILE, ".cfdp0"), link), Found{2}); // unfinished files are not for peers
    Bytes most;
    for (int i = 0; i < CFDP_REQUESTS; i++) {
        most = joined({most, request(CFDP_DENY_FILE, "n")});
    }
    EXPECT_EQ(status(most, link), Found(CFDP_REQUESTS, 0));
    EXPECT_EQ(status(joined({most, request(CFDP_DELETE_FILE, "c")}), link), Found{}); // too many: none is done
    EXPECT_EQ(link.ground.ended()->condition, CFDP_FILESTORE_REJECTION);
    link.craft.remote.allowed = 0;
    EXPECT_EQ(status(request(CFDP_DELETE_FILE, "c"), link), Found{2});
    EXPECT_TRUE(link.craft.memory.has("c"));
}

TEST(CfdpF3, requests_wait_for_the_file_and_are_done_once)
{
    Link link;
    link.file(3000);
    link.craft.memory.files["log"] = {7};
    auto data = lose(CFDP_FILE_DATA, 2), finished = lose(CFDP_FINISHED), metadata = lose(CFDP_METADATA);
    link.drops = [&](const CfdpPdu &pdu, bool up) { return data(pdu, up) || finished(pdu, up) || metadata(pdu, up); };
    link.twice = 0.5;
    link.ground.put("source", "target", 0, request(CFDP_APPEND_FILE, "log", "target"));
    link.finish();
    link.expect_whole();
    EXPECT_EQ(link.craft.memory.files["log"].size(), 3001u);
    EXPECT_EQ(link.ground.count(CFDP_TOLD_RESPONSE), 1);
}

TEST(CfdpF3, get_by_proxy)
{
    for (const std::uint8_t mode : {0, 1}) {
        Link link;
        link.craft.memory.files["science"] = any_bytes(link.random, 30000);
        link.ground.put("", "", 0,
                        joined({message(CFDP_PROXY_PUT, "science", "got", 1), message(CFDP_PROXY_MODE, "", "", 0, mode),
                                message(CFDP_PROXY_MESSAGE, "note")}));
        link.finish();
        EXPECT_EQ(link.ground.memory.files["got"], link.craft.memory.files["science"]);
        // The ground has the message of the file, then the response: no error, whole; and for which transaction.
        std::vector<Bytes> texts;
        for (const Told &one : link.ground.told) {
            if (one.what == CFDP_TOLD_MESSAGE) {
                texts.push_back(one.text);
            }
        }
        ASSERT_EQ(texts.size(), 3u);
        EXPECT_EQ(texts[0], (Bytes{'n', 'o', 't', 'e'}));
        EXPECT_EQ(texts[1], (Bytes{'c', 'f', 'd', 'p', CFDP_PROXY_PUT_RESPONSE,
                                   static_cast<std::uint8_t>(mode == 0 ? CFDP_RETAINED : CFDP_UNREPORTED)}));
        CfdpMessage origin{};
        const CfdpTlv tlv{{texts[2].data(), static_cast<std::uint8_t>(texts[2].size())}, CFDP_TLV_MESSAGE};
        ASSERT_EQ(cfdp_message_read(&origin, &tlv), CCSDS_OK);
        EXPECT_EQ(origin.type, CFDP_ORIGIN);
        EXPECT_EQ(origin.entity, 1u);
        EXPECT_EQ(origin.sequence, 1u);
    }
    Link options; // what the file that is asked for is sent with
    Bytes found;
    options.drops = [&](const CfdpPdu &pdu, bool up) {
        if (!up && pdu.kind == CFDP_METADATA && pdu.from.n != 0) {
            found.assign(pdu.data, pdu.data + pdu.n);
            EXPECT_EQ(pdu.closure, 1);
            EXPECT_EQ(pdu.unacknowledged, 1);
        }
        return false;
    };
    options.craft.memory.files["science"] = {1};
    options.ground.put("", "", 0,
                       joined({message(CFDP_PROXY_PUT, "science", "got", 1), message(CFDP_PROXY_MODE, "", "", 0, 1),
                               message(CFDP_PROXY_CLOSURE, "", "", 0, 1), message(CFDP_PROXY_MESSAGE, "hi"),
                               message(CFDP_PROXY_HANDLER, "", "", 0, CFDP_INACTIVITY << 4 | CFDP_ABANDON),
                               message(CFDP_PROXY_FLOW, "f"), message(CFDP_PROXY_REQUEST, std::string("\x70\1a", 3))}));
    options.finish();
    EXPECT_EQ(found, (Bytes{2, 2, 'h', 'i', 4, 1, CFDP_INACTIVITY << 4 | CFDP_ABANDON, 5, 1, 'f', 0, 3, 0x70, 1, 'a'}));
    Link link; // a file that is not there, and one that may not be asked for
    for (const std::uint8_t allowed : {CFDP_ALLOW_PROXY, CFDP_ALLOW_LIST}) {
        link.craft.remote.allowed = allowed;
        link.craft.memory.files["secret"] = {1};
        link.ground.put("", "", 0, message(CFDP_PROXY_PUT, allowed == CFDP_ALLOW_PROXY ? "none" : "secret", "got", 1));
        link.finish();
        const auto told = std::find_if(link.ground.told.rbegin(), link.ground.told.rend(), [](const Told &one) {
            return one.what == CFDP_TOLD_MESSAGE && one.text[4] == CFDP_PROXY_PUT_RESPONSE;
        });
        ASSERT_NE(told, link.ground.told.rend());
        EXPECT_EQ(told->text[5], CFDP_FILESTORE_REJECTION << 4 | 4 | CFDP_REJECTED);
        EXPECT_FALSE(link.ground.memory.has("got"));
        link.ground.told.clear();
    }
}

TEST(CfdpF3, cancel_by_proxy)
{
    Link link;
    link.craft.memory.files["science"] = any_bytes(link.random, 3000000);
    const CfdpId id = link.ground.put("", "", 0, message(CFDP_PROXY_PUT, "science", "got", 1));
    link.run(1 * s);
    CfdpMessage origin{};
    origin.type = CFDP_ORIGIN;
    origin.entity = id.source;
    origin.sequence = id.sequence;
    origin.entity_bytes = origin.sequence_bytes = 4;
    Bytes which(40);
    which.resize(cfdp_message_write(&origin, which.data(), which.size()));
    link.ground.put("", "", 0, joined({message(CFDP_PROXY_CANCEL), which}));
    link.finish();
    EXPECT_FALSE(link.ground.memory.has("got"));
    EXPECT_EQ(link.craft.count(CFDP_TOLD_ENDED, CFDP_CANCEL_REQUEST), 1);
    EXPECT_EQ(link.ground.count(CFDP_TOLD_ENDED, CFDP_CANCEL_REQUEST), 1);
}

TEST(CfdpF3, list_a_directory)
{
    Link link;
    link.craft.memory.files["a"] = {1};
    link.craft.memory.files["b"] = {};
    link.ground.put("", "", 0, message(CFDP_LIST, "", "names"));
    link.finish();
    EXPECT_EQ(link.ground.memory.files["names"], (Bytes{'a', '\n', 'b', '\n'}));
    link.ground.told.clear();
    link.ground.put("", "", 0, message(CFDP_LIST, "none", "more"));
    link.finish();
    EXPECT_FALSE(link.ground.memory.has("more"));
    const auto told = std::find_if(link.ground.told.begin(), link.ground.told.end(),
                                   [](const Told &one) { return one.what == CFDP_TOLD_MESSAGE; });
    ASSERT_NE(told, link.ground.told.end());
    EXPECT_EQ(told->text[4], CFDP_LISTED);
    EXPECT_EQ(told->text[5], 0x80);
}

/// Ask the craft about a transaction. Returns the value of its answer; -1: there is none.
int ask(Link &link, CfdpMessageType type, CfdpId about, const std::string &file = "")
{
    CfdpMessage one{};
    one.type = static_cast<std::uint8_t>(type);
    one.entity = about.source;
    one.sequence = about.sequence;
    one.entity_bytes = one.sequence_bytes = 4;
    one.first = {reinterpret_cast<const std::uint8_t *>(file.data()), static_cast<std::uint8_t>(file.size())};
    Bytes options(200);
    options.resize(cfdp_message_write(&one, options.data(), options.size()));
    link.ground.told.clear();
    link.ground.put("", "", 0, options);
    link.run(2 * s);
    for (const Told &told : link.ground.told) {
        if (told.what == CFDP_TOLD_MESSAGE && told.text[4] == type + 1) {
            CfdpMessage answer{};
            const CfdpTlv tlv{{told.text.data(), static_cast<std::uint8_t>(told.text.size())}, CFDP_TLV_MESSAGE};
            EXPECT_EQ(cfdp_message_read(&answer, &tlv), CCSDS_OK);
            EXPECT_EQ(answer.entity, about.source);
            EXPECT_EQ(answer.sequence, about.sequence);
            return answer.value;
        }
    }
    return -1;
}

TEST(CfdpF3, remote_suspension_and_reports_of_what_the_craft_sends)
{
    Link link;
    link.craft.memory.files["science"] = any_bytes(link.random, 5'000'000);
    link.ground.put("", "", 0, message(CFDP_PROXY_PUT, "science", "got", 1));
    link.run(1 * s);
    const CfdpId id{2, 1};
    EXPECT_EQ(ask(link, CFDP_REMOTE_SUSPEND, id), 0x80 | CFDP_ACTIVE << 5);
    EXPECT_EQ(link.craft.count(CFDP_TOLD_SUSPENDED), 1);
    const int sent = link.sent[CFDP_FILE_DATA];
    link.run(30 * s);
    EXPECT_EQ(link.sent[CFDP_FILE_DATA], sent);
    EXPECT_EQ(ask(link, CFDP_REMOTE_SUSPEND, id), 0x80 | CFDP_ACTIVE << 5); // it is already
    EXPECT_EQ(link.craft.count(CFDP_TOLD_SUSPENDED), 1);
    EXPECT_EQ(ask(link, CFDP_REMOTE_REPORT, id, "report"), CFDP_ACTIVE << 6);
    const Bytes &report = link.ground.memory.files["report"];
    EXPECT_EQ(std::string(report.begin(), report.end()),
              "progress " + std::to_string(1000 * sent) + "\nsize 5000000\nstate 1\ncondition 0\nsuspended 1\n");
    EXPECT_EQ(ask(link, CFDP_REMOTE_RESUME, id), CFDP_ACTIVE << 5);
    EXPECT_EQ(link.craft.count(CFDP_TOLD_RESUMED), 1);
    link.finish();
    EXPECT_EQ(link.ground.memory.files["got"], link.craft.memory.files["science"]);
    EXPECT_EQ(ask(link, CFDP_REMOTE_REPORT, id, "report"), CFDP_TERMINATED << 6 | 1);
    EXPECT_EQ(ask(link, CFDP_REMOTE_SUSPEND, {2, 999}), CFDP_UNRECOGNIZED << 5);
    link.finish();
}

TEST(CfdpF3, remote_suspension_of_what_the_craft_receives)
{
    for (const int class1 : {0, 1}) {
        Link link;
        link.file(3'000'000);
        const CfdpId id = link.ground.put("source", "target", class1);
        link.run(1 * s);
        EXPECT_EQ(ask(link, CFDP_REMOTE_SUSPEND, id), 0x80 | CFDP_ACTIVE << 5);
        EXPECT_EQ(ask(link, CFDP_REMOTE_REPORT, id, "../report"), -1); // the ground's own store refuses that name
        link.run(5 * s);
        EXPECT_FALSE(link.craft.memory.has("target")); // all of it is there
        EXPECT_EQ(ask(link, CFDP_REMOTE_RESUME, id), CFDP_ACTIVE << 5);
        EXPECT_EQ(link.craft.memory.files["target"], link.ground.memory.files["source"]);
        link.finish();
    }
}

TEST(CfdpF3, remote_suspension_is_for_those_who_may)
{
    Link link;
    CfdpRemote remotes[] = {link.craft.remote, link.craft.remote};
    remotes[1].entity = 7;
    link.craft.cfdp.set.remotes = remotes;
    link.craft.cfdp.set.remotes_n = 2;
    link.file(3'000'000);
    const CfdpId id = link.ground.put("source", "target");
    link.run(1 * s);
    EXPECT_EQ(ask(link, CFDP_REMOTE_SUSPEND, {1, id.sequence + 1}), CFDP_UNRECOGNIZED << 5); // itself
    remotes[0].allowed = CFDP_ALLOW_PROXY;
    EXPECT_EQ(ask(link, CFDP_REMOTE_SUSPEND, id), -1);
    remotes[0].allowed = CFDP_ALLOW_REMOTE;
    link.craft.memory.files["source"] = {1};
    CfdpPut put{};
    put.destination = 7;
    put.from = put.to = "source";
    CfdpId other{};
    ASSERT_EQ(cfdp_put(&link.craft.cfdp, &put, &other), 0);
    EXPECT_EQ(ask(link, CFDP_REMOTE_SUSPEND, other), CFDP_UNRECOGNIZED << 5);
    EXPECT_EQ(link.craft.count(CFDP_TOLD_SUSPENDED), 0);
}

// ---- defects that others have had

TEST(CfdpDefects, eof_while_suspended_is_followed_by_naks_after_resume)
{
    for (const bool immediate : {false, true}) {
        Link link;
        link.craft.remote.immediate = immediate;
        link.file(20000);
        link.drops = lose(CFDP_FILE_DATA, 12);
        const CfdpId id = link.ground.put("source", "target");
        link.run(105 * ms);
        ASSERT_EQ(cfdp_suspend(&link.craft.cfdp, id), 1);
        link.run(30 * s);
        EXPECT_EQ(link.sent[CFDP_NAK], 0);
        EXPECT_EQ(link.sent[CFDP_ACK], 1); // but the EOF is acknowledged
        EXPECT_EQ(cfdp_resume(&link.craft.cfdp, id), 1);
        link.finish();
        link.expect_whole();
    }
}

TEST(CfdpDefects, resume_without_gaps_finishes)
{
    Link link;
    link.file(20000);
    const CfdpId id = link.ground.put("source", "target");
    link.run(105 * ms);
    ASSERT_EQ(cfdp_suspend(&link.craft.cfdp, id), 1);
    link.run(50 * s);
    EXPECT_EQ(link.sent[CFDP_FINISHED], 0);
    EXPECT_FALSE(link.craft.memory.has("target"));
    ASSERT_EQ(cfdp_resume(&link.craft.cfdp, id), 1);
    link.finish(1 * s);
    link.expect_whole();
    EXPECT_EQ(link.sent[CFDP_NAK], 0);

    Link sender; // and at the sender, in the middle of the file
    sender.file(20000);
    const CfdpId other = sender.ground.put("source", "target");
    sender.run(10 * ms);
    ASSERT_EQ(cfdp_suspend(&sender.ground.cfdp, other), 1);
    EXPECT_EQ(cfdp_suspend(&sender.ground.cfdp, other), 0);
    sender.run(50 * s);
    EXPECT_LT(sender.sent[CFDP_FILE_DATA], 11);
    ASSERT_EQ(cfdp_resume(&sender.ground.cfdp, other), 1);
    sender.finish(1 * s);
    sender.expect_whole();
}

TEST(CfdpDefects, a_nak_list_longer_than_one_pdu_is_sent_in_several)
{
    Link link(1, 1, 400);
    link.craft.remote.segment = 100; // 12 ranges
    link.drops = [n = 0](const CfdpPdu &pdu, bool) mutable {
        return pdu.kind == CFDP_FILE_DATA && n < 600 && n++ % 2 == 0;
    };
    link.file(600000);
    link.ground.put("source", "target");
    link.finish(3 * s);
    link.expect_whole();
    EXPECT_EQ(link.sent[CFDP_NAK], (300 + 11) / 12);
    EXPECT_EQ(link.sent[CFDP_FILE_DATA], 900); // and nothing more often than needed
}

TEST(CfdpDefects, what_several_naks_ask_for_is_sent_once)
{
    Link link(1, 1, 8);
    link.file(20000);
    const CfdpId id = link.ground.put("source", "target");
    link.run(15 * ms);
    std::set<std::uint64_t> sent;
    link.drops = [&](const CfdpPdu &pdu, bool) {
        EXPECT_TRUE(pdu.kind != CFDP_FILE_DATA || sent.insert(pdu.offset).second) << pdu.offset;
        return true;
    };
    std::uint8_t bytes[200], segments[200];
    CfdpPdu nak{};
    nak.kind = CFDP_NAK;
    nak.to_sender = 1;
    nak.source = id.source;
    nak.sequence = id.sequence;
    nak.destination = 2;
    nak.entity_bytes = 2;
    nak.sequence_bytes = 4;
    nak.data = segments;
    for (const auto &[begin, end] : std::initializer_list<std::pair<std::uint32_t, std::uint32_t>>{{8000, 9000},
                                                                                                   {1000, 3000},
                                                                                                   {5000, 6000},
                                                                                                   {2000, 5500},
                                                                                                   {500, 1000},
                                                                                                   {6000, 6500},
                                                                                                   {4000, 4000},
                                                                                                   {9000, 4}}) {
        ccsds_put32(segments + nak.n, begin);
        ccsds_put32(segments + nak.n + 4, end);
        nak.n += 8;
    }
    cfdp_take(&link.ground.cfdp, bytes, cfdp_pdu_write(&nak, bytes, sizeof bytes));
    const CfdpRange *ranges = link.ground.ranges.data();
    ASSERT_EQ(link.ground.transactions[0].ranges, 2u);
    EXPECT_EQ(std::tie(ranges[0].begin, ranges[0].end), std::make_tuple(500u, 6500u));
    EXPECT_EQ(std::tie(ranges[1].begin, ranges[1].end), std::make_tuple(8000u, 9000u));
    link.run(100 * ms);
    for (std::uint64_t offset = 500; offset < 6500; offset += 1000) {
        EXPECT_EQ(sent.count(offset), 1u);
    }
    EXPECT_EQ(sent.count(8000), 1u);
}

TEST(CfdpDefects, a_large_file_with_many_gaps_does_not_slow_down)
{
    // The processor's time of a file with three times as many gaps is about three times as long, not nine times.
    const auto time = [](std::uint32_t gaps) {
        Link link(1, 1, gaps + 1);
        std::set<std::uint64_t> lost;
        link.drops = [&lost](const CfdpPdu &pdu, bool) {
            return pdu.kind == CFDP_FILE_DATA && pdu.offset % 40 == 0 && lost.insert(pdu.offset).second;
        };
        link.ground.remote.segment = 20;
        link.craft.remote.segment = 1000;
        link.file(gaps * 40);
        link.ground.put("source", "target");
        const std::clock_t start = std::clock(); // of the processor: other programs may run beside
        link.finish();
        link.expect_whole();
        return static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    };
    double few = 1e9, many = 1e9;
    for (int i = 0; i < 4; i++) {
        few = std::min(few, time(3000));
        many = std::min(many, time(9000));
    }
    EXPECT_LT(many, 6 * few);
}

TEST(CfdpDefects, a_duplicate_eof_is_acknowledged_again)
{
    for (const bool ended : {false, true}) { // while the receiver misses data; after all has ended
        Link link;
        link.file(5000);
        Bytes eof;
        link.drops = [&](const CfdpPdu &pdu, bool) {
            if (pdu.kind == CFDP_EOF) {
                eof = Bytes(64);
                eof.resize(cfdp_pdu_write(&pdu, eof.data(), eof.size()));
            }
            return !ended && pdu.kind == CFDP_FILE_DATA && pdu.offset == 1000;
        };
        link.ground.put("source", "target");
        link.run(500 * ms);
        ASSERT_EQ(link.craft.busy(), !ended);
        const Bytes first = eof;
        if (ended) { // and others after it
            link.ground.put("", "");
            link.ground.put("", "");
            link.run(500 * ms);
        }
        eof = first;
        const int before = link.sent[CFDP_ACK];
        for (int i = 0; i < 3; i++) {
            cfdp_take(&link.craft.cfdp, eof.data(), eof.size());
        }
        link.run(10 * ms);
        EXPECT_EQ(link.sent[CFDP_ACK], before + 3);
        EXPECT_EQ(link.craft.busy(), !ended);
    }
}

TEST(CfdpDefects, three_hundred_files_in_a_row)
{
    Link link(3, 2);
    link.loss = 0.05;
    link.twice = 0.05;
    link.late = 0.1;
    link.tick = 5 * ms;
    link.ground.remote.ack_timer = link.craft.remote.ack_timer = link.craft.remote.nak_timer = 500 * ms;
    link.ground.remote.ack_limit = link.craft.remote.ack_limit = link.craft.remote.nak_limit = 30;
    link.file(3000);
    int files = 0;
    const auto next = [&] {
        if (files < 300) {
            files++;
            link.ground.put("source", "target" + std::to_string(files));
        }
    };
    link.ground.on_event = [&](const CfdpEvent &event) { // the next is put while the last one ends
        if (event.what == CFDP_TOLD_ENDED) {
            next();
        }
    };
    next();
    link.finish(3000 * s);
    EXPECT_EQ(files, 300);
    for (int i = 1; i <= 300; i++) {
        EXPECT_EQ(link.craft.memory.files["target" + std::to_string(i)], link.ground.memory.files["source"]);
    }
}

TEST(CfdpDefects, a_full_list_of_gaps_loses_nothing)
{
    for (const bool immediate : {false, true}) {
        for (const std::uint32_t gaps : {1u, 2u, 5u}) {
            Link link(gaps, 1, gaps);
            link.loss = 0.2;
            link.late = 0.3;
            link.craft.remote.immediate = immediate;
            link.craft.remote.nak_timer = 300 * ms;
            link.craft.remote.nak_limit = link.craft.remote.ack_limit = link.ground.remote.ack_limit = 50;
            link.file(100000);
            link.ground.put("source", "target");
            link.finish();
            link.expect_whole();
            EXPECT_GT(link.craft.cfdp.live.faults[CCSDS_ROOM], 0u);
        }
    }
}

// ---- outages and resets

TEST(CfdpOutage, a_frozen_link_stops_the_clocks_of_both_ends)
{
    Link link;
    link.file(300000);
    link.ground.put("source", "target");
    link.run(150 * ms);
    link.ground.remote.frozen = link.craft.remote.frozen = 1;
    link.drops = [](const CfdpPdu &, bool) { return true; };
    link.run(3600 * s / 10);
    EXPECT_EQ(link.ground.told.size() + link.craft.told.size(), 1u);
    link.ground.remote.frozen = link.craft.remote.frozen = 0;
    link.drops = nullptr;
    link.finish();
    link.expect_whole();
}

TEST(CfdpOutage, suspended_over_an_outage)
{
    for (const Clock when : {110 * ms, 290 * ms, 350 * ms, 410 * ms}) {
        Link link;
        link.file(300000);
        const CfdpId id = link.ground.put("source", "target");
        link.run(when);
        EXPECT_EQ(cfdp_suspend(&link.ground.cfdp, id), 1);
        EXPECT_EQ(cfdp_suspend(&link.craft.cfdp, id), 1);
        link.drops = [](const CfdpPdu &, bool) { return true; };
        link.run(200 * s);
        link.drops = nullptr;
        cfdp_resume(&link.ground.cfdp, id);
        cfdp_resume(&link.craft.cfdp, id);
        link.finish();
        link.expect_whole();
    }
}

/// What a program keeps over a reset.
struct Kept {
    CfdpLive live;
    std::vector<CfdpTransaction> transactions;
    std::vector<CfdpRange> ranges;
    std::vector<CfdpPast> past;
    std::map<std::string, Bytes> files;

    explicit Kept(const End &end)
        : live(end.cfdp.live), transactions(end.transactions), ranges(end.ranges), past(end.past),
          files(end.memory.files)
    {
    }
    void restore(End &end, Clock now) const
    {
        end.memory.opened.clear();
        end.begin(1);
        end.cfdp.live = live;
        std::copy(transactions.begin(), transactions.end(), end.transactions.begin());
        std::copy(ranges.begin(), ranges.end(), end.ranges.begin());
        std::copy(past.begin(), past.end(), end.past.begin());
        cfdp_restart(&end.cfdp, now);
    }
};

TEST(CfdpReset, an_end_that_kept_its_memory_goes_on)
{
    for (const bool of_craft : {false, true}) {
        for (Clock when = 10 * ms; when < 900 * ms; when += 40 * ms) {
            SCOPED_TRACE(when / ms);
            Link link(static_cast<std::uint32_t>(when / ms));
            link.loss = 0.02;
            link.file(300000);
            link.ground.put("source", "target");
            link.run(when);
            End &end = of_craft ? link.craft : link.ground;
            const Kept kept(end);
            link.run(20 * ms); // the memory is a little older than the reset
            kept.restore(end, link.now);
            link.finish();
            ASSERT_TRUE(link.craft.memory.has("target"));
            EXPECT_EQ(link.craft.memory.files["target"], link.ground.memory.files["source"]);
        }
    }
}

TEST(CfdpReset, a_clock_that_begins_anew_moves_the_timers)
{
    Link link;
    link.craft.remote.keep_alive = 10 * s;
    link.file(300000);
    link.ground.put("source", "target");
    link.run(200 * ms);
    const Kept kept(link.craft);
    const CfdpTransaction before = link.craft.transactions[0];
    kept.restore(link.craft, 5);
    const CfdpTransaction &now = link.craft.transactions[0];
    EXPECT_EQ(now.inactive - 5, before.inactive - link.now);
    EXPECT_EQ(now.keep_alive - 5, before.keep_alive - link.now);
    EXPECT_EQ(now.expires, INT64_MAX); // it does not run
}

TEST(CfdpReset, a_file_that_lost_bytes_in_the_reset_is_not_delivered)
{
    for (const int what : {0, 1, 2}) {
        Link link;
        link.file(300000);
        link.ground.put("source", "target");
        link.run(250 * ms);
        const Kept kept(link.craft);
        Bytes &file = link.craft.memory.files.begin()->second;
        ASSERT_GT(file.size(), 100000u);
        if (what == 0) {
            file[5000] ^= 1;
        } else if (what == 1) {
            file.resize(5000);
        } else {
            link.craft.memory.files.clear();
        }
        kept.restore(link.craft, link.now);
        link.finish();
        link.expect_none(what == 0 ? CFDP_CHECKSUM_FAILURE : CFDP_FILESTORE_REJECTION);
    }
}

TEST(CfdpReset, an_end_that_kept_nothing_hangs_nothing_and_delivers_nothing_wrong)
{
    for (const bool of_craft : {false, true}) {
        for (Clock when = 10 * ms; when < 1000 * ms; when += 30 * ms) {
            SCOPED_TRACE(when / ms);
            Link link(static_cast<std::uint32_t>(when / ms));
            link.loss = 0.02;
            link.file(300000);
            link.ground.put("source", "target");
            link.run(when);
            End &end = of_craft ? link.craft : link.ground;
            const bool before = link.craft.memory.has("target");
            end.memory.opened.clear();
            end.begin(1000); // another sequence number than before
            cfdp_time(&end.cfdp, link.now);
            link.ground.memory.files["second"] = any_bytes(link.random, 50000);
            link.ground.put("second", "other");
            while (link.ground.busy() || link.craft.busy()) {
                ASSERT_LT(link.now, 1000 * s) << "a transaction hangs";
                link.step();
            }
            EXPECT_EQ(link.craft.memory.files["other"], link.ground.memory.files["second"]);
            if (before || link.craft.memory.has("target")) {
                EXPECT_EQ(link.craft.memory.files["target"], link.ground.memory.files["source"]);
            }
            std::size_t left = 0; // an unfinished file may be left: at most one for each place
            for (const auto &[name, bytes] : link.craft.memory.files) {
                left += name[0] == '.';
            }
            EXPECT_LE(left, link.craft.transactions.size());
        }
    }
}

// ---- peers that misbehave, and stores that refuse

TEST(CfdpHostile, a_full_store_refuses_and_may_go_on_when_there_is_room)
{
    for (const std::uint8_t handler : {CFDP_CANCEL, CFDP_SUSPEND}) {
        Link link;
        link.craft.memory.capacity = 20000;
        link.craft.remote.handlers[CFDP_FILESTORE_REJECTION] = handler;
        link.file(50000);
        const CfdpId id = link.ground.put("source", "target");
        if (handler == CFDP_CANCEL) {
            link.finish();
            link.expect_none(CFDP_FILESTORE_REJECTION);
            EXPECT_EQ(link.ground.ended()->file_status, CFDP_REJECTED);
        } else {
            link.run(5 * s);
            EXPECT_TRUE(link.craft.busy());
            link.craft.memory.capacity = SIZE_MAX;
            EXPECT_EQ(cfdp_resume(&link.craft.cfdp, id), 1);
            link.finish();
            link.expect_whole();
        }
    }
}

TEST(CfdpHostile, names_that_are_not_allowed)
{
    for (const std::string name : {"../target", "/target", ".cfdp3", ".cfdp"}) {
        Link link;
        link.file(100);
        link.ground.put("source", name);
        link.finish();
        link.expect_none(CFDP_FILESTORE_REJECTION);
        EXPECT_TRUE(link.craft.memory.files.empty());
    }
}

TEST(CfdpHostile, transactions_that_never_end_give_their_places_back)
{
    Link link(1, 4);
    CfdpPdu pdu{};
    pdu.kind = CFDP_FILE_DATA;
    pdu.source = 1;
    pdu.destination = 2;
    pdu.entity_bytes = pdu.sequence_bytes = 2;
    const Bytes data(10);
    pdu.data = data.data();
    pdu.n = data.size();
    std::uint8_t bytes[64];
    for (pdu.sequence = 500; pdu.sequence < 520; pdu.sequence++) {
        cfdp_take(&link.craft.cfdp, bytes, cfdp_pdu_write(&pdu, bytes, sizeof bytes));
    }
    EXPECT_EQ(link.craft.cfdp.live.faults[CCSDS_ROOM], 16u);
    link.file(5000);
    link.ground.put("source", "target"); // finds no place, until one of those has been silent for some time
    link.run(link.craft.remote.inactivity / 4);
    EXPECT_EQ(link.craft.memory.files["target"], link.ground.memory.files["source"]);
    link.finish(); // the others end by inactivity
}

TEST(CfdpHostile, pdus_of_others_are_counted)
{
    Link link;
    CfdpPdu pdu{};
    pdu.kind = CFDP_EOF;
    pdu.source = 1;
    pdu.destination = 2;
    pdu.sequence = 77;
    pdu.entity_bytes = pdu.sequence_bytes = 2;
    std::uint8_t bytes[64];
    const auto take = [&] { cfdp_take(&link.craft.cfdp, bytes, cfdp_pdu_write(&pdu, bytes, sizeof bytes)); };
    const auto &faults = link.craft.cfdp.live.faults;
    pdu.destination = 3;
    take();
    EXPECT_EQ(faults[CCSDS_SPACECRAFT], 1u);
    pdu.destination = 2;
    pdu.source = 9;
    take();
    EXPECT_EQ(faults[CCSDS_CHANNEL], 1u);
    pdu.source = 1;
    pdu.condition = CFDP_CANCEL_REQUEST; // of a transaction that is not known: acknowledged as such
    take();
    EXPECT_EQ(faults[CCSDS_STRAY], 1u);
    Bytes answer(2000);
    const std::size_t n = cfdp_next(&link.craft.cfdp, nullptr, answer.data(), answer.size());
    CfdpPdu ack{};
    ASSERT_EQ(cfdp_pdu_read(&ack, answer.data(), n), CCSDS_OK);
    EXPECT_EQ(ack.kind, CFDP_ACK);
    EXPECT_EQ(ack.status, CFDP_UNRECOGNIZED);
    EXPECT_FALSE(link.craft.busy());
    // A flood of them fills the queue of acknowledgements, and is counted.
    for (int i = 0; i < 40; i++) {
        take();
    }
    EXPECT_EQ(faults[CCSDS_ROOM], 40u - CFDP_ANSWERS);
    EXPECT_EQ(cfdp_next(&link.craft.cfdp, nullptr, answer.data(), CFDP_ROOM - 1), 0u);
}

/// PDUs of both ends are damaged, replayed and made up, while files go on; the sanitizers watch. Whatever arrives is
/// whole: PDUs have a CRC. FLEDGE_CFDP_ROUNDS sets how many.
TEST(CfdpHostile, a_peer_that_answers_with_garbage)
{
    const char *asked = std::getenv("FLEDGE_CFDP_ROUNDS");
    const std::uint32_t rounds = asked != nullptr ? static_cast<std::uint32_t>(std::atol(asked)) : 40;
    std::uint32_t arrived = 0, refused = 0;
    for (std::uint32_t seed = 1; seed <= rounds; seed++) {
        Link link(seed, 3, 4);
        link.ground.remote.inactivity = link.craft.remote.inactivity = 20 * s;
        link.ground.remote.crc = link.craft.remote.crc = 1;
        link.ground.remote.immediate = link.craft.remote.immediate = seed % 2;
        link.craft.remote.handlers[1 + seed % 10] = static_cast<std::uint8_t>(1 + seed % 4);
        link.tick = 10 * ms;
        link.loss = 0.05;
        std::vector<Bytes> old;
        for (int file = 0; file < 2; file++) {
            link.ground.memory.files["f" + std::to_string(file)] = any_bytes(link.random, 20000);
            const Bytes options = joined({request(CFDP_DENY_FILE, "none"), message(CFDP_LIST, "", "names")});
            link.ground.put("f" + std::to_string(file), "f" + std::to_string(file), 0, options);
        }
        for (int i = 0; i < 4000; i++) {
            link.step();
            for (auto &[at, one] : link.flying) {
                if (at == link.now + link.delay) {
                    old.push_back(one.bytes);
                }
            }
            Bytes bytes = old.empty() || link.random() % 4 == 0 ? any_bytes(link.random, link.random() % 100)
                                                                : old[link.random() % old.size()];
            CfdpPdu pdu{};
            if (link.random() % 2 == 0 && cfdp_pdu_read(&pdu, bytes.data(), bytes.size()) == CCSDS_OK) {
                // A valid PDU with wrong contents, of another transaction, so that the files are not touched.
                pdu.sequence = 100 + link.random() % 3;
                pdu.offset = link.random() % 3 == 0 ? link.random() : pdu.offset;
                pdu.condition = static_cast<std::uint8_t>(link.random() % 16);
                pdu.unacknowledged = link.random() % 5 == 0;
                Bytes changed(2000);
                changed.resize(cfdp_pdu_write(&pdu, changed.data(), changed.size()));
                bytes = std::move(changed);
            } else if (!bytes.empty() && link.random() % 2 == 0) {
                bytes[link.random() % bytes.size()] ^= static_cast<std::uint8_t>(1 + link.random() % 255);
            }
            bytes.shrink_to_fit();
            cfdp_take(&(link.random() % 2 == 0 ? link.craft : link.ground).cfdp, bytes.data(), bytes.size());
        }
        const Clock stop = link.now + 2000 * s;
        for (const CfdpTransaction &one : link.craft.transactions) { // suspended by their handler
            cfdp_cancel(&link.craft.cfdp, one.id);
        }
        while (link.ground.busy() || link.craft.busy()) {
            ASSERT_LT(link.now, stop) << "a transaction hangs, seed " << seed;
            link.step();
            for (const CfdpTransaction &one : link.craft.transactions) {
                if (one.suspended != 0) {
                    cfdp_cancel(&link.craft.cfdp, one.id);
                }
            }
        }
        for (const std::string file : {"f0", "f1"}) {
            if (link.craft.memory.has(file)) {
                arrived++;
                EXPECT_EQ(link.craft.memory.files[file], link.ground.memory.files[file]);
            }
        }
        refused += link.craft.cfdp.live.faults[CCSDS_CRC];
    }
    EXPECT_GT(arrived, rounds / 2);
    EXPECT_GT(refused, rounds);
}

// ---- through files of POSIX

TEST(CfdpStore, files_requests_and_lists_in_folders)
{
    const Folder folder;
    PosixStore posix[2];
    Link link;
    link.loss = 0.02;
    for (End *end : {&link.ground, &link.craft}) {
        const std::filesystem::path own = folder.path / std::to_string(end->entity);
        std::filesystem::create_directory(own);
        ASSERT_EQ(posix_store_open(&posix[end->entity - 1], own.c_str(), 1 << 30, &end->store), 1);
        end->begin(1);
    }
    const Bytes bytes = any_bytes(link.random, 123456);
    std::ofstream(folder.path / "1/source", std::ios::binary)
        .write(reinterpret_cast<const char *>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    link.ground.put("", "", 0, request(CFDP_CREATE_DIRECTORY, "new"));
    link.finish();
    link.ground.put("source", "new/target", 0, request(CFDP_CREATE_FILE, "empty"));
    link.finish();
    std::ifstream read(folder.path / "2/new/target", std::ios::binary);
    EXPECT_EQ(Bytes(std::istreambuf_iterator<char>(read), {}), bytes);
    link.ground.put("", "", 0, message(CFDP_LIST, "", "names"));
    link.ground.put("", "", 0, message(CFDP_LIST, "new", "new names"));
    link.finish();
    const auto text = [&](const char *name) {
        std::ifstream file(folder.path / name);
        std::set<std::string> lines;
        for (std::string line; std::getline(file, line);) {
            lines.insert(line);
        }
        return lines;
    };
    EXPECT_EQ(text("1/names"), (std::set<std::string>{"new/", "empty"}));
    EXPECT_EQ(text("1/new names"), (std::set<std::string>{"target"}));
    for (const auto &entry : std::filesystem::recursive_directory_iterator(folder.path)) {
        EXPECT_NE(entry.path().filename().string()[0], '.') << entry.path();
    }
    for (PosixStore &one : posix) {
        posix_store_close(&one);
    }
}

} // namespace cfdp_test
