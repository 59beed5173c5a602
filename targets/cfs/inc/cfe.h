/* SPDX-License-Identifier: Apache-2.0 */
/* The header that an app includes. It is pure C, as cFE's own: C++ code includes it within extern "C". */
#ifndef CFE_H
#define CFE_H

#include "cfe_config.h"
#include "cfe_error.h"
#include "cfe_es.h"
#include "cfe_evs.h"
#include "cfe_msg.h"
#include "cfe_sb.h"
#include "cfe_tbl.h"
#include "cfe_time.h"
#include "common_types.h"
#include "osapi.h"

#endif
