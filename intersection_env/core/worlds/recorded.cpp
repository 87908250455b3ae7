#include "worlds/recorded.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "intersection_env/traffic.hpp"
#include "model/contact.hpp"
#include "tables/problem.hpp"
#include "worlds/grid.hpp"
#include "worlds/recorded_order.hpp"

namespace intersection_env {
namespace {

constexpr int PAD = LANES; // kernels read so many numbers beyond the last one, and use none of them

std::size_t at(long index) { return static_cast<std::size_t>(index); }

float whole(std::int32_t number) { return std::bit_cast<float>(number); }
std::int32_t whole(float number) { return std::bit_cast<std::int32_t>(number); }

Fault fault_of(const Conflict* conflict, int route, bool follows, bool first, bool recording) {
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

// Whether its vehicle may have to wait for a companion: by right of way or by arrival.
bool may_wait(const float* companion) { return companion[6] > 0.0F || companion[6] == -BY_ARRIVAL; }

// Whether a companion on this route can be touched by whoever is on `own`, wherever that one is.
bool can_be_touched(const Map& map, int own, const Body& companion, const Body& once_braked) {
    if (own == companion.route) {
        return true;
    }
    return std::ranges::any_of(map.overlaps_of(own, companion.route), [&](const Overlap& row) {
        const Interval there = row.seen_from(own).on_b;
        return companion.rear() <= there.end && once_braked.front() >= there.begin;
    });
}

} // namespace

Recorded::Recorded(const Map& map, const RecordedScenes& scenes, std::vector<std::int32_t> actors, bool recording,
                   bool needs_v_max)
    : actors_(std::move(actors)) {
    check(map, scenes, actors_);
    const Source from{map, scenes, recording};
    add_samples(from);
    if (needs_v_max) {
        add_v_max(from);
    }
    tracks_.reserve(at(scenes.tracks()) * TRACK_COLUMNS);
    for (int scene = 0; at(scene) + 1 < scenes.scene_tracks.size(); ++scene) {
        for (long track = scenes.scene_tracks[at(scene)]; track < scenes.scene_tracks[at(scene) + 1]; ++track) {
            const auto first = companions_.size();
            add_companions_in_scene(from, scene, static_cast<int>(track));
            const auto beside = std::span<const float>(companions_).subspan(first);
            mark_held(from, static_cast<int>(track), beside);
            add_track(from, static_cast<int>(track));
            add_windows(from, static_cast<int>(track), beside);
        }
    }
    windows_.push_back(static_cast<std::int32_t>(listed_.size()));
    companions_.resize(companions_.size() + COMPANION_COLUMNS); // where lanes look that have none
    listed_.resize(listed_.size() + PAD);
    for (auto* numbers : {&companions_, &samples_}) {
        numbers->shrink_to_fit();
    }
    for (auto* numbers : {&windows_, &listed_}) {
        numbers->shrink_to_fit();
    }
    seen_.resize(at(scenes.samples()));
}

RecordedRows Recorded::rows() const {
    return {tracks_.data(), samples_.data(), companions_.data(), v_max_.empty() ? nullptr : v_max_.data(), seen_.data(),
            actors_.data(), windows_.data(), listed_.data(),     static_cast<int>(actors_.size()),         grid_};
}

void Recorded::add_samples(const Source& from) {
    const RecordedScenes& scenes = from.scenes;
    grid_ = grid_around(from.map, scenes);
    samples_.reserve(at(scenes.samples()) * SAMPLE_COLUMNS + PAD);
    for (int track = 0; track < scenes.tracks(); ++track) {
        const int route = scenes.route[at(track)];
        const Route& road = from.map.routes[at(route)];
        int waited = 0;
        for (long k = scenes.first_sample(track); k < scenes.end_sample(track); ++k) {
            const float position = scenes.position[at(k)], speed = scenes.speed[at(k)];
            const Sample here = from.map.at(route, position);
            const Sample there = straight_on(from.map, route, braked(position, speed));
            const float to_line = road.stop_line - (position + scenes.half_length(track));
            const bool stops = road.must_stop && speed < STOPPED && to_line < AT_LINE;
            waited += waited > 0 || stops ? 1 : 0;
            samples_.insert(samples_.end(), {position, speed, whole(2 * waited), whole(on_grid(grid_, here.x, here.y)),
                                             whole(on_grid(grid_, there.x, there.y))});
        }
    }
    samples_.resize(samples_.size() + PAD);
}

void Recorded::add_v_max(const Source& from) {
    for (int track = 0; track < from.scenes.tracks(); ++track) {
        for (long k = from.scenes.first_sample(track); k < from.scenes.end_sample(track); ++k) {
            const Sample here = from.map.at(from.scenes.route[at(track)], from.scenes.position[at(k)]);
            v_max_.push_back(std::min(here.v_max, from.scenes.max_speed[at(track)]));
        }
    }
}

void Recorded::add_companions_in_scene(const Source& from, int scene, int track) {
    const RecordedScenes& scenes = from.scenes;
    for (long k = scenes.scene_tracks[at(scene)]; k < scenes.scene_tracks[at(scene) + 1]; ++k) {
        const int other = static_cast<int>(k);
        const bool together =
            scenes.first_step(track) < scenes.end_step(other) && scenes.first_step(other) < scenes.end_step(track);
        if (other != track && together) {
            add_companions(from, track, other);
        }
    }
    if (companions() >= MOST_RECORDED_ROWS) {
        refuse_scenes("too many vehicles beside each other for one replay; take fewer scenes");
    }
}

// One row for each conflict, or lane that they share, of the two.
void Recorded::add_companions(const Source& from, int own, int other) {
    const Map& map = from.map;
    const int route = from.scenes.route[at(own)], other_route = from.scenes.route[at(other)];
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
    const bool looked_up = conflicts.size() > 1 || (!from.recording && !conflicts.empty() && conflicts[0]->by_arrival);
    for (std::size_t k = 0; k < std::max(conflicts.size(), lanes.size()); ++k) {
        const Conflict* conflict = k < conflicts.size() ? conflicts[k] : nullptr;
        const SharedLane* lane = k < lanes.size() ? &lanes[k] : nullptr;
        const bool follows = lane != nullptr && is_ahead(from.scenes, *lane, own, other);
        const bool first = conflict != nullptr && went_first(from.scenes, *conflict, own, other);
        Fault fault = looked_up ? Fault::looked_up : fault_of(conflict, route, follows, first, from.recording);
        if (!can_touch) {
            fault = Fault::never;
        }
        const bool yields = conflict != nullptr && (conflict->yielder == route || conflict->by_arrival);
        if (!follows && !yields && fault == Fault::never) {
            continue; // it neither leads, nor goes first, nor is run into
        }
        add_companion(from, own, other, conflict, lane, {follows, first, fault});
    }
}

void Recorded::add_companion(const Source& from, int own, int other, const Conflict* conflict, const SharedLane* lane,
                             const Order& order) {
    const RecordedScenes& scenes = from.scenes;
    const int route = scenes.route[at(own)], other_route = scenes.route[at(other)];
    float own_end = 0.0F, other_end = 0.0F, kind = 0.0F, line = from.map.routes[at(other_route)].stop_line;
    if (conflict != nullptr) {
        const bool yields = conflict->yielder == route;
        own_end = (yields ? conflict->on_yielder : conflict->on_prioritized).end;
        other_end = (yields ? conflict->on_prioritized : conflict->on_yielder).end;
        kind = conflict->by_arrival ? BY_ARRIVAL : conflict->merging ? 2.0F : 1.0F;
        kind = yields ? kind : -kind;
        line = yields && !conflict->by_arrival ? conflict->line : line;
    }
    companions_.insert(
        companions_.end(),
        {lane == nullptr ? -FAR : lane->end, lane == nullptr ? FAR : lane->begin_b,
         lane == nullptr ? 0.0F : lane->offset, order.follows ? 1.0F : 0.0F, own_end, other_end, kind,
         order.first ? 1.0F : 0.0F, static_cast<float>(order.fault), line, scenes.half_length(other),
         0.5F * scenes.width[at(other)], static_cast<float>(scenes.first_sample(other)),
         static_cast<float>(scenes.first_step(other)), static_cast<float>(scenes.end_step(other)),
         static_cast<float>(from.map.routes[at(other_route)].rank * MOST_ROUTES_OF_A_MAP + other_route)});
}

void Recorded::add_track(const Source& from, int track) {
    const RecordedScenes& scenes = from.scenes;
    const long begin = scenes.first_sample(track), end = scenes.end_sample(track);
    const auto seen = std::find(scenes.observed.begin() + begin, scenes.observed.begin() + end, true);
    const long recorded = std::min(seen - scenes.observed.begin(), std::max(end - 2, begin)) - begin;
    tracks_.insert(tracks_.end(),
                   {static_cast<float>(scenes.route[at(track)]), scenes.half_length(track),
                    0.5F * scenes.width[at(track)], std::min(scenes.max_speed[at(track)], UNBOUNDED),
                    static_cast<float>(begin), static_cast<float>(scenes.first_step(track)),
                    static_cast<float>(scenes.end_step(track)), static_cast<float>(scenes.first_step(track) + recorded),
                    asks_for_stop(scenes, from.map, track, from.recording) ? 1.0F : 0.0F,
                    static_cast<float>(windows_.size()), 0.0F, 0.0F});
}

// Lists for each window of the track which of its companions can lead it, have it wait, or be run into then.
void Recorded::add_windows(const Source& from, int track, std::span<const float> companions) {
    const int route = from.scenes.route[at(track)];
    const auto matters = [&](const float* companion, int step) {
        const float* sample =
            &samples_[at(static_cast<long>(companion[12]) + step - static_cast<int>(companion[13])) * SAMPLE_COLUMNS];
        const float position = sample[0], there = position - companion[2];
        const bool leads =
            companion[3] > 0.0F && there - companion[10] < companion[0] && position + companion[10] > companion[1];
        const bool is_awaited =
            may_wait(companion) && position < companion[5] && !(from.recording && companion[7] > 0.0F);
        const Body body{static_cast<int>(companion[15]) % MOST_ROUTES_OF_A_MAP, position, 2.0F * companion[10],
                        2.0F * companion[11]};
        Body later = body;
        later.position = braked(position, sample[1]);
        return leads || is_awaited ||
               (companion[8] != static_cast<float>(Fault::never) && can_be_touched(from.map, route, body, later));
    };
    const long first = static_cast<long>(companions.data() - companions_.data()) / COMPANION_COLUMNS;
    const int end = from.scenes.end_step(track);
    for (int begin = from.scenes.first_step(track); begin < end; begin += WINDOW_STEPS) {
        windows_.push_back(static_cast<std::int32_t>(listed_.size()));
        for (std::size_t k = 0; k < companions.size(); k += COMPANION_COLUMNS) {
            const float* companion = &companions[k];
            const int last = std::min(std::min(begin + WINDOW_STEPS, end), static_cast<int>(companion[14]));
            int step = std::max(begin, static_cast<int>(companion[13]));
            while (step < last && !matters(companion, step)) {
                ++step;
            }
            if (step < last) {
                listed_.push_back(static_cast<std::int32_t>(first + static_cast<long>(k) / COMPANION_COLUMNS));
            }
        }
    }
}

// A sample is held while its vehicle, by the recorded order, waits for one that is present.
void Recorded::mark_held(const Source& from, int track, std::span<const float> companions) {
    const RecordedScenes& scenes = from.scenes;
    for (std::size_t c = 0; c < companions.size(); c += COMPANION_COLUMNS) {
        const float* companion = &companions[c];
        if (!may_wait(companion) || companion[7] != 0.0F) {
            continue;
        }
        const int begin = std::max(scenes.first_step(track), static_cast<int>(companion[13]));
        const int end = std::min(scenes.end_step(track), static_cast<int>(companion[14]));
        for (int step = begin; step < end; ++step) {
            const long own = scenes.first_sample(track) + step - scenes.first_step(track);
            const long other = static_cast<long>(companion[12]) + step - static_cast<int>(companion[13]);
            if (scenes.position[at(own)] - scenes.half_length(track) < companion[4] &&
                scenes.position[at(other)] < companion[5]) {
                float& memory = samples_[at(own) * SAMPLE_COLUMNS + 2];
                memory = whole(whole(memory) | 1);
            }
        }
    }
}

} // namespace intersection_env
