"""Batches: many trials stepped together in one compiled pass, judged and scored."""
