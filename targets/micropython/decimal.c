/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/micropython/decimal.h"

#include <string.h>

/* A double has at most 767 digits; more of a text can only decide a tie. */
enum { DIGITS = 800, SHIFT = 27, FRACTION = 52, BIAS = 1023, LEAST = -1022 };

/* 0.d0 d1 d2 ... * 10^point: d0 is no 0, nor is the last one. */
typedef struct Decimal {
    uint8_t digit[DIGITS];
    int n, point;
    int more; /* 1: digits that are not all 0 follow, for which there is no room */
} Decimal;

static void trim(Decimal *d)
{
    while (d->n > 0 && d->digit[d->n - 1] == 0u) {
        d->n--;
    }
    if (d->n == 0) {
        d->point = 0;
    }
}

static void append(Decimal *d, uint32_t digit)
{
    if (d->n < DIGITS) {
        d->digit[d->n++] = (uint8_t)digit;
    } else {
        d->more |= digit != 0u;
    }
}

/* Divide what is not 0 by 2^k, k <= SHIFT: long division, in which the rest stays below 2^k. */
static void halve(Decimal *d, int k)
{
    const Decimal old = *d;
    uint32_t rest = 0u;
    int at = 0;
    for (; rest >> k == 0u; at++) { /* to the first digit of the quotient */
        rest = rest * 10u + (at < old.n ? old.digit[at] : 0u);
    }
    d->point = old.point - at + 1;
    d->n = 0;
    for (;; at++) {
        append(d, rest >> k);
        rest &= (UINT32_C(1) << k) - 1u;
        if (at >= old.n && (rest == 0u || d->n == DIGITS)) {
            break;
        }
        rest = rest * 10u + (at < old.n ? old.digit[at] : 0u);
    }
    d->more |= rest != 0u;
    trim(d);
}

/* Multiply by 2^k, k <= SHIFT, from the last digit on. */
static void raise(Decimal *d, int k)
{
    uint8_t front[10];
    uint32_t carry = 0u;
    int n = 0;
    for (int i = d->n - 1; i >= 0; i--) {
        carry += (uint32_t)d->digit[i] << k;
        d->digit[i] = (uint8_t)(carry % 10u);
        carry /= 10u;
    }
    for (; carry != 0u; carry /= 10u) {
        front[n++] = (uint8_t)(carry % 10u);
    }
    for (int i = DIGITS - n; i < d->n; i++) { /* these fall off */
        d->more |= d->digit[i] != 0u;
    }
    const int kept = d->n < DIGITS - n ? d->n : DIGITS - n;
    memmove(d->digit + n, d->digit, (size_t)kept);
    for (int i = 0; i < n; i++) {
        d->digit[i] = front[n - 1 - i];
    }
    d->n = kept + n;
    d->point += n;
    trim(d);
}

/* Multiply by 2^k. */
static void scale(Decimal *d, int k)
{
    while (d->n > 0 && k != 0) {
        const int step = k > SHIFT ? SHIFT : k < -SHIFT ? -SHIFT : k;
        if (step > 0) {
            raise(d, step);
        } else {
            halve(d, -step);
        }
        k -= step;
    }
}

/* Whether the number becomes larger where it is cut behind n digits: it is rounded, a tie to even. */
static int rounds_up(const Decimal *d, int n)
{
    if (n < 0 || n >= d->n) {
        return 0;
    }
    if (d->digit[n] == 5u && n + 1 == d->n && !d->more) {
        return n > 0 && (d->digit[n - 1] & 1u);
    }
    return d->digit[n] >= 5u;
}

/* Cut behind n digits. */
static void round_to(Decimal *d, int n)
{
    const int up = rounds_up(d, n);
    d->n = n < 0 ? 0 : n < d->n ? n : d->n;
    d->more = 0;
    if (up) {
        while (d->n > 0 && d->digit[d->n - 1] == 9u) {
            d->n--;
        }
        if (d->n > 0) {
            d->digit[d->n - 1]++;
        } else {
            d->digit[d->n++] = 1u;
            d->point++;
        }
    }
    trim(d);
}

/* The nearest whole number; less than 2^54. */
static uint64_t whole(const Decimal *d)
{
    uint64_t value = 0u;
    for (int i = 0; i < d->point; i++) {
        value = value * 10u + (i < d->n ? d->digit[i] : 0u);
    }
    return value + (uint64_t)rounds_up(d, d->point);
}

static double join(uint64_t bits)
{
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* How far 10^n, n >= 0, may be divided by 2 and stay above 1/2. */
static int steps(int n)
{
    static const uint8_t powers[] = {1, 3, 6, 9, 13, 16, 19, 23, 26};
    return n < (int)sizeof powers ? powers[n] : SHIFT;
}

static double nearest(Decimal *d)
{
    const uint64_t infinite = UINT64_C(0x7FF) << FRACTION;
    int exponent = 0;
    if (d->n == 0 || d->point < -330) {
        return 0.0;
    }
    if (d->point > 310) {
        return join(infinite);
    }
    while (d->point > 0) {
        const int k = steps(d->point);
        scale(d, -k);
        exponent += k;
    }
    while (d->point < 0 || d->digit[0] < 5u) {
        const int k = steps(-d->point);
        scale(d, k);
        exponent -= k;
    }
    exponent--; /* d is in [1/2, 1), and 2 d * 2^exponent the number */
    if (exponent < LEAST) {
        scale(d, exponent - LEAST);
        exponent = LEAST;
    }
    scale(d, FRACTION + 1);
    uint64_t fraction = whole(d);
    if (fraction >> (FRACTION + 1) != 0u) {
        fraction >>= 1;
        exponent++;
    }
    if (exponent > BIAS) {
        return join(infinite);
    }
    /* A subnormal number has the exponent's bits 0, and no first bit to leave out. */
    const uint64_t biased = fraction >> FRACTION == 0u ? 0u : (uint64_t)(exponent + BIAS);
    return join(biased << FRACTION | (fraction & ((UINT64_C(1) << FRACTION) - 1u)));
}

double decimal_read(const char *text, size_t n)
{
    enum { FAR = 100000 };
    Decimal d = {.n = 0};
    size_t i = 0;
    int fraction = 0, exponent = 0, minus = 0;
    for (; i < n && ((text[i] >= '0' && text[i] <= '9') || text[i] == '_' || (text[i] == '.' && !fraction)); i++) {
        if (text[i] == '.') {
            fraction = 1;
        } else if (text[i] != '_') {
            const uint32_t digit = (uint32_t)(text[i] - '0');
            if (digit != 0u || d.n > 0) {
                append(&d, digit);
                d.point += !fraction && d.point < FAR;
            } else {
                d.point -= fraction && d.point > -FAR;
            }
        }
    }
    if (i < n && (text[i] | 0x20) == 'e') {
        i++;
        if (i < n && (text[i] == '+' || text[i] == '-')) {
            minus = text[i++] == '-';
        }
        for (; i < n && ((text[i] >= '0' && text[i] <= '9') || text[i] == '_'); i++) {
            if (text[i] != '_' && exponent < FAR * 10) {
                exponent = exponent * 10 + (text[i] - '0');
            }
        }
    }
    trim(&d);
    d.point += d.n == 0 ? 0 : minus ? -exponent : exponent;
    return nearest(&d);
}

/* The digits of a double that is not negative and finite. */
static Decimal exactly(uint64_t bits)
{
    Decimal d = {.n = 0};
    const int biased = (int)(bits >> FRACTION);
    uint64_t fraction = bits & ((UINT64_C(1) << FRACTION) - 1u);
    uint8_t digits[20];
    int n = 0;
    fraction |= biased != 0 ? UINT64_C(1) << FRACTION : 0u;
    for (; fraction != 0u; fraction /= 10u) {
        digits[n++] = (uint8_t)(fraction % 10u);
    }
    for (d.point = n; n > 0; n--) {
        append(&d, digits[n - 1]);
    }
    trim(&d);
    scale(&d, (biased != 0 ? biased : 1) - BIAS - FRACTION);
    return d;
}

double decimal_round(double value, int64_t digits)
{
    enum { MOST = 1100 }; /* a double ends 1074 digits behind the point */
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    const uint64_t sign = bits & UINT64_C(1) << 63, size = bits ^ sign;
    if (size >> FRACTION == 0x7FF || digits > MOST) {
        return value;
    }
    Decimal d = exactly(size);
    round_to(&d, digits < -MOST ? -1 : d.point + (int)digits);
    const double rounded = nearest(&d);
    memcpy(&bits, &rounded, sizeof bits);
    return join(bits | sign);
}

/* Cut to as few digits as read back as the same number. Unless it is subnormal, 15 digits stay what they are when they
 * become a double: fewer come of them by themselves, as zeros at the end fall off. */
static void shorten(Decimal *d, double value)
{
    for (int n = value < 2.3e-308 ? 1 : 15; n < 17; n++) {
        Decimal shorter = *d;
        round_to(&shorter, n);
        Decimal read = shorter;
        if (nearest(&read) == value) {
            *d = shorter;
            return;
        }
    }
    round_to(d, 17);
}

static char *put(char *at, const char *word)
{
    while (*word) {
        *at++ = *word++;
    }
    return at;
}

static char digit_at(const Decimal *d, int i)
{
    return (char)('0' + (i >= 0 && i < d->n ? d->digit[i] : 0));
}

static char *put_plain(char *at, const Decimal *d, int precision)
{
    for (int i = d->point < 1 ? d->point - 1 : 0; i < d->point; i++) {
        *at++ = digit_at(d, i);
    }
    for (int i = 0; i < precision; i++) {
        at = i == 0 ? put(at, ".") : at;
        *at++ = digit_at(d, d->point + i);
    }
    return at;
}

static char *put_scientific(char *at, const Decimal *d, int precision, char letter)
{
    int exponent = d->n > 0 ? d->point - 1 : 0;
    for (int i = 0; i <= precision; i++) {
        at = i == 1 ? put(at, ".") : at;
        *at++ = digit_at(d, i);
    }
    *at++ = letter;
    *at++ = exponent < 0 ? '-' : '+';
    exponent = exponent < 0 ? -exponent : exponent;
    if (exponent >= 100) {
        *at++ = (char)('0' + exponent / 100);
    }
    *at++ = (char)('0' + exponent / 10 % 10);
    *at++ = (char)('0' + exponent % 10);
    return at;
}

int decimal_format(double value, char *text, size_t size, char format, int precision, char sign)
{
    enum { LEAST_SIZE = 10, AROUND = 9 }; /* sign, digit, point, e+123, the ending 0 */
    const int upper = !(format & 0x20);
    char kind = (char)(format | 0x20), *at = text;
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    if (size < LEAST_SIZE) {
        if (size > 0u) {
            *text = '\0';
        }
        return 0;
    }
    if (bits >> 63 && value == value) {
        *at++ = '-';
    } else if (sign) {
        *at++ = sign;
    }
    bits &= UINT64_MAX >> 1;
    if (bits >> FRACTION == 0x7FF) {
        at = put(at, value != value ? (upper ? "NAN" : "nan") : (upper ? "INF" : "inf"));
    } else {
        Decimal d = exactly(bits);
        const int most = (int)(size < DIGITS ? size : DIGITS) - AROUND; /* digits behind the point, with an exponent */
        precision = precision < 0 ? 6 : precision;
        if (precision == DECIMAL_SHORTEST) {
            shorten(&d, join(bits));
            const int plain = d.n == 0 || (d.point > -4 && d.point <= 16);
            kind = plain ? 'f' : 'e';
            precision = d.n == 0 ? 0 : plain ? d.n - d.point : d.n - 1;
        } else if (kind == 'g') {
            precision = precision == 0 ? 1 : precision;
            Decimal rounded = d;
            round_to(&rounded, precision);
            const int plain = rounded.n == 0 || (rounded.point > -4 && rounded.point <= precision);
            kind = plain ? 'f' : 'e';
            precision = rounded.n == 0 ? 0 : plain ? rounded.n - rounded.point : rounded.n - 1;
        }
        precision = precision < 0 ? 0 : precision;
        if (kind == 'f' && (d.point > 1 ? d.point : 1) + precision + 4 > (int)size) {
            kind = 'e';
        }
        if (kind == 'e' && precision > most) {
            precision = most;
        }
        round_to(&d, kind == 'e' ? precision + 1 : d.point + precision);
        at = kind == 'e' ? put_scientific(at, &d, precision, upper ? 'E' : 'e') : put_plain(at, &d, precision);
    }
    *at = '\0';
    return (int)(at - text);
}
