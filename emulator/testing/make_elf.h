// SPDX-License-Identifier: Apache-2.0
// Makes ELF files of words, without a compiler.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace fledge::emulator::testing {

struct ElfSymbol {
    std::string name;
    std::uint32_t address = 0, size = 0;
};

/// A program with one segment, that begins with its entry and has `zeros` bytes more in memory.
inline std::vector<std::byte> make_elf(std::uint32_t address, const std::vector<std::uint32_t> &words,
                                       const std::vector<ElfSymbol> &functions = {}, std::uint32_t zeros = 0)
{
    std::vector<std::byte> out;
    const auto half = [&](std::uint32_t v) {
        out.push_back(static_cast<std::byte>(v >> 8));
        out.push_back(static_cast<std::byte>(v));
    };
    const auto word = [&](std::uint32_t v) {
        half(v >> 16);
        half(v & 0xFFFF);
    };
    std::string names(1, '\0');
    std::vector<std::uint32_t> name_at;
    for (const ElfSymbol &s : functions) {
        name_at.push_back(static_cast<std::uint32_t>(names.size()));
        names += s.name + '\0';
    }
    names.resize((names.size() + 3) / 4 * 4);
    const auto bytes = static_cast<std::uint32_t>(4 * words.size());
    const auto symbols = static_cast<std::uint32_t>(16 * functions.size()), text = 84u, table = text + bytes,
               strings = table + symbols, sections = strings + static_cast<std::uint32_t>(names.size());

    word(0x7F454C46);
    word(0x01020100);
    word(0);
    word(0);
    half(2); // ET_EXEC
    half(2); // EM_SPARC
    word(1);
    word(address);
    word(52);
    word(sections);
    word(0);
    half(52);
    half(32);
    half(1);
    half(40);
    half(3);
    half(0);
    for (const std::uint32_t v : {1u, text, address, address, bytes, bytes + zeros, 7u, 4u}) {
        word(v);
    }
    for (const std::uint32_t v : words) {
        word(v);
    }
    for (std::size_t i = 0; i < functions.size(); i++) {
        word(name_at[i]);
        word(functions[i].address);
        word(functions[i].size);
        half(0x1200); // a global function
        half(1);
    }
    for (const char c : names) {
        out.push_back(static_cast<std::byte>(c));
    }
    const auto section = [&](std::uint32_t type, std::uint32_t at, std::uint32_t size, std::uint32_t link) {
        for (const std::uint32_t v : {0u, type, 0u, 0u, at, size, link, 0u, 4u, 16u}) {
            word(v);
        }
    };
    section(0, 0, 0, 0);
    section(2, table, symbols, 2);
    section(3, strings, static_cast<std::uint32_t>(names.size()), 0);
    return out;
}

} // namespace fledge::emulator::testing
