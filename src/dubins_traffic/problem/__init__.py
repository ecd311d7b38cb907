"""What is to be solved: trials configurations, problems and instances, and how they are drawn."""
