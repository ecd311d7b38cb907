"""The flat observation, a vector of numbers for learners, and the policies that learners have saved."""
