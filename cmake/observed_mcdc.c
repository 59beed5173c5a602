/* SPDX-License-Identifier: Apache-2.0 */
/* Python says where a process writes its counts, and when: a process of a pool ends without what a program does at its
 * end, and none is to leave a file in the user's folder. */
#include <stdlib.h>

void __llvm_profile_set_filename(const char *name);
int __llvm_profile_write_file(void);

__attribute__((constructor)) static void nowhere(void)
{
    if (getenv("LLVM_PROFILE_FILE") == NULL)
        __llvm_profile_set_filename("/dev/null");
}

/* 0 if they are written. name: stays where it is until then */
__attribute__((visibility("default"))) int fledge_observed_write(const char *name)
{
    __llvm_profile_set_filename(name);
    const int failed = __llvm_profile_write_file();
    __llvm_profile_set_filename("/dev/null");
    return failed;
}
