// SPDX-License-Identifier: Apache-2.0
#include "cosim/router/router.h"

#include "cosim/router/capacity.h"
#include "sim/text.h"

#include <algorithm>
#include <thread>

namespace fledge::cosim {

namespace {

using namespace std::chrono_literals;

constexpr auto check_period = 100ms; ///< of connections and limits of time
constexpr auto held_period = 2ms;    ///< between two looks at observers for which the run waits
constexpr std::size_t most_attaching = 1000;
constexpr std::int64_t longest_greeting = 4096; ///< [bytes]
constexpr int most_names = 100;                 ///< of sockets, to try
constexpr auto longest_rest = 20ms;             ///< between two looks at the sockets, if all nodes share memory
constexpr auto longest_busy_wait = 60us;        ///< longer than a processor needs to wake up

/// What a descriptor in the poller belongs to.
enum Kind : std::uint64_t { greetings, greeters, wake_up, timer, frames, events, kinds };

std::uint64_t key(Kind kind, NodeId id = 0)
{
    return id * kinds + kind;
}

ControllerConfig adjusted(ControllerConfig config, bool listened, bool held)
{
    config.listened = config.listened || listened;
    held = held || std::any_of(config.asynchronous.begin(), config.asynchronous.end(),
                               [](const AsynchronousConfig &program) { return program.complete > 0; });
    config.horizon = !held ? config.horizon : config.past ? config.past->until : -1;
    return config;
}

} // namespace

Router::Router(zmq::context_t &context, const ControllerConfig &controller, RouterConfig config)
    : context_(context), config_(std::move(config)), simulation_(controller.simulation),
      controller_(adjusted(with_broker(controller), config_.broker || !config_.listeners.empty(),
                           config_.pace > 0.0 || config_.steered || config_.window > 0)),
      greetings_(context, zmq::socket_type::router), greeters_(context, greetings_), nodes_(controller.nodes.size())
{
    for (const NodeConfig &node : controller.nodes) {
        names_.push_back(node.name);
    }
    for (const AsynchronousConfig &program : controller.asynchronous) {
        names_.push_back(program.name);
    }
    set_up(greetings_, config_.limits);
    greetings_.set(zmq::sockopt::backlog, static_cast<int>(most_attaching)); // many programs may greet at once
    greetings_.set(zmq::sockopt::maxmsgsize, longest_greeting);
    if (!config_.any_user) {
        refuse_other_users(greetings_);
    }
    if (authenticator_) {
        authenticator_->guard(greetings_);
    }
    try {
        cosim::bind(greetings_, config_.address);
    } catch (const zmq::error_t &error) {
        throw LinkError("cannot listen at " + config_.address + ": " + error.what() +
                        (error.num() == EADDRINUSE ? "; is another controller running?" : ""));
    }
    address_ = greetings_.get(zmq::sockopt::last_endpoint);
    poller_.add(descriptor(greetings_), key(Kind::greetings));
    poller_.add(descriptor(greeters_.events()), key(Kind::greeters));
    greeters_.number(-1); // its descriptor reports only what comes after a first look
    if (config_.pace > 0.0 || config_.steered || !complete_programs_.empty()) {
        pace_.emplace(config_.pace);
        poller_.add(pace_->fd(), key(Kind::timer));
    }
    if (config_.sharing != Sharing::forbidden && !address_.starts_with("inproc://")) {
        try {
            wake_up_.emplace();
            poller_.add(wake_up_->fd(), key(Kind::wake_up));
        } catch (const LinkError &) {
            wake_up_.reset();
            if (config_.sharing == Sharing::required) {
                throw;
            }
        }
    }
}

Router::~Router()
{
    try {
        controller_.stop("the controller was ended");
        act();
    } catch (const std::exception &) {
        // The nodes notice that the connection is closed.
    }
}

void Router::host(const std::string &name, Node &node)
{
    hosted_.push_back(&node);
    controller_.hello(hosted_.size(), {protocol_version, protocol_version, simulation_, name, Role::node, false});
    act();
}

/// A reply may lead to the next request.
void Router::call_hosted()
{
    while (!calls_.empty() && Clock::now() - checked_ < check_period) {
        const auto [id, request] = std::move(calls_.front());
        calls_.pop_front();
        Frame reply{request.number, {}};
        try {
            reply.message = answer(*nodes_[id].hosted, request.message);
        } catch (const std::exception &error) {
            reply.message = Failed{error.what()};
        }
        received(id, std::move(reply));
    }
}

std::string Router::run(const std::function<bool()> &poll)
{
    checked_ = complete_ = Clock::now();
    const unsigned processors = std::thread::hardware_concurrency();
    busy_wait_ = processors > 1 && processors >= nodes_.size() - hosted_.size() ? longest_busy_wait : 0us;
    spin_ = Spin(processors > 1 ? longest_busy_wait : 0us);
    auto waited = checked_;
    while (!controller_.done()) {
        if (broker_ && broker_->received()) {
            inject_messages();
        }
        call_hosted();
        const bool plays = controller_.play();
        if (plays) {
            act();
        }
        const bool busy = listen_to_shared() || plays;
        listen_again();
        const auto now = Clock::now();
        if (now - checked_ >= check_period) {
            check_periodically(poll);
        }
        const bool held = holds(now);
        if (pace_) {
            pace_->update(controller_, nodes_.size(), now, held);
            act();
        } else if (config_.window > 0 && controller_.running() && !controller_.waiting() &&
                   finished(controller_, nodes_.size()) && controller_.next_due() != for_ever) {
            controller_.set_horizon(controller_.next_due() + config_.window);
            act();
        }
        // While the router is busy with some nodes, it still looks at all sockets every millisecond.
        const bool more = busy || !calls_.empty() || controller_.done();
        if (!more || now - waited >= 1ms) {
            waited = now;
            wait(more ? 0ms : held ? held_period : check_period);
        }
    }
    hear_waiting(); // the run is over
    return outcome_;
}

/// Sleep until an event or for the time `most`, then handle all events.
void Router::wait(std::chrono::milliseconds most)
{
    const bool sleeps = most.count() && !sharing_.empty();
    if (wake_up_) {
        wake_up_->wake();
    }
    if (sleeps && spin_.spin([&] { return anything_shared(); })) {
        return;
    }
    if (sleeps) {
        const bool rests = choose_waking_nodes();
        wake_up_->arm(rests ? WakeUp::rests : WakeUp::polls);
        if (anything_shared()) {
            most = 0ms;
        } else if (rests) {
            wake_up_->rest(longest_rest);
            wake_up_->disarm(false);
            if (anything_shared()) {
                return;
            }
            most = 0ms; // look at the sockets, too
        }
    }
    const auto &ready = poller_.wait(most);
    if (wake_up_) {
        wake_up_->disarm(std::find(ready.begin(), ready.end(), key(Kind::wake_up)) != ready.end());
    }
    for (const std::uint64_t what : ready) {
        const NodeId id = what / kinds;
        switch (static_cast<Kind>(what % kinds)) {
        case Kind::greetings: greet(); break;
        case Kind::greeters: check_greeting_programs(); break;
        case Kind::frames: listen(id); break;
        case Kind::events: check_connection(id); break;
        default: break;
        }
    }
}

/// Let only those nodes wake the controller whose replies can unblock a node. True if all of them share memory.
bool Router::choose_waking_nodes()
{
    const bool some = controller_.unblocking_nodes(unblocking_);
    std::size_t expected = 0;
    for (const NodeId id : sharing_) {
        nodes_[id].link->shared()->wake_on_message(!some || unblocking_[id]);
        expected += some && unblocking_[id];
    }
    return some && expected == static_cast<std::size_t>(std::count(unblocking_.begin(), unblocking_.end(), true));
}

bool Router::anything_shared() const
{
    return std::any_of(sharing_.begin(), sharing_.end(),
                       [&](NodeId id) { return nodes_[id].link->shared()->pending(); });
}

bool Router::listen_to_shared()
{
    bool any = false;
    for (std::size_t i = 0; i < sharing_.size(); i++) {
        const NodeId id = sharing_[i];
        if (nodes_[id].link->shared()->pending()) {
            listen(id); // it may shorten the list; then the loop skips a node until the next call
            any = true;
        }
    }
    if (any) {
        wake_up_->wake();
    }
    return any;
}

void Router::listen_again()
{
    while (!unsure_.empty()) {
        const NodeId id = unsure_.back();
        unsure_.pop_back();
        if (nodes_[id].unsure) {
            listen(id);
        }
    }
    if (greetings_unsure_) {
        greet();
    }
}

void Router::greet()
{
    zmq::message_t parts[2];
    auto &[peer, hello] = parts;
    greetings_unsure_ = false;
    while (const std::size_t n = receive_parts(greetings_, parts)) {
        greeting_peer_.assign(peer.data<std::byte>(), peer.data<std::byte>() + peer.size());
        greeting_fd_ = zmq_msg_get(hello.handle(), ZMQ_SRCFD);
        try {
            if (n != 2) {
                throw ProtocolError("a frame is one part, not " + std::to_string(n - 1));
            }
            const Frame frame = decode({hello.data<std::byte>(), hello.size()}, config_.limits);
            const auto *m = std::get_if<Hello>(&frame.message);
            if (!m) {
                throw ProtocolError(std::string("expected Hello, found ") + kind_name(frame.message));
            }
            if (keyed() && !authenticator_->may_speak_as(hello, m->node)) {
                const std::string why =
                    "its key " + authenticator_->name_of(hello) + " is not allowed to speak as " + m->node;
                report("a program was not let in: " + why);
                throw ProtocolError(why);
            }
            if (m->role == Role::asynchronous) {
                attach(*m);
                continue;
            }
            hear(*m);
        } catch (const ProtocolError &error) {
            reply(greeting_peer_, Refused{error.what()});
        }
        act();
    }
}

/// A program that has greeted may be a stranger, which soon leaves the place: the next one waits until it has replied.
/// A lost program sent its last frame and closed its connection before its successor greeted; the router may have read
/// neither yet.
void Router::hear(const Hello &hello)
{
    const auto id = static_cast<NodeId>(std::find(names_.begin(), names_.end(), hello.node) - names_.begin());
    if (id < nodes_.size()) {
        check_connection(id);
        if (controller_.only_greeted(id) && std::cmp_less(waiting_.size(), most_attaching)) {
            waiting_.push_back({hello, greeting_peer_, greeting_fd_});
            return;
        }
    }
    controller_.hello(0, hello);
}

void Router::hear_waiting()
{
    for (Waiting &waiting : std::exchange(waiting_, {})) {
        greeting_peer_ = std::move(waiting.peer);
        greeting_fd_ = waiting.fd;
        hear(waiting.hello);
        act();
    }
}

/// A program keeps the connection on which it greeted until it has taken its own socket.
void Router::check_greeting_programs()
{
    for (NodeId id = 0; id < nodes_.size(); id++) {
        const NodeSlot &slot = nodes_[id];
        if (slot.link && !slot.joined && slot.greeting_fd >= 0 &&
            (!slot.greeting || greeters_.number(slot.greeting_fd) != slot.greeting)) {
            check_connection(id); // its Hello may have come
            if (!slot.joined) {
                controller_.forget(id, "its connection is gone");
                act();
            }
        }
    }
    greeters_.number(-1);
}

/// Make the broker before the controller, which sends the broker's addresses to the nodes.
ControllerConfig Router::with_broker(ControllerConfig controller)
{
    std::size_t programs = controller.nodes.size();
    for (const AsynchronousConfig &program : controller.asynchronous) {
        programs += program.complete;
    }
    make_room(context_, programs);
    if (!config_.keys.empty()) {
        authenticator_ = std::make_unique<Authenticator>(context_, config_.keys);
    }
    check_address(config_.address);
    if (config_.broker) {
        BrokerConfig broker;
        const bool tcp = config_.address.starts_with("tcp://");
        const std::string any = config_.address.substr(0, config_.address.rfind(':') + 1) + "*";
        broker.frontend = !config_.frontend.empty() ? config_.frontend : tcp ? any : config_.address + "-frontend";
        broker.backend = !config_.backend.empty() ? config_.backend : tcp ? any : config_.address + "-backend";
        broker.limits = config_.limits;
        broker.any_user = config_.any_user;
        broker.after = controller.past ? controller.past->until : -1;
        broker.patience = config_.reply;
        bool all = false;
        for (const AsynchronousConfig &program : controller.asynchronous) {
            if (program.complete) {
                awaited_[program.name] += program.complete;
                complete_programs_.push_back(program.name);
                all = all || program.hears.empty();
                broker.complete_topics.insert(program.hears.begin(), program.hears.end());
            }
        }
        if (all) {
            broker.complete_topics.clear();
        }
        broker.observers = awaited_;
        broker.complete = tcp ? any : config_.address + "-complete";
        check_address(broker.frontend);
        check_address(broker.backend);
        broker_ = std::make_unique<Broker>(context_, broker, authenticator_.get());
        controller.frontend = broker_->frontend();
        controller.backend = broker_->backend();
        config_.listeners.push_back(broker_.get());
    } else if (!controller.asynchronous.empty()) {
        throw LinkError("asynchronous programs, such as " + controller.asynchronous.front().name +
                        ", need a broker, and this controller has none");
    }
    return controller;
}

std::string warning(const RouterConfig &config)
{
    return !config.keys.empty() || is_local(config.address)
               ? ""
               : "warning: without keys, any program that reaches " + config.address +
                     " reads all messages and may take any part; ./fledge keys new controller makes keys";
}

void Router::check_address(const std::string &address) const
{
    if (!authenticator_ && !is_local(address) && !config_.unencrypted_beyond_machine) {
        throw LinkError(address + " can be reached from other machines, which needs keys: ./fledge keys new "
                                  "controller, and --keys; or listen at tcp://127.0.0.1");
    }
}

/// Answer the greeting of an asynchronous program, or store it until the matching, which determines the topics.
void Router::attach(const Hello &hello)
{
    const auto refuse = [&](const std::string &why) { reply(greeting_peer_, Refused{why}); };
    if (const std::string reason = controller_.refusal(hello); !reason.empty()) {
        return refuse(reason);
    }
    if (!broker_) {
        return refuse("this controller has no broker, so there can be no observers");
    }
    if (controller_.finishing() || controller_.done()) {
        return refuse("the run is over");
    }
    if (controller_.matched()) {
        return reply(greeting_peer_, attached(hello.node));
    }
    if (std::cmp_greater_equal(attaching_.size(), most_attaching)) {
        return refuse("too many programs wait for the run to begin");
    }
    attaching_.emplace_back(greeting_peer_, hello.node);
}

Message Router::attached(const std::string &program) const
{
    return Attached{broker_->frontend(), broker_->backend(program), controller_.channels()};
}

/// Whether no node may go on now, because complete observers do not keep up, or are not there yet.
bool Router::holds(Clock::time_point now)
{
    if (complete_programs_.empty() || !controller_.running()) {
        return false;
    }
    began_ = began_ == Clock::time_point{} ? now : began_;
    std::erase_if(awaited_, [&](const auto &entry) { return broker_->came(entry.first) >= entry.second; });
    if (!awaited_.empty()) {
        if (now - began_ < config_.join) {
            return true;
        }
        std::vector<std::string> missing;
        for (const auto &[program, observers] : awaited_) {
            missing.push_back(program);
        }
        report("the run goes on without " + sim::format_list(missing) + ", which did not come within " +
               sim::format_time(std::chrono::nanoseconds(config_.join).count()));
        awaited_.clear();
    }
    return broker_->holds();
}

void Router::answer_attaching()
{
    for (const auto &[peer, program] : std::exchange(attaching_, {})) {
        reply(peer, controller_.matched() ? attached(program) : Message(Refused{"the run is over: " + outcome_}));
    }
}

/// Pass the messages of asynchronous programs to the controller.
void Router::inject_messages()
{
    for (const Broker::Written &written : broker_->take()) {
        if (const std::string why = controller_.inject(written.program, written.topic, written.payload); !why.empty()) {
            broker_->refuse(written.program + " writes " + written.topic + ": " + why);
        }
    }
    act();
}

/// libzmq uses no keys within one program (inproc://).
bool Router::keyed() const
{
    return authenticator_ && !config_.address.starts_with("inproc://");
}

void Router::report(const std::string &text)
{
    if (config_.report) {
        config_.report(text);
    }
}

void Router::reply(std::span<const std::byte> peer, const Message &message)
{
    const Bytes bytes = encode({1, message});
    // libzmq drops messages to a disconnected program.
    (void)send_part(greetings_, zmq::buffer(peer.data(), peer.size()),
                    zmq::send_flags::sndmore | zmq::send_flags::dontwait);
    (void)send_part(greetings_, zmq::buffer(bytes), zmq::send_flags::dontwait);
    greetings_unsure_ = true;
}

void Router::listen(NodeId id)
{
    NodeSlot &slot = nodes_[id];
    Frame frame;
    try {
        while (slot.link && slot.link->receive(frame)) {
            if (!slot.joined) {
                join(id, frame);
                continue;
            }
            received(id, std::move(frame));
        }
        slot.unsure = false;
    } catch (const ProtocolError &error) {
        controller_.forget(id, std::string("it sent no frame: ") + error.what());
        act();
    } catch (const LinkError &error) {
        controller_.lost(id, error.what());
        act();
    }
}

/// The last frame of a lost node counts.
void Router::check_connection(NodeId id)
{
    const bool gone = nodes_[id].link && nodes_[id].link->gone();
    listen(id);
    if (gone) {
        controller_.forget(id, "its connection is gone");
        act();
    }
}

void Router::received(NodeId id, Frame &&frame)
{
    NodeSlot &slot = nodes_[id];
    slot.replied = true;
    slot.answered = Clock::now();
    if (const auto *tock = std::get_if<Tock>(&frame.message)) {
        NodeTimes &times = slot.times;
        const Ns whole = std::chrono::nanoseconds(slot.answered - slot.requested).count();
        const Ns compute = std::clamp(tock->compute_ns, Ns{0}, whole); // whatever the node reports
        times.ticks++;
        times.compute += compute;
        times.transport += whole - compute;
    }
    controller_.received(id, std::move(frame));
    act();
}

NodeTimes Router::times(NodeId id) const
{
    const NodeSlot &slot = nodes_[id];
    NodeTimes times = slot.times;
    const auto now = Clock::now();
    if (controller_.waiting_for(id)) {
        times.pending = std::chrono::nanoseconds(now - slot.requested).count();
    } else if (times.ticks && std::string_view(controller_.state(id)) == "running") {
        times.wait += std::chrono::nanoseconds(now - slot.answered).count();
    }
    return times;
}

/// Handle the node's first frame on its own socket, which says which of the connections is the node's.
void Router::join(NodeId id, const Frame &frame)
{
    NodeSlot &slot = nodes_[id];
    const auto *hello = std::get_if<Hello>(&frame.message);
    if (!hello || hello->simulation != simulation_ || hello->node != names_[id]) {
        return; // a stranger's
    }
    slot.link->accept();
    if (hello->shared && !slot.proposed) {
        throw ProtocolError("a Hello over shared memory, which the controller did not propose");
    }
    if (hello->shared) {
        poller_.remove(slot.link->frames());
        slot.link->share(std::move(slot.proposed));
        sharing_.push_back(id);
    } else if (config_.sharing == Sharing::required) {
        throw LinkError("it does not take shared memory, which this run requires: it may be a node that "
                        "cannot, or on another machine");
    }
    slot.proposed.reset();
    slot.joined = true;
    if (slot.first) {
        slot.link->send(*std::exchange(slot.first, std::nullopt));
    }
}

/// Open the socket of a node, and propose shared memory.
Welcome Router::open(NodeId id)
{
    NodeSlot &slot = nodes_[id];
    slot.link = std::make_unique<Link>(context_, config_.limits, Link::End::controller);
    slot.joined = slot.replied = false;
    slot.first.reset();
    slot.greeting_fd = greeting_fd_;
    slot.greeting = greeters_.number(greeting_fd_);
    slot.welcomed = Clock::now();
    if (!config_.any_user) {
        refuse_other_users(slot.link->socket());
    }
    if (!reply_limit(id).count()) {
        allow_silence(slot.link->socket());
    }
    if (authenticator_) {
        authenticator_->guard(slot.link->socket(), names_[id]);
    }
    poller_.add(slot.link->frames(), key(Kind::frames, id));
    poller_.add(slot.link->events(), key(Kind::events, id));
    Welcome welcome;
    if (wake_up_) {
        try {
            slot.proposed = std::make_unique<SharedChannel>(*wake_up_, id, busy_wait_, config_.limits);
            welcome.shared = slot.proposed->path();
            welcome.nonce = slot.proposed->nonce();
        } catch (const LinkError &) {
            // The system has no more memory to share: frames go through the socket.
        }
    }
    welcome.address = bind(*slot.link);
    return welcome;
}

/// Other programs may have taken names of abstract sockets.
std::string Router::bind(Link &link)
{
    if (address_.starts_with("tcp://")) {
        return link.bind(address_.substr(0, address_.rfind(':') + 1) + "*");
    }
    for (int left = most_names;; left--) {
        try {
            return link.bind(config_.address + "-" + std::to_string(++opened_));
        } catch (const LinkError &) {
            if (!left) {
                throw;
            }
        }
    }
}

void Router::close(NodeId id)
{
    NodeSlot &slot = nodes_[id];
    if (slot.link) {
        poller_.remove(slot.link->events());
        if (!slot.link->shared()) {
            poller_.remove(slot.link->frames());
        }
    }
    std::erase(sharing_, id);
    slot.unsure = false;
    slot.proposed.reset();
    slot.link.reset();
    slot.hosted = nullptr;
}

void Router::act()
{
    std::optional<Clock::time_point> now;
    while (!(actions_ = controller_.take_actions(std::move(actions_))).empty()) {
        for (Action &a : actions_) {
            if (auto *send = std::get_if<action::Send>(&a)) {
                NodeSlot &slot = nodes_[send->node];
                try {
                    slot.requested = now ? *now : now.emplace(Clock::now());
                    if (std::holds_alternative<Tick>(send->frame.message) ||
                        (std::holds_alternative<Finish>(send->frame.message) && slot.times.ticks)) {
                        slot.times.wait += std::chrono::nanoseconds(slot.requested - slot.answered).count();
                    }
                    if (slot.hosted) {
                        calls_.emplace_back(send->node, std::move(send->frame));
                    } else if (!slot.joined) {
                        slot.first = std::move(send->frame);
                    } else if (slot.link) {
                        slot.link->send(send->frame);
                        if (!slot.link->shared() && !std::exchange(slot.unsure, true)) {
                            unsure_.push_back(send->node);
                        }
                    }
                } catch (const std::exception &error) {
                    controller_.lost(send->node, error.what());
                }
            } else if (const auto *accept = std::get_if<action::Accept>(&a); accept && accept->peer) {
                nodes_[accept->node].hosted = hosted_[accept->peer - 1];
            } else if (accept) {
                try {
                    reply(greeting_peer_, open(accept->node));
                } catch (const std::exception &error) {
                    reply(greeting_peer_, Refused{error.what()});
                    controller_.forget(accept->node, error.what());
                }
            } else if (const auto *refuse = std::get_if<action::Refuse>(&a)) {
                if (refuse->peer) {
                    throw LinkError(refuse->reason);
                }
                reply(greeting_peer_, Refused{refuse->reason});
            } else if (const auto *out = std::get_if<action::ShutOut>(&a)) {
                close(out->node);
            } else if (const auto *report = std::get_if<action::Report>(&a)) {
                this->report(report->text);
            } else if (const auto *began = std::get_if<action::Began>(&a)) {
                notify([&](RunListener &listener) { listener.began(began->exchange); });
                answer_attaching();
            } else if (const auto *wrote = std::get_if<action::Wrote>(&a)) {
                notify([&](RunListener &listener) { listener.wrote(names_[wrote->node], wrote->records); });
                notify([&](RunListener &listener) { listener.settled(wrote->settled); });
            } else if (const auto *kept = std::get_if<action::Kept>(&a)) {
                notify([&](RunListener &listener) { listener.settled(kept->t); });
                notify([&](RunListener &listener) { listener.kept(kept->t, kept->snapshots); });
            } else if (const auto *done = std::get_if<action::Done>(&a)) {
                outcome_ = done->reason;
                notify([&](RunListener &listener) { listener.ended(done->reason); });
                answer_attaching();
            }
        }
    }
}

/// If a listener throws, the run ends, and the router does not call the listener again.
template <class Call> void Router::notify(Call call)
{
    for (auto it = config_.listeners.begin(); it != config_.listeners.end();) {
        try {
            call(**it);
            ++it;
        } catch (const std::exception &error) {
            it = config_.listeners.erase(it);
            controller_.stop(error.what());
            outcome_ = outcome_.empty() ? error.what() : outcome_;
        }
    }
}

void Router::check_periodically(const std::function<bool()> &poll)
{
    checked_ = Clock::now();
    if (authenticator_) {
        for (const std::string &text : authenticator_->take_reports()) {
            report(text);
        }
    }
    if (broker_) {
        broker_->send_late();
        for (const std::string &text : broker_->take_reports()) {
            report(text);
        }
    }
    const auto absent = controller_.absent();
    if (absent.empty()) {
        complete_ = checked_;
    } else if (checked_ - complete_ >= config_.join) {
        controller_.stop(sim::format_list(absent) + " did not come within " +
                         sim::format_time(std::chrono::nanoseconds(config_.join).count()));
    }
    for (NodeId id = 0; id < nodes_.size(); id++) {
        check_connection(id);
        check_limits(id);
    }
    check_greeting_programs();
    hear_waiting();
    if (poll && !poll()) {
        controller_.stop("the user ended it");
    }
    act();
}

std::chrono::milliseconds Router::reply_limit(NodeId id) const
{
    return config_.replies.empty() ? config_.reply : config_.replies[id];
}

void Router::check_limits(NodeId id)
{
    const NodeSlot &slot = nodes_[id];
    const bool waits = controller_.waiting_for(id), first = slot.link && !slot.replied && !controller_.finishing();
    const auto reply = reply_limit(id);
    const auto most = controller_.finishing() ? config_.finish : first && reply.count() ? config_.greet : reply;
    const auto since = first ? std::max(slot.welcomed, slot.requested) : slot.requested;
    if (!most.count() || checked_ - since < most || !(waits || (first && !slot.joined))) {
        return;
    }
    const std::string why = "it did not answer within " + sim::format_time(std::chrono::nanoseconds(most).count());
    if (first) {
        controller_.forget(id, why + " of its greeting");
    } else {
        controller_.lost(id, why);
    }
}

} // namespace fledge::cosim
