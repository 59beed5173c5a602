// SPDX-License-Identifier: Apache-2.0
// Frames, definitions and messages (all that Fledge has among them), with what C++ makes of them, for readers in
// other languages:
//
//     frame HEX                          is read, and written as the same bytes
//     garbage HEX WHY                    is refused
//     schema HEX FIELDS                  a definition; name|type|unit|shape|offset|item|count; ...
//     nonsense HEX WHY                   is refused
//     message HEX LITTLE BIG             a message by its definition, as a payload in both orders
#include "cosim/protocol/testing/frames.h"
#include "sim/table.h"

#include <bit>
#include <cmath>
#include <cstdio>

extern "C" {
extern const FledgeLibrary fledge_library_flight;
extern const FledgeLibrary fledge_library_world;
}

using namespace fledge::cosim;
using namespace fledge::cosim::testing;

namespace {

std::string hex(std::span<const std::byte> bytes)
{
    std::string text;
    for (const std::byte b : bytes) {
        char digits[3];
        std::snprintf(digits, sizeof digits, "%02x", std::to_integer<unsigned>(b));
        text += digits;
    }
    return text;
}

std::string hex(const std::string &text)
{
    return hex(std::as_bytes(std::span(text)));
}

void tell_frame(const Bytes &bytes)
{
    try {
        decode(bytes);
        std::printf("frame %s\n", hex(bytes).c_str());
    } catch (const ProtocolError &error) {
        std::printf("garbage %s %s\n", hex(bytes).c_str(), error.what());
    }
}

void tell_schema(const std::string &text)
{
    try {
        std::string fields;
        for (const SchemaField &f : parse_schema(text)) {
            fields += f.name + "|" + f.type + "|" + f.unit + "|" + f.shape + "|" + std::to_string(f.offset) + "|" +
                      std::to_string(f.item) + "|" + std::to_string(f.count) + "; ";
        }
        std::printf("schema %s %s\n", hex(text).c_str(), hex(fields).c_str());
    } catch (const SchemaError &error) {
        std::printf("nonsense %s %s\n", hex(text).c_str(), hex(std::string(error.what())).c_str());
    }
}

/// Any number that a text can tell from another: no float is nonsense.
template <class T> void put_finite(std::byte *to, std::mt19937_64 &random)
{
    T x = std::ldexp(static_cast<T>(random()) - std::ldexp(T{1}, 63), static_cast<int>(random() % 200) - 160);
    std::memcpy(to, &x, sizeof x);
}

void tell_message(const std::string &text, std::mt19937_64 &random)
{
    const auto fields = parse_schema(text);
    Bytes bytes(fields.back().offset + std::size_t{fields.back().item} * fields.back().count);
    for (const SchemaField &field : fields) {
        for (std::uint32_t i = 0; i < field.count; i++) {
            std::byte *at = bytes.data() + field.offset + std::size_t{i} * field.item;
            if (field.type == "float64") {
                put_finite<double>(at, random);
            } else if (field.type == "float32") {
                put_finite<float>(at, random);
            } else {
                const std::uint64_t x = random();
                std::memcpy(at, &x, field.item);
            }
        }
    }
    const auto payload = [&](Order order) {
        Bytes p = make_payload(bytes).copy();
        if (order != native_order()) {
            swap_bytes(fields, std::span(p).subspan(4));
            p[1] = static_cast<std::byte>(order);
        }
        return hex(p);
    };
    std::printf("message %s %s %s\n", hex(text).c_str(), payload(Order::little).c_str(), payload(Order::big).c_str());
}

} // namespace

int main()
{
    std::mt19937 random(4);
    const auto frames = one_of_each();
    for (const Order order : {Order::little, Order::big}) {
        for (const Frame &frame : frames) {
            const Bytes whole = encode(frame, order);
            tell_frame(whole);
            for (std::size_t n = 0; n < whole.size(); n += 1 + random() % 40) {
                tell_frame({whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(n)});
                Bytes turned = whole;
                turned[n] ^= static_cast<std::byte>(1 << random() % 8);
                tell_frame(turned);
            }
        }
        for (int i = 0; i < 4000; i++) {
            Bytes b = encode(frames[random() % frames.size()], order);
            change(b, random);
            tell_frame(b);
        }
    }
    for (const char *text : {error_text, rich_text}) {
        tell_schema(text);
        for (int i = 0; i < 1000; i++) {
            tell_schema(change(text, random));
        }
        std::mt19937_64 numbers(5);
        for (int i = 0; i < 50; i++) {
            tell_message(text, numbers);
        }
    }
    std::mt19937_64 numbers(6);
    for (const FledgeLibrary *library : {&fledge_library_flight, &fledge_library_world}) {
        for (std::uint32_t i = 0; i < library->n; i++) {
            if (const char *text = library->structs[i]->schema) {
                tell_schema(text);
                tell_message(text, numbers);
            }
        }
    }
    return 0;
}
