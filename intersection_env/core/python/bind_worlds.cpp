// Worlds: their arrays are views of the core's memory.
#include "python/bind.hpp"

#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>

#include "kernel/dispatch.hpp"
#include "python/arrays.hpp"
#include "worlds/closed_loop.hpp"
#include "worlds/replay.hpp"

namespace intersection_env::python {

using namespace nb::literals;

namespace {

Arrays state_of(const ClosedLoop& worlds) {
    const ClosedLoopState s = worlds.state();
    const int count = worlds.worlds(), vehicles = worlds.vehicles();
    Arrays state;
    state["route"] = copied<std::int32_t>(s.route, {count, vehicles});
    state["position"] = copied<float>(s.position, {count, vehicles});
    state["speed"] = copied<float>(s.speed, {count, vehicles});
    state["length"] = copied<float>(s.length, {count, vehicles});
    state["width"] = copied<float>(s.width, {count, vehicles});
    state["max_speed"] = copied<float>(s.max_speed, {count, vehicles});
    state["acceleration"] = copied<float>(s.acceleration, {count, vehicles});
    state["delta"] = copied<bool>(s.delta, {count, vehicles});
    state["hold"] = copied<std::int32_t>(s.hold, {count, vehicles});
    state["cycle"] = copied<std::int32_t>(s.cycle, {count});
    state["done"] = copied<bool>(s.done, {count});
    state["random"] = copied<std::uint32_t>(s.random, {count, 8});
    return state;
}

void restore(ClosedLoop& worlds, const Arrays& state) {
    ClosedLoopState s;
    take<std::int32_t>(state, "route", s.route);
    take<float>(state, "position", s.position);
    take<float>(state, "speed", s.speed);
    take<float>(state, "length", s.length);
    take<float>(state, "width", s.width);
    take<float>(state, "max_speed", s.max_speed);
    take<float>(state, "acceleration", s.acceleration);
    take<bool>(state, "delta", s.delta);
    take<std::int32_t>(state, "hold", s.hold);
    take<std::int32_t>(state, "cycle", s.cycle);
    take<bool>(state, "done", s.done);
    take<std::uint32_t>(state, "random", s.random);
    const nb::gil_scoped_release release;
    worlds.set_state(s);
}

Arrays state_of(const Replay& worlds) {
    const ReplayState s = worlds.state();
    const int count = worlds.worlds();
    Arrays state;
    state["track"] = copied<std::int32_t>(s.track, {count});
    state["time"] = copied<std::int32_t>(s.time, {count});
    state["position"] = copied<float>(s.position, {count});
    state["speed"] = copied<float>(s.speed, {count});
    state["acceleration"] = copied<float>(s.acceleration, {count});
    state["delta"] = copied<bool>(s.delta, {count});
    state["expert_delta"] = copied<bool>(s.expert_delta, {count});
    state["done"] = copied<bool>(s.done, {count});
    state["random"] = copied<std::uint32_t>(s.random, {count, 8});
    return state;
}

void restore(Replay& worlds, const Arrays& state) {
    ReplayState s;
    take<std::int32_t>(state, "track", s.track);
    take<std::int32_t>(state, "time", s.time);
    take<float>(state, "position", s.position);
    take<float>(state, "speed", s.speed);
    take<float>(state, "acceleration", s.acceleration);
    take<bool>(state, "delta", s.delta);
    take<bool>(state, "expert_delta", s.expert_delta);
    take<bool>(state, "done", s.done);
    take<std::uint32_t>(state, "random", s.random);
    const nb::gil_scoped_release release;
    worlds.set_state(s);
}

RecordedScenes scenes_of(const Arrays& arrays) {
    RecordedScenes s;
    take<std::int64_t>(arrays, "scene_tracks", s.scene_tracks);
    take<std::int64_t>(arrays, "track_samples", s.track_samples);
    take<std::int32_t>(arrays, "track_route", s.route);
    take<std::int32_t>(arrays, "track_start", s.start);
    take<float>(arrays, "track_length", s.length);
    take<float>(arrays, "track_width", s.width);
    take<float>(arrays, "track_max_speed", s.max_speed);
    take<float>(arrays, "position", s.position);
    take<float>(arrays, "speed", s.speed);
    take<bool>(arrays, "observed", s.observed);
    return s;
}

int vehicles_of(const ClosedLoop& worlds) { return worlds.vehicles(); }
int vehicles_of(const Replay&) { return 1; }

template <class T>
T* filled_by(const nb::ndarray<T, nb::c_contig, nb::device::cpu>& array, const char* name, std::size_t size) {
    if (array.size() != size) {
        throw std::invalid_argument(std::string("the array \"") + name + "\" of a rollout has the wrong size");
    }
    return array.data();
}

DrivingNetwork network_of(const Vector<float>& parameters, const char* name) {
    DrivingNetwork network;
    if (parameters.size() * sizeof(float) != sizeof(network)) {
        throw std::invalid_argument(std::string(name) + " must have " +
                                    std::to_string(sizeof(network) / sizeof(float)) + " parameters, not " +
                                    std::to_string(parameters.size()));
    }
    std::copy(parameters.data(), parameters.data() + parameters.size(), reinterpret_cast<float*>(&network));
    return network;
}

using Results = nb::ndarray<float, nb::c_contig, nb::device::cpu>;
using ResultFlags = nb::ndarray<bool, nb::c_contig, nb::device::cpu>;

template <class Worlds>
void roll_out(Worlds& worlds, const Vector<float>& policy, const Vector<float>& value, float sigma, int steps,
              const Results& observation, const Results& latent, const Results& log_probability,
              const Results& value_now, const Results& value_next, const Results& reward, const ResultFlags& terminated,
              const ResultFlags& cut) {
    const DrivingNetwork policy_network = network_of(policy, "policy"), value_network = network_of(value, "value");
    if (steps < 1 || !(sigma > 0.0F)) {
        throw std::invalid_argument("a rollout needs at least one step and a sigma above 0");
    }
    const std::size_t size = static_cast<std::size_t>(worlds.worlds()) * static_cast<std::size_t>(steps) *
                             static_cast<std::size_t>(vehicles_of(worlds));
    const Rollout rollout{&policy_network,
                          &value_network,
                          sigma,
                          std::log(sigma),
                          filled_by(observation, "observation", size * DRIVING_INPUTS),
                          filled_by(latent, "latent", size),
                          filled_by(log_probability, "log_probability", size),
                          filled_by(value_now, "value", size),
                          filled_by(value_next, "value_next", size),
                          filled_by(reward, "reward", size),
                          reinterpret_cast<std::uint8_t*>(filled_by(terminated, "terminated", size)),
                          reinterpret_cast<std::uint8_t*>(filled_by(cut, "cut", size))};
    const nb::gil_scoped_release release;
    worlds.rollout(rollout, steps);
}

} // namespace

void bind_worlds(nb::module_& m) {
    auto closed_loop =
        nb::class_<ClosedLoop>(m, "ClosedLoop",
                               "Closed-loop worlds; the arrays are views of what the next step overwrites.")
            .def(
                "__init__",
                [](ClosedLoop* self, std::shared_ptr<const Map> map, Policy policy, int worlds, int vehicles,
                   int max_cycles, const std::string& autoreset, int threads, const std::optional<std::string>& isa) {
                    new (self) ClosedLoop(std::move(map), std::move(policy), worlds, vehicles, max_cycles,
                                          autoreset_named(autoreset), threads,
                                          isa ? kernel_named(*isa) : kernel_for_worlds(worlds));
                },
                "map"_a, "policy"_a, "worlds"_a, "vehicles"_a, "max_cycles"_a, "autoreset"_a, "threads"_a,
                "isa"_a = nb::none())
            .def("reset", &ClosedLoop::reset, "seed"_a, "desynchronise"_a, nb::call_guard<nb::gil_scoped_release>())
            .def(
                "reset_worlds",
                [](ClosedLoop& worlds, const Vector<bool>& mask) {
                    const std::vector<std::uint8_t> wanted(mask.data(), mask.data() + mask.size());
                    const nb::gil_scoped_release release;
                    worlds.reset_worlds(wanted);
                },
                "mask"_a.noconvert())
            .def("step", &ClosedLoop::step, nb::call_guard<nb::gil_scoped_release>())
            .def("rollout", &roll_out<ClosedLoop>, "policy"_a.noconvert(), "value"_a.noconvert(), "sigma"_a, "steps"_a,
                 "observation"_a.noconvert(), "latent"_a.noconvert(), "log_probability"_a.noconvert(),
                 "value_now"_a.noconvert(), "value_next"_a.noconvert(), "reward"_a.noconvert(),
                 "terminated"_a.noconvert(), "cut"_a.noconvert(),
                 "Steps with the policy inside; fills arrays (world, step, vehicle[, feature]).")
            .def("state", nb::overload_cast<const ClosedLoop&>(&state_of),
                 "Everything, as arrays (world, vehicle), (world,) and (world, 8).")
            .def("set_state", nb::overload_cast<ClosedLoop&, const Arrays&>(&restore), "state"_a);
    for (const auto& [name, field] :
         {std::pair{"action", &ClosedLoop::action}, std::pair{"reward", &ClosedLoop::reward}}) {
        closed_loop.def_prop_ro(name, [field](nb::handle_t<ClosedLoop> self) {
            auto& w = nb::cast<ClosedLoop&>(self);
            return view(self, (w.*field).data(), {w.worlds(), w.vehicles()});
        });
    }
    for (const auto& [name, field] : {std::pair{"observation", &ClosedLoop::observation},
                                      std::pair{"final_observation", &ClosedLoop::final_observation}}) {
        closed_loop.def_prop_ro(name, [field](nb::handle_t<ClosedLoop> self) {
            auto& w = nb::cast<ClosedLoop&>(self);
            return view(self, (w.*field).data(), {w.worlds(), w.vehicles(), DRIVING_INPUTS});
        });
    }
    for (const auto& [name, field] :
         {std::pair{"terminated", &ClosedLoop::terminated}, std::pair{"truncated", &ClosedLoop::truncated},
          std::pair{"reinserted", &ClosedLoop::reinserted}}) {
        closed_loop.def_prop_ro(name, [field](nb::handle_t<ClosedLoop> self) {
            auto& w = nb::cast<ClosedLoop&>(self);
            return flags(self, w.*field, {w.worlds(), w.vehicles()});
        });
    }
    closed_loop.def_prop_ro("done", [](nb::handle_t<ClosedLoop> self) {
        auto& w = nb::cast<ClosedLoop&>(self);
        return flags(self, w.done, {w.worlds()});
    });

    auto replay =
        nb::class_<Replay>(m, "Replay", "Replay worlds; the arrays are views of what the next step overwrites.");
    replay
        .def(
            "__init__",
            [](Replay* self, std::shared_ptr<const Map> map, Policy policy, bool recording, const Arrays& scenes,
               const Vector<std::int32_t>& actors, int worlds, const std::string& autoreset, int threads,
               const std::optional<std::string>& isa) {
                RecordedScenes recorded = scenes_of(scenes);
                std::vector<std::int32_t> may_act = copy(actors);
                const nb::gil_scoped_release release;
                new (self) Replay(std::move(map), std::move(policy), recording, std::move(recorded), std::move(may_act),
                                  worlds, autoreset_named(autoreset), threads,
                                  isa ? kernel_named(*isa) : kernel_for_worlds(worlds));
            },
            "map"_a, "policy"_a, "recording"_a, "scenes"_a, "actors"_a.noconvert(), "worlds"_a, "autoreset"_a,
            "threads"_a, "isa"_a = nb::none())
        .def("reset", &Replay::reset, "seed"_a, "desynchronise"_a, nb::call_guard<nb::gil_scoped_release>())
        .def(
            "reset_worlds",
            [](Replay& worlds, const Vector<bool>& mask) {
                const std::vector<std::uint8_t> wanted(mask.data(), mask.data() + mask.size());
                const nb::gil_scoped_release release;
                worlds.reset_worlds(wanted);
            },
            "mask"_a.noconvert())
        .def("start", &Replay::start, "world"_a, "track"_a, "Begins this world's episode with this track.")
        .def("step", &Replay::step, nb::call_guard<nb::gil_scoped_release>())
        .def("rollout", &roll_out<Replay>, "policy"_a.noconvert(), "value"_a.noconvert(), "sigma"_a, "steps"_a,
             "observation"_a.noconvert(), "latent"_a.noconvert(), "log_probability"_a.noconvert(),
             "value_now"_a.noconvert(), "value_next"_a.noconvert(), "reward"_a.noconvert(), "terminated"_a.noconvert(),
             "cut"_a.noconvert(), "Steps with the policy inside; fills arrays (world, step[, feature]).")
        .def("state", nb::overload_cast<const Replay&>(&state_of), "Everything, as arrays (world,) and (world, 8).")
        .def("set_state", nb::overload_cast<Replay&, const Arrays&>(&restore), "state"_a);
    for (const auto& [name, field] : {std::pair{"action", &Replay::action}, std::pair{"reward", &Replay::reward},
                                      std::pair{"expert_acceleration", &Replay::expert_acceleration}}) {
        replay.def_prop_ro(name, [field](nb::handle_t<Replay> self) {
            auto& w = nb::cast<Replay&>(self);
            return view(self, (w.*field).data(), {w.worlds()});
        });
    }
    for (const auto& [name, field] :
         {std::pair{"observation", &Replay::observation}, std::pair{"final_observation", &Replay::final_observation},
          std::pair{"expert_observation", &Replay::expert_observation}}) {
        replay.def_prop_ro(name, [field](nb::handle_t<Replay> self) {
            auto& w = nb::cast<Replay&>(self);
            return view(self, (w.*field).data(), {w.worlds(), DRIVING_INPUTS});
        });
    }
    for (const auto& [name, field] :
         {std::pair{"terminated", &Replay::terminated}, std::pair{"truncated", &Replay::truncated}}) {
        replay.def_prop_ro(name, [field](nb::handle_t<Replay> self) {
            auto& w = nb::cast<Replay&>(self);
            return flags(self, w.*field, {w.worlds()});
        });
    }
    for (const auto& [name, field] : {std::pair{"track", &Replay::track_now}, std::pair{"time", &Replay::time_now}}) {
        replay.def_prop_ro(name, [field](nb::handle_t<Replay> self) {
            auto& w = nb::cast<Replay&>(self);
            return view(self, (w.*field).data(), {w.worlds()});
        });
    }
}

} // namespace intersection_env::python
