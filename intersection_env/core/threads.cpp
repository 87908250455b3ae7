#include "threads.hpp"

#include <algorithm>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <unistd.h>

#include "cores.hpp"

namespace intersection_env {
struct Threads::Pool {
    std::vector<std::thread> workers;
    std::mutex mutex;
    std::condition_variable begin, end;
    const std::function<void(int, int)>* work = nullptr;
    std::uint64_t round = 0;
    int items = 0, next = 0, busy = 0;
    bool stop = false;
    pid_t process = getpid();

    bool is_forked() const { return process != getpid(); }

    void take(int thread) {
        for (;;) {
            int item = 0;
            {
                const std::lock_guard lock(mutex);
                if (next >= items) {
                    return;
                }
                item = next++;
            }
            (*work)(item, thread);
        }
    }

    void serve(int thread) {
        std::uint64_t seen = 0;
        for (;;) {
            {
                std::unique_lock lock(mutex);
                begin.wait(lock, [&] { return stop || round != seen; });
                if (stop) {
                    return;
                }
                seen = round;
            }
            take(thread);
            {
                const std::lock_guard lock(mutex);
                --busy;
            }
            end.notify_one();
        }
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
    {
        const std::lock_guard lock(pool.mutex);
        pool.work = &work;
        pool.items = items;
        pool.next = 0;
        pool.busy = static_cast<int>(pool.workers.size());
        ++pool.round;
    }
    pool.begin.notify_all();
    pool.take(0);
    std::unique_lock lock(pool.mutex);
    pool.end.wait(lock, [&] { return pool.busy == 0; });
}

Claim::Claim(std::atomic_flag& held) : attempt_(held) {
    if (!attempt_.succeeded()) {
        throw std::runtime_error("another thread is using these worlds at this moment; give each thread its own");
    }
}

} // namespace intersection_env
