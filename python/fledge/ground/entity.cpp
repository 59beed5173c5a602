// SPDX-License-Identifier: Apache-2.0
// The ground's entity of CFDP for Python: files in a folder, the time from the caller.
#include "ccsds/cfdp.h"
#include "ccsds/store/posix_store.h"

#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <deque>
#include <optional>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <variant>
#include <vector>

namespace py = pybind11;

namespace fledge::ground {

namespace {

using TransactionId = std::pair<std::uint64_t, std::uint64_t>; // source, sequence

/// What an entity tells.
struct Told {
    int what;
    TransactionId id;
    bool receiver, incomplete;
    int condition, file_status;
    py::object to; // a name of the other end's: bytes that are no UTF-8 become lone surrogates, as in Python's paths
    py::bytes text;
};

struct Progress {
    std::uint64_t done, size; // [bytes]
    bool suspended;
};

constexpr std::size_t transactions = 32, ranges = 4096, past = 256;
constexpr std::size_t room = 512; // [bytes] of a PDU in a command

class Entity {
public:
    Entity(const std::string &folder, std::uint64_t own, std::uint64_t peer, std::uint64_t sequence,
           std::int64_t timeout, std::int64_t inactivity, unsigned limit, bool crc, unsigned allowed)
        : transactions_(transactions), ranges_(transactions * ranges), past_(past), work_(65536)
    {
        remote_.entity = peer;
        remote_.ack_timer = remote_.nak_timer = remote_.check_timer = timeout;
        remote_.inactivity = inactivity;
        remote_.ack_limit = remote_.nak_limit = remote_.check_limit = static_cast<std::uint8_t>(limit);
        remote_.segment = room; // and less by the header
        remote_.crc = crc;
        remote_.allowed = static_cast<std::uint8_t>(allowed);
        CfdpSetup setup{};
        if (posix_store_open(&posix_, folder.c_str(), UINT64_MAX >> 1, &setup.store) == 0) {
            throw std::runtime_error(folder + ": " + std::strerror(errno));
        }
        setup.entity = own;
        setup.tell = [](void *user, const CfdpEvent *event) { static_cast<Entity *>(user)->tell(*event); };
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
        CfdpMessage one{};
        one.type = static_cast<std::uint8_t>(type);
        one.entity = about.first;
        one.sequence = about.second;
        one.entity_bytes = entity_bytes;
        one.sequence_bytes = sequence_bytes;
        one.first = text(first);
        one.second = text(second);
        one.value = static_cast<std::uint8_t>(value);
        std::array<char, 600> bytes{};
        const std::size_t n = cfdp_message_write(&one, reinterpret_cast<std::uint8_t *>(bytes.data()), bytes.size());
        return {bytes.data(), n};
    }

    static std::optional<std::tuple<int, TransactionId, int>> read_message(const std::string &value)
    {
        CfdpMessage one{};
        const CfdpTlv tlv{text(value), CFDP_TLV_MESSAGE};
        if (cfdp_message_read(&one, &tlv) != CCSDS_OK) {
            return std::nullopt;
        }
        return std::tuple{int{one.type}, TransactionId{one.entity, one.sequence}, int{one.value}};
    }

    /// The transaction's id, or why there is none: a CfdpRefusal.
    std::variant<TransactionId, int> put(const std::string &from, const std::string &to, const std::string &options,
                                         bool class1)
    {
        CfdpPut one{};
        one.destination = remote_.entity;
        one.from = from.c_str();
        one.to = to.c_str();
        one.options = reinterpret_cast<const std::uint8_t *>(options.data());
        one.options_n = options.size();
        one.class1 = class1;
        CfdpId id{};
        const int result = cfdp_put(&cfdp_, &one, &id);
        if (result < 0) {
            return result;
        }
        return TransactionId{id.source, id.sequence};
    }

    void time(std::int64_t now) { cfdp_time(&cfdp_, now); }

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

    std::optional<Told> told()
    {
        if (told_.empty()) {
            return std::nullopt;
        }
        Told one = std::move(told_.front());
        told_.pop_front();
        return one;
    }

    /// Of a transaction that has not ended.
    std::optional<Progress> progress(TransactionId id) const
    {
        for (const CfdpTransaction &one : transactions_) {
            if (one.state != CFDP_FREE && one.id.source == id.first && one.id.sequence == id.second) {
                return Progress{one.progress, one.size, one.suspended != 0};
            }
        }
        return std::nullopt;
    }

    bool busy() const
    {
        for (const CfdpTransaction &one : transactions_) {
            if (one.state != CFDP_FREE) {
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
        return {reinterpret_cast<const std::uint8_t *>(value.data()), static_cast<std::uint8_t>(value.size())};
    }

    void tell(const CfdpEvent &event)
    {
        const char *bytes = reinterpret_cast<const char *>(event.text.bytes);
        told_.push_back({static_cast<int>(event.what),
                         {event.id.source, event.id.sequence},
                         event.receiver != 0,
                         event.incomplete != 0,
                         event.condition,
                         event.file_status,
                         py::reinterpret_steal<py::object>(PyUnicode_DecodeFSDefault(event.to)),
                         py::bytes(event.text.n != 0 ? bytes : "", event.text.n)});
    }

    PosixStore posix_{};
    CfdpRemote remote_{};
    std::vector<CfdpTransaction> transactions_;
    std::vector<CfdpRange> ranges_;
    std::vector<CfdpPast> past_;
    std::vector<std::uint8_t> work_;
    std::deque<Told> told_;
    Cfdp cfdp_{};
};

} // namespace

void bind_entity(py::module_ &m)
{
    py::class_<Told>(m, "Told", "What an entity tells: a CfdpEvent (ccsds/cfdp.h).")
        .def_readonly("what", &Told::what)
        .def_readonly("id", &Told::id, "(source, sequence)")
        .def_readonly("receiver", &Told::receiver)
        .def_readonly("incomplete", &Told::incomplete)
        .def_readonly("condition", &Told::condition)
        .def_readonly("file_status", &Told::file_status)
        .def_readonly("to", &Told::to)
        .def_readonly("text", &Told::text);
    py::class_<Progress>(m, "Progress", "How far a transaction is.")
        .def_readonly("done", &Progress::done, "[bytes]")
        .def_readonly("size", &Progress::size, "[bytes]")
        .def_readonly("suspended", &Progress::suspended);
    py::class_<Entity>(m, "Entity", "An entity of CFDP with files in a folder. Times are nanoseconds.")
        .def(py::init<const std::string &, std::uint64_t, std::uint64_t, std::uint64_t, std::int64_t, std::int64_t,
                      unsigned, bool, unsigned>(),
             py::kw_only(), py::arg("folder"), py::arg("own"), py::arg("peer"), py::arg("sequence"), py::arg("timeout"),
             py::arg("inactivity"), py::arg("limit"), py::arg("crc") = false, py::arg("allowed") = 0)
        .def_static("message", &Entity::message, py::arg("type"), py::arg("about") = TransactionId{},
                    py::arg("first") = "", py::arg("second") = "", py::arg("value") = 0,
                    "A message to the user as a TLV: a CfdpMessage.")
        .def_static("read_message", &Entity::read_message, "(type, about, value) of such a message; None: it is none.")
        .def("put", &Entity::put, py::arg("from_"), py::arg("to"), py::arg("options"), py::arg("class1"),
             "(source, sequence), or a CfdpRefusal.")
        .def("time", &Entity::time)
        .def("take", &Entity::take)
        .def("next", &Entity::next, "The next PDU; empty: there is none.")
        .def("told", &Entity::told, "What it told next; None: nothing.")
        .def("progress", &Entity::progress, "Of a transaction; None: it has ended.")
        .def_property_readonly("busy", &Entity::busy)
        .def("freeze", &Entity::freeze, "Whether the link is out: nothing is sent, and timers rest.")
        .def("suspend", &Entity::suspend)
        .def("resume", &Entity::resume)
        .def("cancel", &Entity::cancel);
}

} // namespace fledge::ground
