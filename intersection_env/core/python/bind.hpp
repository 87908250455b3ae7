// What the module consists of; the order of these calls is that of the stub.
#pragma once

#include <nanobind/nanobind.h>

namespace intersection_env::python {

void bind_model(nanobind::module_& m);      // maps and traffic
void bind_orders(nanobind::module_& m);     // crossing orders
void bind_prediction(nanobind::module_& m); // policies, the predictor
void bind_rankings(nanobind::module_& m);   // maneuvers, probabilities of orders
void bind_worlds(nanobind::module_& m);     // closed loop and replay

} // namespace intersection_env::python
