// SPDX-License-Identifier: Apache-2.0
#include "world/environment/spk.h"

#include "flight/math/elementary.h"
#include "sim/error.h"
#include "sim/text.h"
#include "world/environment/bodies.h"
#include "world/environment/bytes.h"
#include "world/environment/text_input.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <functional>
#include <numbers>
#include <string_view>

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

namespace fledge::world {

namespace {

constexpr std::size_t record_bytes = 1024, record_words = 128;
constexpr std::size_t summary_words = 5; // ND + (NI + 1) / 2
constexpr double farthest = 1e15;        // [km] a hundred light years; [km/s] none so fast
constexpr std::string_view transfer_check("FTPSTR:\r:\n:\r\n:\r\0:\x81:\x10\xce:ENDFTP", 28);

/// A type that is read: the words of a record, of the last words, and how it is evaluated.
struct SegmentType {
    int number;
    EphemerisSegment::Method method;
    int record_words; ///< 0: the last words say it
    int last_words;
    bool has_epochs; ///< and after them every hundredth again
};
using Method = EphemerisSegment::Method;
constexpr SegmentType types[] = {
    {1, Method::differences, 71, 1, true}, {2, Method::chebyshev, 0, 4, false}, {3, Method::chebyshev, 0, 4, false},
    {5, Method::conics, 6, 2, true},       {8, Method::lagrange, 6, 4, false},  {9, Method::lagrange, 6, 2, true},
    {12, Method::hermite, 6, 4, false},    {13, Method::hermite, 6, 2, true},   {18, Method::lagrange, 0, 3, true},
    {21, Method::differences, 0, 2, true},
};
constexpr int most_differences = 25;

/// Axes F that NAIF numbers from 1 on, by those of an earlier number: [FB] = R(turn 0) R(turn 1) R(turn 2), [arcsec].
struct InertialFrame {
    int base;
    struct {
        double angle;
        int axis;
    } turns[3];
};
constexpr InertialFrame inertial_frames[] = {
    {0, {}},                                                                     // J2000
    {1, {{1152.84248596724, 3}, {-1002.26108439117, 2}, {1153.04066200330, 3}}}, // B1950
    {2, {{0.525, 3}}},                                                           // FK4
    {2, {{0.53155, 3}}},                                                         // DE-118
    {2, {{0.4107, 3}}},                                                          // DE-96
    {2, {{0.1359, 3}}},                                                          // DE-102
    {2, {{0.4775, 3}}},                                                          // DE-108
    {2, {{0.5880, 3}}},                                                          // DE-111
    {2, {{0.5529, 3}}},                                                          // DE-114
    {2, {{0.5316, 3}}},                                                          // DE-122
    {2, {{0.5754, 3}}},                                                          // DE-125
    {2, {{0.5247, 3}}},                                                          // DE-130
    {3, {{1177200.0, 3}, {225360.0, 1}, {1016100.0, 3}}},                        // GALACTIC
    {1, {}},                                                                     // DE-200
    {1, {}},                                                                     // DE-202
    {1, {{324000.0, 3}, {133610.4, 2}, {-152348.4, 3}}},                         // MARSIAU
    {1, {{84381.448, 1}}},                                                       // ECLIPJ2000
    {2, {{84404.836, 1}}},                                                       // ECLIPB1950
    {1, {{1152.71013777252, 3}, {-1002.25042010533, 2}, {1153.75719544491, 3}}}, // DE-140
    {1, {{1152.72061453864, 3}, {-1002.25052830351, 2}, {1153.74663857521, 3}}}, // DE-142
    {1, {{1153.03919093833, 3}, {-1002.24822382286, 2}, {1153.42900222357, 3}}}, // DE-143
};

/// [NF]: of those of a frame to those of the ICRF.
Eigen::Matrix3d axes_of(int frame)
{
    Eigen::Matrix3d dcm = Eigen::Matrix3d::Identity();
    for (; frame != 0; frame = inertial_frames[frame - 1].base) {
        for (const auto &turn : inertial_frames[frame - 1].turns) {
            double sine, cosine;
            fm_sincos(turn.angle * (std::numbers::pi / 648000.0), &sine, &cosine);
            const int j = turn.axis % 3, k = (turn.axis + 1) % 3; // without an axis, by zero
            const Eigen::RowVector3d y = dcm.row(j), z = dcm.row(k);
            dcm.row(j) = cosine * y - sine * z;
            dcm.row(k) = sine * y + cosine * z;
        }
    }
    return dcm;
}

/// What NAIF calls the types that are not read.
const char *type_name(int type)
{
    switch (type) {
    case 10: return " (two-line elements, of SGP4: give the elements themselves, as the .tle has them)";
    case 14: return " (Chebyshev polynomials of unequal intervals)";
    case 15: return " (precessing conics)";
    case 17: return " (equinoctial elements)";
    case 19: return " (piecewise interpolation)";
    case 20: return " (Chebyshev polynomials of velocities)";
    default: return "";
    }
}

[[noreturn]] void refuse_system(const std::string &path, const char *what)
{
    refuse_file(path, std::string(what) + ": " + std::strerror(errno));
}

/// The whole of a file in memory, until it is destroyed.
class MappedFile {
public:
    explicit MappedFile(const std::string &path)
    {
        const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
        if (file < 0) {
            refuse_system(path, "cannot be opened");
        }
        struct stat status = {};
        if (::fstat(file, &status) == 0 && S_ISREG(status.st_mode) && status.st_size > 0) {
            size_ = static_cast<std::size_t>(status.st_size);
            bytes_ = ::mmap(nullptr, size_, PROT_READ, MAP_PRIVATE, file, 0);
        }
        ::close(file);
        if (size_ == 0) {
            refuse_file(path, "is empty or no file; expected a SPICE SPK kernel");
        }
        if (bytes_ == MAP_FAILED) {
            refuse_system(path, "cannot be mapped into memory");
        }
    }
    ~MappedFile() { ::munmap(bytes_, size_); }
    MappedFile(const MappedFile &) = delete;
    MappedFile &operator=(const MappedFile &) = delete;

    const char *bytes() const { return static_cast<const char *>(bytes_); }
    std::size_t size() const { return size_; }

private:
    void *bytes_ = nullptr;
    std::size_t size_ = 0;
};

class Reader {
public:
    explicit Reader(const std::string &path) : path_(path), file_(std::make_shared<const MappedFile>(path)) {}

    SegmentFile read()
    {
        const std::size_t first = check_head();
        place_words();
        SegmentFile result;
        std::size_t record = first;
        for (std::size_t visited = 0; record != 0; visited++) {
            if (record > file_->size() / record_bytes || visited > file_->size() / record_bytes) {
                refuse_file(path_, "is damaged or cut short: summary record " + std::to_string(record) +
                                       " is beyond its end or was met before");
            }
            const double *summaries = words_ + (record - 1) * record_words;
            const std::size_t next = index(summaries[0], "the next summary record");
            const std::size_t count = index(summaries[2], "the number of summaries");
            if (count > (record_words - 3) / summary_words) {
                refuse_file(path_, "is damaged: a summary record holds " + std::to_string(count) +
                                       " summaries; there is room for 25");
            }
            for (std::size_t i = 0; i < count; i++) {
                const std::size_t at = (record - 1) * record_bytes + 8 * (3 + i * summary_words);
                result.segments.push_back(segment(at, result.segments.size() + 1));
            }
            record = next;
        }
        if (result.segments.empty()) {
            refuse_file(path_, "holds no segments");
        }
        result.memory = turned_ ? std::shared_ptr<const void>(turned_) : file_;
        return result;
    }

private:
    /// The first summary record.
    std::size_t check_head()
    {
        const char *bytes = file_->bytes();
        const std::string_view magic(bytes, std::min<std::size_t>(8, file_->size()));
        if (magic.starts_with("DAFETF")) {
            refuse_file(path_, "is a transfer file (.xsp); turn it into a binary kernel first, with "
                               "NAIF's tobin");
        }
        if (magic.starts_with("DAF/") && magic != "DAF/SPK ") {
            refuse_file(path_, "is a kernel of kind \"" + std::string(magic) + "\"; expected \"DAF/SPK \"");
        }
        if (magic != "DAF/SPK " && magic != "NAIF/DAF") {
            refuse_file(path_, "is no SPICE SPK kernel: it does not begin with \"DAF/SPK \"");
        }
        if (file_->size() < record_bytes) {
            refuse_file(path_,
                        "is cut short: it has " + std::to_string(file_->size()) + " bytes, less than the first record");
        }
        const std::string_view order(bytes + 88, 8);
        if (order == "LTL-IEEE") {
            order_ = std::endian::little;
        } else if (order == "BIG-IEEE") {
            order_ = std::endian::big;
        } else if (magic == "NAIF/DAF") { // older files have no mark: ND shows the order
            order_ = load<std::int32_t>(bytes + 8, std::endian::little) == 2 ? std::endian::little : std::endian::big;
        } else {
            refuse_file(path_, "is damaged: its byte order is marked neither LTL-IEEE nor BIG-IEEE");
        }
        const auto nd = load<std::int32_t>(bytes + 8, order_);
        const auto ni = load<std::int32_t>(bytes + 12, order_);
        if (nd != 2 || ni != 6) {
            refuse_file(path_, "is damaged: summaries of " + std::to_string(nd) + " doubles and " + std::to_string(ni) +
                                   " integers; SPK kernels have 2 and 6");
        }
        const std::string_view check(bytes + 699, transfer_check.size());
        if (check.starts_with("FTPSTR") && check != transfer_check) {
            refuse_file(path_, "was damaged by a transfer as text; transfer it as binary");
        }
        const auto first = load<std::int32_t>(bytes + 76, order_);
        if (first < 1) {
            refuse_file(path_, "is damaged: its first summary record is " + std::to_string(first));
        }
        return static_cast<std::size_t>(first);
    }

    /// The file as words of this machine.
    void place_words()
    {
        word_count_ = file_->size() / 8;
        if (order_ == std::endian::native) {
            words_ = reinterpret_cast<const double *>(file_->bytes()); // a page boundary
            return;
        }
        auto words = std::make_shared<std::vector<double>>(word_count_);
        for (std::size_t i = 0; i < word_count_; i++) {
            (*words)[i] = load<double>(file_->bytes() + 8 * i, order_);
        }
        words_ = words->data();
        turned_ = std::move(words);
    }

    std::size_t index(double value, const char *what) const
    {
        if (!(value >= 0.0 && value < 1e15 && value == std::floor(value))) {
            refuse_file(path_, std::string("is damaged: ") + what + " is " + sim::format_number(value) +
                                   "; expected a whole number");
        }
        return static_cast<std::size_t>(value);
    }

    EphemerisSegment segment(std::size_t at, std::size_t number) const
    {
        const char *summary = file_->bytes() + at;
        std::int32_t integers[6];
        for (std::size_t i = 0; i < 6; i++) {
            integers[i] = load<std::int32_t>(summary + 16 + 4 * i, order_);
        }
        EphemerisSegment s;
        s.file = path_;
        s.first = load<double>(summary, order_);
        s.last = load<double>(summary + 8, order_);
        s.target = integers[0];
        s.center = integers[1];
        s.frame = integers[2];
        const std::string name = "segment " + std::to_string(number) + ", " + body_name(s.target) + " relative to " +
                                 body_name(s.center) + ", ";
        const Refusal refuse = [&](const std::string &what) { refuse_file(path_, name + what); };

        const auto *type = std::find_if(std::begin(types), std::end(types),
                                        [&](const SegmentType &known) { return known.number == integers[3]; });
        if (type == std::end(types)) {
            refuse("is of type " + std::to_string(integers[3]) + type_name(integers[3]) +
                   "; types 1, 2, 3, 5, 8, 9, 12, 13, 18 and 21 are read: NAIF's mkspk writes states as 13");
        }
        if (s.frame < 1 || s.frame > static_cast<int>(std::size(inertial_frames))) {
            refuse("is given in the frame " + std::to_string(s.frame) +
                   "; the frames that do not turn are read, 1 (J2000) to 21 (DE-143)");
        }
        s.dcm_NF = axes_of(s.frame);
        if (!(s.first <= s.last && std::isfinite(s.first) && std::isfinite(s.last))) {
            refuse("is damaged: it holds from " + sim::format_number(s.first) + " s to " + sim::format_number(s.last) +
                   " s");
        }
        if (s.target == s.center) {
            refuse("is damaged: a body relative to itself");
        }
        if (integers[4] < 1 || integers[5] < integers[4] + type->last_words ||
            static_cast<std::size_t>(integers[5]) > word_count_) {
            refuse("is damaged or cut short: its summary gives it the words " + std::to_string(integers[4]) + " to " +
                   std::to_string(integers[5]) + "; the file has " + std::to_string(word_count_));
        }
        s.records = words_ + integers[4] - 1;
        s.method = type->method;
        const double *tail = words_ + integers[5] - type->last_words;
        if (s.method == Method::chebyshev) {
            s.has_velocity = type->number == 3;
            read_polynomials(s, tail, refuse);
        } else {
            read_states(s, *type, tail, refuse);
        }
        return s;
    }

    using Refusal = std::function<void(const std::string &)>;

    void read_polynomials(EphemerisSegment &s, const double *tail, const Refusal &refuse) const
    {
        const auto words = static_cast<std::size_t>(tail - s.records);
        s.start = tail[0];
        s.length = tail[1];
        s.record_words = index(tail[2], "the length of a record");
        s.count = index(tail[3], "the number of records");
        const std::size_t components = s.has_velocity ? 6 : 3;
        if (s.record_words < 2 + components || (s.record_words - 2) % components != 0 || s.count < 1 ||
            words / s.record_words != s.count || words % s.record_words != 0) {
            refuse("is damaged: " + std::to_string(words) + " words for " + std::to_string(s.count) + " records of " +
                   std::to_string(s.record_words) + ", each 2 and " + std::to_string(components) +
                   " times the number of coefficients");
        }
        s.coefficients = static_cast<int>((s.record_words - 2) / components);

        const double slack = 1e-6 * s.length;
        if (!(s.length > 0.0 && std::isfinite(s.start) && s.start <= s.first + slack &&
              s.last <= s.start + s.length * static_cast<double>(s.count) + slack)) {
            refuse("is damaged: its records begin at " + sim::format_number(s.start) + " s and last " +
                   sim::format_number(s.length) + " s each, which is not the span in its summary");
        }
        for (std::size_t i = 0; i < s.count; i++) {
            const double *record = s.records + i * s.record_words;
            const double middle = s.start + s.length * (static_cast<double>(i) + 0.5);
            if (!(std::fabs(record[0] - middle) <= slack && std::fabs(record[1] - 0.5 * s.length) <= slack)) {
                refuse("is damaged: record " + std::to_string(i + 1) + " is not for its interval");
            }
            if (!std::all_of(record + 2, record + s.record_words, [](double c) { return std::fabs(c) < farthest; })) {
                refuse("is damaged: record " + std::to_string(i + 1) + " holds a coefficient that is no distance");
            }
        }
    }

    /// All but Chebyshev's: records, their epochs or a first and a step, and what the type has behind them.
    void read_states(EphemerisSegment &s, const SegmentType &type, const double *tail, const Refusal &refuse) const
    {
        s.count = index(tail[type.last_words - 1], "the number of records");
        s.record_words = static_cast<std::size_t>(type.record_words);
        std::size_t window = 0;
        if (s.method == Method::differences) {
            s.coefficients = 15;
            if (type.number == 21) {
                s.coefficients = static_cast<int>(std::min<std::size_t>(index(tail[0], "the number of terms"), 1000));
                s.record_words = 4 * static_cast<std::size_t>(s.coefficients) + 11;
            }
            if (s.coefficients < 1 || s.coefficients > most_differences) {
                refuse("is damaged: " + sim::format_number(tail[0]) + " terms of differences; there are 1 to 25");
            }
        } else if (s.method == Method::conics) {
            s.mu = tail[0];
            if (!(s.mu > 0.0 && s.mu < farthest)) {
                refuse("is damaged: its gravitational parameter is " + sim::format_number(s.mu) + " km^3/s^2");
            }
        } else if (type.number == 18) {
            const std::size_t subtype = index(tail[0], "the subtype");
            if (subtype > 2) {
                refuse("is of type 18, subtype " + std::to_string(subtype) + "; subtypes 0 to 2 are read");
            }
            s.method = subtype == 0 ? Method::hermite_of_both : subtype == 1 ? Method::lagrange : Method::hermite;
            s.record_words = subtype == 0 ? 12 : 6;
            s.cut_at_ends = true;
            window = index(tail[1], "the size of the window");
        } else {
            window = index(tail[type.last_words - 2], "the degree") + 1;
        }
        const auto words = static_cast<std::size_t>(tail - s.records);
        const std::size_t per_record = s.record_words + (type.has_epochs ? 1 : 0);
        const std::size_t least = type.has_epochs && s.count > 0 ? (s.count - 1) / 100 : 0; // of the directory
        if (s.count < 1 || s.count > words || words < s.count * per_record + least ||
            words > s.count * per_record + (type.has_epochs ? s.count / 100 : 0)) {
            refuse("is damaged: " + std::to_string(words) + " words for " + std::to_string(s.count) + " records of " +
                   std::to_string(per_record));
        }
        if (!type.has_epochs) {
            s.start = tail[0];
            s.length = tail[1];
        } else {
            s.epochs = s.records + s.count * s.record_words;
        }
        check_times(s, refuse);
        const std::size_t nodes = window * (s.method == Method::lagrange ? 1 : 2);
        if (window > 0 && (nodes < 2 || nodes > EphemerisSegment::most_nodes || (s.cut_at_ends && window % 2 == 1))) {
            refuse("is damaged: its polynomials go through " + std::to_string(window) +
                   " records; expected 2 to 28, for Hermite's 1 to 14, of type 18 an even number");
        }
        s.window = s.cut_at_ends ? window : std::min(window, s.count);
        for (std::size_t i = 0; i < s.count; i++) {
            check_record(s, i, refuse);
        }
    }

    void check_times(const EphemerisSegment &s, const Refusal &refuse) const
    {
        double begin = s.start, end = s.start + s.length * static_cast<double>(s.count - 1);
        if (s.epochs) {
            begin = s.epochs[0];
            end = s.epochs[s.count - 1];
            // Integrators end a record where they begin, too: it has no length, and is never used.
            const bool may_be_equal = s.method == Method::differences;
            const auto *bad = std::adjacent_find(
                s.epochs, s.epochs + s.count, [&](double a, double b) { return !(a < b || (may_be_equal && a == b)); });
            if (bad != s.epochs + s.count || !std::isfinite(begin) || !std::isfinite(end)) {
                refuse("is damaged: the time of record " + std::to_string(bad - s.epochs + 1) +
                       (may_be_equal ? " is after that of the next" : " is not before that of the next"));
            }
        }
        // Differences hold up to their epochs; conics go on from the last state, and from the first back.
        const double slack = 1e-6 * (end - begin) + 1e-6;
        const bool is_open = s.method == Method::conics;
        if (!((s.epochs || s.length > 0.0) &&
              (is_open || s.method == Method::differences || begin <= s.first + slack) &&
              (is_open || s.last <= end + slack))) {
            refuse("is damaged: its records are from " + sim::format_number(begin) + " s to " +
                   sim::format_number(end) + " s, which is not the span in its summary");
        }
    }

    void check_record(const EphemerisSegment &s, std::size_t i, const Refusal &refuse) const
    {
        const double *record = s.records + i * s.record_words, *end = record + s.record_words;
        const auto damaged = [&](const char *what) { refuse("is damaged: record " + std::to_string(i + 1) + what); };
        if (!std::all_of(record, end, [](double x) { return std::fabs(x) < farthest; })) {
            damaged(" holds a number that is no distance");
        }
        if (s.method == Method::conics && !(record[0] != 0.0 || record[1] != 0.0 || record[2] != 0.0)) {
            damaged(" is at the centre of its conic");
        }
        if (s.method == Method::differences) {
            const bool in_bounds = std::all_of(end - 3, end, [&](double order) {
                return order >= 0.0 && order <= s.coefficients && order == std::floor(order);
            });
            const auto highest = in_bounds ? static_cast<int>(*std::max_element(end - 3, end)) : 0;
            if (!in_bounds ||
                std::any_of(record + 1, record + std::max(highest, 1), [](double step) { return step == 0.0; })) {
                damaged(" has no sound orders and steps of its differences");
            }
        }
    }

    std::string path_;
    std::shared_ptr<const MappedFile> file_;
    std::shared_ptr<const std::vector<double>> turned_;
    const double *words_ = nullptr;
    std::size_t word_count_ = 0;
    std::endian order_ = std::endian::native;
};

} // namespace

SegmentFile read_spk(const std::string &path)
{
    return Reader(path).read();
}

} // namespace fledge::world
