// SPDX-License-Identifier: Apache-2.0
// The ground's end of a link of frames for Python.
#include "ccsds/security/key_file.h"
#include "ccsds/space_link.h"
#include "ground/python/loaded.h"

#include <algorithm>

namespace fledge::ground {

namespace {

class LinkEnd {
public:
    /// For frames with security: the file of keys, SdlsService, association and key of commands and of telemetry, the
    /// least number of the first command, and a session number that is unique among the ends with this key.
    using Secrets = std::tuple<std::string, int, int, int, int, int, std::uint64_t, std::uint32_t>;
    using Setup = core::Typed<py::dict, "dict[str, int]">;

    LinkEnd(const Setup &given, std::int64_t timer, int limit, const std::optional<Secrets> &secrets)
    {
        const auto of = [&](const char *name) { return given[name].cast<std::uint16_t>(); };
        const auto byte = [&](const char *name) { return given[name].cast<std::uint8_t>(); };
        const SpaceLinkSetup setup{{of("spacecraft"), byte("command_channel"), byte("segments"), 1},
                                   {of("spacecraft"), of("frame_size"), byte("cop1"), 1},
                                   byte("telemetry_channel"),
                                   byte("map"),
                                   byte("cltu"),
                                   byte("tc_random"),
                                   byte("tm_random"),
                                   byte("marker"),
                                   byte("window"),
                                   byte("cop1")};
        if (!space_link_is_possible(&setup, secrets.has_value())) {
            throw py::value_error("there is no such link");
        }
        if (secrets) {
            secure(setup, *secrets);
        }
        const SpaceLinkSinks sinks{[](void *user, const std::uint8_t *unit, std::size_t n) {
                                       static_cast<LinkEnd *>(user)->units_.emplace_back(unit, unit + n);
                                   },
                                   [](void *user, const std::uint8_t *packet, std::size_t n) {
                                       static_cast<LinkEnd *>(user)->packets_.emplace_back(packet, packet + n);
                                   },
                                   [](void *user, SpaceLinkAnswer answer, std::uint32_t tag) {
                                       static_cast<LinkEnd *>(user)->answers_.emplace_back(tag,
                                                                                           answer != SPACE_LINK_FAILED);
                                   },
                                   this};
        const SpaceLinkSecurity security{&sdls_, &sdls_functions};
        space_link_ground_begin(end_.get(), &setup, secrets ? &security : nullptr, &sinks, timer,
                                static_cast<std::uint8_t>(limit));
    }
    LinkEnd(const LinkEnd &) = delete;

    /// False: not now. Raises ValueError if the packet does not fit into a frame.
    bool send(std::uint32_t tag, const py::bytes &packet)
    {
        const auto bytes = octets(packet);
        if (!space_link_ground_is_ready(end_.get())) {
            return false;
        }
        if (!space_link_ground_send(end_.get(), tag, bytes.data(), bytes.size())) {
            throw py::value_error("a command of " + std::to_string(bytes.size()) +
                                  " bytes does not fit into a frame; a link with segments takes up to " +
                                  std::to_string(int{SPACE_LINK_PACKET}));
        }
        return true;
    }

    std::vector<py::bytes> take(const py::bytes &received)
    {
        const auto bytes = octets(received);
        space_link_ground_take(end_.get(), bytes.data(), bytes.size());
        return moved(packets_);
    }

    std::vector<py::bytes> units() { return moved(units_); }

    std::vector<std::pair<std::uint32_t, bool>> answers() { return std::exchange(answers_, {}); }

    void time(std::int64_t t) { space_link_ground_time(end_.get(), t); }
    std::int64_t due() const { return space_link_ground_due(end_.get()); }
    std::uint64_t number() const { return associations_[0].next; }

    core::Typed<py::dict, "dict[str, int]"> counts() const
    {
        static const char *const names[CCSDS_FAULTS] = {"ok",      "short",       "length", "version", "spacecraft",
                                                        "channel", "crc",         "type",   "gap",     "room",
                                                        "stray",   "association", "tag",    "replay"};
        py::dict counts;
        counts["frames"] = end_->receiver.frames;
        counts["missing"] = end_->receiver.missing;
        counts["clcws"] = end_->clcws;
        counts["ends"] = end_->alerts;
        counts["skipped"] = end_->skipped + end_->sync.skipped;
        const PacketZone &zone = end_->receiver.zone;
        const std::uint32_t unread =
            zone.faults[CCSDS_VERSION] + zone.faults[CCSDS_LENGTH] + zone.faults[CCSDS_ROOM] + zone.faults[CCSDS_GAP];
        for (const auto &[name, n] : {std::pair("encapsulated", zone.encapsulated), std::pair("unread", unread),
                                      std::pair("repeated", end_->receiver.repeated)}) {
            if (n != 0) {
                counts[name] = n;
            }
        }
        for (std::size_t i = 1; i < CCSDS_FAULTS; i++) {
            if (end_->faults[i] != 0) {
                counts[names[i]] = end_->faults[i];
            }
        }
        return counts;
    }

    /// The state of FOP-1, the flags of the last CLCW, and why the service last ended.
    core::Typed<py::dict, "dict[str, Any]"> cop1() const
    {
        static const char *const states[] = {
            "",       "active", "sends again", "sends again, receiver full", "waits for a CLCW", "sets up the receiver",
            "initial"};
        static const char *const alerts[] = {"",
                                             "a frame was asked for more often than allowed",
                                             "no confirmation of a frame came",
                                             "the receiver is locked out",
                                             "the CLCW contradicts what was sent",
                                             "the CLCW has a number that was not sent",
                                             "the CLCW's flags contradict one another",
                                             "the link refused a frame",
                                             "terminated"};
        py::dict state;
        state["state"] = states[end_->fop.state];
        state["ended"] = alerts[end_->alert];
        const Clcw &last = end_->clcw;
        const std::pair<const char *, std::uint8_t> flags[] = {{"no_rf", last.no_rf},
                                                               {"no_bit_lock", last.no_bit_lock},
                                                               {"lockout", last.lockout},
                                                               {"wait", last.wait},
                                                               {"retransmit", last.retransmit}};
        for (const auto &[name, flag] : flags) {
            if (end_->clcws != 0) {
                state[name] = flag != 0;
            }
        }
        return state;
    }

private:
    void secure(const SpaceLinkSetup &setup, const Secrets &secrets)
    {
        const auto &[path, service, spi, key, tm_spi, tm_key, first, session] = secrets;
        char why[400] = "";
        keys_.n = key_file_read(path.c_str(), expanded_.data(), expanded_.size(), why, sizeof why);
        if (keys_.n == 0) {
            throw py::value_error(why);
        }
        const auto association_of = [&, &file = path, service_kind = service](
                                        int id, int with, bool command, std::uint8_t channel, std::uint64_t next) {
            if (std::none_of(expanded_.begin(), expanded_.begin() + static_cast<std::ptrdiff_t>(keys_.n),
                             [&](const AesGcmKey &candidate) { return candidate.id == with; })) {
                throw py::value_error(file + " has no key " + std::to_string(with));
            }
            SdlsAssociation association{};
            association.spi = static_cast<std::uint16_t>(id);
            association.fixed = static_cast<std::uint32_t>(id);
            association.telecommand = command;
            association.virtual_channel = channel;
            association.service = static_cast<std::uint8_t>(service_kind);
            association.window = 1;
            sdls_rekey(&association, static_cast<std::uint16_t>(with), next);
            sdls_start(&association);
            return association;
        };
        associations_ = {association_of(spi, key, true, setup.commands.virtual_channel, first),
                         association_of(tm_spi, tm_key, false, setup.virtual_channel, 0)};
        associations_[0].fixed |= session << 3;
        sdls_ = {aes_gcm(&keys_), associations_.data(), 2, {}};
    }

    static std::vector<py::bytes> moved(std::vector<std::vector<std::uint8_t>> &from)
    {
        std::vector<py::bytes> packets;
        for (const auto &packet : std::exchange(from, {})) {
            packets.push_back(bytes_of(packet));
        }
        return packets;
    }

    std::unique_ptr<SpaceLinkGround> end_ = std::make_unique<SpaceLinkGround>();
    std::array<AesGcmKey, 16> expanded_{};
    AesGcmKeys keys_{expanded_.data(), 0};
    std::array<SdlsAssociation, 2> associations_{};
    Sdls sdls_{};
    std::vector<std::vector<std::uint8_t>> units_, packets_;
    std::vector<std::pair<std::uint32_t, bool>> answers_;
};

} // namespace

void bind_link_end(py::module_ &m)
{
    py::class_<LinkEnd>(m, "SpaceLink", "The ground's end of a link of frames, ccsds/space_link.h.")
        .def(py::init<const LinkEnd::Setup &, std::int64_t, int, const std::optional<LinkEnd::Secrets> &>(),
             py::arg("setup"), py::arg("timer"), py::arg("limit"), py::arg("secrets") = py::none())
        .def("send", &LinkEnd::send, py::arg("tag"), py::arg("packet"), "False: the link is not ready, send it later.")
        .def("take", &LinkEnd::take, py::arg("bytes"), "The packets in received bytes.")
        .def("units", &LinkEnd::units, "The units to send.")
        .def("answers", &LinkEnd::answers, "(tag, whether the spacecraft has it) since the last call.")
        .def("time", &LinkEnd::time, py::arg("t"), "Set the time to t [ns].")
        .def_property_readonly("due", &LinkEnd::due, "[ns] when `time` must be called next.")
        .def_property_readonly("number", &LinkEnd::number, "Of the next secured command.")
        .def_property_readonly("counts", &LinkEnd::counts)
        .def_property_readonly("cop1", &LinkEnd::cop1);
}

} // namespace fledge::ground
