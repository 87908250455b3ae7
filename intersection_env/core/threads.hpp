// A few threads that share the work of one call; what they compute does not depend on how many they are.
#pragma once

#include <atomic>
#include <functional>
#include <memory>

namespace intersection_env {

constexpr int MOST_THREADS = 256; // ours

class Threads {
  public:
    // count: 1 works in the caller's thread alone; 0 takes one for each of usable_cores. Throws std::invalid_argument.
    explicit Threads(int count);
    ~Threads();
    Threads(const Threads&) = delete;
    Threads& operator=(const Threads&) = delete;

    int count() const;

    // Calls work(item, thread) once for every item below `items`; thread < count(). Work must not throw. Where there is
    // little to do, by how long items took before, fewer threads share it, or the caller works alone.
    // In a forked child, which has none of the threads, the caller works alone.
    void share(int items, const std::function<void(int, int)>& work);

  private:
    struct Pool;
    std::unique_ptr<Pool> pool_;
};

// Holds an object for one caller, if no other thread holds it at this moment.
class Attempt {
  public:
    explicit Attempt(std::atomic_flag& held) : held_(held), succeeded_(!held.test_and_set()) {}
    ~Attempt() {
        if (succeeded_) {
            held_.clear();
        }
    }
    Attempt(const Attempt&) = delete;
    Attempt& operator=(const Attempt&) = delete;

    bool succeeded() const { return succeeded_; }

  private:
    std::atomic_flag& held_;
    bool succeeded_;
};

// Holds an object for one caller. Throws std::runtime_error where another thread holds it already.
class Claim {
  public:
    explicit Claim(std::atomic_flag& held);

  private:
    Attempt attempt_;
};

} // namespace intersection_env
