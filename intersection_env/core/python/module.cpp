// The core as a Python module. Arrays are float32, int32 or int8, C-contiguous, never converted.
#include <string>
#include <tuple>
#include <vector>

#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "cores.hpp"
#include "intersection_env/format_error.hpp"
#include "intersection_env/locate.hpp"
#include "intersection_env/maneuvers.hpp"
#include "intersection_env/orders.hpp"
#include "intersection_env/policy.hpp"
#include "intersection_env/traffic.hpp"
#include "kernel/dispatch.hpp"
#include "python/bind.hpp"
#include "tables/problem.hpp"
#include "threads.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace intersection_env;

NB_MODULE(_core, m) {
    m.doc() = "The C++ core: maps, conflicts, crossing orders, prediction.";
    nb::exception<FormatError>(m, "FormatError", PyExc_ValueError);
    m.attr("DT") = DT;
    m.attr("STEPS") = STEPS;
    m.attr("MAX_VEHICLES") = MAX_VEHICLES;
    m.attr("MOST_THREADS") = MOST_THREADS;
    m.attr("BRAKING") = BRAKING;
    m.attr("DRIVES") = DRIVES;
    m.attr("STOPPED") = STOPPED;
    m.attr("AT_LINE") = AT_LINE;
    m.attr("LEAST_SIZE") = LEAST_SIZE;
    m.attr("MOST_LENGTH") = MOST_LENGTH;
    m.attr("MOST_WIDTH") = MOST_WIDTH;
    m.attr("MOST_SPEED") = MOST_SPEED;
    m.attr("ASIDE") = ASIDE;
    m.attr("TURNED") = TURNED;
    m.attr("PLAIN_LANE") = PLAIN_LANE;
    m.attr("WORTHWHILE_GAIN") = WORTHWHILE_GAIN;
    m.attr("MOST_MANEUVERS") = MOST_MANEUVERS;
    m.attr("MOST_COUNTED") = MOST_COUNTED;
    m.attr("SPREAD_LEVELS") = Spread::LEVELS;
    m.attr("SPREAD_SECONDS") = Spread::SECONDS;
    m.def("available_kernels", &available_kernels, "The instruction sets of this machine's kernels, best last.");
    m.def(
        "gap_features", [] { return std::vector<std::string>(GAP_FEATURES.begin(), GAP_FEATURES.end()); },
        "The gap network's inputs, by name and unit.");
    m.def(
        "driving_features", [] { return std::vector<std::string>(DRIVING_FEATURES.begin(), DRIVING_FEATURES.end()); },
        "The driving network's inputs, by name and unit.");
    m.def(
        "order_features", [] { return std::vector<std::string>(ORDER_FEATURES.begin(), ORDER_FEATURES.end()); },
        "The order network's inputs, by name and unit.");
    m.def(
        "spread_ways", [] { return std::vector<float>(Spread::WAYS.begin(), Spread::WAYS.end()); },
        "The ways at which a spread has a scale [m].");
    m.def(
        "multiply_adds",
        [](const std::string& isa, long rounds) {
            const Kernel& one = kernel_named(isa);
            const nb::gil_scoped_release release;
            return std::make_tuple(12 * one.lanes * rounds, one.multiply_add(rounds));
        },
        "isa"_a, "rounds"_a,
        "Does float32 multiply-adds as fast as this kernel can; how many, and a number they end in.");
    m.def(
        "tanhs",
        [](const std::string& isa, long rounds) {
            const Kernel& one = kernel_named(isa);
            const nb::gil_scoped_release release;
            return std::make_tuple(16 * one.lanes * rounds, one.hyperbolic_tangent(rounds));
        },
        "isa"_a, "rounds"_a, "Likewise tanh.");
    m.def("usable_cores", &usable_cores, "groups"_a = "/sys/fs/cgroup", "How many cores this process may use.");
    m.def("orders_in_a_cycle", &orders_in_a_cycle, "vehicles"_a, "How many orders a planner's cycle has time for.");
    m.def("kernel_name", [] { return kernel().name; }, "The kernel in use.");

    python::bind_model(m);
    python::bind_orders(m);
    python::bind_prediction(m);
    python::bind_rankings(m);
    python::bind_worlds(m);
}
