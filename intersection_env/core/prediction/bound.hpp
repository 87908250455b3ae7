// A traffic as kernels read it.
#pragma once

#include <vector>

#include "prediction/predictor.hpp"
#include "tables/lane_tables.hpp"

namespace intersection_env {

struct Predictor::Bound {
    std::vector<ProblemVehicle> vehicles;
    std::vector<LeadCandidate> candidates;
    std::vector<ProblemPair> pairs;
    std::vector<Touch> touches;
    std::vector<float> gap_logits; // (pair,) at the start, where they are asked for
    LaneTables lanes;
};

} // namespace intersection_env
