#include "cores.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <thread>

#ifdef __linux__
#include <sched.h>
#endif

namespace intersection_env {
namespace {

// The quota in cores, rounded up; 0 where there is none. Version 2 has "max 100000" or "150000 100000" in one file,
// version 1 a file for each, the quota -1 where there is none.
int quota(const std::string& groups) {
    double allowed = 0.0, period = 0.0;
    std::ifstream both(groups + "/cpu.max");
    if (!(both >> allowed >> period)) {
        allowed = period = 0.0;
        std::ifstream(groups + "/cpu/cpu.cfs_quota_us") >> allowed;
        std::ifstream(groups + "/cpu/cpu.cfs_period_us") >> period;
    }
    return allowed > 0.0 && period > 0.0 ? std::max(1, static_cast<int>(std::ceil(allowed / period))) : 0;
}

} // namespace

int usable_cores(const std::string& groups) {
    int cores = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
#ifdef __linux__
    cpu_set_t mask;
    if (sched_getaffinity(0, sizeof mask, &mask) == 0) {
        cores = std::max(1, CPU_COUNT(&mask));
    }
#endif
    const int allowed = quota(groups);
    return allowed > 0 ? std::min(cores, allowed) : cores;
}

} // namespace intersection_env
