// SPDX-License-Identifier: Apache-2.0
// A store in memory does what one in a folder does; a copy of its pages, torn or damaged, has files that are right or
// none.
#include "ccsds/store/memory_store.h"
#include "ccsds/store/posix_store.h"
#include "ccsds/testing/bits.h"
#include "ccsds/testing/folder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <functional>
#include <map>
#include <optional>
#include <set>

namespace memory_store_test {

using namespace ccsds::testing;

struct Disk {
    std::vector<std::uint64_t> block;
    explicit Disk(std::uint32_t pages) : block(MEMORY_STORE_BYTES(pages) / 8)
    {
        memory_store_begin(store(), block.size() * 8);
        EXPECT_EQ(store()->pages, pages);
        memory_store_mount(store());
    }
    MemoryStore *store() { return reinterpret_cast<MemoryStore *>(block.data()); }
    CfdpStore files() { return memory_store_files(store()); }
    int dirty()
    {
        std::uint32_t n = 0;
        const int page = memory_store_dirty(store(), &n);
        EXPECT_EQ(n == 0, page < 0);
        return page;
    }
    std::uint8_t *page(std::uint32_t i) { return memory_store_page(store(), i); }
};

int put(const CfdpStore &files, const std::string &name, const Bytes &bytes)
{
    const int file = files.open(files.user, name.c_str(), CFDP_OPEN_NEW);
    return file < 0 ? file : files.write(files.user, file, 0, bytes.data(), bytes.size());
}

std::optional<Bytes> get(const CfdpStore &files, const std::string &name)
{
    const int file = files.open(files.user, name.c_str(), CFDP_OPEN_READ);
    Bytes bytes(file < 0 ? 0 : static_cast<std::size_t>(std::max<std::int64_t>(files.size(files.user, file), 0)));
    const bool good = file >= 0 && files.read(files.user, file, 0, bytes.data(), bytes.size()) == 0;
    if (file >= 0) {
        files.close(files.user, file);
    }
    return good ? std::optional(bytes) : std::nullopt;
}

int note(void *to, const char *name)
{
    static_cast<std::vector<std::string> *>(to)->emplace_back(name);
    return 0;
}

using Content = std::map<std::string, Bytes>; // of files, and "/" behind directories

Content content(const CfdpStore &files, const std::string &directory = "")
{
    Content found;
    std::vector<std::string> lines;
    EXPECT_EQ(files.list(files.user, directory.c_str(), note, &lines), 0) << directory;
    for (const std::string &line : lines) {
        const std::string name = (directory.empty() ? "" : directory + "/") + line;
        if (name.back() == '/') {
            found[name] = {};
            found.merge(content(files, name.substr(0, name.size() - 1)));
        } else {
            found[name] = get(files, name).value();
        }
    }
    return found;
}

std::string any_name(std::mt19937 &random)
{
    static const char *const names[] = {"a", "b",  "c",    "d",  "d/a", "d/b",  "d/e", "d/e/f", "e/a",    "e",  ".h",
                                        "",  "..", "../a", "/a", "d/",  "d//a", "./a", "d/.",   "none/a", "a/b"};
    return names[random() % std::size(names)];
}

TEST(MemoryStore, DoesWhatAFolderDoes)
{
    constexpr std::uint32_t pages = 18;
    std::mt19937 random(1);
    std::size_t full = 0, done = 0, refused = 0;
    for (int run = 0; run < 20; run++) {
        const Folder folder;
        PosixStore posix{};
        CfdpStore oracle{};
        ASSERT_EQ(posix_store_open(&posix, folder.path.c_str(), 1 << 20, &oracle), 1);
        Disk disk(pages);
        std::map<int, int> handles;                        // of the store in memory to the other's
        const auto forget = [&](const std::string &name) { // a folder keeps files that are open, memory does not
            const int gone = disk.files().open(disk.store(), name.c_str(), CFDP_OPEN_READ);
            for (auto i = handles.begin(); i != handles.end();) {
                if (gone >= 0 && i->first >> 1 == gone >> 1) {
                    oracle.close(oracle.user, i->second);
                    i = handles.erase(i);
                } else {
                    ++i;
                }
            }
        };
        for (int step = 0; step < 400; step++) {
            const CfdpStore files = disk.files();
            const std::string name = any_name(random), other = any_name(random);
            const std::string what = name + " " + other + " " + std::to_string(step);
            int found = 0, expected = 0;
            switch (random() % 8) {
            case 0: {
                const auto how = static_cast<CfdpOpen>(random() % 3);
                found = files.open(files.user, name.c_str(), how);
                if (found == CFDP_FULL) {
                    EXPECT_EQ(disk.store()->free, 0u);
                    full++;
                    continue;
                }
                expected = oracle.open(oracle.user, name.c_str(), how);
                EXPECT_EQ(found < 0 ? found : 0, expected < 0 ? expected : 0) << "open " << what;
                if (found >= 0 && handles.count(found) == 0) {
                    handles[found] = expected;
                } else if (found >= 0) {
                    oracle.close(oracle.user, expected);
                }
                continue;
            }
            case 1:
            case 2:
                if (!handles.empty()) {
                    const auto [mine, its] = *std::next(handles.begin(), random() % handles.size());
                    const Bytes bytes = any_bytes(random, 1 + random() % 700);
                    const auto size = oracle.size(oracle.user, its);
                    const std::uint64_t offset = random() % static_cast<unsigned>(size + 300);
                    const auto needs = [](std::uint64_t n) { return (n + MEMORY_DATA - 1) / MEMORY_DATA; };
                    const std::uint64_t end = offset + bytes.size(), was = static_cast<std::uint64_t>(size);
                    found = files.write(files.user, mine, offset, bytes.data(), bytes.size());
                    if ((mine & 1) != 0 && end > was && needs(end) - needs(was) > disk.store()->free &&
                        found == CFDP_FULL) {
                        full++;
                        continue;
                    }
                    expected = oracle.write(oracle.user, its, offset, bytes.data(), bytes.size());
                }
                break;
            case 3:
                if (!handles.empty()) {
                    const auto [mine, its] = *std::next(handles.begin(), random() % handles.size());
                    const auto size = oracle.size(oracle.user, its);
                    EXPECT_EQ(files.size(files.user, mine), size);
                    const std::uint64_t offset = random() % static_cast<unsigned>(size + 10);
                    Bytes bytes(1 + random() % 700), its_bytes(bytes.size());
                    found = files.read(files.user, mine, offset, bytes.data(), bytes.size());
                    expected = oracle.read(oracle.user, its, offset, its_bytes.data(), bytes.size());
                    EXPECT_TRUE(found != 0 || bytes == its_bytes) << what;
                }
                break;
            case 4:
                if (std::filesystem::is_directory(folder.path / name)) {
                    continue; // a folder renames directories too
                }
                if (name != other && std::filesystem::is_regular_file(folder.path / name)) {
                    forget(other);
                }
                found = files.rename(files.user, name.c_str(), other.c_str());
                expected = oracle.rename(oracle.user, name.c_str(), other.c_str());
                break;
            case 5:
                forget(name);
                found = files.remove(files.user, name.c_str());
                expected = oracle.remove(oracle.user, name.c_str());
                break;
            case 6:
                found = files.make_directory(files.user, name.c_str());
                if (found == CFDP_FULL) {
                    EXPECT_EQ(disk.store()->free, 0u);
                    continue;
                }
                expected = oracle.make_directory(oracle.user, name.c_str());
                break;
            default:
                found = files.remove_directory(files.user, name.c_str());
                expected = oracle.remove_directory(oracle.user, name.c_str());
                if (name.empty() || name.back() == '/' || name.back() == '.') {
                    continue;
                }
            }
            EXPECT_EQ(found, expected) << what;
            (found < 0 ? refused : done)++;
            if (random() % 10 == 0) { // a copy of the block is the same store, and so is a mount of its pages
                disk.block = std::vector(disk.block);
                memory_store_mount(disk.store());
                EXPECT_EQ(disk.store()->lost, 0u);
            }
            if (random() % 20 == 0) { // pages wear out, until few are left
                const auto page = static_cast<std::uint32_t>(random() % pages);
                if (disk.store()->free > pages / 3) {
                    EXPECT_EQ(memory_store_move(disk.store(), page), 1);
                }
            }
        }
        for (const auto &[mine, its] : handles) {
            oracle.close(oracle.user, its);
        }
        if (disk.store()->free >= 2) {
            EXPECT_EQ(content(disk.files()), content(oracle));
        }
        for (int left = 4; left-- > 0;) { // files, then directories from within
            for (const char *name : {"d/e/f", "d/e", "d/a", "d/b", "a/b", "a", "b", "c", "d", "e/a", "e", ".h"}) {
                disk.files().remove(disk.store(), name);
                disk.files().remove_directory(disk.store(), name);
            }
        }
        memory_store_mount(disk.store());
        EXPECT_EQ(disk.store()->free, pages) << "pages that no file has";
        posix_store_close(&posix);
    }
    EXPECT_GT(full, 50u);
    EXPECT_GT(done, 1000u);
    EXPECT_GT(refused, 1000u);
}

// Random changes of files, and their pages copied one by one in the order of memory_store_dirty(), some of them torn,
// until copying ends anywhere: the copy has, of each file, what it once was.
TEST(MemoryStore, ATornCopyHasOldFilesOrNewOnes)
{
    constexpr std::uint32_t pages = 32;
    std::mt19937 random(2);
    std::size_t lost = 0, kept = 0;
    for (int run = 0; run < 300; run++) {
        Disk disk(pages), copy(pages);
        std::map<std::string, std::set<Bytes>> ever;
        std::size_t torn = 0;
        for (int step = 0; step < 30; step++) {
            const CfdpStore files = disk.files();
            const std::string name(1, static_cast<char>('a' + random() % 4));
            const auto before = get(files, name);
            switch (random() % 5) {
            case 0: files.remove(files.user, name.c_str()); break;
            case 1: {
                const std::string to(1, static_cast<char>('a' + random() % 4));
                if (files.rename(files.user, name.c_str(), to.c_str()) == 0) {
                    ever[to].insert(get(files, to).value());
                }
                break;
            }
            case 2: {
                const Bytes part = any_bytes(random, 1 + random() % 300);
                const int file = files.open(files.user, name.c_str(), CFDP_OPEN_WRITE);
                files.write(files.user, file, random() % 400, part.data(), part.size());
                break;
            }
            default: put(files, name, any_bytes(random, random() % 900)); ever[name].insert({});
            }
            if (const auto now = get(files, name)) {
                ever[name].insert(*now);
            }
            for (unsigned n = random() % 12; n-- > 0;) {
                const int page = disk.dirty();
                if (page < 0) {
                    break;
                }
                const bool tears = random() % 20 == 0;
                const auto i = static_cast<std::uint32_t>(page);
                std::memcpy(copy.page(i), disk.page(i), tears ? random() % MEMORY_PAGE : std::size_t{MEMORY_PAGE});
                memory_store_mark(disk.store(), i, 0);
                torn += tears;
            }
        }
        Disk found(pages);
        found.block = copy.block;
        memory_store_mount(found.store());
        lost += found.store()->lost;
        for (const auto &[name, versions] : ever) {
            if (const auto bytes = get(found.files(), name)) {
                EXPECT_EQ(versions.count(*bytes), 1u) << name << " run " << run;
                kept++;
            }
        }
        while (disk.dirty() >= 0) { // all is copied, over whatever tore
            const auto i = static_cast<std::uint32_t>(disk.dirty());
            std::memcpy(copy.page(i), disk.page(i), MEMORY_PAGE);
            memory_store_mark(disk.store(), i, 0);
        }
        if (torn == 0) {
            memory_store_mount(copy.store());
            EXPECT_EQ(copy.store()->lost, 0u);
            EXPECT_EQ(content(copy.files()), content(disk.files()));
        }
    }
    EXPECT_GT(kept, 300u);
    EXPECT_GT(lost, 50u);
}

TEST(MemoryStore, ARenameReplacesAFileAtOnce)
{
    Disk disk(12), copy(12);
    const CfdpStore files = disk.files();
    const Bytes old(500, 1), young(600, 2);
    const auto flush = [&] {
        const auto i = static_cast<std::uint32_t>(disk.dirty());
        std::memcpy(copy.page(i), disk.page(i), MEMORY_PAGE);
        memory_store_mark(disk.store(), i, 0);
    };
    ASSERT_EQ(put(files, "f", old), 0);
    while (disk.dirty() >= 0) {
        flush();
    }
    ASSERT_EQ(put(files, ".cfdp0", young), 0);
    ASSERT_EQ(files.rename(files.user, ".cfdp0", "f"), 0);
    int versions = 0;
    for (Bytes last = old; disk.dirty() >= 0;) {
        flush();
        Disk found(12);
        found.block = copy.block;
        memory_store_mount(found.store());
        const Bytes now = get(found.files(), "f").value();
        EXPECT_TRUE(now == old || now == young);
        versions += now != last;
        last = now;
    }
    EXPECT_EQ(versions, 1);
}

TEST(MemoryStore, DamageIsNeverRead)
{
    constexpr std::uint32_t pages = 32;
    std::mt19937 random(3);
    Disk whole(pages);
    ASSERT_EQ(whole.files().make_directory(whole.store(), "d"), 0);
    Content written;
    for (const char *name : {"a", "b", "d/a", "d/b"}) {
        written[name] = any_bytes(random, 200 + random() % 1200);
        ASSERT_EQ(put(whole.files(), name, written[name]), 0);
    }
    int lost = 0, kept = 0, refused = 0;
    for (int run = 0; run < 2000; run++) {
        Disk disk(pages);
        disk.block = whole.block;
        const unsigned flips = 1 + random() % 5;
        for (unsigned n = 0; n < flips; n++) {
            disk.page(0)[random() % (pages * MEMORY_PAGE)] ^= static_cast<std::uint8_t>(1 << random() % 8);
        }
        const auto compare = [&] {
            for (const auto &[name, bytes] : written) {
                const auto found = get(disk.files(), name);
                EXPECT_TRUE(!found || *found == bytes) << name;
                (found ? kept : refused)++;
            }
        };
        compare();                                  // as memory is damaged while the store is in use
        for (const auto &[name, bytes] : written) { // a change does not hide the damage
            const int file = disk.files().open(disk.store(), name.c_str(), CFDP_OPEN_WRITE);
            disk.files().write(disk.store(), file, 0, bytes.data(), 1);
            disk.files().write(disk.store(), file, bytes.size() - 1, &bytes.back(), 1);
        }
        memory_store_move(disk.store(), random() % pages);
        compare();
        memory_store_mount(disk.store());
        compare();
        lost += static_cast<int>(disk.store()->lost);
        disk.files().make_directory(disk.store(), "d"); // it may be lost with all that was in it
        for (const char *name : {"a", "d/b"}) {         // and the store is as good as new
            EXPECT_EQ(put(disk.files(), name, written[name]), 0);
            EXPECT_EQ(get(disk.files(), name), written[name]);
        }
    }
    EXPECT_GT(lost, 500);
    EXPECT_GT(kept, 10000);
    EXPECT_GT(refused, 2000);
    for (int run = 0; run < 300; run++) { // anything at all
        Disk disk(pages);
        for (std::uint32_t i = 0; i < pages * MEMORY_PAGE; i++) {
            disk.page(0)[i] = static_cast<std::uint8_t>(random());
        }
        memory_store_mount(disk.store());
        EXPECT_EQ(disk.store()->free, pages);
    }
}

TEST(MemoryStore, HandlesOfFilesThatAreGoneAreRefused)
{
    Disk disk(8);
    const CfdpStore files = disk.files();
    const int first = files.open(files.user, "a", CFDP_OPEN_NEW);
    ASSERT_EQ(files.remove(files.user, "a"), 0);
    const int second = files.open(files.user, "b", CFDP_OPEN_NEW);
    const int third = files.open(files.user, "c", CFDP_OPEN_NEW);
    const std::uint8_t byte = 7;
    std::uint8_t back = 0;
    ASSERT_EQ(files.write(files.user, third, 0, &byte, 1), 0);
    ASSERT_EQ(files.rename(files.user, "b", "c"), 0); // c's old content goes, b's handle stays
    for (const int file : {first, third, -1, 12345}) {
        EXPECT_EQ(files.size(files.user, file), CFDP_BROKEN);
        EXPECT_EQ(files.read(files.user, file, 0, &back, 0), CFDP_BROKEN);
        EXPECT_EQ(files.write(files.user, file, 0, &byte, 1), CFDP_BROKEN);
    }
    EXPECT_EQ(files.write(files.user, second, 0, &byte, 1), 0);
    EXPECT_EQ(get(files, "c"), Bytes{7});
    EXPECT_EQ(files.write(files.user, files.open(files.user, "c", CFDP_OPEN_READ), 0, &byte, 1), CFDP_REFUSED);
}

TEST(MemoryStore, RefusesNamesThatAreTooLongAndUseBeforeItIsMounted)
{
    Disk disk(8);
    const CfdpStore files = disk.files();
    const std::string longest(CFDP_NAME - 1, 'n');
    EXPECT_EQ(put(files, longest, {1}), 0);
    EXPECT_EQ(get(files, longest), Bytes{1});
    EXPECT_EQ(put(files, longest + "n", {1}), CFDP_REFUSED);
    EXPECT_EQ(put(files, "d/" + longest, {1}), CFDP_ABSENT);
    EXPECT_EQ(files.write(files.user, files.open(files.user, "f", CFDP_OPEN_NEW), UINT64_MAX, nullptr, 2), CFDP_FULL);
    memory_store_begin(disk.store(), disk.block.size() * 8);
    EXPECT_EQ(put(files, "a", {}), CFDP_BROKEN);
    EXPECT_EQ(files.remove(files.user, "a"), CFDP_BROKEN);
    EXPECT_EQ(files.rename(files.user, "a", "b"), CFDP_BROKEN);
    EXPECT_EQ(files.make_directory(files.user, "a"), CFDP_BROKEN);
    EXPECT_EQ(files.remove_directory(files.user, "a"), CFDP_BROKEN);
    EXPECT_EQ(files.list(files.user, "", note, nullptr), CFDP_BROKEN);
}

/// A page of an entry: its fields begin at these bytes.
constexpr std::size_t NEXT = 4, CHANGED = 12, SIZE = 16, NAME = 24;

/// Its check is right again.
void seal(std::uint8_t *page)
{
    ccsds_put32(page, cfdp_checksum(CFDP_CRC32, 0, 0, page + NEXT, MEMORY_PAGE - NEXT));
}

TEST(MemoryStore, ChainsThatAreWrongAreNotFollowed)
{
    const Bytes bytes(400, 3); // pages 1 and 2, behind the entry
    for (const int what : {0, 1, 2}) {
        Disk disk(8);
        const CfdpStore files = disk.files();
        ASSERT_EQ(put(files, "a", bytes), 0);
        if (what == 0) { // the first names none
            ccsds_put32(disk.page(1) + NEXT, ccsds_get32(disk.page(1) + NEXT) | 0xFFFFFF);
        } else if (what == 1) { // the second is damaged
            disk.page(2)[100] ^= 1;
        } else { // the second names itself
            ccsds_put32(disk.page(2) + NEXT, (ccsds_get32(disk.page(2) + NEXT) & 0xFF000000) | 2);
            seal(disk.page(2));
        }
        const int file = files.open(files.user, "a", CFDP_OPEN_WRITE);
        if (what < 2) {
            EXPECT_EQ(files.write(files.user, file, 400, bytes.data(), 300), CFDP_BROKEN);
            EXPECT_EQ(disk.store()->free, 5u);
        } else {
            EXPECT_EQ(files.remove(files.user, "a"), 0);
            EXPECT_EQ(disk.store()->free, 8u);
        }
    }
}

TEST(MemoryStore, RefusesToRenameOrListWhatIsOfTheOtherKind)
{
    Disk disk(8);
    const CfdpStore files = disk.files();
    ASSERT_EQ(files.make_directory(files.user, "d"), 0);
    ASSERT_EQ(put(files, "a", {1}), 0);
    ASSERT_EQ(put(files, "b", {1}), 0);
    EXPECT_EQ(files.rename(files.user, "d", "e"), CFDP_REFUSED);
    EXPECT_EQ(files.list(files.user, "a", note, nullptr), CFDP_REFUSED);
    EXPECT_EQ(files.list(files.user, "none", note, nullptr), CFDP_ABSENT);
    int names = 0;
    const auto stop = [](void *to, const char *) { return --*static_cast<int *>(to); };
    EXPECT_LT(files.list(files.user, "", stop, &names), 0);
    EXPECT_EQ(names, -1); // no more than one
    const int file = files.open(files.user, "a", CFDP_OPEN_READ);
    memory_store_begin(disk.store(), disk.block.size() * 8);
    EXPECT_EQ(files.size(files.user, file), CFDP_BROKEN); // it is not mounted
}

TEST(MemoryStore, MountsEntriesThatCanBeAlone)
{
    const auto rename = [](std::uint8_t *entry, const char *name) {
        std::memset(entry + NAME, 0, CFDP_NAME);
        std::strcpy(reinterpret_cast<char *>(entry + NAME), name);
        seal(entry);
    };
    using Change = std::function<void(Disk &)>; // of the entry a in page 0, with its data in page 1, and of b in page 2
    const struct {
        std::uint32_t pages;
        Change change;
        std::uint32_t lost;
        Content left;
    } cases[] = {
        {4, [](Disk &) {}, 0, {{"a", {1}}, {"b", {}}}},
        {4, [&](Disk &disk) { rename(disk.page(0), ".."); }, 1, {{"b", {}}}},
        {4,
         [](Disk &disk) {
             ccsds_put32(disk.page(0) + SIZE, 5 * MEMORY_DATA);
             seal(disk.page(0));
         },
         1,
         {{"b", {}}}},
        {4, // one file under two names, as an interrupted change leaves it: the later
         [&](Disk &disk) {
             std::memcpy(disk.page(3), disk.page(0), MEMORY_PAGE);
             ccsds_put32(disk.page(3) + CHANGED, 99);
             rename(disk.page(3), "c");
         },
         0,
         {{"c", {1}}, {"b", {}}}},
        {4, [&](Disk &disk) { rename(disk.page(2), "d/b"); }, 0, {{"a", {1}}, {"d/", {}}, {"d/b", {}}}},
        {3, [&](Disk &disk) { rename(disk.page(2), "d/b"); }, 1, {{"a", {1}}}}, // no page for its directory
        {4, [&](Disk &disk) { rename(disk.page(2), "a/b"); }, 1, {{"a", {1}}}}, // which is a file
    };
    for (const auto &[pages, change, lost, left] : cases) {
        Disk disk(pages);
        ASSERT_EQ(put(disk.files(), "a", {1}), 0);
        ASSERT_EQ(put(disk.files(), "b", {}), 0);
        change(disk);
        memory_store_mount(disk.store());
        EXPECT_EQ(disk.store()->lost, lost);
        EXPECT_EQ(content(disk.files()), left);
    }
}

TEST(MemoryStore, APageIsMovedWhereThereIsRoom)
{
    Disk disk(2);
    ASSERT_EQ(put(disk.files(), "a", {1}), 0);
    EXPECT_EQ(memory_store_move(disk.store(), 1), 0);
    EXPECT_EQ(get(disk.files(), "a"), Bytes{1});
    std::uint32_t dirty = 0;
    memory_store_dirty(disk.store(), &dirty);
    EXPECT_EQ(dirty, 1u); // but for that page
    std::vector<std::uint64_t> block(MEMORY_STORE_BYTES(MEMORY_PAGES_MAX + 1) / 8);
    auto *large = reinterpret_cast<MemoryStore *>(block.data());
    memory_store_begin(large, block.size() * 8);
    EXPECT_EQ(large->pages, MEMORY_PAGES_MAX);
}

// What was copied of a directory's entry is damaged: its files are there all the same.
TEST(MemoryStore, MakesALostDirectoryAnew)
{
    Disk disk(16);
    ASSERT_EQ(disk.files().make_directory(disk.store(), "d"), 0);
    ASSERT_EQ(disk.files().make_directory(disk.store(), "d/e"), 0);
    ASSERT_EQ(put(disk.files(), "d/e/f", {1, 2, 3}), 0);
    disk.page(0)[100] ^= 1; // the first page that was taken: the entry of d
    disk.page(1)[100] ^= 1;
    memory_store_mount(disk.store());
    EXPECT_EQ(disk.store()->lost, 2u);
    EXPECT_EQ(content(disk.files()), (Content{{"d/", {}}, {"d/e/", {}}, {"d/e/f", {1, 2, 3}}}));
}

} // namespace memory_store_test
