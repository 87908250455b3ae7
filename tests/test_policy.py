"""Policy files: exact round trip, and each kind of damage refused by name."""

from __future__ import annotations

import zlib
from pathlib import Path

import numpy as np
import pytest

from intersection_env import Predictor
from intersection_env.policy import PolicyFile
from tests.test_core import weights
from tests.twins import random_case, random_networks


def policy() -> PolicyFile:
    gap, driving = random_networks(np.random.default_rng(0))
    return PolicyFile("network", "network", weights(gap), weights(driving))


def test_predictor_loads_a_policy_file_and_writes_nothing_else(tmp_path: Path) -> None:
    policy().save(tmp_path / "random.policy")
    assert [path.name for path in tmp_path.iterdir()] == ["random.policy"]
    predictor = Predictor.load(tmp_path / "random.policy")
    traffic, _ = random_case("bendplatz", 1)
    assert predictor.name == "random"
    assert np.isfinite(predictor.predict(traffic).position).all()


def test_floats_keep_every_bit() -> None:
    driving = policy().driving_network
    assert driving is not None
    lines = policy().text().splitlines()
    first_row = lines.index("layer 16 16", lines.index("inputs 12")) + 2
    written = [[np.float32(token) for token in line.split()] for line in lines[first_row : first_row + 16]]
    np.testing.assert_array_equal(np.array(written), driving.layers[1][0])


def rewritten(old: str, new: str) -> str:
    text = policy().text()
    assert old in text
    body = text[: text.rindex("checksum ")].replace(old, new, 1)
    return f"{body}checksum {zlib.crc32(body.encode()):08x}\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is not a file of the kind"),
        (policy().text()[:200], "is cut short"),
        (policy().text().replace("dt 0.2", "dt 0.3"), "does not match its checksum"),
        (rewritten("dt 0.2", "dt 0.1"), "dt is 0.1.* s, the core steps by 0.2"),
        (rewritten("acceleration_scale 6", "acceleration_scale -6"), "acceleration_scale must be positive"),
        (rewritten("gap network", "gap courage"), 'gap must be "critical_gap", "sumo" or "network", not "courage"'),
        (rewritten("driver network", "driver me"), 'driver must be "idm"'),
        (rewritten("inputs 4", "inputs 5"), "must have 4 inputs"),
        (
            rewritten("yielder_speed_mps", "yielder_speed_kmh"),
            '"yielder_speed_mps" was expected, not "yielder_speed_kmh"',
        ),
        (rewritten("layer 16 16", "layer 16 17"), "16 outputs and 16 inputs was expected"),
        (rewritten("bias ", "bias inf "), "16 numbers were expected, not 17"),
        (rewritten("policy 1", "policy 3"), 'version "3"'),
    ],
)
def test_damaged_policy_file_is_refused_by_name_of_what_is_wrong(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "damaged.policy"
    path.write_text(text)
    with pytest.raises(ValueError, match=message) as refused:
        Predictor.load(path)
    assert str(path) in str(refused.value)


def test_unknown_policy_names_what_there_is() -> None:
    with pytest.raises(ValueError, match='no policy "hero": the names are idm, constant_velocity'):
        Predictor.load("hero")
    with pytest.raises(FileNotFoundError):
        Predictor.load("missing.policy")
    with pytest.raises(ValueError, match='gap must be "critical_gap"'):
        Predictor.load("idm", gap="courage")
