#include "intersection_env/locate.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <string>

namespace intersection_env {
namespace {

constexpr double SAME = 1e-3; // [m], ours: offsets of lanes that routes share differ by less

double wrapped(double angle) { return std::remainder(angle, 2.0 * std::numbers::pi); }

void check_number(const char* what, double value) {
    if (!std::isfinite(value)) {
        throw std::invalid_argument(std::string(what) + " must be a number, not " + std::to_string(value));
    }
}

} // namespace

Nearest nearest(const Map& map, int route, double x, double y) {
    const Route& on = map.routes[static_cast<std::size_t>(route)];
    double squared = std::numeric_limits<double>::infinity(), along = 0.0;
    for (std::size_t k = 0; k + 1 < on.samples.size(); ++k) {
        const double from_x = on.samples[k].x, from_y = on.samples[k].y;
        const double east = on.samples[k + 1].x - from_x, north = on.samples[k + 1].y - from_y;
        const double way = east * east + north * north;
        const double share = way > 0.0 ? std::clamp(((x - from_x) * east + (y - from_y) * north) / way, 0.0, 1.0) : 0.0;
        const double off_x = x - from_x - share * east, off_y = y - from_y - share * north;
        const double here = off_x * off_x + off_y * off_y;
        if (here < squared) {
            squared = here;
            along = (static_cast<double>(k) + share) * double{map.spacing};
        }
    }
    const double length = on.length, position = std::min(along, length), distance = std::sqrt(squared);
    const double width = map.at(route, static_cast<float>(position)).width;
    const double excess = std::max(0.0, distance - std::max(0.0, 0.5 * (width - PLAIN_LANE)));
    return {position, distance, excess, position > 0.0 && position < length};
}

std::vector<Place> locate(const Map& map, double x, double y, double heading, const LocateLimits& limits) {
    check_number("x", x);
    check_number("y", y);
    check_number("heading", heading);
    std::vector<Place> found;
    for (int route = 0; route < static_cast<int>(map.routes.size()); ++route) {
        const Nearest place = nearest(map, route, x, y);
        if (!place.beside || place.excess > limits.aside) {
            continue;
        }
        const Sample sample = map.at(route, static_cast<float>(place.position));
        const double turn = wrapped(heading - double{sample.heading});
        if (std::abs(turn) > limits.turned) {
            continue;
        }
        const double left =
            (y - double{sample.y}) * std::cos(sample.heading) - (x - double{sample.x}) * std::sin(sample.heading);
        found.push_back(
            {route, static_cast<float>(place.position), static_cast<float>(left), static_cast<float>(turn)});
    }
    std::ranges::stable_sort(found, {}, [](const Place& place) { return std::round(std::abs(place.left) / SAME); });
    return found;
}

} // namespace intersection_env
