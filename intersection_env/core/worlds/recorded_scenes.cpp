#include "worlds/recorded_scenes.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "intersection_env/traffic.hpp"
#include "tables/problem.hpp"

namespace intersection_env {
namespace {

std::size_t at(long index) { return static_cast<std::size_t>(index); }

void check_lengths(const RecordedScenes& s) {
    const std::size_t tracks = s.route.size(), samples = s.position.size();
    if (s.start.size() != tracks || s.length.size() != tracks || s.width.size() != tracks ||
        s.max_speed.size() != tracks || s.track_samples.size() != tracks + 1 || s.speed.size() != samples ||
        s.observed.size() != samples || s.scene_tracks.empty()) {
        refuse_scenes("arrays of different lengths");
    }
    const auto rises = [](std::span<const std::int64_t> offsets, std::size_t end) {
        return offsets.front() == 0 && std::is_sorted(offsets.begin(), offsets.end()) && at(offsets.back()) == end;
    };
    if (!rises(s.scene_tracks, tracks) || !rises(s.track_samples, samples)) {
        refuse_scenes("offsets that do not rise from 0 to the number of entries");
    }
}

} // namespace

void refuse_scenes(const char* what) { throw std::invalid_argument(std::string("scenes: ") + what); }

void check(const Map& map, const RecordedScenes& s, const std::vector<std::int32_t>& actors) {
    check_lengths(s);
    const std::size_t tracks = s.route.size();
    if (tracks == 0 || actors.empty()) {
        refuse_scenes("no vehicle that could act");
    }
    if (s.samples() >= MOST_RECORDED_ROWS) {
        refuse_scenes("more than 16 million samples; take fewer scenes");
    }
    for (std::size_t track = 0; track < tracks; ++track) {
        const std::int64_t end = s.start[track] + s.track_samples[track + 1] - s.track_samples[track];
        if (end >= MOST_RECORDED_ROWS || s.route[track] < 0 || at(s.route[track]) >= map.routes.size() ||
            s.start[track] < 0 || s.track_samples[track] == s.track_samples[track + 1] ||
            !(s.length[track] >= LEAST_SIZE && s.length[track] <= MOST_LENGTH) ||
            !(s.width[track] >= LEAST_SIZE && s.width[track] <= MOST_WIDTH) || !(s.max_speed[track] >= 0.1F)) {
            const std::string which = "track " + std::to_string(track);
            refuse_scenes((which + " has no sample, or a route, start or size out of range").c_str());
        }
    }
    const auto finite = [](std::span<const float> values) {
        return std::all_of(values.begin(), values.end(), [](float x) { return std::fabs(x) < FAR; });
    };
    if (!finite(s.position) || !finite(s.speed)) {
        refuse_scenes("a position or speed out of range");
    }
    for (const std::int32_t actor : actors) {
        if (actor < 0 || at(actor) >= tracks || s.end_step(actor) - s.first_step(actor) < 2) {
            const std::string which = "track " + std::to_string(actor);
            refuse_scenes((which + " cannot act: unknown, or of fewer than two samples").c_str());
        }
    }
}

} // namespace intersection_env
