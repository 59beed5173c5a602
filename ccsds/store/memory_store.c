/* SPDX-License-Identifier: Apache-2.0 */
/* A page is: CRC-32 of the rest, kind, the number of the file's next page, the number of the file. Then comes data, or
 * in an entry: the number of its last change, size, sum of the pages' CRCs, name from the root on. Behind the pages is
 * a byte of flags for each. */
#include "ccsds/store/memory_store.h"

#include <string.h>

enum { NEXT = 4, OWNER = 8, DATA = 12, CHANGED = 12, SIZE = 16, SUM = 20, NAME = 24 };
enum { KIND_FILE = 0x3C, KIND_DIRECTORY = 0xC5, KIND_DATA = 0x5A };
enum { USED = 1, ENTRY = 2, DIRTY = 4, WORN = 8 };
enum { NONE = 0xFFFFFF };     /* no next page */
enum { HANDLE = 0x3FFFFFFF }; /* bits of a file's number in its handle; then one: it may be written */

static uint8_t *at(const MemoryStore *m, uint32_t page)
{
    return (uint8_t *)(m + 1) + (size_t)page * MEMORY_PAGE;
}

static uint8_t *flags(const MemoryStore *m, uint32_t page)
{
    return at(m, m->pages) + page;
}

static uint32_t crc(const uint8_t *p)
{
    return cfdp_checksum((uint8_t)CFDP_CRC32, 0u, 0u, p + NEXT, MEMORY_PAGE - NEXT);
}

static void put_next(uint8_t *p, uint32_t kind, uint32_t next)
{
    ccsds_put32(p + NEXT, kind << 24 | next);
}

static void seal(MemoryStore *m, uint32_t page)
{
    ccsds_put32(at(m, page), crc(at(m, page)));
    *flags(m, page) |= DIRTY;
}

static void seal_data(MemoryStore *m, uint32_t entry, uint32_t page)
{
    const uint32_t old = ccsds_get32(at(m, page));
    seal(m, page);
    ccsds_put32(at(m, entry) + SUM, ccsds_get32(at(m, entry) + SUM) - old + ccsds_get32(at(m, page)));
}

static uint32_t pages_of(uint64_t size)
{
    return (uint32_t)((size + MEMORY_DATA - 1u) / MEMORY_DATA);
}

static int sound(const MemoryStore *m, uint32_t page)
{
    return ccsds_get32(at(m, page)) == crc(at(m, page));
}

/* Whether it is a sound page of the file `owner`. */
static int is_data(const MemoryStore *m, uint32_t page, uint32_t owner)
{
    return page < m->pages && at(m, page)[NEXT] == KIND_DATA && ccsds_get32(at(m, page) + OWNER) == owner &&
           sound(m, page);
}

static uint32_t next_of(const MemoryStore *m, uint32_t page)
{
    return ccsds_get24(at(m, page) + NEXT + 1);
}

/* A free page, for the file `owner`; there is one. */
static uint32_t take(MemoryStore *m, uint32_t kind, uint32_t owner)
{
    while ((*flags(m, m->turn) & (USED | WORN)) != 0) {
        m->turn = (m->turn + 1u) % m->pages;
    }
    const uint32_t page = m->turn;
    m->turn = (page + 1u) % m->pages;
    m->free--;
    memset(at(m, page), 0, MEMORY_PAGE);
    put_next(at(m, page), kind, NONE);
    ccsds_put32(at(m, page) + OWNER, owner);
    *flags(m, page) = kind == KIND_DATA ? USED : USED | ENTRY;
    return page;
}

/* A file is empty from now on. Its pages stay as they are, because no entry names them. */
static void empty(MemoryStore *m, uint32_t entry)
{
    for (uint32_t page = next_of(m, entry);
         is_data(m, page, ccsds_get32(at(m, entry) + OWNER)) && (*flags(m, page) & USED) != 0;
         page = next_of(m, page)) {
        *flags(m, page) = 0;
        m->free++;
    }
    put_next(at(m, entry), at(m, entry)[NEXT], NONE);
    ccsds_put32(at(m, entry) + SIZE, 0u);
    ccsds_put32(at(m, entry) + SUM, 0u);
}

static void drop(MemoryStore *m, uint32_t entry)
{
    empty(m, entry);
    memset(at(m, entry), 0, MEMORY_PAGE);
    *flags(m, entry) = DIRTY;
    m->free++;
}

/* ---- names */

/* The entry of a name of n bytes, or CFDP_ABSENT, or CFDP_BROKEN if it is damaged. */
static int32_t find(const MemoryStore *m, const char *name, size_t n)
{
    for (uint32_t i = 0; i < m->pages; i++) {
        const uint8_t *p = at(m, i) + NAME;
        if ((*flags(m, i) & ENTRY) != 0 && memcmp(p, name, n) == 0 && p[n] == 0u) {
            return sound(m, i) ? (int32_t)i : CFDP_BROKEN;
        }
    }
    return CFDP_ABSENT;
}

static int is_directory(const MemoryStore *m, int32_t entry)
{
    return at(m, (uint32_t)entry)[NEXT] == KIND_DIRECTORY;
}

/* Returns the length of a name whose parts are good, and whose directories are there, if m is not NULL. */
static int32_t length_of(const MemoryStore *m, const char *name)
{
    for (size_t i = 0, begin = 0; i < CFDP_NAME; i++) {
        if (name[i] != '\0' && name[i] != '/') {
            continue;
        }
        const size_t n = i - begin;
        if (n == 0u || (name[begin] == '.' && (n == 1u || (n == 2u && name[begin + 1u] == '.')))) {
            return CFDP_REFUSED;
        }
        if (name[i] == '\0') {
            return (int32_t)i;
        }
        const int32_t entry = m == NULL ? 0 : find(m, name, i);
        if (entry < 0 || (m != NULL && !is_directory(m, entry))) {
            return entry < 0 ? entry : CFDP_REFUSED;
        }
        begin = i + 1u;
    }
    return CFDP_REFUSED;
}

/* The entry of a name; *n: its length. */
static int32_t named(const MemoryStore *m, const char *name, int32_t *n)
{
    *n = m->mounted != 0u ? length_of(m, name) : CFDP_BROKEN;
    return *n < 0 ? *n : find(m, name, (size_t)*n);
}

static void give_name(MemoryStore *m, uint32_t entry, const char *name, size_t n)
{
    uint8_t *p = at(m, entry);
    memset(p + NAME, 0, CFDP_NAME);
    memcpy(p + NAME, name, n);
    ccsds_put32(p + CHANGED, m->serial++);
    seal(m, entry);
}

static int32_t make(MemoryStore *m, uint32_t kind, const char *name, size_t n)
{
    if (m->free == 0u) {
        return CFDP_FULL;
    }
    const uint32_t entry = take(m, kind, m->serial++);
    give_name(m, entry, name, n);
    return (int32_t)entry;
}

/* ---- the functions of the store */

static int open_file(void *user, const char *name, CfdpOpen how)
{
    MemoryStore *m = user;
    int32_t n, entry = named(m, name, &n);
    if (entry >= 0 && is_directory(m, entry)) {
        return CFDP_REFUSED;
    }
    if (entry >= 0 && how == CFDP_OPEN_NEW) {
        empty(m, (uint32_t)entry);
        seal(m, (uint32_t)entry);
    } else if (n >= 0 && entry == CFDP_ABSENT && how == CFDP_OPEN_NEW) {
        entry = make(m, KIND_FILE, name, (size_t)n);
    }
    return entry < 0
               ? entry
               : (int)((ccsds_get32(at(m, (uint32_t)entry) + OWNER) & HANDLE) << 1 | (how != CFDP_OPEN_READ ? 1u : 0u));
}

static void close_file(void *user, int file)
{
    (void)user;
    (void)file;
}

/* The entry of a handle. */
static int32_t opened(const MemoryStore *m, int file)
{
    for (uint32_t i = 0; m->mounted != 0u && file >= 0 && i < m->pages; i++) {
        if ((*flags(m, i) & ENTRY) != 0 && at(m, i)[NEXT] == KIND_FILE &&
            (ccsds_get32(at(m, i) + OWNER) & HANDLE) == (uint32_t)file >> 1) {
            return sound(m, i) ? (int32_t)i : CFDP_BROKEN;
        }
    }
    return CFDP_BROKEN;
}

static int64_t size_of(void *user, int file)
{
    const MemoryStore *m = user;
    const int32_t entry = opened(m, file);
    return entry < 0 ? entry : (int64_t)ccsds_get32(at(m, (uint32_t)entry) + SIZE);
}

/* Page k of a file, or the entry for k = -1, or CFDP_BROKEN. */
static int32_t nth(const MemoryStore *m, uint32_t entry, int64_t k)
{
    uint32_t page = entry;
    for (; k >= 0 && page < m->pages; k--) {
        page = next_of(m, page);
    }
    return page < m->pages ? (int32_t)page : CFDP_BROKEN;
}

/* Copy n bytes from or to a file that has them. */
static int copy(MemoryStore *m, uint32_t entry, uint64_t offset, uint8_t *to, const uint8_t *from, size_t n)
{
    const uint32_t owner = ccsds_get32(at(m, entry) + OWNER);
    int32_t page = nth(m, entry, (int64_t)(offset / MEMORY_DATA));
    while (n != 0u) {
        const size_t begin = (size_t)(offset % MEMORY_DATA), room = MEMORY_DATA - begin, part = n < room ? n : room;
        if (page < 0 || !is_data(m, (uint32_t)page, owner)) {
            return CFDP_BROKEN;
        }
        uint8_t *p = at(m, (uint32_t)page) + DATA + begin;
        if (to != NULL) {
            memcpy(to, p, part);
            to += part;
        } else {
            memcpy(p, from, part);
            from += part;
            seal_data(m, entry, (uint32_t)page);
        }
        offset += part;
        n -= part;
        page = n != 0u ? nth(m, (uint32_t)page, 0) : page;
    }
    return 0;
}

static int read_file(void *user, int file, uint64_t offset, uint8_t *bytes, size_t n)
{
    MemoryStore *m = user;
    const int32_t entry = opened(m, file);
    const uint64_t size = entry < 0 ? 0u : ccsds_get32(at(m, (uint32_t)entry) + SIZE);
    return entry < 0 || offset > size || n > size - offset ? CFDP_BROKEN
                                                           : copy(m, (uint32_t)entry, offset, bytes, NULL, n);
}

static int write_file(void *user, int file, uint64_t offset, const uint8_t *bytes, size_t n)
{
    MemoryStore *m = user;
    const int32_t opened_at = opened(m, file);
    const uint64_t most = (uint64_t)m->pages * MEMORY_DATA;
    if (opened_at < 0 || (file & 1) == 0) {
        return opened_at < 0 ? opened_at : CFDP_REFUSED;
    }
    if (n == 0u) {
        return 0;
    }
    if (offset > most || n > most - offset) {
        return CFDP_FULL;
    }
    const uint32_t entry = (uint32_t)opened_at, old = ccsds_get32(at(m, entry) + SIZE);
    const uint32_t owner = ccsds_get32(at(m, entry) + OWNER);
    const uint64_t end = offset + n;
    uint32_t more = end > old ? pages_of(end) - pages_of(old) : 0u;
    if (more > m->free) {
        return CFDP_FULL;
    }
    int32_t last = more != 0u ? nth(m, entry, (int64_t)pages_of(old) - 1) : 0;
    if (more != 0u && (last < 0 || ((uint32_t)last != entry && !is_data(m, (uint32_t)last, owner)))) {
        return CFDP_BROKEN;
    }
    for (; more != 0u; more--) {
        const uint32_t page = take(m, KIND_DATA, owner);
        put_next(at(m, (uint32_t)last), at(m, (uint32_t)last)[NEXT], page);
        if ((uint32_t)last != entry) {
            seal_data(m, entry, (uint32_t)last);
        }
        seal_data(m, entry, page);
        last = (int32_t)page;
    }
    if (end > old) {
        ccsds_put32(at(m, entry) + SIZE, (uint32_t)end);
    }
    const int result = copy(m, entry, offset, NULL, bytes, n);
    seal(m, entry);
    return result;
}

static int rename_file(void *user, const char *from, const char *to)
{
    MemoryStore *m = user;
    int32_t n;
    const int32_t entry = named(m, from, &n);
    if (n < 0) {
        return n;
    }
    const int32_t there = named(m, to, &n);
    if (n < 0 || entry < 0) {
        return n < 0 ? n : entry;
    }
    if (is_directory(m, entry) || (there >= 0 && is_directory(m, there))) {
        return CFDP_REFUSED;
    }
    if (there != entry) {
        if (there >= 0) {
            drop(m, (uint32_t)there);
        }
        give_name(m, (uint32_t)entry, to, (size_t)n);
    }
    return 0;
}

static int remove_file(void *user, const char *name)
{
    MemoryStore *m = user;
    int32_t n;
    const int32_t entry = named(m, name, &n);
    if (entry < 0 || is_directory(m, entry)) {
        return entry < 0 ? entry : CFDP_REFUSED;
    }
    drop(m, (uint32_t)entry);
    return 0;
}

static int make_directory(void *user, const char *name)
{
    MemoryStore *m = user;
    int32_t n, entry = named(m, name, &n);
    if (n < 0 || entry >= 0) {
        return n < 0 ? n : CFDP_REFUSED;
    }
    entry = make(m, KIND_DIRECTORY, name, (size_t)n);
    return entry < 0 ? entry : 0;
}

/* What an entry is called within a directory with a name of n bytes; NULL: it is not directly in there. */
static const char *within(const MemoryStore *m, uint32_t entry, const char *directory, size_t n)
{
    const char *name = (const char *)at(m, entry) + NAME;
    if ((*flags(m, entry) & ENTRY) == 0 || memcmp(name, directory, n) != 0 || (n != 0u && name[n] != '/')) {
        return NULL;
    }
    name += n != 0u ? n + 1u : 0u;
    for (const char *c = name; *c != '\0'; c++) {
        if (*c == '/') {
            return NULL;
        }
    }
    return name;
}

static int remove_directory(void *user, const char *name)
{
    MemoryStore *m = user;
    int32_t n;
    const int32_t entry = named(m, name, &n);
    if (entry < 0 || !is_directory(m, entry)) {
        return entry < 0 ? entry : CFDP_REFUSED;
    }
    for (uint32_t i = 0; i < m->pages; i++) {
        if (within(m, i, name, (size_t)n) != NULL) {
            return CFDP_REFUSED;
        }
    }
    drop(m, (uint32_t)entry);
    return 0;
}

static int list_directory(void *user, const char *directory, CfdpEach each, void *to)
{
    MemoryStore *m = user;
    int32_t n = 0;
    const int32_t entry = directory[0] == '\0' ? (m->mounted != 0u ? 0 : CFDP_BROKEN) : named(m, directory, &n);
    if (entry < 0 || (n != 0 && !is_directory(m, entry))) {
        return entry < 0 ? entry : CFDP_REFUSED;
    }
    int result = 0;
    for (uint32_t i = 0; result >= 0 && i < m->pages; i++) {
        const char *name = within(m, i, directory, (size_t)n);
        if (name != NULL && name[0] != '.') {
            char given[CFDP_NAME + 1] = "";
            size_t k = 0;
            for (; name[k] != '\0'; k++) {
                given[k] = name[k];
            }
            given[k] = is_directory(m, (int32_t)i) ? '/' : '\0';
            result = each(to, given);
        }
    }
    return result;
}

CfdpStore memory_store_files(MemoryStore *store)
{
    return (CfdpStore){.open = open_file,
                       .close = close_file,
                       .size = size_of,
                       .read = read_file,
                       .write = write_file,
                       .rename = rename_file,
                       .remove = remove_file,
                       .make_directory = make_directory,
                       .remove_directory = remove_directory,
                       .list = list_directory,
                       .user = store};
}

/* ---- pages */

void memory_store_begin(MemoryStore *store, size_t bytes)
{
    const size_t room = (bytes - sizeof *store) / (MEMORY_PAGE + 1u);
    memset(store, 0, bytes);
    store->pages = room < MEMORY_PAGES_MAX ? (uint32_t)room : MEMORY_PAGES_MAX;
}

uint8_t *memory_store_page(MemoryStore *store, uint32_t page)
{
    return at(store, page);
}

/* Whether an entry and all its pages are of one time. */
static int whole(const MemoryStore *m, uint32_t entry)
{
    const uint8_t *p = at(m, entry);
    uint32_t sum = 0u, page = entry, n = pages_of(ccsds_get32(p + SIZE));
    if (!sound(m, entry) || length_of(NULL, (const char *)p + NAME) < 0 || n > m->pages) {
        return 0;
    }
    for (; n != 0u; n--) {
        page = next_of(m, page);
        if (!is_data(m, page, ccsds_get32(p + OWNER))) {
            return 0;
        }
        sum += ccsds_get32(at(m, page));
    }
    return next_of(m, page) == NONE && sum == ccsds_get32(p + SUM);
}

/* Of two entries of one name, or of one file, the later is left. */
static void leave_one(MemoryStore *m, uint32_t entry)
{
    const uint8_t *p = at(m, entry);
    for (uint32_t i = 0; i < entry; i++) {
        const uint8_t *q = at(m, i);
        if ((*flags(m, i) & ENTRY) != 0 &&
            (ccsds_get32(p + OWNER) == ccsds_get32(q + OWNER) || memcmp(p + NAME, q + NAME, CFDP_NAME) == 0)) {
            const uint32_t old = ccsds_get32(p + CHANGED) > ccsds_get32(q + CHANGED) ? i : entry;
            memset(at(m, old), 0, MEMORY_PAGE);
            *flags(m, old) = DIRTY;
            if (old == entry) {
                return;
            }
        }
    }
}

/* Make the directories that an entry is in, if they are gone. */
static void enter(MemoryStore *m, uint32_t entry)
{
    char name[CFDP_NAME];
    memcpy(name, at(m, entry) + NAME, CFDP_NAME);
    for (size_t i = 0; name[i] != '\0'; i++) {
        if (name[i] != '/') {
            continue;
        }
        const int32_t there = find(m, name, i);
        if (there < 0 ? make(m, KIND_DIRECTORY, name, i) < 0 : !is_directory(m, there)) {
            drop(m, entry);
            m->lost++;
            return;
        }
    }
}

void memory_store_mount(MemoryStore *store)
{
    MemoryStore *m = store;
    memset(flags(m, 0), 0, m->pages);
    m->serial = m->lost = m->turn = 0;
    for (uint32_t i = 0; i < m->pages; i++) {
        uint8_t *p = at(m, i);
        if (p[NEXT] != KIND_FILE && p[NEXT] != KIND_DIRECTORY) {
            continue;
        }
        if (whole(m, i)) {
            const uint32_t changed = ccsds_get32(p + CHANGED);
            m->serial = changed >= m->serial ? changed + 1u : m->serial;
            *flags(m, i) = USED | ENTRY;
            leave_one(m, i);
        } else {
            memset(p, 0, MEMORY_PAGE);
            *flags(m, i) = DIRTY;
            m->lost++;
        }
    }
    m->free = m->pages;
    for (uint32_t i = 0; i < m->pages; i++) {
        for (uint32_t page = i; (*flags(m, i) & ENTRY) != 0 && page != NONE; page = next_of(m, page)) {
            *flags(m, page) |= USED;
            m->free--;
        }
    }
    for (uint32_t i = 0; i < m->pages; i++) {
        if ((*flags(m, i) & ENTRY) != 0) {
            enter(m, i);
        }
    }
    m->mounted = 1u;
}

int32_t memory_store_dirty(const MemoryStore *store, uint32_t *n)
{
    /* Data before the entries that name it, and new entries before old ones are cleared. */
    enum { RANKS = 3 };
    int32_t first[RANKS] = {-1, -1, -1};
    *n = 0u;
    for (uint32_t i = 0; i < store->pages; i++) {
        const uint32_t flag = *flags(store, i);
        const uint32_t rank = (flag & USED) == 0u ? 2u : (flag & ENTRY) != 0u ? 1u : 0u;
        if ((flag & DIRTY) != 0u) {
            first[rank] = first[rank] < 0 ? (int32_t)i : first[rank];
            ++*n;
        }
    }
    return first[0] >= 0 ? first[0] : first[1] >= 0 ? first[1] : first[2];
}

void memory_store_mark(MemoryStore *store, uint32_t page, int dirty)
{
    uint8_t *flag = flags(store, page);
    *flag = (uint8_t)(dirty ? *flag | DIRTY : *flag & ~DIRTY);
}

int memory_store_move(MemoryStore *store, uint32_t page)
{
    MemoryStore *m = store;
    const uint32_t owner = ccsds_get32(at(m, page) + OWNER);
    uint32_t entry = page;
    for (uint32_t i = 0; i < m->pages && (*flags(m, page) & ENTRY) == 0; i++) {
        entry = (*flags(m, i) & ENTRY) != 0 && ccsds_get32(at(m, i) + OWNER) == owner ? i : entry;
    }
    const int used = (*flags(m, page) & USED) != 0;
    const int good = used && at(m, entry)[NEXT] != KIND_DATA && whole(m, entry);
    if (good && m->free == 0u) {
        memory_store_mark(m, page, 0);
        return 0;
    }
    if (good) {
        const uint32_t moved = take(m, KIND_DATA, owner);
        memcpy(at(m, moved), at(m, page), MEMORY_PAGE);
        *flags(m, moved) = *flags(m, page) | DIRTY;
        m->free++;
        if (entry == page) {
            entry = moved;
            ccsds_put32(at(m, entry) + CHANGED, m->serial++); /* later than the copy in the worn page */
        } else {
            uint32_t before = entry;
            while (next_of(m, before) != page) {
                before = next_of(m, before);
            }
            put_next(at(m, before), at(m, before)[NEXT], moved);
            if (before != entry) {
                seal_data(m, entry, before);
            }
        }
        seal(m, entry);
    } else if (used) {
        m->free++; /* it was damaged in memory: nothing to move */
    }
    m->free -= (*flags(m, page) & WORN) == 0;
    *flags(m, page) = WORN;
    memset(at(m, page), 0, MEMORY_PAGE);
    return 1;
}
