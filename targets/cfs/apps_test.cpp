// SPDX-License-Identifier: Apache-2.0
// Apps: start-up scripts, their loop, their tasks, their end, and starting anew.
#include "targets/cfs/testing/pocket.h"

#include <atomic>

namespace apps_test {

// The actions of an app. The test reads them after the app has sent an event.
std::atomic<int> starts, children, last_status;

extern "C" void child(void)
{
    CFE_SB_PipeId_t pipe;
    CFE_SB_Buffer_t *b;
    children++;
    CFE_SB_CreatePipe(&pipe, 4, "child");
    CFE_SB_ReceiveBuffer(&b, pipe, CFE_SB_PEND_FOREVER); // it never comes back
    children += 1000;
}

/// Answers each command on 0x18c0 by an event with its code; code 9 is an error of its own.
extern "C" void ECHO_AppMain(void)
{
    std::uint32_t status = CFE_ES_RunStatus_APP_RUN;
    CFE_SB_PipeId_t pipe;
    CFE_SB_Buffer_t *b;
    CFE_ES_TaskId_t task;
    CFE_ES_CDSHandle_t store;
    int remembered = 0;
    starts++;
    CFE_EVS_Register(nullptr, 0, CFE_EVS_EventFilter_BINARY);
    CFE_SB_CreatePipe(&pipe, 10, "echo");
    CFE_SB_Subscribe(CFE_SB_ValueToMsgId(0x18c0), pipe);
    CFE_ES_CreateChildTask(&task, "child", child, nullptr, 16384, 60, 0);
    if (CFE_ES_RegisterCDS(&store, sizeof remembered, "n") == CFE_ES_CDS_ALREADY_EXISTS) {
        CFE_ES_RestoreFromCDS(&remembered, store);
    }
    remembered++;
    CFE_ES_CopyToCDS(store, &remembered);
    CFE_EVS_SendEvent(1, CFE_EVS_EventType_INFORMATION, "start %d, reset %d", remembered,
                      int(CFE_ES_GetResetType(nullptr)));
    CFE_ES_WaitForStartupSync(10000);
    while (CFE_ES_RunLoop(&status)) {
        if (CFE_SB_ReceiveBuffer(&b, pipe, CFE_SB_PEND_FOREVER) == CFE_SUCCESS) {
            CFE_MSG_FcnCode_t code;
            CFE_MSG_GetFcnCode(&b->Msg, &code);
            CFE_EVS_SendEvent(2, CFE_EVS_EventType_INFORMATION, "code %d", int(code));
            if (code == 9) {
                status = CFE_ES_RunStatus_APP_ERROR;
            }
        }
    }
    last_status = int(status);
    CFE_ES_ExitApp(status);
}

const PocketApp APPS[] = {{"ECHO_AppMain", ECHO_AppMain}};

class Apps : public Pocket {
protected:
    void SetUp() override
    {
        Pocket::SetUp();
        boot(APPS, 1);
        starts = children = last_status = 0;
    }
    std::int32_t script(const std::string &text)
    {
        std::ofstream(folder / "cf/cfe_es_startup.scr") << text;
        return pocket_run_script("/cf/cfe_es_startup.scr");
    }
    void start()
    {
        ASSERT_EQ(script("CFE_APP, echo, ECHO_AppMain, ECHO, 55, 16384, 0x0, 0;\n! the rest\n???"), 1);
        ASSERT_TRUE(pocket_operational(10000));
    }
};

TEST_F(Apps, AScriptStartsOne)
{
    start();
    EXPECT_EQ(event("ECHO").text, "start 1, reset 2");
    EXPECT_TRUE(ingest(command(0x18c0, 5)));
    EXPECT_EQ(event("ECHO").text, "code 5");
    EXPECT_EQ(pocket_running(), 1u);
    EXPECT_TRUE(pocket_stop(10000));
    EXPECT_EQ(pocket_running(), 0u);
    EXPECT_EQ(last_status, CFE_ES_RunStatus_SYS_DELETE);
    EXPECT_LE(children, 1); // it did not outlive its app
}

TEST_F(Apps, AnAppThatIsRestartedBeginsAnewAndItsStoreStays)
{
    start();
    EXPECT_EQ(event("ECHO").text, "start 1, reset 2");
    for (int i = 2; i < 6; i++) {
        ASSERT_EQ(pocket_restart_app("ECHO"), 0);
        EXPECT_EQ(event("ECHO").text, "start " + std::to_string(i) + ", reset 3");
        ASSERT_TRUE(pocket_operational(10000)); // nothing of the one before is left
        EXPECT_TRUE(ingest(command(0x18c0, unsigned(i))));
        EXPECT_EQ(event("ECHO").text, "code " + std::to_string(i));
    }
    EXPECT_EQ(starts, 5);
    EXPECT_EQ(pocket_restart_app("ELSE"), CFE_ES_ERR_NAME_NOT_FOUND);
}

TEST_F(Apps, AnAppThatEndsByItselfLeavesNothing)
{
    start();
    EXPECT_TRUE(ingest(command(0x18c0, 9)));
    EXPECT_EQ(event("ECHO").text, "start 1, reset 2");
    EXPECT_EQ(event("ECHO").text, "code 9");
    for (int i = 0; i < 10000 && pocket_running() > 0; i++) {
        OS_TaskDelay(1);
    }
    EXPECT_EQ(pocket_running(), 0u);
    EXPECT_EQ(last_status, CFE_ES_RunStatus_APP_ERROR);
    EXPECT_EQ(pocket_counts().apps_failed, 1u);
    const auto before = pocket_counts().no_subscriber;
    EXPECT_TRUE(ingest(command(0x18c0, 5)));
    EXPECT_EQ(pocket_counts().no_subscriber, before + 1);
    start(); // its name is free again
}

TEST_F(Apps, AScriptWithAMistakeStartsNothing)
{
    const std::string good = "CFE_APP, echo, ECHO_AppMain, ECHO, 55, 16384, 0x0, 0;\n";
    const std::pair<std::string, std::string> mistakes[] = {
        {"CFE_APP, echo, ECHO_AppMain, ECHO, 55, 16384, 0x0;\n", "line 2: a line must have 8 fields"},
        {"CFE_LIB, echo, ECHO_AppMain, ECHO, 55, 16384, 0x0, 0;\n", "the kind must be CFE_APP"},
        {"CFE_APP, echo, NO_AppMain, ECHO, 55, 16384, 0x0, 0;\n", "there is no such entry point: NO_AppMain"},
        {"CFE_APP, echo, ECHO_AppMain, ECHO, 300, 16384, 0x0, 0;\n", "a priority must be 0 to 255: 300"},
        {"CFE_APP, echo, ECHO_AppMain, ECHO, 55, none, 0x0, 0;\n", "a stack must have"},
        {"CFE_APP, echo, ECHO_AppMain, , 55, 16384, 0x0, 0;\n", "a name must have 1 to 19 characters"},
        {"CFE_APP, echo, ECHO_AppMain, ECHO, 55, 16384, 0x0, 0\n", "a line must end with a semicolon"},
    };
    for (const auto &[line, says] : mistakes) {
        testing::internal::CaptureStdout();
        EXPECT_EQ(script(good + line), CFE_ES_BAD_ARGUMENT);
        EXPECT_NE(testing::internal::GetCapturedStdout().find(says), std::string::npos) << says;
    }
    testing::internal::CaptureStdout();
    EXPECT_EQ(pocket_run_script("/cf/absent.scr"), CFE_ES_FILE_IO_ERR);
    testing::internal::GetCapturedStdout();
    EXPECT_EQ(pocket_running(), 0u);
    EXPECT_EQ(starts, 0);
}

TEST_F(Apps, ChecksumsOfMemoryAreTheDefaultOnes)
{
    // The check value of this CRC for these nine characters, from catalogues of such.
    EXPECT_EQ(CFE_ES_CalculateCRC("123456789", 9, 0, CFE_MISSION_ES_DEFAULT_CRC), 0xbb3du);
    const std::uint32_t half = CFE_ES_CalculateCRC("1234", 4, 0, CFE_MISSION_ES_DEFAULT_CRC);
    EXPECT_EQ(CFE_ES_CalculateCRC("56789", 5, half, CFE_MISSION_ES_DEFAULT_CRC), 0xbb3du);
}

TEST_F(Apps, StoresHaveBounds)
{
    CFE_ES_CDSHandle_t h;
    int x = 1;
    EXPECT_EQ(CFE_ES_RegisterCDS(&h, 0, "a"), CFE_ES_CDS_INVALID_SIZE);
    EXPECT_EQ(CFE_ES_RegisterCDS(&h, 8, "a name that is too long"), CFE_ES_CDS_INVALID_NAME);
    ASSERT_EQ(CFE_ES_RegisterCDS(&h, sizeof x, "a"), 0);
    EXPECT_EQ(CFE_ES_RestoreFromCDS(&x, h), CFE_ES_CDS_BLOCK_CRC_ERR); // never written
    EXPECT_EQ(CFE_ES_CopyToCDS(h, &x), 0);
    EXPECT_EQ(CFE_ES_RestoreFromCDS(&x, h), 0);
    EXPECT_EQ(CFE_ES_RegisterCDS(&h, 8, "a"), CFE_ES_CDS_INVALID_SIZE);
    EXPECT_EQ(CFE_ES_RegisterCDS(&h, 4095, "b"), CFE_ES_CDS_INSUFFICIENT_MEMORY);
    EXPECT_EQ(CFE_ES_CopyToCDS(CFE_ES_CDSHandle_t{5}, &x), CFE_ES_ERR_RESOURCEID_NOT_VALID);
}

} // namespace apps_test
