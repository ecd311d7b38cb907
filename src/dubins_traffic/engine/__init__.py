"""Batches: many trials stepped together by compiled kernels, judged and scored."""
