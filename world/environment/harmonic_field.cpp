// SPDX-License-Identifier: Apache-2.0
#include "world/environment/harmonic_field.h"

#include "sim/error.h"
#include "sim/text.h"
#include "world/environment/text_input.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string_view>

namespace fledge::world {

namespace {

constexpr int highest_in_header = 10'000; // a header beyond it is damaged: 1.6 GB of numbers

/// sqrt((2 - d_m0) (2 n + 1) (n - m)! / (n + m)!): C = C' / this for an unnormalised C'.
double normalisation(int n, int m)
{
    double square = (m == 0 ? 1.0 : 2.0) * (2.0 * n + 1.0);
    for (int k = n - m + 1; k <= n + m; k++) {
        square /= k;
    }
    return std::sqrt(square);
}

/// Takes the coefficients of a file in any order, and checks that each comes once.
class Collector {
public:
    Collector(std::string file, HarmonicField &field, bool normalised)
        : file_(std::move(file)), field_(field), normalised_(normalised),
          seen_(HarmonicField::index(field.degree + 1, 0), false)
    {
    }

    /// n, m, C, S are the words from `first` on.
    void take(const std::vector<std::string_view> &words, std::size_t first, std::size_t line)
    {
        if (words.size() < first + 4) {
            refuse_line(file_, line, "expected n, m, C, S, found " + std::to_string(words.size() - first) + " values");
        }
        const auto n = parse_integer(words[first]), m = parse_integer(words[first + 1]);
        const auto C = parse_number(words[first + 2]), S = parse_number(words[first + 3]);
        if (!n || !m || !C || !S) {
            const std::size_t bad = !n ? 0 : !m ? 1 : !C ? 2 : 3;
            refuse_line(file_, line, "expected a number, found \"" + std::string(words[first + bad]) + "\"");
        }
        if (*n < 0 || *n > field_.degree || *m < 0 || *m > std::min(*n, field_.order)) {
            refuse_line(file_, line,
                        "degree " + std::to_string(*n) + ", order " + std::to_string(*m) +
                            "; the header promises up to " + std::to_string(field_.degree) + ", " +
                            std::to_string(field_.order));
        }
        const std::size_t i = HarmonicField::index(*n, *m);
        if (seen_[i]) {
            refuse_line(file_, line,
                        "degree " + std::to_string(*n) + ", order " + std::to_string(*m) + " is given twice");
        }
        seen_[i] = true;
        const double scale = normalised_ ? 1.0 : 1.0 / normalisation(*n, *m);
        field_.C[i] = *C * scale;
        field_.S[i] = *S * scale;
        if (!std::isfinite(field_.C[i]) || !std::isfinite(field_.S[i])) {
            refuse_line(file_, line, "the coefficient is beyond the range of numbers");
        }
    }

    void finish() const
    {
        for (int n = 2; n <= field_.degree; n++) {
            for (int m = 0; m <= std::min(n, field_.order); m++) {
                if (!seen_[HarmonicField::index(n, m)]) {
                    throw sim::SetupError(file_ + ": degree " + std::to_string(n) + ", order " + std::to_string(m) +
                                          " is missing; the header promises all up to " +
                                          std::to_string(field_.degree) + ", " + std::to_string(field_.order) +
                                          ". Is the file cut short?");
                }
            }
        }
    }

private:
    std::string file_;
    HarmonicField &field_;
    bool normalised_;
    std::vector<bool> seen_;
};

} // namespace

HarmonicField HarmonicField::zero(double mu, double radius, int degree)
{
    if (!(mu > 0.0 && std::isfinite(mu) && radius > 0.0 && std::isfinite(radius) && degree >= 0 &&
          degree <= highest_in_header)) {
        throw sim::SetupError("gravity field: mu and the radius must be > 0 and the degree 0 to " +
                              std::to_string(highest_in_header) + "; found " + sim::format_number(mu) + ", " +
                              sim::format_number(radius) + " and " + std::to_string(degree));
    }
    HarmonicField field;
    field.mu = mu;
    field.radius = radius;
    field.degree = field.order = degree;
    field.tide_system = "unknown";
    field.C.assign(index(degree + 1, 0), 0.0);
    field.S = field.C;
    field.C[0] = 1.0;
    return field;
}

double HarmonicField::J(int n) const
{
    if (n < 0 || n > degree) {
        throw sim::SetupError("gravity field " + name + ": has no J" + std::to_string(n) + "; its degree is " +
                              std::to_string(degree));
    }
    return -std::sqrt(2.0 * n + 1.0) * C[index(n, 0)];
}

HarmonicField read_shadr(const std::string &path, LengthUnit unit)
{
    const std::string text = read_whole(path);
    const auto lines = lines_of(text);
    const auto header = lines.empty() ? std::vector<std::string_view>() : words_of(lines[0]);
    const auto number = [&](std::size_t i) { return i < header.size() ? parse_number(header[i]) : std::nullopt; };
    const auto integer = [&](std::size_t i) { return i < header.size() ? parse_integer(header[i]) : std::nullopt; };
    const auto radius = number(0), mu = number(1);
    const auto degree = integer(3), order = integer(4), normalised = integer(5);
    if (!radius || !mu || !degree || !order || !normalised || *radius <= 0.0 || *mu <= 0.0 || *degree < 0 ||
        *degree > highest_in_header || *order < 0 || *order > *degree) {
        refuse_line(path, 1,
                    "expected the header of a SHADR file: radius, mu, sigma of mu, degree, "
                    "order, 1 if normalised");
    }
    if (*normalised != 0 && *normalised != 1) {
        refuse_line(path, 1,
                    "the sixth value is 1: fully normalised, or 0: not normalised; found " +
                        std::to_string(*normalised));
    }
    const bool kilometres = unit == LengthUnit::kilometre || (unit == LengthUnit::by_radius && *radius < 1e5);
    HarmonicField field =
        HarmonicField::zero(*mu * (kilometres ? 1e9 : 1.0), *radius * (kilometres ? 1e3 : 1.0), *degree);
    field.name = path;
    field.order = *order;
    Collector collector(path, field, *normalised == 1);
    for (std::size_t i = 1; i < lines.size(); i++) {
        const auto words = words_of(lines[i]);
        if (!words.empty()) {
            collector.take(words, 0, i + 1);
        }
    }
    collector.finish();
    return field;
}

namespace {

/// The head of a file in ICGEM's format.
struct IcgemHead {
    std::string name, tide_system = "unknown";
    std::optional<double> mu, radius;
    std::optional<int> degree;
    bool normalised = true;

    /// From a line of a key and a value.
    void take(const std::string &path, std::size_t line, std::string_view key, std::string_view value)
    {
        bool understood = true;
        if (key == "product_type" && value != "gravity_field") {
            refuse_line(path, line, "expected product_type gravity_field, found " + std::string(value));
        } else if (key == "modelname") {
            name = value;
        } else if (key == "earth_gravity_constant" || key == "gravity_constant") {
            understood = (mu = parse_number(value)).has_value();
        } else if (key == "radius") {
            understood = (radius = parse_number(value)).has_value();
        } else if (key == "max_degree") {
            understood = (degree = parse_integer(value)).has_value();
        } else if (key == "norm") {
            normalised = value == "fully_normalized";
            understood = normalised || value == "unnormalized";
        } else if (key == "tide_system") {
            tide_system = value;
        }
        if (!understood) {
            refuse_line(path, line,
                        "the value \"" + std::string(value) + "\" of " + std::string(key) + " is not understood");
        }
    }
};

} // namespace

HarmonicField read_icgem(const std::string &path)
{
    const std::string text = read_whole(path);
    const auto lines = lines_of(text);
    std::size_t i = 0;
    IcgemHead head;
    head.name = path;
    bool ended = false;
    for (; i < lines.size() && !ended; i++) {
        const auto words = words_of(lines[i]);
        ended = !words.empty() && words[0] == "end_of_head";
        if (words.size() >= 2) {
            head.take(path, i + 1, words[0], words[1]);
        }
    }
    if (!ended) {
        throw sim::SetupError(path + ": has no line end_of_head; expected a gravity field in ICGEM's "
                                     "format (.gfc)");
    }
    if (!head.mu || !head.radius || !head.degree) {
        throw sim::SetupError(path + ": its header lacks " +
                              (!head.mu       ? "earth_gravity_constant"
                               : !head.radius ? "radius"
                                              : "max_degree"));
    }
    HarmonicField field = HarmonicField::zero(*head.mu, *head.radius, *head.degree);
    field.name = head.name;
    field.tide_system = head.tide_system;
    Collector collector(path, field, head.normalised);
    for (; i < lines.size(); i++) {
        const auto words = words_of(lines[i]);
        if (words.empty()) {
            continue;
        }
        // gfct: the value at an epoch; the lines after it hold its change in time.
        if (words[0] == "gfc" || words[0] == "gfct") {
            field.varies = field.varies || words[0] == "gfct";
            collector.take(words, 1, i + 1);
        } else if (words[0] == "trnd" || words[0] == "dot" || words[0] == "asin" || words[0] == "acos") {
            field.varies = true;
        } else {
            refuse_line(path, i + 1,
                        "expected gfc, gfct, trnd, dot, asin or acos, found \"" + std::string(words[0].substr(0, 40)) +
                            "\"");
        }
    }
    collector.finish();
    return field;
}

HarmonicField read_gravity_field(const std::string &path)
{
    return path.ends_with(".gfc") ? read_icgem(path) : read_shadr(path);
}

} // namespace fledge::world
