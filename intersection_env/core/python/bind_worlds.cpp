// Worlds: their arrays are views of the core's memory.
#include "python/bind.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
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

template <class Worlds>
Shape shape_of(const Worlds& worlds, Per per) {
    Shape shape{static_cast<std::size_t>(worlds.worlds())};
    if (std::is_same_v<Worlds, ClosedLoop> && (per == Per::vehicle || per == Per::feature)) {
        shape.push_back(static_cast<std::size_t>(worlds.vehicles()));
    }
    if (per == Per::feature) {
        shape.push_back(DRIVING_INPUTS);
    } else if (per == Per::word) {
        shape.push_back(2 * STREAM_WORDS);
    }
    return shape;
}

template <class Worlds>
Arrays state_of(const Worlds& worlds) {
    const typename Worlds::State state = worlds.state();
    Arrays arrays;
    Worlds::State::for_each([&](auto field, auto member) {
        const auto& values = state.*member;
        auto array = make<decltype(field.shown(values.front()))>(shape_of(worlds, field.per));
        std::transform(values.begin(), values.end(), array.data(), [field](auto kept) { return field.shown(kept); });
        arrays[field.name] = array;
    });
    return arrays;
}

template <class Worlds>
void restore(Worlds& worlds, const Arrays& arrays) {
    typename Worlds::State state;
    Worlds::State::for_each([&](auto field, auto member) {
        auto& values = state.*member;
        const auto array = taken<decltype(field.shown(values.front()))>(arrays, field.name);
        values.resize(array.size());
        std::transform(array.data(), array.data() + array.size(), values.begin(),
                       [field](auto shown) { return field.kept(shown); });
    });
    const nb::gil_scoped_release release;
    worlds.set_state(state);
}

template <class Worlds>
void bind_buffers(nb::class_<Worlds>& bound) {
    Worlds::Buffers::for_each([&](auto field, auto member) {
        bound.def_prop_ro(field.name, [per = field.per, member](nb::handle_t<Worlds> self) {
            auto& worlds = nb::cast<Worlds&>(self);
            return view(self, worlds.buffers.*member, shape_of(worlds, per));
        });
    });
}

// The arrays of a dictionary, which keeps them alive, as they lie in memory.
RecordedScenes scenes_of(const Arrays& arrays) {
    RecordedScenes s;
    const auto take = [&arrays]<class T>(const char* name, std::span<const T>& values) {
        const auto array = taken<T>(arrays, name);
        values = {array.data(), array.size()};
    };
    take("scene_tracks", s.scene_tracks);
    take("track_samples", s.track_samples);
    take("track_route", s.route);
    take("track_start", s.start);
    take("track_length", s.length);
    take("track_width", s.width);
    take("track_max_speed", s.max_speed);
    take("position", s.position);
    take("speed", s.speed);
    take("observed", s.observed);
    return s;
}

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

using Numbers = nb::ndarray<float, nb::c_contig, nb::device::cpu>;
using Booleans = nb::ndarray<bool, nb::c_contig, nb::device::cpu>;

template <class Worlds>
void roll_out(Worlds& worlds, const Vector<float>& policy, const Vector<float>& value, float sigma, int steps,
              const Numbers& observation, const Numbers& latent, const Numbers& log_probability,
              const Numbers& value_now, const Numbers& value_next, const Numbers& reward, const Booleans& terminated,
              const Booleans& cut) {
    const DrivingNetwork policy_network = network_of(policy, "policy"), value_network = network_of(value, "value");
    if (steps < 1 || !(sigma > 0.0F)) {
        throw std::invalid_argument("a rollout needs at least one step and a sigma above 0");
    }
    const std::size_t size = static_cast<std::size_t>(worlds.worlds()) * static_cast<std::size_t>(steps) *
                             static_cast<std::size_t>(worlds.vehicles());
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

void bind_closed_loop(nb::module_& m) {
    auto closed_loop =
        nb::class_<ClosedLoop>(m, "ClosedLoop",
                               "Closed-loop worlds; the arrays are views of what the next step overwrites.")
            .def(
                "__init__",
                [](ClosedLoop* self, std::shared_ptr<const Map> map, Policy policy, int worlds, int vehicles,
                   int max_cycles, const std::string& autoreset, int threads, const std::optional<std::string>& isa,
                   const std::string& bodies) {
                    new (self) ClosedLoop(std::move(map), std::move(policy), worlds, vehicles, max_cycles,
                                          bodies_named(bodies), autoreset_named(autoreset), threads,
                                          isa ? kernel_named(*isa) : kernel_for_worlds(worlds));
                },
                "map"_a, "policy"_a, "worlds"_a, "vehicles"_a, "max_cycles"_a, "autoreset"_a, "threads"_a,
                "isa"_a = nb::none(), "bodies"_a = "circles")
            .def_prop_ro("is_plain", &ClosedLoop::is_plain,
                         "Whether no two routes of the map have more to do with each other than a lane before a split, "
                         "or one conflict and the lane after it: steps are faster then.")
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
            .def("state", &state_of<ClosedLoop>, "Everything, as arrays (world, vehicle), (world,) and (world, 8).")
            .def("set_state", &restore<ClosedLoop>, "state"_a);
    bind_buffers(closed_loop);
}

void bind_replay(nb::module_& m) {
    auto replay =
        nb::class_<Replay>(m, "Replay", "Replay worlds; the arrays are views of what the next step overwrites.");
    replay
        .def(
            "__init__",
            [](Replay* self, std::shared_ptr<const Map> map, Policy policy, bool recording, const Arrays& scenes,
               const Vector<std::int32_t>& actors, int worlds, const std::string& autoreset, int threads,
               const std::optional<std::string>& isa, const std::string& bodies) {
                const RecordedScenes recorded = scenes_of(scenes);
                std::vector<std::int32_t> may_act = copy(actors);
                const nb::gil_scoped_release release;
                new (self) Replay(std::move(map), std::move(policy), recording, recorded, std::move(may_act), worlds,
                                  bodies_named(bodies), autoreset_named(autoreset), threads,
                                  isa ? kernel_named(*isa) : kernel_for_worlds(worlds));
            },
            "map"_a, "policy"_a, "recording"_a, "scenes"_a, "actors"_a.noconvert(), "worlds"_a, "autoreset"_a,
            "threads"_a, "isa"_a = nb::none(), "bodies"_a = "circles")
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
        .def("state", &state_of<Replay>, "Everything, as arrays (world,) and (world, 8).")
        .def("set_state", &restore<Replay>, "state"_a);
    bind_buffers(replay);
}

} // namespace

void bind_worlds(nb::module_& m) {
    bind_closed_loop(m);
    bind_replay(m);
}

} // namespace intersection_env::python
