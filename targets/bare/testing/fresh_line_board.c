/* SPDX-License-Identifier: Apache-2.0 */
/* For tests: line_board.c, whose memory a reset of the board makes new. */
#include "targets/bare/line_board.c" /* NOLINT: its memory is static */

void fresh_line_board(void);

void fresh_line_board(void)
{
    memset(&line, 0, sizeof line);
    memset(&mirror, 0, sizeof mirror);
    memset(memory, 0xA5, sizeof memory); /* whatever the RAM holds */
    memset(&text, 0, sizeof text);
    memset(sent_by, 0, sizeof sent_by);
    kept = NULL;
    clock_window = NULL;
    greetings = ended = flying = sent = shouts = 0u;
    acknowledged = answer_end = 0u;
    has_flown = has_come = 0;
}
