// SPDX-License-Identifier: Apache-2.0
#include "registers/outside.h"

#include "flight/exec/task.h"

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

Outside::Outside(Backend &backend) : backend_(backend)
{
    for (const RegisterWindow &w : backend_.windows()) {
        if (w.board->slave) {
            slaves_.push_back({&w, {}, 0, 0, 0});
            register_slave_start(&slaves_.back());
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

bool Outside::is_down(std::int64_t t, std::uint32_t resets, std::int64_t down)
{
    if (down_.until < 0 && resets != down_.resets) {
        down_.until = exec_later(t, down);
    }
    if (down_.until < 0 || t < down_.until) {
        return down_.until >= 0;
    }
    down_.until = -1;
    down_.resets = resets;
    register_clock_reset(master_);
    return false;
}

Wait Outside::tick(Tick tick, std::chrono::nanoseconds timeout)
{
    if (tick.t < 0) {
        down_.resets = 0;
        down_.until = -1;
    }
    for (RegisterSlaveClock &slave : slaves_) {
        if (tick.t < 0) {
            register_slave_start(&slave);
        } else {
            register_slave_show(&slave, tick.t);
        }
    }
    register_clock_start(master_, tick);
    const Wait wait = backend_.await_done(*master_, timeout);
    for (RegisterSlaveClock &slave : slaves_) {
        if (wait == Wait::done) {
            register_slave_obey(&slave, std::max<std::int64_t>(tick.t, 0));
        }
    }
    return wait;
}

void Outside::stop()
{
    register_clock_stop(master_);
}

std::vector<std::byte> Outside::save() const
{
    std::vector<std::byte> saved(sizeof down_ + slaves_.size() * sizeof(RegisterSlaveClock));
    std::memcpy(saved.data(), &down_, sizeof down_);
    for (std::size_t i = 0; i < slaves_.size(); i++) {
        RegisterSlaveClock slave = slaves_[i];
        slave.window = nullptr;
        std::memcpy(saved.data() + sizeof down_ + i * sizeof slave, &slave, sizeof slave);
    }
    return saved;
}

void Outside::restore(std::span<const std::byte> saved)
{
    if (saved.size() != sizeof down_ + slaves_.size() * sizeof(RegisterSlaveClock)) {
        throw Error("the snapshot is of other boards");
    }
    std::memcpy(&down_, saved.data(), sizeof down_);
    for (std::size_t i = 0; i < slaves_.size(); i++) {
        const RegisterWindow *window = slaves_[i].window;
        std::memcpy(&slaves_[i], saved.data() + sizeof down_ + i * sizeof slaves_[i], sizeof slaves_[i]);
        slaves_[i].window = window;
    }
}

} // namespace fledge::registers
