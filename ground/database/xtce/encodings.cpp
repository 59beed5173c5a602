// SPDX-License-Identifier: Apache-2.0
#include "ground/database/calibrate.h"
#include "ground/database/xtce/readers.h"

#include <sstream>

namespace fledge::ground::xtce {

namespace {

constexpr std::size_t most_steps = 1024; // of a calculation

void number_form(Encoding &result, Node node)
{
    static const std::map<View, NumberForm> forms = {{"unsigned", NumberForm::plain},
                                                     {"twosComplement", NumberForm::twos_complement},
                                                     {"twosCompliment", NumberForm::twos_complement}, // of XTCE 1.0
                                                     {"signed", NumberForm::twos_complement}, // no standard, but common
                                                     {"onesComplement", NumberForm::ones_complement},
                                                     {"signMagnitude", NumberForm::sign_magnitude},
                                                     {"BCD", NumberForm::bcd},
                                                     {"packedBCD", NumberForm::packed_bcd},
                                                     {"IEEE754_1985", NumberForm::ieee754},
                                                     {"IEEE754", NumberForm::ieee754},
                                                     {"IEEE-754", NumberForm::ieee754}, // no standard, but common
                                                     {"MILSTD_1750A", NumberForm::mil1750a}};
    const bool real = result.kind == Encoding::Kind::real;
    const std::string name = node.attribute("encoding").as_string(real ? "IEEE754" : "unsigned");
    const auto form = forms.find(name);
    if (form == forms.end() || (form->second >= NumberForm::ieee754) != real) {
        refuse(node, "the encoding " + name + " is not known");
    }
    result.form = form->second;
    result.bits = count(node, node.attribute("sizeInBits").as_string(real ? "32" : "8"), 1, 64);
    const std::uint32_t unit = result.form == NumberForm::bcd ? 8 : result.form == NumberForm::packed_bcd ? 4 : 1;
    if (result.bits % unit != 0 ||
        (result.form == NumberForm::ieee754 && result.bits != 16 && result.bits != 32 && result.bits != 64) ||
        (result.form == NumberForm::mil1750a && result.bits != 32 && result.bits != 48)) {
        refuse(node, name + " has no form of " + std::to_string(result.bits) + " bits");
    }
}

Charset charset(Node node)
{
    static const char *const names[] = {"UTF-8",    "US-ASCII", "ISO-8859-1", "Windows-1252", "UTF-16",
                                        "UTF-16LE", "UTF-16BE", "UTF-32",     "UTF-32LE",     "UTF-32BE"};
    const std::string name = node.attribute("encoding").as_string("UTF-8");
    const auto found = std::find(std::begin(names), std::end(names), name);
    if (found == std::end(names)) {
        refuse(node, "the character set " + name + " is not known");
    }
    return static_cast<Charset>(found - std::begin(names));
}

void order(Encoding &result, Node node)
{
    const std::string text = node.attribute("byteOrder").as_string("mostSignificantByteFirst");
    const std::size_t bytes = (result.bits + 7) / 8;
    if (text == "leastSignificantByteFirst") {
        for (std::size_t i = 0; i < bytes; i++) {
            result.byte_order.push_back(static_cast<std::uint8_t>(i));
        }
    } else if (text != "mostSignificantByteFirst") {
        std::stringstream list(text);
        for (std::string significance; std::getline(list, significance, ',');) {
            result.byte_order.push_back(static_cast<std::uint8_t>(count(node, significance, 0, 7)));
        }
    }
    if (result.byte_order.empty() || bytes <= 1) {
        result.byte_order.clear();
        return;
    }
    if (result.bits % 8 != 0) {
        refuse(node, "a byte order needs whole bytes; found " + std::to_string(result.bits) + " bits");
    }
    std::vector<std::uint8_t> sorted = result.byte_order, backwards = sorted;
    std::sort(sorted.begin(), sorted.end());
    for (std::size_t i = 0; i < std::max(sorted.size(), bytes); i++) {
        if (i >= sorted.size() || i >= bytes || sorted[i] != i) {
            refuse(node, "a byte order has each significance from 0 to " + std::to_string(bytes - 1) + " once");
        }
    }
    std::sort(backwards.rbegin(), backwards.rend());
    if (result.byte_order == backwards) {
        result.byte_order.clear();
    }
}

void polynomial(Calibrator &result, Node node)
{
    for (Node term : elements(node)) {
        const std::uint32_t exponent = count(term, needed(term, "exponent"), 0, 64);
        result.coefficients.resize(std::max<std::size_t>(result.coefficients.size(), exponent + 1));
        result.coefficients[exponent] += real(term, needed(term, "coefficient"));
    }
}

void spline(Calibrator &result, Node node)
{
    result.order = count(node, node.attribute("order").as_string("1"), 0, 16);
    result.extrapolate = is_true(node, "extrapolate", false);
    for (Node point : elements(node)) {
        result.points.push_back({real(point, needed(point, "raw")), real(point, needed(point, "calibrated"))});
    }
    std::stable_sort(result.points.begin(), result.points.end(), [](auto &a, auto &b) { return a.raw < b.raw; });
    if (result.points.size() <= std::max(result.order, 1u)) {
        refuse(node, "a spline of order " + std::to_string(result.order) + " needs " +
                         std::to_string(std::max(result.order, 1u) + 1) + " points");
    }
}

} // namespace

void EncodingReader::math(Calibrator &result, Node node)
{
    int depth = 0;
    bool sound = true;
    for (Node child : elements(node)) {
        const View name = tag(child);
        MathStep step;
        int takes = 0, gives = 1;
        if (name == "ValueOperand") {
            step.number = any_number(child, child.text().get());
        } else if (name == "ThisParameterOperand") {
            step.kind = MathStep::Kind::this_value;
        } else if (name == "ParameterInstanceRefOperand") {
            step.kind = MathStep::Kind::value;
            step.value = values_.reference(child);
            result.refers = true;
        } else if (name == "Operator") {
            step.kind = MathStep::Kind::function;
            const auto found = math_function(trimmed(child.text().get()));
            if (!found) {
                refuse(child, "the operator " + std::string(trimmed(child.text().get())) + " is not known");
            }
            step.function = *found;
            takes = math_takes(*found);
            gives = math_gives(*found);
        } else {
            refuse_element(child);
        }
        if (result.steps.size() == most_steps) {
            refuse(child, "a calculation has at most " + std::to_string(most_steps) + " steps");
        }
        sound = sound && depth >= takes && depth - takes + gives <= math_depth;
        depth += gives - takes;
        result.steps.push_back(std::move(step));
    }
    if (depth != 1 || !sound) { // the stack has too few or too many values
        result.steps.clear();
    }
}

Calibrator EncodingReader::calibrator(Node node)
{
    using Kind = Calibrator::Kind;
    Calibrator result;
    for (Node child : elements(node)) {
        const View name = tag(child);
        if (result.kind != Kind::none) {
            refuse(child, "<" + std::string(tag(node)) + "> holds more than one calibrator");
        }
        if (name == "PolynomialCalibrator") {
            result.kind = Kind::polynomial;
            polynomial(result, child);
        } else if (name == "SplineCalibrator") {
            result.kind = Kind::spline;
            spline(result, child);
        } else if (name == "MathOperationCalibrator") {
            result.kind = Kind::math;
            math(result, child);
        } else if (!is_common(child)) {
            refuse_element(child);
        }
        if (result.kind != Kind::none && result.coefficients.empty() && result.points.empty() && result.steps.empty()) {
            declared_.note(child, "<" + std::string(name) + "> has no result: the values have none but the raw one");
        }
    }
    return result;
}

/// Read the size of text and binary: [bits] of the whole, and how text ends in it.
void EncodingReader::string_size(Encoding &result, Node node, bool text)
{
    bool ignored = false;
    for (Node child : elements(node)) {
        const View name = tag(child);
        if (name == "LeadingSize" && text) {
            result.size_tag = count(child, child.attribute("sizeInBitsOfSizeTag").as_string("16"), 1, 32);
        } else if (name == "TerminationChar" && text) {
            const View end = trimmed(child.text().get());
            result.terminator = hexadecimal(child, end.empty() ? "00" : end); // the standard's default
        } else if (!one_of(name, {"Fixed", "FixedValue", "DynamicValue", "DiscreteLookupList"})) {
            refuse_element(child);
        } else if (name == "DynamicValue" &&
                   element(child, "ParameterInstanceRef").attribute("parameterRef").value() == View("_yamcs_ignore")) {
            ignored = true; // a common way to write that the value alone has a size
        } else {
            result.sized = true;
            result.size = values_.quantity(node);
        }
    }
    if (const auto most = node.attribute("maxSizeInBits")) {
        result.most_bits = count(node, most.value(), 1, 1 << 24);
    }
    const std::int64_t fixed = result.size.fixed;
    if (!ignored && result.size.is_fixed() && (fixed < -1 || fixed > 8 * 65542)) {
        refuse(node, "a size is at most that of a packet; found " + std::to_string(fixed) + " bits");
    }
}

void EncodingReader::part(Encoding &result, Node child)
{
    const View name = tag(child);
    const bool text = result.kind == Encoding::Kind::text;
    if (name == "DefaultCalibrator") {
        result.calibrator = calibrator(child);
    } else if (name == "ContextCalibratorList") {
        for (Node item : elements(child)) {
            result.contexts.emplace_back(values_.condition(element(item, "ContextMatch")),
                                         calibrator(element(item, "Calibrator")));
        }
    } else if (name == "ByteOrderList") {
        for (Node item : elements(child)) {
            result.byte_order.push_back(static_cast<std::uint8_t>(count(item, needed(item, "byteSignificance"), 0, 7)));
        }
    } else if (name == "SizeInBits" || (text && name == "Variable")) {
        string_size(result, child, text);
    } else if (one_of(name, {"FromBinaryTransformAlgorithm", "ToBinaryTransformAlgorithm"})) {
        result.algorithm = child.attribute("name").value();
        declared_.note(child, "the algorithm " + result.algorithm + " is not computed: what it encodes is not decoded");
    } else if (name == "ErrorDetectCorrect") {
        declared_.note(child, "errors are not corrected");
    } else {
        refuse_element(child);
    }
}

Encoding EncodingReader::encoding(Node node)
{
    using Kind = Encoding::Kind;
    static const std::map<View, Kind> whats = {{"IntegerDataEncoding", Kind::integer},
                                               {"FloatDataEncoding", Kind::real},
                                               {"StringDataEncoding", Kind::text},
                                               {"BinaryDataEncoding", Kind::binary}};
    const auto what = whats.find(tag(node));
    if (what == whats.end()) {
        refuse_element(node);
    }
    Encoding result;
    result.kind = what->second;
    result.bits_reversed = node.attribute("bitOrder").as_string() == View("leastSignificantBitFirst");
    if (result.kind == Kind::integer || result.kind == Kind::real) {
        if (node.attribute("sizeInBits").as_string() == View("0")) {
            declared_.note(node, "0 bits are no encoding: no packet can have a value of this type");
            return {};
        }
        number_form(result, node);
    }
    for (Node child : elements(node)) {
        part(result, child);
    }
    if (result.kind == Kind::text) {
        result.charset = charset(node);
    }
    if (result.kind == Kind::binary && !result.sized && !result.algorithm.empty()) {
        result.sized = true;
        result.size.fixed = -1;
    }
    if ((result.kind == Kind::text || result.kind == Kind::binary) && !result.sized && result.size_tag == 0 &&
        result.terminator.empty()) {
        refuse(node, "<" + std::string(tag(node)) + "> has no size");
    }
    order(result, node);
    return result;
}

} // namespace fledge::ground::xtce
