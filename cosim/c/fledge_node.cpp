// SPDX-License-Identifier: Apache-2.0
// The C face of a StructNode.
#include "cosim/c/fledge_node.h"

#include "cosim/node/struct_node.h"

#include <new>

using namespace fledge::cosim;

struct FledgeNode {
    FledgeNode(DelegateConfig config, Rate steps) : node(std::move(config), steps) {}

    /// Do this; what it throws is the error.
    template <class F> int attempt(F function)
    {
        try {
            error.clear();
            function();
        } catch (const std::exception &e) {
            error = e.what();
        }
        return error.empty() ? 0 : -1;
    }

    StructNode node;
    std::string error;
};

namespace {

std::string text(const char *given)
{
    return given ? given : "";
}

Schema schema(const char *type, const char *definition)
{
    return definition ? make_schema(text(type), definition) : Schema{text(type), "", 0, 0};
}

} // namespace

FledgeNode *fledge_node_create(const char *simulation, const char *node, const char *address, int64_t every,
                               int64_t offset)
{
    try {
        DelegateConfig config;
        config.simulation = text(simulation);
        config.node = text(node);
        config.address = text(address);
        return new FledgeNode(std::move(config), {every, offset});
    } catch (const std::bad_alloc &) {
        return nullptr;
    }
}

void fledge_node_destroy(FledgeNode *node)
{
    delete node;
}

int fledge_node_reads(FledgeNode *node, const char *topic, FledgeLatency latency, const char *type,
                      const char *definition, void *message, size_t size)
{
    return node->attempt([&] {
        node->node.read(topic, static_cast<Latency>(latency), std::span(static_cast<std::byte *>(message), size),
                        schema(type, definition));
    });
}

int fledge_node_writes(FledgeNode *node, const char *topic, const char *type, const char *definition, void *message,
                       size_t size)
{
    return node->attempt(
        [&] { node->node.write(topic, std::span(static_cast<std::byte *>(message), size), schema(type, definition)); });
}

int fledge_node_keeps(FledgeNode *node, void *state, size_t size)
{
    return node->attempt([&] { node->node.keep(std::span(static_cast<std::byte *>(state), size)); });
}

int fledge_node_run(FledgeNode *node, FledgeStep step, void *user)
{
    return node->attempt([&] {
        node->error = node->node.run([&](Ns t) {
            if (const int code = step(user, t)) {
                throw std::runtime_error("its step returned " + std::to_string(code));
            }
        });
    });
}

void fledge_node_leave(FledgeNode *node)
{
    node->node.leave();
}

const char *fledge_node_error(const FledgeNode *node)
{
    return node->error.c_str();
}
