"""The policy of the controller `lanes`: follows its path in the right lane with regard for other cars."""
