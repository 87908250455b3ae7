"""Policy files: exact round trip, and each kind of damage refused by name."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from intersection_env import Predictor, _core
from intersection_env.policies.file import PolicyFile
from intersection_env.policies.named import POLICIES, policy_named
from tests.reference import predictor as reference
from tests.support.core_and_twin import weights
from tests.support.damage import damages, with_checksum
from tests.support.forecasts import forecasting
from tests.support.twins import CASES, random_case, random_networks

PLAIN = """intersection_env policy 1
about {"made_by": "a test"}
dt 0.2
acceleration_scale 6
gap sumo
driver idm
idm 1.5 1 2.5 4 8 1 1000
"""
"""A file of version 1, as it was before there were forecasts; the checksum is to follow."""


WITH_FORECASTS = pytest.mark.parametrize("forecasts", [False, True], ids=["plain", "forecasts"])


def policy() -> PolicyFile:
    gap, driving = random_networks(np.random.default_rng(0))
    return PolicyFile("network", "network", weights(gap), weights(driving))


def with_forecasts() -> PolicyFile:
    return forecasting(np.random.default_rng(0), policy())[0]


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


def test_policy_file_round_trip_is_exact(tmp_path: Path) -> None:
    gap, driving = random_networks(np.random.default_rng(1))
    written = PolicyFile(
        "network", "network", weights(gap), weights(driving), 5.5, about={"made_by": "a test", "score": 0.1}
    )
    written.save(tmp_path / "a.policy")
    read = PolicyFile.read(tmp_path / "a.policy")
    assert read.text() == written.text()
    assert read.about == written.about
    assert read.gap_network is not None
    np.testing.assert_array_equal(read.gap_network.shift, weights(gap).shift)
    PolicyFile("sumo", "idm").save(tmp_path / "b.policy")
    assert PolicyFile.read(tmp_path / "b.policy").text() == PolicyFile("sumo", "idm").text()


def test_file_of_version_2_keeps_order_network_and_spread_to_the_bit(tmp_path: Path) -> None:
    written = with_forecasts()
    written.save(tmp_path / "a.policy")
    read = PolicyFile.read(tmp_path / "a.policy")
    assert read.text() == written.text()
    assert read.text().startswith("intersection_env policy 2\n")
    assert read.order_network is not None
    assert read.spread is not None
    assert written.order_network is not None
    assert written.spread is not None
    np.testing.assert_array_equal(read.spread.scale, written.spread.scale)
    np.testing.assert_array_equal(read.spread.shape, written.spread.shape)
    np.testing.assert_array_equal(read.order_network.scale, written.order_network.scale)
    for (weight, bias), (again, bias_again) in zip(
        written.order_network.layers, read.order_network.layers, strict=True
    ):
        np.testing.assert_array_equal(again, weight)
        np.testing.assert_array_equal(bias_again, bias)
    assert _core.Policy(read.text(), "a").can_forecast


def test_file_of_version_1_is_read_and_written_as_ever() -> None:
    read = PolicyFile.parse(with_checksum(PLAIN), "plain")
    assert (read.gap, read.driver, read.about) == ("sumo", "idm", {"made_by": "a test"})
    assert read.order_network is None
    assert read.spread is None
    assert read.text() == with_checksum(PLAIN)
    assert not _core.Policy(read.text(), "plain").can_forecast


@pytest.mark.parametrize("path", sorted(POLICIES.glob("*.policy")), ids=lambda path: path.stem)
def test_shipped_policy_is_written_as_it_was_read_and_is_one_of_version_1_without_its_forecasts(path: Path) -> None:
    policy, _ = policy_named(path.stem)
    assert policy.text() == path.read_text()
    plain = replace(policy, order_network=None, spread=None).text().splitlines()
    assert plain[0] == "intersection_env policy 1"
    assert plain[1:-1] == policy.text().splitlines()[1 : len(plain) - 1]


def test_core_evaluates_the_networks_as_the_twin_does() -> None:
    gap, driving = random_networks(np.random.default_rng(2))
    core = _core.Policy(PolicyFile("network", "network", weights(gap), weights(driving)).text(), "test")
    features = np.random.default_rng(3).normal(0, 5, (33, 4)).astype(np.float32)
    truth = [reference.evaluate(gap, row.astype(np.float64), "leaky_relu") for row in features]
    np.testing.assert_allclose(core.evaluate_gap(features), truth, atol=1e-5)
    features = np.random.default_rng(4).normal(0, 5, (33, 12)).astype(np.float32)
    truth = [reference.evaluate(driving, row.astype(np.float64), "tanh") for row in features]
    np.testing.assert_allclose(core.evaluate_driving(features), truth, atol=1e-5)
    with pytest.raises(ValueError, match=r"features \(row, 4\) are wanted"):
        core.evaluate_gap(features)


def rewritten(old: str, new: str, text: str = "") -> str:
    text = text or policy().text()
    assert old in text
    body = text[: text.rindex("checksum ")].replace(old, new, 1)
    return with_checksum(body)


def in_forecasts(old: str, new: str) -> str:
    return rewritten(old, new, with_forecasts().text())


def with_shape(levels: str) -> str:
    """Its first quantiles are these."""
    text = with_forecasts().text()
    (old,) = [line for line in text.splitlines() if line.startswith("spread_shape ")][:1]
    return rewritten(old, f"spread_shape {levels}", text)


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
        (rewritten("policy 1", "policy 3"), 'is of version "3", this package reads version 1 to 2'),
        (rewritten("policy 1", "policy 2"), 'the file ends where "inputs" was expected'),
        (in_forecasts("policy 2", "policy 1"), "nothing was expected here but the checksum"),
        (in_forecasts("inputs 21", "inputs 20"), "must have 21 inputs"),
        (in_forecasts("\nmerging ", "\ncrossing "), '"merging" was expected, not "crossing"'),
        (in_forecasts("layer 32 21", "layer 32 12"), "32 outputs and 21 inputs was expected"),
        (in_forecasts("spread_scale ", "spread_scale -"), "the scale of a spread must not be negative"),
        (in_forecasts("spread_scale ", "spread_scale 1 "), "5 numbers were expected, not 6"),
        (in_forecasts("spread_scale ", "spread_width "), '"spread_scale" was expected, not "spread_width"'),
        (in_forecasts("spread_scale ", "spread_scale 1e6"), "a finite number was expected|must be below 1000000"),
        (in_forecasts("spread_scale ", "spread_scale nan"), "a finite number was expected"),
        (with_shape("0 " * 17 + "0"), "19 numbers were expected, not 18"),
        (with_shape("0 " * 17 + "1 0"), "the quantiles of a spread must not fall"),
        (with_shape("-1e6" + " 0" * 18), "the scale and the quantiles of a spread must be below 1000000"),
        (rewritten("yielder_speed_mps ", "yielder_speed_mps 3e38 "), "2 numbers were expected, not 3"),
        (rewritten("layer 1 16\nbias ", "layer 1 16\nbias 3e38"), "a weight must be below|a finite number"),
    ],
)
def test_damaged_policy_file_is_refused_by_name_of_what_is_wrong(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "damaged.policy"
    path.write_text(text)
    with pytest.raises(ValueError, match=message) as refused:
        Predictor.load(path)
    assert str(path) in str(refused.value)


def test_unknown_policy_names_what_there_is() -> None:
    names = "gail, gap, idm_calibrated, ppo, rollout_gradient, idm, constant_velocity"
    with pytest.raises(ValueError, match=f'no policy "hero": the names are {names}'):
        Predictor.load("hero")
    with pytest.raises(FileNotFoundError):
        Predictor.load("missing.policy")
    with pytest.raises(ValueError, match='gap is "courage"; the rules are critical_gap, sumo'):
        Predictor.load("idm", gap="courage")
    with pytest.raises(TypeError, match="gap is 3; wanted critical_gap or sumo"):
        Predictor.load("idm", gap=3)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match='"idm" has no gap network'):
        Predictor.load("idm", gap="network")
    with pytest.raises(ValueError, match='the policy "gap" brings its own'):
        Predictor.load("gap", gap="sumo")


def test_policy_file_that_is_no_text_is_named(tmp_path: Path) -> None:
    path = tmp_path / "binary.policy"
    path.write_bytes(b"\x80\x81\x82")
    with pytest.raises(ValueError, match=r"binary\.policy: is not text"):
        Predictor.load(path)


@WITH_FORECASTS
def test_damage_anywhere_with_a_right_checksum_never_crashes(forecasts: bool) -> None:
    """Bytes changed, lines lost, doubled or cut, and the end cut off: refused in words, or a policy that predicts."""
    traffic, _ = random_case("bendplatz", 20_003)
    body = (with_forecasts() if forecasts else policy()).text().rpartition("checksum ")[0]
    refused = 0
    for damaged in damages(body, 1500 * CASES, np.random.default_rng(1)):
        try:
            core = _core.Policy(with_checksum(damaged), "fuzzed.policy")
        except ValueError as error:
            assert str(error).startswith("fuzzed.policy")  # noqa: PT017, what is let in counts too
            refused += 1
            continue
        no_intervention = np.zeros((1, len(traffic.conflicts)), np.int8)
        predictor = _core.Predictor(traffic.intersection.core, core)
        predicted = predictor.predict(traffic.core, no_intervention, True, True)
        assert np.isfinite(predicted[0]).all()
        if forecasts:
            found = _core.order_probabilities(predictor, traffic.core, no_intervention[0], 0.95, 64, 10_000)
            assert np.isfinite(found[1]).all()
            assert np.isfinite(_core.position_quantiles(core, np.ones(1), predicted[0], np.array([0.0, 1.0]))).all()
    assert 500 * CASES < refused < 1450 * CASES


@WITH_FORECASTS
def test_every_cut_of_a_policy_is_refused(forecasts: bool) -> None:
    text = (with_forecasts() if forecasts else policy()).text()
    for end in range(0, len(text) - 1, 7):
        with pytest.raises(ValueError, match=r"cut short|not a file|checksum|version"):
            _core.Policy(text[:end], "cut.policy")
    body = text.rpartition("checksum ")[0]
    for end in range(0, body.rindex("\n", 0, -1), 7):  # within the last number it would be another policy
        with pytest.raises(ValueError, match=r"cut\.policy"):
            _core.Policy(with_checksum(body[:end] + "\n"), "cut.policy")
