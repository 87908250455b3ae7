#include "prediction/bound.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "model/contact.hpp"
#include "model/rectangle.hpp"
#include "prediction/patience.hpp"

namespace intersection_env {
namespace {

constexpr Interval EVERYWHERE{-FAR, FAR};
constexpr float ROUNDED_REACH = 0.001F; // [m], above what rounding can take from a distance

std::size_t at(int index) { return static_cast<std::size_t>(index); }

} // namespace

void Predictor::add_candidates(const Traffic& traffic, int i, Bound& bound) const {
    const int route = traffic.route[at(i)];
    const float rear = traffic.rear(i);
    for (int j = 0; j < traffic.count(); ++j) {
        if (i == j) {
            continue;
        }
        for (const LeadLane& lane : tables_.lead_lanes_of(route, traffic.route[at(j)])) {
            if (std::max(rear, traffic.rear(j) - lane.offset) < lane.end) { // nobody drives backwards
                bound.candidates.push_back({j, lane.begin, lane.end, lane.offset,
                                            0.5F * (traffic.length[at(i)] + traffic.length[at(j)]),
                                            lane.same_stop_lane});
            }
        }
    }
}

void Predictor::add_touches(const Traffic& traffic, Bound& bound) const {
    std::array<float, MAX_VEHICLES> half_diagonal{}, x{}, y{};
    for (int i = 0; i < traffic.count(); ++i) {
        half_diagonal[at(i)] = 0.5F * std::hypot(traffic.length[at(i)], traffic.width[at(i)]);
        const Sample centre = straight_on(*map_, traffic.route[at(i)], traffic.position[at(i)]);
        x[at(i)] = centre.x;
        y[at(i)] = centre.y;
    }
    for (int a = 0; a < traffic.count(); ++a) {
        for (int b = a + 1; b < traffic.count(); ++b) {
            Touch touch{a, b, EVERYWHERE, EVERYWHERE, half_diagonal[at(a)] + half_diagonal[at(b)] + ROUNDED_REACH};
            // who overlaps from the start, as perception may have it, does not count
            const auto apart = [&] {
                const float across = x[at(a)] - x[at(b)], along = y[at(a)] - y[at(b)];
                return across * across + along * along > touch.reach * touch.reach ||
                       clearance(*map_, body(traffic, a), body(traffic, b)) > 0.0F;
            };
            if (traffic.route[at(a)] == traffic.route[at(b)]) {
                if (apart()) {
                    bound.touches.push_back(touch);
                }
                continue;
            }
            for (const Overlap& row : map_->overlaps_of(traffic.route[at(a)], traffic.route[at(b)])) {
                const Overlap overlap = row.seen_from(traffic.route[at(a)]);
                touch.on_a = overlap.on_a;
                touch.on_b = overlap.on_b;
                if (traffic.rear(a) <= touch.on_a.end && traffic.rear(b) <= touch.on_b.end && apart()) {
                    bound.touches.push_back(touch);
                }
            }
        }
    }
}

void Predictor::bind(const Traffic& traffic, std::span<const Pair> pairs, bool distances, const Kernel& kernel,
                     Bound& bound) const {
    bound.vehicles.clear();
    bound.candidates.clear();
    bound.pairs.clear();
    bound.touches.clear();
    for (int i = 0; i < traffic.count(); ++i) {
        const int index = traffic.route[at(i)];
        const Route& route = map_->routes[at(index)];
        const int first = static_cast<int>(bound.candidates.size());
        add_candidates(traffic, i, bound);
        bound.vehicles.push_back({tables_.first_row[at(index)], static_cast<int>(route.samples.size()) - 1,
                                  traffic.position[at(i)], traffic.speed[at(i)], 0.5F * traffic.length[at(i)],
                                  0.5F * traffic.width[at(i)], std::min(traffic.max_speed[at(i)], UNBOUNDED),
                                  route.stop_line, route.first_conflict, route.length, route.rank, route.must_stop,
                                  traffic.has_memories() ? traffic.delta[at(i)] != 0 : committed(*map_, traffic, i),
                                  traffic.has_memories() ? traffic.hold[at(i)] : -1, traffic.steps_waited(i),
                                  traffic.has_patience() ? traffic.patience[at(i)] : 0.0F, first,
                                  static_cast<int>(bound.candidates.size())});
    }
    for (const Pair& pair : pairs) {
        const Conflict& conflict =
            *map_->conflict(traffic.route[at(pair.yielder)], traffic.route[at(pair.prioritized)]);
        const auto entry = [&](int vehicle, const Interval& interval) {
            return std::max(interval.begin, map_->routes[at(traffic.route[at(vehicle)])].stop_line) + CREPT;
        };
        bound.pairs.push_back({pair.yielder, pair.prioritized, conflict.on_yielder.end, conflict.on_prioritized.end,
                               entry(pair.yielder, conflict.on_yielder),
                               entry(pair.prioritized, conflict.on_prioritized), conflict.line, conflict.merging,
                               conflict.by_arrival});
    }
    if (distances) {
        add_touches(traffic, bound);
    }
    bound.lanes.fill(bound.vehicles, bound.candidates, bound.pairs);
    bind_patience(traffic, pairs, kernel, bound);
}

void Predictor::bind_patience(const Traffic& traffic, std::span<const Pair> pairs, const Kernel& kernel,
                              Bound& bound) const {
    if (traffic.has_patience() && policy_.gap != Gap::network) {
        throw std::invalid_argument("this traffic's drivers keep patience, but no network decides about gaps");
    }
    if (traffic.has_patience() || patience_ == Patience::none) {
        return;
    }
    bool is_asked = false;
    for (int i = 0; i < traffic.count(); ++i) {
        is_asked |= waits(*map_, traffic, i);
    }
    if (!is_asked) {
        return; // 0, the median, is everybody's
    }
    bound.gap_logits.resize(pairs.size());
    kernel.gap_logits(problem(bound), bound.gap_logits.data());
    for (int i = 0; i < traffic.count(); ++i) {
        bound.vehicles[at(i)].patience = patience_of(*map_, traffic, i, pairs, bound.gap_logits, MEDIAN);
    }
    bound.lanes.fill_patience(bound.vehicles, bound.pairs);
}

Problem Predictor::problem(const Bound& bound) const {
    return {bound.vehicles.data(),
            bound.candidates.data(),
            bound.pairs.data(),
            bound.touches.data(),
            static_cast<int>(bound.vehicles.size()),
            static_cast<int>(bound.pairs.size()),
            static_cast<int>(bound.touches.size()),
            static_cast<int>(map_->routes.size()),
            map_->has_stops(),
            1.0F / map_->spacing,
            policy_.gap,
            policy_.driver,
            policy_.idm,
            policy_.acceleration_scale,
            policy_.gap_network ? &*policy_.gap_network : nullptr,
            policy_.driving_network ? &*policy_.driving_network : nullptr,
            tables_.observed.data(),
            tables_.pose.data(),
            bound.lanes.problem()};
}

} // namespace intersection_env
