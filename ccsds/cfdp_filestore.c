/* SPDX-License-Identifier: Apache-2.0 */
#include "ccsds/cfdp_transaction.h"

/* Append a file to one that is open. */
static int append_file(Cfdp *cfdp, const char *name, int to, uint64_t *at)
{
    const CfdpStore *store = &cfdp->set.store;
    const int from = store->open(store->user, name, CFDP_OPEN_READ);
    if (from < 0) {
        return from;
    }
    const int64_t size = store->size(store->user, from);
    int result = size < 0 ? CFDP_BROKEN : 0;
    for (int64_t done = 0; done < size && result >= 0;) {
        const uint64_t left = (uint64_t)(size - done);
        const size_t n = left < cfdp->set.work_n ? (size_t)left : cfdp->set.work_n;
        result = store->read(store->user, from, (uint64_t)done, cfdp->set.work, n);
        if (result >= 0) {
            result = store->write(store->user, to, *at, cfdp->set.work, n);
        }
        done += (int64_t)n;
        *at += n;
    }
    store->close(store->user, from);
    return result;
}

static int file_exists(const CfdpStore *store, const char *name)
{
    const int file = store->open(store->user, name, CFDP_OPEN_READ);
    if (file >= 0) {
        store->close(store->user, file);
    }
    return file >= 0 ? 1 : file == CFDP_ABSENT ? 0 : file;
}

/* Make the first file anew, of its own bytes if `append`, and of those of the second: whole or not at all. */
static int rebuild_file(Cfdp *cfdp, const CfdpTransaction *t, const char *first, const char *second, int append)
{
    const CfdpStore *store = &cfdp->set.store;
    char name[CFDP_NAME];
    cfdp_unfinished_name(cfdp, t, name);
    const int file = store->open(store->user, name, CFDP_OPEN_NEW);
    uint64_t at = 0;
    if (file < 0) {
        return file;
    }
    int result = append ? append_file(cfdp, first, file, &at) : 0;
    result = result >= 0 ? append_file(cfdp, second, file, &at) : result;
    store->close(store->user, file);
    result = result >= 0 ? store->rename(store->user, name, first) : result;
    if (result < 0) {
        (void)store->remove(store->user, name);
        return CFDP_REFUSED;
    }
    return result;
}

uint8_t cfdp_perform(Cfdp *cfdp, const CfdpTransaction *t, const CfdpFilestore *request)
{
    static const uint8_t refused[] = {1, 2, 3, 3, 3, 1, 2, 2, 2};
    const CfdpStore *store = &cfdp->set.store;
    const uint8_t action = request->action;
    char first[CFDP_NAME], second[CFDP_NAME];
    int result = CFDP_REFUSED;
    if ((cfdp_peer(cfdp, t->peer)->allowed & CFDP_ALLOW_FILESTORE) == 0u || !cfdp_copy_name(first, request->first) ||
        !cfdp_copy_name(second, request->second)) {
        return refused[action];
    }
    const int has_first = file_exists(store, first), has_second = file_exists(store, second);
    switch (action) {
    case CFDP_CREATE_FILE:
        result = has_first == 0 ? store->open(store->user, first, CFDP_OPEN_NEW) : CFDP_REFUSED;
        if (result >= 0) {
            store->close(store->user, result);
        }
        break;
    case CFDP_DELETE_FILE:
    case CFDP_DENY_FILE: result = store->remove(store->user, first); break;
    case CFDP_RENAME_FILE:
        if (has_first == 1 && has_second == 1) {
            return 2u;
        }
        result = has_first == 1 && has_second == 0 ? store->rename(store->user, first, second)
                 : has_first == 0                  ? CFDP_ABSENT
                                                   : CFDP_REFUSED;
        break;
    case CFDP_APPEND_FILE:
    case CFDP_REPLACE_FILE:
        if (has_first == 1 && has_second == 0) {
            return 2u;
        }
        result = has_first == 1 && has_second == 1
                     ? rebuild_file(cfdp, t, first, second, action == (uint8_t)CFDP_APPEND_FILE)
                 : has_first == 0 ? CFDP_ABSENT
                                  : CFDP_REFUSED;
        break;
    case CFDP_CREATE_DIRECTORY: result = store->make_directory(store->user, first); break;
    default: /* CFDP_REMOVE_DIRECTORY, CFDP_DENY_DIRECTORY */
        result = store->remove_directory(store->user, first);
        break;
    }
    const int deny = action == (uint8_t)CFDP_DENY_FILE || action == (uint8_t)CFDP_DENY_DIRECTORY;
    return result >= 0 || (deny && result == CFDP_ABSENT) ? 0u : result == CFDP_ABSENT ? 1u : refused[action];
}
