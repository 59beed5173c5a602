/* SPDX-License-Identifier: Apache-2.0 */
/* The elementary functions, of any numbers. */
#include "flight/math/elementary.h"

void main(void)
{
    double x, y, s, c;
    any_bits(&x, sizeof x);
    any_bits(&y, sizeof y);
    fm_sincos(x, &s, &c);
    any = fm_sin(x) < fm_cos(x);
    any = fm_tan(x) < fm_atan(x);
    any = fm_asin(x) < fm_acos(x);
    any = fm_atan2(y, x) < 0.0;
    any = fm_exp(x) < fm_log(x);
    any = fm_pow(x, y) < 0.0;
    Frama_C_show_each_returned();
}
