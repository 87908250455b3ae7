#include "worlds/grid.hpp"

#include <algorithm>
#include <cstddef>

#include "intersection_env/traffic.hpp"

namespace intersection_env {
namespace {

std::size_t at(long index) { return static_cast<std::size_t>(index); }

} // namespace

float braked(float position, float speed) { return position + speed * speed * (0.5F / BRAKING); }

Grid grid_around(const Map& map, const RecordedScenes& scenes) {
    float beyond = 1.0F; // the end of their routes [m]
    for (int track = 0; track < scenes.tracks(); ++track) {
        const float length = map.routes[at(scenes.route[at(track)])].length;
        for (long k = scenes.first_sample(track); k < scenes.end_sample(track); ++k) {
            beyond = std::max(beyond, braked(scenes.position[at(k)], scenes.speed[at(k)]) - length + 1.0F);
        }
    }
    const Sample& any = map.routes[0].samples[0];
    float left = any.x, right = any.x, bottom = any.y, top = any.y;
    for (const Route& route : map.routes) {
        for (const Sample& sample : route.samples) {
            left = std::min(left, sample.x);
            right = std::max(right, sample.x);
            bottom = std::min(bottom, sample.y);
            top = std::max(top, sample.y);
        }
    }
    const float extent = std::max(right - left, top - bottom) + 2.0F * beyond;
    return {left - beyond, bottom - beyond, extent / 65535.0F};
}

std::int32_t on_grid(const Grid& grid, float x, float y) {
    const auto line = [&](float from) {
        return static_cast<std::uint32_t>(std::clamp(from / grid.step + 0.5F, 0.0F, 65535.0F)); // rounding alone
    };
    return static_cast<std::int32_t>(line(x - grid.x) | line(y - grid.y) << 16);
}

} // namespace intersection_env
