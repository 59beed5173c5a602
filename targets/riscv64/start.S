/* SPDX-License-Identifier: Apache-2.0 */
/* The start of a program on a board with a RISC-V processor of 64 bits, in machine mode; its vectors, and what an
 * exception leaves. board.c has the rest. */

#include "targets/riscv64/riscv64.h"

#define FLOATING_POINT 0x2000 /* in mstatus: on */
#define VECTORED 1

        .section .start, "ax"
        .global _start
_start:
        csrw    mie, zero
        csrci   mstatus, 8
        csrr    t0, mhartid
        bnez    t0, park                # one processor flies
        .option push
        .option norelax
        la      gp, __global_pointer$
        .option pop
        la      sp, board_stack_end
        la      tp, board_data          # its begin is what the C library has one of for each thread
        la      t0, vectors
        addi    t0, t0, VECTORED
        csrw    mtvec, t0
        li      t0, FLOATING_POINT
        csrs    mstatus, t0
        fscsr   zero                    # to nearest, no flags

        la      t0, board_data_load
        la      t1, board_data
        la      t2, board_data_end
1:      bgeu    t1, t2, 2f
        ld      t3, 0(t0)
        sd      t3, 0(t1)
        addi    t0, t0, 8
        addi    t1, t1, 8
        j       1b
2:      la      t2, board_bss_end
3:      bgeu    t1, t2, 4f
        sd      zero, 0(t1)
        addi    t1, t1, 8
        j       3b
4:      la      t1, board_stack
        li      t3, BOARD_PAINT
5:      sd      t3, 0(t1)
        addi    t1, t1, 8
        bltu    t1, sp, 5b

        call    board_start
        call    main
        call    _exit

park:   wfi
        j       park

        .text
        .balign 256
        .option push
        .option norvc                   # each entry has four bytes
vectors:
        j       exception
        .rept   6
        j       exception
        .endr
        j       board_beat              # 7: the timer
        .rept   3
        j       exception
        .endr
        j       board_interrupt         # 11: a device
        .option pop

/* Of a watchdog that has expired, too. The stack may be damaged: the registers go into memory of their own, and
 * so does the report. */
exception:
        .global board_exception_entry
board_exception_entry:
        csrci   mstatus, 8
        csrw    mscratch, t0
        la      t0, board_registers
        sd      zero, 0(t0)
        .irp    n, 1, 2, 3, 4, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, \
                29, 30, 31
        sd      x\n, 8 * \n(t0)
        .endr
        csrr    t1, mscratch
        sd      t1, 8 * 5(t0)
        la      sp, board_fault_stack + BOARD_FAULT_STACK
        csrr    a0, mcause
        csrr    a1, mepc
        csrr    a2, mtval
        call    board_exception
