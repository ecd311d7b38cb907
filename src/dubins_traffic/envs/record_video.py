"""Videos of episodes: Gymnasium's own wrapper needs moviepy, which asks for an older Pillow than ours."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, SupportsFloat

import gymnasium
import numpy as np

from dubins_traffic.animation.animate import Video
from dubins_traffic.errors import InputError

SUFFIX: Final = ".mp4"
DRAFT: Final = ".part"
"""What the name of a video ends in while its episode goes on."""


class RecordVideo(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Writes a video of each episode that it is told to, one picture a step.

    Parameters
    ----------
    env : gymnasium.Env
        An environment with ``render_mode="rgb_array"``.
    folder : path
        Where the videos go, ``PREFIX-episode-K.mp4``; it is made. A video appears when its episode is over.
    episode_trigger : callable, optional
        Tells of an episode, by its number from 0 on, whether it is recorded; by default all are.
    name_prefix : str
        How the names of the videos begin.

    Raises
    ------
    InputError
        If the environment does not render arrays.
    MissingExtraError
        If PyAV is not installed (extra ``video``).
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        folder: str | os.PathLike[str],
        *,
        episode_trigger: Callable[[int], bool] | None = None,
        name_prefix: str = "rl-video",
    ) -> None:
        super().__init__(env)
        if env.render_mode != "rgb_array":
            raise InputError("nothing to record", field="render_mode", value=env.render_mode, expected="rgb_array")
        self._folder = Path(folder)
        self._folder.mkdir(parents=True, exist_ok=True)
        self._wanted = episode_trigger
        self._prefix = name_prefix
        self._episode = -1
        self._video: Video | None = None

    def reset(self, **given: Any) -> tuple[Any, dict[str, Any]]:
        """Begin an episode, and its video."""
        self._finish()
        begun = self.env.reset(**given)
        self._episode += 1
        if self._wanted is None or self._wanted(self._episode):
            image = self._painted()
            fps = float(self.env.metadata.get("render_fps", 30.0))
            self._video = Video(self._draft, SUFFIX, fps, (image.shape[1], image.shape[0]))
            self._video.add(image)
        return begun

    def step(self, action: Any) -> tuple[Any, SupportsFloat, bool, bool, dict[str, Any]]:
        """Make a step, and paint it."""
        stepped = self.env.step(action)
        if self._video is not None:
            self._video.add(self._painted())
            if stepped[2] or stepped[3]:
                self._finish()
        return stepped

    def close(self) -> None:
        """Finish the video of the episode under way, and close the environment."""
        self._finish()
        super().close()

    @property
    def _draft(self) -> Path:
        return self._folder / f"{self._prefix}-episode-{self._episode}{SUFFIX}{DRAFT}"

    def _painted(self) -> Any:
        return np.asarray(self.env.render())

    def _finish(self) -> None:
        if self._video is not None:
            self._video.close()
            self._video = None
            self._draft.replace(self._draft.with_suffix(""))
