// SPDX-License-Identifier: Apache-2.0
// The slots of values: one for each leaf of each parameter of telemetry. The leaves of arrays of varying size get slots
// when the first packet has them.
#pragma once

#include "ground/database/decoder.h"

#include <deque>

namespace fledge::ground {

struct Slot {
    std::string name; ///< the alias in the name space Fledge, else the name if it is unique, else the path; ".a[3]"
    std::string path;
    Id parameter = no_id;
    Id type = no_id;
    Id container = no_id; ///< the first that has it
    Kind kind = Kind::none;
    std::string unit{}, description{}; ///< only if it is no parameter
};

class Slots {
public:
    static constexpr std::size_t most = 1 << 20;

    explicit Slots(const Database &database);

    /// The slot of each field, until the next call; no_id: there are `most` without it.
    std::span<const std::uint32_t> of(const Decoded &packet);

    /// Whether `of` adds no slots: a planned packet of this container came before.
    bool knows(const Decoded &packet) const { return packet.planned && known_[packet.container]; }

    /// The slot with this name or path; no_id: none.
    std::uint32_t find(const std::string &name) const;

    /// Add a slot that is no parameter. Throws Refusal if the name is taken.
    std::uint32_t add(Slot slot);

    const std::deque<Slot> &all() const { return all_; }

private:
    struct Branch {
        std::uint32_t slot = no_id;
        std::vector<std::uint32_t> children; ///< branches of members or elements; no_id: none yet
    };

    void lay(const Container &container, Id parameter, Id type, std::uint32_t branch, const std::string &suffix,
             const std::vector<Dimension> *dimensions);
    std::uint32_t child(std::uint32_t branch, std::uint32_t place);
    std::uint32_t leaf(std::uint32_t branch, Id parameter, Id type, Id container, const std::string &suffix);
    std::uint32_t seek(const Decoded &packet, std::size_t field);

    const Database &db_;
    std::deque<Slot> all_;
    std::vector<std::string> names_; ///< of each parameter
    std::vector<Branch> branches_;   ///< the parameters come first
    std::unordered_map<std::string, std::uint32_t> by_name_;
    std::vector<std::vector<std::uint32_t>> tables_; ///< slots of the fields of each container's planned packets
    std::vector<bool> known_;
    std::vector<std::uint32_t> table_, steps_;
};

} // namespace fledge::ground
