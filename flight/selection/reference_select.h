/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_SELECTION_REFERENCE_SELECT_H
#define FLIGHT_SELECTION_REFERENCE_SELECT_H

#include "flight/msg/attitude.h"
#include "flight/selection/newest.h"

/** The newest of several references, of equally new ones the first, as it is; never one that is not finite. So
 *  guidance modules that stand in tasks of different modes drive one tracking error:
 *  a module that its mode has suspended writes nothing new. It stands behind them in its task, and its own task in each
 *  of their modes. */
typedef struct ReferenceSelect {
    struct {
        AttReference a;
        AttReference b; ///< optional: of another module
        AttReference c; ///< optional: of another module
        AttReference d; ///< optional: of another module
        AttReference e; ///< optional: of another module
        AttReference f; ///< optional: of another module
    } in;
    struct {
        AttReference reference;
    } out;
    struct {
        NewestMemory memory;
    } mem;
} ReferenceSelect;

void reference_select_reset(ReferenceSelect *m);
void reference_select_update(ReferenceSelect *m, Tick t);

#endif
