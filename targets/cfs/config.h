/* SPDX-License-Identifier: Apache-2.0 */
/* The sizes of the static pools. A board may define other ones. */
#ifndef TARGETS_CFS_CONFIG_H
#define TARGETS_CFS_CONFIG_H

#ifndef POCKET_APPS
#define POCKET_APPS 8u
#endif
#ifndef POCKET_TASKS
#define POCKET_TASKS 24u
#endif
#ifndef POCKET_FILTERS
#define POCKET_FILTERS 8u ///< of the events of one app
#endif

#ifndef POCKET_PIPES
#define POCKET_PIPES 16u
#endif
#ifndef POCKET_PIPE_DEPTH
#define POCKET_PIPE_DEPTH 256u ///< the largest
#endif
#ifndef POCKET_ROUTES
#define POCKET_ROUTES 256u ///< subscriptions
#endif
#ifndef POCKET_SENT
#define POCKET_SENT 256u ///< message ids with a sequence counter
#endif
#ifndef POCKET_MESSAGES
#define POCKET_MESSAGES 64u ///< in all pipes together
#endif
#ifndef POCKET_MESSAGE_MAX
#define POCKET_MESSAGE_MAX 2048u ///< [bytes]
#endif

#ifndef POCKET_TABLES
#define POCKET_TABLES 96u
#endif
#ifndef POCKET_TABLE_MAX
#define POCKET_TABLE_MAX 16384u ///< [bytes] of one table, as cFE has it by default
#endif
#ifndef POCKET_TABLE_BYTES
#define POCKET_TABLE_BYTES 65536u ///< [bytes] of all tables
#endif
#ifndef POCKET_LOADS
#define POCKET_LOADS 4u ///< at the same time
#endif

#ifndef POCKET_STORES
#define POCKET_STORES 8u ///< blocks of critical data
#endif
#ifndef POCKET_STORE_BYTES
#define POCKET_STORE_BYTES 4096u ///< [bytes] of all blocks
#endif

#ifndef POCKET_SEMAPHORES
#define POCKET_SEMAPHORES 24u
#endif
#ifndef POCKET_FILES
#define POCKET_FILES 8u
#endif

#endif
