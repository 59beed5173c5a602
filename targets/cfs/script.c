/* SPDX-License-Identifier: Apache-2.0 */
/* Start-up scripts: one line for each app, such as
 *
 *     CFE_APP, nav, NAV_AppMain, NAV, 55, 16384, 0x0, 0;
 *
 * The fields are: kind, file, entry point, name, priority, stack size, load address, exception action. An app that is
 * not linked with the program is loaded from its file, /cf/nav.so. The last two are ignored. A `!` ends the script. */
#include "targets/cfs/core.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LONGEST 128
#define FIELDS 8
#define MOST POCKET_APPS

typedef struct Line {
    char file[CFE_MISSION_MAX_FILE_LEN];
    char entry[CFE_MISSION_MAX_FILE_LEN];
    char name[CFE_MISSION_MAX_API_LEN];
    uint32 priority;
    size_t stack;
} Line;

typedef struct Script {
    Line lines[MOST];
    uint32 n;
    uint32 number; ///< of the current line
    uint32 errors;
} Script;

static void complain(Script *script, const char *problem, const char *text)
{
    script->errors++;
    OS_printf("start-up script, line %u: %s: %s\n", (unsigned)script->number, problem, text);
}

static bool is_number(const char *text, unsigned long most, unsigned long *value)
{
    char *end;
    *value = strtoul(text, &end, 0);
    return *text >= '0' && *text <= '9' && *end == '\0' && *value <= most;
}

static char *trimmed(char *text)
{
    while (*text == ' ' || *text == '\t') {
        text++;
    }
    size_t n = strlen(text);
    while (n > 0u && (text[n - 1u] == ' ' || text[n - 1u] == '\t')) {
        text[--n] = '\0';
    }
    return text;
}

/* Read the text before a semicolon. */
static void read_line(Script *script, char *text)
{
    char *field[FIELDS];
    uint32 n = 0;
    unsigned long priority, stack;
    for (char *at = text; at != NULL && n < FIELDS; n++) {
        char *comma = strchr(at, ',');
        if (comma != NULL) {
            *comma++ = '\0';
        }
        field[n] = trimmed(at);
        at = comma;
    }
    if (n != FIELDS) {
        complain(script, "a line must have 8 fields", trimmed(text));
    } else if (strcmp(field[0], "CFE_APP") != 0) {
        complain(script, "the kind must be CFE_APP", field[0]);
    } else if (!pocket_program(field[1], field[2])) {
        complain(script, "there is no such entry point", field[2]);
    } else if (strlen(field[2]) >= sizeof script->lines[0].entry || field[3][0] == '\0' ||
               strlen(field[3]) >= sizeof script->lines[0].name) {
        complain(script, "a name must have 1 to 19 characters", field[3]);
    } else if (!is_number(field[4], 255, &priority)) {
        complain(script, "a priority must be 0 to 255", field[4]);
    } else if (!is_number(field[5], 0x7fffffff, &stack) || stack == 0u) {
        complain(script, "a stack must have 1 to 2147483647 bytes", field[5]);
    } else if (script->n == MOST) {
        complain(script, "there are too many apps", field[3]);
    } else {
        Line *line = &script->lines[script->n++];
        (void)strcpy(line->file, field[1]);
        (void)strcpy(line->entry, field[2]);
        (void)strcpy(line->name, field[3]);
        line->priority = (uint32)priority;
        line->stack = (size_t)stack;
    }
}

static void read_script(Script *script, osal_id_t file)
{
    char text[LONGEST];
    uint32 n = 0;
    char c;
    script->number = 1;
    while (OS_read(file, &c, 1) == 1 && c != '!') {
        if (c == ';') {
            text[n] = '\0';
            read_line(script, text);
            n = 0;
        } else if (c == '\n' || c == '\r') {
            script->number += c == '\n' ? 1u : 0u;
        } else if (n + 1u < sizeof text) {
            text[n++] = c;
        }
    }
    text[n] = '\0';
    if (*trimmed(text) != '\0') {
        complain(script, "a line must end with a semicolon", trimmed(text));
    }
}

int32 pocket_run_script(const char *path)
{
    static Script script; /* only the host reads scripts */
    osal_id_t file;
    memset(&script, 0, sizeof script);
    if (OS_OpenCreate(&file, path, OS_FILE_FLAG_NONE, OS_READ_ONLY) != OS_SUCCESS) {
        OS_printf("start-up script: %s cannot be read\n", path);
        return CFE_ES_FILE_IO_ERR;
    }
    read_script(&script, file);
    (void)OS_close(file);
    if (script.errors > 0u) {
        return CFE_ES_BAD_ARGUMENT;
    }
    for (uint32 i = 0; i < script.n; i++) {
        const Line *line = &script.lines[i];
        const CFE_Status_t status = pocket_start_app(line->file, line->entry, line->name, line->priority, line->stack);
        if (status != CFE_SUCCESS) {
            OS_printf("start-up script: %s does not start: 0x%08X\n", line->name, (unsigned)status);
            return status;
        }
    }
    return (int32)script.n;
}
