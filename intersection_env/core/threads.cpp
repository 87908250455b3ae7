#include "threads.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <pthread.h>

#include "cores.hpp"

namespace intersection_env {
namespace {

using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

constexpr Seconds WORTH_WAKING{100e-6}; // ours: so much work for every thread that is woken, which takes some 20 us
constexpr Seconds NEVER{1e9};
constexpr int LOOKS = 30; // ours: how often the caller looks whether the others are done before it sleeps

// How many times this process and those that it is forked from were forked; to ask for its id takes longer.
std::atomic<int> forks = 0;
[[maybe_unused]] const int counts_forks = pthread_atfork(nullptr, nullptr, [] { ++forks; });

} // namespace

struct Threads::Pool {
    std::vector<std::thread> workers;
    std::mutex mutex;
    std::condition_variable begin, end;
    const std::function<void(int, int)>* work = nullptr;
    int items = 0, next = 0;
    std::atomic<int> unfinished = 0;
    bool stop = false;
    Seconds per_item = NEVER; // by the rounds before, of little and of much work in turns; at first everybody is woken
    int born = forks;

    bool is_forked() const { return born != forks; }

    // The next item to do, or -1; done: how many the caller has just done.
    int take(int done) {
        const std::lock_guard lock(mutex);
        if ((unfinished -= done) == 0 && done > 0) {
            end.notify_one();
        }
        return next < items ? next++ : -1;
    }

    void serve(int thread) {
        for (;;) {
            {
                std::unique_lock lock(mutex);
                begin.wait(lock, [&] { return stop || next < items; });
                if (stop) {
                    return;
                }
            }
            for (int item = take(0); item >= 0; item = take(1)) {
                (*work)(item, thread);
            }
        }
    }

    // How many others such work is worth, if any.
    int helpers(int left) const {
        const double worth = static_cast<double>(left) * (per_item / WORTH_WAKING);
        return static_cast<int>(std::clamp(worth, 0.0, static_cast<double>(workers.size())));
    }

    // The caller has just done so many items since then. One interruption, or a round of another kind, is forgotten
    // soon.
    void remember(int done, Clock::time_point since) {
        if (done > 0) {
            const Seconds now = Seconds(Clock::now() - since) / done;
            per_item = per_item == NEVER ? now : std::clamp(now, 0.25 * per_item, 8.0 * per_item);
        }
    }

    void work_alone(int all, const std::function<void(int, int)>& wanted) {
        const auto start = Clock::now();
        for (int item = 0; item < all; ++item) {
            wanted(item, 0);
        }
        remember(all, start);
    }

    void work_together(int others, int all, const std::function<void(int, int)>& wanted) {
        {
            const std::lock_guard lock(mutex);
            work = &wanted;
            next = 0;
            items = unfinished = all;
        }
        const auto start = Clock::now();
        for (int k = 0; k < others; ++k) {
            begin.notify_one();
        }
        int done = 0;
        for (int item = take(0); item >= 0; item = take(1)) {
            wanted(item, 0);
            ++done;
        }
        remember(done, start);
        for (int look = 0; look < LOOKS && unfinished > 0; ++look) {
            std::this_thread::yield();
        }
        std::unique_lock lock(mutex);
        end.wait(lock, [&] { return unfinished == 0; });
    }

    void finish() {
        {
            const std::lock_guard lock(mutex);
            stop = true;
        }
        begin.notify_all();
        for (std::thread& worker : workers) {
            worker.join();
        }
        workers.clear();
    }
};

Threads::Threads(int count) : pool_(std::make_unique<Pool>()) {
    if (count < 0 || count > MOST_THREADS) {
        throw std::invalid_argument("threads must be from 0, one a core, to " + std::to_string(MOST_THREADS) +
                                    ", not " + std::to_string(count));
    }
    const int wanted = count > 0 ? count : usable_cores();
    try {
        for (int thread = 1; thread < wanted; ++thread) {
            pool_->workers.emplace_back([pool = pool_.get(), thread] { pool->serve(thread); });
        }
    } catch (...) {
        pool_->finish();
        throw;
    }
}

Threads::~Threads() {
    if (pool_->is_forked()) {
        static_cast<void>(pool_.release()); // its threads are not here to be joined
    } else {
        pool_->finish();
    }
}

int Threads::count() const { return static_cast<int>(pool_->workers.size()) + 1; }

void Threads::share(int items, const std::function<void(int, int)>& work) {
    Pool& pool = *pool_;
    if (pool.workers.empty() || items <= 1 || pool.is_forked()) {
        for (int item = 0; item < items; ++item) {
            work(item, 0);
        }
        return;
    }
    const int others = pool.helpers(items - 1);
    if (others > 0) {
        pool.work_together(others, items, work);
    } else {
        pool.work_alone(items, work);
    }
}

Claim::Claim(std::atomic_flag& held) : attempt_(held) {
    if (!attempt_.succeeded()) {
        throw std::runtime_error("another thread is using these worlds at this moment; give each thread its own");
    }
}

} // namespace intersection_env
