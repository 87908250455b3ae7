// libFuzzer on the compiled map's reader, and on a prediction with every map that is let in.
#include <cstddef>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "fuzz.hpp"
#include "intersection_env/maneuvers.hpp"
#include "intersection_env/map.hpp"
#include "kernel/dispatch.hpp"
#include "prediction/predictor.hpp"

using namespace intersection_env;

namespace {

// A vehicle at the beginning, the stop line and the end of each route, as far as a traffic may hold them.
Traffic traffic_on(const Map& map) {
    Traffic traffic;
    for (std::size_t r = 0; r < map.routes.size(); ++r) {
        for (const float position : {0.0F, map.routes[r].stop_line, map.routes[r].length}) {
            if (traffic.count() < MAX_VEHICLES) {
                traffic.route.push_back(static_cast<int>(r));
                traffic.position.push_back(position);
                traffic.speed.push_back(10.0F);
                traffic.length.push_back(4.5F);
                traffic.width.push_back(1.8F);
                traffic.max_speed.push_back(50.0F);
            }
        }
    }
    return traffic;
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const unsigned char* data, std::size_t size) {
    try {
        const auto map = std::make_shared<const Map>(Map::parse(with_checksum(data, size), "fuzzed.map"));
        const Predictor predictor(map, Policy{});
        const Traffic traffic = traffic_on(*map);
        const std::vector<std::uint8_t> all(traffic.route.size(), 1);
        rank_maneuvers(predictor, traffic, all, {20}, {}, kernel());
    } catch (const FormatError&) { // refused: what should happen to most
    } catch (const std::invalid_argument&) {
    }
    return 0;
}
