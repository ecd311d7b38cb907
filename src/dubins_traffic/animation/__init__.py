"""Trials as pixels: frames painted by a kernel, moving pictures in files, and a live page in the browser."""
