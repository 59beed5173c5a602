/* SPDX-License-Identifier: Apache-2.0 */
/* A vector whose squared length compares as less than a number, or as near to one, is finite; other proofs build on it.
 * In turn, each component is infinite or NaN, which is 0 times infinity, and the others are any bits. */
#include "flight/math/vec.h"

void main(void)
{
    /*@ loop unroll 3; */
    for (uint32_t i = 0u; i < 3u; i++) {
        /*@ loop unroll 2; */
        for (uint32_t negative = 0u; negative < 2u; negative++) {
            Vec3 a;
            any_bits(&a, sizeof a);
            a.v[i] = (negative != 0u ? -INFINITY : INFINITY) * any_number(0.0, 1.0);
            const int less = vec_norm2(a) < any_number(-DBL_MAX, DBL_MAX);
            const int near = fm_abs(vec_norm2(a) - any_number(-DBL_MAX, DBL_MAX)) < any_number(-DBL_MAX, DBL_MAX);
            /*@ assert never: less == 0 && near == 0; */
        }
    }
}
