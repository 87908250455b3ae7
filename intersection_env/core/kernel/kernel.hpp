// What one instruction set's kernel offers; kernel.cpp puts it into the table that dispatch.hpp describes.
#pragma once

#include "kernel/dispatch.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

Workspace* create_prediction();
void destroy_prediction(Workspace*);
void predict(const Problem&, const BlockArguments&, Workspace&);
void observe(const Problem&, const ObservationArguments&, Workspace&);

Workspace* create_single();
void destroy_single(Workspace*);
void predict_single(const Problem&, const BlockArguments&, Workspace&);

float multiply_add(long rounds);
float hyperbolic_tangent(long rounds);

Workspace* create_closed_loop();
void destroy_closed_loop(Workspace*);
bool run_closed_loop(const ClosedLoopArguments&, Workspace&);

Workspace* create_replay();
void destroy_replay(Workspace*);
void run_replay(const ReplayArguments&, Workspace&);

} // namespace intersection_env::INTERSECTION_ENV_ISA
