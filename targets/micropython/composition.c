/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/micropython/composition.h"

const mp_print_t *process_text(Text *text)
{
    text->end = (ScriptText){text->text, sizeof text->text, 0u};
    text->print = script_text(&text->end);
    return &text->print;
}

/* The names of a list of the executive, whose entries begin with `next` and `name`. */
typedef struct Named {
    struct Named *next;
    const char *name;
} Named;

static void print_names(const mp_print_t *print, const void *list, const char *none)
{
    const Named *entry = list;
    mp_print_str(print, entry != NULL ? entry->name : none);
    for (entry = entry != NULL ? entry->next : NULL; entry != NULL; entry = entry->next) {
        mp_printf(print, ", %s", entry->name);
    }
}

NORETURN void process_refuse_name(const char *subject, const char *does, const char *name, const void *list)
{
    const mp_print_t *print = objects_error();
    mp_printf(print, "%s %s %s; the process has ", subject, does, name);
    print_names(print, list, "none");
    objects_raise();
}

void process_check_composing(const char *subject)
{
    if (executive.composed) {
        objects_refuse("%s.%s: the mission is composed already; only its script does that, when it starts", PROCESS,
                       subject);
    }
}
