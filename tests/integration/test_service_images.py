"""Container images handed in to a service: one that drives is judged, one that is none is rejected with the reason."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import pytest

from tests import images
from tests.boxes import needs_boxes
from tests.seasons import SETTINGS, TRIALS
from tests.services import season

pytestmark = pytest.mark.tools("boxes")


@needs_boxes
def test_an_image_is_judged_and_what_is_none_is_rejected(tmp_path: Path) -> None:
    images.require()
    source = images.layer(tmp_path, files={"drive": images.program(tmp_path).read_bytes()})
    image = images.image(tmp_path, source, 'CMD ["/drive"]').read_bytes()
    with season(tmp_path, "--workers", "1", settings=SETTINGS, trials=TRIALS) as service:
        organiser = service.organiser()
        person = service.person().join(organiser.invite(), "Ann", "Ants")
        good = person.submit("short/practice", packed(image), "image.zip")
        bad = person.submit("short/practice", packed(b"no image"), "image.zip")
        person.ended(good)
        person.ended(bad, "rejected")
        assert "<canvas" in person.get(f"/s/{good}/trials/0/replay").text
        assert "no image" in person.get(f"/s/{bad}").text


def packed(image: bytes) -> bytes:
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("image.tar", image)
        archive.writestr("controller.toml", 'image = "image.tar"\n')
    return made.getvalue()
