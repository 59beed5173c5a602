// SPDX-License-Identifier: Apache-2.0
// An FMU as a world model: its variables are parameters and fields of messages, by an interface that is made at run
// time. It is initialised at the reset, with the inputs of the first instant, and steps from update to update.
//
// Example:
//
//     void fly(sim::Instance &ball, std::shared_ptr<const importer::FmuPlan> plan)
//     {
//         dynamic_cast<importer::FmuModel &>(*ball.model()).set_plan(std::move(plan));
//     }
#pragma once

#include "fmi/importer/fmu.h"
#include "sim/model.h"

#include <memory>
#include <string>
#include <vector>

namespace fledge::importer {

/// What a field of the interface is in the FMU.
struct FmuField {
    Kind kind = Kind::F64;
    std::vector<std::uint32_t> references{}; ///< of one variable, or of a scalar for each element
    FledgeType type = FLEDGE_F64;            ///< in the interface
    std::uint32_t offset = 0;                ///< [bytes] there
    std::uint32_t n = 1;                     ///< elements; of a text, its room [bytes]
    double factor = 1.0, shift = 0.0;        ///< in the interface: factor * (value of the FMU) + shift
    bool discrete = false;                   ///< an input that may change in event mode alone
};

/// A message of the interface: fields [first, first + n) of the plan.
struct FmuPort {
    std::string name;
    std::uint32_t offset = 0; ///< [bytes] of its head
    std::size_t first = 0, n = 0;
    bool headed = true; ///< the model makes the head of an output; else the FMU has it as variables
};

/// How an interface and an FMU belong together.
struct FmuPlan {
    FmuFile file;
    std::vector<FmuField> fields;
    std::size_t parameters = 0; ///< so many fields, the first ones, are parameters;
    std::size_t tunable = 0;    ///< and so many of these, the first ones, may change in a run
    std::vector<FmuPort> inputs, outputs;
    std::vector<std::uint32_t> counters;  ///< [bytes] for each clock, the number of its ticks in the interface
    std::vector<std::string> assumptions; ///< a line each
    std::string image;                    ///< the bytes of the interface with which a model begins
    std::shared_ptr<const void> keeps;    ///< the unpacked FMU
};

class FmuModel final : public sim::Model {
public:
    explicit FmuModel(void *interface) : memory_(static_cast<std::byte *>(interface)) {}

    /// Before prepare().
    void set_plan(std::shared_ptr<const FmuPlan> plan) { plan_ = std::move(plan); }
    const std::shared_ptr<const FmuPlan> &plan() const { return plan_; }

    void prepare(const sim::Setup &setup) override;
    void refresh() override;
    void reset(sim::Ns t) override;
    void update(Tick tick) override;
    std::span<std::byte> memory() override { return state_; }
    void save() override;
    bool saves() const override { return plan_->file.saves; }
    void restored() override;
    std::vector<std::string> assumptions() const override
    {
        return plan_ ? plan_->assumptions : decltype(plan_->assumptions){};
    }
    void copy_setup(const sim::Model &original, const std::function<Model *(const Model *)> &) override
    {
        plan_ = dynamic_cast<const FmuModel &>(original).plan_;
    }

private:
    /// What the model remembers besides the FMU.
    struct State {
        double time;        ///< [s] that the FMU has reached
        std::uint64_t size; ///< [bytes]
        std::uint32_t phase;
        std::uint32_t spare;
    };
    enum Phase : std::uint32_t { FRESH, INITIALIZING, STEPPING };

    void put(const FmuField &field);
    void take(const FmuField &field);
    void put_parameters(std::size_t n);
    void put_inputs(bool discrete); ///< with those that may change in event mode alone
    bool inputs_changed() const;
    void take_outputs(sim::Ns t);
    std::string about() const { return name_ + " (" + plan_->file.file + ")"; }

    std::byte *memory_;
    std::shared_ptr<const FmuPlan> plan_;
    std::unique_ptr<Fmu> fmu_;
    std::string name_;
    std::vector<bool> fed_;         ///< for each input port
    std::vector<std::byte> values_; ///< of a field, on its way
    std::vector<std::byte> state_;  ///< State, the discrete inputs that the FMU has, and its own state
    std::span<std::byte> written_;  ///< the second
    Phase phase_ = FRESH;
};

} // namespace fledge::importer
