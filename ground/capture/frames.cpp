// SPDX-License-Identifier: Apache-2.0
#include "ground/capture/frames.h"

#include "ccsds/sync.h"
#include "ccsds/tm_frame.h"
#include "ground/capture/reed_solomon.h"

#include <algorithm>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <utility>

namespace fledge::ground {

namespace {

/// A virtual channel, whose packets become pieces of the file.
struct Virtual {
    std::vector<Piece> *pieces;
    std::size_t at = 0;
    std::vector<std::uint8_t> memory = std::vector<std::uint8_t>(SPACE_PACKET_MAX);
    TmReceiver receiver{};
};

const char *fault_text(CcsdsFault fault)
{
    switch (fault) {
    case CCSDS_CRC: return "its CRC does not hold";
    case CCSDS_TYPE: return "it has no packets, but data of its virtual channel's own";
    default: return "its header does not hold";
    }
}

/// The name of a frame's version, the first 2 bits.
std::string kind(unsigned version, unsigned first)
{
    return version == 0       ? "TM"
           : version == 1     ? "AOS"
           : first >> 4 == 12 ? "USLP"
                              : "version " + std::to_string(version);
}

/// The header error control of AOS (732.0-B-4, 4.1.2.6): a Reed-Solomon code of 10 symbols of 4 bits over the first two
/// bytes and the sixth, whose roots are a^6 to a^9, with a^4 = a + 1.
bool header_check_holds(const std::uint8_t *frame)
{
    static const std::uint8_t power[] = {1, 2, 4, 8, 3, 6, 12, 11, 5, 10, 7, 14, 15, 13, 9};
    for (unsigned root = 6; root < 10; root++) {
        unsigned sum = 0;
        unsigned place = 10;
        for (const std::uint8_t byte : {frame[0], frame[1], frame[5], frame[6], frame[7]}) {
            for (const unsigned symbol : {static_cast<unsigned>(byte >> 4), byte & 15u}) {
                place--;
                for (unsigned log = 0; symbol != 0 && log < 15; log++) {
                    sum ^= power[log] == symbol ? power[(log + root * place) % 15] : 0u;
                }
            }
        }
        if (sum != 0) {
            return false;
        }
    }
    return true;
}

/// Reads the frames of a file.
class Frames {
public:
    Frames(std::span<const std::uint8_t> bytes, const FrameFormat &format)
        : bytes_(bytes), format_(format), block_(format.size + format.code * reed_solomon_check)
    {
        const auto refuse = [](const std::string &why) { throw std::invalid_argument(why); };
        if (format.size <= TM_FRAME_HEADER + TM_CONTROL + TM_CHECK || format.size > TM_FRAME_MAX) {
            refuse("a frame has 13 to " + std::to_string(TM_FRAME_MAX) + " bytes, not " + std::to_string(format.size));
        }
        if (format.code > 16 ||
            (format.code && (format.size % format.code != 0 ||
                             format.size / format.code > reed_solomon_length - reed_solomon_check))) {
            refuse("a frame of " + std::to_string(format.size) + " bytes has no Reed-Solomon code of depth " +
                   std::to_string(format.code) +
                   ": the depth is 1 to 16, divides the size, and leaves 223 bytes or "
                   "fewer to a code word");
        }
        if (format.insert > format.size) {
            refuse("an insert zone of " + std::to_string(format.insert) + " bytes does not fit into a frame of " +
                   std::to_string(format.size));
        }
    }

    /// The frame that begins there, decoded; nullptr: the file ends within it.
    const std::uint8_t *read(std::size_t at)
    {
        if (at + format_.size > bytes_.size() || at + block_.size() > bytes_.size()) {
            return nullptr;
        }
        std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(at), block_.size(), block_.begin());
        if (format_.randomized) {
            sync_randomise_tm(block_.data(), block_.size());
        }
        corrected = format_.code ? reed_solomon_correct(block_, format_.code) : 0;
        return block_.data();
    }
    std::size_t step() const { return format_.skip + block_.size() + format_.trailer; }

    std::optional<std::size_t> corrected; ///< symbols of the last frame; nothing: too many are wrong

private:
    std::span<const std::uint8_t> bytes_;
    FrameFormat format_;
    std::vector<std::uint8_t> block_;
};

/// The properties that all frames share.
struct Common {
    unsigned version = 0, first = 0, spacecraft = 0;
    bool check = false, header_check = false;
};

unsigned spacecraft_of(const std::uint8_t *frame)
{
    const unsigned id = ccsds_get16(frame);
    return id >> 14 == 0 ? id >> 4 & 0x3FFu : id >> 6 & 0xFFu;
}

/// The properties of the majority of the first frames; only frames with a right CRC count, if there are any.
Common common_of(Frames &frames, const FrameFormat &format)
{
    std::map<std::pair<unsigned, unsigned>, unsigned> votes;
    Common common;
    unsigned most = 0, headers = 0;
    std::size_t at = format.skip;
    for (int i = 0; i < 16; i++, at += frames.step()) {
        const std::uint8_t *frame = frames.read(at);
        if (frame == nullptr) {
            break;
        }
        const bool holds = ccsds_crc16(frame, format.size) == 0;
        if (holds && !common.check) {
            votes.clear();
            common.check = true;
            most = headers = 0;
        }
        if (!frames.corrected || holds != common.check) {
            continue;
        }
        headers += header_check_holds(frame);
        const unsigned version = frame[0] >> 6, spacecraft = spacecraft_of(frame);
        const unsigned n = ++votes[{version, spacecraft}];
        if (n > most) {
            most = n;
            common.version = version;
            common.first = frame[0];
            common.spacecraft = spacecraft;
        }
    }
    common.header_check = most != 0 && 2 * headers > most;
    return common;
}

/// Messages about what the receiver refused since `before`.
std::vector<std::string> refused(const Virtual &source, const PacketZone &before, const TmFrame &frame)
{
    const PacketZone &zone = source.receiver.zone;
    const std::string channel = "virtual channel " + std::to_string(frame.virtual_channel);
    std::vector<std::string> all;
    if (zone.faults[CCSDS_VERSION] != before.faults[CCSDS_VERSION]) {
        all.push_back(
            channel + " has a packet of version " + std::to_string(zone.memory[0] >> 5) +
            ", which is not read: what is behind it is left out up to the next packet that a frame points to");
    }
    if (zone.faults[CCSDS_LENGTH] != before.faults[CCSDS_LENGTH]) {
        all.push_back("a packet of " + channel + " is left out: it does not end where its frames say");
    }
    if (zone.faults[CCSDS_ROOM] != before.faults[CCSDS_ROOM]) {
        all.push_back("a packet of " + channel + " is left out: it has more than " + std::to_string(SPACE_PACKET_MAX) +
                      " bytes");
    }
    if (frame.first != PACKET_ZONE_IDLE && frame.first != PACKET_ZONE_NONE && frame.first >= frame.n) {
        all.push_back("a frame of " + channel + " points to a packet behind its end");
    }
    return all;
}

/// Collects the packets of successive frames.
class Receiver {
public:
    Receiver(Frames &frames, const FrameFormat &format, const Common &common)
        : frames_(frames), format_(format), common_(common),
          name_(kind(common.version, common.first)), channel_{static_cast<std::uint16_t>(common.spacecraft),
                                                              static_cast<std::uint16_t>(format.size), 0,
                                                              static_cast<std::uint8_t>(common.check)}
    {
    }

    void read_frame(const std::uint8_t *frame, std::size_t at)
    {
        TmFrame parts{};
        if (const std::string why = read(frame, parts); !why.empty()) {
            problem(at, "a frame is passed over: " + why);
            return;
        }
        read_++;
        if (common_.version == 0 || parts.virtual_channel != AOS_CHANNELS - 1) { // else a fill frame
            receive(parts, at);
        }
    }

    void problem(std::size_t at, std::string problem) { pieces.push_back({at, {}, std::move(problem), ""}); }

    std::string summary() const
    {
        std::uint32_t idle = 0, repeated = 0;
        std::string unfinished;
        for (const auto &[number, channel] : channels_) {
            const PacketZone &zone = channel->receiver.zone;
            idle += zone.idle;
            repeated += channel->receiver.repeated;
            if (zone.n + zone.skip != 0) {
                unfinished += "; virtual channel " + std::to_string(number) + " ends within a packet";
            }
        }
        return std::to_string(read_) + " " + name_ + " frames of spacecraft " + std::to_string(common_.spacecraft) +
               ", " + std::to_string(idle) + " idle packets" +
               (repeated ? ", " + std::to_string(repeated) + " repeated frames passed over" : "") +
               (format_.code ? ", " + std::to_string(corrected_) + " symbols corrected" : "") + unfinished;
    }

    std::vector<Piece> pieces;

private:
    /// Returns "", or why the frame cannot be read.
    std::string read(const std::uint8_t *frame, TmFrame &parts)
    {
        if (!frames_.corrected) {
            return "its Reed-Solomon code has too many wrong symbols";
        }
        corrected_ += *frames_.corrected;
        const unsigned version = frame[0] >> 6;
        if (common_.check && ccsds_crc16(frame, format_.size) != 0) {
            return fault_text(CCSDS_CRC);
        }
        if (version != common_.version) {
            return "it is of " + kind(version, frame[0]) + ", the others are of " + name_;
        }
        if (spacecraft_of(frame) != common_.spacecraft) {
            return "it is of another spacecraft";
        }
        if (common_.header_check && !header_check_holds(frame)) {
            return "the check of its header does not hold";
        }
        const CcsdsFault fault =
            version == 0 ? tm_frame_read(&channel_, frame, format_.size, &parts)
                         : aos_frame_read(frame, format_.size, format_.insert + (common_.header_check ? 2u : 0u),
                                          format_.control, common_.check, &parts);
        return fault != CCSDS_OK ? fault_text(fault) : "";
    }

    void receive(const TmFrame &parts, std::size_t at)
    {
        auto &channel = channels_[parts.virtual_channel];
        if (!channel) {
            channel = std::make_unique<Virtual>(Virtual{&pieces});
            const auto store = [](void *user, const std::uint8_t *packet, std::size_t n) {
                const Virtual &self = *static_cast<Virtual *>(user);
                self.pieces->push_back({self.at, {packet, packet + n}, "", ""});
            };
            tm_receiver_begin(&channel->receiver, common_.version == 0 ? 256 : 1u << 24, channel->memory.data(),
                              channel->memory.size(), store, channel.get());
            channel->receiver.zone.encapsulation = store;
        }
        const TmReceiver before = channel->receiver;
        channel->at = at;
        tm_receive(&channel->receiver, &parts);
        if (channel->receiver.missing != before.missing) {
            problem(at, std::to_string(channel->receiver.missing - before.missing) + " frames of virtual channel " +
                            std::to_string(parts.virtual_channel) + " are missing in front of this one");
        }
        for (std::string &why : refused(*channel, before.zone, parts)) {
            problem(at, std::move(why));
        }
    }

    Frames &frames_;
    const FrameFormat &format_;
    const Common &common_;
    const std::string name_;
    const TmChannel channel_;
    std::map<unsigned, std::unique_ptr<Virtual>> channels_;
    std::size_t read_ = 0, corrected_ = 0;
};

} // namespace

std::vector<Piece> packets_of_frames(std::span<const std::uint8_t> bytes, const FrameFormat &format)
{
    Frames frames(bytes, format);
    const Common common = common_of(frames, format);
    Receiver receiver(frames, format, common);
    if (common.version > 1) {
        receiver.problem(format.skip, "the frames are of " + kind(common.version, common.first) +
                                          ", which is not read: TM and AOS are");
        return std::move(receiver.pieces);
    }
    std::size_t at = format.skip;
    for (const std::uint8_t *frame; (frame = frames.read(at)) != nullptr; at += frames.step()) {
        receiver.read_frame(frame, at);
    }
    if (at < bytes.size() + format.skip) {
        receiver.problem(at - format.skip, "the file ends within a frame");
    }
    receiver.pieces.push_back({at, {}, "", receiver.summary()});
    return std::move(receiver.pieces);
}

} // namespace fledge::ground
