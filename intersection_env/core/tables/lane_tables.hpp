// A problem's vehicles, lead candidates and pairs, one to a lane.
#pragma once

#include <vector>

#include "tables/lane_vector.hpp"
#include "tables/problem.hpp"

namespace intersection_env {

class LaneTables {
  public:
    void fill(const std::vector<ProblemVehicle>& vehicles, const std::vector<LeadCandidate>& candidates,
              const std::vector<ProblemPair>& pairs);
    // Once more what vehicles know of their patience, where it has changed since.
    void fill_patience(const std::vector<ProblemVehicle>& vehicles, const std::vector<ProblemPair>& pairs);
    LaneProblem problem() const;

  private:
    void fill_vehicles(const std::vector<ProblemVehicle>& vehicles);
    void fill_candidates(const std::vector<ProblemVehicle>& vehicles, const std::vector<LeadCandidate>& candidates);
    void order_pairs(const std::vector<ProblemPair>& pairs);
    void fill_pairs(const std::vector<ProblemVehicle>& vehicles, const std::vector<ProblemPair>& pairs);

    int vehicles_ = 0, padded_vehicles_ = 0, candidates_ = 0, padded_pairs_ = 0;
    LaneVector<float> half_length_, max_speed_, stop_line_, first_conflict_, route_length_, last_row_, position_,
        speed_;
    LaneVector<std::int32_t> first_row_, rank_, delta_, hold_, waited_, must_stop_;
    LaneVector<std::int32_t> other_, other_stop_lane_;
    LaneVector<float> begin_, end_, offset_, other_half_length_;
    LaneVector<std::int32_t> pair_, yielder_, prioritized_, yielder_rank_, merging_, by_arrival_;
    LaneVector<float> yielder_end_, prioritized_end_, yielder_entry_, prioritized_entry_;
    LaneVector<float> yielder_half_length_, prioritized_half_length_;
    LaneVector<float> yielder_stop_line_, prioritized_line_, yielder_patience_;
};

} // namespace intersection_env
