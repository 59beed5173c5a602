// SPDX-License-Identifier: Apache-2.0
#include "fmi/importer/versions.h"
#include "fmi/standard/fmi3.h"

#include <array>

namespace fledge::importer {

namespace {

class Fmu3 final : public Fmu {
public:
    Fmu3(const FmuFile &file, const std::string &name) : Fmu(file, name)
    {
        check_version(version_.name(), version_());
        const auto log_line = [](fmi3InstanceEnvironment self, fmi3Status status, fmi3String, fmi3String text) {
            static_cast<Fmu3 *>(self)->log(status, text);
        };
        instance_ =
            instantiate_(name_.c_str(), file_.token.c_str(), (file_.resources + "/").c_str(), fmi3False, fmi3True,
                         file_.event_mode, fmi3True, nullptr, std::size_t{0}, this, log_line, nullptr);
        if (!instance_) {
            no_instance(instantiate_.name());
        }
    }
    ~Fmu3() override
    {
        if (!dead_) {
            free_(instance_);
        }
    }
    Fmu3(const Fmu3 &) = delete;
    Fmu3 &operator=(const Fmu3 &) = delete;

    FledgeType carried(Kind kind) const override
    {
        return kind == Kind::BOOLEAN ? FLEDGE_U8 : kind == Kind::ENUMERATION ? FLEDGE_I64 : FledgeType(kind);
    }
    void get(Kind kind, std::span<const std::uint32_t> references, void *values, std::size_t n) override
    {
        need(get_[index(kind)], instance_, references.data(), references.size(), values, n);
    }
    void set(Kind kind, std::span<const std::uint32_t> references, const void *values, std::size_t n) override
    {
        need(set_[index(kind)], instance_, references.data(), references.size(), const_cast<void *>(values), n);
    }
    std::string text(std::uint32_t reference) override
    {
        fmi3String value = nullptr;
        need(get_text_, instance_, &reference, std::size_t{1}, &value, std::size_t{1});
        return value ? value : "";
    }
    void set_text(std::uint32_t reference, const char *text) override
    {
        need(set_text_, instance_, &reference, std::size_t{1}, &text, std::size_t{1});
    }

    void initialize(double start) override
    {
        time_ = start;
        need(enter_initialization_, instance_, fmi3False, 0.0, start, fmi3False, 0.0);
    }
    void begin() override
    {
        need(exit_initialization_, instance_);
        if (file_.event_mode) {
            close_event();
        }
    }
    void open_event() override
    {
        if (file_.event_mode) {
            need(enter_event_, instance_);
        }
    }
    void close_event() override
    {
        constexpr int most = 10'000;
        fmi3Boolean again = file_.event_mode, ends = fmi3False;
        for (int i = 0; again; i++) {
            count_ticks();
            fmi3Boolean nominals, states, defined;
            fmi3Float64 next;
            need(update_, instance_, &again, &ends, &nominals, &states, &defined, &next);
            if (ends) {
                terminate();
            }
            if (i == most) {
                fail(update_.name(), "a request for one more, " + std::to_string(most) + " times");
            }
        }
        if (file_.event_mode) {
            need(enter_step_, instance_);
        }
    }
    void reset() override
    {
        need(reset_, instance_);
        ticks.assign(ticks.size(), 0);
    }

    std::vector<std::byte> save() override
    {
        return saved_by<fmi3Byte>(instance_, get_state_, state_size_, serialize_, free_state_);
    }
    void restore(std::span<const std::byte> bytes) override
    {
        restore_by<fmi3Byte>(instance_, bytes, deserialize_, set_state_, free_state_);
    }

private:
    /// The functions of all numbers, whose arguments differ in the pointer alone.
    using Access = fmi3Status(fmi3Instance, const fmi3ValueReference *, std::size_t, void *, std::size_t);

    static std::size_t index(Kind kind)
    {
        return kind == Kind::BOOLEAN ? 10 : static_cast<std::size_t>(kind == Kind::ENUMERATION ? Kind::I64 : kind);
    }

    bool step(double size) override
    {
        fmi3Boolean event = fmi3False, ends = fmi3False, early = fmi3False;
        const double aim = time_ + size;
        double last = time_;
        const bool done = call(do_step_, instance_, time_, size, fmi3True, &event, &ends, &early, &last);
        time_ = done && !early ? aim : last;
        if (ends) {
            terminate();
        }
        if (done && event && file_.event_mode) {
            open_event();
            close_event();
        }
        return !done;
    }

    void count_ticks()
    {
        for (std::size_t i = 0; i < ticks.size(); i++) {
            fmi3Clock active = fmi3ClockInactive;
            need(get_clock_, instance_, &file_.clocks[i], std::size_t{1}, &active);
            ticks[i] += active ? 1 : 0;
        }
    }

    template <std::size_t... i>
    static std::array<Function<Access>, 11> access(const Fmu3 &me, const std::array<const char *, 11> &names,
                                                   std::index_sequence<i...>)
    {
        return {Function<Access>(me, names[i])...};
    }

#define FUNCTION_IF(needed, member, name) const Function<fmi3##name##TYPE> member{*this, "fmi3" #name, needed}
#define FUNCTION(member, name) FUNCTION_IF(true, member, name)
    FUNCTION(version_, GetVersion);
    FUNCTION(instantiate_, InstantiateCoSimulation);
    FUNCTION(free_, FreeInstance);
    FUNCTION(enter_initialization_, EnterInitializationMode);
    FUNCTION(exit_initialization_, ExitInitializationMode);
    FUNCTION_IF(file_.event_mode, enter_event_, EnterEventMode);
    FUNCTION_IF(file_.event_mode, enter_step_, EnterStepMode);
    FUNCTION_IF(file_.event_mode, update_, UpdateDiscreteStates);
    FUNCTION(do_step_, DoStep);
    FUNCTION(reset_, Reset);
    FUNCTION(get_text_, GetString);
    FUNCTION(set_text_, SetString);
    FUNCTION_IF(!file_.clocks.empty(), get_clock_, GetClock);
    FUNCTION_IF(file_.saves, get_state_, GetFMUState);
    FUNCTION_IF(file_.saves, set_state_, SetFMUState);
    FUNCTION_IF(file_.saves, free_state_, FreeFMUState);
    FUNCTION_IF(file_.saves, state_size_, SerializedFMUStateSize);
    FUNCTION_IF(file_.saves, serialize_, SerializeFMUState);
    FUNCTION_IF(file_.saves, deserialize_, DeserializeFMUState);
#undef FUNCTION
#undef FUNCTION_IF
    // In the order of FledgeType.
    const std::array<Function<Access>, 11> get_ =
        access(*this,
               {"fmi3GetFloat64", "fmi3GetFloat32", "fmi3GetInt8", "fmi3GetUInt8", "fmi3GetInt16", "fmi3GetUInt16",
                "fmi3GetInt32", "fmi3GetUInt32", "fmi3GetInt64", "fmi3GetUInt64", "fmi3GetBoolean"},
               std::make_index_sequence<11>());
    const std::array<Function<Access>, 11> set_ =
        access(*this,
               {"fmi3SetFloat64", "fmi3SetFloat32", "fmi3SetInt8", "fmi3SetUInt8", "fmi3SetInt16", "fmi3SetUInt16",
                "fmi3SetInt32", "fmi3SetUInt32", "fmi3SetInt64", "fmi3SetUInt64", "fmi3SetBoolean"},
               std::make_index_sequence<11>());
    fmi3Instance instance_ = nullptr;
};

} // namespace

std::unique_ptr<Fmu> make_fmu3(const FmuFile &file, const std::string &name)
{
    return std::make_unique<Fmu3>(file, name);
}

} // namespace fledge::importer
