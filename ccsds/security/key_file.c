/* SPDX-License-Identifier: Apache-2.0 */
#define _DEFAULT_SOURCE /* fileno, explicit_bzero */
#include "ccsds/security/key_file.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

/* The value of a hex digit; -1: it is none. */
static int digit(char c)
{
    const char *const digits = "0123456789abcdef", *at = strchr(digits, c >= 'A' && c <= 'F' ? c + 32 : c);
    return c == '\0' || at == NULL ? -1 : (int)(at - digits);
}

/* Expand the key of a line. Returns NULL, or what is wrong. */
static const char *read_line(char *line, AesGcmKey *keys, size_t n)
{
    uint8_t bytes[AES_GCM_KEY_MAX];
    char *end = line;
    const unsigned long id = strtoul(line, &end, 10);
    if (line[0] == '-' || id < 1u || id > 65535u || (*end != ' ' && *end != '\t')) {
        return "a line is the id of a key, 1 to 65535, a space, and the key in hex";
    }
    end += strspn(end, " \t");
    size_t size = 0;
    while (size < sizeof bytes && digit(end[0]) >= 0 && digit(end[1]) >= 0) {
        bytes[size++] = (uint8_t)(digit(end[0]) * 16 + digit(end[1]));
        end += 2;
    }
    for (size_t i = 0; i < n; i++) {
        if (keys[i].id == id) {
            return "an earlier line has this id; give each key its own";
        }
    }
    const int good = end[strspn(end, " \t\r\n")] == '\0' && aes_gcm_expand(&keys[n], (uint16_t)id, bytes, size);
    explicit_bzero(bytes, sizeof bytes);
    return good ? NULL : "a key is 32, 48 or 64 hex digits; ./fledge keys link FILE makes one";
}

static size_t read_keys(FILE *file, AesGcmKey *keys, size_t room, const char **wrong, int *number)
{
    char line[256];
    size_t n = 0;
    struct stat status;
    if (fstat(fileno(file), &status) != 0 || !S_ISREG(status.st_mode)) {
        *wrong = "this is no file of keys";
        return 0;
    }
    if ((status.st_mode & (S_IRWXG | S_IRWXO)) != 0) {
        *wrong = "others may read these secret keys; chmod 600 keeps them yours, and if they might have, make new ones";
        return 0;
    }
    for (*number = 1; *wrong == NULL && fgets(line, sizeof line, file) != NULL; ++*number) {
        const char first = line[strspn(line, " \t\r\n")];
        if (first == '\0' || first == '#') {
            continue;
        }
        *wrong = n == room ? "more keys than this program takes" : read_line(line, keys, n);
        n++;
    }
    explicit_bzero(line, sizeof line);
    --*number;
    if (*wrong == NULL && n == 0) {
        *wrong = "it holds no key; ./fledge keys link FILE makes one";
        *number = 0;
    }
    return n;
}

size_t key_file_read(const char *path, AesGcmKey *keys, size_t room, char *why, size_t size)
{
    const char *wrong = NULL;
    int number = 0;
    size_t n = 0;
    FILE *file = fopen(path, "re");
    if (file == NULL) {
        const int missing = errno == ENOENT;
        (void)snprintf(why, size, "%s: %s%s", path, strerror(errno),
                       missing ? "; ./fledge keys link FILE makes a file of keys" : "");
        return 0;
    }
    n = read_keys(file, keys, room, &wrong, &number);
    (void)fclose(file);
    if (wrong == NULL) {
        return n;
    }
    if (number > 0) {
        (void)snprintf(why, size, "%s, line %d: %s", path, number, wrong);
    } else {
        (void)snprintf(why, size, "%s: %s", path, wrong);
    }
    return 0;
}
