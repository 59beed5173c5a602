// SPDX-License-Identifier: Apache-2.0
#include "sim/instance.h"

#include "sim/error.h"
#include "sim/scripted_model.h"

#include <cstdlib>
#include <cstring>
#include <new>

namespace fledge::sim {

namespace {

constexpr std::align_val_t alignment{64};

std::byte *allocate(std::size_t size)
{
    auto *p = static_cast<std::byte *>(::operator new(size, alignment));
    std::memset(p, 0, size);
    return p;
}

} // namespace

void Instance::Free::operator()(std::byte *p) const
{
    ::operator delete(p, alignment);
}

Instance::Instance(const FledgeStruct &type)
    : path(type.name), given(type.n, false), bare(type.n, false), fed(type.n, false), type_(&type),
      memory_(allocate(type.size))
{
    if (type.kind == FLEDGE_MODEL) {
        model_ = std::make_unique<ScriptedModel>(*this);
    } else if (type.kind != FLEDGE_MODULE) {
        throw SetupError(std::string(type.name) + " is not a flight module");
    }
}

Instance::Instance(const ModelType &type)
    : path(type.interface->name), given(type.interface->n, false), bare(type.interface->n, false),
      fed(type.interface->n, false), type_(type.interface), model_type_(&type), memory_(allocate(type.interface->size)),
      model_(type.create(memory_.get()))
{
}

// The tables hold a module's functions without their argument's type. All of them take one pointer
// to a struct, which every ABI that we fly on passes alike.

void Instance::reset()
{
    if (type_->reset) {
        reinterpret_cast<void (*)(void *)>(type_->reset)(memory());
    } else {
        clear(*this);
    }
    if (script.reset) {
        script.reset(*this);
    }
}

void Instance::update(Tick tick)
{
    if (script.update) {
        script.update(*this, tick);
    } else {
        reinterpret_cast<void (*)(void *, Tick)>(type_->update)(memory(), tick);
    }
}

std::shared_ptr<Instance> Instance::clone() const
{
    auto other = model_type_ ? std::make_shared<Instance>(*model_type_) : std::make_shared<Instance>(*type_);
    other->name = name;
    other->path = path;
    other->at = at;
    other->given = given;
    other->bare = bare;
    other->fed = fed;
    other->maker = maker;
    other->script = script;
    std::memcpy(other->memory(), memory(), type_->size);
    return other;
}

void clear(Instance &instance)
{
    for (const FledgeField &field : fields(instance.type())) {
        if (field.group == FLEDGE_OUT || field.group == FLEDGE_MEM) {
            std::memset(instance.memory() + field.offset, 0, field.size);
        }
    }
}

const FledgeField *find_field(const FledgeStruct &type, std::string_view name)
{
    for (const FledgeField &field : fields(type)) {
        if (name == field.name) {
            return &field;
        }
    }
    return nullptr;
}

const FledgeField *field_at(const FledgeStruct &type, std::uint32_t offset)
{
    for (const FledgeField &field : fields(type)) {
        if (field.offset <= offset && offset < field.offset + field.size) {
            return &field;
        }
    }
    return nullptr;
}

std::vector<std::string> field_names(const FledgeStruct &type, FledgeGroup group)
{
    std::vector<std::string> names;
    for (const FledgeField &field : fields(type)) {
        if (field.group == group && !(field.flags & FLEDGE_SPARE)) {
            names.emplace_back(field.name);
        }
    }
    return names;
}

std::size_t field_elements(const FledgeField &field)
{
    std::size_t n = 1;
    for (std::uint32_t i = 0; i < field.ndim; i++) {
        n *= field.shape[i];
    }
    return n;
}

std::size_t field_rows(const FledgeStruct &type, const FledgeField &field, const std::byte *memory)
{
    const std::size_t rows = field.ndim ? field.shape[0] : 1;
    if (!field.count) {
        return rows;
    }
    const FledgeField *count = find_field(type, field.count);
    std::uint32_t n = 0;
    std::memcpy(&n, memory + count->offset, std::min<std::size_t>(count->size, sizeof n));
    return std::min<std::size_t>(n, rows);
}

} // namespace fledge::sim
