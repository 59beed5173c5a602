! SPDX-License-Identifier: Apache-2.0
! The least that a program of the bench needs: reset, the windows' traps, and an end that QEMU understands, too.
        .section .text.start, "ax"
        .global _start
        .macro bad
        ta      0
        nop
        nop
        nop
        .endm

        .align  4096
table:
        ba      _start                          ! 0x00 reset
        nop
        nop
        nop
        .rept   4
        bad
        .endr
        ba      overflow                        ! 0x05
        rd      %wim, %l3
        nop
        nop
        ba      underflow                       ! 0x06
        rd      %wim, %l3
        nop
        nop
        .rept   249
        bad
        .endr

! The window after the present one is invalid: save it. l1, l2 hold pc and npc.
overflow:
        mov     %g1, %l7
        srl     %l3, 1, %g1
        sll     %l3, 7, %l4
        or      %g1, %l4, %g1
        and     %g1, 0xff, %g1
        save
        wr      %g1, 0, %wim
        nop
        nop
        nop
        std     %l0, [%sp]
        std     %l2, [%sp + 8]
        std     %l4, [%sp + 16]
        std     %l6, [%sp + 24]
        std     %i0, [%sp + 32]
        std     %i2, [%sp + 40]
        std     %i4, [%sp + 48]
        std     %i6, [%sp + 56]
        restore
        mov     %l7, %g1
        jmp     %l1
        rett    %l2

! The window before the present one was saved: fetch it. The trap's window is two away from it.
underflow:
        sll     %l3, 1, %l4
        srl     %l3, 7, %l5
        or      %l4, %l5, %l5
        and     %l5, 0xff, %l5
        wr      %l5, 0, %wim
        nop
        nop
        nop
        restore
        restore
        ldd     [%sp], %l0
        ldd     [%sp + 8], %l2
        ldd     [%sp + 16], %l4
        ldd     [%sp + 24], %l6
        ldd     [%sp + 32], %i0
        ldd     [%sp + 40], %i2
        ldd     [%sp + 48], %i4
        ldd     [%sp + 56], %i6
        save
        save
        jmp     %l1
        rett    %l2

_start:
        set     table, %g1
        wr      %g1, 0, %tbr
        wr      %g0, 2, %wim
        set     0x1fc0, %g1                     ! FPU on, no interrupts, supervisor, window 0
        wr      %g1, 0, %psr
        nop
        nop
        nop
        set     zero, %g1
        ld      [%g1], %fsr
        wr      %g1, 0, %y
        set     stack_top - 96, %sp
        clr     %fp
        set     0x1fe0, %g1                     ! the same, with traps enabled
        wr      %g1, 0, %psr
        nop
        nop
        nop
        call    main
        nop
        set     0x1fc0, %g1
        wr      %g1, 0, %psr                    ! without traps, a trap ends the program
        nop
        nop
        nop
        ta      0
        nop

        .section .rodata
        .align  8
zero:   .word   0, 0
