"""The report of a campaign: statistics, plots, the worst trials; a page, tables and CSV."""
