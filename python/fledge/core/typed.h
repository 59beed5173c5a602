// SPDX-License-Identifier: Apache-2.0
// Objects of Python whose type stands in the binding. pybind11 writes the types of a function into its docstring, and
// cmake/extension_stubs.py makes stubs of these. Containers of C++ have real types there; a py::list says only "list".
//
//   using Numbers = Typed<py::list, "list[int | float]">;
//   m.def("numbers", [] { return Numbers(py::make_tuple(1, 2.5)); });     // numbers() -> list[int | float]
#pragma once

#include <pybind11/pybind11.h>

#include <algorithm>
#include <type_traits>
#include <utility>
#include <vector>

namespace fledge::core {

template <std::size_t n> struct TypeText {
    char text[n]{};

    constexpr TypeText(const char (&from)[n]) { std::copy_n(from, n, text); } // NOLINT: from a literal
};

/// A `Base` of pybind11. As an argument it takes what `Base` takes; a py::object takes everything, None too.
template <class Base, TypeText type> struct Typed : Base {
    using Base::Base;

    Typed(Base from) : Base(std::move(from)) {} // NOLINT: as pybind11's own

    static bool check_(pybind11::handle found)
    {
        if constexpr (std::is_same_v<Base, pybind11::object>) {
            return static_cast<bool>(found);
        } else {
            return Base::check_(found);
        }
    }
};

/// The results of `convert` for the elements of a range: a list of Python, whose type follows from that of `convert`.
template <class Range, class F> auto list_of(const Range &range, F convert)
{
    std::vector<decltype(convert(*std::begin(range)))> list;
    list.reserve(range.size());
    for (const auto &element : range) {
        list.push_back(convert(element));
    }
    return list;
}

} // namespace fledge::core

template <class Base, fledge::core::TypeText shown> // `type` is a class of pybind11 here
struct pybind11::detail::handle_type_name<fledge::core::Typed<Base, shown>> {
    static constexpr auto name = const_name(shown.text);
};
