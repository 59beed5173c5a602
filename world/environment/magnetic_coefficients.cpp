// SPDX-License-Identifier: Apache-2.0
#include "world/environment/magnetic_coefficients.h"

#include "sim/error.h"
#include "world/environment/text_input.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

namespace fledge::world {

namespace {

constexpr double reference_radius = 6371.2e3; // [m]
constexpr int most = 20;                      // degrees; the model itself has 12

struct Row {
    int n, m;
    double values[4]; ///< g, h, and their rates
};

std::optional<Row> row_of(const std::vector<std::string_view> &words)
{
    if (words.size() != 6) {
        return {};
    }
    const auto n = parse_integer(words[0]), m = parse_integer(words[1]);
    if (!n || !m || *n < 1 || *n > most || *m < 0 || *m > *n) {
        return {};
    }
    Row row{*n, *m, {}};
    for (std::size_t i = 0; i < 4; i++) {
        const auto value = parse_number(words[2 + i]);
        if (!value || std::abs(*value) > 1e6) {
            return {};
        }
        row.values[i] = *value;
    }
    return row;
}

} // namespace

/// By Cauchy and Schwarz, Schmidt's functions of a degree n, whose squares add up to 1, give no more than (n + 1) times
/// the root of the sum of the squares of its coefficients. A derivative along an axis leads to the degree n + 1.
MagneticCoefficients::MagneticCoefficients(std::string name, double epoch, const HarmonicField &main,
                                           const HarmonicField &rate)
    : name_(std::move(name)), epoch_(epoch), main_(main), rate_(rate), now_(main)
{
    now_.leave_out_the_point();
    for (int n = 1; n <= main.degree; n++) {
        double squares = 0.0, rates = 0.0;
        for (int m = 0; m <= n; m++) {
            const std::size_t at = HarmonicField::index(n, m);
            const double unit = 1e-18 * (2.0 * n + 1.0), years = end() - epoch_;
            const auto most = [&](const std::vector<double> &now, const std::vector<double> &a_year) {
                return std::abs(now[at]) + years * std::abs(a_year[at]);
            };
            squares += unit * (std::pow(most(main.C, rate.C), 2) + std::pow(most(main.S, rate.S), 2));
            rates += unit * (std::pow(rate.C[at], 2) + std::pow(rate.S[at], 2));
        }
        const double factors = (n + 2.0) * (n + 3.0) * (n + 4.0) * (n + 5.0);
        most_fourth_derivative_ += (n + 1.0) * factors * std::sqrt(squares) / std::pow(reference_radius, 4);
        most_rate_ += (n + 1.0) * std::sqrt(rates);
    }
}

MagneticCoefficients MagneticCoefficients::read(const std::string &path, int degree)
{
    const std::string text = read_whole(path);
    const auto lines = lines_of(text);
    const auto header = lines.empty() ? std::vector<std::string_view>() : words_of(lines[0]);
    const auto epoch = header.size() >= 2 ? parse_number(header[0]) : std::nullopt;
    if (!epoch || *epoch < 1900.0 || *epoch > 2200.0) {
        refuse_line(path, 1, "expected the header of a .COF file: epoch in years, name, date");
    }
    HarmonicField main = HarmonicField::zero(reference_radius * reference_radius, reference_radius, most), rate = main;
    main.name = rate.name = header[1];
    int n = 1, m = 0; // what comes next
    for (std::size_t i = 1;; i++) {
        const auto words = i < lines.size() ? words_of(lines[i]) : std::vector<std::string_view>();
        const std::string next = std::to_string(n) + " " + std::to_string(m);
        if (words.empty()) {
            refuse_line(path, i + 1, "the file ends before its line of nines; next would be degree and order " + next);
        }
        if (words[0].size() > 9 && words[0].find_first_not_of('9') == words[0].npos) {
            if (m != 0 || n == 1) {
                refuse_line(path, i + 1,
                            "the coefficients end within a degree; next would be degree and order " + next);
            }
            break;
        }
        const auto row = row_of(words);
        if (!row || row->n != n || row->m != m) {
            refuse_line(path, i + 1, "expected degree and order " + next + ", then g, h and their rates a year");
        }
        const double scale = 1.0 / std::sqrt(2.0 * n + 1.0);
        const std::size_t at = HarmonicField::index(n, m);
        main.C[at] = scale * row->values[0];
        main.S[at] = scale * row->values[1];
        rate.C[at] = scale * row->values[2];
        rate.S[at] = scale * row->values[3];
        if (++m > n) {
            n++;
            m = 0;
        }
    }
    if (degree < 0 || degree > n - 1) {
        throw sim::SetupError(path + ": has the degrees 1 to " + std::to_string(n - 1) + "; asked for " +
                              std::to_string(degree));
    }
    main.degree = main.order = rate.degree = rate.order = degree > 0 ? degree : n - 1;
    return {main.name, *epoch, main, rate};
}

Eigen::Vector3d MagneticCoefficients::field(const Eigen::Vector3d &r_P, double year) const
{
    if (year != year_) {
        now_.combine(main_, year - epoch_, rate_);
        year_ = year;
    }
    return -1e-9 * now_.gravity(r_P);
}

} // namespace fledge::world
