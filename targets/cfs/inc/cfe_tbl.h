/* SPDX-License-Identifier: Apache-2.0 */
/* Tables: data that an app owns and validates, and that the ground replaces as a whole. */
#ifndef CFE_TBL_H
#define CFE_TBL_H

#include "cfe_config.h"
#include "cfe_error.h"
#include "cfe_time.h"

#define CFE_TBL_CMD_MID 0x1804
#define CFE_TBL_NOOP_CC 0
#define CFE_TBL_RESET_COUNTERS_CC 1
#define CFE_TBL_LOAD_CC 2     ///< char LoadFilename[64]: load a file into the inactive image
#define CFE_TBL_DUMP_CC 3     ///< uint16 ActiveTableFlag, char TableName[40], char DumpFilename[64]
#define CFE_TBL_VALIDATE_CC 4 ///< uint16 ActiveTableFlag, char TableName[40]
#define CFE_TBL_ACTIVATE_CC 5 ///< char TableName[40]: activate a load that passed validation

#define CFE_TBL_OPT_SNGL_BUFFER 0x0000
#define CFE_TBL_OPT_DBL_BUFFER 0x0001
#define CFE_TBL_OPT_LOAD_DUMP 0x0000
#define CFE_TBL_OPT_DEFAULT (CFE_TBL_OPT_SNGL_BUFFER | CFE_TBL_OPT_LOAD_DUMP)
#define CFE_TBL_BAD_TABLE_HANDLE ((CFE_TBL_Handle_t)-1)

typedef int16 CFE_TBL_Handle_t;
typedef int32 (*CFE_TBL_CallbackFuncPtr_t)(void *TblPtr);
typedef enum CFE_TBL_SrcEnum { CFE_TBL_SRC_FILE = 0, CFE_TBL_SRC_ADDRESS } CFE_TBL_SrcEnum_t;

/** The full name of the table is APP.Name. A second call by the same app returns CFE_TBL_WARN_DUPLICATE, which is no
 *  error. */
CFE_Status_t CFE_TBL_Register(CFE_TBL_Handle_t *TblHandlePtr, const char *Name, size_t Size, uint16 TblOptionFlags,
                              CFE_TBL_CallbackFuncPtr_t TblValidationFuncPtr);
/** Read and validate a load, and activate it now, or in the next CFE_TBL_Manage if the app holds the address. */
CFE_Status_t CFE_TBL_Load(CFE_TBL_Handle_t TblHandle, CFE_TBL_SrcEnum_t SrcType, const void *SrcDataPtr);
/** Execute the pending commands of the ground: validate, update. */
CFE_Status_t CFE_TBL_Manage(CFE_TBL_Handle_t TblHandle);
CFE_Status_t CFE_TBL_Validate(CFE_TBL_Handle_t TblHandle);
CFE_Status_t CFE_TBL_Update(CFE_TBL_Handle_t TblHandle);
/** Returns CFE_TBL_INFO_UPDATED the first time after the content has changed. */
CFE_Status_t CFE_TBL_GetAddress(void **TblPtr, CFE_TBL_Handle_t TblHandle);
CFE_Status_t CFE_TBL_ReleaseAddress(CFE_TBL_Handle_t TblHandle);
CFE_Status_t CFE_TBL_GetStatus(CFE_TBL_Handle_t TblHandle);
CFE_Status_t CFE_TBL_Modified(CFE_TBL_Handle_t TblHandle);
CFE_Status_t CFE_TBL_Unregister(CFE_TBL_Handle_t TblHandle);

#endif
