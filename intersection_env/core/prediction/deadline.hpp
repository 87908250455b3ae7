// When a search has to end, if at all.
#pragma once

#include <chrono>
#include <cmath>
#include <stdexcept>
#include <string>

namespace intersection_env {

class Deadline {
  public:
    // seconds: from now, infinite for none. Throws std::invalid_argument for what is no time.
    explicit Deadline(double seconds) : is_set_(!std::isinf(seconds)) {
        if (!(seconds > 0.0)) {
            throw std::invalid_argument("seconds must be above 0, not " + std::to_string(seconds));
        }
        if (is_set_) {
            end_ = Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
        }
    }

    bool is_set() const { return is_set_; }
    bool passed() const { return is_set_ && Clock::now() >= end_; }

  private:
    using Clock = std::chrono::steady_clock;
    bool is_set_;
    Clock::time_point end_{};
};

} // namespace intersection_env
