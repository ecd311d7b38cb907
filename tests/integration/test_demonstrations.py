"""Datasets of driven episodes in Minari's format: what is in them, that it comes again, what is refused."""

from __future__ import annotations

from pathlib import Path

import gymnasium
import numpy as np
import pytest

from dubins_traffic.controllers.registry import load
from dubins_traffic.envs.demonstrations import write_minari
from dubins_traffic.errors import InputError
from dubins_traffic.problem.draw import draw
from dubins_traffic.runs.single import run_trial
from tests.minute import a_minute

pytestmark = pytest.mark.path

minari = pytest.importorskip("minari")
NAME = "dubins-traffic/junction/rules-v0"


@pytest.fixture
def dataset(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    config = {**a_minute("junction").to_document(), "duration": 20.0}
    write_minari(NAME, config, "rules", episodes=2, seed=5, frame_skip=3)


@pytest.mark.usefixtures("dataset")
def test_a_dataset_is_found_by_its_name_and_its_episodes_come_again_from_its_actions() -> None:
    found = minari.load_dataset(NAME)
    assert (found.total_episodes, found.total_steps) == (2, 400)
    assert found.storage.metadata["algorithm_name"] == "rules"
    env = found.recover_environment()
    assert isinstance(env.action_space, gymnasium.spaces.Box)
    for episode in found.iterate_episodes():
        seen, _ = env.reset(seed=5, options={"episode": int(episode.id)})
        assert np.array_equal(episode.observations[0], seen)
        for k, action in enumerate(episode.actions):
            seen, reward, terminated, truncated, info = env.step(action)
            assert np.array_equal(episode.observations[k + 1], seen)
            assert episode.rewards[k] == reward
            assert episode.infos["cost"][k + 1] == info["cost"]
            assert (episode.terminations[k], episode.truncations[k]) == (terminated, truncated)
        assert truncated


def test_what_is_kept_is_nearly_the_trial_that_the_driver_drives_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Actions are float32, so the driver's commands are rounded."""
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    config = a_minute("junction")
    found = write_minari("lanes-v0", config, "lanes", episodes=1, seed=5, reward="score")
    (episode,) = found.iterate_episodes()
    alone = run_trial(draw(config, 5, 0), load("lanes")).score
    assert episode.rewards.sum() == pytest.approx(alone.rounds_before_breach)
    assert len(episode.actions) == round(alone.duration_s * 30)


@pytest.mark.parametrize("name", ["dubins traffic!", NAME])
@pytest.mark.usefixtures("dataset")
def test_a_name_that_is_taken_or_none_is_refused(name: str) -> None:
    with pytest.raises(InputError, match="no dataset"):
        write_minari(name, {**a_minute("junction").to_document(), "duration": 1.0}, "lanes", episodes=1)
