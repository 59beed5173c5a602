// SPDX-License-Identifier: Apache-2.0
// Shared by the tests of the network: nodes that count, folders of keys.
#pragma once

#include "cosim/router/router.h"

#include "cosim/node/delegate.h"
#include "cosim/protocol/testing/words.h"

#include <atomic>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <future>
#include <mutex>
#include <string>
#include <thread>
#include <unistd.h>

namespace fledge::cosim::testing_nodes {

/// Writes its input plus one, at each multiple of 10.
class Counter : public Node {
public:
    Counter(std::string reads, std::string writes, Latency latency)
        : reads_(std::move(reads)), writes_(std::move(writes)), latency_(latency)
    {
    }

    Initialized initialize(const Initialize &m) override
    {
        initialized = m;
        return {{{10, 0}}, false};
    }
    std::vector<Subscription> desired() override
    {
        return reads_.empty() ? std::vector<Subscription>{}
                              : std::vector<Subscription>{{reads_, latency_, false, schema_}};
    }
    std::vector<Publication> match(const std::vector<Channel> &channels) override
    {
        for (const Channel &channel : channels) {
            if (channel.topic == writes_) {
                channel_ = channel.channel;
                return {{*channel_, schema_, word(0)}};
            }
        }
        return {};
    }
    void start(const std::vector<Channel> &) override { count_ = 0; }
    Tock tick(const Tick &tick) override
    {
        Tock tock{tick.until, 0, {}};
        auto record = tick.records.begin();
        for (; next <= tick.until; next += 10) {
            for (; record != tick.records.end() && record->t <= next; ++record) {
                received = word_of(record->payload);
                all.push_back({next, received});
            }
            before_step(next);
            if (channel_) {
                tock.records.push_back({*channel_, ++count_, next, word(received + 1)});
            }
        }
        return tock;
    }
    void finish(const std::string &why) override { reason = why; }
    virtual void before_step(Ns) {}

    std::uint64_t received = 0;
    std::vector<std::pair<Ns, std::uint64_t>> all; ///< all inputs with their times
    Ns next = 0;
    Initialize initialized;
    std::string reason = "(no end)";

private:
    Schema schema_ = make_schema("Word", word_text);
    std::string reads_, writes_;
    Latency latency_;
    std::optional<std::uint32_t> channel_;
    std::uint32_t count_ = 0;
};

inline ControllerConfig config_of(std::vector<NodeConfig> nodes, Ns end)
{
    ControllerConfig config;
    config.simulation = "test";
    config.nodes = std::move(nodes);
    config.end = end;
    return config;
}

/// Calls a function in a thread of its own. std::async by itself instantiates its threads for each lambda anew, which
/// takes a fifth of the time to compile these tests.
template <class Function> auto in_thread(Function function)
{
    return std::async(std::launch::async, std::function<std::invoke_result_t<Function>()>(std::move(function)));
}

/// Run a node; returns the reason of the end, or "threw: ...".
inline std::string serve(zmq::context_t &context, const std::string &address, const std::string &name, Node &node,
                         const std::string &keys = "",
                         std::chrono::milliseconds connect_timeout = std::chrono::seconds(20))
{
    try {
        MemberConfig config;
        config.simulation = "test";
        config.node = name;
        config.address = address;
        config.connect_timeout = connect_timeout;
        config.keys = keys;
        return Delegate(context, config).serve(node);
    } catch (const std::exception &error) {
        return std::string("threw: ") + error.what();
    }
}

/// A folder of keys, removed after the test.
class Keys {
public:
    Keys()
    {
        std::string name = (std::filesystem::temp_directory_path() / "fledge-keys-XXXXXX").string();
        folder_ = mkdtemp(name.data());
        std::filesystem::create_directory(folder_ / "allowed");
        make("controller");
    }
    ~Keys() { std::filesystem::remove_all(folder_); }
    Keys(const Keys &) = delete;
    Keys &operator=(const Keys &) = delete;

    std::filesystem::path folder() const { return folder_; }
    std::string of(const std::string &name) const { return folder_ / (name + ".secret"); }

    /// Make a pair in the controller's folder.
    KeyPair make(const std::string &name)
    {
        char open[41], secret[41];
        zmq_curve_keypair(open, secret);
        write(folder_ / (name + ".public"), open, "");
        write(folder_ / (name + ".secret"), open, std::string("    secret-key = \"") + secret + "\"\n");
        std::filesystem::permissions(of(name), std::filesystem::perms::owner_read);
        return {open, secret};
    }

    /// Make a pair that the controller accepts.
    KeyPair allow(const std::string &name, const std::string &nodes)
    {
        const KeyPair pair = make(name);
        write(folder_ / "allowed" / (name + ".public"), pair.open, "", nodes);
        return pair;
    }

    static void write(const std::filesystem::path &path, const std::string &open, const std::string &more,
                      const std::string &nodes = "")
    {
        std::ofstream file(path);
        file << "# a key\nmetadata\n    name = \"x\"\n";
        if (!nodes.empty()) {
            file << "    nodes = \"" << nodes << "\"\n";
        }
        file << "curve\n    public-key = \"" << open << "\"\n" << more;
    }

private:
    std::filesystem::path folder_;
};

/// What a controller in another thread reports.
struct Reports {
    /// Wait up to 10 s for a report with this text.
    bool reported(const std::string &text)
    {
        for (int i = 0; i < 1000; i++) {
            {
                const std::lock_guard lock(mutex);
                if (reports.find(text) != reports.npos) {
                    return true;
                }
            }
            std::this_thread::sleep_for(std::chrono::milliseconds(10));
        }
        return false;
    }

    std::mutex mutex;
    std::string reports;
};

} // namespace fledge::cosim::testing_nodes
