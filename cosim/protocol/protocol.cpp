// SPDX-License-Identifier: Apache-2.0
#include "cosim/protocol/protocol.h"

#include "cosim/protocol/text.h"
#include "record/mcap_crc.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <limits>
#include <tuple>
#include <type_traits>

namespace fledge::cosim {

namespace {

constexpr char magic[4] = {'F', 'L', 'C', 'S'};

/// The tables of mcap_crc_init(), made at compile time: the programs of one machine then share them in the cache.
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

// ---- the members of each message, in the order of the wire

/// A member that takes only some values. An error names it.
template <class M, class T> struct Checked {
    constexpr Checked(T M::*its_member, const char *its_label) : member(its_member), label(its_label) {}
    T M::*member;
    const char *label;
};
template <class M> struct Name : Checked<M, std::string> { // text.h
    using Checked<M, std::string>::Checked;
};
template <class M> struct Lines : Checked<M, std::string> {
    using Checked<M, std::string>::Checked;
};
/// Lines for people: the writer cleans them, so that a bad character does not hide the reason.
template <class M> struct Reason : Lines<M> {
    using Lines<M>::Lines;
};
template <class M> struct Time : Checked<M, Ns> { ///< of an instant; -1: before the first one
    using Checked<M, Ns>::Checked;
    static constexpr Ns least = -1;
};
template <class M> struct Duration : Checked<M, Ns> {
    using Checked<M, Ns>::Checked;
    static constexpr Ns least = 0;
};
template <class M> Name(std::string M::*, const char *) -> Name<M>;
template <class M> Lines(std::string M::*, const char *) -> Lines<M>;
template <class M> Reason(std::string M::*, const char *) -> Reason<M>;
template <class M> Time(Ns M::*, const char *) -> Time<M>;
template <class M> Duration(Ns M::*, const char *) -> Duration<M>;

template <class M> constexpr std::tuple<> members;
template <>
constexpr auto members<Schema> = std::tuple(Name(&Schema::name, "type"), Lines(&Schema::text, "definition"),
                                            &Schema::size, &Schema::hash);
template <>
constexpr auto members<Rate> = std::tuple(Duration(&Rate::period, "period"), Duration(&Rate::offset, "offset"));
/// The payload's struct begins at a multiple of 8, behind the CDR header.
template <>
constexpr auto members<Record> = std::tuple(Time(&Record::t, "t"), &Record::channel, &Record::count, &Record::payload);
template <>
constexpr auto members<Subscription> = std::tuple(Name(&Subscription::topic, "topic"), &Subscription::latency,
                                                  &Subscription::optional, &Subscription::schema);
template <>
constexpr auto members<Channel> = std::tuple(&Channel::channel, Name(&Channel::topic, "topic"), &Channel::schema);
template <>
constexpr auto members<Publication> = std::tuple(&Publication::channel, &Publication::schema, &Publication::initial);
template <>
constexpr auto members<Hello> = std::tuple(&Hello::oldest, &Hello::newest, &Hello::role, &Hello::shared,
                                           Name(&Hello::simulation, "simulation"), Name(&Hello::node, "node"));
template <>
constexpr auto members<Welcome> = std::tuple(Name(&Welcome::address, "address"), Name(&Welcome::shared, "shared"),
                                             &Welcome::nonce);
template <> constexpr auto members<Refused> = std::tuple(Reason(&Refused::reason, "reason"));
template <>
constexpr auto members<Initialize> = std::tuple(&Initialize::seed, Duration(&Initialize::end, "end"),
                                                Time(&Initialize::start, "start"),
                                                Name(&Initialize::frontend, "frontend"),
                                                Name(&Initialize::backend, "backend"), &Initialize::snapshot);
template <>
constexpr auto members<Initialized> = std::tuple(&Initialized::rates, &Initialized::any_time, &Initialized::saves);
template <> constexpr auto members<Desired> = std::tuple(&Desired::subscriptions);
template <> constexpr auto members<Match> = std::tuple(&Match::channels);
template <> constexpr auto members<Matched> = std::tuple(&Matched::publications);
template <> constexpr auto members<Start> = std::tuple(&Start::wired);
template <> constexpr auto members<Tick> = std::tuple(Time(&Tick::until, "until"), &Tick::records);
template <>
constexpr auto members<Tock> = std::tuple(Time(&Tock::reached, "reached"), Duration(&Tock::compute_ns, "compute_ns"),
                                          &Tock::leaving, &Tock::records);
template <> constexpr auto members<Finish> = std::tuple(Reason(&Finish::reason, "reason"));
template <> constexpr auto members<Failed> = std::tuple(Reason(&Failed::reason, "reason"));
template <>
constexpr auto members<Attached> = std::tuple(Name(&Attached::frontend, "frontend"),
                                              Name(&Attached::backend, "backend"), &Attached::channels);
template <> constexpr auto members<Published> = std::tuple(&Published::record, Name(&Published::node, "node"));
template <> constexpr auto members<Save> = std::tuple(Time(&Save::time, "time"));
template <> constexpr auto members<Saved> = std::tuple(&Saved::snapshot);

/// Pass each member to a Writer, with a const message, or to a Reader.
template <class M> void walk(auto &archive, M &m)
{
    constexpr auto list = members<std::remove_const_t<M>>;
    static_assert((std::tuple_size_v<decltype(list)> == 0) == std::is_empty_v<M>, "its members are not listed above");
    const auto visit = [&](auto member) {
        if constexpr (requires { member.label; }) {
            archive(m.*member.member, member);
        } else if constexpr (std::tuple_size_v<decltype(members<std::remove_cvref_t<decltype(m.*member)>>)> > 0) {
            walk(archive, m.*member);
        } else {
            archive(m.*member);
        }
    };
    std::apply([&](auto... member) { (visit(member), ...); }, list);
}

template <class T>
concept Number = std::is_arithmetic_v<T>;
template <class T>
concept Enum = std::is_enum_v<T>;

/// The fewest bytes of a value in a frame.
template <class T> constexpr std::size_t least_size()
{
    if constexpr (Number<T> || Enum<T>) {
        return sizeof(T);
    } else {
        constexpr auto least_of = [](auto member) {
            if constexpr (requires { member.label; }) {
                return least_size<std::remove_cvref_t<decltype(std::declval<T>().*member.member)>>();
            } else {
                return least_size<std::remove_cvref_t<decltype(std::declval<T>().*member)>>();
            }
        };
        // A text or a list has no members, but a length.
        return std::apply([&](auto... m) { return sizeof...(m) ? (std::size_t{} + ... + least_of(m)) : 4; },
                          members<T>);
    }
}

class Writer {
public:
    Writer(Bytes &out, bool swap) : out_(out), swap_(swap) {}

    void operator()(Number auto x)
    {
        size_ += (frame_header_size - size_) % sizeof x; // a gap of zeros
        x = swap_ ? turned(x) : x;
        std::memcpy(room(sizeof x), &x, sizeof x);
    }
    void operator()(Enum auto x) { (*this)(static_cast<std::uint8_t>(x)); }
    void operator()(const Bytes &b) { counted(b); }
    void operator()(const Payload &b) { counted(b); }
    void operator()(const std::string &s, const auto &) { counted(s); }
    template <class M> void operator()(const std::string &s, const Reason<M> &) { counted(cleaned(s, Limits{}.text)); }
    void operator()(Ns t, const auto &) { (*this)(t); }
    template <class T> void operator()(const std::vector<T> &list)
    {
        length(list.size());
        for (const T &item : list) {
            walk(*this, item);
        }
    }

    /// The bytes of the body.
    std::size_t end()
    {
        out_.resize(size_);
        return size_ - frame_header_size;
    }

private:
    void length(std::size_t n)
    {
        if (n > std::numeric_limits<std::uint32_t>::max()) {
            throw ProtocolError("a list or text of " + std::to_string(n) + " is too long for a frame");
        }
        (*this)(static_cast<std::uint32_t>(n));
    }

    void counted(const auto &bytes)
    {
        length(bytes.size());
        if (bytes.size()) {
            std::memcpy(room(bytes.size()), bytes.data(), bytes.size());
        }
    }

    /// For n bytes more. It grows in large steps, which fill it with zeros.
    std::byte *room(std::size_t n)
    {
        size_ += n;
        if (size_ > out_.size()) {
            out_.resize(2 * size_);
        }
        return out_.data() + size_ - n;
    }

    Bytes &out_; ///< of which `size_` bytes are written
    std::size_t size_ = frame_header_size;
    bool swap_;
};

class Reader {
public:
    Reader(std::span<const std::byte> from, bool swap, const Limits &limits) : from_(from), limits_(limits), swap_(swap)
    {
    }

    void operator()(Number auto &x)
    {
        for (std::size_t gap = -at_ % sizeof x; gap; gap--) {
            if (take(1)[0] != std::byte{0}) {
                fail("a gap is not zero");
            }
        }
        std::memcpy(&x, take(sizeof x).data(), sizeof x);
        x = swap_ ? turned(x) : x;
    }

    void operator()(bool &x)
    {
        const auto byte = number<std::uint8_t>();
        if (byte > 1) {
            fail("expected 0 or 1, found " + std::to_string(byte));
        }
        x = byte;
    }

    template <Enum E> void operator()(E &x)
    {
        constexpr bool latency = std::is_same_v<E, Latency>;
        static_assert(latency || std::is_same_v<E, Role>);
        x = static_cast<E>(number<std::uint8_t>());
        if (latency ? x > E{2} : x > E{1}) {
            fail((latency ? "there is no latency " : "there is no role ") + std::to_string(static_cast<int>(x)));
        }
    }

    template <class M> void operator()(std::string &s, const Name<M> &name)
    {
        text(s, limits_.name, TextKind::name, name.label);
    }
    template <class M> void operator()(std::string &s, const Lines<M> &lines)
    {
        text(s, limits_.text, TextKind::lines, lines.label);
    }
    template <class Checked> void operator()(Ns &t, const Checked &checked)
    {
        (*this)(t);
        if (t < checked.least || t > longest_time) {
            fail(std::string(checked.label) + " is " + std::to_string(t) + " ns; expected " +
                 std::to_string(checked.least) + " to " + std::to_string(longest_time));
        }
    }
    void operator()(Bytes &b)
    {
        const auto bytes = counted(limits_.frame);
        b.assign(bytes.begin(), bytes.end());
    }
    /// All payloads of a short frame are parts of one copy.
    void operator()(Payload &b)
    {
        const auto bytes = counted(limits_.frame);
        if (from_.size() > most_shared || bytes.empty()) {
            b = Payload(bytes);
            return;
        }
        if (copy_.empty()) {
            copy_ = Payload(from_);
        }
        b = copy_.part(at_ - bytes.size(), bytes.size());
    }

    template <class T> void operator()(std::vector<T> &list)
    {
        const auto n = number<std::uint32_t>();
        if (n > limits_.items) {
            fail("a list of " + std::to_string(n) + " items; " + std::to_string(limits_.items) + " are the most");
        }
        if (n > (from_.size() - at_) / least_size<T>()) { // so the list allocates no more memory than the frame has
            fail("a list of " + std::to_string(n) + " items does not fit into what is left");
        }
        list.resize(n);
        for (T &item : list) {
            walk(*this, item);
        }
    }

    void end() const
    {
        if (at_ != from_.size()) {
            fail(std::to_string(from_.size() - at_) + " bytes are left over");
        }
    }

private:
    [[noreturn, gnu::cold]] void fail(const std::string &why) const
    {
        throw ProtocolError("byte " + std::to_string(at_) + " of the body: " + why);
    }

    [[noreturn, gnu::cold]] void fail_short(std::size_t n) const
    {
        fail("it ends here, " + std::to_string(n) + " bytes too early");
    }

    template <class T> T number()
    {
        T x;
        (*this)(x);
        return x;
    }

    std::span<const std::byte> take(std::size_t n)
    {
        if (n > from_.size() - at_) {
            fail_short(n - (from_.size() - at_));
        }
        at_ += n;
        return from_.subspan(at_ - n, n);
    }

    std::span<const std::byte> counted(std::size_t most)
    {
        const std::size_t n = number<std::uint32_t>();
        if (n > most) {
            fail("a length of " + std::to_string(n) + "; " + std::to_string(most) + " is the most");
        }
        return take(n);
    }

    void text(std::string &s, std::size_t most, TextKind kind, const char *label)
    {
        const std::size_t n = number<std::uint32_t>();
        if (n > most) {
            fail(std::string(label) + " has " + std::to_string(n) + " bytes; " + std::to_string(most) +
                 " are the most");
        }
        const auto bytes = take(n);
        s.assign(reinterpret_cast<const char *>(bytes.data()), bytes.size());
        if (const std::string fault = text_fault(s, kind); !fault.empty()) {
            fail(std::string(label) + " " + fault);
        }
    }

    static constexpr std::size_t most_shared = 65536; ///< bytes of a frame that a payload keeps in memory

    std::span<const std::byte> from_;
    Payload copy_; ///< of it
    const Limits &limits_;
    std::size_t at_ = 0;
    bool swap_;
};

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
    std::visit([&](const auto &m) { walk(writer, m); }, frame.message);
    const std::size_t size = writer.end();
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
        std::visit([&](auto &m) { walk(reader, m); }, frame.message);
        reader.end();
    } catch (const ProtocolError &error) {
        throw ProtocolError(std::string(kind_name(frame.message)) + ": " + error.what());
    }
    return frame;
}

Payload::Payload(std::span<const std::byte> bytes, std::span<const std::byte> head) : size_(head.size() + bytes.size())
{
    if (size_) {
        auto room = std::make_shared_for_overwrite<std::byte[]>(size_);
        std::copy(bytes.begin(), bytes.end(), std::copy(head.begin(), head.end(), room.get()));
        bytes_ = std::move(room);
    }
}

bool Payload::operator==(const Payload &other) const
{
    return size_ == other.size_ && (bytes_ == other.bytes_ || !std::memcmp(data(), other.data(), size_));
}

Payload make_payload(std::span<const std::byte> message)
{
    const std::byte head[cdr_header] = {{}, static_cast<std::byte>(native_order()), {}, {}};
    return Payload(message, head);
}

Payload zero_payload(std::size_t size)
{
    return make_payload(Bytes(size));
}

bool is_payload(std::span<const std::byte> payload, std::size_t size)
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
    if (!is_payload(payload, message.size())) {
        throw ProtocolError("a payload does not begin with a CDR header");
    }
    std::copy(payload.begin() + cdr_header, payload.end(), message.begin());
    if (static_cast<Order>(payload[1]) != native_order()) {
        swap_bytes(fields, message);
    }
}

} // namespace fledge::cosim
