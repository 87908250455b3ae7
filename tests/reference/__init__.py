"""The twin: the model in NumPy, slow, obvious, in float64, written from docs/model.md alone.

The slow copy of what the core knows, and its judge. It imports nothing of the package. Arrays follow the axis
order (time, vehicle, feature); metres, seconds, radians. Each file is a section of the page:

- the map: `intersection`
- the model: `traffic` (distances), `lead`, `pairs`, `memory`, `observe`, `decide` (gap decision, decision, hold),
  `networks`, `drive` (IDM, network, constant velocity, advance), `predict`, `outputs`
- the worlds: `reward`, `collisions`, `closed_loop` (one step, ends), `starts`, `recorded`, `replay`
- crossing orders: `orders`; how probable each is, and what drivers do within one: `order_probabilities`,
  `position_quantiles`

`predictor` and `worlds` gather what tests ask of it.
"""
