// How many cores this process may use.
#pragma once

#include <string>

namespace intersection_env {

// At least 1: those that the scheduler lets it run on, and no more than the quota of its control group.
// groups: where the kernel shows control groups.
int usable_cores(const std::string& groups = "/sys/fs/cgroup");

} // namespace intersection_env
