// A few threads that share the blocks of one call; what they compute does not depend on how many they are.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace intersection_env {

class Threads {
  public:
    // count: 1 works in the caller's thread alone; 0 takes one a core of the machine. Throws std::invalid_argument.
    explicit Threads(int count);
    ~Threads();
    Threads(const Threads&) = delete;
    Threads& operator=(const Threads&) = delete;

    int count() const { return static_cast<int>(workers_.size()) + 1; }

    // Calls work(item, thread) once for every item below `items`; thread < count(). Work must not throw.
    void share(int items, const std::function<void(int, int)>& work);

  private:
    void serve(int thread);
    void take(int thread);

    std::vector<std::thread> workers_;
    std::mutex mutex_;
    std::condition_variable begin_, end_;
    const std::function<void(int, int)>* work_ = nullptr;
    std::uint64_t round_ = 0;
    int items_ = 0, next_ = 0, busy_ = 0;
    bool stop_ = false;
};

} // namespace intersection_env
