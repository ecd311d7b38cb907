"""Makes the trial that moves on the first page of the service anew: `python -m scripts.moving_trial`."""

from __future__ import annotations

import gzip
import tempfile
from pathlib import Path

import dubins_traffic as dt
from dubins_traffic.service.pictures import map_of
from dubins_traffic.service.worker import replay_of

PLACE = Path("src/dubins_traffic/service/web/static/trial.svg")

if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        record = Path(folder) / "trial.mcap"
        dt.run_trial(dt.draw(dt.load_config("town"), 3), "rules", record=record)
        page = gzip.compress(replay_of(dt.load_record(record)).encode())
    PLACE.write_text(map_of(page, moves=True), encoding="utf-8")
