// SPDX-License-Identifier: Apache-2.0
// Each message is described once, by a function `body` that names its members in order; a Writer and
// a Reader walk it.
#include "cosim/protocol/protocol.h"

#include "record/mcap_crc.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <limits>
#include <type_traits>

namespace fledge::cosim {

namespace {

constexpr char magic[4] = {'F', 'L', 'C', 'S'};

/// As mcap_crc_init() makes them, but at compile time: programs of one machine then share them in the cache.
constexpr McapCrc make_crc_tables()
{
    McapCrc c{};
    for (std::uint32_t b = 0; b < 256; b++) {
        std::uint32_t r = b;
        for (int bit = 0; bit < 8; bit++) {
            r = (r >> 1) ^ ((r & 1) ? 0xEDB88320u : 0u);
        }
        c.table[0][b] = r;
    }
    for (std::size_t k = 1; k < MCAP_CRC_TABLES; k++) {
        for (std::uint32_t b = 0; b < 256; b++) {
            c.table[k][b] = (c.table[k - 1][b] >> 8) ^ c.table[0][c.table[k - 1][b] & 0xFF];
        }
    }
    return c;
}

constexpr McapCrc crc_tables = make_crc_tables();

template <class T> T turned(T x)
{
    auto bytes = std::bit_cast<std::array<std::byte, sizeof(T)>>(x);
    std::reverse(bytes.begin(), bytes.end());
    return std::bit_cast<T>(bytes);
}

/// A text or payload, and which limit holds for it.
enum class Bound { name, text, payload };

class Writer {
public:
    Writer(Bytes &out, bool swap) : out_(out), swap_(swap) {}

    template <class T> void number(T x)
    {
        while ((out_.size() - frame_header_size) % sizeof x) {
            out_.push_back(std::byte{0});
        }
        x = swap_ ? turned(x) : x;
        out_.resize(out_.size() + sizeof x);
        std::memcpy(out_.data() + out_.size() - sizeof x, &x, sizeof x);
    }

    void operator()(std::uint8_t x) { number(x); }
    void operator()(std::uint32_t x) { number(x); }
    void operator()(std::uint64_t x) { number(x); }
    void operator()(Ns x) { number(x); }
    void operator()(bool x) { number(static_cast<std::uint8_t>(x)); }
    void operator()(Latency x) { number(static_cast<std::uint8_t>(x)); }
    void operator()(Role x) { number(static_cast<std::uint8_t>(x)); }
    void operator()(const std::string &s, Bound) { bytes(s.data(), s.size()); }
    void operator()(const Bytes &b, Bound) { bytes(b.data(), b.size()); }
    void operator()(const Payload &b, Bound) { bytes(b.data(), b.size()); }

    template <class T> void operator()(const std::vector<T> &list, std::size_t)
    {
        length(list.size());
        for (const T &item : list) {
            body(*this, item);
        }
    }

private:
    void length(std::size_t n)
    {
        if (n > std::numeric_limits<std::uint32_t>::max()) {
            throw ProtocolError("a list or text of " + std::to_string(n) + " is too long for a frame");
        }
        number(static_cast<std::uint32_t>(n));
    }

    void bytes(const void *from, std::size_t n)
    {
        length(n);
        if (n) {
            out_.resize(out_.size() + n);
            std::memcpy(out_.data() + out_.size() - n, from, n);
        }
    }

    Bytes &out_;
    bool swap_;
};

class Reader {
public:
    Reader(std::span<const std::byte> from, bool swap, const Limits &limits) : from_(from), limits_(limits), swap_(swap)
    {
    }

    template <class T> T number()
    {
        while (at_ % sizeof(T)) {
            if (take(1)[0] != std::byte{0}) {
                fail("a gap is not zero");
            }
        }
        T x;
        std::memcpy(&x, take(sizeof x).data(), sizeof x);
        return swap_ ? turned(x) : x;
    }

    void operator()(std::uint8_t &x) { x = number<std::uint8_t>(); }
    void operator()(std::uint32_t &x) { x = number<std::uint32_t>(); }
    void operator()(std::uint64_t &x) { x = number<std::uint64_t>(); }
    void operator()(Ns &x) { x = number<Ns>(); }

    void operator()(bool &x)
    {
        const auto byte = number<std::uint8_t>();
        if (byte > 1) {
            fail("expected 0 or 1, found " + std::to_string(byte));
        }
        x = byte;
    }

    void operator()(Latency &x)
    {
        const auto byte = number<std::uint8_t>();
        if (byte > static_cast<std::uint8_t>(Latency::next_exchange)) {
            fail("there is no latency " + std::to_string(byte));
        }
        x = static_cast<Latency>(byte);
    }

    void operator()(Role &x)
    {
        const auto byte = number<std::uint8_t>();
        if (byte > static_cast<std::uint8_t>(Role::asynchronous)) {
            fail("there is no role " + std::to_string(byte));
        }
        x = static_cast<Role>(byte);
    }

    void operator()(std::string &s, Bound bound)
    {
        const auto bytes = counted(bound);
        s.assign(reinterpret_cast<const char *>(bytes.data()), bytes.size());
        if (s.find('\0') != std::string::npos) {
            fail("a text holds a zero byte");
        }
    }

    void operator()(Bytes &b, Bound bound)
    {
        const auto bytes = counted(bound);
        b.assign(bytes.begin(), bytes.end());
    }

    void operator()(Payload &b, Bound bound) { b = Payload(counted(bound)); }

    /// `least`: the fewest bytes of an item, so that a list allocates no more memory than the frame has.
    template <class T> void operator()(std::vector<T> &list, std::size_t least)
    {
        const auto n = number<std::uint32_t>();
        if (n > limits_.items) {
            fail("a list of " + std::to_string(n) + " items; " + std::to_string(limits_.items) + " are the most");
        }
        if (n > (from_.size() - at_) / least) {
            fail("a list of " + std::to_string(n) + " items does not fit into what is left");
        }
        list.resize(n);
        for (T &item : list) {
            body(*this, item);
        }
    }

    void end() const
    {
        if (at_ != from_.size()) {
            fail(std::to_string(from_.size() - at_) + " bytes are left over");
        }
    }

private:
    [[noreturn]] void fail(const std::string &why) const
    {
        throw ProtocolError("byte " + std::to_string(at_) + " of the body: " + why);
    }

    std::span<const std::byte> take(std::size_t n)
    {
        if (n > from_.size() - at_) {
            fail("it ends here, " + std::to_string(n - (from_.size() - at_)) + " bytes too early");
        }
        at_ += n;
        return from_.subspan(at_ - n, n);
    }

    std::span<const std::byte> counted(Bound bound)
    {
        const std::size_t n = number<std::uint32_t>();
        const std::size_t most = bound == Bound::name   ? limits_.name
                                 : bound == Bound::text ? limits_.text
                                                        : limits_.frame;
        if (n > most) {
            fail("a length of " + std::to_string(n) + "; " + std::to_string(most) + " is the most");
        }
        return take(n);
    }

    std::span<const std::byte> from_;
    const Limits &limits_;
    std::size_t at_ = 0;
    bool swap_;
};

// ---- the messages. M is const for a Writer.

template <class M, class T>
concept Is = std::is_same_v<std::remove_const_t<M>, T>;

void body(auto &a, Is<Schema> auto &m)
{
    a(m.name, Bound::name);
    a(m.text, Bound::text);
    a(m.size);
    a(m.hash);
}

void body(auto &a, Is<Rate> auto &m)
{
    a(m.period);
    a(m.offset);
}

/// The payload's struct begins at a multiple of 8, behind the CDR header.
void body(auto &a, Is<Record> auto &m)
{
    a(m.t);
    a(m.channel);
    a(m.count);
    a(m.payload, Bound::payload);
}

void body(auto &a, Is<Subscription> auto &m)
{
    a(m.topic, Bound::name);
    a(m.latency);
    a(m.optional);
    body(a, m.schema);
}

void body(auto &a, Is<Channel> auto &m)
{
    a(m.channel);
    a(m.topic, Bound::name);
    body(a, m.schema);
}

void body(auto &a, Is<Publication> auto &m)
{
    a(m.channel);
    body(a, m.schema);
    a(m.initial, Bound::payload);
}

void body(auto &a, Is<Hello> auto &m)
{
    a(m.oldest);
    a(m.newest);
    a(m.role);
    a(m.shared);
    a(m.simulation, Bound::name);
    a(m.node, Bound::name);
}

void body(auto &a, Is<Welcome> auto &m)
{
    a(m.address, Bound::text);
    a(m.shared, Bound::text);
    a(m.nonce);
}

void body(auto &a, Is<Refused> auto &m)
{
    a(m.reason, Bound::text);
}

void body(auto &a, Is<Initialize> auto &m)
{
    a(m.seed);
    a(m.end);
    a(m.start);
    a(m.frontend, Bound::text);
    a(m.backend, Bound::text);
    a(m.snapshot, Bound::payload);
}

void body(auto &a, Is<Initialized> auto &m)
{
    a(m.rates, 16);
    a(m.any_time);
    a(m.saves);
}

void body(auto &, Is<ProvideDesired> auto &) {}

void body(auto &a, Is<Desired> auto &m)
{
    a(m.subscriptions, 26);
}

void body(auto &a, Is<Match> auto &m)
{
    a(m.asked, 28);
}

void body(auto &a, Is<Matched> auto &m)
{
    a(m.publications, 28);
}

void body(auto &a, Is<Start> auto &m)
{
    a(m.wired, 28);
}

void body(auto &, Is<Ready> auto &) {}

void body(auto &a, Is<Tick> auto &m)
{
    a(m.until);
    a(m.records, 20);
}

void body(auto &a, Is<Tock> auto &m)
{
    a(m.reached);
    a(m.compute_ns);
    a(m.leaving);
    a(m.records, 20);
}

void body(auto &a, Is<Finish> auto &m)
{
    a(m.reason, Bound::text);
}

void body(auto &, Is<Finished> auto &) {}

void body(auto &a, Is<Failed> auto &m)
{
    a(m.reason, Bound::text);
}

void body(auto &a, Is<Attached> auto &m)
{
    a(m.frontend, Bound::text);
    a(m.backend, Bound::text);
    a(m.channels, 28);
}

void body(auto &a, Is<Published> auto &m)
{
    body(a, m.record);
    a(m.node, Bound::name);
}

void body(auto &a, Is<Save> auto &m)
{
    a(m.time);
}

void body(auto &a, Is<Saved> auto &m)
{
    a(m.snapshot, Bound::payload);
}

/// A message of the i-th kind, from 0.
template <std::size_t I = 0> Message make(std::size_t i)
{
    if constexpr (I < std::variant_size_v<Message>) {
        return i == I ? Message(std::in_place_index<I>) : make<I + 1>(i);
    } else {
        throw ProtocolError("there is no frame of kind " + std::to_string(i + 1));
    }
}

constexpr const char *kind_names[] = {"Hello",          "Welcome",  "Refused",   "Initialize", "Initialized",
                                      "ProvideDesired", "Desired",  "Match",     "Matched",    "Start",
                                      "Ready",          "Tick",     "Tock",      "Finish",     "Finished",
                                      "Failed",         "Attached", "Published", "Save",       "Saved"};
static_assert(std::size(kind_names) == std::variant_size_v<Message>);

} // namespace

Order native_order()
{
    return std::endian::native == std::endian::little ? Order::little : Order::big;
}

const char *kind_name(std::size_t index)
{
    return kind_names[index];
}

void encode(const Frame &frame, Bytes &out, Order order, Sum sum)
{
    const bool swap = order != native_order();
    const auto put = [&](std::size_t at, auto x) {
        x = swap ? turned(x) : x;
        std::memcpy(out.data() + at, &x, sizeof x);
    };
    out.assign(frame_header_size, std::byte{0});
    Writer writer(out, swap);
    std::visit([&](const auto &m) { body(writer, m); }, frame.message);
    const std::size_t size = out.size() - frame_header_size;
    if (size > std::numeric_limits<std::uint32_t>::max()) {
        throw ProtocolError(std::string(kind_name(frame.message)) + ": a body of " + std::to_string(size) +
                            " bytes is too long for a frame");
    }
    std::memcpy(out.data(), magic, sizeof magic);
    out[4] = static_cast<std::byte>(order);
    out[5] = std::byte{protocol_version};
    put(6, static_cast<std::uint16_t>(frame.message.index() + 1));
    put(8, static_cast<std::uint32_t>(size));
    if (sum == Sum::crc) {
        put(12, mcap_crc_update(&crc_tables, 0, out.data() + frame_header_size, size));
    }
    put(16, frame.number);
}

Bytes encode(const Frame &frame, Order order)
{
    Bytes out;
    encode(frame, out, order);
    return out;
}

Frame decode(std::span<const std::byte> bytes, const Limits &limits, Sum sum)
{
    if (bytes.size() > limits.frame) {
        throw ProtocolError("a frame of " + std::to_string(bytes.size()) + " bytes; " + std::to_string(limits.frame) +
                            " are the most");
    }
    if (bytes.size() < frame_header_size || std::memcmp(bytes.data(), magic, sizeof magic)) {
        throw ProtocolError("this is no frame of a co-simulation");
    }
    if (bytes[4] > std::byte{1}) {
        throw ProtocolError("there is no byte order " + std::to_string(std::to_integer<int>(bytes[4])));
    }
    if (bytes[5] != std::byte{protocol_version}) {
        throw ProtocolError("version " + std::to_string(std::to_integer<int>(bytes[5])) +
                            " of the format, while this program speaks version " + std::to_string(protocol_version));
    }
    const bool swap = static_cast<Order>(bytes[4]) != native_order();
    const auto get = [&](std::size_t at, auto x) {
        std::memcpy(&x, bytes.data() + at, sizeof x);
        return swap ? turned(x) : x;
    };
    const auto content = bytes.subspan(frame_header_size);
    if (const auto size = get(8, std::uint32_t{}); size != content.size()) {
        throw ProtocolError("a body of " + std::to_string(content.size()) + " bytes, while the header says " +
                            std::to_string(size));
    }
    if (get(12, std::uint32_t{}) !=
        (sum == Sum::crc ? mcap_crc_update(&crc_tables, 0, content.data(), content.size()) : 0)) {
        throw ProtocolError("the checksum of the body is wrong");
    }
    if (get(20, std::uint32_t{}) != 0) {
        throw ProtocolError("bytes 20 to 23 of the header are not zero");
    }
    const auto kind = get(6, std::uint16_t{});
    Frame frame{get(16, std::uint32_t{}), make(std::size_t{kind} - 1)};
    Reader reader(content, swap, limits);
    try {
        std::visit(
            [&](auto &m) {
                body(reader, m);
                reader.end();
            },
            frame.message);
    } catch (const ProtocolError &error) {
        throw ProtocolError(std::string(kind_name(frame.message)) + ": " + error.what());
    }
    return frame;
}

Payload::Payload(std::span<const std::byte> bytes) : size_(bytes.size())
{
    if (size_) {
        auto room = std::make_shared_for_overwrite<std::byte[]>(size_);
        std::memcpy(room.get(), bytes.data(), size_);
        bytes_ = std::move(room);
    }
}

bool Payload::operator==(const Payload &other) const
{
    return size_ == other.size_ && (bytes_ == other.bytes_ || !std::memcmp(data(), other.data(), size_));
}

Payload make_payload(std::span<const std::byte> message)
{
    Payload payload;
    payload.size_ = cdr_header + message.size();
    auto room = std::make_shared_for_overwrite<std::byte[]>(payload.size_);
    const std::byte head[cdr_header] = {{}, static_cast<std::byte>(native_order()), {}, {}};
    std::memcpy(room.get(), head, cdr_header);
    std::copy(message.begin(), message.end(), room.get() + cdr_header);
    payload.bytes_ = std::move(room);
    return payload;
}

Payload zero_payload(std::size_t size)
{
    return make_payload(Bytes(size));
}

bool is_payload(const Payload &payload, std::size_t size)
{
    return payload.size() == size + cdr_header && payload[0] == std::byte{0} && payload[1] <= std::byte{1} &&
           payload[2] == std::byte{0} && payload[3] == std::byte{0};
}

void read_payload(std::span<const std::byte> payload, std::span<const SchemaField> fields, std::span<std::byte> message)
{
    if (payload.size() != cdr_header + message.size()) {
        throw ProtocolError("a payload of " + std::to_string(payload.size()) + " bytes, expected " +
                            std::to_string(cdr_header + message.size()));
    }
    if (payload[0] != std::byte{0} || payload[1] > std::byte{1} || payload[2] != std::byte{0} ||
        payload[3] != std::byte{0}) {
        throw ProtocolError("a payload does not begin with a CDR header");
    }
    std::copy(payload.begin() + cdr_header, payload.end(), message.begin());
    if (static_cast<Order>(payload[1]) != native_order()) {
        swap_bytes(fields, message);
    }
}

} // namespace fledge::cosim
