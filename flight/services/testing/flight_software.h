// SPDX-License-Identifier: Apache-2.0
// What the tests of services share: flight software with some of them, and packets of commands.
#pragma once

extern "C" {
#include "flight/command/command.h"
}

#include <cstddef>
#include <cstdint>
#include <vector>

namespace service_testing {

using Bytes = std::vector<uint8_t>;

/// A number in n bytes, the highest first.
inline Bytes big(uint64_t value, int n)
{
    Bytes bytes;
    for (int i = n - 1; i >= 0; i--) {
        bytes.push_back(static_cast<uint8_t>(value >> 8 * i));
    }
    return bytes;
}

/// The number of n bytes.
inline uint64_t number(const uint8_t *p, int n)
{
    uint64_t value = 0;
    for (int i = 0; i < n; i++) {
        value = value << 8 | p[i];
    }
    return value;
}

inline Bytes operator+(Bytes a, const Bytes &b)
{
    a.insert(a.end(), b.begin(), b.end());
    return a;
}

/// A packet to the stream of command_table(), by the layout in command.h; rest: from the version on.
inline Bytes packet(int code, const Bytes &rest, uint64_t sequence = 9)
{
    Bytes p = big(0x1880, 2) + big(0xC000 + sequence, 2) + big(8 + rest.size() - 7, 2) +
              big(static_cast<uint64_t>(code), 1) + big(0, 1) + rest;
    uint8_t sum = 0xFF;
    for (const uint8_t byte : p) {
        sum ^= byte;
    }
    p[7] = sum;
    return p;
}

/// Services of a mission, and the entries of a table of them that no test changes.
inline CommandServices command_services(const CommandService *const *list, uint32_t n,
                                        void *(*module)(void *, uint32_t),
                                        const void *(*output)(const void *, uint16_t, uint32_t *) = nullptr)
{
    CommandServices services{};
    services.list = list;
    services.n = n;
    services.module = module;
    services.output = output;
    services.check = command_service_check;
    services.execute = command_service_execute;
    services.run = command_service_run;
    return services;
}

/// A service that a test is itself.
inline CommandService command_service(uint16_t first, uint16_t n, decltype(CommandService::check) check,
                                      decltype(CommandService::execute) execute)
{
    CommandService service{};
    service.first = first;
    service.n = n;
    service.check = check;
    service.execute = execute;
    return service;
}

inline CommandTable command_table(const CommandServices *services, uint8_t *queue, std::size_t room)
{
    CommandTable table{};
    table.stream = 0x1880;
    table.version = 0x1234;
    table.services = services;
    table.queue = queue;
    table.room = static_cast<uint32_t>(room);
    return table;
}

} // namespace service_testing
