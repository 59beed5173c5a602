// SPDX-License-Identifier: Apache-2.0
// SPICE text kernels: `.tls` leap seconds, `.tpc` planetary constants.
//
// Everything is a comment but what stands between a line \begindata and a line \begintext:
//
//   BODY499_RADII  = ( 3396.19, 3396.19
//                      3376.20 )            values between blanks, commas and line ends
//   BODY499_RADII += 1.5D0                  more values for the same name
//   NAME           = 'a ''quoted'' word'    or @1972-JAN-1, a time
//
// A later assignment replaces an earlier one. Source: NAIF, "Kernel Required Reading".
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace fledge::world {

struct KernelValue {
    std::string text; ///< as it stands in the file; of a string, what is between the quotes
    bool is_number = false;
    double number = 0.0;
    std::size_t line = 0;
};

class TextKernel {
public:
    /// Throws SetupError with the file, the line and what was expected there.
    static TextKernel read(const std::string &path);

    /// The same from text in memory; `file` is what errors call it.
    static TextKernel parse(std::string_view text, const std::string &file);

    const std::string &file() const { return file_; }
    bool has(const std::string &name) const { return values_.count(name) > 0; }

    /// Throws SetupError if the kernel does not define the name.
    const std::vector<KernelValue> &values(const std::string &name) const;

    /// The values of a name that must be `least` to `most` numbers. Throws SetupError otherwise.
    std::vector<double> numbers(const std::string &name, std::size_t least, std::size_t most) const;

    double number(const std::string &name) const { return numbers(name, 1, 1)[0]; }

    /// All names that the kernel defines, in alphabetical order.
    std::vector<std::string> names() const;

private:
    std::string file_;
    std::map<std::string, std::vector<KernelValue>> values_;
};

} // namespace fledge::world
