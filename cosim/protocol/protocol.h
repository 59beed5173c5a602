// SPDX-License-Identifier: Apache-2.0
// The wire format between controller and nodes: the five requests of the thesis' appendix C and their replies, a
// greeting before them, and a start after the matching.
//
//     node                                controller
//     Hello                          -->                     on the one static address
//                                    <--  Welcome | Refused
//     Hello                          -->                     from here on the node's own socket
//                                    <--  Initialize
//     Initialized                    -->
//                                    <--  ProvideDesired
//     Desired                        -->
//                                    <--  Match
//     Matched                        -->
//                                    <--  Start
//     Ready                          -->
//                                    <--  Tick               again and again
//     Tock                           -->
//                                    <--  Save               between ticks
//     Saved                          -->
//                                    <--  Match, Start       again, where programs join a run
//     Matched, Ready                 -->
//                                    <--  Finish
//     Finished                       -->
//     Failed                         -->                     instead of any reply
//
//     asynchronous program
//     Hello                          -->
//                                    <--  Attached | Refused
//                                    <--  Published          from the broker, behind the topic's name
//
// All counts of messages begin at 1 with each Start; after 4,294,967,295 comes 0.
//
// A frame is a header of 24 bytes and a body:
//
//      0  4  'F' 'L' 'C' 'S'
//      4  1  byte order of all that follows: 1 little, 0 big (as in CDR)
//      5  1  version of this format
//      6  2  kind
//      8  4  bytes of the body
//     12  4  CRC-32 of the body (that of zlib); 0 in shared memory
//     16  4  number of the request; a reply repeats it
//     20  4  0
//
// In the body, each number is aligned to its size, counted from the body's start, and gaps are zero. A text or a list
// begins with its length (uint32). decode() refuses a frame if bytes are missing, left over or out of bounds, if a text
// is not as text.h says, and if a time is not from -1 (before the first instant) or a duration not from 0 to
// longest_time.
//
// Example:
//
//     using namespace cosim;
//     const Frame sent{1, Tick{.until = 1'000'000'000}};
//     const Bytes bytes = encode(sent);
//     const Frame received = decode(bytes); // throws ProtocolError
#pragma once

#include "cosim/protocol/schema.h"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <variant>
#include <vector>

namespace fledge::cosim {

using Ns = std::int64_t;
using Bytes = std::vector<std::byte>;

/// Immutable bytes, shared by all copies.
class Payload {
public:
    Payload() = default;
    Payload(std::span<const std::byte> bytes, std::span<const std::byte> head = {}); ///< head, then bytes
    Payload(const Bytes &bytes) : Payload(std::span(bytes)) {}

    const std::byte *data() const { return bytes_.get(); }
    std::size_t size() const { return size_; }
    bool empty() const { return !size_; }
    const std::byte *begin() const { return data(); }
    const std::byte *end() const { return data() + size_; }
    Bytes copy() const { return {begin(), end()}; }
    /// Shares these bytes.
    Payload part(std::size_t at, std::size_t n) const
    {
        Payload some;
        some.bytes_ = {bytes_, data() + at};
        some.size_ = n;
        return some;
    }
    std::byte operator[](std::size_t i) const { return bytes_[static_cast<std::ptrdiff_t>(i)]; }
    bool operator==(const Payload &other) const;

private:
    std::shared_ptr<const std::byte[]> bytes_;
    std::size_t size_ = 0;
};

inline constexpr std::uint8_t protocol_version = 1;
inline constexpr Ns longest_time = 1'000'000'000'000'000'000; ///< 31 years; sums of a few do not overflow
inline constexpr std::size_t frame_header_size = 24;
inline constexpr std::size_t cdr_header = 4; ///< bytes of a payload before its struct

/// The largest frame and lists that a reader accepts. Missions need less than the defaults, and machines bear more.
struct Limits {
    std::size_t frame = std::size_t{64} << 20; ///< bytes
    std::size_t name = 255;                    ///< bytes of a name or an address
    std::size_t text = std::size_t{1} << 20;   ///< bytes of a definition or a reason
    std::size_t items = 65536;                 ///< of a list
};

/// A frame that breaks the format. The message names the byte and the reason.
class ProtocolError : public std::runtime_error {
    using runtime_error::runtime_error;
};

/// When a consumer sees a message that its producer wrote at t.
enum class Latency : std::uint8_t {
    same_instant = 0,  ///< at t: the producer steps first
    next_instant = 1,  ///< at the consumer's first instant after t
    next_exchange = 2, ///< after the next exchange: both step at the same time, for a whole period
};

/// A message on its way.
struct Record {
    std::uint32_t channel = 0; ///< see Match
    std::uint32_t count = 0;   ///< of the messages on this channel to this reader, from 1
    Ns t = 0;                  ///< in a tock: when the node wrote it. In a tick: the first instant that sees it
    Payload payload;           ///< as in the archive: CDR header, then the struct in the byte order of the header
    bool operator==(const Record &) const = default;
};

/// A node steps at offset + k period for each of these.
struct Rate {
    Ns period = 0, offset = 0;
    bool operator==(const Rate &) const = default;
};

/// A topic that a node reads.
struct Subscription {
    std::string topic; ///< "/world/nav/attitude"
    Latency latency = Latency::same_instant;
    bool optional = false;
    Schema schema;
    bool operator==(const Subscription &) const = default;
};

/// A topic and its number in later frames.
struct Channel {
    std::uint32_t channel = 0;
    std::string topic;
    Schema schema;
    bool operator==(const Channel &) const = default;
};

/// A channel that a node writes, with its value after the node's reset.
struct Publication {
    std::uint32_t channel = 0;
    Schema schema;
    Payload initial;
    bool operator==(const Publication &) const = default;
};

/// The kind of a program that greets.
enum class Role : std::uint8_t {
    node = 0,         ///< it steps with the others
    asynchronous = 1, ///< it does not step, and no node waits for it
};

struct Hello {
    std::uint8_t oldest = protocol_version, newest = protocol_version; ///< versions that it understands
    std::string simulation, node;
    Role role = Role::node;
    bool shared = false; ///< on the node's own socket: all further frames go through shared memory
    bool operator==(const Hello &) const = default;
};
struct Welcome {
    std::string address;     ///< of the socket that the controller opened for this node
    std::string shared = {}; ///< path of shared memory: "/proc/123/fd/7"; "" if there is none
    std::uint64_t nonce = 0; ///< the same number stands in that memory
    bool operator==(const Welcome &) const = default;
};
struct Refused {
    std::string reason;
    bool operator==(const Refused &) const = default;
};
struct Initialize {
    std::uint64_t seed = 0;        ///< of the run
    Ns end = 0;                    ///< of the run
    Ns start = -1;                 ///< the node begins after this instant; -1: with its reset
    std::string frontend, backend; ///< of the broker; "" if there is none
    Bytes snapshot = {};           ///< made at `start`; the node goes on from it; empty: none
    bool operator==(const Initialize &) const = default;
};
struct Initialized {
    std::vector<Rate> rates;
    bool any_time = false; ///< it may write between its instants, too, and return early
    bool saves = false;    ///< it makes snapshots
    bool operator==(const Initialized &) const = default;
};
struct ProvideDesired {
    bool operator==(const ProvideDesired &) const = default;
};
struct Desired {
    std::vector<Subscription> subscriptions;
    bool operator==(const Desired &) const = default;
};
struct Match {
    std::vector<Channel> channels; ///< all topics that other nodes read
    bool operator==(const Match &) const = default;
};
struct Matched {
    std::vector<Publication> publications; ///< of the requested topics, those that this node writes
    bool operator==(const Matched &) const = default;
};
struct Start {
    std::vector<Channel> wired; ///< what this node will read, in the order of its subscriptions, without the
                                ///< optional ones that no node writes
    bool operator==(const Start &) const = default;
};
struct Ready {
    bool operator==(const Ready &) const = default;
};
struct Tick {
    Ns until = 0; ///< step through all instants up to and including this one
    std::vector<Record> records;
    bool operator==(const Tick &) const = default;
};
struct Tock {
    Ns reached = 0;    ///< the node has stepped through all instants up to this one; may be before `until`
    Ns compute_ns = 0; ///< of wall time, spent in stepping; the controller counts at most the time since the tick
    std::vector<Record> records;
    bool leaving = false; ///< the node leaves the run
    bool operator==(const Tock &) const = default;
};
struct Finish {
    std::string reason; ///< "" at the regular end
    bool operator==(const Finish &) const = default;
};
struct Finished {
    bool operator==(const Finished &) const = default;
};
struct Failed {
    std::string reason;
    bool operator==(const Failed &) const = default;
};

/// The answer to an asynchronous program.
struct Attached {
    std::string frontend, backend; ///< of the broker: to publish, and to subscribe
    std::vector<Channel> channels; ///< all topics
    bool operator==(const Attached &) const = default;
};
/// A message that the broker carries.
struct Published {
    Record record;    ///< t: when it was written
    std::string node; ///< that wrote it
    bool operator==(const Published &) const = default;
};
struct Save {
    Ns time = 0; ///< that the node has reached
    bool operator==(const Save &) const = default;
};
struct Saved {
    Bytes snapshot; ///< from which another program can go on; empty: the node makes none
    bool operator==(const Saved &) const = default;
};

/// In the order of their kinds, from 1.
using Message = std::variant<Hello, Welcome, Refused, Initialize, Initialized, ProvideDesired, Desired, Match, Matched,
                             Start, Ready, Tick, Tock, Finish, Finished, Failed, Attached, Published, Save, Saved>;

/// "Tock", by the index in Message.
const char *kind_name(std::size_t index);
inline const char *kind_name(const Message &message)
{
    return kind_name(message.index());
}

struct Frame {
    std::uint32_t number = 0;
    Message message;
    bool operator==(const Frame &) const = default;
};

enum class Order : std::uint8_t { big = 0, little = 1 };
Order native_order();

/// The checksum of a frame: zero in shared memory.
enum class Sum { zero, crc };

/// Write a frame into `out`, and reuse its memory. Only tests use the other byte order. Throws ProtocolError if the
/// body exceeds 4 GiB.
void encode(const Frame &frame, Bytes &out, Order order = native_order(), Sum sum = Sum::crc);
Bytes encode(const Frame &frame, Order order = native_order());

/// Throws ProtocolError.
Frame decode(std::span<const std::byte> bytes, const Limits &limits = {}, Sum sum = Sum::crc);

/// A payload from a struct in the machine's order.
Payload make_payload(std::span<const std::byte> message);
/// The payload of a message that was never written: all zero.
Payload zero_payload(std::size_t size);
/// Whether it has a CDR header and a struct of this size.
bool is_payload(std::span<const std::byte> payload, std::size_t size);

/// Copy the struct of a payload into `message`, in the machine's byte order.
/// Throws ProtocolError if the sizes differ or the CDR header is invalid.
void read_payload(std::span<const std::byte> payload, std::span<const SchemaField> fields,
                  std::span<std::byte> message);

} // namespace fledge::cosim
