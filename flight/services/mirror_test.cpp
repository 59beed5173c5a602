// SPDX-License-Identifier: Apache-2.0
// Files outlive resets of the computer in a recorder that is slow, loses bits, wears out and loses its power.
#include "flight/services/mirror.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <random>
#include <set>
#include <string>
#include <vector>

namespace mirror_test {

using Bytes = std::vector<std::uint8_t>;
constexpr std::uint32_t pages = 16;

/// A recorder as flight sees it: world/avionics/recorder_model_test.cpp tests the real one.
struct Unit {
    std::vector<Bytes> memory{pages, Bytes(RECORDER_PAGE)};
    std::set<std::uint32_t> damaged{}, worn{}, corrected{};
    std::uint32_t busy = 0, late = 0; // [updates] left, and that each request takes
    RecorderRequest serving{};
    RecorderReply reply{};

    Unit() { reply.pages = pages; }

    void update(const RecorderRequest &request)
    {
        reply.head.quality = QUALITY_GOOD;
        reply.head.sequence++;
        if (busy == 0 && request.code != RECORDER_NOTHING && request.number != reply.number) {
            serving = request;
            busy = late + 1;
        }
        if (busy > 0 && --busy == 0) {
            reply.number = serving.number;
            reply.page = serving.page;
            reply.answer = RECORDER_DONE;
            std::fill(std::begin(reply.data), std::end(reply.data), std::uint8_t{0});
            if (serving.code == RECORDER_READ && damaged.count(serving.page) != 0) {
                reply.answer = RECORDER_DAMAGED;
            } else if (serving.code == RECORDER_READ) {
                reply.answer = corrected.count(serving.page) != 0 ? RECORDER_CORRECTED : RECORDER_DONE;
                std::copy(memory[serving.page].begin(), memory[serving.page].end(), reply.data);
            } else if (worn.count(serving.page) != 0) {
                reply.answer = RECORDER_WORN;
            } else {
                std::copy(std::begin(serving.data), std::end(serving.data), memory[serving.page].begin());
                reply.used = std::max(reply.used, serving.page + 1);
            }
        }
    }
};

struct Computer {
    Unit &unit;
    Mirror mirror{};
    RecorderRequest request{};
    std::vector<std::uint64_t> block = std::vector<std::uint64_t>(MEMORY_STORE_BYTES(pages) / 8);

    explicit Computer(Unit &recorder) : unit(recorder) { memory_store_begin(store(), block.size() * 8); }
    MemoryStore *store() { return reinterpret_cast<MemoryStore *>(block.data()); }
    void update(int n = 1)
    {
        while (n-- > 0) {
            mirror_update(&mirror, store(), &unit.reply, &request, Tick{});
            unit.update(request);
        }
    }
    void settle()
    {
        int n = 0;
        do {
            update();
        } while (++n < 1000 && (store()->mounted == 0 || mirror.left != 0 || mirror.waits != 0));
        EXPECT_EQ(mirror.left, 0u);
    }
    int put(const std::string &name, const Bytes &bytes)
    {
        const CfdpStore files = memory_store_files(store());
        const int file = files.open(files.user, name.c_str(), CFDP_OPEN_NEW);
        return file < 0 ? file : files.write(files.user, file, 0, bytes.data(), bytes.size());
    }
    Bytes get(const std::string &name)
    {
        const CfdpStore files = memory_store_files(store());
        const int file = files.open(files.user, name.c_str(), CFDP_OPEN_READ);
        Bytes bytes(file < 0 ? 0 : static_cast<std::size_t>(files.size(files.user, file)));
        EXPECT_EQ(file < 0 ? 0 : files.read(files.user, file, 0, bytes.data(), bytes.size()), 0);
        return file < 0 ? Bytes{} : bytes;
    }
};

Bytes any_bytes(std::mt19937 &random, std::size_t n)
{
    Bytes bytes(n);
    std::generate(bytes.begin(), bytes.end(), [&] { return static_cast<std::uint8_t>(random()); });
    return bytes;
}

TEST(Mirror, FilesOutliveResetsAtAnyTime)
{
    std::mt19937 random(1);
    Unit unit;
    unit.update({});
    std::map<std::string, std::set<Bytes>> ever{{"a", {{}}}, {"b", {{}}}, {"c", {{}}}};
    std::map<std::string, Bytes> kept{{"a", {}}, {"b", {}}, {"c", {}}};
    int resets = 0, whole = 0;
    for (int run = 0; run < 200; run++) {
        Computer c(unit);
        EXPECT_EQ(c.put("a", {1}), CFDP_BROKEN) << "its pages are not back yet";
        unit.late = random() % 3;
        c.settle();
        for (auto &[name, bytes] : kept) {
            const Bytes found = c.get(name);
            EXPECT_EQ(ever[name].count(found), 1u) << name;
            whole += found == bytes;
        }
        for (unsigned n = random() % 4; n-- > 0;) {
            const std::string name(1, static_cast<char>('a' + random() % 3));
            const Bytes bytes = any_bytes(random, random() % 700);
            const CfdpStore files = memory_store_files(c.store());
            if (c.put(".new", bytes) == 0 && files.rename(files.user, ".new", name.c_str()) == 0) {
                ever[name].insert(bytes);
            }
            c.update(static_cast<int>(random() % 12));
        }
        if (random() % 2) {
            c.settle(); // else the reset comes while pages wait
        } else {
            resets++;
        }
        for (auto &[name, bytes] : kept) {
            bytes = c.get(name);
        }
    }
    EXPECT_GT(resets, 50);
    EXPECT_GT(whole, 450);
}

TEST(Mirror, AllThatSettledIsThereAfterAReset)
{
    std::mt19937 random(2);
    Unit unit;
    unit.late = 2;
    std::map<std::string, Bytes> files;
    for (int run = 0; run < 50; run++) {
        Computer c(unit);
        c.settle();
        for (const auto &[name, bytes] : files) {
            EXPECT_EQ(c.get(name), bytes);
        }
        const std::string name(1, static_cast<char>('a' + random() % 3));
        files[name] = any_bytes(random, random() % 1000);
        EXPECT_EQ(c.put(name, files[name]), 0);
        c.settle();
        EXPECT_EQ(c.store()->lost + c.mirror.damaged + c.mirror.worn, 0u);
    }
}

TEST(Mirror, OnlyWhatWasEverWrittenIsReadBack)
{
    Unit unit;
    unit.update({});
    Computer c(unit);
    c.update();
    EXPECT_EQ(c.store()->mounted, 1u) << "nothing was";
    c.put("a", Bytes(2 * MEMORY_DATA));
    c.settle();
    Computer after(unit);
    after.update();
    EXPECT_EQ(after.mirror.left, 3u);
    after.update(3);
    EXPECT_EQ(after.store()->mounted, 1u);
    EXPECT_EQ(after.store()->free, pages - 3);
}

TEST(Mirror, AnOldRequestThatIsStillUnderWayIsNotTakenForANewOne)
{
    Unit unit;
    unit.update({});
    unit.late = 5;
    Computer before(unit);
    before.settle();
    before.put("a", Bytes(500, 7));
    before.settle();
    before.put("a", Bytes(500, 8));
    before.update(3); // the first page of the new content is being written
    Computer after(unit);
    after.settle();
    const Bytes found = after.get("a");
    EXPECT_TRUE(found.empty() || found == Bytes(500, 7));
    EXPECT_EQ(after.mirror.damaged, 0u);
}

TEST(Mirror, GoesOnWhenFlightIsResetAndItsMemoryStays)
{
    for (int when = 1; when < 40; when++) {
        Unit unit;
        unit.late = 3;
        unit.update({});
        Computer c(unit);
        c.update(when % 7);
        c.request = {};
        c.settle();
        EXPECT_EQ(c.put("a", Bytes(1000, 9)), 0);
        c.update(when);
        c.request = {};
        c.settle();
        Computer after(unit);
        after.update(when % 7); // while its pages come back, too
        after.request = {};
        after.settle();
        EXPECT_EQ(after.get("a"), Bytes(1000, 9)) << when;
    }
}

TEST(Mirror, PagesThatAreDamagedOrWornCostTheirFilesOrNone)
{
    std::mt19937 random(3);
    Unit unit;
    Computer c(unit);
    c.settle();
    const Bytes a = any_bytes(random, 700), b = any_bytes(random, 900);
    EXPECT_EQ(c.put("a", a), 0);
    c.settle();
    unit.worn = {4, 5, 6};
    EXPECT_EQ(c.put("b", b), 0); // in pages 4 to 8
    c.settle();
    EXPECT_EQ(c.mirror.worn, 3u);
    EXPECT_EQ(c.store()->free, pages - 4 - 5 - 3);
    Computer again(unit);
    again.settle();
    EXPECT_EQ(again.get("a"), a);
    EXPECT_EQ(again.get("b"), b);
    unit.corrected = {1, 2};
    Computer mended(unit);
    mended.settle();
    EXPECT_EQ(mended.get("a"), a);
    EXPECT_EQ(mended.mirror.damaged, 0u);
    unit.damaged = {2};
    Computer third(unit);
    third.settle();
    EXPECT_EQ(third.mirror.damaged, 1u);
    EXPECT_EQ(third.store()->lost, 1u);
    EXPECT_EQ(third.get("a"), Bytes{});
    EXPECT_EQ(third.get("b"), b);
}

TEST(Mirror, WaitsForARecorderWithoutPowerAndUsesOnlyThePagesItHas)
{
    Unit unit;
    unit.reply.pages = 0;
    Computer c(unit);
    c.update(20);
    EXPECT_EQ(c.store()->mounted, 0u);
    EXPECT_EQ(c.request.code, RECORDER_NOTHING);
    unit.reply.pages = 5;
    c.settle();
    EXPECT_EQ(c.store()->free, 5u);
    EXPECT_EQ(c.put("a", Bytes(5 * MEMORY_DATA)), CFDP_FULL);
    EXPECT_EQ(c.put("a", Bytes(4 * MEMORY_DATA)), 0);
    c.settle();
    EXPECT_EQ(c.mirror.worn, 0u);
}

} // namespace mirror_test
