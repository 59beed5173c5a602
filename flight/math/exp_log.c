/* SPDX-License-Identifier: Apache-2.0 */
/* Exponential, natural logarithm, and power. */
#include "flight/math/elementary.h"
#include "flight/math/ieee.h"

/* ---- exponential --------------------------------------------------------------------------------
 * x = (64 k + j) ln2/64 + r with |r| <= ln2/128, so that
 *
 *     exp x = 2^k T_j (1 + p),   T_j = 2^(j/64),   p = exp r - 1 = r + r^2 E(r). */

/* T_j as double and rest. */
static const FmSum POWERS[64] = {
    {0x1p+0, 0x0p+0},
    {0x1.02c9a3e778061p+0, -0x1.19083535b085dp-56},
    {0x1.059b0d3158574p+0, 0x1.d73e2a475b465p-55},
    {0x1.0874518759bc8p+0, 0x1.186be4bb284ffp-57},
    {0x1.0b5586cf9890fp+0, 0x1.8a62e4adc610bp-54},
    {0x1.0e3ec32d3d1a2p+0, 0x1.03a1727c57b53p-59},
    {0x1.11301d0125b51p+0, -0x1.6c51039449b3ap-54},
    {0x1.1429aaea92dep+0, -0x1.32fbf9af1369ep-54},
    {0x1.172b83c7d517bp+0, -0x1.19041b9d78a76p-55},
    {0x1.1a35beb6fcb75p+0, 0x1.e5b4c7b4968e4p-55},
    {0x1.1d4873168b9aap+0, 0x1.e016e00a2643cp-54},
    {0x1.2063b88628cd6p+0, 0x1.dc775814a8495p-55},
    {0x1.2387a6e756238p+0, 0x1.9b07eb6c70573p-54},
    {0x1.26b4565e27cddp+0, 0x1.2bd339940e9d9p-55},
    {0x1.29e9df51fdee1p+0, 0x1.612e8afad1255p-55},
    {0x1.2d285a6e4030bp+0, 0x1.0024754db41d5p-54},
    {0x1.306fe0a31b715p+0, 0x1.6f46ad23182e4p-55},
    {0x1.33c08b26416ffp+0, 0x1.32721843659a6p-54},
    {0x1.371a7373aa9cbp+0, -0x1.63aeabf42eae2p-54},
    {0x1.3a7db34e59ff7p+0, -0x1.5e436d661f5e3p-56},
    {0x1.3dea64c123422p+0, 0x1.ada0911f09ebcp-55},
    {0x1.4160a21f72e2ap+0, -0x1.ef3691c309278p-58},
    {0x1.44e086061892dp+0, 0x1.89b7a04ef80dp-59},
    {0x1.486a2b5c13cdp+0, 0x1.3c1a3b69062fp-56},
    {0x1.4bfdad5362a27p+0, 0x1.d4397afec42e2p-56},
    {0x1.4f9b2769d2ca7p+0, -0x1.4b309d25957e3p-54},
    {0x1.5342b569d4f82p+0, -0x1.07abe1db13cadp-55},
    {0x1.56f4736b527dap+0, 0x1.9bb2c011d93adp-54},
    {0x1.5ab07dd485429p+0, 0x1.6324c054647adp-54},
    {0x1.5e76f15ad2148p+0, 0x1.ba6f93080e65ep-54},
    {0x1.6247eb03a5585p+0, -0x1.383c17e40b497p-54},
    {0x1.6623882552225p+0, -0x1.bb60987591c34p-54},
    {0x1.6a09e667f3bcdp+0, -0x1.bdd3413b26456p-54},
    {0x1.6dfb23c651a2fp+0, -0x1.bbe3a683c88abp-57},
    {0x1.71f75e8ec5f74p+0, -0x1.16e4786887a99p-55},
    {0x1.75feb564267c9p+0, -0x1.0245957316dd3p-54},
    {0x1.7a11473eb0187p+0, -0x1.41577ee04992fp-55},
    {0x1.7e2f336cf4e62p+0, 0x1.05d02ba15797ep-56},
    {0x1.82589994cce13p+0, -0x1.d4c1dd41532d8p-54},
    {0x1.868d99b4492edp+0, -0x1.fc6f89bd4f6bap-54},
    {0x1.8ace5422aa0dbp+0, 0x1.6e9f156864b27p-54},
    {0x1.8f1ae99157736p+0, 0x1.5cc13a2e3976cp-55},
    {0x1.93737b0cdc5e5p+0, -0x1.75fc781b57ebcp-57},
    {0x1.97d829fde4e5p+0, -0x1.d185b7c1b85d1p-54},
    {0x1.9c49182a3f09p+0, 0x1.c7c46b071f2bep-56},
    {0x1.a0c667b5de565p+0, -0x1.359495d1cd533p-54},
    {0x1.a5503b23e255dp+0, -0x1.d2f6edb8d41e1p-54},
    {0x1.a9e6b5579fdbfp+0, 0x1.0fac90ef7fd31p-54},
    {0x1.ae89f995ad3adp+0, 0x1.7a1cd345dcc81p-54},
    {0x1.b33a2b84f15fbp+0, -0x1.2805e3084d708p-57},
    {0x1.b7f76f2fb5e47p+0, -0x1.5584f7e54ac3bp-56},
    {0x1.bcc1e904bc1d2p+0, 0x1.23dd07a2d9e84p-55},
    {0x1.c199bdd85529cp+0, 0x1.11065895048ddp-55},
    {0x1.c67f12e57d14bp+0, 0x1.2884dff483cadp-54},
    {0x1.cb720dcef9069p+0, 0x1.503cbd1e949dbp-56},
    {0x1.d072d4a07897cp+0, -0x1.cbc3743797a9cp-54},
    {0x1.d5818dcfba487p+0, 0x1.2ed02d75b3707p-55},
    {0x1.da9e603db3285p+0, 0x1.c2300696db532p-54},
    {0x1.dfc97337b9b5fp+0, -0x1.1a5cd4f184b5cp-54},
    {0x1.e502ee78b3ff6p+0, 0x1.39e8980a9cc8fp-55},
    {0x1.ea4afa2a490dap+0, -0x1.e9c23179c2893p-54},
    {0x1.efa1bee615a27p+0, 0x1.dc7f486a4b6bp-54},
    {0x1.f50765b6e454p+0, 0x1.9d3e12dd8a18bp-54},
    {0x1.fa7c1819e90d8p+0, 0x1.74853f3a5931ep-55},
};

typedef struct Scaled {
    double value;
    int32_t exponent;
} Scaled;

/* exp(x + rest) = value 2^exponent, for |x| <= 1000 and a rest within an ulp of x. */
static inline Scaled scaled_exp(double x, double rest)
{
    /* ln2/64 in 32 + 53 bits: n LN2_1 is exact. */
    const double LN2_1 = 0x1.62e42feep-7, LN2_2 = 0x1.a39ef35793c76p-39;
    const double INVERSE = 0x1.71547652b82fep+6;

    const double shifted = x * INVERSE + FM_ROUND_TO_INTEGER;
    const double n = shifted - FM_ROUND_TO_INTEGER;
    const double r = (x - n * LN2_1) - (n * LN2_2 - rest);

    /* Offset to make the dividend positive: shifting a negative number is not portable. */
    const int32_t OFFSET = 4096;
    const uint32_t index = (uint32_t)fm_bits(shifted) + 64u * (uint32_t)OFFSET;
    const FmSum T = POWERS[index % 64];

    const double r2 = r * r;
    const double E =
        (0x1.fffffffffdbabp-2 + r * 0x1.5555555554399p-3) + r2 * (0x1.555573d529201p-5 + r * 0x1.111126cbcea5p-7);
    const double p = r + r2 * E;
    const Scaled result = {T.hi + (T.lo + T.hi * p), (int32_t)(index / 64) - OFFSET};
    return result;
}

/* Of a result near overflow, or subnormal: of the two factors only the last can round. */
static inline double by_halves(Scaled y)
{
    const int32_t half = y.exponent / 2;
    return y.value * fm_power_of_two(half) * fm_power_of_two(y.exponent - half);
}

double fm_exp(double x)
{
    if (fabs(x) < 708.0) {
        const Scaled y = scaled_exp(x, 0.0);
        return y.value * fm_power_of_two(y.exponent);
    }
    if (fabs(x) < 800.0) {
        return by_halves(scaled_exp(x, 0.0));
    }
    if (x > 0.0) {
        return INFINITY;
    }
    return x < 0.0 ? 0.0 : NAN;
}

/* ---- logarithm ----------------------------------------------------------------------------------
 * x = 2^k m with m in about [0.707, 1.414), and a short c near 1/m from a table, so that
 *
 *     log x = k ln2 - log c + log(1 + r),   r = m c - 1,   log(1 + r) = r + r^2 L(r),
 *
 * with |r| < 0.0172. c has 9 bits, so that its product with the leading 44 bits of m is exact.
 * Around m = 1 it is 1, and r is exact. */

typedef struct Reciprocal {
    double c;
    FmSum minus_log; /* hi is a multiple of 2^-42 */
} Reciprocal;

/* Row i holds for m from LOG_START + i 2^47 on, compared as bits. */
#define LOG_START 0x3fe6a00000000000u

static const Reciprocal RECIPROCALS[32] = {
    {0x1.66p+0, {-0x1.5767717456p-2, 0x1.64ead9524d7cap-44}},
    {0x1.5ep+0, {-0x1.404308686ap-2, -0x1.f8ef43049f7d3p-44}},
    {0x1.57p+0, {-0x1.2b9303ab8ap-2, 0x1.6db12d6bfb0a5p-45}},
    {0x1.5p+0, {-0x1.1675cababap-2, -0x1.8380e731f55c4p-44}},
    {0x1.49p+0, {-0x1.00e6c45ad5p-2, -0x1.cc68d52e01203p-50}},
    {0x1.43p+0, {-0x1.dc1bca0abep-3, -0x1.8fac1a628ccc6p-44}},
    {0x1.3dp+0, {-0x1.b5b519e8fcp-3, 0x1.4b722ec011f31p-44}},
    {0x1.37p+0, {-0x1.8e928de886p-3, -0x1.a8154b13d72d5p-44}},
    {0x1.31p+0, {-0x1.66acd4272ap-3, -0x1.aa1bdbfc6c785p-44}},
    {0x1.2bp+0, {-0x1.3dfc2b0eccp-3, -0x1.8a72a62b8c13fp-45}},
    {0x1.26p+0, {-0x1.1b72ad52f6p-3, -0x1.e80a41811a396p-45}},
    {0x1.21p+0, {-0x1.f0a30c0118p-4, 0x1.d599e83368e91p-44}},
    {0x1.1cp+0, {-0x1.a926d3a4acp-4, -0x1.563650bd22a9cp-44}},
    {0x1.17p+0, {-0x1.60658a9374p-4, -0x1.0c3b1dee9c4f8p-44}},
    {0x1.12p+0, {-0x1.16536eea38p-4, 0x1.47c5e768fa309p-46}},
    {0x1.0ep+0, {-0x1.b42dd71198p-5, 0x1.c827ae5d6704cp-46}},
    {0x1.09p+0, {-0x1.1b0d98924p-5, 0x1.3401e9ae889bbp-44}},
    {0x1.05p+0, {-0x1.3cea44347p-6, 0x1.6a2c432d6a40bp-44}},
    {0x1p+0, {0.0, 0.0}},
    {0x1.f4p-1, {0x1.8492528c9p-6, -0x1.aa0ba325a0c34p-45}},
    {0x1.e6p-1, {0x1.aaef2d0fbp-5, 0x1.0fc1a353bb42ep-45}},
    {0x1.d8p-1, {0x1.4d3115d208p-4, -0x1.53a2582f4e1efp-48}},
    {0x1.cap-1, {0x1.c885801bc4p-4, 0x1.646d1c65aacd3p-45}},
    {0x1.bep-1, {0x1.1aa2b7e24p-3, -0x1.1ac38dde3b366p-44}},
    {0x1.b2p-1, {0x1.527e5e4a1cp-3, -0x1.4e60b8d4b411dp-44}},
    {0x1.a6p-1, {0x1.8beafeb39p-3, -0x1.73d54aae92cd1p-47}},
    {0x1.9cp-1, {0x1.bd087383bep-3, -0x1.d4bc4595412b6p-45}},
    {0x1.92p-1, {0x1.ef5ade4ddp-3, -0x1.a211565bb8e11p-51}},
    {0x1.88p-1, {0x1.1178e8227ep-2, 0x1.1ef78ce2d07f2p-44}},
    {0x1.8p-1, {0x1.269621134ep-2, -0x1.1b61f10522625p-44}},
    {0x1.76p-1, {0x1.419b423d5fp-2, -0x1.ce379226de3ecp-44}},
    {0x1.6ep-1, {0x1.57bf753c8dp-2, 0x1.fadedee5d40efp-46}},
};

/* log(x 2^extra) = sum.hi + (sum.lo + small + log(1 + r) - r.hi), with r = r.hi + r.lo exactly. */
typedef struct Reduced {
    FmSum r, sum;
    double small;
} Reduced;

/* Of normal x > 0. */
static inline Reduced reduced_log(double x, int32_t extra)
{
    /* ln2: a multiple of 2^-42, so that k LN2_1 + minus_log.hi is exact, and the rest. */
    const double LN2_1 = 0x1.62e42fefa38p-1, LN2_2 = 0x1.ef35793c7673p-45;

    /* 2^62 keeps the difference positive, and counts as an exponent of 1024. */
    const uint64_t above = fm_bits(x) + ((uint64_t)1024 << 52) - LOG_START;
    const double k = (double)((int32_t)(above >> 52) - 1024 + extra);
    const Reciprocal row = RECIPROCALS[above >> 47 & 31];

    const uint64_t m_bits = (above & FM_FRACTION) + LOG_START;
    const double m1 = fm_from_bits(m_bits & ~(uint64_t)0x1ff);
    const double m2 = fm_from_bits(m_bits) - m1;
    const FmSum r = fm_sum_ordered(m1 * row.c - 1.0, m2 * row.c);
    const Reduced reduced = {r, fm_sum_ordered(k * LN2_1 + row.minus_log.hi, r.hi), k * LN2_2 + row.minus_log.lo};
    return reduced;
}

static inline double log_of_normal(double x, int32_t extra)
{
    const Reduced reduced = reduced_log(x, extra);
    const double r = reduced.r.hi;
    const double rr = r * r;
    const double L = (-0.5 + r * 0x1.5555555557a7ep-2) +
                     rr * ((-0x1.00000000043bep-2 + r * 0x1.999998256aa7bp-3) +
                           rr * ((-0x1.5555538f02dcdp-3 + r * 0x1.24b36649868c9p-3) + rr * -0x1.00216bacb2c18p-3));
    return reduced.sum.hi + (reduced.sum.lo + (reduced.r.lo + reduced.small) + rr * L);
}

double fm_log(double x)
{
    if (DBL_MIN <= x && x <= DBL_MAX) {
        return log_of_normal(x, 0);
    }
    if (x > DBL_MAX) {
        return x;
    }
    if (x > 0.0) {
        return log_of_normal(x * 0x1p54, -54);
    }
    return x == 0.0 ? -INFINITY : NAN;
}

/* ---- power --------------------------------------------------------------------------------------
 * x^y = exp(y log x), with log x as a sum of two doubles: its error, some 2^-66, is multiplied by up to 745. */

/* Of normal x > 0. log(1 + r) = r - r^2/2 + r^3 L(r), and the square is exact. */
static FmSum log_sum(double x, int32_t extra)
{
    const Reduced reduced = reduced_log(x, extra);
    const double r = reduced.r.hi;
    const double rr = r * r;
    const double L = (0x1.5555555555554p-2 + r * -0x1.ffffffffffffdp-3) +
                     rr * ((0x1.99999999a79f6p-3 + r * -0x1.5555555567852p-3) +
                           rr * ((0x1.249246f4f1b88p-3 + r * -0x1.fffffb2851a25p-4) +
                                 rr * (0x1.c7612e79e9c3ap-4 + r * -0x1.99dddc47f1b1ap-4)));
    const FmSum square = fm_product(r, r);
    const FmSum sum = fm_sum_ordered(reduced.sum.hi, -0.5 * square.hi);
    const double lo =
        reduced.sum.lo + sum.lo + (reduced.small - 0.5 * square.lo) + (reduced.r.lo - r * reduced.r.lo) + rr * r * L;
    return fm_sum_ordered(sum.hi, lo);
}

/* Whether y >= 0 is an integer, as all numbers from 2^52 on are. */
static int is_whole(double y)
{
    return y >= 0x1p52 || (y + 0x1p52) - 0x1p52 == y;
}

/* x^y for x > 0 that is not 1, and y that is not 0. */
static double power_of_positive(double x, double y)
{
    const double size = fabs(y);
    if (!(x > 0.0 && x <= DBL_MAX && size <= 0x1p65)) { /* |log x| >= 2^-54 */
        return (x > 1.0) == (y > 0.0) ? INFINITY : 0.0;
    }
    if (size < 0x1p-65) {
        return 1.0;
    }
    const FmSum log_x = x < DBL_MIN ? log_sum(x * 0x1p54, -54) : log_sum(x, 0);
    const FmSum product = fm_product(y, log_x.hi);
    if (fabs(product.hi) >= 800.0) {
        return product.hi > 0.0 ? INFINITY : 0.0;
    }
    return by_halves(scaled_exp(product.hi, product.lo + y * log_x.lo));
}

double fm_pow(double x, double y)
{
    const double x_size = fabs(x), y_size = fabs(y);
    if (y == 0.0 || x == 1.0) {
        return 1.0;
    }
    if (x != x || y != y || (x < 0.0 && x >= -DBL_MAX && !is_whole(y_size))) {
        return NAN;
    }
    const int is_odd = is_whole(y_size) && !is_whole(0.5 * y_size);
    const double power = x_size == 1.0 ? 1.0 : power_of_positive(x_size, y);
    return is_odd ? fm_flip(power, fm_sign(x)) : power;
}
