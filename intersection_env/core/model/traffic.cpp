#include "intersection_env/traffic.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>

#include "model/contact.hpp"
#include "model/rectangle.hpp"

namespace intersection_env {
namespace {

constexpr float DOUBTED = 2.0F; // ours: nobody is recorded at twice the limit; 50 km/h as 50 m/s are 3.6 times 50 km/h

std::size_t at(int index) { return static_cast<std::size_t>(index); }

[[noreturn]] void refuse(int vehicle, const std::string& problem) {
    throw std::invalid_argument("vehicle " + std::to_string(vehicle) + ": " + problem);
}

void check_number(int vehicle, const char* what, float value, float least, float most) {
    if (!(value >= least && value <= most)) {
        refuse(vehicle, std::string(what) + " must be from " + std::to_string(least) + " to " + std::to_string(most) +
                            ", not " + std::to_string(value));
    }
}

} // namespace

namespace {

void check_memories(const Map& map, const Traffic& traffic) {
    const std::size_t count = traffic.route.size(), wanted = traffic.has_memories() ? count : 0;
    if (traffic.hold.size() != wanted || traffic.delta.size() != wanted ||
        (!traffic.waited.empty() && traffic.waited.size() != wanted)) {
        throw std::invalid_argument("memories need delta and hold, and may have waited, each with one entry a vehicle");
    }
    const int most = static_cast<int>(map.routes.size());
    for (int i = 0; i < static_cast<int>(wanted); ++i) {
        if (traffic.delta[at(i)] > 1) {
            refuse(i, "delta must be 0 or 1, not " + std::to_string(traffic.delta[at(i)]));
        }
        if (traffic.hold[at(i)] < -1 || traffic.hold[at(i)] > most) {
            refuse(i, "hold must be from -1 to " + std::to_string(most) + ", the number of routes, not " +
                          std::to_string(traffic.hold[at(i)]));
        }
        if (traffic.steps_waited(i) < 0 || traffic.steps_waited(i) > MOST_WAITED) {
            refuse(i, "waited must be from 0 to " + std::to_string(MOST_WAITED) + " steps, not " +
                          std::to_string(traffic.steps_waited(i)));
        }
    }
}

void check_patience(const Traffic& traffic) {
    if (!traffic.has_patience()) {
        return;
    }
    if (traffic.patience.size() != traffic.route.size()) {
        throw std::invalid_argument("patience must have one entry a vehicle");
    }
    for (int i = 0; i < traffic.count(); ++i) {
        if (!std::isfinite(traffic.patience[at(i)])) {
            refuse(i, "patience must be finite, not " + std::to_string(traffic.patience[at(i)]));
        }
    }
}

} // namespace

void check(const Map& map, const Traffic& traffic) {
    const std::size_t count = traffic.route.size();
    for (const auto* values :
         {&traffic.position, &traffic.speed, &traffic.length, &traffic.width, &traffic.max_speed}) {
        if (values->size() != count) {
            throw std::invalid_argument("all arrays of a traffic must have one entry a vehicle");
        }
    }
    if (count > MAX_VEHICLES) {
        throw std::invalid_argument(std::to_string(count) + " vehicles are more than the " +
                                    std::to_string(MAX_VEHICLES) + " that one traffic may hold");
    }
    for (int i = 0; i < static_cast<int>(count); ++i) {
        if (traffic.route[at(i)] < 0 || at(traffic.route[at(i)]) >= map.routes.size()) {
            refuse(i, "route " + std::to_string(traffic.route[at(i)]) + " is not one of the map's " +
                          std::to_string(map.routes.size()));
        }
        check_number(i, "position", traffic.position[at(i)], 0.0F, map.routes[at(traffic.route[at(i)])].length);
        check_number(i, "speed", traffic.speed[at(i)], 0.0F, MOST_SPEED);
        check_number(i, "length", traffic.length[at(i)], LEAST_SIZE, MOST_LENGTH);
        check_number(i, "width", traffic.width[at(i)], LEAST_SIZE, MOST_WIDTH);
        if (!(traffic.max_speed[at(i)] >= 0.1F)) {
            refuse(i, "max_speed must be at least 0.1, not " + std::to_string(traffic.max_speed[at(i)]));
        }
    }
    check_memories(map, traffic);
    check_patience(traffic);
}

void find_conflicts(const Map& map, const Traffic& traffic, std::vector<Pair>& found) {
    found.clear();
    for (int i = 0; i < traffic.count(); ++i) {
        for (int j = 0; j < traffic.count(); ++j) {
            const Conflict* conflict = map.conflict(traffic.route[at(i)], traffic.route[at(j)]);
            if (conflict != nullptr && traffic.rear(i) < conflict->on_yielder.end &&
                traffic.position[at(j)] < conflict->on_prioritized.end) {
                found.push_back({i, j});
            }
        }
    }
}

std::vector<Pair> find_conflicts(const Map& map, const Traffic& traffic) {
    std::vector<Pair> found;
    find_conflicts(map, traffic, found);
    return found;
}

void lane_order(const Map& map, const Traffic& traffic, std::vector<Pair>& order) {
    std::array<int, MAX_VEHICLES> waiting{};
    std::size_t count = 0;
    for (int i = 0; i < traffic.count(); ++i) {
        if (traffic.front(i) <= map.routes[at(traffic.route[at(i)])].stop_line || !committed(map, traffic, i)) {
            waiting[count++] = i;
        }
    }
    const auto lane = [&](int i) { return map.routes[at(traffic.route[at(i)])].stop_lane; };
    std::sort(waiting.begin(), waiting.begin() + static_cast<long>(count), [&](int a, int b) {
        const float ahead = traffic.position[at(a)] - traffic.position[at(b)];
        return lane(a) != lane(b) ? lane(a) < lane(b) : ahead != 0.0F ? ahead > 0.0F : a < b;
    });
    order.clear();
    for (std::size_t k = 1; k < count; ++k) {
        if (lane(waiting[k - 1]) == lane(waiting[k])) {
            order.push_back({waiting[k - 1], waiting[k]});
        }
    }
}

std::vector<Pair> lane_order(const Map& map, const Traffic& traffic) {
    std::vector<Pair> order;
    lane_order(map, traffic, order);
    return order;
}

bool committed(const Map& map, const Traffic& traffic, int vehicle) {
    const Route& route = map.routes[at(traffic.route[at(vehicle)])];
    const float speed = traffic.speed[at(vehicle)];
    const bool cannot_stop = route.stop_line - traffic.front(vehicle) < speed * speed / (2.0F * BRAKING);
    const bool under_way = cannot_stop && (speed >= DRIVES || traffic.front(vehicle) > route.first_conflict);
    return under_way && (!traffic.has_memories() || traffic.delta[at(vehicle)] != 0);
}

Body body(const Traffic& traffic, int i) {
    return {traffic.route[at(i)], traffic.position[at(i)], traffic.length[at(i)], traffic.width[at(i)]};
}

std::optional<Closest> closest(const Map& map, const Traffic& traffic) {
    std::optional<Closest> result;
    for (int i = 0; i < traffic.count(); ++i) {
        for (int j = i + 1; j < traffic.count(); ++j) {
            const float distance = clearance(map, body(traffic, i), body(traffic, j));
            if (distance >= NO_DISTANCE) {
                continue;
            }
            if (!result || distance < result->distance) {
                result = Closest{distance, i, j};
            }
        }
    }
    return result;
}

std::vector<std::pair<int, int>> overlaps(const Map& map, const Traffic& traffic) {
    std::vector<std::pair<int, int>> found;
    for (int i = 0; i < traffic.count(); ++i) {
        for (int j = i + 1; j < traffic.count(); ++j) {
            if (clearance(map, body(traffic, i), body(traffic, j)) <= 0.0F) {
                found.emplace_back(i, j);
            }
        }
    }
    return found;
}

std::vector<int> doubted_speeds(const Map& map, const Traffic& traffic) {
    std::vector<int> found;
    for (int i = 0; i < traffic.count(); ++i) {
        if (traffic.speed[at(i)] > DOUBTED * map.at(traffic.route[at(i)], traffic.position[at(i)]).v_max) {
            found.push_back(i);
        }
    }
    return found;
}

std::optional<std::pair<int, int>> collision(const Map& map, const Traffic& traffic, const std::string& bodies) {
    const Bodies seen = bodies_named(bodies);
    const auto braking = [&](int i) { return traffic.speed[at(i)] * traffic.speed[at(i)] * (0.5F / BRAKING); };
    for (int i = 0; i < traffic.count(); ++i) {
        for (int j = i + 1; j < traffic.count(); ++j) {
            if (collide(map, body(traffic, i), body(traffic, j), braking(i), braking(j), seen)) {
                return std::make_pair(i, j);
            }
        }
    }
    return std::nullopt;
}

} // namespace intersection_env
