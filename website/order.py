"""Which pages the sidebar of the site shows under which heading, in their order.

The headings are those of docs/index.md. All other pages are reached from these: design notes, pages for whoever changes
the code, and those that one page alone is about. A test sees that the sidebar stays short and that no page is lost.
"""

from __future__ import annotations

SECTIONS: dict[str, tuple[str, ...]] = {
    "Start": (
        "tutorials/first-controller",
        "tutorials/lane-keeper",
        "tutorials/reading-a-verdict",
        "tour",
        "watch",
        "python",
        "gallery",
    ),
    "The task": ("task", "rules", "verdicts", "scores", "semantics", "theory"),
    "Drive": (
        "attach",
        "tutorials/ros",
        "shield",
        "tutorials/synthesis",
        "foreign-strategies",
        "tutorials/learning",
        "learning",
        "learning-agents",
        "sandbox",
        "gazebo",
    ),
    "Evaluate": (
        "tutorials/campaign",
        "campaigns",
        "batches",
        "suites",
        "baselines",
        "results",
        "falsify",
        "records",
    ),
    "Compete": ("tutorials/competition", "competitions/participants", "competitions/organisers"),
    "Reference": (
        "glossary",
        "documents",
        "maps",
        "reference/command-line",
        "reference/api/index",
        "extending/index",
    ),
}
"""Heading of the sidebar: its pages."""
LABELS: dict[str, str] = {
    "tutorials/first-controller": "Tutorial: first controller",
    "tutorials/lane-keeper": "Tutorial: a lane keeper",
    "tutorials/reading-a-verdict": "Tutorial: reading a verdict",
    "tutorials/ros": "Tutorial: ROS",
    "tutorials/synthesis": "Tutorial: synthesis",
    "tutorials/learning": "Tutorial: learning",
    "tutorials/campaign": "Tutorial: campaign",
    "tutorials/competition": "Tutorial: competition",
    "foreign-strategies": "Foreign strategies",
    "learning": "Learning",
}
"""Page: what the sidebar calls it, where that is not its heading."""
SHOWN = frozenset(name for names in SECTIONS.values() for name in names)
ELSEWHERE = {"index", "package"}
"""Pages of docs/ that the site does not show: its own first page stands for them."""
