// SPDX-License-Identifier: Apache-2.0
// The ground's entity of CFDP for Python: files in a folder, the time from the caller.
#include "ccsds/cfdp.h"
#include "ccsds/store/posix_store.h"
#include "core/typed.h"

#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <deque>
#include <fcntl.h>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <tuple>
#include <unistd.h>
#include <utility>
#include <variant>
#include <vector>

namespace py = pybind11;

namespace fledge::ground {

namespace {

using TransactionId = std::pair<std::uint64_t, std::uint64_t>; // source, sequence

/// A file name of the remote entity: bytes that are no UTF-8 become lone surrogates, as in Python's paths.
using FileName = core::Typed<py::object, "str">;

/// An event of an entity, as CfdpEvent.
struct EntityEvent {
    int kind;
    TransactionId id;
    bool receiver, incomplete;
    int condition, file_status;
    FileName to;
    py::bytes text;
};

struct Progress {
    std::uint64_t done, size; // [bytes]
    bool suspended;
};

/// The store of an entity that replaces no file: a second file of a name gets a number, as NAME.2. Names that are
/// hidden, lead elsewhere or have control characters are refused, except expected names.
struct KeepingStore : PosixStore {
    std::set<std::string> expected;
    std::deque<std::pair<std::string, std::string>> stored; ///< the name in the transaction, and the file's

    static int rename(void *user, const char *from, const char *to)
    {
        auto *const store = static_cast<KeepingStore *>(static_cast<PosixStore *>(user));
        const std::string name = to;
        const bool control = std::any_of(name.begin(), name.end(), [](unsigned char c) { return c < 32 || c == 127; });
        const bool hidden = name.empty() || name[0] == '.' || name.find('/') != std::string::npos;
        const bool is_expected = store->expected.erase(name) != 0;
        if (!is_expected && (hidden || control)) {
            return CFDP_REFUSED;
        }
        if (const int file = openat(store->root, from, O_RDONLY | O_CLOEXEC | O_NOFOLLOW); file >= 0) {
            const bool safe = // on the disk, before the sender deletes its own
                fdatasync(file) == 0 || errno == EINVAL || errno == ENOSYS;
            close(file);
            if (!safe) {
                return CFDP_BROKEN;
            }
        }
        if (is_expected) {
            return renameat(store->root, from, store->root, to) == 0 ? 0 : CFDP_BROKEN;
        }
        const std::size_t dot = name.rfind('.');
        for (unsigned n = 1; n < 100'000; n++) {
            std::string place = name;
            if (n > 1) {
                place.insert(std::min(dot, name.size()), "." + std::to_string(n));
            }
            if (linkat(store->root, from, store->root, place.c_str(), 0) == 0) {
                unlinkat(store->root, from, 0);
                store->stored.emplace_back(name, place);
                return 0;
            }
            if (errno != EEXIST) {
                return errno == ENOSPC || errno == EDQUOT ? CFDP_FULL : CFDP_REFUSED;
            }
        }
        return CFDP_REFUSED;
    }
};

constexpr std::size_t transactions = 32, ranges = 4096, past = 256;
constexpr std::size_t room = 512; // [bytes] of a PDU in a command

class Entity {
public:
    Entity(const std::string &folder, std::uint64_t own, std::uint64_t peer, std::uint64_t sequence,
           std::int64_t timeout, std::int64_t inactivity, unsigned limit, bool crc, unsigned allowed, bool keeps)
        : transactions_(transactions), ranges_(transactions * ranges), past_(past), work_(65536)
    {
        remote_.entity = peer;
        remote_.ack_timer = remote_.nak_timer = remote_.check_timer = timeout;
        remote_.inactivity = inactivity;
        remote_.ack_limit = remote_.nak_limit = remote_.check_limit = static_cast<std::uint8_t>(limit);
        remote_.segment = room; // the header makes it less
        remote_.crc = crc;
        remote_.allowed = static_cast<std::uint8_t>(allowed);
        CfdpSetup setup{};
        if (posix_store_open(&posix_, folder.c_str(), UINT64_MAX >> 1, &setup.store) == 0) {
            throw std::runtime_error(folder + ": " + std::strerror(errno));
        }
        setup.store.rename = keeps ? KeepingStore::rename : setup.store.rename;
        setup.entity = own;
        setup.notify = [](void *user, const CfdpEvent *event) { static_cast<Entity *>(user)->notify(*event); };
        setup.user = this;
        setup.remotes = &remote_;
        setup.remotes_n = 1;
        setup.transactions = transactions_.data();
        setup.transactions_n = transactions;
        setup.kept = transactions / 4;
        setup.ranges = ranges_.data();
        setup.ranges_n = ranges;
        setup.past = past_.data();
        setup.past_n = past;
        setup.work = work_.data();
        setup.work_n = static_cast<std::uint32_t>(work_.size());
        setup.entity_bytes = entity_bytes;
        setup.sequence_bytes = sequence_bytes;
        cfdp_begin(&cfdp_, &setup, sequence);
    }
    Entity(const Entity &) = delete;
    Entity &operator=(const Entity &) = delete;
    ~Entity() { posix_store_close(&posix_); }

    static py::bytes message(int type, TransactionId about, const std::string &first, const std::string &second,
                             int value)
    {
        CfdpMessage message{};
        message.type = static_cast<std::uint8_t>(type);
        message.entity = about.first;
        message.sequence = about.second;
        message.entity_bytes = cfdp_bytes(about.first, entity_bytes);
        message.sequence_bytes = cfdp_bytes(about.second, sequence_bytes);
        message.first = text(first);
        message.second = text(second);
        message.value = static_cast<std::uint8_t>(value);
        std::array<char, 600> bytes{};
        const std::size_t n =
            cfdp_message_write(&message, reinterpret_cast<std::uint8_t *>(bytes.data()), bytes.size());
        if (n == 0) {
            throw std::length_error("a message of CFDP has 255 bytes at most; the names are too long: " + first + " " +
                                    second);
        }
        return {bytes.data(), n};
    }

    static std::optional<std::tuple<int, TransactionId, int>> read_message(const std::string &value)
    {
        CfdpMessage message{};
        const CfdpTlv tlv{text(value), CFDP_TLV_MESSAGE};
        if (cfdp_message_read(&message, &tlv) != CCSDS_OK) {
            return std::nullopt;
        }
        return std::tuple{int{message.type}, TransactionId{message.entity, message.sequence}, int{message.value}};
    }

    /// The transaction's id, or why there is none: a CfdpRefusal.
    std::variant<TransactionId, int> put(const std::string &from, const std::string &to, const std::string &options,
                                         bool class1)
    {
        CfdpPut request{};
        request.destination = remote_.entity;
        request.from = from.c_str();
        request.to = to.c_str();
        request.options = reinterpret_cast<const std::uint8_t *>(options.data());
        request.options_n = options.size();
        request.class1 = class1;
        CfdpId id{};
        const int result = cfdp_put(&cfdp_, &request, &id);
        if (result < 0) {
            return result;
        }
        return TransactionId{id.source, id.sequence};
    }

    void expect(const std::string &name) { posix_.expected.insert(name); }
    void time(std::int64_t now) { cfdp_time(&cfdp_, now); }
    void left(std::uint64_t bytes) { posix_.room = bytes; }

    void take(const std::string &pdu)
    {
        cfdp_take(&cfdp_, reinterpret_cast<const std::uint8_t *>(pdu.data()), pdu.size());
    }

    py::bytes next()
    {
        std::array<char, room> bytes{};
        const std::size_t n = cfdp_next(&cfdp_, nullptr, reinterpret_cast<std::uint8_t *>(bytes.data()), bytes.size());
        return {bytes.data(), n};
    }

    std::optional<EntityEvent> event()
    {
        if (events_.empty()) {
            return std::nullopt;
        }
        EntityEvent next_event = std::move(events_.front());
        events_.pop_front();
        return next_event;
    }

    /// Of a transaction that has not ended.
    std::optional<Progress> progress(TransactionId id) const
    {
        for (const CfdpTransaction &transaction : transactions_) {
            if (transaction.state != CFDP_FREE && transaction.id.source == id.first &&
                transaction.id.sequence == id.second) {
                return Progress{transaction.progress, transaction.size, transaction.suspended != 0};
            }
        }
        return std::nullopt;
    }

    bool busy() const
    {
        for (const CfdpTransaction &transaction : transactions_) {
            if (transaction.state != CFDP_FREE) {
                return true;
            }
        }
        return cfdp_.live.answers_n != 0;
    }

    void freeze(bool on) { remote_.frozen = on; }
    bool suspend(TransactionId id) { return cfdp_suspend(&cfdp_, {id.first, id.second}) != 0; }
    bool resume(TransactionId id) { return cfdp_resume(&cfdp_, {id.first, id.second}) != 0; }
    bool cancel(TransactionId id) { return cfdp_cancel(&cfdp_, {id.first, id.second}) != 0; }

private:
    static constexpr std::uint8_t entity_bytes = 2, sequence_bytes = 4;

    static CfdpText text(const std::string &value)
    {
        if (value.size() > UINT8_MAX) {
            throw std::length_error("a text of CFDP has 255 bytes at most, not " + std::to_string(value.size()) + ": " +
                                    value);
        }
        return {reinterpret_cast<const std::uint8_t *>(value.data()), static_cast<std::uint8_t>(value.size())};
    }

    void notify(const CfdpEvent &event)
    {
        const char *bytes = reinterpret_cast<const char *>(event.text.bytes);
        const bool ended = event.what == CFDP_EVENT_ENDED && event.receiver != 0;
        const auto at = std::find_if(posix_.stored.begin(), posix_.stored.end(),
                                     [&](const auto &names) { return ended && names.first == event.to; });
        const std::string to = at != posix_.stored.end() ? at->second : event.to;
        if (at != posix_.stored.end()) {
            posix_.stored.erase(at);
        }
        events_.push_back({static_cast<int>(event.what),
                           {event.id.source, event.id.sequence},
                           event.receiver != 0,
                           event.incomplete != 0,
                           event.condition,
                           event.file_status,
                           py::reinterpret_steal<FileName>(PyUnicode_DecodeFSDefault(to.c_str())),
                           py::bytes(event.text.n != 0 ? bytes : "", event.text.n)});
    }

    KeepingStore posix_{};
    CfdpRemote remote_{};
    std::vector<CfdpTransaction> transactions_;
    std::vector<CfdpRange> ranges_;
    std::vector<CfdpPast> past_;
    std::vector<std::uint8_t> work_;
    std::deque<EntityEvent> events_;
    Cfdp cfdp_{};
};

} // namespace

void bind_entity(py::module_ &m)
{
    py::class_<EntityEvent>(m, "EntityEvent", "An event of an entity: a CfdpEvent (ccsds/cfdp.h).")
        .def_readonly("kind", &EntityEvent::kind)
        .def_readonly("id", &EntityEvent::id, "(source, sequence)")
        .def_readonly("receiver", &EntityEvent::receiver)
        .def_readonly("incomplete", &EntityEvent::incomplete)
        .def_readonly("condition", &EntityEvent::condition)
        .def_readonly("file_status", &EntityEvent::file_status)
        .def_readonly("to", &EntityEvent::to)
        .def_readonly("text", &EntityEvent::text);
    py::class_<Progress>(m, "Progress", "The progress of a transaction.")
        .def_readonly("done", &Progress::done, "[bytes]")
        .def_readonly("size", &Progress::size, "[bytes]")
        .def_readonly("suspended", &Progress::suspended);
    py::class_<Entity>(m, "Entity", "An entity of CFDP with files in a folder. Times are nanoseconds.")
        .def(py::init<const std::string &, std::uint64_t, std::uint64_t, std::uint64_t, std::int64_t, std::int64_t,
                      unsigned, bool, unsigned, bool>(),
             py::kw_only(), py::arg("folder"), py::arg("own"), py::arg("peer"), py::arg("sequence"), py::arg("timeout"),
             py::arg("inactivity"), py::arg("limit"), py::arg("crc") = false, py::arg("allowed") = 0,
             py::arg("keeps") = false)
        .def("expect", &Entity::expect, py::arg("name"),
             "Let the next file of this name replace an existing one; keeps: other files are not replaced, and hidden "
             "names are refused.")
        .def_static("message", &Entity::message, py::arg("type"), py::arg("about") = TransactionId{},
                    py::arg("first") = "", py::arg("second") = "", py::arg("value") = 0,
                    "A message to the user as a TLV: a CfdpMessage.")
        .def_static("read_message", &Entity::read_message, py::arg("value"),
                    "(type, about, value) of such a message; None: it is no message.")
        .def("put", &Entity::put, py::arg("from_"), py::arg("to"), py::arg("options"), py::arg("class1"),
             "(source, sequence), or a CfdpRefusal.")
        .def("time", &Entity::time, py::arg("now"))
        .def("room", &Entity::left, py::arg("bytes"),
             "How many bytes may still be written; more is a filestore rejection.")
        .def("take", &Entity::take, py::arg("pdu"))
        .def("next", &Entity::next, "The next PDU; empty: there is none.")
        .def("event", &Entity::event, "The next event; None: there is none.")
        .def("progress", &Entity::progress, py::arg("id"), "Of a transaction; None: it has ended.")
        .def_property_readonly("busy", &Entity::busy)
        .def("freeze", &Entity::freeze, py::arg("on"), "on: the link is down, nothing is sent, and timers stop.")
        .def("suspend", &Entity::suspend, py::arg("id"))
        .def("resume", &Entity::resume, py::arg("id"))
        .def("cancel", &Entity::cancel, py::arg("id"));
}

} // namespace fledge::ground
