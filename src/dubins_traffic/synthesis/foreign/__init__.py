"""Strategies of other people's tools: read from their files, and followed on the road."""
