"""Tests; folders as those of src/slipsweep, and what they share in `support`."""
