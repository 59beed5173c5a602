// SPDX-License-Identifier: Apache-2.0
#include "cosim/router/router.h"

#include "sim/text.h"

#include <algorithm>
#include <thread>

namespace fledge::cosim {

namespace {

using namespace std::chrono_literals;

constexpr auto look = 100ms;
constexpr std::size_t most_attaching = 1000;
constexpr auto rest = 20ms; ///< how long the sockets may be left alone while all is in shared memory
constexpr auto spin = 20us; ///< before one sleeps, if there is a processor for each program

/// What is watched, by keys.
enum Kind : std::uint64_t { lobby, bell, timer, frames, events, kinds };

std::uint64_t key(Kind kind, NodeId id = 0)
{
    return id * kinds + kind;
}

ControllerConfig telling(ControllerConfig config, bool tell, bool paced)
{
    config.tell = config.tell || tell;
    config.horizon = paced ? -1 : config.horizon;
    return config;
}

} // namespace

Router::Router(zmq::context_t &context, ControllerConfig controller, RouterConfig config)
    : context_(context), config_(std::move(config)), simulation_(controller.simulation),
      controller_(telling(with_broker(controller), config_.broker || !config_.witnesses.empty(), config_.pace > 0.0)),
      lobby_(context, zmq::socket_type::router), nodes_(controller.nodes.size())
{
    for (const NodeConfig &node : controller.nodes) {
        names_.push_back(node.name);
    }
    for (const AsynchronousConfig &program : controller.asynchronous) {
        names_.push_back(program.name);
    }
    set_up(lobby_, config_.limits);
    if (gate_) {
        gate_->guard(lobby_);
    }
    try {
        lobby_.bind(config_.address);
    } catch (const zmq::error_t &error) {
        throw LinkError("cannot listen at " + config_.address + ": " + error.what() +
                        (error.num() == EADDRINUSE ? "; is another controller running?" : ""));
    }
    address_ = lobby_.get(zmq::sockopt::last_endpoint);
    poller_.add(descriptor(lobby_), key(Kind::lobby));
    if (config_.pace > 0.0) {
        pace_.emplace(config_.pace);
        poller_.add(pace_->fd(), key(Kind::timer));
    }
    if (config_.sharing != Sharing::forbidden && !address_.starts_with("inproc://")) {
        try {
            bell_.emplace();
            poller_.add(bell_->fd(), key(Kind::bell));
        } catch (const LinkError &) {
            bell_.reset();
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
        // Nodes see then that their connection is gone.
    }
}

void Router::host(const std::string &name, Node &node)
{
    hosted_.push_back(&node);
    controller_.hello(hosted_.size(), {protocol_version, protocol_version, simulation_, name, Role::node, false});
    act();
}

/// One after another: what they bring about may call them again.
void Router::call_hosted()
{
    while (!calls_.empty() && Clock::now() - looked_ < look) {
        const auto [id, request] = std::move(calls_.front());
        calls_.pop_front();
        Frame reply{request.number, {}};
        try {
            reply.message = answer(*nodes_[id].hosted, request.message);
        } catch (const std::exception &error) {
            reply.message = Failed{error.what()};
        }
        heard(id, std::move(reply));
    }
}

std::string Router::run(const std::function<bool()> &poll)
{
    looked_ = complete_ = Clock::now();
    spins_ = std::thread::hardware_concurrency() > nodes_.size() - hosted_.size() ? spin : 0us;
    spin_ = Spin(spins_);
    auto waited = looked_;
    while (!controller_.done()) {
        if (broker_ && broker_->heard()) {
            hear_programs();
        }
        call_hosted();
        const bool busy = listen_to_shared();
        listen_again();
        const auto now = Clock::now();
        if (now - looked_ >= look) {
            look_at_clock(poll);
        }
        if (pace_) {
            pace_->tend(controller_, nodes_.size(), now);
            act();
        }
        // Who is busy with some still listens to the others.
        const bool more = busy || !calls_.empty() || controller_.done();
        if (!more || now - waited >= 1ms) {
            waited = now;
            wait(more ? 0ms : look);
        }
    }
    return outcome_;
}

/// Wait for something to happen, and listen.
void Router::wait(std::chrono::milliseconds most)
{
    const bool sleeps = most.count() && !sharing_.empty();
    if (bell_) {
        bell_->wake();
    }
    if (sleeps && spin_.spin([&] { return anything_shared(); })) {
        return;
    }
    if (sleeps) {
        const bool rests = expect();
        bell_->arm(rests ? Bell::rests : Bell::polls);
        if (anything_shared()) {
            most = 0ms;
        } else if (rests) {
            bell_->rest(rest);
            bell_->disarm(false);
            if (anything_shared()) {
                return;
            }
            most = 0ms; // nobody rang for a while
        }
    }
    const auto &ready = poller_.wait(most);
    if (bell_) {
        bell_->disarm(std::find(ready.begin(), ready.end(), key(Kind::bell)) != ready.end());
    }
    for (const std::uint64_t what : ready) {
        const NodeId id = what / kinds;
        switch (static_cast<Kind>(what % kinds)) {
        case Kind::lobby: greet(); break;
        case Kind::frames: listen(id); break;
        case Kind::events: {
            // In this order: what a node sent before it went counts.
            const bool gone = nodes_[id].link && nodes_[id].link->gone();
            listen(id);
            if (gone) {
                controller_.lost(id, "its connection is gone");
                act();
            }
            break;
        }
        default: break;
        }
    }
}

/// Let those alone wake this program whose tocks bring the run further. Whether they all share memory.
bool Router::expect()
{
    const bool some = controller_.decisive(decisive_);
    std::size_t expected = 0;
    for (const NodeId id : sharing_) {
        nodes_[id].link->shared()->expect(!some || decisive_[id]);
        expected += some && decisive_[id];
    }
    return some && expected == static_cast<std::size_t>(std::count(decisive_.begin(), decisive_.end(), true));
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
            listen(id); // the list may be shorter now; who was passed over is met next time
            any = true;
        }
    }
    if (any) {
        bell_->wake();
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
    if (lobby_unsure_) {
        greet();
    }
}

void Router::greet()
{
    zmq::message_t peer, hello;
    lobby_unsure_ = false;
    while (lobby_.recv(peer, zmq::recv_flags::dontwait)) {
        std::size_t parts = 0;
        bool more = peer.more();
        while (more) {
            if (!lobby_.recv(hello, zmq::recv_flags::dontwait)) {
                break;
            }
            parts++;
            more = hello.more();
        }
        greeting_peer_.assign(peer.data<std::byte>(), peer.data<std::byte>() + peer.size());
        try {
            if (parts != 1) {
                throw ProtocolError("a frame is one part, not " + std::to_string(parts));
            }
            const Frame frame = decode({hello.data<std::byte>(), hello.size()}, config_.limits);
            const auto *m = std::get_if<Hello>(&frame.message);
            if (!m) {
                throw ProtocolError(std::string("expected Hello, found ") + kind_name(frame.message));
            }
            if (keyed() && !gate_->may_speak_as(hello, m->node)) {
                const std::string why = "its key " + gate_->name_of(hello) + " is not allowed to speak as " + m->node;
                report("a program was not let in: " + why);
                throw ProtocolError(why);
            }
            if (m->role == Role::asynchronous) {
                attach(*m);
                continue;
            }
            controller_.hello(0, *m);
        } catch (const ProtocolError &error) {
            reply(greeting_peer_, Refused{error.what()});
        }
        act();
    }
}

/// Before the controller, which hands its addresses on.
ControllerConfig Router::with_broker(ControllerConfig controller)
{
    if (!config_.keys.empty()) {
        gate_ = std::make_unique<Gate>(context_, config_.keys);
    }
    check_address(config_.address);
    if (config_.broker) {
        BrokerConfig broker;
        const bool tcp = config_.address.starts_with("tcp://");
        const std::string any = config_.address.substr(0, config_.address.rfind(':') + 1) + "*";
        broker.frontend = !config_.frontend.empty() ? config_.frontend : tcp ? any : config_.address + "-frontend";
        broker.backend = !config_.backend.empty() ? config_.backend : tcp ? any : config_.address + "-backend";
        broker.limits = config_.limits;
        check_address(broker.frontend);
        check_address(broker.backend);
        broker_ = std::make_unique<Broker>(context_, broker, gate_.get());
        controller.frontend = broker_->frontend();
        controller.backend = broker_->backend();
        config_.witnesses.push_back(broker_.get());
    } else if (!controller.asynchronous.empty()) {
        throw LinkError("asynchronous programs, such as " + controller.asynchronous.front().name +
                        ", need a broker, and this controller has none");
    }
    return controller;
}

void Router::check_address(const std::string &address) const
{
    if (!gate_ && !is_local(address) && !config_.unencrypted_beyond_machine) {
        throw LinkError(address + " can be reached from other machines, which needs keys: ./fledge keys new "
                                  "controller, and --keys; or listen at tcp://127.0.0.1");
    }
}

/// An asynchronous program greets. What it needs to know is known when the nodes have met.
void Router::attach(const Hello &hello)
{
    const auto refuse = [&](const std::string &why) { reply(greeting_peer_, Refused{why}); };
    if (hello.oldest > protocol_version || hello.newest < protocol_version) {
        return refuse("this controller speaks version " + std::to_string(protocol_version) + " of the format");
    }
    if (hello.simulation != simulation_) {
        return refuse("this is the simulation " + simulation_ + ", not " + hello.simulation);
    }
    if (!broker_) {
        return refuse("this controller has no broker, so nobody can watch");
    }
    if (controller_.finishing() || controller_.done()) {
        return refuse("the run is over");
    }
    if (controller_.matched()) {
        return reply(greeting_peer_, attached());
    }
    if (attaching_.size() >= most_attaching) {
        return refuse("too many wait for the run to begin");
    }
    attaching_.push_back(greeting_peer_);
}

Message Router::attached() const
{
    return Attached{broker_->frontend(), broker_->backend(), controller_.channels()};
}

void Router::answer_attaching()
{
    for (const Bytes &peer : std::exchange(attaching_, {})) {
        reply(peer, controller_.matched() ? attached() : Message(Refused{"the run is over: " + outcome_}));
    }
}

/// What asynchronous programs wrote enters before the next tick goes out.
void Router::hear_programs()
{
    for (const Broker::Written &written : broker_->take()) {
        if (const std::string why = controller_.inject(written.program, written.topic, written.payload); !why.empty()) {
            broker_->refuse(written.program + " writes " + written.topic + ": " + why);
        }
    }
    act();
}

/// Within one program, at inproc://, libzmq asks nobody for keys.
bool Router::keyed() const
{
    return gate_ && !config_.address.starts_with("inproc://");
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
    // One that has gone meanwhile gets nothing: libzmq drops it.
    (void)lobby_.send(zmq::buffer(peer.data(), peer.size()), zmq::send_flags::sndmore | zmq::send_flags::dontwait);
    (void)lobby_.send(zmq::buffer(bytes), zmq::send_flags::dontwait);
    lobby_unsure_ = true;
}

void Router::listen(NodeId id)
{
    Place &place = nodes_[id];
    Frame frame;
    try {
        while (place.link && place.link->receive(frame)) {
            if (!place.joined) {
                join(id, frame);
                continue;
            }
            heard(id, std::move(frame));
        }
        place.unsure = false;
    } catch (const ProtocolError &error) {
        controller_.lost(id, std::string("it sent no frame: ") + error.what());
        act();
    } catch (const LinkError &error) {
        controller_.lost(id, error.what());
        act();
    }
}

void Router::heard(NodeId id, Frame frame)
{
    Place &place = nodes_[id];
    place.answered = Clock::now();
    if (const auto *tock = std::get_if<Tock>(&frame.message)) {
        NodeTimes &times = place.times;
        times.ticks++;
        times.compute += tock->compute_ns;
        times.transport += std::chrono::nanoseconds(place.answered - place.asked).count() - tock->compute_ns;
    }
    controller_.received(id, std::move(frame));
    act();
}

NodeTimes Router::times(NodeId id) const
{
    const Place &place = nodes_[id];
    NodeTimes times = place.times;
    const auto now = Clock::now();
    if (controller_.waiting_for(id)) {
        times.asked = std::chrono::nanoseconds(now - place.asked).count();
    } else if (times.ticks && std::string_view(controller_.state(id)) == "running") {
        times.wait += std::chrono::nanoseconds(now - place.answered).count();
    }
    return times;
}

/// A socket that nobody is connected to takes no frame: the node has to speak first.
void Router::join(NodeId id, const Frame &frame)
{
    Place &place = nodes_[id];
    const auto *hello = std::get_if<Hello>(&frame.message);
    if (!hello) {
        throw ProtocolError(std::string("expected Hello, found ") + kind_name(frame.message));
    }
    if (hello->shared && !place.offered) {
        throw ProtocolError("a Hello over shared memory, which was not offered");
    }
    if (hello->shared) {
        poller_.remove(place.link->frames());
        place.link->share(std::move(place.offered));
        sharing_.push_back(id);
    } else if (config_.sharing == Sharing::required) {
        throw LinkError("it does not take shared memory, which this run requires: it may be a node that "
                        "cannot, or on another machine");
    }
    place.offered.reset();
    place.joined = true;
    if (place.first) {
        place.link->send(*std::exchange(place.first, std::nullopt));
    }
}

/// The socket of a node, and memory to share.
Welcome Router::open(NodeId id)
{
    Place &place = nodes_[id];
    place.link = std::make_unique<Link>(context_, config_.limits);
    place.joined = false;
    if (gate_) {
        gate_->guard(place.link->socket(), names_[id]);
    }
    poller_.add(place.link->frames(), key(Kind::frames, id));
    poller_.add(place.link->events(), key(Kind::events, id));
    Welcome welcome;
    if (bell_) {
        try {
            place.offered = std::make_unique<SharedChannel>(*bell_, id, spins_, config_.limits);
            welcome.shared = place.offered->path();
            welcome.nonce = place.offered->nonce();
        } catch (const LinkError &) {
            // The system has no more to give: the node's socket does it.
        }
    }
    welcome.address = address_.starts_with("tcp://")
                          ? place.link->bind(address_.substr(0, address_.rfind(':') + 1) + "*")
                          : place.link->bind(config_.address + "-" + std::to_string(++opened_));
    return welcome;
}

void Router::close(NodeId id)
{
    Place &place = nodes_[id];
    if (place.link) {
        poller_.remove(place.link->events());
        if (!place.link->shared()) {
            poller_.remove(place.link->frames());
        }
    }
    std::erase(sharing_, id);
    place.unsure = false;
    place.offered.reset();
    place.link.reset();
    place.hosted = nullptr;
}

void Router::act()
{
    for (auto actions = controller_.take_actions(); !actions.empty(); actions = controller_.take_actions()) {
        for (Action &a : actions) {
            if (auto *send = std::get_if<action::Send>(&a)) {
                Place &place = nodes_[send->node];
                try {
                    place.asked = Clock::now();
                    if (std::holds_alternative<Tick>(send->frame.message) ||
                        (std::holds_alternative<Finish>(send->frame.message) && place.times.ticks)) {
                        place.times.wait += std::chrono::nanoseconds(place.asked - place.answered).count();
                    }
                    if (place.hosted) {
                        calls_.emplace_back(send->node, std::move(send->frame));
                    } else if (!place.joined) {
                        place.first = std::move(send->frame);
                    } else if (place.link) {
                        place.link->send(send->frame);
                        if (!place.link->shared() && !std::exchange(place.unsure, true)) {
                            unsure_.push_back(send->node);
                        }
                    }
                } catch (const std::exception &error) {
                    controller_.lost(send->node, error.what());
                }
            } else if (const auto *accept = std::get_if<action::Accept>(&a); accept && accept->peer) {
                nodes_[accept->node].hosted = hosted_[accept->peer - 1];
            } else if (accept) {
                reply(greeting_peer_, open(accept->node));
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
                tell([&](Witness &w) { w.began(began->exchange); });
                answer_attaching();
            } else if (const auto *wrote = std::get_if<action::Wrote>(&a)) {
                tell([&](Witness &w) { w.wrote(names_[wrote->node], wrote->records); });
                tell([&](Witness &w) { w.settled(wrote->settled); });
            } else if (const auto *done = std::get_if<action::Done>(&a)) {
                outcome_ = done->reason;
                tell([&](Witness &w) { w.ended(done->reason); });
                answer_attaching();
            }
        }
    }
}

/// One that fails sees no more, and ends the run.
template <class Call> void Router::tell(Call call)
{
    for (auto it = config_.witnesses.begin(); it != config_.witnesses.end();) {
        try {
            call(**it);
            ++it;
        } catch (const std::exception &error) {
            it = config_.witnesses.erase(it);
            controller_.stop(error.what());
            outcome_ = outcome_.empty() ? error.what() : outcome_;
        }
    }
}

void Router::look_at_clock(const std::function<bool()> &poll)
{
    looked_ = Clock::now();
    if (gate_) {
        for (const std::string &text : gate_->take_reports()) {
            report(text);
        }
    }
    if (broker_) {
        broker_->tend();
        for (const std::string &text : broker_->take_reports()) {
            report(text);
        }
    }
    const auto absent = controller_.absent();
    if (absent.empty()) {
        complete_ = looked_;
    } else if (looked_ - complete_ >= config_.join) {
        controller_.stop(sim::format_list(absent) + " did not come within " +
                         sim::format_time(std::chrono::nanoseconds(config_.join).count()));
    }
    for (NodeId id = 0; id < nodes_.size(); id++) {
        const auto reply = config_.replies.empty() ? config_.reply : config_.replies[id];
        const auto most = controller_.finishing() ? config_.finish : reply;
        if (controller_.waiting_for(id) && most.count() && looked_ - nodes_[id].asked >= most) {
            controller_.lost(id,
                             "it did not answer within " + sim::format_time(std::chrono::nanoseconds(most).count()));
        }
    }
    if (poll && !poll()) {
        controller_.stop("the user ended it");
    }
    act();
}

} // namespace fledge::cosim
