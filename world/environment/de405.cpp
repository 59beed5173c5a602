// SPDX-License-Identifier: Apache-2.0
#include "world/environment/de405.h"

#include "sim/error.h"
#include "sim/text.h"
#include "world/constants.h"
#include "world/environment/bytes.h"
#include "world/environment/text_input.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <string_view>

namespace fledge::world {

namespace {

constexpr double mjd_j2000 = 51544.5; // [d]
constexpr std::size_t table_head = 16, row_head = 12;

/// Reads table.dat: big-endian, strings behind their length.
class Description {
public:
    explicit Description(const std::string &path) : path_(path), bytes_(read_whole(path))
    {
        skip(8); // the mark and the length of it all
        if (bytes_.compare(0, 4, "\xbe\xbe\xbe\xbe") != 0 || string() != "Table") {
            refuse_file(path_, "is no description of a casacore table");
        }
        skip(4); // version
        rows = integer();
        order = integer() == 0 ? std::endian::big : std::endian::little;

        // Records of keywords stand in descriptions of columns and of the table. Only they matter,
        // so they are looked for, and whatever surrounds them need not be understood.
        constexpr std::string_view mark("\0\0\0\x0bTableRecord", 15);
        for (std::size_t at = bytes_.find(mark); at != bytes_.npos; at = bytes_.find(mark, at_)) {
            at_ = at + mark.size();
            keywords();
        }
    }

    double number(const std::string &name) const
    {
        const auto found = numbers_.find(name);
        if (found == numbers_.end() || !std::isfinite(found->second)) {
            refuse_file(path_, "is damaged: it has no keyword " + name);
        }
        return found->second;
    }

    std::uint32_t rows = 0;
    std::endian order = std::endian::little;
    std::vector<std::int32_t> layout; ///< beginnings, then numbers of coefficients, then intervals

private:
    enum Type { type_int = 5, type_double = 8, type_string = 11, type_ints = 18 };

    /// One record: its description (name, type and comment of each field), then the values in
    /// order.
    void keywords()
    {
        skip(8); // version, length
        if (string() != "RecordDesc") {
            refuse_file(path_, "is damaged: a record of keywords has no description");
        }
        skip(4); // version
        std::vector<std::pair<std::string, std::uint32_t>> fields(integer());
        for (auto &[name, type] : fields) {
            name = string();
            type = integer();
            if (type == type_ints) {
                skip(4);  // the length of the shape
                string(); // its kind
                skip(4);  // version
                skip(4 * integer());
            }
            string(); // comment
        }
        skip(4); // kind of record
        for (const auto &[name, type] : fields) {
            if (type == type_double) {
                numbers_[name] = load<double>(take(8), std::endian::big);
            } else if (type == type_int) {
                numbers_[name] = static_cast<std::int32_t>(integer());
            } else if (type == type_string) {
                string();
            } else if (type == type_ints) {
                integers(name);
            } else {
                refuse_file(path_,
                            "is damaged: its keyword " + name + " is of the unknown type " + std::to_string(type));
            }
        }
    }

    void integers(const std::string &name)
    {
        skip(4); // length
        const std::string kind = string();
        skip(4); // version
        skip(4 * integer());
        const std::uint32_t count = integer();
        if (kind != "Array<Int>" || count > bytes_.size()) {
            refuse_file(path_, "is damaged: its keyword " + name + " is no list of integers");
        }
        for (std::uint32_t i = 0; i < count; i++) {
            layout.push_back(static_cast<std::int32_t>(integer()));
        }
    }

    const char *take(std::size_t n)
    {
        if (n > bytes_.size() - at_) {
            refuse_file(path_, "is cut short");
        }
        at_ += n;
        return bytes_.data() + at_ - n;
    }
    void skip(std::size_t n) { take(n); }
    std::uint32_t integer() { return load<std::uint32_t>(take(4), std::endian::big); }
    std::string string()
    {
        const std::uint32_t n = integer();
        return {take(n), n};
    }

    std::string path_, bytes_;
    std::size_t at_ = 0;
    std::map<std::string, double> numbers_;
};

/// The records of one body, as a segment has them: factor times the coefficients of a column.
struct Column {
    int target, center;
    std::size_t column;
    double factor;
};

constexpr std::size_t table_columns = 13;

/// The file of the rows, whose size and heads are those of the description.
class TableRows {
public:
    TableRows(const std::string &folder, const Description &description)
        : path(folder + "/table.f0i"), order(description.order), table_(read_whole(path))
    {
        const std::size_t rows = description.rows;
        if (table_.size() < table_head + row_head) {
            refuse_size(rows);
        }
        words = static_cast<std::size_t>(load<std::uint32_t>(table_.data() + table_head + row_head - 4, order));
        bytes_ = (row_head + 8 * words + 15) / 16 * 16;
        if (words > table_.size() || table_.size() < table_head + (rows - 1) * bytes_ + row_head + 8 * words) {
            refuse_size(rows);
        }
        for (std::size_t row = 0; row < rows; row++) {
            const char *head = at(row);
            if (load<std::uint32_t>(head, order) != 1 || load<std::uint32_t>(head + 4, order) != 1 ||
                load<std::uint32_t>(head + 8, order) != words) {
                refuse_file(path, "is damaged: row " + std::to_string(row + 1) + " has no head");
            }
        }
    }

    double number(std::size_t row, std::size_t word) const
    {
        return load<double>(at(row) + row_head + 8 * word, order);
    }

    const std::string path;
    const std::endian order;
    std::size_t words = 0; ///< numbers of a row

private:
    const char *at(std::size_t row) const { return table_.data() + table_head + row * bytes_; }
    [[noreturn]] void refuse_size(std::size_t rows) const
    {
        refuse_file(path, "is damaged or cut short: it has " + std::to_string(table_.size()) +
                              " bytes, which do not hold " + std::to_string(rows) + " rows");
    }

    std::string table_;
    std::size_t bytes_ = 0; ///< of a row
};

/// The records of a column, in their memory.
EphemerisSegment segment_of(const Column &column, const Description &description, const TableRows &rows,
                            const std::string &folder, std::vector<double> &records)
{
    const std::vector<std::int32_t> &layout = description.layout;
    const double row_days = description.number("dMJD");
    const std::int32_t first = layout[column.column] - 3; // two dates less, counted from 0
    const std::int32_t count = layout[table_columns + column.column];
    const std::int32_t parts = layout[2 * table_columns + column.column];
    if (first < 0 || count < 1 || count > 100 || parts < 1 || parts > 100 ||
        static_cast<std::size_t>(first) + 3 * static_cast<std::size_t>(count) * static_cast<std::size_t>(parts) >
            rows.words) {
        refuse_file(folder + "/table.dat", "is damaged: its layout goes beyond a row");
    }
    EphemerisSegment s;
    s.target = column.target;
    s.center = column.center;
    s.first = s.start = (description.number("MJD0") + row_days - mjd_j2000) * day_s;
    s.last = s.first + static_cast<double>(description.rows) * row_days * day_s;
    s.length = row_days * day_s / parts;
    s.coefficients = count;
    s.record_words = 2 + 3 * static_cast<std::size_t>(count);
    s.count = description.rows * static_cast<std::size_t>(parts);
    s.file = folder;

    records.reserve(s.count * s.record_words);
    for (std::size_t i = 0; i < s.count; i++) {
        const std::size_t row = i / static_cast<std::size_t>(parts);
        const std::size_t part = i % static_cast<std::size_t>(parts);
        const std::size_t from = static_cast<std::size_t>(first) + part * (s.record_words - 2);
        records.push_back(s.start + s.length * (static_cast<double>(i) + 0.5));
        records.push_back(0.5 * s.length);
        for (std::size_t k = 0; k < s.record_words - 2; k++) {
            records.push_back(column.factor * rows.number(row, from + k));
        }
    }
    if (!std::all_of(records.begin(), records.end(), [](double x) { return std::isfinite(x); })) {
        refuse_file(rows.path, "is damaged: it holds coefficients that are not finite");
    }
    s.records = records.data();
    return s;
}

} // namespace

SegmentFile read_de405(const std::string &folder)
{
    if (!std::filesystem::exists(folder + "/table.dat")) {
        refuse_file(folder,
                    "JPL's ephemeris DE405 is not there: give the folder that holds its table.dat; or, as root, "
                    "run: apt-get install casacore-data-jpl-de405");
    }
    const Description description(folder + "/table.dat");
    const double row_days = description.number("dMJD");
    const double earth_moon_ratio = description.number("EMRAT");
    if (!(description.number("DENUM") == 405.0 && description.number("CENTER") == 0.0 && row_days > 0.0 &&
          earth_moon_ratio > 0.0 && description.rows > 0 && description.layout.size() == 3 * table_columns)) {
        refuse_file(folder + "/table.dat", "is damaged, or of an ephemeris other than DE405");
    }
    const TableRows rows(folder, description);

    // The Moon is given relative to the Earth; both lie on a line through their barycentre.
    const double moon = earth_moon_ratio / (1.0 + earth_moon_ratio);
    std::vector<Column> wanted;
    for (int body = 1; body <= 9; body++) {
        wanted.push_back({body, 0, static_cast<std::size_t>(body - 1), 1.0});
    }
    wanted.push_back({10, 0, 10, 1.0});
    wanted.push_back({301, 3, 9, moon});
    wanted.push_back({399, 3, 9, moon - 1.0});
    wanted.push_back({301, 301, 12, 1.0}); // librations

    SegmentFile result;
    auto memory = std::make_shared<std::vector<std::vector<double>>>();
    for (const Column &column : wanted) {
        result.segments.push_back(segment_of(column, description, rows, folder, memory->emplace_back()));
    }
    result.memory = std::move(memory);
    result.librations = std::make_shared<Librations>(Librations{result.segments.back(), result.memory});
    result.segments.pop_back();
    return result;
}

} // namespace fledge::world
