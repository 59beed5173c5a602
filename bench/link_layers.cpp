// SPDX-License-Identifier: Apache-2.0
// The cost of a packet in each layer of the link.
#include "bench/bench.h"

#include "ccsds/cfdp.h"
#include "ccsds/sdls.h"
#include "ccsds/security/aes_gcm.h"
#include "ccsds/space_link.h"
#include "ccsds/sync.h"
#include "ccsds/tc_frame.h"
#include "ccsds/tm_frame.h"

#include <chrono>
#include <cstring>
#include <memory>
#include <vector>

namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr TmChannel telemetry{77, 1024, 1, 1};
constexpr TcChannel commands{77, 1, 1, 1};
constexpr std::size_t packet_size = 200;

/// An entity of CFDP with one file, whose store does nothing: PDUs of 1000 bytes.
struct Files {
    CfdpRemote remote{};
    std::vector<CfdpTransaction> transactions = std::vector<CfdpTransaction>(1);
    std::vector<CfdpRange> ranges = std::vector<CfdpRange>(16);
    std::vector<CfdpPast> past = std::vector<CfdpPast>(1);
    Bytes pdu = Bytes(2000), data = Bytes(1000, 0x5A);
    Cfdp cfdp{};
    CfdpPdu next{};

    Files(const Files &) = delete;
    explicit Files(bool sends)
    {
        CfdpSetup setup{};
        setup.entity = sends ? 1 : 2;
        setup.store.open = [](void *, const char *, CfdpOpen) { return 0; };
        setup.store.close = [](void *, int) {};
        setup.store.size = [](void *, int) { return std::int64_t{1} << 40; };
        setup.store.read = [](void *, int, std::uint64_t, std::uint8_t *, std::size_t) { return 0; };
        setup.store.write = [](void *, int, std::uint64_t, const std::uint8_t *, std::size_t) { return 0; };
        setup.notify = [](void *, const CfdpEvent *) {};
        setup.remotes = &remote;
        setup.remotes_n = setup.transactions_n = setup.past_n = 1;
        setup.transactions = transactions.data();
        setup.ranges = ranges.data();
        setup.ranges_n = 16;
        setup.past = past.data();
        setup.entity_bytes = setup.sequence_bytes = 2;
        remote.entity = sends ? 2 : 1;
        remote.segment = 1000;
        cfdp_begin(&cfdp, &setup, 1);
        next.source = next.sequence = 1;
        next.destination = 2;
        next.entity_bytes = next.sequence_bytes = 2;
        next.large = 1;
        if (sends) {
            CfdpPut put{};
            put.destination = 2;
            put.from = put.to = "file";
            CfdpId id{};
            cfdp_put(&cfdp, &put, &id);
        } else {
            next.kind = CFDP_METADATA;
            next.offset = std::uint64_t{1} << 40;
            next.from = next.to = {data.data(), 4};
            cfdp_take(&cfdp, pdu.data(), cfdp_pdu_write(&next, pdu.data(), pdu.size()));
            next.kind = CFDP_FILE_DATA;
            next.offset = 0;
            next.from = {};
            next.data = data.data();
            next.n = data.size();
        }
    }
};

/// What a layer takes, made once: a packet, the frames of many, a CLTU.
struct Link {
    Bytes packet = Bytes(packet_size, 0x5A), frame = Bytes(1024), frames, memory = Bytes(65542), cltu = Bytes(2000);
    std::size_t cltu_size = 0;
    std::uint64_t seen = 0; // so that no work is left out
    TmSender sender{};
    TmVirtual channel{};
    TmReceiver receiver{};
    CltuReader reader{};
    // Security: a frame of telemetry and one of commands, both protected once.
    AesGcmKey key{};
    AesGcmKeys keys{&key, 1};
    SdlsAssociation associations[2]{};
    Sdls sdls{};
    TmVirtual secure{};
    std::shared_ptr<void> ends; // of the whole link
    Files sender_of_files{true}, receiver_of_files{false};
    Bytes secured = Bytes(1024), command_memory = Bytes(TM_FRAME_MAX), command_data, telemetry_data;

    Link(const Link &) = delete;
    Link()
    {
        const Bytes secret(32, 0x42);
        aes_gcm_expand(&key, 1, secret.data(), secret.size());
        for (std::uint16_t k = 0; k < 2; k++) {
            associations[k] = {static_cast<std::uint16_t>(k + 1),
                               static_cast<std::uint8_t>(k),
                               1,
                               SDLS_ENCRYPT,
                               64,
                               0,
                               k,
                               SDLS_UNKEYED,
                               0,
                               {},
                               0,
                               0};
            sdls_rekey(&associations[k], 1, 1);
            sdls_start(&associations[k]);
        }
        sdls = {aes_gcm(&keys), associations, 2, {}};
        tm_virtual_begin(&secure, 1, secured.data());
        sdls_tm_protect(&sdls, &secure);
        protect_telemetry();
        telemetry_data.assign(zone(), zone() + tm_zone(&telemetry));
        const TcFrame checked = protected_command();
        command_data.assign(checked.data, checked.data + checked.n);
        write_header();
        const auto keep = [](void *user, const std::uint8_t *bytes, std::size_t n) {
            Link &self = *static_cast<Link *>(user);
            self.frames.insert(self.frames.end(), bytes, bytes + n);
        };
        tm_sender_begin(&sender, &telemetry, keep, this);
        tm_virtual_begin(&channel, 1, frame.data());
        while (frames.size() < 256 * 1024) { // the counts of frames go on when they are read again
            tm_send(&sender, &channel, packet.data(), packet.size());
        }
        sender.sink = [](void *user, const std::uint8_t *, std::size_t n) { static_cast<Link *>(user)->seen += n; };
        const auto count = [](void *user, const std::uint8_t *, std::size_t) { static_cast<Link *>(user)->seen++; };
        tm_receiver_begin(&receiver, 256, memory.data(), memory.size(), count, this);
        cltu_size = command();
        cltu_begin(
            &reader, memory.data(), memory.size(),
            [](void *user, std::uint8_t *bytes, std::size_t n) {
                Link &self = *static_cast<Link *>(user);
                sync_randomise_tc(bytes, n);
                TcFrame tc{};
                self.seen += tc_frame_read(&commands, bytes, n, &tc) == CCSDS_OK;
            },
            this);
    }

    void write_header()
    {
        const SpacePacket head{packet_size, 5, static_cast<std::uint16_t>(seen & 0x3FFF), 0, 1, SPACE_PACKET_WHOLE};
        space_packet_write(&head, packet.data());
    }

    std::uint8_t *zone() { return secured.data() + TM_FRAME_HEADER; }

    bool protect_telemetry() { return secure.protect(&sdls, 1, zone(), tm_zone(&telemetry)) != 0; }

    TcFrame protected_command()
    {
        TcFrame tc{};
        tc.data = packet.data();
        tc.n = packet.size();
        tc.part = SPACE_PACKET_WHOLE;
        seen += sdls_tc_protect(&sdls, &commands, &tc, command_memory.data()) == CCSDS_OK;
        return tc;
    }

    /// The packet as a CLTU.
    std::size_t command()
    {
        TcFrame tc{};
        tc.data = packet.data();
        tc.n = packet.size();
        tc.part = SPACE_PACKET_WHOLE;
        const std::size_t n = tc_frame_write(&commands, &tc, frame.data());
        sync_randomise_tc(frame.data(), n);
        return cltu_write(frame.data(), n, cltu.data());
    }
};

} // namespace

namespace {

// Each returns how many packets it took through its layer at the i-th call.

double header(Link &link, long)
{
    SpacePacket read{};
    link.write_header();
    link.seen += space_packet_read(&read, link.packet.data(), link.packet.size()) == CCSDS_OK;
    return 1;
}

double framed(Link &link, long)
{
    tm_send(&link.sender, &link.channel, link.packet.data(), link.packet.size());
    return 1;
}

double unframed(Link &link, long i)
{
    TmFrame frame{};
    if (tm_frame_read(&telemetry, &link.frames[static_cast<std::size_t>(i % 256) * 1024], 1024, &frame) == CCSDS_OK) {
        tm_receive(&link.receiver, &frame);
    }
    return static_cast<double>(frame.n) / packet_size;
}

double commanded(Link &link, long)
{
    link.seen += link.command();
    return 1;
}

double received(Link &link, long)
{
    cltu_take(&link.reader, link.cltu.data(), link.cltu_size);
    return 1;
}

double telemetry_protected(Link &link, long)
{
    link.seen += link.protect_telemetry();
    return 1;
}

double telemetry_opened(Link &link, long)
{
    TmFrame frame{};
    frame.zone = link.telemetry_data.data();
    frame.n = link.telemetry_data.size();
    frame.virtual_channel = 1;
    link.associations[0].next = 1; // it is new each time
    link.seen += sdls_tm_open(&link.sdls, &frame, link.memory.data()) == CCSDS_OK;
    return 1;
}

double command_protected(Link &link, long)
{
    (void)link.protected_command();
    return 1;
}

double command_checked(Link &link, long)
{
    TcFrame tc{};
    SdlsReceipt receipt{};
    tc.data = link.command_data.data();
    tc.n = link.command_data.size();
    tc.part = SPACE_PACKET_WHOLE;
    link.associations[1].next = 1;
    link.seen += sdls_tc_check(&link.sdls, &commands, &tc, link.memory.data(), &receipt) == CCSDS_OK;
    return 1;
}

/// Both ends of the whole link: CLTUs, randomised, COP-1; all that is sent arrives at once.
struct Ends {
    static constexpr SpaceLinkSetup setup{commands, telemetry, 1, 0, 1, 1, 1, 1, 100, 1};
    SdlsAssociation of_craft[2], of_ground[2];
    Sdls craft_sdls, ground_sdls;
    SpaceLinkSecurity craft_security{&craft_sdls, &sdls_functions}, ground_security{&ground_sdls, &sdls_functions};
    const SpaceLinkSecurity *security;
    SpaceLinkCraft craft{};
    std::unique_ptr<SpaceLinkGround> ground = std::make_unique<SpaceLinkGround>();
    std::size_t delivered = 0;

    Ends(const Ends &) = delete;
    Ends(Link &link, bool secured)
        : of_craft{link.associations[0], link.associations[1]}, of_ground{link.associations[0], link.associations[1]},
          craft_sdls{link.sdls.cipher, of_craft, 2, {}}, ground_sdls{link.sdls.cipher, of_ground, 2, {}},
          security(secured ? &craft_security : nullptr)
    {
        space_link_craft_begin(&craft, &setup);
        const auto ignore = [](void *, const std::uint8_t *, std::size_t) {};
        const SpaceLinkSinks sinks{
            [](void *self, const std::uint8_t *unit, std::size_t n) { static_cast<Ends *>(self)->take(unit, n); },
            ignore, [](void *, SpaceLinkAnswer, std::uint32_t) {}, this};
        space_link_ground_begin(ground.get(), &setup, secured ? &ground_security : nullptr, &sinks, 1'000'000'000, 10);
        flush();
    }
    void take(const std::uint8_t *unit, std::size_t n)
    {
        const auto count = [](void *self, const std::uint8_t *, std::size_t, std::uint16_t) {
            static_cast<Ends *>(self)->delivered++;
        };
        space_link_craft_take(&craft, &setup, security, unit, n, 1, count, this);
    }
    static void down(void *self, const std::uint8_t *frame, std::size_t n)
    {
        space_link_ground_take(static_cast<Ends *>(self)->ground.get(), frame, n);
    }
    void flush() { space_link_craft_flush(&craft, &setup, security, 0, down, this); }
    std::size_t exchange(const Bytes &packet)
    {
        space_link_ground_send(ground.get(), 1, packet.data(), packet.size());
        space_link_craft_send(&craft, &setup, security, packet.data(), packet.size(), down, this);
        flush();
        return delivered;
    }
};

template <bool secured> double both_ends(Link &link, long)
{
    if (!link.ends) {
        link.ends = std::make_shared<Ends>(link, secured);
    }
    link.seen = std::static_pointer_cast<Ends>(link.ends)->exchange(link.packet);
    return 1;
}

double file_sent(Link &link, long)
{
    Files &files = link.sender_of_files;
    link.seen += cfdp_next(&files.cfdp, nullptr, files.pdu.data(), files.pdu.size());
    return 1;
}

double file_received(Link &link, long)
{
    Files &files = link.receiver_of_files;
    cfdp_take(&files.cfdp, files.pdu.data(), cfdp_pdu_write(&files.next, files.pdu.data(), files.pdu.size()));
    files.next.offset += files.next.n;
    link.seen = files.transactions[0].progress; // all came
    return 1;
}

constexpr struct {
    const char *name;
    double (*take)(Link &link, long i);
} layers[] = {{"header", header},
              {"telemetry, framed", framed},
              {"telemetry, read", unframed},
              {"command, as a CLTU", commanded},
              {"command, read", received},
              {"frame of telemetry, protected", telemetry_protected},
              {"frame of telemetry, opened", telemetry_opened},
              {"frame of a command, protected", command_protected},
              {"frame of a command, checked", command_checked},
              {"link, up and down", both_ends<false>},
              {"link, up and down, secured", both_ends<true>},
              {"PDU of a file, sent", file_sent},
              {"PDU of a file, written and received", file_received}};

} // namespace

double time_link_layer(const char *layer, long n)
{
    for (const auto &each : layers) {
        if (std::strcmp(each.name, layer) == 0) {
            Link link;
            const auto start = std::chrono::steady_clock::now();
            double packets = 0;
            for (long i = 0; i < n; i++) {
                packets += each.take(link, i);
            }
            const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
            return link.seen == 0 ? -1 : elapsed.count() / packets;
        }
    }
    return -1;
}
