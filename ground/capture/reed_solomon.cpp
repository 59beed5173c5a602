// SPDX-License-Identifier: Apache-2.0
#include "ground/capture/reed_solomon.h"

#include <algorithm>
#include <array>
#include <utility>

namespace fledge::ground {

namespace {

constexpr int order = 255, first_root = 112, root_step = 11; // the roots are a^(11 j), j from 112 to 143

/// GF(2^8) by x^8 + x^7 + x^2 + x + 1.
struct Field {
    std::array<std::uint8_t, std::size_t{2} * order> power{}; // twice, for sums of logarithms
    std::array<int, 256> log{};
    std::array<std::uint8_t, 256> to_dual{}, from_dual{};

    Field()
    {
        unsigned x = 1;
        for (int i = 0; i < order; i++) {
            power[static_cast<std::size_t>(i)] = power[static_cast<std::size_t>(i + order)] =
                static_cast<std::uint8_t>(x);
            log[x] = i;
            x = x << 1 ^ (x & 0x80u ? 0x187u : 0u);
        }
        for (unsigned symbol = 0; symbol < 256; symbol++) {
            unsigned dual = 0; // its bits, the highest first, are the traces of symbol * a^(117 i)
            for (int i = 0; i < 8; i++) {
                unsigned trace = 0, conjugate = times(static_cast<std::uint8_t>(symbol), at(117 * i));
                for (int k = 0; k < 8; k++) {
                    trace ^= conjugate;
                    conjugate = times(static_cast<std::uint8_t>(conjugate), static_cast<std::uint8_t>(conjugate));
                }
                dual = dual << 1 | trace;
            }
            to_dual[symbol] = static_cast<std::uint8_t>(dual);
            from_dual[dual] = static_cast<std::uint8_t>(symbol);
        }
    }
    /// a^i
    std::uint8_t at(int i) const { return power[static_cast<std::size_t>((i % order + order) % order)]; }
    std::uint8_t times(std::uint8_t a, std::uint8_t b) const
    {
        return a == 0 || b == 0 ? std::uint8_t{0} : power[static_cast<std::size_t>(log[a] + log[b])];
    }
    std::uint8_t over(std::uint8_t a, std::uint8_t b) const { return a == 0 ? std::uint8_t{0} : at(log[a] - log[b]); }
};

const Field field;
constexpr int checks = reed_solomon_check;
using Polynomial = std::array<std::uint8_t, reed_solomon_check + 1>; // the constant first

std::uint8_t value(std::span<const std::uint8_t> polynomial, int log_of_x)
{
    const std::uint8_t x = field.at(log_of_x);
    std::uint8_t sum = 0;
    for (std::size_t i = polynomial.size(); i-- > 0;) {
        sum = static_cast<std::uint8_t>(field.times(sum, x) ^ polynomial[i]);
    }
    return sum;
}

/// The locator of the errors, by Berlekamp and Massey; its degree is how many there should be.
Polynomial locator_of(const std::array<std::uint8_t, checks> &syndromes, std::size_t &degree)
{
    Polynomial locator{1}, before{1};
    degree = 0;
    std::size_t shift = 1;
    std::uint8_t scale = 1;
    for (std::size_t n = 0; n < syndromes.size(); n++, shift++) {
        std::uint8_t off = syndromes[n];
        for (std::size_t i = 1; i <= degree; i++) {
            off ^= field.times(locator[i], syndromes[n - i]);
        }
        if (off == 0) {
            continue;
        }
        const Polynomial last = locator;
        for (std::size_t i = shift; i < locator.size(); i++) {
            locator[i] ^= field.times(field.over(off, scale), before[i - shift]);
        }
        if (2 * degree <= n) {
            degree = n + 1 - degree;
            before = last;
            scale = off;
            shift = 0;
        }
    }
    return locator;
}

/// Correct a code word, in the conventional basis, the last symbol that of x^0. Returns as reed_solomon_correct.
std::optional<std::size_t> correct(std::span<std::uint8_t> word)
{
    std::array<std::uint8_t, checks> syndromes{};
    for (int i = 0; i < checks; i++) {
        const std::uint8_t root = field.at(root_step * (first_root + i));
        std::uint8_t &sum = syndromes[static_cast<std::size_t>(i)];
        for (const std::uint8_t symbol : word) {
            sum = static_cast<std::uint8_t>(field.times(sum, root) ^ symbol);
        }
    }
    if (std::all_of(syndromes.begin(), syndromes.end(), [](std::uint8_t syndrome) { return syndrome == 0; })) {
        return 0;
    }
    std::size_t degree = 0;
    const Polynomial locator = locator_of(syndromes, degree);
    if (degree > checks / 2) {
        return std::nullopt;
    }
    std::array<std::uint8_t, checks> evaluator{}; // syndromes * locator
    std::array<std::uint8_t, checks> slope{};     // the derivative of the locator
    for (std::size_t i = 0; i < checks; i++) {
        for (std::size_t k = 0; k <= i; k++) {
            evaluator[i] ^= field.times(syndromes[i - k], locator[k]);
        }
        slope[i] = i % 2 == 0 ? locator[i + 1] : std::uint8_t{0};
    }
    std::array<std::pair<std::size_t, std::uint8_t>, checks / 2> errors;
    std::size_t n_errors = 0;
    for (std::size_t place = 0; place < word.size() && n_errors < degree; place++) {
        const int back = -root_step * static_cast<int>(word.size() - 1 - place); // the inverse of its locator
        const std::uint8_t below = value(slope, back);
        if (value(locator, back) == 0 && below != 0) {
            const std::uint8_t above = field.times(value(evaluator, back), field.at(back * (first_root - 1)));
            errors[n_errors++] = {place, field.over(above, below)};
        }
    }
    if (n_errors != degree) { // some errors would be outside of the word
        return std::nullopt;
    }
    for (std::size_t i = 0; i < n_errors; i++) {
        word[errors[i].first] ^= errors[i].second;
    }
    return n_errors;
}

} // namespace

std::optional<std::size_t> reed_solomon_correct(std::span<std::uint8_t> codeblock, std::size_t depth)
{
    std::size_t wrong = 0;
    bool good = true;
    std::array<std::uint8_t, reed_solomon_length> memory;
    const std::span word(memory.data(), codeblock.size() / depth);
    for (std::size_t lane = 0; lane < depth; lane++) {
        for (std::size_t i = 0; i < word.size(); i++) {
            word[i] = field.from_dual[codeblock[i * depth + lane]];
        }
        const std::optional<std::size_t> corrected = correct(word);
        good = good && corrected;
        wrong += corrected.value_or(0);
        for (std::size_t i = 0; corrected && i < word.size(); i++) {
            codeblock[i * depth + lane] = field.to_dual[word[i]];
        }
    }
    return good ? std::optional(wrong) : std::nullopt;
}

} // namespace fledge::ground
