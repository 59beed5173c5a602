// SPDX-License-Identifier: Apache-2.0
#include "core/doc.h"

#include "sim/text.h"

#include <cstring>

namespace fledge::core {

namespace {

bool has_unit(const FledgeField &field)
{
    return *field.unit && std::strcmp(field.unit, "-") != 0;
}

const char *kind_text(const FledgeField &field)
{
    switch (field.type) {
    case FLEDGE_F64:
    case FLEDGE_F32: return "float";
    case FLEDGE_CHAR: return "str";
    case FLEDGE_ENUM: return field.values ? field.values->name : "int";
    case FLEDGE_STRUCT: return field.ctype;
    default: return "int";
    }
}

/// "(3, 3)", "(n <= 8, 3)"; "" for a scalar.
std::string shape_text(const FledgeField &field)
{
    if (!field.ndim) {
        return "";
    }
    std::string text = "(";
    for (std::uint32_t i = 0; i < field.ndim; i++) {
        text += i ? ", " : field.count ? std::string(field.count) + " <= " : "";
        text += std::to_string(field.shape[i]);
    }
    return text + ")";
}

/// " [N m]", or "" if the field has no unit or is dimensionless.
std::string unit_text(const FledgeField &field)
{
    return has_unit(field) ? " [" + std::string(field.unit) + "]" : "";
}

/// "float [N m], shape (3), required, > 0"
std::string summary(const FledgeField &field)
{
    std::string text = kind_text(field) + unit_text(field);
    if (const std::string shape = shape_text(field); !shape.empty() && field.type != FLEDGE_CHAR) {
        text += ", shape " + shape;
    }
    if (const std::string rule = rule_text(field); !rule.empty()) {
        text += ", " + rule;
    }
    return text;
}

void add_group(std::string &text, const FledgeStruct &table, FledgeGroup group, const char *title)
{
    std::string lines;
    for (std::uint32_t i = 0; i < table.n; i++) {
        const FledgeField &field = table.fields[i];
        if (field.group != group || field.flags & FLEDGE_SPARE) {
            continue;
        }
        lines += "\n    " + std::string(field.name) + ": " + summary(field);
        if (*field.doc) {
            lines += "\n        " + std::string(field.doc);
        } else if (field.sub && *field.sub->doc) {
            const std::string doc = field.sub->doc;
            lines += "\n        " + doc.substr(0, doc.find('\n'));
        }
    }
    if (!lines.empty()) {
        text += "\n\n" + std::string(title) + ":" + lines;
    }
}

/// What inspect.signature() and the first line of help() show.
std::string signature(const FledgeStruct &table)
{
    std::string text;
    for (const bool required : {true, false}) {
        for (std::uint32_t i = 0; i < table.n; i++) {
            const FledgeField &field = table.fields[i];
            const bool settable =
                field.group == FLEDGE_PAR || table.kind == FLEDGE_MESSAGE || table.kind == FLEDGE_PLAIN;
            if (!settable || field.flags & FLEDGE_SPARE ||
                static_cast<bool>(field.flags & FLEDGE_REQUIRED) != required) {
                continue;
            }
            text += (text.empty() ? "*, " : ", ") + std::string(field.name);
            text += required ? "" : field.type == FLEDGE_CHAR ? "=''" : field.sub ? "=None" : "=0";
        }
    }
    if (table.kind == FLEDGE_MODULE) {
        text += (text.empty() ? "*, " : ", ") + std::string("update=None, reset=None, turns=None");
    }
    // PyType_FromSpec takes the part before "--" as the signature.
    return std::string(table.name) + "(" + text + ")\n--\n\n";
}

} // namespace

std::string rule_text(const FledgeField &field)
{
    std::string text;
    const auto add = [&](const std::string &clause) { text += (text.empty() ? "" : ", ") + clause; };
    if (field.flags & FLEDGE_REQUIRED) {
        add("required");
    }
    if (field.flags & FLEDGE_OPTIONAL) {
        add("optional");
    }
    if (field.flags & FLEDGE_INITIAL) {
        add("initial");
    }
    if (field.distinct) {
        add(std::string("distinct from ") + field.distinct);
    }
    if (field.flags & FLEDGE_NON_ZERO) {
        add("non-zero");
    }
    if (field.flags & FLEDGE_INERTIA) {
        add("inertia");
    }
    if (field.bounds) {
        add(sim::bounds_text(field));
    }
    return text;
}

std::string field_doc(const FledgeField &field)
{
    const std::string meaning = *field.doc ? field.doc : field.sub ? field.sub->doc : "";
    return summary(field) + (meaning.empty() ? "" : "\n\n" + meaning);
}

std::string type_doc(const FledgeStruct &table)
{
    std::string text = signature(table) + table.doc;
    if (table.kind == FLEDGE_MODULE || table.kind == FLEDGE_MODEL) {
        add_group(text, table, FLEDGE_IN, "Inputs");
        add_group(text, table, FLEDGE_OUT, "Outputs");
        add_group(text, table, FLEDGE_PAR, "Parameters");
        add_group(text, table, FLEDGE_MEM, "Memory");
        if (table.kind == FLEDGE_MODULE) {
            text += "\n\nIn Python:\n    update: update(m, t, dt), a function of Python in place of the C\n"
                    "    reset: reset(m), to run after that of the C\n"
                    "    turns: how many turns of loops and returns of functions an update may take on a target";
        }
    } else {
        add_group(text, table, FLEDGE_NONE, "Fields");
    }
    return text + "\n\nDeclared in " + table.header + ".";
}

} // namespace fledge::core
