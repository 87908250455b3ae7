// Maneuvers as they are found, the first of them no intervention; rank_maneuvers puts them in order.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "intersection_env/maneuvers.hpp"
#include "kernel/dispatch.hpp"
#include "prediction/deadline.hpp"
#include "prediction/predictor.hpp"

namespace intersection_env {

// Whether priorities (pair,) order anything; what does not is no intervention.
bool imposes_anything(std::span<const std::int8_t> priorities);

// What some orders come to: (order, vehicle) time losses [s], (order,) smallest distances [m] and whether each is
// followed.
struct Outcomes {
    std::vector<float> time_loss, minimum_distance;
    std::vector<std::uint8_t> followed;

    bool safe(std::size_t order) const;
};

// Predicts orders (order, pair). trajectories: where they go, or none.
Outcomes outcomes_of(const Predictor& predictor, const Traffic& traffic, std::span<const std::int8_t> orders,
                     std::size_t count, const Trajectories& trajectories, const Kernel& kernel);

constexpr std::size_t BATCH = 2048, HURRIED = 256; // orders predicted at a time; where a deadline may come between

// By RankBy. cooperative: as of rank_maneuvers, of flags that are enough. limit, deadline: predict no more, or longer.
Ranking predicted_maneuvers(const Predictor& predictor, const Traffic& traffic,
                            std::span<const std::uint8_t> cooperative, std::size_t limit, const Deadline& deadline,
                            const Kernel& kernel);
Ranking expected_maneuvers(const Predictor& predictor, const Traffic& traffic,
                           std::span<const std::uint8_t> cooperative, std::size_t limit, const Deadline& deadline,
                           const Kernel& kernel);

} // namespace intersection_env
