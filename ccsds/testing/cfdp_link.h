// SPDX-License-Identifier: Apache-2.0
// Entities of CFDP at both ends of a link that loses, repeats, reorders and delays, in simulated time.
#ifndef CCSDS_TESTING_CFDP_LINK_H
#define CCSDS_TESTING_CFDP_LINK_H

#include "ccsds/cfdp.h"
#include "ccsds/testing/bits.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>

namespace ccsds::testing {

using Clock = std::int64_t; // [ns]

constexpr Clock ms = 1'000'000, s = 1000 * ms;

/// Files in memory.
struct Memory {
    std::map<std::string, Bytes> files{};
    std::set<std::string> directories{};
    std::map<int, std::string> opened{};
    std::size_t capacity = SIZE_MAX; // [bytes] of all files
    int next = 0;
    std::set<std::string> shown{};      // every name that a finished file ever had
    std::map<std::string, int> fails{}; // by function: from which call on, from 1

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
    bool breaks(const std::string &function)
    {
        const auto found = fails.find(function);
        return found != fails.end() && --found->second <= 0;
    }

    CfdpStore store()
    {
        CfdpStore made{};
        made.user = this;
        made.open = [](void *user, const char *name, CfdpOpen how) -> int {
            Memory &self = of(user);
            const std::string file = name;
            if (self.breaks("open")) {
                return CFDP_BROKEN;
            }
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
            return of(user).breaks("size") ? std::int64_t{CFDP_BROKEN}
                                           : static_cast<std::int64_t>(of(user).files[of(user).opened.at(file)].size());
        };
        made.read = [](void *user, int file, std::uint64_t offset, std::uint8_t *bytes, std::size_t n) -> int {
            const Bytes &all = of(user).files[of(user).opened.at(file)];
            if (of(user).breaks("read") || offset + n > all.size()) {
                return CFDP_BROKEN;
            }
            std::copy_n(all.data() + offset, n, bytes);
            return 0;
        };
        made.write = [](void *user, int file, std::uint64_t offset, const std::uint8_t *bytes, std::size_t n) -> int {
            Bytes &all = of(user).files[of(user).opened.at(file)];
            const std::size_t end = std::max<std::size_t>(all.size(), offset + n);
            if (of(user).breaks("write") || end > (1u << 28) ||
                of(user).used() - all.size() + end > of(user).capacity) {
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
            if (self.breaks("rename") || !self.has(from) || *to == '/' ||
                std::string(to).find("..") != std::string::npos) {
                return CFDP_REFUSED;
            }
            Bytes bytes = std::move(self.files[from]);
            self.files.erase(from);
            self.files[to] = std::move(bytes);
            self.shown.insert(to);
            return 0;
        };
        made.remove = [](void *user, const char *name) -> int {
            return of(user).breaks("remove") ? CFDP_BROKEN : of(user).files.erase(name) != 0 ? 0 : CFDP_ABSENT;
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

struct Event {
    CfdpEventKind what;
    CfdpId id;
    int receiver, condition, incomplete, file_status;
    std::uint64_t progress, size;
    std::string to;
    Bytes text;
};

/// An entity with its memory, a store and the events of which it notifies its user.
struct End {
    Memory memory{};
    CfdpRemote remote{};
    std::vector<CfdpTransaction> transactions;
    std::vector<CfdpRange> ranges;
    std::vector<CfdpPast> past = std::vector<CfdpPast>(100);
    Bytes work = Bytes(4096);
    std::vector<Event> events{};
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
        setup.notify = [](void *user, const CfdpEvent *event) {
            End &self = *static_cast<End *>(user);
            self.events.push_back({event->what, event->id, event->receiver, event->condition, event->incomplete,
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
        CfdpPut request{};
        request.destination = remote.entity;
        request.from = from.c_str();
        request.to = to.c_str();
        request.options = options.data();
        request.options_n = options.size();
        request.class1 = static_cast<std::uint8_t>(class1);
        request.closure = static_cast<std::uint8_t>(closure);
        request.priority = priority;
        CfdpId id{};
        EXPECT_EQ(cfdp_put(&cfdp, &request, &id), 0);
        return id;
    }
    bool busy() const
    {
        return cfdp.live.answers_n != 0 ||
               std::any_of(transactions.begin(), transactions.end(),
                           [](const auto &transaction) { return transaction.state != CFDP_FREE; });
    }
    /// How the last transaction ended; nothing, if none did.
    std::optional<Event> ended() const
    {
        for (auto event = events.rbegin(); event != events.rend(); event++) {
            if (event->what == CFDP_EVENT_ENDED || event->what == CFDP_EVENT_ABANDONED) {
                return *event;
            }
        }
        return std::nullopt;
    }
    std::ptrdiff_t count(CfdpEventKind what, int condition = -1) const
    {
        return std::count_if(events.begin(), events.end(), [&](const Event &event) {
            return event.what == what && (condition < 0 || event.condition == condition);
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
            const Flying packet = std::move(flying.begin()->second);
            flying.erase(flying.begin());
            cfdp_take(&(packet.up ? craft : ground).cfdp, packet.bytes.data(), packet.bytes.size());
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
inline std::function<bool(const CfdpPdu &, bool)> lose(int kind, int nth = 1, int acknowledged = 0)
{
    auto count = std::make_shared<int>(0);
    return [=](const CfdpPdu &pdu, bool) {
        return pdu.kind == kind && (acknowledged == 0 || pdu.acknowledged == acknowledged) && ++*count == nth;
    };
}

// ---- options of a transaction

inline Bytes request(CfdpAction action, const std::string &first, const std::string &second = "")
{
    CfdpFilestore fields{};
    fields.action = action;
    fields.first = {reinterpret_cast<const std::uint8_t *>(first.data()), static_cast<std::uint8_t>(first.size())};
    fields.second = {reinterpret_cast<const std::uint8_t *>(second.data()), static_cast<std::uint8_t>(second.size())};
    Bytes bytes(600);
    bytes.resize(cfdp_filestore_write(&fields, bytes.data(), bytes.size()));
    return bytes;
}

inline Bytes message(std::uint8_t type, const std::string &first = "", const std::string &second = "",
                     std::uint64_t entity = 0, std::uint8_t value = 0)
{
    CfdpMessage fields{};
    fields.type = type;
    fields.first = {reinterpret_cast<const std::uint8_t *>(first.data()), static_cast<std::uint8_t>(first.size())};
    fields.second = {reinterpret_cast<const std::uint8_t *>(second.data()), static_cast<std::uint8_t>(second.size())};
    fields.entity = entity;
    fields.entity_bytes = 2;
    fields.sequence_bytes = 4;
    fields.value = value;
    Bytes bytes(600);
    bytes.resize(cfdp_message_write(&fields, bytes.data(), bytes.size()));
    return bytes;
}

inline Bytes joined(std::initializer_list<Bytes> parts)
{
    Bytes all;
    for (const Bytes &part : parts) {
        all.insert(all.end(), part.begin(), part.end());
    }
    return all;
}

} // namespace ccsds::testing

#endif
