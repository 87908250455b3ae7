#include "worlds/recorded.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "intersection_env/traffic.hpp"
#include "model/contact.hpp"
#include "tables/problem.hpp"

namespace intersection_env {
namespace {

constexpr float NEVER = 1.0e9F;      // [steps], later than any scene ends
constexpr long MOST_ROWS = 1L << 24; // beyond it floats do not count

std::size_t at(long index) { return static_cast<std::size_t>(index); }

[[noreturn]] void refuse(const std::string& what) { throw std::invalid_argument("scenes: " + what); }

} // namespace

Recorded::Recorded(const Map& map, RecordedScenes scenes, std::vector<std::int32_t> actors, bool recording)
    : scenes_(std::move(scenes)), actors_(std::move(actors)) {
    check(map);
    for (std::size_t scene = 0; scene + 1 < scenes_.scene_tracks.size(); ++scene) {
        scene_.resize(at(scenes_.scene_tracks[scene + 1]), static_cast<int>(scene));
    }
    add_samples(map);
    add_accelerations();
    for (int track = 0; track < scenes_.tracks(); ++track) {
        add_track(map, track, recording);
        if (static_cast<long>(companion_rows_.size()) / COMPANION_COLUMNS >= MOST_ROWS) {
            refuse("too many vehicles beside each other for one replay; take fewer scenes");
        }
    }
    companion_rows_.resize(companion_rows_.size() + COMPANION_COLUMNS); // read, and not used, where there is none
    listed_.push_back(0);                                               // likewise
    mark_held();
    seen_.resize(sample_rows_.size() / SAMPLE_COLUMNS * SEEN_COLUMNS);
}

int Recorded::end_step(int track) const {
    return scenes_.start[at(track)] +
           static_cast<int>(scenes_.track_samples[at(track) + 1] - scenes_.track_samples[at(track)]);
}

RecordedRows Recorded::rows() const {
    return {track_rows_.data(),   sample_rows_.data(), companion_rows_.data(),
            acceleration_.data(), seen_.data(),        actors_.data(),
            windows_.data(),      listed_.data(),      static_cast<int>(actors_.size())};
}

void Recorded::check(const Map& map) const {
    const RecordedScenes& s = scenes_;
    const std::size_t tracks = s.route.size(), samples = s.position.size();
    if (s.start.size() != tracks || s.length.size() != tracks || s.width.size() != tracks ||
        s.max_speed.size() != tracks || s.track_samples.size() != tracks + 1 || s.speed.size() != samples ||
        s.observed.size() != samples || s.scene_tracks.empty()) {
        refuse("arrays of different lengths");
    }
    const auto rises = [](const std::vector<std::int64_t>& offsets, std::size_t end) {
        return offsets.front() == 0 && std::is_sorted(offsets.begin(), offsets.end()) && at(offsets.back()) == end;
    };
    if (!rises(s.scene_tracks, tracks) || !rises(s.track_samples, samples)) {
        refuse("offsets that do not rise from 0 to the number of entries");
    }
    if (tracks == 0 || actors_.empty()) {
        refuse("no vehicle that could act");
    }
    if (static_cast<long>(samples) >= MOST_ROWS) {
        refuse("more than 16 million samples; take fewer scenes");
    }
    for (std::size_t track = 0; track < tracks; ++track) {
        const std::int64_t end = s.start[track] + s.track_samples[track + 1] - s.track_samples[track];
        if (end >= MOST_ROWS || s.route[track] < 0 || at(s.route[track]) >= map.routes.size() || s.start[track] < 0 ||
            s.track_samples[track] == s.track_samples[track + 1] ||
            !(s.length[track] >= LEAST_SIZE && s.length[track] <= MOST_LENGTH) ||
            !(s.width[track] >= LEAST_SIZE && s.width[track] <= MOST_WIDTH) || !(s.max_speed[track] >= 0.1F)) {
            refuse("track " + std::to_string(track) + " has no sample, or a route, start or size out of range");
        }
    }
    const auto finite = [](const std::vector<float>& values) {
        return std::all_of(values.begin(), values.end(), [](float x) { return std::fabs(x) < FAR; });
    };
    if (!finite(s.position) || !finite(s.speed)) {
        refuse("a position or speed out of range");
    }
    for (const std::int32_t actor : actors_) {
        if (actor < 0 || at(actor) >= tracks || end_step(actor) - s.start[at(actor)] < 2) {
            refuse("track " + std::to_string(actor) + " cannot act: unknown, or of fewer than two samples");
        }
    }
}

void Recorded::add_samples(const Map& map) {
    for (int track = 0; track < scenes_.tracks(); ++track) {
        const int route = scenes_.route[at(track)];
        const Route& road = map.routes[at(route)];
        int waited = 0;
        for (long k = scenes_.track_samples[at(track)]; k < scenes_.track_samples[at(track) + 1]; ++k) {
            const float position = scenes_.position[at(k)], speed = scenes_.speed[at(k)];
            const float to_line = road.stop_line - (position + 0.5F * scenes_.length[at(track)]);
            const bool stops = road.must_stop && speed < STOPPED && to_line < AT_LINE;
            waited += waited > 0 || stops ? 1 : 0;
            const Sample here = map.at(route, position);
            const Sample braked = straight_on(map, route, position + speed * speed * (0.5F / BRAKING));
            sample_rows_.insert(sample_rows_.end(), {position, speed, 2.0F * static_cast<float>(waited),
                                                     std::min(here.v_max, scenes_.max_speed[at(track)]), here.x, here.y,
                                                     braked.x, braked.y});
        }
    }
}

// What takes the vehicle from each sample to the next; the last one repeats the one before.
void Recorded::add_accelerations() {
    for (int track = 0; track < scenes_.tracks(); ++track) {
        const long begin = scenes_.track_samples[at(track)], end = scenes_.track_samples[at(track) + 1];
        for (long k = begin; k < end; ++k) {
            const long from = std::max(begin, std::min(k, end - 2)), to = std::min(from + 1, end - 1);
            acceleration_.push_back((scenes_.speed[at(to)] - scenes_.speed[at(from)]) / DT);
        }
    }
}

void Recorded::add_track(const Map& map, int track, bool recording) {
    const long first = static_cast<long>(companion_rows_.size()) / COMPANION_COLUMNS;
    const int scene = scene_[at(track)];
    for (long other = scenes_.scene_tracks[at(scene)]; other < scenes_.scene_tracks[at(scene) + 1]; ++other) {
        const bool together = first_step(track) < end_step(static_cast<int>(other)) &&
                              first_step(static_cast<int>(other)) < end_step(track);
        if (other != track && together) {
            add_companion(map, track, static_cast<int>(other), recording);
        }
    }
    const long first_window = static_cast<long>(windows_.size()) / 2;
    add_windows(track, first);
    const long begin = scenes_.track_samples[at(track)], end = scenes_.track_samples[at(track) + 1];
    const auto seen = std::find(scenes_.observed.begin() + begin, scenes_.observed.begin() + end, 1);
    const long recorded = std::min(seen - scenes_.observed.begin(), std::max(end - 2, begin)) - begin;
    track_rows_.insert(track_rows_.end(),
                       {static_cast<float>(scenes_.route[at(track)]), 0.5F * scenes_.length[at(track)],
                        0.5F * scenes_.width[at(track)], std::min(scenes_.max_speed[at(track)], UNBOUNDED),
                        static_cast<float>(begin), static_cast<float>(first_step(track)),
                        static_cast<float>(end_step(track)), static_cast<float>(first_step(track) + recorded),
                        static_cast<float>(first),
                        static_cast<float>(static_cast<long>(companion_rows_.size()) / COMPANION_COLUMNS - first),
                        asks_for_stop(map, track, recording) ? 1.0F : 0.0F, static_cast<float>(first_window)});
}

// Lists for each window of the track which of its companions are present in it.
void Recorded::add_windows(int track, long first) {
    const long end = static_cast<long>(companion_rows_.size()) / COMPANION_COLUMNS;
    for (int step = first_step(track); step < end_step(track); step += WINDOW_STEPS) {
        windows_.push_back(static_cast<std::int32_t>(listed_.size()));
        for (long row = first; row < end; ++row) {
            const float* companion = &companion_rows_[at(row * COMPANION_COLUMNS)];
            if (companion[13] < static_cast<float>(step + WINDOW_STEPS) && static_cast<float>(step) < companion[14]) {
                listed_.push_back(static_cast<std::int32_t>(row));
            }
        }
        windows_.push_back(static_cast<std::int32_t>(listed_.size()));
    }
}

// By the recording nobody who passed its line without a stop.
bool Recorded::asks_for_stop(const Map& map, int track, bool recording) const {
    const Route& road = map.routes[at(scenes_.route[at(track)])];
    if (!recording || !road.must_stop) {
        return road.must_stop;
    }
    bool has_stopped = false;
    for (long k = scenes_.track_samples[at(track)]; k < scenes_.track_samples[at(track) + 1]; ++k) {
        const float to_line = road.stop_line - (scenes_.position[at(k)] + 0.5F * scenes_.length[at(track)]);
        if (to_line < 0.0F) {
            return has_stopped;
        }
        has_stopped |= scenes_.speed[at(k)] < STOPPED && to_line < AT_LINE;
    }
    return true;
}

// One row for each conflict, or lane that they share, of the two.
void Recorded::add_companion(const Map& map, int own, int other, bool recording) {
    const int route = scenes_.route[at(own)], other_route = scenes_.route[at(other)];
    std::vector<const Conflict*> conflicts;
    for (const Conflict* conflict : {map.conflict(route, other_route), map.conflict(other_route, route)}) {
        if (conflict != nullptr) {
            conflicts.push_back(conflict);
        }
    }
    std::vector<SharedLane> lanes;
    for (const SharedLane& lane : map.shared_lanes_of(route, other_route)) {
        lanes.push_back(lane.seen_from(route));
    }
    if (route == other_route) {
        lanes.push_back({route, route, -FAR, -FAR, FAR, 0.0F});
    }
    const bool can_touch = route == other_route || !map.overlaps_of(route, other_route).empty();
    const bool looked_up = conflicts.size() > 1 || (!recording && !conflicts.empty() && conflicts[0]->by_arrival);
    for (std::size_t k = 0; k < std::max(conflicts.size(), lanes.size()); ++k) {
        const Conflict* conflict = k < conflicts.size() ? conflicts[k] : nullptr;
        const SharedLane* lane = k < lanes.size() ? &lanes[k] : nullptr;
        const bool follows = lane != nullptr && is_ahead(*lane, own, other);
        const bool first = conflict != nullptr && went_first(*conflict, own, other);
        Fault fault = looked_up ? Fault::looked_up : fault_of(conflict, route, follows, first, recording);
        if (!can_touch) {
            fault = Fault::never;
        }
        const bool yields = conflict != nullptr && (conflict->yielder == route || conflict->by_arrival);
        if (!follows && !yields && fault == Fault::never) {
            continue; // it neither leads, nor goes first, nor is run into
        }
        add_companion_row(map, own, other, conflict, lane, {follows, first, fault});
    }
}

Fault Recorded::fault_of(const Conflict* conflict, int route, bool follows, bool first, bool recording) {
    if (conflict == nullptr) {
        return follows ? Fault::always : Fault::never;
    }
    if (recording) {
        return first ? Fault::never : Fault::always;
    }
    if (conflict->yielder == route) {
        return follows ? Fault::always : Fault::before_own_end;
    }
    return follows ? Fault::past_other_end : Fault::never;
}

void Recorded::add_companion_row(const Map& map, int own, int other, const Conflict* conflict, const SharedLane* lane,
                                 const Order& order) {
    const int route = scenes_.route[at(own)], other_route = scenes_.route[at(other)];
    float own_end = 0.0F, other_end = 0.0F, kind = 0.0F, line = map.routes[at(other_route)].stop_line;
    if (conflict != nullptr) {
        const bool yields = conflict->yielder == route;
        own_end = (yields ? conflict->on_yielder : conflict->on_prioritized).end;
        other_end = (yields ? conflict->on_prioritized : conflict->on_yielder).end;
        kind = conflict->by_arrival ? BY_ARRIVAL : conflict->merging ? 2.0F : 1.0F;
        kind = yields ? kind : -kind;
        line = yields && !conflict->by_arrival ? conflict->line : line;
    }
    companion_rows_.insert(companion_rows_.end(),
                           {lane == nullptr ? -FAR : lane->end, lane == nullptr ? FAR : lane->begin_b,
                            lane == nullptr ? 0.0F : lane->offset, order.follows ? 1.0F : 0.0F, own_end, other_end,
                            kind, order.first ? 1.0F : 0.0F, static_cast<float>(order.fault), line,
                            0.5F * scenes_.length[at(other)], 0.5F * scenes_.width[at(other)],
                            static_cast<float>(scenes_.track_samples[at(other)]), static_cast<float>(first_step(other)),
                            static_cast<float>(end_step(other)), static_cast<float>(other_route)});
}

// When the track's centre reaches an arc length, in steps of its scene; NEVER if it does not.
float Recorded::reaches(int track, float arc_length) const {
    const long begin = scenes_.track_samples[at(track)], end = scenes_.track_samples[at(track) + 1];
    for (long k = begin; k < end; ++k) {
        if (scenes_.position[at(k)] >= arc_length) {
            const float step = static_cast<float>(first_step(track) + (k - begin));
            if (k == begin) {
                return step;
            }
            const float before = scenes_.position[at(k - 1)];
            return step - (scenes_.position[at(k)] - arc_length) / (scenes_.position[at(k)] - before);
        }
    }
    return NEVER;
}

// Whether the other one was ahead in a lane that the two share.
bool Recorded::is_ahead(const SharedLane& lane, int own, int other) const {
    const int step = std::max(first_step(own), first_step(other));
    const auto position = [&](int track) {
        return scenes_.position[at(scenes_.track_samples[at(track)] + step - first_step(track))];
    };
    if (lane.begin_a > -FAR || lane.begin_b > -FAR) {
        const float own_step = reaches(own, lane.begin_a - 0.5F * scenes_.length[at(own)]);
        const float other_step = reaches(other, lane.begin_b - 0.5F * scenes_.length[at(other)]);
        if (own_step != other_step) {
            return other_step < own_step;
        }
    }
    return position(other) - lane.offset > position(own); // both were there from the first
}

// Whether the own one went first: a yielder whose front reached the conflict before the prioritized vehicle's front
// did, or a prioritized vehicle whose yielder did not.
bool Recorded::went_first(const Conflict& conflict, int own, int other) const {
    const bool yields = conflict.yielder == scenes_.route[at(own)];
    const int yielder = yields ? own : other, prioritized = yields ? other : own;
    const bool yielder_first =
        reaches(yielder, conflict.on_yielder.begin - 0.5F * scenes_.length[at(yielder)]) <
        reaches(prioritized, conflict.on_prioritized.begin - 0.5F * scenes_.length[at(prioritized)]);
    return yields == yielder_first;
}

// A sample is held while its vehicle, by the recorded order, waits for one that is present.
void Recorded::mark_held() {
    for (int track = 0; track < scenes_.tracks(); ++track) {
        const float* row = &track_rows_[at(track) * TRACK_COLUMNS];
        for (long c = static_cast<long>(row[8]); c < static_cast<long>(row[8] + row[9]); ++c) {
            const float* companion = &companion_rows_[at(c * COMPANION_COLUMNS)];
            if ((companion[6] <= 0.0F && companion[6] != -BY_ARRIVAL) || companion[7] != 0.0F) {
                continue;
            }
            const int begin = std::max(first_step(track), static_cast<int>(companion[13]));
            const int end = std::min(end_step(track), static_cast<int>(companion[14]));
            for (int step = begin; step < end; ++step) {
                const long own = scenes_.track_samples[at(track)] + step - first_step(track);
                const long other = static_cast<long>(companion[12]) + step - static_cast<int>(companion[13]);
                const bool active =
                    scenes_.position[at(own)] - row[1] < companion[4] && scenes_.position[at(other)] < companion[5];
                if (active) {
                    float& memory = sample_rows_[at(own) * SAMPLE_COLUMNS + 2];
                    memory += std::fmod(memory, 2.0F) == 0.0F ? 1.0F : 0.0F;
                }
            }
        }
    }
}

} // namespace intersection_env
