// What one instruction set's kernel offers; kernel.cpp puts it into the table that dispatch.hpp describes. All of this
// folder but dispatch.cpp is compiled once per instruction set: nothing in it may call an inline function of the
// standard library, whose one copy could come from the wrong instruction set.
#pragma once

#include "kernel/dispatch.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

Workspace* create_scenario_block();
void destroy_scenario_block(Workspace*);
void predict_scenario_block(const Problem&, const ScenarioArguments&, Workspace&);
void observe(const Problem&, const ObservationArguments&, Workspace&);

Workspace* create_branches();
void destroy_branches(Workspace*);
void predict_branching(const Problem&, const ScenarioArguments&, const BranchMemory&, Workspace&);

Workspace* create_one_scenario();
void destroy_one_scenario(Workspace*);
void predict_one_scenario(const Problem&, const ScenarioArguments&, Workspace&);

void gap_logits(const Problem&, float* logits);

float multiply_add(long rounds);
float hyperbolic_tangent(long rounds);

Workspace* create_closed_loop();
void destroy_closed_loop(Workspace*);
bool run_closed_loop(const ClosedLoopArguments&, Workspace&);

Workspace* create_replay();
void destroy_replay(Workspace*);
void run_replay(const ReplayArguments&, Workspace&);

} // namespace intersection_env::INTERSECTION_ENV_ISA
