"""The claims of the pages, each with the command that shows it and its stored result: docs/experiments.md."""
