// SPDX-License-Identifier: Apache-2.0
#include "emulator/debug/coverage.h"

#include "emulator/error.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>

namespace fledge::emulator {

namespace {

/// Whether it is Bicc or FBfcc with a condition that may hold or not; `target` is where it goes.
bool is_conditional_branch(std::uint32_t pc, std::uint32_t word, std::uint32_t &target)
{
    const std::uint32_t op2 = word >> 22 & 7, condition = word >> 25 & 7;
    target = pc + static_cast<std::uint32_t>(static_cast<std::int32_t>(word << 10) >> 8);
    return word >> 30 == 0 && (op2 == 2 || op2 == 6) && condition != 0;
}

/// The instruction there in the program's file.
std::uint32_t word_at(const Program &program, std::uint32_t address)
{
    for (const Program::Segment &segment : program.segments()) {
        const std::uint32_t at = address - segment.address;
        if (at + 4 <= segment.bytes.size() && at + 4 > at) {
            std::uint32_t word = 0;
            for (std::uint32_t i = 0; i < 4; i++) {
                word = word << 8 | static_cast<std::uint32_t>(segment.bytes[at + i]);
            }
            return word;
        }
    }
    return 0;
}

} // namespace

void Coverage::executed(const Executed &step)
{
    if (step.trapped) {
        return;
    }
    Counts &counts = counts_[step.pc];
    counts.executed++;
    std::uint32_t target = 0;
    if (is_conditional_branch(step.pc, step.word, target)) {
        counts.taken += step.state.npc == target;
    }
}

void Coverage::write(const std::string &path, const Program &program, const SourceLines &lines) const
{
    struct Line {
        std::uint64_t count = 0;
        std::vector<Counts> branches;
    };
    struct File {
        std::map<std::uint32_t, Line> lines;
        std::map<std::uint32_t, std::pair<std::string, std::uint64_t>> functions; ///< by line
    };
    std::map<std::string, File> files;
    const auto count = [&](std::uint32_t address) {
        const auto found = counts_.find(address);
        return found == counts_.end() ? Counts{} : found->second;
    };
    for (const Program::Symbol &function : program.symbols()) {
        if (!function.function) {
            continue;
        }
        const auto *first = lines.find(function.address);
        if (first && std::filesystem::exists(lines.files()[first->file])) {
            files[lines.files()[first->file]].functions[first->line] = {function.name,
                                                                        count(function.address).executed};
        }
        for (std::uint32_t address = function.address; address < function.address + function.size; address += 4) {
            const auto *range = lines.find(address);
            if (!range || !std::filesystem::exists(lines.files()[range->file])) {
                continue;
            }
            Line &line = files[lines.files()[range->file]].lines[range->line];
            const Counts counts = count(address);
            line.count = std::max(line.count, counts.executed);
            std::uint32_t target = 0;
            if (is_conditional_branch(address, word_at(program, address), target)) {
                line.branches.push_back(counts);
            }
        }
    }
    for (const SourceLines::Beginning &beginning : lines.beginnings()) {
        const Program::Symbol *symbol = program.at(beginning.address);
        const auto file = files.find(lines.files()[beginning.file]);
        if (symbol && symbol->function && beginning.address - symbol->address < symbol->size && file != files.end()) {
            Line &line = file->second.lines[beginning.line];
            line.count = std::max(line.count, count(beginning.address).executed);
        }
    }
    std::ofstream out(path);
    for (const auto &[name, file] : files) {
        out << "TN:\nSF:" << name << '\n';
        for (auto at = file.functions.begin(); at != file.functions.end(); ++at) {
            const auto &[name_of, calls] = at->second;
            const auto next = std::next(at);
            const auto end = next == file.functions.end() ? file.lines.end() : file.lines.lower_bound(next->first);
            // A function that is inlined everywhere has run as often as the first of its lines that has.
            std::uint64_t n = calls;
            for (auto line = file.lines.lower_bound(at->first); n == 0 && line != end; ++line) {
                n = line->second.count;
            }
            out << "FN:" << at->first << ',' << name_of << "\nFNDA:" << n << ',' << name_of << '\n';
        }
        for (const auto &[number, line] : file.lines) {
            // Where a line ran without its branches, they are those of a copy that did not.
            if (line.count != 0 && std::ranges::none_of(line.branches, [](const Counts &c) { return c.executed; })) {
                continue;
            }
            for (std::size_t i = 0; i < line.branches.size(); i++) {
                const Counts &branch = line.branches[i];
                const std::uint64_t ways[] = {branch.taken, branch.executed - branch.taken};
                for (int way = 0; way < 2; way++) {
                    out << "BRDA:" << number << ',' << i << ',' << way << ',';
                    branch.executed ? out << ways[way] : out << '-';
                    out << '\n';
                }
            }
        }
        for (const auto &[number, line] : file.lines) {
            out << "DA:" << number << ',' << line.count << '\n';
        }
        out << "end_of_record\n";
    }
    out.close();
    if (!out) {
        throw Error("the coverage " + path + " cannot be written");
    }
}

} // namespace fledge::emulator
