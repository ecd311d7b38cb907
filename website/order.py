"""Which pages the site shows under which heading, in their order; a test sees that no page is missing."""

from __future__ import annotations

TUTORIALS = (
    "tutorials/first-controller",
    "tutorials/lane-keeper",
    "tutorials/reading-a-verdict",
    "tutorials/campaign",
    "tutorials/ros",
    "tutorials/synthesis",
    "tutorials/learning",
    "tutorials/competition",
)
SECTIONS: dict[str, tuple[str, ...]] = {
    "Tutorials": TUTORIALS,
    "How to": (
        "tour",
        "attach",
        "python",
        "batches",
        "campaigns",
        "falsify",
        "suites",
        "maps",
        "foreign-strategies",
        "learning",
        "learning-agents",
        "gazebo",
        "gazebo-plugin",
        "external-worlds",
        "sandbox",
        "first-use",
        "competitions/participants",
        "competitions/organisers",
        "competitions/threat-model",
        "extending/index",
    ),
    "Reference": (
        "rules",
        "reference/command-line",
        "reference/api/index",
        "documents",
        "records",
        "scores",
        "verdicts",
        "competitions/file",
        "glossary",
        "stability",
        "changelog",
    ),
    "Explanation": (
        "task",
        "semantics",
        "shield",
        "theory",
        "architecture",
        "where",
        "design/index",
        "contributing",
        "benchmarks",
        "experiments",
    ),
    "Gallery and results": ("gallery", "results"),
}
"""Heading of the site: its pages."""
BELOW: dict[str, str] = {
    "extending/index": "extending",
    "design/index": "design",
    "reference/api/index": "reference/api",
}
"""Page: the folder whose other pages stand below it."""
ELSEWHERE = {"index", "package"}
"""Pages of docs/ that the site does not show: its own first page stands for them."""
