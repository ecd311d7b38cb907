"""The grammars of formats for which no reader can be installed: TLSF and slugs' structured form."""

from __future__ import annotations

import re


class Grammar:
    """Recognises fully parenthesised formulas: binary operators only between operands, one kind per level."""

    def __init__(self, text: str, operand: str, unary: str, binary: str) -> None:
        self.tokens = re.findall(rf"\s*({operand}|{unary}|{binary}|[()])", text)
        assert "".join(self.tokens).replace(" ", "") == re.sub(r"\s", "", text), text
        self.operand, self.unary, self.binary = operand, unary, binary
        self.place = 0

    def _at(self, pattern: str) -> bool:
        return self.place < len(self.tokens) and re.fullmatch(pattern, self.tokens[self.place]) is not None

    def formula(self) -> None:
        self.part()
        first = self.tokens[self.place] if self._at(self.binary) else ""
        count = 0
        while self._at(self.binary):
            assert self.tokens[self.place] == first, self.tokens
            self.place += 1
            count += 1
            self.part()
        assert count < 2 or first in ("&&", "||", "&", "|"), self.tokens

    def part(self) -> None:
        while self._at(self.unary):
            self.place += 1
        if self._at(r"\("):
            self.place += 1
            self.formula()
            assert self._at(r"\)"), self.tokens
            self.place += 1
        else:
            assert self._at(self.operand), (self.tokens, self.place)
            self.place += 1

    def accepts(self) -> bool:
        self.formula()
        return self.place == len(self.tokens)


TLSF = ("inputs", "outputs", "initially", "preset", "require", "assert", "assume", "guarantee")


def tlsf_sections(text: str) -> dict[str, list[str]]:
    """Return the items of a document in TLSF, which must keep its grammar, by section."""
    item = r"(?:    [^;{}]+;\n)*"
    own = "".join(rf"(?:  {name.upper()} \{{\n(?P<{name}>{item})  \}}\n)?" for name in TLSF)
    main = re.fullmatch(
        r"INFO \{\n  TITLE: \"[^\"]*\"\n  DESCRIPTION: \"[^\"]*\"\n  SEMANTICS: Mealy,Strict\n  TARGET: Mealy\n\}\n\n"
        rf"MAIN \{{\n{own}\}}\n",
        text,
    )
    assert main is not None
    sections = {
        name: [line.strip().removesuffix(";") for line in (body or "").splitlines()]
        for name, body in main.groupdict().items()
    }
    signals = sections["inputs"] + sections["outputs"]
    assert len(set(signals)) == len(signals)
    assert all(re.fullmatch(r"[a-z]\w*", name) for name in signals)
    for name in TLSF[2:]:
        for line in sections[name]:
            assert Grammar(line, r"[a-z]\w*", r"!|X|[FG](?:\[\d+:\d+\])?", r"&&|\|\||->|<->|U|R").accepts(), line
            assert set(re.findall(r"[a-z]\w*", line)) <= set(signals), line
            temporal = set(re.findall(r"\b[XFGUR]\b", line))
            assert name in TLSF[6:] or temporal <= ({"X"} if name in TLSF[4:6] else set()), line
    return sections


def slugs_sections(text: str) -> dict[str, list[str]]:
    """Return the lines of a document in slugs' structured form, which must keep its grammar, by section."""
    sections: dict[str, list[str]] = {}
    for line in text.splitlines():
        if line.startswith("["):
            sections[line.strip("[]")] = []
        elif line:
            sections[list(sections)[-1]].append(line)
    sides = [f"{side}_{part}" for part in ("INIT", "TRANS", "LIVENESS") for side in ("ENV", "SYS")]
    assert list(sections) == ["INPUT", "OUTPUT", *sides]
    counters = r"(?:ticks|left)_\d+"
    declared = {line.split(":")[0] for line in sections["INPUT"] + sections["OUTPUT"]}
    for line in sections["INPUT"] + sections["OUTPUT"]:
        assert re.fullmatch(rf"{counters}:0\.\.\.\d+|\w+", line)
    operand = rf"{counters}'? (?:=|>) (?:{counters} [+-] )?\d+|[a-z]\w*'?"
    for name in sides:
        for line in sections[name]:
            assert Grammar(line, operand, "!", r"&|\||->|<->").accepts(), line
            assert set(re.findall(r"[a-z]\w*", line)) <= declared, line
            assert name.endswith("TRANS") or "'" not in line, line
    primed = set(re.findall(r"(\w+)'", "\n".join(sections["ENV_TRANS"])))
    assert primed <= {line.split(":")[0] for line in sections["INPUT"]}
    return sections
