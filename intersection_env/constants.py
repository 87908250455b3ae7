"""Numbers that the whole package shares: step, horizon, what an action is worth, what stands for a missing lead."""

from __future__ import annotations

from intersection_env import _core

DT: float = round(_core.DT, 6)
"""Step of every prediction and of every world [s]; paper, Section IV-B."""
STEPS: int = _core.STEPS
"""Of a prediction: 10 s."""
ACCELERATION = 6.0
"""At an action of 1 [m/s²]; ours: every row of the reward can fire."""
LEAD_RANGE, FREE_LEAD_SPEED = 100.0, 100.0 / 3.6
"""Distance [m] and speed [m/s] of the lead where there is none; paper, Section III-B.2."""
BICYCLE_MAX_SPEED = 5.0
"""What a cyclist takes for v_max [m/s]; ours: a brisk cyclist on the level (18 km/h)."""
