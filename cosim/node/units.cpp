// SPDX-License-Identifier: Apache-2.0
#include "cosim/node/units.h"

#include "sim/error.h"

#include <cstring>

namespace fledge::cosim {

namespace {

constexpr std::size_t front = 12; // of the message, before its bytes

void put(Bytes &to, std::uint64_t value, int bytes)
{
    while (bytes--) {
        to.push_back(static_cast<std::byte>(value >> 8 * bytes));
    }
}

std::uint64_t get(std::span<const std::byte> from, std::size_t at, std::size_t bytes)
{
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < bytes; i++) {
        value = value << 8 | std::to_integer<std::uint64_t>(from[at + i]);
    }
    return value;
}

} // namespace

Schema units_schema(std::size_t room)
{
    const std::string n = std::to_string((room + 3) / 4 * 4);
    return make_schema("Units" + n, "int64 every  # every [ns] between the instants at which it may be written\n"
                                    "uint32 n  # n [byte] of the units\n"
                                    "uint8[" +
                                        n + "] bytes  # bytes [-] units with their times and lengths\n");
}

Bytes packed(std::span<const sim::Packet> units)
{
    Bytes bytes;
    for (const sim::Packet &unit : units) {
        put(bytes, static_cast<std::uint64_t>(unit.t), 8);
        put(bytes, unit.bytes.size(), 4);
        const auto all = std::as_bytes(std::span(unit.bytes));
        bytes.insert(bytes.end(), all.begin(), all.end());
    }
    return bytes;
}

std::vector<sim::Packet> unpacked(std::span<const std::byte> bytes)
{
    std::vector<sim::Packet> units;
    while (!bytes.empty()) {
        if (bytes.size() < unit_header || get(bytes, 8, 4) > bytes.size() - unit_header) {
            throw ProtocolError("units of a link are cut off");
        }
        const std::size_t n = get(bytes, 8, 4);
        sim::Packet &unit = units.emplace_back(sim::Packet{static_cast<Ns>(get(bytes, 0, 8)), {}});
        const auto *data = reinterpret_cast<const std::uint8_t *>(bytes.data() + unit_header);
        unit.bytes.assign(data, data + n);
        bytes = bytes.subspan(unit_header + n);
    }
    return units;
}

Publication UnitsOut::open(std::uint32_t channel, std::size_t room, Ns every)
{
    const Schema schema = units_schema(room);
    channel_ = channel;
    room_ = schema.size - front;
    every_ = every;
    count_ = 0;
    Bytes message(schema.size);
    std::memcpy(message.data(), &every_, sizeof every_);
    return {channel, schema, make_payload(message)};
}

void UnitsOut::write(Ns t, std::vector<sim::Packet> &units, std::vector<Record> &records)
{
    if (units.empty()) {
        return;
    }
    std::size_t n_units = 0, size = 0;
    for (; n_units < units.size() && size + unit_header + units[n_units].bytes.size() <= room_; n_units++) {
        size += unit_header + units[n_units].bytes.size();
    }
    if (n_units == 0) {
        throw sim::RunError("a unit by a radio has " + std::to_string(units[0].bytes.size()) +
                            " bytes; the message to other programs has room for " +
                            std::to_string(room_ - unit_header));
    }
    const Bytes bytes = packed(std::span(units).first(n_units));
    const auto n = static_cast<std::uint32_t>(bytes.size());
    Bytes message(front + room_);
    std::memcpy(message.data(), &every_, sizeof every_);
    std::memcpy(message.data() + sizeof every_, &n, sizeof n);
    std::copy(bytes.begin(), bytes.end(), message.begin() + front);
    records.push_back({*channel_, ++count_, t, make_payload(message)});
    units.erase(units.begin(), units.begin() + static_cast<std::ptrdiff_t>(n_units));
}

std::vector<sim::Packet> units_of(std::span<const std::byte> payload)
{
    if (payload.size() < cdr_header + front) {
        throw ProtocolError("a message of units is cut off");
    }
    const Schema schema = units_schema(payload.size() - cdr_header - front);
    Bytes message(schema.size);
    read_payload(payload, parse_schema(schema.text), message);
    std::uint32_t n;
    std::memcpy(&n, message.data() + sizeof(std::int64_t), sizeof n);
    if (n > message.size() - front) {
        throw ProtocolError("a message of units has " + std::to_string(message.size() - front) +
                            " bytes, and says that it has " + std::to_string(n));
    }
    return unpacked(std::span(message).subspan(front, n));
}

} // namespace fledge::cosim
