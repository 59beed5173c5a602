// SPDX-License-Identifier: Apache-2.0
#include "ground/capture/packets.h"

#include "ccsds/space_packet.h"

#include <algorithm>
#include <cstdio>
#include <map>
#include <optional>
#include <utility>

namespace fledge::ground {

namespace {

constexpr unsigned near_counts = 256, steps = 64, waiting = 4;

/// The header of what may be a packet.
struct Head {
    std::size_t at, begin, end;           ///< where the bytes before it begin; its own begin and end
    unsigned id = 0, count = 0, part = 0; ///< of a space packet
    bool is_space = false;
};

/// Whether other parts of its unit of data follow a part.
bool goes_on(unsigned part)
{
    return part == SPACE_PACKET_FIRST || part == SPACE_PACKET_MIDDLE;
}

/// The last packet of an application.
struct Last {
    unsigned count, part;
    bool stays;  ///< the counts may be constant
    bool opened; ///< its unit goes on, and the first part of it came

    Last behind(const Head &head) const
    {
        return {head.count, head.part, count == head.count,
                head.part == SPACE_PACKET_FIRST || (opened && head.part == SPACE_PACKET_MIDDLE)};
    }
    static Last first(const Head &head) { return {head.count, head.part, true, head.part == SPACE_PACKET_FIRST}; }
};

/// Whether a packet may follow an earlier one of its application, by their counts and parts. Where packets between them
/// are missing, any part may; and the parts of a unit whose first one came may have one count.
bool is_behind(const Head &head, const Last &last, unsigned furthest = near_counts)
{
    const unsigned on = (head.count - last.count) & (SPACE_PACKET_COUNTS - 1u);
    const bool fits = goes_on(last.part) == (head.part != SPACE_PACKET_FIRST);
    return on == 0 ? last.opened && (head.part & SPACE_PACKET_FIRST) == 0
                   : on <= furthest && (on != 1 || head.part == SPACE_PACKET_WHOLE || fits);
}

/// A packet whose end nothing confirms yet.
struct Waiting {
    Head head;
    std::optional<Last> before; ///< of its application
    const char *doubt;
};

class Stream {
public:
    Stream(std::span<const std::uint8_t> bytes, std::size_t skip) : bytes_(bytes), skip_(skip) {}

    std::vector<Piece> read()
    {
        std::size_t at = read_led();
        while (!ends(at)) {
            const std::optional<Head> head = next(at, true);
            if (head && head->end - head->begin == 1) { // a fill packet
                at = head->end;
                continue;
            }
            const bool known = head && continues_known(*head);
            const bool follows =
                head && (head->at == at || !is_known_inside(at, head->at)); // what is between is padding
            if (known && follows) {
                release();
            }
            const bool sure = follows && (known || is_begun(*head, known_.empty()));
            if (sure || (follows && may_be(*head))) {
                const char *doubt = "";
                if (sure && !known_.empty() ? are_known_inside(*head)
                                            : known_.empty() && first_continued(head->at + 1, head->end)) {
                    doubt = "other packets seem to begin inside of it";
                } else if (!sure && head->is_space && head->part != SPACE_PACKET_WHOLE) {
                    doubt = "it is a part without those before and behind it";
                }
                if (waiting_.size() == waiting) {
                    release_first();
                }
                wait(*head, doubt);
                at = head->end;
                continue;
            }
            at = behind_damage(at, head.has_value());
        }
        release();
        return std::move(pieces_);
    }

private:
    std::span<const std::uint8_t> bytes_;
    std::size_t skip_;
    std::vector<Piece> pieces_;
    std::map<unsigned, Last> known_; ///< by their first two bytes
    std::vector<Waiting> waiting_;

    const std::uint8_t *data(std::size_t at) const { return bytes_.data() + at; }

    /// Read a file in which the lengths lead from packet to packet to its end, or into one that continues those before
    /// and is cut off: each is one, whatever its part. Returns where they end; 0, and nothing is read, if they lead
    /// elsewhere.
    std::size_t read_led()
    {
        std::size_t at = 0;
        for (std::optional<Head> head; !ends(at) && (head = complete(at, true)); at = head->end) {
            if (head->end - head->begin > 1) { // else a fill packet
                wait(*head, "");
                release();
            }
        }
        const std::optional<Head> cut = begins(at, true);
        if (ends(at) || (cut && cut->end > bytes_.size() && continues_known(*cut))) {
            return at;
        }
        known_.clear();
        pieces_.clear();
        return 0;
    }

    /// The header of what may be a packet there, even if the file ends within it. led: lengths lead there, so it may be
    /// a part for application 0, which otherwise is rather padding.
    std::optional<Head> begins(std::size_t at, bool led = false) const
    {
        const std::size_t begin = at + skip_;
        std::uint32_t size = 0;
        if (begin >= bytes_.size()) {
            return std::nullopt;
        }
        (void)packet_size(data(begin), bytes_.size() - begin, &size);
        Head head{at, begin, begin + size};
        head.is_space = *data(begin) >> 5 == 0;
        if (size == 0) {
            return std::nullopt;
        }
        if (head.is_space) {
            head.id = ccsds_get16(data(begin));
            head.count = ccsds_get16(data(begin + 2)) & (SPACE_PACKET_COUNTS - 1u);
            head.part = data(begin + 2)[0] >> 6;
            if (head.id == 0 && head.part != SPACE_PACKET_WHOLE && (!led || (head.part == 0 && head.count == 0))) {
                return std::nullopt;
            }
        }
        return head;
    }
    std::optional<Head> complete(std::size_t at, bool led = false) const
    {
        std::optional<Head> head = begins(at, led);
        return head && head->end <= bytes_.size() ? head : std::nullopt;
    }
    std::size_t behind_zeros(std::size_t at) const
    {
        const auto first = std::find_if(bytes_.begin() + static_cast<std::ptrdiff_t>(std::min(at, bytes_.size())),
                                        bytes_.end(), [](std::uint8_t byte) { return byte != 0; });
        return static_cast<std::size_t>(first - bytes_.begin());
    }
    bool ends(std::size_t at) const { return behind_zeros(at) == bytes_.size(); }

    /// The packet that begins there or behind padding. The best candidate continues known packets, the second best (if
    /// `ahead`) is continued by later ones, the third is whole.
    std::optional<Head> next(std::size_t at, bool ahead = false) const
    {
        std::optional<Head> best_head = complete(at);
        if (at >= bytes_.size() || bytes_[at] != 0) {
            return best_head;
        }
        const auto rank = [&](const std::optional<Head> &head) {
            const bool whole = head && head->is_space && head->part == SPACE_PACKET_WHOLE && head->id != 0;
            return !head ? 0 : continues_known(*head) ? 4 : ahead && is_begun(*head) ? 3 : whole ? 2 : 1;
        };
        int best = rank(best_head);
        const std::size_t zeros = behind_zeros(at); // a header may begin with up to two of them
        std::size_t from = std::max(at + 1, zeros - std::min(zeros, skip_ + 2));
        for (; best < 4 && from <= zeros && from < bytes_.size(); from++) {
            const std::optional<Head> candidate = complete(from);
            if (const int good = rank(candidate); good > best) {
                best = good;
                best_head = candidate;
            }
        }
        return best_head;
    }

    bool continues_known(const Head &head) const
    {
        const auto before = known_.find(head.id);
        if (!head.is_space || before == known_.end()) {
            return false;
        }
        const Last &last = before->second;
        return is_behind(head, last) || (last.stays && head.count == last.count && head.part == last.part);
    }
    /// Whether later packets continue it: one, or two with the same count; three of a part that begins no unit, or all
    /// up to the end. In small numbers many places look like such a part: it counts only where the bytes before it
    /// `lead` there.
    bool is_begun(const Head &first, bool lead = false) const
    {
        const bool begins_unit = (first.part & SPACE_PACKET_FIRST) != 0;
        if (!begins_unit && !lead) {
            return false;
        }
        std::optional<Head> step = first;
        Last last = Last::first(first);
        unsigned same = 0, behind = 0;
        for (unsigned i = 0; i < steps && (step = next(step->end)); i++) {
            if (!step->is_space || step->id != first.id) {
                continue;
            }
            if (step->count == last.count && step->part == SPACE_PACKET_WHOLE && last.part == SPACE_PACKET_WHOLE) {
                if (++same == 2) {
                    return true;
                }
            } else if (!is_behind(*step, last, goes_on(last.part) ? 1 : near_counts)) {
                return false;
            } else if (++behind == (begins_unit ? 1 : 3) || ends(step->end)) {
                return true;
            }
            last = last.behind(*step);
        }
        return false;
    }
    /// Whether two more packets or the end of the file follow it, and one of these or itself ends after `behind`.
    bool is_followed(const Head &first, std::size_t behind) const
    {
        std::optional<Head> step = first;
        for (unsigned i = 0; step && i < steps && step->end != behind; i++, step = next(step->end)) {
            if ((i >= 2 || ends(step->end)) && step->end > behind) {
                return true;
            }
        }
        return false;
    }

    /// Whether it may be a packet although it continues none.
    bool may_be(const Head &head) const
    {
        if (head.is_space && head.part != SPACE_PACKET_WHOLE) { // a part, only if a packet or the end follows
            const std::optional<Head> behind = next(head.end);
            if (!ends(head.end) && (!behind || (!continues_known(*behind) && !is_begun(*behind)))) {
                return false;
            }
        }
        return known_.empty() || !is_known_inside(head.at, head.end);
    }
    /// Whether a packet that continues known ones begins in this range or inside of the packet before it.
    bool is_known_inside(std::size_t from, std::size_t to) const
    {
        for (std::size_t at = waiting_.empty() ? from + 1 : waiting_.back().head.at + 1; at < to; at++) {
            if (at == from) {
                continue;
            }
            const std::optional<Head> candidate = complete(at);
            if (candidate && continues_known(*candidate) && is_followed(*candidate, 0)) {
                return true;
            }
        }
        return false;
    }
    /// Whether two successive packets that continue known ones begin inside of it, or the second at its end.
    bool are_known_inside(const Head &outer) const
    {
        for (std::size_t at = outer.at + 1; at < outer.end; at++) {
            const std::optional<Head> first = complete(at);
            if (first && first->end <= outer.end && continues_known(*first)) {
                const std::optional<Head> second = next(first->end);
                if (second && continues_known(*second)) {
                    return true;
                }
            }
        }
        return false;
    }
    /// The first packet from there on that later ones continue, or that continues a known one.
    std::optional<Head> first_continued(std::size_t at, std::size_t before, std::size_t behind = 0) const
    {
        for (; at < before; at++) {
            const std::optional<Head> candidate = complete(at);
            if (candidate && (continues_known(*candidate) || is_begun(*candidate)) &&
                is_followed(*candidate, at < behind ? behind : 0)) {
                return candidate;
            }
        }
        return std::nullopt;
    }

    void wait(const Head &head, const char *doubt)
    {
        std::optional<Last> before;
        if (head.is_space && *doubt == '\0') {
            const auto [place, fresh] = known_.try_emplace(head.id);
            before = fresh ? std::nullopt : std::optional(place->second);
            place->second = fresh ? Last::first(head) : before->behind(head);
        }
        waiting_.push_back({head, before, doubt});
    }
    void forget_last()
    {
        const auto &[head, before, doubt] = waiting_.back();
        if (before) {
            known_[head.id] = *before;
        } else if (head.is_space && *doubt == '\0') {
            known_.erase(head.id);
        }
        waiting_.pop_back();
    }
    void release_first(const char *otherwise = "")
    {
        const auto &[head, before, doubt] = waiting_.front();
        pieces_.push_back({head.begin,
                           {data(head.begin), data(head.begin) + (head.end - head.begin)},
                           "",
                           *doubt != '\0' ? doubt : otherwise});
        waiting_.erase(waiting_.begin());
    }
    void release(const char *otherwise = "")
    {
        while (!waiting_.empty()) {
            release_first(otherwise);
        }
    }

    /// Skip damaged bytes at `at`; is_plausible: they have the form of a packet. Returns where the next packet begins.
    std::size_t behind_damage(std::size_t at, bool is_plausible)
    {
        const std::optional<Head> cut = begins(at);
        std::string why = reason(at, cut, is_plausible);
        if (cut && cut->end > bytes_.size() && continues_known(*cut)) {
            release(); // the file was cut off; the packets before are whole
        }
        std::optional<Head> resumed =
            first_continued(waiting_.empty() ? at : waiting_.front().head.at + 1, bytes_.size(), at);
        for (std::size_t last = at + is_plausible; !resumed && last < bytes_.size(); last++) {
            const std::optional<Head> candidate = complete(last);
            if (candidate && candidate->is_space && candidate->end == bytes_.size() &&
                (known_.empty() || known_.count(candidate->id) != 0)) {
                resumed = candidate;
            }
        }
        std::size_t from = at;
        while (resumed && !waiting_.empty() && waiting_.back().head.end > resumed->at) {
            from = waiting_.back().head.at;
            why = ": a packet of " + std::to_string(waiting_.back().head.end - waiting_.back().head.begin) +
                  " bytes would begin there, but the next one stands inside of it";
            forget_last();
        }
        release("what follows it is no packet: it may be damaged, too");
        const std::size_t to = resumed ? resumed->at : bytes_.size();
        pieces_.push_back({from, {}, std::to_string(to - from) + " bytes are no packet" + why, ""});
        return to;
    }
    std::string reason(std::size_t at, const std::optional<Head> &cut, bool is_plausible) const
    {
        const std::size_t begin = at + skip_;
        if (is_plausible) {
            return ": a packet would begin there, but one that continues those before stands inside of it";
        }
        if (cut && cut->end > bytes_.size()) {
            return ": a packet of " + std::to_string(cut->end - begin) + " bytes would begin there";
        }
        if (begin >= bytes_.size() || packet_header(bytes_[begin]) != 0) {
            return "";
        }
        char text[80];
        std::snprintf(text, sizeof text, ": byte %zu is 0x%02x, of packet version %d", begin, bytes_[begin],
                      bytes_[begin] >> 5);
        return text;
    }
};

} // namespace

std::vector<Piece> packets_of_bytes(std::span<const std::uint8_t> bytes, std::size_t skip)
{
    return Stream(bytes, skip).read();
}

} // namespace fledge::ground
