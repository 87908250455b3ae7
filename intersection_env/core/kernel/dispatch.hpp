// Chooses the kernel for this machine, once; INTERSECTION_ENV_ISA=baseline|v3|v4 overrides it.
#pragma once

#include <string>
#include <vector>

#include "tables/problem.hpp"
#include "tables/world_arguments.hpp"

namespace intersection_env {

// The memory of one row of lanes; opaque, made and freed by the kernel that uses it.
struct Workspace;

struct Kernel {
    const char* name;
    int lanes;
    // A block of scenarios: one to a lane.
    Workspace* (*create_scenario_block)();
    void (*destroy_scenario_block)(Workspace*);
    void (*predict_scenario_block)(const Problem&, const ScenarioArguments&, Workspace&);
    void (*observe)(const Problem&, const ObservationArguments&, Workspace&);
    // Any number of scenarios, without decisions to replay: what they have in common is predicted once.
    Workspace* (*create_branches)();
    void (*destroy_branches)(Workspace*);
    void (*predict_branching)(const Problem&, const ScenarioArguments&, const BranchMemory&, Workspace&);
    // One scenario, lanes over its vehicles: what a rest of fewer than worth_a_block scenarios is predicted with.
    int worth_a_block;
    Workspace* (*create_one_scenario)();
    void (*destroy_one_scenario)(Workspace*);
    void (*predict_one_scenario)(const Problem&, const ScenarioArguments&, Workspace&);
    // The gap network's logit of every pair at the start: (pair,).
    void (*gap_logits)(const Problem&, float* logits);
    // out: (rows,) the network's output before its last activation; in: (rows, inputs).
    void (*evaluate_gap)(const GapNetwork&, const float* in, long rows, float* out);
    void (*evaluate_driving)(const DrivingNetwork&, const float* in, long rows, float* out);
    void (*evaluate_order)(const OrderNetwork&, const float* in, long rows, float* out);
    Workspace* (*create_closed_loop)();
    void (*destroy_closed_loop)(Workspace*);
    // Runs the task for `lanes` worlds; false where no start without a violated constraint was found.
    bool (*run_closed_loop)(const ClosedLoopArguments&, Workspace&);
    Workspace* (*create_replay)();
    void (*destroy_replay)(Workspace*);
    void (*run_replay)(const ReplayArguments&, Workspace&);
    // Yardsticks: 12 multiply-adds, or 16 tanh, a round and lane, as fast as they go.
    float (*multiply_add)(long rounds);
    float (*hyperbolic_tangent)(long rounds);
};

// Throws std::invalid_argument where the override names an instruction set that is unknown or not here.
const Kernel& kernel();
// For few worlds the second-best: its lanes are fewer and its steps shorter, and the bytes are the same.
const Kernel& kernel_for_worlds(int worlds);
const Kernel& kernel_named(const std::string& name);
std::vector<std::string> available_kernels();

} // namespace intersection_env
