"""Trials configurations, problems and instances: their documents, and how instances are drawn."""
