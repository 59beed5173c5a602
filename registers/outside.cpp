// SPDX-License-Identifier: Apache-2.0
#include "registers/outside.h"

#include <algorithm>
#include <cstring>

namespace fledge::registers {

namespace {

std::string listed(const std::vector<std::string> &names)
{
    std::string text;
    for (const std::string &name : names) {
        text += (text.empty() ? "" : ", ") + name;
    }
    return text.empty() ? "there are none" : text;
}

} // namespace

LaneEnd::LaneEnd(const RegisterWindow &window, const RegisterLane &lane)
    : window_(&window), lane_(&lane), scratch_(lane.outside.add + std::size_t{lane.capacity})
{
}

std::size_t LaneEnd::field(std::string_view name) const
{
    std::vector<std::string> names;
    for (std::size_t i = 0; i < lane_->n_fields; i++) {
        if (lane_->fields[i].name == name) {
            return i;
        }
        names.push_back(lane_->fields[i].name);
    }
    throw Error("lane " + std::string(lane_->name) + " has no field `" + std::string(name) +
                "`; choose of: " + listed(names));
}

RegisterStatus LaneEnd::count(RegisterStatus status)
{
    counts_.passed += status == REGISTER_OK;
    counts_.refused += status == REGISTER_FULL || status == REGISTER_SIZE;
    counts_.corrupt += status == REGISTER_CORRUPT;
    return status;
}

void LaneEnd::swap_units(std::byte *bytes, std::size_t n) const
{
    const std::size_t unit = lane_->outside.unit;
    for (std::size_t i = 0; lane_->outside.swap && i + unit <= n; i += unit) {
        std::reverse(bytes + i, bytes + i + unit);
    }
}

RegisterStatus LaneWriter::put(std::span<const std::byte> packet, std::uint32_t tag)
{
    const RegisterOutside &outside = lane_->outside;
    if (packet.size() < outside.remove || packet.size() - outside.remove + outside.add > lane_->capacity) {
        return count(REGISTER_SIZE);
    }
    const std::size_t n = packet.size() - outside.remove;
    std::byte *payload = scratch_.data() + outside.add;
    std::copy_n(reinterpret_cast<const std::byte *>(outside.head), outside.add, scratch_.data());
    std::copy_n(packet.data() + outside.remove, n, payload);
    swap_units(payload, n);
    return count(register_put(window_, lane_, scratch_.data(), static_cast<std::uint32_t>(outside.add + n), tag));
}

RegisterStatus LaneWriter::put_word(std::uint32_t value, std::uint32_t index)
{
    return count(register_put_word(window_, lane_, index, value));
}

RegisterStatus LaneWriter::put_message(const RegisterMessage &type, const void *message)
{
    return count(register_put_message(window_, lane_, &type, message));
}

RegisterStatus LaneWriter::set(std::size_t field, double value, std::uint32_t index)
{
    if (field >= lane_->n_fields || (lane_->flags & REGISTER_QUEUED)) {
        return count(REGISTER_SIZE);
    }
    std::uint32_t word = 0;
    int saturated = 0;
    const RegisterField &f = lane_->fields[field];
    const std::int64_t n = register_field_quantise(&f, value, &saturated);
    register_take_word(window_, lane_, index, &word);
    counts_.saturated += saturated != 0;
    return put_word(register_field_place(&f, word, n), index);
}

RegisterStatus LaneReader::take(std::span<const std::byte> &packet, RegisterInfo &info)
{
    const RegisterOutside &outside = lane_->outside;
    std::byte *payload = scratch_.data() + outside.add;
    packet = {};
    const RegisterStatus status = count(register_take(window_, lane_, payload, lane_->capacity, &info));
    if (status != REGISTER_OK && status != REGISTER_SAME) {
        return status;
    }
    if (info.n < outside.remove) {
        counts_.passed -= status == REGISTER_OK;
        return count(REGISTER_CORRUPT);
    }
    const std::size_t n = info.n - outside.remove;
    std::memmove(payload, payload + outside.remove, n);
    swap_units(payload, n);
    std::copy_n(reinterpret_cast<const std::byte *>(outside.head), outside.add, scratch_.data());
    packet = {scratch_.data(), outside.add + n};
    return status;
}

RegisterStatus LaneReader::take_word(std::uint32_t &value, std::uint32_t index)
{
    return count(register_take_word(window_, lane_, index, &value));
}

RegisterStatus LaneReader::take_message(const RegisterMessage &type, void *message, RegisterInfo &info)
{
    return count(register_take_message(window_, lane_, &type, message, &info));
}

double LaneReader::get(std::size_t field, std::uint32_t index) const
{
    std::uint32_t word = 0;
    register_take_word(window_, lane_, index, &word);
    const RegisterField &f = lane_->fields[field];
    return register_field_value(&f, register_field_count(&f, word));
}

namespace {

constexpr std::int64_t second = 1'000'000'000;

/// The largest integer up to s * rate, of a time s >= 0 [ns] and a rate [ns/s].
std::int64_t scaled(std::int64_t s, std::int64_t rate)
{
    const std::int64_t part = s % second * rate; // at most 1e9 times 2e9
    return s / second * rate + part / second - (part % second < 0);
}

/// a + b of any two times; beyond the range it wraps, as a counter does.
std::int64_t sum(std::int64_t a, std::int64_t b)
{
    return static_cast<std::int64_t>(static_cast<std::uint64_t>(a) + static_cast<std::uint64_t>(b));
}

} // namespace

void SlaveClock::start()
{
    since_ = offset_ = aligned_ = 0;
    base_ = slave_->start;
    shown_ = -1;
    aligning_ = false;
    store(REGISTER_SLAVE_TIME, base_);
    store(REGISTER_SLAVE_TONE, base_);
    register_store(window_, slave_->address + REGISTER_SLAVE_PULSES, 0u);
    register_store(window_, slave_->address + REGISTER_SLAVE_DONE,
                   register_load(window_, slave_->address + REGISTER_SLAVE_COMMAND));
    store_status(0, false);
}

std::int64_t SlaveClock::at(std::int64_t t) const
{
    const std::int64_t s = t - since_, slewed = scaled(s, slave_->slew);
    const std::int64_t gained = std::clamp(offset_, -slewed, slewed);
    return sum(sum(base_, s + scaled(s, slave_->drift)), gained);
}

void SlaveClock::show(std::int64_t t)
{
    // The pulses at the multiples of `pulse` in (shown_, t].
    const std::int64_t first = shown_ < 0 ? 0 : shown_ / slave_->pulse + 1, last = t / slave_->pulse;
    if (first <= last) {
        if (aligning_) {
            since_ = first * slave_->pulse;
            base_ = aligned_;
            offset_ = 0;
            aligning_ = false;
        }
        store(REGISTER_SLAVE_TONE, at(last * slave_->pulse));
        register_store(window_, slave_->address + REGISTER_SLAVE_PULSES, static_cast<std::uint32_t>(last + 1));
        for (std::int64_t k = first; k <= last && slave_->interrupt >= 0; k++) {
            register_raise(window_, static_cast<std::uint32_t>(slave_->interrupt));
        }
    }
    shown_ = t;
    store(REGISTER_SLAVE_TIME, at(t));
    store_status(t, register_slave_status(window_) & REGISTER_REFUSED);
}

void SlaveClock::obey(std::int64_t t)
{
    const std::uint32_t address = slave_->address;
    const std::uint32_t given = register_load(window_, address + REGISTER_SLAVE_COMMAND);
    if (given == register_load(window_, address + REGISTER_SLAVE_DONE)) {
        return;
    }
    const std::uint64_t high = register_load(window_, address + REGISTER_SLAVE_VALUE);
    const auto value =
        static_cast<std::int64_t>(high << 32 | register_load(window_, address + REGISTER_SLAVE_VALUE + 4));
    const std::uint32_t code = register_load(window_, address + REGISTER_SLAVE_CODE);
    if (code == REGISTER_JAM || code == REGISTER_SLEW) {
        base_ = code == REGISTER_JAM ? value : at(t);
        offset_ = code == REGISTER_JAM ? 0 : value;
        since_ = t;
        aligning_ = false;
    } else if (code == REGISTER_ALIGN) {
        aligned_ = value;
        aligning_ = true;
    }
    store_status(t, code < REGISTER_JAM || code > REGISTER_ALIGN);
    register_store(window_, address + REGISTER_SLAVE_DONE, given);
}

void SlaveClock::store(std::uint32_t place, std::int64_t value) const
{
    const auto bits = static_cast<std::uint64_t>(value);
    register_store(window_, slave_->address + place, static_cast<std::uint32_t>(bits >> 32));
    register_store(window_, slave_->address + place + 4, static_cast<std::uint32_t>(bits));
}

void SlaveClock::store_status(std::int64_t t, bool refused)
{
    const std::int64_t slewed = scaled(t - since_, slave_->slew);
    const bool slewing = std::clamp(offset_, -slewed, slewed) != offset_;
    const std::uint32_t status = std::uint32_t{REGISTER_SLEWING} * slewing |
                                 std::uint32_t{REGISTER_ALIGNING} * aligning_ |
                                 std::uint32_t{REGISTER_REFUSED} * refused;
    register_store(window_, slave_->address + REGISTER_SLAVE_STATUS, status);
}

Outside::Outside(Backend &backend) : backend_(backend)
{
    for (const RegisterWindow &w : backend_.windows()) {
        if (w.board->slave) {
            slaves_.emplace_back(w);
        }
        if (w.board->clock != REGISTER_NOWHERE) {
            if (master_) {
                throw Error("the boards " + std::string(master_->board->name) + " and " + w.board->name +
                            " have a clock, which paces flight; give one of them a [slave_clock] instead");
            }
            master_ = &w;
        }
    }
    if (!master_) {
        throw Error("no board has a clock; give one of them a [clock]");
    }
}

const RegisterWindow &Outside::window(std::string_view board) const
{
    std::vector<std::string> names;
    for (const RegisterWindow &w : backend_.windows()) {
        if (w.board->name == board) {
            return w;
        }
        names.push_back(w.board->name);
    }
    throw Error("there is no board `" + std::string(board) + "`; choose of: " + listed(names));
}

const RegisterLane &Outside::lane(std::string_view board, std::string_view name, bool from_flight) const
{
    const RegisterBoard &b = *window(board).board;
    std::vector<std::string> names;
    for (std::uint32_t i = 0; i < b.n_lanes; i++) {
        if (((b.lanes[i].flags & REGISTER_FROM_FLIGHT) != 0) == from_flight) {
            if (b.lanes[i].name == name) {
                return b.lanes[i];
            }
            names.push_back(b.lanes[i].name);
        }
    }
    throw Error("board " + std::string(board) + " has no lane `" + std::string(name) + "` that " + "flight " +
                (from_flight ? "writes" : "reads") + "; choose of: " + listed(names));
}

LaneWriter Outside::writer(std::string_view board, std::string_view name) const
{
    return {window(board), lane(board, name, false)};
}

LaneReader Outside::reader(std::string_view board, std::string_view name) const
{
    return {window(board), lane(board, name, true)};
}

Wait Outside::tick(Tick tick, std::chrono::nanoseconds timeout)
{
    for (SlaveClock &slave : slaves_) {
        if (tick.t < 0) {
            slave.start();
        } else {
            slave.show(tick.t);
        }
    }
    register_clock_start(master_, tick);
    const Wait wait = backend_.await_done(*master_, timeout);
    for (SlaveClock &slave : slaves_) {
        if (wait == Wait::done) {
            slave.obey(std::max<std::int64_t>(tick.t, 0));
        }
    }
    return wait;
}

void Outside::stop()
{
    register_clock_stop(master_);
}

} // namespace fledge::registers
