// SPDX-License-Identifier: Apache-2.0
// Tables: files by hand, loads by the owner and by the ground, and all that is refused.
#include "targets/cfs/testing/pocket.h"

#include <cstring>
#include <random>

namespace tables_test {

struct Gains {
    double K;
    std::uint32_t n;
    std::uint32_t spare;
};
int validations;

extern "C" std::int32_t positive(void *table)
{
    validations++;
    return static_cast<Gains *>(table)->K > 0 ? CFE_SUCCESS : -7;
}

Bytes big(std::uint32_t v)
{
    return {std::uint8_t(v >> 24), std::uint8_t(v >> 16), std::uint8_t(v >> 8), std::uint8_t(v)};
}

class Tables : public Pocket {
protected:
    void SetUp() override
    {
        Pocket::SetUp();
        validations = 0;
        ASSERT_EQ(CFE_TBL_Register(&handle, "Gains", sizeof(Gains), CFE_TBL_OPT_DEFAULT, positive), 0);
    }

    struct File {
        std::uint32_t content = 0x63464531, subtype = 8, offset = 0, n = sizeof(Gains);
        std::string table = "HOST.Gains";
        Bytes data;
        std::size_t cut = SIZE_MAX;
    };
    const char *write(File f, const char *name = "/cf/gains.tbl")
    {
        Bytes b;
        const auto add = [&](const Bytes &more) { b.insert(b.end(), more.begin(), more.end()); };
        for (const std::uint32_t v : {f.content, f.subtype, 64u, 66u, 1u, 0u, 0u, 0u}) {
            add(big(v));
        }
        add(text("gains", 32));
        for (const std::uint32_t v : {0u, f.offset, f.n}) {
            add(big(v));
        }
        add(text(f.table, 40));
        EXPECT_EQ(b.size(), 116u);
        add(f.data);
        b.resize(std::min(b.size(), f.cut));
        std::ofstream out(folder / (name + 1), std::ios::binary);
        out.write(reinterpret_cast<const char *>(b.data()), std::streamsize(b.size()));
        return name;
    }
    static Bytes data(Gains g)
    {
        Bytes b(sizeof g);
        std::memcpy(b.data(), &g, sizeof g);
        return b;
    }
    File good(double K, std::uint32_t n)
    {
        File f;
        f.data = data({K, n, 0});
        return f;
    }
    /// Its content now, and the status of GetAddress.
    Gains now(std::int32_t expected)
    {
        void *p;
        EXPECT_EQ(CFE_TBL_GetAddress(&p, handle), expected);
        Gains g;
        std::memcpy(&g, p, sizeof g);
        EXPECT_EQ(CFE_TBL_ReleaseAddress(handle), expected < 0 ? expected : 0);
        return g;
    }
    CFE_TBL_Handle_t handle;
};

TEST_F(Tables, AreLoadedFromFileAndFromMemory)
{
    now(CFE_TBL_ERR_NEVER_LOADED);
    ASSERT_EQ(CFE_TBL_Load(handle, CFE_TBL_SRC_FILE, write(good(2.5, 3))), 0);
    EXPECT_EQ(now(CFE_TBL_INFO_UPDATED).K, 2.5);
    EXPECT_EQ(now(CFE_SUCCESS).n, 3u);
    const Gains g{4.0, 9, 0};
    ASSERT_EQ(CFE_TBL_Load(handle, CFE_TBL_SRC_ADDRESS, &g), 0);
    EXPECT_EQ(now(CFE_TBL_INFO_UPDATED).n, 9u);
    EXPECT_EQ(validations, 2);
}

TEST_F(Tables, WhatTheirOwnerFindsBadStaysOut)
{
    ASSERT_EQ(CFE_TBL_Load(handle, CFE_TBL_SRC_FILE, write(good(2.5, 3))), 0);
    EXPECT_EQ(CFE_TBL_Load(handle, CFE_TBL_SRC_FILE, write(good(-1, 4))), -7);
    EXPECT_EQ(event("CFE_TBL", 0).text, "HOST.Gains: load refused: 0xFFFFFFF9");
    EXPECT_EQ(now(CFE_TBL_INFO_UPDATED).n, 3u);
}

TEST_F(Tables, AFileThatIsNotTheirsIsRefusedForWhatItIs)
{
    const auto load = [&](void (*change)(File &)) {
        File f = good(2.5, 3);
        change(f);
        return CFE_TBL_Load(handle, CFE_TBL_SRC_FILE, write(f));
    };
    EXPECT_EQ(load([](File &f) { f.content++; }), CFE_TBL_ERR_BAD_CONTENT_ID);
    EXPECT_EQ(load([](File &f) { f.subtype = 9; }), CFE_TBL_ERR_BAD_SUBTYPE_ID);
    EXPECT_EQ(load([](File &f) { f.table = "OTHER.Gains"; }), CFE_TBL_ERR_FILE_FOR_WRONG_TABLE);
    EXPECT_EQ(load([](File &f) { f.cut = 63; }), CFE_TBL_ERR_NO_STD_HEADER);
    EXPECT_EQ(load([](File &f) { f.cut = 115; }), CFE_TBL_ERR_NO_TBL_HEADER);
    EXPECT_EQ(load([](File &f) { f.cut = 131; }), CFE_TBL_ERR_LOAD_INCOMPLETE);
    EXPECT_EQ(load([](File &f) { f.data.push_back(0); }), CFE_TBL_ERR_FILE_TOO_LARGE);
    EXPECT_EQ(load([](File &f) { f.n = 17; }), CFE_TBL_ERR_FILE_TOO_LARGE);
    EXPECT_EQ(load([](File &f) { f.offset = 0xfffffff8; }), CFE_TBL_ERR_FILE_TOO_LARGE);
    EXPECT_EQ(load([](File &f) { f.n = 8, f.data.resize(8); }), CFE_TBL_ERR_PARTIAL_LOAD);
    EXPECT_EQ(CFE_TBL_Load(handle, CFE_TBL_SRC_FILE, "/cf/absent.tbl"), CFE_TBL_ERR_ACCESS);
    now(CFE_TBL_ERR_NEVER_LOADED);
    EXPECT_EQ(validations, 0);
}

TEST_F(Tables, NoFileDoesHarm)
{
    std::mt19937 random(31);
    ASSERT_EQ(CFE_TBL_Load(handle, CFE_TBL_SRC_FILE, write(good(2.5, 3))), 0);
    int taken = 0;
    for (int n = 0; n < 1500; n++) {
        File f = good(2.5, 3);
        f.offset = random() % 3 != 0 ? 0 : std::uint32_t(random() % 40);
        f.n = random() % 3 != 0 ? 16 : std::uint32_t(random() % 40);
        f.data.resize(random() % 3 != 0 ? f.n : random() % 40);
        f.cut = random() % 4 != 0 ? SIZE_MAX : random() % 160;
        write(f);
        if (random() % 2 != 0) { // one byte is another one
            std::fstream file(folder / "cf/gains.tbl", std::ios::in | std::ios::out | std::ios::binary);
            file.seekp(std::streamoff(random() % 132));
            file.put(char(random()));
        }
        const auto status = CFE_TBL_Load(handle, CFE_TBL_SRC_FILE, "/cf/gains.tbl");
        taken += status >= 0;
        void *p;
        ASSERT_GE(CFE_TBL_GetAddress(&p, handle), 0);
        ASSERT_GT(static_cast<Gains *>(p)->K, 0.0);
        ASSERT_EQ(CFE_TBL_ReleaseAddress(handle), 0);
        while (event("NO_APP", 0).id != 0) {
        }
    }
    EXPECT_GT(taken, 100);
    EXPECT_LT(taken, 1400);
}

TEST_F(Tables, AFileMayHoldAPartOnceTheRestIsThere)
{
    ASSERT_EQ(CFE_TBL_Load(handle, CFE_TBL_SRC_FILE, write(good(2.5, 3))), 0);
    File f;
    f.offset = 8;
    f.n = 4;
    f.data = {7, 0, 0, 0};
    EXPECT_EQ(CFE_TBL_Load(handle, CFE_TBL_SRC_FILE, write(f)), CFE_TBL_WARN_PARTIAL_LOAD);
    const Gains g = now(CFE_TBL_INFO_UPDATED);
    EXPECT_EQ(g.K, 2.5);
    std::uint32_t n;
    std::memcpy(&n, f.data.data(), 4);
    EXPECT_EQ(g.n, n);
}

TEST_F(Tables, AnAddressThatIsHeldDelaysTheUpdate)
{
    ASSERT_EQ(CFE_TBL_Load(handle, CFE_TBL_SRC_FILE, write(good(2.5, 3))), 0);
    void *p;
    ASSERT_EQ(CFE_TBL_GetAddress(&p, handle), CFE_TBL_INFO_UPDATED);
    EXPECT_EQ(CFE_TBL_Load(handle, CFE_TBL_SRC_FILE, write(good(5, 6))), CFE_TBL_INFO_TABLE_LOCKED);
    EXPECT_EQ(CFE_TBL_Manage(handle), CFE_TBL_INFO_TABLE_LOCKED);
    EXPECT_EQ(static_cast<Gains *>(p)->n, 3u);
    EXPECT_EQ(CFE_TBL_ReleaseAddress(handle), 0);
    EXPECT_EQ(CFE_TBL_Manage(handle), 0);
    EXPECT_EQ(now(CFE_TBL_INFO_UPDATED).n, 6u);
}

TEST_F(Tables, TheGroundLoadsValidatesAndActivates)
{
    ASSERT_EQ(CFE_TBL_Load(handle, CFE_TBL_SRC_FILE, write(good(2.5, 3))), 0);
    now(CFE_TBL_INFO_UPDATED);
    write(good(8, 4));
    const Bytes name = text("HOST.Gains", 40);
    Bytes inactive{0, 0};
    inactive.insert(inactive.end(), name.begin(), name.end());
    EXPECT_TRUE(ingest(command(CFE_TBL_CMD_MID, CFE_TBL_LOAD_CC, text("/cf/gains.tbl", 64))));
    EXPECT_TRUE(ingest(command(CFE_TBL_CMD_MID, CFE_TBL_ACTIVATE_CC, name))); // not validated yet
    EXPECT_EQ(pocket_counts().table_errors, 1u);
    EXPECT_TRUE(ingest(command(CFE_TBL_CMD_MID, CFE_TBL_VALIDATE_CC, inactive)));
    EXPECT_EQ(CFE_TBL_GetStatus(handle), CFE_TBL_INFO_VALIDATION_PENDING);
    EXPECT_EQ(CFE_TBL_Manage(handle), 0);
    EXPECT_EQ(now(CFE_SUCCESS).n, 3u);
    EXPECT_TRUE(ingest(command(CFE_TBL_CMD_MID, CFE_TBL_ACTIVATE_CC, name)));
    EXPECT_EQ(CFE_TBL_Manage(handle), 0);
    EXPECT_EQ(now(CFE_TBL_INFO_UPDATED).n, 4u);
    EXPECT_EQ(pocket_counts().table_commands, 3u);
}

TEST_F(Tables, ALoadOfTheGroundIsKeptFromTheOwner)
{
    ASSERT_EQ(CFE_TBL_Load(handle, CFE_TBL_SRC_FILE, write(good(2.5, 3))), 0);
    now(CFE_TBL_INFO_UPDATED);
    write(good(8, 4));
    EXPECT_TRUE(ingest(command(CFE_TBL_CMD_MID, CFE_TBL_LOAD_CC, text("/cf/gains.tbl", 64))));
    const Gains own{1, 1, 0};
    EXPECT_EQ(CFE_TBL_Load(handle, CFE_TBL_SRC_ADDRESS, &own), CFE_TBL_ERR_LOAD_IN_PROGRESS);
    EXPECT_TRUE(ingest(command(CFE_TBL_CMD_MID, CFE_TBL_VALIDATE_CC, text(std::string("\0\0HOST.Gains", 12), 42))));
    EXPECT_EQ(CFE_TBL_Manage(handle), 0);
    EXPECT_TRUE(ingest(command(CFE_TBL_CMD_MID, CFE_TBL_ACTIVATE_CC, text("HOST.Gains", 40))));
    EXPECT_EQ(CFE_TBL_Manage(handle), 0);
    EXPECT_EQ(now(CFE_TBL_INFO_UPDATED).n, 4u);
}

TEST_F(Tables, WhatIsActiveCanBeValidatedAndDumped)
{
    ASSERT_EQ(CFE_TBL_Load(handle, CFE_TBL_SRC_FILE, write(good(2.5, 3))), 0);
    now(CFE_TBL_INFO_UPDATED);
    const Bytes active = text(std::string("\1\0HOST.Gains", 12), 42);
    EXPECT_TRUE(ingest(command(CFE_TBL_CMD_MID, CFE_TBL_VALIDATE_CC, active)));
    EXPECT_EQ(CFE_TBL_Manage(handle), 0);
    EXPECT_EQ(validations, 2);
    Bytes dump = active;
    const Bytes path = text("/ram/dump.tbl", 64);
    dump.insert(dump.end(), path.begin(), path.end());
    EXPECT_TRUE(ingest(command(CFE_TBL_CMD_MID, CFE_TBL_DUMP_CC, dump)));
    EXPECT_EQ(pocket_counts().table_errors, 0u);
    const Gains other{1, 1, 0};
    ASSERT_EQ(CFE_TBL_Load(handle, CFE_TBL_SRC_ADDRESS, &other), 0);
    ASSERT_EQ(CFE_TBL_Load(handle, CFE_TBL_SRC_FILE, "/ram/dump.tbl"), 0);
    EXPECT_EQ(now(CFE_TBL_INFO_UPDATED).n, 3u);
}

TEST_F(Tables, WhatTheGroundGetsWrongIsCounted)
{
    const auto refused = [&](unsigned code, const Bytes &payload) {
        const auto before = pocket_counts();
        EXPECT_TRUE(ingest(command(CFE_TBL_CMD_MID, code, payload)));
        EXPECT_EQ(pocket_counts().table_errors, before.table_errors + 1) << code;
        EXPECT_EQ(pocket_counts().table_commands, before.table_commands);
    };
    refused(CFE_TBL_LOAD_CC, text("/cf/absent.tbl", 64));
    refused(CFE_TBL_LOAD_CC, text("/cf/gains.tbl", 63));
    write(good(1, 1), "/cf/gains.tbl");
    File f = good(1, 1);
    f.table = "NAV.Gains";
    write(f, "/cf/other.tbl");
    refused(CFE_TBL_LOAD_CC, text("/cf/other.tbl", 64));
    refused(CFE_TBL_VALIDATE_CC, text(std::string("\0\0HOST.Gains", 12), 42)); // nothing is loaded
    refused(CFE_TBL_ACTIVATE_CC, text("HOST.Gains", 40));                      // nothing is loaded
    refused(CFE_TBL_ACTIVATE_CC, text("HOST.None", 40));
    refused(CFE_TBL_DUMP_CC, text(std::string("\1\0HOST.None", 11), 2 + 40 + 64));
    refused(CFE_TBL_DUMP_CC, text("", 42));
    refused(77, {});
    Bytes bad = command(CFE_TBL_CMD_MID, CFE_TBL_NOOP_CC);
    bad[7] ^= 0x10;
    const auto before = pocket_counts().table_errors;
    EXPECT_TRUE(ingest(bad));
    EXPECT_EQ(pocket_counts().table_errors, before + 1);
    EXPECT_TRUE(ingest(command(CFE_TBL_CMD_MID, CFE_TBL_NOOP_CC)));
    EXPECT_EQ(pocket_counts().table_commands, 1u);
}

TEST_F(Tables, RegisteringHasRules)
{
    CFE_TBL_Handle_t h;
    EXPECT_EQ(CFE_TBL_Register(&h, "Gains", sizeof(Gains), 0, positive), CFE_TBL_WARN_DUPLICATE);
    EXPECT_EQ(h, handle);
    EXPECT_EQ(CFE_TBL_Register(&h, "Gains", 4, 0, positive), CFE_TBL_ERR_DUPLICATE_DIFF_SIZE);
    EXPECT_EQ(CFE_TBL_Register(&h, "a name too long!", 4, 0, nullptr), CFE_TBL_ERR_INVALID_NAME);
    EXPECT_EQ(CFE_TBL_Register(&h, "Big", 1 << 20, 0, nullptr), CFE_TBL_ERR_INVALID_SIZE);
    EXPECT_EQ(CFE_TBL_Register(&h, "Odd", 4, 8, nullptr), CFE_TBL_ERR_INVALID_OPTIONS);
    EXPECT_EQ(CFE_TBL_Load(77, CFE_TBL_SRC_ADDRESS, &h), CFE_TBL_ERR_INVALID_HANDLE);
    EXPECT_EQ(CFE_TBL_Unregister(handle), 0);
    EXPECT_EQ(CFE_TBL_Manage(handle), CFE_TBL_ERR_INVALID_HANDLE);
    // Its bytes are there for the next ones, however often.
    for (int i = 0; i < 5000; i++) {
        ASSERT_EQ(CFE_TBL_Register(&h, "Again", 4000, 0, nullptr), 0);
        ASSERT_EQ(CFE_TBL_Unregister(h), 0);
    }
}

} // namespace tables_test
