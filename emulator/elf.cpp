// SPDX-License-Identifier: Apache-2.0
#include "emulator/elf.h"

#include <algorithm>
#include <charconv>
#include <elf.h>
#include <fstream>
#include <iterator>

namespace fledge::emulator {

namespace {

/// Reads numbers of a file, and throws if they are not in it.
class FileReader {
public:
    FileReader(std::span<const std::byte> file, const std::string &path) : file_(file), path_(path) {}

    [[noreturn]] void fail(const std::string &why) const { throw Error(path_ + ": " + why); }

    std::span<const std::byte> bytes(std::uint64_t at, std::uint64_t n, const char *what) const
    {
        if (at > file_.size() || n > file_.size() - at) {
            fail(std::string(what) + " is at bytes " + std::to_string(at) + " to " + std::to_string(at + n) +
                 ", but the file has " + std::to_string(file_.size()) + ": it is truncated or damaged");
        }
        return file_.subspan(at, n);
    }
    std::uint32_t half(std::uint64_t at, const char *what) const
    {
        const auto b = bytes(at, 2, what);
        return std::to_integer<std::uint32_t>(b[0]) << 8 | std::to_integer<std::uint32_t>(b[1]);
    }
    std::uint32_t word(std::uint64_t at, const char *what) const { return half(at, what) << 16 | half(at + 2, what); }

private:
    std::span<const std::byte> file_;
    const std::string &path_;
};

std::string text_at(std::span<const std::byte> strings, std::uint32_t at)
{
    std::string text;
    for (; at < strings.size() && strings[at] != std::byte{0}; at++) {
        text += static_cast<char>(strings[at]);
    }
    return text;
}

std::string machine_name(std::uint32_t machine)
{
    switch (machine) {
    case EM_SPARC32PLUS: return "SPARC V8+, which needs a 64-bit processor";
    case EM_SPARCV9: return "64-bit SPARC";
    case EM_386: return "x86";
    case EM_X86_64: return "x86-64";
    case EM_ARM: return "ARM";
    case EM_AARCH64: return "AArch64";
    case EM_RISCV: return "RISC-V";
    default: return "machine " + std::to_string(machine);
    }
}

/// Of the headers of segments, or of sections.
struct ElfTable {
    std::uint32_t begin, size, count;

    std::uint64_t at(std::uint32_t i) const { return begin + std::uint64_t{i} * size; }
};

using EmptySections = std::vector<std::pair<std::uint32_t, std::uint32_t>>;

/// Sections without bytes: address, size.
EmptySections empty_sections(const FileReader &r, const ElfTable &sections)
{
    EmptySections empty;
    for (std::uint32_t i = 0; i < sections.count; i++) {
        const std::uint64_t at = sections.at(i);
        r.bytes(at, sizeof(Elf32_Shdr), "a section header");
        if (r.word(at + 4, "") == SHT_NOBITS && (r.word(at + 8, "") & (SHF_ALLOC | SHF_TLS)) == SHF_ALLOC) {
            empty.emplace_back(r.word(at + 12, ""), r.word(at + 20, ""));
        }
    }
    std::sort(empty.begin(), empty.end());
    return empty;
}

/// With the header at a place.
void read_segment(const FileReader &r, std::uint64_t at, const EmptySections &empty,
                  std::vector<Program::Segment> &segments)
{
    r.bytes(at, sizeof(Elf32_Phdr), "a program header");
    if (r.word(at, "") != PT_LOAD || r.word(at + 20, "") == 0) {
        return;
    }
    Program::Segment s;
    s.address = r.word(at + 12, "");
    s.memory_size = r.word(at + 20, "");
    const auto bytes = r.bytes(r.word(at + 4, ""), r.word(at + 16, ""), "a segment");
    s.bytes.assign(bytes.begin(), bytes.end());
    if (s.bytes.size() > s.memory_size) {
        r.fail("a segment has more bytes in the file than in memory");
    }
    if (std::uint64_t{s.address} + s.memory_size > std::uint64_t{1} << 32) {
        r.fail("a segment goes beyond the last address");
    }
    // Amid a segment the file has zeros for them, which a boot loader does not copy: RTEMS' .noinit.
    std::uint32_t from = r.word(at + 8, "");
    for (const auto &[address, size] : empty) {
        const std::uint32_t before = address - from;
        if (before < s.bytes.size() && size < s.bytes.size() - before) {
            const auto place = s.bytes.begin() + before;
            segments.push_back({s.address, before + size, {s.bytes.begin(), place}});
            s.bytes.erase(s.bytes.begin(), place + size);
            s.address += before + size;
            s.memory_size -= before + size;
            from += before + size;
        }
    }
    segments.push_back(std::move(s));
}

/// Of a section, if it has some.
void read_symbols(const FileReader &r, const ElfTable &sections, std::uint32_t section,
                  std::vector<Program::Symbol> &symbols)
{
    const std::uint64_t at = sections.at(section);
    r.bytes(at, sizeof(Elf32_Shdr), "a section header");
    if (r.word(at + 4, "") != SHT_SYMTAB) {
        return;
    }
    const std::uint32_t link = r.word(at + 24, "");
    const std::uint64_t strings_at = sections.at(link);
    if (link >= sections.count) {
        r.fail("its symbols have no names");
    }
    const auto strings = r.bytes(r.word(strings_at + 16, "a section header"),
                                 r.word(strings_at + 20, "a section header"), "the names of symbols");
    const std::uint32_t table = r.word(at + 16, ""), size = r.word(at + 20, "");
    r.bytes(table, size, "the symbols");
    for (std::uint64_t entry = table; entry + sizeof(Elf32_Sym) <= std::uint64_t{table} + size;
         entry += sizeof(Elf32_Sym)) {
        const std::uint32_t info = r.half(entry + 12, "") >> 8, type = ELF32_ST_TYPE(info);
        const bool plain = type == STT_NOTYPE && ELF32_ST_BIND(info) == STB_GLOBAL;
        Program::Symbol symbol{text_at(strings, r.word(entry, "")), r.word(entry + 4, ""), r.word(entry + 8, ""),
                               type == STT_FUNC};
        if ((symbol.function || type == STT_OBJECT || plain) && r.half(entry + 14, "") != SHN_UNDEF &&
            !symbol.name.empty()) {
            symbols.push_back(std::move(symbol));
        }
    }
}

} // namespace

Program Program::read(const std::string &path)
{
    std::ifstream file(path, std::ios::binary);
    const std::string text{std::istreambuf_iterator<char>(file), {}};
    if (!file.is_open() || file.bad()) {
        throw Error(path + ": cannot be read");
    }
    return {std::as_bytes(std::span(text)), path};
}

Program::Program(std::span<const std::byte> file, std::string path) : path_(std::move(path))
{
    const std::string_view text(reinterpret_cast<const char *>(file.data()), file.size());
    if (text.starts_with("\177ELF")) {
        read_elf(file);
    } else if (path_.ends_with(".bin") && !file.empty()) {
        segments_.push_back({0, static_cast<std::uint32_t>(file.size()), {file.begin(), file.end()}});
    } else if (text.size() > 1 && text[0] == 'S' && text[1] >= '0' && text[1] <= '9') {
        read_records(text);
    } else {
        throw Error(path_ + ": is not an ELF file, nor has it S-records; the bytes of a PROM from address 0 have the "
                            "name *.bin");
    }
}

/// S-records: of each line the type, then bytes: their number, an address, data, the complement of the sum.
void Program::read_records(std::string_view text)
{
    std::size_t line = 0;
    bool entered = false;
    for (std::size_t at = 0; at < text.size();) {
        const std::size_t end = std::min(text.find('\n', at), text.size());
        std::string_view record = text.substr(at, end - at);
        at = end + 1;
        line++;
        record = record.substr(0, record.find_last_not_of("\r ") + 1);
        if (record.empty()) {
            continue;
        }
        std::vector<std::byte> bytes;
        bool whole = record.size() % 2 == 0;
        for (std::size_t i = 2; i + 1 < record.size(); i += 2) {
            unsigned byte = 0;
            const char *const after = record.data() + i + 2;
            whole = whole && std::from_chars(record.data() + i, after, byte, 16).ptr == after;
            bytes.push_back(static_cast<std::byte>(byte));
        }
        unsigned sum = 0;
        for (const std::byte b : bytes) {
            sum += std::to_integer<unsigned>(b);
        }
        static constexpr std::size_t widths[] = {2, 2, 3, 4, 0, 2, 3, 4, 3, 2}; // of the address, by type
        const unsigned type = record.size() > 1 ? static_cast<unsigned>(record[1] - '0') : 10;
        const std::size_t width = record[0] == 'S' && type < 10 ? widths[type] : 0;
        if (width == 0 || !whole || bytes.size() < width + 2 ||
            std::to_integer<std::size_t>(bytes[0]) != bytes.size() - 1 || (sum & 255) != 255) {
            throw Error(path_ + ":" + std::to_string(line) + ": is no S-record, or a damaged one");
        }
        std::uint32_t address = 0;
        for (std::size_t i = 1; i <= width; i++) {
            address = address << 8 | std::to_integer<std::uint32_t>(bytes[i]);
        }
        if (type >= 7) {
            entry_ = address;
            entered = true;
        } else if (type >= 1 && type <= 3) {
            const auto data = std::span(bytes).subspan(width + 1, bytes.size() - width - 2);
            if (segments_.empty() || segments_.back().address + segments_.back().memory_size != address) {
                segments_.push_back({address, 0, {}});
            }
            Segment &s = segments_.back();
            s.bytes.insert(s.bytes.end(), data.begin(), data.end());
            s.memory_size = static_cast<std::uint32_t>(s.bytes.size());
        }
    }
    if (segments_.empty()) {
        throw Error(path_ + ": has nothing to load");
    }
    entry_ = entered ? entry_ : segments_.front().address;
}

void Program::read_elf(std::span<const std::byte> file)
{
    const FileReader r(file, path_);
    const auto ident = r.bytes(0, EI_NIDENT, "the head");
    const std::uint32_t machine = std::to_integer<int>(ident[EI_DATA]) == ELFDATA2LSB
                                      ? __builtin_bswap32(r.half(18, "the head")) >> 16
                                      : r.half(18, "the head");
    if (std::to_integer<int>(ident[EI_CLASS]) != ELFCLASS32 || std::to_integer<int>(ident[EI_DATA]) != ELFDATA2MSB ||
        machine != EM_SPARC) {
        r.fail("is for " + machine_name(machine) + "; needed is a program for 32-bit SPARC (V8), big-endian");
    }
    if (r.half(16, "the head") != ET_EXEC) {
        r.fail("is not a linked program with fixed addresses (ET_EXEC)");
    }
    entry_ = r.word(24, "the head");
    const ElfTable segments{r.word(28, "the head"), r.half(42, "the head"), r.half(44, "the head")};
    const ElfTable sections{r.word(32, "the head"), r.half(46, "the head"), r.half(48, "the head")};
    const auto empty = empty_sections(r, sections);
    for (std::uint32_t i = 0; i < segments.count; i++) {
        read_segment(r, segments.at(i), empty, segments_);
    }
    if (segments_.empty()) {
        r.fail("has nothing to load");
    }
    for (std::uint32_t i = 0; i < sections.count; i++) {
        read_symbols(r, sections, i, symbols_);
    }
    std::stable_sort(symbols_.begin(), symbols_.end(), [](const Symbol &a, const Symbol &b) {
        return a.address != b.address ? a.address < b.address : a.size < b.size;
    });
}

const Program::Symbol *Program::at(std::uint32_t address) const
{
    auto after = std::upper_bound(symbols_.begin(), symbols_.end(), address,
                                  [](std::uint32_t a, const Symbol &s) { return a < s.address; });
    if (after == symbols_.begin()) {
        return nullptr;
    }
    const Symbol &last = *--after;
    // Labels of assembler code have no size: they reach to the next symbol, within what is loaded.
    const bool loaded =
        std::ranges::any_of(segments_, [&](const Segment &s) { return address - s.address < s.memory_size; });
    return address - last.address < last.size || (last.size == 0 && loaded) ? &last : nullptr;
}

const Program::Symbol *Program::named(std::string_view name) const
{
    const auto found = std::find_if(symbols_.begin(), symbols_.end(), [&](const Symbol &s) { return s.name == name; });
    return found == symbols_.end() ? nullptr : &*found;
}

std::string Program::place(std::uint32_t address) const
{
    const Symbol *symbol = at(address);
    if (!symbol) {
        return "";
    }
    char offset[16];
    std::snprintf(offset, sizeof offset, "+0x%x", address - symbol->address);
    return symbol->name + (address == symbol->address ? "" : offset);
}

} // namespace fledge::emulator
