#include "threads.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

namespace intersection_env {

Threads::Threads(int count) {
    if (count < 0 || count > 1024) {
        throw std::invalid_argument("threads must be from 0, one a core, to 1024, not " + std::to_string(count));
    }
    const int wanted = count > 0 ? count : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
    for (int thread = 1; thread < wanted; ++thread) {
        workers_.emplace_back([this, thread] { serve(thread); });
    }
}

Threads::~Threads() {
    {
        const std::lock_guard lock(mutex_);
        stop_ = true;
    }
    begin_.notify_all();
    for (std::thread& worker : workers_) {
        worker.join();
    }
}

void Threads::share(int items, const std::function<void(int, int)>& work) {
    if (workers_.empty() || items <= 1) {
        for (int item = 0; item < items; ++item) {
            work(item, 0);
        }
        return;
    }
    {
        const std::lock_guard lock(mutex_);
        work_ = &work;
        items_ = items;
        next_ = 0;
        busy_ = static_cast<int>(workers_.size());
        ++round_;
    }
    begin_.notify_all();
    take(0);
    std::unique_lock lock(mutex_);
    end_.wait(lock, [this] { return busy_ == 0; });
}

void Threads::take(int thread) {
    for (;;) {
        int item = 0;
        {
            const std::lock_guard lock(mutex_);
            if (next_ >= items_) {
                return;
            }
            item = next_++;
        }
        (*work_)(item, thread);
    }
}

void Threads::serve(int thread) {
    std::uint64_t seen = 0;
    for (;;) {
        {
            std::unique_lock lock(mutex_);
            begin_.wait(lock, [&] { return stop_ || round_ != seen; });
            if (stop_) {
                return;
            }
            seen = round_;
        }
        take(thread);
        {
            const std::lock_guard lock(mutex_);
            --busy_;
        }
        end_.notify_one();
    }
}

} // namespace intersection_env
