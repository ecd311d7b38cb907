"""What may drive in a box, by what a user names, and what its box sees; nothing of it is loaded here."""

from __future__ import annotations

import importlib.util
import os
import sys
import tomllib
from functools import cache
from pathlib import Path
from typing import Final, cast

import numpy

from dubins_traffic import outside
from dubins_traffic.controllers import registry
from dubins_traffic.errors import InputError
from dubins_traffic.files import is_file
from dubins_traffic.kernels import folders
from dubins_traffic.learning import onnx_policy
from dubins_traffic.sandbox import images
from dubins_traffic.sandbox.launch import Program, Shown

PROGRAM: Final = "program:"
"""How the name of a program begins that speaks lines itself."""
MANIFEST: Final = "controller.toml"
"""The file in a folder that says what drives: ``python = "file.py:Class"`` or ``program = ["./drive"]``."""
PLACE: Final = "/submission"
OWN: Final = "/own"
"""Where a box sees this package."""
PACKAGES: Final = "/packages"
"""Where a box sees the packages of this interpreter."""
PYTHON: Final = "/python"
"""Where a box sees an interpreter that is not the system's."""
SHIM: Final = "sandbox/shim.py"
EXPECTED: Final = "a controller, program:PATH, or a folder with controller.toml"
BOXED_POLICY: Final = f"{onnx_policy.__name__}:{onnx_policy.Boxed.__name__}"
"""Who drives there by a policy in ONNX."""
KERNELS: Final = "/kernels"
"""Where a box sees the compiled kernels of this machine."""
ONE_THREAD: Final = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


def program_of(spec: str) -> Program:
    """Return what runs in the box of a controller.

    Parameters
    ----------
    spec : str
        A built-in name, ``module:Class``, ``path/to/file.py:Class``, ``program:PATH``, or a folder with a manifest. Of
        a file the box sees that file alone, of a folder all of it, at ``/submission``.

    Raises
    ------
    InputError
        If there is no such file, folder or name.
    """
    if spec.startswith(PROGRAM):
        return _alone(spec)
    if Path(spec).expanduser().is_dir():
        return _folder(Path(spec).expanduser().resolve())
    place, _, name = spec.rpartition(":")
    if place.endswith(".py"):
        path = _file(place, spec)
        return _python(f"{PLACE}/{path.name}:{name}", Shown(str(path), f"{PLACE}/{path.name}", own=True))
    if spec.endswith((".mcap", ".npz")):
        path = _file(spec, spec)
        return _python(f"{PLACE}/{path.name}", Shown(str(path), f"{PLACE}/{path.name}", own=True))
    if spec.endswith(onnx_policy.SUFFIX):
        path = _file(spec, spec)
        onnx_policy.check_file(path)
        return _python(BOXED_POLICY, Shown(str(path), onnx_policy.BOXED, own=True))
    if outside.is_place(spec):
        return _module(spec)
    if spec not in registry.names():
        expected = f"{EXPECTED}; built in: {', '.join(sorted(registry.names()))}"
        raise InputError("can't drive in a box", file="--controller", value=spec, expected=expected)
    return _python(spec)


def _alone(spec: str) -> Program:
    path = _file(spec.removeprefix(PROGRAM), spec)
    if not os.access(path, os.X_OK):
        raise InputError("can't be executed", file="--controller", value=spec, expected="an executable file")
    place = f"{PLACE}/{path.name}"
    return Program((place,), (Shown(str(path), place, own=True),), ONE_THREAD)


def _folder(folder: Path) -> Program:
    """Return the program of a folder, as its manifest says."""
    manifest = folder / MANIFEST
    try:
        document = tomllib.loads(manifest.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"can't be read: {error}", file=str(manifest), expected="a manifest in TOML") from error
    shown = Shown(str(folder), PLACE, own=True)
    match document:
        case {"python": str(spec)} if len(document) == 1 and outside.is_place(spec):
            place, _, name = spec.rpartition(":")
            inside = f"{PLACE}/{place}:{name}" if place.endswith(".py") else spec
            return _python(inside, shown, paths=(PLACE,))
        case {"program": [str(first), *rest]} if len(document) == 1 and all(isinstance(word, str) for word in rest):
            inside = f"{PLACE}/{first.removeprefix('./')}" if "/" in first else first
            return Program((inside, *map(str, rest)), (shown,), ONE_THREAD)
        case {"image": str(name), **rest} if set(rest) <= {"program"}:
            return _image(folder / name, rest.get("program"))
        case _:
            expected = 'python = "file.py:Class", program = ["./drive", ...] or image = "image.tar"'
            raise InputError("not a manifest", file=str(manifest), value=document, expected=expected)


def _image(archive: Path, program: object) -> Program:
    """Return the program of a container image: its own, or the one that the manifest names."""
    if not is_file(archive) or not archive.resolve().is_relative_to(archive.parent.resolve()):
        raise InputError(
            "no such file", file=MANIFEST, field="image", value=archive.name, expected="an archive beside it"
        )
    image = images.unpacked(archive)
    words = [str(word) for word in cast("list[object]", program)] if isinstance(program, list) else image.command
    if not words:
        raise InputError("the image runs nothing", file=MANIFEST, field="program", expected='program = ["/drive"]')
    root = Shown(image.root, "/")
    environment = {**image.environment, **ONE_THREAD}
    return Program(tuple(words), (root,), environment, image=True, folder=image.folder)


def _module(spec: str) -> Program:
    """Return the program of a class in a module: of an installed one, or of one in the current folder."""
    top = spec.partition(":")[0].partition(".")[0]
    here = next((path for path in (Path.cwd() / f"{top}.py", Path.cwd() / top) if path.exists()), None)
    if importlib.util.find_spec(top) is None and here is None:
        raise InputError(
            f"no module {top}", file="--controller", value=spec, expected="module:Class that can be imported"
        )
    if here is None:
        return _python(spec)
    return _python(spec, Shown(str(here), f"{PLACE}/{here.name}", own=True), paths=(PLACE,))


def _file(name: str, spec: str) -> Path:
    path = Path(name).expanduser()
    if not is_file(path):
        raise InputError(f"no such file: {name}", file="--controller", value=spec, expected=EXPECTED)
    return path.resolve()


def script(inside: str, *words: str) -> Program:
    """Return the program that runs one of this package's files in a box, alone."""
    python, seen, _ = interpreter()
    library = {"LD_LIBRARY_PATH": f"{PYTHON}/lib"} if python.startswith(PYTHON) else {}
    place = f"{OWN}/dubins_traffic/{inside}"
    return Program((python, "-I", "-S", "-B", place, *words), seen, library)


def _python(spec: str, *shown: Shown, paths: tuple[str, ...] = ()) -> Program:
    """Return the program that drives with a controller in Python, by our shim."""
    _, _, search_path = interpreter()
    words = [word for path in (*search_path, *paths) for word in ("--path", path)]
    base = script(SHIM, *words, spec)
    kernels = folders.base_folder()
    environment = {**base.environment, **ONE_THREAD, folders.FOLDER: KERNELS, folders.TIER: folders.KEPT}
    held = (Shown(str(kernels), KERNELS),) if kernels.is_dir() else ()
    seen = (*base.shown, *held, *shown)
    return Program(base.command, seen, environment, shim=True)


@cache
def interpreter() -> tuple[str, tuple[Shown, ...], tuple[str, ...]]:
    """Return this interpreter as a box sees it, what it needs to see for it, and where its packages are."""
    package = Path(__file__).resolve().parents[1]
    shown = [Shown(str(package), f"{OWN}/dubins_traffic")]
    paths = [OWN]
    for number, folder in enumerate(_packages()):
        if folder.is_relative_to("/usr"):
            paths.append(str(folder))
            continue
        shown.append(Shown(str(folder), f"{PACKAGES}/{number}"))
        paths.append(f"{PACKAGES}/{number}")
    base = Path(sys.base_prefix).resolve()
    name = f"python{sys.version_info[0]}.{sys.version_info[1]}"
    if base.is_relative_to("/usr"):
        return str(base / "bin" / name), tuple(shown), tuple(paths)
    return f"{PYTHON}/bin/{name}", (Shown(str(base), PYTHON), *shown), tuple(paths)


def _packages() -> list[Path]:
    """Return the folders with packages that this interpreter looks in, that of numpy among them."""
    numpys = Path(numpy.__file__).resolve().parents[1]
    places = [Path(place).resolve() for place in sys.path if place.endswith(("site-packages", "dist-packages"))]
    return list(dict.fromkeys([numpys, *(place for place in places if place.is_dir())]))
