#include "tables/lane_tables.hpp"

#include <algorithm>

namespace intersection_env {
namespace {

std::size_t at(int index) { return static_cast<std::size_t>(index); }
int padded(int count) { return (count + LANES - 1) / LANES * LANES; }

} // namespace

void LaneTables::fill(const std::vector<ProblemVehicle>& vehicles, const std::vector<LeadCandidate>& candidates,
                      const std::vector<ProblemPair>& pairs) {
    vehicles_ = static_cast<int>(vehicles.size());
    padded_vehicles_ = padded(vehicles_);
    padded_pairs_ = padded(static_cast<int>(pairs.size()));
    fill_vehicles(vehicles);
    fill_candidates(vehicles, candidates);
    fill_pairs(vehicles, pairs);
    fill_patience(vehicles, pairs);
}

void LaneTables::fill_vehicles(const std::vector<ProblemVehicle>& vehicles) {
    const std::size_t size = at(padded_vehicles_);
    half_length_.assign(size, 0.0F);
    max_speed_.assign(size, 1.0F);
    stop_line_.assign(size, 0.0F);
    first_conflict_.assign(size, 0.0F);
    route_length_.assign(size, -1.0F); // behind every position: never present
    last_row_.assign(size, 1.0F);
    position_.assign(size, 0.0F);
    speed_.assign(size, 0.0F);
    first_row_.assign(size, 0);
    rank_.assign(size, 0);
    delta_.assign(size, 0);
    hold_.assign(size, -1);
    waited_.assign(size, 0);
    must_stop_.assign(size, 0);
    for (std::size_t i = 0; i < vehicles.size(); ++i) {
        const ProblemVehicle& vehicle = vehicles[i];
        half_length_[i] = vehicle.half_length;
        max_speed_[i] = vehicle.max_speed;
        stop_line_[i] = vehicle.stop_line;
        first_conflict_[i] = vehicle.first_conflict;
        route_length_[i] = vehicle.route_length;
        last_row_[i] = static_cast<float>(vehicle.last_row);
        position_[i] = vehicle.position;
        speed_[i] = vehicle.speed;
        first_row_[i] = vehicle.first_row;
        rank_[i] = vehicle.rank;
        delta_[i] = vehicle.delta ? -1 : 0;
        hold_[i] = vehicle.hold;
        waited_[i] = vehicle.waited;
        must_stop_[i] = vehicle.must_stop ? -1 : 0;
    }
}

void LaneTables::fill_candidates(const std::vector<ProblemVehicle>& vehicles,
                                 const std::vector<LeadCandidate>& candidates) {
    candidates_ = 0;
    for (const ProblemVehicle& vehicle : vehicles) {
        candidates_ = std::max(candidates_, vehicle.last_candidate - vehicle.first_candidate);
    }
    const std::size_t size = at(candidates_) * at(padded_vehicles_);
    other_.assign(size, 0);
    other_stop_lane_.assign(size, -1);
    begin_.assign(size, FAR);
    end_.assign(size, -FAR);
    offset_.assign(size, 0.0F);
    other_half_length_.assign(size, 0.0F);
    for (std::size_t i = 0; i < vehicles.size(); ++i) {
        for (int c = vehicles[i].first_candidate; c < vehicles[i].last_candidate; ++c) {
            const LeadCandidate& candidate = candidates[at(c)];
            const std::size_t k = at(c - vehicles[i].first_candidate) * at(padded_vehicles_) + i;
            other_[k] = candidate.other;
            other_stop_lane_[k] = candidate.same_stop_lane ? 0 : -1;
            begin_[k] = candidate.begin;
            end_[k] = candidate.end;
            offset_[k] = candidate.offset;
            other_half_length_[k] = vehicles[at(candidate.other)].half_length;
        }
    }
}

// The pairs come sorted by yielder.
void LaneTables::order_pairs(const std::vector<ProblemPair>& pairs) {
    pair_.clear();
    for (std::size_t turn = 0; pair_.size() < pairs.size(); ++turn) {
        for (std::size_t k = 0, first = 0; k < pairs.size(); ++k) {
            first = pairs[k].yielder == pairs[first].yielder ? first : k;
            if (k - first == turn) {
                pair_.push_back(static_cast<std::int32_t>(k));
            }
        }
    }
}

void LaneTables::fill_pairs(const std::vector<ProblemVehicle>& vehicles, const std::vector<ProblemPair>& pairs) {
    order_pairs(pairs);
    const std::size_t size = at(padded_pairs_);
    for (auto* one : {&yielder_, &prioritized_, &yielder_rank_, &merging_, &by_arrival_}) {
        one->assign(size, 0);
    }
    for (auto* one : {&yielder_entry_, &prioritized_entry_, &yielder_half_length_, &prioritized_half_length_,
                      &yielder_stop_line_, &prioritized_line_}) {
        one->assign(size, 0.0F);
    }
    yielder_end_.assign(size, -FAR); // before every position: never active
    prioritized_end_.assign(size, -FAR);
    for (std::size_t k = 0; k < pairs.size(); ++k) {
        const ProblemPair& pair = pairs[at(pair_[k])];
        const ProblemVehicle &i = vehicles[at(pair.yielder)], &j = vehicles[at(pair.prioritized)];
        yielder_[k] = pair.yielder;
        prioritized_[k] = pair.prioritized;
        yielder_rank_[k] = i.rank;
        merging_[k] = pair.merging ? -1 : 0;
        by_arrival_[k] = pair.by_arrival ? -1 : 0;
        yielder_end_[k] = pair.yielder_end;
        prioritized_end_[k] = pair.prioritized_end;
        yielder_entry_[k] = pair.yielder_entry;
        prioritized_entry_[k] = pair.prioritized_entry;
        yielder_half_length_[k] = i.half_length;
        prioritized_half_length_[k] = j.half_length;
        yielder_stop_line_[k] = i.stop_line;
        prioritized_line_[k] = pair.line;
    }
}

void LaneTables::fill_patience(const std::vector<ProblemVehicle>& vehicles, const std::vector<ProblemPair>& pairs) {
    yielder_patience_.assign(at(padded_pairs_), 0.0F);
    for (std::size_t k = 0; k < pairs.size(); ++k) {
        yielder_patience_[k] = vehicles[at(pairs[at(pair_[k])].yielder)].patience;
    }
}

LaneProblem LaneTables::problem() const {
    return {vehicles_,
            padded_vehicles_,
            candidates_,
            padded_pairs_,
            half_length_.data(),
            max_speed_.data(),
            stop_line_.data(),
            first_conflict_.data(),
            route_length_.data(),
            last_row_.data(),
            position_.data(),
            speed_.data(),
            first_row_.data(),
            rank_.data(),
            delta_.data(),
            hold_.data(),
            waited_.data(),
            must_stop_.data(),
            other_.data(),
            other_stop_lane_.data(),
            begin_.data(),
            end_.data(),
            offset_.data(),
            other_half_length_.data(),
            pair_.data(),
            yielder_.data(),
            prioritized_.data(),
            yielder_rank_.data(),
            merging_.data(),
            by_arrival_.data(),
            yielder_end_.data(),
            prioritized_end_.data(),
            yielder_entry_.data(),
            prioritized_entry_.data(),
            yielder_half_length_.data(),
            prioritized_half_length_.data(),
            yielder_stop_line_.data(),
            prioritized_line_.data(),
            yielder_patience_.data()};
}

} // namespace intersection_env
