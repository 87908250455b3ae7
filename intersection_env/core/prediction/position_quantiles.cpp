#include <algorithm>
#include <array>
#include <stdexcept>
#include <string>
#include <utility>

#include "intersection_env/forecast.hpp"

namespace intersection_env {
namespace {

constexpr int STEPS_A_SECOND = 5;

std::size_t at(int index) { return static_cast<std::size_t>(index); }

using Distances = std::array<float, Spread::LEVELS>; // [m]

// The scale for a way predicted until then [m].
float scale_of(const Spread::Second& second, float way) {
    const auto beyond = std::ranges::upper_bound(Spread::WAYS, way);
    if (beyond == Spread::WAYS.end()) {
        return second.scale.back();
    }
    const std::size_t k = std::max<std::size_t>(static_cast<std::size_t>(beyond - Spread::WAYS.begin()), 1);
    const float share = (way - Spread::WAYS[k - 1]) / (Spread::WAYS[k] - Spread::WAYS[k - 1]);
    return second.scale[k - 1] + share * (second.scale[k] - second.scale[k - 1]);
}

// How far whoever is predicted to drive a way until a step may be from there.
Distances distances(const Spread& spread, int step, float way) {
    const int before = step / STEPS_A_SECOND;
    const float share = static_cast<float>(step % STEPS_A_SECOND) / STEPS_A_SECOND;
    Distances result{};
    const auto add = [&](int second, float weight) {
        if (second > 0 && weight > 0.0F) {
            const Spread::Second& own = spread.seconds[at(second - 1)];
            const float unit = weight * scale_of(own, way);
            for (std::size_t l = 0; l < result.size(); ++l) {
                result[l] += unit * own.shape[l];
            }
        }
    };
    add(before, 1.0F - share);
    add(before + 1, share);
    return result;
}

using Weighted = std::pair<float, double>; // where, and how probable

} // namespace

std::vector<float> position_quantiles(const Spread& spread, std::span<const double> probability, const float* position,
                                      int vehicles, std::span<const double> levels) {
    for (const double level : levels) {
        if (!(level >= 0.0 && level <= 1.0)) {
            throw std::invalid_argument("a level must be from 0 to 1, not " + std::to_string(level));
        }
    }
    const std::size_t frame = at(vehicles), scenario = frame * (STEPS + 1);
    std::vector<float> quantiles(levels.size() * scenario);
    std::vector<Weighted> places;
    for (int step = 0; step <= STEPS; ++step) {
        for (std::size_t i = 0; i < frame; ++i) {
            places.clear();
            double sum = 0.0;
            for (std::size_t o = 0; o < probability.size(); ++o) {
                const float now = position[o * scenario + i], then = position[o * scenario + at(step) * frame + i];
                for (const float distance : distances(spread, step, then - now)) {
                    places.emplace_back(std::max(then + distance, now), probability[o]);
                    sum += probability[o];
                }
            }
            std::ranges::sort(places);
            for (std::size_t l = 0; l < levels.size(); ++l) {
                double below = 0.0;
                std::size_t k = 0;
                while (k + 1 < places.size() && (below += places[k].second) < levels[l] * sum) {
                    ++k;
                }
                quantiles[l * scenario + at(step) * frame + i] = places.empty() ? 0.0F : places[k].first;
            }
        }
    }
    return quantiles;
}

} // namespace intersection_env
