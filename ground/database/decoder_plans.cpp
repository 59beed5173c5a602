// SPDX-License-Identifier: Apache-2.0
// Plans for containers whose places are all fixed.
#include "ground/database/decoder_parts.h"

#include <algorithm>
#include <cmath>

namespace fledge::ground {

namespace {

constexpr std::size_t most_planned = 1 << 22;  // of all plans
constexpr std::size_t most_laid = 1 << 25;     // entries and values of all plans, also of those that are abandoned
constexpr std::size_t most_compared = 1 << 27; // fields that the comparisons of a plan's heirs search

using Sort = Type::Sort;
using std::bit_cast;

std::size_t comparisons(const Condition &condition)
{
    std::size_t n = 1;
    for (const Condition &part : condition.parts) {
        n += comparisons(part);
    }
    return n;
}

} // namespace

const Decoder::Plan &Decoder::plan_of(Id container)
{
    if (!plans_[container]) {
        plans_[container] = std::make_unique<Plan>();
        const std::size_t effort = effort_; // of the packet; a plan does not count as its effort
        effort_ = 0;
        if (laid_ < most_laid && planned_fields_ < most_planned) {
            make_plan(*plans_[container], container);
        }
        laid_ += effort_ + plans_[container]->fields.size();
        effort_ = effort;
    }
    return *plans_[container];
}

/// The field and the raw number that a restriction requires, if it is such a comparison.
std::optional<std::pair<std::size_t, std::uint64_t>> Decoder::key(const Plan &plan, const Condition &condition) const
{
    if (condition.kind != Condition::Kind::compare || condition.op != Operator::equal || !condition.literal.number ||
        condition.right.of != Reference::Of::nothing || condition.left.of != Reference::Of::parameter) {
        return std::nullopt;
    }
    for (std::size_t i = plan.fields.size(); i-- > 0;) {
        const Field &field = plan.fields[i];
        if (field.parameter == condition.left.parameter && leads(condition.left, plan.nodes, field.node)) {
            const bool raw = field.raw == Kind::natural && (!condition.left.calibrated || field.value == Kind::natural);
            const auto word = raw ? word_of(Kind::natural, *condition.literal.number) : std::nullopt;
            return word && condition.literal.number == Number(*word) ? std::optional(std::pair(i, *word))
                                                                     : std::nullopt;
        }
    }
    return std::nullopt;
}

/// Choose the field whose raw number most heirs compare.
void Decoder::dispatch(Plan &plan, const Container &container) const
{
    std::unordered_map<std::size_t, std::size_t> counts;
    std::vector<std::unordered_map<std::size_t, std::uint64_t>> keys;
    for (const Id heir : container.heirs) {
        const Condition &all = db_.containers[heir].restriction;
        auto &mine = keys.emplace_back();
        for (const Condition &part : all.kind == Condition::Kind::all ? all.parts : std::vector{all}) {
            if (const auto found = key(plan, part); found && mine.insert(*found).second) {
                counts[found->first]++;
            }
        }
    }
    const auto chosen = std::max_element(counts.begin(), counts.end(), [](auto &a, auto &b) {
        return std::pair(a.second, b.first) < std::pair(b.second, a.first);
    });
    const auto affordable = [&](std::size_t keyed) { return keyed * (keys.size() - keyed) <= most_planned; };
    if (chosen != counts.end() && chosen->second > 1 && affordable(chosen->second)) {
        const std::size_t field = chosen->first;
        plan.dispatch.at = plan.places[field];
        plan.dispatch.encoding = &db_.types[plan.fields[field].type].encoding;
        for (const auto &mine : keys) {
            if (const auto key = mine.find(field); key != mine.end()) {
                plan.dispatch.heirs[key->second];
            }
        }
        for (std::size_t i = 0; i < keys.size(); i++) {
            if (const auto key = keys[i].find(field); key != keys[i].end()) {
                plan.dispatch.heirs[key->second].push_back(container.heirs[i]);
                continue;
            }
            plan.dispatch.others.push_back(container.heirs[i]);
            for (auto &[value, heirs] : plan.dispatch.heirs) {
                heirs.push_back(container.heirs[i]);
            }
        }
    }
}

void Decoder::make_plan(Plan &plan, Id id)
{
    const Container &container = db_.containers[id];
    std::size_t at = 0;
    if (container.base != no_id) {
        const Plan &base = plan_of(container.base);
        if (!base.fixed) {
            return;
        }
        plan.fields = base.fields;
        plan.places = base.places;
        plan.nodes = base.nodes;
        plan.empty = base.empty;
        plan.most = base.most;
        at = base.end;
        effort_ += base.fields.size();
    }
    plan.fixed = lay_entries(plan, id, at, 0);
    planned_fields_ += plan.fields.size();
    if (!plan.fixed || planned_fields_ > most_planned) {
        plan = Plan();
        return;
    }
    plan.end = at;
    join_steps(plan);
    for (std::uint32_t i = 0; i < plan.fields.size(); i++) {
        if (const auto slots = slots_.find(plan.fields[i].parameter); slots != slots_.end()) {
            for (const std::uint32_t slot : slots->second) {
                if (leads(held_[slot].reference, plan.nodes, plan.fields[i].node)) {
                    plan.held.emplace_back(i, slot);
                }
            }
        }
    }

    dispatch(plan, container);
    std::size_t n = 0;
    plan.searches = std::any_of(container.heirs.begin(), container.heirs.end(), [&](Id heir) {
        n += comparisons(db_.containers[heir].restriction) * plan.fields.size();
        return n > most_compared || by_more_than_numbers(plan, db_.containers[heir].restriction);
    });
}

/// Whether a restriction compares texts, bytes, or members without their parameter.
bool Decoder::by_more_than_numbers(const Plan &plan, const Condition &condition) const
{
    for (const Reference *reference : {&condition.left, &condition.right}) {
        if (reference->of == Reference::Of::argument ||
            std::any_of(plan.fields.begin(), plan.fields.end(), [&](const Field &field) {
                return field.parameter == reference->parameter &&
                       (field.raw == Kind::text || field.raw == Kind::binary);
            })) {
            return true;
        }
    }
    return std::any_of(condition.parts.begin(), condition.parts.end(),
                       [&](const Condition &part) { return by_more_than_numbers(plan, part); });
}

bool Decoder::lay_entries(Plan &plan, Id id, std::size_t &at, std::size_t start)
{
    for (const Entry &entry : db_.containers[id].entries) {
        const bool container = entry.kind == Entry::Kind::container;
        if (entry.include.kind != Condition::Kind::always || entry.from == Entry::From::end ||
            !entry.offset.is_fixed() || !entry.count.is_fixed() || !entry.gap.is_fixed() ||
            (container ? !db_.containers[entry.id].heirs.empty() || db_.containers[entry.id].base != no_id
                       : entry.kind != Entry::Kind::parameter)) {
            return false;
        }
        const std::int64_t n = entry.repeats ? entry.count.fixed : 1, gap = entry.repeats ? entry.gap.fixed : 0;
        std::int64_t from =
            static_cast<std::int64_t>(entry.from == Entry::From::start ? start : at) + entry.offset.fixed;
        if (n < 0 || n > 1 << 16) {
            return false;
        }
        for (std::int64_t i = 0; i < n; i++) {
            if (from < 0 || from > 8 * 65542) {
                return false;
            }
            at = static_cast<std::size_t>(from);
            plan.most = std::max(plan.most, at); // a place beyond the packet's end is a fault, even of no bits
            if (!(container ? lay_entries(plan, entry.id, at, at)
                            : lay(plan, entry.id, db_.parameters[entry.id].type, 0, at, &entry.dimensions))) {
                return false;
            }
            from = static_cast<std::int64_t>(at) + gap;
            if (plan.fields.size() > 1 << 16 || ++effort_ > most_effort) {
                return false;
            }
        }
    }
    return true;
}

bool Decoder::lay(Plan &plan, Id parameter, Id id, std::uint32_t node, std::size_t &at,
                  const std::vector<Dimension> *dimensions)
{
    const Type &type = db_.types[id];
    const Encoding &encoding = type.encoding;
    if (plan.fields.size() > 1 << 16 || ++effort_ > most_effort) {
        return false;
    }
    if (type.sort == Sort::aggregate || type.sort == Sort::array) {
        std::int64_t n = type.sort == Sort::aggregate ? static_cast<std::int64_t>(type.members.size()) : 1;
        if (type.sort == Sort::array) {
            for (const Dimension &dimension :
                 dimensions != nullptr && !dimensions->empty() ? *dimensions : type.dimensions) {
                const std::int64_t many = dimension.last.fixed - dimension.first.fixed + 1;
                if (!dimension.first.is_fixed() || !dimension.last.is_fixed() || many < 0 || many > 1 << 16 ||
                    (n *= many) > 1 << 16) {
                    return false;
                }
            }
        }
        if (n == 0 && type.sort == Type::Sort::array) {
            plan.empty.push_back({plan.fields.size(), parameter, node});
        }
        for (std::uint32_t i = 0; i < n; i++) {
            plan.nodes.push_back({node, i, id});
            if (!lay(plan, parameter, type.sort == Sort::array ? type.element : type.members[i].type,
                     static_cast<std::uint32_t>(plan.nodes.size() - 1), at, nullptr)) {
                return false;
            }
        }
        return true;
    }
    if (refers(type) || !encoding.algorithm.empty() || encoding.kind == Encoding::Kind::none ||
        (encoding.bits == 0 && (!encoding.sized || !encoding.size.is_fixed() ||
                                encoding.size.fixed < static_cast<std::int64_t>(encoding.size_tag)))) {
        return false;
    }
    plan.fields.push_back({parameter, id, node, raw_kind(encoding), value_kind(type)});
    plan.places.push_back(at);
    at += encoding.bits != 0 ? encoding.bits : static_cast<std::size_t>(encoding.size.fixed);
    plan.most = std::max(plan.most, at);
    return true;
}

void Decoder::join_steps(Plan &plan) const
{
    using Load = Plan::Load;
    using Make = Plan::Make;
    for (std::uint32_t i = 0; i < plan.fields.size(); i++) {
        const Field &field = plan.fields[i];
        const Type &type = db_.types[field.type];
        const Encoding &encoding = type.encoding;
        const bool whole = plan.places[i] % 8 == 0 && encoding.byte_order.empty() && !encoding.bits_reversed;
        const unsigned bits = encoding.bits;
        Plan::Step step{Load::other, Make::other, i, 1, bits, plan.places[i], &type};
        const Calibrator &calibrator = encoding.calibrator;
        if (encoding.form == NumberForm::ieee754 && whole && (bits == 32 || bits == 64)) {
            step.load = bits == 32 ? Load::f32 : Load::f64;
        } else if (encoding.form == NumberForm::plain && field.raw == Kind::natural && !encoding.bits_reversed &&
                   encoding.byte_order.empty()) {
            step.load = !whole       ? Load::bits
                        : bits == 8  ? Load::u8
                        : bits == 16 ? Load::u16
                        : bits == 32 ? Load::u32
                        : bits == 64 ? Load::u64
                                     : Load::bits;
        } else if (encoding.form == NumberForm::twos_complement && whole && (bits == 8 || bits == 16 || bits == 32)) {
            step.load = bits == 8 ? Load::i8 : bits == 16 ? Load::i16 : Load::i32;
        }
        if (step.load != Load::other) {
            const bool plain = calibrator.kind == Calibrator::Kind::none;
            if (plain && (field.raw == field.value)) {
                step.make = Make::same;
            } else if (plain && field.value == Kind::real) {
                step.make = field.raw == Kind::natural ? Make::from_natural : Make::from_integer;
            } else if (!calibrator.coefficients.empty() && field.value == Kind::real) {
                step.make = Make::line;
            }
        }
        Plan::Step *last = plan.steps.empty() ? nullptr : &plan.steps.back();
        if (last != nullptr && step.load != Load::other && last->load == step.load && last->make == step.make &&
            last->bits == bits && last->at + last->n * bits == step.at &&
            (step.make == Make::same || step.make == Make::from_natural || step.make == Make::from_integer ||
             last->type == &type)) {
            last->n++;
        } else {
            plan.steps.push_back(step);
        }
    }
}

bool Decoder::holds_planned(const Plan &plan, const Condition &condition) const
{
    const auto operand = [&](const Reference &reference) -> std::optional<Operand> {
        for (std::size_t i = plan.fields.size(); i-- > 0;) {
            const Field &field = plan.fields[i];
            if (field.parameter == reference.parameter && leads(reference, plan.nodes, field.node)) {
                const Type &type = db_.types[field.type];
                std::uint64_t raw = 0, value = 0;
                if (!number_of(type.encoding, load_bits(bytes_.data(), plan.places[i], type.encoding.bits), raw)) {
                    return std::nullopt;
                }
                if (!reference.calibrated) {
                    return Operand{field.raw, raw, &type};
                }
                // `convert` changes nothing here: a planned type refers to no other value.
                const Status status = const_cast<Decoder *>(this)->convert(type, field.raw, raw, value);
                return status == Status::uncalibrated
                           ? std::nullopt
                           : std::optional(Operand{field.value, value, &type, field.raw, raw});
            }
        }
        return std::nullopt;
    };
    switch (condition.kind) {
    case Condition::Kind::always: return true;
    case Condition::Kind::all:
        return std::all_of(condition.parts.begin(), condition.parts.end(),
                           [&](const Condition &part) { return holds_planned(plan, part); });
    case Condition::Kind::any:
        return std::any_of(condition.parts.begin(), condition.parts.end(),
                           [&](const Condition &part) { return holds_planned(plan, part); });
    case Condition::Kind::compare: break;
    }
    const auto left = operand(condition.left);
    if (!left || condition.right.of == Reference::Of::nothing) {
        return left && compare(condition.op, *left, condition.literal);
    }
    const auto right = operand(condition.right);
    return right && compare(condition.op, *left, *right);
}

/// The container of the packet, if plans lead to it and it is long enough; else no_id.
Id Decoder::planned(Id id, std::size_t bits)
{
    const Plan &plan = plan_of(id);
    if (!plan.fixed || plan.searches || plan.most > bits) {
        return no_id;
    }
    const Container &container = db_.containers[id];
    std::span<const Id> heirs = container.heirs;
    if (plan.dispatch.encoding != nullptr) {
        std::uint64_t key = 0;
        number_of(*plan.dispatch.encoding, load_bits(bytes_.data(), plan.dispatch.at, plan.dispatch.encoding->bits),
                  key);
        const auto found = plan.dispatch.heirs.find(key);
        heirs = found != plan.dispatch.heirs.end() ? found->second : plan.dispatch.others;
    }
    for (const Id heir : heirs) {
        if (holds_planned(plan, db_.containers[heir].restriction)) {
            return planned(heir, bits); // if no container fits, the search entry by entry decides
        }
    }
    return container.is_abstract ? no_id : id;
}

namespace {

template <class Unsigned, class Signed = Unsigned>
void load_all(const std::uint8_t *p, std::size_t n, std::uint64_t *raw)
{
    for (std::size_t i = 0; i < n; i++) {
        Unsigned loaded;
        std::memcpy(&loaded, p + i * sizeof loaded, sizeof loaded);
        if constexpr (std::endian::native == std::endian::little) {
            if constexpr (sizeof loaded == 2) {
                loaded = __builtin_bswap16(loaded);
            } else if constexpr (sizeof loaded == 4) {
                loaded = __builtin_bswap32(loaded);
            } else if constexpr (sizeof loaded == 8) {
                loaded = __builtin_bswap64(loaded);
            }
        }
        if constexpr (std::is_same_v<Signed, float>) {
            raw[i] = word(static_cast<double>(bit_cast<float>(loaded)));
        } else if constexpr (std::is_signed_v<Signed>) {
            raw[i] = static_cast<std::uint64_t>(static_cast<std::int64_t>(static_cast<Signed>(loaded)));
        } else {
            raw[i] = loaded;
        }
    }
}

} // namespace

void Decoder::run(const Plan &plan)
{
    using Load = Plan::Load;
    using Make = Plan::Make;
    const std::size_t n_fields = plan.fields.size();
    if (raw_.size() < n_fields) {
        raw_.resize(n_fields);
        values_.resize(n_fields);
        status_.resize(n_fields);
    }
    std::memset(status_.data(), 0, n_fields);
    for (const Plan::Step &step : plan.steps) {
        const std::uint8_t *const p = bytes_.data() + step.at / 8;
        std::uint64_t *const raw = raw_.data() + step.first;
        std::uint64_t *const values = values_.data() + step.first;
        const std::size_t n = step.n;
        switch (step.load) {
        case Load::u8: load_all<std::uint8_t>(p, n, raw); break;
        case Load::u16: load_all<std::uint16_t>(p, n, raw); break;
        case Load::u32: load_all<std::uint32_t>(p, n, raw); break;
        case Load::u64:
        case Load::f64: load_all<std::uint64_t>(p, n, raw); break;
        case Load::i8: load_all<std::uint8_t, std::int8_t>(p, n, raw); break;
        case Load::i16: load_all<std::uint16_t, std::int16_t>(p, n, raw); break;
        case Load::i32: load_all<std::uint32_t, std::int32_t>(p, n, raw); break;
        case Load::f32: load_all<std::uint32_t, float>(p, n, raw); break;
        case Load::bits:
            for (std::size_t i = 0; i < n; i++) {
                raw[i] = load_bits(bytes_.data(), step.at + i * step.bits, step.bits);
            }
            break;
        case Load::other: {
            const Type &type = *step.type;
            Status &status = status_[step.first];
            const Kind kind = raw_kind(type.encoding);
            Walk walk{step.at, 0};
            raw[0] = values[0] = 0;
            if (kind == Kind::text) {
                take_text(type, walk, raw[0], values[0], status);
                if (type.sort != Sort::text) {
                    const Status made_status = convert(type, kind, values[0], values[0]);
                    status = status == Status::good ? made_status : status;
                }
            } else if (kind == Kind::binary) {
                take_binary(type, walk, raw[0], values[0]);
            } else if (number_of(type.encoding, load_bits(bytes_.data(), step.at, step.bits), raw[0])) {
                status = convert(type, kind, raw[0], values[0]);
            } else {
                status = Status::malformed;
            }
            continue;
        }
        }
        switch (step.make) {
        case Make::same: std::memcpy(values, raw, 8 * n); break;
        case Make::from_natural:
            for (std::size_t i = 0; i < n; i++) {
                values[i] = word(static_cast<double>(raw[i]));
            }
            break;
        case Make::from_integer:
            for (std::size_t i = 0; i < n; i++) {
                values[i] = word(static_cast<double>(static_cast<std::int64_t>(raw[i])));
            }
            break;
        case Make::line:
            for (std::size_t i = 0; i < n; i++) {
                const double y = polynomial(step.type->encoding.calibrator.coefficients,
                                            *real_of(plan.fields[step.first].raw, raw[i]));
                values[i] = word(y);
                if (y != y) {
                    values[i] = word(std::nan(""));
                    status_[step.first + i] = Status::uncalibrated;
                }
            }
            break;
        case Make::other:
            for (std::size_t i = 0; i < n; i++) {
                status_[step.first + i] = convert(*step.type, plan.fields[step.first].raw, raw[i], values[i]);
            }
            break;
        }
    }
}

} // namespace fledge::ground
