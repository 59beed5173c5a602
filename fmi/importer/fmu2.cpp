// SPDX-License-Identifier: Apache-2.0
#include "fmi/importer/versions.h"
#include "fmi/standard/fmi2.h"

#include <array>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>

namespace fledge::importer {

namespace {

/// The URI of a folder.
std::string uri(const std::string &path)
{
    std::string text = "file://";
    for (const char c : path) {
        const auto byte = static_cast<unsigned char>(c);
        if (byte > 0x20 && byte < 0x7f && c != '%' && c != '#' && c != '?') {
            text += c;
        } else {
            std::array<char, 4> code;
            std::snprintf(code.data(), code.size(), "%%%02X", byte);
            text += code.data();
        }
    }
    return text;
}

class Fmu2 final : public Fmu {
public:
    Fmu2(const FmuFile &file, const std::string &name) : Fmu(file, name)
    {
        check_version(version_.name(), version_());
        instance_ = instantiate_(name_.c_str(), fmi2CoSimulation, file_.token.c_str(), uri(file_.resources).c_str(),
                                 &callbacks_, fmi2False, fmi2True);
        if (!instance_) {
            no_instance(instantiate_.name());
        }
    }
    ~Fmu2() override
    {
        if (!dead_) {
            free_(instance_);
        }
    }
    Fmu2(const Fmu2 &) = delete;
    Fmu2 &operator=(const Fmu2 &) = delete;

    FledgeType carried(Kind kind) const override { return kind == Kind::F64 ? FLEDGE_F64 : FLEDGE_I32; }
    void get(Kind kind, std::span<const std::uint32_t> references, void *values, std::size_t) override
    {
        need(get_[index(kind)], instance_, references.data(), references.size(), values);
    }
    void set(Kind kind, std::span<const std::uint32_t> references, const void *values, std::size_t) override
    {
        need(set_[index(kind)], instance_, references.data(), references.size(), const_cast<void *>(values));
    }
    std::string text(std::uint32_t reference) override
    {
        fmi2String value = nullptr;
        need(get_text_, instance_, &reference, std::size_t{1}, &value);
        return value ? value : "";
    }
    void set_text(std::uint32_t reference, const char *text) override
    {
        need(set_text_, instance_, &reference, std::size_t{1}, &text);
    }

    void initialize(double start) override
    {
        time_ = start;
        need(setup_, instance_, fmi2False, 0.0, start, fmi2False, 0.0);
        need(enter_initialization_, instance_);
    }
    void begin() override { need(exit_initialization_, instance_); }
    void reset() override { need(reset_, instance_); }

    std::vector<std::byte> save() override
    {
        return saved_by<fmi2Byte>(instance_, get_state_, state_size_, serialize_, free_state_);
    }
    void restore(std::span<const std::byte> bytes) override
    {
        restore_by<fmi2Byte>(instance_, bytes, deserialize_, set_state_, free_state_);
    }

private:
    /// The functions of all numbers, whose arguments differ in the pointer alone.
    using Access = fmi2Status(fmi2Component, const fmi2ValueReference *, std::size_t, void *);

    static std::size_t index(Kind kind) { return kind == Kind::F64 ? 0 : kind == Kind::BOOLEAN ? 2 : 1; }

    bool step(double size) override
    {
        const double aim = time_ + size;
        if (call(do_step_, instance_, time_, size, fmi2True)) {
            time_ = aim;
            return false;
        }
        fmi2Boolean ends = fmi2False;
        if (status_boolean_(instance_, fmi2Terminated, &ends) == fmi2OK && ends) {
            terminate();
        }
        double last = time_;
        if (status_real_(instance_, fmi2LastSuccessfulTime, &last) == fmi2OK) {
            time_ = last;
        }
        return true;
    }

    static void log_line(fmi2ComponentEnvironment self, fmi2String, fmi2Status status, fmi2String, fmi2String format,
                         ...)
    {
        std::array<char, 1000> text;
        va_list arguments;
        va_start(arguments, format);
        std::vsnprintf(text.data(), text.size(), format, arguments);
        va_end(arguments);
        static_cast<Fmu2 *>(self)->log(status, text.data());
    }

#define FUNCTION_IF(needed, member, name) const Function<fmi2##name##TYPE> member{*this, "fmi2" #name, needed}
#define FUNCTION(member, name) FUNCTION_IF(true, member, name)
    FUNCTION(version_, GetVersion);
    FUNCTION(instantiate_, Instantiate);
    FUNCTION(free_, FreeInstance);
    FUNCTION(setup_, SetupExperiment);
    FUNCTION(enter_initialization_, EnterInitializationMode);
    FUNCTION(exit_initialization_, ExitInitializationMode);
    FUNCTION(do_step_, DoStep);
    FUNCTION(status_real_, GetRealStatus);
    FUNCTION(status_boolean_, GetBooleanStatus);
    FUNCTION(reset_, Reset);
    FUNCTION(get_text_, GetString);
    FUNCTION(set_text_, SetString);
    FUNCTION_IF(file_.saves, get_state_, GetFMUstate);
    FUNCTION_IF(file_.saves, set_state_, SetFMUstate);
    FUNCTION_IF(file_.saves, free_state_, FreeFMUstate);
    FUNCTION_IF(file_.saves, state_size_, SerializedFMUstateSize);
    FUNCTION_IF(file_.saves, serialize_, SerializeFMUstate);
    FUNCTION_IF(file_.saves, deserialize_, DeSerializeFMUstate);
#undef FUNCTION
#undef FUNCTION_IF
    const std::array<Function<Access>, 3> get_{Function<Access>(*this, "fmi2GetReal"),
                                               Function<Access>(*this, "fmi2GetInteger"),
                                               Function<Access>(*this, "fmi2GetBoolean")};
    const std::array<Function<Access>, 3> set_{Function<Access>(*this, "fmi2SetReal"),
                                               Function<Access>(*this, "fmi2SetInteger"),
                                               Function<Access>(*this, "fmi2SetBoolean")};
    const fmi2CallbackFunctions callbacks_{log_line, std::calloc, std::free, nullptr, this};
    fmi2Component instance_ = nullptr;
};

} // namespace

std::unique_ptr<Fmu> make_fmu2(const FmuFile &file, const std::string &name)
{
    return std::make_unique<Fmu2>(file, name);
}

} // namespace fledge::importer
