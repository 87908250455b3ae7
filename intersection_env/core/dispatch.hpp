// Chooses the kernel for this machine, once; INTERSECTION_ENV_ISA=baseline|v3|v4 overrides it.
#pragma once

#include <string>
#include <vector>

#include "problem.hpp"

namespace intersection_env {

// The memory of one block; opaque, made and freed by the kernel that uses it.
struct Workspace;

struct Kernel {
    const char* name;
    int lanes;
    Workspace* (*create)();
    void (*destroy)(Workspace*);
    void (*run)(const Problem&, const BlockArguments&, Workspace&);
    // out: (rows,) the network's output before its last activation; in: (rows, inputs).
    void (*evaluate_gap)(const GapNetwork&, const float* in, long rows, float* out);
    void (*evaluate_driving)(const DrivingNetwork&, const float* in, long rows, float* out);
    void (*observe)(const Problem&, const ObservationArguments&, Workspace&);
};

// Throws std::invalid_argument where the override names an instruction set that is unknown or not here.
const Kernel& kernel();
const Kernel& kernel_named(const std::string& name);
std::vector<std::string> available_kernels();

} // namespace intersection_env
