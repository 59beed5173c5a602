/* SPDX-License-Identifier: Apache-2.0 */
/* A process of a pool ends without what a program does at its end: Python lets it write its counts. */
int __llvm_profile_write_file(void);

__attribute__((visibility("default"))) int fledge_observed_write(void)
{
    return __llvm_profile_write_file();
}
