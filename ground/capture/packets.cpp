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
    std::size_t at, begin, end;           ///< the bytes in front of it, its own
    unsigned id = 0, count = 0, part = 0; ///< of a space packet
    bool is_space = false;
};

/// The last packet of an application.
struct Last {
    unsigned count, part;
    bool stays; ///< its counts may stay as they are
};

/// Whether a packet may be behind one of its application, by their counts and parts.
bool is_behind(const Head &one, unsigned count, unsigned part, unsigned furthest = near_counts)
{
    const unsigned on = (one.count - count) & (SPACE_PACKET_COUNTS - 1u);
    const bool within = part == SPACE_PACKET_FIRST || part == SPACE_PACKET_MIDDLE; // a unit of data
    return on != 0 && on <= furthest && (one.part == SPACE_PACKET_WHOLE || within == (one.part != SPACE_PACKET_FIRST));
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

    std::vector<Found> read()
    {
        std::size_t at = 0;
        while (!ends(at)) {
            const std::optional<Head> one = next(at, true);
            if (one && one->end - one->begin == 1) { // it fills
                at = one->end;
                continue;
            }
            const bool known = one && continues_known(*one);
            const bool follows = one && (one->at == at || !is_known_inside(at, one->at)); // not behind padding alone
            if (known && follows) {
                release();
            }
            const bool sure = follows && (known || is_begun(*one));
            if (sure || (follows && may_be(*one))) {
                const char *doubt = "";
                if (sure && !known_.empty() ? are_known_inside(*one)
                                            : known_.empty() && first_continued(one->at + 1, one->end)) {
                    doubt = "other packets seem to begin inside of it";
                } else if (!sure && one->is_space && one->part != SPACE_PACKET_WHOLE) {
                    doubt = "it is a part without those before and behind it";
                }
                if (waiting_.size() == waiting) {
                    release_first();
                }
                wait(*one, doubt);
                at = one->end;
                continue;
            }
            at = behind_damage(at, one.has_value());
        }
        release();
        return std::move(found_);
    }

private:
    std::span<const std::uint8_t> bytes_;
    std::size_t skip_;
    std::vector<Found> found_;
    std::map<unsigned, Last> known_; ///< by their first two bytes
    std::vector<Waiting> waiting_;

    const std::uint8_t *data(std::size_t at) const { return bytes_.data() + at; }

    /// What begins there, even if the file ends before it does; nothing: no packet.
    std::optional<Head> begins(std::size_t at) const
    {
        const std::size_t begin = at + skip_;
        std::uint32_t size = 0;
        if (begin >= bytes_.size()) {
            return std::nullopt;
        }
        (void)packet_size(data(begin), bytes_.size() - begin, &size);
        Head made{at, begin, begin + size};
        made.is_space = *data(begin) >> 5 == 0;
        if (size == 0) {
            return std::nullopt;
        }
        if (made.is_space) {
            made.id = ccsds_get16(data(begin));
            made.count = ccsds_get16(data(begin + 2)) & (SPACE_PACKET_COUNTS - 1u);
            made.part = data(begin + 2)[0] >> 6;
            if (made.id == 0 && made.part != SPACE_PACKET_WHOLE) {
                return std::nullopt; // padding, rather than a part for application 0
            }
        }
        return made;
    }
    std::optional<Head> head(std::size_t at) const
    {
        std::optional<Head> made = begins(at);
        return made && made->end <= bytes_.size() ? made : std::nullopt;
    }
    std::size_t behind_zeros(std::size_t at) const
    {
        const auto found = std::find_if(bytes_.begin() + static_cast<std::ptrdiff_t>(std::min(at, bytes_.size())),
                                        bytes_.end(), [](std::uint8_t byte) { return byte != 0; });
        return static_cast<std::size_t>(found - bytes_.begin());
    }
    bool ends(std::size_t at) const { return behind_zeros(at) == bytes_.size(); }

    /// The packet that begins there, or behind padding: one that continues others, else (if `ahead`) one that others
    /// continue, else a whole one.
    std::optional<Head> next(std::size_t at, bool ahead = false) const
    {
        std::optional<Head> found = head(at);
        if (at >= bytes_.size() || bytes_[at] != 0) {
            return found;
        }
        const auto rank = [&](const std::optional<Head> &one) {
            const bool whole = one && one->is_space && one->part == SPACE_PACKET_WHOLE && one->id != 0;
            return !one ? 0 : continues_known(*one) ? 4 : ahead && is_begun(*one) ? 3 : whole ? 2 : 1;
        };
        int best = rank(found);
        const std::size_t zeros = behind_zeros(at); // a header may begin with up to two of them
        std::size_t from = std::max(at + 1, zeros - std::min(zeros, skip_ + 2));
        for (; best < 4 && from <= zeros && from < bytes_.size(); from++) {
            const std::optional<Head> one = head(from);
            if (const int good = rank(one); good > best) {
                best = good;
                found = one;
            }
        }
        return found;
    }

    bool continues_known(const Head &one) const
    {
        const auto before = known_.find(one.id);
        if (!one.is_space || before == known_.end()) {
            return false;
        }
        const auto &[count, part, stays] = before->second;
        return is_behind(one, count, part) || (stays && one.count == count && one.part == part);
    }
    /// Whether packets behind it continue it: one, or two that have its count. It is whole, or a first part.
    bool is_begun(const Head &one) const
    {
        std::optional<Head> step = one;
        unsigned same = 0;
        for (unsigned i = 0; i < steps && (one.part & SPACE_PACKET_FIRST) && (step = next(step->end)); i++) {
            if (!step->is_space || step->id != one.id) {
                continue;
            }
            if (step->count != one.count || step->part != SPACE_PACKET_WHOLE || one.part != SPACE_PACKET_WHOLE) {
                return is_behind(*step, one.count, one.part, one.part == SPACE_PACKET_WHOLE ? near_counts : 1);
            }
            if (++same == 2) {
                return true;
            }
        }
        return false;
    }
    /// Whether two more packets follow it, or the end; and one of them, or itself, ends behind `behind`.
    bool is_followed(const Head &one, std::size_t behind) const
    {
        std::optional<Head> step = one;
        for (unsigned i = 0; step && i < steps && step->end != behind; i++, step = next(step->end)) {
            if ((i >= 2 || ends(step->end)) && step->end > behind) {
                return true;
            }
        }
        return false;
    }

    /// Whether it may be a packet that does not continue others.
    bool may_be(const Head &one) const
    {
        if (one.is_space && one.part != SPACE_PACKET_WHOLE) { // only if others surround it
            const std::optional<Head> behind = next(one.end);
            if (!ends(one.end) && (!behind || (!continues_known(*behind) && !is_begun(*behind)))) {
                return false;
            }
        }
        return known_.empty() || !is_known_inside(one.at, one.end);
    }
    /// Whether a packet that continues those before begins in there, or inside of the packet in front of that.
    bool is_known_inside(std::size_t from, std::size_t to) const
    {
        for (std::size_t at = waiting_.empty() ? from + 1 : waiting_.back().head.at + 1; at < to; at++) {
            if (at == from) {
                continue;
            }
            const std::optional<Head> one = head(at);
            if (one && continues_known(*one) && is_followed(*one, 0)) {
                return true;
            }
        }
        return false;
    }
    /// Whether two that continue those before follow one another inside of it, or the second one at its end.
    bool are_known_inside(const Head &outer) const
    {
        for (std::size_t at = outer.at + 1; at < outer.end; at++) {
            const std::optional<Head> one = head(at);
            if (one && one->end <= outer.end && continues_known(*one)) {
                const std::optional<Head> second = next(one->end);
                if (second && continues_known(*second)) {
                    return true;
                }
            }
        }
        return false;
    }
    /// The first packet that begins from there on and is continued, or continues one that is known.
    std::optional<Head> first_continued(std::size_t at, std::size_t before, std::size_t behind = 0) const
    {
        for (; at < before; at++) {
            const std::optional<Head> one = head(at);
            if (one && (continues_known(*one) || is_begun(*one)) && is_followed(*one, at < behind ? behind : 0)) {
                return one;
            }
        }
        return std::nullopt;
    }

    void wait(const Head &one, const char *doubt)
    {
        std::optional<Last> before;
        if (one.is_space && *doubt == '\0') {
            const auto [place, fresh] = known_.try_emplace(one.id);
            before = fresh ? std::nullopt : std::optional(place->second);
            place->second = {one.count, one.part, fresh || before->count == one.count};
        }
        waiting_.push_back({one, before, doubt});
    }
    void forget_last()
    {
        const auto &[one, before, doubt] = waiting_.back();
        if (before) {
            known_[one.id] = *before;
        } else if (one.is_space && *doubt == '\0') {
            known_.erase(one.id);
        }
        waiting_.pop_back();
    }
    void release_first(const char *otherwise = "")
    {
        const auto &[one, before, doubt] = waiting_.front();
        found_.push_back({one.begin,
                          {data(one.begin), data(one.begin) + (one.end - one.begin)},
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

    /// No packet begins at `at`, or one that is none. Returns where reading goes on.
    std::size_t behind_damage(std::size_t at, bool is_plausible)
    {
        const std::optional<Head> cut = begins(at);
        std::string why = reason(at, cut, is_plausible);
        if (cut && cut->end > bytes_.size() && continues_known(*cut)) {
            release(); // the file was cut off; what is in front of that is whole
        }
        std::optional<Head> found =
            first_continued(waiting_.empty() ? at : waiting_.front().head.at + 1, bytes_.size(), at);
        for (std::size_t last = at + is_plausible; !found && last < bytes_.size(); last++) {
            const std::optional<Head> one = head(last);
            if (one && one->is_space && one->end == bytes_.size() && (known_.empty() || known_.count(one->id) != 0)) {
                found = one;
            }
        }
        std::size_t from = at;
        while (found && !waiting_.empty() && waiting_.back().head.end > found->at) {
            from = waiting_.back().head.at;
            why = ": a packet of " + std::to_string(waiting_.back().head.end - waiting_.back().head.begin) +
                  " bytes would begin there, but the next one stands inside of it";
            forget_last();
        }
        release("what follows it is no packet: it may be damaged, too");
        const std::size_t to = found ? found->at : bytes_.size();
        found_.push_back({from, {}, std::to_string(to - from) + " bytes are no packet" + why, ""});
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

std::vector<Found> packets_of_bytes(std::span<const std::uint8_t> bytes, std::size_t skip)
{
    return Stream(bytes, skip).read();
}

} // namespace fledge::ground
