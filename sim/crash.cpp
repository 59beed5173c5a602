// SPDX-License-Identifier: Apache-2.0
#include "sim/crash.h"

#include "sim/structure.h"

#include <sys/mman.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <ctime>
#include <mutex>
#include <pthread.h>
#include <string_view>
#include <thread>
#include <unistd.h>
#include <vector>

// Of the sanitizers, if one of them is in this program.
extern "C" {
[[gnu::weak]] void __asan_init();
[[gnu::weak]] void __tsan_init();
}

namespace fledge::sim {

namespace {

using Clock = std::chrono::steady_clock;
constexpr std::size_t stack_size = 1 << 16;
constexpr std::array<int, 5> crashes{SIGSEGV, SIGBUS, SIGILL, SIGFPE, SIGABRT};

struct Thread;

struct Watch {
    std::mutex mutex;
    std::vector<Thread *> threads;
    pid_t process = 0; ///< whose threads these are
    bool watched = false;

    /// Call with the mutex: a fork has no watchdog, and of the threads only the one that forked.
    void begin();
};

std::atomic<Ns> update_limit{0};

// Where a handler may read at any time: a key, because thread_local memory that is there from the beginning
// (initial-exec) is scarce in libraries that a program loads, as FMUs are.
pthread_key_t own_key;

/// Whether there is a handler or a watchdog, and the key. In an FMU there is none: its threads are the importer's, and
/// so it may be unloaded.
std::atomic<bool> observed{false};

void observe_threads()
{
    static const int once = pthread_key_create(&own_key, nullptr);
    (void)once;
    observed = true;
}

Thread *own()
{
    return observed ? static_cast<Thread *>(pthread_getspecific(own_key)) : nullptr;
}

void Watch::begin()
{
    if (process != getpid()) {
        process = getpid();
        watched = false;
        threads.clear();
    }
    if (own() && std::find(threads.begin(), threads.end(), own()) == threads.end()) {
        threads.push_back(own());
    }
}

/// Never destroyed: threads may end after the statics of the program.
Watch &watch()
{
    static Watch &instance = *new Watch;
    return instance;
}

struct Thread {
    Running running;
    pthread_t id = pthread_self();
    std::uintptr_t lowest = 0; ///< the first byte of its stack; 0: not known
    void *stack = MAP_FAILED;  ///< for handlers; MAP_FAILED: it has one of others
    std::atomic<bool> late{false};

    // Of the watchdog: what it saw last, since when.
    std::array<std::uintptr_t, 4> seen{};
    Clock::time_point since;

    Thread();
    ~Thread();
    Thread(const Thread &) = delete;
    Thread &operator=(const Thread &) = delete;
};

Thread::Thread()
{
    pthread_attr_t about;
    if (pthread_getattr_np(id, &about) == 0) {
        void *low = nullptr;
        std::size_t size = 0;
        pthread_attr_getstack(&about, &low, &size);
        pthread_attr_destroy(&about);
        lowest = reinterpret_cast<std::uintptr_t>(low);
    }
    stack_t before{};
    if (sigaltstack(nullptr, &before) == 0 && (before.ss_flags & SS_DISABLE)) {
        stack = mmap(nullptr, stack_size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        const stack_t wanted{stack, 0, stack_size};
        if (stack != MAP_FAILED) {
            sigaltstack(&wanted, nullptr);
        }
    }
    const std::lock_guard lock(watch().mutex);
    pthread_setspecific(own_key, this);
    watch().begin();
}

Thread::~Thread()
{
    {
        const std::lock_guard lock(watch().mutex);
        std::erase(watch().threads, this);
        pthread_setspecific(own_key, nullptr);
    }
    stack_t now{};
    if (stack != MAP_FAILED && sigaltstack(nullptr, &now) == 0) {
        if (now.ss_sp == stack) {
            const stack_t none{nullptr, SS_DISABLE, 0};
            sigaltstack(&none, nullptr);
        }
        munmap(stack, stack_size);
    }
}

// ---- the handler: only what is safe in one

std::array<char, 8192> command{}, command_of_one{};
std::array<struct sigaction, NSIG> before{};
bool terminal = false;

class Line {
public:
    ~Line() { put("\n").flush(); }
    Line &put(std::string_view text)
    {
        for (const char c : text) {
            if (n_ == text_.size()) {
                flush();
            }
            text_[n_++] = c;
        }
        return *this;
    }
    Line &number(std::uint64_t x, int digits = 1)
    {
        std::array<char, 20> text;
        auto at = text.end();
        for (; x > 0 || digits > 0; x /= 10, digits--) {
            *--at = static_cast<char>('0' + x % 10);
        }
        return put({at, text.end()});
    }
    Line &seconds(Ns t)
    {
        const auto ns = static_cast<std::uint64_t>(t);
        std::uint64_t rest = ns % 1'000'000'000;
        int digits = 9;
        for (; rest > 0 && rest % 10 == 0; rest /= 10) {
            digits--;
        }
        number(ns / 1'000'000'000);
        return rest ? put(".").number(rest, digits).put(" s") : put(" s");
    }

private:
    void flush()
    {
        for (std::size_t at = 0; at < n_;) {
            const ssize_t written = write(STDERR_FILENO, text_.data() + at, n_ - at);
            if (written < 0 && errno != EINTR) {
                break;
            }
            at += written > 0 ? static_cast<std::size_t>(written) : 0;
        }
        n_ = 0;
    }

    std::array<char, 1024> text_; // the stack is small
    std::size_t n_ = 0;
};

/// A thread in which an FMU runs, which may have started the thread that crashed; null: none, or another thread holds
/// the mutex of the threads.
Thread *beside_fmu()
{
    const std::unique_lock lock(watch().mutex, std::try_to_lock);
    if (!lock || watch().process != getpid()) { // after fork(), the threads of the parent process do not run here
        return nullptr;
    }
    const std::vector<Thread *> &threads = watch().threads;
    const auto found =
        std::ranges::find_if(threads, [](const Thread *thread) { return thread->running.function.load(); });
    return found == threads.end() ? nullptr : *found;
}

const char *name_of(int signal, const siginfo_t &about, const Thread &thread)
{
    // A large frame leaps over the guard below the stack.
    const auto below = thread.lowest - reinterpret_cast<std::uintptr_t>(about.si_addr);
    const bool beyond = thread.lowest && below + (1 << 16) < (1 << 24);
    switch (signal) {
    case SIGSEGV: return about.si_code > 0 && beyond ? "stack overflow" : "segmentation fault (SIGSEGV)";
    case SIGBUS: return "bus error (SIGBUS)";
    case SIGILL: return "illegal instruction (SIGILL)";
    case SIGFPE:
        return about.si_code == FPE_INTDIV ? "division of a whole number by zero (SIGFPE)"
                                           : "floating-point trap (SIGFPE)";
    case SIGXCPU: return "no end of the update";
    default: return "abort (SIGABRT)";
    }
}

void report(int signal, const siginfo_t &about, const Thread &thread, bool beside)
{
    const Running &now = thread.running;
    const Instance *instance = now.instance;
    const Task *task = now.task;
    const char *const function = now.function;
    if (now.t == Running::nothing && !instance && !function) {
        return; // no simulation runs
    }
    const std::int64_t run = now.of_campaign;
    {
        Line line;
        line.put(terminal ? "\nfledge: " : "fledge: ").put(name_of(signal, about, thread));
        line.put(beside ? " in another thread, while one was" : "");
        if (instance) {
            line.put(" in ").put(instance->path).put(" (").put(instance->type().name).put(")");
            line.put(task ? ", task " : "").put(task ? task->name : std::string_view());
        } else if (!function) {
            line.put(" between updates");
        }
        if (function) {
            line.put(instance ? ", in " : " in ").put(function).put(" of ").put(now.fmu.load());
        }
        if (now.t >= 0) {
            line.put(", at t = ").seconds(now.t);
        }
        if (run >= 0) {
            line.put(", in run ").number(static_cast<std::uint64_t>(run)).put(" of a campaign");
        }
        if (signal == SIGXCPU) {
            line.put(": it has taken longer than ").seconds(update_limit);
        }
    }
    if (function) {
        Line().put("fledge: as a node of its own (fledge up), an FMU ends alone");
    }
    if (run >= 0 && command_of_one[0]) {
        Line()
            .put("fledge: a debugger shows where: ")
            .put(command_of_one.data())
            .put(" ")
            .number(static_cast<std::uint64_t>(run));
    } else if (command[0]) {
        Line().put("fledge: a debugger shows where: ").put(command.data());
    }
}

void handle(int signal, siginfo_t *about, void *)
{
    const int error = errno;
    const bool beside = !own() && signal != SIGXCPU;
    const Thread *const thread = beside ? beside_fmu() : own();
    // Another library of Fledge in this program may have found out that a function of an FMU takes too long.
    if (thread && (signal != SIGXCPU || thread->late || thread->running.function)) {
        static std::atomic_flag reported;
        if (!reported.test_and_set()) {
            report(signal, *about, *thread, beside);
        } else { // of another thread, which ends the program
            const timespec while_it_does{2, 0};
            nanosleep(&while_it_does, nullptr);
        }
    }
    sigaction(signal, &before[static_cast<std::size_t>(signal)], nullptr);
    // What trapped does so again when this returns; a signal that was sent has to be sent again.
    if (about->si_code <= 0) {
        raise(signal);
    }
    errno = error;
}

void install(int signal)
{
    struct sigaction action {};
    action.sa_sigaction = handle;
    action.sa_flags = SA_SIGINFO | SA_ONSTACK;
    sigemptyset(&action.sa_mask);
    struct sigaction now {};
    sigaction(signal, nullptr, &now);
    if (now.sa_sigaction != handle) {
        before[static_cast<std::size_t>(signal)] = now;
        sigaction(signal, &action, nullptr);
    }
}

bool sanitized()
{
    return __asan_init || __tsan_init;
}

// ---- the watchdog

void check(Ns limit)
{
    const std::lock_guard lock(watch().mutex);
    const auto now = Clock::now();
    for (Thread *thread : watch().threads) {
        const Running &running = thread->running;
        const auto instance = reinterpret_cast<std::uintptr_t>(running.instance.load());
        const auto function = reinterpret_cast<std::uintptr_t>(running.function.load());
        const std::array<std::uintptr_t, 4> seen{
            instance ? instance : function, reinterpret_cast<std::uintptr_t>(running.task.load()),
            static_cast<std::uintptr_t>(running.t.load()), static_cast<std::uintptr_t>(running.runs.load())};
        if (seen != thread->seen || !seen[0]) {
            thread->seen = seen;
            thread->since = now;
        } else if (now - thread->since > std::chrono::nanoseconds(limit) && !thread->late.exchange(true)) {
            pthread_kill(thread->id, SIGXCPU);
        }
    }
}

void watch_updates()
{
    while (true) {
        const Ns limit = update_limit;
        std::this_thread::sleep_for(
            std::chrono::nanoseconds(limit ? std::clamp<Ns>(limit / 8, 100'000, 100'000'000) : 100'000'000));
        if (limit) {
            check(limit);
        }
    }
}

void begin_watching()
{
    const std::lock_guard lock(watch().mutex);
    watch().begin();
    if (!watch().watched) {
        watch().watched = true;
        const auto unlock = [] { watch().mutex.unlock(); };
        static const int once = pthread_atfork([] { watch().mutex.lock(); }, unlock, unlock);
        (void)once;
        install(SIGXCPU);
        std::thread(watch_updates).detach();
    }
}

} // namespace

Running &running()
{
    if (!observed.load(std::memory_order_relaxed)) {
        thread_local Running unseen;
        return unseen;
    }
    thread_local Thread thread;
    return thread.running;
}

Runs::Runs(const Instance *instance)
    : now_(running()), t_(now_.t), task_(now_.task), instance_(now_.instance), of_campaign_(now_.of_campaign)
{
    // A store in the default order would wait for all before it: 40 ns of each step of a batch.
    const auto relaxed = std::memory_order_relaxed;
    now_.runs.store(now_.runs.load(relaxed) + 1, relaxed);
    now_.task.store(nullptr, relaxed);
    now_.instance.store(instance, relaxed);
    if (update_limit) {
        begin_watching();
    }
}

Runs::~Runs()
{
    const auto relaxed = std::memory_order_relaxed;
    now_.instance.store(instance_, relaxed);
    now_.task.store(task_, relaxed);
    now_.t.store(t_, relaxed);
    now_.of_campaign.store(of_campaign_, relaxed);
}

Inside::Inside(const char *function, const char *fmu) : now_(running())
{
    const auto relaxed = std::memory_order_relaxed;
    if (!now_.instance.load(relaxed)) { // else it is a part of an update
        now_.runs.store(now_.runs.load(relaxed) + 1, relaxed);
    }
    now_.fmu.store(fmu, relaxed);
    now_.function.store(function, relaxed);
    if (update_limit) {
        begin_watching();
    }
}

Inside::~Inside()
{
    now_.function.store(nullptr, std::memory_order_relaxed);
}

void report_crashes(const std::string &given, const std::string &of_run)
{
    if (sanitized()) {
        return;
    }
    const auto keep = [](const std::string &text, auto &to) { to[text.copy(to.data(), to.size() - 1)] = '\0'; };
    keep(given, command);
    keep(of_run, command_of_one);
    terminal = isatty(STDERR_FILENO);
    observe_threads();
    watch(); // a handler may not allocate it
    for (const int signal : crashes) {
        install(signal);
    }
}

void limit_updates(Ns limit)
{
    update_limit = limit;
    if (limit > 0) {
        observe_threads();
    }
}

} // namespace fledge::sim
