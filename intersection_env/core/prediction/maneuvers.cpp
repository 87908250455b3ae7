#include "intersection_env/maneuvers.hpp"

#include <algorithm>
#include <bit>
#include <numeric>
#include <stdexcept>
#include <tuple>

#include "prediction/predictor.hpp"
#include "prediction/ranked.hpp"

namespace intersection_env {
namespace {

std::size_t at(int index) { return static_cast<std::size_t>(index); }

void sort(Ranking& ranking) {
    const std::vector<Maneuver> found = std::move(ranking.maneuvers);
    const std::vector<std::int8_t> priorities = std::move(ranking.priorities);
    std::vector<std::size_t> rows(found.size());
    std::iota(rows.begin(), rows.end(), std::size_t{0});
    const auto key = [&found](std::size_t row) {
        return std::tuple(!found[row].safe, !found[row].followed, found[row].total_time_loss);
    };
    std::ranges::stable_sort(rows, {}, key);
    ranking.maneuvers.clear();
    ranking.priorities.clear();
    const auto pairs = static_cast<std::ptrdiff_t>(ranking.pairs.size());
    for (const std::size_t row : rows) {
        ranking.maneuvers.push_back(found[row]);
        const auto begin = priorities.begin() + static_cast<std::ptrdiff_t>(row) * pairs;
        ranking.priorities.insert(ranking.priorities.end(), begin, begin + pairs);
    }
}

// The first time step at which a vehicle's front has reached a line; STEPS + 1 if never.
int reaches(const float* position, int vehicles, int vehicle, float half_length, float line) {
    int step = 0;
    while (step <= STEPS && !(position[step * vehicles + vehicle] + half_length >= line)) {
        ++step;
    }
    return step;
}

// For each vehicle, those ahead of it in its stop lane, as bits.
std::vector<std::uint64_t> ahead_in_lanes(const Map& map, const Traffic& traffic) {
    std::vector<std::uint64_t> ahead(at(traffic.count()));
    for (const Pair& arc : lane_order(map, traffic)) { // front to back, so everybody ahead is known already
        ahead[at(arc.prioritized)] = ahead[at(arc.yielder)] | std::uint64_t{1} << arc.yielder;
    }
    return ahead;
}

std::string words(std::span<const std::string> names, std::vector<std::uint64_t> waits_for, std::uint64_t involved,
                  const std::vector<double>& to_line) {
    std::string text;
    while (involved != 0) {
        int nearest = -1;
        for (std::uint64_t left = involved; left != 0; left &= left - 1) {
            const int i = std::countr_zero(left);
            if ((waits_for[at(i)] & involved) == 0 && (nearest < 0 || to_line[at(i)] < to_line[at(nearest)])) {
                nearest = i;
            }
        }
        if (nearest < 0) {
            throw std::invalid_argument("the order has vehicles wait for each other");
        }
        text += (text.empty() ? "" : ", ") + names[at(nearest)];
        involved &= ~(std::uint64_t{1} << nearest);
    }
    return text.empty() ? "nobody waits" : text;
}

} // namespace

Ranking rank_maneuvers(const Predictor& predictor, const Traffic& traffic, std::span<const std::uint8_t> cooperative,
                       const Budget& budget, std::optional<RankBy> by, const Kernel& kernel) {
    check(predictor.map(), traffic);
    if (cooperative.size() != at(traffic.count())) {
        throw std::invalid_argument("cooperative takes one flag a vehicle");
    }
    const RankBy automatic = predictor.policy().forecast ? RankBy::expectation : RankBy::prediction;
    const std::size_t limit = budget.orders.value_or(orders_in_a_cycle(traffic.count()));
    const Deadline deadline(budget.seconds);
    Ranking ranking = by.value_or(automatic) == RankBy::expectation
                          ? expected_maneuvers(predictor, traffic, cooperative, limit, deadline, kernel)
                          : predicted_maneuvers(predictor, traffic, cooperative, limit, deadline, kernel);
    sort(ranking);
    return ranking;
}

std::vector<std::int8_t> crossing_order(const Map& map, const Traffic& traffic, std::span<const Pair> pairs,
                                        const float* position, std::size_t scenarios) {
    std::vector<std::int8_t> order;
    order.reserve(scenarios * pairs.size());
    const int count = traffic.count();
    for (std::size_t s = 0; s < scenarios; ++s) {
        const float* of_scenario = position + s * at(STEPS + 1) * at(count);
        for (const auto& [i, j] : pairs) {
            const Conflict& conflict = *map.conflict(traffic.route[at(i)], traffic.route[at(j)]);
            const int yielder = reaches(of_scenario, count, i, 0.5F * traffic.length[at(i)], conflict.on_yielder.begin);
            const int prioritized =
                reaches(of_scenario, count, j, 0.5F * traffic.length[at(j)], conflict.on_prioritized.begin);
            order.push_back(yielder < prioritized ? 1 : prioritized <= STEPS ? -1 : 0);
        }
    }
    return order;
}

std::vector<std::string> in_words(const Map& map, const Traffic& traffic, std::span<const Pair> pairs,
                                  std::span<const std::string> names, const std::int8_t* orders, std::size_t count) {
    const std::vector<std::uint64_t> ahead = ahead_in_lanes(map, traffic);
    std::vector<double> to_line;
    for (int i = 0; i < traffic.count(); ++i) {
        to_line.push_back(double{map.routes[at(traffic.route[at(i)])].stop_line} - double{traffic.position[at(i)]});
    }
    std::vector<std::string> sentences;
    sentences.reserve(count);
    for (std::size_t order = 0; order < count; ++order) {
        std::vector<std::uint64_t> waits_for = ahead;
        std::uint64_t involved = 0;
        for (std::size_t p = 0; p < pairs.size(); ++p) {
            const int way = orders[order * pairs.size() + p];
            if (way != 0) {
                const int first = way > 0 ? pairs[p].yielder : pairs[p].prioritized;
                const int second = way > 0 ? pairs[p].prioritized : pairs[p].yielder;
                waits_for[at(second)] |= std::uint64_t{1} << first;
                involved |= std::uint64_t{1} << first | std::uint64_t{1} << second;
            }
        }
        sentences.push_back(words(names, std::move(waits_for), involved, to_line));
    }
    return sentences;
}

} // namespace intersection_env
