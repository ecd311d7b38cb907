"""Makes the Python code of the LCM messages from their definition: ``python -m scripts.lcm_messages [FOLDER]``.

Without a folder it stands in its place in the package. `setup.py` runs it when the package is built or installed, so it
needs nothing but Python: the code does what that of lcm-gen does, which a test compares. The same definition gives the
same bytes, and a file that is as it should be is not written again.

Of the language of LCM it knows what the definition uses: structs of numbers, booleans, strings and structs, and arrays
of them that a field counts, of numbers also with rows of a constant length.
"""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass
from pathlib import Path

ROOM = Path(__file__).resolve().parents[1] / "src" / "dubins_traffic" / "transports" / "lcm"
DEFINITION = ROOM / "dubins_traffic_lcm.lcm"
PACKAGE = "dubins_traffic.transports.lcm.dubins_traffic_lcm"
HEAD = '"""Made of dubins_traffic_lcm.lcm by scripts/lcm_messages.py; a change there is made here by `make setup`."""\n'
NUMBERS = {"int16_t": ("h", 2), "int32_t": ("i", 4), "int64_t": ("q", 8), "double": ("d", 8)}
CODES = {**{name: code for name, (code, _) in NUMBERS.items()}, "boolean": "b"}
START = {"boolean": "False", "string": '""', "double": "0.0"}
MASK = 2**64 - 1


@dataclass(frozen=True)
class Field:
    """A field of a message: its type and name, and the lengths of its array: of a field, or constant."""

    kind: str
    name: str
    sizes: tuple[str, ...]

    @property
    def is_plain(self) -> bool:
        """Whether it is one number or boolean, which are packed together with those beside it."""
        return not self.sizes and self.kind in CODES

    @property
    def is_struct(self) -> bool:
        """Whether it is a message, or consists of messages."""
        return self.kind not in CODES and self.kind != "string"

    @property
    def typename(self) -> str:
        """What the type is called in Python."""
        return f"{PACKAGE}.{self.kind}" if self.is_struct else self.kind


@dataclass(frozen=True)
class Message:
    """A struct of the definition."""

    name: str
    told: str
    constants: tuple[tuple[str, str], ...]
    fields: tuple[Field, ...]


def messages(definition: str) -> list[Message]:
    """Return the structs of a definition, in order."""
    found: list[Message] = []
    for comment, name, body in re.findall(r"((?://[^\n]*\n)*)struct (\w+)\s*\{(.*?)\n\}", definition, re.DOTALL):
        told = " ".join(line.removeprefix("//").strip() for line in comment.splitlines())
        statements = [part.strip() for part in re.sub(r"//[^\n]*", "", body).split(";") if part.strip()]
        constants: list[tuple[str, str]] = []
        fields: list[Field] = []
        for statement in statements:
            if statement.startswith("const "):
                constants += [(own, value) for own, value in re.findall(r"(\w+) = (-?\d+)", statement)]
                continue
            parts = re.fullmatch(r"(\w+)\s+(\w+)((?:\[\w+\])*)", statement)
            if parts is None:
                raise ValueError(f"{DEFINITION.name}: {name}: {statement!r}; expected a field or a constant")
            fields.append(Field(parts[1], parts[2], tuple(re.findall(r"\w+", parts[3]))))
        found.append(Message(name, told, tuple(constants), tuple(fields)))
    return found


def fingerprint(message: Message) -> int:
    """Return the hash of a message without those that it holds, as LCM computes it."""
    value = 0x12345678

    def add(number: int) -> None:
        nonlocal value
        signed = value - 2**64 if value >> 63 else value
        value = (((signed << 8) ^ (signed >> 55)) + number) & MASK

    def add_text(text: str) -> None:
        for number in (len(text), *text.encode("ascii")):
            add(number)

    for field in message.fields:
        add_text(field.name)
        if not field.is_struct:
            add_text(field.kind)
        add(len(field.sizes))
        for size in field.sizes:
            add(0 if size.isdigit() else 1)
            add_text(size)
    return value


def module(message: Message) -> str:
    """Return the module of a message."""
    name, fields = message.name, message.fields
    quoted = ", ".join(f'"{field.name}"' for field in fields)
    types = ", ".join(f'"{field.typename}"' for field in fields)
    held = [field for field in fields if field.is_struct]
    lines = [
        HEAD,
        "from io import BytesIO",
        "import struct",
        *(("", f"import {PACKAGE}") if held else ()),
        "",
        f"class {name}(object):",
        f'    """{message.told}"""',
        "",
        f"    __slots__ = [{quoted}]",
        "",
        f"    __typenames__ = [{types}]",
        "",
        f"    __dimensions__ = [{', '.join(map(_dimensions, fields))}]",
        "",
        *(f"    {own} = {value}" for own, value in message.constants),
        "",
        "    def __init__(self):",
        *(f"        self.{field.name} = {_start(field)}" for field in fields),
        "",
        "    def encode(self):",
        "        buf = BytesIO()",
        f"        buf.write({name}._get_packed_fingerprint())",
        "        self._encode_one(buf)",
        "        return buf.getvalue()",
        "",
        "    def _encode_one(self, buf):",
        *_encoded(fields),
        "",
        "    @staticmethod",
        "    def decode(data: bytes):",
        "        if hasattr(data, 'read'):",
        "            buf = data",
        "        else:",
        "            buf = BytesIO(data)",
        f"        if buf.read(8) != {name}._get_packed_fingerprint():",
        '            raise ValueError("Decode error")',
        f"        return {name}._decode_one(buf)",
        "",
        "    @staticmethod",
        "    def _decode_one(buf):",
        f"        self = {name}()",
        *_decoded(fields),
        "        return self",
        "",
        "    @staticmethod",
        "    def _get_hash_recursive(parents):",
        f"        if {name} in parents: return 0",
        *((f"        newparents = parents + [{name}]",) if held else ()),
        f"        tmphash = (0x{fingerprint(message):x}"
        + "".join(f" + {field.typename}._get_hash_recursive(newparents)" for field in held)
        + ") & 0xffffffffffffffff",
        "        tmphash = (((tmphash << 1) & 0xffffffffffffffff) + (tmphash >> 63)) & 0xffffffffffffffff",
        "        return tmphash",
        "    _packed_fingerprint = None",
        "",
        "    @staticmethod",
        "    def _get_packed_fingerprint():",
        f"        if {name}._packed_fingerprint is None:",
        f'            {name}._packed_fingerprint = struct.pack(">Q", {name}._get_hash_recursive([]))',
        f"        return {name}._packed_fingerprint",
        "",
        "    def get_hash(self):",
        '        """Get the LCM hash of the struct"""',
        f'        return struct.unpack(">Q", {name}._get_packed_fingerprint())[0]',
    ]
    return "\n".join([*lines, ""])


def _dimensions(field: Field) -> str:
    sizes = ", ".join(size if size.isdigit() else f'"{size}"' for size in field.sizes)
    return f"[{sizes}]" if sizes else "None"


def _start(field: Field) -> str:
    """Return what a field is in a new message."""
    if field.sizes:
        return "[]"
    return f"{field.typename}()" if field.is_struct else START.get(field.kind, "0")


def _runs(fields: tuple[Field, ...], kinds: set[str]) -> list[list[Field]]:
    """Return the fields in runs: numbers beside one another that are packed together, each other field alone."""
    runs: list[list[Field]] = []
    for field in fields:
        packed = field.is_plain and field.kind in kinds
        if packed and runs and runs[-1][-1].is_plain and runs[-1][-1].kind in kinds:
            runs[-1].append(field)
        else:
            runs.append([field])
    return runs


def _encoded(fields: tuple[Field, ...]) -> list[str]:
    lines: list[str] = []
    for run in _runs(fields, {*CODES}):
        field = run[0]
        if field.is_plain:
            codes = "".join(CODES[own.kind] for own in run)
            lines.append(f'buf.write(struct.pack(">{codes}", {", ".join(f"self.{own.name}" for own in run)}))')
        elif not field.sizes:
            lines += _one_encoded(field, f"self.{field.name}")
        elif field.kind in NUMBERS and len(field.sizes) == 1:
            count, code = f"self.{field.sizes[0]}", CODES[field.kind]
            lines.append(f"buf.write(struct.pack('>%d{code}' % {count}, *self.{field.name}[:{count}]))")
        else:
            lines.append(f"for i0 in range(self.{field.sizes[0]}):")
            lines += [f"    {line}" for line in _one_encoded(field, f"self.{field.name}[i0]")]
    return [f"        {line}" for line in lines]


def _one_encoded(field: Field, own: str) -> list[str]:
    """Return what writes a string, a message, or a row of numbers."""
    if field.is_struct:
        same = f"{own}._get_packed_fingerprint() == {field.typename}._get_packed_fingerprint()"
        return [f"assert {same}", f"{own}._encode_one(buf)"]
    if field.kind == "string":
        made = f"__{field.name}_encoded"
        return [
            f"{made} = {own}.encode('utf-8')",
            f"buf.write(struct.pack('>I', len({made})+1))",
            f"buf.write({made})",
            'buf.write(b"\\0")',
        ]
    width = field.sizes[1]
    return [f"buf.write(struct.pack('>{width}{CODES[field.kind]}', *{own}[:{width}]))"]


def _decoded(fields: tuple[Field, ...]) -> list[str]:
    lines: list[str] = []
    for run in _runs(fields, {*NUMBERS}):
        field = run[0]
        if field.kind == "boolean" and field.is_plain:
            lines.append(f"self.{field.name} = bool(struct.unpack('b', buf.read(1))[0])")
        elif field.is_plain:
            codes = "".join(CODES[own.kind] for own in run)
            size = sum(NUMBERS[own.kind][1] for own in run)
            names = ", ".join(f"self.{own.name}" for own in run)
            first = "" if len(run) > 1 else "[0]"
            lines.append(f'{names} = struct.unpack(">{codes}", buf.read({size})){first}')
        elif not field.sizes:
            before, value = _one_decoded(field)
            lines += [*before, f"self.{field.name} = {value}"]
        elif field.kind in NUMBERS and len(field.sizes) == 1:
            count, (code, size) = f"self.{field.sizes[0]}", NUMBERS[field.kind]
            lines.append(f"self.{field.name} = struct.unpack('>%d{code}' % {count}, buf.read({count} * {size}))")
        else:
            before, value = _one_decoded(field)
            lines += [f"self.{field.name} = []", f"for i0 in range(self.{field.sizes[0]}):"]
            lines += [f"    {line}" for line in (*before, f"self.{field.name}.append({value})")]
    return [f"        {line}" for line in lines]


def _one_decoded(field: Field) -> tuple[list[str], str]:
    """Return what reads a string, a message, or a row of numbers, and what is read then."""
    if field.is_struct:
        return [], f"{field.typename}._decode_one(buf)"
    if field.kind == "string":
        length = f"__{field.name}_len"
        before = [f"{length} = struct.unpack('>I', buf.read(4))[0]"]
        return before, f"buf.read({length})[:-1].decode('utf-8', 'replace')"
    code, size = NUMBERS[field.kind]
    width = int(field.sizes[1])
    return [], f"struct.unpack('>{width}{code}', buf.read({width * size}))"


def make(folder: Path = ROOM / "dubins_traffic_lcm") -> None:
    """Write the modules into a folder, and take out what is none of them."""
    found = messages(DEFINITION.read_text(encoding="utf-8"))
    files = {f"{own.name}.py": module(own) for own in found}
    files["__init__.py"] = HEAD + "\n" + "".join(f"from .{own.name} import {own.name} as {own.name}\n" for own in found)
    folder.mkdir(parents=True, exist_ok=True)
    for path in folder.glob("*.py"):
        if path.name not in files:
            path.unlink()
    for name, text in files.items():
        path = folder / name
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    make(*map(Path, sys.argv[1:2]))
