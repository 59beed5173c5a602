// SPDX-License-Identifier: Apache-2.0
// An instance: the memory of one module or model, its type and its name.
#pragma once

#include "sim/error.h"
#include "sim/model.h"

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace fledge::sim {

class Instance;

/// Functions of the user's that a module runs: `update` in place of its type's, `reset` after its type's. The type of a
/// prototype has no functions of its own. A clone has copies of them.
struct Script {
    std::function<void(Instance &, Tick)> update; ///< empty: the type's
    std::function<void(Instance &)> reset;        ///< of a flight module; may be empty
    std::function<void(Instance &)> prepare;      ///< of a world model, as Model::prepare(); may be empty
    std::function<void(Instance &, Tick)> begin;  ///< of a world model, as Model::reset(); may be empty
    /// Of a world model: what other models ask for at t [s] and a place, an answer of numbers; may be empty.
    std::function<void(Instance &, double t, std::span<const double, 3> place, std::span<double> answer)> at_place;
    bool shares = true; ///< whether it may keep data outside of the instance's memory, which clones would share
};

/// Owns the C struct of a module or the interface of a model. The memory is zeroed, aligned to 64 bytes,
/// and never moves while the instance lives.
class Instance : public std::enable_shared_from_this<Instance> {
public:
    /// A flight module, or a world model whose behaviour is its script. Throws SetupError for other types.
    explicit Instance(const FledgeStruct &type);
    /// A world model.
    explicit Instance(const ModelType &type);
    Instance(const Instance &) = delete;
    Instance &operator=(const Instance &) = delete;

    const FledgeStruct &type() const { return *type_; }
    std::byte *memory() const { return memory_.get(); }
    Model *model() const { return model_.get(); } ///< null for a flight module

    std::string name; ///< "control"; empty until the instance has a process
    std::string path; ///< "flight.control"; the name of the type until the instance has a name
    SourceLine at;    ///< where it got its name

    /// Which fields the user has set, by index in the table of the type.
    std::vector<bool> given;

    /// Which of them were given as numbers without a unit, by the same index.
    std::vector<bool> bare;

    /// Which inputs a wire or a feed writes before each update, by the same index.
    std::vector<bool> fed;

    /// Whether an instant has run since its reset, which sets outputs and memory anew.
    bool begun = false;

    /// What makes its outputs: itself, a playback, or what flies in its place: a computer (Process::fly_by), which has
    /// parameters of its own, or a model (fly_by_model), which gets them.
    enum class Maker { itself, record, computer, model } maker = Maker::itself;

    Script script;

    /// Run a flight module's functions. Without a reset of its type's, outputs and memory become zero.
    void reset();
    void update(Tick tick);

    /// A new instance of the same type with the same bytes; a model's set-up is not copied.
    std::shared_ptr<Instance> clone() const;

private:
    struct Free {
        void operator()(std::byte *p) const;
    };
    const FledgeStruct *type_;
    const ModelType *model_type_ = nullptr;
    std::unique_ptr<std::byte[], Free> memory_;
    std::unique_ptr<Model> model_;
};

/// Outputs and memory become zero.
void clear(Instance &instance);

/// The fields of a type, for loops.
inline std::span<const FledgeField> fields(const FledgeStruct &type)
{
    return {type.fields, type.n};
}

/// The field of that name, or nullptr.
const FledgeField *find_field(const FledgeStruct &type, std::string_view name);

/// The field that has the byte at this offset, or nullptr.
const FledgeField *field_at(const FledgeStruct &type, std::uint32_t offset);

/// The names of a type's fields in a group (spares left out), for messages.
std::vector<std::string> field_names(const FledgeStruct &type, FledgeGroup group);

/// The number of elements of a field; the number of its leading rows that are in use, from the memory of the struct.
std::size_t field_elements(const FledgeField &field);
std::size_t field_rows(const FledgeStruct &type, const FledgeField &field, const std::byte *memory);

/// Check one field of a struct at `memory` against its header's rule (bounds, non-zero, inertia,
/// finite). Throws SetupError: "path.field: rule; found ...".
void check_field(const FledgeStruct &type, const FledgeField &field, const std::byte *memory, std::string_view path);

/// Check all parameters, required ones included. Throws SetupError that lists every fault.
void check_parameters(const Instance &instance);

} // namespace fledge::sim
