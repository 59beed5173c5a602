// SPDX-License-Identifier: Apache-2.0
#include "emulator/debug/source_lines.h"

#include <algorithm>
#include <dwarf.h>
#include <elfutils/libdw.h>
#include <fcntl.h>
#include <filesystem>
#include <unistd.h>

namespace fledge::emulator {

SourceLines::SourceLines(const std::string &elf)
{
    const int fd = open(elf.c_str(), O_RDONLY | O_CLOEXEC);
    Dwarf *dwarf = fd < 0 ? nullptr : dwarf_begin(fd, DWARF_C_READ);
    std::map<std::string, std::uint32_t> known;
    Dwarf_Off offset = 0, next = 0;
    for (std::size_t header = 0; dwarf && dwarf_nextcu(dwarf, offset, &next, &header, nullptr, nullptr, nullptr) == 0;
         offset = next) {
        Dwarf_Die unit;
        Dwarf_Lines *lines = nullptr;
        std::size_t n = 0;
        if (!dwarf_offdie(dwarf, offset + header, &unit) || dwarf_getsrclines(&unit, &lines, &n) != 0) {
            continue;
        }
        Dwarf_Attribute attribute;
        const char *folder = dwarf_formstring(dwarf_attr(&unit, DW_AT_comp_dir, &attribute));
        for (std::size_t i = 0; i + 1 < n; i++) {
            Dwarf_Line *here = dwarf_onesrcline(lines, i), *behind = dwarf_onesrcline(lines, i + 1);
            Dwarf_Addr begin = 0, end = 0;
            int line = 0;
            bool last = false, statement = false;
            const char *file = dwarf_linesrc(here, nullptr, nullptr);
            (void)dwarf_lineaddr(here, &begin);
            (void)dwarf_lineaddr(behind, &end);
            (void)dwarf_lineno(here, &line);
            (void)dwarf_lineendsequence(here, &last);
            (void)dwarf_linebeginstatement(here, &statement);
            if (last || !file || line <= 0) {
                continue;
            }
            const auto path = (std::filesystem::path(folder ? folder : "") / file).lexically_normal().string();
            const auto [found, isnew] = known.emplace(path, static_cast<std::uint32_t>(files_.size()));
            if (isnew) {
                files_.push_back(path);
            }
            const auto address = static_cast<std::uint32_t>(begin), number = static_cast<std::uint32_t>(line);
            if (statement) {
                beginnings_.push_back({address, found->second, number});
            }
            if (begin < end) {
                ranges_.push_back({address, static_cast<std::uint32_t>(end), found->second, number});
            }
        }
    }
    dwarf_end(dwarf);
    if (fd >= 0) {
        close(fd);
    }
    std::stable_sort(ranges_.begin(), ranges_.end(), [](const Range &a, const Range &b) { return a.begin < b.begin; });
}

const SourceLines::Range *SourceLines::find(std::uint32_t address) const
{
    const auto after = std::upper_bound(ranges_.begin(), ranges_.end(), address,
                                        [](std::uint32_t a, const Range &range) { return a < range.begin; });
    if (after == ranges_.begin() || address >= std::prev(after)->end) {
        return nullptr;
    }
    return &*std::prev(after);
}

} // namespace fledge::emulator
