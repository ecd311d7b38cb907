"""`python -m dubins_traffic.cli`: the command line without its script."""

from dubins_traffic.cli.main import main

if __name__ == "__main__":
    raise SystemExit(main())
