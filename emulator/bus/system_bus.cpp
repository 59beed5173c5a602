// SPDX-License-Identifier: Apache-2.0
#include "emulator/bus/system_bus.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <new>
#include <sys/mman.h>

namespace fledge::emulator {

namespace {

std::uint64_t load(const std::byte *bytes, unsigned size)
{
    std::uint64_t value = 0;
    for (unsigned i = 0; i < size; i++) {
        value = value << 8 | std::to_integer<std::uint64_t>(bytes[i]);
    }
    return value;
}

void store(std::byte *bytes, unsigned size, std::uint64_t value)
{
    for (unsigned i = size; i-- > 0; value >>= 8) {
        bytes[i] = static_cast<std::byte>(value);
    }
}

std::uint32_t word_of(std::uint32_t address)
{
    return address & ~3u;
}

} // namespace

void UnmapBytes::operator()(std::byte *bytes) const
{
    munmap(bytes, size);
}

void SystemBus::add_memory(std::uint32_t base, std::uint32_t size, bool writable, bool edac)
{
    // Pages that are never written cost nothing, so a machine is made in microseconds.
    const auto zeros = [](std::size_t n) {
        void *p = mmap(nullptr, n, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
        if (p == MAP_FAILED) {
            throw std::bad_alloc();
        }
        return std::unique_ptr<std::byte, UnmapBytes>(static_cast<std::byte *>(p), UnmapBytes{n});
    };
    Region r;
    r.bytes = zeros(size);
    r.code = zeros(size / 4);
    r.flags.resize(size / page_size, page_unchanged);
    r.memory = {
        base, size, r.bytes.get(), r.flags.data(), reinterpret_cast<std::uint8_t *>(r.code.get()), &read_flag_changes_};
    r.writable = writable;
    r.edac = edac;
    r.first_page = pages_;
    pages_ += size / page_size;
    edac_on_ = edac_on_ || edac;
    regions_.push_back(std::move(r));
}

void SystemBus::add_device(std::uint32_t base, std::uint32_t size, Device &device, std::uint32_t wait)
{
    slaves_.push_back({base, size, &device, wait});
}

SystemBus::Region *SystemBus::region(std::uint32_t address)
{
    for (Region &r : regions_) {
        if (address - r.memory.base < r.memory.size) {
            return &r;
        }
    }
    return nullptr;
}

const SystemBus::Slave *SystemBus::slave(std::uint32_t address) const
{
    for (const Slave &s : slaves_) {
        if (address - s.base < s.size) {
            return &s;
        }
    }
    return nullptr;
}

Access SystemBus::answer_hole(std::uint32_t address, unsigned size, bool write)
{
    if (std::ranges::any_of(bridges_, [&](const Slave &b) { return address - b.base < b.size; })) {
        return Access::done;
    }
    return refuse(address, size, write);
}

Access SystemBus::refuse(std::uint32_t address, unsigned size, bool write)
{
    if (error) {
        error({address, size, write, false});
    }
    return Access::fault;
}

// ---- accesses of the processor

Access SystemBus::read(std::uint32_t address, unsigned size, std::uint64_t &value)
{
    const Region *r = region(address);
    if (!r) {
        const Slave *s = slave(address);
        value = 0;
        return s ? read_device(*s, address, size, value) : answer_hole(address, size, false);
    }
    const std::uint32_t offset = address - r->memory.base;
    const std::uint8_t flags = r->flags[offset / page_size];
    value = load(r->memory.bytes + offset, size);
    if ((flags & page_faulty) && !read_faulty(address, size, value)) {
        return Access::fault;
    }
    return (flags & page_watch_read) && watched(address, size, false) ? Access::watched : Access::done;
}

Access SystemBus::write(std::uint32_t address, unsigned size, std::uint64_t value)
{
    Region *r = region(address);
    if (!r) {
        const Slave *s = slave(address);
        if (!s) {
            return answer_hole(address, size, true);
        }
        write_device(*s, address, size, value);
        return Access::done;
    }
    const std::uint32_t offset = address - r->memory.base;
    const std::uint8_t flags = r->flags[offset / page_size];
    if (!r->writable || (flags & page_protected)) {
        return refuse(address, size, true);
    }
    if ((flags & page_faulty) && !write_faulty(address, size)) {
        return Access::fault;
    }
    store(r->memory.bytes + offset, size, value);
    note_write(*r, address, size);
    return (flags & page_watch_write) && watched(address, size, true) ? Access::watched : Access::done;
}

Access SystemBus::fetch(std::uint32_t address, std::uint32_t &word)
{
    const Region *r = region(address);
    if (!r) {
        // Instructions are not executed from devices.
        return refuse(address, 4, false);
    }
    const std::uint32_t offset = address - r->memory.base;
    // An engine may fetch once and execute often, so the first fetch corrects the memory itself.
    if ((r->flags[offset / page_size] & page_faulty) && !correct(address)) {
        return Access::fault;
    }
    word = static_cast<std::uint32_t>(load(r->memory.bytes + offset, 4));
    return Access::done;
}

void SystemBus::mark_code(std::uint32_t address)
{
    if (Region *r = region(address)) {
        r->flags[(address - r->memory.base) / page_size] |= page_code;
        r->memory.code[(address - r->memory.base) / 4] = 1;
    }
}

/// The time until a device answers.
void SystemBus::pass(const Slave &s) const
{
    if (s.wait != 0) {
        *cycles += s.wait;
    }
}

Access SystemBus::read_device(const Slave &s, std::uint32_t address, unsigned size, std::uint64_t &value)
{
    const std::uint32_t offset = address - s.base;
    pass(s);
    if (size == 8) {
        value = std::uint64_t{s.device->read(offset)} << 32;
        value |= s.device->read(offset + 4);
    } else {
        const std::uint32_t word = s.device->read(word_of(offset));
        value = word >> (8 * (4 - size - offset % 4)) & (size == 4 ? ~0u : (1u << 8 * size) - 1);
    }
    return Access::done;
}

void SystemBus::write_device(const Slave &s, std::uint32_t address, unsigned size, std::uint64_t value)
{
    const std::uint32_t offset = address - s.base;
    auto word = static_cast<std::uint32_t>(value);
    pass(s);
    if (size == 8) {
        s.device->write(offset, static_cast<std::uint32_t>(value >> 32));
        s.device->write(offset + 4, word);
    } else if (size == 4) {
        s.device->write(offset, word);
    } else {
        const std::uint32_t mask = (1u << 8 * size) - 1;
        const std::uint32_t lane = 8 * (4 - size - offset % 4);
        if (s.device->is_memory()) {
            word = (s.device->read(word_of(offset)) & ~(mask << lane)) | (word & mask) << lane;
        } else {
            word = (word & mask) * (size == 1 ? 0x01010101u : 0x00010001u);
        }
        s.device->write(word_of(offset), word);
    }
}

// ---- bytes, pages, code

std::span<std::byte> SystemBus::memory(std::uint32_t address, std::size_t size) const
{
    for (const Region &r : regions_) {
        const std::uint32_t offset = address - r.memory.base;
        if (offset < r.memory.size && size <= r.memory.size - offset) {
            return {r.memory.bytes + offset, size};
        }
    }
    return {};
}

void SystemBus::note_write(Region &r, std::uint32_t address, unsigned size)
{
    const std::uint32_t page = (address - r.memory.base) / page_size;
    if (r.flags[page] & page_unchanged) {
        r.flags[page] = static_cast<std::uint8_t>(r.flags[page] & ~page_unchanged);
        changed_.push_back(r.first_page + page);
    }
    if (r.flags[page] & page_code) {
        const std::span words(r.memory.code + (address - r.memory.base) / 4, (address % 4 + size + 3) / 4);
        if (std::ranges::find(words, 1) != words.end()) {
            std::ranges::fill(words, std::uint8_t{0});
            if (code_changed) {
                code_changed(address, size);
            }
        }
    }
}

/// Whether a debugger may read the word of a device.
bool SystemBus::shows(const Slave &s, std::uint32_t address)
{
    const auto registers = s.device->registers();
    return s.device->is_memory() || std::ranges::any_of(registers, [&](const DeviceRegister &r) {
               return r.offset == word_of(address - s.base);
           });
}

bool SystemBus::peek(std::uint32_t address, std::span<std::byte> bytes) const
{
    if (const auto from = memory(address, bytes.size()); !from.empty()) {
        std::memcpy(bytes.data(), from.data(), bytes.size());
        return true;
    }
    for (std::byte &byte : bytes) {
        const Slave *s = slave(address);
        if (!s || !shows(*s, address)) {
            return false;
        }
        const std::uint32_t offset = address++ - s->base;
        byte = static_cast<std::byte>(s->device->read(word_of(offset)) >> (8 * (3 - offset % 4)));
    }
    return true;
}

bool SystemBus::poke(std::uint32_t address, std::span<const std::byte> bytes)
{
    const std::span<std::byte> to = memory(address, bytes.size());
    if (const Slave *s = slave(address); s && shows(*s, address) && bytes.size() == 4 && address % 4 == 0) {
        s->device->write(address - s->base, static_cast<std::uint32_t>(load(bytes.data(), 4)));
        return true;
    }
    if (bytes.empty() || to.empty()) {
        return bytes.empty();
    }
    std::memcpy(to.data(), bytes.data(), bytes.size());
    const std::uint64_t end = std::uint64_t{address} + bytes.size();
    Region &r = *region(address);
    for (std::uint64_t at = address; at < end;) {
        const std::uint64_t next = std::min<std::uint64_t>(end, (at / page_size + 1) * page_size);
        note_write(r, static_cast<std::uint32_t>(at), static_cast<unsigned>(next - at));
        at = next;
    }
    for (auto f = flips_.lower_bound(word_of(address)); f != flips_.end() && f->first < end;) {
        const std::uint32_t word = f->first;
        f = flips_.erase(f);
        set_faulty(word);
    }
    return true;
}

const SystemBus::Region *SystemBus::region_of_page(std::uint32_t index) const
{
    const auto last =
        std::find_if(regions_.rbegin(), regions_.rend(), [&](const Region &r) { return r.first_page <= index; });
    return &*last;
}

std::span<std::byte> SystemBus::page(std::uint32_t index) const
{
    const Region *r = region_of_page(index);
    return {r->memory.bytes + std::size_t{index - r->first_page} * page_size, page_size};
}

std::uint32_t SystemBus::page_address(std::uint32_t index) const
{
    const Region *r = region_of_page(index);
    return r->memory.base + (index - r->first_page) * page_size;
}

void SystemBus::page_changed(std::uint32_t index)
{
    const std::uint32_t address = page_address(index);
    note_write(*region(address), address, page_size);
}

void SystemBus::all_unchanged()
{
    for (const std::uint32_t index : changed_) {
        Region &r = *region(page_address(index));
        r.flags[index - r.first_page] |= page_unchanged;
    }
    changed_.clear();
}

void SystemBus::forget_code()
{
    for (Region &r : regions_) {
        for (std::size_t page = 0; page < r.flags.size(); page++) {
            if (r.flags[page] & page_code) {
                r.flags[page] = static_cast<std::uint8_t>(r.flags[page] & ~page_code);
                std::fill_n(r.memory.code + page * (page_size / 4), page_size / 4, std::uint8_t{0});
            }
        }
    }
}

// ---- protection and watchpoints

void SystemBus::mark_pages(std::uint8_t flag, const std::vector<ProtectedRange> &ranges)
{
    read_flag_changes_++;
    for (Region &r : regions_) {
        for (std::uint32_t page = 0; page < r.flags.size(); page++) {
            const std::uint64_t from = std::uint64_t{r.memory.base} + std::uint64_t{page} * page_size;
            const bool marked = std::any_of(ranges.begin(), ranges.end(), [&](const ProtectedRange &p) {
                return p.from < from + page_size && from < p.to;
            });
            r.flags[page] = static_cast<std::uint8_t>((r.flags[page] & ~flag) | (marked ? flag : 0));
        }
    }
}

void SystemBus::protect(std::vector<ProtectedRange> ranges)
{
    if (ranges != protected_) {
        protected_ = std::move(ranges);
        mark_pages(page_protected, protected_);
    }
}

void SystemBus::watch(std::uint32_t address, std::uint32_t size, bool on_read, bool on_write, bool on)
{
    const Watch entry{address, size, on_read, on_write};
    if (on) {
        watches_.push_back(entry);
    } else if (const auto at = std::find(watches_.begin(), watches_.end(), entry); at != watches_.end()) {
        watches_.erase(at);
    }
    std::vector<ProtectedRange> read, written;
    for (const Watch &w : watches_) {
        if (w.on_read) {
            read.push_back({w.address, w.address + w.size});
        }
        if (w.on_write) {
            written.push_back({w.address, w.address + w.size});
        }
    }
    mark_pages(page_watch_read, read);
    mark_pages(page_watch_write, written);
}

bool SystemBus::watched(std::uint32_t address, unsigned size, bool write)
{
    return std::any_of(watches_.begin(), watches_.end(), [&](const Watch &w) {
        const bool hit = (write ? w.on_write : w.on_read) && w.address < address + size && address < w.address + w.size;
        watched_at_ = hit ? std::max(address, w.address) : watched_at_;
        return hit;
    });
}

// ---- EDAC

void SystemBus::set_faulty(std::uint32_t address)
{
    const std::uint32_t page = address / page_size * page_size;
    const auto first = flips_.lower_bound(page);
    Region &r = regions_.front();
    std::uint8_t &flags = r.flags[(page - r.memory.base) / page_size];
    const bool faulty = flip_next_ != 0 || (first != flips_.end() && first->first - page < page_size);
    flags = static_cast<std::uint8_t>((flags & ~page_faulty) | (faulty ? page_faulty : 0));
    read_flag_changes_++;
}

void SystemBus::flip(std::uint32_t address, EdacFlips flips)
{
    address = word_of(address);
    Region &r = regions_.front();
    if (address - r.memory.base >= r.memory.size) {
        return;
    }
    std::byte *bytes = r.memory.bytes + (address - r.memory.base);
    store(bytes, 4, load(bytes, 4) ^ flips.data);
    if (r.edac) {
        EdacFlips &present = flips_[address];
        present.data ^= flips.data;
        present.check ^= flips.check & 0x7Fu;
        if (present.none()) {
            flips_.erase(address);
        }
        set_faulty(address);
    }
    note_write(r, address, 4);
}

void SystemBus::flip_next_read(std::uint32_t bits)
{
    flip_next_ = bits;
    fail_next_ = false;
    const Memory &ram = regions_.front().memory;
    for (std::uint32_t offset = 0; offset < ram.size; offset += page_size) {
        set_faulty(ram.base + offset);
    }
}

void SystemBus::fail_next_read()
{
    flip_next_read(1);
    fail_next_ = true;
}

void SystemBus::set_flips(std::map<std::uint32_t, EdacFlips> flips)
{
    if (flip_next_ != 0) {
        flip_next_read(0);
    }
    flips_.swap(flips);
    for (const auto &[word, _] : flips) {
        set_faulty(word);
    }
    for (const auto &[word, _] : flips_) {
        set_faulty(word);
    }
}

/// Decode a word of RAM, and report what was found.
EdacResult SystemBus::check(std::uint32_t word, std::uint32_t &correction, bool write)
{
    correction = 0;
    const auto found = flips_.find(word);
    if (found == flips_.end() || !edac_on_) {
        return EdacResult::clean;
    }
    const EdacResult result = edac_decode(found->second, correction);
    if (result != EdacResult::clean && error) {
        error({word, 4, write, result == EdacResult::corrected});
    }
    return result;
}

/// Write the corrected word back. False: it cannot be corrected.
bool SystemBus::correct(std::uint32_t word)
{
    std::uint32_t correction;
    const EdacResult result = check(word, correction, false);
    if (result == EdacResult::corrected) {
        std::byte *bytes = memory(word, 4).data();
        store(bytes, 4, load(bytes, 4) ^ correction);
        flips_.erase(word);
        set_faulty(word);
        note_write(regions_.front(), word, 4);
    }
    return result != EdacResult::uncorrectable;
}

EdacResult SystemBus::scrub(std::uint32_t address)
{
    std::uint32_t correction = 0;
    const auto found = flips_.find(word_of(address));
    if (found == flips_.end() || !edac_on_) {
        return EdacResult::clean;
    }
    const EdacResult result = edac_decode(found->second, correction);
    correct(word_of(address));
    return result;
}

bool SystemBus::read_faulty(std::uint32_t address, unsigned size, std::uint64_t &value)
{
    std::uint64_t corrections = 0;
    for (std::uint32_t word = word_of(address); word < address + size; word += 4) {
        std::uint32_t correction;
        if (check(word, correction, false) == EdacResult::uncorrectable) {
            return false;
        }
        corrections = corrections << 32 | correction;
    }
    if (flip_next_ != 0) {
        corrections ^= size == 8 ? std::uint64_t{flip_next_} << 32 : flip_next_;
        const bool fails = fail_next_;
        flip_next_read(0);
        if (fails) {
            (void)refuse(address, size, false);
            return false;
        }
    }
    value ^= size >= 4 ? corrections : corrections >> (8 * (4 - size - address % 4)) & ((1u << 8 * size) - 1);
    return true;
}

bool SystemBus::write_faulty(std::uint32_t address, unsigned size)
{
    if (size < 4) {
        // The controller reads the word, corrects it, and writes all of it.
        return correct(word_of(address));
    }
    for (std::uint32_t word = address; word < address + size; word += 4) {
        flips_.erase(word);
        set_faulty(word);
    }
    return true;
}

} // namespace fledge::emulator
