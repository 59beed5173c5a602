/* SPDX-License-Identifier: Apache-2.0 */
/* The macro with which a source file names its table. The pocket reads .tbl files only; the macro makes such sources
 * compile. */
#ifndef CFE_TBL_FILEDEF_H
#define CFE_TBL_FILEDEF_H

#include "cfe_config.h"
#include "common_types.h"

typedef struct CFE_TBL_FileDef {
    char ObjectName[64];
    char TableName[CFE_MISSION_TBL_MAX_FULL_NAME_LEN];
    char Description[32];
    char TgtFilename[CFE_MISSION_MAX_FILE_LEN];
    uint32 ObjectSize;
} CFE_TBL_FileDef_t;

#define CFE_TBL_FILEDEF(object, table, description, file)                                                              \
    static OS_USED CFE_TBL_FileDef_t CFE_TBL_FileDef = {#object "\0", #table "\0", #description "\0", #file "\0",      \
                                                        sizeof(object)};

#endif
