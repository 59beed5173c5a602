/* SPDX-License-Identifier: Apache-2.0 */
#include "../../inc/common_types.h"
