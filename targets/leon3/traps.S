/* SPDX-License-Identifier: Apache-2.0 */
/* The trap table, the register windows, and the start of a program on a LEON3.
 *
 * A SPARC has overlapping windows of registers in a ring. SAVE goes one window down, RESTORE one up. One bit of WIM
 * marks the window that is kept free; between it and the present one, downwards from the oldest, lie the windows of the
 * callers. When SAVE reaches the free window, the oldest one is spilled to its stack and becomes the free one; when
 * RESTORE reaches it, the window is filled again. A trap takes the next window down without asking WIM, so each handler
 * that calls C first makes sure that this is not the free one.
 *
 * All handlers begin with %l0 = PSR, %l1 = PC, %l2 = nPC, %l3 = TBR. */

#include "targets/leon3/leon3.h"

#define WINDOWS LEON3_WINDOWS
#define ENABLE_FPU 0x1000
#define NONSTANDARD 0x400000 /* of the FSR */
#define ALL_LEVELS 0xf00 /* of interrupts */
#define ENABLE_TRAPS 0x20

/* The frame of an interrupt, above the 96 bytes of any frame. */
#define GLOBALS 96  /* %g1 in the second word */
#define Y_REGISTER 96 /* in place of %g0 */
#define FLOAT_STATUS 128
#define FLOATS 136
#define FRAME (136 + 128)

.macro wait /* for what WR wrote */
        nop
        nop
        nop
.endm

.macro spill_window /* the locals and ins of this window to its stack */
        std     %l0, [%sp]
        std     %l2, [%sp + 8]
        std     %l4, [%sp + 16]
        std     %l6, [%sp + 24]
        std     %i0, [%sp + 32]
        std     %i2, [%sp + 40]
        std     %i4, [%sp + 48]
        std     %i6, [%sp + 56]
.endm

.macro fill_window
        ldd     [%sp], %l0
        ldd     [%sp + 8], %l2
        ldd     [%sp + 16], %l4
        ldd     [%sp + 24], %l6
        ldd     [%sp + 32], %i0
        ldd     [%sp + 40], %i2
        ldd     [%sp + 48], %i4
        ldd     [%sp + 56], %i6
.endm

.macro spill_oldest /* in the free window: the one below, which is the oldest, becomes the free one */
        mov     %g1, %l5
        rd      %wim, %l4
        srl     %l4, 1, %g1
        sll     %l4, WINDOWS - 1, %l4
        or      %l4, %g1, %g1
        save
        wr      %g1, %wim
        wait
        spill_window
        restore
        mov     %l5, %g1
.endm

.macro free_next_up /* the window above the free one becomes the free one */
        rd      %wim, %l4
        srl     %l4, WINDOWS - 1, %l5
        sll     %l4, 1, %l4
        or      %l4, %l5, %l4
        wr      %l4, %wim
        wait
.endm

.macro trap handler
        rd      %psr, %l0
        sethi   %hi(\handler), %l4
        jmp     %l4 + %lo(\handler)
        rd      %tbr, %l3
.endm

        .section .traps, "ax"
        .global leon3_traps
        .align  4096
leon3_traps:
        sethi   %hi(start), %g1         ! 0x00: reset
        jmp     %g1 + %lo(start)
        nop
        nop
        .rept   4
        trap    unexpected
        .endr
        trap    window_overflow         ! 0x05
        trap    window_underflow        ! 0x06
        .rept   0x11 - 0x07
        trap    unexpected
        .endr
        .rept   15
        trap    interrupt               ! 0x11 to 0x1f
        .endr
        .rept   0x83 - 0x20
        trap    unexpected
        .endr
        trap    flush_windows           ! 0x83: ta 3
        .rept   0x100 - 0x84
        trap    unexpected
        .endr

        .text
        .align  8

/* SAVE reached the free window, in which this runs. */
window_overflow:
        spill_oldest
        jmp     %l1
        rett    %l2

/* RESTORE reached the free window, two above this one: fill it. */
window_underflow:
        free_next_up
        restore
        restore
        fill_window
        save
        save
        jmp     %l1
        rett    %l2

interrupt:
        rd      %wim, %l4
        srl     %l4, %l0, %l4           ! the lowest bits of PSR are the number of this window
        btst    1, %l4
        be      1f
        nop
        spill_oldest
1:      sub     %fp, FRAME, %sp
        rd      %y, %l4
        st      %l4, [%sp + Y_REGISTER]
        st      %g1, [%sp + GLOBALS + 4]
        std     %g2, [%sp + GLOBALS + 8]
        std     %g4, [%sp + GLOBALS + 16]
        std     %g6, [%sp + GLOBALS + 24]
        st      %fsr, [%sp + FLOAT_STATUS]
        .irp    n, 0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30
        std     %f\n, [%sp + FLOATS + 4 * \n]
        .endr
        srl     %l3, 4, %o0
        and     %o0, 15, %o0            ! the level
        andn    %l0, ALL_LEVELS, %l4
        sll     %o0, 8, %l5
        or      %l4, %l5, %l4
        wr      %l4, %psr               ! higher levels may interrupt this one
        wait
        wr      %l4, ENABLE_TRAPS, %psr
        wait
        call    leon3_interrupt
        nop
        wr      %l0, %psr               ! no traps
        wait
        .irp    n, 0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30
        ldd     [%sp + FLOATS + 4 * \n], %f\n
        .endr
        ld      [%sp + FLOAT_STATUS], %fsr
        ld      [%sp + Y_REGISTER], %l4
        wr      %l4, %y
        ld      [%sp + GLOBALS + 4], %g1
        ldd     [%sp + GLOBALS + 8], %g2
        ldd     [%sp + GLOBALS + 16], %g4
        ldd     [%sp + GLOBALS + 24], %g6
        add     %l0, 1, %l4             ! the interrupted window may have been spilled meanwhile
        and     %l4, WINDOWS - 1, %l4
        rd      %wim, %l5
        srl     %l5, %l4, %l5
        btst    1, %l5
        be      2f
        nop
        free_next_up
        restore
        fill_window
        save
2:      wr      %l0, %psr               ! the condition codes
        wait
        jmp     %l1
        rett    %l2

/* ta 3: spill the windows of all callers, the present one included. */
flush_windows:
        mov     %g1, %l4
        mov     %g2, %l5
        mov     %g3, %l6
        mov     %g4, %l7
        mov     %l0, %g1                ! PSR of this window
        rd      %wim, %g2
        wr      %g0, %wim               ! no window traps meanwhile
        wait
1:      restore
        rd      %psr, %g3
        srl     %g2, %g3, %g4
        btst    1, %g4
        bne     2f
        nop
        spill_window
        ba      1b
        nop
2:      wr      %g1, %psr
        wait
        mov     1, %g2
        add     %l0, 2, %g3             ! the window above the caller's is the free one now
        and     %g3, WINDOWS - 1, %g3
        sll     %g2, %g3, %g2
        wr      %g2, %wim
        wr      %l0, %psr
        mov     %l4, %g1
        mov     %l5, %g2
        mov     %l6, %g3
        mov     %l7, %g4
        jmp     %l2
        rett    %l2 + 4

/* A trap for which there is no handler: write all that a report needs into leon3_fault (leon3.h), and call C on a stack
 * of its own, because that of the program may be damaged. */
unexpected:
        set     leon3_fault, %l4
        std     %l0, [%l4]              ! PSR, PC
        std     %l2, [%l4 + 8]          ! nPC, TBR
        rd      %wim, %l5
        rd      %y, %l6
        st      %l5, [%l4 + 16]
        st      %l6, [%l4 + 20]
        sethi   %hi(ENABLE_FPU), %l5
        btst    %l5, %l0
        be      1f
        nop
        st      %fsr, [%l4 + 24]
1:      st      %g1, [%l4 + 36]
        std     %g2, [%l4 + 40]
        std     %g4, [%l4 + 48]
        std     %g6, [%l4 + 56]
        mov     %l4, %g1
        wr      %g0, %wim
        wait
        restore                         ! the window that trapped
        std     %o0, [%g1 + 64]
        std     %o2, [%g1 + 72]
        std     %o4, [%g1 + 80]
        std     %o6, [%g1 + 88]
        std     %l0, [%g1 + 96]
        std     %l2, [%g1 + 104]
        std     %l4, [%g1 + 112]
        std     %l6, [%g1 + 120]
        std     %i0, [%g1 + 128]
        std     %i2, [%g1 + 136]
        std     %i4, [%g1 + 144]
        std     %i6, [%g1 + 152]
        save
        add     %l0, 1, %l6             ! all windows but that one are free for C
        and     %l6, WINDOWS - 1, %l6
        mov     1, %l5
        sll     %l5, %l6, %l5
        wr      %l5, %wim
        set     leon3_fault_stack + LEON3_FAULT_STACK - 96, %sp
        clr     %fp
        or      %l0, ALL_LEVELS, %l0
        wr      %l0, %psr
        wait
        wr      %l0, ENABLE_TRAPS, %psr
        wait
        call    leon3_report_fault
        mov     %g1, %o0

/* void bare_switch(BareContext *from, const BareContext *to): go on where `to` was left. */
        .global bare_switch
bare_switch:
        rd      %psr, %g1
        or      %g1, ALL_LEVELS, %g2
        wr      %g2, %psr               ! an interrupt would spill a window of one stack to the other
        wait
        ta      3
        st      %sp, [%o0]
        st      %o7, [%o0 + 4]
        ld      [%o1 + 4], %o7
        ld      [%o1], %sp
        fill_window
        wr      %g1, %psr
        wait
        retl
        nop

/* Where a new context begins: entry in %l0, its argument in %l1. */
        .global leon3_begin
leon3_begin:
        call    %l0
        mov     %l1, %o0
        ta      1

/* void leon3_halt(int status): the error mode. */
        .global leon3_halt
leon3_halt:
        rd      %psr, %g1
        andn    %g1, ENABLE_TRAPS, %g1
        wr      %g1, %psr
        wait
        ta      0

start:
        set     ENABLE_FPU | ALL_LEVELS | 0xc0, %g1
        wr      %g1, %psr               ! supervisor, window 0, no traps
        wr      %g0, 2, %wim
        wait
        set     leon3_traps, %g1
        wr      %g1, %tbr
        wr      %g0, %y
        set     leon3_stack_end - 96, %sp
        clr     %fp
        clr     %g2
        clr     %g3
        clr     %g4
        clr     %g5
        clr     %g6
        clr     %g7
        clr     %g1
        set     float_state, %o0
        ld      [%o0], %fsr
        set     leon3_data, %o0         ! from where it was loaded: a reset starts with it anew
        set     leon3_data_end, %o1     ! all ends of sections are multiples of 8
        set     leon3_data_load, %o2
1:      cmp     %o0, %o1
        bcc     2f
        nop
        ldd     [%o2], %o4
        std     %o4, [%o0]
        add     %o2, 8, %o2
        ba      1b
        add     %o0, 8, %o0
2:      set     leon3_bss_end, %o1      ! .bss follows
3:      cmp     %o0, %o1
        bcc     4f
        nop
        std     %g0, [%o0]              ! %g0 and %g1
        ba      3b
        add     %o0, 8, %o0
4:      set     leon3_stack, %o0        ! paint the stack
        set     LEON3_PAINT, %o4
        mov     %o4, %o5
5:      cmp     %o0, %sp
        bcc     6f
        nop
        std     %o4, [%o0]
        ba      5b
        add     %o0, 8, %o0
6:      rd      %psr, %g1
        andn    %g1, ALL_LEVELS, %g1
        wr      %g1, ENABLE_TRAPS, %psr
        wait
        call    leon3_run
        nop

        .align  4
float_state:                            ! no traps; a subnormal operand is 0, for which the GRFPU would trap
        .word   NONSTANDARD
