#include <algorithm>
#include <map>
#include <numeric>

#include "intersection_env/forecast.hpp"
#include "prediction/ranked.hpp"
#include "prediction/weighed_orders.hpp"

namespace intersection_env {
namespace {

std::size_t at(int index) { return static_cast<std::size_t>(index); }

using Rows = std::vector<std::size_t>; // of orders

// All orders with what each comes to.
struct Predicted {
    WeighedOrders found;
    Outcomes outcomes;
    std::vector<double> total, worst; // (order,) time losses [s]

    Predicted(const Predictor& predictor, const Traffic& traffic, std::size_t limit, const Deadline& deadline,
              const Kernel& kernel)
        : found(weigh_orders(predictor, traffic, {}, limit, deadline, kernel)) {
        const std::size_t pairs = found.pairs.size(), vehicles = at(traffic.count());
        const std::size_t most = deadline.is_set() ? HURRIED : BATCH;
        for (std::size_t first = 0; first < found.count(); first += most) {
            if (first > 0 && deadline.passed()) {
                found.keep_first(first);
                break;
            }
            const std::size_t count = std::min(most, found.count() - first);
            const std::span<const std::int8_t> orders(found.orders.data() + first * pairs, count * pairs);
            const Outcomes part = outcomes_of(predictor, traffic, orders, count, {}, kernel);
            const auto add = [](auto& all, const auto& more) { all.insert(all.end(), more.begin(), more.end()); };
            add(outcomes.time_loss, part.time_loss);
            add(outcomes.minimum_distance, part.minimum_distance);
            add(outcomes.followed, part.followed);
        }
        for (std::size_t o = 0; o < found.count(); ++o) {
            const float* lost = outcomes.time_loss.data() + o * vehicles;
            total.push_back(std::accumulate(lost, lost + vehicles, 0.0));
            worst.push_back(vehicles == 0 ? 0.0 : std::max(0.0, double{*std::max_element(lost, lost + vehicles)}));
        }
    }
};

// Total time losses without intervention, so sorted that the chance of one beyond a bound is found at once.
class Without {
  public:
    explicit Without(const Predicted& all) {
        const std::vector<double> probability = shares(all.found.logarithm);
        Rows rows(all.total.size());
        std::iota(rows.begin(), rows.end(), std::size_t{0});
        std::ranges::stable_sort(rows, std::greater{}, [&](std::size_t row) { return all.total[row]; });
        double sum = 0.0;
        for (const std::size_t row : rows) {
            lost_.push_back(all.total[row]);
            mass_.push_back(sum += probability[row]);
        }
    }

    double chance_above(double bound) const {
        const auto end = std::ranges::lower_bound(lost_, bound, std::greater{}); // the first that is not above it
        const auto above = static_cast<std::size_t>(end - lost_.begin());
        return above == 0 ? 0.0 : std::min(mass_[above - 1], 1.0);
    }

  private:
    std::vector<double> lost_, mass_;
};

// The maneuver that leaves these orders, each with its share of their probability.
Maneuver maneuver(const Predicted& all, const Rows& rows, const Without& without, const Maneuver* none) {
    std::vector<double> logarithm;
    for (const std::size_t row : rows) {
        logarithm.push_back(all.found.logarithm[row]);
    }
    const std::vector<double> share = shares(logarithm);
    Maneuver result{};
    for (std::size_t k = 0; k < rows.size(); ++k) {
        result.total_time_loss += share[k] * all.total[rows[k]];
        result.worst_time_loss += share[k] * all.worst[rows[k]];
        result.chance_unsafe += all.outcomes.safe(rows[k]) ? 0.0 : share[k];
        if (none != nullptr) {
            result.chance_worthwhile += share[k] * without.chance_above(all.total[rows[k]] + WORTHWHILE_GAIN);
        }
    }
    const std::size_t likely = rows[static_cast<std::size_t>(std::ranges::max_element(share) - share.begin())];
    result.minimum_distance = all.outcomes.minimum_distance[likely];
    result.followed = all.outcomes.followed[likely] != 0;
    result.safe = all.outcomes.safe(likely);
    result.intervention = none != nullptr;
    result.gain = none == nullptr ? 0.0 : none->total_time_loss - result.total_time_loss;
    result.worth_executing = result.safe && result.gain > WORTHWHILE_GAIN;
    return result;
}

} // namespace

Ranking expected_maneuvers(const Predictor& predictor, const Traffic& traffic,
                           std::span<const std::uint8_t> cooperative, std::size_t limit, const Deadline& deadline,
                           const Kernel& kernel) {
    const Predicted all(predictor, traffic, limit, deadline, kernel);
    const Without without(all);
    Ranking ranking;
    ranking.pairs = all.found.pairs;
    ranking.left_out = all.found.left_out;
    const auto append = [&](std::span<const std::int8_t> imposed, const Rows& rows) {
        const Maneuver* none = ranking.maneuvers.empty() ? nullptr : &ranking.maneuvers.front();
        ranking.maneuvers.push_back(maneuver(all, rows, without, none));
        ranking.priorities.insert(ranking.priorities.end(), imposed.begin(), imposed.end());
    };
    Rows every(all.found.count());
    std::iota(every.begin(), every.end(), std::size_t{0});
    append(std::vector<std::int8_t>(ranking.pairs.size()), every);
    std::map<std::vector<std::int8_t>, std::size_t> place; // of what is imposed, in the order in which it was found
    std::vector<std::pair<std::vector<std::int8_t>, Rows>> groups;
    for (const std::size_t row : every) {
        std::vector<std::int8_t> imposed(ranking.pairs.size());
        for (std::size_t p = 0; p < imposed.size(); ++p) {
            const Pair& pair = ranking.pairs[p];
            const bool both = cooperative[at(pair.yielder)] != 0 && cooperative[at(pair.prioritized)] != 0;
            imposed[p] = both ? all.found.order(row)[p] : std::int8_t{0};
        }
        const auto [found, is_new] = place.try_emplace(imposed, groups.size());
        if (is_new) {
            groups.emplace_back(std::move(imposed), Rows{});
        }
        groups[found->second].second.push_back(row);
    }
    for (const auto& [imposed, rows] : groups) {
        if (all.found.feasible && imposes_anything(imposed)) {
            append(imposed, rows);
        }
    }
    return ranking;
}

} // namespace intersection_env
